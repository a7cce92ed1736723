"""Mesh files with faults."""

from __future__ import annotations

import base64
import re
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from hypothesis import strategies as st
from small_meshes import block, frame

import fem

NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
NUMBERS = (b"0", b"-1", b"1", b"2", b"3", b"7", b"99", b"1e99", b"1e400", b"nan", b"inf", b"-inf",
           b"2147483648", b"4294967296", b"99999999", b"1000000000000", b"18446744073709551616",
           b"9" * 400, b"x", b"", b"1.5", b"1 1", b"0x10", b"1_0", "٣".encode())  # fmt: skip
PIECES = (b"", b"\x00", b"\xff\xfe", b"\n", b" ", b"<", b">", b"$", b"*", b",", b'"', b"&a;",
          b"$EndNodes\n", b"*NODE\n", b"</DataArray>", b"<!--", b"set:arm", b"*INCLUDE, INPUT=",
          b"../frame.inp\n", b"/dev/zero\n", b"*INCLUDE, INPUT=frame.inp\n")  # fmt: skip


def whole_files(folder: Path) -> dict[str, tuple[str, bytes]]:
    """Good mesh files by a name: the scene that uses them, and their bytes."""
    files: dict[str, tuple[str, bytes]] = {}
    for end in (".msh", ".vtu", ".inp"):
        fem.write_mesh(frame(), folder / f"frame{end}")
        files[f"frame{end}"] = ("frame", (folder / f"frame{end}").read_bytes())
    content = meshio.vtu.read(folder / "frame.vtu")
    meshio.vtu.write(folder / "zlib.vtu", content, compression="zlib")
    files["zlib.vtu"] = ("frame", (folder / "zlib.vtu").read_bytes())
    meshio.vtu.write(folder / "ascii.vtu", content, binary=False)
    files["ascii.vtu"] = ("frame", (folder / "ascii.vtu").read_bytes())
    data = Path(__file__).parents[1] / "fem" / "data"
    for name in ("gmsh22", "gmsh22_binary", "gmsh41", "gmsh41_binary"):
        files[f"{name}.msh"] = ("gmsh", (data / f"{name}.msh").read_bytes())
    fem.write_mesh(block(), folder / "block.vtu")
    solid = meshio.vtu.read(folder / "block.vtu")
    meshio.vtu.write(folder / "block.vtu", solid, binary=False)
    files["block.vtu"] = ("structure", (folder / "block.vtu").read_bytes())
    return files


@st.composite
def spoiled_file(draw: Any, files: dict[str, tuple[str, bytes]]) -> tuple[str, bytes]:
    """Name and bytes of a mesh file that is cut, or holds other numbers, bytes or lines."""
    name = draw(st.sampled_from(sorted(files)))
    content = files[name][1]
    for _ in range(draw(st.integers(1, 3))):
        content = draw(st.sampled_from((_number, _number, _line, _bytes, _cut)))(draw, content)
    return name, content


def _number(draw: Any, content: bytes) -> bytes:
    found = list(NUMBER.finditer(content))
    if not found:
        return content
    at = found[draw(st.integers(0, len(found) - 1))]
    new = draw(st.sampled_from(NUMBERS) | st.integers(-2, 12).map(lambda n: b"%d" % n))
    return content[: at.start()] + new + content[at.end() :]


def _line(draw: Any, content: bytes) -> bytes:
    lines = content.splitlines(keepends=True)
    if not lines:
        return content
    at = draw(st.integers(0, len(lines) - 1))
    other = draw(st.integers(0, len(lines) - 1))
    change = draw(st.integers(0, 2))
    if change == 0:
        del lines[at]
    elif change == 1:
        lines.insert(at, lines[other])
    else:
        lines[at], lines[other] = lines[other], lines[at]
    return b"".join(lines)


def _bytes(draw: Any, content: bytes) -> bytes:
    first = draw(st.integers(0, len(content)))
    last = first + draw(st.integers(0, 12))
    new = draw(st.sampled_from(PIECES) | st.binary(max_size=8))
    return content[:first] + new + content[last:]


def _cut(draw: Any, content: bytes) -> bytes:
    return content[: draw(st.integers(0, len(content)))]


def packed_zeros(mebibytes: int) -> bytes:
    """What zlib makes of so many MiB of zeros, from one MiB: fully flushed blocks may repeat."""
    raw = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    block = raw.compress(bytes(1 << 20)) + raw.flush(zlib.Z_FULL_FLUSH)
    checksum = ((mebibytes << 20) % 65521 << 16) | 1  # of zeros, by RFC 1950
    return b"\x78\xda" + mebibytes * block + raw.flush() + checksum.to_bytes(4, "big")


