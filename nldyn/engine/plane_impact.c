/* Impacts on a rigid stop with Coulomb's friction over the plane of two tangents.
 *
 * Along the normal impulse P the speed v of closing, that of sliding, u, and the impulse of friction,
 * Q, change by
 *
 *     dv = -(m_nn + m_nt . ρ) dP,    du = -(m_nt + B ρ) dP,    dQ = ρ dP,    ρ = μ u/|u|
 *
 * [Routh 1905; Keller 1986; Stronge 2000]: the direction of u turns, unless it is one that B and m_nt
 * leave alone. With dP = |u| ds all is analytic in s,
 *
 *     u' = -(|u| m_nt + μ B u),    P' = |u|,    Q' = μ u,
 *
 * and Taylor series follow it; what comes to rest does so as an exponential. There it sticks, with
 * ρ = -B^-1 m_nt, if that is no longer than μ; else it slides on along the one direction that leaves,
 * (μ B + σ) d = -m_nt with |d| = 1 and σ > 0, and keeps it. Poisson's hypothesis as in
 * rubbing_impact.c. */
#include "engine.h"

#define TERMS 20       /* of the series */
#define SHARE 0.135335 /* e^-2, of their radius of convergence: a step [Jorba and Zou 2005] */
#define GONE 1e-18     /* of the first speed of sliding: it has come to rest */
#define MOST_BLOW_STEPS 100000

/* speeds that a unit impulse along the normal takes from closing and along both tangents, what those
 * along the tangents take there: xx, xy, yy; coefficient of friction */
typedef struct {
    double normal, both[2], tangent[3], friction;
} Plane;

/* an impact on its way: speeds along both tangents; impulses up to here; speed of closing */
typedef struct {
    Slopes u[2], normal, rub[2], closing;
} Hodograph;

/* its Taylor series in s, coefficients by their order */
typedef struct {
    Slopes u[2][TERMS + 1], size[TERMS + 1];
} Series;

static Slopes constant(double value) { return (Slopes){value, {0.0}}; }

/* s a */
static Slopes share_of(double s, Slopes a) { return plus(constant(0.0), s, a); }

static Slopes rooted(Slopes a)
{
    a.value = sqrt(a.value);
    for (int c = 0; c < N_BLOW_BY; c++) a.by[c] /= 2.0 * a.value;
    return a;
}

/* x of B x = b */
static void solve_plane(const double *B, const Slopes *b, Slopes *x)
{
    double det = B[0] * B[2] - B[1] * B[1];
    for (int i = 0; i < 2; i++)
        x[i] = plus(share_of(B[2 - 2 * i] / det, b[i]), -B[1] / det, b[1 - i]);
}

/* fill the series of u and |u| from a place on */
static void fill_series(Plane at, Slopes friction, const Slopes *u, Series *series)
{
    Slopes *size = series->size;
    for (int i = 0; i < 2; i++) series->u[i][0] = u[i];
    for (int k = 0; k <= TERMS; k++) {
        Slopes square = constant(0.0);
        for (int j = 0; j <= k; j++) {
            for (int i = 0; i < 2; i++)
                square = plus(square, 1.0, multiplied(series->u[i][j], series->u[i][k - j]));
            if (j > 0 && j < k) square = plus(square, -1.0, multiplied(size[j], size[k - j]));
        }
        size[k] = k == 0 ? rooted(square) : divided(share_of(0.5, square), size[0]);
        for (int i = 0; i < 2 && k < TERMS; i++) {
            Slopes pulled = share_of(at.tangent[2 * i], series->u[i][k]);
            pulled = multiplied(friction, plus(pulled, at.tangent[1], series->u[1 - i][k]));
            pulled = plus(pulled, at.both[i], size[k]);
            series->u[i][k + 1] = share_of(-1.0 / (k + 1), pulled);
        }
    }
}

/* step of s in which the series has all digits */
static double series_step(const Series *series)
{
    double step = INFINITY, first = series->size[0].value;
    for (int k = TERMS - 1; k <= TERMS; k++) {
        double last = larger(fabs(series->u[0][k].value), fabs(series->u[1][k].value));
        step = smaller(step, SHARE * pow(larger(last, TINY) / first, -1.0 / k));
    }
    return step;
}

