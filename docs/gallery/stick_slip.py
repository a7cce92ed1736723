"""A block on a belt sticks and slips.

A belt of speed V carries a block against its spring until the force reaches $\\mu_0 N$; it slips
back with $\\mu N$, and sticks again when it is as fast as the belt. For a drop at once the period
is
$\\frac{2D}{kV} + \\frac{2}{\\omega}\\left(\\pi - \\arctan\\frac{D\\omega}{kV}\\right)$ with
$D = (\\mu_0 - \\mu)N$; here the coefficient falls within a ten thousandth of the speed.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from nldyn import System, simulate
from nldyn.system import DryFriction, Friction

BELT, REST, SLIDING = 0.1, 0.4, 0.3  # m/s
block = System.from_matrices(
    [[1.0]],
    [[1.0]],
    {"block": [1.0]},
    dampers=[DryFriction("block", 1.0, Friction(SLIDING, REST, 1e-4 * BELT, base_speed=BELT))],
)
motion = simulate(block, frequency_hz=0.1, periods=6)
drop = REST - SLIDING
period = 2.0 * drop / BELT + 2.0 * (math.pi - math.atan(drop / BELT))
times, values = motion.extremes("block")
tops = times[values > values.mean()][-3:]
found = float(np.diff(tops).mean())
print(f"period {found:.6f} s, closed form {period:.6f} s")
assert abs(found / period - 1.0) < 1e-3

history = motion.history(2000)
fig, ax = plt.subplots()
ax.plot(history.time, history.displacement["block"])
ax.set(xlabel="time (s)", ylabel="displacement of the block (m)")
