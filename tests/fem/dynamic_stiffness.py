"""Exact frequencies of plane Euler-Bernoulli frames, without any finite element.

The dynamic stiffness of a uniform member follows from the closed-form solutions of
EI w'''' = rho A omega² w and EA u'' = -rho A omega² u (W.H. Wittrick and F.W. Williams, A general
algorithm for computing natural frequencies of elastic structures, Quarterly Journal of Mechanics
and Applied Mathematics 24, 1971). Here the coefficients of sin, cos and of two decaying
exponentials are solved for numerically, so that nothing overflows. Natural frequencies are the
zeros of the determinant.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class Member:
    """A uniform member from node `start` to node `stop`."""

    start: int
    stop: int
    EA: float
    EI: float
    mass_per_length: float


def bending_stiffness(EI, rhoA, length, omega):
    """(4, 4): forces and moments of (w, rotation) at both ends."""
    k = (rhoA * omega**2 / EI) ** 0.25
    c, s, d = np.cos(k * length), np.sin(k * length), np.exp(-k * length)
    # w = a cos kx + b sin kx + c exp(-kx) + d exp(-k (L - x))
    displacement = np.array(
        [[1, 0, 1, d], [0, k, -k, k * d], [c, s, d, 1], [-k * s, k * c, -k * d, k]]
    )
    shear_and_moment = np.array(
        [
            [0, -(k**3), -(k**3), k**3 * d],
            [k**2, 0, -(k**2), -(k**2) * d],
            [-(k**3) * s, k**3 * c, k**3 * d, -(k**3)],
            [-(k**2) * c, -(k**2) * s, k**2 * d, k**2],
        ]
    )
    return EI * np.linalg.solve(displacement.T, shear_and_moment.T).T


def stretching_stiffness(EA, rhoA, length, omega):
    """(2, 2): forces along the axis at both ends."""
    q = omega * np.sqrt(rhoA / EA)
    return (
        EA * q / np.sin(q * length) * np.array([[np.cos(q * length), -1], [-1, np.cos(q * length)]])
    )


def frame_stiffness(nodes, members, omega, lumps=None):
    """(3n, 3n) dynamic stiffness; `lumps` adds to the diagonal at {dof: spring - omega² mass}."""
    D = np.zeros((3 * len(nodes), 3 * len(nodes)))
    for member in members:
        span = np.subtract(nodes[member.stop], nodes[member.start])
        length = np.hypot(*span)
        c, s = span / length
        local = np.zeros((6, 6))
        local[np.ix_([0, 3], [0, 3])] = stretching_stiffness(
            member.EA, member.mass_per_length, length, omega
        )
        bend = [1, 2, 4, 5]
        local[np.ix_(bend, bend)] = bending_stiffness(
            member.EI, member.mass_per_length, length, omega
        )
        T = np.kron(np.eye(2), [[c, s, 0], [-s, c, 0], [0, 0, 1]])
        dofs = [3 * node + i for node in (member.start, member.stop) for i in range(3)]
        D[np.ix_(dofs, dofs)] += T.T @ local @ T
    for dof, (spring, mass) in (lumps or {}).items():
        D[dof, dof] += spring - omega**2 * mass
    return D


def natural_frequency(nodes, members, held, low_hz, high_hz, lumps=None):
    """The one zero of det D in the bracket, in Hz; the determinant is scaled to stay finite."""
    free = np.setdiff1d(np.arange(3 * len(nodes)), held)

    def determinant(f):
        D = frame_stiffness(nodes, members, 2 * np.pi * f, lumps)[np.ix_(free, free)]
        sign, log = np.linalg.slogdet(D)
        return sign * np.exp(log - reference)

    reference = 0.0
    at_low = frame_stiffness(nodes, members, 2 * np.pi * low_hz, lumps)[np.ix_(free, free)]
    reference = np.linalg.slogdet(at_low)[1]
    return brentq(determinant, low_hz, high_hz, xtol=1e-13, rtol=1e-14)
