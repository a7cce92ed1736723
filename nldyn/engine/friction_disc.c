/* Friction over a plane: a slider with two tangents behind an isotropic spring.
 *
 * It is two rows of sliders, a tangent each; the second follows the first. With the strain e of the
 * spring, the force k e is within a disc of radius R = μN. Where the slider slides, the force is
 * R u with u = e/|e|, and its place moves along u so fast that |e| stays R/k. Only the direction
 * of e counts then, which turns by the speed v along the plane, with t a quarter turn from u,
 *
 *     e' = (k |e|/R) (v . t) t + g u,
 *
 * whatever g is: the rate of the length, which is put right where a panel ends. It is none, but
 * where a contact begins, with e = 0. So the place has the speed v - e': a row for each tangent,
 * which acts on the place as forces do on velocities, see `moves` in `Stop`.
 *
 * Without a spring the force is R v/|v|: there are no places, and no rows of these. */
#include "engine.h"

#define SETTLING 30 /* rounds in which a force and the way in which it lets go settle */

enum { OF_NORMAL = 4, N_TILTS = 5 }; /* strains and speeds along both tangents, normal force */

/* whether a slider slides over its plane */
static bool slides_on_disc(const Flow *fl, int s) { return is_disc(fl, s) && fl->slides[s] != 0; }

/* let both rows slide, or stick */
static void set_slides(const Flow *fl, int s, int way)
{
    fl->slides[s] = way;
    if (is_disc(fl, s)) fl->slides[(int)stop_of(fl, s)->beside] = way;
}

/* Forces along both tangents and speeds of the place (4,) with their derivatives by strains, speeds
 * and the normal force, where the length of the strain grows as fast as told */
static void disc_law(const Flow *fl, int s, const double *strain, const double *speed,
                     double normal, double growth, double *found, double by[4][N_TILTS])
{
    const Stop *slider = stop_of(fl, s);
    double size = hypot(strain[0], strain[1]), most = slider->friction * fabs(normal);
    memset(by, 0, sizeof(double) * 4 * N_TILTS);
    for (int i = 0; i < 2; i++) {
        found[i] = 0.0;
        found[2 + i] = speed[i];
        by[2 + i][2 + i] = 1.0;
    }
    if (!(size > 0.0 && most > 0.0)) return;
    double u[2] = {strain[0] / size, strain[1] / size}, t[2] = {-u[1], u[0]};
    double along = u[0] * speed[0] + u[1] * speed[1], aside = t[0] * speed[0] + t[1] * speed[1];
    double rate = slider->tangential / most, turn = rate * size, pull = slider->friction * normal;
    for (int i = 0; i < 2; i++) {
        found[i] = pull * u[i];
        found[2 + i] -= turn * aside * t[i] + growth * u[i];
        by[i][OF_NORMAL] = slider->friction * u[i];
        by[2 + i][OF_NORMAL] = turn * aside / normal * t[i];
        for (int j = 0; j < 2; j++) {
            by[i][j] = pull / size * t[i] * t[j];
            by[2 + i][j] = rate * (aside * (u[i] * t[j] - t[i] * u[j]) + along * t[i] * t[j]) -
                           growth / size * t[i] * t[j];
            by[2 + i][2 + j] -= turn * t[i] * t[j];
        }
    }
}

/* the same without a spring: forces alone, against the speed along what it slides on */
static void hard_disc_law(const Flow *fl, int s, const double *speed, double normal, double *found,
                          double by[4][N_TILTS])
{
    double friction = stop_of(fl, s)->friction, size = hypot(speed[0], speed[1]);
    memset(by, 0, sizeof(double) * 4 * N_TILTS);
    for (int f = 0; f < 4; f++) found[f] = 0.0;
    if (!(size > 0.0)) return;
    double u[2] = {speed[0] / size, speed[1] / size}, t[2] = {-u[1], u[0]};
    for (int i = 0; i < 2; i++) {
        found[i] = friction * normal * u[i];
        by[i][OF_NORMAL] = friction * u[i];
        for (int j = 0; j < 2; j++) by[i][2 + j] = friction * normal / size * t[i] * t[j];
    }
}

