"""How many modes: the names that are not in the face of nldyn."""

from nldyn.reduction.convergence import ConvergenceStudy as ConvergenceStudy
from nldyn.reduction.selection import ModeSelection as ModeSelection
from nldyn.reduction.studied import JoinedComponents as JoinedComponents
