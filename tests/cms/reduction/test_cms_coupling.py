"""Coupled components against the structure in one piece."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain, fixed_free_hz
from scipy import linalg

import cms

STATIC = ["rubin", "craig-bampton", "macneal", "dual-craig-bampton"]


def halves(method, left=30, right=21, modes=6):
    """A held chain and a floating one, cut at a mass that both have half of."""
    a = chain(left, interfaces={"cut": left - 1, "middle": left // 2})
    b = chain(right, left=0.0, interfaces={"cut": 0, "tip": right - 1})
    for part, at in ((a, left - 1), (b, 0)):
        part.mass[at, at] = 0.5
    return {
        name: cms.reduce(part, modes=modes, method=method) for name, part in (("a", a), ("b", b))
    }


JOINT = cms.Joint(("a", "cut"), ("b", "cut"))


@pytest.mark.parametrize("method", STATIC)
def test_coupled_halves_have_the_frequencies_of_the_whole(method):
    """30 + 21 masses that share one: the chain of 50, all methods to their accuracy."""
    model = cms.couple(halves(method), [JOINT])
    exact = fixed_free_hz(50)
    error = np.abs(model.frequencies_hz[:4] / exact[:4] - 1)
    assert error.max() < {"macneal": 2e-3, "craig-bampton": 1e-3}.get(method, 1e-4)


@pytest.mark.parametrize("method", STATIC)
def test_coupled_frequencies_converge_with_the_count(method):
    exact = fixed_free_hz(50)[:3]
    errors = [
        np.abs(cms.couple(halves(method, modes=k), [JOINT]).frequencies_hz[:3] / exact - 1).max()
        for k in (2, 4, 8, 16)
    ]
    assert np.all(np.diff(errors) < 0)
    assert errors[-1] < 2e-5


@pytest.mark.parametrize("method", ["rubin", "macneal", "dual-craig-bampton"])
def test_statics_of_coupled_components_are_exact(method):
    """Springs in series: mass 16 and mass 50, whatever the count.

    A Craig-Bampton half that floats is not exact in the shape that inertia gives it, but coupled
    it needs no inertia relief; see the next test.
    """
    model = cms.couple(halves(method, modes=2), [JOINT])
    assert model.static_flexibility("b.tip") == pytest.approx(50, rel=1e-9)
    assert model.static_flexibility("a.middle", "b.tip") == pytest.approx(16, rel=1e-9)
    assert model.static_flexibility("b.cut", "b.tip") == pytest.approx(30, rel=1e-9)


def test_statics_of_coupled_craig_bampton_components_are_exact():
    model = cms.couple(halves("craig-bampton", modes=1), [JOINT])
    assert model.static_flexibility("b.tip") == pytest.approx(50, rel=1e-10)
    assert model.static_flexibility("a.middle", "b.tip") == pytest.approx(16, rel=1e-10)


@pytest.mark.parametrize("method", ["rubin", "craig-bampton"])
def test_joined_interfaces_move_as_one(method):
    model = cms.couple(halves(method), [JOINT])
    np.testing.assert_allclose(
        model.participation["a.cut"], model.participation["b.cut"], atol=1e-10
    )


@pytest.mark.parametrize("method", ["rubin", "macneal", "craig-bampton"])
def test_all_modes_give_the_whole_chain(method):
    """The dual method is left out: its interfaces fit only as the residual flexibility vanishes."""
    a = chain(8, interfaces={"cut": 7})
    b = chain(6, left=0.0, interfaces={"cut": 0, "tip": 5})
    for part, at in ((a, 7), (b, 0)):
        part.mass[at, at] = 0.5
    counts = {"a": 7, "b": 4} if method == "craig-bampton" else {"a": 8, "b": 6}
    models = {
        name: cms.reduce(part, modes=counts[name], method=method)
        for name, part in (("a", a), ("b", b))
    }
    found = cms.couple(models, [JOINT]).frequencies_hz
    np.testing.assert_allclose(found, fixed_free_hz(13), rtol=1e-10)


def test_different_methods_and_counts_go_together():
    mixed = {
        "a": halves("craig-bampton", modes=9)["a"],
        "b": halves("macneal", modes=5)["b"],
    }
    model = cms.couple(mixed, [JOINT])
    np.testing.assert_allclose(model.frequencies_hz[:3], fixed_free_hz(50)[:3], rtol=2e-3)
    assert not np.allclose(model.residual_flexibility, 0.0)


@pytest.mark.parametrize("method", ["rubin", "macneal", "craig-bampton", "dual-craig-bampton"])
def test_a_spring_between_components(method):
    """Against the matrices put together by hand."""
    parts = halves(method, modes=8)
    model = cms.couple(parts, [cms.Joint(("a", "cut"), ("b", "cut"), stiffness=0.3)])
    K = linalg.block_diag(chain(30).stiffness.toarray(), chain(21, left=0.0).stiffness.toarray())
    row = np.zeros(51)
    row[[29, 30]] = 1.0, -1.0
    M = np.eye(51)
    M[29, 29] = M[30, 30] = 0.5
    exact = np.sqrt(linalg.eigvalsh(K + 0.3 * np.outer(row, row), M)) / (2 * np.pi)
    np.testing.assert_allclose(model.frequencies_hz[:4], exact[:4], rtol=2e-3)
    expected = np.linalg.inv(K + 0.3 * np.outer(row, row))[50, 50]
    assert model.static_flexibility("b.tip") == pytest.approx(expected, rel=1e-8)


def test_dampers_and_damping_are_carried_over():
    """Local dampers, Rayleigh damping and a damped joint: the full receptance at a frequency."""
    a, b = halves("rubin", modes=14).values()
    parts = {
        "a": a.with_damping(rayleigh=(0.02, 0.01), dampers={"middle": 0.5}),
        "b": b.with_damping(rayleigh=(0.01, 0.0)),
    }
    joint = cms.Joint(("a", "cut"), ("b", "cut"), stiffness=0.3, damping=0.2)
    model = cms.couple(parts, [joint])
    Ka, Kb = chain(30).stiffness.toarray(), chain(21, left=0.0).stiffness.toarray()
    row, middle = np.zeros(51), np.eye(51)[15]
    row[[29, 30]] = 1.0, -1.0
    M = np.eye(51)
    M[29, 29] = M[30, 30] = 0.5
    K = linalg.block_diag(Ka, Kb) + 0.3 * np.outer(row, row)
    C = linalg.block_diag(0.02 * M[:30, :30] + 0.01 * Ka, 0.01 * M[30:, 30:])
    C += 0.5 * np.outer(middle, middle) + 0.2 * np.outer(row, row)
    omega = 2 * np.pi * 0.03
    exact = np.linalg.solve(K - omega**2 * M + 1j * omega * C, np.eye(51)[50])
    assert model.receptance(0.03, "b.tip", "b.tip") == pytest.approx(exact[50], rel=1e-5)
    assert model.receptance(0.03, "a.middle", "b.tip") == pytest.approx(exact[15], rel=1e-5)


def test_ground_holds_an_interface():
    free = cms.reduce(chain(21, left=0.0, interfaces={"end": 0, "tip": 20}), modes=12)
    model = cms.couple({"rod": free}, [cms.Joint(("rod", "end"))])
    np.testing.assert_allclose(model.frequencies_hz[:2], fixed_free_hz(20)[:2], rtol=1e-6)
    assert model.rigid_body_modes == 0


def test_floating_components_stay_floating():
    one = chain(10, left=0.0, interfaces={"left": 0, "right": 9})
    model = cms.reduce(one, modes=4)
    both = cms.couple({"a": model, "b": model}, [cms.Joint(("a", "right"), ("b", "left"))])
    assert both.rigid_body_modes == 1
    loose = cms.couple({"a": model, "b": model}, [])
    assert loose.rigid_body_modes == 2


@pytest.mark.parametrize("method", STATIC)
def test_shapes_of_the_components(method):
    """The static shape of the whole under a load at the tip: min(i, 50)."""
    model = cms.couple(halves(method, modes=3), [JOINT])
    q = model.participation["b.tip"] / (2 * np.pi * model.frequencies_hz) ** 2
    shape = {name: model.expand(q, name) for name in ("a", "b")}
    if model.residual_shapes is not None:
        extra = model.residual_shapes[:, model.interfaces.index("b.tip")]
        shape = {n: u + extra[slice(*model.components[n])] for n, u in shape.items()}
    np.testing.assert_allclose(shape["a"], np.arange(1, 31), rtol=1e-8)
    np.testing.assert_allclose(shape["b"], np.arange(30, 51), rtol=1e-8)


def test_three_components_in_a_ring_of_joints():
    """A tripod: more joints than a tree needs, against direct assembly."""
    rod = chain(9, left=0.0, interfaces={"left": 0, "right": 8})
    model = cms.reduce(rod, modes=9, method="truncation")
    names = ("a", "b", "c")
    joints = [cms.Joint((x, "right"), (y, "left")) for x, y in zip(names, "bca", strict=True)]
    ring = cms.couple(dict.fromkeys(names, model), joints)
    n = 24
    K = 2 * np.eye(n) - np.roll(np.eye(n), 1, 0) - np.roll(np.eye(n), -1, 0)
    M = np.eye(n)
    M[[0, 8, 16], [0, 8, 16]] = 2.0
    exact = np.sqrt(np.maximum(linalg.eigvalsh(K, M), 0)) / (2 * np.pi)
    np.testing.assert_allclose(ring.frequencies_hz, exact, atol=1e-9)


@pytest.mark.parametrize(
    "joints, words",
    [
        ([cms.Joint(("a", "cut"), ("c", "cut"))], "no component 'c'"),
        ([cms.Joint(("a", "cut"), ("b", "nose"))], "'b' has no interface 'nose'"),
        ([cms.Joint(("a", "cut"), ("a", "cut"))], "joins an interface with itself"),
        ([("a.cut", "b.cut")], r"a joint is a cms.Joint, not \('a.cut', 'b.cut'\)"),
        ([JOINT, cms.Joint(("b", "cut"), ("a", "cut"))], "is given twice"),
        ([cms.Joint(("a", "cut"), ("b", "cut"), stiffness=-1.0)], "not negative"),
        ([cms.Joint(("a", "cut"), ("b", "cut"), damping=1.0)], "is rigid, so that its damping"),
    ],
)
def test_faults_in_joints_are_told(joints, words):
    with pytest.raises(cms.ReductionError, match=words):
        cms.couple(halves("rubin"), joints)


def test_methods_that_do_not_go_together_are_told():
    parts = {"a": halves("dual-craig-bampton")["a"], "b": halves("rubin")["b"]}
    with pytest.raises(cms.ReductionError, match="cannot be coupled with components by 'rubin'"):
        cms.couple(parts, [JOINT])
    joint = cms.Joint(("a", "cut"), ("b", "cut"), stiffness=1.0, damping=1.0)
    with pytest.raises(cms.ReductionError, match="needs components whose interfaces have mass"):
        cms.couple(halves("macneal"), [joint])
    with pytest.raises(cms.ReductionError, match="no component to couple"):
        cms.couple({}, [])
