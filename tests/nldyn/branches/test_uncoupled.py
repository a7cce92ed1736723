"""Two oscillators that do not know of each other: what is true of each is true of both.

Branches of one beside those of the other lie as close together as one likes, and special points of
the two coincide where one likes.
"""

from __future__ import annotations

import numpy as np
import pytest

from nldyn import (
    HarmonicForce,
    Parameter,
    Stop,
    System,
    continue_branch,
    continue_special,
    solve_orbit,
)
from nldyn.bifurcations.normal_forms import switch_at_branch_point

MASS, STIFFNESS, DAMPING = 1.0, 100.0, 0.4
STOP, GAP = 3000.0, 0.01


def stops(at: str, scale: float, sides: tuple[int, ...]) -> list[Stop]:
    return [Stop.linear(at, STOP, gap=scale * GAP, direction=side) for side in sides]


def oscillator(scale: float = 1.0, sides: tuple[int, ...] = (1, -1)) -> System:
    """With linear stops, force and gap times s give displacements times s."""
    return System.from_matrices(
        [[MASS]], [[STIFFNESS]], {"y": [1.0]}, damping=[[DAMPING]],
        stops=stops("y", scale, sides), excitation=[HarmonicForce("y", scale)],
    )  # fmt: skip


@pytest.mark.slow
def test_a_fast_mode_that_no_stop_moves_costs_no_contact_panels():
    """1 rad/s beside 1e6 rad/s; too many panels at first."""
    found = []
    for fast in (1e2, 1e12):
        system = System.from_matrices(
            np.eye(2), np.diag([fast, 1.0]), {"m": [0.0, 1.0]}, modal_damping=0.05,
            stops=[Stop.linear("m", 1.5, gap=-1e-2)], excitation=[HarmonicForce("m", 1e-3)],
        )  # fmt: skip
        found.append(solve_orbit(system, 0.1).max_abs_displacement)
    assert found[1] == pytest.approx(found[0], rel=1e-12)


