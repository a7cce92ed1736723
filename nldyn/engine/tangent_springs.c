/* Sliders behind a spring of tangential stiffness [Jenkins 1962]: where one sticks, its force goes
 * with the strain of the spring, the output of its row; where it slides, that is its friction over
 * the stiffness. The place of the slider is an entry of the state, so that the strain is a row of
 * it like any other; as it slides, or nothing presses it on, the place follows at once. */
#include "engine.h"

static int place_entry(const Flow *fl, int s) { return (int)stop_of(fl, s)->place; }

/* strain by that entry */
static double strain_by_place(const Flow *fl, int s) { return row_of(fl, 0, s)[place_entry(fl, s)]; }

/* force that presses a slider on, with its derivative by the penetration of the stop that does */
static Value pressing_now(const Flow *fl, int s, const double *w, double phase)
{
    if (!is_pressed(fl, s)) return (Value){stop_of(fl, s)->pressing, 0.0};
    int stop = (int)stop_of(fl, s)->normal;
    Course at = depth_now(fl, stop, w, phase);
    Force f = law(fl, stop, at.value, at.first);
    bool touches = at.value <= 0.0 && stop_of(fl, stop)->exponent == 1.0; /* or it would be open */
    return (Value){f.force, touches ? stop_of(fl, stop)->stiffness : f.stiffness};
}

/* a slider over a plane at present */
typedef struct {
    double strain[2], speed[2], u[2]; /* u: direction of the strain or, without any, of the speed */
    double size;                      /* length of the strain, zero where it is rounding */
    double along;                     /* speed along u at which the slider slides */
} Disc;

static Disc disc_now(const Flow *fl, int s, const double *w, double phase)
{
    const Stop *slider = stop_of(fl, s);
    Disc at;
    for (int d = 0; d < 2; d++) {
        Course strain = output_now(fl, d == 0 ? s : (int)slider->beside, w, phase);
        at.strain[d] = strain.value;
        at.speed[d] = strain.first;
    }
    at.size = hypot(at.strain[0], at.strain[1]);
    double noise = output_noise(fl, s, w) + output_noise(fl, (int)slider->beside, w);
    bool strained = at.size > 10.0 * noise;
    if (!strained) at.size = 0.0;
    double length = strained ? at.size : hypot(at.speed[0], at.speed[1]);
    for (int d = 0; d < 2; d++)
        at.u[d] = (strained ? at.strain[d] : at.speed[d]) / larger(length, TINY);
    at.along = at.u[0] * at.speed[0] + at.u[1] * at.speed[1];
    if (!is_pressed(fl, s)) return at;
    double pace = depth_now(fl, (int)slider->normal, w, phase).first;
    at.along -= grip(fl, s) * pressing_now(fl, s, w, phase).slope * pace / slider->tangential;
    return at;
}

/* Speed at which a slider moves along what it slides on, to one `way`: of what it holds or, behind
 * a spring, less the rate of the strain, that of its friction over the stiffness. */
static double drag_speed(const Flow *fl, int s, int way, const double *w, double phase)
{
    const Stop *slider = stop_of(fl, s);
    double speed = output_now(fl, s, w, phase).first - slider->belt;
    if (is_disc(fl, s) && is_sprung(fl, s) && way != 0) return disc_now(fl, s, w, phase).along;
    if (!is_sprung(fl, s) || !is_pressed(fl, s) || way == 0) return speed;
    double pace = depth_now(fl, (int)slider->normal, w, phase).first;
    double growth = pressing_now(fl, s, w, phase).slope * pace;
    return speed - way * grip(fl, s) * growth / slider->tangential;
}

/* rounding error of it */
static double drag_noise(const Flow *fl, int s, const double *w, double phase)
{
    const Stop *slider = stop_of(fl, s);
    double noise = rate_noise(fl, s, w);
    if (is_hard_disc(fl, s)) return noise + rate_noise(fl, (int)slider->beside, w);
    if (is_disc(fl, s)) {
        int other = (int)slider->beside;
        Disc at = disc_now(fl, s, w, phase);
        double turn = at.size > 0.0 ? hypot(at.speed[0], at.speed[1]) / at.size : 0.0;
        noise += rate_noise(fl, other, w);
        noise += turn * (output_noise(fl, s, w) + output_noise(fl, other, w));
    }
    if (!is_sprung(fl, s) || !is_pressed(fl, s)) return noise;
    int stop = (int)slider->normal;
    Course at = depth_now(fl, stop, w, phase);
    double slope = pressing_now(fl, s, w, phase).slope, sway = rate_noise(fl, stop, w);
    if (at.value > 0.0)
        sway += stop_of(fl, stop)->exponent * fabs(at.first) / at.value * output_noise(fl, stop, w);
    return noise + grip(fl, s) * slope * sway / slider->tangential;
}

