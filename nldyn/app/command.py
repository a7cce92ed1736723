"""The command ``nldyn``, started so that Ctrl-C is answered in one line from the first moment.

It imports nothing large before it can answer.
"""

from __future__ import annotations

from nldyn.runtime.interruption import answering


def main() -> None:
    """Load the command line and run it."""
    answering(_command_line)


def _command_line() -> None:
    from nldyn.app.cli import main as command

    command(prog_name="nldyn")
