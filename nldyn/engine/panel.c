/* One panel of a contact: the Volterra equation of the forces at its Gauss nodes.
 *
 * The modes see one scalar force per stop, so the penetrations at the nodes of a panel satisfy
 *
 *     δ_a(t_i) = free_a(t_i) - Σ_b Σ_j h W_ij K_ab(t_i - t_j) F_b(t_j),
 *
 * K being the impulse response between two stops, and so do their rates if a force depends on
 * them. Newton's matrix for the forces also gives all sensitivities. The end state is a Gauss
 * quadrature: order 2m with m nodes. */
#include "engine.h"

#define SETTLED 1e-10 /* of the largest force: its difference from that of its own penetration */
#define SOLVED 1e-13  /* relative change of the penetrations that Newton's method would still make */
#define SLOWEST 1e-3  /* 1 - rate of its convergence, at least, in the estimate of that */
#define STALE 0.1     /* rate from which its matrix is factored anew */

/* make the panel an empty one for some closed stops */
static void renew_panel(const Flow *fl, Panel *panel, const int *active, int na)
{
    panel->na = na;
    panel->outputs = na;
    for (int a = 0; a < na; a++) {
        panel->active[a] = active[a];
        if (needs_speed(fl, active[a])) panel->outputs = 2 * na;
    }
    for (int i = 0; i < panel->outputs * panel->m; i++) panel->output[i] = 0.0;
    for (int a = 0; a < na; a++) panel->decayed[a] = panel->decay[a] = 0.0;
    panel->kept = false;
    panel->made_kind = -1;
    panel->made_length = 0.0;
}

static bool same_stops(const Panel *panel, const int *active, int na)
{
    if (panel->na != na) return false;
    for (int a = 0; a < na; a++)
        if (panel->active[a] != active[a]) return false;
    return true;
}

/* which row of a stop an output of a panel is: a rigid stop's is its acceleration */
static int output_order(const Flow *fl, int stop, int rate)
{
    return rate == 0 && is_rigid(fl, stop) ? 2 : rate;
}

/* speed that a unit impulse at another stop takes from the closing of a stop's gap, in 1/kg */
static double between(const Flow *fl, int stop, int other)
{
    double mobility = 0.0;
    const double *row = row_of(fl, 1, stop), *push = push_of(fl, other);
    for (int k = 0; k < fl->size; k++) mobility += row[k] * push[k];
    return mobility;
}

/* fill the columns of a block in to, rise and back at node i */
static void fill_block_responses(const Flow *fl, Panel *panel, int b, int i, const ThereAndBack *e)
{
    int na = panel->na, m = panel->m, size = fl->size, j = 2 * b;
    Square there = e->there, back = e->back;
    for (int o = 0; o < panel->outputs; o++) {
        int stop = panel->active[o % na];
        const double *row = row_of(fl, output_order(fl, stop, o / na), stop);
        double x = row[j], y = row[j + 1], *to = panel->to + ((size_t)o * m + i) * size + j;
        to[0] = x * there.a + y * there.c;
        to[1] = x * there.b + y * there.d;
        if (o < na) {
            double *rise = panel->rise + ((size_t)o * m + i) * size + j;
            rise[0] = x * e->less_a + y * there.c;
            rise[1] = x * there.b + y * e->less_d;
        }
    }
    for (int a = 0; a < na; a++) {
        const double *push = push_of(fl, panel->active[a]) + j;
        double *into = panel->back + ((size_t)a * size + j) * m + i;
        into[0] = back.a * push[0] + back.b * push[1];
        into[m] = back.c * push[0] + back.d * push[1];
    }
}

/* fill G from `to` and `back` */
static void fill_influences(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel,
                            Scratch *s)
{
    int na = panel->na, m = panel->m, width = na * m;
    const double *integrate = tab->integrate + (size_t)kind * m * m;
    for (int o = 0; o < panel->outputs; o++)
        for (int a = 0; a < na; a++) {
            multiply(fl->watch, panel->to + (size_t)o * m * fl->size,
                     panel->back + (size_t)a * fl->size * m, s->product, m, fl->size, m);
            double *G = panel->G + (size_t)o * m * width + a * m;
            for (int i = 0; i < m; i++)
                for (int j = 0; j < m; j++)
                    G[(size_t)i * width + j] = h * integrate[i * m + j] * s->product[i * m + j];
            if (o < na && a != o && is_rigid(fl, panel->active[o])) { /* what acts at once */
                double kick = between(fl, panel->active[o], panel->active[a]);
                for (int i = 0; i < m; i++) G[(size_t)i * width + i] += kick;
            }
        }
}

