// The model file (docs/model_file.md): a line of magic, a JSON header that names every array, the
// arrays in little-endian binary, and a CRC-32 of all that precedes it.
// The writer collects the arrays into one blob and their descriptions into the header; the reader
// checks magic and CRC first, then takes the arrays by name with their expected shape.
#include "tissue/live_cut.h"
#include "tissue/model_file.h"
#include "tissue/model.h"

#include "base/bounds.h"
#include "base/maths.h"

#include <string.h>
#include <zlib.h>

#define MAGIC "SONDE-MODEL "
// Volumetric models have version 5 and limbs version 6, so that programs which do not know them
// refuse them.
enum { LIMB_VERSION = 6, BULK_VERSION = 5, FORMAT_VERSION = 4, OLDEST_VERSION = 2 };
enum { GRAVITY_COLUMNS = 7 }; // posture, up, groin

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the model file is little-endian");

typedef sonde_model_writer writer;
typedef sonde_model_reader reader;

/* ---- writer ------------------------------------------------------------------------------- */

void sonde_model_put(writer *w, const char *name, const char *type, const char *unit, uint32_t rows,
                     uint32_t columns, const void *bytes) {
  SONDE_ASSERT(w->used <= w->room && (bytes || !rows));
  size_t count = (size_t)rows * columns * (strcmp(type, "f64") == 0 ? 8 : 4);
  if (w->used + count > w->room) {
    size_t room = 2 * (w->used + count) + 4096;
    char *blob = sonde_realloc(w->blob, w->used, room);
    if (!blob) sonde_free(w->blob);
    w->blob = blob;
    w->room = blob ? room : 0;
    if (!blob) w->failed = true;
  }
  if (w->failed) return;
  sonde_json_begin_object(&w->header, NULL);
  sonde_json_put_text(&w->header, "name", name);
  sonde_json_put_text(&w->header, "type", type);
  sonde_json_put_text(&w->header, "unit", unit);
  sonde_json_begin_list(&w->header, "shape");
  sonde_json_put_integer(&w->header, NULL, rows);
  sonde_json_put_integer(&w->header, NULL, columns);
  sonde_json_end(&w->header);
  sonde_json_put_integer(&w->header, "offset", (int64_t)w->used);
  sonde_json_end(&w->header);
  if (count) memcpy(w->blob + w->used, bytes, count);
  w->used += count;
}

static void put_mesh(writer *w, const char *vertices, const char *faces, const sonde_mesh *mesh) {
  sonde_model_put(w, vertices, "f64", "m", mesh->vertex_count, 3, mesh->vertices);
  sonde_model_put(w, faces, "u32", "1", mesh->face_count, 3, mesh->faces);
}

static void put_sites(writer *w, const uint32_t *probe, const sonde_model *model) {
  uint32_t n = model->site_count;
  uint32_t *id = SONDE_NEW(uint32_t, n);
  double(*row)[14] = sonde_calloc(n, sizeof *row);
  double(*share)[2] = sonde_calloc(n, sizeof *share);
  if (id && row && share) {
    for (uint32_t k = 0; k < n; ++k) {
      const sonde_site *s = &model->sites[k];
      id[k] = s->id;
      memcpy(&row[k][0], &s->position_m, 24);
      memcpy(&row[k][3], &s->normal, 24);
      memcpy(&row[k][6], &s->u, 24);
      memcpy(&row[k][9], &s->v, 24);
      row[k][12] = s->k0_n_m3;
      row[k][13] = s->xm_m;
      share[k][0] = s->shear_share;
      share[k][1] = s->limit_share;
    }
    sonde_model_put(w, "site_id", "u32", "1", n, 1, id);
    sonde_model_put(w, "site", "f64", "position m, normal, u, v, k0 N/m^3, xm m", n, 14, row);
    sonde_model_put(w, "site_share", "f64", "of G, of gm", n, 2, share);
  } else {
    w->failed = true;
  }
  sonde_free(id);
  sonde_free(row);
  sonde_free(share);

  // The measurements at the sites.
  uint32_t count = model->datum_count;
  uint32_t(*key)[2] = sonde_calloc(count, sizeof *key);
  double(*value)[2] = sonde_calloc(count, sizeof *value);
  if (key && value) {
    for (uint32_t k = 0; k < count; ++k) {
      key[k][0] = model->data[k].site;
      key[k][1] = probe[k];
      value[k][0] = model->data[k].penetration_m;
      value[k][1] = model->data[k].force_n;
    }
    sonde_model_put(w, "datum_key", "u32", "site, probe", count, 2, key);
    sonde_model_put(w, "datum", "f64", "penetration m, force N", count, 2, value);
  } else {
    w->failed = true;
  }
  sonde_free(key);
  sonde_free(value);
}

