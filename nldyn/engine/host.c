/* The link to the program that called: other threads, Ctrl-C, BLAS. */
#include "engine.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#define WORTH 4096 /* multiplications from which a product of matrices is left to BLAS */

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
    watch->next = seconds_now() + watch->host->pause;
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
    if (!watch->stopped && watch->host->enough) watch->stopped = watch->host->enough() != 0;
    watch->thread = watch->host->release ? watch->host->release() : NULL;
    watch->next = seconds_now() + watch->host->pause;
    return watch->stopped;
}

/* C = keep C + factor A B by BLAS, which has matrices column by column, or A^T B; whether that is
 * worth its call. Rows of A lie `apart`. */
static bool left_to_blas(const Watch *watch, double factor, const double *A, const char *turned,
                         int apart, const double *B, double keep, double *C, int rows, int inner,
                         int columns)
{
    if (!watch->host->dgemm || (double)rows * inner * columns < WORTH) return false;
    watch->host->dgemm("N", turned, &columns, &rows, &inner, &factor, B, &columns, A, &apart, &keep,
                       C, &columns);
    return true;
}

/* C (rows, columns) = A (rows, inner) B (inner, columns) */
static void multiply(const Watch *watch, const double *A, const double *B, double *C, int rows,
                     int inner, int columns)
{
    if (left_to_blas(watch, 1.0, A, "N", inner, B, 0.0, C, rows, inner, columns)) return;
    for (int i = 0; i < rows; i++)
        combine(C + (size_t)i * columns, NULL, columns, B, columns, A + (size_t)i * inner, 1,
                inner);
}

/* C (rows, columns) = A^T B of A (inner, rows), whose rows lie `apart`, and B (inner, columns) */
static void multiply_transposed(const Watch *watch, const double *A, int apart, const double *B,
                                double *C, int rows, int inner, int columns)
{
    if (left_to_blas(watch, 1.0, A, "T", apart, B, 0.0, C, rows, inner, columns)) return;
    for (int i = 0; i < rows; i++)
        combine(C + (size_t)i * columns, NULL, columns, B, columns, A + i, apart, inner);
}

/* take A B of A (rows, inner) and B (inner, columns) from C (rows, columns); spare (columns,) */
static void take_product(const Watch *watch, const double *A, const double *B, double *C, int rows,
                         int inner, int columns, double *spare)
{
    if (left_to_blas(watch, -1.0, A, "N", inner, B, 1.0, C, rows, inner, columns)) return;
    for (int i = 0; i < rows; i++) {
        double *row = C + (size_t)i * columns;
        combine(spare, NULL, columns, B, columns, A + (size_t)i * inner, 1, inner);
        for (int c = 0; c < columns; c++) row[c] -= spare[c];
    }
}

/* whether the processor and the system have all that the wider form of the library is compiled
 * for: AVX2, FMA, F16C, BMI, LZCNT and MOVBE [Intel SDM, CPUID and XGETBV] */
#if defined(__x86_64__)
EXPORT int64_t nldyn_runs_v3(void)
{
    const unsigned first = 1u << 12 | 1u << 22 | 1u << 27 | 1u << 28 | 1u << 29; /* leaf 1, ecx */
    const unsigned seventh = 1u << 3 | 1u << 5 | 1u << 8;                        /* leaf 7, ebx */
    const unsigned lzcnt = 1u << 5, wide_registers = 6;
    unsigned a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & first) != first) return 0;
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & seventh) != seventh) return 0;
    if (!__get_cpuid(0x80000001u, &a, &b, &c, &d) || !(c & lzcnt)) return 0;
    __asm__ volatile("xgetbv" : "=a"(a), "=d"(d) : "c"(0)); /* those that the system saves */
    return (a & wide_registers) == wide_registers;
}
#else
EXPORT int64_t nldyn_runs_v3(void) { return 0; }
#endif

/* what the callers must know alike: how many columns a stop has, and the last outcome */
EXPORT int64_t nldyn_layout(void)
{
    return 10000 * (int64_t)(sizeof(System) / 8) + 100 * FIRST_POWER + UNDECIDED;
}

/* the sources of the library, see fingerprint.py */
#ifndef FINGERPRINT
#define FINGERPRINT 0
#endif
EXPORT int64_t nldyn_fingerprint(void) { return FINGERPRINT; }

/* the compiler of the library, as "clang 21.1" */
#define QUOTED(text) #text
#define VERSION(name, major, minor) name " " QUOTED(major) "." QUOTED(minor)
EXPORT const char *nldyn_built_by(void)
{
#if defined(__clang__)
    return VERSION("clang", __clang_major__, __clang_minor__);
#elif defined(__GNUC__)
    return VERSION("gcc", __GNUC__, __GNUC_MINOR__);
#else
    return "a C compiler";
#endif
}
