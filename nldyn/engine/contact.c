/* The course of a contact, panel after panel. */
#include "engine.h"

#define AT_ONCE 1e-12 /* of a panel: so near its start, an event happens there */
#define SHORTER 0.4 /* of a panel that was not solved: the next one tried */
#define NEAR_END 1e-3 /* of a panel: an event that it aims at and that happens so near its end */
#define INSTANTS 5.0 /* the same of another event: in errors of its instant, at most */
#define FARTHEST_END 1e-7
#define GIVEN_UP 1e-5 /* the same of a slider that is let go at the end: its force is as small there */
#define MISSED 0.01 /* of the panel first tried: no event in one so short: it is farther off, */
#define FARTHER 10.0 /* and the next panel is so many times longer */
#define WITHIN 1e-6 /* of a panel: a doubtful place nearer to an end is that of a known switch */
#define MOST_ATTEMPTS 100
#define BEYOND 1.001 /* of a length in which nothing was seen: as much as a corrected instant asks for */
#define ELSEWHERE 1e-4 /* of its radius: a node off a circle that holds a body */

/* a panel that is being looked for */
typedef struct {
    double phase;      /* forcing phase at its start, less whole turns */
    double h_max;      /* its longest length */
    int kind, aim;     /* aim: the stop at whose event it is to end, or -1 */
    int solved_for;    /* that of the panel that was solved last */
    bool decays;       /* whether that one shows what the stops damp */
    double h, tried;   /* length; that first tried */
    bool looked;       /* whether a doubtful place has been cut at */
    int smooth, to_switch; /* kinds without and with an event at its end */
} Trial;

/* what comes of one attempt */
enum Verdict { AGAIN, TAKEN, TAKEN_WITH_EVENT };

/* whether a body on a rigid round clearance is elsewhere at a node of the panel: what holds it goes
 * with the square of its speed, so that a body that is thrown around solves the equations, too */
static bool leaves_circle(const Flow *fl, const Panel *panel)
{
    int m = panel->m;
    for (int a = 0; a < panel->na; a++) {
        int s = panel->active[a];
        if (!is_round(fl, s) || !is_rigid(fl, s)) continue;
        int other = partner_of(fl, panel, a);
        const double *x = panel->output + (size_t)a * m, *y = panel->output + (size_t)other * m;
        double radius = hypot(panel->depth[a], panel->depth[other]); /* at the start */
        for (int i = 0; i < m; i++)
            if (!(fabs(hypot(x[i], y[i]) - radius) <= ELSEWHERE * radius)) return true;
    }
    return false;
}

/* Whether a panel holds another solution of the force laws than the motion: it opens a stop at
 * once that is not about to, lets one feed as much as it should damp, or leaves a rigid circle. */
static bool far_off(const Motion *M, const Trial *trial, Event event)
{
    const Flow *fl = M->fl;
    const Panel *panel = M->panel;
    if (panel->round && leaves_circle(fl, panel)) return true;
    if (event.stop < 0) {
        double least = panel->decay[0];
        for (int a = 1; a < panel->na; a++) least = smaller(least, panel->decay[a]);
        return !(least > -DECAY);
    }
    double allowed = 10.0 * coarsest_instant(fl) * trial->h;
    return !(trial->h * event.where > AT_ONCE * trial->tried ||
             at_switch(fl, event.stop, M->w, trial->phase, allowed, M->closed));
}

/* guess a panel anew, no longer than `limit` */
static void guess_again(Motion *M, Trial *trial, double limit)
{
    Choice choice = guess_panel(M->fl, M->tab, trial->phase, M->w, limit, M->h_mapped,
                                M->start_switch, M->panel);
    trial->aim = -1;
    trial->kind = choice.kind;
    trial->h = choice.length;
}

/* go over to a panel of another kind, `ratio` times as long */
static void change_length(Motion *M, Trial *trial, int kind, double ratio)
{
    keep_profile(M->fl, M->tab, trial->kind, kind, ratio, M->panel, M->s->guess);
    trial->kind = kind;
    trial->h *= ratio;
}

/* Add to the rounding errors of the accelerations of what is held those of friction over a plane, which
 * acts on them at once: its direction is as little known as a speed that comes to rest. */
