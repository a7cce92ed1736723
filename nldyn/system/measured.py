"""Periodic forces from samples of one period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, check_whole, numbers
from nldyn.system.loads import ConstantForce, Excitation, HarmonicForce

NONE_LEFT = 1e-14  # share of the largest amplitude that rounding of the samples may be
SAME = 1e-9  # share of the largest deviation from the mean below which two samples are equal


@dataclass(frozen=True)
class MeasuredForce:
    """A periodic force by its harmonics.

    Parameters
    ----------
    sources : tuple of Excitation
        Its mean and its harmonics, as a `System` takes them.
    truncation_error : float
        Largest difference in N between the samples and the sum of the harmonics.
    size : float
        Largest deviation of a sample from the mean, in N.
    """

    sources: tuple[Excitation, ...]
    truncation_error: float
    size: float

    def __repr__(self) -> str:
        """One line: how many harmonics, and what they leave out."""
        count = sum(source.harmonic > 0 for source in self.sources)
        return (
            f"<MeasuredForce of {count} harmonics; largest deviation from the mean "
            f"{self.size:.6g} N, truncation error {self.truncation_error:.2g} N>"
        )


def measured_force(
    at: str, samples: ArrayLike, harmonics: int = 20, *, closed: bool | None = None
) -> MeasuredForce:
    """Periodic force from its values at equal distances over one period of the excitation.

    The coefficients are those of the discrete Fourier transform.

    Parameters
    ----------
    at : str
        Interface, or load vector.
    samples : (n,) array_like
        Force in N at the times 0, T/n, ..., (n - 1) T/n.
    harmonics : int
        How many harmonics to take, less than n/2; those of rounding's size are left out.
    closed : bool, optional
        Whether the last sample is that at T, the first one again, which then is left out. Needed
        where the two are equal, which does not tell it.

    Raises
    ------
    SystemModelError
        For too few samples, ones that are no finite numbers, or a last one that equals the first
        where nothing says whether it is that again.

    Examples
    --------
    >>> t = np.arange(64) / 64.0
    >>> force = measured_force("tip", 2.0 + np.cos(2 * np.pi * t) + 0.1 * np.sin(6 * np.pi * t))
    >>> [(s.harmonic, round(abs(s.phasor), 12)) for s in force.sources]
    [(0, 2.0), (1, 1.0), (3, 0.1)]
    >>> force.truncation_error < 1e-14
    True
    """
    values = numbers(f"samples of the force at '{at}'", samples)
    check_whole("harmonics", harmonics, 1)
    check_types(closed=(closed, bool, None))
    values = _one_period(at, values, closed)
    if values.ndim != 1 or values.size <= 2 * harmonics:
        raise SystemModelError(
            f"the force at '{at}' needs more than {2 * harmonics} samples of one period for "
            f"{harmonics} harmonics, got {values.size if values.ndim == 1 else values.shape}"
        )
    coefficients = np.fft.rfft(values) / values.size
    mean, phasors = float(coefficients[0].real), 2.0 * coefficients[1 : harmonics + 1]
    least = NONE_LEFT * max(np.abs(phasors).max(), abs(mean))
    sources: list[Excitation] = [ConstantForce(at, mean)] if abs(mean) > least else []
    sources += [
        HarmonicForce(at, float(abs(a)), float(np.degrees(np.angle(a))), order)
        for order, a in enumerate(phasors.tolist(), 1)
        if abs(a) > least
    ]
    turns = 2.0 * np.pi * np.arange(values.size) / values.size
    sum_ = mean + (np.exp(1j * np.outer(turns, np.arange(1, harmonics + 1))) @ phasors).real
    return MeasuredForce(
        tuple(sources), float(np.abs(values - sum_).max()), float(np.abs(values - mean).max())
    )


def _one_period(at: str, values: Real, closed: bool | None) -> Real:
    """The samples without a last one that is the first one again."""
    if values.ndim != 1 or values.size < 2:
        return values
    apart, size = abs(values[-1] - values[0]), np.abs(values - values.mean()).max()
    if closed is None and size > 0.0 and apart <= SAME * size:
        raise SystemModelError(
            f"the last of {values.size} samples of the force at '{at}' equals the first: say "
            "closed = true if it is that again, a whole period later, and closed = false if the "
            "period ends one step after it"
        )
    return values[:-1] if closed else values
