"""Compute the reference values of the benchmark: ``python -m bench.reference``.

It takes the stored systems and starts, computes everything else at two precisions, and writes
``data/reference.json`` anew (about a quarter of an hour). With ``--new-starts`` the systems and
starts are made from the example scenes first. It needs mpmath, and is several times faster if
gmpy2 is installed as well.
"""

from __future__ import annotations

import argparse
import json
import math
from itertools import chain
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

from bench.exact import ExactEnd, ExactFlow, Number, Precision, Series
from bench.models import MODELS, stored, to_system, to_table
from bench.native import sensitivities
from nldyn.base.arrays import Real
from nldyn.branches.continuation import continue_branch
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions
from nldyn.orbits.solve import solve_orbit
from nldyn.system.stop import Stop
from nldyn.system.system import System

mp = mpmath.mp
FILE = Path(__file__).with_name("data") / "reference.json"
TIGHT = FlowOptions(rtol=1e-13)

PRECISIONS = {
    "one_dof": (Precision(60, 70, 55), Precision(70, 85, 62)),
    "two_dof": (Precision(60, 70, 55), Precision(70, 85, 62)),
    "four_dof": (Precision(60, 70, 50), Precision(66, 80, 56)),
    "sixteen_dof": (Precision(42, 45, 30), Precision(46, 52, 36)),
}
# a stable orbit from which the branch is followed, and the flip wanted on it, both in Hz
FLIPS = {
    "one_dof": (30.0, 33.654),
    "two_dof": (30.0, 30.703),
    "four_dof": (35.0, 30.338),
    "sixteen_dof": (35.0, 30.354),
}
GRAZING_DEPTHS = ("1e-2", "1e-4", "1e-6", "1e-8", "1e-10", "1e-12", "1e-14")


def model_system(name: str) -> System:
    """The beam with 1, 2, 4 or 16 degrees of freedom, from the example scenes."""
    import cms
    from nldyn.base.resources import example
    from nldyn.scene.build import build_system
    from nldyn.scene.component import build_component
    from nldyn.scene.read import load_scene

    if name == "one_dof":
        return build_system(load_scene(example("one_dof.toml")))
    scene = load_scene(example("four_dof_xi_0.01.toml"))
    size = {"two_dof": 2, "four_dof": 4, "sixteen_dof": 16}[name]
    reduced = cms.reduce(build_component(scene), modes=size - 1, residual=True)
    return build_system(scene, reduced)


def new_start(name: str) -> dict[str, Any]:
    """System, frequency and state of the orbit at the wanted flip."""
    start_hz, flip_hz = FLIPS[name]
    system = to_system(to_table(model_system(name)))
    flow = FlowMap(system, TIGHT)
    ends = sorted((start_hz, flip_hz))
    branch = continue_branch(solve_orbit(flow, start_hz), (ends[0] - 0.2, ends[1] + 0.2))
    flips = [p for p in branch.special_points if p.kind == "PD"]
    orbit = min(flips, key=lambda p: abs(p.frequency_hz - flip_hz)).orbit
    start = flow.to_modal(orbit.problem.nodes(orbit.point)[0])
    return {"system": to_table(system), "omega": orbit.omega, "start": start.tolist()}


def grazing_start(depth: str) -> dict[str, Any]:
    """The linear orbit of the 1-DOF model at 20 Hz, with a stop a little inside of it."""
    free = model_system("one_dof")
    omega = 2.0 * math.pi * 20.0
    flow = FlowMap(free)
    steady = free.response(omega).amplitudes[0]
    amplitude = abs(complex(flow.rows[0] @ steady))
    gap = amplitude * (1.0 - float(depth))
    stop = Stop("middle", free.elastic_stops[0].stiffness, gap=gap)
    system = System(
        free.natural_frequencies, free.damping, free.participation, (stop,), (), free.excitation
    )
    start = flow.to_modal(steady.real)
    return {"system": to_table(system), "omega": omega, "start": start.tolist()}


def flip_equations(end: ExactEnd, start: Series) -> Series:
    """Return to the start, and a multiplier of -1: zero at a flip."""
    matrix = mp.matrix(end.monodromy) + mp.eye(len(start))
    return [*(a - b for a, b in zip(end.state, start, strict=True)), mp.det(matrix)]


def flip_inverse(system: System, start: Real, omega: float) -> Real:
    """Inverse Jacobian of `flip_equations`, by central differences of the flow map."""
    flow = FlowMap(system, TIGHT)
    scale = np.concatenate([1.0 / system.natural_frequencies, np.ones(system.size), [0.0]])
    step = 1e-6 * np.linalg.norm(start / scale[:-1]) * scale
    step[-1] = 1e-6 * omega

    def equations(z: Real) -> Real:
        end = sensitivities(flow, z[:-1], float(z[-1]))
        determinant = np.linalg.det(end.monodromy + np.eye(start.size))
        return np.append(end.state - z[:-1], determinant)

    at = np.append(start, omega)
    columns = [
        (equations(at + h * e) - equations(at - h * e)) / (2.0 * h)
        for h, e in zip(step, np.eye(at.size), strict=True)
    ]
    return np.asarray(np.linalg.inv(np.array(columns).T))


