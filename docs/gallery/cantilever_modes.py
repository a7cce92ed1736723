"""Modes of a cantilever.

A beam of 40 elements, clamped at its root. Its first frequency is that of Euler and Bernoulli,
$f_1 = (1.875104/L)^2 \\sqrt{EI/\\rho A}/2\\pi$.
"""

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem

length, width, height = 0.5, 0.03, 0.005
steel = fem.Material(youngs_modulus=2.1e11, density=7800.0)
mesh = fem.frame_mesh({"root": (0, 0), "tip": (length, 0)}, [("arm", "root", "tip", 40)])
model = fem.StructureModel(
    mesh,
    {"arm": fem.BeamPart(steel, fem.RectangularSection(width, height))},
    supports=[fem.Support("root", ("x", "y", "rotation"))],
    interfaces={"tip": fem.Interface("tip", "y")},
    plane=True,
)
beam = fem.assemble(model)
reduced = cms.reduce(beam, modes=4, method="truncation")

fig, ax = plt.subplots()
x = mesh.points[:, 0]
order = np.argsort(x)
for hz, mode in zip(reduced.frequencies_hz, reduced.basis.T, strict=True):
    ax.plot(x[order], beam.shape(mode)[order, 1], label=f"{hz:.1f} Hz")
ax.set(xlabel="x (m)", ylabel="mode (1/√kg)", title="Cantilever")
ax.legend()

found = reduced.frequencies_hz[0]
bending = steel.youngs_modulus * height**2 / 12 / steel.density  # E I / (rho A)
known = (1.87510407 / length) ** 2 * np.sqrt(bending) / (2 * np.pi)
print(f"{found:.5f} Hz, by beam theory {known:.5f} Hz")
assert abs(found / known - 1) < 1e-5
