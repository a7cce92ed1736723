"""Orbits from which the branches of the larger models are followed.

The search for them takes longer than to follow what it finds, and chaotic
motions make its outcome differ by a few small branches between versions of the program. So its
orbits are kept, one of each branch; every one is solved for again before its branch is followed.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_frequency, check_whole, numbers
from nldyn.branches.branch import Branch
from nldyn.branches.step_control import ContinuationOptions
from nldyn.flow.flow_map import flow_of
from nldyn.io.store import save
from nldyn.orbits.axis import Axis
from nldyn.orbits.orbit import Orbit, check_observe, stroboscopic
from nldyn.orbits.shooting import LONGEST_PERIOD
from nldyn.orbits.starts import orbit_near
from nldyn.runtime.files import write_whole
from nldyn.runtime.progress import Progress, silent
from nldyn.search.collector import Collector, middle_orbit
from nldyn.search.diagram import Diagram
from nldyn.system.system import System
from paper.kept import read_diagram

DATA = Path(__file__).parent / "data"
LONGEST = 3  # period of the orbits looked for
AT_START = 1e-6  # largest relative distance of an orbit from its start
LOST = "no orbit leads on from the start of period"


@dataclass(frozen=True, eq=False)
class Start:
    """An orbit in a file of starts.

    Parameters
    ----------
    period : int
        Period multiple n.
    frequency_hz : float
        Excitation frequency in Hz.
    state : (2n_modes,) array
        At forcing phase zero.
    """

    period: int
    frequency_hz: float
    state: Real

    @property
    def omega(self) -> float:
        """Excitation frequency in rad/s."""
        return 2.0 * math.pi * self.frequency_hz


def read_starts(name: str, folder: Path = DATA) -> list[Start]:
    """The orbits that a search of the model of this name gave.

    Raises
    ------
    SystemModelError
        If the file holds none, or a line is none.
    """
    path = starts_path(name, folder)
    with path.open(newline="", encoding="utf-8") as file:
        head, *rows = list(csv.reader(file)) or [[]]
    if not rows:
        raise SystemModelError(f"{path}: has no starts")
    return [_start(row, len(head), f"{path}: line {line}") for line, row in enumerate(rows, 2)]


def _start(row: Sequence[str], columns: int, place: str) -> Start:
    """The orbit in a line of a file of starts."""
    if not len(row) == columns >= 3:
        raise SystemModelError(f"{place}: has {len(row)} columns, not {max(columns, 3)}")
    frequency_hz, *state = numbers(place, row[1:]).tolist()
    period = int(row[0]) if row[0].isdecimal() else 0
    check_whole(f"{place}: period", period, 1, LONGEST_PERIOD)
    check_frequency(f"{place}: frequency_hz", frequency_hz)
    return Start(period, frequency_hz, np.array(state))


def starts_path(name: str, folder: Path = DATA) -> Path:
    """File of the starts of a model."""
    return folder / f"starts_{name}.csv"


def write_starts(path: Path, branches: Sequence[Branch]) -> None:
    """Write one orbit of each branch, to the last digit, by period and frequency."""
    orbits = sorted(map(middle_orbit, branches), key=lambda o: (o.period, o.frequency_hz))
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    size = orbits[0].problem.size if orbits else 0
    table.writerow(["period", "frequency_hz", *(f"state_{i}" for i in range(size))])
    for orbit in orbits:
        table.writerow([orbit.period, orbit.frequency_hz, *stroboscopic(orbit)[0].tolist()])
    write_whole(path, text.getvalue().encode())


def follow_starts(
    system: System,
    starts: Sequence[Start],
    range_hz: tuple[float, float],
    options: ContinuationOptions,
    doubled: tuple[int, int],
    progress: Progress | None = None,
    *,
    whole: bool = False,
    keep_at: Callable[[int], Path] | None = None,
) -> Diagram:
    """Follow the branches through some orbits, and those that they lead to.

    Parameters
    ----------
    system : System
        Of the orbits.
    starts : sequence of Start
        Where to begin.
    range_hz : (float, float)
        Frequencies.
    options : ContinuationOptions
        Step control.
    doubled : (int, int)
        Longest period to which flips are followed, and most points in one direction of branches
        that are longer in period than `LONGEST` and whose own flips would lead beyond.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.
    whole : bool
        Whether the branches are to be followed any further; if not, see `keep_numbers`.
    keep_at : callable, optional
        Gives the file that keeps what the start of a number leads to, as `nldyn.save` writes it.
        What an interrupted run of the same system, starts and options has kept there is taken from
        it.

    Returns
    -------
    Diagram
        The first note tells how many starts there were, and how many of them are no orbits: from
        their states none is found, or only one of another period or elsewhere.

    Raises
    ------
    SystemModelError
        If a state is not one of the system.
    OutputError
        If a file cannot be written.
    """
    flow = flow_of(system)
    for number, start in enumerate(starts, 1):
        if start.state.size != 2 * system.size:
            raise SystemModelError(
                f"start {number}: has a state of {start.state.size} numbers, the system one of "
                f"{2 * system.size}"
            )
    observe = check_observe(system, None)
    axis = Axis.in_frequency(range_hz)
    box = Collector(flow, axis, observe, options, progress or silent)
    lost = 0
    for number, start in enumerate(starts):
        box.done = number / len(starts)
        path = keep_at(number) if keep_at else None
        found = read_diagram(path) if path else None
        if found is not None:
            box.take_back(found.branches, found.notes)
        else:
            found = _follow(box, start, doubled)
            if path:
                save(found, path)
        if not whole:
            keep_numbers(found.branches)
        lost += any(note.startswith(LOST) for note in found.notes)
    periods = ", ".join(map(str, sorted({start.period for start in starts})))
    what = f"{lost} of which {'is no orbit' if lost == 1 else 'are no orbits'}"
    note = f"from {len(starts)} starts of period {periods}, {what if lost else 'each an orbit'}"
    return Diagram(tuple(box.branches), range_hz, observe, (note, *box.notes))


def _follow(box: Collector, start: Start, doubled: tuple[int, int]) -> Diagram:
    """Follow the branch of a start and those that it leads to, see `follow_starts`."""
    longest, most = doubled
    count, told = len(box.branches), len(box.notes)
    orbit = orbit_near(box.flow, start.state, start.period, start.omega, box.observe)
    if orbit is not None and orbit.period == start.period and is_at(orbit, start.state):
        box.follow(orbit, longest, longest_whole(longest), most)
    else:
        box.notes.append(f"{LOST} {start.period} at {start.frequency_hz:.6g} Hz")
    branches, notes = tuple(box.branches[count:]), tuple(box.notes[told:])
    return Diagram(branches, box.axis.limits, box.observe, notes)


def is_at(orbit: Orbit, state: Real) -> bool:
    """Whether an orbit begins at a state, but for rounding."""
    off = float(np.linalg.norm(stroboscopic(orbit)[0] - state))
    return off <= AT_START * float(np.linalg.norm(state))


def longest_whole(longest: int) -> int:
    """Longest period of branches followed to their ends, so that their flips are followed, too."""
    return max(LONGEST, longest // 2)


def keep_numbers(branches: Sequence[Branch]) -> None:
    """Keep of the orbits their states and the numbers in figures and tables, and drop the rest.

    A motion is recorded again where it is asked for. Without their Jacobians the orbits cannot be
    followed any further.
    """
    none = np.empty((0, 0, 0))
    for branch in branches:
        vars(branch)["course"] = None
        for orbit in (*branch.points, *(special.orbit for special in branch.special_points)):
            _ = orbit.max_abs_displacement, orbit.max_penetration, orbit.impacts
            _ = orbit.liouville_error
            known = vars(orbit)
            known.update(motion=None, jacobians=none, _spectrum=(orbit._spectrum[0], none))
            names = "trajectory", "_extremes", "_touches", "observed_extremes", "penetration_peaks"
            for name in names:
                known.pop(name, None)
