"""What an input file of another program holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fem.formats.content import MeshContent
from fem.mesh.attachments import Attachments, LeftOut


@dataclass(frozen=True, eq=False, repr=False)
class DeckFile:
    """What a deck of Abaqus, CalculiX or Nastran holds.

    Parameters
    ----------
    content
        Cells and named points ("node 17"). A set of cells is each element set of Abaqus and each
        property of Nastran ("PSHELL 3"), and the cells of each element type ("abaqus:" and it).
    attachments
        Masses, springs, dampers, couplings, equations, supports and matrices.
    described
        By the name of a set of cells: keys of a part of a scene, or a part under "made"; under
        "refused" why there is none.
    left_out
        Keywords and cards that are left out by intention.
    notes
        Sentences on what means more than it says.
    ignored
        What of the names to ignore was met, in capitals and without blanks and asterisk.
    """

    content: MeshContent
    attachments: Attachments = field(default_factory=Attachments)
    described: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    left_out: tuple[LeftOut, ...] = ()
    notes: tuple[str, ...] = ()
    ignored: frozenset[str] = frozenset()

    def __repr__(self) -> str:
        cells = ", ".join(f"{len(block.data)} {block.type}" for block in self.content.cells)
        points = len(self.content.points)
        return f"<DeckFile: {points} points, {cells}; {self.attachments!r}>"
