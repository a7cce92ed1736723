"""Where parts can move against each other though they share nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from fem.base.arrays import IntArray
from fem.base.errors import ModelError, quoted
from fem.checks.neighbours import shared_facets
from fem.elements.links import link_terms
from fem.elements.trusses import loose_nodes, loose_sentences
from fem.mesh.pieces import place_of
from fem.model.structure import AXES, StructureModel, axis_index

MEANT = ", or say that it is meant ('pinned')"
ALIGNED = 1e-6  # of the mesh: nodes no farther than so from a line lie on it


def joint_warnings(model: StructureModel) -> Iterator[str]:
    """One sentence for everything that turns at nodes of solids, but for the ``pinned`` parts.

    Raises
    ------
    ModelError
        For a part that is said to be pinned, but turns nowhere.
    """
    found = [*shells_that_turn(model), *beams_that_turn(model), *solids_that_turn(model)]
    free = [name for name in model.pinned if not any(name in parts for parts, _ in found)]
    if free:
        raise ModelError(
            f"{model.mesh.source}: {quoted(free)} of 'pinned' meets no solid in nodes that it turns"
            " about; leave it out there"
        )
    for parts, text in found:
        if not set(parts).intersection(model.pinned):
            yield text


def shells_that_turn(model: StructureModel) -> Iterator[tuple[list[str], str]]:
    """Each shell part with nodes on solids that only hold their place, and a sentence on it.

    Nodes of solids have no rotation, so that a shell that shares the nodes of an edge with a solid
    can turn about it. It cannot where a whole facet of it lies on or in the solid, and where a
    rigid coupling joins the node.

    Examples
    --------
    >>> import fem
    >>> steel = fem.Material(2.1e11, 7800.0, 0.3)
    >>> block = fem.box_mesh("block", (1.0, 1.0, 1.0), (1, 1, 1), kind="hexahedron")
    >>> plate = fem.box_mesh("plate", (1.0, 1.0), (1, 1), origin=(1.0, 0.0, 0.0), kind="quad")
    >>> model = fem.StructureModel(
    ...     fem.joined([block, plate]),
    ...     {"block": fem.SolidPart(steel), "plate": fem.ShellPart(steel, 0.01)},
    ... )
    >>> [text.split(": ")[1] for _, text in shells_that_turn(model)]
    ["part 'plate' shares 2 nodes with solids"]
    """
    solid = np.zeros(len(model.mesh.points), dtype=np.bool_)
    for _, kinds in model.solids.values():
        for nodes in kinds.values():
            solid[nodes] = True
    for coupling in model.attached.couplings:
        if coupling.kind == "rigid" and len(coupling.directions) == 3:
            solid[model.mesh.nodes(coupling.face)] = False
    shells = [facets for _, kinds in model.shells.values() for facets in kinds.values()]
    held = np.zeros(len(solid), dtype=np.bool_)
    for facets in shells:
        held[facets[solid[facets].all(axis=1)]] = True
    for name, (_, kinds) in model.shells.items():
        used = np.unique(np.concatenate([facets.ravel() for facets in kinds.values()]))
        count = int((solid & ~held)[used].sum())
        if count:
            text = (
                f"{model.mesh.source}: part {name!r} shares {count} nodes with solids: these hold"
                " their place only, so that the shell turns there as on a hinge; let it go on by a"
                " cell along the face or into the solid, couple these nodes rigidly to a point"
            )
            yield [name], text + MEANT


def beams_that_turn(model: StructureModel) -> Iterator[tuple[list[str], str]]:
    """Each beam part with nodes on solids that only hold their place, and a sentence on it.

    Nothing is said of a node whose rotations a support holds, that a shell or a coupling joins, or
    from which a line goes to another node of one cell, along the solid or into it.

    Examples
    --------
    >>> import fem
    >>> steel = fem.Material(2.1e11, 7800.0, 0.3)
    >>> block = fem.box_mesh("block", (1.0, 1.0), (1, 1), kind="quad")
    >>> rod = fem.frame_mesh({"a": (1, 0), "b": (2, 0)}, [("rod", "a", "b", 1)])
    >>> model = fem.StructureModel(
    ...     fem.joined([block, rod]),
    ...     {
    ...         "block": fem.SolidPart(steel, plane="stress", thickness=0.01),
    ...         "rod": fem.BeamPart(steel, fem.CircularSection(0.02)),
    ...     },
    ... )
    >>> [text.split(": ")[1] for _, text in beams_that_turn(model)]
    ["part 'rod' shares 1 nodes with solids, the first 'a' at (1, 0, 0)"]
    """
    if not model.solids or not model.beams:
        return
    pinned = np.zeros(len(model.mesh.points), dtype=np.bool_)
    for cells in _solid_cells(model):
        pinned[cells] = True
    lines = np.concatenate([ends for _, ends in model.beams.values()])
    pinned[_in_one_cell(model, lines[pinned[lines].all(axis=1)])] = False
    for _, kinds in model.shells.values():
        for facets in kinds.values():
            pinned[facets] = False
    for coupling in model.attached.couplings:
        pinned[model.mesh.node(coupling.point)] = False
        if coupling.kind == "rigid" and len(coupling.directions) == 3:
            pinned[model.mesh.nodes(coupling.face)] = False
    turns = {"rotation_z"} if model.plane else {f"rotation_{axis}" for axis in "xyz"}
    for support in model.attached.supports:
        if turns <= {AXES[axis_index(direction)] for direction in support.directions}:
            pinned[model.mesh.nodes(support.point)] = False
    for name, (_, ends) in model.beams.items():
        at = np.unique(ends[pinned[ends]])
        if len(at):
            text = (
                f"{model.mesh.source}: part {name!r} shares {len(at)} nodes with solids, the first"
                f" {_point(model, int(at[0]))}: solids hold the place of a node only, so that the"
                " beam turns there as on a ball joint; to clamp it, couple a face of the solid to"
                " the end of the beam ('couplings' in a scene, fem.Coupling)"
            )
            yield [name], text + MEANT


def solids_that_turn(model: StructureModel) -> Iterator[tuple[list[str], str]]:
    """The parts of solids that meet in a node or on a line only, and a sentence on it.

    Nothing is said of nodes that a rigid coupling joins.

    Examples
    --------
    >>> import fem
    >>> cubes = [fem.box_mesh(name, (1.0, 1.0, 1.0), (1, 1, 1), origin=(x, x, 0.0))
    ...     for name, x in (("one", 0.0), ("other", 1.0))]
    >>> part = fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))
    >>> model = fem.StructureModel(fem.joined(cubes), {"one": part, "other": part})
    >>> [(parts, text.split(": ")[1]) for parts, text in solids_that_turn(model)]
    [(['one', 'other'], "solids of 'one', 'other' meet in 3 nodes, but in no face there")]
    """
    if not model.solids:
        return
    body, blocks = _bodies(model), _solid_cells(model)
    if not body.any():
        return
    owners = np.repeat(np.arange(len(body)), np.concatenate([_widths(b) for b in blocks]))
    nodes = np.concatenate([cells.ravel() for cells in blocks])
    met = _on_axes(model, np.unique(np.stack([nodes, body[owners]], axis=1), axis=0))
    for coupling in model.attached.couplings:
        if coupling.kind == "rigid":
            met = np.setdiff1d(met, model.mesh.nodes(coupling.face))
    if not len(met):
        return
    names = np.repeat(
        list(model.solids), [_cell_count(kinds) for _, kinds in model.solids.values()]
    )
    parts = [str(name) for name in dict.fromkeys(names[owners[np.isin(nodes, met)]])]
    text = (
        f"{model.mesh.source}: solids of {quoted(parts)} meet in {len(met)} nodes, but in no face"
        f" there: they turn about these, the first of which is {_point(model, int(met[0]))}; give"
        " them a common face"
    )
    yield parts, text + MEANT


def _on_axes(model: StructureModel, pairs: IntArray) -> IntArray:
    """Nodes of several bodies, out of pairs (p, 2) of a node and a body, that are all on one line.

    Looked at are two bodies at a time; in the plane they turn only about a single node.
    """
    bodies_of: dict[int, list[int]] = {}
    for node, body in pairs[np.isin(pairs[:, 0], pairs[1:, 0][np.diff(pairs[:, 0]) == 0])].tolist():
        bodies_of.setdefault(node, []).append(body)
    shared: dict[tuple[int, int], list[int]] = {}
    for node, bodies in bodies_of.items():
        for two in combinations(bodies, 2):
            shared.setdefault(two, []).append(node)
    found: set[int] = set()
    for nodes in shared.values():
        spans = model.mesh.points[nodes] - model.mesh.points[nodes[0]]
        rank = np.linalg.matrix_rank(spans, tol=ALIGNED * model.mesh.size)
        if rank < (1 if model.plane else 2):
            found.update(nodes)
    return np.array(sorted(found), dtype=np.int64)


def _bodies(model: StructureModel) -> IntArray:
    """For each solid cell the number of the body whose cells hang together by faces."""
    count = sum(_cell_count(kinds) for _, kinds in model.solids.values())
    pairs = np.concatenate([cells for _, cells in shared_facets(model)])
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _widths(cells: IntArray) -> IntArray:
    return np.full(len(cells), cells.shape[1])


def _cell_count(kinds: Mapping[str, IntArray]) -> int:
    return sum(len(cells) for cells in kinds.values())


def _solid_cells(model: StructureModel) -> list[IntArray]:
    return [cells for _, kinds in model.solids.values() for cells in kinds.values()]


def _in_one_cell(model: StructureModel, lines: IntArray) -> IntArray:
    """Those of some lines (e, 2) both of whose ends are nodes of one solid cell."""
    blocks = _solid_cells(model)
    widths = np.concatenate([_widths(cells) for cells in blocks])
    owners = np.repeat(np.arange(len(widths)), widths)
    used = np.concatenate([cells.ravel() for cells in blocks])
    shape = (len(model.mesh.points), len(widths))
    cells_of = csr_array((np.ones(len(used)), (used, owners)), shape=shape)
    common = cells_of[lines[:, 0]].multiply(cells_of[lines[:, 1]])
    return np.asarray(lines[common.sum(axis=1) > 0.0])


def _point(model: StructureModel, node: int) -> str:
    """A node by the name of its point, if it has one, and its place."""
    name = next((n for n, at in model.mesh.point_sets.items() if list(at) == [node]), None)
    what = f"node {node}" if name is None else repr(name)
    return f"{what} at {place_of(model.mesh.points[node])}"


def mechanism_warnings(model: StructureModel) -> Iterator[str]:
    """One sentence for nodes that trusses do not hold in all directions, nor anything else."""
    held = np.zeros((len(model.mesh.points), 3), dtype=np.int64)
    for _, kinds in (*model.solids.values(), *model.shells.values()):
        for nodes in kinds.values():
            held[nodes] = 1
    for _, lines in model.beams.values():
        held[lines] = 1
    for coupling in model.attached.couplings:
        held[model.mesh.nodes(coupling.face)] = held[model.mesh.node(coupling.point)] = 1
    for foundation in model.foundations:
        held[model.mesh.nodes(foundation.face)] |= np.array(foundation.stiffness) > 0.0
    ties = [(support.point, d) for support in model.attached.supports for d in support.directions]
    ties += [(spring.point, spring.direction) for spring in model.springs]
    brought = model.attached
    ties += [(p, d) for link in brought.links for p, d, _ in link_terms(model.mesh, link)]
    ties += [(p, d) for equation in brought.equations for p, d, _ in equation.terms]
    ties += [term for matrix in brought.matrices for term in matrix.terms]
    for point, direction in ties:
        if axis_index(direction) < 3:
            held[model.mesh.nodes(point), axis_index(direction)] = 1
    for name in brought.loose:
        held[model.mesh.nodes(name)] = 1
    trusses = [nodes for _, kinds in model.trusses.values() for nodes in kinds.values()]
    dimension = 2 if model.plane else 3
    yield from loose_sentences(model.mesh, loose_nodes(model.mesh.points, trusses, held, dimension))
