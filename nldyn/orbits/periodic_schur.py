"""Compiled eigenvalues of a product of matrices, by the periodic QR algorithm.

The product A[k-1] ... A[0] is never formed. Rotations of the coordinates between the factors make
A[k-1] = H upper Hessenberg and all others upper triangular; QR steps on the product, chased through
the factors, make H block triangular [Bojanczyk, Golub and Van Dooren 1992]. What comes out are the
eigenvalues of factors that differ from the given ones by rounding relative to each factor's norm.

Every eigenvalue is a number in [0.5, 1) times a power of two of its own, so that products of any
length neither overflow nor underflow.
"""

from __future__ import annotations

import math

import numpy as np

from nldyn.flow.kernels.compiling import allocating, inner, njit

EPS = 2.0**-52
MAX_STEPS = 150  # for one or two eigenvalues; three or four are usual, thirty at a triple one
PATIENCE = 50  # steps before entries at the rounding level of a factor count as zero
ANY_NUMBER, HALF_RANGE = 4000.0, 2000.0  # powers of 2 that take any number, and one near 1, to 0
SQUARE_LOST = 1e-150  # a length whose square underflows
FEW = 16.0  # roundings of a factor, within which an entry counts as zero in the end
SMALL, LARGE = 1e-30, 1e30  # entries of a product, from which on powers of 2 are taken out of it
LEAST, MOST = 1e-250, 1e250  # size of a start, beyond which the step loses its direction
OTHER_START = (1.0, 0.7, -0.4)  # of an exceptional step: any that is in no way special


@njit(cache=True, nogil=True, error_model="numpy")
def product_eigenvalues(factors):
    """Eigenvalues of factors[k-1] @ ... @ factors[0], shape (k, n, n), largest modulus first.

    Returns
    -------
    multipliers : (n,) complex
        Zero or infinite where the modulus is beyond the range of floating-point numbers.
    logarithms : (n,)
        Natural logarithms of the moduli, -inf for zero.
    squeeze : float
        Smallest factor by which one of the matrices multiplies a direction of the periodic Schur
        form, relative to the matrix's largest entry.
    converged : bool
    """
    A = factors.copy()
    n = A.shape[1]
    multipliers, logarithms = np.zeros(n, dtype=np.complex128), np.full(n, -np.inf)
    exponent = scale_factors(A)
    if exponent == -math.inf:
        return multipliers, logarithms, 0.0, True
    if math.isnan(exponent):
        return multipliers, logarithms, 0.0, False
    triangularise(A)
    make_hessenberg(A)
    values, exponents = np.zeros(n, dtype=np.complex128), np.zeros(n)
    squeeze, converged = deflate_all(A, values, exponents)
    for i in range(n):
        values_at = insertion_place(values[i], exponents[i] + exponent, logarithms, i)
        for j in range(i, values_at, -1):
            multipliers[j], logarithms[j] = multipliers[j - 1], logarithms[j - 1]
        multipliers[values_at] = powered(values[i], exponents[i] + exponent)
        logarithms[values_at] = logarithm(values[i], exponents[i] + exponent)
    return multipliers, logarithms, squeeze, converged


@inner
def insertion_place(value, exponent, logarithms, count):
    """Where a value belongs among the first `count` logarithms, which fall; after its equals."""
    size = logarithm(value, exponent)
    i = count
    while i > 0 and logarithms[i - 1] < size:
        i -= 1
    return i


@inner
def logarithm(value, exponent):
    """Natural logarithm of |value · 2^exponent|."""
    size = math.hypot(value.real, value.imag)
    return math.log(size) + exponent * math.log(2.0) if size > 0.0 else -math.inf


@inner
def powered(value, exponent):
    """The value times 2^exponent, an exponent that may be too large for `ldexp`."""
    power = int(min(max(exponent, -ANY_NUMBER), ANY_NUMBER))
    return complex(math.ldexp(value.real, power), math.ldexp(value.imag, power))


