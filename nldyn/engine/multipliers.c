/* Test functions of multipliers, and where between two orbits they may cross the unit circle. */
#include "engine.h"

#define NEAR_CIRCLE 0.4 /* distance from the unit circle, within which one may cross it soon */
#define LEAST_MODULUS 1e-3 /* that has a logarithm here: far inside */

/* ∏(μ + shift) / (1 + |μ|): with 1 it changes sign where a multiplier crosses -1, with -1 at +1 */
EXPORT double nldyn_shifted_product(int64_t n, const Complex *multipliers, double shift)
{
    Complex total = {1.0, 0.0};
    for (int i = 0; i < n; i++) {
        Complex factor = {multipliers[i].re + shift, multipliers[i].im};
        total = product(total, scaled(1.0 / (1.0 + modulus(multipliers[i])), factor));
    }
    return total.re;
}

/* ∏(μᵢμⱼ - 1) over pairs i < j, scaled: zero where a pair is on the unit circle. The product is the
 * determinant of the bialternate product of Φ with itself minus the identity [Kuznetsov 2004,
 * section 10.2.2]. */
EXPORT double nldyn_torus_test(int64_t n, const Complex *multipliers)
{
    Complex total = {1.0, 0.0};
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) {
            Complex both = product(multipliers[i], multipliers[j]);
            Complex factor = {both.re - 1.0, both.im};
            total = product(total, scaled(1.0 / (1.0 + modulus(both)), factor));
        }
    return total.re;
}

/* index of the first of the two whose product is nearest to 1; `off`: how far that is from 1 */
static int64_t nearest_pair(int64_t n, const Complex *multipliers, double *off)
{
    int64_t index = 0;
    *off = INFINITY;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = i + 1; j < n; j++) {
            Complex both = product(multipliers[i], multipliers[j]);
            double away = hypot(both.re - 1.0, both.im);
            if (away < *off) {
                index = i;
                *off = away;
            }
        }
    return index;
}

/* ln|μ|, negative within the unit circle, not below that of `LEAST_MODULUS` */
static double height_of(Complex mu) { return log(larger(modulus(mu), LEAST_MODULUS)); }

static double apart(Complex a, Complex b) { return modulus(minus(a, b)); }

/* index of the multiplier nearest to another one */
static int closest(int n, const Complex *multipliers, Complex mu)
{
    int best = 0;
    double least = INFINITY;
    for (int k = 0; k < n; k++)
        if (apart(multipliers[k], mu) < least) {
            best = k;
            least = apart(multipliers[k], mu);
        }
    return best;
}

/* longest way of a multiplier near the unit circle to the nearest one of the next orbit */
static double travel(int64_t n, const Complex *before, const Complex *after)
{
    double longest = 0.0;
    for (int i = 0; i < n; i++)
        if (fabs(height_of(before[i])) < NEAR_CIRCLE) {
            double shortest = INFINITY;
            for (int j = 0; j < n; j++) shortest = smaller(shortest, apart(after[j], before[i]));
            longest = larger(longest, shortest);
        }
    return longest;
}

/* the same either way */
EXPORT double nldyn_farthest_travel(int64_t n, const Complex *before, const Complex *after)
{
    return larger(travel(n, before, after), travel(n, after, before));
}

/* fewest multipliers outside the unit circle if each modulus may be off so far; -tolerance: most */
EXPORT int64_t nldyn_number_outside(int64_t n, const Complex *multipliers, double tolerance)
{
    int64_t found = 0;
    for (int i = 0; i < n; i++) found += modulus(multipliers[i]) > 1.0 + tolerance;
    return found;
}

/* fill all test functions of multipliers, (7,): those of a flip, of a branch point and of a torus;
 * the index of `nearest_pair` and how far off it is; fewest and most outside the circle */
