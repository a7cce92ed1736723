"""``[[round_clearances]]`` of a scene."""

import numpy as np
import pytest

from nldyn import Parameter, RoundStop, continue_branch, solve_orbit
from nldyn.app.describe import describe_stop
from nldyn.base.errors import SceneError
from nldyn.base.resources import example
from nldyn.report.stop_spheres import not_drawn
from nldyn.scene.backbone import undamped
from nldyn.scene.build import build_system
from nldyn.scene.followed import followed_parameter
from nldyn.scene.read import load_scene
from tests.rubbing import Ring, Rotor

SCENE = example("rotor_in_a_ring.toml").read_text()
RING = RoundStop(("x", "y"), 2e6, 6e-4, 1.0, friction=0.08, surface_speed=5.0)


def scene_of(tmp_path, *changes):
    text = SCENE
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return load_scene(path)


def test_a_table_becomes_a_round_stop_behind_the_others(tmp_path):
    other = '\n[[stops]]\nat = "x"\nstiffness = 1e9\ngap = 1.0\n[observe]'
    scene = scene_of(tmp_path, ("\n[observe]", other))
    system = build_system(scene)
    assert system.stops[1] == RING
    assert "ring around 'x', 'y'" in describe_stop(system.stops[1])
    assert not_drawn(scene)[-1] == "round clearance at 'x' and 'y', which is all around"
    assert build_system(undamped(scene)).stops[1].friction == 0.0


def test_all_keys_are_taken(tmp_path):
    more = (
        'law = "hertz"\nexponent = 2.0\neccentricity = [1e-5, -2e-5]\ninside = false\n'
        "dissipation = 0.1\nagainst = ['sx', 'sy']"
    )
    scene = scene_of(
        tmp_path,
        ('law = "linear"', more),
        ("[[10.0, 0.0], [0.0, 10.0]]", "[[10.0, 0, 0, 0], [0, 10.0, 0, 0], [0, 0, 5.0, 0], "
         "[0, 0, 0, 5.0]]"),
        ("[[4e5, 0.0], [0.0, 4e5]]", "[[4e5, 0, 0, 0], [0, 4e5, 0, 0], [0, 0, 4e6, 0], "
         "[0, 0, 0, 4e6]]"),
        ("damping = [[300.0, 0.0], [0.0, 300.0]]\n", ""),
        ("interfaces.x = [1.0, 0.0]", "interfaces.x = [1.0, 0, 0, 0]"),
        ("interfaces.y = [0.0, 1.0]", "interfaces.y = [0, 1.0, 0, 0]\n"
         "interfaces.sx = [0, 0, 1.0, 0]\ninterfaces.sy = [0, 0, 0, 1.0]"),
    )  # fmt: skip
    assert build_system(scene).stops == (
        RoundStop(
            ("x", "y"), 2e6, 6e-4, 2.0, (1e-5, -2e-5), False, ("sx", "sy"), 0.1, friction=0.08,
            surface_speed=5.0,
        ),
    )  # fmt: skip


RIGID = ('law = "linear"', 'law = "rigid"\nrestitution = 0.6')


def test_one_may_be_rigid(tmp_path):
    scene = scene_of(tmp_path, ("stiffness = 2e6\n", ""), RIGID)
    ring = build_system(scene).stops[0]
    assert ring == RoundStop.rigid(("x", "y"), 0.6, 6e-4, friction=0.08, surface_speed=5.0)
    assert describe_stop(ring).startswith("rigid ring around 'x', 'y': restitution 0.6, clearance")
    followed = ("range_hz = [24.0, 42.0]", 'frequency_hz = 30.0\nrange = [0.1, 0.9]\n'
                'parameter = "round_clearances.0.restitution"')  # fmt: skip
    scene = scene_of(tmp_path, ("stiffness = 2e6\n", ""), RIGID, followed)
    assert followed_parameter(scene) == Parameter("restitution", 0)


@pytest.mark.parametrize(
    ("key", "parameter"),
    [
        ("clearance", Parameter("clearance", 0)),
        ("surface_speed", Parameter("surface_speed", 0)),
        ("friction", Parameter("rubbing_friction", 0)),
        ("eccentricity.1", Parameter("second_eccentricity", 0)),
        ("stiffness", Parameter("stiffness", 0)),
    ],
)
def test_its_numbers_may_change(tmp_path, key, parameter):
    changed = f'frequency_hz = 30.0\nparameter = "round_clearances.0.{key}"\nrange = [1e-4, 1e-2]'
    scene = scene_of(tmp_path, ("range_hz = [24.0, 42.0]", changed))
    assert followed_parameter(scene) == parameter


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('plane = ["x", "y"]', 'plane = ["x", "z"]'), "round_clearances.*'z'"),
        (('plane = ["x", "y"]', 'plane = ["x", "x"]'), "different"),
        (('plane = ["x", "y"]', 'plane = ["x"]'), "plane"),
        (("clearance = 6e-4", "clearance = 0.0"), "clearance"),
        (("surface_speed = 5.0", ""), r"0\] has friction, which needs the surface_speed of what"),
        (("friction = 0.08", ""), r"0\] has a surface_speed, which needs a friction, or 0"),
        (('law = "linear"', 'law = "linear"\nexponent = 2.0'), "exponent"),
        (RIGID, "stiffness.*law 'rigid'"),
        (('law = "linear"', 'law = "rigid"'), "stiffness.*law 'rigid'"),
        (('law = "linear"', "restitution = 0.5"), "which is for law 'rigid'"),
        (("stiffness = 2e6", ""), "needs a 'stiffness', or the law 'rigid'"),
        (('law = "linear"', 'law = "linear"\ngap = 2.0'), "gap"),
    ],
)
def test_faults_are_told(tmp_path, change, said):
    with pytest.raises(SceneError, match=said):
        build_system(scene_of(tmp_path, change))


def test_a_tube_wears_in_its_support_as_an_independent_integration_says():
    system = build_system(load_scene(example("tube_with_friction.toml")))
    orbit = continue_branch(solve_orbit(system, 17.0), (17.0, 18.0)).points[-1]
    (found,) = orbit.friction
    assert orbit.impacts == 2 and 0.3 < found.open < 0.8
    rows = np.array(system.stop_vectors(system.stops[0]))
    pushed = np.array([system.participation[name] for name in ("flow_y", "flow_z")])

    def load(t):
        w = orbit.omega
        return np.array([2.0 * np.cos(w * t), 1.6 * np.sin(w * t)]) @ pushed

    natural = 2.0 * np.pi * system.frequencies_hz
    ring = Ring(rows, 1e5, 3e-4, friction=0.2)
    tube = Rotor(np.eye(system.size), np.diag(0.06 * natural), np.diag(natural**2), load, [ring])
    start = orbit.states(np.zeros(1))[0]
    end, _, passed, work = tube.followed(start, orbit.duration, orbit.duration / 400)
    assert len(passed) == 1 + 4
    assert end == pytest.approx(start, abs=1e-7 * np.abs(start).max())
    assert found.work_rate == pytest.approx(work / orbit.duration, rel=1e-8)
