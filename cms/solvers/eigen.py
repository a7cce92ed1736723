"""Lowest modes of K phi = w^2 M phi, each with a bound on its error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from cms.base.arrays import FloatArray, SparseMatrix
from cms.base.errors import ReductionError
from cms.component.component import Pencil, times
from cms.component.massless import statically_split
from cms.solvers.factor import DENSE_LIMIT, SUSPECT_PIVOT, Factor, factorise

EPS = float(np.finfo(np.float64).eps)
RIGID_TOLERANCE = 64 * EPS
SUMMED = 64 * EPS  # relative error of an entry that double precision sums and factorises
SHIFT_OVER_ROUNDING = 32.0
CLEAR = 0.25  # of the rounding: w^2 above it is too large for a zero, too small for a frequency
APART = 16.0  # w^2 of the first elastic mode over the rounding
MOSTLY = 0.99  # a row whose unit vector lies in the massless directions to so much has no mass
ERROR_TOLERANCE = 1e-8
LARGEST_ERROR = 1e-3
GUARD_MODES = 2
BLOCK = 4  # finds modes of one frequency, and takes a quarter of the passes over the factor
DEPENDENT = 1e-12
MOST_REFINEMENTS = 8
REFINED = 1e-12  # bound of the error of w^2, which after a step is about its square
DENSE_AT_MOST = 6000
LOOK_ALWAYS = 200  # up to this many vectors it costs little to see after each block what converged
LOOK_AGAIN = 1.15  # beyond, after the basis has grown by so much
MASSLESS = 1e-12  # of the largest 1/(ω² + shift): a direction without mass
CONVERGED = 1e-12  # relative residual of an eigenvalue that is found
EXACT = 1e-6  # of the largest 1/(ω² + shift): all above it are found to enough digits


@dataclass(frozen=True, eq=False)
class Shifted:
    """K + shift M, factorised.

    Attributes
    ----------
    factor : Factor
        Of K + shift M.
    shift : float
        In rad^2/s^2; zero unless the component floats.
    fastest : float
        Lower bound of the largest w^2, the scale of rounding.
    rigid_modes : (N, n) array
        The mass-normalised rigid-body modes; none if the component is held.
    """

    factor: Factor
    shift: float
    fastest: float
    rigid_modes: FloatArray

    @property
    def rigid(self) -> int:
        """Number of rigid-body modes."""
        return int(self.rigid_modes.shape[1])


@dataclass(frozen=True, eq=False)
class Modes:
    """Mass-normalised modes (N, k), their w^2 (k,) and a relative error bound for each (k,)."""

    squares: FloatArray
    vectors: FloatArray
    errors: FloatArray


def fastest_square(pencil: Pencil) -> float:
    """Largest K_ii / M_ii: a lower bound of the largest w^2 and the scale of its rounding."""
    mass = pencil.mass.diagonal()
    heavy = mass > 0.0
    if pencil.massless.shape[1]:
        turn, _ = linalg.qr(pencil.massless * np.sqrt(mass + ~heavy)[:, None], mode="economic")
        heavy &= np.sum(turn**2, axis=1) < MOSTLY
    if not np.any(heavy):
        raise ReductionError("the mass matrix has no positive diagonal entry")
    return float(np.max(pencil.stiffness.diagonal()[heavy] / mass[heavy]))


def shifted_factor(pencil: Pencil) -> Shifted:
    """Factorise K, or K plus a small multiple of M where the component floats.

    A pivot or an eigenvalue at rounding level makes K suspect; whether it is singular is then
    decided by the lowest frequencies of the shifted problem.

    Raises
    ------
    ReductionError
        If even the shifted matrix is not positive definite.
    """
    fastest = fastest_square(pencil)
    # the natural form keeps what the entries of K have lost: there the pivots alone are asked
    factor = factorise(pencil.stiffness, *([] if pencil.natural is None else [0.0]))
    none = np.zeros((pencil.size, 0))
    if factor is not None and not factor.suspect and not pencil.rounding:
        return Shifted(factor, 0.0, fastest, none)
    shift = shift_over_rounding(pencil, fastest)
    moved = factorise(pencil.stiffness + shift * pencil.mass)
    if moved is None:
        raise ReductionError(
            "the stiffness or the mass matrix is indefinite (as beyond a buckling load), or a dof "
            f"has neither: K + {shift:.3g} M is not positive definite"
        )
    shifted = Shifted(moved, shift, fastest, none)
    few = modes_up_to(pencil, shifted, 0.0)
    if few.squares.size == 0 and factor is not None:
        return Shifted(factor, 0.0, fastest, none)
    return replace(shifted, rigid_modes=few.vectors)


def shift_over_rounding(pencil: Pencil, fastest: float) -> float:
    """A shift in rad^2/s^2 that makes K + s M positive, whatever rounding has left of zero."""
    rounding = max(np.sqrt(EPS), SHIFT_OVER_ROUNDING * pencil.rounding)
    return float(rounding * (fastest if fastest > 0.0 else 1.0))


def without_offsets(pencil: Pencil, shifted: Shifted) -> Pencil:
    """The pencil in which nothing holds the rigid-body modes, not even rounding.

    With rigid-body modes R of w^2 = o, ``K - M R diag(o) R^T M`` has the same modes as K, and the
    same frequencies but for those, which are zero.
    """
    rigid = shifted.rigid_modes
    if pencil.natural is not None or not rigid.shape[1]:
        return pencil
    inertia = times(pencil.mass, rigid)
    offset = np.sum(rigid * times(pencil.stiffness, rigid), axis=0)
    return replace(pencil, inertia=inertia, offset=offset)


def rigid_rounding(pencil: Pencil, vectors: FloatArray, fastest: float) -> FloatArray:
    """Largest |w^2| (k,) that the rounding of K alone may give mass-normalised modes (N, k)."""
    if pencil.natural is not None:
        return np.full(vectors.shape[1], RIGID_TOLERANCE * fastest)
    return pencil.undetermined(vectors, SUMMED)


def zeroed(squares: FloatArray, rounding: FloatArray, pencil: Pencil) -> FloatArray:
    """The w^2, ascending, with those of the first modes zero that are so but for rounding.

    Raises
    ------
    ReductionError
        If few digits leave it open which modes these are: a mode lies just within the rounding, or
        the rounding is a sixteenth of the next w^2 or more.
    """
    inside = np.abs(squares) <= rounding
    count = inside.size if np.all(inside) else int(np.argmin(inside))
    if count and pencil.digits is not None:
        bound = float(np.max(rounding[:count]))
        following = float(squares[count]) if count < squares.size else np.inf
        if np.max(squares[:count]) > CLEAR * bound or bound * APART > following:
            raise ReductionError(undecided(squares[: count + 1], bound, pencil.digits))
    return np.where(np.arange(squares.size) < count, 0.0, squares)


def undecided(squares: FloatArray, bound: float, digits: int) -> str:
    """The sentence for modes of which few digits leave open whether they are rigid."""
    listed = ", ".join(f"{np.sqrt(max(square, 0.0)) / (2 * np.pi):.4g}" for square in squares)
    return (
        f"the {digits} digits of the stiffness leave open which modes are rigid-body modes: they "
        f"may move one of 0 Hz to {np.sqrt(bound) / (2 * np.pi):.3g} Hz, and the lowest lie at "
        f"{listed} Hz; give more digits, or state digits = 17 if the entries are exact"
    )


def lowest_modes(pencil: Pencil, shifted: Shifted, count: int) -> Modes:
    """The ``count`` modes of lowest frequency.

    Parameters
    ----------
    pencil : Pencil
        K and M, (N, N).
    shifted : Shifted
        The factorised K + shift M.
    count : int
        How many; 0 gives empty arrays.

    Returns
    -------
    Modes
        Ascending; where the component floats, frequencies at rounding level are set to exactly
        zero (rigid-body modes).

    Raises
    ------
    ReductionError
        If the eigen-solver does not converge or a mode fails its residual check.

    Notes
    -----
    The inverse problem ``M phi = nu (K + s M) phi`` is solved, because the largest ``nu`` are the
    lowest frequencies and come out to full relative accuracy. Dense LAPACK up to 1500 degrees of
    freedom, above that `lanczos_modes` with the sparse factorisation.
    """
    if count == 0:
        return Modes(np.zeros(0), np.zeros((pencil.size, 0)), np.zeros(0))
    if pencil.size <= DENSE_LIMIT or count > pencil.size // 4:
        squares, vectors = dense_modes(pencil, shifted, count)
    else:
        squares, vectors = lanczos_modes(pencil, shifted, count)
    vectors = mass_orthonormal(vectors, pencil.mass)
    if shifted.shift > 0.0:
        if pencil.natural is None and shifted.rigid:
            squares = np.where(np.arange(squares.size) < shifted.rigid, 0.0, squares)
        else:
            rounding = rigid_rounding(pencil, vectors, shifted.fastest)
            squares = zeroed(squares, rounding + RIGID_TOLERANCE * shifted.shift, pencil)
    check_stable(pencil, squares, vectors, shifted.fastest)
    if not shifted.rigid and squares[0] == 0.0:
        rigid = replace(shifted, rigid_modes=vectors[:, squares == 0.0])
        pencil = without_offsets(pencil, rigid)
    modes = refined(pencil, shifted, squares, vectors)
    check_errors(modes.errors, modes.squares, shifted, neglected_mass(pencil, shifted, modes))
    return modes


def neglected_mass(pencil: Pencil, shifted: Shifted, modes: Modes) -> FloatArray:
    r"""What `mode_errors` (k,) owes to mass in massless directions, which is rounding.

    The directions V, ``V^T (K + s M) V = I``, follow the modes statically, so that of the residual
    :math:`V^T r = -(\omega^2 + s) V^T M \phi` is left.
    """
    if not pencil.massless.shape[1]:
        return np.zeros_like(modes.squares)
    massless, _ = statically_split(shifted.factor.matrix, pencil.massless)
    coupling = np.linalg.norm(massless.T @ times(pencil.mass, modes.vectors), axis=0)
    return np.asarray(np.sqrt(modes.squares + shifted.shift) * coupling)


def check_stable(pencil: Pencil, squares: FloatArray, vectors: FloatArray, fastest: float) -> None:
    """Raise ReductionError where the lowest w^2, ascending, is negative."""
    if squares.size == 0 or squares[0] >= 0.0:
        return
    rounding = float(rigid_rounding(pencil, vectors[:, :1], fastest)[0])
    raise ReductionError(
        "the stiffness matrix is not positive, as of a structure beyond its buckling load: its "
        f"lowest w^2 is {squares[0]:.3g} rad^2/s^2, and the rounding of its entries explains "
        f"{rounding:.1g}; if it floats, state how many digits the entries have (digits = ...)"
    )


def modes_up_to(pencil: Pencil, shifted: Shifted, cutoff: float) -> Modes:
    """All modes with w^2 (rad^2/s^2) not above ``cutoff``; see :func:`lowest_modes`."""
    most = pencil.size - pencil.massless.shape[1]
    count = min(8, most)
    while True:
        modes = lowest_modes(pencil, shifted, count)
        if modes.squares[-1] > cutoff or count == most:
            return first_modes(modes, int(np.searchsorted(modes.squares, cutoff, side="right")))
        count = min(2 * count, most)


def first_modes(modes: Modes, count: int) -> Modes:
    """The first ``count`` of some modes."""
    return Modes(modes.squares[:count], modes.vectors[:, :count], modes.errors[:count])


def dense_modes(pencil: Pencil, shifted: Shifted, count: int) -> tuple[FloatArray, FloatArray]:
    """w^2 (k,) and modes (N, k) by LAPACK."""
    size = pencil.size
    if size > DENSE_AT_MOST:
        raise ReductionError(
            f"{count} modes are more than a quarter of the component's {size} degrees of "
            f"freedom, which is done only up to {DENSE_AT_MOST} degrees of freedom"
        )
    if pencil.massless.shape[1]:
        return massive_modes(pencil, shifted, count)
    if size > DENSE_LIMIT and factorise(pencil.mass) is not None:
        return direct_modes(pencil, shifted, count)
    mass, matrix = pencil.mass.toarray(), shifted.factor.matrix.toarray()
    nu, vectors = linalg.eigh(mass, matrix, subset_by_index=[size - count, size - 1])
    nu, vectors = nu[::-1], vectors[:, ::-1]
    positive = nu > size * EPS * nu[0]
    if np.all(positive) and nu[-1] > EXACT * nu[0]:
        return 1.0 / nu - shifted.shift, vectors / np.sqrt(nu)
    if factorise(pencil.mass) is None:
        massive = nu > MASSLESS * nu[0]
        if not np.all(massive):
            raise ReductionError(
                f"{count} modes are asked for, but only {np.count_nonzero(massive)} have mass"
            )
        return 1.0 / nu - shifted.shift, vectors / np.sqrt(nu)
    return with_fast_modes(pencil, shifted, nu, vectors)


def massive_modes(pencil: Pencil, shifted: Shifted, count: int) -> tuple[FloatArray, FloatArray]:
    """w^2 (k,) and modes (N, k) where directions without mass follow the others statically."""
    if count > pencil.size - pencil.massless.shape[1]:
        raise ReductionError(
            f"{count} modes are asked for, but only {pencil.size - pencil.massless.shape[1]} "
            "have mass"
        )
    _, massive = statically_split(shifted.factor.matrix, pencil.massless)
    energy = massive.T @ times(shifted.factor.matrix, massive)
    mass = massive.T @ times(pencil.mass, massive)
    squares, directions = dense_pair(energy, mass)
    order = np.argsort(squares, kind="stable")[:count]
    return squares[order] - shifted.shift, massive @ directions[:, order]


def dense_pair(stiffness: FloatArray, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All w^2 (n,) ascending and mass-normalised modes (n, n) of two positive definite matrices.

    Slow ones come from the inverse problem, fast ones from the direct one.
    """
    K, M = (stiffness + stiffness.T) / 2, (mass + mass.T) / 2
    direct, direct_directions = linalg.eigh(K, M)
    nu, directions = linalg.eigh(M, K)
    nu, directions = np.maximum(nu[::-1], EPS * nu[-1]), directions[:, ::-1]
    slow = direct <= np.sqrt(1.0 / (nu[0] * nu[-1]))
    squares = np.where(slow, 1.0 / nu, direct)
    return squares, np.where(slow, directions / np.sqrt(nu), direct_directions)


