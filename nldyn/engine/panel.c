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
#define LARGEST_ANGLE 1e5 /* that `fill_sines` is left to */
#define ROUGH 3       /* steps in which the turning of friction over a plane is not led by forces */
#define MOST_TURNS 12  /* steps in which what slides over a plane settles: else it goes to and fro */
#define LEAVING 6      /* rounds of the guess of how what is let go over a plane leaves */
#define STALE 0.1     /* rate from which its matrix is inverted anew */

static bool solve_many(const Flow *fl, const Gauss *tab, const double *noise, Panel *panel,
                       Scratch *s);

/* fill how a complex number of length one has turned, from a phase on, at the nodes of a panel, to
 * its own precision: real and imaginary parts (2, m); angles (m,) is scratch */
static void fill_turns(const Flow *fl, const Gauss *tab, int kind, double phase, double angle,
                       double *angles, double *restrict turns)
{
    int m = (int)tab->m;
    const double *chi = tab->chi + (size_t)kind * m;
    Complex start = turn_at(fl, phase);
    double *restrict sine = turns, *restrict cosine = turns + m;
    for (int i = 0; i < m; i++) angles[i] = 0.5 * angle * chi[i];
    if (angle < LARGEST_ANGLE)
        fill_sines(angles, sine, cosine, m);
    else
        for (int i = 0; i < m; i++) {
            sine[i] = sin(angles[i]);
            cosine[i] = cos(angles[i]);
        }
    for (int i = 0; i < m; i++) { /* the start times e^{2i angle} - 1 */
        double re = -2.0 * sine[i] * sine[i], im = 2.0 * sine[i] * cosine[i];
        turns[i] = start.re * re - start.im * im;
        turns[m + i] = start.re * im + start.im * re;
    }
}

/* fill an output (m,) without contact forces at the nodes, see `free_outputs`; forced (m,) is
 * scratch */
static void free_output_at_nodes(const Flow *fl, double phase, const double *w, double h,
                                 const Panel *panel, int o, const double *chi, const double *turns,
                                 double *forced, double *free)
{
    int na = panel->na, m = panel->m, size = fl->size, stop = panel->active[o % na];
    int order = output_order(fl, stop, o / na);
    double omega = fl->omega;
    Complex steady = forced_of(fl, 0, 0, stop), start = turn_at(fl, phase);
    const double *rows = (order == 0 ? panel->rise : panel->to) + (size_t)o * size * m;
    for (int i = 0; i < m; i++) {
        Complex swing = complex_of(turns[i], turns[m + i]), turn = sum(start, swing);
        if (order == 0)
            forced[i] = panel->depth[o] + product(steady, swing).re;
        else if (order == 1)
            forced[i] = -omega * product(steady, turn).im;
        else
            forced[i] = -omega * omega * product(steady, turn).re;
    }
    combine(free, forced, m, rows, m, w, 1, size);
    for (int i = 0; i < m && fl->n_terms > 0; i++) {
        double t = h * chi[i];
        if (order == 0) {
            free[i] += swollen(fl, stop, phase, t);
        } else {
            Course more = swelling(fl, stop, phase + omega * t);
            free[i] += order == 1 ? more.first : more.second;
        }
    }
}

/* fill the panel's outputs at the nodes (outputs m,) without contact forces; penetrations are what
 * they were at the start of the panel, and their changes */
static void free_outputs(const Flow *fl, const Gauss *tab, int kind, double phase, const double *w,
                         double h, Panel *panel, Scratch *s)
{
    int m = panel->m;
    fill_turns(fl, tab, kind, phase, fl->omega * h, s->times, s->waves);
    for (int o = 0; o < panel->outputs; o++)
        if (is_needed(fl, panel, o))
            free_output_at_nodes(fl, phase, w, h, panel, o, tab->chi + (size_t)kind * m, s->waves,
                                 s->step, s->free + (size_t)o * m);
    fill_base(fl, panel, s);
}

/* that of the one that presses a closed slider on, or -1 */
static int pressing_place(const Flow *fl, const Panel *panel, int a)
{
    int s = panel->active[a];
    if (is_disc(fl, s)) return -1; /* see `add_disc_friction` */
    return is_pressed(fl, s) && fl->slides[s] != 0 ? place_of(panel, (int)stop_of(fl, s)->normal) : -1;
}

/* add to rows of sliders that are sought what they have of the rows of the stops that press them
 * on, in a matrix (na m, n_columns) of how forces change by the outputs; entries of a row, and
 * rows, lie so far apart */
