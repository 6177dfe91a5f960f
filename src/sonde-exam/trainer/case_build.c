// A case on its thigh: the model, the pathology where its vein has the places, and the check that
// the truth is what was built.
#include "trainer/case.h"
#include "exam/vessels.h"
#include "tissue/anatomy.h"

#include <string.h>

// The id of a case may tell its finding, and the page tells learners the name of the leg they
// press.
static const char LEG_NAME[] = "Leg of a case";

// Less clot than this in a segment does not make it a segment with a clot.
static const double CLOT_M = 0.005;

static sonde_status get_model(const sonde_case *from, const char *bundled, const char *directory,
                              sonde_model **model, sonde_error *error) {
  if (from->thigh == SONDE_CASE_GENERATED) {
    sonde_thigh thigh;
    sonde_thigh_shape *shape = NULL;
    sonde_thigh_def def = sonde_thigh_def_default();
    def.name = LEG_NAME;
    def.provenance = "Synthetic thigh of a training case";
    sonde_status status = sonde_thigh_draw(&from->known, from->seed, &thigh, error);
    if (!status) status = sonde_thigh_shape_create(&thigh, &shape, error);
    if (!status) status = sonde_thigh_build(&thigh, shape, &def, model, error);
    sonde_thigh_shape_destroy(shape);
    return status;
  }
  if (from->thigh == SONDE_CASE_LEG) {
    sonde_limb_body body;
    sonde_limb_model_def def = sonde_limb_model_def_default();
    def.name = LEG_NAME;
    def.provenance = "Synthetic limb of a training case";
    sonde_limb_setting setting;
    if (from->position < SONDE_LIMB_POSITIONS) {
      setting = sonde_limb_setting_usual(from->position);
      def.setting = &setting;
    }
    sonde_status status = sonde_limb_draw(&from->leg, from->seed, &body, error);
    return status ? status : sonde_limb_model(&body, &def, model, error);
  }
  if (from->thigh == SONDE_CASE_BUNDLED) {
    if (bundled) return sonde_limb_model_load(bundled, model, error);
    return sonde_fail(error, SONDE_NOT_FOUND, "case %s needs the bundled thigh", from->id);
  }
  char path[4096];
  bool alone = !directory || from->model[0] == '/';
  snprintf(path, sizeof path, "%.3700s%s%s", alone ? "" : directory, alone ? "" : "/", from->model);
  return sonde_limb_model_load(path, model, error);
}

// A stretch of vein as z of the model. @param line of the branch that has the clot; NULL: main vein
static sonde_status place_extent(const sonde_case_extent *extent, const sonde_vein_map *map,
                                 const sonde_vessel *line, sonde_pathology *pathology,
                                 sonde_error *error) {
  pathology->thrombus_from_m = pathology->thrombus_to_m = 0; // all
  if (extent->whole) return SONDE_OK;
  const sonde_station *end[2] = {&extent->from, &extent->to};
  double z_m[2], along_m[2] = {0, 1};
  for (int k = 0; k < 2; ++k) {
    if (line && end[k]->of_branch) { // a share of its length, shifted along it
      double length_m = 0, left_m;
      for (uint32_t i = 1; i < line->count; ++i)
        length_m += v_distance(line->point[i].centre_m, line->point[i - 1].centre_m);
      along_m[k] = left_m = clamp(end[k]->share * length_m + end[k]->shift_m, 0, length_m);
      z_m[k] = line->point[line->count - 1].centre_m.z;
      for (uint32_t i = 1; i < line->count && left_m >= 0; ++i) {
        sonde_vec3 a = line->point[i - 1].centre_m, b = line->point[i].centre_m;
        double piece_m = v_distance(a, b);
        if (left_m <= piece_m) z_m[k] = a.z + (piece_m > 0 ? left_m / piece_m : 0) * (b.z - a.z);
        left_m -= left_m <= piece_m ? INFINITY : piece_m;
      }
      continue;
    }
    sonde_status status = sonde_station_find(end[k], map, &along_m[k], error);
    if (status) return status;
    z_m[k] = sonde_vein_at(map, along_m[k]).z_m;
  }
  if (end[0]->of_branch != end[1]->of_branch)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a clot from a place of the branch to one of another vein, expected both "
                      "as shares of the branch");
  if (!(along_m[1] > along_m[0]))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a clot from %.0f to %.0f mm along the vein, expected from < to",
                      1e3 * along_m[0], 1e3 * along_m[1]);
  double a = z_m[0], b = z_m[1];
  pathology->thrombus_from_m = fmin(a, b);
  pathology->thrombus_to_m = fmax(a, b);
  return SONDE_OK;
}

