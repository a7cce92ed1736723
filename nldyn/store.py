"""Branches in HDF5 files: everything that makes them up, to the last digit.

A file has the attributes ``format``, ``format_version`` and ``software``; a group for each flow
map (system and accuracy) in ``flow_maps``, one for each branch in ``branches``, and in each branch
one for its ``nodes``, ``special_points`` and ``requested`` points, one for its ``course``, and a
``table`` of what is reported of the nodes, which other software may read and this one does not.
Datasets carry their unit as the attribute ``unit``.
"""

from __future__ import annotations

import io
import math
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nldyn._kernels import Record
from nldyn.branch import Branch, BranchPoint, Course, SpecialPoint, WalkEnd
from nldyn.contact_law import ContactLaw
from nldyn.continuation import ContinuationOptions, alike
from nldyn.diagrams import Diagram
from nldyn.elements import Damper, Excitation, HarmonicForce, Stop, Unbalance
from nldyn.errors import SystemModelError, check_types, shown
from nldyn.exploration import Coverage, Exploration, ExploreOptions, Question, Stage
from nldyn.flow import FlowMap, FlowOptions, Trajectory
from nldyn.linear import LinearPart, Real
from nldyn.orbit import Orbit
from nldyn.parameters import strength
from nldyn.result_directory import OutputError, in_use, is_writable
from nldyn.shooting import ShootingProblem
from nldyn.system import System, same_system
from nldyn.tables import UNITS, orbit_columns
from nldyn.version import software_version

FORMAT = "nldyn branches"
FORMAT_VERSION = 2
STATE_UNIT = "m kg^0.5"
RECORD_UNITS = {"phase": "rad", "duration": "s", "w": STATE_UNIT, "force": "N", "depth": "m"}
TRIALS = ((0.1, 0.0), (1.0, 0.1), (1.0, -0.1))  # penetration over its unit, speed in m/s

Laws = Mapping[int, ContactLaw]


def save_branches(path: str | Path, branches: Sequence[Branch]) -> None:
    """Write branches to one file, whole or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    SystemModelError
        If the points of a branch are of different systems.
    """
    write_whole(path, _content(branches, {}))


def save_diagram(path: str | Path, diagram: Diagram) -> None:
    """Write a diagram with its branches to one file, whole or not at all; see `Diagram.save`."""
    write_whole(path, _content(diagram.branches, _of_diagram(diagram)))


def save_exploration(path: str | Path, found: Exploration) -> None:
    """Write an exploration to one file, whole or not at all; see `Exploration.save`."""
    diagram = found.diagram
    write_whole(path, _content(diagram.branches, _of_diagram(diagram), found))


def _of_diagram(diagram: Diagram) -> dict[str, Any]:
    return {"range_hz": diagram.range_hz, "observe": diagram.observe, "notes": diagram.notes}


def load_branch(path: str | Path, name: str | None = None, *, laws: Laws | None = None) -> Branch:
    """Read a branch that `Branch.save` or `Diagram.save` wrote.

    Its points, special points and orbits have the numbers of the branch that was saved, and it can
    be extended as that one could.

    Parameters
    ----------
    path : str or Path
        The file.
    name : str, optional
        Name of the branch, if there are several in the file.
    laws : mapping of int to callable, optional
        Contact laws of the user's own by the number of their stop: a file holds numbers, no code.

    Returns
    -------
    Branch

    Raises
    ------
    SystemModelError
        If the file is not one of branches, is damaged, or was written by a later version; if the
        name does not tell one branch; if a law is missing or is another one.

    Examples
    --------
    >>> load_branch("nowhere.h5")
    Traceback (most recent call last):
        ...
    nldyn.errors.SystemModelError: nowhere.h5: there is no such file
    """
    branches = load_branches(path, laws=laws)
    found = branches if name is None else [b for b in branches if b.name == name]
    if len(found) != 1:
        names = ", ".join(f"'{branch.name}'" for branch in branches) or "none"
        wanted = "a name must choose one of its branches" if name is None else f"no '{name}'"
        raise SystemModelError(f"{path}: {wanted}; there are: {names}")
    return found[0]


def load_branches(path: str | Path, *, laws: Laws | None = None) -> list[Branch]:
    """Read all branches of a file; see `load_branch`."""
    with _opened(path) as root:
        return _read_branches(root, _read_flows(root, laws))


