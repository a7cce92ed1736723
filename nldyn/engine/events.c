/* When stops open and close, and sliders slide and stick. */
#include "engine.h"

#define GROWTH 0.5 /* of a slip in a panel, the logarithm of it, at most */
#define HIDDEN_GROWTH 3e-9 /* of a panel: in a time so short rounding hides how a slip grows */
#define PRESSING_ROUNDING 1e-14 /* of its terms: the acceleration against which a rigid stop presses */

/* The output that tells when a stop opens or closes, by passing its gap: the penetration or, of
 * one that never pulls and is penetrated, what its force goes with. */
static int watched(const Flow *fl, int s, const bool *closed, const double *w, double phase)
{
    if (!never_pulls(fl, s)) return s;
    const Stop *stop = stop_of(fl, s);
    if (closed[s]) return (int)stop->release;
    double depth = gap_now(fl, s, w, phase).value;
    return depth > 10.0 * output_noise(fl, s, w) ? (int)stop->release : s;
}

/* what that output exceeds the gap by, and its first two rates, the first with all forces; the
 * second leaves the forces out */
static Course watched_pace(const Flow *fl, int stop, const bool *closed, const double *w,
                           double phase)
{
    int out = watched(fl, stop, closed, w, phase);
    if (out == stop) return gap_now(fl, stop, w, phase);
    Course at = output_now(fl, out, w, phase);
    const double *row = row_of(fl, 0, out);
    for (int s = 0; s < fl->n_stops; s++) {
        if (!closed[s]) continue;
        double force = force_now(fl, s, w, phase);
        const double *push = push_of(fl, s);
        for (int k = 0; k < fl->size; k++) at.first -= row[k] * push[k] * force;
    }
    at.value -= stop_of(fl, stop)->gap;
    at.second = 0.0;
    return at;
}

/* time (of either sign) to the instant at which a stop opens or closes in flight, or inf: the
 * nearer root of the parabola through the present; inf where the gap changes the wrong way */
static double time_to_event(const Flow *fl, int stop, const bool *closed, const double *w,
                            double phase)
{
    Course at = watched_pace(fl, stop, closed, w, phase);
    double speed = at.first;
    if (closed[stop] ? speed >= 0.0 : speed <= 0.0) return INFINITY;
    double square = speed * speed - 2.0 * at.second * at.value;
    double root = square > 0.0 ? sqrt(square) : fabs(speed);
    return -2.0 * at.value / (speed + copysign(root, speed));
}

/* rounding error of the acceleration that a rigid stop takes from what rests on it */
static double pressing_noise(const Flow *fl, int stop, const double *w)
{
    return PRESSING_ROUNDING * output_size(fl, stop, w, 2);
}

/* what changes its sign with the force of a rigid stop at a place among the closed ones, (m,) */
static const double *pressing_of(const Flow *fl, const Panel *panel, int a)
{
    bool around = is_round(fl, panel->active[a]);
    return (around ? panel->radial : panel->output) + (size_t)a * panel->m;
}

/* time from the end of a panel to where a rigid stop's force changes its sign, or inf; the panel
 * must not be stretched at its end */
static double time_to_release(const Flow *fl, const Gauss *tab, int stop, int kind, double h, const Panel *panel)
{
    for (int a = 0; a < panel->na; a++) {
        if (panel->active[a] != stop) continue;
        const double *output = pressing_of(fl, panel, a);
        double slope = slope_at_end(tab, output) / (h * (kind == 0 ? 1.0 : 2.0));
        if (slope < 0.0) return -at_end(tab, output) / slope;
    }
    return INFINITY;
}

/* largest error allowed in the instant of an event, as a share of a panel */
static double coarsest_instant(const Flow *fl)
{
    double found = 0.0;
    for (int s = 0; s < fl->n_stops; s++) found = larger(found, stop_of(fl, s)->instant);
    return found;
}

/* speed of a slider along what it slides on, in the sense in which it slides */
static double slip(const Flow *fl, int s, const double *w, double phase)
{
    double speed = is_second(fl, s) ? round_slip(fl, s, w, phase).value
                                    : drag_speed(fl, s, fl->slides[s], w, phase);
    return fl->slides[s] * speed;
}

