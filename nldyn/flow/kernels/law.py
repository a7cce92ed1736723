"""The force of a stop and its derivatives."""

from __future__ import annotations

import math

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from nldyn.flow.kernels.compiling import inlined, inner
from nldyn.flow.kernels.layout import (
    BOND,
    CUBIC,
    DASHPOT,
    DISSIPATION,
    DRAG,
    EXPONENT,
    FIRST_POWER,
    GAP,
    MOBILITY,
    RELEASE,
    RESTITUTION,
    ROUND,
    STIFFNESS,
)
from nldyn.system import contact_law

power_law = inlined(contact_law.power_law)


@intrinsic
def call_law(typing, address, delta, speed):
    """Call ``void law(double delta, double speed, double out[3])`` at an address."""
    signature = types.UniTuple(types.float64, 3)(types.int64, types.float64, types.float64)

    def codegen(context, builder, signature, arguments):
        double = ir.DoubleType()
        kind = ir.FunctionType(ir.VoidType(), [double, double, double.as_pointer()])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        out = cgutils.alloca_once(builder, double, size=3)
        builder.call(function, [arguments[1], arguments[2], out])
        values = [builder.load(cgutils.gep_inbounds(builder, out, i)) for i in range(3)]
        return context.make_tuple(builder, signature.return_type, values)

    return signature, codegen


@inner
def is_bond(fl, stop):
    """Whether a stop is none, but a bond that acts all the time."""
    return fl.stops[stop, BOND] != 0.0


@inner
def never_pulls(fl, stop):
    """Whether a stop with a dashpot lets go where its force would pull."""
    return fl.stops[stop, RELEASE] >= 0.0


@inner
def bond_law(numbers, u, speed):
    """Force of a bond, Σ k_j u^j + (drag u² + cubic u'²) u', and its two derivatives."""
    secant, bend = 0.0, 0.0  # Σ k_j u^(j - 1), and its derivative
    for c in range(numbers.size - 1, FIRST_POWER - 1, -1):
        bend = bend * u + secant
        secant = secant * u + numbers[c]
    drag, cubic = numbers[DRAG], numbers[CUBIC]
    viscosity = drag * u * u + cubic * speed * speed
    return (
        u * secant + viscosity * speed,
        secant + u * bend + 2.0 * drag * u * speed,
        viscosity + 2.0 * cubic * speed * speed,
    )


@inner
def is_rigid(fl, stop):
    """Whether a stop is rigid."""
    return fl.stops[stop, RESTITUTION] >= 0.0


@inner
def restitution_at(fl, stop, speed):
    """Coefficient of restitution of a rigid stop at an impact speed, and its derivative by it."""
    if fl.laws[stop] == 0:
        return fl.stops[stop, RESTITUTION], 0.0
    restitution, _, slope = call_law(fl.laws[stop], 0.0, speed)
    return restitution, slope


@inner
def law(fl, stop, delta, speed):
    """Contact force of an elastic stop and its derivatives by penetration and speed."""
    if is_bond(fl, stop):
        return bond_law(fl.stops[stop], delta, speed)
    if delta <= 0.0 or is_rigid(fl, stop):
        return 0.0, 0.0, 0.0
    if (
        never_pulls(fl, stop)
        and fl.stops[stop, STIFFNESS] * delta < -fl.stops[stop, DASHPOT] * speed
    ):
        return 0.0, 0.0, 0.0
    return pressing_law(fl, stop, delta, speed)


@inner
def pressing_law(fl, stop, delta, speed):
    """The same of a stop that is closed."""
    if fl.laws[stop] != 0:
        return call_law(fl.laws[stop], delta, speed)
    numbers = fl.stops[stop]
    return power_law(
        numbers[STIFFNESS],
        numbers[EXPONENT],
        numbers[DISSIPATION],
        numbers[DASHPOT],
        delta,
        speed,
    )


@inner
def closed_law(fl, stop, delta, speed):
    """The same within a panel on which the stop is closed.

    There a law whose slope sets in almost at once goes on beyond the switch, as an odd function:
    the outermost node may come to lie on its other side, and would drop the whole stiffness. So
    does a dashpot. A rigid stop makes the acceleration vanish, which stands in for the penetration.
    """
    if is_rigid(fl, stop):
        return delta / fl.stops[stop, MOBILITY], 1.0 / fl.stops[stop, MOBILITY], 0.0
    if is_bond(fl, stop):
        return law(fl, stop, delta, speed)
    if delta > 0.0:
        return pressing_law(fl, stop, delta, speed)
    dashpot = fl.stops[stop, DASHPOT]
    if fl.stops[stop, EXPONENT] < ROUND:
        force, stiffness, viscosity = pressing_law(fl, stop, -delta, speed)
        return 2.0 * dashpot * speed - force, stiffness, 2.0 * dashpot - viscosity
    return dashpot * speed, 0.0, dashpot


@inner
def depends_on_speed(fl, stop):
    """Whether a force depends on the speed of penetration, as far as one knows."""
    lossy = fl.stops[stop, DISSIPATION] != 0.0 or fl.stops[stop, DASHPOT] != 0.0
    lossy = lossy or fl.stops[stop, DRAG] != 0.0 or fl.stops[stop, CUBIC] != 0.0
    return not is_rigid(fl, stop) and (fl.laws[stop] != 0 or lossy)


@inner
def needs_speed(fl, stop):
    """Whether a force depends on the speed, or is to be differentiated by what makes it do so."""
    needed = depends_on_speed(fl, stop)
    for c in range(fl.parameters.shape[0]):
        wanted = fl.parameters[c, 0] in (DISSIPATION, DASHPOT) and fl.parameters[c, 1] == stop
        needed = needed or wanted
    return needed


@inner
def law_by(fl, stop, column, delta, speed):
    """Derivative of a stop's force with respect to its own number in a column of `stops`."""
    if column >= FIRST_POWER:
        return delta ** (column - FIRST_POWER + 1)
    force, slope, _ = closed_law(fl, stop, delta, speed)
    if column == GAP:
        return -slope
    if column == DASHPOT:
        return speed
    force -= fl.stops[stop, DASHPOT] * speed
    if column == STIFFNESS:
        return force / fl.stops[stop, STIFFNESS]
    if column == EXPONENT:
        return force * math.log(delta) if delta > 0.0 else 0.0
    factor = 1.0 + fl.stops[stop, DISSIPATION] * speed  # column == DISSIPATION
    return speed * force / factor


@inner
def singular_slope(fl, stop):
    """Whether the slope of a stop's force is singular at its switch."""
    exponent = fl.stops[stop, EXPONENT]
    singular = fl.laws[stop] != 0 or exponent != math.floor(exponent)
    return singular and not is_rigid(fl, stop)
