"""Cells that are out of shape, and neighbours that do not fit together."""

import warnings

import numpy as np
import pytest
from mixed import FAMILIES, mixed_block
from structures import STEEL

import fem
from fem.checks.conforming import check_conforming
from fem.checks.distorted import aspects, distortion_warnings, least_volumes, warps
from fem.mesh.cells import KINDS


def model_of(mesh):
    return fem.StructureModel(mesh, {name: fem.SolidPart(STEEL) for name in mesh.groups})


def side_by_side(kind, other, counts=(1, 1, 1)):
    left = fem.box_mesh("left", (1.0, 1.0, 1.0), counts, kind=kind)
    right = fem.box_mesh("right", (1.0, 1.0, 1.0), counts, kind=other, origin=(1.0, 0.0, 0.0))
    return model_of(fem.joined([left, right]))


@pytest.mark.parametrize(
    ("kind", "other", "said"),
    [
        ("hexahedron", "hexahedron20", r"1 faces; the first, at \(1, 0.5, 0.5\), is a quad on one"),
        ("hexahedron20", "hexahedron27", "is a quad8 on one side and a quad9 on the other"),
        ("hexahedron20", "wedge18", "is a quad8 on one side and a quad9 on the other"),
        ("tetra", "tetra10", "2 faces; .* is a triangle on one side and a triangle6 on the other"),
        ("hexahedron", "tetra", "is a quad on one side and two triangles on the other"),
        ("pyramid13", "tetra10", "is a quad8 on one side and two triangles on the other"),
    ],
)
def test_neighbours_that_do_not_fit_are_refused_with_the_place(kind, other, said):
    with pytest.raises(fem.ModelError, match=f"cells do not fit together at .*{said}"):
        fem.assemble(side_by_side(kind, other))


@pytest.mark.parametrize(
    ("kind", "other"),
    [("hexahedron", "wedge"), ("hexahedron20", "pyramid13"), ("wedge18", "hexahedron27")],
)
def test_neighbours_of_one_family_fit(kind, other):
    check_conforming(side_by_side(kind, other, (2, 2, 2)))


@pytest.mark.parametrize("family", FAMILIES)
def test_all_shapes_of_a_family_fit(family):
    check_conforming(model_of(mixed_block(family)))


def test_a_crack_between_the_nodes_of_edges_is_found():
    """Corners are joined, the node in the middle of an edge is there twice."""
    mesh = fem.box_mesh("bar", (2.0, 1.0, 1.0), (2, 1, 1), source="bar.msh")
    cells = mesh.cells["hexahedron20"].copy()
    own = np.setdiff1d(np.intersect1d(cells[0], cells[1]), cells[:, :8])
    cells[1][cells[1] == own[0]] = len(mesh.points)
    points = np.vstack([mesh.points, mesh.points[own[0]]])
    cracked = fem.StructureMesh(points, {"hexahedron20": cells}, mesh.groups, {}, "bar.msh")
    with pytest.raises(fem.ModelError, match=r"bar.msh: .* 1 faces; .* with other nodes between"):
        fem.assemble(model_of(cracked))


def test_sheets_of_different_order_do_not_fit():
    left = fem.box_mesh("left", (1.0, 1.0), (1, 1), kind="quad")
    right = fem.box_mesh("right", (1.0, 1.0), (1, 1), kind="quad8", origin=(1.0, 0.0, 0.0))
    sheet = fem.SolidPart(STEEL, "stress", 0.1)
    model = fem.StructureModel(fem.joined([left, right]), {"left": sheet, "right": sheet})
    with pytest.raises(fem.ModelError, match="is a line on one side and a line3 on the other"):
        fem.assemble(model)


def test_measures_of_known_cells():
    cube, quad = KINDS["hexahedron"], KINDS["quad"]
    stretched = cube.corners * [4.0, 1.0, 2.0]
    assert aspects(cube, stretched[None])[0] == pytest.approx(4.0)
    assert least_volumes(cube, stretched[None])[0] == pytest.approx(1.0)
    # a trapezium of heights 1 and 1/4: the map stretches a quarter as much at its narrow end
    narrow = quad.corners * 1.0
    narrow[2, 1] = 0.25
    assert least_volumes(quad, narrow[None])[0] == pytest.approx(0.25)
    # one corner lifted by the side: along one diagonal the halves meet at acos(1/sqrt(3)), along
    # the other at acos(1/2), which is more
    lifted = cube.corners * 1.0
    lifted[6, 2] += 1.0
    assert warps(cube, lifted[None])[0] == pytest.approx(60.0)
    assert warps(cube, cube.corners[None])[0] == 0.0


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda c: c * [1, 1, 40], "has 1 hexahedron out of 2 with edges of very different length"),
        (lambda c: c + (c[:, :1] == 2) * (c[:, 1:2] == 1) * (c[:, 2:] == 1) * [-0.98, 0, 0],
         "has 1 hexahedron out of 2 whose mapping has almost no volume"),
        (lambda c: c + (c[:, :1] == 2) * (c[:, 1:2] == 1) * (c[:, 2:] == 1) * [0, 0, 2],
         "has 1 hexahedron out of 2 with faces that are far from flat"),
    ],
)  # fmt: skip
def test_cells_out_of_shape_are_told_with_number_and_place(spoil, said):
    mesh = fem.box_mesh("bar", (2.0, 1.0, 1.0), (2, 1, 1), kind="hexahedron", source="bar.msh")
    points, second = mesh.points.copy(), np.unique(mesh.cells["hexahedron"][1])
    changed = spoil(mesh.points)
    points[second] = changed[second]
    if "edges" in said:
        points[mesh.points[:, 0] == 1.0] = mesh.points[mesh.points[:, 0] == 1.0]
    found = list(distortion_warnings(model_of(mesh.with_points(points))))
    assert any(said in text and "the worst is hexahedron 1 at (" in text for text in found), found
    assert all(text.startswith("bar.msh: part 'bar' ") for text in found)


def test_assembling_warns_of_cells_out_of_shape_and_not_of_good_ones():
    mesh = fem.box_mesh("bar", (40.0, 1.0, 1.0), (1, 1, 1))
    with pytest.warns(fem.DistortionWarning, match=r"1 hexahedron20 .* up to 40 to 1; the w"):
        fem.assemble(model_of(mesh))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fem.assemble(model_of(fem.box_mesh("bar", (4.0, 1.0, 1.0), (4, 1, 1))))


@pytest.mark.parametrize("kind", ["quad9", "pyramid14", "wedge18", "hexahedron27"])
def test_nodes_on_faces_in_another_order_are_found_out(kind):
    dimension = KINDS[kind].dimension
    mesh = fem.box_mesh("b", (3.0, 1.0, 0.1)[:dimension], (1, 1, 1)[:dimension], kind=kind)
    points = mesh.points.copy()
    points[:, 2 if dimension == 3 else 1] += 0.3 * np.sin(points[:, 0])
    curved = mesh.with_points(points)
    order = np.arange(KINDS[kind].node_count)
    first = order[-1] if kind in ("quad9", "pyramid14") else order[-2]
    order[[first, first - 1]] = order[[first - 1, first]]
    with pytest.raises(fem.ModelError, match=rf"{kind} 0 at .* not (near|in) the middle"):
        fem.StructureMesh(curved.points, {kind: curved.cells[kind][:, order]})
