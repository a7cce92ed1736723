"""Scenes with faults: small good ones, and strategies that spoil them.

`docs/reference/scene.md` says what a scene may hold; the changes here know nothing of it but the
examples.
"""

from __future__ import annotations

import copy
import datetime
import math
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

from nldyn.base.resources import example, examples

Path = tuple[str | int, ...]

MODAL = """
title = "two modes"
[modal]
frequencies_hz = [13.1, 125.1]
participation.middle = [0.6, 0.5]
participation.end = [0.3, -0.5]
[damping]
modal_ratio = [0.01, 0.02]
[[dampers]]
at = "middle"
coefficient = 3.0
[[stops]]
at = "middle"
stiffness = 5e9
exponent = 2
gap = 1e-4
restitution = 0.8
impact_speed = 0.1
[[stops]]
at = "middle"
against = "end"
radius = 0.01
youngs_modulus = 2.1e11
poissons_ratio = 0.3
direction = -1
dissipation = 0.2
[[excitation]]
at = "middle"
kind = "unbalance"
mass_times_radius = 4.92e-6
phase_deg = 30
[[excitation]]
at = "end"
kind = "harmonic"
amplitude = 0.3
[observe]
at = "end"
[continuation]
range_hz = [5.0, 90.0]
periods = [1, 2]
follow_doublings = 1
search_points = 4
max_step = 0.1
rtol = 1e-8
[[subharmonics]]
period = 3
near_hz = 40
"""

MATRICES = """
[matrices]
mass = [[2.0, 0.1], [0.1, 1.0]]
stiffness = [[3e4, -1e4], [-1e4, 1e4]]
damping = [[3, -1], [-1, 1]]
interfaces.a = [1, 0]
interfaces.b = [0.0, 1.0]
[[stops]]
at = "b"
law = "linear"
stiffness = 1e6
[[excitation]]
at = "a"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [5, 40]
[explore]
max_period = 3
spacing = 0.01
starts = 2
rounds = 2
settling = 1000
unstable_period = 2
doubled_period = 4
doubled_points = 30
pseudo_orbits = 3
mixtures = 3
walks = 2
walk_states = 20
seed = 1
"""

FRAME = """
[mesh]
file = "frame.vtu"
[parts.arm]
youngs_modulus = 2.1e11
density = 7800
poissons_ratio = 0.3
theory = "timoshenko"
width = 0.03
height = 0.01
axial_force = 100.0
[parts.leg]
youngs_modulus = 2.1e11
density = 7800
diameter = 0.02
bore = 0.01
[parts.brace]
youngs_modulus = 2.1e11
density = 7800
area = 1e-4
second_moment = 1e-9
[[supports]]
at = "foot"
fixed = ["x", "y", "rotation"]
[[supports]]
at = "wall"
fixed = ["x", "y"]
[[point_masses]]
at = "tip"
mass = 0.2
rotary_inertia = 1e-5
[[springs]]
at = "tip"
direction = "y"
stiffness = 1e3
[[hinges]]
at = "corner"
part = "brace"
[interfaces.tip]
at = "tip"
direction = "y"
[interfaces.corner]
at = "corner"
direction = "x"
[reduction]
modes = 2
method = "craig-bampton"
[damping]
modal_ratio = 0.01
[[stops]]
at = "tip"
stiffness = 1e9
gap = 1e-3
[[excitation]]
at = "corner"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [5, 90]
"""

STRUCTURE = """
[mesh]
file = "block.vtu"
model = "structure"
[parts.block]
kind = "solid"
youngs_modulus = 2.1e11
density = 7800
poissons_ratio = 0.3
[parts.rod]
youngs_modulus = 2.1e11
density = 7800
poissons_ratio = 0.3
width = 0.02
height = 0.01
orientation = [0, 0, 1]
offset = [0.0, 0.001]
[[supports]]
at = "x0"
fixed = ["x", "y", "z"]
[[couplings]]
at = "root"
face = "x1"
[[couplings]]
at = "new"
face = "middle"
kind = "averaging"
place = [0.1, 0.1, 0.0]
[[foundations]]
at = "z0"
stiffness = [0, 0, 1e9]
[[point_masses]]
at = "tip"
mass = 1.0
rotary_inertia = [1e-4, 1e-4, 2e-4]
offset = [0, 0.01, 0]
[[springs]]
at = "tip"
direction = "rotation_x"
stiffness = 10.0
[interfaces.tip]
at = "tip"
direction = "z"
[interfaces.new]
at = "new"
direction = "y"
[reduction]
cutoff_hz = 5000
[[stops]]
at = "tip"
stiffness = 1e9
[[excitation]]
at = "new"
kind = "unbalance"
mass_times_radius = 1e-5
[continuation]
range_hz = [50, 2000]
"""

# these take a second and more; the small frame and structure above stand for them
OWN_MESHES = ("solid_beam.toml", "coarse_beam.toml", "plate.toml", "portal.toml", "hook.toml")

TEXTS = {"modal": MODAL, "matrices": MATRICES, "frame": FRAME, "structure": STRUCTURE}
TEXTS |= {
    name: example(name).read_text().replace("../../meshes/", "")
    for name in examples()
    if name not in OWN_MESHES
}


def places(tree: Any, at: Path = ()) -> Iterator[Path]:
    """All places in a tree of tables and lists but its root."""
    steps: Any = ()
    if isinstance(tree, dict):
        steps = tree.items()
    elif isinstance(tree, list):
        steps = enumerate(tree)
    for step, value in steps:
        yield (*at, step)
        yield from places(value, (*at, step))


def value_at(tree: Any, place: Path) -> Any:
    """What stands at a place."""
    for step in place:
        tree = tree[step]
    return tree


