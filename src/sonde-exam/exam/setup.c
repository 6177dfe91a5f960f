// What a session starts with, as a member of a recording's header.
#include "exam/setup.h"

#include "base/base.h"
#include "base/maths.h"
#include "sonde/files_scanner.h"

#include <string.h>

enum { MOST_NUMBERS = 16 };
static const char *const LAYERS[SONDE_SOLID_LAYERS] = {SONDE_SOLID_LAYER_NAMES};

sonde_setup sonde_setup_default(void) {
  return (sonde_setup){.friction = sonde_world_def_default().friction,
                       .circulation = sonde_circulation_default(),
                       .solid = sonde_session_solid_default()};
}

sonde_setup sonde_setup_of(const sonde_session_def *def) {
  sonde_setup setup = {.friction = def->world.friction,
                       .preset_count = def->preset_count,
                       .gel_m3 = def->gel_m3,
                       .circulate = def->circulate,
                       .circulation = def->circulation,
                       .scans = def->scanner != NULL};
  if (def->scanner) setup.scanner = *def->scanner;
  setup.is_solid = def->solid != NULL;
  if (def->solid) setup.solid = *def->solid;
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
  def->scanner = setup->scans ? &setup->scanner : NULL;
  def->solid = setup->is_solid ? &setup->solid : NULL;
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
      {"valsalva_to_s", &c->valsalva_to_s}, {"valsalva_pa", &c->valsalva_pa},
      {"valve_leak", &c->valve_leak}};
  memcpy(list, own, sizeof own);
  return SONDE_COUNT_OF(own);
}

static uint32_t list_layer(number *list, sonde_hyperelastic *layer) {
  const number own[] = {
      {"shear_pa", &layer->shear_pa}, {"exponent", &layer->exponent}, {"bulk_pa", &layer->bulk_pa}};
  memcpy(list, own, sizeof own);
  return SONDE_COUNT_OF(own);
}

static void write_list(sonde_json_out *out, const number *list, uint32_t count) {
  for (uint32_t i = 0; i < count; ++i)
    if (isfinite(*list[i].value)) sonde_json_put_real(out, list[i].key, *list[i].value, 17);
}

static void read_list(const sonde_json *object, const number *list, uint32_t count) {
  for (uint32_t i = 0; i < count; ++i)
    *list[i].value = sonde_json_as_number(sonde_json_member(object, list[i].key));
}

void sonde_setup_write(sonde_json_out *header, const sonde_setup *setup) {
  SONDE_ASSERT(setup->preset_count <= SONDE_SESSION_PRESETS);
  sonde_setup s = *setup;
  number list[MOST_NUMBERS];
  sonde_json_begin_object(header, "setup");
  sonde_json_begin_object(header, "friction");
  write_list(header, list, add_friction(list, 0, &s.friction));
  sonde_json_end(header);
  sonde_json_put_real(header, "gel_m3", s.gel_m3, 17);
  sonde_json_begin_list(header, "presets");
  for (uint32_t i = 0; i < s.preset_count; ++i) {
    sonde_json_begin_object(header, NULL);
    sonde_json_put_text(header, "name", s.presets[i].name);
    write_list(header, list, list_preset(list, &s.presets[i]));
    sonde_json_end(header);
  }
  sonde_json_end(header);
  if (s.circulate) {
    sonde_json_begin_object(header, "circulation");
    sonde_json_put_integer(header, "posture", s.circulation.posture);
    write_list(header, list, list_circulation(list, &s.circulation));
    sonde_json_end(header);
  }
  if (s.is_solid) {
    sonde_json_begin_object(header, "solid");
    sonde_json_put_real(header, "edge_m", s.solid.edge_m, 17);
    for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
      sonde_json_begin_object(header, LAYERS[k]);
      sonde_json_put_integer(header, "energy", s.solid.layer[k].energy);
      write_list(header, list, list_layer(list, &s.solid.layer[k]));
      sonde_json_end(header);
    }
    sonde_json_end(header);
  }
  if (s.scans) {
    uint32_t count;
    const sonde_scanner_number *item = sonde_scanner_numbers(&count);
    sonde_json_begin_object(header, "scanner");
    for (uint32_t i = 0; i < count; ++i)
      sonde_json_put_real(header, item[i].key,
                          *(const double *)((const char *)&s.scanner + item[i].offset), 17);
    sonde_json_begin_list(header, "slider_db");
    for (uint32_t k = 0; k < SONDE_SCANNER_SLIDERS; ++k)
      sonde_json_put_real(header, NULL, s.scanner.slider_db[k], 17);
    sonde_json_end(header);
    sonde_json_end(header);
  }
  sonde_json_end(header);
}

