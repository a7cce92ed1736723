"""Component mode synthesis: reduce a linear component to a few modal coordinates."""

from cms.accuracy import Accuracy, accuracy
from cms.checks import Checks, check, mac
from cms.component import ComponentLike
from cms.coupled_accuracy import CoupledAccuracy, coupled_accuracy
from cms.coupling import Joint, couple
from cms.errors import ReductionError
from cms.matrix_files import ReadMatrices, read_matrices
from cms.model import ReducedModel
from cms.reduction import METHODS, Matrices, keep_modes, reduce

__all__ = [
    "METHODS",
    "Accuracy",
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
