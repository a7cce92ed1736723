/* Local extremes of an output of a recorded motion. */
#include "engine.h"

#define UNSEEN 1e-14 /* share of a displacement that rounding may be */
#define PER_HALF_WAVE 8.0 /* samples of the fastest motion that is seen, between which is sought */
#define SOON 1e-6 /* of the time to the next sample: a difference over it is the slope of a rate */
#define MOST_SAMPLES 3000000 /* of a piece, in which no more extremes are told */
#define RENEWED 64 /* samples from which on exponentials are computed anew, not by those before */
#define KEPT_WEIGHTS 1024 /* samples of a panel whose weights are kept for the next panel */

/* row . w + Re Σ forced e(t), of all terms of the response and of a base on which it rides */
typedef struct {
    const double *row, *row1; /* (2n,) of the displacement and its rate */
    Complex *forced;          /* (1 + n_terms,) */
} Moving;

/* a search for extremes of an output */
typedef struct {
    Flow fl;
    Piece piece;
    Watch watch;
    Moving moving[2]; /* the output; of a round clearance both directions */
    const Stop *round; /* of one, or none */
    int n_terms;
    Term *terms;
    double *w, *v, *weights, *fresh;
    Square *steps, *now; /* (n,) exponentials over a sample, and from the start to the one at hand */
    Complex turn, turn_step; /* e^{iωt} at the sample at hand, and over a sample */
    int64_t n_samples, kept; /* of the piece at hand; with which `weights` were made */
    int out, sign, first_sign;
    bool *closed; /* (n_stops,) in the piece at hand, where stops are coupled */
    double shift; /* gap of a coupled stop, less that which its row has there */
    double first_value;
    double t_old, rate_old, t_older, rate_older;
    Extreme *found; /* (capacity,) */
    int64_t capacity, count;
} Search;

/* value and rate (slope) of a displacement, with the homogeneous state w, a time t after the start
 * of the piece, where the excitation is at e^{iωt} = turn */
static Value moving_rate(const Search *S, const Moving *moving, double t, Complex turn,
                         const double *w)
{
    double omega = S->fl.omega, phase = S->piece.phase + omega * t;
    Complex swing = product(moving->forced[0], turn);
    Value found = {swing.re + S->shift, -omega * swing.im};
    for (int k = 0; k < S->n_terms; k++) {
        TermCourse e = term_since(S->terms + k, omega, phase, t);
        found.value += product(moving->forced[1 + k], e.value).re;
        found.slope += product(moving->forced[1 + k], e.first).re;
    }
    for (int k = 0; k < S->fl.size; k++) {
        found.value += moving->row[k] * w[k];
        found.slope += moving->row1[k] * w[k];
    }
    return found;
}

/* the same of the output; of a round clearance the distance from its centre, positive within a ring,
 * and what changes its sign with its rate, smooth at the centre */
static Value output_rate(const Search *S, double t, Complex turn, const double *w)
{
    Value first = moving_rate(S, S->moving, t, turn, w);
    if (!S->round) return first;
    Value second = moving_rate(S, S->moving + 1, t, turn, w);
    double x = first.value - S->round->centre;
    double y = second.value - stop_of(&S->fl, (int)S->round->second)->centre;
    double share = S->round->sense / S->round->gap;
    return (Value){S->round->sense * hypot(x, y), share * (x * first.slope + y * second.slope)};
}

/* the same with the state solved for */
static Value output_rate_at(Search *S, double t)
{
    state_at(&S->piece, t, S->v);
    return output_rate(S, t, turned(S->piece.phase + S->fl.omega * t), S->v);
}

static void append_extreme(Search *S, double phase, double value, int sign)
{
    if (S->count < S->capacity) {
        S->found[S->count] = (Extreme){phase, value, sign > 0, value};
    }
    S->count++;
}

/* weight of the value at the far end when the near end moves once more on the same side */
static double shrink(double new, double old)
{
    double weight = old != 0.0 ? 1.0 - new / old : 0.5;
    return weight > 0.0 ? weight : 0.5;
}

/* append the extreme where the rate changes its sign between two times of a piece, by the secant
 * that weighs down an end kept twice [Anderson and Björck 1973] */
