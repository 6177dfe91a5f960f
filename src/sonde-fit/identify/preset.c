// FIELDS:   keys of the file, their units and ranges.
// line_of:  line of a key in the text, for messages.
// check:    the ranges, for files and for presets made by hand.
// load, save, apply.
#include "base/bounds.h"
#include "base/maths.h"
#include "identify/forward.h"

#include <cjson/cJSON.h>
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

// cJSON keeps no places: the first line with the key in quotes, 1 when there is none.
static int line_of(const char *text, const char *key) {
  char quoted[80];
  snprintf(quoted, sizeof quoted, "\"%.70s\"", key);
  const char *at = text ? strstr(text, quoted) : NULL;
  return at ? (int)sonde_line_of(text, at) : 1;
}

// Where a preset came from, for messages: "path:line: " or nothing.
typedef struct source {
  const char *path, *text;
} source;

static void place_of(const source *from, const char *key, char place[200]) {
  place[0] = 0;
  if (from) snprintf(place, 200, "%.150s:%d: ", from->path, line_of(from->text, key));
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

static const field *field_of(const char *key) {
  for (size_t k = 0; k < SONDE_COUNT_OF(FIELDS); ++k)
    if (!strcmp(key, FIELDS[k].key)) return &FIELDS[k];
  return NULL;
}

static sonde_status read_item(const source *from, const cJSON *item, sonde_preset *preset,
                              sonde_error *error) {
  const field *f = field_of(item->string);
  int line = line_of(from->text, item->string);
  if (f) {
    if (!cJSON_IsNumber(item) || !isfinite(item->valuedouble))
      return sonde_fail(error, SONDE_FORMAT, "%s:%d: %s: expected a number from %g to %g",
                        from->path, line, f->key, f->low, f->high);
    *value_of(preset, f) = item->valuedouble * f->unit;
    return SONDE_OK;
  }
  if (!strcmp(item->string, "name") && cJSON_IsString(item)) {
    snprintf(preset->name, sizeof preset->name, "%s", item->valuestring);
    return SONDE_OK;
  }
  if (!strcmp(item->string, "format") || !strcmp(item->string, "version")) return SONDE_OK;
  return sonde_fail(
      error, SONDE_FORMAT,
      "%s:%d: '%.40s' is not a key of a preset (or not of its kind); docs/identify.md "
      "lists them",
      from->path, line, item->string);
}

static sonde_status read_root(const source *from, const cJSON *root, sonde_preset *preset,
                              sonde_error *error) {
  const char *format = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(root, "format"));
  const cJSON *version = cJSON_GetObjectItemCaseSensitive(root, "version");
  if (!cJSON_IsObject(root) || !format || strcmp(format, FORMAT_NAME) != 0)
    return sonde_fail(error, SONDE_FORMAT,
                      "%s:%d: expected an object with \"format\": \"" FORMAT_NAME "\"", from->path,
                      line_of(from->text, "format"));
  if (!cJSON_IsNumber(version) || version->valueint != VERSION)
    return sonde_fail(error, SONDE_VERSION, "%s:%d: expected \"version\": %d", from->path,
                      line_of(from->text, "version"), VERSION);
  const cJSON *item;
  cJSON_ArrayForEach(item, root) {
    sonde_status status = read_item(from, item, preset, error);
    if (status) return status;
  }
  return check(preset, from, error);
}

sonde_status sonde_preset_load(const char *path, sonde_preset *preset, sonde_error *error) {
  *preset = sonde_preset_default();
  char *text = NULL;
  size_t bytes;
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_json, &text, &bytes, error);
  if (!status) status = sonde_bounded_json(path, text, bytes, &sonde_limits_json, error);
  if (status) {
    sonde_free(text);
    return status;
  }
  const char *stop = text;
  cJSON *root = cJSON_ParseWithOpts(text, &stop, 1);
  if (root) {
    status = read_root(&(source){path, text}, root, preset, error);
  } else {
    status = sonde_fail(error, SONDE_FORMAT, "%s:%u: is not JSON", path,
                        stop ? sonde_line_of(text, stop) : 1);
  }
  cJSON_Delete(root);
  sonde_free(text);
  return status;
}

// A JSON string: quotes and backslashes escaped, control characters left out.
static void write_name(sonde_file *file, const char *name) {
  sonde_file_printf(file, "  \"name\": \"");
  for (const char *c = name; *c; ++c) {
    if (*c == '"' || *c == '\\') sonde_file_printf(file, "\\");
    if ((unsigned char)*c >= 0x20) sonde_file_write(file, c, 1);
  }
  sonde_file_printf(file, "\"");
}

sonde_status sonde_preset_save(const char *path, const sonde_preset *preset, sonde_error *error) {
  sonde_preset copy = *preset;
  sonde_file *file;
  sonde_status status = check(preset, NULL, error);
  if (!status) status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "{\n  \"format\": \"" FORMAT_NAME "\",\n  \"version\": %d,\n", VERSION);
  write_name(file, preset->name);
  for (size_t k = 0; k < SONDE_COUNT_OF(FIELDS); ++k) {
    double value = *value_of(&copy, &FIELDS[k]) / FIELDS[k].unit;
    if (!isnan(value)) sonde_file_printf(file, ",\n  \"%s\": %.9g", FIELDS[k].key, value);
  }
  sonde_file_printf(file, "\n}\n");
  return sonde_file_commit(file, error);
}

static void apply_to_model(const sonde_preset *preset, sonde_model *model) {
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

sonde_status sonde_preset_apply(const sonde_preset *preset, sonde_model *model,
                                sonde_world_def *def, sonde_error *error) {
  sonde_status status = check(preset, NULL, error);
  if (status) return status;
  if (model) apply_to_model(preset, model);
  if (def) def->friction = preset->friction;
  return SONDE_OK;
}
