"""Points of a branch: an orbit with the branch's direction, and special points."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, shown
from nldyn.orbits.orbit import Orbit, shifted_alike, stroboscopic

SAME_HZ, SAME_STATES = 1e-6, 1e-3  # relative, of an orbit at a special point or close beside it


@dataclass(frozen=True, eq=False)
class BranchNode:
    """An orbit on a branch with the branch's direction there.

    Parameters
    ----------
    orbit : Orbit
        The orbit.
    tangent : (N + 1,)
        Unit tangent in the metric of the shooting problem.
    arclength : float
        Relative arclength from the branch's first computed point.
    tests : dict of str to float
        Test functions, filled when first asked for (see `nldyn.bifurcations.sign_changes.tests`).
    """

    orbit: Orbit
    tangent: Real
    arclength: float
    tests: dict[str, float] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        """One line: the orbit and where it is along the branch."""
        return f"<BranchNode at arclength {self.arclength:.4g}: {self.orbit!r}>"


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A located bifurcation or grazing point.

    Parameters
    ----------
    kind : {"LP", "PD", "NS", "BP", "GR"}
        Cyclic fold, flip, Neimark-Sacker, branch point, grazing.
    point : BranchNode
        The orbit at which it happens.
    frequency_error : float
        Estimated error of the root in frequency and the last Newton step, relative.
    """

    kind: str
    point: BranchNode
    frequency_error: float

    def __repr__(self) -> str:
        """One line: kind, frequency with its error, the orbit's period and size."""
        orbit = self.orbit
        return (
            f"<{self.kind} at {self.frequency_hz:.9g} Hz (error {self.frequency_error:.1g}): "
            f"period {orbit.period}, {orbit.max_abs_displacement:.4g} m>"
        )

    @property
    def orbit(self) -> Orbit:
        """The orbit."""
        return self.point.orbit

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return self.point.orbit.frequency_hz


def check_special(caller: str, special: object, kind: str = "", *, of_branch: bool = True) -> None:
    """Refuse anything but a special point, of a branch and of a kind where these are wanted.

    Raises
    ------
    SystemModelError
        As said.
    """
    found, orbit = getattr(special, "kind", None), getattr(special, "orbit", None)
    if not (isinstance(found, str) and isinstance(orbit, Orbit)):
        raise SystemModelError(f"{caller} needs a special point, got {shown(special)}")
    if kind and found != kind:
        raise SystemModelError(f"{caller} needs a {kind} point, got {found}")
    if of_branch and not isinstance(getattr(special, "point", None), BranchNode):
        raise SystemModelError(
            f"{caller} needs a special point of a branch, which knows the branch's direction; "
            f"the {found} point at {orbit.frequency_hz:g} Hz was found otherwise"
        )


def is_at(orbit: Orbit, special: SpecialPoint, multiple: int = 1) -> bool:
    """Whether an orbit is that of a special point, run through several times, up to a shift.

    Mirror images are not the same.
    """
    other = special.orbit
    if orbit.period != multiple * other.period:
        return False
    if not math.isclose(orbit.frequency_hz, special.frequency_hz, rel_tol=SAME_HZ):
        return False
    states = np.tile(stroboscopic(other), (multiple, 1))
    return shifted_alike(stroboscopic(orbit), states, SAME_STATES * float(np.abs(states).max()))