def exact_flip(system: System, start: Real, omega: float, inverse: Real, p: Precision) -> Number:
    """Frequency of the flip, by Newton's method with a fixed Jacobian."""
    mp.dps = p.digits
    unknown = mp.matrix([*(mp.mpf(a) for a in start), mp.mpf(omega)])
    B = mp.matrix(inverse.tolist())
    for _ in range(20):
        end = ExactFlow(system, unknown[len(start)], p).period(list(unknown)[:-1])
        step = B * mp.matrix(flip_equations(end, list(unknown)[:-1]))
        unknown -= step
        change = abs(step[len(start)] / unknown[len(start)])
        print(f"    flip: change of the frequency {mp.nstr(change, 3)}", flush=True)
        if change < mp.mpf(10) ** (-0.8 * p.aim):
            return unknown[len(start)]
    raise RuntimeError("the flip was not found")


def agreement(a: ExactEnd, b: ExactEnd) -> float:
    """Digits to which two results agree, each part relative to its largest entry."""
    digits = []
    for x, y in (
        (a.state, b.state),
        ([*chain(*a.monodromy)], [*chain(*b.monodromy)]),
        (a.d_omega, b.d_omega),
    ):
        n = len(a.state) // 2
        for half in (slice(0, n), slice(n, None)) if len(x) == 2 * n else (slice(None),):
            difference = max(abs(p - q) for p, q in zip(x[half], y[half], strict=True))
            digits.append(-mp.log10(difference / max(abs(p) for p in x[half]) + mp.mpf(10) ** -99))
    return float(min(digits))


def solve(name: str, table: dict[str, Any]) -> tuple[dict[str, Any], ExactEnd]:
    """End state and derivatives of a case at both precisions."""
    system = to_system(table["system"])
    ends = [ExactFlow(system, table["omega"], p).period(table["start"]) for p in PRECISIONS[name]]
    digits = agreement(*ends)
    print(f"  {name}: {ends[1].contacts} contacts, {digits:.1f} digits", flush=True)
    shown = min(45, math.floor(digits))
    return {
        **{key: table[key] for key in ("system", "omega", "start")},
        "contacts": ends[1].contacts,
        "digits": round(digits, 1),
        "state": _text(ends[1].state, shown),
        "monodromy": [_text(row, shown) for row in ends[1].monodromy],
        "d_omega": _text(ends[1].d_omega, shown),
    }, ends[1]


def solve_model(name: str, table: dict[str, Any]) -> dict[str, Any]:
    """All reference values of a model."""
    done, end = solve(name, table)
    system = to_system(table["system"])
    size = len(end.state)
    # one Newton step from the start to the periodic orbit: the error left is the square of it
    residual = mp.matrix(end.state) - mp.matrix(table["start"])
    step = mp.lu_solve(mp.eye(size) - mp.matrix(end.monodromy), residual)
    done["orbit_start"] = _text(list(mp.matrix(table["start"]) + step), 25)
    inverse = flip_inverse(system, np.array(table["start"]), table["omega"])
    omega = exact_flip(system, table["start"], table["omega"], inverse, PRECISIONS[name][0])
    done["flip_omega"] = mp.nstr(omega, min(45, int(0.8 * PRECISIONS[name][0].aim)))
    done["flip_inverse"] = [[float(f"{a:.8g}") for a in row] for row in inverse]
    return done


def _text(values: Series, digits: int) -> list[str]:
    return [mp.nstr(value, digits) for value in values]


def main() -> None:
    """Compute and write the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--new-starts", action="store_true", help="make systems and starts anew")
    parser.add_argument("models", nargs="*", default=[*MODELS, "grazing"], help="which ones")
    chosen = parser.parse_args()
    content = stored() if FILE.exists() else {"models": {}, "grazing": {}}
    content["made_by"] = "python -m bench.reference"
    for name in chosen.models:
        print(name, flush=True)
        if name == "grazing":
            for depth in GRAZING_DEPTHS:
                known = not chosen.new_starts and content["grazing"].get(depth)
                content["grazing"][depth], _ = solve("one_dof", known or grazing_start(depth))
        else:
            known = not chosen.new_starts and content["models"].get(name)
            content["models"][name] = solve_model(name, known or new_start(name))
        FILE.write_text(json.dumps(content, indent=0) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
