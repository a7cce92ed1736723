"""``python -m nldyn`` is the command line."""

from nldyn_command import main

main()
