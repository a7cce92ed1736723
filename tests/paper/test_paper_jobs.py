"""The diagrams behind the figures: which are computed, from what, and what is kept of them."""

import inspect
import re
from dataclasses import replace

import numpy as np
import pytest

import paper.checks
from nldyn.runtime.progress import silent
from paper.figures import SHOWN
from paper.jobs import (
    COARSE,
    JOBS,
    LOWEST_HZ,
    Follow,
    diagrams_of,
    is_wide,
    job_named,
    run_job,
    tasks_of,
)
from paper.starts import read_starts

NAME = "two_dof_xi_0.001"


@pytest.fixture
def short_job(monkeypatch):
    """The harmonic branches of a model near their peak, and one of period 2."""
    job = replace(
        job_named(NAME), range_hz=(42.0, 44.0), starts=(Follow(1, 1.0), Follow(2, 1.0)),
        quarters_hz=None,
    )  # fmt: skip
    wanted = (21.4537, 42.7222)
    starts = [s for s in read_starts(NAME) if round(s.frequency_hz, 4) in wanted]
    monkeypatch.setattr("paper.jobs.JOBS", (job,))
    monkeypatch.setattr("paper.jobs.read_starts", lambda name: starts)
    return job


def test_the_figures_and_checks_ask_for_diagrams_that_are_computed():
    names = {job.name for job in JOBS}
    assert {job for jobs in SHOWN.values() for job in jobs} <= names
    source = inspect.getsource(paper.checks)
    asked = set(re.findall(r'results\["([\w.]+)"\]', source))
    asked |= set(re.findall(r'partial\(_\w+, "([\w.]+)"', source))
    assert len(asked) > 5
    assert asked <= names


def test_every_start_that_a_job_names_is_kept_and_within_its_range():
    for job in JOBS:
        for follow in job.starts:
            chosen = follow.starts(job.name)
            assert len(chosen) == len(follow.near_hz) or (chosen and not follow.near_hz)
            assert all(job.range_hz[0] <= s.frequency_hz <= job.range_hz[1] for s in chosen)


def test_a_job_is_followed_from_its_starts_once(short_job, tmp_path, monkeypatch):
    """The separate harmonic branch near 23 Hz is closed, with two folds and two flips."""
    tasks = tasks_of((short_job,), tmp_path)
    values = {task.name: task.function(*task.arguments, silent) for task in tasks}
    found = diagrams_of(values)[NAME]
    harmonic = found.of_period(1)
    assert len(harmonic) == 1
    assert found.limits == (LOWEST_HZ, 44.0)
    kinds = [special.kind for special in harmonic[0].special_points]
    assert (kinds.count("LP"), kinds.count("PD")) == (2, 2)
    assert not is_wide(harmonic[0])
    assert all(orbit.motion is None for orbit in harmonic[0].points)
    assert len(found.of_period(2)) == 1
    monkeypatch.setattr("paper.jobs.computed", None)  # what is kept is not computed again
    again = run_job(NAME, 1, tmp_path, silent)
    points = [[orbit.point for orbit in d.of_period(1)[0].points] for d in (found, again)]
    np.testing.assert_array_equal(*points)


def test_a_start_that_is_no_orbit_is_told(short_job, tmp_path, monkeypatch):
    (start,) = [s for s in read_starts(NAME) if s.period == 1 and 21.0 < s.frequency_hz < 22.0]
    wrong = replace(start, state=np.array([1.0, -1.0, 1.0, -1.0]))
    monkeypatch.setattr("paper.jobs.read_starts", lambda name: [wrong])
    found = run_job(NAME, 1, tmp_path, silent)
    assert not found.branches
    (note,) = found.notes
    assert note.startswith("no orbit leads on from the start of period 1 at 21.45")


def test_longer_steps_locate_the_same_special_points(short_job, tmp_path):
    """Shorter ones have more points between them, and the special points where they were."""
    fine = replace(short_job, options=replace(COARSE, max_angle=0.1, grazing_step=0.004))
    marks = []
    for number, job in enumerate((short_job, fine)):
        (folder := tmp_path / str(number)).mkdir()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("paper.jobs.JOBS", (job,))
            (branch,) = run_job(NAME, 1, folder, silent).branches
        marks.append(sorted((s.kind, s.frequency_hz) for s in branch.special_points))
    assert [kind for kind, _ in marks[0]] == [kind for kind, _ in marks[1]]
    for (_, coarse), (_, finer) in zip(*marks, strict=True):
        assert coarse == pytest.approx(finer, rel=1e-7)
