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
    int orders = panel->outputs / na;
    for (int i = 0; i < m; i++) {
        double at[3][2] = {{0.0}}, force[2], by[3][4];
        for (int order = 0; order < orders; order++)
            for (int d = 0; d < 2; d++)
                at[order][d] = panel->output[(order * na + places[d]) * m + i];
        round_law(fl, s, at[0], at[1], at[2], force, by);
        Polar polar_at = polar(fl, s, at[0], at[1]);
        double pressed = polar_at.n[0] * force[0] + polar_at.n[1] * force[1];
        panel->radial[a * m + i] = is_rigid(fl, s) ? stop_of(fl, s)->sense * pressed : polar_at.depth;
        for (int d = 0; d < 2; d++) {
            int own = places[d] * m + i, cross = panel->outputs * m + own;
            panel->F[own] = force[d];
            for (int order = 0; order < orders; order++) {
                slope[order * na * m + own] = by[order][3 * d];
                slope[order * na * m + cross] = by[order][d + 1];
            }
        }
    }
}

/* fill how both forces of a rigid one change with its coefficient of friction, by the normal force, in
 * one `way` of sliding */
static void rigid_rubbing_by(const Flow *fl, int s, const Polar *at, double pressed, int way,
                             double *by)
{
    double M[4], along[2], t[2] = {-at->n[1], at->n[0]};
    rubbing(stop_of(fl, s)->sense, way * stop_of(fl, s)->rub, at, along);
    round_mobilities(fl, s, M);
    double less = across_matrix(at->n, M, t) / across_matrix(at->n, M, along);
    for (int d = 0; d < 2; d++) by[d] = way * pressed * (t[d] - less * along[d]);
}

/* add to the sensitivities of both forces of a round clearance at the node of output o, of its
 * first direction, what its own parameters do */
static void add_round_columns(const Flow *fl, const Panel *panel, int o, int i, int n_columns,
                              double *forces)
{
    int na = panel->na, m = panel->m, s = panel->active[o], rows[2] = {s, (int)stop_of(fl, s)->second};
    int places[2] = {o, place_of(panel, rows[1])}, way = fl->slides[rows[1]];
    double place[2], speed[2] = {0.0, 0.0}, along[2], still[2] = {0.0, 0.0};
    for (int d = 0; d < 2; d++) {
        place[d] = panel->output[places[d] * m + i];
        if (panel->outputs > na) speed[d] = panel->output[(na + places[d]) * m + i];
    }
    Polar at = polar(fl, s, place, speed);
    double sense = stop_of(fl, s)->sense, rub_by[2];
    if (stop_of(fl, s)->rub == 0.0) way = at.across + stop_of(fl, s)->surface > 0.0 ? 1 : -1;
    if (is_rigid(fl, s)) {
        rigid_rubbing_by(fl, s, &at, panel->radial[o * m + i], way, rub_by);
    } else {
        double pressed = closed_law(fl, s, at.depth, at.rate).force;
        rubbing(sense, round_friction(fl, s, &at, speed, still, pressed).share, &at, along);
        for (int d = 0; d < 2; d++) rub_by[d] = way * pressed * (d == 0 ? -at.n[1] : at.n[0]);
    }
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
                *force += rub_by[d];
            else if (!is_rigid(fl, s)) /* whose clearance counts in the state, see `hold` */
                *force += along[d] * law_by(fl, s, column, at.depth, at.rate) *
                          (column == GAP ? sense : 1.0);
        }
    }
}

/* fill values (m,) at the nodes of a panel, positive as long as the surface slides on in a round
 * clearance, whose second direction is `s`, or sticks without more force than its friction to one
 * `side` */
static void show_rubbing(const Flow *fl, const Panel *panel, int s, int side, double *values)
{
    int na = panel->na, m = panel->m, lead = (int)stop_of(fl, s)->lead;
    int places[2] = {place_of(panel, lead), place_of(panel, s)};
    for (int i = 0; i < m; i++) {
        double place[2], speed[2], force[2];
        for (int d = 0; d < 2; d++) {
            place[d] = panel->output[places[d] * m + i];
            speed[d] = panel->output[(na + places[d]) * m + i];
            force[d] = panel->F[places[d] * m + i];
        }
        Polar at = polar(fl, lead, place, speed);
        double normal = stop_of(fl, s)->sense * (at.n[0] * force[0] + at.n[1] * force[1]);
        values[i] = fl->slides[s] != 0
                        ? fl->slides[s] * (at.across + stop_of(fl, s)->surface)
                        : grip(fl, s) * normal - side * (at.n[0] * force[1] - at.n[1] * force[0]);
    }
}
