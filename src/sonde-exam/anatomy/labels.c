// From a volume of labels to the surfaces of a leg: which number is which tissue, the largest body,
// holes, and an isosurface of each tissue's share in blocks of about 1.5 mm.
#include "anatomy/shape.h"
#include "base/bounds.h"
#include "files/nifti.h"
#include "geometry/isosurface.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

// What a number can be called. An unlabelled hole is tissue.
typedef enum tissue {
  BACKGROUND,
  TISSUE,
  SKIN,
  FAT,
  MUSCLE,
  BONE,
  FEMUR,
  VEIN,
  ARTERY,
  KINDS
} tissue;
static const char *const NAMES[KINDS] = {"background", "tissue", "skin", "fat",   "muscle",
                                         "bone",       "femur",  "vein", "artery"};
enum { UNNAMED = 255, LABELS = 65536 };

static const double BLOCK_M = 0.0015;                     // least step of the surfaces' grid
static const double MOST_HOLES = 0.05, SECOND_BODY = 0.2; // of the leg's volume
static const uint32_t LEAST_VOXELS = 1000;

// A voxel's bits by tissue.
#define BIT(kind) (1U << (kind))
static const uint32_t BODY = ~BIT(BACKGROUND);

typedef struct volume {
  uint32_t size[3];
  size_t count, stride[3];
  uint8_t *kind;   // [count] tissue
  uint8_t *mark;   // [count] of flood()
  uint32_t *stack; // [count]
} volume;

static sonde_status read_names(const char *path, uint8_t kind[LABELS], sonde_error *error) {
  SONDE_ASSERT(kind[0] == BACKGROUND);
  if (!path) {
    static const tissue USUAL[] = {BACKGROUND, SKIN, FAT, MUSCLE, BONE, VEIN, ARTERY};
    for (size_t k = 0; k < SONDE_COUNT_OF(USUAL); ++k) kind[k] = (uint8_t)USUAL[k];
    return SONDE_OK;
  }
  static const sonde_input_limits NAME_FILE = {"a file of label names", 1 << 20, 0, 0};
  char *text = NULL;
  size_t count;
  sonde_status status = sonde_bounded_load_text(path, &NAME_FILE, &text, &count, error);
  uint32_t number = 0;
  for (char *line = text, *next; !status && line; line = next) {
    // A number, then words in any signs; one of the words names the tissue.
    next = strchr(line, '\n');
    if (next) *next++ = 0;
    ++number;
    while (isspace((unsigned char)*line)) ++line;
    if (!*line || *line == '#') continue;
    char *end;
    long label = strtol(line, &end, 10);
    int found = KINDS, several = 0;
    for (char *word = end; *word;) {
      while (*word && !isalpha((unsigned char)*word)) ++word;
      size_t length = 0;
      while (isalpha((unsigned char)word[length])) ++length;
      for (int k = 0; length > 0 && k < KINDS; ++k)
        if (strlen(NAMES[k]) == length && strncasecmp(word, NAMES[k], length) == 0 && found != k)
          found = k, ++several;
      word += length;
    }
    if (end == line || label < 0 || label >= LABELS)
      status = sonde_fail(error, SONDE_FORMAT, "%.300s:%u: expected a number from 0 to 65535", path,
                          number);
    else if (several != 1 && label > 0)
      status =
          sonde_fail(error, SONDE_FORMAT,
                     "%.300s:%u: label %ld names %s, expected one of background, tissue, skin, "
                     "fat, muscle, bone, femur, vein, artery",
                     path, number, label, several ? "several tissues" : "no tissue");
    else if (label > 0)
      kind[label] = (uint8_t)found;
  }
  sonde_free(text);
  return status;
}

// Marks everything that is connected with a voxel through sides along some axes and has the same
// mark. @return how many
static size_t flood(volume *v, size_t seed, uint8_t mark, uint32_t axes) {
  const uint8_t old = v->mark[seed];
  SONDE_ASSERT(old != mark && seed < v->count);
  size_t found = 0, depth = 1;
  v->stack[0] = (uint32_t)seed;
  v->mark[seed] = mark;
  while (depth > 0) {
    size_t at = v->stack[--depth];
    ++found;
    for (int a = 0; a < 3; ++a) {
      if (!(axes & BIT(a))) continue;
      size_t place = at / v->stride[a] % v->size[a];
      for (int side = 0; side < 2; ++side) {
        if (side ? place + 1 == v->size[a] : place == 0) continue;
        size_t next = side ? at + v->stride[a] : at - v->stride[a];
        if (v->mark[next] != old) continue;
        v->mark[next] = mark;
        v->stack[depth++] = (uint32_t)next;
      }
    }
  }
  return found;
}

// Marks the largest part of some tissues with 3, everything else with less.
// @return its voxels; *second those of the next
static size_t largest_part(volume *v, uint32_t kinds, size_t *second) {
  size_t best = 0, seed = 0;
  *second = 0;
  for (size_t k = 0; k < v->count; ++k) v->mark[k] = (kinds >> v->kind[k]) & 1;
  for (size_t k = 0; k < v->count; ++k) {
    if (v->mark[k] != 1) continue;
    size_t found = flood(v, k, 2, 7);
    if (found > best)
      *second = best, best = found, seed = k;
    else if (found > *second)
      *second = found;
  }
  if (best > 0) (void)flood(v, seed, 3, 7);
  return best;
}

