"""Matrices from files in scenes, against the closed form of a chain between two walls."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import io, sparse

from nldyn import SceneError, solve_orbit
from nldyn.app.cli import main
from nldyn.scene.build import build_system
from nldyn.scene.case_fingerprints import case_fingerprints
from nldyn.scene.read import load_scene, parse_scene

COUNT = 60
REST = """
[[excitation]]
at = "load"
kind = "harmonic"
amplitude = 1.0

[continuation]
range_hz = [0.01, 0.02]
"""


def chain(count: int):
    return sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(count, count)).tocsc()


def frequencies(count: int):
    """Of masses 1 and springs 1 between walls: 2 sin(k pi / 2 / (count + 1)) in rad/s."""
    return np.sin(np.arange(1, count + 1) * np.pi / 2 / (count + 1)) / np.pi


def written(folder, head: str, count: int = COUNT):
    io.mmwrite(folder / "M.mtx", sparse.eye_array(count))
    sparse.save_npz(folder / "K.npz", chain(count))
    io.savemat(folder / "all.mat", {"K": chain(count), "M": sparse.eye_array(count).tocsc()})
    np.save(folder / "load.npy", np.eye(count)[count // 2 - 1])
    (folder / "scene.toml").write_text(head + REST)
    return folder / "scene.toml"


FILES = '[matrices]\nmass = "M.mtx"\nstiffness = "K.npz"\n'
MAT = '[matrices]\nmass = "all.mat:M"\nstiffness = "all.mat:K"\n'


@pytest.mark.parametrize("files", [FILES, MAT])
@pytest.mark.parametrize(
    "place", ["{row = 30}", "{rows = {30 = 1.0}}", '"load.npy"'], ids=["row", "rows", "file"]
)
def test_a_chain_from_files_moves_as_its_closed_form(tmp_path, files, place):
    system = build_system(load_scene(written(tmp_path, f"{files}interfaces.load = {place}\n")))
    assert system.frequencies_hz == pytest.approx(frequencies(COUNT), rel=1e-9)
    k = np.arange(1, COUNT + 1)
    shapes = np.sqrt(2.0 / (COUNT + 1)) * np.sin(k * 30 * np.pi / (COUNT + 1))
    assert np.abs(system.participation["load"]) == pytest.approx(np.abs(shapes), abs=1e-9)


def test_reduced_matrices_keep_modes_and_statics(tmp_path):
    head = (
        f"{FILES}interfaces.load = {{row = 30}}\ninterfaces.apart = {{rows = {{1 = 1, 60 = -1}}}}\n"
    )
    scene = load_scene(written(tmp_path, f"{head}[reduction]\nmodes = 5\n"))
    system = build_system(scene)
    assert system.frequencies_hz[:5] == pytest.approx(frequencies(COUNT)[:5], rel=1e-9)
    flexibility = np.linalg.inv(chain(COUNT).toarray())
    apart = np.zeros(COUNT)
    apart[[0, -1]] = 1.0, -1.0
    squares = system.natural_frequencies**2
    for name, vector in (("load", np.eye(COUNT)[29]), ("apart", apart)):
        static = np.sum(system.participation[name] ** 2 / squares)
        assert static == pytest.approx(vector @ flexibility @ vector, rel=1e-8)


def test_reduced_matrices_take_dampings_and_loads(tmp_path):
    head = (
        f'{FILES}damping = "K.npz"\ninterfaces.load = {{row = 30}}\nloads.weight = {{row = 7}}\n'
        "[reduction]\nmodes = 5\n"
    )
    system = build_system(load_scene(written(tmp_path, head)))
    assert system.loads["weight"].shape == (system.size,) and system.interfaces == ("load",)
    omega = system.natural_frequencies
    assert np.diag(system.damping)[:5] == pytest.approx(omega[:5] ** 2, rel=1e-8)
    rayleigh = head.replace('damping = "K.npz"\n', "") + "[damping]\nrayleigh_stiffness = 1.0\n"
    again = build_system(load_scene(written(tmp_path, rayleigh)))
    assert again.damping == pytest.approx(system.damping, abs=1e-9)


def test_a_scene_of_files_is_checked_and_solved(tmp_path):
    damping = "[damping]\nmodal_ratio = 0.02\n"
    head = f"{FILES}interfaces.load = {{row = 30}}\n[reduction]\nmodes = 5\n{damping}"
    path = written(tmp_path, head)
    told = CliRunner().invoke(main, ["check", str(path)])
    assert told.exit_code == 0, told.output
    assert "matrices of 60 degrees of freedom" in told.output
    assert f"{frequencies(COUNT)[0]:.6f}" in told.output
    system = build_system(load_scene(path))
    omega = 2.0 * np.pi * 0.015
    phi = system.participation["load"]
    linear = phi**2 / (
        system.natural_frequencies**2 - omega**2 + 2j * 0.02 * system.natural_frequencies * omega
    )
    found = solve_orbit(system, 0.015).max_abs_displacement
    assert found == pytest.approx(abs(np.sum(linear)), rel=1e-6)


def test_large_matrices_must_be_reduced(tmp_path):
    path = written(tmp_path, f"{FILES}interfaces.load = {{row = 30}}\n", count=600)
    with pytest.raises(SceneError, match="reduction is missing: matrices of 600 rows"):
        build_system(load_scene(path))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('mass = "none.mtx"', "matrices.mass names .*none.mtx, which does not exist"),
        ('mass = "load.npy"', "matrices.mass: .*load.npy: the mass matrix has shape .60, 1."),
        ('mass = "all.mat"', 'matrices.mass: .*all.mat: must be told as "all.mat:K"'),
        ("mass = [[1.0]]", "matrices: the mass typed in has 1 rows, but .*K.npz has 60"),
        ("mass = 3", "matrices.mass must be a list in square brackets, not 3"),
        ('mass = [["a"]]', r"matrices.mass\[0\]\[0\] must be a number, not 'a'"),
    ],
)
def test_files_that_do_not_fit_are_told(tmp_path, line, words):
    head = f'[matrices]\n{line}\nstiffness = "K.npz"\ninterfaces.load = {{row = 30}}\n'
    with pytest.raises(SceneError, match=words):
        build_system(load_scene(written(tmp_path, head)))


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("{row = 0}", "load.row must be at least 1"),
        ("{row = 61}", "load: there is no row 61: rows are counted from 1 to 60"),
        ("{rows = {0 = 1.0}}", "must name rows by numbers from 1, not '0'"),
        ("{row = 3, node = 4}", "has both 'row' and 'node'; keep one"),
        ("{node = 4}", "needs both 'node' and 'direction'"),
        ('{node = 4, direction = "x"}', "the files do not tell nodes: give the row instead"),
        ("[1.0, 2.0]", "there must be 60 numbers, one per row of the matrices, not 2"),
        ('"all.mat:K"', "must hold a vector of real numbers, but is of shape"),
    ],
)
def test_interfaces_that_matrices_do_not_have(tmp_path, place, words):
    path = written(tmp_path, f"{FILES}interfaces.load = {place}\n")
    with pytest.raises(SceneError, match=words) as told:
        build_system(load_scene(path))
    assert "matrices.interfaces.load" in str(told.value)


def test_files_outside_the_folder_are_refused(tmp_path):
    (tmp_path / "inner").mkdir()
    path = written(tmp_path / "inner", f"{FILES}interfaces.load = {{row = 3}}\n")
    np.save(tmp_path / "secret.npy", np.eye(60))
    text = path.read_text().replace("M.mtx", "../secret.npy")
    with pytest.raises(SceneError, match="outside the folder of the scene"):
        build_system(parse_scene(text, path))


def test_studies_tell_files_of_matrices_apart(tmp_path):
    path = written(tmp_path, f'{FILES}interfaces.load = "load.npy"\n')
    tables = json.loads(json.dumps(tomllib.loads(path.read_text())))

    def key() -> str:
        return case_fingerprints([tables], tmp_path, max, "name")[0]

    keys = [key(), key()]
    for name, matrix in (("K.npz", 2.0 * chain(COUNT)), ("load.npy", np.ones(COUNT))):
        save = sparse.save_npz if name.endswith("npz") else np.save
        save(tmp_path / name, matrix)
        keys.append(key())
    assert keys[0] == keys[1] and len(set(keys)) == 3


WHIRL = """
[matrices]
mass = "M.mtx"
stiffness = "K.mtx"
gyroscopic = "G.mtx"
interfaces.x = {row = 19}
interfaces.y = {row = 20}
[reduction]
modes = 4
"""


def rotor(folder, G=None):
    """A chain of 10 masses that whirls: K the chain's in both planes, G = 0.3 (0 1; -1 0)."""
    chain = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(10, 10))
    spin = sparse.kron(sparse.eye_array(10), [[0.0, 0.3], [-0.3, 0.0]])
    for name, matrix in (
        ("K", sparse.kron(chain, sparse.eye_array(2))),
        ("M", sparse.eye_array(20)),
        ("G", spin if G is None else G),
    ):
        io.mmwrite(folder / f"{name}.mtx", matrix)
    return parse_scene(WHIRL, folder / "scene.toml")


