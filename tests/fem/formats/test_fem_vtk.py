"""VTK's files, as VTK itself and meshio write and read them."""

from __future__ import annotations

from itertools import product

import meshio
import numpy as np
import pytest
import pyvista
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

import fem
from fem.formats.vtk_cells import NUMBERS
from fem.mesh.cells import KINDS

ORDER = {"wedge": [0, 2, 1, 3, 5, 4]}


def one_of_each() -> fem.StructureMesh:
    """A cell of each kind that VTK has beside the others, two of each group."""
    points, cells, first = [], {}, 0
    for place, kind in enumerate(kind for kind in KINDS if kind in NUMBERS):
        cell = KINDS[kind]
        nodes = np.pad(cell.nodes, ((0, 0), (0, 3 - cell.dimension)))
        points.append(nodes + np.array([3.0 * place, 1.0 / 3.0, 0.0]))
        cells[kind] = np.arange(first, first + len(nodes))[None]
        first += len(nodes)
    pairs = zip(list(cells)[::2], list(cells)[1::2], strict=False)
    groups = {f"{a} {b}": {a: [0], b: [0]} for a, b in pairs}
    return fem.StructureMesh(np.concatenate(points), cells, groups, {"first": [0], "some": [3, 9]})


def as_grid(mesh: fem.StructureMesh) -> pyvista.UnstructuredGrid:
    cells, types = [], []
    for kind, nodes in mesh.cells.items():
        for cell in nodes[:, ORDER.get(kind, slice(None))]:
            cells += [len(cell), *cell]
            types.append(NUMBERS[kind])
    grid = pyvista.UnstructuredGrid(np.array(cells), np.array(types), mesh.points)
    numbers = {kind: at for at, kind in enumerate(mesh.cells)}
    for name, group in mesh.groups.items():
        grid.cell_data[f"set:{name}"] = np.isin(np.arange(len(types)), [numbers[k] for k in group])
    for name, nodes in mesh.point_sets.items():
        grid.point_data[f"set:{name}"] = np.isin(np.arange(len(mesh.points)), nodes).astype("u1")
    return grid


def same(found: fem.StructureMesh, mesh: fem.StructureMesh, within: float = 0.0) -> None:
    np.testing.assert_allclose(found.points, mesh.points, rtol=within, atol=0.0)
    assert {kind: nodes.tolist() for kind, nodes in found.cells.items()} == {
        kind: nodes.tolist() for kind, nodes in mesh.cells.items()
    }
    assert found.groups.keys() == mesh.groups.keys()
    for name, group in mesh.groups.items():
        assert {kind: at.tolist() for kind, at in found.part(name).items()} == {
            kind: list(at) for kind, at in group.items()
        }
    assert {name: nodes.tolist() for name, nodes in found.point_sets.items()} == {
        name: nodes.tolist() for name, nodes in mesh.point_sets.items()
    }


FORMS = [
    (mode, codec, big, wide)
    for mode, codec in product(("Ascii", "Binary", "appended raw", "appended base64"),
                               ("None", "ZLib", "LZMA"))
    for big, wide in ((False, False), (True, True))
    if (mode, codec) not in (("Ascii", "ZLib"), ("Ascii", "LZMA"))
]  # fmt: skip


def written_by_vtk(path, mesh, mode, codec, big, wide) -> None:
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(as_grid(mesh))
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode.split()[0].capitalize()}")()
    writer.SetEncodeAppendedData(mode.endswith("base64"))
    getattr(writer, f"SetCompressorTypeTo{codec}")()
    writer.SetBlockSize(96)
    (writer.SetByteOrderToBigEndian if big else writer.SetByteOrderToLittleEndian)()
    (writer.SetHeaderTypeToUInt64 if wide else writer.SetHeaderTypeToUInt32)()
    (writer.SetIdTypeToInt64 if wide else writer.SetIdTypeToInt32)()
    assert writer.Write()


@pytest.mark.parametrize(("mode", "codec", "big", "wide"), FORMS)
def test_every_form_in_which_vtk_writes_is_read(tmp_path, mode, codec, big, wide):
    mesh, path = one_of_each(), tmp_path / "cells.vtu"
    written_by_vtk(path, mesh, mode, codec, big, wide)
    same(fem.read_mesh(path), mesh)


@pytest.mark.parametrize("binary", [False, True])
def test_cells_of_all_kinds_are_read_from_legacy_files(tmp_path, binary):
    mesh, path = one_of_each(), tmp_path / "cells.vtk"
    as_grid(mesh).save(path, binary=binary)
    same(fem.read_mesh(path), mesh, 0.0 if binary else 1e-10)  # VTK writes so many digits


