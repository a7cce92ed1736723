"""The equations of motion with their derivatives as one compiled function, for general solvers.

The unknowns are scaled to the size of the motion, the independent variable is the forcing phase:

    y = (x̂, X̂ row by row, ω dx̂/dω at fixed phase),   x̂ = (Ω q, q') / size,

2n (2n + 2) numbers that are all of the order of one, so that one tolerance fits them all.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from bench.models import Sensitivities
from nldyn.base.arrays import Real
from nldyn.system.loads import Unbalance
from nldyn.system.system import System

FLIGHT, CONTACT = 0.0, 1.0
PERIOD = 2.0 * math.pi
HEAD = 6  # n, ω, size, k, gap, mode


def pack_parameters(system: System, start: Real, omega: float) -> Real:
    """All numbers of the equations in one vector, as `rate` wants them."""
    (stop,), (source,) = system.elastic_stops.values(), system.excitation
    assert stop.exponent == 1.5 and isinstance(source, Unbalance)
    frequencies = system.natural_frequencies
    n = system.size
    size = float(np.hypot(np.linalg.norm(frequencies * start[:n]), np.linalg.norm(start[n:])))
    load = source.mass_times_radius * omega**2 * system.participation[source.at]
    head = [n, omega, size, stop.stiffness, stop.gap, CONTACT]
    c = system.stop_vector(stop)
    return np.concatenate([head, frequencies, c, load, system.total_damping.ravel()])


def in_mode(parameters: Real, mode: float) -> Real:
    """The same parameters for flights (no stop) or contacts."""
    changed = parameters.copy()
    changed[HEAD - 1] = mode
    return changed


def units(parameters: Real) -> Real:
    """Units of the scaled state (2n,)."""
    n, size = int(parameters[0]), parameters[2]
    return np.asarray(size * np.concatenate([1.0 / parameters[HEAD : HEAD + n], np.ones(n)]))


def initial(parameters: Real, start: Real) -> Real:
    """Scaled unknowns at phase zero."""
    size = start.size
    return np.concatenate([start / units(parameters), np.eye(size).ravel(), np.zeros(size)])


def to_sensitivities(parameters: Real, y: Real) -> Sensitivities:
    """Physical results from the scaled unknowns at the end."""
    unit, omega = units(parameters), parameters[1]
    size = unit.size
    scaled = y[size : size + size**2].reshape(size, size)
    monodromy = unit[:, None] * scaled / unit
    return Sensitivities(y[:size] * unit, monodromy, y[size + size**2 :] * unit / omega)


@njit(cache=True, error_model="numpy")
def penetration(parameters, y):
    """Penetration of the stop over size / Ω₁."""
    n = int(parameters[0])
    total = -parameters[4] / parameters[2]
    for k in range(n):
        total += parameters[HEAD + n + k] / parameters[HEAD + k] * y[k]
    return total * parameters[HEAD]


@njit(cache=True, error_model="numpy")
def rate(phase, y, parameters, out):
    """Derivative of the unknowns with respect to the forcing phase."""
    n = int(parameters[0])
    omega, size = parameters[1], parameters[2]
    frequency = parameters[HEAD : HEAD + n]
    c = parameters[HEAD + n : HEAD + 2 * n]
    load = parameters[HEAD + 2 * n : HEAD + 3 * n]
    damping = parameters[HEAD + 3 * n :].reshape(n, n)
    width = 2 * n
    force, slope = 0.0, 0.0
    if parameters[HEAD - 1] == CONTACT:
        depth = -parameters[4]
        for k in range(n):
            depth += c[k] * size / frequency[k] * y[k]
        if depth > 0.0:
            root = math.sqrt(depth)
            force = parameters[3] * depth * root / size
            slope = 1.5 * parameters[3] * root
    turn = math.cos(phase) / size
    for k in range(n):
        out[k] = frequency[k] * y[n + k] / omega
        total = turn * load[k] - frequency[k] * y[k] - c[k] * force
        for j in range(n):
            total -= damping[k, j] * y[n + j]
        out[n + k] = total / omega
    X = y[width : width + width * width].reshape(width, width)
    dX = out[width : width + width * width].reshape(width, width)
    for i in range(width):
        felt = 0.0
        for k in range(n):
            felt += c[k] / frequency[k] * X[k, i]
        for k in range(n):
            dX[k, i] = frequency[k] * X[n + k, i] / omega
            total = -frequency[k] * X[k, i] - c[k] * slope * felt
            for j in range(n):
                total -= damping[k, j] * X[n + j, i]
            dX[n + k, i] = total / omega
    z = y[width + width * width :]
    dz = out[width + width * width :]
    felt = 0.0
    for k in range(n):
        felt += c[k] / frequency[k] * z[k]
    for k in range(n):
        dz[k] = frequency[k] * z[n + k] / omega - out[k]
        total = -frequency[k] * z[k] - c[k] * slope * felt + 2.0 * turn * load[k]
        for j in range(n):
            total -= damping[k, j] * z[n + j]
        dz[n + k] = total / omega - out[n + k]


def numpy_rate(phase: float, y: Real, parameters: Real) -> Real:
    """The same as `rate`, written in numpy as one would for a general solver."""
    n = int(parameters[0])
    _, omega, size, k, gap, mode = parameters[:HEAD]
    frequency, c, load = parameters[HEAD : HEAD + 3 * n].reshape(3, n)
    damping = parameters[HEAD + 3 * n :].reshape(n, n)
    width = 2 * n
    columns = np.empty((width, width + 2))
    columns[:, 0] = y[:width]
    columns[:, 1:-1] = y[width : width + width**2].reshape(width, width)
    columns[:, -1] = y[width + width**2 :]
    q, v = columns[:n], columns[n:]
    felt = (c / frequency) @ q
    depth = size * felt[0] - gap if mode == CONTACT else 0.0
    push = felt * (1.5 * k * math.sqrt(max(depth, 0.0)))
    push[0] = k * max(depth, 0.0) ** 1.5 / size
    rates = np.empty_like(columns)
    rates[:n] = frequency[:, None] * v
    rates[n:] = -frequency[:, None] * q - damping @ v - np.outer(c, push)
    turn = load * (math.cos(phase) / size)
    rates[n:, 0] += turn
    rates[n:, -1] += 2.0 * turn
    rates /= omega
    rates[:, -1] -= rates[:, 0]
    return np.concatenate([rates[:, 0], rates[:, 1:-1].ravel(), rates[:, -1]])


@njit(cache=True, error_model="numpy")
def runge_kutta(y, parameters, A, B, C, steps):
    """Explicit Runge-Kutta steps of equal length over one period, with a given tableau."""
    stages = B.size
    h = PERIOD / steps
    y = y.copy()
    slopes = np.empty((stages, y.size))
    state = np.empty(y.size)
    for step in range(steps):
        phase = step * h
        for i in range(stages):
            state[:] = y
            for j in range(i):
                if A[i, j] != 0.0:
                    state += h * A[i, j] * slopes[j]
            rate(phase + C[i] * h, state, parameters, slopes[i])
        for i in range(stages):
            y += h * B[i] * slopes[i]
    return y
