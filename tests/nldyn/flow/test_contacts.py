"""Contact phases, against adaptive Runge-Kutta and closed forms that share no code with them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from independent import Motion, state_map
from scipy.optimize import brentq

from nldyn import Damper, FlowMap, FlowOptions, HarmonicForce, Stop, System, Unbalance, solve_orbit

THREE = ([13.1, 117.5, 326.5], {"middle": [0.63, 0.8, -0.5], "end": [-0.4, 0.9, 0.7]})
SHAKER = [Unbalance("middle", 5e-6)]


def three_modes(*stops: Stop, damping: float = 0.01) -> System:
    return System.from_modal(
        *THREE, modal_damping=damping, stops=stops, dampers=[Damper("end", 6.0)], excitation=SHAKER
    )


def flow_and_jacobian(system, x0, phases, omega, options=None):
    """End state, Jacobian in physical coordinates, number of closings."""
    flow = FlowMap(system, options)
    start = flow.to_state(np.asarray(x0))
    found = flow.shoot(start[None], np.array(phases), omega)
    assert found.failure == ""
    L = state_map(system)
    jacobian = np.linalg.solve(L, found.jacobians[0] @ L)
    return flow.to_modal(found.ends[0]), jacobian, found.closings


# largest relative errors of state and Jacobian; the reference itself is good to 1e-12 and 5e-11
DEFAULT = (FlowOptions(), 1e-9, 1e-8)
FINE = (FlowOptions(rtol=1e-12), 4e-12, 2e-10)


def assert_agrees(system, x0, phases, omega, *, closings, efforts=(DEFAULT, FINE)):
    """The flow map against `Motion.run`, velocities and displacements in their own scales."""
    exact, exact_jacobian, closed = Motion(system).run(np.asarray(x0), phases, omega)
    assert closed == closings
    n = system.size
    length, speed = np.abs(exact[:n]).max(), np.abs(exact[n:]).max()
    scale = np.repeat([length, max(speed, omega * length)], n)
    weights = scale[:, None] / scale
    size = np.abs(exact_jacobian / weights).max()
    for options, state_rtol, jacobian_rtol in efforts:
        found, jacobian, closed = flow_and_jacobian(system, x0, phases, omega, options)
        assert closed.tolist() == closings
        assert np.abs((found - exact) / scale).max() < state_rtol
        assert np.abs((jacobian - exact_jacobian) / weights).max() < jacobian_rtol * size


TURN = (0.3, 0.3 + 2 * np.pi)
OMEGA = 2 * np.pi * 25.0
X0 = np.array([-2e-6, 1e-6, 0.0, 4e-3, 1e-3, 2e-3])


def test_one_mode_against_runge_kutta(one_dof):
    assert_agrees(one_dof, [-2e-6, 3e-3], TURN, OMEGA, closings=[1])


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.0])
def test_three_modes_against_runge_kutta(exponent):
    stiffness = 5e9 * 4e-6 ** (1.5 - exponent)  # as stiff as Hertz's law at a depth of 4 µm
    system = three_modes(Stop("middle", stiffness=stiffness, exponent=exponent))
    assert_agrees(system, X0, TURN, OMEGA, closings=[2])


@pytest.mark.parametrize("exponent", [1.2, 2.3])
def test_exponents_that_the_square_of_time_does_not_make_smooth(exponent):
    stiffness = 5e9 * 4e-6 ** (1.5 - exponent)
    system = three_modes(Stop("middle", stiffness=stiffness, exponent=exponent))
    assert_agrees(system, X0, TURN, OMEGA, closings=[2])


@pytest.mark.parametrize("exponent", [1.0, 1.3, 1.5])
def test_states_within_a_recorded_motion_are_those_of_shorter_motions(exponent):
    """Also on a panel that starts and ends at a switch, here with two stops at the same place."""
    stiffness = 5e9 * 4e-6 ** (1.5 - exponent)
    stops = [Stop("middle", stiffness, exponent), Stop("middle", stiffness, exponent, gap=2e-6)]
    flow = FlowMap(three_modes(*stops))
    start = flow.to_state(X0)[None]
    motion = flow.trajectory(start, np.array(TURN), OMEGA)
    assert len(set(motion.record.kind.tolist()) & {1, 2, 3}) >= 2
    phases = np.linspace(*TURN, 80)[1:]
    states = motion.states(phases)
    for phase, state in zip(phases, states, strict=True):
        end = flow.shoot(start, np.array([TURN[0], phase]), OMEGA).ends[0]
        # between the nodes a panel is only as good as its polynomial
        assert state == pytest.approx(end, abs=1e-6 * np.abs(end).max())


def test_segment_that_starts_and_ends_in_contact(one_dof):
    assert_agrees(one_dof, [3e-6, -1e-3], (1.0, 7.9), OMEGA, closings=[1])


@pytest.mark.parametrize(("speed", "closings"), [(1e-4, 0), (3e-4, 1), (6e-3, 4)])
def test_preloaded_stop_against_runge_kutta(speed, closings):
    """A negative gap presses the stop: slow motion never leaves it, faster motion does."""
    system = three_modes(Stop("middle", stiffness=5e9, gap=-2e-5))
    bend = system.participation["middle"] / system.natural_frequencies**2
    compliance = system.participation["middle"] @ bend
    force = brentq(lambda f: (f / 5e9) ** (2 / 3) + compliance * f - 2e-5, 0.0, 1.0, xtol=1e-15)
    x0 = [*(-force * bend), speed, -speed, 0.5 * speed]
    assert_agrees(system, x0, (0.0, 2 * np.pi), OMEGA, closings=[closings])


def test_stops_on_both_sides_against_runge_kutta():
    system = three_modes(
        Stop("middle", stiffness=5e9, gap=1e-6),
        Stop("middle", stiffness=1e9, gap=2e-6, direction=-1),
    )
    assert_agrees(system, [2e-6, *X0[1:]], TURN, OMEGA, closings=[7, 4])


def test_stops_closed_at_the_same_time_against_runge_kutta():
    """Two stops at two places, and a second, stiffer one behind the first at the same place."""
    system = three_modes(
        Stop("middle", stiffness=5e8),
        Stop("middle", stiffness=5e9, gap=1e-6),
        Stop("end", stiffness=1e9),
    )
    assert_agrees(system, X0, TURN, OMEGA, closings=[5, 7, 4])


def test_short_contact_of_a_second_stop_while_the_first_is_closed():
    """A soft spring holds on all the time; the stiff stop behind it is hit at 95 % of the swing."""
    rest = -1.0 / (1.0 + (2 * np.pi * 20.0) ** 2)  # where the springs balance, unit mass
    system = System.from_modal(
        [20.0], {"mass": [1.0]}, modal_damping=0.001,
        stops=[
            Stop.linear("mass", 1.0, gap=-1.0),
            Stop("mass", stiffness=1e10, gap=rest + 0.95e-3),
        ],
    )  # fmt: skip
    x0 = [rest - 1e-3, 0.0]
    assert_agrees(system, x0, (0.0, 2 * np.pi), 2 * np.pi * 20.0, closings=[0, 1])


@pytest.mark.parametrize(
    ("frequencies", "shape", "stops", "velocity", "effort"),
    [
        (
            [20.0, 97.0], [0.85, 0.5],
            [Stop("m", 1e8, gap=-2e-6), Stop("m", 1e10, gap=1e-6, direction=-1)],
            [2e-3, -2e-5], DEFAULT,
        ),
        (
            [20.0, 97.0], [0.85, 0.5],
            [Stop("m", 1e7, gap=-1e-6), Stop("m", 1e8, gap=2e-7, direction=-1)],
            [1e-5, 2e-3], DEFAULT,
        ),
        ([20.0], [0.6], [Stop("m", 1e7, gap=-2e-6), Stop("m", 1e10)], [-3e-5], FINE),
    ],
    ids=["both sides", "both sides, soft", "one behind the other"],
)  # fmt: skip
def test_second_stop_that_closes_before_the_first_one_opens(
    frequencies, shape, stops, velocity, effort
):
    system = System.from_modal(frequencies, {"m": shape}, modal_damping=0.005, stops=stops)
    x0 = np.array([*np.zeros(len(shape)), *velocity])
    phases, omega = (0.0, 2 * np.pi), 2 * np.pi * 20.0
    exact, *_ = Motion(system).run(x0, phases, omega, tangent=False, max_step=0.002)
    found, _, _ = flow_and_jacobian(system, x0, phases, omega, effort[0])
    assert np.abs(found - exact).max() < effort[1] * np.abs(exact).max()


def random_system(rng, stops):
    """Up to four modes and a state, with stops of any kind at two interfaces."""
    n = int(rng.integers(1, 5))
    elements = []
    for _ in range(stops):
        exponent = float(rng.choice([1.0, 1.5, 1.5, 2.0]))
        elements.append(
            Stop(
                str(rng.choice(["m", "e"])),
                stiffness=10 ** rng.uniform(7, 10) * 4e-6 ** (1.5 - exponent),
                exponent=exponent,
                gap=float(rng.choice([0.0, rng.uniform(-5e-6, 5e-6)])),
                direction=int(rng.choice([1, -1])),
            )
        )
    system = System.from_modal(
        10 ** rng.uniform(1, 2.7, n),
        {"m": rng.uniform(0.2, 1, n), "e": rng.uniform(-1, 1, n)},
        modal_damping=10 ** rng.uniform(-4, -0.7),
        stops=elements,
        excitation=[Unbalance("m", 10 ** rng.uniform(-6, -4))],
    )
    lengths = rng.standard_normal(n) * 10 ** rng.uniform(-7, -4)
    speeds = rng.standard_normal(n) * 10 ** rng.uniform(-4, -2)
    return system, np.concatenate([lengths, speeds])


@pytest.mark.parametrize("stops", [1, 2, 3])
def test_three_accuracies_agree_on_random_systems(stops):
    rng = np.random.default_rng(11)
    for _ in range(150):
        system, x0 = random_system(rng, stops)
        phases, omega = (0.4, 0.4 + rng.uniform(0.5, 6.3)), 2 * np.pi * rng.uniform(5, 80)
        runs = [
            flow_and_jacobian(system, x0, phases, omega, options)
            for options in (FlowOptions(), FlowOptions(tail=1e-6), FlowOptions(rtol=1e-12))
        ]
        exact, jacobian, _ = runs[2]
        growth = max(1.0, np.abs(jacobian).max())
        for end, other, _ in runs:
            assert np.abs(end - exact).max() < 1e-7 * growth * np.abs(exact).max()
            assert np.abs(other - jacobian).max() < 1e-4 * growth


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-13])
def test_stops_at_one_place_act_as_one_of_their_stiffnesses(rtol):
    """Rounding of the instant may carry the body a little into one of them before the other."""
    rng = np.random.default_rng(7)
    for _ in range(60):
        n, p = int(rng.integers(1, 4)), float(rng.choice([1.0, 1.5, 2.0]))
        stiffness = 10.0 ** rng.uniform(7.0, 10.0, int(rng.integers(2, 4))) * 4e-6 ** (1.5 - p)
        gap = float(rng.choice([0.0, 3e-6]))
        hz, share, ratio = 10.0 ** rng.uniform(1, 2.7, n), rng.uniform(0.2, 1, n), 0.01
        drive = [Unbalance("m", 10 ** rng.uniform(-6, -4))]
        x0 = np.concatenate([-rng.uniform(0.0, 1e-4, n), rng.uniform(0.0, 1e-2, n)])
        phases, omega = (0.4, 0.4 + rng.uniform(0.5, 6.3)), 2 * np.pi * rng.uniform(5, 80)
        (end, jacobian, _), (other, _, _) = (
            flow_and_jacobian(
                System.from_modal(
                    hz, {"m": share}, modal_damping=ratio, excitation=drive,
                    stops=[Stop("m", k, p, gap) for k in parts],
                ),
                x0, phases, omega, FlowOptions(rtol=rtol),
            )
            for parts in (stiffness, [stiffness.sum()])
        )  # fmt: skip
        growth = max(1.0, np.abs(jacobian).max())
        assert np.abs(end - other).max() < 10.0 * max(rtol, 1e-11) * growth * np.abs(other).max()


@pytest.mark.parametrize(
    ("exponents", "seed"),
    [((1.37, 3.0, 1.0), 3), ((1.2, 1.5, 2.0), 3), ((1.2, 1.5, 2.0), 5), ((1.0, 2.5, 1.5), 3)],
)
@pytest.mark.parametrize("count", [3, pytest.param(25, marks=pytest.mark.slow)])
def test_stops_of_mixed_laws_on_one_mass_are_resolved_at_every_tolerance(exponents, seed, count):
    """Preloaded and open stops that are hit up to hundreds of times, some at almost one instant.

    The results are compared over a twentieth of the period, before impacts magnify differences.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        stops = [
            Stop(
                "a", 10 ** (rng.uniform(5, 9) + 4 * (p - 1)), p, rng.normal() * 1e-4,
                int(rng.choice([-1, 1])), dissipation=5.0 if rng.random() < 0.3 else 0.0,
            )
            for p in exponents
        ]  # fmt: skip
        system = System.from_modal(
            [10.0], {"a": [1.0]}, modal_damping=0.02, stops=stops,
            excitation=[HarmonicForce("a", rng.uniform(0.5, 4))],
        )  # fmt: skip
        start = rng.normal(size=(1, 2)) * [1e-4, 1e-2]
        omega = 2 * np.pi * rng.uniform(5, 40)
        ends = {}
        for rtol in (1e-3, 1e-6, 1e-9, 1e-12):
            flow = FlowMap(system, FlowOptions(rtol=rtol))
            assert flow.shoot(start, np.array([0.0, 2 * np.pi]), omega).failure == ""
            ends[rtol] = flow.shoot(start, np.array([0.0, 0.1 * np.pi]), omega).ends[0]
        size = np.abs(flow.trajectory(start, np.array([0.0, 0.1 * np.pi]), omega).states(
            np.linspace(0.0, 0.1 * np.pi, 50))).max(axis=0)  # fmt: skip
        assert (np.abs(ends[1e-9] - ends[1e-12]) < 1e-8 * size).all()


