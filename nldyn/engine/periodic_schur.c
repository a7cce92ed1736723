/* Eigenvalues of a product of matrices, by the periodic QR algorithm.
 *
 * The product A[k-1] ... A[0] is never formed. Rotations of the coordinates between the factors
 * make A[k-1] = H upper Hessenberg and all others upper triangular; QR steps on the product, chased
 * through the factors, make H block triangular [Bojanczyk, Golub and Van Dooren 1992]. What comes
 * out are the eigenvalues of factors that differ from the given ones by rounding relative to each
 * factor's norm.
 *
 * Every eigenvalue is a number in [0.5, 1) times a power of two of its own, so that products of any
 * length neither overflow nor underflow. */
#include "engine.h"

#define SMALL_MATRIX 16 /* of so many rows: the eigenvalues of a product take no time */
#define MOST_QR_STEPS 150 /* for one or two eigenvalues; three or four are usual, thirty at a triple */
#define MOST_ROUNDS 100 /* of balancing: four are usual */
#define PATIENCE 50 /* steps before entries at the rounding level of a factor count as zero */
#define ANY_NUMBER 4000.0 /* powers of 2 that take any number, and one near 1, to 0 */
#define HALF_RANGE 2000.0
#define FEW 16.0 /* roundings of a factor, within which an entry counts as zero in the end */
#define SMALL 1e-30 /* entries of a product, from which on powers of 2 are taken out of it */
#define LARGE_ENTRY 1e30
#define LEAST 1e-250 /* size of a start, beyond which the step loses its direction */
#define MOST 1e250

/* mantissa times a power of two */
typedef struct {
    double mantissa, exponent;
} Scaled;

/* natural logarithm of |value 2^exponent| */
static double logarithm(Complex value, double exponent)
{
    double size = hypot(value.re, value.im);
    return size > 0.0 ? log(size) + exponent * log(2.0) : -INFINITY;
}

static int power_within(double exponent, double range)
{
    return isnan(exponent) ? 0 : (int)smaller(larger(exponent, -range), range);
}

/* divide each factor by a power of two near its largest entry; the sum of the exponents: -inf if a
 * factor is zero, nan if one is not finite */
static double scale_factors(const Factors *A)
{
    double total = 0.0;
    size_t count = (size_t)A->n * A->n;
    for (int j = 0; j < A->k; j++) {
        double *factor = A->entries + j * count, size = 0.0;
        for (size_t i = 0; i < count; i++) {
            if (!isfinite(factor[i])) return NAN;
            size = larger(size, fabs(factor[i]));
        }
        if (size == 0.0) return -INFINITY;
        int exponent;
        frexp(size, &exponent);
        total += exponent;
        for (size_t i = 0; i < count; i++) factor[i] = ldexp(factor[i], -exponent);
    }
    return total;
}

/* first coordinate of the diagonal block that ends at `hi` and cannot be split */
static int decoupled_from(const Factors *A, int hi, bool patient)
{
    int h = A->k - 1;
    for (int i = hi; i > 0; i--) {
        double neighbours = fabs(*entry(A, h, i - 1, i - 1)) + fabs(*entry(A, h, i, i));
        if (neighbours == 0.0 || patient) neighbours = 1.0;
        if (fabs(*entry(A, h, i, i - 1)) <= DBL_EPSILON * neighbours) {
            *entry(A, h, i, i - 1) = 0.0;
            return i;
        }
    }
    return 0;
}

/* product of the diagonal entries i of the triangular factors */
static Scaled diagonal(const Factors *A, int i)
{
    Scaled found = {1.0, 0.0};
    for (int j = 0; j < A->k - 1; j++) {
        int power;
        found.mantissa = frexp(found.mantissa * *entry(A, j, i, i), &power);
        found.exponent += power;
    }
    return found;
}

/* smallest of the diagonal entries i of the triangular factors */
static double smallest_entry(const Factors *A, int i)
{
    double least = 1.0;
    for (int j = 0; j < A->k - 1; j++) least = smaller(least, fabs(*entry(A, j, i, i)));
    return least;
}

