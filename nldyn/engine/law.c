/* The force of a stop and its derivatives. */
#include "engine.h"

/* k δ^p (1 + a v) + c v [Hunt and Crossley 1975, eq. 9; Kelvin and Voigt's for a = 0]; zero where
 * the stop is open */
static Force power_law(const Stop *stop, double delta, double speed)
{
    if (delta <= 0.0) return (Force){0.0, 0.0, 0.0};
    double slope = stop->stiffness;
    if (stop->exponent == 1.5)
        slope *= sqrt(delta);
    else if (stop->exponent != 1.0)
        slope *= pow(delta, stop->exponent - 1.0);
    double factor = 1.0 + stop->dissipation * speed;
    return (Force){slope * delta * factor + stop->dashpot * speed, stop->exponent * slope * factor,
                   stop->dissipation * slope * delta + stop->dashpot};
}

typedef void Law(double depth, double speed, double out[3]);

/* the law at an address, ``void law(double depth, double speed, double out[3])`` */
static Force call_law(int64_t address, double depth, double speed)
{
    double out[3] = {0.0, 0.0, 0.0};
    ((Law *)(intptr_t)address)(depth, speed, out);
    return (Force){out[0], out[1], out[2]};
}

static bool is_bond(const Flow *fl, int s) { return stop_of(fl, s)->bond != 0.0; }

static bool is_rigid(const Flow *fl, int s) { return stop_of(fl, s)->restitution >= 0.0; }

static bool is_slider(const Flow *fl, int s) { return stop_of(fl, s)->friction >= 0.0; }

/* whether a slider is behind a spring, and whether it sticks and that alone gives way */
static bool is_sprung(const Flow *fl, int s) { return stop_of(fl, s)->place >= 0.0; }

static bool is_strained(const Flow *fl, int s) { return is_sprung(fl, s) && fl->slides[s] == 0; }

/* whether a row is the first direction of a round clearance, or the second */
static bool is_round(const Flow *fl, int s) { return stop_of(fl, s)->second >= 0.0; }

static bool is_second(const Flow *fl, int s) { return stop_of(fl, s)->lead >= 0.0; }

static bool is_planar(const Flow *fl, int s) { return is_round(fl, s) || is_second(fl, s); }

/* whether a force keeps an acceleration at zero, that of one row: of a rigid gap, or of a slider that
 * sticks */
static bool is_held(const Flow *fl, int s)
{
    if (is_planar(fl, s)) return false;
    return is_rigid(fl, s) || (is_slider(fl, s) && fl->slides[s] == 0 && !is_sprung(fl, s));
}

/* whether a row is the second direction of a round clearance with friction, and whether its surface
 * sticks there */
static bool rubs_around(const Flow *fl, int s) { return is_second(fl, s) && stop_of(fl, s)->rub > 0.0; }

static bool sticks_around(const Flow *fl, int s) { return rubs_around(fl, s) && fl->slides[s] == 0; }

/* whether the force of either row of a round clearance keeps an acceleration: that of a rigid one, or of
 * a surface that sticks */
static bool holds_around(const Flow *fl, int s)
{
    if (!is_planar(fl, s)) return false;
    int lead = is_round(fl, s) ? s : (int)stop_of(fl, s)->lead;
    return is_rigid(fl, lead) || sticks_around(fl, (int)stop_of(fl, lead)->second);
}

/* whether a row has friction that is pressed on: a slider or a round clearance */
static bool rubs(const Flow *fl, int s) { return is_slider(fl, s) || rubs_around(fl, s); }

/* whether what slides is held by friction at present */
static bool is_stuck(const Motion *M, int s)
{
    return M->closed[s] && (sticks_around(M->fl, s) || (is_slider(M->fl, s) && is_held(M->fl, s)));
}

/* whether a slider slides over a plane, and whether it is the second row of one that does */
static bool is_disc(const Flow *fl, int s) { return stop_of(fl, s)->beside >= 0.0; }

static bool is_mate(const Flow *fl, int s)
{
    return is_disc(fl, s) && (int)stop_of(fl, s)->beside < s;
}

/* whether nothing gives way before what slides over a plane, and the first row of it */
static bool is_hard_disc(const Flow *fl, int s) { return is_disc(fl, s) && !is_sprung(fl, s); }

static int first_tangent(const Flow *fl, int s)
{
    return is_mate(fl, s) ? (int)stop_of(fl, s)->beside : s;
}

/* whether it has just been let go: it has no speed yet */
static bool is_let_go(const Flow *fl, int s) { return is_hard_disc(fl, s) && fl->slides[s] == LET_GO; }

/* whether a row is the speed of a slider's place */
static bool is_mover(const Flow *fl, int s) { return stop_of(fl, s)->moves >= 0.0; }

static bool is_elastic(const Flow *fl, int s)
{
    return !(is_rigid(fl, s) || is_slider(fl, s) || is_bond(fl, s) || is_second(fl, s) ||
             is_mover(fl, s));
}

