/* The memory of a call: one block, sized before it. */
#include "engine.h"

/* a block that is only measured as long as it has no base */
typedef struct {
    char *base;
    size_t used;
} Block;

static void *room(Block *block, size_t count, size_t width)
{
    void *place = block->base ? block->base + block->used : NULL;
    block->used += (count * width + 63) / 64 * 64;
    return place;
}

static double *numbers(Block *block, size_t count) { return room(block, count, sizeof(double)); }

static int *indices(Block *block, size_t count) { return room(block, count, sizeof(int)); }

static bool *flags(Block *block, size_t count) { return room(block, count, sizeof(bool)); }

/* most terms that a response may have */
static size_t most_terms(const System *sys)
{
    return (size_t)sys->n_orders * (1 + 2 * (size_t)sys->n);
}

static void lay_out_flow(Block *block, const System *sys, int n_parameters,
                         const int64_t *parameters, Flow *fl)
{
    fl->n = (int)sys->n;
    fl->size = 2 * fl->n;
    fl->n_out = (int)sys->n_out;
    fl->n_stops = (int)sys->n_stops;
    fl->n_columns = (int)sys->n_columns;
    fl->n_parameters = n_parameters;
    fl->blocks = sys->blocks;
    fl->rows = sys->rows;
    fl->bound3 = sys->bound3;
    fl->stops = sys->stops;
    fl->laws = sys->laws;
    fl->parameters = parameters;
    fl->tail = sys->tail;
    fl->node_angle = sys->node_angle;
    size_t amplitudes = (1 + most_terms(sys)) * (2 + (size_t)n_parameters);
    fl->turns = room(block, 2, sizeof(Turn));
    fl->pushes = numbers(block, (size_t)fl->n_stops * fl->size);
    fl->slides = indices(block, fl->n_stops);
    fl->terms = room(block, most_terms(sys), sizeof(Term));
    fl->response = room(block, amplitudes * fl->size, sizeof(Complex));
    fl->forced = room(block, amplitudes * fl->n_out, sizeof(Complex));
    fl->give = NULL;
    size_t pairs = (size_t)fl->n_stops * fl->n_stops, first = 0;
    while (first < pairs && sys->common[first] == 0.0) first++;
    if (first == pairs) return;
    fl->plain = sys;
    fl->own_rows = numbers(block, (size_t)3 * fl->n_out * fl->size);
    fl->own_stops = numbers(block, (size_t)fl->n_stops * fl->n_columns);
    fl->give = numbers(block, pairs);
    fl->coupled = flags(block, fl->n_stops);
    fl->counted = flags(block, fl->n_stops);
    fl->pivots = indices(block, 1);
}

/* most derivatives that panels have outputs of, with the outputs themselves */
static size_t most_orders(const Flow *fl)
{
    for (int s = 0; s < fl->n_stops; s++)
        if (rubs_around(fl, s) || (is_round(fl, s) && is_rigid(fl, s))) return 3;
    return 2;
}

static void lay_out_panel(Block *block, const Flow *fl, int m, Panel *panel)
{
    size_t na = fl->n_stops, nodes = na * m, size = fl->size;
    size_t outputs = most_orders(fl) * nodes;
    panel->m = m;
    panel->active = indices(block, na);
    panel->output = numbers(block, outputs);
    panel->F = numbers(block, nodes);
    panel->slope = numbers(block, 2 * outputs);
    panel->radial = numbers(block, nodes);
    panel->tilt = numbers(block, N_TILTS * nodes);
    panel->growth = numbers(block, na);
    panel->inverted = numbers(block, outputs);
    panel->there = numbers(block, 2 * size * m);
    panel->home = numbers(block, 2 * size * m);
    panel->to = numbers(block, outputs * size);
    panel->back = numbers(block, nodes * size);
    panel->G = numbers(block, outputs * nodes);
    panel->inverse = numbers(block, nodes * padded((int)nodes));
    panel->order = indices(block, nodes);
    panel->stuck = indices(block, na);
    panel->ways = indices(block, na);
    size_t stuck = 0;
    for (int s = 0; s < fl->n_stops; s++) stuck += is_slider(fl, s) ? m : 0;
    panel->reach = numbers(block, outputs * stuck);
    panel->loose = numbers(block, stuck * padded((int)stuck));
    panel->share = numbers(block, nodes * stuck);
    panel->base = numbers(block, stuck);
    panel->whole = numbers(block, 3 * size);
    panel->rise = numbers(block, nodes * size);
    panel->depth = numbers(block, na);
    panel->doubt = numbers(block, na);
    panel->end_depth = numbers(block, na);
    panel->end_doubt = numbers(block, na);
    panel->decayed = numbers(block, na);
    panel->decay = numbers(block, na);
}

