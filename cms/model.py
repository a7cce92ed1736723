"""The reduced model and its file."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cms.component import FloatArray
from cms.errors import ReductionError

FORMAT = "cms.ReducedModel"
FORMAT_VERSION = 1


@dataclass(frozen=True, eq=False)
class ReducedModel:
    r"""A component reduced to r modal coordinates.

    ``q'' + diag(w^2) q = sum_j p_j f_j``, displacement of interface j ``y_j = p_j @ q``, and all
    other displacements ``u = basis @ q``.

    Attributes
    ----------
    frequencies_hz : (r,) array
        Ascending; the kept free-interface modes first, then the residual modes.
    participation : dict of str to (r,) array
        ``b^T phi`` of the mass-normalised modes at each interface, in 1/sqrt(kg).
    basis : (N, r) array
        The modes, in 1/sqrt(kg); ``basis.T @ M @ basis`` is the identity.
    residuals : (r,) array
        Relative residual of each mode as a mode of the whole component: a bound on the relative
        error of its w^2. At rounding for kept modes; residual modes are not modes of the
        component, and theirs says how far they are from one.
    modes : int
        Number of kept free-interface modes.
    dropped_residual_modes : int
        Interfaces' residuals that vanish or depend on the others.

    Examples
    --------
    >>> import cms
    >>> chain = cms.Matrices([[2.0, -1.0], [-1.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]],
    ...                      {"tip": [0.0, 1.0]})
    >>> reduced = cms.reduce(chain, modes=0)
    >>> reduced.size, float(round(reduced.static_flexibility("tip"), 9))
    (1, 2.0)
    """

    frequencies_hz: FloatArray
    participation: Mapping[str, FloatArray]
    basis: FloatArray
    residuals: FloatArray
    modes: int
    dropped_residual_modes: int = 0

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        shape = np.shape(self.frequencies_hz)
        if len(shape) != 1 or np.ndim(self.basis) != 2 or self.basis.shape[1:] != shape:
            raise ReductionError(
                f"frequencies_hz of shape {shape} and basis of shape {np.shape(self.basis)} "
                "do not belong together"
            )
        for name, row in {"residuals": self.residuals, **self.participation}.items():
            if np.shape(row) != shape:
                raise ReductionError(f"'{name}' has shape {np.shape(row)}, it must have {shape}")
        if not 0 <= self.modes <= shape[0]:
            raise ReductionError(f"modes = {self.modes} is not between 0 and {shape[0]}")
        for field in ("frequencies_hz", "basis", "residuals"):
            object.__setattr__(self, field, read_only(getattr(self, field)))
        rows = {name: read_only(row) for name, row in self.participation.items()}
        object.__setattr__(self, "participation", rows)

    @property
    def size(self) -> int:
        """Number r of modal coordinates."""
        return int(self.frequencies_hz.size)

    @property
    def residual_modes(self) -> int:
        """Number of residual modes, the last ones of the basis."""
        return self.size - self.modes

    @property
    def rigid_body_modes(self) -> int:
        """Number of modes of zero frequency."""
        return int(np.count_nonzero(self.frequencies_hz == 0.0))

    @property
    def interfaces(self) -> tuple[str, ...]:
        """Names of the interfaces."""
        return tuple(self.participation)

    def expand(self, q: ArrayLike) -> FloatArray:
        """Displacements of the component from modal coordinates.

        Parameters
        ----------
        q : (r,) or (r, m) array_like
            Modal coordinates in m sqrt(kg), one column per state.

        Returns
        -------
        (N,) or (N, m) array
            ``basis @ q``.

        Raises
        ------
        ReductionError
            If q does not have r rows, or holds what is not a finite number.
        """
        try:
            states = np.asarray(q, dtype=np.float64)
        except (TypeError, ValueError):
            raise ReductionError("q must hold numbers only") from None
        if states.ndim not in (1, 2) or states.shape[0] != self.size:
            raise ReductionError(
                f"q has shape {states.shape}, it must be ({self.size},) or ({self.size}, m)"
            )
        if not np.all(np.isfinite(states)):
            raise ReductionError("q has an entry that is not a finite number")
        return self.basis @ states

    def static_flexibility(self, name: str, excited: str | None = None) -> float:
        """Displacement of an interface by a unit static load.

        Parameters
        ----------
        name : str
            Interface whose displacement is wanted.
        excited : str, optional
            Interface where the load acts; the same one if not given.

        Returns
        -------
        float
            In m/N. Equal to the full component's value if the model has residual modes;
            infinite if a rigid-body mode takes part.

        Raises
        ------
        ReductionError
            If there is no such interface.
        """
        product = self._row(name) * self._row(name if excited is None else excited)
        stiffness = (2.0 * np.pi * self.frequencies_hz) ** 2
        if np.any(product[stiffness == 0.0] != 0.0):
            return float("inf")
        elastic = stiffness > 0.0
        return float(np.sum(product[elastic] / stiffness[elastic]))

    def receptance(
        self, frequency_hz: ArrayLike, at: str, excited: str, modal_damping: float = 0.0
    ) -> NDArray[np.complex128]:
        r"""Displacement of one interface by a harmonic unit force at another.

        .. math:: H(\Omega) = \sum_i \frac{p_{ai}\, p_{ei}}
           {\omega_i^2 - \Omega^2 + 2 i \xi \omega_i \Omega}

        Parameters
        ----------
        frequency_hz : float or array_like
            Frequencies of the force in Hz.
        at, excited : str
            Interfaces of the displacement and of the force.
        modal_damping : float
            Damping ratio xi of every mode.

        Returns
        -------
        complex array of the shape of ``frequency_hz``
            In m/N; infinite at an undamped resonance.

        Raises
        ------
        ReductionError
            If there is no such interface.
        """
        omega = 2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64)[..., None]
        natural = 2.0 * np.pi * self.frequencies_hz
        product = self._row(at) * self._row(excited)
        dynamic = natural**2 - omega**2 + 2j * modal_damping * natural * omega
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sum(product / dynamic, axis=-1), dtype=np.complex128)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model to an .npz file, whole or not at all.

        Parameters
        ----------
        path : path-like
            Name of the file; it is written as named, replacing what was there.

        Raises
        ------
        ReductionError
            If the file cannot be written.
        """
        arrays: dict[str, Any] = {
            "format": np.array(FORMAT),
            "version": np.array(FORMAT_VERSION),
            "frequencies_hz": self.frequencies_hz,
            "basis": self.basis,
            "residuals": self.residuals,
            "modes": np.array(self.modes),
            "dropped_residual_modes": np.array(self.dropped_residual_modes),
            "interfaces": np.array(self.interfaces, dtype=np.str_),
            "participation": np.array(list(self.participation.values())).reshape(-1, self.size),
        }
        target = Path(path)
        draft = target.with_name(f".{target.name}-{secrets.token_hex(4)}")
        try:
            with draft.open("wb") as file:
                np.savez(file, **arrays)
            draft.replace(target)
        except OSError as error:
            raise ReductionError(
                f"{target} cannot be written ({error.strerror or error})"
            ) from error
        finally:
            draft.unlink(missing_ok=True)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ReducedModel:
        """Read a model that :meth:`save` wrote.

        Parameters
        ----------
        path : path-like
            Name of the file.

        Returns
        -------
        ReducedModel

        Raises
        ------
        ReductionError
            If the file is missing, is not such a file, or has a newer format.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = dict(file)
        except FileNotFoundError as error:
            raise ReductionError(f"there is no file {path}") from error
        except Exception as error:  # whatever zipfile, numpy or the system make of a broken file
            raise ReductionError(f"{path} is not a readable .npz file") from error
        return from_arrays(arrays, path)

    def _row(self, name: str) -> FloatArray:
        if name not in self.participation:
            known = ", ".join(self.participation) or "none"
            raise ReductionError(f"there is no interface '{name}' (there are: {known})")
        return self.participation[name]


def from_arrays(arrays: Mapping[str, NDArray[Any]], path: str | os.PathLike[str]) -> ReducedModel:
    """The reduced model from the arrays of its file, or ReductionError naming the file."""
    if "format" not in arrays or str(arrays["format"]) != FORMAT:
        raise ReductionError(f"{path} does not hold a reduced model")
    version = int(arrays["version"]) if "version" in arrays else 0
    if version != FORMAT_VERSION:
        raise ReductionError(
            f"{path} has format version {version}, this program reads version {FORMAT_VERSION}"
        )
    try:
        names = [str(name) for name in arrays["interfaces"]]
        return ReducedModel(
            frequencies_hz=arrays["frequencies_hz"],
            participation=dict(zip(names, arrays["participation"], strict=True)),
            basis=arrays["basis"],
            residuals=arrays["residuals"],
            modes=int(arrays["modes"]),
            dropped_residual_modes=int(arrays["dropped_residual_modes"]),
        )
    except (KeyError, ValueError) as error:
        raise ReductionError(f"{path} is damaged: {error}") from error


def read_only(array: ArrayLike) -> FloatArray:
    """A copy as floats that cannot be written to."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy
