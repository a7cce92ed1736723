"""``python -m nldyn`` is the command line."""

from nldyn.app.command import main

main()
