"""Modes that no interface sees are left out and not counted."""

import numpy as np
import pytest
from scipy import linalg

import cms
import fem
from cms.reduction import seen
from nldyn.base.errors import SystemModelError
from nldyn.system.system import System

STEEL = fem.Material(2.1e11, 7850.0, 0.3)
LENGTH, WIDTH, HEIGHT, COUNT = 1.0, 0.03, 0.02, 24
ROOTS = np.array([1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349])  # cos x cosh x = -1


def in_plane_hz(side):
    """The lowest frequencies of a cantilever by the beam theory of Euler and Bernoulli."""
    return (ROOTS / LENGTH) ** 2 * np.sqrt(2.1e11 * side**2 / 12 / 7850.0) / (2 * np.pi)


@pytest.fixture(scope="module")
def beam():
    """A cantilever in space whose tip is seen along y alone, and the same in its plane."""
    return cantilevers(WIDTH)


def cantilevers(width):
    part = fem.BeamPart(STEEL, fem.RectangularSection(width, HEIGHT))
    line = fem.frame_mesh({"root": (0, 0), "tip": (LENGTH, 0)}, [("beam", "root", "tip", COUNT)])
    flat = fem.StructureModel(
        line,
        {"beam": part},
        supports=[fem.Support("root", ("x", "y", "rotation"))],
        interfaces={"tip": fem.Interface("tip", "y")},
        plane=True,
    )
    ends = {"root": (0, 0, 0), "tip": (LENGTH, 0, 0)}
    mesh = fem.frame_mesh(ends, [("beam", "root", "tip", COUNT)])
    turns = tuple(f"rotation_{axis}" for axis in "xyz")
    solid = fem.StructureModel(
        mesh,
        {"beam": part},
        supports=[fem.Support("root", ("x", "y", "z", *turns))],
        interfaces={"tip": fem.Interface("tip", "y")},
    )
    return fem.assemble(solid), fem.assemble(flat)


@pytest.mark.parametrize("method", cms.METHODS)
def test_a_beam_in_space_with_a_stop_in_one_plane_is_one_in_that_plane(beam, method):
    """Four modes are four of that plane."""
    if method == "guyan":
        pytest.skip("keeps no modes")
    whole, flat = beam
    said = []
    reduced = cms.reduce(whole, modes=4, method=method, progress=said.append)
    expected = cms.reduce(flat, modes=4, method=method)
    assert (reduced.modes, reduced.unseen_modes) == (4, ())
    np.testing.assert_allclose(reduced.frequencies_hz, expected.frequencies_hz, rtol=1e-8)
    assert reduced.participation["tip"] == pytest.approx(expected.participation["tip"], rel=1e-6)
    if method == "craig-bampton":
        return
    np.testing.assert_allclose(reduced.frequencies_hz[:4], in_plane_hz(HEIGHT), rtol=1e-4)
    across = in_plane_hz(WIDTH)
    below = across[across < in_plane_hz(HEIGHT)[3]]
    assert below == pytest.approx(reduced.left_out_hz[: below.size], rel=1e-4)
    listed = ", ".join(f"{hz:.4g}" for hz in reduced.left_out_hz)
    assert f"{len(reduced.left_out_hz)} modes that no interface sees are left out: {listed} Hz" in (
        said
    )


@pytest.mark.parametrize("method", ["rubin", "macneal", "truncation", "craig-bampton"])
def test_the_band_of_the_error_holds_where_modes_are_left_out(beam, method):
    whole, _ = beam
    reduced = cms.reduce(whole, modes=3, method=method)
    known = cms.accuracy(whole, reduced)
    assert len(reduced.left_out_hz) > 0
    for hz in (30.0, 150.0):
        low, high = known.receptance_error(hz, "tip", "tip")[0]
        b = whole.interfaces["tip"]
        dynamic = whole.stiffness.toarray() - (2 * np.pi * hz) ** 2 * whole.mass.toarray()
        error = b @ np.linalg.solve(dynamic, b) - reduced.receptance(hz, "tip", "tip").real
        rounding = 1e-9 * abs(reduced.receptance(hz, "tip", "tip"))
        assert low - rounding <= error <= high + rounding


