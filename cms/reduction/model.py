"""The reduced model and its file."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.reduction.area import Attached

FORMAT = "cms.ReducedModel"
FORMAT_VERSION = 2
INVISIBLE = 1e-9
OPTIONAL = ("damping", "residual_flexibility", "residual_shapes")


@dataclass(frozen=True, eq=False)
class ReducedModel:
    r"""A component, or several coupled ones, reduced to r modal coordinates.

    ``q'' + D q' + diag(w^2) q = sum_j p_j f_j``, displacement of interface i
    ``y_i = p_i @ q + sum_j G_ij f_j``, and all other displacements ``u = basis @ q``. Every method
    gives this form, since projected matrices can be diagonalised; G is zero but for MacNeal's
    method and coupled dual models.

    Attributes
    ----------
    frequencies_hz : (r,) array
        For free-interface methods the kept modes first, then the residual modes, each ascending;
        else ascending.
    participation : dict of str to (r,) array
        ``b^T phi`` of the mass-normalised modes at each interface, in 1/sqrt(kg).
    basis : (N, r) array
        The modes, in 1/sqrt(kg); ``basis.T @ M @ basis`` is the identity.
    residuals : (r,) array
        Relative residual of each mode as a mode of the whole component: a bound on the relative
        error of its w^2. At rounding for kept modes; residual modes are not modes of the
        component, and theirs says how far they are from one. Infinite (no bound is known) for
        coupled models.
    modes : int
        Number of kept component modes: free-interface modes, or fixed-interface modes for
        Craig-Bampton's method. For a coupled model all of its modes.
    dropped_residual_modes : int
        Interfaces' residual or constraint modes that vanish or depend on the others.
    method : str
        Name of the method, see `cms.reduce`.
    damping : (r, r) array, optional
        Damping matrix D in 1/s, see `with_damping`; no array means none.
    residual_flexibility : (m, m) array, optional
        Massless part G of the flexibility between the interfaces in m/N.
    residual_shapes : (N, m) array, optional
        The shapes that belong to it: under interface forces f the displacements are
        ``basis @ q + residual_shapes @ f``.
    components : dict of str to (int, int)
        Rows of the basis that belong to each component of a coupled model.
    load_vectors : tuple of str
        Names of those interfaces that are load vectors: of weight, or of a motion of the base.
    left_out_hz : tuple of float
        Frequencies in Hz of modes below the last kept one that are left out, as no interface sees
        them.
    areas : dict of str to Attached
        How many attachment modes areas of contact were given, and their static errors.
    rigid_bound_hz : float
        Up to where the few digits of given matrices leave the frequency of rigid-body modes
        undetermined; those below are zero. 0 for matrices in double precision.

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
    method: str = "rubin"
    damping: FloatArray | None = None
    residual_flexibility: FloatArray | None = None
    residual_shapes: FloatArray | None = None
    components: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    rigid_bound_hz: float = 0.0
    load_vectors: tuple[str, ...] = ()
    left_out_hz: tuple[float, ...] = ()
    areas: Mapping[str, Attached] = field(default_factory=dict)

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
        m = len(self.participation)
        optional = {
            "damping": shape * 2,
            "residual_flexibility": (m, m),
            "residual_shapes": (np.shape(self.basis)[0], m),
        }
        for name, wanted in optional.items():
            array = getattr(self, name)
            if array is None:
                continue
            if np.shape(array) != wanted:
                raise ReductionError(f"'{name}' has shape {np.shape(array)}, it must be {wanted}")
            object.__setattr__(self, name, read_only(array))
        for name in ("frequencies_hz", "basis", "residuals"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        rows = {name: read_only(row) for name, row in self.participation.items()}
        object.__setattr__(self, "participation", rows)

    def __repr__(self) -> str:
        """One line: modes, their frequencies, the method and the interfaces."""
        names = ", ".join(map(repr, self.participation)) or "none"
        span = f" from {self.frequencies_hz.min():.4g} to {self.frequencies_hz.max():.4g} Hz"
        return (
            f"<ReducedModel: {self.size} modes, {self.modes} of them kept,"
            f"{span if self.size else ''} by '{self.method}'; interfaces {names}>"
        )

    @property
    def size(self) -> int:
        """Number r of modal coordinates."""
        return int(self.frequencies_hz.size)

    @property
    def residual_modes(self) -> int:
        """Number of residual modes, the last ones of the basis.

        None by fixed-interface methods, whose constraint modes all modes of the model share.
        """
        return 0 if self.method in ("craig-bampton", "guyan") else self.size - self.modes

    @property
    def rigid_body_modes(self) -> int:
        """Number of modes of zero frequency."""
        return int(np.count_nonzero(self.frequencies_hz == 0.0))

    @property
    def unseen_modes(self) -> tuple[int, ...]:
        """Numbers, from 1, of the kept modes that move no interface: no force there finds them."""
        if not self.participation:
            return ()
        rows = np.abs(np.array(list(self.participation.values())))
        largest = rows.max(axis=1, keepdims=True)
        seen = np.any(rows > INVISIBLE * np.where(largest > 0.0, largest, 1.0), axis=0)
        return tuple(int(number) + 1 for number in np.flatnonzero(~seen[: self.modes]))

    @property
    def interfaces(self) -> tuple[str, ...]:
        """Names of the interfaces."""
        return tuple(self.participation)

    @property
    def has_massless_part(self) -> bool:
        """Whether part of the flexibility has no mass, so that forces move interfaces at once."""
        return self.residual_flexibility is not None and bool(np.any(self.residual_flexibility))

    def with_damping(
        self,
        *,
        modal: float | ArrayLike = 0.0,
        rayleigh: tuple[float, float] = (0.0, 0.0),
        dampers: Mapping[str, float] | None = None,
    ) -> ReducedModel:
        r"""The same model with more damping.

        Parameters
        ----------
        modal : float or (r,) array_like
            Damping ratio of every mode: adds :math:`2\xi_i\omega_i` to the diagonal of D.
        rayleigh : (float, float)
            alpha in 1/s and beta in s of ``C = alpha M + beta K``: adds
            :math:`\alpha I + \beta\Omega^2`, which is the projection of C and so exact.
        dampers : dict of str to float
            Coefficient in N s/m of a damper from an interface to the ground: adds
            :math:`c\,p\,p^T`, which is exact, too.

        Returns
        -------
        ReducedModel

        Raises
        ------
        ReductionError
            For a value that is negative or not finite, or an unknown interface.

        Examples
        --------
        >>> import cms
        >>> oscillator = cms.reduce(cms.Matrices([[400.0]], [[4.0]], {"mass": [1.0]}), modes=1)
        >>> oscillator.with_damping(rayleigh=(0.1, 0.002), dampers={"mass": 2.0}).damping.tolist()
        [[0.8]]
        """
        omega = 2.0 * np.pi * self.frequencies_hz
        ratios = positive("modal", modal)
        if ratios.shape not in ((), omega.shape):
            raise ReductionError(
                f"modal must be one damping ratio or one per mode ({self.size}), "
                f"it has shape {ratios.shape}"
            )
        pair = positive("rayleigh", rayleigh)
        if pair.shape != (2,):
            raise ReductionError(f"rayleigh must be two numbers (alpha, beta), not {rayleigh}")
        alpha, beta = pair
        if beta > 0.0 and self.has_massless_part:
            raise ReductionError(
                f"stiffness-proportional damping of a model by '{self.method}' has no exact form: "
                "reduce by 'rubin' or 'craig-bampton'"
            )
        D = np.diag(2.0 * ratios * omega + alpha + beta * omega**2)
        for name, coefficient in (dampers or {}).items():
            row = self._row(name)
            if self.has_massless_part:
                raise ReductionError(
                    f"a damper at '{name}' needs a model whose interfaces have mass: reduce by "
                    f"'rubin' or 'craig-bampton', not by '{self.method}'"
                )
            D += positive(f"the damper at '{name}'", coefficient) * np.outer(row, row)
        return replace(self, damping=D if self.damping is None else self.damping + D)

    def expand(self, q: ArrayLike, component: str | None = None) -> FloatArray:
        """Displacements of the component from modal coordinates.

        Parameters
        ----------
        q : (r,) or (r, m) array_like
            Modal coordinates in m sqrt(kg), one column per state.
        component : str, optional
            Of a coupled model only this component.

        Returns
        -------
        (N,) or (N, m) array
            ``basis @ q``.

        Raises
        ------
        ReductionError
            If q does not have r rows, or holds what is not a finite number.
        """
        basis = self.basis
        if component is not None:
            if component not in self.components:
                known = ", ".join(self.components) or "none"
                raise ReductionError(f"there is no component '{component}' (there are: {known})")
            basis = basis[slice(*self.components[component])]
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
        return basis @ states

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
        excited = name if excited is None else excited
        product = self._row(name) * self._row(excited)
        stiffness = (2.0 * np.pi * self.frequencies_hz) ** 2
        if np.any(product[stiffness == 0.0] != 0.0):
            return float("inf")
        elastic = stiffness > 0.0
        modal = np.sum(product[elastic] / stiffness[elastic])
        return float(modal + self._massless_flexibility(name, excited))

    def receptance(
        self, frequency_hz: ArrayLike, at: str, excited: str, modal_damping: float = 0.0
    ) -> NDArray[np.complex128]:
        r"""Displacement of one interface by a harmonic unit force at another.

        .. math:: H(\Omega) = G_{ae} + \sum_i \frac{p_{ai}\, p_{ei}}
           {\omega_i^2 - \Omega^2 + 2 i \xi \omega_i \Omega}

        With a damping matrix D the matrix of the sum is inverted as a whole.

        Parameters
        ----------
        frequency_hz : float or array_like
            Frequencies of the force in Hz.
        at, excited : str
            Interfaces of the displacement and of the force.
        modal_damping : float
            Damping ratio xi of every mode, beside the model's own ``damping``.

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
        a, e = self._row(at), self._row(excited)
        massless = self._massless_flexibility(at, excited)
        dynamic = natural**2 - omega**2 + 2j * modal_damping * natural * omega
        if self.damping is None:
            with np.errstate(divide="ignore", invalid="ignore"):
                modal = np.sum(a * e / dynamic, axis=-1)
        else:
            matrices = dynamic[..., None] * np.eye(self.size)
            matrices = matrices + 1j * omega[..., None] * self.damping
            try:
                modal = np.linalg.solve(matrices, e[:, None])[..., 0] @ a
            except np.linalg.LinAlgError:
                raise ReductionError("a frequency meets an undamped resonance exactly") from None
        return np.asarray(modal + massless, dtype=np.complex128)

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
            "method": np.array(self.method),
            "rigid_bound_hz": np.array(self.rigid_bound_hz),
            "load_vectors": np.array(self.load_vectors, dtype=np.str_),
            "left_out_hz": np.array(self.left_out_hz),
            "components": np.array(list(self.components), dtype=np.str_),
            "component_rows": np.array(list(self.components.values()), dtype=np.int64),
            "areas": np.array(list(self.areas), dtype=np.str_),
            "attachment_modes": np.array([a.modes for a in self.areas.values()], dtype=np.int64),
            "static_errors": np.array([a.static_error for a in self.areas.values()]),
        }
        for name in OPTIONAL:
            if getattr(self, name) is not None:
                arrays[name] = getattr(self, name)
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

    def _massless_flexibility(self, at: str, excited: str) -> float:
        if self.residual_flexibility is None:
            return 0.0
        i, j = self.interfaces.index(at), self.interfaces.index(excited)
        return float(self.residual_flexibility[i, j])

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
    if not 1 <= version <= FORMAT_VERSION:
        raise ReductionError(
            f"{path} has format version {version}, this program reads up to {FORMAT_VERSION}"
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
            **(later_fields(arrays) if version > 1 else {}),
        )
    except (KeyError, ValueError) as error:
        raise ReductionError(f"{path} is damaged: {error}") from error


def later_fields(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """What version 2 of the file holds beside version 1."""
    names = [str(name) for name in arrays["components"]]
    rows = [(int(start), int(end)) for start, end in arrays["component_rows"].reshape(-1, 2)]
    return {
        "method": str(arrays["method"]),
        "components": dict(zip(names, rows, strict=True)),
        "rigid_bound_hz": float(arrays.get("rigid_bound_hz", 0.0)),
        "load_vectors": tuple(str(name) for name in arrays.get("load_vectors", ())),
        "left_out_hz": tuple(float(hz) for hz in arrays.get("left_out_hz", ())),
        "areas": {
            str(name): Attached(int(modes), float(error))
            for name, modes, error in zip(
                *(arrays.get(key, ()) for key in ("areas", "attachment_modes", "static_errors")),
                strict=True,
            )
        },
        **{name: arrays[name] for name in OPTIONAL if name in arrays},
    }


def positive(name: str, values: ArrayLike) -> FloatArray:
    """Finite numbers that are not negative, or a ReductionError that names them."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ReductionError(f"{name} must hold numbers only") from None
    if not np.all(np.isfinite(array)) or np.any(array < 0.0):
        raise ReductionError(f"{name} must be finite and not negative, not {array}")
    return array


def read_only(array: ArrayLike) -> FloatArray:
    """A copy as floats that cannot be written to."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy
