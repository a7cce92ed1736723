"""One branch through two doors: in the frequency, and in the speed of a shaft that goes with it.

A spin whose matrix is zero changes nothing, so both are one curve in the same chart ln ω. But only
the first is corrected by the compiled method, with derivatives by the frequency: that in the speed
goes by the bordered one, with differences of whole motions in their place.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from bilinear import Bilinear
from hard.chatter import mass
from hard.grazing import touching
from hard.impact_oscillator import ImpactOscillator
from hard.modes import close_system
from hard.resonance import resonance_with_gap
from hard.stiffness import beam_with_stop
from paper.jobs import scene_system
from problems import between_stops, make_one_dof, three_modes, torus_system

from nldyn import (
    ContinuationOptions,
    HarmonicForce,
    PolynomialSpring,
    RigidStop,
    RoundStop,
    Stop,
    System,
    Unbalance,
    continue_branch,
    solve_orbit,
)
from nldyn.bifurcations.chord import Chord
from nldyn.branches.guards import KINK
from nldyn.orbits.bordered import Solved
from nldyn.orbits.shooting import metric_length
from nldyn.system.spin import Spin

FEW = ContinuationOptions(max_points=60)
SPECIAL, POINT = 1e-9, 1e-10
BESIDE = 1e-7  # arclength from the grazing of a rigid stop
NEAR = 0.5  # arclength from an orbit, up to which its chord is looked for


def duffing() -> System:
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.05]],
        springs=[PolynomialSpring("x", [0.0, 0.0, 0.05])], excitation=[HarmonicForce("x", 0.1)],
    )  # fmt: skip


def one_mass(*stops: Stop | RigidStop) -> System:
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.1]], stops=stops,
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip


def rotor_in_a_ring() -> System:
    around = RoundStop(("x", "y"), 2e6, 6e-4, 1.0, friction=0.08, surface_speed=5.0)
    return System.from_matrices(
        10.0 * np.eye(2), 4e5 * np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        damping=200.0 * np.eye(2), stops=[around],
        excitation=[Unbalance("x", 2e-3), Unbalance("y", 2e-3, phase_deg=-90.0)],
    )  # fmt: skip


def scene(name: str) -> Callable[[], System]:
    return lambda: scene_system(name)


Door = tuple[Callable[[], System], float, tuple[float, float]]
QUICK: dict[str, Door] = {
    "duffing": (duffing, 0.1, (0.1, 0.25)),
    "touching": (lambda: one_mass(Stop.linear("x", 2.0, gap=3.0)), 0.05, (0.05, 0.25)),
    "bilinear": (lambda: Bilinear(0.1, 1.0, 5.0, 0.3, 1.0).system, 0.33, (0.15, 0.6)),
    "rigid": (lambda: one_mass(RigidStop("x", restitution=0.8, gap=0.3)), 0.27, (0.2, 0.8)),
}
OTHERS: dict[str, Door] = {
    "rigid_calm": (lambda: one_mass(RigidStop("x", restitution=0.8, gap=0.3)), 0.45, (0.3, 0.5)),
    "rubbing_rotor": (rotor_in_a_ring, 29.0, (28.0, 45.0)),
    "one_dof": (make_one_dof, 20.0, (5.0, 90.0)),
    "between_stops": (between_stops, 10.0, (5.0, 30.0)),
    "three_modes": (three_modes, 20.0, (10.0, 60.0)),
    "torus": (torus_system, 11.0, (8.0, 20.0)),
    "chatter": (lambda: mass(Stop("m", 1e9)), 20.0, (12.0, 40.0)),
    "grazing": (touching, 15.0, (12.0, 60.0)),
    "stiff": (lambda: ImpactOscillator().with_stop(1e9), 0.32, (0.25, 0.45)),
    "stiffer_beam": (lambda: beam_with_stop(1e12), 20.0, (18.0, 30.0)),
    "close_modes": (lambda: close_system(1e-4), 13.0, (11.0, 20.0)),
    "repeated_modes": (lambda: close_system(0.0), 13.0, (11.0, 20.0)),
    "gap": (lambda: resonance_with_gap(1e-5), 20.0, (10.0, 40.0)),
    **{
        f"scene_{name}": (scene(name), hz, limits)
        for name, hz, limits in (
            ("two_dof_xi_0.01", 20.0, (15.0, 90.0)),
            ("two_dof_xi_0.001", 20.0, (15.0, 90.0)),
            ("four_dof_xi_0.01", 20.0, (15.0, 90.0)),
            ("four_dof_xi_0.001", 20.0, (15.0, 90.0)),
            ("two_well_beam", 3.0, (2.5, 8.0)),
            ("gear_pair", 0.1, (0.0477, 0.2387)),
            ("ship_between_fenders", 0.3, (0.15, 1.2)),
            ("bilinear_modal", 12.0, (8.0, 30.0)),
            ("portal", 4.0, (2.0, 15.0)),
            ("portal_with_absorber", 10.0, (8.0, 18.0)),
            ("bumper", 5.0, (3.0, 15.0)),
            ("hook", 420.0, (400.0, 500.0)),
            ("plate", 30.0, (25.0, 60.0)),
            ("coarse_beam", 20.0, (15.0, 90.0)),
        )
    },
}


def through_both(system: System, hz: float, limits: tuple[float, float]):
    turning = replace(system, spin=Spin(hz, gyroscopic=np.zeros((system.size, system.size))))
    orbit = solve_orbit(turning, hz)
    return [
        continue_branch(orbit, limits, parameter=name, options=FEW)
        for name in ("frequency_hz", "speed_hz")
    ]


def distance(branch, node) -> float:
    """Of an orbit from a branch in the frequency, relative to its size; inf where that has ended.

    The branch is solved for on the plane across the chord on which the orbit lies.
    """
    point = np.append(node.point[:-1], np.log(node.orbit.omega))
    place = Solved(branch.nodes[0].family, point, node.orbit)
    least = np.inf
    for a, b in pairwise(branch.nodes):
        if abs(0.5 * (a.arclength + b.arclength) - node.arclength) > NEAR:
            continue
        chord = Chord(a, b)
        if chord.passes(place, 1e-3):
            off = chord.at(chord.place(place)).point - point
            least = min(least, metric_length(a.family.metric(a.point), off))
    return float(least)


def check(a, b):
    """Two branches have the same special points, and the points of one lie on the other.

    As far as both were followed, and but for those right beside the grazing of a rigid stop, where
    the bordered method follows no impact as slight as the compiled one does, and those in a step
    so short that the branch may have a corner in it.
    """
    ends = [[node.arclength for node in (c.nodes[0], c.nodes[-1])] for c in (a, b)]
    first, last = max(e[0] for e in ends), min(e[1] for e in ends)

    def within(points):
        return [p for p in points if first <= p.arclength <= last]

    special = [[s for s in c.special_points if within([s.point])] for c in (a, b)]
    assert [s.kind for s in special[0]] == [s.kind for s in special[1]]
    for s, t in zip(*special, strict=True):
        assert s.value == pytest.approx(t.value, rel=SPECIAL)
    rigid = b.nodes[0].orbit.system.rigid_stops
    touches = [s.point.arclength for s in b.special_points if rigid and s.kind == "GR"]
    lengths = [node.arclength for node in a.nodes]
    corners = [(p, q) for p, q in pairwise(lengths) if q - p <= KINK]
    points = [
        node for node in within(b.nodes)
        if all(abs(node.arclength - place) > BESIDE for place in touches)
        and not any(p < node.arclength < q for p, q in corners)
    ]  # fmt: skip
    assert len(points) > 0.75 * len(b.nodes)
    assert max(distance(a, node) for node in points) < POINT


@pytest.mark.parametrize("name", QUICK)
def test_both_doors_give_one_branch(name):
    make, hz, limits = QUICK[name]
    check(*through_both(make(), hz, limits))


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_both_doors_give_one_branch_of_other_systems(name):
    make, hz, limits = OTHERS[name]
    check(*through_both(make(), hz, limits))
