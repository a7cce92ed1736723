"""Collocation for the periodic orbit as a boundary value problem."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp

from bench import motion
from bench.job import EngineError, Job, Prepared
from bench.models import Case, Sensitivities
from nldyn.base.arrays import Real


def collocation(case: Case, tolerance: float) -> Prepared:
    """`scipy.integrate.solve_bvp` for the periodic orbit, started from the orbit itself.

    It gives the orbit only, no derivatives. The first mesh has 100 points.
    """
    n = case.size

    def job(start: Real, omega: float) -> Job:
        p = motion.pack_parameters(case.system, start, omega)
        frequency, c, load = np.split(p[motion.HEAD : motion.HEAD + 3 * n], 3)
        damping, size, k, gap = case.system.total_damping, p[2], p[3], p[4]
        zero, turn = np.zeros((n, n)), np.diag(frequency)
        linear = np.block([[zero, turn], [-turn, -damping]])

        def depths(y: Real) -> Real:
            return np.asarray(np.maximum((c / frequency * size) @ y[:n] - gap, 0.0))

        def rates(phase: Real, y: Real) -> Real:
            out = linear @ y
            out[n:] += np.outer(load, np.cos(phase) / size)
            out[n:] -= np.outer(c, k * depths(y) ** 1.5 / size)
            return np.asarray(out / omega)

        def jacobians(phase: Real, y: Real) -> Real:
            out = np.repeat(linear[:, :, None], phase.size, axis=2)
            slope = 1.5 * k * np.sqrt(depths(y))
            out[n:, :n] -= np.multiply.outer(np.outer(c, c / frequency), slope)
            return np.asarray(out / omega)

        mesh = np.linspace(0.0, motion.PERIOD, 100)
        y0 = start / motion.units(p)
        guess = solve_ivp(
            lambda t, y: rates(np.array([t]), y[:, None])[:, 0],
            (0.0, motion.PERIOD),
            y0,
            method="DOP853",
            rtol=1e-8,
            atol=1e-8,
            t_eval=mesh,
        ).y

        def closed(a: Real, b: Real) -> Real:
            return np.asarray(a - b)

        def run() -> Real:
            found = solve_bvp(
                rates, closed, mesh, guess, tol=tolerance, max_nodes=50000, fun_jac=jacobians
            )
            if not found.success:
                raise EngineError(found.message)
            return np.asarray(found.y[:, 0])

        def read(y: Real) -> Sensitivities:
            none = np.full((2 * n, 2 * n), np.nan)
            return Sensitivities(y * motion.units(p), none, none[0])

        return Job(run, read)

    return job