WORDS = ("middle", "tip", "at", "x", "rotation", "y", "beam", "leaf", "foot", "stops", "hertz",
         "linear", "stiffness", "modes", "rubin", "structure", "harmonic", "mass", "")  # fmt: skip
TRICKS = (
    "../frame.vtu", "/etc/passwd", "/dev/zero", "/dev/random", "folder", "link.vtu", "loop.vtu",
    "pipe.vtu", "~/frame.vtu", "$HOME", "frame.vtu\x00", "a" * 300 + ".msh", "file:///etc/passwd",
    "http://localhost/a.msh", "frame.VTU", "./frame.vtu", "folder/../frame.vtu", "*.vtu",
    "__import__('os').system('false')", "{0.__class__}", "%s%n", "$\\frac{", "<script>", "=1+1",
    "\ud7ff", "\u202e", "\ufeff", "\u0000", "e\u0301", "\U0001f600", "\r\n", "\x1b[31m", "ﬁ", " ",
)  # fmt: skip
NUMBERS = (
    0, 1, -1, 2, 3, 7, 100, 101, 2**31, 2**63, 2**64, -(2**63), 10**40, 10**400, 0.0, -0.0, 0.5,
    1.0, 1.5, 5e-324, 1e-320, 1e-300, 1e-60, 1e-50, 1e-30, 1e-12, 1e-6, 1e6, 1e12, 1e15, 1e30,
    1e50, 1e60, 1e300, 1.7e308, math.inf, -math.inf, math.nan, -1e-9, -1e9,
)  # fmt: skip
LEAVES = st.one_of(
    st.sampled_from(NUMBERS),
    st.floats(),
    st.integers(),
    st.sampled_from(WORDS + TRICKS),
    st.text(max_size=20),
    st.booleans(),
    st.sampled_from((datetime.date(2020, 1, 1), datetime.datetime(2020, 1, 1), datetime.time(1))),
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(WORDS) | st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=8,
)
SIZES = st.sampled_from((0, 1, 2, 3, 50, 400))


def spoil(draw: Any, tree: dict[str, Any]) -> None:
    """Change one thing in a tree."""
    found = list(places(tree))
    if not found:
        tree[draw(st.text(max_size=4))] = draw(VALUES)
        return
    place = draw(st.sampled_from(found))
    parent, step = value_at(tree, place[:-1]), place[-1]
    old = parent[step]
    change = draw(st.integers(0, 9))
    if change <= 3:
        parent[step] = draw(VALUES)
    elif change == 4:
        del parent[step]
    elif change == 5:
        other = value_at(tree, draw(st.sampled_from(found)))
        parent[step] = copy.deepcopy(other)
    elif change == 6:
        number = isinstance(old, int | float) and not isinstance(old, bool)
        factor = draw(st.sampled_from((-1, 0.5, 1.0, 1e3, 1e-3, 1e9, 1e-9, 1e25, 1e-25)))
        parent[step] = old * factor if number and abs(old) < 1e300 else [old]
    elif change == 7:
        parent[step] = [copy.deepcopy(old)] * draw(SIZES)
    elif change == 8 and isinstance(step, str):
        name = draw(st.text(max_size=8) | st.sampled_from((*WORDS, step[:-1], step + "s")))
        parent[name] = parent.pop(step)
    else:
        target = old if isinstance(old, dict) else tree
        target[draw(st.text(max_size=8) | st.sampled_from(WORDS))] = draw(VALUES)


def toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + "".join(_letter(letter) for letter in value) + '"'
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(str(key))} = {toml(v)}" for key, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return hex(value) if isinstance(value, int) and value > 1 << 60 else repr(value)


def _letter(letter: str) -> str:
    if letter in '"\\' or ord(letter) < 32 or ord(letter) == 127:
        return f"\\u{ord(letter):04x}"
    return letter


def document(tree: dict[str, Any]) -> str:
    """A tree as the text of a TOML file."""
    return "".join(f"{toml(str(key))} = {toml(value)}\n" for key, value in tree.items())


FACTORS = (-1.0, 0.0, 0.1, 0.5, 1.0000001, 2.0, 10.0, 1e3, 1e-3, 1e6, 1e-6, 1e9, 1e-9, 1e15, 1e-15,
           1e25, 1e-25, 1e40, 1e-40)  # fmt: skip


def tweak(draw: Any, tree: dict[str, Any]) -> None:
    """Change one leaf to another of its kind, or add or take away an entry."""
    leaves = [p for p in places(tree) if not isinstance(value_at(tree, p), dict | list)]
    place = draw(st.sampled_from(leaves))
    parent, step = value_at(tree, place[:-1]), place[-1]
    old = parent[step]
    change = draw(st.integers(0, 9))
    if change == 0:
        del parent[step]
    elif change == 1 and isinstance(parent, list):
        parent.append(old)
    elif change == 2 and len(place) >= 3 and isinstance(place[0], str):
        table = tree[place[0]]
        if isinstance(table, list):
            table.append(copy.deepcopy(table[0]))
    elif isinstance(old, bool):
        parent[step] = not old
    elif isinstance(old, int):
        parent[step] = draw(st.integers(0, 12) | st.sampled_from((old * 10, 10**6, -old)))
    elif isinstance(old, float):
        parent[step] = old * draw(st.sampled_from(FACTORS))
    elif isinstance(old, str):
        names = {value_at(tree, p) for p in leaves if isinstance(value_at(tree, p), str)}
        known = ("truncation", "guyan", "craig-bampton", "linear", "z", "rotation", "averaging")
        parent[step] = draw(st.sampled_from(sorted(names)) | st.sampled_from(known))