def test_interfaces_that_hit_each_other_against_runge_kutta():
    system = three_modes(Stop("middle", stiffness=5e9, against="end", gap=1e-7))
    assert_agrees(system, X0, TURN, OMEGA, closings=[2])


def test_stop_against_an_interface_is_a_stop_at_the_relative_displacement():
    frequencies, places = THREE
    between = np.array(places["middle"]) - np.array(places["end"])
    stop = {"stiffness": 5e9, "gap": 1e-7}
    pair = System.from_modal(
        frequencies, places, stops=[Stop("middle", against="end", **stop)], excitation=SHAKER
    )
    single = System.from_modal(
        frequencies, {**places, "between": between}, stops=[Stop("between", **stop)],
        excitation=SHAKER,
    )  # fmt: skip
    a, ja, _ = flow_and_jacobian(pair, X0, TURN, OMEGA)
    b, jb, _ = flow_and_jacobian(single, X0, TURN, OMEGA)
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())
    np.testing.assert_allclose(ja, jb, rtol=0, atol=1e-11 * np.abs(jb).max())


def test_stop_from_the_other_side_is_the_mirrored_system():
    right = three_modes(Stop("middle", stiffness=5e9, gap=5e-7))
    left = System.from_modal(
        *THREE,
        modal_damping=0.01,
        stops=[Stop("middle", stiffness=5e9, gap=5e-7, direction=-1)],
        dampers=[Damper("end", 6.0)],
        excitation=[Unbalance("middle", 5e-6, phase_deg=180.0)],
    )
    a, ja, na = flow_and_jacobian(right, X0, TURN, OMEGA)
    b, jb, nb = flow_and_jacobian(left, -X0, TURN, OMEGA)
    np.testing.assert_allclose(b, -a, rtol=0, atol=1e-12 * np.abs(a).max())
    np.testing.assert_allclose(jb, ja, rtol=0, atol=1e-10 * np.abs(ja).max())
    assert na[0] == nb[0] > 0


