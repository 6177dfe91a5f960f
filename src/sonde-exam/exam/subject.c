// The thigh under the probe: creation.
#include "exam/subject.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/gel.h"
#include "haptics/motion.h"

#include <string.h>

sonde_preset sonde_setup_preset(const sonde_setup *setup, const sonde_session_controls *c) {
  SONDE_ASSERT(setup->preset_count <= SONDE_SESSION_PRESETS);
  sonde_preset preset = sonde_preset_default();
  preset.friction = setup->friction;
  uint32_t last = setup->preset_count ? setup->preset_count - 1 : 0;
  if (setup->preset_count) preset = setup->presets[c->preset < last ? c->preset : last];
  preset.stiffness_scale *= c->stiffness_scale;
  preset.damping_multiplier *= c->damping_scale;
  preset.friction.mu_static *= c->friction_scale;
  preset.friction.mu_kinetic *= c->friction_scale;
  preset.friction.mu_gel *= c->friction_scale;
  return preset;
}

sonde_status sonde_subject_create(const sonde_setup *setup, const sonde_model *model,
                                  const sonde_world_def *world,
                                  const sonde_session_controls *controls, sonde_subject **out,
                                  sonde_error *error) {
  *out = NULL;
  sonde_subject *subject = SONDE_NEW(sonde_subject, 1);
  if (!subject) return sonde_fail_memory(error);
  subject->model = model;
  subject->setup = *setup;
  subject->dt_s = world->dt_s;
  subject->now.circulation = setup->circulation;
  sonde_status status = sonde_state_create(model, world, &subject->state, error);
  if (!status) status = sonde_gel_create(model, NULL, &subject->gel, error);
  if (!status) status = sonde_surface_index_create(&model->surface, &subject->rest_skin, error);
  if (status) {
    sonde_subject_destroy(subject);
    return status;
  }
  // Half over the sites, half along the vein, where an exam goes. Shares overlap, so that the film
  // is closed between the places.
  const double radius_m = 0.02, along_m = 0.03, all_m3 = subject->setup.gel_m3;
  uint32_t sites = model->site_count, points = model->vein.count;
  if (all_m3 > 0) {
    double half = sites && points ? 0.5 : 1.0;
    for (uint32_t i = 0; i < sites; ++i)
      sonde_gel_put(subject->gel, model->sites[i].position_m, radius_m, half * all_m3 / sites);
    const sonde_mesh *skin = &model->surface;
    for (uint32_t i = 0; i < points; ++i) {
      uint32_t at = v_nearest(skin->vertices, skin->vertex_count, model->vein.point[i].centre_m);
      sonde_gel_put(subject->gel, skin->vertices[at], along_m, half * all_m3 / points);
    }
  }
  subject->now.controls = *controls;
  subject->now.controls.valsalva = false;
  sonde_subject_control(subject, controls);
  *out = subject;
  return SONDE_OK;
}

sonde_session_solid sonde_session_solid_default(void) {
  const sonde_solid_leg_def def = sonde_solid_leg_def_default();
  sonde_session_solid solid = {.version = SONDE_DEF_VERSION, .edge_m = def.mesh.edge_m};
  memcpy(solid.layer, def.live.solid.layer, sizeof solid.layer);
  return solid;
}

sonde_status sonde_subject_give_solid(sonde_subject *subject, const sonde_interior *interior,
                                      const sonde_probe *probes, uint32_t probe_count,
                                      sonde_error *error) {
  SONDE_ASSERT(subject->setup.is_solid && !subject->solid && !subject->now.placed);
  const sonde_session_solid *solid = &subject->setup.solid;
  sonde_status status = sonde_def_check("a session's solid", solid->version, error);
  if (!status && subject->setup.preset_count > 0)
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "the hyperelastic solid goes without presets, which "
                        "are of the springs");
  if (!status && fabs(subject->dt_s - 1e-3) > 1e-9)
    status =
        sonde_fail(error, SONDE_ARGUMENT,
                   "ticks of %g s: the hyperelastic solid has those of 0.001 s", subject->dt_s);
  const sonde_bounded range = {"edge_m", solid->edge_m, 5e-3, 20e-3};
  if (!status) status = sonde_bounded_check(&range, 1, error);
  if (status) return status;
  sonde_solid_leg_def def = sonde_solid_leg_def_default();
  def.model = subject->model, def.columns = interior, def.skin = subject->rest_skin;
  def.probes = subject->probes = probes, def.probe_count = probe_count;
  def.mesh.edge_m = solid->edge_m;
  memcpy(def.live.solid.layer, solid->layer, sizeof solid->layer);
  subject->told = SONDE_LEG_AS_DONE;
  return sonde_solid_leg_create(&def, &subject->solid, error);
}

void sonde_subject_destroy(sonde_subject *subject) {
  if (!subject) return;
  sonde_solid_leg_destroy(subject->solid);
  sonde_surface_index_destroy(subject->rest_skin);
  sonde_gel_destroy(subject->gel);
  sonde_state_destroy(subject->state);
  sonde_free(subject);
}

sonde_status sonde_subject_recall(sonde_subject *subject, const void *saved, size_t bytes,
                                  sonde_error *error) {
  size_t own = sonde_subject_save(subject, NULL);
  sonde_subject_moment moment;
  if (bytes > own) memcpy(&moment, saved, sizeof moment);
  // Bytes of a file may hold anything.
  const sonde_session_controls *c = &moment.controls;
  if (bytes <= own ||
      !(c->stiffness_scale >= 0.5 && c->stiffness_scale <= 2 && c->damping_scale >= 0.25 &&
        c->damping_scale <= 4 && c->friction_scale >= 0 && c->friction_scale <= 2 &&
        c->posture < SONDE_POSTURE_COUNT && v_finite(moment.drift_m_s) &&
        (!moment.placed || sonde_pose_usable(moment.pose))))
    return sonde_fail(error, SONDE_FORMAT, "the saved moment is damaged");
  sonde_subject_restore(subject, saved);
  subject->felt = (sonde_contact){0};
  if (subject->solid) {
    const sonde_status status = sonde_solid_leg_recall(subject->solid, &moment.rest, error);
    if (status) return status;
  }
  return sonde_state_restore(subject->state, (const char *)saved + own, bytes - own, error);
}
