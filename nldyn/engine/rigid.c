/* Rigid stops: impacts, at which velocities jump, and rest, in which a force holds the gap closed.
 *
 * An impact takes the impulse J = (1 + e) v / Σ c² from the modes, with the speed v at which the
 * gap closes and the restitution e. Where several stops are hit at once, impacts follow each other
 * within the instant, the fastest first, each with its own restitution, until no gap closes:
 * energy never grows.
 *
 * A body rests on a stop where it would bounce no higher than rounding. The impacts that would
 * follow have a finite sum in time and impulse: with the acceleration a towards the stop they take
 * (1 + e) v + e v (1 + e) + ... = v + a Δt within Δt = 2 e v / (a (1 - e)), which is what an impact
 * without rebound and the force of rest take. */
#include "engine.h"

#define ROUNDS 100 /* of impacts within one instant with restitution; then without */
#define SHUT 10.0  /* roundings of a gap that is shut, and of a rate that is none */
#define AT_START 1e5 /* the same at the start of a segment, whose state is known less well */
#define SLOW 1e-7 /* share of the first speed below which impacts are no longer told apart */
#define LOW 10.0 /* a body that would rebound no higher than this many roundings of the gap stays */
#define SEIZED 1e-2 /* of a mobility: what is left of it as a force that rubs grows without bound */
#define DIRECTIONS 180 /* of a plane, between which at most one way leaves */
#define OVER 1e-6 /* of the accelerations: by which what leaves gets faster, if it does at all */
#define HIT_AGAIN 1e-3 /* rad of the excitation, within which a body that pushes off hits again */

/* fill the rigid stops on which a body rests, and the sliders that stick; how many */
static int held_stops(const Motion *M, bool with_sliders)
{
    const Flow *fl = M->fl;
    int n = 0;
    for (int s = 0; s < fl->n_stops; s++)
        if (M->closed[s] && (is_rigid(fl, s) || (with_sliders && is_stuck(M, s))))
            M->s->resting[n++] = s;
    return n;
}

/* what a rigid stop presses on, or -1: a slider, of a round clearance the row of its friction */
static int rubbed_by(const Flow *fl, int stop)
{
    if (is_round(fl, stop)) return (int)stop_of(fl, stop)->second;
    for (int s = stop + 1; s < fl->n_stops && is_rigid(fl, stop); s++)
        if (is_pressed(fl, s) && (int)stop_of(fl, s)->normal == stop) return s;
    return -1;
}

/* what slides as a rigid stop presses it on, or -1 */
static int sliding_with(const Motion *M, int stop)
{
    int slider = rubbed_by(M->fl, stop);
    return slider >= 0 && M->closed[slider] && M->fl->slides[slider] != 0 ? slider : -1;
}

/* rows that a force acts on together, and its shares in them */
typedef struct {
    int count, row[3];
    double share[3];
} RowsAlong;

/* those of what is held: in a round clearance both directions, along the circle for its surface,
 * along the radius for itself, see `fill_directions` */
static RowsAlong held_along(const Motion *M, int s)
{
    if (!is_planar(M->fl, s)) return (RowsAlong){1, {s}, {1.0}};
    const double *along = is_second(M->fl, s) ? M->s->across : M->s->outward;
    int lead = is_second(M->fl, s) ? (int)stop_of(M->fl, s)->lead : s;
    int second = (int)stop_of(M->fl, lead)->second;
    return (RowsAlong){2, {lead, second}, {along[lead], along[second]}};
}

/* the same of what holds it, with what slides on it */
static RowsAlong holding_along(const Motion *M, int s)
{
    int slider = is_rigid(M->fl, s) ? sliding_with(M, s) : -1;
    RowsAlong along = held_along(M, s);
    if (slider < 0) return along;
    double most = grip(M->fl, slider), share = M->fl->slides[slider] * most;
    if (is_disc(M->fl, slider)) {
        int other = (int)stop_of(M->fl, slider)->beside;
        const double *u = M->s->across;
        return (RowsAlong){3, {s, slider, other}, {1.0, most * u[slider], most * u[other]}};
    }
    if (!is_round(M->fl, s)) return (RowsAlong){2, {s, slider}, {1.0, share}};
    for (int d = 0; d < 2; d++) along.share[d] += share * M->s->across[along.row[d]];
    return along;
}

/* fill directions in round clearances: s->across (n_stops,) along the circle, s->outward to where the
 * body presses; and over planes s->across to where it slides */
static void fill_directions(const Motion *M, double phase)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (M->closed[s] && is_hard_disc(fl, s) && !is_mate(fl, s) && fl->slides[s] != 0) {
            double u[2];
            fill_heading(M, s, phase, u);
            M->s->across[s] = u[0];
            M->s->across[(int)stop_of(fl, s)->beside] = u[1];
        }
        if (!is_second(fl, s)) continue;
        double place[2], speed[2], pace[2];
        int lead = (int)stop_of(fl, s)->lead;
        round_now(fl, lead, M->w, phase, place, speed, pace);
        Polar at = polar(fl, lead, place, speed);
        int rows[2] = {lead, s};
        for (int d = 0; d < 2; d++) {
            M->s->outward[rows[d]] = stop_of(fl, lead)->sense * at.n[d];
            M->s->across[rows[d]] = d == 0 ? -at.n[1] : at.n[0];
        }
    }
}

/* sum over rows of their share in numbers (n_stops,) */
static double sum_along(RowsAlong along, const double *values)
{
    double total = 0.0;
    for (int d = 0; d < along.count; d++) total += along.share[d] * values[along.row[d]];
    return total;
}

/* acceleration of what is held, by those of the rows */
static double held_pace(const Motion *M, int s, const double *rates, double phase)
{
    double pace = sum_along(held_along(M, s), rates);
    if (!is_planar(M->fl, s)) return pace;
    double place[2], speed[2], flight[2];
    int lead = is_second(M->fl, s) ? (int)stop_of(M->fl, s)->lead : s;
    round_now(M->fl, lead, M->w, phase, place, speed, flight);
    Polar at = polar(M->fl, lead, place, speed);
    if (lead == s) return pace + stop_of(M->fl, s)->sense * at.across * at.across / at.radius;
    return pace - at.across * (at.n[0] * speed[0] + at.n[1] * speed[1]) / at.radius;
}

/* force that holds a slider, by s->stop_forces */
static double held_force(const Motion *M, int s)
{
    return sum_along(held_along(M, s), M->s->stop_forces);
}

