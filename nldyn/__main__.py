"""``python -m nldyn`` is the command line."""

from nldyn.cli import main

main(prog_name="nldyn")
