/* Round clearances: a body within a ring, or around a pin, whose penetration is radial.
 *
 * One is two rows of stops, a direction each: the first has the law and closes and opens, the
 * second follows it, as sliders follow what presses them on. Their outputs are the displacements
 * X along both; with r = |X|, n = X/r and t, n turned from the first direction to the second, a ring
 * of clearance c has the penetration δ = r - c, a pin δ = c - r, and the forces
 *
 *     F = N(δ, δ') (± n + ρ t),
 *
 * that friction by ρ = ±μ in the sense in which the surface of what turns slides. */
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

/* direction of the force per unit of the normal force */
static void rubbing(const Flow *fl, int s, const Polar *at, double *along)
{
    const Stop *stop = stop_of(fl, s);
    along[0] = stop->sense * at->n[0] - stop->rub * at->n[1];
    along[1] = stop->sense * at->n[1] + stop->rub * at->n[0];
}

/* Forces (2,) of a closed one along both directions; fills their derivatives by the displacements
 * and by the rates, each (2, 2) with a row for each force: with the normal force's slope K and
 * viscosity C
 *
 *     dF = (± n + ρ t) (K dδ + C dδ') + N/r (± t - ρ n) (t . dX). */
static void round_law(const Flow *fl, int s, const double *place, const double *speed,
                      double *force, double *slope, double *viscosity)
{
    Polar at = polar(fl, s, place, speed);
    double sense = stop_of(fl, s)->sense, along[2], t[2] = {-at.n[1], at.n[0]};
    Force normal = closed_law(fl, s, at.depth, at.rate);
    double turn = at.radius > 0.0 ? 1.0 / at.radius : 0.0;
    rubbing(fl, s, &at, along);
    for (int i = 0; i < 2; i++) {
        double turned_along = i == 0 ? -along[1] : along[0];
        force[i] = along[i] * normal.force;
        for (int j = 0; j < 2; j++) {
            double rate_by = sense * at.across * turn * t[j];
            slope[2 * i + j] =
                along[i] * (normal.stiffness * sense * at.n[j] + normal.viscosity * rate_by) +
                normal.force * turn * turned_along * t[j];
            viscosity[2 * i + j] = along[i] * normal.viscosity * sense * at.n[j];
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

/* force of a row, sliders that stops press on left out */
static double force_now(const Flow *fl, int s, const double *w, double phase)
{
    if (!is_planar(fl, s)) {
        Course depth = depth_now(fl, s, w, phase);
        return law(fl, s, depth.value, depth.first).force;
    }
    int lead = is_round(fl, s) ? s : (int)stop_of(fl, s)->lead;
    double place[2], speed[2], pace[2], force[2], by[4], by_speed[4];
    round_now(fl, lead, w, phase, place, speed, pace);
    if (!(polar(fl, lead, place, speed).depth > 0.0)) return 0.0;
    round_law(fl, lead, place, speed, force, by, by_speed);
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

/* velocity jump of the penetration per unit impulse, in 1/kg */
static double mobility_now(const Flow *fl, int s, const double *w, double phase)
{
    const Stop *stop = stop_of(fl, s);
    if (!is_round(fl, s)) return stop->mobility;
    double place[2], speed[2], pace[2], n[2], both = 0.0;
    round_now(fl, s, w, phase, place, speed, pace);
    int rows[2] = {s, (int)stop->second};
    for (int d = 0; d < 2; d++) n[d] = polar(fl, s, place, speed).n[d];
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) both += n[i] * n[j] * between(fl, rows[i], rows[j]);
    return both;
}

/* place of a stop among the closed ones */
static int place_of(const Panel *panel, int stop)
{
    int place = 0;
    while (panel->active[place] != stop) place++;
    return place;
}

/* that of the other direction of a round clearance, or -1 */
static int partner_of(const Flow *fl, const Panel *panel, int a)
{
    const Stop *stop = stop_of(fl, panel->active[a]);
    if (stop->second >= 0.0) return place_of(panel, (int)stop->second);
    return stop->lead >= 0.0 ? place_of(panel, (int)stop->lead) : -1;
}

/* how the forces of place a change by the output o of the other direction, (m,), among `slope` */
static const double *crossed(const Panel *panel, const double *slope, int o, int a)
{
    int rate = o / panel->na;
    return slope + (size_t)(panel->outputs + rate * panel->na + a) * panel->m;
}
