/* Flights and contacts in turn through a segment of a motion. */
#include "engine.h"

#define SHORTEST 1e-10 /* time apart, in rad of the excitation or the fastest mode */

#define GOES_ON (-1) /* no outcome yet */

/* fill `held` (n_stops,) with the forces that hold sliders, or nan where none does */
static void fill_held(const Motion *M, double phase, double *held)
{
    bool any = any_sticks(M);
    if (any) contact_forces(M, phase);
    for (int s = 0; s < M->fl->n_stops; s++)
        held[s] = any && is_stuck(M, s) && is_slider(M->fl, s) ? M->s->stop_forces[s] : NAN;
}

/* friction of what slides, along a row, per unit of the normal force */
static double sliding_share(const Motion *M, int s, double phase)
{
    double u[2];
    if (!is_disc(M->fl, s)) return friction_at(M->fl, s, output_now(M->fl, s, M->w, phase).first).value;
    fill_heading(M, first_tangent(M->fl, s), phase, u);
    return u[is_mate(M->fl, s)] * grip(M->fl, s);
}

/* Change of the sensitivities as a dashpot begins or ceases to act, a time t after the start.
 *
 * The force jumps by c δ', and the switch moves by -dδ/δ' with the penetration there: together
 * they change the velocities by c dδ [Aizerman and Gantmacher 1958]. So do those of sliders that it
 * presses on, or that slip as it was more than their friction: they `held` that much before. What is
 * held on takes its share of the impulse. Over an ever slower touch these remain bounded, for what
 * slips lacked no more to its friction than a share of c δ'; but where friction drops at once they
 * grow with 1/δ', as they are: a grazing then decides whether it slips at all. */
static void jump_columns(Motion *M, int stop, double phase, double t, bool closes,
                         const double *held)
{
    const Flow *fl = M->fl;
    double *depth = M->s->moved, *shift = M->s->moved_shift, dashpot = stop_of(fl, stop)->dashpot;
    double speed = output_now(fl, stop, M->w, phase).first;
    depth_columns(M, stop, phase, t, depth);
    for (int s = 0; s < fl->n_stops; s++) {
        bool slides = is_slider(fl, s) && fl->slides[s] != 0;
        double share = slides ? sliding_share(M, s, phase) : 1.0;
        double jump = (closes ? dashpot : -dashpot) * share; /* of the force, over the speed */
        if (slides && !isnan(held[s]))
            jump = (share * pressing_now(fl, s, M->w, phase).value - held[s]) / speed;
        else if (s != stop && !(slides && is_pressed(fl, s) && (int)stop_of(fl, s)->normal == stop))
            continue;
        const double *push = push_of(fl, s);
        for (int k = 0; k < fl->size; k++)
            for (int c = 0; c < M->n_columns; c++)
                M->columns[(size_t)k * M->n_columns + c] -= jump * push[k] * depth[c];
    }
    for (int c = 0; c < M->n_columns; c++) shift[c] = 0.0;
    hold(M, phase, t, shift);
}

/* Whether the force jumps as a stop opens or closes. That of one that never pulls does so only
 * where it is hit, not where it lets go, or presses again: there the body moves out. */
static bool force_jumps(const Motion *M, int stop, double phase)
{
    if (never_pulls(M->fl, stop)) return output_now(M->fl, stop, M->w, phase).first > 0.0;
    return stop_of(M->fl, stop)->dashpot > 0.0;
}

/* let coupled stops know which are closed, and forget the penetrations that were carried */
static void recouple(Motion *M)
{
    couple(M->fl, M->closed);
    for (int s = 0; s < M->fl->n_stops; s++)
        if (is_coupled(M->fl, s)) M->doubt[s] = INFINITY;
}

