"""Matrices from files: MatrixMarket, NumPy, MATLAB, Abaqus, Ansys, CalculiX and Nastran."""

from __future__ import annotations

import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import io, sparse

from cms.base.arrays import SparseMatrix
from cms.base.errors import ReductionError
from cms.component.component import SYMMETRY_TOLERANCE, Matrices, symmetric_matrix
from cms.files.file_entries import chosen_entry
from cms.files.harwell_boeing import is_harwell_boeing, read_harwell_boeing
from cms.files.punch import read_punch
from cms.files.triangles import check_one_triangle, mirrored

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_ROWS = 2_000_000
MOST_DENSE_ROWS = 20_000
HELD = 1e35  # on the diagonal of a stiffness: Abaqus writes 1e36 where a support holds
DIRECTIONS = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
WITH_VARIABLES = (".mat", ".npz", ".pch")
NOT_READ = {
    ".op4": "OUTPUT4 is not read: write DMIG to a .pch file (PARAM,EXTOUT,DMIGPCH), or convert it "
    "with pyNastran and scipy.sparse.save_npz",
    ".full": "this binary file of Ansys is not read: write it with the command HBMAT",
    ".sim": "this binary file of Abaqus is not read: use *MATRIX OUTPUT, FORMAT=MATRIX INPUT",
}
UNREADABLE = (
    *(OSError, ValueError, TypeError, KeyError, IndexError, EOFError, OverflowError, MemoryError),
    *(NotImplementedError, zipfile.BadZipFile, zlib.error),
)


@dataclass(frozen=True, eq=False)
class FileMatrix:
    """A matrix with the node and direction (1 to 6) of each row, (n, 2), where its file has them.

    ``source`` is the file's name.
    """

    entries: SparseMatrix
    source: str
    labels: IntArray | None = None


@dataclass(frozen=True, eq=False)
class ReadMatrices:
    """Matrices of one component, as `read_matrices` gives them.

    Parameters
    ----------
    stiffness, mass : (N, N) sparse arrays
        Without the rows that a support holds.
    damping : (N, N) sparse array, optional
        Damping matrix.
    rows : (N,) array of int
        Row of each degree of freedom in the files, counted from 1.
    labels : (N, 2) array of int, optional
        Its node, and its direction from 1 to 6: x, y, z and the rotations about them.
    """

    stiffness: SparseMatrix
    mass: SparseMatrix
    damping: SparseMatrix | None
    rows: IntArray
    labels: IntArray | None
    file_rows: int

    def at_rows(self, weights: Mapping[int, float]) -> FloatArray:
        """Interface vector (N,) with weights at some rows of the files, counted from 1.

        Raises
        ------
        ReductionError
            If there is no such row, or a support holds it.
        """
        vector = np.zeros(self.rows.size)
        for row, weight in weights.items():
            if not 1 <= row <= self.file_rows:
                raise ReductionError(
                    f"there is no row {row}: rows are counted from 1 to {self.file_rows}"
                )
            found = np.flatnonzero(self.rows == row)
            if not found.size:
                raise ReductionError(f"row {row} is held by a support")
            vector[found] = weight
        return vector

    def at_node(self, node: int, direction: str) -> FloatArray:
        """Interface vector (N,) of a node and a direction: "x", ..., "rotation_z".

        Raises
        ------
        ReductionError
            If the files do not name nodes, or have no free degree of freedom there.
        """
        if direction not in DIRECTIONS:
            raise ReductionError(f"a direction is one of {', '.join(DIRECTIONS)}, not {direction}")
        if self.labels is None:
            raise ReductionError("the files do not tell nodes: give the row instead")
        here = self.labels[:, 0] == node
        wanted = here & (self.labels[:, 1] == DIRECTIONS.index(direction) + 1)
        if not np.any(wanted):
            there = [DIRECTIONS[k - 1] for k in self.labels[here, 1] if 1 <= k <= 6]
            free = f"which is free in: {', '.join(there)}" if there else "which they do not have"
            raise ReductionError(f"the matrices do not have '{direction}' of node {node}, {free}")
        return np.asarray(wanted, dtype=np.float64)

    def of_file(self, vector: FloatArray) -> FloatArray:
        """A vector over the rows of the files without those that are held, (N,).

        Raises
        ------
        ReductionError
            If its length is not that of the matrices.
        """
        if vector.shape != (self.file_rows,):
            raise ReductionError(
                f"there must be {self.file_rows} numbers, one per row of the matrices, not "
                f"{vector.size}"
            )
        return np.asarray(vector[self.rows - 1])

    def component(self, interfaces: Mapping[str, FloatArray]) -> Matrices:
        """What `cms.reduce` takes, with these interface vectors (N,)."""
        return Matrices(self.stiffness, self.mass, interfaces, self.damping)


