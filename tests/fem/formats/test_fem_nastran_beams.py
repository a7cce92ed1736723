"""Beams and rods of Nastran against beam theory, and their sections against integrals."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

import fem
from fem.formats.nastran.shapes import SHAPES

pytestmark = [pytest.mark.filterwarnings("ignore::fem.JointWarning", "ignore::fem.UnlikelyWarning")]
HEAD = "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\nMAT1,1,2.+11,,.3,8000.\n"
CLAMPED = 1.8751040687


def component(tmp_path, cards):
    path = tmp_path / "deck.bdf"
    path.write_text(f"{HEAD}{cards}ENDDATA\n")
    mesh = fem.read_mesh(path)
    return fem.assemble(fem.StructureModel(mesh, fem.parts_of(mesh)))


def lowest(found, count):
    K, M = found.stiffness.toarray(), found.mass.toarray()
    return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)[:count]) / (2 * np.pi)


def cantilever(element, prop, count=8, way="0.,1.,0."):
    grids = "".join(f"GRID,{i + 1},,{i / count!r},0.,0.\n" for i in range(count + 1))
    lines = "".join(f"{element},{i},7,{i},{i + 1},{way}\n" for i in range(1, count + 1))
    return f"{grids}{lines}{prop}SPC1,1,123456,1\n"


@pytest.mark.parametrize(
    ("element", "prop", "name"),
    [
        ("CBAR", "PBAR,7,1,1.-4,2.-9,1.-9,1.-9\n", "PBAR 7"),
        ("CBEAM", "PBEAM,7,1,1.-4,2.-9,1.-9,,1.-9\n,,,,,,,,\n,0.,0.\n", "PBEAM 7"),
        ("CBEAM", "PBEAM,7,1,1.-4,2.-9,1.-9,,1.-9\n,,,,,,,,\n,YES,1.,1.-4,2.-9,1.-9,,1.-9\n"
         ",,,,,,,,\n,0.,0.\n", "PBEAM 7"),
    ],
)  # fmt: skip
def test_a_cantilever_bends_in_both_planes(tmp_path, element, prop, name):
    found = component(tmp_path, cantilever(element, prop))
    assert list(found.model.parts) == [name]
    expected = CLAMPED**2 / (2 * np.pi) * np.sqrt(2e11 * np.array([1e-9, 2e-9]) / 0.8)
    np.testing.assert_allclose(lowest(found, 2), expected, rtol=1e-4)
    assert found.rigid_mass[0, 0] == pytest.approx(0.8)


def test_a_product_of_inertia_turns_the_principal_axes(tmp_path):
    """I1 = I2 = 1.5 and I12 = 0.5: principal moments 2 and 1."""
    prop = "PBAR,7,1,1.-4,1.5-9,1.5-9,1.-9\n,,,,,,,,\n,,,.5-9\n"
    found = component(tmp_path, cantilever("CBAR", prop))
    expected = CLAMPED**2 / (2 * np.pi) * np.sqrt(2e11 * np.array([1e-9, 2e-9]) / 0.8)
    np.testing.assert_allclose(lowest(found, 2), expected, rtol=1e-4)
    np.testing.assert_allclose(found.model.parts["PBAR 7"].orientation, [0, 0.5**0.5, 0.5**0.5])


def test_orientations_offsets_and_systems_of_displacements_are_taken(tmp_path):
    """The same cantilever aside of its grid points, given by a grid point and in turned axes."""
    cards = (
        "CORD2R,5,0,0.,0.,0.,0.,0.,1.\n,0.,1.,0.\n"  # x' = y
        "GRID,1,,0.,0.,0.,5\nGRID,2,,.5,0.,0.,5\nGRID,3,,1.,0.,0.,5\nGRID,9,,0.,8.,0.\n"
        "CBAR,1,7,1,2,9\n,,,.1,.2,.3,.1,.2,.3\nCBAR,2,7,2,3,1.,0.,0.\n,,,.1,.2,.3,.1,.2,.3\n"
        "PBAR,7,1,1.-4,2.-9,1.-9,1.-9\nSPC1,1,123456,1\n"
    )
    part = component(tmp_path, cards).model.parts["PBAR 7"]
    np.testing.assert_allclose(part.orientation, [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(part.end_offsets, np.tile([-0.2, 0.1, 0.3], (2, 1)), atol=1e-12)


def test_pins_let_ends_turn(tmp_path):
    """Clamped at one end and pinned at the other: 3.9266 for the first mode."""
    count = 8
    cards = cantilever("CBAR", "PBAR,7,1,1.-4,2.-9,1.-9,1.-9\n", count)
    last = f"CBAR,{count},7,{count},{count + 1},0.,1.,0.\n"
    cards = cards.replace(last, last.strip() + "\n,,56\n")
    cards = cards.replace("SPC1,1,123456,1", f"SPC1,1,123456,1,{count + 1}")
    expected = 3.9266023**2 / (2 * np.pi) * np.sqrt(2e11 * np.array([1e-9, 2e-9]) / 0.8)
    np.testing.assert_allclose(lowest(component(tmp_path, cards), 2), expected, rtol=1e-3)


def test_pins_in_all_directions_are_refused(tmp_path):
    cards = cantilever("CBAR", "PBAR,7,1,1.-4,2.-9,1.-9,1.-9\n", 1).replace(
        "1.,0.\nP", "1.,0.\n,123456\nP"
    )
    with pytest.raises(fem.ModelError, match=r"CBAR: its pins \(PA or PB\) free all six"):
        component(tmp_path, cards)


def test_a_tapered_beam_carries_its_mean_mass(tmp_path):
    prop = "PBEAM,7,1,1.-4,2.-9,1.-9,,1.-9,.1\n,,,,,,,,\n,NO,1.,3.-4,4.-9,2.-9,,2.-9,.3\n"
    found = component(tmp_path, cantilever("CBEAM", prop, 1))
    assert found.rigid_mass[0, 0] == pytest.approx(8000.0 * 2e-4 + 0.2)


@pytest.mark.parametrize(
    ("rest", "moment", "polar"),
    [
        ("10.\n,,,,,,,,\n,NO,1.,1.-3,4.-6,1.-7,,2.-7,0.\n", 8.0 / 2 + 10.0 / 6, 8000 * 4.1e-6),
        ("10.\n,,,,,,,,\n,NO,1.,3.-3,4.-6,1.-7,,2.-7,10.\n", 8.0 * (1 / 2 + 2 / 3) + 5.0,
         8000 * 4.1e-6),
        ("10.\n", 9.0, 8000 * 4.1e-6),
        ("10.\n,,,,,,,,\n,,,,,.02,.04\n", 9.0, 8000 * 4.1e-6 + 0.03),
    ],
)  # fmt: skip
def test_added_mass_is_linear_whatever_the_area_and_turns_only_as_told(
    tmp_path, rest, moment, polar
):
    """The first moment is the integral of (rho A + NSM) x; NSI alone adds to rho (I1 + I2)."""
    prop = f"PBEAM,7,1,1.-3,4.-6,1.-7,,2.-7,{rest}"
    found = component(tmp_path, cantilever("CBEAM", prop, 1)).rigid_mass
    assert found[1, 5] == pytest.approx(moment, rel=1e-12)
    assert found[3, 3] == pytest.approx(polar, rel=1e-12)


def test_a_place_of_added_mass_aside_of_the_neutral_axis_is_told(tmp_path):
    path = tmp_path / "deck.bdf"
    for last, told in (("0.,0.,0.,0.,.1,.2", 1), ("0.,0.,0.,0.", 0), (".1,.2,.1,.2,.1,.2", 0)):
        prop = f"PBEAM,7,1,1.-3,4.-6,1.-7,,2.-7,1.\n,,,,,,,,\n,,,,,,,,\n,{last}\n"
        path.write_text(f"{HEAD}{cantilever('CBEAM', prop, 1)}ENDDATA\n")
        names = [item.keyword for item in fem.read_mesh(path).left_out]
        assert names.count("place of NSM of PBEAM") == told


def test_rods_stretch_and_twist(tmp_path):
    """A truss of CROD, CONROD and CTUBE that are alike, and torsion between beams."""
    area = np.pi / 4 * (0.02**2 - 0.01**2)
    cards = (
        "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n"
        f"CROD,1,1,1,2\nPROD,1,1,{area:.9f}\nCTUBE,2,2,1,3\nPTUBE,2,1,.02,.005\n"
        f"CONROD,3,1,4,1,{area:.9f}\nSPC1,1,123,2,3,4\n"
    )
    found = component(tmp_path, cards)
    K = 2e11 * area * np.eye(3)
    np.testing.assert_allclose(found.stiffness.toarray(), K, rtol=1e-5, atol=1e-3)
    assert set(found.model.parts) == {"PROD 1", "PTUBE 2", "CONROD 3"}
    cards = cantilever("CBAR", "PBAR,7,1,1.-4,2.-9,1.-9,1.-9\n", 1)
    cards += "GRID,3,,2.,0.,0.\nCROD,9,1,2,3\nPROD,1,1,1.-4,3.-9\nCBAR,8,7,3,2,0.,1.,0.\n"
    twisted = component(tmp_path, cards.replace("SPC1,1,123456,1", "SPC1,1,123456,1,3"))
    dof = twisted.numbering.dofs(np.array([1]))[0, 3]
    own = list(twisted.free).index(dof)
    G = 2e11 / 2.6
    assert twisted.stiffness.toarray()[own, own] == pytest.approx(2 * G * 1e-9 + G * 3e-9)


def test_rods_are_heavier_in_nastran_by_what_the_page_says(tmp_path):
    """Ours of n rods held at one end is that of consistent masses; the page compares with 5/12.

    With c = cos(pi/2n), E = rho: (omega L/n)² is 6 (1 - c)/(2 + c), Nastran's 12 (1 - c)/(5 + c).
    """
    page = (Path(__file__).parents[3] / "docs" / "results" / "nastran.md").read_text("utf-8")
    words = dict(zip((1, 2, 4), ("one element", "two", "four"), strict=True))
    for n, word in words.items():
        grids = "".join(f"GRID,{i + 1},,{i / n!r},0.,0.\n" for i in range(n + 1))
        rods = "".join(f"CONROD,{i},{i},{i + 1},1,1.-4\n" for i in range(1, n + 1))
        held = f"SPC1,1,123456,1\nSPC1,1,23456,2,THRU,{n + 1}\n"
        found = 2 * np.pi * lowest(component(tmp_path, grids + rods + held), 1)[0]
        c, speed = np.cos(np.pi / (2 * n)), np.sqrt(2e11 / 8000)
        assert found == pytest.approx(n * speed * np.sqrt(6 * (1 - c) / (2 + c)), rel=1e-9)
        nastrans = n * speed * np.sqrt(12 * (1 - c) / (5 + c))
        assert re.search(rf"{100 * (found / nastrans - 1):.1f} %( with)?\s+(with )?{word}", page)


def test_a_modulus_alone_gives_no_shear_modulus(tmp_path):
    """As Nastran has it: neither torsion nor shear deformation, and the bending of E."""
    prop = "PBAR,7,9,1.-4,2.-9,1.-9,1.-9\n,,,,,,,,\n,.8,.8\nMAT1,9,2.+11,,,8000.\n"
    found = component(tmp_path, cantilever("CBAR", prop))
    expected = CLAMPED**2 / (2 * np.pi) * np.sqrt(2e11 * np.array([1e-9, 2e-9]) / 0.8)
    section = found.model.parts["PBAR 7"].section
    assert section.torsion_constant < 1e-11 * section.second_moment
    bending = lowest(found, 10)
    for one in expected:
        assert np.abs(bending / one - 1.0).min() < 1e-4


DIMENSIONS = {
    "ROD": (0.03,), "TUBE": (0.03, 0.02), "TUBE2": (0.03, 0.01), "BAR": (0.02, 0.05),
    "BOX": (0.06, 0.08, 0.006, 0.004), "BOX1": (0.06, 0.08, 0.006, 0.008, 0.004, 0.002),
    "I": (0.1, 0.08, 0.06, 0.006, 0.01, 0.008), "I1": (0.05, 0.006, 0.08, 0.1),
    "T": (0.08, 0.1, 0.01, 0.006), "T1": (0.1, 0.05, 0.01, 0.006),
    "T2": (0.08, 0.1, 0.01, 0.006), "L": (0.06, 0.08, 0.006, 0.008),
    "CHAN": (0.05, 0.1, 0.006, 0.008), "CHAN1": (0.04, 0.006, 0.08, 0.1),
    "CHAN2": (0.006, 0.008, 0.06, 0.1), "Z": (0.04, 0.006, 0.08, 0.1),
    "H": (0.05, 0.02, 0.1, 0.008), "CROSS": (0.05, 0.006, 0.1, 0.008),
}  # fmt: skip
# area as the quick reference guide's drawings have it
AREAS = {
    "BOX": lambda w, h, t, s: w * h - (w - 2 * s) * (h - 2 * t),
    "BOX1": lambda w, h, a, b, c, d: w * h - (w - c - d) * (h - a - b),
    "I": lambda h, a, b, w, c, d: a * c + b * d + (h - c - d) * w,
    "I1": lambda a, b, c, d: b * d + a * (d - c),
    "T": lambda a, b, c, d: a * c + (b - c) * d, "T2": lambda a, b, c, d: a * c + (b - c) * d,
    "T1": lambda a, b, c, d: a * c + b * d, "L": lambda a, b, c, d: a * c + (b - c) * d,
    "CHAN": lambda a, b, c, d: 2 * a * d + (b - 2 * d) * c,
    "CHAN1": lambda a, b, c, d: b * d + a * (d - c), "Z": lambda a, b, c, d: b * d + a * (d - c),
    "CHAN2": lambda a, b, c, d: 2 * a * c + (d - 2 * a) * b,
    "H": lambda a, b, c, d: b * c + a * d, "CROSS": lambda a, b, c, d: b * c + a * d,
    "BAR": lambda a, b: a * b, "ROD": lambda r: np.pi * r**2,
    "TUBE": lambda r, s: np.pi * (r**2 - s**2),
    "TUBE2": lambda r, t: np.pi * (r**2 - (r - t) ** 2),
}  # fmt: skip


def test_all_shapes_have_the_area_of_their_drawing():
    assert set(DIMENSIONS) == set(SHAPES) == set(AREAS)
    for name, sizes in DIMENSIONS.items():
        assert SHAPES[name][1](*sizes).area == pytest.approx(AREAS[name](*sizes)), name


def test_second_moments_and_shear_centres_are_those_of_the_books():
    """An I by its outer rectangle less two; a channel's shear centre in front of its web."""
    h, b, w, t = 0.1, 0.06, 0.006, 0.01
    found = SHAPES["I"][1](h, b, b, w, t, t)
    assert found.along_y == pytest.approx((b * h**3 - (b - w) * (h - 2 * t) ** 3) / 12)
    assert found.along_z == pytest.approx((2 * t * b**3 + (h - 2 * t) * w**3) / 12)
    assert found.shear_centre == pytest.approx((0.0, 0.0), abs=1e-15)
    hollow = SHAPES["BOX"][1](0.06, 0.08, 0.006, 0.004)
    assert hollow.along_y == pytest.approx((0.06 * 0.08**3 - 0.052 * 0.068**3) / 12)
    middle, height = 0.056, 0.074
    walls = 2 * middle / 0.006 + 2 * height / 0.004
    assert hollow.torsion == pytest.approx(4 * (middle * height) ** 2 / walls)
    z = SHAPES["Z"][1](0.04, 0.006, 0.08, 0.1)
    assert z.mixed == pytest.approx(2 * (0.04 * 0.01) * 0.045 * 0.023)
    channel = SHAPES["CHAN"][1](0.05, 0.1, 0.006, 0.008)
    aside = 3 * 0.047**2 * 0.008 / (6 * 0.047 * 0.008 + 0.092 * 0.006)  # from the web's middle
    centroid = (0.1 * 0.006 * 0.003 + 2 * 0.044 * 0.008 * 0.028) / (0.0006 + 0.000704)
    assert channel.shear_centre == pytest.approx((0.0, 0.003 - aside - centroid))


