/* Round clearances: a body within a ring, or around a pin, whose penetration is radial.
 *
 * One is two rows of stops, a direction each: the first has the law and closes and opens, the
 * second follows it, as sliders follow what presses them on. Their outputs are the displacements
 * X along both; with r = |X|, n = X/r and t, n turned from the first direction to the second, a ring
 * of clearance c has the penetration δ = r - c, a pin δ = c - r, and the forces
 *
 *     F = N(δ, δ') (± n) + T t,
 *
 * with T = ±μN in the sense in which the surface slides. Where it sticks, T keeps the speed of the
 * surface, t . X' + v_s, at zero: with the accelerations X'' = a - M F, M the mobilities between both
 * directions,
 *
 *     t . X'' = (t . X') (n . X') / r.
 *
 * A rigid ring or pin has impacts, see `rigid.c`, and while a body is on it the force N that keeps
 * r at c,
 *
 *     n . X'' = -(t . X')² / r.
 *
 * The row of the second direction has the friction: fl->slides tells of it, its events are those of
 * sliding and sticking. */
#include "engine.h"

/* what is taken from an output for the number that a panel knows: a gap, a centre's place */
static double origin_of(const Flow *fl, int s)
{
    return is_planar(fl, s) ? stop_of(fl, s)->centre : stop_of(fl, s)->gap;
}

/* where a round clearance is, in polar coordinates of its centre */
typedef struct {
    double radius, n[2]; /* n: unit vector away from the centre */
    double depth, rate;  /* penetration and its rate */
    double across;       /* speed along t */
} Polar;

/* the same of displacements and their rates, from the centre */
static Polar polar(const Flow *fl, int s, const double *place, const double *speed)
{
    const Stop *stop = stop_of(fl, s);
    Polar at = {.radius = hypot(place[0], place[1]), .n = {1.0, 0.0}};
    if (at.radius > 0.0)
        for (int d = 0; d < 2; d++) at.n[d] = place[d] / at.radius;
    at.depth = stop->sense * (at.radius - stop->gap);
    at.rate = stop->sense * (at.n[0] * speed[0] + at.n[1] * speed[1]);
    at.across = at.n[0] * speed[1] - at.n[1] * speed[0];
    return at;
}

/* fill the mobilities M (2, 2) between both directions */
static void round_mobilities(const Flow *fl, int s, double *M)
{
    int rows[2] = {s, (int)stop_of(fl, s)->second};
    for (int i = 0; i < 4; i++) M[i] = between(fl, rows[i / 2], rows[i % 2]);
}

/* a M b of vectors (2,) */
static double across_matrix(const double *a, const double *M, const double *b)
{
    return a[0] * (M[0] * b[0] + M[1] * b[1]) + a[1] * (M[2] * b[0] + M[3] * b[1]);
}

/* friction T and its derivatives: by the normal force, by a turn of n, by the radius, by the rates
 * along n and t, by the acceleration along t without the own forces */
typedef struct {
    double force, share, by_turn, by_radius, by_out, by_across, by_push;
} Friction;

/* that of sliding, or what holds the surface; 0 without accelerations `push`, (2,) */
static Friction round_friction(const Flow *fl, int s, const Polar *at, const double *speed,
                               const double *push, double normal)
{
    int second = (int)stop_of(fl, s)->second;
    const double *n = at->n, t[2] = {-n[1], n[0]};
    Friction found = {0.0};
    if (!sticks_around(fl, second)) {
        found.share = fl->slides[second] * stop_of(fl, s)->rub;
        found.force = found.share * normal;
        return found;
    }
    if (!push) return found;
    double M[4];
    round_mobilities(fl, s, M);
    double both = across_matrix(n, M, n), along = across_matrix(n, M, t);
    double across = across_matrix(t, M, t);
    double sense = stop_of(fl, s)->sense, out = n[0] * speed[0] + n[1] * speed[1], r = at->radius;
    found.share = -sense * along / across;
    found.by_push = 1.0 / across;
    found.by_across = -out / (r * across);
    found.by_out = -at->across / (r * across);
    found.by_radius = at->across * out / (r * r * across);
    found.force = (t[0] * push[0] + t[1] * push[1] - at->across * out / r) / across +
                  found.share * normal;
    found.by_turn = (squared(out) - squared(at->across)) / (r * across) -
                    (n[0] * push[0] + n[1] * push[1] + normal * sense * (across - both)) / across +
                    2.0 * found.force * along / across;
    return found;
}

