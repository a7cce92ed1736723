/* States within a recorded piece. */
#include "engine.h"

/* a piece of a recorded motion */
typedef struct {
    const Flow *fl;
    const Gauss *tab;
    int kind;
    double h, phase;
    double *start;   /* (2n,) homogeneous state at its start */
    double *shares;  /* (m, 2n) the nodes' impulses on the state, carried back to the start */
    double *weights; /* (m,) scratch */
} Piece;

/* inverse of `map_fraction` between two switches with the power 4, from a guess s */
static double inverted_map(const Gauss *tab, double x, double s)
{
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 60; i++) {
        double error = map_fraction(tab, 3, s) - x;
        if (error > 0.0)
            high = s;
        else
            low = s;
        double slope = 140.0 * cubed(s * (1.0 - s)), step = slope > 0.0 ? error / slope : INFINITY;
        double next = s - step;
        s = low < next && next < high ? next : 0.5 * (low + high);
        if (fabs(step) <= SUM_ROUNDING || high - low <= SUM_ROUNDING) break;
    }
    return s;
}

/* inverse of `map_fraction` */
static double stretched_time(const Gauss *tab, int kind, double x)
{
    bool square = tab->power == 2;
    x = smaller(larger(x, 0.0), 1.0);
    if (kind == 0) return x;
    if (kind == 1) {
        double left = sqrt(1.0 - x);
        return 1.0 - (square ? left : sqrt(left));
    }
    if (kind == 2) return square ? sqrt(x) : sqrt(sqrt(x));
    double s = acos(1.0 - 2.0 * x) / PI;
    return square ? s : inverted_map(tab, x, s);
}

/* weights (m,) of the node values in the integral of their interpolant from 0 to s, by
 * ∫ P_k = (P_{k+1} - P_{k-1})/(2k + 1) of Legendre's polynomials */
static void antiderivative_weights(const Gauss *tab, double s, double *out)
{
    int m = (int)tab->m;
    double x = 2.0 * s - 1.0, before = 1.0, here = x;
    for (int j = 0; j < m; j++) out[j] = 0.0;
    for (int degree = 0; degree < m; degree++) {
        double integral = s;
        if (degree > 0) {
            double next = ((2 * degree + 1) * x * here - degree * before) / (degree + 1);
            integral = 0.5 * (next - before) / (2 * degree + 1);
            before = here;
            here = next;
        }
        const double *row = tab->to_legendre + (size_t)degree * m;
        for (int j = 0; j < m; j++) out[j] += integral * row[j];
    }
}

/* fill the nodes' impulses from their forces (n_stops, m) */
static void fill_impulses(const Piece *piece, const double *forces)
{
    const Flow *fl = piece->fl;
    const Gauss *tab = piece->tab;
    int m = (int)tab->m;
    for (int j = 0; j < m; j++) {
        double slope = piece->h * tab->slope[piece->kind * m + j];
        double *share = piece->shares + (size_t)j * fl->size;
        for (int k = 0; k < fl->size; k++) share[k] = 0.0;
        for (int a = 0; a < fl->n_stops; a++) {
            const double *push = push_of(fl, a);
            double impulse = forces[a * m + j];
            for (int k = 0; k < fl->size; k++) share[k] += slope * push[k] * impulse;
        }
        fly_state(fl->blocks, fl->n, share, -piece->h * tab->chi[piece->kind * m + j]);
    }
}

/* fill w (2n,) with a state in a panel carried back to its start, by the weights of the nodes up to
 * there */
static void carried_back(const Piece *piece, const double *weights, double *w)
{
    int size = piece->fl->size;
    for (int k = 0; k < size; k++) w[k] = piece->start[k];
    for (int j = 0; j < piece->tab->m; j++) {
        const double *share = piece->shares + (size_t)j * size;
        for (int k = 0; k < size; k++) w[k] -= weights[j] * share[k];
    }
}

