/* A system at one excitation frequency: its response to what excites it. */
#include "engine.h"

/* |λ - iω| below this share of ω makes an eigenvalue λ near, see system/linear.py */
#define NEAR 3e-3

/* eigenvalue λ of a block with |λ - i pace| < NEAR pace, or zero */
static Complex near_rate(const double *block, double pace)
{
    double mean = 0.5 * (block[0] + block[3]), half = 0.5 * (block[0] - block[3]);
    double square = half * half + block[1] * block[2], rate = sqrt(fabs(square));
    bool near = square < 0.0 && hypot(mean, rate - pace) < NEAR * pace;
    return near ? complex_of(mean, rate) : complex_of(0.0, 0.0);
}

/* trace + i determinant of a block, and whether an eigenvalue of it is slow beside ω */
static Complex slow_rate(const double *block, double omega, bool *slow)
{
    double trace = block[0] + block[3], determinant = block[0] * block[3] - block[1] * block[2];
    double square = 0.25 * trace * trace - determinant, fastest = sqrt(fabs(determinant));
    if (square >= 0.0) fastest = 0.5 * fabs(trace) + sqrt(square);
    *slow = fastest == 0.0 || fabs(determinant) < NEAR * omega * fastest;
    return complex_of(trace, determinant);
}

/* the terms of a system's response beside the steady one at order 1: how many; `terms` may be
 * missing */
static int further_terms(const System *sys, double omega, Term *terms)
{
    int k = 0;
    for (int h = 1; h < sys->n_orders; h++, k++)
        if (terms) terms[k] = (Term){STEADY, sys->orders[h], {0.0, 0.0}};
    for (int h = 0; h < sys->n_orders; h++)
        for (int b = 0; b < sys->n; b++) {
            if (sys->orders[h] == 0.0) {
                bool slow;
                Complex rate = slow_rate(sys->blocks + 4 * b, omega, &slow);
                if (!slow) continue;
                if (terms) {
                    terms[k] = (Term){DRIFT, 0.0, rate};
                    terms[k + 1] = (Term){DRIFT_ON, 0.0, rate};
                }
                k += 2;
            } else {
                Complex rate = near_rate(sys->blocks + 4 * b, sys->orders[h] * omega);
                if (!(rate.im > 0.0)) continue;
                if (terms) terms[k] = (Term){GROWTH, sys->orders[h], rate};
                k++;
            }
        }
    return k;
}

/* place of a state's response in a term, in the row of a derivative */
typedef struct {
    Complex *response;
    int rows, size, row;
} Responses;

static inline Complex *response_in(const Responses *r, int term)
{
    return r->response + ((size_t)term * r->rows + r->row) * r->size;
}

/* response of one block to a constant drive (u, v); the first of the next block's drifts */
static int respond_constant(const double *block, double omega, Complex u, Complex v, int i,
                            int steady, int k, const Responses *r)
{
    bool slow;
    Complex rate = slow_rate(block, omega, &slow);
    if (slow) {
        response_in(r, k)[i] = u;
        response_in(r, k)[i + 1] = v;
        response_in(r, k + 1)[i] = sum(scaled(block[0], u), scaled(block[1], v));
        response_in(r, k + 1)[i + 1] = sum(scaled(block[2], u), scaled(block[3], v));
        return k + 2;
    }
    Complex *still = response_in(r, steady) + i;
    still[0] = scaled(1.0 / rate.im, minus(scaled(block[1], v), scaled(block[3], u)));
    still[1] = scaled(1.0 / rate.im, minus(scaled(block[2], u), scaled(block[0], v)));
    return k;
}

/* the same to a drive at a frequency `pace`: (i pace - A)⁻¹ (u, v), but for a near eigenvalue λ.
 * There the drive falls into its parts along the two eigenvectors: that of λ is the drive of the
 * growth, that of its conjugate has a steady response. */
