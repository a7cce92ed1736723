"""The same results here, on threads, on processes, and on a cluster that loses a worker."""

from __future__ import annotations

import multiprocessing
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager

import cluster_tasks
import numpy as np
import pytest
from problems import make_one_dof

from nldyn import (
    FlowMap,
    StatePlane,
    Stop,
    SystemModelError,
    basins,
    classify_attractor,
    find_attractors,
    impacts,
    lyapunov_exponents,
    simulate,
    solve_orbit,
    sweep,
)
from nldyn.base.resources import example
from nldyn.longterm import basin_edge, brute_force, contact_measures, stable_manifold
from nldyn.longterm.measures import measures_table
from nldyn.runtime import executors, run_all
from nldyn.runtime.executors import TaskError, as_finished, process_pool
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene


def processes(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"))


HERTZ = (25.3, 29.0, 33.0, 36.0, 41.0, 50.0)


def swept_both_ways(executor, progress):
    ranges = [(20.0, 24.0), (24.0, 20.0), (28.0, 30.0), (30.0, 28.0), (24.0, 25.0), (25.0, 24.0)]
    motions = sweep(make_one_dof(), ranges, 4.0, executor=executor, progress=progress)
    assert [motion.frequency_hz(motion.start_time) > motion.frequency_hz(motion.end_time)
            for motion in motions] == [False, True] * 3  # fmt: skip
    return [motion.period_peaks() for motion in motions]


def simulated(executor, progress):
    starts = np.linspace(-1e-4, 1e-4, 12).reshape(6, 2)
    motions = simulate(make_one_dof(), HERTZ, 40, start=starts, transient=50,
                       executor=executor, progress=progress)  # fmt: skip
    return [(motion.end, motion.strobe, impacts(motion).impulse) for motion in motions]


def exponents(executor, progress):
    found = lyapunov_exponents(
        make_one_dof(), HERTZ, periods=64, executor=executor, progress=progress
    )
    return [(s.frequency_hz, s.exponents, s.errors, s.divergence, s.end) for s in found]


def measured(executor, progress):
    attractors = [
        classify_attractor(make_one_dof(), hz) for hz in (36.0, 50.0)
    ]  # chaos and an orbit
    sources = [*attractors, *simulate(make_one_dof(), HERTZ[:3], 50)]
    table = measures_table(sources, periods=50, executor=executor, progress=progress)
    return [column.astype(str) for column in table.values()]


def manifold(executor, progress):
    system = make_one_dof()
    saddle = solve_orbit(system, 50.0)
    plane = StatePlane.at_interface(system, (-2e-4, 0.0), (-0.05, 0.05))
    return stable_manifold(saddle, plane, max_points=60, executor=executor, progress=progress)


LISTS = [swept_both_ways, simulated, exponents, measured, manifold]


def assert_same_numbers(here, there):
    assert len(here) == len(there) > 0
    for one, other in zip(here, there, strict=True):
        if isinstance(one, tuple):
            assert_same_numbers(one, other)
        else:
            np.testing.assert_array_equal(one, other)


@pytest.fixture(scope="module")
def alone():
    """What each list of computations gives here, one after the other."""
    return {compute: compute(None, None) for compute in LISTS}


@pytest.fixture(scope="module")
def plane():
    return StatePlane.at_interface(make_one_dof(), (-3e-4, 0.4e-4), (-0.05, 0.05))


@pytest.fixture(scope="module")
def here(plane):
    return basins(make_one_dof(), 25.3, plane, shape=(12, 16), starts=3, checks=3)


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


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 2])
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
        raise SystemError("a library returned a result with an exception set") from error


def test_ctrl_c_is_no_failure_of_a_case():
    with pytest.raises(KeyboardInterrupt):
        run_all(wrapped_interrupt, [1, 2])
    with ThreadPoolExecutor(1) as pool, pytest.raises(KeyboardInterrupt):
        run_all(wrapped_interrupt, [1, 2], pool)


def test_ctrl_c_in_the_engine_ends_all_cases():
    flow = FlowMap(make_one_dof())
    simulate(flow, 36.0, 1)
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


