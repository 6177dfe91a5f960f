// Truth beside a picture: arrays of what its pixels show, and their files.
#include "base/base.h"
#include "base/maths.h"
#include "echo/truth.h"
#include "sonde/sweep_truth.h"

static void put(float out[3], sonde_vec3 v) {
  out[0] = (float)v.x, out[1] = (float)v.y, out[2] = (float)v.z;
}

sonde_status sonde_truth_create(const sonde_echo *echo, const sonde_image *image,
                                sonde_truth *truth, sonde_error *error) {
  SONDE_ASSERT(echo != NULL && image != NULL && truth != NULL);
  const size_t pixels = (size_t)image->width * image->height;
  *truth = (sonde_truth){.width = image->width,
                         .height = image->height,
                         .width_m = image->width_m,
                         .height_m = image->height_m,
                         .tick = image->tick};
  truth->tissue = SONDE_NEW(uint8_t, pixels);
  truth->vessel = SONDE_NEW(uint8_t, pixels);
  truth->place_m = sonde_calloc(pixels, sizeof *truth->place_m);
  truth->displacement_m = sonde_calloc(pixels, sizeof *truth->displacement_m);
  truth->velocity_m_s = sonde_calloc(pixels, sizeof *truth->velocity_m_s);
  if (!truth->tissue || !truth->vessel || !truth->place_m || !truth->displacement_m ||
      !truth->velocity_m_s) {
    sonde_truth_clear(truth);
    return sonde_fail_memory(error);
  }
  const sonde_pose probe = sonde_truth_pose(echo);
  const sonde_mat3 local = m_transpose(q_matrix(probe.rotation));
  for (size_t i = 0; i < pixels; ++i) {
    sonde_truth_pixel p;
    if (!sonde_truth_at(echo, image, (uint32_t)(i % image->width), (uint32_t)(i / image->width),
                        &p))
      continue;
    truth->tissue[i] = (uint8_t)p.label;
    truth->vessel[i] = (uint8_t)p.vessel;
    put(truth->place_m[i], pose_apply_inverse(probe, p.point_m));
    if (p.label != SONDE_LABEL_OUTSIDE)
      put(truth->displacement_m[i], m_mul_v(local, v_sub(p.point_m, p.rest_m)));
    put(truth->velocity_m_s[i], m_mul_v(local, p.velocity_m_s));
  }
  return SONDE_OK;
}

void sonde_truth_clear(sonde_truth *truth) {
  if (truth == NULL) return;
  void *parts[] = {truth->tissue, truth->vessel, truth->place_m, truth->displacement_m,
                   truth->velocity_m_s};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  *truth = (sonde_truth){0};
}

sonde_vec3 sonde_truth_drawn(const sonde_echo *echo, sonde_vec3 point_m) {
  SONDE_ASSERT(echo != NULL);
  return sonde_truth_drawn_at(echo, point_m);
}

const char *sonde_truth_label_name(sonde_label label) {
  static const char *const NAMES[SONDE_LABEL_COUNT] = {
      "outside",     "skin",   "fat",  "muscle", "bone",      "vein_wall", "vein",   "thrombus",
      "artery_wall", "artery", "node", "cyst",   "haematoma", "fascia",    "tendon", "nerve"};
  SONDE_ASSERT((uint32_t)label < SONDE_LABEL_COUNT);
  return NAMES[label];
}

sonde_status sonde_truth_save_vectors(const sonde_truth *truth, const float (*vectors)[3],
                                      const char *unit, const char *path, sonde_error *error) {
  SONDE_ASSERT(truth != NULL && vectors != NULL && unit != NULL && path != NULL);
  sonde_file *file;
  const sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  const double x_mm = 1e3 * truth->width_m / truth->width;
  const double y_mm = 1e3 * truth->height_m / truth->height;
  sonde_file_printf(file,
                    "NRRD0004\ntype: float\ndimension: 3\nsizes: 3 %u %u\nspacings: nan %.9g %.9g\n"
                    "kinds: vector domain domain\nunits: \"%s\" \"mm\" \"mm\"\nendian: little\n"
                    "encoding: raw\ntick:=%llu\n\n",
                    truth->width, truth->height, x_mm, y_mm, unit, (unsigned long long)truth->tick);
  sonde_file_write(file, vectors, (size_t)truth->width * truth->height * sizeof *vectors);
  return sonde_file_commit(file, error);
}