/* direction of what the force changes by with the normal force */
static void rubbing(double sense, double share, const Polar *at, double *along)
{
    along[0] = sense * at->n[0] - share * at->n[1];
    along[1] = sense * at->n[1] + share * at->n[0];
}

/* The same as `round_law` of a rigid one on which the surface slides, or without friction: with T = ρN,
 * the direction d = ± n + ρ t of the force and the accelerations a without it
 *
 *     N = (n . a + (t . X')² / r) / n . M d. */
static void rigid_sliding_law(const Flow *fl, int s, const Polar *at, const double *speed,
                              const double *push, double *force, double by[3][4])
{
    const double *n = at->n, t[2] = {-n[1], n[0]};
    double sense = stop_of(fl, s)->sense, M[4], along[2], turned[2];
    double share = fl->slides[(int)stop_of(fl, s)->second] * stop_of(fl, s)->rub;
    double r = at->radius, w = at->across, u = n[0] * speed[0] + n[1] * speed[1];
    round_mobilities(fl, s, M);
    rubbing(sense, share, at, along);
    for (int i = 0; i < 2; i++) turned[i] = sense * t[i] - share * n[i];
    double lost = across_matrix(n, M, along);
    double normal = (n[0] * push[0] + n[1] * push[1] + w * w / r) / lost;
    double lost_by = across_matrix(t, M, along) + across_matrix(n, M, turned);
    double by_turn = t[0] * push[0] + t[1] * push[1] - 2.0 * w * u / r - normal * lost_by;
    for (int i = 0; i < 2; i++) {
        force[i] = normal * along[i];
        for (int j = 0; j < 2; j++) {
            double turn = t[j] / r;
            double change = (by_turn * turn - squared(w / r) * n[j]) / lost;
            by[0][2 * i + j] = change * along[i] + normal * turned[i] * turn;
            by[1][2 * i + j] = 2.0 * w / r * t[j] / lost * along[i];
            by[2][2 * i + j] = n[j] / lost * along[i];
        }
    }
}

/* the same where the surface sticks: M F = a - X'' with all of X'' known */
static void rigid_sticking_law(const Flow *fl, int s, const Polar *at, const double *speed,
                               const double *push, double *force, double by[3][4])
{
    const double *n = at->n, t[2] = {-n[1], n[0]};
    double M[4], r = at->radius, w = at->across, u = n[0] * speed[0] + n[1] * speed[1];
    round_mobilities(fl, s, M);
    double size = M[0] * M[3] - M[1] * M[2];
    double inverse[4] = {M[3] / size, -M[1] / size, -M[2] / size, M[0] / size};
    double inward = w * w / r, aside = -w * u / r, change[3][4];
    for (int j = 0; j < 2; j++) {
        double turn = t[j] / r; /* by which n, w and u change with a displacement */
        double out_by[2] = {-2.0 * w * u / r * turn - squared(w / r) * n[j] - aside * turn,
                            2.0 * w / r * t[j]};
        double aside_by[2] = {inward * turn + (u * u - w * w) / r * turn + w * u / (r * r) * n[j],
                              -(u * t[j] + w * n[j]) / r};
        for (int i = 0; i < 2; i++) {
            for (int order = 0; order < 2; order++)
                change[order][2 * i + j] = out_by[order] * n[i] + aside_by[order] * t[i];
            change[2][2 * i + j] = i == j;
        }
    }
    for (int i = 0; i < 2; i++) {
        force[i] = 0.0;
        for (int k = 0; k < 2; k++)
            force[i] += inverse[2 * i + k] * (push[k] + inward * n[k] + aside * t[k]);
        for (int j = 0; j < 2; j++)
            for (int order = 0; order < 3; order++)
                by[order][2 * i + j] = inverse[2 * i] * change[order][j] +
                                       inverse[2 * i + 1] * change[order][2 + j];
    }
}

/* Forces (2,) of a closed one along both directions; fills their derivatives by the displacements,
 * the rates and the accelerations `push` without the own forces, each (2, 2) with a row for each
 * force: with the normal force's slope K and viscosity C, and the friction's share T_N
 *
 *     dF = (± n + T_N t) (K dδ + C dδ') + (dT - T_N dN) t + (± N t - T n) (t . dX) / r. */
