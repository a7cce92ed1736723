"""Areas of contact in scenes."""

import numpy as np
import pytest

from nldyn import Parameter, SceneError
from nldyn.base.resources import example
from nldyn.report.stop_spheres import not_drawn
from nldyn.scene import build_reduced, build_system, load_scene
from nldyn.scene.contact import areas_found
from nldyn.scene.convergence import convergence_study_of
from nldyn.scene.followed import followed_parameter
from nldyn.scene.load_case import load_case_of
from nldyn.system.chart import value_of

LISTED = """
[modal]
frequencies_hz = [1.0, 3.1, 5.0]
participation.tip = [1.0, 0.3, 0.1]
participation.left = [1.0, -0.5, 0.2]
participation.right = [1.0, 0.5, -0.1]
participation.slide = [0.3, 0.5, 0.9]

[[contact_areas]]
at = ["left", "right"]
name = "pads"
stiffness = 40.0
weights = [0.5, 0.25]
gap = [0.1, 0.2]

[[excitation]]
at = "tip"
kind = "harmonic"
amplitude = 1.0

[continuation]
range_hz = [0.5, 2.0]
"""


def scene_of(tmp_path, text):
    file = tmp_path / "scene.toml"
    file.write_text(text)
    return load_scene(file)


def landing(tmp_path, *changes):
    """The example with twice its points on a stiffer edge, and lines of its text changed."""
    path = example("landing_strip.toml")
    text = path.read_text().replace("\npoints = 1", "\npoints = 2")
    text = text.replace("stiffness = 1e4", "stiffness = 2e5")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    mesh = (path.parent / "../../meshes/strip.msh").resolve()
    file = tmp_path / "scene.toml"
    file.write_text(text.replace("../../meshes/strip.msh", str(mesh)))
    return load_scene(file, [mesh.parent])


def test_points_of_an_edge_have_the_stiffness_and_the_gap_of_the_profile():
    system = build_system(load_scene(example("landing_strip.toml")))
    stops = system.area_stops("support")
    assert len(stops) == 20 and system.areas == {"support": tuple(range(20))}
    assert np.isclose(sum(stop.stiffness for stop in stops), 1e4 * 0.3)
    (found,) = areas_found(load_scene(example("landing_strip.toml")))
    x = found.places[:, 0]
    assert np.allclose([s.gap for s in stops], 1e-4 + 20.0 - np.sqrt(20.0**2 - x**2), atol=1e-15)


def test_the_reduction_gives_an_area_few_attachment_modes_and_tells_the_error(tmp_path):
    scene = landing(tmp_path)
    loose = build_reduced(scene)
    tight = build_reduced(landing(tmp_path, ("points = 2", "points = 2\nstatic_error = 1e-5")))
    asked = build_reduced(landing(tmp_path, ("points = 2", "points = 2\nattachment_modes = 2")))
    assert asked.areas["support"].modes == 2
    assert asked.areas["support"].static_error > loose.areas["support"].static_error
    assert loose.areas["support"].static_error <= 1e-2
    assert tight.areas["support"].static_error <= 1e-5
    assert asked.size < loose.size < tight.size < 44


@pytest.mark.parametrize("key", ["gap", "stiffness"])
def test_numbers_of_an_area_are_keys_that_may_be_followed(tmp_path, key):
    text = LISTED.replace(
        "range_hz = [0.5, 2.0]",
        f'parameter = "contact_areas.0.{key}"\nrange = [0.01, 0.3]\nfrequency_hz = 1.2',
    )
    scene = scene_of(tmp_path, text)
    assert followed_parameter(scene) == Parameter(f"area_{key}", 0)
    assert not_drawn(scene) == ["contact area 'pads', which is many points"]


def test_a_list_of_interfaces_shares_a_law(tmp_path):
    system = build_system(scene_of(tmp_path, LISTED))
    assert [stop.stiffness for stop in system.stops] == [20.0, 10.0]
    assert [stop.gap for stop in system.stops] == [0.1, 0.2]
    rough = LISTED.replace("gap = [", 'friction = 0.2\nalong = ["slide", "tip"]\ngap = [')
    sliders = build_system(scene_of(tmp_path, rough)).sliders
    assert [(slider.at, slider.stop) for slider in sliders] == [("slide", 0), ("tip", 1)]
    plane = 'tangential_stiffness = 8.0\nsecond_along = ["tip", "slide"]\ngap = ['
    sliders = build_system(scene_of(tmp_path, rough.replace("gap = [", plane))).sliders
    assert [slider.across for slider in sliders] == [("tip", None), ("slide", None)]
    assert [slider.tangential_stiffness for slider in sliders] == [4.0, 2.0]


