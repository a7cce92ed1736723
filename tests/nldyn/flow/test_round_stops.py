"""Round clearances: circular whirl in closed form, polygons, integration from event to event."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg as sla
from scipy.optimize import brentq

from nldyn import (
    ConstantForce,
    ConvergenceError,
    FlowMap,
    HarmonicForce,
    Parameter,
    PolynomialSpring,
    RoundStop,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    impacts,
    limit_cycle,
    load,
    save,
    simulate,
    solve_orbit,
)
from nldyn.app.describe import describe_rest
from nldyn.branches.tables import orbit_columns
from nldyn.flow.sliding import slider_measures
from nldyn.orbits.bordered import length_unit
from nldyn.system import DryFriction
from nldyn.system.chart import value_of, with_value
from nldyn.system.equilibrium import rest
from nldyn.system.naming import slider_name
from tests.rubbing import Ring, Rotor, turns

MASS, STIFFNESS, DAMPING, CLEARANCE = 2.0, 8e3, 6.0, 1e-3
PLANE = {"x": [1.0, 0.0], "y": [0.0, 1.0]}
PERIOD = np.array([0.0, 2.0 * np.pi])


def jeffcott(stops, unbalance=2e-3, *more):
    """A disc on a light shaft, of which the modes are x and y over the square root of its mass."""
    return System.from_matrices(
        MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, damping=DAMPING * np.eye(2), stops=stops,
        excitation=[Unbalance("x", unbalance), Unbalance("y", unbalance, phase_deg=-90.0), *more],
    )  # fmt: skip


class Whirl:
    """The circular whirl of a disc that rubs all around, and small motions about it."""

    def __init__(self, stop: RoundStop, unbalance: float, hz: float):
        self.stop, self.w = stop, 2.0 * math.pi * hz
        inertia = STIFFNESS - MASS * self.w**2
        drive = unbalance * self.w**2

        def force(r: float) -> float:
            return stop.stiffness * (r - stop.clearance) ** stop.exponent

        def reaction(r: float) -> complex:
            return complex(1.0, stop.rub) * force(r)

        self.r = brentq(
            lambda r: abs((inertia + 1j * DAMPING * self.w) * r + reaction(r)) - drive,
            stop.clearance * (1.0 + 1e-9), 1.0, xtol=1e-18, rtol=1e-15,
        )  # fmt: skip
        turned = drive / (inertia + 1j * DAMPING * self.w + reaction(self.r) / self.r)
        rate = 1j * self.w * turned
        self.state = math.sqrt(MASS) * np.array([turned.real, turned.imag, rate.real, rate.imag])
        self.force = force(self.r)
        slope = stop.exponent * self.force / (self.r - stop.clearance)
        self.matrix = self._matrix(inertia, slope, stop.dissipation * self.force)

    def _matrix(self, inertia: float, slope: float, viscosity: float):
        """In the frame that turns with it, along the radius and across."""
        rub, secant, w = self.stop.rub, self.force / self.r, self.w
        contact = np.array([[slope, -rub * secant], [rub * slope, secant]])
        loss = np.array([[viscosity, 0.0], [rub * viscosity, 0.0]])
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        found = np.zeros((4, 4))
        found[:2, 2:] = np.eye(2)
        found[2:, :2] = -(inertia * np.eye(2) + DAMPING * w * turn + contact) / MASS
        found[2:, 2:] = -(DAMPING * np.eye(2) + loss + 2.0 * MASS * w * turn) / MASS
        return found

    @property
    def multipliers(self):
        return np.exp(np.linalg.eigvals(self.matrix) * 2.0 * np.pi / self.w)


@pytest.mark.parametrize(
    "stop",
    [
        RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0),
        RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.05, surface_speed=5.0),
        RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.05, surface_speed=-5.0),
        RoundStop(("x", "y"), 2e6, CLEARANCE, friction=0.05, surface_speed=5.0),
        RoundStop(
            ("x", "y"), 5e4, CLEARANCE, 1.0, dissipation=2.0, friction=0.1, surface_speed=5.0
        ),
    ],
)
def test_full_annular_rub_is_that_in_closed_form(stop):
    whirl = Whirl(stop, 2e-3, 12.0)
    orbit = solve_orbit(jeffcott([stop]), 12.0, guess=whirl.state * (1.0 + 1e-4))
    moved = orbit.history(16)
    radii = np.hypot(moved.displacement["x"], moved.displacement["y"])
    assert radii == pytest.approx(whirl.r, rel=1e-12)
    assert moved.force[:, 0] == pytest.approx(whirl.force, rel=1e-11)
    assert orbit.max_penetration == pytest.approx(whirl.r - CLEARANCE, rel=1e-11)
    assert orbit.impacts == 0  # it stays closed
    gap = np.sort_complex(orbit.multipliers) - np.sort_complex(whirl.multipliers)
    assert np.abs(gap).max() < 1e-11
    assert orbit.liouville_error < 1e-11


@pytest.mark.parametrize("surface", [5.0, -5.0, 0.0])
def test_a_rub_all_around_wears_as_in_closed_form(surface):
    """The work rate of tubes is N v, friction's power μ N v; 0 of what does not turn."""
    stop = RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.05, surface_speed=surface)
    whirl = Whirl(stop, 2e-3, 12.0)
    orbit = solve_orbit(jeffcott([stop]), 12.0, guess=whirl.state * (1.0 + 1e-4))
    (found,) = orbit.friction
    rate = whirl.force * abs(surface + whirl.w * whirl.r)
    assert found.power == pytest.approx(0.05 * rate, rel=1e-11)
    assert found.work_rate == pytest.approx(rate, rel=1e-11)
    assert found.pressed_distance == pytest.approx(rate / 12.0, rel=1e-11)
    assert found.peak_force == pytest.approx(0.05 * whirl.force, rel=1e-9)
    assert (found.stuck, found.slid, found.open) == (0.0, 1.0, 0.0)
    assert slider_name(orbit.system, 0) == "friction, ring at 'x', 'y'"


