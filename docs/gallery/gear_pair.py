"""A gear pair with backlash.

One body between the flanks of the teeth, a mean load that keeps one of them closed, and an error of
the teeth that grows with the speed: the scene `gear_pair.toml`. At rest the load of 0.1 N closes
the flank of 1 N/m behind 1 m of backlash by 0.1 m; small motions about that have 1 rad/s.
"""

import matplotlib.pyplot as plt

from nldyn import continue_branch, solve_orbit
from nldyn.base.resources import example
from nldyn.plot import plot_diagram
from nldyn.scene import build_system, load_scene
from nldyn.system import closed_at_rest, rest

gears = build_system(load_scene(example("gear_pair.toml")))
branch = continue_branch(solve_orbit(gears, 0.2387), (0.0477, 0.2387))
fig, ax = plt.subplots()
plot_diagram(branch, ax)
ax.set(title="Gear pair under a mean load", ylim=(1.05, 1.4))

((_, depth, force),) = closed_at_rest(gears, rest(gears))
folds = sorted(p.frequency_hz for p in branch.special_points if p.kind == "LP")
print(f"at rest {depth} m deep, {force} N")
print(f"jumps at {folds[0]:.6f} and {folds[1]:.6f} Hz")
assert abs(depth - 0.1) < 1e-12
# from the closed forms of the linear pieces of the equation, by another program
assert abs(folds[0] - 0.112687) < 5e-7 and abs(folds[1] - 0.131854) < 5e-7
