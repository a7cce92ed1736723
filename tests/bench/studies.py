"""Whole branches, growth with the number of modes, grazing contacts, and the first call."""

from __future__ import annotations

import cProfile
import math
import pstats
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from paper.atlas import CHARTS, LONG, odd_part
from paper.jobs import scene_system
from paper.starts import Start, follow_starts, read_starts

from bench import native
from bench.engines import flow_map
from bench.measure import errors, median_seconds
from bench.models import Case, Sensitivities, load_case, load_grazing
from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import continue_branch
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.system.loads import HarmonicForce
from nldyn.system.stop import Stop
from nldyn.system.system import System

DEFAULT = FlowOptions()
TIGHT = FlowOptions(rtol=1e-13)
MODES = (4, 8, 16, 32, 64)
MODES_HZ = 38.0
EACH = 10  # of so many points of a branch one flow is timed


@dataclass(frozen=True)
class BranchTask:
    """A harmonic branch to be timed: start in Hz, range in Hz."""

    model: str
    start_hz: float
    range_hz: tuple[float, float]


BRANCHES = (
    BranchTask("one_dof", 26.0, (3.0, 90.0)),
    BranchTask("four_dof", 38.0, (18.0, 40.0)),
)


@dataclass(frozen=True)
class BranchTime:
    """Time of a branch and how well its special points are located.

    Parameters
    ----------
    task : BranchTask
        What was computed.
    seconds : float
        Median, with the search for the first orbit.
    points : int
        Points of the branch.
    special : int
        Special points.
    unmatched : int
        Special points without a partner on the same branch at the tightest setting, either way.
    error : float
        Largest relative difference of their frequencies otherwise.
    located : tuple of (str, float)
        Kind and frequency in Hz of each special point.
    flows : float
        Time of the walk over that of one flow with derivatives for each point.
    """

    task: BranchTask
    seconds: float
    points: int
    special: int
    unmatched: int
    error: float
    located: tuple[tuple[str, float], ...]
    flows: float = math.nan


def harmonic(system: System, task: BranchTask, options: FlowOptions = DEFAULT) -> Branch:
    """The harmonic branch of a task."""
    orbit = solve_orbit(FlowMap(system, options), task.start_hz)
    return continue_branch(orbit, task.range_hz)


def time_branch(task: BranchTask) -> BranchTime:
    """Time a branch, and compare its special points with those of the tightest setting."""
    system = load_case(task.model).system
    branch = harmonic(system, task)
    seconds, _ = median_seconds(lambda: harmonic(system, task), calm=1.0)
    unmatched, error = compare_special_points(branch, harmonic(system, task, TIGHT))
    located = tuple((p.kind, p.frequency_hz) for p in branch.special_points)
    points = branch.points
    flows = seconds / (len(points) * statistics.mean(map(flow_seconds, points[::EACH])))
    return BranchTime(task, seconds, len(points), len(located), unmatched, error, located, flows)


def flow_seconds(orbit: Orbit) -> float:
    """Median time of one flow over an orbit with its monodromy matrix and frequency derivative."""
    problem = orbit.problem
    nodes = problem.nodes(orbit.point)
    return median_seconds(
        lambda: problem.flow.shoot(nodes, problem.phases, orbit.omega), 5, calm=0.0
    )[0]


def compare_special_points(branch: Branch, finer: Branch) -> tuple[int, float]:
    """Special points without a partner of the same kind, and the largest relative difference."""
    unmatched, error = 0, 0.0
    for kind in ("LP", "PD", "NS", "BP", "GR"):
        here, there = (
            sorted(p.frequency_hz for p in b.special_points if p.kind == kind)
            for b in (branch, finer)
        )
        a, b, alone = pair_up(np.array(here), np.array(there))
        unmatched += alone
        if a.size:
            error = max(error, float(np.abs(a / b - 1.0).max()))
    return unmatched, error


def pair_up(a: Real, b: Real, rtol: float = 1e-5) -> tuple[Real, Real, int]:
    """Pairs of nearly equal frequencies of two sorted lists, and how many are left over."""
    pairs = []
    i = j = 0
    while i < a.size and j < b.size:
        if abs(a[i] - b[j]) <= rtol * b[j]:
            pairs.append((a[i], b[j]))
            i, j = i + 1, j + 1
        elif a[i] < b[j]:
            i += 1
        else:
            j += 1
    found = np.array(pairs).reshape(-1, 2)
    return found[:, 0], found[:, 1], a.size + b.size - 2 * len(pairs)