static void put_vessel(writer *w, const char *name, const sonde_vessel *vessel) {
  SONDE_ASSERT(vessel->count <= SONDE_VESSEL_POINTS);
  double row[SONDE_VESSEL_POINTS][5];
  for (uint32_t k = 0; k < vessel->count; ++k) {
    const sonde_vessel_point *p = &vessel->point[k];
    memcpy(row[k], &p->centre_m, 24);
    row[k][3] = p->radius_m;
    row[k][4] = p->depth_m;
  }
  sonde_model_put(w, name, "f64", "centre m, radius m, depth m", vessel->count, 5, row);
}

// Fields of the law in file order.
static double *law_field(sonde_surface_law *law, int index, const char **name) {
  double *field[] = {&law->edge_stiffness_n_m,
                     &law->edge_damping_s,
                     &law->edge_compression,
                     &law->edge_pretension_n,
                     &law->tangential_stiffness_n_m3,
                     &law->shear_stiffness_n_m,
                     &law->shear_limit,
                     &law->normal_damping_s,
                     &law->surface_density_kg_m2,
                     &law->guard,
                     &law->normal_exponent,
                     &law->inplane_stiffness_n_m};
  static const char *const NAME[] = {"edge_stiffness_n_m",
                                     "edge_damping_s",
                                     "edge_compression",
                                     "edge_pretension_n",
                                     "tangential_stiffness_n_m3",
                                     "shear_stiffness_n_m",
                                     "shear_limit",
                                     "normal_damping_s",
                                     "surface_density_kg_m2",
                                     "guard",
                                     "normal_exponent",
                                     "inplane_stiffness_n_m"};
  if (index >= (int)SONDE_COUNT_OF(field)) return NULL;
  *name = NAME[index];
  return field[index];
}

