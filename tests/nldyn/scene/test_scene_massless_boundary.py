"""Rigid contact without mass in scenes."""

import logging

import pytest

import cms
from nldyn import RigidStop, SceneError, System, SystemModelError
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
