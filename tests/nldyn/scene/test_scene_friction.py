"""``[[friction]]`` of a scene."""

import math

import pytest
from den_hartog import with_two_stops

from nldyn import solve_orbit
from nldyn.app.describe import describe_slider
from nldyn.base.errors import SceneError
from nldyn.base.resources import example
from nldyn.scene.build import build_system
from nldyn.scene.followed import followed_parameter
from nldyn.scene.read import load_scene
from nldyn.system import DryFriction, Friction
from nldyn.system.chart import value_of

SCENE = """
[matrices]
mass = [[1.0, 0.0], [0.0, 1.0]]
stiffness = [[1.0, 0.0], [0.0, 4.0]]
[matrices.interfaces]
across = [1.0, 0.0]
along = [0.0, 1.0]
[[stops]]
at = "across"
stiffness = 50.0
[[stops]]
at = "across"
law = "rigid"
restitution = 0.5
gap = 2.0
[[friction]]
at = "across"
coefficient = 0.1
normal_force = 3.0
{other}
[[excitation]]
at = "across"
kind = "harmonic"
amplitude = 1.0
[continuation]
frequency_hz = 0.2
parameter = "friction.1.coefficient"
range = [0.1, 0.4]
"""
AT_STOP = """
[[friction]]
at = "along"
coefficient = 0.3
at_rest = 0.4
fading_speed = 0.1
base_speed = 0.2
stop = 0
"""


def scene_with(tmp_path, other):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(other=other))
    return load_scene(path)


def test_tables_become_friction_of_stops_and_dampers_and_their_coefficients_may_change(tmp_path):
    scene = scene_with(tmp_path, AT_STOP)
    system = build_system(scene)
    assert system.stops[0].friction == Friction(0.3, 0.4, 0.1, 0.2)
    assert system.stops[0].tangent == "along"
    assert system.dampers == (DryFriction("across", 3.0, 0.1),)
    # that of the stop comes first among the sliders, though it is the second table
    assert value_of(system, 0.2, followed_parameter(scene)) == 0.3


def test_a_spring_before_friction_may_change(tmp_path):
    spring = AT_STOP.replace("at_rest = 0.4\nfading_speed = 0.1", "tangential_stiffness = 7.0")
    text = SCENE.replace("friction.1.coefficient", "friction.1.tangential_stiffness")
    path = tmp_path / "scene.toml"
    path.write_text(text.format(other=spring))
    scene = load_scene(path)
    system = build_system(scene)
    assert system.stops[0].tangential_stiffness == 7.0
    assert value_of(system, 0.2, followed_parameter(scene)) == 7.0
    assert "behind 7 N/m, pressed on by stop 0" in describe_slider(system.sliders[0])
    path.write_text(text.format(other=AT_STOP))
    with pytest.raises(SceneError, match="no spring is before that"):
        followed_parameter(load_scene(path))


def test_a_rigid_stop_has_friction_of_one_coefficient_without_a_spring(tmp_path):
    plain = AT_STOP.replace("stop = 0", "stop = 1").replace("at_rest = 0.4\nfading_speed = 0.1", "")
    stop = build_system(scene_with(tmp_path, plain)).stops[1]
    assert stop.friction == Friction(0.3, base_speed=0.2)
    assert (stop.impulsive, stop.tangent) == (True, "along")
    with pytest.raises(SceneError, match="tangential_stiffness is not for stop 1, which is rigid"):
        build_system(scene_with(tmp_path, plain + "tangential_stiffness = 7.0\n"))


def test_without_a_fading_speed_friction_drops_at_once(tmp_path):
    system = build_system(scene_with(tmp_path, AT_STOP.replace("fading_speed = 0.1\n", "")))
    assert system.stops[0].friction == Friction(0.3, at_rest=0.4, base_speed=0.2)
    told = "coefficient 0.3, at rest 0.4, from which it drops at once, base at 0.2 m/s"
    assert told in describe_slider(system.sliders[0])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"base_speed = 0.2": "tangential_stiffness = 7.0"}, "before which 'at_rest'"),
        ({"base_speed = 0.2": "tangential_stiffness = 0.0"}, "tangential_stiffness"),
        ({"stop = 0": ""}, "needs one of 'normal_force' and 'stop'"),
        ({"stop = 0": "stop = 0\nnormal_force = 1.0"}, "has both 'normal_force' and 'stop'"),
        ({"stop = 0": "stop = 1"}, "friction of a rigid stop has one coefficient"),
        ({"stop = 0": "stop = 2"}, "no stop has that number; there are 2"),
        ({"at_rest = 0.4": ""}, "needs the 'at_rest' that fades"),
        ({"at_rest = 0.4": "at_rest = 0.2"}, "'at_rest' of at least"),
        ({"0.3": "-0.3"}, "coefficient"),
        ({'"along"': '"alongside"'}, "alongside"),
    ],
)
def test_bad_friction_is_refused_with_its_place(tmp_path, change, told):
    text = AT_STOP
    for old, new in change.items():
        text = text.replace(old, new)
    with pytest.raises(SceneError, match="friction") as error:
        build_system(scene_with(tmp_path, text))
    assert told in str(error.value)


