"""Frames to draw."""

from __future__ import annotations

import pytest

import fem

STEEL = fem.Material(2.1e11, 7800.0)


@pytest.fixture
def half_beam():
    """Coarse half of a beam on leaf springs, symmetric at the middle, with a mass there."""
    mesh = fem.frame_mesh(
        {"corner": (0, 0), "middle": (0.66, 0), "foot": (0, -0.113)},
        [("beam", "corner", "middle", 6), ("leaf", "corner", "foot", 3)],
    )
    return fem.assemble(
        fem.StructureModel(
            mesh,
            parts={
                "beam": fem.BeamPart(STEEL, fem.RectangularSection(width=0.09, height=0.01)),
                "leaf": fem.BeamPart(STEEL, fem.RectangularSection(width=0.075, height=0.001)),
            },
            supports=[
                fem.Support("middle", ("x", "rotation")),
                fem.Support("foot", ("x", "y", "rotation")),
            ],
            point_masses=[fem.PointMass("middle", 0.19)],
            interfaces={"middle": fem.Interface("middle", "y")},
            plane=True,
        )
    )


@pytest.fixture
def portal():
    """A portal with round columns, a pin, a roller, a loose mass and a section by numbers only."""
    mesh = fem.frame_mesh(
        {"a": (0, 0), "b": (0, 3), "c": (4, 3), "d": (4, 0), "e": (5, 3)},
        [("column", "a", "b", 2), ("girder", "b", "c", 2), ("column", "c", "d", 1),
         ("girder", "c", "e", 1)],
    )  # fmt: skip
    return fem.assemble(
        fem.StructureModel(
            mesh,
            parts={
                "column": fem.BeamPart(STEEL, fem.CircularSection(0.2, bore=0.18)),
                "girder": fem.BeamPart(STEEL, fem.Section(2.85e-3, 1.94e-5)),
            },
            supports=[
                fem.Support("a", ("x", "y")),
                fem.Support("d", "y"),
                fem.Support("e", "rotation"),
            ],
            point_masses=[fem.PointMass("e", 20.0)],
            hinges=[fem.Hinge("b", "girder")],
            interfaces={"b": fem.Interface("b", "x")},
            plane=True,
        )
    )