/* the share of that rate at node i of a panel, in the sense of sliding */
static double grip_pace(const Flow *fl, const Panel *panel, int s, int i)
{
    if (!is_sprung(fl, s) || !is_pressed(fl, s)) return 0.0;
    int m = panel->m, a = place_of(panel, (int)stop_of(fl, s)->normal);
    double growth = panel->slope[a * m + i] * panel->output[(panel->na + a) * m + i];
    return grip(fl, s) * growth / stop_of(fl, s)->tangential;
}

/* fill s->drags (n_stops,): rates of the places of sliders that slide or that nothing presses on,
 * beside those at which they stick */
static void fill_drags(const Motion *M, double phase)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_sprung(fl, s)) continue;
        bool sticks = M->closed[s] && fl->slides[s] == 0;
        int way = M->closed[s] ? fl->slides[s] : 0;
        double speed = sticks ? 0.0 : drag_speed(fl, s, way, M->w, phase);
        if (way != 0 && is_disc(fl, s)) {
            int first = is_mate(fl, s) ? (int)stop_of(fl, s)->beside : s;
            Disc at = disc_now(fl, first, M->w, phase);
            speed = at.along * at.u[s != first];
        }
        M->s->drags[s] = -speed / strain_by_place(fl, s);
    }
}

/* rounding error of the margin between the force of a spring and the friction that holds it */
static double strain_noise(const Flow *fl, int s, const double *w)
{
    const Stop *slider = stop_of(fl, s);
    double noise = output_noise(fl, s, w);
    if (is_disc(fl, s)) noise += output_noise(fl, (int)slider->beside, w);
    return slider->tangential * noise;
}

/* whether a slider that sticks is about to slip, to within a time allowed or rounding */
static bool at_grip(const Flow *fl, int s, const double *w, double phase, double allowed)
{
    const Stop *slider = stop_of(fl, s);
    Course strain = output_now(fl, s, w, phase);
    double most = grip(fl, s) * pressing_now(fl, s, w, phase).value;
    if (is_disc(fl, s)) {
        Disc at = disc_now(fl, s, w, phase);
        strain.value = at.size;
        strain.first = hypot(at.speed[0], at.speed[1]);
    }
    double margin = most - fabs(slider->tangential * strain.value);
    double pace = slider->tangential * fabs(strain.first);
    if (is_pressed(fl, s)) {
        double growth = pressing_now(fl, s, w, phase).slope;
        pace += grip(fl, s) * growth * fabs(depth_now(fl, (int)slider->normal, w, phase).first);
    }
    return margin <= allowed * pace + 10.0 * strain_noise(fl, s, w);
}

static bool any_sprung(const Flow *fl)
{
    for (int s = 0; s < fl->n_stops; s++)
        if (is_sprung(fl, s)) return true;
    return false;
}

/* whether a slider has no friction, so that nothing tells which way it slides */
static bool slides_freely(const Flow *fl, int s)
{
    return (is_sprung(fl, s) || is_disc(fl, s)) && grip(fl, s) == 0.0;
}

/* add to a row of sensitivities (n_columns,) `factor` times what presses a slider on changes by */
static void add_pressing_columns(const Motion *M, int s, double factor, double phase, double t,
                                 double *sums)
{
    const Flow *fl = M->fl;
    int stop = (int)stop_of(fl, s)->normal;
    if (!is_pressed(fl, s)) {
        for (int c = 0; c < fl->n_parameters; c++)
            if (is_parameter(fl, c, PRESSING, s)) sums[fl->size + c] += factor;
        return;
    }
    double *depth = M->s->moved, slope = pressing_now(fl, s, M->w, phase).slope;
    Course at = depth_now(fl, stop, M->w, phase);
    output_columns(fl, stop, 0, phase, t, M->columns, M->n_columns, depth);
    for (int c = 0; c < M->n_columns; c++) sums[c] += factor * slope * depth[c];
    for (int c = 0; c < fl->n_parameters && at.value > 0.0; c++)
        if (is_number_of(fl, c, stop) && fl->parameters[2 * c] >= GAP)
            sums[fl->size + c] += factor * share_in(fl, c, stop) *
                                  law_by(fl, stop, fl->parameters[2 * c], at.value, at.first);
}

/* Put the place of a slider where its spring has a strain of `way` times its friction over the
 * stiffness, with its sensitivities, at a time t after the start. */
