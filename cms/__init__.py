"""Component mode synthesis: reduce a linear component to a few modal coordinates."""

from cms.component import ComponentLike
from cms.errors import ReductionError
from cms.model import ReducedModel
from cms.reduction import Matrices, reduce

__all__ = ["ComponentLike", "Matrices", "ReducedModel", "ReductionError", "reduce"]
