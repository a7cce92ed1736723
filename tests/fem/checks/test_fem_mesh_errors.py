"""What the modes of a mesh say of its errors, against finer meshes."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from mesh_errors import SHELLS, TABLES, angle, counts, errors, lowest_modes, plate, ring, rows

import cms
import fem
from nldyn.scene.build import TOLD_ERROR, doubts_until_modes, tell_mesh_errors

DOC = Path(__file__).resolve().parents[3] / "docs" / "results" / "elements.md"
COARSE = [
    *(
        (plate, kind, 4, 0.01, "clamped")
        for kind in ("quad", "triangle", "hexahedron20", "tetra10")
    ),
    *((ring, kind, 16, 0.1, "free") for kind in ("quad", "tetra10", "wedge15", "hexahedron")),
]
FINE = [
    *((plate, kind, 12, 0.01, "supported") for kind in ("quad", "triangle", "hexahedron20")),
    *((ring, kind, 32, 0.1, "free") for kind in ("hexahedron20", "tetra10", "wedge15")),
]


@pytest.mark.parametrize(("make", "kind", "n", "thickness", "held"), COARSE)
def test_a_coarse_mesh_is_told(make, kind, n, thickness, held):
    true, said = errors(make, kind, n, thickness, held)
    assert true > 0.05 and said > TOLD_ERROR
    assert said > true / 5.0


@pytest.mark.parametrize(("make", "kind", "n", "thickness", "held"), FINE)
def test_a_fine_mesh_is_not_told(make, kind, n, thickness, held):
    true, said = errors(make, kind, n, thickness, held)
    assert true < 0.02 and said < TOLD_ERROR


FOLDED = [
    *(("quad", 2), ("quad8", 5), ("triangle6", 3)),
    *(("hexahedron20", 6), ("hexahedron20", 8), ("tetra10", 3), ("tetra10", 6)),
]


@pytest.mark.parametrize(("kind", "n"), FOLDED)
def test_strains_that_jump_at_a_fold_are_no_error(kind, n):
    fine, _ = lowest_modes(angle(*(("quad8", 12) if kind in SHELLS else ("hexahedron20", 12))), 4)
    component = angle(kind, n)
    frequencies, modes = lowest_modes(component, 4)
    true, said = frequencies / fine - 1.0, component.mesh_errors(modes)
    assert not (said > TOLD_ERROR)[true < 0.02].any()
    assert (said > TOLD_ERROR).any() or (true < 0.05).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_the_table_of_errors_is_what_is_computed(name):
    text = DOC.read_text(encoding="utf-8")
    table = re.search(rf"<!-- {name} -->\n(.*?)<!-- end of {name} -->", text, re.DOTALL)[1]
    lines = table.strip().splitlines()[2:]
    assert lines == list(rows(TABLES[name]))


@pytest.mark.parametrize("name", TABLES)
def test_no_mesh_of_the_tables_is_told_wrongly(name):
    text = DOC.read_text(encoding="utf-8")
    table = re.search(rf"<!-- {name} -->\n(.*?)<!-- end of {name} -->", text, re.DOTALL)[1]
    found = counts(table.strip().splitlines()[2:])
    assert found["misses"] == found["false alarms"] == 0
    assert found["hits"] > 25


def test_the_estimate_does_not_depend_on_the_scale_of_a_mode():
    component = plate("hexahedron20", 4, 0.01, "clamped")
    shape = np.random.default_rng(1).standard_normal((len(component.free), 1))
    assert component.mesh_errors(-3.0 * shape) == pytest.approx(component.mesh_errors(shape))


def test_a_scene_tells_of_its_mesh_by_mode_and_amount():
    component = plate("hexahedron20", 4, 0.01, "clamped")
    with pytest.warns(fem.MeshWarning, match=r"mode 1 \(.* Hz\) by 2\d %") as caught:
        tell_mesh_errors(component, cms.reduce(component, modes=2))
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fine = plate("hexahedron20", 8, 0.01, "supported")
        tell_mesh_errors(fine, cms.reduce(fine, modes=1))


def bracket():
    mesh = fem.read_mesh(DOC.parents[2] / "tests" / "fem" / "data" / "gmsh_bracket.msh")
    part = fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))
    return fem.StructureModel(mesh, {"bracket": part}, [fem.Support("foot", ("x", "y", "z"))])


@pytest.mark.parametrize("told", [False, True])
def test_curved_cells_are_told_of_where_the_modes_do_not_find_them_good(told):
    """Cut into eighths the cells of the bracket give 0.4, 0.4, 1.0 and 1.0 % less."""
    model = ring("tetra10", 16, 0.1).model if told else bracket()
    with warnings.catch_warnings(record=True) as caught, doubts_until_modes() as doubts:
        warnings.simplefilter("always")
        component = fem.assemble(model)
        assert len(doubts) == 1 and "times too stiff: they are curved" in str(doubts[0][0])
        if tell_mesh_errors(component, cms.reduce(component, modes=4)):
            doubts.clear()
    kinds = {warning.category for warning in caught}
    assert any(issubclass(kind, fem.LockingWarning) for kind in kinds) == told
    assert (fem.MeshWarning in kinds) == told


def test_a_rib_on_a_plate_is_assembled_without_a_word():
    plate = fem.box_mesh("part", (0.2, 0.2), (4, 4), kind="quad", origin=(0.0, -0.1))
    rib = fem.box_mesh("part", (0.2, 0.03), (4, 1), kind="quad")
    rib = rib.with_points(rib.points[:, [0, 2, 1]])
    part = fem.ShellPart(fem.Material(2.1e11, 7800.0, 0.3), 0.002)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fem.assemble(fem.StructureModel(fem.joined([plate, rib]), {"part": part}))
