"""Scenes of machines with clearances: gears, boxes, chains between walls, masses on stops.

Each is sound, of one to six modes, and takes seconds; what is random is the same for a seed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scene_mutations import document

SMALL = {"search_points": 1, "max_step": 0.2, "rtol": 1e-7}
BRIEF = 1.005  # of the lowest frequency: a range of a few points
Rows = list[list[float]]


def machine(seed: int, *, explored: bool = False, brief: bool = False) -> str:
    """The scene of a machine with natural frequencies about 1 rad/s, as a TOML document."""
    rng = np.random.default_rng(seed)
    kinds = (gears, body_in_box, chain_between_walls, masses_on_stops)
    tree: dict[str, Any] = kinds[rng.integers(len(kinds))](rng)
    places = list(tree["matrices"]["interfaces"])
    tree["excitation"] = drives(rng, places)
    low = float(rng.uniform(0.3, 2.0)) / (2.0 * np.pi)
    high = low * float(rng.choice((1.05, 1.3)))
    tree["continuation"] = {
        **SMALL,
        "range_hz": [low, BRIEF * low if brief else high],
        "periods": [[1], [1], [1, 2]][rng.integers(3)],
    }
    if explored:
        del tree["continuation"]["periods"], tree["continuation"]["search_points"]
        tree["explore"] = {"max_period": 2, "spacing": 0.3, "starts": 2, "settling": 200}
    return document(tree)


def drives(rng: np.random.Generator, places: list[str]) -> list[dict[str, Any]]:
    """A harmonic force, perhaps with another harmonic, perhaps with a constant one."""
    size = float(10.0 ** rng.uniform(-1.0, 1.0))
    found: list[dict[str, Any]] = [
        {"at": str(rng.choice(places)), "kind": "harmonic", "amplitude": size}
    ]
    if rng.random() < 0.4:
        found.append({**found[0], "amplitude": 0.5 * size, "harmonic": 2, "phase_deg": 50.0})
    if rng.random() < 0.4:
        at = str(rng.choice(places))
        found.append({"at": at, "kind": "constant", "force": float(rng.normal()) * size})
    return found


def stop(rng: np.random.Generator, at: str, gap: float, direction: int = 1) -> dict[str, Any]:
    """A stop at a gap: rigid, linear, of Hertz, with a dashpot or with dissipation."""
    found: dict[str, Any] = {"at": at, "gap": gap}
    if direction < 0:
        found["direction"] = -1
    kind = int(rng.integers(6))
    if kind < 2:
        return {**found, "law": "rigid", "restitution": float(rng.choice((0.3, 0.7, 0.9, 1.0)))}
    found["stiffness"] = float(10.0 ** rng.uniform(0.5, 4.0))
    if kind == 2:
        return {**found, "law": "linear"}
    if kind == 3:
        return {**found, "law": "linear", "dashpot": 0.5, "pulls": bool(rng.integers(2))}
    return found if kind == 4 else {**found, "dissipation": 0.3}


def both_sides(rng: np.random.Generator, at: str) -> list[dict[str, Any]]:
    """Two stops of one law, at gaps that are alike or not, or one that is preloaded."""
    gap = float(rng.choice((0.5, 1.0, 1e-3)))
    first = stop(rng, at, gap)
    other = {**first, "direction": -1, "gap": gap * float(rng.choice((1.0, 1.0, 2.0)))}
    if first.get("law") != "rigid" and rng.random() < 0.2:
        first["gap"] = other["gap"] = -0.1
    return [first, other]


def loss(rng: np.random.Generator) -> float:
    """A coefficient of damping, perhaps none."""
    return float(rng.choice((0.0, 0.05, 0.2, 0.75)))


def gears(rng: np.random.Generator) -> dict[str, Any]:
    """A body, or several on weak springs, free between the flanks of a tooth gap."""
    count = int(rng.choice((1, 1, 2, 3)))
    stiffness = np.diag(np.append(0.0, rng.uniform(0.5, 9.0, count - 1)))
    if rng.random() < 0.3:
        stiffness[0, 0] = 0.01
    names = [f"x{i}" for i in range(count)]
    return {
        "matrices": matrices(np.eye(count), stiffness, names, max(loss(rng), 0.05) * np.eye(count)),
        "stops": both_sides(rng, "x0"),
    }


def body_in_box(rng: np.random.Generator) -> dict[str, Any]:
    """An impact damper: a free body between the walls of a box on a spring."""
    mass = float(rng.choice((0.05, 0.2, 1.0)))
    damping = np.diag([loss(rng), float(rng.choice((0.0, 0.02)))])
    stops = [{**each, "against": "box"} for each in both_sides(rng, "body")]
    return {
        "matrices": matrices(np.diag([1.0, mass]), np.diag([1.0, 0.0]), ["box", "body"], damping),
        "stops": stops,
    }


def chain_between_walls(rng: np.random.Generator) -> dict[str, Any]:
    """Masses one after the other on springs, the ends of which can hit walls, or one another."""
    count = int(rng.integers(2, 7))
    stiffness = 2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    if rng.random() < 0.3:  # free as a whole
        stiffness[0, 0] = stiffness[-1, -1] = 1.0
    names = [f"x{i}" for i in range(count)]
    stops = [stop(rng, names[0], 0.5, -1), stop(rng, names[-1], 0.5)]
    if rng.random() < 0.3:
        stops[1] = {**stop(rng, names[0], 0.3), "against": names[1]}
    damping = loss(rng) * np.eye(count)
    return {"matrices": matrices(np.eye(count), stiffness, names, damping), "stops": stops}


def masses_on_stops(rng: np.random.Generator) -> dict[str, Any]:
    """Masses on springs of their own, coupled a little, with stops on one side or on both."""
    count = int(rng.integers(1, 4))
    springs = np.diag(rng.uniform(0.5, 9.0, count))
    coupled = 0.1 * (np.eye(count) * count - np.ones((count, count)))
    names = [f"x{i}" for i in range(count)]
    stops = both_sides(rng, "x0")
    if rng.random() < 0.5:
        stops = [stop(rng, "x0", float(rng.choice((0.0, 0.3, 1.0))))]
    damping = loss(rng) * np.eye(count)
    return {"matrices": matrices(np.eye(count), springs + coupled, names, damping), "stops": stops}


def matrices(mass: Any, stiffness: Any, names: list[str], damping: Any) -> dict[str, Any]:
    """The table of a structure with an interface at each degree of freedom."""
    rows = np.eye(len(names)).tolist()
    return {
        "mass": mass.tolist(),
        "stiffness": stiffness.tolist(),
        "damping": damping.tolist(),
        "interfaces": dict(zip(names, rows, strict=True)),
    }
