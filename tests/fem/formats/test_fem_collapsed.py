"""Hexahedra and other cells with repeated nodes, and cells that are out of shape."""

import warnings
from itertools import permutations

import meshio
import numpy as np
import pytest
from structures import CLAMP, STEEL, lowest_hz

import fem
from fem.elements.solids import gradients_and_volumes, stiffness_matrices
from fem.formats.collapsed import SECOND_ORDER, _symmetries, uncollapsed
from fem.mesh.cells import KINDS
from fem.mesh.wedges import pyramid_rule

CUBE = KINDS["hexahedron"]
PATTERNS = {
    "wedge": [(0, 1, 2, 2, 4, 5, 6, 6), (0, 0, 2, 3, 4, 4, 6, 7), (0, 1, 2, 3, 0, 1, 6, 7)],
    "pyramid": [(0, 1, 2, 3, 4, 4, 4, 4), (0, 0, 0, 0, 4, 5, 6, 7), (0, 1, 2, 2, 4, 5, 2, 2),
                (0, 1, 2, 2, 0, 5, 6, 6)],
    "tetra": [(0, 1, 2, 2, 4, 4, 4, 4), (0, 1, 1, 0, 4, 4, 6, 6), (0, 1, 2, 2, 0, 1, 6, 6)],
}  # fmt: skip
CASES = [(kind, pattern) for kind, patterns in PATTERNS.items() for pattern in patterns]


def gauss(kind, count):
    """Places and weights of many points; the cube is collapsed to a tetrahedron or halved."""
    s, w = np.polynomial.legendre.leggauss(count)
    s, w = (s + 1) / 2, w / 2
    x, y, z = (g.ravel() for g in np.meshgrid(s, s, s))
    weights = np.einsum("i,j,k->ijk", w, w, w).ravel()
    if kind == "hexahedron":
        return np.column_stack([x, y, z]), weights
    if kind == "wedge":
        return np.column_stack([x, y * (1 - x), z]), weights * (1 - x)
    if kind == "pyramid":
        return pyramid_rule(2 * count - 2)
    return np.column_stack([x, y * (1 - x), z * (1 - x) * (1 - y)]), weights * (1 - x) ** 2 * (
        1 - y
    )


def finely_integrated(kind, coordinates, count=14):
    places, weights = gauss(kind, count)
    gradients, volumes = gradients_and_volumes(KINDS[kind], coordinates[None], places)
    assert (volumes * np.sign(volumes[0, 0]) > 0).all()
    return stiffness_matrices(gradients, np.abs(volumes) * weights, (1.2, 0.8))[0]


def summed(matrix, nodes, size):
    """Element matrix (b, 3, b, 3) on the nodes of a mesh, repeated ones united."""
    total = np.zeros((size, 3, size, 3))
    for a, i in enumerate(nodes):
        for b, j in enumerate(nodes):
            total[i, :, j] += matrix[a, :, b]
    return total


@pytest.mark.parametrize(("kind", "pattern"), CASES)
def test_a_collapsed_hexahedron_is_exactly_what_it_is_taken_as(kind, pattern):
    """The matrix of the collapsed map, finely integrated, is that of the cell it is taken as."""
    points = CUBE.corners + np.random.default_rng(1).uniform(-0.15, 0.15, (8, 3))
    for group in set(pattern):
        alike = [i for i in range(8) if pattern[i] == group]
        points[group] = points[alike].mean(axis=0)
    cells, _, notes = uncollapsed(points, {"hexahedron": np.array([pattern])}, {}, "mesh")
    assert list(cells) == [kind] and "1 hexahedron with repeated nodes is taken as" in notes[0]
    collapsed = finely_integrated("hexahedron", points[list(pattern)], 30)
    taken = finely_integrated(kind, points[cells[kind][0]])
    there = summed(collapsed, pattern, 8), summed(taken, cells[kind][0], 8)
    assert np.abs(there[0] - there[1]).max() < 1e-8 * np.abs(there[1]).max()


