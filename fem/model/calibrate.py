"""Find unknown dimensions of a structure from published or measured values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError, quoted

SETTLED = 1e-12  # relative change that a fit would still make
SEEN = 1e-6  # share of the largest singular value, and of a direction, that counts


Predictor = Callable[[dict[str, float]], Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of `calibrate`; every mapping is by name.

    Parameters
    ----------
    values
        The unknowns at the best fit.
    standard_uncertainties
        One standard deviation of each unknown; infinite where the targets do not determine it.
    targets, tolerances, computed
        Wanted value, half-width of what it may be, and what the fitted model gives.
    covariance
        Of the unknowns, in the order of `values`, shape (p, p).
    jacobian
        Derivatives of the computed values with respect to the unknowns, shape (m, p).
    chi_square
        Sum of ((computed - target) / sigma)² with sigma = tolerance/√3.
    degrees_of_freedom
        Number of targets less that of unknowns. A `chi_square` far above it says that the model
        cannot meet the targets within their tolerances.
    converged, message
        Whether the least-squares method ended at a minimum, and what it says.
    """

    values: dict[str, float]
    standard_uncertainties: dict[str, float]
    targets: dict[str, float]
    tolerances: dict[str, float]
    computed: dict[str, float]
    covariance: FloatArray
    jacobian: FloatArray
    chi_square: float
    degrees_of_freedom: int
    converged: bool
    message: str

    @property
    def residuals(self) -> dict[str, float]:
        """Computed less target, in the unit of the target."""
        return {name: self.computed[name] - target for name, target in self.targets.items()}

    @property
    def deviations(self) -> dict[str, float]:
        """Computed less target, relative to the target."""
        return {
            name: residual / self.targets[name] if self.targets[name] else math.nan
            for name, residual in self.residuals.items()
        }

    def table(self) -> str:
        """Wanted and computed values as a Markdown table."""
        rows = ["| value | published | computed | deviation |", "| --- | ---: | ---: | ---: |"]
        for name, target in self.targets.items():
            rows.append(
                f"| {name} | {target:.6g} | {self.computed[name]:.6g}"
                f" | {100 * self.deviations[name]:+.3f} % |"
            )
        return "\n".join(rows)

    def unknowns_table(self) -> str:
        """Unknowns and their standard uncertainties as a Markdown table."""
        rows = ["| unknown | value | standard uncertainty |", "| --- | ---: | ---: |"]
        for name, value in self.values.items():
            rows.append(f"| {name} | {value:.6g} | {self.standard_uncertainties[name]:.2g} |")
        return "\n".join(rows)


def calibrate(
    predict: Predictor,
    start: Mapping[str, float],
    targets: Mapping[str, float],
    tolerances: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]] | None = None,
    step: float = 1e-4,
) -> Calibration:
    """Fit unknowns of a model to values that are known of the real structure.

    Parameters
    ----------
    predict
        Given the unknowns by name, builds the model and returns the values by name. Values that
        are not in `targets` are ignored.
    start
        First guess of every unknown; its size is also its scale.
    targets
        Wanted values, at least as many as unknowns.
    tolerances
        Half-width of the interval in which the true value of a target may lie, in its unit. A
        value printed as 13.1 has 0.05.
    bounds
        Lowest and highest allowed value of some unknowns; trial steps keep within them, so a
        length or mass that could come out negative on the way needs a lower bound above zero.
    step
        Relative step of the central differences.

    Returns
    -------
    Calibration
        Best fit, its uncertainties and residuals. One that did not converge says so.

    Raises
    ------
    ModelError
        If names do not match, a number is not finite, a tolerance is not positive, the bounds
        exclude the start, or there are fewer targets than unknowns.

    Notes
    -----
    Minimises the sum of squares of (computed - target) / tolerance with
    `scipy.optimize.least_squares`. A rounded value is uniformly distributed over its interval, so
    its standard deviation is sigma = tolerance/√3 [1]_. With the rows of the Jacobian J divided
    by sigma, the covariance of the unknowns is (JᵀJ)⁻¹. Where the targets miss by more than their
    tolerances explain, it is multiplied with chi²/(m - p), the square of the Birge ratio [2]_:
    the scatter of the residuals then tells how good the model is, not the rounding.
    The covariance does not know of the bounds.

    .. [1] JCGM 100:2008, Guide to the expression of uncertainty in measurement, 4.3.7.
    .. [2] R.T. Birge, The calculation of errors by the method of least squares, Physical Review
       40, 1932, 207-227.

    Examples
    --------
    How long is a cantilever whose first two frequencies are printed as 16.6 and 104 Hz?

    >>> import fem
    >>> def frequencies(unknowns):
    ...     factor = (2.1e11 * 8.333e-10 / 0.78) ** 0.5 / (2 * 3.141592653589793)
    ...     return {
    ...         name: factor * (root / unknowns["length"]) ** 2
    ...         for name, root in (("f1", 1.875104), ("f2", 4.694091))
    ...     }
    >>> fit = fem.calibrate(
    ...     frequencies, {"length": 0.5}, {"f1": 16.6, "f2": 104.0}, {"f1": 0.05, "f2": 0.5}
    ... )
    >>> round(fit.values["length"], 3), round(fit.standard_uncertainties["length"], 4)
    (0.711, 0.0005)
    """
    names, wanted = list(start), list(targets)
    _check(start, targets, tolerances, bounds or {}, step)
    scale = np.array([abs(start[name]) or 1.0 for name in names])
    target = np.array([targets[name] for name in wanted])
    tolerance = np.array([tolerances[name] for name in wanted])
    limits = np.array([(bounds or {}).get(name, (-np.inf, np.inf)) for name in names])

    def compute(scaled: FloatArray) -> FloatArray:
        unknowns = dict(zip(names, (scaled * scale).tolist(), strict=True))
        return _picked(predict(unknowns), wanted, unknowns)

    def misses(scaled: FloatArray) -> FloatArray:
        return np.asarray((compute(scaled) - target) / tolerance, dtype=np.float64)

    result = least_squares(
        misses,
        np.array([start[name] for name in names]) / scale,
        jac="3-point",
        bounds=(limits[:, 0] / scale, limits[:, 1] / scale),
        diff_step=np.full(len(names), step),
        xtol=SETTLED,
        ftol=SETTLED,
        gtol=SETTLED,
    )
    freedom = len(wanted) - len(names)
    chi_square = 3.0 * float(np.sum(result.fun**2))
    covariance = _covariance(np.sqrt(3.0) * result.jac) * np.outer(scale, scale)
    if freedom > 0:
        covariance = covariance * max(1.0, chi_square / freedom)
    return Calibration(
        values=dict(zip(names, (result.x * scale).tolist(), strict=True)),
        standard_uncertainties=dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
        targets={name: float(targets[name]) for name in wanted},
        tolerances={name: float(tolerances[name]) for name in wanted},
        computed=dict(zip(wanted, (target + result.fun * tolerance).tolist(), strict=True)),
        covariance=covariance,
        jacobian=result.jac * tolerance[:, None] / scale,
        chi_square=chi_square,
        degrees_of_freedom=freedom,
        converged=bool(result.status > 0),
        message=str(result.message),
    )


