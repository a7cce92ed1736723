"""Keep a model in an .npz file: the arrays of its mesh and a JSON text of what is attached."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

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
from fem.mesh.structure_mesh import StructureMesh
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
from fem.model.structure import LISTS, Part, StructureModel
from fem.model.supports import Interface

FORMAT = "fem model 3"
OF_FRAMES, OF_STRUCTURES = "fem frame 2", "fem structure 2"
"""Formats of files before `FORMAT`, which are read, too."""
Arrays = dict[str, npt.NDArray[Any]]
BROUGHT: Mapping[str, type] = {
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


def save_model(model: StructureModel, path: str | os.PathLike[str]) -> None:
    """Write a model, whole or not at all.

    A cross-section of a class that is not from this package is kept by its numbers.

    Raises
    ------
    ModelError
        If the file cannot be written.

    Examples
    --------
    >>> import fem, pathlib, tempfile
    >>> model = fem.StructureModel(
    ...     fem.box_mesh("bar", (1.0, 0.1, 0.1), (2, 1, 1)),
    ...     {"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))},
    ...     couplings=[fem.Coupling("tip", "x1")],
    ... )
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "bar.npz"
    >>> save_model(model, path)
    >>> load_model(path).couplings == model.couplings
    True
    """
    mesh = model.mesh
    arrays: Arrays = {"points": mesh.points}
    arrays |= {f"cells {kind}": nodes for kind, nodes in mesh.cells.items()}
    for name, group in mesh.groups.items():
        arrays |= {f"group {kind} {name}": cells for kind, cells in group.items()}
    for name, found in mesh.element_types.items():
        arrays |= {f"type {kind} {name}": cells for kind, cells in found.items()}
    arrays |= {f"point {name}": nodes for name, nodes in mesh.point_sets.items()}
    text = json.dumps(_attached(model))
    arrays = {"format": np.array(FORMAT), "attached": np.array(text), **arrays}
    target = Path(path)
    with plain_write_errors(target), draft_of(target) as draft, draft.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def load_model(path: str | os.PathLike[str]) -> StructureModel:
    """Read a model that `save_model` wrote, also in its earlier formats.

    Raises
    ------
    ModelError
        If the file is missing or is not such a file.
    """
    if not Path(path).is_file():
        raise ModelError(f"{path}: there is no such model file")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        attached = json.loads(str(arrays["attached"]))
        kind = str(arrays["format"])
        if kind == OF_FRAMES:
            arrays, attached = _as_structure(arrays, attached)
        elif kind not in (FORMAT, OF_STRUCTURES):
            raise KeyError("format")
        return _model(arrays, attached)
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{path}: is not a file of a saved model") from error


def _as_structure(arrays: Arrays, attached: dict[str, Any]) -> tuple[Arrays, dict[str, Any]]:
    """What a file of a plane frame holds, as one of a structure does."""
    sorts = {"lines": "cells line", "part": "group line", "type": "type line"}
    words = {name: name.partition(" ") for name in arrays}
    renamed = {
        f"{sorts.get(sort, sort)}{space}{name}": arrays[key]
        for key, (sort, space, name) in words.items()
    }
    return renamed, {**attached, "couplings": [], "foundations": [], "plane": True}


def _model(arrays: Arrays, attached: dict[str, Any]) -> StructureModel:
    mesh = StructureMesh(
        arrays["points"],
        _named(arrays, "cells "),
        _named_by_kind(arrays, "group "),
        _named(arrays, "point "),
        attached["source"],
        attachments=_from_file(attached),
        element_types=_named_by_kind(arrays, "type "),
    )
    items: dict[str, Any] = {
        name: [kind(**item) for item in attached[name]] for name, kind in LISTS.items()
    }
    # the mesh that was saved has the points of the couplings
    items["couplings"] = [replace(coupling, at=None) for coupling in items["couplings"]]
    return StructureModel(
        mesh,
        parts={name: _part_from(part) for name, part in attached["parts"].items()},
        interfaces={name: Interface(**item) for name, item in attached["interfaces"].items()},
        separate=bool(attached["separate"]),
        pinned=attached.get("pinned", ()),
        plane=attached.get("plane", False),
        **items,
    )


def _attached(model: StructureModel) -> dict[str, Any]:
    return {
        "source": model.mesh.source,
        "from file": {
            item.name: [_plain(each) for each in getattr(model.mesh.attachments, item.name)]
            for item in fields(Attachments)
        },
        "parts": {name: _part(part) for name, part in model.parts.items()},
        "interfaces": {name: asdict(item) for name, item in model.interfaces.items()},
        "separate": model.separate,
        "pinned": model.pinned,
        "plane": model.plane,
        **{name: [asdict(item) for item in getattr(model, name)] for name in LISTS},
    }


def _from_file(attached: dict[str, Any]) -> Attachments:
    given = attached["from file"]
    made = {name: [kind(**i) for i in given.get(name, [])] for name, kind in BROUGHT.items()}
    names = {name: given.get(name, ()) for name in ("turning", "loose", "placeless")}
    return Attachments(**made, **names)


def _plain(item: Any) -> Any:
    """A name as it is; all else as a dictionary."""
    return item if isinstance(item, str) else asdict(item)


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


def _named(arrays: Arrays, prefix: str) -> Arrays:
    named = {name: array for name, array in arrays.items() if name.startswith(prefix)}
    return {name.removeprefix(prefix): array for name, array in named.items()}


def _named_by_kind(arrays: Arrays, prefix: str) -> dict[str, Arrays]:
    """Arrays whose names are a kind of cell and a name, by name and kind."""
    found: dict[str, Arrays] = {}
    for key, cells in _named(arrays, prefix).items():
        kind, _, name = key.partition(" ")
        found.setdefault(name, {})[kind] = cells
    return found