/* close a stop that is open, or open one that is closed, a time t after the start */
static void switch_stop(Motion *M, int stop, double phase, double t)
{
    double *held = M->s->first_pushes;
    bool jumps = M->with_columns && force_jumps(M, stop, phase);
    if (jumps) fill_held(M, phase, held);
    M->closed[stop] = !M->closed[stop];
    for (int s = stop + 1; s < M->fl->n_stops; s++) {
        bool follows = is_pressed(M->fl, s) && (int)stop_of(M->fl, s)->normal == stop;
        if (!follows && !(is_second(M->fl, s) && (int)stop_of(M->fl, s)->lead == stop)) continue;
        M->closed[s] = M->closed[stop];
        M->fl->slides[s] = 0;
    }
    if (is_coupled(M->fl, stop)) recouple(M);
    if (M->closed[stop]) {
        loosen_sliders(M, phase, SHUT);
        slip_overloaded(M, phase);
        press_on(M, stop, phase, t);
    }
    if (jumps) jump_columns(M, stop, phase, t, M->closed[stop], held);
}

/* Open and close the stops that do so at the very instant of another one's event, each to the
 * small share of the length h of the panel before it to which it must be known. Of coupled ones
 * always the first that is wrong: so it ends where all are right [Murty 1974]. What closes and opens
 * again did not close; `was_open` tells of before. */
static void switch_with(Motion *M, double phase, double t, double h, const bool *was_open)
{
    const Flow *fl = M->fl;
    int pivots = 0;
    for (int s = 0; s < fl->n_stops; s++)
        if (with_event(fl, s, M->w, phase, 10.0 * stop_of(fl, s)->instant * h, M->closed)) {
            switch_stop(M, s, phase, t);
            M->closings[s] += M->closed[s] ? 1 : was_open[s] ? -1 : 0;
            if (is_coupled(fl, s) && pivots++ < PIVOTS_PER_STOP * fl->n_stops) s = -1;
        }
}

/* fill times (n_stops,) to pass before a gap that has opened without speed is looked at again */
static void leave_rigid_stops(Motion *M, int event, double phase)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_rigid(fl, s) || M->closed[s]) continue;
        Course at = depth_now(fl, s, M->w, phase);
        bool shut = s == event || at.value >= -SHUT * gap_noise(fl, s, M->w);
        if (shut && fabs(at.first) <= SHUT * gap_rate_noise(fl, s, M->w, phase))
            M->skips[s] = departure(M, s, phase);
    }
}

static void skip(Motion *M, double time)
{
    for (int s = 0; s < M->fl->n_stops; s++) M->skips[s] = time;
}

/* let a stop open or close at the present instant, and those with it, after a panel of length h */
static void pass_event(Motion *M, int event, double h)
{
    double here = M->phase + M->fl->omega * M->t;
    M->start_switch = 0;
    for (int s = 0; s < M->fl->n_stops; s++) M->s->was_open[s] = !M->closed[s];
    if (rubs(M->fl, event)) {
        slide_or_stick(M, event, here, M->t);
    } else if (is_rigid(M->fl, event)) {
        if (M->closed[event]) {
            M->closed[event] = false;
            hand_over_sliders(M, here, SHUT);
            slip_overloaded(M, here);
        } else {
            impact(M, event, true, here, M->t);
        }
        leave_rigid_stops(M, event, here);
    } else {
        switch_stop(M, event, here, M->t);
        M->start_switch = 1;
        if (M->closed[event]) M->closings[event]++;
    }
    switch_with(M, here, M->t, h, M->s->was_open);
    if (M->undecided < 0) find_undecided(M, here);
    if (M->undecided < 0 && is_hard_disc(M->fl, event)) {
        contact_forces(M, here);
        find_jammed(M, here);
    }
    if (!any_sprung(M->fl)) return;
    contact_forces(M, here);
    load_springs(M, here, M->t, SHUT, 10.0 * coarsest_instant(M->fl) * h, event);
}