def test_gyroscopic_matrix_of_a_file_goes_through_a_reduction(tmp_path):
    """The planes whirl at sqrt(w² + g²/4) -+ g/2, with the chain's w = 2 sin(k pi/22)."""
    rates = np.linalg.eigvals(build_system(rotor(tmp_path)).linear.blocks)
    found = np.sort(np.unique(abs(rates.imag.ravel()).round(12)))[:4]
    w = 2.0 * np.sin(np.array([1, 2]) * np.pi / 22)
    exact = [np.sqrt(w**2 + 0.15**2) - 0.15, np.sqrt(w**2 + 0.15**2) + 0.15]
    np.testing.assert_allclose(found, np.sort(np.ravel(exact)), rtol=1e-9)


@pytest.mark.parametrize(
    ("G", "fault"),
    [
        (np.eye(20), "the gyroscopic matrix must be skew"),
        (np.array([[0.0, 1.0], [-1.0, 0.0]]), "has 2 rows, but 20 rows of the matrices can move"),
    ],
)
def test_gyroscopic_matrix_of_a_file_that_does_not_fit(tmp_path, G, fault):
    with pytest.raises(SceneError, match=rf"matrices\.gyroscopic.* {fault}"):
        build_system(rotor(tmp_path, G))


def test_modes_are_not_chosen_beside_a_gyroscopic_matrix(tmp_path):
    text = WHIRL.replace("modes = 4", "tolerance = 0.01")
    with pytest.raises(SceneError, match=r"reduction\.tolerance knows no matrices\.gyroscopic"):
        parse_scene(text, tmp_path / "scene.toml")


