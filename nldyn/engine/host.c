/* The link to the program that called: other threads, Ctrl-C, BLAS. */
#include "engine.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

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
EXPORT int64_t nldyn_layout(void) { return 100 * FIRST_POWER + SLIDING_TURNS; }

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