/* fly to the first contact or to the end */
static int fly(Motion *M, double here)
{
    const Flow *fl = M->fl;
    double first = M->duration - M->t;
    int stop = -1;
    for (int s = 0; s < fl->n_stops; s++) {
        if (is_slider(fl, s) || is_second(fl, s) || is_mover(fl, s)) continue; /* not pressed */
        double at = closing_time(fl, s, M->w, here, M->skips[s], first, M->shortest);
        if (at < 0.0) return fl->watch->stopped ? INTERRUPTED : TOO_MANY_STEPS;
        if (at < first) {
            first = at;
            stop = s;
        }
    }
    if (M->recording && !record_piece(M, here, first, FLIGHT, stop)) return RECORD_FULL;
    fly_state(fl->blocks, fl->n, M->w, first);
    if (M->with_columns) fly_columns(fl->blocks, fl->n, M->columns, M->n_columns, first);
    M->t = stop < 0 ? M->duration : M->t + first;
    drag_places(M, M->phase + fl->omega * M->t, M->t);
    skip(M, 0.0);
    if (stop >= 0) pass_event(M, stop, 0.0);
    return GOES_ON;
}

/* pass over a touch without force: whether it is one; `status` tells of a contact that is hidden
 * by rounding */
static bool pass_touch(Motion *M, int stop, double here, int *status)
{
    const Flow *fl = M->fl;
    Impact hit = expected_contact(fl, stop, M->w, here);
    double noise = gap_noise(fl, stop, M->w);
    if (lost_to_rounding(fl, stop, M->w, here, hit.peak, noise) > WORST_ROUNDING) *status = ROUNDED;
    if (*status != GOES_ON || !(hit.peak <= 100.0 * noise)) return false;
    switch_stop(M, stop, here, M->t);
    M->closings[stop]--;
    M->start_switch = 0;
    double calm = calm_time(fl, stop, M->w, here, 100.0 * noise);
    M->skips[stop] = larger(smaller(hit.left, calm), M->shortest);
    return true;
}

/* carry the penetrations over to a new panel, or take those of the state, which knows them as well */
static void carry_depths(Motion *M, double here)
{
    Panel *panel = M->panel;
    for (int a = 0; a < panel->na; a++) {
        int stop = panel->active[a];
        double noise = output_noise(M->fl, stop, M->w);
        if (M->doubt[stop] >= noise) {
            double value = output_now(M->fl, stop, M->w, here).value - origin_of(M->fl, stop);
            bool begins = M->start_switch == 1 && fabs(value) <= noise;
            M->depth[stop] = begins ? 0.0 : value;
            M->doubt[stop] = begins ? 0.0 : noise;
        }
        panel->depth[a] = M->depth[stop];
        panel->doubt[a] = M->doubt[stop];
    }
    for (int a = 0; a < panel->na; a++) { /* a strain that is none may grow at any rate */
        int s = panel->active[a];
        panel->growth[a] = 0.0;
        if (is_let_go(M->fl, s)) panel->decayed[a] = 2.0 * FADED; /* there is nothing to forget */
        if (disc_of(M->fl, panel, a) != s || !is_sprung(M->fl, s)) continue;
        int other = place_of(panel, (int)stop_of(M->fl, s)->beside);
        Disc at = disc_now(M->fl, s, M->w, here);
        if (at.size > 0.0) continue;
        panel->depth[a] = panel->depth[other] = 0.0;
        panel->growth[a] = hypot(at.speed[0], at.speed[1]);
    }
}

/* whether all numbers of the state at the end of a panel are finite */
static bool end_is_finite(const Motion *M)
{
    double total = 0.0;
    for (int k = 0; k < M->fl->size; k++) total += M->w_end[k];
    return isfinite(total);
}

