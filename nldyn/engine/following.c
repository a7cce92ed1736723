/* Friction that follows: forces of a panel that are linear in the others are no unknowns of it.
 *
 * Of what slides by one coefficient, T = ±μ N: N acts along a direction of its own, n ± μ t. What
 * sticks, behind a spring or not, has a force in proportion to its own output, T = κ (free + G_tt T
 * + G_tn N), so that
 *
 *     T = base + share N,  base = K⁻¹ κ free,  share = K⁻¹ κ G_tn,  K = 1 - κ G_tt,
 *
 * where K and the share depend on the kind and length of the panel alone. What is left, the forces
 * that are sought, has the equations of a panel without friction. */
#include "engine.h"

/* whether a slider's force follows from those of the stops, or may */
static bool may_follow(const Flow *fl, int s)
{
    if (!is_slider(fl, s)) return false;
    if (fl->slides[s] == 0) return true;
    return !is_disc(fl, s) && is_pressed(fl, s) && stop_of(fl, s)->fading == 0.0;
}

/* whether the force at a place among the closed ones is that of a stop times a share */
static bool is_led(const Flow *fl, const Panel *panel, int a)
{
    return a >= panel->sought && fl->slides[panel->active[a]] != 0;
}

static bool any_led(const Panel *panel) { return panel->sought + panel->n_stuck < panel->na; }

/* place of the stop whose force that is, and the share */
static int leader_of(const Flow *fl, const Panel *panel, int a)
{
    return place_of(panel, (int)stop_of(fl, panel->active[a])->normal);
}

static double led_share(const Flow *fl, const Panel *panel, int a)
{
    return friction_at(fl, panel->active[a], 0.0).value;
}

/* force of what sticks over its output: the strain, or the acceleration without that force */
static double stuck_stiffness(const Flow *fl, const Panel *panel, int a)
{
    const Stop *slider = stop_of(fl, panel->active[a]);
    return is_strained(fl, panel->active[a]) ? slider->tangential : 1.0 / slider->mobility;
}

/* Tell which forces of a new panel are sought: the first so many, up to the last that does not
 * follow, and whether they go with rates, too. Where all would follow, all are sought. */
static void find_sought(const Flow *fl, Panel *panel, bool all)
{
    int na = panel->na, sought = na;
    while (sought > 0 && !all && may_follow(fl, panel->active[sought - 1])) sought--;
    panel->sought = sought > 0 ? sought : na;
    panel->orders = panel->outputs / larger_index(na, 1);
    bool rates = panel->sought == na;
    for (int a = 0; a < panel->sought; a++) rates = rates || needs_speed(fl, panel->active[a]);
    if (!rates) panel->orders = 1;
    panel->n_stuck = 0;
    for (int a = panel->sought; a < na; a++) {
        panel->ways[a] = fl->slides[panel->active[a]];
        if (panel->ways[a] == 0) panel->stuck[panel->n_stuck++] = a;
    }
}

/* whether what follows slides as it did when the panel was made */
static bool follows_alike(const Flow *fl, const Panel *panel)
{
    for (int a = panel->sought; a < panel->na; a++)
        if (fl->slides[panel->active[a]] != panel->ways[a]) return false;
    return true;
}

/* whether equations of a panel need an output: those sought, or what sticks */
static bool is_needed(const Flow *fl, const Panel *panel, int o)
{
    int a = o % panel->na, order = o / panel->na;
    if (a < panel->sought) return order < panel->orders;
    return order == 0 && !is_led(fl, panel, a);
}

/* what a force that is sought does to the modes, (2n, m), with the friction that it leads; spare
 * (2n, m) */
static const double *drawn(const Flow *fl, const Panel *panel, int a, double *restrict spare)
{
    size_t count = (size_t)fl->size * panel->m;
    const double *own = panel->back + a * count, *found = own;
    for (int l = panel->sought; l < panel->na; l++) {
        if (!is_led(fl, panel, l) || leader_of(fl, panel, l) != a) continue;
        const double *back = panel->back + l * count;
        double share = led_share(fl, panel, l);
        for (size_t p = 0; p < count; p++) spare[p] = found[p] + share * back[p];
        found = spare;
    }
    return found;
}

/* replace columns (n_stuck m,), so far apart, by what K⁻¹ κ makes of them; scaled (n_stuck m,) is
 * scratch */