static int respond_turning(const double *block, double pace, Complex u, Complex v, int i,
                           int steady, int k, const Responses *r)
{
    Complex *still = response_in(r, steady) + i, rate = near_rate(block, pace);
    if (rate.im > 0.0) {
        double half = 0.5 * (block[0] - block[3]), share = -0.5 / rate.im;
        Complex turn_u = sum(scaled(half, u), scaled(block[1], v));
        Complex turn_v = minus(scaled(block[2], u), scaled(half, v));
        Complex p = sum(scaled(0.5, u), quarter_turned(share, turn_u));
        Complex q = sum(scaled(0.5, v), quarter_turned(share, turn_v));
        Complex away = complex_of(-rate.re, pace + rate.im);
        response_in(r, k)[i] = p;
        response_in(r, k)[i + 1] = q;
        still[0] = quotient(minus(u, p), away);
        still[1] = quotient(minus(v, q), away);
        return k + 1;
    }
    Complex first = complex_of(-block[0], pace), last = complex_of(-block[3], pace);
    Complex det = minus(product(first, last), complex_of(block[1] * block[2], 0.0));
    still[0] = quotient(sum(product(last, u), scaled(block[1], v)), det);
    still[1] = quotient(sum(product(first, v), scaled(block[2], u)), det);
    return k;
}

/* drive of a coordinate at an order, or its derivative: row 0 itself, row 1 by ω, then by the
 * parameters */
static Complex drive_at(const System *sys, const Complex *drive_by, double omega, int h, int i,
                        const Responses *r)
{
    int size = r->size, row = r->row;
    const Complex *x = sys->drive + (size_t)h * 3 * size;
    if (row == 0)
        return sum(x[i], scaled(omega, sum(x[size + i], scaled(omega, x[2 * size + i]))));
    if (row == 1) {
        Complex by = sum(x[size + i], scaled(2.0 * omega, x[2 * size + i]));
        Complex here = r->response[(size_t)h * r->rows * size + i];
        return minus(by, quarter_turned(sys->orders[h], here));
    }
    const Complex *by = drive_by + ((size_t)(row - 2) * sys->n_orders + h) * 3 * size;
    return sum(by[i], scaled(omega, sum(by[size + i], scaled(omega, by[2 * size + i]))));
}

/* fill the response (1 + n_terms, 2 + n_parameters, 2n), which is zero */
static void fill_response(const System *sys, const Complex *drive_by, double omega, int rows,
                          Complex *response)
{
    int first = (int)sys->n_orders;
    for (int h = 0; h < sys->n_orders; h++) {
        int after = first;
        for (int row = 0; row < rows; row++) {
            Responses r = {response, rows, 2 * (int)sys->n, row};
            int k = first;
            for (int b = 0; b < sys->n; b++) {
                Complex u = drive_at(sys, drive_by, omega, h, 2 * b, &r);
                Complex v = drive_at(sys, drive_by, omega, h, 2 * b + 1, &r);
                const double *block = sys->blocks + 4 * b;
                double order = sys->orders[h];
                if (order == 0.0)
                    k = respond_constant(block, omega, u, v, 2 * b, h, k, &r);
                else
                    k = respond_turning(block, order * omega, u, v, 2 * b, h, k, &r);
            }
            after = k;
        }
        first = after;
    }
}

/* fill the response of the outputs from that of the state */
static void fill_forced(const Flow *fl)
{
    int rows = 2 + fl->n_parameters;
    for (int p = 0; p < (1 + fl->n_terms) * rows; p++)
        for (int out = 0; out < fl->n_out; out++) {
            const double *row = row_of(fl, 0, out);
            Complex total = {0.0, 0.0};
            for (int i = 0; i < fl->size; i++)
                total = sum(total, scaled(row[i], fl->response[(size_t)p * fl->size + i]));
            fl->forced[(size_t)p * fl->n_out + out] = total;
        }
}

static void uncouple(const Flow *fl);

/* numbers of the system at an excitation frequency (rad/s); the arrays of `fl` have their room */
static void at_frequency(const System *sys, double omega, const Complex *drive_by, Flow *fl)
{
    fl->omega = omega;
    fl->turns[0].phase = fl->turns[1].phase = NAN;
    fl->n_terms = further_terms(sys, omega, fl->terms);
    int rows = 2 + fl->n_parameters;
    memset(fl->response, 0, sizeof(Complex) * (1 + fl->n_terms) * rows * fl->size);
    fill_response(sys, drive_by, omega, rows, fl->response);
    if (fl->give) {
        fl->rows = fl->own_rows;
        fl->stops = fl->own_stops;
        uncouple(fl);
    } else {
        fill_forced(fl);
    }
    for (int s = 0; s < fl->n_stops; s++)
        for (int k = 0; k < fl->size; k++)
            fl->pushes[(size_t)s * fl->size + k] = sys->force[(size_t)k * fl->n_stops + s];
}
