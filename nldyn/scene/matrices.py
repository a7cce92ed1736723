"""From the matrices of a scene, typed in or in files, to a component."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

import cms
from cms.files.matrix_files import (
    FileMatrix,
    joined,
    read_matrix,
    read_skew,
    read_vector,
    split_source,
)
from nldyn.base.arrays import Real
from nldyn.scene.component import readable_path
from nldyn.scene.faults import told_as
from nldyn.scene.messages import KeyPath, scene_error
from nldyn.scene.schema.scene import Scene
from nldyn.scene.schema.structures import PlaceOfMatrices


def build_matrices(scene: Scene) -> cms.Matrices:
    """The component that ``[matrices]`` gives, its load vectors among its interfaces.

    Parameters
    ----------
    scene : Scene
        A scene with ``[matrices]``.

    Returns
    -------
    cms.Matrices
        Sparse matrices (N, N), without rows that a support holds, and vectors (N,).

    Raises
    ------
    SceneError
        If a file cannot be read, is not square and symmetric, or sizes differ.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> build_matrices(load_scene(example("one_dof.toml"))).mass.shape
    (1, 1)
    """
    table = scene.matrices
    assert table is not None
    given = {
        key: _matrix(scene, key, getattr(table, key))
        for key in ("stiffness", "mass", "damping")
        if getattr(table, key) is not None
    }
    with told_as(scene, ("matrices",), cms.ReductionError):
        read = joined(given["stiffness"], given["mass"], given.get("damping"))
    vectors = {
        name: _vector(scene, read, ("matrices", kind, name), value)
        for kind in ("interfaces", "loads")
        for name, value in getattr(table, kind).items()
    }
    return replace(read.component(vectors), load_vectors=tuple(table.loads), digits=table.digits)


def skew_matrices(scene: Scene, rows: int, table: str = "") -> dict[str, Any]:
    """The ``gyroscopic`` and the ``circulatory`` matrix that ``[matrices]`` gives, (rows, rows).

    Parameters
    ----------
    scene : Scene
        A scene with ``[matrices]``.
    rows : int
        How many rows they must have.
    table : str
        ``"spin"`` for those of ``[matrices.spin]``.

    Raises
    ------
    SceneError
        If a file cannot be read, or a matrix is not skew or not of this size.
    """
    found = {}
    where: KeyPath = ("matrices", table) if table else ("matrices",)
    given = getattr(scene.matrices, table) if table else scene.matrices
    for key in ("gyroscopic", "circulatory"):
        value, place = getattr(given, key, None), (*where, key)
        if value is None:
            continue
        if isinstance(value, str):
            with told_as(scene, place, cms.ReductionError):
                matrix = read_skew(_source(scene, value, place), key)
        else:
            matrix = sparse.csc_array(np.array(value, dtype=float))
        if matrix.shape[0] != rows:
            fault = f"has {matrix.shape[0]} rows, but {rows} rows of the matrices can move"
            raise scene_error(scene.file, place, fault)
        found[key] = matrix
    return found


def _matrix(scene: Scene, key: str, value: list[list[float]] | str) -> FileMatrix:
    place = ("matrices", key)
    if not isinstance(value, str):
        count = len(value)
        if any(len(row) != count for row in value):
            raise scene_error(scene.file, place, "must be square")
        return FileMatrix(sparse.csc_array(np.array(value, dtype=float)), f"the {key} typed in")
    with told_as(scene, place, cms.ReductionError):
        return read_matrix(_source(scene, value, place), key)


def _source(scene: Scene, value: str, key: KeyPath) -> str:
    """The file that a value names, with its variable."""
    file, variable = split_source(value)
    path = readable_path(scene, str(file), key)
    return str(path) if variable is None else f"{path}:{variable}"


def _vector(
    scene: Scene, read: cms.ReadMatrices, key: KeyPath, value: list[float] | PlaceOfMatrices | str
) -> Real:
    with told_as(scene, key, cms.ReductionError):
        if isinstance(value, str):
            vector = read.of_file(read_vector(_source(scene, value, key)))
        elif isinstance(value, list):
            vector = read.of_file(np.array(value, dtype=float))
        else:
            vector = _at_place(read, value)
    if not np.any(vector):
        fault = "must not be zero throughout: nothing could move there"
        raise scene_error(scene.file, key, fault)
    return vector


def _at_place(read: cms.ReadMatrices, place: PlaceOfMatrices) -> Real:
    if place.node is not None:
        assert place.direction is not None
        return read.at_node(place.node, place.direction)
    rows: dict[Any, float] = {place.row: 1.0} if place.rows is None else place.rows
    return read.at_rows({int(row): weight for row, weight in rows.items()})
