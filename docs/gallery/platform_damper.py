"""A blade with a friction damper under its platform.

The sector of a bladed disk, reduced to its blade and its platform. The damper is pressed on the
platform by its centrifugal force N and gives way before it slides: Jenkins' element, which
loses $4\\mu N(X - \\mu N/k_t)$ in a cycle of amplitude X. Pressed on too little, the blade hardly
feels it, too much, it sticks and only stiffens; the best is in between.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from nldyn import HarmonicForce, System, continue_branch, solve_orbit
from nldyn.system import DryFriction

MASS = np.diag([0.3, 1.0])  # kg: blade and platform
STIFFNESS = np.array([[1e5, -1e5], [-1e5, 1.6e6]])  # N/m
FRICTION, SPRING = 0.5, 4e5  # of the damper; N/m

fig, ax = plt.subplots()
for force in (0.0, 2.0, 8.0, 1000.0):
    sector = System.from_matrices(
        MASS,
        STIFFNESS,
        {"blade": [1.0, 0.0], "platform": [0.0, 1.0]},
        modal_damping=0.002,
        dampers=[DryFriction("platform", force, FRICTION, tangential_stiffness=SPRING)]
        if force
        else [],
        excitation=[HarmonicForce("blade", 1.0)],
    )
    orbit = solve_orbit(sector, 88.0)
    branch = continue_branch(orbit, (85.0, 94.0))
    hz = [point.frequency_hz for point in branch.points]
    blade = [1e3 * point.max_abs_displacement for point in branch.points]
    ax.plot(hz, blade, label=f"N = {force:g} N")
    peak = branch.points[int(np.argmax(blade))]
    for found in peak.friction:
        size = np.abs(peak.states(np.linspace(0.0, 2.0 * math.pi, 2001))[:, :2]
                      @ sector.participation["platform"]).max()  # fmt: skip
        slides = max(size - FRICTION * force / SPRING, 0.0)
        known = 4.0 * FRICTION * force * slides
        print(f"N = {force:g} N: {found.loss:.6e} J at the peak, Jenkins {known:.6e} J")
        assert abs(found.loss - known) <= 1e-5 * known
ax.set(xlabel="frequency (Hz)", ylabel="largest displacement of the blade (mm)")
ax.legend()
