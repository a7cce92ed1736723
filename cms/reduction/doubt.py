"""Matrices whose entries have so few digits that what they are hangs on their rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import linalg, sparse

from cms.base.arrays import FloatArray, SparseMatrix
from cms.base.errors import ReductionError
from cms.component.component import MOST_DENSE, ComponentLike, Pencil, checked_pencil
from cms.component.digits import doubtful_digits, relative_rounding
from cms.component.massless import MASSLESS
from cms.solvers.eigen import (
    RIGID_TOLERANCE,
    SUMMED,
    Shifted,
    dense_modes,
    fastest_square,
    lanczos_modes,
    shift_over_rounding,
    shifted_factor,
)
from cms.solvers.factor import DENSE_LIMIT, factorise

LOWEST = 8


def check_doubtful_digits(component: ComponentLike, pencil: Pencil) -> None:
    """Refuse what is one thing if the entries are exact, and another if they were rounded.

    That is only asked where the digits are neither stated nor sure, and K is known by its entries.

    Raises
    ------
    ReductionError
        If rounding to the digits of the entries may have moved one of the lowest w^2 from zero to
        where it is, or has left mass to a direction without any.
    """
    if pencil.natural is not None or getattr(component, "digits", None) is not None:
        return
    if not pencil.mass_rounding and pencil.size <= MOST_DENSE:
        digits = doubtful_digits(sparse.csc_array(component.mass).data)
        if digits is not None:
            check_mass(pencil.mass, digits)
    if not pencil.rounding:
        digits = doubtful_digits(sparse.csc_array(component.stiffness).data)
        if digits is not None:
            check_stiffness(pencil, digits)


def check_unreduced(component: ComponentLike) -> None:
    """Refuse matrices that cannot be used as they are, as rounding holds what floats.

    Raises
    ------
    ReductionError
        As `check_doubtful_digits`, and if there are rigid-body modes but for few digits.
    """
    pencil = checked_pencil(component)
    check_doubtful_digits(component, pencil)
    if pencil.rounding and (count := shifted_factor(pencil).rigid):
        raise ReductionError(
            f"with {pencil.digits} digits the stiffness holds by rounding what has {count} "
            f"rigid-body mode{'s' if count > 1 else ''}: it needs a reduction, which frees them"
        )


def check_mass(mass: SparseMatrix, digits: int) -> None:
    """Raise ReductionError where an eigenvalue of M, scaled to a unit diagonal, may be rounding."""
    has = mass.diagonal() > 0.0
    part = mass.toarray()[np.ix_(has, has)]
    scale = 1.0 / np.sqrt(np.diag(part))
    scaled = scale[:, None] * part * scale
    values = linalg.eigvalsh(scaled)
    bound = relative_rounding(digits) * float(linalg.norm(np.abs(scaled), 2))
    doubtful = (np.abs(values) <= bound) & (np.abs(values) > MASSLESS)
    if np.any(doubtful):
        raise ReductionError(
            f"the {digits} digits of the mass leave open which directions have mass: scaled to a "
            f"unit diagonal it has the eigenvalue {values[doubtful][0]:.2g}, and rounding may have "
            f"moved it by {bound:.1g}; {what_to_do(digits)}"
        )


def check_stiffness(pencil: Pencil, digits: int) -> None:
    """Raise ReductionError where a lowest w^2 may be zero but for rounding of the entries."""
    rounded = replace(pencil, rounding=relative_rounding(digits))
    shift = shift_over_rounding(rounded, fastest_square(pencil))
    factor = factorise(pencil.stiffness + shift * pencil.mass)
    if factor is None:
        return  # rounding does not explain it
    squares, vectors = lowest(pencil, Shifted(factor, shift, 0.0, np.zeros((pencil.size, 0))))
    bound = rounded.undetermined(vectors, SUMMED)
    zero = pencil.undetermined(vectors, SUMMED) + RIGID_TOLERANCE * shift
    doubtful = (np.abs(squares) <= bound) & (np.abs(squares) > zero)
    if np.any(doubtful):
        mode = int(np.argmax(doubtful))
        raise ReductionError(
            f"the {digits} digits of the stiffness leave open whether the component floats: "
            f"rounding may move the w^2 of a rigid-body mode by {bound[mode]:.2g} rad^2/s^2, and "
            f"that of mode {mode + 1} is {squares[mode]:.3g}; {what_to_do(digits)}"
        )


def lowest(pencil: Pencil, shifted: Shifted) -> tuple[FloatArray, FloatArray]:
    """The lowest w^2 (k,) and modes (N, k), whatever their sign."""
    count = min(LOWEST, pencil.size - pencil.massless.shape[1])
    found = dense_modes if pencil.size <= DENSE_LIMIT else lanczos_modes
    return found(pencil, shifted, count)


def what_to_do(digits: int) -> str:
    """The end of the sentence."""
    return (
        f"give more digits, or state digits = {digits} if the entries were rounded to these, "
        "digits = 17 if they are exact"
    )
