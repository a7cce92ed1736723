"""Beams that land on areas of contact: closed forms, an independent integration, quadrature."""

import math

import numpy as np
import pytest

import cms
import fem
from nldyn import (
    ConstantForce,
    FlowMap,
    HarmonicForce,
    Parameter,
    System,
    contact_area,
    impacts,
    simulate,
    solve_orbit,
)
from nldyn.app.describe import describe_rest, describe_stops, describe_system, told_interfaces
from nldyn.system import Friction, rest
from nldyn.system.chart import value_of, with_value
from tests.independent import Motion

STEEL = fem.Material(2.1e11, 7800.0)
SECTION = fem.RectangularSection(0.02, 0.01)
BENDING = 2.1e11 * 0.02 * 0.01**3 / 12.0


def area_of(component, at, direction, stiffness, points, modes, *, tolerance=1e-2, **more):
    """A reduced model with an area, and the stops of that."""
    found = fem.contact_points(component, at, direction, points=points)
    names = [f"bed {i + 1}" for i in range(len(found.places))]
    bed = cms.Area(names, stiffness * found.weights, tolerance=tolerance)
    touching = component.with_interfaces(
        dict(zip(names, found.vectors(), strict=True)), {"bed": bed}
    )
    gap = more.pop("gap", lambda x: np.zeros_like(x))(found.places[:, 0])
    stops = contact_area("bed", names, stiffness, weights=found.weights, gap=gap, **more)
    return cms.reduce(touching, modes=modes), stops


def winkler_deflection(points, lines=24):
    """Deflection under the load in the middle of a long free beam on a foundation that lifts off.

    Half the beam: its middle neither turns nor moves along.
    """
    stiffness = 2e5
    wave = (stiffness / (4.0 * BENDING)) ** 0.25
    mesh = fem.frame_mesh(
        {"middle": (0, 0), "end": (1.6 * math.pi / wave, 0)}, [("half", "middle", "end", lines)]
    )
    half = fem.assemble(
        fem.StructureModel(
            mesh,
            parts={"half": fem.BeamPart(STEEL, SECTION)},
            supports=[fem.Support("middle", ("x", "rotation"))],
            interfaces={"middle": fem.Interface("middle", "y")},
            plane=True,
        )
    )
    reduced, stops = area_of(half, "half", "-y", stiffness, points, 20, tolerance=1e-7)
    system = System.from_reduced(
        reduced, modal_damping=0.01, stops=stops, excitation=[ConstantForce("middle", -50.0)]
    )
    q = rest(system)
    depths = np.array([system.stop_vector(stop) @ q for stop in stops])
    sunk = -float(system.participation["middle"] @ q)
    return sunk, depths, 2.0 * 50.0 * wave / (2.0 * stiffness) / math.tanh(0.5 * math.pi)


def test_a_beam_on_a_foundation_that_lifts_off_sinks_and_parts_as_in_closed_form():
    """Weitsman 1970: it touches up to λa = π/2, whatever the load; w = Pλ/(2k) coth(π/2)."""
    for points in (1, 2, 4):
        sunk, depths, exact = winkler_deflection(points)
        assert abs(sunk / exact - 1.0) < 2e-5
        closed = np.flatnonzero(depths > 0.0)
        assert np.array_equal(closed, np.arange(closed.size))  # one region around the middle
        share = closed.size / depths.size * 1.6 * math.pi
        assert abs(share - 0.5 * math.pi) < 1.6 * math.pi / depths.size


def parted(lines, points):
    """How far a force F brings two long beams together, and the closed form; penetrations.

    The difference of their deflections bends as one beam of 1/EI = 1/EI₁ + 1/EI₂ on the layer
    between them. Halves: their middles neither turn nor move along; one end is held.
    """
    bed, heights = 2e5, (0.01, 0.014)
    bending = 1.0 / sum(12.0 / (2.1e11 * 0.02 * height**3) for height in heights)
    wave = (bed / (4.0 * bending)) ** 0.25
    halves = []
    for name, height, y, count in zip(("low", "high"), heights, (0.0, 0.012), lines, strict=True):
        ends = {"middle": (0.0, y), "end": (1.6 * math.pi / wave, y)}
        supports = [fem.Support("middle", ("x", "rotation")), fem.Support("end", ("y",))]
        halves.append(
            fem.assemble(
                fem.StructureModel(
                    fem.frame_mesh(ends, [(name, "middle", "end", count)]),
                    parts={name: fem.BeamPart(STEEL, fem.RectangularSection(0.02, height))},
                    supports=supports[: 1 + (name == "low")],
                    interfaces={"middle": fem.Interface("middle", "y")},
                    plane=True,
                )
            )
        )
    near = fem.contact_points(halves[0], "low", "y", points=points, surface=0.005)
    pair = fem.opposite_points(halves[1], near, "high", surface=0.007)
    models, names = {}, []
    for half, side in zip(halves, (pair.near, pair.far), strict=True):
        of = [f"bed {i + 1}" for i in range(len(side.places))]
        area = cms.Area(of, bed * side.weights, tolerance=1e-10)
        vectors = dict(zip(of, side.vectors(), strict=True))
        part = "low" if half is halves[0] else "high"
        models[part] = cms.reduce(half.with_interfaces(vectors, {"bed": area}), modes=12)
        names.append([f"{part}.{name}" for name in of])
    system = System.from_reduced(
        cms.couple(models, []),
        stops=contact_area("bed", names[0], bed, weights=pair.near.weights, against=names[1]),
        excitation=[ConstantForce("low.middle", 25.0), ConstantForce("high.middle", -25.0)],
    )
    q = rest(system)
    depths = np.array([system.stop_vector(stop) @ q for stop in system.stops])
    near_by = float(system.vector_between("low.middle", "high.middle") @ q)
    known = 50.0 * wave / (2.0 * bed) / math.tanh(0.5 * math.pi)
    return near_by / known - 1.0, depths, pair