// `probe` is scratch, one entry per datum.
static void put_model(writer *w, uint32_t *probe, const sonde_model *model) {
  sonde_json_out *header = &w->header;
  sonde_surface_law copy = model->law;
  const char *name;
  sonde_json_begin_object(header, NULL);
  sonde_json_begin_object(header, "law");
  for (int k = 0; law_field(&copy, k, &name); ++k)
    sonde_json_put_real(header, name, *law_field(&copy, k, &name), 0);
  sonde_json_end(header);

  // each probe of the data by name; probe[datum] is its index in that list
  uint32_t probes = 0;
  sonde_json_begin_list(header, "probes");
  for (uint32_t k = 0; k < model->datum_count; ++k) {
    uint32_t first = 0;
    while (strcmp(model->data[first].probe, model->data[k].probe) != 0) ++first;
    SONDE_ASSERT(first <= k);
    if (first == k) sonde_json_put_text(header, NULL, model->data[k].probe);
    probe[k] = first == k ? probes++ : probe[first];
  }
  sonde_json_end(header);

  sonde_json_begin_list(header, "arrays");
  put_mesh(w, "surface_vertices", "surface_faces", &model->surface);
  put_mesh(w, "femur_vertices", "femur_faces", &model->femur);
  uint32_t n = model->surface.vertex_count;
  sonde_model_put(w, "node_k0", "f64", "N/m^3", n, 1, model->k0_n_m3);
  sonde_model_put(w, "node_xm", "f64", "m", n, 1, model->xm_m);
  sonde_model_put(w, "node_shear_share", "f64", "1", n, 1, model->shear_share);
  sonde_model_put(w, "node_limit_share", "f64", "1", n, 1, model->limit_share);
  sonde_model_put(w, "node_fat_depth", "f64", "m", n, 1, model->fat_depth_m);
  sonde_model_put(w, "node_muscle_depth", "f64", "m", n, 1, model->muscle_depth_m);
  sonde_model_put(w, "node_bone_depth", "f64", "m", n, 1, model->bone_depth_m);
  if (model->edge_share) { // what cannot be derived again from a skin with lips
    sonde_model_put(w, "node_normal", "f64", "1", n, 3, model->normal);
    sonde_model_put(w, "edge_share", "f64", "1", model->topology.edge_count, 1, model->edge_share);
  }
  put_sites(w, probe, model);
  put_vessel(w, "vein", &model->vein);
  put_vessel(w, "artery", &model->artery);
  if (model->bone_axis_m) {
    sonde_model_put(w, "bone_axis", "f64", "m", model->bone_axis_count, 3, model->bone_axis_m);
    sonde_model_put(w, "map_origin", "f64", "SI", model->map_origin_count, 1, model->map_origin);
  }
  const sonde_gravity *g = &model->gravity;
  if (v_norm2(g->up) > 0) {
    const double row[GRAVITY_COLUMNS] = {g->posture,   g->up.x,      g->up.y,     g->up.z,
                                         g->groin_m.x, g->groin_m.y, g->groin_m.z};
    sonde_model_put(w, "gravity", "f64", "1, m", 1, GRAVITY_COLUMNS, row);
  }
  if (model->anatomy) sonde_anatomy_put_arrays(w, model->anatomy);
  if (model->bulk) sonde_bulk_put_arrays(w, model);
  sonde_json_end(header);
  sonde_json_put_text(header, "name", model->name);
  sonde_json_put_text(header, "provenance", model->provenance);
  sonde_json_put_text(header, "written_by", "sonde " SONDE_VERSION_STRING);
  if (model->anatomy) sonde_anatomy_put_section(header, model->anatomy);
  if (model->bulk) sonde_bulk_put_section(header, model);
  sonde_json_end(header);
}

sonde_status sonde_model_save(sonde_model *model, const char *path, sonde_error *error) {
  SONDE_ASSERT(model && path);
  writer w = {.header = {.layout = SONDE_JSON_TABS}};
  char *text = NULL, magic[64];
  size_t count = 0;
  uint32_t *probe = SONDE_NEW(uint32_t, model->datum_count);
  sonde_status status = probe ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_file_in_memory(&w.header.file, error);
  if (!status) {
    put_model(&w, probe, model);
    status = sonde_file_take(w.header.file, &text, &count, error);
  }
  if (!status && w.failed) status = sonde_fail_memory(error);
  sonde_file *file = NULL;
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    // magic line, header, arrays and the CRC-32 of them all
    size_t length = (size_t)snprintf(magic, sizeof magic, MAGIC "%d %zu %zu\n",
                                     model->bone_axis_m ? LIMB_VERSION
                                     : model->bulk      ? BULK_VERSION
                                                        : FORMAT_VERSION,
                                     count, w.used);
    uLong crc = crc32_z(0, (const Bytef *)magic, length);
    crc = crc32_z(crc, (const Bytef *)text, count);
    uint32_t tail = (uint32_t)crc32_z(crc, (const Bytef *)w.blob, w.used);
    sonde_file_write(file, magic, length);
    sonde_file_write(file, text, count);
    sonde_file_write(file, w.blob, w.used);
    sonde_file_write(file, &tail, sizeof tail);
    model->checksum =
        sonde_hash(sonde_hash(sonde_hash(0, magic, length), text, count), w.blob, w.used);
    status = sonde_file_commit(file, error);
  }
  sonde_free(text);
  sonde_free(probe);
  sonde_free(w.blob);
  return status;
}

