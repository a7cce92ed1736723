"""How far a computation has come: what it tells its caller, and the line that shows it.

A computation calls ``progress(what, frequency_hz, done)``: what it is at, the excitation frequency
in Hz (0 where none applies), and which share of the whole is done, from 0 to 1 in proportion to
the time that it takes.
"""

from __future__ import annotations

import logging
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext

from nldyn.runtime.compilation import compilations

Progress = Callable[[str, float, float], None]

PAUSE = 0.1  # s, between two lines
SURE = 0.1  # share of the work after which the time that is left is told


def silent(what: str, frequency_hz: float, done: float) -> None:
    """Tell nobody."""


class Shares:
    """A computation of parts, each with a weight in proportion to the time that it takes.

    Parameters
    ----------
    tell : callable
        Called as ``tell(what, frequency_hz, done)``, with the share of the whole.
    weights : mapping of str to float, optional
        Weights of parts by their names; more can be added with `weigh`.

    Examples
    --------
    >>> whole = Shares(print, {"search": 1.0, "branches": 3.0})
    >>> whole.part("search")("search", 45.0, 1.0)
    search 45.0 0.25
    >>> whole.part("branches")("1/2", 50.0, 0.5)
    1/2 50.0 0.625
    """

    def __init__(self, tell: Progress, weights: Mapping[str, float] | None = None) -> None:
        self.tell = tell
        self._weights = dict(weights or {})
        self._done = dict.fromkeys(self._weights, 0.0)

    def __repr__(self) -> str:
        return f"<Shares: {len(self._weights)} parts, {self.done:.0%} done>"

    @property
    def done(self) -> float:
        """Share of the whole that is done."""
        total = math.fsum(self._weights.values())
        done = math.fsum(self._weights[name] * self._done[name] for name in self._weights)
        return done / total if total else 0.0

    def weigh(self, name: str, weight: float) -> None:
        """Give a part another weight, or add it: when its time is better known."""
        self._weights[name] = weight
        self._done.setdefault(name, 0.0)

    def part(self, name: str) -> Progress:
        """The function that a part calls with its own share done."""

        def tell(what: str, frequency_hz: float, done: float) -> None:
            self._done[name] = min(max(done, 0.0), 1.0)
            self.tell(what, frequency_hz, self.done)

        return tell

    def end(self, name: str) -> None:
        """Count a part as done."""
        self._done[name] = 1.0

    def counted(self, name: str, what: str) -> Callable[[int, int], None]:
        """The function that a part of many equal computations calls: ``(done, total)``."""
        tell = self.part(name)
        return lambda done, total: tell(f"{done} of {total} {what}", 0.0, done / max(total, 1))


class ProgressLine:
    """The line that a terminal shows while a computation lasts; nothing else is written.

    It tells how much is done, how long the rest will take, and what is being computed. The time
    left is told once a tenth is done; time spent compiling does not count.

    Parameters
    ----------
    quiet : bool
        Show nothing. Where the standard error output is no terminal nothing is shown anyway.

    Examples
    --------
    >>> line = ProgressLine(quiet=True)
    >>> line("1/2", 45.0, 0.5)
    >>> line.done
    0.5
    """

    def __init__(self, quiet: bool = False) -> None:
        self.shown = sys.stderr.isatty() and not quiet
        self.done = 0.0
        self._start = self._last = time.monotonic()
        self._last -= PAUSE
        self._first: float | None = None
        self._compiled = compilations.seconds()

    def __repr__(self) -> str:
        return f"<ProgressLine: {self.text('...', 0.0)}>"

    def __call__(self, what: str, frequency_hz: float, done: float) -> None:
        """Take the news of a computation, and show them if it is time."""
        if self._first is None:
            self._first = min(max(done, 0.0), 1.0)  # what an interrupted run had done
        self.done = max(self.done, min(done, 1.0))
        now = time.monotonic()
        if self.shown and now - self._last >= PAUSE:
            self._last = now
            self._write(self.text(what, frequency_hz))

    def left(self) -> float:
        """Time in s that the rest will take; NaN while that cannot be told."""
        first = self._first or 0.0
        own = self.done - first
        if own < SURE * (1.0 - first) or own <= 0.0:
            return math.nan
        compiling = compilations.seconds() - self._compiled
        spent = time.monotonic() - self._start - compiling
        return spent * (1.0 - self.done) / own

    def text(self, what: str, frequency_hz: float) -> str:
        """The line: how much is done, how long the rest will take, and what is computed."""
        minutes, seconds = divmod(int(time.monotonic() - self._start), 60)
        left = self.left()
        rest = "" if math.isnan(left) else f", about {duration(left)} left"
        where = f" at {frequency_hz:.2f} Hz" if frequency_hz else ""
        return f"{minutes:02d}:{seconds:02d}  {self.done:.0%} done{rest}: {what}{where}"

    def counted(self, what: str) -> Callable[[int, int], None]:
        """The function that many equal computations call as ``(done, total)``."""
        return lambda done, total: self(f"{done} of {total} {what}", 0.0, done / max(total, 1))

    def clear(self) -> None:
        """Remove the line."""
        if self.shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def _write(self, line: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        print(f"\r\x1b[K{line[:width]}", end="", file=sys.stderr, flush=True)


def duration(seconds: float) -> str:
    """A time as one says it.

    Examples
    --------
    >>> duration(3.2), duration(100.0), duration(4000.0)
    ('4 s', '2 min', '1.1 h')
    """
    if seconds < 60.0:
        return f"{math.ceil(seconds)} s"
    if seconds < 3600.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"


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
def progress_line(quiet: bool = False) -> Iterator[ProgressLine]:
    """Show a `ProgressLine` while a computation lasts, and remove it at the end.

    Compilations and what the package's logger is told are shown too, also where the standard error
    output is no terminal.

    Parameters
    ----------
    quiet : bool
        Show nothing.

    Yields
    ------
    ProgressLine
        To be called as ``report(what, frequency_hz, done)``.

    Examples
    --------
    >>> with progress_line(quiet=True) as report:
    ...     report("1/2", 45.0, 0.1)
    """
    report = ProgressLine(quiet)
    try:
        with compilations.silenced(quiet), nullcontext() if quiet else messages_shown():
            yield report
    finally:
        report.clear()