/* the impact at s from where the series begins */
static Hodograph moved_on(Plane at, Slopes friction, const Hodograph *from, const Series *series,
                          Slopes s)
{
    Hodograph to = *from;
    Slopes gained = constant(0.0), way[2] = {constant(0.0), constant(0.0)};
    for (int i = 0; i < 2; i++) to.u[i] = constant(0.0);
    for (int k = TERMS; k >= 0; k--) {
        gained = plus(share_of(1.0 / (k + 1), series->size[k]), 1.0, multiplied(gained, s));
        for (int i = 0; i < 2; i++) {
            Slopes u = series->u[i][k];
            to.u[i] = plus(u, 1.0, multiplied(to.u[i], s));
            way[i] = plus(share_of(1.0 / (k + 1), u), 1.0, multiplied(way[i], s));
        }
    }
    gained = multiplied(gained, s);
    to.normal = plus(from->normal, 1.0, gained);
    to.closing = plus(from->closing, -at.normal, gained);
    for (int i = 0; i < 2; i++) {
        Slopes rubbed = multiplied(friction, multiplied(way[i], s));
        to.rub[i] = plus(from->rub[i], 1.0, rubbed);
        to.closing = plus(to.closing, -at.both[i], rubbed);
    }
    return to;
}

/* rate by s of what is to reach zero, see `left_to` */
static double rate_to(Plane at, const Hodograph *here, bool compression)
{
    double size = hypot(here->u[0].value, here->u[1].value), rub = 0.0;
    for (int i = 0; i < 2; i++) rub += at.both[i] * at.friction * here->u[i].value;
    return -(compression ? at.normal * size + rub : size);
}

/* what is to reach zero: the speed of closing in compression, else the impulse that is left */
static Slopes left_to(const Hodograph *here, bool compression, Slopes last)
{
    return compression ? here->closing : plus(last, -1.0, here->normal);
}

/* s within a step at which that is zero, or -1 */
static double zero_within(Plane at, Slopes friction, const Hodograph *from, const Series *series,
                          double step, bool compression, Slopes last)
{
    double low = 0.0, high = step;
    Hodograph end = moved_on(at, friction, from, series, constant(high));
    if (left_to(&end, compression, last).value > 0.0) {
        if (!(rate_to(at, from, compression) < 0.0 && rate_to(at, &end, compression) > 0.0)) return -1.0;
        for (int round = 0; round < 60; round++) { /* the least in between */
            double middle = 0.5 * (low + high);
            Hodograph there = moved_on(at, friction, from, series, constant(middle));
            if (rate_to(at, &there, compression) < 0.0)
                low = middle;
            else
                high = middle;
        }
        end = moved_on(at, friction, from, series, constant(high));
        if (left_to(&end, compression, last).value > 0.0) return -1.0;
        low = 0.0;
    }
    double s = high;
    for (int round = 0; round < 100; round++) { /* Newton's method within bounds */
        Hodograph there = moved_on(at, friction, from, series, constant(s));
        double left = left_to(&there, compression, last).value;
        if (left > 0.0)
            low = s;
        else
            high = s;
        double next = s - left / rate_to(at, &there, compression);
        if (!(next >= low && next <= high)) next = 0.5 * (low + high);
        if (fabs(next - s) <= HALF_ULP * s || next == s) break;
        s = next;
    }
    return s;
}

/* share ρ = dQ/dP (2,) from where nothing slides on, along the one direction that leaves, if it does;
 * whether it sticks */
