"""Frames and structures: from a mesh to stiffness, mass and interfaces."""

from fem.abaqus import read_abaqus
from fem.assemble import assemble
from fem.calibrate import Calibration, calibrate
from fem.errors import JointWarning, ModelError
from fem.frame import Component
from fem.mesh import FrameMesh, frame_mesh
from fem.model import (
    BeamPart,
    FrameModel,
    Hinge,
    Interface,
    Material,
    PointMass,
    PointSpring,
    Support,
    TrussPart,
)
from fem.read import from_meshio, read_mesh, read_structure, structure_from_meshio
from fem.sections import (
    CircularSection,
    CrossSection,
    RectangularSection,
    Section,
    TaperedSection,
)
from fem.shells import ShellPart
from fem.structure import Coupling, Foundation, SolidPart, StructureModel, symmetry
from fem.structure_assembly import LockingWarning, StructureComponent
from fem.structure_mesh import StructureMesh, box_mesh, joined, structure_mesh
from fem.write import write_mesh

__all__ = [
    "BeamPart",
    "Calibration",
    "CircularSection",
    "Component",
    "Coupling",
    "CrossSection",
    "Foundation",
    "FrameMesh",
    "FrameModel",
    "Hinge",
    "Interface",
    "JointWarning",
    "LockingWarning",
    "Material",
    "ModelError",
    "PointMass",
    "PointSpring",
    "RectangularSection",
    "Section",
    "ShellPart",
    "SolidPart",
    "StructureComponent",
    "StructureMesh",
    "StructureModel",
    "Support",
    "TaperedSection",
    "TrussPart",
    "assemble",
    "box_mesh",
    "calibrate",
    "frame_mesh",
    "from_meshio",
    "joined",
    "read_abaqus",
    "read_mesh",
    "read_structure",
    "structure_from_meshio",
    "structure_mesh",
    "symmetry",
    "write_mesh",
]
