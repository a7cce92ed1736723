"""Rigid rings and pins: billiards and rubs in closed form, limits, an independent integration."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as sla
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from nldyn import (
    ConstantForce,
    FlowMap,
    HarmonicForce,
    Parameter,
    RigidStop,
    RoundStop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    impacts,
    load,
    save,
    simulate,
    solve_orbit,
)
from nldyn.app.describe import describe_stop
from nldyn.flow.rigid import before_rigid_stops, behind_rigid_stops
from nldyn.flow.sliding import slider_measures
from nldyn.system.chart import value_of, with_value
from nldyn.system.equilibrium import rest
from tests.rigid_rings import RigidRing, RigidRotor
from tests.sliding import off_differences

MASS, CLEARANCE, GRAVITY = 2.0, 0.5, 9.81
PLANE = {"x": [1.0, 0.0], "y": [0.0, 1.0]}
PERIOD = np.array([0.0, 2.0 * np.pi])
ROOT = math.sqrt(MASS)


def free(stops, *acting):
    return System.from_matrices(
        MASS * np.eye(2), np.zeros((2, 2)), PLANE, stops=stops, excitation=acting
    )


def end_of(system, start, time=1.0):
    """Displacements and velocities of a mass at a time in s."""
    flow = FlowMap(system)
    z = flow.to_state(ROOT * np.array([start]))
    found = flow.shoot(z, PERIOD * time, 2.0 * np.pi)
    assert not found.failure
    return flow.to_modal(found.ends)[0] / ROOT, found


def billiard(start, time):
    """End of chords in a circle: those of one motion are alike, each turned on by one angle."""
    x, y, u, v = start
    moment, speed = x * v - y * u, (u * u + v * v) ** 0.5
    reach = (CLEARANCE**2 - (moment / speed) ** 2) ** 0.5  # half a chord
    way = (x * u + y * v) / speed + speed * time
    hits = math.floor(((way + reach) / (2.0 * reach)).real)
    cosine, sine = moment / speed / CLEARANCE, reach / CLEARANCE
    cosine, sine = cosine * cosine - sine * sine, 2.0 * cosine * sine
    c, s = 1.0, 0.0
    for _ in range(hits):
        c, s = c * cosine - s * sine, s * cosine + c * sine
    u, v = (u * c - v * s) / speed, (u * s + v * c) / speed
    along, aside = way - 2.0 * reach * hits, moment / speed
    return np.array([along * u + aside * v, along * v - aside * u, speed * u, speed * v]), hits


def differentiated(function, start):
    """Jacobian by complex steps."""
    columns = [function(np.array(start) + 1e-30j * row) for row in np.eye(4)]
    return np.array([column.imag / 1e-30 for column in columns]).T


@pytest.mark.parametrize(
    "start", [(0.1, -0.2, 3.0, 2.0), (0.3, 0.0, 0.2, -4.0), (0.0, 0.1, 7.0, 0.0)]
)
def test_a_billiard_is_that_in_closed_form(start):
    end, found = end_of(free([RoundStop.rigid(("x", "y"), 1.0, CLEARANCE)]), start)
    known, hits = billiard(np.array(start, dtype=complex), 1.0)
    assert found.closings[0] == hits >= 4
    assert end == pytest.approx(known.real, abs=1e-12)
    exact = differentiated(lambda z: billiard(z, 1.0)[0], start)
    flow = FlowMap(free([RoundStop.rigid(("x", "y"), 1.0, CLEARANCE)]))
    right, left = flow.system.linear.right, flow.system.linear.left
    assert right @ found.jacobians[0] @ left == pytest.approx(exact, rel=1e-9, abs=1e-9)
    x, y, u, v = end
    assert x * v - y * u == pytest.approx(start[0] * start[3] - start[1] * start[2], abs=1e-13)
    assert math.hypot(u, v) == pytest.approx(math.hypot(*start[2:]), rel=1e-14)


@pytest.mark.parametrize(("corners", "turns"), [(3, 1), (4, 1), (5, 2), (7, 3)])
def test_polygons_of_a_billiard_close(corners, turns):
    """A regular star is run through in a period; neighbours drift along the circle: no multiplier
    is other than one."""
    half = math.pi * turns / corners
    speed = 2.0 * corners * CLEARANCE * math.sin(half)
    start = [CLEARANCE * math.cos(half), 0.0, 0.0, speed]
    end, found = end_of(free([RoundStop.rigid(("x", "y"), 1.0, CLEARANCE)]), start)
    assert found.closings[0] == corners
    assert end == pytest.approx(start, abs=1e-12)
    jacobian = found.jacobians[0]
    size = np.abs(jacobian).max()
    assert np.linalg.matrix_power(jacobian - np.eye(4), 2) == pytest.approx(0.0, abs=1e-9 * size**2)
    assert np.linalg.det(jacobian) == pytest.approx(1.0, abs=1e-9)


def bowl(inside, speed, angle, restitution=0.5):
    """A mass on a circle under its weight, and the state at an angle from its bottom or top."""
    centre = (0.0, 0.0) if inside else (0.0, -1.5 * CLEARANCE)
    ring = RoundStop.rigid(("x", "y"), restitution, CLEARANCE, eccentricity=centre, inside=inside)
    from_x = angle + (-0.5 if inside else 0.5) * math.pi
    n = np.array([math.cos(from_x), math.sin(from_x)])
    start = [*(np.array(centre) + CLEARANCE * n), -speed * n[1], speed * n[0]]
    return free([ring], ConstantForce("y", -MASS * GRAVITY)), start, from_x, np.array(centre)


@pytest.mark.parametrize(
    ("inside", "speed", "angle", "leaves"),
    [(True, 1.0, 0.4, False), (True, 4.2, 0.1, True), (False, 0.3, 0.2, True)],
)
def test_a_body_on_a_circle_moves_and_leaves_as_a_pendulum(inside, speed, angle, leaves):
    system, start, from_x, centre = bowl(inside, speed, angle)
    sense = 1.0 if inside else -1.0

    def pressed(t, y):
        return sense * (CLEARANCE * y[1] ** 2 - GRAVITY * math.sin(y[0]))

    pressed.terminal, pressed.direction = True, -1.0
    run = solve_ivp(
        lambda t, y: [y[1], -GRAVITY / CLEARANCE * math.cos(y[0])], (0.0, 0.5),
        [from_x, speed / CLEARANCE], method="DOP853", rtol=1e-13, atol=1e-14, events=pressed,
    )  # fmt: skip
    assert (run.status == 1) is leaves
    left, (phi, rate) = 0.5 - run.t[-1], run.y[:, -1]
    n = np.array([math.cos(phi), math.sin(phi)])
    v = CLEARANCE * rate * np.array([-n[1], n[0]])
    fall = np.array([0.0, -GRAVITY])
    place = centre + CLEARANCE * n + v * left + 0.5 * fall * left**2
    found, shot = end_of(system, start, 0.5)
    flow = FlowMap(system)
    motion = flow.trajectory(flow.to_state(ROOT * np.array([start])), 0.5 * PERIOD, 2.0 * np.pi)
    if leaves:
        released = motion.record.phase[1 + np.flatnonzero(motion.record.event == 0)[0]]
        assert released / (2.0 * np.pi) == pytest.approx(run.t[-1], abs=1e-10)
    assert shot.closings[0] == 0
    assert found == pytest.approx(np.concatenate([place, v + left * fall]), abs=1e-11)


def test_a_body_leaves_a_ring_at_the_height_in_closed_form():
    """With v² = 4 g c at the bottom the force is gone at the height 2 c/3 above the centre."""
    system, start, _, _ = bowl(True, math.sqrt(4.0 * GRAVITY * CLEARANCE), 0.0)
    flow = FlowMap(system)
    motion = flow.trajectory(flow.to_state(ROOT * np.array([start])), 0.4 * PERIOD, 2.0 * np.pi)
    release = 1 + np.flatnonzero(motion.record.event == 0)[0]
    height = flow.to_modal(motion.record.start[release])[1] / ROOT
    assert height == pytest.approx(2.0 / 3.0 * CLEARANCE, rel=1e-11)


def test_it_bounces_to_rest_along_the_circle():
    """Without a force a body keeps its speed along the circle, on which it comes to rest after the
    time of a geometric series, to first order of its angle to it."""
    ring = RoundStop.rigid(("x", "y"), 0.5, CLEARANCE)
    speed, angle = 2.0, 1e-3
    start = [CLEARANCE, 0.0, speed * math.sin(angle), speed * math.cos(angle)]
    end, found = end_of(free([ring]), start, 0.3)
    assert found.closings[0] == 1  # a series that ends in rest
    assert math.hypot(*end[:2]) == pytest.approx(CLEARANCE, rel=1e-13)
    assert math.hypot(*end[2:]) == pytest.approx(speed * math.cos(angle), rel=1e-9)
    turned = math.atan2(end[1], end[0])
    assert turned == pytest.approx(speed * 0.3 / CLEARANCE, rel=3e-6)


def test_rigid_polygons_come_to_the_ring_with_their_number():
    """The pad that is hit is turned from the circle by up to half the angle of one, and the rebound
    by twice as much: nothing of this law converges faster than with the number of pads."""
    start = [0.1, -0.2, 3.0, 2.0]
    true, found = end_of(free([RoundStop.rigid(("x", "y"), 1.0, CLEARANCE)]), start, 0.2)
    assert found.closings[0] == 1
    for pads in (16, 64, 256):
        angles = 2.0 * np.pi * np.arange(pads) / pads
        names = {f"pad {k}": [math.cos(a), math.sin(a)] for k, a in enumerate(angles)}
        system = System.from_matrices(
            MASS * np.eye(2), np.zeros((2, 2)), {**PLANE, **names},
            stops=[RigidStop(name, 1.0, gap=CLEARANCE) for name in names],
        )  # fmt: skip
        end, shot = end_of(system, start, 0.2)
        hit = angles[int(np.flatnonzero(shot.closings)[0])]
        before, (u, v) = math.atan2(start[3], start[2]), true[2:]
        normal = 0.5 * (
            math.atan2(v, u) + before + np.pi
        )  # the circle turns back what goes along it
        off = (hit - normal + 0.5 * np.pi) % np.pi - 0.5 * np.pi
        assert abs(off) < 1.01 * np.pi / pads
        turned = (math.atan2(end[3], end[2]) - math.atan2(v, u) + np.pi) % (2.0 * np.pi) - np.pi
        assert turned == pytest.approx(2.0 * off, rel=1e-9, abs=1e-13)


def test_stiff_rings_come_to_the_rigid_one():
    """By the duration of their contacts, which goes with the root of the stiffness."""
    start = [0.1, -0.2, 3.0, 2.0]
    true, _ = end_of(free([RoundStop.rigid(("x", "y"), 1.0, CLEARANCE)]), start)
    errors = [
        float(
            np.linalg.norm(
                end_of(free([RoundStop(("x", "y"), k, CLEARANCE, 1.0)]), start)[0] - true
            )
        )
        for k in (1e8, 1e10)
    ]
    assert errors[1] == pytest.approx(0.1 * errors[0], rel=0.02)


STIFFNESS, DAMPING, UNBALANCE = 8e3, 12.0, 4e-3


class Rub:
    """A disc whirls on a rigid ring, on which the unbalance holds it: at ψ ahead of that whirl

    m c ψ'' + C c (ω + ψ') + μ N + D sin(ψ - φ) = 0,  N = D cos(ψ - φ) + m c (ω + ψ')² - K c.
    """

    def __init__(self, hz: float, friction: float, surface: float, clearance: float = 1e-3):
        self.w, self.mu = 2.0 * math.pi * hz, friction * math.copysign(1.0, surface)
        w, c = self.w, clearance
        drive, spring = UNBALANCE * w**2, (STIFFNESS - MASS * w**2) * c
        self.drag = DAMPING * c * w - self.mu * spring
        # D (sin φ - μ cos φ) = C c ω - μ (K - m ω²) c
        self.ahead = math.atan(self.mu) + math.asin(self.drag / drive / math.hypot(1.0, self.mu))
        self.force = drive * math.cos(self.ahead) - spring
        across = drive * (math.cos(self.ahead) + self.mu * math.sin(self.ahead))
        self.rates = np.roots([MASS * c, DAMPING * c + 2.0 * self.mu * MASS * c * w, across])
        self.system = System.from_matrices(
            MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, damping=DAMPING * np.eye(2),
            stops=[
                RoundStop.rigid(("x", "y"), 0.5, c, friction=friction, surface_speed=surface)
            ],
            excitation=[
                Unbalance("x", UNBALANCE), Unbalance("y", UNBALANCE, phase_deg=-90.0)
            ],
        )  # fmt: skip
        n = np.array([math.cos(-self.ahead), math.sin(-self.ahead)])
        self.start = ROOT * c * np.array([*n, -w * n[1], w * n[0]])


@pytest.mark.parametrize(("friction", "surface"), [(0.0, 5.0), (0.1, 5.0), (0.1, -5.0), (0.3, 5.0)])
def test_a_rub_all_around_is_that_in_closed_form(friction, surface):
    rub = Rub(12.0, friction, surface)
    orbit = solve_orbit(rub.system, 12.0, guess=rub.start * (1.0 + 1e-6))
    moved = orbit.history(16)
    assert np.hypot(moved.displacement["x"], moved.displacement["y"]) == pytest.approx(
        1e-3, rel=1e-12
    )
    assert moved.force[:, 0] == pytest.approx(rub.force, rel=1e-10)
    assert orbit.states(np.zeros(1))[0] == pytest.approx(rub.start, rel=1e-9, abs=1e-14)
    assert (orbit.impacts, orbit.rests, orbit.max_penetration) == (0, True, 0.0)
    assert orbit.touches_stops
    known = np.concatenate([[0.0, 0.0], np.exp(rub.rates * 2.0 * np.pi / rub.w)])
    gap = np.sort_complex(orbit.multipliers) - np.sort_complex(known)
    assert np.abs(gap).max() < 1e-10
    if not friction:
        return
    (found,) = orbit.friction
    slides = abs(surface + rub.w * 1e-3)
    assert found.work_rate == pytest.approx(rub.force * slides, rel=1e-10)
    assert found.power == pytest.approx(friction * rub.force * slides, rel=1e-10)
    assert (found.stuck, found.slid) == (0.0, 1.0)


def test_a_disc_rolls_in_a_rigid_ring_as_in_closed_form():
    """Its surface, at v, does not slip: it goes round backwards at v/c. The damper takes C v, which
    must be no more than μ N, with N = m v²/c - K c."""
    c, damping = 1e-3, 24.0
    for mu_holds, way in ((1.0 + 1e-6, True), (1.0 - 1e-6, False)):
        v = 0.15
        normal = MASS * v**2 / c - STIFFNESS * c
        mu = mu_holds * damping * v / normal
        ring = RoundStop.rigid(("x", "y"), 0.5, c, friction=mu, surface_speed=v)
        system = System.from_matrices(
            MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, stops=[ring],
            damping=damping * np.eye(2),
        )  # fmt: skip
        flow, w = FlowMap(system), v / c
        start = ROOT * np.array([[c, 0.0, 0.0, -v]])
        motion = flow.trajectory(flow.to_state(start), PERIOD, w)
        (found,) = slider_measures(motion)
        assert (found.stuck == 1.0) is way
        if way:
            assert found.peak_force == pytest.approx(damping * v, rel=1e-9)
            end = flow.to_modal(motion.recorded_states(np.array([np.nextafter(2.0 * np.pi, 0.0)])))
            assert end == pytest.approx(start, rel=1e-9, abs=1e-12)


def random_system(seed, frictions=(0.0,), surfaces=(0.0,)):
    """Modes, a rigid ring or pin somewhere, and the same for the independent integration."""
    rng = np.random.default_rng([640, seed])
    n = int(rng.integers(2, 5))
    half, coupled = rng.normal(size=(n, n)), 0.3 * rng.normal(size=(n, n))
    M = np.diag(rng.uniform(0.5, 2.0, n)) + coupled @ coupled.T
    K = half @ half.T * 1e3 + np.diag(rng.uniform(2e3, 2e4, n))
    C = 0.002 * K + np.diag(rng.uniform(1.0, 5.0, n))
    rows = np.eye(2, n) + (0.2 * rng.normal(size=(2, n)) if n > 2 else 0.0)
    c, inside, way = (
        rng.uniform(0.5e-3, 1e-3),
        bool(rng.random() < 0.7),
        rng.uniform(0.0, 2 * np.pi),
    )
    away = c * (rng.uniform(0.0, 0.6) if inside else rng.uniform(1.1, 1.5))
    centre = (away * math.cos(way), away * math.sin(way))
    e, mu = float(rng.choice([0.0, 0.3, 0.6, 0.9, 1.0])), float(rng.choice(frictions))
    surface = float(rng.choice(surfaces))
    stop = RoundStop.rigid(
        ("x", "y"), e, c, eccentricity=centre, inside=inside, friction=mu, surface_speed=surface
    )
    w, f, share = 2.0 * np.pi * rng.uniform(5.0, 40.0), rng.uniform(2.0, 20.0), rng.random()
    system = System.from_matrices(
        M, K, {"x": rows[0], "y": rows[1]}, damping=C, stops=[stop],
        excitation=[
            HarmonicForce("x", f), HarmonicForce("y", share * f, phase_deg=-90.0),
            ConstantForce("x", f),
        ],
    )  # fmt: skip
    ring = RigidRing(rows, e, c, centre, stop.sense, mu, stop.sliding_speed)
    rotor = RigidRotor(
        M, C, K,
        lambda t: f * (rows[0] * (math.cos(w * t) + 1.0) + rows[1] * share * math.sin(w * t)),
        [ring],
    )  # fmt: skip
    near, way = (
        c * (rng.uniform(0.2, 0.9) if inside else rng.uniform(1.05, 1.6)),
        6.0 * rng.random(),
    )
    place = np.array(centre) + near * np.array([math.cos(way), math.sin(way)])
    start = np.concatenate([np.linalg.pinv(rows) @ place, 0.1 * rng.normal(size=n)])
    modes = sla.eigh(K, M)[1]
    return system, rotor, w, start, sla.block_diag(modes, modes)


def check_against_integration(seed, frictions=(0.0,), surfaces=(0.0,)):
    """How often it hits, for what share of a period it rests, and how often it sticks and turns."""
    system, rotor, w, start, basis = random_system(seed, frictions, surfaces)
    flow = FlowMap(system)
    z = flow.to_state(np.linalg.solve(basis, start))[None]
    found = flow.shoot(z, PERIOD, w)
    assert not found.failure
    end = rotor.followed(start, 2.0 * np.pi / w, 2.0 * np.pi / w / 400)
    n, ours = start.size // 2, basis @ flow.to_modal(found.ends[0])
    for part in (slice(0, n), slice(n, None)):
        assert np.abs(ours - end)[part].max() < 1e-8 * np.abs(end[part]).max()
    step = 1e-7 * float(np.abs(z).max())
    ends = [[flow.shoot(z + way * step * row, PERIOD, w).ends[0] for way in (1.0, -1.0)]
            for row in np.eye(z.size)]  # fmt: skip
    slopes = np.array([(up - down) / (2.0 * step) for up, down in ends]).T
    size = np.abs(found.jacobians[0]).max()
    assert np.abs(slopes - found.jacobians[0]).max() < 1e-6 * max(size, 1.0)
    return np.array([rotor.hits, rotor.rested * w / (2.0 * np.pi), rotor.turned])


SURFACES, FRICTIONS = (-0.05, 0.0, 0.02, 0.3), (0.1, 0.3, 0.8)


@pytest.mark.parametrize("seed", [2, 4, 10])
def test_motions_are_those_of_an_independent_integration(seed):
    check_against_integration(seed)


@pytest.mark.parametrize("seed", [10, 25, 38])
def test_motions_with_friction_are_those_of_an_independent_integration(seed):
    """All of them hit, rest, and stick or turn meanwhile."""
    assert check_against_integration(seed, FRICTIONS, SURFACES).all()


@pytest.mark.slow
@pytest.mark.parametrize("frictions", [(0.0,), FRICTIONS])
@pytest.mark.parametrize("block", range(3))
def test_random_motions_are_those_of_an_independent_integration(block, frictions):
    found = [
        check_against_integration(100 + 20 * block + k, frictions, SURFACES) for k in range(20)
    ]
    hits, rested, _ = np.sum(found, axis=0)
    assert hits > 50 and rested > 0.3


@pytest.mark.parametrize("seed", [0, 4, 6])
def test_an_impact_changes_volumes_by_the_square_of_the_restitution(seed):
    """Liouville: beside that the damping alone does, whatever the masses along both directions."""
    system, _, w, start, basis = random_system(seed)
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(np.linalg.solve(basis, start))[None], PERIOD, w)
    assert found.closings[0] >= 2
    lost = 2 * found.closings[0] * math.log(system.stops[0].restitution)
    sign, volume = np.linalg.slogdet(found.jacobians[0])
    damped = -np.trace(system.damping) * 2.0 * np.pi / w
    assert (sign, volume) == pytest.approx((1.0, damped + lost), abs=1e-11)


@pytest.mark.parametrize("seed", [2, 4])
def test_two_rings_are_hit_and_rested_on_at_once(seed):
    """The second ring is carried by the first place in one of them; impacts pass through both."""
    rng, names, stops, rings = np.random.default_rng([641, seed]), {}, [], []
    half, coupled = rng.normal(size=(4, 4)), 0.2 * rng.normal(size=(4, 4))
    M = np.diag(rng.uniform(0.5, 2.0, 4)) + coupled @ coupled.T
    K = half @ half.T * 1e3 + np.diag(rng.uniform(2e3, 1e4, 4))
    C = 0.002 * K + np.diag(rng.uniform(1.0, 5.0, 4))
    across = np.eye(4)[2:] - (np.eye(4)[:2] if rng.random() < 0.5 else 0.0)
    for k, rows in enumerate((np.eye(4)[:2], across)):
        c, way = rng.uniform(0.5e-3, 1e-3), 6.28 * rng.random()
        away = 0.5 * c * rng.random()
        centre = (away * math.cos(way), away * math.sin(way))
        e = float(rng.choice([0.0, 0.3, 0.6, 0.9]))
        mu, surface = float(rng.choice([0.0, 0.2, 0.5])), float(rng.choice([-0.05, 0.0, 0.02, 0.3]))
        names |= {f"x{k}": rows[0], f"y{k}": rows[1]}
        stops.append(
            RoundStop.rigid(
                (f"x{k}", f"y{k}"), e, c, eccentricity=centre, friction=mu, surface_speed=surface
            )
        )
        rings.append(RigidRing(rows, e, c, centre, 1.0, mu, stops[-1].sliding_speed))
    w, f = 2.0 * np.pi * rng.uniform(5.0, 40.0), rng.uniform(5.0, 25.0, size=4)
    system = System.from_matrices(
        M, K, names, damping=C, stops=stops,
        excitation=[
            HarmonicForce("x0", f[0]), HarmonicForce("y0", f[1], phase_deg=-90.0),
            ConstantForce("x1", f[2]), HarmonicForce("y1", f[3], phase_deg=30.0),
        ],
    )  # fmt: skip
    vectors = np.array(list(names.values()))

    def pushed(t):
        at = [math.cos(w * t), math.sin(w * t), 1.0, math.cos(w * t + np.pi / 6.0)]
        return vectors.T @ (f * at)

    rotor = RigidRotor(M, C, K, pushed, rings)
    start = np.concatenate([1e-4 * rng.normal(size=4), 0.1 * rng.normal(size=4)])
    end = rotor.followed(start, 2.0 * np.pi / w, 2.0 * np.pi / w / 400)
    modes = sla.eigh(K, M)[1]
    basis, flow = sla.block_diag(modes, modes), FlowMap(system)
    z = flow.to_state(np.linalg.solve(basis, start))[None]
    found = flow.shoot(z, PERIOD, w)
    assert rotor.hits > 20 and rotor.rested * w > 0.4 * 2.0 * np.pi and rotor.turned > 0
    ours = basis @ flow.to_modal(found.ends[0])
    assert ours[:4] == pytest.approx(end[:4], abs=1e-8 * np.abs(end[:4]).max())
    assert ours[4:] == pytest.approx(end[4:], abs=1e-8 * np.abs(end[4:]).max())
    step = 1e-8 * float(np.abs(z).max())
    assert off_differences(flow, found, z, PERIOD, w, step) < 1e-6


@pytest.mark.parametrize("seed", [4, 10])
def test_derivatives_by_its_numbers_are_those_of_differences(seed):
    system, _, w, start, basis = random_system(seed, FRICTIONS, SURFACES)
    z = FlowMap(system).to_state(np.linalg.solve(basis, start))[None]
    flow = FlowMap(system)
    names = ("clearance", "first_eccentricity", "second_eccentricity", "restitution")
    parameters = [Parameter(name) for name in (*names, "rubbing_friction")]
    found = flow.shoot(z, PERIOD, w, parameters=parameters)
    assert found.closings[0] > 0
    assert off_differences(flow, found, z, PERIOD, w, 1e-8) < 1e-6
    for column, parameter in zip(found.d_parameters[0].T, parameters, strict=True):
        value = value_of(system, 1.0, parameter)
        step = 1e-6 * (1.0 if parameter.name in ("restitution", "rubbing_friction") else 1e-3)
        up, down = (
            FlowMap(with_value(system, parameter, value + way * step)).shoot(z, PERIOD, w).ends[0]
            for way in (1.0, -1.0)
        )
        off = np.abs((up - down) / (2.0 * step) - column).max()
        assert off < 1e-6 * max(np.abs(column).max(), 1e-3)


def two_directions(ring=None, hz=None):
    """A disc whose unbalance shakes it more along one direction, so that it knocks on the ring."""
    ring = ring or RoundStop.rigid(("x", "y"), 0.6, 1e-3)
    return System.from_matrices(
        MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, damping=DAMPING * np.eye(2), stops=[ring],
        excitation=[HarmonicForce("x", 12.0), HarmonicForce("y", 4.0, phase_deg=-70.0)],
    )  # fmt: skip


@pytest.mark.parametrize(("friction", "surface"), [(0.0, None), (0.2, 0.3)])
def test_over_a_period_the_excitation_gives_what_dampers_and_impacts_take(friction, surface):
    ring = RoundStop.rigid(("x", "y"), 0.6, 1e-3, friction=friction, surface_speed=surface)
    system = two_directions(ring)
    orbit = solve_orbit(system, 9.0)
    assert orbit.impacts > 0 and not (friction and orbit.rests)
    phases, weights = np.polynomial.legendre.leggauss(24)
    cuts = np.unique(np.concatenate([[0.0, 2.0 * np.pi], orbit.trajectory.record.phase]))
    given = 0.0
    for a, b in pairwise(cuts):
        at = 0.5 * (a + b) + 0.5 * (b - a) * phases
        v = orbit.states(at)[:, 2:] / ROOT
        pushed = 12.0 * np.cos(at) * v[:, 0] + 4.0 * np.cos(at - math.radians(70.0)) * v[:, 1]
        power = pushed - DAMPING * (v * v).sum(axis=1)
        given += float(weights @ power) * 0.5 * (b - a) / orbit.omega
    motion = simulate(system, 9.0, start=orbit.states(np.zeros(1))[0], periods=1)
    listed = impacts(motion)
    lost = float(sum(listed.loss)) + sum(each.loss for each in orbit.friction)
    drawn = 0.0
    if surface:  # the surface that turns gives, too: the friction's work is that of the slip
        drawn = surface * sum_of_rubs(orbit)
    assert given + drawn == pytest.approx(lost, rel=1e-8)


def sum_of_rubs(orbit):
    """Impulses of friction in a period, by the jumps of the speed across."""
    record, total = orbit.trajectory.record, 0.0
    flow = orbit.problem.flow
    for piece in 1 + np.flatnonzero(record.event[:-1] == 0):
        before = orbit.trajectory.recorded_states(np.nextafter(record.phase[[piece]], -math.inf))
        x, y, u, v = flow.to_modal(before)[0] / ROOT
        _, _, up, vp = flow.to_modal(record.start[piece]) / ROOT
        total += MASS * ((x * v - y * u) - (x * vp - y * up)) / math.hypot(x, y)
    return total


def test_branches_are_followed_and_files_keep_them(tmp_path):
    orbit = solve_orbit(two_directions(), 9.0)
    branch = continue_branch(orbit, (8.98, 9.02))
    assert branch.stop_reason == "end of the frequency range / end of the frequency range"
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[0].system.stops == branch.points[0].system.stops
    assert again.points[-1].stable == branch.points[-1].stable
    along = continue_branch(orbit, (0.595, 0.605), parameter="restitution")
    found = {along.points[i].system.stops[0].restitution for i in (0, -1)}
    assert found == {0.595, 0.605}


@pytest.mark.slow
def test_a_branch_ends_where_it_grazes_a_rigid_ring():
    """It is not followed on behind it, and says so."""
    branch = continue_branch(solve_orbit(two_directions(), 9.0), (8.87, 9.0))
    assert branch.stop_reason.startswith("grazes a rigid stop at 8.8857")
    assert branch.special_points[0].kind == "GR"


def test_states_behind_it_are_known_and_mirrored():
    flow = FlowMap(two_directions(RoundStop.rigid(("x", "y"), 0.6, 1e-3, eccentricity=(2e-4, 0.0))))
    states = flow.to_state(ROOT * np.array([[1.4e-3, 0.0, 0.0, 0.0], [0.0, 9e-4, 0.0, 0.0]]))
    assert behind_rigid_stops(flow, states).tolist() == [True, False]
    moved = flow.to_modal(before_rigid_stops(flow, states)) / ROOT
    assert moved[0, :2] == pytest.approx([1e-3, 0.0], abs=1e-15)  # as far before it as behind
    with pytest.raises(SystemModelError, match="behind a rigid stop"):
        simulate(flow.system, 9.0, start=flow.to_modal(states)[0], periods=1)


def test_it_holds_a_weight_at_rest():
    ring = RoundStop.rigid(("x", "y"), 0.5, 1e-3)
    system = free([ring], ConstantForce("y", -20.0))
    x, y = rest(system) / ROOT
    assert (x, y) == pytest.approx((0.0, -1e-3), abs=1e-7)  # by a stiff spring in its place
    assert describe_stop(ring) == "rigid ring around 'x', 'y': restitution 0.5, clearance 0.001 m"


def pressed(stop, weight, *others):
    """1 kg on 1 N/m both ways, under a weight along x."""
    return System.from_matrices(
        np.eye(2), np.eye(2), PLANE, damping=0.2 * np.eye(2), stops=[stop],
        excitation=[ConstantForce("x", weight), *others],
    )  # fmt: skip


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize(
    ("mu", "surface", "weight", "centre", "inside"),
    [
        (0.3, 1.0, 1.5, (0.0, 0.0), True),
        (0.05, 1.0, 3.0, (0.0, 0.0), True),
        (0.3, -1.0, 10.0, (0.0, 0.0), True),
        (0.3, 1.0, 3.0, (0.2, -0.4), True),
        (0.3, 1.0, 2.0, (1.5, 0.3), False),
        (0.2, -1.0, 2.0, (1.5, 0.3), False),
    ],
)
def test_a_rotor_that_turns_rests_where_friction_and_spring_hold_it(
    restitution, mu, surface, weight, centre, inside
):
    """It rolls up to the angle at which the forces along the circle vanish."""
    ring = RoundStop.rigid(
        ("x", "y"), restitution, 1.0, eccentricity=centre, inside=inside, friction=mu,
        surface_speed=surface,
    )  # fmt: skip
    system = pressed(ring, weight)
    place = rest(system)
    found = system.round_polar(ring, np.append(place, [0.0, 0.0])[None])
    radius = found.radius[0]
    assert radius == pytest.approx(1.0, abs=1e-7)  # by a stiff spring in its place

    def forces(angle):
        """Force that presses it to the other side, and what is left along the circle."""
        normal = np.array([math.cos(angle), math.sin(angle)])
        acting = np.array([weight, 0.0]) - centre - radius * normal
        press = ring.sense * float(acting @ normal)
        along = float(acting @ [-normal[1], normal[0]])
        return press, along - math.copysign(mu, ring.sense * surface) * press

    angle = math.atan2(*found.normal[0][::-1])
    true = brentq(lambda a: forces(a)[1], angle - 0.3, angle + 0.3, xtol=1e-14)
    assert angle == pytest.approx(true, abs=1e-10)
    assert forces(true)[0] > 0.0


def test_a_rotor_that_slides_on_a_ring_swings_about_where_it_rests():
    """A small force F cos ωt along x moves it by the angle a: with the weight W, N = W cos φ - k c,
    m c a'' + d c a' + W (cos φ - μ sin φ) a = -F (sin φ + μ cos φ) cos ωt about φ."""
    mu, weight, push, w = 0.3, 1.5, 1e-5, 2.0 * math.pi * 0.2
    ring = RoundStop.rigid(("x", "y"), 0.5, 1.0, friction=mu, surface_speed=1.0)
    system = pressed(ring, weight, HarmonicForce("x", push))
    orbit = solve_orbit(system, 0.2, seconds=20.0)
    place = brentq(
        lambda a: -weight * math.sin(a) - mu * (weight * math.cos(a) - 1.0), -0.5, 0.0, xtol=1e-15
    )
    s, c = math.sin(place), math.cos(place)
    swing = -push * (s + mu * c) / (weight * (c - mu * s) - w * w + 0.2j * w)
    phases = np.linspace(0.0, 2.0 * np.pi, 9)
    x, y = orbit.states(phases)[:, :2].T
    assert np.hypot(x, y) == pytest.approx(np.ones(9), abs=1e-10)
    angles = np.arctan2(y, x) - place
    assert angles == pytest.approx((swing * np.exp(1j * phases)).real, abs=1e-4 * abs(swing))


