"""What a special point means: normal-form coefficients, directions, and a sentence in plain words.

Nothing here is computed by a continuation: the coefficients cost a few dozen flow maps each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from nldyn.base.arrays import SLACK, Complex, Real
from nldyn.base.errors import (
    FAILURES,
    LocateError,
    SystemModelError,
    check_positive,
    check_types,
    failing_as,
)
from nldyn.bifurcations.kinds import GRAZING_SLIDING, KINDS, SLIDING
from nldyn.bifurcations.normal_form_coefficients import (
    CoefficientError,
    Coefficients,
    Crossing,
    Estimate,
    Loop,
    crossing,
    doubled_parameter,
    flip,
    fold,
    loop_of,
    torus,
)
from nldyn.bifurcations.point import (
    BranchNode,
    SpecialPoint,
    check_special,
    is_of_branch,
    on_branch,
)
from nldyn.bifurcations.rigid_grazing import RigidGrazing, RootMap, turned
from nldyn.bifurcations.rigid_touch import Touches
from nldyn.bifurcations.self_excited import HOPF
from nldyn.bifurcations.sliding_forms import changes_at, told
from nldyn.orbits.bordered import FREE, Place, correct
from nldyn.orbits.conditions import Grazing, output_slope
from nldyn.orbits.orbit import Orbit, minimal_period
from nldyn.orbits.shooting import asymmetry, metric_length
from nldyn.system.naming import stop_name

CLOSE = 1e-3  # relative distance in frequency of a special point that counts as close
NEAR_RESONANCE_DEG = 5.0
GRAZING_ERROR = 1e-6  # relative, of the numbers of a rigid grazing
UNCHANGED = 1e-3  # relative change of a null vector that is none
SIDES = {1: "above", -1: "below"}
UNSTABLE_WITHOUT = "Without impacts the orbit is unstable"
JUMPS = "no attractor with slight impacts is to be expected, the motion jumps"
LOST = "the coefficient is lost in its error"
NUMBERS = {1: "one", 2: "two", 3: "three"}
SHARES = (1.0, 0.25, 0.05, 0.01, 1e-3, 1e-4)  # of the amplitude, that a branch may need to begin
DEEPEST = 1e-8  # of the deepest: an extreme as near to the surface grazes with the nearest one
ALIKE = 0.05  # relative difference of two amplitudes that may be of one place


@dataclass(frozen=True)
class NormalForm:
    """What happens at a special point.

    Parameters
    ----------
    name : str
        ``fold``, ``supercritical flip``, ``subcritical flip``, ``supercritical torus``,
        ``subcritical torus``, ``supercritical pitchfork``, ``subcritical pitchfork``,
        ``transcritical``, ``new contact``, ``split contact``, ``rigid grazing`` or ``multiple rigid
        grazing``; ``flip``, ``torus``, ``pitchfork`` or ``branch point`` where the coefficient does
        not tell more.
    sentence : str
        The same in plain words.
    coefficient : Estimate, optional
        Of the normal form, for ξ in units of the orbit's size (see
        `nldyn.bifurcations.normal_form_coefficients`): a of a fold, c of a flip or pitchfork, the
        first Lyapunov coefficient of a torus, ⟨p, B(q, q)⟩ of a transcritical point; of a rigid
        grazing the product in m/s of the speed of the slight impact and the multiplier that it
        makes grow.
    frequency_shift : Estimate, optional
        (f - f₀)/(f₀ ξ²) of the orbits that meet or are born here; of a rigid grazing
        (f - f₀)/(f₀ v) in s/m with the speed v of the slight impact.
    side : int
        +1 where these exist above the frequency of the point, -1 below, 0 on both sides or unknown.
    stable : bool, optional
        Whether these are stable (of a fold: whether one of the two is).
    """

    name: str
    sentence: str
    coefficient: Estimate | None = None
    frequency_shift: Estimate | None = None
    side: int = 0
    stable: bool | None = None


def describe_special(special: SpecialPoint, others: Sequence[SpecialPoint] = ()) -> str:
    """Say in one or two sentences what happens at a special point.

    Parameters
    ----------
    special : SpecialPoint
        Where.
    others : sequence of SpecialPoint
        The special points of the same branch, of which close ones are named at a grazing point.

    Returns
    -------
    str

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, continue_branch, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, 33.0), (32.0, 34.0))
    >>> describe_special(branch.special_points[0])[:49]
    'Flip at 33.6544 Hz, supercritical: a stable orbit'
    """
    return normal_form(special, others).sentence


def normal_form(special: SpecialPoint, others: Sequence[SpecialPoint] = ()) -> NormalForm:
    """Normal form of a special point; the parameters are those of `describe_special`.

    Returns
    -------
    NormalForm
        Where a coefficient cannot be computed, the sentence says why.

    Raises
    ------
    SystemModelError
        For a kind of point that is none of LP, PD, NS, BP, GR, CS, GS and AS, and no event of a
        branch.

    References
    ----------
    Yu. A. Kuznetsov (2004), *Elements of Applied Bifurcation Theory*, 3rd ed., section 5.4.
    """
    if getattr(getattr(special, "orbit", None), "self_excited", False):
        return _of_limit_cycle(special)
    kind = getattr(special, "kind", "")
    check_special("describe_special", special, of_branch=kind in ("GR", "BP", *SLIDING))
    check_types(others=(others, Sequence))
    for other in others:
        check_special("describe_special: others", other, of_branch=False)
    if special.kind not in KINDS and is_of_branch(special):
        return NormalForm("event", _of_event(special))
    special = on_branch(special)
    if special.kind == "GR":
        return _grazing(special, others)
    if special.kind in SLIDING:
        return _sliding(special)
    kinds = {"LP": _fold, "PD": _flip, "NS": _torus, "BP": _branch_point}
    if special.kind not in kinds:
        raise SystemModelError(f"no special point is of the kind {special.kind!r}")
    try:
        return kinds[special.kind](special, loop_of(special.point))
    except FAILURES as error:
        title, name = {
            "LP": ("Fold", "fold"),
            "PD": ("Flip", "flip"),
            "NS": ("Neimark-Sacker point", "torus"),
            "BP": ("Branch point", "branch point"),
        }[special.kind]
        return NormalForm(name, f"{title} at {_hz(special)}: no coefficient can be given, {error}.")


def _of_limit_cycle(special: SpecialPoint) -> NormalForm:
    """What happens at a special point of self-excited motions; no coefficient is computed."""
    name, meaning = {
        "LP": ("fold", "two limit cycles meet"),
        "PD": ("flip", "a limit cycle of about twice the period branches off"),
        "NS": ("torus", "quasi-periodic motions branch off"),
        "BP": ("branch point", "branches of limit cycles cross"),
        "GR": ("grazing", "the limit cycle touches a stop without speed"),
        GRAZING_SLIDING: ("grazing-sliding", "sticking begins or ends, and the branch may turn"),
        HOPF: ("Hopf point", "the limit cycle has shrunk to rest"),
    }[special.kind]
    title = name[0].upper() + name[1:]
    return NormalForm(name, f"{title} at {special.place(9)}: {meaning}.")


def _of_event(special: SpecialPoint) -> str:
    """What is told of a point that is special by an event."""
    stability = special.orbit.stability.verdict
    size = f"{special.orbit.max_abs_displacement:.6g} m"
    name = special.kind[0].upper() + special.kind[1:]
    return f"{name} at {special.place(9)}: the orbit is {stability} and reaches {size}."


# --- folds ---------------------------------------------------------------------------------------


def _fold(special: SpecialPoint, loop: Loop) -> NormalForm:
    form, q = fold(loop)
    shift = form.parameter
    side, hz = shift.sign, _hz(special)
    if not side:
        sentence = f"Fold at {hz}: on which side the two orbits exist cannot be told, {LOST}."
        return NormalForm("fold", sentence, form.nonlinear, shift)
    others = others_outside(special)
    if others:
        which = f"both are unstable, {_other_multipliers(others)}"
    else:
        growth = -form.nonlinear.value * displacement_along(special.point, q)
        which = f"the one of {'larger' if growth > 0.0 else 'smaller'} displacement is stable"
    sentence = (
        f"Fold at {hz}: two orbits exist {SIDES[side]} {hz} and neither {SIDES[-side]} it; {which}."
    )
    return NormalForm("fold", sentence, form.nonlinear, shift, side, not others)


def displacement_along(place: Place, q: Real) -> float:
    """Derivative of the largest observed displacement along a change q (k, 2n) of the nodes."""
    orbit = place.orbit
    extremes = orbit.observed_extremes
    index = int(np.argmax(np.abs(extremes.values)))
    output = orbit.system.output(orbit.observe)
    segment, row, _ = output_slope(place, output, float(extremes.phases[index]))
    return math.copysign(1.0, float(extremes.values[index])) * float(row @ q[segment])


# --- flips ---------------------------------------------------------------------------------------


def _flip(special: SpecialPoint, loop: Loop) -> NormalForm:
    form, _ = flip(loop)
    duration = f"{2e3 * special.orbit.duration:.4g} ms"
    return _by_sign(
        special, f"Flip at {_hz(special)}", "flip", form.nonlinear, doubled_parameter(form), 1,
        lambda stable: f"{_a(stable)} orbit of twice the period ({duration}) exists",
    )  # fmt: skip


def _by_sign(
    special: SpecialPoint,
    title: str,
    name: str,
    coefficient: Estimate,
    shift: Estimate,
    sense: int,
    born: Callable[[bool], str],
    tail: str = "",
) -> NormalForm:
    """Super- or subcritical, by the sign of a coefficient, of which `sense` is supercritical.

    What is born is stable if it is and no other multiplier lies outside the unit circle.
    """
    hz, supercritical = _hz(special), coefficient.sign == sense
    if not (coefficient.sign and shift.sign):
        sentence = f"{title}: super- or subcritical cannot be told, {LOST}{tail}."
        return NormalForm(name, sentence, coefficient, shift)
    others = others_outside(special)
    stable, word = supercritical and not others, "supercritical" if supercritical else "subcritical"
    why = f" ({_other_multipliers(others)})" if supercritical and others else ""
    sentence = f"{title}, {word}: {born(stable)} {SIDES[shift.sign]} {hz}{why}{tail}."
    return NormalForm(f"{word} {name}", sentence, coefficient, shift, shift.sign, stable)


def _a(stable: bool) -> str:
    return "a stable" if stable else "an unstable"


# --- tori ----------------------------------------------------------------------------------------


def _torus(special: SpecialPoint, loop: Loop) -> NormalForm:
    mu = critical_pair(special.orbit.multipliers)
    form, title = torus(loop, mu), f"Neimark-Sacker point at {_hz(special)}"
    return _by_sign(
        special, title, "torus", form.nonlinear, form.parameter, -1,
        lambda stable: f"{_a(stable)} torus (a motion of two frequencies) exists",
        f"; {resonance(mu)}",
    )  # fmt: skip


def critical_pair(multipliers: Complex) -> complex:
    """The multiplier in the upper half plane that is nearest to the unit circle."""
    upper = multipliers[multipliers.imag > 0.0]
    if not upper.size:
        raise CoefficientError("no multiplier is complex")
    return complex(upper[np.argmin(np.abs(np.abs(upper) - 1.0))])


def resonance(mu: complex) -> str:
    """Say how far a pair on the unit circle is from the strong resonances.

    Examples
    --------
    >>> resonance(1j ** 0.9)
    'its multipliers turn by 81 degrees per period, 9 from the strong resonance 1:4'
    """
    angle = math.degrees(abs(math.atan2(mu.imag, mu.real)))
    order = min((1, 2, 3, 4), key=lambda m: abs(angle - 360.0 / m % 360.0))
    distance = abs(angle - 360.0 / order % 360.0)
    said = (
        f"its multipliers turn by {angle:.4g} degrees per period, {distance:.3g} from the strong "
        f"resonance 1:{order}"
    )
    if distance < NEAR_RESONANCE_DEG:
        said += ", which decides what happens further away"
    return said


# --- branch points -------------------------------------------------------------------------------


def _branch_point(special: SpecialPoint, loop: Loop) -> NormalForm:
    shorter = minimal_period(special.orbit)
    if shorter < special.orbit.period:
        return _shorter_period_met(special, shorter)
    found = crossing(loop)
    return _pitchfork(special, found) if found.is_pitchfork else _transcritical(special, found)


def _shorter_period_met(special: SpecialPoint, shorter: int) -> NormalForm:
    sentence = f"Branch point at {_hz(special)}: here the orbit is one of period {shorter}"
    if special.orbit.period == 2 * shorter:
        sentence += ", at a flip of a branch of that period, from which this branch is born."
        return NormalForm("flip", sentence)
    return NormalForm("branch point", f"{sentence}, of a branch of that period.")


def _pitchfork(special: SpecialPoint, found: Crossing) -> NormalForm:
    form: Coefficients = found.pitchfork
    symmetric = _breaks_mirror(special.orbit, found.q)
    title = f"Branch point at {_hz(special)}, pitchfork"
    if symmetric:
        title += " (the symmetry x(t + T/2) = -x(t) breaks)"
    pair = "mirror images of each other" if symmetric else "one on either side of the old one"
    return _by_sign(
        special, title, "pitchfork", form.nonlinear, form.parameter, -1,
        lambda stable: f"two {'stable' if stable else 'unstable'} orbits, {pair}, exist",
    )  # fmt: skip


def _transcritical(special: SpecialPoint, found: Crossing) -> NormalForm:
    hz = _hz(special)
    if not found.roots:
        sentence = (
            f"Branch point at {hz}: the branching equation has no real solution but the point "
            "itself (an isolated orbit)."
        )
        return NormalForm("branch point", sentence, found.quadratic[0])
    others = others_outside(special)
    which = (
        f"both are unstable, {_other_multipliers(others)}"
        if others
        else "the stable one becomes unstable and the other stable"
    )
    sentence = (
        f"Branch point at {hz}, transcritical: two branches cross, each goes on to either side; "
        f"{which}."
    )
    return NormalForm("transcritical", sentence, found.quadratic[0], stable=not others)


def is_symmetric(orbit: Orbit, rtol: float = 1e-4) -> bool:
    """Whether half a period turns the orbit into its mirror image, x(t + T/2) = -x(t)."""
    return asymmetry(orbit.problem, orbit.point) <= rtol


def _breaks_mirror(orbit: Orbit, q: Real) -> bool:
    """Whether a change q (k, 2n) takes an orbit's symmetry x(t + T/2) = -x(t) from it.

    Then half a period leaves q as it is; a mirrored q keeps the symmetry, and another one tells
    that the system has none.
    """
    if not is_symmetric(orbit):
        return False
    shifted = np.roll(q, orbit.problem.segments // 2, axis=0)
    return bool(np.abs(shifted - q).max() < UNCHANGED * np.abs(q).max())


def switch_at_branch_point(
    special: SpecialPoint, amplitude: float = 0.02
) -> tuple[BranchNode, BranchNode]:
    """First points of the other branch through a branch point, one in either direction.

    At a broken symmetry these are the two halves of the new branch.

    Parameters
    ----------
    special : SpecialPoint
        A branch point (BP).
    amplitude : float
        Relative size of the first step; smaller ones are tried if it fails.

    Returns
    -------
    pair of BranchNode
        Their tangents lead away from the branch point.

    Raises
    ------
    SystemModelError
        If the special point is not a branch point.
    LocateError
        If the other branch is not found, or is one of a shorter period.
    """
    check_special("switch_at_branch_point", special, "BP")
    check_positive("amplitude", amplitude)
    shorter = minimal_period(special.orbit)
    if shorter < special.orbit.period:
        raise LocateError(
            f"the other branch at {_hz(special)} is one of period {shorter}: solve for its orbits"
        )
    try:
        direction = other_tangent(special)
    except FAILURES as error:
        raise LocateError(f"no other branch at {_hz(special)}: {error}") from None
    return (
        _step_off(special, direction, amplitude),
        _step_off(special, -direction, amplitude),
    )


def other_tangent(special: SpecialPoint) -> Real:
    """Unit tangent (N + 1,) of the branch that crosses at a branch point.

    Of the two solutions of the branching equation it is the one further from the direction of the
    branch on which the point was found.
    """
    weights, tangents = special.point.family.metric(special.point.point), crossing_tangents(special)
    along = [abs(float(special.point.tangent @ (weights * t))) for t in tangents]
    return tangents[int(np.argmin(along))]


def crossing_tangents(special: SpecialPoint) -> list[Real]:
    """Unit tangents (N + 1,) of the two branches that cross at a branch point."""
    found = crossing(loop_of(special.point))
    if not found.roots:
        raise CoefficientError("the branching equation has no real solution")
    weights = special.point.family.metric(special.point.point)
    tangents = []
    for alpha, beta in found.roots:
        tangent = np.append((alpha * found.q + beta * found.v).ravel(), beta)
        tangents.append(tangent / metric_length(weights, tangent))
    return tangents


@failing_as(LocateError)
def _step_off(special: SpecialPoint, direction: Real, amplitude: float) -> BranchNode:
    """Point of the branch with a tangent at a distance from the branch point.

    The distance must be short where a linear stop is just touched beside the branch point: the
    other branch bends there and has another tangent behind.
    """
    family, place = special.point.family, special.point.point
    row = family.metric(place) * direction
    row /= np.linalg.norm(row)
    for share in SHARES:
        size = share * amplitude
        found = correct(family, place + size * direction, FREE, row, longest=size)
        if found.converged:
            return BranchNode.of(found, found.tangent(direction), 0.0)
    raise LocateError(f"no orbit found beside the branch point at {_hz(special)}: {found.failure}")


# --- grazing -------------------------------------------------------------------------------------


def _grazing(special: SpecialPoint, others: Sequence[SpecialPoint]) -> NormalForm:
    orbit, hz = special.orbit, _hz(special)
    try:
        nearest = Grazing.of(orbit)
    except SystemModelError:
        nearest = None
    if nearest and nearest.half:
        return _rigid_grazing(special, nearest)
    touches = touching(orbit)
    if not touches:
        return NormalForm("new contact", f"Grazing at {hz}: the system has no stop.")
    output, phase, is_maximum = touches[0]
    states = special.point.tangent[:-1].reshape(orbit.problem.segments, -1)
    try:
        segment, row, by_parameter = output_slope(special.point, output, phase)
        pace = float(special.point.tangent[-1])
        slope = (float(row @ states[segment]) + by_parameter * pace) * pace
    except FAILURES:
        slope = 0.0
    side = int(np.sign(slope)) * (1 if is_maximum else -1)
    stops = " and ".join(_stop_name(orbit, *touch[:2]) for touch in touches)
    verb = "is" if len(touches) == 1 else "are"
    if is_maximum:
        name, what, follows = "new contact", "just touched, with zero speed", "the contact exists"
    else:
        name, what, follows = "split contact", "left for an instant", "the contact is split in two"
    where = f"; {follows} {SIDES[side]} {hz}" if side else ""
    sentence = (
        f"Grazing at {hz}: {stops} {verb} {what}{where}. {_stability_at_grazing(special, others)}"
    )
    return NormalForm(name, sentence, side=side, stable=orbit.stable)


def _rigid_grazing(special: SpecialPoint, grazing: Grazing) -> NormalForm:
    """Grazing of a rigid stop, by the root of the distance in the map of the motion behind it.

    References
    ----------
    A. B. Nordmark (1991), *J. Sound Vib.* 145, 279-297; W. Chin, E. Ott, H. E. Nusse, C. Grebogi
    (1994), *Phys. Rev. E* 50, 4427-4444; M. H. Fredriksson and A. B. Nordmark (1997),
    *Proc. R. Soc. A* 453, 1261-1276.
    """
    orbit, hz = special.orbit, _hz(special)
    alone = _stop_name(orbit, grazing.stop, grazing.phase)
    try:
        touches = Touches.of(orbit)
        root_map = RootMap.of(touches)
        if len(touches.stops) > 1:
            return _several_grazings(special, touches, root_map)
        form = RigidGrazing.of(root_map)
    except FAILURES as error:
        return NormalForm(
            "rigid grazing", f"Grazing at {hz}: rigid {alone} is just touched: no coefficient can "
            f"be given, {error}.",
        )  # fmt: skip
    side = int(np.sign(form.speed_change))
    rest = int(np.sign(form.height_change))
    ends = "where the one without ends" if side == rest else "on the same side as the one without"
    largest = orbit.largest_multiplier
    if abs(largest) >= 1.0:
        follows = UNSTABLE_WITHOUT
    elif not form.lowers:
        follows = f"An impact raises the motion in a later period: {JUMPS}"
    else:
        follows = f"An impact lowers all that follows: {_behind_grazing(abs(largest))}"
    sentence = (
        f"Grazing at {hz}: rigid {alone} is just touched. An orbit with one impact more exists "
        f"{SIDES[side]} {hz}, {ends}; with the speed v of that impact a multiplier goes to "
        f"infinity, as {form.growth:.4g} m/s / v. {follows}."
    )
    return NormalForm(
        "rigid grazing", sentence, Estimate(form.growth, GRAZING_ERROR * abs(form.growth)),
        Estimate(1.0 / form.speed_change, GRAZING_ERROR / abs(form.speed_change)), side,
        orbit.stable,
    )  # fmt: skip


def _several_grazings(special: SpecialPoint, touches: Touches, form: RootMap) -> NormalForm:
    """Grazing of an orbit in several touches at once: which orbits begin there, on either side."""
    orbit, hz = special.orbit, _hz(special)
    count, shorter, beside = len(touches.stops), minimal_period(orbit), form.beside
    every = count * shorter // orbit.period
    names = ", ".join(
        _stop_name(orbit, stop, phase)
        for stop, phase in zip(touches.stops[:every], touches.phases.tolist(), strict=False)
    )
    touched = f"Grazing at {hz} in {NUMBERS.get(count, str(count))} touches at once: rigid {names}"
    if shorter < orbit.period:
        touched += f", of an orbit of period {shorter} run through {orbit.period // shorter} times"
    sides = []
    for side in (1, -1):
        kinds = {  # one of those that are the same but for when they begin
            max(turned(each.hits, turn) for turn in range(0, count, every)): None
            for each in beside
            if each.side == side
        }
        if kinds:
            sides.append(f"{SIDES[side]} {hz} {', '.join(map(_with_impacts, kinds))}")
    begin = f"Orbits begin here {'; '.join(sides)}" if sides else "Which orbits begin here is open"
    if abs(orbit.largest_multiplier) >= 1.0:
        follows = UNSTABLE_WITHOUT
    elif not form.lowers:
        follows = f"An impact raises the motion at a later touch: {JUMPS}"
    else:
        follows = "What else appears is not told by the normal form, which is that of one root"
    hit = {each.side for each in beside if any(each.hits)}
    return NormalForm(
        "multiple rigid grazing",
        f"{touched}. The map of the motion beside it has a root for each touch. {begin}; as the "
        f"speeds of impacts go to zero a multiplier goes to infinity. {follows}.",
        side=hit.pop() if len(hit) == 1 else 0,
        stable=orbit.stable,
    )


def _with_impacts(hits: tuple[bool, ...]) -> str:
    """Say at which touches impacts are."""
    *places, last = [str(number) for number, hit in enumerate(hits, 1) if hit] or [""]
    if not last:
        return "without an impact"
    if all(hits):
        return "with an impact at each touch"
    if not places:
        return f"with an impact at touch {last} alone"
    return f"with impacts at touches {', '.join(places)} and {last} alone"


def _behind_grazing(multiplier: float) -> str:
    """What the map with a root shows behind a grazing, by the largest multiplier before it."""
    if multiplier > 2.0 / 3.0:
        return "chaos sets in at once (multiplier above 2/3)"
    if multiplier > 0.25:
        return "orbits of periods that grow by one, with chaos between (multiplier above 1/4)"
    return "orbits of periods that grow by one follow each other (multiplier below 1/4)"


def touching(orbit: Orbit) -> list[tuple[int, float, bool]]:
    """Stop, phase and whether a maximum, of the penetrations' extremes nearest to zero.

    The nearest comes first; others follow that are as near within rounding, which happens where
    a symmetric orbit touches two stops alike.
    """
    found = []
    for index in range(len(orbit.system.stops)):
        extremes = orbit.extremes(index)
        found += [
            (abs(float(value)), index, float(phase), bool(kind))
            for phase, value, kind in zip(
                extremes.phases, extremes.values, extremes.is_maximum, strict=True
            )
        ]
    found.sort()
    limit = DEEPEST * max((entry[0] for entry in found), default=0.0)
    return [entry[1:] for number, entry in enumerate(found) if number == 0 or entry[0] < limit]


def _stop_name(orbit: Orbit, index: int, phase: float) -> str:
    return f"{stop_name(orbit.system, index)} ({1e3 * phase / orbit.omega:.4g} ms)"


def _stability_at_grazing(special: SpecialPoint, others: Sequence[SpecialPoint]) -> str:
    close = [
        other
        for other in others
        if other.kind != "GR"
        and abs(other.frequency_hz / special.frequency_hz - 1.0) < CLOSE
        and abs(other.orbit.max_abs_displacement / special.orbit.max_abs_displacement - 1.0) < ALIKE
    ]
    said = "The force sets in softly, so the multipliers are continuous and stability stays"
    if close:
        named = ", ".join(f"{other.kind} at {_hz(other)}" for other in close)
        return f"{said}, but a special point is close by ({named})."
    return f"{said}."


# --- sliding -------------------------------------------------------------------------------------


def _sliding(special: SpecialPoint) -> NormalForm:
    """Where a motion begins or ceases to stick; no coefficient is computed."""
    name, changes = KINDS[special.kind].words, changes_at(special)
    sentence = f"{name[0].upper()}{name[1:]} at {_hz(special)}: {told(special, changes)}."
    side, stable = (changes[0].side, changes[0].stable) if changes else (0, None)
    return NormalForm(name, sentence, side=side, stable=stable)


# --- all -----------------------------------------------------------------------------------------


def others_outside(special: SpecialPoint) -> int:
    """How many multipliers lie outside the unit circle besides the critical ones."""
    mu = special.orbit.multipliers
    if special.kind == "NS":
        pair = critical_pair(mu)
        distance = np.minimum(np.abs(mu - pair), np.abs(mu - pair.conjugate()))
        rest = np.delete(mu, np.argsort(distance, kind="stable")[:2])
    else:
        critical = -1.0 if special.kind == "PD" else 1.0
        rest = np.delete(mu, int(np.argmin(np.abs(mu - critical))))
    return int(np.sum(np.abs(rest) > 1.0 + SLACK))


def _other_multipliers(count: int) -> str:
    number = NUMBERS.get(count, str(count))
    lie = "lies" if count == 1 else "lie"
    return f"as {number} other multiplier{'' if count == 1 else 's'} {lie} outside the unit circle"


def _hz(special: SpecialPoint) -> str:
    return special.place()