@pytest.mark.parametrize(("kind", "pattern"), CASES)
def test_it_does_not_matter_where_a_hexahedron_begins(kind, pattern):
    """All 48 ways to number it, also mirrored, and those with twenty nodes, give one cell."""
    points = CUBE.corners @ (np.eye(3) + np.random.default_rng(2).uniform(-0.2, 0.2, (3, 3)))
    found = []
    for turned in _symmetries("hexahedron"):
        cell = np.array([[pattern[i] for i in turned]])
        cells, _, _ = uncollapsed(points, {"hexahedron": cell}, {}, "mesh")
        assert list(cells) == [kind]
        own = points[cells[kind][0]]
        found.append(summed(finely_integrated(kind, own, 4), cells[kind][0], 8))
        names = twenty(cell[0])
        number = {name: n for n, name in enumerate(dict.fromkeys(names))}
        of_twenty = np.array([[number[name] for name in names]])
        found_20, _, _ = uncollapsed(np.zeros((20, 3)), {"hexahedron20": of_twenty}, {}, "mesh")
        assert list(found_20) == [SECOND_ORDER[kind]]
    assert np.abs(np.array(found) - found[0]).max() < 1e-12 * np.abs(found[0]).max()


def twenty(cell):
    """Nodes of hexahedra of second order by the names (pairs of corners) of their edges' nodes."""
    return [*cell, *((min(cell[a], cell[b]), max(cell[a], cell[b])) if cell[a] != cell[b]
                     else cell[a] for a, b in CUBE.edges)]  # fmt: skip


@pytest.mark.parametrize(("kind", "pattern"), CASES)
def test_with_twenty_nodes_each_edge_keeps_its_own(kind, pattern):
    names = twenty(pattern)
    number = {name: n for n, name in enumerate(dict.fromkeys(names))}
    cell = np.array([[number[name] for name in names]])
    target = SECOND_ORDER[kind]
    cells, _, _ = uncollapsed(np.zeros((20, 3)), {"hexahedron20": cell}, {}, "mesh")
    assert list(cells) == [target] and set(cells[target][0]) == set(number.values())
    back = dict(enumerate(number))
    corners = len(KINDS[kind].corners)
    for (a, b), middle in zip(KINDS[kind].edges, cells[target][0][corners:], strict=True):
        assert back[middle] == tuple(sorted((back[cells[target][0][a]], back[cells[target][0][b]])))


def collapsed_bar(kind, wedge, counts):
    """A bar whose second half is of wedges: written as hexahedra, as such, and all of hexahedra."""
    lengths = (0.5, 0.12, 0.1)
    left = fem.box_mesh("bar", lengths, counts, kind=kind)
    right = fem.box_mesh("bar", lengths, counts, kind=wedge, origin=(0.5, 0.0, 0.0))
    true = fem.joined([left, right])
    local = [0, 1, 2, 2, 3, 4, 5, 5]
    if wedge == "wedge15":
        local += [6, 7, 2, 8, 9, 10, 5, 11, 12, 13, 14, 14]
    whole = fem.box_mesh("bar", (1.0, 0.12, 0.1), (2 * counts[0], *counts[1:]), kind=kind)
    data = np.concatenate([true.cells[kind], true.cells[wedge][:, local]])
    content = meshio.Mesh(true.points, [(kind, data)], cell_data={"set:bar": [np.ones(len(data))]},
                          point_sets={"x0": true.nodes("x0")})  # fmt: skip
    root = np.flatnonzero(true.points[:, 0] == 0.0)
    content.point_sets["x0"] = root
    return content, true.with_point_sets({"x0": root}), whole


def held_hz(mesh):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fem.LockingWarning)
        model = fem.StructureModel(mesh, {"bar": fem.SolidPart(STEEL)}, [fem.Support("x0", CLAMP)])
        return lowest_hz(fem.assemble(model), 4)


@pytest.mark.parametrize(
    ("kind", "wedge", "within"), [("hexahedron", "wedge", 0.015), ("hexahedron20", "wedge15", 5e-4)]
)
def test_a_bar_of_hexahedra_and_wedges_swings_as_one_of_hexahedra(kind, wedge, within):
    content, true, whole = collapsed_bar(kind, wedge, (8, 2, 2))
    mesh = fem.from_meshio(content, "bar.inp")
    assert {k: len(c) for k, c in mesh.cells.items()} == {kind: 32, wedge: 64}
    assert mesh.notes == (f"bar.inp: 64 {kind} with repeated nodes are taken as 64 {wedge}",)
    assert {k: len(c) for k, c in mesh.part("bar").items()} == {kind: 32, wedge: 64}
    own = held_hz(mesh)
    np.testing.assert_allclose(own, held_hz(true), rtol=1e-9)
    np.testing.assert_allclose(own[:2], held_hz(whole)[:2], rtol=within)


