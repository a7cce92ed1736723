/* What the files of the engine share: outcomes, tolerances, and what a motion is made of.
 *
 * The state z is a list of pairs that move by themselves between contacts, z_b' = A_b z_b with
 * real 2 by 2 blocks; w is z without the response to the excitation: the steady one, but for a
 * mode excited at, or almost at, an eigenvalue of its own, whose share in it starts from rest at
 * phase zero, since the steady one would be huge, or none.
 *
 * Matrices lie row by row. All memory of a call is one block, the workspace, sized before it.
 */
#ifndef NLDYN_ENGINE_H
#define NLDYN_ENGINE_H

#include "numbers.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* outcomes; the names and numbers of layout.py */
enum Status {
    OK, TOO_MANY_PIECES, CONTACT_FAILED, DIVERGED, SINGULAR, NOT_CONVERGED, RECORD_FULL, ROUNDED,
    TOO_MANY_STEPS, OTHER_CONTACTS, INTERRUPTED, OUT_OF_MEMORY, UNDECIDED
};

#define FLIGHT (-1) /* kind of a piece that is no contact panel */
/* share of the speed at a stop that rounding of the penetration may cost in one contact, and share
 * of the modes' speeds there that their rounding may cost where a stop's damping decides them */
#define WORST_ROUNDING 1e-6
#define MOST_STEPS 10000000 /* in the search for one contact: a second */
#define MOST_PIECES 20000   /* flights and panels in one segment */
#define LET_GO 2 /* in place of 1 in fl->slides: over a plane from rest on, without a spring */
/* what a stop damps: a panel shows decay by e^-8 to 14 digits, and nothing is left of e^-40 */
#define DECAY 8.0
#define FADED 40.0
/* below this exponent a slope sets in almost at once: there nodes at the switch count, and less
 * than the usual tail is accepted */
#define ROUND 1.5
#define SHARP_TAIL 0.1
#define REST_TAIL 0.01 /* where a body rests: the error of a force that acts at once goes with it */
#define CREEP 100.0    /* such an exponent over an elastic contact: damping alone decides the speed */
#define RELEASED 1e-11 /* error allowed in the instant of a rigid stop's release */
#define HALF_CONTACT 2.5 /* phase of the stiffness of a stop in half a contact, at most, in rad */
/* the share of a slope in a Jacobian's error, kick (4 tail)², is less than rtol, (tail / 0.3)², as
 * long as KICK kick is less than one */
#define KICK 1.5
#define SUM_ROUNDING 1e-15 /* of a sum's terms, 4 units in the last place */
#define HALF_ULP 1e-16     /* of a number */
#define BLIND 20.0         /* roundings of a penetration: a tail within them tells nothing */
#define MAPPED 0.75 /* share of a panel's length for a map that brings nodes together at an end */

/* What the program that called gives: how other threads of it run meanwhile, whether it was
 * interrupted, BLAS, and whether it has had enough; each may be missing. */
typedef void Dgemm(const char *, const char *, const int *, const int *, const int *,
                   const double *, const double *, const int *, const double *, const int *,
                   const double *, double *, const int *);
typedef struct {
    void *(*release)(void);
    void (*acquire)(void *);
    int (*signalled)(void);
    Dgemm *dgemm;
    int (*enough)(void);
    double pause; /* s between two looks whether it was interrupted, or has had enough */
} Host;

/* one call's link to it */
typedef struct {
    const Host *host;
    void *thread;
    double next; /* time in s of the next look */
    bool stopped;
} Watch;

/* Numbers of a stop; the columns of `stops` begin so, then come coefficients of bonds. */
typedef struct {
    double gap, stiffness, exponent, dissipation, dashpot;
    double mobility;    /* velocity jump per unit impulse in 1/kg */
    double duration;    /* of a free contact, over (peak penetration / speed) */
    double instant;     /* error allowed in the instant of an event, as a share of the panel */
    double restitution; /* of a rigid stop; -1 for an elastic one */
    double bond;        /* 1 for what is no stop but acts all the time, with the law `bond_law` */
    double drag, cubic; /* of a bond: coefficients of u² u' and u'^3 */
    double release;     /* output δ + δ' dashpot/stiffness of a stop that never pulls, or -1 */
    double friction;    /* of a slider: coefficient while it slides; -1 for what is none */
    double adhesion;    /* by how much more it is at rest */
    double fading;      /* speed in which that falls to 1/e; 0 for at once */
    double belt;        /* speed of what it slides on */
    double normal;      /* stop whose force presses it on, or -1 */
    double pressing;    /* force that does so in place of a stop's */
    double second;      /* of a round clearance: row of its second direction, or -1 */
    double lead;        /* of that: row of the first one, or -1 */
    double centre;      /* of both: displacement along them of the centre */
    double sense;       /* 1 for a ring, in which the body is, -1 for a pin, around which it is */
    double rub;         /* coefficient of friction, in both of its rows as the next */
    double surface;     /* speed of the surface on that of the other side, from first to second */
    double area;        /* number of the area of contact that it is a point of, or -1 */
    double share;       /* what of that it stands for: change of its stiffness with the area's */
    double tangential;  /* of a slider behind a spring: its stiffness */
    double place;       /* entry of the state that is the slider's own place, or -1 */
    double place_rate;  /* rate of that entry where it sticks */
    double beside;      /* of a slider over a plane: row of its other tangent, or -1 */
    double mover;       /* of both: row of the speed of its place */
    double moves;       /* of that: row of the slider whose place it moves, or -1 */
} Stop;

