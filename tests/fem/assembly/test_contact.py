"""Points of contact: their weights, and how they move."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

import fem
from fem.assembly.contact import rule
from fem.mesh.cells import KINDS

STEEL = fem.Material(2e11, 7800.0, 0.3)
BEAM = fem.BeamPart(STEEL, fem.RectangularSection(0.02, 0.01))


def line(count=4):
    return fem.frame_mesh({"root": (0, 0), "tip": (2, 0)}, [("arm", "root", "tip", count)])


def clamped_frame(**more):
    return fem.assemble(
        fem.StructureModel(
            line(),
            parts={"arm": BEAM},
            supports=[fem.Support("root", ("x", "y", "rotation"))],
            interfaces={"tip": fem.Interface("tip", "y")},
            **more,
            plane=True,
        )
    )


def block(kind="hexahedron20", counts=(2, 3, 1)):
    mesh = fem.box_mesh("body", (1.0, 0.6, 0.2), counts, kind=kind)
    return fem.assemble(fem.StructureModel(mesh, {"body": fem.SolidPart(STEEL)}))


@pytest.mark.parametrize("points", [2, "nodes"])
def test_the_surface_of_a_beam_slides_as_its_axis_turns(points):
    arm = clamped_frame()
    found = fem.contact_points(arm, "arm", "-y", points=points, surface=0.05)
    u = spsolve(arm.stiffness, arm.interfaces["tip"])
    x, stiffness = found.places[:, 0], 2e11 * 0.02 * 0.01**3 / 12.0
    assert np.allclose(found.places[:, 1], -0.05)
    expected = 0.05 * (12.0 * x - 3.0 * x**2) / (6.0 * stiffness)
    assert np.allclose(found.vectors("x") @ u, expected, rtol=1e-10)


@pytest.mark.parametrize("points", [1, 3, "nodes"])
def test_points_of_a_beam_move_as_its_axis_does_under_a_force_at_its_tip(points):
    arm = clamped_frame()
    found = fem.contact_points(arm, "arm", "y", points=points)
    u = spsolve(arm.stiffness, arm.interfaces["tip"])
    x, stiffness = found.places[:, 0], 2e11 * 0.02 * 0.01**3 / 12.0
    expected = x**2 * (6.0 - x) / (6.0 * stiffness)
    assert np.allclose(found.vectors() @ u, expected, rtol=1e-10)


def test_beams_of_a_structure_are_those_of_a_frame():
    flat = clamped_frame()
    frame = fem.contact_points(flat, "arm", "-y", points=2, surface=0.05)
    arm = fem.assemble(
        fem.StructureModel(
            line(),
            {"arm": BEAM},
            supports=[fem.Support("root", ("x", "y", "z", *(f"rotation_{a}" for a in "xyz")))],
            interfaces={"tip": fem.Interface("tip", "y")},
        )
    )
    found = fem.contact_points(arm, "arm", "-y", points=2, surface=0.05)
    assert np.allclose(found.places, frame.places) and np.allclose(found.weights, frame.weights)
    u, v = (spsolve(each.stiffness, each.interfaces["tip"]) for each in (arm, flat))
    for along in ("x", "y"):
        assert np.allclose(found.vectors(along) @ u, frame.vectors(along) @ v, rtol=1e-9)


@pytest.mark.parametrize("kind", ["hexahedron", "hexahedron20", "hexahedron27"])
@pytest.mark.parametrize("points", [1, 2, 5])
def test_a_facet_of_four_sides_has_as_many_points_as_asked_for_in_each_direction(kind, points):
    found = fem.contact_points(block(kind), "z1", "z", points=points)
    assert len(found.places) == 6 * points**2
    if points == 1:
        assert np.allclose(found.places[:, :2] % [0.5, 0.2], [0.25, 0.1])  # middles


@pytest.mark.parametrize("kind", ["hexahedron", "hexahedron20", "tetra10", "wedge15"])
@pytest.mark.parametrize("points", [1, 2])
def test_points_of_a_face_move_as_it_does_and_weigh_what_it_measures(kind, points):
    body = block(kind)
    found = fem.contact_points(body, "z1", "z", points=points)
    assert np.isclose(found.weights.sum(), 0.6) and np.all(found.weights > 0.0)
    assert np.allclose(found.places[:, 2], 0.2)
    slope = np.array([[0.3, -0.2, 0.5], [0.1, 0.4, -0.6], [0.7, 0.2, 0.9]])
    nodes = np.arange(len(body.model.mesh.points))
    u = np.zeros(body.stiffness.shape[0])
    place = {int(dof): i for i, dof in enumerate(body.free)}
    for node, dofs in zip(nodes, body.numbering.dofs(nodes)[:, :3], strict=True):
        moved = slope @ body.model.mesh.points[node]
        for dof, value in zip(dofs, moved, strict=True):
            u[place[int(dof)]] = value
    assert np.allclose((found.motion @ u).reshape(-1, 3), found.places @ slope.T, atol=1e-13)


def test_pressure_on_a_plane_edge_is_carried_by_its_points():
    mesh = fem.box_mesh("body", (1.0, 0.2), (4, 1))
    part = fem.SolidPart(STEEL, "stress", 0.01)
    body = fem.assemble(
        fem.StructureModel(mesh, {"body": part}, supports=[fem.Support("y0", ("y",))])
    )
    found = fem.contact_points(body, "y1", "y", points=2)
    assert found.measure == "length" and np.isclose(found.weights.sum(), 1.0)
    load = found.weights @ found.vectors()

    u = np.linalg.lstsq(body.stiffness.toarray(), load, rcond=None)[0]
    assert np.allclose(found.vectors() @ u, 0.2 / (2e11 * 0.01), rtol=1e-8)  # uniaxial stress


@pytest.mark.parametrize("kind", ["line", "triangle", "triangle6", "quad", "quad8"])
@pytest.mark.parametrize("points", [1, 2, 5])
def test_rules_of_facets_have_positive_weights(kind, points):
    places, weights = rule(kind, points)
    assert np.all(weights > 0.0)
    assert np.isclose(weights.sum(), 0.5 if kind.startswith("tri") else 1.0)
    assert places.shape == (len(weights), KINDS[kind].dimension)


def test_what_makes_no_area_is_refused_in_a_sentence():
    arm, body = clamped_frame(), block()
    for component, at, direction, more, said in (
        (arm, "tip", "y", {}, "no outer face, edge or beam whose nodes are all in it"),
        (arm, "arm", "up", {}, "direction must be"),
        (arm, "arm", (0.0, 0.0, 0.0), {}, "direction must be"),
        (arm, "arm", "y", {"points": 0}, "points must be"),
        (arm, "arm", "z", {"points": 2}, "nothing of it moves along"),
        (arm, "root", "y", {"points": "nodes"}, "nothing of it moves along"),
        (body, "z1", "z", {"points": "nodes", "surface": 0.1}, "surface is for beams and shells"),
        (arm, "wing", "y", {}, "wing"),
        (body, "z1", "x", {}, "90 degrees off its direction"),
        (body, "z1", "z", {"surface": 0.1}, "surface is for beams and shells"),
    ):
        with pytest.raises(fem.ModelError, match=said):
            fem.contact_points(component, at, direction, **more)
    with pytest.raises(fem.ModelError, match="already"):
        arm.with_interfaces({"tip": arm.interfaces["tip"]})
    with pytest.raises(fem.ModelError, match="must have"):
        arm.with_interfaces({"other": np.ones(3)})


@pytest.mark.parametrize("plane", [True, False])
def test_points_opposite_on_other_beams_move_as_their_axis_does(plane):
    """The other cantilever is of two parts whose lines end elsewhere; it is pulled at its tip."""
    places = {"a": (0, 0), "b": (2, 0), "c": (0, 0.1), "m": (0.7, 0.1), "d": (2, 0.1)}
    members = [("low", "a", "b", 4), ("far", "m", "d", 3), ("near", "c", "m", 2)]
    mesh = fem.frame_mesh(places, members)
    high = np.union1d(mesh.nodes("far"), mesh.nodes("near"))
    turns = ("rotation",) if plane else ("z", *(f"rotation_{axis}" for axis in "xyz"))
    pair = fem.assemble(
        fem.StructureModel(
            mesh.with_point_sets({"high": high}),
            {name: BEAM for name in ("low", "far", "near")},
            supports=[fem.Support(end, ("x", "y", *turns)) for end in ("a", "c")],
            interfaces={"tip": fem.Interface("d", "y")},
            plane=plane,
        )
    )
    low = fem.contact_points(pair, "low", "y", points=3)
    found = fem.opposite_points(pair, low, "high").far
    x, stiffness = low.places[:, 0], 2e11 * 0.02 * 0.01**3 / 12.0
    assert np.allclose(found.places, low.places + np.array([0.0, 0.1, 0.0]), atol=1e-12)
    u = spsolve(pair.stiffness, pair.interfaces["tip"])
    assert np.allclose(found.vectors() @ u, x**2 * (6.0 - x) / (6.0 * stiffness), rtol=1e-9)
    assert not (low.vectors() @ u).any()
