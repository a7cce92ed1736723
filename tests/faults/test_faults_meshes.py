"""Fuzzed meshes: each is read rightly or refused in one sentence; nothing else happens."""

import numpy as np
import pytest
from frequencies import lowest_hz
from hypothesis import given
from hypothesis import strategies as st
from limited_commands import command, limits, refusal
from mesh_mutations import bombs, spoiled_file, whole_files
from scene_mutations import FRAME, STRUCTURE
from small_meshes import fuzz, write_meshes

import cms
import fem
from nldyn.scene.build import build_system
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene

QUICK, FULL = 20, 4000

PART = "{ youngs_modulus = 2e11, density = 7800, width = 0.03, height = 0.01 }"
GMSH = f"""
parts.beam = {PART}
parts.leaf = {PART}
[mesh]
file = "gmsh.msh"
[[supports]]
at = "foot"
fixed = ["x", "y", "rotation"]
[interfaces.middle]
at = "middle"
direction = "y"
[reduction]
modes = 2
[[excitation]]
at = "middle"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [5, 90]
"""
SCENES = {"frame": FRAME, "structure": STRUCTURE, "gmsh": GMSH}
NAMES = {"frame": "frame.vtu", "structure": "block.vtu", "gmsh": "gmsh.msh"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("meshes")
    write_meshes(place)
    return place


@pytest.fixture(scope="module")
def files(folder):
    return whole_files(folder)


def judge(folder, files, name, content):
    """Check what `nldyn check` makes of a mesh."""
    kind = files[name][0]
    mesh, file = folder / f"spoiled_{name}", folder / "scene.toml"
    mesh.write_bytes(content)
    file.write_text(SCENES[kind].replace(NAMES[kind], mesh.name))
    result = command("check", file)
    said = refusal(result)
    if said is not None:
        assert said.startswith(f"{file}: ")
        return
    assert "nan" not in result.stdout
    scene = load_scene(file)
    component = build_component(scene)
    stiffness, mass = component.stiffness.toarray(), component.mass.toarray()
    lowest, rounding = lowest_hz(stiffness, mass, 1)
    found = build_system(scene).frequencies_hz[0]
    if "craig" in SCENES[kind]:  # few modes: a frequency from above, by Rayleigh and Ritz
        assert (1.0 - 1e-6) * lowest[0] - 1e-3 <= found <= 1.05 * lowest[0] + 1e-3
        if np.linalg.cond(mass) > 1e14:  # a whole basis may not be told from a singular one
            return
        whole = cms.reduce(component, cutoff_hz=1e12, method="craig-bampton")
        found = whole.frequencies_hz[0]
    floats = found == 0.0 and lowest[0] <= rounding
    assert floats or found == pytest.approx(lowest[0], rel=1e-6, abs=1e-3)


def test_the_meshes_to_spoil_are_good(folder, files):
    for name, (_, content) in files.items():
        judge(folder, files, name, content)
        assert refusal(command("check", folder / "scene.toml")) is None


@fuzz(QUICK)
@given(data=st.data())
def test_a_spoiled_mesh_is_told_in_one_sentence_or_right(folder, files, data):
    judge(folder, files, *data.draw(spoiled_file(files)))


@pytest.mark.slow
@fuzz(FULL)
@given(data=st.data())
def test_thousands_of_spoiled_meshes(folder, files, data):
    judge(folder, files, *data.draw(spoiled_file(files)))


@pytest.mark.parametrize("name", sorted(bombs()))
def test_what_declares_or_unpacks_to_something_huge_is_refused(folder, name):
    """Within a gigabyte and some seconds."""
    path = folder / name
    path.write_bytes(bombs()[name])
    with limits(20.0, 1_000_000_000), pytest.raises(fem.ModelError) as caught:
        fem.read_mesh(path)
    assert str(caught.value).startswith(str(path))
    assert "root:" not in str(caught.value)
