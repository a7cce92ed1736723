/* Which extremes of two orbits belong together, and which pass zero between them. */
#include "engine.h"

/* difference of two phases on a circle of length `full`, without sign */
static double phase_distance(double a, double b, double full)
{
    double turns = fmod(a - b + 0.5 * full, full);
    if (turns < 0.0) turns += full;
    return fabs(turns - 0.5 * full);
}

/* index of the extreme (n,) of a key nearest in phase, or -1 */
EXPORT int64_t nldyn_nearest(int64_t n, const Extreme *of, double key, double phase, double full)
{
    int64_t best = -1;
    double shortest = INFINITY;
    for (int64_t i = 0; i < n; i++) {
        if (of[i].key != key) continue;
        double away = phase_distance(of[i].phase, phase, full);
        if (away < shortest) {
            best = i;
            shortest = away;
        }
    }
    return best;
}

/* Fill keys and phases (n_b, 2) of the extremes of a and b, nearest to each other, of opposite
 * signs; how many. The phase is that of the extreme nearer to zero. */
EXPORT int64_t nldyn_sign_changes(int64_t n_a, const Extreme *a, int64_t n_b, const Extreme *b,
                                  int64_t n_stops, double full, double *found)
{
    int64_t n = 0;
    for (int64_t place = 0; place < 2 * n_stops; place++) { /* of each stop the maxima first */
        double key = (double)(place ^ 1);
        for (int64_t j = 0; j < n_b; j++) {
            if (b[j].key != key) continue;
            int64_t i = nldyn_nearest(n_a, a, key, b[j].phase, full);
            if (i < 0 || a[i].value * b[j].value >= 0.0) continue;
            if (nldyn_nearest(n_b, b, key, a[i].phase, full) != j) continue;
            found[2 * n] = key;
            found[2 * n + 1] = fabs(b[j].value) < fabs(a[i].value) ? b[j].phase : a[i].phase;
            n++;
        }
    }
    return n;
}

/* fill which extremes of b none of a belongs to: those born or lost between them */
EXPORT void nldyn_alone(int64_t n_a, const Extreme *a, int64_t n_b, const Extreme *b, double full,
                        bool *found)
{
    for (int64_t j = 0; j < n_b; j++) {
        int64_t i = nldyn_nearest(n_a, a, b[j].key, b[j].phase, full);
        found[j] = i < 0 || nldyn_nearest(n_b, b, b[j].key, a[i].phase, full) != j;
    }
}

/* Where a function may touch zero unseen between `left` and `right` of here, or nan: its three
 * values have one sign, but the parabola through them comes within a quarter of zero. */
static double dip(double left, double right, double before, double here, double after)
{
    if (before * here <= 0.0 || here * after <= 0.0 || left == 0.0 || right == 0.0) return NAN;
    double first = (before - here) / left, last = (after - here) / right;
    double curvature = (last - first) / (right - left), slope = first - curvature * left;
    if (curvature * here <= 0.0) return NAN; /* bends away from zero */
    double where = -0.5 * slope / curvature;
    double value = here - 0.25 * slope * slope / curvature;
    double least = smaller(smaller(fabs(before), fabs(here)), fabs(after));
    bool close = left < where && where < right && value * here < 0.25 * least * fabs(here);
    return close ? where : NAN;
}

/* the same for the first extreme of a stop that does so, each with the nearest ones beside it */
static double extreme_dip(int64_t stop, double left, double right, const int64_t *counts,
                          const Extreme *before, const Extreme *here, const Extreme *after,
                          double full)
{
    for (int64_t i = 0; i < counts[1]; i++) {
        if ((int64_t)here[i].key / 2 != stop) continue;
        int64_t z = nldyn_nearest(counts[0], before, here[i].key, here[i].phase, full);
        int64_t b = nldyn_nearest(counts[2], after, here[i].key, here[i].phase, full);
        if (z < 0 || b < 0) continue;
        double where = dip(left, right, before[z].value, here[i].value, after[b].value);
        if (where == where) return where;
    }
    return NAN;
}

/* Fill where test functions, (3, n_tests) at the three points, and an extreme of each stop, of
 * which there are so many (3,), may touch zero unseen: (n_tests + n_stops,). */
EXPORT void nldyn_dips(double left, double right, int64_t n_tests, const double *tests,
                       int64_t n_stops, const int64_t *counts, const Extreme *before,
                       const Extreme *here, const Extreme *after, double full, double *found)
{
    for (int64_t i = 0; i < n_tests; i++)
        found[i] = dip(left, right, tests[i], tests[n_tests + i], tests[2 * n_tests + i]);
    for (int64_t stop = 0; stop < n_stops; stop++)
        found[n_tests + stop] =
            extreme_dip(stop, left, right, counts, before, here, after, full);
}
