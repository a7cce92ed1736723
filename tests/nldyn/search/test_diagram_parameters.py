"""Diagrams over the gap, the force, the damping and the restitution at one frequency."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bilinear import Bilinear, PiecewiseOrbit
from one_impact import OneImpact
from paper.jobs import scene_system
from scipy.optimize import brentq

import nldyn
from nldyn import (
    ContinuationOptions,
    ExploreOptions,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    continue_special,
    diagram,
    explore,
    extend_diagram,
    index_sum,
    solve_orbit,
)
from nldyn.bifurcations.point import SpecialPoint
from nldyn.io import CheckpointFile
from nldyn.orbits import OrbitSearchOptions
from nldyn.orbits.orbit import minimal_period
from nldyn.search import ClosedWalks, Mixtures, PseudoOrbits, SubharmonicSeed
from nldyn.search.fixed_point_index import index_gaps
from nldyn.system.chart import OwnParameter, value_of, with_value
from nldyn.system.parameters import Parameter

QUICK = {"search_points": 4, "search": OrbitSearchOptions(starts=2)}
FEW = ContinuationOptions(max_points=6)
GAPS = (0.0, 5e-5)


def one_mode(gap: float = 1e-6) -> System:
    return System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9, gap=gap)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip


def rigid() -> System:
    return System.from_matrices(
        [[1.0]], [[1.0]], {"m": [1.0]}, damping=[[0.1]],
        stops=[RigidStop("m", gap=0.0721, restitution=0.7)], excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip


def in_frequency(special) -> list[SpecialPoint]:
    """Points of its kind that a branch in the frequency has near it, begun beside it."""
    hz, found = special.frequency_hz, []
    near = continue_branch(special.orbit, (0.999 * hz, 1.001 * hz), options=FEW)
    beside = [orbit for orbit in near.points if minimal_period(orbit) == orbit.period]
    for orbit in (beside[-1], beside[0]):  # at the very end it may have joined another branch
        branch = continue_branch(orbit, (0.998 * hz, 1.002 * hz))
        found += [s for s in branch.special_points if s.kind == special.kind]
    return found


def off_in_frequency(special) -> float:
    """How far, relatively, the point lies from that of a branch in the frequency, at its value."""
    return min(abs(s.frequency_hz / special.frequency_hz - 1.0) for s in in_frequency(special))


def off_on_curve(special) -> float:
    """How far, relatively, it lies from a curve begun on a branch in the frequency, elsewhere."""
    axes = "frequency_hz", special.point.family.charts[0].parameter
    ranges = [(0.99 * value, 1.01 * value) for value in (special.frequency_hz, special.value)]
    through = continue_special(special, axes, ranges, options=FEW)
    here = int(np.argmin(np.abs(through.values[:, 0] - special.frequency_hz)))
    away = through.points[here + 1]
    there = min(
        in_frequency(SpecialPoint(special.kind, away, 0.0)),
        key=lambda s: abs(s.frequency_hz - away.orbit.frequency_hz),
    )
    curve = continue_special(there, axes, ranges)
    met = curve.at("frequency_hz", special.frequency_hz)
    return min(abs(value_of(o.system, o.frequency_hz, axes[1]) / special.value - 1) for o in met)


def special_points(found, least: int) -> list[SpecialPoint]:
    special = [s for branch in found.branches for s in branch.special_points]
    assert len(special) >= least
    return special


@pytest.fixture(scope="module")
def over_gap():
    return diagram(one_mode(), GAPS, (1, 2), parameter="gap", frequency_hz=23.0, **QUICK)


def test_every_special_point_is_one_in_the_frequency():
    beam = scene_system("two_dof_xi_0.01")
    found = diagram(beam, GAPS, (1, 2), parameter="gap", frequency_hz=23.0, **QUICK)
    assert [s for s in special_points(found, 12) if not off_in_frequency(s) < 1e-8] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "limits", "hz", "least"),
    [
        ("gap", GAPS, 23.0, 12),
        ("gap", GAPS, 36.0, 50),
        ("mass_times_radius", (1e-6, 2e-5), 36.0, 7),
        ("modal_damping", (2e-3, 0.05), 36.0, 2),
        ("restitution", (0.3, 0.98), 0.4, 1),
    ],
)
def test_special_points_are_ones_in_the_frequency_and_on_curves(name, limits, hz, least):
    system = rigid() if name == "restitution" else scene_system("two_dof_xi_0.01")
    found = diagram(system, limits, (1, 2), parameter=name, frequency_hz=hz, **QUICK)
    for special in special_points(found, least):
        assert off_in_frequency(special) < 1e-8
        assert off_on_curve(special) < 1e-8


def test_folds_over_the_gap_lie_on_the_curve_of_folds(over_gap):
    """The curve is begun at the fold of a branch in the frequency, at another gap."""
    wide = one_mode(2e-5)
    branch = continue_branch(solve_orbit(wide, 11.0), (10.0, 30.0))
    starts = [s for s in branch.special_points if s.kind == "LP"]
    ranges = (10.0, 40.0), (1e-6, 5e-5)
    folds = [s for b in over_gap.branches for s in b.special_points if s.kind == "LP"]
    crossed = [
        orbit.system.stops[0].gap
        for start in starts
        for orbit in continue_special(start, ("frequency_hz", "gap"), ranges).at("frequency_hz", 23)
    ]
    assert len(folds) == 2
    for fold in folds:
        assert min(abs(gap / fold.value - 1.0) for gap in crossed) < 1e-8


def test_the_flip_over_the_restitution_has_a_closed_form():
    asked = partial(diagram, rigid(), (0.3, 0.98), (1, 2), frequency_hz=0.4, **QUICK)
    found = asked(parameter="restitution")

    def off(restitution):
        exact = OneImpact(1.0, 1.0, 0.1, [1.0], [1.0], 0.0721, restitution)
        return np.prod(exact.motions(0.8 * np.pi, 1)[0].multipliers + 1.0).real

    flips = [s.value for b in found.of_period(1) for s in b.special_points if s.kind == "PD"]
    assert flips == pytest.approx([brentq(off, 0.3, 0.98, xtol=1e-14)], rel=1e-8)
    (doubled,) = found.of_period(2)
    assert np.abs(doubled.values[[0, -1]] - flips[0]).min() < 1e-6


def test_the_flip_of_a_bilinear_oscillator_over_the_ratio_of_stiffnesses():
    """The ratio is a function of the user's own; the motion in two pieces is solved for."""
    oscillator = Bilinear(0.1, 1.0, 5.0, 0.3, 1.0)
    ratio = OwnParameter(
        name="ratio",
        value=lambda system: system.stops[0].stiffness,  # over a stiffness of one
        changed=lambda system, value: with_value(system, Parameter("stiffness"), value),
    )
    found = diagram(
        oscillator.system, (0.5, 60.0), [1], parameter=ratio, frequency_hz=0.33, **QUICK
    )
    (flip,) = [s for b in found.branches for s in b.special_points]
    exact = Bilinear(0.1, 1.0, flip.value, 0.3, 1.0)
    at_flip = PiecewiseOrbit.near(exact, flip.orbit).solved().at_multiplier(-1)
    assert flip.kind == "PD"
    assert at_flip.frequency_hz == pytest.approx(0.33, rel=1e-8)
    assert "ratio = 0.5 to 60 at 0.33 Hz" in repr(found)
    with pytest.raises(SystemModelError, match="is a function of your own"):
        nldyn.save(found, "ratio.h5")


