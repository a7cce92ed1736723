"""A beam over the gap of its stop: a diagram at one frequency.

The scene `two_dof_xi_0.01.toml` at 23 Hz and at 36 Hz while the gap goes from 0 to 50 µm. A fold
over the gap is one over the frequency, too, of the beam with the gap that the fold lies at.
"""

import matplotlib.pyplot as plt

from nldyn import continue_branch, diagram, solve_orbit
from nldyn.base.resources import example
from nldyn.orbits import OrbitSearchOptions
from nldyn.plot import plot_diagram
from nldyn.scene import build_system, load_scene
from nldyn.system.chart import with_value

beam = build_system(load_scene(example("two_dof_xi_0.01.toml")))
few = OrbitSearchOptions(starts=2)
fig, axes = plt.subplots(2, 1, figsize=(7, 7), layout="constrained")
found = {}
for ax, (hz, periods) in zip(axes, {23.0: [1, 2], 36.0: [1]}.items(), strict=True):
    found[hz] = diagram(
        beam, (0.0, 50e-6), periods, parameter="gap", frequency_hz=hz, search_points=1, search=few
    )
    plot_diagram(found[hz], ax, hover=False)
    ax.set_title(f"{hz:g} Hz")

folds = [s for s in found[23.0].of_period(1)[0].special_points if s.kind == "LP"]
fold = max(folds, key=lambda each: each.value)
there = with_value(beam, fold.point.parameter, fold.value)
branch = continue_branch(solve_orbit(there, 20.0), (18.0, 26.0))
known = min(
    (s.frequency_hz for s in branch.special_points if s.kind == "LP"), key=lambda hz: abs(hz - 23)
)
print(f"a fold at 23 Hz and {1e6 * fold.value:.6f} µm; of that gap's branch at {known:.9f} Hz")
assert abs(known / 23.0 - 1.0) < 1e-8
