"""Ways to reduce a cantilever.

How far the tip goes under a steady force, by the modes that are kept. Rubin's and
Craig and Bampton's models have the static flexibility $L^3/3EI$ from the first mode on; a model of
free modes only has not, and lets the tip move too little.
"""

import matplotlib.pyplot as plt

import cms
import fem

mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 30)])
steel = fem.Material(youngs_modulus=2.1e11, density=7800.0)
model = fem.StructureModel(
    mesh,
    {"arm": fem.BeamPart(steel, fem.RectangularSection(0.03, 0.01))},
    supports=[fem.Support("root", ("x", "y", "rotation"))],
    interfaces={"tip": fem.Interface("tip", "y")},
    plane=True,
)
beam = fem.assemble(model)
known = 1.0 / (3 * 2.1e11 * 0.03 * 0.01**3 / 12)

fig, ax = plt.subplots()
counts = range(1, 9)
for method, style in (("truncation", "o-"), ("rubin", "s-"), ("craig-bampton", "x-")):
    models = [cms.reduce(beam, modes=count, method=method) for count in counts]
    shares = [model.static_flexibility("tip") / known for model in models]
    ax.plot(counts, shares, style, label=method)
ax.set(xlabel="kept modes", ylabel="flexibility of the tip / exact")
ax.legend()

found = cms.reduce(beam, modes=1, method="rubin").static_flexibility("tip")
print(f"{found:.9e} m/N, by beam theory {known:.9e} m/N")
assert abs(found / known - 1) < 1e-9
