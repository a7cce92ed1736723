/* Numbers: constants, the larger of two, complex numbers, 2 by 2 matrices. */
#ifndef NLDYN_NUMBERS_H
#define NLDYN_NUMBERS_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PI 3.14159265358979323846
#define TINY 1e-300 /* in place of a divisor that is zero: the quotient stays finite */
#define SLACK 1e-9  /* relative difference of two numbers that were meant to be one */

/* the larger one; of a number and nan the first of the two */
static inline double larger(double a, double b) { return b > a ? b : a; }

static inline double smaller(double a, double b) { return b < a ? b : a; }

static inline int64_t larger_index(int64_t a, int64_t b) { return b > a ? b : a; }

/* of two numbers whose squares neither overflow nor matter where they vanish */
static inline double length_of(double a, double b) { return sqrt(a * a + b * b); }

static inline double squared(double x) { return x * x; }

static inline double cubed(double x) { return x * x * x; }

typedef struct {
    double re, im;
} Complex;

static inline Complex complex_of(double re, double im) { return (Complex){re, im}; }

static inline Complex sum(Complex a, Complex b) { return complex_of(a.re + b.re, a.im + b.im); }

static inline Complex minus(Complex a, Complex b) { return complex_of(a.re - b.re, a.im - b.im); }

static inline Complex product(Complex a, Complex b)
{
    return complex_of(a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re);
}

static inline Complex scaled(double s, Complex a) { return complex_of(s * a.re, s * a.im); }

/* i s a */
static inline Complex quarter_turned(double s, Complex a)
{
    return complex_of(-s * a.im, s * a.re);
}

/* a / b without overflow of |b|² [Smith 1962] */
static inline Complex quotient(Complex a, Complex b)
{
    if (fabs(b.re) >= fabs(b.im)) {
        double ratio = b.im / b.re, divisor = b.re + b.im * ratio;
        return complex_of((a.re + a.im * ratio) / divisor, (a.im - a.re * ratio) / divisor);
    }
    double ratio = b.re / b.im, divisor = b.re * ratio + b.im;
    return complex_of((a.re * ratio + a.im) / divisor, (a.im * ratio - a.re) / divisor);
}

static inline double modulus(Complex a) { return hypot(a.re, a.im); }

/* e^{i phase} */
static inline Complex turned(double phase) { return complex_of(cos(phase), sin(phase)); }

/* entries of a 2 by 2 matrix, row by row */
typedef struct {
    double a, b, c, d;
} Square;

/* a double that depends on one number, and its derivatives by it or by two */
typedef struct {
    double value, slope;
} Value;

#endif
