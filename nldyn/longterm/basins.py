"""Basins of attraction in a plane of initial states, with shares and integrity."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from nldyn.base.arrays import SLACK, TINY, Real
from nldyn.base.errors import (
    SystemModelError,
    check_choice,
    check_frequency,
    check_types,
    check_whole,
    is_finite,
    numbers,
    shown,
)
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.flow.rigid import behind_rigid_stops
from nldyn.longterm.attractors import (
    Attractor,
    AttractorOptions,
    attractor_from,
    find_attractors,
    same_attractor,
    stuck_places,
)
from nldyn.longterm.neighbourhoods import CHUNK, UNDECIDED, Settled, Target, settle, target_of
from nldyn.orbits.newton import check_bounded
from nldyn.orbits.orbit import check_observe
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress
from nldyn.system.system import System, same_system

CELLS = 250  # initial states in one computation
MOTION = 10  # cells that take as long as a motion that is looked at closely
MOST_CELLS = 10**7
IMPOSSIBLE = -2  # label of a state behind a rigid stop
PARALLEL = 1e-9  # what is left of one of two directions across the other
AROUND = 2.0  # size of a plane, over that of what attractors do in it
SAMPLES = 4096  # of a motion whose size is wanted
PlaneState = tuple[str, str]  # "displacement" or "velocity", and of which interface
UNITS = {"displacement": "{}", "velocity": "{}/s"}  # with m or rad
IN_PLANE = 1e-6  # of a state: its distance from a plane in which it lies


@dataclass(frozen=True, eq=False)
class StatePlane:
    """A rectangle in the space of initial states at forcing phase zero.

    Parameters
    ----------
    origin : (2n,)
        Modal displacements and velocities where both coordinates are zero.
    x, y : (2n,)
        What a unit of either coordinate adds.
    x_range, y_range : (float, float)
        Ends of the rectangle, ascending.
    x_label, y_label : str
        Names for the axes of a picture, with their units.

    Raises
    ------
    SystemModelError
        If shapes disagree, a range is not ascending, or x and y are parallel.
    """

    origin: Real
    x: Real
    y: Real
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    x_label: str = "x"
    y_label: str = "y"

    def __repr__(self) -> str:
        """One line: what is on the axes, and how far they reach."""
        (a, b), (c, d) = self.x_range, self.y_range
        return f"<StatePlane: {self.x_label} {a:g} to {b:g}, {self.y_label} {c:g} to {d:g}>"

    def __post_init__(self) -> None:
        for name in ("origin", "x", "y"):
            object.__setattr__(self, name, numbers(f"plane: {name}", getattr(self, name)))
        if self.origin.ndim != 1 or not self.x.shape == self.origin.shape == self.y.shape:
            raise SystemModelError("plane: origin, x and y must be vectors of one length")
        for name in ("x_range", "y_range"):
            ends = getattr(self, name)
            check_types(**{f"plane: {name}": (ends, Sequence, np.ndarray)})
            ascending = len(ends) == 2 and all(is_finite(e) for e in ends) and ends[0] < ends[1]
            if not ascending:
                raise SystemModelError(
                    f"plane: {name} must be two ascending numbers, got {shown(ends)}"
                )
        if np.linalg.matrix_rank(np.array([self.x, self.y])) < 2:
            raise SystemModelError("plane: x and y must not be parallel")

    @classmethod
    def at_interface(
        cls,
        system: System,
        displacement: tuple[float, float],
        velocity: tuple[float, float],
        *,
        interface: str | None = None,
        origin: Real | None = None,
    ) -> StatePlane:
        """Displacement (m) and velocity (m/s) of an interface, as from a blow there.

        The modes take part as a blow at the interface moves them, in proportion to their
        participation: of all states with these two numbers it is the one nearest to `origin`.

        Parameters
        ----------
        system : System
            The system.
        displacement, velocity : (float, float)
            Ranges of the interface's displacement and velocity.
        interface : str, optional
            The first unless given.
        origin : (2n,) array, optional
            Modal displacements and velocities through which the plane passes; undeformed
            and still unless given.

        Raises
        ------
        SystemModelError
            For input that makes no sense.

        Examples
        --------
        >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]})
        >>> plane = StatePlane.at_interface(system, (-1e-4, 1e-4), (-0.1, 0.1))
        >>> plane.states((3, 3)).shape
        (3, 3, 2)
        """
        for label, ends in (("displacement", displacement), ("velocity", velocity)):
            check_types(**{f"plane: {label}": (ends, Sequence, np.ndarray)})
        name = check_observe(system, interface)
        x, y = ("displacement", name), ("velocity", name)
        return cls.spanned_by(system, x, y, displacement, velocity, origin=origin)

    @classmethod
    def spanned_by(
        cls,
        system: System,
        x: PlaneState,
        y: PlaneState,
        x_range: tuple[float, float],
        y_range: tuple[float, float],
        *,
        origin: Real | None = None,
    ) -> StatePlane:
        """Any two of the displacements (m) and velocities (m/s) of interfaces.

        Of all states with these two numbers it is the one nearest to `origin`.

        Parameters
        ----------
        system : System
            The system.
        x, y : ({"displacement", "velocity"}, str)
            What is on either axis, of which interface.
        x_range, y_range : (float, float)
            Their ranges.
        origin : (2n,) array, optional
            As for `at_interface`.

        Raises
        ------
        SystemModelError
            For input that makes no sense, such as two interfaces that always move together.

        Examples
        --------
        >>> system = System.from_matrices(np.eye(2), [[2.0, -1.0], [-1.0, 2.0]],
        ...     {"a": [1.0, 0.0], "b": [0.0, 1.0]})
        >>> StatePlane.spanned_by(
        ...     system, ("displacement", "a"), ("displacement", "b"), (-1.0, 1.0), (-2.0, 2.0))
        <StatePlane: displacement of a (m) -1 to 1, displacement of b (m) -2 to 2>
        """
        rows = _rows_of(system, x, y)
        n = system.size
        base = np.zeros(2 * n) if origin is None else numbers("origin", origin)
        if base.shape != (2 * n,):
            raise SystemModelError(f"origin must have {2 * n} entries, got shape {base.shape}")
        sizes = np.linalg.norm(rows, axis=1)
        unit = rows / sizes[:, None]
        if abs(1.0 - abs(float(unit[0] @ unit[1]))) < PARALLEL:
            raise SystemModelError(f"plane: the {x[0]} of '{x[1]}' moves with that of '{y[1]}'")
        along = np.linalg.solve(unit @ unit.T, unit) / sizes[:, None]
        base = base - (rows @ base) @ along
        labels = [
            f"{quantity} of {name} ({UNITS[quantity].format(system.unit(name))})"
            for quantity, name in (x, y)
        ]
        return cls(base, along[0], along[1], x_range, y_range, *labels)

    @classmethod
    def around(
        cls,
        attractors: Sequence[Attractor],
        x: PlaneState,
        y: PlaneState,
        *,
        x_range: tuple[float, float] | None = None,
        y_range: tuple[float, float] | None = None,
    ) -> StatePlane:
        """A plane `spanned_by` two states, twice as wide as what some attractors do in it.

        Parameters
        ----------
        attractors : sequence of Attractor
            At least one, all of one system, at one frequency or value of a parameter or at several.
        x, y : ({"displacement", "velocity"}, str)
            What is on either axis, of which interface.
        x_range, y_range : (float, float), optional
            A range that is known.

        Raises
        ------
        SystemModelError
            For input that makes no sense, and if the attractors do not move.

        Examples
        --------
        >>> from nldyn import HarmonicForce, System, classify_attractor
        >>> system = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]}, damping=[[1.0]],
        ...     excitation=[HarmonicForce("x", 1.0)])
        >>> found = classify_attractor(system, 0.5 / np.pi)     # resonance, amplitude 1 m
        >>> StatePlane.around([found], ("displacement", "x"), ("velocity", "x"))
        <StatePlane: displacement of x (m) -2 to 2, velocity of x (m/s) -2 to 2>
        """
        if not attractors:
            raise SystemModelError("plane: no attractor is known, so the ranges must be given")
        system = attractors[0].flow.system
        rows = _rows_of(system, x, y)
        states = np.vstack([_all_along(attractor) for attractor in attractors])
        low, high = (rows @ states.T).min(axis=1), (rows @ states.T).max(axis=1)
        middle, half = 0.5 * (low + high), 0.5 * AROUND * (high - low)
        rate = 2.0 * math.pi * attractors[0].frequency_hz
        half = np.where(half > TINY, half, _other_size(half, x, y, rate))
        ranges = []
        for given, centre, size in zip((x_range, y_range), middle, half, strict=True):
            if given is None and not size > 0.0:
                raise SystemModelError(
                    f"plane: no attractor moves '{x[1]}' or '{y[1]}', so the ranges must be given"
                )
            ranges.append(given or (float(centre - size), float(centre + size)))
        return cls.spanned_by(system, x, y, ranges[0], ranges[1])

    def axes(self, shape: tuple[int, int]) -> tuple[Real, Real]:
        """Coordinates of the middles of the cells, (nx,) and (ny,), for a shape (ny, nx)."""
        ny, nx = check_shape("plane: shape", shape)
        (x0, x1), (y0, y1) = self.x_range, self.y_range
        return (
            x0 + (x1 - x0) * (np.arange(nx) + 0.5) / nx,
            y0 + (y1 - y0) * (np.arange(ny) + 0.5) / ny,
        )

    def states(self, shape: tuple[int, int]) -> Real:
        """Modal states in the middles of the cells, (ny, nx, 2n)."""
        x, y = self.axes(shape)
        return np.asarray(self.origin + x[None, :, None] * self.x + y[:, None, None] * self.y)

    def coordinates(self, modal: Real) -> tuple[Real, NDArray[np.bool_]]:
        """Coordinates (k, 2) of states (k, 2n), and which of the states lie in the plane (k,)."""
        modal = numbers("modal", modal)
        if modal.ndim != 2 or modal.shape[1] != self.origin.size:
            raise SystemModelError(
                f"modal must be states (k, {self.origin.size}), got shape {modal.shape}"
            )
        basis = np.array([self.x, self.y]).T
        unit = np.linalg.norm(basis, axis=1).max()
        found, *_ = np.linalg.lstsq(basis / unit, (modal - self.origin).T, rcond=None)
        off = np.linalg.norm(modal - self.origin - (basis / unit @ found).T, axis=1)
        size = np.linalg.norm(modal, axis=1)
        return found.T / unit, off <= IN_PLANE * np.maximum(size, TINY)


def _rows_of(system: System, x: PlaneState, y: PlaneState) -> Real:
    """Rows (2, 2n) that give two states of interfaces from a modal one."""
    zero = np.zeros(system.size)
    rows = []
    for axis, state in (("x", x), ("y", y)):
        check_types(**{f"plane: {axis}": (state, Sequence)})
        if len(state) != 2:
            raise SystemModelError(f"plane: {axis} must be a state and an interface, got {state}")
        quantity, name = state
        check_choice(f"plane: {axis}", quantity, UNITS)
        phi = system.participation[check_observe(system, name, f"plane: {axis}")]
        if name in system.rides:
            raise SystemModelError(f"plane: '{name}' rides on a base; take the relative motion")
        if not np.any(phi):
            raise SystemModelError(f"no mode moves interface '{name}'")
        rows.append(np.concatenate([phi, zero] if quantity == "displacement" else [zero, phi]))
    return np.array(rows)


def _all_along(attractor: Attractor) -> Real:
    """Modal states (k, 2n) along the motion on an attractor."""
    motion = attractor.motion()
    return motion.states(np.linspace(motion.start_time, motion.end_time, SAMPLES))


def _other_size(half: Real, x: PlaneState, y: PlaneState, rate: float) -> Real:
    """Sizes (2,) of axes by that of the other one, at a rate in rad/s."""
    power = [0 if quantity == "displacement" else 1 for quantity, _ in (x, y)]
    return half[::-1] * rate ** np.array([power[0] - power[1], power[1] - power[0]])


@dataclass(frozen=True, eq=False)
class Basin:
    """One attractor's part of the plane.

    Parameters
    ----------
    number : int
        Of the attractor, from 1.
    attractor : Attractor
        The attractor.
    share : float
        Share of the cells; of those that are no possible states none counts.
    uncertainty : float
        Standard error of the share from as many random states [Agresti and Coull]; a straight edge
        along the cells leaves as much, any other less.
    integrity : float
        Radius of the largest disc within it, in units of the sides of the rectangle: the integrity
        factor of Rega and Lenci. The edge of the rectangle counts as a boundary.
    distance : float
        Distance from the attractor's nearest stroboscopic point to another basin, in the same
        units: their local integrity measure. nan if none of its points lies in the rectangle.
    """

    number: int
    attractor: Attractor
    share: float
    uncertainty: float
    integrity: float
    distance: float

    def __repr__(self) -> str:
        """One line: the attractor and its share."""
        return f"<Basin: {self.text}>"

    @property
    def text(self) -> str:
        """Such as ``1: 40.0 ± 0.5 %, period 2, 1 impact, -0.001 to 0.002 m at 'a'``."""
        return self.told(1.0, unit_of(self.attractor))

    def told(self, factor: float, unit: str) -> str:
        """The same with the extremes in a unit of a size, such as 1e-6 of µm."""
        percent = f"{100.0 * self.share:.1f} ± {100.0 * self.uncertainty:.1f} %"
        low, high = (value / factor for value in self.attractor.span)
        span = f"{low:.3g} to {high:.3g} {unit} at '{self.attractor.interface}'"
        return f"{self.number}: {percent}, {self.attractor.title}, {span}"


def unit_of(attractor: Attractor) -> str:
    """Unit of what is observed of an attractor: m, or rad of a rotation."""
    return attractor.flow.system.unit(attractor.interface)


@dataclass(frozen=True, eq=False)
class Basins:
    """Which attractor each cell of a plane leads to.

    Parameters
    ----------
    plane : StatePlane
        The initial states.
    frequency_hz : float
        Excitation frequency in Hz.
    attractors : tuple of Attractor
        Those that were reached.
    labels : (ny, nx) int
        Index of the attractor, -1 where the motion did not settle in time or failed, or -2 where
        the state lies behind a rigid stop, so that no motion begins there.
    phases : (ny, nx) int
        Of a subharmonic of period n, by how many excitation periods, 0 to n - 1, the motion runs
        ahead of the attractor's first state; else 0.
    periods : (ny, nx) int
        Excitation periods until the attractor's neighbourhood was reached.
    checked, wrong : int
        Cells that were simulated and classified once more by themselves, and how many of them came
        to another result.
    notes : tuple of str
        How many simulations failed, and why.
    """

    plane: StatePlane
    frequency_hz: float
    attractors: tuple[Attractor, ...]
    labels: NDArray[np.int64]
    phases: NDArray[np.int64]
    periods: NDArray[np.int64]
    checked: int
    wrong: int
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line: cells, frequency, attractors."""
        rows, columns = self.labels.shape
        kinds = ", ".join(attractor.kind for attractor in self.attractors) or "none"
        return (
            f"<Basins: {columns} x {rows} cells at {self.frequency_hz:.6g} Hz, attractors: {kinds}>"
        )

    @property
    def unit(self) -> str:
        """Unit of what is observed of the attractors: m, or rad of a rotation."""
        return unit_of(self.attractors[0]) if self.attractors else "m"

    @property
    def undecided(self) -> float:
        """Share of the cells that led to no attractor in time."""
        return float(np.mean(self.labels[self.possible] == UNDECIDED))

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Which of the cells (ny, nx) are states that do not lie behind a rigid stop."""
        return np.asarray(self.labels != IMPOSSIBLE)

    @property
    def basins(self) -> tuple[Basin, ...]:
        """Each attractor with its share and its integrity."""
        return tuple(self._basin(index) for index in range(len(self.attractors)))

    def _basin(self, index: int) -> Basin:
        inside = self.labels == index
        ny, nx = inside.shape
        depth = np.asarray(distance_transform_edt(np.pad(inside, 1), sampling=(1.0 / ny, 1.0 / nx)))
        return Basin(
            index + 1,
            self.attractors[index],
            float(inside[self.possible].mean()),
            standard_error(int(inside.sum()), int(self.possible.sum())),
            float(depth.max()),
            self._distance(index, inside),
        )

    def report(self) -> str:
        """Lines for a reader: each attractor with its share, what was undecided, what failed."""
        lines = [basin.text for basin in self.basins]
        if self.undecided:
            lines.append(f"undecided: {100.0 * self.undecided:.1f} %")
        if not self.possible.all():
            behind = 100.0 * (1.0 - float(self.possible.mean()))
            lines.append(f"{behind:.1f} % of the plane lies behind a rigid stop and does not count")
        again = f"{self.wrong} of {self.checked} cells that were simulated once more"
        return "\n".join([*lines, f"{again} came to another result", *self.notes])

    def points(self, index: int) -> Real:
        """Coordinates (k, 2) of an attractor's stroboscopic states in the plane."""
        check_whole("points: index", index, 0, len(self.attractors) - 1)
        attractor = self.attractors[index]
        found, inside = self.plane.coordinates(attractor.flow.to_modal(attractor.states))
        return found[inside]

    def _distance(self, index: int, inside: NDArray[np.bool_]) -> float:
        points = self.points(index)
        (x0, x1), (y0, y1) = self.plane.x_range, self.plane.y_range
        points = (points - (x0, y0)) / (x1 - x0, y1 - y0)
        points = points[((points >= 0.0) & (points <= 1.0)).all(axis=1)]
        ny, nx = inside.shape
        rows, columns = np.nonzero(~inside)
        if not len(points) or not len(rows):
            return math.nan
        others = np.column_stack([(columns + 0.5) / nx, (rows + 0.5) / ny])
        return float(np.min(cKDTree(others).query(points)[0]))