def elliptic(sense=-1.0, inside=True):
    """A disc that does not turn, carried round on an ellipse, and the same for integration."""
    ring = RoundStop(
        ("x", "y"), 5e4, CLEARANCE, 1.0, (0.0, 0.0) if inside else (1.4e-3, 0.0), inside,
        friction=0.2, surface_speed=0.0,
    )  # fmt: skip
    forces = [HarmonicForce("x", 3.0), HarmonicForce("y", 2.0, phase_deg=sense * 90.0)]
    system = System.from_matrices(
        MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, damping=4.0 * DAMPING * np.eye(2),
        stops=[ring], excitation=forces,
    )  # fmt: skip
    rows = np.eye(2)
    same = Ring(rows, 5e4, CLEARANCE, 1.0, ring.eccentricity, ring.sense, friction=0.2)

    def rotor(w):
        def load(t):
            return np.array([3.0 * math.cos(w * t), 2.0 * math.cos(w * t + sense * np.pi / 2.0)])

        return Rotor(MASS * rows, 4.0 * DAMPING * rows, STIFFNESS * rows, load, [same])

    return system, rotor


@pytest.mark.parametrize(("hz", "inside"), [(8.5, True), (9.5, True), (4.4, False)])
def test_work_rates_of_what_does_not_turn_are_those_of_an_independent_integration(hz, inside):
    system, rotor = elliptic(sense=-1.0 if inside else 1.0, inside=inside)
    orbit = solve_orbit(system, hz)
    (found,) = orbit.friction
    assert 0.1 < found.open < 0.99
    start = orbit.states(np.zeros(1))[0] / math.sqrt(MASS)
    end, _, _, work = rotor(orbit.omega).followed(start, orbit.duration, orbit.duration / 400)
    assert end == pytest.approx(start, abs=1e-8 * np.abs(start).max())
    assert found.work_rate == pytest.approx(hz * work, rel=1e-8)
    assert found.loss == pytest.approx(0.2 * work, rel=1e-8)


def test_a_table_goes_on_to_where_there_is_no_friction():
    system, _ = elliptic()
    to_none = Parameter("rubbing_friction", 0)
    branch = continue_branch(solve_orbit(system, 9.0), (0.0, 0.2), parameter=to_none)
    table = orbit_columns(branch.points)
    order = np.argsort([node.value for node in branch.nodes])
    lost = table["friction_loss_j"][order]
    assert lost[0] == 0.0 and lost[-1] > 1e-4
    assert branch.points[order[0]].friction[0].work_rate > 0.0


def test_what_whirls_the_other_way_does_the_same_in_a_mirror():
    one, other = (solve_orbit(elliptic(sense=sense)[0], 8.5) for sense in (-1.0, 1.0))
    (there,), (back,) = one.friction, other.friction
    assert back.loss == pytest.approx(there.loss, rel=1e-9)
    assert (back.stuck, back.open) == pytest.approx((there.stuck, there.open), abs=1e-9)
    sizes = [np.sort(np.abs(orbit.multipliers)) for orbit in (one, other)]
    assert sizes[1] == pytest.approx(sizes[0], abs=1e-9)


