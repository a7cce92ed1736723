"""One check for each claim of the paper: what is computed and how it is judged."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache, partial

import cms
from nldyn.base.resources import example
from nldyn.bifurcations.point import SpecialPoint
from nldyn.branches.branch import Branch
from nldyn.branches.peaks import lowest_orbit, resonance_peaks
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene
from nldyn.search.diagram import Diagram
from nldyn.system.stop import hertz_stiffness
from paper.evidence import (
    READING_TOLERANCE,
    Finding,
    describe,
    highest_peak,
    main_branch,
    nearest_special,
    nearest_unstable,
    orbits_at,
    peak_near,
    special,
    unstable_share,
)
from paper.jobs import BILINEAR_ALPHA, HERTZ_STIFFNESS, STIFFNESS

Results = Mapping[str, Diagram]
Check = Callable[[Results], Finding]

CHAOS = Finding(
    note="needs the long-term behaviour (Lyapunov exponents); only periodic orbits are computed"
)


@cache
def _reduced(modes: int) -> cms.ReducedModel:
    component = build_component(load_scene(example("four_dof_xi_0.01.toml")))
    return cms.reduce(component, modes=modes)


def _frequency(modes: int, index: int, note: str, results: Results) -> Finding:
    return Finding(float(_reduced(modes).frequencies_hz[index]), note=note)


def _modal_mass(results: Results) -> Finding:
    phi = float(_reduced(1).participation["middle"][0])
    return Finding(phi**-2, note="a calibration target")


def _modal_stiffness(results: Results) -> Finding:
    reduced = _reduced(1)
    omega = 2.0 * math.pi * float(reduced.frequencies_hz[0])
    phi = float(reduced.participation["middle"][0])
    return Finding((omega / phi) ** 2, note="a calibration target")


def _hertz(results: Results) -> Finding:
    value = 0.5 * hertz_stiffness(0.005, 2.1e11, 0.3)
    compliance = 4.0 / 3.0 * math.sqrt(0.005) / (2.0 * HERTZ_STIFFNESS)
    ratio = math.sqrt(1.0 - compliance * 2.1e11 / 2.0)
    note = (
        "half of Hertz's stiffness for r = 5 mm, E = 2.1e11 N/m² and ν = 0.3; the paper names no "
        f"Poisson's ratio, its value needs ν = {ratio:.3f}. All models use the published value."
    )
    return Finding(value, note=note)


def _alpha(results: Results) -> Finding:
    ratio = 25.3 / 13.1
    return Finding((ratio / (2.0 - ratio)) ** 2 - 1.0, note="equation 3.2 solved for α")


def _crossover(results: Results) -> Finding:
    return Finding((BILINEAR_ALPHA * STIFFNESS / HERTZ_STIFFNESS) ** 2, note="α k y = k_s y^1.5")


def _penetration(results: Results) -> Finding:
    diagrams = (results["one_dof"], results["one_dof.listed"])
    branch, orbit = max(
        ((b, o) for d in diagrams for b in d.branches for o in b.points),
        key=lambda pair: pair[1].max_penetration,
    )
    harmonic = max(o.max_penetration for o in results["one_dof"].of_period(1)[0].points)
    note = (
        f"at {orbit.frequency_hz:.2f} Hz on a 1/{branch.period} branch; the harmonic branch alone "
        f"reaches {harmonic:.3g} m. An impact at speed v with m = 2.48 kg and the published k_s "
        "penetrates by (5 m v² / 4 k_s)^(2/5)."
    )
    return Finding(orbit.max_penetration, note=note)


def _peak(job: str, period: int, near_hz: float, results: Results, width: float = 0.05) -> Finding:
    return peak_near(results[job], period, near_hz, width)


def _third_folds(results: Results) -> Finding:
    one = results["one_dof"]
    third = highest_peak(one.of_period(3), 72.0, 80.0)
    if third is None:
        return Finding(holds=False, text="no 1/3 peak")
    top = third[1].frequency_hz
    folds = special(third[0], "LP", 0.99 * top, 1.01 * top)
    others = []
    for period, low, high in ((1, 24.0, 27.0), (2, 48.0, 53.0)):
        found = highest_peak(one.of_period(period), low, high)
        if found is None:
            return Finding(holds=False, text=f"no 1/{period} peak to compare with")
        hz = found[1].frequency_hz
        others += special(found[0], "LP", 0.99 * hz, 1.01 * hz)
    at = ", ".join(f"{s.frequency_hz:.4f}" for s in folds)
    return Finding(
        holds=len(folds) == 2 and not others,
        text=f"{len(folds)} folds at the 1/3 peak ({at} Hz), {len(others)} at the others",
        note="within 1 % of the tops of the highest harmonic, 1/2 and 1/3 peaks",
    )


def _flips(results: Results) -> Finding:
    branches = [b for b in results["one_dof"].branches if b.period <= 3]  # not the doubled ones
    branches += [b for b in results["one_dof.listed"].branches if b.period > 1]
    without = [f"1/{b.period} near {b.frequency_hz.mean():.1f} Hz" for b in branches
               if len(special(b, "PD")) < 2]  # fmt: skip
    return Finding(
        holds=bool(branches) and not without,
        text=f"{len(branches) - len(without)} of {len(branches)} branches carry a pair of flips",
        note="without one: " + "; ".join(without) if without else "",
    )


def _graze(period: int, near_hz: float, results: Results) -> Finding:
    branch = main_branch(results["one_dof"], period, 45.0, 90.0)
    point = nearest_special(branch, "GR", near_hz) if branch else None
    if branch is None or point is None:
        return Finding(holds=False, text="no grazing point found")
    index = next(i for i, node in enumerate(branch.nodes) if node.arclength > point.point.arclength)
    pair = [branch.nodes[index - 1].orbit, branch.nodes[index].orbit]
    below, above = sorted(pair, key=lambda orbit: orbit.frequency_hz)
    note = f"{below.impacts} impacts per period below, {above.impacts} above"
    return Finding(point.frequency_hz, note=note)


def _graze_smooth(results: Results) -> Finding:
    gaps = []
    for diagram in (results["one_dof"], results["one_dof.listed"]):
        for branch in diagram.branches:
            lengths = [s.point.arclength for s in branch.special_points if s.kind != "GR"]
            for s in branch.special_points:
                if s.kind == "GR" and lengths:
                    gaps.append(min(abs(s.point.arclength - x) for x in lengths))
    nearest = min(gaps)
    return Finding(
        holds=nearest > 1e-8,
        text=f"{len(gaps)} grazing points; nearest bifurcation {nearest:.1e} of relative "
        "arclength away",
        note="points are located to about 1e-10, so 1e-8 tells them apart; the stiff contact bends "
        "the branch just behind "
        "grazing, so bifurcations come close but do not coincide",
    )


def _impacts_at(job: str, hz: float, wanted: int, results: Results) -> Finding:
    orbits = orbits_at(results[job], 1, hz)
    if not orbits:
        return Finding(holds=False, text="no orbit found")
    text = "; ".join(f"{1e6 * o.max_abs_displacement:.3g} µm: {describe(o)}" for o in orbits)
    match = [o for o in orbits if o.impacts == wanted]
    return Finding(float(match[0].impacts if match else orbits[0].impacts), note=text)


def _branch_a(results: Results) -> Finding:
    diagram = results["two_dof_xi_0.01"]
    tops = [
        (peak.height, peak)
        for branch in diagram.of_period(1)
        for peak in resonance_peaks(branch, (22.0, 24.0))
        if peak.orbit.stable and peak.orbit.impacts == 2
    ]
    if not tops:
        return Finding(holds=False, text="no stable top with two impacts between 22 and 24 Hz")
    peak = max(tops, key=lambda pair: pair[0])[1]
    return Finding(
        peak.frequency_hz, note=f"max |y| = {1e6 * peak.height:.4g} µm, {describe(peak.orbit)}"
    )


def _separate_branch(diagram: Diagram) -> tuple[Branch, ...]:
    """Harmonic branches between 21.5 and 24.5 Hz beside the one with the most points."""
    harmonic = sorted(diagram.of_period(1), key=lambda b: -len(b.nodes))
    return tuple(
        b for b in harmonic[1:] if b.frequency_hz.max() > 21.5 and b.frequency_hz.min() < 24.5
    )


def _branch_b(results: Results) -> Finding:
    separate = _separate_branch(results["two_dof_xi_0.01"])
    note = f"at ξ = 0.001: {_spans(_separate_branch(results['two_dof_xi_0.001']))}"
    found = highest_peak(separate, 22.0, 24.5)
    if found is None:
        return Finding(
            holds=False, text=f"separate harmonic branch near 23 Hz: {_spans(separate)}", note=note
        )
    branch, top = found
    folds, grazings = special(branch, "LP"), special(branch, "GR")
    return Finding(
        top.frequency_hz,
        holds=not top.orbit.stable
        and top.orbit.impacts == 2
        and len(folds) >= 2
        and bool(grazings),
        text=f"separate harmonic branch: {_spans((branch,))}; top at {top.frequency_hz:.2f} Hz "
        f"({describe(top.orbit)}); folds at {_places(folds)}, grazing at {_places(grazings)}",
        note=note,
    )


def _spans(branches: tuple[Branch, ...]) -> str:
    spans = [
        f"{b.frequency_hz.min():.2f} to {b.frequency_hz.max():.2f} Hz ({b.stop_reasons[0]})"
        for b in branches
    ]
    return "; ".join(spans) or "none"


def _places(points: list[SpecialPoint]) -> str:
    return ", ".join(f"{point.frequency_hz:.2f}" for point in points) + " Hz"


def _branch_c(results: Results) -> Finding:
    diagram = results["two_dof_xi_0.01"]
    parts = [
        branch
        for branch in diagram.of_period(1)
        if any(o.stable and o.impacts == 1 and 21.0 < o.frequency_hz < 24.5 for o in branch.points)
        and len(special(branch, "PD", 21.0, 24.5)) >= 2
    ]
    flips = [f"{s.frequency_hz:.3f}" for b in parts for s in special(b, "PD", 21.0, 24.5)]
    return Finding(
        holds=bool(parts), text=f"stable one-impact part; flips at {', '.join(flips)} Hz"
    )


def _half_a(results: Results) -> Finding:
    diagram = results["two_dof_xi_0.01"]
    found = highest_peak(diagram.of_period(2), 44.0, 49.0)
    harmonic = highest_peak(diagram.of_period(1), 21.0, 25.0)
    if found is None or harmonic is None:
        return Finding(holds=False, text="no 1/2 peak between 44 and 49 Hz, or no harmonic one")
    branch, peak = found
    folds = [s.frequency_hz for s in special(branch, "LP", 44.0, 49.0)]
    return Finding(
        peak.frequency_hz,
        holds=bool(folds),
        text=f"top at {peak.frequency_hz:.3f} Hz ({describe(peak.orbit)}); folds at "
        + ", ".join(f"{f:.3f}" for f in folds)
        + " Hz",
        note=f"twice our harmonic top is {2.0 * harmonic[1].frequency_hz:.3f} Hz",
    )


def _half_fold(results: Results) -> Finding:
    branch = main_branch(results["two_dof_xi_0.01"], 2, 44.0, 49.0)
    point = nearest_special(branch, "LP", 44.5) if branch else None
    if point is None:
        return Finding(holds=False, text="no fold found")
    return Finding(point.frequency_hz, note=describe(point.orbit))


def _third_pattern(results: Results) -> Finding:
    found = highest_peak(results["two_dof_xi_0.01"].of_period(3), 65.0, 73.0)
    if found is None:
        return Finding(holds=False, text="no 1/3 peak between 65 and 73 Hz")
    branch, peak = found
    folds = [s.frequency_hz for s in special(branch, "LP", 64.0, 73.0)]
    return Finding(
        peak.frequency_hz,
        holds=len(folds) >= 2,
        text=f"top at {peak.frequency_hz:.3f} Hz; folds at "
        + ", ".join(f"{f:.3f}" for f in folds) + " Hz",
    )  # fmt: skip


def _third_unstable(results: Results) -> Finding:
    low = [
        b for b in results["two_dof_xi_0.01"].of_period(3) if 28.0 < b.frequency_hz.mean() < 45.0
    ]
    if not low:
        return Finding(holds=False, text="no 1/3 branch found between 28 and 45 Hz")
    text = "; ".join(
        f"{b.frequency_hz.min():.2f}-{b.frequency_hz.max():.2f} Hz, "
        f"{int(b.stable.sum())} of {len(b.nodes)} points stable"
        for b in low
    )
    near = [b for b in low if b.frequency_hz.min() <= 33.33 and b.frequency_hz.max() >= 32.67]
    return Finding(holds=any(not _has_stable_part(b) for b in near), text=text)


def _has_stable_part(branch: Branch) -> bool:
    """Whether a point is stable, or a bifurcation is the end of a stable part between points."""
    ends = (s for s in branch.special_points if s.kind in ("LP", "PD", "NS"))
    return bool(branch.stable.any()) or any(
        abs(end.orbit.largest_multiplier) < 1.0 + 1e-6 for end in ends
    )


def _antiresonance(results: Results) -> Finding:
    branch = max(results["two_dof.high"].of_period(1), key=lambda b: len(b.nodes))
    orbit = lowest_orbit(branch, (65.0, 120.0))
    if orbit is None:
        return Finding(holds=False, text="no harmonic orbit between 65 and 120 Hz")
    return Finding(
        orbit.frequency_hz,
        note=f"smallest max |y| of the harmonic branch: {1e6 * orbit.max_abs_displacement:.3g} µm",
    )


def _bilinear_shift(results: Results) -> Finding:
    pairs = []
    for hz in (26.5, 32.0, 44.0, 64.0):
        ours = peak_near(results["two_dof_xi_0.01"], 1, hz, 0.04).value
        other = peak_near(results["two_dof.bilinear"], 1, hz, 0.04).value
        if ours and other:
            pairs.append((ours, other))
    worst = max((abs(b / a - 1.0) for a, b in pairs), default=math.inf)
    text = "; ".join(f"{a:.2f} and {b:.2f} Hz" for a, b in pairs)
    return Finding(
        holds=len(pairs) == 4 and worst < 0.02,
        text=f"Hertz and bilinear peaks: {text}",
        note=f"largest difference {100 * worst:.1f} %",
    )


TOPS = ((1, 21.0, 25.0), (2, 43.0, 49.0), (3, 65.0, 73.0))


def _higher(results: Results) -> Finding:
    strong, weak = results["two_dof_xi_0.01"], results["two_dof_xi_0.001"]
    texts, grown = [], True
    for period, low, high in TOPS:
        a = highest_peak(strong.of_period(period), low, high)
        b = highest_peak(weak.of_period(period), low, high)
        if a is None or b is None:
            return Finding(holds=False, text=f"no 1/{period} peak at one of the dampings")
        grown = grown and b[1].height > a[1].height and b[1].orbit.impacts == 2
        texts.append(
            f"1/{period}: {1e6 * a[1].height:.3g} to {1e6 * b[1].height:.3g} µm, "
            f"{describe(b[1].orbit)}"
        )
    alike = [[b for b in d.branches if b.period <= 3] for d in (strong, weak)]
    shares = [unstable_share(branches, 20.0, 90.0) for branches in alike]
    return Finding(
        holds=grown and shares[1] > shares[0],
        text="; ".join(texts) + f"; unstable share {shares[0]:.2f} to {shares[1]:.2f}",
    )


def _sub14(results: Results) -> Finding:
    branches = results["two_dof.sub14"].of_period(14)
    if not branches:
        return Finding(holds=False, text="no 1/14 orbit found near 57 Hz")
    unstable = [(b, float(f)) for b in branches for f in b.frequency_hz[~b.stable]]
    if not unstable:
        return Finding(holds=False, text="the 1/14 orbits found near 57 Hz are stable")
    branch, hz = min(unstable, key=lambda found: abs(found[1] - 57.0))
    low, high = branch.frequency_hz.min(), branch.frequency_hz.max()
    return Finding(
        hz,
        note=f"the unstable orbit nearest to 57 Hz; its branch was followed from {low:.2f} to "
        f"{high:.2f} Hz, {int(branch.stable.sum())} of {len(branch.nodes)} points stable",
    )


def _undamped(results: Results) -> Finding:
    points = [o for b in results["two_dof.undamped"].branches for o in b.points]
    stable = sum(o.stable for o in points)
    weakest = 1.0 - max((abs(o.largest_multiplier) for o in points if o.stable), default=1.0)
    return Finding(
        holds=bool(points) and stable == 0,
        text=f"{stable} of {len(points)} harmonic orbits between 20 and 60 Hz are stable",
        note="the damper at the middle also damps the second mode a little: the stable orbits have "
        f"multipliers of up to 1 - {weakest:.1e}",
    )


def _five(results: Results) -> Finding:
    texts, worst = [], 0.0
    windows = ((21.0, 24.0), (25.5, 28.0), (30.0, 34.0), (38.5, 42.0), (58.0, 62.0))
    for low, high in windows:
        four = highest_peak(results["four_dof_xi_0.01"].of_period(1), low, high)
        five = highest_peak(results["five_dof_xi_0.01"].of_period(1), low, high)
        if four and five:
            shift = five[1].frequency_hz / four[1].frequency_hz - 1.0
            growth = five[1].height / four[1].height - 1.0
            worst = max(worst, abs(shift))
            texts.append(
                f"{four[1].frequency_hz:.2f} Hz: {100 * shift:+.1f} %, height {100 * growth:+.0f} %"
            )
    return Finding(
        holds=len(texts) == len(windows) and worst <= READING_TOLERANCE,
        text="; ".join(texts) or "no common peak",
        note="shift of the highest harmonic peaks in five windows from four to five DOF; agrees if "
        "every shift is below 1 %",
    )


def _split(results: Results) -> Finding:
    harmonic = results["four_dof_xi_0.01"].of_period(1)
    tops = [p for b in harmonic for p in resonance_peaks(b, (24.5, 29.0))]
    if not tops:
        return Finding(holds=False, text="no harmonic top from 24.5 to 29 Hz")
    text = ", ".join(
        f"{p.frequency_hz:.2f} Hz ({1e6 * p.height:.3g} µm, {describe(p.orbit)})" for p in tops
    )
    nearest = min(tops, key=lambda p: abs(p.frequency_hz - 27.0))
    return Finding(
        nearest.frequency_hz,
        holds=len(tops) >= 3,
        text=f"tops: {text}",
        note="harmonic tops from 24.5 to 29 Hz: one high and one low with two tops makes three; "
        "the deviation is that of the top nearest to 27 Hz",
    )


def _no_second(results: Results) -> Finding:
    separate = _separate_branch(results["four_dof_xi_0.01"])
    spans = "; ".join(f"{b.frequency_hz.min():.2f}-{b.frequency_hz.max():.2f} Hz" for b in separate)
    return Finding(
        holds=not separate,
        text=spans or "no separate harmonic branch found",
        note="not finding one by simulation does not prove that there is none",
    )


def _peaks7(results: Results) -> Finding:
    texts, good = [], True
    for period, low, high in TOPS:
        found = highest_peak(results["four_dof_xi_0.01"].of_period(period), low, high)
        if found is None:
            return Finding(holds=False, text=f"no 1/{period} peak")
        orbit = found[1].orbit
        good = good and orbit.stable and orbit.impacts == 2
        texts.append(f"1/{period} at {orbit.frequency_hz:.2f} Hz: {describe(orbit)}")
    return Finding(holds=good, text="; ".join(texts))


def _many_peaks(low: float, high: float, results: Results) -> Finding:
    tops = [
        peak
        for branch in results["four_dof_xi_0.001"].of_period(1)
        for peak in resonance_peaks(branch, (low, high))
    ]
    text = f"{len(tops)} tops of harmonic branches"
    return Finding(
        holds=len(tops) >= 3, text=text, note="counted; which modes dominate is not evaluated"
    )


def _impacts8(results: Results) -> Finding:
    tops = [
        peak.orbit
        for branch in results["four_dof_xi_0.001"].of_period(1)
        for peak in resonance_peaks(branch, (22.0, 23.5))
    ]
    stable = sorted({o.impacts for o in tops if o.stable})
    unstable = sorted({o.impacts for o in tops if not o.stable})
    return Finding(
        holds=stable == [1] and unstable == [3],
        text=f"impacts at stable tops: {stable}, at unstable tops: {unstable}",
        note="tops of harmonic branches from 22 to 23.5 Hz",
    )


def _orbit9(results: Results) -> Finding:
    orbits = [o for o in orbits_at(results["four_dof_xi_0.001"], 1, 22.5) if not o.stable]
    text = "; ".join(f"{1e6 * o.max_abs_displacement:.3g} µm: {describe(o)}" for o in orbits)
    three = [o for o in orbits if o.impacts == 3]
    if not orbits:
        return Finding(holds=False, text="none at 22.5 Hz", note=_nearest_with_three(results))
    return Finding(float(three[0].impacts if three else orbits[0].impacts), note=text)


def _nearest_with_three(results: Results) -> str:
    """Where the unstable orbit with three impacts is that Figure 9 would show."""
    nearest = nearest_unstable(results["four_dof_xi_0.001"], 3, 22.5)
    if nearest is None:
        return "no unstable harmonic orbit with three impacts at any frequency"
    return (
        f"the nearest unstable orbit with three impacts, {1e6 * nearest.max_abs_displacement:.3g} "
        f"µm, is at {nearest.frequency_hz:.4g} Hz"
    )


def _damping(results: Results) -> Finding:
    texts, fewer = [], True
    for model in ("two_dof", "four_dof"):
        counts = []
        for xi in ("0.01", "0.001"):
            branches = results[f"{model}_xi_{xi}"].of_period(1)
            counts.append(sum(len(special(b, "PD", 20.0, 90.0)) for b in branches))
        fewer = fewer and counts[0] < counts[1]
        texts.append(f"{model}: {counts[0]} flips at ξ = 0.01, {counts[1]} at 0.001")
    return Finding(
        holds=fewer,
        text="; ".join(texts),
        note="flips on the harmonic branches, 20 to 90 Hz; the chaotic ranges are not decided",
    )


_RUN_2 = "two_dof_xi_0.01"
CHECKS: dict[str, Check] = {
    "linear.f1": partial(_frequency, 3, 0, "a calibration target"),
    "linear.f2": partial(_frequency, 3, 1, "a calibration target"),
    "linear.f3": partial(_frequency, 3, 2, "a calibration target"),
    "linear.m1": _modal_mass,
    "linear.k1": _modal_stiffness,
    "cms.2dof.f2": partial(_frequency, 1, 1, "a calibration target"),
    "cms.4dof.f2": partial(_frequency, 3, 1, "a calibration target"),
    "cms.4dof.f3": partial(_frequency, 3, 2, "a calibration target"),
    "cms.4dof.f4": partial(_frequency, 3, 3, "a calibration target"),
    "hertz.ks.half": _hertz,
    "bilinear.alpha": _alpha,
    "bilinear.crossover": _crossover,
    "fig2.penetration": _penetration,
    "fig2.peak.1": partial(_peak, "one_dof", 1, 25.3),
    "fig2.peak.super2": partial(_peak, "one_dof", 1, 12.4),
    "fig2.peak.super3": partial(_peak, "one_dof", 1, 8.1),
    "fig2.peak.super4": partial(_peak, "one_dof", 1, 6.0),
    "fig2.peak.1/2": partial(_peak, "one_dof", 2, 50.6),
    "fig2.peak.1/3": partial(_peak, "one_dof", 3, 76.0),
    "fig2.sub.1/3.of.super2": partial(_peak, "one_dof.listed", 3, 37.1),
    "fig2.sub.1/5.of.super2": partial(_peak, "one_dof.listed", 5, 62.2),
    "fig2.sub.1/2.of.super3": partial(_peak, "one_dof.listed", 2, 16.1),
    "fig2.sub.1/4.of.super3": partial(_peak, "one_dof.listed", 4, 33.0),
    "fig2.sub.1/7.of.super3": partial(_peak, "one_dof.listed", 7, 58.0),
    "fig2.sub.1/10.of.super3": partial(_peak, "one_dof.listed", 10, 83.0),
    "fig2.sub.1/3.of.super4": partial(_peak, "one_dof.listed", 3, 18.4),
    "fig2.sub.1/5.of.super4": partial(_peak, "one_dof.listed", 5, 31.0),
    "fig2.sub.1/9.of.super4": partial(_peak, "one_dof.listed", 9, 56.0),
    "fig2.sub.1/13.of.super4": partial(_peak, "one_dof.listed", 13, 81.0),
    "fig2.folds.1/3": _third_folds,
    "fig2.flips": _flips,
    "fig2.graze.1/2": partial(_graze, 2, 40.0),
    "fig2.graze.1/3": partial(_graze, 3, 66.0),
    "fig2.graze.smooth": _graze_smooth,
    "fig3.orbit": partial(_impacts_at, "one_dof", 25.3, 1),
    "fig4.super5": partial(_peak, _RUN_2, 1, 26.5, width=0.04),
    "fig4.super4": partial(_peak, _RUN_2, 1, 32.0),
    "fig4.super3": partial(_peak, _RUN_2, 1, 44.0),
    "fig4.super2": partial(_peak, _RUN_2, 1, 64.0),
    "fig4.second.harmonic": partial(_peak, "two_dof.high", 1, 126.5),
    "fig4.branch.a": _branch_a,
    "fig4.branch.b": _branch_b,
    "fig4.branch.c": _branch_c,
    "fig4.half.a": _half_a,
    "fig4.half.fold": _half_fold,
    "fig4.third": _third_pattern,
    "fig4.third.of.super2": _third_unstable,
    "fig4.chaos": lambda results: CHAOS,
    "fig4.antiresonance": _antiresonance,
    "fig4.bilinear": _bilinear_shift,
    "fig5.higher": _higher,
    "fig5.sub14": _sub14,
    "fig6.orbits": partial(_impacts_at, "two_dof_xi_0.001", 23.0, 2),
    "undamped": _undamped,
    "five.dof": _five,
    "fig7.split": _split,
    "fig7.second.branch": _no_second,
    "fig7.peaks": _peaks7,
    "fig7.chaos": lambda results: CHAOS,
    "fig8.peaks.low": partial(_many_peaks, 22.0, 23.0),
    "fig8.peaks.high": partial(_many_peaks, 24.0, 26.0),
    "fig8.impacts": _impacts8,
    "fig9.orbits": _orbit9,
    "damping": _damping,
}
