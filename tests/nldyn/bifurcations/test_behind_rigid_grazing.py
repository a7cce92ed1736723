"""What begins at a grazing of a rigid stop: said, simulated, and followed.

An overdamped oscillator x'' + 2.5 x' + x = cos ωt whose linear response just reaches the stop at a
frequency. Near it the height of the motion n periods after an impact of the speed v is
h' δ - g(n) v with the relative distance δ in frequency and g(n) = (1 + e) c Aⁿ b; it hits with
v = √(2 a h). The orbit with one impact in n periods is stable for v > a g(n), and ends where it
hits a period earlier [Nordmark 1991; Chin et al. 1994].
"""

import math

import numpy as np
import pytest
from one_impact import OneImpact
from scipy.linalg import expm

from nldyn import (
    HarmonicForce,
    LocateError,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    describe_special,
    impacts,
    lyapunov_exponents,
    simulate,
    solve_orbit,
    switch_branch,
)
from nldyn.bifurcations.rigid_grazing import RootMap

TURN = 2.0 * math.pi
RESTITUTION = 0.8
ADDING, BETWEEN, CHAOS = 1.5, 4.0, 12.0  # rad/s, with multipliers of 0.12, 0.46 and 0.77


class Grazing:
    """The oscillator, and its map beside grazing."""

    def __init__(self, omega, damping=2.5):
        self.omega, self.damping = omega, damping
        stiff = 1.0 - omega**2
        square = stiff**2 + (damping * omega) ** 2
        self.gap = square**-0.5
        self.deceleration = self.gap * omega**2
        self.height = self.gap * omega**2 * (2.0 * stiff - damping**2) / square  # by ln ω
        self.system = System.from_matrices(
            [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[damping]],
            stops=[RigidStop("x", RESTITUTION, self.gap)], excitation=[HarmonicForce("x", 1.0)],
        )  # fmt: skip
        self.flight = expm(np.array([[0.0, 1.0], [-1.0, -damping]]) * TURN / omega)

    def effect(self, periods):
        """g(n)."""
        return (1.0 + RESTITUTION) * np.linalg.matrix_power(self.flight, periods)[0, 1]

    def window(self, periods):
        """Distances between which the orbit with one impact in n periods exists and is stable."""
        a, late, early = self.deceleration, self.effect(periods), self.effect(periods - 1)
        slow, fast = a * late, 2.0 * a * (early - late)
        return [(v**2 / (2.0 * a) + late * v) / -self.height for v in (slow, fast)]

    def hz(self, distance):
        return self.omega / TURN * math.exp(-distance)

    def periods_between_impacts(self, distance):
        hz = self.hz(distance)
        times = impacts(simulate(self.system, hz, periods=60, transient=300)).time
        return np.diff(times) * hz

    def chaotic(self, distance):
        return lyapunov_exponents(self.system, self.hz(distance)).chaotic

    def special(self):
        """The grazing of the branch of orbits without impacts."""
        calm = solve_orbit(self.system, 1.02 * self.omega / TURN)
        branch = continue_branch(calm, (0.999 * self.omega / TURN, 1.03 * self.omega / TURN))
        (grazing,) = (point for point in branch.special_points if point.kind == "GR")
        assert grazing.frequency_hz == pytest.approx(self.omega / TURN, rel=1e-10)
        return grazing


def test_below_a_quarter_stable_orbits_of_growing_periods_follow_each_other():
    """The next period begins before the last one ends."""
    at = Grazing(ADDING)
    assert "orbits of periods that grow by one follow each other" in describe_special(at.special())
    for n in (3, 4, 5):
        assert at.window(n)[0] < at.window(n + 1)[1]
        middle = math.sqrt(math.prod(at.window(n)))
        assert at.periods_between_impacts(middle) == pytest.approx(n, abs=1e-3)
    assert not any(map(at.chaotic, np.geomspace(at.window(5)[0], at.window(3)[1], 6)))


def test_between_a_quarter_and_two_thirds_chaos_lies_between_the_periods():
    at = Grazing(BETWEEN)
    said = describe_special(at.special())
    assert "orbits of periods that grow by one, with chaos between" in said
    for n in (5, 6):
        assert at.periods_between_impacts(np.mean(at.window(n))) == pytest.approx(n, abs=1e-3)
        assert at.window(n)[0] > at.window(n + 1)[1]
    assert at.chaotic(0.5 * (at.window(5)[0] + at.window(6)[1]))


