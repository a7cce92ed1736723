"""A rotor against its stator.

A disc on a light shaft with weight, unbalance and a seal that pushes across the displacement,
within three pads: the scene `rotor_against_stator.toml`. It first touches where sag and whirl
together reach the gap, $\\mathrm{Re}\\,W/(k - ik_c) + |U| = 0.4$ mm.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

from nldyn import continue_branch, solve_orbit
from nldyn.base.resources import example
from nldyn.scene import build_system, load_scene

rotor = build_system(load_scene(example("rotor_against_stator.toml")))
branch = continue_branch(solve_orbit(rotor, 30.4), (30.0, 31.1))
found = next(p.frequency_hz for p in branch.special_points if p.kind == "GR")

fig, ax = plt.subplots()
for orbit in (branch.points[0], branch.points[-1]):
    moved = orbit.history(1000).displacement
    label = f"{orbit.frequency_hz:.1f} Hz"
    ax.plot(1e3 * moved["y"], -1e3 * moved["x"], label=label)
ax.axhline(-0.4, color="0.6", label="lower pad")
ax.set(xlabel="to the side (mm)", ylabel="upwards (mm)", aspect="equal", title="Path of the disc")
ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def left(hz):
    """Gap that is left, in m."""
    w = 2 * np.pi * hz
    sag = (98.1 / (4e5 - 8e3j)).real
    return 4e-4 - sag - 1e-4 * w**2 / abs(4e5 - 10.0 * w**2 + 1j * (80.0 * w - 8e3))


known = brentq(left, 20.0, 31.0)
print(f"touches at {found:.9f} Hz, in closed form {known:.9f} Hz")
assert abs(found / known - 1) < 1e-7