static bool fill_share_behind(Plane at, Slopes friction, Slopes *share)
{
    Slopes free[2] = {constant(-at.both[0]), constant(-at.both[1])};
    solve_plane(at.tangent, free, share);
    if (hypot(share[0].value, share[1].value) <= at.friction) return true;
    double d[2], pulled[2], more, less = 0.0, own = 0.0;
    double accel[2] = {free[0].value, free[1].value};
    more = fill_leaving(at.tangent, accel, at.friction, d);
    double A[3] = {at.friction * at.tangent[0] + more, at.friction * at.tangent[1],
                   at.friction * at.tangent[2] + more};
    for (int i = 0; i < 2; i++)
        pulled[i] = at.tangent[2 * i] * d[i] + at.tangent[1] * d[1 - i];
    Slopes rhs[2] = {constant(pulled[0]), constant(pulled[1])}, by_pull[2], by_more[2];
    Slopes along[2] = {constant(d[0]), constant(d[1])};
    solve_plane(A, rhs, by_pull);
    solve_plane(A, along, by_more);
    for (int i = 0; i < 2; i++) {
        less += d[i] * by_pull[i].value;
        own += d[i] * by_more[i].value;
    }
    for (int i = 0; i < 2; i++) {
        Slopes turned_by = constant(d[i]);
        turned_by.by[BY_FRICTION] = less / own * by_more[i].value - by_pull[i].value;
        share[i] = multiplied(friction, turned_by);
    }
    return false;
}

/* take what is at rest over the plane to the end of the impact */
static void rest_on(Plane at, Slopes friction, const Slopes *first, Slopes speed, Slopes grows,
                    bool slid, bool compression, Slopes last, Hodograph *here)
{
    Slopes share[2], lost = constant(at.normal);
    bool sticks = fill_share_behind(at, friction, share);
    if (slid || sticks) { /* all of u is taken: B Q = u - m_nt P */
        Slopes taken[2];
        for (int i = 0; i < 2; i++) taken[i] = plus(first[i], -at.both[i], here->normal);
        solve_plane(at.tangent, taken, here->rub);
        here->closing = plus(speed, -at.normal, here->normal);
        for (int i = 0; i < 2; i++) here->closing = plus(here->closing, -at.both[i], here->rub[i]);
    }
    for (int i = 0; i < 2; i++) lost = plus(lost, at.both[i], share[i]);
    if (compression)
        last = multiplied(grows, plus(here->normal, 1.0, divided(here->closing, lost)));
    Slopes more = plus(last, -1.0, here->normal);
    for (int i = 0; i < 2; i++)
        here->rub[i] = plus(here->rub[i], 1.0, multiplied(share[i], more));
    here->normal = last;
}

/* the impulses of an impact at a speed of closing and those of sliding (2,); nan where no end of it is
 * found */
static Blow blow_over(Plane at, Value restitution, double speed, const double *slip)
{
    Slopes friction = number_by(at.friction, BY_FRICTION, 1.0);
    Slopes closing = number_by(speed, BY_SPEED, 1.0), last = constant(INFINITY);
    Slopes grows = number_by(1.0 + restitution.value, BY_RESTITUTION, 1.0);
    grows.by[BY_SPEED] = restitution.slope;
    Slopes first[2] = {number_by(slip[0], BY_SLIP, 1.0), number_by(slip[1], BY_SLIP_ASIDE, 1.0)};
    Hodograph here = {{first[0], first[1]}, constant(0.0), {constant(0.0), constant(0.0)}, closing};
    double begun = hypot(slip[0], slip[1]);
    bool compression = true;
    Series series;
    for (int turn = 0; turn < MOST_BLOW_STEPS; turn++) {
        if (hypot(here.u[0].value, here.u[1].value) <= GONE * begun) {
            rest_on(at, friction, first, closing, grows, begun > 0.0, compression, last, &here);
            return (Blow){here.normal, here.rub[0], here.rub[1]};
        }
        fill_series(at, friction, here.u, &series);
        double step = series_step(&series);
        double zero = zero_within(at, friction, &here, &series, step, compression, last);
        Slopes s = constant(zero < 0.0 ? step : zero);
        Hodograph next = moved_on(at, friction, &here, &series, s);
        if (zero >= 0.0) { /* where it is zero moves along */
            Slopes left = left_to(&next, compression, last);
            double rate = rate_to(at, &next, compression);
            for (int c = 0; c < N_BLOW_BY; c++) s.by[c] = -left.by[c] / rate;
            next = moved_on(at, friction, &here, &series, s);
            if (!compression) return (Blow){next.normal, next.rub[0], next.rub[1]};
            compression = false;
            last = multiplied(grows, next.normal);
        }
        here = next;
    }
    return (Blow){constant(NAN), constant(NAN), constant(NAN)};
}
