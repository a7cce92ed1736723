"""Stops of a spring and a dashpot in parallel, against the exact pieces of linear motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla
from scipy.optimize import brentq

from nldyn import (
    ConstantForce,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Parameter,
    SceneError,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    dashpot_for,
    load,
    save,
    solve_orbit,
)
from nldyn.base.arrays import Real
from nldyn.base.resources import example
from nldyn.branches.endings import Ending
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene, parse_scene

M, K, C, SPRING, DASHPOT, GAP, FORCE = 1.3, 4000.0, 3.0, 1e5, 60.0, 1e-3, 5.0
HZ = 10.0
OMEGA = 2 * np.pi * HZ
EXACT = FlowOptions(rtol=1e-13)


def make(gap: float = GAP, dashpot: float = DASHPOT, stiffness: float = SPRING, mean: float = 0.0):
    return System.from_matrices(
        [[M]], [[K]], {"x": [1.0]}, damping=[[C]],
        stops=[Stop.linear("x", stiffness, gap=gap, dashpot=dashpot)],
        excitation=[HarmonicForce("x", FORCE), ConstantForce("x", mean)],
    )  # fmt: skip


def exact_end(x: Real, omega: float = OMEGA, gap: float = GAP, dashpot: float = DASHPOT) -> Real:
    """State after one period from phase zero: matrix exponentials from switch to switch."""

    def generator(closed: bool) -> Real:
        k, c = (K + SPRING, C + dashpot) if closed else (K, C)
        A = np.zeros((5, 5))  # x, x', cos, sin, 1
        A[0, 1] = 1.0
        A[1] = np.array([-k, -c, FORCE, 0.0, SPRING * gap if closed else 0.0]) / M
        A[2, 3], A[3, 2] = -omega, omega
        return A

    y, t, T = np.array([*x, 1.0, 0.0, 1.0]), 0.0, 2 * np.pi / omega
    closed = bool(x[0] > gap)
    while t < T:
        A = generator(closed)
        times = np.linspace(0.0, T - t, 4001)
        step = sla.expm(A * (times[1] - times[0]))
        z, places = y, [y[0] - gap]
        for _ in times[1:]:
            z = step @ z
            places.append(z[0] - gap)
        signs = np.array(places) > 0.0
        changes = np.flatnonzero(signs[2:] != closed) + 2
        if not changes.size:
            return (sla.expm(A * (T - t)) @ y)[:2]
        i = int(changes[0])
        at = brentq(
            lambda s, A=A, y=y: (sla.expm(A * s) @ y)[0] - gap, times[i - 1], times[i], xtol=1e-16
        )
        y, t, closed = sla.expm(A * at) @ y, t + at, not closed
        y[0] = gap
    return y[:2]


START = np.array([2e-4, 0.09])


def test_a_period_is_made_of_linear_pieces():
    flow = FlowMap(make(), EXACT)
    x = START * np.sqrt(M)  # modal
    found = flow.shoot(flow.to_state(x)[None], np.array([0.0, 2 * np.pi]), OMEGA)
    assert found.closings[0] >= 1
    end = flow.to_modal(found.ends[0]) / np.sqrt(M)
    assert end == pytest.approx(exact_end(START), abs=1e-12 * np.abs(end).max())


def test_derivatives_jump_as_they_must():
    """Columns, ω, gap and dashpot: against differences of the exact pieces."""
    flow = FlowMap(make(), EXACT)
    parameters = [Parameter("gap"), Parameter("dashpot")]
    start = flow.to_state(START * np.sqrt(M))[None]
    turn = np.array([0.0, 2 * np.pi])
    found = flow.shoot(start, turn, OMEGA, parameters=parameters)
    to_x = np.array([flow.to_modal(column) for column in np.eye(2)]).T / np.sqrt(M)
    jacobian = to_x @ found.jacobians[0] @ np.linalg.inv(to_x)

    def slope(function, h):
        return (function(-2 * h) - 8 * function(-h) + 8 * function(h) - function(2 * h)) / (12 * h)

    for column, h in enumerate((1e-7, 1e-5)):
        unit = np.eye(2)[column]
        exact = slope(lambda s, unit=unit: exact_end(START + s * unit), h)
        assert jacobian[:, column] == pytest.approx(exact, abs=1e-7 * np.abs(exact).max())
    by_omega = slope(lambda s: exact_end(START, omega=OMEGA + s), 1e-3)
    assert to_x @ found.d_omega[0] == pytest.approx(by_omega, abs=1e-7 * np.abs(by_omega).max())
    by_gap = slope(lambda s: exact_end(START, gap=GAP + s), 1e-7)
    by_dashpot = slope(lambda s: exact_end(START, dashpot=DASHPOT + s), 1e-3)
    for column, exact in enumerate((by_gap, by_dashpot)):
        got = to_x @ found.d_parameters[0][:, column]
        assert got == pytest.approx(exact, abs=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize("dashpot", [1.0, 60.0, 600.0, 3000.0])
def test_orbits_of_light_and_heavy_dashpots(dashpot):
    """From under- to overdamped contacts; the determinant is that of Liouville's formula."""
    orbit = solve_orbit(make(dashpot=dashpot), HZ)
    assert orbit.impacts >= 1
    x = orbit.states(np.array([0.0]))[0] / np.sqrt(M)
    assert exact_end(x, dashpot=dashpot) == pytest.approx(x, abs=1e-8 * np.abs(x).max())
    assert np.prod(orbit.multipliers).real > 0.0
    assert orbit.flow_error.monodromy < 1e-7


