/* Flights: the first contact, found with steps bounded by the third derivative of the gap, so that
 * none is passed over. */
#include "engine.h"

/* first positive root of h + h1 τ + h2 τ²/2, for h <= 0 */
static double parabola_root(double h, double h1, double h2)
{
    if (h >= 0.0) return h2 > 0.0 ? -2.0 * h1 / h2 : INFINITY;
    double square = h1 * h1 - 2.0 * h * h2;
    if (h1 < 0.0 && h2 > 0.0) /* it comes back: the root without cancellation */
        return (sqrt(square) - h1) / h2;
    double top = square >= 0.0 ? h1 + sqrt(square) : 0.0;
    return top > 0.0 ? -2.0 * h / top : INFINITY;
}

/* first positive root of h + h1 τ + h2 τ²/2 + bound τ³/6, for h <= 0: no function with these
 * derivatives and a third derivative below `bound` reaches zero sooner */
static double safe_step(double h, double h1, double h2, double bound)
{
    if (h >= 0.0 && (h1 > 0.0 || (h1 == 0.0 && h2 > 0.0))) return 0.0;
    if (bound <= 0.0) return parabola_root(h, h1, h2);
    if (h >= 0.0) /* leave the root at zero out: h1 + h2 τ/2 + bound τ²/6 = 0 */
        return (-0.5 * h2 + sqrt(0.25 * h2 * h2 - 2.0 / 3.0 * bound * h1)) * 3.0 / bound;
    double turning = h2 * h2 - 2.0 * bound * h1, tau = -1.0;
    if (h2 < 0.0 && h1 > 0.0 && turning >= 0.0) {
        double top = 2.0 * h1 / (-h2 + sqrt(turning));
        if (h + top * (h1 + top * (0.5 * h2 + top * bound / 6.0)) >= 0.0)
            tau = 0.0; /* the root lies on the concave rise before the top: Newton from the left */
    }
    if (tau < 0.0) /* beyond the inflection: Newton from an upper bound of all roots */
        tau = 2.0 * larger(3.0 * fabs(h2) / bound,
                           larger(sqrt(6.0 * fabs(h1) / bound), cbrt(6.0 * fabs(h) / bound)));
    for (int i = 0; i < 60; i++) {
        double p = h + tau * (h1 + tau * (0.5 * h2 + tau * bound / 6.0));
        double p1 = h1 + tau * (h2 + 0.5 * tau * bound);
        if (p1 <= 0.0) break;
        double step = p / p1;
        tau -= step;
        if (fabs(step) <= SUM_ROUNDING * tau) break;
    }
    return larger(tau, 0.0);
}

/* largest value of |y|, |y'|, |y''| within a time, by the present ones and a bound of the third */
static Course reach_within(Course at, double time)
{
    Course most = {0.0, 0.0, fabs(at.second) + at.bound * time, at.bound};
    most.first = fabs(at.first) + time * (fabs(at.second) + 0.5 * at.bound * time);
    most.value = fabs(at.value) + time * (fabs(at.first) + 0.5 * time * fabs(at.second) +
                                          time * time * at.bound / 6.0);
    return most;
}

/* |third derivative| of (x² + y²)/2c within a time */
static double round_bound(const Flow *fl, int s, const Course *at, double time)
{
    double total = 0.0;
    for (int d = 0; d < 2; d++) {
        Course most = reach_within(at[d], time);
        total += most.value * most.bound + 3.0 * most.first * most.second;
    }
    return total / stop_of(fl, s)->gap;
}

/* `gap_now` of an output (a stop's, or one that is watched in its place) in flight, after a time t,
 * with a bound of its third rate for the time `holds` from then on */
static Course gap_after(const Flow *fl, int stop, int out, const double *w, double phase, double t,
                        double *holds)
{
    *holds = 2.0 * PI / fl->omega;
    if (!is_round(fl, stop)) {
        Course at = output_after(fl, out, w, phase, t);
        at.value -= stop_of(fl, stop)->gap;
        return at;
    }
    Course at[2];
    double place[2], speed[2], pace[2], fastest = TINY;
    for (int d = 0; d < 2; d++) {
        int row = d == 0 ? stop : (int)stop_of(fl, stop)->second;
        at[d] = output_after(fl, row, w, phase, t);
        at[d].value -= stop_of(fl, row)->centre;
        place[d] = at[d].value;
        speed[d] = at[d].first;
        pace[d] = at[d].second;
        fastest = larger(fastest, at[d].bound);
    }
    Course found = around(fl, stop, place, speed, pace);
    *holds = smaller(*holds, cbrt(stop_of(fl, stop)->gap / fastest));
    double now = round_bound(fl, stop, at, 0.0);
    double first = safe_step(smaller(found.value, 0.0), found.first, found.second, now);
    if (first > 0.0) *holds = smaller(*holds, first);
    found.bound = round_bound(fl, stop, at, *holds);
    return found;
}

/* First time in [start, end] at which an output rises to the gap of a stop, or inf.
 *
 * Every step is bounded by the third derivative, so that it cannot cross a contact; the steps
 * converge to the contact at order three. Only contacts that are shorter than `shortest` or no
 * deeper than rounding can be stepped over, and only where the approach is so slow that the
 * acceleration stops it in that time. Negative if it takes too many steps or is interrupted. */
static double rising_time(const Flow *fl, int stop, int out, const double *w, double phase,
                          double start, double end, double shortest)
{
    double noise = gap_noise(fl, out, w), t = start, longest;
    for (int i = 0; i < MOST_STEPS; i++) {
        if (t > end) return INFINITY;
        if (isnan(t) || (i % 1024 == 1023 && interrupted(fl->watch))) return -1.0;
        Course at = gap_after(fl, stop, out, w, phase, t, &longest);
        double h = at.value;
        if (h >= 0.0 && at.first > 0.0) return t;
        double tau = safe_step(smaller(h, 0.0), at.first, at.second, at.bound);
        if (tau < shortest) {
            if (at.first > 0.0 && h + at.first * shortest >= 0.0)
                return smaller(t + larger(tau, 0.0), end);
            tau = larger(shortest,
                         safe_step(smaller(h, 0.0) - noise, at.first, at.second, at.bound));
        }
        t += smaller(tau, larger(longest, shortest));
    }
    return -1.0;
}

/* First time in [start, end] at which a stop closes, or inf; no contact is passed over. One that
 * never pulls closes within, too, where its force turns positive. Negative as `rising_time`. */
static double closing_time(const Flow *fl, int stop, const double *w, double phase, double start,
                           double end, double shortest)
{
    int release = (int)stop_of(fl, stop)->release;
    if (release >= 0 && output_after(fl, stop, w, phase, start).value > stop_of(fl, stop)->gap) {
        double at = rising_time(fl, stop, release, w, phase, start, end, shortest);
        if (!(0.0 <= at && at <= end)) return at;
        if (output_after(fl, stop, w, phase, at).value > stop_of(fl, stop)->gap) return at;
        start = at;
    }
    return rising_time(fl, stop, stop, w, phase, start, end, shortest);
}

/* time in which the third derivative of a gap cannot make more than a change of it */
static double calm_time(const Flow *fl, int stop, const double *w, double phase, double change)
{
    double holds, bound = gap_after(fl, stop, stop, w, phase, 0.0, &holds).bound;
    return smaller(holds, bound > 0.0 ? cbrt(6.0 * change / bound) : INFINITY);
}