static void test_functions(int64_t n, const Complex *multipliers, double tolerance, double *found)
{
    found[0] = nldyn_shifted_product(n, multipliers, 1.0);
    found[1] = nldyn_shifted_product(n, multipliers, -1.0);
    found[2] = nldyn_torus_test(n, multipliers);
    found[3] = (double)nearest_pair(n, multipliers, found + 4);
    found[5] = (double)nldyn_number_outside(n, multipliers, tolerance);
    found[6] = (double)nldyn_number_outside(n, multipliers, -tolerance);
}

/* Multipliers (n,) of the Jacobians (k, n, n), balanced, and the logarithms of their moduli (n,), see
 * `nldyn_product_eigenvalues`; told (8,): the squeeze and all test functions. Whether it converged,
 * or -1 without memory. */
EXPORT int64_t nldyn_spectrum(const Host *host, int64_t k, int64_t n, const double *jacobians,
                              double tolerance, Complex *multipliers, double *logarithms,
                              double *told)
{
    double *balanced = malloc(sizeof(double) * ((size_t)k * n * n + 1));
    int64_t converged = -1;
    if (balanced && nldyn_balanced(k, n, jacobians, balanced))
        converged = nldyn_product_eigenvalues(host, k, n, balanced, multipliers, logarithms, told);
    if (converged >= 0) test_functions(n, multipliers, tolerance, told + 1);
    free(balanced);
    return converged;
}

/* distance of the nearest multiplier from the unit circle */
static double off_circle(int64_t n, const Complex *multipliers)
{
    double least = INFINITY;
    for (int i = 0; i < n; i++) least = smaller(least, fabs(modulus(multipliers[i]) - 1.0));
    return least;
}

/* distance of a multiplier from the nearest of the others */
static double to_others(int n, const Complex *multipliers, int i)
{
    double least = INFINITY;
    for (int k = 0; k < n; k++)
        if (k != i) least = smaller(least, apart(multipliers[k], multipliers[i]));
    return least;
}

/* Whether multipliers near the unit circle may meet, or touch it, between two sets of them, of which
 * one moves by `way`: 0: they do not, or too far inside to come out. 1: smaller steps tell, as
 * where several cross it. 2: the error hides it. `coarse` says so, too, of multipliers that come
 * near the circle alone. */
EXPORT int64_t nldyn_meetings(int64_t count, const Complex *before, const Complex *after,
                              double way, double error_before, double error_after, int64_t coarse)
{
    int n = (int)count, verdict = 0, crossings = 0;
    double error = larger(error_before, error_after);
    for (int i = 0; i < n; i++) {
        double height = height_of(before[i]);
        if (before[i].im < 0.0 || fabs(height) > NEAR_CIRCLE) continue;
        int j = closest(n, after, before[i]);
        double step = apart(after[j], before[i]), later = height_of(after[j]);
        double off = height * later > 0.0 ? smaller(fabs(height), fabs(later)) : 0.0;
        if (2.0 * (way + error) < off) continue;
        crossings += height * later < 0.0;
        double gap = smaller(to_others(n, before, i), to_others(n, after, j));
        if (gap < 4.0 * (larger(way, step) + error)) {
            if (2.0 * error > off && off > 0.0) return 2;
            verdict = 1;
        } else if (coarse) {
            bool near = fabs(height) < 1.5 * error_before || fabs(later) < 1.5 * error_after;
            if (near || off < 0.5 * fabs(height - later)) verdict = 1;
        }
    }
    return crossings > 1 ? 1 : verdict;
}

/* the first place at which a number in -1 ... 1 may be passed for the second time, or -1 */
static int64_t doubtful_in(int64_t m, const double *ratios)
{
    bool rising = ratios[m - 1] > 0.0;
    double sign = rising ? 1.0 : -1.0;
    if (rising == (ratios[0] > 0.0)) {
        double best = 1.0;
        int64_t where = -1;
        for (int64_t k = 1; k < m - 1; k++)
            if (sign * ratios[k] < best) {
                best = sign * ratios[k];
                where = k;
            }
        return where;
    }
    double reached = -INFINITY;
    for (int64_t k = 0; k < m; k++) {
        double ratio = sign * ratios[k];
        if (ratio < smaller(reached, 1.0) && reached > -1.0) return k == m - 1 ? k - 1 : k;
        reached = larger(reached, ratio);
    }
    return -1;
}

