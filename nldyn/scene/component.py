"""From the mesh of a scene to a component."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import fem
from nldyn.base.errors import SceneError
from nldyn.base.resources import data_directory
from nldyn.scene.checks import check_mesh_names
from nldyn.scene.contact import check_one_mesh, with_areas
from nldyn.scene.described_parts import told_otherwise, with_described_parts
from nldyn.scene.faults import check_regular, told_as, unreadable
from nldyn.scene.messages import KeyPath, scene_error
from nldyn.scene.schema.loads import WeightTable
from nldyn.scene.schema.parts import BeamTable, PartTable, ShellTable, SolidTable, TrussTable
from nldyn.scene.schema.scene import Scene

AXES = ("x", "y", "z")
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}


def build_component(scene: Scene, refinement: int = 1) -> fem.Component:
    """Assemble the mesh of a scene.

    Parameters
    ----------
    scene : Scene
        A scene with a ``[mesh]``.
    refinement : int
        Cut every line of a structure of lines alone into this many.

    Returns
    -------
    fem.Component
        Sparse stiffness (N/m) and mass (kg), and the interfaces.

    Raises
    ------
    SceneError
        If the scene has no mesh, or the mesh is unreadable, empty or lacks a name used, or is of a
        structure and to be refined.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> list(build_component(load_scene(example("two_dof_xi_0.01.toml"))).interfaces)
    ['middle']
    """
    if scene.mesh is None:
        raise scene_error(scene.file, ("mesh",), "is missing: the structure is not given by a mesh")
    path, ignore = readable_path(scene, scene.mesh.file, ("mesh", "file")), scene.mesh.ignore
    with told_as(scene, ("mesh", "file"), fem.ModelError):
        mesh = _in_metres(scene, fem.read_mesh(path, _mesh_places(scene), ignore))
        if scene.mesh.merge:
            mesh = fem.joined([mesh], None if scene.mesh.merge is True else scene.mesh.merge)
        if scene.mesh.offset is not None:
            mesh = mesh.with_points(mesh.points + np.array(scene.mesh.offset))
    mesh = _noted(scene, _with_places(scene, mesh))
    described = with_described_parts(scene, mesh)
    with told_as(scene, ("mesh", "file"), fem.ModelError):
        check_mesh_names(described, mesh, scene.file)
    if refinement > 1:
        check_one_mesh(scene)
        with told_as(scene, ("mesh", "file"), fem.ModelError, hint=": --meshes"):
            mesh = fem.refined(mesh, refinement)
    with told_as(scene, (), fem.ModelError):
        component = fem.assemble(_model(described, mesh))
        whole = with_areas(scene, {"": _loaded(scene, component)})[""]
    assert isinstance(whole, fem.Component)
    return whole


def _loaded(scene: Scene, component: fem.Component) -> fem.Component:
    """The component with the load vectors that the excitation acts on."""
    for number, table in enumerate(scene.excitation):
        if table.load is None or table.load in component.interfaces:
            continue
        acceleration = [float(table.load == f"base {axis}") for axis in AXES]
        if isinstance(table, WeightTable):
            acceleration = table.acceleration
        with told_as(scene, ("excitation", number), fem.ModelError):
            component = component.with_load(table.load, acceleration)
    return component


def _in_metres(scene: Scene, mesh: fem.StructureMesh) -> fem.StructureMesh:
    """The mesh with its coordinates in m; what else a file holds cannot be converted."""
    assert scene.mesh is not None
    unit = scene.mesh.unit
    if mesh.unit and "unit" not in scene.mesh.model_fields_set:
        fault = f"states the unit {mesh.unit!r} for its coordinates: say in [mesh] which 'unit' to"
        raise scene_error(scene.file, ("mesh", "file"), f"{fault} take, 'm' if it is wrong")
    if unit == "m":
        return mesh
    if mesh.attachments.measured or scene.mesh.parts_from_file:
        fault = f"'{unit}' tells the unit of lengths alone, but masses, springs or parts are taken"
        raise scene_error(scene.file, ("mesh", "unit"), f"{fault} from the file, too")
    return mesh.with_points(METRES[unit] * mesh.points)


def _with_places(scene: Scene, mesh: fem.StructureMesh) -> fem.StructureMesh:
    """The mesh with the point sets of ``[places]``."""
    sets = {}
    for name, place in scene.places.items():
        with told_as(scene, ("places", name), fem.ModelError):
            if name in mesh.point_sets:
                raise fem.ModelError(f"{mesh.source}: has a point set of this name already")
            if place.at is not None:
                sets[name] = fem.node_at(mesh.points, place.at, mesh.source)
            else:
                assert place.box is not None
                sets[name] = fem.nodes_inside(mesh.points, place.box, mesh.source)
    return mesh.with_point_sets(sets) if sets else mesh


def _noted(scene: Scene, mesh: fem.StructureMesh) -> fem.StructureMesh:
    """The mesh with a note for each part that its file describes otherwise than the scene."""
    said: list[str] = told_otherwise(scene, mesh)
    return replace(mesh, notes=[*mesh.notes, *said]) if said else mesh


def _model(scene: Scene, mesh: fem.StructureMesh) -> fem.StructureModel:
    assert scene.mesh is not None
    return fem.StructureModel(
        mesh,
        parts={name: _part(table) for name, table in scene.parts.items()},
        supports=[fem.Support(s.at, tuple(s.fixed)) for s in scene.supports],
        point_masses=[
            fem.PointMass(m.at, m.mass, m.rotary_inertia, m.offset or (0.0, 0.0, 0.0))
            for m in scene.point_masses
        ],
        springs=[
            fem.PointSpring(s.at, s.direction, s.stiffness) for s in scene.mesh_springs.values()
        ],
        hinges=[fem.Hinge(h.at, h.part) for h in scene.hinges],
        couplings=[
            fem.Coupling(c.at, c.face, c.kind, c.place, tuple(c.directions))
            for c in scene.couplings
        ],
        foundations=[fem.Foundation(f.at, f.stiffness) for f in scene.foundations],
        interfaces={name: fem.Interface(i.at, i.direction) for name, i in scene.interfaces.items()},
        separate=scene.mesh.separate,
        pinned=scene.mesh.pinned,
        plane=scene.mesh.model == "frame",
    )


def _part(table: PartTable) -> fem.BeamPart | fem.TrussPart | fem.SolidPart | fem.ShellPart:
    if table._made is not None:
        made: fem.BeamPart | fem.TrussPart | fem.SolidPart | fem.ShellPart = table._made
        return made
    material = fem.Material(table.youngs_modulus, table.density, table.poissons_ratio)
    if isinstance(table, SolidTable):
        return fem.SolidPart(material, table.plane, table.thickness, table.integration)
    if isinstance(table, ShellTable):
        return fem.ShellPart(material, table.thickness, table.offset or 0.0)
    if isinstance(table, TrussTable):
        return fem.TrussPart(material, table.area)
    assert isinstance(table, BeamTable)
    return fem.BeamPart(
        material,
        _section(table),
        table.theory or "euler-bernoulli",
        table.axial_force or 0.0,
        table.orientation,
        table.offset or (0.0, 0.0),
    )


def _section(table: BeamTable) -> fem.CrossSection | fem.TaperedSection:
    sections: list[fem.RectangularSection | fem.CircularSection] = []
    for end in ("", "_end"):
        width, height, diameter, bore = (
            table.size(name, end) for name in ("width", "height", "diameter", "bore")
        )
        if width is not None and height is not None:
            sections.append(fem.RectangularSection(width, height))
        elif diameter is not None:
            sections.append(fem.CircularSection(diameter, bore or 0.0))
    if table.taper is not None:
        return fem.TaperedSection(sections[0], sections[1], table.taper[0], table.taper[1])
    if sections:
        return sections[0]
    assert table.area is not None and table.second_moment is not None
    return fem.Section(
        table.area,
        table.second_moment,
        table.second_moment_across,
        table.torsion_constant,
        table.shear_area,
        table.shear_area_across,
    )


def readable_path(scene: Scene, name: str, key: KeyPath) -> Path:
    """Where a file that a key names is: one that can be read, where files may come from.

    Raises
    ------
    SceneError
        If it is elsewhere, or cannot be read.
    """
    path = scene.file.parent / name
    try:
        real = path.resolve()
        if not any(real.is_relative_to(place) for place in _mesh_places(scene)):
            advice = f"if that is meant, allow it with --mesh-folder {real.parent}"
            if not real.is_file():
                advice = "there is no such file: copy it beside the scene"
            fault = f"leads to {real}, outside the folder of the scene and the current one"
            raise scene_error(scene.file, key, f"{fault}; {advice}")
        check_regular(path)
        path.open("rb").close()
    except SceneError:
        raise
    except (OSError, ValueError, RuntimeError) as error:  # the last one of links in a circle
        fault = f"names {path}, which {unreadable(error)}"
        raise scene_error(scene.file, key, fault) from None
    return path


def _mesh_places(scene: Scene) -> list[Path]:
    """Folders below which the mesh of a scene may be: those asked for, and the package's own."""
    return [*scene.mesh_folders, (data_directory() / "meshes").resolve()]