/* first row of what slides over a plane that a place among the closed ones belongs to, or -1 */
static int disc_of(const Flow *fl, const Panel *panel, int a)
{
    int s = panel->active[a];
    if (is_mover(fl, s)) s = (int)stop_of(fl, s)->moves;
    if (!slides_on_disc(fl, s)) return -1;
    return is_mate(fl, s) ? (int)stop_of(fl, s)->beside : s;
}

static bool any_disc(const Flow *fl, const Panel *panel)
{
    for (int a = 0; a < panel->na; a++)
        if (disc_of(fl, panel, a) >= 0) return true;
    return false;
}

/* places among the closed ones of its forces along both tangents and, behind a spring, of the speeds
 * of its place; how many */
static int disc_places(const Flow *fl, const Panel *panel, int s, int *places)
{
    int rows[2] = {s, (int)stop_of(fl, s)->beside};
    for (int d = 0; d < 2; d++) {
        places[d] = place_of(panel, rows[d]);
        places[2 + d] = is_sprung(fl, s) ? place_of(panel, (int)stop_of(fl, rows[d])->mover) : -1;
    }
    return is_sprung(fl, s) ? 4 : 2;
}

/* derivatives (m,) of the force or speed at a place among the closed ones: by strains and speeds
 * along both tangents, but for that by the strain along its own, or by the normal force */
static double *tilt_of(const Panel *panel, int a, int by)
{
    return panel->tilt + (size_t)(a * N_TILTS + by) * panel->m;
}

/* force that presses a slider on, at node i of a panel */
static double normal_at(const Flow *fl, const Panel *panel, int s, int i)
{
    if (!is_pressed(fl, s)) return stop_of(fl, s)->pressing;
    return panel->F[place_of(panel, (int)stop_of(fl, s)->normal) * panel->m + i];
}

/* strains and speeds along both tangents at node i of a panel */
static void disc_at(const Flow *fl, const Panel *panel, const int *places, int i, double *strain,
                    double *speed)
{
    for (int d = 0; d < 2; d++) {
        double belt = stop_of(fl, panel->active[places[d]])->belt;
        strain[d] = panel->output[places[d] * panel->m + i];
        speed[d] = panel->output[(panel->na + places[d]) * panel->m + i] - belt;
    }
}

/* fill F and its derivatives of what slides over a plane, of its first row */
static void disc_forces(const Flow *fl, Panel *panel, int a, double *slope)
{
    int na = panel->na, m = panel->m, s = panel->active[a], places[4];
    int count = disc_places(fl, panel, s, places), own = is_sprung(fl, s) ? 0 : 2;
    for (int i = 0; i < m; i++) {
        double strain[2], speed[2], found[4], by[4][N_TILTS], normal = normal_at(fl, panel, s, i);
        disc_at(fl, panel, places, i, strain, speed);
        if (is_sprung(fl, s))
            disc_law(fl, s, strain, speed, normal, panel->growth[a], found, by);
        else
            hard_disc_law(fl, s, speed, normal, found, by);
        for (int f = 0; f < count; f++) {
            panel->F[places[f] * m + i] = found[f];
            slope[places[f] * m + i] = f < 2 && own == 0 ? by[f][f] : 0.0;
            slope[(na + places[f]) * m + i] = own == 2 ? by[f][2 + f] : 0.0;
            if (f < 2) by[f][own + f] = 0.0;
            if (f >= 2 && panel->rough) by[f][OF_NORMAL] = 0.0;
            for (int c = 0; c < N_TILTS; c++) tilt_of(panel, places[f], c)[i] = by[f][c];
        }
    }
}

/* which of these derivatives is that by an output of a slider over a plane */
static int tilt_by(const Flow *fl, const Panel *panel, int o)
{
    return (is_mate(fl, panel->active[o % panel->na]) ? 1 : 0) + (o >= panel->na ? 2 : 0);
}

/* add to rows of forces, in a matrix (na m, n_columns), what they have of the output o of what
 * slides over a plane, (m, n_columns); entries of a row, and rows, lie so far apart */