def test_what_an_alarm_raises_comes_out_of_the_engine_as_it_is():
    """A time limit, say."""
    flow = FlowMap(make_one_dof())
    simulate(flow, 36.0, 1)

    def too_late(number, frame):
        raise TimeoutError("too late")

    before = signal.signal(signal.SIGALRM, too_late)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(TimeoutError, match="too late"):
            simulate(flow, 36.0, 1, transient=10**7)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_the_engine_lets_other_threads_go_on():
    """With the interpreter's lock held there would be two or three turns, however long the call."""
    flow = FlowMap(make_one_dof())
    start = flow.to_state(simulate(flow, 36.0, 1).end)[None]
    with ThreadPoolExecutor(1) as pool:
        for doublings in range(8):  # until the call is long enough, whatever the machine
            phases = 2.0 * np.pi * np.arange(2000 * 2**doublings + 1)
            call = pool.submit(
                flow.shoot, start, phases, 72.0 * np.pi, sensitivities=False, chained=True
            )
            turns = 0
            while not call.done():
                time.sleep(0.001)
                turns += 1
            assert not call.result().failure
            if turns > 20:
                return
    pytest.fail("the other thread stood still")


def test_a_caller_may_stop_early():
    with ThreadPoolExecutor(1) as pool:
        results = as_finished(cluster_tasks.worker, range(50), pool)
        next(results)
        results.close()


def test_threads_give_the_same_basins(plane, here):
    with ThreadPoolExecutor(2) as pool:
        found = basins(
            make_one_dof(), 25.3, plane, shape=(12, 16), starts=3, checks=3, executor=pool
        )
    np.testing.assert_array_equal(found.labels, here.labels)
    np.testing.assert_array_equal(found.periods, here.periods)


@pytest.mark.slow
def test_processes_give_the_same_diagram():
    alone = brute_force(make_one_dof(), (35.0, 38.0), points=4)
    with processes(2) as pool:
        found = brute_force(make_one_dof(), (35.0, 38.0), points=4, executor=pool)
    for a, b in zip(alone.columns, found.columns, strict=True):
        assert a.attractor.name == b.attractor.name
        np.testing.assert_array_equal(a.peaks, b.peaks)


@pytest.mark.parametrize("compute", LISTS)
def test_threads_give_the_same_numbers(compute, alone):
    counts = []
    with ThreadPoolExecutor(2) as pool:
        found = compute(pool, lambda *done: counts.append(done))
    assert_same_numbers(alone[compute], found)
    assert counts[-1][0] == counts[-1][1] >= 2


@pytest.mark.slow  # 20 s
def test_processes_give_the_same_numbers(alone):
    with processes(2) as pool:
        for compute in LISTS:
            assert_same_numbers(alone[compute], compute(pool, None))


def test_a_law_of_ones_own_goes_to_another_process_and_back():
    """Its machine code lies elsewhere there: what is sent must not hold its address."""
    stop = Stop("middle", 5e7, 1.0, law=cluster_tasks.lossy_spring)
    system = make_one_dof(stops=[stop])
    here = classify_attractor(system, 50.0)
    contact_measures(here)  # compiles the law
    with processes(1) as pool:
        [there] = [
            share.attractor for share in find_attractors(system, 50.0, starts=1, executor=pool)
        ]
        measured = measures_table([here, there], executor=pool)
    assert set(vars(there.flow)) <= {"system", "options", "clock"}  # nothing that was compiled
    assert there.name == here.name == "period 2"
    assert contact_measures(there) == contact_measures(here)
    assert (
        measured["peak_force"][0] == measured["peak_force"][1] == contact_measures(here).peak_force
    )


def test_a_list_of_one_is_what_the_single_call_gives():
    system = make_one_dof()
    (motion,) = simulate(system, [36.0], 50, transient=100)
    np.testing.assert_array_equal(motion.end, simulate(system, 36.0, 50, transient=100).end)
    (run_up,) = sweep(system, [(20.0, 21.0)], 1.0)
    np.testing.assert_array_equal(run_up.end, sweep(system, (20.0, 21.0), 1.0).end)
    (found,) = lyapunov_exponents(system, np.array([36.0]), periods=64)
    single = lyapunov_exponents(system, 36.0, periods=64)
    np.testing.assert_array_equal(found.exponents, single.exponents)


