/* Exponentials of 2 by 2 blocks. */
#include "engine.h"

#define SLOW_DECAY 0.35 /* exponent up to which `series_expm1` is exact */
#define WHOLE 6755399441055744.0 /* 1.5 2^52: a sum with it has no fraction */

/* exp(block t), also for equal or zero eigenvalues; without any it is 1 + block t */
static Square block_exponential(const double *block, double t)
{
    double mean = 0.5 * (block[0] + block[3]), half = 0.5 * (block[0] - block[3]);
    double square = half * half + block[1] * block[2], even, odd;
    if (mean == 0.0 && square == 0.0)
        return (Square){1.0 + t * half, t * block[1], t * block[2], 1.0 - t * half};
    if (square < 0.0) {
        double rate = sqrt(-square), size = exp(mean * t);
        even = size * cos(rate * t);
        odd = size * sin(rate * t) / rate;
    } else {
        double rate = sqrt(square);
        if (fabs(rate * t) < 1.0) {
            double size = exp(mean * t);
            even = size * cosh(rate * t);
            odd = size * (rate > 0.0 ? sinh(rate * t) / rate : t);
        } else {
            double up = exp((mean + rate) * t), down = exp((mean - rate) * t);
            even = 0.5 * (up + down);
            odd = 0.5 * (up - down) / rate;
        }
    }
    return (Square){even + odd * half, odd * block[1], odd * block[2], even - odd * half};
}

/* exp(block t), exp(-block t), and the diagonal of exp(block t) - 1 to its own precision */
typedef struct {
    Square there, back;
    double less_a, less_d;
} ThereAndBack;

/* of a block that swings: by its decay, and that less 1, and by the sine and cosine of half its
 * phase */
static inline ThereAndBack swung_there_and_back(const double *block, double rate, double less,
                                                double size, double s, double c)
{
    double half = 0.5 * (block[0] - block[3]);
    double swing = -2.0 * s * s, odd = 2.0 * s * c / rate; /* cos - 1, sin / rate */
    double even = 1.0 + swing, inverse = 1.0 / size;
    double a = odd * half, b = odd * block[1], d = odd * block[2];
    ThereAndBack both;
    both.there = (Square){size * (even + a), size * b, size * d, size * (even - a)};
    both.back = (Square){inverse * (even - a), -inverse * b, -inverse * d, inverse * (even + a)};
    both.less_a = less + size * (swing + a);
    both.less_d = less + size * (swing - a);
    return both;
}

static ThereAndBack there_and_back(const double *block, double t)
{
    double mean = 0.5 * (block[0] + block[3]), half = 0.5 * (block[0] - block[3]);
    double square = half * half + block[1] * block[2], rate = sqrt(fabs(square));
    if (mean == 0.0 && square == 0.0)
        return (ThereAndBack){block_exponential(block, t), block_exponential(block, -t), half * t,
                              -half * t};
    double less = expm1(mean * t), size = less > -0.5 ? 1.0 + less : exp(mean * t);
    if (square < 0.0)
        return swung_there_and_back(block, rate, less, size, sin(0.5 * rate * t),
                                    cos(0.5 * rate * t));
    double s = sinh(0.5 * rate * t), c = cosh(0.5 * rate * t);
    double swing = 2.0 * s * s, a = half * (rate > 0.0 ? 2.0 * s * c / rate : t);
    return (ThereAndBack){block_exponential(block, t), block_exponential(block, -t),
                          less + size * (swing + a), less + size * (swing - a)};
}

/* fill sines and cosines of x (m,), of up to 1e6; without calls, so that several go at once.
 * π/2 in three parts, of which multiples by whole numbers up to 2^20 are exact [Cody and Waite
 * 1980]; coefficients up to π/4 with errors below rounding [Ng, fdlibm 5.3]. */
static void fill_sines(const double *restrict x, double *restrict sine, double *restrict cosine,
                       int m)
{
    for (int i = 0; i < m; i++) {
        double k = (x[i] * (2.0 / PI) + WHOLE) - WHOLE;
        double r = ((x[i] - k * 1.57079632673412561417e00) - k * 6.07710050630396597660e-11) -
                   k * 2.02226624871116645580e-21;
        double z = r * r, s = 1.58969099521155010221e-10, c = -1.13596475577881948265e-11;
        s = -2.50507602534068634195e-08 + z * s, c = 2.08757232129817482790e-09 + z * c;
        s = 2.75573137070700676789e-06 + z * s, c = -2.75573143513906633035e-07 + z * c;
        s = -1.98412698298579493134e-04 + z * s, c = 2.48015872894767294178e-05 + z * c;
        s = 8.33333333332248946124e-03 + z * s, c = -1.38888888888741095749e-03 + z * c;
        s = -1.66666666666666324348e-01 + z * s, c = 4.16666666666666019037e-02 + z * c;
        s = r + r * z * s, c = 1.0 - (0.5 * z - z * z * c);
        double half = 0.5 * k;
        bool odd = half != (half + WHOLE) - WHOLE;
        double turns = odd ? 0.5 * (half - 0.5) : 0.5 * half;
        bool back = turns != (turns + WHOLE) - WHOLE;
        double a = odd ? c : s, b = odd ? -s : c;
        sine[i] = back ? -a : a;
        cosine[i] = back ? -b : b;
    }
}

