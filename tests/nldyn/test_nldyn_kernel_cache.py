"""Compiled code that is kept must not outlive its sources."""

from __future__ import annotations

import numba

from nldyn._sample import local_extremes, sample_states, state_at
from nldyn.kernel_cache import resting_on


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
