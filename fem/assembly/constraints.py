"""Supports and couplings as a linear transformation from the free degrees of freedom to all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import sparse

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.beams import cross_matrix
from fem.elements.scatter import SparseArray, dense_scatter
from fem.mesh.attachments import Coupling, Support
from fem.mesh.cells import KINDS, measures
from fem.model.structure import AXES, IN_PLANE, StructureModel, axis_index

CANCELLED = 1e-12  # of the largest: a coefficient that is rounding
ALIGNED = 1e10  # condition of a support's moments of area, from which its nodes lie on a line
FREE = 1e-6  # of the mesh: a motion against which supports have no more arm than so is free


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
    """Translations for all nodes of parts and coupled points; rotations where something turns.

    In a frame in the plane they follow each other node by node, else all rotations come last.
    """
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
    _number_attached(model, moves | turns, moves, turns)
    moves |= turns
    node_by_node = model.plane and not model.solids
    has = np.stack([moves, turns], axis=1 if node_by_node else 0)
    numbers = np.where(has, np.cumsum(has).reshape(has.shape) - 1, -1)
    translation, rotation = numbers.T if node_by_node else numbers
    count = int(has.sum())
    hinged = count + np.arange(len(model.hinges))
    return Numbering(translation, rotation, hinged, count + len(model.hinges))


def _number_attached(
    model: StructureModel, on_parts: BoolArray, moves: BoolArray, turns: BoolArray
) -> None:
    """Coupled points turn; nodes on no part move, and turn where what the file attaches does."""
    for coupling in model.attached.couplings:
        turns[model.mesh.node(coupling.point)] = True
    brought = model.mesh.attachments
    masses = brought.point_masses
    used = [(m.point, bool(np.any(m.rotary_inertia) or any(m.offset))) for m in masses]
    used += [
        (point, way.startswith("rotation"))
        for link in brought.links
        for point, way in zip(link.points, link.directions or ("x", "x"), strict=True)
    ]
    used += [(p, way.startswith("rotation")) for e in brought.equations for p, way, _ in e.terms]
    used += [(p, way.startswith("rotation")) for m in brought.matrices for p, way in m.terms]
    for point, turning in used:
        node = model.mesh.node(point)
        moves[node] = True
        turns[node] |= turning and not on_parts[node]
    for name in brought.turning:
        turns[model.mesh.nodes(name)] = True


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

    def holding(self, more: BoolArray) -> Constraints:
        """The same with some of the free ones held, too, given by a mask (N,)."""
        relation = sparse.csr_array(self.relation[:, ~more])
        return Constraints(self.free[~more], self.dependent, relation, self.size)

    @cached_property
    def transformation(self) -> SparseArray:
        """All degrees of freedom from the free ones, sparse (size, N)."""
        N = len(self.free)
        unit = sparse.csr_array((np.ones(N), (self.free, np.arange(N))), shape=(self.size, N))
        if not len(self.dependent):
            return unit
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
    couplings = model.attached.couplings
    size = 3 * numbering.count
    held = np.zeros(size, dtype=np.bool_)
    held[_held(model, numbering)] = True
    owner = np.full(size, -1)
    rows, columns, values = [], [], []
    for index, coupling in enumerate(couplings):
        slaves, masters, matrix = coupled(model, coupling, numbering)
        _check_coupling(model, index, slaves, held, owner)
        owner[slaves] = index
        at = np.nonzero(matrix)
        rows.append(slaves[at[0]])
        columns.append(masters[at[1]])
        values.append(matrix[at])
    entries = [
        np.concatenate([*each, np.zeros(0, kind)])
        for each, kind in ((values, np.float64), (rows, np.int64), (columns, np.int64))
    ]
    whole = sparse.csr_array((entries[0], (entries[1], entries[2])), shape=(size, size))
    used = entries[2]
    circle = np.flatnonzero(owner[used] >= 0)
    if len(circle):
        first = couplings[owner[entries[1][circle[0]]]]
        other = couplings[owner[used[circle[0]]]]
        raise ModelError(
            f"{model.mesh.source}: coupling of {first.face!r} to {first.point!r} rests on nodes"
            f" that the coupling of {other.face!r} to {other.point!r} moves; couple one of them to"
            " other nodes"
        )
    solved = solved_equations(model, numbering, held, owner, whole)
    owner[list(solved)] = len(couplings)
    free = np.flatnonzero(~held & (owner < 0))
    dependent = np.flatnonzero(owner >= 0)
    if len(free) == 0:
        raise ModelError(f"{model.mesh.source}: the supports hold every degree of freedom")
    whole = sparse.csr_array(whole + equation_rows(solved, size))
    return Constraints(free, dependent, _relation(whole, free, dependent), size)


def _relation(whole: SparseArray, free: IntArray, dependent: IntArray) -> SparseArray:
    """The dependent degrees of freedom from the free ones, where some rest on others."""
    found = whole[dependent]
    while len(dependent) and found[:, dependent].nnz:
        chained = sparse.csr_array(found[:, dependent] @ whole[dependent])
        kept = np.ones(whole.shape[1])
        kept[dependent] = 0.0
        found = sparse.csr_array(found @ sparse.diags_array(kept) + chained)
        found.eliminate_zeros()
    return sparse.csr_array(found[:, free])


Form = dict[int, float]


def solved_equations(
    model: StructureModel,
    numbering: Numbering,
    held: BoolArray,
    owner: IntArray,
    coupled_rows: SparseArray,
) -> dict[int, Form]:
    """Every equation of the mesh solved for one degree of freedom, in terms of others.

    What earlier equations and the couplings determine is put in, and what is held is zero. An
    equation that then says nothing is fulfilled already.
    """
    solved: dict[int, Form] = {}
    for equation in model.attached.equations:
        given: Form = {}
        for point, direction, coefficient in equation.terms:
            dof = point_dof(model, numbering, point, direction)
            given[dof] = given.get(dof, 0.0) + coefficient
        size = max(map(abs, given.values()))
        form = _put_in(given, solved, owner, coupled_rows)
        form = {d: c for d, c in form.items() if not held[d] and abs(c) > CANCELLED * size}
        if form:
            first = next(iter(given))
            pivot = first if first in form else max(form, key=lambda dof: abs(form[dof]))
            divisor = -form.pop(pivot)
            solved[pivot] = {dof: value / divisor for dof, value in form.items()}
    return solved


def _put_in(
    form: Form, solved: dict[int, Form], owner: IntArray, coupled_rows: SparseArray
) -> Form:
    """A linear form without the degrees of freedom that are determined already."""
    found: Form = {}
    pending = list(form.items())
    while pending:
        dof, factor = pending.pop()
        if dof in solved:
            pending += [(other, factor * value) for other, value in solved[dof].items()]
        elif owner[dof] >= 0:
            row = slice(coupled_rows.indptr[dof], coupled_rows.indptr[dof + 1])
            columns, values = coupled_rows.indices[row], coupled_rows.data[row]
            pending += zip(columns.tolist(), (factor * values).tolist(), strict=True)
        else:
            found[dof] = found.get(dof, 0.0) + factor
    return found


def equation_rows(solved: dict[int, Form], size: int) -> SparseArray:
    """Solved equations as a sparse matrix (size, size), one row for each."""
    entries = [(row, column, v) for row, form in solved.items() for column, v in form.items()]
    at = np.array([entry[:2] for entry in entries], dtype=np.int64).reshape(-1, 2)
    values = np.array([entry[2] for entry in entries], dtype=np.float64)
    return sparse.csr_array((values, (at[:, 0], at[:, 1])), shape=(size, size))


def point_dof(model: StructureModel, numbering: Numbering, point: str, direction: str) -> int:
    """The degree of freedom of a named point, or a ModelError where it has none."""
    dof = int(numbering.dofs(np.array([model.mesh.node(point)]))[0, axis_index(direction)])
    if dof < 0:
        fault = "is on no part of the model; couple a face to it"
        if axis_index(direction) > 2:
            fault = "does not turn, since only solids or trusses meet there; couple a face to it"
        raise ModelError(
            f"{model.mesh.source}: {point!r} has no direction {direction!r}: it {fault}"
        )
    return dof


def _check_coupling(
    model: StructureModel, index: int, slaves: IntArray, held: BoolArray, owner: IntArray
) -> None:
    coupling = model.attached.couplings[index]
    what = f"{model.mesh.source}: coupling of {coupling.face!r} to {coupling.point!r}"
    if held[slaves].any():
        moved = "face" if coupling.kind == "rigid" else "point"
        raise ModelError(
            f"{what}: a support holds a direction of its {moved}, which the coupling determines;"
            " support the other side, or leave the direction out of the coupling"
        )
    taken = owner[slaves]
    if (taken >= 0).any():
        other = model.attached.couplings[int(taken[taken >= 0][0])]
        raise ModelError(
            f"{what}: the coupling of {other.face!r} to {other.point!r} moves some of the same"
            " nodes already"
        )


def _held(model: StructureModel, numbering: Numbering) -> IntArray:
    held = []
    if model.plane:
        out = [axis_index(name) for name in AXES if name not in IN_PLANE]
        held.append(numbering.dofs(np.arange(len(model.mesh.points)))[:, out].ravel())
        held += [3 * numbering.hinged, 3 * numbering.hinged + 1]
    for support in model.attached.supports:
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


def _check_turns(model: StructureModel, support: Support, nodes: IntArray, dofs: IntArray) -> None:
    """Rotations that no node has must be held by the translations: a face held in x cannot tip."""
    columns = [axis_index(direction) for direction in support.directions]
    lacking = [c for at, c in enumerate(columns) if (dofs[:, at] < 0).all()]
    if not lacking:
        return
    place = (model.mesh.points[nodes] - model.mesh.points[nodes].mean(axis=0)) / model.mesh.size
    shift = np.broadcast_to(np.eye(3), (len(nodes), 3, 3))
    motions = np.concatenate([shift, -cross_matrix(place)], axis=2)
    held = motions[:, [c for c in columns if c < 3]].reshape(-1, 6)
    prevented = np.diag(np.linalg.pinv(held, rcond=FREE) @ held) > 1.0 - FREE
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
    axes = [axis_index(name) for name in IN_PLANE] if model.plane else list(range(6))
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
    products = face_products(model, coupling.face, nodes)
    if coupling.weighting == "nodes":
        products = sparse.csr_array(sparse.eye_array(len(nodes)))
    WR = (products @ R.reshape(len(nodes), -1)).reshape(R.shape)
    normal = np.einsum("mij,mik->jk", R, WR)
    scale = np.sqrt(np.diag(normal))
    if not (scale > 0.0).all() or np.linalg.cond(normal / np.outer(scale, scale)) > ALIGNED:
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
        found = sparse.csr_array(found + dense_scatter([(products, at[inside])], len(nodes)))
    return found


def facet_products(kind: str, coordinates: FloatArray) -> FloatArray:
    """Integrals over facets of products of shape functions, (f, k, k), in m² or m."""
    values, _ = KINDS[kind].basis(KINDS[kind].quadrature[0])
    found = measures(kind, coordinates)
    return np.asarray(
        np.einsum("fq,qa,qb->fab", found, values, values, optimize=True),
        dtype=np.float64,
    )
