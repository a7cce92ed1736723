"""Parameter studies: labelled results, failures kept, resume, samples, bad keys."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import cluster_tasks
import numpy as np
import pytest

from nldyn import FlowMap, SceneError, Stop, SystemModelError, parameter_study
from nldyn.base.resources import example
from nldyn.scene.case_fingerprints import case_fingerprints

GAPS = [0.0, 5e-4, 1e-3]


def grid(**more):
    keys = {"stops.0.gap": GAPS, "damping.modal_ratio": [0.01, 0.02]}
    return parameter_study(example("one_dof.toml"), keys, cluster_tasks.frequencies, **more)


def test_a_grid_is_labelled_by_its_keys_and_keeps_failures():
    found = grid()
    assert found["gap"].dims == ("stops.0.gap", "damping.modal_ratio")
    chosen = found.sel({"stops.0.gap": 5e-4, "damping.modal_ratio": 0.02})
    assert float(chosen["gap"]) == 5e-4
    assert float(chosen["f1_hz"]) == pytest.approx(np.sqrt(16877.0 / 2.48) / (2.0 * np.pi))
    lost = found.sel({"stops.0.gap": 1e-3})
    assert np.isnan(lost["gap"]).all()
    assert set(lost["failure"].values) == {"ValueError: the gap is too large"}
    assert (found["failure"].sel({"stops.0.gap": 0.0}) == "").all()


def test_a_study_goes_on_where_it_was(tmp_path):
    keep = tmp_path / "study.jsonl"
    first = grid(keep=keep)
    lines = keep.read_text().splitlines()
    assert len(lines) == 6
    marked = [json.loads(line) for line in lines if not json.loads(line)["failure"]]
    for entry in marked:
        entry["values"]["f1_hz"] = -1.0  # to see that it is read, not computed
    keep.write_text("\n".join(json.dumps(e) for e in marked[:3]) + "\n" + lines[5][:20])
    again = grid(keep=keep)
    assert int((again["f1_hz"] == -1.0).sum()) == 3
    assert int(again["f1_hz"].notnull().sum()) == int(first["f1_hz"].notnull().sum()) == 4
    assert int((grid(keep=keep)["f1_hz"] == -1.0).sum()) == 3


def test_another_scene_does_not_use_the_cases_of_this_one(tmp_path):
    keep = tmp_path / "study.jsonl"
    grid(keep=keep)
    parameter_study(
        example("one_dof.toml"), {"stops.0.gap": [2e-4]}, cluster_tasks.frequencies, keep=keep
    )
    assert len(keep.read_text().splitlines()) == 7


def test_latin_hypercube_covers_each_range_evenly_and_repeats():
    keys = {"stops.0.gap": (0.0, 8e-4), "damping.modal_ratio": (0.0, 0.1)}
    runs = [
        parameter_study(
            example("one_dof.toml"), keys, cluster_tasks.frequencies,
            design="latin hypercube", samples=16, seed=4,
        )
        for _ in range(2)
    ]  # fmt: skip
    assert runs[0].equals(runs[1])
    for name, (low, high) in keys.items():
        cells = np.floor((runs[0][name].values - low) / (high - low) * 16).astype(int)
        assert sorted(cells) == list(range(16))
    np.testing.assert_array_equal(runs[0]["gap"].values, runs[0]["stops.0.gap"].values)


def modes(system):
    return {"f1_hz": system.frequencies_hz[0], "size": system.size}


@pytest.mark.parametrize("design", ["random", "latin hypercube"])
def test_samples_of_a_key_of_whole_numbers_are_whole(design):
    keys = {"reduction.modes": (1, 4), "damping.modal_ratio": (0.01, 0.02)}
    found = parameter_study(example("two_dof_xi_0.01.toml"), keys, modes, design=design, samples=6)
    assert (found["failure"] == "").all()
    chosen = found["reduction.modes"].values
    assert chosen.dtype.kind == "i" and len(set(chosen)) > 1
    np.testing.assert_array_equal(found["size"].values, chosen + 1)  # and the residual one
    ratios = found["damping.modal_ratio"].values
    assert np.all((ratios > 0.01) & (ratios < 0.02))


def test_whole_numbers_in_a_key_of_any_numbers_are_not_rounded():
    keys = {"stops.0.gap": (0, 1)}  # also written without a point in some scenes
    found = parameter_study(example("one_dof.toml"), keys, modes, design="random", samples=4)
    assert not np.any(found["stops.0.gap"].values == found["stops.0.gap"].values.round())


def ratios(system):
    return {"second": system.damping[1, 1] / (4.0 * np.pi * system.frequencies_hz[1])}


def test_values_of_a_grid_may_be_numbers_and_lists_in_turn():
    keys = {"damping.modal_ratio": [[0.01, 0.02], 0.03, np.array([0.01, 0.02])]}
    found = parameter_study(example("two_dof_xi_0.01.toml"), keys, ratios)
    assert found["damping.modal_ratio"].values.tolist()[:2] == ["[0.01, 0.02]", "0.03"]
    assert (found["failure"] == "").all()
    np.testing.assert_allclose(found["second"].values, [0.02, 0.03, 0.02], rtol=1e-12)


def test_progress_counts_all_cases():
    counts = []
    grid(progress=lambda done, total: counts.append((done, total)))
    assert counts == [(k, 6) for k in range(1, 7)]


@pytest.mark.parametrize(
    ("keys", "more", "error", "said"),
    [
        ({"stops.1.gap": [0.0]}, {}, SceneError, "'1' is not one of 0 to 0"),
        ({"stop.0.gap": [0.0]}, {}, SceneError, "names no key of the scene: no 'stop' there"),
        ({"stops.0.gapp": [0.0]}, {}, SceneError, "gapp"),
        ({"damping.modal_ratio": [0.1, -1.0]}, {}, SceneError, "modal_ratio"),
        (["stops.0.gap"], {}, SystemModelError, "study: parameters must be a Mapping"),
        ({7: [0.0]}, {}, SystemModelError, "a key of parameters must be a str, got 7"),
        ({"stops.0.gap": [0.0]}, {"executor": 2}, SystemModelError, "executor must be"),
        ({"stops.0.gap": [0.0]}, {"keep": 3}, SystemModelError, "study: keep must be"),
        ({"stops.0.gap": [0.0]}, {"keep_name": 3}, SystemModelError, "study: keep_name must be"),
        ({}, {}, SystemModelError, "name at least one parameter"),
        ({"": [1]}, {}, SystemModelError, "a key of parameters has an empty part, got ''"),
        ({"stops..gap": [1]}, {}, SystemModelError, "has an empty part, got 'stops..gap'"),
        ({"stops.0.gap": 1.0}, {}, SystemModelError, "must list its values, got 1.0"),
        ({"stops.0.gap": [0.0]}, {"samples": 3}, SystemModelError, "a grid takes no samples"),
        ({"stops.0.gap": (1.0, 0.0)}, {"design": "random", "samples": 2}, SystemModelError,
         "two ends of its range, ascending"),
        ({"stops.0.gap": (0.0, 1.0)}, {"design": "random"}, SystemModelError, "samples must be"),
        ({"stops.0.gap": (0.0, 1.0)}, {"design": "sobol"}, SystemModelError, "design must be"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(keys, more, error, said):
    with pytest.raises(error, match=said):
        parameter_study(example("one_dof.toml"), keys, cluster_tasks.frequencies, **more)


def test_a_file_that_is_no_study_is_refused(tmp_path):
    keep = tmp_path / "notes.txt"
    keep.write_text("some notes\nof mine\n")
    with pytest.raises(SystemModelError, match="line 1 is not a case of a study"):
        grid(keep=keep)
    assert keep.read_text() == "some notes\nof mine\n"


def key_of(measure, name=None):
    return case_fingerprints([{}], Path(), measure, name)[0]


def scaled(factor):
    return lambda system: {"f": factor * system.frequencies_hz[0]}


def weighted(system, weight=1.0, table=None):
    return {"f": weight * system.frequencies_hz[0]}


class Meter:
    def __init__(self, factor):
        self.factor = factor

    def measure(self, system):
        return {"f": self.factor * system.frequencies_hz[0]}


def defined(text):
    space = {"__name__": "a_script", "np": np}
    exec(text, space)
    return space["measure"]


def test_measures_of_the_same_content_have_one_key():
    assert key_of(scaled(2.0)) == key_of(scaled(2.0))
    array = np.arange(3.0)
    for more in ({"weight": 2.0}, {"table": array}, {"table": {"a": [1, Stop("tip", 1e9)]}}):
        assert key_of(partial(weighted, **more)) == key_of(partial(weighted, **more))
    text = "HZ = 3.0\ndef part(x): return np.linalg.norm(x)\ndef measure(s): return part(HZ)"
    assert key_of(defined(text)) == key_of(defined(text))
    recursive = "def measure(s, n=3): return measure(s, n - 1) if n else {'f': len([1])}"
    assert key_of(defined(recursive)) == key_of(defined(recursive))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (scaled(2.0), scaled(3.0)),
        (partial(weighted, weight=2.0), partial(weighted, weight=3.0)),
        (partial(weighted, table=np.arange(3.0)), partial(weighted, table=np.arange(3))),
        (partial(weighted, table=Stop("tip", 1e9)), partial(weighted, table=Stop("tip", 2e9))),
        (lambda s: {"f": 1.0}, lambda s: {"f": 2.0}),
        (lambda s: {"f": max(s, key=lambda x: x)}, lambda s: {"f": max(s, key=lambda x: -x)}),
        (lambda s: {"f": s.size}, lambda s: {"f": s.drive}),
        (defined("def measure(s, w=1): return w"), defined("def measure(s, w=2): return w")),
        (
            defined("HZ = 1\ndef measure(s): return HZ"),
            defined("HZ = 2\ndef measure(s): return HZ"),
        ),
        (
            defined("def part(x): return x\ndef measure(s): return part(1)"),
            defined("def part(x): return -x\ndef measure(s): return part(1)"),
        ),
    ],
)
def test_measures_of_other_content_have_other_keys(one, other):
    assert key_of(one) != key_of(other)


def test_two_measures_of_one_name_do_not_share_a_file(tmp_path):
    keep = tmp_path / "study.jsonl"
    found = [
        parameter_study(example("one_dof.toml"), {"stops.0.gap": [0.0]}, scaled(factor), keep=keep)
        for factor in (1.0, 2.0)
    ]
    assert float(found[1]["f"].item() / found[0]["f"].item()) == 2.0


def test_another_mesh_of_the_same_name_has_other_keys(tmp_path):
    tables = [{"mesh": {"file": "beam.msh"}}]
    keys = set()
    for content in (b"one", b"two", b"one"):
        (tmp_path / "beam.msh").write_bytes(content)
        keys.add(case_fingerprints(tables, tmp_path, cluster_tasks.frequencies, None)[0])
    assert len(keys) == 2


def test_a_measure_with_objects_needs_a_name(one_dof):
    flow = FlowMap(one_dof)
    for measure in (Meter(2.0).measure, partial(weighted, table=flow), lambda s: {"f": flow}):
        with pytest.raises(SystemModelError, match=r"keep cannot tell .*: name it by keep_name"):
            key_of(measure)
        assert key_of(measure, "one") == key_of(measure, "one") != key_of(measure, "two")


def test_a_file_that_cannot_be_written_is_refused_before_any_case(tmp_path):
    def measure(system):
        raise AssertionError("a case was computed")

    for keep in (tmp_path / "missing" / "study.jsonl", tmp_path):
        with pytest.raises(SystemModelError, match="cannot be"):
            parameter_study(example("one_dof.toml"), {"stops.0.gap": [0.0]}, measure, keep=keep)


@pytest.mark.parametrize("name", ["failure", "stops.0.gap"])
def test_a_measured_number_has_a_name_of_its_own(name):
    with pytest.raises(SystemModelError, match=f"must not be named '{name}'"):
        parameter_study(example("one_dof.toml"), {"stops.0.gap": [0.0]}, lambda system: {name: 1.0})