@inner
def scale_factors(A):
    """Divide each factor by a power of two near its largest entry; the sum of the exponents.

    It is -inf if a factor is zero, nan if one is not finite.
    """
    total = 0.0
    for j in range(A.shape[0]):
        size = 0.0
        for r in range(A.shape[1]):
            for c in range(A.shape[1]):
                if not math.isfinite(A[j, r, c]):
                    return math.nan
                size = max(size, abs(A[j, r, c]))
        if size == 0.0:
            return -math.inf
        exponent = math.frexp(size)[1]
        total += exponent
        for r in range(A.shape[1]):
            for c in range(A.shape[1]):
                A[j, r, c] = math.ldexp(A[j, r, c], -exponent)
    return total


# Rotations


@inner
def rotation(a, b):
    """Cosine and sine of the rotation that takes (a, b) to (r, 0)."""
    if b == 0.0:
        return 1.0, 0.0
    r = math.sqrt(a * a + b * b)
    if r < SQUARE_LOST:
        r = math.hypot(a, b)
    return a / r, b / r


@inner
def turn_rows(A, j, i, cosine, sine, first, last):
    """Turn rows i and i + 1 of factor j in the columns from `first` to `last`."""
    for c in range(first, last + 1):
        a, b = A[j, i, c], A[j, i + 1, c]
        A[j, i, c] = cosine * a + sine * b
        A[j, i + 1, c] = cosine * b - sine * a


@inner
def turn_columns(A, j, i, cosine, sine, first, last):
    """Turn columns i and i + 1 of factor j in the rows from `first` to `last`."""
    for r in range(first, last + 1):
        a, b = A[j, r, i], A[j, r, i + 1]
        A[j, r, i] = cosine * a + sine * b
        A[j, r, i + 1] = cosine * b - sine * a


@inner
def pass_on(A, j, i, cosine, sine, lo, hi):
    """Turn the coordinates before triangular factor j; the rotation behind it that keeps it so.

    A zero on the diagonal moves on and stays exact.
    """
    singular = A[j, i, i] == 0.0 or A[j, i + 1, i + 1] == 0.0
    turn_columns(A, j, i, cosine, sine, lo, i + 1)
    cosine, sine = rotation(A[j, i, i], A[j, i + 1, i])
    turn_rows(A, j, i, cosine, sine, i, hi)
    A[j, i + 1, i] = 0.0
    if singular:
        A[j, i + 1, i + 1] = 0.0
    return cosine, sine


@inner
def pass_back(A, j, i, cosine, sine, lo, hi):
    """Turn the coordinates behind triangular factor j; the rotation before it that keeps it so.

    A zero on the diagonal moves on and stays exact.
    """
    singular = A[j, i, i] == 0.0 or A[j, i + 1, i + 1] == 0.0
    turn_rows(A, j, i, cosine, sine, i, hi)
    cosine, sine = rotation(A[j, i + 1, i + 1], -A[j, i + 1, i])
    turn_columns(A, j, i, cosine, sine, lo, i + 1)
    A[j, i + 1, i] = 0.0
    if singular:
        A[j, i, i] = 0.0
    return cosine, sine


@inner
def annihilate(A, i, column, bottom, lo, hi):
    """Make H[i + 1, column] zero by turning coordinates i and i + 1; the column lies before i."""
    h = A.shape[0] - 1
    cosine, sine = rotation(A[h, i, column], A[h, i + 1, column])
    turn_around(A, i, cosine, sine, column, bottom, lo, hi)
    A[h, i + 1, column] = 0.0


@inner
def turn_around(A, i, cosine, sine, left, bottom, lo, hi):
    """Turn coordinates i and i + 1 behind H, and so on around all factors to H again.

    Only the diagonal blocks from `lo` to `hi` are kept up to date. Left of column `left` the two
    rows of H are zero, and below row `bottom` the two columns.
    """
    h = A.shape[0] - 1
    turn_rows(A, h, i, cosine, sine, left, hi)
    for j in range(h):
        cosine, sine = pass_on(A, j, i, cosine, sine, lo, hi)
    turn_columns(A, h, i, cosine, sine, lo, bottom)


