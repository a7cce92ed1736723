"""A branch point and a grazing point down to where orbits are exact, between two equal stops.

The orbits near them are symmetric, x(t + π/ω) = -x(t): one contact with each stop, between which
the motion reaches the stop that it has left once more. Piece by piece they have closed forms.
"""

import math
from dataclasses import dataclass, replace

import mpmath as mp
import numpy as np
import pytest
from bilinear import Bilinear

from nldyn import HarmonicForce, Stop, System, continue_branch, solve_orbit

SAMPLES = 20000
GAP, STIFFNESS, DAMPING, NATURAL_HZ = 2e-4, 2e5, 0.03, 10.0
RANGE_HZ = (8.7, 8.9)


def between_stops(force: float) -> System:
    """A mass between two equal linear stops."""
    stops = [Stop.linear("m", STIFFNESS, gap=GAP, direction=sign) for sign in (1, -1)]
    return System.from_modal(
        [NATURAL_HZ], {"m": [1.0]}, modal_damping=DAMPING, stops=stops,
        excitation=[HarmonicForce("m", force)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def by_force():
    """The orbits in question with other forces, at a frequency of them all."""
    guess = np.random.default_rng(0).normal(size=2) * [3e-4, 3e-2]
    start = solve_orbit(between_stops(3.0), 8.4, guess=guess)
    on_branch = continue_branch(start, (7.0, 10.0)).at(8.81599)[1]
    return continue_branch(on_branch, (2.5, 6.0), parameter="amplitude")


@dataclass(frozen=True)
class HalfOrbit:
    """Frequency, phase and speed of the entry into the upper stop, and times between switches.

    Half a period later the motion enters the lower stop with the opposite speed.
    """

    oscillator: Bilinear
    omega: mp.mpf
    unknowns: tuple

    def pieces(self):
        """Time, displacement and speed at the end of each piece, and its matrix exponential."""
        t, x, v = self.unknowns[0] / self.omega, mp.mpf(GAP), self.unknowns[1]
        for number, duration in enumerate(self.unknowns[2:]):
            closed = number % 2 == 0
            (x, v), matrix = self.oscillator.motion(closed, self.omega, t, x, v, duration)
            t = t + duration
            yield t, x, v, matrix
            x = mp.mpf(GAP)

    def conditions(self) -> list:
        """Zero for a symmetric orbit."""
        *before, (_, x, v, _) = self.pieces()
        switches = [x - GAP for _, x, _, _ in before]
        times = sum(self.unknowns[2:]) - mp.pi / self.omega
        return [*switches, x + GAP, v + self.unknowns[1], times]

    def beyond(self):
        """Zero where the symmetry breaks: the half map, whose image is turned over, has a -1."""
        product = mp.eye(2)
        for _, _, _, matrix in self.pieces():
            product = matrix * product
        return mp.det(product - mp.eye(2))

    def touch(self, share):
        """Distance from the upper stop and speed after a share of the flight behind it."""
        t, _, v, _ = next(iter(self.pieces()))
        flight = share * self.unknowns[3]
        (x, v), _ = self.oscillator.motion(False, self.omega, t, mp.mpf(GAP), v, flight)
        return [x - GAP, v]


def solved(equations, *guess):
    """Roots to thirty digits."""
    return mp.findroot(equations, guess, solver="mdnewton", tol=1e-45, maxsteps=60)


def grazing_orbit(orbit, oscillator):
    """The exact orbit that only touches the stop it has left, and at which share of its flight."""
    history = orbit.history(SAMPLES)
    above, below = (history.force[:, stop] > 1e-2 * history.force.max() for stop in (0, 1))
    entry = int(np.flatnonzero(above & ~np.roll(above, 1))[0])
    above, below, depth = (np.roll(x, -entry) for x in (above, below, history.penetration[:, 0]))
    leaves, meets = int(np.argmin(above)), int(np.argmax(below))
    away = (leaves + meets) // 2  # the touch is in the second half of the flight
    touches = away + int(np.argmax(depth[away:meets]))
    tick, speed = history.time[1], history.modal_velocity[entry, 0]

    def equations(omega, share, *u):
        trial = HalfOrbit(oscillator, omega, u)
        return [*trial.conditions(), *trial.touch(share)]

    omega, share, *u = solved(
        equations, orbit.omega, (touches - leaves) / (meets - leaves),
        history.time[entry] * orbit.omega, speed, leaves * tick, (meets - leaves) * tick,
    )  # fmt: skip
    return HalfOrbit(oscillator, omega, tuple(u)), share


def branch_point(grazing, share):
    """The exact orbit behind the touch, with one contact more, at which the symmetry breaks.

    Its duration is guessed from two others, between which the determinant is nearly linear.
    """
    phase, speed, contact, flight = grazing.unknowns

    def with_contact(duration, condition):
        def equations(omega, *u):
            trial = replace(grazing, omega=omega, unknowns=u)
            return [*trial.conditions(), condition(trial)]

        first, last = share * flight - duration / 2, (1 - share) * flight - duration / 2
        guess = grazing.omega, phase, speed, contact, first, duration, last
        omega, *u = solved(equations, *guess)
        return replace(grazing, omega=omega, unknowns=tuple(u))

    short, longer = mp.mpf("1e-7"), mp.mpf("1e-6")
    low, high = (
        with_contact(e, lambda trial, e=e: trial.unknowns[4] - e).beyond() for e in (short, longer)
    )
    guess = short - low * (longer - short) / (high - low)
    return with_contact(guess, HalfOrbit.beyond)


@pytest.mark.parametrize(
    ("force", "rel", "together"),
    [
        (5.2824, 3e-10, True),
        pytest.param(5.285, 1e-11, True, marks=pytest.mark.slow),
        pytest.param(5.287, 1e-11, True, marks=pytest.mark.slow),
        pytest.param(5.32, 1e-11, False, marks=pytest.mark.slow),
    ],
)
def test_grazing_and_branch_point_are_both_where_the_piecewise_solution_has_them(
    by_force, force, rel, together
):
    """From 5e-12 Hz apart, where rounding decides which comes first; a note tells of it."""
    natural = 2.0 * math.pi * NATURAL_HZ
    oscillator = Bilinear(2.0 * DAMPING * natural, natural**2, STIFFNESS, GAP, force)
    whole = continue_branch(by_force.at(force)[0], RANGE_HZ)
    exact = {}
    for start in whole.points[:: len(whole.points) // 2]:
        branch = continue_branch(start, RANGE_HZ)
        found = {special.kind: special for special in branch.special_points}
        assert sorted(special.kind for special in branch.special_points) == ["BP", "GR", "LP"]
        if not exact:
            grazing, share = grazing_orbit(found["GR"].orbit, oscillator)
            crossing = branch_point(grazing, share)
            exact = {"GR": grazing.omega, "BP": crossing.omega}
        for kind, omega in exact.items():
            assert found[kind].orbit.omega == pytest.approx(float(omega), rel=rel)
        assert np.abs(found["BP"].orbit.multipliers - 1.0).min() < 3e-4
        assert any("lie so close together" in note for note in branch.notes) == together


@pytest.mark.parametrize("force", [5.28234, pytest.param(5.28235, marks=pytest.mark.slow)])
def test_a_grazing_point_beside_a_branch_point_is_found_once(by_force, force):
    """1e-7 to 6e-6 Hz before the touch, where both lie in steps of their own or in one."""
    whole = continue_branch(by_force.at(force)[0], RANGE_HZ)
    for start in whole.points[:: len(whole.points) // 3]:
        branch = continue_branch(start, RANGE_HZ)
        assert sorted(special.kind for special in branch.special_points) == ["BP", "GR", "LP"]
