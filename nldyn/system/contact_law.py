"""Contact laws of stops: the power law, and those that users bring."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

from nldyn.base.errors import SystemModelError

ContactLaw = Callable[[float, float], tuple[float, float, float]]
_C_LAW = ctypes.CFUNCTYPE(None, ctypes.c_double, ctypes.c_double, ctypes.POINTER(ctypes.c_double))
SHALLOW = 1e-6, 1e-8  # of the penetration at which the power law gives 1 N
TRIED, SPEED = (1e-3, 0.1, 1.0), 0.1  # penetrations over their unit, and m/s, at which it is tried
DIGITS = 1e-14  # relative rounding of a law
WRONG_SLOPE, VANISHED, SAME = 1e-4, 1e-4, 0.01  # relative differences: of slopes, of 0, of forces
LEAST_POWER, PER_DOUBLING, PLACES = -26.5, 8.0, 319  # where a kink is looked for, from 1e-8 on
MAY_JUMP, NARROW = 0.05, 1e-10  # relative change between two of them; within it, a kink is found
STEP = 1e-6  # of the differences: in penetrations, and in m/s
ALL_BUT_NONE = 1e-9  # penetration over its unit, where a force must be all but zero


def power_law(
    stiffness: float,
    exponent: float,
    dissipation: float,
    dashpot: float,
    delta: float,
    speed: float,
) -> tuple[float, float, float]:
    """The law of a stop without one of its own: its force, and the force's two derivatives.

    That of the engine is in engine/law.c.

    Parameters
    ----------
    stiffness, exponent, dissipation, dashpot : float
        k in N/m^p, p, a in s/m and c in N s/m of the force k δ^p (1 + a v) + c v [Hunt and
        Crossley 1975, eq. 9; Kelvin and Voigt's for a = 0].
    delta, speed : float
        Penetration δ in m and its rate v in m/s.

    Returns
    -------
    force, slope, viscosity : float
        In N, N/m and N s/m; zero where the stop is open.

    Examples
    --------
    >>> power_law(2.0, 1.0, 0.5, 0.0, 3.0, 1.0)
    (9.0, 3.0, 3.0)
    """
    if delta <= 0.0:
        return 0.0, 0.0, 0.0
    slope = stiffness
    if exponent == 1.5:
        slope *= math.sqrt(delta)
    elif exponent != 1.0:
        slope *= delta ** (exponent - 1.0)
    factor = 1.0 + dissipation * speed
    return (
        slope * delta * factor + dashpot * speed,
        exponent * slope * factor,
        dissipation * slope * delta + dashpot,
    )


def duration_factor(p: float) -> float:
    """Contact duration of a free impact over (peak penetration / speed) for F = k δ^p.

    2 ∫ dx / sqrt(1 - x^(p+1)) from 0 to 1 = 2.94 for Hertz's law (Johnson 1985, eq. 11.24).
    """
    q = 1.0 / (p + 1.0)
    return 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + q) / math.gamma(0.5 + q)


def check_law(owner: str, law: ContactLaw, stiffness: float, exponent: float) -> None:
    """Refuse a law that is not finite, not smooth, not as declared at its start, or wrong in slope.

    Penetrations and speeds are tried around those at which the power law gives 1 N.

    Raises
    ------
    SystemModelError
        With the first pair at which something is wrong.
    """
    unit = stiffness ** (-1.0 / exponent)
    for share in TRIED:
        for speed in (0.0, SPEED, -SPEED):
            delta = share * unit
            force, stiff, viscous = _values(owner, law, delta, speed)
            step, jolt = STEP * delta, STEP
            rise = _values(owner, law, delta + step, speed)[0]
            fall = _values(owner, law, delta - step, speed)[0]
            faster = _values(owner, law, delta, speed + jolt)[0]
            slower = _values(owner, law, delta, speed - jolt)[0]
            for name, slope, change, width in (
                ("penetration", stiff, rise - fall, 2.0 * step),
                ("speed", viscous, faster - slower, 2.0 * jolt),
            ):
                rounding = DIGITS * abs(force) / width
                if abs(change / width - slope) > WRONG_SLOPE * abs(slope) + 100.0 * rounding:
                    raise SystemModelError(
                        f"{owner}: law says {slope:g} for the derivative by the {name} at "
                        f"penetration {delta:g} m and speed {speed:g} m/s, but its force changes "
                        f"by {change / width:g}"
                    )
    tiny = abs(_values(owner, law, ALL_BUT_NONE * unit, SPEED)[0])
    if tiny > VANISHED * max(abs(_values(owner, law, unit, SPEED)[0]), 1.0):
        raise SystemModelError(
            f"{owner}: law must vanish with the penetration; a spring with a damper beside it is "
            "`dashpot` of a linear stop"
        )
    _check_declared(owner, law, stiffness, exponent)
    _check_smooth(owner, law, unit)


def _check_declared(owner: str, law: ContactLaw, stiffness: float, exponent: float) -> None:
    """Refuse a law that does not begin as k δ^p with the k and p it is declared with."""
    unit = stiffness ** (-1.0 / exponent)
    for share in SHALLOW:
        delta = share * unit
        force = _values(owner, law, delta, 0.0)[0]
        declared = stiffness * delta**exponent
        if _differ(force, declared, SAME):
            raise SystemModelError(
                f"{owner}: law gives {force:g} N at a penetration of {delta:g} m, but its "
                f"stiffness {stiffness:g} and exponent {exponent:g} say {declared:g} N: declare "
                "those with which the law begins"
            )


def _check_smooth(owner: str, law: ContactLaw, unit: float) -> None:
    """Refuse a law whose force or slope jumps: panels resolve analytic laws only.

    Sought on a grid of penetrations with eight points to an octave, from 1e-8 to 1e4 of the unit;
    where neighbours differ by a twentieth, the larger half of the change is followed down to 1e-10
    of the penetration, and one that is left there is a jump.
    """

    def values(exponent: float) -> tuple[float, float]:
        force, stiff, _ = _values(owner, law, unit * 2.0**exponent, SPEED)
        return force, stiff

    points = [LEAST_POWER + k / PER_DOUBLING for k in range(PLACES)]
    for which, name in enumerate(("force", "derivative by the penetration")):
        known = []
        for point in points:
            try:
                known.append(values(point)[which])
            except SystemModelError:  # beyond what can be computed, as of an exponential law
                break
        for k in range(len(known) - 1):
            if _differ(known[k], known[k + 1], MAY_JUMP):
                low, high, below, above = points[k], points[k + 1], known[k], known[k + 1]
                while high - low > NARROW:
                    middle = 0.5 * (low + high)
                    between = values(middle)[which]
                    if abs(between - below) > abs(above - between):
                        high, above = middle, between
                    else:
                        low, below = middle, between
                if _differ(below, above, SAME):
                    raise SystemModelError(
                        f"{owner}: law is not smooth: its {name} jumps from {below:g} to {above:g} "
                        f"at penetration {unit * 2.0**low:g} m; use several stops with gaps of "
                        "their own instead"
                    )


def _differ(a: float, b: float, share: float) -> bool:
    return abs(a - b) > share * max(abs(a), abs(b))


def _values(owner: str, law: ContactLaw, delta: float, speed: float) -> tuple[float, float, float]:
    try:
        force, stiff, viscous = (float(x) for x in law(delta, speed))
    except (TypeError, ValueError, ArithmeticError) as error:
        raise SystemModelError(
            f"{owner}: law({delta:g}, {speed:g}) must give three numbers "
            f"(force, its derivatives by penetration and by speed): {error}"
        ) from None
    if not all(math.isfinite(x) for x in (force, stiff, viscous)):
        raise SystemModelError(f"{owner}: law({delta:g}, {speed:g}) is not finite")
    return force, stiff, viscous


@dataclass(frozen=True)
class CompiledLaw:
    """A law that is a function of a shared library, as compilers of C make them.

    It is called as ``void law(double depth, double speed, double out[3])`` for a positive
    penetration and fills in the force and its derivatives by both.

    Parameters
    ----------
    library : str
        Path of the library.
    name : str
        Name of the function.

    Raises
    ------
    SystemModelError
        If there is no such function.
    """

    library: str
    name: str

    def __post_init__(self) -> None:
        try:
            _ = self.address
        except (OSError, AttributeError) as error:
            raise SystemModelError(f"law '{self.name}': {error}") from None

    @property
    def __name__(self) -> str:
        """That of the function."""
        return self.name

    @property
    def address(self) -> int:
        """Where the function is in this process."""
        found = getattr(ctypes.CDLL(self.library), self.name)
        return int(ctypes.cast(found, ctypes.c_void_p).value or 0)

    def __call__(self, depth: float, speed: float) -> tuple[float, float, float]:
        """Force and its derivatives by penetration and speed."""
        out = (ctypes.c_double * 3)()
        _C_LAW(self.address)(depth, speed, out)
        return out[0], out[1], out[2]


def law_address(law: ContactLaw | None) -> int:
    """Address of the compiled law ``void (double, double, double[3])``; 0 for none.

    Raises
    ------
    SystemModelError
        If numba cannot compile it, or is not there.
    """
    if law is None:
        return 0
    return law.address if isinstance(law, CompiledLaw) else int(_compiled(law).address)


def numba_for(what: str) -> Any:
    """The package numba, which compiles functions of Python; its stubs lack what is needed.

    Raises
    ------
    SystemModelError
        If it is not installed.
    """
    try:
        return import_module("numba")
    except ImportError:
        raise SystemModelError(
            f"{what} is a function of Python, which numba compiles: install it with "
            "pip install 'nldyn[laws]'"
        ) from None


@cache
def _compiled(law: ContactLaw) -> Any:
    numba = numba_for(f"the contact law '{law.__name__}'")
    inner = law if hasattr(law, "py_func") else numba.njit(law)

    def call(delta: Any, speed: Any, out: Any) -> None:
        out[0], out[1], out[2] = inner(delta, speed)  # whole numbers among them are converted

    double = numba.types.float64
    signature = numba.types.void(double, double, numba.types.CPointer(double))
    try:
        return numba.cfunc(signature)(call)
    except numba.core.errors.NumbaError as error:
        told = [line.strip() for line in str(error).splitlines()]
        reasons = [line for line in told if line and not line.startswith(("Failed", "During"))]
        raise SystemModelError(
            f"the contact law '{law.__name__}' cannot be compiled: {(reasons or told)[0]}"
        ) from None
