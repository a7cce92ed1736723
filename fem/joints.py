"""Where a shell meets a solid at an edge only, so that it can turn there as on a hinge."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.structure import StructureModel


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
    for coupling in model.couplings:
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