def load_bare_branches(path: Path, laws: Laws) -> list[Branch]:
    """Read the branches of a file that holds nothing else: writing them leaves nothing out."""
    with _opened(path) as root:
        if root.has_attribute("range_hz"):
            raise SystemModelError(f"{path}: holds a diagram or exploration, not branches alone")
        return _read_branches(root, _read_flows(root, laws))


def laws_of(system: System) -> Laws:
    """Contact laws of a system's own, by the numbers of their stops."""
    return {i: stop.law for i, stop in enumerate(system.stops) if stop.law}


def load_diagram(path: str | Path, *, laws: Laws | None = None) -> Diagram:
    """Read a diagram that `Diagram.save` wrote.

    Parameters
    ----------
    path : str or Path
        The file.
    laws : mapping of int to callable, optional
        See `load_branch`.

    Returns
    -------
    Diagram

    Raises
    ------
    SystemModelError
        As `load_branch`, and if the file holds branches without a diagram.
    """
    with _opened(path) as root:
        if not root.has_attribute("range_hz"):
            raise SystemModelError(f"{path}: holds branches without a diagram; use load_branches")
        return _read_diagram(root, _read_flows(root, laws))


def load_exploration(path: str | Path, *, laws: Laws | None = None) -> Exploration:
    """Read an exploration that `Exploration.save` wrote, or what `explore` keeps while it works.

    Parameters
    ----------
    path : str or Path
        The file.
    laws : mapping of int to callable, optional
        See `load_branch`.

    Returns
    -------
    Exploration

    Raises
    ------
    SystemModelError
        As `load_branch`, and if the file holds no exploration.
    """
    with _opened(path) as root:
        if "exploration" not in root:
            raise SystemModelError(f"{path}: holds no exploration; use load_branches")
        flows = _read_flows(root, laws)
        diagram = _read_diagram(root, flows)
        question, stage = _read_exploration(root.group("exploration"), flows, diagram)
        return Exploration(diagram, question, stage)


def same_flow(a: FlowMap, b: FlowMap) -> bool:
    """Whether two flow maps have the same numbers and laws, and states in the same coordinates."""
    return a is b or (
        a.options == b.options
        and same_system(a.system, b.system)
        and np.array_equal(a.system.linear.right, b.system.linear.right)
    )


