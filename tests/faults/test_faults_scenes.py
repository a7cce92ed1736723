"""Fuzzed scenes: each is computed rightly or refused in one sentence; nothing else happens."""

import tomllib
from copy import deepcopy

import numpy as np
import pytest
from frequencies import lowest_hz
from hypothesis import given
from hypothesis import strategies as st
from limited_commands import command, refusal
from scene_mutations import TEXTS, document, spoil, tweak
from small_meshes import fuzz, write_meshes

from nldyn.base.resources import mesh
from nldyn.scene.build import build_system
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene

QUICK, FULL = 20, 4000
UNSEEN = (1e-9, 1e-10, 1e-8)  # a mode that moves an interface by such a share may count or not
KEYS = {name: tomllib.loads(text) for name, text in TEXTS.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of scenes with the meshes, and what else paths may lead to."""
    place = tmp_path_factory.mktemp("scenes")
    write_meshes(place)
    for name in ("half_beam.msh", "tube.msh", "strip.msh", "two_beams.msh", "portal.inp"):
        (place / name).write_bytes(mesh(name).read_bytes())
    return place


def judge(folder, content):
    """Check what `nldyn check` makes of a scene."""
    file = folder / "scene.toml"
    file.write_bytes(content)
    result = command("check", file)
    said = refusal(result)
    if said is not None:
        assert said.startswith(f"{file}: ")
        return
    assert "no fault found" in result.stdout
    assert "nan" not in result.stdout.replace("nan'", "")
    compare(load_scene(file))


def compare(scene):
    """Compare the frequencies of a scene with those of the full eigenproblem."""
    found = build_system(scene).frequencies_hz
    assert np.isfinite(found).all()
    if scene.components:  # their whole is compared in tests/nldyn/scene
        return
    if scene.modal is not None:
        assert np.allclose(np.sort(found), np.sort(scene.modal.frequencies_hz), rtol=1e-9)
        return
    loads = None
    if scene.matrices is not None:
        stiffness, mass = np.array(scene.matrices.stiffness), np.array(scene.matrices.mass)
    elif scene.reduction.method in ("guyan", "craig-bampton"):
        return
    else:
        component = build_component(scene)
        stiffness, mass = component.stiffness.toarray(), component.mass.toarray()
        if scene.reduction.modes is not None:  # counted are those that something sees
            loads = np.array(list(component.interfaces.values())).T
    kept = len(found) if scene.matrices is not None else kept_modes(scene, len(found))
    rigid = np.count_nonzero(found == 0.0)
    told = (lowest_hz(stiffness, mass, kept, loads, share, rigid) for share in UNSEEN)
    assert any(agree(found, kept, *each) for each in told)


def agree(found, kept, wanted, zero):
    """Whether the kept ones of some frequencies are those wanted; below a limit all are zero."""
    if len(wanted) != kept:
        return False
    if not kept or wanted[-1] == 0.0:
        return not found[:kept].any()
    rounding = 1e-14 * (wanted / max(wanted[0], 1e-12 * wanted[-1])) ** 2  # of the check itself
    values = np.sort(found)[:kept]
    close = np.abs(values - wanted) <= (1e-6 + rounding) * wanted + 1e-6 * wanted[-1]
    hidden = (values <= zero) & (wanted <= zero)  # neither is told by the stiffness matrix
    return (close | hidden).all()


def kept_modes(scene, count):
    """Free-interface modes among those of a reduced model; the others are residual modes."""
    if scene.reduction.method == "truncation" or not scene.reduction.residual:
        return count
    loads = {table.load for table in scene.excitation} - {None}  # have residual modes, too
    return max(0, count - len(scene.interfaces) - len(loads))


@pytest.mark.parametrize("name", TEXTS)
def test_the_scenes_to_spoil_are_good(folder, name):
    file = folder / "scene.toml"
    file.write_text(TEXTS[name])
    assert refusal(command("check", file)) is None
    compare(load_scene(file))
    assert tomllib.loads(document(KEYS[name])) == KEYS[name]


@st.composite
def spoiled(draw):
    """The text of a scene with up to four changes."""
    tree = deepcopy(KEYS[draw(st.sampled_from(sorted(KEYS)))])
    for _ in range(draw(st.integers(1, 4))):
        spoil(draw, tree)
    return document(tree).encode("utf-8", "surrogatepass")


@fuzz(QUICK)
@given(content=spoiled())
def test_a_spoiled_scene_is_told_in_one_sentence_or_right(folder, content):
    judge(folder, content)


@pytest.mark.slow
@fuzz(FULL)
@given(content=spoiled())
def test_thousands_of_spoiled_scenes(folder, content):
    judge(folder, content)


@st.composite
def tweaked(draw):
    """The text of a scene with one to three other values that are of the right kind."""
    tree = deepcopy(KEYS[draw(st.sampled_from(sorted(KEYS)))])
    for _ in range(draw(st.integers(1, 3))):
        tweak(draw, tree)
    return document(tree).encode()


@fuzz(QUICK)
@given(content=tweaked())
def test_a_scene_of_other_values_is_told_in_one_sentence_or_right(folder, content):
    judge(folder, content)


@pytest.mark.slow
@fuzz(FULL)
@given(content=tweaked())
def test_thousands_of_scenes_of_other_values(folder, content):
    judge(folder, content)


@st.composite
def garbled(draw):
    """The bytes of a scene, cut, doubled, swapped or overwritten somewhere."""
    content = bytearray(TEXTS[draw(st.sampled_from(sorted(TEXTS)))].encode())
    for _ in range(draw(st.integers(1, 3))):
        first = draw(st.integers(0, len(content)))
        last = first + draw(st.integers(0, 40))
        piece = bytes(content[first:last])
        other = draw(st.sampled_from((b"", piece * 2, piece[::-1], b"\x00", b"\xff", b"[[[", b"=")))
        content[first:last] = other if draw(st.booleans()) else draw(st.binary(max_size=8))
    return bytes(content)


@fuzz(QUICK // 2)
@given(content=garbled())
def test_a_garbled_file_is_told_in_one_sentence_or_right(folder, content):
    judge(folder, content)


@pytest.mark.slow
@fuzz(FULL // 4)
@given(content=garbled())
def test_thousands_of_garbled_files(folder, content):
    judge(folder, content)
