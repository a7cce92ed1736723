/* Small linear systems. */
#include "engine.h"

/* four numbers that the processor takes at once, wherever they lie */
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));

/* Fill out (n,) with base (n,), or zeros, and the multiples x_k of columns (n,) that lie `stride`
 * apart; the x lie `apart`. out is no other's memory: the last numbers may be filled twice. */
static void combine(double *restrict out, const double *base, int n,
                    const double *restrict columns, size_t stride, const double *restrict x,
                    size_t apart, int count)
{
    int first = 0;
    for (; n >= 8 && first + 8 < n; first += 16) { /* two eights at once: a sum waits for itself */
        int second = first + 16 > n ? n - 8 : first + 8;
        Four a = {0.0}, b = {0.0}, c = {0.0}, d = {0.0};
        if (base) {
            a = *(const Four *)(base + first), b = *(const Four *)(base + first + 4);
            c = *(const Four *)(base + second), d = *(const Four *)(base + second + 4);
        }
        for (int k = 0; k < count; k++) {
            const double *column = columns + k * stride;
            double factor = x[k * apart];
            a += *(const Four *)(column + first) * factor;
            b += *(const Four *)(column + first + 4) * factor;
            c += *(const Four *)(column + second) * factor;
            d += *(const Four *)(column + second + 4) * factor;
        }
        *(Four *)(out + first) = a;
        *(Four *)(out + first + 4) = b;
        *(Four *)(out + second) = c;
        *(Four *)(out + second + 4) = d;
    }
    if (n >= 8 && first < n) {
        int i = first > n - 8 ? n - 8 : first;
        Four a = {0.0}, b = {0.0};
        if (base) a = *(const Four *)(base + i), b = *(const Four *)(base + i + 4);
        for (int k = 0; k < count; k++) {
            const double *column = columns + k * stride + i;
            a += *(const Four *)column * x[k * apart];
            b += *(const Four *)(column + 4) * x[k * apart];
        }
        *(Four *)(out + i) = a;
        *(Four *)(out + i + 4) = b;
    }
    for (int i = 0; i < n && n < 8; i++) {
        double total = base ? base[i] : 0.0;
        for (int k = 0; k < count; k++) total += columns[k * stride + i] * x[k * apart];
        out[i] = total;
    }
}

/* numbers from one column of a matrix with n rows to the next in `invert` */
static int padded(int n) { return (n + 3) / 4 * 4; }

/* take the multiples of column k out of another one, see `invert`; both end with zeros */
static inline void eliminate(const double *restrict column, double *restrict other, int k, int pad,
                             double inverse)
{
    double factor = other[k];
    for (int i = 0; i < pad; i += 4) *(Four *)(other + i) += *(const Four *)(column + i) * factor;
    other[k] = factor * inverse;
}

/* Replace A (n, n), column by column, each padded with zeros, by its inverse: Gauss and Jordan's
 * way, as fast as factors where n is small, and a product is faster than a solution with them.
 * order (n,) is scratch. */
static void invert(double *restrict A, int n, int *restrict order)
{
    int pad = padded(n);
    for (int k = 0; k < n; k++) {
        double *column = A + (size_t)k * pad;
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(column[i]) > fabs(column[pivot])) pivot = i;
        order[k] = pivot;
        for (int j = 0; j < n && pivot != k; j++) {
            double kept = A[(size_t)j * pad + k];
            A[(size_t)j * pad + k] = A[(size_t)j * pad + pivot];
            A[(size_t)j * pad + pivot] = kept;
        }
        double inverse = column[k] != 0.0 ? 1.0 / column[k] : INFINITY;
        for (int i = 0; i < n; i++) column[i] *= -inverse;
        for (int j = 0; j < k; j++) eliminate(column, A + (size_t)j * pad, k, pad, inverse);
        for (int j = k + 1; j < n; j++) eliminate(column, A + (size_t)j * pad, k, pad, inverse);
        column[k] = inverse;
    }
    for (int k = n - 1; k >= 0; k--) {
        double *a = A + (size_t)k * pad, *b = A + (size_t)order[k] * pad;
        for (int i = 0; i < n && order[k] != k; i++) {
            double kept = a[i];
            a[i] = b[i];
            b[i] = kept;
        }
    }
}

/* replace A (n, n), column by column, by its LU factors with the inverses of the pivots, order by
 * the row swaps */
static void lu_factor(double *restrict A, int n, int *restrict order)
{
    for (int k = 0; k < n; k++) {
        double *restrict column = A + (size_t)k * n;
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(column[i]) > fabs(column[pivot])) pivot = i;
        order[k] = pivot;
        if (pivot != k)
            for (int j = 0; j < n; j++) {
                double kept = A[(size_t)j * n + k];
                A[(size_t)j * n + k] = A[(size_t)j * n + pivot];
                A[(size_t)j * n + pivot] = kept;
            }
        column[k] = column[k] != 0.0 ? 1.0 / column[k] : INFINITY;
        for (int i = k + 1; i < n; i++) column[i] *= column[k];
        for (int j = k + 1; j < n; j++) {
            double *restrict target = A + (size_t)j * n;
            double factor = target[k];
            if (factor != 0.0)
                for (int i = k + 1; i < n; i++) target[i] -= column[i] * factor;
        }
    }
}

/* solve for the columns of B (n, n_rhs), row by row, in place with the factors of `lu_factor` */
static void lu_apply(const double *restrict A, int n, const int *order, double *restrict B,
                     int n_rhs)
{
    for (int k = 0; k < n; k++)
        if (order[k] != k)
            for (int j = 0; j < n_rhs; j++) {
                double kept = B[(size_t)k * n_rhs + j];
                B[(size_t)k * n_rhs + j] = B[(size_t)order[k] * n_rhs + j];
                B[(size_t)order[k] * n_rhs + j] = kept;
            }
    for (int i = 1; i < n; i++) {
        double *b = B + (size_t)i * n_rhs;
        for (int k = 0; k < i; k++) {
            double factor = A[(size_t)k * n + i];
            const double *above = B + (size_t)k * n_rhs;
            for (int j = 0; j < n_rhs; j++) b[j] -= factor * above[j];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        double *b = B + (size_t)i * n_rhs;
        for (int k = i + 1; k < n; k++) {
            double factor = A[(size_t)k * n + i];
            const double *below = B + (size_t)k * n_rhs;
            for (int j = 0; j < n_rhs; j++) b[j] -= factor * below[j];
        }
        for (int j = 0; j < n_rhs; j++) b[j] *= A[(size_t)i * n + i];
    }
}

/* the same for one right-hand side (n,) */
static void lu_apply_vector(const double *restrict A, int n, const int *order, double *restrict b)
{
    for (int k = 0; k < n; k++) {
        double kept = b[k];
        b[k] = b[order[k]];
        b[order[k]] = kept;
    }
    for (int k = 0; k < n; k++) {
        const double *column = A + (size_t)k * n;
        double value = b[k];
        for (int i = k + 1; i < n; i++) b[i] -= column[i] * value;
    }
    for (int k = n - 1; k >= 0; k--) {
        const double *column = A + (size_t)k * n;
        double value = b[k] *= column[k];
        for (int i = 0; i < k; i++) b[i] -= column[i] * value;
    }
}