def test_two_unlike_beams_on_a_layer_part_as_one_in_closed_form_where_meshes_do_not_match():
    """Weitsman's form for both together; errors of cubic beams fall with the fourth power."""
    errors = []
    for count in (6, 12, 24):
        error, depths, pair = parted((count, round(1.4 * count)), 3)
        assert np.all(pair.gaps == 0.0) and not pair.alone
        errors.append(abs(error))
        closed = np.flatnonzero(depths > 0.0)
        assert np.array_equal(closed, np.arange(closed.size))
        share = closed.size / depths.size * 1.6 * math.pi
        assert abs(share - 0.5 * math.pi) < 1.6 * math.pi / count
    assert errors[2] < 1e-5 and np.log2(errors[0] / errors[2]) > 7.5


def landing(points, modes=3, stiffness=2e4, **more):
    """A cantilever that lands on a curved support."""
    mesh = fem.frame_mesh({"root": (0, 0), "tip": (0.5, 0)}, [("strip", "root", "tip", 6)])
    strip = fem.assemble(
        fem.StructureModel(
            mesh,
            parts={"strip": fem.BeamPart(STEEL, fem.RectangularSection(0.02, 0.002))},
            supports=[fem.Support("root", ("x", "y", "rotation"))],
            interfaces={"tip": fem.Interface("tip", "y")},
            plane=True,
        )
    )
    reduced, stops = area_of(
        strip, "strip", "-y", stiffness, points, modes, gap=lambda x: 1e-4 + x**2 / 100.0, **more
    )
    return System.from_reduced(
        reduced, modal_damping=0.05, stops=stops, excitation=[HarmonicForce("tip", 0.3)]
    )


@pytest.mark.parametrize(
    "law",
    [{}, pytest.param({"exponent": 1.5, "dissipation": 0.5}, marks=pytest.mark.slow)],
)
def test_a_landing_is_that_of_an_independent_integration(law):
    stiffness = 2e4 if not law else 2e6
    system = landing(2, modes=2, stiffness=stiffness, tolerance=0.3, **law)
    orbit = solve_orbit(system, 5.0)
    start = orbit.states(np.zeros(1))[0]
    omega = 2.0 * np.pi * 5.0
    end, jacobian, closings = Motion(system).run(start, (0.0, 2.0 * np.pi), omega, max_step=0.01)
    scale = np.abs(start)
    scale[: system.size] = scale[: system.size].max()
    scale[system.size :] = scale[system.size :].max()
    assert np.all(np.abs(end - start) < 1e-8 * scale)
    assert sum(closings) == orbit.impacts and np.count_nonzero(closings) > 3
    expected = np.linalg.eigvals(jacobian)
    for multiplier in orbit.multipliers:
        assert np.abs(expected - multiplier).min() < 1e-6


def bed(modes=8, points=24):
    """A string of sines over a curved bed: more points touch at once than there are modes."""
    orders, places = np.arange(1, modes + 1), (np.arange(points) + 0.5) / points
    shapes = np.sqrt(2.0) * np.sin(np.pi * np.outer(np.append(0.47, places), orders))
    names = ["middle", *(f"p{i}" for i in range(points))]
    stops = contact_area(
        "bed", names[1:], 1e4, weights=np.full(points, 1.0 / points),
        gap=3e-4 + 2e-3 * (places - 0.5) ** 2,
    )  # fmt: skip
    return System.from_modal(
        10.0 * orders**1.2, dict(zip(names, shapes, strict=True)), modal_damping=0.02,
        stops=stops, excitation=[HarmonicForce("middle", 10.0)],
    )  # fmt: skip