// The leg is the largest body; what lies apart becomes background. Holes of its sections become
// tissue, also those that run out at the ends, as an empty marrow cavity does.
static sonde_status clean_body(const char *path, const sonde_label_volume *labels, volume *v,
                               double *filled_share, sonde_error *error) {
  size_t second, body = largest_part(v, BODY, &second);
  if (body < LEAST_VOXELS)
    return sonde_fail(error, SONDE_MESH, "%.300s: %zu voxels are labelled, expected a leg", path,
                      body);
  const sonde_vec3 *s = labels->step_m;
  double litre = 1e3 * fabs(v_dot(s[0], v_cross(s[1], s[2])));
  if ((double)second > SECOND_BODY * (double)body)
    return sonde_fail(
        error, SONDE_MESH,
        "%.300s: the labels make two bodies, of %.2f and %.2f l, expected one leg: crop "
        "the volume to it",
        path, (double)body * litre, (double)second * litre);
  for (size_t k = 0; k < v->count; ++k)
    if (v->mark[k] != 3) v->kind[k] = BACKGROUND;

  // Sections stand across the index that runs most along the body.
  int up = 0;
  for (int a = 1; a < 3; ++a)
    if (fabs(s[a].z) / v_norm(s[a]) > fabs(s[up].z) / v_norm(s[up])) up = a;
  const uint32_t across = 7 & ~BIT(up);
  for (size_t k = 0; k < v->count; ++k) v->mark[k] = v->kind[k] == BACKGROUND ? 0 : 1;
  for (size_t k = 0; k < v->count; ++k) {
    bool border = false;
    for (int a = 0; a < 3; ++a) {
      size_t place = k / v->stride[a] % v->size[a];
      border |= a != up && (place == 0 || place + 1 == v->size[a]);
    }
    if (border && v->mark[k] == 0) (void)flood(v, k, 2, across);
  }
  size_t holes = 0;
  for (size_t k = 0; k < v->count; ++k)
    if (v->mark[k] == 0) v->kind[k] = TISSUE, ++holes;
  *filled_share = (double)holes / (double)(body + holes);
  if (*filled_share <= MOST_HOLES) return SONDE_OK;
  return sonde_fail(error, SONDE_MESH,
                    "%.300s: %.0f %% of the leg inside its outline has no label, expected at most "
                    "%.0f %%: label it, or call its number tissue",
                    path, 100 * *filled_share, 100 * MOST_HOLES);
}

// The surface around what is marked with 3, in metres. `open`: without faces on the volume's sides.
static sonde_status make_surface(const sonde_label_volume *labels, const volume *v, bool open,
                                 sonde_mesh *mesh, sonde_error *error) {
  // Share of the marked voxels in blocks.
  uint32_t block[3], n[3];
  for (int a = 0; a < 3; ++a) {
    block[a] = (uint32_t)fmax(1, floor(BLOCK_M / v_norm(labels->step_m[a])));
    n[a] = (v->size[a] + block[a] - 1) / block[a];
  }
  const size_t count = (size_t)n[0] * n[1] * n[2], row = n[0], plane = row * n[1];
  float *share = SONDE_NEW(float, count), *old = SONDE_NEW(float, (size_t)n[0] + n[1] + n[2]);
  sonde_status status = share && old ? SONDE_OK : sonde_fail_memory(error);
  for (size_t k = 0; !status && k < v->count; ++k) {
    if (v->mark[k] != 3) continue;
    const size_t place[3] = {k % v->size[0], k / v->stride[1] % v->size[1], k / v->stride[2]};
    size_t at = 0, inside = 1; // the outermost blocks may hold less
    for (int a = 2; a >= 0; --a) {
      size_t b = place[a] / block[a], left = v->size[a] - b * block[a];
      at = at * n[a] + b;
      inside *= left < block[a] ? left : block[a];
    }
    share[at] += 1.0F / (float)inside;
  }

  // Smoothed by (1, 2, 1)/4 along each index, which takes the steps off a slanting wall and leaves
  // a flat one where it is.
  const size_t stride[3] = {1, row, plane};
  for (int a = 0; !status && a < 3; ++a)
    for (size_t k = 0; k < count; ++k) {
      if (k / stride[a] % n[a] != 0) continue;
      for (uint32_t i = 0; i < n[a]; ++i) old[i] = share[k + i * stride[a]];
      for (uint32_t i = 0; i < n[a]; ++i)
        share[k + i * stride[a]] =
            0.25F * (old[i > 0 ? i - 1 : 0] + 2 * old[i] + old[i + 1 < n[a] ? i + 1 : i]);
    }
  if (!status) status = sonde_isosurface_create(share, n, 0.5F, mesh, error);

  // Faces beyond the outermost voxels' middles close the surface at the volume's sides.
  uint32_t kept = 0;
  for (uint32_t k = 0; !status && open && k < mesh->face_count; ++k) {
    sonde_vec3 p = vec3(0, 0, 0);
    for (int c = 0; c < 3; ++c) p = v_madd(p, 1.0 / 3, mesh->vertices[mesh->faces[k][c]]);
    if (p.x < 0 || p.y < 0 || p.z < 0 || p.x > n[0] - 1 || p.y > n[1] - 1 || p.z > n[2] - 1)
      continue;
    memmove(mesh->faces[kept++], mesh->faces[k], sizeof mesh->faces[k]);
  }
  if (!status && open) mesh->face_count = kept;

  // From blocks to metres; a left-handed grid turns the faces round.
  const sonde_vec3 *s = labels->step_m;
  const bool turned = v_dot(s[0], v_cross(s[1], s[2])) < 0;
  for (uint32_t k = 0; !status && k < mesh->vertex_count; ++k) {
    double index[3] = {mesh->vertices[k].x, mesh->vertices[k].y, mesh->vertices[k].z};
    sonde_vec3 p = labels->origin_m;
    for (int a = 0; a < 3; ++a) p = v_madd(p, block[a] * index[a] + 0.5 * (block[a] - 1.0), s[a]);
    mesh->vertices[k] = p;
  }
  for (uint32_t k = 0; !status && turned && k < mesh->face_count; ++k) {
    uint32_t swap = mesh->faces[k][1];
    mesh->faces[k][1] = mesh->faces[k][2];
    mesh->faces[k][2] = swap;
  }
  sonde_free(share);
  sonde_free(old);
  return status;
}