/* ---- reader ------------------------------------------------------------------------------- */

static const sonde_json *find_array(const reader *r, const char *name) {
  const sonde_json *entry = sonde_json_first(sonde_json_member(r->header, "arrays"));
  for (; entry; entry = sonde_json_next(entry)) {
    const char *found = sonde_json_as_text(sonde_json_member(entry, "name"));
    if (found && strcmp(found, name) == 0) return entry;
  }
  return NULL;
}

// Bytes of a named array with `columns` columns; NULL after setting the error.
const void *sonde_model_take(const reader *r, const char *name, const char *type, uint32_t columns,
                             uint32_t *rows) {
  const sonde_json *entry = find_array(r, name);
  const sonde_json *shape = sonde_json_first(sonde_json_member(entry, "shape"));
  const char *kind = sonde_json_as_text(sonde_json_member(entry, "type"));
  double height = sonde_json_as_number(shape);
  double width = sonde_json_as_number(sonde_json_next(shape));
  double offset = sonde_json_as_number(sonde_json_member(entry, "offset"));
  size_t item = strcmp(type, "f64") == 0 ? 8 : 4;
  bool ok = entry && kind && strcmp(kind, type) == 0 && width == (double)columns && height >= 0 &&
            height < 1e8 && offset >= 0 &&
            offset + height * width * (double)item <= (double)r->size;
  if (!ok) {
    sonde_fail(r->error, SONDE_FORMAT, "%s: array '%s' is missing or not %s [n][%u]", r->path, name,
               type, columns);
    return NULL;
  }
  *rows = (uint32_t)height;
  return r->blob + (size_t)offset;
}

static bool take_mesh(const reader *r, const char *vertices, const char *faces, sonde_mesh *mesh) {
  uint32_t v, f;
  const void *xyz = sonde_model_take(r, vertices, "f64", 3, &v);
  const void *abc = xyz ? sonde_model_take(r, faces, "u32", 3, &f) : NULL;
  if (!abc || sonde_mesh_create(mesh, v, f, r->error)) return false;
  memcpy(mesh->vertices, xyz, (size_t)v * 24);
  memcpy(mesh->faces, abc, (size_t)f * 12);
  for (uint32_t k = 0; k < f; ++k)
    for (int c = 0; c < 3; ++c)
      if (mesh->faces[k][c] >= v) {
        sonde_fail(r->error, SONDE_FORMAT, "%s: face %u of '%s' names vertex %u of %u", r->path, k,
                   faces, mesh->faces[k][c], v);
        return false;
      }
  return true;
}

static bool take_sites(const reader *r, sonde_model *model) {
  uint32_t n, m;
  const char *id = sonde_model_take(r, "site_id", "u32", 1, &n);
  const char *row = id ? sonde_model_take(r, "site", "f64", 14, &m) : NULL;
  if (!row) return false;
  model->sites = SONDE_NEW(sonde_site, n);
  if (!model->sites || n != m) {
    sonde_fail(r->error, SONDE_FORMAT, "%s: %u site ids for %u sites", r->path, n, m);
    return false;
  }
  model->site_count = n;
  for (uint32_t k = 0; k < n; ++k, id += 4, row += 14 * 8) {
    sonde_site *s = &model->sites[k];
    memcpy(&s->id, id, 4);
    memcpy(&s->position_m, row, 24);
    memcpy(&s->normal, row + 24, 24);
    memcpy(&s->u, row + 48, 24);
    memcpy(&s->v, row + 72, 24);
    memcpy(&s->k0_n_m3, row + 96, 8);
    memcpy(&s->xm_m, row + 104, 8);
  }

  // What files before the fields of the shear layer lack; the shares stay as they are then.
  uint32_t nodes = model->surface.vertex_count, rows[3];
  if (!find_array(r, "node_shear_share")) return true;
  const char *shear = sonde_model_take(r, "node_shear_share", "f64", 1, &rows[0]);
  const char *limit = shear ? sonde_model_take(r, "node_limit_share", "f64", 1, &rows[1]) : NULL;
  const char *site = limit ? sonde_model_take(r, "site_share", "f64", 2, &rows[2]) : NULL;
  if (!site) return false;
  if (rows[0] != nodes || rows[1] != nodes || rows[2] != n) {
    sonde_fail(r->error, SONDE_FORMAT,
               "%s: shares of %u, %u nodes and %u sites, expected %u and %u", r->path, rows[0],
               rows[1], rows[2], nodes, n);
    return false;
  }
  memcpy(model->shear_share, shear, (size_t)nodes * 8);
  memcpy(model->limit_share, limit, (size_t)nodes * 8);
  for (uint32_t k = 0; k < n; ++k, site += 16) {
    memcpy(&model->sites[k].shear_share, site, 8);
    memcpy(&model->sites[k].limit_share, site + 8, 8);
  }
  return true;
}

