// bench_closing OUT.csv [SEED [BMI...]]: what closes the veins of drawn limbs at the stations of an
// examination. For women and men of each body mass index (default 19, 24, 30, 36) a row for each
// vein of each station: the force of a slow press of a face of 50 x 12 mm, lying, at which its area
// in the image plane passes 5 % of that at rest, what the artery beside it keeps there and what the
// vein keeps of its area when it is filled by a clot; the cuffs that close it lying, sitting and
// standing (docs/interior.md). A vein beside the station's beam, or along it, has a press of its
// own, with the probe slid over it.
#include "sonde/limb_model.h"
#include "sonde/limb_vessels.h"
#include "sonde/sonde.h"

#include "interior/interior.h"
#include "pose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double CLOSED = 0.05, STEP_M = 1.5e-3, DEEPEST_M = 0.060, BEYOND = 1.25, LIFT_M = 2e-3;
static const double AT_ONCE_S = -1,
                    LATER_S = 10; // vessels in equilibrium, with the window that follows
static const double CUFF_MMHG[][2] = {{14, 40}, {28, 90}, {36, 110}}, CUFF_STEP = 2; // by posture
static const char *const CLOTS[] = {"acute_occlusive", "subacute_occlusive", "chronic_occlusive",
                                    "partial_mural"};
static const char *const FACE = "rect:50x12"; // the longest of those that the bands are made for
static const double BESIDE_M = 5e-3,          // so far from the beam a vein is not under the middle
    MOST_ALONG_BEAM = 0.5,                    // cosine between a vein that is pressed and the beam
    ALONG_M = 25e-3, ROUND_M = 0.05;          // how far the probe slides along; the leg's radius
enum { CLOT_COUNT = 4, POSTURES = 3, MOST_VEINS = SONDE_LIMB_STATION_VEINS };

typedef struct leg {
  sonde_model *model;
  const sonde_limb *limb; // the model's
  sonde_vein_map map;     // with its stations
  sonde_state *state;
  sonde_interior *interior;
  sonde_probe probe;
  sonde_pathology healthy;
} leg;

// A vein of a station.
typedef struct vein {
  int which, artery;       // numbers of the interior
  sonde_pose probe;        // on the skin
  bool slid;               // off the station's place
  double depth_m, band[2]; // of its front wall along the beam; forces between which it may close
  bool closed;
  double area, force_n, artery_area; // of the last look; of closing once it is closed
  double cuff_mmhg[POSTURES], kept[CLOT_COUNT];
} vein;

// The interior's number of a vessel of the limb: the longest of its names that the limb's begins
// with. Names of the interior have '_' for ' ' and may lack last words.
static int find_vessel(const leg *l, uint32_t vessel) {
  static const char *const MAIN[2][4] = {
      {"external_iliac_vein", "common_femoral_vein", "femoral_vein", "popliteal_vein"},
      {"external_iliac_artery", "common_femoral_artery", "superficial_femoral_artery",
       "popliteal_artery"}};
  sonde_limb_vessel v = sonde_limb_vessel_get(l->limb, vessel);
  for (char *c = v.name; *c; ++c)
    if (*c == ' ') *c = '_';
  for (int main = 0; main < 2; ++main)
    for (int k = 0; k < 4; ++k)
      if (strcmp(v.name, MAIN[main][k]) == 0) return main;
  int found = -1;
  size_t longest = 0;
  for (int k = 2; k < (int)sonde_interior_vessel_count(l->interior); ++k) {
    const char *name = sonde_interior_vessel_name(l->interior, k);
    size_t length = strlen(name);
    if (length <= longest || strncmp(v.name, name, length) != 0) continue;
    if (v.name[length] == '\0' || v.name[length] == '_') longest = length, found = k;
  }
  return found;
}

// The probe, which lies on the skin, moved `depth_m` along its beam.
static sonde_pose pushed(sonde_pose on, double depth_m) {
  return pose_shift(on, depth_m, pose_axis(on, 2));
}

