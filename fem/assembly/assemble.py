"""Assembly of frames and structures."""

from __future__ import annotations

from typing import overload

from fem.assembly.frame import Component, assemble_frame
from fem.assembly.structure import StructureComponent, assemble_structure
from fem.base.errors import ModelError
from fem.model.frame import FrameModel
from fem.model.structure import StructureModel


@overload
def assemble(model: FrameModel) -> Component: ...


@overload
def assemble(model: StructureModel) -> StructureComponent: ...


def assemble(model: FrameModel | StructureModel) -> Component | StructureComponent:
    """Assemble stiffness and consistent mass of a plane frame or of a structure.

    Parameters
    ----------
    model
        What is assembled. It may float freely or be a mechanism.

    Returns
    -------
    Component or StructureComponent
        Matrices of the free degrees of freedom and the interface vectors.

    Raises
    ------
    ModelError
        If the supports leave nothing free, a part lacks a number, or a cell is flat or folded.

    Notes
    -----
    Beams: cubic Hermite bending and linear stretching [1]_, with shear deformation and rotary
    inertia where a part is a Timoshenko beam. The error of a bending frequency falls with the
    fourth power of the element length as long as stretching does not matter, else with the
    second. Solids: displacements of first or second order, fully integrated; the error of a
    frequency falls with the second or fourth power of the cell size where the solution is smooth.

    .. [1] M. Petyt, Introduction to Finite Element Vibration Analysis, 2nd ed., Cambridge
       University Press, 2010, sections 3.2, 3.4 and 3.5.

    Examples
    --------
    The tip of a cantilever under 1 N moves by L³/(3 E I):

    >>> import fem
    >>> from scipy.sparse.linalg import spsolve
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (2, 0)}, [("arm", "root", "tip", 3)])
    >>> component = fem.assemble(fem.FrameModel(
    ...     mesh,
    ...     parts={"arm": fem.BeamPart(fem.Material(2e11, 7800.0), fem.Section(1e-3, 1e-8))},
    ...     supports=[fem.Support("root", ("x", "y", "rotation"))],
    ...     interfaces={"tip": fem.Interface("tip", "y")},
    ... ))
    >>> tip = component.interfaces["tip"]
    >>> bool(abs(tip @ spsolve(component.stiffness, tip) / (8 / (3 * 2e11 * 1e-8)) - 1) < 1e-12)
    True
    """
    if isinstance(model, FrameModel):
        return assemble_frame(model)
    if isinstance(model, StructureModel):
        return assemble_structure(model)
    raise ModelError(f"assemble needs a FrameModel or a StructureModel, not {model!r}")
