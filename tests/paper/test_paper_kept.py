"""An interrupted `nldyn paper` goes on with what it has computed."""

import pytest

import nldyn.paper.kept
from nldyn.paper.kept import keep, kept, kept_folder, read_kept, unfinished_folder
from nldyn.paper.workers import worker_processes


def test_a_value_is_computed_once(tmp_path):
    calls = []

    def square(x):
        calls.append(x)
        return x * x

    assert [kept(tmp_path / "nine.pickle", square, 3) for _ in range(3)] == [9, 9, 9]
    assert calls == [3]
    assert [path.name for path in tmp_path.iterdir()] == ["nine.pickle"]


def test_a_damaged_file_and_a_folder_that_is_gone_do_no_harm(tmp_path):
    path = tmp_path / "value.pickle"
    path.write_bytes(b"\x80\x05cut")
    assert kept(path, abs, -3) == 3
    assert kept(path, abs, -4) == 3  # written anew
    assert kept(tmp_path / "gone" / "value.pickle", abs, -5) == 5


def test_no_damage_to_a_file_gives_another_value(tmp_path):
    path = tmp_path / "value.pickle"
    keep(path, [1.5, "text", bytes(20)])
    written = path.read_bytes()
    for place in range(len(written)):
        path.write_bytes(written[:place])
        assert read_kept(path) is None
        path.write_bytes(written[:place] + bytes([written[place] ^ 4]) + written[place + 1 :])
        assert read_kept(path) is None


def test_a_value_that_cannot_be_kept_leaves_what_was_kept_before(tmp_path):
    class Unwritable:
        def __reduce__(self):
            raise ZeroDivisionError

    path = tmp_path / "value.pickle"
    keep(path, "before")
    with pytest.raises(ZeroDivisionError):
        keep(path, [bytes(10**6), Unwritable()])
    assert read_kept(path) == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_processes_take_what_an_earlier_run_has_kept(tmp_path):
    for argument in (-2, -5):  # the second run asks for the same, and its function is not called
        with worker_processes(1, tmp_path) as workers:
            found = workers.values({"two": workers.submit("two", abs, argument)}, "numbers")
        assert found == {"two": 2}


def test_what_other_code_computed_is_removed(tmp_path, monkeypatch):
    results = tmp_path / "paper"
    folder = kept_folder(results)
    (folder / "value.pickle").write_bytes(b"1")
    assert kept_folder(results) == folder
    assert (folder / "value.pickle").exists()
    monkeypatch.setattr(nldyn.paper.kept, "BESIDE", ())  # other sources count
    other = kept_folder(results)
    assert other != folder and not folder.exists()
    assert list(unfinished_folder(results).iterdir()) == [other]
