// The section `anatomy` of the model file (docs/model_file.md).
// Names stand in the header, points and muscle levels in arrays; a reader checks each number of
// entries against the room that the struct has.
#include "tissue/model_file.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

enum { SECTION_VERSION = 1, LEVEL_COLUMNS = 6, POINT_COLUMNS = 5 };
enum { ALL_POINTS = SONDE_BRANCHES * SONDE_VESSEL_POINTS };
static const char *const KIND[] = {"vein", "artery"};

/* ---- writing ------------------------------------------------------------------------------ */

void sonde_anatomy_put_section(sonde_json_out *header, const sonde_thigh_anatomy *a) {
  SONDE_ASSERT(a->segment_count <= SONDE_SEGMENTS);
  sonde_json_begin_object(header, "anatomy");
  sonde_json_put_integer(header, "version", SECTION_VERSION);
  sonde_json_begin_list(header, "vessels");
  for (uint32_t k = 0; k < a->branch_count; ++k) {
    sonde_json_begin_object(header, NULL);
    sonde_json_put_text(header, "name", a->branch[k].name);
    sonde_json_put_text(header, "kind", KIND[a->branch[k].kind]);
    sonde_json_put_integer(header, "points", a->branch[k].line.count);
    sonde_json_end(header);
  }
  sonde_json_end(header);
  sonde_json_begin_list(header, "landmarks");
  for (uint32_t k = 0; k < a->landmark_count; ++k)
    sonde_json_put_text(header, NULL, a->landmark[k].name);
  sonde_json_end(header);
  sonde_json_begin_list(header, "segments");
  for (uint32_t k = 0; k < a->segment_count; ++k) {
    sonde_json_begin_object(header, NULL);
    sonde_json_put_text(header, "name", a->segment[k].name);
    sonde_json_put_real(header, "from_m", a->segment[k].from_m, 0);
    sonde_json_put_real(header, "to_m", a->segment[k].to_m, 0);
    sonde_json_end(header);
  }
  sonde_json_end(header);
  sonde_json_put_real(header, "fascia_medial_m", a->fascia_medial_m, 0);
  sonde_json_put_real(header, "fascia_lateral_m", a->fascia_lateral_m, 0);
  sonde_json_begin_list(header, "pennation_rad");
  for (int k = 0; k < SONDE_COMPARTMENTS; ++k)
    sonde_json_put_real(header, NULL, a->pennation_rad[k], 0);
  sonde_json_end(header);
  sonde_json_end(header);
}

void sonde_anatomy_put_arrays(sonde_model_writer *w, const sonde_thigh_anatomy *a) {
  SONDE_ASSERT(a->branch_count <= SONDE_BRANCHES && a->landmark_count <= SONDE_LANDMARKS);
  SONDE_ASSERT(a->level_count <= SONDE_LEVELS);
  double mark[SONDE_LANDMARKS][9], level[SONDE_LEVELS][LEVEL_COLUMNS];
  uint32_t site[SONDE_LANDMARKS];
  for (uint32_t k = 0; k < a->landmark_count; ++k) {
    memcpy(mark[k], &a->landmark[k].skin_m, 24);
    memcpy(mark[k] + 3, &a->landmark[k].normal, 24);
    memcpy(mark[k] + 6, &a->landmark[k].vein_m, 24);
    site[k] = a->landmark[k].site;
  }
  for (uint32_t k = 0; k < a->level_count; ++k) {
    const sonde_muscle_level *l = &a->level[k];
    const double row[LEVEL_COLUMNS] = {l->z_m,           l->bone_x_m,      l->bone_y_m,
                                       l->septum_rad[0], l->septum_rad[1], l->septum_rad[2]};
    memcpy(level[k], row, sizeof row);
  }
  double(*point)[POINT_COLUMNS] = sonde_calloc(ALL_POINTS, sizeof *point);
  if (!point) {
    w->failed = true;
    return;
  }
  uint32_t points = 0;
  for (uint32_t b = 0; b < a->branch_count; ++b)
    for (uint32_t k = 0; k < a->branch[b].line.count; ++k, ++points) {
      const sonde_vessel_point *p = &a->branch[b].line.point[k];
      memcpy(point[points], &p->centre_m, 24);
      point[points][3] = p->radius_m;
      point[points][4] = p->depth_m;
    }
  sonde_model_put(w, "anatomy_vessels", "f64", "centre m, radius m, depth m", points, POINT_COLUMNS,
                  point);
  sonde_free(point);
  sonde_model_put(w, "anatomy_landmarks", "f64", "skin m, normal, vein m", a->landmark_count, 9,
                  mark);
  sonde_model_put(w, "anatomy_landmark_sites", "u32", "1", a->landmark_count, 1, site);
  sonde_model_put(w, "anatomy_levels", "f64", "z m, bone x m, bone y m, septa rad", a->level_count,
                  LEVEL_COLUMNS, level);
}

