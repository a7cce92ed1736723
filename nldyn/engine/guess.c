/* First guesses of contact panels: of free impacts, of bonds, and of a motion before. */
#include "engine.h"

#define LEAST_GUESS 0.01 /* of the peak: penetrations where the sine of a guess begins and ends */
#define LEAST_STRAIN 1e-30 /* Legendre tail of a force that a longer panel resolves as well */
#define SAFETY 0.9 /* of the length that the tail allows the next panel */
#define LEAST_GROWTH 0.5 /* of a panel's length after the one before */
#define MOST_GROWTH 1.6
#define MOST_LEFT 0.6 /* of a contact that one panel takes to its end; more of it is halved */
#define ALL_BUT 0.98  /* of the time left: a known panel without an event that fills it ends so */
#define SMALLEST 1e-3 /* of the largest: a penetration that is guessed where none is expected */

/* a free impact through the present state: peak penetration, duration and time to release */
typedef struct {
    double peak, duration, left;
} Impact;

/* From the energy of the contact spring and the local mobility; a push (positive acceleration
 * without speed) counts as an impact as deep as its static penetration. All zero when the stop is
 * left at once. */
static Impact expected_contact(const Flow *fl, int s, const double *w, double phase)
{
    const Stop *stop = stop_of(fl, s);
    Course at = depth_now(fl, s, w, phase);
    double speed = at.first, accel = at.second, depth = larger(at.value, 0.0);
    double p = stop->exponent, rate = stop->stiffness * mobility_now(fl, s, w, phase);
    double still = pow(larger(accel, 0.0) / rate, 1.0 / p);
    double energy = 0.5 * speed * speed + rate * (pow(depth, p + 1.0) + pow(still, p + 1.0)) / (p + 1.0);
    if (energy <= 0.0) return (Impact){0.0, 0.0, 0.0};
    double top_speed = sqrt(2.0 * energy);
    double peak = pow(energy * (p + 1.0) / rate, 1.0 / (p + 1.0));
    double duration = stop->duration * peak / top_speed;
    double left = duration * (0.5 + asin(speed / top_speed) / PI);
    if (speed >= 0.0 && depth < still) /* pushed in from near rest */
        left = duration;
    else if (speed < 0.0)
        left = smaller(0.5 * duration, -depth / speed);
    if (accel < 0.0 && left > 0.0) {
        double root = sqrt(speed * speed - 2.0 * accel * depth);
        if (speed > 0.0) { /* a slow touch is turned back by the deceleration */
            double back = (speed + root) / -accel, share = back / (back + left);
            return (Impact){peak * share, duration * share, left * share};
        }
        /* (speed + root) / -accel without cancellation, for an acceleration of any size */
        left = smaller(left, 2.0 * depth / (root - speed));
    }
    return (Impact){peak, duration, left};
}

/* half-sine penetrations at the nodes to start Newton's method from */
static void profile_guess(const Gauss *tab, int kind, double h, Impact hit, double *delta)
{
    for (int i = 0; i < tab->m; i++) {
        double t = h * tab->chi[kind * tab->m + i];
        double x = PI * smaller((hit.duration - hit.left + t) / hit.duration, 1.0);
        delta[i] = larger(hit.peak * sin(x), LEAST_GUESS * hit.peak);
    }
}

/* carry node values over to a panel `ratio` times as long, linearly in time */
static void stretch_profile(const Gauss *tab, int old_kind, int new_kind, double ratio,
                            const double *old, double *new)
{
    int m = (int)tab->m;
    const double *chi = tab->chi + (size_t)old_kind * m;
    for (int i = 0; i < m; i++) {
        double x = tab->chi[new_kind * m + i] * ratio;
        int j = 0;
        while (j < m && chi[j] < x) j++;
        if (j == 0)
            new[i] = old_kind >= 2 ? old[0] * x / chi[0] : old[0];
        else if (j == m)
            new[i] = old[m - 1];
        else
            new[i] = old[j - 1] + (old[j] - old[j - 1]) * (x - chi[j - 1]) / (chi[j] - chi[j - 1]);
    }
}

/* carry all penetrations over to a panel `ratio` times as long */
static void keep_profile(const Flow *fl, const Gauss *tab, int kind, int new_kind, double ratio,
                         Panel *panel, double *guess)
{
    int m = panel->m;
    for (int a = 0; a < panel->na; a++) {
        double *output = panel->output + (size_t)a * m, top = 0.0;
        stretch_profile(tab, kind, new_kind, ratio, output, guess);
        for (int i = 0; i < m; i++) top = larger(top, guess[i]);
        int s = panel->active[a];
        bool pressed = (is_elastic(fl, s) || is_rigid(fl, s)) && !is_round(fl, s);
        for (int i = 0; i < m; i++) output[i] = !pressed ? guess[i] : larger(guess[i], SMALLEST * top);
    }
}

/* depth (value) and speed (slope) of a body that creeps out of a stop, its speed held by the
 * damping, or zeros: so it does where an elastic contact would take much longer than the damping
 * to act */
