"""Lyapunov exponents against closed forms, multipliers, published values and another method."""

from __future__ import annotations

import numpy as np
import pytest
from independent import Motion as Independent
from problems import driven, make_one_dof
from scipy.optimize import brentq

from nldyn import (
    ConstantForce,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    lyapunov_exponents,
    simulate,
    solve_orbit,
)
from nldyn.longterm.lyapunov import spectrum_from, standard_errors


def test_exponents_of_linear_modes_are_their_decays():
    system = System.from_modal(
        [10.0, 27.0], {"tip": [1.0, 0.5]}, modal_damping=[0.01, 0.05],
        excitation=[HarmonicForce("tip", 1.0)],
    )  # fmt: skip
    found = lyapunov_exponents(system, 13.0, transient=0, periods=400)
    decays = -np.repeat(2.0 * np.pi * np.array([0.1, 1.35]), 2)
    np.testing.assert_allclose(found.exponents, decays, atol=0.01)
    np.testing.assert_allclose(found.exponents.sum(), decays.sum(), rtol=1e-11)
    assert np.all(np.abs(found.exponents - decays) < 4.0 * found.errors + 1e-9)
    assert found.decaying and not found.chaotic and found.dimension == 0.0


def test_strongly_damped_direction_keeps_its_exponent():
    system = System.from_modal([10.0, 80.0], {"tip": [1.0, 1.0]}, modal_damping=[0.01, 30.0])
    found = lyapunov_exponents(system, 5.0, transient=0, periods=64)
    omega = 160.0 * np.pi
    fast = omega * (30.0 + np.sqrt(899.0))
    assert found.exponents[-1] == pytest.approx(-fast, rel=1e-9)
    assert found.sum_error < 1e-9


def test_undamped_exponents_are_zero():
    system = System.from_modal([10.0], {"tip": [1.0]}, excitation=[HarmonicForce("tip", 1.0)])
    found = lyapunov_exponents(system, 13.0, periods=2000)
    assert np.all(np.abs(found.exponents) < 0.01)
    assert not found.chaotic and not found.decaying


@pytest.mark.parametrize("hz", [25.3, 50.0])
def test_exponents_of_a_periodic_orbit_are_those_of_its_multipliers(hz):
    system = make_one_dof()
    found = lyapunov_exponents(system, hz, transient=500, periods=1000)
    orbit = solve_orbit(system, hz, period=1 if hz < 30.0 else 2)
    expected = orbit.log_moduli / orbit.duration
    assert orbit.stable
    assert np.all(np.abs(found.exponents - expected) < 4.0 * found.errors + 1e-3)
    assert abs(found.largest - expected[0]) < 0.05 * abs(expected[0])
    assert found.decaying


def test_sum_is_the_divergence_also_with_a_lossy_stop():
    stop = Stop("middle", 5.17e9, dissipation=20.0)
    found = lyapunov_exponents(make_one_dof(stops=[stop]), 33.0, periods=200)
    plain = -2.0 * 0.0142 * np.sqrt(16877.0 / 2.48)
    assert found.divergence < plain - 0.01
    assert found.sum_error < 1e-7


def test_a_body_that_comes_to_rest_forgets_what_was_before():
    """A shaken ball rests on its table now and then: -∞ twice, beside -c/2 of an oscillator."""
    table = RigidStop("ball", 0.5, direction=-1)
    loads = [ConstantForce("ball", -9.81), HarmonicForce("ball", 19.62), HarmonicForce("x", 1.0)]
    system = System.from_matrices(
        np.eye(2), np.diag([0.0, 1.0]), {"ball": [1.0, 0.0], "x": [0.0, 1.0]},
        damping=np.diag([0.0, 0.4]), stops=[table], excitation=loads,
    )  # fmt: skip
    found = lyapunov_exponents(system, 1.0, transient=20, periods=300)
    assert found.exponents[:2] == pytest.approx([-0.2, -0.2], abs=1e-3)
    assert list(found.exponents[2:]) == [-np.inf, -np.inf] and not found.errors[2:].any()
    assert found.divergence == -np.inf and found.sum_error == 0.0
    assert found.decaying and found.dimension == 0.0


def ueda() -> System:
    """Duffing's equation x'' + 0.05 x' + x³ = 7.5 cos t [Ueda 1979], as two preloaded stops."""
    reach = 5.0  # larger than the motion, so that both stay closed

    def half_cubic(depth: float, speed: float) -> tuple[float, float, float]:
        x = depth - reach
        return 0.5 * (x**3 + reach**3), 1.5 * x * x, 0.0

    stops = [
        Stop("x", 1.5 * reach**2, 1.0, gap=-reach, direction=side, law=half_cubic)
        for side in (1, -1)
    ]
    return System.from_matrices(
        [[1.0]], [[0.0]], {"x": [1.0]}, damping=[[0.05]], stops=stops,
        excitation=[HarmonicForce("x", 7.5)],
    )  # fmt: skip