static void add_tilted(const Flow *fl, const Panel *panel, int o, double sign,
                       const double *outputs, size_t output_entry, size_t output_row,
                       double *forces, size_t entry, size_t row, int n_columns)
{
    int m = panel->m, a = o % panel->na, places[4], s = disc_of(fl, panel, a);
    if (s < 0 || is_mover(fl, panel->active[a])) return;
    int count = disc_places(fl, panel, s, places);
    for (int f = 0; f < count; f++) {
        const double *tilt = tilt_of(panel, places[f], tilt_by(fl, panel, o));
        for (int i = 0; i < m; i++) {
            const double *from = outputs + (size_t)i * output_row;
            double *to = forces + (size_t)(places[f] * m + i) * row;
            for (int c = 0; c < n_columns; c++)
                to[c * entry] += sign * tilt[i] * from[c * output_entry];
        }
    }
}

/* add to rows of forces what they have of the force that presses on what slides over a plane */
static void add_disc_friction(const Flow *fl, const Panel *panel, int a, double *matrix,
                              int n_columns, size_t entry, size_t row)
{
    int m = panel->m, s = disc_of(fl, panel, a);
    if (s < 0 || !is_pressed(fl, s)) return;
    int normal = place_of(panel, (int)stop_of(fl, s)->normal);
    for (int i = 0; i < m; i++) {
        double share = tilt_of(panel, a, OF_NORMAL)[i];
        const double *from = matrix + (size_t)(normal * m + i) * row;
        double *to = matrix + (size_t)(a * m + i) * row;
        for (int c = 0; c < n_columns; c++) to[c * entry] += share * from[c * entry];
    }
}

/* rounding error of the force or speed at a place among the closed ones, by those of the outputs
 * (outputs,) */
static double disc_noise(const Flow *fl, const Panel *panel, int a, const double *noise)
{
    int na = panel->na, m = panel->m, places[4], s = disc_of(fl, panel, a);
    double total = 0.0;
    if (s < 0) return total;
    disc_places(fl, panel, s, places);
    for (int c = 0; c < 4; c++) {
        int o = c < 2 ? places[c] : na + places[c - 2];
        total += 10.0 * noise[o] * largest(tilt_of(panel, a, c), m);
    }
    if (!is_pressed(fl, s)) return total;
    int normal = place_of(panel, (int)stop_of(fl, s)->normal);
    for (int o = normal; o < panel->outputs; o += na)
        total += 10.0 * largest(tilt_of(panel, a, OF_NORMAL), m) * noise[o] *
                 largest(panel->slope + (size_t)o * m, m);
    return total;
}

/* add to the sensitivities of forces and speeds at a node of what slides over a plane what its own
 * numbers do */
static void add_disc_columns(const Flow *fl, const Panel *panel, int a, int i, int n_columns,
                             double *forces)
{
    int na = panel->na, m = panel->m, s = panel->active[a], places[4];
    const Stop *slider = stop_of(fl, s);
    int count = disc_places(fl, panel, s, places);
    double e[2], v[2], normal = normal_at(fl, panel, s, i);
    disc_at(fl, panel, places, i, e, v);
    if (slider->friction == 0.0 || !is_sprung(fl, s))
        memcpy(e, v, sizeof e); /* it pulls, or would, against the sliding */
    double size = larger(hypot(e[0], e[1]), TINY);
    for (int c = 0; c < fl->n_parameters; c++) {
        int64_t column = fl->parameters[2 * c];
        if (!is_number_of(fl, c, s)) continue;
        for (int f = 0; f < count; f++) {
            double *force = forces + (size_t)(places[f] * m + i) * n_columns + fl->size + c;
            double by_normal = tilt_of(panel, places[f], OF_NORMAL)[i];
            if (column == PRESSING) *force += by_normal;
            if (column == FRICTION && f < 2) *force += normal * e[f] / size;
            if (column == FRICTION && f >= 2 && slider->friction > 0.0)
                *force += by_normal * normal / slider->friction;
            if (column == TANGENTIAL && f >= 2)
                *force -= by_normal * normal / slider->tangential;
        }
    }
}

/* how often the direction has forgotten what it was, in a panel: where nothing presses on, or a strain
 * begins, that is soon, and does not count */
