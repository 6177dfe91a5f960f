// Reading a case file.
#include "trainer/case.h"

#include "base/bounds.h"

#include <ctype.h>
#include <string.h>

const char *const sonde_case_levels[] = {"first", "easy", "hard", NULL};
const char *const sonde_case_postures[] = {"supine", "sitting", "standing", NULL};
const char *const sonde_case_lesions[] = {"node", "cyst", "haematoma", NULL};
const char *const sonde_case_clot_forms[] = {"mural", "floating", "recanalised", NULL};
const char *const sonde_case_sexes[] = {"drawn", "female", "male", NULL};
const char *const sonde_case_sides[] = {"right", "left", NULL};
const char *const sonde_case_positions[] = {"supine_turned", "prone_bent", "sitting",  "supine",
                                            "prone",         "standing",   "straight", NULL};
_Static_assert(SONDE_COUNT_OF(sonde_case_positions) == SONDE_LIMB_POSITIONS + 2,
               "a name for each position");
static const char *const DECISIONS[] = {"", "compressible", "clot", "not_seen"};

static const double UNKNOWN = (double)NAN;

static const char *const POSITION_TITLES[] = {
    "on the back, the leg turned out", "prone, the knee bent",    "sitting, the calf hanging",
    "on the back, the leg straight",   "prone, the leg straight", "standing",
    "lying, the leg straight"};
_Static_assert(SONDE_COUNT_OF(POSITION_TITLES) == SONDE_LIMB_POSITIONS + 1, "a title for each");

const char *sonde_position_key(sonde_limb_position position) {
  SONDE_ASSERT((unsigned)position <= SONDE_LIMB_POSITIONS);
  return sonde_case_positions[position];
}

bool sonde_position_parse(const char *key, sonde_limb_position *position) {
  for (int k = 0; key && k <= SONDE_LIMB_POSITIONS; ++k)
    if (strcmp(sonde_case_positions[k], key) == 0) {
      *position = (sonde_limb_position)k;
      return true;
    }
  return false;
}

const char *sonde_position_title(sonde_limb_position position) {
  SONDE_ASSERT((unsigned)position <= SONDE_LIMB_POSITIONS);
  return POSITION_TITLES[position];
}

bool sonde_case_takes(const sonde_case *of, sonde_limb_position position) {
  SONDE_ASSERT(of && (unsigned)position <= SONDE_LIMB_POSITIONS);
  if (position == of->position) return true;
  return of->thigh == SONDE_CASE_LEG && of->circulation.posture == SONDE_POSTURE_SUPINE &&
         position < SONDE_LIMB_POSITIONS && (of->positions >> position & 1);
}

const char *sonde_case_level_name(sonde_case_level level) {
  SONDE_ASSERT(level <= SONDE_CASE_HARD);
  return sonde_case_levels[level];
}

const char *sonde_decision_name(sonde_decision decision) {
  SONDE_ASSERT(decision < SONDE_DECISIONS);
  return DECISIONS[decision];
}

bool sonde_decision_parse(const char *name, sonde_decision *decision) {
  for (int i = 0; name && i < SONDE_DECISIONS; ++i)
    if (strcmp(DECISIONS[i], name) == 0) {
      *decision = (sonde_decision)i;
      return true;
    }
  return false;
}

sonde_case sonde_case_default(void) {
  sonde_case c = {.known = sonde_thigh_unknown(),
                  .leg = sonde_limb_unknown(),
                  .position = SONDE_LIMB_POSITIONS,
                  .positions = CASE_ALL_POSITIONS,
                  .circulation = sonde_circulation_default(),
                  .extent.whole = true};
  sonde_status status = sonde_pathology_preset("healthy", &c.pathology, NULL);
  SONDE_ASSERT(status == SONDE_OK);
  return c;
}

// ---- the patient