@pytest.mark.parametrize("modes", [1, 3])
def test_frequency_derivative_against_runge_kutta(one_dof, modes):
    """d_omega at fixed phases and fixed start, from sixth-order differences in ω.

    The end state depends smoothly on ω as long as every contact begins and ends with speed.
    """
    system = one_dof if modes == 1 else three_modes(Stop("middle", stiffness=5e9))
    x0 = np.array([-2e-6, 3e-3]) if modes == 1 else X0
    flow, omega, phases = FlowMap(system), OMEGA, np.array(TURN)
    start = flow.to_state(x0)

    def end(w: float) -> np.ndarray:
        x0 = flow.to_modal(start)
        x, *_ = Motion(system).run(x0, TURN, w, tangent=False)
        return flow.to_state(x)

    h = 1e-3 * omega
    d1, d2, d3 = (end(omega + k * h) - end(omega - k * h) for k in (1, 2, 3))
    exact = (45.0 * d1 - 9.0 * d2 + d3) / (60.0 * h)
    found = flow.shoot(start[None], phases, omega).d_omega[0]
    assert np.abs(found - exact).max() < 3e-8 * np.abs(exact).max()


def test_collocation_converges_spectrally():
    """Without halving, each two further nodes gain more than any fixed order would."""
    system = three_modes(Stop("middle", stiffness=5e9))
    exact, exact_jacobian, _ = flow_and_jacobian(
        system, X0, TURN, OMEGA, FlowOptions(nodes=36, tail=1e-6)
    )
    state_errors, jacobian_errors = [], []
    for nodes in (4, 8, 12, 16, 20):
        options = FlowOptions(nodes=nodes, tail=0.999)
        x, J, _ = flow_and_jacobian(system, X0, TURN, OMEGA, options)
        state_errors.append(np.abs(x - exact).max() / np.abs(exact).max())
        jacobian_errors.append(np.abs(J - exact_jacobian).max() / np.abs(exact_jacobian).max())
    for errors, floor in ((state_errors, 1e-13), (jacobian_errors, 1e-11)):
        for coarse, fine in itertools.pairwise(errors):
            assert fine < max(0.02 * coarse, floor)
    assert state_errors[3] < 1e-12
    assert jacobian_errors[3] < 1e-10


