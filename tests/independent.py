"""Motions computed without the flow map: Runge-Kutta methods, and the matrix exponential."""

from __future__ import annotations

import cmath
import math

import numpy as np
import scipy.linalg as sla
from numba import njit
from scipy.integrate import DOP853, solve_ivp

from nldyn import PolynomialSpring, Spring, Stop, System
from nldyn.system import CubicDamper

TABLEAU = DOP853.A, DOP853.B, DOP853.C, DOP853.E3, DOP853.E5  # of order 8, with two estimates
RTOL = 2e-13


@njit(cache=True)
def contact(depth, speed, k, p, a, c, pulls):
    """Force k δ^p (1 + a δ') + c δ' and its derivatives, nothing where the stop is open."""
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    return pressed(depth, speed, k, p, a, c, pulls)


@njit(cache=True)
def pressed(depth, speed, k, p, a, c, pulls):
    """The same, and a linear law also goes on behind the place where the stop opens."""
    if depth <= 0.0 and p != 1.0:
        return 0.0, 0.0, 0.0
    slope, lossy = k * p * depth ** (p - 1.0), 1.0 + a * speed
    spring = slope * depth / p
    force = spring * lossy + c * speed
    if force < 0.0 and not pulls:
        return 0.0, 0.0, 0.0
    return force, slope * lossy, a * spring + c


@njit(cache=True)
def rate(phase, y, omega, size, terms, closed, out):
    """Derivatives by the phase of a state and of the columns (if any) that are carried with it.

    Stops are open (0), closed (1), or as their depths say (2).
    """
    A, stops, sources, springs, dampers = terms
    n, columns = size // 2, y.size // size - 1
    J = A.copy()
    for i in range(size):
        out[i] = 0.0
        for j in range(size):
            out[i] += A[i, j] * y[j]
    for source in sources:
        turn = source[2 * n] * phase
        for i in range(n):
            out[n + i] += source[i] * math.cos(turn) - source[n + i] * math.sin(turn)
    for kind, rows in enumerate((stops, springs, dampers)):
        for place in range(rows.shape[0]):
            row = rows[place]
            u = v = 0.0
            for i in range(n):
                u += row[i] * y[i]
                v += row[i] * y[n + i]
            force = by_u = by_v = 0.0
            if kind == 0:
                if closed[place] > 0:
                    k, p, a, c, pulls = row[n + 1 : n + 6]
                    if u > row[n] or closed[place] == 1:
                        force, by_u, by_v = pressed(u - row[n], v, k, p, a, c, pulls)
            elif kind == 1:
                for power in range(row.size - n, 0, -1):
                    k = row[n + power - 1]
                    force += k * u**power
                    by_u += power * k * u ** (power - 1)
            elif row[n + 1] > 0.0:
                force, by_v = row[n] * v**3, 3.0 * row[n] * v * v
            else:
                force, by_u, by_v = row[n] * v * u * u, 2.0 * row[n] * v * u, row[n] * u * u
            for i in range(n):
                out[n + i] -= row[i] * force
                for j in range(n):
                    J[n + i, j] -= row[i] * by_u * row[j]
                    J[n + i, n + j] -= row[i] * by_v * row[j]
    for i in range(size):
        out[i] /= omega
        for column in range(columns):
            total = 0.0
            for j in range(size):
                total += J[i, j] * y[size + j * columns + column]
            out[size + i * columns + column] = total / omega


@njit(cache=True)
def stepped(phase, y, h, omega, size, terms, closed, tableau, atol, K, new):
    """Put a Runge-Kutta step into `new`; its error in the measure of the tolerances."""
    A, B, C, E3, E5 = tableau
    for i in range(13):
        for m in range(y.size):
            new[m] = y[m]
            for j in range(i):
                new[m] += h * (A[i, j] if i < 12 else B[j]) * K[j, m]
        rate(phase + (C[i] if i < 12 else 1.0) * h, new, omega, size, terms, closed, K[i])
    fifth = third = 0.0
    for i in range(y.size):
        scale = atol[i] + RTOL * max(abs(y[i]), abs(new[i]))
        e3 = e5 = 0.0
        for j in range(13):
            e3 += E3[j] * K[j, i]
            e5 += E5[j] * K[j, i]
        third += (e3 / scale) ** 2
        fifth += (e5 / scale) ** 2
    if fifth == 0.0:
        return 0.0
    return h * fifth / math.sqrt((fifth + 0.01 * third) * y.size)