def check_writable(path: str | Path) -> Path:
    """A path at which a file may be written, or an OutputError, before the work.

    Examples
    --------
    >>> check_writable("/no/such/folder/branch.h5")
    Traceback (most recent call last):
        ...
    nldyn.result_directory.OutputError: /no/such/folder/branch.h5: there is no such folder
    """
    try:
        target = Path(path)
        if "\0" in str(target):
            raise ValueError("it has a null character")
        if target.is_dir():
            raise OutputError(f"{path}: is a folder, not a file")
        if not target.parent.is_dir():
            raise OutputError(f"{path}: there is no such folder")
        if not is_writable(target.parent):
            raise OutputError(f"{path}: the folder is read-only")
    except (TypeError, ValueError) as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"{shown(path)} cannot be the name of a file: {error}") from None
    return target


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file beside its place, then put it there; on an error the place is as it was.

    Raises
    ------
    OutputError
        If the system refuses.
    """
    target = check_writable(path)
    draft = target.with_name(f".{target.name}.{secrets.token_hex(4)}.new")
    try:
        with draft.open("wb") as file, in_use(draft):
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, target)
    except OSError as error:
        fault = (error.strerror or str(error)).lower()
        raise OutputError(f"{path}: cannot be written: {fault}") from error
    finally:
        draft.unlink(missing_ok=True)


def _content(
    branches: Sequence[Branch],
    attributes: Mapping[str, Any],
    exploration: Exploration | None = None,
) -> bytes:
    """The bytes of a file of branches."""
    memory = io.BytesIO()
    flows: list[FlowMap] = []
    with h5py.File(memory, "w", libver=("v110", "v110")) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        file.attrs["software"] = f"nldyn {software_version()}"
        for key, value in attributes.items():
            _set_attribute(file, key, value)
        groups = file.create_group("branches")
        for number, branch in enumerate(branches):
            _write_branch(groups.create_group(f"{number:04d}"), branch, flows)
        if exploration is not None:
            _write_exploration(file.create_group("exploration"), exploration, flows)
        maps = file.create_group("flow_maps")
        for number, flow in enumerate(flows):
            _write_flow(maps.create_group(f"{number:04d}"), flow)
    return memory.getvalue()


def _write_branch(group: Any, branch: Branch, flows: list[FlowMap]) -> None:
    problem, observe = branch.nodes[0].orbit.problem, branch.nodes[0].orbit.observe
    others = [special.point for special in branch.special_points]
    for point in (*branch.nodes, *others, *branch.requested):
        mine = point.orbit.problem
        if (
            not same_flow(mine.flow, problem.flow)
            or (mine.period, mine.segments) != (problem.period, problem.segments)
            or point.orbit.observe != observe
        ):
            raise SystemModelError(
                f"branch '{branch.name}' cannot be saved: its points are of different systems, "
                "flow maps or shooting problems"
            )
    number = _number_of(problem.flow, flows)
    for key, value in {
        "name": branch.name,
        "period": branch.period,
        "segments": problem.segments,
        "flow_map": number,
        "observe": observe,
        "stop_reasons": branch.stop_reasons,
        "notes": branch.notes,
    }.items():
        _set_attribute(group, key, value)
    _write_points(group.create_group("nodes"), branch.nodes, problem)
    special = group.create_group("special_points")
    _write_points(special, others, problem)
    _set_attribute(special, "kinds", [s.kind for s in branch.special_points])
    _put(special, "frequency_error", [s.frequency_error for s in branch.special_points], "1")
    _write_points(group.create_group("requested"), branch.requested, problem)
    table = group.create_group("table")
    for name, column in orbit_columns(branch.points).items():
        _put(table, name, column, UNITS[name])
    if branch.course is not None:
        _write_course(group.create_group("course"), branch.course)


def _number_of(flow: FlowMap, flows: list[FlowMap]) -> int:
    """Number of a flow map among those of the file, to which it is added if it is new."""
    if not any(same_flow(flow, other) for other in flows):
        flows.append(flow)
    return next(i for i, other in enumerate(flows) if same_flow(other, flow))


def _write_exploration(group: Any, found: Exploration, flows: list[FlowMap]) -> None:
    question, stage = found.question, found.stage
    _set_attribute(group, "flow_map", _number_of(question.flow, flows))
    _set_attribute(group, "max_period", question.max_period)
    for name, value in asdict(question.effort).items():
        if value is not None:
            _set_attribute(group, f"effort {name}", value)
    _write_options(group, question.options)
    for name in ("steps", "branches", "notes", "given", "folds_followed"):
        _set_attribute(group, name, getattr(stage, name))
    _put(group, "carried", stage.carried, STATE_UNIT)
    _put(group, "met", np.asarray(stage.met, dtype=np.int64), "1 where motions came to a branch")
    _put(group, "ends", np.array(stage.ends, dtype=np.int64), "branches at each round's end")
    table = group.create_group("coverage")
    coverage = stage.coverage
    _put(table, "frequency_hz", np.array([c.frequency_hz for c in coverage], dtype=float), "Hz")
    for name in ("settled", "unsettled", "failed"):
        _put(table, name, np.array([getattr(c, name) for c in coverage], dtype=np.int64), "1")
    attractors = np.array([len(c.periods) for c in coverage], dtype=np.int64)
    periods = np.array([n for c in coverage for n in c.periods], dtype=np.int64)
    _put(table, "different_periods", attractors, "1")
    _put(table, "periods", periods, "1; those of one frequency after the other")


def _write_options(group: Any, options: ContinuationOptions) -> None:
    for name, value in asdict(options).items():
        _set_attribute(group, f"option {name}", value)


def _write_points(group: Any, points: Sequence[BranchPoint], problem: ShootingProblem) -> None:
    orbits = [point.orbit for point in points]
    length, size, count = problem.segments * problem.size + 1, problem.size, len(points)

    def stacked(arrays: Iterable[ArrayLike], *shape: int) -> Real:
        return np.array(list(arrays), dtype=float).reshape(count, *shape)

    unknowns = stacked((orbit.point for orbit in orbits), length)
    _put(group, "point", unknowns, f"{STATE_UNIT}; the last column: logarithm of rad/s")
    _put(group, "tangent", stacked((p.tangent for p in points), length), "as point")
    _put(group, "arclength", stacked(p.arclength for p in points), "1")
    jacobians = stacked((o.jacobians for o in orbits), problem.segments, size, size)
    _put(group, "jacobians", jacobians, "1")
    _put(group, "error", stacked(o.error for o in orbits), "1")
    _write_motions(group.create_group("motion"), [o.motion for o in orbits], problem.flow)


def _write_motions(group: Any, motions: Sequence[Trajectory | None], flow: FlowMap) -> None:
    """Recorded motions, one after the other; an orbit without one has no pieces."""
    stops = len(flow.system.stops)
    known = [motion for motion in motions if motion is not None]
    pieces = [0 if motion is None else motion.record.phase.size for motion in motions]
    _put(group, "pieces", np.array(pieces, dtype=np.int64), "1")
    omega = [math.nan if motion is None else motion.omega for motion in motions]
    _put(group, "omega", np.array(omega, dtype=float), "rad/s")
    closings = [np.zeros(stops) if motion is None else motion.closings for motion in motions]
    _put(group, "closings", np.array(closings, dtype=np.int64).reshape(len(motions), stops), "1")
    for name, empty in _record_columns(flow):
        parts = [getattr(motion.record, name) for motion in known]
        _put(group, name, np.concatenate([empty, *parts]), RECORD_UNITS.get(name, "1"))


def _record_columns(flow: FlowMap) -> list[tuple[str, NDArray[Any]]]:
    """Names of the columns of a record, and empty ones."""
    empty = flow._record(0)
    return [(name, getattr(empty, name)) for name in Record._fields if name != "used"]


def _write_course(group: Any, course: Course) -> None:
    _set_attribute(group, "range_hz", course.range_hz)
    _set_attribute(group, "start", course.start)
    _set_attribute(group, "special_points_before", course.special_points_before)
    _set_attribute(group, "notes_before", course.notes_before)
    _write_options(group, course.options)
    _put(group, "at", np.array(course.at, dtype=float), "Hz")
    _put(group, "open_ends", course.open_ends, f"{STATE_UNIT}; the last: logarithm of rad/s")
    for name, end_ in zip(("backward", "forward"), course.ends, strict=True):
        if end_ is not None:
            part = group.create_group(name)
            for key in ("step", "count", "node", "kept", "special_points", "notes"):
                _set_attribute(part, key, getattr(end_, key))
            _put(part, "behind", end_.behind, "as point")


def _write_flow(group: Any, flow: FlowMap) -> None:
    for key, value in asdict(flow.options).items():
        if value is not None:
            _set_attribute(group, key, value)
    system, linear = flow.system, flow.system.linear
    _put(group, "natural_frequencies", system.natural_frequencies, "rad/s")
    _put(group, "damping", system.damping, "1/s")
    _set_attribute(group, "interfaces", system.interfaces)
    vectors = np.array([system.participation[name] for name in system.interfaces], dtype=float)
    _put(group, "participation", vectors.reshape(-1, system.size), "kg^-0.5")
    basis = group.create_group(
        "basis"
    )  # the states' coordinates: another computer may choose others
    _put(basis, "blocks", linear.blocks, "1/s")
    _put(basis, "right", linear.right, "kg^-0.5 for displacements")
    _put(basis, "left", linear.left, "kg^0.5 for displacements")
    _put(basis, "growth", linear.growth, "1")
    _set_attribute(basis, "condition", linear.condition)
    stops = system.stops
    _write_columns(
        group.create_group("stops"),
        {"at": [s.at for s in stops], "against": [s.against or "" for s in stops]},
        {
            "stiffness": ("N/m^exponent", [s.stiffness for s in stops]),
            "exponent": ("1", [s.exponent for s in stops]),
            "gap": ("m", [s.gap for s in stops]),
            "direction": ("1", [s.direction for s in stops]),
            "dissipation": ("s/m", [s.dissipation for s in stops]),
            "is_against": ("1", [s.against is not None for s in stops]),
            "has_own_law": ("1", [s.law is not None for s in stops]),
            "law_trials": ("N, N/m, N s/m", [_trials(s) for s in stops]),
        },
    )
    _write_columns(
        group.create_group("dampers"),
        {"at": [d.at for d in system.dampers]},
        {"coefficient": ("N s/m", [d.coefficient for d in system.dampers])},
    )
    sources = system.excitation
    _write_columns(
        group.create_group("excitation"),
        {
            "at": [s.at for s in sources],
            "kind": ["unbalance" if isinstance(s, Unbalance) else "harmonic" for s in sources],
        },
        {
            "size": ("kg m of an unbalance, else N", [strength(s) for s in sources]),
            "phase_deg": ("degree", [s.phase_deg for s in sources]),
        },
    )


def _write_columns(
    group: Any, texts: Mapping[str, Sequence[str]], numbers: Mapping[str, tuple[str, Sequence[Any]]]
) -> None:
    for name, values in texts.items():
        _set_attribute(group, name, values)
    for name, (unit, column) in numbers.items():
        _put(group, name, np.array(column, dtype=float), unit)


def _trials(stop: Stop) -> list[tuple[float, float, float]]:
    """What a stop's own law gives at a few penetrations and speeds, to know it again."""
    law = stop.law
    if law is None:
        return [(0.0, 0.0, 0.0) for _ in TRIALS]
    unit = stop.stiffness ** (-1.0 / stop.exponent)
    return [law(share * unit, speed) for share, speed in TRIALS]