/* rounding error of it */
static double slip_noise(const Flow *fl, int s, const double *w, double phase)
{
    return is_second(fl, s) ? round_slip_noise(fl, s, w, phase) : drag_noise(fl, s, w, phase);
}

/* that of the force that holds a slider */
static double hold_noise(const Flow *fl, int s, const double *w)
{
    if (is_strained(fl, s)) return strain_noise(fl, s, w);
    double noise = pressing_noise(fl, s, w), mobility = stop_of(fl, s)->mobility;
    if (is_disc(fl, s)) {
        int other = (int)stop_of(fl, s)->beside;
        return noise / mobility + pressing_noise(fl, other, w) / stop_of(fl, other)->mobility;
    }
    if (!is_second(fl, s)) return noise / mobility;
    int lead = (int)stop_of(fl, s)->lead;
    noise += pressing_noise(fl, lead, w);
    return noise / smaller(mobility, stop_of(fl, lead)->mobility);
}

/* the same as `show_slider` over a plane; where it sticks, the margin is smooth without force, too */
static void show_disc(const Flow *fl, const Panel *panel, int position, double *values)
{
    int na = panel->na, m = panel->m, s = panel->active[position];
    int places[2] = {position, place_of(panel, (int)stop_of(fl, s)->beside)};
    double most = TINY;
    for (int i = 0; i < m; i++) {
        double force = hypot(panel->F[places[0] * m + i], panel->F[places[1] * m + i]);
        double held = grip(fl, s) * normal_at(fl, panel, s, i);
        most = larger(most, larger(force, held));
        values[i] = 0.5 * (held - force) * (held + force);
    }
    for (int i = 0; i < m && fl->slides[s] == 0; i++) values[i] /= most;
    for (int i = 0; i < m && fl->slides[s] != 0; i++) {
        double size = TINY, along = 0.0;
        for (int d = 0; d < 2; d++) {
            double strain = panel->output[places[d] * m + i];
            size = hypot(size, strain);
            along += strain * panel->output[(na + places[d]) * m + i];
        }
        values[i] = along / size - grip_pace(fl, panel, s, i);
    }
}

/* fill values (m,) at the nodes of a panel, positive as long as a slider at a place among the
 * closed ones slides on, or sticks without more force than its friction to one `side` */
static void show_slider(const Flow *fl, const Panel *panel, int position, int side, double *values)
{
    int m = panel->m, s = panel->active[position];
    if (is_second(fl, s)) {
        show_rubbing(fl, panel, s, side, values);
        return;
    }
    if (is_disc(fl, s)) {
        show_disc(fl, panel, position, values);
        return;
    }
    for (int i = 0; i < m; i++)
        if (fl->slides[s] != 0)
            values[i] = fl->slides[s] * (panel->output[(panel->na + position) * m + i] -
                                         stop_of(fl, s)->belt) - grip_pace(fl, panel, s, i);
        else
            values[i] = grip(fl, s) * normal_at(fl, panel, s, i) -
                        side * panel->F[position * m + i];
}

/* side to which a slider is held at the end of a panel */
static int held_to(const Motion *M, int s, double end_phase)
{
    const Panel *panel = M->panel;
    int m = panel->m;
    double force = at_end(M->tab, panel->F + (size_t)place_of(panel, s) * m);
    if (is_second(M->fl, s)) {
        double place[2], speed[2], pace[2];
        int lead = (int)stop_of(M->fl, s)->lead;
        double other = at_end(M->tab, panel->F + (size_t)place_of(panel, lead) * m);
        round_now(M->fl, lead, M->w_end, end_phase, place, speed, pace);
        force = place[0] * force - place[1] * other;
    }
    return force < 0.0 ? -1 : 1;
}

/* time from the end of a panel to where a slider sticks or slips, or inf, and the value that it
 * passes zero with */
