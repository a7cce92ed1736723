"""Reduce a component to what its setting needs, and say how wrong that is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import cms
from nldyn.base.errors import ConvergenceError, SystemModelError, is_finite, shown
from nldyn.branches.branch import Branch
from nldyn.branches.peaks import resonance_peaks
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.reduction.candidates import BEYOND, Candidates, candidate_modes, share
from nldyn.reduction.load_case import LoadCase
from nldyn.reduction.model_errors import (
    axis_of,
    harmonic_branch,
    largest_force,
    matched,
    special_points_of,
    told,
)
from nldyn.runtime.progress import Progress, Shares, shows_progress, silent
from nldyn.system.system import System

SAMPLES = 9
FINEST = 1e-6  # tolerance of a selection, at least: eigenfrequencies have few more digits


@dataclass(frozen=True)
class LeftOut:
    """A mode that a selection did not keep.

    Parameters
    ----------
    number : int
        Number of the mode, from 1.
    frequency_hz : float
        Its frequency.
    reason : str
        Why.
    """

    number: int
    frequency_hz: float
    reason: str


@dataclass(frozen=True, eq=False)
class ModeSelection:
    """A component reduced to what a setting needs, by `select_modes`.

    Parameters
    ----------
    reduced : cms.ReducedModel
        The model.
    kept : tuple of int
        Numbers of the kept modes, from 1.
    left_out : tuple of LeftOut
        The other modes up to ``reference_hz``.
    cutoff_hz : float
        Up to where modes may matter: the larger of the excitation's highest frequency and 1.5
        over the shortest contact.
    reference_hz : float
        Up to where the modes of the reference reach, twice that.
    contact_s : float
        Shortest contact expected, in s; infinite without a stop.
    tolerance : float
        What was asked for.
    error : (float, float)
        Band of the relative error of the harmonic response (largest displacement and contact
        force, at the peak and over the range).
    special_error : (float, float)
        Band of the largest relative error of a fold's or flip's frequency, of those that the
        model and the reference both have; nan if it was not asked for.
    missing, extra : int
        Folds and flips that only the reference has, and only the model.
    doubtful : int
        Folds and flips in which the reference itself differs from the model with all modes up to
        the cut-off, so that it is not certain which of them the full model has.
    """

    reduced: cms.ReducedModel
    kept: tuple[int, ...]
    left_out: tuple[LeftOut, ...]
    cutoff_hz: float
    reference_hz: float
    contact_s: float
    tolerance: float
    error: tuple[float, float]
    special_error: tuple[float, float] = (math.nan, math.nan)
    missing: int = 0
    extra: int = 0
    doubtful: int = 0

    def __repr__(self) -> str:
        """One line: the modes that are kept, and the error of the response."""
        low, high = self.error
        return (
            f"<ModeSelection: modes {', '.join(map(str, self.kept)) or '(none)'} up to "
            f"{self.cutoff_hz:.4g} Hz, error {low:.1g} to {high:.1g} of {self.tolerance:g} wanted>"
        )

    def report(self) -> str:
        """What was kept and left out, and the estimated error."""
        hz = self.reduced.frequencies_hz
        kept = ", ".join(f"{number} ({f:.4g} Hz)" for number, f in zip(self.kept, hz, strict=False))
        lines = [
            f"modes kept: {kept or 'none'}; {self.reduced.residual_modes} residual",
            f"cut-off {self.cutoff_hz:.4g} Hz (shortest contact {self.contact_s:.3g} s), judged "
            f"against all modes up to {self.reference_hz:.4g} Hz",
        ]
        reasons: dict[str, list[LeftOut]] = {}
        for mode in self.left_out:
            reasons.setdefault(mode.reason, []).append(mode)
        for reason, modes in reasons.items():
            named = ", ".join(f"{m.number} ({m.frequency_hz:.4g} Hz)" for m in modes[:8])
            more = f" and {len(modes) - 8} more" if len(modes) > 8 else ""
            lines.append(f"left out, {reason}: {named}{more}")
        low, high = self.error
        lines.append(
            f"estimated error of the harmonic response: {low:.1e} to {high:.1e} "
            f"(asked for {self.tolerance:g})"
        )
        low, high = self.special_error
        if not math.isnan(high):
            lines.append(
                f"folds and flips: error {low:.1e} to {high:.1e}, {self.missing} missing, "
                f"{self.extra} too many, {self.doubtful} uncertain"
            )
        return "\n".join(lines)


@shows_progress()
def select_modes(
    component: cms.ComponentLike,
    setting: LoadCase,
    *,
    tolerance: float = 0.01,
    special_points: bool = False,
    progress: Progress | None = None,
) -> ModeSelection:
    """Reduce a component to the modes that its setting needs.

    Parameters
    ----------
    component : ComponentLike
        As for `cms.reduce`.
    setting : LoadCase
        What acts on it, and the range of frequencies or of another parameter.
    tolerance : float
        Largest relative change of the harmonic response that leaving modes out may make.
    special_points : bool
        Also follow the branches of the chosen model and of that with all modes up to the cut-off,
        and compare their folds and flips with the reference's.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.

    Returns
    -------
    ModeSelection

    Raises
    ------
    SystemModelError
        For a tolerance out of range, or a setting that the component has no interface for.
    ConvergenceError
        If the harmonic branch of the reference cannot be followed.
    cms.ReductionError
        As `cms.reduce`.

    Notes
    -----
    1. The shortest contact follows from `contact_duration` with the largest speed of the linear
       response in the range and the mass that the interface shows in so short a time, 1/Σp² over
       the modes below the cut-off; the cut-off is 1.5 over this duration.
    2. The reference has all modes up to twice the cut-off that an interface in use can see. Its
       harmonic branch gives nine orbits over the range and the one at the top of its highest
       resonance peak.
    3. Modes are added in the order of their frequencies until these orbits differ from the
       reference's by less than the tolerance; then each kept mode, the least visible first, is
       left out if that still holds. The judge is the reference and not the next mode: where the
       next mode happens to be one that the interface hardly sees, a small change would prove
       nothing.
    4. The error of the reference is judged by that of the model with all modes up to the cut-off;
       both differences together make the band. So it is for folds and flips.
    """
    if not (is_finite(tolerance) and FINEST <= tolerance < 1.0):
        raise SystemModelError(f"tolerance must lie in [1e-6, 1), got {shown(tolerance)}")
    visible = candidate_modes(component, setting)
    whole, seen, cutoff = visible.whole, visible.seen, visible.cutoff_hz
    shares = Shares(progress or silent, {"reference": 3.0, "modes": 1.0})
    reference = cms.keep_modes(whole, seen)
    system = setting.system(reference)
    tell = told(shares.part("reference"), "reference", axis_of(setting, system))
    judge = Judge(setting, reference, harmonic_branch(system, setting, tell))
    candidates = visible.numbers
    shares.end("reference")
    kept, error = fewest_modes(visible, judge, tolerance, shares.part("modes"))
    smaller = cms.keep_modes(whole, candidates) if len(candidates) < len(seen) else reference
    doubt = 0.0 if smaller is reference else judge.error(smaller)
    reduced = cms.keep_modes(whole, kept)
    special_error, missing, extra, doubtful = (math.nan, math.nan), 0, 0, 0
    if special_points:
        for part in ("chosen model", "model up to the cut-off"):
            shares.weigh(part, 3.0)
        tell = told(shares.part("chosen model"), "chosen model", judge.axis)
        moved_by, missing, extra = judge.special_error(reduced, tell)
        shares.end("chosen model")
        tell = told(shares.part("model up to the cut-off"), "cut-off", judge.axis)
        uncertain, *lacking = judge.special_error(smaller, tell)
        special_error, doubtful = around(moved_by, uncertain), sum(lacking)
    return ModeSelection(
        reduced,
        tuple(kept),
        tuple(reasons(whole, seen, kept)),
        cutoff,
        BEYOND * cutoff,
        visible.contact_s,
        tolerance,
        around(error, doubt),
        special_error,
        missing,
        extra,
        doubtful,
    )


def fewest_modes(
    visible: Candidates, judge: Judge, tolerance: float, progress: Progress
) -> tuple[list[int], float]:
    """The modes of which none can be left out, and the error of the model that has them.

    They are added one by one until it is small enough; then those that matter least are tried.
    """
    whole, seen = visible.whole, visible.seen
    rigid = [n for n in visible.numbers if whole.frequencies_hz[n - 1] == 0.0]
    kept, error = list(rigid), math.inf if len(seen) > len(rigid) else 0.0
    for number in [n for n in seen if n not in rigid]:
        kept.append(number)
        progress(f"mode {number}", 0.0, 0.5 * len(kept) / len(seen))
        error = judge.error(cms.keep_modes(whole, kept))
        if error <= tolerance:
            break
    for tried, number in enumerate(sorted(kept, key=lambda n: share(whole, judge.setting, n))):
        fewer = [n for n in kept if n != number]
        if number in rigid or not fewer:
            continue
        progress(f"mode {number}", 0.0, 0.5 + 0.5 * tried / len(seen))
        without = judge.error(cms.keep_modes(whole, fewer))
        if without <= tolerance:
            kept, error = fewer, without
    return kept, error


def around(error: float, doubt: float) -> tuple[float, float]:
    """Band of an error that is known up to a doubt."""
    return max(error - doubt, 0.0), error + doubt


class Judge:
    """The orbits of a reference model, with which smaller models are compared."""

    def __init__(self, setting: LoadCase, reference: cms.ReducedModel, branch: Branch) -> None:
        self.setting, self.reference, self.branch = setting, reference, branch
        self.axis = axis_of(setting, branch.points[0].system)
        places = self.axis.spread(SAMPLES + 2)[1:-1]
        self.orbits: list[Orbit] = [o for place in places for o in branch.at(float(place))[:1]]
        self.orbits += [
            p.orbit for p in sorted(resonance_peaks(branch), key=lambda p: -p.height)[:1]
        ]
        if not self.orbits:
            raise ConvergenceError("the reference has no orbit in the range")

    def error(self, model: cms.ReducedModel) -> float:
        """Largest relative difference of displacement and force; infinite where an orbit is lost.

        A force is measured relative to the largest one in the range.
        """
        system = self.setting.system(model)
        strongest = max(largest_force(orbit) for orbit in self.orbits)
        worst = 0.0
        for known in self.orbits:
            try:
                here = self.axis.at(FlowMap(system), self.axis.value(known)).flow.system
                orbit = moved(known, self.reference, model, here)
            except ConvergenceError:
                return math.inf
            size = known.max_abs_displacement
            worst = max(worst, abs(orbit.max_abs_displacement - size) / size)
            if strongest > 0.0:
                change = abs(largest_force(orbit) - largest_force(known))
                worst = max(worst, change / strongest)
        return worst

    def special_error(
        self, model: cms.ReducedModel, tell: Callable[[float], None]
    ) -> tuple[float, int, int]:
        """Largest relative error of a fold or flip, and how many are missing and too many."""
        if model is self.reference:
            return 0.0, 0, 0
        branch = harmonic_branch(self.setting.system(model), self.setting, tell)
        return matched(special_points_of([branch]), special_points_of([self.branch]), self.axis)


def moved(
    known: Orbit, reference: cms.ReducedModel, model: cms.ReducedModel, system: System
) -> Orbit:
    """The orbit of a smaller model nearest to a known one of the reference."""
    states = known.problem.flow.to_modal(known.problem.nodes(known.point))
    turn = np.linalg.lstsq(model.basis, reference.basis, rcond=None)[0]
    half = known.system.size
    start = np.hstack([states[:, :half] @ turn.T, states[:, half:] @ turn.T])
    return solve_orbit(
        system,
        known.frequency_hz,
        known.period,
        guess=start,
        observe=known.observe,
        segments=known.problem.segments,
    )


def reasons(model: cms.ReducedModel, seen: Sequence[int], kept: Sequence[int]) -> list[LeftOut]:
    """Why each mode that is not kept was left out."""
    found = []
    for index in range(model.modes):
        number = index + 1
        if number in kept:
            continue
        reason = "no interface in use sees it"
        if number in seen:
            reason = "the response changes by less than asked"
        found.append(LeftOut(number, float(model.frequencies_hz[index]), reason))
    return found