def _put(group: Any, name: str, values: ArrayLike, unit: str) -> None:
    """A dataset with its unit and, so that damage is noticed, with checksums."""
    array = np.asarray(values)
    packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
    data = group.create_dataset(name, data=array, **(packed if array.size else {}))
    data.attrs["unit"] = unit


def _set_attribute(group: Any, key: str, value: Any) -> None:
    texts = [value] if isinstance(value, str) else value
    if isinstance(texts, list | tuple) and all(isinstance(text, str) for text in texts):
        # texts of fixed length lie where HDF5 keeps a checksum, others do not
        encoded = [text.encode() for text in texts]
        length = max(1, *(len(text) for text in encoded), 1)
        kind = h5py.string_dtype("utf-8", length)
        shape = () if isinstance(value, str) else (len(encoded),)
        group.attrs.create(key, np.array(encoded, dtype=kind).reshape(shape), dtype=kind)
    else:
        group.attrs[key] = np.asarray(value)


class _Group:
    """A group of a file; what is missing or of another kind is told with file and place."""

    def __init__(self, path: str | Path, group: Any) -> None:
        self.path, self._group = path, group

    def __contains__(self, name: str) -> bool:
        return name in self._group

    def fault(self, kind: str, name: str, what: str) -> SystemModelError:
        place = f"{self._group.name.rstrip('/')}/{name}"
        return SystemModelError(f"{self.path}: {kind} '{place}' {what}")

    def group(self, name: str) -> _Group:
        inner = self._group.get(name)
        if not isinstance(inner, h5py.Group):
            raise self.fault("group", name, "is missing")
        return _Group(self.path, inner)

    def has_group(self, name: str) -> bool:
        return isinstance(self._group.get(name), h5py.Group)

    def groups(self) -> list[_Group]:
        return [self.group(name) for name in sorted(self._group)]

    def array(self, name: str, *shape: int, kind: type = float) -> NDArray[Any]:
        """A dataset of a shape, of which -1 may be any length."""
        data = self._group.get(name)
        if not isinstance(data, h5py.Dataset):
            raise self.fault("dataset", name, "is missing")
        try:
            array = np.asarray(data[()])
        except OSError as error:
            raise self.fault("dataset", name, f"is damaged: {error}") from None
        fits = len(shape) == array.ndim and all(
            wanted in (-1, have) for wanted, have in zip(shape, array.shape, strict=True)
        )
        if not fits:
            raise self.fault("dataset", name, f"has shape {array.shape} instead of {shape}")
        if array.dtype != np.dtype(kind):
            raise self.fault("dataset", name, f"has numbers of type {array.dtype}")
        return array

    def arrays(self) -> list[Real]:
        return [self.array(name, -1) for name in sorted(self._group)]

    def has_attribute(self, name: str) -> bool:
        return name in self._group.attrs

    def pair(self, name: str) -> tuple[float, float]:
        value = np.asarray(self.attribute(name))
        if value.shape != (2,) or value.dtype.kind != "f":
            raise self.fault("attribute", name, "is not a pair of numbers")
        return float(value[0]), float(value[1])

    def attribute(self, name: str) -> Any:
        if name not in self._group.attrs:
            raise self.fault("attribute", name, "is missing")
        return self._group.attrs[name]

    def number(self, name: str) -> float:
        return float(self._single(name, "f"))

    def whole(self, name: str) -> int:
        return int(self._single(name, "iu"))

    def _single(self, name: str, kinds: str) -> Any:
        value = np.asarray(self.attribute(name))
        if value.shape or value.dtype.kind not in kinds:
            raise self.fault("attribute", name, "is not a number of its kind")
        return value.item()

    def text(self, name: str) -> str:
        (text,) = self._texts(name, 0)
        return text

    def texts(self, name: str) -> list[str]:
        return self._texts(name, 1)

    def _texts(self, name: str, dimensions: int) -> list[str]:
        value = np.asarray(self.attribute(name))
        if value.ndim != dimensions or not (value.dtype.kind in "SU" or value.size == 0):
            raise self.fault("attribute", name, "is not a text" + "s" * dimensions)
        return [text if isinstance(text, str) else text.decode() for text in value.ravel().tolist()]


