// Presets of what was identified: their file, ranges, and use on a model.
#include "base/bounds.h"
#include "base/maths.h"
#include "identify/forward.h"
#include "sonde/base_json.h"

#include <string.h>

enum { VERSION = 1 };
#define FORMAT_NAME "sonde-preset"

// A number of the file: value in SI = unit times the file's.
typedef struct field {
  const char *key;
  size_t offset;
  double unit, low, high; // low and high in the file's unit
  bool optional;          // NaN: not in the file
} field;

#define PLACE(member) offsetof(sonde_preset, member)
static const field FIELDS[] = {
    {"normal_damping_ms", PLACE(normal_damping_s), 1e-3, 0, 10000, true},
    {"edge_damping_ms", PLACE(edge_damping_s), 1e-3, 0, 10000, true},
    {"damping_multiplier", PLACE(damping_multiplier), 1, 0, 100, false},
    {"stiffness_scale", PLACE(stiffness_scale), 1, 0.05, 20, false},
    {"mu_static", PLACE(friction.mu_static), 1, 0, 5, false},
    {"mu_kinetic", PLACE(friction.mu_kinetic), 1, 0, 5, false},
    {"stribeck_speed_mm_s", PLACE(friction.stribeck_speed_m_s), 1e-3, 0.01, 10000, false},
    {"gel_film", PLACE(friction.gel_film), 1, 0, 100, false},
    {"mu_gel", PLACE(friction.mu_gel), 1, 0, 5, false}};

sonde_preset sonde_preset_default(void) {
  return (sonde_preset){.name = "default",
                        .normal_damping_s = NAN,
                        .edge_damping_s = NAN,
                        .damping_multiplier = 1,
                        .stiffness_scale = 1,
                        .friction = sonde_world_def_default().friction};
}

static double *value_of(sonde_preset *preset, const field *f) {
  SONDE_ASSERT(f->offset + sizeof(double) <= sizeof *preset);
  return (double *)(void *)((char *)preset + f->offset);
}

// Where a preset came from, for messages: "path:line: " or nothing.
typedef struct source {
  const char *path;
  const sonde_json *root;
} source;

static void place_of(const source *from, const char *key, char place[200]) {
  const sonde_json *item = from ? sonde_json_member(from->root, key) : NULL;
  place[0] = 0;
  if (from) snprintf(place, 200, "%.150s:%u: ", from->path, item ? sonde_json_line(item) : 1);
}

static sonde_status check(const sonde_preset *preset, const source *from, sonde_error *error) {
  sonde_preset copy = *preset;
  char place[200];
  for (size_t k = 0; k < SONDE_COUNT_OF(FIELDS); ++k) {
    const field *f = &FIELDS[k];
    double value = *value_of(&copy, f) / f->unit;
    if (isnan(value) && f->optional) continue;
    if (value >= f->low * (1 - 1e-9) && value <= f->high * (1 + 1e-9)) continue;
    place_of(from, f->key, place);
    return sonde_fail(error, from ? SONDE_FORMAT : SONDE_ARGUMENT, "%s%s is %g, expected %g to %g",
                      place, f->key, value, f->low, f->high);
  }
  if (preset->friction.mu_kinetic <= preset->friction.mu_static) return SONDE_OK;
  place_of(from, "mu_kinetic", place);
  return sonde_fail(error, from ? SONDE_FORMAT : SONDE_ARGUMENT,
                    "%smu_kinetic is %g, expected at most mu_static, %g", place,
                    preset->friction.mu_kinetic, preset->friction.mu_static);
}

static sonde_status read_item(const char *path, const sonde_json *item, sonde_preset *preset,
                              sonde_error *error) {
  const char *key = sonde_json_key(item), *text = sonde_json_as_text(item);
  unsigned line = sonde_json_line(item);
  for (size_t k = 0; k < SONDE_COUNT_OF(FIELDS); ++k) {
    const field *f = &FIELDS[k];
    if (strcmp(key, f->key) != 0) continue;
    if (sonde_json_kind_of(item) != SONDE_JSON_NUMBER)
      return sonde_fail(error, SONDE_FORMAT, "%s:%u: %s: expected a number from %g to %g", path,
                        line, key, f->low, f->high);
    *value_of(preset, f) = sonde_json_as_number(item) * f->unit;
    return SONDE_OK;
  }
  if (!strcmp(key, "name") && text) {
    snprintf(preset->name, sizeof preset->name, "%s", text);
    return SONDE_OK;
  }
  if (!strcmp(key, "format") || !strcmp(key, "version")) return SONDE_OK;
  return sonde_fail(
      error, SONDE_FORMAT,
      "%s:%u: '%.40s' is not a key of a preset (or not of its kind); docs/identify.md "
      "lists them",
      path, line, key);
}

