// Friction of the probe on the skin, every step (docs/world.md).
//
// Every touched node has a bond with the probe: the tangential way b that the node has gone
// relative to the probe, less what slipped. Its force is -P mu_s b/d for |b| up to d mu/mu_s and
// never more than mu P, with P the normal push and d the way before slip. The law is linear in P,
// so that b is not upset when the push changes. P and mu are those of the end of the step before.
#include "world/contact.h"

#include "base/base.h"
#include "base/maths.h"

static const double BOND_M = 1e-4; // d

double sonde_friction_coefficient(const sonde_friction *friction, double slip_m_s) {
  if (!(friction->mu_static > 0)) return 0;
  double x = slip_m_s / friction->stribeck_speed_m_s;
  double dry = friction->mu_kinetic + (friction->mu_static - friction->mu_kinetic) * exp(-x * x);
  return friction->mu_gel + (dry - friction->mu_gel) * exp(-friction->gel_film);
}

void sonde_friction_release(sonde_state *state) {
  state->mu = sonde_friction_coefficient(&state->def.friction, 0);
  for (uint32_t i = 0; i < state->nodes.count; ++i)
    state->bond_m[i] = state->grip_n[i] = vec3(0, 0, 0);
}

typedef struct bond {
  sonde_vec3 normal;    // along which the probe pushes
  sonde_vec3 b_m;       // deflection, across the normal
  double stiffness_n_m; // P mu_s/d
  double limit_m;       // d mu/mu_s
} bond;

// False for a node that the probe did not push in the step before.
static bool bond_of(const sonde_state *state, uint32_t i, const sonde_motion *probe,
                    sonde_vec3 moved, bond *at) {
  double push = v_norm(state->grip_n[i]);
  if (state->grip_tick[i] != state->tick || !(push > 0)) return false;
  double most = sonde_friction_coefficient(&state->def.friction, 0);
  at->normal = v_scale(state->grip_n[i], 1 / push);
  // The node's displacement against the probe's point there, less what slipped, across the push.
  sonde_vec3 arm = v_sub(state->position[i], probe->origin);
  sonde_vec3 carried = v_scale(v_add(probe->velocity, v_cross(probe->spin, arm)), state->def.dt_s);
  sonde_vec3 b = v_sub(v_add(state->bond_m[i], moved), carried);
  at->b_m = v_madd(b, -v_dot(b, at->normal), at->normal);
  at->stiffness_n_m = push * most / BOND_M;
  at->limit_m = BOND_M * state->mu / most;
  return most > 0;
}

// Sticking: -k b. Slipping: -k limit b/|b|, whose slope is k limit/|b| across b and 0 along it.
bool sonde_friction_at(const sonde_state *state, uint32_t i, const sonde_motion *probe,
                       const sonde_contact_scales *scales, sonde_vec3 *force, sonde_mat3 *block) {
  bond at;
  double reach = state->def.implicitness * state->def.dt_s;
  SONDE_ASSERT(i < state->nodes.count && reach >= 0);
  if (!bond_of(state, i, probe, v_scale(state->velocity[i], reach), &at)) return false;
  double length = v_norm(at.b_m);
  bool slips = length > at.limit_m;
  double stiffness = slips ? at.stiffness_n_m * at.limit_m / length : at.stiffness_n_m;
  double scaled = scales->stiffness * stiffness;
  *block = m_rank1(at.normal, -scaled, scaled);
  if (slips) *block = m_add(*block, m_rank1(v_scale(at.b_m, 1 / length), -scaled, 0));
  *force = v_scale(at.b_m, -stiffness);
  return true;
}

// Returns the way that slipped.
static double advance_node(sonde_state *state, uint32_t i, const sonde_motion *probe) {
  double h = state->def.dt_s, slip = 0;
  bond at;
  bool held = bond_of(state, i, probe, v_scale(state->velocity[i], h), &at);
  state->grip_n[i] = state->contact_force[i];
  state->grip_tick[i] = state->tick + 1;
  state->bond_m[i] = vec3(0, 0, 0);
  if (!held) return 0;
  double length = v_norm(at.b_m);
  if (length > at.limit_m) {
    slip = length - at.limit_m;
    at.b_m = v_scale(at.b_m, at.limit_m / length);
  }
  SONDE_ASSERT(v_norm(at.b_m) <= BOND_M * (1 + 1e-9));
  state->bond_m[i] = at.b_m;
  state->contact_force[i] = v_madd(state->contact_force[i], -at.stiffness_n_m, at.b_m);
  return slip;
}

// One coefficient for the whole patch, from its mean slip speed weighted by the push.
void sonde_friction_advance(sonde_state *state, const sonde_motion *probe) {
  if (!(state->def.friction.mu_static > 0)) return;
  double sum = 0, push = 0;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    double slip = advance_node(state, i, probe), weight = v_norm(state->grip_n[i]);
    sum += weight * slip;
    push += weight;
  }
  double speed = push > 0 ? sum / (push * state->def.dt_s) : 0;
  state->mu = sonde_friction_coefficient(&state->def.friction, speed);
}
