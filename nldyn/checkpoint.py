"""What a running continuation has found, kept in a file so that nothing is lost if it ends early.

The file is written anew each time, whole or not at all, and not more often than a twentieth of
the time allows.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nldyn.errors import SystemModelError

if TYPE_CHECKING:
    from nldyn.branch import Branch, Course
    from nldyn.orbit import Orbit

PAUSE = 5.0  # s, at least, between two writings
SHARE = 20.0  # times as long as it took to write


class Checkpoint:
    """A file with the finished branches of a computation and the one at work.

    Parameters
    ----------
    write_branches : callable, optional
        Writes a list of branches; nothing is kept without it.
    finished : list of Branch
        Branches to be kept besides; the caller may add more.
    earlier : sequence of Branch
        What the file held before.
    strict : str
        Name of the file, if it shall hold nothing but the computation asked for.
    """

    def __init__(
        self,
        write_branches: Callable[[Sequence[Branch]], None] | None = None,
        finished: list[Branch] | None = None,
        earlier: Sequence[Branch] = (),
        strict: str = "",
    ) -> None:
        self._write = write_branches
        self._finished = [] if finished is None else finished
        self._earlier = earlier
        self._strict = strict
        self._due = time.monotonic() + PAUSE

    def branch_from(self, orbit: Orbit, course: Course) -> Branch | None:
        """The branch in the file that was begun at an orbit in the same way.

        Raises
        ------
        SystemModelError
            If the file is strict and holds something else.
        """
        for branch in self._earlier:
            if _is_begun_at(branch, orbit, course):
                return branch
        if self._strict and self._earlier:
            raise SystemModelError(
                f"{self._strict}: holds another continuation (other system, start, range or "
                "options); choose another file, or delete it"
            )
        return None

    def offer(self, whole: Callable[[], Branch | None]) -> None:
        """Write, if it is time, what a function gives."""
        if self._write is not None and time.monotonic() >= self._due:
            self.write(whole())

    def write(self, branch: Branch | None) -> None:
        """Write the finished branches and one more."""
        if self._write is None or branch is None:
            return
        start = time.monotonic()
        self._write([*self._finished, branch])
        end = time.monotonic()
        self._due = end + max(PAUSE, SHARE * (end - start))

    @contextmanager
    def at_failure(self, whole: Callable[[], Branch | None]) -> Iterator[None]:
        """Write what a function gives if the work ends with an exception, also with Ctrl-C."""
        try:
            yield
        except BaseException:
            self.write(whole())
            raise


def checkpoint_at(place: str | Path | Checkpoint | None) -> Checkpoint:
    """The checkpoint of one continuation in a file; one that keeps nothing for None.

    Raises
    ------
    SystemModelError
        If the file exists but is not one of branches.
    OutputError
        If it cannot be written.
    """
    if isinstance(place, Checkpoint):
        return place
    if place is None:
        return Checkpoint()
    from nldyn.store import check_writable, load_branches, save_branches

    path = check_writable(place)
    earlier = load_branches(path) if path.exists() else []
    return Checkpoint(lambda branches: save_branches(path, branches), None, earlier, str(place))


def checkpoint_of_several(place: str | Path | None, finished: list[Branch]) -> Checkpoint:
    """The checkpoint of a computation of several branches, which adds them to a list.

    Branches in the file that it does not ask for are dropped.

    Raises
    ------
    SystemModelError, OutputError
        As `checkpoint_at`.
    """
    if place is None:
        return Checkpoint()
    from nldyn.store import check_writable, load_branches, save_branches

    path = check_writable(place)
    earlier = load_branches(path) if path.exists() else []
    return Checkpoint(lambda branches: save_branches(path, branches), finished, earlier)


def _is_begun_at(branch: Branch, orbit: Orbit, course: Course) -> bool:
    """Whether a branch comes from a continuation of an orbit with the same range and options."""
    from nldyn.store import same_flow

    mine = branch.course
    if mine is None or branch.period != orbit.period:
        return False
    start = branch.nodes[mine.start].orbit
    return (
        np.array_equal(start.point, orbit.point)
        and start.observe == orbit.observe
        and mine.range_hz == course.range_hz
        and mine.options == course.options
        and len(mine.open_ends) == len(course.open_ends)
        and all(map(np.array_equal, mine.open_ends, course.open_ends))
        and start.problem.segments == orbit.problem.segments
        and same_flow(start.problem.flow, orbit.problem.flow)
    )
