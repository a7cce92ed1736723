"""Basins of a double well.

Duffing's equation with two wells, shaken: motions stay in one of them, and which one depends on the
start. Some starts are integrated once more by Runge and Kutta.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

from nldyn import HarmonicForce, PolynomialSpring, StatePlane, System, basins
from nldyn.longterm import AttractorOptions
from nldyn.plot import plot_basins

hz, force, damping = 0.15, 0.08, 0.2
wells = System.from_matrices(
    [[1.0]],
    [[0.0]],
    {"x": [1.0]},
    damping=[[damping]],
    springs=[PolynomialSpring("x", [-1.0, 0.0, 1.0])],
    excitation=[HarmonicForce("x", force)],
)
plane = StatePlane.at_interface(
    wells, displacement=(-2.0, 2.0), velocity=(-2.0, 2.0), origin=[0, 0]
)
short = AttractorOptions(periods=64)
found = basins(wells, hz, plane, shape=(25, 25), starts=6, checks=4, options=short)
fig, ax = plt.subplots()
plot_basins(found, ax)


def slope(t, state):
    x, v = state.reshape(2, -1)
    pull = force * np.cos(2 * np.pi * hz * t)
    return np.concatenate([v, pull - damping * v + x - x**3])


rows, columns = np.meshgrid([2, 7, 12, 17, 22], [1, 6, 11, 16, 23])
cells = rows.ravel(), columns.ravel()
starts = plane.states((25, 25))[cells]
ends = solve_ivp(slope, (0, 20 / hz), starts.T.ravel(), rtol=1e-8, atol=1e-8).y[:25, -1]
known = np.sign(ends)
wells_of = np.array([np.sign(basin.attractor.states[0, 0]) for basin in found.basins])
agree = int((wells_of[found.labels[cells]] == known).sum())
print([(basin.attractor.name, round(basin.share, 3)) for basin in found.basins])
print(f"{agree} of 25 cells as by Runge and Kutta")
assert agree == 25 and len(set(known)) == 2
