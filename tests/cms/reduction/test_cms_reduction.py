"""Reduced models against closed forms and the unreduced component."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain, fixed_free_hz, free_free_hz
from scipy import linalg

import cms
import fem


@pytest.mark.parametrize("modes", [1, 3, 29, 30])
def test_kept_frequencies_are_those_of_the_chain(cantilever, modes):
    reduced = cms.reduce(cantilever, modes=modes)
    exact = fixed_free_hz(30, 7.0, 0.3)
    np.testing.assert_allclose(reduced.frequencies_hz[:modes], exact[:modes], rtol=1e-12)
    assert reduced.modes == modes
    assert np.all(reduced.residuals[:modes] < 1e-11)


def test_all_modes_leave_no_residual(cantilever):
    reduced = cms.reduce(cantilever, modes=30)
    assert (reduced.size, reduced.residual_modes, reduced.dropped_residual_modes) == (30, 0, 2)


def test_one_mode_missing_leaves_room_for_one_residual(cantilever):
    reduced = cms.reduce(cantilever, modes=29)
    assert (reduced.residual_modes, reduced.dropped_residual_modes) == (1, 1)
    np.testing.assert_allclose(reduced.frequencies_hz, fixed_free_hz(30, 7.0, 0.3), rtol=1e-9)


@pytest.mark.parametrize("modes", [0, 1, 2, 5, 28, 30])
def test_static_flexibility_is_exact(cantilever, modes):
    """Springs in series: a load at mass i moves mass j by min(i, j) / k."""
    reduced = cms.reduce(cantilever, modes=modes)
    assert reduced.static_flexibility("tip") == pytest.approx(30 / 7, rel=1e-11)
    assert reduced.static_flexibility("middle") == pytest.approx(15 / 7, rel=1e-11)
    assert reduced.static_flexibility("tip", "middle") == pytest.approx(15 / 7, rel=1e-11)


def test_without_residual_the_statics_converge_from_below(cantilever):
    found = [
        cms.reduce(cantilever, modes=k, residual=False).static_flexibility("tip")
        for k in range(1, 31)
    ]
    assert np.all(np.diff(found) > 0)
    assert found[-1] == pytest.approx(30 / 7, rel=1e-11)


def test_residual_mode_is_rubins(cantilever):
    """One interface, one mode: the Rayleigh quotient of G_res b, by its textbook formula."""
    tip = {"tip": cantilever.interfaces["tip"]}
    component = cms.Matrices(cantilever.stiffness, cantilever.mass, tip)
    K, M, b = component.stiffness.toarray(), component.mass.toarray(), tip["tip"]
    squares, vectors = linalg.eigh(K, M)
    psi = np.linalg.solve(K, b) - vectors[:, 0] * (vectors[:, 0] @ b) / squares[0]
    expected = np.sqrt((psi @ K @ psi) / (psi @ M @ psi)) / (2 * np.pi)
    assert cms.reduce(component, modes=1).frequencies_hz[1] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("interfaces", [{"tip": 39}, {"tip": 39, "middle": 19, "third": 7}])
def test_frequencies_come_from_above_and_fall_with_more_modes(interfaces):
    component = chain(40, interfaces=interfaces)
    exact = fixed_free_hz(40)
    before = np.full(40, np.inf)
    for modes in range(0, 12):
        found = cms.reduce(component, modes=modes).frequencies_hz
        assert np.all(found >= exact[: found.size] * (1 - 1e-12))
        smaller = min(found.size, before.size)
        assert np.all(found[:smaller] <= before[:smaller] * (1 + 1e-12))
        before = np.concatenate([found, np.full(40 - found.size, np.inf)])


def test_receptance_with_damping_is_that_of_an_oscillator():
    single = cms.reduce(cms.Matrices([[400.0]], [[4.0]], {"mass": [1.0]}), modes=1)
    at_resonance = single.receptance(10 / (2 * np.pi), "mass", "mass", modal_damping=0.02)
    assert at_resonance == pytest.approx(1 / (2j * 0.02 * 400.0))


def test_expand(cantilever):
    reduced = cms.reduce(cantilever, modes=2)
    q = np.arange(8.0).reshape(4, 2)
    u = reduced.expand(q)
    assert u.shape == (30, 2)
    np.testing.assert_allclose(u[:, 1], reduced.expand(q[:, 1]))
    for name, vector in cantilever.interfaces.items():
        np.testing.assert_allclose(vector @ u, reduced.participation[name] @ q)


def test_static_shape_at_an_interface_load_is_exact(cantilever):
    """A load at mass 15 of the chain: displacement min(i, 15) / k, whatever the mode count."""
    reduced = cms.reduce(cantilever, modes=0)
    squares = (2 * np.pi * reduced.frequencies_hz) ** 2
    found = reduced.expand(reduced.participation["middle"] / squares)
    np.testing.assert_allclose(found, np.minimum(np.arange(1, 31), 15) / 7, rtol=1e-11)


def test_dependent_interfaces_are_dropped():
    component = chain(20)
    tip = component.interfaces["tip"]
    first = np.eye(20)[0]
    interfaces = {"tip": tip, "same": -1e6 * tip, "first": first, "sum": tip + 3 * first}
    reduced = cms.reduce(cms.Matrices(component.stiffness, component.mass, interfaces), modes=2)
    assert (reduced.residual_modes, reduced.dropped_residual_modes) == (2, 2)
    assert reduced.static_flexibility("tip") == pytest.approx(20.0, rel=1e-10)
    assert reduced.static_flexibility("same") == pytest.approx(20e12, rel=1e-10)
    assert reduced.static_flexibility("first") == pytest.approx(1.0, rel=1e-10)
    assert reduced.static_flexibility("sum") == pytest.approx(20 + 9 + 6, rel=1e-10)


def test_neighbouring_interfaces_in_a_fine_mesh_are_both_kept():
    component = chain(1000, interfaces={"tip": 999, "next": 998})
    reduced = cms.reduce(component, modes=3)
    assert reduced.residual_modes == 2
    assert reduced.static_flexibility("tip") == pytest.approx(1000, rel=1e-10)
    assert reduced.static_flexibility("next") == pytest.approx(999, rel=1e-10)


@pytest.mark.parametrize("cutoff_hz", [1e-3, 0.05, 0.2, 1.0])
def test_cutoff_counts_the_modes_below_it(cutoff_hz):
    modes = np.count_nonzero(fixed_free_hz(40) <= cutoff_hz)
    reduced = cms.reduce(chain(40), cutoff_hz=cutoff_hz)
    assert reduced.modes == modes
    assert reduced.static_flexibility("tip") == pytest.approx(40, rel=1e-10)


def test_signs_follow_the_first_interface_that_moves(cantilever):
    reduced = cms.reduce(cantilever, modes=6)
    assert np.all(reduced.participation["tip"] > 0)


def test_sign_of_a_mode_that_the_first_interface_cannot_see():
    """Odd chain held at both ends: even modes have a node in the middle."""
    component = chain(21, left=1.0, right=1.0, interfaces={"middle": 10, "off": 4})
    reduced = cms.reduce(component, modes=6)
    np.testing.assert_allclose(reduced.participation["middle"][1:6:2], 0, atol=1e-12)
    assert np.all(reduced.participation["middle"][0:6:2] > 0)
    assert np.all(reduced.participation["off"][1:6:2] > 0)


@pytest.mark.parametrize("size", [40, 2500])
def test_floating_chain_keeps_its_rigid_body_mode(size):
    component = chain(size, left=0.0)
    reduced = cms.reduce(component, modes=4, residual=False)
    np.testing.assert_allclose(reduced.frequencies_hz, free_free_hz(size)[:4], rtol=1e-9)
    assert reduced.rigid_body_modes == 1
    np.testing.assert_allclose(reduced.basis[:, 0], 1 / np.sqrt(size), rtol=1e-8)
    assert reduced.static_flexibility("tip") == np.inf


@pytest.mark.parametrize("method", ["rubin", "craig-chang", "macneal"])
def test_rigid_body_modes_must_be_kept(method):
    one = chain(5, left=0.0).stiffness.toarray()
    component = cms.Matrices(linalg.block_diag(one, one), np.eye(10), {"tip": np.eye(10)[4]})
    with pytest.raises(cms.ReductionError, match="its 2 rigid-body modes must be kept"):
        cms.reduce(component, modes=1, method=method)
    assert cms.reduce(component, modes=3, method=method).rigid_body_modes == 2


def test_a_very_soft_support_is_not_floating():
    """1e-9 of the chain's spring: the whole chain swings on it as one mass."""
    reduced = cms.reduce(chain(20, left=1e-9), modes=1)
    assert reduced.rigid_body_modes == 0
    expected = np.sqrt(1e-9 / 20) / (2 * np.pi)
    assert reduced.frequencies_hz[0] == pytest.approx(expected, rel=1e-5)
    assert reduced.static_flexibility("tip") == pytest.approx(1e9 + 19, rel=1e-5)