// What a map gives of a body that is drawn: its seed, its sex and parameters, in their units at the
// boundary. `leg`: side and positions are keys too.
static sonde_sex read_body(sonde_reader *reader, sonde_place at, const char *what, bool leg,
                           const sonde_parameter *parameter, uint32_t count, void *to,
                           uint64_t *seed) {
  enum { KEYS = 48 };
  const char *keys[KEYS] = {"seed", "sex"};
  SONDE_ASSERT(count + 6 <= KEYS);
  for (uint32_t i = 0; i < count; ++i) keys[2 + i] = parameter[i].name;
  if (leg) keys[2 + count] = "side", keys[3 + count] = "position", keys[4 + count] = "positions";
  sonde_read_keys(reader, at, what, keys);
  for (uint32_t i = 0; i < count; ++i) {
    const sonde_parameter *p = &parameter[i];
    if (!sonde_read_find(reader, at, p->name)) continue;
    double value =
        sonde_read_real(reader, at, p->name, p->low / p->unit, p->high / p->unit, UNKNOWN);
    *sonde_parameter_of(to, p) = value * p->unit;
  }
  *seed = sonde_read_integer(reader, at, "seed", 0, UINT32_MAX, 1);
  return (sonde_sex)sonde_read_choice(reader, at, "sex", sonde_case_sexes, 0);
}

// A whole limb; or the bundled thigh, a model file, or one that is generated from a seed and what
// is known of it.
static void read_thigh(sonde_reader *reader, sonde_place root, sonde_case *c) {
  static const char *const MODEL[] = {"model", NULL};
  sonde_place at = sonde_read_find(reader, root, "thigh");
  sonde_place leg = sonde_read_find(reader, root, "leg");
  if (leg && at) sonde_reader_fail(reader, leg, SONDE_FORMAT, "give either leg or thigh");
  uint32_t count;
  if (leg) {
    const sonde_parameter *parameter = sonde_limb_parameters(&count);
    c->thigh = SONDE_CASE_LEG;
    c->leg.sex = read_body(reader, leg, "leg", true, parameter, count, &c->leg, &c->seed);
    c->leg.side = (sonde_limb_side)sonde_read_choice(reader, leg, "side", sonde_case_sides, 0);
    c->position = (sonde_limb_position)sonde_read_choice(
        reader, leg, "position", sonde_case_positions, SONDE_LIMB_POSITIONS);
    sonde_place others = sonde_read_find(reader, leg, "positions");
    if (others) c->positions = 0;
    for (uint32_t i = 0; others && i < sonde_read_count(reader, others); ++i) {
      sonde_place item = sonde_read_item(reader, others, i);
      const char *text = sonde_read_text_at(reader, item, "positions");
      uint32_t k = 0;
      while (k < SONDE_LIMB_POSITIONS && text && strcmp(text, sonde_case_positions[k]) != 0) ++k;
      if (text && k < SONDE_LIMB_POSITIONS)
        c->positions |= 1u << k;
      else if (text)
        sonde_reader_fail(reader, item, SONDE_FORMAT,
                          "positions has '%s', expected supine_turned, prone_bent, sitting, "
                          "supine, prone or standing",
                          text);
    }
  }
  if (!at || leg) return;
  if (sonde_read_is_text(reader, at)) {
    const char *text = sonde_read_text_at(reader, at, "thigh");
    if (text && strcmp(text, "bundled") != 0)
      sonde_reader_fail(reader, at, SONDE_FORMAT,
                        "thigh is '%s', expected bundled, {seed: ...} or {model: FILE}", text);
    return;
  }
  if (sonde_read_find(reader, at, "model")) {
    sonde_read_keys(reader, at, "thigh", MODEL);
    c->thigh = SONDE_CASE_MODEL;
    sonde_read_member(reader, at, "model", true, c->model, sizeof c->model);
    return;
  }
  const sonde_parameter *parameter = sonde_thigh_parameters(&count);
  c->thigh = SONDE_CASE_GENERATED;
  c->known.sex = read_body(reader, at, "thigh", false, parameter, count, &c->known, &c->seed);
}

