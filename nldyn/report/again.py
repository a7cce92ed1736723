"""The report of results that were written before, or of a run that has not ended."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import cms
from fem.render.gl import missing_library
from fem.render.several import Several
from nldyn.base.errors import SceneError, SystemModelError
from nldyn.branches.branch import Branch
from nldyn.io.store import load
from nldyn.report.answer import answer_lines
from nldyn.report.contact import contact_figure
from nldyn.report.offline import Table, unpacked
from nldyn.report.page import Drawn, write_page
from nldyn.report.results import FILES, software_name, summary, tables_of
from nldyn.report.stop_spheres import stops_to_draw
from nldyn.runtime.progress import Progress, silent
from nldyn.runtime.result_directory import SCENE, OutputError, result_directory
from nldyn.runtime.unfinished import unfinished_path
from nldyn.scene.build import AnyComponent, Structure, build_structure, build_system
from nldyn.scene.read import load_scene
from nldyn.scene.schema.scene import Scene
from nldyn.search.diagram import Diagram
from nldyn.search.exploration import Exploration
from nldyn.system.system import same_system

TEXTS = {"branch", "type", "normal_form", "meaning", "end", "reason"}
UNFINISHED = "The run has not ended: this is what it had computed."
SAME = 1e-9  # relative difference of the frequencies of modes that are the same


def drawn_of(scene: Scene | None, structure: Structure) -> Drawn | None:
    """The structure of a scene to be shown deflected, or what of it is of a mesh."""
    if scene is None or structure.reduced is None:
        return None
    stops = stops_to_draw(scene)
    if scene.components:
        drawn = _drawn_parts(structure.parts, structure.reduced)
        return drawn and replace(drawn, stops=stops)
    component = structure.component
    if scene.mesh is None or component is None or isinstance(component, cms.Matrices):
        return None
    return Drawn(component, structure.reduced, scene.mesh.mirror, stops)


def _drawn_parts(parts: Mapping[str, AnyComponent], reduced: cms.ReducedModel) -> Drawn | None:
    """Those of several components that are of meshes, with their rows of the reduced model."""
    meshes = {n: part for n, part in parts.items() if not isinstance(part, cms.Matrices)}
    if not meshes:
        return None
    rows = np.concatenate([np.arange(*reduced.components[name]) for name in meshes])
    shown = replace(reduced, basis=reduced.basis[rows], residual_shapes=None, components={})
    return Drawn(Several(meshes), shown)


def report_again(
    directory: str | Path,
    scene: Scene | None = None,
    mesh_folders: Iterable[str | Path] = (),
    progress: Progress = silent,
) -> list[str]:
    """Write ``report.html`` into a directory of results, or beside an unfinished run.

    Parameters
    ----------
    directory : str or Path
        What ``nldyn run --out`` was given.
    scene : Scene, optional
        What was computed; by default the copy in the directory, whose mesh may not be found.
    mesh_folders : iterable of str or Path
        Folders from which the mesh of that copy may come.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.

    Returns
    -------
    list of str
        What is said in the page beside the notes of the diagram.

    Raises
    ------
    OutputError
        If there are no results.
    SystemModelError
        If their file cannot be read, or the scene is not theirs.
    """
    folder, kept = Path(directory), unfinished_path(directory)
    file = folder / "branches.h5"
    finished = file.is_file()
    if not finished and not kept.is_file():
        raise OutputError(f"{directory}: holds no results of 'nldyn run', finished or unfinished")
    progress("reading", 0.0, 0.0)
    diagram = as_diagram(load(file if finished else kept))
    copy = folder / "scene.toml"
    if scene is None and copy.is_file() and finished:
        scene = load_scene(copy, mesh_folders)
    drawn, notes = drawn_again(scene, diagram)
    surface: Mapping[str, Any] | None = drawn.surface if drawn else None
    if surface is None and notes:
        surface = kept_surface(folder / "report.html", diagram)
    if surface is not None:
        notes = []
    if not finished:
        notes = [UNFINISHED, *notes]
    progress("tables", 0.0, 0.3)
    tables = read_tables(folder) if finished else tables_of(diagram)
    told = read_summary(folder) if finished else summary(diagram)
    if "answer" not in told:  # written before, or not yet
        told["answer"] = answer_lines(diagram, tables["special_points"])
    progress("orbits", 0.0, 0.6)
    with result_directory(directory, "report") as new:
        page = new / "report.html"
        write_page(
            diagram, page, tables, told, contact=contact_figure(diagram, scene), scene=scene,
            surface=surface, notes=notes,
        )  # fmt: skip
    return notes


def computed_before(
    directory: Path, scene: Scene, structure: Structure
) -> Diagram | Exploration | None:
    """What a directory holds of this very scene, finished; None if it is to be computed.

    The scene counts word for word, and what its files made of it: the system is compared.
    """
    try:
        text = (directory / SCENE).read_text(encoding="utf-8")
        if text != scene.text or read_summary(directory)["software"] != software_name():
            return None
        system = build_system(scene, structure.reduced)
        found = load(directory / "branches.h5")
        kept = as_diagram(found)
    except (OSError, KeyError, OutputError, SystemModelError):
        return None
    if not kept.branches or not same_system(kept.branches[0].nodes[0].family.system, system):
        return None
    return found if isinstance(found, Exploration) else kept


def kept_surface(page: Path, diagram: Diagram) -> Mapping[str, Any] | None:
    """The structure that the page before shows, if it moves by the modes of a diagram.

    The mesh is not among the results, and the copy of the scene may not find it.
    """
    try:
        surface = unpacked(page.read_text(encoding="utf-8")).get("surface")
    except (OSError, ValueError, IndexError):
        return None
    modes = diagram.branches[0].points[0].system.size
    found: Mapping[str, Any] | None = surface
    if not found or len(found.get("moves", ())) != modes or isinstance(found.get("stops"), int):
        return None  # of another structure, or of a page of an earlier version
    return found


def as_diagram(found: object) -> Diagram:
    """The diagram in what a file holds."""
    if isinstance(found, Exploration):
        return found.diagram
    if isinstance(found, Diagram):
        return found
    if not isinstance(found, list) or not all(isinstance(each, Branch) for each in found):
        raise SystemModelError("the results hold no branches")
    spans = [branch.course.limits if branch.course else branch.span_hz for branch in found]
    lowest = min((low for low, _ in spans), default=0.0)
    highest = max((high for _, high in spans), default=0.0)
    observe = found[0].points[0].observe if found else ""
    return Diagram(tuple(found), (float(lowest), float(highest)), observe)


def drawn_again(scene: Scene | None, diagram: Diagram) -> tuple[Drawn | None, list[str]]:
    """The structure to be shown, and what is to be said if there is none."""
    if scene is None or not (scene.mesh or scene.components) or not diagram.branches:
        return None, []
    try:
        drawn = drawn_of(scene, build_structure(scene))
        if drawn and (missing := missing_library()):
            return None, [f"The structure is not shown: {missing}"]
    except SceneError as error:
        return None, [
            f"The structure is not shown: {error}; "
            "'--scene' takes the scene from the place where it was computed"
        ]
    system = diagram.branches[0].points[0].system
    if drawn is None:
        return None, []
    hz = np.asarray(drawn.reduced.frequencies_hz)
    if hz.shape != system.frequencies_hz.shape or not np.allclose(
        hz, system.frequencies_hz, rtol=SAME, atol=0.0
    ):
        raise SystemModelError(f"{scene.file}: has other modes than the results")
    return drawn, []


def read_summary(folder: Path) -> dict[str, Any]:
    """What ``summary.json`` says.

    Raises
    ------
    OutputError
        If it cannot be read.
    """
    try:
        found: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise OutputError(f"{folder / 'summary.json'}: cannot be read: {error}") from None
    return found


def read_tables(folder: Path) -> dict[str, Table]:
    """The tables of a directory of results, as `write_results` wrote them.

    Raises
    ------
    OutputError
        If one cannot be read.
    """
    return {part: read_table(folder / name) for part, name in FILES.items()}


def read_table(path: Path) -> Table:
    """Columns and rows of a table; an empty cell is None."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            columns, *rows = csv.reader(file)
        return columns, [
            [cell(name, text) for name, text in zip(columns, row, strict=True)] for row in rows
        ]
    except (OSError, ValueError) as error:
        raise OutputError(f"{path}: cannot be read: {error}") from None


def cell(column: str, text: str) -> object:
    """The value of a cell.

    Examples
    --------
    >>> cell("branch", "1"), cell("period", "3"), cell("frequency_hz", "25.3"), cell("period", "")
    ('1', 3, 25.3, None)
    """
    if column in TEXTS:
        return text
    if not text:
        return None
    return int(text) if text.isdecimal() else float(text)