static void add_friction(const Flow *fl, const Panel *panel, double *matrix, int n_columns,
                         size_t entry, size_t row)
{
    int na = panel->na, m = panel->m;
    for (int a = 0; a < panel->sought; a++) {
        add_disc_friction(fl, panel, a, matrix, n_columns, entry, row);
        int normal = pressing_place(fl, panel, a);
        for (int i = 0; i < m && normal >= 0; i++) {
            double share = friction_at(fl, panel->active[a], panel->output[(na + a) * m + i]).value;
            const double *from = matrix + (size_t)(normal * m + i) * row;
            double *to = matrix + (size_t)(a * m + i) * row;
            for (int c = 0; c < n_columns; c++) to[c * entry] += share * from[c * entry];
        }
    }
}

/* fill F that is sought from the outputs at the nodes, and all derivatives into `slope` */
static void panel_forces(const Flow *fl, Panel *panel, double *slope)
{
    int na = panel->na, m = panel->m;
    bool rates = panel->orders > 1;
    for (int a = 0; a < panel->sought; a++) {
        const double *delta = panel->output + (size_t)a * m;
        const double *speed = rates ? panel->output + (size_t)(na + a) * m : NULL;
        double *viscosity = rates ? slope + (size_t)(na + a) * m : NULL;
        if (is_round(fl, panel->active[a])) round_forces(fl, panel, a, slope);
        if (panel->round && partner_of(fl, panel, a) >= 0) continue;
        for (int i = 0; i < m && panel->outputs > 2 * na; i++) slope[(2 * na + a) * m + i] = 0.0;
        closed_laws(fl, panel->active[a], m, delta, speed, panel->F + (size_t)a * m,
                    slope + (size_t)a * m, viscosity);
    }
    for (int a = 0; a < panel->sought; a++) { /* sliders that stops press on come after these */
        int normal = pressing_place(fl, panel, a);
        for (int i = 0; i < m && normal >= 0; i++) {
            Force f = sliding_law(fl, panel->active[a], panel->output[(na + a) * m + i],
                                  panel->F[normal * m + i]);
            panel->F[a * m + i] = f.force;
            slope[(na + a) * m + i] = f.viscosity;
        }
        if (disc_of(fl, panel, a) == panel->active[a]) disc_forces(fl, panel, a, slope);
    }
    fill_following_slopes(fl, panel, slope);
}

/* fill the inverse of the matrix 1 - slope G, unless it is there: slopes of linear laws stay; what
 * depends on speeds may depend on more */
static void invert_panel(const Flow *fl, Panel *panel)
{
    int na = panel->na, m = panel->m, width = panel->sought * m, height = panel->orders * width;
    int pad = padded(width);
    const double *slope = panel->slope;
    bool same = height == width && !panel->round;
    for (int p = 0; p < height && same; p++) same = slope[p] == panel->inverted[p];
    if (same) return;
    memcpy(panel->inverted, slope, sizeof(double) * width);
    for (int q = 0; q < width; q++) {
        double *restrict column = panel->inverse + (size_t)q * pad;
        const double *G = panel->G + (size_t)q * height;
        for (int p = 0; p < width; p++) column[p] = -slope[p] * G[p];
        for (int order = 1; order < panel->orders; order++)
            for (int p = 0; p < width; p++)
                column[p] -= slope[order * na * m + p] * G[order * width + p];
        for (int p = width; p < pad; p++) column[p] = 0.0;
    }
    for (int row = 0; row < panel->orders * panel->sought; row++) {
        int o = row / panel->sought * na + row % panel->sought;
        const double *G = panel->G + row * m;
        add_crossed(fl, panel, o, -1.0, G, height, 1, panel->inverse, pad, 1, width);
        add_tilted(fl, panel, o, -1.0, G, height, 1, panel->inverse, pad, 1, width);
    }
    add_friction(fl, panel, panel->inverse, width, pad, 1);
    for (int q = 0; q < width; q++) panel->inverse[(size_t)q * pad + q] += 1.0;
    invert(panel->inverse, width, panel->order);
}

/* fill the outputs sought at the nodes, from an order on: what is free and what the forces sought
 * add */
static void with_forces(const Panel *panel, const double *free, const double *force, int first,
                        double *output)
{
    int width = panel->sought * panel->m;
    size_t height = (size_t)panel->orders * width, stride = (size_t)panel->na * panel->m;
    for (int order = first; order < panel->orders; order++)
        combine(output + order * stride, free + order * stride, width,
                panel->G + (size_t)order * width, height, force, 1, width);
}