static bool take_data(const reader *r, sonde_model *model) {
  uint32_t n, m;
  const char *key = sonde_model_take(r, "datum_key", "u32", 2, &n);
  const char *value = key ? sonde_model_take(r, "datum", "f64", 2, &m) : NULL;
  if (!value || n != m) return false;
  const sonde_json *names = sonde_json_member(r->header, "probes");
  model->data = SONDE_NEW(sonde_datum, n);
  if (!model->data) return false;
  model->datum_count = n;
  for (uint32_t k = 0; k < n; ++k, key += 8, value += 16) {
    sonde_datum *d = &model->data[k];
    uint32_t probe;
    memcpy(&d->site, key, 4);
    memcpy(&probe, key + 4, 4);
    memcpy(&d->penetration_m, value, 8);
    memcpy(&d->force_n, value + 8, 8);
    const sonde_json *name = sonde_json_first(names);
    for (uint32_t i = probe & 0xffff; name && i > 0; --i) name = sonde_json_next(name);
    const char *text = sonde_json_as_text(name);
    snprintf(d->probe, sizeof d->probe, "%s", text ? text : "?");
  }
  return true;
}

static bool take_vessel(const reader *r, const char *name, sonde_vessel *vessel) {
  uint32_t n;
  const char *row = sonde_model_take(r, name, "f64", 5, &n);
  if (!row || n > SONDE_VESSEL_POINTS) return false;
  vessel->count = n;
  for (uint32_t k = 0; k < n; ++k, row += 40) {
    sonde_vessel_point *p = &vessel->point[k];
    memcpy(&p->centre_m, row, 24);
    memcpy(&p->radius_m, row + 24, 8);
    memcpy(&p->depth_m, row + 32, 8);
  }
  return true;
}

static void take_text(const reader *r, const char *key, char *to, size_t size) {
  const char *text = sonde_json_as_text(sonde_json_member(r->header, key));
  snprintf(to, size, "%s", text ? text : "");
}

// Every number of the model is that of a body: a file may be whole and yet wrong.
static bool numbers_within(const reader *r, const char *name, const double *values, size_t count,
                           double low, double high) {
  for (size_t k = 0; k < count; ++k)
    if (!(values[k] >= low && values[k] <= high)) {
      sonde_fail(r->error, SONDE_FORMAT, "%s: %s[%zu] is %g, expected a number from %g to %g",
                 r->path, name, k, values[k], low, high);
      return false;
    }
  return true;
}

static bool check_vessel(const reader *r, const char *name, const sonde_vessel *vessel) {
  for (uint32_t k = 0; k < vessel->count; ++k) {
    const sonde_vessel_point *p = &vessel->point[k];
    if (!numbers_within(r, name, &p->centre_m.x, 3, -100, 100) ||
        !numbers_within(r, name, &p->radius_m, 1, 1e-6, 100) ||
        !numbers_within(r, name, &p->depth_m, 1, 0, 100))
      return false;
  }
  return true;
}