def test_a_branch_goes_on_where_a_tube_begins_to_stick():
    ring = RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.6, surface_speed=0.0)
    system = System.from_matrices(
        MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, damping=4.0 * DAMPING * np.eye(2),
        stops=[ring],
        excitation=[HarmonicForce("x", 3.0), HarmonicForce("y", 2.0, phase_deg=-30.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 9.9), (9.9, 10.7))
    assert branch.stop_reason == "end of the frequency range / end of the frequency range"
    first, last = branch.points[0], branch.points[-1]
    assert first.friction[0].stuck == 0.0 and math.isfinite(first.liouville_error)
    assert last.friction[0].stuck > 0.1 and math.isnan(last.liouville_error)
    w = last.omega

    def load_at(t):
        return np.array([3.0 * math.cos(w * t), 2.0 * math.cos(w * t - math.pi / 6.0)])

    rotor = Rotor(
        MASS * np.eye(2), 4.0 * DAMPING * np.eye(2), STIFFNESS * np.eye(2), load_at,
        [Ring(np.eye(2), 5e4, CLEARANCE, friction=0.6)],
    )  # fmt: skip
    start = last.states(np.zeros(1))[0] / math.sqrt(MASS)
    end, _, passed, work = rotor.followed(start, last.duration, last.duration / 400)
    assert end == pytest.approx(start, abs=1e-8 * np.abs(start).max())
    assert turns(passed) == (2, 2, 0)
    assert last.friction[0].work_rate == pytest.approx(work / last.duration, rel=1e-8)


class Roll:
    """The backward whirl of a disc that rolls in a ring without slipping, driven by nothing else.

    Its surface has the speed v, so that it goes round at Ω = v/r. With the radial balance
    m v²/r = K r + k (r - c), and friction that gives what the damper takes, C v: it must be no more
    than μ N. Small motions keep r φ' = -v, and are m ρ'' + C ρ' + (K + k + m v²/r²) ρ = 0.
    """

    def __init__(self, surface: float, damping: float = 24.0, friction: float = 0.2):
        self.v, self.damping, self.stiffness = surface, damping, 5e4
        K = STIFFNESS + self.stiffness
        push = self.stiffness * CLEARANCE
        self.r = (push + math.sqrt(push**2 + 4.0 * K * MASS * surface**2)) / (2.0 * K)
        self.pressed = self.stiffness * (self.r - CLEARANCE)
        self.stop = RoundStop(
            ("x", "y"), self.stiffness, CLEARANCE, 1.0, friction=friction, surface_speed=surface
        )
        self.system = System.from_matrices(
            MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, damping=damping * np.eye(2),
            stops=[self.stop],
        )  # fmt: skip
        self.w = surface / self.r
        self.start = math.sqrt(MASS) * np.array([self.r, 0.0, 0.0, -surface])

    @property
    def multipliers(self):
        spring = STIFFNESS + self.stiffness + MASS * self.w**2
        rates = np.roots([MASS, self.damping, spring])
        return np.array([0.0, *np.exp(rates * 2.0 * math.pi / self.w)])

    @staticmethod
    def onset(damping: float = 24.0, friction: float = 0.2) -> float:
        """Least speed at which friction suffices: μ (m Ω² - K) = C Ω, the whip that slides."""
        w = np.roots([friction * MASS, -damping, -friction * STIFFNESS]).max()
        return float(w * 5e4 * CLEARANCE / (5e4 + STIFFNESS - MASS * w**2))


def test_dry_whip_rolls_backwards_as_in_closed_form():
    roll = Roll(0.15)
    cycle = limit_cycle(roll.system, start=1.001 * roll.start, frequency_hz=roll.w / 2.0 / math.pi)
    assert 2.0 * math.pi * cycle.frequency_hz == pytest.approx(roll.w, rel=1e-12)
    assert cycle.max_penetration == pytest.approx(roll.r - CLEARANCE, rel=1e-11)
    gap = np.sort_complex(cycle.multipliers) - np.sort_complex(roll.multipliers)
    assert np.abs(gap).max() < 1e-10
    assert cycle.multiplier_along == pytest.approx(1.0, abs=1e-10)
    assert cycle.stable
    (found,) = cycle.friction
    assert (found.stuck, found.loss) == (1.0, 0.0)
    assert found.peak_force == pytest.approx(24.0 * 0.15, rel=1e-9)  # what the damper takes


def test_dry_whip_begins_where_friction_can_hold_it():
    onset = Roll.onset()
    for surface, holds in ((onset * (1.0 + 1e-6), True), (onset * (1.0 - 1e-6), False)):
        roll = Roll(surface)
        flow = FlowMap(roll.system)
        motion = flow.trajectory(flow.to_state(roll.start[None]), PERIOD, roll.w)
        (found,) = slider_measures(motion)
        assert (found.stuck == 1.0) is holds
    with pytest.raises(ConvergenceError):  # it comes to rest
        slow = Roll(0.97 * onset)
        limit_cycle(slow.system, start=slow.start, frequency_hz=slow.w / 2.0 / math.pi)


def test_friction_makes_the_whirl_unstable_where_the_frame_that_turns_says():
    def growth(mu):
        stop = RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=mu, surface_speed=5.0)
        return stop, Whirl(stop, 2e-3, 12.0)

    def fastest(mu):
        return float(np.linalg.eigvals(growth(mu)[1].matrix).real.max())

    onset = brentq(fastest, 1e-3, 0.05, xtol=1e-14)
    for mu, stable in ((onset - 1e-8, True), (onset + 1e-8, False)):
        stop, whirl = growth(mu)
        assert solve_orbit(jeffcott([stop]), 12.0, guess=whirl.state).stable is stable


def random_system(seed, surfaces):
    """Modes, a ring or a pin somewhere, and the same for the independent integration.

    A surface of 20 m/s hardly ever turns, one slower than the whirl sticks and turns.
    """
    rng = np.random.default_rng([64, seed])
    n = int(rng.integers(2, 5))
    half = rng.normal(size=(n, n))
    M = np.diag(rng.uniform(0.5, 2.0, n))
    K = half @ half.T * 1e3 + np.diag(rng.uniform(2e3, 2e4, n))
    C = 0.002 * K + np.diag(rng.uniform(1.0, 5.0, n))
    rows = np.eye(2, n) + (0.2 * rng.normal(size=(2, n)) if n > 2 else 0.0)
    p, c = float(rng.choice([1.0, 1.5, 2.0])), rng.uniform(0.5e-3, 1e-3)
    stop = RoundStop(
        ("x", "y"), rng.uniform(2e4, 5e5) * 1e-4 ** (1.0 - p), c, p,
        tuple(0.3 * c * rng.normal(size=2)), bool(rng.random() < 0.7),
        dissipation=float(rng.choice([0.0, 0.2])), friction=float(rng.choice([0.0, 0.1, 0.3, 0.8])),
        surface_speed=float(rng.choice(surfaces)),
    )  # fmt: skip
    w, f, share = 2.0 * np.pi * rng.uniform(5.0, 40.0), rng.uniform(2.0, 20.0), rng.random()
    system = System.from_matrices(
        M, K, {"x": rows[0], "y": rows[1]}, damping=C, stops=[stop],
        excitation=[
            HarmonicForce("x", f), HarmonicForce("y", share * f, phase_deg=-90.0),
            ConstantForce("x", 0.5 * f),
        ],
    )  # fmt: skip
    ring = Ring(
        rows, stop.stiffness, c, p, stop.eccentricity, stop.sense, stop.dissipation,
        stop.friction, stop.sliding_speed,
    )  # fmt: skip
    rotor = Rotor(
        M, C, K,
        lambda t: f * (rows[0] * (math.cos(w * t) + 0.5) + rows[1] * share * math.sin(w * t)),
        [ring],
    )  # fmt: skip
    near = c * (rng.uniform(0.5, 1.1) if stop.inside else rng.uniform(1.0, 1.6))
    angle = rng.uniform(0.0, 2.0 * np.pi)
    away = np.array(stop.eccentricity) + near * np.array([np.cos(angle), np.sin(angle)])
    start = np.concatenate([np.linalg.pinv(rows) @ away, 0.1 * rng.normal(size=n)])
    modes = sla.eigh(K, M)[1]
    return system, rotor, w, start, sla.block_diag(modes, modes)