static sonde_status read_root(const source *from, sonde_preset *preset, sonde_error *error) {
  const char *format = sonde_json_as_text(sonde_json_member(from->root, "format"));
  char place[200];
  place_of(from, "format", place);
  if (!format || strcmp(format, FORMAT_NAME) != 0)
    return sonde_fail(error, SONDE_FORMAT,
                      "%sexpected an object with \"format\": \"" FORMAT_NAME "\"", place);
  place_of(from, "version", place);
  if (sonde_json_as_number(sonde_json_member(from->root, "version")) != VERSION)
    return sonde_fail(error, SONDE_VERSION, "%sexpected \"version\": %d", place, VERSION);
  for (const sonde_json *v = sonde_json_first(from->root); v; v = sonde_json_next(v)) {
    sonde_status status = read_item(from->path, v, preset, error);
    if (status) return status;
  }
  return check(preset, from, error);
}

sonde_status sonde_preset_load(const char *path, sonde_preset *preset, sonde_error *error) {
  *preset = sonde_preset_default();
  char *text = NULL;
  size_t bytes;
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_json, &text, &bytes, error);
  sonde_json *root = NULL;
  if (!status)
    status = sonde_json_parse(text, bytes, &(sonde_json_source){.name = path}, &root, error);
  if (!status) status = read_root(&(source){path, root}, preset, error);
  sonde_json_free(root);
  sonde_free(text);
  return status;
}

sonde_status sonde_preset_save(const char *path, const sonde_preset *preset, sonde_error *error) {
  sonde_preset copy = *preset;
  sonde_json_out out = {.layout = SONDE_JSON_LINES};
  sonde_status status = check(preset, NULL, error);
  if (!status) status = sonde_file_create(path, &out.file, error);
  if (status) return status;
  size_t used = 0; // the name without control characters
  for (const char *c = preset->name; *c; ++c)
    if ((unsigned char)*c >= 0x20) copy.name[used++] = *c;
  copy.name[used] = 0;
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_text(&out, "format", FORMAT_NAME);
  sonde_json_put_integer(&out, "version", VERSION);
  sonde_json_put_text(&out, "name", copy.name);
  for (size_t k = 0; k < SONDE_COUNT_OF(FIELDS); ++k) {
    double value = *value_of(&copy, &FIELDS[k]) / FIELDS[k].unit;
    if (!isnan(value)) sonde_json_put_real(&out, FIELDS[k].key, value, 9);
  }
  sonde_json_end(&out);
  sonde_file_printf(out.file, "\n");
  return sonde_file_commit(out.file, error);
}

sonde_status sonde_preset_apply(const sonde_preset *preset, sonde_model *model,
                                sonde_world_def *def, sonde_error *error) {
  sonde_status status = check(preset, NULL, error);
  if (status) return status;
  if (model) {
    sonde_surface_law *law = &model->law;
    double scale = preset->stiffness_scale;
    if (!isnan(preset->normal_damping_s)) law->normal_damping_s = preset->normal_damping_s;
    if (!isnan(preset->edge_damping_s)) law->edge_damping_s = preset->edge_damping_s;
    law->normal_damping_s *= preset->damping_multiplier;
    law->edge_damping_s *= preset->damping_multiplier;
    sonde_law_scale(law, scale);
    for (uint32_t i = 0; i < model->surface.vertex_count; ++i) model->k0_n_m3[i] *= scale;
    for (uint32_t i = 0; i < model->site_count; ++i) model->sites[i].k0_n_m3 *= scale;
  }
  if (def) def->friction = preset->friction;
  return SONDE_OK;
}
