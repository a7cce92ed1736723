"""Modes and static shapes by the natural form of a stiffness, at any condition of it.

A uniform beam of cubic elements between two pins, or guided at both ends, has modes whose
displacements are W sin(kπj/n) or W cos(kπj/n) at node j, so that each is a problem of two unknowns.
"""

import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest
from scipy import linalg, sparse

import cms
import fem

E, RHO, LENGTH, WIDTH, HEIGHT = 2e11, 7800.0, 2.0, 0.1, 0.05
EI, MASS = E * WIDTH * HEIGHT**3 / 12.0, RHO * WIDTH * HEIGHT
PINNED = ("a", ("x", "y")), ("b", ("x", "y"))
GUIDED = ("a", ("x", "rotation")), ("b", ("x", "rotation"))


def beam(count, held=PINNED, scale=1.0):
    """A beam of so many elements; lengths in units of 1/scale m, forces in N, time in s."""
    mesh = fem.frame_mesh({"a": (0, 0), "b": (LENGTH * scale, 0)}, [("p", "a", "b", count)])
    section = fem.RectangularSection(WIDTH * scale, HEIGHT * scale)
    part = fem.BeamPart(fem.Material(E / scale**2, RHO / scale**4, 0.3), section)
    free = "y" if held is GUIDED else "rotation"
    return fem.assemble(
        fem.StructureModel(
            mesh,
            parts={"p": part},
            supports=[fem.Support(point, directions) for point, directions in held],
            interfaces={"end": fem.Interface("a", free)},
            plane=True,
        )
    )


def exact_hz(count, number):
    """Frequency of the assembled beam, to 40 digits."""
    with mp.workdps(40):
        angle = mp.pi * number / count
        c, s = mp.cos(angle), mp.sin(angle)
        stiffness = mp.matrix([[24 - 24 * c, -12 * s], [-12 * s, 8 + 4 * c]])
        mass = mp.matrix([[312 + 108 * c, 26 * s], [26 * s, 8 - 6 * c]]) / 420
        a, d = mp.det(mass), mp.det(stiffness)
        b = stiffness[0, 0] * mass[1, 1] + stiffness[1, 1] * mass[0, 0]
        b = 2 * stiffness[0, 1] * mass[0, 1] - b
        square = (-b - mp.sqrt(b * b - 4 * a * d)) / (2 * a)
        unit = mp.mpf(EI) / (MASS * (mp.mpf(LENGTH) / count) ** 4)
        return float(mp.sqrt(square * unit) / (2 * mp.pi))


def plain(component):
    """The component by its matrices alone."""
    return cms.Matrices(component.stiffness, component.mass, component.interfaces)


@pytest.mark.parametrize("count", [10, 1000])
@pytest.mark.parametrize("held", [PINNED, GUIDED], ids=["pinned", "guided"])
def test_frequencies_are_those_of_the_exact_matrices(count, held):
    reduced = cms.reduce(beam(count, held), modes=4)
    rigid = 1 if held is GUIDED else 0
    exact = [exact_hz(count, number) for number in range(1, 5 - rigid)]
    np.testing.assert_allclose(reduced.frequencies_hz[rigid:4], exact, rtol=2e-13)
    assert np.all(reduced.frequencies_hz[:rigid] == 0.0)


def test_matrices_alone_lose_as_many_digits_as_their_condition_has():
    """Which shows that the test above can fail."""
    found = cms.reduce(plain(beam(1000)), modes=1).frequencies_hz[0]
    assert 1e-9 < abs(found / exact_hz(1000, 1) - 1) < 1e-4


@pytest.mark.parametrize("method", ["rubin", "macneal", "craig-bampton", "guyan"])
@pytest.mark.parametrize("count", [1000])
def test_static_flexibility_is_that_of_the_beam(method, count):
    """Statics of beam elements are exact: L/(3EI)."""
    modes = {} if method == "guyan" else {"modes": 4}
    reduced = cms.reduce(beam(count), method=method, **modes)
    assert reduced.static_flexibility("end") == pytest.approx(LENGTH / (3 * EI), rel=1e-11)


def test_inertia_relief_of_a_fine_mesh():
    """Of a guided beam pushed at its end and balanced by its inertia: L³/(45 EI).

    The consistent mass makes it 6.2e-6 (10/n)⁴ less.
    """
    reduced = cms.reduce(beam(400, GUIDED), modes=4)
    rows, hz = reduced.participation["end"][1:], reduced.frequencies_hz[1:]
    found = np.sum((rows / (2 * math.pi * hz)) ** 2)
    assert found == pytest.approx(LENGTH**3 / (45 * EI), rel=1e-9)


@pytest.mark.parametrize("method", ["rubin", "craig-bampton"])
def test_units_do_not_matter(method):
    """Lengths in mm, mass in t."""
    found, exact = (
        cms.reduce(beam(400, scale=scale), modes=4, method=method) for scale in (1e3, 1.0)
    )
    np.testing.assert_allclose(found.frequencies_hz, exact.frequencies_hz, rtol=1e-11)
    rows = found.participation["end"] / exact.participation["end"]
    np.testing.assert_allclose(rows / math.sqrt(1e-3), 1.0, rtol=1e-10)  # rad / (mm √t)


