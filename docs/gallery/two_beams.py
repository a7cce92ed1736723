"""Two beams with frictional impacts.

The free ends of two cantilevers with close natural frequencies hit each other and rub. These ends
have no mass: rigid contact and Coulomb's friction act on what the modes leave of the flexibility
(Monjaraz-Tec, Gross and Krack 2022, whose beams answered strongly modulated, too). In a periodic
motion the force puts in what damping and friction take out.
"""

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem
from nldyn import HarmonicForce, RigidStop, System, simulate, solve_orbit

places = {"root a": (0, 0), "tip a": (0.3, 0)}
places |= {"root b": (0.588, 0.011), "half b": (0.443, 0.011), "tip b": (0.298, 0.011)}
lines = [("a", "root a", "tip a", 16), ("b", "root b", "half b", 8), ("b", "half b", "tip b", 8)]
steel, bar = fem.Material(2.1e11, 7800.0, 0.3), fem.RectangularSection(0.014, 0.01)
held = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
ends = ["tip a y", "tip b y", "tip a z", "tip b z"]
beams = fem.assemble(
    fem.StructureModel(
        fem.frame_mesh(places, lines),
        parts={name: fem.BeamPart(steel, bar, orientation=(0, 1, 0)) for name in "ab"},
        supports=[fem.Support(f"root {name}", held) for name in "ab"],
        interfaces={at: fem.Interface(at[:-2], at[-1]) for at in (*ends, "half b y", "half b z")},
    )
)
reduced = cms.reduce(beams, modes=8, method="macneal", massless=ends)
rub = {"against": "tip b y", "tangent": "tip a z", "tangent_against": "tip b z", "friction": 0.3}
far, near = (
    System.from_reduced(
        reduced,
        modal_damping=0.01,
        stops=[RigidStop("tip a y", 1.0, gap, **rub)],
        excitation=[HarmonicForce("half b y", 2.0), HarmonicForce("half b z", 20.0)],
    )
    for gap in (6e-4, 1e-4)
)
seen = simulate(far, 100.0, 150, transient=50).history(9600)
orbit = solve_orbit(near, 100.0)
one = orbit.history(8000)

fig, (above, below) = plt.subplots(2, layout="constrained")
for name in ("tip b y", "tip a y"):
    above.plot(seen.time, 1e3 * seen.displacement[name], label=name[:5], linewidth=0.6)
above.set(xlabel="time (s)", ylabel="displacement (mm)", title="Gap 0.6 mm: modulated")
above.legend(loc="upper right")
hit = np.abs(one.time - one.time[np.argmax(one.force[:, 0])]) < 4e-4
below.plot(1e3 * one.time[hit], one.force[hit, 0])
below.set(xlabel="time (ms)", ylabel="contact force (N)", title="Gap 0.1 mm: periodic")

rows = [2.0 * near.participation["half b y"], 20.0 * near.participation["half b z"]]
power = np.cos(200.0 * np.pi * one.time) * (one.modal_velocity @ sum(rows))
damped = one.modal_velocity**2 @ (0.02 * near.natural_frequencies)
put_in, taken = (p[:-1].mean() / 100.0 for p in (power, damped))
rubbed = orbit.friction[0].loss
print(f"put in {put_in:.6e} J, damping {taken:.6e} J and friction {rubbed:.6e} J take it out")
assert abs(put_in - taken - rubbed) < 1e-6 * rubbed