@njit(cache=True)
def switched(y, stops, size, closed, now):
    """Put into `now` which stops are closed; how many are not as they were."""
    n, count = size // 2, 0
    for s in range(closed.size):
        depth = -stops[s, n]
        for i in range(n):
            depth += stops[s, i] * y[i]
        now[s] = 1 if depth > 0.0 else 0
        count += now[s] != closed[s]
    return count


@njit(cache=True)
def followed(y, first, last, omega, size, terms, tableau, atol, max_step):
    """State and columns at the last phase, and how often each stop closes.

    No step holds the beginning or the end of a contact, where a Hertz force is not smooth.
    """
    stops = terms[1]
    closed, now = np.zeros((2, stops.shape[0]), dtype=np.int64)
    switched(y, stops, size, closed, closed)
    closings = np.zeros_like(closed)
    K, new = np.empty((13, y.size)), np.empty(y.size)
    phase, h = first, 0.01 * max_step
    while phase < last:
        h = min(h, max_step, last - phase)
        ends = phase + h >= last
        error = stepped(phase, y, h, omega, size, terms, closed, tableau, atol, K, new)
        if not error <= 1.0:
            if h < 1e-15 * last:
                raise ValueError("the steps get too short")
            h *= max(0.2, 0.9 * error**-0.125)
            continue
        longer = h * min(10.0, 0.9 * max(error, 1e-9) ** -0.125)
        if switched(new, stops, size, closed, now):
            low, high, middle = 0.0, h, 0.5 * h
            while low < middle < high:
                stepped(phase, y, middle, omega, size, terms, closed, tableau, atol, K, new)
                if switched(new, stops, size, closed, now):
                    high = middle
                else:
                    low = middle
                if high - low < 1e-16 * (last - first):
                    break
                middle = 0.5 * (low + high)
            stepped(phase, y, high, omega, size, terms, closed, tableau, atol, K, new)
            switched(new, stops, size, closed, now)
            for s in range(closed.size):
                closings[s] += now[s] > closed[s]
                closed[s] = now[s]
            ends, h, longer = ends and high == h, high, h
        phase += h
        for m in range(y.size):
            y[m] = new[m]
        if ends:
            break
        h = longer
    return y, closings


class Motion:
    """q'' + D q' + Ω² q = Σ p Re(f e^{iφ}) - Σ c F(c·q - gap, c·q'), with φ = ωt as time.

    The state holds modal displacements, then velocities.
    """

    def __init__(self, system: System) -> None:
        n = system.size
        self.n = n
        self.A = np.zeros((2 * n, 2 * n))
        self.A[:n, n:] = np.eye(n)
        self.A[n:, :n] = -np.diag(system.natural_frequencies**2)
        self.A[n:, n:] = -system.damping
        if system.circulatory is not None:
            self.A[n:, :n] -= system.circulatory
        stops, springs, dampers = [], [], []
        for stop in system.stops:
            assert isinstance(stop, Stop) and stop.law is None
            numbers = stop.gap, stop.stiffness, stop.exponent, stop.dissipation, stop.dashpot
            stops.append([*system.stop_vector(stop), *numbers, stop.pulls])
        for element in (*system.springs, *system.dampers):
            c = system.participation[element.at].copy()
            if element.against is not None:
                c -= system.participation[element.against]
            if isinstance(element, PolynomialSpring):
                springs.append([*c, *element.coefficients, *[0.0] * 9][: n + 9])
            elif isinstance(element, CubicDamper):
                dampers.append([*c, element.coefficient, element.by == "speed"])
            elif isinstance(element, Spring):
                self.A[n:, :n] -= element.stiffness * np.outer(c, c)
            else:
                self.A[n:, n:] -= element.coefficient * np.outer(c, c)
        rows = (stops, n + 6), (springs, n + 9), (dampers, n + 2)
        self.elements = [np.array(r, dtype=float).reshape(-1, width) for r, width in rows]
        self.sources = [(system.load_vector(e.at), e) for e in system.excitation]

    def terms(self, omega: float) -> tuple[np.ndarray, ...]:
        """All numbers of the equations at a frequency."""
        amplitudes = [s.phasor * (s.harmonic * omega) ** s.power for _, s in self.sources]
        sources = np.array(
            [
                [*(shape * a.real), *(shape * a.imag), source.harmonic]
                for (shape, source), a in zip(self.sources, amplitudes, strict=True)
            ],
            dtype=float,
        ).reshape(-1, 2 * self.n + 1)
        stops, springs, dampers = self.elements
        return self.A, stops, sources, springs, dampers

    def run(
        self,
        state: np.ndarray,
        phases: tuple[float, float],
        omega: float,
        *,
        tangent: bool = True,
        max_step: float = 0.05,
    ) -> tuple[np.ndarray, np.ndarray, list[int]]:
        """End state, its derivative by the start, good to 1e-12 and 5e-11, and closings of stops.

        The steps (radians of the forcing phase) must be shorter than every contact.
        """
        assert not tangent or all(self.elements[0][:, -1])  # a force that ends is no smooth one
        size = 2 * self.n
        y = np.concatenate([state, np.eye(size).ravel()] if tangent else [state]).astype(float)
        fastest = max(np.abs(np.linalg.eigvals(self.A)).max(), omega)
        length = max(np.abs(state[: self.n]).max(), np.abs(state[self.n :]).max() / fastest)
        scale = np.repeat([length, length * fastest], self.n)
        atol = 1e-14 * np.concatenate([scale, (scale[:, None] / scale).ravel()])
        first, last = map(float, phases)
        y, closings = followed(
            y, first, last, omega, size, self.terms(omega), TABLEAU, atol, max_step
        )
        return y[:size], y[size:].reshape(size, -1), closings.tolist()

    def stiff_end(
        self, state: np.ndarray, phases: tuple[float, float], omega: float, atol: float = 1e-19
    ) -> np.ndarray:
        """End state where a stop damps fast, by Radau's method of order 5."""
        size, terms = 2 * self.n, self.terms(omega)
        by_depth = np.full(len(terms[1]), 2)

        def rates(phase: float, x: np.ndarray, *columns: np.ndarray) -> np.ndarray:
            y = np.concatenate([x, *columns])
            out = np.empty(y.size)
            rate(phase, y, omega, size, terms, by_depth, out)
            return out

        return solve_ivp(
            rates,
            phases,
            state,
            method="Radau",
            rtol=1e-12,
            atol=atol,
            jac=lambda phase, x: rates(phase, x, np.eye(size).ravel())[size:].reshape(size, size),
        ).y[:, -1]


