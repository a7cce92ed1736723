"""The answer first: what a diagram says in five lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from nldyn.bifurcations.kinds import GRAZING_SLIDING
from nldyn.branches.endings import Ending
from nldyn.plot.diagram import are_limit_cycles, branch_curve, stability_runs
from nldyn.plot.words import FORCES, Along, unit_in
from nldyn.system.naming import slider_name, stop_name

if TYPE_CHECKING:
    from nldyn.bifurcations.point import BranchNode
    from nldyn.branches.branch import Branch
    from nldyn.orbits.orbit import Impact, Orbit
    from nldyn.report.offline import Table
    from nldyn.search.diagram import Diagram

Ranges = list[tuple[float, float]]

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
        A line for each, of the contacts one for each kind: forces, moments, impulses; one of
        friction where there is any; empty where there is no branch. Rotations are told in rad and
        N m.
    """
    nodes = [node for branch in diagram.branches for node in branch.nodes]
    if not nodes:
        return []
    largest = max(map(abs, diagram.limits))
    along = Along.of(diagram.parameter, largest, nodes[0].orbit.system)
    stable = joined(stable_ranges(diagram.branches), diagram.limits)
    between = gaps(stable, diagram.limits)
    unstable = _listed(between, along) if between else "none"
    found = "no stable limit cycle" if are_limit_cycles(diagram.branches) else "nothing stable"
    return [
        _peak_line(nodes, along, diagram.observe),
        *([_frequency_line(nodes, along)] if are_limit_cycles(diagram.branches) else []),
        *_contact_lines(nodes, along),
        *_area_lines(nodes, along),
        *_friction_lines(nodes, along),
        f"stable and periodic: {_listed(stable, along)}",
        "; ".join([f"ranges where {found} was found: {unstable}", *_stuck(diagram.branches)]),
        f"jumps: {jumps_line(diagram.branches, special_points, along)}",
    ]


def _stuck(branches: Iterable[Branch]) -> list[str]:
    """From where on something sticks all the time, of which no branch goes on."""
    reasons = [reason for branch in branches for reason in branch.stop_reasons]
    return list(dict.fromkeys(str(r) for r in reasons if r.ending is Ending.STICKS))


def _peak_line(nodes: Sequence[BranchNode], along: Along, observe: str) -> str:
    measure = nodes[0].orbit.system.unit(observe)

    def told(node: BranchNode) -> str:
        size = node.orbit.max_abs_displacement
        factor, unit = unit_in(measure, size)
        return f"{size / factor:.4g} {unit} at {along.told(node.value)}"

    line = f"largest {'rotation' if measure == 'rad' else 'displacement'} of '{observe}': "
    return line + _of_stable_and_all(nodes, lambda node: node.orbit.max_abs_displacement, told)


def _frequency_line(nodes: Sequence[BranchNode], along: Along) -> str:
    """Between which frequencies self-excited motions lie."""
    ends = [pick(nodes, key=lambda node: node.orbit.frequency_hz) for pick in (min, max)]
    told = [f"{node.orbit.frequency_hz:.6g} Hz at {along.told(node.value)}" for node in ends]
    return f"frequency, found with the motion: {' to '.join(told)}"


def _contact_lines(nodes: Sequence[BranchNode], along: Along) -> list[str]:
    """The largest force or moment, and of rigid stops the largest impulse, each if there is one."""
    stops = nodes[0].orbit.system.stops
    if not stops:
        return ["largest contact force: there are no stops"]
    if not any(node.orbit.touches_stops for node in nodes):
        return ["largest contact force: none, no stop is touched"]
    kinds: dict[tuple[bool, bool], list[int]] = {}
    for number, stop in enumerate(stops):
        kind = stop.impulsive, nodes[0].orbit.system.unit(stop.at) == "rad"
        kinds.setdefault(kind, []).append(number)
    return [_contact_line(nodes, along, among, *kind) for kind, among in sorted(kinds.items())]


def _contact_line(
    nodes: Sequence[BranchNode], along: Along, among: Sequence[int], rigid: bool, angle: bool
) -> str:
    """The hardest contact with some stops, all rigid or all elastic."""
    stops = nodes[0].orbit.system.stops
    hits = {id(node): _hardest(node.orbit, among) for node in nodes}

    def told(node: BranchNode) -> str:
        hit = hits[id(node)]
        if hit is None:
            return "none"
        place = f", {stop_name(nodes[0].orbit.system, hit.stop)}" if len(stops) > 1 else ""
        value, moment = _hardness(hit), " m" if angle else ""
        scale = ((1.0, "N s"),) if rigid else FORCES
        factor, unit = next((each for each in scale if value >= each[0]), scale[-1])
        unit = f"N{moment} s" if rigid else unit + moment
        return f"{value / factor:.4g} {unit} at {along.told(node.value)}{place}"

    name = {
        (False, False): "largest contact force",
        (False, True): "largest contact moment",
        (True, False): "largest impulse of an impact",
        (True, True): "largest angular impulse of an impact",
    }[rigid, angle]
    if not any(hits.values()):
        rests = rigid and any(node.orbit.rests for node in nodes)
        such = "such " * (len(among) < len(stops))
        return f"{name}: none" + (", but of rest" if rests else f", no {such}stop is touched")
    return f"{name}: " + _of_stable_and_all(nodes, lambda o: _hardness(hits[id(o)]), told)


