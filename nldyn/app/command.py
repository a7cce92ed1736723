"""The command ``nldyn``, started so that Ctrl-C is answered in one line from the first moment.

It imports nothing large before it can answer.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable

from nldyn.runtime.interruption import heed_swallowed, interrupted

INTERRUPTED = 130
STOPPED = "nldyn: stopped by Ctrl-C, nothing is written"


def main() -> None:
    """Load the command line and run it."""
    answering(_command_line)


def _command_line() -> None:
    from nldyn.app.cli import main as command

    command(prog_name="nldyn")


def answering(work: Callable[[], None]) -> None:
    """Do the work of a process; Ctrl-C ends it with one line and exit code 130."""
    heed_swallowed()
    try:
        work()
    except SystemExit:
        raise
    except BaseException as error:
        if not interrupted(error):
            raise
        print(STOPPED, file=sys.stderr)
        sys.exit(INTERRUPTED)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is left is to end
        # a Ctrl-C that left an exec of text, as in the making of a dataclass, lets ``python -m``
        # end by the signal whatever the exit code; another exec makes it forget that
        exec("")