# --- the bilinear oscillator -----------------------------------------------------------------


class Bilinear:
    """m x'' + c x' + k x + k_b max(x - g, 0) = F cos ωt, one closed form on each side of g."""

    def __init__(self, m, c, k, k_b, gap, force):
        self.m, self.c, self.gap, self.force = m, c, gap, force
        self.k = {False: k, True: k + k_b}
        self.offset = {False: 0.0, True: k_b * gap / (k + k_b)}

    def side(self, closed, x, v, t0, omega):
        """Displacement and velocity as functions of t, and the homogeneous transition matrix."""
        k = self.k[closed]
        steady = self.force / (k - self.m * omega**2 + 1j * self.c * omega)
        a = self.c / (2 * self.m)
        nu = math.sqrt(k / self.m - a * a)

        def transition(t):
            e, cos, sin = math.exp(-a * t), math.cos(nu * t), math.sin(nu * t)
            return e * np.array(
                [[cos + a / nu * sin, sin / nu], [-k / self.m / nu * sin, cos - a / nu * sin]]
            )

        def forced(t):
            z = steady * np.exp(1j * omega * t)
            return np.array([z.real + self.offset[closed], (1j * omega * z).real])

        def at(t):
            return transition(t - t0) @ (np.array([x, v]) - forced(t0)) + forced(t)

        return at, transition

    def run(self, x, v, t0, t1, omega):
        """End state, Jacobian and number of closings."""
        jacobian, closings = np.eye(2), 0
        closed = x > self.gap or (x == self.gap and v > 0)
        while t0 < t1:
            at, transition = self.side(closed, x, v, t0, omega)
            grid = np.linspace(t0, t1, 2000)
            depths = np.array([at(t)[0] - self.gap for t in grid])
            beyond = np.flatnonzero(depths[1:] * (1 if closed else -1) < 0.0)
            until = t1
            if beyond.size:
                i = beyond[0]
                until = brentq(lambda t, f=at: f(t)[0] - self.gap, grid[i], grid[i + 1], xtol=1e-16)
            jacobian = transition(until - t0) @ jacobian  # the force is continuous: no jump
            (x, v), t0 = at(until), until
            if beyond.size:
                x, closed = self.gap, not closed
                closings += closed
        return np.array([x, v]), jacobian, closings