static void round_law(const Flow *fl, int s, const double *place, const double *speed,
                      const double *push, double *force, double by[3][4])
{
    Polar at = polar(fl, s, place, speed);
    if (is_rigid(fl, s)) {
        bool sticks = sticks_around(fl, (int)stop_of(fl, s)->second);
        (sticks ? rigid_sticking_law : rigid_sliding_law)(fl, s, &at, speed, push, force, by);
        return;
    }
    double sense = stop_of(fl, s)->sense, along[2], *n = at.n, t[2] = {-n[1], n[0]};
    Force normal = closed_law(fl, s, at.depth, at.rate);
    double turn = at.radius > 0.0 ? 1.0 / at.radius : 0.0;
    Friction held = round_friction(fl, s, &at, speed, push, normal.force);
    rubbing(sense, held.share, &at, along);
    for (int i = 0; i < 2; i++) {
        double turned_force = sense * normal.force * t[i] - held.force * n[i];
        force[i] = sense * normal.force * n[i] + held.force * t[i];
        for (int j = 0; j < 2; j++) {
            double rate_by = sense * at.across * turn * t[j];
            by[0][2 * i + j] =
                along[i] * (normal.stiffness * sense * n[j] + normal.viscosity * rate_by) +
                turn * turned_force * t[j] +
                t[i] * (held.by_turn * turn * t[j] + held.by_radius * n[j]);
            by[1][2 * i + j] = along[i] * normal.viscosity * sense * n[j] +
                               t[i] * (held.by_out * n[j] + held.by_across * t[j]);
            by[2][2 * i + j] = t[i] * held.by_push * t[j];
        }
    }
}

/* displacements and rates of a round clearance from its centre at present, their accelerations in
 * flight, each (2,) */
static void round_now(const Flow *fl, int s, const double *w, double phase, double *place,
                      double *speed, double *pace)
{
    for (int d = 0; d < 2; d++) {
        int row = d == 0 ? s : (int)stop_of(fl, s)->second;
        Course at = output_now(fl, row, w, phase);
        place[d] = at.value - stop_of(fl, row)->centre;
        speed[d] = at.first;
        pace[d] = at.second;
    }
}

/* penetration of a stop at present, its rate and acceleration in flight */
static Course depth_now(const Flow *fl, int s, const double *w, double phase)
{
    if (!is_round(fl, s)) {
        Course at = output_now(fl, s, w, phase);
        at.value -= stop_of(fl, s)->gap;
        return at;
    }
    double place[2], speed[2], pace[2];
    round_now(fl, s, w, phase, place, speed, pace);
    Polar at = polar(fl, s, place, speed);
    double turning = at.radius > 0.0 ? squared(at.across) / at.radius : 0.0;
    double push = at.n[0] * pace[0] + at.n[1] * pace[1] + turning;
    return (Course){at.depth, at.rate, stop_of(fl, s)->sense * push, 0.0};
}

/* force of a closed row; sliders that stops press on, and what keeps an acceleration, are left out.
 * At its switch a dashpot acts, on whichever side rounding puts the penetration. */
static double force_now(const Flow *fl, int s, const double *w, double phase)
{
    if (!is_planar(fl, s)) {
        Course depth = depth_now(fl, s, w, phase);
        return is_elastic(fl, s) ? closed_law(fl, s, depth.value, depth.first).force
                                 : law(fl, s, depth.value, depth.first).force;
    }
    int lead = is_round(fl, s) ? s : (int)stop_of(fl, s)->lead;
    if (is_rigid(fl, lead)) return 0.0;
    double place[2], speed[2], pace[2], force[2], by[3][4];
    round_now(fl, lead, w, phase, place, speed, pace);
    if (!(polar(fl, lead, place, speed).depth > 0.0)) return 0.0;
    round_law(fl, lead, place, speed, NULL, force, by);
    return force[lead == s ? 0 : 1];
}

/* ± (r² - c²)/2c, which is the penetration where that is small, and smooth at the centre, too: of
 * displacements and rates from the centre with their accelerations */
static Course around(const Flow *fl, int s, const double *place, const double *speed,
                     const double *pace)
{
    const Stop *stop = stop_of(fl, s);
    double r = hypot(place[0], place[1]), share = stop->sense / stop->gap;
    return (Course){
        0.5 * share * (r - stop->gap) * (r + stop->gap),
        share * (place[0] * speed[0] + place[1] * speed[1]),
        share * (squared(speed[0]) + squared(speed[1]) + place[0] * pace[0] + place[1] * pace[1]),
        0.0};
}

