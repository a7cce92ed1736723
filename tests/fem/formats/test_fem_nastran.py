"""Cards and fields of Nastran, and its solids; what is not read is refused by card."""

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from mixed import mixed_block
from structures import STEEL, lowest_hz

import fem
from fem.formats.nastran.known import ADVICE, LEFT_OUT, READ

CARDS = {"tetra": "CTETRA", "pyramid": "CPYRAM", "wedge": "CPENTA", "hexahedron": "CHEXA"}
WEDGE15 = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11)
HEXAHEDRON20 = (*range(12), 16, 17, 18, 19, 12, 13, 14, 15)
ORDERS = {"wedge15": WEDGE15, "hexahedron20": HEXAHEDRON20}
"""The quick reference guide numbers the edges from bottom to top before those of the top."""


def free(words):
    rows = [words[i : i + 8] for i in range(1, len(words), 8)]
    return "\n".join(",".join([words[0] if not i else "", *row]) for i, row in enumerate(rows))


def fixed(words, width=8):
    many, star = 64 // width, "*" if width == 16 else ""
    rows = [words[i : i + many] for i in range(1, len(words), many)]
    return "\n".join(
        (f"{words[0]}{star}" if not i else star).ljust(8) + "".join(w.ljust(width) for w in row)
        for i, row in enumerate(rows)
    )


STYLES = {"free": free, "small": fixed, "large": lambda words: fixed(words, 16)}


def real(value, digits):
    """As Nastran likes it: a point, and an exponent without its letter."""
    mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
    return f"{mantissa}{int(exponent):+d}" if int(exponent) else mantissa


def bulk(mesh, style):
    digits = {"free": 17, "small": 3, "large": 10}[style]
    write = STYLES[style]
    rows = ["SOL 103", "CEND", "BEGIN BULK", "$ a comment", "PARAM,POST,-1"]
    rows += ["MAT1,1,2.+11,,.3,8000.", "PSOLID,1,1", "PSOLID,2,1", "SPC1,1,123,1"]
    for label, place in enumerate(mesh.points.tolist(), start=1):
        rows.append(write(["GRID", str(label), "", *(real(x, digits) for x in place)]))
    label = 0
    for kind, cells in mesh.cells.items():
        name = CARDS[kind.rstrip("0123456789")]
        for cell in cells[:, ORDERS.get(kind, range(cells.shape[1]))]:
            label += 1
            part = str(1 + label % 2)
            rows.append(write([name, str(label), part, *(str(n + 1) for n in cell)]))
    return "\n".join([*rows, "ENDDATA", "what follows is nothing", ""])


def component(mesh, parts):
    ends = np.flatnonzero(mesh.points[:, 0] < 1e-9)
    held = [fem.Support("ends", ("x", "y", "z"))]
    mesh = mesh.with_point_sets({"ends": ends})
    return fem.assemble(fem.StructureModel(mesh, dict.fromkeys(parts, fem.SolidPart(STEEL)), held))


@pytest.mark.filterwarnings("ignore::fem.LockingWarning")
@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("family", ["first order", "serendipity"])
def test_all_solids_in_all_fields_are_the_component_that_was_written(tmp_path, family, style):
    mesh = mixed_block(family, lambda corners: 0.5 * corners)
    path = tmp_path / "block.bdf"
    path.write_text(bulk(mesh, style))
    found = fem.read_mesh(path)
    known, read = component(mesh, ["body"]), component(found, ["PSOLID 1", "PSOLID 2"])
    assert read.rigid_mass[0, 0] == pytest.approx(known.rigid_mass[0, 0], rel=1e-12)
    np.testing.assert_allclose(lowest_hz(read, 4), lowest_hz(known, 4), rtol=1e-9)
    assert [item.keyword for item in found.left_out] == ["PARAM", "SPC1 1"]
    assert found.described["PSOLID 2"]["made"] == fem.SolidPart(fem.Material(2e11, 8000.0, 0.3))