# what a condition number of (4 n / pi)^2 makes of rounding; frequencies have half of it
ROUNDING_OF_5000 = (4 * 5000 / np.pi) ** 2 * np.finfo(float).eps


@pytest.mark.parametrize("interfaces", [{"tip": 4999}, {"tip": 4999, "quarter": 1249}])
def test_large_sparse_chain(interfaces):
    reduced = cms.reduce(chain(5000, interfaces=interfaces), modes=8)
    np.testing.assert_allclose(
        reduced.frequencies_hz[:8], fixed_free_hz(5000)[:8], rtol=ROUNDING_OF_5000 / 2
    )
    assert reduced.static_flexibility("tip") == pytest.approx(5000, rel=ROUNDING_OF_5000)
    assert reduced.residual_modes == len(interfaces)


def test_large_sparse_chain_by_cutoff():
    exact = fixed_free_hz(5000)
    reduced = cms.reduce(chain(5000), cutoff_hz=0.5 * (exact[20] + exact[21]))
    assert reduced.modes == 21
    np.testing.assert_allclose(reduced.frequencies_hz[:21], exact[:21], rtol=ROUNDING_OF_5000 / 2)


def test_massless_dofs_are_modes_of_infinite_frequency_and_not_counted():
    """Two masses with a massless node between: springs in series, k/2 between them."""
    component = cms.Matrices(
        [[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]],
        np.diag([1.0, 0.0, 1.0]),
        {"tip": [0.0, 0.0, 1.0]},
    )
    reduced = cms.reduce(component, modes=2)
    squares = np.linalg.eigvalsh([[1.5, -0.5], [-0.5, 0.5]])
    np.testing.assert_allclose((2 * np.pi * reduced.frequencies_hz) ** 2, squares, rtol=1e-12)
    with pytest.raises(cms.ReductionError, match="only 2 have mass"):
        cms.reduce(component, modes=3)