static double time_to_slip(const Motion *M, int s, int kind, double end_phase, double h,
                           double *value)
{
    const Flow *fl = M->fl;
    const Panel *panel = M->panel;
    double *nodes = M->s->inner;
    int position = place_of(panel, s);
    int side = held_to(M, s, end_phase);
    show_slider(fl, panel, position, side, nodes);
    *value = fl->slides[s] != 0 ? slip(fl, s, M->w_end, end_phase) : at_end(M->tab, nodes);
    double slope = slope_at_end(M->tab, nodes) / (h * (kind == 0 ? 1.0 : M->tab->power));
    return slope < 0.0 ? -*value / slope : INFINITY;
}

/* size of a slider's acceleration in flight */
static double push_along(const Flow *fl, int s, const double *w, double phase)
{
    double push = output_now(fl, s, w, phase).second;
    if (!is_disc(fl, s)) return fabs(push);
    return hypot(push, output_now(fl, (int)stop_of(fl, s)->beside, w, phase).second);
}

/* whether a stop is just about to switch, to within a time allowed or rounding: of the state, and of
 * the time, since an instant is known no better than its phase */
static bool at_switch(const Flow *fl, int stop, const double *w, double phase, double allowed,
                      const bool *closed)
{
    Course at = watched_pace(fl, stop, closed, w, phase);
    int out = watched(fl, stop, closed, w, phase);
    if (is_strained(fl, stop)) return at_grip(fl, stop, w, phase, allowed);
    if (rubs(fl, stop)) { /* where it sticks, the state does not tell */
        double pace = is_second(fl, stop) ? round_slip(fl, stop, w, phase).first
                                          : push_along(fl, stop, w, phase);
        return fabs(slip(fl, stop, w, phase)) <=
               allowed * fabs(pace) + 10.0 * slip_noise(fl, stop, w, phase);
    }
    double instant = allowed + 10.0 * SUM_ROUNDING * phase / fl->omega;
    return fabs(at.value) <= instant * fabs(at.first) + 10.0 * gap_noise(fl, out, w);
}

/* whether a stop is to open or close now, to within a time allowed or rounding; a rigid one does
 * so by itself, see `impact` */
static bool with_event(const Flow *fl, int stop, const double *w, double phase, double allowed,
                       const bool *closed)
{
    if (!is_elastic(fl, stop)) return false;
    if (!at_switch(fl, stop, w, phase, allowed, closed)) return false;
    return closed[stop] != (watched_pace(fl, stop, closed, w, phase).first > 0.0);
}

/* whether a stop's next event is no switch of a force: a body rests on a rigid one, or slides */
static bool ends_smoothly(const Flow *fl, int stop, const bool *closed)
{
    return closed[stop] && (is_rigid(fl, stop) || rubs(fl, stop));
}

/* error allowed in the instant at which a stop and others with it open or close */
static double instant_with(const Flow *fl, int aim, const double *w, double phase, double h,
                           const bool *closed)
{
    double allowed = stop_of(fl, aim)->instant * h;
    for (int s = 0; s < fl->n_stops; s++) {
        double share = stop_of(fl, s)->instant * h;
        if (share < allowed &&
            with_event(fl, s, w, phase, 10.0 * coarsest_instant(fl) * h, closed))
            allowed = share;
    }
    return allowed;
}

/* stop that is to open or close now, to within a share of a length h of time, or -1 */
static int stop_at_switch(const Flow *fl, const double *w, double phase, double h,
                          const bool *closed)
{
    int stop = -1;
    double nearest = INFINITY;
    double allowed = 10.0 * (coarsest_instant(fl) * h + SUM_ROUNDING * phase / fl->omega);
    for (int s = 0; s < fl->n_stops; s++) {
        if (is_bond(fl, s) || is_slider(fl, s) || is_second(fl, s) || is_mover(fl, s)) continue;
        if (is_rigid(fl, s) && closed[s]) continue;
        double late = fabs(time_to_event(fl, s, closed, w, phase));
        double gap = watched_pace(fl, s, closed, w, phase).value;
        int out = watched(fl, s, closed, w, phase);
        bool here = late <= allowed || fabs(gap) <= 10.0 * gap_noise(fl, out, w);
        if (late < nearest && here) {
            stop = s;
            nearest = late;
        }
    }
    return stop;
}

