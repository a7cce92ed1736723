"""An interrupted `make paper` goes on with what it has computed, which is data and no code."""

import json
import math
import pickle

import pytest

import paper.kept
from nldyn import System, Unbalance, continue_branch, solve_orbit
from nldyn.search.diagram import Diagram
from paper.kept import (
    has_values,
    kept_diagram,
    kept_folder,
    kept_numbers,
    read_diagram,
    read_numbers,
    unfinished_folder,
    write_numbers,
)

VALUES = [{"kind": "chaotic", "exponent": 20.25, "ended": [0, 250]}, 1.0 / 3.0]


class Trap:
    """Runs code where it is unpickled."""

    def __reduce__(self):
        return pytest.fail, ("code was run",)


@pytest.fixture(scope="module")
def found():
    system = System.from_modal(
        [13.1], {"middle": [0.635]}, modal_damping=0.0142,
        excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, frequency_hz=10.0), (9.0, 11.0))
    return Diagram((branch,), (9.0, 11.0), "middle", ("a note",))


def test_numbers_are_computed_once(tmp_path):
    calls = []

    def compute():
        calls.append(1)
        return VALUES

    path = tmp_path / "values.json"
    assert [kept_numbers(path, compute) for _ in range(3)] == [VALUES] * 3
    assert len(calls) == 1
    assert json.loads(path.read_text())["values"] == VALUES  # for other software, too


def test_a_number_that_is_none_is_kept(tmp_path):
    write_numbers(tmp_path / "a.json", [math.nan])
    assert math.isnan(read_numbers(tmp_path / "a.json")[0])


def test_no_damage_to_numbers_gives_other_ones(tmp_path):
    path = tmp_path / "values.json"
    write_numbers(path, VALUES)
    written = path.read_bytes()
    for place in range(len(written)):
        path.write_bytes(written[:place])
        assert read_numbers(path) is None
        path.write_bytes(written[:place] + bytes([written[place] ^ 1]) + written[place + 1 :])
        assert read_numbers(path) in (None, VALUES)


def test_a_diagram_is_computed_once_and_a_damaged_file_is_written_anew(found, tmp_path):
    path, calls = tmp_path / "some.h5", []

    def compute():
        calls.append(1)
        return found

    for _ in range(2):
        again = kept_diagram(path, compute)
        assert again.notes == found.notes
        assert [len(b.points) for b in again.branches] == [len(b.points) for b in found.branches]
    assert len(calls) == 1
    path.write_bytes(path.read_bytes()[:-100])
    assert read_diagram(path) is None
    kept_diagram(path, compute)
    assert len(calls) == 2
    assert read_diagram(path) is not None


def test_a_folder_that_someone_sends_runs_no_code(tmp_path):
    for name in ("some.h5", "some.json"):
        (tmp_path / name).write_bytes(pickle.dumps(Trap()))
    assert read_diagram(tmp_path / "some.h5") is None
    assert read_numbers(tmp_path / "some.json") is None


def test_a_folder_that_is_gone_does_no_harm(found, tmp_path):
    assert kept_numbers(tmp_path / "gone" / "a.json", lambda: VALUES) == VALUES
    assert kept_diagram(tmp_path / "gone" / "a.h5", lambda: found) is found


def test_what_other_code_computed_is_removed(tmp_path, monkeypatch):
    results = tmp_path / "paper"
    folder = kept_folder(results)
    assert not has_values(unfinished_folder(results))
    write_numbers(folder / "value.json", 1)
    assert has_values(unfinished_folder(results))
    assert kept_folder(results) == folder
    assert (folder / "value.json").exists()
    monkeypatch.setattr(paper.kept, "BESIDE", ())  # other sources count
    other = kept_folder(results)
    assert other != folder and not folder.exists()
    assert list(unfinished_folder(results).iterdir()) == [other]
