/* Panels with many closed stops: their forces by iteration.
 *
 * What a force does within a panel grows with its length squared over that of a swing on the stops,
 * so that forces and what they lead to, in turn, come to rest, the faster the shorter the panel
 * [Volterra]. The way from forces at the nodes to outputs goes by the modes, where the stops are
 * more than these: no matrix of all influences is made, none is inverted. */
#include "engine.h"

#define MANY 128      /* unknown forces at the nodes from which on they are found so */
/* The same of coupled stops with n modes, whose laws are linear, so that one inverse lasts long: as
 * measured with 3, 6, 12 and 20 modes, of which either way takes as long at about 95, 100, 140 and 170
 * unknowns; with 40, at 224, the inverse is still twice as fast. */
#define FEWER 60
#define FEWER_BY_MODES 7
#define WORST_RATE 0.5 /* of convergence: a panel that takes longer is to be shorter */
#define MOST_TURNS 60
#define MOST_TERMS 200 /* of a series of sensitivities, which begins farther from its end */

static int fewest_unknowns(const Flow *fl) { return FEWER + FEWER_BY_MODES * fl->n; }

/* whether the forces of a panel are found by iteration: they are many, each a smooth law's */
static bool is_many(const Flow *fl, const Panel *panel)
{
    bool all = true;
    for (int a = 0; a < panel->na; a++) all = all && is_coupled(fl, panel->active[a]);
    if (panel->na * panel->m < (all ? fewest_unknowns(fl) : MANY) || panel->round) return false;
    for (int a = 0; a < panel->na; a++)
        if (is_held(fl, panel->active[a]) || is_bond(fl, panel->active[a]) ||
            is_disc(fl, panel->active[a]) || is_mover(fl, panel->active[a]))
            return false;
    return true;
}

/* fill s->pushed (2n, m): what forces (na, m) push the modes by, taken back to the start */
static void push_modes(const Flow *fl, const Panel *panel, const double *force, Scratch *s)
{
    int m = panel->m, size = fl->size;
    memset(s->pushed, 0, sizeof(double) * size * m);
    for (int a = 0; a < panel->na; a++) {
        const double *restrict back = panel->back + (size_t)a * size * m, *F = force + (size_t)a * m;
        for (int k = 0; k < size; k++) {
            double *restrict pushed = s->pushed + (size_t)k * m;
            for (int j = 0; j < m; j++) pushed[j] += back[k * m + j] * F[j];
        }
    }
}

/* fill s->carried (2n, m): the modes at the nodes, taken back to the start, by s->pushed */
static void carry_modes(const Flow *fl, const Gauss *tab, const Panel *panel, Scratch *s)
{
    int m = panel->m;
    const double *integrate = tab->integrate + (size_t)panel->made_kind * m * m;
    double *restrict impulses = s->inner;
    for (int k = 0; k < fl->size; k++) {
        for (int j = 0; j < m; j++) impulses[j] = -panel->made_length * s->pushed[k * m + j];
        combine(s->carried + (size_t)k * m, NULL, m, integrate, m, impulses, 1, m);
    }
}

/* fill the outputs (outputs, m) with those of free motion and what forces (na, m) add */
static void outputs_by_modes(const Flow *fl, const Gauss *tab, const Panel *panel,
                             const double *free, const double *force, double *output, Scratch *s)
{
    int m = panel->m, size = fl->size;
    push_modes(fl, panel, force, s);
    carry_modes(fl, tab, panel, s);
    for (int o = 0; o < panel->outputs; o++) {
        const double *restrict to = panel->to + (size_t)o * size * m;
        double *restrict found = output + (size_t)o * m;
        for (int i = 0; i < m; i++) found[i] = free[o * m + i];
        for (int k = 0; k < size; k++)
            for (int i = 0; i < m; i++) found[i] += to[k * m + i] * s->carried[k * m + i];
    }
}

/* `solve_panel` by forces and outputs in turn; the responses and free outputs are filled */
static bool solve_many(const Flow *fl, const Gauss *tab, const double *noise, Panel *panel,
                       Scratch *s)
{
    int width = panel->na * panel->m;
    double before = INFINITY;
    for (int turn = 0; turn < MOST_TURNS; turn++) {
        panel_forces(fl, panel, panel->slope);
        memcpy(s->solved, panel->F, sizeof(double) * width);
        outputs_by_modes(fl, tab, panel, s->free, s->solved, s->led, s);
        double change = renew_outputs(fl, panel, s, noise);
        if (isnan(change)) return false;
        double rate = change > 0.0 ? change / before : 0.0;
        if (turn > 0 && change * rate / larger(1.0 - rate, SLOWEST) <= SOLVED) {
            panel_forces(fl, panel, panel->slope);
            if (consistent(fl, panel, s->solved, noise)) return true;
        }
        if (turn > 4 && rate > WORST_RATE) return false;
        before = change;
    }
    return false;
}