@contextmanager
def _opened(
    path: str | Path, format_: str = FORMAT, version: int = FORMAT_VERSION
) -> Iterator[_Group]:
    """The root of a file of a format that this version can read."""
    try:
        content = Path(path).read_bytes()
    except TypeError:
        raise SystemModelError(f"{shown(path)} is not the name of a file") from None
    except FileNotFoundError:
        raise SystemModelError(f"{path}: there is no such file") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise SystemModelError(f"{path}: cannot be read: {reason}") from None
    try:
        file = h5py.File(io.BytesIO(content), "r")
    except (OSError, RuntimeError, KeyError):
        raise SystemModelError(f"{path}: is not an HDF5 file, or is cut off or damaged") from None
    with file:
        root = _Group(path, file)
        try:
            _check_format(root, format_, version)
            yield root
        except SystemModelError:
            raise
        except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as error:
            # what h5py raises where a text or a type cannot be decoded
            raise SystemModelError(f"{path}: is damaged: {error}") from error


def _check_format(root: _Group, format_: str, newest: int) -> None:
    if not root.has_attribute("format") or root.text("format") != format_:
        raise SystemModelError(
            f"{root.path}: is not a file of {format_.removeprefix('nldyn ')} of nldyn"
        )
    version = root.whole("format_version")
    if version > newest:
        raise SystemModelError(
            f"{root.path}: has format version {version}, written by {root.text('software')}; this "
            f"is nldyn {software_version()}, which reads versions up to {newest}"
        )


