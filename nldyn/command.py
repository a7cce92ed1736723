"""The command ``nldyn``, started so that Ctrl-C is answered in one line from the first moment.

It imports nothing large before it can answer.
"""

from __future__ import annotations

import sys

INTERRUPTED = 130
STOPPED = "nldyn: stopped by Ctrl-C, nothing is written"


def main() -> None:
    """Load the command line and run it."""
    try:
        from nldyn.cli import main as command

        command(prog_name="nldyn")
    except SystemExit:
        raise
    except BaseException as error:
        if not interrupted(error):
            raise
        print(STOPPED, file=sys.stderr)
        sys.exit(INTERRUPTED)


def interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: compiled code and imports wrap it in others."""
    if error is None or isinstance(error, KeyboardInterrupt):
        return error is not None
    return interrupted(error.__cause__ or error.__context__)
