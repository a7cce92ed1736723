"""A ball bounces to rest.

Each impact leaves 0.8 of the speed, and after infinitely many bounces the ball rests at the time
$t_0 (1 + e)/(1 - e)$, where $t_0 = \\sqrt{2h/g}$ is the time of the first fall.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import ConstantForce, RigidStop, System, impacts, simulate

height, gravity, restitution = 1.0, 9.81, 0.8
ball = System.from_matrices(
    [[1.0]],
    [[0.0]],
    {"ball": [1.0]},
    stops=[RigidStop("ball", restitution, direction=-1)],
    excitation=[ConstantForce("ball", -gravity)],
)
motion = simulate(ball, 0.2, 1, start=[height, 0.0])

history = motion.history(4000)
fig, ax = plt.subplots()
ax.plot(history.time, history.displacement["ball"])
ax.set(xlabel="time (s)", ylabel="height (m)", title="Restitution 0.8")

found = impacts(motion).time[-1]
known = np.sqrt(2 * height / gravity) * (1 + restitution) / (1 - restitution)
print(f"rests after {found:.6f} s, by the geometric series {known:.6f} s")
assert abs(found / known - 1) < 1e-5
