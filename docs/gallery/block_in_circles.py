"""A block that is shaken in circles on a table.

A force P that goes around in the plane drives a mass on springs k, pressed on a table by N. Its
way is a circle of radius X, and behind a contact stiffness $k_t$ friction is μN, at an angle a
from it with $\\cos a = \\mu N/(k_t X)$. With β, the frequency over its own, and damping ratio ζ

$|(1 - \\beta^2 + 2i\\zeta\\beta)\\,k X + \\mu N e^{ia}| = P$.

In a cycle $2\\pi\\mu N\\sqrt{X^2 - (\\mu N/k_t)^2}$ is lost.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from nldyn import HarmonicForce, System, continue_branch, solve_orbit
from nldyn.system import DryFriction

HZ = 1.0 / (2.0 * math.pi)
PULL, SPRING, DAMPING = 0.4, 20.0, 0.2

block = System.from_matrices(
    np.eye(2),
    np.eye(2),
    {"x": [1.0, 0.0], "y": [0.0, 1.0]},
    damping=2.0 * DAMPING * np.eye(2),
    dampers=[DryFriction("x", 1.0, PULL, tangential_stiffness=SPRING, second_tangent="y")],
    excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", 1.0, 90.0)],
)
branch = continue_branch(solve_orbit(block, 0.7 * HZ), (0.7 * HZ, 1.3 * HZ))
beta = np.array([point.omega for point in branch.points])
size = np.array([point.max_abs_displacement for point in branch.points])
loss = np.array([point.friction[0].loss for point in branch.points])
angle = np.arccos(PULL / (SPRING * size))
force = (1.0 - beta**2 + 2j * DAMPING * beta) * size + PULL * np.exp(1j * angle)
known = 2.0 * math.pi * PULL * np.sqrt(size**2 - (PULL / SPRING) ** 2)
print(f"force off 1 by {np.abs(np.abs(force) - 1.0).max():.1e}")
print(f"losses off the closed form by {np.abs(loss / known - 1.0).max():.1e}")
assert np.abs(np.abs(force) - 1.0).max() < 1e-8
assert np.abs(loss / known - 1.0).max() < 1e-8

fig, (ax, below) = plt.subplots(2, 1, sharex=True)
ax.plot(beta, size)
ax.set(ylabel="radius k X / P")
below.plot(beta, loss, label="computed")
below.plot(beta[::4], known[::4], "k.", label="closed form")
below.set(xlabel="frequency over the natural one", ylabel="loss k W / P²")
below.legend()
