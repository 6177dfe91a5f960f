// Reader of STL files, ascii and binary. Vertices with exactly equal coordinates become one;
// triangles that lose a corner by that are dropped.
#include "geometry/internal.h"

#include "base/bytes.h"

#include <string.h>

enum { HEAD_BYTES = 84, TRIANGLE_BYTES = 50 };

typedef struct stl {
  sonde_text text;
  sonde_mesh_builder *builder;
  uint32_t *table;   // vertex index + 1, 0 when free
  size_t table_size; // power of two
  sonde_error *error;
} stl;

// Each corner gets the index of a known vertex by a hash table with open addressing, or a new one.
// The table never fills up: it has at least twice as many places as the file can hold corners.
static sonde_status add_triangle(stl *file, const sonde_vec3 corners[3]) {
  sonde_mesh *mesh = &file->builder->mesh;
  uint32_t v[3];
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 point = v_add(corners[k], vec3(0, 0, 0)); // -0 becomes 0
    sonde_vec3 scaled = v_scale(point, file->builder->scale);
    uint64_t hash = sonde_hash(0, &point, sizeof point);
    hash ^= hash >> 32; // the low bits alone hardly depend on the high bits of the coordinates
    hash ^= hash >> 15;
    size_t slot = (size_t)hash & (file->table_size - 1);
    for (; file->table[slot]; slot = (slot + 1) & (file->table_size - 1)) {
      sonde_vec3 known = mesh->vertices[file->table[slot] - 1];
      if (known.x == scaled.x && known.y == scaled.y && known.z == scaled.z) break;
    }
    if (!file->table[slot]) {
      SONDE_ASSERT(2 * (size_t)mesh->vertex_count < file->table_size);
      if (!sonde_builder_vertex(file->builder, point)) return sonde_fail_memory(file->error);
      file->table[slot] = mesh->vertex_count;
    }
    v[k] = file->table[slot] - 1;
  }
  if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) return SONDE_OK;
  return sonde_builder_face(file->builder, v[0], v[1], v[2]) ? SONDE_OK
                                                             : sonde_fail_memory(file->error);
}

// An 84-byte head, then 50 bytes per triangle: normal, three corners, attributes.
static sonde_status read_binary(stl *file, uint32_t triangles) {
  const sonde_text *text = &file->text;
  SONDE_ASSERT(text->at == text->begin);
  size_t count = (size_t)(text->end - text->begin);
  if (count != HEAD_BYTES + (size_t)triangles * TRIANGLE_BYTES)
    return sonde_fail(file->error, SONDE_FORMAT,
                      "%s: byte 80: expected a size of %zu bytes for the %u triangles declared, "
                      "found %zu bytes",
                      text->path, HEAD_BYTES + (size_t)triangles * TRIANGLE_BYTES, triangles,
                      count);
  for (uint32_t t = 0; t < triangles; ++t) {
    size_t offset = HEAD_BYTES + (size_t)t * TRIANGLE_BYTES + 12;
    bytes_reader reader = {(const unsigned char *)text->begin + offset};
    sonde_vec3 corners[3];
    for (size_t k = 0; k < 3; ++k) {
      corners[k].x = bytes_take_f32(&reader);
      corners[k].y = bytes_take_f32(&reader);
      corners[k].z = bytes_take_f32(&reader);
      if (!v_finite(corners[k]))
        return sonde_fail(file->error, SONDE_FORMAT,
                          "%s: byte %zu: expected finite coordinates in triangle %u", text->path,
                          offset + 12 * k, t);
    }
    sonde_status status = add_triangle(file, corners);
    if (status) return status;
  }
  return SONDE_OK;
}

// Reads the words of a line, e.g. "outer loop".
static sonde_status expect_words(stl *file, const char *words) {
  sonde_text *text = &file->text;
  sonde_text_skip_blank_lines(text);
  const char *start = text->at;
  for (const char *at = words; *at;) {
    char word[16];
    size_t length = strcspn(at, " ");
    sonde_text_word(text, word, sizeof word);
    if (strlen(word) != length || strncmp(word, at, length)) {
      text->at = start;
      return sonde_text_expected(text, file->error, "\"%s\"", words);
    }
    at += length + (at[length] == ' ');
  }
  return SONDE_OK;
}

static sonde_status read_numbers(stl *file, const char *words, sonde_vec3 *point) {
  sonde_status status = expect_words(file, words);
  double value[3];
  for (int k = 0; k < 3 && !status; ++k)
    if (!sonde_text_real(&file->text, &value[k]))
      status = sonde_text_expected(&file->text, file->error, "a finite number after \"%s\"", words);
  if (!status) *point = vec3(value[0], value[1], value[2]);
  return status;
}

// facet normal / outer loop / vertex x3 / endloop / endfacet, until endsolid.
static sonde_status read_ascii(stl *file) {
  sonde_text *text = &file->text;
  sonde_status status = expect_words(file, "solid");
  sonde_text_next_line(text); // the rest of the line is a name
  while (!status) {
    if (!sonde_text_skip_blank_lines(text))
      return sonde_text_expected(text, file->error, "\"facet\" or \"endsolid\"");
    if (text->end - text->at >= 8 && !strncmp(text->at, "endsolid", 8)) break;
    sonde_vec3 normal, corners[3];
    status = read_numbers(file, "facet normal", &normal);
    if (!status) status = expect_words(file, "outer loop");
    for (int k = 0; k < 3 && !status; ++k) status = read_numbers(file, "vertex", &corners[k]);
    if (!status) status = expect_words(file, "endloop");
    if (!status) status = expect_words(file, "endfacet");
    if (!status) status = add_triangle(file, corners);
  }
  return status;
}

sonde_status sonde_stl_read(const char *path, const char *bytes, size_t count,
                            sonde_mesh_builder *builder, sonde_error *error) {
  SONDE_ASSERT(bytes != NULL && builder != NULL);
  stl file = {.text = {path, bytes, bytes, bytes + count, 1}, .builder = builder, .error = error};
  bytes_reader declared = {(const unsigned char *)bytes + HEAD_BYTES - 4};
  uint32_t triangles = count < HEAD_BYTES ? 0 : bytes_take_u32(&declared);
  bool fits = count == HEAD_BYTES + (size_t)triangles * TRIANGLE_BYTES;
  bool ascii = !fits && count >= 5 && !strncmp(bytes, "solid", 5);
  // A corner takes at least 12 bytes: "vertex 0 0 0".
  for (file.table_size = 64; file.table_size < count / 6;) file.table_size *= 2;
  file.table = SONDE_NEW(uint32_t, file.table_size);
  if (!file.table) return sonde_fail_memory(error);
  sonde_status status = ascii ? read_ascii(&file) : read_binary(&file, triangles);
  sonde_free(file.table);
  return status;
}
