"""Small meshes for the scenes to spoil, and the settings of the fuzzer."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, settings

import fem
from fem.mesh.structure_mesh import box_mesh, joined


def frame() -> fem.StructureMesh:
    """An arm on a leg with a brace to a wall."""
    points = {"foot": (0, 0), "corner": (0, 0.5), "tip": (1, 0.5), "wall": (-0.5, 0)}
    members = [("leg", "foot", "corner", 2), ("arm", "corner", "tip", 3),
               ("brace", "wall", "corner", 1)]  # fmt: skip
    return fem.frame_mesh(points, members)


def block() -> fem.StructureMesh:
    """A block of bricks with a rod before one of its faces."""
    solid = box_mesh("block", (0.2, 0.1, 0.1), (4, 2, 2), kind="hexahedron")
    middle = np.flatnonzero(np.isclose(solid.points[:, 0], 0.1))
    solid = solid.with_point_sets({"middle": middle})
    rod = fem.frame_mesh({"root": (0.25, 0, 0), "tip": (0.45, 0, 0)}, [("rod", "root", "tip", 2)])
    return joined([solid, rod])


def write_meshes(folder: Path) -> None:
    """Write both, and what else a path in a scene may lead to."""
    for end in (".vtu", ".msh", ".inp"):
        fem.write_mesh(frame(), folder / f"frame{end}")
    fem.write_mesh(block(), folder / "block.vtu")
    (folder / "folder").mkdir()
    (folder / "loop.vtu").symlink_to("loop.vtu")
    (folder / "link.vtu").symlink_to("frame.vtu")
    os.mkfifo(folder / "pipe.vtu")


def fuzz(examples: int) -> settings:
    """So many examples, the same ones each time."""
    return settings(
        max_examples=examples,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
