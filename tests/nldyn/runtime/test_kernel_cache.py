"""Compiled code that is kept must not outlive its sources."""

from __future__ import annotations

import errno
import gc
import subprocess
import sys

import numba
import pytest
from numba.core.caching import IndexDataCacheFile

from nldyn.flow.kernels.newton import newton
from nldyn.flow.kernels.sample import local_extremes, sample_states
from nldyn.runtime.kernel_cache import first_call, resting_on


def double(x):
    return 2 * x


def whole_share(x):
    return 1 // x


def test_kept_code_is_outdated_when_a_file_it_rests_on_changes(tmp_path):
    source = tmp_path / "source.py"
    stamps = []
    for text in ("a", "b", "b"):
        source.write_text(text)
        kernel = resting_on(numba.njit(cache=True), str(source))(double)
        stamps.append(kernel._cache._cache_file._source_stamp)
    assert stamps[0] != stamps[1] == stamps[2]


def test_kernels_that_call_those_of_another_file_rest_on_it():
    for kernel in (newton, local_extremes, sample_states):
        assert isinstance(kernel._cache._cache_file._source_stamp, tuple)


@pytest.mark.parametrize("collecting", [True, False])
def test_the_collector_rests_during_a_first_call_and_is_as_before_afterwards(collecting):
    was = gc.isenabled()
    try:
        (gc.enable if collecting else gc.disable)()
        kernel = numba.njit(double)
        compile_it, seen = kernel.compile, []
        kernel.compile = lambda signature: (seen.append(gc.isenabled()), compile_it(signature))
        assert first_call(kernel, 21) == 42
        assert seen == [False]
        assert gc.isenabled() is collecting
        with pytest.raises(ZeroDivisionError):
            first_call(numba.njit(whole_share), 0)
        assert gc.isenabled() is collecting
    finally:
        (gc.enable if was else gc.disable)()


INTERRUPTED = """
import _thread, signal, threading
import numpy as np
import nldyn.runtime.kernel_cache
from nldyn import FlowMap, Stop, System

usual = nldyn.runtime.kernel_cache.deferred_interruption
def deferred_interruption():
    threading.Timer(0.2, _thread.interrupt_main).start()
    return usual()
nldyn.runtime.kernel_cache.deferred_interruption = deferred_interruption
signal.signal(signal.SIGINT, signal.default_int_handler)
flow = FlowMap(System.from_modal([13.0], {"a": [1.0]}, stops=[Stop("a", 1e9)]))
try:
    flow.shoot(np.ones((1, 2)), np.arange(0.0, 60001.0), 100.0, sensitivities=False, chained=True)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_ctrl_c_during_the_first_call_of_the_kernel_is_no_crash():
    found = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=300
    )
    assert (found.returncode, found.stdout) == (0, "interrupted\n"), found.stderr


def test_code_that_cannot_be_kept_is_used_and_told_of_once(monkeypatch, capsys):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    assert [numba.njit(cache=True)(double)(x) for x in (2, 3)] == [4, 6]
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "compiled code cannot be kept in" in said
    assert "no space left on device" in said
