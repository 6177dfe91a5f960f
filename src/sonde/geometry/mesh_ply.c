// Reader of PLY files: ascii, binary little and big endian, any elements and properties.
#include "geometry/internal.h"

#include "base/bytes.h"

#include <string.h>

enum { MAX_ELEMENTS = 16, MAX_PROPERTIES = 64 };
typedef enum format { ASCII, LITTLE, BIG } format;
typedef enum scalar { NO_SCALAR, INT8, UINT8, INT16, UINT16, INT32, UINT32, REAL32, REAL64 } scalar;
typedef enum role { DROPPED, X, Y, Z, INDICES } role;

typedef struct property {
  char name[32];
  scalar type, count_type; // count_type is NO_SCALAR unless this is a list
  role role;
} property;

typedef struct element {
  char name[32];
  uint32_t count, property_count;
  property properties[MAX_PROPERTIES];
} element;

typedef struct ply {
  sonde_text text;
  format format;
  uint32_t element_count, vertex_count;
  element elements[MAX_ELEMENTS];
  sonde_mesh_builder *builder;
  sonde_error *error;
} ply;

static const char *const scalar_names[][2] = {
    [INT8] = {"char", "int8"},       [UINT8] = {"uchar", "uint8"},    [INT16] = {"short", "int16"},
    [UINT16] = {"ushort", "uint16"}, [INT32] = {"int", "int32"},      [UINT32] = {"uint", "uint32"},
    [REAL32] = {"float", "float32"}, [REAL64] = {"double", "float64"}};
static const uint8_t scalar_bytes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};

// ---- header -------------------------------------------------------------------------------

static sonde_status parse_type(ply *file, scalar *type) {
  char word[32];
  sonde_text_more(&file->text);
  const char *start = file->text.at;
  sonde_text_word(&file->text, word, sizeof word);
  for (int k = INT8; k <= REAL64; ++k)
    if (!strcmp(word, scalar_names[k][0]) || !strcmp(word, scalar_names[k][1])) {
      *type = (scalar)k;
      return SONDE_OK;
    }
  file->text.at = start;
  return sonde_text_expected(&file->text, file->error, "a type such as float or uchar");
}

static sonde_status parse_property(ply *file) {
  sonde_text *text = &file->text;
  if (!file->element_count)
    return sonde_text_expected(text, file->error, "an element before its properties");
  element *owner = &file->elements[file->element_count - 1];
  if (owner->property_count == MAX_PROPERTIES)
    return sonde_text_expected(text, file->error, "at most %d properties", MAX_PROPERTIES);
  property *item = &owner->properties[owner->property_count++];
  sonde_text_more(text);
  const char *start = text->at;
  char word[32];
  sonde_text_word(text, word, sizeof word);
  bool list = !strcmp(word, "list");
  if (!list) text->at = start;
  sonde_status status = list ? parse_type(file, &item->count_type) : SONDE_OK;
  if (!status) status = parse_type(file, &item->type);
  if (status) return status;
  if (!sonde_text_more(text)) return sonde_text_expected(text, file->error, "a property name");
  sonde_text_word(text, item->name, sizeof item->name);

  // what a mesh needs of the property
  const char *name = item->name;
  bool coordinate = name[0] >= 'x' && name[0] <= 'z' && !name[1];
  bool indices = !strcmp(name, "vertex_indices") || !strcmp(name, "vertex_index");
  if (!strcmp(owner->name, "vertex") && !list && coordinate) item->role = (role)(X + name[0] - 'x');
  if (!strcmp(owner->name, "face") && list && indices) item->role = INDICES;
  return SONDE_OK;
}

// Properties with a role from one to the other.
static uint32_t count_roles(const element *item, role from, role to) {
  uint32_t count = 0;
  for (uint32_t p = 0; p < item->property_count; ++p)
    if (item->properties[p].role >= from && item->properties[p].role <= to) ++count;
  return count;
}

