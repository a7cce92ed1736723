"""Supports and couplings as a linear transformation from the free degrees of freedom to all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import sparse

from fem.beams import cross_matrix
from fem.cells import KINDS
from fem.errors import ModelError
from fem.mesh import FloatArray, IntArray
from fem.model import Support
from fem.scatter import SparseArray, dense_scatter
from fem.structure import AXES, IN_PLANE, Coupling, StructureModel, axis_index

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Numbering:
    """Which blocks of three degrees of freedom the nodes have.

    Parameters
    ----------
    translation, rotation
        Block of every node, shape (n,); -1 where it has none.
    hinged
        Block of the own rotations of every hinge, shape (h,).
    count
        Number of blocks.
    """

    translation: IntArray
    rotation: IntArray
    hinged: IntArray
    count: int

    def blocks(self, nodes: IntArray) -> IntArray:
        """Blocks (e, 2 b) of cells' nodes (e, b): moves and turns of the first, then the next."""
        found = np.stack([self.translation[nodes], self.rotation[nodes]], axis=-1)
        return np.asarray(found.reshape(len(nodes), -1), dtype=np.int64)

    def dofs(self, nodes: IntArray) -> IntArray:
        """The six degrees of freedom of nodes, (m, 6); -1 for those that they do not have."""
        blocks = np.stack([self.translation[nodes], self.rotation[nodes]], axis=-1)
        found = 3 * blocks[..., None] + np.arange(3)
        return np.where(blocks[..., None] < 0, -1, found).reshape(*np.shape(nodes), 6)


def number_blocks(model: StructureModel) -> Numbering:
    """Translations for all nodes of parts and coupled points; rotations where something turns."""
    count = len(model.mesh.points)
    moves, turns = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    for _, kinds in (*model.solids.values(), *model.trusses.values()):
        for nodes in kinds.values():
            moves[nodes] = True
    for _, lines in model.beams.values():
        turns[lines] = True
    for _, kinds in model.shells.values():
        for nodes in kinds.values():
            turns[nodes] = True
    for coupling in model.couplings:
        turns[model.mesh.node(coupling.point)] = True
    moves |= turns
    translation = np.where(moves, np.cumsum(moves) - 1, -1)
    first = int(moves.sum())
    rotation = np.where(turns, first + np.cumsum(turns) - 1, -1)
    first += int(turns.sum())
    hinged = first + np.arange(len(model.hinges))
    return Numbering(translation, rotation, hinged, first + len(model.hinges))


@dataclass(frozen=True, eq=False)
class Constraints:
    """Free, held and dependent degrees of freedom.

    Parameters
    ----------
    free, dependent
        Indices among all, shape (N,) and (s,).
    relation
        The dependent ones from the free ones, sparse (s, N).
    size
        Number of all degrees of freedom.
    """

    free: IntArray
    dependent: IntArray
    relation: SparseArray
    size: int

    def reduced(self, matrix: SparseArray) -> SparseArray:
        """TᵀAT of a symmetric matrix A of all degrees of freedom, T being `transformation`."""
        part = sparse.csr_array(matrix[self.free][:, self.free])
        if len(self.dependent):
            C = self.relation
            rows = sparse.csr_array(matrix[self.dependent])
            mixed = C.T @ rows[:, self.free]
            own = C.T @ rows[:, self.dependent] @ C
            part = sparse.csr_array(part + (mixed + mixed.T + own))
        part.eliminate_zeros()
        part.sort_indices()
        return part

    @cached_property
    def transformation(self) -> SparseArray:
        """All degrees of freedom from the free ones, sparse (size, N)."""
        N = len(self.free)
        unit = sparse.csr_array((np.ones(N), (self.free, np.arange(N))), shape=(self.size, N))
        spread = sparse.csr_array(
            (np.ones(len(self.dependent)), (self.dependent, np.arange(len(self.dependent)))),
            shape=(self.size, len(self.dependent)),
        )
        return sparse.csr_array(unit + spread @ self.relation)