def _covariance(jacobian: FloatArray) -> FloatArray:
    """(JᵀJ)⁻¹; infinite variance for an unknown that a null direction of J moves."""
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    seen = singular > SEEN * singular.max(initial=0.0)
    covariance = (directions[seen].T / singular[seen] ** 2) @ directions[seen]
    unseen = (directions[~seen] ** 2).sum(axis=0) > SEEN
    covariance[unseen, unseen] = np.inf
    return np.asarray(covariance, dtype=np.float64)


def _picked(
    values: Mapping[str, float], wanted: list[str], unknowns: dict[str, float]
) -> FloatArray:
    missing = [name for name in wanted if name not in values]
    if missing:
        raise ModelError(
            f"calibration: the prediction does not give {missing[0]!r}; it gives {quoted(values)}"
        )
    picked = np.array([values[name] for name in wanted], dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(picked))
    if len(bad):
        at = ", ".join(f"{name} = {value:.6g}" for name, value in unknowns.items())
        raise ModelError(f"calibration: the predicted {wanted[bad[0]]!r} is not finite at {at}")
    return picked


def _check(
    start: Mapping[str, float],
    targets: Mapping[str, float],
    tolerances: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    step: float,
) -> None:
    if not start:
        raise ModelError("calibration: there is no unknown")
    if len(targets) < len(start):
        raise ModelError(
            f"calibration: {len(start)} unknowns ({quoted(start)}) need at least as many targets,"
            f" not {len(targets)}"
        )
    if set(targets) != set(tolerances):
        odd = sorted(set(targets) ^ set(tolerances))
        raise ModelError(
            f"calibration: targets and tolerances must have the same names; {odd[0]!r} is in one"
        )
    for what, numbers in (("start", start), ("target", targets), ("tolerance", tolerances)):
        for name, value in numbers.items():
            if not math.isfinite(value) or (what == "tolerance" and value <= 0.0):
                kind = "positive and finite" if what == "tolerance" else "finite"
                raise ModelError(
                    f"calibration: the {what} of {name!r} must be {kind}, not {value!r}"
                )
    for name, (low, high) in bounds.items():
        if name not in start:
            raise ModelError(
                f"calibration: there are bounds for {name!r} but the unknowns are {quoted(start)}"
            )
        if not low < high or not low <= start[name] <= high:
            raise ModelError(
                f"calibration: the start {start[name]:.6g} of {name!r} is not"
                f" within its bounds {low:.6g} to {high:.6g}"
            )
    if not 0.0 < step < 1.0:
        raise ModelError(f"calibration: step must be between 0 and 1, not {step!r}")
