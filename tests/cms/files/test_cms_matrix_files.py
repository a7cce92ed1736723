"""Matrices from the files of other programs: the chain 2 -1, -1 2 -1, -1 2 with masses 1, 2 and 1.

Its squares of circular frequencies are those of det(K - w^2 M) = 0: 2 and (3 +- sqrt(5)) / 2.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import io, sparse

import cms

STIFFNESS = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
MASS = np.diag([1.0, 2.0, 1.0])
SQUARES = np.array([(3.0 - 5.0**0.5) / 2.0, 2.0, (3.0 + 5.0**0.5) / 2.0])

ABAQUS_STIFFNESS = """** Abaqus, *MATRIX OUTPUT, FORMAT=MATRIX INPUT: node 4 is held
12,1, 12,1, 2.00000000000000000e+00
12,2, 12,1, -1.00000000000000000e+00
12,2, 12,2, 2.00000000000000000e+00
31,1, 12,2, -1.00000000000000000e+00
31,1, 31,1, 2.00000000000000000e+00
4,1, 4,1, 1.00000000000000000e+36
"""
ABAQUS_MASS = """12,1, 12,1, 1.0
12,2, 12,2, 2.0
31,1, 31,1, 1.0
"""
COORDINATE = "1 1 2.0\n1 2 -1.0\n2 2 2.0\n2 3 -1.0\n3 3 2.0\n"
DIAGONAL = "1 1 1.0\n2 2 2.0\n3 3 1.0\n"
HARWELL_BOEING = """Stiffness of a chain                                                    CHAIN
             5             1             1             3             0
RSA                        3             3             5             0
(4I8)           (5I8)           (3D20.12)
       1       3       5       6
       1       2       2       3       3
  2.000000000000D+00 -1.000000000000D+00  2.000000000000D+00
 -1.000000000000D+00  2.000000000000D+00
"""
HARWELL_BOEING_OF_BOTH_TRIANGLES = """Stiffness of a chain
             6             1             1             4             0
RSA                        3             3             7             0
(4I8)           (7I8)           (2D20.12)
       1       3       6       8
       1       2       1       2       3       2       3
  2.000000000000D+00 -1.000000000000D+00
 -1.000000000000D+00  2.000000000000D+00
 -1.000000000000D+00 -1.000000000000D+00
  2.000000000000D+00
"""
HARWELL_BOEING_MASS = """Mass of a chain
             3             1             1             1             0
RSA                        3             3             3             0
(4I8)           (5I8)           (3D20.12)
       1       2       3       4
       1       2       3
  1.000000000000D+00  2.000000000000D+00  1.000000000000D+00
