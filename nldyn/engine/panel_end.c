/* What a panel leads to: the state at its end, its sensitivities, outputs at its nodes. */
#include "engine.h"

/* add to w (2n,) what impulses (na,) in the sense of the gaps change */
static void add_kicks(const Flow *fl, const Panel *panel, const double *kicks, double *w)
{
    for (int a = 0; a < panel->na; a++) {
        const double *push = push_of(fl, panel->active[a]);
        for (int k = 0; k < fl->size; k++) w[k] += push[k] * kicks[a];
    }
}

/* fill and factor the matrix 1 + h viscosity mobility of the closed stops */
static void factor_holding(const Flow *fl, double h, const Panel *panel, Scratch *s)
{
    int na = panel->na;
    for (int a = 0; a < na; a++)
        for (int b = 0; b < na; b++) {
            double mobility = between(fl, panel->active[a], panel->active[b]);
            s->hold_matrix[b * na + a] = (a == b) + h * s->viscosity[a] * mobility;
        }
    lu_factor(s->hold_matrix, na, s->hold_order);
}

/* Correct the end of a panel by the speeds of the stops that damp strongly.
 *
 * An error of such a force is a much smaller one of the speed, by its slope. So the nodes' speeds,
 * and the one at which the law gives the force of the end, are known better than what the forces
 * integrate to. Where several stops damp, they count by how strongly they do. */
static void hold_speeds(const Flow *fl, const Gauss *tab, int kind, double end_phase, double h,
                        Panel *panel, double *w_end, Scratch *s)
{
    int na = panel->na, m = panel->m;
    if (largest(panel->decay, na) <= DECAY) return;
    for (int a = 0; a < na; a++) {
        s->viscosity[a] = s->off[a] = 0.0;
        bool turns = is_planar(fl, panel->active[a]) || is_disc(fl, panel->active[a]);
        if (!(panel->decay[a] > DECAY) || turns) continue;
        double speed = output_now(fl, panel->active[a], w_end, end_phase).first, gained = 0.0;
        s->viscosity[a] = law(fl, panel->active[a], panel->end_depth[a], speed).viscosity;
        for (int i = 0; i < m; i++)
            gained += h * tab->weights[kind * m + i] * panel->output[(na + a) * m + i];
        s->off[a] = h * s->viscosity[a] * (panel->depth[a] + gained - panel->end_depth[a]);
    }
    factor_holding(fl, h, panel, s);
    lu_apply_vector(s->hold_matrix, na, s->hold_order, s->off);
    for (int k = 0; k < fl->size; k++) s->kick[k] = s->shift[k] = 0.0;
    add_kicks(fl, panel, s->off, s->kick);
    add_rates(fl->blocks, fl->n, s->kick, s->shift); /* without the end of a kick in time */
    for (int k = 0; k < fl->size; k++) {
        w_end[k] += s->shift[k];
        for (int a = 0; a < na; a++)
            panel->end_depth[a] += row_of(fl, 0, panel->active[a])[k] * s->shift[k];
    }
    for (int round = 0; round < 2; round++) { /* the slopes are those before the shift */
        for (int a = 0; a < na; a++) {
            s->off[a] = 0.0;
            if (!(s->viscosity[a] > 0.0)) continue;
            double speed = output_now(fl, panel->active[a], w_end, end_phase).first;
            double force = law(fl, panel->active[a], panel->end_depth[a], speed).force;
            s->off[a] = h * (at_end(tab, panel->F + (size_t)a * m) - force);
        }
        lu_apply_vector(s->hold_matrix, na, s->hold_order, s->off);
        add_kicks(fl, panel, s->off, w_end);
    }
}

/* what the modes' free vibration over a panel, from the state w, and the excitation change a
 * penetration by, to its own precision */
static double flown(const Flow *fl, const Panel *panel, int stop, double phase, const double *w,
                    double h)
{
    double value = product(forced_of(fl, 0, 0, stop), swung(turn_at(fl, phase), fl->omega * h)).re;
    if (fl->n_terms > 0) value += swollen(fl, stop, phase, h);
    const double *row = row_of(fl, 0, stop), *e = panel->whole;
    for (int j = 0; j < fl->size; j += 2, e += 6) {
        value += row[j] * (e[4] * w[j] + e[1] * w[j + 1]);
        value += row[j + 1] * (e[2] * w[j] + e[5] * w[j + 1]);
    }
    return value;
}

