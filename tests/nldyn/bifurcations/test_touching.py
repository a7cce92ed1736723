"""Where contacts begin: none is passed over, and a grazing one changes nothing suddenly."""

from __future__ import annotations

import ctypes
import itertools
import math
import sys

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from independent import Motion, state_map
from problems import make_one_dof
from scipy.optimize import brentq
from scipy.special import beta

from nldyn import Damper, FlowMap, HarmonicForce, Stop, System, Unbalance, solve_orbit

GAP = 1e-3
NATURAL = 2 * np.pi * 20.0
OMEGA = 2 * np.pi * 10.0


def rising_to(speed: float) -> np.ndarray:
    """Unit mass on a spring, a sixth of a period before it would pass GAP at this speed."""
    amplitude = math.hypot(GAP, speed / NATURAL)
    top = math.atan2(speed / NATURAL, GAP) + np.pi / 3
    return amplitude * np.array([math.cos(top), NATURAL * math.sin(top)])


def through_contact(state, stiffness, exponent):
    """End state and Jacobian, in displacement and velocity / Ω, after 0.35 natural periods."""
    system = System.from_modal(
        [20.0], {"m": [1.0]}, stops=[Stop("m", stiffness=stiffness, exponent=exponent, gap=GAP)]
    )
    flow = FlowMap(system)
    phases = np.array([0.0, 0.35 * np.pi])
    found = flow.shoot(flow.to_state(state)[None], phases, OMEGA)
    L = state_map(system)
    jacobian = np.linalg.solve(L, found.jacobians[0] @ L)
    weights = np.array([1.0, NATURAL])
    end = flow.to_modal(found.ends[0]) / weights
    return system, end, jacobian * weights / weights[:, None]


def rotation(angle: float) -> np.ndarray:
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


def along_parabola(speed, stiffness, p):
    """Change of velocity / Ω by the force along δ = vτ - aτ²/2, and its derivative."""
    a = NATURAL**2 * GAP
    T = 2 * speed / a
    impulse = stiffness * (a / 2) ** p * T ** (2 * p + 1) * beta(p + 1, p + 1)
    kick = stiffness * p * (a / 2) ** (p - 1) * T ** (2 * p - 1) * beta(p, p)
    return impulse / NATURAL, kick / NATURAL


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("speed", [10.0**-k for k in range(5, 13)])
def test_grazing_contact_gives_the_impulse_of_its_parabola(speed, exponent):
    """To first order a slow touch adds the impulse of the force along the undisturbed parabola.

    It goes with v^(2p+1) and its derivative with v^(2p-1): both are continuous at grazing.
    """
    stiffness = 1e8 * (1e-8) ** (1.5 - exponent)
    _, end, jacobian = through_contact(rising_to(speed), stiffness, exponent)
    impulse, kick = along_parabola(speed, stiffness, exponent)
    unseen = along_parabola(6e-8, stiffness, exponent)[1]  # as deep as 1e-13 of the motion
    assert kick < 0.02
    after = rotation(0.7 * np.pi - np.pi / 3 - speed / (NATURAL * GAP))
    before = rotation(np.pi / 3 + speed / (NATURAL * GAP))
    flight = rotation(0.7 * np.pi)
    state = flight @ (rising_to(speed) / [1.0, NATURAL]) + after @ [0.0, -impulse]
    change = after @ np.array([[0.0, 0.0], [-kick, 0.0]]) @ before
    assert np.abs(end - state).max() < 0.05 * impulse + 1e-12 * GAP
    assert np.abs(jacobian - flight - change).max() < 0.05 * kick + 1.1 * unseen + 1e-11


@pytest.mark.parametrize("speed", [1e-2, 1e-3, 3e-4])
def test_slow_contact_against_runge_kutta(speed):
    state = rising_to(speed)
    system, end, jacobian = through_contact(state, 1e9, 1.5)
    exact, exact_jacobian, _ = Motion(system).run(state, (0.0, 0.35 * np.pi), OMEGA, max_step=1e-3)
    weights = np.array([1.0, NATURAL])
    assert np.abs(end - exact / weights).max() < 1e-9 * GAP
    error = jacobian - exact_jacobian * weights / weights[:, None]
    assert np.abs(error).max() < 1e-8


def test_jacobian_is_continuous_from_a_miss_to_a_touch():
    """Through grazing the Jacobian leaves that of the flight without a jump."""
    flight = through_contact(rising_to(0.0) * (1 - 1e-6), 1e9, 1.5)[2]
    np.testing.assert_allclose(flight, rotation(0.7 * np.pi), rtol=0, atol=1e-12)
    speeds = np.geomspace(1e-12, 3e-5, 60)
    off = [np.abs(through_contact(rising_to(v), 1e9, 1.5)[2] - flight).max() for v in speeds]
    limit = np.array([along_parabola(v, 1e9, 1.5)[1] for v in speeds])
    assert np.all(off < 1.2 * limit + 1e-11)


