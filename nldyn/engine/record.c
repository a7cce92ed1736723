/* The record of a motion. */
#include "engine.h"

/* append a piece; its index, or -1 when the record is full */
static int64_t record_piece(Motion *M, double phase, double h, int kind, int event)
{
    Record *rec = M->rec;
    const Flow *fl = M->fl;
    int64_t n = rec->used[0];
    if (n >= rec->capacity) return -1;
    rec->used[1] = larger_index(rec->used[1], n + 1); /* what is remembered there is overwritten */
    rec->phase[n] = M->before + phase;
    rec->duration[n] = h;
    rec->kind[n] = kind;
    rec->event[n] = event;
    double *start = rec->start + (size_t)n * fl->size;
    Complex turn = turned(phase);
    const Complex *steady = response_of(fl, 0, 0);
    for (int i = 0; i < fl->size; i++) start[i] = M->w[i] + product(steady[i], turn).re;
    for (int k = 0; k < fl->n_terms; k++) {
        Complex e = term_at(fl->terms + k, fl->omega, phase).value;
        const Complex *share = response_of(fl, 1 + k, 0);
        for (int i = 0; i < fl->size; i++) start[i] += product(share[i], e).re;
    }
    size_t width = (size_t)fl->n_stops * M->panel->m;
    for (size_t i = n * width; i < (n + 1) * width; i++) rec->force[i] = rec->depth[i] = 0.0;
    rec->used[0] = n + 1;
    return n;
}

/* record the panel that has been solved; whether there was room */
static bool record_panel(Motion *M, double phase, double h, int kind, int event)
{
    const Panel *panel = M->panel;
    int64_t n = record_piece(M, phase, h, kind, event);
    if (n < 0) return false;
    for (int a = 0; a < panel->na; a++) {
        size_t place = ((size_t)n * M->fl->n_stops + panel->active[a]) * panel->m;
        for (int i = 0; i < panel->m; i++) {
            M->rec->force[place + i] = panel->F[a * panel->m + i];
            M->rec->depth[place + i] = panel->output[a * panel->m + i];
        }
    }
    return true;
}

/* keep what a motion before needs to serve as a guess at the end of its own record; `width` is the
 * number of depths of a piece */
static void remember(Record *rec, size_t width)
{
    int64_t used = rec->used[0], size = rec->capacity;
    rec->used[0] = 0;
    rec->used[1] = size;
    if (2 * used > size) return;
    for (int64_t i = used - 1; i >= 0; i--) {
        int64_t n = size - used + i;
        rec->phase[n] = rec->phase[i];
        rec->duration[n] = rec->duration[i];
        rec->kind[n] = rec->kind[i];
        rec->event[n] = rec->event[i];
        memmove(rec->depth + n * width, rec->depth + i * width, sizeof(double) * width);
    }
    rec->used[1] = size - used;
}