// ---- pathology

// The stage of a clot with what the case changes of it, and the stretch of vein that it fills.
static void read_clot(sonde_reader *reader, sonde_place map, sonde_pathology *pathology,
                      sonde_case_extent *extent) {
  sonde_error error = {0};
  sonde_place at = sonde_read_find(reader, map, "stage");
  const char *stage = sonde_read_text(reader, map, "stage", true);
  if (stage && sonde_pathology_preset(stage, pathology, &error))
    sonde_reader_pass(reader, at, &error);
  sonde_pathology *p = pathology;
  p->form =
      (sonde_clot_form)sonde_read_choice(reader, map, "form", sonde_case_clot_forms, (int)p->form);
  p->thrombus_fraction = sonde_read_real(reader, map, "fraction", 0, 1, p->thrombus_fraction);
  p->thrombus_modulus_pa =
      1e3 * sonde_read_real(reader, map, "modulus_kpa", 0, 500, 1e-3 * p->thrombus_modulus_pa);
  p->echogenicity = sonde_read_real(reader, map, "echogenicity", 0, 1, p->echogenicity);
  p->lumen_scale = sonde_read_real(reader, map, "lumen_scale", 0.3, 2, p->lumen_scale);
  p->wall_shear_pa =
      1e3 * sonde_read_real(reader, map, "wall_kpa", 0, 300, 1e-3 * p->wall_shear_pa);

  sonde_place from = sonde_read_find(reader, map, "from"), to = sonde_read_find(reader, map, "to");
  *extent = (sonde_case_extent){.whole = !from && !to};
  if (!from != !to)
    sonde_reader_fail(reader, map, SONDE_FORMAT, "give both from and to, or neither");
  if (!from || !to) return;
  sonde_read_station(reader, from, "from", &extent->from);
  sonde_read_station(reader, to, "to", &extent->to);
}

static uint32_t read_some(sonde_reader *reader, sonde_place list, const char *what, uint32_t most) {
  uint32_t count = sonde_read_count(reader, list);
  if (count <= most) return count;
  sonde_reader_fail(reader, list, SONDE_ARGUMENT, "%u %s, expected at most %u", count, what, most);
  return 0;
}