/* fill what a panel of length h needs to know of the linear part: to, rise, back and G */
static void panel_responses(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel,
                            Scratch *s)
{
    int m = panel->m;
    if (panel->made_kind == kind && panel->made_length == h) return;
    panel->made_kind = kind;
    panel->made_length = h;
    double *decay = s->waves, *less = decay + m, *sine = less + m, *cosine = sine + m;
    for (int i = 0; i < m; i++) s->times[i] = h * tab->chi[kind * m + i];
    for (int b = 0; b < fl->n; b++) {
        const double *block = block_of(fl, b);
        double rate = fill_swings(block, s->times, m, decay, less, sine, cosine);
        for (int i = 0; i < m; i++) {
            ThereAndBack e = rate > 0.0 ? swung_there_and_back(block, rate, less[i], decay[i],
                                                               sine[i], cosine[i])
                                        : there_and_back(block, s->times[i]);
            fill_block_responses(fl, panel, b, i, &e);
        }
    }
    fill_influences(fl, tab, kind, h, panel, s);
}

/* fill the panel's outputs at the nodes (outputs m,) without contact forces; penetrations are what
 * they were at the start of the panel, and their changes */
static void free_outputs(const Flow *fl, const Gauss *tab, int kind, double phase, const double *w,
                         double h, const Panel *panel, double *free)
{
    int na = panel->na, m = panel->m, size = fl->size;
    double omega = fl->omega;
    Complex start = turned(phase);
    for (int i = 0; i < m; i++) {
        double t = h * tab->chi[kind * m + i];
        Complex swing = swung(start, omega * t), turn = sum(start, swing);
        for (int o = 0; o < panel->outputs; o++) {
            int stop = panel->active[o % na], order = output_order(fl, stop, o / na);
            Complex steady = forced_of(fl, 0, 0, stop);
            double value;
            const double *row = panel->to + ((size_t)o * m + i) * size;
            if (order == 2) {
                value = -omega * omega * product(steady, turn).re;
            } else if (order == 0) {
                value = panel->depth[o] + product(steady, swing).re;
                row = panel->rise + ((size_t)o * m + i) * size;
            } else {
                value = -omega * product(steady, turn).im;
            }
            for (int k = 0; k < size; k++) value += row[k] * w[k];
            if (fl->n_terms > 0) {
                if (order == 0) {
                    value += swollen(fl, stop, phase, t);
                } else {
                    Course more = swelling(fl, stop, phase + omega * t);
                    value += order == 1 ? more.first : more.second;
                }
            }
            free[o * m + i] = value;
        }
    }
}

/* fill F from the outputs at the nodes, and its derivatives into `slope` */
static void panel_forces(const Flow *fl, Panel *panel, double *slope)
{
    int na = panel->na, m = panel->m;
    bool rates = panel->outputs > na;
    for (int a = 0; a < na; a++)
        for (int i = 0; i < m; i++) {
            double speed = rates ? panel->output[(na + a) * m + i] : 0.0;
            Force f = closed_law(fl, panel->active[a], panel->output[a * m + i], speed);
            panel->F[a * m + i] = f.force;
            slope[a * m + i] = f.stiffness;
            if (rates) slope[(na + a) * m + i] = f.viscosity;
        }
}

/* factor the matrix 1 + slope G */
static void factor_panel(Panel *panel)
{
    int width = panel->na * panel->m;
    for (int p = 0; p < width; p++) {
        double *row = panel->factors + (size_t)p * width;
        const double *G = panel->G + (size_t)p * width;
        for (int q = 0; q < width; q++) row[q] = panel->slope[p] * G[q];
        if (panel->outputs > panel->na) {
            const double *rates = panel->G + (size_t)(width + p) * width;
            for (int q = 0; q < width; q++) row[q] += panel->slope[width + p] * rates[q];
        }
        row[p] += 1.0;
    }
    lu_factor(panel->factors, width, panel->order);
}

/* output p at its node: what is free minus what the forces (na m,) take away */
static inline double less_forced(const Panel *panel, const double *free, const double *force,
                                 int p)
{
    int width = panel->na * panel->m;
    double total = free[p];
    const double *G = panel->G + (size_t)p * width;
    for (int q = 0; q < width; q++) total -= G[q] * force[q];
    return total;
}

/* fill the rates of the outputs with what the guessed penetrations lead to without them */
static void guess_rates(const Flow *fl, Panel *panel, Scratch *s)
{
    int width = panel->na * panel->m, count = panel->outputs * panel->m;
    for (int p = width; p < count; p++) panel->output[p] = 0.0;
    panel_forces(fl, panel, s->new_slope);
    for (int p = 0; p < width; p++) s->solved[p] = panel->F[p];
    for (int p = width; p < count; p++)
        panel->output[p] = less_forced(panel, s->free, s->solved, p);
}

