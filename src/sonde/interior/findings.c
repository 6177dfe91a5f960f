// What a case adds to a leg, lesions and clots in branches: checked once, applied at every update.
#include "base/base.h"
#include "interior/interior.h"

#include <string.h>

static const double least_half_m = 0.5e-3, most_half_m = 50e-3;
static const sonde_label labels[SONDE_LESION_KINDS] = {
    [SONDE_LESION_NODE] = SONDE_LABEL_NODE,
    [SONDE_LESION_CYST] = SONDE_LABEL_CYST,
    [SONDE_LESION_HAEMATOMA] = SONDE_LABEL_HAEMATOMA,
};

static bool within(double value, double low, double high) { return value >= low && value <= high; }

uint32_t sonde_interior_vessel_count(const sonde_interior *in) {
  SONDE_ASSERT(in != NULL && in->vessel_count >= 2);
  return in->vessel_count;
}

const char *sonde_interior_vessel_name(const sonde_interior *in, int which) {
  SONDE_ASSERT(in != NULL && which >= 0 && (uint32_t)which < in->vessel_count);
  if (which < 2) return which == 0 ? "femoral_vein" : "femoral_artery";
  return in->model->anatomy->branch[which - 2].name;
}

// Across the lesion's axis, x as far towards the skin as that allows.
static lesion_frame frame_of(const sonde_interior *in, const sonde_lesion *l) {
  sonde_column_point at;
  (void)sonde_interior_locate(in, l->centre_m, &at);
  sonde_vec3 out = v_add(v_scale(in->e1, cos(at.theta)), v_scale(in->e2, sin(at.theta)));
  sonde_vec3 z = v_unit(l->axis, in->axis), spare = v_cross(in->axis, z);
  sonde_vec3 x = v_madd(out, -v_dot(out, z), z);
  x = v_norm(x) > 1e-3 ? v_unit(x, in->e1) : v_unit(spare, in->e1);
  return (lesion_frame){v_scale(x, 1 / l->half_m.x), v_scale(v_cross(z, x), 1 / l->half_m.y),
                        v_scale(z, 1 / l->half_m.z)};
}

static bool in_tissue(const sonde_interior *in, sonde_vec3 rest) {
  sonde_label label = sonde_interior_label(in, rest, NULL);
  return label != SONDE_LABEL_OUTSIDE && label != SONDE_LABEL_BONE;
}

// SONDE_VESSELS when the leg has none of that name.
static uint32_t find_branch(const sonde_interior *in, const char *name) {
  for (uint32_t which = 2; which < in->vessel_count; ++which)
    if (strcmp(sonde_interior_vessel_name(in, (int)which), name) == 0) return which;
  return SONDE_VESSELS;
}

