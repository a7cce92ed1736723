"""Cells and numbers that meshio 5.3 leaves out of its tables, so that they are read or named.

Without this a `meshio.Mesh` of "wedge15" or "pyramid13" is a `KeyError`, whatever the format.
"""

from __future__ import annotations

from meshio._common import num_nodes_per_cell
from meshio._mesh import topological_dimension
from meshio.vtk import _vtk_42, _vtk_51

LEFT_OUT = {
    "pixel": (2, 4),
    "quad6": (2, 6),
    "triangle7": (2, 7),
    "wedge12": (3, 12),
    "pyramid13": (3, 13),
    "wedge15": (3, 15),
    "hexahedron24": (3, 24),
    "penta_prism": (3, 10),
    "hexa_prism": (3, 12),
}
"""Dimension and number of nodes of each."""

for _kind, (_dimension, _count) in LEFT_OUT.items():
    topological_dimension.setdefault(_kind, _dimension)
    num_nodes_per_cell.setdefault(_kind, _count)

NUMBERS = {
    **_vtk_51.vtk_to_numpy_dtype_name,
    **_vtk_42.vtk_to_numpy_dtype_name,
    "signed_char": "int8",
    "vtkidtype": "int32",
}
"""Kinds of numbers of all versions of VTK legacy files; vtkIdType is written as int."""

_vtk_42.vtk_to_numpy_dtype_name.update(NUMBERS)
_vtk_51.vtk_to_numpy_dtype_name.update(NUMBERS)