/* let the motion go over a panel that was solved */
static int take_panel(Motion *M, double here, const Trial *trial)
{
    Panel *panel = M->panel;
    const Flow *fl = M->fl;
    double h = trial->h;
    if (!end_is_finite(M)) return CONTACT_FAILED;
    if (M->recording && !record_panel(M, here, h, trial->kind, trial->aim)) return RECORD_FULL;
    for (int a = 0; a < panel->na; a++) {
        bool turns = is_disc(fl, panel->active[a]);
        if (HALF_ULP * panel->decay[a] > WORST_ROUNDING && !turns) return ROUNDED;
        panel->decayed[a] += panel->decay[a];
        if (panel->decay[a] > DECAY && !turns)
            M->last_push[panel->active[a]] = at_end(M->tab, panel->F + (size_t)a * panel->m);
    }
    if (M->with_columns)
        panel_columns(fl, M->tab, trial->kind, here, M->t, h, panel, M->columns, M->n_columns,
                      M->s);
    for (int k = 0; k < fl->size; k++) M->w[k] = M->w_end[k];
    M->t = h >= M->duration - M->t ? M->duration : M->t + h;
    for (int c = 0; c < M->n_columns; c++) M->s->moved_shift[c] = 0.0; /* no instant moves now */
    hold(M, M->phase + fl->omega * M->t, M->t, M->s->moved_shift);
    for (int a = 0; a < panel->na; a++) {
        M->depth[panel->active[a]] = panel->end_depth[a];
        M->doubt[panel->active[a]] = panel->end_doubt[a];
    }
    drag_places(M, M->phase + fl->omega * M->t, M->t);
    for (int s = 0; s < fl->n_stops; s++)
        if (is_let_go(fl, s) && !is_mate(fl, s) && moves_over(M, s)) set_slides(fl, s, 1);
    return GOES_ON;
}

/* Time that a panel may take before what slides over a plane comes to rest, or inf; what does so now
 * is `resting`, or -1. */
static double time_before_rest(const Motion *M, double here, int *resting)
{
    const Flow *fl = M->fl;
    double first = INFINITY;
    bool filled = false;
    *resting = -1;
    for (int s = 0; s < fl->n_stops; s++) {
        bool slides = M->closed[s] && is_hard_disc(fl, s) && !is_mate(fl, s) && fl->slides[s] == 1;
        if (!slides || slides_freely(fl, s)) continue;
        if (!filled) contact_forces(M, here);
        filled = true;
        double left = time_to_rest(M, s, here);
        if (!moves_over(M, s) || left <= AT_REST * M->shortest) *resting = s;
        first = smaller(first, NEARER * left);
    }
    return first;
}

/* go on by a contact panel with na closed stops in M->active */
static int touch(Motion *M, double here, int na)
{
    const Flow *fl = M->fl;
    Panel *panel = M->panel;
    int stop = M->active[0], status = GOES_ON;
    double remain = M->duration - M->t;
    if (!same_stops(fl, panel, M->active, na)) renew_panel(fl, panel, M->active, na);
    if (na == (is_round(fl, stop) ? 2 : 1) && M->start_switch == 1 && is_elastic(fl, stop)) {
        bool passed = pass_touch(M, stop, here, &status);
        if (passed || status != GOES_ON) return status;
    }
    int resting;
    double h_max = smaller(remain, time_before_rest(M, here, &resting));
    if (resting >= 0) {
        pass_event(M, resting, 0.0);
        return GOES_ON;
    }
    h_max = smaller(h_max, M->start_switch == 1 ? M->h_mapped : M->h_even);
    h_max = smaller(h_max, M->reach);
    carry_depths(M, here);
    Trial trial;
    status = contact_panel(M, here, h_max, &trial);
    if (status == CONTACT_FAILED) find_seized(M, here);
    if (M->undecided >= 0) return UNDECIDED;
    if (status != OK) return status;
    if (M->bonded && trial.h > 0.0) {
        double grown = growth_of_panel(fl, M->tab, panel) * trial.h;
        bool cut = trial.aim >= 0 || trial.h >= remain || M->start_switch == 1;
        M->reach = cut ? larger(M->reach, grown) : grown;
    }
    if (trial.h > 0.0) {
        status = take_panel(M, here, &trial);
        if (status != GOES_ON) return status;
    }
    M->start_switch = 0;
    if (trial.aim < 0) return GOES_ON;
    for (int a = 0; a < panel->na; a++) panel->decayed[a] = panel->decay[a] = 0.0;
    skip(M, trial.h < M->shortest ? M->shortest : 0.0);
    pass_event(M, trial.aim, trial.h);
    return GOES_ON;
}

