"""Frames and structures: from a mesh to stiffness, mass and interfaces."""

from fem.abaqus import read_abaqus
from fem.assemble import assemble
from fem.attachments import (
    Attachments,
    Coupling,
    LeftOut,
    LinearEquation,
    Link,
    PointMass,
    PointSpring,
)
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
    Support,
    TrussPart,
)
from fem.pieces import Pieces, pieces_of
from fem.places import node_at, nodes_inside
from fem.read import from_meshio, read_mesh, read_structure, structure_from_meshio
from fem.refine import refined
from fem.sections import (
    CircularSection,
    CrossSection,
    RectangularSection,
    Section,
    TaperedSection,
)
from fem.shells import ShellPart
from fem.structure import Foundation, SolidPart, StructureModel, symmetry
from fem.structure_assembly import DistortionWarning, LockingWarning, StructureComponent
from fem.structure_mesh import StructureMesh, box_mesh, joined, structure_mesh
from fem.summary import MassProperties, mass_properties, summary
from fem.unlikely import UnlikelyWarning
from fem.write import write_mesh

__all__ = [
    "Attachments",
    "BeamPart",
    "Calibration",
    "CircularSection",
    "Component",
    "Coupling",
    "CrossSection",
    "DistortionWarning",
    "Foundation",
    "FrameMesh",
    "FrameModel",
    "Hinge",
    "Interface",
    "JointWarning",
    "LeftOut",
    "LinearEquation",
    "Link",
    "LockingWarning",
    "MassProperties",
    "Material",
    "ModelError",
    "Pieces",
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
    "UnlikelyWarning",
    "assemble",
    "box_mesh",
    "calibrate",
    "frame_mesh",
    "from_meshio",
    "joined",
    "mass_properties",
    "node_at",
    "nodes_inside",
    "pieces_of",
    "read_abaqus",
    "read_mesh",
    "read_structure",
    "refined",
    "structure_from_meshio",
    "structure_mesh",
    "summary",
    "symmetry",
    "write_mesh",
]
