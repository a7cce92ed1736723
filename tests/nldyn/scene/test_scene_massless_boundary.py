"""Rigid contact without mass in scenes."""

import logging

import pytest

import cms
from nldyn import RigidStop, SceneError, System, SystemModelError
from nldyn.app.describe import describe_stops
from nldyn.base.resources import example
from nldyn.scene import build_component, build_system, load_scene

MASSLESS = 'modes = 6\nmethod = "macneal"\nmassless = ["push"]'


def portal(tmp_path, reduction=MASSLESS, at="middle", law='law = "rigid"\nrestitution = 1'):
    """The example's portal against a rigid stop, with its force in the middle of the beam."""
    path = example("portal.toml")
    mesh = (path.parent / "../../meshes/portal.inp").resolve()
    text = path.read_text().replace("../../meshes/portal.inp", str(mesh))
    for old, new in (
        ("tolerance = 0.02", reduction),
        ('law = "linear"\nstiffness = 2.0e5          # N/m', law),
        ('at = "push"\nkind', f'at = "{at}"\nkind'),
        ("[reduction]", '[interfaces.middle]\nat = "MIDSPAN"\ndirection = "x"\n[reduction]'),
    ):
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "scene.toml"
    file.write_text(text)
    return load_scene(file, [mesh.parent])


def test_a_rigid_stop_of_a_scene_gives_way_by_what_is_left(tmp_path, caplog):
    with caplog.at_level(logging.INFO):
        scene = portal(tmp_path)
        (stop,) = build_system(scene).stops
    assert "interfaces without mass: push" in caplog.text
    reduced = cms.reduce(build_component(scene), modes=6, method="macneal", massless=["push"])
    (known,) = System.from_reduced(reduced, stops=[RigidStop("push", 1.0, 2e-3)]).stops
    assert stop == known


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"reduction": 'modes = 6\nmassless = ["push"]'}, "needs both method = "),
        ({"reduction": 'modes = 6\nmethod = "macneal"'}, "needs both method = "),
        (
            {"reduction": MASSLESS.replace('"push"', '"pull"')},
            "reduction.*no interface 'pull'",
        ),
        ({"at": "push"}, "excitation: 'push' has no mass"),
        ({"law": 'law = "rigid"\nrestitution = 0.8'}, "impact that could lose energy"),
        ({"law": "stiffness = 1e9"}, "only a rigid stop or a linear one"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path, changes, sentence):
    with pytest.raises((SceneError, SystemModelError), match=sentence):
        build_system(portal(tmp_path, **changes))


def strip(tmp_path, law, massless):
    """The example's strip on a support of another law."""
    path = example("landing_strip.toml")
    mesh = (path.parent / "../../meshes/strip.msh").resolve()
    text = path.read_text().replace("../../meshes/strip.msh", str(mesh))
    named = f'[reduction]\nmethod = "macneal"\nmassless = {massless}\n' if massless else None
    for old, new in (("stiffness = 1e4", law), ("[reduction]\n", named or "[reduction]\n")):
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "scene.toml"
    file.write_text(text)
    return load_scene(file, [mesh.parent])


def test_an_area_of_a_scene_is_rigid_or_linear_where_it_has_no_mass(tmp_path, caplog):
    with caplog.at_level(logging.INFO):
        rigid = build_system(strip(tmp_path, 'law = "rigid"', '["support"]'))
    assert "interfaces without mass: 20, 'support 1' to 'support 20'" in caplog.text
    assert rigid.areas == {"support": tuple(range(20))}
    soft = build_system(strip(tmp_path, "stiffness = 1e4", '["support"]'))
    for stiff, give in zip(rigid.stops, soft.stops, strict=True):  # each in series with 1e4 * 15 mm
        assert stiff.gap == give.gap
        assert 1.0 / give.stiffness - 1.0 / stiff.stiffness == pytest.approx(1.0 / 150.0, rel=1e-6)
    (told,) = describe_stops(soft)
    assert "20 points" in told and float(told.split()[5]) < 20 * 150.0


@pytest.mark.parametrize(
    ("law", "sentence"),
    [
        ('law = "rigid"', 'law is rigid, which needs points without mass: method = "macneal"'),
        ('law = "rigid"\ndashpot = 1.0', "has 'dashpot', which is not a key of law 'rigid'"),
        ('law = "rigid"\nstiffness = 1.0', "has 'stiffness', which is not a key of law 'rigid'"),
        ('law = "linear"', "needs a 'stiffness', or the law 'rigid'"),
    ],
)
def test_an_area_that_makes_no_sense_is_refused(tmp_path, law, sentence):
    with pytest.raises(SceneError, match=sentence):
        build_system(strip(tmp_path, law, ""))
