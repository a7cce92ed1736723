"""Small questions to a diagram, from which the checks of the claims are made."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from nldyn.bifurcations.point import SpecialPoint
from nldyn.branches.branch import Branch
from nldyn.branches.peaks import Peak, resonance_peaks
from nldyn.orbits.orbit import Orbit
from nldyn.search.diagram import Diagram

DATA = Path(__file__).resolve().parent / "data"
READING_TOLERANCE = 0.01  # what a reader can measure in a plot


def published_claims() -> list[dict[str, str]]:
    """Rows of ``data/claims.csv``: what the paper states.

    Examples
    --------
    >>> published_claims()[0]["id"]
    'linear.f1'
    """
    with (DATA / "claims.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@dataclass(frozen=True)
class Finding:
    """What a check found: a number to compare, whether a statement holds, both, or neither.

    Parameters
    ----------
    value : float, optional
        Number to compare with the published one.
    holds : bool, optional
        Whether a statement holds. A statement with a number agrees if it holds and the number
        agrees.
    text : str
        What was found, for a statement.
    note : str
        Remark for the table.
    """

    value: float | None = None
    holds: bool | None = None
    text: str = ""
    note: str = ""


def highest_peak(
    branches: Iterable[Branch], low_hz: float, high_hz: float
) -> tuple[Branch, Peak] | None:
    """The highest resonance peak of some branches in a window of frequencies."""
    peaks = [
        (branch, peak) for branch in branches for peak in resonance_peaks(branch, (low_hz, high_hz))
    ]
    return max(peaks, key=lambda pair: pair[1].height, default=None)


def peak_near(diagram: Diagram, period: int, near_hz: float, width: float = 0.05) -> Finding:
    """Frequency of the highest peak of one period within a relative width of a frequency."""
    found = highest_peak(
        diagram.of_period(period), near_hz * (1.0 - width), near_hz * (1.0 + width)
    )
    if found is None:
        return Finding(holds=False, text="no such peak", note=f"searched within {100 * width:g} %")
    branch, peak = found
    note = f"max |y| = {1e6 * peak.height:.4g} µm, {describe(peak.orbit)}, branch {branch.name}"
    return Finding(peak.frequency_hz, note=note)


def main_branch(diagram: Diagram, period: int, low_hz: float, high_hz: float) -> Branch | None:
    """The branch of one period with the highest peak in a window."""
    found = highest_peak(diagram.of_period(period), low_hz, high_hz)
    return found[0] if found else None


def special(
    branch: Branch, kind: str, low_hz: float = 0.0, high_hz: float = float("inf")
) -> list[SpecialPoint]:
    """Special points of one kind between two frequencies."""
    return [
        s for s in branch.special_points if s.kind == kind and low_hz <= s.frequency_hz <= high_hz
    ]


def nearest_special(branch: Branch, kind: str, hz: float) -> SpecialPoint | None:
    """The special point of one kind that is nearest to a frequency."""
    points = special(branch, kind)
    return min(points, key=lambda s: abs(s.frequency_hz - hz), default=None)


def unstable_share(branches: Iterable[Branch], low_hz: float, high_hz: float) -> float:
    """Share of the arclength of some branches that is unstable, in a window of frequencies."""
    total = unstable = 0.0
    for branch in branches:
        for a, b in pairwise(branch.nodes):
            if low_hz <= a.orbit.frequency_hz <= high_hz:
                length = b.arclength - a.arclength
                total += length
                unstable += 0.0 if a.orbit.stable and b.orbit.stable else length
    return unstable / total if total else 0.0


def orbits_at(diagram: Diagram, period: int, hz: float) -> list[Orbit]:
    """All orbits of one period at a frequency, the highest first."""
    found = [orbit for branch in diagram.of_period(period) for orbit in branch.at(hz)]
    return sorted(found, key=lambda orbit: -orbit.max_abs_displacement)


def nearest_unstable(diagram: Diagram, impacts: int, hz: float) -> Orbit | None:
    """The unstable harmonic orbit with so many impacts that is nearest to a frequency."""
    found = [
        orbit
        for branch in diagram.of_period(1)
        for orbit in branch.points
        if not orbit.stable and orbit.impacts == impacts
    ]
    return min(found, key=lambda orbit: abs(orbit.frequency_hz - hz), default=None)


def describe(orbit: Orbit) -> str:
    """Impacts and stability in words."""
    plural = "s" if orbit.impacts != 1 else ""
    return f"{orbit.impacts} impact{plural} per period, {'stable' if orbit.stable else 'unstable'}"
