"""A ball on a shaking table doubles its period.

It hits the table once a period. The curve goes up in the acceleration of the table; with
restitution e the motion becomes unstable at
$a/g = \\sqrt{(\\pi(1-e)/(1+e))^2 + (2(1+e^2)/(1+e)^2)^2}$
[A. C. J. Luo and R. P. S. Han, *Nonlinear Dynamics* 10 (1996)].
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import ConstantForce, HarmonicForce, RigidStop, System, continue_branch, solve_orbit
from nldyn.plot import plot_diagram

gravity, hz, e, shaken = 9.81, 10.0, 0.5, 1.2 * 9.81
omega, period = 2 * np.pi * hz, 1 / hz
ball = System.from_matrices(
    [[1.0]],
    [[0.0]],
    {"ball": [1.0]},
    stops=[RigidStop("ball", e, direction=-1)],
    excitation=[HarmonicForce("ball", shaken), ConstantForce("ball", -gravity)],
)
# it leaves the table at g T / 2, when the table rises at g T (1 - e) / 2 (1 + e)
phase = -np.arcsin(gravity * period * (1 - e) / (2 * (1 + e)) * omega / shaken)
later = -phase / omega
height = gravity * later * (period - later) / 2 - shaken / omega**2 * (1 - np.cos(phase))
orbit = solve_orbit(ball, hz, guess=[height, gravity * (period / 2 - later)])
branch = continue_branch(orbit, (1.1 * gravity, 1.8 * gravity), parameter="amplitude")
fig, ax = plt.subplots()
plot_diagram([branch], ax)
ax.set_title("Ball on a shaking table, restitution 0.5")

(flip,) = [special for special in branch.special_points if special.kind == "PD"]
found = flip.value / gravity
known = np.hypot(np.pi * (1 - e) / (1 + e), 2 * (1 + e**2) / (1 + e) ** 2)
print(f"{found:.9f} g, in closed form {known:.9f} g")
assert abs(found / known - 1) < 1e-7