def test_friction_beside_an_area_with_friction_is_followed_by_its_own_number(tmp_path):
    rough = LISTED.replace(
        "participation.slide", "participation.side = [0.9, 0.1, 0.4]\nparticipation.slide"
    )
    rough = rough.replace("gap = [", 'friction = 0.2\nalong = ["slide", "tip"]\ngap = [')
    rough += 'parameter = "friction.0.coefficient"\nrange = [0.1, 0.7]\nfrequency_hz = 1.2\n'
    rough += '[[friction]]\nat = "side"\ncoefficient = 0.5\nnormal_force = 1.0\n'
    scene = scene_of(tmp_path, rough.replace("range_hz = [0.5, 2.0]\n", ""))
    assert value_of(build_system(scene), 1.2, followed_parameter(scene)) == 0.5


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("stiffness = 40.0", "stiffness = -40.0", "greater than 0"),
        ("weights = [0.5, 0.25]", "weights = [0.5]", "one number or one for each of 2 points"),
        ('at = ["left", "right"]', 'at = ["left", "left"]', "each interface once"),
        ('at = ["left", "right"]', "at = []", "there are no points"),
        ('at = ["left", "right"]', 'at = ["left", "up"]', "up"),
        ('at = ["left", "right"]', 'at = "left"', "is not a key of an area of a mesh"),
        ("weights = [0.5, 0.25]", "friction = 0.2", "needs both 'friction' and 'along'"),
        ("weights = [0.5, 0.25]", "radius = 2.0", "is not a key of a list of interfaces"),
        ("weights = [0.5, 0.25]", "points = 3", "points is not a key of a list"),
        ("weights = [0.5, 0.25]", "surface = 0.1", "surface is not a key of a list"),
        ("weights = [0.5, 0.25]", "closes = true", "must be 1 or -1"),
        ("weights = [0.5, 0.25]", "pulls = false", "needs a 'dashpot' above 0"),
        ("weights = [0.5, 0.25]", "tangential_stiffness = 1.0", "needs 'friction' and 'along'"),
        (
            "weights = [0.5, 0.25]",
            'second_along = ["slide", "slide"]',
            "'second_along', which needs 'friction' and 'along'",
        ),
    ],
)
def test_what_makes_no_area_of_interfaces_is_refused(tmp_path, old, new, said):
    with pytest.raises(SceneError, match=said):
        build_system(scene_of(tmp_path, LISTED.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('direction = "-y" ', "", "direction is missing: an area of a mesh needs it"),
        ('direction = "-y" ', 'direction = "z" ', "nothing of it moves along"),
        ('at = "strip"', 'at = "stripe"', "stripe"),
        ('at = "strip"', 'at = "tip"', "no outer face, edge or beam whose nodes are all in it"),
        ("gap = 1e-4", "gap = [1e-4, 2e-4]", "gap has 2 values, but the area has 40 points"),
        ("radius = 20.0", "radius = 0.1", "beyond the radius"),
        ("points = 2", "points = 2\ncloses = -1", "is not a key of an area of a mesh"),
        ("modes = 4", "tolerance = 0.01", "does not go with reduction.tolerance"),
        ("points = 2", 'points = 2\nagainst = "root"', "nothing of that lies opposite"),
        ("radius = 20.0", "", "needs a 'slope' or a 'radius'"),
        ("points = 2", "points = 2\nsurface_against = 0.01", "which needs 'against'"),
        ("points = 2", "attachment_modes = 3\nstatic_error = 0.1", "keep one"),
        (
            "points = 2",
            'friction = 0.1\nalong = "x"\ntangential_stiffness = 1e3\nsecond_along = [0, 1, 0]',
            "'second_along' must be perpendicular to 'direction'",
        ),
    ],
)
def test_what_makes_no_area_of_a_mesh_is_refused(tmp_path, old, new, said):
    with pytest.raises(SceneError, match=said):
        build_system(landing(tmp_path, (old, new)))


def test_a_convergence_study_refuses_to_refine_what_the_points_go_with(tmp_path):
    from nldyn.scene.component import build_component

    scene = landing(tmp_path)
    assert len(load_case_of(scene).stops) == 40
    with pytest.raises(SceneError, match="go with the mesh"):
        build_component(scene, refinement=2)
    with pytest.raises(SceneError, match="go with the mesh"):
        convergence_study_of(scene, meshes=[scene.mesh.file])


def test_what_the_points_stand_for_is_told_with_its_unit(caplog):
    """Beams of 0.3 m: a length."""
    with caplog.at_level("INFO", logger="nldyn"):
        build_reduced(load_scene(example("landing_strip.toml")))
    assert "contact area 'support': 20 points that stand for 0.3 m;" in caplog.text


STOP = """
[[stops]]
at = "tip"
law = "linear"
stiffness = 1.0
"""
RUBS = """
[[friction]]
at = "{}"
coefficient = 0.1
tangential_stiffness = 1.0
"""
RING = """
[[round_clearances]]
plane = ["tip", "again"]
clearance = 1e-3
stiffness = 1.0
"""
AREA = """
[[contact_areas]]
name = "of interfaces"
at = ["side", "tip"]
along = ["tip", "again"]
stiffness = 1.0
friction = 0.1
"""


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (
            RUBS.format("side") + 'normal_force = 1.0\nsecond_tangent = "beside"',
            "second_tangent 'beside' lies along 'x' as 'side', and must be perpendicular",
        ),
        (STOP + RUBS.format("again") + "stop = 0", "at 'again' lies along 'y' as 'tip'"),
        (
            STOP + RUBS.format("side") + 'stop = 0\nsecond_tangent = "again"',
            "second_tangent 'again' lies along 'y' as 'tip'",
        ),
        (RING, "plane 'again' lies along 'y' as 'tip'"),
        (AREA, "along 'again' lies along 'y' as 'tip'"),
    ],
)
def test_tangents_along_the_normal_or_each_other_are_refused(tmp_path, more, told):
    place = '[interfaces.tip]\nat = "tip"\n'
    named = (("side", "x"), ("beside", "x"), ("again", "y"))
    others = "".join(
        place.replace(".tip", f".{name}") + f'direction = "{axis}"\n' for name, axis in named
    )
    with pytest.raises(SceneError, match=told):
        landing(tmp_path, (place, more + "\n" + others + place))
