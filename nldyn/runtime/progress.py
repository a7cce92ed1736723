"""What is being computed, shown while it lasts."""

from __future__ import annotations

import logging
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

Progress = Callable[[str, float], None]

TERMINAL_PAUSE, FILE_PAUSE = 0.1, 60.0  # s
COMPILING = "compiling, about 20 s the first time"


@contextmanager
def compilation_told(tell: Progress) -> Iterator[None]:
    """Report numba's compilations, which take a while but leave nothing to do at later starts.

    Code that is read from numba's cache is not reported.

    Examples
    --------
    >>> import numba
    >>> with compilation_told(lambda what, frequency_hz: print(what)):
    ...     numba.njit(lambda x: x + 1)(1)
    compiling, about 20 s the first time
    2
    """
    from numba.core import event

    class Teller(event.Listener):
        def on_start(self, _: object) -> None:
            tell(COMPILING, 0.0)

        def on_end(self, _: object) -> None:
            pass

    with event.install_listener("numba:compile", Teller()):
        yield


@contextmanager
def messages_shown() -> Iterator[None]:
    """Show on stderr what the package's logger is told: the solver, its memory, modes chosen."""
    logger = logging.getLogger("nldyn")
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("\r\x1b[K%(message)s" if sys.stderr.isatty() else None))
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)


@contextmanager
def progress_line(quiet: bool = False) -> Iterator[Progress]:
    """Count the orbits on stderr and say what is being computed.

    A terminal gets one line that is written over; anything else gets a line a minute.

    Parameters
    ----------
    quiet : bool
        Show nothing.

    Yields
    ------
    callable
        To be called as ``report(what, frequency_hz)`` at every orbit; the frequency is 0 where
        none applies.

    Examples
    --------
    >>> with progress_line(quiet=True) as report:
    ...     report("1/2", 45.0)
    """
    terminal = sys.stderr.isatty()
    pause = TERMINAL_PAUSE if terminal else FILE_PAUSE
    start = time.monotonic()
    shown = start - pause if terminal else start
    orbits = 0

    def report(what: str, frequency_hz: float) -> None:
        nonlocal orbits, shown
        orbits += bool(frequency_hz) and "search" not in what
        now = time.monotonic()
        if quiet or now - shown < pause:
            return
        shown = now
        minutes, seconds = divmod(int(now - start), 60)
        where = f" at {frequency_hz:.2f} Hz" if frequency_hz else ""
        line = f"{minutes:02d}:{seconds:02d}  {orbits} orbits, {what}{where}"
        if terminal:
            line = f"\r\x1b[K{line[: shutil.get_terminal_size().columns - 1]}"
        print(line, end="" if terminal else "\n", file=sys.stderr, flush=True)

    try:
        with compilation_told(report), nullcontext() if quiet else messages_shown():
            yield report
    finally:
        if terminal and not quiet:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
