"""Two branches of orbits that cross: a transcritical branch point.

To the system of `test_mathieu` two stops at y are added whose forces cancel at y = 0 but
bend differently, k(p + y)² against k(p - y)³ with p = 1. So y = 0 still is an orbit, on which y
obeys Mathieu's equation, but y and -y are no longer alike: where a multiplier of y is 1, another
branch goes through from y > 0 to y < 0.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from branches_alike import assert_same_branches
from independent import mathieu_multipliers_of

from nldyn import (
    ContinuationOptions,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    continue_special,
    describe_special,
    solve_orbit,
)
from nldyn.bifurcations.normal_forms import other_tangent, switch_at_branch_point
from nldyn.curves import refine_special
from nldyn.orbits.orbit import Orbit

FORCE, DAMPING_X, DAMPING_Y = 9.0, 0.1, 0.02
OWN_X, OWN_Y, PRELOAD = 20.0, 1.0, 1.0
SPRING_X, SPRING_Y = OWN_X + 8.0, OWN_Y + 4.0 + 2.0 + 3.0


def system(preload_y: float = PRELOAD) -> System:
    """Its branches cross at the smaller an angle the less the two stops at y are preloaded."""
    p = preload_y
    quadratic = [Stop(at, 1.0, 2.0, gap=-PRELOAD) for at in ("x + y", "x - y")]
    quadratic.append(Stop("y", 1.0 / p, 2.0, gap=-p))
    others = [Stop("x", 2.0, 2.0, -PRELOAD, -1), Stop("y", 1.0 / p**2, 3.0, -p, -1)]
    return made_of(OWN_Y, [*quadratic, *others])


def made_of(own_y: float, stops: list[Stop]) -> System:
    return System.from_matrices(
        np.eye(2), np.diag([OWN_X, own_y]),
        {"x": [1.0, 0.0], "y": [0.0, 1.0], "x + y": [1.0, 1.0], "x - y": [1.0, -1.0]},
        damping=np.diag([DAMPING_X, DAMPING_Y]), stops=stops,
        excitation=[HarmonicForce("x", FORCE)],
    )  # fmt: skip


def multipliers_of_y(hz, force=FORCE):
    omega = 2.0 * math.pi * hz
    amplitude = abs(force / (SPRING_X - omega**2 + 1j * DAMPING_X * omega))
    return mathieu_multipliers_of(omega, SPRING_Y, 4.0 * amplitude, DAMPING_Y)


@pytest.fixture(scope="module")
def branch():
    return branch_without_y()


@cache
def branch_without_y(preload_y=PRELOAD):
    hz = 0.45
    orbit = solve_orbit(system(preload_y), hz, guess=orbit_without_y(hz), observe="y")
    return continue_branch(orbit, (hz, 0.56))


def orbit_without_y(hz):
    omega = 2.0 * math.pi * hz
    response = FORCE / (SPRING_X - omega**2 + 1j * DAMPING_X * omega)
    shape = system().participation["x"]
    return np.outer([response.real, (1j * omega * response).real], shape).ravel()


def bent_slightly(bend: float) -> System:
    """Stops at y bend so little that the other branch is folded close to where it crosses."""
    stiff = 0.1
    stops = [Stop(at, 1.0, 2.0, gap=-PRELOAD) for at in ("x + y", "x - y")]
    stops += [Stop("x", 2.0, 2.0, -PRELOAD, -1)]
    stops += [Stop("y", stiff, 3.0, -1.0, side) for side in (1, -1)]
    stops += [Stop("y", bend, 2.0, -1.0), Stop("y", bend, 3.0, -1.0, -1)]
    own_y = SPRING_Y - 4.0 - 6.0 * stiff - 5.0 * bend
    return made_of(own_y, stops)


@pytest.fixture(scope="module")
def crossed():
    """Where the branch without y is crossed by one that is folded close by."""
    hz = 0.45
    orbit = solve_orbit(bent_slightly(2e-3), hz, guess=orbit_without_y(hz), observe="y")
    special = continue_branch(orbit, (hz, 0.501)).special_points[0]
    assert special.kind == "BP"
    return special


@pytest.mark.parametrize(
    ("beside", "step"),
    [
        (9e-6, 0.01),
        pytest.param(2e-6, 0.05, marks=pytest.mark.slow),
        pytest.param(-5e-6, 0.01, marks=pytest.mark.slow),
    ],
)
def test_a_fold_beyond_a_branch_point_beside_the_start_is_told(crossed, beside, step):
    """There the tangent may be of both branches, and its sign that of no fold."""
    special = crossed
    window = 0.9 * special.frequency_hz, 1.1 * special.frequency_hz
    few = ContinuationOptions(first_step=step, max_step=step, max_points=2)
    begun = orbit_along(special, other_tangent(special), beside)
    branch = continue_branch(begun, window, options=few)
    fold, crossing = sorted(branch.special_points, key=lambda s: s.frequency_hz)
    assert (fold.kind, crossing.kind) == ("LP", "BP")
    assert crossing.frequency_hz == pytest.approx(special.frequency_hz, rel=1e-9)
    assert fold.frequency_hz == pytest.approx(refine_special(fold).frequency_hz, rel=1e-9)
    assert np.all(branch.frequency_hz > fold.frequency_hz)


def orbit_along(special, tangent, beside):
    """Orbit at a distance from a branch point, of the branch with a tangent."""
    problem, place = special.orbit.problem, special.orbit.point
    across = problem.metric(place) * tangent
    found = problem.correct(place + beside * tangent, across / np.linalg.norm(across))
    return Orbit.of(problem, found, "y")


@pytest.mark.parametrize("preload_y", [1.0, 1e-3])
def test_branch_points_are_where_a_multiplier_of_mathieus_equation_is_one(preload_y):
    points = branch_without_y(preload_y).special_points
    assert [s.kind for s in points] == ["BP", "BP"]
    for special in points:
        assert np.abs(multipliers_of_y(special.frequency_hz) - 1.0).min() < 1e-8
        refined = refine_special(special)
        assert refined.frequency_hz == pytest.approx(special.frequency_hz, rel=1e-9)
        assert "transcritical" in describe_special(special)


@pytest.mark.parametrize("index", [0, 1])
def test_the_other_branch_goes_through_and_exchanges_stability(branch, index):
    """To either side of the point it has the multiplier on the other side of 1."""
    special = branch.special_points[index]
    starts = switch_at_branch_point(special, 1e-3)
    sides = np.sign([s.orbit.frequency_hz - special.frequency_hz for s in starts])
    assert sorted(sides) == [-1.0, 1.0]
    for start in starts:
        assert start.orbit.max_abs_displacement > 1e-5  # of y, zero on the first branch
        own = multipliers_of_y(start.orbit.frequency_hz)
        critical = own[np.argmin(np.abs(own - 1.0))].real
        mu = start.orbit.multipliers
        other = mu[np.argmin(np.abs(mu - 1.0))].real
        assert (critical - 1.0) / (other - 1.0) == pytest.approx(-1.0, rel=0.1)


def test_transcritical_points_are_followed_where_y_can_stay_zero(branch):
    """Force and frequency leave y = 0 an orbit; the gap of a stop at y does not."""
    special = branch.special_points[0]
    few = ContinuationOptions(max_points=5)
    window = ((0.4, 0.6), (7.0, 12.0))
    curve = continue_special(special, ("frequency_hz", "amplitude"), window, options=few)
    assert np.ptp(curve.values[:, 1]) > 0.5
    for hz, force in curve.values:
        assert np.abs(multipliers_of_y(hz, force) - 1.0).min() < 1e-8
    gap = Parameter("gap", 2)
    with pytest.raises(SystemModelError, match="dissolves when frequency_hz or gap changes"):
        continue_special(special, ("frequency_hz", gap), ((0.4, 0.6), (-1.1, -0.9)))


@pytest.mark.parametrize("beside", [3.2e-7, pytest.param(-5e-7, marks=pytest.mark.slow)])
def test_a_branch_begun_beside_a_branch_point_has_it_once(beside):
    """There rounding decides the sign of the branch point's test, in both directions."""
    special = branch_without_y().special_points[1]
    window = 0.9995 * special.frequency_hz, 1.0005 * special.frequency_hz
    few = ContinuationOptions(first_step=0.001, max_step=3e-3, max_points=3)
    more = replace(few, max_points=5)
    orbit = orbit_along(special, other_tangent(special), beside)
    branch = continue_branch(orbit, window, options=few)
    longer = continue_branch(branch, options=more)
    for told in (branch, longer):
        assert [s.kind for s in told.special_points] == ["BP"]
    assert_same_branches(longer, continue_branch(orbit, window, options=more))


