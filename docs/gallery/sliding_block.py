"""A block that slides on dry friction.

Pulled to and fro with $P\\cos\\omega t$ against a spring k and a friction force F, a block that
does not stop within its swing has the amplitude of J. P. Den Hartog (1931); β is the frequency over
its own:
$(kX/P)^2 = V^2 - (F/P)^2 U^2$ with $V = 1/(1 - \\beta^2)$, $U = \\tan(\\pi/2\\beta)/\\beta$. Below
$kX = F/\\beta^2$ it rests at both ends of its swing.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from nldyn import HarmonicForce, System, continue_branch, solve_orbit
from nldyn.system import DryFriction


def functions(beta):
    """Den Hartog's V and U."""
    return 1.0 / (1.0 - beta**2), np.tan(0.5 * math.pi / beta) / beta


def largest_share(beta):
    """F/P up to which it does not rest."""
    size, swing = functions(beta)
    return size / np.hypot(swing, beta**-2)


fig, ax = plt.subplots()
for share in (0.2, 0.4, 0.7):
    block = System.from_matrices(
        [[1.0]],
        [[1.0]],
        {"x": [1.0]},
        dampers=[DryFriction("x", normal_force=1.0, friction=share)],
        excitation=[HarmonicForce("x", 1.0)],
    )
    orbit = solve_orbit(block, 0.9 / (2.0 * math.pi))
    branch = continue_branch(orbit, (0.6 / (2.0 * math.pi), 0.9 / (2.0 * math.pi)))
    beta = np.array([point.omega for point in branch.points])
    ax.plot(beta, [point.max_abs_displacement for point in branch.points], label=f"F/P = {share}")
    size, swing = functions(0.9)
    found, known = orbit.max_abs_displacement, math.sqrt(size**2 - (share * swing) ** 2)
    print(f"F/P = {share}: {found:.9f}, Den Hartog {known:.9f}")
    assert abs(found / known - 1.0) < 1e-9
    ax.plot(0.9, known, "ko", label="Den Hartog (1931)" if share == 0.2 else None)
    rests = np.array([point.friction[0].stuck > 0.0 for point in branch.points])
    assert (rests == (share > largest_share(beta))).all()
beta = np.linspace(0.6, 0.9)
ax.plot(beta, largest_share(beta) / beta**2, "k--", label="below: rests twice a cycle")
ax.set(xlabel="frequency over the natural one", ylabel="largest displacement k X / P")
ax.legend()
