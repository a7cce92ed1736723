"""Flow maps in HDF5 files: the numbers of a system and the accuracy, in its own coordinates."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, astuple, fields, replace
from typing import Any

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions
from nldyn.io.hdf5 import Group, put, set_attribute
from nldyn.system.contact_law import ContactLaw
from nldyn.system.friction import DryFriction, Friction
from nldyn.system.linear import LinearPart
from nldyn.system.loads import BaseMotion, ConstantForce, Excitation, HarmonicForce, Unbalance
from nldyn.system.parameters import strength
from nldyn.system.rigid_stop import TRIED_SPEEDS, AnyStop, Restitution, RigidStop
from nldyn.system.round_stop import RoundStop
from nldyn.system.spin import Spin
from nldyn.system.springs_dampers import (
    LARGEST_DEGREE,
    CubicDamper,
    Damper,
    PolynomialSpring,
    Spring,
)
from nldyn.system.stop import Stop
from nldyn.system.system import AnyDamper, AnySpring, System

TRIALS = ((0.1, 0.0), (1.0, 0.1), (1.0, -0.1))  # penetration over its unit, speed in m/s
STATE_UNIT = "m kg^0.5"

Laws = Mapping[int, Callable[..., Any]]  # of elastic stops, restitutions of rigid ones


def laws_of(system: System) -> Laws:
    """Contact laws of a system's own, by the numbers of their stops."""
    own = {i: stop.law for i, stop in system.elastic_stops.items() if stop.law}
    rigid = {i: s.restitution for i, s in system.rigid_stops.items() if callable(s.restitution)}
    return {**own, **rigid}


def checked_laws(laws: Laws | None) -> Laws:
    """Contact laws by the numbers of their stops."""
    check_types(laws=(laws, Mapping, None))
    return laws or {}


_OF_SPIN = {"gyroscopic": "1", "circulatory": "1/s"}


def _read_spin(group: Group, n: int) -> Spin:
    matrices = {name: group.array(name, n, n) for name in _OF_SPIN if name in group}
    return Spin(group.number("hz"), **matrices)


def _read_rides(group: Group) -> dict[str, dict[str, float]]:
    fault = group.fault("attribute", "rides", "does not tell what rides on a base")
    try:
        told = json.loads(group.text("rides"))
        return {name: {load: float(x) for load, x in on.items()} for name, on in told.items()}
    except (ValueError, TypeError, AttributeError):
        raise fault from None


def write_flow(group: Any, flow: FlowMap) -> None:
    """Write the numbers of a flow map into a group."""
    for key, value in asdict(flow.options).items():
        if value is not None:
            set_attribute(group, key, value)
    system = flow.system
    _write_modes(group, system)
    _write_spin(group, system)
    _write_interfaces(group, system)
    _write_basis(group, system)
    _write_rigid_stops(group, system)
    _write_elastic_stops(group, [stop for stop in system.stops if isinstance(stop, Stop)])
    if system.areas:
        set_attribute(group, "areas", json.dumps(_told_areas(system)))
    if system.round_stops:
        set_attribute(group, "round_stops", json.dumps(_told_round(system)))
    viscous = [d for d in system.dampers if not isinstance(d, DryFriction)]
    _write_columns(
        group.create_group("dampers"),
        {"at": [d.at for d in viscous], **_ends(viscous), **_drags(viscous)},
        {"coefficient": ("N s/m", [d.coefficient for d in viscous])},
    )
    if system.sliders:
        set_attribute(group, "friction", json.dumps(_told_friction(system)))
    if system.springs:
        _write_springs(group, system.springs)
    sources = system.excitation
    _write_columns(
        group.create_group("excitation"),
        {"at": [s.at for s in sources], "kind": [_kind(s) for s in sources]},
        {
            "size": ("kg m, N, m, m/s or m/s^2", [strength(s) for s in sources]),
            "phase_deg": ("degree", [getattr(s, "phase_deg", 0.0) for s in sources]),
        },
    )


def _told_friction(system: System) -> dict[str, Any]:
    """Dry friction by the places of its stops and dampers."""
    return {
        "stops": {
            place: [
                stop.tangent,
                stop.tangent_against,
                astuple(stop.friction),
                getattr(stop, "tangential_stiffness", None),
                *(getattr(stop, "across", None) or ()),
            ]
            for place, stop in enumerate(system.stops)
            if not isinstance(stop, RoundStop) and isinstance(stop.friction, Friction)
        },
        "dampers": {
            place: [
                damper.at,
                damper.normal_force,
                astuple(damper.friction),
                damper.against,
                damper.tangential_stiffness,
                *(damper.across or ()),
            ]
            for place, damper in enumerate(system.dampers)
            if isinstance(damper, DryFriction) and isinstance(damper.friction, Friction)
        },
    }


