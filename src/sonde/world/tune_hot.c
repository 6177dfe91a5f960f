// Other springs and another friction for a state that is under way.
#include "tissue/model.h"
#include "world/engine.h"

#include "base/base.h"
#include "base/maths.h"

static void scale_springs(sonde_state *state) {
  const sonde_tuning *t = &state->tuning;
  sonde_surface_law *law = &state->tuned.law;
  state->tuned = *state->model;
  state->tuned.k0_n_m3 = state->tuned_k0;
  if (!isnan(t->normal_damping_s)) law->normal_damping_s = t->normal_damping_s;
  if (!isnan(t->edge_damping_s)) law->edge_damping_s = t->edge_damping_s;
  law->normal_damping_s *= t->damping_scale;
  law->edge_damping_s *= t->damping_scale;
  sonde_law_scale(law, t->stiffness_scale);
  if (state->model->bulk) {
    state->tuned_bulk = *state->model->bulk;
    state->tuned.bulk = &state->tuned_bulk;
    state->tuned_bulk.law.stiffness_scale *= t->stiffness_scale;
    state->tuned_bulk.law.damping_s *= t->damping_scale;
  }
  for (uint32_t i = 0; i < state->model->surface.vertex_count; ++i)
    state->tuned_k0[i] = t->stiffness_scale * state->model->k0_n_m3[i];
}

void sonde_state_retune(sonde_state *state, const sonde_tuning *tuning) {
  SONDE_ASSERT(tuning->stiffness_scale > 0 && tuning->damping_scale >= 0);
  bool plain = tuning->stiffness_scale == 1 && tuning->damping_scale == 1 &&
               isnan(tuning->normal_damping_s) && isnan(tuning->edge_damping_s);
  if (plain && state->tissue == state->model) return;
  state->tuning = *tuning;
  scale_springs(state);
  state->tissue = plain ? state->model : &state->tuned;
  state->engine->calls->tune(state->engine, state->tissue, &state->def);
  if (state->precise && state->precise != state->engine)
    state->precise->calls->tune(state->precise, state->tissue, &state->def);
  sonde_state_publish(state);
  sonde_state_wake_all(state);
}

// The coefficient keeps its place between slipping and sticking.
void sonde_state_rub(sonde_state *state, const sonde_friction *friction) {
  SONDE_ASSERT(friction->mu_static >= friction->mu_kinetic && friction->gel_film >= 0);
  double before = sonde_friction_coefficient(&state->def.friction, 0);
  double most = sonde_friction_coefficient(friction, 0);
  state->mu = before > 0 ? state->mu / before * most : most;
  state->def.friction = *friction;
}
