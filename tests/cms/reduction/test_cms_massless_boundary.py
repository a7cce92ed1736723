"""A massless boundary: residual flexibility without mass at some interfaces alone."""

import numpy as np
import pytest
from chains import chain
from scipy import sparse

import cms

PLACES = {"tip": 39, "middle": 20, "near": 5}


def bar(cells=400):
    """A free bar of unit length, mass and wave speed, of cells with their consistent masses."""
    main, mass = np.full(cells + 1, 2.0), np.full(cells + 1, 2.0 / 3.0)
    main[[0, -1]], mass[[0, -1]] = 1.0, 1.0 / 3.0
    off = np.ones(cells)
    diagonals = [-1, 0, 1]
    stiffness = cells * sparse.diags_array([-off, main, -off], offsets=diagonals, format="csc")
    masses = sparse.diags_array([off / 6.0, mass, off / 6.0], offsets=diagonals, format="csc")
    return cms.Matrices(stiffness, masses / cells, {"end": np.eye(1, cells + 1, cells)[0]})


def test_statics_are_exact_at_all_interfaces():
    whole = chain(40, interfaces=PLACES)
    reduced = cms.reduce(whole, modes=5, method="macneal", massless=["tip", "near"])
    assert (reduced.size, reduced.modes, reduced.residual_modes) == (6, 5, 1)
    for name, at in PLACES.items():
        for other, place in PLACES.items():
            known = 1.0 + min(at, place)  # springs in series
            assert reduced.static_flexibility(name, other) == pytest.approx(known, rel=1e-11)


@pytest.mark.parametrize("left", [1.0, 0.0])
def test_interfaces_with_mass_answer_as_by_rubin(left):
    """At and between them, and by them at the others, nothing moves at once."""
    whole = chain(40, left=left, interfaces=PLACES)
    reduced = cms.reduce(whole, modes=5, method="macneal", massless=["tip"])
    alone = cms.reduce(
        chain(40, left=left, interfaces={"middle": 20, "near": 5}), modes=5, method="rubin"
    )
    G = reduced.residual_flexibility
    assert np.count_nonzero(G) == 1 and G[0, 0] > 0.0
    for hz in (0.004, 0.031):
        for name in ("middle", "near"):
            assert reduced.receptance(hz, name, "near") == pytest.approx(
                alone.receptance(hz, name, "near"), rel=1e-9
            )


def test_all_interfaces_without_mass_are_macneals_method():
    whole = chain(40, interfaces=PLACES)
    plain = cms.reduce(whole, modes=5, method="macneal")
    named = cms.reduce(whole, modes=5, method="macneal", massless=list(PLACES))
    np.testing.assert_allclose(named.residual_flexibility, plain.residual_flexibility, rtol=1e-10)
    np.testing.assert_allclose(named.residual_shapes, plain.residual_shapes, atol=1e-12)


def test_what_a_free_bar_has_left_is_known():
    """1/3 - Σ 2/(nπ)² of the elastic modes kept.

    Cells of the length h make ω² larger by (ωh)²/12 of it, and the 1/3 smaller by h²/12.
    """
    for modes in (3, 9):
        reduced = cms.reduce(bar(), modes=modes, method="macneal", massless=["end"])
        kept = np.arange(1, modes)
        known = 1.0 / 3.0 - np.sum(2.0 / (np.pi * kept) ** 2)
        by_mesh = (2 * modes - 1) / 12.0 / 400**2
        found = reduced.residual_flexibility[0, 0]
        assert found == pytest.approx(known - by_mesh, rel=1e-6)


def test_how_much_is_common_to_two_is_told():
    said = []
    reduced = cms.reduce(
        chain(40, interfaces=PLACES), modes=5, method="macneal", massless=["tip", "near"],
        progress=said.append,
    )  # fmt: skip
    G = reduced.residual_flexibility
    share = 100.0 * abs(G[0, 2]) / np.sqrt(G[0, 0] * G[2, 2])
    (told,) = [line for line in said if "without mass" in line]
    assert told.startswith("interfaces without mass: tip, near; ")
    assert f"at most {share:.2g} % is common to two" in told


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"massless": ["tip"], "method": "rubin"}, "massless is for method 'macneal', not 'rubin'"),
        ({"massless": ["top"]}, "there is no interface 'top'"),
        ({"massless": ["tip", "tip"]}, "names an interface twice"),
        ({"massless": []}, "names no interface"),
        ({"massless": "tip"}, "must be a list of interfaces, got 'tip'"),
        ({"massless": ["tip"], "modes": 40}, "nothing is left of the flexibility of 'tip'"),
        (
            {"massless": ["tip"], "areas": {"pad": cms.Area(["tip", "near"], [1.0, 1.0])}},
            "'tip' is a point of area 'pad'",
        ),
    ],
)
def test_a_boundary_that_cannot_be_is_refused(asked, sentence):
    whole = chain(40, interfaces=PLACES)
    with pytest.raises(cms.ReductionError, match=sentence):
        cms.reduce(whole, **{"modes": 5, "method": "macneal", **asked})


def test_an_area_is_named_for_all_of_its_points():
    """As if each were: none of them shares attachment modes with mass any more."""
    whole, pad = chain(40, interfaces=PLACES), cms.Area(["tip", "near"], [1.0, 1.0])
    told = []
    named = cms.reduce(
        whole, modes=5, method="macneal", massless=["pad"], areas={"pad": pad}, progress=told.append
    )
    single = cms.reduce(whole, modes=5, method="macneal", massless=["tip", "near"])
    assert named.areas == {} and named.size == single.size
    np.testing.assert_array_equal(named.residual_flexibility, single.residual_flexibility)
    assert any("interfaces without mass: tip, near" in sentence for sentence in told)


def test_no_bound_is_claimed_where_some_have_mass():
    whole = chain(40, interfaces=PLACES)
    reduced = cms.reduce(whole, modes=5, method="macneal", massless=["tip"])
    with pytest.raises(cms.ReductionError, match="all interfaces have mass, or none of them"):
        cms.accuracy(whole, reduced)