def test_matrices_that_float_but_for_their_digits(tmp_path):
    """A free chain, rounded: unreduced its rigid mode would not lie at 0 Hz."""
    across = np.diff(np.eye(6), axis=0)
    exact = across.T @ (1e4 * np.sqrt([[2.0], [3.0], [5.0], [7.0], [11.0]]) * across)
    np.save(tmp_path / "M.npy", np.eye(6))
    scene = tmp_path / "chain.toml"
    text = '[matrices]\nstiffness = "K.npy"\nmass = "M.npy"\ninterfaces.load.row = 1\n'
    for digits, fault in (
        (7, "with 7 digits the stiffness holds by rounding what has 1 rigid-body mode: it needs"),
        (5, "5 digits of the stiffness leave open whether"),
    ):
        np.save(tmp_path / "K.npy", [[float(f"{x:.{digits - 1}e}") for x in row] for row in exact])
        scene.write_text(text + REST)
        with pytest.raises(SceneError, match=fault):
            build_system(load_scene(scene))
        scene.write_text(f"{text}digits = {digits}\n[reduction]\nmodes = 4\n{REST}")
        hz = build_system(load_scene(scene)).frequencies_hz
        known = np.sqrt(np.linalg.eigvalsh(exact)[1:4]) / (2 * np.pi)
        assert hz[0] == 0.0
        np.testing.assert_allclose(hz[1:4], known, rtol=10.0 ** (1 - digits))


TWO_PLANES = """
matrices = {mass = [[1, 0], [0, 1]], stiffness = [[4, 0], [0, 9]], interfaces.y = [0, 1]}
reduction.modes = 1
"""


def test_a_scene_counts_the_modes_that_an_interface_sees(caplog):
    with caplog.at_level("INFO", logger="nldyn"):
        system = build_system(parse_scene(TWO_PLANES, "scene.toml"))
    assert system.natural_frequencies == pytest.approx([3.0], rel=1e-14)
    assert "1 mode that no interface sees is left out: 0.3183 Hz" in caplog.text


def test_modes_that_a_gyroscopic_matrix_couples_are_seen():
    """λ² + s = 0 with (4 - s)(9 - s) = s."""
    turned = TWO_PLANES.replace("stiffness", "gyroscopic = [[0, 1], [-1, 0]], stiffness")
    scene = parse_scene(turned.replace("modes = 1", "modes = 2"), "scene.toml")
    rates = np.linalg.eigvals(build_system(scene).linear.blocks).ravel()
    exact = np.sqrt(7.0 + np.sqrt(13.0) * np.array([-1.0, 1.0]))
    assert np.unique(abs(rates.imag).round(12)) == pytest.approx(exact, rel=1e-11)
