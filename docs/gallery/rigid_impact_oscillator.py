"""An oscillator against a rigid stop.

Each impact leaves 0.8 of the speed [S. W. Shaw and P. J. Holmes, *J. Sound Vib.* 90 (1983)]. Where
the impact becomes a touch, the linear response reaches just the gap: the branch goes on with it.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

from nldyn import HarmonicForce, RigidStop, System, continue_branch, solve_orbit
from nldyn.plot import plot_diagram

oscillator = System.from_matrices(
    [[1.0]],
    [[1.0]],
    {"x": [1.0]},
    damping=[[0.1]],
    stops=[RigidStop("x", restitution=0.8, gap=0.3)],
    excitation=[HarmonicForce("x", 1.0)],
)
branch = continue_branch(solve_orbit(oscillator, 0.27), (0.2, 0.8))
calm = continue_branch(solve_orbit(oscillator, 0.45), (0.3, 0.5))
fig, ax = plt.subplots()
plot_diagram([branch, calm], ax)

found = branch.special_points[-1].frequency_hz
known = brentq(lambda w: 1 / abs(1 - w**2 + 0.1j * w) - 0.3, 1.5, 3.0) / (2 * np.pi)
print([f"{p.kind} {p.frequency_hz:.6f} Hz" for p in branch.special_points])
print(f"touches at {found:.9f} Hz, in closed form {known:.9f} Hz")
assert abs(found / known - 1) < 1e-7
