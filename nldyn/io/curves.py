"""Curves in HDF5 files: their unknowns to the last digit, from which their orbits are made again.

A file has the attributes ``format``, ``format_version`` and ``software``, and a group for each
curve: its flow map at the start, its parameters with their ranges, the unknowns, tangents and
conditions of its points and, in ``marked``, of its marks, its ``course`` as that of a branch, and a
``table`` of what is reported of the points, which other software may read and this one does not.
Datasets carry their unit as the attribute ``unit``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, shown
from nldyn.bifurcations.branch_crossing import distance
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.branches.at_frequency import requested
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import make_branch
from nldyn.branches.endings import StopReason
from nldyn.branches.tables import UNITS
from nldyn.curves.backbone import Backbone
from nldyn.curves.curves import Curve
from nldyn.flow.flow_map import FlowMap
from nldyn.io.branches import of_diagram, read_course, read_diagram, write_course
from nldyn.io.flow import STATE_UNIT, Laws, checked_laws, read_flow, write_flow
from nldyn.io.hdf5 import Group, new_file, opened, put, set_attribute
from nldyn.orbits.bordered import FREE, Condition, Evaluation, OrbitFamily
from nldyn.orbits.conditions import (
    MONITORS,
    BranchPointCondition,
    Grazing,
    Held,
    Phase,
    Singular,
    Turning,
)
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import ShootingProblem
from nldyn.search.diagram import Diagram
from nldyn.system.chart import FREQUENCY, Chart, checked_parameter
from nldyn.system.chart import UNITS as PARAMETER_UNITS
from nldyn.system.parameters import Parameter

FORMAT = "nldyn curves"
FORMAT_VERSION = 3
POINT_UNIT = f"{STATE_UNIT}; then the parameters' coordinates"
SELF_EXCITED = "limit cycle"
HELD = 1e-6  # how far the held quantity of a loaded curve may be off

OwnMonitor = Callable[[Orbit], float]


def save_curves(
    path: str | Path, curves: Sequence[Curve], attributes: Mapping[str, Any] | None = None
) -> None:
    """Write curves to one file, whole or not at all.

    Parameters
    ----------
    path : str or Path
        The file.
    curves : sequence of Curve
        What to write.
    attributes : mapping, optional
        What the file has beside them.

    Raises
    ------
    OutputError
        If the file cannot be written.
    SystemModelError
        For anything but a list of curves.
    """
    if not isinstance(curves, list | tuple) or not all(isinstance(c, Curve) for c in curves):
        raise SystemModelError(f"curves must be a list of curves, got {shown(curves)}")
    with new_file(path, FORMAT, FORMAT_VERSION) as file:
        for key, value in (attributes or {}).items():
            set_attribute(file, key, value)
        groups = file.create_group("curves")
        for number, curve in enumerate(curves):
            _write_curve(groups.create_group(f"{number:04d}"), curve)


def save_self_excited(
    path: str | Path, branches: Sequence[Branch], diagram: Diagram | None = None
) -> None:
    """Write branches of self-excited motions, whose frequency goes along, as curves.

    Those of a diagram with what that has beside them.

    Raises
    ------
    OutputError
        If the file cannot be written.
    SystemModelError
        If others are among them.
    """
    if not all(map(is_self_excited, branches)):
        raise SystemModelError(
            "branches of self-excited motions and of others are saved to files of their own"
        )
    curves = [Curve(SELF_EXCITED, branch) for branch in branches]
    save_curves(path, curves, None if diagram is None else of_diagram(diagram))


def is_self_excited(branch: Branch) -> bool:
    """Whether a branch is one of limit cycles, found with their frequency."""
    return isinstance(branch.nodes[0].condition, Turning)


def save_backbone(path: str | Path, found: Backbone) -> None:
    """Write a backbone to a file, whole or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with new_file(path, FORMAT, FORMAT_VERSION) as file:
        group = file.create_group("curves").create_group("0000")
        _write_curve(group, found.curve)
        set_attribute(group, "mode", found.mode)


def load_curves(
    path: str | Path, *, laws: Laws | None = None, monitor: OwnMonitor | None = None
) -> list[Curve | Branch | Backbone]:
    """Read all curves of a file, a backbone, and branches that were written as curves.

    See `nldyn.load`.


    Their orbits are made of their unknowns when they are asked for, by the flow map.
    """
    known = checked_laws(laws)
    check_types(monitor=(monitor, Callable, None))
    with opened(path, FORMAT, FORMAT_VERSION) as root:
        groups = root.group("curves").groups()
        return [_read_curve(group, known, monitor) for group in groups]


def load_self_excited(path: str | Path, *, laws: Laws | None = None) -> Diagram:
    """Read a diagram of self-excited motions."""
    found = load_curves(path, laws=laws)
    with opened(path, FORMAT, FORMAT_VERSION) as root:
        return read_diagram(root, [each for each in found if isinstance(each, Branch)])