static void add_heading_noise(const Motion *M, double *rounding)
{
    const Flow *fl = M->fl;
    const Panel *panel = M->panel;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!M->closed[s] || !is_hard_disc(fl, s) || is_mate(fl, s) || fl->slides[s] != 1) continue;
        double speed[2], here = M->phase + fl->omega * M->t;
        double least = (1.0 - NEARER) * speeds_over(fl, s, M->w, here, speed); /* at the end */
        double force = grip(fl, s) * pressed_on(M, s) * speeds_noise(fl, s, M->w) / larger(least, TINY);
        for (int a = 0; a < panel->na; a++) {
            int held = panel->active[a];
            if (is_held(fl, held))
                rounding[a] += force * hypot(between(fl, held, s),
                                             between(fl, held, (int)stop_of(fl, s)->beside));
        }
    }
}

/* rounding errors of the outputs, from which events are found in the state */
static void fill_rounding(const Motion *M)
{
    const Flow *fl = M->fl;
    const Panel *panel = M->panel;
    double *rounding = M->s->rounding;
    for (int a = 0; a < panel->na; a++) {
        int stop = panel->active[a];
        rounding[a] = is_held(fl, stop) ? pressing_noise(fl, stop, M->w)
                                        : output_noise(fl, stop, M->w);
    }
    for (int o = panel->na; o < panel->outputs; o++) {
        int stop = panel->active[o % panel->na];
        rounding[o] = o < 2 * panel->na ? rate_noise(fl, stop, M->w) : pressing_noise(fl, stop, M->w);
    }
    add_heading_noise(M, rounding);
    for (int o = 0; o < panel->outputs; o++) M->s->noise[o] = rounding[o];
}

/* carry the rounding errors of the penetrations to the end of the panel */
static void carry_noise(Motion *M, double h)
{
    Panel *panel = M->panel;
    for (int a = 0; a < panel->na; a++) {
        int stop = panel->active[a];
        double more = carried_noise(M->fl, stop, M->w, panel->depth[a], h);
        panel->end_doubt[a] = panel->doubt[a] + more;
        if (!is_held(M->fl, stop))
            M->s->noise[a] = smaller(panel->end_doubt[a], M->s->rounding[a]);
    }
}

/* whether a solved panel resolves what happens in it; that takes a while */
static bool fine_enough(const Motion *M, const Trial *trial)
{
    const Flow *fl = M->fl;
    if (!trial->decays) return false;
    if (!resolved(fl, M->tab, trial->kind, trial->h, M->s->rounding, M->panel, M->s)) return false;
    bool ends = trial->kind % 2 == 1;
    double end_phase = trial->phase + fl->omega * trial->h;
    return trial->h <= 1.5 * graded_length(fl, M->panel, M->w_end, end_phase, trial->h, -1.0, ends,
                                           ends ? trial->solved_for : -1);
}

/* where a panel is expected to end with a release, and more time is left, aim at that */
static void aim_at_release(const Motion *M, Trial *trial)
{
    const Flow *fl = M->fl;
    double end_phase = trial->phase + fl->omega * trial->h;
    if (trial->aim >= 0 || trial->kind % 2 != 1 || !(trial->h < trial->h_max)) return;
    for (int a = 0; a < M->panel->na; a++) {
        int s = M->panel->active[a];
        bool elastic = trial->aim < 0 && is_elastic(fl, s);
        if (elastic && time_to_event(fl, s, M->closed, M->w_end, end_phase) < trial->h)
            trial->aim = s;
    }
}

/* time from the end of a panel to the event that it aims at, and whether it is there: as near as
 * rounding tells */
static double time_to_aim(const Motion *M, const Trial *trial, bool *there)
{
    const Flow *fl = M->fl;
    double h = trial->h, end_phase = trial->phase + fl->omega * h;
    const double *w = M->w_end;
    int aim = trial->aim;
    if (rubs(fl, aim)) {
        double off, dh = time_to_slip(M, aim, trial->kind, end_phase, h, &off);
        double noise = fl->slides[aim] != 0 ? slip_noise(fl, aim, w, end_phase)
                                            : hold_noise(fl, aim, w);
        *there = fabs(dh) <= RELEASED * h || fabs(off) <= noise ||
                 (is_sprung(fl, aim) && fabs(dh) <= SUM_ROUNDING * end_phase / fl->omega);
        return dh;
    }
    if (ends_smoothly(fl, aim, M->closed)) {
        double dh = time_to_release(fl, M->tab, aim, trial->kind, h, M->panel);
        *there = fabs(dh) <= RELEASED * h;
        return dh;
    }
    double off = watched_pace(fl, aim, M->closed, w, end_phase).value;
    *there = fabs(off) <= gap_noise(fl, watched(fl, aim, M->closed, w, end_phase), M->w);
    return time_to_event(fl, aim, M->closed, w, end_phase);
}