enum Column {
    GAP, STIFFNESS, EXPONENT, DISSIPATION, DASHPOT, MOBILITY, DURATION, INSTANT, RESTITUTION, BOND,
    DRAG, CUBIC, RELEASE, FRICTION, ADHESION, FADING, BELT, NORMAL, PRESSING,
    SECOND, LEAD, CENTRE, SENSE, RUB, SURFACE, AREA, SHARE, TANGENTIAL,
    PLACE, PLACE_RATE, BESIDE, MOVER, MOVES, FIRST_POWER
};

/* A system. Outputs are the penetrations of the stops, the displacements of sliders and bonds and
 * those along the second directions of round clearances and of sliders over a plane, then those of
 * the movers of these, which are the same again, then the observed displacements. */
typedef struct {
    int64_t n, n_out, n_stops, n_columns, n_orders;
    const double *blocks; /* (n, 2, 2) */
    const double *rows;   /* (3, n_out, 2n) outputs, their velocities and accelerations in flight */
    const double *bound3; /* (n_out, 2n) |third derivative| <= Σ_b |bound3_b| |w_b| from now on */
    const double *force;  /* (2n, n_stops): w' = A w - force F */
    const double *orders; /* (h,) multiples of the excitation frequency; 1 first */
    const Complex *drive; /* (h, 3, 2n) excitation Σ Re(Σ_p ω^p drive[h, p] e^{i orders[h] ωt}) */
    const double *stops;  /* (n_stops, n_columns): stops, sliders, bonds, seconds, movers */
    const int64_t *laws;  /* (n_stops,) address of a law (of a rigid stop's restitution), or 0 */
    double tail;          /* largest relative Legendre tail accepted on a contact panel */
    double node_angle;    /* phase of the fastest mode from node to node, in rad */
    const double *common; /* (n_stops, n_stops) how far a unit force at one moves another at once */
} System;

/* Collocation tables of panels with m nodes, by kind: 2 (switch at start) + (switch at end). */
typedef struct {
    int64_t m, n_fine, power;
    const double *chi;         /* (4, m) node times as fractions of the panel */
    const double *slope;       /* (4, m) dχ/ds */
    const double *integrate;   /* (4, m, m) weight of node j in the integral up to node i, [j, i] */
    const double *weights;     /* (4, m) of the integral over the panel */
    const double *to_legendre; /* (m, m) */
    const double *ends_nodes;  /* (m + 2,) 0, the nodes, 1 */
    const double *barycentric; /* (m + 2,) */
    const double *fine_grid;   /* (n_fine,) */
    const double *to_fine;     /* (m + 2, n_fine) */
} Gauss;

/* Pieces of a trajectory, see layout.py: rows of one block, whose first row tells how many are in
 * use. */
typedef struct {
    int64_t capacity, width; /* numbers in a row */
    double *block;           /* (1 + capacity, width) */
} Record;

/* A piece: forcing phase at its start, duration, kind, stop that opens or closes at its end or -1,
 * state (2n,) at its start; then forces and penetrations (n_stops, m) each. */
typedef struct {
    double phase, duration, kind, event, start[];
} Recorded;

static inline Recorded *recorded(const Record *rec, int64_t n)
{
    return (Recorded *)(rec->block + (size_t)(1 + n) * rec->width);
}

static inline int64_t n_recorded(const Record *rec) { return (int64_t)rec->block[0]; }

/* kinds of terms of a response: e^{imωt}; the growth from rest e' = λe + e^{imωt}; and for a slow
 * block A of a trace and determinant the functions of ∫exp(As) ds = e + e_on A from 0 to t */
enum TermKind { STEADY, GROWTH, DRIFT, DRIFT_ON };

typedef struct {
    int kind;
    double order; /* multiple m of the excitation frequency */
    Complex rate; /* eigenvalue λ of a growth, trace + i determinant of a drift */
} Term;

/* sine and cosine of a phase */
typedef struct {
    double phase;
    Complex turn;
} Turn;

