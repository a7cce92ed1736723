"""Orbits, special points and curves of the bilinear oscillator against its piecewise solution.

`bilinear.PiecewiseOrbit` solves the same equations with closed forms and thirty digits; it shares
no code with the flow map, the shooting equations or the location of special points.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bilinear import Bilinear, PiecewiseOrbit
from legs import leg_from

from nldyn import continue_branch, continue_special, solve_orbit
from nldyn.bifurcations.period_doubling import switch_at_flip

OSCILLATOR = Bilinear(damping=0.04, stiffness=1.0, stop=40.0, gap=0.0, force=1.0)
MULTIPLIER = {"LP": 1, "PD": -1}


def exact_frequency(kind, orbit, oscillator=OSCILLATOR) -> float:
    """Frequency in Hz of the special point near an orbit by the piecewise solution."""
    guess = PiecewiseOrbit.near(oscillator, orbit)
    if kind != "GR":
        return guess.at_multiplier(MULTIPLIER[kind]).frequency_hz
    shares = np.linspace(0.02, 0.98, 97)
    nearest = min(shares, key=lambda share: abs(guess.last_flight(share)[0]))
    return guess.at_touch(nearest).frequency_hz


@pytest.fixture(scope="module")
def branch():
    return continue_branch(solve_orbit(OSCILLATOR.system, 0.35), (0.085, 1.0))


@pytest.mark.parametrize("frequency_hz", [0.09, 0.125, 0.16, 0.3])
def test_orbit_has_the_switches_and_multipliers_of_the_piecewise_solution(frequency_hz):
    orbit = solve_orbit(OSCILLATOR.system, frequency_hz)
    exact = PiecewiseOrbit.near(OSCILLATOR, orbit).solved()
    assert orbit.impacts == (len(exact.unknowns) - 2) // 2
    phase, speed = map(float, exact.unknowns[:2])
    x, v = orbit.states(np.array([phase]))[0]
    assert x / orbit.max_abs_displacement == pytest.approx(OSCILLATOR.gap, abs=1e-9)
    assert v == pytest.approx(speed, rel=1e-9)
    monodromy = np.array(exact.monodromy().tolist(), dtype=float)
    expected = np.sort_complex(np.linalg.eigvals(monodromy))
    assert np.sort_complex(orbit.multipliers) == pytest.approx(expected, rel=1e-9)


def test_every_special_point_of_the_branch_is_where_the_piecewise_solution_has_it(branch):
    kinds = [special.kind for special in branch.special_points]
    assert sorted(kinds) == ["GR", "GR", "LP", "LP", "PD", "PD", "PD", "PD", "PD", "PD"]
    for special in branch.special_points:
        expected = exact_frequency(special.kind, special.orbit)
        assert special.frequency_hz == pytest.approx(expected, rel=1e-11)


def test_flip_of_doubled_orbits_is_where_the_piecewise_solution_has_it(branch):
    start = switch_at_flip(branch.special_points[-1])
    located = leg_from(start, (0.2, 0.6)).special_points
    special = next(s for s in located if s.kind == "PD")
    assert special.orbit.period == 2
    expected = exact_frequency("PD", special.orbit)
    assert special.frequency_hz == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(("kind", "index"), [("LP", 0), ("PD", -1), ("GR", 0)])
@pytest.mark.parametrize(
    ("parameter", "field", "window"),
    [
        ("gap", "gap", (-0.2, 0.3)),
        pytest.param("stiffness", "stop", (25.0, 60.0), marks=pytest.mark.slow),
    ],
)
def test_curve_in_two_parameters_is_that_of_the_piecewise_solution(
    branch, kind, index, parameter, field, window
):
    special = [s for s in branch.special_points if s.kind == kind][index]
    curve = continue_special(special, ("frequency_hz", parameter), ((0.05, 1.0), window))
    assert len(curve.points) > 8
    assert np.ptp(curve.values[:, 1]) > 0.2 * (window[1] - window[0])
    for k in np.linspace(0, len(curve.points) - 1, 5).astype(int):
        frequency_hz, value = curve.values[k]
        changed = replace(OSCILLATOR, **{field: float(value)})
        expected = exact_frequency(kind, curve.orbits[k], changed)
        assert frequency_hz == pytest.approx(expected, rel=1e-9)
