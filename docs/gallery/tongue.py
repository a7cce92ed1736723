"""A tongue of Mathieu's equation: a map in frequency and force.

A force on x shakes the spring of y, and within a tongue y doubles its period. The curve of flips is
followed in frequency and force. A small y obeys Mathieu's equation with damping; Runge and Kutta
find its multipliers, of which one has to be -1.
"""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

from nldyn import HarmonicForce, Stop, System, continue_special, solve_orbit
from nldyn.curves import refine_special
from nldyn.plot import plot_curves

damping = 0.05
# three stops that never open are together the potential 4 (1 + x) y²/2 + 8 x²/2
stops = [Stop(at, 1.0, 2.0, gap=-1.0) for at in ("x + y", "x - y")]
system = System.from_matrices(
    np.eye(2),
    np.eye(2),
    {"x": [1.0, 0.0], "x + y": [1.0, 1.0], "x - y": [1.0, -1.0]},
    damping=np.diag([0.1, damping]),
    stops=[*stops, Stop("x", 2.0, 2.0, gap=-1.0, direction=-1)],
    excitation=[HarmonicForce("x", 2.0)],
)


def multipliers(omega, swing):
    """Of y'' + c y' + (5 + 4 swing cos ωt) y = 0."""

    def slope(t, y):
        return [y[1], -damping * y[1] - (5 + 4 * swing * np.cos(omega * t)) * y[0]]

    span = (0, 2 * np.pi / omega)
    ends = [solve_ivp(slope, span, y, rtol=1e-10, atol=1e-12).y[:, -1] for y in np.eye(2)]
    return np.linalg.eigvals(np.transpose(ends))


start = 2.0 / (9 - 4.6**2 + 0.46j) * np.array([1, 4.6j])  # of x: the linear response
orbit = solve_orbit(system, 4.6 / (2 * np.pi), guess=[start[0].real, 0, start[1].real, 0])
flip = refine_special(SimpleNamespace(kind="PD", orbit=orbit))
curve = continue_special(flip, ("frequency_hz", "amplitude"), ((0.6, 0.9), (0.1, 3.0)))
fig, ax = plt.subplots()
plot_curves([curve], ax)

hz, force = curve.values[::5].T
omega = 2 * np.pi * hz
swings = np.abs(force / (9 - omega**2 + 0.1j * omega))
off = [np.abs(multipliers(w, swing) + 1).min() for w, swing in zip(omega, swings, strict=True)]
print(f"{len(curve.values)} points, a multiplier within {max(off):.1e} of -1")
assert np.ptp(hz) > 0.05 and force.min() < 1.0 and max(off) < 1e-7
