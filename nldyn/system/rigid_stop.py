"""Rigid stops: Newton's law of impact with a coefficient of restitution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

from nldyn.base.errors import SystemModelError, check_types, is_finite, shown
from nldyn.system.contact_law import ContactLaw, numba_for
from nldyn.system.friction import Across, Friction, across_of, check_plane
from nldyn.system.round_stop import RoundStop
from nldyn.system.stop import Stop, check_other_side, check_tangent
from nldyn.system.values import check_restitution, check_sides

Restitution = Callable[[float], tuple[float, float]]
TRIED_SPEEDS = tuple(10.0**k for k in range(-12, 4))  # m/s
STEP, WRONG_SLOPE, DIGITS = 1e-5, 1e-3, 1e-10  # of the differences that check a law's derivative


@dataclass(frozen=True)
class RigidStop:
    r"""One-sided rigid stop: a body that closes the gap at the speed v leaves it at e v.

    The penetration δ is that of a `Stop`. At an impact the velocities jump by an impulse that acts
    on all retained modes, :math:`\dot q^+ = \dot q^- - c\,(1 + e)\,v / (c \cdot c)` with the vector
    c of the gap; more modes make the mass 1/(c·c) that takes part smaller. Impacts that follow each
    other ever faster end in rest on the stop, under a force that lasts until it would have to pull.
    Where several rigid stops are hit at once, impacts follow each other within the instant, the
    fastest first, until no gap closes: energy never grows.

    With friction an impact has an impulse along `tangent`, too, by Coulomb's law at each instant of
    it: what slides takes μ times the normal impulse, until it sticks, or slides back where the
    normal impulse drives it. Compression ends where the gap closes no more; the whole normal
    impulse is 1 + e times the one up to there, which is Poisson's hypothesis, by Routh's method. It
    takes energy out in every case, which Newton's hypothesis (the rebound is e v) does not where
    normal and tangent are coupled. Where they are not, as at a block on a table, they agree.
    On the stop it sticks, or slides at μ times the force of rest. Where a large μ leaves no force
    or several (Painlevé), the flow map fails with a sentence that names the stop and the phase.
    With a `second_tangent` it slides over the plane of both: friction is against its sliding there,
    whose direction turns in an impact where the masses along both, or normal and tangents, differ
    or are coupled.

    Parameters
    ----------
    at : str
        Interface that hits the stop.
    restitution : float or callable
        Coefficient e, from 0 to 1. Or a function of the impact speed in m/s that gives e and its
        derivative de/dv in s/m; numba (``pip install 'nldyn[laws]'``)
        must be able to compile it.
    gap : float
        Distance in m at rest, not negative.
    direction : {1, -1}
        Sign of the displacement that closes the gap.
    against : str, optional
        Interface on the other side; the ground unless given.
    tangent, friction, tangent_against : optional
        As for a `Stop`. The coefficient is one, at rest and sliding.
    area, share
        As for a `Stop`: of a point of an area of contact, which must have no mass.
    second_tangent, second_tangent_against : str, optional
        As for a `Stop`.

    Raises
    ------
    SystemModelError
        For a value that is out of range.

    References
    ----------
    S. W. Shaw, P. J. Holmes (1983), *J. Sound Vib.* 90, 129-155; F. Pfeiffer, C. Glocker (1996),
    *Multibody Dynamics with Unilateral Contacts*, ch. 8. For friction E. J. Routh (1905), *Dynamics
    of a System of Rigid Bodies, Elementary Part*, ch. 4; T. R. Kane, D. A. Levinson (1985),
    *Dynamics: Theory and Applications*; J. B. Keller (1986), *J. Appl. Mech.* 53, 1-4; W. J.
    Stronge (2000), *Impact Mechanics*, ch. 4; Y. Wang, M. T. Mason (1992), *J. Appl. Mech.* 59,
    635-642; F. Génot, B. Brogliato (1999), *Eur. J. Mech. A/Solids* 18, 653-677.

    Examples
    --------
    >>> RigidStop("middle", restitution=0.8).gap
    0.0
    """

    at: str
    restitution: float | Restitution
    gap: float = 0.0
    direction: int = 1
    against: str | None = None
    tangent: str | None = None
    friction: Friction | float | None = None
    tangent_against: str | None = None
    area: str | None = None
    share: float = 1.0
    second_tangent: str | None = None
    second_tangent_against: str | None = None
    impulsive: ClassVar[bool] = True
    sharp: ClassVar[bool] = True
    jumps: ClassVar[bool] = True
    is_linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_types(**{"stop: at": (self.at, str), "stop: against": (self.against, str, None)})
        owner = f"rigid stop at '{self.at}'"
        if callable(self.restitution):
            for speed in TRIED_SPEEDS:
                _check_restitution(owner, self.restitution, speed)
        else:
            check_restitution(owner, self.restitution)
        if not (is_finite(self.gap) and self.gap >= 0.0):
            raise SystemModelError(
                f"{owner}: gap must not be negative, got {shown(self.gap)}: a preload needs a "
                "stop with a stiffness"
            )
        check_sides(owner, self.at, self.against, self.direction)
        ends = (self.tangent, self.tangent_against)
        law = check_tangent(owner, (self.at, self.against), ends, self.friction)
        if law is None and self.across is not None:
            raise SystemModelError(f"{owner}: friction needs both friction and tangent")
        if law is not None:
            check_plane(owner, (self.at, self.against, *ends), self.across, law)
            beside = self.second_tangent_against
            check_other_side(owner, "second_tangent_against", beside, self.against)
        object.__setattr__(self, "friction", law)

    @property
    def across(self) -> Across:
        """Ends of its second tangent, if it has one."""
        return across_of(self.second_tangent, self.second_tangent_against)

    @property
    def reach(self) -> float:
        """Displacement in m of the size of those with which it is touched."""
        return self.gap

    def out_of_reach(self, size: float) -> RigidStop:
        """The same where what moves no farther than `size` from rest does not hit it."""
        return replace(self, gap=self.gap + size)

    @property
    def law(self) -> ContactLaw | None:
        """The restitution as the engine calls a law, where it is a function of the speed."""
        return _as_law(self.restitution) if callable(self.restitution) else None

    @property
    def depends_on_speed(self) -> bool:
        """Whether an impact takes energy out."""
        loses = callable(self.restitution) or self.restitution != 1.0
        return loses or self.friction is not None

    def determinant(self, speed: float) -> float:
        """Factor e (e + v de/dv) by which an impact at a speed changes volumes of states.

        Examples
        --------
        >>> RigidStop("middle", 0.5).determinant(1.0)
        0.25
        """
        if not callable(self.restitution):
            return self.restitution**2
        e, slope = self.restitution(speed)
        return float(e * (e + speed * slope))

    def restitution_at(self, speed: float) -> float:
        """Coefficient of restitution at an impact speed in m/s.

        Examples
        --------
        >>> RigidStop("middle", 0.8).restitution_at(1.0)
        0.8
        """
        return float(self.restitution(speed)[0]) if callable(self.restitution) else self.restitution


AnyStop = Stop | RigidStop | RoundStop


def _check_restitution(owner: str, restitution: Restitution, speed: float) -> None:
    """Refuse a function that gives no coefficient at a speed, or a wrong derivative."""

    def values(speed: float) -> tuple[float, float]:
        try:
            e, slope = (float(x) for x in restitution(speed))
        except (TypeError, ValueError, ArithmeticError) as error:
            raise SystemModelError(
                f"{owner}: restitution({speed:g}) must give two numbers (the coefficient and its "
                f"derivative by the speed): {error}"
            ) from None
        if not (0.0 <= e <= 1.0 and is_finite(slope)):
            raise SystemModelError(
                f"{owner}: restitution({speed:g}) must lie between 0 and 1 with a finite "
                f"derivative, got {e:g} and {slope:g}"
            )
        return e, slope

    step = STEP * speed
    _, slope = values(speed)
    change = (values(speed + step)[0] - values(speed - step)[0]) / (2.0 * step)
    if abs(change - slope) > WRONG_SLOPE * abs(slope) + DIGITS / speed:
        raise SystemModelError(
            f"{owner}: restitution says {slope:g} for its derivative at {speed:g} m/s, but it "
            f"changes by {change:g}"
        )


@cache
def _as_law(restitution: Restitution) -> ContactLaw:
    numba = numba_for("a restitution by the speed")
    inner = restitution if hasattr(restitution, "py_func") else numba.njit(restitution)

    def law(delta: float, speed: float) -> tuple[float, float, float]:
        e, slope = inner(speed)
        return e, 0.0, slope

    law.__name__ = getattr(restitution, "__name__", "restitution")
    return law
