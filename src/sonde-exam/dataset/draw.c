// What is drawn by the plan's seed: patients, and where, how and with what they are pressed.
#include "base/maths.h"
#include "dataset/dataset.h"
#include "sonde/files_scanner.h"

#include <string.h>

static const double CLEAR_M = 0.01; // between the face and the skin at the start of a press
static const double EDGE = 0.03;    // share of the vein that is left out at either end
enum { ATTEMPTS = 64, BUILDS = 4 };

uint64_t sonde_dataset_key(uint64_t seed, uint32_t leg, uint32_t press,
                           sonde_dataset_purpose purpose) {
  const uint64_t patient = sonde_random_bits(seed, leg);
  return sonde_random_bits(patient, (uint64_t)press << 8 | (uint64_t)purpose);
}

static double between(uint64_t key, uint64_t counter, double low, double high) {
  return low + (high - low) * sonde_random_uniform(key, counter);
}

// One of the bits that are set, each as likely.
static uint32_t one_of(uint64_t key, uint64_t counter, uint32_t bits) {
  SONDE_ASSERT(bits != 0);
  uint32_t left = (uint32_t)(sonde_random_uniform(key, counter) * (double)__builtin_popcount(bits));
  uint32_t k = 0;
  for (;; ++k)
    if (bits >> k & 1 && left-- == 0) return k;
}

sonde_status sonde_dataset_draw_leg(const sonde_dataset_plan *plan, uint32_t leg,
                                    const char *bundled, sonde_case *patient,
                                    sonde_case_setup *setup, sonde_error *error) {
  SONDE_ASSERT(plan && patient && setup);
  const uint64_t key = sonde_dataset_key(plan->seed, leg, 0, SONDE_DATASET_FOR_PATIENT);
  const bool clot = sonde_random_uniform(key, 0) < plan->clot_share;
  const sonde_case_level level = (sonde_case_level)one_of(key, 1, plan->levels);
  const uint32_t position = one_of(key, 2, plan->positions);
  sonde_status status = SONDE_OK;
  uint32_t built = 0;
  for (uint32_t k = 0; k < ATTEMPTS && built < BUILDS; ++k) {
    sonde_case_generate(sonde_random_bits(key, 8 + k) & UINT32_MAX, level, patient);
    if (patient->thrombosis != clot) continue;
    if (plan->body == SONDE_DATASET_BUNDLED) {
      patient->thigh = SONDE_CASE_BUNDLED;
    } else if (patient->circulation.posture == SONDE_POSTURE_SUPINE) {
      patient->position = (sonde_limb_position)position;
    }
    ++built;
    *setup = (sonde_case_setup){0};
    status = sonde_case_build(patient, bundled, NULL, setup, error);
    if (!status || status == SONDE_MEMORY) return status;
    if (plan->body == SONDE_DATASET_BUNDLED && !bundled) return status;
  }
  if (built) return status;
  return sonde_fail(error, SONDE_CONVERGENCE,
                    "leg %u: no case of level %s %s a thrombosis in %d draws", leg,
                    sonde_case_level_name(level), clot ? "with" : "without", ATTEMPTS);
}

sonde_status sonde_dataset_scanner(const sonde_dataset_def *def, uint32_t which,
                                   sonde_scanner *scanner, sonde_error *error) {
  SONDE_ASSERT(def && which < def->plan->scanner_count && scanner);
  return sonde_scanner_find(def->plan->scanner[which], def->scanners, scanner, error);
}

// A pose moved along one of its own axes.
static sonde_pose moved(sonde_pose pose, int axis, double by_m) {
  const sonde_mat3 axes = q_matrix(pose.rotation);
  pose.position = v_madd(pose.position, by_m, m_column(&axes, axis));
  return pose;
}