def check_against_integration(seed, surfaces):
    """How often it closes, and how often it sticks, slips and turns."""
    system, rotor, w, start, basis = random_system(seed, surfaces)
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(np.linalg.solve(basis, start))[None], PERIOD, w)
    assert not found.failure
    end, columns, passed, _ = rotor.followed(
        start, 2.0 * np.pi / w, 2.0 * np.pi / w / 400, columns=True
    )
    n = start.size // 2
    ours = basis @ flow.to_modal(found.ends[0])
    assert np.abs(ours - end)[:n].max() < 1e-8 * np.abs(end[:n]).max()
    assert np.abs(ours - end)[n:].max() < 1e-8 * np.abs(end[n:]).max()
    right, left = basis @ system.linear.right, system.linear.left @ np.linalg.inv(basis)
    jacobian = right @ found.jacobians[0] @ left
    assert np.abs(jacobian - columns).max() < 1e-6 * np.abs(columns).max()
    return np.array([int(found.closings[0]), *turns(passed)])


FAST, SLOW = (-20.0, 20.0), (-0.05, 0.0, 0.02)


@pytest.mark.parametrize("seed", [2, 8])
def test_motions_are_those_of_an_independent_integration(seed):
    check_against_integration(seed, FAST)


@pytest.mark.parametrize("seed", [15, 25, 27])
def test_motions_that_stick_and_turn_are_those_of_an_independent_integration(seed):
    assert check_against_integration(seed, SLOW)[1:].any()


@pytest.mark.slow
@pytest.mark.parametrize("surfaces", [FAST, SLOW])
@pytest.mark.parametrize("block", range(5))
def test_random_motions_are_those_of_an_independent_integration(block, surfaces):
    found = [check_against_integration(100 + 10 * block + k, surfaces) for k in range(10)]
    hits, *turned = np.sum(found, axis=0)
    assert hits > 10
    assert surfaces is FAST or sum(turned) > 0


PADS = 3e4  # N/m and rad


def pressed_pads(depth, speed):
    """Force of a ring of endlessly many pads, ∫ k (r cos φ - c) cos φ dφ where they press."""
    radius = CLEARANCE + depth
    x = 2.0 * math.atan2(math.sqrt(depth * (2.0 * CLEARANCE + depth)), CLEARANCE)
    square = x * x
    if x < 0.5:
        wedge = 1.0 - square / 72.0 * (1.0 - square / 110.0 * (1.0 - square / 156.0))
        wedge = x * square / 12.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * wedge))
    else:
        wedge = 0.5 * (x - math.sin(x))
    return PADS * radius * wedge, 0.5 * PADS * (x + math.sin(x)), 0.0


def check_polygons(numbers):
    """Ends of motions between pads of the same stiffness per angle come to those in the ring."""
    hertz = 4.0 / 3.0 * math.sqrt(2.0 / CLEARANCE) * PADS
    ring = jeffcott([RoundStop(("x", "y"), hertz, CLEARANCE, law=pressed_pads)])
    w, start = 2.0 * np.pi * 10.0, np.array([1.3e-3, 0.4e-3, -0.05, 0.12]) * math.sqrt(MASS)

    def end(system):
        flow = FlowMap(system)
        found = flow.shoot(flow.to_state(start[None]), PERIOD, w)
        assert not found.failure
        return flow.to_modal(found.ends)[0]

    true, errors = end(ring), []
    for pads in numbers:
        angles = 2.0 * np.pi * np.arange(pads) / pads
        names = {f"pad {k}": [math.cos(a), math.sin(a)] for k, a in enumerate(angles)}
        polygon = System.from_matrices(
            MASS * np.eye(2), STIFFNESS * np.eye(2), {**PLANE, **names},
            damping=DAMPING * np.eye(2), excitation=ring.excitation,
            stops=[Stop.linear(name, 2.0 * np.pi * PADS / pads, gap=CLEARANCE) for name in names],
        )  # fmt: skip
        errors.append(float(np.linalg.norm(end(polygon) - true)) * pads**2)
    assert all(error < 0.3 for error in errors[1:])  # pads² times as large
    assert errors[1] < 0.5 * errors[0]  # eight pads are still coarser than that
    return errors


def test_pads_around_a_disc_come_to_a_ring():
    pytest.importorskip("numba")
    check_polygons((8, 32))


@pytest.mark.slow
def test_many_pads_do_with_the_square_of_their_number():
    pytest.importorskip("numba")
    errors = check_polygons((8, 32, 128))
    assert errors[2] < 1.5 * errors[1]


