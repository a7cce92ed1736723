"""Neighbourhoods of attractors that contract: a motion that enters one has settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import FlowMap, chain
from nldyn.flow.settling import settling_runs
from nldyn.longterm.attractors import Attractor
from nldyn.orbits.orbit import Orbit, stroboscopic

CHUNK = 16  # periods between two looks at where a motion is
SHELLS = (1.0, 0.5, 0.2)  # of a neighbourhood, on which its contraction is tried
LINGERS = 48  # periods in a row near an attractor that is not periodic
UNDECIDED = -1
MOST = 0.95  # share of an attractor's states with a neighbour within a third of its radius
SMALLEST = 1e-6  # of the states: radius about an orbit, from which no smaller one is tried


@dataclass(frozen=True, eq=False)
class Target:
    """Where a motion counts as having reached an attractor.

    Parameters
    ----------
    states : (k, 2n)
        Stroboscopic states z.
    shapes : (k, 2n, 2n), optional
        Of a periodic orbit: motions with ``(z - states[i])ᵀ shapes[i] (z - states[i]) < 1`` for
        some i converge to it.
    reach : float
        Of another attractor: distance from the states within which it stays.
    """

    states: Real
    shapes: Real | None
    reach: float

    def reached(self, strobe: Real) -> NDArray[np.int64]:
        """Index of the state that each of the states (m, 2n) is near to, or -1."""
        if self.shapes is None:
            distance = np.asarray(self._tree.query(strobe)[0])
            return np.where(distance <= self.reach, 0, UNDECIDED)
        off = strobe[:, None, :] - self.states[None]
        near = np.einsum("mki,kij,mkj->mk", off, self.shapes, off) < 1.0
        return np.where(near.any(axis=1), near.argmax(axis=1), UNDECIDED)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.states)


def target_of(attractor: Attractor) -> Target:
    """Neighbourhood of an attractor in which motions count as having reached it."""
    if attractor.orbit is not None:
        return _orbit_target(attractor.orbit)
    tree = cKDTree(attractor.states)
    own = np.asarray(tree.query(attractor.states, k=2)[0])[:, 1]
    return Target(attractor.states, None, 3.0 * float(np.quantile(own, MOST)))


def _orbit_target(orbit: Orbit) -> Target:
    """Ellipsoids around the stroboscopic states of a stable orbit that contract over its period.

    Each one is a level of the quadratic function that decreases under the linearised map
    [Stein's equation]; the largest for which points on three shells also come nearer under
    the full map is taken.
    """
    flow, omega, period = orbit.problem.flow, orbit.omega, orbit.period
    states = stroboscopic(orbit)
    parts = orbit.problem.segments // period
    steps = [chain(orbit.jacobians[k * parts : (k + 1) * parts]) for k in range(period)]
    scale = orbit.problem.scale(orbit.point)
    shapes = []
    for k in range(period):
        turn = chain(np.array(steps[k:] + steps[:k]))
        shape = sla.solve_discrete_lyapunov(turn.T, np.eye(len(turn)))
        shapes.append(shape / np.linalg.norm(shape, 2))
    rng = np.random.default_rng(1)
    tries = rng.standard_normal((40 * flow.system.size, states.shape[1]))
    radius = scale

    def comes_nearer(k: int, radius: float) -> bool:
        lower = np.linalg.cholesky(shapes[k])
        for shell in SHELLS:
            for direction in tries:
                off = np.linalg.solve(lower.T, direction / np.linalg.norm(direction))
                start = states[k] + shell * radius * off
                found = flow.strobe(start, omega, period)
                if found.failure:
                    return False
                left = found.ends[-1] - states[k]
                if float(left @ shapes[k] @ left) >= (shell * radius) ** 2:
                    return False
        return True

    while radius > SMALLEST * scale and not all(comes_nearer(k, radius) for k in range(period)):
        radius /= 1.5
    return Target(states, np.array(shapes) / radius**2, 0.0)


@dataclass(frozen=True)
class Settled:
    """Where motions from k states have gone.

    Parameters
    ----------
    labels, phases, periods : (k,) int
        As in `Basins`.
    ends : (k, 2n)
        Last states z.
    failures : (k,) of str
        Why a simulation failed, if it did.
    """

    labels: NDArray[np.int64]
    phases: NDArray[np.int64]
    periods: NDArray[np.int64]
    ends: Real
    failures: NDArray[np.object_]


def settle(
    flow: FlowMap, omega: float, targets: Sequence[Target], longest: int, states: Real
) -> Settled:
    """Follow motions from states z (k, 2n) until they reach a target, or for `longest` periods."""
    found = Settled(
        np.full(len(states), UNDECIDED, dtype=np.int64),
        np.zeros(len(states), dtype=np.int64),
        np.zeros(len(states), dtype=np.int64),
        states.copy(),
        np.full(len(states), "", dtype=object),
    )
    for row in range(len(states)):
        try:
            _settle_one(flow, omega, targets, longest, found, row)
        except ConvergenceError as error:
            found.failures[row] = str(error)
    return found


def _settle_one(
    flow: FlowMap, omega: float, targets: Sequence[Target], longest: int, found: Settled, row: int
) -> None:
    """Fill one row of what is found; see `settle`."""
    lingered = [0] * len(targets)
    for run in settling_runs(flow, found.ends[row], omega, longest, CHUNK):
        before = int(found.periods[row])
        found.ends[row] = run[-1]
        found.periods[row] = before + len(run)
        for index, target in enumerate(targets):
            near = target.reached(run)
            hits = np.flatnonzero(near != UNDECIDED)
            if target.shapes is None:
                lingered[index] = lingered[index] + len(run) if len(hits) == len(run) else 0
                if lingered[index] >= LINGERS:
                    found.labels[row] = index
                    return
            elif len(hits):
                period = before + 1 + int(hits[0])
                found.labels[row] = index
                found.phases[row] = (int(near[hits[0]]) - period) % len(target.states)
                found.periods[row] = period
                return
