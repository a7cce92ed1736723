"""How far a computation has come: what it tells its caller, and the line that shows it.

A computation calls ``progress(what, frequency_hz, done)``: what it is at, the excitation frequency
in Hz (0 where none applies), and which share of the whole is done, from 0 to 1 in proportion to
the time that it takes.
"""

from __future__ import annotations

import logging
import math
import multiprocessing
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import wraps
from importlib.util import find_spec
from typing import Any, ParamSpec, TypeVar

from tqdm import tqdm

Progress = Callable[[str, float, float], None]
P = ParamSpec("P")
R = TypeVar("R")

PAUSE = 0.1  # s, between two lines
PATIENCE = 2.0  # s, before a line appears that nobody asked for
SURE = 0.1  # share of the work after which the time that is left is told

_shown = 0  # lines of this process


def silent(what: str, frequency_hz: float, done: float) -> None:
    """Tell nobody."""


def silent_count(done: int, total: int) -> None:
    """Tell nobody of what is counted."""


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
    """The line that a terminal or a notebook shows while a computation lasts.

    It tells how much is done, how long the rest will take, and what is being computed. The time
    left is told once a tenth is done, from the pace of the last half of the time, so that it grows
    where the work stands still.

    Parameters
    ----------
    quiet : bool
        Show nothing. Where the standard error output is neither nothing is shown anyway.
    delay : float
        Time in s before it appears.

    Examples
    --------
    >>> line = ProgressLine(quiet=True)
    >>> line("1/2", 45.0, 0.5)
    >>> line.done
    0.5
    """

    def __init__(self, quiet: bool = False, delay: float = 0.0) -> None:
        self.done = 0.0
        self._start = time.monotonic()
        self._course: list[tuple[float, float]] = []  # time spent in s, and the share done by then
        hidden = quiet or not (sys.stderr.isatty() or in_notebook())
        self._bar = None if hidden else _bar(delay)

    def __repr__(self) -> str:
        return f"<ProgressLine: {self.done:.0%} done>"

    def __call__(self, what: str, frequency_hz: float, done: float) -> None:
        """Take the news of a computation, and show them if it is time; NaN for an unknown share."""
        share = 0.0 if math.isnan(done) else min(max(done, 0.0), 1.0)
        self.done = max(self.done, share)
        if not self._course or self.done > self._course[-1][1]:
            self._course.append((self._spent(), self.done))
        if self._bar is not None:
            self._bar.set_description_str(self.text(what, frequency_hz), refresh=False)
            self._bar.update(self.done - self._bar.n)

    def _spent(self) -> float:
        return time.monotonic() - self._start

    def left(self) -> float:
        """Time in s that the rest will take; NaN while that cannot be told."""
        if not self._course:
            return math.nan
        begin, first = self._course[0]  # what an interrupted run had done
        now = self._spent()
        middle = 0.5 * (begin + now)
        since, before = [place for place in self._course if place[0] <= middle][-1]
        recent = self.done - before
        if self.done - first < SURE * (1.0 - first) or recent <= 0.0:
            return math.nan
        return (now - since) * (1.0 - self.done) / recent

    def text(self, what: str, frequency_hz: float) -> str:
        """How long the rest will take, and what is computed."""
        left = self.left()
        rest = "" if math.isnan(left) else f"about {duration(left)} left: "
        where = f" at {frequency_hz:.2f} Hz" if frequency_hz else ""
        return f"{rest}{what}{where}"

    def counted(self, what: str) -> Callable[[int, int], None]:
        """The function that many equal computations call as ``(done, total)``."""
        return lambda done, total: self(f"{done} of {total} {what}", 0.0, done / max(total, 1))

    def clear(self) -> None:
        """Remove the line."""
        if self._bar is not None:
            self._bar.close()


def _bar(delay: float) -> Any:
    """A bar on stderr, by widgets where a notebook has them."""
    kind: Any = tqdm
    width: int | None = shutil.get_terminal_size().columns - 1
    if in_notebook() and find_spec("ipywidgets") is not None:
        from tqdm.notebook import tqdm_notebook

        kind, width = tqdm_notebook, None
    return kind(
        total=1.0, leave=False, delay=delay, mininterval=PAUSE, miniters=0, file=sys.stderr,
        ncols=width, bar_format="{elapsed} {percentage:3.0f} % done |{bar:16}| {desc}",
    )  # fmt: skip


def in_notebook() -> bool:
    """Whether a kernel of Jupyter runs this."""
    shell = sys.modules.get("IPython")
    running = shell.get_ipython() if shell is not None else None
    return running is not None and "IPKernelApp" in running.config


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
    global _shown
    report = ProgressLine(quiet)
    _shown += 1
    try:
        with nullcontext() if quiet else messages_shown():
            yield report
    finally:
        _shown -= 1
        report.clear()


def shows_progress(
    adapted: Callable[[ProgressLine], Callable[..., None]] = lambda line: line,
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function with a ``progress`` show a line of its own where it is given none.

    The line appears after two seconds, in a terminal or a notebook; within another one, in
    a thread and in a worker process there is none.

    Parameters
    ----------
    adapted : callable
        Makes of the line what the function takes as ``progress``.

    Examples
    --------
    >>> @shows_progress()
    ... def work(progress=None):
    ...     progress("half", 0.0, 0.5)
    >>> work()
    >>> work(progress=print)
    half 0.0 0.5
    """

    def showing(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            global _shown
            if kwargs.get("progress") is not None or _shown or not _at_the_front():
                return function(*args, **kwargs)
            line = ProgressLine(delay=PATIENCE)
            _shown += 1
            try:
                kwargs["progress"] = adapted(line)
                return function(*args, **kwargs)
            finally:
                _shown -= 1
                line.clear()

        return call

    return showing


def _at_the_front() -> bool:
    """Whether this is the thread and the process that a user looks at."""
    main = threading.current_thread() is threading.main_thread()
    return main and multiprocessing.parent_process() is None


def of_number(what: str) -> Callable[[ProgressLine], Callable[[int, int], None]]:
    """For `shows_progress`: what tells how many of so many are done."""
    return lambda line: line.counted(what)


def of_value(what: str) -> Callable[[ProgressLine], Callable[[float], None]]:
    """For `shows_progress`: what tells the value of the parameter that it is at."""
    return lambda line: lambda value: line(f"{what} at {value:.6g}", 0.0, math.nan)


def of_place(what: str) -> Callable[[ProgressLine], Callable[..., None]]:
    """For `shows_progress`: what tells the values of the parameters that it is at."""

    def adapted(line: ProgressLine) -> Callable[..., None]:
        def tell(place: Iterable[float]) -> None:
            line(f"{what} at " + ", ".join(f"{value:.6g}" for value in place), 0.0, math.nan)

        return tell

    return adapted
