"""Curves in one parameter reach the ends of their ranges."""

import numpy as np
import pytest

from nldyn import (
    ConstantForce,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    Unbalance,
    continue_branch,
    find_orbits,
    solve_orbit,
)
from nldyn.branches.endings import Ending


def single(stops, stiffness=1.0, damping=0.1, amplitude=1.0):
    """A mass on a spring."""
    return System.from_matrices(
        [[1.0]], [[stiffness]], {"x": [1.0]}, damping=[[damping]], stops=stops,
        excitation=[HarmonicForce("x", amplitude)],
    )  # fmt: skip


def endings(curve):
    return [reason.ending for reason in curve.stop_reasons]


def test_a_dashpot_that_never_pulls_goes_down_to_zero():
    """There it is the linear stop without one."""
    stop = Stop.linear("x", 10.0, gap=0.2, dashpot=0.5, pulls=False)
    curve = continue_branch(solve_orbit(single([stop]), 0.3), (0.0, 2.0), parameter="dashpot")
    assert endings(curve) == [Ending.PARAMETER_RANGE_END] * 2
    assert [*curve.values[[0, -1]]] == [0.0, 2.0]
    plain = solve_orbit(single([Stop.linear("x", 10.0, gap=0.2)]), 0.3)
    end = curve.points[0].max_abs_displacement
    assert end == pytest.approx(plain.max_abs_displacement, rel=1e-9)


@pytest.mark.parametrize("stops", [[], [RigidStop("x", 0.7, gap=0.0)]])
def test_orbits_that_shrink_in_proportion_end_at_rest(stops):
    """All of them, forced by F, are F times that of 1 N; the walk on their own scale has no end."""
    curve = continue_branch(solve_orbit(single(stops), 0.3), (0.0, 2.0), parameter="amplitude")
    assert endings(curve) == [Ending.SCALES_TO_REST, Ending.PARAMETER_RANGE_END]
    assert len(curve.points) < 40
    assert not curve.special_points
    assert not curve.notes
    sizes = np.array([orbit.max_abs_displacement for orbit in curve.points])
    forces = curve.values
    unit = sizes[-1] / forces[-1]
    np.testing.assert_allclose(sizes, unit * forces, rtol=1e-8)
    assert [forces[0], sizes[0]] == [0.0, 0.0]


def pushed(force):
    """A linear system under a constant force, and what is shaken as well."""
    return System.from_matrices(
        [[2.0, 0.3], [0.3, 1.0]], [[3.0, -1.0], [-1.0, 1.0]], {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        damping=0.1 * np.eye(2), excitation=[force],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("force", "name", "limits"),
    [
        (HarmonicForce("y", 1.0), "amplitude", (0.0, 2.0)),
        (Unbalance("x", 0.5), "mass_times_radius", (0.0, 2.0)),
        (ConstantForce("y", 0.4), "force", (0.0, 2.0)),
        (ConstantForce("y", 0.4), "force", (-1.0, 2.0)),
        (ConstantForce("y", -0.4), "force", (-1.0, 2.0)),
    ],
)
def test_a_linear_system_is_followed_to_rest_in_whatever_drives_it(force, name, limits):
    curve = continue_branch(solve_orbit(pushed(force), 0.13), limits, parameter=name)
    at_rest = curve.stop_reasons.index("the orbits shrink in proportion to "
                                       f"{name}, to rest where it is zero")  # fmt: skip
    assert len(curve.points) < 50
    assert not (curve.special_points or curve.notes)
    assert curve.values[-at_rest] == 0.0
    assert curve.points[-at_rest].max_abs_displacement == 0.0
    assert endings(curve)[1 - at_rest] is Ending.PARAMETER_RANGE_END


def test_a_range_is_crossed_where_an_impact_stays_long_beside_a_phase_of_shooting():
    """With other phases no impact meets one there, and the orbits at the end are the same."""
    walls = [RigidStop("x", 0.8, gap=1.0, direction=side) for side in (1, -1)]
    system = single(walls, stiffness=0.01, damping=0.0, amplitude=1.5)
    orbit = next(o for o in find_orbits(system, 0.2, 1) if o.impacts == 3)
    curve = continue_branch(orbit, (1.0, 8.0), parameter="amplitude")
    other = solve_orbit(system, 0.2, segments=3, guess=orbit.states(np.zeros(1))[0])
    again = continue_branch(other, (1.0, 8.0), parameter="amplitude")
    for found in (curve, again):
        assert endings(found) == [Ending.PARAMETER_RANGE_END] * 2
        assert [*found.values[[0, -1]]] == [8.0, 8.0]  # it turns on the way
    for end in (0, -1):
        a, b = (found.points[end].states(np.zeros(1))[0] for found in (curve, again))
        np.testing.assert_allclose(a, b, rtol=1e-8)