# Reduction


@inner
def all_coordinates(A):
    """First and last coordinate; the first is no literal, for which functions compile anew."""
    return 0 * A.shape[1], A.shape[1] - 1


@inner
def triangularise(A):
    """Make all factors but the last upper triangular."""
    lo, hi = all_coordinates(A)
    for j in range(A.shape[0] - 1):
        for c in range(hi):
            for i in range(hi - 1, c - 1, -1):
                cosine, sine = rotation(A[j, i, c], A[j, i + 1, c])
                turn_rows(A, j, i, cosine, sine, c, hi)
                A[j, i + 1, c] = 0.0
                turn_columns(A, j + 1, i, cosine, sine, lo, hi)


@inner
def make_hessenberg(A):
    """Make the last factor upper Hessenberg, the others staying triangular."""
    lo, hi = all_coordinates(A)
    for c in range(hi - 1):
        for i in range(hi - 1, c, -1):
            annihilate(A, i, c, hi, lo, hi)


# Iteration


@allocating
def deflate_all(A, values, exponents):
    """Split off one or two eigenvalues after the other; the squeeze, and whether it converged."""
    h = A.shape[0] - 1
    hi, steps, squeeze = A.shape[1] - 1, 0, 1.0
    while hi >= 0:
        lo = decoupled_from(A, hi, steps > PATIENCE)
        if lo == hi:
            mantissa, exponents[hi] = diagonal(A, hi)
            values[hi] = mantissa * A[h, hi, hi]
            squeeze = min(squeeze, abs(A[h, hi, hi]), smallest(A, hi))
            hi, steps = hi - 1, 0
        elif lo == hi - 1:
            pair(A, lo, values, exponents)
            squeeze = min(squeeze, pair_squeeze(A, lo), smallest(A, lo), smallest(A, hi))
            hi, steps = hi - 2, 0
        elif not split_at_zero(A, lo, hi, FEW * EPS if steps > PATIENCE else 0.0):
            if steps == MAX_STEPS:
                return squeeze, False
            double_step(A, lo, hi, steps % 10 == 5, steps % 40 == 39)
            steps += 1
    return squeeze, True


@inner
def decoupled_from(A, hi, patient):
    """First coordinate of the diagonal block that ends at `hi` and cannot be split."""
    h = A.shape[0] - 1
    for i in range(hi, 0, -1):
        neighbours = abs(A[h, i - 1, i - 1]) + abs(A[h, i, i])
        if neighbours == 0.0 or patient:
            neighbours = 1.0
        if abs(A[h, i, i - 1]) <= EPS * neighbours:
            A[h, i, i - 1] = 0.0
            return i
    return 0


@inner
def diagonal(A, i):
    """Product of the diagonal entries i of the triangular factors: mantissa, exponent."""
    mantissa, exponent = 1.0, 0.0
    for j in range(A.shape[0] - 1):
        mantissa, power = math.frexp(mantissa * A[j, i, i])
        exponent += power
    return mantissa, exponent


@inner
def smallest(A, i):
    """Smallest of the diagonal entries i of the triangular factors."""
    h = A.shape[0] - 1
    least = 1.0
    for j in range(h):
        least = min(least, abs(A[j, i, i]))
    return least


@inner
def pair_squeeze(A, lo):
    """Smaller singular value of a block of two of H, nearly."""
    h = A.shape[0] - 1
    a, b, c, d = A[h, lo, lo], A[h, lo, lo + 1], A[h, lo + 1, lo], A[h, lo + 1, lo + 1]
    size = max(abs(a), abs(b), abs(c), abs(d))
    return abs(a * d - b * c) / size if size > 0.0 else 0.0