# Where the time of a branch goes

SUBJECTS = {
    "flow": "flow map",
    "system": "flow map (steady response)",
    "orbits": "corrector, extremes and multipliers",
    "bifurcations": "special points",
    "branches": "walk",
    "linalg": "linear algebra (numpy)",
}


def profile_branch(task: BranchTask) -> dict[str, float]:
    """Share of each subject in the time of a branch; the profiler favours compiled code."""
    system = load_case(task.model).system
    harmonic(system, task)
    profiler = cProfile.Profile()
    profiler.runcall(harmonic, system, task)
    shares: dict[str, float] = {}
    stats = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    for (file, _, _), (_, _, own, _, _) in stats.items():
        room = re.search(r"nldyn/(\w+)/", Path(file).as_posix())
        key = room[1] if room else "linalg" if "linalg" in file else ""
        subject = SUBJECTS.get(key, "the rest (numpy, scipy, Python)")
        shares[subject] = shares.get(subject, 0.0) + own
    total = sum(shares.values())
    return {k: v / total for k, v in sorted(shares.items(), key=lambda item: -item[1])}


# Number of modes


@dataclass(frozen=True)
class ModesTime:
    """One orbit with its derivatives at a number of modes: median time and error."""

    modes: int
    seconds: float
    closings: int
    error: float


def time_modes(numbers: Sequence[int] = MODES) -> list[ModesTime]:
    """One period of the beam with more and more modes; errors against the tightest setting."""
    import cms
    from nldyn.base.resources import example
    from nldyn.scene.build import build_system
    from nldyn.scene.component import build_component
    from nldyn.scene.read import load_scene

    scene = load_scene(example("four_dof_xi_0.01.toml"))
    component = build_component(scene)
    guess: Real | None = None
    found = []
    for modes in numbers:
        system = build_system(scene, cms.reduce(component, modes=modes - 1, residual=True))
        if guess is not None:  # keep the free-interface modes, start the new ones at zero
            halves = [np.append(half[:-1], np.zeros(modes - half.size + 1)) for half in guess]
            guess = np.concatenate(halves)
        orbit = solve_orbit(FlowMap(system, TIGHT), MODES_HZ, guess=guess)
        tight = orbit.problem.flow
        start = tight.to_modal(orbit.problem.nodes(orbit.point)[0])
        guess = start.reshape(2, -1)
        exact = native.sensitivities(tight, start, orbit.omega)
        case = Case(f"{modes} modes", system, orbit.omega, start, exact, 12.0)
        found.append(_time_case(case, DEFAULT, modes))
    return found


def _time_case(case: Case, options: FlowOptions, modes: int) -> ModesTime:
    seconds, _ = median_seconds(flow_map(case, options)(case.start, case.omega).run, 5)
    flow = FlowMap(case.system, options)
    error = max(errors(case, native.sensitivities(flow, case.start, case.omega)))
    return ModesTime(modes, seconds, native.closings(flow, case), error)


# Impacts with many modes

TUBE_MODES = (4, 20)
TUBE_HZ = 5.2


@dataclass(frozen=True)
class ImpactTime:
    """Median of the time of a period with derivatives over its number of impacts."""

    modes: int
    seconds: float
    closings: int


def tube(modes: int) -> System:
    """A tube on two supports that knocks on both sides of a third one, loosely held."""
    length, bending, mass = 4.0, 2.1e11 * 3e-8, 1.5
    n = np.arange(1, modes + 1)
    shapes = {
        name: np.sqrt(2.0 / (mass * length)) * np.sin(n * np.pi * place)
        for name, place in (("support", 0.5), ("drive", 0.37))
    }
    return System.from_modal(
        (n * np.pi / length) ** 2 * np.sqrt(bending / mass) / (2.0 * np.pi),
        shapes,
        modal_damping=0.01,
        stops=[Stop("support", 5e6, 1.0, gap=1e-4, direction=side) for side in (1, -1)],
        excitation=[HarmonicForce("drive", 20.0)],
    )


def impact_times() -> list[ImpactTime]:
    """The impacts of ten periods, a hundred after the tube began at rest."""
    found = []
    for modes in TUBE_MODES:
        flow, omega = FlowMap(tube(modes)), 2.0 * np.pi * TUBE_HZ
        states = flow.strobe(np.zeros(2 * modes), omega, 110).ends[100:]
        times, closings = [], 0
        for state in states:
            period = partial(flow.shoot, state[None], native.PERIOD, omega)
            hits = int(period().closings.sum())
            times.append(median_seconds(period, calm=0.0)[0] / hits)
            closings += hits
        found.append(ImpactTime(modes, statistics.median(times), closings))
    return found