class FreeMotion:
    """Sum of damped oscillations and a harmonic: y(t) in closed form, at many times at once."""

    def __init__(self, frequencies, ratios, shape, state, force, omega):
        n = len(frequencies)
        self.state = np.array(state)
        natural = 2 * np.pi * np.array(frequencies)
        damping = 2 * np.array(ratios) * natural
        self.system_parts = (frequencies, ratios, shape, force)
        self.omega = omega
        decay = -damping / 2
        turn = natural * np.sqrt(1 - np.array(ratios) ** 2)
        steady = force * np.array(shape) / (natural**2 - omega**2 + 1j * damping * omega)
        q0 = self.state[:n] - steady.real
        v0 = self.state[n:] - (1j * omega * steady).real
        self.rates = decay + 1j * turn
        self.amplitudes = np.array(shape) * (q0 - 1j * (v0 - decay * q0) / turn)
        self.steady = np.sum(np.array(shape) * steady)
        self.total = np.abs(self.amplitudes).sum() + abs(self.steady)
        # |y''| stays below this
        self.bend = np.abs(self.amplitudes) @ np.abs(self.rates) ** 2
        self.bend += abs(self.steady) * omega**2

    def __call__(self, t):
        t = np.asarray(t)[..., None]
        free = (self.amplitudes * np.exp(self.rates * t)).real.sum(axis=-1)
        return free + (self.steady * np.exp(1j * self.omega * t[..., 0])).real

    def system(self, gap):
        frequencies, ratios, shape, force = self.system_parts
        return System.from_modal(
            frequencies, {"m": shape}, modal_damping=ratios, stops=[Stop("m", 1e6, gap=gap)],
            excitation=[HarmonicForce("m", force)],
        )  # fmt: skip


@st.composite
def motions(draw):
    n = draw(st.integers(1, 4))
    number = st.floats(0.05, 1.0)
    signed = st.builds(lambda x, s: x * s, number, st.sampled_from([1.0, -1.0]))

    def numbers(strategy):
        return draw(st.lists(strategy, min_size=n, max_size=n))

    frequencies = [10.0 ** (1 + 1.7 * x) for x in numbers(number)]
    assume(all(abs(a / b - 1) > 1e-3 for a, b in itertools.combinations(frequencies, 2)))
    ratios = [0.1 * x**2 for x in numbers(number)]
    velocity = [v * 2 * np.pi * f for v, f in zip(numbers(signed), frequencies, strict=True)]
    omega = 2 * np.pi * draw(st.floats(15.0, 60.0))
    force = draw(st.sampled_from([0.0, 1.0])) * omega**2
    return FreeMotion(
        frequencies, ratios, numbers(signed), numbers(signed) + velocity, force, omega
    ), draw(st.sampled_from([1e-1, 1e-3, 1e-5, 1e-7, 1e-9]))