// Puts the probe for a vein of a station and says how deep below the skin the vein's front wall is
// there: at the station when the vein is under the middle of the face and runs across the beam,
// else where it does so next, on the nearest skin that the probe reaches by leaning in its plane.
static void put_probe(const leg *l, sonde_pose station, uint32_t vessel, double arc_m, vein *v) {
  const double step_m = 1e-3;
  const sonde_vec3 beam = pose_axis(station, 2), across = pose_axis(station, 0);
  sonde_limb_vessel_point place = {0};
  sonde_vec3 middle = {0};
  for (double way_m = 0; way_m <= ALONG_M; way_m += step_m) {
    place = sonde_limb_vessel_place(l->limb, vessel, arc_m + way_m);
    middle = sonde_limb_to_model(l->limb, place.centre_m);
    const sonde_limb_vessel_point next =
        sonde_limb_vessel_place(l->limb, vessel, arc_m + way_m + 2 * step_m);
    const sonde_vec3 run = v_sub(sonde_limb_to_model(l->limb, next.centre_m), middle);
    v->slid = way_m > 0;
    if (fabs(v_dot(v_unit(run, across), beam)) < MOST_ALONG_BEAM) break;
  }
  const double beside_m = fabs(v_dot(v_sub(middle, station.position), across));
  v->slid |= beside_m > BESIDE_M;
  sonde_surface_point best = {0};
  double least_m = INFINITY;
  const double most_rad = v->slid ? beside_m / ROUND_M : 0; // the skin turns no more on its way
  for (double lean = -most_rad; lean <= most_rad; lean += 0.02) {
    const sonde_vec3 back = v_madd(v_scale(beam, -cos(lean)), sin(lean), across);
    sonde_surface_point above;
    if (!sonde_surface_raycast(l->interior->skin, middle, back, 0.2, &above)) continue;
    const double far_m = v_distance(middle, above.point_m);
    if (far_m < least_m) least_m = far_m, best = above;
  }
  v->probe = station;
  v->depth_m = isfinite(least_m) ? fmax(least_m - place.radius_m, 1e-3) : 1e-3;
  if (!v->slid || !isfinite(least_m)) return;
  const sonde_vec3 down = v_unit(v_sub(middle, best.point_m), beam);
  const sonde_vec3 y = v_unit(v_cross(down, across), pose_axis(station, 1));
  v->probe.position = best.point_m;
  v->probe.rotation = q_from_matrix(m_columns(v_cross(y, down), y, down));
}

static void update(const leg *l, sonde_pose pose, const sonde_pathology *pathology, double dt_s,
                   double cuff_pa, sonde_posture posture) {
  sonde_interior_update(
      l->interior, &(sonde_interior_input){.positions_m = sonde_state_positions(l->state),
                                           .contact_forces_n = sonde_state_contact_forces(l->state),
                                           .world_from_probe = pose,
                                           .pathology = pathology,
                                           .dt_s = dt_s,
                                           .face_half_x_m = l->probe.half_x_m,
                                           .face_half_y_m = l->probe.half_y_m,
                                           .cuff_pa = cuff_pa,
                                           .posture = posture});
}

// Area of a vessel in the image plane over that at rest; NaN: it is not there.
static double area_of(const leg *l, int which, sonde_pose pose) {
  sonde_vessel_state v;
  bool seen = which >= 0 && sonde_interior_vessel_at_plane(l->interior, which, pose, &v);
  return seen ? v.area_ratio : (double)NAN;
}

// All veins filled by one clot, or none (NULL).
static sonde_status fill_veins(const leg *l, const sonde_pathology *clot, sonde_error *error) {
  static sonde_findings findings;
  const sonde_thigh_anatomy *a = l->model->anatomy;
  memset(&findings, 0, sizeof findings);
  for (uint32_t k = 0; clot && k < a->branch_count; ++k) {
    if (a->branch[k].kind != SONDE_VESSEL_VEIN) continue;
    sonde_branch_finding *to = &findings.branch[findings.branch_count++];
    to->pathology = *clot;
    memcpy(to->branch, a->branch[k].name, sizeof to->branch);
  }
  return sonde_interior_set_findings(l->interior, &findings, error);
}

// The skin has just been pressed so far that some veins have closed: what clots would keep of them.
static sonde_status try_clots(const leg *l, sonde_pose pose, vein *veins, uint32_t count,
                              sonde_error *error) {
  sonde_status status = SONDE_OK;
  for (int c = 0; c < CLOT_COUNT && !status; ++c) {
    sonde_pathology clot;
    status = sonde_pathology_preset(CLOTS[c], &clot, error);
    if (!status) status = fill_veins(l, &clot, error);
    if (status) return status;
    update(l, pose, &clot, LATER_S, 0, SONDE_POSTURE_SUPINE);
    for (uint32_t k = 0; k < count; ++k)
      if (veins[k].closed && isnan(veins[k].kept[c]))
        veins[k].kept[c] = area_of(l, veins[k].which, pose);
  }
  return status ? status : fill_veins(l, NULL, error);
}