def _told_areas(system: System) -> dict[str, list[list[float]]]:
    """The areas of contact: places of their points among all stops, and shares."""
    return {
        name: [
            [place, stop.share] for place, stop in zip(places, system.area_stops(name), strict=True)
        ]
        for name, places in system.areas.items()
    }


def _with_areas(group: Group, stops: tuple[AnyStop, ...]) -> tuple[AnyStop, ...]:
    """Stops with what `_told_areas` told."""
    if not group.has_attribute("areas"):
        return stops
    found = list(stops)
    try:
        for name, points in json.loads(group.text("areas")).items():
            for place, share in points:
                point = found[int(place)]
                assert isinstance(point, Stop)
                found[int(place)] = replace(point, area=name, share=share)
    except (ValueError, TypeError, AttributeError, IndexError, AssertionError):
        raise group.fault("attribute", "areas", "does not tell areas of contact") from None
    return tuple(found)


def _told_round(system: System) -> dict[int, dict[str, Any]]:
    """The round clearances by their places among all stops."""
    told = {}
    for place, stop in system.round_stops.items():
        numbers = {own.name: getattr(stop, own.name) for own in fields(stop) if own.name != "law"}
        law = {} if stop.law is None else {"law_trials": _trials(stop)}
        told[place] = {**numbers, **law}
    return told


def _read_round_stops(group: Group, laws: Laws) -> dict[int, RoundStop]:
    """What `_told_round` told."""
    if not group.has_attribute("round_stops"):
        return {}
    found = {}
    try:
        for key, numbers in json.loads(group.text("round_stops")).items():
            place, trials = int(key), numbers.pop("law_trials", None)
            law = laws.get(place) if trials else None
            if trials and law is None:
                raise _no_law(group, place, numbers["plane"][0])
            stop = RoundStop(**numbers, law=law)
            if trials and [list(each) for each in _trials(stop)] != trials:
                raise _other_law(group, place, stop.at)
            found[place] = stop
    except (ValueError, TypeError, KeyError, AttributeError, IndexError):
        raise group.fault("attribute", "round_stops", "does not tell round clearances") from None
    return found


def _no_law(group: Group, place: int, at: str) -> SystemModelError:
    return SystemModelError(
        f"{group.path}: stop {place} at '{at}' has a law of its own, which a file cannot hold: "
        f"pass laws={{{place}: law}}"
    )


def _other_law(group: Group, place: int, at: str) -> SystemModelError:
    return SystemModelError(
        f"{group.path}: the law passed for stop {place} at '{at}' is not the one with which the "
        "file was written: its forces differ"
    )


def _with_friction(
    group: Group, stops: tuple[AnyStop, ...], dampers: tuple[AnyDamper, ...]
) -> tuple[tuple[AnyStop, ...], tuple[AnyDamper, ...]]:
    """Stops and dampers with what `_told_friction` told."""
    if not group.has_attribute("friction"):
        return stops, dampers
    rough, all_dampers = list(stops), list(dampers)
    try:
        told = json.loads(group.text("friction"))
        for place, (tangent, against, law, *spring) in told["stops"].items():
            own = {"tangent": tangent, "tangent_against": against, "friction": Friction(*law)}
            if spring and spring[0] is not None:  # earlier versions do not tell it
                own["tangential_stiffness"] = spring[0]
            if len(spring) > 1:
                own["second_tangent"], own["second_tangent_against"] = spring[1:]
            rough[int(place)] = replace(rough[int(place)], **own)
        for place, (at, normal, law, *ends) in told["dampers"].items():
            all_dampers.insert(int(place), DryFriction(at, normal, Friction(*law), *ends))
    except (ValueError, TypeError, KeyError, AttributeError, IndexError):
        raise group.fault("attribute", "friction", "does not tell what slides") from None
    return tuple(rough), tuple(all_dampers)


def _write_modes(group: Any, system: System) -> None:
    put(group, "natural_frequencies", system.natural_frequencies, "rad/s")
    put(group, "damping", system.damping, "1/s")
    if system.circulatory is not None:
        put(group, "circulatory", system.circulatory, "1/s^2")


def _write_spin(group: Any, system: System) -> None:
    if system.spin is None:
        return
    spin = group.create_group("spin")
    set_attribute(spin, "hz", system.spin.hz)
    for name, unit in _OF_SPIN.items():
        if getattr(system.spin, name) is not None:
            put(spin, name, getattr(system.spin, name), unit)