sonde_status sonde_leg_labels_load(const char *path, const char *names_path, sonde_leg_labels *out,
                                   sonde_error *error) {
  SONDE_ASSERT(path && out);
  *out = (sonde_leg_labels){0};
  uint8_t *kind = SONDE_NEW(uint8_t, LABELS);
  if (!kind) return sonde_fail_memory(error);
  memset(kind + 1, UNNAMED, LABELS - 1);
  sonde_label_volume labels = {0};
  volume v = {0};
  sonde_status status = read_names(names_path, kind, error);
  if (!status) status = sonde_label_volume_load(path, &labels, error);
  if (!status) {
    v.count = 1;
    for (int a = 0; a < 3; ++a) {
      v.size[a] = labels.size[a], v.stride[a] = v.count, v.count *= v.size[a];
      out->voxel_m = fmax(out->voxel_m, v_norm(labels.step_m[a]));
    }
    v.kind = SONDE_NEW(uint8_t, v.count);
    v.mark = SONDE_NEW(uint8_t, v.count);
    v.stack = SONDE_NEW(uint32_t, v.count);
    if (!v.kind || !v.mark || !v.stack) status = sonde_fail_memory(error);
  }
  for (size_t k = 0; !status && k < v.count; ++k) {
    v.kind[k] = kind[labels.label[k]];
    if (v.kind[k] == UNNAMED)
      status = sonde_fail(
          error, SONDE_FORMAT, "%.300s: label %u has no name, expected %s", path, labels.label[k],
          names_path ? "a line in the file of label names"
                     : "1 to 6 (skin, fat, muscle, bone, vein, artery), or a file of "
                       "label names");
  }
  sonde_free(labels.label); // as large as all that follows
  labels.label = NULL;
  if (!status) status = clean_body(path, &labels, &v, &out->filled_share, error);

  size_t many[KINDS] = {0};
  for (size_t k = 0; !status && k < v.count; ++k) many[v.kind[k]]++;
  const struct {
    sonde_mesh *mesh;
    uint32_t kinds;
    bool wanted;
  } part[] = {{&out->skin, BODY, true},
              {&out->femur, many[FEMUR] ? BIT(FEMUR) : BIT(BONE), true},
              {&out->muscle, BIT(MUSCLE) | BIT(BONE) | BIT(FEMUR), many[MUSCLE] >= LEAST_VOXELS},
              {&out->vein, BIT(VEIN), true},
              {&out->artery, BIT(ARTERY), true}};
  for (size_t k = 0; !status && k < SONDE_COUNT_OF(part); ++k) {
    size_t second;
    if (!part[k].wanted || largest_part(&v, part[k].kinds, &second) == 0) continue;
    status = make_surface(&labels, &v, k == 0, part[k].mesh, error);
    // A vessel that is thinner than the voxels smooth away is not in the scan.
    if (status == SONDE_MESH && part[k].kinds & (BIT(VEIN) | BIT(ARTERY)) && k > 0)
      status = SONDE_OK;
  }
  sonde_free(v.kind);
  sonde_free(v.mark);
  sonde_free(v.stack);
  sonde_free(kind);
  sonde_label_volume_clear(&labels);
  if (status) sonde_leg_labels_clear(out);
  return status;
}

void sonde_leg_labels_clear(sonde_leg_labels *labels) {
  sonde_mesh_clear(&labels->skin);
  sonde_mesh_clear(&labels->femur);
  sonde_mesh_clear(&labels->muscle);
  sonde_mesh_clear(&labels->vein);
  sonde_mesh_clear(&labels->artery);
  *labels = (sonde_leg_labels){0};
}