def checked_laws(laws: Laws | None) -> Laws:
    """Contact laws by the numbers of their stops."""
    check_types(laws=(laws, Mapping, None))
    return laws or {}


def _read_flows(root: _Group, laws: Laws | None) -> list[FlowMap]:
    known = checked_laws(laws)
    return [_read_flow(group, known) for group in root.group("flow_maps").groups()]


def _read_branches(root: _Group, flows: Sequence[FlowMap]) -> list[Branch]:
    return [_read_branch(group, flows) for group in root.group("branches").groups()]


def _read_diagram(root: _Group, flows: Sequence[FlowMap]) -> Diagram:
    range_hz, observe = root.pair("range_hz"), root.text("observe")
    branches = tuple(_read_branches(root, flows))
    return Diagram(branches, range_hz, observe, tuple(root.texts("notes")))


def _flow_of(group: _Group, flows: Sequence[FlowMap]) -> FlowMap:
    number = group.whole("flow_map")
    if not 0 <= number < len(flows):
        raise group.fault("attribute", "flow_map", f"is {number}, but there are {len(flows)}")
    return flows[number]


def _read_branch(group: _Group, flows: Sequence[FlowMap]) -> Branch:
    problem = ShootingProblem(
        _flow_of(group, flows), group.whole("period"), group.whole("segments")
    )
    observe = group.text("observe")
    if observe not in problem.flow.system.interfaces:
        raise group.fault("attribute", "observe", f"names an unknown interface '{observe}'")
    nodes = _read_points(group.group("nodes"), problem, observe)
    special = group.group("special_points")
    points = _read_points(special, problem, observe)
    kinds = special.texts("kinds")
    if len(kinds) != len(points):
        raise special.fault("attribute", "kinds", f"has {len(kinds)} of {len(points)} entries")
    errors = special.array("frequency_error", len(points))
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
        (reasons[0], reasons[1]),
        tuple(group.texts("notes")),
        tuple(_read_points(group.group("requested"), problem, observe)),
        _read_course(group.group("course"), nodes) if "course" in group else None,
    )