def test_above_two_thirds_chaos_sets_in_at_once():
    at = Grazing(CHAOS)
    assert "chaos sets in at once" in describe_special(at.special())
    assert all(first > last for first, last in map(at.window, range(3, 8)))  # none is stable
    assert all(map(at.chaotic, (1e-2, 1e-3, 1e-4)))


def test_where_an_impact_raises_the_motion_it_jumps():
    """However near to grazing, impacts are as fast as the motion."""
    at = Grazing(2.08, damping=0.1)
    assert "the motion jumps" in describe_special(at.special())
    for distance in (1e-3, 1e-6, 1e-9):
        hits = impacts(simulate(at.system, at.hz(distance), periods=60, transient=3000))
        assert hits.speed.max() > 0.1 * at.gap * at.omega


@pytest.mark.parametrize(
    ("omega", "periods"), [(ADDING, 2), (ADDING, 3), (BETWEEN, 5), (BETWEEN, 7), (CHAOS, 3)]
)
def test_orbits_with_one_impact_in_n_periods_begin_at_a_grazing(omega, periods):
    """The slower one of the closed form, unstable at first."""
    at = Grazing(omega)
    (node,) = switch_branch(at.special(), times=periods)
    orbit = node.orbit
    assert (orbit.period, orbit.impacts) == (periods, 1)
    shape = OneImpact([[1.0]], [[1.0]], [[at.damping]], [1.0], [1.0], at.gap, RESTITUTION)
    motion = shape.motions(orbit.omega, periods)[-1]
    assert impacts(orbit).speed == pytest.approx([motion.speed], rel=1e-8)
    assert orbit.largest_multiplier == pytest.approx(-np.abs(motion.multipliers).max(), rel=1e-8)


def test_their_speed_goes_with_the_root_of_the_distance_but_nearest_to_grazing():
    """There with the distance itself: v²/2a + g v = h' δ, with g of all impacts before."""
    at, n = Grazing(BETWEEN), 6
    (node,) = switch_branch(at.special(), times=n)
    hz = at.omega / TURN
    branch = continue_branch(node.orbit, (0.998 * node.orbit.frequency_hz, hz))
    assert not branch.notes
    flown = np.linalg.matrix_power(at.flight, n)
    late = (1.0 + RESTITUTION) * np.linalg.solve(np.eye(2) - flown, flown)[0, 1]
    orbits = [orbit for orbit in branch.points if abs(orbit.largest_multiplier) < 1e3]
    distance = np.log([hz / orbit.frequency_hz for orbit in orbits])
    speed = np.array([impacts(orbit).speed[0] for orbit in orbits])
    height = speed**2 / (2.0 * at.deceleration) + late * speed
    assert height == pytest.approx(-at.height * distance, rel=0.02)
    turns = 2.0 * at.deceleration * late  # speed at which both parts are equal
    assert speed.min() < 0.01 * turns < 0.5 * speed.max()


def test_what_no_branch_leaves_is_told():
    at = Grazing(ADDING)
    special = at.special()
    with pytest.raises(LocateError, match="no orbit of period 9 is found"):
        switch_branch(special, times=9)
    with pytest.raises(SystemModelError, match="times"):
        switch_branch(special, times=0)
    soft = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[2.5]], stops=[Stop("x", 1e3, gap=at.gap)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(soft, 0.25), (0.23, 0.26))
    with pytest.raises(SystemModelError, match="of an elastic stop"):
        switch_branch(next(s for s in branch.special_points if s.kind == "GR"))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("turns_at", "lowers"), [(801, False), (9e9, True)])
def test_a_growing_motion_may_turn_after_more_periods_than_numbers_reach(turns_at, lowers):
    """c Aᵏ b = 3ᵏ cos(kθ) is beyond all numbers from k = 647 on, and turns at θ = π / 2k."""
    angle = 0.5 * math.pi / (turns_at - 0.5)
    turn = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    one = np.ones(1)
    root_map = RootMap(None, 3.0 * np.array([turn]), np.eye(2)[:1], np.eye(2)[:1], one, one)
    assert root_map.lowers is lowers