def test_derivatives_are_those_of_differences():
    stop = RoundStop(
        ("x", "y"), 5e4, CLEARANCE, 1.0, (1e-4, -2e-4), friction=0.1, surface_speed=-5.0,
        dissipation=1.0,
    )  # fmt: skip
    flow, w = FlowMap(jeffcott([stop])), 2.0 * np.pi * 11.0
    start = flow.to_state(np.array([[1.2e-3, 0.3e-3, 0.01, 0.05]]))
    found = flow.shoot(start, PERIOD, w)
    assert not found.failure and found.closings[0] >= 1

    def by(change, step):
        ends = [flow.shoot(*change(sign * step)).ends[0] for sign in (1.0, -1.0)]
        return (ends[0] - ends[1]) / (2.0 * step)

    columns = [
        by(lambda h, e=e: (start + h * e, PERIOD, w), 1e-9) for e in np.eye(start.size)[:, None]
    ]
    assert np.abs(np.array(columns).T - found.jacobians[0]).max() < 1e-5
    by_omega = by(lambda h: (start, PERIOD, w + h), 1e-5)
    assert by_omega == pytest.approx(found.d_omega[0], abs=1e-6 * np.abs(by_omega).max())


def test_a_whirl_that_is_faster_than_the_surface_drags_it_along():
    back, forth = (
        RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.05, surface_speed=speed)
        for speed in (-0.05, 0.05)
    )
    whirl = Whirl(forth, 2e-3, 12.0)
    assert whirl.w * whirl.r > 0.05
    found = [solve_orbit(jeffcott([stop]), 12.0, guess=whirl.state) for stop in (back, forth)]
    assert found[0].point == pytest.approx(found[1].point, rel=1e-11)
    for orbit, surface in zip(found, (-0.05, 0.05), strict=True):
        power = 0.05 * whirl.force * (whirl.w * whirl.r + surface)
        assert orbit.friction[0].power == pytest.approx(power, rel=1e-10)


def test_a_drop_into_a_ring_keeps_its_energy():
    weight = ConstantForce("x", 20.0)
    free = System.from_matrices(
        MASS * np.eye(2), np.zeros((2, 2)), PLANE, excitation=[weight],
        stops=[RoundStop(("x", "y"), 5e6, CLEARANCE, eccentricity=(2e-4, 3e-4))],
    )  # fmt: skip
    flow, w = FlowMap(free), 2.0 * np.pi * 2.0
    found = flow.trajectory(flow.to_state(np.zeros((1, 4))), PERIOD, w)
    assert not found.failure and found.closings[0] > 5
    states = flow.to_modal(found.states(np.linspace(*PERIOD, 400)))
    depth, _ = free.depth_and_speed(free.stops[0], states)
    stored = 5e6 * np.maximum(depth, 0.0) ** 2.5 / 2.5 - 20.0 * states[:, 0] / math.sqrt(MASS)
    energy = 0.5 * (states[:, 2:] ** 2).sum(axis=1) + stored
    assert np.abs(energy).max() < 1e-9 * np.abs(stored).max()


def test_weight_rests_in_a_ring_beside_its_lowest_place_with_friction():
    for mu in (0.0, 0.2):
        stop = RoundStop(("x", "y"), 5e6, CLEARANCE, friction=mu, surface_speed=5.0)
        drop = ConstantForce("x", 20.0)
        system = System.from_matrices(MASS * np.eye(2), np.zeros((2, 2)), PLANE, stops=[stop],
                                      excitation=[drop])  # fmt: skip
        at = system.round_polar(stop, np.append(rest(system), [0.0, 0.0])[None])
        force = stop.force(at.depth)[:, None] * stop.along(at)
        assert force[0] == pytest.approx([20.0, 0.0], abs=1e-10)
        assert math.atan2(*at.normal[0][::-1]) == pytest.approx(-math.atan(mu), abs=1e-12)


@pytest.mark.parametrize("surface", [5.0, -5.0])
def test_a_spring_presses_on_a_pin_where_friction_holds_it_or_nowhere(surface):
    # it pulls to a place a beside the centre; where it rests at a distance r and an angle φ from
    # the way there, it pulls by K (r - a cos φ) inward and by K a sin φ across, against μ N
    e, a, k, push = np.array([0.46e-3, 0.55e-3]), 0.8e-3, 5e5, np.array([0.6, 0.8])
    for mu, rests in ((0.3, True), (1.0, True), (1.6, False)):
        stop = RoundStop(
            ("x", "y"), k, CLEARANCE, 1.0, tuple(e), False, friction=mu, surface_speed=surface
        )
        loads = STIFFNESS * (e + a * push)
        system = System.from_matrices(
            MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, stops=[stop],
            excitation=[ConstantForce(name, f) for name, f in zip("xy", loads, strict=True)],
        )  # fmt: skip
        if not rests:
            with pytest.raises(SystemModelError, match="no rest"):
                rest(system)
            continue
        at = system.round_polar(stop, np.append(rest(system), [0.0, 0.0])[None])
        pressed = stop.force(at.depth)[0]
        turn = push[0] * at.normal[0, 1] - push[1] * at.normal[0, 0]  # sin φ
        assert pressed == pytest.approx(
            STIFFNESS * (at.radius[0] - a * float(push @ at.normal[0])), rel=1e-9
        )
        # the surface pushes the body back, against the sense in which that of the body slides
        assert STIFFNESS * a * turn == pytest.approx(math.copysign(mu * pressed, surface), rel=1e-9)