static void append_turning_point(Search *S, int sign, double lo, double hi, double rate_lo,
                                 double rate_hi)
{
    double middle = hi, value = 0.0, spacing = S->piece.h / (double)S->n_samples;
    for (int step = 0; step < 100; step++) {
        double last = middle;
        middle = lo - rate_lo * (hi - lo) / (rate_hi - rate_lo);
        if (step > 10 && step % 2 == 0) middle = 0.5 * (lo + hi);
        Value at = output_rate_at(S, middle);
        value = at.value;
        if (at.slope * sign > 0.0) {
            if (step > 0 && last < middle) rate_hi *= shrink(at.slope, rate_lo);
            lo = middle;
            rate_lo = at.slope;
        } else {
            if (step > 0 && last > middle) rate_lo *= shrink(at.slope, rate_hi);
            hi = middle;
            rate_hi = at.slope;
        }
        if (fabs(middle - last) <= SLACK * spacing || at.slope == 0.0) break;
    }
    append_extreme(S, S->piece.phase + S->fl.omega * middle, value, sign);
}

/* where the parabola through three rates of one sign comes within a quarter of zero, or nan */
static double near_zero(double a, double b, double c, double rate_a, double rate_b, double rate_c)
{
    double first = (rate_b - rate_a) / (b - a), last = (rate_c - rate_b) / (c - b);
    double curvature = (last - first) / (c - a);
    if (curvature * rate_b <= 0.0) return NAN;
    double slope = first + curvature * (b - a), where = b - 0.5 * slope / curvature;
    double value = rate_b - 0.25 * slope * slope / curvature;
    double least = smaller(smaller(fabs(rate_a), fabs(rate_b)), fabs(rate_c));
    return value * rate_b < 0.25 * least * fabs(rate_b) ? where : NAN;
}

/* Look for two extremes between samples of one sign, where their parabola comes to zero; behind an
 * impact, where the rate may turn fast, by its slope. */
static void look_between(Search *S, int64_t i, double t, double rate)
{
    double lo = S->t_older, hi = t, rate_lo = S->rate_older, rate_hi = rate;
    double middle = S->t_old, rate_middle = S->rate_old, slope = 0.0;
    if (i == 1) {
        lo = S->t_old;
        rate_lo = S->rate_old;
        slope = (output_rate_at(S, SOON * t).slope - S->rate_old) / (SOON * t);
    }
    for (int step = 0; step < 3; step++) {
        double where;
        if (i == 1 && step == 0)
            where = slope * S->rate_old < 0.0 ? -2.0 * S->rate_old / slope : hi;
        else
            where = near_zero(lo, middle, hi, rate_lo, rate_middle, rate_hi);
        if (!(lo < where && where < hi) || where == middle) return;
        double rate_where = output_rate_at(S, where).slope;
        if (where < middle) {
            hi = middle;
            rate_hi = rate_middle;
        } else {
            lo = middle;
            rate_lo = rate_middle;
        }
        if (rate_where * S->sign < 0.0) {
            append_turning_point(S, S->sign, lo, where, rate_lo, rate_where);
            append_turning_point(S, -S->sign, where, hi, rate_where, rate_hi);
            S->rate_old = 0.0; /* the next three samples would show the same pair */
            return;
        }
        middle = where;
        rate_middle = rate_where;
    }
}

/* set to zero what the output shows by rounding alone, vibrations that ended long ago, of modes that
 * may be very fast; the fastest vibration left, in rad/s */
static double leave_unseen(Search *S)
{
    const Flow *fl = &S->fl;
    double least = 0.0, fastest = 0.0, *w = S->piece.start, *sizes = S->v;
    for (int b = 0; b < fl->n; b++) sizes[b] = 0.0;
    for (int d = 0; d < (S->round ? 2 : 1); d++) {
        const Moving *moving = S->moving + d;
        for (int p = 0; p <= S->n_terms; p++) least += modulus(moving->forced[p]);
        for (int b = 0; b < fl->n; b++) {
            int j = 2 * b;
            sizes[b] += hypot(moving->row[j], moving->row[j + 1]) * hypot(w[j], w[j + 1]);
        }
    }
    for (int b = 0; b < fl->n; b++) least += sizes[b];
    least *= UNSEEN;
    for (int b = 0; b < fl->n; b++) {
        if (sizes[b] <= least) {
            w[2 * b] = w[2 * b + 1] = 0.0;
            continue;
        }
        const double *block = block_of(fl, b);
        double half = 0.5 * (block[0] - block[3]), square = half * half + block[1] * block[2];
        fastest = larger(fastest, sqrt(larger(-square, 0.0)));
    }
    return fastest;
}