/* what presses it on */
static double held_on(const Motion *M, int s)
{
    const Flow *fl = M->fl;
    const double *forces = M->s->stop_forces;
    if (!is_second(fl, s)) return pressed_on(M, s);
    int lead = (int)stop_of(fl, s)->lead;
    double out = M->s->across[s] * forces[lead] - M->s->across[lead] * forces[s];
    return stop_of(fl, s)->sense * out;
}

/* speed along some rows that a unit impulse along others takes */
static double taken_along(const Flow *fl, RowsAlong of, RowsAlong by)
{
    double taken = 0.0;
    for (int a = 0; a < of.count; a++)
        for (int b = 0; b < by.count; b++)
            taken += of.share[a] * by.share[b] * between(fl, of.row[a], by.row[b]);
    return taken;
}

/* that which one at what is held, with that of what slides on it, takes from a row */
static double taken_by(const Motion *M, int row, int other)
{
    return taken_along(M->fl, (RowsAlong){1, {row}, {1.0}}, holding_along(M, other));
}

/* and from what is held */
static double held_by(const Motion *M, int stop, int other)
{
    return taken_along(M->fl, held_along(M, stop), holding_along(M, other));
}

/* fill and factor the speeds of closing per unit impulse of each of the `resting` stops, (n, n) */
static void factor_mobilities(const Motion *M, int n)
{
    Scratch *s = M->s;
    for (int a = 0; a < n; a++)
        for (int b = 0; b < n; b++)
            s->mobility[b * n + a] = held_by(M, s->resting[a], s->resting[b]);
    lu_factor(s->mobility, n, s->mobility_order);
}

/* fill s->stop_forces (n_stops,) of the closed stops, and s->pushes (n_stops,), the closing
 * accelerations with them; those of rigid stops keep their accelerations at zero */
static void contact_forces(const Motion *M, double phase)
{
    const Flow *fl = M->fl;
    double *forces = M->s->stop_forces, *rates = M->s->pushes, *holding = M->s->held;
    int n = fl->n_stops;
    for (int s = 0; s < n; s++) {
        Course at = output_now(fl, s, M->w, phase);
        rates[s] = at.second;
        forces[s] = M->closed[s] ? force_now(fl, s, M->w, phase) : 0.0;
        if (M->closed[s] && is_pressed(fl, s) && !is_strained(fl, s)) /* after what presses it on */
            forces[s] = sliding_law(fl, s, at.first, forces[(int)stop_of(fl, s)->normal]).force;
        if (M->closed[s] && slides_on_disc(fl, s)) {
            int first = first_tangent(fl, s);
            double u[2];
            if (is_sprung(fl, s))
                memcpy(u, disc_now(fl, first, M->w, phase).u, sizeof u);
            else
                fill_heading(M, first, phase, u);
            forces[s] = u[s != first] * grip(fl, s) * pressing_now(fl, s, M->w, phase).value;
        }
    }
    for (int b = 0; b < n; b++)
        if (forces[b] != 0.0)
            for (int s = 0; s < n; s++) rates[s] -= between(fl, s, b) * forces[b];
    fill_drags(M, phase);
    fill_directions(M, phase);
    int count = held_stops(M, true);
    if (count == 0) return;
    const int *stops = M->s->resting;
    factor_mobilities(M, count);
    for (int a = 0; a < count; a++) holding[a] = held_pace(M, stops[a], rates, phase);
    lu_apply_vector(M->s->mobility, count, M->s->mobility_order, holding);
    for (int a = 0; a < count; a++) {
        RowsAlong by = holding_along(M, stops[a]);
        for (int d = 0; d < by.count; d++) /* round clearances press, too */
            forces[by.row[d]] = by.share[d] * holding[a] +
                                (is_planar(fl, by.row[d]) ? forces[by.row[d]] : 0.0);
        for (int s = 0; s < n; s++) rates[s] -= taken_by(M, s, stops[a]) * holding[a];
    }
}

/* fill s->rate (2n,): rate of change of the homogeneous state with `stop_forces` at work */
static void state_rate(const Motion *M)
{
    const Flow *fl = M->fl;
    double *rate = M->s->rate;
    for (int k = 0; k < fl->size; k++) rate[k] = 0.0;
    add_rates(fl->blocks, fl->n, M->w, rate);
    for (int s = 0; s < fl->n_stops; s++) {
        const double *push = push_of(fl, s);
        double force = M->s->stop_forces[s];
        for (int k = 0; k < fl->size; k++) rate[k] -= push[k] * force;
        if (is_sprung(fl, s)) rate[place_entry(fl, s)] += M->s->drags[s];
    }
}

/* rigid stop whose gap is shut and closes fastest, or -1, and that speed; that of the stop `first`
 * counts as shut. Rates up to so many `roundings` are none. */
static int hit_stop(const Motion *M, double phase, int first, double roundings, double *fastest)
{
    const Flow *fl = M->fl;
    int hit = -1;
    *fastest = 0.0;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_rigid(fl, s)) continue;
        Course at = depth_now(fl, s, M->w, phase);
        bool shut = s == first || at.value >= -SHUT * gap_noise(fl, s, M->w);
        if (shut && at.first > larger(*fastest, roundings * gap_rate_noise(fl, s, M->w, phase))) {
            hit = s;
            *fastest = at.first;
        }
    }
    return hit;
}

/* whether a rebound against an acceleration is lost in the rounding of the gap */
static bool is_low(const Motion *M, int stop, double rebound, double push)
{
    return push > 0.0 &&
           rebound * rebound <= 2.0 * LOW * gap_noise(M->fl, stop, M->w) * push;
}

/* leave out of the stops on which a body is at rest those that it parts from */
static void leave_parting(const Motion *M, double phase, bool *still)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++)
        if (still[s] && is_rigid(fl, s))
            still[s] = depth_now(fl, s, M->w, phase).first >= -SHUT * gap_rate_noise(fl, s, M->w, phase);
}

/* add to sensitivities what s->rate makes of a shift in time (n_columns,), forth or back */
static void move(Motion *M, double sign, const double *shift)
{
    const double *rate = M->s->rate;
    for (int k = 0; k < M->fl->size; k++)
        for (int c = 0; c < M->n_columns; c++)
            M->columns[(size_t)k * M->n_columns + c] += rate[k] * (sign * shift[c]);
}

/* fill sensitivities of an output (order 0) or its rate at an instant that shifts, (n_columns,);
 * the columns have the states' own */
static void shifted_columns(const Motion *M, int stop, int order, double phase, double t,
                            const double *shift, double *found)
{
    const Flow *fl = M->fl;
    output_columns(fl, stop, order, phase, t, M->columns, M->n_columns, found);
    /* the excitation's share of the rate alone: that of the state is in the columns */
    Complex turn = product(forced_of(fl, 0, 0, stop), turned(phase));
    Course more = swelling(fl, stop, phase);
    double pace = order == 0 ? -fl->omega * turn.im + more.first
                             : -fl->omega * fl->omega * turn.re + more.second;
    for (int c = 0; c < M->n_columns && shift; c++) found[c] += pace * shift[c];
}