def test_what_rests_beside_a_pin_is_held_by_its_spring_alone():
    # where it would rest at zero the pin is in its way, beyond the pin nothing is
    for mu in (0.0, 1.0):
        pin = RoundStop(
            ("x", "y"), 5e5, CLEARANCE, 1.0, (0.46e-3, 0.55e-3), False, friction=mu,
            surface_speed=5.0,
        )  # fmt: skip
        system = System.from_matrices(
            MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, stops=[pin],
            excitation=[ConstantForce("x", 50.0), ConstantForce("y", 50.0)],
        )  # fmt: skip
        place = rest(system) / math.sqrt(MASS)
        assert place == pytest.approx(np.full(2, 50.0 / STIFFNESS), rel=1e-12)


@pytest.mark.parametrize("push", [9.7, 11.0, 14.4])
def test_what_is_pushed_straight_at_a_pin_comes_to_rest_behind_it(push):
    # the spring's own place lies within the pin, beyond its centre
    pin = RoundStop(("x", "y"), 5e5, CLEARANCE, 1.0, (1.2e-3, 0.0), False)
    system = System.from_matrices(
        MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, stops=[pin],
        excitation=[ConstantForce("x", push)],
    )  # fmt: skip
    # K x + k (x - e - c) = F there
    known = (push + 5e5 * 2.2e-3) / (STIFFNESS + 5e5)
    assert rest(system) / math.sqrt(MASS) == pytest.approx([known, 0.0], abs=1e-12)


def test_files_hold_round_stops(tmp_path):
    stop = RoundStop(
        ("x", "y"), 5e4, CLEARANCE, 1.0, (1e-4, -2e-4), friction=0.05, surface_speed=5.0,
        dissipation=0.1,
    )  # fmt: skip
    system = jeffcott([Stop.linear("x", 1e3, gap=1.0), stop])
    orbit = solve_orbit(system, 12.0, guess=Whirl(stop, 2e-3, 12.0).state)
    branch = continue_branch(orbit, (11.9, 12.1))
    save(branch, tmp_path / "branch.h5")
    back = load(tmp_path / "branch.h5")[0]
    assert back.points[0].system.stops == system.stops
    assert back.points[-1].multipliers == pytest.approx(branch.points[-1].multipliers)


def test_numbers_of_numpy_are_written_as_all_others(tmp_path):
    plain = RoundStop(("x", "y"), 5e4, 0.5, 1.0, (0.25, 0.0), True, friction=0.5, surface_speed=5.0)
    stop = RoundStop(
        ("x", "y"), np.int64(50000), np.float32(0.5), np.int64(1),
        (np.float32(0.25), np.int64(0)), np.True_, dissipation=np.float32(0.0),
        friction=np.float32(0.5), surface_speed=np.int64(5),
    )  # fmt: skip
    save(continue_branch(solve_orbit(jeffcott([stop]), 12.0), (11.9, 12.1)), tmp_path / "b.h5")
    assert load(tmp_path / "b.h5")[0].points[0].system.stops == (plain,)
    assert repr(stop) == repr(plain)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"plane": "xy"}, "two interfaces"),
        ({"plane": ("x", "x")}, "different"),
        ({"clearance": 0.0}, "clearance must be positive"),
        ({"clearance": -1e-3}, "clearance must be positive"),
        ({"eccentricity": (0.0,)}, "two numbers"),
        ({"friction": -0.1, "surface_speed": 1.0}, "friction must not be negative"),
        ({"friction": 0.1}, "'y' has friction, which needs the surface_speed of what turns, or 0"),
        ({"surface_speed": 5.0}, "'y' has a surface_speed, which needs a friction, or 0"),
        ({"stiffness": -1.0}, "stiffness must be positive"),
        ({"against_plane": ("x", "z")}, "other interfaces"),
    ],
)
def test_bad_numbers_are_told(values, said):
    good = {"plane": ("x", "y"), "stiffness": 1e6, "clearance": 1e-3}
    with pytest.raises(SystemModelError, match=said):
        RoundStop(**{**good, **values})


def test_friction_in_a_plane_of_one_motion_is_told():
    ring = RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.2, surface_speed=0.0)
    with pytest.raises(SystemModelError, match="no motion all around"):
        System.from_matrices([[MASS]], [[STIFFNESS]], {"x": [1.0], "y": [0.5]}, stops=[ring])


@pytest.mark.parametrize("size", [-1.0, 0.3])
def test_directions_of_a_ring_that_are_one_motion_are_told(size):
    rows = {"x": [1.0, 0.0], "y": [size, 0.0]}
    with pytest.raises(SystemModelError, match="must be perpendicular"):
        System.from_matrices(
            np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], rows, stops=[RoundStop(("x", "y"), 5.0, 0.1)]
        )


def test_unknown_interfaces_are_told():
    with pytest.raises(SystemModelError, match="'z'"):
        jeffcott([RoundStop(("x", "z"), 1e6, 1e-3)])


