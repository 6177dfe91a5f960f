// Creation and release of the moving state; cold.
#include "world/engine.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/morton.h"

#include <string.h>

sonde_world_def sonde_world_def_default(void) {
  return (sonde_world_def){.version = SONDE_DEF_VERSION,
                           .dt_s = 1e-3,
                           .implicitness = 1,
                           .newton_iterations = 3,
                           .engine = SONDE_ENGINE_FAST,
                           .pcg = {1e-2, 1e-6, 200}, // 1 mN over a step
                           .contact_law = SONDE_CONTACT_FOUNDATION,
                           .contact_stiffness_n_m3 = 5e8,
                           .contact_damping_n_s_m3 = 1e5,
                           .sleep_displacement_m = 20e-6,
                           .friction = {.stribeck_speed_m_s = 0.01, .mu_gel = 0.05},
                           .threads = 1};
}

static sonde_status check_friction(const sonde_friction *f, sonde_error *error) {
  const sonde_bounded range[] = {{"friction.mu_static", f->mu_static, 0, 5},
                                 {"friction.mu_kinetic", f->mu_kinetic, 0, f->mu_static},
                                 {"friction.stribeck_speed_m_s", f->stribeck_speed_m_s, 1e-5, 10},
                                 {"friction.gel_film", f->gel_film, 0, 100},
                                 {"friction.mu_gel", f->mu_gel, 0, 5}};
  return sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
}

static sonde_status check(const sonde_world_def *def, sonde_error *error) {
  sonde_status status = sonde_def_check("world", def->version, error);
  if (status) return status;
  bool fast = def->engine == SONDE_ENGINE_FAST;
  const sonde_bounded range[] = {{"dt_s", def->dt_s, 1e-7, 1},
                                 {"implicitness", def->implicitness, 0, 1},
                                 {"newton_iterations", def->newton_iterations, fast ? 1 : 0, 100},
                                 {"pcg.relative_residual", def->pcg.relative_residual, 0, 0.5},
                                 {"pcg.absolute_residual", def->pcg.absolute_residual, 0, 1},
                                 {"pcg.max_iterations", def->pcg.max_iterations, 1, 1e6},
                                 {"contact_law", def->contact_law, 0, SONDE_CONTACT_NODES},
                                 {"engine", def->engine, 0, SONDE_ENGINE_FAST},
                                 {"threads", def->threads, 0, fast ? 2 : 1},
                                 {"contact_stiffness_n_m3", def->contact_stiffness_n_m3, 0, 1e12},
                                 {"contact_damping_n_s_m3", def->contact_damping_n_s_m3, 0, 1e10},
                                 {"sleep_displacement_m", def->sleep_displacement_m, 0, 1e-3}};
  status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  if (status) return status;
  if (def->engine == SONDE_ENGINE_FAST &&
      (def->implicitness != 1 || def->contact_law == SONDE_CONTACT_VOLUME))
    return sonde_fail(
        error, SONDE_ARGUMENT,
        "the fast engine wants implicitness 1 (it is %g) and a contact law other than "
        "VOLUME",
        def->implicitness);
  return check_friction(&def->friction, error);
}

sonde_status sonde_state_set_friction(sonde_state *state, const sonde_friction *friction,
                                      sonde_error *error) {
  sonde_status status = check_friction(friction, error);
  if (status) return status;
  state->def.friction = *friction;
  state->mu = sonde_friction_coefficient(friction, 0);
  return SONDE_OK;
}

sonde_tuning sonde_tuning_default(void) { return (sonde_tuning){1, 1, NAN, NAN}; }

sonde_status sonde_state_tune(sonde_state *state, const sonde_tuning *t, sonde_error *error) {
  const sonde_bounded range[] = {
      {"stiffness_scale", t->stiffness_scale, 0.01, 100},
      {"damping_scale", t->damping_scale, 0, 1000},
      {"normal_damping_s", isnan(t->normal_damping_s) ? 0 : t->normal_damping_s, 0, 100},
      {"edge_damping_s", isnan(t->edge_damping_s) ? 0 : t->edge_damping_s, 0, 100}};
  sonde_status status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  if (status) return status;
  sonde_state_retune(state, t);
  return SONDE_OK;
}