/* whether a stop presses a slider on, in place of a constant force */
static bool is_pressed(const Flow *fl, int s)
{
    return is_slider(fl, s) && stop_of(fl, s)->normal >= 0.0;
}

/* friction per unit of the normal force, (μ + adhesion e^{-|v|/fading}) in the sense of sliding, and
 * its derivative by the speed; with fl->slides = 0 nothing */
static Value friction_at(const Flow *fl, int s, double speed)
{
    const Stop *slider = stop_of(fl, s);
    int way = fl->slides[s];
    if (slider->fading == 0.0) return (Value){way * slider->friction, 0.0};
    double more = slider->adhesion * exp(-way * (speed - slider->belt) / slider->fading);
    return (Value){way * (slider->friction + more), -more / slider->fading};
}

/* most friction per unit of the normal force at rest, of a slider or a second direction */
static double grip(const Flow *fl, int s)
{
    if (is_second(fl, s)) return stop_of(fl, s)->rub;
    return stop_of(fl, s)->friction + stop_of(fl, s)->adhesion;
}

/* whether that drops at once as it begins to slide */
static bool drops_at_once(const Flow *fl, int s)
{
    return is_slider(fl, s) && stop_of(fl, s)->adhesion > 0.0 && stop_of(fl, s)->fading == 0.0;
}

/* whether a stop with a dashpot lets go where its force would pull */
static bool never_pulls(const Flow *fl, int s) { return stop_of(fl, s)->release >= 0.0; }

/* force of a bond, Σ k_j u^j + (drag u² + cubic u'²) u', and its two derivatives */
static Force bond_law(const Flow *fl, int s, double u, double speed)
{
    const Stop *bond = stop_of(fl, s);
    const double *numbers = (const double *)bond;
    double secant = 0.0, bend = 0.0; /* Σ k_j u^(j - 1), and its derivative */
    for (int c = fl->n_columns - 1; c >= FIRST_POWER; c--) {
        bend = bend * u + secant;
        secant = secant * u + numbers[c];
    }
    double viscosity = bond->drag * u * u + bond->cubic * speed * speed;
    return (Force){u * secant + viscosity * speed,
                   secant + u * bend + 2.0 * bond->drag * u * speed,
                   viscosity + 2.0 * bond->cubic * speed * speed};
}

/* coefficient of restitution of a rigid stop at an impact speed, and its derivative by it */
static Value restitution_at(const Flow *fl, int s, double speed)
{
    if (fl->laws[s] == 0) return (Value){stop_of(fl, s)->restitution, 0.0};
    Force found = call_law(fl->laws[s], 0.0, speed);
    return (Value){found.force, found.viscosity};
}

/* force of a stop that is closed */
static Force pressing_law(const Flow *fl, int s, double delta, double speed)
{
    if (fl->laws[s] != 0) return call_law(fl->laws[s], delta, speed);
    return power_law(stop_of(fl, s), delta, speed);
}

/* force of a slider, pressed on by a normal force, and its derivatives, those by that force apart */
static Force sliding_law(const Flow *fl, int s, double speed, double normal)
{
    Value by = friction_at(fl, s, speed);
    return (Force){by.value * normal, 0.0, by.slope * normal};
}

/* contact force of an elastic stop and its derivatives by penetration and speed */
static Force law(const Flow *fl, int s, double delta, double speed)
{
    const Stop *stop = stop_of(fl, s);
    Force none = {0.0, 0.0, 0.0};
    if (is_mover(fl, s)) return none; /* see `disc_law` */
    if (is_bond(fl, s)) return bond_law(fl, s, delta, speed);
    if (is_strained(fl, s))
        return (Force){stop->tangential * delta, stop->tangential, 0.0};
    if (is_slider(fl, s)) return sliding_law(fl, s, speed, stop->pressing);
    if (delta <= 0.0 || is_rigid(fl, s)) return none;
    if (never_pulls(fl, s) && stop->stiffness * delta < -stop->dashpot * speed) return none;
    return pressing_law(fl, s, delta, speed);
}

/* The same within a panel on which the stop is closed. There a law whose slope sets in almost at
 * once goes on beyond the switch, as an odd function: the outermost node may come to lie on its
 * other side, and would drop the whole stiffness. So does a dashpot. What is held makes the
 * acceleration vanish, which stands in for the penetration. */
static Force closed_law(const Flow *fl, int s, double delta, double speed)
{
    const Stop *stop = stop_of(fl, s);
    if (is_held(fl, s)) return (Force){delta / stop->mobility, 1.0 / stop->mobility, 0.0};
    if (is_bond(fl, s) || is_slider(fl, s) || is_mover(fl, s)) return law(fl, s, delta, speed);
    if (delta > 0.0) return pressing_law(fl, s, delta, speed);
    double dashpot = stop->dashpot;
    if (stop->exponent < ROUND) {
        Force odd = pressing_law(fl, s, -delta, speed);
        return (Force){2.0 * dashpot * speed - odd.force, odd.stiffness,
                       2.0 * dashpot - odd.viscosity};
    }
    return (Force){dashpot * speed, 0.0, dashpot};
}

