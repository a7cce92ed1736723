"""Ten modes of a bracket of tetrahedra of second order: time and memory from the mesh to the modes.

``python -m bench.solids --edge 0.0068`` measures by itself; shorter edges give larger problems.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh

import cms
import fem
from bench.with_gmsh import gmsh_at_work
from cms.base.arrays import FloatArray
from cms.component.component import checked_pencil
from cms.solvers.factor import SOLVERS, pardiso_is_there

MODES = 10
EDGE = 0.0068  # m: 277,509 degrees of freedom
STEEL = fem.Material(2.1e11, 7800.0, 0.3)
SOLVER = "PARDISO" if pardiso_is_there() else "SuperLU"
OURS, PEER = "from the mesh, fem and cms", f"from the matrices, {SOLVER} and eigsh"
TOLERANCE = 1e-10  # of eigsh


@dataclass(frozen=True)
class SolidTime:
    """What a process took for the modes of a bracket.

    Attributes
    ----------
    what : str
        What was done: `OURS` or `PEER`.
    size : int
        Degrees of freedom.
    seconds : float
        Of the processor, with the system's.
    gigabytes : float
        Most memory of the process.
    frequencies_hz : tuple of float
        The lowest ones.
    """

    what: str
    size: int
    seconds: float
    gigabytes: float
    frequencies_hz: tuple[float, ...]


def write_bracket(edge: float, path: Path) -> None:
    """Mesh an angle with a hole in its longer arm by edges of a length in m, and write it."""
    with gmsh_at_work() as gmsh:
        arm = gmsh.model.occ.addBox(0.0, 0.0, 0.0, 0.5, 0.1, 0.06)
        hole = gmsh.model.occ.addCylinder(0.4, 0.05, 0.0, 0.0, 0.0, 0.06, 0.03)
        post = gmsh.model.occ.addBox(0.0, 0.0, 0.06, 0.06, 0.1, 0.2)
        gmsh.model.occ.cut([(3, arm)], [(3, hole)], 4)
        gmsh.model.occ.fuse([(3, 4)], [(3, post)], 5)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [5], name="bracket")
        back = gmsh.model.getEntitiesInBoundingBox(-1e-6, -1.0, -1.0, 1e-6, 1.0, 1.0, 2)
        gmsh.model.addPhysicalGroup(2, [face for _, face in back], name="foot")
        for option in ("MeshSizeMin", "MeshSizeMax"):
            gmsh.option.setNumber(f"Mesh.{option}", edge)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))


def assembled(path: Path) -> fem.Component:
    """The bracket of a mesh file, clamped at its foot."""
    model = fem.StructureModel(
        fem.read_mesh(path),
        {"bracket": fem.SolidPart(STEEL)},
        [fem.Support("foot", ("x", "y", "z"))],
    )
    return fem.assemble(model)


def by_ours(folder: Path) -> tuple[int, FloatArray]:
    """Degrees of freedom, and frequencies in Hz from the mesh, with what goes on told."""
    component = assembled(folder / "bracket.msh")
    reduced = cms.reduce(component, modes=MODES, progress=told)
    return component.stiffness.shape[0], reduced.frequencies_hz


def by_peer(folder: Path) -> tuple[int, FloatArray]:
    """Degrees of freedom, and frequencies in Hz from the matrices."""
    K, M = (sparse.csc_array(sparse.load_npz(folder / f"{name}.npz")) for name in "KM")
    found = SOLVERS[SOLVER.lower()](K)
    assert found is not None
    inverse = LinearOperator(K.shape, matvec=found[0], dtype=np.float64)
    squares = eigsh(K, MODES, M, sigma=0.0, OPinv=inverse, tol=TOLERANCE, return_eigenvectors=False)
    return K.shape[0], np.asarray(np.sqrt(np.sort(squares)) / (2.0 * np.pi))


WAYS: dict[str, Callable[[Path], tuple[int, FloatArray]]] = {OURS: by_ours, PEER: by_peer}


def told(text: str) -> None:
    """Say what is done, on stderr."""
    print(f"  {text}", file=sys.stderr, flush=True)


def write_matrices(folder: Path) -> None:
    """Write the matrices of the bracket beside its mesh."""
    pencil = checked_pencil(assembled(folder / "bracket.msh"))
    for name, matrix in (("K", pencil.stiffness), ("M", pencil.mass)):
        sparse.save_npz(folder / f"{name}.npz", sparse.csc_matrix(matrix), compressed=False)


def solid_times(edge: float = EDGE, ways: Sequence[str] = (OURS, PEER)) -> list[SolidTime]:
    """Measure each way in a process of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        told(f"meshing a bracket with edges of {edge:g} m")
        write_bracket(edge, folder / "bracket.msh")
        if PEER in ways:
            write_matrices(folder)
        found = []
        for way in ways:
            told(f"{MODES} modes {way}")
            command = [sys.executable, "-m", "bench.solids", "--way", way, "--folder", name]
            tests = {"PYTHONPATH": str(Path(__file__).parents[1])}
            said = subprocess.run(
                command, stdout=subprocess.PIPE, check=True, env=os.environ | tests
            ).stdout
            found.append(SolidTime(way, **json.loads(said)))
        return found


def one_way(way: str, folder: Path) -> str:
    """Go one way; what it took, as JSON."""
    begin = time.process_time()
    size, frequencies = WAYS[way](folder)
    usage = resource.getrusage(resource.RUSAGE_SELF)
    unit = 1e-9 if sys.platform == "darwin" else 1.024e-6
    return json.dumps(
        {
            "size": size,
            "seconds": time.process_time() - begin,
            "gigabytes": unit * usage.ru_maxrss,
            "frequencies_hz": list(frequencies),
        }
    )


def main() -> None:
    """Measure, or go one way."""
    parser = argparse.ArgumentParser(prog="python -m bench.solids")
    parser.add_argument("--edge", type=float, default=EDGE, metavar="M")
    parser.add_argument("--way", choices=list(WAYS))
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    if given.folder:
        print(one_way(given.way, given.folder))
        return
    for row in solid_times(given.edge, [given.way] if given.way else list(WAYS)):
        print(row)


if __name__ == "__main__":
    main()