def _write_interfaces(group: Any, system: System) -> None:
    set_attribute(group, "interfaces", system.interfaces)
    if system.rides:
        set_attribute(group, "rides", json.dumps({k: dict(v) for k, v in system.rides.items()}))
    if system.common_flexibility is not None:
        put(group, "common_flexibility", system.common_flexibility, "m/N")
    if system.rotations:
        set_attribute(group, "rotations", tuple(sorted(system.rotations)))
    vectors = np.array([system.participation[name] for name in system.interfaces], dtype=float)
    put(group, "participation", vectors.reshape(-1, system.size), "kg^-0.5")
    if system.loads:
        set_attribute(group, "load_vectors", tuple(system.loads))
        put(group, "loads", np.array(list(system.loads.values()), dtype=float), "kg^0.5")


def _write_basis(group: Any, system: System) -> None:
    """The basis of the states: another computer may choose another one."""
    linear, basis = system.linear, group.create_group("basis")
    put(basis, "blocks", linear.blocks, "1/s")
    put(basis, "right", linear.right, "kg^-0.5 for displacements")
    put(basis, "left", linear.left, "kg^0.5 for displacements")
    put(basis, "growth", linear.growth, "1")
    set_attribute(basis, "condition", linear.condition)


def _write_elastic_stops(group: Any, stops: Sequence[Stop]) -> None:
    columns: dict[str, tuple[str, list[Any]]] = {
        "stiffness": ("N/m^exponent", [s.stiffness for s in stops]),
        "exponent": ("1", [s.exponent for s in stops]),
        "gap": ("m", [s.gap for s in stops]),
        "direction": ("1", [s.direction for s in stops]),
        "dissipation": ("s/m", [s.dissipation for s in stops]),
    }
    if any(s.dashpot for s in stops):
        columns["dashpot"] = ("N s/m", [s.dashpot for s in stops])
    if not all(s.pulls for s in stops):
        columns["pulls"] = ("1", [s.pulls for s in stops])
    columns["is_against"] = ("1", [s.against is not None for s in stops])
    columns["has_own_law"] = ("1", [s.law is not None for s in stops])
    columns["law_trials"] = ("N, N/m, N s/m", [_trials(s) for s in stops])
    names = {"at": [s.at for s in stops], "against": [s.against or "" for s in stops]}
    _write_columns(group.create_group("stops"), names, columns)


def _write_springs(group: Any, springs: Sequence[AnySpring]) -> None:
    names = {
        "at": [s.at for s in springs],
        "kind": ["linear" if isinstance(s, Spring) else "" for s in springs],
        **_ends(springs),
    }
    coefficients = "N/m, N/m^2, ...", [_coefficients(s) for s in springs]
    _write_columns(group.create_group("springs"), names, {"coefficients": coefficients})


def _ends(elements: Sequence[AnyDamper] | Sequence[AnySpring]) -> dict[str, list[str]]:
    """Interfaces at the other ends, with a mark before, or nothing if all are on the ground."""
    if all(element.against is None for element in elements):
        return {}
    return {"against": ["" if e.against is None else f"'{e.against}" for e in elements]}


def _drags(dampers: Sequence[AnyDamper]) -> dict[str, list[str]]:
    """With what the damping grows, or nothing if all dampers are linear."""
    if all(isinstance(damper, Damper) for damper in dampers):
        return {}
    return {"by": [getattr(damper, "by", "") for damper in dampers]}


def _coefficients(spring: AnySpring) -> list[float]:
    """Coefficients of all powers that there may be; nan stands for one that is not given."""
    known = [spring.stiffness] if isinstance(spring, Spring) else list(spring.coefficients)
    return known + [math.nan] * (LARGEST_DEGREE - len(known))


def _write_rigid_stops(group: Any, system: System) -> None:
    """Write the rigid stops, if there are some, with their places among all."""
    placed = {i: s for i, s in enumerate(system.stops) if isinstance(s, RigidStop)}
    if not placed:
        return
    stops = list(placed.values())
    _write_columns(
        group.create_group("rigid_stops"),
        {"at": [s.at for s in stops], "against": [s.against or "" for s in stops]},
        {
            "place": ("1", list(placed)),
            "gap": ("m", [s.gap for s in stops]),
            "direction": ("1", [s.direction for s in stops]),
            "is_against": ("1", [s.against is not None for s in stops]),
            "has_own_law": ("1", [s.law is not None for s in stops]),
            "restitution": ("1", [[s.restitution_at(v) for v in TRIED_SPEEDS] for s in stops]),
        },
    )