static sonde_status place_findings(const sonde_case *from, sonde_case_setup *setup,
                                   sonde_error *error) {
  SONDE_ASSERT(from->lesion_count <= SONDE_LESIONS && from->branch_count <= SONDE_BRANCHES);
  sonde_findings *findings = &setup->findings;
  findings->lesion_count = from->lesion_count;
  for (uint32_t i = 0; i < from->lesion_count; ++i) {
    const sonde_case_lesion *lesion = &from->lesion[i];
    double along;
    sonde_status status = sonde_station_find(&lesion->station, &setup->map, &along, error);
    if (status) return status;
    sonde_vein_point p = sonde_vein_at(&setup->map, along);
    sonde_vec3 below = v_madd(p.skin_m, -lesion->depth_m, p.normal);
    findings->lesion[i] = (sonde_lesion){.kind = lesion->kind,
                                         .centre_m = v_madd(below, lesion->across_m, p.across),
                                         .axis = v_unit(v_cross(p.normal, p.across), vec3(0, 0, 1)),
                                         .half_m = lesion->half_m,
                                         .echogenicity = lesion->echogenicity};
  }
  findings->branch_count = from->branch_count;
  for (uint32_t i = 0; i < from->branch_count; ++i) {
    const sonde_case_branch *branch = &from->branch[i];
    const sonde_thigh_anatomy *anatomy = setup->model->anatomy;
    const sonde_branch *there = anatomy ? sonde_anatomy_branch(anatomy, branch->branch) : NULL;
    if (!there || there->kind != SONDE_VESSEL_VEIN)
      return sonde_fail(error, SONDE_NOT_FOUND, "the thigh has no vein '%s'", branch->branch);
    sonde_branch_finding *to = &findings->branch[i];
    to->pathology = branch->pathology;
    memcpy(to->branch, branch->branch, sizeof to->branch);
    sonde_status status =
        place_extent(&branch->extent, &setup->map, &there->line, &to->pathology, error);
    if (status) return status;
  }
  return SONDE_OK;
}

// ---- truth

static double clot_length(const sonde_pathology *p, double from_m, double to_m) {
  if (!(p->thrombus_fraction > 0)) return 0;
  if (p->thrombus_from_m == p->thrombus_to_m) return to_m - from_m;
  return fmax(0, fmin(p->thrombus_to_m, to_m) - fmax(p->thrombus_from_m, from_m));
}