static bool check_numbers(const reader *r, const sonde_model *model) {
  size_t n = model->surface.vertex_count;
  bool ok =
      numbers_within(r, "surface_vertices", &model->surface.vertices[0].x, 3 * n, -100, 100) &&
      numbers_within(r, "femur_vertices", &model->femur.vertices[0].x,
                     3 * (size_t)model->femur.vertex_count, -100, 100) &&
      numbers_within(r, "node_k0", model->k0_n_m3, n, 1e-6, 1e12) &&
      numbers_within(r, "node_xm", model->xm_m, n, 1e-6, 100) &&
      numbers_within(r, "node_shear_share", model->shear_share, n, 1e-6, 1e12) &&
      numbers_within(r, "node_limit_share", model->limit_share, n, 1e-6, 1e12) &&
      numbers_within(r, "node_fat_depth", model->fat_depth_m, n, 0, 100) &&
      numbers_within(r, "node_muscle_depth", model->muscle_depth_m, n, 0, 100) &&
      numbers_within(r, "node_bone_depth", model->bone_depth_m, n, 0, 100);
  for (uint32_t k = 0; ok && k < model->site_count; ++k) {
    const sonde_site *site = &model->sites[k];
    ok = numbers_within(r, "site", &site->position_m.x, 12, -100, 100) &&
         numbers_within(r, "site", &site->k0_n_m3, 1, 1e-6, 1e12) &&
         numbers_within(r, "site", &site->xm_m, 1, 1e-6, 100) &&
         numbers_within(r, "site_share", &site->shear_share, 2, 0, 100);
  }
  for (uint32_t k = 0; ok && k < model->datum_count; ++k)
    ok = numbers_within(r, "datum", &model->data[k].penetration_m, 2, -1e6, 1e6);
  return ok && check_vessel(r, "vein", &model->vein) && check_vessel(r, "artery", &model->artery);
}

// A cut skin brings the normals that it had when it was whole and the edges' shares of the springs.
static bool take_cuts(const reader *r, sonde_model *model) {
  uint32_t n = model->surface.vertex_count, edges = model->topology.edge_count, rows[2];
  const char *normal = sonde_model_take(r, "node_normal", "f64", 3, &rows[0]);
  const char *share = normal ? sonde_model_take(r, "edge_share", "f64", 1, &rows[1]) : NULL;
  if (!share) return false;
  model->edge_share = SONDE_NEW(double, edges);
  if (!model->edge_share || rows[0] != n || rows[1] != edges) {
    sonde_fail(r->error, SONDE_FORMAT, "%s: %u normals and %u shares, expected %u and %u", r->path,
               rows[0], rows[1], n, edges);
    return false;
  }
  memcpy(model->normal, normal, n * sizeof *model->normal);
  memcpy(model->edge_share, share, edges * sizeof *model->edge_share);
  for (uint32_t i = 0; i < n; ++i)
    if (!(fabs(v_norm(model->normal[i]) - 1) < 1e-9)) {
      sonde_fail(r->error, SONDE_FORMAT, "%s: node_normal[%u] is not of unit length", r->path, i);
      return false;
    }
  for (uint32_t e = 0; e < edges; ++e)
    if (!(model->edge_share[e] > 0 && model->edge_share[e] <= 1)) {
      sonde_fail(r->error, SONDE_FORMAT, "%s: edge_share[%u] is %g, expected more than 0 to 1",
                 r->path, e, model->edge_share[e]);
      return false;
    }
  return true;
}

