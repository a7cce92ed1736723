"""Two leaves that rub on each other.

A clip presses the ends of two leaves together. As they bend, the upper side of the lower one gets
shorter and the lower side of the upper one longer: pads between them stick, give way and slide.
Both are shaken alike, so that nothing presses them in turn, and each pad loses
$4\\mu N(X - \\mu N/k_t)$ in a cycle in which its surfaces move by X to both sides.
"""

import matplotlib.pyplot as plt
import numpy as np

import cms
import fem
from nldyn import ConstantForce, HarmonicForce, System, contact_area, solve_orbit

FRICTION, ACROSS, ALONG = 0.3, 2e7, 1e7  # the latter in N/m per m of the pads
bar = fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.RectangularSection(0.02, 0.02))
leaves = []
for y in (0.0, 0.02):
    places = {"root": (0.0, y), "pad": (0.2, y), "tip": (0.3, y)}
    model = fem.StructureModel(
        fem.frame_mesh(places, [("leaf", "root", "pad", 4), ("pads", "pad", "tip", 2)]),
        parts={"leaf": bar, "pads": bar},
        supports=[fem.Support("root", ("x", "y", "rotation"))],
        interfaces={"tip": fem.Interface("tip", "y")},
        plane=True,
    )
    leaves.append(fem.assemble(model))
near = fem.contact_points(leaves[0], "pads", "y", points=1, surface=0.01)
pair = fem.opposite_points(leaves[1], near, "pads", surface=0.01)
names, models = [["up 0", "up 1"], ["along 0", "along 1"]], {}
bed = cms.Area([*names[0], *names[1]], np.outer([ACROSS, ALONG], near.weights).ravel())
for leaf, body, side in zip(("low", "high"), leaves, (pair.near, pair.far), strict=True):
    rows = np.vstack([side.vectors("y"), side.vectors("x")])
    touching = body.with_interfaces(dict(zip(bed.points, rows, strict=True)), {"pads": bed})
    models[leaf] = cms.reduce(touching, modes=2)
low, high = ([[f"{leaf}.{name}" for name in row] for row in names] for leaf in models)
pads = contact_area(
    "pads", low[0], ACROSS, weights=near.weights, against=high[0], friction=FRICTION,
    tangents=low[1], tangents_against=high[1], tangential_stiffness=ALONG,
)  # fmt: skip
forces = [ConstantForce("low.tip", 60.0), ConstantForce("high.tip", -60.0)]
forces += [HarmonicForce(f"{leaf}.tip", 400.0) for leaf in models]
whole = cms.couple(models, [])
system = System.from_reduced(whole, modal_damping=0.05, stops=pads, excitation=forces)
orbit = solve_orbit(system, 150.0)

phases, motion = np.linspace(0.0, 2.0 * np.pi, 20001), orbit.trajectory
modal, places = np.split(motion.flow.to_start(motion.states(phases)), [2 * system.size], axis=1)
fig, ax = plt.subplots()
pressed = orbit.areas[0].pressure * near.weights
for pad, place, N, found in zip(pads, places.T, pressed, orbit.friction, strict=True):
    moved = modal[:, : system.size] @ system.vector_between(pad.tangent, pad.tangent_against)
    pull, most = pad.tangential_stiffness * (moved - place), FRICTION * N
    ax.plot(1e3 * moved, pull, label=f"pad under {N:.0f} N")
    known = 4.0 * most * (np.abs(moved).max() - most / pad.tangential_stiffness)
    print(f"{1e3 * found.loss:.6f} mJ a cycle, Jenkins {1e3 * known:.6f} mJ")
    assert abs(found.loss - known) < 1e-6 * known
ax.set(xlabel="one surface beside the other (mm)", ylabel="friction (N)", title="Two pads, 150 Hz")
ax.legend()