// What the findings come to, and whether every segment is called so.
static sonde_status find_truth(const sonde_case *from, sonde_case_setup *setup,
                               sonde_error *error) {
  const sonde_vein_map *map = &setup->map;
  const bool told = from->truth_count > 0;
  for (uint32_t k = 0; k < from->truth_count; ++k)
    if (sonde_vein_segment(map, from->truth_segment[k]) == SONDE_SEGMENTS)
      return sonde_fail(error, SONDE_MISMATCH, "%s: the truth names '%s', which the thigh has not",
                        from->id, from->truth_segment[k]);
  for (uint32_t i = 0; i < map->segment_count; ++i) {
    const sonde_exam_segment *segment = &map->segment[i];
    const bool main = segment->vein_count == 0;
    sonde_decision called = sonde_case_truth(from, segment->name);
    if (told && called == SONDE_DECISION_NONE)
      return sonde_fail(error, SONDE_MISMATCH, "%s: the truth misses the segment '%s'", from->id,
                        segment->name);

    // The second vein of a double one is a deep vein of the segment beside it.
    double from_m = segment->from_m, to_m = segment->to_m;
    double clot_m = main ? clot_length(&setup->pathology, from_m, to_m) : 0;
    for (uint32_t b = 0; b < setup->findings.branch_count; ++b) {
      const sonde_branch_finding *finding = &setup->findings.branch[b];
      const sonde_vessel *line =
          &sonde_anatomy_branch(setup->model->anatomy, finding->branch)->line;
      double z0 = line->point[0].centre_m.z, z1 = line->point[line->count - 1].centre_m.z;
      double first_m = fmax(from_m, fmin(z0, z1)), last_m = fmin(to_m, fmax(z0, z1));
      const char *of = sonde_segment_of_branch(finding->branch);
      bool twin = sonde_vein_is_double(finding->branch) && last_m > first_m;
      if (main && twin) clot_m = fmax(clot_m, clot_length(&finding->pathology, first_m, last_m));
      const sonde_pathology *p = &finding->pathology;
      if (main || !of || strcmp(of, segment->name) != 0 || !(p->thrombus_fraction > 0)) continue;
      double filled_m = 0; // pieces of the branch whose middle is in the clot
      for (uint32_t n = 1; n < line->count; ++n) {
        sonde_vec3 start = line->point[n - 1].centre_m, end = line->point[n].centre_m;
        double z_m = 0.5 * (start.z + end.z);
        bool all = p->thrombus_from_m == p->thrombus_to_m;
        if (all || (z_m >= p->thrombus_from_m && z_m <= p->thrombus_to_m))
          filled_m += v_distance(start, end);
      }
      clot_m = fmax(clot_m, filled_m);
    }
    setup->clot[i] = clot_m >= CLOT_M;
    setup->thrombosis |= setup->clot[i] && segment->kind != SONDE_SEGMENT_SUPERFICIAL;
    if (!told || (called == SONDE_DECISION_CLOT) == setup->clot[i]) continue;
    return sonde_fail(error, SONDE_MISMATCH,
                      "%s: the truth calls %s %s, but %.0f of its %.0f mm have a clot", from->id,
                      segment->name, called == SONDE_DECISION_CLOT ? "clot" : "compressible",
                      1e3 * clot_m, 1e3 * (to_m - from_m));
  }
  return SONDE_OK;
}

sonde_status sonde_case_build(const sonde_case *from, const char *bundled, const char *directory,
                              sonde_case_setup *setup, sonde_error *error) {
  SONDE_ASSERT(from && setup);
  *setup = (sonde_case_setup){
      .position = from->position, .pathology = from->pathology, .circulation = from->circulation};
  setup->findings.webs = from->webs;
  setup->findings.oedema = from->oedema;
  sonde_status status = sonde_case_check(from, error);
  if (!status) status = get_model(from, bundled, directory, &setup->model, error);
  if (!status) status = sonde_vein_map_make(setup->model, &setup->map, error);
  if (!status) status = place_extent(&from->extent, &setup->map, NULL, &setup->pathology, error);
  if (!status) status = place_findings(from, setup, error);
  if (!status) status = find_truth(from, setup, error);
  sonde_circulation_apply(&from->circulation, 0, 1e-3, &setup->pathology);
  if (status) sonde_case_setup_clear(setup);
  return status;
}

void sonde_case_setup_clear(sonde_case_setup *setup) {
  if (!setup) return;
  sonde_model_destroy(setup->model);
  *setup = (sonde_case_setup){0};
}

void sonde_case_session(const sonde_case_setup *setup, sonde_session_def *def) {
  SONDE_ASSERT(setup && setup->model && def);
  def->model = setup->model;
  def->controls.pathology = setup->pathology;
  def->controls.posture = setup->circulation.posture;
  def->findings = &setup->findings;
  def->circulate = true;
  def->circulation = setup->circulation;
}