def _read_rigid_stops(group: Group, laws: Laws) -> dict[int, RigidStop]:
    """The rigid stops by their places among all."""
    at, against = group.texts("at"), group.texts("against")
    count = len(at)
    names = ("place", "gap", "direction", "is_against", "has_own_law")
    values = {name: group.array(name, count) for name in names}
    trials = group.array("restitution", count, len(TRIED_SPEEDS))
    found = {}
    for i in range(count):
        place = int(values["place"][i])
        restitution: float | Restitution = float(trials[i, 0])
        if values["has_own_law"][i]:
            if place not in laws:
                raise SystemModelError(
                    f"{group.path}: the restitution of stop {place} at '{at[i]}' is a function, "
                    f"which a file cannot hold: pass laws={{{place}: restitution}}"
                )
            restitution = laws[place]
        stop = RigidStop(
            at[i],
            restitution,
            float(values["gap"][i]),
            int(values["direction"][i]),
            against[i] if values["is_against"][i] else None,
        )
        if [stop.restitution_at(v) for v in TRIED_SPEEDS] != trials[i].tolist():
            raise SystemModelError(
                f"{group.path}: the restitution passed for stop {place} at '{at[i]}' is not the "
                "one with which the file was written: its values differ"
            )
        found[place] = stop
    return found


def _kind(source: Excitation) -> str:
    """Kind of excitation in files, with its harmonic unless that is the usual one."""
    if isinstance(source, ConstantForce):
        return "constant"
    if isinstance(source, BaseMotion):
        name = f"base-{source.quantity}"
    else:
        name = "unbalance" if isinstance(source, Unbalance) else "harmonic"
    return name if source.harmonic == 1 else f"{name} {source.harmonic}"


def _write_columns(
    group: Any, texts: Mapping[str, Sequence[str]], numbers: Mapping[str, tuple[str, Sequence[Any]]]
) -> None:
    for name, values in texts.items():
        set_attribute(group, name, values)
    for name, (unit, column) in numbers.items():
        put(group, name, np.array(column, dtype=float), unit)


def _trials(stop: Stop | RoundStop) -> list[tuple[float, float, float]]:
    """What a stop's own law gives at a few penetrations and speeds, to know it again."""
    law = stop.law
    if law is None:
        return [(0.0, 0.0, 0.0) for _ in TRIALS]
    unit = stop.stiffness ** (-1.0 / stop.exponent)
    return [law(share * unit, speed) for share, speed in TRIALS]


def read_flow(group: Group, laws: Laws) -> FlowMap:
    """The flow map that `write_flow` wrote, with the laws of the user's own.

    Raises
    ------
    SystemModelError
        For numbers that make no system, and a law that is missing or is another one.
    """
    omega = group.array("natural_frequencies", -1)
    n = omega.size
    names = group.texts("interfaces")
    vectors = group.array("participation", len(names), n)
    try:
        system = System(
            omega,
            group.array("damping", n, n),
            dict(zip(names, vectors, strict=True)),
            *_with_friction(group, _read_stops(group, laws), _read_dampers(group.group("dampers"))),
            _read_excitation(group.group("excitation")),
            _read_loads(group, n),
            _read_springs(group.group("springs")) if "springs" in group else (),
            group.array("circulatory", n, n) if "circulatory" in group else None,
            _read_spin(group.group("spin"), n) if "spin" in group else None,
            _read_rides(group) if group.has_attribute("rides") else {},
            frozenset(group.texts("rotations") if group.has_attribute("rotations") else ()),
            group.array("common_flexibility", -1, -1) if "common_flexibility" in group else None,
        )
    except SystemModelError as error:
        if str(error).startswith(str(group.path)):
            raise
        raise SystemModelError(f"{group.path}: {error}") from error
    basis, places = group.group("basis"), len(system.place_ends)
    vars(system)["linear"] = LinearPart(
        basis.array("blocks", n + places, 2, 2),
        basis.array("right", 2 * n, system.state_size),
        basis.array("left", system.state_size, 2 * n),
        basis.array("growth", n + places),
        basis.number("condition"),
        places,
    )
    nodes = group.whole("nodes") if group.has_attribute("nodes") else None
    tail = group.number("tail") if group.has_attribute("tail") else None
    return FlowMap(system, FlowOptions(group.number("rtol"), nodes, tail))


