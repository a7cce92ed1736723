"""Shells of Nastran: properties, layers, directions, offsets and thicknesses."""

import numpy as np
import pytest

import fem

pytestmark = [pytest.mark.filterwarnings("ignore::fem.JointWarning", "ignore::fem.UnlikelyWarning")]
HEAD = """SOL 103
CEND
BEGIN BULK
MAT1,1,2.+11,,.3,8000.
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
GRID,4,,0.,1.,0.
GRID,5,,.5,0.,0.
GRID,6,,1.,.5,0.
GRID,7,,.5,1.,0.
GRID,8,,0.,.5,0.
"""


def read(tmp_path, cards):
    path = tmp_path / "deck.bdf"
    path.write_text(f"{HEAD}{cards}ENDDATA\n")
    return fem.read_mesh(path)


def component(mesh):
    return fem.assemble(fem.StructureModel(mesh, fem.parts_of(mesh)))


@pytest.mark.parametrize(
    ("cards", "kinds"),
    [
        ("CQUAD4,1,3,1,2,3,4\n", {"quad"}),
        ("CQUADR,1,3,1,2,3,4\n", {"quad"}),
        ("CTRIA3,1,3,1,2,3\nCTRIAR,2,3,1,3,4\n", {"triangle"}),
        ("CQUAD8,1,3,1,2,3,4,5,6\n,7,8\n", {"quad8"}),
        ("GRID,9,,.5,.5,0.\nCTRIA6,1,3,1,2,3,5,6,9\nCTRIA6,2,3,1,3,4,9,7,8\n", {"triangle6"}),
    ],
)
def test_all_shells_have_their_mass_and_are_plain_where_they_can_be(tmp_path, cards, kinds):
    mesh = read(tmp_path, cards + "PSHELL,3,1,.01,1,,1,,2.\n")
    assert set(mesh.cells) == kinds
    assert fem.parts_of(mesh)["PSHELL 3"] == fem.ShellPart(fem.Material(2e11, 8200.0, 0.3), 0.01)
    assert component(mesh).rigid_mass[0, 0] == pytest.approx(82.0)


QUAD = "CQUAD4,1,3,1,2,3,4\n"


def test_numbers_of_pshell_become_matrices(tmp_path):
    """Twice the bending stiffness, no transverse shear deformation, coupling by MID4."""
    made = fem.parts_of(read(tmp_path, QUAD + "PSHELL,3,1,.01,1,2.\n"))["PSHELL 3"].section
    law = 2e11 / 0.91 * np.array([[1, 0.3, 0], [0.3, 1, 0], [0, 0, 0.35]])
    np.testing.assert_allclose(made.membrane, 0.01 * law)
    np.testing.assert_allclose(made.bending, 2 * 0.01**3 / 12 * law)
    assert np.linalg.eigvalsh(made.shear)[0] > 100 * 2e11 / 2.6 * 0.01
    assert made.mass == pytest.approx(80.0)
    only = fem.parts_of(read(tmp_path, QUAD + "PSHELL,3,1,.01\n"))["PSHELL 3"].section
    np.testing.assert_allclose(only.bending, 0.0)
    cards = QUAD + "PSHELL,3,1,.01,1,,1,,,\n,,,2\nMAT2,2,1.+9,0.,0.,1.+9,0.,1.+8\n"
    both = fem.parts_of(read(tmp_path, cards))["PSHELL 3"].section
    np.testing.assert_allclose(np.diag(both.coupling), -1e-4 * np.array([1e9, 1e9, 1e8]))


def test_moduli_that_contradict_are_told_and_each_element_takes_its_two(tmp_path):
    """E and NU for solids, membranes and bending, G for transverse shear and torsion [1].

    [1] Altair, OptiStruct 2021, "Material Property Checks for MAT1", usage rules.
    """
    E, G, nu, t = 2e11, 3e10, 0.3, 0.01
    cards = QUAD + (
        "PSHELL,3,7,.01,7,,7\nMAT1,7,2.+11,3.+10,.3,8000.\nPSOLID,7,7\n"
        "GRID,11,,0.,0.,5.\nGRID,12,,1.,0.,5.\nGRID,13,,0.,1.,5.\nGRID,14,,0.,0.,6.\n"
        "CTETRA,90,7,11,12,13,14\nPBAR,5,7,1.-4,2.-9,1.-9,4.-9\nCBAR,91,5,11,12,0.,1.,0.\n"
    )
    mesh = read(tmp_path, cards)
    (told,) = [note for note in mesh.notes if "contradict" in note]
    assert "line 15: MAT1 7: E, G and NU contradict each other; E and NU are those of" in told
    parts = fem.parts_of(mesh)
    assert parts["PSOLID 7"].material == fem.Material(E, 8000.0, nu)
    section, bar = parts["PSHELL 3"].section, parts["PBAR 5"]
    law = E / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    np.testing.assert_allclose(section.membrane, t * law, rtol=1e-12)
    np.testing.assert_allclose(section.bending, t**3 / 12 * law, rtol=1e-12)
    np.testing.assert_allclose(section.shear, 5 / 6 * t * G * np.eye(2), rtol=1e-3)
    twist = bar.material.youngs_modulus / (2 * (1 + bar.material.poissons_ratio))
    assert twist * bar.section.torsion_constant == pytest.approx(G * 4e-9)


PLIES = "MAT8,8,1.4+11,1.+10,.3,5.+9,4.+9,3.+9,1600.\n"


