/* Whether a panel resolves the contact, and where what it shows changes its sign. */
#include "engine.h"

#define SHALLOW 16.0 /* a lowest point so low a part of the curvature all but opens the stop */
#define DAMPED_TAIL 0.01 /* of the usual one, where a stop damps strongly */
#define REACH 0.05 /* of the interval: where the next parabola's places lie beside its lowest point */
#define CLEAR 0.1  /* of the largest: a lowest value above it is not near zero in between either */
#define PLACED 1e-6 /* relative: error of the place where a panel is to be cut */

static int disc_of(const Flow *fl, const Panel *panel, int a);
static double show_disc_force(const Flow *fl, const Panel *panel, int a, double *shown);
static double slowest_over(const Flow *fl, const Panel *panel, int a);
static double disc_kick(const Flow *fl, const Panel *panel, int a, double h);
static double forgotten(const Flow *fl, const Gauss *tab, int kind, double h, const Panel *panel,
                        int a);

/* Legendre coefficient of the polynomial through values (m,) */
static inline double legendre_coefficient(const Gauss *tab, const double *values, int degree)
{
    double total = 0.0;
    const double *row = tab->to_legendre + (size_t)degree * tab->m;
    for (int j = 0; j < tab->m; j++) total += row[j] * values[j];
    return total;
}

/* larger of the last two of these coefficients */
static double legendre_tail(const Gauss *tab, const double *values)
{
    int m = (int)tab->m;
    return larger(fabs(legendre_coefficient(tab, values, m - 2)),
                  fabs(legendre_coefficient(tab, values, m - 1)));
}

/* value at the end of the panel of the same polynomial: each of Legendre's is 1 there */
static double at_end(const Gauss *tab, const double *values)
{
    double total = 0.0;
    for (int degree = 0; degree < tab->m; degree++)
        total += legendre_coefficient(tab, values, degree);
    return total;
}

/* its value at the start, where Legendre's polynomials alternate */
static double at_start(const Gauss *tab, const double *values)
{
    double total = 0.0;
    for (int degree = 0; degree < tab->m; degree++) {
        double share = legendre_coefficient(tab, values, degree);
        total += degree % 2 ? -share : share;
    }
    return total;
}

/* its slope at the end over the stretched time of a panel: n (n + 1) of each of Legendre's */
static double slope_at_end(const Gauss *tab, const double *values)
{
    double total = 0.0;
    for (int degree = 0; degree < tab->m; degree++)
        total += degree * (degree + 1) * legendre_coefficient(tab, values, degree);
    return total;
}

/* largest absolute value */
static double largest(const double *values, int m)
{
    double found = 0.0;
    for (int j = 0; j < m; j++) found = larger(found, fabs(values[j]));
    return found;
}

/* slope (value) and curvature (slope), at its middle, of the parabola through values at left, 0
 * and right */
static Value parabola(double left, double right, double below, double here, double above)
{
    double up = (below - here) / left, on = (above - here) / right;
    double curvature = (on - up) / (right - left);
    return (Value){up - curvature * left, curvature};
}

/* whether penetrations have a minimum so low that their slope is nearly singular there: the
 * parabola through it vanishes at a complex pair nearer than a quarter of the panel */
static bool nearly_opens(const Gauss *tab, int kind, const double *values, double noise)
{
    const double *chi = tab->chi + (size_t)kind * tab->m;
    for (int i = 1; i < tab->m - 1; i++) {
        if (!(values[i - 1] >= values[i] && values[i] <= values[i + 1])) continue;
        Value at = parabola(chi[i - 1] - chi[i], chi[i + 1] - chi[i], values[i - 1], values[i],
                            values[i + 1]);
        if (!(at.slope > 0.0)) continue;
        double lowest = values[i] - 0.25 * at.value * at.value / at.slope;
        if (noise < lowest && lowest < at.slope / SHALLOW) return true;
    }
    return false;
}

/* Legendre tail, beside its largest, of the response (2n, m) of the modes to a stop, or of its
 * square; each mode counts by its share in the mobility */