/* Longest panel on which the slopes of stops that closed a little before (sign 1) are smooth; with
 * sign -1 the same at the end of a panel, of stops that open a little after it, `event` left out.
 *
 * A law with a power that is not whole is singular at its switch; at a distance τ from it, 4 τ is
 * a length on which Legendre coefficients fall by 2.6 from one to the next (Bernstein's ellipse).
 * Where a map has its nodes crowded there (switched), a switch within the error allowed in its
 * instant does not count. Where friction falls with the speed, a slip grows: a panel that skips
 * its growth would solve the equations, too. */
static double graded_length(const Flow *fl, const Panel *panel, const double *w, double phase,
                            double h, double sign, bool switched, int event)
{
    double longest = INFINITY;
    for (int a = 0; a < panel->na; a++) {
        int s = panel->active[a];
        if (is_slider(fl, s) && !is_held(fl, s)) {
            double speed = output_now(fl, s, w, phase).first;
            double normal = pressing_now(fl, s, w, phase).value;
            double growth = -stop_of(fl, s)->mobility * sliding_law(fl, s, speed, normal).viscosity;
            bool hidden = GROWTH < growth * HIDDEN_GROWTH * h;
            if (growth > 0.0 && !hidden) longest = smaller(longest, GROWTH / growth);
        }
        bool turns = disc_of(fl, panel, a) == s && is_sprung(fl, s) && panel->growth[a] == 0.0;
        if (sign > 0.0 && turns && panel->decayed[a] <= FADED) {
            Disc at = disc_now(fl, s, w, phase);
            if (at.size > 0.0 && at.along > 0.0)
                longest = smaller(longest, 0.5 * DECAY * at.size / at.along);
        }
        if (s == event || !singular_slope(fl, s)) continue;
        Course at = depth_now(fl, s, w, phase);
        double delta = at.value, speed = at.first, accel = at.second, away;
        if (delta <= 10.0 * gap_noise(fl, s, w)) continue;
        if (accel > 0.0 && speed * speed < 2.0 * accel * delta)
            away = sqrt(2.0 * delta / accel); /* it nearly opens: a complex pair */
        else if (sign * speed > 0.0)
            away = delta / fabs(speed);
        else
            continue;
        if (!switched || away > 10.0 * stop_of(fl, s)->instant * h)
            longest = smaller(longest, 4.0 * away);
    }
    return longest;
}

/* a stop that opens or closes within a panel, or -1; the fraction of the panel; and the fraction
 * at which one first comes so near to it that only the state can tell; fractions are 2 for none */
typedef struct {
    int stop;
    double where, doubtful;
} Event;

/* what a stop shows of itself in a panel: values at 0, the nodes and 1, positive as long as
 * nothing happens, their Legendre tail, their rounding error and the first rate */
typedef struct {
    double noise, tail, speed;
} Shown;

/* fill s->inner (m,) with the output that tells of a closed stop */
static void show_closed(const Flow *fl, const Panel *panel, int position, int s, int out,
                        double *inner)
{
    int m = panel->m;
    for (int i = 0; i < m; i++) inner[i] = panel->output[position * m + i];
    if (out == s) return;
    double creep_time = stop_of(fl, s)->dashpot / stop_of(fl, s)->stiffness;
    for (int i = 0; i < m; i++)
        inner[i] += creep_time * panel->output[(panel->na + position) * m + i];
}

/* the same of a round clearance, open or closed: what passes zero where it switches */
static void show_round(const Motion *M, int kind, double phase, double h, int stop, int position,
                       double *inner)
{
    const Flow *fl = M->fl;
    const Panel *panel = M->panel;
    int m = panel->m, second = (int)stop_of(fl, stop)->second;
    double *values[2] = {M->s->waves, M->s->waves + m};
    if (M->closed[stop]) {
        memcpy(values[0], panel->output + (size_t)position * m, sizeof(double) * m);
        memcpy(values[1], panel->output + (size_t)place_of(panel, second) * m, sizeof(double) * m);
    } else {
        for (int d = 0; d < 2; d++) {
            int row = d == 0 ? stop : second;
            node_outputs(fl, M->tab, kind, phase, h, panel, row, values[d], M->s);
            for (int i = 0; i < m; i++) values[d][i] -= stop_of(fl, row)->centre;
        }
    }
    for (int i = 0; i < m; i++) {
        double place[2] = {values[0][i], values[1][i]}, still[2] = {0.0, 0.0};
        inner[i] = around(fl, stop, place, still, still).value;
    }
}