/* prepare lengths and carried numbers for a segment */
static void begin_pieces(Motion *M, double fastest)
{
    const Flow *fl = M->fl;
    int n_stops = fl->n_stops;
    M->h_even = fastest > 0.0 ? fl->node_angle * M->panel->m / fastest : INFINITY;
    M->h_mapped = MAPPED * M->h_even / M->tab->power;
    M->shortest = larger(SHORTEST / larger(fastest, fl->omega), SUM_ROUNDING * M->duration);
    M->t = 0.0;
    M->start_switch = 0;
    M->bonded = false;
    M->reach = INFINITY;
    renew_panel(fl, M->panel, M->active, 0);
    for (int s = 0; s < n_stops; s++) {
        M->skips[s] = M->depth[s] = 0.0;
        M->doubt[s] = INFINITY;
        M->last_push[s] = NAN;
        if (!is_bond(fl, s)) continue;
        M->bonded = true;
        M->reach = smaller(M->reach, bond_length(fl, s, M->w, M->phase));
    }
}

/* whether the place of a slider over a plane moves by itself */
static bool moves_now(const Motion *M, int s)
{
    int slider = (int)stop_of(M->fl, s)->moves;
    return M->closed[slider] && M->fl->slides[slider] != 0;
}

/* advance w and its sensitivities in place over a segment, piece by piece */
static int run_pieces(Motion *M)
{
    const Flow *fl = M->fl;
    for (int piece = 0; piece < MOST_PIECES; piece++) {
        if (M->duration - M->t <= 0.0) return OK;
        if (interrupted(fl->watch)) return INTERRUPTED;
        if (M->undecided >= 0) return UNDECIDED;
        double here = M->phase + fl->omega * M->t;
        int na = 0;
        for (int s = 0; s < fl->n_stops; s++) {
            M->last_push[s] = NAN;
            if (is_mover(fl, s)) M->closed[s] = moves_now(M, s);
            if (M->closed[s])
                M->active[na++] = s;
            else
                M->doubt[s] = INFINITY;
        }
        int status = na == 0 ? fly(M, here) : touch(M, here, na);
        if (status != GOES_ON) return status;
    }
    return TOO_MANY_PIECES;
}

/* whether a stop is closed at the start, by its penetration */
static bool begins_shut(const Motion *M, int s)
{
    Course at = gap_now(M->fl, s, M->w, M->phase);
    double left = at.first < 0.0 ? gap_noise(M->fl, s, M->w) : 0.0; /* it opens now */
    return at.value > left;
}

/* which coupled stops are closed at the start, see `switch_with` */
static void begin_coupled(Motion *M)
{
    const Flow *fl = M->fl;
    if (!any_coupled(fl)) return;
    uncouple(fl);
    for (int s = 0; s < fl->n_stops; s++) M->closed[s] = is_coupled(fl, s) && begins_shut(M, s);
    couple(fl, M->closed);
    int pivots = 0;
    for (int s = 0; s < fl->n_stops && pivots < PIVOTS_PER_STOP * fl->n_stops; s++) {
        if (!is_coupled(fl, s) || M->closed[s] == begins_shut(M, s)) continue;
        M->closed[s] = !M->closed[s];
        couple(fl, M->closed);
        pivots++;
        s = -1;
    }
}