/* A system at one excitation frequency. */
typedef struct {
    int n, size, n_out, n_stops, n_columns, n_parameters, n_terms;
    const double *blocks, *rows, *bound3, *stops;
    double *pushes; /* (n_stops, 2n): w' = A w - Σ pushes F */
    const int64_t *laws;
    int *slides; /* (n_stops,) which way each slider slides: 1, -1, or 0 where it sticks, see LET_GO */
    Term *terms; /* beside the steady one at order 1 */
    /* (1 + k, 2 + n_parameters, 2n): amplitude of the steady response at order 1, z = w +
     * Re(response[0, 0] e^{iωt}), and of each further term; then their derivatives with respect to
     * ω and to each parameter */
    Complex *response;
    Complex *forced;           /* (1 + k, 2 + n_parameters, n_out) the same of the outputs */
    /* (n_parameters, 2) column of `stops`, or -1; index of the stop, or -2 - number of an area */
    const int64_t *parameters;
    double omega, tail, node_angle;
    /* of stops that move each other at once, see coupled.c; missing where there are none */
    const System *plain;
    double *own_rows, *own_stops; /* `rows` and `stops` are then these */
    double *give;      /* (n_stops, n_stops) `common` with the forces of the closed ones */
    bool *coupled;     /* (n_stops,) whether others move it */
    bool *counted;     /* (n_stops,) closed ones that the rows know of */
    int *pivots;       /* (1,) since they were the stops' own */
    Turn *turns; /* (2,) of the last phases that outputs were asked for at: mostly the same again */
    Watch *watch;
} Flow;

/* Arrays of a contact panel with na stops, m nodes and n modes, filled by `solve_panel`; what
 * depends on kind and length alone serves the next panel of the same stops too. Outputs are the
 * na penetrations and, if a force depends on them, their na rates, and na accelerations: those that
 * round clearances would have without their own forces. That of a rigid stop, and of a slider that
 * sticks, is the acceleration that it would have without its own force; the force is in
 * proportion to it. */
typedef struct {
    int na, m, outputs;
    int sought, orders; /* closed stops whose forces are unknowns, and orders of outputs that these
                         * forces go with; the others follow, see following.c */
    int n_stuck, *stuck; /* (n_stuck,) places of those that stick */
    int *ways;           /* (na,) how those that follow slid as the panel was made */
    int *active;      /* (na,) closed stops */
    double *output;   /* (outputs, m) values at the nodes */
    double *F;        /* (na, m) forces */
    double *slope;    /* (outputs, m) derivative of the force with respect to the output; then, with
                       * round clearances, (outputs, m) that by the output of the other direction */
    bool round;       /* whether there are any */
    double *radial;   /* (na, m) their penetrations, at the place of the first direction */
    double *tilt;     /* (na, 5, m) derivatives of what slides over a plane, see `tilt_of` */
    bool rough;       /* whether their turning is not yet led by the normal force: far from it */
    double *growth;   /* (na,) rate of the length of its strain, at the place of its first row */
    double *there;    /* (n, 4, m) exp(A t_i) */
    double *home;     /* (n, 4, m) exp(-A t_j) */
    double *to;       /* (outputs, 2n, m) row exp(A t_i) */
    double *back;     /* (na, 2n, m) exp(-A t_j) force */
    double *G;        /* (sought m, orders sought m) outputs at the nodes per force at the nodes, by
                       * forces, with what follows */
    double *reach;    /* (n_stuck m, orders sought m) the same of forces that stick */
    double *loose;    /* (n_stuck m, n_stuck m) inverse of their own equations */
    double *share;    /* (sought m, n_stuck m) what they are per force sought */
    double *base;     /* (n_stuck m,) and without these */
    double *inverse;  /* (sought m, sought m) of 1 - slope G, at these slopes or earlier ones, see `invert` */
    int *order;       /* (na m,) scratch for it */
    bool kept;        /* whether it is worth keeping */
    bool many;        /* whether the forces are found by iteration, without G and its inverse */
    double *inverted; /* (outputs, m) slopes for which it was filled, or nan in the first */
    int made_kind;    /* kind and length for which there, to, back and G were filled */
    double made_length;
    double *whole;    /* (n, 6) exp(A h), and the diagonal of that less 1 */
    bool weighed;     /* whether the tails of its responses are known, see `fill_response_tails` */
    double *rise;     /* (na, 2n, m) row (exp(A t_i) - 1) of the penetrations */
    /* (na,) penetration at the start and its rounding error, the same at the end: carried apart
     * from the state, in which rounding is a share of the displacement */
    double *depth, *doubt, *end_depth, *end_doubt;
    /* (na,) exponent by which each stop has damped fast motion, before this panel and in it, since
     * the segment began, the last event, or another stop began to count */
    double *decayed, *decay;
} Panel;