#define CARVE(field, count) (s->field = sonde_carve(base, &offset, (count), sizeof *s->field))

// All arrays in one block: measured and placed by the same code.
static size_t carve(sonde_state *s, char *base) {
  size_t offset = 0;
  uint32_t n = s->nodes.count;
  CARVE(tuned_k0, n), CARVE(face_order, s->model->surface.face_count);
  CARVE(position, n), CARVE(velocity, n), CARVE(probed, n);
  CARVE(touched, n), CARVE(parent, n), CARVE(share_m3, n), CARVE(gradient, n);
  CARVE(contact_force, n), CARVE(surprise, n);
  CARVE(bond_m, n), CARVE(grip_n, n), CARVE(grip_tick, n);
  CARVE(plane_weight, SONDE_MAX_PROBE_PLANES);
  CARVE(plane_normal, SONDE_MAX_PROBE_PLANES), CARVE(plane_offset, SONDE_MAX_PROBE_PLANES);
  return offset;
}

sonde_status sonde_state_create_ordered(const sonde_model *model, const sonde_world_def *def,
                                        const uint32_t *face_order, sonde_state **out,
                                        sonde_error *error) {
  *out = NULL;
  sonde_world_def fallback = sonde_world_def_default();
  if (!def) def = &fallback;
  sonde_status status = check(def, error);
  if (status) return status;
  sonde_state *state = SONDE_NEW(sonde_state, 1);
  if (!state) return sonde_fail_memory(error);
  state->model = state->tissue = model;
  state->nodes = sonde_model_nodes(model);
  state->tuning = sonde_tuning_default();
  state->def = *def;
  const sonde_engine_calls *calls =
      def->engine == SONDE_ENGINE_FAST ? &sonde_engine_float : &sonde_engine_double;
  state->block = sonde_calloc(1, carve(state, NULL));
  if (state->block) carve(state, state->block);
  status = state->block ? SONDE_OK : sonde_fail_memory(error);
  if (!status && face_order)
    memcpy(state->face_order, face_order, model->surface.face_count * sizeof *face_order);
  // Faces along a space-filling curve.
  if (!status && !face_order) {
    const sonde_mesh *mesh = &model->surface;
    sonde_keyed *list = SONDE_NEW(sonde_keyed, mesh->face_count);
    if (!list) status = sonde_fail_memory(error);
    for (uint32_t f = 0; list && f < mesh->face_count; ++f) {
      sonde_vec3 c = vec3(0, 0, 0);
      for (int k = 0; k < 3; ++k) c = v_madd(c, 1.0 / 3, mesh->vertices[mesh->faces[f][k]]);
      list[f] = (sonde_keyed){sonde_morton_key(c), f};
    }
    if (list) qsort(list, mesh->face_count, sizeof *list, sonde_keyed_compare);
    for (uint32_t f = 0; list && f < mesh->face_count; ++f) state->face_order[f] = list[f].index;
    sonde_free(list);
  }
  if (!status) status = calls->create(model, def, state->face_order, &state->engine, error);
  if (!status && def->engine == SONDE_ENGINE_DOUBLE) state->precise = state->engine;
  if (status) {
    sonde_state_destroy(state);
    return status;
  }
  sonde_state_reset(state);
  *out = state;
  return SONDE_OK;
}

sonde_status sonde_state_create(const sonde_model *model, const sonde_world_def *def,
                                sonde_state **state, sonde_error *error) {
  return sonde_state_create_ordered(model, def, NULL, state, error);
}

void sonde_state_destroy(sonde_state *state) {
  if (!state) return;
  if (state->engine) state->engine->calls->destroy(state->engine);
  if (state->precise && state->precise != state->engine)
    state->precise->calls->destroy(state->precise);
  sonde_free(state->block);
  sonde_free(state);
}