/* fill those of a displacement from a centre, times a share */
static void add_place_columns(const Motion *M, int row, double share, double phase, double t,
                              const double *shift, double *found)
{
    const Flow *fl = M->fl;
    double *moved = M->s->moved;
    shifted_columns(M, row, 0, phase, t, shift, moved);
    for (int c = 0; c < fl->n_parameters; c++)
        if (is_parameter(fl, c, CENTRE, row)) moved[fl->size + c] -= 1.0;
    for (int c = 0; c < M->n_columns; c++) found[c] += share * moved[c];
}

/* fill those of the penetration of a rigid stop; the instant does not shift without `shift` */
static void gap_columns(const Motion *M, int stop, double phase, double t, const double *shift,
                        double *found)
{
    const Flow *fl = M->fl;
    RowsAlong along = held_along(M, stop);
    double sense = is_round(fl, stop) ? stop_of(fl, stop)->sense : 1.0;
    for (int c = 0; c < M->n_columns; c++) found[c] = 0.0;
    for (int d = 0; d < along.count; d++)
        add_place_columns(M, along.row[d], along.share[d], phase, t, shift, found);
    for (int c = 0; c < fl->n_parameters; c++)
        if (is_parameter(fl, c, GAP, stop)) found[fl->size + c] -= sense;
}

/* fill those of the turn of the directions in a round clearance */
static void direction_columns(const Motion *M, int lead, double phase, double t, const double *shift,
                         double *found)
{
    double place[2], speed[2], pace[2];
    int rows[2] = {lead, (int)stop_of(M->fl, lead)->second};
    round_now(M->fl, lead, M->w, phase, place, speed, pace);
    double radius = hypot(place[0], place[1]);
    for (int c = 0; c < M->n_columns; c++) found[c] = 0.0;
    for (int d = 0; d < 2; d++)
        add_place_columns(M, rows[d], M->s->across[rows[d]] / radius, phase, t, shift, found);
}

/* fill those of the speed of what is held */
static void held_columns(const Motion *M, int s, double phase, double t, const double *shift,
                         double *found)
{
    const Flow *fl = M->fl;
    double *moved = M->s->moved;
    RowsAlong along = held_along(M, s);
    for (int c = 0; c < M->n_columns; c++) found[c] = 0.0;
    if (is_planar(fl, s)) { /* the direction turns */
        double place[2], speed[2], pace[2], sense = stop_of(fl, s)->sense;
        round_now(fl, along.row[0], M->w, phase, place, speed, pace);
        Polar at = polar(fl, along.row[0], place, speed);
        direction_columns(M, along.row[0], phase, t, shift, found);
        double by_turn = is_second(fl, s) ? -sense * at.rate : sense * at.across;
        for (int c = 0; c < M->n_columns; c++) found[c] *= by_turn;
    }
    for (int d = 0; d < along.count; d++) {
        shifted_columns(M, along.row[d], 1, phase, t, shift, moved);
        for (int c = 0; c < M->n_columns; c++) found[c] += along.share[d] * moved[c];
    }
}

/* fill `shift` (n_columns,): change of the instant at which a gap closes */
static void instant_shift(const Motion *M, int stop, double phase, double t, double *shift)
{
    double speed = depth_now(M->fl, stop, M->w, phase).first;
    gap_columns(M, stop, phase, t, NULL, shift);
    for (int c = 0; c < M->n_columns; c++) shift[c] = -shift[c] / speed;
}

/* take impulses at a stop or slider, and their changes (n_columns,), from the state */
static void push_state(Motion *M, int stop, double impulse, const double *by)
{
    const Flow *fl = M->fl;
    const double *push = push_of(fl, stop);
    for (int k = 0; k < fl->size && M->with_columns; k++)
        for (int c = 0; c < M->n_columns; c++)
            M->columns[(size_t)k * M->n_columns + c] -= push[k] * by[c];
    for (int k = 0; k < fl->size; k++) M->w[k] -= push[k] * impulse;
}

/* speed at which what a rigid stop presses on slides, if beyond rounding, over a plane along both
 * tangents (2,) */
static void fill_slip(const Motion *M, int slider, double phase, double *slip)
{
    const Flow *fl = M->fl;
    double size, noise;
    slip[1] = 0.0;
    if (is_disc(fl, slider)) {
        size = speeds_over(fl, slider, M->w, phase, slip);
        noise = speeds_noise(fl, slider, M->w);
    } else if (is_second(fl, slider)) {
        size = slip[0] = round_slip(fl, slider, M->w, phase).value;
        noise = round_slip_noise(fl, slider, M->w, phase);
    } else {
        double belt = stop_of(fl, slider)->belt;
        size = slip[0] = output_now(fl, slider, M->w, phase).first - belt;
        noise = rate_noise(fl, slider, M->w) + SUM_ROUNDING * fabs(belt);
    }
    if (fabs(size) <= SHUT * noise) slip[0] = slip[1] = 0.0;
}

/* fill changes (n_columns,) of an impulse: by those of the speeds of closing and sliding, in s->closing
 * and s->sliding, over a plane also s->aside, of the restitution and the friction, and in a round
 * clearance by its turn */
static void blow_columns(const Motion *M, int stop, int slider, Rubbing at, const Slopes *impulse,
                         double *by)
{
    const Flow *fl = M->fl;
    const Scratch *s = M->s;
    const double *slopes = impulse->by;
    double turn = 0.0;
    if (is_round(fl, stop)) {
        double sense = stop_of(fl, stop)->sense, both = sense * at.both;
        turn = 2.0 * both * (slopes[BY_NORMAL] - slopes[BY_TANGENT]) +
               sense * (at.tangent - at.normal) * slopes[BY_BOTH];
    }
    for (int c = 0; c < M->n_columns; c++) {
        by[c] = s->closing[c] * slopes[BY_SPEED];
        if (slider >= 0) by[c] += s->sliding[c] * slopes[BY_SLIP];
        if (slider >= 0 && is_disc(fl, slider)) by[c] += s->aside[c] * slopes[BY_SLIP_ASIDE];
        if (turn != 0.0) by[c] += s->turning[c] * turn;
    }
    for (int c = 0; c < fl->n_parameters; c++) {
        int64_t row = fl->parameters[2 * c + 1];
        if (is_parameter(fl, c, RESTITUTION, stop)) by[fl->size + c] += slopes[BY_RESTITUTION];
        if (slider < 0) continue;
        bool rub = is_round(fl, stop) && fl->parameters[2 * c] == RUB && row == stop;
        if (rub || is_parameter(fl, c, FRICTION, slider)) by[fl->size + c] += slopes[BY_FRICTION];
    }
}