// Presses slowly at one place until all veins are closed, or to 1.25 times the end of the deepest
// one's band.
static sonde_status press(const leg *l, uint32_t count, vein *veins, sonde_error *error) {
  sonde_path_def def = sonde_path_def_default();
  uint32_t open = count;
  double most_n = 0;
  for (uint32_t k = 0; k < count; ++k) most_n = fmax(most_n, BEYOND * veins[k].band[1]);
  double force_n = 0, dt_s = AT_ONCE_S;
  sonde_status status = SONDE_OK;
  def.relative_residual = 1e-4, def.step_m = STEP_M;
  sonde_state_reset(l->state);
  for (double depth_m = -LIFT_M; open && depth_m < DEEPEST_M && force_n < most_n && !status;
       depth_m += STEP_M) {
    sonde_path_result path;
    status = sonde_settle_path(l->state, &l->probe, pushed(veins->probe, depth_m),
                               pushed(veins->probe, depth_m + STEP_M), &def, NULL, &path, error);
    if (status || !(path.force_n > 0.05)) continue;
    update(l, path.pose, &l->healthy, dt_s, 0, SONDE_POSTURE_SUPINE);
    dt_s = LATER_S;
    bool closing = false;
    for (uint32_t k = 0; k < count; ++k) {
      vein *v = &veins[k];
      const double area = area_of(l, v->which, path.pose), before = v->area;
      double artery = area_of(l, v->artery, path.pose);
      if (isnan(artery)) artery = area_of(l, 1, path.pose);
      if (v->closed || isnan(area)) continue;
      // Between two looks force and artery go evenly with the vein's area.
      const double share = area <= CLOSED ? (before - CLOSED) / (before - area) : 1;
      v->closed = area <= CLOSED;
      v->force_n = force_n + share * (path.force_n - force_n);
      v->artery_area += share * (artery - v->artery_area);
      v->area = area;
      open -= v->closed, closing |= v->closed;
    }
    force_n = path.force_n;
    if (closing) status = try_clots(l, path.pose, veins, count, error);
    if (closing) update(l, path.pose, &l->healthy, LATER_S, 0, SONDE_POSTURE_SUPINE);
  }
  return status;
}

// Cuffs that close the veins of all stations, without a probe.
static void try_cuffs(const leg *l, const sonde_limb_station *stations, vein (*veins)[MOST_VEINS]) {
  static const sonde_posture POSTURE[POSTURES] = {SONDE_POSTURE_SUPINE, SONDE_POSTURE_SITTING,
                                                  SONDE_POSTURE_STANDING};
  sonde_state_reset(l->state);
  for (int p = 0; p < POSTURES; ++p) {
    // The groin's pressure in this posture; the interior adds the blood's weight below it.
    sonde_circulation still = sonde_circulation_default();
    sonde_pathology filled = l->healthy;
    still.posture = POSTURE[p], still.breath_pa = 0;
    sonde_circulation_apply(&still, 0, 1e-3, &filled);
    double before[SONDE_LIMB_STATIONS][MOST_VEINS];
    for (double cuff = CUFF_MMHG[p][0]; cuff <= CUFF_MMHG[p][1]; cuff += CUFF_STEP) {
      update(l, pushed(veins[0]->probe, -LIFT_M), &filled, AT_ONCE_S, cuff * SONDE_PA_PER_MMHG,
             POSTURE[p]);
      for (int s = 0; s < SONDE_LIMB_STATIONS; ++s)
        for (uint32_t k = 0; k < stations[s].veins; ++k) {
          vein *v = &veins[s][k];
          double area = area_of(l, v->which, v->probe), was = before[s][k];
          before[s][k] = area;
          if (!isnan(v->cuff_mmhg[p]) || !(area <= CLOSED)) continue;
          double back = cuff > CUFF_MMHG[p][0] ? (CLOSED - area) / (was - area) : 0;
          v->cuff_mmhg[p] = cuff - back * CUFF_STEP;
        }
    }
  }
}

static void write_number(FILE *out, double value, const char *format) {
  fputc(',', out);
  if (isfinite(value)) fprintf(out, format, value);
}

static void write_rows(FILE *out, const leg *l, const char *sex, double bmi,
                       const sonde_limb_station *stations, vein (*veins)[MOST_VEINS]) {
  for (int s = 0; s < SONDE_LIMB_STATIONS; ++s)
    for (uint32_t k = 0; k < stations[s].veins; ++k) {
      const vein *v = &veins[s][k];
      const sonde_limb_station *at = &stations[s];
      if (isnan(v->cuff_mmhg[0])) continue; // the plane of the picture does not meet it
      char name[64];                        // no commas in a table
      snprintf(name, sizeof name, "%s", at->name);
      for (char *c = strchr(name, ','); c; c = strchr(c, ',')) memmove(c, c + 1, strlen(c));
      fprintf(out, "%s,%g,%s,%s,%.1f,%.2f,%.2f,%d,%.4f,%.2f", sex, bmi, name,
              sonde_limb_vessel_get(l->limb, at->vein[k]).name, 1e3 * v->depth_m, v->band[0],
              v->band[1], v->closed, v->area, v->force_n);
      write_number(out, v->artery_area, "%.3f");
      for (int c = 0; c < CLOT_COUNT; ++c) write_number(out, v->kept[c], "%.3f");
      for (int p = 0; p < POSTURES; ++p) write_number(out, v->cuff_mmhg[p], "%.1f");
      fputc('\n', out);
    }
  fflush(out);
}

