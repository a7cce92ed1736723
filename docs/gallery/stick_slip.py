"""A block on a belt sticks and slips.

A belt of speed V carries a block against its spring until the force reaches $\\mu_0 N$; it slips
back with less, and sticks again when it is as fast as the belt. Nothing excites it, so its
frequency is found: for a drop of friction at once the period is
$\\frac{2D}{kV} + \\frac{2}{\\omega}\\left(\\pi - \\arctan\\frac{D\\omega}{kV}\\right)$ with
$D = (\\mu_0 - \\mu)N$. With some damping and a coefficient that falls over 0.05 m/s, the limit
cycle is followed over the speed of the belt: sticking is lost where it turns back to an unstable
one without, which ends in steady sliding at a Hopf point.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from nldyn import ContinuationOptions, System, continue_branch, limit_cycle
from nldyn.system import DryFriction, Friction

BELT, REST, SLIDING = 0.1, 0.4, 0.3  # m/s


def on_belt(fading_speed, damping=0.0):
    friction = Friction(SLIDING, REST, fading_speed, base_speed=BELT)
    dampers = [DryFriction("block", 1.0, friction)]
    return System.from_matrices(
        [[1.0]], [[1.0]], {"block": [1.0]}, damping=[[damping]], dampers=dampers
    )


drop = REST - SLIDING
period = 2.0 * drop / BELT + 2.0 * (math.pi - math.atan(drop / BELT))
found = limit_cycle(on_belt(None)).duration
print(f"period {found:.9f} s, closed form {period:.9f} s")
assert abs(found / period - 1.0) < 1e-9

cycle = limit_cycle(on_belt(0.05, damping=0.04))
steps = ContinuationOptions(max_step=0.2)
branch = continue_branch(cycle, (BELT, 1.0), parameter="base_speed", options=steps)
print(cycle, *branch.special_points, sep="\n")

history = cycle.history(2000)
fig, (in_time, over_speed) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
in_time.plot(history.time, history.displacement["block"], "C0")
in_time.set(xlabel="time (s)", ylabel="displacement of the block (m)", title=f"belt at {BELT} m/s")
top, stable = branch.max_abs_displacement, branch.stable
over_speed.plot(branch.values, np.where(stable, top, np.nan), "C0", label="stable")
over_speed.plot(branch.values, np.where(stable, np.nan, top), "C0:", label="unstable")
for mark, style in zip(branch.special_points, ("k*", "ko"), strict=True):
    over_speed.plot(mark.value, mark.orbit.max_abs_displacement, style, label=mark.kind)
over_speed.set(xlabel="speed of the belt (m/s)", ylabel="largest displacement (m)")
over_speed.legend()
