/* Rotations of coordinates between the factors of a product of matrices. */
#include "engine.h"

#define SQUARE_LOST 1e-150 /* a length whose square underflows */

/* factors (k, n, n), at work */
typedef struct {
    double *entries, *turns; /* turns: (n, 2) scratch */
    int k, n;
    Watch *watch; /* none where they are small */
} Factors;

static bool ended(const Factors *A) { return A->watch && interrupted(A->watch); }

typedef struct {
    double cosine, sine;
} Rotation;

static inline double *entry(const Factors *A, int j, int r, int c)
{
    return A->entries + ((size_t)j * A->n + r) * A->n + c;
}

/* the rotation that takes (a, b) to (r, 0) */
static Rotation rotation(double a, double b)
{
    if (b == 0.0) return (Rotation){1.0, 0.0};
    double r = sqrt(a * a + b * b);
    if (r < SQUARE_LOST) r = hypot(a, b);
    return (Rotation){a / r, b / r};
}

/* turn rows i and i + 1 of factor j in the columns from `first` to `last` */
static void turn_rows(const Factors *A, int j, int i, Rotation turn, int first, int last)
{
    double *up = entry(A, j, i, 0), *down = entry(A, j, i + 1, 0);
    for (int c = first; c <= last; c++) {
        double a = up[c], b = down[c];
        up[c] = turn.cosine * a + turn.sine * b;
        down[c] = turn.cosine * b - turn.sine * a;
    }
}

/* turn columns i and i + 1 of factor j in the rows from `first` to `last` */
static void turn_columns(const Factors *A, int j, int i, Rotation turn, int first, int last)
{
    for (int r = first; r <= last; r++) {
        double *row = entry(A, j, r, i), a = row[0], b = row[1];
        row[0] = turn.cosine * a + turn.sine * b;
        row[1] = turn.cosine * b - turn.sine * a;
    }
}

static bool is_singular(const Factors *A, int j, int i)
{
    return *entry(A, j, i, i) == 0.0 || *entry(A, j, i + 1, i + 1) == 0.0;
}

/* turn the coordinates before triangular factor j; the rotation behind it that keeps it so. A zero
 * on the diagonal moves on and stays exact. */
static Rotation pass_on(const Factors *A, int j, int i, Rotation turn, int lo, int hi)
{
    bool singular = is_singular(A, j, i);
    turn_columns(A, j, i, turn, lo, i + 1);
    turn = rotation(*entry(A, j, i, i), *entry(A, j, i + 1, i));
    turn_rows(A, j, i, turn, i, hi);
    *entry(A, j, i + 1, i) = 0.0;
    if (singular) *entry(A, j, i + 1, i + 1) = 0.0;
    return turn;
}

/* turn the coordinates behind triangular factor j; the rotation before it that keeps it so */
static Rotation pass_back(const Factors *A, int j, int i, Rotation turn, int lo, int hi)
{
    bool singular = is_singular(A, j, i);
    turn_rows(A, j, i, turn, i, hi);
    turn = rotation(*entry(A, j, i + 1, i + 1), -*entry(A, j, i + 1, i));
    turn_columns(A, j, i, turn, lo, i + 1);
    *entry(A, j, i + 1, i) = 0.0;
    if (singular) *entry(A, j, i, i) = 0.0;
    return turn;
}

/* Turn coordinates i and i + 1 behind H, and so on around all factors to H again. Only the diagonal
 * blocks from `lo` to `hi` are kept up to date. Left of column `left` the two rows of H are zero,
 * and below row `bottom` the two columns. */
static void turn_around(const Factors *A, int i, Rotation turn, int left, int bottom, int lo,
                        int hi)
{
    int h = A->k - 1;
    turn_rows(A, h, i, turn, left, hi);
    for (int j = 0; j < h; j++) turn = pass_on(A, j, i, turn, lo, hi);
    turn_columns(A, h, i, turn, lo, bottom);
}

/* make H[i + 1, column] zero by turning coordinates i and i + 1; the column lies before i */
static void annihilate(const Factors *A, int i, int column, int bottom, int lo, int hi)
{
    int h = A->k - 1;
    Rotation turn = rotation(*entry(A, h, i, column), *entry(A, h, i + 1, column));
    turn_around(A, i, turn, column, bottom, lo, hi);
    *entry(A, h, i + 1, column) = 0.0;
}

/* make all factors but the last upper triangular, and that upper Hessenberg */
static void reduce(const Factors *A)
{
    int hi = A->n - 1;
    for (int j = 0; j < A->k - 1; j++)
        for (int c = 0; c < hi && !ended(A); c++)
            for (int i = hi - 1; i >= c; i--) {
                Rotation turn = rotation(*entry(A, j, i, c), *entry(A, j, i + 1, c));
                turn_rows(A, j, i, turn, c, hi);
                *entry(A, j, i + 1, c) = 0.0;
                turn_columns(A, j + 1, i, turn, 0, hi);
            }
    for (int c = 0; c < hi - 1 && !ended(A); c++)
        for (int i = hi - 1; i > c; i--) annihilate(A, i, c, hi, 0, hi);
}
