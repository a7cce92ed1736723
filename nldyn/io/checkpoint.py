"""What a running continuation has found, kept in a file so that nothing is lost if it ends early.

The file is written anew each time, whole or not at all, and not more often than a twentieth of
the time allows. A computation does not end because its file cannot be written, on a full disk for
instance: a warning says so, and it is tried again later.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Generic, Self, TypeVar

import numpy as np

from nldyn.base.errors import SystemModelError
from nldyn.flow.flow_map import same_flow
from nldyn.runtime.files import check_writable
from nldyn.runtime.result_directory import OutputError

if TYPE_CHECKING:
    from nldyn.branches.branch import Branch, Course
    from nldyn.flow.flow_map import FlowMap
    from nldyn.orbits.orbit import Orbit
    from nldyn.search.tally import Tally
    from nldyn.system.system import System

Kept = TypeVar("Kept")
Item = TypeVar("Item")

PAUSE = 5.0  # s, at least, between two writings
SHARE = 20.0  # times as long as it took to write


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


class Checkpoint(Keeper["Branch"]):
    """Keeps branches.

    Parameters
    ----------
    write, finished, earlier
        As for `Keeper`.
    strict : str
        Name of the file, if it shall hold nothing but the computation asked for.
    held : list, optional
        Branches of the file that stay there: those known otherwise, see `new_branches`, and at the
        end those that were not asked for.

    Attributes
    ----------
    tally : Tally or None
        How far a search has come that is kept with its branches.
    """

    def __init__(
        self,
        write: Callable[[Sequence[Branch]], None] | None = None,
        finished: list[Branch] | None = None,
        earlier: Sequence[Branch] = (),
        strict: str = "",
        held: list[Branch] | None = None,
    ) -> None:
        super().__init__(write, finished, earlier)
        self.tally: Tally | None = None
        self._strict = strict
        self._held = [] if held is None else held

    def __exit__(self, error: type[BaseException] | None, *rest: object) -> None:
        if error is None:
            self._held += self._earlier
        super().__exit__(error, *rest)

    def branch_from(self, orbit: Orbit, *courses: Course) -> Branch | None:
        """Take from the file the branch that was begun at an orbit with one of some courses.

        The first of them counts most.

        Raises
        ------
        SystemModelError
            If the file is strict and holds something else.
        """
        for course in courses:
            for number, branch in enumerate(self._earlier):
                if _is_begun_at(branch, orbit, course):
                    return self._taken(number)
        if self._strict and self._earlier:
            raise SystemModelError(
                f"{self._strict}: holds another continuation (other system, start, range or "
                "options); choose another file, or delete it"
            )
        return None

    def new_branches(self, is_known: Callable[[Branch], bool]) -> Iterator[Branch]:
        """Take from the file one branch after the other, but for those known, which stay there."""
        while self._earlier:
            if is_known(self._earlier[0]):
                self._held.append(self._earlier[0])
                del self._earlier[0]
            else:
                yield self._taken(0)

    def _taken(self, number: int) -> Branch:
        """A branch of the file, which counts as the one at work from now on."""
        branch = self._earlier[number]
        self.work = lambda: branch
        del self._earlier[number]
        return branch


def checkpoint_at(
    place: str | Path | Checkpoint | None,
    system: System,
) -> AbstractContextManager[Checkpoint]:
    """The checkpoint of one continuation of a system in a file; one that keeps nothing for None.

    One that is given is left to the giver to end.

    Raises
    ------
    SystemModelError
        If the file exists but is not one of branches.
    OutputError
        If it cannot be written.
    """
    if isinstance(place, Checkpoint):
        return nullcontext(place)
    if place is None:
        return Checkpoint()
    write, earlier, _ = _file(place, system)
    return Checkpoint(write, earlier=earlier, strict=str(place))


def checkpoint_of_several(
    place: str | Path | None,
    finished: list[Branch],
    flow: FlowMap,
    range_hz: tuple[float, float],
) -> Checkpoint:
    """The checkpoint of a computation of several branches of a system, added to a list.

    Those that are in the list already are not kept.

    Raises
    ------
    SystemModelError, OutputError
        As `checkpoint_at`; also for branches of another system or range in the file.
    """
    if place is None:
        return Checkpoint()
    write, earlier, tally = _file(place, flow.system)
    for branch in earlier:
        same_range = branch.course is not None and branch.course.range_hz == range_hz
        if not (same_range and same_flow(branch.points[0].problem.flow, flow)):
            raise SystemModelError(
                f"{place}: holds branches of another system, accuracy or range; choose another "
                "file, or delete it"
            )
    known = len(finished)
    held: list[Branch] = []
    written = bool(earlier or tally)

    def write_new(branches: Sequence[Branch]) -> None:
        nonlocal written
        if written or len(branches) > known or checkpoint.tally:
            write([*held, *branches[known:]], checkpoint.tally)
            written = True

    checkpoint = Checkpoint(write_new, finished, earlier, held=held)
    checkpoint.tally = tally
    return checkpoint


def _file(
    place: str | Path, system: System
) -> tuple[Callable[..., None], list[Branch], Tally | None]:
    """What writes a file, the branches of a system in it, and how far a search in it has come."""
    from nldyn.io.branches import load_bare_branches, save_branches
    from nldyn.io.flow import laws_of

    path = check_writable(place)
    read = partial(load_bare_branches, laws=laws_of(system))
    branches, tally = begun_before(read, path) if path.exists() else ([], None)
    return partial(save_branches, path), branches, tally


def begun_before(read: Callable[[Path], Kept], path: Path) -> Kept:
    """Read what an earlier run kept; the error of a file that cannot be read says what helps."""
    try:
        return read(path)
    except SystemModelError as error:
        advice = "choose another file, or delete it to begin anew"
        raise SystemModelError(f"{error}; {advice}") from error


def _is_begun_at(branch: Branch, orbit: Orbit, course: Course) -> bool:
    """Whether a branch comes from a continuation of an orbit with the same range and options."""
    mine = branch.course
    if mine is None or branch.period != orbit.period:
        return False
    start = branch.nodes[mine.start].orbit
    return (
        np.array_equal(start.point, orbit.point)
        and start.observe == orbit.observe
        and mine.range_hz == course.range_hz
        and mine.options == course.options
        and np.array_equal(mine.open_ends, course.open_ends)
        and start.problem.segments == orbit.problem.segments
        and same_flow(start.problem.flow, orbit.problem.flow)
    )
