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

enum BlowBy { BY_SPEED, BY_SLIP, BY_RESTITUTION, BY_FRICTION, N_BLOW_BY };

/* impulses along the normal and the tangent, and their derivatives */
typedef struct {
    double normal, tangent, normal_by[N_BLOW_BY], tangent_by[N_BLOW_BY];
} Blow;

/* share ρ = dQ/dP of the friction from where sliding ends on, and its derivative by μ */
static Value share_behind(Rubbing at)
{
    double sticks = at.both == 0.0 ? 0.0 : -at.both / at.tangent;
    if (fabs(sticks) <= at.friction) return (Value){sticks, 0.0};
    return (Value){copysign(at.friction, sticks), copysign(1.0, sticks)};
}

/* sense in which it slides first; that of nothing is the one in which it will, or that comes to rest
 * the sooner */
static double first_sense(Rubbing at, double slip, Value behind)
{
    if (slip != 0.0) return copysign(1.0, slip);
    return behind.slope != 0.0 ? behind.slope : behind.value > 0.0 ? -1.0 : 1.0;
}

/* the impulses of an impact at a speed of closing and one of sliding */
static Blow blow(Rubbing at, Value restitution, double speed, double slip)
{
    Value behind = share_behind(at);
    double sense = first_sense(at, slip, behind), share = sense * at.friction;
    double lost = at.normal + share * at.both, slowed = at.both + share * at.tangent;
    double lost_behind = at.normal + behind.value * at.both, e = restitution.value;
    double turn = slowed * sense > 0.0 ? slip / slowed : INFINITY; /* P at which sliding ends */
    bool in_compression = !(lost > 0.0 && speed / lost <= turn);
    double reach = in_compression ? speed + turn * (lost_behind - lost) : speed;
    double rate = in_compression ? lost_behind : lost;
    Blow found = {(1.0 + e) * reach / rate, 0.0, {0.0}, {0.0}};
    bool turns = found.normal > turn;
    double turn_by[N_BLOW_BY] = {0.0}, by_friction = sense * at.both;
    double *normal_by = found.normal_by;
    normal_by[BY_SPEED] = (1.0 + e + restitution.slope * reach) / rate;
    normal_by[BY_RESTITUTION] = reach / rate;
    normal_by[BY_FRICTION] = -found.normal * by_friction / rate;
    if (turns) {
        turn_by[BY_SLIP] = 1.0 / slowed;
        turn_by[BY_FRICTION] = -turn * sense * at.tangent / slowed;
    }
    if (in_compression) {
        double growth = normal_by[BY_SPEED]; /* by the reach */
        double more = behind.slope * at.both;
        normal_by[BY_SLIP] = growth * (lost_behind - lost) * turn_by[BY_SLIP];
        normal_by[BY_FRICTION] = growth * ((lost_behind - lost) * turn_by[BY_FRICTION] +
                                           turn * (more - by_friction)) -
                                 found.normal * more / rate;
    }
    double then = turns ? behind.value : share, first = turns ? share - behind.value : 0.0;
    found.tangent = then * found.normal + (turns ? first * turn : 0.0);
    for (int c = 0; c < N_BLOW_BY; c++)
        found.tangent_by[c] = then * normal_by[c] + first * turn_by[c];
    found.tangent_by[BY_FRICTION] +=
        turns ? behind.slope * found.normal + (sense - behind.slope) * turn : sense * found.normal;
    return found;
}