static double forgotten(const Flow *fl, const Gauss *tab, int kind, double h, const Panel *panel,
                        int a)
{
    int na = panel->na, m = panel->m, s = panel->active[a], places[4];
    double most = TINY, total = 0.0;
    disc_places(fl, panel, s, places);
    for (int p = 0; p < 2 * m && !is_sprung(fl, s); p++) {
        int place = places[p / m], i = p % m;
        total += h * tab->weights[kind * m + i] * stop_of(fl, panel->active[place])->mobility *
                 panel->slope[(na + place) * m + i];
    }
    if (!is_sprung(fl, s) || panel->growth[a] > 0.0) return total;
    for (int i = 0; i < m; i++) {
        double along = 0.0, size = TINY;
        for (int d = 0; d < 2; d++) {
            double strain = panel->output[places[d] * m + i];
            along += strain * panel->output[(na + places[d]) * m + i];
            size = hypot(size, strain);
        }
        total += h * tab->weights[kind * m + i] * larger(along, 0.0) / size;
        most = larger(most, stop_of(fl, s)->friction * fabs(normal_at(fl, panel, s, i)));
    }
    return total * stop_of(fl, s)->tangential / most;
}

/* least speed along both tangents at the nodes, of what slides without a spring */
static double slowest_over(const Flow *fl, const Panel *panel, int a)
{
    double slowest = INFINITY, strain[2], speed[2];
    int places[4];
    disc_places(fl, panel, disc_of(fl, panel, a), places);
    for (int i = 0; i < panel->m; i++) {
        disc_at(fl, panel, places, i, strain, speed);
        slowest = smaller(slowest, hypot(speed[0], speed[1]));
    }
    return larger(slowest, TINY);
}

/* fill `shown` (m,) with the force at a place among the closed ones or, of a place that moves, its
 * speed, which counts the less the less force there is; the largest of both tangents */
static double show_disc_force(const Flow *fl, const Panel *panel, int a, double *shown)
{
    int m = panel->m, s = disc_of(fl, panel, a), places[4];
    disc_places(fl, panel, s, places);
    int first = is_mover(fl, panel->active[a]) ? 2 : 0;
    double most = TINY, strongest = 0.0;
    for (int i = 0; i < m; i++) most = larger(most, fabs(normal_at(fl, panel, s, i)));
    for (int i = 0; i < m; i++) {
        double share = first == 0 ? 1.0 : fabs(normal_at(fl, panel, s, i)) / most;
        shown[i] = share * panel->F[a * m + i];
        for (int d = 0; d < 2; d++)
            strongest = larger(strongest, share * fabs(panel->F[places[first + d] * m + i]));
    }
    return strongest;
}

/* Share of the speed along the plane that its friction may take in a panel. The direction of what
 * nothing presses on is that of a power of the time left, which no polynomial shows: there it counts
 * how little the force does. */
static double disc_kick(const Flow *fl, const Panel *panel, int a, double h)
{
    int na = panel->na, m = panel->m, s = disc_of(fl, panel, a), places[4];
    double most = 0.0, fastest = TINY;
    disc_places(fl, panel, s, places);
    for (int d = 0; d < 2; d++) {
        most = larger(most, largest(panel->F + (size_t)places[d] * m, m));
        fastest = larger(fastest, largest(panel->output + (size_t)(na + places[d]) * m, m));
    }
    return most * h * stop_of(fl, s)->mobility / fastest;
}

/* slope of the polynomial through values (m,) at node i over the stretched time of a panel */
static double slope_at_node(const Gauss *tab, const double *values, int i)
{
    double x = 2.0 * tab->ends_nodes[i + 1] - 1.0, total = 0.0;
    double before = 0.0, here = 1.0, slope_before = 0.0, slope = 0.0; /* Legendre's polynomials */
    for (int n = 0; n < tab->m; n++) {
        total += legendre_coefficient(tab, values, n) * slope;
        double next = ((2 * n + 1) * x * here - n * before) / (n + 1);
        double slope_next = slope_before + (2 * n + 1) * here;
        before = here;
        here = next;
        slope_before = slope;
        slope = slope_next;
    }
    return 2.0 * total;
}

