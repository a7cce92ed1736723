/* Impacts on a rigid stop with Coulomb's friction, in the plane of its normal and its tangent, by
 * Routh's incremental impulse and Poisson's hypothesis [Routh 1905; Wang and Mason 1992].
 *
 * Along the normal impulse P, which grows from zero, the speed v of closing and that of sliding, u,
 * change by
 *
 *     dv = -(m_nn + ρ m_nt) dP,    du = -(m_nt + ρ m_tt) dP,    dQ = ρ dP,
 *
 * with ρ = ±μ in the sense of sliding. Where u comes to zero, what is there sticks with
 * ρ = -m_nt/m_tt if that is no more than μ, else it slides back with the nearest of ±μ; so ρ changes
 * once at most. Compression ends where v is zero, and the impact after 1 + e times the
 * impulse up to there. That takes energy out, which Newton's hypothesis may not [Kane and Levinson
 * 1985]; where m_nt is zero the hypotheses agree. */
#include "engine.h"

/* speeds that a unit impulse along the normal takes from closing and sliding, and one along the
 * tangent from sliding; coefficient of friction */
typedef struct {
    double normal, both, tangent, friction;
} Rubbing;

enum BlowBy {
    BY_SPEED, BY_SLIP, BY_SLIP_ASIDE, BY_RESTITUTION, BY_FRICTION, BY_NORMAL, BY_BOTH, BY_TANGENT,
    N_BLOW_BY
};

/* a number and its derivatives by these */
typedef struct {
    double value, by[N_BLOW_BY];
} Slopes;

/* impulses along the normal and the tangent; over a plane along both tangents */
typedef struct {
    Slopes normal, tangent, aside;
} Blow;

static Slopes number_by(double value, int place, double slope)
{
    Slopes found = {value, {0.0}};
    found.by[place] = slope;
    return found;
}

/* a + s b */
static Slopes plus(Slopes a, double s, Slopes b)
{
    a.value += s * b.value;
    for (int c = 0; c < N_BLOW_BY; c++) a.by[c] += s * b.by[c];
    return a;
}

static Slopes multiplied(Slopes a, Slopes b)
{
    for (int c = 0; c < N_BLOW_BY; c++) a.by[c] = a.by[c] * b.value + a.value * b.by[c];
    a.value *= b.value;
    return a;
}

static Slopes divided(Slopes a, Slopes b)
{
    a.value /= b.value;
    for (int c = 0; c < N_BLOW_BY; c++) a.by[c] = (a.by[c] - a.value * b.by[c]) / b.value;
    return a;
}

/* share ρ = dQ/dP of the friction from where sliding ends on */
static Slopes share_behind(Rubbing at, Slopes friction, Slopes both, Slopes tangent)
{
    if (at.tangent == 0.0) return (Slopes){0.0, {0.0}};
    Slopes sticks = divided(plus((Slopes){0.0, {0.0}}, -1.0, both), tangent);
    if (fabs(sticks.value) <= at.friction) return sticks;
    return plus((Slopes){0.0, {0.0}}, copysign(1.0, sticks.value), friction);
}

/* sense in which it slides first; that of nothing is the one in which it will, or that comes to rest
 * the sooner */
static double first_sense(Rubbing at, double slip, double behind)
{
    if (slip != 0.0) return copysign(1.0, slip);
    bool slides = at.both != 0.0 && fabs(at.both / at.tangent) > at.friction;
    return slides ? copysign(1.0, -at.both) : behind > 0.0 ? -1.0 : 1.0;
}

/* the impulses of an impact at a speed of closing and one of sliding */
static Blow blow(Rubbing at, Value restitution, double speed, double slip)
{
    Slopes normal = number_by(at.normal, BY_NORMAL, 1.0), both = number_by(at.both, BY_BOTH, 1.0);
    Slopes tangent = number_by(at.tangent, BY_TANGENT, 1.0);
    Slopes friction = number_by(at.friction, BY_FRICTION, 1.0);
    Slopes reach = number_by(speed, BY_SPEED, 1.0), sliding = number_by(slip, BY_SLIP, 1.0);
    Slopes grows = number_by(1.0 + restitution.value, BY_RESTITUTION, 1.0);
    grows.by[BY_SPEED] = restitution.slope;
    Slopes behind = share_behind(at, friction, both, tangent);
    double sense = first_sense(at, slip, behind.value);
    Slopes share = plus((Slopes){0.0, {0.0}}, sense, friction);
    Slopes lost = plus(normal, 1.0, multiplied(share, both));
    Slopes lost_behind = plus(normal, 1.0, multiplied(behind, both));
    Slopes slowed = plus(both, 1.0, multiplied(share, tangent)); /* P at which sliding ends: */
    Slopes turn = slowed.value * sense > 0.0 ? divided(sliding, slowed) : number_by(INFINITY, 0, 0.0);
    bool in_compression = !(lost.value > 0.0 && speed / lost.value <= turn.value);
    if (in_compression) reach = plus(reach, 1.0, multiplied(turn, plus(lost_behind, -1.0, lost)));
    Slopes impulse = divided(multiplied(grows, reach), in_compression ? lost_behind : lost);
    bool turns = impulse.value > turn.value;
    Slopes rubbed = multiplied(turns ? behind : share, impulse);
    if (turns) rubbed = plus(rubbed, 1.0, multiplied(plus(share, -1.0, behind), turn));
    return (Blow){impulse, rubbed, {0.0, {0.0}}};
}
