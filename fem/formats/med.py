"""Read MED files, as Salome and Code_Aster have them, with the names of their groups.

meshio cannot hold cells of which some kinds are in a group and others in none, which is how these
programs write them, and keeps the families, not the groups.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fem.base.arrays import IntArray
from fem.base.errors import ModelError, quoted
from fem.formats.content import CellBlock, MeshContent

KINDS = {
    "PO1": "vertex", "SE2": "line", "SE3": "line3", "TR3": "triangle", "TR6": "triangle6",
    "QU4": "quad", "QU8": "quad8", "QU9": "quad9", "TE4": "tetra", "T10": "tetra10",
    "HE8": "hexahedron", "H20": "hexahedron20", "PY5": "pyramid", "P13": "pyramid13",
    "PE6": "wedge", "P15": "wedge15",
}  # fmt: skip
"""Kinds of cells by MED's name; its nodes are in VTK's order, but for the handedness of solids."""

OLDEST = 3
"""The oldest version that is read."""

SYSTEMS = {1: "cylindrical", 2: "spherical"}
"""MED's other systems of coordinates, by their numbers."""


UNKNOWN = ("", "INCONNUE", "SANS UNITE", "UNKNOWN")
"""What stands where no unit is known."""


def read_med(path: Path) -> MeshContent:
    """Read the nodes, cells and groups of a MED file with one mesh.

    Parameters
    ----------
    path
        Version 3 or later (HDF5), of a whole mesh.

    Returns
    -------
    MeshContent
        One block for each kind of cell; groups of cells as cell sets, groups of nodes as point
        sets. Its ``unit`` is what the file states, or empty.

    Raises
    ------
    ModelError
        If it is not a MED file, is of an older version, is not in Cartesian coordinates, holds
        several meshes or steps, one piece of a mesh (with joints), or cells of a kind that is not
        read.

    References
    ----------
    *MED file format*, the layout of ``ENS_MAA`` and ``FAS``, https://docs.salome-platform.org.
    """
    import h5py  # slow to import, and only this format needs it

    try:
        file = h5py.File(path, "r")
    except OSError:
        raise ModelError(f"{path}: is not a MED file, or is cut off") from None
    with file:
        _check_version(path, file)
        if "ENS_MAA" not in file:
            raise ModelError(f"{path}: is not a MED file with a mesh (there is no ENS_MAA)")
        names = list(file["ENS_MAA"])
        if len(names) != 1:
            raise ModelError(f"{path}: holds {len(names)} meshes, not one: {quoted(names)}")
        joints = list(file.get(f"JNT/{names[0]}", ()))
        if joints:
            raise ModelError(
                f"{path}: is one piece of a mesh that is cut up for several processes, with the"
                f" joints {quoted(joints)} to others; join the pieces and save the whole mesh"
            )
        mesh = file["ENS_MAA"][names[0]]
        _check_cartesian(path, mesh)
        step = mesh if "NOE" in mesh else _only_step(path, mesh)
        families = file["FAS"][names[0]] if "FAS" in file and names[0] in file["FAS"] else {}
        content = _content(path, step, families, int(mesh.attrs["ESP"]))
        content.unit = _stated_unit(mesh)
        return content


def _check_version(path: Path, file: Any) -> None:
    """Refuse files of MED 2, in which families and steps lie elsewhere."""
    said = file["INFOS_GENERALES"].attrs if "INFOS_GENERALES" in file else {}
    version = [int(said.get(part, 0)) for part in ("MAJ", "MIN", "REL")]
    if 0 < version[0] < OLDEST:
        raise ModelError(
            f"{path}: is of MED {'.'.join(map(str, version))}, and {OLDEST} or later is read; MED's"
            " program medimport makes it one, or open it in Salome and save it"
        )


def _check_cartesian(path: Path, mesh: Any) -> None:
    system = int(mesh.attrs.get("REP", 0))
    if system:
        name = SYSTEMS.get(system, "of an unknown kind")
        raise ModelError(
            f"{path}: its coordinates are {name} (REP = {system}); save them as Cartesian ones"
        )


def _stated_unit(mesh: Any) -> str:
    """The unit of the axes, which have 16 letters each; empty where none is stated."""
    letters = bytes(mesh.attrs.get("UNI", b"")).decode("latin-1").replace("\0", " ")
    units = dict.fromkeys(letters[i : i + 16].strip() for i in range(0, len(letters), 16))
    return ", ".join(unit for unit in units if unit.upper() not in UNKNOWN)


def _only_step(path: Path, mesh: Any) -> Any:
    if len(mesh) != 1:
        raise ModelError(f"{path}: holds {len(mesh)} steps of its mesh, not one")
    return next(iter(mesh.values()))


def _content(path: Path, step: Any, families: Any, dimension: int) -> MeshContent:
    coordinates = step["NOE"]["COO"][()]
    points = coordinates.reshape((dimension, -1)).T
    others = [name for name in step if name not in ("NOE", "MAI")]
    if others:
        raise ModelError(f"{path}: has cells under names that are not read: {quoted(others)}")
    unknown = [kind for kind in step.get("MAI", {}) if kind not in KINDS]
    if unknown:
        told = ", ".join(f"{_count(step['MAI'][kind])} {kind}" for kind in unknown)
        raise ModelError(f"{path}: has cells of kinds that are not read: {told}")
    cells, numbers = [], []
    for name, group in step.get("MAI", {}).items():
        count = _count(group)
        cells.append(CellBlock(KINDS[name], group["NOD"][()].reshape(-1, count).T - 1))
        numbers.append(_family_numbers(path, group, name, count, families, "ELEME"))
    sets: dict[str, list[IntArray]] = {}
    for number, family in _groups(families, "ELEME"):
        found = [np.flatnonzero(of_block == number) for of_block in numbers]
        if family in sets:
            found = [np.union1d(a, b) for a, b in zip(sets[family], found, strict=True)]
        sets[family] = found
    nodes = _family_numbers(path, step["NOE"], "NOE", len(points), families, "NOEUD")
    point_sets: dict[str, IntArray] = {}
    for number, family in _groups(families, "NOEUD"):
        marked = np.flatnonzero(nodes == number)
        point_sets[family] = np.union1d(point_sets.get(family, marked), marked)
    return MeshContent(np.ascontiguousarray(points), cells, cell_sets=sets, point_sets=point_sets)


def _family_numbers(
    path: Path, group: Any, name: str, count: int, families: Any, what: str
) -> IntArray:
    """Family of each cell or node of one kind, 0 for none."""
    if "FAM" not in group:
        return np.zeros(count, dtype=np.int64)
    numbers: IntArray = group["FAM"][()].astype(np.int64)
    if len(numbers) != count:
        raise ModelError(f"{path}: {name} has {count} members, but families for {len(numbers)}")
    defined = [0, *(int(family.attrs["NUM"]) for family in families.get(what, {}).values())]
    undefined = np.setdiff1d(numbers, defined)
    if len(undefined):
        raise ModelError(f"{path}: {name} is in family {undefined[0]}, which FAS does not define")
    return numbers


def _count(group: Any) -> int:
    return int(group["NOD"].attrs["NBR"])


def _groups(families: Any, what: str) -> Iterator[tuple[int, str]]:
    """Number of each family and the names of its groups, one after the other."""
    for family in families.get(what, {}).values():
        if "GRO" not in family:
            continue
        for letters in family["GRO"]["NOM"][()]:
            name = bytes(np.asarray(letters, dtype=np.uint8)).split(b"\0")[0]
            yield int(family.attrs["NUM"]), name.decode("utf-8", "replace").strip()