@allocating
def corner(A, first, last):
    """Product of the diagonal blocks of all triangular factors, and its exponent."""
    h = A.shape[0] - 1
    size = last - first + 1
    P = np.eye(size)
    exponent = 0.0
    for j in range(h):
        largest = 0.0
        for r in range(size):
            for c in range(r, size):
                entry = 0.0
                for q in range(r, c + 1):
                    entry += A[j, first + r, first + q] * P[q, c]
                P[r, c] = entry
                largest = max(largest, abs(entry))
        if 0.0 < largest < SMALL or largest > LARGE:
            power = math.frexp(largest)[1]
            exponent += power
            for r in range(size):
                for c in range(r, size):
                    P[r, c] = math.ldexp(P[r, c], -power)
    return P, exponent


@allocating
def pair(A, lo, values, exponents):
    """Eigenvalues of a block of two.

    The sum of the roots comes from the product of the block, which is exact for factors whose
    entries differ by rounding; the smaller root from the determinants of the factors, so that it
    keeps its digits however small it is.
    """
    h = A.shape[0] - 1
    T, exponent = corner(A, lo, lo + 1)
    h00, h01, h10, h11 = A[h, lo, lo], A[h, lo, lo + 1], A[h, lo + 1, lo], A[h, lo + 1, lo + 1]
    a, b = h00 * T[0, 0], h00 * T[0, 1] + h01 * T[1, 1]
    c, d = h10 * T[0, 0], h10 * T[0, 1] + h11 * T[1, 1]
    first, first_exponent = diagonal(A, lo)
    second, second_exponent = diagonal(A, lo + 1)
    det, power = math.frexp((h00 * h11 - h01 * h10) * first * second)
    det_exponent = first_exponent + second_exponent + power
    half, mean = 0.5 * (a - d), 0.5 * (a + d)
    square = half * half + b * c
    if square < 0.0:
        value = complex(mean, math.sqrt(-square))
        if det > 0.0:
            odd = det_exponent % 2.0
            exponent = 0.5 * (det_exponent - odd)
            value *= math.sqrt(det * (1.0 + odd)) / abs(value)
        values[lo], values[lo + 1] = value, value.conjugate()
        exponents[lo] = exponents[lo + 1] = exponent
        return
    large = mean + math.copysign(math.sqrt(square), mean)
    values[lo], exponents[lo] = large, exponent
    if large != 0.0:
        values[lo + 1], exponents[lo + 1] = det / large, det_exponent - exponent


@allocating
def double_step(A, lo, hi, unshifted, exceptional):
    """An implicit QR step with two shifts on the diagonal blocks from `lo` to `hi`.

    Where eigenvalues differ by more than rounding, steps with the larger ones as shifts carry a
    tiny one upwards without end; without shifts one step puts it below the others.
    """
    x, y, z = start_of_step(A, lo, hi, unshifted)
    size = max(abs(x), abs(y), abs(z))
    if exceptional or not LEAST < size < MOST:
        (x, y, z), size = OTHER_START, 1.0
    x, y, z = x / size, y / size, z / size
    cosine, sine = rotation(y, z)
    turn_around(A, lo + 1, cosine, sine, lo, min(lo + 3, hi), lo, hi)
    cosine, sine = rotation(x, math.hypot(y, z))
    turn_around(A, lo, cosine, sine, lo, min(lo + 3, hi), lo, hi)
    for c in range(lo, hi - 1):
        bottom = min(c + 4, hi)
        if c + 3 <= hi:
            annihilate(A, c + 2, c, bottom, lo, hi)
        annihilate(A, c + 1, c, bottom, lo, hi)