/* replace x (m,), |x| < SLOW_DECAY, by exp(x) - 1, by its power series */
static void series_expm1(double *x, int m)
{
    for (int i = 0; i < m; i++) {
        double total = 0.0;
        for (int j = 15; j > 1; j--) total = x[i] * (1.0 / j) * (1.0 + total);
        x[i] = x[i] * (1.0 + total);
    }
}

/* fill what a swing needs at times (m,): e^{mean t}, that less 1, and sine and cosine of half its
 * phase */
static void fill_swings(double mean, double rate, const double *times, int m, double *decay,
                        double *less, double *sine, double *cosine)
{
    for (int i = 0; i < m; i++) {
        less[i] = mean * times[i]; /* for the time being */
        decay[i] = 0.5 * rate * times[i];
    }
    fill_sines(decay, sine, cosine, m);
    if (fabs(less[m - 1]) < SLOW_DECAY) {
        series_expm1(less, m);
        for (int i = 0; i < m; i++) decay[i] = 1.0 + less[i];
    } else {
        for (int i = 0; i < m; i++) {
            decay[i] = exp(less[i]);
            less[i] = expm1(less[i]);
        }
    }
}

/* fill exp(block t) (4, m), exp(-block t) (4, m) and the diagonal of exp(block t) - 1 (2, m), to
 * its own precision, at times (m,); waves (4, m) is scratch */
static void fill_there_and_back(const double *block, const double *times, int m,
                                double *restrict there, double *restrict back,
                                double *restrict less, double *restrict waves)
{
    double mean = 0.5 * (block[0] + block[3]), half = 0.5 * (block[0] - block[3]);
    double square = half * half + block[1] * block[2], rate = sqrt(fabs(square));
    if (square < 0.0) {
        double *w = waves;
        fill_swings(mean, rate, times, m, w, w + m, w + 2 * m, w + 3 * m);
        for (int i = 0; i < m; i++) {
            ThereAndBack e = swung_there_and_back(block, rate, w[m + i], w[i], w[2 * m + i],
                                                  w[3 * m + i]);
            there[i] = e.there.a, there[m + i] = e.there.b;
            there[2 * m + i] = e.there.c, there[3 * m + i] = e.there.d;
            back[i] = e.back.a, back[m + i] = e.back.b;
            back[2 * m + i] = e.back.c, back[3 * m + i] = e.back.d;
            less[i] = e.less_a, less[m + i] = e.less_d;
        }
        return;
    }
    for (int i = 0; i < m; i++) {
        ThereAndBack e = there_and_back(block, times[i]);
        there[i] = e.there.a, there[m + i] = e.there.b;
        there[2 * m + i] = e.there.c, there[3 * m + i] = e.there.d;
        back[i] = e.back.a, back[m + i] = e.back.b;
        back[2 * m + i] = e.back.c, back[3 * m + i] = e.back.d;
        less[i] = e.less_a, less[m + i] = e.less_d;
    }
}

/* move a pair of coordinates */
static void move_pair(Square by, double *pair)
{
    double x = pair[0], y = pair[1];
    pair[0] = by.a * x + by.b * y;
    pair[1] = by.c * x + by.d * y;
}

/* the same of two rows (count,) */
static void move_rows(Square by, double *restrict first, double *restrict second, int count)
{
    for (int c = 0; c < count; c++) {
        double x = first[c], y = second[c];
        first[c] = by.a * x + by.b * y;
        second[c] = by.c * x + by.d * y;
    }
}

/* product of two matrices */
static Square times(Square a, Square b)
{
    return (Square){a.a * b.a + a.b * b.c, a.a * b.b + a.b * b.d, a.c * b.a + a.d * b.c,
                    a.c * b.b + a.d * b.d};
}

/* advance a state (2n,) in place by a flight of duration t */
static void fly_state(const double *blocks, int n, double *w, double t)
{
    for (int b = 0; b < n; b++) move_pair(block_exponential(blocks + 4 * b, t), w + 2 * b);
}

/* advance sensitivities (2n, n_columns) in place by a flight of duration t */
static void fly_columns(const double *blocks, int n, double *columns, int n_columns, double t)
{
    for (int b = 0; b < n; b++) {
        double *first = columns + (size_t)2 * b * n_columns;
        move_rows(block_exponential(blocks + 4 * b, t), first, first + n_columns, n_columns);
    }
}

/* add the rates of change of w (2n,) in free vibration */
static void add_rates(const double *blocks, int n, const double *w, double *rate)
{
    for (int b = 0; b < n; b++) {
        const double *block = blocks + 4 * b;
        rate[2 * b] += block[0] * w[2 * b] + block[1] * w[2 * b + 1];
        rate[2 * b + 1] += block[2] * w[2 * b] + block[3] * w[2 * b + 1];
    }
}

/* change of a complex number as it turns by an angle, to its own precision */
static Complex swung(Complex turn, double angle)
{
    double s = sin(0.5 * angle), c = cos(0.5 * angle);
    return product(turn, complex_of(-2.0 * s * s, 2.0 * s * c));
}

/* the same for the tests of their last digits */
EXPORT void nldyn_sines(int64_t m, const double *x, double *sine, double *cosine)
{
    fill_sines(x, sine, cosine, (int)m);
}

EXPORT void nldyn_expm1(int64_t m, double *x) { series_expm1(x, (int)m); }
