"""What may be in the way of a step of a walk: guards, each a test of a point that was found."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES
from nldyn.bifurcations.branch_crossing import (
    ON_CROSSING,
    SHORTEST_CROSSING,
    is_crossing,
    lies_on_crossing,
)
from nldyn.bifurcations.codimension_two import cosine_near, is_torus_curve, torus_cosine
from nldyn.bifurcations.corners import grazes_linear
from nldyn.bifurcations.period_doubling import half_difference, passed_flip
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.bifurcations.self_excited import sticking
from nldyn.bifurcations.sign_changes import crosses
from nldyn.bifurcations.touching import rigid_grazing, rigid_touches
from nldyn.branches.step_control import ContinuationOptions
from nldyn.orbits.bordered import FREE, Condition, Corrected, OrbitFamily, length_unit
from nldyn.orbits.conditions import TOUCH, Grazing, Singular, Turning
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import BROKEN, metric_length, shifts

KINK = TOUCH  # step below which a branch may bend by any angle where the number of contacts changes
BY_TOLERANCE = 1.0  # asymmetry over the tolerance of the flow map: its error (0.3 at most seen)
EQUAL_HALVES = 1e-3  # difference of an orbit's halves, over that of the orbit before
MEETING_STEP = 1e-4  # longest step over which a doubled branch may meet the one it comes from
GRAZES = 1e-4  # depth over size at which a walk that cannot go on is at a grazing of a rigid stop
FARTHEST_OFF = 0.75  # of the largest angle: how far, over the step, a point may lie off the tangent
NEAR_CROSSING = 0.1  # of the step: a crossing as near as this to its end is passed by another step
# The condition of a Neimark-Sacker point holds for neutral saddles, too, and some may be near: the
# cosine of the pair's angle changes by no more than this from point to point.
TURN = 0.1


@dataclass(frozen=True, eq=False)
class Attempt:
    """A step of a walk, and what Newton's method has found at its end.

    Parameters
    ----------
    here : BranchNode
        Where it begins.
    step : float
        Its arclength.
    direction, straight, cubic : (N + m,) array
        Unit tangent, the end on it, and the end on the cubic through the last two points.
    found : Corrected
        The orbit.
    options : ContinuationOptions
        Step control.
    crossing : float
        Longest step over which another branch may be crossed or met, if longer than usual.
    looked : bool
        Whether a corner ahead has been looked for.
    """

    here: BranchNode
    step: float
    direction: Real
    straight: Real
    cubic: Real
    found: Corrected
    options: ContinuationOptions
    crossing: float = 0.0
    looked: bool = False

    @property
    def weights(self) -> Real:
        """Metric where the step begins."""
        return self.here.weights

    @property
    def free(self) -> bool:
        """Whether the orbits of the branch meet no condition."""
        return self.here.condition is FREE

    @cached_property
    def there(self) -> BranchNode:
        """The point that was found."""
        return node_of(self.found, self.direction, self.here.arclength + self.step)

    @cached_property
    def miss(self) -> float:
        """Its distance from where it was predicted, relative to the step."""
        return metric_length(self.weights, self.found.point - self.cubic) / self.step

    @cached_property
    def off(self) -> float:
        """Its distance from the tangent."""
        return metric_length(self.weights, self.found.point - self.straight)

    @cached_property
    def angle(self) -> float:
        """Angle between the tangents at both ends."""
        tangent = self.there.tangent
        cosine = float(self.direction @ (self.weights * tangent))
        cosine /= metric_length(self.weights, tangent)
        return math.acos(min(max(cosine, -1.0), 1.0))

    @cached_property
    def touched(self) -> bool:
        """Whether the number of contacts changes."""
        return self.found.orbit.impacts != self.here.orbit.impacts

    @property
    def kinked(self) -> bool:
        """Whether the branch may bend by any angle.

        A linear stop that is touched bends it; a force that jumps does where the phase of a switch
        passes one of shooting, as the state there has a corner.
        """
        bends = self.free or isinstance(self.here.condition, Turning)
        if not (self.step <= KINK and bends and self.miss < 1.0):
            return False
        a, b = self.here.orbit, self.found.orbit
        return b.system.jumps or self.touched or rubs_all_around(a) != rubs_all_around(b)


Guard = Callable[[Attempt], str]


def no_orbit(attempt: Attempt) -> str:
    """Newton's method has failed."""
    found = attempt.found
    if found.converged:
        return ""
    step = found.solution is not None and found.step < math.inf
    return found.failure + (f", last relative step {found.step:.1e}" if step else "")