/* rounding error of stop a's force at node i by what all forces (na m,) have moved so far */
static double rounded_force(const Panel *panel, const double *force, int a, int i)
{
    int width = panel->na * panel->m;
    double error = 0.0;
    for (int o = a; o < panel->outputs; o += panel->na) {
        double moved = 0.0;
        const double *G = panel->G + (size_t)(o * panel->m + i) * width;
        for (int p = 0; p < width; p++) moved += fabs(G[p] * force[p]);
        error += SUM_ROUNDING * moved * fabs(panel->slope[o * panel->m + i]);
    }
    return error;
}

/* whether the forces (na m,) are those of the penetrations that they lead to */
static bool consistent(const Panel *panel, const double *force, const double *noise)
{
    int na = panel->na, m = panel->m;
    for (int a = 0; a < na; a++) {
        double allowed = SETTLED * largest(panel->F + (size_t)a * m, m);
        for (int o = a; o < panel->outputs; o += na)
            allowed += 10.0 * noise[o] * largest(panel->slope + (size_t)o * m, m);
        for (int i = 0; i < m; i++) {
            double off = fabs(panel->F[a * m + i] - force[a * m + i]);
            if (off > allowed && off > allowed + rounded_force(panel, force, a, i)) return false;
        }
    }
    return true;
}

/* take a Newton step of the forces (na m,) */
static void step_forces(Panel *panel, Scratch *s, int iteration)
{
    int width = panel->na * panel->m;
    for (int p = 0; p < width; p++) {
        if (iteration > 0) {
            s->step[p] = panel->F[p] - s->solved[p];
        } else {
            s->solved[p] = panel->F[p];
            s->step[p] = 0.0;
        }
    }
    if (iteration == 0) /* the guess is not what its forces lead to */
        for (int p = 0; p < panel->outputs * panel->m; p++) {
            double off = less_forced(panel, s->free, s->solved, p) - panel->output[p];
            s->step[p % width] += panel->slope[p] * off;
        }
    lu_apply_vector(panel->factors, width, panel->order, s->step);
    for (int p = 0; p < width; p++) s->solved[p] += s->step[p];
}

/* put the outputs that the forces lead to in their place; their largest relative change beyond
 * `noise`, or nan */
static double renew_outputs(Panel *panel, const Scratch *s, const double *noise)
{
    int m = panel->m;
    double change = 0.0;
    for (int o = 0; o < panel->outputs; o++) {
        double scale = 0.0, longest = 0.0, total = 0.0;
        for (int i = 0; i < m; i++) {
            double *output = panel->output + o * m + i;
            double value = less_forced(panel, s->free, s->solved, o * m + i);
            scale = larger(scale, fabs(*output));
            longest = larger(longest, fabs(value - *output));
            total += value;
            *output = value;
        }
        if (!isfinite(total)) return NAN; /* a maximum may pass over nan */
        if (o < panel->na && longest > noise[o]) change = larger(change, longest / scale);
    }
    return change;
}

/* Newton's method for the forces at the nodes; the penetrations in `output` are the guess.
 *
 * noise (outputs,) is the rounding error to expect in each output. Returns whether it converged,
 * with the panel filled. The factors of its matrix serve as long as they bring an error down
 * tenfold per step, also those that the call before has left. */
static bool solve_panel(const Flow *fl, const Gauss *tab, int kind, double phase, const double *w,
                        double h, const double *noise, Panel *panel, Scratch *s)
{
    int count = panel->outputs * panel->m;
    panel_responses(fl, tab, kind, h, panel, s);
    free_outputs(fl, tab, kind, phase, w, h, panel, s->free);
    if (panel->outputs > panel->na) guess_rates(fl, panel, s);
    double before = INFINITY;
    for (int iteration = 0; iteration < 60; iteration++) {
        panel_forces(fl, panel, s->new_slope);
        bool fresh = !panel->kept;
        if (fresh) {
            for (int p = 0; p < count; p++) panel->slope[p] = s->new_slope[p];
            factor_panel(panel);
            panel->kept = true;
        }
        step_forces(panel, s, iteration);
        double change = renew_outputs(panel, s, noise);
        if (isnan(change)) break;
        /* the error left: goes with the square after a step with a fresh matrix, else linearly;
         * nothing moves where forces are too weak to: they may still not be the penetrations' */
        double rate = change > 0.0 ? change / before : 0.0;
        double left = fresh ? change * change : change * rate / larger(1.0 - rate, SLOWEST);
        if (left <= SOLVED && (fresh || before < INFINITY || change == 0.0)) {
            panel_forces(fl, panel, panel->slope);
            if (consistent(panel, s->solved, noise)) return true;
            rate = 1.0; /* that estimate trusts in the order of convergence */
        }
        if (rate > STALE) panel->kept = false;
        before = change;
    }
    panel->kept = false;
    return false;
}
