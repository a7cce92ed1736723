"""The diagrams behind the figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path

import cms
from nldyn.base.resources import example
from nldyn.branches.continuation import broken_off
from nldyn.branches.options import ContinuationOptions
from nldyn.paper.starts import follow_starts, keep_numbers, longest_whole, read_starts
from nldyn.paper.workers import Workers, tell
from nldyn.runtime.progress import Progress
from nldyn.scene.build import build_component, build_system, load_scene
from nldyn.search.diagram import Diagram, Seed, diagram, notes_on_ends
from nldyn.search.fixed_point_index import index_note
from nldyn.system.elements import Stop
from nldyn.system.system import System

BILINEAR_ALPHA = 790.0  # section 3, from equation 3.2
STIFFNESS = 16877.0  # N/m, section 3
HERTZ_STIFFNESS = 5.17e9  # N/m^1.5, half of what sections 2 and 3 print for the whole beam


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
    seeds : tuple of Seed
        Further orbits to look for.
    search_points : int
        Frequencies searched.
    options : ContinuationOptions, optional
        Step control.
    doubled : (int, int), optional
        If given, the branches through the starts that the search of this model gave, and doubled
        ones as `follow_starts` says.
    """

    name: str
    system: Callable[[], System]
    range_hz: tuple[float, float]
    periods: tuple[int, ...] = (1,)
    seeds: tuple[Seed, ...] = ()
    search_points: int = 12
    options: ContinuationOptions | None = None
    doubled: tuple[int, int] | None = None

    @property
    def families(self) -> tuple[int, ...]:
        """Odd parts of the periods of its starts; no branch of one leads to one of another."""
        if self.doubled is None:
            return (1,)
        return tuple(sorted({odd_part(start.period) for start in read_starts(self.name)}))

    def run(self, family: int, folder: Path, progress: Progress | None = None) -> Diagram:
        """Compute the diagram, or of one with starts the branches of one family.

        The folder keeps what each start leads to.
        """
        if self.doubled is not None:
            starts = [s for s in read_starts(self.name) if odd_part(s.period) == family]
            return follow_starts(
                self.system(),
                starts,
                self.range_hz,
                LONG,
                self.doubled,
                progress,
                keep_at=lambda number: folder / f"{self.name}.{family}.{number}.pickle",
            )
        found = diagram(
            self.system(),
            self.range_hz,
            self.periods,
            seeds=self.seeds,
            search_points=self.search_points,
            options=self.options,
            progress=progress,
        )
        keep_numbers(found.branches)
        return found


def odd_part(period: int) -> int:
    """A period without its factors of two, which flips add."""
    return period // (period & -period)


def joined(parts: Mapping[tuple[str, int], Diagram]) -> dict[str, Diagram]:
    """The diagrams of some jobs, from those of their families."""
    return {name: _whole(name, parts) for name in dict.fromkeys(name for name, _ in parts)}


def _whole(name: str, parts: Mapping[tuple[str, int], Diagram]) -> Diagram:
    """The diagram of a job from those of its families, with what all of them together tell."""
    first, *others = (part for (job, _), part in parts.items() if job == name)
    doubled = job_named(name).doubled
    if doubled is None:
        return first
    both = (first, *others)
    branches = tuple(branch for part in both for branch in part.branches)
    notes = tuple(note for part in both for note in part.notes)
    found = replace(first, branches=branches, notes=notes)
    told = index_note(branches, first.range_hz, longest_whole(doubled[0]))
    return replace(found, notes=(*_summed_up(found), told))


def _summed_up(found: Diagram) -> list[str]:
    """How many ends of branches were broken off for which reason, and all other notes."""
    reasons = Counter(reason for branch in found.branches for _, reason in broken_off(branch))
    each = {note for branch in found.branches for note in notes_on_ends(branch)}
    counted = [f"{n} ends of branches broken off: {why}" for why, n in reasons.items()]
    return counted + [note for note in found.notes if note not in each]


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
LISTED = (
    Seed(3, 37.1), Seed(5, 62.2), Seed(2, 16.1), Seed(4, 33.0), Seed(7, 58.0),
    Seed(10, 83.0), Seed(3, 18.4), Seed(5, 31.0), Seed(9, 56.0), Seed(13, 81.0),
)  # fmt: skip

# Branches of the larger models are long. One that is cut off by max_points would be found and
# followed again from the next orbit.
LONG = ContinuationOptions(max_points=20000)

# Flips are followed to period 8. Branches of period 6 and 8, whose own flips are not, have up to 25
# points each way; those of the model with several thousand flips up to 10.
DOUBLED, MANY_DOUBLED = (8, 25), (8, 10)

JOBS = (
    Job("four_dof_xi_0.001", _scene("four_dof_xi_0.001"), (18.0, 90.0), doubled=MANY_DOUBLED),
    Job("two_dof_xi_0.01", _scene("two_dof_xi_0.01"), (15.0, 90.0), doubled=DOUBLED),
    Job("two_dof_xi_0.001", _scene("two_dof_xi_0.001"), (18.0, 90.0), doubled=DOUBLED),
    Job("four_dof_xi_0.01", _scene("four_dof_xi_0.01"), (15.0, 90.0), doubled=DOUBLED),
    Job("one_dof.listed", _scene("one_dof"), (5.0, 90.0), (), LISTED),
    Job("one_dof", _scene("one_dof"), (5.0, 90.0), (1, 2), (Seed(3, 76.0),)),
    Job("five_dof_xi_0.01", five_dof_system, (15.0, 90.0), search_points=6),
    Job("two_dof.undamped", undamped_system, (20.0, 60.0), (1,), search_points=6),
    Job("two_dof.bilinear", bilinear_system, (22.0, 70.0), (1,), search_points=6),
    Job(
        "two_dof.sub14",
        _scene("two_dof_xi_0.001"),
        (50.0, 65.0),
        (),
        (Seed(14, 56.75), Seed(14, 57.0)),
        options=ContinuationOptions(max_points=150),
    ),
    Job("two_dof.high", _scene("two_dof_xi_0.01"), (60.0, 135.0), (1,), search_points=4),
)


def job_named(name: str) -> Job:
    """The job of a name."""
    return next(job for job in JOBS if job.name == name)


def run_job(name: str, family: int, folder: Path) -> Diagram:
    """Compute a family of a job (in a worker process), with what the figures need of it.

    The folder keeps what an interrupted run has computed.
    """
    job = job_named(name)

    def progress(what: str, frequency_hz: float, done: float) -> None:
        tell(f"{name}: {what}", frequency_hz)

    return job.run(family, folder, progress)


def submit_diagrams(
    workers: Workers, jobs: Sequence[Job] = JOBS
) -> dict[tuple[str, int], Future[Diagram]]:
    """Begin each family of some jobs, the longest jobs first; see `joined`."""
    scene_system("one_dof")  # fail early, before any process is started
    return {
        (job.name, family): workers.submit(
            f"{job.name}.{family}", run_job, job.name, family, workers.folder
        )
        for job in jobs
        for family in job.families
    }