def _told(obstacle: str, holds: bool) -> str:
    return obstacle if holds else ""


def jumped(attempt: Attempt) -> str:
    """The orbit is one shifted by some excitation periods, or one of half the period."""
    family, here, there = attempt.here.family, attempt.here.point, attempt.found.point
    jump = is_shifted(family, here, attempt.straight, there)
    return _told("the next orbit is a shifted one, or one of half the period", jump)


def mends(attempt: Attempt) -> str:
    """A broken symmetry is whole again; along a curve rounding may break it."""
    here, there = attempt.here, attempt.there
    mended = mends_symmetry(here.family, here.asymmetry, there.asymmetry)
    return _told("the next orbit is a symmetric one", mended)


def changes_impacts(attempt: Attempt) -> str:
    """An impact with a rigid stop is lost or won, but for one that is let past."""
    if attempt.here.family.passages:
        return ""
    orbit = attempt.found.orbit
    changes = loses_impact(orbit) or grazing_between(attempt.here.orbit, orbit)
    return _told("an impact with a rigid stop is lost or won", changes)


def bends_at_rigid_grazing(attempt: Attempt) -> str:
    """The branch with a slight impact and that without meet in a corner."""
    bends = attempt.kinked and attempt.touched
    bends = bends and grazes_rigid(attempt.here.orbit, -GRAZES, GRAZES)
    return _told("the branch bends where a rigid stop is grazed", bends)


def misses(attempt: Attempt) -> str:
    """The point lies far from where it was predicted."""
    far = attempt.miss > attempt.options.max_miss
    return _told("the next point lies far from where it was predicted", far)


def is_off(attempt: Attempt) -> str:
    """It lies far from the tangent.

    A curve that turns by max_angle leaves its tangent by half of that: a longer correction has
    landed on another branch.
    """
    far = attempt.off > FARTHEST_OFF * attempt.options.max_angle * attempt.step
    return _told("the next point lies far from the tangent", far)


def turns(attempt: Attempt) -> str:
    """The branch turns far, or has no direction."""
    try:
        return _told("the direction changes too much", attempt.angle > attempt.options.max_angle)
    except FAILURES as error:
        if attempt.free:
            raise
        return str(error)


def changes_pair(attempt: Attempt) -> str:
    """A curve of Neimark-Sacker points has come to another pair, as that of a neutral saddle."""
    if not is_torus_curve(attempt.here.condition):
        return ""
    before = torus_cosine(attempt.here.orbit.multipliers)
    after = cosine_near(attempt.there.orbit.multipliers, before)
    return _told("the pair of multipliers changes too much", abs(after - before) > TURN)


def touches(attempt: Attempt) -> str:
    """The number of contacts changes in a long step.

    Where no corner was looked for, a curve of special points steps over none of a linear stop:
    beside it another piece of the curve may lie straight ahead.
    """
    here = attempt.here
    if not attempt.touched or isinstance(here.condition, Grazing):
        return ""
    root = isinstance(here.condition, Singular) and not attempt.looked and grazes_linear(here.orbit)
    far = root or attempt.step > attempt.options.grazing_step
    return _told("the number of contacts changes", far)


def changes_sticking(attempt: Attempt) -> str:
    """A self-excited motion begins or ceases to stick: its branch has a corner."""
    here = attempt.here
    if not isinstance(here.condition, Turning) or not here.orbit.system.rubbing:
        return ""
    changes = sticking(here.orbit) != sticking(attempt.found.orbit)
    return _told("a slider begins or ceases to stick", changes)


def meets_flip(attempt: Attempt) -> str:
    """A doubled branch meets the one it comes from in a long step."""
    long = attempt.step > max(MEETING_STEP, attempt.crossing)
    return _told(
        "orbits of half the period are met", long and passed_flip(attempt.here, attempt.found)
    )


def crosses_branch(attempt: Attempt) -> str:
    """Another branch is crossed in a long step, or the orbit is one of another branch."""
    if passed_flip(attempt.here, attempt.found):
        return ""
    if not crosses(attempt.here, attempt.there):
        return ""
    long = attempt.step > max(attempt.crossing, SHORTEST_CROSSING)
    return _told("another branch is crossed", long or not is_crossing(attempt.found))


def ends_on_crossing(attempt: Attempt) -> str:
    """Another branch crosses where the step ends."""
    within = min(NEAR_CROSSING * attempt.step, ON_CROSSING)
    on = lies_on_crossing(attempt.found, within)
    return _told("another branch crosses at the next point", on)