/* fill s->pushing (na, 2n) with what the stops' forces do to the modes in the length of the panel,
 * and s->showing (outputs, 2n) with what the modes do to its outputs */
static void gather_stops(const Flow *fl, const Panel *panel, Scratch *s)
{
    int na = panel->na, size = fl->size;
    for (int o = 0; o < panel->outputs; o++) {
        int stop = panel->active[o % na];
        const double *row = row_of(fl, output_order(fl, stop, o / na), stop);
        memcpy(s->showing + (size_t)o * size, row, sizeof(double) * size);
    }
    for (int a = 0; a < na; a++)
        for (int k = 0; k < size; k++)
            s->pushing[a * size + k] = -panel->made_length * push_of(fl, panel->active[a])[k];
}

/* move the pairs of coordinates in X (2n, m, n_columns), at each node by a matrix of its own, of
 * blocks (n, 4, m) */
static void move_nodes(const Flow *fl, const double *blocks, int m, int n_columns, double *X)
{
    for (int b = 0; b < fl->n; b++, blocks += 4 * m) {
        double *first = X + (size_t)2 * b * m * n_columns, *second = first + (size_t)m * n_columns;
        for (int i = 0; i < m; i++) {
            Square by = {blocks[i], blocks[m + i], blocks[2 * m + i], blocks[3 * m + i]};
            move_rows(by, first + i * n_columns, second + i * n_columns, n_columns);
        }
    }
}

/* fill s->flown (2n, m, n_columns): `carry_modes` of columns of forces (na, m, n_columns) */
static void carry_columns(const Flow *fl, const Gauss *tab, const Panel *panel, int n_columns,
                          const double *forces, Scratch *s)
{
    int m = panel->m, size = fl->size, row = m * n_columns;
    const double *integrate = tab->integrate + (size_t)panel->made_kind * m * m;
    multiply_transposed(fl->watch, s->pushing, size, forces, s->driven_many, size, panel->na, row);
    move_nodes(fl, panel->home, m, n_columns, s->driven_many);
    for (int k = 0; k < size; k++)
        multiply_transposed(fl->watch, integrate, m, s->driven_many + (size_t)k * row,
                            s->flown + (size_t)k * row, m, m, n_columns);
}

/* fill `next` (na, m, n_columns) with what the forces' slopes make of s->flown, which it moves to
 * the nodes */
static void slopes_of_columns(const Flow *fl, const Panel *panel, int n_columns, double *next,
                              Scratch *s)
{
    int na = panel->na, m = panel->m, size = fl->size, row = m * n_columns;
    move_nodes(fl, panel->there, m, n_columns, s->flown);
    memset(next, 0, sizeof(double) * na * row);
    for (int first = 0; first < panel->outputs; first += na) {
        multiply(fl->watch, s->showing + (size_t)first * size, s->flown, s->driven_many, na, size,
                 row);
        for (int p = 0; p < na * m; p++) {
            double slope = panel->slope[first * m + p];
            const double *restrict from = s->driven_many + (size_t)p * n_columns;
            double *restrict to = next + (size_t)p * n_columns;
            for (int c = 0; c < n_columns; c++) to[c] += slope * from[c];
        }
    }
    add_friction(fl, panel, next, n_columns, 1, n_columns);
}

/* fill the largest (n_columns,) of each column of rows */
static void largest_of_columns(const double *rows, size_t count, int n_columns, double *found)
{
    for (int c = 0; c < n_columns; c++) found[c] = 0.0;
    for (size_t p = 0; p < count; p++)
        for (int c = 0; c < n_columns; c++)
            found[c] = larger(found[c], fabs(rows[p * n_columns + c]));
}

/* Replace columns of forces (na, m, n_columns) in s->forces by (1 - slope G)^-1 of them: the sum of
 * what each turn adds; by no numbers if that does not end. */
static void solve_columns(const Flow *fl, const Gauss *tab, const Panel *panel, int n_columns,
                          Scratch *s)
{
    size_t rows = (size_t)panel->na * panel->m, count = rows * n_columns;
    double *most = s->part, *scale = s->part + n_columns;
    gather_stops(fl, panel, s);
    memcpy(s->added, s->forces, sizeof(double) * count);
    for (int term = 0; term < MOST_TERMS; term++) {
        carry_columns(fl, tab, panel, n_columns, s->added, s);
        slopes_of_columns(fl, panel, n_columns, s->added, s);
        for (size_t p = 0; p < count; p++) s->forces[p] += s->added[p];
        largest_of_columns(s->added, rows, n_columns, most);
        largest_of_columns(s->forces, rows, n_columns, scale);
        bool settled = true;
        for (int c = 0; c < n_columns; c++)
            settled = settled && most[c] <= SUM_ROUNDING * scale[c];
        if (settled) return;
    }
    for (size_t p = 0; p < count; p++) s->forces[p] = NAN;
}
