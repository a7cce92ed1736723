"""A rotor rubs all around its seal ring.

A disc on a light shaft with unbalance, in a ring of 0.6 mm. Full annular rub is a circular whirl,
about which small motions have constant coefficients in the frame that turns with it: there friction
of the spinning surface makes it unstable.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

from nldyn import RoundStop, System, Unbalance, continue_branch, solve_orbit

m, k, c, ring, gap, mu, unbalance = 10.0, 4e5, 200.0, 2e6, 6e-4, 0.08, 2e-3
rotor = System.from_matrices(
    m * np.eye(2),
    k * np.eye(2),
    {"x": [1.0, 0.0], "y": [0.0, 1.0]},
    damping=c * np.eye(2),
    stops=[RoundStop(("x", "y"), ring, gap, 1.0, friction=mu, surface_speed=5.0)],
    excitation=[Unbalance("x", unbalance), Unbalance("y", unbalance, phase_deg=-90.0)],
)
branch = continue_branch(solve_orbit(rotor, 24.0), (24.0, 45.0))
found = next(p.frequency_hz for p in branch.special_points if p.kind == "NS")

radius = 1e3 * np.array([orbit.max_abs_displacement for orbit in branch.points])
stable = np.array([orbit.stable for orbit in branch.points])
fig, ax = plt.subplots()
ax.plot(branch.frequency_hz, np.where(stable, radius, np.nan), "C0-", label="stable")
ax.plot(branch.frequency_hz, radius, "C0:", label="unstable")
ax.axhline(1e3 * gap, color="0.6", linestyle="-.", label="clearance")
ax.set(xlabel="speed (Hz)", ylabel="radius of the whirl (mm)", title="Full annular rub")
ax.legend(frameon=False)


def growth(hz):
    """Of the fastest small motion about the whirl in closed form, in 1/s."""
    w = 2.0 * np.pi * hz
    inertia, turn = k - m * w**2, np.array([[0.0, -1.0], [1.0, 0.0]])

    def missing(r):
        rubs = (1.0 + 1j * mu) * ring * (r - gap)
        return abs((inertia + 1j * c * w) * r + rubs) - unbalance * w**2

    radius = brentq(missing, gap, 2.0 * gap, xtol=1e-18)
    secant = ring * (1.0 - gap / radius)
    contact = np.array([[ring, -mu * secant], [mu * ring, secant]])
    spring = inertia * np.eye(2) + c * w * turn + contact
    damper = c * np.eye(2) + 2.0 * m * w * turn
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-spring / m, -damper / m]])
    return np.linalg.eigvals(matrix).real.max()


known = brentq(growth, 33.0, 36.0, xtol=1e-12)
print(f"unstable from {found:.9f} Hz on, in closed form {known:.9f} Hz")
assert abs(found / known - 1.0) < 1e-9
