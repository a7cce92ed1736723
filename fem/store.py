"""Keep a frame in an .npz file: the arrays of its mesh and a JSON text of what is attached."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fem.errors import ModelError
from fem.files import draft_of, plain_write_errors
from fem.mesh import FrameMesh
from fem.model import (
    BeamPart,
    FrameModel,
    Hinge,
    Interface,
    Material,
    PointMass,
    PointSpring,
    Support,
)
from fem.sections import CircularSection, CrossSection, RectangularSection, Section

FORMAT = "fem frame 1"
SECTIONS = {kind.__name__: kind for kind in (RectangularSection, CircularSection, Section)}


def save_model(model: FrameModel, path: str | os.PathLike[str]) -> None:
    """Write a model, whole or not at all.

    A cross-section of a class that is not from this package is kept as its area and second moment.

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
    arrays: dict[str, npt.NDArray[Any]] = {
        "format": np.array(FORMAT),
        "points": mesh.points,
        "lines": mesh.lines,
        "attached": np.array(json.dumps(_attached(model))),
    }
    arrays |= {f"part {name}": elements for name, elements in mesh.parts.items()}
    arrays |= {f"point {name}": nodes for name, nodes in mesh.point_sets.items()}
    target = Path(path)
    with plain_write_errors(target), draft_of(target) as draft, draft.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def load_model(path: str | os.PathLike[str]) -> FrameModel:
    """Read a model that `save_model` wrote.

    Raises
    ------
    ModelError
        If the file is missing or is not such a file.
    """
    if not Path(path).is_file():
        raise ModelError(f"{path}: there is no such frame file")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        if str(arrays["format"]) != FORMAT:
            raise KeyError("format")
        attached = json.loads(str(arrays["attached"]))
        mesh = FrameMesh(
            arrays["points"],
            arrays["lines"],
            _named(arrays, "part "),
            _named(arrays, "point "),
            attached["source"],
        )
        return _model(mesh, attached)
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{path}: is not a file of a saved frame") from error


def _attached(model: FrameModel) -> dict[str, Any]:
    lists = ("supports", "point_masses", "springs", "hinges")
    return {
        "source": model.mesh.source,
        "parts": {
            name: {"material": asdict(part.material), **_section(part.section)}
            for name, part in model.parts.items()
        },
        "interfaces": {name: asdict(item) for name, item in model.interfaces.items()},
        **{name: [asdict(item) for item in getattr(model, name)] for name in lists},
    }


def _section(section: CrossSection) -> dict[str, Any]:
    kind = type(section).__name__
    if not isinstance(section, RectangularSection | CircularSection | Section):
        section, kind = Section(section.area, section.second_moment), "Section"
    return {"kind": kind, "section": asdict(section)}


def _model(mesh: FrameMesh, attached: dict[str, Any]) -> FrameModel:
    return FrameModel(
        mesh,
        parts={
            name: BeamPart(Material(**part["material"]), SECTIONS[part["kind"]](**part["section"]))
            for name, part in attached["parts"].items()
        },
        supports=[Support(**item) for item in attached["supports"]],
        point_masses=[PointMass(**item) for item in attached["point_masses"]],
        springs=[PointSpring(**item) for item in attached["springs"]],
        hinges=[Hinge(**item) for item in attached["hinges"]],
        interfaces={name: Interface(**item) for name, item in attached["interfaces"].items()},
    )


def _named(arrays: dict[str, npt.NDArray[Any]], prefix: str) -> dict[str, npt.NDArray[Any]]:
    named = {name: array for name, array in arrays.items() if name.startswith(prefix)}
    return {name.removeprefix(prefix): array for name, array in named.items()}