def bilinear_errors(gap, k_b, options):
    """Relative errors of state and Jacobian after one period."""
    m, c, k, force, omega = 2.48, 5.81, 16877.0, 0.2, 2 * np.pi * 19.0
    system = System.from_matrices(
        [[m]], [[k]], {"middle": [1.0]}, damping=[[c]], stops=[Stop.linear("middle", k_b, gap=gap)],
        excitation=[HarmonicForce("middle", force)],
    )  # fmt: skip
    x0 = np.array([-3e-5, 2e-3])
    exact, exact_jacobian, closings = Bilinear(m, c, k, k_b, gap, force).run(
        *x0, 0.0, 2 * np.pi / omega, omega
    )
    unit = 1.0 / system.participation["middle"][0]  # modal displacement of 1 m, sign and all
    end, jacobian, closed = flow_and_jacobian(system, x0 * unit, (0.0, 2 * np.pi), omega, options)
    assert closed[0] == closings > 0
    weights = np.array([1.0, omega])
    state_error = (end / unit - exact) / weights / np.abs(exact[0])
    jacobian_error = (jacobian - exact_jacobian) * weights / weights[:, None]
    return np.abs(state_error).max(), np.abs(jacobian_error).max()


BILINEAR = pytest.mark.parametrize(
    ("gap", "k_b"), [(g, k) for g in (0.0, 1.5e-5, -4e-6) for k in (3e4, 1.33e7)]
)


