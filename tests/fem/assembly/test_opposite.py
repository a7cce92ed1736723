"""Points that lie opposite to those of an area, on a mesh that does not match."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

import fem
from fem.mesh.cells import KINDS

STEEL = fem.Material(2e11, 7800.0, 0.3)
SLOPE = np.array([[0.3, -0.2, 0.5], [0.1, 0.4, -0.6], [0.7, 0.2, 0.9]])


def block(kind, counts, size=(1.0, 0.6, 0.2), shift=(0.0, 0.0, 0.0), held=()):
    mesh = fem.box_mesh("body", size, counts, kind=kind)
    mesh = mesh.with_points(mesh.points + np.array(shift))
    supports = [fem.Support(face, (face[0],)) for face in held]
    return fem.assemble(fem.StructureModel(mesh, {"body": fem.SolidPart(STEEL)}, supports=supports))


def moved(component, motion):
    """Displacements of the free degrees of freedom whose nodes move by a function of places."""
    points = component.model.mesh.points
    values = np.zeros(component.numbering.count * 3)
    values[component.numbering.dofs(np.arange(len(points)))[:, :3]] = motion(points)
    return values[component.free]


@pytest.mark.filterwarnings("ignore::fem.LockingWarning")
@pytest.mark.parametrize(
    "kind", ["hexahedron", "hexahedron20", "hexahedron27", "tetra", "tetra10", "wedge", "wedge15"]
)
def test_points_of_a_face_are_found_on_one_that_does_not_match_and_move_with_it(kind):
    """As the shape functions: of first order linear, of second order quadratic fields."""
    low = fem.contact_points(block("hexahedron20", (3, 2, 1)), "z1", "z", points=3)
    high = block(kind, (4, 5, 1), (1.3, 0.8, 0.2), (-0.2, -0.1, 0.25))
    pair = fem.opposite_points(high, low, "z0")
    assert pair.alone == 0 and pair.tilt < 1e-5  # rounding of an arc cosine
    assert np.allclose(pair.gaps, 0.05, atol=1e-14)
    assert np.allclose(pair.far.places - pair.near.places, [0.0, 0.0, 0.05], atol=1e-12)

    def field(x):
        square = np.stack([x[:, 0] ** 2, x[:, 0] * x[:, 1], x[:, 1] ** 2 - x[:, 0]], axis=1)
        return x @ SLOPE.T + (square if KINDS[kind].order == 2 else 0.0)

    found = (pair.far.motion @ moved(high, field)).reshape(-1, 3)
    assert np.allclose(found, field(pair.far.places), atol=1e-12)


def rigid(turn, shift):
    return lambda x: np.cross(turn, x) + shift


def pressed(low_counts, high_counts, points=2):
    """Two blocks under 1 Pa with a bed of springs between: its pair, and the pressure in it."""
    low = block("hexahedron20", low_counts, held=("x0", "y0", "z0"))
    high = block("hexahedron20", high_counts, shift=(0.0, 0.0, 0.2), held=("x0", "y0"))
    pair = fem.opposite_points(high, fem.contact_points(low, "z1", "z", points=points), "z0")
    bed = 1e12 * pair.near.weights
    opening = np.hstack([pair.near.vectors(), -pair.far.vectors()])
    K = sparse.block_diag([low.stiffness, high.stiffness]) + sparse.csr_array(
        opening.T @ (bed[:, None] * opening)
    )
    top = fem.contact_points(high, "z1", "z", points=2)
    load = np.append(np.zeros(low.stiffness.shape[0]), -top.weights @ top.vectors())
    return low, high, pair, 1e12 * (opening @ spsolve(sparse.csc_array(K), load))


@pytest.mark.parametrize("points", [2, 3])
def test_between_meshes_that_match_a_uniform_pressure_is_uniform(points):
    *_, pair, pressure = pressed((3, 2, 1), (3, 2, 2), points)
    assert np.all(pair.gaps == 0.0)
    assert np.abs(pressure - 1.0).max() < 1e-9


def test_between_meshes_that_do_not_match_the_resultant_is_exact_and_the_pressure_nearly():
    """Force and moments to rounding; the error at a point goes with what quadrature misses."""
    errors = []
    for points in (2, 6, 12):
        low, high, pair, pressure = pressed((3, 2, 1), (4, 3, 1), points)
        loads = [(pair.near.weights * pressure) @ side.vectors() for side in (pair.near, pair.far)]
        assert abs(pair.near.weights @ pressure - 0.6) < 1e-9
        for number in range(6):
            works = [
                load @ moved(body, rigid(*np.eye(6)[number].reshape(2, 3)))
                for load, body in zip(loads, (low, high), strict=True)
            ]
            assert abs(works[0] - works[1]) < 1e-12
        errors.append(np.abs(pressure - 1.0).max())
    assert errors[0] < 0.1 and errors[1] < 0.05 and errors[2] < 0.02


def test_points_beyond_the_other_surface_are_left_out_and_counted():
    low = fem.contact_points(block("hexahedron20", (4, 2, 1)), "z1", "z", points=2)
    pair = fem.opposite_points(block("hexahedron20", (3, 2, 1), shift=(0.5, 0.0, 0.19)), low, "z0")
    assert len(pair.gaps) == pair.alone == 16
    assert np.isclose(pair.near.weights.sum(), 0.3) and pair.near.places[:, 0].min() > 0.5
    assert np.allclose(pair.gaps, -0.01, atol=1e-14)  # they overlap


def test_a_surface_that_is_inclined_and_curved_is_met_where_it_is():
    """A parabola, which a quad8 has as it is: z = 0.25 + x²/50 + y/10."""
    high = block("hexahedron20", (2, 2, 1))
    x = high.model.mesh.points
    bent = x + np.stack([0.0 * x[:, 0], 0.0 * x[:, 0], 0.25 + x[:, 0] ** 2 / 50 + x[:, 1] / 10], 1)
    high = fem.assemble(replace(high.model, mesh=high.model.mesh.with_points(bent)))
    low = fem.contact_points(block("hexahedron20", (3, 2, 1)), "z1", "z", points=3)
    pair = fem.opposite_points(high, low, "z0")
    x, y, z = pair.near.places.T
    assert np.allclose(pair.gaps, 0.25 + x**2 / 50 + y / 10 - z, atol=1e-12)
    slope = np.hypot(x.max() / 25, 0.1)
    assert np.isclose(pair.tilt, np.degrees(np.arctan(slope)), rtol=1e-9)


def plates(shift, **more):
    """A plate of shells 2 mm thick."""
    mesh = fem.box_mesh("plate", (1.0, 0.6), (3, 2), kind="quad")
    mesh = mesh.with_points(mesh.points + np.array([0.0, 0.0, shift]))
    return fem.assemble(fem.StructureModel(mesh, {"plate": fem.ShellPart(STEEL, 0.002)}, **more))


def test_the_surface_of_shells_is_off_their_middle_and_turns_with_it():
    low, high = plates(0.0), plates(0.003)
    near = fem.contact_points(low, "plate", "z", points=2, surface=0.001)
    pair = fem.opposite_points(high, near, "plate", surface=0.001)
    assert np.allclose(pair.gaps, 0.001, atol=1e-15)
    turn = np.array([0.3, -0.2, 0.0])
    for side, body in ((pair.near, low), (pair.far, high)):
        points = body.model.mesh.points
        values = np.zeros(3 * body.numbering.count)
        values[body.numbering.dofs(np.arange(len(points)))] = np.hstack(
            [np.cross(turn, points), np.broadcast_to(turn, points.shape)]
        )
        moves = (side.motion @ values[body.free]).reshape(-1, 3)
        assert np.allclose(moves, np.cross(turn, side.places), atol=1e-14)


def test_edges_in_the_plane_face_each_other():
    sheets = []
    for counts, shift in (((4, 1), 0.0), ((3, 1), 0.21)):
        mesh = fem.box_mesh("sheet", (1.0, 0.2), counts)
        mesh = mesh.with_points(mesh.points + np.array([0.0, shift, 0.0]))
        part = {"sheet": fem.SolidPart(STEEL, "stress", 0.01)}
        sheets.append(fem.assemble(fem.StructureModel(mesh, part)))
    low, high = sheets
    pair = fem.opposite_points(high, fem.contact_points(low, "y1", "y", points=3), "y0")
    assert len(pair.gaps) == 12 and np.allclose(pair.gaps, 0.01, atol=1e-14)
    assert np.allclose(pair.far.vectors().sum(axis=1), 1.0)
    with pytest.raises(fem.ModelError, match="faces away"):
        fem.opposite_points(high, fem.contact_points(low, "y1", "-y", points=3), "y0")


def test_what_does_not_face_the_area_is_refused_in_a_sentence():
    low = block("hexahedron20", (2, 2, 1))
    high = block("hexahedron20", (3, 2, 1), shift=(0.0, 0.0, 0.25))
    far = block("hexahedron20", (3, 2, 1), shift=(3.0, 0.0, 0.25))
    up, down = (fem.contact_points(low, "z1", way, points=1) for way in ("z", "-z"))
    for component, points, at, more, said in (
        (high, down, "z0", {}, "faces away"),
        (high, up, "z1", {}, "faces away"),
        (high, up, "x0", {}, "nothing of that lies opposite to any of its 4 points"),
        (far, up, "z0", {}, "nothing of that lies opposite"),
        (high, up, "lid", {}, "lid"),
        (high, up, "z0", {"surface": 0.1}, "surface is for beams and shells"),
        (plates(-0.1), up, "plate", {}, "lies behind the points, by 0.3 m"),
    ):
        with pytest.raises(fem.ModelError, match=said):
            fem.opposite_points(component, points, at, **more)
