"""The answer first: what a diagram says in five lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from nldyn.plot.diagram import branch_curve, length_unit, stability_runs
from nldyn.system.naming import stop_name

if TYPE_CHECKING:
    from nldyn.branches.branch import Branch
    from nldyn.orbits.orbit import Impact, Orbit
    from nldyn.report.offline import Table
    from nldyn.search.diagram import Diagram

Ranges = list[tuple[float, float]]

FORCES = ((1e6, "MN"), (1e3, "kN"), (1.0, "N"), (1e-3, "mN"), (1e-6, "µN"))
MOST_RANGES = 5  # told, of many the widest
NARROW = 1e-6  # share of a range of frequencies that counts as no gap


def answer_lines(diagram: Diagram, special_points: Table) -> list[str]:
    """Peak, largest contact force, where the response is stable, where not, and where it jumps.

    Parameters
    ----------
    diagram : Diagram
        What was computed.
    special_points : (columns, rows)
        The table of its special points, with their normal forms.

    Returns
    -------
    list of str
        A line for each; empty where there is no branch.
    """
    orbits = [orbit for branch in diagram.branches for orbit in branch.points]
    if not orbits:
        return []
    stable = joined(stable_ranges(diagram.branches), diagram.range_hz)
    return [
        _peak_line(orbits, diagram.observe),
        _force_line(orbits),
        f"stable and periodic: {_listed(stable)}",
        f"nothing stable was found: {_listed(gaps(stable, diagram.range_hz))}",
        f"jumps: {jumps_line(diagram.branches, special_points)}",
    ]


def _peak_line(orbits: Sequence[Orbit], observe: str) -> str:
    def told(orbit: Orbit) -> str:
        factor, unit = length_unit(orbit.max_abs_displacement)
        return f"{orbit.max_abs_displacement / factor:.4g} {unit} at {orbit.frequency_hz:.5g} Hz"

    line = f"largest displacement of '{observe}': "
    return line + _of_stable_and_all(orbits, lambda orbit: orbit.max_abs_displacement, told)


def _force_line(orbits: Sequence[Orbit]) -> str:
    """The largest force, or where all stops are rigid the largest impulse."""
    system = orbits[0].system
    if not system.stops:
        return "largest contact force: there are no stops"
    rigid = not system.elastic_stops
    hits = {id(orbit): _hardest(orbit, rigid) for orbit in orbits}

    def size(orbit: Orbit) -> float:
        hit = hits[id(orbit)]
        return 0.0 if hit is None else (hit.impulse if rigid else hit.force) or 0.0

    def told(orbit: Orbit) -> str:
        value, hit = size(orbit), hits[id(orbit)]
        where = f"at {orbit.frequency_hz:.5g} Hz"
        if hit is None:
            return "none, no stop is touched"
        place = f", at {stop_name(system.stops, hit.stop)}" if len(system.stops) > 1 else ""
        if rigid:
            return f"{value:.4g} N s {where}{place}"
        factor, unit = next((each for each in FORCES if value >= each[0]), FORCES[-1])
        return f"{value / factor:.4g} {unit} {where}{place}"

    name = "largest impulse of an impact: " if rigid else "largest contact force: "
    return name + _of_stable_and_all(orbits, size, told)


def _hardest(orbit: Orbit, rigid: bool) -> Impact | None:
    """The impact of an orbit with the largest impulse or force."""
    hits = [hit for hit in orbit.impact_list if (hit.force is None) == rigid]
    return max(hits, key=lambda hit: (hit.impulse if rigid else hit.force) or 0.0, default=None)


def _of_stable_and_all(
    orbits: Sequence[Orbit], size: Callable[[Orbit], float], told: Callable[[Orbit], str]
) -> str:
    """What the largest stable orbit says, and that of all if it is larger."""
    highest = max(orbits, key=size)
    steady = max((orbit for orbit in orbits if orbit.stable), key=size, default=None)
    if steady is None:
        return f"{told(highest)} (unstable; no orbit is stable)"
    if size(steady) == size(highest):
        return f"{told(steady)} (stable)"
    return f"{told(steady)} (stable; of unstable orbits {told(highest)})"


def stable_ranges(branches: Iterable[Branch]) -> Ranges:
    """Ranges in Hz of the stable pieces of all branches."""
    found = []
    for branch in branches:
        hz, _, stable = branch_curve(branch)
        runs = [run for run in stability_runs(stable) if run.stable]
        found += [(min(hz[r.start : r.stop]), max(hz[r.start : r.stop])) for r in runs]
    return [(float(low), float(high)) for low, high in found]


def joined(ranges: Ranges, whole: tuple[float, float]) -> Ranges:
    """Ranges without what overlaps, ascending.

    Examples
    --------
    >>> joined([(3.0, 4.0), (1.0, 2.0), (2.0, 2.5)], (0.0, 10.0))
    [(1.0, 2.5), (3.0, 4.0)]
    """
    found: Ranges = []
    slack = NARROW * (whole[1] - whole[0])
    for low, high in sorted(ranges):
        if found and low <= found[-1][1] + slack:
            found[-1] = found[-1][0], max(found[-1][1], high)
        else:
            found.append((low, high))
    return found


def gaps(ranges: Ranges, whole: tuple[float, float]) -> Ranges:
    """What ascending ranges leave of a whole one.

    Examples
    --------
    >>> gaps([(1.0, 2.5), (3.0, 4.0)], (1.0, 5.0))
    [(2.5, 3.0), (4.0, 5.0)]
    """
    slack = NARROW * (whole[1] - whole[0])
    ends = [(whole[0], whole[0]), *ranges, (whole[1], whole[1])]
    return [(a[1], b[0]) for a, b in pairwise(ends) if b[0] - a[1] > slack]


def _listed(ranges: Ranges) -> str:
    """Ranges as text; of many the widest."""
    if not ranges:
        return "nowhere"
    widest = sorted(sorted(ranges, key=lambda r: r[0] - r[1])[:MOST_RANGES])
    text = ", ".join(
        f"{low:.5g} to {high:.5g} Hz" if high > low else f"{low:.5g} Hz" for low, high in widest
    )
    more = len(ranges) - len(widest)
    return text + (f" and {more} narrower ranges" if more else "")


def jumps_line(branches: Iterable[Branch], special_points: Table) -> str:
    """Frequencies at which a stable branch ends at a fold, or where what it meets is unstable."""
    columns, rows = special_points
    forms = iter(str(row[list(columns).index("normal_form")]) for row in rows)
    rising: set[float] = set()
    falling: set[float] = set()
    for branch in branches:
        hz, _, stable = branch_curve(branch)
        ends = {float(s.frequency_hz): (str(s.kind), next(forms)) for s in branch.special_points}
        for at in range(1, hz.size - 1):
            before, after = at - 1, at + 1
            if float(hz[at]) not in ends or stable[before] == stable[after]:
                continue
            inner, outer = (before, after) if stable[before] else (after, before)
            kind, form = ends[float(hz[at])]
            turns = (hz[at] - hz[inner]) * (hz[outer] - hz[at]) < 0.0
            if kind == "LP" or form.startswith("subcritical") or (kind == "GR" and turns):
                (rising if hz[inner] < hz[at] else falling).add(float(hz[at]))
    told = [
        f"as the frequency {word} past {_few(sorted(places))} Hz"
        for word, places in (("rises", rising), ("falls", falling))
        if places
    ]
    return "; ".join(told) or "none was found"


def _few(places: Sequence[float]) -> str:
    text = ", ".join(f"{hz:.5g}" for hz in places[:MOST_RANGES])
    return text + (f" and {len(places) - MOST_RANGES} more" if len(places) > MOST_RANGES else "")