/* Homogeneous state at sample i of a flight, which from time to time is computed anew: a sum of many
 * roundings. */
static void next_in_flight(Search *S, int64_t i, double t)
{
    double *w = S->w;
    if (i % RENEWED == 0) {
        state_at(&S->piece, t, w);
        return;
    }
    for (int b = 0; b < S->fl.n; b++) move_pair(S->steps[b], w + 2 * b);
}

/* the same of a panel, with the weights of the nodes up to the sample */
static void next_in_contact(Search *S, const double *weights, int64_t i, double t)
{
    if (S->piece.kind != 0) { /* its samples do not lie evenly */
        state_in_contact(&S->piece, weights, t, S->w);
        return;
    }
    carried_back(&S->piece, weights, S->w);
    for (int b = 0; b < S->fl.n; b++) {
        bool anew = i % RENEWED == 0;
        S->now[b] = anew ? block_exponential(block_of(&S->fl, b), t) : times(S->steps[b], S->now[b]);
        move_pair(S->now[b], S->w + 2 * b);
    }
}

/* e^{iωt} at sample i */
static Complex next_turn(const Search *S, int64_t i, double t)
{
    bool evenly = S->piece.kind <= 0;
    if (evenly && i % RENEWED != 0) return product(S->turn, S->turn_step);
    return turned(S->piece.phase + S->fl.omega * t);
}

/* fill the weights of the nodes up to the samples of a panel, unless those at hand fit */
static void make_weights(Search *S)
{
    if (S->kept == S->n_samples || S->n_samples >= KEPT_WEIGHTS) return;
    for (int64_t i = 0; i <= S->n_samples; i++)
        antiderivative_weights(S->piece.tab, (double)i / S->n_samples,
                               S->weights + (size_t)i * S->piece.tab->m);
    S->kept = S->n_samples;
}

static const double *weights_at(Search *S, int64_t i)
{
    if (S->n_samples < KEPT_WEIGHTS) return S->weights + (size_t)i * S->piece.tab->m;
    antiderivative_weights(S->piece.tab, (double)i / S->n_samples, S->fresh);
    return S->fresh;
}

/* look at the sample i of a piece, at time t, and between it and those before */
static void look_at(Search *S, int64_t n, int64_t i, double t)
{
    Value at = output_rate(S, t, S->turn, S->w);
    int sign = at.slope > 0.0 ? 1 : at.slope < 0.0 ? -1 : S->sign;
    if (n == 0 && i == 0) S->first_value = at.value;
    if (S->first_sign == 0) S->first_sign = S->sign = sign;
    if (sign != S->sign) {
        if (i > 0)
            append_turning_point(S, S->sign, S->t_old, t, S->rate_old, at.slope);
        else
            append_extreme(S, S->piece.phase + S->fl.omega * t, at.value, S->sign);
        S->sign = sign;
    } else if (S->piece.kind == FLIGHT && S->rate_old * at.slope > 0.0 &&
               (i == 1 || S->rate_older * S->rate_old > 0.0)) {
        look_between(S, i, t, at.slope);
    }
    S->t_older = S->t_old;
    S->rate_older = S->rate_old;
    S->t_old = t;
    S->rate_old = at.slope;
}

/* terms and rows of the output's directions, with what is closed in a piece */
static void show_output(Search *S, const int *rows)
{
    const Flow *fl = &S->fl;
    for (int d = 0; d < 2; d++) {
        S->moving[d].row = row_of(fl, 0, rows[d]);
        S->moving[d].row1 = row_of(fl, 1, rows[d]);
        for (int p = 0; p <= fl->n_terms; p++) S->moving[d].forced[p] = forced_of(fl, p, 0, rows[d]);
    }
}