/* whether that is the end of the panel */
static bool at_aim(const Motion *M, const Trial *trial, double dh, bool there)
{
    const Flow *fl = M->fl;
    double h = trial->h, end_phase = trial->phase + fl->omega * h;
    return fabs(dh) <= instant_with(fl, trial->aim, M->w_end, end_phase, h, M->closed) ||
           (dh < INFINITY && there);
}

/* whether another length, not far from this one, leads there; takes it */
static bool aim_again(Trial *trial, double dh)
{
    double h = trial->h;
    if (!(-0.5 * h < dh && dh < h && (dh < 0.0 || h < trial->h_max))) return false;
    trial->h = smaller(h + dh, trial->h_max);
    return true;
}

/* The same before anything else is asked of a panel with friction, whose aim is the first event that
 * was seen: what ends it will be looked at as all are. */
static bool still_off(const Motion *M, Trial *trial)
{
    bool there;
    if (trial->aim < 0 || M->panel->sought == M->panel->na) return false;
    double dh = time_to_aim(M, trial, &there);
    return !at_aim(M, trial, dh, there) && aim_again(trial, dh);
}

/* whether a panel that aims at an event ends with it, goes on, or is to be tried again; without
 * any of them, -1 */
static int reach_aim(Motion *M, Trial *trial, bool event)
{
    const Flow *fl = M->fl;
    double h = trial->h;
    int aim = trial->aim;
    bool there;
    double dh = time_to_aim(M, trial, &there);
    if (at_aim(M, trial, dh, there)) {
        if (fine_enough(M, trial)) return TAKEN_WITH_EVENT;
    } else if (aim_again(trial, dh)) {
        return AGAIN;
    } else if (!event && dh == INFINITY && !M->closed[aim] && h < MISSED * trial->tried) {
        change_length(M, trial, trial->kind, FARTHER); /* it is farther off than it was seen */
        return AGAIN;
    } else if (!event && dh > h && rubs(fl, aim) && h < trial->h_max) {
        change_length(M, trial, trial->kind, smaller(FARTHER, trial->h_max / h));
        return AGAIN; /* it came sooner in the motion before */
    } else if (dh > 0.0 && fine_enough(M, trial)) { /* the contact goes on */
        return TAKEN;
    }
    return -1;
}

/* look at a solved panel: take it, or change its length */
static int judge(Motion *M, Trial *trial, Event event, bool lost)
{
    const Flow *fl = M->fl;
    if (WITHIN < event.doubtful && event.doubtful < 1.0 - WITHIN && !trial->looked) {
        trial->looked = true; /* the state at a panel's end is exact */
        change_length(M, trial, trial->smooth, event.doubtful);
        trial->aim = -1;
        return AGAIN;
    }
    double near_end = NEAR_END;
    if (event.stop >= 0 && event.stop != trial->aim) /* so near that `switch_with` will find it */
        near_end = larger(smaller(INSTANTS * stop_of(fl, event.stop)->instant, FARTHEST_END), AT_ONCE);
    if (trial->aim >= 0 && event.stop >= 0 && is_sprung(fl, event.stop) &&
        (int)stop_of(fl, event.stop)->normal == trial->aim)
        near_end = larger(near_end, GIVEN_UP);
    bool ends = event.where > 1.0 - near_end;
    if (event.stop >= 0 && (trial->aim < 0 || !ends) && !lost) {
        int goal = ends_smoothly(fl, event.stop, M->closed) ? trial->smooth : trial->to_switch;
        trial->aim = event.stop;
        if (trial->h * event.where > M->h_mapped) { /* half the way first */
            goal = trial->smooth;
            trial->aim = -1;
            event.where *= 0.5;
        }
        change_length(M, trial, goal, event.where);
        return AGAIN;
    }
    aim_at_release(M, trial);
    if (trial->aim >= 0 && !lost) {
        int verdict = reach_aim(M, trial, event.stop >= 0);
        if (verdict >= 0) return verdict;
    } else if (!lost && fine_enough(M, trial)) {
        return TAKEN;
    }
    trial->aim = -1;
    change_length(M, trial, trial->smooth, 0.5);
    return AGAIN;
}

