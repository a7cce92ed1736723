"""What the commands say of scenes, systems and diagrams, in words and as JSON."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from nldyn.base.arrays import Real
    from nldyn.scene.schema.scene import Scene
    from nldyn.search.diagram import Diagram
    from nldyn.system.friction import Friction, Slider
    from nldyn.system.rigid_stop import AnyStop
    from nldyn.system.round_stop import RoundStop
    from nldyn.system.system import AnySpring, System


def describe(diagram: Diagram, seconds: float, out: Path) -> str:
    """Say in a few lines what was computed."""
    branches = diagram.branches
    kinds = special_counts(diagram)
    found = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none"
    points = sum(len(branch.points) for branch in branches)
    lines = [
        f"{len(branches)} {'branch' if len(branches) == 1 else 'branches'} with {points} points "
        f"in {seconds:.1f} s",
        f"special points: {found}",
        *(f"note: {note}" for note in dict.fromkeys(diagram.notes)),
        f"written to {out}; {out / 'report.html'} is a page for a browser",
    ]
    return "\n".join(lines)


def special_counts(diagram: Diagram) -> dict[str, int]:
    """How many special points there are of each kind."""
    special = (point for branch in diagram.branches for point in branch.special_points)
    return dict(sorted(Counter(str(point.kind) for point in special).items()))


def describe_system(system: System, residual: int = 0) -> str:
    """Tabulate frequencies and participation of the modes, and the static flexibility.

    The last ``residual`` modes are marked as such.
    """
    import numpy as np

    names = told_interfaces(system)
    width = max(14, *(len(name) + 2 for name in names))
    lines = ["mode   frequency (Hz)   participation (1/sqrt(kg)) at"]
    lines.append(" " * 23 + "".join(f"{name:>{width}}" for name in names))
    for mode, hz in enumerate(system.frequencies_hz):
        values = "".join(f"{system.participation[name][mode]:>{width}.6g}" for name in names)
        mark = "  residual" if mode >= system.size - residual else ""
        lines.append(f"{mode + 1:>4}{hz:>19.6f}{values}{mark}")
    flexibility = "".join(f"{static_flexibility(system, name):>{width}.6g}" for name in names)
    lines.append(f"{'static flexibility m/N':<23}{flexibility}")
    if system.rotations:
        turning = ", ".join(repr(name) for name in names if name in system.rotations)
        lines.append(f"of the rotation of {turning}: rad for m, N m for N")
    lines += describe_stops(system)
    lines += [describe_spring(spring, system.unit(spring.at)) for spring in system.springs]
    lines += describe_sliders(system)
    if np.any(system.spring_stiffness):
        hz = ", ".join(f"{value:.6f}" for value in system.linear.frequencies_hz)
        lines.append(f"frequencies with the springs: {hz} Hz")
    return "\n".join(lines)


def describe_rest(system: System) -> list[str]:
    """Say where the structure rests, and what holds it, if that is not at zero."""
    from nldyn.system.equilibrium import rest_positions

    found = rest_positions(system)
    q, others = found[0], found[1:]
    if not q.any() and not others:
        return []
    return [
        f"at rest: {_places(system, q)}",
        *(f"or at rest: {_places(system, other)}" for other in others),
        *_closed(system, q),
    ]


def describe_self_excited(scene: Scene) -> list[str]:
    """Say what is computed of a scene whose motions nothing excites."""
    if not scene.self_excited:
        return []
    assert scene.continuation is not None
    low, high = scene.continuation.limits
    return [
        "nothing excites it: motions that excite themselves are followed, with their frequency, "
        f"over {scene.continuation.parameter} from {low:g} to {high:g}"
    ]


def _closed(system: System, q: Real) -> list[str]:
    """A line for each stop that is closed at rest, and one for each area of contact."""
    from nldyn.system.equilibrium import closed_at_rest
    from nldyn.system.naming import moment_unit

    closed, of_areas = closed_at_rest(system, q), _places_of_areas(system)
    lines = [
        f"at rest the {_short(system.stops[i])} is closed by {depth:.6g} {unit}: "
        f"{force:.6g} {moment_unit(unit)}"
        for i, depth, force in closed
        if i not in of_areas
        for unit in [system.unit(system.stops[i].at)]
    ]
    for name, places in system.areas.items():
        forces = [force for i, _, force in closed if i in places]
        if forces:
            unit = moment_unit(system.unit(system.stops[places[0]].at))
            lines.append(
                f"at rest {len(forces)} of {len(places)} points of the contact area '{name}' are "
                f"closed: {sum(forces):.6g} {unit} in all"
            )
    return lines


def _short(stop: AnyStop) -> str:
    """What a stop is, and where, in a few words."""
    from nldyn.system.naming import quoted
    from nldyn.system.round_stop import RoundStop

    if isinstance(stop, RoundStop):
        return f"round clearance at {quoted(stop.plane)}"
    return f"stop at '{stop.at}'"


def _places(system: System, q: Real) -> str:
    return ", ".join(
        f"{float(system.participation[name] @ q):.6g} {system.unit(name)} at '{name}'"
        for name in told_interfaces(system)
    )


def told_interfaces(system: System) -> list[str]:
    """The interfaces, without the points of areas of contact unless there are no others."""
    points = {
        end
        for name in system.areas
        for stop in system.area_stops(name)
        for end in (
            *(stop.at, stop.tangent, stop.second_tangent),
            *(stop.against, stop.tangent_against, stop.second_tangent_against),
        )
    }
    return [name for name in system.interfaces if name not in points] or list(system.interfaces)


def describe_stops(system: System) -> list[str]:
    """A line for each stop, and one for each area of contact."""
    of_areas = _places_of_areas(system)
    single = [
        describe_stop(stop, system.unit(stop.at))
        for place, stop in enumerate(system.stops)
        if place not in of_areas
    ]
    return single + [describe_area(system, name) for name in system.areas]


def _places_of_areas(system: System) -> set[int]:
    """Which of the stops are points of areas of contact."""
    return {place for places in system.areas.values() for place in places}


def describe_area(system: System, name: str) -> str:
    """Say in a line how many points an area has, and what they do."""
    stops = system.area_stops(name)
    first, gaps = stops[0], sorted({stop.gap for stop in stops})
    unit = "N/m" + ("" if first.exponent == 1.0 else f"^{first.exponent:g}")
    total = sum(stop.stiffness for stop in stops)
    if first.exponent == 1.0:
        total = system.coupled.whole_stiffness(system.areas[name])
    told = f"contact area '{name}': {len(stops)} points, {total:.6g} {unit} in all, "
    told += f"gap {gaps[0]:g} m" if len(gaps) == 1 else f"gaps {gaps[0]:g} to {gaps[-1]:g} m"
    told += f", dissipation {first.dissipation:g} s/m" if first.dissipation else ""
    damping = sum(stop.dashpot for stop in stops)
    told += f", dashpot {damping:.6g} N s/m in all" if damping else ""
    told += "" if first.pulls else " (never pulls)"
    if first.tangent is None:
        return told
    over = first.second_tangent is not None
    told += f", friction {_told_law(first.law_of_friction, over)}"
    told += " over the plane" if over else ""
    if first.tangential_stiffness is not None:
        total = sum(stop.tangential_stiffness or 0.0 for stop in stops)
        told += f", behind {total:.6g} N/m in all"
    return told


def describe_stop(stop: AnyStop, length: str = "m") -> str:
    """Say in a line where a stop is and what it does; of a rotation the length is rad."""
    from nldyn.system.naming import moment_unit
    from nldyn.system.rigid_stop import RigidStop
    from nldyn.system.round_stop import RoundStop

    if isinstance(stop, RigidStop):
        return (
            f"rigid stop {_place(stop)}: restitution {stop.restitution_at(1.0):g}, "
            f"gap {stop.gap:g} {length}, direction {stop.direction:+d}"
        )
    if isinstance(stop, RoundStop):
        return _describe_round(stop)
    force = moment_unit(length)
    unit = f"{force}/{length}" + ("" if stop.exponent == 1.0 else f"^{stop.exponent:g}")
    loss = f", dissipation {stop.dissipation:g} s/{length}" if stop.dissipation else ""
    loss += f", dashpot {stop.dashpot:g} {force} s/{length}" if stop.dashpot else ""
    loss += "" if stop.pulls else " (never pulls)"
    return (
        f"stop {_place(stop)}: {stop.stiffness:.6g} {unit}, gap {stop.gap:g} {length}, "
        f"direction {stop.direction:+d}{loss}"
    )


def _describe_round(stop: RoundStop) -> str:
    """Say in a line where a round clearance is and what it does."""
    from nldyn.system.naming import quoted

    unit = "N/m" + ("" if stop.exponent == 1.0 else f"^{stop.exponent:g}")
    told = f"{'ring around' if stop.inside else 'pin beside'} {quoted(stop.plane)}"
    told += f" against {quoted(stop.against_plane)}" if stop.against_plane else ""
    law = f"{stop.stiffness:.6g} {unit}"
    if stop.restitution is not None:
        told, law = f"rigid {told}", f"restitution {stop.restitution:g}"
    told += f": {law}, clearance {stop.clearance:g} m"
    x, y = stop.eccentricity
    told += "" if stop.concentric else f", centre at {x:g}, {y:g} m"
    told += f", dissipation {stop.dissipation:g} s/m" if stop.dissipation else ""
    if not stop.friction:
        return told
    surface = f"a surface at {stop.surface_speed:g} m/s" if stop.surface_speed else "no turning"
    return f"{told}, friction {stop.friction:g} of {surface}"


def describe_spring(spring: AnySpring, length: str = "m") -> str:
    """Say in a line where a spring is and what it does; of a rotation the length is rad."""
    from nldyn.system.naming import moment_unit

    unit = f"{moment_unit(length)}/{length}"
    where = f"at '{spring.at}'" + (f" against '{spring.against}'" if spring.against else "")
    values = getattr(spring, "coefficients", None) or (getattr(spring, "stiffness", 0.0),)
    terms = [f"{k:.6g} {unit}" + (f"^{j}" if j > 1 else "") for j, k in enumerate(values, 1) if k]
    return f"spring {where}: {', '.join(terms) or f'0 {unit}'}"


def describe_sliders(system: System) -> list[str]:
    """A line for each slider, but those of areas of contact."""
    of_areas = _places_of_areas(system)
    return [
        describe_slider(slider, system.unit(slider.at))
        for slider in system.sliders
        if slider.stop not in of_areas
    ]


def describe_slider(slider: Slider, length: str = "m") -> str:
    """Say in a line where something slides, and what presses it on; of a rotation in rad."""
    from nldyn.system.naming import moment_unit

    law = slider.friction
    where = f"at '{slider.at}'" + (f" against '{slider.against}'" if slider.against else "")
    if slider.across is not None:
        where += f", over the plane with '{slider.across[0]}'"
        where += f" against '{slider.across[1]}'" if slider.across[1] else ""
    told = f"friction {where}: coefficient {_told_law(law, slider.across is not None, length)}"
    if slider.tangential_stiffness is not None:
        told += f", behind {slider.tangential_stiffness:.6g} {moment_unit(length)}/{length}"
    force = f"{slider.normal_force:.6g} {moment_unit(length)}"
    pressing = f"stop {slider.stop}" if slider.stop >= 0 else force
    return f"{told}, pressed on by {pressing}"


def _told_law(law: Friction, over_plane: bool, length: str = "m") -> str:
    """Coefficients of friction and the speeds of what it acts on, along one or two tangents."""
    told = f"{law.coefficient:.6g}"
    if law.adhesion:
        told += f", at rest {law.at_rest:.6g}, from which it "
        told += (
            f"falls over {law.fading_speed:.6g} {length}/s" if law.fading_speed else "drops at once"
        )
    if any(law.base_speeds):
        speeds = law.base_speeds if over_plane else law.base_speeds[:1]
        told += f", base at {' and '.join(f'{speed:.6g}' for speed in speeds)} {length}/s"
    return told


def _place(stop: AnyStop) -> str:
    return f"at '{stop.at}'" + (f" against '{stop.against}'" if stop.against else "")


def static_flexibility(system: System, interface: str) -> float:
    """Displacement in m, or rad, at an interface for 1 N, or 1 N m, there; inf if nothing holds."""
    import numpy as np

    phi = system.participation[interface]
    if system.springs:
        displaced = np.linalg.lstsq(system.stiffness, phi, rcond=None)[0]
        left = np.linalg.norm(system.stiffness @ displaced - phi)
        return float(phi @ displaced) if left <= 1e-9 * np.linalg.norm(phi) else float("inf")
    shares, squares = phi**2, system.natural_frequencies**2
    if any(shares[squares == 0.0] > 1e-18 * shares.max()):  # a free motion that it sees
        return float("inf")
    return float(sum(shares[squares > 0.0] / squares[squares > 0.0]))


def described_as_json(system: System) -> dict[str, object]:
    """Static flexibilities and stops of a system."""
    flexibilities: dict[str, dict[str, float]] = {}
    for name in told_interfaces(system):
        key = f"static_flexibility_{'rad_per_n_m' if name in system.rotations else 'm_per_n'}"
        flexibilities.setdefault(key, {})[name] = static_flexibility(system, name)
    return {
        **flexibilities,
        "stops": describe_stops(system),
        "friction": describe_sliders(system),
    }


def echo_parts(parts: Mapping[str, Any]) -> None:
    """What was read of each component of a scene."""
    import cms
    import fem

    for name, part in parts.items():
        if name:
            click.echo(f"component '{name}':")
        if isinstance(part, cms.Matrices):
            click.echo(f"matrices of {part.mass.shape[0]} degrees of freedom")
        else:
            click.echo(fem.summary(part))


def json_text(content: Mapping[str, object]) -> str:
    """Content as JSON; numbers that are not finite become null."""

    def plain(value: object) -> object:
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        if isinstance(value, Mapping):
            return {key: plain(each) for key, each in value.items()}
        return [plain(each) for each in value] if isinstance(value, list | tuple) else value

    return json.dumps(plain(content), indent=1, allow_nan=False)
