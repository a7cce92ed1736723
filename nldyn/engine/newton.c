/* Newton's method for the shooting equations on a plane, or the flow map alone. */
#include "engine.h"

/* an orbit closes to this share of its size, or to this one times the largest entry of its
 * segments' Jacobians, which is what rounding costs; a short step of Newton's method does not tell */
#define OPEN 1e-7
#define NOISE 1e-12
#define PRELOADED 1e-14 /* the same of the preloads' size: forces that hold each other are rounded */
#define STEADY_SHARE 1e-3 /* share by which Jacobians may change in a step that only shows rounding */
#define LAST_DIGITS 1e-8 /* relative step that may go to and fro at the rounding level */

/* One call: what is asked for, and where the answers go. All fields have eight bytes. */
typedef struct {
    int64_t recording, chained, with_columns, n_segments;
    int64_t n_unknowns; /* none for the flow map alone */
    int64_t n_parameters;
    int64_t max_iterations; /* most steps; none means the flow map alone */
    int64_t wanted_closings; /* how often stops close in the motion from the guess, or -1 */
    double omega; /* excitation frequency, of the flow map alone */
    double level; /* the plane row . point = level on which to stay */
    double state_weight; /* of a state's square in the squared length of a step; 1 for ln ω */
    double rtol; /* longest last step */
    double longest; /* farthest distance of the first corrected point from `aim` */
    double turn; /* least cosine of the first tangent and the normal of the plane, in the metric */
    /* (n_unknowns,) states at the phases and ln ω; the guess, then the solution; or states alone */
    double *point;
    const double *phases; /* (n_segments + 1,) */
    const int64_t *parameters;
    const Complex *drive_by; /* (n_parameters, h, 3, 2n) derivative of `drive` by each */
    const double *row, *aim; /* (n_unknowns,) */
    const double *like; /* block of the record of a motion nearby, whose panels are guesses, or none */
    double *told; /* (3,) number of steps, lengths of the first and the last; undecided: stop, phase */
    double *along; /* (n_unknowns,) vector along the branch, of no particular length */
    double *ends; /* (k, 2n) */
    double *jacobians; /* (k, 2n, 2n), or one of them without columns, as what follows */
    double *d_omegas; /* (k, 2n) */
    double *d_parameters; /* (k, 2n, n_parameters) */
    int64_t *closings; /* (n_stops,) */
} Task;

/* a call at work */
typedef struct {
    const System *sys;
    const Task *task;
    Flow fl;
    Motion motion;
    Panel panel;
    Scratch scratch;
    Watch watch;
    const double *like; /* block of the record of a motion nearby, until it has served */
    double fastest, preload, omega;
    double *matrix, *sides, *known; /* Newton's method */
    int *order;
} Call;

/* cosine, in the metric of the steps, of the normal of a plane and the direction in the second
 * column of `sides` (n, 2), either way */
static double cosine(const double *row, const double *sides, int n, double state_weight)
{
    int last = n - 1;
    double end = sides[2 * last + 1], inner = row[last] * end;
    double length = squared(row[last]), pace = squared(end);
    for (int i = 0; i < last; i++) {
        double along = sides[2 * i + 1];
        inner += row[i] * along;
        length += squared(row[i]) / state_weight;
        pace += state_weight * squared(along);
    }
    return fabs(inner) / sqrt(length * pace);
}

/* size of the state that would relieve the most preloaded stop */
static double preloaded(const System *sys)
{
    double largest_state = 0.0;
    for (int s = 0; s < sys->n_stops; s++) {
        double square = 0.0, gap = sys->stops[(size_t)s * sys->n_columns + GAP];
        for (int k = 0; k < 2 * sys->n; k++) square += squared(sys->rows[(size_t)s * 2 * sys->n + k]);
        if (square > 0.0) largest_state = larger(largest_state, -gap / sqrt(square));
    }
    return largest_state;
}

/* propagate each node (k, 2n) to the next phase; chained, each starts where the last one ended */
static int shoot(Call *call)
{
    const Task *task = call->task;
    Motion *M = &call->motion;
    size_t size = call->fl.size, count = task->n_parameters, k = task->n_segments;
    size_t kept = task->with_columns ? k : 1;
    at_frequency(call->sys, call->omega, task->drive_by, &call->fl);
    memset(task->ends, 0, sizeof(double) * k * size);
    memset(task->jacobians, 0, sizeof(double) * kept * size * size);
    memset(task->d_omegas, 0, sizeof(double) * kept * size);
    if (count > 0) memset(task->d_parameters, 0, sizeof(double) * kept * size * count);
    for (int s = 0; s < call->fl.n_stops; s++) task->closings[s] = 0;
    remember(M, call->like);
    call->like = NULL;
    for (size_t i = 0; i < k; i++) {
        const double *start = task->point + i * size;
        if (task->chained && i > 0) start = task->ends + (i - 1) * size;
        double duration = (task->phases[i + 1] - task->phases[i]) / call->omega;
        size_t j = task->with_columns ? i : 0;
        Outcome outcome = {task->ends + i * size, task->jacobians + j * size * size,
                           task->d_omegas + j * size, task->d_parameters + j * size * count};
        int status = propagate(M, start, task->phases[i], duration, call->fastest, outcome);
        if (status == UNDECIDED) {
            task->told[1] = M->undecided;
            task->told[2] = task->phases[i] + call->omega * M->t;
        }
        if (status != OK) return status;
    }
    return OK;
}

