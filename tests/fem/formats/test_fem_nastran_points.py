"""Systems, supports, masses, springs, rigid elements and equations of Nastran in closed forms."""

import numpy as np
import pytest
import scipy.linalg

import fem

pytestmark = [
    pytest.mark.filterwarnings("ignore::fem.LockingWarning", "ignore::fem.JointWarning"),
]

BRICK = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
GRID,4,,0.,1.,0.
GRID,5,,0.,0.,1.
GRID,6,,1.,0.,1.
GRID,7,,1.,1.,1.
GRID,8,,0.,1.,1.
CHEXA,1,1,1,2,3,4,5,6
,7,8
PSOLID,1,1
MAT1,1,2.+11,,.3,8000.
"""
HELD = "SPC1,1,123456,1,THRU,8\n"


def read(tmp_path, more, case=None):
    if case is None:
        case = "SPC = 1" if "SPC1,1," in more or "SPC1    1 " in more else ""
    path = tmp_path / "deck.bdf"
    path.write_text(f"SOL 103\nCEND\n{case}\nBEGIN BULK\n{BRICK}{more}ENDDATA\n")
    return fem.read_mesh(path)


def assembled(mesh, **more):
    return fem.assemble(fem.StructureModel(mesh, fem.parts_of(mesh), separate=True, **more))


def hz(component):
    values = scipy.linalg.eigh(
        component.stiffness.toarray(), component.mass.toarray(), eigvals_only=True
    )
    return np.sqrt(np.abs(values)) / (2.0 * np.pi)


def test_coordinate_systems_stand_in_chains(tmp_path):
    """A point of a spherical system in a cylindrical one in a turned rectangular one."""
    mesh = read(
        tmp_path,
        "CORD2R,1,0,1.,2.,3.,2.,2.,3.\n,1.,3.,3.\n"  # z along x, x along y
        "CORD2C,2,1,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
        "CORD2S,3,2,2.,90.,1.,2.,90.,2.\n,3.,90.,1.\n"  # its origin at y' = 2, z' = 1
        "GRID,20,3,4.,90.,90.\nGRID,21,2,5.,180.,0.5\n"
        "GRID,31,,0.,0.,0.\nGRID,32,,0.,0.,1.\nGRID,33,,0.,1.,0.\nCORD1C,4,31,32,33\n"
        "GRID,22,4,2.,90.,3.\n"
        "CONM2,101,20,,1.\nCONM2,102,21,,1.\nCONM2,103,22,,1.\n",
    )
    # axes of 1 in basic: x' = y, y' = z, z' = x
    # 2 has the axes of 1, and its directions at the origin of 3 are e_r = y', so the x axis of 3
    # is y' and its y axis is z' x y' = -x'
    origin = np.array([1.0, 2.0, 3.0]) + 2.0 * np.array([0, 0, 1.0]) + np.array([1.0, 0, 0])
    expected = {
        "node 20": origin + 4.0 * np.array([0, -1.0, 0]),
        "node 21": np.array([1.0, 2.0, 3.0]) - 5.0 * np.array([0, 1.0, 0]) + [0.5, 0, 0],
        "node 22": np.array([-2.0, 0.0, 3.0]),  # x' = y, so y' = z x y = -x
    }
    for name, place in expected.items():
        np.testing.assert_allclose(mesh.points[mesh.node(name)], place, atol=1e-12)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("CORD2R,1,2,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nCORD2R,2,1,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
         "GRID,9,1,0.,0.,0.\n", "CORD2R: coordinate system 1 rests on itself"),
        ("CORD2R,1,0,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\nGRID,9,1,0.,0.,0.\n", "lie on a line"),
        ("CONM2,9,77,,1.\n", "CONM2: names the grid point 77, which is not defined"),
        ("PARAM,WTMASS,0.\n", "PARAM: WTMASS is 0 and must be positive"),
        ("DMIG,A,0,6,1\nDMIG,A,1,1,,1,1,2.\nDMIG,A,1,1,,1,1,3.\n", "DMIG: the number .* twice"),
        ("GRID,9,,0.,0.,0.\nCONROD,9,1,9,1,1.\n", "CONROD: has no length"),
        ("CELAS2,9,5.,77,0\n", "CELAS2: names the grid point 77, which is not defined"),
        ("CELAS1,9,5,1,1\n", "CELAS1: names the property 5, which is not defined"),
        ("CBUSH,9,5,1,2\n", "CBUSH: names the property PBUSH 5, which is not defined"),
        ("PBUSH,5,K,1.\nCBUSH,9,5,1\n", r"CBUSH: has no length, so it needs a .* \(CID\)"),
        ("PBUSH,5,K,1.,2.\nCBUSH,9,5,1,2\n", "CBUSH: acts across its line and needs an orient"),
        ("SPC1,1,7,1\n", "SPC1: '7' in field 4 are not directions out of 1 to 6|'7' in field 3"),
        ("RBE3,9,,1,123456,1.,123,2,3\n", "RBE3: its grid points do not determine all six"),
        ("RBAR,9,1,2,123,123456\n", "RBAR: its independent directions .* are not six"),
        ("CONROD,9,1,2,1,1.\nCROD,8,1,1,2,7,1,2,3\n", "CROD: has '7' in field 6, behind its last"),
        ("GRID,9,,0.,0.,0.\n=,*1,=,*1.,==\n=4\n", r"= \(1, .* =4 \(1, .*: it repeats the card"),
    ],
)  # fmt: skip
def test_faults_name_card_line_and_what_is_wrong(tmp_path, more, said):
    with pytest.raises(fem.ModelError, match=said):
        read(tmp_path, more)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("CONM2,51,1,,3.,.1,.2,.3,.5\n,.05\n", "CONM2: has '.5' in field 9, which must be blank"),
        ("MPC,8,1,2,1.,2,2,-1.,5\n,,3,2,.5\n", "MPC: has '5' in field 9, which must be blank"),
        ("MPC,8,1,2,1.,2,2,-1.\n,3,2,.5\n", "MPC: has '3' in field 2 of its line 2, which must"),
        ("MPC,8,1,2,1.,,2,-1.\n", "MPC: has '2' in field 7, but nothing in field 6"),
        ("PBAR,1,1,1.-3,4.-7,1.-7,2.-7,.5,7.\n", "PBAR: has '7.' in field 9, which must be"),
        ("PBARL,1,1,,ROD,,,,.1\n,.2\n", "PBARL: has '.1' in field 9, which must be blank"),
        ("CTRIA3,9,1,1,2,3,,,.1\n", "CTRIA3: has '.1' in field 9, which must be blank"),
        ("MAT1,9,2.+11,,.3,,,,\n,,,,,7.\n", "MAT1: has '7.' in field 6 of its line 2, behind"),
        ("RBE3,9,7,1,123456,1.,123,2,3\n", "RBE3: has '7' in field 3, which must be blank"),
        ("SPC,1,,12,0.\n", "SPC: has '12' in field 4, but nothing in field 3, which goes with it"),
        ("PVISC,4,2.,,9\n", "PVISC: has '9' in field 5, which must be blank"),
        ("DMIG,A,0,6,1\nDMIG,A,1,1,,1,1,2.\n,,1,2,3.\n", "DMIG: has '1' in field 3 of its line"),
        ("DMIG,A,0,6,1\nDMIG,A,1,1,,1,1,2.,3.\n", "DMIG: has '3.' in field 9, an imaginary part"),
        ("MAT1,1,30,+6,,.3\n", "MAT1: '30' in field 3 is a whole number where .*; write '30.'"),
        ("CELAS2,9,100,1,1\n", "CELAS2: '100' in field 3 is a whole number where .*write '100.'"),
        ("CONM2,9,1,,1.\n,.5,0,.5\n", "CONM2: '0' in field 3 of its line 2 is a whole number"),
    ],
)  # fmt: skip
def test_what_stands_where_a_card_has_no_field_is_refused_and_so_are_whole_numbers_for_reals(
    tmp_path, more, said
):
    """The fields are those of the quick reference guide, in which reals have a point."""
    text = BRICK.replace("MAT1,1,2.+11,,.3,8000.\n", "") if "MAT1,1," in more else BRICK
    path = tmp_path / "deck.bdf"
    case = "SPC = 1\nMPC = 8" if "MPC," in more else "SPC = 1"
    path.write_text(f"SOL 103\nCEND\n{case}\nBEGIN BULK\n{text}{more}SPC1,1,3,1\nENDDATA\n")
    with pytest.raises(fem.ModelError, match=said):
        fem.parts_of(fem.read_mesh(path))


def test_a_bush_that_turns_corners_of_solids_is_named(tmp_path):
    """Nothing else has rotations there, so that both ends may turn together."""
    cards = "PBUSH,5,K,1.,1.,1.,1.,1.,1.\nCBUSH,50,5,7,20,,,,0\nGRID,20,,2.,1.,1.\n"
    told = read(tmp_path, cards).notes
    assert any("line 18: CBUSH 50 turns the grid point 7, whose other elements" in n for n in told)
    flat = "PBUSH,5,K,1.,1.,1.\nCBUSH,50,5,7,21,,,,0\nGRID,21,,1.,1.,1.\n"
    assert not read(tmp_path, flat).notes


def test_an_equation_needs_a_first_factor(tmp_path):
    with pytest.raises(fem.ModelError, match="line 17: MPC: its first factor is 0"):
        read(tmp_path, "MPC,1,1,1,0.,2,1,1.\n", "MPC = 1")


def test_structural_damping_and_warping_are_told(tmp_path):
    cards = (
        "GRID,9,,2.,0.,0.\nPELAS,3,4.,.1\nCELAS1,11,3,9,1,1,1\nCELAS2,12,4.,9,2,,,.1\n"
        "PBUSH,4,K,1.,1.,1.,1.,1.,1.\n,GE,.05\nCBUSH,13,4,9,,,,,0\n"
        "PBEAM,5,1,.1,.1,.1,,.1\nCBEAM,14,5,2,9,0.,0.,1.\n,,,,,,,,\n,77,78\n"
    )
    told = {item.keyword for item in read(tmp_path, cards).left_out}
    assert {"GE of PELAS", "GE of CELAS2", "GE of PBUSH", "warping at the ends of CBEAM"} <= told


def test_points_of_a_range_that_are_not_there_and_springs_that_join_nothing_are_told(tmp_path):
    cards = (
        "SPC1,1,3,6,THRU,10\nSPC1,1,3,200,THRU,210\nRBE2,9,1,123,2,THRU,9\nCELAS2,7,1.,1,2,1,2\n"
    )
    mesh = read(tmp_path, cards)
    told = {item.keyword: (item.count, item.place) for item in mesh.left_out}
    assert told == {
        "points of SPC1 with THRU that are not defined": (2 + 11, "line 17"),
        "points of RBE2 with THRU that are not defined": (1, "line 19"),
        "CELAS2 between a point and itself": (1, "line 20"),
    }
    with pytest.raises(fem.ModelError, match="line 17: SPC1: names the grid point 9, which is not"):
        read(tmp_path, "SPC1,1,3,8,9\n")


def test_masses_have_numbers_of_their_own_and_directions_may_have_blanks(tmp_path):
    text = f"CONM2,1,2,,3.\nSPC1    1       12  3   1\nCONM2  *{2:<16}{3:<16}{0:<16}{5.0:<16}\n*\n"
    mesh = read(tmp_path, text)
    assert [mass.mass for mass in mesh.attachments.point_masses] == [3.0, 5.0]
    assert mesh.attachments.supports[0].directions == ("x", "y", "z")


def test_case_control_chooses_supports_and_all_else_is_told(tmp_path):
    cards = "SPC1,1,123,1,2\nSPC,2,3,12\nSPCADD,5,1,2\nSPC1,7,3,8\n"
    mesh = read(tmp_path, cards, "SPC = 7\nSUBCASE 2\nSPC = 5")
    held = {s.point: (s.directions, mesh.point_sets[s.point].tolist()) for s in
            mesh.attachments.supports}  # fmt: skip
    assert held == {
        "SPC 1 2 5 x y z": (("x", "y", "z"), [0, 1]),
        "SPC 1 2 5 x y": (("x", "y"), [2]),
    }
    assert not mesh.notes
    assert [str(item) for item in mesh.left_out] == [
        "SPC1 7 (1, first in line 22): no SPC of case control chooses the set 7"
    ]
    assert not read(tmp_path, cards, "").attachments.supports
    with pytest.raises(fem.ModelError, match="line 3: SPC = 6 chooses a set that is not there"):
        read(tmp_path, cards, "SPC = 6")
    with pytest.raises(fem.ModelError, match="line 21: SPCADD: adds the set 9, which is not there"):
        read(tmp_path, cards + "SPCADD,8,1,9\n", "SPC = 8")
    assert (
        "MPC = 4 chooses a set, but the deck has no MPC" in read(tmp_path, "", "MPC = 4").notes[0]
    )
    path = tmp_path / "bulk.bdf"
    path.write_text(BRICK + "SPC1,3,123,1,THRU,4\n")
    alone = fem.read_mesh(path)
    assert alone.attachments.supports and "SPC = 3, the only set, is taken" in alone.notes[0]


@pytest.mark.parametrize(
    ("case", "omega", "said"),
    [
        ("SPC = 9\nSUBCASE 1\nSPC = 1", 2.0, "SPC1 9"),
        ("SPC = 1\nMPC = 5\nSUBCASE 1\nMPC = 6", np.sqrt(104.0 / 2.0), "MPC 5"),
        ("SPC = 1\nK2GG = A\nSUBCASE 1\nK2GG = B", 3.0, "DMIG A"),
        ("SPC = 1\nK2GG = (2.0*A,\n 0.5*B)\nSUBCASE 1", np.sqrt(4.0 + 12.0 + 2.5), None),
        ("SPC = 1\nSUBCASE 1\nSUBCASE 2\nK2GG = B", 3.0, "DMIG A"),
        ("SPC = 1\nLABEL = a mass,\nK2GG = B\nSUBCASE 1", 3.0, "DMIG A"),
    ],
)
def test_the_choice_inside_a_case_beats_that_above_all_cases(tmp_path, case, omega, said):
    """A mass of 1 on a spring of 4; equations tie another mass to it, matrices stiffen it."""
    cards = (
        "GRID,20,,5.,5.,5.\nCMASS2,9,1.,20,1\nCELAS2,10,4.,20,1\nSPC1,1,23,20\nSPC1,9,1,20\n"
        "GRID,21,,6.,5.,5.\nSPC1,1,123,21\nSPOINT,30\nCMASS2,11,1.,30\nCELAS2,12,100.,30\n"
        "SPOINT,31\nCMASS2,13,1.,31\nCELAS2,14,400.,31\n"
        "MPC,5,31,,1.,20,1,-1.\nMPC,6,30,,1.,20,1,-1.\n"
        "DMIG,A,0,6,1,0\nDMIG,A,20,1,,20,1,6.\nDMIG,B,0,6,1,0\nDMIG,B,20,1,,20,1,5.\n"
    )
    mesh = read(tmp_path, cards + HELD, case)
    assert 2.0 * np.pi * hz(assembled(mesh))[0] == pytest.approx(omega, rel=1e-9)
    assert said is None or said in [item.keyword for item in mesh.left_out]
    assert not mesh.notes


def test_what_other_cases_choose_is_told_and_what_one_case_chooses_twice_refused(tmp_path):
    cards = HELD + "SPC1,7,123,1\nDMIG,A,0,6,1,0\nDMIG,B,0,6,1,0\n"
    case = "K2GG = A\nSUBCASE 1\nSPC = 1\nSUBCASE 2\nSPC = 7\nK2GG = B"
    told = " ".join(read(tmp_path, cards, case).notes)
    again = " ".join(read(tmp_path, cards, case + "\nSUBCASE 3\nSPC = 1").notes)
    assert "SPC = 1 of the first case that has one is taken, not SPC = 7" in again
    with pytest.raises(fem.ModelError, match="ends with a comma, and no line goes on"):
        read(tmp_path, cards, "K2GG = (2.0*A,")
    assert "SPC = 1 of the first case that has one is taken, not SPC = 7" in told
    assert "K2GG = A of the first case that has one is taken, not K2GG = B" in told
    with pytest.raises(fem.ModelError, match="line 4: SPC = 7: its case chooses SPC = 1 already"):
        read(tmp_path, cards, "SPC = 1\nSPC = 7")
    with pytest.raises(fem.ModelError, match=r"line 4: K2GG = 2.0A: is not read; name matrices"):
        read(tmp_path, cards, "SPC = 1\nK2GG = 2.0A")


@pytest.mark.parametrize(
    ("cards", "expected"),
    [
        ("CELAS2,9,4.+4,20,1\nCONM2,10,20,,2.\n", [np.sqrt(4e4 / 2)]),
        ("PELAS,3,4.+4\nCELAS1,9,3,20,1,1,1\nCMASS2,10,2.,20,1\n", [np.sqrt(4e4 / 2)]),
        ("SPOINT,21,22\nCELAS4,9,3.,21,0\nCELAS4,10,3.,21,22\nCMASS4,11,1.,21,0\n"
         "CMASS4,12,1.,22,0\n",  # two masses in a row: 3 (3 -+ sqrt 5)/2
         np.sqrt(3.0 * (3.0 + np.array([-1, 1]) * np.sqrt(5.0)) / 2.0)),
        ("PARAM,WTMASS,.5\nPBUSH,3,K,1.,4.,9.\nCBUSH,9,3,20,,,,,0\nCONM2,10,20,,2.\n",
         [1.0, 2.0, 3.0]),
        # a disc on a bush that twists, its inertia given in a turned system
        ("CORD2R,7,0,0.,0.,0.,1.,0.,0.\n,0.,1.,0.\nPBUSH,3,K,,,,8.,18.,32.\n"
         "CBUSH,9,3,20,,,,,0\nCONM2,10,20,7,0.\n,2.,,2.,,,2.\n", [2.0, 3.0, 4.0]),
        # in a skew system of displacements only the direction (1, 1, 0) is free
        ("CORD2R,7,0,0.,0.,0.,0.,0.,1.\n,1.,1.,0.\nGRID,30,0,5.,5.,5.,7\nSPC1,1,23,30\n"
         "CELAS2,9,8.,30,1\nCONM2,10,30,,2.\n", [2.0]),
        # a mass on a massless rigid lever of length 2, turned by a spring of 16 N m
        ("GRID,31,,7.,5.,5.\nRBE2,9,20,123456,31\nCONM2,10,31,,1.\nSPC1,1,12345,20\n"
         "CELAS2,11,16.,20,6\n", [2.0]),
        ("GRID,31,,7.,5.,5.\nRBAR,9,20,31,123456\nCONM2,10,31,,1.\nSPC1,1,12345,20\n"
         "CELAS2,11,16.,20,6\n", [2.0]),
        # a body at the end of that lever turns with it, and so does what an equation ties to it
        ("GRID,31,,7.,5.,5.\nRBE2,9,20,123456,31\nCONM2,10,31,,1.\n,12.,,12.,,,12.\n"
         "SPC1,1,12345,20\nCELAS2,11,64.,20,6\n", [2.0]),
        ("GRID,31,,7.,5.,5.\nRBE2,9,20,123456,31\nCONM2,10,31,,1.\nSPC1,1,12345,20\n"
         "CELAS2,11,52.,20,6\nGRID,40,,5.,5.,5.\nSPC1,1,23,40\nCONM2,12,40,,1.\n"
         "MPC,4,40,1,-1.,31,6,3.\n", [2.0]),
        # the mean of two masses, one on a spring each, moves a third: (k1 + k2)/(m + 4 m3/4)
        ("GRID,31,,6.,5.,5.\nSPC1,1,23,20,31\nMPC,4,40,1,-2.,20,1,1.\n,,31,1,1.\n"
         "GRID,40,,5.5,5.,5.\nSPC1,1,23,40\nCONM2,10,40,,4.\nCELAS2,11,8.,20,1\n"
         "CELAS2,12,8.,31,1\nMPC,4,20,1,1.,31,1,-1.\n", [2.0]),
    ],
)  # fmt: skip
def test_masses_and_springs_swing_as_they_should(tmp_path, cards, expected):
    mesh = read(tmp_path, f"GRID,20,,5.,5.,5.\n{cards}{HELD}", "SPC = 1\nMPC = 4")
    omega = np.sort(2.0 * np.pi * hz(assembled(mesh)))
    np.testing.assert_allclose(omega, np.sort(expected), rtol=1e-9)


def test_an_averaging_element_moves_with_the_rigid_body_and_with_the_weighted_mean(tmp_path):
    mesh = read(tmp_path, "GRID,20,,.5,.5,3.\nRBE3,9,,20,123456,1.,123,5,6\n,7,3.,123,8\n", "")
    at = {name: mesh.points[mesh.node(name)] for name in ("node 5", "node 6", "node 7", "node 8")}
    centre, weights = np.array([0.5, 0.5, 3.0]), {name: 1.0 for name in at} | {"node 8": 3.0}
    rng = np.random.default_rng(3)
    shift, turn = rng.normal(size=(2, 3))
    moved = {name: shift + np.cross(turn, place - centre) for name, place in at.items()}
    expected = dict(zip(AXES, [*shift, *turn], strict=True))
    for equation in mesh.attachments.equations:
        (point, way, own), *others = equation.terms
        assert point == "node 20"
        found = -sum(c * moved[p]["xyz".index(d)] for p, d, c in others) / own
        assert found == pytest.approx(expected[way], abs=1e-12)
    # the force on the mean is shared by weight, where it acts at their weighted centre
    z = next(e for e in mesh.attachments.equations if e.terms[0][1] == "z").terms
    shares = {p: -c for p, d, c in z[1:] if d == "z"}
    moment = sum(share * (at[p] - centre) for p, share in shares.items())[:2]
    assert sum(shares.values()) == pytest.approx(1.0)
    np.testing.assert_allclose(moment, 0.0, atol=1e-12)
    least = sum(s**2 / weights[p] for p, s in shares.items())
    even = dict.fromkeys(shares, 0.25)  # another sharing in balance costs more
    assert least < sum(s**2 / weights[p] for p, s in even.items()) + 1e-12


AXES = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")


def test_masses_off_their_points_and_with_products_of_inertia_are_whole_bodies(tmp_path):
    """The rigid mass about the origin is that of a body at its place, by Steiner's theorem."""
    inertia = np.array([[5.0, -1.0, -0.5], [-1.0, 6.0, -0.25], [-0.5, -0.25, 7.0]])
    cards = (
        "GRID,20,,5.,5.,5.\nRBE2,9,20,123456,1\n"
        "CONM2,10,20,,3.,.1,.2,.3\n,5.,1.,6.,.5,.25,7.\n"
        "CONM2,11,20,-1,2.,6.,5.,4.\n"
        "CONM1,12,20,,1.,0.,1.,0.,0.\n,1.\n"
    )
    mesh = read(tmp_path, cards, "")
    with_mass = assembled(mesh).rigid_mass
    plain = assembled(read(tmp_path, "", "")).rigid_mass

    def body(mass, place, own):
        x, y, z = place
        lever = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        to_centre = np.hstack([np.eye(3), lever])
        found = mass * to_centre.T @ to_centre
        found[3:, 3:] += own
        return found

    expected = body(3.0, (5.1, 5.2, 5.3), inertia) + body(2.0, (6.0, 5.0, 4.0), 0.0)
    expected += body(1.0, (5.0, 5.0, 5.0), 0.0)
    np.testing.assert_allclose(with_mass - plain, expected, rtol=1e-12, atol=1e-9)


