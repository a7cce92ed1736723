"""The same input gives the same bits: again, in another process, with any number of workers.

These tests are slow; in the gate test_faults_machine.py has another process on one core.
"""

import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from killing import same_results
from paper.jobs import JOBS, diagrams_of, tasks_of
from paper.workers import worker_processes

from nldyn import StatePlane, basins, parameter_study, simulate, sweep
from nldyn.base.resources import example
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene

START = "from nldyn.app.command import main; main()"


@pytest.mark.slow
def test_two_processes_give_the_same_bytes(tmp_path):
    """With another order of sets and dictionaries, and other numbers of threads."""
    text = example("bilinear_modal.toml").read_text()
    text = text.replace("[8.0, 30.0]", "[12.0, 13.0]\nsearch_points = 1\nrtol = 1e-7")
    scene = tmp_path / "scene.toml"
    scene.write_text(text.replace("max_step = 0.02", "max_step = 0.1"))
    for seed in ("1", "2"):
        threads = {f"{name}_NUM_THREADS": seed for name in ("OPENBLAS", "OMP")}
        subprocess.run(
            [sys.executable, "-c", START, "run", str(scene), "--out", str(tmp_path / seed),
             "--jobs", "1"],
            check=True, timeout=300, capture_output=True,
            env={**os.environ, "PYTHONHASHSEED": seed, **threads},
        )  # fmt: skip
    same_results(tmp_path / "1", tmp_path / "2")


@pytest.mark.slow
def test_diagrams_of_the_paper_are_the_same_with_any_number_of_workers(tmp_path):
    """Two of its jobs, whose branches keep states and numbers, compared to the last bit."""
    names = ("two_dof.high", "two_dof.bilinear")
    jobs = [job for job in JOBS if job.name in names]
    found = {}
    for workers in (1, 3):
        (tmp_path / str(workers)).mkdir()
        with worker_processes(workers, quiet=True) as processes:
            diagrams = diagrams_of(processes.values(tasks_of(jobs, tmp_path / str(workers))))
        for name, diagram in diagrams.items():
            found[name, workers] = [contents(branch) for branch in diagram.branches]
    for name in names:
        assert len(found[name, 1]) > 0
        assert found[name, 1] == found[name, 3]


def contents(branch):
    """Name, states with their frequencies, multipliers and special points of a branch."""
    states = np.array([node.orbit.point for node in branch.nodes])
    multipliers = np.array([node.orbit.multipliers for node in branch.nodes])
    marks = [(mark.kind, mark.frequency_hz) for mark in branch.special_points]
    return branch.name, states.tobytes(), multipliers.tobytes(), marks


def executors():
    """Threads and processes, one to three of them."""
    return [
        *(ThreadPoolExecutor(count) for count in (1, 3)),
        *(ProcessPoolExecutor(count, get_context("spawn")) for count in (1, 2, 3)),
    ]


@pytest.mark.slow
def test_motions_and_basins_are_the_same_with_any_executor():
    """To the last bit, alone, with threads and with processes."""
    system = build_system(load_scene(example("one_dof.toml")))
    corner = StatePlane(
        np.zeros(2), np.array([1e-3, 0.0]), np.array([0.0, 0.1]), (-1.0, 1.0), (-1.0, 1.0)
    )

    def computed(executor):
        motions = simulate(system, [25.0, 36.0, 50.0], 20, executor=executor)
        ramps = [(30.0, 34.0), (34.0, 30.0), (50.0, 48.0)]
        motions += sweep(system, ramps, 10.0, executor=executor)
        found = basins(system, 50.0, corner, shape=(6, 6), starts=4, checks=2, executor=executor)
        arrays = [motion.states(np.linspace(0.0, motion.end_time, 50)) for motion in motions]
        return [*arrays, found.labels, found.periods, *(a.states for a in found.attractors)]

    alone = computed(None)
    for pool in executors():
        with pool:
            found = computed(pool)
        assert len(found) == len(alone)
        for one, other in zip(alone, found, strict=True):
            np.testing.assert_array_equal(one, other)


def response(system):
    """A number that depends on every mode."""
    found = system.response(2.0 * np.pi * 14.0)
    return {"size": float(np.abs(found.amplitudes).sum())}


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 3])
def test_a_study_is_the_same_with_any_number_of_workers(workers):
    values = {
        "excitation.0.amplitude": [0.1, 0.2, 0.3],
        "damping.modal_ratio": [[0.01, 0.02], [0.03, 0.04]],
    }
    alone = parameter_study(example("bilinear_modal.toml"), values, response)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        found = parameter_study(example("bilinear_modal.toml"), values, response, executor=pool)
    assert found.identical(alone)
    assert len(np.unique(found["size"])) == 6
