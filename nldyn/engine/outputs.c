/* Outputs of a state: values, rates, rounding errors, sensitivities. */
#include "engine.h"

#define UNMOVED 1e-14 /* of the largest: what a stop pushes a mode by that is rounding */

/* value, two time derivatives, and bound of the third over a period, of an output's terms */
static Course swelling(const Flow *fl, int out, double phase)
{
    Course found = {0.0, 0.0, 0.0, 0.0};
    for (int k = 0; k < fl->n_terms; k++) {
        Complex share = forced_of(fl, 1 + k, 0, out);
        TermCourse e = term_at(fl->terms + k, fl->omega, phase);
        found.value += product(share, e.value).re;
        found.first += product(share, e.first).re;
        found.second += product(share, e.second).re;
        found.bound += modulus(share) * third_bound(fl->terms + k, fl->omega, phase);
    }
    return found;
}

/* change of an output's terms in a time t from a phase on, to its own precision */
static double swollen(const Flow *fl, int out, double phase, double t)
{
    double change = 0.0;
    for (int k = 0; k < fl->n_terms; k++)
        change += product(forced_of(fl, 1 + k, 0, out),
                          term_change(fl->terms + k, fl->omega, phase, t)).re;
    return change;
}

/* add the derivatives of an output's terms at time t after a fixed phase: of their values, rates
 * (order 1) or accelerations; `phase` is that at the time. sums (n_columns,) ends with the columns
 * of the parameters and of ω. */
static void add_swelling_by(const Flow *fl, int out, int order, double phase, double t,
                            double factor, double *sums, int n_columns)
{
    int last = n_columns - 1, first = last - fl->n_parameters;
    for (int k = 0; k < fl->n_terms; k++) {
        TermCourse value = term_at(fl->terms + k, fl->omega, phase);
        TermCourse by = term_by_omega(fl->terms + k, fl->omega, phase, t);
        Complex e = order == 0 ? value.value : order == 1 ? value.first : value.second;
        Complex d = order == 0 ? by.value : order == 1 ? by.first : by.second;
        sums[last] += factor * (product(forced_of(fl, 1 + k, 1, out), e).re +
                                product(forced_of(fl, 1 + k, 0, out), d).re);
        for (int c = first; c < last; c++)
            sums[c] += factor * product(forced_of(fl, 1 + k, 2 + c - first, out), e).re;
    }
}

/* the same of the whole response to the excitation */
static void add_forced_by(const Flow *fl, int out, int order, double phase, double t,
                          double factor, double *sums, int n_columns)
{
    int last = n_columns - 1, first = last - fl->n_parameters;
    Complex turn = turned(phase), steady = product(forced_of(fl, 0, 0, out), turn);
    Complex pace = {1.0, 0.0}, slope = {0.0, 0.0}; /* (iω)^order and its derivative */
    if (order == 1) {
        pace = complex_of(0.0, fl->omega);
        slope = complex_of(0.0, 1.0);
    } else if (order == 2) {
        pace = complex_of(-fl->omega * fl->omega, 0.0);
        slope = complex_of(-2.0 * fl->omega, 0.0);
    }
    Complex by = sum(product(forced_of(fl, 0, 1, out), turn), quarter_turned(t, steady));
    sums[last] += factor * (product(pace, by).re + product(slope, steady).re);
    for (int c = first; c < last; c++) {
        Complex share = product(pace, forced_of(fl, 0, 2 + c - first, out));
        sums[c] += factor * product(share, turn).re;
    }
    if (fl->n_terms > 0) add_swelling_by(fl, out, order, phase, t, factor, sums, n_columns);
}

/* sensitivities (n_columns,) of an output, its rate or acceleration in flight (order 0 to 2), at a
 * time t after a fixed phase; `phase` is that at the time */
static void output_columns(const Flow *fl, int out, int order, double phase, double t,
                           const double *columns, int n_columns, double *found)
{
    const double *row = row_of(fl, order, out);
    for (int c = 0; c < n_columns; c++) found[c] = 0.0;
    for (int k = 0; k < fl->size; k++)
        for (int c = 0; c < n_columns; c++) found[c] += row[k] * columns[(size_t)k * n_columns + c];
    add_forced_by(fl, out, order, phase, t, 1.0, found, n_columns);
}