# Searches in vain


@dataclass(frozen=True)
class VainSearch:
    """Processor time of a `solve_orbit`, whether it finds none, and what it says."""

    modes: int
    seconds: float
    vain: bool
    said: str


def vain_searches() -> list[VainSearch]:
    """The tube where its motion is chaotic: no orbit of period 1 lies near a motion from rest."""
    found = []
    for modes in TUBE_MODES:
        system = tube(modes)
        start = time.process_time()
        try:
            solve_orbit(system, TUBE_HZ)
            vain, said = False, "found one"
        except ConvergenceError as error:
            vain, said = True, str(error)
        found.append(VainSearch(modes, time.process_time() - start, vain, said))
    return found


# The atlas of the paper

ATLAS_SHARE = 60  # of so many starts of each family of a chart one is followed


@dataclass(frozen=True)
class AtlasTime:
    """A sample of a chart of the atlas: processor time for its orbits, and all orbits there are."""

    model: str
    seconds: float
    orbits: int
    all_orbits: int

    @property
    def minutes(self) -> float:
        """Processor time of the whole chart in min, if all of its orbits take as long."""
        return self.seconds / self.orbits * self.all_orbits / 60.0


def atlas_times() -> list[AtlasTime]:
    """Every sixtieth start of each family, from its middle, with all branches that it leads to."""
    found = []
    for chart in CHARTS:
        system, starts = scene_system(chart.name), read_starts(chart.name)
        begun = time.process_time()
        parts = [
            follow_starts(system, sample, chart.range_hz, LONG, chart.doubled)
            for family in chart.families
            if (sample := _sampled([start for start in starts if odd_part(start.period) == family]))
        ]
        seconds = time.process_time() - begun
        orbits = sum(len(branch.points) for part in parts for branch in part.branches)
        found.append(AtlasTime(chart.name, seconds, orbits, chart.orbits))
    return found


def _sampled(starts: Sequence[Start]) -> Sequence[Start]:
    """Some of the starts: not the first, which leads to a large part of a diagram."""
    return starts[len(starts) // 2 :: ATLAS_SHARE]


# Grazing


@dataclass(frozen=True)
class GrazingError:
    """A touch of a given depth, relative to the amplitude."""

    depth: float
    seconds: float
    state: float
    monodromy: float


def grazing_errors(options: FlowOptions = DEFAULT) -> list[GrazingError]:
    """Errors and times of slower and slower touches."""
    found = []
    for depth, case in load_grazing().items():
        flow = FlowMap(case.system, options)
        result: Sensitivities = native.sensitivities(flow, case.start, case.omega)
        state, monodromy, _ = errors(case, result)
        found.append(GrazingError(depth, _time_case(case, options, 1).seconds, state, monodromy))
    return found


# The first call

FIRST_ORBIT = """
import time
import nldyn
imported = time.process_time()
system = nldyn.System.from_matrices(
    [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142,
    stops=[nldyn.Stop("middle", stiffness=5.17e9)],
    excitation=[nldyn.Unbalance("middle", 4.92e-6)],
)
nldyn.solve_orbit(system, frequency_hz=20.0)
print(imported, time.process_time())
"""


@dataclass(frozen=True)
class FirstCall:
    """Seconds of the import alone, and of import and first orbit."""

    import_alone: float
    orbit: float


def first_call() -> FirstCall:
    """Import and first orbit in a new process."""
    text = subprocess.run(
        [sys.executable, "-c", FIRST_ORBIT], capture_output=True, text=True, check=True
    ).stdout
    return FirstCall(*(float(word) for word in text.split()))


# Against AUTO's special points


def published_special_points() -> list[tuple[str, float, dict[str, float]]]:
    """Kind, frequency in Hz by an independent shooting code, and AUTO's by setting."""
    import csv
    from importlib import resources

    file = resources.files("paper").joinpath("data/auto_special_points_harmonic.csv")
    found = []
    for row in csv.DictReader(file.read_text("utf-8").splitlines()):
        auto = {
            key.split("NTST")[1].split()[0]: float(value)
            for key, value in row.items()
            if "NTST" in key and value != "missed"
        }
        found.append((row["type"], float(row["fe_Hz_shooting"]), auto))
    return found
