"""Effective masses of a cantilever.

What each mode takes part in when the root is shaken, $(\\varphi^T M r)^2$. The first four have
61.3, 18.8, 6.5 and 3.3 % of the mass [R. W. Clough and J. Penzien, *Dynamics of Structures*].
"""

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem

mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 40)])
steel = fem.Material(youngs_modulus=2.1e11, density=7800.0)
model = fem.StructureModel(
    mesh,
    {"arm": fem.BeamPart(steel, fem.RectangularSection(0.03, 0.005))},
    supports=[fem.Support("root", ("x", "y", "rotation"))],
    plane=True,
)
beam = fem.assemble(model)
reduced = cms.reduce(beam, modes=8, method="truncation")
mass = fem.mass_properties(beam).mass
shares = (reduced.basis.T @ beam.inertia)[:, 1] ** 2 / mass  # along y

fig, ax = plt.subplots()
ax.bar(np.arange(1, 9), 100 * shares)
ax.plot(np.arange(1, 9), 100 * np.cumsum(shares), "k.-", label="together")
ax.set(xlabel="mode", ylabel="effective mass (%)", title="Cantilever shaken at its root")
ax.legend()

print([round(float(share), 3) for share in shares[:4]])
roots = np.array([1.87510407, 4.69409113, 7.85475744, 10.99554073])
slopes = np.sinh(roots) - np.sin(roots)
known = (2 * slopes / (np.cosh(roots) + np.cos(roots)) / roots) ** 2
assert np.abs(shares[:4] - known).max() < 1e-4
assert abs(known[0] - 0.613) < 5e-4