def _as_branch(curve: Curve) -> Branch:
    """What an earlier version wrote as a curve of orbits in one parameter."""
    special = []
    for mark in curve.marks:
        near = min(curve.points, key=lambda node: distance(node, mark.point))
        way = near.family.metric(near.point) * (mark.point.point - near.point)
        length = near.arclength + float(way @ near.tangent)
        place = replace(mark.point, tangent=near.tangent, arclength=length)
        special.append(replace(mark, point=place))
    return make_branch("", list(curve.points), special, curve.stop_reasons, list(curve.notes))


def _write_curve(group: Any, curve: Curve) -> None:
    points, marks = curve.points, curve.marks
    family = points[0].family
    for key, value in {
        "kind": curve.kind,
        "name": curve.branch.name,
        "parameters": [chart.parameter.name for chart in family.charts],
        "observe": family.observe,
        "period": family.period,
        "segments": family.segments,
        "frequency_hz": family.frequency_hz,
        "least": family.least,
        "stop_reasons": curve.stop_reasons,
        "notes": curve.notes,
        "marks": [mark.kind for mark in marks],
    }.items():
        set_attribute(group, key, value)
    write_flow(group.create_group("flow_map"), FlowMap(family.system, family.options))
    charts = [(c.parameter.index, c.low, c.high, c.unit) for c in family.charts]
    put(group, "ranges", np.array(charts, dtype=float), "index, range and scale of the parameters")
    for name in ("unfolding", "origin"):
        if getattr(family, name) is not None:
            put(group, name, getattr(family, name), STATE_UNIT)
    _write_points(group, points)
    if marks:
        _write_points(group.create_group("marked"), [mark.point for mark in marks])
    put(group, "mark_residual", [mark.residual for mark in marks], "1")
    put(group, "mark_error", [mark.error for mark in marks], "1")
    if curve.branch.course is not None:
        write_course(group.create_group("course"), curve.branch.course)
    table = group.create_group("table")
    units = {"residual": "1", **PARAMETER_UNITS, **UNITS}
    for name, column in curve.table().items():
        put(table, name, column, units.get(name) or units[name.rsplit("_", 1)[0]])


def _write_points(group: Any, points: Sequence[BranchNode]) -> None:
    set_attribute(group, "corners", [point.corner for point in points])
    set_attribute(group, "in_log_omega", True)
    put(group, "point", [point.point for point in points], POINT_UNIT)
    put(group, "tangent", [point.tangent for point in points], "as point")
    put(group, "arclength", [point.arclength for point in points], "1")
    put(group, "step", [point.orbit.error for point in points], "1")
    condition = group.create_group("condition")
    name = type(points[0].condition).__name__
    set_attribute(condition, "kind", name.removesuffix("Condition"))
    rows = [_numbers_of(point.condition) for point in points]
    for name in rows[0]:
        put(condition, name, np.array([row[name] for row in rows], dtype=float), "relative or SI")


def _numbers_of(condition: Condition) -> dict[str, Any]:
    """The numbers of a condition, by the names of its fields."""
    names = {
        Singular: ("left", "right"),
        BranchPointCondition: ("left", "right", "unit"),
        Grazing: ("stop", "is_maximum", "phase", "unit", "half", "every"),
        Held: ("target",),
        Phase: ("begin", "path"),
        Turning: (),
    }[type(condition)]
    return {name: getattr(condition, name) for name in names}


def _read_curve(group: Group, laws: Laws, monitor: OwnMonitor | None) -> Curve | Branch | Backbone:
    family, kind = _read_family(group, laws), group.text("kind")
    reasons = group.texts("stop_reasons")
    nodes = _read_points(group, family, kind, monitor)
    if len(reasons) != 2 or not nodes:
        raise group.fault("attribute", "stop_reasons", "must have two entries, of some points")
    marks = _read_marks(group, family, nodes, kind, monitor)
    course = read_course(group.group("course"), nodes) if "course" in group else None
    branch = replace(
        make_branch(
            "", nodes, marks, (StopReason(reasons[0]), StopReason(reasons[1])), group.texts("notes")
        ),
        course=course,
    )
    if is_self_excited(branch):
        return _with_requested(replace(branch, name=group.text("name")))
    curve = Curve(kind, branch)
    if group.has_attribute("mode"):
        return Backbone(curve, group.whole("mode"))
    return _as_branch(curve) if nodes[0].condition is FREE else curve


def _with_requested(branch: Branch) -> Branch:
    """A branch with the orbits at the values that were asked for, found anew."""
    if branch.course is None or not branch.course.at:
        return branch
    return replace(branch, requested=tuple(requested(branch.places, branch.course.at)[0]))


def _read_points(
    group: Group, family: OrbitFamily, kind: str, monitor: OwnMonitor | None
) -> list[BranchNode]:
    """Points of a curve, or its marks, each in memory of its own; see `nldyn.io.branches`."""
    corners = group.texts("corners")
    count = len(corners)
    points = _unknowns(group, "point", family, count)
    tangents = group.array("tangent", *points.shape)
    lengths, steps = group.array("arclength", count), group.array("step", count)
    conditions = _read_conditions(group, family, count, points, kind, monitor)
    numbers = zip(
        points, conditions, tangents, steps.tolist(), lengths.tolist(), corners, strict=True
    )
    return [
        replace(
            _node(family, place.copy(), condition, step, length),
            tangent=tangent.copy(), corner=corner,
        )
        for place, condition, tangent, step, length, corner in numbers
    ]  # fmt: skip