/* take an impulse along some rows, and its changes, from the state */
static void push_rows(Motion *M, RowsAlong along, double impulse, const double *by)
{
    double *share = M->s->along_columns;
    for (int d = 0; d < along.count; d++) {
        for (int c = 0; c < M->n_columns && M->with_columns; c++) share[c] = along.share[d] * by[c];
        push_state(M, along.row[d], along.share[d] * impulse, share);
    }
}

/* take what impulses along the normal and the tangent change by as both turn from the sensitivities */
static void turn_impulses(Motion *M, int stop, double normal, double tangent)
{
    RowsAlong out = held_along(M, stop);
    double *by = M->s->along_columns, sense = stop_of(M->fl, stop)->sense;
    for (int d = 0; d < 2; d++) {
        int row = out.row[d];
        double turn = sense * (normal * M->s->across[row] - tangent * M->s->outward[row]);
        for (int c = 0; c < M->n_columns; c++) by[c] = turn * M->s->turning[c];
        push_state(M, row, 0.0, by);
    }
}

/* the impulses of an impact; those of friction are along one tangent, or both of a plane */
static Blow blow_of(Motion *M, int stop, int slider, double speed, Value restitution, double phase,
                    Rubbing *at)
{
    const Flow *fl = M->fl;
    RowsAlong normal = held_along(M, stop);
    *at = (Rubbing){taken_along(fl, normal, normal), 0.0, 1.0, 0.0};
    if (slider < 0) return blow(*at, restitution, speed, 0.0);
    double slip[2];
    RowsAlong tangent = held_along(M, slider);
    fill_slip(M, slider, phase, slip);
    *at = (Rubbing){at->normal, taken_along(fl, normal, tangent), taken_along(fl, tangent, tangent),
                    grip(fl, slider)};
    if (!is_disc(fl, slider)) return blow(*at, restitution, speed, slip[0]);
    int other = (int)stop_of(fl, slider)->beside;
    Plane plane = {at->normal, {at->both, between(fl, stop, other)},
                   {at->tangent, between(fl, slider, other), stop_of(fl, other)->mobility}, at->friction};
    Blow found = blow_over(plane, restitution, speed, slip);
    if (!isfinite(found.normal.value)) M->undecided = stop;
    return found;
}

/* one impact: the impulses on the state, and its sensitivities */
static void strike(Motion *M, int stop, double speed, Value restitution, double phase, double t,
                   const double *shift)
{
    const Flow *fl = M->fl;
    Scratch *s = M->s;
    Rubbing at;
    int slider = rubbed_by(fl, stop), other = slider >= 0 ? (int)stop_of(fl, slider)->beside : -1;
    Blow hit = blow_of(M, stop, slider, speed, restitution, phase, &at);
    if (M->undecided >= 0) return;
    int rows[3] = {stop, slider, other};
    const Slopes *impulses[3] = {&hit.normal, &hit.tangent, &hit.aside};
    double *speeds[3] = {s->closing, s->sliding, s->aside};
    for (int d = 0; d < 3 && M->with_columns; d++)
        if (rows[d] >= 0) held_columns(M, rows[d], phase, t, shift, speeds[d]);
    if (M->with_columns && is_round(fl, stop)) {
        direction_columns(M, stop, phase, t, shift, s->turning);
        turn_impulses(M, stop, hit.normal.value, hit.tangent.value);
    }
    for (int d = 0; d < 3; d++) {
        if (rows[d] < 0) continue;
        if (M->with_columns) blow_columns(M, stop, slider, at, impulses[d], s->gained);
        push_rows(M, held_along(M, rows[d]), impulses[d]->value, s->gained);
    }
}

/* fill s->offsets (count, 1 + n): gaps (rate 0) of the `resting` stops or the rates, and their
 * sensitivities */
static void fill_offsets(const Motion *M, double phase, double t, const double *shift, int count,
                         int rate, int n)
{
    const Flow *fl = M->fl;
    for (int a = 0; a < count; a++) {
        int stop = M->s->resting[a];
        double *off = M->s->offsets + (size_t)a * (1 + n);
        Course at = depth_now(fl, stop, M->w, phase);
        off[0] = rate == 1 ? at.first - stop_of(fl, stop)->belt : at.value;
        if (is_second(fl, stop)) off[0] = round_slip(fl, stop, M->w, phase).value;
        if (n == 0) continue;
        if (rate == 1)
            held_columns(M, stop, phase, t, shift, off + 1);
        else
            gap_columns(M, stop, phase, t, shift, off + 1);
    }
}

/* fill what a unit impulse at a stop, with that of what slides on it, takes from the state (2n,) */
static void fill_pull(const Motion *M, int stop, double *pull)
{
    const Flow *fl = M->fl;
    RowsAlong by = holding_along(M, stop);
    for (int k = 0; k < fl->size; k++) {
        pull[k] = 0.0;
        for (int d = 0; d < by.count; d++) pull[k] += by.share[d] * push_of(fl, by.row[d])[k];
    }
}

/* Shut the gaps of the stops that a body rests on, and stop their rates and those of the sliders
 * that stick, in all sensitivities: by a shift of the displacements along what an impulse moves,
 * and by an impulse. */
static void hold(Motion *M, double phase, double t, const double *shift)
{
    const Flow *fl = M->fl;
    Scratch *s = M->s;
    int n = M->with_columns ? M->n_columns : 0, factored = 0; /* rates: the same stops, or more */
    fill_directions(M, phase);
    for (int rate = 0; rate < 2; rate++) {
        int count = held_stops(M, rate == 1);
        if (count == 0) continue;
        if (count != factored) factor_mobilities(M, factored = count);
        fill_offsets(M, phase, t, shift, count, rate, n);
        lu_apply(s->mobility, count, s->mobility_order, s->offsets, 1 + n);
        for (int a = 0; a < count; a++) {
            const double *off = s->offsets + (size_t)a * (1 + n);
            fill_pull(M, s->resting[a], s->pull);
            for (int k = 0; k < fl->size; k++) s->along[k] = rate == 0 ? 0.0 : s->pull[k];
            if (rate == 0) add_rates(fl->blocks, fl->n, s->pull, s->along);
            for (int k = 0; k < fl->size; k++) {
                M->w[k] -= s->along[k] * off[0];
                for (int c = 0; c < n; c++)
                    M->columns[(size_t)k * n + c] -= s->along[k] * off[1 + c];
            }
        }
    }
}

