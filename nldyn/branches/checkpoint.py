"""Branches of a running continuation or search, kept in a file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from nldyn.base.errors import KeptWorkError
from nldyn.branches.branch import Branch, Course
from nldyn.flow.flow_map import FlowMap, same_flow
from nldyn.orbits.axis import Axis
from nldyn.orbits.bordered import Place
from nldyn.runtime.keeper import Keeper, KeptFile
from nldyn.system.system import System


@dataclass(frozen=True)
class Tally:
    """What a search beside known branches has tried.

    Parameters
    ----------
    question : str
        Which search it is: its way, its numbers, and the branches it began with.
    given : int
        How many branches were known of the periods and frequencies wanted.
    known : int
        How many branches there were when the last of the frequencies done had been searched.
    done : int
        Frequencies that are done.
    tried, came : int
        How many guesses there were at these, and how many led to an orbit.
    met : frozenset of int
        Branches known that guesses led to which were made of others of them.
    """

    question: str
    given: int
    known: int
    done: int = 0
    tried: int = 0
    came: int = 0
    met: frozenset[int] = frozenset()


class BranchFile(KeptFile, Protocol):
    """A file of branches; `nldyn.io.CheckpointFile` is one.

    For developers: whatever else keeps branches has these methods.
    """

    def read_branches(self, system: System) -> tuple[list[Branch], Tally | None]:
        """The branches of a system that it holds, and how far a search has come; none if new."""

    def write_branches(self, branches: Sequence[Branch], tally: Tally | None = None) -> None:
        """Keep these in place of what it holds."""


class Checkpoint(Keeper[Branch]):
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

    def branch_from(self, place: Place, *courses: Course) -> Branch | None:
        """Take from the file the branch that was begun at an orbit with one of some courses.

        The first of them counts most.

        Raises
        ------
        KeptWorkError
            If the file is strict and holds something else.
        """
        for course in courses:
            for number, branch in enumerate(self._earlier):
                if _is_begun_at(branch, place, course):
                    return self._taken(number)
        if self._strict and self._earlier:
            raise KeptWorkError(
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
    place: BranchFile | Checkpoint | None,
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
    place.check_writable()
    earlier, _ = place.read_branches(system)
    return Checkpoint(place.write_branches, earlier=earlier, strict=place.name)


def checkpoint_of_several(
    place: BranchFile | None,
    finished: list[Branch],
    flow: FlowMap,
    axis: Axis,
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
    place.check_writable()
    earlier, tally = place.read_branches(flow.system)
    for branch in earlier:
        same_range = branch.course is not None and branch.course.limits == axis.limits
        same = same_flow(branch.nodes[0].family.problem.flow, flow)
        if not (same_range and same and axis.is_along(branch.nodes[0])):
            raise KeptWorkError(
                f"{place.name}: holds branches of another system, accuracy or range; choose "
                "another file, or delete it"
            )
    known = len(finished)
    held: list[Branch] = []
    written = bool(earlier or tally)

    def write_new(branches: Sequence[Branch]) -> None:
        nonlocal written
        if written or len(branches) > known or checkpoint.tally:
            place.write_branches([*held, *branches[known:]], checkpoint.tally)
            written = True

    checkpoint = Checkpoint(write_new, finished, earlier, held=held)
    checkpoint.tally = tally
    return checkpoint


def _is_begun_at(branch: Branch, place: Place, course: Course) -> bool:
    """Whether a branch comes from a continuation of an orbit with the same range and options."""
    mine = branch.course
    if mine is None or branch.period != place.orbit.period:
        return False
    start = branch.nodes[mine.start]
    problem, own = start.family.problem, place.family.problem
    return (
        np.array_equal(start.point, place.point)
        and start.orbit.observe == place.orbit.observe
        and start.family.scales == place.family.scales
        and start.family.holds(place.orbit)
        and mine.ranges == course.ranges
        and mine.options == course.options
        and np.array_equal(mine.open_ends, course.open_ends)
        and problem.segments == own.segments
        and same_flow(problem.flow, own.flow)
    )