@pytest.mark.parametrize("inside", [True, False])
def test_derivatives_by_parameters_are_those_of_differences(inside):
    stop = RoundStop(
        ("x", "y"), 5e4, CLEARANCE, 1.2, (1e-4, -2e-4), inside, friction=0.1, surface_speed=-5.0,
        dissipation=1.0,
    )  # fmt: skip
    system, w = jeffcott([Stop.linear("x", 1e4, gap=1.6e-3), stop]), 2.0 * np.pi * 11.0
    names = ("clearance", "stiffness", "exponent", "dissipation", "rubbing_friction",
             "first_eccentricity", "second_eccentricity")  # fmt: skip
    parameters = [Parameter(name, 1) for name in names]
    start = (1.0 if inside else 0.4) * np.array([[1.7e-3, 0.5e-3, 0.01, 0.05]])
    found = FlowMap(system).shoot(start, PERIOD, w, parameters=parameters)
    assert not found.failure and np.all(found.d_parameters.any(axis=1))
    for column, parameter in zip(found.d_parameters[0].T, parameters, strict=True):
        value, errors = value_of(system, 11.0, parameter), []
        for step in (1e-4 * abs(value), 1e-5 * abs(value)):
            ends = [
                FlowMap(with_value(system, parameter, value + sign * step))
                .shoot(start, PERIOD, w).ends[0] for sign in (1.0, -1.0)
            ]  # fmt: skip
            change = (ends[0] - ends[1]) / (2.0 * step)
            errors.append(np.abs(change - column).max() / np.abs(column).max())
        assert min(errors) < 1e-5, parameter


def test_a_branch_goes_on_where_the_whirl_touches_all_around():
    stop = RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.01, surface_speed=5.0)
    branch = continue_branch(solve_orbit(jeffcott([stop], 1e-3), 8.0), (8.0, 10.5))
    assert branch.stop_reason == "end of the frequency range / end of the frequency range"
    free, touching = branch.points[0], branch.points[-1]
    assert free.max_penetration == 0.0
    whirl = Whirl(stop, 1e-3, touching.frequency_hz)
    assert touching.max_penetration == pytest.approx(whirl.r - CLEARANCE, rel=1e-9)


def test_grazing_beside_a_weight_is_that_in_closed_form():
    stop, weight = RoundStop(("x", "y"), 5e4, CLEARANCE), 3.0
    system = jeffcott([stop], 1e-3, ConstantForce("x", weight))
    branch = continue_branch(solve_orbit(system, 7.0), (6.8, 8.0))

    def room(hz):
        w = 2.0 * np.pi * hz
        swing = 1e-3 * w**2 / abs(STIFFNESS - MASS * w**2 + 1j * DAMPING * w)
        return CLEARANCE - weight / STIFFNESS - swing

    known = brentq(room, 7.0, 8.0, xtol=1e-13)
    found = next(point for point in branch.special_points if point.kind == "GR")
    assert found.frequency_hz == pytest.approx(known, rel=1e-9)


def test_round_stops_act_beside_all_else_that_acts():
    def flow(stops, *dampers):
        system = System.from_matrices(
            MASS * np.eye(3), STIFFNESS * np.eye(3),
            {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]},
            damping=DAMPING * np.eye(3), stops=stops,
            springs=[PolynomialSpring("z", [0.0, 0.0, 1e9])],
            dampers=dampers,
            excitation=[Unbalance("x", 2e-3), Unbalance("y", 2e-3, phase_deg=-90.0),
                        HarmonicForce("z", 12.0)],
        )  # fmt: skip
        return FlowMap(system)

    def ring(**other):
        return RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, **other)

    pressed = Stop.linear("x", 2e4, gap=8e-4)
    rough = Stop("x", 2e4, 1.0, 8e-4, tangent="z", friction=0.2)
    start, w = np.array([[1.2e-3, 0.3e-3, 1e-4, 0.01, 0.05, 0.02]]), 2.0 * np.pi * 11.0
    # what acts along z alone does not know of the plane, and the plane nothing of it
    both = flow([pressed, ring(friction=0.1, surface_speed=3.0)], DryFriction("z", 2.0, 0.3))
    plane = FlowMap(jeffcott([pressed, ring(friction=0.1, surface_speed=3.0)]))
    z = both.to_modal(both.shoot(both.to_state(start), PERIOD, w).ends)[0]
    other = plane.to_modal(plane.shoot(plane.to_state(start[:, [0, 1, 3, 4]]), PERIOD, w).ends)[0]
    assert z[[0, 1, 3, 4]] == pytest.approx(other, rel=1e-9)
    # two rings of half the stiffness are one
    one, two = (
        flow([rough, *rings]) for rings in (
            [ring()], [RoundStop(("x", "y"), 2.5e4, CLEARANCE, 1.0) for _ in range(2)])
    )  # fmt: skip
    ends = [one.shoot(start, PERIOD, w), two.shoot(start, PERIOD, w)]
    assert not ends[0].failure and not ends[1].failure and ends[0].closings.any()
    assert ends[0].ends == pytest.approx(ends[1].ends, rel=1e-8)
    assert ends[0].jacobians == pytest.approx(ends[1].jacobians, abs=1e-6)


def test_impacts_of_a_motion_are_those_of_its_orbit():
    stop = RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, friction=0.02, surface_speed=5.0)
    orbit = solve_orbit(jeffcott([stop], 1e-3, ConstantForce("x", 3.0)), 8.0)
    (hit,) = orbit.impact_list
    motion = simulate(orbit.system, 8.0, periods=2, start=orbit.states(np.zeros(1))[0])
    table = impacts(motion)
    assert table.penetration[0] == pytest.approx(hit.penetration, rel=1e-5)
    assert table.peak_force[0] == pytest.approx(hit.force, rel=1e-5)
    assert table.impulse[0] > 0.0 and abs(table.loss[0]) < 1e-9 * table.work[0]