/* what is zero where a stop switches, positive beyond, with two rates: the penetration, or what is
 * it at a round clearance where that is small */
static Course gap_now(const Flow *fl, int s, const double *w, double phase)
{
    if (!is_round(fl, s)) return depth_now(fl, s, w, phase);
    double place[2], speed[2], pace[2];
    round_now(fl, s, w, phase, place, speed, pace);
    return around(fl, s, place, speed, pace);
}

/* rounding error of it, of an output other than a stop of the output itself */
static double gap_noise(const Flow *fl, int out, const double *w)
{
    double noise = output_noise(fl, out, w);
    if (out >= fl->n_stops || !is_round(fl, out)) return noise;
    const Stop *stop = stop_of(fl, out);
    noise += output_noise(fl, (int)stop->second, w);
    return noise + SUM_ROUNDING * (stop->gap + fabs(stop->centre) +
                                   fabs(stop_of(fl, (int)stop->second)->centre));
}

/* speed (value) at which the surface slides in a round clearance, whose second direction is `s`, and
 * its rate in flight (first) */
static Course round_slip(const Flow *fl, int s, const double *w, double phase)
{
    double place[2], speed[2], pace[2];
    int lead = (int)stop_of(fl, s)->lead;
    round_now(fl, lead, w, phase, place, speed, pace);
    Polar at = polar(fl, lead, place, speed);
    double out = at.n[0] * speed[0] + at.n[1] * speed[1];
    double push = at.n[0] * pace[1] - at.n[1] * pace[0];
    return (Course){at.across + stop_of(fl, s)->surface, push - at.across * out / at.radius, 0.0, 0.0};
}

/* rounding error of the rate of `gap_now` */
static double gap_rate_noise(const Flow *fl, int s, const double *w, double phase)
{
    if (!is_round(fl, s)) return rate_noise(fl, s, w);
    double place[2], speed[2], pace[2], noise = 0.0;
    int rows[2] = {s, (int)stop_of(fl, s)->second};
    round_now(fl, s, w, phase, place, speed, pace);
    double turning = hypot(speed[0], speed[1]) / hypot(place[0], place[1]);
    for (int d = 0; d < 2; d++)
        noise += rate_noise(fl, rows[d], w) + turning * output_noise(fl, rows[d], w);
    return noise;
}

/* the same of the speed at which the surface slides */
static double round_slip_noise(const Flow *fl, int s, const double *w, double phase)
{
    return SUM_ROUNDING * fabs(stop_of(fl, s)->surface) +
           gap_rate_noise(fl, (int)stop_of(fl, s)->lead, w, phase);
}

/* velocity jump of the penetration per unit impulse, in 1/kg */
static double mobility_now(const Flow *fl, int s, const double *w, double phase)
{
    const Stop *stop = stop_of(fl, s);
    if (!is_round(fl, s)) return stop->mobility;
    double place[2], speed[2], pace[2], M[4];
    round_now(fl, s, w, phase, place, speed, pace);
    round_mobilities(fl, s, M);
    Polar at = polar(fl, s, place, speed);
    return across_matrix(at.n, M, at.n);
}

/* place of a stop among the closed ones */
static int place_of(const Panel *panel, int stop)
{
    int place = 0;
    while (panel->active[place] != stop) place++;
    return place;
}

/* whether a row acts in a panel */
static bool acts_in(const Panel *panel, int stop)
{
    for (int a = 0; a < panel->na; a++)
        if (panel->active[a] == stop) return true;
    return false;
}

/* row of the other direction of a round clearance, or -1 */
static int partner_row(const Flow *fl, int s)
{
    return (int)(is_round(fl, s) ? stop_of(fl, s)->second : stop_of(fl, s)->lead);
}

/* its place among the closed ones, or -1 */
static int partner_of(const Flow *fl, const Panel *panel, int a)
{
    int row = partner_row(fl, panel->active[a]);
    return row < 0 ? -1 : place_of(panel, row);
}

/* how the forces of place a change by the output o of the other direction, (m,), among `slope` */
static const double *crossed(const Panel *panel, const double *slope, int o, int a)
{
    int rate = o / panel->na;
    return slope + (size_t)(panel->outputs + rate * panel->na + a) * panel->m;
}
