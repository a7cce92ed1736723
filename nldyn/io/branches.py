"""Branches in HDF5 files: everything that makes them up, to the last digit.

A file has the attributes ``format``, ``format_version`` and ``software``; a group for each flow
map (system and accuracy) in ``flow_maps``, one for each branch in ``branches``, and in each branch
one for its ``nodes``, ``special_points`` and ``requested`` points, one for its ``course``, and a
``table`` of what is reported of the nodes, which other software may read and this one does not.
A ``search`` for further branches has a group of its own.
Datasets carry their unit as the attribute ``unit``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError
from nldyn.bifurcations.events import event_of
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.branches.branch import Branch, Course, WalkEnd
from nldyn.branches.checkpoint import Tally
from nldyn.branches.continuation import alike
from nldyn.branches.endings import StopReason
from nldyn.branches.step_control import ContinuationOptions
from nldyn.branches.tables import UNITS, orbit_columns
from nldyn.engine.layout import RECORD_COLUMNS, Record
from nldyn.flow.flow_map import FlowMap, Trajectory, same_flow
from nldyn.io.flow import STATE_UNIT, Laws, checked_laws, read_flow, write_flow
from nldyn.io.hdf5 import Group, new_file, opened, put, set_attribute
from nldyn.orbits.bordered import OrbitFamily
from nldyn.orbits.shooting import ShootingProblem
from nldyn.search.diagram import Diagram
from nldyn.search.exploration import Coverage, Exploration, ExploreOptions, Question, Stage
from nldyn.system.chart import NAMES, THE_FREQUENCY, Chart, OwnParameter, checked_parameter, unit_of
from nldyn.system.parameters import Parameter

FORMAT = "nldyn branches"
FORMAT_VERSION = 3
LIMITS = "limits", "range_hz"  # ends of a range, and what older files call them
UNKNOWNS = f"{STATE_UNIT}; the last column: logarithm of rad/s, or the parameter's coordinate"
RECORD_UNITS = {"phase": "rad", "duration": "s", "w": STATE_UNIT, "force": "N", "depth": "m"}


def save_branches(path: str | Path, branches: Sequence[Branch], tally: Tally | None = None) -> None:
    """Write branches to one file, whole or not at all, and how far a search for others has come.

    Raises
    ------
    OutputError
        If the file cannot be written.
    SystemModelError
        If the points of a branch are of different systems.
    """
    _write(path, branches, {}, tally=tally)


def save_diagram(path: str | Path, diagram: Diagram) -> None:
    """Write a diagram with its branches to one file, whole or not at all."""
    _write(path, diagram.branches, of_diagram(diagram))


def save_exploration(path: str | Path, found: Exploration) -> None:
    """Write an exploration to one file, whole or not at all."""
    diagram = found.diagram
    _write(path, diagram.branches, of_diagram(diagram), found)


def of_diagram(diagram: Diagram) -> dict[str, Any]:
    """What a diagram has beside its branches; of an axis that is not the frequency, that too."""
    about: dict[str, Any] = {"limits": diagram.limits, "observe": diagram.observe}
    about["notes"] = diagram.notes
    if diagram.frequency_hz is not None:
        about["frequency_hz"] = diagram.frequency_hz
    _check_written(diagram.parameter)
    if diagram.parameter != THE_FREQUENCY:
        about |= {"parameter": diagram.parameter.name, "index": diagram.parameter.index}
    return about


def _check_written(parameter: Parameter) -> None:
    """Refuse what a file cannot hold."""
    if isinstance(parameter, OwnParameter):
        raise SystemModelError(
            f"parameter '{parameter.name}' is a function of your own, which a file does not hold: "
            "keep the table() of its branches"
        )


def _is_diagram(root: Group) -> bool:
    return any(map(root.has_attribute, LIMITS))


def load_branches(path: str | Path, *, laws: Laws | None = None) -> list[Branch]:
    """Read all branches of a file; see `nldyn.load`."""
    with opened(path, FORMAT, FORMAT_VERSION) as root:
        return _read_branches(root, _read_flows(root, laws))


def load_bare_branches(path: Path, laws: Laws) -> tuple[list[Branch], Tally | None]:
    """Read what `save_branches` wrote, of a file that holds nothing else."""
    with opened(path, FORMAT, FORMAT_VERSION) as root:
        if _is_diagram(root):
            raise SystemModelError(f"{path}: holds a diagram or exploration, not branches alone")
        tally = _read_tally(root.group("search")) if "search" in root else None
        return _read_branches(root, _read_flows(root, laws)), tally


def load_diagram(path: str | Path, *, laws: Laws | None = None) -> Diagram:
    """Read a diagram with its branches."""
    with opened(path, FORMAT, FORMAT_VERSION) as root:
        if not _is_diagram(root):
            raise SystemModelError(f"{path}: holds branches without a diagram")
        return read_diagram(root, _read_branches(root, _read_flows(root, laws)))


def load_exploration(path: str | Path, *, laws: Laws | None = None) -> Exploration:
    """Read an exploration, or what `explore` keeps while it works."""
    with opened(path, FORMAT, FORMAT_VERSION) as root:
        if "exploration" not in root:
            raise SystemModelError(f"{path}: holds no exploration")
        flows = _read_flows(root, laws)
        diagram = read_diagram(root, _read_branches(root, flows))
        question, stage = _read_exploration(root.group("exploration"), flows, diagram)
        return Exploration(diagram, question, stage)


def _write(
    path: str | Path,
    branches: Sequence[Branch],
    attributes: Mapping[str, Any],
    exploration: Exploration | None = None,
    tally: Tally | None = None,
) -> None:
    """Write a file of branches."""
    flows: list[FlowMap] = []
    with new_file(path, FORMAT, FORMAT_VERSION) as file:
        for key, value in attributes.items():
            set_attribute(file, key, value)
        groups = file.create_group("branches")
        for number, branch in enumerate(branches):
            _write_branch(groups.create_group(f"{number:04d}"), branch, flows)
        if exploration is not None:
            _write_exploration(file.create_group("exploration"), exploration, flows)
        if tally is not None:
            _write_tally(file.create_group("search"), tally)
        maps = file.create_group("flow_maps")
        for number, flow in enumerate(flows):
            write_flow(maps.create_group(f"{number:04d}"), flow)


def _write_branch(group: Any, branch: Branch, flows: list[FlowMap]) -> None:
    family, observe = branch.nodes[0].family, branch.nodes[0].orbit.observe
    problem = family.problem
    others = [special.point for special in branch.special_points]
    for point in (*branch.nodes, *others, *branch.requested):
        mine = point.family.problem
        if (
            not same_flow(mine.flow, problem.flow)
            or (mine.period, mine.segments) != (problem.period, problem.segments)
            or point.orbit.observe != observe
            or point.family.scales != family.scales
        ):
            raise SystemModelError(
                f"branch '{branch.name}' cannot be saved: its points are of different systems, "
                "flow maps or shooting problems"
            )
    number = _number_of(problem.flow, flows)
    chart = family.charts[0]
    if not family.in_frequency_alone:
        _check_written(chart.parameter)
        part = group.create_group("parameter")
        for key in ("name", "index"):
            set_attribute(part, key, getattr(chart.parameter, key))
        for key in ("low", "high", "unit"):
            set_attribute(part, key, getattr(chart, key))
        set_attribute(part, "frequency_hz", family.frequency_hz)
    for key, value in {
        "name": branch.name,
        "period": branch.period,
        "segments": problem.segments,
        "flow_map": number,
        "observe": observe,
        "stop_reasons": branch.stop_reasons,
        "notes": branch.notes,
    }.items():
        set_attribute(group, key, value)
    _write_points(group.create_group("nodes"), branch.nodes, problem)
    special = group.create_group("special_points")
    _write_points(special, others, problem)
    set_attribute(special, "kinds", [s.kind for s in branch.special_points])
    put(special, "root_error", [s.error for s in branch.special_points], "1")
    _write_points(group.create_group("requested"), branch.requested, problem)
    table = group.create_group("table")
    for name, column in orbit_columns(branch.points).items():
        put(table, name, column, UNITS[name])
    if branch.course is not None:
        write_course(group.create_group("course"), branch.course)


def _number_of(flow: FlowMap, flows: list[FlowMap]) -> int:
    """Number of a flow map among those of the file, to which it is added if it is new."""
    if not any(same_flow(flow, other) for other in flows):
        flows.append(flow)
    return next(i for i, other in enumerate(flows) if same_flow(other, flow))


def _write_exploration(group: Any, found: Exploration, flows: list[FlowMap]) -> None:
    question, stage = found.question, found.stage
    set_attribute(group, "flow_map", _number_of(question.flow, flows))
    set_attribute(group, "max_period", question.max_period)
    for name, value in asdict(question.effort).items():
        if value is not None:
            set_attribute(group, f"effort {name}", value)
    _write_options(group, question.options)
    for name in ("steps", "branches", "notes", "given"):
        set_attribute(group, name, getattr(stage, name))
    put(group, "carried", stage.carried, STATE_UNIT)
    put(group, "met", np.asarray(stage.met, dtype=np.int64), "1 where motions came to a branch")
    put(group, "ends", np.array(stage.ends, dtype=np.int64), "branches at each round's end")
    table = group.create_group("coverage")
    coverage = stage.coverage
    unit = unit_of(question.axis.parameter)
    put(table, "value", np.array([c.value for c in coverage], dtype=float), unit)
    for name in ("settled", "unsettled", "failed"):
        put(table, name, np.array([getattr(c, name) for c in coverage], dtype=np.int64), "1")
    attractors = np.array([len(c.periods) for c in coverage], dtype=np.int64)
    periods = np.array([n for c in coverage for n in c.periods], dtype=np.int64)
    put(table, "different_periods", attractors, "1")
    put(table, "periods", periods, "1; those of one value after the other")


def _write_tally(group: Any, tally: Tally) -> None:
    for name in ("question", "given", "known", "done", "tried", "came"):
        set_attribute(group, name, getattr(tally, name))
    put(group, "met", np.array(sorted(tally.met), dtype=np.int64), "1; numbers of known branches")


def _write_options(group: Any, options: ContinuationOptions) -> None:
    for name, value in asdict(options).items():
        set_attribute(group, f"option {name}", value)


def _write_points(group: Any, points: Sequence[BranchNode], problem: ShootingProblem) -> None:
    orbits = [point.orbit for point in points]
    length, size, count = problem.segments * problem.size + 1, problem.size, len(points)

    def stacked(arrays: Iterable[ArrayLike], *shape: int) -> Real:
        return np.array(list(arrays), dtype=float).reshape(count, *shape)

    unknowns = stacked((point.point for point in points), length)
    put(group, "point", unknowns, UNKNOWNS)
    put(group, "tangent", stacked((p.tangent for p in points), length), "as point")
    put(group, "arclength", stacked(p.arclength for p in points), "1")
    jacobians = stacked((o.jacobians for o in orbits), problem.segments, size, size)
    put(group, "jacobians", jacobians, "1")
    put(group, "error", stacked(o.error for o in orbits), "1")
    _write_motions(group.create_group("motion"), [o.motion for o in orbits], problem.flow)


def _write_motions(group: Any, motions: Sequence[Trajectory | None], flow: FlowMap) -> None:
    """Recorded motions, one after the other; an orbit without one has no pieces."""
    stops = len(flow.system.stops)
    known = [motion for motion in motions if motion is not None]
    pieces = [0 if motion is None else motion.record.phase.size for motion in motions]
    put(group, "pieces", np.array(pieces, dtype=np.int64), "1")
    omega = [math.nan if motion is None else motion.omega for motion in motions]
    put(group, "omega", np.array(omega, dtype=float), "rad/s")
    closings = [np.zeros(stops) if motion is None else motion.closings for motion in motions]
    put(group, "closings", np.array(closings, dtype=np.int64).reshape(len(motions), stops), "1")
    for name, empty in _record_columns(flow):
        parts = [getattr(motion.record, name) for motion in known]
        put(group, name, np.concatenate([empty, *parts]), RECORD_UNITS.get(name, "1"))


def _record_columns(flow: FlowMap) -> list[tuple[str, NDArray[Any]]]:
    """Names of the columns of a record, and empty ones."""
    empty = flow._record(0)
    return [(name, getattr(empty, name)) for name in RECORD_COLUMNS]


def write_course(group: Any, course: Course) -> None:
    """Write how a branch or curve was continued."""
    set_attribute(group, "limits", course.limits)
    if course.further:
        put(group, "further", course.further, "of the further parameters")
    set_attribute(group, "start", course.start)
    set_attribute(group, "special_points_before", course.special_points_before)
    set_attribute(group, "notes_before", course.notes_before)
    if course.events:
        set_attribute(group, "events", [event.kind for event in course.events])
    _write_options(group, course.options)
    put(group, "at", np.array(course.at, dtype=float), "of the parameter")
    put(group, "open_ends", course.open_ends, UNKNOWNS)
    for name, end_ in zip(("backward", "forward"), course.ends, strict=True):
        if end_ is not None:
            part = group.create_group(name)
            for key in ("step", "count", "node", "kept", "special_points", "notes"):
                set_attribute(part, key, getattr(end_, key))
            put(part, "behind", end_.behind, "as point")


def _read_flows(root: Group, laws: Laws | None) -> list[FlowMap]:
    known = checked_laws(laws)
    return [read_flow(group, known) for group in root.group("flow_maps").groups()]


def _read_branches(root: Group, flows: Sequence[FlowMap]) -> list[Branch]:
    return [_read_branch(group, flows) for group in root.group("branches").groups()]


def read_diagram(root: Group, branches: Sequence[Branch]) -> Diagram:
    """The diagram that has these branches, from what a file has beside them."""
    limits, observe = _limits(root), root.text("observe")
    parameter, held = THE_FREQUENCY, None
    if root.has_attribute("parameter"):
        parameter = Parameter(root.text("parameter"), root.whole("index"))
        if parameter.name not in NAMES:
            raise root.fault("attribute", "parameter", f"is unknown: '{parameter.name}'")
    if root.has_attribute("frequency_hz"):
        held = root.number("frequency_hz")
    return Diagram(tuple(branches), limits, observe, tuple(root.texts("notes")), parameter, held)


def _flow_of(group: Group, flows: Sequence[FlowMap]) -> FlowMap:
    number = group.whole("flow_map")
    if not 0 <= number < len(flows):
        raise group.fault("attribute", "flow_map", f"is {number}, but there are {len(flows)}")
    return flows[number]


def _read_branch(group: Group, flows: Sequence[FlowMap]) -> Branch:
    problem = ShootingProblem(
        _flow_of(group, flows), group.whole("period"), group.whole("segments")
    )
    observe = group.text("observe")
    if observe not in problem.flow.system.interfaces:
        raise group.fault("attribute", "observe", f"names an unknown interface '{observe}'")
    family = _read_family(group, problem, observe)
    nodes = _read_points(group.group("nodes"), family)
    special = group.group("special_points")
    points = _read_points(special, family)
    kinds = special.texts("kinds")
    if len(kinds) != len(points):
        raise special.fault("attribute", "kinds", f"has {len(kinds)} of {len(points)} entries")
    errors = special.array(
        "frequency_error" if "frequency_error" in special else "root_error", len(points)
    )
    reasons = group.texts("stop_reasons")
    if not nodes:
        raise group.fault("group", "nodes", "is empty")
    if len(reasons) != 2:
        raise group.fault("attribute", "stop_reasons", "must have two entries")
    return Branch(
        group.text("name"),
        problem.period,
        tuple(nodes),
        tuple(map(SpecialPoint, kinds, points, errors.tolist())),
        (StopReason(reasons[0]), StopReason(reasons[1])),
        tuple(group.texts("notes")),
        tuple(_read_points(group.group("requested"), family)),
        read_course(group.group("course"), nodes) if "course" in group else None,
    )


def _read_family(group: Group, problem: ShootingProblem, observe: str) -> OrbitFamily:
    """The family of a branch: in the frequency unless another parameter is told."""
    if "parameter" not in group:
        at = group.group("nodes").array("point", -1, problem.segments * problem.size + 1)
        low, high = _limits(group.group("course")) if "course" in group else _octave(at)
        return OrbitFamily(problem, observe, low, (Chart(THE_FREQUENCY, low, high),))
    part = group.group("parameter")
    parameter = Parameter(part.text("name"), part.whole("index"))
    low, high, unit = (part.number(key) for key in ("low", "high", "unit"))
    chart = Chart(checked_parameter(problem.flow.system, parameter), low, high, unit)
    return OrbitFamily(problem, observe, part.number("frequency_hz"), (chart,))


def _octave(points: Real) -> tuple[float, float]:
    """Frequencies in Hz about those of some points."""
    hz = np.exp(points[:, -1]) / (2.0 * math.pi)
    return 0.5 * float(hz.min(initial=1.0)), 2.0 * float(hz.max(initial=1.0))


def _limits(group: Group) -> tuple[float, float]:
    return group.pair(next((name for name in LIMITS if group.has_attribute(name)), LIMITS[0]))


def _read_points(group: Group, family: OrbitFamily) -> list[BranchNode]:
    problem = family.problem
    arclength = group.array("arclength", -1)
    count, size = arclength.size, problem.size
    point = group.array("point", count, problem.segments * size + 1)
    tangent = group.array("tangent", *point.shape)
    jacobians = group.array("jacobians", count, problem.segments, size, size)
    error = group.array("error", count)
    motions = _read_motions(group.group("motion"), count, problem.flow)
    # each in memory of its own, as in the run that computed it: some kernels of BLAS sum in an
    # order that depends on where in memory a vector begins
    found = []
    for i in range(count):
        place = point[i].copy()
        orbit = family.at(place).orbit_by(jacobians[i].copy(), float(error[i]))
        if motions[i] is not None:
            orbit = replace(orbit, motion=motions[i])
        place = orbit.point if family.in_frequency_alone else place
        found.append(BranchNode(family, place, orbit, tangent[i].copy(), float(arclength[i])))
    return found


def _read_motions(group: Group, count: int, flow: FlowMap) -> list[Trajectory | None]:
    pieces = group.array("pieces", count, kind=np.int64)
    total = int(pieces.sum())
    omega = group.array("omega", count)
    closings = group.array("closings", count, len(flow.system.stops), kind=np.int64)
    columns = {
        name: group.array(name, total, *empty.shape[1:], kind=empty.dtype.type)
        for name, empty in _record_columns(flow)
    }
    motions: list[Trajectory | None] = []
    end = 0
    for i, number in enumerate(pieces.tolist()):
        start, end = end, end + number
        part = {name: column[start:end] for name, column in columns.items()}
        record = Record.of(**part)
        motion = Trajectory(flow, float(omega[i]), record, closings[i], "")
        motions.append(motion if number else None)
    return motions


def read_course(group: Group, nodes: Sequence[BranchNode]) -> Course:
    """How a branch or curve was continued."""
    low, high = _limits(group)
    further = group.array("further", -1, 2).tolist() if "further" in group else []
    start = group.whole("start")
    if not 0 <= start < len(nodes):
        raise group.fault("attribute", "start", f"is {start}, but there are {len(nodes)} points")
    backward, forward = (
        _read_end(group.group(name), count) if name in group else None
        for name, count in (("backward", start + 1), ("forward", len(nodes) - start))
    )
    return Course(
        (low, high),
        _read_options(group),
        _read_open_ends(group, nodes[0].family),
        tuple(group.array("at", -1).tolist()),
        start,
        group.whole("special_points_before"),
        group.whole("notes_before"),
        (backward, forward),
        tuple(map(event_of, group.texts("events"))) if group.has_attribute("events") else (),
        tuple((a, b) for a, b in further),
    )


def _read_open_ends(group: Group, family: OrbitFamily) -> Real:
    """Where other branches were broken off; version 1 has a dataset for each end."""
    if group.has_group("open_ends"):
        return alike(family, group.group("open_ends").arrays())
    return group.array("open_ends", -1, family.n_states + family.n_free)


def _read_tally(group: Group) -> Tally | None:
    """None of a version that did not tell how many branches were known, which begins anew."""
    if not group.has_attribute("known"):
        return None
    names = "given", "known", "done", "tried", "came"
    given, known, done, tried, came = map(group.whole, names)
    met = frozenset(group.array("met", -1, kind=np.int64).tolist())
    return Tally(group.text("question"), given, known, done, tried, came, met)


def _read_options(group: Group) -> ContinuationOptions:
    lengths = {
        item.name: group.number(f"option {item.name}")
        for item in fields(ContinuationOptions)
        if item.name != "max_points"
    }
    return ContinuationOptions(**lengths, max_points=group.whole("option max_points"))


def _read_exploration(
    group: Group, flows: Sequence[FlowMap], diagram: Diagram
) -> tuple[Question, Stage]:
    efforts: dict[str, Any] = {
        item.name: (group.number if item.name == "spacing" else group.whole)(f"effort {item.name}")
        for item in fields(ExploreOptions)
        if item.name == "spacing" or group.has_attribute(f"effort {item.name}")
    }
    guesses = dict.fromkeys(("pseudo_orbits", "mixtures", "walks"), 0)
    efforts = {**guesses, **efforts}  # what a file does not have was not done
    question = Question(
        _flow_of(group, flows),
        diagram.axis,
        group.whole("max_period"),
        diagram.observe,
        ExploreOptions(**efforts),
        _read_options(group),
    )
    steps, branches, notes = (group.whole(name) for name in ("steps", "branches", "notes"))
    given = group.whole("given") if group.has_attribute("given") else 0
    carried = group.array("carried", -1, question.flow.system.state_size)
    coverage = _read_coverage(group.group("coverage"))
    ends = tuple(group.array("ends", -1, kind=np.int64).tolist())
    met = group.array("met", -1, branches, kind=np.int64) > 0
    done, here, length = question.place(max(steps, 0))
    reached = sum(len(question.values(turn)) for turn in range(done)) + min(here, length // 2)
    if steps < 0 or len(coverage) != reached or len(ends) != done or not 0 <= len(met) - done <= 1:
        raise group.fault("attribute", "steps", f"is {steps} with {len(coverage)} values")
    for name, value, most in (
        ("branches", branches, len(diagram.branches)),
        ("notes", notes, len(diagram.notes)),
        ("given", given, branches),
    ):
        if not 0 <= value <= most:
            raise group.fault("attribute", name, f"is {value}, but there are {most}")
    return question, Stage(steps, branches, notes, carried, coverage, met, ends, given)


def _read_coverage(group: Group) -> tuple[Coverage, ...]:
    values = group.array("value" if "value" in group else "frequency_hz", -1)
    counts = [
        group.array(name, values.size, kind=np.int64).tolist()
        for name in ("settled", "unsettled", "failed")
    ]
    different = group.array("different_periods", values.size, kind=np.int64)
    periods = group.array("periods", int(different.sum()), kind=np.int64)
    parts = np.split(periods, np.cumsum(different)[:-1]) if values.size else []
    rows = zip(values.tolist(), (tuple(part.tolist()) for part in parts), *counts, strict=True)
    return tuple(Coverage(*row) for row in rows)


def _read_end(group: Group, nodes: int) -> WalkEnd:
    node, kept = group.whole("node"), group.whole("kept")
    if not 0 <= kept <= node < nodes:
        raise group.fault("attribute", "node", f"is {node} with {kept} before, of {nodes} points")
    return WalkEnd(
        group.number("step"),
        group.array("behind", -1, -1),
        group.whole("count"),
        node,
        kept,
        group.whole("special_points"),
        group.whole("notes"),
    )