@BILINEAR
@pytest.mark.parametrize("tail", [1e-4, 1e-6])
def test_bilinear_oscillator_is_its_piecewise_closed_form(gap, k_b, tail):
    state_error, jacobian_error = bilinear_errors(gap, k_b, FlowOptions(tail=tail))
    assert state_error < 1e-11
    assert jacobian_error < 2e-8


def test_monodromy_of_a_bilinear_oscillator_is_exact_too():
    assert bilinear_errors(1.5e-5, 1.33e7, FlowOptions(tail=1e-6))[1] < 1e-11


# --- Hertz ------------------------------------------------------------------------------------


def free_impact(mass: float, stiffness: float, exponent: float, speed: float):
    """Duration and peak penetration of a free impact, from the energy of F = k δ^p.

    T = 2 (δ/v) ∫ dx / sqrt(1 - x^(p+1)) from 0 to 1 (Johnson 1985, eq. 11.24 for p = 3/2).
    """
    peak = ((exponent + 1) * mass * speed**2 / (2 * stiffness)) ** (1 / (exponent + 1))
    q = 1 / (exponent + 1)
    factor = 2 * math.sqrt(math.pi) * math.gamma(1 + q) / math.gamma(0.5 + q)
    return factor * peak / speed, peak


def test_named_stops_take_what_every_stop_takes():
    more = {"gap": 1e-5, "direction": -1, "against": "frame", "dissipation": 2.0}
    assert Stop.linear("m", 1e6, **more) == Stop("m", 1e6, 1.0, **more)
    ball = Stop.hertz("m", radius=0.005, youngs_modulus=2.1e11, **more)
    assert ball == Stop("m", ball.stiffness, 1.5, **more)