// What fills the femoral vein, and what else the thigh has.
static void read_pathology(sonde_reader *reader, sonde_place root, sonde_case *c) {
  static const char *const VEIN[] = {
      "stage",        "from",        "to",       "form", "fraction", "modulus_kpa",
      "echogenicity", "lumen_scale", "wall_kpa", "webs", NULL};
  static const char *const LESION[] = {"kind",    "at",           "across_mm", "depth_mm",
                                       "size_mm", "echogenicity", NULL};
  static const double ECHO[] = {0.25, 0.0, 0.4}; // of node, cyst, haematoma
  static const char *const BRANCH[] = {"branch",      "stage",    "from",        "to",
                                       "form",        "fraction", "modulus_kpa", "echogenicity",
                                       "lumen_scale", "wall_kpa", NULL};
  sonde_place vein = sonde_read_find(reader, root, "vein");
  if (vein) {
    sonde_read_keys(reader, vein, "vein", VEIN);
    read_clot(reader, vein, &c->pathology, &c->extent);
    c->webs = sonde_read_real(reader, vein, "webs", 0, 1, 0);
  }
  static const char *const KEYS[] = {"lesions", "branches", "oedema", NULL};
  sonde_place at = sonde_read_find(reader, root, "findings");
  if (!at) return;
  sonde_read_keys(reader, at, "findings", KEYS);
  c->oedema = sonde_read_real(reader, at, "oedema", 0, 1, 0);
  sonde_place lesions = sonde_read_find(reader, at, "lesions");
  c->lesion_count = read_some(reader, lesions, "lesions", SONDE_LESIONS);
  for (uint32_t i = 0; i < c->lesion_count; ++i) {
    sonde_place item = sonde_read_item(reader, lesions, i);
    sonde_case_lesion *lesion = &c->lesion[i];
    sonde_read_keys(reader, item, "a lesion", LESION);
    lesion->kind =
        (sonde_lesion_kind)sonde_read_choice(reader, item, "kind", sonde_case_lesions, 0);
    sonde_place where = sonde_read_find(reader, item, "at");
    if (!where)
      sonde_reader_fail(reader, item, SONDE_FORMAT, "at is missing");
    else
      sonde_read_station(reader, where, "at", &lesion->station);
    lesion->across_m = 1e-3 * sonde_read_real(reader, item, "across_mm", -100, 100, 0);
    lesion->depth_m = 1e-3 * sonde_read_real(reader, item, "depth_mm", 1, 120, UNKNOWN);
    sonde_vec3 size = sonde_read_vector(reader, item, "size_mm", 100, vec3(10, 10, 16));
    if (!(size.x > 0 && size.y > 0 && size.z > 0))
      sonde_reader_fail(reader, item, SONDE_ARGUMENT, "size_mm must be three lengths more than 0");
    lesion->half_m = v_scale(size, 0.5e-3);
    lesion->echogenicity =
        sonde_read_real(reader, item, "echogenicity", 0, 1, ECHO[lesion->kind % 3]);
  }
  sonde_place branches = sonde_read_find(reader, at, "branches");
  c->branch_count = read_some(reader, branches, "branches", SONDE_BRANCHES);
  for (uint32_t i = 0; i < c->branch_count; ++i) {
    sonde_place item = sonde_read_item(reader, branches, i);
    sonde_case_branch *branch = &c->branch[i];
    sonde_read_keys(reader, item, "a branch", BRANCH);
    sonde_read_member(reader, item, "branch", true, branch->branch, sizeof branch->branch);
    read_clot(reader, item, &branch->pathology, &branch->extent);
  }
}

// ---- the answer

static void read_truth(sonde_reader *reader, sonde_place root, sonde_case *c) {
  static const char *const KEYS[] = {"thrombosis", "diagnosis", "segments", "look_alikes", NULL};
  const char *names[TRAINER_SEGMENTS + 2] = {NULL};
  for (uint32_t i = 0; i < TRAINER_SEGMENTS; ++i) names[i] = sonde_segment_known(i, NULL);
  names[TRAINER_SEGMENTS] = "popliteal_near"; // of files about thighs
  static const char *const WORDS[] = {"compressible", "clot", NULL};
  sonde_place at = sonde_read_find(reader, root, "truth");
  if (!at) {
    sonde_reader_fail(reader, root, SONDE_FORMAT, "truth is missing");
    return;
  }
  sonde_read_keys(reader, at, "truth", KEYS);
  if (!sonde_read_find(reader, at, "thrombosis"))
    sonde_reader_fail(reader, at, SONDE_FORMAT, "thrombosis (true or false) is missing");
  c->thrombosis = sonde_read_bool(reader, at, "thrombosis", false);
  sonde_read_member(reader, at, "diagnosis", true, c->diagnosis, sizeof c->diagnosis);
  sonde_place segments = sonde_read_find(reader, at, "segments");
  if (segments) sonde_read_keys(reader, segments, "segments", names);
  for (int i = 0; segments && names[i]; ++i) {
    if (!sonde_read_find(reader, segments, names[i])) continue;
    int word = sonde_read_choice(reader, segments, names[i], WORDS, 0);
    SONDE_ASSERT(c->truth_count < SONDE_SEGMENTS);
    snprintf(c->truth_segment[c->truth_count], sizeof c->truth_segment[0], "%s",
             i == TRAINER_SEGMENTS ? "popliteal" : names[i]);
    c->truth[c->truth_count++] = word ? SONDE_DECISION_CLOT : SONDE_DECISION_COMPRESSIBLE;
  }
  if (c->truth_count == 0) sonde_reader_fail(reader, at, SONDE_FORMAT, "the truth has no segments");
  sonde_place list = sonde_read_find(reader, at, "look_alikes");
  c->look_alike_count = read_some(reader, list, "look_alikes", SONDE_LOOK_ALIKES);
  for (uint32_t i = 0; i < c->look_alike_count; ++i) {
    const char *text = sonde_read_text_at(reader, sonde_read_item(reader, list, i), "a look-alike");
    if (text) snprintf(c->look_alike[i], sizeof c->look_alike[i], "%s", text);
  }
}