static double response_tail(const Flow *fl, const Gauss *tab, int stop, const double *response,
                            bool of_square)
{
    double worst = 0.0, mobility = TINY;
    int m = (int)tab->m;
    const double *last = tab->to_legendre + (size_t)(m - 1) * m, *before = last - m;
    for (int b = 0; b < fl->n; b++) {
        double tail = 0.0, size = TINY, share = 0.0;
        for (int k = 2 * b; k < 2 * b + 2; k++) {
            const double *values = response + (size_t)k * m;
            double row = fabs(row_of(fl, 1, stop)[k]), ends[2] = {0.0, 0.0}, top = 0.0;
            for (int j = 0; j < m; j++) {
                double value = of_square ? values[j] * values[j] : values[j];
                ends[0] += before[j] * value;
                ends[1] += last[j] * value;
                top = larger(top, fabs(value));
            }
            tail = larger(tail, row * larger(fabs(ends[0]), fabs(ends[1])));
            size = larger(size, row * top);
            share += row * fabs(push_of(fl, stop)[k]);
        }
        worst = larger(worst, share * tail / size);
        mobility += share;
    }
    return worst / mobility;
}

/* bound of the square of the fastest swing on the closed coupled stops: eigenvalues λ of what their
 * forces make of accelerations are real, and none is above √Σλ² */
static double coupled_stiffness(const Flow *fl, const Panel *panel)
{
    double total = 0.0;
    for (int a = 0; a < panel->na && any_coupled(fl); a++)
        for (int b = 0; b < panel->na; b++) {
            int s = panel->active[a], other = panel->active[b];
            if (!is_coupled(fl, s) || !is_coupled(fl, other)) continue;
            total += stop_of(fl, s)->stiffness * between(fl, s, other) *
                     stop_of(fl, other)->stiffness * between(fl, other, s);
        }
    return sqrt(larger(total, 0.0));
}

/* whether the stiffness of the closed stops sways too fast for a panel: a force that hardly
 * changes tells nothing of how a change of the motion sways on them, so it is held to the bound of
 * the structure's fastest mode */
static bool sways_unseen(const Flow *fl, const Gauss *tab, int kind, double h, const Panel *panel)
{
    double stiffness = coupled_stiffness(fl, panel);
    for (int a = 0; a < panel->na; a++)
        if (!is_held(fl, panel->active[a]) && !is_coupled(fl, panel->active[a]))
            stiffness += stop_of(fl, panel->active[a])->mobility *
                         largest(piece_row(panel->slope, a, panel->m), panel->m);
    double longest = fl->node_angle * panel->m * (kind == 0 ? 1.0 : MAPPED / tab->power);
    return h * sqrt(stiffness) > larger(longest, HALF_CONTACT);
}

/* fill the tails of the responses to the stops and of their squares, each (na,), of a new panel */
static void fill_response_tails(const Flow *fl, const Gauss *tab, Panel *panel, Scratch *s)
{
    if (panel->weighed) return;
    for (int a = 0; a < panel->na; a++) {
        int stop = panel->active[a];
        const double *back = panel->back + (size_t)a * fl->size * panel->m;
        double tail = larger(response_tail(fl, tab, stop, back, false), fl->tail);
        s->forced[a] = s->swayed[a] = tail;
        if (tail > fl->tail) /* what a slope acts on sways like what it leads to */
            s->swayed[a] = larger(tail, response_tail(fl, tab, stop, back, true));
    }
    panel->weighed = true;
}

/* largest of numbers (na, m) of a stop, of both directions at a round clearance */
static double largest_of(const Flow *fl, const Panel *panel, const double *values, int a)
{
    int m = panel->m, partner = panel->round ? partner_of(fl, panel, a) : -1;
    double found = largest(values + (size_t)a * m, m);
    return partner < 0 ? found : larger(found, largest(values + (size_t)partner * m, m));
}