def constrain(model: StructureModel, numbering: Numbering) -> Constraints:
    """Hold what is supported and eliminate what is coupled.

    Raises
    ------
    ModelError
        If nothing is left free, or a coupled direction is held, joined twice or joined in a
        circle.
    """
    size = 3 * numbering.count
    held = np.zeros(size, dtype=np.bool_)
    held[_held(model, numbering)] = True
    owner = np.full(size, -1)
    rows, columns, values = [], [], []
    for index, coupling in enumerate(model.couplings):
        slaves, masters, matrix = coupled(model, coupling, numbering)
        _check_coupling(model, index, slaves, held, owner)
        owner[slaves] = index
        at = np.nonzero(matrix)
        rows.append(slaves[at[0]])
        columns.append(masters[at[1]])
        values.append(matrix[at])
    free = np.flatnonzero(~held & (owner < 0))
    dependent = np.flatnonzero(owner >= 0)
    if len(free) == 0:
        raise ModelError(f"{model.mesh.source}: the supports hold every degree of freedom")
    if not len(dependent):
        none = sparse.csr_array((0, len(free)), dtype=np.float64)
        return Constraints(free, dependent, none, size)
    used = np.concatenate(columns)
    circle = np.flatnonzero(owner[used] >= 0)
    if len(circle):
        first = model.couplings[owner[np.concatenate(rows)[circle[0]]]]
        other = model.couplings[owner[used[circle[0]]]]
        raise ModelError(
            f"{model.mesh.source}: coupling of {first.face!r} to {first.point!r} rests on nodes"
            f" that the coupling of {other.face!r} to {other.point!r} moves; couple one of them to"
            " other nodes"
        )
    whole = sparse.csr_array(
        (np.concatenate(values), (np.concatenate(rows), used)), shape=(size, size)
    )
    return Constraints(free, dependent, sparse.csr_array(whole[dependent][:, free]), size)


def _check_coupling(
    model: StructureModel, index: int, slaves: IntArray, held: BoolArray, owner: IntArray
) -> None:
    coupling = model.couplings[index]
    what = f"{model.mesh.source}: coupling of {coupling.face!r} to {coupling.point!r}"
    if held[slaves].any():
        moved = "face" if coupling.kind == "rigid" else "point"
        raise ModelError(
            f"{what}: a support holds a direction of its {moved}, which the coupling determines;"
            " support the other side, or leave the direction out of the coupling"
        )
    taken = owner[slaves]
    if (taken >= 0).any():
        other = model.couplings[int(taken[taken >= 0][0])]
        raise ModelError(
            f"{what}: the coupling of {other.face!r} to {other.point!r} moves some of the same"
            " nodes already"
        )


def _held(model: StructureModel, numbering: Numbering) -> IntArray:
    held = []
    if model.is_plane:
        out = [axis_index(name) for name in AXES if name not in IN_PLANE]
        held.append(numbering.dofs(np.arange(len(model.mesh.points)))[:, out].ravel())
        held += [3 * numbering.hinged, 3 * numbering.hinged + 1]
    for support in model.supports:
        nodes = model.mesh.nodes(support.point)
        columns = [axis_index(direction) for direction in support.directions]
        dofs = numbering.dofs(nodes)[:, columns]
        if (dofs < 0).all():
            raise ModelError(
                f"{model.mesh.source}: support at {support.point!r} holds nothing: its nodes do"
                f" not have {' or '.join(support.directions)}"
            )
        _check_turns(model, support, nodes, dofs)
        held.append(dofs.ravel())
    found = np.unique(np.concatenate(held)) if held else np.zeros(0, dtype=np.int64)
    return found[found >= 0]


def _check_turns(
    model: StructureModel, support: Support, nodes: IntArray, dofs: IntArray
) -> None:
    """Rotations that no node has must be held by the translations: a face held in x cannot tip."""
    columns = [axis_index(direction) for direction in support.directions]
    lacking = [c for at, c in enumerate(columns) if (dofs[:, at] < 0).all()]
    if not lacking:
        return
    place = (model.mesh.points[nodes] - model.mesh.points[nodes].mean(axis=0)) / model.mesh.size
    shift = np.broadcast_to(np.eye(3), (len(nodes), 3, 3))
    motions = np.concatenate([shift, -cross_matrix(place)], axis=2)
    held = motions[:, [c for c in columns if c < 3]].reshape(-1, 6)
    prevented = np.diag(np.linalg.pinv(held, rcond=1e-6) @ held) > 1.0 - 1e-6
    for column in lacking:
        if not prevented[column]:
            raise ModelError(
                f"{model.mesh.source}: support at {support.point!r}: its nodes are of solids and"
                f" have no {AXES[column]}, and what else it holds does not prevent it; couple"
                " them to a point, and hold that"
            )