OVER_A_PLANE = """
[[friction]]
at = "along"
coefficient = 0.3
stop = {stop}
tangential_stiffness = 20.0
second_tangent = "{second}"
"""


@pytest.mark.parametrize("table", ["along = [-0.3, 0.0]", "along = [1e-3, 0.0]"])
@pytest.mark.parametrize("law", ["", "tangential_stiffness = 7.0"])
def test_a_row_along_the_normal_is_no_tangent(tmp_path, table, law):
    path = tmp_path / "scene.toml"
    rough = AT_STOP.replace("at_rest = 0.4\nfading_speed = 0.1", law)
    path.write_text(SCENE.format(other=rough).replace("along = [0.0, 1.0]", table))
    told = "friction at 'along' acts along the normal of the stop at 'across'"
    with pytest.raises(SceneError, match=told):
        build_system(load_scene(path))


def test_what_it_slides_on_moves_along_both_tangents_of_a_plane(tmp_path):
    belt = over_a_plane() + "base_speed = [0.1, -0.2]\n"
    slider = build_system(with_third(tmp_path, belt)).sliders[0]
    assert slider.friction.base_speeds == (0.1, -0.2)
    assert "base at 0.1 and -0.2 m/s" in describe_slider(slider)
    with pytest.raises(SceneError, match="'base_speed' of two, which needs a 'second_tangent'"):
        with_third(tmp_path, AT_STOP.replace("0.2", "[0.1, 0.2]"))


def over_a_plane(stop=0, second="aside"):
    return OVER_A_PLANE.format(stop=stop, second=second)


def with_third(tmp_path, other):
    path = tmp_path / "scene.toml"
    three = "[[1.0, 0.0, 0.0], [0.0, {}, 0.0], [0.0, 0.0, 1.0]]"
    text = SCENE.replace("[[1.0, 0.0], [0.0, 1.0]]", three.replace("{}", "1.0"))
    text = text.replace("[[1.0, 0.0], [0.0, 4.0]]", three.replace("{}", "4.0"))
    text = text.replace("across = [1.0, 0.0]", "across = [1.0, 0.0, 0.0]\naside = [0.0, 0.0, 1.0]")
    text = text.replace("along = [0.0, 1.0]", "along = [0.0, 1.0, 0.0]")
    path.write_text(text.format(other=other))
    return load_scene(path)


def test_a_second_tangent_makes_friction_over_a_plane(tmp_path):
    system = build_system(with_third(tmp_path, over_a_plane()))
    slider = system.sliders[0]
    assert (slider.across, slider.tangential_stiffness) == (("aside", None), 20.0)
    assert describe_slider(slider) == (
        "friction at 'along', over the plane with 'aside': coefficient 0.3, behind 20 N/m, "
        "pressed on by stop 0"
    )
    assert system.output("along") == 2 + 2 + 3 + system.interfaces.index("along")
    text = (tmp_path / "scene.toml").read_text().replace("tangential_stiffness = 20.0", "")
    text = text.replace('law = "rigid"\nrestitution = 0.5', "stiffness = 9.0")
    (tmp_path / "hard.toml").write_text(text)
    system = build_system(load_scene(tmp_path / "hard.toml"))
    assert (system.sliders[0].across, system.sprung) == (("aside", None), ())
    assert system.output("along") == 2 + 2 + 1 + system.interfaces.index("along")


def test_what_slides_over_a_plane_on_a_rigid_stop_needs_no_spring(tmp_path):
    hard = over_a_plane(stop=1).replace("tangential_stiffness = 20.0", "")
    system = build_system(with_third(tmp_path, hard))
    assert (system.stops[1].impulsive, system.stops[1].across) == (True, ("aside", None))
    assert describe_slider(system.sliders[0]) == (
        "friction at 'along', over the plane with 'aside': coefficient 0.3, pressed on by stop 1"
    )


@pytest.mark.parametrize(
    ("other", "told"),
    [
        (over_a_plane(second="nowhere"), r"friction\[1\]\.second_tangent.*nowhere"),
        (over_a_plane(second="along"), "another interface as 'second_tangent'"),
        (over_a_plane(stop=1), "tangential_stiffness is not for stop 1, which is rigid"),
        (
            over_a_plane().replace("tangential_stiffness = 20.0", ""),
            "needs a tangential_stiffness beside rigid stops",
        ),
        (
            over_a_plane().replace(
                "tangential_stiffness = 20.0", "at_rest = 0.4\nfading_speed = 1.0"
            ),
            "'second_tangent', over which 'at_rest' is no other one",
        ),
    ],
)
def test_bad_second_tangents_are_refused(tmp_path, other, told):
    with pytest.raises(SceneError, match=told):
        build_system(with_third(tmp_path, other))


def test_the_example_of_a_block_that_stops_moves_as_den_hartog_says():
    system = build_system(load_scene(example("block_that_stops.toml")))
    for ratio in (0.5, 1.1):
        known, orbit = with_two_stops(ratio, 0.8), solve_orbit(system, ratio / math.tau)
        assert orbit.max_abs_displacement == pytest.approx(known.top, rel=1e-9)
        assert orbit.friction[0].stuck == pytest.approx(known.rests, abs=1e-8)
