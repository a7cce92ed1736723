"""The same input gives the same bits: again, in another process, with any number of workers."""

import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from killing import same_results

from nldyn import study
from nldyn.resources import example

START = "from nldyn.command import main; main()"


def test_two_processes_give_the_same_bytes(tmp_path):
    """With another order of sets and dictionaries, and other numbers of threads."""
    text = example("bilinear_modal.toml").read_text()
    text = text.replace("[8.0, 30.0]", "[12.0, 16.0]\nsearch_points = 1\nrtol = 1e-7")
    scene = tmp_path / "scene.toml"
    scene.write_text(text.replace("max_step = 0.02", "max_step = 0.1"))
    for seed in ("1", "2"):
        threads = {f"{name}_NUM_THREADS": seed for name in ("OPENBLAS", "OMP", "NUMBA")}
        subprocess.run(
            [sys.executable, "-c", START, "run", str(scene), "--out", str(tmp_path / seed)],
            check=True, timeout=300, capture_output=True,
            env={**os.environ, "PYTHONHASHSEED": seed, **threads},
        )  # fmt: skip
    same_results(tmp_path / "1", tmp_path / "2")


def response(system):
    """A number that depends on every mode."""
    _, found = system.response(2.0 * np.pi * 14.0)
    return {"size": float(np.abs(found).sum())}


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_a_study_is_the_same_with_any_number_of_workers(workers):
    values = {
        "excitation.0.amplitude": [0.1, 0.2, 0.3],
        "damping.modal_ratio": [[0.01, 0.02], [0.03, 0.04]],
    }
    alone = study(example("bilinear_modal.toml"), values, response)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        found = study(example("bilinear_modal.toml"), values, response, executor=pool)
    assert found.identical(alone)
    assert len(np.unique(found["size"])) == 6
