"""A rotor whips dry in its ring.

Knocked against its ring, a disc on a light shaft rolls around it backwards, with nothing else that
drives it: at $\\Omega = v/r$ for the speed v of its surface, $m v^2/r = k r + s\\,(r - c)$. That
lasts where friction gives what the damper takes, $d v \\leq \\mu s\\,(r - c)$: from the speed on at
which a disc that slides would whip, $\\mu\\,(m\\Omega^2 - k) = d\\,\\Omega$.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from nldyn import ConvergenceError, RoundStop, System, limit_cycle

m, k, d, s, c, mu = 10.0, 4e5, 200.0, 2e6, 6e-4, 0.2  # kg, N/m, N s/m, N/m, m

slides = np.roots([mu * m, -d, -mu * k]).max()  # rad/s
onset = slides * s * c / (s + k - m * slides**2)


def radius(v):
    """Of the disc that rolls, in m."""
    return (s * c + math.sqrt((s * c) ** 2 + 4.0 * (s + k) * m * v**2)) / (2.0 * (s + k))


def rolling(v):
    """The limit cycle of the rotor, from a knock that sets it going."""
    rotor = System.from_matrices(
        m * np.eye(2),
        k * np.eye(2),
        {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        damping=d * np.eye(2),
        stops=[RoundStop(("x", "y"), s, c, 1.0, friction=mu, surface_speed=v)],
    )
    knocked = math.sqrt(m) * np.array([1.01 * radius(v), 0.0, 0.0, -1.02 * v])
    return limit_cycle(rotor, start=knocked, frequency_hz=v / radius(v) / (2.0 * math.pi))


speeds = onset * np.array([1.01, 1.1, 1.25, 1.5, 1.75, 2.0])
found = np.array([rolling(v).frequency_hz for v in speeds])
known = np.array([v / radius(v) / (2.0 * math.pi) for v in speeds])
fig, ax = plt.subplots()
drawn = np.linspace(onset, speeds[-1])
ax.plot(drawn, [v / radius(v) / (2.0 * math.pi) for v in drawn], label="rolls, closed form")
ax.plot(speeds, found, "ko", label="limit cycles")
ax.axhline(slides / (2.0 * math.pi), color="C0", linestyle=":", label="slides, unstable")
ax.axvline(onset, color="0.6", linestyle="-.", label="onset")
ax.set(xlabel="speed of the surface (m/s)", ylabel="backward whirl (Hz)", title="Dry whip")
ax.legend(frameon=False)
print(f"from {onset:.6f} m/s on; largest difference {np.abs(found / known - 1.0).max():.1e}")
assert np.abs(found / known - 1.0).max() < 1e-10
try:
    raise AssertionError(f"{rolling(0.99 * onset)} below the onset")
except ConvergenceError:
    print("below it comes to rest")
