"""Scenes say how a mesh is read: its unit, what is ignored, whether pieces are one, places."""

import numpy as np
import pytest
from click.testing import CliRunner
from universal_files import write_unv

import fem
from nldyn.app.cli import main
from nldyn.base.errors import SceneError
from nldyn.scene.component import build_component
from nldyn.scene.read import parse_scene

SCENE = """
[mesh]
file = "{file}"
model = "structure"
{mesh}

[parts.bar]
kind = "solid"
youngs_modulus = 2.1e11
density = 7800.0
poissons_ratio = 0.3

[places.root]
box = [[0.0, -1.0, -1.0], [0.0, 1.0, 1.0]]

[places.tip]
at = [1.0, 0.05, 0.05]

[[supports]]
at = "root"
fixed = ["x", "y", "z"]

[interfaces.tip]
at = "tip"
direction = "y"

[reduction]
modes = 2
"""


def bar(x: float, length: float, count: int) -> fem.StructureMesh:
    return fem.box_mesh("bar", (length, 0.05, 0.05), (count, 1, 1), origin=(x, 0.0, 0.0))


def touching() -> fem.StructureMesh:
    """Two bars one after the other whose nodes are not merged."""
    first, second = bar(0.0, 0.5, 4), bar(0.5, 0.5, 4)
    kind, count = "hexahedron20", len(first.points)
    return fem.StructureMesh(
        np.vstack([first.points, second.points]),
        {kind: np.vstack([first.cells[kind], second.cells[kind] + count])},
        {"bar": {kind: np.arange(8)}},
    )


def component(tmp_path, mesh, keys=""):
    fem.write_mesh(mesh, tmp_path / "mesh.vtu")
    text = SCENE.format(file="mesh.vtu", mesh=keys)
    return build_component(parse_scene(text, tmp_path / "scene.toml"))


def test_pieces_that_touch_are_refused_or_merged_or_separate(tmp_path):
    with pytest.raises(SceneError, match="2 pieces of the mesh touch but share no node: 16 nodes"):
        component(tmp_path, touching())
    whole = component(tmp_path, bar(0.0, 1.0, 8))
    merged = component(tmp_path, touching(), "merge = true")
    assert merged.mass.shape == whole.mass.shape
    assert np.trace(merged.mass.toarray()) == pytest.approx(np.trace(whole.mass.toarray()), 1e-12)
    apart = component(tmp_path, touching(), "separate = true")
    assert apart.mass.shape[0] == whole.mass.shape[0] + 3 * 8


def test_a_mesh_in_millimetres_is_the_same_component(tmp_path):
    metres = component(tmp_path, bar(0.0, 1.0, 8))
    mesh = bar(0.0, 1.0, 8)
    millimetres = component(tmp_path, mesh.with_points(1000.0 * mesh.points), 'unit = "mm"')
    for name in ("stiffness", "mass"):
        known, found = getattr(metres, name), getattr(millimetres, name)
        assert abs(found - known).max() <= 1e-12 * abs(known).max()


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_a_unit_that_the_file_states_must_be_confirmed_in_the_scene(tmp_path, unit):
    """The mesh of a universal file that states millimetres; the scene may say that it is wrong."""
    mesh, size = bar(0.0, 1.0, 8), 1000.0 if unit == "mm" else 1.0
    write_unv(mesh.with_points(size * mesh.points), tmp_path / "mesh.unv", per_metre=1000.0)
    text = SCENE.format(file="mesh.unv", mesh="")
    with pytest.raises(SceneError, match=r"mesh\.file states the unit 'mm'.*which 'unit' to take"):
        build_component(parse_scene(text, tmp_path / "scene.toml"))
    text = SCENE.format(file="mesh.unv", mesh=f'unit = "{unit}"')
    found = build_component(parse_scene(text, tmp_path / "scene.toml"))
    assert fem.mass_properties(found).mass == pytest.approx(7800.0 * 0.05**2, rel=1e-9)


def test_what_is_ignored_is_not_there_and_is_told(tmp_path):
    mesh = bar(0.0, 1.0, 8)
    corners = mesh.cells["hexahedron20"][0, :4][None]
    extra = fem.StructureMesh(
        mesh.points,
        {**mesh.cells, "quad": corners},
        {**mesh.groups, "paint": {"quad": [0]}},
    )
    found = component(tmp_path, extra, 'ignore = ["paint"]')
    assert set(found.model.mesh.cells) == {"hexahedron20"}
    assert '1 quad left out, as "paint" is to be ignored' in fem.summary(found)
    with pytest.raises(SceneError, match="there is no cell of 'pain' to ignore"):
        component(tmp_path, extra, 'ignore = ["pain"]')


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("at = [1.0, 0.05, 0.05]", "at = [0.9, 0.05, 0.05]", "no node is at"),
        ("at = [1.0, 0.05, 0.05]", "", "needs one of 'at' and 'box'"),
        ('model = "structure"', 'model = "structure"\nmerge = true\nseparate = true', "keep one"),
        ('model = "structure"', 'model = "structure"\npinned = ["ba"]', "'ba' of 'pinned' is no"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(tmp_path, old, new, said):
    fem.write_mesh(bar(0.0, 1.0, 8), tmp_path / "mesh.vtu")
    text = SCENE.format(file="mesh.vtu", mesh="").replace(old, new)
    with pytest.raises(SceneError, match=said) as caught:
        build_component(parse_scene(text, tmp_path / "scene.toml"))
    assert "\n" not in str(caught.value)


def test_check_prints_what_was_read(tmp_path):
    fem.write_mesh(bar(0.0, 1.0, 8), tmp_path / "mesh.vtu")
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(file="mesh.vtu", mesh=""))
    said = CliRunner().invoke(main, ["check", str(scene)]).output
    assert "104 nodes; 8 hexahedron20" in said
    assert "extents: (0, 0, 0) to (1, 0.05, 0.05) m" in said
    assert "mass: 19.5 kg, centre at (0.5, 0.025, 0.025) m" in said
    assert "'bar' (8 hexahedron20, a part)" in said