// ---- the whole

static sonde_status check_id(const char *id, sonde_error *error) {
  for (const char *c = id; *c; ++c)
    if (!islower((unsigned char)*c) && !isdigit((unsigned char)*c) && *c != '-' && *c != '_')
      return sonde_fail(error, SONDE_FORMAT, "id '%s' has '%c', expected a-z, 0-9, - and _", id,
                        *c);
  return id[0] ? SONDE_OK : sonde_fail(error, SONDE_FORMAT, "the case has no id");
}

sonde_decision sonde_case_truth(const sonde_case *of, const char *segment) {
  SONDE_ASSERT(of && segment && of->branch_count <= SONDE_BRANCHES);
  for (uint32_t k = 0; k < of->truth_count; ++k)
    if (strcmp(of->truth_segment[k], segment) == 0) return of->truth[k];
  sonde_segment_kind kind = SONDE_SEGMENT_MAIN;
  for (uint32_t i = 0; i < TRAINER_SEGMENTS; ++i) {
    sonde_segment_kind own;
    if (strcmp(sonde_segment_known(i, &own), segment) == 0) kind = own;
  }
  for (uint32_t b = 0; b < of->branch_count; ++b) {
    const char *filled = sonde_segment_of_branch(of->branch[b].branch);
    if (of->branch[b].pathology.thrombus_fraction > 0 && filled && strcmp(filled, segment) == 0)
      return SONDE_DECISION_CLOT;
  }
  return kind == SONDE_SEGMENT_MAIN ? SONDE_DECISION_NONE : SONDE_DECISION_COMPRESSIBLE;
}

sonde_status sonde_case_check(const sonde_case *of, sonde_error *error) {
  SONDE_ASSERT(of && of->truth_count <= SONDE_SEGMENTS);
  sonde_status status = check_id(of->id, error);
  if (status) return status;
  bool clot = of->truth_count == 0 && of->thrombosis; // of a deep vein
  for (uint32_t i = 0; i < TRAINER_SEGMENTS && of->truth_count > 0; ++i) {
    sonde_segment_kind kind;
    const char *name = sonde_segment_known(i, &kind);
    clot |= kind != SONDE_SEGMENT_SUPERFICIAL && sonde_case_truth(of, name) == SONDE_DECISION_CLOT;
  }
  if (clot != of->thrombosis)
    return sonde_fail(error, SONDE_MISMATCH, "thrombosis is %s, but %s segment is clot",
                      of->thrombosis ? "true" : "false", clot ? "a" : "no deep");
  if (of->position < SONDE_LIMB_POSITIONS && of->circulation.posture != SONDE_POSTURE_SUPINE)
    return sonde_fail(error, SONDE_MISMATCH,
                      "the leg's position says how the patient is held: no posture beside it");
  if (of->webs > 0 && !(of->pathology.thrombus_fraction > 0))
    return sonde_fail(error, SONDE_MISMATCH, "webs in a vein without a clot");
  return SONDE_OK;
}

