"""Stops of a spring and a dashpot that never pull, against the exact pieces of linear motion."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
from independent import Motion
from scipy.optimize import brentq

from nldyn import (
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Parameter,
    PolynomialSpring,
    SceneError,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    impacts,
    load,
    save,
    solve_orbit,
)
from nldyn.scene.build import build_system
from nldyn.scene.read import parse_scene

M, K, C, SPRING, GAP, FORCE = 1.3, 4000.0, 3.0, 1e5, 1e-3, 5.0
OMEGA = 20.0 * np.pi
EXACT = FlowOptions(rtol=1e-12)
SHAKEN = 160.0  # N at the seventh harmonic: the body moves to and fro within the stop


def make(dashpot: float = 60.0, shaken: float = 0.0, spring: float = SPRING, gap: float = GAP):
    return System.from_matrices(
        [[M]], [[K]], {"x": [1.0]}, damping=[[C]],
        stops=[Stop.linear("x", spring, gap=gap, dashpot=dashpot, pulls=False)],
        excitation=[HarmonicForce("x", FORCE), HarmonicForce("x", shaken, harmonic=7)],
    )  # fmt: skip


def exact(x, omega=OMEGA, dashpot=60.0, shaken=0.0, spring=SPRING, gap=GAP):
    """State after a period, and how often the stop is hit and presses again within."""

    def generator(closed):
        k, c = (K + spring, C + dashpot) if closed else (K, C)
        A = np.zeros((7, 7))  # x, x', cos ωt, sin ωt, cos 7ωt, sin 7ωt, 1
        A[0, 1] = 1.0
        A[1] = np.array([-k, -c, FORCE, 0.0, shaken, 0.0, spring * gap if closed else 0.0]) / M
        A[2, 3], A[3, 2], A[4, 5], A[5, 4] = -omega, omega, -7.0 * omega, 7.0 * omega
        return A

    def depth(y):
        return y[0] - gap

    def force(y):
        return spring * depth(y) + dashpot * y[1]

    y, t, T = np.array([*x, 1.0, 0.0, 1.0, 0.0, 1.0]), 0.0, 2.0 * np.pi / omega
    closed, hits, again = min(depth(y), force(y)) > 0.0, 0, 0
    while True:
        A = generator(closed)
        times = np.linspace(0.0, T - t, 3001)
        step = sla.expm(A * (times[1] - times[0]))
        z, states = y, [y]
        for _ in times[1:]:
            z = step @ z
            states.append(z)
        pressing = np.array([min(depth(z), force(z)) > 0.0 for z in states])
        changes = np.flatnonzero(pressing[2:] != closed) + 2
        if not changes.size:
            return (sla.expm(A * (T - t)) @ y)[:2], hits, again
        i = int(changes[0])
        before = states[i - 1]
        watched = depth if not closed and depth(before) < 0.0 else force
        at = brentq(lambda s, A=A, y=y, f=watched: f(sla.expm(A * s) @ y), *times[i - 1 : i + 1],
                    xtol=1e-17)  # fmt: skip
        y, t, closed = sla.expm(A * at) @ y, t + at, not closed
        if closed:
            hits, again = hits + (watched is depth), again + (watched is force)


CASES = {
    "soft dashpot": ({}, [2e-4, 0.09]),
    "dashpot beyond critical": ({"dashpot": 2000.0}, [2e-4, 0.12]),
    "presses again within": (
        {"dashpot": 100.0, "shaken": SHAKEN, "spring": 1e4, "gap": -1e-3},
        [2e-4, 0.12],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_period_and_its_derivatives_are_exact(name):
    changes, start = CASES[name]
    system = make(**changes)
    flow = FlowMap(system, EXACT)
    phases = np.array([0.0, 2.0 * np.pi])
    names = [Parameter("gap"), Parameter("stiffness"), Parameter("dashpot")]
    found = flow.shoot(
        flow.to_state(np.sqrt(M) * np.array(start))[None], phases, OMEGA, parameters=names
    )
    assert not found.failure
    end, hits, again = exact(np.array(start), **changes)
    assert bool(again) == ("shaken" in changes)
    assert found.closings.sum() == hits + again > 0
    assert flow.to_modal(found.ends[0]) == pytest.approx(end * np.sqrt(M), rel=1e-9)

    def difference(move, step):
        near, far = move(step) - move(-step), move(2.0 * step) - move(-2.0 * step)
        return (8.0 * near - far) / (12.0 * step)

    J = system.linear.right @ found.jacobians[0] @ system.linear.left
    for column, step in enumerate((1e-8, 1e-6)):
        unit = np.eye(2)[column]
        slope = difference(lambda h, e=unit: exact(np.array(start) + h * e, **changes)[0], step)
        assert J[:, column] == pytest.approx(slope, rel=2e-6, abs=1e-6 * np.abs(slope).max())
    base = {"gap": GAP, "spring": SPRING, "dashpot": 60.0} | changes
    for column, key in enumerate(("gap", "spring", "dashpot")):

        def moved(h, key=key, value=base[key]):
            return exact(np.array(start), **{**changes, key: value + h})[0]

        slope = np.sqrt(M) * difference(moved, 1e-5 * abs(base[key]))
        exactly = flow.to_modal(found.d_parameters[0][:, column])
        assert exactly == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(slope).max())
    by_omega = difference(lambda h: exact(np.array(start), OMEGA + h, **changes)[0], 1e-4)
    assert flow.to_modal(found.d_omega[0]) == pytest.approx(np.sqrt(M) * by_omega, rel=1e-5)


def test_with_a_nonlinear_spring_beside_it():
    """There are no flights then; Runge-Kutta's method finds the kinks by its step."""
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.05]],
        stops=[Stop.linear("x", 60.0, gap=0.3, dashpot=6.0, pulls=False)],
        springs=[PolynomialSpring("x", [0.0, 0.0, 2.0])],
        excitation=[HarmonicForce("x", 1.0), HarmonicForce("x", 4.0, harmonic=5)],
    )  # fmt: skip
    flow, start = FlowMap(system), np.array([0.1, 0.3])
    state, *_ = Motion(system).run(start, (0.0, 12.0), 1.1, tangent=False, max_step=0.01)
    here = flow.to_state(start)
    found = flow.shoot(here[None], np.array([0.0, 12.0]), 1.1)
    assert found.closings.sum() > 1
    assert flow.to_modal(found.ends[0]) == pytest.approx(state, rel=1e-8)
    J = np.empty((2, 2))
    for column in range(2):
        step = 1e-6 * np.eye(2)[column]
        ahead, back = (
            flow.shoot((here + s * step)[None], np.array([0.0, 12.0]), 1.1).ends[0]
            for s in (1.0, -1.0)
        )
        J[:, column] = (ahead - back) / 2e-6
    assert found.jacobians[0] == pytest.approx(J, rel=1e-5, abs=1e-6 * np.abs(J).max())