/* smaller singular value of a block of two of H, nearly */
static double pair_squeeze(const Factors *A, int lo)
{
    int h = A->k - 1;
    double a = *entry(A, h, lo, lo), b = *entry(A, h, lo, lo + 1);
    double c = *entry(A, h, lo + 1, lo), d = *entry(A, h, lo + 1, lo + 1);
    double size = larger(larger(fabs(a), fabs(b)), larger(fabs(c), fabs(d)));
    return size > 0.0 ? fabs(a * d - b * c) / size : 0.0;
}

/* fill P (3, 3) with the product of the diagonal blocks of all triangular factors; its exponent */
static double corner(const Factors *A, int first, int last, double P[3][3])
{
    int size = last - first + 1;
    double exponent = 0.0;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) P[r][c] = r == c;
    for (int j = 0; j < A->k - 1; j++) {
        double top = 0.0;
        for (int r = 0; r < size; r++)
            for (int c = r; c < size; c++) {
                double total = 0.0;
                for (int q = r; q <= c; q++) total += *entry(A, j, first + r, first + q) * P[q][c];
                P[r][c] = total;
                top = larger(top, fabs(total));
            }
        if (!((0.0 < top && top < SMALL) || top > LARGE_ENTRY)) continue;
        int power;
        frexp(top, &power);
        exponent += power;
        for (int r = 0; r < size; r++)
            for (int c = r; c < size; c++) P[r][c] = ldexp(P[r][c], -power);
    }
    return exponent;
}

/* Eigenvalues of a block of two.
 *
 * The sum of the roots comes from the product of the block, which is exact for factors whose
 * entries differ by rounding; the smaller root from the determinants of the factors, so that it
 * keeps its digits however small it is. */
static void solve_pair(const Factors *A, int lo, Complex *values, double *exponents)
{
    int h = A->k - 1, power;
    double T[3][3], exponent = corner(A, lo, lo + 1, T);
    double h00 = *entry(A, h, lo, lo), h01 = *entry(A, h, lo, lo + 1);
    double h10 = *entry(A, h, lo + 1, lo), h11 = *entry(A, h, lo + 1, lo + 1);
    double a = h00 * T[0][0], b = h00 * T[0][1] + h01 * T[1][1];
    double c = h10 * T[0][0], d = h10 * T[0][1] + h11 * T[1][1];
    Scaled first = diagonal(A, lo), second = diagonal(A, lo + 1);
    double det = frexp((h00 * h11 - h01 * h10) * first.mantissa * second.mantissa, &power);
    double det_exponent = first.exponent + second.exponent + power;
    double half = 0.5 * (a - d), mean = 0.5 * (a + d), square = half * half + b * c;
    if (square < 0.0) {
        Complex value = {mean, sqrt(-square)};
        if (det > 0.0) {
            double odd = remainder(det_exponent, 2.0) != 0.0;
            exponent = 0.5 * (det_exponent - odd);
            value = scaled(sqrt(det * (1.0 + odd)) / modulus(value), value);
        }
        values[lo] = value;
        values[lo + 1] = complex_of(value.re, -value.im);
        exponents[lo] = exponents[lo + 1] = exponent;
        return;
    }
    double large = mean + copysign(sqrt(square), mean);
    values[lo] = complex_of(large, 0.0);
    exponents[lo] = exponent;
    if (large != 0.0) {
        values[lo + 1] = complex_of(det / large, 0.0);
        exponents[lo + 1] = det_exponent - exponent;
    }
}

/* the pair real ± i imaginary of the last two rows of the product, and its exponent; of two real
 * eigenvalues the one nearer to the last diagonal entry is taken twice */
static double shifts(const Factors *A, int hi, Complex *shift)
{
    int h = A->k - 1, i = hi - 1;
    double T[3][3], exponent = corner(A, hi - 2, hi, T);
    double before = *entry(A, h, i, i - 1), here = *entry(A, h, i, i);
    double a = before * T[0][1] + here * T[1][1];
    double b = before * T[0][2] + here * T[1][2] + *entry(A, h, i, hi) * T[2][2];
    double c = *entry(A, h, hi, i) * T[1][1];
    double d = *entry(A, h, hi, i) * T[1][2] + *entry(A, h, hi, hi) * T[2][2];
    double half = 0.5 * (a - d), square = half * half + b * c;
    if (square < 0.0) {
        *shift = complex_of(0.5 * (a + d), sqrt(-square));
        return exponent;
    }
    double root = half + copysign(sqrt(square), half);
    *shift = complex_of(root != 0.0 ? d - b * c / root : d, 0.0);
    return exponent;
}