// A limb brings the line of its bones and the numbers of its tissue map.
static bool take_limb(const reader *r, sonde_model *model) {
  uint32_t points, numbers;
  const char *axis = sonde_model_take(r, "bone_axis", "f64", 3, &points);
  const char *origin = axis ? sonde_model_take(r, "map_origin", "f64", 1, &numbers) : NULL;
  if (!origin) return false;
  if (points < 2) {
    sonde_fail(r->error, SONDE_FORMAT, "%s: bone_axis has %u points, expected 2 or more", r->path,
               points);
    return false;
  }
  model->bone_axis_m = SONDE_NEW(sonde_vec3, points);
  model->map_origin = SONDE_NEW(double, numbers);
  if (!model->bone_axis_m || !model->map_origin) return false;
  model->bone_axis_count = points, model->map_origin_count = numbers;
  memcpy(model->bone_axis_m, axis, points * sizeof *model->bone_axis_m);
  if (numbers) memcpy(model->map_origin, origin, numbers * sizeof *model->map_origin);
  if (find_array(r, "gravity")) {
    double row[GRAVITY_COLUMNS] = {0};
    const char *gravity = sonde_model_take(r, "gravity", "f64", GRAVITY_COLUMNS, &numbers);
    if (!gravity) return false;
    if (numbers == 1) memcpy(row, gravity, sizeof row);
    const sonde_vec3 up = vec3(row[1], row[2], row[3]), groin = vec3(row[4], row[5], row[6]);
    if (numbers != 1 || !(row[0] >= 0 && row[0] < SONDE_POSTURE_COUNT) ||
        !(fabs(v_norm(up) - 1) < 1e-9) || !v_finite(groin)) {
      sonde_fail(r->error, SONDE_FORMAT,
                 "%s: gravity, expected a posture 0 to %d, a unit vector and a point", r->path,
                 SONDE_POSTURE_COUNT - 1);
      return false;
    }
    model->gravity = (sonde_gravity){(sonde_posture)row[0], up, groin};
  }
  return numbers_within(r, "bone_axis", &model->bone_axis_m[0].x, 3 * (size_t)points, -100, 100);
}

// The skin encloses the thigh; a cut one when its lips are put together.
static sonde_status check_closed(const reader *r, const sonde_model *model, bool is_cut) {
  bool closes = true;
  sonde_mesh_report report = {0};
  sonde_status status = is_cut ? sonde_skin_closes(model, &closes, r->error)
                               : sonde_mesh_inspect(&model->surface, &report, r->error);
  if (status || (closes && (is_cut || report.closed))) return status;
  return sonde_fail(r->error, SONDE_MESH, "%s: the skin is not closed", r->path);
}

static sonde_status read_model(const reader *r, sonde_model *model) {
  sonde_fail(r->error, SONDE_FORMAT, "%s: its arrays do not belong together", r->path);
  take_text(r, "name", model->name, sizeof model->name);
  take_text(r, "provenance", model->provenance, sizeof model->provenance);
  const sonde_json *law = sonde_json_member(r->header, "law");
  const char *name;
  double *field;
  for (int k = 0; (field = law_field(&model->law, k, &name)) != NULL; ++k) {
    const sonde_json *item = sonde_json_member(law, name);
    bool late = field == &model->law.inplane_stiffness_n_m; // files before version 4 have none
    if (!item && late) continue;
    if (sonde_json_kind_of(item) != SONDE_JSON_NUMBER)
      return sonde_fail(r->error, SONDE_FORMAT, "%s: law.%s is missing, expected a number", r->path,
                        name);
    *field = sonde_json_as_number(item);
  }
  if (!take_mesh(r, "surface_vertices", "surface_faces", &model->surface) ||
      !take_mesh(r, "femur_vertices", "femur_faces", &model->femur))
    return SONDE_FORMAT;
  sonde_status status = sonde_model_allocate_nodes(model, r->error);
  if (status) return status;

  // What every node has.
  const struct {
    const char *name;
    double *to;
  } array[] = {{"node_k0", model->k0_n_m3},
               {"node_xm", model->xm_m},
               {"node_fat_depth", model->fat_depth_m},
               {"node_muscle_depth", model->muscle_depth_m},
               {"node_bone_depth", model->bone_depth_m}};
  uint32_t n = model->surface.vertex_count;
  for (size_t k = 0; k < SONDE_COUNT_OF(array); ++k) {
    uint32_t rows;
    const void *from = sonde_model_take(r, array[k].name, "f64", 1, &rows);
    if (from && rows != n)
      sonde_fail(r->error, SONDE_FORMAT, "%s: array '%s' has %u rows, expected %u", r->path,
                 array[k].name, rows, n);
    if (!from || rows != n) return SONDE_FORMAT;
    memcpy(array[k].to, from, (size_t)n * 8);
  }

  if (!take_sites(r, model) || !take_data(r, model) || !take_vessel(r, "vein", &model->vein) ||
      !take_vessel(r, "artery", &model->artery) || !check_numbers(r, model))
    return SONDE_FORMAT;
  if (find_array(r, "bone_axis") && !take_limb(r, model)) return SONDE_FORMAT;
  if ((status = sonde_anatomy_take(r, model)) != SONDE_OK) return status;
  bool is_cut = find_array(r, "edge_share") != NULL;
  if (!is_cut) status = check_closed(r, model, false);
  if (!status) status = sonde_model_derive(model, r->error);
  if (!status && is_cut) status = check_closed(r, model, true);
  if (!status && is_cut && !take_cuts(r, model)) status = SONDE_FORMAT;
  return status ? status : sonde_bulk_take(r, model);
}

