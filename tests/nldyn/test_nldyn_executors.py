"""The same results here, on threads, on processes, and on a cluster that loses a worker."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import cluster_tasks
import numpy as np
import pytest
from one_dof import make_one_dof

from nldyn import (
    FlowMap,
    Plane,
    SystemModelError,
    TaskError,
    basins,
    brute_force,
    executors,
    run_all,
    simulate,
)
from nldyn.executors import as_finished


def processes(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"))


@pytest.fixture(scope="module")
def plane():
    return Plane.at_interface(make_one_dof(), (-3e-4, 0.4e-4), (-0.05, 0.05))


@pytest.fixture(scope="module")
def here(plane):
    return basins(make_one_dof(), 25.3, plane, shape=(30, 40), starts=3, checks=3)


def test_failures_are_kept_beside_results():
    counts = []
    with ThreadPoolExecutor(2) as pool:
        for executor in (None, pool):
            found = run_all(
                cluster_tasks.square, [1, 2, 3, 4], executor, lambda *done: counts.append(done)
            )
            assert [outcome.value for outcome in found] == [1, 4, None, 16]
            assert found[2].failure == "ValueError: three is refused"
            assert counts[-1] == (4, 4)
            with pytest.raises(TaskError, match="computation 2 failed: ValueError: three"):
                found[2].value_or_raise()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_case_that_kills_its_process_fails_alone(workers):
    with processes(workers) as pool:
        for items in ([0, 1, 2, 3], [4, 5]):  # the pool stays broken
            found = run_all(cluster_tasks.die, items, pool)
            assert [outcome.value for outcome in found] == [i if i != 1 else None for i in items]
            assert all(("BrokenProcessPool" in o.failure) == (i == 1)
                       for i, o in zip(items, found, strict=True))  # fmt: skip


def test_processes_that_always_end_are_given_up(monkeypatch):
    monkeypatch.setattr(executors, "HOPELESS", 2)
    with processes(1) as pool:
        found = run_all(cluster_tasks.die, [1, 1, 1, 1], pool)
    assert all("BrokenProcessPool" in outcome.failure for outcome in found)
    assert "2 processes ended one after the other" in found[3].failure


def test_an_executor_of_a_wrong_kind_is_named():
    with pytest.raises(SystemModelError, match="executor must be an Executor or None, got 2"):
        run_all(cluster_tasks.square, [1], 2)


def wrapped_interrupt(value):
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as error:
        raise SystemError("a kernel returned a result with an exception set") from error


def test_ctrl_c_is_no_failure_of_a_case():
    with pytest.raises(KeyboardInterrupt):
        run_all(wrapped_interrupt, [1, 2])
    with ThreadPoolExecutor(1) as pool, pytest.raises(KeyboardInterrupt):
        run_all(wrapped_interrupt, [1, 2], pool)


def test_ctrl_c_in_a_compiled_kernel_ends_all_cases():
    flow = FlowMap(make_one_dof())
    simulate(flow, 36.0, 1)  # compiled before the signal comes
    begun = []

    def case(index):
        begun.append(index)
        if index == 0:
            signal.setitimer(signal.ITIMER_REAL, 0.05)
        simulate(flow, 36.0, 1, transient=10**7)

    def stop(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    try:
        with pytest.raises(KeyboardInterrupt):
            run_all(case, range(3))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert begun == [0]


def test_a_caller_may_stop_early():
    with ThreadPoolExecutor(1) as pool:
        results = as_finished(cluster_tasks.worker, range(50), pool)
        next(results)
        results.close()


def test_threads_give_the_same_basins(plane, here):
    with ThreadPoolExecutor(2) as pool:
        found = basins(
            make_one_dof(), 25.3, plane, shape=(30, 40), starts=3, checks=3, executor=pool
        )
    np.testing.assert_array_equal(found.labels, here.labels)
    np.testing.assert_array_equal(found.periods, here.periods)


def test_processes_give_the_same_diagram():
    alone = brute_force(make_one_dof(), (35.0, 38.0), points=4)
    with processes(2) as pool:
        found = brute_force(make_one_dof(), (35.0, 38.0), points=4, executor=pool)
    for a, b in zip(alone.columns, found.columns, strict=True):
        assert a.attractor.name == b.attractor.name
        np.testing.assert_array_equal(a.peaks, b.peaks)


def test_a_cluster_that_loses_a_worker_gives_the_same_basins(plane, here, tmp_path):
    distributed = pytest.importorskip("distributed")
    import dask

    settings = {"distributed.worker.daemon": False, "distributed.comm.timeouts.connect": "20s"}
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None,
            local_directory=str(tmp_path),
        ) as cluster,
        distributed.Client(cluster) as client,
    ):  # fmt: skip
        pids = list(client.run(os.getpid).values())
        assert len(set(pids)) == 3
        killed = []

        def kill_one(done: int, total: int) -> None:
            if done == 1 and total > 4 and not killed:
                os.kill(pids[0], signal.SIGKILL)
                killed.append(pids[0])

        found = basins(
            make_one_dof(), 25.3, plane, shape=(30, 40), starts=3, checks=3,
            executor=client.get_executor(), progress=kill_one,
        )  # fmt: skip
        assert killed
    np.testing.assert_array_equal(found.labels, here.labels)
    np.testing.assert_array_equal(found.periods, here.periods)
    assert found.wrong == here.wrong == 0
