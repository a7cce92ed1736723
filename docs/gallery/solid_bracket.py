"""A bracket of solids under a load.

An upright and an arm of hexahedra with 20 nodes, clamped at the foot, pushed down at the end of
the arm. Castigliano's theorem for two slender beams gives how far it goes: the arm bends, and the
upright bends under the constant moment.
"""

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem

size, thick, deep = 0.3, 0.005, 0.01
half = thick / 2
steel = fem.Material(youngs_modulus=2.1e11, density=7800.0, poissons_ratio=0.3)
corner = (-half, size - half, 0.0)
mesh = fem.joined(
    [
        fem.box_mesh("bracket", (thick, size - half, deep), (2, 40, 1), origin=(-half, 0, 0)),
        fem.box_mesh("bracket", (thick, thick, deep), (2, 2, 1), origin=corner),
        fem.box_mesh("bracket", (size - half, thick, deep), (40, 2, 1), origin=(half, *corner[1:])),
    ]
)
places = {
    "foot": fem.nodes_inside(mesh.points, ((-1, 0, -1), (1, 0, 1)), "bracket"),
    "end": fem.node_at(mesh.points, (size, size, 0.0), "bracket"),
}
model = fem.StructureModel(
    fem.StructureMesh(mesh.points, mesh.cells, mesh.groups, places),
    {"bracket": fem.SolidPart(steel)},
    supports=[fem.Support("foot", ("x", "y", "z"))],
    interfaces={"end": fem.Interface("end", "y")},
)
bracket = fem.assemble(model)
reduced = cms.reduce(bracket, modes=2)
found = reduced.static_flexibility("end")  # m/N

q = reduced.participation["end"] / (2 * np.pi * reduced.frequencies_hz) ** 2
moved = mesh.points - 30 * bracket.shape(reduced.expand(q))[:, :3]  # 1 N down, 30-fold
fig, ax = plt.subplots()
ax.plot(*mesh.points[:, :2].T, ".", color="0.8", ms=2, label="undeformed")
ax.plot(*moved[:, :2].T, ".", color="tab:blue", ms=2, label="deflected, true scale")
ax.legend()
ax.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title="A push of 30 N at the end")

bending = steel.youngs_modulus * deep * thick**3 / 12
known = size**3 / (3 * bending) + size**2 * size / bending
print(f"{found:.4e} m/N, by Castigliano {known:.4e} m/N")
assert abs(found / known - 1) < 0.01