@pytest.mark.parametrize(("angle", "at_once"), [(2.4, False), (2.9, True)])
def test_a_force_that_friction_makes_endless_is_told(angle, at_once):
    """With masses m along both directions and 0.9 m between them the normal n and the way t of the
    friction have n M⁻¹ (n + μ t) = 0 at 163.18 degrees (μ = 2); the force grows up to there."""
    mass, mu = np.array([[1.0, 0.9], [0.9, 1.0]]), 2.0
    ring = RoundStop.rigid(("x", "y"), 0.5, 1e-3, friction=mu, surface_speed=1.0)
    system = System.from_matrices(
        mass, 1e3 * np.eye(2), PLANE, stops=[ring],
        excitation=[HarmonicForce("x", 5.0), HarmonicForce("y", 5.0, phase_deg=-90.0)],
    )  # fmt: skip
    modes = sla.block_diag(*2 * [sla.eigh(1e3 * np.eye(2), mass)[1]])
    n = np.array([math.cos(angle), math.sin(angle)])
    start = np.linalg.solve(modes, [*(1e-3 * n), -0.3 * n[1], 0.3 * n[0]])
    flow = FlowMap(system)
    motion = flow.trajectory(flow.to_state(start[None]), PERIOD, 2.0 * np.pi * 40.0)
    assert "Painlevé" in motion.failure
    assert (motion.record.used == 0) is at_once
    if at_once:
        return
    x, y = (modes @ flow.to_modal(motion.record.start[-1]))[:2]
    a = brentq(
        lambda a: (
            np.array([math.cos(a), math.sin(a)])
            @ np.linalg.inv(mass)
            @ np.array([math.cos(a) - mu * math.sin(a), math.sin(a) + mu * math.cos(a)])
        ),
        2.4, 2.9,
    )  # fmt: skip
    assert math.atan2(y, x) == pytest.approx(a, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"restitution": 1.2}, "restitution must lie between 0 and 1"),
        ({"eccentricity": (2e-3, 0.0)}, "0.001 m behind it"),
        ({"friction": 0.2}, "surface_speed"),
        ({"inside": False}, "behind it"),
    ],
)
def test_what_is_no_rigid_ring_is_refused(change, said):
    with pytest.raises(SystemModelError, match=said):
        RoundStop.rigid(**{"plane": ("x", "y"), "restitution": 0.5, "clearance": 1e-3, **change})


def test_one_has_no_numbers_of_another_law():
    with pytest.raises(
        SystemModelError, match="either a restitution, if it is rigid, or stiffness"
    ):
        RoundStop(("x", "y"), 1e6, 1e-3, restitution=0.5)
    with pytest.raises(SystemModelError, match="or dissipation"):
        RoundStop(("x", "y"), math.inf, 1e-3, restitution=0.5, dissipation=0.1)
    with pytest.raises(SystemModelError, match="stiffness"):
        RoundStop(("x", "y"), math.inf, 1e-3)
    with pytest.raises(SystemModelError, match="rigid, without stiffness"):
        continue_branch(solve_orbit(two_directions(), 9.0), (1.0, 2.0), parameter="stiffness")
    with pytest.raises(SystemModelError, match="needs a motion all around"):
        System.from_modal(
            [10.0], {"x": [1.0], "y": [0.5]}, stops=[RoundStop.rigid(("x", "y"), 0.5, 1e-3)]
        )