def test_indices_add_up_to_one_at_every_gap(over_gap):
    assert index_gaps(over_gap.branches, GAPS) == []
    assert [index_sum(over_gap.branches, gap) for gap in (1e-6, 2e-5, 4e-5)] == [1, 1, 1]
    with pytest.raises(SystemModelError, match="branches must not be empty"):
        index_sum([], 1e-6)
    with pytest.raises(SystemModelError, match=r"which does not tell of gap = 0\.0001 m"):
        index_sum(over_gap.branches, 1e-4)


def test_a_diagram_is_kept_and_says_what_it_is_drawn_over(over_gap, tmp_path):
    nldyn.save(over_gap, tmp_path / "gap.h5")
    back = nldyn.load(tmp_path / "gap.h5")
    assert repr(back) == repr(over_gap)
    assert "gap = 0 to 5e-05 m at 23 Hz" in repr(back)
    assert (back.parameter, back.frequency_hz, back.limits) == (Parameter("gap"), 23.0, GAPS)
    for a, b in zip(back.branches, over_gap.branches, strict=True):
        assert np.array_equal(a.values, b.values)
    table = back.table("special_points")
    assert {"gap", "gap_error"} <= set(table)


def test_an_interrupted_diagram_goes_on_to_the_last_bit(over_gap, tmp_path):
    kept = CheckpointFile(tmp_path / "kept.h5")

    def stop(what, hz, done):
        stop.calls += 1
        if stop.calls > 60:
            raise KeyboardInterrupt

    stop.calls = 0
    asked = partial(
        diagram, one_mode(), GAPS, (1, 2), parameter="gap", frequency_hz=23.0, checkpoint=kept,
        **QUICK,
    )  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        asked(progress=stop)
    found = asked()
    for a, b in zip(found.branches, over_gap.branches, strict=True):
        assert np.array_equal(a.values, b.values)
        assert np.array_equal(a.nodes[-1].point, b.nodes[-1].point)
    with pytest.raises(SystemModelError, match="holds branches of another"):
        diagram(one_mode(), GAPS, parameter="gap", frequency_hz=22.0, checkpoint=kept)