/* the same of a coupled stop in a recorded piece: those are closed that have penetrations there */
static void couple_in_piece(Search *S, const Recorded *piece)
{
    const Flow *fl = &S->fl;
    int m = (int)S->piece.tab->m, rows[2] = {S->out, S->out};
    if (S->out >= fl->n_stops || !is_coupled(fl, S->out)) return;
    for (int s = 0; s < fl->n_stops; s++) {
        S->closed[s] = false;
        for (int i = 0; i < m; i++)
            S->closed[s] = S->closed[s] || depths_of(fl, m, piece)[(size_t)s * m + i] != 0.0;
    }
    couple(fl, S->closed);
    show_output(S, rows);
    S->shift = fl->plain->stops[(size_t)S->out * fl->n_columns + GAP] - stop_of(fl, S->out)->gap;
}

/* go through the samples of piece n; `moved` is the fastest motion in contact */
static void search_piece(Search *S, const Record *rec, int64_t n, double moved)
{
    Piece *piece = &S->piece;
    const Gauss *tab = piece->tab;
    begin_piece(piece, rec, n);
    couple_in_piece(S, recorded(rec, n));
    double seen = larger(S->fl.omega, leave_unseen(S));
    bool flight = piece->kind == FLIGHT;
    if (!flight) seen = larger(seen, moved);
    double wanted = ceil(piece->h * seen * (PER_HALF_WAVE / PI));
    int64_t count = wanted < MOST_SAMPLES ? (int64_t)wanted : MOST_SAMPLES; /* also of nan */
    S->n_samples = larger_index(count, 0) + 1 + (flight ? 0 : tab->m);
    if (!flight) make_weights(S);
    double step = piece->h / (double)S->n_samples;
    for (int b = 0; piece->kind <= 0 && b < S->fl.n; b++)
        S->steps[b] = block_exponential(block_of(&S->fl, b), step);
    S->turn_step = turned(S->fl.omega * step);
    for (int64_t i = 0; i <= S->n_samples; i++) {
        if (i % 1024 == 1023 && interrupted(&S->watch)) return;
        double x = (double)i / (double)S->n_samples;
        double t = piece->h * (flight ? x : map_fraction(tab, piece->kind, x));
        if (flight)
            next_in_flight(S, i, t);
        else
            next_in_contact(S, weights_at(S, i), i, t);
        S->turn = next_turn(S, i, t);
        look_at(S, n, i, t);
    }
}

/* give a search its memory, or measure it; `more` is the number of terms of a base */
static void lay_out_search(Block *block, const System *sys, const Gauss *tab, size_t more,
                           Search *S)
{
    lay_out_flow(block, sys, 0, NULL, &S->fl);
    lay_out_piece(block, &S->fl, tab, &S->piece);
    S->terms = room(block, most_terms(sys) + more, sizeof(Term));
    for (int d = 0; d < 2; d++)
        S->moving[d].forced = room(block, 1 + most_terms(sys) + more, sizeof(Complex));
    S->closed = flags(block, S->fl.n_stops);
    S->w = numbers(block, S->fl.size);
    S->v = numbers(block, S->fl.size);
    S->weights = numbers(block, (size_t)(KEPT_WEIGHTS + 1) * tab->m);
    S->fresh = numbers(block, tab->m);
    S->steps = room(block, S->fl.n, sizeof(Square));
    S->now = room(block, S->fl.n, sizeof(Square));
}

/* the terms of the output: those of the response, and Σ Re(amplitudes e^{i orders ωt}) of a base */
static void begin_output(Search *S, int out, int64_t more, const double *orders,
                         const Complex *amplitudes)
{
    const Flow *fl = &S->fl;
    S->round = out < fl->n_stops && is_round(fl, out) ? stop_of(fl, out) : NULL;
    S->sign = S->first_sign = 0;
    S->first_value = S->t_old = S->rate_old = S->t_older = S->rate_older = 0.0;
    int rows[2] = {out, S->round ? (int)S->round->second : out};
    S->n_terms = fl->n_terms + (int)more;
    for (int p = 0; p < fl->n_terms; p++) S->terms[p] = fl->terms[p];
    S->out = out;
    S->shift = 0.0;
    show_output(S, rows);
    for (int p = 0; p < more; p++) {
        S->moving[0].forced[1 + fl->n_terms + p] = amplitudes[p];
        S->moving[1].forced[1 + fl->n_terms + p] = (Complex){0.0, 0.0}; /* nothing rides there */
        S->terms[fl->n_terms + p] = (Term){STEADY, orders[p], {0.0, 0.0}};
    }
}