/* Scratch of the functions that are named, sized once for each call. */
typedef struct {
    double *times, *waves, *product;                   /* panel_responses, free_outputs */
    double *free, *new_slope, *solved, *step, *led;    /* solve_panel */
    double *guess, *rounding, *noise, *inner, *values; /* contact_panel, first_event */
    double *fine, *driven;
    double *slopes, *forced, *swayed;                  /* resolved */
    double *viscosity, *off, *hold_matrix, *shift, *kick; /* hold_speeds */
    int *hold_order;
    double *forces, *answers, *square, *part, *change; /* panel_columns */
    double *last_forces; /* (n_stops, 1 + n_columns) see `fill_last_force` */
    double *pushed, *carried, *added, *driven_many, *flown, *pushing, *showing; /* many stops */
    double *stop_forces, *pushes, *first_pushes, *held, *mobility; /* rigid stops */
    double *across, *outward; /* (n_stops,) see `fill_directions` */
    double *heading; /* (n_stops,) direction along which what is let go over a plane leaves */
    double *drags; /* (n_stops,) speeds of the places of sliders behind springs, see `drag_speed` */
    int *resting, *mobility_order;
    double *rate, *moved, *moved_shift, *along, *along_columns, *offsets;
    double *closing, *sliding, *aside, *turning, *gained, *pull; /* strike, hold */
    bool *struck, *still;
    bool *was_open; /* (n_stops,) before an event */
} Scratch;

/* A motion over one segment. */
typedef struct {
    const Flow *fl;
    const Gauss *tab;
    Record *rec;
    int64_t ahead; /* the first of the pieces of a motion before, at the record's end, not passed */
    bool other;    /* whether these are of another orbit */
    Panel *panel;
    Scratch *s;
    bool with_columns, recording;
    int n_columns;
    double *w;         /* (2n,) */
    double *w_end;     /* (2n,) at the end of a panel */
    double *columns;   /* (2n, n_columns) sensitivities: by the start, the parameters, ω */
    bool *closed;      /* (n_stops,) */
    int64_t *closings; /* (n_stops,) how often each stop closed */
    int64_t *bounces;  /* (n_stops,) impacts since the last release */
    double *last_push; /* (n_stops,) force at the end of stops that damp strongly, or nan */
    double *skips;     /* (n_stops,) times to pass before a gap is looked at again */
    double *depth, *doubt; /* (n_stops,) carried penetrations and their rounding errors */
    int *active;
    double phase;      /* forcing phase at the start, less `before`, that of whole turns */
    double before, duration, t;
    double h_even, h_mapped; /* lengths of panels that resolve the fastest mode */
    double shortest, reach;  /* reach: length of a panel that the bonds are likely to allow */
    bool bonded;
    int start_switch;  /* whether a stop has switched just now */
    int undecided;     /* rigid stop whose force with friction nothing tells, or -1 */
} Motion;

/* value and first two time derivatives of an output, and a bound on the third */
typedef struct {
    double value, first, second, bound;
} Course;

/* A local extreme of a penetration, or another output: its key is twice the number of the stop, for a
 * maximum one more; `output` is the penetration with the gap. */
typedef struct {
    double phase, value, key, output;
} Extreme;

/* force of a stop and its derivatives by penetration and speed */
typedef struct {
    double force, stiffness, viscosity;
} Force;

static inline const double *block_of(const Flow *fl, int b) { return fl->blocks + 4 * b; }

static inline const double *row_of(const Flow *fl, int order, int out)
{
    return fl->rows + ((size_t)order * fl->n_out + out) * fl->size;
}

static inline const double *push_of(const Flow *fl, int stop)
{
    return fl->pushes + (size_t)stop * fl->size;
}

static inline const Stop *stop_of(const Flow *fl, int stop)
{
    return (const Stop *)(fl->stops + (size_t)stop * fl->n_columns);
}

static inline Complex forced_of(const Flow *fl, int term, int row, int out)
{
    return fl->forced[((size_t)term * (2 + fl->n_parameters) + row) * fl->n_out + out];
}

static inline const Complex *response_of(const Flow *fl, int term, int row)
{
    return fl->response + ((size_t)term * (2 + fl->n_parameters) + row) * fl->size;
}

/* forces (n_stops, m) of a recorded piece, and its penetrations */
static inline double *forces_of(const Flow *fl, const Recorded *piece)
{
    return (double *)piece->start + fl->size;
}

static inline double *depths_of(const Flow *fl, int m, const Recorded *piece)
{
    return forces_of(fl, piece) + (size_t)fl->n_stops * m;
}

static inline double *piece_row(double *values, int a, int width) { return values + (size_t)a * width; }

#endif