@lru_cache(maxsize=16)
def guards_of(free: bool, rigid: bool, period: int) -> tuple[Sequence[Guard], Sequence[Guard]]:
    """Guards that may object: those of all steps, and further ones of smooth steps.

    Parameters
    ----------
    free : bool
        Whether orbits meet no condition.
    rigid : bool
        Whether there are rigid stops.
    period : int
        That of the orbits.
    """
    of_orbits = (
        (no_orbit, True), (mends, free), (jumped, period > 1), (changes_impacts, rigid),
        (bends_at_rigid_grazing, rigid),
    )  # fmt: skip
    of_smooth_steps = (
        (misses, True), (is_off, True), (turns, True), (changes_pair, not free),
        (changes_sticking, not free), (touches, True),
        (meets_flip, period % 2 == 0), (crosses_branch, free), (ends_on_crossing, free),
    )  # fmt: skip
    first, further = (
        tuple(guard for guard, may_object in guards if may_object)
        for guards in (of_orbits, of_smooth_steps)
    )
    return first, further


def in_the_way(attempt: Attempt) -> tuple[Guard, str] | None:
    """The first guard that objects, and what is in the way; None if none does."""
    family = attempt.here.family
    for guards in guards_of(attempt.free, bool(family.system.rigid_stops), family.period):
        for guard in guards:
            if obstacle := guard(attempt):
                return guard, obstacle
        if attempt.kinked:
            break
    return None


def grazes_rigid(orbit: Orbit, least: float, most: float, condition: Condition = FREE) -> bool:
    """Whether an impact with a rigid stop, or a near miss, is so deep.

    Both bounds are shares of the orbit's size; that of a curve of grazings is its own.
    """
    own = condition if isinstance(condition, Grazing) else None
    return any(
        least < depth / length_unit(orbit) < most
        and not (own and own.is_of(stop, True, phase, orbit.period))
        for stop, phase, depth in rigid_touches(orbit)
    )


def loses_impact(orbit: Orbit) -> bool:
    """Whether the last step of Newton's method has lost or won a slight impact."""
    grazed = rigid_grazing(orbit)
    if grazed is None or abs(grazed[2]) > GRAZES * length_unit(orbit) or orbit.rests:
        return False
    problem = orbit.problem
    found = problem.flow.shoot(
        problem.nodes(orbit.point), problem.phases, orbit.omega, sensitivities=False
    )
    return bool(found.failure) or int(found.closings.sum()) != orbit.impacts


def grazing_between(a: Orbit, b: Orbit) -> bool:
    """Whether two neighbouring orbits without rest differ by impacts with rigid stops.

    Between them lies a grazing, where a branch has a corner, and may turn back.
    """
    if a.rests or b.rests:
        return False
    first, last = (sum(depth > 0.0 for *_, depth in rigid_touches(orbit)) for orbit in (a, b))
    return first != last


def rubs_all_around(orbit: Orbit) -> bool:
    """Whether a round clearance is closed all the time, which no impact tells.

    Where that begins, all of a circular whirl touches at once, and its branch has a corner.
    """
    if orbit.impacts or not orbit.system.round_stops:
        return False
    force = orbit.trajectory.contacts_at_nodes[1]
    return bool(force[:, list(orbit.system.round_stops)].any())


def mends_symmetry(family: OrbitFamily, before: float, after: float) -> bool:
    """Whether a step from an orbit of broken symmetry has landed on a symmetric one."""
    least = max(BROKEN, BY_TOLERANCE * family.options.rtol)
    return before > least and after < EQUAL_HALVES * before


def is_shifted(family: OrbitFamily, here: Real, guess: Real, there: Real) -> bool:
    """Whether a step has landed on an orbit shifted by some excitation periods, or on half of one.

    Where it is shifted, some other shift of it lies nearer to where the step began. Only through a
    flip the halves change places steadily, as the tangent foretells; not in a jump. Nor does a
    doubled branch go on along the one that it comes from.
    """
    problem, n = family.problem, family.n_states
    if problem.period == 1:
        return False
    apart, *others = (float(np.linalg.norm((p - here)[:n])) for p in shifts(problem, there))
    if problem.period % 2 == 0:  # half its period: a flip, below
        del others[problem.period // 2 - 1]
    if any(other < apart for other in others):
        return True
    if problem.period % 2:
        return False
    a, g, b = (half_difference(family, point) for point in (here, guess, there))
    before, after = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if after < EQUAL_HALVES * before:  # on the branch of half the period
        return True
    return float(a @ b) < 0.0 and float(np.linalg.norm(b - g)) > 0.5 * max(before, after)