/* first column of (M - σ₁)(M - σ₂), of any length, for the product M and its shifts σ */
static void start_of_step(const Factors *A, int lo, int hi, bool unshifted, double start[3])
{
    int h = A->k - 1;
    double T[3][3], exponent = corner(A, lo, lo + 1, T);
    double a = *entry(A, h, lo, lo) * T[0][0];
    double b = *entry(A, h, lo, lo) * T[0][1] + *entry(A, h, lo, lo + 1) * T[1][1];
    double c = *entry(A, h, lo + 1, lo) * T[0][0];
    double d = *entry(A, h, lo + 1, lo) * T[0][1] + *entry(A, h, lo + 1, lo + 1) * T[1][1];
    double e = *entry(A, h, lo + 2, lo + 1) * T[1][1];
    Complex shift;
    double shift_exponent = shifts(A, hi, &shift);
    if (unshifted) {
        shift = complex_of(0.0, 0.0);
        shift_exponent = exponent;
    }
    int power = power_within(shift_exponent - exponent, HALF_RANGE);
    if (power > 0) {
        a = ldexp(a, -power), b = ldexp(b, -power);
        c = ldexp(c, -power), d = ldexp(d, -power), e = ldexp(e, -power);
    } else {
        shift = complex_of(ldexp(shift.re, power), ldexp(shift.im, power));
    }
    start[0] = squared(a - shift.re) + squared(shift.im) + b * c;
    start[1] = c * (a + d - 2.0 * shift.re);
    start[2] = c * e;
}

static int least_index(int a, int b) { return b < a ? b : a; }

/* An implicit QR step with two shifts on the diagonal blocks from `lo` to `hi`.
 *
 * Where eigenvalues differ by more than rounding, steps with the larger ones as shifts carry a tiny
 * one upwards without end; without shifts one step puts it below the others. */
static void double_step(const Factors *A, int lo, int hi, bool unshifted, bool exceptional)
{
    double s[3];
    start_of_step(A, lo, hi, unshifted, s);
    double size = larger(larger(fabs(s[0]), fabs(s[1])), fabs(s[2]));
    if (exceptional || !(LEAST < size && size < MOST)) { /* any that is in no way special */
        s[0] = 1.0, s[1] = 0.7, s[2] = -0.4;
        size = 1.0;
    }
    double x = s[0] / size, y = s[1] / size, z = s[2] / size;
    turn_around(A, lo + 1, rotation(y, z), lo, least_index(lo + 3, hi), lo, hi);
    turn_around(A, lo, rotation(x, hypot(y, z)), lo, least_index(lo + 3, hi), lo, hi);
    for (int c = lo; c < hi - 1; c++) {
        int bottom = least_index(c + 4, hi);
        if (c + 3 <= hi) annihilate(A, c + 2, c, bottom, lo, hi);
        annihilate(A, c + 1, c, bottom, lo, hi);
    }
}

/* make H[zero, zero - 1] zero: a QR step whose last rotation ends at the zero of factor j */
static void decouple_above(const Factors *A, int j, int zero, int lo, int hi)
{
    int h = A->k - 1;
    for (int i = lo; i < zero; i++) {
        Rotation turn = rotation(*entry(A, h, i, i), *entry(A, h, i + 1, i));
        turn_rows(A, h, i, turn, i, hi);
        *entry(A, h, i + 1, i) = 0.0;
        for (int between_them = 0; between_them < h; between_them++) {
            turn = pass_on(A, between_them, i, turn, lo, hi);
            if (i == zero - 1 && between_them == j) turn = (Rotation){1.0, 0.0};
        }
        A->turns[2 * i] = turn.cosine;
        A->turns[2 * i + 1] = turn.sine;
    }
    for (int i = lo; i < zero; i++)
        turn_columns(A, h, i, (Rotation){A->turns[2 * i], A->turns[2 * i + 1]}, lo, hi);
}

