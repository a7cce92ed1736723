"""Special points solved by their defining systems."""

from __future__ import annotations

from nldyn.base.errors import LocateError, check_whole
from nldyn.bifurcations.marks import without_direction
from nldyn.bifurcations.point import SpecialPoint, check_special
from nldyn.orbits.bordered import OrbitFamily, correct
from nldyn.orbits.conditions import defined_by
from nldyn.system.chart import FREQUENCY, Chart, checked_parameter, value_of
from nldyn.system.parameters import Parameter


def refine_special(
    special: SpecialPoint, parameter: str | Parameter = FREQUENCY, *, max_iterations: int = 12
) -> SpecialPoint:
    """Solve the defining system of a special point by Newton's method in one parameter.

    Parameters
    ----------
    special : SpecialPoint
        LP, PD, NS, GR or BP.
    parameter : str or Parameter
        Which number is free: see `nldyn.system.chart.checked_parameter`.
    max_iterations : int
        Most steps.

    Returns
    -------
    SpecialPoint
        It knows no direction of a branch.

    Raises
    ------
    SystemModelError
        For an unknown kind or parameter.
    LocateError
        If Newton's method does not converge.

    References
    ----------
    G. Moore (1980), *Numer. Funct. Anal. Optim.* 2, 441-472 (branch points);
    W. J. F. Govaerts (2000); Yu. A. Kuznetsov (2004), section 10.3.
    """
    check_special("refine_special", special, of_branch=False)
    check_whole("max_iterations", max_iterations, 1, 1000)
    orbit = special.orbit
    chosen = checked_parameter(orbit.system, parameter)
    value = value_of(orbit.system, orbit.frequency_hz, chosen)
    span = (0.5 * value, 2.0 * value) if value > 0.0 else (value - 1.0, value + 1.0)
    if chosen.name == "gap" and value <= 0.0:
        size = orbit.max_abs_displacement
        span = (value - size, value + size)
    family = OrbitFamily.around(orbit, (Chart(chosen, *span),))
    family, condition = defined_by(special.kind, family, orbit)
    guess = family.unknowns(orbit)
    found = correct(family, guess, condition, max_iterations=max_iterations)
    if not found.converged:
        raise LocateError(
            f"{special.kind} near {orbit.frequency_hz:.6g} Hz was not refined: {found.failure}"
        )
    return SpecialPoint(special.kind, without_direction(found, 0.0), found.step)