@pytest.mark.slow
def test_duffing_oscillator_has_the_published_exponents():
    flow = FlowMap(ueda(), FlowOptions(1e-6))
    found = lyapunov_exponents(flow, 0.5 / np.pi, start=[2.5, 0.0], transient=50, periods=1000)
    published = np.array([0.1034, -0.1534])  # Sprott (2003), Chaos and Time-Series Analysis
    assert found.chaotic
    assert np.all(np.abs(found.exponents - published) < 3.0 * found.errors)
    assert np.all(found.errors < 0.01)
    assert found.dimension == pytest.approx(1.0 + 0.1034 / 0.1534, abs=0.06)


# J. C. Sprott (2001), Simple Driven Conservative Chaotic Flows: exponent p, ω, largest exponent
PUBLISHED = [(2.0, 1.61, 0.051), (3.0, 1.88, 0.097), (4.0, 2.00, 0.139)]


@pytest.mark.parametrize(
    ("power", "omega", "published", "motions", "periods"),
    [(*PUBLISHED[2], 1, 4000)]
    + [pytest.param(*case, 6, 20000, marks=pytest.mark.slow) for case in PUBLISHED],
)
def test_mass_between_two_stops_has_the_published_exponents(
    power, omega, published, motions, periods
):
    """The published value is that of a single motion, and single motions scatter."""
    hz = np.full(motions, omega / (2.0 * np.pi))
    starts = 1e-3 * np.arange(motions)[:, None] * [1.0, 0.0]
    found = lyapunov_exponents(driven(power), hz, start=starts, transient=0, periods=periods)
    assert all(one.chaotic and one.divergence == 0.0 and one.sum_error < 1e-12 for one in found)
    largest = np.array([one.largest for one in found])
    scatter = largest.std(ddof=1) if motions > 1 else found[0].largest_error
    assert abs(largest.mean() - published) < 3.0 * scatter
    assert scatter < 0.25 * published


def test_growth_over_a_chaotic_motion_of_a_bilinear_oscillator_agrees_with_another_method():
    stop = Stop.linear("middle", 50.0 * 16877.0)
    system = make_one_dof(stops=[stop])
    hz = 36.0
    flow = FlowMap(system)
    omega = 2.0 * np.pi * hz
    phases = np.linspace(0.0, 600.0 * np.pi, 301)
    start = flow.shoot(np.zeros((1, 2)), phases, omega, sensitivities=False, chained=True).ends[-1]
    periods = 32  # as many as an error needs
    found = spectrum_from(flow, start, omega, periods)
    other = Independent(system)
    x = flow.to_modal(start)
    basis = np.eye(2)
    logs = []
    transform = system.linear.left
    for k in range(periods + 3):  # a tenth of the periods turns the basis first
        x, tangent, _ = other.run(x, (0.0, 2.0 * np.pi), omega)
        jacobian = transform @ tangent @ np.linalg.inv(transform)
        basis, triangle = np.linalg.qr(jacobian @ basis)
        if k >= 3:
            logs.append(np.log(np.abs(np.diag(triangle))))
    expected = np.mean(logs, axis=0) * hz
    np.testing.assert_allclose(found.exponents, expected, atol=1e-3 * np.abs(expected).max())


class PiecewiseBilinear:
    """x'' + c x' + k x + s max(x - g, 0) = f cos(ωt) by its closed forms on either side of g.

    Of a motion no more is used than where it goes: neither Jacobians nor the flow map.
    """

    SAMPLES = 128  # in a period, between which a crossing of g is looked for

    def __init__(self, c: float, k: float, s: float, g: float, f: float, omega: float) -> None:
        self.c, self.g, self.omega = c, g, omega
        self.period = 2.0 * np.pi / omega
        self.sides = []
        for stiffness, rest in ((k, 0.0), (k + s, s * g / (k + s))):
            response = f / (stiffness - omega**2 + 1j * c * omega)
            own = np.sqrt(stiffness - 0.25 * c**2)
            self.sides.append((stiffness, rest, response, own))

    def ahead(self, side: int, t: float, x: float, v: float, after):
        """Displacement and speed some time later, on one side."""
        k, rest, response, own = self.sides[side]
        before = response * np.exp(1j * self.omega * t)
        a = x - rest - before.real
        b = v - (1j * self.omega * before).real
        turn = response * np.exp(1j * self.omega * (t + after))
        decay = np.exp(-0.5 * self.c * after)
        cos, sin = np.cos(own * after), np.sin(own * after) / own
        return (
            rest + turn.real + decay * (a * (cos + 0.5 * self.c * sin) + b * sin),
            (1j * self.omega * turn).real + decay * (b * (cos - 0.5 * self.c * sin) - k * a * sin),
        )

    def after_a_period(self, x: float, v: float) -> tuple[float, float]:
        """The stroboscopic map."""
        t = 0.0
        side = int(x > self.g or (x == self.g and v > 0.0))
        while True:
            left = self.period - t
            times = np.linspace(0.0, left, self.SAMPLES + 1)[1:]
            off = (self.ahead(side, t, x, v, times)[0] - self.g) * (1.0 if side else -1.0)
            out = np.flatnonzero(off < 0.0)
            if not out.size:
                return self.ahead(side, t, x, v, left)
            begin = times[out[0] - 1] if out[0] else 1e-9 * self.period
            crossing = brentq(
                lambda after, *at: self.ahead(*at, after)[0] - self.g,
                begin, times[out[0]], (side, t, x, v), xtol=1e-15, rtol=1e-14,
            )  # fmt: skip
            x, v = self.g, self.ahead(side, t, x, v, crossing)[1]
            t += crossing
            side = 1 - side