static Value creep(const Flow *fl, int s, const double *w, double phase, double duration)
{
    Value none = {0.0, 0.0};
    if (fl->laws[s] != 0 || !depends_on_speed(fl, s)) return none;
    Course at = depth_now(fl, s, w, phase);
    double depth = at.value;
    if (at.first >= 0.0 || depth <= 0.0) return none;
    double viscosity = law(fl, s, depth, at.first).viscosity;
    if (viscosity * mobility_now(fl, s, w, phase) * duration < CREEP) return none;
    return (Value){depth, at.first};
}

/* length of a panel to try first on a bond: a radian of the free swing through the present, by a
 * bound of the slope as far as the displacement and the speed carry */
static double bond_length(const Flow *fl, int s, const double *w, double phase)
{
    Course at = output_now(fl, s, w, phase);
    const Stop *bond = stop_of(fl, s);
    const double *numbers = (const double *)bond;
    double rate = fl->omega;
    for (int i = 0; i < 6; i++) {
        double reach = fabs(at.value) + fabs(at.first) / rate, power = 1.0, slope = 0.0;
        for (int c = FIRST_POWER; c < fl->n_columns; c++) {
            slope += (c - FIRST_POWER + 1) * fabs(numbers[c]) * power;
            power *= reach;
        }
        rate = sqrt(rate * larger(sqrt(bond->mobility * slope), fl->omega));
    }
    return 1.0 / rate;
}

/* factor by which the next panel may be longer than this one, as far as its bonds tell: a Legendre
 * tail of degree m - 1 goes about with that power of the length */
static double growth_of_panel(const Flow *fl, const Gauss *tab, const Panel *panel)
{
    int na = panel->na, m = panel->m;
    double strain = LEAST_STRAIN;
    for (int a = 0; a < na; a++) {
        if (!is_bond(fl, panel->active[a])) continue;
        for (int o = a; o < panel->outputs; o += na) {
            const double *slope = panel->slope + (size_t)o * m;
            double top = largest(slope, m);
            if (top > 0.0) strain = larger(strain, legendre_tail(tab, slope) / (4.0 * top));
        }
        const double *F = panel->F + (size_t)a * m;
        double top = largest(F, m);
        double rounding = BLIND * panel->doubt[a] * largest(panel->slope + (size_t)a * m, m);
        if (top > 0.0) strain = larger(strain, (legendre_tail(tab, F) - rounding) / top);
    }
    double growth = SAFETY * pow(fl->tail / strain, 1.0 / (m - 1));
    return smaller(larger(growth, LEAST_GROWTH), MOST_GROWTH);
}

/* guess a bond's displacements to be the present one: then one step is its linearisation */
static void hold_still(const Flow *fl, double phase, const double *w, int a, Panel *panel)
{
    double value = output_now(fl, panel->active[a], w, phase).value;
    for (int i = 0; i < panel->m; i++) panel->output[a * panel->m + i] = value;
}

/* kind and length of a panel, and the event that it ends with, or -1 */
typedef struct {
    int kind, event;
    double length;
} Choice;

/* turn guessed penetrations of a round clearance into displacements: it goes on around the centre
 * as fast as now */
static void guess_round(const Flow *fl, const Gauss *tab, double phase, const double *w,
                        Choice choice, int a, Panel *panel)
{
    int m = panel->m, s = panel->active[a];
    const Stop *stop = stop_of(fl, s);
    double place[2], speed[2], pace[2];
    round_now(fl, s, w, phase, place, speed, pace);
    Polar at = polar(fl, s, place, speed);
    double *first = panel->output + (size_t)a * m;
    double *second = panel->output + (size_t)place_of(panel, (int)stop->second) * m;
    double turning = at.radius > 0.0 ? at.across / at.radius : 0.0;
    for (int i = 0; i < m; i++) {
        Complex way = turned(turning * choice.length * tab->chi[choice.kind * m + i]);
        double radius = stop->gap + stop->sense * first[i];
        way = scaled(radius, product(complex_of(at.n[0], at.n[1]), way));
        first[i] = way.re;
        second[i] = way.im;
    }
}

/* guess the outputs of one closed stop */
static void guess_outputs(const Flow *fl, const Gauss *tab, double phase, const double *w,
                          Choice choice, int a, Panel *panel)
{
    int m = panel->m, stop = panel->active[a];
    double *delta = panel->output + (size_t)a * m;
    if (is_second(fl, stop)) return; /* with the first direction */
    if (is_bond(fl, stop) || is_mover(fl, stop) || (is_slider(fl, stop) && !is_held(fl, stop))) {
        hold_still(fl, phase, w, a, panel);
        int disc = disc_of(fl, panel, a);
        double pace = output_now(fl, stop, w, phase).first * choice.length;
        if (disc >= 0 && panel->growth[place_of(panel, disc)] > 0.0)
            for (int i = 0; i < panel->m; i++) delta[i] = pace * tab->chi[choice.kind * panel->m + i];
        return;
    }
    if (is_held(fl, stop)) {
        double push = output_now(fl, stop, w, phase).second;
        for (int i = 0; i < m; i++) delta[i] = push;
        return;
    }
    Impact hit = {0.0, 0.0, 0.0};
    if (is_elastic(fl, stop)) hit = expected_contact(fl, stop, w, phase);
    Value out = creep(fl, stop, w, phase, hit.duration);
    if (out.value > 0.0) {
        for (int i = 0; i < m; i++) {
            double later = out.value + out.slope * choice.length * tab->chi[choice.kind * m + i];
            delta[i] = larger(later, SMALLEST * out.value);
        }
    } else if (hit.duration > 0.0) {
        profile_guess(tab, choice.kind, choice.length, hit, delta);
    } else {
        for (int i = 0; i < m; i++) delta[i] = 0.0;
    }
    if (is_round(fl, stop)) guess_round(fl, tab, phase, w, choice, a, panel);
}

