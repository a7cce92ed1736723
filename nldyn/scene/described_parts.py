"""Parts whose material and section are taken from the file of the mesh."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

from pydantic import TypeAdapter, ValidationError

import fem
from nldyn.scene.messages import quoted, scene_error, show
from nldyn.scene.schema.parts import (
    AnyPartTable,
    BeamTable,
    PartTable,
    ShellTable,
    SolidTable,
    TrussTable,
)
from nldyn.scene.schema.scene import Scene

MADE, REFUSED = "made", "refused"
TABLES: dict[type, type[PartTable]] = {
    fem.BeamPart: BeamTable,
    fem.TrussPart: TrussTable,
    fem.SolidPart: SolidTable,
    fem.ShellPart: ShellTable,
}
PART: TypeAdapter[AnyPartTable] = TypeAdapter(AnyPartTable)
SAME = 1e-6  # relative


class DescribedMesh(Protocol):
    """What is needed of a mesh: the keys of parts that its file gives."""

    @property
    def described(self) -> Mapping[str, Mapping[str, object]]:
        """Keys of a part by its name; "refused" with a reason where they cannot be taken."""


def with_described_parts(scene: Scene, mesh: DescribedMesh) -> Scene:
    """The scene with the parts that ``parts_from_file`` names.

    Raises
    ------
    SceneError
        If the file describes no such part, or in a way that is not taken over.
    """
    if scene.mesh is None or not scene.mesh.parts_from_file:
        return scene
    key = ("mesh", "parts_from_file")
    parts: dict[str, PartTable] = dict(scene.parts)
    for name in named_parts(scene, mesh):
        if name not in mesh.described:
            known = quoted(mesh.described) if mesh.described else "none"
            fault = f"names '{name}', which the mesh file does not describe; it describes {known}"
            raise scene_error(scene.file, key, fault)
        given = mesh.described[name]
        if REFUSED in given:
            raise scene_error(scene.file, key, f"names '{name}': {given[REFUSED]}")
        if MADE in given:
            parts[name] = table_of(given[MADE])
            continue
        try:
            parts[name] = PART.validate_python(dict(given))
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(word) for word in first["loc"][1:])
            fault = f"names '{name}', whose numbers in the mesh file make no part: {place}: "
            raise scene_error(scene.file, key, fault + first["msg"]) from None
    return scene.model_copy(update={"parts": parts})


def named_parts(scene: Scene, mesh: DescribedMesh) -> list[str]:
    """The parts that are taken from the file: those that are named, or all others."""
    assert scene.mesh is not None
    if scene.mesh.parts_from_file == "all":
        return [name for name in mesh.described if name not in scene.parts]
    return list(scene.mesh.parts_from_file)


def table_of(part: Any) -> PartTable:
    """The table of a part that the file of the mesh makes whole, with its plain numbers."""
    given = {"thickness": getattr(part, "thickness", None), "area": getattr(part, "area", None)}
    material = part.material
    table = TABLES[type(part)].model_construct(
        youngs_modulus=material.youngs_modulus,
        density=material.density,
        poissons_ratio=material.poissons_ratio,
        **{key: value for key, value in given.items() if value is not None},
    )
    table._made = part
    return table


def told_otherwise(scene: Scene, mesh: DescribedMesh) -> list[str]:
    """A sentence for each part of the scene that the file of its mesh describes otherwise."""
    parts = {n: t for n, t in scene.parts.items() if n in mesh.described and t._made is None}
    if scene.mesh and scene.mesh.parts_from_file != "all":
        parts = {n: t for n, t in parts.items() if n not in scene.mesh.parts_from_file}
    found = []
    for name, table in parts.items():
        given = mesh.described[name]
        if REFUSED in given:
            found.append(f"part '{name}' is as in the scene, not as in the file: {given[REFUSED]}")
            continue
        if MADE in given:
            given = table_of(given[MADE]).model_dump(exclude_none=True)
        other = [
            f"{key} {show(own)}, not {show(value)}"
            for key, value in given.items()
            if (own := getattr(table, key, None)) not in (None, value) and not _near(own, value)
        ]
        if other:
            found.append(
                f"part '{name}' is as in the scene, not as in the file: {', '.join(other)}"
            )
    return found


def _near(one: object, other: object) -> bool:
    both = isinstance(one, int | float) and isinstance(other, int | float)
    return both and math.isclose(float(one), float(other), rel_tol=SAME)  # type: ignore[arg-type]
