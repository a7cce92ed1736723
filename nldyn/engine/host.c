/* The link to the program that called: other threads, Ctrl-C, BLAS. */
#include "engine.h"

#define PAUSE 0.05 /* s between two looks whether Ctrl-C was pressed */
#define LARGE 32   /* inner length from which a product of matrices is left to BLAS */

static double seconds_now(void)
{
    struct timespec now;
    timespec_get(&now, TIME_UTC);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* let other threads of the program run from now on */
static void begin_watch(Watch *watch, const Host *host)
{
    watch->host = host;
    watch->stopped = false;
    watch->next = seconds_now() + PAUSE;
    watch->thread = host->release ? host->release() : NULL;
}

static void end_watch(Watch *watch)
{
    if (watch->host->release) watch->host->acquire(watch->thread);
}

/* whether the call is to end; the program then knows why */
static bool interrupted(Watch *watch)
{
    if (watch->stopped || !watch->host->signalled) return watch->stopped;
    if (seconds_now() < watch->next) return false;
    end_watch(watch);
    watch->stopped = watch->host->signalled() != 0;
    watch->thread = watch->host->release ? watch->host->release() : NULL;
    watch->next = seconds_now() + PAUSE;
    return watch->stopped;
}

/* C (rows, columns) = A (rows, inner) B (inner, columns) */
static void multiply(const Watch *watch, const double *A, const double *B, double *C, int rows,
                     int inner, int columns)
{
    if (watch->host->dgemm && inner >= LARGE && rows > 1) { /* BLAS has matrices column by column */
        double one = 1.0, zero = 0.0;
        watch->host->dgemm("N", "N", &columns, &rows, &inner, &one, B, &columns, A, &inner, &zero,
                           C, &columns);
        return;
    }
    for (int i = 0; i < rows; i++)
        combine(C + (size_t)i * columns, NULL, columns, B, columns, A + (size_t)i * inner, 1,
                inner);
}

/* C (rows, columns) = A^T B of A (inner, rows) and B (inner, columns) */
static void multiply_transposed(const Watch *watch, const double *A, const double *B, double *C,
                                int rows, int inner, int columns)
{
    if (watch->host->dgemm && inner >= LARGE && rows > 1) {
        double one = 1.0, zero = 0.0;
        watch->host->dgemm("N", "T", &columns, &rows, &inner, &one, B, &columns, A, &rows, &zero,
                           C, &columns);
        return;
    }
    for (int i = 0; i < rows; i++)
        combine(C + (size_t)i * columns, NULL, columns, B, columns, A + i, rows, inner);
}

/* whether the processor has all that the wider form of the library is compiled for */
EXPORT int64_t nldyn_runs_v3(void)
{
#if defined(__x86_64__) && (defined(__GNUC__) || defined(__clang__))
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
           __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
#else
    return 0;
#endif
}
