"""Run-up through a resonance.

The excitation goes slowly from 8 to 12 Hz. So slowly, the largest motion is almost that of the
steady resonance, $1/2\\zeta\\sqrt{1-\\zeta^2}$ times the static one, and comes a little late.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import HarmonicForce, System, sweep
from nldyn.plot import plot_sweep

ratio = 0.02
oscillator = System.from_modal(
    [10.0], {"x": [1.0]}, modal_damping=ratio, excitation=[HarmonicForce("x", 1.0)]
)
motion = sweep(oscillator, (8.0, 12.0), rate_hz_per_s=0.05)
fig, ax = plt.subplots()
plot_sweep(motion, ax)

low, high = motion.extremes("x")
found = max(high.max(), -low.min()) * (2 * np.pi * 10.0) ** 2
known = 1 / (2 * ratio * np.sqrt(1 - ratio**2))
print(f"{found:.4f} times the static displacement, in steady motion {known:.4f}")
assert 0.98 < found / known < 1.0