def test_pbarl_and_pbeaml_are_their_shapes(tmp_path):
    bar = component(tmp_path, cantilever("CBAR", "PBARL,7,1,,BAR\n,.02,.05,.3\n"))
    part = bar.model.parts["PBARL 7"]
    assert part.section.second_moment == pytest.approx(0.02 * 0.05**3 / 12)
    assert part.material.density == 8000.0 and part.section.added_mass == 0.3
    cards = cantilever("CBEAM", "PBEAML,7,1,,CHAN\n,.05,.1,.006,.008,,YES,1.,.05\n,.1,.006,.008\n")
    beam = component(tmp_path, cards).model.parts["PBEAML 7"]
    aside = SHAPES["CHAN"][1](0.05, 0.1, 0.006, 0.008).shear_centre[1]
    np.testing.assert_allclose(beam.neutral_axis, [0, -aside], atol=1e-15)
    assert beam.end_offsets is None


def test_moments_of_inertia_that_are_missing_resist_nothing(tmp_path):
    """Without I2 and J a cantilever bends in plane 1 alone; the rest is held, as AUTOSPC does."""
    found = component(tmp_path, cantilever("CBAR", "PBAR,7,1,1.-4,2.-9\n"))
    expected = CLAMPED**2 / (2 * np.pi) * np.sqrt(2e11 * 2e-9 / 0.8)
    np.testing.assert_allclose(lowest(found, 1), expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("prop", "said"),
    [
        ("PBAR,7,1,1.-4\n", "PBAR: its I1 and I2 and J must be positive for a beam"),
        ("PBARL,7,1,,BAR\n,.1,.2,.3,.4\n", "PBARL: has '.4' in field 5 of its line 2, behind its"),
        ("PBARL,7,1,,HAT\n,.1,.1,.1,.1\n", "PBARL: the shape 'HAT' is not read"),
        ("PBAR,8,1,1.-4,1.-9,1.-9,1.-9\n", "PBAR 7 of CBAR in line .* is not defined"),
    ],
)
def test_a_part_that_cannot_be_made_says_why(tmp_path, prop, said):
    with pytest.raises(fem.ModelError, match=said):
        component(tmp_path, cantilever("CBAR", prop))
    with pytest.raises(fem.ModelError, match="its orientation is missing or lies along it"):
        component(tmp_path, cantilever("CBAR", "", way="1.,0.,0."))