/* fill the force that presses what slides on, by the penetrations of its stop, and its derivatives */
static void press_again(const Flow *fl, Panel *panel, int a, double *slope)
{
    int na = panel->na, m = panel->m, s = panel->active[a];
    if (!is_pressed(fl, s)) return;
    int normal = place_of(panel, (int)stop_of(fl, s)->normal);
    double *speed = panel->output + (size_t)(na + normal) * m;
    closed_laws(fl, panel->active[normal], m, panel->output + (size_t)normal * m, speed,
                panel->F + (size_t)normal * m, slope + (size_t)normal * m,
                slope + (size_t)(na + normal) * m);
}

/* fill the rates of the outputs with what the guessed penetrations lead to without them */
static void guess_rates(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel,
                        Scratch *s)
{
    int width = panel->na * panel->m, count = panel->outputs * panel->m;
    for (int p = width; p < count; p++) panel->output[p] = 0.0;
    panel_forces(fl, panel, s->new_slope);
    with_forces(panel, s->free, panel->F, 1, panel->output);
    for (int a = 0; a < panel->na; a++) {
        if (!is_let_go(fl, panel->active[a]) || is_mate(fl, panel->active[a])) continue;
        for (int round = 0; round < LEAVING; round++) {
            press_again(fl, panel, a, s->new_slope);
            guess_leaving(fl, tab, kind, h, panel, a);
            with_forces(panel, s->free, panel->F, 0, panel->output);
        }
    }
}

/* rounding error of stop a's force at node i by what all forces (na m,) have moved so far */
static double rounded_force(const Flow *fl, const Panel *panel, const double *force, int a, int i)
{
    int na = panel->na, width = panel->sought * panel->m, height = panel->orders * width;
    double error = 0.0;
    if (panel->many) { /* without influences: by what the outputs are */
        for (int o = a; o < panel->outputs; o += na)
            error += BLIND * SUM_ROUNDING * fabs(panel->output[o * panel->m + i] *
                                                 panel->slope[o * panel->m + i]);
        return error;
    }
    int partner = panel->round ? partner_of(fl, panel, a) : -1;
    for (int row = 0; row < panel->orders * panel->sought; row++) {
        int o = row / panel->sought * na + row % panel->sought;
        if (o % na != a && o % na != partner) continue;
        double moved = 0.0;
        const double *G = panel->G + row * panel->m + i;
        for (int p = 0; p < width; p++) moved += fabs(G[(size_t)p * height] * force[p]);
        double slope = o % na == a ? panel->slope[o * panel->m + i]
                                   : crossed(panel, panel->slope, o, a)[i];
        error += SUM_ROUNDING * moved * fabs(slope);
    }
    return error;
}

/* whether the forces (na m,) are those of the penetrations that they lead to */
static bool consistent(const Flow *fl, const Panel *panel, const double *force,
                       const double *noise)
{
    int na = panel->na, m = panel->m;
    for (int a = 0; a < panel->sought; a++) {
        double allowed = SETTLED * largest(panel->F + (size_t)a * m, m);
        for (int o = a; o < panel->outputs; o += na)
            allowed += 10.0 * noise[o] * largest(panel->slope + (size_t)o * m, m);
        int partner = panel->round ? partner_of(fl, panel, a) : -1;
        if (partner >= 0) allowed += SETTLED * largest(panel->F + (size_t)partner * m, m);
        for (int o = partner; o >= 0 && o < panel->outputs; o += na)
            allowed += 10.0 * noise[o] * largest(crossed(panel, panel->slope, o, a), m);
        int normal = pressing_place(fl, panel, a);
        for (int o = normal; o >= 0 && o < panel->outputs; o += na)
            allowed += 10.0 * grip(fl, panel->active[a]) * noise[o] *
                       largest(panel->slope + (size_t)o * m, m);
        allowed += disc_noise(fl, panel, a, noise);
        for (int i = 0; i < m; i++) {
            double off = fabs(panel->F[a * m + i] - force[a * m + i]);
            if (off > allowed && off > allowed + rounded_force(fl, panel, force, a, i)) return false;
        }
    }
    return true;
}