/* let columns (2n, count) vibrate freely over a panel, in place */
static void swing(const Flow *fl, const Panel *panel, double *columns, int count)
{
    const double *e = panel->whole;
    for (int b = 0; b < fl->n; b++, e += 6) {
        double *first = columns + (size_t)2 * b * count;
        move_rows((Square){e[0], e[1], e[2], e[3]}, first, first + count, count);
    }
}

/* state w_end and penetrations at the end of a panel from the forces at its nodes; `decay` has
 * been filled */
static void panel_end(const Flow *fl, const Gauss *tab, int kind, double phase, const double *w,
                      double h, Panel *panel, double *w_end, Scratch *s)
{
    int na = panel->na, m = panel->m;
    for (int a = 0; a < na; a++) panel->end_depth[a] = panel->depth[a];
    push_modes(fl, panel, panel->F, s);
    for (int k = 0; k < fl->size; k++) {
        double kick = 0.0; /* what the forces have added, taken back to the start */
        for (int j = 0; j < m; j++) kick -= h * tab->weights[kind * m + j] * s->pushed[k * m + j];
        w_end[k] = w[k] + kick;
        for (int a = 0; a < na; a++)
            panel->end_depth[a] += row_of(fl, 0, panel->active[a])[k] * kick;
    }
    for (int a = 0; a < na; a++)
        panel->end_depth[a] += flown(fl, panel, panel->active[a], phase, w_end, h);
    swing(fl, panel, w_end, 1);
    hold_speeds(fl, tab, kind, phase + fl->omega * h, h, panel, w_end, s);
}

/* add to the forces' sensitivities at the node of output o what the excitation and the stop's own
 * parameters do */
static void add_node_columns(const Flow *fl, double node_phase, double t, const Panel *panel,
                             int o, int i, int n_columns, Scratch *s)
{
    int na = panel->na, m = panel->m, stop = panel->active[o % na];
    double *forces = s->forces + (size_t)((o % na) * m + i) * n_columns;
    int order = output_order(fl, stop, o / na);
    add_forced_by(fl, stop, order, node_phase, t, panel->slope[o * m + i], forces, n_columns);
    int disc = disc_of(fl, panel, o % na);
    if (disc >= 0) {
        int places[4];
        if (is_mover(fl, stop)) return;
        disc_places(fl, panel, disc, places);
        for (int f = 0; f < 4; f++)
            add_forced_by(fl, stop, order, node_phase, t,
                          tilt_of(panel, places[f], tilt_by(fl, panel, o))[i],
                          s->forces + (size_t)(places[f] * m + i) * n_columns, n_columns);
        if (stop == disc && order == 0) add_disc_columns(fl, panel, o, i, n_columns, s->forces);
        return;
    }
    if (is_planar(fl, stop)) {
        if (is_round(fl, stop) && order == 0) add_round_columns(fl, panel, o, i, n_columns, s->forces);
        int partner = partner_of(fl, panel, o % na);
        add_forced_by(fl, stop, order, node_phase, t, crossed(panel, panel->slope, o, partner)[i],
                      s->forces + (size_t)(partner * m + i) * n_columns, n_columns);
        return;
    }
    for (int c = 0; c < fl->n_parameters && order == 0; c++) {
        int64_t column = fl->parameters[2 * c];
        if (!is_number_of(fl, c, stop) || column < GAP) continue;
        if (is_slider(fl, stop)) { /* what is held does not go with its friction */
            double way = friction_at(fl, stop, panel->output[(na + o) * m + i]).value;
            if (column == TANGENTIAL && is_strained(fl, stop))
                forces[fl->size + c] += panel->output[o * m + i];
            if (column == PRESSING) forces[fl->size + c] += way;
            if (column == FRICTION)
                forces[fl->size + c] += fl->slides[stop] * normal_at(fl, panel, stop, i);
            continue;
        }
        double speed = panel->outputs > na ? panel->output[(na + o) * m + i] : 0.0;
        double by = share_in(fl, c, stop) * law_by(fl, stop, column, panel->output[o * m + i], speed);
        for (int a = 0; a < na; a++) {
            double share = a == o;
            if (is_coupled(fl, stop) && is_coupled(fl, panel->active[a]))
                share = passed_on(fl, panel->active[a], stop);
            s->forces[(size_t)(a * m + i) * n_columns + fl->size + c] += share * by;
        }
    }
}

