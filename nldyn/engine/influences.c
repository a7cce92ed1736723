/* What the modes answer to the forces of a panel: the linear part of its equations, which depends on
 * its kind and length alone. */
#include "engine.h"

#define ALONG 1e-9 /* of the cosine squared: a slider that moves as a stop does */

static bool is_many(const Flow *fl, const Panel *panel);

/* make the panel an empty one for some closed stops */
static void renew_panel(const Flow *fl, Panel *panel, const int *active, int na)
{
    panel->na = na;
    panel->outputs = na;
    panel->round = false;
    for (int a = 0; a < na; a++) {
        panel->active[a] = active[a];
        panel->round = panel->round || is_round(fl, active[a]);
        if (panel->outputs == na && needs_speed(fl, active[a])) panel->outputs = 2 * na;
        if (holds_around(fl, active[a])) panel->outputs = 3 * na;
    }
    for (int i = 0; i < panel->outputs * panel->m; i++) panel->output[i] = 0.0;
    for (int a = 0; a < na; a++) panel->decayed[a] = panel->decay[a] = 0.0;
    find_sought(fl, panel, panel->round || is_many(fl, panel));
    panel->kept = false;
    panel->made_kind = -1;
    panel->inverted[0] = NAN;
    panel->made_length = 0.0;
}

/* whether a panel of some closed stops has the equations that it was made with */
static bool same_stops(const Flow *fl, const Panel *panel, const int *active, int na)
{
    if (panel->na != na) return false;
    for (int a = 0; a < na; a++)
        if (panel->active[a] != active[a]) return false;
    return follows_alike(fl, panel);
}

/* which row of a stop an output of a panel is: of what is held the acceleration */
static int output_order(const Flow *fl, int stop, int rate)
{
    return rate == 0 && is_held(fl, stop) ? 2 : rate;
}

/* whether forces act on an output at once: it is an acceleration, but what holds it does not count */
static bool acts_at_once(const Flow *fl, const Panel *panel, int o, int a)
{
    int stop = panel->active[o % panel->na], other = panel->active[a];
    if (o < panel->na) return is_held(fl, stop) && stop != other;
    if (o < 2 * panel->na || !is_planar(fl, stop)) return false;
    return other != stop && other != partner_row(fl, stop);
}

/* whether a slider moves as another stop does, over a plane in some direction of it */
static bool moves_with(const Flow *fl, int slider, int stop)
{
    double own = stop_of(fl, stop)->mobility, first = between(fl, slider, stop), B[3];
    if (!is_disc(fl, slider))
        return squared(first) >= (1.0 - ALONG) * own * stop_of(fl, slider)->mobility;
    fill_yield(fl, slider, B);
    double second = between(fl, (int)stop_of(fl, slider)->beside, stop);
    double along = B[2] * first * first - 2.0 * B[1] * first * second + B[0] * second * second;
    return along >= (1.0 - ALONG) * own * (B[0] * B[2] - B[1] * B[1]);
}

/* fill the rows of a block in to, rise and back, by its exponentials: there (4, m), back (4, m) and
 * the diagonal of exp(A t) - 1 (2, m) */
static void fill_block_responses(const Flow *fl, Panel *panel, int b, const double *there,
                                 const double *back, const double *less)
{
    int na = panel->na, m = panel->m, size = fl->size, j = 2 * b;
    for (int o = 0; o < panel->outputs; o++) {
        if (!is_needed(fl, panel, o)) continue;
        int stop = panel->active[o % na];
        const double *row = row_of(fl, output_order(fl, stop, o / na), stop);
        double x = row[j], y = row[j + 1];
        double *restrict to = panel->to + ((size_t)o * size + j) * m;
        for (int i = 0; i < m; i++) to[i] = x * there[i] + y * there[2 * m + i];
        for (int i = 0; i < m; i++) to[m + i] = x * there[m + i] + y * there[3 * m + i];
        if (o >= na) continue;
        double *restrict rise = panel->rise + ((size_t)o * size + j) * m;
        for (int i = 0; i < m; i++) rise[i] = x * less[i] + y * there[2 * m + i];
        for (int i = 0; i < m; i++) rise[m + i] = x * there[m + i] + y * less[m + i];
    }
    for (int a = 0; a < na; a++) {
        const double *push = push_of(fl, panel->active[a]) + j;
        double x = push[0], y = push[1];
        double *restrict into = panel->back + ((size_t)a * size + j) * m;
        for (int i = 0; i < m; i++) into[i] = back[i] * x + back[m + i] * y;
        for (int i = 0; i < m; i++) into[m + i] = back[2 * m + i] * x + back[3 * m + i] * y;
    }
}