def test_orbits_obey_liouvilles_formula_and_never_pull(tmp_path):
    orbit = solve_orbit(make(dashpot=400.0), 10.0)
    assert orbit.impacts > 0
    assert orbit.liouville_error < 1e-7
    times = np.linspace(0.0, 2.0 * np.pi, 400)
    assert orbit.system.stops[0].force(orbit.penetration(0, times), -1e3).min() == 0.0
    assert (impacts(orbit).loss > 0.0).all()
    branch = continue_branch(orbit, (9.8, 10.2))
    save(branch, tmp_path / "b.h5")
    (back,) = load(tmp_path / "b.h5")
    assert back.points[0].system.stops == orbit.system.stops


def test_what_makes_no_sense_is_refused():
    with pytest.raises(SystemModelError, match="pulls = False is for a linear stop"):
        Stop("x", 1.0, pulls=False)
    with pytest.raises(SystemModelError, match="pulls = False is for a linear stop"):
        Stop.linear("x", 1.0, pulls=False)
    text = (
        "[matrices]\nmass = [[1.0]]\nstiffness = [[1.0]]\ninterfaces.x = [1.0]\n[[stops]]\n"
        "at = 'x'\nlaw = 'linear'\nstiffness = 5.0\ndashpot = 0.5\npulls = false\n"
    )
    assert not build_system(parse_scene(text)).stops[0].pulls
    with pytest.raises(SceneError, match="needs a 'dashpot' above 0"):
        parse_scene(text.replace("dashpot = 0.5\n", ""))