static sonde_status read_header(ply *file) {
  static const char *const formats[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  sonde_text *text = &file->text;
  char word[32];
  sonde_text_word(text, word, sizeof word);
  if (strcmp(word, "ply"))
    return sonde_fail(file->error, SONDE_FORMAT, "%s:1: expected \"ply\" in the first line",
                      text->path);
  for (bool done = false; !done;) {
    if (!sonde_text_next_line(text)) return sonde_text_expected(text, file->error, "end_header");
    if (!sonde_text_more(text)) continue;
    const char *start = text->at;
    sonde_text_word(text, word, sizeof word);
    sonde_status status = SONDE_OK;
    if (!strcmp(word, "end_header")) {
      done = true;
    } else if (!strcmp(word, "format")) {
      sonde_text_more(text);
      start = text->at;
      sonde_text_word(text, word, sizeof word);
      int k = 0;
      while (k < 3 && strcmp(word, formats[k])) ++k;
      if (k == 3) {
        text->at = start;
        return sonde_text_expected(text, file->error,
                                   "format ascii, binary_little_endian or binary_big_endian");
      }
      file->format = (format)k;
    } else if (!strcmp(word, "element")) {
      if (file->element_count == MAX_ELEMENTS)
        return sonde_text_expected(text, file->error, "at most %d elements", MAX_ELEMENTS);
      element *item = &file->elements[file->element_count++];
      sonde_text_word(text, item->name, sizeof item->name);
      double count = 0;
      if (!sonde_text_real(text, &count) || count < 0 || count > 4e9 || count != floor(count))
        return sonde_text_expected(text, file->error, "the count of element %s", item->name);
      item->count = (uint32_t)count;
    } else if (!strcmp(word, "property")) {
      status = parse_property(file);
    } else if (strcmp(word, "comment") && strcmp(word, "obj_info")) {
      text->at = start;
      status = sonde_text_expected(text, file->error,
                                   "comment, format, element, property or end_header");
    }
    if (status) return status;
  }

  uint32_t vertices = 0, faces = 0;
  for (uint32_t e = 0; e < file->element_count; ++e) {
    const element *item = &file->elements[e];
    if (!strcmp(item->name, "vertex")) {
      file->vertex_count = item->count;
      if (count_roles(item, X, Z) == 3) vertices++;
    }
    if (!strcmp(item->name, "face") && item->count && count_roles(item, INDICES, INDICES) == 1)
      faces++;
  }
  if (vertices != 1 || faces != 1)
    return sonde_fail(file->error, SONDE_FORMAT,
                      "%s:%u: expected one element vertex with properties x, y, z and one element "
                      "face with a list vertex_indices, found no such header",
                      text->path, text->line);
  sonde_text_next_line(text);
  return SONDE_OK;
}

// ---- rows ---------------------------------------------------------------------------------

// Where reading stands: "path:line" or "path: byte offset".
static const char *place(const ply *file, char *buffer, size_t size) {
  const sonde_text *text = &file->text;
  if (file->format == ASCII)
    snprintf(buffer, size, "%s:%u", text->path, text->line);
  else
    snprintf(buffer, size, "%s: byte %zu", text->path, (size_t)(text->at - text->begin));
  return buffer;
}

// False at the end of the file and for a number that is not finite.
static bool read_binary(ply *file, scalar type, double *value) {
  SONDE_ASSERT(type != NO_SCALAR);
  sonde_text *text = &file->text;
  int size = scalar_bytes[type];
  if (text->end - text->at < size) return false;
  bytes_reader reader = {(const unsigned char *)text->at};
  uint64_t bits = bytes_take(&reader, size);
  if (file->format == BIG) bits = __builtin_bswap64(bits) >> (64 - 8 * size);
  float real32;
  uint32_t low = (uint32_t)bits;
  switch (type) {
  case INT8: *value = (int8_t)bits; break;
  case INT16: *value = (int16_t)bits; break;
  case INT32: *value = (int32_t)low; break;
  case REAL32: memcpy(&real32, &low, sizeof real32), *value = (double)real32; break;
  case REAL64: memcpy(value, &bits, sizeof bits); break;
  default: *value = (double)bits;
  }
  if (!isfinite(*value)) return false;
  text->at += size;
  return true;
}

// One value of any type from text or bytes.
static sonde_status read_scalar(ply *file, const element *owner, const property *item, scalar type,
                                uint32_t row, double *value) {
  if (file->format == ASCII ? sonde_text_real(&file->text, value) : read_binary(file, type, value))
    return SONDE_OK;
  if (file->format == ASCII)
    return sonde_text_expected(&file->text, file->error, "a finite number for %s of %s %u of %u",
                               item->name, owner->name, row, owner->count);
  char at[256];
  bool short_file = (size_t)(file->text.end - file->text.at) < scalar_bytes[type];
  return sonde_fail(file->error, SONDE_FORMAT,
                    "%s: expected a finite number for %s of %s %u of %u, found %s",
                    place(file, at, sizeof at), item->name, owner->name, row, owner->count,
                    short_file ? "the end of the file" : "a number that is not finite");
}

// One row of an element: the point of a vertex, or the polygon of a face, split into a fan of
// triangles; other properties are read and dropped.
static sonde_status read_row(ply *file, const element *owner, uint32_t row) {
  double point[3] = {0, 0, 0}, value = 0;
  for (uint32_t p = 0; p < owner->property_count; ++p) {
    const property *item = &owner->properties[p];
    bool list = item->count_type != NO_SCALAR, polygon = item->role == INDICES;
    uint32_t length = 1, first = 0, previous = 0;
    sonde_status status = SONDE_OK;
    if (list) { // number of its entries
      double entries = 0, least = polygon ? 3 : 0;
      status = read_scalar(file, owner, item, item->count_type, row, &entries);
      if (status) return status;
      if (!(entries >= least && entries < 4e9 && entries == floor(entries))) {
        char at[256];
        return sonde_fail(file->error, SONDE_FORMAT,
                          "%s: expected at least %g entries in list %s of %s %u, found %.17g",
                          place(file, at, sizeof at), least, item->name, owner->name, row, entries);
      }
      length = (uint32_t)entries;
    }
    for (uint32_t k = 0; k < length && !status; ++k) {
      status = read_scalar(file, owner, item, item->type, row, &value);
      if (status || !polygon) continue;
      if (!(value >= 0 && value < file->vertex_count && value == floor(value))) {
        char at[256];
        return sonde_fail(file->error, SONDE_FORMAT,
                          "%s: expected a vertex index from 0 to %u in face %u, found %.17g",
                          place(file, at, sizeof at), file->vertex_count - 1, row, value);
      }
      uint32_t index = (uint32_t)value;
      if (k == 0) first = index;
      if (k >= 2 && !sonde_builder_face(file->builder, first, previous, index))
        return sonde_fail_memory(file->error);
      previous = index;
    }
    if (status) return status;
    if (item->role >= X && item->role <= Z) point[item->role - X] = value;
  }
  if (strcmp(owner->name, "vertex")) return SONDE_OK;
  return sonde_builder_vertex(file->builder, vec3(point[0], point[1], point[2]))
             ? SONDE_OK
             : sonde_fail_memory(file->error);
}

sonde_status sonde_ply_read(const char *path, const char *bytes, size_t count,
                            sonde_mesh_builder *builder, sonde_error *error) {
  ply *file = SONDE_NEW(ply, 1);
  if (!file) return sonde_fail_memory(error);
  SONDE_ASSERT(bytes != NULL && builder != NULL);
  file->text = (sonde_text){path, bytes, bytes, bytes + count, 1};
  file->builder = builder;
  file->error = error;
  sonde_status status = read_header(file);
  SONDE_ASSERT(file->element_count <= MAX_ELEMENTS);
  sonde_text *text = &file->text;
  bool lines = file->format == ASCII;
  for (uint32_t e = 0; e < file->element_count; ++e) {
    const element *item = &file->elements[e];
    uint32_t rows = item->property_count ? item->count : 0;
    for (uint32_t row = 0; row < rows && !status; ++row) {
      if (lines && !sonde_text_skip_blank_lines(text))
        status = sonde_text_expected(text, error, "%s %u of %u", item->name, row, item->count);
      if (!status) status = read_row(file, item, row);
      if (!status && lines && sonde_text_more(text))
        status = sonde_text_expected(text, error, "the end of the line of %s %u", item->name, row);
      if (!status && lines) sonde_text_next_line(text);
    }
  }
  char at[256];
  if (!status && sonde_text_skip_blank_lines(text))
    status = sonde_fail(error, SONDE_FORMAT,
                        "%s: expected the end of the file after the last element, found %zu more "
                        "bytes",
                        place(file, at, sizeof at), (size_t)(text->end - text->at));
  sonde_free(file);
  return status;
}