def _hardness(hit: Impact | None) -> float:
    """The force of a contact, of an impact with a rigid stop its impulse; 0 of none."""
    if hit is None:
        return 0.0
    return (hit.impulse if hit.force is None else hit.force) or 0.0


def _hardest(orbit: Orbit, among: Sequence[int]) -> Impact | None:
    """The hardest contact of an orbit with some stops."""
    return max((hit for hit in orbit.impact_list if hit.stop in among), key=_hardness, default=None)


def _area_lines(nodes: Sequence[BranchNode], along: Along) -> list[str]:
    """Where each area of contact is pressed hardest: its whole force, and what touches."""
    lines = []
    for number, (name, places) in enumerate(nodes[0].orbit.system.areas.items()):
        hits = [_hardness(_hardest(node.orbit, places)) for node in nodes]
        if not any(hits):
            lines.append(f"contact area '{name}': it is not touched")
            continue
        node = nodes[hits.index(max(hits))]
        found = node.orbit.areas[number]
        lines.append(
            f"contact area '{name}': {found.peak_force:.4g} N in all at {along.told(node.value)}, "
            f"where {100.0 * found.touched:.3g} % of it touches, "
            f"{100.0 * found.closed:.3g} % on average"
        )
    return lines


def _friction_lines(nodes: Sequence[BranchNode], along: Along) -> list[str]:
    """The largest loss of a slider in a period of the excitation, if there are any."""
    system = nodes[0].orbit.system
    if not system.rubbing:
        return []

    def loss(node: BranchNode) -> float:
        return max(each.loss for each in node.orbit.friction) / node.orbit.period

    def told(node: BranchNode) -> str:
        found = node.orbit.friction
        most = max(range(len(found)), key=lambda number: found[number].loss)
        place = f", {slider_name(system, most)}" if len(found) > 1 else ""
        factor, unit = unit_in("J", loss(node))
        period = "period" if node.orbit.self_excited else "excitation period"
        lost = f"{loss(node) / factor:.4g} {unit} per {period}"
        return f"{lost} at {along.told(node.value)}{place}"

    name = "largest loss by friction"
    if not any(map(loss, nodes)):
        return [f"{name}: none, nothing slides"]
    return [f"{name}: " + _of_stable_and_all(nodes, loss, told)]


def _of_stable_and_all(
    nodes: Sequence[BranchNode],
    size: Callable[[BranchNode], float],
    told: Callable[[BranchNode], str],
) -> str:
    """What the largest stable orbit says, and that of all if it is larger."""
    highest = max(nodes, key=size)
    steady = max((node for node in nodes if node.orbit.stable), key=size, default=None)
    if steady is None:
        return f"{told(highest)} (unstable; no orbit is stable)"
    if size(steady) == size(highest):
        return f"{told(steady)} (stable)"
    return f"{told(steady)} (stable; of unstable orbits {told(highest)})"


def stable_ranges(branches: Iterable[Branch]) -> Ranges:
    """Ranges of the stable pieces of all branches."""
    found = []
    for branch in branches:
        x, _, stable = branch_curve(branch)
        runs = [run for run in stability_runs(stable) if run.stable]
        found += [(min(x[r.start : r.stop]), max(x[r.start : r.stop])) for r in runs]
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


def _listed(ranges: Ranges, along: Along) -> str:
    """Ranges as text; of many the widest."""
    if not ranges:
        return "nowhere"
    widest = sorted(sorted(ranges, key=lambda r: r[0] - r[1])[:MOST_RANGES])
    text = ", ".join(along.span(low, high) for low, high in widest)
    more = len(ranges) - len(widest)
    return text + (f" and {more} narrower ranges" if more else "")


def jumps_line(branches: Iterable[Branch], special_points: Table, along: Along) -> str:
    """Values at which a stable branch ends at a fold, or where what it meets is unstable."""
    columns, rows = special_points
    forms = iter(str(row[list(columns).index("normal_form")]) for row in rows)
    rising: set[float] = set()
    falling: set[float] = set()
    for branch in branches:
        x, _, stable = branch_curve(branch)
        ends = {float(s.value): (str(s.kind), next(forms)) for s in branch.special_points}
        for at in range(1, x.size - 1):
            before, after = at - 1, at + 1
            if float(x[at]) not in ends or stable[before] == stable[after]:
                continue
            inner, outer = (before, after) if stable[before] else (after, before)
            kind, form = ends[float(x[at])]
            turns = (x[at] - x[inner]) * (x[outer] - x[at]) < 0.0
            folds = kind == "LP" or (turns and kind in ("GR", GRAZING_SLIDING))
            if folds or form.startswith("subcritical"):
                (rising if x[inner] < x[at] else falling).add(float(x[at]))
    told = [
        f"as the {along.noun} {word} past {_few(sorted(places), along)}"
        for word, places in (("rises", rising), ("falls", falling))
        if places
    ]
    return "; ".join(told) or "none was found"


def _few(places: Sequence[float], along: Along) -> str:
    more = f" and {len(places) - MOST_RANGES} more" if len(places) > MOST_RANGES else ""
    return along.number(*places[:MOST_RANGES]) + more