def test_exponent_of_a_bilinear_oscillator_is_the_rate_at_which_two_exact_motions_part():
    """No Jacobian: two neighbours by closed forms, set near each other again after each period."""
    mass, ratio, hz = 2.48, 0.0142, 36.0
    stiffness = 16877.0
    system = make_one_dof(stops=[Stop.linear("middle", 50.0 * stiffness)])
    omega = 2.0 * np.pi * hz
    own = np.sqrt(stiffness / mass)
    exact = PiecewiseBilinear(
        2.0 * ratio * own, own**2, 50.0 * own**2, 0.0, 4.92e-6 * omega**2 / mass, omega
    )
    motion = simulate(system, hz, 3, transient=300)
    states = motion.strobe / np.sqrt(mass)  # the modal coordinate is √m x
    near = [np.array(exact.after_a_period(*state)) for state in states[:-1]]
    np.testing.assert_allclose(near, states[1:], rtol=1e-6, atol=1e-7 * np.abs(states).max())
    size = np.abs(states).max(axis=0)
    here, apart = states[0], 1e-7 * np.array([0.6, 0.8])
    logs = []
    for _ in range(1500):
        beside = np.array(exact.after_a_period(*(here + apart * size)))
        here = np.array(exact.after_a_period(*here))
        gone = (beside - here) / size
        logs.append(np.log(np.linalg.norm(gone) / 1e-7))
        apart = 1e-7 * gone / np.linalg.norm(gone)
    rates = hz * np.array(logs[30:])[:, None]
    error = standard_errors(rates)[0]
    found = lyapunov_exponents(system, hz, periods=4000)
    assert found.chaotic
    assert abs(found.largest - rates.mean()) < 3.0 * np.hypot(found.largest_error, error)
    assert max(found.largest_error, error) < 0.1 * found.largest
    assert found.exponents.sum() == pytest.approx(-2.0 * ratio * own, rel=1e-9)


def test_error_of_a_mean_is_right_for_correlated_samples():
    rng = np.random.default_rng(3)
    n, rho = 2**14, 0.9
    noise = rng.normal(size=n)
    series = np.empty(n)
    series[0] = noise[0]
    for k in range(1, n):
        series[k] = rho * series[k - 1] + noise[k]
    exact = 1.0 / (1.0 - rho) / np.sqrt(n)
    assert standard_errors(series[:, None])[0] == pytest.approx(exact, rel=0.4)


def test_error_of_a_bounded_oscillation_falls_with_its_length():
    steps = np.arange(2**14)
    wave = np.cos(0.7 * steps)[:, None]
    assert standard_errors(wave)[0] < 0.5 * wave.std() / np.sqrt(steps.size)


def test_exponent_of_the_logistic_map_lies_within_its_error():
    x, logs = 0.3, []
    for _ in range(4096):
        logs.append(np.log(abs(4.0 - 8.0 * x)))
        x = 4.0 * x * (1.0 - x)
    samples = np.array(logs)[:, None]
    assert abs(samples.mean() - np.log(2.0)) < 3.0 * standard_errors(samples)[0]


def test_two_runs_differ_by_no_more_than_their_errors_say():
    system = System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142,
        stops=[Stop("middle", 5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip
    one = lyapunov_exponents(system, 36.0, transient=300, periods=1000)
    two = lyapunov_exponents(system, 36.0, transient=1500, periods=1000)
    assert one.chaotic and two.chaotic
    assert abs(one.largest - two.largest) < 4.0 * np.hypot(one.largest_error, two.largest_error)


def test_bad_input_is_one_sentence():
    with pytest.raises(SystemModelError, match="periods must be a whole number from 32 to 1000"):
        lyapunov_exponents(make_one_dof(), 30.0, periods=10)
    with pytest.raises(SystemModelError, match="an error needs 32 samples, got 3"):
        standard_errors(np.zeros((3, 1)))