@pytest.mark.parametrize("loss", [20.0, 60.0])
def test_normal_forces_that_pull_count_as_such(loss):
    flat = [Stop("x", 5e4, 1.0, CLEARANCE, direction=way, dissipation=loss) for way in (1, -1)]
    ring = RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0, dissipation=loss)
    tables = []
    for stops in (flat, [ring]):
        system = System.from_matrices(
            MASS * np.eye(2), STIFFNESS * np.eye(2), PLANE, damping=DAMPING * np.eye(2),
            stops=stops, excitation=[HarmonicForce("x", 20.0)],
        )  # fmt: skip
        tables.append(impacts(simulate(system, 12.0, periods=3)))
    sides, around = tables
    assert len(sides) > 2
    assert around.time == pytest.approx(sides.time, rel=1e-9)
    # as `impacts` says how good they are
    for name, rel in (("impulse", 1e-8), ("loss", 1e-8), ("peak_force", 1e-6), ("work", 1e-4)):
        assert getattr(around, name) == pytest.approx(getattr(sides, name), rel=rel), name


def test_a_body_rests_in_a_round_clearance_which_is_told_with_both_directions():
    system = jeffcott([RoundStop(("x", "y"), 5e4, CLEARANCE, 1.0)], 1e-3, ConstantForce("x", 20.0))
    # K (c + d) + k d = 20 N
    depth = (20.0 - STIFFNESS * CLEARANCE) / (STIFFNESS + 5e4)
    assert describe_rest(system)[-1] == (
        f"at rest the round clearance at 'x', 'y' is closed by {depth:.6g} m: {5e4 * depth:.6g} N"
    )


def test_clearances_between_bodies_in_clearances_move_as_an_independent_integration_says():
    """Two discs, each in a ring that is held, and a ring of the first around the second."""
    names = ("x", "y", "u", "v")
    M, C, w = np.diag([2.0, 2.0, 1.0, 1.0]), 4.0 * np.eye(4), 2.0 * np.pi * 11.0
    K = np.diag([8e3, 9e3, 5e3, 5e3])
    outer = {"friction": 0.1, "surface_speed": 5.0}
    stops = [
        RoundStop(("x", "y"), 5e4, 1.0e-3, 1.0, (1e-4, -2e-4), **outer),
        RoundStop(("u", "v"), 4e4, 1.5e-3, 1.0, dissipation=0.2),
        RoundStop(("x", "y"), 6e4, 0.8e-3, 1.0, (0.0, 1e-4), against_plane=("u", "v"), **outer),
    ]
    system = System.from_matrices(
        M, K, dict(zip(names, np.eye(4), strict=True)), damping=C, stops=stops,
        excitation=[HarmonicForce("x", 12.0), HarmonicForce("y", 12.0, phase_deg=-90.0),
                    HarmonicForce("u", 6.0)],
    )  # fmt: skip
    first, second = np.eye(2, 4), np.eye(2, 4, 2)
    rings = [
        Ring(rows, s.stiffness, s.clearance, 1.0, s.eccentricity, 1.0, s.dissipation,
             s.friction, s.sliding_speed)
        for rows, s in zip((first, second, first - second), stops, strict=True)
    ]  # fmt: skip

    def load_at(t):
        return np.array([12.0, 0.0, 6.0, 0.0]) * np.cos(w * t) + np.array(
            [0.0, 12.0, 0.0, 0.0]
        ) * np.sin(w * t)

    start = np.array([0.6e-3, 0.0, 0.1e-3, 0.2e-3, 0.0, 0.05, 0.02, 0.0])
    modes = sla.eigh(K, M)[1]
    basis = sla.block_diag(modes, modes)
    flow = FlowMap(system)
    begin = flow.to_state(np.linalg.solve(basis, start))[None]
    found = flow.shoot(begin, PERIOD, w)
    depth, _ = flow.trajectory(begin, PERIOD, w).contacts_at_nodes
    assert not found.failure and depth.any(axis=(0, 2)).all()  # each of them touches
    rotor = Rotor(M, C, K, load_at, rings)
    end, columns, *_ = rotor.followed(start, 2.0 * np.pi / w, 2.0 * np.pi / w / 400, columns=True)
    ours = basis @ flow.to_modal(found.ends[0])
    assert np.abs(ours - end)[:4].max() < 1e-8 * np.abs(end[:4]).max()
    assert np.abs(ours - end)[4:].max() < 1e-8 * np.abs(end[4:]).max()
    right, left = basis @ system.linear.right, system.linear.left @ np.linalg.inv(basis)
    jacobian = right @ found.jacobians[0] @ left
    assert np.abs(jacobian - columns).max() < 1e-6 * np.abs(columns).max()


def test_a_clearance_whose_first_direction_is_held_counts_along_the_second():
    def branch(plane):
        held = {name: [1.0] if name == "free" else [0.0] for name in plane}
        system = System.from_matrices(
            [[MASS]], [[STIFFNESS]], held, damping=[[DAMPING]],
            stops=[RoundStop(plane, 5e4, CLEARANCE, 1.0)],
            excitation=[Unbalance("free", 1e-3)],
        )  # fmt: skip
        orbit = solve_orbit(system, 8.0, observe="free")
        return length_unit(orbit), continue_branch(orbit, (7.9, 9.0))

    (size, found), (other_size, other) = branch(("free", "held")), branch(("held", "free"))
    assert other_size == size > 0.0
    assert [point.kind for point in found.special_points] == [
        point.kind for point in other.special_points
    ]
    assert "GR" in [point.kind for point in found.special_points]
    assert other.points[-1].max_penetration == pytest.approx(
        found.points[-1].max_penetration, rel=1e-9
    )