def test_dampers_of_all_kinds_make_one_damping_matrix(tmp_path):
    cards = (
        "GRID,20,,5.,5.,5.\nGRID,21,,8.,5.,9.\nCONM2,9,20,,1.\nCELAS2,10,9.,20,1\n"
        "CELAS2,14,9.,20,2\nCELAS2,15,9.,20,3\nSPC1,1,123,21\n"
        "CDAMP2,11,.5,20,1\nPDAMP,3,.25\nCDAMP1,12,3,20,2\nPVISC,4,2.\nCVISC,13,4,20,21\n"
        "PBUSH,5,B,1.\nCBUSH,16,5,20,,,,,0\n"
    )
    along = np.array([0.6, 0.0, 0.8])
    expected = np.diag([1.5, 0.25, 0.0]) + 2.0 * np.outer(along, along)
    found = assembled(read(tmp_path, cards + HELD)).damping.toarray()
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_scalar_points_have_no_place(tmp_path):
    """They move neither the centre of mass nor its amount, and are at no other point."""
    cards = "SPOINT,100,THRU,140\nCELAS2,5,1000.,1,2,100\nCMASS2,6,2.,100\n"
    cards += "".join(
        f"CELAS2,{n},9.,{n - 1},0,{n}\nCMASS2,{n + 200},1.,{n}\n" for n in range(101, 141)
    )
    mesh = read(tmp_path, cards)
    found = fem.assemble(fem.StructureModel(mesh, fem.parts_of(mesh)))  # no slit: not separate
    plain = assembled(read(tmp_path, ""))
    np.testing.assert_allclose(found.rigid_mass, plain.rigid_mass, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(found.inertia.sum(axis=0), plain.inertia.sum(axis=0), atol=1e-8)
    gaps = np.linalg.norm(mesh.points[:, None] - mesh.points, axis=2) + np.eye(len(mesh.points))
    assert gaps.min() > 1e-4
    found.save(tmp_path / "component.npz")
    again = type(found).load(tmp_path / "component.npz")
    np.testing.assert_array_equal(again.rigid_mass, found.rigid_mass)


def test_parameters_may_stand_in_case_control(tmp_path):
    halved = assembled(read(tmp_path, "", " param, wtmass, .5"))
    assert halved.rigid_mass[0, 0] == pytest.approx(4000.0)
    rigid = "RBE2,9,1,123456,2\n"
    assert read(tmp_path, rigid).attachments.loose
    assert not read(tmp_path, rigid, "AUTOSPC(NOPRINT) = NO").attachments.loose


def test_the_analysis_set_is_a_set_of_points(tmp_path):
    mesh = read(tmp_path, "ASET,1,3,5,123\nASET1,123,7,THRU,8\n")
    assert mesh.nodes("ASET").tolist() == [0, 4, 6, 7]


def test_supports_alone_do_not_forbid_another_unit(tmp_path):
    mesh = read(tmp_path, "SPC1,1,123,1,2\n")
    assert mesh.attachments and not mesh.attachments.measured


PUNCHED = """DMIG    KSPR           0       6       2       0                       2
DMIG*   KSPR                          20               1
*                     20               1 8.000000000D+00
DMIG*   KSPR                          20               2
*                     20               1-2.000000000D+00
*                     20               2 5.000000000D+00
"""


def test_matrices_that_case_control_names_are_added(tmp_path):
    """A punched stiffness, and a mass in free fields; unnamed ones are told."""
    (tmp_path / "k.pch").write_text(PUNCHED)
    cards = (
        "GRID,20,,5.,5.,5.\nINCLUDE 'k.pch'\nDMIG,MASS,0,1,1\nDMIG,MASS,20,1,,20,1,2.\n"
        "DMIG,MASS,20,2,,20,2,2.\nDMIG,OTHER,0,6,1\nDMIG,OTHER,20,1,,20,1,9.\n"
    )
    mesh = read(tmp_path, cards + HELD, "SPC = 1\nK2GG = KSPR\nM2GG = MASS")
    expected = np.linalg.eigvalsh([[8.0, -2.0], [-2.0, 5.0]]) / 2.0
    np.testing.assert_allclose((2 * np.pi * hz(assembled(mesh))) ** 2, expected, rtol=1e-9)
    assert any(item.keyword == "DMIG OTHER" for item in mesh.left_out)
    turning = (
        "GRID,20,,5.,5.,5.\nCONM2,9,20,,,\n,2.,,2.,,,2.\nSPC1,1,12356,20\n"
        "DMIG,TURN,0,6,1\nDMIG,TURN,20,4,,20,4,8.\n"
    )
    mesh = read(tmp_path, turning + HELD, "SPC = 1\nK2GG = TURN")
    np.testing.assert_allclose(2 * np.pi * hz(assembled(mesh)), [2.0], rtol=1e-9)
    with pytest.raises(fem.ModelError, match="K2GG = NONE: there is no DMIG 'NONE'"):
        read(tmp_path, cards, "K2GG = NONE")
    bad = "DMIG,MASS,0,1,1\nDMIG,MASS,1,1,,2,1,2.\n"
    with pytest.raises(fem.ModelError, match="DMIG: MASS is not symmetric"):
        read(tmp_path, bad, "M2GG = MASS")
    rectangular = "DMIG,MASS,0,2,1\n"
    with pytest.raises(fem.ModelError, match="DMIG: must be symmetric"):
        read(tmp_path, rectangular, "M2GG = MASS")
    assert [item.keyword for item in read(tmp_path, rectangular, "").left_out] == ["DMIG MASS"]
