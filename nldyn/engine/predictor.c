/* Where a branch goes on, by polynomials through its last points and their tangents. */
#include "engine.h"

#define APART 0.1 /* of the step: a polynomial farther from the cubic is not believed */

/* points and tangents (m, size), the newest first, and the metric (size,) */
typedef struct {
    int m, size;
    const double **points, **tangents, *weights;
    double *nodes, *table; /* (2m,) scratch */
} Past;

static double distance_between(const Past *past, const double *a, const double *b)
{
    double total = 0.0;
    for (int i = 0; i < past->size; i++) total += past->weights[i] * squared(a[i] - b[i]);
    return sqrt(total);
}

/* length of a tangent in the metric */
static double tangent_length(const Past *past, const double *tangent)
{
    double length = 0.0;
    for (int i = 0; i < past->size; i++) length += past->weights[i] * squared(tangent[i]);
    return sqrt(length);
}

/* Fill the polynomial through points and tangents from `first` up to `last`, a step ahead of the
 * first. The distance along the first tangent is its variable; divided differences of double
 * nodes. */
static void hermite(const Past *past, int first, int last, double step, double *values)
{
    int n = 2 * (last - first);
    const double *along = past->tangents[first];
    double length = tangent_length(past, along), *nodes = past->nodes, *table = past->table;
    double *slopes = table + 2 * past->m;
    for (int k = 0; k < last - first; k++) {
        double at = 0.0, pace = 0.0;
        for (int i = 0; i < past->size; i++) {
            double row = past->weights[i] * along[i] / length;
            at += row * (past->points[first + k][i] - past->points[first][i]);
            pace += row * past->tangents[first + k][i];
        }
        nodes[2 * k] = nodes[2 * k + 1] = at;
        slopes[k] = pace;
    }
    for (int i = 0; i < past->size; i++) {
        for (int k = 0; k < last - first; k++) {
            table[2 * k] = past->points[first + k][i];
            table[2 * k + 1] = past->tangents[first + k][i] / slopes[k];
        }
        for (int k = last - first - 1; k > 0; k--) {
            double rise = past->points[first + k][i] - past->points[first + k - 1][i];
            table[2 * k] = rise / (nodes[2 * k] - nodes[2 * k - 2]);
        }
        for (int order = 2; order < n; order++)
            for (int j = n - 1; j >= order; j--)
                table[j] = (table[j] - table[j - 1]) / (nodes[j] - nodes[j - order]);
        double value = table[n - 1];
        for (int j = n - 2; j >= 0; j--) value = value * (step - nodes[j]) + table[j];
        values[i] = value;
    }
}

/* distance of the newest point from the polynomial through some points before it; found: (size,) */
static double foretold_error(const Past *past, int count, double *found)
{
    double step = 0.0, length = tangent_length(past, past->tangents[1]);
    for (int i = 0; i < past->size; i++)
        step += past->weights[i] * past->tangents[1][i] / length *
                (past->points[0][i] - past->points[1][i]);
    hermite(past, 1, 1 + count, step, found);
    return distance_between(past, found, past->points[0]);
}

/* Fill points at a distance along the tangent (size,): on the cubic through two points, or on the
 * tangent if there is one only; and on the polynomial through so many points as foretell this one
 * best from those before it. `behind`: (2 n_behind, size) the points before and their tangents in
 * turn, the last point first. Whether there was memory. */
EXPORT int64_t nldyn_predicted(int64_t size, const double *point, const double *tangent,
                               int64_t n_behind, const double *behind, const double *weights,
                               double step, double *cubic, double *best)
{
    int m = 1 + (int)n_behind, count = 2;
    char *memory = malloc((2 * sizeof(double *) + 5 * sizeof(double)) * m);
    if (!memory) return false;
    double *scratch = (double *)memory;
    const double **places = (const double **)(scratch + 5 * m);
    Past past = {m, (int)size, places, places + m, weights, scratch, scratch + 2 * m};
    for (int k = 0; k < m; k++) {
        past.points[k] = k == 0 ? point : behind + (2 * k - 2) * size;
        past.tangents[k] = k == 0 ? tangent : behind + (2 * k - 1) * size;
    }
    hermite(&past, 0, m < 2 ? m : 2, step, cubic);
    if (m >= 3) {
        double least = INFINITY;
        for (int q = 2; q < m; q++) {
            double error = foretold_error(&past, q, best);
            if (error < least) {
                count = q;
                least = error;
            }
        }
        if (count == m - 1) count = m;
        hermite(&past, 0, count, step, best);
    }
    if (m < 3 || !(distance_between(&past, best, cubic) < APART * step))
        memcpy(best, cubic, sizeof(double) * size);
    free(memory);
    return true;
}
