"""A moored ship between two fenders.

Wind and current press it on one fender, waves of two harmonics move it: the scene
`ship_between_fenders.toml`. At rest the mooring and the fender share the load,
$5x + 400(x - 0.02) = 1.5$.
"""

import matplotlib.pyplot as plt

from nldyn import solve_orbit
from nldyn.base.resources import example
from nldyn.plot import plot_history
from nldyn.scene import build_system, load_scene
from nldyn.system import rest

ship = build_system(load_scene(example("ship_between_fenders.toml")))
orbit = solve_orbit(ship, 0.5)
fig, ax = plt.subplots()
plot_history(orbit, ax)
ax.set_title("Surge of a moored ship")

found = float(ship.participation["hull"] @ rest(ship))
known = (1.5 + 400 * 0.02) / (5 + 400)
print(f"at rest at {found:.9f} m, by statics {known:.9f} m")
assert abs(found / known - 1) < 1e-12