def read_matrices(
    stiffness: str | Path, mass: str | Path, damping: str | Path | None = None
) -> ReadMatrices:
    """Read the matrices of a component from the files of other programs.

    Parameters
    ----------
    stiffness, mass, damping : str or Path
        MatrixMarket (.mtx), NumPy (.npy, .npz), MATLAB (.mat), Abaqus' text (.mtx), CalculiX
        (.sti, .mas, with .dof beside it), Harwell-Boeing as Ansys writes it, or a Nastran punch
        file (.pch). ``"file.mat:K"`` names the variable where a .mat, .npz or .pch has several.

    Returns
    -------
    ReadMatrices
        In the units of the files. Rows that a support holds are left out.

    Raises
    ------
    ReductionError
        With the file, if it cannot be read, is not square and symmetric, or sizes differ.

    Examples
    --------
    >>> import tempfile, numpy as np, cms
    >>> from scipy import io, sparse
    >>> chain = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(30, 30))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     io.mmwrite(f"{folder}/K.mtx", chain)
    ...     io.mmwrite(f"{folder}/M.mtx", sparse.eye_array(30))
    ...     read = cms.read_matrices(f"{folder}/K.mtx", f"{folder}/M.mtx")
    >>> reduced = cms.reduce(read.component({"first": read.at_rows({1: 1.0})}), modes=3)
    >>> float(round(reduced.static_flexibility("first"), 6))  # 30 / 31
    0.967742
    """
    return joined(
        read_matrix(stiffness, "stiffness"),
        read_matrix(mass, "mass"),
        None if damping is None else read_matrix(damping, "damping"),
    )


def read_matrix(source: str | Path, what: str) -> FileMatrix:
    """Read one symmetric matrix, told as "stiffness", "mass" or "damping" in errors.

    Raises
    ------
    ReductionError
        As `read_matrices`.
    """
    found = _read(source)
    try:
        entries = symmetric_matrix(found.entries, what)
    except ReductionError as error:
        triangle = _one_triangle(found.entries)
        hint = "; a file of one triangle must say 'symmetric' in its first line" if triangle else ""
        raise ReductionError(f"{found.source}: {error}{hint}") from None
    return FileMatrix(entries, found.source, found.labels)


def read_skew(source: str | Path, what: str) -> SparseMatrix:
    """Read a skew matrix (n, n), told as "gyroscopic" or "circulatory" in errors.

    Raises
    ------
    ReductionError
        If the file cannot be read, tells nodes, or holds no skew matrix of finite real numbers.
    """
    found = _read(source)
    if found.labels is not None:
        raise ReductionError(f"{found.source}: must give rows, as .mtx and .npz do, and no nodes")
    entries = sparse.csc_array(found.entries)
    if np.iscomplexobj(entries.data) or not np.all(np.isfinite(entries.data)):
        raise ReductionError(f"{found.source}: the {what} matrix must hold finite real numbers")
    if entries.shape[0] != entries.shape[1]:
        raise ReductionError(f"{found.source}: the {what} matrix must be square")
    if abs(entries + entries.T).max() > SYMMETRY_TOLERANCE * abs(entries).max():
        raise ReductionError(
            f"{found.source}: the {what} matrix must be skew: its transpose must be minus itself"
        )
    return sparse.csc_array((entries - entries.T) * 0.5)


def read_vector(source: str | Path) -> FloatArray:
    """Read a vector (n,) from a file, as a column, a row or an array of one dimension.

    Raises
    ------
    ReductionError
        If the file cannot be read, or holds no vector of real numbers.
    """
    found = _read(source)
    shape = found.entries.shape
    if 1 not in shape or np.iscomplexobj(found.entries):
        kind = "complex" if np.iscomplexobj(found.entries) else f"of shape {shape}"
        raise ReductionError(f"{found.source}: must hold a vector of real numbers, but is {kind}")
    return np.asarray(found.entries.toarray(), dtype=np.float64).ravel()