def test_thin_solid_bends_as_its_theory_says():
    """1 m long, 1 mm thick, under a moment: L/EI; the condition is 5e13."""
    material = fem.Material(2.1e11, 7800.0, 0.0)
    strip = fem.assemble(
        fem.StructureModel(
            fem.box_mesh("strip", (1.0, 0.05, 1e-3), (50, 1, 1)),
            parts={"strip": fem.SolidPart(material)},
            supports=[fem.Support("x0", ("x", "y", "z"))],
            couplings=[fem.Coupling("tip", "x1", at=(1.0, 0.025, 5e-4))],
            interfaces={"turn": fem.Interface("tip", "rotation_y")},
        )
    )
    exact = 12.0 / (2.1e11 * 0.05 * 1e-9)
    flexibilities = [
        cms.reduce(each, modes=2).static_flexibility("turn") for each in (strip, plain(strip))
    ]
    assert flexibilities[0] == pytest.approx(exact, rel=2e-9)
    assert abs(flexibilities[1] / exact - 1) > 1e-7


def test_deformations_are_made_a_few_columns_at_a_time(monkeypatch):
    component = beam(20)
    whole = cms.reduce(component, modes=8)
    monkeypatch.setattr("cms.component.component.MOST_BYTES", 3 * 8 * 80)
    parts = cms.reduce(component, modes=8)
    np.testing.assert_allclose(parts.frequencies_hz, whole.frequencies_hz, rtol=1e-13)


@dataclasses.dataclass
class Form:
    deformations: object
    stiffness: object


@pytest.mark.parametrize(
    "form, sentence",
    [
        (Form(np.eye(2), [1.0, 1.0]), "not that of the stiffness matrix"),
        (Form(np.eye(2), [1.0]), r"of shape \(2, 2\) and stiffness of shape \(1,\)"),
        (Form(np.eye(3), [1.0, 1.0, 1.0]), "the component has 2 degrees of freedom"),
        (Form(np.eye(2), ["a", "b"]), "needs 'deformations' and 'stiffness'"),
        (Form(np.eye(2), [1.0, np.nan]), "not that of the stiffness matrix"),
        (object(), "needs 'deformations' and 'stiffness'"),
    ],
)
def test_natural_form_must_be_that_of_the_stiffness(form, sentence):
    component = cms.Matrices(np.diag([1.0, 4.0]), np.eye(2), {"x": [1.0, 0.0]})
    object.__setattr__(component, "natural_form", form)
    with pytest.raises(cms.ReductionError, match=sentence):
        cms.reduce(component, modes=1)


def test_natural_form_is_checked_at_soft_degrees_of_freedom_too():
    component = cms.Matrices(np.diag([1.0, 1e14]), np.eye(2), {"x": [1.0, 0.0]})
    object.__setattr__(component, "natural_form", Form(np.eye(2), [2.0, 1e14]))
    with pytest.raises(cms.ReductionError, match="not that of the stiffness matrix"):
        cms.reduce(component, modes=1)


@pytest.mark.parametrize("kind", [list, np.asarray, sparse.csr_array])
def test_natural_form_may_be_typed_in(kind):
    component = cms.Matrices([[5.0, -4.0], [-4.0, 4.0]], np.eye(2), {"x": [1.0, 0.0]})
    object.__setattr__(component, "natural_form", Form(kind([[1.0, 0.0], [-1.0, 1.0]]), [1.0, 4.0]))
    reduced = cms.reduce(component, modes=1)
    assert reduced.static_flexibility("x") == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("modes", [5, 9, 19])
def test_a_loose_piece_moves_rigidly_beside_a_held_one(modes):
    """Craig-Bampton with interfaces on the held piece: the loose one's modes carry no energy."""
    points = {"foot": (0, 0), "tip": (0.3, 0.4), "from": (1, 0), "to": (1.5, 0.2)}
    mesh = fem.frame_mesh(points, [("held", "foot", "tip", 3), ("loose", "from", "to", 3)])
    part = fem.BeamPart(fem.Material(E, RHO, 0.3), fem.RectangularSection(WIDTH, HEIGHT))
    component = fem.assemble(
        fem.StructureModel(
            mesh,
            parts={"held": part, "loose": part},
            supports=[fem.Support("foot", ("x", "y", "rotation"))],
            interfaces={name: fem.Interface("tip", name) for name in ("x", "y")},
            plane=True,
        )
    )
    reduced = cms.reduce(component, modes=modes, method="craig-bampton", unseen=True)
    assert np.array_equal(reduced.frequencies_hz[:3], np.zeros(3))
    K, M = component.stiffness.toarray(), component.mass.toarray()
    exact = np.sqrt(linalg.eigh(K, M, eigvals_only=True)[3:]) / (2.0 * np.pi)
    found = reduced.frequencies_hz[3:]
    assert np.all(found >= exact[: found.size] * (1.0 - 1e-9))
    if modes == 19:  # all there are
        assert found == pytest.approx(exact, rel=1e-9)
