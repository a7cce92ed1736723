"""Noise and wear: contact forces, impulses, impact power and power spectra of a motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from nldyn.base.arrays import Complex, Real
from nldyn.base.errors import SystemModelError, check_choice, check_types, check_whole
from nldyn.branches.branch import Branch
from nldyn.longterm.attractors import Attractor
from nldyn.longterm.impacts import check_stop, impacts, panel_table, units_where
from nldyn.longterm.poincare import BruteForce
from nldyn.longterm.simulation import MOST_RECORDED, WHOLE, Motion, motion_of
from nldyn.orbits.harmonics import modal_row
from nldyn.orbits.history import told
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress
from nldyn.system.system import System

MOST_SAMPLES = 10**6  # in a period
MOST_ORDERS = 1000
SAMPLES = 512  # in a period, for each 32 orders of a spectrum
Source = Orbit | Motion | Attractor | BruteForce | Branch
UNITS = {
    "frequency_hz": "Hz",
    "attractor": "",
    "stable": "1",
    "periods": "1",
    "rotation": "1",
    "peak_force": "N",
    "rms_force": "N",
    "impulse_rate": "N",
    "impact_rate": "1/s",
    "impact_power": "W",
    "loss_power": "W",
    "contact_share": "1",
    "fastest_impact": "m/s",
}


@dataclass(frozen=True)
class ContactMeasures:
    """What a motion does to one stop.

    Parameters
    ----------
    frequency_hz : float
        Excitation frequency in Hz, the mean one of a sweep.
    attractor : str
        Such as ``period 2`` or ``chaotic``.
    stable : bool
        False for an unstable orbit, which a machine does not stay on.
    periods : float
        Excitation periods over which is averaged.
    rotation : bool
        Whether the stop acts on a rotation: rad then stands for m below, and N m for N.
    peak_force, rms_force : float
        Largest force, and root of the mean of its square over all time, in N.
    impulse_rate : float
        Impulse per second: the mean force, in N.
    impact_rate : float
        Impacts that begin per second.
    impact_power : float
        Work done against the stop while the penetration grows, per second, in W: the energy that
        impacts bring to the contact.
    loss_power : float
        Power that stays in the contact, in W; zero but for rounding without dissipation.
    contact_share : float
        Share of the time in contact.
    fastest_impact : float
        Largest speed of an impact in m/s.
    """

    frequency_hz: float
    attractor: str
    stable: bool
    periods: float
    rotation: bool
    peak_force: float
    rms_force: float
    impulse_rate: float
    impact_rate: float
    impact_power: float
    loss_power: float
    contact_share: float
    fastest_impact: float

    @property
    def units(self) -> dict[str, str]:
        """Unit of each number by its name."""
        return units_where(UNITS, np.array([self.rotation]))


def contact_measures(
    source: Orbit | Motion | Attractor, *, stop: int = 0, periods: int = 256
) -> ContactMeasures:
    """Peak and r.m.s. contact force, impulse and impacts per second, and impact power.

    Impacts on a rigid stop count by impulse, work and loss; of forces there are only those of rest.

    Parameters
    ----------
    source : Orbit, Motion or Attractor
        A periodic orbit counts over its period, a motion over all of its time.
    stop : int
        Index of the stop.
    periods : int
        Excitation periods simulated on an attractor that is not periodic.

    Returns
    -------
    ContactMeasures

    Raises
    ------
    SystemModelError
        For a stop that the system does not have, or an attractor whose simulation failed.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, solve_orbit
    >>> from nldyn.longterm import contact_measures
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = contact_measures(solve_orbit(system, frequency_hz=25.3))
    >>> f"{found.peak_force:.1f} N, {found.impact_rate:.1f} impacts per second"
    '119.4 N, 25.3 impacts per second'
    """
    check_types(source=(source, Orbit, Motion, Attractor))
    check_whole("contact_measures: periods", periods, 1, MOST_RECORDED)
    system = _system_of(source)
    check_stop(system, stop)
    if isinstance(source, Attractor):
        if source.kind == "failed":
            raise SystemModelError(f"the attractor's simulation failed: {source.failure}")
        source = source.orbit if source.orbit is not None else source
    motion, name, stable = _motion_on(source, periods)
    table = panel_table(motion, stop)
    listed = impacts(source if isinstance(source, Orbit) else motion)
    own = listed.stop == stop
    speeds = listed.speed[own]
    at_once = own & np.isnan(listed.peak_force)  # on a rigid stop, in no time
    time = motion.duration
    lengths = zip(np.diff(motion.begins), motion.stretches, strict=True)
    turns = float(sum(length * stretch.omega for length, stretch in lengths)) / (2.0 * math.pi)
    return ContactMeasures(
        turns / time,
        name,
        stable,
        turns,
        system.unit(system.stops[stop].at) == "rad",
        float(table.peak_force.max(initial=0.0)),
        math.sqrt(max(float(table.square.sum()), 0.0) / time),
        float(table.impulse.sum() + listed.impulse[at_once].sum()) / time,
        speeds.size / time,
        float(table.work.sum() + listed.work[at_once].sum()) / time,
        float(table.loss.sum() + listed.loss[at_once].sum()) / time,
        float(table.duration.sum()) / time,
        float(speeds.max(initial=0.0)),
    )


@shows_progress(of_number("motions"))
def measures_table(
    sources: Source | Iterable[Source],
    *,
    stop: int = 0,
    periods: int = 256,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, NDArray[Any]]:
    """Columns of `contact_measures`, one row for each source, ascending in frequency.

    Parameters
    ----------
    sources : BruteForce, Branch, Orbit, Motion, Attractor or iterable
        A diagram by brute force, whose attractors count, a branch, whose points count, an orbit, a
        motion, an attractor, or a list of such. Attractors whose simulation failed are left out.
    stop, periods
        As for `contact_measures`.
    executor : concurrent.futures.Executor, optional
        Where to compute, each source by itself; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each source.

    Returns
    -------
    dict of str to (k,) array
        Columns and units are those of `ContactMeasures`; ``pandas.DataFrame`` takes it as it is.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    TaskError
        If the measures of a source cannot be computed.
    """
    check_execution(executor, progress)
    check_whole("measures_table: periods", periods, 1, MOST_RECORDED)
    chosen = _sources(sources)
    for source in chosen:
        check_stop(_system_of(source), stop)
    task = partial(contact_measures, stop=stop, periods=periods)
    rows = [asdict(measures) for measures in values_of(task, chosen, executor, progress)]
    rows.sort(key=lambda row: float(row["frequency_hz"]))
    return {name: np.array([row[name] for row in rows]) for name in UNITS}


def _sources(given: Source | Iterable[Source]) -> list[Orbit | Motion | Attractor]:
    """Orbits, motions and attractors, also those of branches and diagrams; none that failed."""
    kinds = get_args(Source)
    check_types(sources=(given, Iterable, *kinds))
    chosen: list[Orbit | Motion | Attractor] = []
    for k, entry in enumerate([given] if isinstance(given, Source) else given):
        check_types(**{f"sources: entry {k}": (entry, *kinds)})
        if isinstance(entry, BruteForce):
            chosen += [column.attractor for column in entry.columns]
        elif isinstance(entry, Branch):
            chosen += entry.points
        else:
            chosen.append(entry)
    return [s for s in chosen if not (isinstance(s, Attractor) and s.kind == "failed")]


@shows_progress(of_number("motions"))
def spectra_table(
    sources: Source | Iterable[Source],
    point: str | Real | None = None,
    *,
    orders: int = 5,
    periods: int = 256,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, NDArray[Any]]:
    """Leading harmonics of the displacement at a point against the excitation frequency.

    The amplitude of order k is that of the Fourier coefficient at k times the excitation frequency
    over a whole number of excitation periods. What lies between these lines, subharmonics and the
    broad spectrum of chaos, and above the last of them is in ``rest``, by Parseval's theorem.

    Parameters
    ----------
    sources
        As for `measures_table`; no sweeps.
    point : str or (n,) array, optional
        An interface, or the displacement of each mode at any point of the mesh: a row of
        ``reduced.expand(numpy.eye(n))``. The first interface unless given.
    orders : int
        Highest multiple of the excitation frequency.
    periods : int
        Excitation periods simulated on an attractor that is not periodic. The amplitudes of a
        chaotic motion vary from one such record to the next, by about ``rest / sqrt(periods)``.
    executor, progress
        As for `measures_table`.

    Returns
    -------
    dict of str to (k,) array
        ``frequency_hz``, ``attractor`` and ``stable`` as in `measures_table`; ``mean``, the
        amplitudes ``order_1`` to ``order_<orders>`` and ``rest``, the r.m.s. of all else, in m, of
        a rotation in rad. Rows ascend in frequency.

    Raises
    ------
    SystemModelError
        For input that makes no sense, or a motion whose frequency changes.
    TaskError
        If the spectrum of a source cannot be computed.

    Examples
    --------
    >>> from nldyn import System, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> orbit = solve_orbit(system, frequency_hz=20.0)
    >>> table = spectra_table([orbit], orders=2)      # a linear system answers at one frequency
    >>> bool(abs(table["order_1"][0] / orbit.max_abs_displacement - 1.0) < 1e-6)
    True
    """
    check_whole("spectra_table: orders", orders, 1, MOST_ORDERS)
    harmonics = partial(_harmonics, orders=orders)
    found = _spectra(harmonics, sources, point, orders, periods, executor, progress)
    values = np.array([spectrum.values for spectrum in found]).reshape(-1, orders + 2)
    names = ["mean", *(f"order_{k}" for k in range(1, orders + 1)), "rest"]
    return {
        "frequency_hz": np.array([spectrum.frequency_hz for spectrum in found]),
        "attractor": np.array([spectrum.attractor for spectrum in found]),
        "stable": np.array([spectrum.stable for spectrum in found]),
        **dict(zip(names, values.T, strict=True)),
    }


def _harmonics(phasors: Complex, turns: int, orders: int) -> Real:
    """Mean, amplitudes of the orders, and the r.m.s. of all else."""
    amplitudes = 2.0 * np.abs(phasors[turns : turns * orders + 1 : turns])
    rest = float(_squares(phasors)[1:].sum()) - 0.5 * float(amplitudes @ amplitudes)
    return np.array([phasors[0].real, *amplitudes, math.sqrt(max(rest, 0.0))])


def _squares(phasors: Complex) -> Real:
    """Mean squares of the lines of a real Fourier transform of an even number of samples."""
    squares = np.asarray(2.0 * np.abs(phasors) ** 2)
    squares[[0, -1]] *= 0.5  # these two have no twin
    return squares


@dataclass(frozen=True, eq=False)
class SpectraMap:
    """Spectra of displacements against the excitation frequency; see `spectra_map`.

    Parameters
    ----------
    frequency_hz : (k,)
        Excitation frequency of each motion in Hz, ascending.
    attractor : (k,) of str
        Such as ``period 2`` or ``chaotic``.
    stable : (k,) bool
        False for an unstable orbit.
    order : (m,)
        Middles of the bands, as multiples of the excitation frequency: 0, 1/parts, 2/parts, ...
    rms : (k, m)
        Root of the mean square of what lies in each band.
    rest : (k,)
        Root of the mean square of what lies above the last band.
    unit : str
        Of both: m, or rad of a rotation.
    """

    frequency_hz: Real
    attractor: NDArray[np.str_]
    stable: NDArray[np.bool_]
    order: Real
    rms: Real
    rest: Real
    unit: str


@shows_progress(of_number("motions"))
def spectra_map(
    sources: Source | Iterable[Source],
    point: str | Real | None = None,
    *,
    orders: int = 5,
    parts: int = 12,
    periods: int = 256,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SpectraMap:
    """Spectra of the displacement at a point, in bands, against the excitation frequency.

    The bands have the width of a part of the excitation frequency, and their middles are its
    multiples and the fractions between them, so that the lines of a subharmonic whose period
    divides `parts` lie in the middles. The mean squares of all bands and of the rest add up to
    that of the displacement (Parseval's theorem).

    Parameters
    ----------
    sources, point, periods, executor, progress
        As for `spectra_table`.
    orders : int
        Middle of the last band, as a multiple of the excitation frequency.
    parts : int
        Bands from one multiple to the next.

    Returns
    -------
    SpectraMap
        What `nldyn.plot.plot_spectra` draws.

    Raises
    ------
    SystemModelError
        For input that makes no sense, or a motion whose frequency changes.
    TaskError
        If the spectrum of a source cannot be computed.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = spectra_map([solve_orbit(system, frequency_hz=50.0, period=2)], orders=2, parts=2)
    >>> found.order.tolist()
    [0.0, 0.5, 1.0, 1.5, 2.0]
    >>> int(found.rms[0, 1:].argmax())                # half of the excitation frequency
    0
    """
    check_whole("spectra_map: orders", orders, 1, MOST_ORDERS)
    check_whole("spectra_map: parts", parts, 1, MOST_ORDERS)
    count = orders * parts + 1
    bands = partial(_bands, parts=parts, count=count)
    found = _spectra(bands, sources, point, orders, periods, executor, progress)
    values = np.array([spectrum.values for spectrum in found]).reshape(-1, count + 1)
    return SpectraMap(
        np.array([spectrum.frequency_hz for spectrum in found]),
        np.array([spectrum.attractor for spectrum in found], dtype=str),
        np.array([spectrum.stable for spectrum in found], dtype=bool),
        np.arange(count) / parts,
        values[:, :-1],
        values[:, -1],
        told(dict.fromkeys(spectrum.unit for spectrum in found)) or "m",
    )


def _bands(phasors: Complex, turns: int, parts: int, count: int) -> Real:
    """Roots of the mean squares in so many bands and above them."""
    band = np.rint(np.arange(phasors.size) * (parts / turns)).astype(int)
    return np.sqrt(np.bincount(np.minimum(band, count), _squares(phasors), minlength=count + 1))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """What is wanted of the spectrum of one motion."""

    frequency_hz: float
    attractor: str
    stable: bool
    unit: str
    values: Real


def _spectra(
    wanted: Callable[[Complex, int], Real],
    sources: Source | Iterable[Source],
    point: str | Real | None,
    orders: int,
    periods: int,
    executor: Executor | None,
    progress: Callable[[int, int], None] | None,
) -> list[_Spectrum]:
    """What is wanted of the spectra of all sources, ascending in frequency."""
    check_execution(executor, progress)
    check_whole("periods", periods, 1, MOST_RECORDED)
    chosen = _sources(sources)
    for source in chosen:
        modal_row(_system_of(source), point)
        if isinstance(source, Motion):
            _constant_omega(source)
    task = partial(_spectrum, wanted, point, orders, periods)
    found = values_of(task, chosen, executor, progress)
    return sorted(found, key=lambda spectrum: spectrum.frequency_hz)


def _spectrum(
    wanted: Callable[[Complex, int], Real],
    point: str | Real | None,
    orders: int,
    periods: int,
    source: Orbit | Motion | Attractor,
) -> _Spectrum:
    """What is wanted of the Fourier coefficients over a whole number of excitation periods."""
    motion, name, stable = _motion_on(source, periods)
    row = modal_row(motion.system, point)
    hz = _constant_omega(motion) / (2.0 * math.pi)
    turns = math.floor(motion.duration * hz + WHOLE)
    if turns < 1:
        raise SystemModelError("a spectrum needs a motion of at least one excitation period")
    count = SAMPLES * math.ceil(orders / 32)
    times = motion.start_time + np.arange(turns * count) / (count * hz)
    y = motion.states(times)[:, : row.size] @ row
    unit = "m"
    if point is None or isinstance(point, str):
        unit = motion.system.unit(check_observe(motion.system, point))
    return _Spectrum(hz, name, stable, unit, wanted(np.fft.rfft(y) / y.size, turns))


def _motion_on(source: Orbit | Motion | Attractor, periods: int) -> tuple[Motion, str, bool]:
    """The motion to measure, what it is called, and whether it is stable."""
    if isinstance(source, Motion):
        return source, "motion", True
    if isinstance(source, Attractor):
        if source.orbit is None:
            return source.motion(periods), source.name, True
        source = source.orbit
    return motion_of(source), f"period {source.period}", source.stable


def _constant_omega(motion: Motion) -> float:
    omegas = {stretch.omega for stretch in motion.stretches}
    if len(omegas) > 1:
        raise SystemModelError("a spectrum needs a motion at constant frequency")
    return omegas.pop()


def _system_of(source: Orbit | Motion | Attractor) -> System:
    if isinstance(source, Motion):
        return source.system
    flow = source.problem.flow if isinstance(source, Orbit) else source.flow
    return flow.system


def power_spectrum(
    motion: Motion,
    point: str | Real | None = None,
    *,
    samples_per_period: int = 64,
    quantity: str = "displacement",
) -> tuple[Real, Real]:
    """Power spectral density of a motion that is not periodic, at an interface or any point.

    By Welch's method with Hann windows of an eighth of the motion [Welch 1967]. Contact makes
    content at high frequencies: what lies above half of the sampling frequency is folded down.

    Parameters
    ----------
    motion : Motion
        What `nldyn.simulate` gave, with a transient left out; at constant frequency.
    point : str or (n,) array, optional
        An interface, or the displacement of each mode at any point of the mesh: a row of
        ``reduced.expand(numpy.eye(n))``. The first interface unless given.
    samples_per_period : int
        Samples in an excitation period.
    quantity : {"displacement", "velocity"}
        What of the point; the velocity of a surface is what it sounds by.

    Returns
    -------
    frequency_hz : (k,)
    density : (k,)
        In m²/Hz or (m/s)²/Hz; of a rotation rad stands for m.

    Raises
    ------
    SystemModelError
        For input that makes no sense.

    Examples
    --------
    >>> from nldyn import System, Unbalance, simulate
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> hz, density = power_spectrum(simulate(system, 20.0, periods=64, transient=1000))
    >>> float(hz[np.argmax(density)])
    20.0
    """
    check_types(motion=(motion, Motion), quantity=(quantity, str))
    check_whole("samples_per_period", samples_per_period, 4, MOST_SAMPLES)
    check_choice("quantity", quantity, ("displacement", "velocity"))
    row = modal_row(motion.system, point)
    hz = _constant_omega(motion) / (2.0 * math.pi)
    rate = samples_per_period * hz
    count = int(motion.duration * rate + WHOLE)
    if count < 16:
        raise SystemModelError(f"a power spectrum needs 16 samples, the motion gives {count}")
    states = motion.states(motion.start_time + np.arange(count) / rate)
    half = states[:, : row.size] if quantity == "displacement" else states[:, row.size :]
    frequency, density = welch(half @ row, rate, nperseg=max(count // 8, 16))
    return np.asarray(frequency), np.asarray(density)
