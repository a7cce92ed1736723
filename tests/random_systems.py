"""``python tests/random_systems.py COUNT``: random systems, with bad numbers, through the engine.

None may crash, hang or break the rules of C, which a library that is built with sanitizers tells
(`make sanitize`); what comes out is nobody's concern here. The engine is called below the checks
of the package: sizes and indices are right, all other numbers may be NaN, infinite, zero, huge.
Bad numbers may ask for as many panels as the engine's bounds allow, which is hours: each system is
interrupted after a quarter of a second.
"""

from __future__ import annotations

import collections
import signal
import sys
import time
from typing import Any

import numpy as np

from nldyn.base.errors import SystemModelError
from nldyn.engine.layout import INTERRUPTED, StopRow, SystemData, empty_record
from nldyn.engine.newton import Corrector, newton, packed_system
from nldyn.engine.sample import local_extremes, sample_states, touches
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.gauss import gauss_tables
from nldyn.orbits.periodic_schur import product_eigenvalues
from nldyn.system.friction import DryFriction, Friction
from nldyn.system.loads import ConstantForce, HarmonicForce, Unbalance
from nldyn.system.rigid_stop import RigidStop
from nldyn.system.round_stop import RoundStop
from nldyn.system.springs_dampers import PolynomialSpring
from nldyn.system.stop import Stop
from nldyn.system.system import System

SECONDS = 0.25  # of the processor for each system
LATE = 5.0  # of these: no call may go on for so long after the signal
BAD = np.array([np.nan, np.inf, -np.inf, 0.0, 1e308, -1e308, 5e-324, 1e-300, -1.0])
NUMBERS = "blocks", "rows", "bound3", "force", "orders", "drive"
COLUMNS = [StopRow._fields.index(name) for name in (
    "gap", "stiffness", "exponent", "dissipation", "dashpot", "mobility", "duration", "instant",
    "adhesion", "fading", "belt", "pressing", "tangential", "place_rate", "centre", "rub",
    "surface",
)]  # fmt: skip


def random_system(rng: np.random.Generator) -> System:
    """Up to five modes and, now and then, forty stops; half of them with friction."""
    n = int(rng.integers(1, 6))
    count = int(rng.choice([0, 1, 2, 3, 40], p=[0.1, 0.4, 0.3, 0.19, 0.01]))
    stops: list[Stop | RigidStop | RoundStop] = []
    dampers: list[DryFriction] = []
    for _ in range(count):
        gap, direction = float(rng.choice([0.0, 1e-4])), int(rng.choice([1, -1]))
        if rng.random() < 0.2:
            stops.append(RigidStop("a", float(rng.random()), gap, direction))
        elif rng.random() < 0.3:
            linear = Stop("b", 1e6, 1.0, gap, direction, dashpot=50.0, pulls=rng.random() < 0.5)
            stops.append(linear)
        else:
            exponent = float(rng.choice([1.0, 1.5, 2.2]))
            stops.append(Stop("a", 10.0 ** rng.uniform(5, 9), exponent, gap, direction))
    if rng.random() < 0.5:
        add_friction(rng, stops, dampers)
    return System.from_modal(
        np.sort(rng.uniform(0.0, 100.0, n)),
        {name: rng.uniform(-1, 1, n) for name in "abc"},
        modal_damping=rng.uniform(0.0, 0.1, n),
        stops=stops,
        dampers=dampers,
        springs=[PolynomialSpring("b", [1e4, 0.0, 1e10])] if rng.random() < 0.1 else [],
        excitation=[Unbalance("a", 1e-5), HarmonicForce("b", 1.0, harmonic=2)]
        + ([ConstantForce("a", 1.0)] if rng.random() < 0.2 else []),
    )


