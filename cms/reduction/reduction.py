"""Reduce a component: free-interface and fixed-interface methods."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.base.threads import one_thread
from cms.component.component import (
    ComponentLike,
    Matrices,
    Pencil,
    checked_pencil,
    symmetric_matrix,
    times,
)
from cms.reduction.area import Area
from cms.reduction.boundary import (
    massless_boundary,
    massless_names,
    told_of_massless,
    with_flexibility,
)
from cms.reduction.condensed import condensed
from cms.reduction.constraint import fixed_interface, fixed_interface_errors
from cms.reduction.doubt import check_doubtful_digits
from cms.reduction.model import ReducedModel
from cms.reduction.residual import residual_flexibility, residual_modes
from cms.reduction.seen import (
    NEGLIGIBLE_PARTICIPATION,
    couples,
    lowest_seen_modes,
    told_of_seen,
)
from cms.solvers.eigen import (
    SUMMED,
    Modes,
    Shifted,
    fastest_square,
    lowest_modes,
    mode_errors,
    modes_up_to,
    ritz,
    shifted_factor,
    without_offsets,
)
from cms.solvers.factor import Progress, announce, announced

METHODS = (
    "rubin",
    "craig-chang",
    "macneal",
    "dual-craig-bampton",
    "craig-bampton",
    "guyan",
    "truncation",
)
FIXED = ("craig-bampton", "guyan")
MASS_ERROR = 1e-7
LARGEST = 1e-6  # relative difference of entries that both count as a mode's largest


def reduce(
    component: ComponentLike,
    *,
    modes: int | None = None,
    cutoff_hz: float | None = None,
    method: str = "rubin",
    residual: bool = True,
    unseen: bool = False,
    areas: Mapping[str, Area] | None = None,
    massless: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> ReducedModel:
    r"""Reduce a component by component mode synthesis.

    Parameters
    ----------
    component : ComponentLike
        Any object with ``stiffness``, ``mass`` (N, N) and ``interfaces`` {name: (N,)}; where it has
        a ``damping`` (N, N), too, its projection is the model's ``damping``.
    modes : int, optional
        Number of component modes to keep, 0 to N: the lowest that an interface or a load vector
        sees. Of a floating component the rigid-body modes count. Not for "guyan", which keeps none.
    cutoff_hz : float, optional
        Keep the modes up to this frequency in Hz, instead of ``modes``. Below the first
        frequency no mode is kept, which leaves the interfaces' modes alone: a static model.
    method : str
        ======================  ============================================================
        "rubin"                 free-interface modes, and one residual flexibility mode per
                                interface with its mass [1]_ [2]_
        "craig-chang"           the same; where the component floats, its attachment modes are
                                those of inertia relief [3]_ (of "rubin", too)
        "macneal"               the same without the mass of the residual modes [1]_
        "dual-craig-bampton"    as "rubin"; `cms.couple` joins such models by interface forces
                                [5]_
        "craig-bampton"         fixed-interface modes and constraint modes [4]_
        "guyan"                 constraint modes alone [6]_
        "truncation"            free-interface modes alone
        ======================  ============================================================
    residual : bool
        False is short for ``method="truncation"``.
    unseen : bool
        Whether modes that no interface sees are kept and counted, too: for matrices beside these
        that couple modes, as a gyroscopic one. The component's own ``damping`` is looked at: where
        it couples the modes left out with the others, all are kept.
    areas : mapping of str to Area
        Interfaces that are points of areas of contact: they share as few attachment modes as the
        static deflection needs, told in the model's ``areas``; the component's own ``areas`` unless
        given. For "rubin" and "craig-chang"; by fixed-interface methods each point has its own.
    massless : sequence of str, optional
        Of "macneal": the interfaces, or areas for all of their points, whose residual modes have no
        mass, all unless given; the others have theirs as by "rubin". A rigid or linear stop of
        `nldyn` at such a massless boundary converges with the modes [7]_; loads act on interfaces
        with mass.
    progress : callable, optional
        Called as ``progress(text)`` with what is to be done, how much memory it needs, and which
        solver does it.

    Returns
    -------
    ReducedModel
        A mode's sign is such that its participation at the first interface that it moves is
        positive.

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
    .. [4] Craig, R.R. and Bampton, M.C.C. (1968) Coupling of substructures for dynamic analyses.
       AIAA Journal 6(7), 1313-1319.
    .. [5] Rixen, D.J. (2004) A dual Craig-Bampton method for dynamic substructuring. Journal of
       Computational and Applied Mathematics 168, 383-391.
    .. [6] Guyan, R.J. (1965) Reduction of stiffness and mass matrices. AIAA Journal 3(2), 380.
    .. [7] Monjaraz-Tec, C., Gross, J. and Krack, M. (2022) A massless boundary component mode
       synthesis method for elastodynamic contact problems. Computers & Structures 260, 106698.

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
    >>> static = cms.reduce(chain, method="guyan")
    >>> static.size, bool(np.isclose(static.static_flexibility("first"), n / (n + 1), rtol=1e-12))
    (1, True)
    """
    method = chosen_method(method, residual)
    if method == "guyan":
        if cutoff_hz is not None or modes not in (None, 0):
            raise ReductionError("method 'guyan' keeps no modes; give neither modes nor cutoff_hz")
        modes = 0
    check_request(modes, cutoff_hz)
    pencil = checked_pencil(component)
    check_count(modes, method, pencil)
    shared = getattr(component, "areas", {}) if areas is None else areas
    if massless is not None:
        massless = massless_names(massless, method, pencil.names, shared)
        shared = {name: area for name, area in shared.items() if area.points[0] not in massless}
    if method in FIXED and not pencil.names:
        raise ReductionError(f"method '{method}' needs an interface, and the component has none")
    free = partial(reduced_free, areas=shared, massless=massless)
    with announced(progress), one_thread():
        check_doubtful_digits(component, pencil)
        try:
            by_method = reduced_fixed if method in FIXED else free
            reduced, left_out = by_method(pencil, modes, cutoff_hz, method, unseen)
            if couples(getattr(component, "damping", None), reduced.basis, left_out):
                reduced, _ = by_method(pencil, modes, cutoff_hz, method, True)
        except np.linalg.LinAlgError as error:
            reason = str(error).rstrip(".")
            raise ReductionError(
                "the modes cannot be computed, as the entries of the stiffness or of the mass "
                f"differ too much in size ({reason})"
            ) from error
    check_masses(pencil, reduced)
    with announced(progress):
        reduced = with_component_damping(told(reduced, pencil, modes), component)
    return replace(reduced, load_vectors=tuple(getattr(component, "load_vectors", ())))


def told(reduced: ReducedModel, pencil: Pencil, asked: int | None) -> ReducedModel:
    """The model with the bound of its rigid-body modes; says that, and which modes are unseen."""
    if reduced.unseen_modes:
        numbers = ", ".join(map(str, reduced.unseen_modes))
        announce(f"kept modes that move no interface: {numbers}")
    for sentence in (*told_of_seen(reduced, asked), *told_of_massless(reduced)):
        announce(sentence)
    rigid = reduced.basis[:, reduced.frequencies_hz == 0.0]
    if pencil.digits is None or not rigid.shape[1]:
        return reduced
    bound = float(np.sqrt(np.max(pencil.undetermined(rigid, SUMMED)))) / (2.0 * np.pi)
    announce(
        f"{counted(rigid.shape[1])}: zero within the {pencil.digits} digits of the stiffness, "
        f"which leave {bound:.3g} Hz undetermined"
    )
    return replace(reduced, rigid_bound_hz=bound)


def check_masses(pencil: Pencil, reduced: ReducedModel) -> None:
    """Raise ReductionError where modes do not have unit masses or are not orthogonal."""
    V = reduced.basis
    error = np.abs(V.T @ times(pencil.mass, V) - np.eye(reduced.size))
    if not error.max(initial=0.0) <= MASS_ERROR:
        mode, other = np.unravel_index(int(np.argmax(error)), error.shape)
        raise ReductionError(
            f"the masses of modes {mode + 1} and {other + 1} by '{reduced.method}' are wrong by "
            f"{error[mode, other]:.1e}: the mass matrix is too near to a singular one"
        )


def chosen_method(method: str, residual: bool) -> str:
    """The name of the method, or ReductionError where there is none of that name."""
    if method not in METHODS:
        raise ReductionError(f"there is no method '{method}' (there are: {', '.join(METHODS)})")
    if residual:
        return method
    if method not in ("rubin", "truncation"):
        raise ReductionError(f"residual=False is method 'truncation', not '{method}'")
    return "truncation"


def reduced_free(
    pencil: Pencil,
    modes: int | None,
    cutoff_hz: float | None,
    method: str,
    unseen: bool,
    areas: Mapping[str, Area],
    massless: Sequence[str] | None,
) -> tuple[ReducedModel, FloatArray]:
    """Free-interface modes with what the method adds to them, and the modes left out (N, k)."""
    shifted = shifted_factor(pencil)
    pencil = without_offsets(pencil, shifted)
    if method != "truncation":
        check_rigid_kept(modes, shifted)
    kept, left_out = kept_modes(pencil, shifted, modes, cutoff_hz, unseen, pencil.loads)
    model = with_residuals(pencil, shifted, kept, cutoff_hz, method, areas, massless)
    return replace(model, left_out_hz=in_hz(left_out)), left_out.vectors


def with_residuals(
    pencil: Pencil,
    shifted: Shifted,
    kept: Modes,
    cutoff_hz: float | None,
    method: str,
    areas: Mapping[str, Area],
    massless: Sequence[str] | None,
) -> ReducedModel:
    """The model of the kept modes and what a free-interface method adds to them."""
    if method == "truncation":
        if kept.squares.size == 0:
            raise ReductionError(nothing_kept(cutoff_hz))
        return assembled(pencil, kept, 0, method)
    if method == "macneal" and massless is None:
        if kept.squares.size == 0:
            raise ReductionError(
                "method 'macneal' needs at least one mode: what it adds is massless"
            )
        shapes = residual_flexibility(pencil, shifted, kept.vectors)
        return with_flexibility(assembled(pencil, kept, 0, method), pencil, shapes)
    massive = [name for name in pencil.names if name not in (massless or ())]
    extra = residual_modes(pencil, shifted, kept.vectors, areas, massive)
    if kept.squares.size + extra.squares.size == 0:
        raise ReductionError(nothing_kept(cutoff_hz))
    errors = mode_errors(pencil, shifted, extra.squares, extra.vectors)
    added = Modes(extra.squares, extra.vectors, errors)
    whole = replace(assembled(pencil, kept, extra.dropped, method, added), areas=extra.attached)
    if massless:
        shapes = massless_boundary(pencil, shifted, kept.vectors, extra, massless)
        return with_flexibility(whole, pencil, shapes)
    if not extra.massless.shape[1]:
        return whole
    return with_flexibility(whole, pencil, extra.massless @ (extra.massless.T @ pencil.loads))


def reduced_fixed(
    pencil: Pencil, modes: int | None, cutoff_hz: float | None, method: str, unseen: bool
) -> tuple[ReducedModel, FloatArray]:
    """Constraint and fixed-interface modes, diagonalised, and the modes left out (N, k)."""
    parts = condensed(pencil)
    if parts is not None:
        model, out = reduced_fixed(parts.pencil, modes, cutoff_hz, method, unseen)
        return parts.expanded(model), parts.shapes @ out
    fixed = fixed_interface(pencil)
    inner = fixed.interior
    if modes is not None and modes > inner.size:
        raise ReductionError(
            f"modes = {modes}, but with its interfaces held the component has only {inner.size} "
            f"degrees of freedom{'' if pencil.origin is None else ' that have mass'}"
        )
    if modes is not None and modes < fixed.shifted.rigid and method != "guyan":
        raise ReductionError(
            f"modes = {modes}, but with its interfaces held the component still floats: its "
            f"{counted(fixed.shifted.rigid)} must be kept"
        )
    if method == "guyan" and fixed.shifted.rigid:
        raise ReductionError(
            "method 'guyan' needs interfaces that hold the component: with them held "
            f"{counted(fixed.shifted.rigid)} are left; use 'craig-bampton'"
        )
    pull = fixed.inertia_of_constraint_modes()
    kept, left_out = kept_modes(inner, fixed.shifted, modes, cutoff_hz, unseen, pull)
    basis = np.hstack([fixed.expanded(kept.vectors), fixed.constraint_modes])
    squares, vectors = ritz(basis, pencil, fastest_square(pencil))
    errors = fixed_interface_errors(fixed, squares, vectors)
    whole = assembled(pencil, Modes(squares, vectors, errors), fixed.dropped, method)
    whole = replace(whole, modes=int(kept.squares.size), left_out_hz=in_hz(left_out))
    return whole, fixed.expanded(left_out.vectors)


def keep_modes(reduced: ReducedModel, numbers: Sequence[int]) -> ReducedModel:
    """The model with fewer modes, as if the component had been reduced to these.

    Parameters
    ----------
    reduced : ReducedModel
        A model by "rubin", "craig-chang" or "dual-craig-bampton".
    numbers : sequence of int
        Numbers of the component modes to keep, from 1; rigid-body modes must be among them.

    Returns
    -------
    ReducedModel
        With its residual modes; nothing is computed on the component, because the static
        solutions are combinations of the larger model's modes.

    Raises
    ------
    ReductionError
        For a number that there is not, or a model by another method.

    Examples
    --------
    >>> import numpy as np, cms
    >>> n = 30
    >>> K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    >>> chain = cms.Matrices(K, np.eye(n), {"first": np.eye(n)[0]})
    >>> fewer = cms.keep_modes(cms.reduce(chain, modes=8), [1, 2])
    >>> bool(np.allclose(fewer.frequencies_hz, cms.reduce(chain, modes=2).frequencies_hz))
    True
    """
    if reduced.method not in ("rubin", "craig-chang", "dual-craig-bampton") or reduced.components:
        raise ReductionError(
            f"modes of a model by '{reduced.method}' cannot be left out afterwards"
        )
    wanted = sorted(set(numbers))
    if any(not 1 <= number <= reduced.modes for number in wanted):
        raise ReductionError(f"modes {wanted} are not all between 1 and {reduced.modes}")
    chosen = np.array(wanted, dtype=np.intp) - 1
    squares = (2.0 * np.pi * reduced.frequencies_hz) ** 2
    rigid = np.flatnonzero(squares[: reduced.modes] == 0.0)
    if not set(rigid) <= set(chosen):
        raise ReductionError(f"the {counted(rigid.size)} must be kept")
    pencil = checked_pencil(Matrices(np.diag(squares), np.eye(reduced.size), reduced.participation))
    kept = Modes(squares[chosen], np.eye(reduced.size)[:, chosen], reduced.residuals[chosen])
    extra = residual_modes(pencil, shifted_factor(pencil), kept.vectors)
    if kept.squares.size + extra.squares.size == 0:
        raise ReductionError("nothing is left of the model")
    added = Modes(extra.squares, extra.vectors, np.full(extra.squares.size, np.inf))
    small = assembled(pencil, kept, extra.dropped, reduced.method, added)
    damping = reduced.damping
    return replace(
        small,
        basis=reduced.basis @ small.basis,
        damping=None if damping is None else small.basis.T @ damping @ small.basis,
    )


def with_component_damping(reduced: ReducedModel, component: ComponentLike) -> ReducedModel:
    """The model with the component's damping matrix projected on its basis, if there is one."""
    given = getattr(component, "damping", None)
    if given is None:
        return reduced
    damping = symmetric_matrix(given, "damping")
    if damping.shape[0] != reduced.basis.shape[0]:
        raise ReductionError(
            f"the damping matrix has shape {damping.shape}, but the component has "
            f"{reduced.basis.shape[0]} degrees of freedom"
        )
    if reduced.has_massless_part:
        raise ReductionError(
            f"a model by '{reduced.method}' with a massless part has no exact form of a damping "
            "matrix: use 'rubin', or 'with_damping' for modal damping"
        )
    return replace(reduced, damping=reduced.basis.T @ times(damping, reduced.basis))


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