/* add sign times the terms to the state w (2n,) and their derivatives to its last columns */
static void add_growth(const Flow *fl, double phase, double sign, double *w, double *columns,
                       int n_columns)
{
    int last = n_columns - 1, first = last - fl->n_parameters;
    for (int k = 0; k < fl->n_terms; k++) {
        Complex e = scaled(sign, term_at(fl->terms + k, fl->omega, phase).value);
        Complex d = scaled(sign, term_by_omega(fl->terms + k, fl->omega, phase, 0.0).value);
        const Complex *by = response_of(fl, 1 + k, 0);
        for (int i = 0; i < fl->size; i++) {
            double *row = columns + (size_t)i * n_columns;
            w[i] += product(by[i], e).re;
            row[last] += product(by[fl->size + i], e).re + product(by[i], d).re;
            for (int c = first; c < last; c++)
                row[c] += product(by[(size_t)(2 + c - first) * fl->size + i], e).re;
        }
    }
}

/* `turned` of a phase, which is often one of the last two */
static Complex turn_at(const Flow *fl, double phase)
{
    Turn *last = fl->turns;
    if (phase == last[0].phase) return last[0].turn;
    Turn other = last[1];
    last[1] = last[0];
    last[0] = phase == other.phase ? other : (Turn){phase, turned(phase)};
    return last[0].turn;
}

/* value and first two time derivatives of an output at present */
static Course output_now(const Flow *fl, int out, const double *w, double phase)
{
    double omega = fl->omega;
    Complex turn = product(forced_of(fl, 0, 0, out), turn_at(fl, phase));
    Course found = {turn.re, -omega * turn.im, -omega * omega * turn.re, 0.0};
    const double *row0 = row_of(fl, 0, out), *row1 = row_of(fl, 1, out), *row2 = row_of(fl, 2, out);
    for (int k = 0; k < fl->size; k += 2) {
        found.value += row0[k] * w[k] + row0[k + 1] * w[k + 1];
        found.first += row1[k] * w[k] + row1[k + 1] * w[k + 1];
        found.second += row2[k] * w[k] + row2[k + 1] * w[k + 1];
    }
    if (fl->n_terms > 0) {
        Course more = swelling(fl, out, phase);
        found.value += more.value;
        found.first += more.first;
        found.second += more.second;
    }
    return found;
}

/* value and first two time derivatives of an output, and a bound on the third, after a time t; the
 * bound holds for one excitation period at least */
static Course output_after(const Flow *fl, int out, const double *w, double phase, double t)
{
    double omega = fl->omega;
    Complex turn = product(forced_of(fl, 0, 0, out), turned(phase + omega * t));
    Course found = {turn.re, -omega * turn.im, -omega * omega * turn.re,
                    length_of(turn.re, turn.im) * cubed(omega)};
    const double *row0 = row_of(fl, 0, out), *row1 = row_of(fl, 1, out), *row2 = row_of(fl, 2, out);
    const double *bound3 = fl->bound3 + (size_t)out * fl->size;
    for (int b = 0; b < fl->n; b++) {
        int j = 2 * b;
        double x = w[j], y = w[j + 1];
        const double *block = block_of(fl, b);
        if (t != 0.0) {
            Square e = block_exponential(block, t);
            double moved = e.a * x + e.b * y;
            y = e.c * x + e.d * y;
            x = moved;
        }
        found.value += row0[j] * x + row0[j + 1] * y;
        found.first += row1[j] * x + row1[j + 1] * y;
        found.second += row2[j] * x + row2[j + 1] * y;
        if (block[1] == 0.0 && block[2] == 0.0) /* two decays */
            found.bound += bound3[j] * fabs(x) + bound3[j + 1] * fabs(y);
        else
            found.bound += length_of(bound3[j], bound3[j + 1]) * length_of(x, y);
    }
    if (fl->n_terms > 0) {
        Course more = swelling(fl, out, phase + omega * t);
        found.value += more.value;
        found.first += more.first;
        found.second += more.second;
        found.bound += more.bound;
    }
    return found;
}