/* Where a multiplier that is followed through some sets (m, n) at positions (m,) from 0 to 1 may
 * cross the circle more than once: the number of a set, or -1. The error of ln|μ| is taken as a
 * constant between -1 and 1 times `error` σ(1 - σ). ratios: (m,) scratch. */
EXPORT int64_t nldyn_doubtful(int64_t m, int64_t n, const double *sigmas, const Complex *sets,
                              double error, double *ratios)
{
    int64_t found = -1;
    double worst = 0.0;
    for (int backward = 0; backward < 2; backward++)
        for (int i = 0; i < n; i++) {
            int at = i;
            const Complex *last = NULL;
            for (int64_t k = 0; k < m; k++) {
                int64_t now = backward ? m - 1 - k : k;
                const Complex *set = sets + now * n;
                if (k > 0) at = closest((int)n, set, last[at]);
                double size = error * sigmas[now] * (1.0 - sigmas[now]);
                ratios[k] = height_of(set[at]) / larger(size, TINY);
                last = set;
            }
            int64_t k = doubtful_in(m, ratios);
            if (k < 0) continue;
            int64_t now = backward ? m - 1 - k : k;
            double weight = sigmas[now] * (1.0 - sigmas[now]);
            if (weight > worst) {
                found = now;
                worst = weight;
            }
        }
    return found;
}

/* whether the parabola through three heights of one sign turns between them, and is nearer to zero
 * there than half of each */
static bool turns_near_zero(const double *x, double before, double here, double after)
{
    double rise = (here - before) / (x[1] - x[0]);
    double bent = ((after - here) / (x[2] - x[1]) - rise) / (x[2] - x[0]);
    if (!(bent * here > 0.0)) return false;
    double slope = rise + bent * (x[1] - x[0]);
    double way = -0.5 * slope / bent, top = here + 0.5 * slope * way;
    if (!(x[0] - x[1] < way && way < x[2] - x[1])) return false;
    double least = smaller(fabs(here), smaller(fabs(before), fabs(after)));
    return (here > 0.0 ? top : -top) < 0.5 * least;
}

/* Beside which sets (m, n) of multipliers, at positions (m,), one comes near the circle and goes
 * again: where its distance is less than what a parabola may dip between three of them, or the
 * parabola itself comes there beside them, and not hidden by the error, (m,). */
EXPORT void nldyn_dips_towards_circle(int64_t m, int64_t count, const double *sigmas,
                                      const Complex *sets, const double *errors, bool *found)
{
    int n = (int)count;
    for (int64_t k = 0; k < m; k++) found[k] = false;
    for (int64_t k = 1; k < m - 1; k++) {
        const Complex *set = sets + k * n, *first = set - n, *last = set + n;
        for (int i = 0; i < n; i++) {
            double here = height_of(set[i]), size = fabs(here);
            if (!(errors[k] < size && size < NEAR_CIRCLE)) continue;
            double before = height_of(first[closest(n, first, set[i])]);
            double after = height_of(last[closest(n, last, set[i])]);
            if (!(before * here > 0.0 && here * after > 0.0)) continue;
            double least = smaller(fabs(before), fabs(after));
            bool dips = size <= least && size < 0.5 * (fabs(before) + fabs(after) - 2.0 * size);
            if (dips || turns_near_zero(sigmas + k - 1, before, here, after)) found[k] = true;
        }
    }
}