/* let a slider slide whose speed is more than so many `roundings` */
static void loosen_slider(const Motion *M, int s, double phase, double roundings)
{
    const Flow *fl = M->fl;
    double speed = output_now(fl, s, M->w, phase).first - stop_of(fl, s)->belt;
    double noise = rate_noise(fl, s, M->w) + SUM_ROUNDING * fabs(stop_of(fl, s)->belt);
    if (is_second(fl, s)) {
        speed = round_slip(fl, s, M->w, phase).value;
        noise = round_slip_noise(fl, s, M->w, phase);
    }
    if (is_disc(fl, s)) {
        double both[2];
        speed = speeds_over(fl, first_tangent(fl, s), M->w, phase, both);
        noise = speeds_noise(fl, first_tangent(fl, s), M->w);
    }
    if (fabs(speed) <= roundings * noise && !(is_disc(fl, s) && slides_freely(fl, s))) return;
    if (is_disc(fl, s))
        set_slides(fl, s, 1);
    else
        fl->slides[s] = speed > 0.0 ? 1 : -1;
    M->panel->na = -1; /* its equations are others now */
}

/* whether a rigid stop on which a body rests moves as a slider does */
static bool holds_slider(const Motion *M, int s)
{
    for (int r = 0; r < M->fl->n_stops; r++) {
        bool flat = is_rigid(M->fl, r) && !is_round(M->fl, r);
        if (flat && M->closed[r] && moves_with(M->fl, s, r)) return true;
    }
    return false;
}

/* Leave sliders out that move as a rigid stop does on which a body rests: that holds them, and what
 * they would hold is not told. They are taken back when it lets go. What a rigid stop presses on
 * acts as long as a body rests there, and so do the second rows of rigid round clearances. */
static void hand_over_sliders(const Motion *M, double phase, double roundings)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        bool around = is_second(fl, s) && is_rigid(fl, (int)stop_of(fl, s)->lead), acts;
        if (!around && (!is_slider(fl, s) || is_sprung(fl, s))) continue;
        if (around) {
            acts = M->closed[(int)stop_of(fl, s)->lead];
        } else { /* what is held still slides on a belt */
            acts = !is_pressed(fl, s) || M->closed[(int)stop_of(fl, s)->normal];
            acts = acts && (stop_of(fl, s)->belt != 0.0 || is_disc(fl, s) || !holds_slider(M, s));
        }
        if (acts == M->closed[s]) continue;
        M->closed[s] = acts;
        fl->slides[s] = 0;
        M->panel->na = -1;
        if (acts && (is_pressed(fl, s) || rubs_around(fl, s))) loosen_slider(M, s, phase, roundings);
    }
}

/* let sliders slide whose speed is more than so many `roundings` */
static void loosen_sliders(const Motion *M, double phase, double roundings)
{
    for (int s = 0; s < M->fl->n_stops; s++)
        if (is_stuck(M, s)) loosen_slider(M, s, phase, roundings);
}

static bool any_sticks(const Motion *M)
{
    for (int s = 0; s < M->fl->n_stops; s++)
        if (is_stuck(M, s)) return true;
    return false;
}

/* size of the force that holds a slider, over a plane along both tangents; s->stop_forces are filled */
static double held_size(const Motion *M, int s)
{
    double force = held_force(M, s);
    return is_disc(M->fl, s) ? hypot(force, held_force(M, (int)stop_of(M->fl, s)->beside))
                             : fabs(force);
}

/* Fill the accelerations (3,) along the normal and both tangents of what sticks on a rigid stop that it
 * would have without its forces, and what these take there, yields (3, 3), with all else held as now;
 * s->stop_forces are filled. */
static void fill_contact(const Motion *M, const int *rows, double *free, double *yields)
{
    Scratch *s = M->s;
    int n = held_stops(M, true), order[3];
    double inverse[9];
    factor_mobilities(M, n);
    for (int c = 0; c < 3; c++) {
        for (int a = 0; a < n; a++) s->held[a] = s->resting[a] == rows[c];
        lu_apply_vector(s->mobility, n, s->mobility_order, s->held);
        for (int a = 0; a < n; a++)
            for (int r = 0; r < 3; r++)
                if (s->resting[a] == rows[r]) inverse[3 * c + r] = s->held[a];
    }
    lu_factor(inverse, 3, order);
    for (int i = 0; i < 9; i++) yields[i] = i % 4 == 0;
    lu_apply(inverse, 3, order, yields, 3);
    for (int r = 0; r < 3; r++) {
        free[r] = 0.0;
        for (int c = 0; c < 3; c++) free[r] += yields[3 * r + c] * s->stop_forces[rows[c]];
    }
}

/* of a direction at an angle: what it is pulled aside by, times `lost`; what it gets faster by, likewise;
 * and lost, the acceleration towards the stop that a unit of its force takes */
static double pulled_aside(const double *free, const double *yields, double friction, double angle,
                           double *faster, double *lost)
{
    double u[2] = {cos(angle), sin(angle)}, left[2];
    *lost = yields[0] + friction * (yields[1] * u[0] + yields[2] * u[1]);
    for (int d = 0; d < 2; d++) {
        const double *row = yields + 3 * (1 + d);
        left[d] = free[1 + d] * *lost - free[0] * (row[0] + friction * (row[1] * u[0] + row[2] * u[1]));
    }
    *faster = u[0] * left[0] + u[1] * left[1];
    return u[0] * left[1] - u[1] * left[0];
}

/* Ways in which what sticks on a rigid stop may leave over its plane. */
typedef struct {
    int count;      /* of those along which it gets faster by more than rounding */
    double u[2];    /* the direction of that along which it gets fastest */
    double pressed; /* acceleration towards the stop that it would have without its forces */
} Leaving;

/* With the accelerations a_n, a without its forces it goes along u with the force N of the stop where
 *
 *     (m_nn + μ m_nt . u) N = a_n > 0,    a - m_tn N - μ N B u = σ u,    σ > 0
 *
 * so along zeros of a trigonometric polynomial of order two. */
