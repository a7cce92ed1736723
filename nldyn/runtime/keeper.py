"""What a running computation has found, kept in a file so that nothing is lost if it ends early.

The file is written anew each time, whole or not at all, and not more often than a twentieth of
the time allows. A computation does not end because its file cannot be written, on a full disk for
instance: a warning says so, and it is tried again later.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Generic, Protocol, Self, TypeVar

from nldyn.base.errors import KeptWorkError, SystemModelError
from nldyn.runtime.result_directory import OutputError

Kept = TypeVar("Kept")
Item = TypeVar("Item")
PAUSE = 5.0  # s, at least, between two writings
SHARE = 20.0  # times as long as it took to write


class KeptFile(Protocol):
    """A file that keeps unfinished work."""

    @property
    def name(self) -> str:
        """How messages call it."""

    def exists(self) -> bool:
        """Whether an earlier run has written it."""

    def check_writable(self) -> None:
        """Raise an `OutputError` if it cannot be written."""


class Keeper(Generic[Item]):
    """A file with the finished parts of a computation and the one at work.

    As a context it writes the file at the end, also when an exception such as Ctrl-C ends the work.

    Parameters
    ----------
    write : callable, optional
        Writes a list of parts; nothing is kept without it.
    finished : list, optional
        Parts to be kept besides; the caller may add more.
    earlier : sequence
        What the file held before.

    Attributes
    ----------
    work : callable or None
        Gives the part at work, as far as it is known.
    """

    def __init__(
        self,
        write: Callable[[Sequence[Item]], None] | None = None,
        finished: list[Item] | None = None,
        earlier: Sequence[Item] = (),
    ) -> None:
        self.work: Callable[[], Item | None] | None = None
        self._write = write
        self._finished = [] if finished is None else finished
        self._earlier = list(earlier)
        self._due = time.monotonic() + PAUSE
        self._failed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is None:
            self._earlier.clear()
        if self.work or self._finished:
            self.write()

    def offer(self) -> None:
        """Write, if it is time."""
        if self._write is not None and time.monotonic() >= self._due:
            self.write()

    def write(self) -> None:
        """Write what is finished, what is at work, and what the file held and is not yet used."""
        if self._write is None:
            return
        start = time.monotonic()
        part = self.work() if self.work else None
        try:
            self._write([*self._finished, *([part] if part else []), *self._earlier])
        except OutputError as error:
            if not self._failed:
                warnings.warn(f"{error}; the computation goes on without it", stacklevel=2)
            self._failed = True
        end = time.monotonic()
        self._due = end + max(PAUSE, SHARE * (end - start))


def begun_before(read: Callable[[Path], Kept], path: Path) -> Kept:
    """Read what an earlier run kept; the error of a file that cannot be read says what helps."""
    try:
        return read(path)
    except SystemModelError as error:
        advice = "choose another file, or delete it to begin anew"
        raise KeptWorkError(f"{error}; {advice}") from error