def joined(
    stiffness: FileMatrix, mass: FileMatrix, damping: FileMatrix | None = None
) -> ReadMatrices:
    """The matrices over one set of degrees of freedom, without those that supports hold.

    Raises
    ------
    ReductionError
        If sizes differ, or one tells nodes and another does not.
    """
    given = [stiffness, mass, *([] if damping is None else [damping])]
    labels = _common_labels(given)
    if labels is None:
        for other in given[1:]:
            if other.entries.shape != stiffness.entries.shape:
                raise ReductionError(
                    f"{other.source} has {other.entries.shape[0]} rows, but {stiffness.source} "
                    f"has {stiffness.entries.shape[0]}"
                )
        every = [one.entries for one in given]
    else:
        every = [_spread(one, labels) for one in given]
    free = np.flatnonzero(every[0].diagonal() < HELD)
    if not free.size:
        raise ReductionError(f"{stiffness.source}: supports hold every row")
    kept = [sparse.csc_array(matrix[free][:, free]) for matrix in every]
    return ReadMatrices(
        kept[0],
        kept[1],
        kept[2] if damping is not None else None,
        free.astype(np.int64) + 1,
        None if labels is None else labels[free],
        int(every[0].shape[0]),
    )


def _common_labels(given: list[FileMatrix]) -> IntArray | None:
    """All nodes and directions (n, 2) of the matrices, ascending; None where none tells any."""
    known = [one.labels for one in given if one.labels is not None]
    if not known:
        return None
    if all(np.array_equal(one.labels, known[0]) for one in given if one.labels is not None):
        silent = [one for one in given if one.labels is None]
        if all(one.entries.shape[0] == known[0].shape[0] for one in silent):
            return known[0]
    for one in given:
        if one.labels is None:
            raise ReductionError(f"{one.source} does not tell nodes, but other matrices do")
    return np.asarray(np.unique(np.vstack(known), axis=0))


def _spread(one: FileMatrix, labels: IntArray) -> SparseMatrix:
    """The matrix over more degrees of freedom (n, 2) than its own."""
    if one.labels is None or np.array_equal(one.labels, labels):
        return one.entries
    place = {tuple(label): row for row, label in enumerate(labels.tolist())}
    rows = np.array([place[tuple(label)] for label in one.labels.tolist()])
    entries = sparse.coo_array(one.entries)
    size = labels.shape[0]
    return sparse.csc_array(
        (entries.data, (rows[entries.row], rows[entries.col])), shape=(size, size)
    )


def split_source(source: str | Path) -> tuple[Path, str | None]:
    """A file and the variable in it: "model.mat:K" is K of model.mat.

    Examples
    --------
    >>> split_source("model.mat:K")[1], split_source("M.mtx")[1]
    ('K', None)
    """
    file, colon, name = str(source).rpartition(":")
    if colon and Path(file).suffix.lower() in WITH_VARIABLES:
        return Path(file), name
    return Path(source), None


def _read(source: str | Path) -> FileMatrix:
    path, name = split_source(source)
    suffix = path.suffix.lower()
    if suffix in NOT_READ:
        raise ReductionError(f"{path}: {NOT_READ[suffix]}")
    try:
        if suffix == ".npy":
            found = _from_array(path, np.load(path, allow_pickle=False))
        elif suffix == ".npz":
            found = _from_npz(path, name)
        elif suffix == ".mat":
            found = _from_variables(path, _mat_variables(path), name)
        else:
            found = _from_text(path, name)
    except ReductionError as error:
        raise ReductionError(f"{path}: {error}") from None
    except UNREADABLE as error:
        reason = "does not exist" if isinstance(error, FileNotFoundError) else str(error)
        reason = reason.splitlines()[0][:200] if reason else type(error).__name__
        raise ReductionError(f"{path}: cannot be read: {reason}") from None
    if max(found.entries.shape) > MOST_ROWS:
        raise ReductionError(f"{path}: has more than {MOST_ROWS} rows")
    return found


def _from_array(path: Path, array: Any) -> FileMatrix:
    if not sparse.issparse(array):
        array = np.atleast_1d(array)
        if array.dtype.kind not in "iufcb" or array.ndim > 2:
            raise ReductionError("does not hold a matrix of numbers")
        array = array[:, None] if array.ndim == 1 else array
    return FileMatrix(sparse.csc_array(array), str(path))


def _from_npz(path: Path, name: str | None) -> FileMatrix:
    with np.load(path, allow_pickle=False) as file:
        keys = set(file.files)
        arrays = {} if "format" in keys else {key: file[key] for key in file.files}
    if "format" in keys and "shape" in keys:
        return _from_array(path, sparse.load_npz(path))
    return _from_variables(path, arrays, name)


def _mat_variables(path: Path) -> dict[str, Any]:
    try:
        found = io.loadmat(path, spmatrix=False)
    except NotImplementedError:
        raise ReductionError("is a file of MATLAB 7.3: save it with '-v7'") from None
    return {key: value for key, value in found.items() if not key.startswith("__")}


