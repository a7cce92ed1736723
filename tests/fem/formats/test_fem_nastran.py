"""Solids of Nastran bulk data, in all fields; what is not read is refused by card."""

import meshio
import numpy as np
import pytest
from mixed import mixed_block
from structures import STEEL, lowest_hz

import fem

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
    rows = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "$ a comment", "PARAM,POST,-1"]
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
    found = fem.read_structure(path)
    known, read = component(mesh, ["body"]), component(found, ["PSOLID 1", "PSOLID 2"])
    assert read.rigid_mass[0, 0] == pytest.approx(known.rigid_mass[0, 0], rel=1e-12)
    np.testing.assert_allclose(lowest_hz(read, 4), lowest_hz(known, 4), rtol=1e-9)
    assert [item.keyword for item in found.left_out] == ["PARAM", "MAT1", "PSOLID", "SPC1"]


BRICK = bulk(fem.box_mesh("body", (1.0, 1.0, 1.0), (1, 1, 1), kind="hexahedron"), "free")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("PARAM", "CONM2,9,1,,5.\nCONM2,10,2,,5.\nCBAR,7,1,1,2\nPARAM",
         r"CONM2 \(2, first in line 6\); CBAR \(1, first in line 8\); solids are"),
        ("PARAM", "INCLUDE 'more.bdf'\nPARAM", r"INCLUDE \(1, first in line 6\)"),
        ("GRID,1,,", "GRID,1,4,", "line 11: GRID: coordinates in a system of their own"),
        ("GRID,1,,", "GRID*   1\nGRID,1,,", "line 11: GRID: has no third coordinate"),
        ("GRID,2,", "GRID,1,", "line 12: GRID: grid point 1 is defined twice"),
        ("GRID,8,", "GRID,99,", "the grid point 8, which is not defined"),
        ("CHEXA,1,2,", "CHEXA,1,2,,", "line 19 has more fields than a line can have"),
        ("CHEXA,1,2,1,", "CHEXA,1,2,,", "element 1 has 7 grid points where 8 or 20 are needed"),
        ("CHEXA,1,", "CTETRA,1,", "element 1 has 8 grid points where 4 or 10 are needed"),
        ("CHEXA,1,2", "CHEXA,1,x", "line 19: CHEXA: 'x' is not a whole number"),
        ("GRID,1,,0.", "GRID,1,,z0.", "line 11: GRID: 'z0.*' is not a real number"),
        ("BEGIN BULK", "BEGIN BULK\n,1,2", "line 5 goes on with a card that is not there"),
        ("PARAM", "PSOLID,2,1,,,,,PFLUID\nPARAM", r"PSOLID: is of a fluid .*\(PFLUID\), no solid"),
        ("CHEXA", "$CHEXA", "is no Nastran bulk data with solids|line"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_refused_with_its_place(tmp_path, old, new, said):
    path = tmp_path / "brick.bdf"
    assert old in BRICK
    path.write_text(BRICK.replace(old, new, 1))
    with pytest.raises(fem.ModelError, match=said):
        fem.read_structure(path)


def test_grid_points_that_are_held_for_good_are_told(tmp_path):
    path = tmp_path / "brick.bdf"
    line = next(line for line in BRICK.splitlines() if line.startswith("GRID,1,"))
    path.write_text(BRICK.replace(line, f"{line},,123", 1))
    told = [str(item) for item in fem.read_structure(path).left_out]
    assert "GRID with PS (1, first in line 11): supports are given by the scene" in told


@pytest.mark.filterwarnings("ignore::fem.LockingWarning")
def test_the_advice_for_masses_and_for_shells_gives_the_model_that_was_meant(tmp_path):
    """A mass of the deck is given to the model; shells are written as a deck of Abaqus."""
    path = tmp_path / "brick.bdf"
    with_mass = BRICK.replace("ENDDATA", "CONM2,77,7,,0.25\nENDDATA", 1)
    path.write_text(with_mass)
    with pytest.raises(fem.ModelError, match=r"CONM2 \(1, .*; take out masses and"):
        fem.read_structure(path)
    path.write_text("".join(r for r in with_mass.splitlines(True) if not r.startswith("CONM2")))
    mesh = fem.read_structure(path)
    model = fem.StructureModel(
        mesh.with_point_sets({"corner": np.array([6])}),
        dict.fromkeys(mesh.groups, fem.SolidPart(STEEL)),
        point_masses=[fem.PointMass("corner", 0.25)],
    )
    assert fem.mass_properties(fem.assemble(model)).mass == pytest.approx(STEEL.density + 0.25)
    path.write_text(BRICK.replace("ENDDATA", "CQUAD4,9,3,5,6,7,8\nENDDATA", 1))
    with pytest.raises(fem.ModelError, match=r"CQUAD4 \(1, .*; write other elements as '.inp'"):
        fem.read_structure(path)
    cells = mesh.cells | {"quad": mesh.cells["hexahedron"][:, 4:]}
    groups = {**mesh.groups, "lid": {"quad": np.array([0])}}
    types = {"S4": {"quad": np.array([0])}}
    lid = fem.StructureMesh(mesh.points, cells, groups, element_types=types)
    fem.write_mesh(lid, tmp_path / "brick.inp")
    parts = dict.fromkeys(mesh.groups, fem.SolidPart(STEEL)) | {"lid": fem.ShellPart(STEEL, 0.01)}
    read = fem.read_structure(tmp_path / "brick.inp")
    found = fem.mass_properties(fem.assemble(fem.StructureModel(read, parts)))
    assert found.mass == pytest.approx(1.01 * STEEL.density)


@pytest.mark.filterwarnings("ignore::fem.LockingWarning")
@pytest.mark.parametrize("form", ["fixed-small", "fixed-large", "free"])
@pytest.mark.parametrize("family", ["first order", "serendipity"])
def test_meshio_writes_the_same_solids(tmp_path, family, form):
    mesh, path = mixed_block(family, lambda corners: 0.5 * corners), tmp_path / "block.bdf"
    cells = {kind: nodes for kind, nodes in mesh.cells.items() if kind != "pyramid13"}
    ones = [np.ones(len(nodes), dtype=int) for nodes in cells.values()]
    content = meshio.Mesh(mesh.points, list(cells.items()), cell_data={"nastran:ref": ones})
    meshio.nastran.write(path, content, point_format=form, cell_format="fixed-small")
    path.write_text(path.read_text().replace("_", " "))  # it writes CHEXA_ for 20 nodes
    found = fem.read_structure(path)
    assert set(found.cells) == set(cells)
    for kind, nodes in cells.items():
        np.testing.assert_allclose(found.points[found.cells[kind]], mesh.points[nodes], atol=1e-6)