def _read_points(group: _Group, problem: ShootingProblem, observe: str) -> list[BranchPoint]:
    arclength = group.array("arclength", -1)
    count, size = arclength.size, problem.size
    point = group.array("point", count, problem.segments * size + 1)
    tangent = group.array("tangent", *point.shape)
    jacobians = group.array("jacobians", count, problem.segments, size, size)
    error = group.array("error", count)
    motions = _read_motions(group.group("motion"), count, problem.flow)
    return [
        BranchPoint(
            Orbit(problem, point[i], jacobians[i], float(error[i]), observe, motions[i]),
            tangent[i],
            float(arclength[i]),
        )
        for i in range(count)
    ]


def _read_motions(group: _Group, count: int, flow: FlowMap) -> list[Trajectory | None]:
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
        used = np.array([number, number], dtype=np.int64)
        part = {name: column[start:end] for name, column in columns.items()}
        record = Record(**part, used=used)
        motion = Trajectory(flow, float(omega[i]), record, closings[i], "")
        motions.append(motion if number else None)
    return motions


def _read_course(group: _Group, nodes: Sequence[BranchPoint]) -> Course:
    low, high = group.pair("range_hz")
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
        _read_open_ends(group, nodes[0].orbit),
        tuple(group.array("at", -1).tolist()),
        start,
        group.whole("special_points_before"),
        group.whole("notes_before"),
        (backward, forward),
    )


def _read_open_ends(group: _Group, orbit: Orbit) -> Real:
    """Where other branches were broken off; version 1 has a dataset for each end."""
    if group.has_group("open_ends"):
        return alike(orbit, group.group("open_ends").arrays())
    return group.array("open_ends", -1, orbit.point.size)


def _read_options(group: _Group) -> ContinuationOptions:
    lengths = {
        item.name: group.number(f"option {item.name}")
        for item in fields(ContinuationOptions)
        if item.name != "max_points"
    }
    return ContinuationOptions(**lengths, max_points=group.whole("option max_points"))


