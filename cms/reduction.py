"""Reduce a component to free-interface modes and residual flexibility."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cms.component import ComponentLike, FloatArray, Pencil, checked_pencil
from cms.eigen import Modes, Shifted, lowest_modes, mode_errors, modes_up_to, shifted_factor
from cms.errors import ReductionError
from cms.model import ReducedModel
from cms.residual import residual_modes

NEGLIGIBLE_PARTICIPATION = 1e-9


@dataclass(frozen=True, eq=False)
class Matrices:
    """A component given by its matrices.

    Attributes
    ----------
    stiffness, mass : (N, N) sparse or dense matrix
        Symmetric, in N/m and kg for translations.
    interfaces : mapping of str to (N,) array_like
        Load and displacement vector of each interface.

    Examples
    --------
    >>> import cms
    >>> oscillator = cms.Matrices([[4.0]], [[1.0]], {"mass": [1.0]})
    >>> cms.reduce(oscillator, modes=1).frequencies_hz.round(4).tolist()
    [0.3183]
    """

    stiffness: Any
    mass: Any
    interfaces: Mapping[str, Any]


def reduce(
    component: ComponentLike,
    *,
    modes: int | None = None,
    cutoff_hz: float | None = None,
    residual: bool = True,
) -> ReducedModel:
    r"""Reduce a component to free-interface modes plus residual flexibility modes.

    Parameters
    ----------
    component : ComponentLike
        Any object with ``stiffness``, ``mass`` (N, N) and ``interfaces`` {name: (N,)}.
    modes : int, optional
        Number of free-interface modes to keep, 0 to N.
    cutoff_hz : float, optional
        Keep the modes up to this frequency in Hz, instead of ``modes``. Below the first
        frequency no mode is kept, which leaves the residual modes alone: a static model.
    residual : bool
        Add one residual flexibility mode per interface, which makes the static flexibility
        between the interfaces exact. Needs a component that is held (no rigid-body modes).

    Returns
    -------
    ReducedModel
        Of r = kept modes + independent residual modes. A mode's sign is such that its
        participation at the first interface that it moves is positive.

    Raises
    ------
    ReductionError
        With one sentence that names what is wrong with the component or the request.

    Notes
    -----
    The residual modes are the static solutions minus the kept modes' share,
    :math:`\psi_j = K^{-1} b_j - \sum_i \phi_i \phi_i^T b_j / \omega_i^2` [1]_, with their mass kept
    [2]_ as in a Rayleigh-Ritz projection on :math:`[\Phi, \Psi]` [3]_. They are K- and
    M-orthogonal to the kept modes, so the kept frequencies stay exact.

    References
    ----------
    .. [1] MacNeal, R.H. (1971) A hybrid method of component mode synthesis. Computers &
       Structures 1(4), 581-601.
    .. [2] Rubin, S. (1975) Improved component-mode representation for structural dynamic
       analysis. AIAA Journal 13(8), 995-1006.
    .. [3] Craig, R.R. and Chang, C.-J. (1977) On the use of attachment modes in substructure
       coupling for dynamic analysis. AIAA paper 77-405.

    Examples
    --------
    >>> import numpy as np, cms
    >>> n = 50
    >>> stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    >>> chain = cms.Matrices(stiffness, np.eye(n), {"first": np.eye(n)[0]})
    >>> reduced = cms.reduce(chain, modes=3)
    >>> reduced.size
    4
    >>> bool(np.isclose(reduced.static_flexibility("first"), n / (n + 1), rtol=1e-12))
    True
    """
    check_request(modes, cutoff_hz)
    pencil = checked_pencil(component)
    check_count(modes, residual, pencil)
    shifted = shifted_factor(pencil)
    if residual:
        check_held(shifted)
    kept = kept_modes(pencil, shifted, modes, cutoff_hz)
    if not residual:
        if kept.squares.size == 0:
            raise ReductionError(nothing_kept(cutoff_hz))
        return assembled(pencil, kept, 0)
    extra = residual_modes(pencil, shifted.factor, kept.vectors)
    if kept.squares.size + extra.squares.size == 0:
        raise ReductionError(nothing_kept(cutoff_hz))
    errors = mode_errors(pencil, shifted, extra.squares, extra.vectors)
    return assembled(pencil, kept, extra.dropped, Modes(extra.squares, extra.vectors, errors))


def check_request(modes: int | None, cutoff_hz: float | None) -> None:
    """Raise ReductionError unless exactly one of modes and cutoff_hz is given, and sensible."""
    if (modes is None) == (cutoff_hz is None):
        given = "neither is" if modes is None else "both are"
        raise ReductionError(f"give either modes or cutoff_hz; {given} given")
    if modes is not None:
        try:
            count = operator.index(modes)
        except TypeError:
            count = -1
        if isinstance(modes, bool) or count < 0:
            raise ReductionError(f"modes = {modes!r} must be a whole number, 0 or more")
    elif not (isinstance(cutoff_hz, int | float | np.number) and 0.0 < cutoff_hz < math.inf):
        raise ReductionError(f"cutoff_hz = {cutoff_hz!r} must be a positive frequency in Hz")


def check_count(modes: int | None, residual: bool, pencil: Pencil) -> None:
    """Raise ReductionError where the component cannot give what is asked for."""
    if modes is not None and modes > pencil.size:
        raise ReductionError(
            f"modes = {modes}, but the component has only {pencil.size} degrees of freedom"
        )
    if modes == 0 and not residual:
        raise ReductionError("modes = 0 without residual modes leaves nothing of the component")
    if modes == 0 and not pencil.names:
        raise ReductionError("modes = 0, and the component has no interface for a residual mode")


def nothing_kept(cutoff_hz: float | None) -> str:
    """The sentence for an empty reduced model."""
    return f"no mode of the component lies below cutoff_hz = {cutoff_hz}, so nothing is left of it"


def kept_modes(
    pencil: Pencil, shifted: Shifted, modes: int | None, cutoff_hz: float | None
) -> Modes:
    """The free-interface modes up to the count or the cut-off frequency."""
    if modes is not None:
        return lowest_modes(pencil, shifted, operator.index(modes))
    assert cutoff_hz is not None
    return modes_up_to(pencil, shifted, (2.0 * np.pi * float(cutoff_hz)) ** 2)


def check_held(shifted: Shifted) -> None:
    """Raise ReductionError where the component floats, so that K has no inverse."""
    if shifted.rigid:
        raise ReductionError(
            f"the component floats ({shifted.rigid} rigid-body "
            f"mode{'s' if shifted.rigid > 1 else ''}): residual flexibility needs supports "
            "that hold it, or use residual=False"
        )


def assembled(
    pencil: Pencil, kept: Modes, dropped: int, extra: Modes | None = None
) -> ReducedModel:
    """Put kept and residual modes together as a ReducedModel."""
    parts = [kept] if extra is None else [kept, extra]
    squares = np.concatenate([part.squares for part in parts])
    errors = np.concatenate([part.errors for part in parts])
    vectors = signed(np.hstack([part.vectors for part in parts]), pencil.loads)
    rows = pencil.loads.T @ vectors
    return ReducedModel(
        frequencies_hz=np.sqrt(squares) / (2.0 * np.pi),
        participation=dict(zip(pencil.names, rows, strict=True)),
        basis=vectors,
        residuals=errors,
        modes=int(kept.squares.size),
        dropped_residual_modes=dropped,
    )


def signed(vectors: FloatArray, loads: FloatArray) -> FloatArray:
    """The modes with their signs fixed by the first interface that each of them moves.

    A mode that moves no interface gets a positive largest entry (the first of equal ones).
    """
    rows = loads.T @ vectors
    size = np.linalg.norm(loads, axis=0)[:, None] * np.linalg.norm(vectors, axis=0)
    peak = np.max(np.abs(vectors), axis=0)
    largest = np.argmax(np.abs(vectors) > (1.0 - 1e-6) * peak, axis=0)
    signs = np.sign(np.take_along_axis(vectors, largest[None, :], axis=0)[0])
    for row, scale in zip(rows[::-1], size[::-1], strict=True):
        signs = np.where(np.abs(row) > NEGLIGIBLE_PARTICIPATION * scale, np.sign(row), signs)
    return np.asarray(vectors * signs)
