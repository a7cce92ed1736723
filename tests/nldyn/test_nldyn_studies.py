"""Parameter studies: labelled results, failures kept, resume, samples, bad keys."""

from __future__ import annotations

import json

import cluster_tasks
import numpy as np
import pytest

from nldyn import SceneError, SystemModelError, study
from nldyn.resources import example

GAPS = [0.0, 5e-4, 1e-3]


def grid(**more):
    keys = {"stops.0.gap": GAPS, "damping.modal_ratio": [0.01, 0.02]}
    return study(example("one_dof.toml"), keys, cluster_tasks.frequencies, **more)


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
    study(
        example("one_dof.toml"), {"stops.0.gap": [2e-4]}, cluster_tasks.frequencies, keep=keep
    )
    assert len(keep.read_text().splitlines()) == 7


def test_latin_hypercube_covers_each_range_evenly_and_repeats():
    keys = {"stops.0.gap": (0.0, 8e-4), "damping.modal_ratio": (0.0, 0.1)}
    runs = [
        study(
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
        ({}, {}, SystemModelError, "name at least one parameter"),
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
        study(example("one_dof.toml"), keys, cluster_tasks.frequencies, **more)


def test_a_file_that_is_no_study_is_refused(tmp_path):
    keep = tmp_path / "notes.txt"
    keep.write_text("some notes\nof mine\n")
    with pytest.raises(SystemModelError, match="line 1 is not a case of a study"):
        grid(keep=keep)
    assert keep.read_text() == "some notes\nof mine\n"
