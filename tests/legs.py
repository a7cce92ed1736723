"""A branch followed in one direction only."""

from nldyn import ContinuationOptions
from nldyn.branches.arclength import Stepper
from nldyn.branches.leg import Leg, LegBuilder


def leg_from(start, limits) -> Leg:
    """What a walk finds from a point on, in the direction of its tangent."""
    return LegBuilder(Stepper(start, limits, ContinuationOptions())).follow()