"""


def dmig(name: str, entries: list[tuple[int, int, int, int, float]]) -> str:
    lines = [f"DMIG    {name:8}{0:8}{6:8}{2:8}{0:8}"]
    for column, component, row, other, value in entries:
        lines.append(f"DMIG*   {name:16}{column:16}{component:16}")
        lines.append(f"*       {row:16}{other:16}{f'{value:.9E}'.replace('E', 'D'):>16}")
    return "\n".join(lines) + "\n"


PUNCH = dmig(
    "KAAX",
    [
        (12, 1, 12, 1, 2.0),
        (12, 1, 12, 2, -1.0),
        (12, 2, 12, 2, 2.0),
        (12, 2, 31, 1, -1.0),
        (31, 1, 31, 1, 2.0),
    ],
) + dmig("MAAX", [(12, 1, 12, 1, 1.0), (12, 2, 12, 2, 2.0), (31, 1, 31, 1, 1.0)])


@pytest.fixture
def files(tmp_path):
    texts = {
        "abaqus_K.mtx": ABAQUS_STIFFNESS,
        "abaqus_M.mtx": ABAQUS_MASS,
        "plain_K.mtx": COORDINATE,
        "plain_M.mtx": DIAGONAL,
        "job.sti": COORDINATE,
        "job.mas": DIAGONAL,
        "job.dof": "12.1\n12.2\n31.1\n",
        "ansys_K.matrix": HARWELL_BOEING,
        "ansys_both.matrix": HARWELL_BOEING_OF_BOTH_TRIANGLES,
        "ansys_M.matrix": HARWELL_BOEING_MASS,
        "nastran.pch": f"$TITLE = CHAIN\n{PUNCH}",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    for name, matrix in (("K", STIFFNESS), ("M", MASS)):
        io.mmwrite(tmp_path / f"dense_{name}.mtx", matrix)
        io.mmwrite(tmp_path / f"{name}.mtx", sparse.coo_array(matrix), symmetry="symmetric")
        np.save(tmp_path / f"{name}.npy", matrix)
        np.savez(tmp_path / f"{name}.npz", matrix)
        sparse.save_npz(tmp_path / f"sparse_{name}.npz", sparse.csr_array(matrix))
    np.savez(tmp_path / "both.npz", K=STIFFNESS, M=MASS)
    io.savemat(tmp_path / "both.mat", {"K": sparse.csc_matrix(STIFFNESS), "M": MASS})
    return tmp_path


PAIRS = [
    ("ansys_both.matrix", "ansys_M.matrix"),
    ("K.mtx", "M.mtx"),
    ("dense_K.mtx", "dense_M.mtx"),
    ("K.npy", "M.npy"),
    ("K.npz", "M.npz"),
    ("sparse_K.npz", "sparse_M.npz"),
    ("both.npz:K", "both.npz:M"),
    ("both.mat:K", "both.mat:M"),
    ("abaqus_K.mtx", "abaqus_M.mtx"),
    ("plain_K.mtx", "plain_M.mtx"),
    ("job.sti", "job.mas"),
    ("ansys_K.matrix", "ansys_M.matrix"),
    ("nastran.pch:KAAX", "nastran.pch:MAAX"),
    ("job.sti", "nastran.pch:MAAX"),
]


@pytest.mark.parametrize(("stiffness", "mass"), PAIRS)
def test_the_chain_has_its_frequencies_from_every_format(files, stiffness, mass):
    read = cms.read_matrices(files / stiffness, files / mass)
    reduced = cms.reduce(read.component({}), modes=3)
    omega = 2.0 * np.pi * reduced.frequencies_hz
    assert omega**2 == pytest.approx(SQUARES, rel=1e-9)


@pytest.mark.parametrize("pair", [PAIRS[8], PAIRS[10], PAIRS[12]])
def test_interfaces_by_nodes(files, pair):
    read = cms.read_matrices(files / pair[0], files / pair[1])
    load = read.at_node(12, "y")
    assert load @ read.stiffness @ load == 2.0 and load @ read.mass @ load == 2.0
    with pytest.raises(cms.ReductionError, match="'z' of node 12, which is free in: x, y"):
        read.at_node(12, "z")
    with pytest.raises(cms.ReductionError, match="node 5, which they do not have"):
        read.at_node(5, "x")


def test_rows_are_those_of_the_files_though_supports_hold_some(tmp_path):
    (tmp_path / "K.mtx").write_text("1 1 1e36\n2 2 5.0\n3 3 7.0\n")
    (tmp_path / "M.mtx").write_text(DIAGONAL)
    read = cms.read_matrices(tmp_path / "K.mtx", tmp_path / "M.mtx")
    assert read.stiffness.shape == (2, 2)
    assert read.at_rows({3: -2.0}).tolist() == [0.0, -2.0]
    with pytest.raises(cms.ReductionError, match="row 1 is held by a support"):
        read.at_rows({1: 1.0})
    with pytest.raises(cms.ReductionError, match="no row 4: rows are counted from 1 to 3"):
        read.at_rows({4: 1.0})


def test_degrees_of_freedom_without_mass_or_stiffness_keep_their_place(tmp_path):
    (tmp_path / "K.mtx").write_text("1,1,1,1,3.0\n2,1,2,1,4.0\n2,6,2,6,5.0\n")
    (tmp_path / "M.mtx").write_text("1,1,1,1,1.0\n2,1,2,1,2.0\n")
    read = cms.read_matrices(tmp_path / "K.mtx", tmp_path / "M.mtx")
    assert read.mass.toarray().tolist() == np.diag([1.0, 2.0, 0.0]).tolist()
    assert read.at_node(2, "rotation_z").tolist() == [0.0, 0.0, 1.0]


BAD = {
    "wide.npy": (
        lambda path: np.save(path, np.ones((2, 3))),
        "shape \\(2, 3\\), it must be square",
    ),
    "skew.npy": (lambda path: np.save(path, np.eye(2) + np.eye(2, k=1)), "not symmetric.*triangle"),
    "complex.npy": (lambda path: np.save(path, 1j * np.eye(2)), "is complex"),
    "text.npy": (lambda path: np.save(path, np.array(["a"])), "matrix of numbers"),
    "nan.npy": (lambda path: np.save(path, np.full((2, 2), np.nan)), "entry nan in row"),
    "empty.mtx": (lambda path: path.write_text(""), "is empty"),
    "words.mtx": (lambda path: path.write_text("once upon a time\n"), "format that is known"),
    "short.mtx": (lambda path: path.write_text("1 1 2.0\n2 2\n"), "3 numbers in every line"),
    "zero.mtx": (lambda path: path.write_text("0 0 2.0\n"), "counted from 1"),
    "cut.mtx": (
        lambda path: path.write_text("%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 1"),
        "cannot be read",
    ),
    "huge.mtx": (
        lambda path: path.write_text(
            "%%MatrixMarket matrix array real general\n900000000 900000000\n"
        ),
        "more than 20000 rows",
    ),
    "twice.mtx": (
        lambda path: path.write_text(
            "%%MatrixMarket matrix coordinate real symmetric\n"
            "2 2 4\n1 1 3.0\n2 1 -1.0\n1 2 -1.0\n2 2 4.0\n"
        ),
        "entry \\(2, 1\\) twice.*one triangle",
    ),
    "cut.matrix": (lambda path: path.write_text(HARWELL_BOEING[:-50]), "ends before"),
    "half.npz": (lambda path: path.write_bytes(b"PK\x03\x04 and no more"), "cannot be read"),
    "half.mat": (lambda path: path.write_bytes(b"MATLAB 5.0 and no more"), "cannot be read"),
    "model.op4": (lambda path: path.write_bytes(b""), "OUTPUT4 is not read"),
    "model.full": (lambda path: path.write_bytes(b""), "HBMAT"),
    "absent.mtx": (lambda path: None, "does not exist"),
}


@pytest.mark.parametrize("name", BAD)
def test_files_that_hold_no_matrix_are_told(tmp_path, name):
    make, words = BAD[name]
    make(tmp_path / name)
    with pytest.raises(cms.ReductionError, match=words) as told:
        cms.read_matrices(tmp_path / name, tmp_path / name)
    assert name in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("both.npz", 'must be told as "both.npz:K", as it has the variables K, M'),
        ("both.mat:C", "has no variable 'C'; it has: K, M"),
        ("nastran.pch", 'must be told as "nastran.pch:KAAX"'),
        ("nastran.pch:BAAX", "has no matrix 'BAAX'; it has: KAAX, MAAX"),
    ],
)
def test_files_of_several_matrices_need_a_name(files, source, words):
    with pytest.raises(cms.ReductionError, match=words):
        cms.read_matrices(f"{files}/{source}", files / "M.mtx")


def test_matrices_of_different_sizes(files):
    np.save(files / "two.npy", np.eye(2))
    with pytest.raises(cms.ReductionError, match=r"two.npy has 2 rows, but .*K.mtx has 3"):
        cms.read_matrices(files / "K.mtx", files / "two.npy")
