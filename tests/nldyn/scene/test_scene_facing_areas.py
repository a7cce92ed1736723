"""Areas of contact between two surfaces of meshes, in scenes."""

import numpy as np
import pytest

import fem
from nldyn import SceneError, solve_orbit
from nldyn.scene import build_reduced, build_system, load_scene
from nldyn.scene.contact import areas_found

LENGTH, HEIGHT = 0.3, 2e-3

BEAM = """
[components.{name}.mesh]
file = "{name}.vtu"

[components.{name}.parts.{name}]
youngs_modulus = 2.1e11
density = 7800.0
width = 0.02
height = 0.002

[[components.{name}.supports]]
at = "root"
fixed = ["x", "y", "rotation"]

[components.{name}.interfaces.tip]
at = "tip"
direction = "y"

[components.{name}.reduction]
modes = 3
"""

AREA = """
[[contact_areas]]
at = "low.low"
{against}
direction = "y"
stiffness = {stiffness}
points = 2
surface = 0.001
{more}
attachment_modes = 2
"""

LOAD = """
[[excitation]]
at = "{name}.tip"
kind = "harmonic"
amplitude = 0.3
phase_deg = {phase}
"""

REST = """
[damping]
modal_ratio = 0.05

[continuation]
range_hz = [10.0, 40.0]
"""


def write_beam(folder, name, height, lines, length=LENGTH):
    mesh = fem.frame_mesh(
        {"root": (0, height), "tip": (length, height)}, [(name, "root", "tip", lines)]
    )
    fem.write_mesh(mesh, folder / f"{name}.vtu")


def scene_of(folder, text):
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def pair_of(folder, lines=(6, 6), length=LENGTH, **changes):
    """Two cantilevers 0.1 mm apart, pressed against each other by opposite forces."""
    write_beam(folder, "low", 0.0, lines[0])
    write_beam(folder, "high", HEIGHT + 1e-4, lines[1], length)
    area = {"against": 'against = "high.high"', "stiffness": 1e5, "more": "surface_against = 0.001"}
    text = BEAM.format(name="low") + BEAM.format(name="high") + AREA.format(**(area | changes))
    text += LOAD.format(name="low", phase=0) + LOAD.format(name="high", phase=180)
    return scene_of(folder, text + REST)


def test_two_beams_pressed_alike_move_as_one_against_the_rigid_mirror_of_twice_the_stiffness(
    tmp_path,
):
    """The penetration of both is twice that of one, so that its pressure is that of 2 k."""
    pair = build_system(pair_of(tmp_path))
    assert np.allclose([stop.gap for stop in pair.stops], 1e-4, atol=1e-15)
    mirror = AREA.format(against="gap = 5e-5", stiffness=2e5, more="")
    one = BEAM.format(name="low") + mirror + LOAD.format(name="low", phase=0) + REST
    alone = build_system(scene_of(tmp_path, one))
    assert len(alone.stops) == len(pair.stops) == 12
    both, single = (solve_orbit(system, 25.0) for system in (pair, alone))
    assert both.areas[0].touched > 0.3
    assert np.isclose(both.max_abs_displacement, single.max_abs_displacement, rtol=1e-7)
    expected = single.areas[0].pressure
    assert np.allclose(both.areas[0].pressure, expected, rtol=0.0, atol=1e-6 * expected.max())


def test_beams_whose_lines_end_elsewhere_touch_where_they_face_each_other(tmp_path, caplog):
    """The other beam is of 5 lines and 0.2 m long: a third of the points has nothing opposite."""
    scene = pair_of(tmp_path, (6, 5), 0.2)
    with caplog.at_level("INFO", logger="nldyn"):
        reduced = build_reduced(scene)
    assert "8 points that stand for 0.2 m (4 more have nothing opposite" in caplog.text
    assert "2 attachment modes on the other side" in caplog.text
    assert list(reduced.areas) == ["low.low", "high.low against"]
    (found,) = areas_found(scene)
    assert found.places[:, 0].max() < 0.2
    assert build_system(scene).stops[3].against == "high.low against 4"


def test_one_file_serves_twice_where_a_component_is_moved(tmp_path, caplog):
    """As two files whose coordinates differ by that."""
    away = pair_of(tmp_path).text.replace(
        'file = "high.vtu"', f'file = "high.vtu"\noffset = [0.0, {HEIGHT + 1e-4}, 0.0]'
    )
    write_beam(tmp_path, "high", 0.0, 6)
    with caplog.at_level("INFO", logger="nldyn"):
        reduced = build_reduced(scene_of(tmp_path, away))
    assert "in the mesh the surfaces are up to 0.0001 m apart" in caplog.text
    moved = build_system(scene_of(tmp_path, away))
    given = build_system(pair_of(tmp_path))
    assert np.allclose([s.gap for s in moved.stops], [s.gap for s in given.stops], atol=1e-16)
    assert np.allclose(moved.natural_frequencies, given.natural_frequencies, rtol=1e-12)
    assert reduced.interfaces == build_reduced(pair_of(tmp_path)).interfaces


def test_a_structure_alone_is_not_moved(tmp_path):
    write_beam(tmp_path, "low", 0.0, 6)
    text = (
        BEAM.format(name="low")
        .replace("components.low.", "")
        .replace('file = "low.vtu"', 'file = "low.vtu"\noffset = [0.0, 1.0, 0.0]')
    )
    with pytest.raises(SceneError, match=r"mesh\.offset is for a component of several"):
        scene_of(tmp_path, text + LOAD.format(name="low", phase=0).replace("low.tip", "tip") + REST)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"against": 'against = "top.high"'}, "top"),
        ({"against": 'against = "high"'}, "a component and a set of its mesh"),
        ({"against": 'against = "high.lid"'}, "lid"),
        ({"more": "surface_against = 0.01"}, "lies behind the points"),
    ],
)
def test_what_does_not_face_the_area_is_refused(tmp_path, changes, said):
    with pytest.raises(SceneError, match=said):
        build_system(pair_of(tmp_path, **changes))