sonde_status sonde_model_load(const char *path, sonde_model **out, sonde_error *error) {
  *out = NULL;
  char *bytes = NULL;
  size_t count = 0, text = 0, blob = 0, start = 0;
  sonde_error scratch = {0};
  sonde_json *header = NULL;
  sonde_model *model = SONDE_NEW(sonde_model, 1);
  sonde_status status = model ? sonde_bounded_load(path, &sonde_limits_model, &bytes, &count, error)
                              : sonde_fail_memory(error);

  // Magic, header and arrays: sizes, version and CRC are checked before anything is believed.
  if (!status) {
    int version = 0, used = 0;
    bool known = count >= 32 && strncmp(bytes, MAGIC, strlen(MAGIC)) == 0;
    uint32_t stored = 0, crc = known ? (uint32_t)crc32_z(0, (const Bytef *)bytes, count - 4) : 0;
    if (known) memcpy(&stored, bytes + count - 4, 4);
    if (!known)
      status = sonde_fail(error, SONDE_FORMAT,
                          "%s: is not a Sonde model, expected '%s' at its start", path, MAGIC);
    else if (crc != stored)
      status = sonde_fail(error, SONDE_CHECKSUM,
                          "%s: is damaged or truncated: CRC-32 is %08x, expected %08x", path, crc,
                          stored);
    else if (sscanf(bytes + strlen(MAGIC), "%d %zu %zu%n", &version, &text, &blob, &used) != 3)
      status = sonde_fail(error, SONDE_FORMAT, "%s:1: expected a version and two sizes", path);
    else if (version < OLDEST_VERSION || version > LIMB_VERSION)
      status = sonde_fail(error, SONDE_VERSION, "%s: has format version %d, expected %d to %d",
                          path, version, OLDEST_VERSION, LIMB_VERSION);
    start = strlen(MAGIC) + (size_t)used + 1;
    if (!status && (text > count || blob > count || start + text + blob + 4 != count))
      status = sonde_fail(error, SONDE_FORMAT,
                          "%s:1: the sizes do not add up to the file's %zu bytes", path, count);
  }
  const sonde_json_source source = {path, 2, sonde_limits_model.most_depth,
                                    (uint32_t)sonde_limits_model.most_items};
  if (!status) status = sonde_json_parse(bytes + start, text, &source, &header, error);
  if (!status) {
    reader r = {path, header, bytes + start + text, blob, &scratch};
    status = read_model(&r, model);
    if (status && error) *error = scratch;
  }
  if (!status) {
    model->checksum = sonde_hash(0, bytes, count - 4);
    *out = model;
    model = NULL;
  }
  sonde_json_free(header);
  sonde_free(bytes);
  sonde_model_destroy(model);
  return status;
}