static void drag_place(Motion *M, int s, int way, double phase, double t)
{
    const Flow *fl = M->fl;
    const Stop *slider = stop_of(fl, s);
    double by = strain_by_place(fl, s), share = way * grip(fl, s) / slider->tangential;
    double normal = way == 0 ? 0.0 : pressing_now(fl, s, M->w, phase).value;
    double *off = M->s->along_columns;
    if (M->with_columns) {
        output_columns(fl, s, 0, phase, t, M->columns, M->n_columns, off);
        for (int c = 0; c < M->n_columns; c++) off[c] = -off[c];
        if (way != 0) add_pressing_columns(M, s, share, phase, t, off);
        for (int c = 0; c < fl->n_parameters && way != 0; c++) {
            if (is_parameter(fl, c, FRICTION, s))
                off[fl->size + c] += way * normal / slider->tangential;
            if (is_parameter(fl, c, TANGENTIAL, s))
                off[fl->size + c] -= share * normal / slider->tangential;
        }
        double *row = M->columns + (size_t)place_entry(fl, s) * M->n_columns;
        for (int c = 0; c < M->n_columns; c++) row[c] += off[c] / by;
    }
    M->w[place_entry(fl, s)] += (share * normal - output_now(fl, s, M->w, phase).value) / by;
    M->depth[s] = share * normal;
    M->doubt[s] = 0.0;
}

/* The same over a plane: the strain keeps its direction, at the length of its friction over the
 * stiffness. */
static void drag_over_plane(Motion *M, int s, double phase, double t)
{
    const Flow *fl = M->fl;
    const Stop *slider = stop_of(fl, s);
    int rows[2] = {s, (int)slider->beside}, n = M->n_columns;
    Disc at = disc_now(fl, s, M->w, phase);
    double share = grip(fl, s) / slider->tangential;
    double normal = larger(pressing_now(fl, s, M->w, phase).value, 0.0), aim = share * normal;
    if (!(aim > 0.0 && at.size > 0.0)) {
        for (int d = 0; d < 2; d++) drag_place(M, rows[d], 0, phase, t);
        return;
    }
    double *off[2] = {M->s->closing, M->s->sliding}, *grown = M->s->along_columns;
    for (int d = 0; d < 2 && M->with_columns; d++)
        output_columns(fl, rows[d], 0, phase, t, M->columns, n, off[d]);
    for (int c = 0; c < n && M->with_columns; c++) grown[c] = 0.0;
    if (M->with_columns) add_pressing_columns(M, s, share, phase, t, grown);
    for (int c = 0; c < fl->n_parameters && M->with_columns; c++) {
        if (is_parameter(fl, c, FRICTION, s)) grown[fl->size + c] += normal / slider->tangential;
        if (is_parameter(fl, c, TANGENTIAL, s)) grown[fl->size + c] -= aim / slider->tangential;
    }
    for (int c = 0; c < n && M->with_columns; c++) {
        double aside = at.u[0] * off[1][c] - at.u[1] * off[0][c], turned_by = aim / at.size * aside;
        off[0][c] = at.u[0] * grown[c] - at.u[1] * turned_by - off[0][c];
        off[1][c] = at.u[1] * grown[c] + at.u[0] * turned_by - off[1][c];
    }
    for (int d = 0; d < 2; d++) {
        double by = strain_by_place(fl, rows[d]);
        double *row = M->columns + (size_t)place_entry(fl, rows[d]) * n;
        for (int c = 0; c < n && M->with_columns; c++) row[c] += off[d][c] / by;
        M->w[place_entry(fl, rows[d])] += (aim * at.u[d] - at.strain[d]) / by;
        M->depth[rows[d]] = aim * at.u[d];
        M->doubt[rows[d]] = 0.0;
    }
}

/* the same of all sliders behind springs that slide, or that nothing presses on */
static void drag_places(Motion *M, double phase, double t)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_sprung(fl, s) || (M->closed[s] && fl->slides[s] == 0)) continue;
        if (M->closed[s] && is_disc(fl, s)) {
            if (!is_mate(fl, s)) drag_over_plane(M, s, phase, t);
        } else {
            drag_place(M, s, M->closed[s] ? fl->slides[s] : 0, phase, t);
        }
    }
}

/* `load_springs` of a slider over a plane */
static void load_disc(Motion *M, int s, double phase, double t, double roundings, double allowed)
{
    const Flow *fl = M->fl;
    const Stop *slider = stop_of(fl, s);
    double noise = 10.0 * strain_noise(fl, s, M->w);
    double most = grip(fl, s) * larger(pressing_now(fl, s, M->w, phase).value, 0.0);
    double force = slider->tangential * disc_now(fl, s, M->w, phase).size;
    int before = fl->slides[s];
    if (force > most + noise) drag_over_plane(M, s, phase, t);
    double speed = disc_now(fl, s, M->w, phase).along;
    double none = roundings * drag_noise(fl, s, M->w, phase);
    if (allowed > 0.0) none += allowed * hypot(M->s->pushes[s], M->s->pushes[(int)slider->beside]);
    bool slides = (before != 0 || at_grip(fl, s, M->w, phase, allowed)) && speed > none;
    set_slides(fl, s, slides || slides_freely(fl, s));
    if (fl->slides[s] != before) M->panel->na = -1;
}

