"""The parts that the file of a mesh describes."""

from __future__ import annotations

from collections.abc import Iterable

from fem.base.errors import ModelError, quoted
from fem.mesh.structure_mesh import StructureMesh
from fem.model.structure import Part

MADE, REFUSED = "made", "refused"


def parts_of(mesh: StructureMesh, names: Iterable[str] | None = None) -> dict[str, Part]:
    """The parts that the file of a mesh describes whole, as decks of Nastran do.

    Parameters
    ----------
    mesh
        A mesh that `fem.read_mesh` read.
    names
        Of parts; by default all that have cells.

    Returns
    -------
    dict
        Parts by name, for a `fem.StructureModel`.

    Raises
    ------
    ModelError
        If there is no part of a name, or the file describes it in a way that is not read.

    Examples
    --------
    >>> import pathlib, tempfile, fem
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "corner.bdf"
    >>> _ = path.write_text(
    ...     "GRID,1,,0.,0.,0.\\nGRID,2,,1.,0.,0.\\nGRID,3,,0.,1.,0.\\nGRID,4,,0.,0.,1.\\n"
    ...     "CTETRA,1,3,1,2,3,4\\nPSOLID,3,1\\nMAT1,1,2.1+11,,.3,7800.\\n"
    ... )
    >>> list(parts_of(fem.read_mesh(path)))
    ['PSOLID 3']
    """
    found: dict[str, Part] = {}
    for name in mesh.described if names is None else names:
        if name not in mesh.described:
            raise ModelError(
                f"{mesh.source}: the file describes no part {name!r}; it describes"
                f" {quoted(mesh.described)}"
            )
        given = mesh.described[name]
        if REFUSED in given:
            raise ModelError(f"{mesh.source}: part {name!r}: {given[REFUSED]}")
        if MADE not in given:
            raise ModelError(
                f"{mesh.source}: the file gives numbers of {name!r}, but no whole part; take them"
                " from mesh.described"
            )
        if names is not None or name in mesh.groups:
            found[name] = given[MADE]  # type: ignore[assignment]
    return found