@pytest.mark.parametrize("strategy", [PseudoOrbits(5), Mixtures(5), ClosedWalks(50, 5)])
def test_strategies_find_the_other_half_over_the_gap(over_gap, strategy):
    """Of the bistable range, from the branch at rest alone: each guess ends on known orbits."""
    found = extend_diagram(over_gap, strategy, max_period=1, limits=(1e-5, 2e-5), spacing=0.1)
    assert len(found.branches) == len(over_gap.branches)
    assert "led to an orbit" in found.notes[-1]
    assert "add up to one from gap = 0 to 5e-05 m" in found.notes[-2]


def test_exploring_over_the_gap_finds_what_the_diagram_has(over_gap):
    effort = ExploreOptions(spacing=0.25, starts=2, walks=2, walk_states=30, mixtures=2)
    found = explore(one_mode(), GAPS, 1, parameter="gap", frequency_hz=23.0, effort=effort)
    assert found.settled_share == 1.0
    assert [c.value for c in found.coverage] == np.linspace(*GAPS, 5).tolist()
    (branch,), (other,) = found.diagram.branches, over_gap.branches
    assert branch.at(1e-5)[0].max_abs_displacement in [
        pytest.approx(orbit.max_abs_displacement, rel=1e-8) for orbit in other.at(1e-5)
    ]
    said = found.report()
    assert said.startswith("gap = 0 to 5e-05 m at 23 Hz: 1 branch (1 harmonic)")
    assert "simulations at 5 values of the gap, 100.0 % ended" in said


def test_damping_changes_the_coordinates_and_not_the_orbits():
    """Searches carry states from one damping to the next in the coordinates of the first."""
    effort = ExploreOptions(
        spacing=0.5, starts=1, walks=0, pseudo_orbits=0, mixtures=2, unstable_period=1
    )
    found = explore(
        one_mode(), (0.01, 0.03), 1, parameter="modal_damping", frequency_hz=23.0, effort=effort
    )
    for branch in found.diagram.branches:
        for orbit in branch.at(0.02):
            system = with_value(one_mode(), branch.parameter, 0.02)
            again = solve_orbit(system, 23.0, guess=orbit.states(orbit.problem.phases[:-1]),
                                segments=orbit.problem.segments)  # fmt: skip
            assert again.max_abs_displacement == pytest.approx(orbit.max_abs_displacement, rel=1e-8)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"parameter": "gap"}, "parameter 'gap': needs frequency_hz"),
        ({"parameter": "width", "frequency_hz": 23.0}, "unknown parameter 'width'"),
        ({"frequency_hz": 23.0}, "frequency_hz is what parameter 'frequency_hz' changes"),
        ({"parameter": "restitution", "frequency_hz": 23.0}, "is elastic, without restitution"),
        (
            {"parameter": "gap", "frequency_hz": 23.0, "seeds": [SubharmonicSeed(2, 1e-3)]},
            r"near = 0.001 lies outside the range of gap \(0, 5e-05\)",
        ),
    ],
)
def test_bad_questions_are_refused(given, says):
    with pytest.raises(SystemModelError, match=says):
        diagram(one_mode(), GAPS, (1,), **given)


def test_known_branches_belong_to_the_question(over_gap):
    asked = partial(explore, one_mode(), GAPS, 1, parameter="gap", known=over_gap)
    with pytest.raises(SystemModelError, match="known: is of gap = 0 to 5e-05 m at 23 Hz, but"):
        asked(frequency_hz=22.0)
    with pytest.raises(SystemModelError, match="was followed in gap at 23 Hz, not in the"):
        extend_diagram(replace(over_gap, parameter=Parameter("frequency_hz"), frequency_hz=None,
                               limits=(20.0, 30.0)), Mixtures(5))  # fmt: skip
