"""What sliding bifurcations mean: at which contact what begins, told by orbits on both sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nldyn.bifurcations.kinds import ADDING_SLIDING, CROSSING_SLIDING, GRAZING_SLIDING
from nldyn.bifurcations.point import BranchNode, SpecialPoint, node_of
from nldyn.bifurcations.sliding import Birth, born, sticks, watched, words
from nldyn.orbits.bordered import FREE, correct
from nldyn.system.naming import slider_name

BESIDE = (1e-4, 1e-3, 1e-5)  # arclength of these orbits
WHAT = {
    CROSSING_SLIDING: "its friction just holds what turns",
    GRAZING_SLIDING: "the speed of sliding just falls to zero",
    ADDING_SLIDING: "what sticks just needs all its friction",
}
HOW_OFTEN = {-1: "all the time", 0: "never", 1: "once", 2: "twice"}


@dataclass(frozen=True)
class Change:
    """What begins at a sliding bifurcation at one of `System.rubbing`.

    Parameters
    ----------
    number : int
        Which one.
    birth : Birth
        What it is, on an orbit beside the point.
    without, with_it : int
        How often it sticks in a period on either side; -1 for all the time.
    side : int
        1 where it begins at larger values of the parameter, -1 at smaller ones.
    stable : bool
        Whether the orbit with it is stable.
    """

    number: int
    birth: Birth
    without: int
    with_it: int
    side: int
    stable: bool


def changes_at(special: SpecialPoint) -> list[Change]:
    """What begins at a sliding bifurcation, by orbits of its branch; none if they do not tell."""
    for way in BESIDE:
        sides = [_beside(special.point, step) for step in (-way, way)]
        pair = [side for side in sides if side is not None]
        changes = [_change(special, pair, k) for k in watched(special.orbit.system) if pair[1:]]
        found = [change for change in changes if change is not None]
        if found:
            return found
    return []


def _beside(point: BranchNode, step: float) -> BranchNode | None:
    """The orbit at an arclength from a point, if there is one."""
    row = point.weights * point.tangent
    guess = point.point + step * point.tangent
    found = correct(point.family, guess, FREE, row, like=point.orbit.motion)
    return node_of(found, point.tangent, point.arclength + step) if found.converged else None


def _change(special: SpecialPoint, sides: Sequence[BranchNode], number: int) -> Change | None:
    """What begins at one that rubs between orbits on both sides."""
    bare, rich = sorted(sides, key=lambda side: len(words(side.orbit)[number]))
    without, with_it = words(bare.orbit)[number], words(rich.orbit)[number]
    birth = born(without, with_it) if sticks(without) != sticks(with_it) else None
    if birth is None or birth.kind != special.kind:
        return None
    side = int(np.sign(rich.value - special.value))
    return Change(number, birth, sticks(without), sticks(with_it), side, rich.orbit.stable)


def told(special: SpecialPoint, changes: Sequence[Change]) -> str:
    """What happens at which contacts, in words."""
    if not changes:
        return "the motion begins or ceases to stick; orbits beside it do not tell where"
    return "; ".join(_told(special, change) for change in changes)


def _told(special: SpecialPoint, change: Change) -> str:
    """The same at one contact: what, when, and how often it sticks on both sides."""
    orbit = special.orbit
    times = sorted(1e3 * each.phase / orbit.omega for each in change.birth.stretches)
    where = ", ".join(f"{time:.4g} ms" for time in times)
    here, there = ("above", "below") if change.side > 0 else ("below", "above")
    often = [HOW_OFTEN.get(n, f"{n} times") for n in (change.with_it, change.without)]
    return (
        f"{slider_name(orbit.system, change.number)} ({where}): {WHAT[special.kind]}; "
        f"it sticks {often[0]} in a period {here} {special.place()}, and {often[1]} {there} it"
    )
