"""Pictures of a scene; without a graphics library everything else is still written."""

import csv

import pytest
from click.testing import CliRunner

import fem.render
from fem.render.pictures import surface_of
from fem.render.stop_scenery import penetration
from nldyn.app.cli import main
from nldyn.base.resources import example, mesh
from nldyn.report.render import (
    deepest_impact,
    deepest_state,
    orbit_to_draw,
    render_scene,
)
from nldyn.report.stop_spheres import stops_to_draw
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene, parse_scene

BEAM = example("two_dof_xi_0.01.toml")


def render(tmp_path, scene=BEAM, *more):
    out = tmp_path / "out"
    arguments = ["render", str(scene), "--out", str(out), "--quiet", *more]
    return CliRunner().invoke(main, arguments), out


def names(out):
    return {p.name for p in out.iterdir() if not p.name.startswith(".")}


def test_without_graphics_the_rest_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(fem.render, "gl_available", lambda: (False, "install libegl1"))
    result, out = render(tmp_path, BEAM, "--frequency-hz", "23.0")
    assert result.exit_code == 3
    assert result.stderr == "nldyn: install libegl1\n"
    pages = {"mode_shapes.html", "deepest_contact.html"}
    assert names(out) == {"modes.csv", "scene.toml", "orbit.png", "orbit.svg"} | pages
    page = (out / "deepest_contact.html").read_text()
    assert " orbit at 23 Hz, opened at its deepest contact" in page  # it goes on to other instants
    with (out / "modes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["mode"] for row in rows] == ["1", "2"]
    assert float(rows[0]["frequency_hz"]) == pytest.approx(13.1, rel=2e-3)
    assert float(rows[0]["participation_middle"]) > 0


def test_mp4_that_cannot_be_written_is_told_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setattr(
        "nldyn.report.render.build_structure", lambda scene: pytest.fail("computed")
    )
    result, out = render(tmp_path, BEAM, "--frequency-hz", "23.0", "--video", "mp4")
    assert result.exit_code == 3
    assert result.stderr.startswith(f"nldyn: {out}/motion.mp4: writing .mp4 needs imageio-ffmpeg")
    assert result.stderr.count("\n") == 1 and not out.exists()


def test_pictures_stand_beside_the_tables_of_a_run(tmp_path, monkeypatch):
    monkeypatch.setattr(fem.render, "gl_available", lambda: (False, "none"))
    for _ in range(2):
        _, out = render(tmp_path, BEAM, "--frequency-hz", "23.0")
    assert "modes.csv" in names(out)


def test_scene_without_mesh_cannot_be_drawn(tmp_path):
    result, out = render(tmp_path, example("one_dof.toml"))
    assert result.exit_code == 2
    assert "mesh is missing: only a mesh can be drawn" in result.stderr
    assert not out.exists()


def test_stop_is_drawn_where_the_interface_is():
    (stop,) = stops_to_draw(load_scene(BEAM))
    assert (stop.point, stop.direction, stop.gap) == ("middle", (0.0, 1.0), 0.0)


def test_deepest_state_is_at_the_largest_penetration():
    scene = load_scene(BEAM)
    system = build_system(scene)
    orbit = orbit_to_draw(scene, system, 23.0, 1)
    depth = system.participation["middle"] @ deepest_state(orbit, deepest_impact(scene, orbit))
    assert depth == pytest.approx(orbit.max_penetration, rel=1e-9)


def beam_between_stops():
    """A stop never touched, the hard one above, a soft one below, one that stops a rotation."""
    text = BEAM.read_text().replace("../../meshes/half_beam.msh", mesh("half_beam.msh").as_posix())
    never = '[[stops]]\nat = "middle"\nlaw = "linear"\nstiffness = 1e6\ngap = 1.0\n'
    below = '[[stops]]\nat = "middle"\nlaw = "linear"\nstiffness = 1e3\ndirection = -1\n'
    turning = '[[stops]]\nat = "turn"\nlaw = "linear"\nstiffness = 0.1\n'
    turn = '[interfaces.turn]\nat = "corner"\ndirection = "rotation"\n'
    head, tail = text.split("[[stops]]")
    excitation = tail.index("[[excitation]]")
    hard, rest = "[[stops]]" + tail[:excitation], tail[excitation:]
    return parse_scene(head + turn + never + hard + below + turning + rest, BEAM)


def test_pictures_show_all_stops_that_lie_along_an_axis(tmp_path, monkeypatch):
    drawn = {}

    def draw(component, states, path, **options):
        drawn[path.name] = (component, states, options)

    monkeypatch.setattr(fem.render, "gl_available", lambda: (True, ""))
    monkeypatch.setattr(fem.render, "render_modes", lambda *_, **__: None)
    for name in ("render_shape", "animate"):
        monkeypatch.setattr(fem.render, name, draw)
    scene = beam_between_stops()
    orbit = render_scene(scene, tmp_path / "out", frequency_hz=23.0).orbit
    depth = orbit.history(20_000).penetration.max(axis=0)
    assert depth[0] < 0.0 < depth[1] < depth[2] < depth[3]
    component, u, options = drawn["deepest_contact.png"]
    for stops in (options["stops"], drawn["motion.gif"][2]["stops"]):
        places = [(stop.point, stop.direction, stop.gap) for stop in stops]
        assert places == [
            ("middle", (0.0, 1.0), 1.0), ("middle", (0.0, 1.0), 0.0), ("middle", (0.0, -1.0), 0.0),
        ]  # fmt: skip
    assert -component.interfaces["middle"] @ u == pytest.approx(depth[2], rel=1e-6)
    soft = options["stops"][2]
    sunk = penetration(surface_of(component, "middle"), u, soft)
    assert sunk == pytest.approx(depth[2], rel=1e-6)
    assert "not drawn: stop at 'turn', which acts on a rotation" in options["title"]


def test_all_pictures(tmp_path, monkeypatch):
    available, advice = fem.render.gl_available()
    if not available:
        pytest.skip(advice)
    monkeypatch.setattr("nldyn.report.render.FRAMES", 3)
    result, out = render(tmp_path, BEAM, "--frequency-hz", "23.0")
    assert result.exit_code == 0, result.output
    stress = "deepest_contact_stress.png"
    assert {"mode_shapes.png", "deepest_contact.png", stress, "motion.gif"} < names(out)
