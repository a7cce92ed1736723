"""Make plate.msh and hook.msh with Gmsh, as a user would who has a mesher of his own.

Run as ``python meshes/make_gmsh_meshes.py``; it needs ``pip install gmsh``, and perhaps a system
library that Gmsh names. The files are written beside this script; docs/tutorials/own_mesh.md goes
on.
"""

from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent
NEAR = 1e-6


def plate() -> None:
    """A plate of second-order hexahedra, clamped at one end."""
    length, width, thickness = 0.30, 0.10, 0.004
    geo = gmsh.model.geo
    point = geo.addPoint(0.0, 0.0, 0.0)
    line = geo.extrude([(0, point)], length, 0, 0, [12], recombine=True)[1]
    face = geo.extrude([line], 0, width, 0, [4], recombine=True)[1]
    geo.extrude([face], 0, 0, thickness, [1], recombine=True)
    geo.synchronize()
    name(3, "plate", inside((-1, 1), (-1, 1), (-1, 1)))
    name(2, "root", inside((0, 0), (-1, 1), (-1, 1)))
    name(0, "corner", inside((length, length), (0, 0), (0, 0)))
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)  # 20 nodes instead of 27
    gmsh.model.mesh.generate(3)


def hook() -> None:
    """An L of sheet metal with a hole, in second-order triangles."""
    occ = gmsh.model.occ
    upright = occ.addRectangle(0, 0, 0, 0.02, 0.12)
    arm = occ.addRectangle(0, 0.10, 0, 0.15, 0.02)
    whole, _ = occ.fuse([(2, upright)], [(2, arm)])
    occ.cut(whole, [(2, occ.addDisk(0.01, 0.11, 0, 0.004, 0.004))])
    occ.synchronize()
    name(2, "sheet", inside((-1, 1), (-1, 1), (0, 0)))
    name(1, "foot", inside((-1, 1), (0, 0), (0, 0)))
    name(0, "tip", inside((0.15, 0.15), (0.10, 0.10), (0, 0)))
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.008)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.model.mesh.generate(2)


def inside(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> list[float]:
    """The box (low corner, high corner) around these ranges."""
    low, high = zip(x, y, z, strict=True)
    return [*(value - NEAR for value in low), *(value + NEAR for value in high)]


def name(dimension: int, label: str, box: list[float]) -> None:
    """Make a physical group of all entities within a box."""
    found = gmsh.model.getEntitiesInBoundingBox(*box, dimension)
    gmsh.model.addPhysicalGroup(dimension, [tag for _, tag in found], name=label)


def main() -> None:
    """Write both meshes."""
    for make in (plate, hook):
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        make()
        gmsh.write(str(HERE / f"{make.__name__}.msh"))
        gmsh.finalize()


if __name__ == "__main__":
    main()
