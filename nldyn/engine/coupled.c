/* Stops at points without mass, whose forces move each other's at once.
 *
 * What a stop is penetrated by goes with the forces of the others [Monjaraz-Tec, Gross and Krack
 * 2022],
 *
 *     δ_a = c_a q - gap_a - Σ_b common_ab F_b,   F_b = k_b δ_b where that is above zero, else none,
 *
 * a linear complementarity problem of one solution, as common + diag(1/k) is positive definite. So
 * long as the same stops are closed, each δ is linear in the state: its row, its response and its
 * gap stand in the place of the stop's own, and nothing else in the engine knows of the others.
 * Where a stop closes or opens, they change by a principal pivot [Cottle, Pang and Stone 2009,
 * section 2.3]; neither δ nor F jumps there. */
#include "engine.h"

#define MOST_PIVOTS 50      /* after which their rounding is left behind */
#define PIVOTS_PER_STOP 100 /* in the search for the closed ones, at most */
#define LEAST 0.1 /* of a mobility alone: guesses need one, and others' forces may make up for it */

static bool any_coupled(const Flow *fl) { return fl->give != NULL; }

static bool is_coupled(const Flow *fl, int s) { return any_coupled(fl) && fl->coupled[s]; }

/* give all stops their own rows again: none is closed */
static void uncouple(const Flow *fl)
{
    size_t n = fl->n_stops;
    memcpy(fl->own_rows, fl->plain->rows, sizeof(double) * 3 * fl->n_out * fl->size);
    memcpy(fl->own_stops, fl->plain->stops, sizeof(double) * n * fl->n_columns);
    memcpy(fl->give, fl->plain->common, sizeof(double) * n * n);
    for (size_t s = 0; s < n; s++) {
        fl->counted[s] = fl->coupled[s] = false;
        for (size_t b = 0; b < n; b++) fl->coupled[s] = fl->coupled[s] || fl->give[s * n + b] != 0.0;
    }
    *fl->pivots = 0;
    fill_forced(fl);
}

/* times a factor, or less a share of that of another stop: all that is linear in a stop's δ */
static void combine_stop(const Flow *fl, int stop, double factor, double share, int other)
{
    int size = fl->size, n = fl->n_stops;
    for (int order = 0; order < 3; order++) {
        double *row = fl->own_rows + ((size_t)order * fl->n_out + stop) * size;
        const double *by = row_of(fl, order, other);
        for (int k = 0; k < size; k++) row[k] = factor * row[k] - share * by[k];
    }
    for (int p = 0; p < (1 + fl->n_terms) * (2 + fl->n_parameters); p++) {
        Complex *forced = fl->forced + (size_t)p * fl->n_out;
        forced[stop] = minus(scaled(factor, forced[stop]), scaled(share, forced[other]));
    }
    for (int b = 0; b < n; b++) {
        double *give = fl->give + (size_t)stop * n + b;
        *give = factor * *give - share * fl->give[(size_t)other * n + b];
    }
    double *numbers = fl->own_stops + (size_t)stop * fl->n_columns;
    numbers[GAP] = factor * numbers[GAP] - share * stop_of(fl, other)->gap;
}

/* count a stop among the closed ones, or leave it out of them */
static void pivot(const Flow *fl, int stop)
{
    int n = fl->n_stops;
    double k = stop_of(fl, stop)->stiffness * (fl->counted[stop] ? -1.0 : 1.0);
    combine_stop(fl, stop, 1.0 / (1.0 + k * fl->give[(size_t)stop * n + stop]), 0.0, stop);
    for (int a = 0; a < n; a++)
        if (a != stop && fl->coupled[a])
            combine_stop(fl, a, 1.0, k * fl->give[(size_t)a * n + stop], stop);
    for (int a = 0; a < n; a++)
        if (fl->coupled[a]) {
            size_t place = (size_t)a * fl->n_columns + MOBILITY;
            fl->own_stops[place] = larger(between(fl, a, a), LEAST * fl->plain->stops[place]);
        }
    fl->counted[stop] = !fl->counted[stop];
    ++*fl->pivots;
}

/* let the rows of coupled stops be those with the forces of the closed ones */
static void couple(const Flow *fl, const bool *closed)
{
    if (!any_coupled(fl)) return;
    bool same = true, none = true;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!fl->coupled[s]) continue;
        same = same && closed[s] == fl->counted[s];
        none = none && !closed[s];
    }
    if (same) return;
    if (none || *fl->pivots >= MOST_PIVOTS) uncouple(fl);
    for (int s = 0; s < fl->n_stops; s++)
        if (fl->coupled[s] && closed[s] != fl->counted[s]) pivot(fl, s);
}

/* what a force at stop b, by a number of its own, changes of that of stop a */
static double passed_on(const Flow *fl, int a, int b)
{
    return (a == b) - stop_of(fl, a)->stiffness * fl->give[(size_t)a * fl->n_stops + b];
}