static void lay_out_contacts(Block *block, const Flow *fl, const Gauss *tab, Scratch *s)
{
    size_t m = tab->m, na = fl->n_stops, nodes = na * m, size = fl->size;
    size_t orders = most_orders(fl);
    s->times = numbers(block, m);
    s->waves = numbers(block, 6 * m);
    s->product = numbers(block, m * m);
    s->free = numbers(block, orders * nodes);
    s->new_slope = numbers(block, 2 * orders * nodes);
    s->solved = numbers(block, nodes);
    s->step = numbers(block, nodes);
    s->led = numbers(block, orders * nodes);
    s->guess = numbers(block, m);
    s->rounding = numbers(block, orders * na);
    s->noise = numbers(block, orders * na);
    s->inner = numbers(block, m);
    s->values = numbers(block, m + 2);
    s->fine = numbers(block, tab->n_fine);
    s->driven = numbers(block, size * m);
    s->slopes = numbers(block, 2 * orders * nodes);
    s->forced = numbers(block, na);
    s->swayed = numbers(block, na);
    s->viscosity = numbers(block, na);
    s->off = numbers(block, na);
    s->hold_matrix = numbers(block, na * na);
    s->shift = numbers(block, size);
    s->kick = numbers(block, size);
    s->hold_order = indices(block, na);
    s->pushed = numbers(block, size * m);
    s->carried = numbers(block, size * m);
}

static void lay_out_jumps(Block *block, const Flow *fl, int m, int n_columns, Scratch *s)
{
    size_t na = fl->n_stops, size = fl->size;
    s->forces = numbers(block, na * m * n_columns);
    s->part = numbers(block, (size_t)m * n_columns);
    s->answers = numbers(block, na * m * n_columns);
    s->square = numbers(block, (size_t)m * m);
    s->change = numbers(block, n_columns);
    s->last_forces = numbers(block, na * (1 + n_columns));
    if (na * m >= MANY || na * m >= (size_t)fewest_unknowns(fl)) {
        s->added = numbers(block, na * m * n_columns);
        s->driven_many = numbers(block, (na > size ? na : size) * m * n_columns);
        s->pushing = numbers(block, na * size);
        s->showing = numbers(block, 2 * na * size);
        s->flown = numbers(block, size * m * n_columns);
    }
    s->stop_forces = numbers(block, na);
    s->pushes = numbers(block, na);
    s->first_pushes = numbers(block, na);
    s->held = numbers(block, na);
    s->drags = numbers(block, na);
    s->heading = numbers(block, na);
    s->across = numbers(block, na);
    s->outward = numbers(block, na);
    s->mobility = numbers(block, na * na);
    s->resting = indices(block, na);
    s->mobility_order = indices(block, na);
    s->rate = numbers(block, size);
    s->moved = numbers(block, n_columns);
    s->moved_shift = numbers(block, n_columns);
    s->along = numbers(block, size);
    s->along_columns = numbers(block, n_columns);
    s->closing = numbers(block, n_columns);
    s->sliding = numbers(block, n_columns);
    s->turning = numbers(block, n_columns);
    s->gained = numbers(block, n_columns);
    s->aside = numbers(block, n_columns);
    s->pull = numbers(block, size);
    s->offsets = numbers(block, na * (1 + n_columns));
    s->struck = flags(block, na);
    s->still = flags(block, na);
    s->was_open = flags(block, na);
}

static void lay_out_motion(Block *block, const Flow *fl, Motion *M)
{
    size_t na = fl->n_stops, size = fl->size;
    M->n_columns = fl->size + fl->n_parameters + 1;
    M->w = numbers(block, size);
    M->w_end = numbers(block, size);
    M->columns = numbers(block, size * M->n_columns);
    M->closed = flags(block, na);
    M->bounces = room(block, na, sizeof(int64_t));
    M->last_push = numbers(block, na);
    M->skips = numbers(block, na);
    M->depth = numbers(block, na);
    M->doubt = numbers(block, na);
    M->active = indices(block, na);
}