@given(motions())
def test_no_contact_is_passed_over(drawn):
    """The stop stands just below the highest point of a dense sampling of one period.

    The sampling brackets a contact: before it the flow map must not have closed, after it it must.
    """
    motion, share = drawn
    duration = 2 * np.pi / motion.omega
    t = np.linspace(0.0, duration, 20001)
    y = motion(t)
    top = int(np.argmax(y))
    gap = y[top] - share * motion.total
    assume(top > 0 and y[0] < gap)
    first = int(np.argmax(y > gap))
    crossing = brentq(lambda x: float(motion(x)) - gap, t[first - 1], t[first], xtol=1e-17)
    system = motion.system(gap)
    flow = FlowMap(system)
    start = flow.to_state(motion.state)

    def closings(until: float) -> int:
        phases = np.array([0.0, motion.omega * until])
        found = flow.shoot(start[None], phases, motion.omega, sensitivities=False)
        assert found.failure == ""
        return int(found.closings[0])

    assert closings(crossing + 1e-7 * duration) >= 1
    sag = motion.bend * (t[1] - t[0]) ** 2 / 8  # what the sampling may not see
    if y[:first].max() + sag < gap:
        assert closings(crossing * (1 - 1e-9)) == 0


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.5])
def test_hundreds_of_whole_turns_before_the_start_change_nothing(exponent):
    system = make_one_dof(stops=[Stop("middle", 1e6, exponent, gap=1e-5)])
    flow = FlowMap(system)
    omega = 2 * np.pi * 14.0
    start = 3.0 * flow.system.steady(omega)[None]
    period = 2 * np.pi * np.array([0.0, 1.0])
    first = flow.shoot(start, period, omega)
    later = flow.shoot(start, period + 2 * np.pi * 400, omega)
    assert not first.failure and not later.failure
    assert later.ends == pytest.approx(first.ends, rel=1e-9)  # 1e-13 rad of phase
    assert later.jacobians == pytest.approx(first.jacobians, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("force", [[], [Unbalance("middle", 0.0)]])
def test_a_point_that_rests_at_its_stop_never_hits_it(force):
    orbit = solve_orbit(make_one_dof(excitation=force), 20.0)
    assert orbit.impacts == 0 and orbit.max_abs_displacement == 0.0


def fill_freed_memory_with_nan() -> None:
    """Leave NaN in small freed blocks, from which the next ones are taken."""
    libc = ctypes.CDLL(None)
    libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    libc.free.argtypes = [ctypes.c_void_p]
    for size in range(16, 520, 8):
        blocks = [libc.malloc(size) for _ in range(12)]
        for block in blocks:
            ctypes.memmove(block, np.full(size // 8, np.nan).tobytes(), size)
        for block in blocks:
            libc.free(block)


@pytest.mark.skipif(sys.platform != "linux", reason="takes memory from the C library")
def test_a_contact_that_begins_at_the_start_does_not_depend_on_what_memory_holds():
    """Its first panel has no length, and an end that nobody has computed."""
    flow = FlowMap(make_one_dof())
    state, phases = (
        np.array([[0.0, -2.9250430670353065e-06]]),
        [262.8990431862277, 263.839970938368],
    )
    for _ in range(5):
        fill_freed_memory_with_nan()
        found = flow.shoot(state, np.array(phases), 2 * np.pi * 36.0, sensitivities=False)
        assert not found.failure


@pytest.mark.parametrize("fast_hz", [1e5, 1e7, 1e9])
def test_a_mode_that_rests_does_not_make_extremes_dear(fast_hz):
    """Two extremes in a period, of the closed form's amplitude, whatever else might vibrate."""
    force = HarmonicForce("m", 1.0)
    system = System.from_modal(
        [20.0, fast_hz], {"m": [1.0, 1.0]}, modal_damping=0.02, excitation=[force]
    )
    orbit = solve_orbit(system, 15.0)
    omega, natural = 2 * np.pi * 15.0, 2 * np.pi * np.array([20.0, fast_hz])
    amplitude = abs((1.0 / (natural**2 - omega**2 + 0.04j * natural * omega)).sum())
    assert orbit.max_abs_displacement == pytest.approx(amplitude, rel=1e-9)
    assert orbit.observed_extremes.values.size == 2


@pytest.mark.parametrize("apart", [0.0, 1e-15, 1e-12])
def test_modes_that_cancel_at_a_stop_without_gap_leave_it_alone(apart):
    """The displacement there is rounding for ever, beside modes that move."""
    modal = [20.0, 20.0 * (1.0 + apart)], {"m": [1.0, 1.0]}
    flow = FlowMap(System.from_modal(*modal, stops=[Stop("m", stiffness=1e9)]))
    free = FlowMap(System.from_modal(*modal))
    state = flow.to_state(np.array([1e-3, -1e-3, 0.05, -0.05]))[None]
    phases = np.array([0.0, 2.0 * np.pi])
    found = flow.shoot(state, phases, OMEGA, sensitivities=False)
    assert not found.failure
    assert found.ends == pytest.approx(free.shoot(state, phases, OMEGA).ends, abs=1e-12)


@pytest.mark.slow
def test_the_search_for_a_contact_ends_beside_a_decay_in_a_nanosecond():
    """Its shortest step would be lost in the rounding of the time."""
    modal = [20.0, 90.0], {"b": [0.5, 1.0]}
    dampers = [Damper("b", 1e9)]
    free = FlowMap(System.from_modal(*modal, dampers=dampers))
    stop = Stop.linear("b", 1e3)
    flow = FlowMap(System.from_modal(*modal, dampers=dampers, stops=[stop]))
    rng = np.random.default_rng(1)
    at_b, beside_b = np.array([0.5, 1.0]), np.array([1.0, -0.5])
    phases = np.linspace(0.0, 0.7, 50)
    touched = 0
    for _ in range(30):
        q = 1e-3 * rng.uniform(-1, 1) * beside_b - 1e-10 * rng.uniform(0, 1) * at_b
        state = np.append(q, rng.uniform(-0.1, 0.1) * beside_b)
        found = flow.shoot(flow.to_state(state)[None], phases[[0, -1]], OMEGA, sensitivities=False)
        start = free.to_state(state)[None]
        ends = free.shoot(start, phases, OMEGA, sensitivities=False, chained=True).ends
        touches = max(at_b @ free.to_modal(end)[:2] for end in ends) > 0.0
        assert found.closings[0] == touches
        touched += touches
    assert 5 < touched < 25


def test_a_linear_stop_does_not_end_a_long_simulation():
    """Its force starts with a jump of the slope, so that the instant is needed to rounding."""
    flow = FlowMap(make_one_dof(stops=[Stop.linear("middle", 1e6)]))
    phases = 2 * np.pi * np.arange(181.0)
    found = flow.shoot(
        np.zeros((1, 2)), phases, 2 * np.pi * 14.0, sensitivities=False, chained=True
    )
    assert not found.failure