/* search an output from the start of a motion to its end; `moved` is the fastest motion in contact */
static void search_output(Search *S, const Record *rec, double moved)
{
    for (int64_t n = 0; n < n_recorded(rec) && !S->watch.stopped; n++) {
        search_piece(S, rec, n, moved);
        interrupted(&S->watch);
    }
    if (S->sign != S->first_sign)
        append_extreme(S, recorded(rec, 0)->phase, S->first_value, S->sign);
}

/* begin a search with memory of its own, which is none if there was none left */
static char *begin_search(const Host *host, const System *sys, const Gauss *tab, double omega,
                          int64_t more, Search *S)
{
    Block block = {NULL, 0};
    lay_out_search(&block, sys, tab, more, S);
    char *memory = malloc(block.used);
    if (!memory) return NULL;
    block = (Block){memory, 0};
    lay_out_search(&block, sys, tab, more, S);
    begin_watch(&S->watch, host);
    S->fl.watch = &S->watch;
    at_frequency(sys, omega, NULL, &S->fl);
    return memory;
}

/* Fill all local extremes (capacity,) of an output, each with a key of its own kind: 1 for a maximum,
 * else 0. How many there are, also of those that had no room, or -1 without memory.
 *
 * The rate is sampled sixteen times per period of the fastest mode that `leave_unseen` leaves, or
 * that stops move in contact; its sign changes are refined. In flight, where a parabola through
 * three samples of one sign comes near zero, it is looked for a change of sign there: two extremes
 * closer than the samples. So it is behind the first, which may be an impact, by the rate's slope.
 * The motion is taken as periodic: an extreme at its start counts once. */
EXPORT int64_t nldyn_local_extremes(const Host *host, const System *sys, const Gauss *tab,
                                    const Record *rec, double omega, int64_t out, int64_t more,
                                    const double *orders, const Complex *amplitudes,
                                    int64_t capacity, Extreme *found)
{
    Search S = {.found = found, .capacity = capacity, .kept = -1};
    char *memory = begin_search(host, sys, tab, omega, more, &S);
    if (!memory) return -1;
    begin_output(&S, (int)out, more, orders, amplitudes);
    search_output(&S, rec, fastest_moved(sys));
    end_watch(&S.watch);
    free(memory);
    return S.count;
}

/* Fill the local extremes (capacity,) of the penetrations of the first stops, whose gaps (n_stops,)
 * are taken off, one stop after the other, with keys of the stops, see `Extreme`; and for each stop
 * (n_stops,) how many of these are shallow: within a share of its largest. How many there are, also
 * of those that had no room, or -1 without memory. */
EXPORT int64_t nldyn_touches(const Host *host, const System *sys, const Gauss *tab,
                             const Record *rec, double omega, int64_t n_stops, const double *gaps,
                             double share, int64_t capacity, Extreme *found, int64_t *shallow)
{
    Search S = {.found = found, .capacity = capacity, .kept = -1};
    char *memory = begin_search(host, sys, tab, omega, 0, &S);
    if (!memory) return -1;
    double moved = fastest_moved(sys);
    for (int64_t stop = 0; stop < n_stops; stop++) {
        int64_t before = S.count;
        double deepest = 0.0;
        begin_output(&S, (int)stop, 0, NULL, NULL);
        search_output(&S, rec, moved);
        int64_t end = S.count < capacity ? S.count : capacity;
        for (int64_t i = before; i < end; i++) {
            found[i].value = found[i].output - gaps[stop];
            found[i].key += (double)(2 * stop);
            deepest = larger(deepest, fabs(found[i].value));
        }
        shallow[stop] = 0;
        for (int64_t i = before; i < end; i++)
            shallow[stop] += fabs(found[i].value) <= share * deepest;
    }
    end_watch(&S.watch);
    free(memory);
    return S.count;
}
