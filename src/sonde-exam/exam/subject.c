// The thigh under the probe: creation.
#include "exam/subject.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/gel.h"
#include "haptics/motion.h"

#include <string.h>

// The vertex of the skin nearest to a point at rest.
static sonde_vec3 skin_at(const sonde_mesh *skin, sonde_vec3 point_m) {
  return skin->vertices[v_nearest(skin->vertices, skin->vertex_count, point_m)];
}

// Half over the sites, half along the vein, where an exam goes. Shares overlap, so that the film is
// closed between the places.
static void spread(sonde_subject *subject) {
  const sonde_model *model = subject->model;
  const double radius_m = 0.02, along_m = 0.03, all_m3 = subject->setup.gel_m3;
  uint32_t sites = model->site_count, points = model->vein.count;
  if (!(all_m3 > 0)) return;
  double half = sites && points ? 0.5 : 1.0;
  for (uint32_t i = 0; i < sites; ++i)
    sonde_gel_put(subject->gel, model->sites[i].position_m, radius_m, half * all_m3 / sites);
  for (uint32_t i = 0; i < points; ++i)
    sonde_gel_put(subject->gel, skin_at(&model->surface, model->vein.point[i].centre_m), along_m,
                  half * all_m3 / points);
}

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
  spread(subject);
  subject->now.controls = *controls;
  subject->now.controls.valsalva = false;
  sonde_subject_control(subject, controls);
  *out = subject;
  return SONDE_OK;
}

void sonde_subject_destroy(sonde_subject *subject) {
  if (!subject) return;
  sonde_surface_index_destroy(subject->rest_skin);
  sonde_gel_destroy(subject->gel);
  sonde_state_destroy(subject->state);
  sonde_free(subject);
}

// Bytes of a file may hold anything.
static bool usable(const sonde_subject_moment *m) {
  const sonde_session_controls *c = &m->controls;
  return c->stiffness_scale >= 0.5 && c->stiffness_scale <= 2 && c->damping_scale >= 0.25 &&
         c->damping_scale <= 4 && c->friction_scale >= 0 && c->friction_scale <= 2 &&
         c->posture < SONDE_POSTURE_COUNT && v_finite(m->drift_m_s) &&
         (!m->placed || sonde_pose_usable(m->pose));
}

sonde_status sonde_subject_recall(sonde_subject *subject, const void *saved, size_t bytes,
                                  sonde_error *error) {
  size_t own = sonde_subject_save(subject, NULL);
  sonde_subject_moment moment;
  if (bytes > own) memcpy(&moment, saved, sizeof moment);
  if (bytes <= own || !usable(&moment))
    return sonde_fail(error, SONDE_FORMAT, "the saved moment is damaged");
  sonde_subject_restore(subject, saved);
  return sonde_state_restore(subject->state, (const char *)saved + own, bytes - own, error);
}