def exact_flight(
    system: System, x0: np.ndarray, phases: tuple[float, float], omega: float
) -> tuple[np.ndarray, np.ndarray]:
    """End state and Jacobian from one matrix exponential of the system and its oscillators."""
    n, orders = system.size, sorted({source.harmonic for source in system.excitation})
    size = 2 * n + 2 * len(orders)
    A = np.zeros((size, size))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -np.diag(system.natural_frequencies**2)
    A[n : 2 * n, n : 2 * n] = -system.total_damping
    start = list(x0)
    for h, order in enumerate(orders):  # (cos mωt, sin mωt)
        pair = slice(2 * n + 2 * h, 2 * n + 2 * h + 2)
        A[pair, pair] = order * np.array([[0.0, -omega], [omega, 0.0]])
        start += [np.cos(order * phases[0]), np.sin(order * phases[0])]
        for source in system.excitation:
            if source.harmonic == order:
                f = source.phasor * (order * omega) ** source.power
                A[n : 2 * n, pair] += np.outer(system.load_vector(source.at), [f.real, -f.imag])
    E = sla.expm(A * (phases[1] - phases[0]) / omega)
    return (E @ start)[: 2 * n], E[: 2 * n, : 2 * n]


def state_map(system: System) -> np.ndarray:
    """Matrix L with z = L @ x for modal displacements and velocities x, (2n, 2n)."""
    return system.linear.left


def mathieu_multipliers_of(omega, spring, swing, damping):
    """Multipliers of y'' + c y' + (k + s cos ωt) y = 0 by Hill's determinant.

    E. T. Whittaker and G. N. Watson, A Course of Modern Analysis, 19.42.
    """
    a, q = 4.0 * (spring - 0.25 * damping**2) / omega**2, 2.0 * swing / omega**2
    n = np.arange(-4000, 4001)
    xi = q / (4.0 * n**2 - a)
    determinant, before = 1.0, 1.0
    for product in xi[1:] * xi[:-1]:
        determinant, before = determinant - product * before, determinant
    cosine = 1.0 - determinant * (1.0 - math.cos(math.pi * math.sqrt(a)))
    root = cmath.sqrt(cosine**2 - 1.0)
    decay = math.exp(-math.pi * damping / omega)
    return decay * np.array([cosine + root, cosine - root])