def check_count(modes: int | None, method: str, pencil: Pencil) -> None:
    """Raise ReductionError where the component cannot give what is asked for."""
    if modes is not None and modes > pencil.size:
        raise ReductionError(
            f"modes = {modes}, but the component has only {pencil.size} degrees of freedom"
        )
    if modes == 0 and method == "truncation":
        raise ReductionError("modes = 0 without residual modes leaves nothing of the component")
    if modes == 0 and not pencil.names:
        raise ReductionError("modes = 0, and the component has no interface for a residual mode")


def nothing_kept(cutoff_hz: float | None) -> str:
    """The sentence for an empty reduced model."""
    return f"no mode of the component lies below cutoff_hz = {cutoff_hz}, so nothing is left of it"


def kept_modes(
    pencil: Pencil,
    shifted: Shifted,
    modes: int | None,
    cutoff_hz: float | None,
    unseen: bool,
    loads: FloatArray,
) -> tuple[Modes, Modes]:
    """The modes up to the count or the cut-off frequency, and those that no load moves."""
    if modes is not None and not unseen:
        return lowest_seen_modes(pencil, shifted, operator.index(modes), loads)
    none = Modes(np.zeros(0), np.zeros((pencil.size, 0)), np.zeros(0))
    if modes is not None:
        return lowest_modes(pencil, shifted, operator.index(modes)), none
    assert cutoff_hz is not None
    return modes_up_to(pencil, shifted, (2.0 * np.pi * float(cutoff_hz)) ** 2), none