/* make H[zero + 1, zero] zero: a QR step from the right, ending at the zero of factor j */
static void decouple_below(const Factors *A, int j, int zero, int lo, int hi)
{
    int h = A->k - 1;
    for (int i = hi - 1; i >= zero; i--) {
        Rotation turn = rotation(*entry(A, h, i + 1, i + 1), -*entry(A, h, i + 1, i));
        turn_columns(A, h, i, turn, lo, i + 1);
        *entry(A, h, i + 1, i) = 0.0;
        for (int between_them = h - 1; between_them >= 0; between_them--) {
            turn = pass_back(A, between_them, i, turn, lo, hi);
            if (i == zero && between_them == j) turn = (Rotation){1.0, 0.0};
        }
        A->turns[2 * i] = turn.cosine;
        A->turns[2 * i + 1] = turn.sine;
    }
    for (int i = hi - 1; i >= zero; i--)
        turn_rows(A, h, i, (Rotation){A->turns[2 * i], A->turns[2 * i + 1]}, lo, hi);
}

/* split off the zero eigenvalue of a triangular factor's zero on the diagonal, if any */
static bool split_at_zero(const Factors *A, int lo, int hi, double negligible)
{
    for (int j = 0; j < A->k - 1; j++)
        for (int i = lo; i <= hi; i++)
            if (fabs(*entry(A, j, i, i)) <= negligible) {
                *entry(A, j, i, i) = 0.0;
                decouple_above(A, j, i, lo, hi);
                decouple_below(A, j, i, lo, hi);
                return true;
            }
    return false;
}

/* split off one or two eigenvalues after the other; whether it converged */
static bool deflate_all(const Factors *A, Complex *values, double *exponents, double *squeeze)
{
    int h = A->k - 1, hi = A->n - 1, steps = 0;
    *squeeze = 1.0;
    while (hi >= 0) {
        int lo = decoupled_from(A, hi, steps > PATIENCE);
        if (lo == hi) {
            Scaled found = diagonal(A, hi);
            double last = *entry(A, h, hi, hi);
            values[hi] = complex_of(found.mantissa * last, 0.0);
            exponents[hi] = found.exponent;
            *squeeze = smaller(smaller(*squeeze, fabs(last)), smallest_entry(A, hi));
            hi -= 1;
            steps = 0;
        } else if (lo == hi - 1) {
            solve_pair(A, lo, values, exponents);
            *squeeze = smaller(*squeeze, pair_squeeze(A, lo));
            *squeeze = smaller(*squeeze, smaller(smallest_entry(A, lo), smallest_entry(A, hi)));
            hi -= 2;
            steps = 0;
        } else if (!split_at_zero(A, lo, hi, steps > PATIENCE ? FEW * DBL_EPSILON : 0.0)) {
            if (steps == MOST_QR_STEPS || ended(A)) return false;
            double_step(A, lo, hi, steps % 10 == 5, steps % 40 == 39);
            steps++;
        }
    }
    return true;
}

/* put the eigenvalues in order, the largest modulus first; equals stay in theirs */
static void sort_values(int n, const Complex *values, const double *exponents, double exponent,
                        Complex *multipliers, double *logarithms)
{
    for (int i = 0; i < n; i++) {
        double power = exponents[i] + exponent, size = logarithm(values[i], power);
        int place = i;
        for (; place > 0 && logarithms[place - 1] < size; place--) {
            multipliers[place] = multipliers[place - 1];
            logarithms[place] = logarithms[place - 1];
        }
        int two = power_within(power, ANY_NUMBER);
        multipliers[place] = complex_of(ldexp(values[i].re, two), ldexp(values[i].im, two));
        logarithms[place] = size;
    }
}

/* Length of row (or column) i of a matrix (n, n), and its largest entry. */
static double length_of_line(const double *matrix, int n, int i, bool row, double *largest_entry)
{
    double square = 0.0;
    *largest_entry = 0.0;
    for (int j = 0; j < n; j++) {
        double here = row ? matrix[i * n + j] : matrix[j * n + i];
        square += squared(here);
        *largest_entry = larger(*largest_entry, fabs(here));
    }
    return sqrt(square);
}

/* Fill powers of two (n,) for the coordinates, with which the rows and columns of a matrix (n, n) of
 * no negative entries are alike in length, as LAPACK's dgebal does [Osborne 1960; James, Langou and
 * Lowery 2014]. The matrix is scaled, too. */
