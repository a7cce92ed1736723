"""Ctrl-C behind other errors: imports wrap it, callbacks from C swallow it."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from nldyn.base.exit_codes import INTERRUPTED

STOPPED = "nldyn: stopped by Ctrl-C, nothing is written"

SOON = 0.2
"""Seconds after which a Ctrl-C that was swallowed is tried again."""

_swallowed = threading.Event()


def interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error.

    Examples
    --------
    >>> interrupted(KeyboardInterrupt()), interrupted(ValueError())
    (True, False)
    """
    if error is None or isinstance(error, KeyboardInterrupt):
        return error is not None
    return _swallowed.is_set() or interrupted(error.__cause__ or error.__context__)


@contextmanager
def ignored_interruption() -> Iterator[None]:
    """Let Ctrl-C have no effect in the block, nor on the processes that are started in it.

    In the main thread, and if Python sets its handler.

    Examples
    --------
    >>> with ignored_interruption():
    ...     signal.raise_signal(signal.SIGINT)
    """
    usual = signal.getsignal(signal.SIGINT)
    if usual is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)


def heed_swallowed() -> None:
    """Let no Ctrl-C be lost that falls into a callback or destructor, whose errors Python drops.

    Whatever error follows stands for the Ctrl-C, and where none follows it comes again.
    """
    usual = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            usual(unraisable)
            return
        _swallowed.set()
        again = threading.Timer(SOON, _thread.interrupt_main)
        again.daemon = True
        again.start()

    sys.unraisablehook = hook


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