@cache
def bombs() -> dict[str, bytes]:
    """Small files that declare, or unpack to, something huge."""
    head = b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
    huge = b"1000000000000"
    nodes = b"$Nodes\n2\n1 0 0 0\n2 1 0 0\n$EndNodes\n"
    tail = b"$Elements\n1\n1 1 2 1 1 1 2\n$EndElements\n"
    v41 = b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
    binary = b"$MeshFormat\n4.1 1 8\n" + np.int32(1).tobytes() + b"\n$EndMeshFormat\n"
    packed = packed_zeros(1 << 10)
    header = np.array([1, 1 << 30, 1 << 30, len(packed)], dtype=np.uint32).tobytes()
    array = (base64.b64encode(header) + base64.b64encode(packed)).decode()
    grid = (
        '<VTKFile type="UnstructuredGrid" version="0.1" compressor="vtkZLibDataCompressor">'
        '<UnstructuredGrid><Piece NumberOfPoints="2" NumberOfCells="1"><Points>'
        '<DataArray type="Float64" Name="Points" NumberOfComponents="3" format="{}">{}</DataArray>'
        "</Points></Piece></UnstructuredGrid></VTKFile>"
    )
    laughs = '<?xml version="1.0"?><!DOCTYPE z [<!ENTITY a "ha">' + "".join(
        f'<!ENTITY {chr(98 + i)} "{10 * f"&{chr(97 + i)};"}">' for i in range(12)
    )
    outside = '<?xml version="1.0"?><!DOCTYPE z [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
    ascii_grid = grid.replace(' compressor="vtkZLibDataCompressor"', "")
    return {
        "many_nodes.msh": head + b"$Nodes\n" + huge + b"\n1 0 0 0\n$EndNodes\n" + tail,
        "many_elements.msh": head + nodes + b"$Elements\n" + huge + b"\n1 1 2 1 1 1 2\n"
        b"$EndElements\n",
        "high_number.msh": head + b"$Nodes\n2\n1 0 0 0\n2000000000 1 0 0\n$EndNodes\n" + tail,
        "many_names.msh": head + b"$PhysicalNames\n" + huge + b"\n$EndPhysicalNames\n" + nodes
        + tail,
        "many_nodes_41.msh": v41 + b"$Nodes\n1 " + huge + b" 1 2\n1 1 0 2\n1\n2\n0 0 0\n1 0 0\n"
        b"$EndNodes\n$Elements\n1 1 1 1\n1 1 1 1\n1 1 2\n$EndElements\n",
        "high_number_41.msh": v41 + b"$Nodes\n1 2 1 2\n1 1 0 2\n1\n" + huge + b"\n0 0 0\n1 0 0\n"
        b"$EndNodes\n$Elements\n1 1 1 1\n1 1 1 1\n1 1 2\n$EndElements\n",
        "many_elements_41.msh": v41 + b"$Nodes\n1 2 1 2\n1 1 0 2\n1\n2\n0 0 0\n1 0 0\n$EndNodes\n"
        b"$Elements\n1 1 1 1\n1 1 1 " + huge + b"\n1 1 2\n$EndElements\n",
        "many_entities.msh": v41 + b"$Entities\n0 " + huge + b" 0 0\n$EndEntities\n" + tail,
        "binary.msh": binary + b"$Nodes\n" + np.array([1, 10**12, 1, 2], np.uint64).tobytes()
        + b"\n$EndNodes\n$Elements\n$EndElements\n",
        "zlib.vtu": grid.format("binary", array).encode(),
        "points.vtu": ascii_grid.format("ascii", "0 0 0 1 0 0")
        .replace('"2"', f'"{huge.decode()}"').encode(),
        "laughs.vtu": (laughs + "]>" + ascii_grid.format("ascii", "&m;")).encode(),
        "outside.vtu": (outside + ascii_grid.format("ascii", "&a;")).encode(),
        "range.inp": b"*NODE\n1, 0, 0\n*NSET, NSET=a, GENERATE\n" + b"1, 9999999, 1\n" * 1000,
        "label.inp": b"*NODE\n1, 0, 0\n" + b"9" * 5000 + b", 1, 0\n",
        "circle.inp": b"*INCLUDE, INPUT=circle.inp\n",
        "twice.inp": b"*INCLUDE, INPUT=twice.inp\n*INCLUDE, INPUT=twice.inp\n",
        "device.inp": b"*INCLUDE, INPUT=/dev/zero\n",
        "passwd.inp": b"*INCLUDE, INPUT=/etc/passwd\n",
    }  # fmt: skip