@pytest.mark.parametrize("modes", [1, 4])
def test_of_two_modes_of_one_frequency_the_interface_sees_one(modes):
    """A square section: any turn of the two planes is a pair of modes."""
    whole, flat = cantilevers(HEIGHT)
    reduced, expected = cms.reduce(whole, modes=modes), cms.reduce(flat, modes=modes)
    np.testing.assert_allclose(reduced.frequencies_hz, expected.frequencies_hz, rtol=1e-8)
    assert reduced.participation["tip"] == pytest.approx(expected.participation["tip"], rel=1e-6)
    np.testing.assert_allclose(reduced.left_out_hz, in_plane_hz(HEIGHT)[: modes - 1], rtol=1e-4)
    low, high = cms.accuracy(whole, reduced).receptance_error(10.0, "tip", "tip")[0]
    error = cms.accuracy(flat, expected).receptance_error(10.0, "tip", "tip")[0]
    assert [low, high] == pytest.approx(error, rel=1e-5)


def springs(**more):
    """Masses 1 on K = [2 -1; -1 2] and, for themselves, on 0.5; only the first is seen."""
    K = linalg.block_diag([[0.5]], [[2.0, -1.0], [-1.0, 2.0]])
    return cms.Matrices(K, np.eye(3), {"one": [0.0, 1.0, 0.0]}, **more)


def hz_of(squares):
    return np.sqrt(squares) / (2 * np.pi)


def test_an_interface_that_pulls_nothing_inside_sees_no_mode_there():
    """A held mass without a coupling to the others, of which two have one frequency."""
    alone = cms.Matrices(np.diag([1.0, 2.0, 2.0]), np.eye(3), {"one": [1.0, 0.0, 0.0]})
    reduced = cms.reduce(alone, modes=1, method="craig-bampton")
    assert reduced.frequencies_hz == pytest.approx([1.0 / (2.0 * np.pi)])
    assert reduced.modes == 0


def test_fewer_modes_than_asked_for_are_told():
    said = []
    reduced = cms.reduce(springs(), modes=3, progress=said.append)
    np.testing.assert_allclose(reduced.frequencies_hz, hz_of([1.0, 3.0]), rtol=1e-12)
    assert said[-1] == (
        "1 mode that no interface sees is left out: 0.1125 Hz; the component has only 2 that one "
        "sees, not 3"
    )
    assert "1 mode that no interface sees" in cms.check(springs(), reduced).report()


def test_a_mode_that_a_load_vector_sees_is_seen():
    loaded = springs(load_vectors=("weight",))
    loaded.interfaces["weight"] = [1.0, 1.0, 1.0]
    reduced = cms.reduce(loaded, modes=3)
    np.testing.assert_allclose(reduced.frequencies_hz, hz_of([0.5, 1.0, 3.0]), rtol=1e-12)


def test_modes_that_a_damping_matrix_couples_are_kept():
    """The receptance of the damped component; with proportional damping nothing is coupled."""
    crossed = np.outer([1.0, 1.0, 0.0], [1.0, 1.0, 0.0])
    for method in ("rubin", "craig-bampton"):
        for C, kept in ((crossed, 3), (0.2 * np.eye(3), 2)):
            component = springs(damping=C)
            reduced = cms.reduce(component, modes=3 if method == "rubin" else 2, method=method)
            assert reduced.size == kept
            dynamic = component.stiffness - np.eye(3) + 1j * C  # at 1 rad/s
            exact = np.linalg.inv(dynamic)[1, 1]
            found = reduced.receptance(1.0 / (2 * np.pi), "one", "one")
            assert found == pytest.approx(exact, rel=1e-12)


def test_a_large_component_is_not_searched_for_ever(monkeypatch):
    monkeypatch.setattr(seen, "DENSE_AT_MOST", 10)
    first = cms.Matrices(np.diag(np.arange(1.0, 21.0)), np.eye(20), {"first": np.eye(20)[0]})
    with pytest.raises(cms.ReductionError, match="see only 1 of the component's lowest 5 modes"):
        cms.reduce(first, modes=2)


def test_a_file_and_a_coupled_model_keep_what_is_left_out(tmp_path):
    reduced = cms.reduce(springs(), modes=2)
    reduced.save(tmp_path / "model.npz")
    assert cms.ReducedModel.load(tmp_path / "model.npz").left_out_hz == reduced.left_out_hz
    pair = cms.couple({"a": reduced, "b": reduced}, [cms.Joint(("a", "one"), ("b", "one"))])
    assert pair.left_out_hz == 2 * reduced.left_out_hz


def test_a_skew_matrix_beside_modes_left_out_is_refused():
    """It may couple them with the others."""
    reduced, G = cms.reduce(springs(), modes=2), np.array([[0.0, 1.0], [-1.0, 0.0]])
    with pytest.raises(SystemModelError, match="reduce with unseen=True"):
        System.from_reduced(reduced, gyroscopic=G)