@pytest.mark.parametrize(
    ("preload_y", "beside"),
    [
        *((1.0, -3e-5), (1e-3, 5e-7)),
        pytest.param(1.0, 1e-4, marks=pytest.mark.slow),
        *(
            pytest.param(preload_y, beside, marks=pytest.mark.slow)
            for preload_y in (1.0, 1e-3)
            for beside in (-3e-6, -5e-7, 2e-6)
        ),
    ],
)
def test_a_walk_begun_beside_the_point_stays_on_its_branch_and_finds_it(preload_y, beside):
    """Also where the other branch crosses at an angle of 0.08."""
    special = branch_without_y(preload_y).special_points[0]
    tangents = special.point.tangent, other_tangent(special)
    window = 0.998 * special.frequency_hz, 1.002 * special.frequency_hz
    for tangent, has_y in zip(tangents, (False, True), strict=True):
        walked = continue_branch(orbit_along(special, tangent, beside), window)
        assert walked.stop_reasons == ("end of the frequency range",) * 2
        assert [s.kind for s in walked.special_points] == ["BP"]
        assert walked.special_points[0].frequency_hz == pytest.approx(
            special.frequency_hz, rel=1e-9
        )
        ends = [walked.points[i].max_abs_displacement for i in (0, -1)]
        assert (min(ends) > 1e-6) == has_y == (max(ends) > 1e-9)


@pytest.mark.parametrize(
    ("end", "longest"), [(0.52, 0.05), pytest.param(0.504, 0.3, marks=pytest.mark.slow)]
)
def test_two_branch_points_within_one_of_the_last_steps_are_both_found(end, longest):
    """There y and -y are alike: stops that bend the same way put pitchforks at the same places."""
    hz, bend = 0.45, 0.1
    own_y = SPRING_Y - 4.0 - 6.0 * bend
    stops = [Stop(at, 1.0, 2.0, gap=-PRELOAD) for at in ("x + y", "x - y")]
    stops += [Stop("x", 2.0, 2.0, -PRELOAD, -1)]
    stops += [Stop("y", bend, 3.0, -1.0, side) for side in (1, -1)]
    alike = made_of(own_y, stops)
    orbit = solve_orbit(alike, hz, guess=orbit_without_y(hz), observe="y")
    options = ContinuationOptions(max_step=longest)
    branch = continue_branch(orbit, (hz, end), options=options)
    assert [s.kind for s in branch.special_points] == ["BP", "BP"]
    low, high = (s.frequency_hz for s in branch.special_points)
    assert not any(low < node.orbit.frequency_hz < high for node in branch.nodes)
    assert not branch.notes
    for special in branch.special_points:
        assert np.abs(multipliers_of_y(special.frequency_hz) - 1.0).min() < 1e-8