def with_fast_modes(
    pencil: Pencil, shifted: Shifted, nu: FloatArray, vectors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Take the fast modes from the direct problem, whose rounding error is small there.

    The inverse problem has the relative error eps w_i^2 / w_1^2, the direct one
    eps w_n^2 / w_i^2; they cross at the geometric mean.
    """
    count = nu.size
    direct, direct_vectors = linalg.eigh(
        pencil.stiffness.toarray(), pencil.mass.toarray(), subset_by_index=[0, count - 1]
    )
    slowest = 1.0 / nu[0]
    crossing = np.sqrt(slowest * shifted.fastest)
    slow = direct + shifted.shift <= crossing
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = np.where(slow, 1.0 / nu - shifted.shift, direct)
        modes = np.where(slow, vectors / np.sqrt(np.abs(nu)), direct_vectors)
    return squares, modes


def direct_modes(pencil: Pencil, shifted: Shifted, count: int) -> tuple[FloatArray, FloatArray]:
    """w^2 (k,) and modes (N, k) by one dense problem, the direct one.

    Its slow modes lack digits. One step of inverse iteration removes what they have of fast ones,
    and the inverse problem projected on them gives them anew.
    """
    squares, vectors = linalg.eigh(
        pencil.stiffness.toarray(), pencil.mass.toarray(), subset_by_index=[0, count - 1]
    )
    slowest = max(squares[0] + shifted.shift, EPS * shifted.fastest)
    slow = squares + shifted.shift <= np.sqrt(slowest * shifted.fastest)
    weighted = times(pencil.mass, vectors[:, slow])
    image = shifted.factor.solve(weighted)
    energy = image.T @ weighted
    nu, turn = linalg.eigh(image.T @ times(pencil.mass, image), (energy + energy.T) / 2)
    squares[slow] = 1.0 / nu[::-1] - shifted.shift
    vectors[:, slow] = image @ (turn / np.sqrt(nu))[:, ::-1]
    order = np.argsort(squares, kind="stable")
    return squares[order], vectors[:, order]


def lanczos_modes(pencil: Pencil, shifted: Shifted, count: int) -> tuple[FloatArray, FloatArray]:
    """w^2 (k,) and modes (N, k) by block Lanczos for (K + s M)^-1 M, without restarts.

    Each step is one solution with several right sides, which takes little longer than with one. A
    mode has converged when what its image has outside of the basis is 1e-12 of it, or at the
    rounding of the slowest mode. All blocks are kept orthogonal to each other (Golub and Van Loan
    2013, *Matrix Computations*, 4th ed., section 10.3.6).
    """
    size, mass = pencil.size, pencil.mass
    wanted = min(count + GUARD_MODES, size - 1)
    start = np.random.default_rng(0).standard_normal((size, min(BLOCK, size)))
    room, used, looked = np.empty((size, 0), order="F"), 0, 0
    projected = np.zeros((0, 0))
    image = shifted.factor.solve(times(mass, start))
    weighted = times(mass, image)
    while True:
        fresh, heavy, outside = next_block(room[:, :used], image, weighted, mass)
        if used and (used < LOOK_ALWAYS or used >= LOOK_AGAIN * looked or not fresh.shape[1]):
            looked = used
            nu, turn = linalg.eigh(projected)
            nu, turn = nu[::-1][:wanted], turn[:, ::-1][:, :wanted]
            left = np.linalg.norm(outside @ turn[-outside.shape[1] :], axis=0)
            converged = left <= np.maximum(CONVERGED * nu, 10 * EPS * nu[0])
            if fresh.shape[1] == 0 or (nu.size == wanted and np.all(converged)):
                break
        if used + fresh.shape[1] > room.shape[1]:
            larger = np.empty((size, 2 * used + 8 * BLOCK), order="F")
            larger[:, :used] = room[:, :used]
            room = larger
        room[:, used : used + fresh.shape[1]] = fresh
        used += fresh.shape[1]
        image = shifted.factor.solve(heavy)
        weighted = times(mass, image)
        columns = room[:, :used].T @ weighted
        corner = columns[-fresh.shape[1] :]
        above = columns[: -fresh.shape[1]]
        projected = np.block([[projected, above], [above.T, (corner + corner.T) / 2]])
    if nu.size < count or nu[count - 1] <= 0.0:
        raise ReductionError(f"only {np.count_nonzero(nu > 0.0)} of {count} modes have mass")
    return 1.0 / nu[:count] - shifted.shift, room[:, :used] @ turn[:, :count]


def next_block(
    basis: FloatArray, image: FloatArray, weighted: FloatArray, mass: SparseMatrix
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What ``image`` (N, b) adds to a mass-orthonormal basis (N, m), and its coordinates there.

    Directions at rounding level of the image are left out. ``weighted`` is M times the image; the
    second result is M times the first.
    """
    size = np.sqrt(np.maximum(np.sum(image * weighted, axis=0), 0.0))
    for _ in range(2):
        image = image - basis @ (basis.T @ weighted)
        weighted = times(mass, image)
    norms = np.sqrt(np.maximum(np.sum(image * weighted, axis=0), 0.0))
    inverse = np.divide(1.0, norms, out=np.zeros_like(norms), where=norms > 10 * EPS * size)
    image, weighted = image * inverse, weighted * inverse
    share, directions = linalg.eigh(image.T @ weighted)
    directions = directions[:, share > DEPENDENT] / np.sqrt(share[share > DEPENDENT])
    fresh = image @ directions
    fresh = fresh - basis @ (basis.T @ (weighted @ directions))
    heavy = times(mass, fresh)
    turn = nearly_orthonormal(fresh.T @ heavy)
    fresh, heavy = fresh @ turn, heavy @ turn
    return fresh, heavy, (heavy.T @ image) * norms


def mass_orthonormal(vectors: FloatArray, mass: SparseMatrix) -> FloatArray:
    """The vectors nearest to those given with ``V^T M V = I`` (one Newton step, symmetric)."""
    return vectors @ nearly_orthonormal(vectors.T @ times(mass, vectors))


def nearly_orthonormal(gram: FloatArray) -> FloatArray:
    """What makes vectors whose products (k, k) are nearly 1 orthonormal to second order."""
    return np.asarray(1.5 * np.eye(gram.shape[0]) - 0.5 * gram)


def refined(pencil: Pencil, shifted: Shifted, squares: FloatArray, vectors: FloatArray) -> Modes:
    """Modes with their errors; where K has a natural form, refined by it.

    The modes of the rounded entries of K take steps ``phi - (K + s M)^-1 (K phi - w^2 M phi)``.
    That is inverse iteration but for what the factor lacks, which costs no digits, as only the
    residual has to be exact. After each step the modes are separated again, and w^2 is Rayleigh's
    quotient.
    """
    modes, worst = None, np.inf
    for _ in range(MOST_REFINEMENTS + 1):
        residual = pencil.forces(vectors) - times(pencil.mass, vectors) * squares
        step = shifted.factor.solve(residual)
        errors = energy_errors(residual, step, squares + shifted.shift)
        before, worst = worst, float(np.max(errors))
        if modes is None or worst < before:
            modes = Modes(squares, vectors, errors)
        if pencil.natural is None or worst <= REFINED or not worst < before / 2:
            break
        squares, vectors = ritz(vectors - step, pencil, shifted.fastest, shifted.shift)
        squares = np.where(squares == 0.0, 0.0, np.diag(pencil.energies(vectors)))
    assert modes is not None
    return modes


def energy_errors(residual: FloatArray, step: FloatArray, squares: FloatArray) -> FloatArray:
    """``sqrt(r^T step / w^2)`` of every mode, see `mode_errors`."""
    energy = np.sum(residual * step, axis=0)
    return np.asarray(np.sqrt(np.abs(energy) / squares))


def ritz(
    basis: FloatArray, pencil: Pencil, fastest: float, shift: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """w^2 (r,) ascending and mass-normalised vectors (N, r) of K and M projected on a basis (N, r).

    Where the projected stiffness is singular, which is found out unless its shift is given (a
    direction whose energy is rounding, or a small pivot), w^2 at rounding level of the fastest w^2
    of the component are exactly zero. Slow modes come from the inverse problem, fast ones from the
    direct one, as in `with_fast_modes`.

    Raises
    ------
    ReductionError
        If a direction of the basis has no mass, or none beside rounding.
    """
    if basis.shape[1] == 0:
        return np.zeros(0), basis
    K, M = pencil.energies(basis), basis.T @ times(pencil.mass, basis)
    M = (M + M.T) / 2
    if shift is None:
        if pencil.natural is None:
            sizes = abs(basis) * times(abs(pencil.stiffness), abs(basis))
            rounding = 8 * EPS * np.sum(sizes, axis=0)
        else:
            rounding = RIGID_TOLERANCE**2 * fastest * np.diag(M)
        held = np.all(np.diag(K) > rounding) and definite(K) and not pencil.rounding
        shift = 0.0 if held else shift_over_rounding(pencil, fastest)
    try:
        direct, direct_directions = linalg.eigh(K, M)
    except linalg.LinAlgError as error:
        raise ReductionError(no_mass(pencil, basis, M)) from error
    nu, directions = linalg.eigh(M, K + shift * M)
    nu, directions = np.maximum(nu[::-1], EPS * nu[-1]), directions[:, ::-1]
    squares, directions = 1.0 / nu - shift, directions / np.sqrt(nu)
    slow = direct + shift <= np.sqrt(1.0 / (nu[0] * nu[-1]))
    squares = np.where(slow, squares, direct)
    directions = np.where(slow, directions, direct_directions)
    vectors = mass_orthonormal(basis @ directions, pencil.mass)
    loose = pencil.natural is None and squares[0] <= rigid_rounding(pencil, vectors, fastest)[0]
    if not shift and loose:
        return ritz(basis, pencil, fastest, shift_over_rounding(pencil, fastest))
    if shift:
        rounding = rigid_rounding(pencil, vectors, fastest)
        squares = zeroed(squares, rounding + RIGID_TOLERANCE * shift, pencil)
    check_stable(pencil, squares, vectors, fastest)
    return squares, vectors


def no_mass(pencil: Pencil, basis: FloatArray, mass: FloatArray) -> str:
    """The sentence for a motion without mass, with the interface that it moves most."""
    diagonal = np.diag(mass)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf))
    scale = np.where(diagonal > 0.0, scale, 1.0)
    motion = basis @ (scale * linalg.eigh(scale[:, None] * mass * scale)[1][:, 0])
    moved = np.abs(pencil.loads.T @ motion) / np.linalg.norm(pencil.loads, axis=0)
    name = pencil.names[int(np.argmax(moved))] if pencil.names else "unknown"
    return (
        f"interface '{name}' has no mass to move, or one that rounding hides beside the others'; "
        "use method 'macneal', or give it some mass"
    )


