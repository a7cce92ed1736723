"""Checks of a scene that need two of its tables, or its mesh, at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nldyn.base.errors import SceneError, must_be_symmetric
from nldyn.scene.messages import KeyPath, joined, scene_error, show, unknown_name
from nldyn.scene.schema.contacts import ALONG, ListedAreaTable, MeshAreaTable
from nldyn.scene.schema.loads import BaseTable
from nldyn.scene.schema.parts import BeamTable, ShellTable, SolidTable
from nldyn.scene.schema.scene import Scene
from nldyn.scene.schema.table import Matrix
from nldyn.system.system import NOT_HELD, System

SOUND = (10.0, 3e4)  # speeds in m/s, below those of soft rubber and above that of diamond

Report = Callable[[KeyPath, str], SceneError]
MANY_OSCILLATIONS = 1000.0  # in a period: 1700 take four times as long as 170
LONGEST_NAME, LONGEST_TITLE = 100, 1000
NAMED_BY = (
    "the file has no names; they are physical groups in .msh, arrays 'set:NAME' in .vtu and .vtk,"
    " groups in .med, ELSET and NSET in .inp files, and points may have coordinates in [places]"
)
MESH_ONLY = (
    *("parts", "supports", "point_masses", "springs", "hinges"),
    *("couplings", "foundations", "interfaces", "reduction"),
)


class TaggedMesh(Protocol):
    """What the checks need of a mesh: its groups of cells, and all its names."""

    @property
    def groups(self) -> Mapping[str, object]:
        """Cells by name."""

    @property
    def names(self) -> list[str]:
        """All names that stand for nodes."""

    def nodes(self, name: str) -> NDArray[np.int64]:
        """The nodes of a name."""


def check_scene(scene: Scene, file: Path) -> None:
    """Check what joins the tables of a scene; raise `SceneError` at the first fault."""

    def report(key: KeyPath, fault: str) -> SceneError:
        return scene_error(file, key, fault)

    _check_names(scene, report)
    _check_structure(scene, report)
    _check_modal(scene, report)
    _check_matrices(scene, report)
    if scene.mesh is not None and scene.mesh.offset is not None:
        fault = "is for a component of several: nothing depends on where a structure alone lies"
        raise report(("mesh", "offset"), fault)
    _check_components(scene, file)
    _check_joints(scene, report)
    _check_interface_names(scene, report)
    _check_absolute(scene, report)
    _check_areas(scene, report)
    _check_perpendicular(scene, report)
    _check_seeds(scene, report)
    _check_explore(scene, report)


def check_mesh_names(scene: Scene, mesh: TaggedMesh, file: Path) -> None:
    """Check that the scene and the mesh agree on the names of parts and places."""
    assert scene.mesh is not None
    source = scene.mesh.file
    _check_known(scene, mesh, file)
    for key, name in _points_used(scene):
        count = len(mesh.nodes(name)) if name in mesh.names else 1
        if count > 1 and key[0] != "supports" and key != ("mesh", "mirror"):
            fault = f"'{name}' must be a single point, but holds {count} nodes of the mesh {source}"
            raise scene_error(file, key, fault)
    _check_interfaces_free(scene, file)
    if scene.mesh.mirror is not None:
        _check_mirror(scene, scene.mesh.mirror, file)
    for number, hinge in enumerate(scene.hinges):
        key = ("hinges", number, "part")
        _require(hinge.part, mesh.groups, f"a part of the mesh {source}", file, key)


def _check_known(scene: Scene, mesh: TaggedMesh, file: Path) -> None:
    """Refuse all names that the mesh does not have: of parts, and of what is used of it."""
    assert scene.mesh is not None
    source = scene.mesh.file
    known = dict.fromkeys([*mesh.names, *(coupling.at for coupling in scene.couplings)])
    what = f"a point or face of the mesh {source}, of [places] or of [[couplings]]"
    faults: list[tuple[KeyPath, str]] = []
    for name in scene.parts:
        if name not in mesh.groups:
            fault = _not_in_mesh(name, mesh.groups, f"a part of the mesh {source}")
            faults.append((("parts", name), fault.removeprefix(f"'{name}' ")))
    used = (*_points_used(scene), *_faces_used(scene))
    faults += [(key, _not_in_mesh(name, known, what)) for key, name in used if name not in known]
    if faults:
        raise scene_error(file, *joined(faults))


def check_computable(scene: Scene, file: Path) -> None:
    """Check that the scene says what excites the structure and which range to follow.

    Motions that excite themselves are followed over a parameter.
    """
    if scene.self_excited:
        _check_self_excited(scene, file)
    elif not scene.driven:
        fault = "is missing: nothing moves the structure"
        if scene.excitation:
            fault = "is constant: there is no branch to follow, but 'nldyn simulate' takes it"
        if any(any(table.of_coulomb.base_speeds) for table in scene.friction):
            fault += (
                "; motions that excite themselves are followed over the 'range' of a 'parameter' "
                "of [continuation], such as 'friction.0.base_speed'"
            )
        raise scene_error(file, ("excitation",), fault)
    for number, table in enumerate(scene.excitation):
        if not table.periodic:
            fault = "leaves no motion a period, so that no branch can be followed: simulate it by "
            wanted = "'nldyn simulate', or let both be multiples 'harmonic' of a lower frequency, "
            rest = "nearly (5 and 7 for a ratio of 1.4)"
            raise scene_error(file, ("excitation", number, "frequency_hz"), fault + wanted + rest)
    if scene.continuation is None:
        fault = "is missing: give the frequency range, range_hz = [lowest, highest]"
        raise scene_error(file, ("continuation",), fault)


def _check_self_excited(scene: Scene, file: Path) -> None:
    """Refuse what counts periods of an excitation, or needs its frequency, where there is none."""
    fault = "is of no use where nothing excites the structure, whose frequency is found; leave it"
    assert scene.continuation is not None
    for key in ("frequency_hz", "periods", "follow_doublings", "events"):
        if key in scene.continuation.model_fields_set:
            raise scene_error(file, ("continuation", key), f"{fault} out")
    for table in ("subharmonics", "explore"):
        if getattr(scene, table):
            raise scene_error(file, (table,), f"{fault} out")


def only_simulated(scene: Scene) -> bool:
    """Whether a scene is meant for ``nldyn simulate``: no range, and loads that have no period."""
    several = any(not table.periodic for table in scene.excitation)
    begun = bool(scene.excitation) or scene.start is not None
    return scene.continuation is None and begun and (several or not scene.driven)


def check_held_to_follow(scene: Scene, system: System) -> None:
    """Refuse a structure that nothing holds, whose branches cannot be followed."""
    if system.left_free and system.circulatory is None:
        fault = f"{NOT_HELD}: hold it by a support, a spring or a stop, or simulate it"
        raise scene_error(scene.file, (), fault)


def remarks(scene: Scene, system: System) -> list[str]:
    """Say what is possible but looks like a mistake in the units, or takes long."""
    beyond = _range_remark(scene, float(system.frequencies_hz.max()))
    slow = _slow_remarks(scene, system)
    odd = *_material_remarks(scene), *([beyond] if beyond else []), *_unknown_rides(scene)
    return [*odd, *_unused(scene), *slow]


def _unknown_rides(scene: Scene) -> Iterator[str]:
    """Name what ties two places of which nobody knows how a moving base carries them."""
    if scene.modal is None or not any(table.kind == "base" for table in scene.excitation):
        return
    for table, number, at, against in scene.ties:
        yield (
            f"{table}[{number}]: displacements are relative to the base, and modes do not tell "
            f"whether it carries '{at}' and '{against}' alike, as it must"
        )


def _unused(scene: Scene) -> Iterator[str]:
    """Name what a search for branches passes over."""
    if scene.start is not None and scene.continuation is not None and not scene.self_excited:
        yield "[start] is for 'nldyn simulate': branches do not depend on where a motion begins"


def _slow_remarks(scene: Scene, system: System) -> Iterator[str]:
    """Name what makes a computation many times as long, or endless."""
    if scene.continuation is None or scene.self_excited or system.left_free:
        return
    if system.conservative:
        yield (
            "nothing takes energy out, for there is neither a damper nor [damping] of a mode above "
            "0 Hz: motions do not settle, and 'nldyn run' takes many times as long as with damping"
        )
    lowest, highest = scene.continuation.frequencies_hz[0], float(system.frequencies_hz.max())
    where = ", where range_hz begins," if scene.continuation.range_hz else ""
    if highest > MANY_OSCILLATIONS * lowest:
        yield (
            f"one period at {lowest:g} Hz{where} holds {highest / lowest:.0f} "
            f"oscillations of the mode at {highest:.4g} Hz, and the time that a branch takes grows "
            "with their number: keep fewer modes, or begin higher"
        )


def _material_remarks(scene: Scene) -> Iterator[str]:
    """Name parts in which sound is slower or faster than in any material."""
    for name, part in scene.parts.items():
        speed = math.sqrt(part.youngs_modulus / part.density)
        if not SOUND[0] < speed < SOUND[1]:
            yield (
                f"in [parts.{name}] sound would travel at {speed:.2g} m/s: youngs_modulus is in "
                "N/m^2, density in kg/m^3"
            )


def _range_remark(scene: Scene, highest_hz: float) -> str:
    """Say that the range goes beyond the modes that are kept; empty if it does not."""
    if scene.reduction is None or scene.continuation is None or scene.self_excited:
        return ""
    top = scene.continuation.frequencies_hz[1]
    if top <= highest_hz:
        return ""
    named = "range_hz goes up to" if scene.continuation.range_hz else "frequency_hz is"
    return (
        f"{named} {top:g} Hz, but the model of the structure to {highest_hz:.4g} Hz "
        "only: keep more modes, or check the units"
    )


def check_ratio_count(scene: Scene, count: int, file: Path) -> None:
    """Check that a list of damping ratios has one entry for each of ``count`` modes."""
    ratios = scene.damping.modal_ratio
    if isinstance(ratios, list) and len(ratios) != count:
        fault = f"has {len(ratios)} entries for a model with {count} modes"
        raise scene_error(file, ("damping", "modal_ratio"), fault)


def _check_interfaces_free(scene: Scene, file: Path) -> None:
    held = {(support.at, direction) for support in scene.supports for direction in support.fixed}
    for name, interface in scene.interfaces.items():
        if (interface.at, interface.direction) in held:
            fault = f"'{interface.direction}' is held by a support at '{interface.at}'"
            raise scene_error(file, ("interfaces", name, "direction"), fault)


def _check_mirror(scene: Scene, name: str, file: Path) -> None:
    assert scene.mesh is not None
    held = {
        "rotation_z" if d == "rotation" else d
        for s in scene.supports
        if s.at == name
        for d in s.fixed
    }
    planes = [{axis, *(f"rotation_{other}" for other in "xyz" if other != axis)} for axis in "xyz"]
    planes += [{"x"}, {"y"}, {"z"}]  # of solids, whose nodes do not turn
    told = "one of 'x', 'y' and 'z' and, but for solids, the rotations about the other two"
    if scene.mesh.model == "frame":
        planes = [{"x", "rotation_z"}, {"y", "rotation_z"}]
        told = "['x', 'rotation'] or ['y', 'rotation']"
    if held not in planes:
        fault = f"'{name}' is not on a plane of symmetry, where [[supports]] fix {told} and no more"
        raise scene_error(file, ("mesh", "mirror"), fault)


def _check_names(scene: Scene, report: Report) -> None:
    """Refuse names that cannot be printed, or fill the screen."""
    if len(scene.title) > LONGEST_TITLE or not scene.title.replace("\n", " ").isprintable():
        fault = f"must be at most {LONGEST_TITLE} letters that can be printed, and ends of lines"
        raise report(("title",), fault)
    tables: dict[KeyPath, Iterable[str]] = {("parts",): scene.parts}
    if scene.modal is not None:
        tables["modal", "participation"] = scene.modal.participation
    if scene.matrices is not None:
        tables["matrices", "interfaces"] = scene.matrices.interfaces
    tables[("interfaces",)] = scene.interfaces
    for key, names in tables.items():
        for name in names:
            _check_name((*key, name), name, report)
    for number, coupling in enumerate(scene.couplings):
        _check_name(("couplings", number, "at"), coupling.at, report)


def _check_name(key: KeyPath, name: str, report: Report) -> None:
    if not 0 < len(name) <= LONGEST_NAME or not name.isprintable():
        fault = f"must be a name of 1 to {LONGEST_NAME} letters that can be printed"
        raise report(key, fault)


def _check_structure(scene: Scene, report: Report) -> None:
    every = ("mesh", "modal", "matrices", "components")
    kinds = [kind for kind in every if getattr(scene, kind)]
    if not kinds:
        wanted = "one of [mesh], [modal], [matrices] and [components.NAME]"
        raise report((), f"gives no structure; it needs {wanted}")
    if len(kinds) > 1:
        raise report((kinds[1],), f"cannot stand beside [{kinds[0]}]; keep one of them")
    if scene.mesh is None:
        for key in MESH_ONLY:
            given = scene.mesh_springs if key == "springs" else getattr(scene, key)
            if given and kinds[0] == "components":
                raise report((key,), f"must be in a component, as [components.NAME.{key}]")
            if given and (key, kinds[0]) != ("reduction", "matrices"):
                raise report(
                    (key,), f"describes a mesh, but the structure is given by [{kinds[0]}]"
                )
        return
    named = () if scene.mesh.parts_from_file == "all" else scene.mesh.parts_from_file
    twice = [name for name in named if name in scene.parts]
    if twice:
        fault = f"names '{twice[0]}', which [parts] gives, too; keep one of them"
        raise report(("mesh", "parts_from_file"), fault)
    for key in ("parts", "interfaces", "reduction"):
        if not getattr(scene, key) and not (key == "parts" and scene.mesh.parts_from_file):
            raise report((key,), "is missing: a mesh needs it")
    for name, part in scene.parts.items():
        in_space = isinstance(part, ShellTable) or (
            isinstance(part, SolidTable) and part.plane is None
        )
        if in_space and scene.mesh.model == "frame":
            fault = f"'{part.kind}' needs [mesh] with model = 'structure'"
            raise report(("parts", name, "kind"), fault)


def _check_components(scene: Scene, file: Path) -> None:
    """Check each component as a structure of its own, and its names."""
    for name, part in scene.component_scenes.items():
        here: KeyPath = ("components", name)

        def report(key: KeyPath, fault: str, here: KeyPath = here) -> SceneError:
            return scene_error(file, (*here, *key), fault)

        _check_name((), name, report)
        if "." in name:
            raise report((), "must be a name without a dot")
        _check_names(part, report)
        if part.mesh is None and part.matrices is None:
            raise report((), "gives no structure; it needs a [mesh] or [matrices] of its own")
        _check_structure(part, report)
        _check_matrices(part, report)
        if part.mesh is not None and part.mesh.mirror is not None:
            raise report(
                ("mesh", "mirror"), "is for a single component; several are drawn as they are"
            )
        if part.reduction is not None and part.reduction.tolerance is not None:
            fault = "is for a single component; give 'modes' or 'cutoff_hz'"
            raise report(("reduction", "tolerance"), fault)
        for number, spring in part.interface_springs.items():
            fault = f"acts at an interface: give it in [[springs]] of the scene, at '{name}."
            raise report(("springs", number), f"{fault}{spring.at}'")


def _check_joints(scene: Scene, report: Report) -> None:
    """Check that joints name interfaces which can move as one, each pair once."""
    if scene.joints and not scene.components:
        raise report(("joints",), "needs [components.NAME], which it joins")
    known, turning = scene.interface_names, _rotations(scene)
    seen: dict[frozenset[str], int] = {}
    for number, joint in enumerate(scene.joints):
        for key, end in zip(("at", "against"), joint.joined, strict=False):
            component, dot, _ = end.partition(".")
            if dot and component not in scene.components:
                fault = unknown_name(component, scene.components, "a component")
                raise report(("joints", number, key), fault)
            if end not in known:
                raise report(("joints", number, key), unknown_name(end, known, "an interface"))
        if len({turning[end] for end in joint.joined if end in turning}) > 1:
            turns = next(end for end in joint.joined if turning[end])
            other = next(end for end in joint.joined if not turning[end])
            fault = f"joins '{turns}', a rotation, to '{other}', a displacement"
            raise report(("joints", number), fault)
        pair = frozenset(joint.joined)
        if pair in seen:
            raise report(("joints", number), f"joins what joints[{seen[pair]}] joins already")
        seen[pair] = number


def _rotations(scene: Scene) -> dict[str, bool]:
    """Whether each interface whose direction is known is a rotation."""
    return {
        f"{name}.{at}": interface.direction.startswith("rotation")
        for name, part in scene.components.items()
        for at, interface in part.interfaces.items()
    }


def _check_modal(scene: Scene, report: Report) -> None:
    if scene.modal is None:
        return
    count = len(scene.modal.frequencies_hz)
    for name, values in scene.modal.participation.items():
        _check_length(values, count, "mode", ("modal", "participation", name), report)


def _check_matrices(scene: Scene, report: Report) -> None:
    """Check the matrices and vectors that are typed in; those in files are checked when read."""
    table = scene.matrices
    if table is None:
        return
    for name in ("gyroscopic", "circulatory"):
        skew = getattr(table, name)
        if skew is not None and scene.reduction is not None and scene.reduction.tolerance:
            fault = f"knows no matrices.{name}; give 'modes' or 'cutoff_hz' instead"
            raise report(("reduction", "tolerance"), fault)
        if isinstance(skew, list):
            _check_skew(skew, ("matrices", name), report)
        turning = getattr(table.spin, name, None)
        if isinstance(turning, list):
            _check_skew(turning, ("matrices", "spin", name), report)
    if table.spin is not None and scene.reduction is not None and scene.reduction.tolerance:
        fault = "knows no matrices.spin; give 'modes' or 'cutoff_hz' instead"
        raise report(("reduction", "tolerance"), fault)
    mass, typed = table.mass, {}
    for key in ("mass", "stiffness", "damping"):
        matrix = getattr(table, key)
        if isinstance(matrix, list):
            typed[key] = matrix
    if isinstance(mass, list):
        count = len(mass)
        for row in mass:
            if len(row) != count:
                fault = f"must be square, but has {_counted(count, 'row')} and one of "
                raise report(("matrices", "mass"), fault + _counted(len(row), "number"))
        for key, matrix in typed.items():
            _check_symmetric(matrix, count, ("matrices", key), report)
        if np.linalg.eigvalsh(np.array(mass))[0] <= 0:
            raise report(("matrices", "mass"), "must be positive definite")
    for kind in ("interfaces", "loads"):
        for name, values in getattr(table, kind).items():
            if isinstance(values, list) and isinstance(mass, list):
                key_path = ("matrices", kind, name)
                _check_length(values, len(mass), "degree of freedom", key_path, report)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _check_symmetric(matrix: Matrix, count: int, key: KeyPath, report: Report) -> None:
    if len(matrix) != count or any(len(row) != count for row in matrix):
        size = f"{_counted(count, 'row')} of {_counted(count, 'number')}"
        raise report(key, f"must have {size}, like the mass matrix")
    values = np.array(matrix)
    if not np.allclose(values, values.T, rtol=1e-9, atol=1e-12 * np.abs(values).max()):
        raise report(key, must_be_symmetric(str(key[-1])))


def _check_skew(matrix: Matrix, key: KeyPath, report: Report) -> None:
    if any(len(row) != len(matrix) for row in matrix):
        raise report(key, "must be square")
    values = np.array(matrix)
    if not np.allclose(values, -values.T, rtol=1e-9, atol=1e-12 * np.abs(values).max()):
        raise report(key, "must be skew: its transpose must be minus itself")


def _check_length(values: list[float], count: int, unit: str, key: KeyPath, report: Report) -> None:
    if len(values) != count:
        fault = f"must have {_counted(count, 'number')}, one per {unit}, not {show(values)}"
        raise report(key, fault)
    if not any(values):
        raise report(key, "must not be zero throughout: nothing could move there")


def _check_interface_names(scene: Scene, report: Report) -> None:
    faults = [
        (key, _not_an_interface(scene, key, name))
        for key, name in _interfaces_used(scene)
        if name not in scene.interface_names
        and not (key[0] == "excitation" and name in scene.load_names)
    ]
    if faults:
        raise report(*joined(faults))
    for number, table in enumerate(scene.excitation):
        if isinstance(table, BaseTable) and table.at in scene.interface_names:
            fault = f"'{table.at}' is an interface, and a base needs a load vector M r of the whole"
            fault += "; a single stop that moves is three loads (docs/how-to/loads.md)"
            raise report(("excitation", number, "at"), fault)
        if table.load is None:
            continue
        if scene.components:
            _check_load_of_all(scene, number, table.load, report)
            continue
        if scene.mesh is None:
            wanted = "a [mesh]; give 'loads' of the matrices and name one of them in 'at'"
            raise report(("excitation", number, "kind"), f"'{table.kind}' needs {wanted}")
        if table.load in scene.interfaces:
            raise report(("interfaces", table.load), "is the name of a load vector; rename it")


def _not_an_interface(scene: Scene, key: KeyPath, name: str) -> str:
    if key[0] == "excitation" and scene.load_names:
        known = [*scene.interface_names, *scene.load_names]
        return unknown_name(name, known, "an interface or load vector")
    at_mesh = key[0] == "springs" and scene.mesh is not None
    hint = "; a spring at a point of the mesh needs a 'direction'" if at_mesh else ""
    return unknown_name(name, scene.interface_names, "an interface") + hint


def _check_load_of_all(scene: Scene, number: int, load: str, report: Report) -> None:
    """Check that all components are of meshes, where a load acts on the whole of each."""
    for name, part in scene.components.items():
        if part.mesh is None:
            fault = f"acts on meshes only, but component '{name}' is given by matrices: give it"
            wanted = f"{fault} a vector in its 'loads' and name the load of each component in 'at'"
            raise report(("excitation", number), wanted)
        if load in part.interfaces:
            fault = "is the name of a load vector; rename it"
            raise report(("components", name, "interfaces", load), fault)


def _check_absolute(scene: Scene, report: Report) -> None:
    """Check that there is a base that moves, where absolute displacements are asked for."""
    if scene.observe is None or not scene.observe.absolute:
        return
    if not any(table.kind == "base" for table in scene.excitation):
        raise report(("observe", "absolute"), "needs an [[excitation]] of kind 'base'")
    if scene.modal is not None:
        fault = "needs a mesh or matrices: modes do not tell how the structure moves as a whole"
        raise report(("observe", "absolute"), fault)
    if scene.reduction is not None and scene.reduction.tolerance is not None:
        fault = "does not go with reduction.tolerance; give 'modes' or 'cutoff_hz'"
        raise report(("observe", "absolute"), fault)


def _check_areas(scene: Scene, report: Report) -> None:
    """Refuse areas of a mesh where there is none, or where the modes are chosen by a tolerance."""
    for number, area in enumerate(scene.contact_areas):
        if not isinstance(area, MeshAreaTable):
            continue
        key = ("contact_areas", number, "at")
        if scene.components:
            _check_area_of_components(scene, number, area, report)
            continue
        if scene.mesh is None:
            raise report(key, "names a set of a mesh, and there is no [mesh]: list interfaces")
        if scene.reduction is not None and scene.reduction.tolerance is not None:
            fault = "does not go with reduction.tolerance; give 'modes' or 'cutoff_hz'"
            raise report(key, fault)
        named = () if scene.reduction is None else scene.reduction.massless
        if area.law == "rigid" and area.called not in named:
            fault = (
                'is rigid, which needs points without mass: method = "macneal" and '
                f"massless = ['{area.called}'] in [reduction]"
            )
            raise report(("contact_areas", number, "law"), fault)


def _check_perpendicular(scene: Scene, report: Report) -> None:
    """Refuse tangents along the normal or each other, where directions are known."""
    for key, name, others in _perpendicular(scene):
        axis = scene.direction_at(name)
        for other in others:
            if axis and axis == scene.direction_at(other):
                fault = f"'{name}' lies along '{axis}' as '{other}', and must be perpendicular"
                raise report(key, fault)


def _perpendicular(scene: Scene) -> Iterator[tuple[KeyPath, str, list[str]]]:
    """Where an interface is named, and those that it must be perpendicular to."""
    for number, rough in enumerate(scene.friction):
        by_stop = rough.stop is not None and rough.stop < len(scene.stops)
        normal = [scene.stops[rough.stop or 0].at] if by_stop else []
        yield ("friction", number, "at"), rough.at, normal
        if rough.second_tangent is not None:
            second = ("friction", number, "second_tangent")
            yield second, rough.second_tangent, [rough.at, *normal]
    for number, ring in enumerate(scene.round_clearances):
        yield ("round_clearances", number, "plane"), ring.plane[1], [ring.plane[0]]
    for number, area in enumerate(scene.contact_areas):
        if isinstance(area, ListedAreaTable):
            others = [area.at]
            for key in ("along", "second_along"):
                named = getattr(area, key) or []
                for name, *before in zip(named, *others, strict=False):
                    yield ("contact_areas", number, key), name, before
                others.append(named)


def _check_area_of_components(
    scene: Scene, number: int, area: MeshAreaTable, report: Report
) -> None:
    """Refuse sets that are not "component.set" of a component with a mesh."""
    for key in ("at", "against"):
        component, dot, _ = (getattr(area, key) or "").partition(".")
        if getattr(area, key) is None:
            continue
        place = ("contact_areas", number, key)
        if not dot:
            raise report(place, "must name a component and a set of its mesh: 'component.set'")
        if component not in scene.components:
            raise report(place, unknown_name(component, scene.components, "a component"))
        if scene.components[component].mesh is None:
            fault = f"names a set of a mesh, and component '{component}' has none: list interfaces"
            raise report(place, fault)


def _check_seeds(scene: Scene, report: Report) -> None:
    if scene.continuation is None:
        return
    low, high = scene.continuation.limits
    own, other, key = ("near_hz", "near", "range_hz")
    if scene.continuation.range_hz is None:
        own, other, key = ("near", "near_hz", "range")
    for number, seed in enumerate(scene.subharmonics):
        near = getattr(seed, own)
        if near is None or getattr(seed, other) is not None:
            raise report(("subharmonics", number), f"needs '{own}', and no '{other}'")
        if not low <= near <= high:
            fault = f"must lie within continuation.{key}, not at {near:g}"
            raise report(("subharmonics", number, own), fault)


def _check_explore(scene: Scene, report: Report) -> None:
    """Refuse beside [explore] what says where to look."""
    if scene.explore is None:
        return
    if scene.subharmonics:
        raise report(("subharmonics",), "is of no use beside [explore]; keep one of them")
    if scene.continuation is not None:
        for key in ("periods", "follow_doublings", "search_points"):
            if key in scene.continuation.model_fields_set:
                raise report(("continuation", key), "is of no use beside [explore]; keep one")


def _interfaces_used(scene: Scene) -> Iterable[tuple[KeyPath, str]]:
    for table in ("dampers", "stops", "friction", "excitation"):
        for number, entry in enumerate(getattr(scene, table)):
            if getattr(entry, "at", None) is not None:
                yield (table, number, "at"), entry.at
    for number, spring in scene.interface_springs.items():
        yield ("springs", number, "at"), spring.at
    for kind in ("stops", "friction", "dampers", "springs"):
        for number, entry in enumerate(getattr(scene, kind)):
            if getattr(entry, "against", None) is not None:
                yield (kind, number, "against"), entry.against
    for number, rough in enumerate(scene.friction):
        for key in ("second_tangent", "second_tangent_against"):
            if getattr(rough, key) is not None:
                yield ("friction", number, key), getattr(rough, key)
    for number, area in enumerate(scene.contact_areas):
        if isinstance(area, ListedAreaTable):
            for key in ("at", "against", *ALONG):
                named = getattr(area, key) or ()
                yield from ((("contact_areas", number, key), name) for name in named)
    for number, around in enumerate(scene.round_clearances):
        for key, names in (("plane", around.plane), ("against", around.against or ())):
            yield from ((("round_clearances", number, key), name) for name in names)
    if scene.observe is not None:
        yield ("observe", "at"), scene.observe.at
    if scene.start is not None:
        for kind in ("displacements", "velocities"):
            yield from ((("start", kind, name), name) for name in getattr(scene.start, kind))


def _points_used(scene: Scene) -> Iterable[tuple[KeyPath, str]]:
    for number, spring in scene.mesh_springs.items():
        yield ("springs", number, "at"), spring.at
    for table in ("supports", "point_masses", "hinges"):
        for number, entry in enumerate(getattr(scene, table)):
            yield (table, number, "at"), entry.at
    for name, interface in scene.interfaces.items():
        yield ("interfaces", name, "at"), interface.at
    for name, part in scene.parts.items():
        if isinstance(part, BeamTable):
            yield from ((("parts", name, "taper"), point) for point in part.taper or ())
    if scene.mesh is not None and scene.mesh.mirror is not None:
        yield ("mesh", "mirror"), scene.mesh.mirror


def _faces_used(scene: Scene) -> Iterable[tuple[KeyPath, str]]:
    for number, coupling in enumerate(scene.couplings):
        yield ("couplings", number, "face"), coupling.face
    for number, foundation in enumerate(scene.foundations):
        yield ("foundations", number, "at"), foundation.at


def _require(name: str, known: Mapping[str, object], what: str, file: Path, key: KeyPath) -> None:
    if name not in known:
        raise scene_error(file, key, _not_in_mesh(name, known, what))


def _not_in_mesh(name: str, known: Mapping[str, object], what: str) -> str:
    """Say that a name is not among those of a mesh and, if that has none, what gives it names."""
    fault = unknown_name(name, known, what)
    return fault if known else f"{fault} ({NAMED_BY})"
