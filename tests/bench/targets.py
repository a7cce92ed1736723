"""What the flow map is meant to reach, and whether it does."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bench import throughput
from bench.engines import NLDYN
from bench.measure import Sample, curve
from bench.ratios import seconds_at, times_faster
from bench.solids import MODES, SolidTime
from bench.studies import (
    AtlasTime,
    BranchTime,
    FirstCall,
    GrazingError,
    ImpactTime,
    ModesTime,
    VainSearch,
)

WANTED_ERROR = 1e-8
THROUGHPUT_GOALS = {"one_dof": 20000.0, "four_dof": 5000.0}


@dataclass(frozen=True)
class Target:
    """A goal, what was measured, and the verdict: met, missed, or not measured."""

    what: str
    goal: str
    measured: str
    verdict: str


def target(what: str, goal: str, measured: str, met: bool | None) -> Target:
    """A target with its verdict in words."""
    verdict = "not measured" if met is None else "met" if met else "missed"
    return Target(what, goal, measured, verdict)


def speed_target(
    samples: Sequence[Sample], model: str, title: str, rivals: tuple[str, ...], goal: float
) -> Target:
    """How much faster than the fastest of some rivals, at equal error."""
    ours = curve(samples, model, NLDYN, "worst")
    ratios = []
    for rival in rivals:
        ratio = times_faster(ours, curve(samples, model, rival, "worst"), WANTED_ERROR)
        if ratio is not None:
            ratios.append(ratio)
    worst = min(ratios, default=math.nan)
    measured = f"{worst:.3g} times" if ratios else "error not reached"
    return target(title, f"{goal:.3g} times", measured, worst >= goal if ratios else None)


def branch_targets(
    times: Sequence[BranchTime], goals: Mapping[str, tuple[float, float]]
) -> list[Target]:
    """Time of each branch, and how well its special points are located."""
    found = []
    for run in times:
        low, high = run.task.range_hz
        goal, aim = goals[run.task.model]
        name = f"harmonic branch of {run.task.model}, {low:g} to {high:g} Hz"
        found += [
            target(
                f"{name}, warm",
                f"{goal:g} s (aim {aim:g} s)",
                f"{run.seconds:.2f} s",
                run.seconds <= goal,
            ),
            target(
                f"{name}: every special point to 1e-9",
                "1e-9, none missed",
                f"{run.error:.1e}, {run.unmatched} of {run.special} unmatched",
                run.error <= 1e-9 and not run.unmatched,
            ),
            target(
                f"{name}: its time over that of one flow with monodromy matrix for each point",
                "2.5 times",
                f"{run.flows:.2f} times",
                None if math.isnan(run.flows) else run.flows <= 2.5,
            ),
        ]
    return found


def all_targets(
    samples: Sequence[Sample],
    default: str,
    branches: Sequence[BranchTime],
    modes: Sequence[ModesTime],
    grazing: Sequence[GrazingError],
    shares: Mapping[str, float],
    first: FirstCall | None,
) -> list[Target]:
    """All targets of the flow map, in order.

    Parameters
    ----------
    samples, branches, modes, grazing, first
        What was measured.
    default : str
        Label of the default setting among the samples.
    shares : mapping of str to float
        Shares of the subjects in the time of the 1-DOF branch.
    """
    rivals = {
        "DOP853 (equations in numpy)": ("solve_ivp DOP853 in numpy",),
        "DOP853 (equations compiled)": ("solve_ivp DOP853", "solve_ivp DOP853, events"),
        "heyoka (regularised)": ("heyoka, events, regularised",),
    }
    in_numpy, compiled, taylor = rivals
    found = [
        speed_target(
            samples,
            model,
            f"one orbit of {model} with all derivatives, error 1e-8, against {rival}",
            rivals[rival],
            goal,
        )
        for model, rival, goal in (
            ("one_dof", taylor, 1.0),
            ("two_dof", taylor, 1.0),
            ("four_dof", compiled, 400.0),
            ("sixteen_dof", compiled, 1500.0),
            ("one_dof", in_numpy, 500.0),
            ("four_dof", in_numpy, 300.0),
        )
    ]
    found += branch_targets(branches, {"one_dof": (0.4, 0.1), "four_dof": (0.5, 0.27)})
    if grazing:
        worst = max(g.monodromy for g in grazing)
        times = [g.seconds for g in grazing]
        slowest = max(times) / times[0]
        found.append(
            target(
                "monodromy error at grazing, no step-size collapse",
                "1e-8, no touch takes twice the time of the deepest",
                f"{worst:.1e}, {slowest:.1f} times",
                worst <= 1e-8 and slowest <= 2.0,
            )
        )
    if len(modes) > 1:
        growth = modes[-1].seconds / modes[0].seconds
        allowed = modes[-1].modes / modes[0].modes
        found.append(
            target(
                f"{modes[0].modes} to {modes[-1].modes} modes",
                f"at most {allowed:.0f} times the time",
                f"{growth:.1f} times",
                growth <= allowed,
            )
        )
    found += default_targets(samples, default)
    if shares:
        share = sum(v for k, v in shares.items() if k.startswith("flow map"))
        found.append(
            target(
                "flow map's share in the time of the 1-DOF branch",
                "at least half",
                f"{share:.0%}",
                share >= 0.5,
            )
        )
    if first is not None:
        seconds = first.orbit
        found.append(target("import and first orbit", "2 s", f"{seconds:.1f} s", seconds <= 2.0))
    return found


def throughput_targets(rows: Sequence[throughput.Row]) -> list[Target]:
    """Periods per second and core of plain simulation."""
    found = []
    for model, goal in THROUGHPUT_GOALS.items():
        if any(row.model == model for row in rows):
            rate = throughput.rate_at(rows, model, throughput.FLOW)
            found.append(
                target(
                    f"plain simulation of {model}, error {throughput.WANTED:.0e} over a period",
                    f"{goal:.0f} periods per second and core",
                    "error not reached" if rate is None else f"{rate:.0f}",
                    None if rate is None else rate >= goal,
                )
            )
    return found


def resonance_target(rates: Mapping[float, float]) -> Target:
    """Periods per second of the 4-DOF model where several impacts follow each other."""
    slowest, fastest = min(rates.values()), max(rates.values())
    return target(
        f"plain simulation of four_dof, default options, {min(rates):g} to {max(rates):g} Hz",
        "15000 periods per second and core",
        f"{slowest:.0f} to {fastest:.0f}",
        slowest >= 15000.0,
    )


def impact_target(impacts: Sequence[ImpactTime]) -> Target:
    """How much longer an impact takes with more modes."""
    growth = impacts[-1].seconds / impacts[0].seconds
    return target(
        f"an impact with {impacts[-1].modes} modes against one with {impacts[0].modes}",
        "at most 4 times the time",
        f"{growth:.1f} times",
        growth <= 4.0,
    )


def atlas_target(sample: Sequence[AtlasTime]) -> Target:
    """Processor time of the whole atlas, by a sample of its starts."""
    minutes = sum(chart.minutes for chart in sample)
    goal = "20 min of processor time"
    return target("the atlas, by a sample", goal, f"{minutes:.0f} min", minutes <= 20.0)


def search_targets(searches: Sequence[VainSearch]) -> list[Target]:
    """How long a search takes that finds nothing."""
    return [
        target(
            f"`solve_orbit` that finds none, {search.modes} modes",
            "a sentence after at most 5 s",
            f"{search.seconds:.1f} s" if search.vain else "it finds one",
            search.seconds <= 5.0 if search.vain else None,
        )
        for search in searches
    ]


def default_targets(samples: Sequence[Sample], default: str) -> list[Target]:
    """Accuracy of the default and of the tightest setting, over all models."""
    ours = [s for s in samples if s.engine == NLDYN and not s.note]
    at_default = [s for s in ours if s.setting == default]
    if not at_default:
        return []
    state = max(s.state for s in at_default)
    monodromy = max(s.monodromy for s in at_default)
    tightest = max(min(s.worst for s in ours if s.model == m) for m in {s.model for s in ours})
    return [
        target("default setting: error of the state", "1e-9", f"{state:.1e}", state <= 1e-9),
        target(
            "default setting: error of the monodromy matrix",
            "1e-8",
            f"{monodromy:.1e}",
            monodromy <= 1e-8,
        ),
        target("tightest setting: all errors", "1e-12", f"{tightest:.1e}", tightest <= 1e-12),
    ]


def fastest_rows(
    samples: Sequence[Sample], models: Sequence[str], wanted: Sequence[float]
) -> list[dict[str, str]]:
    """The fastest engine of each model at each error."""
    rows = []
    for model in models:
        row = {"model": model}
        for error in wanted:
            times = {
                engine: seconds_at(curve(samples, model, engine, "worst"), error)
                for engine in dict.fromkeys(s.engine for s in samples)
            }
            reached = {engine: t for engine, t in times.items() if t is not None}
            row[f"at {error:.0e}"] = min(reached, key=reached.__getitem__) if reached else "none"
        rows.append(row)
    return rows


def ratio_rows(
    samples: Sequence[Sample],
    models: Sequence[str],
    engines: Sequence[str],
    wanted: Sequence[float],
) -> list[dict[str, str]]:
    """Times of all engines at equal error, and the ratio to ours, as a table."""
    rows = []
    for model in models:
        ours = curve(samples, model, NLDYN, "worst")
        for engine in engines:
            theirs = curve(samples, model, engine, "worst")
            row = {"model": model, "engine": engine}
            for error in wanted:
                seconds = seconds_at(theirs, error)
                ratio = times_faster(ours, theirs, error)
                row[f"ms at {error:.0e}"] = "" if seconds is None else f"{1e3 * seconds:.3g}"
                row[f"times nldyn at {error:.0e}"] = "" if ratio is None else f"{ratio:.3g}"
            rows.append(row)
    return rows


def solid_targets(ours: SolidTime, peer: SolidTime) -> list[Target]:
    """Time and memory of the modes of a solid from its mesh, against a peer from the matrices."""
    what = f"{MODES} modes of a solid of {ours.size} degrees of freedom, from the mesh"
    times = ours.seconds / peer.seconds
    memory = ours.gigabytes / peer.gigabytes
    return [
        target(
            f"{what}, against those {peer.what}",
            "at most 1.25 times its time of the processor",
            f"{times:.2f} times",
            times <= 1.25,
        ),
        target(f"{what}: memory", "no more than the other", f"{memory:.2f} times", memory <= 1.0),
    ]
