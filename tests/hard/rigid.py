"""Rigid stops: chatter that ends, release, grazing and two stops at once."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from scipy.optimize import brentq

from hard.case import Case, Measured
from nldyn.flow.flow_map import FlowMap
from nldyn.longterm.impacts import impacts
from nldyn.longterm.simulation import simulate
from nldyn.system.loads import ConstantForce, HarmonicForce
from nldyn.system.rigid_stop import RigidStop
from nldyn.system.system import System

SUBJECT = "rigid stops"
G, HZ = 9.81, 10.0


def ball(restitution: float, table: float) -> System:
    """A ball of 1 kg on a table that shakes with an acceleration of `table` g, seen from it."""
    return System.from_matrices(
        [[1.0]],
        [[0.0]],
        {"ball": [1.0]},
        stops=[RigidStop("ball", restitution, direction=-1)],
        excitation=[HarmonicForce("ball", table * G), ConstantForce("ball", -G)],
    )


def chatter_error(restitution: float) -> Measured:
    """Largest error of the first twenty instants, and what is left when the series has ended."""
    height = 0.3
    fall = math.sqrt(2.0 * height / G)
    whole = fall * (1.0 + restitution) / (1.0 - restitution)
    motion = simulate(
        ball(restitution, 0.0), 1.0 / (1.0001 * whole), 1, start=np.array([height, 0.0])
    )
    hits = impacts(motion)
    times = fall * (1.0 + 2.0 * np.cumsum(np.append(0.0, restitution ** np.arange(1, 20))))
    count = min(20, len(hits))
    late = float(np.abs(hits.time[:count] - times[:count]).max()) / whole
    left = float(np.abs(motion.end).max())
    return Measured(max(late, left), f"{len(hits)} impacts followed, rest after {whole:.6g} s")


def release_error() -> Measured:
    """Phase and speed with which a ball without rebound lands, from the root of its way."""
    omega, table = 2.0 * math.pi * HZ, 1.0001
    leaves = -math.acos(1.0 / table) / omega

    def pace(t: float) -> float:
        swing = math.sin(omega * t) - math.sin(omega * leaves)
        return table * G * swing / omega - G * (t - leaves)

    def way(t: float) -> float:
        swing = math.cos(omega * t) - math.cos(omega * leaves)
        swing += omega * (t - leaves) * math.sin(omega * leaves)
        return -table * G * swing / omega**2 - 0.5 * G * (t - leaves) ** 2

    lands = brentq(way, 0.0, 0.05, xtol=1e-16)
    hits = impacts(simulate(ball(0.0, table), HZ, 4, start=np.zeros(2)))
    late = float(np.abs(hits.time[1:] % (1.0 / HZ) - lands).max()) * HZ
    off = float(np.abs(hits.speed[1:] / -pace(lands) - 1.0).max())
    return Measured(max(late, off), f"it flies for {lands - leaves:.3g} s, no higher than 1e-8 m")


def graze_error(excess: float) -> Measured:
    """State after a slight impact of a free oscillation whose amplitude exceeds the gap."""
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, stops=[RigidStop("x", 0.8, 1.0)],
        excitation=[HarmonicForce("x", 0.0)],
    )  # fmt: skip
    flow = FlowMap(system)
    amplitude = 1.0 + excess
    speed = math.sqrt(excess * (2.0 + excess))
    hit = math.pi - math.atan2(speed, 1.0)  # begun at -amplitude, at rest
    found = flow.shoot(flow.to_state(np.array([-amplitude, 0.0]))[None], np.array([0.0, 5.0]), 1.0)
    t = 5.0 - hit
    exact = [
        math.cos(t) - 0.8 * speed * math.sin(t),
        -math.sin(t) - 0.8 * speed * math.cos(t),
    ]
    error = float(np.abs(flow.to_modal(found.ends)[0] - exact).max())
    return Measured(error, f"speed of the impact {speed:.2g}, {int(found.closings[0])} impact")


def together_error() -> Measured:
    """Speeds behind impacts of two masses, each with its own stop, at one instant."""
    system = System.from_matrices(
        np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]]), {"a": [1.0, 0.0], "b": [0.0, 1.0]},
        stops=[RigidStop("a", 0.5, 0.1), RigidStop("b", 0.25, 0.1)],
    )  # fmt: skip
    flow = FlowMap(system)
    rows = np.array([system.participation[name] for name in "ab"])
    start = np.concatenate([np.zeros(2), np.linalg.solve(rows, [1.0, 1.0])])
    hit = math.asin(0.1)  # the masses swing together, with 1 rad/s
    found = flow.shoot(flow.to_state(start)[None], np.array([0.0, hit + 1e-10]), 1.0)
    speeds = rows @ flow.to_modal(found.ends)[0][2:]
    exact = -math.cos(hit) * np.array([0.5, 0.25])
    return Measured(float(np.abs(speeds - exact).max()), f"{found.closings.tolist()} impacts")


CASES = (
    *(
        Case(
            SUBJECT,
            f"a ball comes to rest, e = {e:g}",
            "infinitely many impacts in a finite time",
            "instants of the impacts: a geometric series; after it, exactly rest",
            1e-10,
            "an instant is known to rounding of the height over the speed",
            partial(chatter_error, e),
        )
        for e in (0.5, 0.8, 0.95)
    ),
    Case(
        SUBJECT,
        "release and landing at 1.0001 g",
        "the force of rest is negative for 0.4 ms; the ball flies less than a hair's breadth",
        "root of the closed form of the flight",
        1e-6,
        "the height is known to 1e-16 m of 1e-9 m",
        release_error,
    ),
    *(
        Case(
            SUBJECT,
            f"an impact that exceeds grazing by {excess:g}",
            "the speed is the root of that; without the impact the motion is another one",
            "closed form of free vibrations before and behind it",
            1e-9,
            "rounding of the gap over the speed, 1e-16 / 1e-6",
            partial(graze_error, excess),
        )
        for excess in (1e-6, 1e-12)
    ),
    Case(
        SUBJECT,
        "two stops are hit at one instant",
        "which is first is rounding",
        "each mass rebounds with its own restitution",
        1e-9,
        "the shot ends 1e-10 s behind the impact",
        together_error,
    ),
)