static sonde_status measure(FILE *out, sonde_sex sex, double bmi, uint64_t seed,
                            sonde_error *error) {
  static leg l;
  l = (leg){0};
  vein veins[SONDE_LIMB_STATIONS][MOST_VEINS];
  sonde_limb_station stations[SONDE_LIMB_STATIONS];
  sonde_limb_body body = sonde_limb_unknown();
  const sonde_limb_model_def def = sonde_limb_model_def_default();
  sonde_world_def world = sonde_world_def_default();
  world.engine = SONDE_ENGINE_DOUBLE; // nothing but equilibria
  body.sex = sex, body.bmi = bmi;
  sonde_status status = sonde_limb_draw(&body, seed, &body, error);
  if (!status) status = sonde_limb_model(&body, &def, &l.model, error);
  if (!status) status = sonde_vein_map_make(l.model, &l.map, error);
  if (!status) status = sonde_probe_create(FACE, &l.probe, error);
  if (!status) status = sonde_state_create(l.model, &world, &l.state, error);
  if (!status) status = sonde_interior_create(l.model, &l.interior, error);
  if (!status) status = sonde_pathology_preset("healthy", &l.healthy, error);
  if (!status) {
    sonde_interior_for_vessels(l.interior, true);
    sonde_interior_wait(l.interior, true);
    l.limb = sonde_limb_of(l.model);
    sonde_limb_stations(l.limb, stations);
    for (int s = 0; s < SONDE_LIMB_STATIONS; ++s)
      for (uint32_t k = 0; k < stations[s].veins; ++k) {
        uint32_t mate = sonde_limb_vessel_get(l.limb, stations[s].vein[k]).mate;
        vein *v = &veins[s][k];
        *v = (vein){.area = 1, .artery_area = 1, .which = find_vessel(&l, stations[s].vein[k])};
        put_probe(&l, l.map.station[s].probe, stations[s].vein[k], stations[s].arc_m[k], v);
        sonde_limb_force_band(v->depth_m, v->band);
        v->artery = mate == SONDE_LIMB_NO_VESSEL ? 1 : find_vessel(&l, mate);
        for (int c = 0; c < CLOT_COUNT; ++c) v->kept[c] = (double)NAN;
        for (int p = 0; p < POSTURES; ++p) v->cuff_mmhg[p] = (double)NAN;
      }
    try_cuffs(&l, stations, veins);
  }
  // Veins under one face are pressed together, the others one by one.
  for (int s = 0; s < SONDE_LIMB_STATIONS && !status; ++s)
    for (uint32_t k = 0, together; k < stations[s].veins && !status; k += together) {
      for (together = 1;
           !veins[s][k].slid && k + together < stations[s].veins && !veins[s][k + together].slid;)
        ++together;
      status = press(&l, together, &veins[s][k], error);
    }
  if (!status) write_rows(out, &l, sex == SONDE_SEX_MALE ? "male" : "female", bmi, stations, veins);
  sonde_interior_destroy(l.interior);
  sonde_state_destroy(l.state);
  sonde_probe_clear(&l.probe);
  sonde_model_destroy(l.model);
  return status;
}

int main(int argc, char **argv) {
  static const double USUAL[] = {19, 24, 30, 36};
  const long seed = argc > 2 ? atol(argv[2]) : 1;
  const int count = argc > 3 ? argc - 3 : 4;
  if (argc < 2 || seed < 0) {
    fprintf(stderr, "usage: bench_closing OUT.csv [SEED [BMI...]]\n");
    return 2;
  }
  FILE *out = fopen(argv[1], "w");
  if (!out) {
    fprintf(stderr, "bench_closing: %s cannot be written\n", argv[1]);
    return 1;
  }
  fprintf(out, "sex,bmi,station,vein,depth_mm,least_n,most_n,closed,area,force_n,artery");
  for (int c = 0; c < CLOT_COUNT; ++c) fprintf(out, ",%s", CLOTS[c]);
  fprintf(out, ",cuff_supine_mmhg,cuff_sitting_mmhg,cuff_standing_mmhg\n");
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  for (int k = 0; k < count && !status; ++k)
    for (int sex = 0; sex < 2 && !status; ++sex)
      status =
          measure(out, sex ? SONDE_SEX_MALE : SONDE_SEX_FEMALE,
                  argc > 3 ? atof(argv[3 + k]) : USUAL[k], (uint64_t)(seed + 2 * k + sex), &error);
  if (status) fprintf(stderr, "bench_closing: %s\n", error.message);
  return fclose(out) != 0 || status;
}
