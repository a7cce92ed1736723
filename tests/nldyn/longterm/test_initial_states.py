"""States from displacements and velocities at interfaces."""

import numpy as np
import pytest

from nldyn import ConstantForce, Stop, System, simulate
from nldyn.base.errors import SystemModelError
from nldyn.longterm.initial_states import state_with
from nldyn.scene.read import parse_scene
from nldyn.scene.simulation import simulation_of

MASS, STIFFNESS = np.diag([1.0, 2.0]), np.array([[3.0, -1.0], [-1.0, 1.0]])


def chain(**more):
    rows = {"a": [1.0, 0.0], "b": [0.0, 1.0]}
    return System.from_matrices(MASS, STIFFNESS, rows, modal_damping=0.01, **more)


def physical(system, state):
    rows = np.array([system.participation[name] for name in ("a", "b")])
    return rows @ state[:2], rows @ state[2:]


def test_values_at_all_coordinates_are_that_state():
    system = chain()
    u, v = physical(system, state_with(system, {"a": 0.1, "b": 0.2}, {"a": 1.0, "b": -3.0}))
    assert u == pytest.approx([0.1, 0.2]) and v == pytest.approx([1.0, -3.0])


def test_what_is_not_given_follows_statically_and_by_an_impulse():
    """A force at a moves b by k_b u_b = u_a; an impulse at a leaves b where masses are apart."""
    u, v = physical(chain(), state_with(chain(), {"a": 0.1}, {"a": 2.0}))
    assert u == pytest.approx([0.1, 0.1]) and v == pytest.approx([2.0, 0.0], abs=1e-12)


def test_at_rest_is_the_balance_of_stop_spring_and_force():
    """k x + s x = F with the stop closed; what is given is added."""
    system = System.from_matrices(
        [[1.0]], [[4.0]], {"tip": [1.0]}, modal_damping=0.1,
        stops=[Stop.linear("tip", 6.0)], excitation=[ConstantForce("tip", 5.0)],
    )  # fmt: skip
    assert state_with(system, at_rest=True) == pytest.approx([0.5, 0.0])
    assert state_with(system, {"tip": 0.1}, at_rest=True) == pytest.approx([0.6, 0.0])


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"displacements": {"c": 1.0}}, "displacements: unknown interface 'c'; there are: a, b"),
        ({"velocities": {"a": np.nan}}, "velocities: that of 'a' must be a number"),
    ],
)
def test_what_makes_no_sense_is_refused(given, fault):
    with pytest.raises(SystemModelError, match=fault):
        state_with(chain(), **given)


def test_two_interfaces_that_move_as_one_have_one_displacement():
    system = System.from_modal([1.0], {"a": [1.0], "b": [2.0]})
    assert state_with(system, {"a": 1.0, "b": 2.0})[0] == pytest.approx(1.0)
    with pytest.raises(SystemModelError, match="no motion of 1 modes has these values at 'a', 'b'"):
        state_with(system, {"a": 1.0, "b": 1.0})


SCENE = """
[modal]
frequencies_hz = [1.0]
participation.tip = [2.0]
[damping]
modal_ratio = 0.05
[start]
displacements.tip = 0.3
velocities.tip = -1.0
"""


def test_a_scene_that_begins_somewhere_decays_as_a_free_oscillation():
    scene = parse_scene(SCENE)
    motion = simulation_of(scene, 1.0, periods=3).motion
    omega, t = 2.0 * np.pi, np.linspace(0.0, 3.0, 7)
    decay, turn = 0.05 * omega, omega * np.sqrt(1.0 - 0.05**2)
    exact = np.exp(-decay * t) * (
        0.3 * np.cos(turn * t) + (-1.0 + decay * 0.3) / turn * np.sin(turn * t)
    )
    assert 2.0 * motion.states(t)[:, 0] == pytest.approx(exact, abs=1e-9)
    same = simulate(motion.flow, 1.0, 3, start=np.array([0.15, -0.5]))
    assert same.end == pytest.approx(motion.end)
