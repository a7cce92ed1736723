"""Scenes whose continuation changes another key than the frequency."""

import csv
import json
import re

import numpy as np
import pytest

from nldyn.base.errors import SceneError
from nldyn.base.resources import example
from nldyn.report.offline import unpacked
from nldyn.report.results import write_results
from nldyn.report.stop_spheres import not_drawn, stops_to_draw
from nldyn.scene import build_system, load_scene
from nldyn.scene.followed import axis_of, followed_parameter
from nldyn.scene.load_case import load_case_of
from nldyn.scene.read import parse_scene
from nldyn.scene.run import compute
from nldyn.system.parameters import Parameter

TEXT = load_scene(example("over_the_gap.toml")).text
FOLLOWED = 'parameter = "stops.0.gap"'
MORE = """
[[stops]]
at = "middle"
law = "rigid"
restitution = 0.8
gap = 1e-3
[[dampers]]
at = "middle"
coefficient = 1.0
[[springs]]
at = "middle"
coefficients = [0.0, 0.0, 1e6]
[[springs]]
at = "middle"
stiffness = 10.0
[[excitation]]
at = "middle"
kind = "constant"
force = 0.1
"""


def scene_over(name: str, text: str = TEXT + MORE):
    return parse_scene(text.replace(FOLLOWED, f'parameter = "{name}"'))


@pytest.fixture(scope="module")
def scene():
    return load_scene(example("over_the_gap.toml"))


@pytest.fixture(scope="module")
def found(scene):
    return compute(scene)


@pytest.mark.parametrize(
    ("name", "parameter"),
    [
        ("stops.1.gap", Parameter("gap", 1)),
        ("gap", Parameter("gap")),
        ("stops.0.dashpot", Parameter("dashpot")),
        ("stops.1.restitution", Parameter("restitution", 1)),
        ("force", Parameter("mass_times_radius")),
        ("excitation.0.mass_times_radius", Parameter("mass_times_radius")),
        ("excitation.1.force", Parameter("force", 1)),
        ("dampers.0.coefficient", Parameter("coefficient")),
        ("springs.1.stiffness", Parameter("spring_stiffness", 1)),
        ("springs.0.coefficients.2", Parameter("k3")),
        ("damping", Parameter("modal_damping", -1)),
        ("damping.modal_ratio.0", Parameter("modal_damping")),
    ],
)
def test_a_key_of_the_scene_is_a_number_of_its_system(name, parameter):
    found = scene_over(name)
    assert followed_parameter(found) == parameter
    axis = axis_of(found, build_system(found))
    assert (axis.parameter, axis.limits, axis.frequency_hz) == (parameter, (0.0, 5e-5), 23.0)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("stops.7.gap", "needs a number in stops, counted from 0, not '7'; there are 2"),
        ("stops.0.width", "'width' is not a key of stops.0 that may change"),
        ("gab", "'gab' is not a key that may change; did you mean 'gap'?"),
        ("excitation.0.force", "names 'excitation.0.force', which one of kind 'unbalance' has not"),
        ("matrices.mass", "is not a key that may change"),
        ("", "is not a key that may change"),
    ],
)
def test_other_keys_are_refused_in_a_sentence(name, says):
    with pytest.raises(SceneError, match=r"continuation\.parameter") as error:
        scene_over(name)
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (FOLLOWED, "", "needs 'range_hz'"),
        ("range = [0.0, 50e-6]", "", "needs 'range', the lowest and highest value"),
        ("range = [0.0, 50e-6]", "range = [2.0, 1.0]", "must run from the lower to the higher"),
        ("range = [0.0, 50e-6]", "range_hz = [2.0, 3.0]", "has both 'range_hz' and 'parameter'"),
        (FOLLOWED, "range_hz = [2.0, 3.0]", "has 'range', which goes with a 'parameter'"),
    ],
)
def test_a_continuation_has_one_range(old, new, says):
    assert old in TEXT
    with pytest.raises(SceneError) as error:
        parse_scene(TEXT.replace(old, new))
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("frequency_hz = 23.0", "", "needs frequency_hz"),
        (FOLLOWED, 'parameter = "restitution"', "is elastic, without restitution"),
        (FOLLOWED, 'parameter = "stiffness"', "must begin above zero"),
    ],
)
def test_what_the_system_does_not_have_is_refused_before_any_search(old, new, says):
    scene = parse_scene(TEXT.replace(old, new))
    with pytest.raises(SceneError) as error:
        axis_of(scene, build_system(scene))
    assert says in str(error.value)


