"""Plane frames of Euler-Bernoulli beams: from a mesh to stiffness, mass and interfaces."""

from fem.abaqus import read_abaqus
from fem.calibrate import Calibration, calibrate
from fem.errors import ModelError
from fem.frame import Component, assemble
from fem.mesh import FrameMesh, frame_mesh
from fem.model import (
    BeamPart,
    CircularSection,
    CrossSection,
    FrameModel,
    Hinge,
    Interface,
    Material,
    PointMass,
    PointSpring,
    RectangularSection,
    Section,
    Support,
)
from fem.read import from_meshio, read_mesh
from fem.write import write_mesh

__all__ = [
    "BeamPart",
    "Calibration",
    "CircularSection",
    "Component",
    "CrossSection",
    "FrameMesh",
    "FrameModel",
    "Hinge",
    "Interface",
    "Material",
    "ModelError",
    "PointMass",
    "PointSpring",
    "RectangularSection",
    "Section",
    "Support",
    "assemble",
    "calibrate",
    "frame_mesh",
    "from_meshio",
    "read_abaqus",
    "read_mesh",
    "write_mesh",
]
