"""Fourier coefficients of an orbit's motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.base.errors import SystemModelError, check_types, check_whole, numbers, shown
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.system.ride import Ride
from nldyn.system.system import System

MOST_PARTS = 2**13
SETTLED = 1e-9  # change of a coefficient with twice the parts, relative to the largest
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Lines of a periodic displacement, ``y(t) = Re Σ phasor_k exp(2πi frequency_hz_k t)``.

    Parameters
    ----------
    frequency_hz : (m + 1,)
        Multiples of the orbit's own frequency, that of the excitation over the period multiple,
        from zero.
    phasor : (m + 1,)
        Complex amplitudes in m; the first is the mean.
    """

    frequency_hz: Real
    phasor: Complex

    def __repr__(self) -> str:
        """One line: how many lines, and the largest."""
        size = np.abs(self.phasor)
        most = int(np.argmax(size))
        return (
            f"<Harmonics: {size.size} lines, the largest {size[most]:.4g} at "
            f"{self.frequency_hz[most]:.6g} Hz>"
        )

    @property
    def amplitude(self) -> Real:
        """Amplitudes of the lines in m, (m + 1,)."""
        return np.asarray(np.abs(self.phasor))


def harmonics(orbit: Orbit, interface: str | Real | None = None, *, orders: int = 30) -> Harmonics:
    """Fourier coefficients of a displacement over one period of an orbit.

    Gauss's rule on each piece of the motion, between what happens at stops, and on more and more
    parts of the period, until the coefficients stay within 1e-9 of the largest (or there are 2¹³
    parts).

    Parameters
    ----------
    orbit : Orbit
        A periodic orbit.
    interface : str or (n,) array, optional
        An interface, or the displacement of each mode at any point: a row of
        ``reduced.expand(numpy.eye(n))``. The observed interface unless given.
    orders : int
        Highest multiple of the excitation frequency.

    Returns
    -------
    Harmonics

    Raises
    ------
    SystemModelError
        For an unknown interface, a row of the wrong length, or if `orders` is not a whole number
        of at least 1.

    Examples
    --------
    >>> from nldyn import System, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> orbit = solve_orbit(system, frequency_hz=20.0)
    >>> lines = harmonics(orbit)           # a linear system answers at one frequency
    >>> bool(abs(lines.amplitude[1] / orbit.max_abs_displacement - 1.0) < 1e-9)
    True
    """
    check_types(orbit=(orbit, Orbit))
    check_whole("harmonics: orders", orders, 1, 10**4)
    place = orbit.observe if interface is None else interface
    system, ride = orbit.system, Ride.of((), orbit.omega)
    if isinstance(place, str) and place in system.rides:
        phi, ride = np.asarray(system.participation[place]), system.ride(place, orbit.omega)
    else:
        phi = modal_row(system, place)
    lines = orders * orbit.period
    parts = lines
    found = _coefficients(orbit, phi, ride, lines, parts)
    while parts < MOST_PARTS:
        parts *= 2
        coarser, found = found, _coefficients(orbit, phi, ride, lines, parts)
        if np.abs(found - coarser).max() <= SETTLED * np.abs(found).max():
            break
    multiples = np.arange(lines + 1, dtype=float)
    return Harmonics(multiples * (orbit.frequency_hz / orbit.period), found)


def line_by_balance(orbit: Orbit, interface: str, order: int) -> complex:
    r"""Complex amplitude in m of one order of a displacement, by the balance of its forces.

    :math:`(im\omega - A)z_m = g_m - B F_m` with the Fourier coefficients :math:`F_m` of the contact
    forces by the quadrature of their panels: as good as the flow map, and without a sample of the
    motion. For a damped system with elastic stops.

    Parameters
    ----------
    orbit : Orbit
        A periodic orbit.
    interface : str
        Whose displacement.
    order : int
        Multiple of the excitation frequency.

    Raises
    ------
    SystemModelError
        If the system has rigid stops, or an undamped mode of this very frequency.
    """
    system, flow, omega = orbit.system, orbit.problem.flow, orbit.omega
    if system.rigid_stops:
        raise SystemModelError("the forces of rigid stops have no balance by harmonics")
    phases, weights = orbit.trajectory.contact_quadrature()
    record = orbit.trajectory.record
    forces = record.force[record.kind >= 0].transpose(0, 2, 1)
    forces = forces.reshape(phases.size, record.force.shape[1])
    pushed = 2.0 / orbit.duration * (weights * np.exp(-1j * order * phases)) @ forces
    given = system.drive[system.orders == order].sum(axis=0)
    right = np.array([1.0, omega, omega**2]) @ given - flow.force_columns @ pushed
    matrices = 1j * order * omega * np.eye(2) - system.linear.blocks
    try:
        z = np.linalg.solve(matrices, right.reshape(-1, 2, 1)).ravel()
    except np.linalg.LinAlgError:
        raise SystemModelError("an undamped mode has the frequency of the excitation") from None
    ride = system.ride(interface, omega)
    carried = ride.amplitudes[ride.orders == order].sum()
    return complex(system.displacement_row(system.participation[interface]) @ z + carried)


def modal_row(system: System, point: str | Real | None) -> Real:
    """Displacement of each mode (n,) at an interface, or at any point that is given so.

    Raises
    ------
    SystemModelError
        For an unknown interface or a row of the wrong length.
    """
    if point is None or isinstance(point, str):
        name = check_observe(system, point)
        if name in system.rides:
            raise SystemModelError(f"'{name}' cannot be taken here, only a relative displacement")
        return np.asarray(system.participation[name])
    if np.shape(point) != (system.size,):
        raise SystemModelError(
            f"interface must be a str or None, or the displacements of {system.size} modes, got "
            f"{shown(point)}"
        )
    return numbers("interface", point)


def _coefficients(orbit: Orbit, phi: Real, ride: Ride, lines: int, parts: int) -> Complex:
    period = 2.0 * np.pi * orbit.period
    starts = orbit.trajectory.record.phase % period
    edges = np.union1d(np.linspace(0.0, period, parts + 1), starts)
    half = 0.5 * np.diff(edges)[:, None]
    phases = (edges[:-1, None] + half * (1.0 + NODES)).ravel()
    displacement = orbit.states(phases)[:, : phi.size] @ phi + ride.at(phases)
    wave = displacement * (half * WEIGHTS).ravel() / period + 0j
    turn = np.exp(-1j * phases / orbit.period)
    phasor = np.empty(lines + 1, dtype=complex)
    for k in range(lines + 1):
        phasor[k] = wave.sum()
        wave *= turn
    phasor[1:] *= 2.0
    return phasor