def test_groups_follow_when_cells_change_their_kind():
    """Every cell of a group is in it after, wherever it stands then."""
    plain = fem.box_mesh("plate", (4.0, 1.0), (4, 1), kind="quad")
    cells = plain.cells["quad"].copy()
    cells[1, 3], cells[2, 0] = cells[1, 2], cells[2, 1]
    groups = {"odd": {"quad": np.array([1, 3])}, "even": {"quad": np.array([0, 2])}}
    found, named, notes = uncollapsed(plain.points, {"quad": cells}, groups, "mesh")
    assert {kind: len(nodes) for kind, nodes in found.items()} == {"quad": 2, "triangle": 2}
    assert found["quad"].tolist() == [cells[0].tolist(), cells[3].tolist()]
    by_set = {frozenset(nodes) for nodes in found["triangle"][named["odd"]["triangle"]].tolist()}
    assert by_set == {frozenset(cells[1].tolist())}
    assert named["odd"]["quad"].tolist() == [1] and named["even"]["quad"].tolist() == [0]
    assert set(found["triangle"][named["even"]["triangle"][0]]) == set(cells[2].tolist())
    assert notes == ["mesh: 2 quad with repeated nodes are taken as 2 triangle"]


def one_cell(kind, nodes, points):
    content = meshio.Mesh(points, [(kind, [nodes])], cell_data={"set:body": [[1]]})
    return fem.from_meshio(content, "cell.inp")


def test_what_repeated_nodes_do_not_make_a_cell_is_refused():
    points = fem.box_mesh("b", (1.0, 1.0, 1.0), (1, 1, 1)).points
    eight = fem.box_mesh("b", (1.0, 1.0, 1.0), (1, 1, 1), kind="hexahedron")
    cell = eight.cells["hexahedron"][0]
    one_edge = [*cell[:3], cell[2], *cell[4:]]
    with pytest.raises(fem.ModelError, match=r"hexahedron 0 at \(.*\) has repeated nodes, but"):
        one_cell("hexahedron", one_edge, eight.points)
    flat = [*cell[:4], cell[0], *cell[5:]]
    assert list(one_cell("hexahedron", [*cell[:2], cell[2], cell[2], *cell[4:7], cell[6]],
                         eight.points).cells) == ["wedge"]  # fmt: skip
    with pytest.raises(fem.ModelError, match="has repeated nodes"):
        one_cell("hexahedron", flat, eight.points)
    names = twenty((0, 1, 2, 2, 4, 5, 6, 6))
    number = {name: n for n, name in enumerate(dict.fromkeys(names))}
    twenty_nodes = [number[name] for name in names]
    twenty_nodes[19] = 19  # two middles of what is one edge
    with pytest.raises(fem.ModelError, match=r"hexahedron20 0 at .* has repeated nodes"):
        one_cell("hexahedron20", twenty_nodes, points)


def test_nodes_at_one_place_are_told_by_cell_and_place():
    mesh = fem.box_mesh("b", (2.0, 1.0, 1.0), (2, 1, 1), kind="hexahedron", source="b.inp")
    points = mesh.points.copy()
    points[mesh.cells["hexahedron"][1, 3]] = points[mesh.cells["hexahedron"][1, 2]]
    with pytest.raises(fem.ModelError, match=r"b\.inp: hexahedron [01] at .* nodes .* at one pl"):
        mesh.with_points(points)


def test_there_are_as_many_ways_to_number_a_shape_as_it_has_symmetries():
    counts = {shape: len(_symmetries(shape)) for shape in SECOND_ORDER}
    assert counts == {"triangle": 6, "quad": 8, "tetra": 24, "pyramid": 8, "wedge": 12,
                      "hexahedron": 48}  # fmt: skip
    assert len(list(permutations(range(4)))) == counts["tetra"]