def definite(matrix: FloatArray) -> bool:
    """Whether a symmetric matrix scaled to a unit diagonal has no pivot at rounding level."""
    diagonal = np.diag(matrix)
    if np.any(diagonal <= 0.0):
        return False
    scale = 1.0 / np.sqrt(diagonal)
    try:
        lower = linalg.cholesky(scale[:, None] * matrix * scale, lower=True)
    except linalg.LinAlgError:
        return False
    return bool(np.min(np.diag(lower)) ** 2 > SUSPECT_PIVOT)


def mode_errors(
    pencil: Pencil, shifted: Shifted, squares: FloatArray, vectors: FloatArray
) -> FloatArray:
    r"""Relative residual of each mode, which bounds the relative error of its w^2.

    Returns
    -------
    (k,) array
        ``sqrt(r^T (K + s M)^-1 r / (w^2 + s))`` with ``r = K phi - w^2 M phi`` for mass-normalised
        phi. With x for ``w^2 + s`` there is an exact eigenvalue y of ``K + s M`` at a distance
        ``|x - y| / sqrt(x y)`` [1]_ not above it.

    Notes
    -----
    For ``phi = sum c_j phi_j`` in the exact modes, ``sum c_j^2 = 1``, the square of the result is
    ``sum c_j^2 (x - x_j)^2 / (x x_j)``, a mean of the squared distances. A share of mode 1 in mode
    i weighs as much as one of mode i in mode 1. In the norm of ``(K + s M)^-1 M`` the former
    weighs w_i / w_1 times as much, and rounding would look like an error of the fastest modes.

    References
    ----------
    .. [1] Li, R.-C. (1998) Relative perturbation theory: I. Eigenvalue and singular value
       variations. SIAM Journal on Matrix Analysis and Applications 19(4), 956-982.
    """
    residual = pencil.forces(vectors) - times(pencil.mass, vectors) * squares
    return energy_errors(residual, shifted.factor.solve(residual), squares + shifted.shift)