/* whether friction at any slider drops at once */
static bool any_drops(const Flow *fl)
{
    for (int s = 0; s < fl->n_stops; s++)
        if (drops_at_once(fl, s)) return true;
    return false;
}

/* fill s->last_forces of a stop with the rate and the sensitivities of its force at the end of a
 * panel, of a length h without a switch at its end: those at the nodes are (m, n_columns) */
static void fill_last_force(const Gauss *tab, int kind, double h, const Panel *panel, int a,
                            const double *answer, int n_columns, Scratch *s)
{
    int m = panel->m;
    double *found = s->last_forces + (size_t)panel->active[a] * (1 + n_columns);
    found[0] = slope_at_end(tab, panel->F + (size_t)a * m) / (h * (kind == 0 ? 1.0 : tab->power));
    for (int c = 0; c < n_columns; c++) {
        for (int i = 0; i < m; i++) s->inner[i] = answer[i * n_columns + c];
        found[1 + c] = at_end(tab, s->inner);
    }
}

/* add to rows (m, n_columns), each times a factor of its own or one, the product of a block (m, m),
 * whose columns lie so far apart, and others (m, n_columns) */
static void add_block(const Flow *fl, const double *block, int apart, const double *from,
                      const double *factors, double *to, int m, int n_columns, Scratch *s)
{
    multiply_transposed(fl->watch, block, apart, from, s->part, m, m, n_columns);
    for (int i = 0; i < m; i++) {
        double factor = factors ? factors[i] : 1.0;
        for (int c = 0; c < n_columns; c++)
            to[i * n_columns + c] += factor * s->part[i * n_columns + c];
    }
}

/* add to s->forces what led friction does, by numbers of its own, to the outputs of others */
static void add_led_columns(const Flow *fl, const Gauss *tab, int kind, double h,
                            const Panel *panel, int n_columns, Scratch *s)
{
    int na = panel->na, m = panel->m;
    for (int l = panel->sought; l < na; l++) {
        bool any = false;
        for (int c = 0; c < fl->n_parameters; c++)
            any = any || is_number_of(fl, c, panel->active[l]);
        if (!any || !is_led(fl, panel, l)) continue;
        const double *back = panel->back + (size_t)l * fl->size * m;
        for (int o = 0; o < panel->outputs; o++) {
            if (!is_needed(fl, panel, o)) continue;
            bool kicks = acts_at_once(fl, panel, o, l);
            double kick = kicks ? between(fl, panel->active[o % na], panel->active[l]) : 0.0;
            fill_influence(fl, tab, kind, h, panel, o, back, kick, s->square, m, s->product);
            add_block(fl, s->square, m, s->forces + (size_t)l * m * n_columns, panel->slope + o * m,
                      s->forces + (size_t)(o % na) * m * n_columns, m, n_columns, s);
            add_tilted(fl, panel, o, 1.0, s->part, 1, n_columns, s->forces, 1, n_columns, n_columns);
        }
    }
}

/* fill s->answers of what sticks without the forces sought, and let it act on s->forces of these */
static void loosen_columns(const Flow *fl, const Panel *panel, int n_columns, Scratch *s)
{
    int m = panel->m, sought = panel->sought, width = panel->n_stuck * m;
    int height = panel->orders * sought * m;
    size_t rows = (size_t)m * n_columns;
    for (int q = 0; q < panel->n_stuck; q++) {
        double *answer = s->answers + panel->stuck[q] * rows;
        memset(answer, 0, sizeof(double) * rows);
        for (int p = 0; p < panel->n_stuck; p++)
            add_block(fl, panel->loose + (size_t)p * m * padded(width) + q * m, padded(width),
                      s->forces + panel->stuck[p] * rows, NULL, answer, m, n_columns, s);
    }
    for (int q = 0; q < panel->n_stuck; q++)
        for (int row = 0; row < panel->orders * sought; row++) {
            int o = row / sought * panel->na + row % sought;
            add_block(fl, panel->reach + (size_t)q * m * height + row * m, height,
                      s->answers + panel->stuck[q] * rows, panel->slope + o * m,
                      s->forces + (row % sought) * rows, m, n_columns, s);
            add_tilted(fl, panel, o, 1.0, s->part, 1, n_columns, s->forces, 1, n_columns, n_columns);
        }
}

