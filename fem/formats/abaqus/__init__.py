"""Read input files of Abaqus and CalculiX: cells, names, and what is attached to them.

meshio 5.3 has a reader of its own, but it loses or mixes up sets in ordinary files, and passes
over what it does not know. This one takes what bears on stiffness, mass and connection, names what
it leaves out by intention (`known.py`), and refuses all else at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from fem.formats.abaqus.assembly import read_scopes
from fem.formats.abaqus.attached import Gathered, read_point_elements, read_transforms
from fem.formats.abaqus.deck import Deck, bare
from fem.formats.abaqus.joints import Joints
from fem.formats.abaqus.keywords import Reading
from fem.formats.abaqus.mesh import collected_cells, content_of, numbered_nodes
from fem.formats.abaqus.sections import described_parts
from fem.formats.abaqus.sets import Resolver
from fem.formats.abaqus.surfaces import Surfaces
from fem.formats.deck_file import DeckFile
from fem.mesh.attachments import LeftOut


def _no_cells(deck: Deck) -> str:
    kinds = Counter(e.type.name for body in deck.bodies.values() for _, e in body.elements())
    told = ", ".join(f"{count} of type {name}" for name, count in kinds.items()) or "none"
    return f"the mesh has no line elements, surfaces or volumes (its elements: {told})"


def read_abaqus(
    path: str | Path,
    include_folders: Iterable[str | Path] = (),
    ignore: Iterable[str] = (),
) -> DeckFile:
    """Read an input file of Abaqus or CalculiX.

    Parameters
    ----------
    path
        Input file. Upper and lower case are the same, and a set keeps the spelling of its first
        occurrence. ``docs/reference/decks.md`` lists the keywords and elements.
    include_folders
        Folders below which included files may be, beside that of the file.
    ignore
        Keywords and element types that are not read, such as ``GAPUNI`` or ``*CONTACT PAIR``, and
        that are left out instead of refused; other names in it have no effect here.

    Returns
    -------
    DeckFile
        The points, cells and names, and what is attached to it.

    Raises
    ------
    ModelError
        For a keyword or an element type that is not read (all of them in one sentence), a number
        defined twice, a name or a number that is not defined, words that are no numbers, an
        element with too few or too many nodes, or an included file in another folder.

    Examples
    --------
    >>> read_abaqus("meshes/half_beam.inp").content.cells[0].type
    'line'
    """
    folders = [Path(path).parent, *map(Path, include_folders)]
    reading = Reading(Path(path), [folder.resolve() for folder in folders])
    deck = Deck(Path(path), ignore=frozenset(map(bare, ignore)))
    read_scopes(deck, reading.keywords())
    position, places = numbered_nodes(deck)
    if not position:
        deck.raise_problems()
        raise deck.fail("is not an Abaqus input file with nodes (there is no *NODE)")
    deck.raise_problems()
    resolver = Resolver(deck)
    surfaces = Surfaces(resolver)
    gathered = Gathered(deck, resolver)
    cells = collected_cells(deck, resolver, position)
    deck.raise_problems()
    if not cells.nodes:
        raise deck.fail(_no_cells(deck))
    read_transforms(gathered)
    read_point_elements(gathered)
    Joints(gathered, surfaces, places).read()
    deck.raise_problems()
    return DeckFile(
        content_of(deck, cells, gathered, position, places, surfaces),
        gathered.attachments,
        described_parts(deck, resolver),
        tuple(LeftOut(p.what, p.count, p.place, p.advice) for p in deck.left_out.values()),
        tuple(surfaces.notes()),
        frozenset(deck.ignored),
    )
