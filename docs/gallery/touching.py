"""Where it just touches: a map in frequency and gap.

A grazing orbit of a system with a stop, followed in the frequency and the gap. Without contact the
response is linear, so that the curve is $g = F/|k - m\\omega^2 + ic\\omega|$.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import HarmonicForce, Stop, System, continue_branch, continue_special, solve_orbit
from nldyn.plot import plot_curves

oscillator = System.from_matrices(
    [[1.0]],
    [[1.0]],
    {"x": [1.0]},
    damping=[[0.1]],
    stops=[Stop.linear("x", 2.0, gap=3.0)],
    excitation=[HarmonicForce("x", 1.0)],
)
branch = continue_branch(solve_orbit(oscillator, 0.05), (0.05, 0.25))
touch = next(point for point in branch.special_points if point.kind == "GR")
curve = continue_special(touch, ("frequency_hz", "gap"), ((0.1, 0.25), (1.5, 6.0)))

hz, gap = curve.values.T
omega = 2 * np.pi * hz
known = 1 / np.abs(1 - omega**2 + 0.1j * omega)
fig, ax = plt.subplots()
plot_curves([curve], ax)
ax.plot(hz[::4], known[::4], "k.", label="linear response")
ax.legend()

print(f"{len(hz)} points, largest difference {np.abs(gap / known - 1).max():.1e}")
assert len(hz) > 20
assert np.abs(gap / known - 1).max() < 1e-8