sonde_status sonde_dataset_draw_press(const sonde_dataset_def *def, uint32_t leg, uint32_t number,
                                      const sonde_case_setup *setup, double half_width_m,
                                      sonde_dataset_press *press, sonde_error *error) {
  SONDE_ASSERT(def && def->plan && setup && press);
  const sonde_dataset_plan *plan = def->plan;
  const sonde_vein_map *map = &setup->map;
  const uint64_t place = sonde_dataset_key(plan->seed, leg, number, SONDE_DATASET_FOR_PLACE);
  const uint64_t hand = sonde_dataset_key(plan->seed, leg, number, SONDE_DATASET_FOR_HAND);
  const uint64_t force = sonde_dataset_key(plan->seed, leg, number, SONDE_DATASET_FOR_FORCE);
  const uint64_t time = sonde_dataset_key(plan->seed, leg, number, SONDE_DATASET_FOR_TIME);
  const uint64_t scanner = sonde_dataset_key(plan->seed, leg, number, SONDE_DATASET_FOR_SCANNER);
  *press = (sonde_dataset_press){.along_vein_m = (double)NAN};
  sonde_pose pose;
  if (map->station_count > 0 && sonde_random_uniform(place, 0) < plan->station_share) {
    const uint32_t k = (uint32_t)between(place, 1, 0, map->station_count);
    pose = map->station[k].probe;
    snprintf(press->place, sizeof press->place, "%s", map->station[k].name);
  } else {
    press->along_vein_m = between(place, 2, EDGE, 1 - EDGE) * map->length_m;
    const sonde_vein_point point = sonde_vein_at(map, press->along_vein_m);
    const uint32_t segment = sonde_vein_segment_at(map, point.z_m);
    pose = sonde_vein_pose(&point, 0);
    if (segment < map->segment_count)
      snprintf(press->place, sizeof press->place, "%s", map->segment[segment].name);
  }
  // The hand: beside the vein, tilted, turned; and a quarter turn to look along it.
  press->along = sonde_random_uniform(place, 3) < plan->along_share;
  const double turn_rad = plan->turn_rad * sonde_random_normal(hand, 3);
  const double shift_m = press->along ? 0 : plan->shift_m * sonde_random_normal(hand, 0);
  pose = moved(pose, 0, shift_m);
  pose.rotation = q_mul(pose.rotation, q_about(2, turn_rad + (press->along ? SONDE_PI / 2 : 0)));
  for (int axis = 0; axis < 2; ++axis)
    pose.rotation =
        q_mul(pose.rotation,
              q_about(axis, plan->tilt_rad * sonde_random_normal(hand, 1 + (uint64_t)axis)));
  pose.rotation = q_unit(pose.rotation);
  press->start = moved(pose, 2, -CLEAR_M);
  press->force_n = between(force, 0, plan->force_low_n, plan->force_high_n);
  press->at_s = between(time, 0, 1, 9);

  // One of the plan's scanners, its settings as the plan has them.
  const uint32_t which = (uint32_t)between(scanner, 0, 0, plan->scanner_count);
  snprintf(press->scanner_name, sizeof press->scanner_name, "%s", plan->scanner[which]);
  sonde_status status = sonde_dataset_scanner(def, which, &press->scanner, error);
  if (status) return status;
  const sonde_echo_range *ranges = sonde_echo_ranges();
  for (int k = 0; k < SONDE_ECHO_SETTINGS; ++k) {
    if (isnan(plan->setting[k][0])) continue;
    const double value =
        ranges[k].si * between(scanner, 1 + (uint64_t)k, plan->setting[k][0], plan->setting[k][1]);
    memcpy((char *)&press->scanner.settings + ranges[k].offset, &value, sizeof value);
  }
  press->scanner.settings = sonde_echo_settings_clamp(press->scanner.settings);
  press->aperture_m = press->scanner.aperture_m > 0 ? press->scanner.aperture_m : 2 * half_width_m;
  return sonde_echo_check_view(press->aperture_m, press->scanner.radius_m, error);
}
