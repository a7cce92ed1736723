"""Lyapunov exponents of Ueda's oscillator.

$\\ddot x + 0.05\\dot x + x^3 = 7.5\\cos t$ is chaotic [Y. Ueda, *J. Stat. Phys.* 20 (1979)]. The
picture shows the motion once a period. The exponents add up to minus the damping.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import HarmonicForce, PolynomialSpring, System, lyapunov_exponents, simulate
from nldyn.plot import plot_section

ueda = System.from_matrices(
    [[1.0]],
    [[0.0]],
    {"x": [1.0]},
    damping=[[0.05]],
    springs=[PolynomialSpring("x", [0.0, 0.0, 1.0])],
    excitation=[HarmonicForce("x", 7.5)],
)
hz = 1 / (2 * np.pi)
spectrum = lyapunov_exponents(ueda, hz, periods=300)
fig, ax = plt.subplots()
plot_section(simulate(ueda, hz, 2000, transient=20), ax)

print(f"exponents {spectrum.exponents}, largest to {spectrum.largest_error:.3f}")
assert abs(spectrum.exponents.sum() + 0.05) < 1e-8
assert spectrum.largest > 3 * spectrum.largest_error  # chaotic