/* What sticks behind its spring all the time keeps the place that it has: it is taken out of the
 * equations, with a multiplier of zero. */
static void pin_places(Call *call)
{
    const Task *task = call->task;
    const Flow *fl = &call->fl;
    size_t size = fl->size, k = task->n_segments;
    for (int s = 0; s < fl->n_stops; s++) {
        if (!is_sprung(fl, s)) continue;
        size_t place = place_entry(fl, s);
        bool free = true;
        for (size_t i = 0; i < k && free; i++)
            for (size_t j = 0; j < size; j++)
                free = free && task->jacobians[(i * size + place) * size + j] == (j == place);
        if (free) task->jacobians[((k - 1) * size + place) * size + place] = 0.0;
    }
}

/* fill the linear equations of a step, column by column: those of the segments, and the plane */
static void fill_equations(Call *call)
{
    const Task *task = call->task;
    int size = call->fl.size, k = (int)task->n_segments, n = (int)task->n_unknowns;
    double *matrix = call->matrix, *sides = call->sides;
    memset(matrix, 0, sizeof(double) * n * n);
    for (int s = 0; s < k; s++) {
        int following = (s + 1) % k;
        for (int i = 0; i < size; i++) {
            int r = s * size + i;
            sides[2 * r] = task->point[following * size + i] - task->ends[r];
            sides[2 * r + 1] = 0.0;
            matrix[(size_t)(following * size + i) * n + r] -= 1.0;
            for (int j = 0; j < size; j++)
                matrix[(size_t)(s * size + j) * n + r] += task->jacobians[(size_t)r * size + j];
            matrix[(size_t)(n - 1) * n + r] = call->omega * task->d_omegas[r];
        }
    }
    double off = task->level;
    for (int j = 0; j < n; j++) {
        matrix[(size_t)j * n + n - 1] = task->row[j];
        off -= task->row[j] * task->point[j];
    }
    sides[2 * (n - 1)] = off;
    sides[2 * (n - 1) + 1] = 1.0;
}

/* weighted length of the states in the first column of `sides`, without or with ln ω */
static double weighted_length(const Call *call, bool with_frequency)
{
    int n = (int)call->task->n_unknowns;
    double total = with_frequency ? squared(call->sides[2 * (n - 1)]) : 0.0;
    for (int i = 0; i < n - 1; i++)
        total += call->task->state_weight * squared(call->sides[2 * i]);
    return sqrt(total);
}

/* distance of the corrected point from where it is expected */
static double distance_from_aim(const Call *call)
{
    const Task *task = call->task;
    int n = (int)task->n_unknowns;
    const double *sides = call->sides;
    double far = squared(task->point[n - 1] + sides[2 * (n - 1)] - task->aim[n - 1]);
    for (int i = 0; i < n - 1; i++)
        far += task->state_weight * squared(task->point[i] + sides[2 * i] - task->aim[i]);
    return sqrt(far);
}

/* largest difference of the Jacobians from those of the step before */
static double change_of_jacobians(const Call *call, size_t count)
{
    double change = 0.0;
    for (size_t i = 0; i < count; i++)
        change = larger(change, fabs(call->task->jacobians[i] - call->known[i]));
    return change;
}

/* take a step whose equations are solved; why not, or OK */
static int take_step(Call *call, int iteration, double step)
{
    const Task *task = call->task;
    int n = (int)task->n_unknowns;
    double far = step;
    if (!isfinite(step)) return SINGULAR;
    if (iteration == 1) {
        far = distance_from_aim(call);
        if (cosine(task->row, call->sides, n, task->state_weight) < task->turn) return DIVERGED;
    }
    double longest = iteration == 1 ? task->longest : 1e3;
    if (far >= longest || fabs(call->sides[2 * (n - 1)]) >= 0.5) return DIVERGED;
    for (int i = 0; i < n; i++) {
        task->point[i] += call->sides[2 * i];
        task->along[i] = call->sides[2 * i + 1];
    }
    return OK;
}