@shows_progress(of_number("cells"))
def basins(
    system: System | FlowMap,
    frequency_hz: float,
    plane: StatePlane,
    *,
    shape: tuple[int, int] = (100, 100),
    attractors: Sequence[Attractor] = (),
    starts: int = 24,
    longest: int = 2000,
    checks: int = 40,
    seed: int = 20,
    observe: str | None = None,
    options: AttractorOptions | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Basins:
    """Basins of attraction in a plane of initial states at forcing phase zero.

    Attractors are found from some of the cells first. Every cell is then simulated until it enters
    a neighbourhood of one of them, of which trial motions have shown that it contracts; a motion
    that enters none is classified by itself, and may add an attractor. Some cells are classified
    once more without the neighbourhoods, as a check of the picture.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    frequency_hz : float
        Excitation frequency in Hz.
    plane : StatePlane
        The initial states.
    shape : (int, int)
        Numbers of cells (ny, nx).
    attractors : sequence of Attractor
        Those that are known, of the same system and frequency.
    starts : int
        Cells from which attractors are looked for first.
    longest : int
        Excitation periods after which a motion is given up.
    checks : int
        Cells classified once more.
    seed : int
        Of the cells that are picked.
    observe, options
        As for `nldyn.classify_attractor`.
    executor : concurrent.futures.Executor, optional
        Where to compute; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each motion that looks for an attractor or checks
        a cell, which counts as 10 cells, and after every 250 cells. The total grows where cells
        must be looked at again because another attractor was found.

    Returns
    -------
    Basins

    Raises
    ------
    SystemModelError
        For a system without damping, which has no attractors, and other input that makes no
        sense.
    TaskError
        If a computation ends in an error.

    Examples
    --------
    >>> from nldyn import StatePlane, Stop, System, Unbalance, basins
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> plane = StatePlane.at_interface(system, (-2e-4, 0.0), (-0.05, 0.05))
    >>> found = basins(system, 50.0, plane, shape=(6, 6), checks=4)
    >>> found.wrong, found.undecided
    (0, 0.0)

    References
    ----------
    A. Agresti, B. A. Coull (1998), Approximate is better than "exact" for interval estimation of
    binomial proportions, *Am. Stat.* 52.

    G. Rega, S. Lenci (2005), Identifying, evaluating, and controlling dynamical integrity measures
    in non-linear mechanical oscillators, *Nonlinear Anal.* 63.
    """
    flow = flow_of(system)
    check_types(
        plane=(plane, StatePlane), options=(options, AttractorOptions, None),
        attractors=(attractors, Sequence),
    )  # fmt: skip
    check_execution(executor, progress)
    check_has_basins(flow, frequency_hz)
    omega = 2.0 * math.pi * frequency_hz
    name = check_observe(flow.system, observe)
    options = options or AttractorOptions()
    for label, value, least in (
        ("starts", starts, 1), ("longest", longest, CHUNK), ("checks", checks, 0), ("seed", seed, 0)
    ):  # fmt: skip
        check_whole(f"basins: {label}", value, least)
    check_shape("basins: shape", shape)
    if plane.origin.size != 2 * flow.system.size:
        raise SystemModelError(
            f"plane: states have {plane.origin.size} entries but the system needs "
            f"{2 * flow.system.size}"
        )
    _check_known(attractors, flow.system, frequency_hz)
    modal = plane.states(shape).reshape(-1, plane.origin.size)
    ends = _Ends.of(flow.to_state(modal))
    ends.labels[behind_rigid_stops(flow, ends.states)] = IMPOSSIBLE
    possible = np.flatnonzero(ends.labels != IMPOSSIBLE)
    if not possible.size:
        raise SystemModelError("plane: all of it lies behind a rigid stop")
    rng = np.random.default_rng(seed)
    cells = len(possible)
    picked = rng.choice(possible, min(starts, cells), replace=False)
    known = list(attractors)
    count = _Count(progress, MOTION * (len(picked) + min(checks, cells)) + cells)
    shares = find_attractors(
        flow, frequency_hz, starts=modal[picked], observe=name, options=options,
        executor=executor, progress=count.stage(MOTION * len(picked)),
    )  # fmt: skip
    for share in shares:
        _add(known, share.attractor)
    failed = Counter({s.attractor.failure: s.count for s in shares if s.attractor.failure})
    notes = _told(failed, len(picked), "simulations that look for attractors")
    order = rng.permutation(possible)  # so that all computations take about as long
    new = partial(attractor_from, flow, frequency_hz, name, options)
    enter = partial(settle, flow, omega)
    _follow_cells(ends, order, known, enter, longest, new, starts, executor, count)
    checked = rng.choice(possible, min(checks, cells), replace=False)
    again = partial(_index_of, flow, frequency_hz, name, options, known)
    stage = count.stage(MOTION * len(checked))
    results = values_of(again, [flow.to_state(modal[cell]) for cell in checked], executor, stage)
    wrong = sum(index != ends.labels[cell] for cell, index in zip(checked, results, strict=True))
    counts = np.array([max(attractor.period, 1) for attractor in known] + [1, 1])
    failures = ends.failures[ends.failures != ""]
    notes += _told(Counter(failures.tolist()), cells, "cells")
    return Basins(
        plane,
        frequency_hz,
        tuple(known),
        ends.labels.reshape(shape),
        (ends.phases % counts[ends.labels]).reshape(shape),
        ends.periods.reshape(shape),
        len(checked),
        int(wrong),
        tuple(notes),
    )


def standard_error(hits: int, count: int) -> float:
    """Of a share, from the hits among independent trials; not zero where all or none hit.

    Examples
    --------
    >>> round(standard_error(50, 100), 3), round(standard_error(0, 96), 3)
    (0.049, 0.014)
    """
    share = (hits + 2.0) / (count + 4.0)
    return math.sqrt(share * (1.0 - share) / (count + 4.0))


def check_has_basins(flow: FlowMap, frequency_hz: float) -> None:
    """Refuse a frequency that makes no sense, and a system that has no attractors at it."""
    check_frequency("frequency_hz", frequency_hz)
    check_bounded(flow, 2.0 * math.pi * frequency_hz)
    if flow.system.conservative:
        raise SystemModelError("basins: a system without damping has no attractors")


def _follow_cells(
    ends: _Ends,
    order: NDArray[np.intp],
    known: list[Attractor],
    enter: Callable[[list[Target], int, Real], Settled],
    longest: int,
    new: Callable[[Real], Attractor],
    starts: int,
    executor: Executor | None,
    count: _Count,
) -> None:
    """Follow cells to the attractors that are known; what is left may lead to others."""
    left, done = order, 0
    while len(left) and done < len(known):
        targets = [target_of(attractor) for attractor in known]
        stage = count.stage(len(left), more=0 if len(left) == len(order) else len(left))
        ends.settle(left, partial(enter, targets, longest), executor, stage)
        done = len(known)
        left = order[ends.labels[order] == UNDECIDED]
        more = MOTION * len(left[:starts])
        stage = count.stage(more, more=more)
        for attractor in values_of(new, list(ends.states[left[:starts]]), executor, stage):
            _add(known, attractor)


@dataclass
class _Ends:
    """Where the cells of a plane lead, as far as they have been followed."""

    states: Real
    labels: NDArray[np.intp]
    phases: NDArray[np.intp]
    periods: NDArray[np.intp]
    failures: NDArray[np.object_]

    @classmethod
    def of(cls, states: Real) -> _Ends:
        """At the beginning."""
        labels, phases, periods = (np.full(len(states), value) for value in (UNDECIDED, 0, 0))
        return cls(states, labels, phases, periods, np.full(len(states), "", dtype=object))

    def settle(
        self,
        cells: NDArray[np.intp],
        task: Callable[[Real], Settled],
        executor: Executor | None,
        progress: Callable[[int, int], None],
    ) -> None:
        """Follow these cells, from where they are, until they have settled or take too long."""
        pieces = [cells[k : k + CELLS] for k in range(0, len(cells), CELLS)]
        ends = values_of(task, [self.states[piece] for piece in pieces], executor, progress)
        for piece, settled in zip(pieces, ends, strict=True):
            self.labels[piece], self.states[piece] = settled.labels, settled.ends
            self.failures[piece] = settled.failures
            self.phases[piece] = settled.phases - self.periods[piece]
            self.periods[piece] += settled.periods


class _Count:
    """How much of the work of several stages is done, in cells."""

    def __init__(self, tell: Callable[[int, int], None] | None, total: int) -> None:
        self._tell, self._total, self._done = tell, total, 0

    def stage(self, size: int, more: int = 0) -> Callable[[int, int], None]:
        """What a stage of so many cells calls, of which ``more`` were not expected."""
        before = self._done
        self._done += size
        self._total += more

        def tell(done: int, total: int) -> None:
            if self._tell is not None:
                self._tell(before + size * done // total, self._total)

        return tell


def _told(failures: Mapping[str, int], total: int, what: str) -> list[str]:
    """How many of the simulations failed for each reason."""
    return [f"{n} of {total} {what} failed: {reason}" for reason, n in failures.items()]


def check_shape(name: str, shape: tuple[int, int]) -> tuple[int, int]:
    """Two whole numbers of at least 1 and of no huge product; a SystemModelError names them."""
    check_types(**{name: (shape, Sequence)})
    if len(shape) != 2:
        raise SystemModelError(f"{name} must be two numbers, got {shown(shape)}")
    for count in shape:
        check_whole(name, count, 1)
    if shape[0] * shape[1] > MOST_CELLS:
        raise SystemModelError(f"{name} may have up to {MOST_CELLS} cells, got {shown(shape)}")
    return shape


def _check_known(attractors: Sequence[Attractor], system: System, frequency_hz: float) -> None:
    """Refuse attractors of another system or frequency than those of the basins."""
    for k, attractor in enumerate(attractors):
        check_types(**{f"attractors: entry {k}": (attractor, Attractor)})
        if not math.isclose(attractor.frequency_hz, frequency_hz, rel_tol=SLACK):
            raise SystemModelError(
                f"attractors: entry {k} is one at {attractor.frequency_hz:g} Hz, but the basins "
                f"are asked for at {frequency_hz:g} Hz"
            )
        if not same_system(attractor.flow.system, system):
            raise SystemModelError(f"attractors: entry {k} is one of another system")
        _check_apart(attractor)


def _check_apart(attractor: Attractor) -> None:
    """Refuse one of a continuum of motions."""
    orbit = attractor.orbit
    places = [] if orbit is None else stuck_places(orbit)
    if orbit is not None and places:
        system = orbit.system
        at = system.place_ends[places[0] // 2 - system.size][0]
        raise SystemModelError(
            f"basins: at '{at}' something sticks behind its spring all the time, in a motion of "
            f"period {orbit.period} at {orbit.frequency_hz:g} Hz, as it may at any place within "
            "its friction: such motions lie side by side, and none of them has a basin"
        )


def _add(known: list[Attractor], attractor: Attractor) -> None:
    """Keep what is an attractor, and new."""
    _check_apart(attractor)
    if attractor.lasting and not any(same_attractor(attractor, other) for other in known):
        known.append(attractor)


def _index_of(
    flow: FlowMap, hz: float, observe: str, options: AttractorOptions,
    known: Sequence[Attractor], state: Real,
) -> int:  # fmt: skip
    """Index among the known attractors of the one that a state leads to."""
    found = attractor_from(flow, hz, observe, options, state)
    for index, attractor in enumerate(known):
        if same_attractor(found, attractor):
            return index
    return UNDECIDED
