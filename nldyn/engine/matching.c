/* Which extremes of two orbits belong together, and which pass zero between them. */
#include "engine.h"

/* extremes of an orbit: phases and values (n,), and whether each is a maximum */
typedef struct {
    int64_t n;
    const double *phases, *values;
    const bool *kinds;
} Extremes;

/* difference of two phases on a circle of length `full`, without sign */
static double phase_distance(double a, double b, double full)
{
    double turns = fmod(a - b + 0.5 * full, full);
    if (turns < 0.0) turns += full;
    return fabs(turns - 0.5 * full);
}

/* index of the extreme of a kind nearest in phase, or -1 */
EXPORT int64_t nldyn_nearest(const Extremes *of, int64_t kind, double phase, double full)
{
    int64_t best = -1;
    double shortest = INFINITY;
    for (int64_t i = 0; i < of->n; i++) {
        if (of->kinds[i] != (kind != 0)) continue;
        double away = phase_distance(of->phases[i], phase, full);
        if (away < shortest) {
            best = i;
            shortest = away;
        }
    }
    return best;
}

/* Fill kinds and phases of the extremes of a and b, nearest to each other, of opposite signs; how
 * many. The phase is that of the extreme nearer to zero. */
EXPORT int64_t nldyn_sign_changes(const Extremes *a, const Extremes *b, double full, bool *kinds,
                                  double *phases)
{
    int64_t n = 0;
    for (int kind = 1; kind >= 0; kind--)
        for (int64_t j = 0; j < b->n; j++) {
            if (b->kinds[j] != (kind != 0)) continue;
            int64_t i = nldyn_nearest(a, kind, b->phases[j], full);
            if (i < 0 || a->values[i] * b->values[j] >= 0.0) continue;
            if (nldyn_nearest(b, kind, a->phases[i], full) != j) continue;
            kinds[n] = kind != 0;
            phases[n] = fabs(b->values[j]) < fabs(a->values[i]) ? b->phases[j] : a->phases[i];
            n++;
        }
    return n;
}

/* fill which extremes of b none of a belongs to: those born or lost between them */
EXPORT void nldyn_alone(const Extremes *a, const Extremes *b, double full, bool *found)
{
    for (int64_t j = 0; j < b->n; j++) {
        int64_t i = nldyn_nearest(a, b->kinds[j], b->phases[j], full);
        found[j] = i < 0 || nldyn_nearest(b, b->kinds[j], a->phases[i], full) != j;
    }
}

/* Where a function may touch zero unseen between `left` and `right` of here, or nan: its three
 * values have one sign, but the parabola through them comes within a quarter of zero. */
EXPORT double nldyn_dip(double left, double right, double before, double here, double after)
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

/* the same for the first of the extremes that does so, each with the nearest ones beside it */
EXPORT double nldyn_extreme_dip(double left, double right, const Extremes *before,
                                const Extremes *here, const Extremes *after, double full)
{
    for (int64_t i = 0; i < here->n; i++) {
        int64_t z = nldyn_nearest(before, here->kinds[i], here->phases[i], full);
        int64_t b = nldyn_nearest(after, here->kinds[i], here->phases[i], full);
        if (z < 0 || b < 0) continue;
        double where =
            nldyn_dip(left, right, before->values[z], here->values[i], after->values[b]);
        if (where == where) return where;
    }
    return NAN;
}