// Numbers as the scanner holds them, SI; false where one is missing or beyond its limits.
static bool read_scanner(const sonde_json *object, sonde_scanner *scanner) {
  uint32_t count, k = 0;
  const sonde_scanner_number *item = sonde_scanner_numbers(&count);
  *scanner = sonde_scanner_plain();
  for (uint32_t i = 0; i < count; ++i) {
    double value = sonde_json_as_number(sonde_json_member(object, item[i].key));
    const double slack = 1e-9 * fabs(item[i].high * item[i].si);
    if (!(value >= item[i].low * item[i].si - slack && value <= item[i].high * item[i].si + slack))
      return false;
    *(double *)((char *)scanner + item[i].offset) = value;
  }
  const sonde_json *list = sonde_json_member(object, "slider_db");
  for (list = sonde_json_first(list); list && k < SONDE_SCANNER_SLIDERS;
       list = sonde_json_next(list)) {
    scanner->slider_db[k] = sonde_json_as_number(list);
    if (!isfinite(scanner->slider_db[k++])) return false;
  }
  return k == SONDE_SCANNER_SLIDERS;
}

bool sonde_setup_read(const sonde_json *header, sonde_setup *setup) {
  *setup = sonde_setup_default();
  const sonde_json *object = sonde_json_member(header, "setup");
  if (!object) return true;
  number list[MOST_NUMBERS];
  sonde_preset friction = sonde_preset_default();
  read_list(sonde_json_member(object, "friction"), list, add_friction(list, 0, &friction.friction));
  setup->gel_m3 = sonde_json_as_number(sonde_json_member(object, "gel_m3"));
  if (!(setup->gel_m3 >= 0 && setup->gel_m3 <= 1e-3)) return false;
  setup->friction = friction.friction;
  if (sonde_preset_apply(&friction, NULL, NULL, NULL)) return false;
  const sonde_json *presets = sonde_json_member(object, "presets");
  if (sonde_json_count(presets) > SONDE_SESSION_PRESETS) return false;
  for (const sonde_json *item = sonde_json_first(presets); item; item = sonde_json_next(item)) {
    sonde_preset *preset = &setup->presets[setup->preset_count++];
    const char *name = sonde_json_as_text(sonde_json_member(item, "name"));
    snprintf(preset->name, sizeof preset->name, "%.60s", name ? name : "");
    read_list(item, list, list_preset(list, preset));
    if (sonde_preset_apply(preset, NULL, NULL, NULL)) return false;
  }
  const sonde_json *solid = sonde_json_member(object, "solid");
  setup->is_solid = solid != NULL;
  if (solid) setup->solid.edge_m = sonde_json_as_number(sonde_json_member(solid, "edge_m"));
  for (int k = 0; k < SONDE_SOLID_LAYERS && solid; ++k) { // a session checks their ranges
    const sonde_json *layer = sonde_json_member(solid, LAYERS[k]);
    const double energy = sonde_json_as_number(sonde_json_member(layer, "energy"));
    if (!(energy >= 0 && energy <= SONDE_ENERGY_FUNG)) return false;
    setup->solid.layer[k].energy = (sonde_strain_energy)(int)energy;
    read_list(layer, list, list_layer(list, &setup->solid.layer[k]));
  }
  const sonde_json *scanner = sonde_json_member(object, "scanner");
  setup->scans = scanner != NULL;
  if (scanner && !read_scanner(scanner, &setup->scanner)) return false;
  const sonde_json *circulation = sonde_json_member(object, "circulation");
  if (!circulation) return true;
  double posture = sonde_json_as_number(sonde_json_member(circulation, "posture"));
  if (!(posture >= 0 && posture < SONDE_POSTURE_COUNT)) return false;
  setup->circulate = true;
  setup->circulation.posture = (sonde_posture)(int)posture;
  uint32_t count = list_circulation(list, &setup->circulation);
  read_list(circulation, list, count);
  // Before version 10 all valves were sound.
  double *leak = &setup->circulation.valve_leak;
  if (!sonde_json_member(circulation, "valve_leak")) *leak = 0;
  for (uint32_t i = 0; i < count; ++i)
    if (!isfinite(*list[i].value)) return false;
  return *leak >= 0 && *leak <= 1;
}