/* fill s->values (m + 2,) of a stop; `position` is its place among the closed ones */
static Shown show_stop(const Motion *M, int kind, double phase, double h, int stop, int out,
                       int position)
{
    const Flow *fl = M->fl;
    const Gauss *tab = M->tab;
    Scratch *s = M->s;
    const Panel *panel = M->panel;
    int m = panel->m;
    bool round = is_round(fl, stop);
    double gap = round ? 0.0 : stop_of(fl, stop)->gap, sign = M->closed[stop] ? 1.0 : -1.0;
    double end_phase = phase + fl->omega * h;
    Course first = round ? gap_now(fl, stop, M->w, phase) : output_now(fl, out, M->w, phase);
    double start = first.value, end = round ? gap_now(fl, stop, M->w_end, end_phase).value
                                            : output_now(fl, out, M->w_end, end_phase).value;
    Shown shown = {gap_noise(fl, out, M->w), 0.0, sign * first.first};
    if (is_rigid(fl, stop) && M->closed[stop]) {
        const double *pressing = pressing_of(fl, panel, position);
        shown.noise = round ? hold_noise(fl, (int)stop_of(fl, stop)->second, M->w)
                            : pressing_noise(fl, stop, M->w);
        shown.speed = 0.0;
        start = at_start(tab, pressing) + gap;
        end = at_end(tab, pressing) + gap;
        memcpy(s->inner, pressing, sizeof(double) * m);
    } else if (round) {
        show_round(M, kind, phase, h, stop, position, s->inner);
        for (int i = 0; i < m; i++) s->inner[i] *= sign;
    } else if (M->closed[stop]) {
        show_closed(fl, panel, position, stop, out, s->inner);
    } else {
        node_outputs(fl, tab, kind, phase, h, panel, out, s->inner, s);
        for (int i = 0; i < m; i++) s->inner[i] = gap - s->inner[i];
    }
    s->values[0] = sign * (start - gap);
    s->values[m + 1] = sign * (end - gap);
    for (int i = 0; i < m; i++) s->values[i + 1] = s->inner[i];
    refine(tab, s->values, s->fine);
    shown.tail = 4.0 * legendre_tail(tab, s->inner);
    return shown;
}

/* the same of a slider, to one side of its friction */
static Shown show_friction(const Motion *M, double phase, double h, int s, int position, int side)
{
    const Flow *fl = M->fl;
    const Gauss *tab = M->tab;
    Scratch *scratch = M->s;
    double *values = scratch->values, *inner = scratch->inner;
    int m = M->panel->m;
    show_slider(fl, M->panel, position, side, inner);
    for (int i = 0; i < m; i++) values[i + 1] = inner[i];
    values[0] = at_start(tab, inner);
    values[m + 1] = at_end(tab, inner);
    Shown shown = {hold_noise(fl, s, M->w), 0.0, 0.0};
    if (fl->slides[s] != 0) {
        values[0] = slip(fl, s, M->w, phase);
        values[m + 1] = slip(fl, s, M->w_end, phase + fl->omega * h);
        shown = (Shown){slip_noise(fl, s, M->w, phase), 0.0, values[1] - values[0]};
    }
    refine(tab, values, scratch->fine);
    shown.tail = 4.0 * legendre_tail(tab, inner);
    return shown;
}

/* whether a stop that lets go without pulling is beyond its surface at stretched time `root`, where
 * its force would press in vain */