BRICK = bulk(fem.box_mesh("body", (1.0, 1.0, 1.0), (1, 1, 1), kind="hexahedron"), "free")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("PARAM", "CGAP,9,1,1,2\nCGAP,10,2,1,3\nCSHEAR,7,1,1,2\nPARAM",
         r"CGAP \(2, first in line 5\): contact is.*; CSHEAR \(1, first in line 7\): a shear"),
        ("PARAM", "INCLUDE 'more.bdf'\nPARAM",
         "brick.bdf line 5: INCLUDE: the file .*more.bdf does not"),
        ("PARAM", "NOTHING,1\nPARAM", r"NOTHING \(1, first in line 5\): it is neither read nor"),
        ("PARAM", "PARAM,CM2,2.\nPARAM", "line 5: PARAM: CM2 scales a part of the matrices"),
        ("PARAM", "PARAM,CB1,2.\nPARAM", "line 5: PARAM: CB1 scales a part of the matrices"),
        ("PARAM", "PARAM,WTMASS,1.\nPARAM,WTMASS,.25\nPARAM",
         "line 6: PARAM: WTMASS is 1. already, in line 5; keep one"),
        ("GRID,1,,", "GRID,1,4,", "line 10: GRID: names the coordinate system 4, which is not"),
        ("GRID,1,,", "GRID*   1\nGRID,1,,", "line 10: GRID: has no third coordinate"),
        ("GRID,2,", "GRID,1,", "line 11: GRID: grid point 1 is defined twice"),
        ("GRID,8,", "GRID,99,", "CHEXA: names the grid point 8, which is not defined"),
        ("CHEXA,1,2,", "CHEXA,1,2,,", "line 18 has more fields than a line can have"),
        ("CHEXA,1,2,1,", "CHEXA,1,2,,", "element 1 has 7 grid points where 8 or 20 are needed"),
        ("CHEXA,1,", "CTETRA,1,", "element 1 has 8 grid points where 4 or 10 are needed"),
        ("CHEXA,1,2", "CHEXA,1,x", "line 18: CHEXA: 'X' in field 3 is not a whole number"),
        ("GRID,1,,0.", "GRID,1,,z0.", "line 10: GRID: 'Z0.*' in field 4 is not a real number"),
        ("BEGIN BULK", "BEGIN BULK\n,1,2", "line 4 goes on with a card that is not there"),
        ("PSOLID,2,1", "PSOLID,2,1,,,,,PFLUID", r"PSOLID: is of a fluid .*\(PFLUID\), no solid"),
        ("PSOLID,2,1", "PSOLID,2,1,,,,,,,+A\n+B", r"goes on with the mark '\+B', but PSOLID"),
        ("CHEXA", "$CHEXA", "is no Nastran bulk data with elements|line"),
        ("BEGIN BULK", "BEGIN_BULK", "line 3: BEGIN_BULK: write it as BEGIN BULK"),
        ("MAT1,1,2.+11,,.3,8000.", "MAT9,1,1.+11", "line 6: MAT9: solids of it are not read; give"),
        ("BEGIN BULK", "BEGIN SUPER=1", "superelements are not read; write the model as one"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_refused_with_its_place(tmp_path, old, new, said):
    path = tmp_path / "brick.bdf"
    assert old in BRICK
    path.write_text(BRICK.replace(old, new, 1))
    with pytest.raises(fem.ModelError, match=said):
        fem.parts_of(fem.read_mesh(path))


def test_cards_of_analyses_and_unused_systems_change_nothing(tmp_path):
    """Femap writes two coordinate systems into every deck; NLPARM says how a step is solved."""
    path = tmp_path / "brick.bdf"
    more = "CORD2C,1,0,0.,0.,0.,0.,0.,1.\n,1.,0.,1.\nCORD2S,2,0,0.,0.,0.,0.,0.,1.\n,1.,0.,1.\n"
    path.write_text(BRICK.replace("PARAM", f"NLPARM,1,10\nTABDMP1,3\n{more}PARAM", 1))
    found = fem.read_mesh(path)
    assert [str(item) for item in found.left_out][:2] == [
        "NLPARM (1, first in line 5): which analysis is made is told by the scene",
        "TABDMP1 (1, first in line 6): which analysis is made is told by the scene",
    ]


def test_parameters_that_nobody_knows_are_named(tmp_path):
    path = tmp_path / "brick.bdf"
    path.write_text(BRICK.replace("PARAM", "PARAM,WTMAS,.25\nPARAM,XQZ,1\nPARAM,COUPMASS,1\nPARAM"))
    assert [str(item) for item in fem.read_mesh(path).left_out][:4] == [
        "PARAM WTMAS (1, first in line 5): no parameter of this name is known; is it WTMASS?",
        "PARAM XQZ (1, first in line 6): no parameter of this name is known",
        "PARAM COUPMASS (1, first in line 7): masses are consistent here, always",
        "PARAM (1, first in line 8): it changes no matrix of this model",
    ]


def test_marks_of_continuations_are_compared_from_the_second_column_on(tmp_path):
    """Field 10 is " +000001" and the next line begins with "++000001"."""
    path = tmp_path / "brick.bdf"
    text = BRICK.replace("PSOLID,2,1", f"PSOLID  2       1{'':55} +000001\n++000001")
    assert "++000001" in text
    path.write_text(text)
    assert fem.read_mesh(path).described["PSOLID 2"]["made"]


def test_cards_to_ignore_are_left_out(tmp_path):
    path = tmp_path / "brick.bdf"
    path.write_text(BRICK.replace("PARAM", "CGAP,9,1,1,2\nPGAP,1\nPARAM", 1))
    found = fem.read_mesh(path, ignore=["CGAP", "PGAP"])
    assert "CGAP (1, first in line 5): it is to be ignored" in map(str, found.left_out)


def test_included_files_are_read_and_errors_name_them(tmp_path):
    head, points = BRICK.split("GRID,1,", 1)
    (tmp_path / "points.inc").write_text("GRID,1," + points)
    path = tmp_path / "brick.bdf"
    path.write_text(f"{head}INCLUDE 'POINTS.\nINC'\n")
    assert len(fem.read_mesh(path).cells["hexahedron"]) == 1
    (tmp_path / "points.inc").write_text("GRID,1," + points.replace("CHEXA,1,2", "CHEXA,1,x"))
    with pytest.raises(fem.ModelError, match=r"brick.bdf: points.inc line 9: CHEXA: 'X'"):
        fem.read_mesh(path)
    path.write_text(BRICK.replace("CEND", "INCLUDE '/programs/alter.v9'\nCEND", 1))
    told = [str(item) for item in fem.read_mesh(path).left_out]
    assert told[0].startswith("INCLUDE of executive control (1, first in line 2): it holds no bulk")


UNKNOWN = ("pyramid13", "wedge15")  # to meshio


@pytest.mark.filterwarnings("ignore::fem.LockingWarning")
@pytest.mark.parametrize("form", ["fixed-small", "fixed-large", "free"])
@pytest.mark.parametrize("family", ["first order", "serendipity"])
def test_meshio_writes_the_same_solids(tmp_path, family, form):
    mesh, path = mixed_block(family, lambda corners: 0.5 * corners), tmp_path / "block.bdf"
    cells = {kind: nodes for kind, nodes in mesh.cells.items() if kind not in UNKNOWN}
    ones = [np.ones(len(nodes), dtype=int) for nodes in cells.values()]
    content = meshio.Mesh(mesh.points, list(cells.items()), cell_data={"nastran:ref": ones})
    meshio.nastran.write(path, content, point_format=form, cell_format="fixed-small")
    path.write_text(path.read_text().replace("_", " "))  # it writes CHEXA_ for 20 nodes
    found = fem.read_mesh(path)
    assert set(found.cells) == set(cells)
    for kind, nodes in cells.items():
        np.testing.assert_allclose(found.points[found.cells[kind]], mesh.points[nodes], atol=1e-6)


def test_the_page_lists_every_card():
    """docs/reference/nastran.md and `known.py` say the same of every card."""
    page = (Path(__file__).parents[3] / "docs" / "reference" / "nastran.md").read_text("utf-8")
    read, left = page.split("## All cards")[1].split("**Left out by intention:**")
    assert set(re.findall(r"`(.+?)`", read)) == READ
    left, refused = left.split("**Refused with advice**")
    for text, known in ((left, LEFT_OUT), (refused, ADVICE)):
        rows = re.findall(r"^\| (.+?) \| (`.+`) \|$", text, flags=re.MULTILINE)
        found = {card: why for why, cards in rows for card in re.findall(r"`(.+?)`", cards)}
        assert found == known
    assert not READ & set(LEFT_OUT) and not READ & set(ADVICE) and not set(LEFT_OUT) & set(ADVICE)
