"""Keep a model in an .npz file: the arrays of its mesh and a JSON text of what is attached."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from fem.base.errors import ModelError
from fem.base.files import draft_of, plain_write_errors
from fem.mesh.attachments import (
    Attachments,
    Coupling,
    LinearEquation,
    Link,
    PointMass,
    PointMatrix,
    Support,
)
from fem.mesh.frame_mesh import FrameMesh
from fem.mesh.structure_mesh import StructureMesh
from fem.model.frame import LISTS as FRAME_LISTS
from fem.model.frame import FrameModel
from fem.model.parts import BeamPart, Material, ShellPart, SolidPart, TrussPart
from fem.model.plates import PlateSection
from fem.model.sections import (
    CircularSection,
    CrossSection,
    LinearSection,
    RectangularSection,
    Section,
    TaperedSection,
    added,
)
from fem.model.structure import LISTS as STRUCTURE_LISTS
from fem.model.structure import Part, StructureModel
from fem.model.supports import Interface

FORMAT = "fem frame 2"
STRUCTURE_FORMAT = "fem structure 2"
Arrays = dict[str, npt.NDArray[Any]]
Lists = Mapping[str, type]
Model = TypeVar("Model")
BROUGHT: Lists = {
    "point_masses": PointMass,
    "links": Link,
    "couplings": Coupling,
    "equations": LinearEquation,
    "supports": Support,
    "matrices": PointMatrix,
}
PARTS = {kind.__name__: kind for kind in (BeamPart, TrussPart, SolidPart, ShellPart)}
SECTIONS = {
    kind.__name__: kind
    for kind in (RectangularSection, CircularSection, Section, TaperedSection, LinearSection)
}


def save_model(model: FrameModel, path: str | os.PathLike[str]) -> None:
    """Write a model, whole or not at all.

    A cross-section of a class that is not from this package is kept by its numbers.

    Raises
    ------
    ModelError
        If the file cannot be written.

    Examples
    --------
    >>> import fem, pathlib, tempfile
    >>> mesh = fem.frame_mesh({"a": (0, 0), "b": (1, 0)}, [("rod", "a", "b", 2)])
    >>> part = fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.CircularSection(0.01))
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "rod.npz"
    >>> save_model(fem.FrameModel(mesh, {"rod": part}), path)
    >>> load_model(path).parts["rod"] == part
    True
    """
    mesh = model.mesh
    arrays: dict[str, npt.NDArray[Any]] = {"points": mesh.points, "lines": mesh.lines}
    arrays |= {f"part {name}": elements for name, elements in mesh.parts.items()}
    arrays |= {f"type {name}": elements for name, elements in mesh.element_types.items()}
    arrays |= {f"point {name}": nodes for name, nodes in mesh.point_sets.items()}
    _write(path, FORMAT, _attached(model, FRAME_LISTS), arrays)


def save_structure(model: StructureModel, path: str | os.PathLike[str]) -> None:
    """Write a structure as `save_model` writes a frame.

    Examples
    --------
    >>> import fem, pathlib, tempfile
    >>> model = fem.StructureModel(
    ...     fem.box_mesh("bar", (1.0, 0.1, 0.1), (2, 1, 1)),
    ...     {"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))},
    ...     couplings=[fem.Coupling("tip", "x1")],
    ... )
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "bar.npz"
    >>> save_structure(model, path)
    >>> load_structure(path).couplings == model.couplings
    True
    """
    mesh = model.mesh
    arrays: dict[str, npt.NDArray[Any]] = {"points": mesh.points}
    arrays |= {f"cells {kind}": nodes for kind, nodes in mesh.cells.items()}
    for name, group in mesh.groups.items():
        arrays |= {f"group {kind} {name}": cells for kind, cells in group.items()}
    for name, found in mesh.element_types.items():
        arrays |= {f"type {kind} {name}": cells for kind, cells in found.items()}
    arrays |= {f"point {name}": nodes for name, nodes in mesh.point_sets.items()}
    attached = {**_attached(model, STRUCTURE_LISTS), "pinned": model.pinned}
    _write(path, STRUCTURE_FORMAT, attached, arrays)


def load_model(path: str | os.PathLike[str]) -> FrameModel:
    """Read a model that `save_model` wrote.

    Raises
    ------
    ModelError
        If the file is missing or is not such a file.
    """

    def build(arrays: Arrays, attached: dict[str, Any]) -> FrameModel:
        mesh = FrameMesh(
            arrays["points"],
            arrays["lines"],
            _named(arrays, "part "),
            _named(arrays, "point "),
            attached["source"],
            attachments=_from_file(attached),
            element_types=_named(arrays, "type "),
        )
        return FrameModel(mesh, **_items(attached, FRAME_LISTS))

    return _read(path, FORMAT, "frame", build)


def load_structure(path: str | os.PathLike[str]) -> StructureModel:
    """Read a model that `save_structure` wrote.

    Raises
    ------
    ModelError
        If the file is missing or is not such a file.
    """

    def build(arrays: Arrays, attached: dict[str, Any]) -> StructureModel:
        mesh = StructureMesh(
            arrays["points"],
            _named(arrays, "cells "),
            _named_by_kind(arrays, "group "),
            _named(arrays, "point "),
            attached["source"],
            attachments=_from_file(attached),
            element_types=_named_by_kind(arrays, "type "),
        )
        items = _items(attached, STRUCTURE_LISTS) | {"pinned": attached.get("pinned", ())}
        # the mesh that was saved has the points of the couplings
        items["couplings"] = [replace(coupling, at=None) for coupling in items["couplings"]]
        return StructureModel(mesh, **items)

    return _read(path, STRUCTURE_FORMAT, "structure", build)


def _write(
    path: str | os.PathLike[str], kind: str, attached: dict[str, Any], arrays: Arrays
) -> None:
    arrays = {"format": np.array(kind), "attached": np.array(json.dumps(attached)), **arrays}
    target = Path(path)
    with plain_write_errors(target), draft_of(target) as draft, draft.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _read(
    path: str | os.PathLike[str],
    kind: str,
    what: str,
    build: Callable[[Arrays, dict[str, Any]], Model],
) -> Model:
    if not Path(path).is_file():
        raise ModelError(f"{path}: there is no such {what} file")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        if str(arrays["format"]) != kind:
            raise KeyError("format")
        return build(arrays, json.loads(str(arrays["attached"])))
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{path}: is not a file of a saved {what}") from error


def _attached(model: FrameModel | StructureModel, lists: Lists) -> dict[str, Any]:
    return {
        "source": model.mesh.source,
        "from file": {
            item.name: [_plain(each) for each in getattr(model.mesh.attachments, item.name)]
            for item in fields(Attachments)
        },
        "parts": {name: _part(part) for name, part in model.parts.items()},
        "interfaces": {name: asdict(item) for name, item in model.interfaces.items()},
        "separate": model.separate,
        **{name: [asdict(item) for item in getattr(model, name)] for name in lists},
    }


def _from_file(attached: dict[str, Any]) -> Attachments:
    given = attached["from file"]
    made = {name: [kind(**i) for i in given.get(name, [])] for name, kind in BROUGHT.items()}
    names = {name: given.get(name, ()) for name in ("turning", "loose", "placeless")}
    return Attachments(**made, **names)


def _plain(item: Any) -> Any:
    """A name as it is; all else as a dictionary."""
    return item if isinstance(item, str) else asdict(item)


def _items(attached: dict[str, Any], lists: Lists) -> dict[str, Any]:
    return {
        "parts": {name: _part_from(part) for name, part in attached["parts"].items()},
        "interfaces": {name: Interface(**item) for name, item in attached["interfaces"].items()},
        "separate": bool(attached["separate"]),
        **{name: [kind(**item) for item in attached[name]] for name, kind in lists.items()},
    }


def _part(part: Part) -> dict[str, Any]:
    plain = {"part": type(part).__name__, **asdict(part)}
    if isinstance(part, BeamPart):
        plain["section"] = _section(part.section, part.material.poissons_ratio)
    return plain


def _part_from(plain: dict[str, Any]) -> Any:
    plain = {**plain, "material": Material(**plain["material"])}
    sort = PARTS[plain.pop("part")]
    if sort is BeamPart:
        plain["section"] = _section_from(plain["section"])
    elif plain.get("section") is not None:
        plain["section"] = PlateSection(**plain["section"])
    return sort(**plain)


def _section_from(plain: dict[str, Any]) -> Any:
    plain = dict(plain)
    sort = SECTIONS[plain.pop("kind")]
    if sort in (TaperedSection, LinearSection):
        plain |= {end: _section_from(plain[end]) for end in ("start", "end")}
    return sort(**plain)


def _section(section: Any, poissons_ratio: float | None) -> dict[str, Any]:
    if isinstance(section, TaperedSection | LinearSection):
        ends = {end: _section(getattr(section, end), None) for end in ("start", "end")}
        return {"kind": type(section).__name__, **asdict(section), **ends}
    if type(section).__name__ not in SECTIONS:
        section = _plain_section(section, poissons_ratio)
    return {"kind": type(section).__name__, **asdict(section)}


def _plain_section(section: CrossSection, poissons_ratio: float | None) -> Section:
    """A section of a class of the user's own by its numbers."""
    areas: tuple[float | None, float | None] = (None, None)
    if poissons_ratio is not None and hasattr(section, "shear_areas"):
        areas = section.shear_areas(poissons_ratio)
    return Section(
        section.area,
        section.second_moment,
        getattr(section, "second_moment_across", None),
        getattr(section, "torsion_constant", None),
        *areas,
        added(section, "added_mass"),
        added(section, "added_inertia"),
    )


def _named(arrays: dict[str, npt.NDArray[Any]], prefix: str) -> dict[str, npt.NDArray[Any]]:
    named = {name: array for name, array in arrays.items() if name.startswith(prefix)}
    return {name.removeprefix(prefix): array for name, array in named.items()}


def _named_by_kind(
    arrays: dict[str, npt.NDArray[Any]], prefix: str
) -> dict[str, dict[str, npt.NDArray[Any]]]:
    """Arrays whose names are a kind of cell and a name, by name and kind."""
    found: dict[str, dict[str, npt.NDArray[Any]]] = {}
    for key, cells in _named(arrays, prefix).items():
        kind, _, name = key.partition(" ")
        found.setdefault(name, {})[kind] = cells
    return found
