"""A mass that leans against a spring.

One side has the stiffness 1, the other 4: half a period each of two linear oscillators. The
frequency $2\\omega_1\\omega_2/(\\omega_1 + \\omega_2)$ is the same for all amplitudes.
"""

import matplotlib.pyplot as plt
import numpy as np

from nldyn import Stop, System, backbone

oscillator = System.from_matrices(
    [[1.0]], [[1.0]], {"x": [1.0]}, stops=[Stop.linear("x", 3.0, gap=0.0)]
)
family = backbone(oscillator, amplitude_m=(0.1, 1.0))

fig, ax = plt.subplots()
for orbit in family.orbits[::3]:
    history = orbit.history(400)
    ax.plot(history.displacement["x"], history.modal_velocity[:, 0], color="tab:blue")
ax.axvline(0.0, color="0.6", label="spring")
ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
ax.set(xlabel="displacement (m)", ylabel="velocity (m/s)", aspect="equal")

known = 2 * 1 * 2 / (1 + 2) / (2 * np.pi)
print(
    f"{family.frequency_hz.min():.9f} to {family.frequency_hz.max():.9f} Hz, exactly {known:.9f} Hz"
)
assert np.abs(family.frequency_hz / known - 1).max() < 1e-9