/* Let the sliders behind springs slide whose friction is reached and that move on, and the others
 * stick, but for one of which that is known, or what such a stop presses on; what is strained
 * beyond its friction, as at the start of a guess, is let go so far. A speed of so many
 * `roundings`, or gained in the time `allowed` by s->pushes, is none. */
static void load_springs(Motion *M, double phase, double t, double roundings, double allowed,
                         int known)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!(is_sprung(fl, s) && M->closed[s]) || s == known) continue;
        if (is_pressed(fl, s) && (int)stop_of(fl, s)->normal == known) continue;
        if (is_disc(fl, s)) {
            if (!is_mate(fl, s)) load_disc(M, s, phase, t, roundings, allowed);
            continue;
        }
        Course strain = output_now(fl, s, M->w, phase);
        double force = stop_of(fl, s)->tangential * strain.value;
        double noise = 10.0 * strain_noise(fl, s, M->w);
        double most = grip(fl, s) * larger(pressing_now(fl, s, M->w, phase).value, 0.0);
        int way = force > 0.0 ? 1 : -1, before = fl->slides[s];
        if (fabs(force) > most + noise) drag_place(M, s, way, phase, t);
        if (smaller(most, fabs(force)) <= noise) way = strain.first > 0.0 ? 1 : -1;
        double speed = way * drag_speed(fl, s, way, M->w, phase);
        double none = roundings * drag_noise(fl, s, M->w, phase);
        if (allowed > 0.0) none += allowed * fabs(M->s->pushes[s]); /* else these are not filled */
        bool slides = (before != 0 || at_grip(fl, s, M->w, phase, allowed)) && speed > none;
        fl->slides[s] = slides || slides_freely(fl, s) ? way : 0;
        if (fl->slides[s] != before) M->panel->na = -1; /* its equations are others now */
    }
}

/* Let the sliders stick or slide that a stop presses on which just closes: both forces grow from
 * nothing. Up to that instant, which shifts, places have followed. */
static void press_on(Motion *M, int stop, double phase, double t)
{
    const Flow *fl = M->fl;
    double *shift = M->s->along_columns;
    double pace = depth_now(fl, stop, M->w, phase).first;
    for (int s = stop + 1; s < fl->n_stops; s++) {
        if (!(is_sprung(fl, s) && is_pressed(fl, s) && (int)stop_of(fl, s)->normal == stop)) continue;
        double speed = drag_speed(fl, s, 0, M->w, phase), growth = 0.0, fastest = speed;
        if (is_disc(fl, s)) {
            Disc at = disc_now(fl, s, M->w, phase);
            fastest = hypot(at.speed[0], at.speed[1]);
        }
        if (stop_of(fl, stop)->exponent == 1.0) growth = stop_of(fl, stop)->stiffness * pace;
        bool slides = stop_of(fl, s)->tangential * fabs(fastest) > grip(fl, s) * growth;
        slides = slides || slides_freely(fl, s);
        if (is_disc(fl, s))
            set_slides(fl, s, slides);
        else
            fl->slides[s] = !slides ? 0 : speed > 0.0 ? 1 : -1;
        if (!M->with_columns || fl->slides[s] != 0) continue;
        depth_columns(M, stop, phase, t, shift);
        double rate = -speed / strain_by_place(fl, s);
        double *row = M->columns + (size_t)place_entry(fl, s) * M->n_columns;
        for (int c = 0; c < M->n_columns; c++) row[c] -= rate * shift[c] / pace;
    }
}

/* let places move as what they lie on: that is no coordinate of the motion, but given */
static void begin_places(Motion *M)
{
    const Flow *fl = M->fl;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_sprung(fl, s)) continue;
        int entry = place_entry(fl, s) + 1;
        M->w[entry] = stop_of(fl, s)->place_rate;
        M->columns[(size_t)entry * M->n_columns + entry] = 0.0;
    }
}

/* fastest rate of a system whose stops move blocks so fast, with springs of sliders */
static double fastest_strained(const System *sys, double fastest)
{
    double square = squared(fastest);
    for (int s = 0; s < sys->n_stops; s++) {
        const Stop *slider = (const Stop *)(sys->stops + (size_t)s * sys->n_columns);
        if (slider->place >= 0.0) square += slider->tangential * slider->mobility;
    }
    return sqrt(square);
}
