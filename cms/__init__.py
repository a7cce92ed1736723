"""Component mode synthesis: reduce a linear component to a few modal coordinates."""

from cms.base.errors import ReductionError
from cms.checks.accuracy import Accuracy, accuracy
from cms.checks.checks import Checks, check, mac
from cms.checks.coupled_accuracy import CoupledAccuracy, coupled_accuracy
from cms.component.component import ComponentLike, Matrices
from cms.files.matrix_files import ReadMatrices, read_matrices
from cms.reduction.area import Area, Attached
from cms.reduction.coupling import Joint, couple
from cms.reduction.model import ReducedModel
from cms.reduction.reduction import METHODS, keep_modes, reduce

__version__ = "1.0.0"

__all__ = [
    "METHODS",
    "Accuracy",
    "Area",
    "Attached",
    "Checks",
    "ComponentLike",
    "CoupledAccuracy",
    "Joint",
    "Matrices",
    "ReadMatrices",
    "ReducedModel",
    "ReductionError",
    "accuracy",
    "check",
    "couple",
    "coupled_accuracy",
    "keep_modes",
    "mac",
    "read_matrices",
    "reduce",
]