sonde_status sonde_interior_set_findings(sonde_interior *in, const sonde_findings *findings,
                                         sonde_error *error) {
  SONDE_ASSERT(in != NULL);
  static const sonde_findings none;
  const sonde_findings *f = findings != NULL ? findings : &none;
  sonde_status status = SONDE_OK;
  if (f->lesion_count > SONDE_LESIONS || f->branch_count > SONDE_BRANCHES)
    return sonde_fail(error, SONDE_ARGUMENT, "%u lesions and %u branches; expected at most %d",
                      f->lesion_count, f->branch_count, SONDE_LESIONS);
  if (!within(f->webs, 0, 1) || !within(f->oedema, 0, 1))
    return sonde_fail(error, SONDE_ARGUMENT, "webs %g and oedema %g; expected 0 to 1", f->webs,
                      f->oedema);
  in->findings.lesion_count = 0; // an old lesion is tissue for the new ones
  for (uint32_t k = 0; k < f->lesion_count && !status; ++k) {
    const sonde_lesion *l = &f->lesion[k];
    if ((uint32_t)l->kind >= SONDE_LESION_KINDS)
      return sonde_fail(error, SONDE_ARGUMENT, "lesion %u is of unknown kind %d", k, (int)l->kind);
    if (!within(l->half_m.x, least_half_m, most_half_m) ||
        !within(l->half_m.y, least_half_m, most_half_m) ||
        !within(l->half_m.z, least_half_m, most_half_m))
      return sonde_fail(error, SONDE_ARGUMENT, "lesion %u: semi-axes of %g to %g mm expected", k,
                        least_half_m * 1e3, most_half_m * 1e3);
    if (!within(v_norm(l->axis), 0.99, 1.01) || !within(l->echogenicity, 0, 1))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "lesion %u: a unit axis and an echogenicity of 0 to 1 expected", k);
    bool fits = v_finite(l->centre_m) && in_tissue(in, l->centre_m);
    for (int end = 0; end < 6 && fits; ++end) {
      const lesion_frame frame = frame_of(in, l);
      const sonde_vec3 axis = end < 2 ? frame.x : end < 4 ? frame.y : frame.z;
      double offset = (end % 2 ? 1 : -1) / v_norm2(axis);
      fits = in_tissue(in, v_madd(l->centre_m, offset, axis));
    }
    if (!fits)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "lesion %u at (%.1f, %.1f, %.1f) mm is not inside the soft tissue", k,
                        l->centre_m.x * 1e3, l->centre_m.y * 1e3, l->centre_m.z * 1e3);
  }
  for (uint32_t k = 0; k < f->branch_count && !status; ++k) {
    const sonde_branch_finding *b = &f->branch[k];
    const sonde_pathology *p = &b->pathology;
    if (memchr(b->branch, 0, sizeof b->branch) == NULL)
      return sonde_fail(error, SONDE_ARGUMENT, "branch %u: the name has no end", k);
    uint32_t which = find_branch(in, b->branch);
    if (which == SONDE_VESSELS)
      return sonde_fail(error, SONDE_ARGUMENT, "this leg has no branch '%s'", b->branch);
    for (uint32_t other = 0; other < k; ++other)
      if (strcmp(f->branch[other].branch, b->branch) == 0)
        return sonde_fail(error, SONDE_ARGUMENT, "branch '%s' is named twice", b->branch);
    bool clot = p->thrombus_fraction > 0;
    if (clot && in->course[which].kind == SONDE_VESSEL_ARTERY)
      return sonde_fail(error, SONDE_ARGUMENT, "'%s' is an artery; clots lie in veins", b->branch);
    if (!within(p->thrombus_fraction, 0, 1) || !within(p->echogenicity, 0, 1) ||
        (clot && !within(p->thrombus_modulus_pa, 100, 1e7)) || !within(p->lumen_scale, 0.1, 3) ||
        !within(p->wall_shear_pa, 0, 1e7) || !isfinite(p->thrombus_from_m + p->thrombus_to_m) ||
        (unsigned)p->form > SONDE_CLOT_RECANALISED)
      return sonde_fail(error, SONDE_ARGUMENT, "branch '%s': a value is out of range", b->branch);
  }
  if (status) return status;
  in->findings = *f;
  sonde_sections_mark(in); // a wider lumen reaches farther
  for (uint32_t k = 0; k < f->lesion_count; ++k) in->lesion[k] = frame_of(in, &f->lesion[k]);
  return SONDE_OK;
}

// A branch is healthy unless the case says otherwise, under the pressures of the femoral vessels.
void sonde_findings_apply(sonde_interior *in, const sonde_pathology *pathology) {
  SONDE_ASSERT(in->vessel_count >= 2 && in->vessel_count <= SONDE_VESSELS);
  in->pathology[0] = in->pathology[1] = *pathology;
  for (uint32_t which = 2; which < in->vessel_count; ++which)
    in->pathology[which] = (sonde_pathology){.lumen_scale = 1};
  for (uint32_t k = 0; k < in->findings.branch_count; ++k) {
    const uint32_t which = find_branch(in, in->findings.branch[k].branch);
    if (which < in->vessel_count) in->pathology[which] = in->findings.branch[k].pathology;
  }
  for (uint32_t which = 2; which < in->vessel_count; ++which) {
    in->pathology[which].venous_pressure_pa = pathology->venous_pressure_pa;
    in->pathology[which].arterial_pressure_pa = pathology->arterial_pressure_pa;
  }
}

sonde_vec3 sonde_lesion_point(const sonde_interior *in, uint32_t lesion, sonde_vec3 rest) {
  SONDE_ASSERT(lesion < in->findings.lesion_count);
  const lesion_frame *f = &in->lesion[lesion];
  sonde_vec3 d = v_sub(rest, in->findings.lesion[lesion].centre_m);
  return vec3(v_dot(d, f->x), v_dot(d, f->y), v_dot(d, f->z));
}

sonde_label sonde_lesion_label(const sonde_interior *in, sonde_vec3 rest) {
  for (uint32_t k = 0; k < in->findings.lesion_count; ++k)
    if (v_norm2(sonde_lesion_point(in, k, rest)) <= 1) return labels[in->findings.lesion[k].kind];
  return SONDE_LABEL_COUNT;
}
