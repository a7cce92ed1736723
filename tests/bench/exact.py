"""One period with all derivatives, to as many digits as wanted.

Flights are evaluated in closed form with the eigenvalues of the linear part. In a contact phase
the unknown is carried in a fictitious time s with ``dt/ds = u``, ``u = sqrt(penetration)``. Then

    du/ds = v/2,   dq/ds = u q',   dq'/ds = u (-Ω²q - D q' + p f(t) - c k u³),   v = c·q',

and the variational equations likewise: all polynomial, so that the solution is analytic also
where contact begins and ends, and a contact phase lasts from one zero of u to the next. It is
summed as a Taylor series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mpmath
import numpy as np

from nldyn.base.arrays import Real
from nldyn.system.loads import HarmonicForce, Unbalance
from nldyn.system.system import System

mp = mpmath.mp
Number = Any  # mpmath has no type hints
Series = list[Number]


@dataclass(frozen=True)
class Precision:
    """Working digits, order of the Taylor series, and digits that its steps aim at."""

    digits: int
    order: int
    aim: int


@dataclass(frozen=True)
class ExactEnd:
    """State, monodromy matrix (rows) and derivative with respect to ω; and the contacts."""

    state: Series
    monodromy: list[Series]
    d_omega: Series
    contacts: int


@dataclass
class Motion:
    """Instant, state and the 2n + 1 columns of derivatives at fixed time."""

    t: Number
    x: Series
    columns: list[Series]


class ExactFlow:
    """The flow over one period of a system with one Hertz stop and one excitation.

    Parameters
    ----------
    system : System
        What to propagate; its numbers are taken as exact.
    omega : float or mpf
        Excitation frequency in rad/s.
    precision : Precision
        How many digits.
    """

    def __init__(self, system: System, omega: Number, precision: Precision) -> None:
        mp.dps = precision.digits
        (stop,), (source,) = system.elastic_stops.values(), system.excitation
        assert isinstance(source, HarmonicForce | Unbalance) and source.harmonic == 1
        assert stop.exponent == 1.5 and not stop.depends_on_speed and source.phase_deg == 0.0
        self.precision = precision
        self.n = system.size
        self.omega = mp.mpf(omega)
        self.T = 2 * mp.pi / self.omega
        self.stiffness = [mp.mpf(w) ** 2 for w in system.natural_frequencies]
        self.damping = [[mp.mpf(d) for d in row] for row in system.total_damping]
        self.c = [mp.mpf(c) for c in system.stop_vector(stop)]
        self.gap = mp.mpf(stop.gap)
        self.k = mp.mpf(stop.stiffness)
        amplitude = mp.mpf(source.phasor.real)
        load = [mp.mpf(p) * amplitude for p in system.participation[source.at]]
        self.load = [p * self.omega**source.power for p in load]
        self.d_load = [source.power * p / self.omega for p in self.load]

    # Flights

    @cached_property
    def eigen(self) -> tuple[Series, Number, Number]:
        """Eigenvalues, eigenvectors, and their inverse, of the linear part."""
        n = self.n
        A = mp.zeros(2 * n)
        for i in range(n):
            A[i, n + i] = 1
            A[n + i, i] = -self.stiffness[i]
            for j in range(n):
                A[n + i, n + j] = -self.damping[i][j]
        values, vectors = mp.eig(A)
        return values, vectors, mp.inverse(vectors)

    @cached_property
    def steady(self) -> tuple[Series, Series]:
        """Complex amplitudes of the steady linear response, and their derivatives by ω."""
        n, w = self.n, self.omega
        matrix = mp.matrix(n)
        slope = mp.matrix(n)
        for i in range(n):
            for j in range(n):
                own = self.stiffness[i] - w**2 if i == j else mp.mpf(0)
                matrix[i, j] = own + mp.j * w * self.damping[i][j]
                slope[i, j] = (-2 * w if i == j else 0) + mp.j * self.damping[i][j]
        q = mp.lu_solve(matrix, mp.matrix(self.load))
        dq = mp.lu_solve(matrix, mp.matrix(self.d_load) - slope * q)
        value = [*q, *(mp.j * w * a for a in q)]
        d_value = [*dq, *(mp.j * (a + w * b) for a, b in zip(q, dq, strict=True))]
        return value, d_value

    def forced(self, t: Number) -> tuple[Series, Series]:
        """Steady linear response and its derivative with respect to ω, at time t."""
        turn = mp.expj(self.omega * t)
        value, slope = self.steady
        x = [(a * turn).real for a in value]
        dx = [((b + mp.j * t * a) * turn).real for a, b in zip(value, slope, strict=True)]
        return x, dx

    def fly(self, motion: Motion, end: Number) -> None:
        """Carry a motion in closed form to time `end`."""
        values, vectors, inverse = self.eigen
        growth = [mp.exp(value * (end - motion.t)) for value in values]
        size = 2 * self.n

        def homogeneous(column: Series) -> Series:
            z = inverse * mp.matrix(column)
            z = mp.matrix([g * z[i] for i, g in enumerate(growth)])
            return [(vectors[i, :] * z)[0].real for i in range(size)]

        def plus(a: Series, b: Series, sign: int = 1) -> Series:
            return [x + sign * y for x, y in zip(a, b, strict=True)]

        before, d_before = self.forced(motion.t)
        after, d_after = self.forced(end)
        motion.x = plus(homogeneous(plus(motion.x, before, -1)), after)
        last = plus(homogeneous(plus(motion.columns[-1], d_before, -1)), d_after)
        motion.columns = [*(homogeneous(c) for c in motion.columns[:-1]), last]
        motion.t = end

    def next_contact(self, motion: Motion, after_contact: bool) -> Number | None:
        """First instant at which a flight closes the gap, if there is one within the period."""
        values, vectors, inverse = self.eigen
        size = 2 * self.n
        row = [mp.fdot(self.c, [vectors[i, j] for i in range(self.n)]) for j in range(size)]
        own = inverse * mp.matrix(
            [a - b for a, b in zip(motion.x, self.forced(motion.t)[0], strict=True)]
        )
        own = [row[j] * own[j] for j in range(size)]
        response = mp.fdot(self.c, self.steady[0][: self.n])

        def depth(t: Number, derivative: int = 0) -> Number:
            powers = [v**derivative * mp.exp(v * (t - motion.t)) for v in values]
            free = mp.fdot(own, powers).real
            turn = (mp.j * self.omega) ** derivative * mp.expj(self.omega * t)
            return free + (response * turn).real - (0 if derivative else self.gap)

        fastest = max(float(abs(v)) for v in values)
        count = int(20 * fastest * float(self.T - motion.t) / (2 * math.pi)) + 200
        times = np.linspace(float(motion.t), float(self.T), count)
        speeds = self._speeds(times, motion, own, response)
        for i in np.flatnonzero(~(speeds[:-1] < 0.0) & (speeds[1:] < 0.0) | (speeds[:-1] > 0.0)):
            left = motion.t if i == 0 else mp.mpf(times[i])
            right = self.T if i == count - 2 else mp.mpf(times[i + 1])
            if speeds[i + 1] < 0.0:  # a maximum lies in between
                if i == 0 and speeds[0] <= 0.0:
                    continue
                right = mp.findroot(lambda t: depth(t, 1), (left, right), solver="anderson")
            if depth(right) > 0 and not (i == 0 and after_contact and depth(left, 1) >= 0):
                return mp.findroot(depth, (left, right), solver="anderson")
        return None

    def _speeds(self, times: Real, motion: Motion, own: Series, response: Number) -> Real:
        """Rates of the penetration on a grid, in double precision."""
        values = np.array([complex(v) for v in self.eigen[0]])
        weights = np.array([complex(w) for w in own]) * values
        lag = times - float(motion.t)
        turn = 1j * float(self.omega) * complex(response) * np.exp(1j * float(self.omega) * times)
        free = np.zeros(times.size)
        for value, weight in zip(values, weights, strict=True):
            free += (weight * np.exp(value * lag)).real
        return np.asarray(free + turn.real)

    # Contacts

    def contact(self, motion: Motion, u: Number) -> Number:
        """Carry a motion through a contact phase, to its end or the end of the period.

        Returns the root u of the penetration there: zero at the end of the contact.
        """
        while True:
            series, t, x, columns = self._expand(motion, u)
            h = self._step(x, columns)
            end = self._first_event(series, t, h)
            h = h if end is None else end
            motion.t = _sum(t, h)
            motion.x = [_sum(a, h) for a in x]
            motion.columns = [[_sum(a, h) for a in column] for column in columns]
            u = _sum(series, h)
            if end is not None:
                return u

    def _expand(
        self, motion: Motion, u0: Number
    ) -> tuple[Series, Series, list[Series], list[list[Series]]]:
        """Taylor coefficients in s of u, t, the state and the columns."""
        n, w, c = self.n, self.omega, self.c
        u, t = [u0], [motion.t]
        cos, sin = [mp.cos(w * motion.t)], [mp.sin(w * motion.t)]
        x = [[a] for a in motion.x]
        columns = [[[a] for a in column] for column in motion.columns]
        u2: Series = []
        cx: list[Series] = [[] for _ in columns]
        rates: list[Series] = [[] for _ in range(n)]
        column_rates: list[list[Series]] = [[[] for _ in range(n)] for _ in columns]
        t_sin: Series = []
        for j in range(self.precision.order):
            back = u[::-1]
            u2.append(mp.fdot(u, back))
            force = self.k * mp.fdot(u2, back)
            velocity = [x[n + i][j] for i in range(n)]
            for i in range(n):
                own = mp.fdot(self.damping[i], velocity) + self.stiffness[i] * x[i][j]
                rates[i].append(self.load[i] * cos[j] - own - c[i] * force)
            t_sin.append(mp.fdot(t, sin[::-1]))
            for number, (column, rate, depth) in enumerate(
                zip(columns, column_rates, cx, strict=True)
            ):
                depth.append(mp.fdot(c, [column[i][j] for i in range(n)]))
                slope = 1.5 * self.k * mp.fdot(depth, back)
                velocity = [column[n + i][j] for i in range(n)]
                for i in range(n):
                    own = mp.fdot(self.damping[i], velocity) + self.stiffness[i] * column[i][j]
                    rate[i].append(-own - c[i] * slope)
                    if number == 2 * n:
                        rate[i][j] += self.d_load[i] * cos[j] - self.load[i] * t_sin[j]
            for vector, rate in zip([x, *columns], [rates, *column_rates], strict=True):
                for i in range(n):
                    q_next = mp.fdot(vector[n + i], back) / (j + 1)
                    p_next = mp.fdot(rate[i], back) / (j + 1)
                    vector[i].append(q_next)
                    vector[n + i].append(p_next)
            cos_next = -w * mp.fdot(sin, back) / (j + 1)
            sin.append(w * mp.fdot(cos, back) / (j + 1))
            cos.append(cos_next)
            t.append(u[j] / (j + 1))
            u.append(mp.fdot(c, [x[n + i][j] for i in range(n)]) / (2 * (j + 1)))
        return u, t, x, columns

    def _step(self, x: list[Series], columns: list[list[Series]]) -> Number:
        """Step at which the last coefficients fall below the aim, in the state and the columns."""
        n, order = self.n, self.precision.order
        blocks = [x[:n], x[n:], *(c[:n] for c in columns), *(c[n:] for c in columns)]
        step = mp.inf
        for block in blocks:
            size = max(abs(a[0]) for a in block)
            for j in (order - 1, order):
                last = max(abs(a[j]) for a in block)
                if last > 0 and size > 0:
                    step = min(
                        step, (mp.mpf(10) ** -self.precision.aim * size / last) ** (mp.one / j)
                    )
        return step

    def _first_event(self, u: Series, t: Series, h: Number) -> Number | None:
        """Where in a step the contact or the period ends, if it does.

        Beyond the end of the contact time would run backwards, since dt/ds is u.
        """
        release = None
        if _sum(u, h) <= 0:
            low = h * mp.mpf("1e-9") if u[0] == 0 else mp.zero
            release = h = mp.findroot(lambda s: _sum(u, s), (low, h), solver="anderson")
        if _sum(t, h) >= self.T:
            return mp.findroot(lambda s: _sum(t, s) - self.T, (0, h), solver="anderson")
        return release

    # The period

    def period(self, start: Real | Series) -> ExactEnd:
        """Carry a state over one period from phase zero."""
        mp.dps = self.precision.digits
        n = self.n
        unit = [[mp.mpf(i == j) for i in range(2 * n)] for j in range(2 * n)]
        x = [mp.mpf(a) for a in start]
        motion = Motion(mp.zero, x, [*unit, [mp.zero] * (2 * n)])
        contacts = 0
        depth = mp.fdot(self.c, x[:n]) - self.gap
        u = mp.sqrt(depth) if depth > 0 else mp.zero
        in_contact = depth > 0 or (depth == 0 and mp.fdot(self.c, x[n:]) > 0)
        after_contact = False
        while True:
            if in_contact:
                u = self.contact(motion, u)
                if motion.t >= self.T * (1 - mp.mpf(10) ** (10 - self.precision.digits)):
                    break
                in_contact, after_contact, u = False, True, mp.zero
                continue
            at = self.next_contact(motion, after_contact)
            self.fly(motion, self.T if at is None else at)
            if at is None:
                break
            in_contact = True
            contacts += 1
        rate = self._rate(motion.x, u)
        d_omega = [
            d - r * self.T / self.omega for d, r in zip(motion.columns[-1], rate, strict=True)
        ]
        rows = [[column[i] for column in motion.columns[:-1]] for i in range(2 * n)]
        return ExactEnd(motion.x, rows, d_omega, contacts)

    def _rate(self, x: Series, u: Number) -> Series:
        """Time derivative of a state at the end of the period."""
        n = self.n
        velocity = x[n:]
        acceleration = [
            self.load[i]
            - self.stiffness[i] * x[i]
            - mp.fdot(self.damping[i], velocity)
            - self.c[i] * self.k * u**3
            for i in range(n)
        ]
        return [*velocity, *acceleration]


def _sum(series: Series, h: Number) -> Number:
    total = mp.zero
    for coefficient in reversed(series):
        total = total * h + coefficient
    return total
