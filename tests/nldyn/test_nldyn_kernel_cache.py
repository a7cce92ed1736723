"""Compiled code that is kept must not outlive its sources."""

from __future__ import annotations

import errno
import gc

import numba
import pytest
from numba.core.caching import IndexDataCacheFile

from nldyn._sample import local_extremes, sample_states, state_at
from nldyn.kernel_cache import first_call, resting_on


def double(x):
    return 2 * x


def test_kept_code_is_outdated_when_a_file_it_rests_on_changes(tmp_path):
    source = tmp_path / "source.py"
    stamps = []
    for text in ("a", "b", "b"):
        source.write_text(text)
        kernel = resting_on(numba.njit(cache=True), str(source))(double)
        stamps.append(kernel._cache._cache_file._source_stamp)
    assert stamps[0] != stamps[1] == stamps[2]


def test_kernels_that_call_those_of_another_file_rest_on_it():
    for kernel in (local_extremes, sample_states, state_at):
        assert isinstance(kernel._cache._cache_file._source_stamp, tuple)


@pytest.mark.parametrize("collecting", [True, False])
def test_the_collector_rests_during_a_first_call_and_is_as_before_afterwards(collecting):
    was = gc.isenabled()
    try:
        (gc.enable if collecting else gc.disable)()
        assert first_call(gc.isenabled) is False
        assert gc.isenabled() is collecting
        with pytest.raises(ZeroDivisionError):
            first_call(divmod, 1, 0)
        assert gc.isenabled() is collecting
    finally:
        (gc.enable if was else gc.disable)()


def test_code_that_cannot_be_kept_is_used_and_told_of_once(monkeypatch, capsys):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    assert [numba.njit(cache=True)(double)(x) for x in (2, 3)] == [4, 6]
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "compiled code cannot be kept in" in said
    assert "no space left on device" in said