def test_a_failure_in_a_list_says_which():
    starts = np.array([[0.0, 0.0], [1e300, 0.0]])
    with pytest.raises(TaskError, match="computation 1 failed: ConvergenceError: the motion at 36"):
        simulate(make_one_dof(), [25.3, 36.0], 5, start=starts)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s: simulate(s, [], 5), "at least one frequency, got an empty list"),
        (lambda s: simulate(s, [20.0, -1.0], 5), r"frequency_hz must be positive.* got -1\.0"),
        (lambda s: simulate(s, "20", 5), "frequency_hz must be positive.* got '20'"),
        (lambda s: simulate(s, [20.0, 30.0], 5, start=np.zeros((3, 2))), "3 states for 2 motions"),
        (lambda s: simulate(s, [20.0, 30.0], 5, start=[[0.0], [0.0, 1.0]]), "start must hold numb"),
        (lambda s: simulate(s, 20.0, 5, executor=2), "executor must be an Executor or None"),
        (lambda s: lyapunov_exponents(s, [20.0, None]), "frequency_hz must be positive"),
        (lambda s: lyapunov_exponents(s, 20.0, progress=2), "progress must be a function or None"),
        (lambda s: sweep(s, [(20.0, 30.0), (30.0, 30.0)], 1.0), "begins and ends at 30 Hz"),
        (lambda s: sweep(s, [(20.0, 30.0), (30.0, 20.0)], 1e-9), "choose a higher rate"),
        (lambda s: sweep(s, None, 1.0), "range_hz must be two frequencies, got None"),
    ],
)
def test_bad_lists_are_refused_before_anything_is_computed(call, said):
    with pytest.raises(SystemModelError, match=said):
        call(make_one_dof())


@pytest.fixture
def cluster(tmp_path):
    """A client of three new worker processes: one that was killed is not always started again."""
    distributed = pytest.importorskip("distributed")
    import dask

    settings = {"distributed.worker.daemon": False, "distributed.comm.timeouts.connect": "20s"}
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None,
            local_directory=str(tmp_path / "dask"),
        ) as cluster,
        distributed.Client(cluster) as client,
    ):  # fmt: skip
        yield client


@contextmanager
def one_worker_killed(client) -> Iterator[Executor]:
    """Kill a worker of a cluster while there is something that it was given to do.

    It is stopped before, so that it has not done that, however fast the computations are.
    """
    client.wait_for_workers(3, timeout=120)
    pids = client.run(os.getpid)
    assert len(set(pids.values())) == 3
    address, pid = next(iter(pids.items()))
    lost = []

    def kill() -> None:
        while not lost:
            time.sleep(0.05)
            lost.extend(client.processing()[address])
        os.kill(pid, signal.SIGKILL)

    os.kill(pid, signal.SIGSTOP)
    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    yield client.get_executor()
    killer.join(10.0)
    assert lost


def test_a_cluster_that_loses_a_worker_gives_the_same_basins(plane, here, cluster):
    with one_worker_killed(cluster) as executor:
        found = basins(
            make_one_dof(), 25.3, plane, shape=(12, 16), starts=3, checks=3, executor=executor
        )
    np.testing.assert_array_equal(found.labels, here.labels)
    np.testing.assert_array_equal(found.periods, here.periods)
    assert found.wrong == here.wrong == 0


@pytest.mark.slow
@pytest.mark.parametrize("compute", [swept_both_ways, simulated, exponents, measured])
def test_a_cluster_that_loses_a_worker_gives_the_same_numbers(compute, alone, cluster):
    with one_worker_killed(cluster) as executor:
        found = compute(executor, None)
    assert_same_numbers(alone[compute], found)


@pytest.mark.slow
def test_points_on_the_edge_of_basins_do_not_depend_on_the_executor():
    system = build_system(load_scene(example("two_dof_xi_0.01.toml")))
    plane = StatePlane.at_interface(system, (-3e-5, 1e-5), (-0.006, 0.006))
    found = basins(system, 22.8, plane, shape=(6, 6), starts=8, checks=2)
    points, saddles = basin_edge(found, 4)
    with ThreadPoolExecutor(2) as pool:
        again, others = basin_edge(found, 4, executor=pool)
    np.testing.assert_array_equal(points, again)
    assert [s.period for s in saddles] == [s.period for s in others]


def half_an_answer(told):
    """In a process of a pool: write the beginning of an answer to the pool, and no more."""
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        frame = frame.f_back
    frame.f_locals["result_queue"]._writer._send(struct.pack("!i", 1000) + b"half")
    told.touch()
    time.sleep(600)


def test_a_process_that_is_ended_while_it_answers_does_not_hold_the_program(tmp_path):
    told = tmp_path / "told"
    with process_pool(1) as pool:
        pool.submit(half_an_answer, told)
        while not told.exists():
            time.sleep(0.01)
        reader = pool._executor_manager_thread
    reader.join(timeout=60)
    assert not reader.is_alive()
