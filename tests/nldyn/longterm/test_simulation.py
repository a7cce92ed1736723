"""Simulated motions, sweeps and lists of impacts against closed forms and another integrator."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from independent import Motion as Independent
from independent import contact
from problems import driven, make_one_dof
from scipy.integrate import solve_ivp

from nldyn import (
    FlowMap,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    classify_attractor,
    find_orbits,
    impacts,
    simulate,
    solve_orbit,
    sweep,
)
from nldyn.flow.flow_map import BUNCH
from nldyn.longterm.simulation import PIECE, chirp_steps, transient_end


def ball(speed: float = -0.2, stop: Stop | None = None) -> tuple[System, list[float]]:
    """A free mass of 2 kg that flies from -10 mm towards a stop at zero."""
    stop = stop or Stop("x", 1e9)
    system = System.from_matrices([[2.0]], [[0.0]], {"x": [1.0]}, stops=[stop])
    root = np.sqrt(2.0)  # modal coordinates are mass-normalised
    return system, [-0.01 * root, -speed * root]


def test_simulation_agrees_with_adaptive_integration():
    system = make_one_dof()
    start = np.array([-1e-4, 1e-2])
    motion = simulate(system, 26.0, periods=6, start=start)
    x, *_ = Independent(system).run(start, (0.0, 12.0 * np.pi), 2.0 * np.pi * 26.0, tangent=False)
    assert len(impacts(motion)) >= 4
    scale = np.abs(motion.strobe).max(axis=0)
    assert np.all(np.abs(motion.end - x) < 1e-8 * scale)


@pytest.mark.parametrize("start", [(-0.3, 1.0), (0.3, -1.0), (-1.2, 1.8), (0.0, 0.0)])
def test_mass_between_two_stops_leaves_one_while_the_force_vanishes(start):
    """At phase zero nothing but the stop accelerates the mass: the flight has no deceleration."""
    motion = simulate(driven(3.0), 0.3, periods=4, start=np.array(start))
    found = solve_ivp(
        lambda t, x: [x[1], np.sin(0.6 * np.pi * t) - x[0] ** 3], (0.0, 4.0 / 0.3), start,
        rtol=1e-12, atol=1e-13, method="DOP853",
    )  # fmt: skip
    np.testing.assert_allclose(motion.end, found.y[:, -1], atol=2e-8)


def test_one_impact_of_a_free_mass_has_the_closed_form_of_hertz():
    system, start = ball()
    motion = simulate(system, 10.0, periods=1, start=start)
    found = impacts(motion)
    assert len(found) == 1
    depth = (1.25 * 2.0 * 0.2**2 / 1e9) ** 0.4  # m v²/2 = k δ^2.5/2.5
    assert found.time[0] == pytest.approx(0.05, rel=1e-12)
    assert found.speed[0] == pytest.approx(0.2, rel=1e-12)
    assert found.rebound_speed[0] == pytest.approx(0.2, rel=1e-9)
    assert found.impulse[0] == pytest.approx(2.0 * 2.0 * 0.2, rel=1e-9)
    assert found.duration[0] == pytest.approx(2.9432750 * depth / 0.2, rel=1e-7)  # Johnson 11.24
    assert found.penetration[0] == pytest.approx(depth, rel=2e-5)
    assert found.peak_force[0] == pytest.approx(1e9 * depth**1.5, rel=2e-5)
    assert found.work[0] == pytest.approx(0.04, rel=2e-4)
    assert abs(found.loss[0]) < 1e-4 * found.work[0]


def test_loss_of_a_dissipative_impact_is_what_the_mass_loses():
    stop = Stop("x", 1e9, dissipation=0.5)
    system, start = ball(stop=stop)
    found = impacts(simulate(system, 10.0, periods=1, start=start))
    lost = found.speed[0] ** 2 - found.rebound_speed[0] ** 2  # m v²/2 with m = 2 kg
    assert lost > 1e-3
    assert found.loss[0] == pytest.approx(lost, rel=1e-4)
    assert found.impulse[0] == pytest.approx(2.0 * (found.speed[0] + found.rebound_speed[0]))


def test_impacts_of_an_orbit_are_those_of_its_simulation():
    system = make_one_dof()
    orbit = solve_orbit(system, 25.3)
    once = impacts(orbit)
    start = orbit.states(np.array([0.0]))[0]
    many = impacts(simulate(system, 25.3, periods=200, start=start))
    assert len(once) == orbit.impacts
    assert len(many) == 200 * orbit.impacts
    np.testing.assert_allclose(many.impulse, once.impulse[0], rtol=1e-5)
    peak = orbit.impact_list[0]
    assert once.peak_force[0] == pytest.approx(peak.force, rel=2e-6)


def test_a_contact_over_the_end_of_the_period_counts_once():
    phased = make_one_dof(
        excitation=[Unbalance("middle", 4.92e-6, phase_deg=180.0 * 1.83)]
    )  # the contact lies over phase zero
    for shift in (0.0, 60.0, 120.0, 180.0, 240.0, 300.0):
        turned = make_one_dof(
            excitation=[Unbalance("middle", 4.92e-6, phase_deg=180.0 * 1.83 + shift)]
        )
        found = impacts(solve_orbit(turned, 25.3))
        assert len(found) == 1
        assert found.peak_force[0] == pytest.approx(119.406, rel=1e-4)
    assert len(impacts(solve_orbit(phased, 25.3))) == 1


def test_loss_is_rounding_where_the_stop_is_elastic():
    found = impacts(simulate(make_one_dof(), 15.0, periods=10))
    assert len(found) > 10
    assert np.all(np.abs(found.loss) < 1e-10 * found.work)


def test_loss_is_the_kinetic_energy_that_a_free_mass_leaves_in_the_stop():
    system, start = ball(stop=Stop("x", 1e9, dissipation=3.0))
    found = impacts(simulate(system, 1.0, periods=1, start=start))
    energy = 0.5 * 2.0 * (found.speed**2 - found.rebound_speed**2)
    assert len(found) == 1 and energy[0] > 0.1 * 0.5 * 2.0 * 0.2**2
    np.testing.assert_allclose(found.loss, energy, rtol=1e-9)


def test_permanent_contact_is_no_impact():
    system = make_one_dof(stops=[Stop("middle", 5.17e9, gap=-1e-3)])
    depth = (16877.0 * 1e-3 / 5.17e9) ** (2.0 / 3.0)  # where spring and stop balance
    start = [(depth - 1e-3) * np.sqrt(2.48), 0.0]
    motion = simulate(system, 20.0, periods=5, transient=100, start=start)
    assert len(impacts(motion)) == 0
    np.testing.assert_allclose(motion.history(100).force, 16.9, rtol=0.1)


def chirp_end(system: System, first: float, last: float, rate: float) -> np.ndarray:
    """State at the end of a sweep whose frequency changes at every instant."""
    (phi, source), stops = Independent(system).sources[0], Independent(system).elements[0]
    slope = np.copysign(rate, last - first)
    spring, damping = system.natural_frequencies[0] ** 2, system.total_damping[0, 0]

    def rate_of(t: float, x: np.ndarray) -> list[float]:
        omega = 2.0 * np.pi * (first + slope * t)
        phase = 2.0 * np.pi * (first * t + 0.5 * slope * t * t)
        push = phi[0] * source.phasor.real * omega**source.power * np.cos(phase)
        for c, gap, *law in stops:
            push -= c * contact(c * x[0] - gap, c * x[1], *law)[0]
        return [x[1], push - spring * x[0] - damping * x[1]]

    span = (0.0, abs(last - first) / rate)
    return solve_ivp(
        rate_of, span, [0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-16, max_step=3e-4
    ).y[:, -1]


def sweep_error(system: System, ends: tuple[float, float], steps: int, exact: np.ndarray) -> float:
    motion = sweep(system, ends, 2.0, steps_per_period=steps)
    assert motion.end_time == pytest.approx(abs(ends[1] - ends[0]) / 2.0, rel=1e-12)
    return float(np.abs(motion.end - exact).max() / np.abs(exact).max())


SWEEPS = [(20.0, 21.0), (21.0, 20.0), (20.0, 22.0)]


@pytest.mark.parametrize("ends", SWEEPS)
def test_sweep_of_a_force_converges_with_the_fourth_power_of_the_step(ends):
    system = make_one_dof(stops=[], excitation=[HarmonicForce("middle", 0.08)])
    exact = chirp_end(system, *ends, 2.0)
    errors = [sweep_error(system, ends, steps, exact) for steps in (4, 8, 16)]
    assert errors[0] < 1e-4
    assert errors[0] > 12.0 * errors[1] > 144.0 * errors[2]


@pytest.mark.parametrize("ends", SWEEPS)
def test_sweep_of_an_unbalance_converges_with_the_square_of_the_step(ends):
    system = make_one_dof(stops=[])
    exact = chirp_end(system, *ends, 2.0)
    errors = [sweep_error(system, ends, steps, exact) for steps in (4, 8, 16, 32)]
    assert errors[0] < 2e-3
    for coarse, fine in pairwise(errors):
        assert coarse > 3.5 * fine


@pytest.mark.parametrize("ends", SWEEPS)
def test_sweep_with_impacts_comes_near_the_true_one(ends):
    system = make_one_dof()
    exact = chirp_end(system, *ends, 2.0)
    for steps, bound in ((4, 1e-3), (8, 1e-3), (16, 1e-3), (32, 2e-5)):
        assert sweep_error(system, ends, steps, exact) < bound


def test_slow_sweep_follows_the_branch():
    system = make_one_dof()
    motion = sweep(system, (20.0, 21.0), 0.02)
    hz, peaks = motion.period_peaks()
    for target in (20.5, 20.9):
        orbit = solve_orbit(system, target)
        here = peaks[np.argmin(np.abs(hz - target))]
        assert here == pytest.approx(orbit.max_abs_displacement, rel=5e-3)


def test_chirp_steps_end_where_the_sweep_does():
    phases, times = chirp_steps(30.0, 20.0, 4.0, 3)
    assert times[-1] == pytest.approx(2.5, rel=1e-14)
    assert phases[-1] == pytest.approx(2.0 * np.pi * 25.0 * 2.5, rel=1e-14)
    assert np.all(np.diff(times) > 0.0)


def test_history_and_states_are_those_of_one_motion_in_blocks():
    system = make_one_dof()
    motion = simulate(system, 26.0, periods=130)
    assert len(motion.stretches) == 3
    history = motion.history(1300)
    again = simulate(FlowMap(system), 26.0, periods=1, transient=129)
    assert again.start_time == pytest.approx(129.0 / 26.0)
    np.testing.assert_allclose(history.modal[-1], again.end[:1], rtol=1e-6)
    assert history.force.shape == (1301, 1)
    np.testing.assert_allclose(motion.frequency_hz(history.time), 26.0, rtol=1e-12)
    hz, peaks = motion.period_peaks()
    assert hz.size == peaks.size == 130
    assert peaks.max() >= np.abs(history.displacement["middle"]).max() * (1.0 - 1e-12)


def test_largest_displacement_of_a_period_without_an_extreme_lies_at_its_ends():
    system = System.from_modal([1.0], {"mass": [1.0]})
    _, peaks = simulate(system, 20.0, periods=40, start=[1.0, 0.0]).period_peaks()
    cosine = np.abs(np.cos(2.0 * np.pi * np.arange(41) / 20.0))
    np.testing.assert_allclose(peaks, np.maximum(cosine[:-1], cosine[1:]), rtol=1e-9)


@pytest.mark.parametrize("hz", [50.0, 76.0])
def test_largest_displacements_of_subharmonic_motion_are_those_of_a_dense_sampling(hz):
    system = make_one_dof()
    motion = simulate(system, hz, periods=12, transient=800)
    _, peaks = motion.period_peaks()
    size = np.abs(motion.history(12 * 2000).displacement["middle"])
    sampled = [size[2000 * k : 2000 * (k + 1) + 1].max() for k in range(12)]
    np.testing.assert_allclose(peaks, sampled, rtol=1e-5)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s: simulate(s, -1.0, 5), "frequency_hz must be positive"),
        (lambda s: simulate(s, 20.0, 0), "periods must be a whole number from 1 to .*, got 0"),
        (lambda s: simulate(s, 20.0, 5, start=[1.0]), r"start must have 2 entries"),
        (lambda s: sweep(s, (20.0, 20.0), 1.0), "begins and ends at 20 Hz"),
        (lambda s: sweep(s, (20.0, 30.0), -1.0), "rate_hz_per_s must be positive"),
        (lambda s: sweep(s, 20.0, 1.0), "range_hz must be two frequencies, got 20.0"),
        (lambda s: sweep(s, (20.0, 30.0), 1e-9), "higher rate"),
        (lambda s: simulate(s, 20.0, 2).states(np.array([7.0])), "time must lie between 0 and 0.1"),
    ],
)
def test_bad_input_is_one_sentence(call, said):
    with pytest.raises(SystemModelError, match=said):
        call(make_one_dof())


def test_a_long_transient_is_cut_into_short_calls_and_ends_at_the_same_state(monkeypatch):
    system = make_one_dof()
    flow, omega, periods = FlowMap(system), 2.0 * np.pi * 26.0, 2 * PIECE + 7
    phases = 2.0 * np.pi * np.arange(periods + 1)
    whole = flow.shoot(np.zeros((1, 2)), phases, omega, sensitivities=False, chained=True)
    counts, shoot = [], flow.shoot

    def counted(nodes, phases, omega, **more):
        counts.append(phases.size - 1)
        return shoot(nodes, phases, omega, **more)

    monkeypatch.setattr(flow, "shoot", counted)
    end = transient_end(flow, np.zeros(2), omega, periods)
    assert sum(counts) == periods
    assert max(counts) == BUNCH
    np.testing.assert_allclose(end, whole.ends[-1], rtol=1e-9)


def test_one_long_motion_and_the_searches_tell_how_far_they_are():
    """Each count goes up to its total; what has no total says what it is at."""
    one_dof = make_one_dof()
    counted = []
    simulate(one_dof, 50.0, 100, transient=150, progress=lambda *n: counted.append(n))
    assert counted == [(150, 250), (214, 250), (250, 250)]
    steps = []
    sweep(one_dof, (20.0, 21.0), 1.0, progress=lambda *n: steps.append(n))
    assert [done for done, _ in steps] == list(range(1, steps[-1][1] + 1))
    told = []
    classify_attractor(one_dof, 50.0, progress=lambda *n: told.append(n))
    assert told[0][0].startswith("transient of ") and told[0][1] == 50.0
    shares = []
    find_orbits(one_dof, 50.0, 2, progress=lambda *n: shares.append(n[2]))
    assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] > 0.5