static void loosen(const Flow *fl, const Panel *panel, double *columns, int n_columns,
                   double *scaled)
{
    int m = panel->m, width = panel->n_stuck * m;
    for (int c = 0; c < n_columns; c++) {
        double *column = columns + (size_t)c * width;
        for (int q = 0; q < panel->n_stuck; q++) {
            double stiffness = stuck_stiffness(fl, panel, panel->stuck[q]);
            for (int i = 0; i < m; i++) scaled[q * m + i] = stiffness * column[q * m + i];
        }
        combine(column, NULL, width, panel->loose, padded(width), scaled, 1, width);
    }
}

/* Take what sticks out of the equations: `loose` has been filled with G of its own forces, `share`
 * with that of those sought, `reach` and G with what both do to the outputs of these. */
static void take_stuck_out(const Flow *fl, Panel *panel, Scratch *s)
{
    int m = panel->m, width = panel->n_stuck * m, pad = padded(width);
    int columns = panel->sought * m, height = panel->orders * columns;
    if (width == 0) return;
    for (int p = 0; p < width; p++) {
        double *column = panel->loose + (size_t)p * pad;
        for (int q = 0; q < width; q++)
            column[q] *= -stuck_stiffness(fl, panel, panel->stuck[q / m]);
        for (int q = width; q < pad; q++) column[q] = 0.0;
        column[p] += 1.0;
    }
    invert(panel->loose, width, panel->order);
    loosen(fl, panel, panel->share, columns, s->step);
    for (int c = 0; c < columns; c++) {
        double *G = panel->G + (size_t)c * height;
        const double *share = panel->share + (size_t)c * width;
        combine(s->led, G, height, panel->reach, height, share, 1, width);
        memcpy(G, s->led, sizeof(double) * height);
    }
}

/* add to outputs sought, of the orders of the panel, what forces (n_stuck m,) do to them */
static void add_reach(const Panel *panel, const double *force, double *outputs, double *spare)
{
    int width = panel->n_stuck * panel->m, count = panel->sought * panel->m;
    for (int order = 0; order < panel->orders; order++) {
        double *output = outputs + (size_t)order * panel->na * panel->m;
        combine(spare, output, count, panel->reach + order * count,
                (size_t)panel->orders * count, force, 1, width);
        memcpy(output, spare, sizeof(double) * count);
    }
}

/* fill the base of what sticks from its free outputs, and let it act on those sought */
static void fill_base(const Flow *fl, Panel *panel, Scratch *s)
{
    int m = panel->m;
    if (panel->n_stuck == 0) return;
    for (int q = 0; q < panel->n_stuck; q++)
        memcpy(panel->base + q * m, s->free + panel->stuck[q] * m, sizeof(double) * m);
    loosen(fl, panel, panel->base, 1, s->step);
    add_reach(panel, panel->base, s->free, s->led);
}

/* fill F of what follows by that of the forces sought, and the outputs of what sticks */
static void fill_following(const Flow *fl, Panel *panel, Scratch *s)
{
    int m = panel->m, width = panel->n_stuck * m;
    if (width > 0)
        combine(s->led, panel->base, width, panel->share, width, panel->F, 1, panel->sought * m);
    for (int q = 0; q < panel->n_stuck; q++) {
        int a = panel->stuck[q];
        double stiffness = stuck_stiffness(fl, panel, a);
        for (int i = 0; i < m; i++) {
            panel->F[a * m + i] = s->led[q * m + i];
            panel->output[a * m + i] = s->led[q * m + i] / stiffness;
        }
    }
    for (int a = panel->sought; a < panel->na; a++) {
        if (!is_led(fl, panel, a)) continue;
        const double *from = panel->F + (size_t)leader_of(fl, panel, a) * m;
        double share = led_share(fl, panel, a);
        for (int i = 0; i < m; i++) panel->F[a * m + i] = share * from[i];
    }
}

/* fill the slopes of what follows, and those by rates that no force goes with */
static void fill_following_slopes(const Flow *fl, const Panel *panel, double *slope)
{
    int na = panel->na, m = panel->m;
    if (panel->sought == na) return; /* and all orders */
    for (int o = 0; o < panel->outputs; o++) {
        int a = o % na, order = o / na;
        if (a < panel->sought && order < panel->orders) continue;
        bool sticks = order == 0 && a >= panel->sought && !is_led(fl, panel, a);
        double value = sticks ? stuck_stiffness(fl, panel, a) : 0.0;
        for (int i = 0; i < m; i++) slope[o * m + i] = value;
    }
}
