// Writing a case file that reads to the same case.
#include "sonde/base_json.h"
#include "trainer/case.h"

#include <string.h>

// A YAML string in double quotes has JSON's escapes.
static void put_quoted(sonde_file *file, const char *before, const char *text) {
  sonde_json_out out = {.file = file, .layout = SONDE_JSON_COMPACT};
  sonde_file_printf(file, "%s", before);
  sonde_json_put_text(&out, NULL, text);
  sonde_file_printf(file, "\n");
}

static void put_station(sonde_file *file, const char *key, const sonde_station *s) {
  if (s->of_branch)
    sonde_file_printf(file, "%s: {share: %.12g, shift_mm: %.12g}", key, s->share, 1e3 * s->shift_m);
  else if (s->station[0])
    sonde_file_printf(file, "%s: {station: %s, shift_mm: %.12g}", key, s->station,
                      1e3 * s->shift_m);
  else if (s->landmark[0])
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
  sonde_pathology usual;
  if (sonde_pathology_preset(p->name, &usual, NULL) || usual.form != p->form)
    sonde_file_printf(file, "%sform: %s", before, sonde_case_clot_forms[p->form]);
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

// Parameters that are known.
static void put_parameters(sonde_file *file, const sonde_parameter *p, uint32_t count,
                           void *known) {
  SONDE_ASSERT(p != NULL && known != NULL);
  for (uint32_t i = 0; i < count; ++i) {
    double value = *sonde_parameter_of(known, &p[i]);
    if (isfinite(value)) sonde_file_printf(file, "  %s: %.12g\n", p[i].name, value / p[i].unit);
  }
}

static void put_case(sonde_file *file, const sonde_case *c) {
  sonde_file_printf(file, "sonde_case: %d\n", SONDE_CASE_VERSION);
  put_quoted(file, "id: ", c->id);
  put_quoted(file, "title: ", c->title);
  sonde_file_printf(file, "level: %s\n", sonde_case_levels[c->level]);
  put_quoted(file, "history: ", c->history);
  if (c->note[0]) put_quoted(file, "note: ", c->note);

  if (c->thigh == SONDE_CASE_BUNDLED) sonde_file_printf(file, "thigh: bundled\n");
  if (c->thigh == SONDE_CASE_MODEL) put_quoted(file, "thigh:\n  model: ", c->model);
  if (c->thigh == SONDE_CASE_GENERATED) {
    sonde_file_printf(file, "thigh:\n  seed: %llu\n  sex: %s\n", (unsigned long long)c->seed,
                      sonde_case_sexes[c->known.sex]);
    uint32_t count;
    const sonde_parameter *p = sonde_thigh_parameters(&count);
    sonde_thigh known = c->known;
    put_parameters(file, p, count, &known);
  }

  if (c->thigh == SONDE_CASE_LEG) {
    sonde_limb_body known = c->leg;
    uint32_t count;
    const sonde_parameter *p = sonde_limb_parameters(&count);
    sonde_file_printf(file, "leg:\n  seed: %llu\n  sex: %s\n  side: %s\n",
                      (unsigned long long)c->seed, sonde_case_sexes[known.sex],
                      sonde_case_sides[known.side]);
    if (c->position < SONDE_LIMB_POSITIONS)
      sonde_file_printf(file, "  position: %s\n", sonde_case_positions[c->position]);
    if (c->positions != CASE_ALL_POSITIONS) {
      sonde_file_printf(file, "  positions: [");
      for (uint32_t k = 0; k < SONDE_LIMB_POSITIONS; ++k)
        if (c->positions >> k & 1) sonde_file_printf(file, "%s, ", sonde_case_positions[k]);
      sonde_file_printf(file, "]\n");
    }
    put_parameters(file, p, count, &known);
  }

  const sonde_circulation *flow = &c->circulation;
  sonde_file_printf(file, "circulation: {posture: %s, breath_mmhg: %.12g",
                    sonde_case_postures[flow->posture], flow->breath_pa / SONDE_PA_PER_MMHG);
  if (flow->valsalva_to_s > flow->valsalva_from_s)
    sonde_file_printf(file, ", valsalva_from_s: %.12g, valsalva_to_s: %.12g", flow->valsalva_from_s,
                      flow->valsalva_to_s);
  if (flow->valve_leak > 0) sonde_file_printf(file, ", valve_leak: %.12g", flow->valve_leak);
  sonde_file_printf(file, ", valsalva_mmhg: %.12g}\n", flow->valsalva_pa / SONDE_PA_PER_MMHG);

  sonde_file_printf(file, "vein:");
  put_clot(file, "\n  ", &c->pathology, &c->extent);
  sonde_file_printf(file, "\n  webs: %.12g\n", c->webs);

  SONDE_ASSERT(c->lesion_count <= SONDE_LESIONS && c->branch_count <= SONDE_BRANCHES);
  if (c->lesion_count || c->branch_count || c->oedema > 0)
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

  sonde_file_printf(file, "truth:\n  thrombosis: %s\n", c->thrombosis ? "true" : "false");
  put_quoted(file, "  diagnosis: ", c->diagnosis);
  sonde_file_printf(file, "  segments:\n");
  for (uint32_t i = 0; i < c->truth_count; ++i)
    sonde_file_printf(file, "    %s: %s\n", c->truth_segment[i], sonde_decision_name(c->truth[i]));
  if (c->look_alike_count) sonde_file_printf(file, "  look_alikes:\n");
  for (uint32_t i = 0; i < c->look_alike_count; ++i) put_quoted(file, "  - ", c->look_alike[i]);
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