def test_free_impact_formula_is_that_of_hertz():
    mass, stiffness, speed = 2.48, 5.17e9, 0.01
    duration, peak = free_impact(mass, stiffness, 1.5, speed)
    assert peak == pytest.approx((5 * mass * speed**2 / (4 * stiffness)) ** 0.4, rel=1e-14)
    assert duration == pytest.approx(2.943 * peak / speed, rel=1e-4)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("speed", [1e-6, 1e-3, 1.0])
def test_free_impact_has_the_duration_and_depth_of_its_energy(speed, exponent):
    """An almost free mass hits at phase zero, is deepest at T/2, off at T, and flies back."""
    mass, stiffness = 2.48, 5.17e9
    duration, peak = free_impact(mass, stiffness, exponent, speed)
    natural_hz = 1e-3
    system = System.from_modal(
        [natural_hz], {"m": [1 / math.sqrt(mass)]}, modal_damping=1e-3,
        stops=[Stop("m", stiffness=stiffness, exponent=exponent)],
    )  # fmt: skip
    flow = FlowMap(system)
    omega = 2 * np.pi / duration  # the contact fills one period of an excitation that is absent
    start = flow.to_state(np.array([0.0, speed * math.sqrt(mass)]))
    phases = np.array([0.0, np.pi, 2 * np.pi, 3 * np.pi])
    found = flow.shoot(start[None], phases, omega, chained=True)
    states = zip(found.ends, phases[1:], strict=True)
    x = np.array([flow.to_modal(end) for end, phase in states]) / math.sqrt(mass)
    slow = 2 * np.pi * natural_hz * duration  # what the weak spring and damper change, relative
    tolerance = 10 * (slow**2 + 2e-3 * slow) + 1e-9
    scale = np.array([peak, speed])
    np.testing.assert_allclose(x[0] / scale, [1.0, 0.0], rtol=0, atol=tolerance)
    np.testing.assert_allclose(x[1] / scale, [0.0, -1.0], rtol=0, atol=tolerance)
    assert x[2, 0] == pytest.approx(-0.5 * speed * duration, rel=tolerance)
    assert found.closings.tolist() == [1]


def test_small_motion_on_a_preloaded_stop_has_the_tangent_stiffness():
    """Near rest at depth δ₀ the stop is a spring 1.5 k δ₀^½: the multipliers tell it."""
    m, k, c, k_s = 2.48, 16877.0, 5.81, 5.17e9
    depth = brentq(lambda d: k * (d - 1e-5) + k_s * d**1.5, 0.0, 1e-5, xtol=1e-20)
    system = System.from_matrices(
        [[m]], [[k]], {"y": [1.0]}, damping=[[c]], stops=[Stop("y", stiffness=k_s, gap=-1e-5)]
    )
    omega = 2 * np.pi * 40.0
    x0 = np.array([depth - 1e-5, 0.0]) * math.sqrt(m) * np.sign(system.participation["y"][0])
    end, jacobian, closings = flow_and_jacobian(system, x0, (0.0, 2 * np.pi), omega)
    np.testing.assert_allclose(end, x0, rtol=0, atol=1e-11 * abs(x0[0]) * 1e3)
    tangent = k + 1.5 * k_s * math.sqrt(depth)
    exponent = np.roots([m, c, tangent])
    exact = np.exp(exponent * 2 * np.pi / omega)
    found = np.linalg.eigvals(jacobian)
    assert abs(found.real[0] - exact.real[0]) < 1e-9
    assert abs(abs(found[0]) - abs(exact[0])) < 1e-9
    assert closings.tolist() == [0]


# --- stops that close or open shortly after one another ----------------------------------------


def jacobian_by_differences(flow, start, phases, omega):
    """Central differences of order eight of the end state, (2, 2)."""
    shares = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
    step = 1e-3 * np.abs(start).max()

    def end(offset):
        return flow.shoot((start + offset)[None], phases, omega, sensitivities=False).ends[0]

    columns = [
        sum(c * (end(k * step * e) - end(-k * step * e)) for k, c in shares) / step
        for e in np.eye(2)
    ]
    return np.transpose(columns)