def test_all_modes_of_an_ill_conditioned_pair():
    """Springs from 1 to 1e11: slow and fast modes both keep their digits."""
    stiffness = 10.0 ** np.arange(12)
    turn = linalg.block_diag(*[linalg.hadamard(4) / 2] * 3)
    pair = cms.Matrices(turn @ np.diag(stiffness) @ turn.T, np.eye(12), {"one": turn[0]})
    reduced = cms.reduce(pair, modes=12, unseen=True)
    squares = (2 * np.pi * reduced.frequencies_hz) ** 2
    np.testing.assert_allclose(squares, stiffness, rtol=1e-5)
    np.testing.assert_allclose(squares[-4:], stiffness[-4:], rtol=1e-11)


@pytest.mark.parametrize("size", [52, 88, 142])
def test_all_modes_of_a_small_frame_are_those_of_the_direct_problem(size):
    """Just below w_n^2 / w_1^2 = 1e6 the inverse problem gives all modes, the fastest too."""
    component = portal_frame(size)
    K, M = component.stiffness.toarray(), component.mass.toarray()
    exact = np.sqrt(linalg.eigvalsh(K, M)) / (2 * np.pi)
    whole = cms.reduce(component, cutoff_hz=1e9)
    assert whole.modes == size
    for modes in (size, size - 2, 3 * size // 4, size // 2):
        reduced = cms.reduce(component, modes=modes)
        fast = slice(modes // 2, modes)
        np.testing.assert_allclose(reduced.frequencies_hz[fast], exact[fast], rtol=1e-8)
        assert np.max(reduced.residuals[:modes]) < 1e-9


@pytest.mark.parametrize("mode, other", [(0, 29), (0, 1), (14, 15)])
@pytest.mark.parametrize("share", [1e-3, 1e-6])
def test_residual_of_a_mode_is_its_share_of_another_times_their_distance(
    cantilever, monkeypatch, mode, other, share
):
    """|w_i^2 - w_j^2| / (w_i w_j); both modes have it, and the slower one is told."""
    monkeypatch.setattr("cms.solvers.eigen.dense_modes", mixing(mode, other, share))
    squares = fixed_free_hz(30, 7.0, 0.3) ** 2
    distance = abs(squares[mode] - squares[other]) / np.sqrt(squares[mode] * squares[other])
    with pytest.raises(cms.ReductionError) as caught:
        cms.reduce(cantilever, modes=30)
    text = str(caught.value)
    assert f"mode {mode + 1} of the component fails its residual check" in text
    assert f"({share * distance:.1e} > 1.0e-08)" in text
    assert "the eigen-solver did not find the lowest 30 modes to that accuracy" in text


def test_component_too_stiff_for_double_precision_is_told_as_such():
    """Springs from 1 to 1e15 N/m in coordinates that mix them all."""
    stiffness = np.geomspace(1.0, 1e15, 8)
    turn = linalg.hadamard(8) / np.sqrt(8.0)
    component = cms.Matrices(turn * stiffness @ turn.T, np.eye(8), {"one": turn[0]})
    with pytest.raises(cms.ReductionError, match="too much for double precision; use a coarser"):
        cms.reduce(component, modes=1)


def mixing(mode, other, share):
    """A solver that puts a share of one mode into another."""
    solve = cms.solvers.eigen.dense_modes

    def mixed(pencil, shifted, count):
        squares, vectors = solve(pencil, shifted, count)
        vectors = vectors.copy()
        vectors[:, mode] += share * vectors[:, other]
        vectors[:, other] -= share * vectors[:, mode]
        return squares, vectors

    return mixed


def portal_frame(size):
    """A steel portal of unequal members: 9 e - 2 degrees of freedom with e elements in each."""
    steel = fem.Material(2.1e11, 7800.0)
    elements = (size + 2) // 9
    mesh = fem.frame_mesh(
        {"a": (0, 0), "b": (0, 0.5), "c": (0.8, 0.5), "d": (0.8, 0)},
        [("left", "a", "b", elements), ("beam", "b", "c", elements), ("right", "c", "d", elements)],
    )
    sections = {
        "left": fem.RectangularSection(0.03, 0.02),
        "beam": fem.CircularSection(0.03, bore=0.02),
        "right": fem.RectangularSection(0.01, 0.01),
    }
    component = fem.assemble(
        fem.StructureModel(
            mesh,
            parts={name: fem.BeamPart(steel, section) for name, section in sections.items()},
            supports=[fem.Support("a", ("x", "y", "rotation")), fem.Support("d", ("x", "y"))],
            interfaces={"b": fem.Interface("b", "x")},
            plane=True,
        )
    )
    assert component.stiffness.shape == (size, size)
    return component
