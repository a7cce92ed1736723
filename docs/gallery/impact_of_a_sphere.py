"""A sphere hits a wall.

Hertz's law makes the contact last $2.9432\\,\\delta/v$, with the deepest penetration
$\\delta = (5 m v^2/4 k)^{2/5}$ [K. L. Johnson, *Contact Mechanics*, section 11.4].
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import Stop, System, hertz_stiffness, impacts, simulate

mass, radius, speed = 0.033, 0.01, 0.5  # kg, m, m/s: a steel ball against a steel wall
stiffness = hertz_stiffness(radius, 2.1e11, 0.3)
ball = System.from_matrices([[mass]], [[0.0]], {"ball": [1.0]}, stops=[Stop("ball", stiffness)])
start = [-1e-5 * np.sqrt(mass), speed * np.sqrt(mass)]  # modal: scaled by the root of the mass
motion = simulate(ball, 5000.0, 1, start=start)
(hit,) = impacts(motion).duration

history = motion.history(4000)
fig, ax = plt.subplots()
ax.plot(1e6 * history.time, history.force[:, 0])
ax.set(xlabel="time (µs)", ylabel="contact force (N)", title="A steel ball at 0.5 m/s")

depth = (5 * mass * speed**2 / (4 * stiffness)) ** 0.4
known = 2.94326 * depth / speed
print(f"{1e6 * hit:.4f} µs, by Hertz {1e6 * known:.4f} µs")
assert abs(hit / known - 1) < 1e-5