def add_friction(
    rng: np.random.Generator,
    stops: list[Stop | RigidStop | RoundStop],
    dampers: list[DryFriction],
) -> None:
    """Of a stop over a line or a plane, of a ring, and of what is pressed on all the time."""
    belt, speed = float(rng.choice([0.0, 0.1])), float(rng.choice([0.0, 0.1]))
    law, spring = Friction(float(rng.uniform(0.0, 1.0)), base_speed=belt), 10.0 ** rng.uniform(4, 8)
    second = "c" if rng.random() < 0.7 else None
    give = spring if rng.random() < 0.5 else None
    if rng.random() < 0.4:
        stops.append(
            Stop("a", 1e6, float(rng.choice([1.0, 1.5])), friction=law, tangent="b",
                 tangential_stiffness=give, second_tangent=second)
        )  # fmt: skip
    if rng.random() < 0.4:
        dampers.append(DryFriction("b", 10.0, law, None, give, second))
    if rng.random() < 0.4:
        stops.append(
            RoundStop(("a", "b"), 1e7, 1e-4, 1.5, (1e-5, 0.0), friction=0.2, surface_speed=speed)
        )
    if rng.random() < 0.2:
        dampers.append(DryFriction("a", 5.0, Friction(0.3, 0.5, 0.1, belt)))


def spoiled(data: SystemData, rng: np.random.Generator) -> SystemData:
    """The same numbers, a few of them bad."""
    changed = {name: getattr(data, name).copy() for name in (*NUMBERS, "stops")}
    for _ in range(int(rng.integers(1, 4))):
        array = changed[str(rng.choice([*NUMBERS, "stops"]))]
        if array is changed["stops"]:
            if len(array):
                array[rng.integers(len(array)), rng.choice(COLUMNS)] = rng.choice(BAD)
        elif array.size:
            array.flat[rng.integers(array.size)] = rng.choice(BAD)
    return data._replace(**changed)


def try_system(rng: np.random.Generator) -> int:
    """Fly, correct and evaluate; the outcome of the correction."""
    try:
        flow = FlowMap(random_system(rng))
        data = flow._data
    except SystemModelError:
        return -1
    if rng.random() < 0.7:
        data = spoiled(data, rng)
    size, n_stops, k = len(data.force), len(data.stops), int(rng.integers(1, 4))
    tables = gauss_tables(int(rng.integers(4, 15)), int(rng.choice([2, 4])))
    record = empty_record(int(rng.choice([0, 20, 400])), size, n_stops, tables.nodes.size)
    system = packed_system(data)
    point = np.append(1e-4 * rng.standard_normal(k * size), np.log(rng.uniform(1.0, 500.0)))
    if rng.random() < 0.1:
        point[rng.integers(point.size)] = rng.choice(BAD)
    phases = np.linspace(0.0, 2.0 * np.pi, k + 1)
    row = np.zeros(point.size)
    row[-1] = 1.0
    corrector = Corrector(row, float(point[-1]), 1e4, 1e-8, 1.0, 3, point.copy(), -1, 0.0)
    none = np.zeros((0, 2), dtype=np.int64), np.zeros((0, *data.drive.shape), dtype=complex)
    found = newton(
        system, tables.packed(), record, True, 1.0, point, phases, False, True, *none, corrector,
        n_stops,
    )  # fmt: skip
    product_eigenvalues(found.jacobians)
    if record.used:
        for _ in range(2):
            output = int(rng.integers(data.rows.shape[1]))
            local_extremes(system, tables.packed(), record, 100.0, np.zeros(0), np.zeros(0), output)
        touches(system, tables.packed(), record, 100.0, np.zeros(n_stops), 1e-3)
        here = np.sort(rng.uniform(0.0, 6.0, 20))
        sample_states(system, tables.packed(), record, 100.0, here)
    return found.outcome


def stop(*_: Any) -> None:
    """End a system as Ctrl-C would."""
    raise KeyboardInterrupt


def main() -> None:
    """Try so many systems and tell the outcomes."""
    outcomes: collections.Counter[int] = collections.Counter()
    signal.signal(signal.SIGVTALRM, stop)
    for seed in range(int(sys.argv[1])):
        begun = time.process_time()
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
            outcome = try_system(np.random.default_rng(seed))
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        except KeyboardInterrupt:
            outcome = INTERRUPTED
        outcomes[outcome] += 1
        if time.process_time() - begun > SECONDS + LATE:
            sys.exit(f"system {seed} took {time.process_time() - begun:.1f} s")
        if seed % 500 == 499:
            print(seed + 1, dict(sorted(outcomes.items())), flush=True)


if __name__ == "__main__":
    main()
