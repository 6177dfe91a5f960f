// JSON messages to the page.
#include "stream/page_message.h"

#include "base/maths.h"
#include "sonde/trainer.h"

#include <string.h>

// A number of at most ten digits; null when it is not finite or too large to matter.
static void put_real(sonde_json_out *out, const char *key, double value) {
  sonde_json_put_real(out, key, fabs(value) < 1e12 ? value : (double)NAN, 10);
}

static void put_vector(sonde_json_out *out, const char *key, sonde_vec3 v, double scale) {
  sonde_json_begin_list(out, key);
  put_real(out, NULL, v.x * scale);
  put_real(out, NULL, v.y * scale);
  put_real(out, NULL, v.z * scale);
  sonde_json_end(out);
}

// Of a limb: side and position, and where knee cap and foot belong in a picture of it.
static void put_limb(sonde_json_out *out, const sonde_model *model) {
  const sonde_limb *limb = sonde_limb_of(model);
  if (!limb) return;
  const sonde_limb_pose *pose = sonde_limb_pose_of(model);
  const sonde_limb_position position = sonde_limb_position_of(model);
  const double kneecap = 0.97, ankle = 2; // levels
  sonde_pose shin = {{0, 0, 0}, quat_identity()};
  if (pose) shin = sonde_limb_pose_bone(pose, SONDE_LIMB_TIBIA);
  sonde_vec3 knee_m = sonde_limb_point(limb, kneecap, 0, 1);
  if (pose) knee_m = sonde_limb_pose_point(pose, knee_m);
  sonde_vec3 ankle_m = pose_apply(shin, sonde_limb_point(limb, ankle, 0, 0));
  sonde_vec3 down = q_rotate(shin.rotation, vec3(0, 0, -1)),
             forward = q_rotate(shin.rotation, vec3(0, 1, 0));
  down.z = -down.z, forward.z = -forward.z; // the model's z runs the other way
  sonde_json_begin_object(out, "limb");
  sonde_json_put_text(out, "side",
                      sonde_limb_body_of(limb)->side == SONDE_LIMB_LEFT ? "left" : "right");
  sonde_json_put_text(out, "position", sonde_position_key(position));
  sonde_json_put_text(out, "title", sonde_position_title(position));
  const sonde_vec3 up = model->gravity.up;
  put_vector(out, "up", v_norm2(up) > 0 ? up : vec3(0, 1, 0), 1);
  put_vector(out, "kneecap_mm", sonde_limb_to_model(limb, knee_m), 1e3);
  put_vector(out, "ankle_mm", sonde_limb_to_model(limb, ankle_m), 1e3);
  put_vector(out, "down", down, 1);
  put_vector(out, "forward", forward, 1);
  put_real(out, "ankle_radius_mm", 1e3 * sonde_limb_girth(limb, ankle) / (2 * SONDE_PI));
  sonde_json_end(out);
}

