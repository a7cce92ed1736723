"""A first orbit against a Hertz stop.

The 1-DOF model of the paper at 26 Hz: a sphere against a wall once a period. No stop without loss
changes areas in the phase plane (Liouville), so that the product of the multipliers is
$e^{-2\\zeta\\omega_0 T}$.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import Stop, System, Unbalance, solve_orbit
from nldyn.plot import plot_contact_force, plot_phase_portrait

mass, stiffness, ratio = 2.48, 16877.0, 0.0142
system = System.from_matrices(
    [[mass]],
    [[stiffness]],
    {"middle": [1.0]},
    modal_damping=ratio,
    stops=[Stop("middle", stiffness=5.17e9)],
    excitation=[Unbalance("middle", 4.92e-6)],
)
orbit = solve_orbit(system, frequency_hz=26.0)

fig, axes = plt.subplots(1, 2, layout="constrained")
plot_phase_portrait(orbit, axes[0])
plot_contact_force(orbit, axes[1])
for ax in axes:
    ax.set_title("")
    ax.get_legend().remove()

found = np.prod(orbit.multipliers).real
known = np.exp(-2 * ratio * np.sqrt(stiffness / mass) * orbit.duration)
print(orbit)
print(f"product of the multipliers {found:.12f}, by Liouville {known:.12f}")
assert abs(found / known - 1) < 1e-9