def _unknowns(group: Group, name: str, family: OrbitFamily, count: int) -> Real:
    """Unknowns (count, N + m); in version 1 the frequency's coordinate was the logarithm of Hz."""
    found = group.array(name, count, family.n_states + family.n_free)
    if not group.has_attribute("in_log_omega"):
        for place, chart in enumerate(family.charts, family.n_states):
            if chart.parameter.name == FREQUENCY:
                found[:, place] += math.log(2.0 * math.pi)
    return found


def _read_family(group: Group, laws: Laws) -> OrbitFamily:
    flow = read_flow(group.group("flow_map"), laws)
    names = group.texts("parameters")
    charts = []
    for name, numbers in zip(names, group.array("ranges", len(names), -1).tolist(), strict=True):
        index, low, high, *unit = numbers  # files of earlier versions have no unit
        chosen = checked_parameter(flow.system, Parameter(name, int(index)))
        charts.append(replace(Chart.of(chosen, (low, high)), unit=unit[0] if unit else 0.0))
    problem = ShootingProblem(flow, group.whole("period"), group.whole("segments"))
    held = group.number("frequency_hz")
    family = OrbitFamily(problem, group.text("observe"), held, tuple(charts))
    if group.has_attribute("least"):  # not in files of earlier versions
        family = replace(family, least=group.number("least"))
    if "unfolding" in group:
        family = family.unfolded(group.array("unfolding", family.n_states))
    if "origin" in group:
        family = replace(family, origin=group.array("origin", family.n_states))
    return family


def _read_marks(
    group: Group,
    family: OrbitFamily,
    nodes: Sequence[BranchNode],
    kind: str,
    monitor: OwnMonitor | None,
) -> list[SpecialPoint]:
    """The marks; of earlier versions each with the condition of the point nearest to it."""
    kinds = group.texts("marks")
    errors = group.array("mark_error", len(kinds)).tolist()
    found: list[BranchNode] = []
    if "marked" in group:
        found = _read_points(group.group("marked"), family, kind, monitor)
    elif kinds:
        points = np.array([node.point for node in nodes])
        places = _unknowns(group, "mark_point", family, len(kinds))
        for place, error in zip(places, errors, strict=True):
            nearest = nodes[int(np.argmin(np.abs(points - place).max(axis=1)))]
            found.append(_node(family, place, nearest.condition, error, nearest.arclength))
    return list(map(SpecialPoint, kinds, found, errors))


def _node(
    family: OrbitFamily, place: Real, condition: Condition, error: float, arclength: float
) -> BranchNode:
    """A point of a curve without direction, the rigid stop passed that a grazing passes."""
    if isinstance(condition, Grazing):
        family = family.past(condition.passages)
    elif isinstance(condition, Phase):
        family = family.unfolded(family.from_origin(place))
    orbit = Evaluation(family, place).make_orbit(error)
    return BranchNode(family, place, orbit, np.zeros(place.size), arclength, condition=condition)


def _read_conditions(
    curve: Group,
    family: OrbitFamily,
    count: int,
    points: Real,
    of: str,
    monitor: OwnMonitor | None,
) -> list[Condition]:
    group, n = curve.group("condition"), family.n_states
    kind = group.text("kind")
    if kind == "Free":
        return [FREE] * count
    if kind == "Turning":
        return [Turning()] * count
    if kind == "Phase":
        size = family.problem.size
        return list(map(Phase, group.array("begin", count, size), group.array("path", count, size)))
    if kind == "BranchPoint":
        left, unit = group.array("left", count, n), group.array("unit", count, n + 1)
        return list(map(BranchPointCondition, left, group.array("right", count, 2, n + 1), unit))
    if kind == "Singular":
        left, right = group.array("left", count, -1), group.array("right", count, -1)
        return [Singular(of, *borders) for borders in zip(left, right, strict=True)]
    if kind == "Grazing":
        columns = [group.array(x, count) for x in ("stop", "is_maximum", "phase", "unit")]
        for x in ("half", "every"):  # of rigid stops; files of earlier versions have none
            columns.append(group.array(x, count) if x in group else np.zeros(count))
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return [
            Grazing(int(stop), bool(top), phase, unit, half=half, every=every)
            for stop, top, phase, unit, half, every in rows
        ]
    if kind != "Held":
        raise group.fault("attribute", "kind", f"names an unknown condition '{kind}'")
    held = MONITORS.get(of.partition(" ")[0], monitor)
    if held is None:
        raise SystemModelError(
            f"{group.path}: the curve holds '{of}' constant, a function that a file cannot hold: "
            "pass monitor="
        )
    conditions = [Held(of, held, target) for target in group.array("target", count).tolist()]
    if abs(float(conditions[0].value(Evaluation(family, points[0]))[0])) > HELD:
        raise SystemModelError(
            f"{group.path}: the monitor passed is not '{of}', which the curve holds constant"
        )
    return list(conditions)