@pytest.mark.parametrize("exponent", [1.5, 2.5, 1.2])
@pytest.mark.parametrize("apart", [1e-7, 1e-5, 1e-4, 1e-3, 1e-2])
def test_stops_that_close_shortly_after_one_another_keep_the_jacobian(exponent, apart):
    """The slope of the first one is singular a little before the panel of both begins."""
    stiffness = 3e8 * 1e-4 ** (1.5 - exponent)
    stops = [
        Stop("a", stiffness, exponent, gap=1e-4),
        Stop("a", 2.0 * stiffness, exponent, gap=1e-4 * (1.0 + apart)),
    ]
    system = System.from_modal(
        [60.0], {"a": [1.0]}, modal_damping=0.02, stops=stops, excitation=[HarmonicForce("a", 20.0)]
    )
    flow, fine = FlowMap(system), FlowMap(system, FlowOptions(rtol=1e-13))
    start, phases, omega = flow.to_state([0.0, 0.1]), np.array([0.0, 1.0]), 50.0 * math.pi
    wanted = jacobian_by_differences(fine, start, phases, omega)
    found = flow.shoot(start[None], phases, omega).jacobians[0]
    assert np.abs(found - wanted).max() < 1e-9 * np.abs(wanted).max()


@pytest.mark.parametrize("depth", [1e-13, 1e-10, 1e-7])
def test_segment_that_starts_just_after_a_closing_keeps_the_jacobian(depth):
    system = System.from_modal(
        [60.0], {"a": [1.0]}, modal_damping=0.02, excitation=[HarmonicForce("a", 20.0)],
        stops=[Stop("a", 10.0**13.5, 2.5, gap=1e-4)],
    )  # fmt: skip
    coarse, fine = FlowMap(system), FlowMap(system, FlowOptions(rtol=1e-13))
    start, phases = coarse.to_state([1e-4 + depth, 0.1])[None], np.array([0.3, 1.3])
    found, wanted = (f.shoot(start, phases, 50.0 * math.pi).jacobians[0] for f in (coarse, fine))
    assert np.abs(found - wanted).max() < 2e-9 * np.abs(wanted).max()


def test_linear_stop_is_as_exact_beside_one_of_another_law():
    """The map for powers that are not whole has a node within rounding of the switch."""
    linear, other = Stop("a", 1e6, 1.0, gap=1e-4), Stop("a", 1e6, 1.2, gap=1.0)
    jacobians = []
    for stops in ([linear], [linear, other]):
        system = System.from_modal([60.0], {"a": [1.0]}, modal_damping=0.02, stops=stops)
        flow = FlowMap(system)
        found = flow.shoot(flow.to_state([[0.0, 0.1]]), np.array([0.0, 1.0]), 50.0 * math.pi)
        jacobians.append(found.jacobians[0])
    assert np.abs(jacobians[1] - jacobians[0]).max() < 1e-10 * np.abs(jacobians[0]).max()


def held_between_stops() -> System:
    """Pressed into two stiff Hertz stops, which swing eight times in half a period of 5 Hz."""
    return System.from_modal(
        [11.54], {"a": [-0.4131], "b": [-2.4415]}, modal_damping=0.0052,
        stops=[
            Stop("a", 1.578e7, gap=-1.295e-4), Stop("b", 6.851e5, direction=-1),
        ],
        excitation=[HarmonicForce("b", 2.205)],
    )  # fmt: skip


@pytest.mark.parametrize("hz", [4.8, 5.03])
def test_slow_motion_held_between_stops_against_runge_kutta(hz):
    """The forces are smooth over a panel that is far too long for what a change of them does."""
    system = held_between_stops()
    phases = (0.0, 2.0 * np.pi)
    start = solve_orbit(system, hz).states(np.zeros(1))[0]
    assert_agrees(system, start, phases, 2.0 * np.pi * hz, closings=[0, 0])