def in_hz(modes: Modes) -> tuple[float, ...]:
    """The frequencies of modes in Hz."""
    return tuple((np.sqrt(modes.squares) / (2.0 * np.pi)).tolist())


def check_rigid_kept(modes: int | None, shifted: Shifted) -> None:
    """Raise ReductionError where fewer modes are asked for than there are rigid-body modes."""
    if modes is not None and modes < shifted.rigid:
        raise ReductionError(
            f"modes = {modes}, but the component floats: its {counted(shifted.rigid)} must be kept"
        )


def counted(rigid: int) -> str:
    """How many rigid-body modes there are, in words."""
    return f"{rigid} rigid-body mode{'s' if rigid > 1 else ''}"


def assembled(
    pencil: Pencil, kept: Modes, dropped: int, method: str, extra: Modes | None = None
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
        method=method,
    )


def signed(vectors: FloatArray, loads: FloatArray) -> FloatArray:
    """The modes with their signs fixed by the first interface that each of them moves.

    A mode that moves no interface gets a positive largest entry (the first of equal ones).
    """
    rows = loads.T @ vectors
    size = np.linalg.norm(loads, axis=0)[:, None] * np.linalg.norm(vectors, axis=0)
    peak = np.max(np.abs(vectors), axis=0)
    largest = np.argmax(np.abs(vectors) > (1.0 - LARGEST) * peak, axis=0)
    signs = np.sign(np.take_along_axis(vectors, largest[None, :], axis=0)[0])
    for row, scale in zip(rows[::-1], size[::-1], strict=True):
        signs = np.where(np.abs(row) > NEGLIGIBLE_PARTICIPATION * scale, np.sign(row), signs)
    return np.asarray(vectors * signs)
