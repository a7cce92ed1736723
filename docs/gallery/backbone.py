"""The backbone of Duffing's oscillator.

Free motions of $\\ddot x + x + x^3 = 0$ from small to large; their frequency is
$\\sqrt{1 + a^2}/4K(m)$ with $m = a^2/2(1 + a^2)$
[I. Kovacic and M. J. Brennan, *The Duffing Equation*].
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import ellipk

from nldyn import PolynomialSpring, System, backbone

oscillator = System.from_matrices(
    [[1.0]], [[1.0]], {"x": [1.0]}, springs=[PolynomialSpring("x", [0.0, 0.0, 1.0])]
)
family = backbone(oscillator, amplitude_m=(0.01, 3.0))
size = family.amplitude
known = np.sqrt(1 + size**2) / (4 * ellipk(size**2 / (2 * (1 + size**2))))

fig, ax = plt.subplots()
ax.plot(family.frequency_hz, size, label="followed")
ax.plot(known, size, "k.", label="elliptic integral")
ax.set(xlabel="frequency (Hz)", ylabel="amplitude (m)")
ax.legend()

print(f"largest difference {np.abs(family.frequency_hz / known - 1).max():.1e}")
assert np.abs(family.frequency_hz / known - 1).max() < 1e-9