/* which stops are closed at the start */
static void begin_contacts(Motion *M)
{
    const Flow *fl = M->fl;
    begin_coupled(M);
    for (int s = 0; s < fl->n_stops; s++) {
        bool shut = is_elastic(fl, s) && begins_shut(M, s);
        fl->slides[s] = 0;
        M->closed[s] = is_bond(fl, s) || shut;
        if (is_slider(fl, s))
            M->closed[s] = !is_pressed(fl, s) || M->closed[(int)stop_of(fl, s)->normal];
        if (is_second(fl, s)) M->closed[s] = M->closed[(int)stop_of(fl, s)->lead];
        if (!(never_pulls(fl, s) && M->closed[s])) continue;
        int release = (int)stop_of(fl, s)->release;
        Course at = output_now(fl, release, M->w, M->phase);
        double left = at.first < 0.0 ? output_noise(fl, release, M->w) : 0.0;
        M->closed[s] = at.value - stop_of(fl, s)->gap > left;
    }
    loosen_sliders(M, M->phase, AT_START);
    drag_places(M, M->phase, 0.0);
    load_springs(M, M->phase, 0.0, AT_START, 0.0, -1);
}

/* fill w and its sensitivities from the state z (2n,) at the start of a segment */
static void begin_state(Motion *M, const double *start)
{
    const Flow *fl = M->fl;
    int size = fl->size, last = M->n_columns - 1;
    Complex turn = turned(M->phase);
    const Complex *by = response_of(fl, 0, 0);
    memset(M->columns, 0, sizeof(double) * size * M->n_columns);
    for (int i = 0; i < size; i++) {
        double *row = M->columns + (size_t)i * M->n_columns;
        M->w[i] = start[i] - product(by[i], turn).re;
        row[i] = 1.0;
        row[last] = -product(by[size + i], turn).re;
        for (int c = 0; c < fl->n_parameters; c++)
            row[size + c] = -product(by[(size_t)(2 + c) * size + i], turn).re;
    }
    add_growth(fl, M->phase, -1.0, M->w, M->columns, M->n_columns);
    begin_places(M);
}

/* what comes of a segment: the state (2n,) at its end, and its derivatives with respect to the
 * start (2n, 2n), to ω at fixed phases (2n,) and to the parameters (2n, n_parameters) */
typedef struct {
    double *end, *jacobian, *d_omega, *d_parameters;
} Outcome;

/* fill the outcome of a segment; the duration follows the frequency (fixed phase), and the
 * derivative with respect to ω takes that into account */
static void finish(Motion *M, Outcome outcome)
{
    const Flow *fl = M->fl;
    int size = fl->size, count = fl->n_parameters, last = M->n_columns - 1;
    double end_phase = M->phase + fl->omega * M->duration;
    Complex turn = turned(end_phase);
    const Complex *by = response_of(fl, 0, 0);
    contact_forces(M, end_phase);
    for (int s = 0; s < fl->n_stops; s++)
        if (!isnan(M->last_push[s])) M->s->stop_forces[s] = M->last_push[s];
    state_rate(M);
    add_growth(fl, end_phase, 1.0, M->w, M->columns, M->n_columns);
    for (int i = 0; i < size; i++) {
        const double *row = M->columns + (size_t)i * M->n_columns;
        outcome.end[i] = M->w[i] + product(by[i], turn).re;
        outcome.d_omega[i] = row[last] + product(by[size + i], turn).re;
        outcome.d_omega[i] -= M->s->rate[i] * (M->duration / fl->omega);
        if (!M->with_columns) continue;
        for (int j = 0; j < size; j++) outcome.jacobian[(size_t)i * size + j] = row[j];
        for (int c = 0; c < count; c++)
            outcome.d_parameters[(size_t)i * count + c] =
                row[size + c] + product(by[(size_t)(2 + c) * size + i], turn).re;
    }
}

/* carry a state z (2n,) over one segment, from a forcing phase on */
static int propagate(Motion *M, const double *start, double phase, double duration,
                     double fastest, Outcome outcome)
{
    M->before = 2.0 * PI * floor(phase / (2.0 * PI)); /* whole turns cost digits */
    M->phase = phase - M->before;
    M->duration = duration;
    begin_state(M, start);
    for (int s = 0; s < M->fl->n_stops; s++) M->bounces[s] = 0;
    M->undecided = -1;
    begin_contacts(M);
    begin_on_rigid_stops(M);
    begin_sliders(M);
    begin_pieces(M, fastest);
    int status = run_pieces(M);
    finish(M, outcome);
    return status;
}
