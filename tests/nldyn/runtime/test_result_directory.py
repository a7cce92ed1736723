"""Results appear whole or not at all, and nobody's files are lost."""

import os
import sys
from multiprocessing import get_context

import pytest

from nldyn.runtime.result_directory import OutputError, check_directory, result_directory


def write(place, kind="run", **files):
    with result_directory(place, kind) as folder:
        for name, text in files.items():
            (folder / name).write_text(text)


def visible(place):
    return {p.name: p.read_text() for p in place.iterdir() if not p.name.startswith(".")}


def leftovers(place):
    return [p.name for p in place.parent.iterdir() if p != place]


def test_new_directory_with_parents(tmp_path):
    place = tmp_path / "a" / "b" / "results"
    write(place, table="1")
    assert visible(place) == {"table": "1"}
    assert leftovers(place) == []


def test_nothing_is_there_before_the_end(tmp_path):
    place = tmp_path / "results"
    with result_directory(place, "run") as folder:
        (folder / "table").write_text("1")
        assert not place.exists()
    assert place.exists()


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_failure_midway_leaves_nothing(tmp_path, error):
    place = tmp_path / "a" / "results"
    with pytest.raises(error), result_directory(place, "run") as folder:
        (folder / "table").write_text("1")
        raise error
    assert list(tmp_path.iterdir()) == []


def test_failure_midway_leaves_the_earlier_results(tmp_path):
    place = tmp_path / "results"
    write(place, table="1")
    with pytest.raises(RuntimeError), result_directory(place, "run") as folder:
        (folder / "table").write_text("2")
        raise RuntimeError
    assert visible(place) == {"table": "1"}
    assert leftovers(place) == []


def test_failure_of_the_last_rename_puts_the_old_results_back(tmp_path, monkeypatch):
    place = tmp_path / "results"
    write(place, table="1")
    rename = os.rename
    monkeypatch.setattr(
        "pathlib.Path.rename",
        lambda self, to: rename(self, to) if not self.name.endswith(".new") else os.stat("/none"),
    )
    with pytest.raises(OutputError, match="cannot be written"):
        write(place, table="2")
    assert visible(place) == {"table": "1"}
    assert leftovers(place) == []


def test_second_run_replaces_the_first(tmp_path):
    place = tmp_path / "results"
    write(place, table="1", old="1")
    write(place, table="2")
    assert visible(place) == {"table": "2"}


def test_other_files_and_other_kinds_are_kept(tmp_path):
    place = tmp_path / "results"
    write(place, table="1")
    write(place, "render", picture="1")
    (place / "notes").write_text("mine")
    (place / "more").mkdir()
    (place / "more" / "deep").write_text("mine too")
    write(place, table="2")
    write(place, "render", picture="2")
    assert (place / "more" / "deep").read_text() == "mine too"
    (place / "more" / "deep").unlink()
    (place / "more").rmdir()
    assert visible(place) == {"table": "2", "picture": "2", "notes": "mine"}


def test_empty_directory_is_used(tmp_path):
    place = tmp_path / "results"
    place.mkdir()
    write(place, table="1")
    assert visible(place) == {"table": "1"}


def test_link_to_a_directory_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    place = tmp_path / "link"
    place.symlink_to("real")
    write(place, table="1")
    assert place.is_symlink()
    assert visible(tmp_path / "real") == {"table": "1"}


def test_somebody_elses_directory_is_refused(tmp_path):
    (tmp_path / "notes").write_text("mine")
    with pytest.raises(OutputError, match="not written by nldyn"):
        write(tmp_path, table="1")
    assert visible(tmp_path) == {"notes": "mine"}


def test_file_is_refused(tmp_path):
    place = tmp_path / "results"
    place.write_text("")
    with pytest.raises(OutputError, match="is a file"):
        check_directory(place)
    with pytest.raises(OutputError, match="cannot be made: Not a directory"):
        check_directory(place / "below")


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_a_place_that_refuses_folders_is_found_before_the_work():
    with pytest.raises(OutputError, match="/proc/foo: cannot be made"):
        check_directory("/proc/foo")


def test_a_name_that_is_too_long_is_found_before_the_work(tmp_path):
    with pytest.raises(OutputError, match="cannot be made: File name too long"):
        check_directory(tmp_path / ("x" * 250))


def test_a_mount_point_cannot_be_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr("pathlib.Path.is_mount", lambda _: True)
    with pytest.raises(OutputError, match="cannot be replaced; choose a folder in it"):
        check_directory(tmp_path)


def test_checking_leaves_nothing(tmp_path):
    check_directory(tmp_path / "a" / "results")
    assert list(tmp_path.iterdir()) == []


def test_permissions_are_those_of_any_new_directory(tmp_path):
    (tmp_path / "plain").mkdir()
    write(tmp_path / "results", table="1")
    assert (tmp_path / "results").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_permissions_of_a_directory_that_is_there_are_kept(tmp_path):
    place = tmp_path / "results"
    write(place, table="1")
    place.chmod(0o700)
    write(place, table="2")
    assert visible(place) == {"table": "2"}
    assert place.stat().st_mode & 0o777 == 0o700


def test_read_only_directory_is_refused(tmp_path):
    place = tmp_path / "results"
    write(place, table="1")
    place.chmod(0o555)
    with pytest.raises(OutputError, match="results: is read-only; choose another directory"):
        write(place, table="2")
    place.chmod(0o755)
    assert visible(place) == {"table": "1"}


def write_often(place):
    """Refusals of thirty runs one after the other."""
    refused = []
    for _ in range(30):
        try:
            write(place, table="1")
        except OutputError as error:
            refused.append(str(error))
    return refused


def test_runs_that_end_at_the_same_time_in_one_place_are_all_written(tmp_path):
    """They make and remove the same parents, and replace each other's results."""
    place = tmp_path / "a" / "b" / "results"
    with get_context("spawn").Pool(4) as pool:
        assert pool.map(write_often, [place] * 4, chunksize=1) == [[]] * 4
    assert visible(place) == {"table": "1"}
    assert leftovers(place) == []