/* fill how what slides over a plane yields to forces along both tangents: xx, xy, yy */
static void fill_yield(const Flow *fl, int s, double *B)
{
    int other = (int)stop_of(fl, s)->beside;
    B[0] = stop_of(fl, s)->mobility;
    B[1] = between(fl, s, other);
    B[2] = stop_of(fl, other)->mobility;
}

/* Fill the direction u (2,) in which what rests over a plane leaves, by how it yields, B, the
 * accelerations a that it would have without friction, and the most that this may be, R:
 * (R B + σ) u = a with |u| = 1, so that it gets faster, by σ, along the direction in which it goes; σ. */
static double fill_leaving(const double *B, const double *free, double most, double *u)
{
    double b = B[0], c = B[1], d = B[2];
    double low = 0.0, high = hypot(free[0], free[1]), size = 0.0;
    for (int step = 0; step < 60; step++) {
        double more = 0.5 * (low + high), p = most * b + more, q = most * c, r = most * d + more;
        double det = larger(p * r - q * q, TINY);
        u[0] = (r * free[0] - q * free[1]) / det;
        u[1] = (p * free[1] - q * free[0]) / det;
        size = hypot(u[0], u[1]);
        if (size > 1.0)
            low = more;
        else
            high = more;
    }
    for (int i = 0; i < 2; i++) u[i] /= larger(size, TINY);
    return 0.5 * (low + high);
}

/* The same of what a rigid stop presses on with a force N that friction changes at once: by the
 * accelerations (3,) along the normal and both tangents without either; N. */
static double fill_pressed_leaving(const Flow *fl, int s, const double *free, double N, double *u)
{
    int stop = (int)stop_of(fl, s)->normal;
    double B[3], friction = stop_of(fl, s)->friction;
    double both[2] = {between(fl, stop, s), between(fl, stop, (int)stop_of(fl, s)->beside)};
    fill_yield(fl, s, B);
    for (int round = 0; round < SETTLING; round++) {
        double left[2] = {free[1] - both[0] * N, free[2] - both[1] * N}, before = N;
        fill_leaving(B, left, friction * N, u);
        N = larger(free[0] / (stop_of(fl, stop)->mobility + friction * (both[0] * u[0] + both[1] * u[1])), 0.0);
        if (fabs(N - before) <= SUM_ROUNDING * N) break;
    }
    return N;
}

/* Guess the forces of what has just been let go over a plane, at a place among the closed ones, by
 * its rates with those that were guessed before. */
static void guess_leaving(const Flow *fl, const Gauss *tab, int kind, double h, Panel *panel, int a)
{
    int na = panel->na, m = panel->m, first = panel->active[a], places[4];
    int stop = is_pressed(fl, first) ? (int)stop_of(fl, first)->normal : -1;
    bool rigid = stop >= 0 && is_rigid(fl, stop);
    double B[3];
    disc_places(fl, panel, first, places);
    fill_yield(fl, first, B);
    for (int i = 0; i < m; i++) {
        double free[2], u[2], normal = larger(normal_at(fl, panel, first, i), 0.0);
        for (int d = 0; d < 2; d++) {
            int row = panel->active[places[d]];
            double *rates = panel->output + (size_t)(na + places[d]) * m;
            free[d] = slope_at_node(tab, rates, i) / (h * tab->slope[kind * m + i]);
            for (int e = 0; e < 2; e++)
                free[d] += between(fl, row, panel->active[places[e]]) * panel->F[places[e] * m + i];
        }
        if (rigid) {
            double all[3] = {stop_of(fl, stop)->mobility * normal, free[0], free[1]};
            for (int d = 0; d < 2; d++) {
                double both = between(fl, stop, panel->active[places[d]]);
                all[0] += both * panel->F[places[d] * m + i];
                all[1 + d] += both * normal;
            }
            normal = fill_pressed_leaving(fl, first, all, normal, u);
            panel->F[place_of(panel, stop) * m + i] = normal;
        } else {
            fill_leaving(B, free, stop_of(fl, first)->friction * normal, u);
        }
        for (int d = 0; d < 2; d++)
            panel->F[places[d] * m + i] = stop_of(fl, first)->friction * normal * u[d];
    }
}
