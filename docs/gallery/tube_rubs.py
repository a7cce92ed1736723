"""A tube rubs in its support.

The flow carries a tube round in the hole of its support. What wears off goes with the work rate,
normal force times speed of sliding (Fisher et al. 1995). A rub all around is a circular whirl
$u\\,(1 + (1 + i\\mu)\\,H_{ss}\\,N/|u|) = H_{sf} F$ with receptances H; it works at $\\omega |u| N$.
"""

import math

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

from nldyn import HarmonicForce, RoundStop, System, continue_branch, solve_orbit

MASS, FIRST_HZ, DAMPING, FORCE = 2.04, 20.47, 0.03, 2.0  # kg, Hz, of the flow in N; pinned ends
STIFFNESS, CLEARANCE, FRICTION = 1e5, 3e-4, 0.05  # of the support in N/m, m

order = np.array([1, 3])  # the second has its node at the support
hz = FIRST_HZ * order**2
support, flow = (math.sqrt(2.0 / MASS) * np.sin(order * math.pi * x) for x in (0.5, 0.25))
still = np.zeros(order.size)
places = {
    "support_y": np.r_[support, still], "support_z": np.r_[still, support],
    "flow_y": np.r_[flow, still], "flow_z": np.r_[still, flow],
}  # fmt: skip


def work_rate(at):
    """Of a rub all around, in W."""
    omega, natural = 2.0 * math.pi * at, 2.0 * math.pi * hz
    modes = 1.0 / (natural**2 - omega**2 + 2j * DAMPING * natural * omega)
    own, moved = support**2 @ modes, (support * flow) @ modes * FORCE

    def missing(r):
        return abs(r + (1.0 + 1j * FRICTION) * own * STIFFNESS * (r - CLEARANCE)) - abs(moved)

    r = brentq(missing, CLEARANCE, 2.0 * CLEARANCE, xtol=1e-18)
    return omega * r * STIFFNESS * (r - CLEARANCE)


hole = RoundStop(
    ("support_y", "support_z"), STIFFNESS, CLEARANCE, 1.0, friction=FRICTION, surface_speed=0.0
)
push = [HarmonicForce("flow_y", FORCE), HarmonicForce("flow_z", FORCE, phase_deg=-90.0)]
tube = System.from_modal(
    np.r_[hz, hz], places, modal_damping=DAMPING, stops=[hole], excitation=push
)
branch = continue_branch(solve_orbit(tube, 20.0), (17.5, 21.0))
at = np.array([orbit.frequency_hz for orbit in branch.points])
found = np.array([orbit.friction[0].work_rate for orbit in branch.points])
known = np.array([work_rate(each) for each in at])
fig, ax = plt.subplots()
drawn = np.linspace(17.5, 21.0)
ax.plot(drawn, [1e3 * work_rate(each) for each in drawn], label="closed form")
ax.plot(at, 1e3 * found, "ko", label="orbits")
ax.set(xlabel="frequency of the flow (Hz)", ylabel="work rate (mW)", title="A tube in its support")
ax.legend(frameon=False)
print(f"largest difference of {at.size} orbits: {np.abs(found / known - 1.0).max():.1e}")
assert at.size > 5 and np.abs(found / known - 1.0).max() < 1e-9