def _from_variables(path: Path, variables: Mapping[str, Any], name: str | None) -> FileMatrix:
    chosen = chosen_entry(path, variables, name, ("variable", "variables"), "K")
    return _from_array(path, variables[chosen])


def _from_text(path: Path, name: str | None) -> FileMatrix:
    if path.suffix.lower() == ".pch":
        return _labelled(path, *read_punch(path, name))
    with path.open(encoding="latin-1") as file:
        head = [file.readline(1000) for _ in range(3)]
    if head[0].lower().startswith("%%matrixmarket"):
        return _from_matrix_market(path)
    if is_harwell_boeing(head):
        return FileMatrix(read_harwell_boeing(path), str(path))
    return _from_entries(path)


def _from_matrix_market(path: Path) -> FileMatrix:
    rows, columns, _, form, field, symmetry = io.mminfo(path)
    if field == "pattern":
        raise ReductionError("is a pattern without numbers")
    most = MOST_ROWS if form == "coordinate" else MOST_DENSE_ROWS
    if max(rows, columns) > most:
        raise ReductionError(f"has more than {most} rows")
    found = io.mmread(path, spmatrix=False)
    if form == "coordinate" and symmetry != "general":
        check_one_triangle(found)
    return _from_array(path, found)


def _from_entries(path: Path) -> FileMatrix:
    """Entries of Abaqus or CalculiX, one to a line, of one triangle or of both."""
    table = _numbers_of(path)
    indices = np.rint(table[:, :-1]).astype(np.int64)
    if np.any(indices != table[:, :-1]):
        raise ReductionError("rows, columns, nodes and directions must be whole numbers")
    if table.shape[1] == 5:
        return _labelled(path, indices[:, :2], indices[:, 2:4], table[:, 4])
    if indices.min() < 1:
        raise ReductionError("rows and columns must be counted from 1")
    size = int(indices.max())
    if size > MOST_ROWS:
        raise ReductionError(f"has more than {MOST_ROWS} rows")
    places = (indices[:, 0] - 1, indices[:, 1] - 1)
    entries = mirrored(sparse.csc_array((table[:, 2], places), shape=(size, size)))
    return FileMatrix(entries, str(path), _calculix_labels(path, size))


def _numbers_of(path: Path) -> FloatArray:
    """The numbers of a file (m, 3) or (m, 5), between commas or blanks."""
    text = path.read_text(encoding="latin-1")
    lines = [line for line in text.splitlines() if line.strip() and line.lstrip()[0] not in "*#"]
    if not lines:
        raise ReductionError("is empty")
    width = len(lines[0].replace(",", " ").split())
    if width not in (3, 5):
        raise ReductionError(
            "is no matrix in a format that is known: its lines must hold a row, a column and a "
            "number, or two nodes with their directions and a number"
        )
    try:
        flat = " ".join(lines).replace(",", " ").replace("D", "E").replace("d", "e")
        found = np.array(flat.split(), dtype=np.float64)
        return found.reshape(len(lines), width)
    except ValueError:
        raise ReductionError(f"must have {width} numbers in every line") from None


def _calculix_labels(path: Path, size: int) -> IntArray | None:
    """Nodes and directions from CalculiX' file of degrees of freedom beside a matrix."""
    beside = path.with_suffix(".dof")
    if path.suffix.lower() not in (".sti", ".mas") or not beside.is_file():
        return None
    words = beside.read_text(encoding="latin-1").split()
    if len(words) != size or not all(re.fullmatch(r"\d+\.\d", word) for word in words):
        raise ReductionError(f"{beside.name} beside it does not tell {size} degrees of freedom")
    return np.array([[int(part) for part in word.split(".")] for word in words], dtype=np.int64)


def _labelled(path: Path, rows: IntArray, columns: IntArray, values: FloatArray) -> FileMatrix:
    """A matrix whose entries tell their nodes and directions, each (m, 2)."""
    labels, place = np.unique(np.vstack([rows, columns]), axis=0, return_inverse=True)
    place = place.ravel()
    size = labels.shape[0]
    half = values.size
    entries = sparse.csc_array((values, (place[:half], place[half:])), shape=(size, size))
    return FileMatrix(mirrored(entries), str(path), labels)


def _one_triangle(matrix: Any) -> bool:
    found = sparse.csc_array(matrix)
    if found.shape[0] != found.shape[1]:
        return False
    return any(half(found, k).nnz == 0 for half, k in ((sparse.tril, -1), (sparse.triu, 1)))
