"""Read meshes from Gmsh, VTK and Abaqus files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from fem.base.errors import ModelError, quoted
from fem.formats.abaqus import read_abaqus
from fem.formats.abaqus.deck import bare
from fem.formats.content import MeshContent
from fem.formats.deck_file import DeckFile
from fem.formats.faults import reason_of
from fem.formats.from_meshio import from_meshio
from fem.formats.gmsh import read_gmsh
from fem.formats.ignored import without_cells
from fem.formats.med import read_med
from fem.formats.nastran import read_nastran
from fem.formats.unv import read_unv
from fem.formats.vtk_legacy import read_vtk
from fem.formats.vtu import read_vtu
from fem.mesh.structure_mesh import StructureMesh

READERS: dict[str, tuple[str, Callable[[Path], MeshContent]]] = {
    ".msh": ("Gmsh", read_gmsh),
    ".vtu": ("VTK", read_vtu),
    ".vtk": ("VTK", read_vtk),
    ".med": ("MED", read_med),
}
DECK = ".inp"
"""The extension of files that hold more than a mesh."""
NASTRAN = (".bdf", ".dat", ".nas")
UNIVERSAL = ".unv"
ARCHIVE = ".cdb"
EXTENSIONS = (*READERS, UNIVERSAL, DECK, *NASTRAN)
PROGRAMS = {DECK: "Abaqus", UNIVERSAL: "universal", **dict.fromkeys(NASTRAN, "Nastran")}


def read_mesh(
    path: str | Path, include_folders: Iterable[str | Path] = (), ignore: Sequence[str] = ()
) -> StructureMesh:
    """Read a mesh of lines, surfaces and volumes with its named groups and points.

    Parameters
    ----------
    path
        A file whose extension says what it is:

        - ``.msh``: Gmsh 2.2 or 4.1, ASCII or binary. Physical groups are groups of cells, physical
          points are point sets; a group without a name goes by its number.
        - ``.vtu``, ``.vtk``: VTK unstructured grid. VTK has neither cell sets nor point sets, so
          a cell array ``set:NAME`` that is 1 on the cells of a group, else 0, names the group,
          and a point array ``set:NAME`` that is 1 at its nodes names a point set.
        - ``.med``: MED of version 3 or later. Groups of cells and of nodes.
        - ``.unv``: universal file, as Salome writes it, with its groups likewise.
        - ``.bdf``, ``.dat``, ``.nas``: Nastran bulk data, with supports, masses and springs.
          Properties are the groups, "PBAR 3".
        - ``.inp``: Abaqus input. ELSET are groups and NSET point sets, also those given on
          ``*ELEMENT`` and ``*NODE``.

    include_folders
        Folders from which decks may include other files, beside their own.
    ignore
        Cells to leave out: names of groups, kinds of cells such as "quad", element types of
        Abaqus such as "S4R", or "ungrouped" for those in no group. Of an Abaqus file also what is
        refused: element types and keywords such as ``GAPUNI`` and ``*CONTACT PAIR``; of Nastran
        names of cards such as ``CGAP``.

    Returns
    -------
    StructureMesh
        All cells, and all coordinates as in the file. Hexahedra, wedges, pyramids and
        quadrilaterals some of whose nodes are repeated are the wedges, pyramids, tetrahedra and
        triangles that they mean; `notes` tell how many.

    Raises
    ------
    ModelError
        If the file does not exist, has another extension or another content, or if it has no
        cells, cells of a kind that `fem` does not know, which it names, coordinates that are not
        finite, or whatever `StructureMesh` refuses.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.read_mesh("meshes/half_beam.msh")
    >>> sorted(mesh.groups), sorted(mesh.point_sets)
    (['beam', 'leaf'], ['corner', 'foot', 'middle'])
    """
    path = Path(path)
    extension = path.suffix.lower()
    if extension not in EXTENSIONS:
        if extension == ARCHIVE:
            raise ModelError(
                f"{path}: archives of Ansys are not read, and no conversion that keeps their"
                " components is known; the matrices that Ansys writes by HBMAT are read: give them"
                " as [matrices] in the scene"
            )
        raise ModelError(
            f"{path}: unknown mesh extension {path.suffix!r}; known are {quoted(EXTENSIONS)};"
            " export it as one of these from the program that made it: converters lose the names"
        )
    if not path.is_file():
        raise ModelError(f"{path}: there is no such mesh file")
    if path.stat().st_size == 0:
        raise ModelError(f"{path}: the mesh file is empty")
    try:
        if extension == DECK:
            return _deck_mesh(path, include_folders, ignore)
        if extension in NASTRAN:
            deck = read_nastran(path, include_folders, ignore)
            others = [name for name in ignore if name.upper() not in deck.ignored]
            return _with_attached(path, deck, others)
        whole, left_out = (
            read_unv(path) if extension == UNIVERSAL else (READERS[extension][1](path), [])
        )
        content, said = without_cells(whole, ignore, str(path))
        mesh = _noted(_with_unit(from_meshio(content, str(path)), whole.unit), said)
        return replace(mesh, left_out=left_out)
    except ModelError:
        raise
    except (Exception, SystemExit) as error:
        reason = reason_of(error)
        if "zero-size array" in reason:
            raise ModelError(f"{path}: the mesh is empty, it has no elements") from error
        kind = PROGRAMS[extension] if extension in PROGRAMS else READERS[extension][0]
        raise ModelError(f"{path}: cannot be read as {kind} mesh ({reason})") from error


def _deck_mesh(
    path: Path,
    include_folders: Iterable[str | Path],
    ignore: Sequence[str],
) -> StructureMesh:
    """The mesh of an Abaqus file, with what the file attaches to it."""
    found = read_abaqus(path, include_folders, ignore)
    others = [name for name in ignore if bare(name) not in found.ignored]
    return _with_attached(path, found, others)


def _with_attached(
    path: Path,
    found: DeckFile,
    ignore: Sequence[str],
) -> StructureMesh:
    """The mesh of a deck, with what the deck attaches to it and says of it."""
    content, said = without_cells(found.content, ignore, str(path))
    notes = list(found.notes) + said
    return replace(
        _noted(from_meshio(content, str(path)), notes),
        attachments=found.attachments,
        described=found.described,
        left_out=found.left_out,
    )


def _with_unit(mesh: StructureMesh, unit: str) -> StructureMesh:
    """A mesh with the unit that its file states."""
    if unit in ("", "m"):
        return mesh
    note = (
        f"{mesh.source}: states the unit {unit!r} for its coordinates, which are taken as they are,"
        " in m unless 'unit' in [mesh] says otherwise"
    )
    return _noted(replace(mesh, unit=unit), [note])


def _noted(mesh: StructureMesh, said: Sequence[str]) -> StructureMesh:
    """A mesh with further notes."""
    return replace(mesh, notes=[*mesh.notes, *said]) if said else mesh