void page_write_hello(sonde_json_out *out, const page_hello *hello) {
  SONDE_ASSERT(hello->model && (hello->probes || hello->probe_count == 0));
  const sonde_model *model = hello->model;
  sonde_json_begin_object(out, NULL);
  sonde_json_put_text(out, "type", "hello");
  sonde_json_put_integer(out, "version", PAGE_VERSION);
  sonde_json_put_text(out, "program", sonde_version());
  sonde_json_put_text(out, "model", model->name);
  sonde_json_put_text(out, "provenance", model->provenance);
  sonde_json_put_integer(out, "nodes", model->surface.vertex_count);
  sonde_json_put_integer(out, "faces", model->surface.face_count);
  put_real(out, "force_limit_n", hello->force_limit_n);
  sonde_json_put_bool(out, "controls", hello->controls);
  sonde_json_begin_list(out, "probes");
  for (uint32_t i = 0; i < hello->probe_count; ++i) {
    const sonde_probe *probe = hello->probes[i];
    sonde_json_begin_object(out, NULL);
    sonde_json_put_text(out, "name", probe->name);
    put_real(out, "half_x_mm", probe->half_x_m * 1e3);
    put_real(out, "half_y_mm", probe->half_y_m * 1e3);
    sonde_json_put_bool(out, "rectangular", probe->rectangular);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_json_begin_list(out, "cases");
  for (const char *const *name = sonde_pathology_names(); *name; ++name)
    sonde_json_put_text(out, NULL, *name);
  sonde_json_end(out);
  sonde_json_begin_list(out, "faults");
  for (int i = 0; i < SONDE_FAULT_COUNT; ++i)
    sonde_json_put_text(out, NULL, sonde_fault_text((sonde_fault)i));
  sonde_json_end(out);
  // Sites, each with the measured points of every probe in the order of the data.
  sonde_json_begin_list(out, "sites");
  for (uint32_t k = 0; k < model->site_count; ++k) {
    const sonde_site *site = &model->sites[k];
    sonde_json_begin_object(out, NULL);
    sonde_json_put_integer(out, "id", site->id);
    put_vector(out, "position_mm", site->position_m, 1e3);
    put_vector(out, "normal", site->normal, 1);
    put_vector(out, "u", site->u, 1);
    put_vector(out, "v", site->v, 1);
    sonde_json_begin_object(out, "curves");
    for (uint32_t i = 0; i < hello->probe_count; ++i) {
      const char *probe = hello->probes[i]->name;
      sonde_json_begin_list(out, probe);
      for (const sonde_datum *d = model->data; d && d < model->data + model->datum_count; ++d) {
        if (d->site != site->id || strcmp(d->probe, probe) != 0) continue;
        sonde_json_begin_list(out, NULL);
        put_real(out, NULL, d->penetration_m * 1e3);
        put_real(out, NULL, d->force_n);
        sonde_json_end(out);
      }
      sonde_json_end(out);
    }
    sonde_json_end(out);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  put_limb(out, model);
  if (hello->more && hello->more[0]) sonde_file_printf(out->file, ",%s", hello->more);
  sonde_json_end(out);
}

static const char *const POSTURES[SONDE_POSTURE_COUNT] = {"supine", "sitting", "standing"};

bool page_posture_parse(const char *name, sonde_posture *posture) {
  for (int k = 0; k < SONDE_POSTURE_COUNT; ++k) {
    if (strcmp(name, POSTURES[k]) != 0) continue;
    *posture = (sonde_posture)k;
    return true;
  }
  return false;
}

void page_write_controls(sonde_json_out *out, const sonde_session_controls *controls,
                         const char *probe_name, page_hidden hidden, double gel_m3,
                         page_role role) {
  static const char *const WHO[] = {"nobody", "learner", "watcher", "teacher"};
  static const char *const MAY[] = {"", "take", "give", "return"};
  const sonde_echo_settings *echo = &controls->echo;
  SONDE_ASSERT(controls->posture < SONDE_POSTURE_COUNT);
  sonde_json_begin_object(out, NULL);
  sonde_json_put_text(out, "type", "controls");
  sonde_json_put_bool(out, "controls", role.controls);
  sonde_json_put_text(out, "role", WHO[role.is]);
  sonde_json_put_text(out, "holder", WHO[role.holder]);
  sonde_json_put_text(out, "may", MAY[role.may]);
  sonde_json_put_text(out, "probe", probe_name);
  sonde_json_put_text(out, "case", hidden.pathology ? "" : controls->pathology.name);
  sonde_json_put_bool(out, "stop", controls->stop);
  // The scanner's settings in the page's units.
  put_real(out, "gain_db", echo->gain_db);
  put_real(out, "depth_mm", echo->depth_m * 1e3);
  put_real(out, "frequency_mhz", echo->frequency_hz * 1e-6);
  put_real(out, "dynamic_range_db", echo->dynamic_range_db);
  put_real(out, "focus_mm", echo->focus_m * 1e3);
  put_real(out, "tgc_db_per_cm", echo->tgc_db_per_m * 1e-2);
  // The patient and the tissue.
  if (!hidden.posture) sonde_json_put_text(out, "posture", POSTURES[controls->posture]);
  sonde_json_put_bool(out, "valsalva", controls->valsalva);
  sonde_json_put_bool(out, "gel", controls->gel);
  put_real(out, "gel_ml", gel_m3 * 1e6);
  put_real(out, "stiffness_scale", controls->stiffness_scale);
  put_real(out, "damping_scale", controls->damping_scale);
  put_real(out, "friction_scale", controls->friction_scale);
  const sonde_duplex_controls *duplex = &controls->duplex;
  // Colour over the image.
  const double *box_m = &duplex->box.left_m;
  SONDE_ASSERT(duplex->shown <= SONDE_DUPLEX_POWER);
  sonde_json_put_text(out, "colour", page_colour_word[duplex->shown]);
  sonde_json_begin_list(out, "colour_box_mm");
  for (int k = 0; k < 4; ++k) put_real(out, NULL, box_m[k] * 1e3);
  sonde_json_end(out);
  if (!hidden.steer) put_real(out, "colour_steer_deg", duplex->box.steer_rad * 180 / SONDE_PI);
  put_real(out, "colour_scale_cm_s", duplex->scale_m_s * 100);
  put_real(out, "colour_gain_db", duplex->gain_db);
  // The gate.
  const sonde_gate_settings *gate = &duplex->gate;
  sonde_json_put_bool(out, "gate", duplex->gated);
  sonde_json_begin_list(out, "gate_mm");
  put_real(out, NULL, gate->x_m * 1e3);
  put_real(out, NULL, gate->z_m * 1e3);
  sonde_json_end(out);
  for (size_t k = 0; k < PAGE_GATE_NUMBERS; ++k)
    if (!(hidden.steer && page_gate_number[k].offset == offsetof(sonde_gate_settings, steer_rad)))
      put_real(out, page_gate_number[k].key,
               *(const double *)((const char *)gate + page_gate_number[k].offset) /
                   page_gate_number[k].si);
  sonde_json_end(out);
}
