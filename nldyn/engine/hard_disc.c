/* Coulomb's friction over a plane without a spring: where what slides comes to rest, and leaves.
 *
 * With R = μN, the mobility B of both tangents and the force h that would hold it, the speed v goes
 * as v' = B (h - R v/|v|). It comes to rest where |h| < R, and does so within a time; its direction
 * is that of a power of the time left then, which panels show that take most of that time, but not
 * all. So the state comes to rest in steps, until nothing of the speed is left but rounding.
 *
 * It stays while |h| < R. From rest on it leaves along the u with (R B + σ) u = B h and |u| = 1: along
 * h itself, if all directions are alike. */
#include "engine.h"

#define NEARER 0.8 /* share of the time until what slides rests that a panel may take */
#define ROUNDED_AWAY 1e3 /* roundings of a speed that has no direction any more */
#define AT_REST 1e-3 /* time until then that counts as none, in the shortest of a motion */

/* speeds along both tangents of what it slides on; the size */
static double speeds_over(const Flow *fl, int s, const double *w, double phase, double *speed)
{
    int rows[2] = {s, (int)stop_of(fl, s)->beside};
    for (int d = 0; d < 2; d++)
        speed[d] = output_now(fl, rows[d], w, phase).first - stop_of(fl, rows[d])->belt;
    return hypot(speed[0], speed[1]);
}

/* rounding error of it */
static double speeds_noise(const Flow *fl, int s, const double *w)
{
    int rows[2] = {s, (int)stop_of(fl, s)->beside};
    double noise = 0.0;
    for (int d = 0; d < 2; d++)
        noise += rate_noise(fl, rows[d], w) + SUM_ROUNDING * fabs(stop_of(fl, rows[d])->belt);
    return noise;
}

/* force that presses it on; s->stop_forces are filled */
static double pressed_on(const Motion *M, int s)
{
    return is_pressed(M->fl, s) ? M->s->stop_forces[(int)stop_of(M->fl, s)->normal]
                                : stop_of(M->fl, s)->pressing;
}

/* whether something is left of it now but rounding */
static bool moves_over(const Motion *M, int s)
{
    double speed[2], phase = M->phase + M->fl->omega * M->t;
    double size = speeds_over(M->fl, s, M->w, phase, speed);
    return size > ROUNDED_AWAY * speeds_noise(M->fl, s, M->w);
}

/* fill the direction (2,) in which it slides, or leaves if it has just been let go */
static void fill_heading(const Motion *M, int s, double phase, double *u)
{
    int rows[2] = {s, (int)stop_of(M->fl, s)->beside};
    double size = speeds_over(M->fl, s, M->w, phase, u);
    for (int d = 0; d < 2; d++)
        u[d] = is_let_go(M->fl, s) || size == 0.0 ? M->s->heading[rows[d]] : u[d] / size;
}

/* time until it rests, if it goes on as now, or inf; s->pushes are filled */
static double time_to_rest(const Motion *M, int s, double phase)
{
    double u[2], speed[2], size = speeds_over(M->fl, s, M->w, phase, speed);
    fill_heading(M, s, phase, u);
    double pace = u[0] * M->s->pushes[s] + u[1] * M->s->pushes[(int)stop_of(M->fl, s)->beside];
    return pace < 0.0 ? -size / pace : INFINITY;
}
