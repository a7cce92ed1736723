/* The record of a motion. */
#include "engine.h"

/* append a piece; none when the record is full */
static Recorded *record_piece(Motion *M, double phase, double h, int kind, int event)
{
    Record *rec = M->rec;
    const Flow *fl = M->fl;
    int64_t n = n_recorded(rec);
    if (n >= rec->capacity) return NULL;
    M->ahead = larger_index(M->ahead, n + 1); /* what is remembered there is overwritten */
    Recorded *piece = recorded(rec, n);
    piece->phase = M->before + phase;
    piece->duration = h;
    piece->kind = kind;
    piece->event = event;
    double *start = piece->start;
    Complex turn = turned(phase);
    const Complex *steady = response_of(fl, 0, 0);
    for (int i = 0; i < fl->size; i++) start[i] = M->w[i] + product(steady[i], turn).re;
    for (int k = 0; k < fl->n_terms; k++) {
        Complex e = term_at(fl->terms + k, fl->omega, phase).value;
        const Complex *share = response_of(fl, 1 + k, 0);
        for (int i = 0; i < fl->size; i++) start[i] += product(share[i], e).re;
    }
    memset(forces_of(fl, piece), 0, sizeof(double) * 2 * fl->n_stops * M->panel->m);
    rec->block[0] = (double)(n + 1);
    return piece;
}

/* record the panel that has been solved; whether there was room */
static bool record_panel(Motion *M, double phase, double h, int kind, int event)
{
    const Panel *panel = M->panel;
    int m = panel->m;
    Recorded *piece = record_piece(M, phase, h, kind, event);
    if (!piece) return false;
    double *forces = forces_of(M->fl, piece), *depths = depths_of(M->fl, m, piece);
    for (int a = 0; a < panel->na; a++) {
        size_t place = (size_t)panel->active[a] * m;
        memcpy(forces + place, panel->F + a * m, sizeof(double) * m);
        memcpy(depths + place, panel->output + a * m, sizeof(double) * m);
    }
    return true;
}

/* put the pieces of a motion before at the end of a record, where they serve as guesses: those of a
 * block of another one, or what it has itself recorded */
static void remember(Motion *M, const double *other)
{
    const Record *rec = M->rec;
    const double *from = other ? other : rec->block;
    int64_t used = (int64_t)from[0];
    rec->block[0] = 0.0;
    M->ahead = rec->capacity;
    M->other = other != NULL;
    if (2 * used > rec->capacity) return;
    M->ahead -= used;
    memcpy(recorded(rec, M->ahead), from + rec->width, sizeof(double) * used * rec->width);
}