def test_vtk_and_meshio_read_what_is_written(tmp_path):
    mesh, path = one_of_each(), tmp_path / "cells.vtu"
    fem.write_mesh(mesh, path)
    same(fem.read_mesh(path), mesh)
    theirs, grid = pyvista.read(path), as_grid(mesh)
    assert np.array_equal(theirs.points, grid.points)
    assert np.array_equal(theirs.cells, grid.cells)
    assert np.array_equal(theirs.celltypes, grid.celltypes)
    for name in list(grid.cell_data):
        assert np.array_equal(theirs.cell_data[name], grid.cell_data[name])
    box = fem.box_mesh("whole", (2.0, 1.0, 1.0), (3, 2, 1), kind="wedge")
    for made, content in ((box, path), (fem.frame_mesh({"a": (0, 0), "b": (1, 0)},
                                                       [("rod", "a", "b", 2)]), path)):  # fmt: skip
        fem.write_mesh(made, content)
        other = meshio.read(content)
        assert np.array_equal(other.points, made.points)
        for kind, nodes in made.cells.items():
            assert np.array_equal(other.cells_dict[kind], nodes)


@pytest.mark.parametrize(
    ("form", "old", "new", "said"),
    [
        ("None", b'version="1.0"', b'version="9.0"', "version is '9.0', which is not read"),
        ("None", b"UnstructuredGrid", b"PolyData", "holds PolyData, no unstructured grid"),
        ("ZLib", b"ZLib", b"LZ4", "compressor is 'vtkLZ4DataCompressor', which is not read"),
        ("None", b"</AppendedData>", b"", "its appended data are cut off"),
        ("None", b'NumberOfPoints="', b'NumberOfPoints="9', "array 'set:first' has|'Points' has"),
        ("None", b'NumberOfCells="1', b'NumberOfCells="', "has 1. numbers, not"),
        ("None", b'Name="offsets"', b'Name="ends"', "told by 'connectivity', 'offsets' and 'types"),
        ("None", b'type="UInt8"', b'type="Bit"', "holds Bit, which is not read"),
    ],
)
def test_what_is_not_understood_in_a_vtu_file_is_told(tmp_path, form, old, new, said):
    path = tmp_path / "cells.vtu"
    written_by_vtk(path, one_of_each(), "appended raw", form, False, True)
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(fem.ModelError, match=said) as caught:
        fem.read_mesh(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize("form", ["ZLib", "LZMA"])
def test_packed_data_that_are_damaged_are_refused(tmp_path, form):
    """At each byte of the appended data: the mesh is refused, or none of its numbers changed."""
    mesh, path = one_of_each(), tmp_path / "cells.vtu"
    written_by_vtk(path, mesh, "appended raw", form, False, False)
    whole = path.read_bytes()
    begin, refused = whole.index(b"_", whole.index(b"<AppendedData")) + 1, 0
    places = range(begin, whole.rindex(b"</AppendedData>"), 101)
    for place in places:
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x15]) + whole[place + 1 :])
        try:
            same(fem.read_mesh(path), mesh)
        except fem.ModelError as error:
            assert str(error).startswith(str(path))
            refused += 1
    assert refused > 0.7 * len(places)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("DATASET UNSTRUCTURED_GRID", "nonsense", "'NONSENSE' stands where DATASET is due"),
        ("DATASET UNSTRUCTURED_GRID", "dataset polydata", "holds POLYDATA, no unstructured grid"),
        ("CELL_TYPES", "POINTS 1 float\n0 0 0\nCELL_TYPES", "POINTS stands twice"),
    ],
)
def test_what_is_not_understood_in_a_legacy_file_is_told(tmp_path, old, new, said):
    path = tmp_path / "two.vtk"
    text = (
        "# vtk DataFile Version 3.0\ntwo\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        "POINTS 2 float\n0 0 0 1 0 0\nCELLS 1 3\n2 0 1\nCELL_TYPES 1\n3\n"
    )
    path.write_text(text)
    assert fem.read_mesh(path).cells["line"].tolist() == [[0, 1]]
    path.write_text(text.replace(old, new))
    with pytest.raises(fem.ModelError, match=said):
        fem.read_mesh(path)


def test_cells_with_a_wrong_number_of_nodes_are_refused(tmp_path):
    path = tmp_path / "cells.vtk"
    path.write_text(
        "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 float\n"
        "0 0 0 1 0 0 0 1 0\nCELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n9\n"
    )
    with pytest.raises(fem.ModelError, match="a quad has 3 nodes, not 4"):
        fem.read_mesh(path)
    path.write_text(path.read_text().replace("\n9\n", "\n5\n"))
    assert fem.read_mesh(path).cells["triangle"].tolist() == [[0, 1, 2]]
    path.write_text(path.read_text().replace("3 0 1 2", "3 0 1 2 2"))
    with pytest.raises(fem.ModelError, match="a line goes on after the 4 numbers"):
        fem.read_mesh(path)