static Leaving ways_to_leave(const Motion *M, int stop, int slider)
{
    const Flow *fl = M->fl;
    int rows[3] = {stop, slider, (int)stop_of(fl, slider)->beside};
    double free[3], W[9], friction = grip(fl, slider), before = 0.0, best = -INFINITY;
    fill_contact(M, rows, free, W);
    Leaving found = {0, {0.0, 0.0}, free[0]};
    double least = OVER * (fabs(free[0]) + hypot(free[1], free[2]));
    for (int k = 0; k <= DIRECTIONS; k++) {
        double low = 2.0 * PI * (k - 1) / DIRECTIONS, high = 2.0 * PI * k / DIRECTIONS, faster, lost;
        double aside = pulled_aside(free, W, friction, high, &faster, &lost);
        bool turns = k > 0 && (aside > 0.0) != (before > 0.0), rises = before > 0.0;
        before = aside;
        if (!turns) continue;
        for (int round = 0; round < 60; round++) {
            double middle = 0.5 * (low + high);
            if ((pulled_aside(free, W, friction, middle, &faster, &lost) > 0.0) == rises)
                low = middle;
            else
                high = middle;
        }
        pulled_aside(free, W, friction, high, &faster, &lost);
        if (!(free[0] * lost > 0.0) || faster / lost < -least) continue;
        if (faster / lost > least) found.count++;
        if (!(faster / lost > best)) continue;
        best = faster / lost;
        found.u[0] = cos(high);
        found.u[1] = sin(high);
    }
    return found;
}

/* Fill the one way in which what a rigid stop presses on leaves over its plane; where there are several,
 * or none though it is pressed on, that is told. Whether it slides: else it leaves the stop. */
static bool fill_way_off(Motion *M, int stop, int slider, double *u)
{
    Leaving way = ways_to_leave(M, stop, slider);
    bool none = way.u[0] == 0.0 && way.u[1] == 0.0;
    if (way.count > 1 || (none && way.pressed > 0.0)) M->undecided = stop;
    if (!none) memcpy(u, way.u, sizeof way.u);
    return !none || way.pressed > 0.0;
}

/* let a slider go that sticks; s->stop_forces are filled */
static void let_go(Motion *M, int s)
{
    const Flow *fl = M->fl;
    M->panel->na = -1;
    if (!is_disc(fl, s)) {
        fl->slides[s] = held_force(M, s) > 0.0 ? 1 : -1;
        return;
    }
    int other = (int)stop_of(fl, s)->beside, stop = (int)stop_of(fl, s)->normal;
    if (!is_sprung(fl, s)) {
        double held[2] = {held_force(M, s), held_force(M, other)}, B[3], free[2], u[2];
        fill_yield(fl, s, B);
        for (int d = 0; d < 2; d++) free[d] = B[2 * d] * held[d] + B[1] * held[1 - d];
        fill_leaving(B, free, grip(fl, s) * larger(held_on(M, s), 0.0), u);
        if (stop >= 0 && is_rigid(fl, stop) && !fill_way_off(M, stop, s, u)) return;
        M->s->heading[s] = u[0];
        M->s->heading[other] = u[1];
    }
    set_slides(fl, s, is_sprung(fl, s) ? 1 : LET_GO);
}

/* let sliders slide that would need more than their friction to stick, the most loaded first; all, or
 * those alone that rigid stops press on */
static void slip_of(Motion *M, double phase, bool all)
{
    const Flow *fl = M->fl;
    for (int round = 0; round < fl->n_stops; round++) {
        double most = 1.0;
        int loosest = -1;
        if (!any_sticks(M)) return;
        contact_forces(M, phase);
        for (int s = 0; s < fl->n_stops; s++) {
            if (!is_stuck(M, s) || is_mate(fl, s)) continue;
            int pressing = (int)(is_second(fl, s) ? stop_of(fl, s)->lead : stop_of(fl, s)->normal);
            if (!all && !(pressing >= 0 && is_rigid(fl, pressing))) continue;
            double load = held_size(M, s) / (grip(fl, s) * larger(held_on(M, s), 0.0));
            if (!(load > most)) continue;
            most = load;
            loosest = s;
        }
        if (loosest < 0) return;
        let_go(M, loosest);
    }
}

static void slip_overloaded(Motion *M, double phase) { slip_of(M, phase, true); }

static void slip_pressed(Motion *M, double phase) { slip_of(M, phase, false); }

/* let what sticks at the start of a segment slip where it would need more than its friction */
static void begin_sliders(Motion *M)
{
    if (!any_sticks(M)) return;
    slip_overloaded(M, M->phase);
    for (int c = 0; c < M->n_columns; c++) M->s->moved_shift[c] = 0.0;
    hold(M, M->phase, 0.0, M->s->moved_shift);
}

/* fill `shift` (n_columns,): change of the instant at which the force that holds a slider reaches its
 * friction, to one `way` */
static void slip_shift(const Motion *M, int s, int way, double phase, double *shift)
{
    const Flow *fl = M->fl;
    int n = M->n_columns, stop = (int)stop_of(fl, s)->normal;
    const double *held = M->s->last_forces + (size_t)s * (1 + n);
    double pace = -way * held[0], most = grip(fl, s);
    for (int c = 0; c < n; c++) shift[c] = -way * held[1 + c];
    if (is_pressed(fl, s)) {
        const double *pressed = M->s->last_forces + (size_t)stop * (1 + n);
        pace += most * pressed[0];
        for (int c = 0; c < n; c++) shift[c] += most * pressed[1 + c];
    }
    for (int c = 0; c < fl->n_parameters; c++) {
        if (is_parameter(fl, c, PRESSING, s)) shift[fl->size + c] += most;
        if (is_parameter(fl, c, FRICTION, s))
            shift[fl->size + c] += pressing_now(fl, s, M->w, phase).value;
    }
    for (int c = 0; c < n; c++) shift[c] /= -pace;
}

/* Let a slider slide one `way`, or stick, from an instant on that shifts: forces jump there, those of
 * others with it. Their rates before the jump are in s->stop_forces. */
static void jump_to(Motion *M, int s, int way, double phase, double t, const double *shift)
{
    if (M->with_columns) {
        state_rate(M);
        move(M, 1.0, shift);
    }
    set_slides(M->fl, s, way);
    if (is_disc(M->fl, s)) hold(M, phase, t, shift); /* across its speed, too, though it turns */
    slip_overloaded(M, phase);
    hold(M, phase, t, shift);
    if (!M->with_columns) return;
    contact_forces(M, phase);
    state_rate(M);
    move(M, -1.0, shift);
}

/* A slider comes to rest, or slips, a time t after the start. Its force jumps as it comes to rest,
 * and where its friction drops as it slips: sensitivities change as in an impact, by the shift of
 * that instant. */
