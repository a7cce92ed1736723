"""A free decay.

A linear oscillator is let go; two maxima that follow each other have the ratio
$\\exp(-2\\pi\\zeta/\\sqrt{1 - \\zeta^2})$: the logarithmic decrement.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import System, simulate

ratio = 0.03
oscillator = System.from_modal([1.0], {"x": [1.0]}, modal_damping=ratio)
motion = simulate(oscillator, 1.0, 12, start=[1.0, 0.0])
history = motion.history(4000)

fig, ax = plt.subplots()
ax.plot(history.time, history.displacement["x"], label="computed")
ax.plot(history.time, np.exp(-ratio * 2 * np.pi * history.time), "0.6", ls="--", label="exp(-ζωt)")
ax.legend()
ax.set(xlabel="time (s)", ylabel="displacement (m)", title="Damping ratio 0.03")

period = 1 / np.sqrt(1 - ratio**2)
first, second = motion.states(np.array([period, 2 * period]))[:, 0]
known = 2 * np.pi * ratio / np.sqrt(1 - ratio**2)
print(f"decrement {np.log(first / second):.9f}, in closed form {known:.9f}")
assert abs(np.log(first / second) / known - 1) < 1e-9
