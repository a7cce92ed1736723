/* Forces of round clearances at the nodes of a panel, see `round.c`. */
#include "engine.h"

/* add to rows of forces, in a matrix (na m, n_columns), what they have of the output o of the other
 * direction of a round clearance, (m, n_columns); entries of a row, and rows, lie so far apart */
static void add_crossed(const Flow *fl, const Panel *panel, int o, double sign,
                        const double *outputs, size_t output_entry, size_t output_row,
                        double *forces, size_t entry, size_t row, int n_columns)
{
    int m = panel->m, a = panel->round ? partner_of(fl, panel, o % panel->na) : -1;
    if (a < 0) return;
    const double *slope = crossed(panel, panel->slope, o, a);
    for (int i = 0; i < m; i++) {
        const double *from = outputs + (size_t)i * output_row;
        double *to = forces + (size_t)(a * m + i) * row;
        for (int c = 0; c < n_columns; c++)
            to[c * entry] += sign * slope[i] * from[c * output_entry];
    }
}

/* fill F of both directions of a round clearance, and its derivatives into `slope` */
static void round_forces(const Flow *fl, Panel *panel, int a, double *slope)
{
    int na = panel->na, m = panel->m, s = panel->active[a], places[2] = {a, partner_of(fl, panel, a)};
    bool rates = panel->outputs > na;
    for (int i = 0; i < m; i++) {
        double place[2], speed[2] = {0.0, 0.0}, force[2], by[4], by_speed[4];
        for (int d = 0; d < 2; d++) {
            place[d] = panel->output[places[d] * m + i];
            if (rates) speed[d] = panel->output[(na + places[d]) * m + i];
        }
        round_law(fl, s, place, speed, force, by, by_speed);
        panel->radial[a * m + i] = polar(fl, s, place, speed).depth;
        for (int d = 0; d < 2; d++) {
            int own = places[d] * m + i, cross = panel->outputs * m + own;
            panel->F[own] = force[d];
            slope[own] = by[3 * d];
            slope[cross] = by[d + 1];
            if (rates) slope[na * m + own] = by_speed[3 * d];
            if (rates) slope[na * m + cross] = by_speed[d + 1];
        }
    }
}

/* add to the sensitivities of both forces of a round clearance at the node of output o, of its
 * first direction, what its own parameters do */
static void add_round_columns(const Flow *fl, const Panel *panel, int o, int i, int n_columns,
                              double *forces)
{
    int na = panel->na, m = panel->m, s = panel->active[o], rows[2] = {s, (int)stop_of(fl, s)->second};
    int places[2] = {o, place_of(panel, rows[1])};
    double place[2], speed[2] = {0.0, 0.0}, along[2];
    for (int d = 0; d < 2; d++) {
        place[d] = panel->output[places[d] * m + i];
        if (panel->outputs > na) speed[d] = panel->output[(na + places[d]) * m + i];
    }
    Polar at = polar(fl, s, place, speed);
    double pressed = closed_law(fl, s, at.depth, at.rate).force;
    rubbing(fl, s, &at, along);
    for (int c = 0; c < fl->n_parameters; c++) {
        int64_t column = fl->parameters[2 * c], row = fl->parameters[2 * c + 1];
        for (int d = 0; d < 2 && column >= GAP; d++) {
            double *force = forces + (size_t)(places[d] * m + i) * n_columns + fl->size + c;
            const double *slope = panel->slope + (size_t)places[d] * m + i;
            const double *cross = crossed(panel, panel->slope, o, places[d]) + i;
            if (column == CENTRE && row == rows[0]) *force -= d == 0 ? *slope : *cross;
            if (column == CENTRE && row == rows[1]) *force -= d == 1 ? *slope : *cross;
            if (row != s || column == CENTRE) continue;
            if (column == RUB)
                *force += copysign(1.0, stop_of(fl, s)->surface) * pressed *
                          (d == 0 ? -at.n[1] : at.n[0]);
            else
                *force += along[d] * law_by(fl, s, column, at.depth, at.rate) *
                          (column == GAP ? stop_of(fl, s)->sense : 1.0);
        }
    }
}

/* Whether the surface of what turns slides the other way somewhere in a panel, or rests, where a
 * round clearance rubs: its friction is that of sliding one way. */
static bool sliding_turns(const Motion *M, double phase, double h)
{
    const Flow *fl = M->fl;
    const Panel *panel = M->panel;
    int na = panel->na, m = panel->m, n_fine = (int)M->tab->n_fine;
    double place[2], speed[2], pace[2], *values = M->s->values;
    for (int a = 0; a < na && panel->round; a++) {
        int s = panel->active[a];
        double surface = stop_of(fl, s)->surface, sense = copysign(1.0, surface);
        if (!is_round(fl, s) || stop_of(fl, s)->rub == 0.0) continue;
        for (int i = 0; i < m + 2; i++) {
            const double *output = panel->output + i - 1;
            int partner = partner_of(fl, panel, a);
            if (i == 0)
                round_now(fl, s, M->w, phase, place, speed, pace);
            else if (i == m + 1)
                round_now(fl, s, M->w_end, phase + fl->omega * h, place, speed, pace);
            for (int d = 0; d < 2 && 0 < i && i <= m; d++) {
                int row = d == 0 ? a : partner;
                place[d] = output[row * m];
                speed[d] = output[(na + row) * m];
            }
            values[i] = sense * (polar(fl, s, place, speed).across + surface);
        }
        refine(M->tab, values, M->s->fine);
        for (int i = 0; i < n_fine; i++)
            if (!(M->s->fine[i] > 0.0)) return true;
    }
    return false;
}