/* ---- reading ------------------------------------------------------------------------------ */

static sonde_status wrong(const sonde_model_reader *r, const char *what) {
  return sonde_fail(r->error, SONDE_FORMAT, "%s: anatomy: %s", r->path, what);
}

static bool take_name(const sonde_json *text, char to[32]) {
  const char *name = sonde_json_as_text(text);
  if (name) snprintf(to, 32, "%s", name);
  return name && name[0];
}

static bool finite_row(const double *row, int count) {
  for (int k = 0; k < count; ++k)
    if (!(fabs(row[k]) < 100)) return false;
  return true;
}

// A number of entries from 0 to `room`.
static bool take_count(const sonde_json *list, uint32_t room, uint32_t *count) {
  *count = sonde_json_count(list);
  return sonde_json_kind_of(list) == SONDE_JSON_LIST && *count <= room;
}

static sonde_status take_vessels(const sonde_model_reader *r, const sonde_json *section,
                                 sonde_thigh_anatomy *a) {
  const sonde_json *list = sonde_json_member(section, "vessels"), *entry = sonde_json_first(list);
  uint32_t rows, used = 0, b = 0;
  const char *row = sonde_model_take(r, "anatomy_vessels", "f64", POINT_COLUMNS, &rows);
  if (!row) return SONDE_FORMAT;
  if (!take_count(list, SONDE_BRANCHES, &a->branch_count)) return wrong(r, "too many vessels");
  for (; entry; entry = sonde_json_next(entry)) {
    sonde_branch *branch = &a->branch[b++];
    const char *kind = sonde_json_as_text(sonde_json_member(entry, "kind"));
    double points = sonde_json_as_number(sonde_json_member(entry, "points"));
    bool artery = kind && strcmp(kind, KIND[SONDE_VESSEL_ARTERY]) == 0;
    if (!take_name(sonde_json_member(entry, "name"), branch->name) || !kind ||
        (!artery && strcmp(kind, KIND[SONDE_VESSEL_VEIN]) != 0))
      return wrong(r, "a vessel lacks its name or kind");
    branch->kind = artery ? SONDE_VESSEL_ARTERY : SONDE_VESSEL_VEIN;
    if (!(points >= 2 && points <= SONDE_VESSEL_POINTS && points <= rows - used))
      return wrong(r, "a vessel has a wrong number of points");
    branch->line.count = (uint32_t)points;
    for (uint32_t k = 0; k < branch->line.count; ++k, ++used) {
      double x[POINT_COLUMNS];
      memcpy(x, row + (size_t)used * sizeof x, sizeof x);
      if (!finite_row(x, POINT_COLUMNS) || !(x[3] >= 1e-6) || !(x[4] >= 0))
        return wrong(r, "a vessel has a point out of range");
      branch->line.point[k] = (sonde_vessel_point){vec3(x[0], x[1], x[2]), x[3], x[4]};
    }
  }
  return SONDE_OK;
}

