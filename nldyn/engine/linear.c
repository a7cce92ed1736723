/* Small linear systems. */
#include "engine.h"

/* replace A (n, n) by its LU factors with the inverses of the pivots, order by the row swaps */
static void lu_factor(double *A, int n, int *order)
{
    for (int k = 0; k < n; k++) {
        double *row = A + (size_t)k * n;
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[(size_t)i * n + k]) > fabs(A[(size_t)pivot * n + k])) pivot = i;
        order[k] = pivot;
        if (pivot != k) {
            double *other = A + (size_t)pivot * n;
            for (int j = 0; j < n; j++) {
                double kept = row[j];
                row[j] = other[j];
                other[j] = kept;
            }
        }
        row[k] = row[k] != 0.0 ? 1.0 / row[k] : INFINITY;
        for (int i = k + 1; i < n; i++) {
            double *target = A + (size_t)i * n;
            double factor = target[k] *= row[k];
            if (factor != 0.0)
                for (int j = k + 1; j < n; j++) target[j] -= factor * row[j];
        }
    }
}

/* solve for the columns of B (n, n_rhs) in place with the factors of `lu_factor` */
static void lu_apply(const double *A, int n, const int *order, double *B, int n_rhs)
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
            double factor = A[(size_t)i * n + k];
            const double *above = B + (size_t)k * n_rhs;
            for (int j = 0; j < n_rhs; j++) b[j] -= factor * above[j];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        double *b = B + (size_t)i * n_rhs;
        for (int k = i + 1; k < n; k++) {
            double factor = A[(size_t)i * n + k];
            const double *below = B + (size_t)k * n_rhs;
            for (int j = 0; j < n_rhs; j++) b[j] -= factor * below[j];
        }
        for (int j = 0; j < n_rhs; j++) b[j] *= A[(size_t)i * n + i];
    }
}

/* the same for one right-hand side (n,) */
static void lu_apply_vector(const double *A, int n, const int *order, double *b)
{
    for (int k = 0; k < n; k++) {
        double kept = b[k];
        b[k] = b[order[k]];
        b[order[k]] = kept;
    }
    for (int i = 1; i < n; i++) {
        double total = b[i];
        for (int k = 0; k < i; k++) total -= A[(size_t)i * n + k] * b[k];
        b[i] = total;
    }
    for (int i = n - 1; i >= 0; i--) {
        double total = b[i];
        for (int k = i + 1; k < n; k++) total -= A[(size_t)i * n + k] * b[k];
        b[i] = total * A[(size_t)i * n + i];
    }
}