static void slide_or_stick(Motion *M, int s, double phase, double t)
{
    const Flow *fl = M->fl;
    double *shift = M->s->moved_shift;
    contact_forces(M, phase);
    M->panel->na = -1;
    if (is_sprung(fl, s) && fl->slides[s] != 0) { /* no force jumps */
        set_slides(fl, s, 0);
        return;
    }
    for (int c = 0; c < M->n_columns; c++) shift[c] = 0.0;
    if (fl->slides[s] == 0) {
        if (drops_at_once(fl, s)) {
            int way = held_force(M, s) > 0.0 ? 1 : -1;
            if (M->with_columns) slip_shift(M, s, way, phase, shift);
            jump_to(M, s, way, phase, t, shift);
        } else {
            let_go(M, s);
        }
        return;
    }
    RowsAlong along = {1, {s}, {1.0}};
    if (is_hard_disc(fl, s)) {
        along = (RowsAlong){2, {s, (int)stop_of(fl, s)->beside}, {0.0}};
        fill_heading(M, s, phase, along.share);
    }
    double pace = is_disc(fl, s) ? sum_along(along, M->s->pushes)
                                 : held_pace(M, s, M->s->pushes, phase);
    double *sum = M->s->along_columns;
    for (int c = 0; c < M->n_columns; c++) sum[c] = 0.0;
    for (int d = 0; d < along.count && M->with_columns; d++) {
        held_columns(M, along.row[d], phase, t, shift, M->s->sliding);
        for (int c = 0; c < M->n_columns; c++)
            sum[c] -= along.share[d] * M->s->sliding[c] / pace;
    }
    memcpy(shift, sum, sizeof(double) * M->n_columns);
    jump_to(M, s, 0, phase, t, shift);
}

/* close the rigid stops that are shut and do not part; a body that an impact on another stop has
 * lifted comes back, and stays where that is lost in the rounding of the gap */
static void close_shut(Motion *M, int first, double phase, double roundings, const bool *struck)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_rigid(fl, s)) continue;
        Course at = depth_now(fl, s, M->w, phase);
        bool shut = s == first || M->closed[s] || struck[s];
        shut = shut || at.value >= -roundings * gap_noise(fl, s, M->w);
        M->closed[s] = shut && fabs(at.first) <= roundings * gap_rate_noise(fl, s, M->w, phase);
    }
    hand_over_sliders(M, phase, roundings);
    contact_forces(M, phase);
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_rigid(fl, s) || M->closed[s]) continue;
        Course at = depth_now(fl, s, M->w, phase);
        bool shut = at.value >= -roundings * gap_noise(fl, s, M->w);
        double push = held_pace(M, s, M->s->pushes, phase);
        M->closed[s] = shut && at.first < 0.0 && is_low(M, s, -at.first, push);
    }
    hand_over_sliders(M, phase, roundings);
}

/* whether a rigid stop may hold what slides on it one way by nothing but its own friction */
static bool may_jam(const Motion *M, int stop)
{
    int slider = rubbed_by(M->fl, stop);
    if (slider < 0) return false;
    RowsAlong normal = held_along(M, stop);
    double both = fabs(taken_along(M->fl, normal, held_along(M, slider)));
    return taken_along(M->fl, normal, normal) <= grip(M->fl, slider) * both;
}

/* look for a rigid stop that holds what sticks over a plane, too, in some direction of it: how much of
 * that each takes is not told */
static void find_cornered(Motion *M)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_stuck(M, s) || !is_disc(fl, s) || is_mate(fl, s)) continue;
        for (int r = 0; r < fl->n_stops; r++)
            if (is_rigid(fl, r) && !is_round(fl, r) && M->closed[r] && moves_with(fl, s, r))
                M->undecided = r;
    }
}

/* Look for a rigid stop whose force nothing tells, or more than one, with friction: where the forces
 * that hold the gaps would have to feed what closes them [Painlevé 1895; Génot and Brogliato 1999].
 * Elsewhere the leading minors of the matrix of their equations are positive, as without friction. */
static void find_undecided(Motion *M, double phase)
{
    Scratch *s = M->s;
    int slid_on = -1;
    find_cornered(M);
    if (M->undecided >= 0) return;
    fill_directions(M, phase);
    for (int r = 0; r < M->fl->n_stops; r++)
        if (M->closed[r] && sliding_with(M, r) >= 0) slid_on = r;
    int n = slid_on >= 0 ? held_stops(M, true) : 0;
    double *matrix = s->mobility;
    for (int a = 0; a < n; a++)
        for (int b = 0; b < n; b++) matrix[a * n + b] = held_by(M, s->resting[a], s->resting[b]);
    for (int p = 0; p < n; p++) {
        if (!(matrix[p * n + p] > 0.0)) {
            M->undecided = is_rigid(M->fl, s->resting[p]) ? s->resting[p] : slid_on;
            return;
        }
        for (int a = p + 1; a < n; a++)
            for (int b = n - 1; b >= p; b--)
                matrix[a * n + b] -= matrix[a * n + p] / matrix[p * n + p] * matrix[p * n + b];
    }
}

/* The same of a rigid stop whose force has grown without bound: as the body goes round in a clearance, or
 * turns over a plane, its friction comes to take as much from what it holds as it gives. */
static void find_seized(Motion *M, double phase)
{
    fill_directions(M, phase);
    for (int r = 0; r < M->fl->n_stops; r++) {
        if (!(is_rigid(M->fl, r) && M->closed[r])) continue;
        RowsAlong normal = held_along(M, r);
        if (sliding_with(M, r) >= 0 && held_by(M, r, r) <= SEIZED * taken_along(M->fl, normal, normal))
            M->undecided = r;
    }
}

/* the same of a rigid stop that jams where nothing presses a body on: whether that holds or leaves
 * it is not told; and over a plane where it may as well slide */
static void find_jammed(Motion *M, double phase)
{
    const Flow *fl = M->fl;
    for (int r = 0; r < fl->n_stops; r++) {
        if (!(is_rigid(fl, r) && M->closed[r])) continue;
        int slider = rubbed_by(fl, r);
        if (slider >= 0 && is_disc(fl, slider)) {
            if (!is_stuck(M, slider) || !(held_force(M, r) > 0.0)) continue;
            Leaving way = ways_to_leave(M, r, slider);
            if (way.pressed <= 0.0 || way.count > 0) M->undecided = r;
            continue;
        }
        if (!may_jam(M, r)) continue;
        RowsAlong normal = held_along(M, r);
        double pressed = taken_along(fl, normal, normal) * held_force(M, r) +
                         taken_along(fl, normal, held_along(M, slider)) * held_force(M, slider);
        double slip[2];
        fill_slip(M, slider, phase, slip);
        if (pressed <= 0.0 && slip[0] == 0.0) M->undecided = r;
    }
}

/* the same of a rigid stop that holds what a slider at another stop would hold, too: how much of it
 * each takes is not told, nor what rubs on the rigid stop then */