sonde_status sonde_anatomy_take(const sonde_model_reader *r, sonde_model *model) {
  const sonde_json *section = sonde_json_member(r->header, "anatomy");
  if (!section) return SONDE_OK;
  SONDE_ASSERT(!model->anatomy);
  double version = sonde_json_as_number(sonde_json_member(section, "version"));
  if (!(version == SECTION_VERSION))
    return sonde_fail(r->error, SONDE_VERSION, "%s: anatomy has version %g, expected %d", r->path,
                      version, SECTION_VERSION);
  sonde_thigh_anatomy *a = model->anatomy = SONDE_NEW(sonde_thigh_anatomy, 1);
  if (!a) return sonde_fail_memory(r->error);
  sonde_status status = take_vessels(r, section, a);
  if (status) return status;

  const sonde_json *list = sonde_json_member(section, "landmarks"), *entry = sonde_json_first(list);
  uint32_t rows, sites, k = 0;
  const char *row = sonde_model_take(r, "anatomy_landmarks", "f64", 9, &rows);
  const char *site = row ? sonde_model_take(r, "anatomy_landmark_sites", "u32", 1, &sites) : NULL;
  if (!site) return SONDE_FORMAT;
  if (!take_count(list, SONDE_LANDMARKS, &a->landmark_count) || a->landmark_count != rows ||
      rows != sites)
    return wrong(r, "landmarks do not match their rows");
  for (; entry; entry = sonde_json_next(entry)) {
    sonde_landmark *mark = &a->landmark[k];
    double x[9];
    memcpy(x, row + (size_t)k * sizeof x, sizeof x);
    memcpy(&mark->site, site + (size_t)k * 4, 4);
    if (!take_name(entry, mark->name) || !finite_row(x, 9))
      return wrong(r, "a landmark lacks its name or place");
    memcpy(&mark->skin_m, x, 24);
    memcpy(&mark->normal, x + 3, 24);
    memcpy(&mark->vein_m, x + 6, 24);
    ++k;
  }

  list = sonde_json_member(section, "segments");
  entry = sonde_json_first(list);
  if (!take_count(list, SONDE_SEGMENTS, &a->segment_count)) return wrong(r, "too many segments");
  for (k = 0; entry; ++k, entry = sonde_json_next(entry)) {
    sonde_segment *s = &a->segment[k];
    s->from_m = sonde_json_as_number(sonde_json_member(entry, "from_m"));
    s->to_m = sonde_json_as_number(sonde_json_member(entry, "to_m"));
    if (!take_name(sonde_json_member(entry, "name"), s->name) || !finite_row(&s->from_m, 2))
      return wrong(r, "a segment lacks its name or ends");
  }

  row = sonde_model_take(r, "anatomy_levels", "f64", LEVEL_COLUMNS, &rows);
  if (!row) return SONDE_FORMAT;
  const bool limb = model->map_origin != NULL; // its map knows the muscles
  if ((rows < 2 && !(limb && rows == 0)) || rows > SONDE_LEVELS)
    return wrong(r, "a wrong number of levels");
  a->level_count = rows;
  for (k = 0; k < rows; ++k) {
    double x[LEVEL_COLUMNS];
    memcpy(x, row + (size_t)k * sizeof x, sizeof x);
    if (!finite_row(x, LEVEL_COLUMNS) || (k > 0 && !(x[0] > a->level[k - 1].z_m)) ||
        !(x[3] < x[4] && x[4] < x[5]))
      return wrong(r, "a level is out of order");
    a->level[k] = (sonde_muscle_level){x[0], x[1], x[2], {x[3], x[4], x[5]}};
  }

  const sonde_json *angle = sonde_json_first(sonde_json_member(section, "pennation_rad"));
  for (k = 0; k < SONDE_COMPARTMENTS; ++k, angle = sonde_json_next(angle))
    a->pennation_rad[k] = sonde_json_as_number(angle);
  a->fascia_medial_m = sonde_json_as_number(sonde_json_member(section, "fascia_medial_m"));
  a->fascia_lateral_m = sonde_json_as_number(sonde_json_member(section, "fascia_lateral_m"));
  bool ok = finite_row(a->pennation_rad, SONDE_COMPARTMENTS) && a->fascia_medial_m >= 0 &&
            a->fascia_lateral_m >= 0 && finite_row(&a->fascia_medial_m, 2);
  return ok ? SONDE_OK : wrong(r, "pennation or fascia is missing or out of range");
}