def _read_stops(group: Group, laws: Laws) -> tuple[AnyStop, ...]:
    rigid = _read_rigid_stops(group.group("rigid_stops"), laws) if "rigid_stops" in group else {}
    around = _read_round_stops(group, laws)
    other: dict[int, AnyStop] = {**rigid, **around}
    own = {i: law for i, law in laws.items() if i not in other}
    elastic = _read_elastic_stops(group.group("stops"), own, set(other))
    stops: dict[int, AnyStop] = {**other, **elastic}
    return _with_areas(group, tuple(stops[i] for i in sorted(stops)))


def _read_elastic_stops(group: Group, laws: Laws, taken: set[int]) -> dict[int, Stop]:
    """The elastic stops by their places among all, of which others are taken."""
    at, against = group.texts("at"), group.texts("against")
    count = len(at)
    places = [i for i in range(count + len(taken)) if i not in taken]
    numbers = ("stiffness", "exponent", "gap", "direction", "dissipation")
    values = {name: group.array(name, count) for name in (*numbers, "is_against", "has_own_law")}
    values["dashpot"] = group.array("dashpot", count) if "dashpot" in group else np.zeros(count)
    values["pulls"] = group.array("pulls", count) if "pulls" in group else np.ones(count)
    trials = group.array("law_trials", *((count, len(TRIALS), 3) if count else (0,)))
    for i in laws:
        if i not in places or not values["has_own_law"][places.index(i)]:
            raise SystemModelError(f"{group.path}: laws: no stop {i} has a law of its own")
    stops = {}
    for i, place in enumerate(places):
        law: ContactLaw | None = None
        if values["has_own_law"][i]:
            if place not in laws:
                raise _no_law(group, place, at[i])
            law = laws[place]
        stop = Stop(
            at[i],
            float(values["stiffness"][i]),
            float(values["exponent"][i]),
            float(values["gap"][i]),
            int(values["direction"][i]),
            against[i] if values["is_against"][i] else None,
            float(values["dissipation"][i]),
            law,
            float(values["dashpot"][i]),
            bool(values["pulls"][i]),
        )
        if not np.array_equal(_trials(stop), trials[i]):
            raise _other_law(group, place, at[i])
        stops[place] = stop
    return stops


def _read_dampers(group: Group) -> tuple[AnyDamper, ...]:
    at = group.texts("at")
    by = group.texts("by") if group.has_attribute("by") else [""] * len(at)
    rows = zip(at, group.array("coefficient", len(at)).tolist(), _other_ends(group), strict=True)
    return tuple(
        CubicDamper(*row, drag) if drag else Damper(*row)
        for row, drag in zip(rows, by, strict=True)
    )


def _read_springs(group: Group) -> tuple[AnySpring, ...]:
    at, kinds = group.texts("at"), group.texts("kind")
    rows = group.array("coefficients", len(at), LARGEST_DEGREE)
    return tuple(
        Spring(place, float(row[0]), other)
        if kind
        else PolynomialSpring(place, row[~np.isnan(row)].tolist(), other)
        for place, kind, row, other in zip(at, kinds, rows, _other_ends(group), strict=True)
    )


def _other_ends(group: Group) -> list[str | None]:
    """What `_ends` wrote."""
    if not group.has_attribute("against"):
        return [None] * len(group.texts("at"))
    return [name[1:] if name else None for name in group.texts("against")]


def _read_loads(group: Group, modes: int) -> dict[str, Real]:
    """Load vectors, if the file has some."""
    if not group.has_attribute("load_vectors"):
        return {}
    names = group.texts("load_vectors")
    return dict(zip(names, group.array("loads", len(names), modes), strict=True))


def _read_excitation(group: Group) -> tuple[Excitation, ...]:
    at, kinds = group.texts("at"), group.texts("kind")
    size, phase = group.array("size", len(at)), group.array("phase_deg", len(at))
    rows = zip(at, kinds, size.tolist(), phase.tolist(), strict=True)
    return tuple(_source(group, *row) for row in rows)


def _source(group: Group, at: str, kind: str, size: float, phase_deg: float) -> Excitation:
    name, _, harmonic = kind.partition(" ")
    order = int(harmonic) if harmonic.isdecimal() else 1
    if kind == "constant":
        return ConstantForce(at, size)
    if kind == _numbered("unbalance", harmonic):
        return Unbalance(at, size, phase_deg, order)
    if kind == _numbered("harmonic", harmonic):
        return HarmonicForce(at, size, phase_deg, order)
    if kind == _numbered(name, harmonic) and name.startswith("base-"):
        return BaseMotion(at, size, name.removeprefix("base-"), phase_deg, order)
    raise group.fault("attribute", "kind", f"has an unknown entry '{kind}'")


def _numbered(name: str, harmonic: str) -> str:
    return f"{name} {harmonic}" if harmonic.isdecimal() else name