/* fill w (2n,) a time t after the start of a panel, with the weights of the nodes up to t */
static void state_in_contact(const Piece *piece, const double *weights, double t, double *w)
{
    carried_back(piece, weights, w);
    fly_state(piece->fl->blocks, piece->fl->n, w, t);
}

/* fill w with the homogeneous state a time t after the start of a piece */
static void state_at(const Piece *piece, double t, double *w)
{
    if (piece->kind == FLIGHT) {
        for (int k = 0; k < piece->fl->size; k++) w[k] = piece->start[k];
        fly_state(piece->fl->blocks, piece->fl->n, w, t);
        return;
    }
    antiderivative_weights(piece->tab, stretched_time(piece->tab, piece->kind, t / piece->h),
                           piece->weights);
    state_in_contact(piece, piece->weights, t, w);
}

/* begin a piece of a record, less its steady responses */
static void begin_piece(Piece *piece, const Record *rec, int64_t n)
{
    const Flow *fl = piece->fl;
    const Recorded *from = recorded(rec, n);
    piece->kind = (int)from->kind;
    piece->h = from->duration;
    piece->phase = from->phase;
    for (int k = 0; k < fl->size; k++) piece->start[k] = from->start[k];
    for (int p = 0; p <= fl->n_terms; p++) {
        if (p > 0 && fl->terms[p - 1].kind != STEADY) continue;
        Complex turn = turned(p == 0 ? piece->phase : fl->terms[p - 1].order * piece->phase);
        const Complex *share = response_of(fl, p, 0);
        for (int k = 0; k < fl->size; k++) piece->start[k] -= product(share[k], turn).re;
    }
    if (piece->kind != FLIGHT) fill_impulses(piece, forces_of(fl, from));
}

static void lay_out_piece(Block *block, const Flow *fl, const Gauss *tab, Piece *piece)
{
    piece->fl = fl;
    piece->tab = tab;
    piece->start = numbers(block, fl->size);
    piece->shares = numbers(block, (size_t)tab->m * fl->size);
    piece->weights = numbers(block, tab->m);
}

/* add the response to the excitation, at a phase a time t after the start of a piece */
static void add_response(const Piece *piece, double phase, double t, double *state)
{
    const Flow *fl = piece->fl;
    for (int p = 0; p <= fl->n_terms; p++) {
        Complex e = turned(phase);
        if (p > 0) e = term_since(fl->terms + p - 1, fl->omega, phase, t).value;
        const Complex *share = response_of(fl, p, 0);
        for (int k = 0; k < fl->size; k++) state[k] += product(share[k], e).re;
    }
}

/* Fill states (n_phases, 2n) at ascending forcing phases of a recorded motion. */
EXPORT int64_t nldyn_sample_states(const Host *host, const System *sys, const Gauss *tab,
                                   const Record *rec, double omega, int64_t n_phases,
                                   const double *phases, double *states)
{
    Flow fl;
    Piece piece;
    Watch watch;
    Block block = {NULL, 0};
    lay_out_flow(&block, sys, 0, NULL, &fl);
    lay_out_piece(&block, &fl, tab, &piece);
    char *memory = malloc(block.used);
    if (!memory) return OUT_OF_MEMORY;
    block = (Block){memory, 0};
    lay_out_flow(&block, sys, 0, NULL, &fl);
    lay_out_piece(&block, &fl, tab, &piece);
    begin_watch(&watch, host);
    fl.watch = &watch;
    at_frequency(sys, omega, NULL, &fl);
    int64_t n = 0, ready = -1;
    for (int64_t i = 0; i < n_phases && !(i % 64 == 63 && interrupted(&watch)); i++) {
        while (n + 1 < n_recorded(rec) && recorded(rec, n + 1)->phase <= phases[i]) n++;
        if (ready != n) begin_piece(&piece, rec, n);
        ready = n;
        double t = (phases[i] - piece.phase) / omega;
        state_at(&piece, t, states + (size_t)i * fl.size);
        add_response(&piece, phases[i], t, states + (size_t)i * fl.size);
    }
    end_watch(&watch);
    free(memory);
    return watch.stopped ? INTERRUPTED : OK;
}