def coupled(
    model: StructureModel, coupling: Coupling, numbering: Numbering
) -> tuple[IntArray, IntArray, FloatArray]:
    """Dependent dofs (s,), independent dofs (m,) and the matrix (s, m) between them."""
    node = model.mesh.node(coupling.point)
    nodes = np.setdiff1d(model.mesh.nodes(coupling.face), [node])
    nodes = nodes[numbering.translation[nodes] >= 0]
    what = f"{model.mesh.source}: coupling of {coupling.face!r} to {coupling.point!r}"
    if len(nodes) == 0:
        raise ModelError(f"{what}: the face has no node of a part")
    axes = [axis_index(name) for name in IN_PLANE] if model.is_plane else list(range(6))
    translations = [axis for axis in axes if axis < 3]
    arms = model.mesh.points[nodes] - model.mesh.points[node]
    rigid = rigid_motions(arms)
    point_dofs = numbering.dofs(np.array([node]))[0]
    if coupling.kind == "averaging":
        mean = averaging(model, coupling, nodes, rigid, translations, axes, what)
        return point_dofs[axes], numbering.dofs(nodes)[:, translations].ravel(), mean
    follow = [axis_index(name) for name in coupling.directions]
    slaves, matrix = [], []
    for axis in (axis for axis in translations if axis in follow):
        slaves.append(numbering.dofs(nodes)[:, axis])
        matrix.append(rigid[:, axis][:, axes])
    turning = nodes[numbering.rotation[nodes] >= 0]
    if len(follow) == 3:
        for axis in (axis for axis in axes if axis > 2):
            slaves.append(numbering.dofs(turning)[:, axis])
            matrix.append(np.tile(np.eye(6)[axis][axes], (len(turning), 1)))
    return np.concatenate(slaves), point_dofs[axes], np.concatenate(matrix)


def rigid_motions(arms: FloatArray) -> FloatArray:
    """Translations of points at arms (m, 3) for the six rigid motions, shape (m, 3, 6)."""
    unit = np.broadcast_to(np.eye(3), (len(arms), 3, 3))
    return np.concatenate([unit, -cross_matrix(arms)], axis=2)


def averaging(
    model: StructureModel,
    coupling: Coupling,
    nodes: IntArray,
    rigid: FloatArray,
    translations: list[int],
    axes: list[int],
    what: str,
) -> FloatArray:
    """The rigid motion nearest to a face's: (RᵀWR)⁻¹RᵀW, shape (r, m d).

    R are the rigid motions at the nodes and W the integral over the face of the products of its
    shape functions, so that the mean is over the area and not over the nodes; where the nodes
    carry no facet (as on beams) all count the same.
    """
    R = rigid[:, translations][:, :, axes]
    WR = (face_products(model, coupling.face, nodes) @ R.reshape(len(nodes), -1)).reshape(R.shape)
    normal = np.einsum("mij,mik->jk", R, WR)
    scale = np.sqrt(np.diag(normal))
    if not (scale > 0.0).all() or np.linalg.cond(normal / np.outer(scale, scale)) > 1e10:
        raise ModelError(
            f"{what}: the nodes of the face lie on a line or a point, so that their mean rotation"
            " is not determined"
        )
    return np.asarray(np.linalg.solve(normal, WR.reshape(-1, len(axes)).T), dtype=np.float64)


def face_products(model: StructureModel, face: str, nodes: IntArray) -> SparseArray:
    """Integrals (m, m) of products of shape functions over a face; else the identity."""
    facets = model.facets_on(face)
    if not facets:
        return sparse.csr_array(sparse.eye_array(len(nodes)))
    position = np.full(len(model.mesh.points), -1)
    position[nodes] = np.arange(len(nodes))
    found = sparse.csr_array((len(nodes), len(nodes)))
    for kind, cells in facets.items():
        at = position[cells]
        inside = (at >= 0).all(axis=1)
        products = facet_products(kind, model.mesh.points[cells[inside]])
        found = sparse.csr_array(found + dense_scatter(products, at[inside], len(nodes)))
    return found


def facet_products(kind: str, coordinates: FloatArray) -> FloatArray:
    """Integrals over facets of products of shape functions, (f, k, k), in m² or m."""
    cell = KINDS[kind]
    places, weights = cell.quadrature
    values, reference = cell.basis(places)
    J = np.einsum("fbi,qbj->fqij", coordinates, reference)
    measure = np.sqrt(np.linalg.det(J.swapaxes(-1, -2) @ J))
    return np.asarray(
        np.einsum("fq,qa,qb->fab", measure * weights, values, values, optimize=True),
        dtype=np.float64,
    )