static void balance(double *matrix, int n, double *scale)
{
    const double most = DBL_MIN / DBL_EPSILON, worth = 0.95; /* a change by less is not worth it */
    bool again = true;
    for (int i = 0; i < n; i++) scale[i] = 1.0;
    for (int round = 0; again && round < MOST_ROUNDS; round++) {
        again = false;
        for (int i = 0; i < n; i++) {
            double column_entry, row_entry, factor = 1.0;
            double column = length_of_line(matrix, n, i, false, &column_entry);
            double row = length_of_line(matrix, n, i, true, &row_entry), both = column + row;
            if (!(column > 0.0 && row > 0.0 && isfinite(both))) continue;
            for (; column < 0.5 * row && larger(factor, column_entry) < 0.5 / most &&
                   smaller(row, row_entry) > 2.0 * most; column *= 2.0, row *= 0.5) {
                factor *= 2.0;
                column_entry *= 2.0;
                row_entry *= 0.5;
            }
            for (; 0.5 * column >= row && larger(row, row_entry) < 0.5 / most &&
                   smaller(factor, smaller(column, column_entry)) > 2.0 * most;
                 column *= 0.5, row *= 2.0) {
                factor *= 0.5;
                column_entry *= 0.5;
                row_entry *= 2.0;
            }
            if (!(column + row < worth * both)) continue;
            if (factor < 1.0 && scale[i] < 1.0 && factor * scale[i] <= most) continue;
            if (factor > 1.0 && scale[i] > 1.0 && scale[i] >= 1.0 / (most * factor)) continue;
            scale[i] *= factor;
            again = true;
            for (int j = 0; j < n; j++) matrix[i * n + j] /= factor;
            for (int j = 0; j < n; j++) matrix[j * n + i] *= factor;
        }
    }
}

/* Fill the same maps (k, n, n) in coordinates scaled by powers of two, so that entries are alike;
 * whether there was memory. Those that are not finite stay as they are. */
EXPORT int64_t nldyn_balanced(int64_t k, int64_t n, const double *factors, double *found)
{
    size_t count = (size_t)n * n;
    double *total = malloc(sizeof(double) * (count + n + 1)), *scale = total + count, sum = 0.0;
    if (!total) return false;
    memcpy(found, factors, sizeof(double) * count * k);
    for (size_t i = 0; i < count; i++) {
        total[i] = 0.0;
        for (int64_t j = 0; j < k; j++) total[i] += fabs(factors[j * count + i]);
        sum += total[i];
    }
    if (isfinite(sum)) {
        balance(total, (int)n, scale);
        for (size_t i = 0; i < count * k; i++) found[i] = found[i] * scale[i % n] / scale[i / n % n];
    }
    free(total);
    return true;
}

/* Eigenvalues of factors[k-1] ... factors[0], (k, n, n), the largest modulus first; whether it
 * converged, or -1 without memory. Fills multipliers (n,), zero or infinite where the modulus is
 * beyond the range of numbers; the natural logarithms (n,) of the moduli, -inf for zero; and the
 * smallest factor by which one of the matrices multiplies a direction of the periodic Schur form,
 * relative to the matrix's largest entry. */
EXPORT int64_t nldyn_product_eigenvalues(const Host *host, int64_t k, int64_t n,
                                         const double *factors, Complex *multipliers,
                                         double *logarithms, double *squeeze)
{
    size_t count = (size_t)k * n * n;
    *squeeze = 0.0;
    for (int i = 0; i < n; i++) {
        multipliers[i] = complex_of(0.0, 0.0);
        logarithms[i] = -INFINITY;
    }
    double *memory = malloc(sizeof(double) * (count + 5 * n + 1));
    if (!memory) return -1;
    Watch watch;
    Factors A = {memory, memory + count, (int)k, (int)n, n > SMALL_MATRIX ? &watch : NULL};
    if (A.watch) begin_watch(A.watch, host);
    Complex *values = (Complex *)(memory + count + 2 * n);
    double *exponents = memory + count + 4 * n;
    memcpy(A.entries, factors, sizeof(double) * count);
    memset(values, 0, sizeof(double) * 3 * n);
    double exponent = scale_factors(&A);
    bool converged = exponent == -INFINITY;
    if (isfinite(exponent)) {
        reduce(&A);
        converged = deflate_all(&A, values, exponents, squeeze);
        sort_values((int)n, values, exponents, exponent, multipliers, logarithms);
    }
    if (A.watch) end_watch(A.watch);
    free(memory);
    return converged;
}