def test_many_points_at_once_move_as_in_an_independent_integration():
    system, omega = bed(), 2.0 * np.pi * 9.0
    start, turn = np.full(2 * system.size, 1e-6), np.array([0.0, 2.0 * np.pi])
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(start[None]), turn, omega)
    end, jacobian, closings = Motion(system).run(start, tuple(turn), omega, max_step=0.01)
    assert found.closings.tolist() == closings and np.count_nonzero(closings) > 15
    left = system.linear.left
    off = np.abs(flow.to_modal(found.ends)[0] - end)
    for half in (slice(0, system.size), slice(system.size, None)):
        assert off[half].max() < 1e-10 * np.abs(end[half]).max()
    mine = np.linalg.solve(left, found.jacobians[0] @ left)
    assert np.abs(mine - jacobian).max() < 1e-8 * np.abs(jacobian).max()


def test_impacts_of_many_points_are_read_from_what_the_simulation_has_recorded(monkeypatch):
    motion = simulate(bed(), 9.0, 2)
    runs, run = [], FlowMap._call
    monkeypatch.setattr(FlowMap, "_call", lambda *a: runs.append(a) or run(*a))
    found = impacts(motion)
    assert len(found) > 15 and len(runs) <= 1  # that to the very end of the motion
    assert np.abs(found.loss).max() < 1e-12 * found.work.max()  # an elastic foundation


def test_derivatives_by_the_numbers_of_an_area_of_many_points_are_those_of_differences():
    system, omega, turn = bed(), 2.0 * np.pi * 9.0, np.array([0.0, 2.0 * np.pi])
    start = np.full((1, 2 * system.size), 1e-6)
    for name, step in (("area_gap", 1e-9), ("area_stiffness", 0.01)):
        parameter = Parameter(name)
        exact = FlowMap(system).shoot(start, turn, omega, parameters=[parameter]).d_parameters
        value = value_of(system, 9.0, parameter)
        ends = [
            FlowMap(with_value(system, parameter, value + sign * step))
            .shoot(start, turn, omega)
            .ends
            for sign in (1.0, -1.0)
        ]
        differences = (ends[0] - ends[1])[0] / (2.0 * step)
        assert np.abs(exact[0, :, 0] - differences).max() < 1e-4 * np.abs(differences).max()


def test_an_area_may_be_closed_at_rest_and_is_told_in_a_line():
    """Its smallest gap is -1 mm: both springs of 100 N/m lift what hangs on one of 200 N/m."""
    edge = contact_area("edge", ["left", "right"], 100.0, gap=[1e-3, 1e-3])
    system = System.from_matrices(
        [[1.0]], [[200.0]], {"left": [1.0], "right": [1.0]}, modal_damping=0.1, stops=edge
    )
    pressed = with_value(system, Parameter("area_gap"), -1e-3)
    assert value_of(pressed, 1.0, Parameter("area_gap")) == -1e-3
    assert [stop.friction for stop in pressed.stops] == [None, None]
    assert describe_rest(pressed) == [
        "at rest: -0.0005 m at 'left', -0.0005 m at 'right'",
        "at rest 2 of 2 points of the contact area 'edge' are closed: 0.1 N in all",
    ]
    assert "contact area 'edge': 2 points, 200 N/m in all" in describe_system(pressed)


def test_a_line_tells_how_an_area_rubs():
    """Weights of 0.1 and 0.3 m² in sum: 0.4 times what is given per area."""
    names = ("a", "b", "ta", "tb", "sa", "sb")
    points = {**dict(zip(names, np.eye(6), strict=True)), "hub": np.ones(6)}

    def told(free, **more):
        pads = contact_area("pads", ["a", "b"], 1e4, weights=[0.1, 0.3], **more)
        system = System.from_matrices(np.eye(6), np.eye(6), points, stops=pads)
        assert told_interfaces(system) == [*free, "hub"]
        (line,) = describe_stops(system)
        return line.removeprefix("contact area 'pads': 2 points, 4000 N/m in all, gap 0 m")

    assert told(names[2:], dashpot=50.0, pulls=False) == ", dashpot 20 N s/m in all (never pulls)"
    law = Friction(0.2, at_rest=0.3, fading_speed=0.05, base_speed=0.7)
    assert told(names[4:], friction=law, tangents=["ta", "tb"]) == (
        ", friction 0.2, at rest 0.3, from which it falls over 0.05 m/s, base at 0.7 m/s"
    )
    over = {"friction": 0.2, "tangents": ["ta", "tb"], "tangential_stiffness": 5e3}
    assert told(names[4:], **over) == ", friction 0.2, behind 2000 N/m in all"
    assert told((), **over, second_tangents=["sa", "sb"]) == (
        ", friction 0.2 over the plane, behind 2000 N/m in all"
    )


@pytest.mark.slow
def test_finer_quadrature_comes_to_one_landing():
    amplitudes = [solve_orbit(landing(n), 5.0).max_abs_displacement for n in (1, 2, 4)]
    steps = np.abs(np.diff(amplitudes)) / amplitudes[-1]
    assert steps[1] < 1e-3 and steps[1] < 0.5 * steps[0]