def _read_exploration(
    group: _Group, flows: Sequence[FlowMap], diagram: Diagram
) -> tuple[Question, Stage]:
    efforts: dict[str, Any] = {
        item.name: (group.number if item.name in ("spacing", "fold_factor") else group.whole)(
            f"effort {item.name}"
        )
        for item in fields(ExploreOptions)
        if item.name == "spacing" or group.has_attribute(f"effort {item.name}")
    }
    question = Question(
        _flow_of(group, flows),
        diagram.range_hz,
        group.whole("max_period"),
        diagram.observe,
        ExploreOptions(**efforts),
        _read_options(group),
    )
    steps, branches, notes = (group.whole(name) for name in ("steps", "branches", "notes"))
    given, folded = (
        group.whole(name) if group.has_attribute(name) else 0
        for name in ("given", "folds_followed")
    )
    carried = group.array("carried", -1, 2 * question.flow.system.size)
    coverage = _read_coverage(group.group("coverage"))
    ends = tuple(group.array("ends", -1, kind=np.int64).tolist())
    met = group.array("met", -1, branches, kind=np.int64) > 0
    done, here, length = question.place(max(steps, 0))
    reached = sum(len(question.frequencies(turn)) for turn in range(done)) + min(here, length // 2)
    if steps < 0 or len(coverage) != reached or len(ends) != done or not 0 <= len(met) - done <= 1:
        raise group.fault("attribute", "steps", f"is {steps} with {len(coverage)} frequencies")
    for name, value, most in (
        ("branches", branches, len(diagram.branches)),
        ("notes", notes, len(diagram.notes)),
        ("given", given, branches),
        ("folds_followed", folded, branches),
    ):
        if not 0 <= value <= most:
            raise group.fault("attribute", name, f"is {value}, but there are {most}")
    return question, Stage(steps, branches, notes, carried, coverage, met, ends, given, folded)


def _read_coverage(group: _Group) -> tuple[Coverage, ...]:
    hz = group.array("frequency_hz", -1)
    counts = [
        group.array(name, hz.size, kind=np.int64).tolist()
        for name in ("settled", "unsettled", "failed")
    ]
    different = group.array("different_periods", hz.size, kind=np.int64)
    periods = group.array("periods", int(different.sum()), kind=np.int64)
    parts = np.split(periods, np.cumsum(different)[:-1]) if hz.size else []
    rows = zip(hz.tolist(), (tuple(part.tolist()) for part in parts), *counts, strict=True)
    return tuple(Coverage(*row) for row in rows)


def _read_end(group: _Group, nodes: int) -> WalkEnd:
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


def _read_flow(group: _Group, laws: Laws) -> FlowMap:
    omega = group.array("natural_frequencies", -1)
    n = omega.size
    names = group.texts("interfaces")
    vectors = group.array("participation", len(names), n)
    try:
        system = System(
            omega,
            group.array("damping", n, n),
            dict(zip(names, vectors, strict=True)),
            _read_stops(group.group("stops"), laws),
            _read_dampers(group.group("dampers")),
            _read_excitation(group.group("excitation")),
        )
    except SystemModelError as error:
        if str(error).startswith(str(group.path)):
            raise
        raise SystemModelError(f"{group.path}: {error}") from error
    basis = group.group("basis")
    vars(system)["linear"] = LinearPart(
        basis.array("blocks", n, 2, 2),
        basis.array("right", 2 * n, 2 * n),
        basis.array("left", 2 * n, 2 * n),
        basis.array("growth", n),
        basis.number("condition"),
    )
    nodes = group.whole("nodes") if group.has_attribute("nodes") else None
    tail = group.number("tail") if group.has_attribute("tail") else None
    return FlowMap(system, FlowOptions(group.number("rtol"), nodes, tail))


def _read_stops(group: _Group, laws: Laws) -> tuple[Stop, ...]:
    at, against = group.texts("at"), group.texts("against")
    count = len(at)
    numbers = ("stiffness", "exponent", "gap", "direction", "dissipation")
    values = {name: group.array(name, count) for name in (*numbers, "is_against", "has_own_law")}
    trials = group.array("law_trials", *((count, len(TRIALS), 3) if count else (0,)))
    for i in laws:
        if i not in range(count) or not values["has_own_law"][i]:
            raise SystemModelError(f"{group.path}: laws: no stop {i} has a law of its own")
    stops = []
    for i in range(count):
        law = None
        if values["has_own_law"][i]:
            if i not in laws:
                raise SystemModelError(
                    f"{group.path}: stop {i} at '{at[i]}' has a law of its own, which a file "
                    f"cannot hold: pass laws={{{i}: law}}"
                )
            law = laws[i]
        stop = Stop(
            at[i],
            float(values["stiffness"][i]),
            float(values["exponent"][i]),
            float(values["gap"][i]),
            int(values["direction"][i]),
            against[i] if values["is_against"][i] else None,
            float(values["dissipation"][i]),
            law,
        )
        if not np.array_equal(_trials(stop), trials[i]):
            raise SystemModelError(
                f"{group.path}: the law passed for stop {i} at '{at[i]}' is not the one with "
                "which the file was written: its forces differ"
            )
        stops.append(stop)
    return tuple(stops)


def _read_dampers(group: _Group) -> tuple[Damper, ...]:
    at = group.texts("at")
    return tuple(map(Damper, at, group.array("coefficient", len(at)).tolist()))


def _read_excitation(group: _Group) -> tuple[Excitation, ...]:
    at, kinds = group.texts("at"), group.texts("kind")
    size, phase = group.array("size", len(at)), group.array("phase_deg", len(at))
    sources: list[Excitation] = []
    for place, kind, amount, angle in zip(at, kinds, size.tolist(), phase.tolist(), strict=True):
        if kind not in ("unbalance", "harmonic"):
            raise group.fault("attribute", "kind", f"has an unknown entry '{kind}'")
        maker = Unbalance if kind == "unbalance" else HarmonicForce
        sources.append(maker(place, amount, angle))
    return tuple(sources)