def test_a_body_that_stays_closed_is_a_linear_oscillator():
    system = make(gap=-0.1)
    orbit = solve_orbit(system, HZ)
    k, c = K + SPRING, C + DASHPOT
    amplitude = FORCE / abs(k - M * OMEGA**2 + 1j * c * OMEGA)
    moved = orbit.extremes(0).values
    assert np.ptp(moved) == pytest.approx(2 * amplitude, rel=1e-7)
    decay = np.exp(-c / M / HZ)
    assert np.prod(orbit.multipliers).real == pytest.approx(decay, rel=1e-6)


def test_a_branch_goes_on_where_a_switch_passes_a_phase_of_shooting():
    """The state there has a corner, as the force jumps; twice on this branch."""
    system = build_system(load_scene(example("ship_between_fenders.toml")))
    branch = continue_branch(solve_orbit(system, 0.9), (0.15, 1.2))
    assert [reason.ending for reason in branch.stop_reasons] == [Ending.RANGE_END] * 2
    assert sum(point.kind == "LP" for point in branch.special_points) == 4


def test_a_dashpot_comes_back_from_its_file(tmp_path):
    branch = continue_branch(solve_orbit(make(), HZ), (9.9, 10.1))
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[0].system.stops == make().stops


def test_dashpots_that_make_no_sense():
    with pytest.raises(SystemModelError, match="dashpot must not be negative"):
        Stop("x", 1.0, dashpot=-1.0)
    with pytest.raises(SystemModelError, match="dashpot or a law of your own"):
        Stop("x", 1.0, 1.0, law=lambda d, v: (d, 1.0, 0.0), dashpot=1.0)


@pytest.mark.parametrize("pulls", [True, False])
@pytest.mark.parametrize("restitution", [0.9999, 0.8, 0.1353, 0.01])
def test_a_dashpot_gives_one_restitution_at_every_speed(restitution, pulls):
    """A free body flies against the stop; 0.1353 is beside critical damping without pull."""
    dashpot = dashpot_for(restitution, SPRING, M, pulls=pulls)
    stop = Stop.linear("x", SPRING, dashpot=dashpot)
    stop = replace(stop, pulls=pulls)
    system = System.from_matrices([[M]], [[0.0]], {"x": [1.0]}, stops=[stop])
    flow = FlowMap(system)
    for speed in (1e-3, 1.0, 1e3):
        start = flow.to_state(np.array([-1e-3, 1.0]) * speed * np.sqrt(M))
        found = flow.shoot(start[None], np.array([0.0, 2.0 * np.pi]), 2.0 * np.pi / 2.0)
        after = flow.to_modal(found.ends[0])[1] / np.sqrt(M)
        assert -after / speed == pytest.approx(restitution, rel=1e-10)


def test_a_scene_asks_for_a_restitution_at_every_speed():
    text = "[modal]\nfrequencies_hz=[1.0]\nparticipation.a=[1.0]\n[[stops]]\nat='a'\n"
    linear = f"{text}law='linear'\nstiffness=1e5\nrestitution=0.8\n"
    (stop,) = build_system(parse_scene(f"{linear}mass=2.0\npulls=false\n")).stops
    assert stop.dashpot == dashpot_for(0.8, 1e5, 2.0, pulls=False) and not stop.pulls
    for wrong, words in (
        (linear, "needs both 'restitution' and 'impact_speed' or 'mass', or neither"),
        (f"{linear}mass=2.0\nimpact_speed=1.0\n", "has both 'impact_speed' and 'mass'; keep one"),
        (f"{linear}mass=2.0\ndashpot=1.0\n", "has both 'mass' and 'dashpot'; keep one"),
        (f"{linear}mass=2.0\ndissipation=1.0\n", "'dissipation', which is not a key of a stop"),
        (f"{text}stiffness=1e5\nrestitution=0.8\nmass=2.0\n", "mass is not a key of law 'hertz'"),
    ):
        with pytest.raises(SceneError, match=words):
            parse_scene(wrong)


@pytest.mark.parametrize("numbers", [(0.0, 1.0, 1.0), (1.1, 1.0, 1.0), (0.5, -1.0, 1.0)])
def test_no_dashpot_for_what_makes_no_sense(numbers):
    with pytest.raises(SystemModelError, match="dashpot_for: "):
        dashpot_for(*numbers)
