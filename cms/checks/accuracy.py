"""How wrong a reduced model is: bands for its frequencies and for the receptance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.checks.checks import check_belongs
from cms.component.component import ComponentLike, Pencil, checked_pencil, times
from cms.reduction.constraint import fixed_interface
from cms.reduction.inertia import elastic_solutions
from cms.reduction.model import ReducedModel, positive
from cms.reduction.residual import residual_flexibility, without_modes
from cms.reduction.seen import lowest_seen_modes
from cms.solvers.eigen import Modes, Shifted, lowest_modes, shifted_factor, without_offsets

NO_MODE = 1e8  # relative residual of what is no mode at all; its square is still a number
NEGATIVE = 1e-9  # of the largest: an eigenvalue that is not rounding


@dataclass(frozen=True, eq=False)
class Bounds:
    """What is known of a component with free interfaces at one frequency.

    Attributes
    ----------
    low, high : (m, m) array
        The undamped receptance H of its interfaces lies between these: ``H - low`` and
        ``high - H`` are positive semidefinite.
    free : int
        Number of its frequencies, with rigid-body modes, below the given one.
    """

    low: FloatArray
    high: FloatArray
    free: int


@dataclass(frozen=True, eq=False)
class Accuracy:
    """What is known of a reduced model's error without solving the full one, by `accuracy`.

    Attributes
    ----------
    reduced : ReducedModel
        The model.
    next_hz : float
        Frequency of the first mode left out: of the component, or of the component with held
        interfaces for Craig-Bampton's and Guyan's methods. Infinite if none is left out.
    gram : (m, m) array
        Positive semidefinite matrix from which the receptance's error grows, see the notes of
        `receptance_error`.
    """

    reduced: ReducedModel
    next_hz: float
    gram: FloatArray

    @cached_property
    def frequency_bands_hz(self) -> FloatArray:
        """Band (r, 2) in Hz around each frequency that holds one of the component, for certain.

        From the residuals: an exact w' lies within ``|w'^2 - w^2| <= residual w w'`` (Li 1998).
        Kept free-interface modes have bands at rounding level; a residual mode's band says how
        little it is a mode.
        """
        half = np.minimum(self.reduced.residuals, NO_MODE) / 2.0
        factor = np.sqrt(1.0 + half**2) + half
        hz = self.reduced.frequencies_hz
        return np.column_stack([hz / factor, hz * factor])

    def receptance_error(self, frequency_hz: ArrayLike, at: str, excited: str) -> FloatArray:
        r"""Band of the error of the receptance, without damping.

        Parameters
        ----------
        frequency_hz : float or (k,) array_like
            Frequencies in Hz.
        at, excited : str
            Interfaces of the displacement and of the force.

        Returns
        -------
        (k, 2) array
            Between these the component's receptance minus the model's lies, in m/N; infinite at
            and above ``next_hz``, where a mode left out may resonate.

        Raises
        ------
        ReductionError
            If there is no such interface, or a frequency is not a number.

        Notes
        -----
        What free-interface methods leave out is a sum over the modes above the kept ones, in which
        each term lies between its static value and :math:`a = \omega^2/(\omega^2 - \Omega^2)`
        times that, with the first frequency left out ω. The static values need no modes:
        for truncation they sum to the residual flexibility :math:`\Psi^T K\Psi`, for MacNeal's
        method to :math:`\Omega^2 \Psi^T M \Psi`, and for Rubin's to

        .. math:: \Omega^4 x^T (V^T M K_r^{-1} M V - \Lambda^{-1}) x, \qquad
                  x = (\Lambda - \Omega^2)^{-1} V^T b

        with the residual modes V, their squared frequencies Λ, and the inverse :math:`K_r^{-1}`
        on what is left out. For Craig-Bampton's method the same holds for the dynamic
        stiffness between the interfaces, where it is
        :math:`\Omega^4 \Psi_c^T M K_r^{-1} M \Psi_c` with the constraint modes. So the bands are
        bounds, not estimates. For displacement and force at different interfaces the spread
        follows from those of both by Schwarz's inequality.

        Examples
        --------
        >>> import numpy as np, cms
        >>> n = 50
        >>> K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        >>> chain = cms.Matrices(K, np.eye(n), {"first": np.eye(n)[0]})
        >>> known = cms.accuracy(chain, cms.reduce(chain, modes=3))
        >>> low, high = known.receptance_error(0.015, "first", "first")[0]
        >>> exact = np.linalg.inv(K - (2 * np.pi * 0.015) ** 2 * np.eye(n))[0, 0]
        >>> model = known.reduced.receptance(0.015, "first", "first").real
        >>> bool(low < exact - model < high < 1.2 * low)
        True
        """
        names = self.reduced.interfaces
        for name in (at, excited):
            self.reduced.static_flexibility(name)  # says if there is no such interface
        i, j = names.index(at), names.index(excited)
        bands = []
        for hz in positive("frequency_hz", np.atleast_1d(frequency_hz)):
            if hz >= self.next_hz:
                bands.append((-np.inf, np.inf))
                continue
            square = (2.0 * np.pi * hz) ** 2
            growth = 1.0 / (1.0 - (hz / self.next_hz) ** 2)
            low, high = self._error(square, 1.0), self._error(square, growth)
            spread = high - low
            if np.min(np.linalg.eigvalsh(spread)) < -NEGATIVE * np.abs(high).max():
                bands.append((-np.inf, np.inf))  # a resonance of the model lies in between
            elif i == j:
                bands.append((low[i, i], high[i, i]))
            else:
                middle = (low + high)[i, j] / 2.0
                reach = np.sqrt(max(spread[i, i] * spread[j, j], 0.0)) / 2.0
                bands.append((middle - reach, middle + reach))
        return np.array(bands)

    def bounds(self, frequency_hz: float) -> Bounds | None:
        """Bounds of the receptance as a matrix, and the count of frequencies below.

        None from ``next_hz`` on, and where a resonance of the model by held interfaces lies in
        the band.
        """
        model = self.reduced
        if frequency_hz >= self.next_hz:
            return None
        square = (2.0 * np.pi * frequency_hz) ** 2
        growth = 1.0 / (1.0 - (frequency_hz / self.next_hz) ** 2)
        rows = np.array([model.participation[name] for name in model.interfaces])
        with np.errstate(divide="ignore", invalid="ignore"):
            receptance = (rows / ((2.0 * np.pi * model.frequencies_hz) ** 2 - square)) @ rows.T
        if not np.all(np.isfinite(receptance)):
            return None
        if model.method in ("craig-bampton", "guyan"):
            below = int(np.count_nonzero(model.frequencies_hz < frequency_hz))
            stiffness = linalg.inv(receptance)
            softer = [stiffness - g * square**2 * self.gram for g in (1.0, growth)]
            held = below - negative(stiffness)
            if negative(softer[0]) != negative(softer[1]):
                return None
            low, high = map(linalg.inv, softer)
            return Bounds(low, high, held + negative(softer[0]))
        if model.residual_flexibility is not None:
            receptance = receptance + model.residual_flexibility
        below = int(np.count_nonzero(model.frequencies_hz[: model.modes] < frequency_hz))
        return Bounds(
            receptance + self._error(square, 1.0), receptance + self._error(square, growth), below
        )

    def _error(self, square: float, growth: float) -> FloatArray:
        """Error (m, m) of the receptance at w^2 if every mode left out answers ``growth`` times."""
        model = self.reduced
        if model.method == "truncation":
            return growth * self.gram
        if model.method == "macneal":
            return growth * square * self.gram
        rows = np.array([model.participation[name] for name in model.interfaces])
        dynamic = (2.0 * np.pi * model.frequencies_hz) ** 2 - square
        if model.method in ("craig-bampton", "guyan"):
            stiffness = linalg.inv((rows / dynamic) @ rows.T)
            return np.asarray(
                linalg.inv(stiffness - growth * square**2 * self.gram) - linalg.inv(stiffness)
            )
        x = rows[:, model.modes :] / dynamic[model.modes :]
        return np.asarray(growth * square**2 * x @ self.gram @ x.T)


def accuracy(component: ComponentLike, reduced: ReducedModel) -> Accuracy:
    """What is known of the error of a reduced model.

    Parameters
    ----------
    component : ComponentLike
        The component that it was made of.
    reduced : ReducedModel
        Its reduced model.

    Returns
    -------
    Accuracy

    Raises
    ------
    ReductionError
        If the model does not belong to the component, or is one whose error is not known.

    Notes
    -----
    It costs a factorisation, the kept modes and one more, and a solution per interface.
    """
    pencil = checked_pencil(component)
    check_belongs(pencil, reduced)
    if reduced.method in ("craig-bampton", "guyan"):
        return accuracy_fixed(pencil, reduced)
    if reduced.method == "macneal" and reduced.residual_modes:
        raise ReductionError(
            "the error is known only where all interfaces have mass, or none of them has"
        )
    shifted = shifted_factor(pencil)
    pencil = without_offsets(pencil, shifted)
    modes = with_next(pencil, shifted, reduced, pencil.loads)
    kept = modes.vectors[:, : reduced.modes]
    if reduced.method in ("truncation", "macneal"):
        shapes = residual_flexibility(pencil, shifted, kept)
        truncated = reduced.method == "truncation"
        gram = pencil.energies(shapes) if truncated else shapes.T @ times(pencil.mass, shapes)
    else:
        V = reduced.basis[:, reduced.modes :]
        inertia = times(pencil.mass, V)
        inverse = without_modes(elastic_solutions(pencil, shifted, inertia), kept, pencil)
        squares = (2.0 * np.pi * reduced.frequencies_hz[reduced.modes :]) ** 2
        gram = inertia.T @ inverse - np.diag(1.0 / squares)
    return Accuracy(reduced, next_frequency(modes, reduced.modes), semidefinite(gram))


def accuracy_fixed(pencil: Pencil, reduced: ReducedModel) -> Accuracy:
    """Accuracy of a model by Craig-Bampton's or Guyan's method."""
    if reduced.dropped_residual_modes:
        raise ReductionError("the error is known only where no interface depends on the others")
    fixed = fixed_interface(pencil)
    if fixed.shifted.rigid:
        raise ReductionError("the error is known only where the interfaces hold the component")
    inner = fixed.interior
    load = fixed.inertia_of_constraint_modes()
    modes = with_next(inner, fixed.shifted, reduced, load)
    kept = modes.vectors[:, : reduced.modes]
    load = load - times(inner.mass, kept) @ (kept.T @ load)
    gram = load.T @ without_modes(elastic_solutions(inner, fixed.shifted, load), kept, inner)
    return Accuracy(reduced, next_frequency(modes, reduced.modes), semidefinite(gram))


def with_next(pencil: Pencil, shifted: Shifted, reduced: ReducedModel, loads: FloatArray) -> Modes:
    """The kept modes of a model and, if there is one, the next that a load moves."""
    count = min(reduced.modes + 1, pencil.size)
    if reduced.unseen_modes:
        return lowest_modes(pencil, shifted, count)
    return lowest_seen_modes(pencil, shifted, count, loads)[0]


def next_frequency(modes: Modes, kept: int) -> float:
    """Frequency in Hz of the mode after the kept ones; infinite if there is none."""
    if modes.squares.size <= kept:
        return np.inf
    return float(np.sqrt(modes.squares[kept])) / (2.0 * np.pi)


def negative(matrix: FloatArray) -> int:
    """Number of negative eigenvalues of a symmetric matrix."""
    return int(np.count_nonzero(np.linalg.eigvalsh(matrix) < 0.0)) if matrix.size else 0


def semidefinite(matrix: FloatArray) -> FloatArray:
    """The matrix without its negative part, which is rounding."""
    if not matrix.size:
        return matrix
    values, vectors = linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
