"""A scene is data: nothing in it is executed, and no path in it leads outside unasked."""

import json
import os
import sys
from contextlib import contextmanager

import pytest
from limited_commands import command, refusal
from scene_mutations import FRAME, MODAL
from small_meshes import write_meshes

import fem
from fem.render import write_page
from nldyn.base.errors import SceneError
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene, parse_scene

IN_FOLDER = "outside the folder of the scene and the current one"


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder of scenes beside one of meshes; the current folder is neither."""
    for name in ("scenes", "meshes", "elsewhere"):
        (tmp_path / name).mkdir()
    write_meshes(tmp_path / "meshes")
    monkeypatch.chdir(tmp_path / "elsewhere")
    return tmp_path


def scene_with(project, mesh):
    file = project / "scenes" / "scene.toml"
    file.write_text(FRAME.replace('"frame.vtu"', json.dumps(str(mesh))))
    return file


@pytest.mark.parametrize("absolute", [False, True])
def test_a_mesh_in_another_folder_is_read_if_asked_for(project, absolute, monkeypatch):
    mesh = project / "meshes" / "frame.vtu"
    file = scene_with(project, mesh if absolute else "../meshes/frame.vtu")
    said = refusal(command("check", file))
    assert said == (
        f"{file}: mesh.file leads to {mesh}, {IN_FOLDER}; if that is meant, allow it with "
        f"--mesh-folder {mesh.parent}"
    )
    assert refusal(command("check", file, "--mesh-folder", mesh.parent)) is None
    assert refusal(command("check", file, "--mesh-folder", "../meshes")) is None
    assert build_component(load_scene(file, [mesh.parent])).stiffness.shape[0] > 0
    with pytest.raises(SceneError, match=IN_FOLDER):
        build_component(load_scene(file))
    monkeypatch.chdir(project)  # the mesh is below the current folder
    assert refusal(command("check", file)) is None


def test_a_mesh_that_is_not_there_is_not_asked_for_in_another_folder(project):
    file = scene_with(project, "../meshes/frime.vtu")
    assert refusal(command("check", file)) == (
        f"{file}: mesh.file leads to {project / 'meshes' / 'frime.vtu'}, {IN_FOLDER}; there is no "
        "such file: copy it beside the scene"
    )


def test_a_link_counts_where_it_leads(project):
    (project / "scenes" / "frame.vtu").symlink_to(project / "meshes" / "frame.vtu")
    (project / "scenes" / "more").symlink_to(project / "meshes")
    for name in ("frame.vtu", "more/frame.vtu"):
        assert IN_FOLDER in refusal(command("check", scene_with(project, name)))
    (project / "scenes" / "real.vtu").write_bytes((project / "meshes/frame.vtu").read_bytes())
    (project / "scenes" / "link.vtu").symlink_to("real.vtu")
    assert refusal(command("check", scene_with(project, "link.vtu"))) is None
    assert refusal(command("check", scene_with(project, "../scenes/./real.vtu"))) is None


@pytest.mark.parametrize("name", ["loop.vtu", "pipe.vtu", "folder", "a" * 300 + ".vtu", "x\0.vtu"])
def test_what_is_no_file_is_told(project, name):
    file = scene_with(project, f"../meshes/{name}")
    said = refusal(command("check", file, "--mesh-folder", project / "meshes"))
    assert said.startswith(f"{file}: mesh.file names ")


@pytest.mark.parametrize("place", ["/dev/zero", "/dev/random", "/proc/self/mem", "/etc/passwd"])
def test_devices_and_files_of_the_system_are_not_read(project, place):
    said = refusal(command("check", scene_with(project, place)))
    assert IN_FOLDER in said and "root:" not in said
    allowed = command("check", scene_with(project, place), "--mesh-folder", "/")
    assert "root:" not in refusal(allowed)


def test_a_scene_that_is_a_device_or_a_pipe_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    for file in ("/dev/zero", tmp_path / "pipe.toml"):
        assert refusal(command("check", file)).endswith("it is not a regular file")


def test_a_scene_is_not_larger_than_one_may_be(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text("x = [" + "1.0, " * 2_100_000 + "]")
    assert refusal(command("check", file)) == f"{file}: is larger than 10 MB; use a mesh"
    with file.open("wb") as stream:
        stream.truncate(10**12)  # sparse
    assert "is larger than 10 MB" in refusal(command("check", file))


@pytest.mark.parametrize("text", ["a" + ".a" * 100_000 + " = 1", '["a"' + '."b"' * 100_000 + "]"])
def test_a_key_of_very_many_words_is_refused_at_once(text):
    with pytest.raises(SceneError, match="more than 100 words with dots"):
        parse_scene(text)


def test_dots_in_text_are_no_key():
    words = "one. two. " * 40
    assert parse_scene(MODAL.replace("two modes", words)).title == words


def test_an_included_file_is_in_the_folder_of_the_mesh_or_an_allowed_one(project):
    deck = project / "scenes" / "deck.inp"
    deck.write_text("*INCLUDE, INPUT=../meshes/frame.inp\n")
    file = scene_with(project, "deck.inp")
    said = refusal(command("check", file))
    assert "the included file" in said and "is in a folder that is not allowed" in said
    assert refusal(command("check", file, "--mesh-folder", project / "meshes")) is None
    with pytest.raises(fem.ModelError, match="not allowed"):
        fem.read_mesh(deck)
    assert len(fem.read_mesh(deck, [project / "meshes"]).cells["line"]) == 6


def test_results_go_nowhere_but_into_the_folder_asked_for(tmp_path, monkeypatch):
    """Names and titles that look like paths are not used as such."""
    monkeypatch.chdir(tmp_path)
    text = MODAL.partition("[[subharmonics]]")[0].replace("two modes", "../../x/$(touch y)")
    text = text.replace("[5.0, 90.0]", "[30.0, 30.3]").replace("[1, 2]", "[1]")
    text = text.replace("participation.middle", 'participation."../out"')
    text = text.replace('"middle"', '"../out"')
    (tmp_path / "scene.toml").write_text(text)
    result = command("run", "scene.toml", "--out", "out", "--quiet", seconds=120.0)
    assert refusal(result) is None
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out", "scene.toml"]
    known = {"branches.csv", "special_points.csv", "ends.csv", "branches.h5", "diagram.png",
             "diagram.svg", "report.html", "summary.json", "scene.toml", ".nldyn.json"}  # fmt: skip
    assert {entry.name for entry in (tmp_path / "out").iterdir()} == known


def test_nothing_in_a_scene_or_a_mesh_is_executed(tmp_path):
    """No process is started, nothing of them is compiled."""
    write_meshes(tmp_path)
    tricks = ("__import__('os').system('touch x')", "!!python/object/apply:os.system", "${HOME}")
    file = tmp_path / "scene.toml"
    for trick in tricks:  # twice: what is imported at the first time is compiled then
        file.write_text(f"title = {json.dumps(trick)}\n{FRAME}")
        assert refusal(command("check", file)) is None
    with audited() as seen:
        for trick in tricks:
            file.write_text(f"title = {json.dumps(trick)}\n{FRAME}")
            assert refusal(command("check", file)) is None
    assert not {event for event, _ in seen if event in FORBIDDEN}
    compiled = [what for event, what in seen if event == "compile"]
    assert not any(trick in what for trick in tricks for what in compiled)
    assert any(event == "open" for event, _ in seen)


FORBIDDEN = {"os.system", "subprocess.Popen", "os.exec", "os.posix_spawn",
             "os.fork", "socket.connect", "urllib.Request", "pickle.find_class"}  # fmt: skip


@contextmanager
def audited():
    """Names of the audit events of the interpreter meanwhile, with what they are about."""
    seen, armed = [], True
    sys.addaudithook(lambda event, what: seen.append((event, str(what))) if armed else None)
    try:
        yield seen
    finally:
        armed = False


def test_a_page_for_the_browser_runs_nothing_of_the_scene(tmp_path):
    evil = '</script><script>alert(1)</script><img src=x onerror="alert(2)"><!--<script>'
    component = build_component(_frame_scene(tmp_path))
    count = len(component.free)
    path = tmp_path / "page.html"
    write_page(component, [[1.0]] * count, [evil], path, heading=evil)
    text = path.read_text()
    body = text.partition('type="application/json">')[2].partition("</script>")[0]
    assert json.loads(body)["heading"] == evil
    assert "<" not in body


def _frame_scene(folder):
    write_meshes(folder)
    (folder / "scene.toml").write_text(FRAME)
    return load_scene(folder / "scene.toml")