/* at which of the sets more or fewer are outside than on the way from first to last, or -1 */
EXPORT int64_t nldyn_return_of_outside(int64_t m, int64_t n, const double *sigmas,
                                       const Complex *sets)
{
    int64_t first = nldyn_number_outside(n, sets, 0.0), found = -1, reached = first;
    int64_t last = nldyn_number_outside(n, sets + (m - 1) * n, 0.0);
    int rising = last >= first ? 1 : -1;
    double worst = 0.0;
    for (int64_t k = 1; k < m - 1; k++) {
        int64_t here = nldyn_number_outside(n, sets + k * n, 0.0);
        bool beyond = rising * (here - last) > 0 || rising * (here - reached) < 0;
        double weight = sigmas[k] * (1.0 - sigmas[k]);
        if (beyond && weight > worst) {
            found = k;
            worst = weight;
        }
        if (rising * (here - reached) > 0) reached = here;
    }
    return found;
}

/* the Jacobians of p orbits (p, k, n, n) at their places (p,) along a branch */
typedef struct {
    int64_t k, n;
    const double *jacobians, *places;
} Along;

/* fill the Jacobians (k, n, n) at a position by the polynomials through those from first up to last */
static void jacobians_at(const Along *along, int64_t first, int64_t last, double sigma,
                         double *here)
{
    size_t count = (size_t)along->k * along->n * along->n;
    const double *places = along->places;
    for (size_t e = 0; e < count; e++) here[e] = 0.0;
    for (int64_t i = first; i < last; i++) {
        double weight = 1.0;
        for (int64_t j = first; j < last; j++)
            if (j != i) weight *= (sigma - places[j]) / (places[i] - places[j]);
        for (size_t e = 0; e < count; e++) here[e] += weight * along->jacobians[i * count + e];
    }
}

/* Fill the multipliers (m, n) of the Jacobians at positions (m,) by the polynomials through those
 * (p, k, n, n) from first up to last: the multipliers are not smooth where they meet. Whether there
 * was memory. */
EXPORT int64_t nldyn_multipliers_between(const Host *host, const Along *along, int64_t first,
                                         int64_t last, int64_t m, const double *sigmas,
                                         Complex *found)
{
    size_t count = (size_t)along->k * along->n * along->n;
    double *memory = malloc(sizeof(double) * (count + along->n + 1)), squeeze;
    int64_t done = memory != NULL;
    for (int64_t i = 0; i < m && done; i++) {
        jacobians_at(along, first, last, sigmas[i], memory);
        done = nldyn_product_eigenvalues(host, along->k, along->n, memory, found + i * along->n,
                                         memory + count, &squeeze) >= 0;
    }
    free(memory);
    return done;
}

/* Fill the multipliers (n,) half-way between two of p orbits, whose own are given, and how far one
 * moves from one orbit to the other. Whether all are too far from the circle to come near it in half
 * a step, or -1 without memory: those do that move by less than `calm` times their distance. */
EXPORT int64_t nldyn_half_way(const Host *host, const Along *along, int64_t p,
                              const Complex *before, const Complex *after, double calm,
                              Complex *middle, double *way)
{
    int64_t n = along->n;
    double half = 0.5;
    if (!nldyn_multipliers_between(host, along, 0, p, 1, &half, middle)) return -1;
    *way = 2.0 * larger(nldyn_farthest_travel(n, before, middle),
                        nldyn_farthest_travel(n, middle, after));
    double nearest = smaller(off_circle(n, before), off_circle(n, after));
    return *way < calm * smaller(nearest, off_circle(n, middle));
}

/* How far the multipliers (n,) half-way between the places first and first + 1, of three or four,
 * are from those without one of the other orbits; -1 without memory. found: (n,) scratch. */
EXPORT double nldyn_error_half_way(const Host *host, const Along *along, int64_t p, int64_t first,
                                   const Complex *middle, Complex *found)
{
    double half = 0.5, error = 0.0;
    int64_t from[2] = {p == 3 ? first : 0, 1}, number = p == 3 ? 2 : 3;
    for (int i = 0; i < (p == 3 ? 1 : 2); i++) {
        if (!nldyn_multipliers_between(host, along, from[i], from[i] + number, 1, &half, found))
            return -1.0;
        error = larger(error, travel(along->n, middle, found));
    }
    return error;
}
