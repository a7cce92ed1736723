"""Three balls in a row.

The first hits the second and that the third; with restitution e the last one leaves with
$((1 + e)/2)^2$ of the first speed.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import RigidStop, System, simulate

restitution, gap = 0.9, 0.01
balls = System.from_matrices(
    np.eye(3),
    np.zeros((3, 3)),
    dict(zip("abc", np.eye(3), strict=True)),
    stops=[
        RigidStop("a", restitution, gap, against="b"),
        RigidStop("b", restitution, gap, against="c"),
    ],
)
motion = simulate(balls, 20.0, 1, start=[*np.zeros(3), 1.0, 0.0, 0.0])

history = motion.history(2000)
fig, ax = plt.subplots()
for place, (name, moved) in enumerate(history.displacement.items()):
    ax.plot(1e3 * history.time, 1e3 * (moved + gap * place), label=f"ball {name}")
ax.set(xlabel="time (ms)", ylabel="place (mm)")
ax.legend()

found = motion.end[5]  # masses of 1 kg: velocities are those of the modes
known = ((1 + restitution) / 2) ** 2
print(f"{found:.9f} m/s, by momentum {known:.9f} m/s")
assert abs(found / known - 1) < 1e-9