def test_layers_are_those_of_the_laminate(tmp_path):
    """PCOMP with blank repetitions, PCOMPG and SYM say the same; its bottom is Z0."""
    factor = 1.0 / (1.0 - 0.3**2 * 1e10 / 1.4e11)
    law = factor * np.array([[1.4e11, 3e9, 0], [3e9, 1e10, 0], [0, 0, 5e9 / factor]])
    plies = [
        fem.Layer(law.tolist(), [[4e9, 0], [0, 3e9]], 1600.0, 1e-3, angle)
        for angle in (0.0, 45.0, 45.0, 0.0)
    ]
    expected = fem.layered(plies, added_mass=0.5)
    decks = (
        "PCOMP,3,,.5\n,8,.001,0.,,,,45.\n,,,45.,,,,0.\n",
        "PCOMP,3,,.5,,,,,SYM\n,8,.001,0.,,8,.001,45.\n",
        "PCOMPG,3,,.5\n,1,8,.001,0.\n,2,8,.001,45.\n,3,8,.001,45.\n,4,8,.001,0.\n",
    )
    for deck in decks:
        (part,) = fem.parts_of(read(tmp_path, QUAD + PLIES + deck)).values()
        np.testing.assert_allclose(part.section.law, expected.law, rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(part.section.shear, expected.shear, rtol=1e-9)
        assert part.section.mass == pytest.approx(6.9)
    (part,) = fem.parts_of(read(tmp_path, QUAD + PLIES + "PCOMP,3,.01\n,8,.001,0.\n")).values()
    B = np.array(part.section.coupling)
    assert B[0, 0] == pytest.approx(0.0105 * 1e-3 * law[0, 0])


def test_elements_with_own_thickness_offset_and_direction_are_parts_of_their_own(tmp_path):
    cards = (
        "CORD2R,5,0,0.,0.,0.,0.,0.,1.\n,1.,1.,0.\nPCOMP,4\n,8,.001,0.\n"
        "PSHELL,3,1,.01,1,,1\nCTRIA3,1,3,1,5,8\nCTRIA3,2,3,5,2,6,,.02\n"
        "CTRIA3,3,3,6,3,7\n,,,.03,.03,.03\nCTRIA3,4,3,7,4,8,77.\n"
        "CTRIA3,5,4,5,6,8,30.\nCTRIA3,6,4,6,7,8,5\n"
    )
    mesh = read(tmp_path, PLIES + cards)
    parts = fem.parts_of(mesh)
    assert list(parts) == ["PSHELL 3", "PSHELL 3 (2)", "PSHELL 3 (3)", "PCOMP 4", "PCOMP 4 (2)"]
    assert len(mesh.part("PSHELL 3")["triangle"]) == 2  # of isotropic ones the angle is nothing
    assert parts["PSHELL 3 (2)"].offset == 0.02
    assert parts["PSHELL 3 (3)"].thickness == pytest.approx(0.03)
    assert parts["PCOMP 4"].direction == 30.0
    np.testing.assert_allclose(parts["PCOMP 4 (2)"].direction, [0.5**0.5, 0.5**0.5, 0], atol=1e-8)
    relative = "CTRIA6,1,3,1,2,3,5,6,9\n,,,1.5,1.5,1.5,1\nGRID,9,,.5,.5,0.\nPSHELL,3,1,.01,1,,1\n"
    (part,) = fem.parts_of(read(tmp_path, relative)).values()
    assert part.thickness == pytest.approx(0.015)
    assert "elements of PSHELL 3 and of 1 other properties differ" in mesh.notes[-1]


def test_what_is_not_used_is_told(tmp_path):
    cards = QUAD + "PSHELL,3,2,.01,2,,2\nMAT1,2,2.+11,,.3,8000.,1.2-5,,.02\nTEMPD,1,20.\n"
    told = [str(item) for item in read(tmp_path, cards).left_out]
    assert "thermal expansion of MAT1 2" in " ".join(told)
    assert any(text.startswith("TEMPD (1") for text in told)
    assert any(text.startswith("GE of MAT1 (1") for text in told)


@pytest.mark.parametrize(
    ("cards", "said"),
    [
        ("PSHELL,3,9,.01,9\n", "PSHELL: names the material 9, which is not defined"),
        ("PSHELL,3,1\n", "PSHELL: its thickness is 0 and must be positive"),
        ("PCOMP,3,,,,,,,SMEAR\n,1,.1,0.\n", "PCOMP: the lamination 'SMEAR' is not read"),
        ("PSHELL,4,1,.01\n", "PSHELL 3 of CQUAD4 in line 13 is not defined"),
        ("PSHELL,3,1,.01,-1\n", "plane strain"),
        ("PSHELL,3,7,.01,7\nMAT1,7,2.+11\n", "MAT1: its G is 0 .* give NU"),
        (
            "PSHELL,3,7,.01,7\nMAT1,7,2.+11,.3\n",
            r"line 15: MAT1: its Poisson's ratio is 3.33333e\+11, .*; does NU stand in the field",
        ),
        ("PSHELL,3,1,.01\nGRID,9,,2.,0.,0.\nCTRIA3,8,3,2,9,3\n,,.03\n", "TFLAG"),
    ],
)
def test_a_part_that_cannot_be_made_says_why(tmp_path, cards, said):
    with pytest.raises(fem.ModelError, match=said):
        fem.parts_of(read(tmp_path, QUAD + cards))