/* length of a panel that resolves the fastest swing on coupled stops */
static double longest_coupled(const Flow *fl, const Gauss *tab, const Panel *panel)
{
    double fastest = sqrt(coupled_stiffness(fl, panel));
    return fastest > 0.0 ? MAPPED * fl->node_angle * panel->m / (tab->power * fastest) : INFINITY;
}

/* Choose the kind and length of a panel and guess its penetrations; h bounds the length, h_mapped
 * that of a panel that is to end with a release. A contact is covered by two panels, so that no
 * panel has to resolve more than a quarter wave. */
static Choice guess_panel(const Flow *fl, const Gauss *tab, double phase, const double *w,
                          double h, double h_mapped, int start_switch, Panel *panel)
{
    bool ends = false;
    double length = smaller(h, longest_coupled(fl, tab, panel));
    for (int a = 0; a < panel->na; a++) {
        int stop = panel->active[a];
        if (!is_elastic(fl, stop) || is_coupled(fl, stop)) continue;
        Impact hit = expected_contact(fl, stop, w, phase);
        Value out = creep(fl, stop, w, phase, hit.duration);
        double most = hit.left;
        bool to_end = true;
        if (out.value > 0.0) {
            most = -0.5 * out.value / out.slope;
            to_end = false;
        } else if (hit.left > smaller(MOST_LEFT * hit.duration, h_mapped)) {
            most = 0.5 * hit.left;
            to_end = false;
        }
        if (most < length) {
            ends = to_end;
            length = most;
        }
    }
    Choice choice = {2 * start_switch + ends, -1, length};
    for (int a = 0; a < panel->na; a++) guess_outputs(fl, tab, phase, w, choice, a, panel);
    return choice;
}

/* the recorded panel of a motion before at this phase */
static int64_t panel_before(Motion *M, double phase)
{
    for (; M->ahead < M->rec->capacity; M->ahead++) {
        const Recorded *piece = recorded(M->rec, M->ahead);
        if (piece->phase + 0.5 * M->fl->omega * piece->duration >= phase) break;
    }
    return M->ahead;
}

/* Kind, length and event of a panel to try first; fills the penetrations.
 *
 * The panel of a motion before serves, if it has one there. Of another orbit only one
 * of the kind that the state asks for does, and its length only if it ends with an event: lengths
 * that are handed on from orbit to orbit would become shorter and shorter. */
static Choice first_panel(Motion *M, double phase, double h_max)
{
    const Flow *fl = M->fl;
    Panel *panel = M->panel;
    int m = panel->m;
    int64_t n = panel_before(M, M->before + phase);
    const Recorded *before = recorded(M->rec, n);
    const double *depth = depths_of(fl, m, before);
    bool known = n < M->rec->capacity && before->kind != FLIGHT &&
                 (int)before->kind / 2 == M->start_switch;
    for (int a = 0; a < panel->na && known; a++)
        known = largest(depth + (size_t)panel->active[a] * m, m) > 0.0;
    if (known && before->event >= 0.0 && rubs(fl, (int)before->event))
        known = acts_in(panel, (int)before->event) && /* else nothing presses on it now */
                !(is_hard_disc(fl, (int)before->event) && fl->slides[(int)before->event] != 0);
    Choice guessed = {-1, -1, 0.0};
    if (M->other || !known) {
        guessed = guess_panel(fl, M->tab, phase, M->w, h_max, M->h_mapped, M->start_switch, panel);
        known = known && guessed.kind == (int)before->kind;
    }
    if (!known) return guessed;
    for (int a = 0; a < panel->na; a++)
        for (int i = 0; i < m; i++)
            panel->output[a * m + i] = depth[(size_t)panel->active[a] * m + i];
    Choice found = {(int)before->kind, (int)before->event, before->duration};
    if (M->other && found.event < 0) {
        for (int a = 0; a < panel->na; a++)
            if (is_bond(fl, panel->active[a])) hold_still(fl, phase, M->w, a, panel);
        return (Choice){found.kind, -1, guessed.length};
    }
    if (found.length > h_max || (found.event < 0 && found.length > ALL_BUT * h_max))
        return (Choice){found.kind, -1, h_max};
    return found;
}