/* the same at m nodes; `speed` and `viscosity` are missing where no force depends on speeds */
static void closed_laws(const Flow *fl, int s, int m, const double *delta, const double *speed,
                        double *restrict force, double *restrict stiffness,
                        double *restrict viscosity)
{
    const Stop *stop = stop_of(fl, s);
    bool plain = fl->laws[s] == 0 && !is_rigid(fl, s) && !is_bond(fl, s) && !speed;
    if (plain && stop->exponent == 1.0) {
        for (int i = 0; i < m; i++) {
            force[i] = stop->stiffness * delta[i];
            stiffness[i] = stop->stiffness;
        }
        return;
    }
    if (plain && stop->exponent == 1.5) { /* several roots at once */
        for (int i = 0; i < m; i++) {
            double depth = larger(delta[i], 0.0), slope = stop->stiffness * sqrt(depth);
            force[i] = slope * depth;
            stiffness[i] = stop->exponent * slope;
        }
        return;
    }
    for (int i = 0; i < m; i++) {
        Force f = closed_law(fl, s, delta[i], speed ? speed[i] : 0.0);
        force[i] = f.force;
        stiffness[i] = f.stiffness;
        if (viscosity) viscosity[i] = f.viscosity;
    }
}

/* whether a force depends on the speed of penetration, as far as one knows */
static bool depends_on_speed(const Flow *fl, int s)
{
    const Stop *stop = stop_of(fl, s);
    bool lossy = stop->dissipation != 0.0 || stop->dashpot != 0.0 || stop->drag != 0.0 ||
                 stop->cubic != 0.0;
    return !is_rigid(fl, s) && (fl->laws[s] != 0 || lossy);
}

/* whether column c of the parameters is a number of a stop or slider, or of the area that it belongs
 * to */
static bool is_number_of(const Flow *fl, int c, int s)
{
    int64_t column = fl->parameters[2 * c], index = fl->parameters[2 * c + 1];
    if (is_mate(fl, s)) s = (int)stop_of(fl, s)->beside;
    if (index >= -1) return index == s;
    return (int64_t)stop_of(fl, s)->area == -2 - index && is_slider(fl, s) == (column == FRICTION);
}

/* whether column c of the parameters is a stop's own number */
static bool is_parameter(const Flow *fl, int c, int64_t column, int stop)
{
    return fl->parameters[2 * c] == column && is_number_of(fl, c, stop);
}

/* fill sensitivities (n_columns,) of a penetration at present, a time t after the start */
static void depth_columns(const Motion *M, int stop, double phase, double t, double *found)
{
    const Flow *fl = M->fl;
    output_columns(fl, stop, 0, phase, t, M->columns, M->n_columns, found);
    for (int c = 0; c < fl->n_parameters; c++)
        if (is_parameter(fl, c, GAP, stop)) found[fl->size + c] -= 1.0;
}

/* change of a stop's number in a column with column c of the parameters, which is that number of
 * the stop or of its area */
static double share_in(const Flow *fl, int c, int s)
{
    bool of_area = fl->parameters[2 * c + 1] <= -2 && fl->parameters[2 * c] == STIFFNESS;
    return of_area ? stop_of(fl, s)->share : 1.0;
}

/* whether it does, or is to be differentiated by what makes it do so */
static bool needs_speed(const Flow *fl, int s)
{
    bool needed = depends_on_speed(fl, s) || is_slider(fl, s); /* whose rate tells when it sticks */
    needed = needed || stop_of(fl, s)->rub != 0.0;             /* or turns */
    for (int c = 0; c < fl->n_parameters; c++) {
        int64_t column = fl->parameters[2 * c];
        bool viscous = column == DISSIPATION || column == DASHPOT || column == RUB;
        needed = needed || (viscous && is_number_of(fl, c, s));
    }
    return needed;
}

/* derivative of a stop's force with respect to its own number in a column of `stops` */
static double law_by(const Flow *fl, int s, int64_t column, double delta, double speed)
{
    const Stop *stop = stop_of(fl, s);
    if (column >= FIRST_POWER) return pow(delta, (double)(column - FIRST_POWER + 1));
    Force found = closed_law(fl, s, delta, speed);
    if (column == GAP) return -found.stiffness;
    if (column == DASHPOT) return speed;
    double force = found.force - stop->dashpot * speed;
    if (column == STIFFNESS) return force / stop->stiffness;
    if (column == EXPONENT) return delta > 0.0 ? force * log(delta) : 0.0;
    return speed * force / (1.0 + stop->dissipation * speed); /* column == DISSIPATION */
}

/* whether the slope of a stop's force is singular at its switch */
static bool singular_slope(const Flow *fl, int s)
{
    double exponent = stop_of(fl, s)->exponent;
    bool broken = fl->laws[s] != 0 || exponent != floor(exponent);
    return broken && !is_rigid(fl, s) && !is_second(fl, s);
}