def both(scale: float, sides: tuple[int, ...] = (1, -1), force: float = 1.0) -> System:
    """x against one stop, and y with everything smaller."""
    return System.from_matrices(
        np.diag([MASS, MASS]), np.diag([STIFFNESS, STIFFNESS]),
        {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=np.diag([DAMPING, DAMPING]),
        stops=[*stops("x", 1.0, (1,)), *stops("y", scale, sides)],
        excitation=[HarmonicForce("x", force), HarmonicForce("y", scale)],
    )  # fmt: skip


@pytest.mark.parametrize("scale", [pytest.param(1e-4, marks=pytest.mark.slow), 1e-6])
def test_a_branch_never_jumps_to_its_close_mirror_image(scale):
    """The halves of a broken symmetry of y, and the symmetric branch, are `scale` apart."""
    symmetric = continue_branch(solve_orbit(oscillator(), 1.0), (0.5, 1.0))
    point = [s for s in symmetric.special_points if s.kind == "BP"][-1]
    alone = continue_branch(switch_at_branch_point(point)[0].orbit, (0.5, 1.0))
    x, (first, second) = solve_orbit(oscillator(sides=(1,)), 0.6), alone.at(0.6)
    assert off_symmetry(first) * off_symmetry(second) < 0.0
    shapes = both(scale).participation
    for y in (first, second):
        start = np.outer(at_phase_zero(x), shapes["x"])
        start += scale * np.outer(at_phase_zero(y), shapes["y"])
        orbit = solve_orbit(both(scale), 0.6, guess=start.ravel())
        branch = continue_branch(orbit, (0.55, 0.66))
        assert len(branch.nodes) > 5
        for node in branch.nodes:
            half = [o for o in alone.at(node.orbit.frequency_hz) if on_side_of(o, y)]
            expected = [at_phase_zero(o) for o in half]
            found = at_phase_zero(node.orbit).reshape(2, 2) @ shapes["y"] / scale
            # Newton's method ends with a step of 1e-11 of the whole state, of which y is `scale`;
            # that is true within a factor of ten
            left = 1e-10 * np.abs(at_phase_zero(x)).max() / scale
            assert found == pytest.approx(expected[0], rel=1e-5, abs=left)
            assert len(expected) == 1


def off_symmetry(orbit):
    """Displacement plus that of half a period later: zero for the symmetric orbits."""
    return float(orbit.states(np.array([0.0, np.pi]))[:, 0].sum())


def on_side_of(a, b):
    return off_symmetry(a) * off_symmetry(b) > 0.0


def at_phase_zero(orbit):
    """Modal displacements, then velocities."""
    return orbit.states(np.array([0.0]))[0]


@pytest.mark.parametrize(("kind", "name"), [("LP", "LPPD"), ("PD", "R2")])
def test_point_of_x_meets_the_flip_of_y_where_each_has_its_own(kind, name):
    """With y's time scaled, both have their points at one frequency if the gaps are the same.

    x has a fold or a flip; on its curve, along which only y changes, that of y is marked at its own
    gap. Two multipliers are -1 at R2, here those of two flips.
    """
    alone = continue_branch(solve_orbit(oscillator(sides=(1,)), 1.0), (0.9, 1.3))
    flip = next(s for s in alone.special_points if s.kind == "PD")
    of_x = next(s for s in alone.special_points if s.kind == kind)
    pace = of_x.frequency_hz / flip.frequency_hz
    system = System.from_matrices(
        np.diag([MASS, MASS]), STIFFNESS * np.diag([1.0, pace**2]),
        {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=DAMPING * np.diag([1.0, pace]),
        stops=[
            Stop.linear("x", STOP, gap=GAP), Stop.linear("y", pace**2 * STOP, gap=1.02 * GAP)
        ],
        excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", pace**2)],
    )  # fmt: skip
    shapes = system.participation
    start = np.outer(at_phase_zero(of_x.orbit), shapes["x"])
    start += np.outer(at_phase_zero(flip.orbit) * [1.0, pace], shapes["y"])
    hz = of_x.frequency_hz * (0.999 if kind == "LP" else 1.001)
    branch = continue_branch(solve_orbit(system, hz, guess=start.ravel()), (0.99 * hz, 1.01 * hz))
    special = next(
        s for s in branch.special_points
        if s.kind == kind and s.frequency_hz == pytest.approx(of_x.frequency_hz, rel=1e-8)
    )  # fmt: skip
    window = ((0.8, 1.4), (0.97 * GAP, 1.05 * GAP))
    curve = continue_special(special, ("frequency_hz", Parameter("gap", 1)), window)
    assert np.ptp(curve.values[:, 0]) < 1e-8
    (mark,) = [m for m in curve.marks if m.kind == name]
    assert mark.values == pytest.approx([of_x.frequency_hz, GAP], rel=1e-7)
    near = np.sort(np.abs(mark.orbit.multipliers + 1.0))
    assert near[0 if kind == "LP" else 1] < 1e-6


def test_two_stops_are_grazed_at_once_where_each_amplitude_is_its_gap():
    """The curve on which x touches its stop is its resonance curve; y touches at one frequency."""
    stiff = 400.0  # of y: its resonance lies above those frequencies
    wanted_hz = 1.0
    system = System.from_matrices(
        np.diag([MASS, MASS]), np.diag([STIFFNESS, stiff]),
        {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=np.diag([DAMPING, DAMPING]),
        stops=[
            Stop("x", 1e4, gap=amplitude(STIFFNESS, 0.8)),
            Stop("y", 1e4, gap=amplitude(stiff, wanted_hz)),
        ],
        excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", 1.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 0.7), (0.7, 0.85))
    touch = next(s for s in branch.special_points if s.kind == "GR")
    curve = continue_special(touch, ("frequency_hz", "gap"), ((0.7, 1.2), (1e-3, 1e-1)))
    (mark,) = [m for m in curve.marks if m.kind == "GRGR"]
    assert mark.values == pytest.approx([wanted_hz, amplitude(STIFFNESS, wanted_hz)], rel=1e-9)


def amplitude(stiffness, hz):
    omega = 2.0 * np.pi * hz
    return 1.0 / abs(stiffness - MASS * omega**2 + 1j * DAMPING * omega)
