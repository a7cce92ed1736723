"""Blocks in which hexahedra, wedges, pyramids and tetrahedra meet face to face, as patches."""

import numpy as np
from scipy.sparse.linalg import spsolve

import fem
from fem.mesh.cells import CUBE, KINDS
from fem.mesh.structure_mesh import _UNIT_CORNERS, PYRAMID, TETRAHEDRON, WEDGE

FAMILIES = {
    "first order": ("hexahedron", "wedge", "pyramid", "tetra"),
    "serendipity": ("hexahedron20", "wedge15", "pyramid13", "tetra10"),
    "complete": ("hexahedron27", "wedge18", "pyramid14", "tetra10"),
}


def corner_cells(layers):
    """Corners (e, c, 3) of cells by shape: hexahedra beside wedges, pyramids beside tetrahedra.

    Above the wedges there are six tetrahedra in a box, which have their diagonals; beside those
    a box of five pyramids, and of two tetrahedra with the diagonal of the six.
    """
    x, z = np.eye(3)[0], np.eye(3)[2]
    pyramids = _UNIT_CORNERS[PYRAMID] + z
    right = (pyramids[:, :4, 0] == 1.0).all(axis=1)
    (base, apex), ends = (pyramids[right][0][:4], pyramids[right][0][4]), ([1, 0, 1], [1, 1, 2])
    others = [p for p in base if p.tolist() not in ends]
    split = np.array([[*ends, other, apex] for other in others])
    once = {
        "hexahedron": CUBE.corners[None],
        "wedge": _UNIT_CORNERS[WEDGE] + x,
        "pyramid": pyramids[~right],
        "tetra": np.concatenate([_UNIT_CORNERS[TETRAHEDRON] + x + z, split]),
    }
    shift = np.eye(3)[1]
    return {
        name: np.concatenate([cells + k * shift for k in range(layers)])
        for name, cells in once.items()
    }


def mixed_block(family, move=lambda corners: corners, layers=2, source="mixed"):
    """A mesh of all four shapes; ``move`` takes the corners (p, 3) to where they shall be."""
    cells = corner_cells(layers)
    flat = np.concatenate([c.reshape(-1, 3) for c in cells.values()])
    unique, number = np.unique(flat, axis=0, return_inverse=True)
    moved, first, places, kinds = move(unique)[number], 0, [], {}
    for corners, name in zip(cells.values(), FAMILIES[family], strict=True):
        count = corners.shape[0] * corners.shape[1]
        filled = KINDS[name].filled(moved[first : first + count].reshape(corners.shape))
        first += count
        kinds[name] = len(filled), KINDS[name].node_count
        places.append(filled.reshape(-1, 3))
    _, kept, index = np.unique(
        np.concatenate(places).round(9), axis=0, return_index=True, return_inverse=True
    )
    points, cells, first = np.concatenate(places)[kept], {}, 0
    for name, (count, nodes) in kinds.items():
        cells[name] = index[first : first + count * nodes].reshape(count, nodes)
        first += count * nodes
    return fem.StructureMesh(
        points, cells, {"body": {name: np.arange(len(c)) for name, c in cells.items()}}, {}, source
    )


def inner_nodes(component):
    """Nodes that are on no outer face."""
    outer = [nodes.ravel() for nodes in component.model.facets.values()]
    return np.setdiff1d(np.arange(len(component.model.mesh.points)), np.concatenate(outer))


STRETCH = np.array([[0.3, -0.2, 0.5], [0.1, 0.4, -0.6], [0.7, 0.2, 0.1]])
"""A linear displacement of points (n, 3), by ``points @ STRETCH``."""


def jiggled(corners):
    """Corners inside move by up to a sixth of a cell in each direction, those outside too."""
    return corners + np.random.default_rng(3).uniform(-0.12, 0.12, corners.shape)


def patch_error(component, exact):
    """Greatest error of the nodes inside, with exact displacements (n, 3) outside, by the largest.

    There must be three nodes inside at least.
    """
    inner = np.zeros(len(exact), dtype=bool)
    inner[inner_nodes(component)] = True
    assert inner.sum() >= 3
    free = np.repeat(inner, 3)
    K = component.stiffness.tocsr()
    found = spsolve(K[free][:, free].tocsc(), -K[free][:, ~free] @ exact.ravel()[~free])
    return np.abs(found - exact.ravel()[free]).max() / np.abs(exact).max()
