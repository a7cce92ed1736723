"""Duffing's oscillator.

A hardening spring bends the resonance curve over; two folds bound the range in which there are two
stable motions. At the peak a balance of one harmonic has $c\\,\\omega\\,a = F$ and
$\\omega^2 = k + \\tfrac34 k_3 a^2$ [A. H. Nayfeh and D. T. Mook, *Nonlinear Oscillations*].
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

from nldyn import HarmonicForce, PolynomialSpring, System, continue_branch, solve_orbit
from nldyn.plot import plot_diagram

damping, cubic, force = 0.05, 0.05, 0.1
duffing = System.from_matrices(
    [[1.0]],
    [[1.0]],
    {"x": [1.0]},
    damping=[[damping]],
    springs=[PolynomialSpring("x", [0.0, 0.0, cubic])],
    excitation=[HarmonicForce("x", force)],
)
branch = continue_branch(solve_orbit(duffing, 0.1), (0.1, 0.25))
fig, ax = plt.subplots()
plot_diagram(branch, ax)

peak = max(branch.points, key=lambda orbit: orbit.max_abs_displacement)
found = peak.max_abs_displacement
known = brentq(lambda a: damping * np.sqrt(1 + 0.75 * cubic * a**2) * a - force, 0.1, 10)
ax.axhline(known, color="0.7", zorder=0)
ax.text(0.25, known, "by one harmonic", ha="right", va="bottom", fontsize="small")
ax.set_ylim(top=1.12 * known)
print([f"{p.kind} {p.frequency_hz:.6f} Hz" for p in branch.special_points])
print(f"peak {found:.5f}, by one harmonic {known:.5f}")
assert [point.kind for point in branch.special_points] == ["LP", "LP"]
assert abs(found / known - 1) < 0.01