/* largest penetration at the nodes; of a rigid round clearance, which has none, displacement */
static double deepest_of(const Flow *fl, const Panel *panel, int a)
{
    int first = is_second(fl, panel->active[a]) ? partner_of(fl, panel, a) : a;
    int s = panel->active[first];
    if (!is_round(fl, s) || is_rigid(fl, s)) return largest_of(fl, panel, panel->output, a);
    return largest(panel->radial + (size_t)first * panel->m, panel->m);
}

/* Legendre tail (value) and largest (slope) of what a stop's force changes by, times dχ/ds */
static Value slope_tail(const Flow *fl, const Gauss *tab, const Panel *panel, const double *slopes,
                        int o)
{
    int na = panel->na, m = panel->m, a = o % na;
    const double *by = slopes + (size_t)(o - a) * m;
    Value found = {legendre_tail(tab, slopes + (size_t)o * m), largest_of(fl, panel, by, a)};
    if (!is_planar(fl, panel->active[a])) return found;
    const double *cross = by + (size_t)panel->outputs * m;
    found.value = larger(found.value, legendre_tail(tab, cross + (size_t)a * m));
    found.slope = larger(found.slope, largest_of(fl, panel, cross, a));
    return found;
}

/* whether the force (o < na) and the slope of an output are resolved */
static bool output_resolved(const Flow *fl, const Gauss *tab, int kind, double h,
                            const double *noise, const Panel *panel, const Scratch *s, int o)
{
    int na = panel->na, m = panel->m, a = o % na, closed = panel->active[a];
    const Stop *stop = stop_of(fl, closed);
    const double *F = panel->F + (size_t)a * m;
    const double *depths = (is_round(fl, closed) ? panel->radial : panel->output) + (size_t)a * m;
    double deepest = deepest_of(fl, panel, a), strongest = largest_of(fl, panel, panel->F, a);
    if (o >= na && is_let_go(fl, closed)) return true; /* its slope is infinite at the start */
    if (disc_of(fl, panel, a) >= 0) {
        strongest = show_disc_force(fl, panel, a, s->inner);
        F = s->inner;
        double share = legendre_tail(tab, F) / larger(strongest, TINY);
        if (kind != 0 && share * disc_kick(fl, panel, a, h) <= squared(fl->tail)) return true;
    }
    if (deepest <= 10.0 * noise[a]) return true;
    if (o < na && singular_slope(fl, closed) && nearly_opens(tab, kind, depths, 10.0 * noise[a]))
        return false;
    double goal = panel->decay[a] <= DECAY || is_disc(fl, closed) ? fl->tail : DAMPED_TAIL * fl->tail; /* hold_speeds */
    if (1.0 < stop->exponent && stop->exponent < ROUND) goal *= SHARP_TAIL;
    if (is_held(fl, closed) || holds_around(fl, closed)) goal *= REST_TAIL;
    double floor = BLIND * noise[a] / deepest;
    double tail = larger(goal * fl->tail / s->forced[a], floor);
    double shake = 0.0; /* of the force by rounding: terms of a bond cancel where it is at rest */
    if (is_bond(fl, closed)) shake = BLIND * noise[a] * largest(panel->slope + (size_t)a * m, m);
    if (o < na && na < panel->outputs)
        shake += BLIND * noise[na + a] * largest(panel->slope + (size_t)(na + a) * m, m);
    if (o < na && 2 * na < panel->outputs) /* accelerations cancel, too, where a force keeps one */
        shake += BLIND * noise[2 * na + a] *
                 largest_of(fl, panel, panel->slope + (size_t)(2 * na) * m, a);
    if (o < na && legendre_tail(tab, F) > tail * strongest + shake) return false;
    shake *= stop->exponent / deepest * largest(tab->slope + (size_t)kind * m, m);
    Value slopes = slope_tail(fl, tab, panel, s->slopes, o);
    if (o >= na && disc_of(fl, panel, a) >= 0 && is_hard_disc(fl, closed))
        shake = BLIND * noise[o] * slopes.slope / slowest_over(fl, panel, a);
    double size = slopes.slope, fastest = largest_of(fl, panel, panel->output + (size_t)(o - a) * m, a);
    if (o >= na && fastest > 0.0) /* by speed: its share in the force counts */
        size = larger(size, strongest / fastest);
    double kick = 1.0;
    if (o < na && !is_held(fl, closed)) {
        kick = KICK * stop->mobility * largest_of(fl, panel, panel->slope + (size_t)(o - a) * m, a);
        kick = larger(kick * h / fl->omega, 1.0);
    }
    tail = larger(goal * fl->tail / (s->swayed[a] * sqrt(kick)), floor);
    return !(slopes.value > 4.0 * (tail * size + shake));
}

