"""Where parts can move against each other though they share nodes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.links import link_terms
from fem.structure import StructureModel, axis_index
from fem.trusses import loose_nodes, loose_sentences


def hinge_warnings(model: StructureModel) -> Iterator[str]:
    """One sentence for every shell part with nodes on solids that only hold their place.

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
    >>> [text.split(": ")[1] for text in hinge_warnings(model)]
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
            yield (
                f"{model.mesh.source}: part {name!r} shares {count} nodes with solids: these hold"
                " their place only, so that the shell turns there as on a hinge; let it go on by a"
                " cell along the face or into the solid, or couple these nodes rigidly to a point"
            )


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
    ties = [(support.point, d) for support in model.supports for d in support.directions]
    ties += [(spring.point, spring.direction) for spring in model.springs]
    brought = model.attached
    ties += [(p, d) for link in brought.links for p, d, _ in link_terms(model.mesh, link)]
    ties += [(p, d) for equation in brought.equations for p, d, _ in equation.terms]
    for point, direction in ties:
        if axis_index(direction) < 3:
            held[model.mesh.nodes(point), axis_index(direction)] = 1
    trusses = [nodes for _, kinds in model.trusses.values() for nodes in kinds.values()]
    dimension = 2 if model.is_plane else 3
    yield from loose_sentences(model.mesh, loose_nodes(model.mesh.points, trusses, held, dimension))
