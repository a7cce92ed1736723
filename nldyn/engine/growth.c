/* Orthonormalisation: how much each direction grows over a sequence of Jacobians. */
#include "engine.h"

/* make column j of a basis (n, n) a unit vector across the columns before it */
static void put_across(double *basis, int n, int j)
{
    int best = 0;
    double across = -1.0;
    for (int i = 0; i < n; i++) {
        double left = 1.0;
        for (int other = 0; other < j; other++) left -= squared(basis[i * n + other]);
        if (left > across) {
            best = i;
            across = left;
        }
    }
    for (int i = 0; i < n; i++) {
        double share = 0.0;
        for (int other = 0; other < j; other++)
            share += basis[best * n + other] * basis[i * n + other];
        basis[i * n + j] = ((i == best) - share) / sqrt(across);
    }
}

/* make column j of `moved` orthogonal to the basis before it, twice, since once loses digits where
 * they have nearly become parallel; its length */
static double without_those_before(const double *basis, double *moved, int n, int j)
{
    for (int round = 0; round < 2; round++)
        for (int other = 0; other < j; other++) {
            double share = 0.0;
            for (int i = 0; i < n; i++) share += basis[i * n + other] * moved[i * n + j];
            for (int i = 0; i < n; i++) moved[i * n + j] -= share * basis[i * n + other];
        }
    double length = 0.0;
    for (int i = 0; i < n; i++) length += squared(moved[i * n + j]);
    return sqrt(length);
}

/* Carry an orthonormal basis (n, n) in place over Jacobians (k, n, n); fill ln of the stretches
 * (k, n). A column no longer than `least` times the Jacobian's size has been squeezed to nothing,
 * and another takes its place. moved: (n, n) scratch. */
EXPORT int64_t nldyn_growth_rates(const Host *host, int64_t k, int64_t count,
                                  const double *jacobians, double *basis, double least,
                                  double *stretches, double *moved)
{
    int n = (int)count;
    Watch watch;
    begin_watch(&watch, host);
    int pause = n > 32 ? 1 : 64; /* steps between two looks */
    for (int64_t step = 0; step < k && !(step % pause == pause - 1 && interrupted(&watch)); step++) {
        const double *jacobian = jacobians + (size_t)step * n * n;
        double size = 0.0;
        for (int i = 0; i < n * n; i++) size += squared(jacobian[i]);
        double nothing = least * sqrt(size);
        multiply(&watch, jacobian, basis, moved, n, n, n);
        for (int j = 0; j < n; j++) {
            double length = without_those_before(basis, moved, n, j);
            bool left = length > nothing;
            stretches[step * n + j] = left ? log(length) : -INFINITY;
            for (int i = 0; left && i < n; i++) basis[i * n + j] = moved[i * n + j] / length;
            if (!left) put_across(basis, n, j);
        }
    }
    end_watch(&watch);
    return watch.stopped ? INTERRUPTED : OK;
}