static void find_shared(Motion *M)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_slider(fl, s) || !is_pressed(fl, s) || is_sprung(fl, s) || M->closed[s]) continue;
        if (!M->closed[(int)stop_of(fl, s)->normal] || grip(fl, s) == 0.0) continue;
        for (int r = 0; r < fl->n_stops; r++) {
            bool flat = is_rigid(fl, r) && !is_round(fl, r);
            int rubbing = flat && M->closed[r] && moves_with(fl, s, r) ? rubbed_by(fl, r) : -1;
            if (rubbing >= 0 && M->closed[rubbing] && grip(fl, rubbing) > 0.0) M->undecided = r;
        }
    }
}

/* Close the rigid stops on which the body rests now and open the others. A gap and a rate of so
 * many `roundings` are none. Resting is what is shut, does not part and is pushed on, together
 * with all that does: stops that would have to pull are left out one by one. */
static void settle(Motion *M, int first, double phase, double t, const double *shift,
                   double roundings, const bool *struck)
{
    const Flow *fl = M->fl;
    close_shut(M, first, phase, roundings, struck);
    for (int round = 0; round < fl->n_stops; round++) {
        slip_pressed(M, phase);
        find_undecided(M, phase);
        contact_forces(M, phase);
        find_jammed(M, phase);
        if (M->undecided >= 0) return;
        double least = 0.0;
        int weakest = -1;
        for (int s = 0; s < fl->n_stops; s++) {
            if (!(M->closed[s] && is_rigid(fl, s))) continue;
            double force = held_force(M, s);
            if (force > least || (weakest >= 0 && force == least)) continue;
            weakest = s;
            least = force;
        }
        if (weakest < 0) break;
        M->closed[weakest] = false;
        hand_over_sliders(M, phase, roundings);
    }
    find_shared(M);
    hold(M, phase, t, shift);
}

/* let the instant of impacts shift with the gap of stop `moves` */
static void shift_instant(Motion *M, int moves, double phase, double t, bool anew, double *shift)
{
    if (anew) contact_forces(M, phase);
    state_rate(M);
    move(M, -1.0, shift);
    instant_shift(M, moves, phase, t, shift);
    move(M, 1.0, shift);
}

/* Impacts at the instant at which rigid stop `first` is hit, a time t after the start. Of those
 * stops the ones on which the body comes to rest are closed afterwards. `crossed` tells that the
 * instant is that of the gap's closing, and moves with it. Impacts that end in rest count as one
 * of `closings`.
 *
 * Sensitivities change by the saltation [Aizerman and Gantmacher 1958; Müller 1995]: an earlier
 * instant, by τ, is seen with the rates before it, the jump is differentiated, and the rates after
 * it lead back. Of several impacts each has an instant of its own, which moves with its own gap:
 * they stay in this order. A body at rest on a stop strikes it at the very instant at which another
 * impact drives it on. */
static void impact(Motion *M, int first, bool crossed, double phase, double t)
{
    const Flow *fl = M->fl;
    bool *struck = M->s->struck, *still = M->s->still;
    double *shift = M->s->moved_shift, fastest = 0.0, speed;
    for (int c = 0; c < M->n_columns; c++) shift[c] = 0.0;
    contact_forces(M, phase);
    double *pushes = M->s->first_pushes; /* those before the impacts */
    for (int s = 0; s < fl->n_stops; s++) {
        pushes[s] = is_rigid(fl, s) ? held_pace(M, s, M->s->pushes, phase) : 0.0;
        struck[s] = false;
        still[s] = M->closed[s];
    }
    for (int step = 0; step < 10 * ROUNDS; step++) {
        int hit = hit_stop(M, phase, step == 0 ? first : -1, SHUT, &speed);
        int moves = step > 0 ? hit : first;
        fastest = larger(fastest, speed);
        if (step > 0 && hit >= 0 && (still[hit] || speed < SLOW * fastest)) moves = -1;
        if (M->with_columns && crossed && moves >= 0)
            shift_instant(M, moves, phase, t, step > 0, shift);
        if (hit < 0) break;
        Value restitution = restitution_at(fl, hit, speed);
        if (step > ROUNDS || is_low(M, hit, restitution.value * speed, pushes[hit]))
            restitution = (Value){0.0, 0.0};
        strike(M, hit, speed, restitution, phase, t, shift);
        if (M->undecided >= 0) return;
        struck[hit] = true;
        still[hit] = restitution.value == 0.0;
        leave_parting(M, phase, still);
        M->bounces[hit]++;
        M->closings[hit]++;
    }
    for (int s = 0; s < fl->n_stops; s++) /* an impact may turn any of them */
        if (rubs(fl, s) && !is_sprung(fl, s)) fl->slides[s] = 0;
    M->panel->na = -1;
    loosen_sliders(M, phase, SHUT);
    settle(M, first, phase, t, shift, SHUT, struck);
    slip_overloaded(M, phase);
    load_springs(M, phase, t, SHUT, 0.0, -1);
    for (int s = 0; s < fl->n_stops; s++) {
        if (!(struck[s] && M->closed[s] && M->bounces[s] > 0)) continue;
        M->closings[s] -= M->bounces[s] - 1;
        M->bounces[s] = 0;
    }
    if (!M->with_columns) return;
    contact_forces(M, phase);
    state_rate(M);
    move(M, -1.0, shift);
}

/* time after which a gap that opens without speed is open by 100 roundings */
static double departure(const Motion *M, int stop, double phase)
{
    const Flow *fl = M->fl;
    double noise = 100.0 * gap_noise(fl, stop, M->w), t = M->shortest, holds;
    for (int i = 0; i < 60; i++) {
        Course at = gap_after(fl, stop, stop, M->w, phase, t, &holds);
        if (at.value < -noise && at.first < 0.0) return t;
        t *= 2.0;
        if (fl->omega * t > HIT_AGAIN) break;
    }
    return M->shortest;
}

/* let a body that begins at or beyond rigid stops rebound, rest or leave */
static void begin_on_rigid_stops(Motion *M)
{
    double speed;
    bool any = false;
    for (int s = 0; s < M->fl->n_stops; s++) any = any || is_rigid(M->fl, s);
    if (!any) return;
    int hit = hit_stop(M, M->phase, -1, AT_START, &speed);
    if (hit >= 0) {
        impact(M, hit, false, M->phase, 0.0);
        return;
    }
    for (int s = 0; s < M->fl->n_stops; s++) M->s->struck[s] = false;
    for (int c = 0; c < M->n_columns; c++) M->s->moved_shift[c] = 0.0;
    settle(M, -1, M->phase, 0.0, M->s->moved_shift, AT_START, M->s->struck);
}