static bool presses_in_vain(const Motion *M, int kind, double phase, double h, int stop,
                            double root)
{
    Scratch *s = M->s;
    const Flow *fl = M->fl;
    int m = M->panel->m;
    node_outputs(fl, M->tab, kind, phase, h, M->panel, stop, s->inner, s);
    for (int i = 0; i < m; i++) s->values[i + 1] = s->inner[i];
    s->values[0] = output_now(fl, stop, M->w, phase).value;
    s->values[m + 1] = output_now(fl, stop, M->w_end, phase + fl->omega * h).value;
    return interpolate(M->tab, s->values, root) < stop_of(fl, stop)->gap;
}

/* take the first event that s->values show into account */
static void find_event(const Motion *M, int kind, double phase, double h, int stop, Shown shown,
                       Event *found)
{
    Scratch *s = M->s;
    bool hidden = !M->closed[stop] && watched(M->fl, stop, M->closed, M->w, phase) != stop;
    double below = shown.noise + shown.tail, edge = 0.0;
    if (shown.speed > 0.0) { /* the panel may begin a little before the event it begins with */
        below += 2.0 * larger(-s->values[0], 0.0);
        edge = smaller(2.0 * s->values[0], 0.0);
    }
    double root = first_root(M->tab, s->values, s->fine, below, edge);
    if (root <= 1.0) {
        double fraction = map_fraction(M->tab, kind, root);
        if (hidden && presses_in_vain(M, kind, phase, h, stop, root)) {
            found->doubtful = smaller(found->doubtful, fraction);
        } else if (fraction < found->where) {
            found->stop = stop;
            found->where = fraction;
        }
    } else if (shown.tail > 10.0 * shown.noise) {
        double low = first_doubt(M->tab, s->values, s->fine, shown.noise, shown.tail);
        if (low < 1.0) found->doubtful = smaller(found->doubtful, map_fraction(M->tab, kind, low));
    }
}

/* whether a slider that sticks keeps an open stop where it is: what is shut may not close then */
static bool held_open(const Motion *M, int stop)
{
    for (int s = 0; s < M->fl->n_stops; s++)
        if (is_stuck(M, s) && moves_with(M->fl, s, stop)) return true;
    return false;
}

/* whether a slider that sticks is held to the other side of its friction all the time: to this one it
 * may only slip later */
static bool held_away(const Motion *M, int s, int position, int side)
{
    const Panel *panel = M->panel;
    const double *F = panel->F + (size_t)position * panel->m;
    bool away = false;
    if (M->fl->slides[s] != 0 || !is_slider(M->fl, s) || is_disc(M->fl, s)) return false;
    for (int i = 0; i < panel->m; i++) {
        if (side * F[i] > 0.0) return false;
        away = away || F[i] != 0.0;
    }
    return away;
}

/* the first event within a panel; s->driven is filled where not all stops are closed */
static Event first_event(const Motion *M, int kind, double phase, double h)
{
    const Flow *fl = M->fl;
    Event found = {-1, 2.0, 2.0};
    int position = -1;
    for (int stop = 0; stop < fl->n_stops; stop++) {
        if (M->closed[stop]) position++; /* a bond is always closed */
        if (is_bond(fl, stop) || is_mover(fl, stop) || is_mate(fl, stop)) continue;
        if (is_second(fl, stop) && !rubs_around(fl, stop)) continue;
        if (rubs(fl, stop) && (!M->closed[stop] || slides_freely(fl, stop))) continue;
        if (is_hard_disc(fl, stop) && fl->slides[stop] != 0) continue; /* see `time_to_rest` */
        if (is_rigid(fl, stop) && !is_round(fl, stop) && !M->closed[stop] && held_open(M, stop)) continue;
        if (!rubs(fl, stop)) {
            int out = watched(fl, stop, M->closed, M->w, phase);
            Shown shown = show_stop(M, kind, phase, h, stop, out, position);
            find_event(M, kind, phase, h, stop, shown, &found);
            continue;
        }
        for (int side = -1; side <= 1; side += 2) /* what slides has one only */
            if (((fl->slides[stop] == 0 && !is_disc(fl, stop)) || side == 1) &&
                !held_away(M, stop, position, side))
                find_event(M, kind, phase, h, stop, show_friction(M, phase, h, stop, position, side),
                           &found);
    }
    if (!(found.doubtful < found.where)) found.doubtful = 2.0;
    return found;
}