/* take a Newton step of the forces (na m,) */
static void step_forces(const Flow *fl, Panel *panel, Scratch *s, int iteration)
{
    int na = panel->na, m = panel->m, width = panel->sought * m;
    for (int p = 0; p < width; p++) {
        if (iteration > 0) {
            s->step[p] = panel->F[p] - s->solved[p];
        } else {
            s->solved[p] = panel->F[p];
            s->step[p] = 0.0;
        }
    }
    if (iteration == 0) { /* the guess is not what its forces lead to */
        with_forces(panel, s->free, s->solved, 0, s->led);
        for (int order = 0; order < panel->orders; order++)
            for (int p = 0; p < width; p++) {
                int place = order * na * m + p;
                s->led[place] -= panel->output[place];
                s->step[p] += panel->slope[place] * s->led[place];
            }
        for (int o = 0; o < panel->outputs; o++) {
            if (o % na >= panel->sought || o / na >= panel->orders) continue;
            add_crossed(fl, panel, o, 1.0, s->led + o * panel->m, 0, 1, s->step, 0, 1, 1);
            add_tilted(fl, panel, o, 1.0, s->led + o * panel->m, 0, 1, s->step, 0, 1, 1);
        }
        add_friction(fl, panel, s->step, 1, 1, 1);
    }
    combine(s->led, s->solved, width, panel->inverse, padded(width), s->step, 1, width);
    memcpy(s->solved, s->led, sizeof(double) * width);
}

/* put the outputs that the forces lead to, s->led, in their place; their largest relative change
 * beyond `noise`, or nan */
static double renew_outputs(const Flow *fl, Panel *panel, const Scratch *s, const double *noise)
{
    int m = panel->m;
    double change = 0.0;
    for (int o = 0; o < panel->outputs; o++) {
        if (o % panel->na >= panel->sought || o / panel->na >= panel->orders) continue;
        double scale = 0.0, longest = 0.0, total = 0.0;
        for (int i = 0; i < m; i++) {
            double *output = panel->output + o * m + i;
            double value = s->led[o * m + i];
            scale = larger(scale, fabs(*output));
            longest = larger(longest, fabs(value - *output));
            total += value;
            *output = value;
        }
        if (!isfinite(total)) return NAN; /* a maximum may pass over nan */
        if (panel->round && o < panel->na) scale = deepest_of(fl, panel, o);
        bool counts = o < panel->na || o >= 2 * panel->na;
        if (counts && longest > noise[o]) change = larger(change, longest / scale);
    }
    return change;
}

/* Newton's method for the forces at the nodes; the penetrations in `output` are the guess.
 *
 * noise (outputs,) is the rounding error to expect in each output. Returns whether it converged,
 * with the panel filled. The inverse of its matrix serves as long as it brings an error down
 * tenfold per step, also that which the call before has left. */
static bool solve_panel(const Flow *fl, const Gauss *tab, int kind, double phase, const double *w,
                        double h, const double *noise, Panel *panel, Scratch *s)
{
    int count = panel->outputs * panel->m * (panel->round ? 2 : 1);
    bool many = is_many(fl, panel);
    if (many != panel->many) panel->made_kind = -1;
    panel->many = many;
    panel_responses(fl, tab, kind, h, panel, s);
    free_outputs(fl, tab, kind, phase, w, h, panel, s);
    if (many) return solve_many(fl, tab, noise, panel, s);
    panel->rough = true;
    if (panel->orders > 1) guess_rates(fl, tab, kind, h, panel, s);
    bool discs = any_disc(fl, panel);
    double before = INFINITY;
    int most = discs ? MOST_TURNS : 60;
    for (int iteration = 0; iteration < most; iteration++) {
        if (iteration % 8 == 7 && interrupted(fl->watch)) break; /* a step of 40 stops takes long */
        panel->rough = discs && iteration < ROUGH;
        if (discs && iteration <= ROUGH) panel->kept = false;
        panel_forces(fl, panel, s->new_slope);
        bool fresh = !panel->kept;
        if (fresh) {
            for (int p = 0; p < count; p++) panel->slope[p] = s->new_slope[p];
            invert_panel(fl, panel);
            panel->kept = true;
        }
        step_forces(fl, panel, s, iteration);
        with_forces(panel, s->free, s->solved, 0, s->led);
        double change = renew_outputs(fl, panel, s, noise);
        if (isnan(change)) break;
        /* the error left: goes with the square after a step with a fresh matrix, else linearly;
         * nothing moves where forces are too weak to: they may still not be the penetrations' */
        double rate = change > 0.0 ? change / before : 0.0;
        double left = fresh ? change * change : change * rate / larger(1.0 - rate, SLOWEST);
        if (left <= SOLVED && !panel->rough && (fresh || before < INFINITY || change == 0.0)) {
            panel_forces(fl, panel, panel->slope);
            if (consistent(fl, panel, s->solved, noise)) {
                fill_following(fl, panel, s);
                return true;
            }
            rate = 1.0; /* that estimate trusts in the order of convergence */
        }
        if (rate > STALE) panel->kept = false;
        before = change;
    }
    panel->kept = false;
    return false;
}