/* fill s->answers (na m, n_columns), the sensitivities of the forces, from what goes into them
 * without each other, s->forces */
static void answer_columns(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel,
                           int n_columns, Scratch *s)
{
    int m = panel->m, sought = panel->sought, stuck = panel->n_stuck * m, width = sought * m;
    size_t rows = (size_t)m * n_columns;
    add_led_columns(fl, tab, kind, h, panel, n_columns, s);
    loosen_columns(fl, panel, n_columns, s);
    add_friction(fl, panel, s->forces, n_columns, 1, n_columns); /* of all that presses on */
    invert_panel(fl, panel);
    for (int a = 0; a < sought; a++)
        multiply_transposed(fl->watch, panel->inverse + a * m, padded(width), s->forces,
                            s->answers + a * rows, m, width, n_columns);
    for (int q = 0; q < panel->n_stuck; q++)
        for (int a = 0; a < sought; a++)
            add_block(fl, panel->share + (size_t)a * m * stuck + q * m, stuck,
                      s->answers + a * rows, NULL, s->answers + panel->stuck[q] * rows, m,
                      n_columns, s);
    for (int l = sought; l < panel->na; l++) {
        if (!is_led(fl, panel, l)) continue;
        const double *leader = s->answers + leader_of(fl, panel, l) * rows;
        double share = led_share(fl, panel, l);
        for (size_t p = 0; p < rows; p++)
            s->answers[l * rows + p] = s->forces[l * rows + p] + share * leader[p];
    }
}

/* Advance sensitivities (2n, n_columns) in place over a panel.
 *
 * After those of the start come the derivatives with respect to parameters; the last column is
 * that with respect to ω at fixed time; t0 is the time from the start of the segment at which its
 * phase is fixed. */
static void panel_columns(const Flow *fl, const Gauss *tab, int kind, double phase, double t0,
                          double h, Panel *panel, double *columns, int n_columns, Scratch *s)
{
    int na = panel->na, m = panel->m;
    bool drops = any_drops(fl);
    memset(s->forces, 0, sizeof(double) * na * m * n_columns);
    for (int o = 0; o < panel->outputs; o++) {
        bool needed = is_needed(fl, panel, o);
        if (!needed && !(o < na && fl->n_parameters > 0)) continue;
        if (needed)
            multiply_transposed(fl->watch, panel->to + (size_t)o * m * fl->size, m, columns,
                                s->part, m, fl->size, n_columns);
        for (int i = 0; i < m; i++) {
            double *forces = s->forces + (size_t)((o % na) * m + i) * n_columns;
            double slope = panel->slope[o * m + i], t = h * tab->chi[kind * m + i];
            for (int c = 0; c < n_columns && needed; c++)
                forces[c] += slope * s->part[i * n_columns + c];
            add_node_columns(fl, phase + fl->omega * t, t0 + t, panel, o, i, n_columns, s);
        }
        if (!needed) continue;
        add_crossed(fl, panel, o, 1.0, s->part, 1, n_columns, s->forces, 1, n_columns, n_columns);
        add_tilted(fl, panel, o, 1.0, s->part, 1, n_columns, s->forces, 1, n_columns, n_columns);
    }
    if (panel->many) {
        add_friction(fl, panel, s->forces, n_columns, 1, n_columns);
        solve_columns(fl, tab, panel, n_columns, s);
    } else {
        answer_columns(fl, tab, kind, h, panel, n_columns, s);
    }
    for (int a = 0; a < na; a++) {
        const double *answer = (panel->many ? s->forces : s->answers) + (size_t)a * m * n_columns;
        if (drops) fill_last_force(tab, kind, h, panel, a, answer, n_columns, s);
        for (int j = 0; j < m; j++) {
            double weight = h * tab->weights[kind * m + j];
            for (int c = 0; c < n_columns; c++)
                s->part[j * n_columns + c] = answer[j * n_columns + c] * weight;
        }
        take_product(fl->watch, panel->back + (size_t)a * fl->size * m, s->part, columns, fl->size,
                     m, n_columns, s->change);
    }
    swing(fl, panel, columns, n_columns);
}

