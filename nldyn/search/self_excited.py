"""Branches of motions that nothing excites: simulated until they settle, solved for, followed."""

from __future__ import annotations

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.orbits.limit_cycle import limit_cycle
from nldyn.search.collector import Collector
from nldyn.search.outlook import SEARCH
from nldyn.system.equilibrium import at_rest, rest
from nldyn.system.system import System

NOT_FOLLOWED = "PD", "BP", "NS"  # special points from which other limit cycles, or tori, branch off


def follow_limit_cycles(box: Collector, values: list[float], start: Real | None) -> None:
    """Follow the limit cycles to which motions lead at some values; note where none was found."""
    failures: dict[float, str] = {}
    for number, value in enumerate(values, 1):
        box.tell(SEARCH, value)
        here = box.at(value).flow
        starts = starts_of(here.system) if start is None else [start]
        reasons = []
        for state in starts:
            try:
                cycle = limit_cycle(here, state, observe=box.observe)
            except ConvergenceError as error:
                reasons.append(str(error))
            else:
                box.from_orbits([cycle])
        if len(reasons) == len(starts):
            failures[value] = reasons[-1]
        box.reach(SEARCH, number)
    for branch in box.branches:  # which become more
        box.from_mirror(branch, box.options)
    _note_branches_not_followed(box)
    _note_failures(box, failures)


def starts_of(system: System) -> list[Real]:
    """Modal states (2n,): at rest, and carried along by all that moves beneath friction."""
    still = at_rest(rest(system))
    moving = [
        (system.vector_between(*ends), speed)
        for slider in system.sliders
        for ends, speed in zip(slider.ends, slider.friction.base_speeds, strict=False)
        if any(slider.friction.base_speeds)
    ]
    if not moving:
        return [still]
    rows, speeds = (np.array(each) for each in zip(*moving, strict=True))
    carried = still.copy()
    carried[system.size :] = np.linalg.lstsq(rows, speeds, rcond=None)[0]
    return [still, carried]


def _note_branches_not_followed(box: Collector) -> None:
    for branch in box.branches:
        for special in branch.special_points:
            if special.kind in NOT_FOLLOWED:
                box.notes.append(
                    f"branch {branch.name}: what branches off at the {special.kind} at "
                    f"{special.place()} was not followed"
                )


def _note_failures(box: Collector, failures: dict[float, str]) -> None:
    """Name the values at which no motion led to a limit cycle, and no branch has a stable one."""
    left = [
        value
        for value in sorted(failures)
        if not any(orbit.stable for branch in box.branches for orbit in branch.at(value))
    ]
    if left:
        where = box.axis.told_span(left[0], left[-1])
        box.notes.append(
            f"no stable limit cycle was found at {box.axis.counted(len(left))}, {where}: "
            f"{failures[left[0]]}"
        )