sonde_status sonde_case_parse(const char *text, const char *name, sonde_case *out,
                              sonde_error *error) {
  SONDE_ASSERT(text && name && out);
  static const char *const CIRCULATION[] = {
      "posture",    "breath_mmhg", "valsalva_from_s", "valsalva_to_s", "valsalva_mmhg",
      "valve_leak", NULL};
  const char *keys[] = {"sonde_case", "id",    "title", "level",       "history",
                        "note",       "thigh", "leg",   "circulation", "vein",
                        "findings",   "truth", NULL,    NULL};
  sonde_reader *reader;
  *out = sonde_case_default();
  sonde_status status = sonde_reader_create(text, name, &reader, error);
  if (status) return status;
  sonde_place root = sonde_reader_root(reader);
  double version = sonde_read_real(reader, root, "sonde_case", 0, 1e6, 0);
  // Files of version 1 may set forces; the forces of a place come from its thigh.
  if (version == 1) keys[SONDE_COUNT_OF(keys) - 2] = "criteria";
  sonde_read_keys(reader, root, "a case", keys);
  if (!sonde_read_find(reader, root, "sonde_case"))
    sonde_reader_fail(reader, root, SONDE_FORMAT, "sonde_case: %d is missing", SONDE_CASE_VERSION);
  if (version != 1 && version != 2 && version != SONDE_CASE_VERSION)
    sonde_reader_fail(reader, sonde_read_find(reader, root, "sonde_case"), SONDE_VERSION,
                      "case of version %g, expected 1 to %d", version, SONDE_CASE_VERSION);
  sonde_read_member(reader, root, "id", true, out->id, sizeof out->id);
  sonde_error problem = {0};
  if (sonde_reader_good(reader) && check_id(out->id, &problem))
    sonde_reader_pass(reader, sonde_read_find(reader, root, "id"), &problem);
  sonde_read_member(reader, root, "title", true, out->title, sizeof out->title);
  out->level = (sonde_case_level)sonde_read_choice(reader, root, "level", sonde_case_levels, 0);
  sonde_read_member(reader, root, "history", true, out->history, sizeof out->history);
  sonde_read_member(reader, root, "note", false, out->note, sizeof out->note);
  read_thigh(reader, root, out);
  sonde_place at = sonde_read_find(reader, root, "circulation");
  if (at) {
    sonde_circulation *flow = &out->circulation;
    sonde_read_keys(reader, at, "circulation", CIRCULATION);
    flow->posture = (sonde_posture)sonde_read_choice(reader, at, "posture", sonde_case_postures, 0);
    const double pa = SONDE_PA_PER_MMHG;
    flow->breath_pa = pa * sonde_read_real(reader, at, "breath_mmhg", 0, 10, flow->breath_pa / pa);
    flow->valsalva_pa =
        pa * sonde_read_real(reader, at, "valsalva_mmhg", 0, 60, flow->valsalva_pa / pa);
    flow->valsalva_from_s = sonde_read_real(reader, at, "valsalva_from_s", 0, 3600, 0);
    flow->valsalva_to_s = sonde_read_real(reader, at, "valsalva_to_s", 0, 3600, 0);
    flow->valve_leak = sonde_read_real(reader, at, "valve_leak", 0, 1, 0);
    if (flow->valsalva_to_s < flow->valsalva_from_s)
      sonde_reader_fail(reader, at, SONDE_ARGUMENT,
                        "valsalva_to_s is %g, expected valsalva_from_s (%g) or more",
                        flow->valsalva_to_s, flow->valsalva_from_s);
  }
  read_pathology(reader, root, out);
  read_truth(reader, root, out);
  if (sonde_reader_good(reader) && sonde_case_check(out, &problem))
    sonde_reader_pass(reader, sonde_read_find(reader, root, "truth"), &problem);
  status = sonde_reader_status(reader, error);
  sonde_reader_destroy(reader);
  return status;
}

sonde_status sonde_case_load(const char *path, sonde_case *out, sonde_error *error) {
  SONDE_ASSERT(path && out);
  char *text = NULL;
  size_t count;
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_yaml, &text, &count, error);
  if (!status) status = sonde_case_parse(text, path, out, error);
  sonde_free(text);
  return status;
}
