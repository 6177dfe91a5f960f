// What is known of a frame beside its arrays, as JSON.
#include "base/maths.h"
#include "dataset/dataset.h"
#include "sonde/base_json.h"

#include <string.h>

enum { DIGITS = 9 };
static const double MM = 1e3, DEG = 180 / SONDE_PI;

static void put(sonde_json_out *out, const char *key, double value) {
  sonde_json_put_real(out, key, value, DIGITS);
}

static void put_list(sonde_json_out *out, const char *key, const double *values, uint32_t count) {
  SONDE_ASSERT(values && count > 0);
  sonde_json_begin_list(out, key);
  for (uint32_t k = 0; k < count; ++k) put(out, NULL, values[k]);
  sonde_json_end(out);
}

// Patient and case; a limb's body with all its parameters.
static void put_patient(sonde_json_out *out, const sonde_dataset_moment *m) {
  const sonde_case *c = m->patient;
  sonde_json_begin_object(out, "patient");
  sonde_json_put_text(out, "case", c->id);
  sonde_json_put_text(out, "body", c->thigh == SONDE_CASE_LEG ? "limb" : "bundled");
  sonde_json_put_text(out, "level", sonde_case_level_name(c->level));
  sonde_json_put_text(out, "position", sonde_position_key(m->setup->position));
  sonde_json_put_bool(out, "deep_vein_thrombosis", c->thrombosis);
  sonde_json_put_text(out, "diagnosis", c->diagnosis);
  sonde_json_put_text(out, "vein", m->pathology.name);
  put(out, "thrombus_fraction", m->pathology.thrombus_fraction);
  put(out, "thrombus_modulus_kpa", 1e-3 * m->pathology.thrombus_modulus_pa);
  put(out, "thrombus_echogenicity", m->pathology.echogenicity);
  put(out, "venous_mmhg", m->pathology.venous_pressure_pa / SONDE_PA_PER_MMHG);
  put(out, "arterial_mmhg", m->pathology.arterial_pressure_pa / SONDE_PA_PER_MMHG);
  const sonde_limb *limb = sonde_limb_of(m->setup->model);
  if (limb) {
    sonde_limb_body body = *sonde_limb_body_of(limb);
    uint32_t count;
    const sonde_parameter *p = sonde_limb_parameters(&count);
    sonde_json_put_text(out, "sex", body.sex == SONDE_SEX_FEMALE ? "female" : "male");
    sonde_json_put_text(out, "side", body.side == SONDE_LIMB_LEFT ? "left" : "right");
    sonde_json_begin_object(out, "parameters");
    for (uint32_t k = 0; k < count; ++k)
      put(out, p[k].name, *sonde_parameter_of(&body, &p[k]) / p[k].unit);
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

sonde_status sonde_dataset_describe(const sonde_dataset_moment *m, char **text, size_t *count,
                                    sonde_error *error) {
  SONDE_ASSERT(m && m->press && m->truth && text && count);
  sonde_file *file;
  sonde_status status = sonde_file_in_memory(&file, error);
  if (status) return status;
  sonde_json_out json = {.file = file, .layout = SONDE_JSON_TABS}, *out = &json;
  const sonde_dataset_press *press = m->press;
  const double pixel_m = m->truth->width_m / m->truth->width;
  sonde_json_begin_object(out, NULL);
  sonde_json_put_integer(out, "leg", m->leg);
  sonde_json_put_integer(out, "press", m->press_number);
  sonde_json_put_integer(out, "frame", m->frame);
  put(out, "force_n", m->force_n);
  put(out, "way_mm", m->way_m * MM);
  const double wrench[6] = {m->force[0],  m->force[1],  m->force[2],
                            m->torque[0], m->torque[1], m->torque[2]};
  put_list(out, "wrench", wrench, 6);
  const sonde_pose *pose = &m->pose;
  const double position[3] = {pose->position.x, pose->position.y, pose->position.z};
  const double rotation[4] = {pose->rotation.w, pose->rotation.x, pose->rotation.y,
                              pose->rotation.z};
  put_list(out, "position_m", position, 3);
  put_list(out, "rotation_wxyz", rotation, 4);
  sonde_json_put_text(out, "place", press->place);
  put(out, "along_vein_mm", press->along_vein_m * MM);
  sonde_json_put_text(out, "view", press->along ? "longitudinal" : "transverse");
  put(out, "time_s", press->at_s);
  put(out, "residual", m->residual);
  sonde_json_put_integer(out, "branch_jumps", m->jumps);
  put(out, "pixel_mm", pixel_m * MM);
  put(out, "width_mm", m->truth->width_m * MM);
  put(out, "height_mm", m->truth->height_m * MM);
  sonde_json_begin_object(out, "scanner");
  sonde_json_put_text(out, "name", press->scanner_name);
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k) {
    const sonde_echo_range *r = &sonde_echo_ranges()[k];
    double value;
    memcpy(&value, (const char *)&press->scanner.settings + r->offset, sizeof value);
    put(out, r->key, value / r->si);
  }
  put(out, "aperture_mm", press->aperture_m * MM);
  put(out, "radius_mm", press->scanner.radius_m * MM);
  sonde_json_put_integer(out, "lines", m->lines);
  sonde_json_put_integer(out, "samples", m->samples);
  sonde_json_end(out);
  put_patient(out, m);
  sonde_json_begin_list(out, "vessels");
  for (uint32_t k = 0; k < m->vessel_count; ++k) {
    const sonde_dataset_vessel *v = &m->vessel[k];
    const sonde_vessel_state *s = &v->state;
    sonde_json_begin_object(out, NULL);
    sonde_json_put_integer(out, "number", v->number);
    sonde_json_put_text(out, "name", v->name);
    sonde_json_put_text(out, "kind", v->artery ? "artery" : "vein");
    put(out, "area_ratio", s->area_ratio);
    put(out, "rest_area_mm2", SONDE_PI * s->rest_radius_m * s->rest_radius_m * MM * MM);
    put(out, "area_mm2", SONDE_PI * s->half_short_m * s->half_long_m * MM * MM);
    put(out, "short_mm", 2 * s->half_short_m * MM);
    put(out, "long_mm", 2 * s->half_long_m * MM);
    put(out, "outside_mmhg", s->outside_pa / SONDE_PA_PER_MMHG);
    put(out, "tilt_deg", v->tilt_rad * DEG);
    put(out, "x_mm", v->x_m * MM);
    put(out, "z_mm", v->z_m * MM);
    put(out, "drawn_mm2", (v->lumen + v->clot) * pixel_m * pixel_m * MM * MM);
    put(out, "drawn_clot_mm2", v->clot * pixel_m * pixel_m * MM * MM);
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_json_end(out);
  sonde_file_printf(file, "\n");
  return sonde_file_take(file, text, count, error);
}
