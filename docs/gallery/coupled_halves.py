"""Two halves of a beam, reduced and coupled.

Each half is clamped at its outer end and reduced to six modes by Craig and Bampton's method;
joined in the middle they are a beam between two clamps, with $\\beta_1 L = 4.730041$.
"""

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem

steel = fem.Material(youngs_modulus=2.1e11, density=7800.0)
mesh = fem.frame_mesh({"root": (0, 0), "end": (0.5, 0)}, [("arm", "root", "end", 20)])
model = fem.StructureModel(
    mesh,
    {"arm": fem.BeamPart(steel, fem.RectangularSection(0.03, 0.01))},
    supports=[fem.Support("root", ("x", "y", "rotation"))],
    interfaces={"y": fem.Interface("end", "y"), "turn": fem.Interface("end", "rotation")},
    plane=True,
)
half = fem.assemble(model)


def whole(modes):
    """Frequencies of the coupled beam; the right half is the left one, turned in the plane."""
    reduced = cms.reduce(half, modes=modes, method="craig-bampton")
    minus = cms.Matrices(
        half.stiffness, half.mass, {"y": -half.interfaces["y"], "turn": half.interfaces["turn"]}
    )
    turned = cms.reduce(minus, modes=modes, method="craig-bampton")
    joints = [cms.Joint(("left", name), ("right", name)) for name in ("y", "turn")]
    return cms.couple({"left": reduced, "right": turned}, joints).frequencies_hz


roots = np.array([4.73004074, 7.85320462, 10.99560784])
known = roots**2 / (2 * np.pi) * np.sqrt(2.1e11 * 0.01**2 / 12 / 7800.0)
fig, ax = plt.subplots()
counts = range(2, 9)
errors = np.array([whole(count)[:3] / known - 1 for count in counts])
for number, error in enumerate(errors.T, start=1):
    ax.semilogy(counts, error, "o-", label=f"mode {number}")
ax.set(xlabel="kept modes of each half", ylabel="relative error of the frequency")
ax.legend()

print(f"{whole(6)[0]:.4f} Hz, by beam theory {known[0]:.4f} Hz")
assert abs(whole(6)[0] / known[0] - 1) < 1e-5