/* speed that a force and the friction that it leads take from an output at once */
static double kick_of(const Flow *fl, const Panel *panel, int o, int a)
{
    int stop = panel->active[o % panel->na];
    double kick = acts_at_once(fl, panel, o, a) ? between(fl, stop, panel->active[a]) : 0.0;
    for (int l = panel->sought; l < panel->na; l++)
        if (is_led(fl, panel, l) && leader_of(fl, panel, l) == a && acts_at_once(fl, panel, o, l))
            kick += led_share(fl, panel, l) * between(fl, stop, panel->active[l]);
    return kick;
}

/* fill what a force that acts on the modes by `back` (2n, m) adds to an output at the nodes, by the
 * force's nodes, which lie so far apart; product (m, m) is scratch */
static void fill_influence(const Flow *fl, const Gauss *tab, int kind, double h, const Panel *panel,
                           int o, const double *back, double kick, double *restrict G,
                           size_t apart, double *restrict product)
{
    int m = panel->m;
    const double *integrate = tab->integrate + (size_t)kind * m * m;
    multiply_transposed(fl->watch, back, m, panel->to + (size_t)o * fl->size * m, product, m,
                        fl->size, m);
    for (int j = 0; j < m; j++)
        for (int i = 0; i < m; i++)
            G[j * apart + i] = -h * integrate[j * m + i] * product[j * m + i];
    for (int i = 0; i < m && kick != 0.0; i++) G[i * apart + i] -= kick;
}

/* the influences of what acts at a, drawn by `back`, on what is sought and on what sticks */
static void fill_influences_of(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel,
                               int a, const double *back, double *onto, double *onto_stuck,
                               size_t stuck_apart, Scratch *s)
{
    int m = panel->m, sought = panel->sought;
    size_t height = (size_t)panel->orders * sought * m;
    for (int row = 0; row < panel->orders * sought; row++) {
        int o = row / sought * panel->na + row % sought;
        fill_influence(fl, tab, kind, h, panel, o, back, kick_of(fl, panel, o, a), onto + row * m,
                       height, s->product);
    }
    for (int p = 0; p < panel->n_stuck; p++)
        fill_influence(fl, tab, kind, h, panel, panel->stuck[p], back,
                       kick_of(fl, panel, panel->stuck[p], a), onto_stuck + p * m, stuck_apart,
                       s->product);
}

/* fill G from `to` and `back`, without what follows */
static void fill_influences(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel,
                            Scratch *s)
{
    int m = panel->m, n_stuck = panel->n_stuck;
    size_t height = (size_t)panel->orders * panel->sought * m, width = (size_t)n_stuck * m;
    size_t apart = padded((int)width);
    for (int a = 0; a < panel->sought; a++)
        fill_influences_of(fl, tab, kind, h, panel, a, drawn(fl, panel, a, s->driven),
                           panel->G + a * m * height, panel->share + a * m * width, width, s);
    for (int q = 0; q < n_stuck; q++)
        fill_influences_of(fl, tab, kind, h, panel, panel->stuck[q],
                           panel->back + (size_t)panel->stuck[q] * fl->size * m,
                           panel->reach + q * m * height, panel->loose + q * m * apart, apart, s);
    take_stuck_out(fl, panel, s);
}

/* fill what a panel of length h needs to know of the linear part: there, home, to, rise, back,
 * whole and G */
static void panel_responses(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel,
                            Scratch *s)
{
    int m = panel->m;
    if (panel->made_kind == kind && panel->made_length == h) return;
    panel->made_kind = kind;
    panel->made_length = h;
    panel->inverted[0] = NAN;
    panel->weighed = false;
    double *less = s->waves + 4 * m;
    for (int i = 0; i < m; i++) s->times[i] = h * tab->chi[kind * m + i];
    for (int b = 0; b < fl->n; b++) {
        double *there = panel->there + (size_t)4 * b * m, *home = panel->home + (size_t)4 * b * m;
        fill_there_and_back(block_of(fl, b), s->times, m, there, home, less, s->waves);
        fill_block_responses(fl, panel, b, there, home, less);
        Square end = block_exponential(block_of(fl, b), h);
        ThereAndBack swing = there_and_back(block_of(fl, b), h);
        double whole[6] = {end.a, end.b, end.c, end.d, swing.less_a, swing.less_d};
        memcpy(panel->whole + 6 * b, whole, sizeof whole);
    }
    if (!panel->many) fill_influences(fl, tab, kind, h, panel, s);
}
