/* Functions of time that the response to excitation is made of, beside the steady one. */
#include "engine.h"

#define LINEAR 1e-18 /* |x|² below which (exp(x) - 1)/x is 1 + x/2 to all digits */

/* value and first two time derivatives of a term */
typedef struct {
    Complex value, first, second;
} TermCourse;

/* ∫ exp(rate u) du from 0 to t for a complex rate, to full precision also where it is small */
static Complex from_rest(Complex rate, double t)
{
    double x = rate.re * t, y = rate.im * t, square = x * x + y * y;
    if (square < LINEAR) return complex_of(t + 0.5 * t * x, 0.5 * t * y);
    double half = sin(0.5 * y), size = expm1(x);
    double real = size * cos(y) - 2.0 * half * half, imag = (size + 1.0) * sin(y);
    double share = t / square;
    return complex_of((real * x + imag * y) * share, (imag * x - real * y) * share);
}

/* solution of e' = rate e + e^{iωt} at rest at phase zero, for a rate near iω:
 * e = (e^{rate t} - e^{iωt})/(rate - iω) without its cancellation; at resonance t e^{iωt} */
static Complex growth(Complex rate, double omega, double phase)
{
    Complex off = complex_of(rate.re, rate.im - omega);
    return product(turned(phase), from_rest(off, phase / omega));
}

/* derivative of `growth` with respect to ω at a fixed phase: with off = rate - iω it is
 * e^{iφ} ∫ exp(off u) du from 0 to t = φ/ω, and its derivative
 * -e^{iφ} (i ∫ u exp(off u) du + exp(off t) t/ω) */
static Complex growth_by_omega(Complex rate, double omega, double phase)
{
    Complex e = growth(rate, omega, phase), turn = turned(phase);
    double t = phase / omega;
    Complex off = complex_of(rate.re, rate.im - omega), x = scaled(t, off);
    Complex end = scaled(exp(x.re), turned(x.im)), by_rate = {0.0, 0.0};
    if (modulus(x) > 1.0) {
        by_rate = quotient(minus(product(scaled(t, end), turn), e), off);
    } else {
        Complex power = scaled(t * t, turn);
        for (int j = 0; j < 18; j++) {
            by_rate = sum(by_rate, scaled(1.0 / (j + 2), power));
            power = scaled(1.0 / (j + 1), product(power, x));
        }
    }
    return minus(quarter_turned(-1.0, by_rate), scaled(t / omega, product(end, turn)));
}

/* scalars f and f_on with exp(At) = f + f_on A, and e and e_on of their integrals from 0 to t */
typedef struct {
    double f, f_on, e, e_on;
} Drift;

/* A is any 2 by 2 matrix of that trace and determinant: by the series of its divided differences
 * at a t so small that it converges, and then by doubling, ∫₀²ᵗ = (1 + exp(At)) ∫₀ᵗ */
static Drift drift(double trace, double determinant, double t)
{
    double size = (fabs(trace) + sqrt(fabs(determinant))) * fabs(t);
    int halvings = 0;
    for (; size > 0.5 && halvings < 2100; size *= 0.5) halvings++;
    double s = ldexp(t, -halvings), h_old = 0.0, h = 1.0, power = s;
    Drift d = {0.0, 0.0, 0.0, 0.0};
    for (int j = 0; j < 16; j++) {
        d.f_on += h * power;
        power *= s / (j + 2);
        d.e_on += h * power;
        double next = trace * h - determinant * h_old;
        h_old = h;
        h = next;
    }
    d.f = 1.0 - determinant * d.e_on;
    d.e = d.f_on - trace * d.e_on;
    for (int i = 0; i < halvings; i++)
        d = (Drift){d.f * d.f - determinant * d.f_on * d.f_on,
                    2.0 * d.f * d.f_on + trace * d.f_on * d.f_on,
                    d.e + d.f * d.e - determinant * d.f_on * d.e_on,
                    d.e_on + d.f * d.e_on + d.f_on * d.e + trace * d.f_on * d.e_on};
    return d;
}

/* a term that was at rest a time t ago, if it is no steady one; the phase is that at its end */
static TermCourse term_since(const Term *term, double omega, double phase, double t)
{
    double pace = term->order * omega;
    Complex rate = term->rate, turn = turned(term->order * phase);
    if (term->kind == STEADY)
        return (TermCourse){turn, quarter_turned(pace, turn), scaled(-pace * pace, turn)};
    if (term->kind == GROWTH) {
        Complex e = product(turn, from_rest(complex_of(rate.re, rate.im - pace), t));
        Complex first = sum(product(rate, e), turn);
        return (TermCourse){e, first, sum(product(rate, first), quarter_turned(pace, turn))};
    }
    Drift d = drift(rate.re, rate.im, t);
    if (term->kind == DRIFT)
        return (TermCourse){complex_of(d.e, 0.0), complex_of(d.f, 0.0),
                            complex_of(-rate.im * d.f_on, 0.0)};
    return (TermCourse){complex_of(d.e_on, 0.0), complex_of(d.f_on, 0.0),
                        complex_of(d.f + rate.re * d.f_on, 0.0)};
}

