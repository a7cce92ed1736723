"""How long a search for an orbit may take."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from nldyn.engine.looking import looking
from nldyn.runtime.progress import Progress, silent


class OutOfTimeError(RuntimeError):
    """A search has taken as long as it may; the text says what it was at."""


class TimeLimit:
    """The processor time that a search may take, to within what Python does at a stretch.

    Parameters
    ----------
    seconds : float
        The time in s.
    frequency_hz : float
        Where the search is, for `progress`.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``, with the share of the time that is spent.

    Examples
    --------
    >>> limit = TimeLimit(60.0, 20.0, print)
    >>> limit.look("simulation from rest")  # doctest: +ELLIPSIS
    simulation from rest 20.0 ...
    """

    def __init__(
        self, seconds: float, frequency_hz: float, progress: Progress | None = None
    ) -> None:
        self.seconds = seconds
        self.frequency_hz = frequency_hz
        self.tell = progress or silent
        self._start = time.thread_time()
        self._looked = 0.0  # time spent at the last look
        self._what = "its start"  # what the search was at then

    def __repr__(self) -> str:
        return f"<TimeLimit: {self.spent:.3g} of {self.seconds:g} s spent>"

    @property
    def spent(self) -> float:
        """Processor time in s since the search began."""
        return time.thread_time() - self._start

    def look(self, what: str) -> None:
        """Tell what the search is at.

        Raises
        ------
        OutOfTimeError
            If the time is spent, or would be after as much as since the last look.
        """
        spent = self.spent
        if 2.0 * spent - self._looked > self.seconds:
            raise OutOfTimeError(what)
        self._looked, self._what = spent, what
        self.tell(what, self.frequency_hz, max(spent, 0.0) / self.seconds)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Let the time bound the block also where it lasts long between two looks.

        Raises
        ------
        OutOfTimeError
            From a call of the flow map in which the time is spent.
        """
        with looking(self._check):
            yield

    def _check(self) -> None:
        if self.spent > self.seconds:
            raise OutOfTimeError(self._what)
