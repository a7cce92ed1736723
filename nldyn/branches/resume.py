"""A branch goes on where its continuation stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from nldyn.base.errors import SystemModelError, check_range
from nldyn.branches.at_frequency import check_requested
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import complete, split
from nldyn.branches.options import ContinuationOptions
from nldyn.io.checkpoint import Checkpoint, checkpoint_at


def extend(
    branch: Branch,
    range_hz: tuple[float, float] | None = None,
    options: ContinuationOptions | None = None,
    at: Sequence[float] | None = None,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | Path | Checkpoint | None = None,
) -> Branch:
    """Finish or extend a branch; see `Branch.extend`."""
    course = branch.course
    if course is None:
        raise SystemModelError(
            f"branch '{branch.name}' cannot be extended: it does not tell how it was continued"
        )
    low, high = check_range(course.range_hz if range_hz is None else range_hz)
    if not low <= course.range_hz[0] < course.range_hz[1] <= high:
        raise SystemModelError(
            f"range_hz = ({low:g}, {high:g}) must contain the range of the branch, "
            f"({course.range_hz[0]:g}, {course.range_hz[1]:g})"
        )
    new = replace(
        course,
        range_hz=(low, high),
        options=options or course.options,
        at=check_requested(course.at if at is None else at, (low, high)),
    )
    with checkpoint_at(checkpoint, branch.points[0].system) as kept:
        known = kept.branch_from(branch.points[course.start], new, course)
        if known is not None and known.course is not None and known.course.range_hz == (low, high):
            branch, course = known, known.course  # this very extension was begun before
        forward, backward = split(branch, course)
        start = branch.nodes[course.start]
        return complete(branch.name, forward, backward, start, new, progress, kept)