@allocating
def start_of_step(A, lo, hi, unshifted):
    """First column of (M - σ₁)(M - σ₂), of any length, for the product M and its shifts σ."""
    h = A.shape[0] - 1
    T, exponent = corner(A, lo, lo + 1)
    a = A[h, lo, lo] * T[0, 0]
    b = A[h, lo, lo] * T[0, 1] + A[h, lo, lo + 1] * T[1, 1]
    c = A[h, lo + 1, lo] * T[0, 0]
    d = A[h, lo + 1, lo] * T[0, 1] + A[h, lo + 1, lo + 1] * T[1, 1]
    e = A[h, lo + 2, lo + 1] * T[1, 1]
    real, imaginary, power = shifts(A, hi)
    if unshifted:
        real, imaginary, power = 0.0, 0.0, exponent
    power = int(min(max(power - exponent, -HALF_RANGE), HALF_RANGE))
    if power > 0:
        a, b = math.ldexp(a, -power), math.ldexp(b, -power)
        c, d, e = math.ldexp(c, -power), math.ldexp(d, -power), math.ldexp(e, -power)
    else:
        real, imaginary = math.ldexp(real, power), math.ldexp(imaginary, power)
    x = (a - real) ** 2 + imaginary**2 + b * c
    return x, c * (a + d - 2.0 * real), c * e


@allocating
def shifts(A, hi):
    """The pair real ± i imaginary of the last two rows of the product, and its exponent.

    Of two real eigenvalues the one nearer to the last diagonal entry is taken twice.
    """
    h = A.shape[0] - 1
    T, exponent = corner(A, hi - 2, hi)
    i = hi - 1
    a = A[h, i, i - 1] * T[0, 1] + A[h, i, i] * T[1, 1]
    b = A[h, i, i - 1] * T[0, 2] + A[h, i, i] * T[1, 2] + A[h, i, hi] * T[2, 2]
    c = A[h, hi, i] * T[1, 1]
    d = A[h, hi, i] * T[1, 2] + A[h, hi, hi] * T[2, 2]
    half = 0.5 * (a - d)
    square = half * half + b * c
    if square < 0.0:
        return 0.5 * (a + d), math.sqrt(-square), exponent
    root = half + math.copysign(math.sqrt(square), half)
    return (d - b * c / root if root != 0.0 else d), 0.0, exponent


# Zeros on the diagonal of a triangular factor


@allocating
def split_at_zero(A, lo, hi, negligible):
    """Split off the zero eigenvalue of a triangular factor's zero on the diagonal, if any."""
    h = A.shape[0] - 1
    for j in range(h):
        for i in range(lo, hi + 1):
            if abs(A[j, i, i]) <= negligible:
                A[j, i, i] = 0.0
                decouple_above(A, j, i, lo, hi)
                decouple_below(A, j, i, lo, hi)
                return True
    return False


@allocating
def decouple_above(A, j, zero, lo, hi):
    """Make H[zero, zero - 1] zero: a QR step whose last rotation ends at the zero of factor j."""
    h = A.shape[0] - 1
    turns = np.empty((hi + 1, 2))
    for i in range(lo, zero):
        cosine, sine = rotation(A[h, i, i], A[h, i + 1, i])
        turn_rows(A, h, i, cosine, sine, i, hi)
        A[h, i + 1, i] = 0.0
        for between in range(h):
            cosine, sine = pass_on(A, between, i, cosine, sine, lo, hi)
            if i == zero - 1 and between == j:
                cosine, sine = 1.0, 0.0
        turns[i, 0], turns[i, 1] = cosine, sine
    for i in range(lo, zero):
        turn_columns(A, h, i, turns[i, 0], turns[i, 1], lo, hi)


@allocating
def decouple_below(A, j, zero, lo, hi):
    """Make H[zero + 1, zero] zero: a QR step from the right, ending at the zero of factor j."""
    h = A.shape[0] - 1
    turns = np.empty((hi + 1, 2))
    for i in range(hi - 1, zero - 1, -1):
        cosine, sine = rotation(A[h, i + 1, i + 1], -A[h, i + 1, i])
        turn_columns(A, h, i, cosine, sine, lo, i + 1)
        A[h, i + 1, i] = 0.0
        for between in range(h - 1, -1, -1):
            cosine, sine = pass_back(A, between, i, cosine, sine, lo, hi)
            if i == zero and between == j:
                cosine, sine = 1.0, 0.0
        turns[i, 0], turns[i, 1] = cosine, sine
    for i in range(hi - 1, zero - 1, -1):
        turn_rows(A, h, i, turns[i, 0], turns[i, 1], lo, hi)