/* Whether the Legendre tails of each force and of its slopes are small beside their largest.
 *
 * Where the rate of penetration comes close to one without force, its rounding is all there is to
 * see. A slope counts as it does in the sensitivities: times dχ/ds. Where contacts are short
 * against the period, it kicks them to many times their final size, and its error, the square of
 * the tail, with them. What a force or a slope does over a panel is off by the product of its tail
 * and that of the response to it, or of the response's square. */
static bool resolved(const Flow *fl, const Gauss *tab, int kind, double h, const double *noise,
                     Panel *panel, Scratch *s)
{
    if (sways_unseen(fl, tab, kind, h, panel)) return false;
    const double *stretch = tab->slope + (size_t)kind * panel->m;
    for (int o = 0; o < panel->outputs * (panel->round ? 2 : 1); o++)
        for (int i = 0; i < panel->m; i++)
            s->slopes[o * panel->m + i] = panel->slope[o * panel->m + i] * stretch[i];
    fill_response_tails(fl, tab, panel, s);
    for (int o = 0; o < panel->orders * panel->na; o++)
        if (!output_resolved(fl, tab, kind, h, noise, panel, s, o)) return false;
    return true;
}

/* whether a panel shows what each stop damps, or nothing is left of it; fills `decay` */
static bool shows_decay(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel)
{
    int na = panel->na, m = panel->m;
    bool shown = true;
    if (panel->orders == 1) return true; /* nothing damps */
    for (int o = na; o < panel->outputs && o < 2 * na; o++) {
        int a = o - na;
        double total = 0.0, mobility = stop_of(fl, panel->active[a])->mobility;
        for (int i = 0; i < m; i++)
            total += h * tab->weights[kind * m + i] * (mobility * panel->slope[o * m + i]);
        if (disc_of(fl, panel, a) == panel->active[a])
            total = forgotten(fl, tab, kind, h, panel, a);
        panel->decay[a] = total;
        bool faded = panel->decayed[a] > FADED && !is_planar(fl, panel->active[a]);
        shown = shown && (total <= DECAY || faded);
    }
    return shown;
}

/* fraction of the panel that belongs to the stretched time s (see `gauss.time_map`) */
static double map_fraction(const Gauss *tab, int kind, double s)
{
    bool square = tab->power == 2;
    if (kind == 0) return s;
    if (kind == 1) {
        double left = (1.0 - s) * (1.0 - s);
        return 1.0 - (square ? left : left * left);
    }
    if (kind == 2) return square ? s * s : s * s * s * s;
    if (square) return 0.5 - 0.5 * cos(PI * s);
    return s * s * s * s * (35.0 - s * (84.0 - s * (70.0 - 20.0 * s)));
}

/* polynomial through the values at 0, the nodes and 1, at s (barycentric formula) */
static double interpolate(const Gauss *tab, const double *values, double s)
{
    double top = 0.0, bottom = 0.0;
    for (int j = 0; j < tab->m + 2; j++) {
        double away = s - tab->ends_nodes[j];
        if (away == 0.0) return values[j];
        double weight = tab->barycentric[j] / away;
        top += weight * values[j];
        bottom += weight;
    }
    return top / bottom;
}

