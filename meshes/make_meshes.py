"""Make the meshes of the paper's beam: half of it, the whole, and half in solids.

The dimensions are those of half_beam.toml.

Run as ``python meshes/make_meshes.py``. The files are written beside this script.

The beam lies along x, the leaf springs stand under its ends. The half beam reaches from its end
"corner" at the origin to the "middle"; its leaf ends at the "foot". The full beam has
"corner_left", "foot_left", "middle", "corner_right" and "foot_right". half_beam_coarse.msh has two
elements in half the beam and one in its leaf: the start of studies of the mesh.

half_beam_solid.vtu is the half beam in second-order hexahedra, with the axes where the lines of the
frame are: the leaf spring reaches up to the axis of the beam, and couplings to the point "corner"
join its upper end, "leaf_top", with the end of the beam, "beam_end". Its other faces are
"middle_face" and "foot"; "lengthwise" are the nodes in the plane z = 0.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import fem

HERE = Path(__file__).resolve().parent
DIMENSIONS = HERE / "half_beam.toml"

YOUNGS_MODULUS = 2.1e11
BEAM = fem.BeamPart(
    fem.Material(YOUNGS_MODULUS, 7746.0), fem.RectangularSection(width=0.09, height=0.01)
)
LEAF = fem.BeamPart(
    fem.Material(YOUNGS_MODULUS, 7713.0), fem.RectangularSection(width=0.075, height=0.001)
)
PARTS = {"beam": BEAM, "leaf": LEAF}
CLAMP = ("x", "y", "rotation")

BEAM_ELEMENTS = 72
"""Elements of half the beam; with `LEAF_ELEMENTS` the three lowest frequencies of the half
beam are within 1e-7 of those of the continuous beam."""
LEAF_ELEMENTS = 20
SOLID_BEAM_CELLS = (40, 1, 4)
"""Along the half beam, through its height and across its width; a finer mesh changes the three
lowest symmetric frequencies by less than 1e-3."""
SOLID_LEAF_CELLS = (1, 24, 8)
"""Through the thickness of the leaf, along it and across its width."""
POISSONS_RATIO = 0.3


@dataclass(frozen=True)
class Dimensions:
    """What the paper's text does not give: lengths in m and the mass at the middle in kg.

    `beam_length` and `middle_mass` are those of the whole beam.
    """

    beam_length: float
    leaf_length: float
    middle_mass: float


def read_dimensions(path: Path = DIMENSIONS) -> Dimensions:
    """The calibrated dimensions."""
    return Dimensions(**tomllib.loads(path.read_text(encoding="utf-8")))


def half_beam_mesh(
    dimensions: Dimensions, beam_elements: int = BEAM_ELEMENTS, leaf_elements: int = LEAF_ELEMENTS
) -> fem.StructureMesh:
    """Half the beam from its left end to the middle, with its leaf spring."""
    points = {
        "corner": (0.0, 0.0),
        "middle": (dimensions.beam_length / 2, 0.0),
        "foot": (0.0, -dimensions.leaf_length),
    }
    return fem.frame_mesh(
        points,
        [("beam", "corner", "middle", beam_elements), ("leaf", "corner", "foot", leaf_elements)],
        source="half beam",
    )


def full_beam_mesh(
    dimensions: Dimensions, beam_elements: int = BEAM_ELEMENTS, leaf_elements: int = LEAF_ELEMENTS
) -> fem.StructureMesh:
    """The whole beam with both leaf springs."""
    length, leaf = dimensions.beam_length, dimensions.leaf_length
    points = {
        "corner_left": (0.0, 0.0),
        "middle": (length / 2, 0.0),
        "corner_right": (length, 0.0),
        "foot_left": (0.0, -leaf),
        "foot_right": (length, -leaf),
    }
    members = [
        ("beam", "corner_left", "middle", beam_elements),
        ("beam", "middle", "corner_right", beam_elements),
        ("leaf", "corner_left", "foot_left", leaf_elements),
        ("leaf", "corner_right", "foot_right", leaf_elements),
    ]
    return fem.frame_mesh(points, members, source="full beam")


def solid_half_beam_mesh(
    dimensions: Dimensions,
    beam_cells: tuple[int, int, int] = SOLID_BEAM_CELLS,
    leaf_cells: tuple[int, int, int] = SOLID_LEAF_CELLS,
) -> fem.StructureMesh:
    """Half the beam and its leaf spring in solids; they share no node."""
    length, leaf = dimensions.beam_length / 2, dimensions.leaf_length
    height, width = BEAM.section.height, BEAM.section.width
    thickness, breadth = LEAF.section.height, LEAF.section.width
    beam = fem.box_mesh(
        "beam", (length, height, width), beam_cells, origin=(0.0, -height / 2, -width / 2)
    )
    spring = fem.box_mesh(
        "leaf", (thickness, leaf, breadth), leaf_cells,
        origin=(-thickness / 2, -leaf, -breadth / 2),
    )  # fmt: skip
    count = len(beam.points)
    points = np.vstack([beam.points, spring.points])
    (kind,) = beam.cells
    return fem.StructureMesh(
        points,
        {kind: np.vstack([beam.cells[kind], spring.cells[kind] + count])},
        {
            "beam": {kind: np.arange(len(beam.cells[kind]))},
            "leaf": {kind: len(beam.cells[kind]) + np.arange(len(spring.cells[kind]))},
        },
        {
            "beam_end": beam.nodes("x0"),
            "middle_face": beam.nodes("x1"),
            "leaf_top": spring.nodes("y1") + count,
            "foot": spring.nodes("y0") + count,
            "lengthwise": np.flatnonzero(np.abs(points[:, 2]) < 1e-9),
        },
        source="solid half beam",
    )


def solid_half_beam_model(
    mesh: fem.StructureMesh, middle_mass: float, poissons_ratio: float = POISSONS_RATIO
) -> fem.StructureModel:
    """Half the beam in solids, held and loaded as the frame of `half_beam_model`."""

    def solid(part: fem.BeamPart) -> fem.SolidPart:
        material = part.material
        return fem.SolidPart(
            fem.Material(material.youngs_modulus, material.density, poissons_ratio)
        )

    return fem.StructureModel(
        mesh,
        parts={"beam": solid(BEAM), "leaf": solid(LEAF)},
        supports=[
            fem.symmetry("middle_face", "x"),
            fem.Support("foot", ("x", "y", "z")),
            fem.Support("lengthwise", "z"),
            fem.Support("corner", "z"),
        ],
        couplings=[
            fem.Coupling("corner", "beam_end", at=(0.0, 0.0, 0.0), directions=("x", "y")),
            fem.Coupling("corner", "leaf_top", directions=("x", "y")),
            fem.Coupling("middle", "middle_face", "averaging"),
        ],
        point_masses=[fem.PointMass("middle", middle_mass / 2)],
        interfaces={"middle": fem.Interface("middle", "y")},
    )


def half_beam_model(
    mesh: fem.StructureMesh, middle_mass: float, beam: fem.BeamPart = BEAM
) -> fem.StructureModel:
    """Half the beam: symmetric at the middle, with half of the mass there; foot clamped."""
    return fem.StructureModel(
        mesh,
        parts={**PARTS, "beam": beam},
        supports=[fem.Support("middle", ("x", "rotation")), fem.Support("foot", CLAMP)],
        point_masses=[fem.PointMass("middle", middle_mass / 2)],
        interfaces={"middle": fem.Interface("middle", "y")},
        plane=True,
    )


def full_beam_model(mesh: fem.StructureMesh, middle_mass: float) -> fem.StructureModel:
    """The whole beam with both feet clamped."""
    return fem.StructureModel(
        mesh,
        parts=PARTS,
        supports=[fem.Support("foot_left", CLAMP), fem.Support("foot_right", CLAMP)],
        point_masses=[fem.PointMass("middle", middle_mass)],
        interfaces={"middle": fem.Interface("middle", "y")},
        plane=True,
    )


def tube_mesh() -> fem.StructureMesh:
    """A tube of a heat exchanger, 1.8 m between tube sheets, with a baffle in the middle."""
    places = {"left": (0.0, 0.0), "baffle": (0.9, 0.0), "quarter": (1.35, 0.0), "right": (1.8, 0.0)}
    ends = ("left", "baffle", 16), ("baffle", "quarter", 8), ("quarter", "right", 8)
    return fem.frame_mesh(places, [("tube", *pair) for pair in ends])


def strip_mesh() -> fem.StructureMesh:
    """A cantilever of 0.3 m."""
    return fem.frame_mesh({"root": (0.0, 0.0), "tip": (0.3, 0.0)}, [("strip", "root", "tip", 20)])


def two_beams_mesh() -> fem.StructureMesh:
    """Two cantilevers whose free ends overlap by 2 mm, 0.1 mm apart where they are 10 mm high."""
    places = {"root_a": (0.0, 0.0), "tip_a": (0.3, 0.0), "root_b": (0.588, 0.0101)}
    places |= {"half_b": (0.443, 0.0101), "tip_b": (0.298, 0.0101)}
    lines = [("beam_a", "root_a", "tip_a", 16)]
    lines += [("beam_b", "root_b", "half_b", 8), ("beam_b", "half_b", "tip_b", 8)]
    return fem.frame_mesh(places, lines)


def main() -> None:
    """Write all files."""
    dimensions = read_dimensions()
    half = half_beam_mesh(dimensions)
    for extension in (".msh", ".vtu", ".inp"):
        fem.write_mesh(half, HERE / f"half_beam{extension}")
    fem.write_mesh(half_beam_mesh(dimensions, 2, 1), HERE / "half_beam_coarse.msh")
    fem.write_mesh(full_beam_mesh(dimensions), HERE / "full_beam.msh")
    fem.write_mesh(solid_half_beam_mesh(dimensions), HERE / "half_beam_solid.vtu")
    fem.write_mesh(tube_mesh(), HERE / "tube.msh")
    fem.write_mesh(strip_mesh(), HERE / "strip.msh")
    fem.write_mesh(two_beams_mesh(), HERE / "two_beams.msh")


if __name__ == "__main__":
    main()
