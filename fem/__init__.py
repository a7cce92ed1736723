"""Structures: from a mesh to stiffness, mass and interfaces."""

from fem.assembly.component import (
    Component,
    DistortionWarning,
    LockingWarning,
    MeshWarning,
    assemble,
)
from fem.assembly.contact import ContactPoints, contact_points, unit_vector
from fem.assembly.opposite import ContactPair, opposite_points
from fem.assembly.summary import MassProperties, mass_properties, summary
from fem.base.errors import JointWarning, ModelError
from fem.checks.unlikely import UnlikelyWarning
from fem.formats.abaqus import read_abaqus
from fem.formats.from_meshio import from_meshio
from fem.formats.read import read_mesh
from fem.formats.write import write_mesh
from fem.mesh.attachments import (
    Attachments,
    Coupling,
    LeftOut,
    LinearEquation,
    Link,
    PointMass,
    PointMatrix,
    PointSpring,
    Support,
)
from fem.mesh.frames import frame_mesh
from fem.mesh.pieces import Pieces, pieces_of
from fem.mesh.places import node_at, nodes_inside
from fem.mesh.refine import refined
from fem.mesh.structure_mesh import StructureMesh, box_mesh, joined
from fem.model.calibrate import Calibration, calibrate
from fem.model.described import parts_of
from fem.model.parts import BeamPart, Material, ShellPart, SolidPart, TrussPart
from fem.model.plates import Layer, PlateSection, layered
from fem.model.sections import (
    CircularSection,
    CrossSection,
    LinearSection,
    RectangularSection,
    Section,
    TaperedSection,
)
from fem.model.structure import StructureModel, symmetry
from fem.model.supports import Foundation, Hinge, Interface

__version__ = "1.0.0"

__all__ = [
    "Attachments",
    "BeamPart",
    "Calibration",
    "CircularSection",
    "Component",
    "ContactPair",
    "ContactPoints",
    "Coupling",
    "CrossSection",
    "DistortionWarning",
    "Foundation",
    "Hinge",
    "Interface",
    "JointWarning",
    "Layer",
    "LeftOut",
    "LinearEquation",
    "LinearSection",
    "Link",
    "LockingWarning",
    "MassProperties",
    "Material",
    "MeshWarning",
    "ModelError",
    "Pieces",
    "PlateSection",
    "PointMass",
    "PointMatrix",
    "PointSpring",
    "RectangularSection",
    "Section",
    "ShellPart",
    "SolidPart",
    "StructureMesh",
    "StructureModel",
    "Support",
    "TaperedSection",
    "TrussPart",
    "UnlikelyWarning",
    "assemble",
    "box_mesh",
    "calibrate",
    "contact_points",
    "frame_mesh",
    "from_meshio",
    "joined",
    "layered",
    "mass_properties",
    "node_at",
    "nodes_inside",
    "opposite_points",
    "parts_of",
    "pieces_of",
    "read_abaqus",
    "read_mesh",
    "refined",
    "summary",
    "symmetry",
    "unit_vector",
    "write_mesh",
]