/* how low (value) the polynomial through `values` is between three places, and where (slope) */
static Value minimum_beside(const Gauss *tab, const double *values, const double *places,
                            const double *heights)
{
    double here = places[1], height = heights[1], left = places[0], right = places[2];
    double below = heights[0], above = heights[2];
    for (int i = 0; i < 3; i++) {
        if (!(left < here && here < right)) break;
        Value at = parabola(left - here, right - here, below, height, above);
        if (!(at.slope > 0.0)) break;
        double reach = REACH * (right - left);
        here = smaller(larger(here - 0.5 * at.value / at.slope, left), right);
        left = larger(here - reach, places[0]);
        right = smaller(here + reach, places[2]);
        height = interpolate(tab, values, here);
        below = interpolate(tab, values, left);
        above = interpolate(tab, values, right);
    }
    return (Value){height, here};
}

/* fill the polynomial through `values` on a grid four times as fine as the nodes */
static void refine(const Gauss *tab, const double *values, double *fine)
{
    int n = (int)tab->n_fine;
    combine(fine, NULL, n, tab->to_fine, n, values, 1, (int)tab->m + 2);
}

/* where a polynomial that is `above` at `low` and negative at `high` changes its sign */
static double refined_root(const Gauss *tab, const double *values, double low, double above,
                           double high)
{
    double under = interpolate(tab, values, high);
    for (int step = 0; step < 60; step++) {
        double middle = 0.5 * (low + high);
        if (step % 3 != 2) middle = low + (high - low) * above / (above - under);
        double value = interpolate(tab, values, middle);
        if (value > 0.0) {
            low = middle;
            above = value;
        } else {
            high = middle;
            under = value;
        }
        if (high - low <= PLACED * high || value == 0.0) break;
    }
    return high;
}

/* first s at which the polynomial through `values` falls below -noise, at its end edge, or 2; it
 * is looked at on the fine grid, and at the minima between */
static double first_root(const Gauss *tab, const double *values, const double *fine, double noise,
                         double edge)
{
    const double *grid = tab->fine_grid;
    int n = (int)tab->n_fine;
    for (int i = 1; i < n; i++) {
        double below = -1.0;
        if (fine[i] < (i < n - 1 ? -noise : edge)) {
            below = grid[i];
        } else if (i < n - 1 && fine[i - 1] >= fine[i] && fine[i] <= fine[i + 1] &&
                   fine[i] < 0.5 * larger(fine[i - 1], fine[i + 1])) { /* near zero in between */
            Value bottom = minimum_beside(tab, values, grid + i - 1, fine + i - 1);
            if (bottom.value < -noise) below = bottom.slope;
        }
        if (below < 0.0) continue;
        int last = i - 1;
        while (last > 0 && fine[last] <= 0.0) last--;
        if (fine[last] <= 0.0) return 0.5 * below;
        return refined_root(tab, values, grid[last], fine[last], below);
    }
    return 2.0;
}

/* Where the polynomial through `values` first dips to zero within an error, or 2. Beside a switch
 * at an end of the panel, where the value is rounding, it must have left that band before and
 * leave it behind. */
static double first_doubt(const Gauss *tab, const double *values, const double *fine,
                          double rounding, double error)
{
    int last = (int)tab->n_fine - 1;
    double where = 2.0, lowest = fine[0], highest = fine[0];
    for (int i = 1; i <= last; i++) {
        lowest = smaller(lowest, fine[i]);
        highest = larger(highest, fine[i]);
    }
    if (lowest > CLEAR * highest) return 2.0; /* not near zero between the places either */
    bool came = fine[0] > 100.0 * rounding;
    for (int i = 1; i <= last; i++) {
        came = came || fine[i - 1] > 10.0 * error;
        if (came && where > 1.0 && i > 1 && fine[i - 2] > fine[i - 1] && fine[i - 1] <= fine[i]) {
            Value bottom = minimum_beside(tab, values, tab->fine_grid + i - 2, fine + i - 2);
            if (fabs(bottom.value) <= error) where = bottom.slope;
        }
        bool left_behind =
            fine[i] > 10.0 * error || (i == last && fine[i] > 100.0 * rounding);
        if (where <= 1.0 && left_behind) return where;
    }
    return 2.0;
}