def test_seeds_are_values_of_the_parameter():
    seed = "[[subharmonics]]\nperiod = 2\n"
    assert parse_scene(TEXT + seed + "near = 1e-5").subharmonics[0].place == 1e-5
    with pytest.raises(SceneError, match="needs 'near', and no 'near_hz'"):
        parse_scene(TEXT + seed + "near_hz = 20.0")
    with pytest.raises(SceneError, match=r"must lie within continuation\.range, not at 1"):
        parse_scene(TEXT + seed + "near = 1.0")


def test_tables_and_answers_are_named_after_the_parameter(scene, found, tmp_path):
    folder = write_results(found, tmp_path / "out", scene)
    with (folder / "branches.csv").open() as file:
        rows = list(csv.DictReader(file))
    gaps = np.array([float(row["gap"]) for row in rows])
    assert {gaps[0], gaps[-1]} == {0.0, 5e-5}
    assert {float(row["frequency_hz"]) for row in rows} == {23.0}
    with (folder / "special_points.csv").open() as file:
        folds = [float(row["gap"]) for row in csv.DictReader(file) if row["type"] == "LP"]
    told = json.loads((folder / "summary.json").read_text())
    assert (told["parameter"], told["frequency_hz"]) == ("gap", 23.0)
    assert told["branches"][0]["range"] == [0.0, 5e-5]
    peak, force, stable, _, jumps = told["answer"]
    assert " µm at gap 29." in peak and " N at gap 29." in force
    assert stable == "stable and periodic: 0 to 50 µm"
    low, high = (f"{1e6 * gap:.5g} µm" for gap in sorted(folds))
    assert jumps == f"jumps: as the gap rises past {high}; as the gap falls past {low}"


def test_the_page_is_drawn_over_the_parameter(scene, found, tmp_path):
    folder = write_results(found, tmp_path / "out", scene)
    content = unpacked((folder / "report.html").read_text(encoding="utf-8"))
    assert content["along"] == "gap (µm)"
    assert content["span"] == "gap 0 to 50 µm, at 23 Hz"
    assert content["range"] == pytest.approx([0.0, 50.0])
    assert (content["natural_hz"], content["gaps"]) == ([], [])
    (branch,) = content["branches"]
    assert max(branch["x"]) == pytest.approx(50.0)
    for orbit in content["orbits"]:
        assert orbit["walls"] == pytest.approx([1e-6 * orbit["x"]], abs=1e-15)
        assert orbit["title"].endswith(" µm") and " at 23 Hz, gap " in orbit["title"]
    assert content["tables"]["special points"]["columns"][2] == "gap (µm)"


def test_a_stop_whose_gap_changes_is_not_drawn_at_one_gap():
    text = load_scene(example("two_dof_xi_0.01.toml")).text
    own = 'parameter = "gap"\nrange = [0.0, 5e-5]\nfrequency_hz = 23.0'
    changed = re.sub("(?m)^range_hz = .*$", own, text)
    assert not_drawn(parse_scene(text)) == []
    (said,) = not_drawn(parse_scene(changed))
    assert said.endswith("which has a gap that changes from orbit to orbit")
    assert stops_to_draw(parse_scene(changed)) == []


def test_modes_are_chosen_over_the_parameter_of_the_continuation():
    text = TEXT.replace("[damping]", "[reduction]\ntolerance = 0.01\n[damping]", 1)
    scene = parse_scene(text)
    setting = load_case_of(scene)
    assert (setting.parameter, setting.limits) == (Parameter("gap"), scene.continuation.limits)
    assert setting.frequency_hz == scene.continuation.frequency_hz
