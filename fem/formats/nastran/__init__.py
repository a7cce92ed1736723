"""Read bulk data of Nastran: cells, parts, and what is attached to points.

What bears on stiffness, mass and connection is read; what is left out by intention is told
(`known.py`), and all else is refused at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

from fem.base.errors import ModelError
from fem.formats.deck_file import DeckFile
from fem.formats.nastran.beams import read_beams
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import Deck, read_deck
from fem.formats.nastran.gathered import Gathered
from fem.formats.nastran.known import PARAMETERS, PARAMETERS_WITH_EFFECT
from fem.formats.nastran.materials import Materials
from fem.formats.nastran.matrices import read_matrices
from fem.formats.nastran.points import read_points
from fem.formats.nastran.rigid import mark_turning, read_rigid
from fem.formats.nastran.rods import read_rods, twist_rods
from fem.formats.nastran.shells import read_shells
from fem.formats.nastran.solids import read_solids
from fem.formats.nastran.supports import read_supports


def read_nastran(
    path: Path, include_folders: Iterable[str | Path] = (), ignore: Iterable[str] = ()
) -> DeckFile:
    """Read bulk data of Nastran.

    Parameters
    ----------
    path
        In free, small or large fields, with or without executive and case control.
        ``docs/reference/nastran.md`` lists the cards.
    include_folders
        Folders below which included files may be, beside that of the file.
    ignore
        Names of cards that are left out instead of read or refused, such as ``CGAP``; other names
        in it have no effect here.

    Returns
    -------
    DeckFile
        The points, cells and names, and what is attached to it.

    Raises
    ------
    ModelError
        For cards that are not read (all of them in one sentence, with their number and the line
        of the first), numbers that stand twice or are not there, and fields that are no numbers.

    References
    ----------
    *MSC Nastran Quick Reference Guide*, bulk data entries.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "corner.bdf"
    >>> _ = path.write_text(
    ...     "GRID,1,,0.,0.,0.\\nGRID,2,,1.,0.,0.\\nGRID,3,,0.,1.,0.\\nGRID,4,,0.,0.,1.\\n"
    ...     "CTETRA,1,3,1,2,3,4\\nPSOLID,3,1\\nMAT1,1,2.1+11,,.3,7800.\\n"
    ... )
    >>> read_nastran(path).described["PSOLID 3"]["made"].material.youngs_modulus
    210000000000.0
    """
    path = Path(path)
    folders = [Path(folder).resolve() for folder in (path.parent, *include_folders)]
    deck = read_deck(path, folders, ignore)
    factor = _parameters(deck)
    gathered = Gathered(deck)
    materials = Materials(deck, deck.by_number("MAT1", "MAT2", "MAT8", "MAT9"), factor)
    read_solids(gathered, materials)
    read_shells(gathered, materials)
    read_beams(gathered, materials)
    rods = read_rods(gathered, materials)
    if not gathered.cells:
        raise ModelError(
            f"{path}: is no Nastran bulk data with elements that have a shape (CQUAD4, CBAR,"
            " CTETRA, ...); give masses and springs alone as [matrices] in the scene"
        )
    equations = mark_turning(gathered)
    read_matrices(gathered)
    read_points(gathered, factor)
    read_rigid(gathered, equations)
    twist_rods(gathered, rods)
    read_supports(gathered)
    _name_analysis_set(gathered)
    attached = gathered.attachments()
    return DeckFile(
        gathered.content(),
        attached,
        gathered.described,
        tuple(deck.left_out),
        tuple(deck.notes),
        frozenset(deck.ignored),
    )


def _parameters(deck: Deck) -> float:
    """The factor on all masses; a PARAM that changes matrices otherwise is refused."""
    taken: dict[str, Card] = {}
    for card in deck.of("PARAM"):
        name = card.text(0)
        if name not in PARAMETERS_WITH_EFFECT:
            _leave_out_parameter(deck, card, name)
            continue
        before = taken.setdefault(name, card)
        if before.text(1) != card.text(1):
            raise card.fail(f"{name} is {before.text(1)} already, in {before.place}; keep one")
        if name == "AUTOSPC":
            continue
        card.check_fields("xxx")
        if name == "WTMASS" and not card.real(1) > 0.0:
            raise card.fail(f"WTMASS is {card.real(1):g} and must be positive")
        if name != "WTMASS" and card.real(1) != 1.0:
            raise card.fail(f"{name} scales a part of the matrices, which is not read")
    return taken["WTMASS"].real(1) if "WTMASS" in taken else 1.0


def _leave_out_parameter(deck: Deck, card: Card, name: str) -> None:
    if name == "COUPMASS":
        deck.leave_out("PARAM COUPMASS", card.place, "masses are consistent here, always")
    elif name in PARAMETERS or name.startswith("PRT"):
        deck.leave_out("PARAM", card.place, "it changes no matrix of this model")
    else:
        like = get_close_matches(name, PARAMETERS | PARAMETERS_WITH_EFFECT, 1, 0.8)
        reason = "no parameter of this name is known" + (f"; is it {like[0]}?" if like else "")
        deck.leave_out(f"PARAM {name}", card.place, reason)


def _name_analysis_set(gathered: Gathered) -> None:
    """The grid points of ASET and ASET1 as a set of points, for the scene to choose from."""
    grids: list[int] = []
    for card in gathered.deck.of("ASET"):
        grids += [card.whole(at) for at in range(0, len(card.fields), 2) if card.given(at, 2)]
    for card in gathered.deck.of("ASET1"):
        grids += card.wholes(1)
    known = [g for g in dict.fromkeys(grids) if g in gathered.deck.grids]
    if known:
        gathered.sets["ASET"] = known
        card = gathered.deck.of("ASET", "ASET1")[0]
        gathered.deck.leave_out(
            "ASET", card.place, "the scene names its interfaces; the grid points are a set 'ASET'"
        )