def check_errors(
    errors: FloatArray, squares: FloatArray, shifted: Shifted, neglected: FloatArray
) -> None:
    """Raise ReductionError where a mode's error is above what rounding explains, or above 1e-3.

    Rounding explains the error of ``neglected`` mass (k,), too, see `neglected_mass`.

    The rounding of K alone may move w_1^2 by eps w_n^2, which shows in very fine meshes of
    beams, where w_n / w_1 grows with the square of the number of elements.
    """
    rounding = 10 * EPS * shifted.fastest / (squares[0] + shifted.shift)
    allowed = np.minimum(max(ERROR_TOLERANCE, rounding) + neglected, LARGEST_ERROR)
    failed = np.flatnonzero(~(errors <= allowed))
    if failed.size:
        worst = int(failed[0])
        raise ReductionError(
            f"mode {worst + 1} of the component fails its residual check "
            f"({errors[worst]:.1e} > {allowed[worst]:.1e}): {why_inexact(squares, shifted)}"
        )


def why_inexact(squares: FloatArray, shifted: Shifted) -> str:
    """Say whether rounding alone spoils the modes, or the eigen-solver did."""
    spread = np.sqrt(shifted.fastest / np.min(squares, where=squares > 0.0, initial=np.inf))
    if 10 * EPS * spread**2 <= LARGEST_ERROR:
        return f"the eigen-solver did not find the lowest {squares.size} modes to that accuracy"
    return (
        f"its fastest motion is {spread:.1e} times as fast as its slowest, too much for double "
        "precision; use a coarser mesh or stiffnesses that differ less"
    )
