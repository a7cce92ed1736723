"""A beam on a foundation that lifts off.

A force on a long beam that nothing holds down: it touches up to $\\lambda a = \\pi/2$, whatever the
force, and sinks by $F\\lambda/2k\\,\\coth(\\pi/2)$ (Weitsman 1970).
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem
from nldyn import ConstantForce, System, contact_area
from nldyn.system import rest

FORCE, FOUNDATION, BENDING = 100.0, 2e5, 2.1e11 * 0.02 * 0.01**3 / 12.0
wave = (FOUNDATION / (4.0 * BENDING)) ** 0.25

# half of the beam: its middle, under the force, neither turns nor moves along
ends = {"middle": (0.0, 0.0), "end": (1.6 * math.pi / wave, 0.0)}
half = fem.assemble(
    fem.StructureModel(
        fem.frame_mesh(ends, [("half", "middle", "end", 24)]),
        parts={
            "half": fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.RectangularSection(0.02, 0.01))
        },
        supports=[fem.Support("middle", ("x", "rotation"))],
        interfaces={"middle": fem.Interface("middle", "y")},
        plane=True,
    )
)
points = fem.contact_points(half, "half", "-y", points=2)
names = [f"bed {i + 1}" for i in range(len(points.places))]
bed = cms.Area(names, FOUNDATION * points.weights, tolerance=1e-6)
half = half.with_interfaces(dict(zip(names, points.vectors(), strict=True)), {"bed": bed})
reduced = cms.reduce(half, modes=12)
system = System.from_reduced(
    reduced,
    stops=contact_area("bed", names, FOUNDATION, weights=points.weights),
    excitation=[ConstantForce("middle", -0.5 * FORCE)],
)
q = rest(system)
sunk = -float(system.participation["middle"] @ q)
depth = np.array([system.stop_vector(stop) @ q for stop in system.stops])

x = 1e3 * points.places[:, 0]
fig, (above, below) = plt.subplots(2, sharex=True)
above.plot(x, -1e3 * depth, ".-")
above.axhline(0.0, color="0.6", linewidth=0.8)
above.set(ylabel="deflection (mm)", title="Beam on a foundation that lifts off")
below.plot(x, FOUNDATION * np.maximum(depth, 0.0), ".-", label="at the points")
below.axvline(500.0 * math.pi / wave, color="C3", linestyle="--", label="closed form: lifts off")
below.set(xlabel="distance from the force (mm)", ylabel="pressure (N/m)")
below.legend()

known = FORCE * wave / (2.0 * FOUNDATION) / math.tanh(0.5 * math.pi)
print(f"it sinks by {1e3 * sunk:.5f} mm, in closed form {1e3 * known:.5f} mm")
assert abs(sunk / known - 1.0) < 2e-5