/* whether the method has arrived: at a short step, or at the rounding level */
static bool arrived(Call *call, double opening, double noise, double last, double before)
{
    size_t count = (size_t)call->task->n_segments * call->fl.size * call->fl.size;
    bool closes = opening <= larger(OPEN, noise);
    bool converged = last <= call->task->rtol && closes;
    /* the rounding level, or steps to and fro where there is no orbit, across a sharp touch */
    bool stagnant = last < larger(LAST_DIGITS, noise) && last > 0.5 * before && closes;
    if (stagnant && opening > larger(NOISE, noise)) {
        double size = 0.0;
        for (size_t i = 0; i < count; i++) size = larger(size, fabs(call->task->jacobians[i]));
        stagnant = change_of_jacobians(call, count) <= STEADY_SHARE * size;
    }
    memcpy(call->known, call->task->jacobians, sizeof(double) * count);
    return converged || stagnant;
}

/* whether the stops close as often as wanted */
static bool closes_as_wanted(const Call *call)
{
    int64_t total = 0;
    for (int s = 0; s < call->fl.n_stops; s++) total += call->task->closings[s];
    return call->task->wanted_closings < 0 || total == call->task->wanted_closings;
}

/* rounding of the segments' ends */
static double closing_noise(const Call *call)
{
    const Task *task = call->task;
    size_t count = (size_t)task->n_segments * call->fl.size * call->fl.size;
    double size = 0.0;
    for (size_t i = 0; i < count; i++) size = larger(size, fabs(task->jacobians[i]));
    /* roundings of many pieces add up */
    double pressed = PRELOADED * call->preload * sqrt((double)n_recorded(call->motion.rec));
    return (NOISE + pressed) * size;
}

static int correct(Call *call)
{
    const Task *task = call->task;
    int n = (int)task->n_unknowns;
    size_t count = (size_t)task->n_segments * call->fl.size * call->fl.size;
    double last = INFINITY;
    for (size_t i = 0; i < count; i++) call->known[i] = INFINITY;
    for (int iteration = 1;; iteration++) {
        task->told[0] = iteration;
        call->omega = exp(task->point[n - 1]);
        int status = shoot(call);
        if (status != OK) return status;
        if (iteration == 1 && !closes_as_wanted(call)) return OTHER_CONTACTS;
        pin_places(call);
        fill_equations(call);
        double opening = weighted_length(call, false), noise = closing_noise(call);
        lu_factor(call->matrix, n, call->order);
        lu_apply(call->matrix, n, call->order, call->sides, 2);
        double before = last;
        task->told[2] = last = weighted_length(call, true);
        if (iteration == 1) task->told[1] = last;
        status = take_step(call, iteration, last);
        if (status != OK) return status;
        if (arrived(call, opening, noise, last, before)) return OK;
        if (iteration == task->max_iterations) return NOT_CONVERGED;
        if (last > 0.5 * before) /* panels that change with what is remembered may keep it going */
            call->motion.rec->block[0] = 0.0;
    }
}

/* give a call its memory, or measure it */
static void lay_out(Block *block, const Gauss *tab, Call *call)
{
    const Task *task = call->task;
    Motion *M = &call->motion;
    Flow *fl = &call->fl;
    int m = (int)tab->m;
    lay_out_flow(block, call->sys, (int)task->n_parameters, task->parameters, fl);
    lay_out_panel(block, fl, m, &call->panel);
    lay_out_motion(block, fl, M);
    lay_out_contacts(block, fl, tab, &call->scratch);
    lay_out_jumps(block, fl, m, M->n_columns, &call->scratch);
    size_t n = task->n_unknowns;
    call->matrix = numbers(block, n * n);
    call->sides = numbers(block, 2 * n);
    call->known = n > 0 ? numbers(block, task->n_segments * (size_t)fl->size * fl->size) : NULL;
    call->order = indices(block, n);
}

/* Correct a point, in place, or only fly from it; the outcome. The answers are of the point before
 * the last step, where the record is from, too. */
EXPORT int64_t nldyn_newton(const Host *host, const System *sys, const Gauss *tab, Record *rec,
                            const Task *task)
{
    Call call = {.sys = sys, .task = task, .omega = task->omega, .like = task->like};
    Block block = {NULL, 0};
    lay_out(&block, tab, &call);
    char *memory = malloc(block.used);
    if (!memory) return OUT_OF_MEMORY;
    block = (Block){memory, 0};
    lay_out(&block, tab, &call);
    call.fl.watch = &call.watch;
    Motion *M = &call.motion;
    M->fl = &call.fl;
    M->tab = tab;
    M->rec = rec;
    M->panel = &call.panel;
    M->s = &call.scratch;
    M->with_columns = task->with_columns != 0;
    M->recording = task->recording != 0;
    M->closings = task->closings;
    call.fastest = fastest_strained(sys, fastest_moved(sys));
    task->told[0] = 1.0;
    task->told[1] = task->told[2] = INFINITY;
    begin_watch(&call.watch, host);
    if (task->max_iterations > 0)
        call.preload = preloaded(sys) * sqrt(task->state_weight);
    int status = task->max_iterations > 0 ? correct(&call) : shoot(&call);
    end_watch(&call.watch);
    free(memory);
    return status;
}