/* end the search for a panel that became so short that no time passes in it */
static int end_at_once(const Motion *M, Trial *trial)
{
    const Flow *fl = M->fl;
    double coarse = 10.0 * coarsest_instant(fl) * trial->tried;
    if (trial->aim < 0 || !at_switch(fl, trial->aim, M->w, trial->phase, coarse, M->closed))
        trial->aim = stop_at_switch(fl, M->w, trial->phase, trial->tried, M->closed);
    trial->h = 0.0;
    return trial->aim >= 0 ? OK : CONTACT_FAILED;
}

/* begin the search for a panel, no longer than h_max */
static Trial first_trial(Motion *M, double phase, double h_max)
{
    Trial trial = {.phase = phase, .h_max = h_max, .looked = false,
                   .smooth = 2 * M->start_switch, .to_switch = 2 * M->start_switch + 1};
    Choice first = first_panel(M, phase, h_max);
    trial.kind = first.kind;
    trial.h = first.length;
    trial.aim = first.event;
    double graded = graded_length(M->fl, M->panel, M->w, phase, trial.h, 1.0,
                                  M->start_switch == 1, -1);
    if (trial.h > 1.5 * graded) guess_again(M, &trial, graded);
    trial.tried = trial.h;
    return trial;
}

/* Solve one panel and choose its length, at most h_max, and h_mapped to aim at an event. The trial
 * that comes back ends where stop `aim` opens or closes, or (aim = -1) is short enough to be
 * resolved. */
static int contact_panel(Motion *M, double phase, double h_max, Trial *trial)
{
    const Flow *fl = M->fl;
    Panel *panel = M->panel;
    panel->kept = false;
    fill_rounding(M);
    *trial = first_trial(M, phase, h_max);
    double clear = 0.0; /* length in which nothing was seen before what is aimed at */
    for (int attempt = 0; attempt < MOST_ATTEMPTS; attempt++) {
        if (trial->h <= HALF_ULP * trial->tried || phase + fl->omega * trial->h == phase)
            return end_at_once(M, trial);
        if (interrupted(fl->watch)) return INTERRUPTED;
        carry_noise(M, trial->h);
        bool found = solve_panel(fl, M->tab, trial->kind, phase, M->w, trial->h, M->s->noise,
                                 panel, M->s);
        bool lost = attempt % 20 == 19; /* the instant that is aimed at goes to and fro */
        Event event = {-1, 2.0, 2.0};
        if (found) {
            trial->solved_for = trial->aim;
            trial->decays = shows_decay(fl, M->tab, trial->kind, trial->h, panel);
            panel_end(fl, M->tab, trial->kind, phase, M->w, trial->h, panel, M->w_end, M->s);
            if (panel->na < fl->n_stops || any_led(panel))
                drive_back(fl, M->tab, M->w, panel, M->s);
            if (any_led(panel))
                show_following(fl, M->tab, trial->kind, phase, trial->h, panel, M->s);
            if (trial->h <= BEYOND * clear && !lost && still_off(M, trial)) continue;
            event = first_event(M, trial->kind, phase, trial->h);
            found = !far_off(M, trial, event);
        }
        if (!found) {
            guess_again(M, trial, SHORTER * smaller(trial->h, trial->tried));
            trial->tried = trial->h;
            clear = 0.0;
            continue;
        }
        clear = trial->h * smaller(event.where, 1.0);
        int verdict = judge(M, trial, event, lost);
        if (verdict == TAKEN) trial->aim = -1;
        if (verdict != AGAIN) return OK;
    }
    return CONTACT_FAILED;
}

/* share of the speed at a stop that rounding of the penetration costs in a contact so deep */
static double lost_to_rounding(const Flow *fl, int s, const double *w, double phase, double peak,
                               double noise)
{
    if (peak <= 0.0) return 0.0;
    const Stop *stop = stop_of(fl, s);
    double p = stop->exponent, rate = stop->stiffness * mobility_now(fl, s, w, phase);
    double impact_speed = sqrt(2.0 * rate * pow(peak, p + 1.0) / (p + 1.0));
    double speed = impact_speed;
    int rows[2] = {s, (int)stop->second};
    for (int d = 0; d < (is_round(fl, s) ? 2 : 1); d++) {
        const double *row = row_of(fl, 1, rows[d]);
        speed += output_size(fl, rows[d], w, 0) * fl->omega;
        for (int j = 0; j < fl->size; j++) speed += fabs(row[j] * w[j]);
    }
    return noise / peak * impact_speed / speed;
}
