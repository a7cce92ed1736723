"""Orbits are carried through systems with more or less damping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from independent import Motion

from nldyn import Damper, HarmonicForce, Stop, System, solve_orbit
from nldyn.orbits.homotopy import Homotopy, _far
from nldyn.orbits.orbit import Orbit


def two_modes() -> System:
    """A stop that touches one of two modes."""
    return System.from_modal(
        [10.0, 30.307], {"tip": [1.0, -1.2178], "force": [1.0, 1.0309]},
        modal_damping=0.013513, stops=[Stop("tip", 3.5791e7)],
        excitation=[HarmonicForce("force", 7.4926)],
    )  # fmt: skip


def runge_kutta_gap(orbit: Orbit, system: System) -> float:
    """How far from closing an orbit of one period is by another integration, relative."""
    start = orbit.states([0.0])[0]
    end, *_ = Motion(system).run(start, (0.0, 2.0 * np.pi), orbit.omega, tangent=False)
    scale = np.repeat([1.0, orbit.omega], 2) * np.abs(start[:2]).max()
    return float(np.abs((end - start) / scale).max())


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_carried_there_and_back_an_orbit_is_the_same(factor):
    system = replace(two_modes(), dampers=(Damper("tip", 0.3),))
    orbit = solve_orbit(system, 10.0)
    way = Homotopy(orbit.problem.flow, factor)
    other = way.carried(orbit, 0.0, 1.0)
    there = other.system
    assert np.allclose(there.damping, factor * system.damping, rtol=1e-12)
    assert there.dampers[0].coefficient == pytest.approx(0.3 * factor, rel=1e-12)
    assert other.frequency_hz == pytest.approx(10.0, rel=1e-14)
    assert runge_kutta_gap(other, there) < 1e-8
    back = way.carried(other, 1.0, 0.0)
    assert np.abs(back.point - orbit.point).max() < 1e-9 * np.abs(orbit.point[:-1]).max()


@pytest.mark.parametrize("size", [1.0, 1e-6])
@pytest.mark.parametrize(
    ("states", "frequency", "first_far"), [(0.1, 0.0, True), (0.0, 0.1, True), (3e-3, 4e-3, False)]
)
def test_far_is_told_of_states_and_of_frequencies(size, states, frequency, first_far):
    """What was missed, over the way, and for the first step over the orbit."""
    there = np.array([3.0 * size, 4.0 * size, 5.0])
    way = np.array([3.0 * size * states, 4.0 * size * states, frequency])
    before = [(0.0, there - 2.0 * way), (0.5, there - way)]
    for miss, far in ((0.25, False), (0.35, True)):
        assert _far(there, there - miss * way, before) == far
    assert _far(there, there - 0.25 * way, before[:1]) == first_far


def test_an_orbit_far_from_where_it_was_expected_is_not_taken(monkeypatch):
    orbit, other = (solve_orbit(two_modes(), hz) for hz in (10.0, 7.5))
    asked = []

    def near(self, here, share, guess):
        asked.append(share)
        return orbit if share < 0.01 else other

    monkeypatch.setattr(Homotopy, "_near", near)
    assert Homotopy(orbit.problem.flow, 0.5).carried(orbit, 0.0, 1.0) is None
    assert max(asked) > 0.01 > min(asked)


@pytest.mark.filterwarnings("error")
def test_the_rest_of_a_system_without_excitation_is_carried():
    orbit = solve_orbit(two_modes().with_elements(excitation=()), 10.0)
    other = Homotopy(orbit.problem.flow, 0.5).carried(orbit, 0.0, 1.0)
    assert np.array_equal(other.states([0.0]), np.zeros((1, 4)))
