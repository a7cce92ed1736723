"""The diagrams behind the figures: what the paper shows, and no more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import cms
from nldyn.base.resources import example
from nldyn.branches.branch import Branch
from nldyn.branches.step_control import ContinuationOptions
from nldyn.flow.flow_map import flow_of
from nldyn.orbits.axis import Axis
from nldyn.orbits.orbit import check_observe
from nldyn.orbits.starts import orbit_near
from nldyn.runtime.progress import Progress, silent
from nldyn.scene.build import build_system
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene
from nldyn.search.collector import Collector
from nldyn.search.diagram import Diagram, SubharmonicSeed, diagram
from nldyn.system.stop import Stop
from nldyn.system.system import System
from paper.kept import kept_diagram
from paper.starts import LOST, Start, is_at, keep_numbers, read_starts
from paper.workers import Task

BILINEAR_ALPHA = 790.0  # section 3, from equation 3.2
STIFFNESS = 16877.0  # N/m, section 3
HERTZ_STIFFNESS = 5.17e9  # N/m^1.5, half of what sections 2 and 3 print for the whole beam
PART = ", period "  # between the name of a job and what of it is computed
LOWEST_HZ = 5.0
WIDE_HZ = 4.0  # width of the subharmonic branches that the figures show
NEAR_HZ = 0.005  # of a start to the frequency by which it is called

FINE = ContinuationOptions()
# Steps as long as smooth curves and the special points allow. A branch that is cut off by
# max_points would be found and followed again from the next orbit.
COARSE = ContinuationOptions(max_angle=0.3, max_miss=0.2, grazing_step=0.02, max_points=8000)


@dataclass(frozen=True)
class Follow:
    """Kept starts whose branches are followed.

    Parameters
    ----------
    period : int
        Their period multiple.
    weight : float
        Seconds that it takes, as measured.
    near_hz : tuple of float
        Their frequencies in Hz, within `NEAR_HZ`; all of this period if there are none.
    """

    period: int
    weight: float
    near_hz: tuple[float, ...] = ()

    def starts(self, name: str) -> list[Start]:
        """Those of a model."""
        found = [start for start in read_starts(name) if start.period == self.period]
        return [start for start in found if not self.near_hz or self._wants(start)]

    def _wants(self, start: Start) -> bool:
        return any(abs(start.frequency_hz - hz) < NEAR_HZ for hz in self.near_hz)


@dataclass(frozen=True)
class Job:
    """One diagram to compute.

    Parameters
    ----------
    name : str
        Key of the result.
    system : callable
        Gives the system.
    range_hz : (float, float)
        Frequencies.
    periods : tuple of int
        Period multiples wanted everywhere in the range.
    seeds : tuple of SubharmonicSeed
        Further orbits to look for.
    search_points : int
        Frequencies searched.
    options : ContinuationOptions
        Step control.
    quarters_hz : float, optional
        Frequency from which on flips of wide 1/2 branches are followed to 1/4 branches.
    starts : tuple of Follow
        Kept starts; the harmonic branches reach down to `LOWEST_HZ`. If there are any, nothing is
        searched.
    weight : float
        Seconds that it takes otherwise, as measured.
    """

    name: str
    system: Callable[[], System]
    range_hz: tuple[float, float]
    periods: tuple[int, ...] = (1,)
    seeds: tuple[SubharmonicSeed, ...] = ()
    search_points: int = 12
    options: ContinuationOptions = FINE
    quarters_hz: float | None = None
    starts: tuple[Follow, ...] = ()
    weight: float = 1.0


def scene_system(name: str) -> System:
    """System of an example scene."""
    return build_system(load_scene(example(f"{name}.toml")))


def bilinear_system() -> System:
    """Two modes against a linear one-sided spring with α = 790 (section 4)."""
    stop = Stop.linear("middle", BILINEAR_ALPHA * STIFFNESS)
    return replace(scene_system("two_dof_xi_0.01"), stops=(stop,))


def undamped_system() -> System:
    """Two modes without modal damping: only the damper at the middle is left."""
    system = scene_system("two_dof_xi_0.01")
    return replace(system, damping=0.0 * system.damping)


def five_dof_system() -> System:
    """Four free-interface modes and the residual flexibility (section 5)."""
    base = scene_system("four_dof_xi_0.01")
    component = build_component(load_scene(example("four_dof_xi_0.01.toml")))
    return System.from_reduced(
        cms.reduce(component, modes=4),
        modal_damping=0.01,
        stops=base.stops,
        dampers=base.dampers,
        excitation=base.excitation,
    )


def _scene(name: str) -> Callable[[], System]:
    return lambda: scene_system(name)


# The subharmonics of the 1-DOF model that section 3 lists, beside the main 1/2 and 1/3.
LISTED = tuple(
    SubharmonicSeed(period, hz)
    for period, hz in (
        (3, 37.1), (5, 62.2), (2, 16.1), (4, 33.0), (7, 58.0),
        (10, 83.0), (3, 18.4), (5, 31.0), (9, 56.0), (13, 81.0),
    )
)  # fmt: skip

JOBS: tuple[Job, ...] = (
    Job(
        "four_dof_xi_0.001",
        _scene("four_dof_xi_0.001"),
        (18.0, 90.0),
        options=COARSE,
        starts=(
            Follow(1, 70.0),
            Follow(2, 60.0, (36.788, 52.152, 81.744)),
            Follow(3, 20.0, (58.997,)),
        ),
        quarters_hz=44.0,
    ),
    Job(
        "four_dof_xi_0.01",
        _scene("four_dof_xi_0.01"),
        (15.0, 90.0),
        options=COARSE,
        starts=(
            Follow(1, 34.0),
            Follow(2, 16.0, (35.158, 35.496, 51.389, 79.713)),
            Follow(3, 5.0, (59.590,)),
        ),
        quarters_hz=40.0,
    ),
    Job(
        "two_dof_xi_0.001",
        _scene("two_dof_xi_0.001"),
        (18.0, 90.0),
        options=COARSE,
        starts=(
            Follow(1, 28.0),
            Follow(2, 16.0, (36.618, 39.248, 50.928, 84.695)),
            Follow(3, 25.0, (29.078, 35.156, 36.980, 64.262)),
        ),
        quarters_hz=40.0,
    ),
    Job(
        "two_dof_xi_0.01",
        _scene("two_dof_xi_0.01"),
        (15.0, 90.0),
        options=COARSE,
        starts=(
            Follow(1, 7.0),
            Follow(2, 20.0, (36.867, 37.382, 51.284, 84.883)),
            Follow(3, 14.0, (29.991, 31.869, 34.017, 39.190, 63.391, 64.515)),
        ),
        quarters_hz=36.0,
    ),
    Job("one_dof.listed", _scene("one_dof"), (5.0, 90.0), (), LISTED, weight=10.0),
    Job(
        "one_dof",
        _scene("one_dof"),
        (5.0, 90.0),
        (1, 2),
        (SubharmonicSeed(3, 76.0),),
        quarters_hz=36.0,
        weight=13.0,
    ),
    Job(
        "five_dof_xi_0.01",
        five_dof_system,
        (18.0, 70.0),
        search_points=3,
        options=COARSE,
        weight=6.0,
    ),
    Job("two_dof.undamped", undamped_system, (20.0, 60.0), (1,), search_points=3, weight=3.0),
    Job("two_dof.bilinear", bilinear_system, (22.0, 70.0), (1,), search_points=3, weight=3.0),
    Job(
        "two_dof.sub14",
        _scene("two_dof_xi_0.001"),
        (50.0, 65.0),
        (),
        (SubharmonicSeed(14, 56.75), SubharmonicSeed(14, 57.0)),
        options=ContinuationOptions(max_points=150),
        weight=8.0,
    ),
    Job(
        "two_dof.high",
        _scene("two_dof_xi_0.01"),
        (60.0, 135.0),
        (1,),
        search_points=3,
        weight=1.0,
    ),
)


def job_named(name: str) -> Job:
    """The job of a name."""
    return next(job for job in JOBS if job.name == name)


def tasks_of(jobs: Sequence[Job], folder: Path) -> tuple[Task, ...]:
    """What is to be computed of some jobs, kept starts by period; the folder keeps it."""
    return tuple(
        Task(f"{job.name}{PART}{period}", run_job, (job.name, period, folder), weight)
        for job in jobs
        for period, weight in [(s.period, s.weight) for s in job.starts] or [(0, job.weight)]
    )


def run_job(name: str, period: int, folder: Path, progress: Progress) -> Diagram:
    """Compute a job, or its kept starts of one period, unless the folder keeps that.

    Of the orbits the numbers are left that figures and checks need.
    """
    job = job_named(name)
    path = folder / f"{name}.{period}.h5"
    found = kept_diagram(path, lambda: computed(job, period, progress))
    keep_numbers(found.branches)
    return found


def computed(job: Job, period: int, progress: Progress = silent) -> Diagram:
    """The diagram of a job, or the branches through its kept starts of one period."""
    system = job.system()
    found = (
        follow_kept(job, period, system, progress)
        if job.starts
        else diagram(
            system,
            job.range_hz,
            job.periods,
            seeds=job.seeds,
            search_points=job.search_points,
            options=job.options,
            progress=progress,
        )
    )
    return found if job.quarters_hz is None else with_quarters(found, job, system, progress)


def with_quarters(found: Diagram, job: Job, system: System, progress: Progress) -> Diagram:
    """A diagram with the 1/4 branches that are born at flips of its wide 1/2 branches."""
    axis = Axis.in_frequency(job.range_hz)
    box = Collector(flow_of(system), axis, found.observe, job.options, progress, done=0.9)
    box.take(found.branches, found.notes)
    for branch in box.of_period(2):
        for special in branch.special_points if is_wide(branch) else ():
            if special.kind == "PD" and special.frequency_hz >= (job.quarters_hz or 0.0):
                box.from_flip(special)
    return replace(found, branches=tuple(box.branches), notes=tuple(box.notes))


def follow_kept(job: Job, period: int, system: System, progress: Progress) -> Diagram:
    """Follow the branches through the kept starts of a job of one period."""
    low, high = LOWEST_HZ if period == 1 else job.range_hz[0], job.range_hz[1]
    flow, observe = flow_of(system), check_observe(system, None)
    axis = Axis.in_frequency((low, high))
    box = Collector(flow, axis, observe, job.options, progress)
    (starts,) = (follow.starts(job.name) for follow in job.starts if follow.period == period)
    for number, start in enumerate(starts):
        box.done = number / len(starts)
        orbit = orbit_near(flow, start.state, start.period, start.omega, observe)
        if orbit is not None and orbit.period == start.period and is_at(orbit, start.state):
            box.from_orbits([orbit])
        else:
            box.notes.append(f"{LOST} {start.period} at {start.frequency_hz:.6g} Hz")
    return Diagram.of(box)


def is_wide(branch: Branch) -> bool:
    """Whether a branch reaches over so many frequencies that the figures show it."""
    return bool(np.ptp(branch.frequency_hz) >= WIDE_HZ)


def diagrams_of(values: Mapping[str, object]) -> dict[str, Diagram]:
    """The diagrams among the values of tasks, by the names of their jobs."""
    parts: dict[str, list[Diagram]] = {}
    for task, found in values.items():
        if isinstance(found, Diagram):
            parts.setdefault(task.partition(PART)[0], []).append(found)
    return {name: _joined(found) for name, found in parts.items()}


def _joined(parts: Sequence[Diagram]) -> Diagram:
    """The parts of a job as one."""
    low = min(part.limits[0] for part in parts)
    return replace(
        parts[0],
        limits=(low, parts[0].limits[1]),
        branches=tuple(branch for part in parts for branch in part.branches),
        notes=tuple(note for part in parts for note in part.notes),
    )
