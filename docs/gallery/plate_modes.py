"""A square plate on simple supports.

Shells of four nodes, 24 by 24. Kirchhoff's plate has $f_{11} = \\pi \\sqrt{D/\\rho h}/a^2$
[R. D. Blevins, *Formulas for Natural Frequency and Mode Shape*].
"""

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem

side, thickness = 0.5, 0.002
aluminium = fem.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.3)
mesh = fem.box_mesh("plate", (side, side), (24, 24), kind="quad")
model = fem.StructureModel(
    mesh,
    {"plate": fem.ShellPart(aluminium, thickness)},
    supports=[fem.Support(edge, ("x", "y", "z")) for edge in ("x0", "x1", "y0", "y1")],
)
plate = fem.assemble(model)
reduced = cms.reduce(plate, modes=4, method="truncation")

fig, axes = plt.subplots(2, 2, layout="constrained")
x, y, _ = mesh.points.T
for ax, hz, mode in zip(axes.flat, reduced.frequencies_hz, reduced.basis.T, strict=True):
    ax.tricontourf(x, y, plate.shape(mode)[:, 2], 21, cmap="RdBu")
    ax.set(title=f"{hz:.1f} Hz", aspect="equal", xticks=[], yticks=[])

found = reduced.frequencies_hz[0]
stiffness = aluminium.youngs_modulus * thickness**3 / 12 / (1 - 0.3**2)
known = np.pi * np.sqrt(stiffness / (aluminium.density * thickness)) / side**2
print(f"{found:.4f} Hz, by plate theory {known:.4f} Hz")
assert abs(found / known - 1) < 3e-3
