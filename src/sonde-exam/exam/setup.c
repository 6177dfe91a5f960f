// What a session starts with, as a member of a recording's header.
// add_friction, list_preset, list_circulation: its numbers by name; the same list writes and reads.
// write_real, write_list, read_list: such a list in a JSON object.
// read_presets, read_circulation: parts of it.
#include "exam/setup.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

enum { MOST_NUMBERS = 16 };

sonde_setup sonde_setup_default(void) {
  return (sonde_setup){.friction = sonde_world_def_default().friction,
                       .circulation = sonde_circulation_default()};
}

sonde_setup sonde_setup_of(const sonde_session_def *def) {
  sonde_setup setup = {.friction = def->world.friction,
                       .preset_count = def->preset_count,
                       .gel_m3 = def->gel_m3,
                       .circulate = def->circulate,
                       .circulation = def->circulation};
  memcpy(setup.presets, def->presets, sizeof setup.presets);
  return setup;
}

void sonde_setup_apply(const sonde_setup *setup, sonde_session_def *def) {
  SONDE_ASSERT(setup->preset_count <= SONDE_SESSION_PRESETS);
  def->world.friction = setup->friction;
  def->preset_count = setup->preset_count;
  memcpy(def->presets, setup->presets, sizeof def->presets);
  def->gel_m3 = setup->gel_m3;
  def->circulate = setup->circulate;
  def->circulation = setup->circulation;
}

// A number by name. NaN and infinity have no JSON: they are left out, and read as NaN.
typedef struct number {
  const char *key;
  double *value;
} number;

static uint32_t add_friction(number *list, uint32_t count, sonde_friction *f) {
  const number own[] = {{"mu_static", &f->mu_static},
                        {"mu_kinetic", &f->mu_kinetic},
                        {"stribeck_speed_m_s", &f->stribeck_speed_m_s},
                        {"gel_film", &f->gel_film},
                        {"mu_gel", &f->mu_gel}};
  memcpy(list + count, own, sizeof own);
  return count + SONDE_COUNT_OF(own);
}

static uint32_t list_preset(number *list, sonde_preset *p) {
  const number own[] = {{"normal_damping_s", &p->normal_damping_s},
                        {"edge_damping_s", &p->edge_damping_s},
                        {"damping_multiplier", &p->damping_multiplier},
                        {"stiffness_scale", &p->stiffness_scale}};
  memcpy(list, own, sizeof own);
  return add_friction(list, SONDE_COUNT_OF(own), &p->friction);
}

static uint32_t list_circulation(number *list, sonde_circulation *c) {
  const number own[] = {
      {"heart_rate_hz", &c->heart_rate_hz}, {"systolic_pa", &c->systolic_pa},
      {"diastolic_pa", &c->diastolic_pa},   {"breath_rate_hz", &c->breath_rate_hz},
      {"breath_pa", &c->breath_pa},         {"valsalva_from_s", &c->valsalva_from_s},
      {"valsalva_to_s", &c->valsalva_to_s}, {"valsalva_pa", &c->valsalva_pa}};
  memcpy(list, own, sizeof own);
  return SONDE_COUNT_OF(own);
}

// With all its digits, which cJSON does not always write, whatever the program's locale.
static void write_real(cJSON *object, const char *key, double value) {
  char text[40];
  snprintf(text, sizeof text, "%.17g", value);
  for (char *c = text; *c; ++c)
    if (*c == ',') *c = '.';
  cJSON_AddRawToObject(object, key, text);
}

static void write_list(cJSON *object, const number *list, uint32_t count) {
  for (uint32_t i = 0; i < count; ++i)
    if (isfinite(*list[i].value)) write_real(object, list[i].key, *list[i].value);
}

static void read_list(const cJSON *object, const number *list, uint32_t count) {
  for (uint32_t i = 0; i < count; ++i) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, list[i].key);
    *list[i].value = cJSON_IsNumber(item) ? item->valuedouble : (double)NAN;
  }
}

void sonde_setup_write(cJSON *header, const sonde_setup *setup) {
  SONDE_ASSERT(setup->preset_count <= SONDE_SESSION_PRESETS);
  sonde_setup s = *setup;
  number list[MOST_NUMBERS];
  cJSON *object = cJSON_AddObjectToObject(header, "setup");
  write_list(cJSON_AddObjectToObject(object, "friction"), list, add_friction(list, 0, &s.friction));
  write_real(object, "gel_m3", s.gel_m3);
  cJSON *presets = cJSON_AddArrayToObject(object, "presets");
  for (uint32_t i = 0; i < s.preset_count; ++i) {
    cJSON *preset = cJSON_CreateObject();
    cJSON_AddStringToObject(preset, "name", s.presets[i].name);
    write_list(preset, list, list_preset(list, &s.presets[i]));
    cJSON_AddItemToArray(presets, preset);
  }
  if (!s.circulate) return;
  cJSON *circulation = cJSON_AddObjectToObject(object, "circulation");
  cJSON_AddNumberToObject(circulation, "posture", s.circulation.posture);
  write_list(circulation, list, list_circulation(list, &s.circulation));
}

static bool read_presets(const cJSON *object, sonde_setup *setup) {
  const cJSON *presets = cJSON_GetObjectItemCaseSensitive(object, "presets"), *item;
  if (cJSON_GetArraySize(presets) > SONDE_SESSION_PRESETS) return false;
  number list[MOST_NUMBERS];
  cJSON_ArrayForEach(item, presets) {
    sonde_preset *preset = &setup->presets[setup->preset_count++];
    const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(item, "name"));
    snprintf(preset->name, sizeof preset->name, "%.60s", name ? name : "");
    read_list(item, list, list_preset(list, preset));
    if (sonde_preset_apply(preset, NULL, NULL, NULL)) return false;
  }
  return true;
}

static bool read_circulation(const cJSON *object, sonde_setup *setup) {
  const cJSON *circulation = cJSON_GetObjectItemCaseSensitive(object, "circulation");
  if (!circulation) return true;
  const cJSON *posture = cJSON_GetObjectItemCaseSensitive(circulation, "posture");
  if (!cJSON_IsNumber(posture) || posture->valueint < 0 || posture->valueint >= SONDE_POSTURE_COUNT)
    return false;
  number list[MOST_NUMBERS];
  setup->circulate = true;
  setup->circulation.posture = (sonde_posture)posture->valueint;
  uint32_t count = list_circulation(list, &setup->circulation);
  read_list(circulation, list, count);
  for (uint32_t i = 0; i < count; ++i)
    if (!isfinite(*list[i].value)) return false;
  return true;
}

bool sonde_setup_read(const cJSON *header, sonde_setup *setup) {
  *setup = sonde_setup_default();
  const cJSON *object = cJSON_GetObjectItemCaseSensitive(header, "setup");
  if (!object) return true;
  number list[MOST_NUMBERS];
  sonde_preset friction = sonde_preset_default();
  read_list(cJSON_GetObjectItemCaseSensitive(object, "friction"), list,
            add_friction(list, 0, &friction.friction));
  const cJSON *gel = cJSON_GetObjectItemCaseSensitive(object, "gel_m3");
  if (!cJSON_IsNumber(gel) || !(gel->valuedouble >= 0 && gel->valuedouble <= 1e-3)) return false;
  setup->gel_m3 = gel->valuedouble;
  setup->friction = friction.friction;
  return sonde_preset_apply(&friction, NULL, NULL, NULL) == SONDE_OK &&
         read_presets(object, setup) && read_circulation(object, setup);
}