/* speed that a unit impulse at another stop takes from the closing of a stop's gap, in 1/kg */
static double between(const Flow *fl, int stop, int other)
{
    double mobility = 0.0;
    const double *row = row_of(fl, 1, stop), *push = push_of(fl, other);
    for (int k = 0; k < fl->size; k++) mobility += row[k] * push[k];
    return mobility;
}

/* size of a term of the response in an output */
static double forced_size(const Flow *fl, int term, int out)
{
    Complex share = forced_of(fl, term, 0, out);
    return length_of(share.re, share.im);
}

/* sum of the sizes of an output's terms (order 0), or those of its rate or acceleration */
static double output_size(const Flow *fl, int out, const double *w, int order)
{
    double omega = fl->omega, pace = order == 0 ? 1.0 : order == 1 ? omega : omega * omega;
    double total = forced_size(fl, 0, out) * pace;
    for (int k = 0; k < fl->n_terms; k++) {
        Value sizes = term_sizes(fl->terms + k, omega);
        double share = order == 0 ? sizes.value : sizes.slope * (order == 1 ? 1.0 : omega);
        total += forced_size(fl, 1 + k, out) * share;
    }
    const double *row = row_of(fl, order, out);
    for (int j = 0; j < fl->size; j++) total += fabs(row[j] * w[j]);
    return total;
}

/* rounding error to expect in an output: 4 units in the last place of its terms */
static double output_noise(const Flow *fl, int out, const double *w)
{
    return SUM_ROUNDING * output_size(fl, out, w, 0);
}

/* the same in the output's rate */
static double rate_noise(const Flow *fl, int out, const double *w)
{
    return SUM_ROUNDING * output_size(fl, out, w, 1);
}

/* the same in a penetration that is carried on from a depth over a time h */
static double carried_noise(const Flow *fl, int stop, const double *w, double depth, double h)
{
    double change = forced_size(fl, 0, stop) * fl->omega * h;
    for (int k = 0; k < fl->n_terms; k++)
        change += h * forced_size(fl, 1 + k, stop) *
                  term_sizes(fl->terms + k, fl->omega).slope;
    const double *row1 = row_of(fl, 1, stop), *row2 = row_of(fl, 2, stop);
    for (int j = 0; j < fl->size; j++)
        change += h * (fabs(row1[j]) + h * fabs(row2[j])) * fabs(w[j]);
    return SUM_ROUNDING * (fabs(depth) + change);
}

/* largest |eigenvalue|, in 1/s, of the blocks that stops move by more than rounding */
static double fastest_moved(const System *sys)
{
    double fastest = 0.0, least = 0.0;
    size_t width = (size_t)sys->n_stops;
    for (size_t i = 0; i < 2 * (size_t)sys->n * width; i++) least = larger(least, fabs(sys->force[i]));
    least *= UNMOVED;
    for (int b = 0; b < sys->n; b++) {
        double moved = 0.0;
        for (size_t i = 2 * b * width; i < (2 * b + 2) * width; i++) moved += fabs(sys->force[i]);
        if (!(moved > least)) continue;
        const double *block = sys->blocks + 4 * b;
        double mean = 0.5 * (block[0] + block[3]), half = block[0] - block[3];
        double square = 0.25 * half * half + block[1] * block[2], rate = sqrt(fabs(square));
        fastest = larger(fastest, square < 0.0 ? hypot(mean, rate) : fabs(mean) + rate);
    }
    return fastest;
}

/* response of an output to the excitation at a forcing phase */
static double forced_output(const Flow *fl, int out, double phase)
{
    double value = fl->n_terms > 0 ? swelling(fl, out, phase).value : 0.0;
    return value + product(forced_of(fl, 0, 0, out), turned(phase)).re;
}

/* output of the homogeneous state w after a flight of duration t */
static double free_output(const Flow *fl, int out, const double *w, double t)
{
    double value = 0.0;
    const double *row = row_of(fl, 0, out);
    for (int b = 0; b < fl->n; b++) {
        int j = 2 * b;
        Square e = block_exponential(block_of(fl, b), t);
        value += row[j] * (e.a * w[j] + e.b * w[j + 1]);
        value += row[j + 1] * (e.c * w[j] + e.d * w[j + 1]);
    }
    return value;
}
