"""Make the meshes of the paper's beam: half of it and the whole, from half_beam.toml.

Run as ``python meshes/make_meshes.py``. The files are written beside this script.

The beam lies along x, the leaf springs stand under its ends. The half beam reaches from its end
"corner" at the origin to the "middle"; its leaf ends at the "foot". The full beam has
"corner_left", "foot_left", "middle", "corner_right" and "foot_right".
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

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
) -> fem.FrameMesh:
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
) -> fem.FrameMesh:
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


def half_beam_model(
    mesh: fem.FrameMesh, middle_mass: float, beam: fem.BeamPart = BEAM
) -> fem.FrameModel:
    """Half the beam: symmetric at the middle, with half of the mass there; foot clamped."""
    return fem.FrameModel(
        mesh,
        parts={**PARTS, "beam": beam},
        supports=[fem.Support("middle", ("x", "rotation")), fem.Support("foot", CLAMP)],
        point_masses=[fem.PointMass("middle", middle_mass / 2)],
        interfaces={"middle": fem.Interface("middle", "y")},
    )


def full_beam_model(mesh: fem.FrameMesh, middle_mass: float) -> fem.FrameModel:
    """The whole beam with both feet clamped."""
    return fem.FrameModel(
        mesh,
        parts=PARTS,
        supports=[fem.Support("foot_left", CLAMP), fem.Support("foot_right", CLAMP)],
        point_masses=[fem.PointMass("middle", middle_mass)],
        interfaces={"middle": fem.Interface("middle", "y")},
    )


def main() -> None:
    """Write half_beam.msh, .vtu, .inp and full_beam.msh."""
    dimensions = read_dimensions()
    half = half_beam_mesh(dimensions)
    for extension in (".msh", ".vtu", ".inp"):
        fem.write_mesh(half, HERE / f"half_beam{extension}")
    fem.write_mesh(full_beam_mesh(dimensions), HERE / "full_beam.msh")


if __name__ == "__main__":
    main()
