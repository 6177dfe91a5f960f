// Writing a case file that reads to the same case.
// put_text, put_station, put_clot: pieces.
#include "trainer/case.h"

#include <string.h>

static void put_text(sonde_file *file, const char *key, const char *text) {
  sonde_file_printf(file, "%s: ", key);
  sonde_json_text(file, text); // a YAML string in double quotes has JSON's escapes
  sonde_file_printf(file, "\n");
}

static void put_station(sonde_file *file, const char *key, const sonde_station *s) {
  if (s->landmark[0])
    sonde_file_printf(file, "%s: {landmark: %s, shift_mm: %.12g}", key, s->landmark,
                      1e3 * s->shift_m);
  else if (!s->segment[0])
    sonde_file_printf(file, "%s: %.12g", key, 1e3 * s->shift_m);
  else
    sonde_file_printf(file, "%s: {segment: %s, share: %.12g, shift_mm: %.12g}", key, s->segment,
                      s->share, 1e3 * s->shift_m);
}

static void put_clot(sonde_file *file, const char *before, const sonde_pathology *p,
                     const sonde_case_extent *extent) {
  sonde_file_printf(file, "%sstage: %s", before, p->name);
  sonde_file_printf(file, "%sfraction: %.12g", before, p->thrombus_fraction);
  sonde_file_printf(file, "%smodulus_kpa: %.12g", before, 1e-3 * p->thrombus_modulus_pa);
  sonde_file_printf(file, "%sechogenicity: %.12g", before, p->echogenicity);
  sonde_file_printf(file, "%slumen_scale: %.12g", before, p->lumen_scale);
  sonde_file_printf(file, "%swall_kpa: %.12g", before, 1e-3 * p->wall_shear_pa);
  if (extent->whole) return;
  sonde_file_printf(file, "%s", before);
  put_station(file, "from", &extent->from);
  sonde_file_printf(file, "%s", before);
  put_station(file, "to", &extent->to);
}

static void put_thigh(sonde_file *file, const sonde_case *c) {
  if (c->thigh == SONDE_CASE_BUNDLED) sonde_file_printf(file, "thigh: bundled\n");
  if (c->thigh == SONDE_CASE_MODEL) {
    sonde_file_printf(file, "thigh:\n  ");
    put_text(file, "model", c->model);
  }
  if (c->thigh != SONDE_CASE_GENERATED) return;
  sonde_file_printf(file, "thigh:\n  seed: %llu\n  sex: %s\n", (unsigned long long)c->seed,
                    sonde_case_sexes[c->known.sex]);
  uint32_t count;
  const sonde_thigh_parameter *p = sonde_thigh_parameters(&count);
  sonde_thigh known = c->known;
  for (uint32_t i = 0; i < count; ++i) {
    double value = *sonde_thigh_member(&known, &p[i]);
    if (isfinite(value)) sonde_file_printf(file, "  %s: %.12g\n", p[i].name, value / p[i].unit);
  }
}

static void put_circulation(sonde_file *file, const sonde_circulation *c) {
  sonde_file_printf(file, "circulation: {posture: %s, breath_mmhg: %.12g",
                    sonde_case_postures[c->posture], c->breath_pa / SONDE_PA_PER_MMHG);
  if (c->valsalva_to_s > c->valsalva_from_s)
    sonde_file_printf(file, ", valsalva_from_s: %.12g, valsalva_to_s: %.12g", c->valsalva_from_s,
                      c->valsalva_to_s);
  sonde_file_printf(file, ", valsalva_mmhg: %.12g}\n", c->valsalva_pa / SONDE_PA_PER_MMHG);
}

static void put_findings(sonde_file *file, const sonde_case *c) {
  if (c->lesion_count == 0 && c->branch_count == 0 && !(c->oedema > 0)) return;
  sonde_file_printf(file, "findings:\n  oedema: %.12g\n", c->oedema);
  if (c->lesion_count) sonde_file_printf(file, "  lesions:\n");
  for (uint32_t i = 0; i < c->lesion_count; ++i) {
    const sonde_case_lesion *l = &c->lesion[i];
    sonde_file_printf(file, "  - {kind: %s, ", sonde_case_lesions[l->kind]);
    put_station(file, "at", &l->station);
    sonde_file_printf(file, ", across_mm: %.12g, depth_mm: %.12g, ", 1e3 * l->across_m,
                      1e3 * l->depth_m);
    sonde_file_printf(file, "size_mm: [%.12g, %.12g, %.12g], echogenicity: %.12g}\n",
                      2e3 * l->half_m.x, 2e3 * l->half_m.y, 2e3 * l->half_m.z, l->echogenicity);
  }
  if (c->branch_count) sonde_file_printf(file, "  branches:\n");
  for (uint32_t i = 0; i < c->branch_count; ++i) {
    sonde_file_printf(file, "  - branch: %s", c->branch[i].branch);
    put_clot(file, "\n    ", &c->branch[i].pathology, &c->branch[i].extent);
    sonde_file_printf(file, "\n");
  }
}

static void put_truth(sonde_file *file, const sonde_case *c) {
  sonde_file_printf(file, "truth:\n  thrombosis: %s\n  ", c->thrombosis ? "true" : "false");
  put_text(file, "diagnosis", c->diagnosis);
  sonde_file_printf(file, "  segments:\n");
  for (uint32_t i = 0; i < c->truth_count; ++i)
    sonde_file_printf(file, "    %s: %s\n", c->truth_segment[i], sonde_decision_name(c->truth[i]));
  if (c->look_alike_count) sonde_file_printf(file, "  look_alikes:\n");
  for (uint32_t i = 0; i < c->look_alike_count; ++i) {
    sonde_file_printf(file, "  - ");
    sonde_json_text(file, c->look_alike[i]);
    sonde_file_printf(file, "\n");
  }
}

static void put_case(sonde_file *file, const sonde_case *from) {
  sonde_file_printf(file, "sonde_case: %d\n", SONDE_CASE_VERSION);
  put_text(file, "id", from->id);
  put_text(file, "title", from->title);
  sonde_file_printf(file, "level: %s\n", sonde_case_levels[from->level]);
  put_text(file, "history", from->history);
  if (from->note[0]) put_text(file, "note", from->note);
  put_thigh(file, from);
  put_circulation(file, &from->circulation);
  sonde_file_printf(file, "vein:");
  put_clot(file, "\n  ", &from->pathology, &from->extent);
  sonde_file_printf(file, "\n  webs: %.12g\n", from->webs);
  put_findings(file, from);
  put_truth(file, from);
}

sonde_status sonde_case_save(const sonde_case *from, const char *path, sonde_error *error) {
  SONDE_ASSERT(from && path);
  sonde_file *file;
  sonde_status status = sonde_case_check(from, error);
  if (!status) status = sonde_file_create(path, &file, error);
  if (status) return status;
  put_case(file, from);
  return sonde_file_commit(file, error);
}

sonde_status sonde_case_text(const sonde_case *from, char **text, sonde_error *error) {
  SONDE_ASSERT(from && text);
  sonde_file *file;
  size_t count;
  *text = NULL;
  sonde_status status = sonde_case_check(from, error);
  if (!status) status = sonde_file_in_memory(&file, error);
  if (status) return status;
  put_case(file, from);
  return sonde_file_take(file, text, &count, error);
}
