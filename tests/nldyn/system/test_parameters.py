"""Derivatives with respect to numbers of stops and excitation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import make_one_dof

from nldyn import (
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    SystemModelError,
    Unbalance,
)

OMEGA = 2 * np.pi * 26.0
PHASES = np.array([0.2, 3.0, 0.2 + 2 * np.pi])
EXACT = FlowOptions(rtol=1e-13)


def two_stops() -> System:
    return System.from_modal(
        [13.1, 117.5, 326.5],
        {"middle": [0.63, 0.45, 0.5], "end": [0.2, -0.7, 0.4]},
        modal_damping=0.01,
        stops=[
            Stop("middle", 5e9, gap=1e-6, dissipation=2.0),
            Stop("end", 1e6, 1.0, gap=-2e-6, direction=-1, against="middle"),
        ],
        excitation=[Unbalance("middle", 1e-5, 30.0), HarmonicForce("end", 0.5, 70.0)],
    )


def changed(system: System, parameter: Parameter, factor: float) -> tuple[System, float]:
    """The system with a number multiplied, and the change of the number."""
    kind = "excitation" if parameter.name in ("amplitude", "mass_times_radius") else "stops"
    elements = list(getattr(system, kind))
    element = elements[parameter.index]
    value = getattr(element, parameter.name)
    elements[parameter.index] = replace(element, **{parameter.name: value * factor})
    return replace(system, **{kind: tuple(elements)}), value * (factor - 1.0)


EVERY = [
    *(Parameter(name, 0) for name in ("gap", "stiffness", "exponent", "dissipation")),
    Parameter("gap", 1), Parameter("stiffness", 1),
    Parameter("mass_times_radius", 0), Parameter("amplitude", 1),
]  # fmt: skip


def test_derivatives_are_the_limits_of_differences():
    system = two_stops()
    flow = FlowMap(system, EXACT)
    starts = flow.to_state(
        np.array([[-2e-6, 1e-6, 0.0, 4e-3, 1e-3, 2e-3], [1e-6, 0.0, 1e-6, -3e-3, 2e-3, 0.0]])
    )
    found = flow.shoot(starts, PHASES, OMEGA, parameters=EVERY)
    assert found.closings.min() > 0
    for column, parameter in enumerate(EVERY):
        ends, change = [], 0.0
        for h in (1e-5, -1e-5):
            other, step = changed(system, parameter, 1.0 + h)
            ends.append(FlowMap(other, EXACT).shoot(starts, PHASES, OMEGA).ends)
            change = step if h > 0 else change
        difference = (ends[0] - ends[1]) / (2.0 * change)
        exact = found.d_parameters[:, :, column]
        assert np.abs(exact - difference).max() < 1e-5 * np.abs(difference).max(), parameter


def test_a_motion_scales_with_force_and_stiffness():
    """δ → sδ where force → s force and k → s^(1-p) k: the derivatives obey Euler's relation."""
    system = make_one_dof()
    flow = FlowMap(system, EXACT)
    start = 2.0 * flow.system.steady(OMEGA)[None]
    found = flow.shoot(
        start,
        2 * np.pi * np.array([0.0, 1.0]),
        OMEGA,
        parameters=[Parameter("mass_times_radius"), Parameter("stiffness")],
    )
    by_force, by_stiffness = found.d_parameters[0].T
    scaled = found.jacobians[0] @ start[0] + by_force * 4.92e-6 - 0.5 * by_stiffness * 5.17e9
    assert scaled == pytest.approx(found.ends[0], rel=1e-10)


def test_asking_for_parameters_changes_nothing_else():
    flow = FlowMap(two_stops())
    start = flow.to_state(np.array([[-2e-6, 1e-6, 0.0, 4e-3, 1e-3, 2e-3]]))
    turn = np.array([0.0, 2 * np.pi])
    plain, more = flow.shoot(start, turn, OMEGA), flow.shoot(start, turn, OMEGA, parameters=EVERY)
    assert np.array_equal(plain.ends, more.ends)
    assert more.jacobians == pytest.approx(plain.jacobians, rel=1e-12, abs=1e-14)
    assert more.d_omega == pytest.approx(plain.d_omega, rel=1e-12)


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        (Parameter("mass"), "unknown parameter 'mass'"),
        (Parameter("gap", 2), "no stop 2"),
        (Parameter("amplitude", 0), "excitation 0 has no amplitude"),
        (Parameter("amplitude", -1), "no excitation -1"),
    ],
)
def test_parameters_that_there_are_not(parameter, words):
    with pytest.raises(SystemModelError, match=words):
        FlowMap(two_stops()).shoot(np.zeros((1, 6)), PHASES[:2], OMEGA, parameters=[parameter])


def test_a_law_of_ones_own_has_no_exponent():
    def law(delta, speed):
        return 5e9 * delta**1.5, 7.5e9 * delta**0.5, 0.0

    flow = FlowMap(make_one_dof(stops=[Stop("middle", 5e9, law=law)]))
    with pytest.raises(SystemModelError, match="law of its own"):
        flow.shoot(np.zeros((1, 2)), PHASES[:2], OMEGA, parameters=[Parameter("exponent")])