/* fill `driven` (2n, m): the states at the nodes of a panel, taken back to its start; `panel_end` has
 * filled s->pushed */
static void drive_back(const Flow *fl, const Gauss *tab, const double *w, const Panel *panel,
                       Scratch *s)
{
    int m = panel->m;
    carry_modes(fl, tab, panel, s);
    for (int k = 0; k < fl->size; k++)
        for (int i = 0; i < m; i++) s->driven[k * m + i] = w[k] + s->carried[k * m + i];
}

/* add to values (m,) at the nodes what a row makes of the states in s->driven */
static void add_driven(const Flow *fl, const Panel *panel, const double *row,
                       double *restrict values, const Scratch *s)
{
    int m = panel->m;
    for (int b = 0; b < fl->n; b++) {
        const double *e = panel->there + (size_t)4 * b * m, *x = s->driven + (size_t)2 * b * m;
        for (int i = 0; i < m; i++)
            values[i] += row[2 * b] * (e[i] * x[i] + e[m + i] * x[m + i]) +
                         row[2 * b + 1] * (e[2 * m + i] * x[i] + e[3 * m + i] * x[m + i]);
    }
}

/* fill an output at the nodes of a panel, (m,), with the forces at work; s->driven is filled */
static void node_outputs(const Flow *fl, const Gauss *tab, int kind, double phase, double h,
                         const Panel *panel, int out, double *values, const Scratch *s)
{
    int m = panel->m;
    for (int i = 0; i < m; i++)
        values[i] = forced_output(fl, out, phase + fl->omega * h * tab->chi[kind * m + i]);
    add_driven(fl, panel, row_of(fl, 0, out), values, s);
}

/* the same of an output o of the panel, with the turns (2, m) of the excitation from the phase on */
static void node_course(const Flow *fl, const Gauss *tab, int kind, double phase, double h,
                        Panel *panel, int o, const double *turns, const Scratch *s)
{
    int m = panel->m, out = panel->active[o % panel->na], order = o / panel->na;
    double *values = panel->output + (size_t)o * m;
    Complex swing = forced_of(fl, 0, 0, out);
    if (order == 1) swing = quarter_turned(fl->omega, swing);
    double start = product(swing, turn_at(fl, phase)).re;
    for (int i = 0; i < m; i++) values[i] = start + swing.re * turns[i] - swing.im * turns[m + i];
    for (int i = 0; i < m && fl->n_terms > 0; i++) {
        Course more = swelling(fl, out, phase + fl->omega * h * tab->chi[kind * m + i]);
        values[i] += order == 1 ? more.first : more.value;
    }
    add_driven(fl, panel, row_of(fl, order, out), values, s);
}

/* Fill the outputs of what follows that no equation needs: place and speed of what slides, and of
 * the stops that press it on behind a spring. s->driven is filled. */
static void show_following(const Flow *fl, const Gauss *tab, int kind, double phase, double h,
                           Panel *panel, Scratch *s)
{
    int na = panel->na;
    fill_turns(fl, tab, kind, phase, fl->omega * h, s->times, s->waves);
    for (int a = panel->sought; a < na; a++) {
        if (!is_led(fl, panel, a)) continue;
        node_course(fl, tab, kind, phase, h, panel, a, s->waves, s);
        node_course(fl, tab, kind, phase, h, panel, na + a, s->waves, s);
        if (is_sprung(fl, panel->active[a]) && panel->orders == 1)
            node_course(fl, tab, kind, phase, h, panel, na + leader_of(fl, panel, a), s->waves, s);
    }
}