static TermCourse term_at(const Term *term, double omega, double phase)
{
    return term_since(term, omega, phase, phase / omega);
}

/* derivatives with respect to ω of a term, its rate and acceleration, t after a fixed phase;
 * `phase` is that at the time */
static TermCourse term_by_omega(const Term *term, double omega, double phase, double t)
{
    double order = term->order, pace = order * omega;
    TermCourse e = term_at(term, omega, phase);
    if (term->kind == STEADY) {
        Complex by = quarter_turned(order * t, e.value);
        Complex first = sum(quarter_turned(order, e.value), quarter_turned(pace, by));
        Complex twice = sum(quarter_turned(2.0 * order, e.value), quarter_turned(pace, by));
        return (TermCourse){by, first, quarter_turned(pace, twice)};
    }
    if (term->kind == GROWTH) {
        Complex turn = turned(order * phase), rate = term->rate;
        Complex by = scaled(order, growth_by_omega(rate, pace, order * phase));
        by = sum(by, scaled(t / omega, e.first));
        Complex by_rate = sum(product(rate, by), quarter_turned(order * t, turn));
        Complex more = product(complex_of(1.0, pace * t), turn);
        return (TermCourse){by, by_rate, sum(product(rate, by_rate), quarter_turned(order, more))};
    }
    double since = (t - phase / omega) / omega;
    Complex third = minus(scaled(term->rate.re, e.second), scaled(term->rate.im, e.first));
    return (TermCourse){scaled(since, e.first), scaled(since, e.second), scaled(since, third)};
}

/* change of a term in a time t from a phase on, to its own precision */
static Complex term_change(const Term *term, double omega, double phase, double t)
{
    double order = term->order, pace = order * omega;
    Complex rate = term->rate;
    if (term->kind == STEADY) return swung(turned(order * phase), pace * t);
    if (term->kind == GROWTH) {
        Complex e = growth(rate, pace, order * phase);
        Complex turn = product(turned(order * phase), turned(pace * t));
        Complex fresh = product(turn, from_rest(complex_of(rate.re, rate.im - pace), t));
        return sum(product(product(e, rate), from_rest(rate, t)), fresh);
    }
    /* (exp(At) - 1) ∫ + ∫ over t, with exp(At) - 1 = f_on A - determinant e_on */
    Drift old = drift(rate.re, rate.im, phase / omega), fresh = drift(rate.re, rate.im, t);
    if (term->kind == DRIFT)
        return complex_of(fresh.e - rate.im * (fresh.e_on * old.e + fresh.f_on * old.e_on), 0.0);
    return complex_of(fresh.e_on - rate.im * fresh.e_on * old.e_on +
                          fresh.f_on * (old.e + rate.re * old.e_on),
                      0.0);
}

/* sizes that a term (value) and its rate (slope) may have within a period from rest */
static Value term_sizes(const Term *term, double omega)
{
    double period = 2.0 * PI / omega;
    if (term->kind == STEADY) return (Value){1.0, term->order * omega};
    if (term->kind == GROWTH) return (Value){period, period * term->order * omega};
    if (term->kind == DRIFT) return (Value){period, 1.0};
    return (Value){0.5 * period * period, period};
}

/* bound on the third time derivative of a term within a period from a phase on: no eigenvalue
 * grows; a growth gains by at most the time that passes, and |f_on| <= t */
static double third_bound(const Term *term, double omega, double phase)
{
    double pace = term->order * omega;
    if (term->kind == STEADY) return cubed(pace);
    if (term->kind == GROWTH) {
        Complex e = growth(term->rate, pace, term->order * phase);
        double size = modulus(term->rate), later = modulus(e) + 2.0 * PI / omega;
        return size * size * (size * later + 1.0) + pace * (size + pace);
    }
    double t = (fabs(phase) + 2.0 * PI) / omega;
    double trace = fabs(term->rate.re), determinant = fabs(term->rate.im);
    double second = 1.0 + 0.5 * determinant * t * t + trace * t; /* of |f_on'| */
    return term->kind == DRIFT ? determinant * second : determinant * t + trace * second;
}
