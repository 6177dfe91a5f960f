// Inside of the tracked sequences: headers of image files, their pixels, affine maps.
#ifndef SONDE_SRC_SWEEP_FRAMES_H
#define SONDE_SRC_SWEEP_FRAMES_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/sweep_volume.h"

enum {
  SONDE_SIDE_MAX = 16384,     // pixels or voxels along an axis
  SONDE_FRAMES_MAX = 1000000, // frames of a sequence
  SONDE_FIELDS_MAX = 256,     // texts per frame
  SONDE_VALUE_MAX = 1 << 20,  // bytes of one text
};

typedef struct sonde_header_entry {
  char *key, *value;
  uint32_t line;
} sonde_header_entry;

typedef enum sonde_packing {
  SONDE_PACKING_RAW,
  SONDE_PACKING_ZLIB,
  SONDE_PACKING_GZIP
} sonde_packing;

// Header of an image file, cut into entries in place, and where its pixels begin.
typedef struct sonde_header {
  const char *path;
  char *bytes;
  size_t count, data; // of the file; first byte of the pixels
  uint32_t lines;     // of the header
  bool nrrd;
  sonde_header_entry *entries;
  uint32_t entry_count, entry_room;
  sonde_packing packing;
  size_t packed; // bytes of the pixels in the file
  uint32_t dimension, size[4];
  int list_axis; // axis of the frames, -1 when not told
  sonde_affine mm_from_voxel;
} sonde_header;

// Value of a field or NULL; borrowed.
const char *sonde_sequence_get(const sonde_sequence *sequence, uint32_t frame, const char *key);

sonde_status sonde_header_load(const char *path, sonde_header *header, sonde_error *error);
void sonde_header_clear(sonde_header *header);
sonde_status sonde_metaimage_parse(sonde_header *header, sonde_error *error);
sonde_status sonde_nrrd_parse(sonde_header *header, sonde_error *error);
// True for keys that describe the pixels and are written anew.
bool sonde_metaimage_owns(const char *key);
bool sonde_nrrd_owns(const char *key);

// Next line of the header as a string without its end; NULL at the end of the file.
sonde_status sonde_header_line(sonde_header *header, char **line, sonde_error *error);
sonde_status sonde_header_add(sonde_header *header, char *key, char *value, sonde_error *error);
const sonde_header_entry *sonde_header_find(const sonde_header *header, const char *key);
sonde_status sonde_header_only(const sonde_header *header, const char *key, bool required,
                               const char *const *words, sonde_error *error);
// An entry that must be there, be one of some words (none: anything), or both.
typedef struct sonde_header_rule {
  const char *key;
  bool required;
  const char *words[6];
} sonde_header_rule;
sonde_status sonde_header_rules(const sonde_header *header, const sonde_header_rule *rules,
                                size_t count, sonde_error *error);
// @param names "|one|another|"
bool sonde_header_among(const char *key, const char *names);
sonde_status sonde_header_whole(const sonde_header *header, const sonde_header_entry *entry,
                                uint32_t count, uint32_t low, uint32_t high, uint32_t *values,
                                sonde_error *error);
sonde_status sonde_header_reals(const sonde_header *header, const char *key, uint32_t count,
                                double *values, sonde_error *error);
// Exactly count finite numbers and nothing else.
bool sonde_text_reals(const char *text, uint32_t count, double *values);
// A transform of 16 numbers whose last row is 0 0 0 1.
bool sonde_text_affine(const char *text, sonde_affine *affine);
char *sonde_text_trim(char *text);
bool sonde_text_ends(const char *text, const char *end);

// The pixels, unpacked; exactly `expected` bytes.
sonde_status sonde_pixels_read(const sonde_header *header, size_t expected, uint8_t **pixels,
                               sonde_error *error);
// Writes a sequence or a volume, the other one NULL; the name's end tells the format.
sonde_status sonde_pixels_save(const char *path, const sonde_sequence *sequence,
                               const sonde_volume *volume, const uint8_t *pixels, size_t count,
                               bool compressed, sonde_error *error);

// Headers of a sequence, up to the first byte of the pixels.
void sonde_metaimage_write_sequence(sonde_file *file, const sonde_sequence *sequence,
                                    size_t packed);
void sonde_nrrd_write_sequence(sonde_file *file, const sonde_sequence *sequence, bool packed,
                               bool four_axes);
void sonde_metaimage_write_volume(sonde_file *file, const sonde_volume *volume, size_t packed);
void sonde_nrrd_write_volume(sonde_file *file, const sonde_volume *volume, bool packed);

static inline sonde_affine affine_identity(void) {
  return (sonde_affine){{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
}
static inline sonde_vec3 affine_column(const sonde_affine *a, int k) {
  return vec3(a->m[0][k], a->m[1][k], a->m[2][k]);
}
static inline sonde_affine affine_columns(sonde_vec3 x, sonde_vec3 y, sonde_vec3 z, sonde_vec3 t) {
  return (sonde_affine){{{x.x, y.x, z.x, t.x}, {x.y, y.y, z.y, t.y}, {x.z, y.z, z.z, t.z}}};
}
static inline sonde_affine affine_mul(const sonde_affine *a, const sonde_affine *b) {
  sonde_affine c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j)
      c.m[i][j] = a->m[i][0] * b->m[0][j] + a->m[i][1] * b->m[1][j] + a->m[i][2] * b->m[2][j] +
                  (j == 3 ? a->m[i][3] : 0);
  return c;
}
static inline sonde_vec3 affine_apply(const sonde_affine *a, sonde_vec3 p) {
  const double(*m)[4] = a->m;
  return vec3(m[0][0] * p.x + m[0][1] * p.y + m[0][2] * p.z + m[0][3],
              m[1][0] * p.x + m[1][1] * p.y + m[1][2] * p.z + m[1][3],
              m[2][0] * p.x + m[2][1] * p.y + m[2][2] * p.z + m[2][3]);
}
static inline sonde_affine affine_scale(sonde_affine a, double s) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) a.m[i][j] *= s;
  return a;
}
// False when the columns are so nearly dependent that there is no inverse.
static inline bool affine_inverse(const sonde_affine *a, sonde_affine *inverse) {
  sonde_vec3 x = affine_column(a, 0), y = affine_column(a, 1), z = affine_column(a, 2);
  sonde_vec3 t = affine_column(a, 3), yz = v_cross(y, z);
  double volume = v_dot(x, yz), scale = v_norm(x) * v_norm(y) * v_norm(z);
  if (!(fabs(volume) > 1e-9 * scale) || !isfinite(scale)) return false;
  const sonde_vec3 rows[3] = {v_scale(yz, 1 / volume), v_scale(v_cross(z, x), 1 / volume),
                              v_scale(v_cross(x, y), 1 / volume)};
  for (int k = 0; k < 3; ++k) {
    inverse->m[k][0] = rows[k].x, inverse->m[k][1] = rows[k].y, inverse->m[k][2] = rows[k].z;
    inverse->m[k][3] = -v_dot(rows[k], t);
  }
  return true;
}

#endif
