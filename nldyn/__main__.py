"""``python -m nldyn`` is the command line."""

from nldyn.command import main

main()
