// Reader of PLY files: ascii, binary little and big endian, any elements and properties.
//
//   read_header       elements and properties as declared, checked for what a mesh needs
//   read_scalar       one value of any type from text or bytes
//   read_vertex       x, y, z of a vertex; other properties are read and dropped
//   read_polygon      vertex indices of a face, split into a fan of triangles
//   read_element      all rows of an element
#include "geometry/internal.h"

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

static scalar parse_scalar(const char *word) {
  for (int type = INT8; type <= REAL64; ++type)
    if (!strcmp(word, scalar_names[type][0]) || !strcmp(word, scalar_names[type][1]))
      return (scalar)type;
  return NO_SCALAR;
}

static role parse_role(const element *owner, const property *item) {
  SONDE_ASSERT(item->type != NO_SCALAR);
  bool list = item->count_type != NO_SCALAR;
  if (!strcmp(owner->name, "vertex") && !list && item->name[0] && !item->name[1]) {
    if (item->name[0] == 'x') return X;
    if (item->name[0] == 'y') return Y;
    if (item->name[0] == 'z') return Z;
  }
  if (!strcmp(owner->name, "face") && list &&
      (!strcmp(item->name, "vertex_indices") || !strcmp(item->name, "vertex_index")))
    return INDICES;
  return DROPPED;
}

static sonde_status parse_format(ply *file) {
  static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  char word[32];
  sonde_text_more(&file->text);
  const char *start = file->text.at;
  sonde_text_word(&file->text, word, sizeof word);
  for (int k = 0; k < 3; ++k)
    if (!strcmp(word, names[k])) {
      file->format = (format)k;
      return SONDE_OK;
    }
  file->text.at = start;
  return sonde_text_expected(&file->text, file->error,
                             "format ascii, binary_little_endian or binary_big_endian");
}

static sonde_status parse_element(ply *file) {
  sonde_text *text = &file->text;
  if (file->element_count == MAX_ELEMENTS)
    return sonde_text_expected(text, file->error, "at most %d elements", MAX_ELEMENTS);
  element *item = &file->elements[file->element_count++];
  sonde_text_word(text, item->name, sizeof item->name);
  double count = 0;
  if (!sonde_text_real(text, &count) || count < 0 || count > 4e9 || count != floor(count))
    return sonde_text_expected(text, file->error, "the count of element %s", item->name);
  item->count = (uint32_t)count;
  return SONDE_OK;
}

static sonde_status parse_type(ply *file, scalar *type) {
  char word[32];
  sonde_text_more(&file->text);
  const char *start = file->text.at;
  sonde_text_word(&file->text, word, sizeof word);
  *type = parse_scalar(word);
  if (*type != NO_SCALAR) return SONDE_OK;
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
  item->role = parse_role(owner, item);
  return SONDE_OK;
}

// One header line; sets *done at end_header.
static sonde_status parse_line(ply *file, bool *done) {
  char word[32];
  const char *start = file->text.at;
  sonde_text_word(&file->text, word, sizeof word);
  if (!strcmp(word, "comment") || !strcmp(word, "obj_info")) return SONDE_OK;
  if (!strcmp(word, "format")) return parse_format(file);
  if (!strcmp(word, "element")) return parse_element(file);
  if (!strcmp(word, "property")) return parse_property(file);
  *done = !strcmp(word, "end_header");
  if (*done) return SONDE_OK;
  file->text.at = start;
  return sonde_text_expected(&file->text, file->error,
                             "comment, format, element, property or end_header");
}

static uint32_t count_roles(const element *item, role from, role to) {
  uint32_t count = 0;
  for (uint32_t p = 0; p < item->property_count; ++p)
    if (item->properties[p].role >= from && item->properties[p].role <= to) ++count;
  return count;
}

static sonde_status check_header(ply *file) {
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
  if (vertices == 1 && faces == 1) return SONDE_OK;
  return sonde_fail(file->error, SONDE_FORMAT,
                    "%s:%u: expected one element vertex with properties x, y, z and one element "
                    "face with a list vertex_indices, found no such header",
                    file->text.path, file->text.line);
}

static sonde_status read_header(ply *file) {
  sonde_text *text = &file->text;
  char word[8];
  sonde_text_word(text, word, sizeof word);
  if (strcmp(word, "ply"))
    return sonde_fail(file->error, SONDE_FORMAT, "%s:1: expected \"ply\" in the first line",
                      text->path);
  bool done = false;
  while (!done) {
    if (!sonde_text_next_line(text)) return sonde_text_expected(text, file->error, "end_header");
    if (!sonde_text_more(text)) continue;
    sonde_status status = parse_line(file, &done);
    if (status) return status;
  }
  sonde_status status = check_header(file);
  sonde_text_next_line(text);
  return status;
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

static double decode(scalar type, uint64_t bits) {
  SONDE_ASSERT(type != NO_SCALAR);
  float real32;
  double real64;
  uint32_t low = (uint32_t)bits;
  switch (type) {
  case INT8: return (int8_t)bits;
  case INT16: return (int16_t)bits;
  case INT32: return (int32_t)low;
  case REAL32: memcpy(&real32, &low, sizeof real32); return (double)real32;
  case REAL64: memcpy(&real64, &bits, sizeof real64); return real64;
  default: return (double)bits;
  }
}

static bool read_binary(ply *file, scalar type, double *value) {
  sonde_text *text = &file->text;
  size_t size = scalar_bytes[type];
  if ((size_t)(text->end - text->at) < size) return false;
  uint64_t bits = 0;
  for (size_t k = 0; k < size; ++k) {
    size_t shift = 8 * (file->format == LITTLE ? k : size - 1 - k);
    bits |= (uint64_t)(unsigned char)text->at[k] << shift;
  }
  *value = decode(type, bits);
  if (!isfinite(*value)) return false;
  text->at += size;
  return true;
}

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

static sonde_status read_index(ply *file, const element *owner, const property *item, uint32_t row,
                               uint32_t *index) {
  double value = 0;
  sonde_status status = read_scalar(file, owner, item, item->type, row, &value);
  if (status) return status;
  if (value >= 0 && value < file->vertex_count && value == floor(value)) {
    *index = (uint32_t)value;
    return SONDE_OK;
  }
  char at[256];
  return sonde_fail(file->error, SONDE_FORMAT,
                    "%s: expected a vertex index from 0 to %u in face %u, found %.17g",
                    place(file, at, sizeof at), file->vertex_count - 1, row, value);
}

// Number of entries of a list.
static sonde_status read_length(ply *file, const element *owner, const property *item, uint32_t row,
                                double least, uint32_t *length) {
  double value = 0;
  sonde_status status = read_scalar(file, owner, item, item->count_type, row, &value);
  if (status) return status;
  if (value >= least && value < 4e9 && value == floor(value)) {
    *length = (uint32_t)value;
    return SONDE_OK;
  }
  char at[256];
  return sonde_fail(file->error, SONDE_FORMAT,
                    "%s: expected at least %g entries in list %s of %s %u, found %.17g",
                    place(file, at, sizeof at), least, item->name, owner->name, row, value);
}

static sonde_status read_polygon(ply *file, const element *owner, const property *item,
                                 uint32_t row) {
  uint32_t length = 0, first = 0, previous = 0, index = 0;
  SONDE_ASSERT(item->role == INDICES && item->count_type != NO_SCALAR);
  sonde_status status = read_length(file, owner, item, row, 3, &length);
  for (uint32_t k = 0; k < length && !status; ++k) {
    status = read_index(file, owner, item, row, &index);
    if (k == 0) first = index;
    if (!status && k >= 2 && !sonde_builder_face(file->builder, first, previous, index))
      status = sonde_fail_memory(file->error);
    previous = index;
  }
  return status;
}

static sonde_status skip_list(ply *file, const element *owner, const property *item, uint32_t row) {
  uint32_t length = 0;
  double value;
  sonde_status status = read_length(file, owner, item, row, 0, &length);
  for (uint32_t k = 0; k < length && !status; ++k)
    status = read_scalar(file, owner, item, item->type, row, &value);
  return status;
}

static sonde_status read_row(ply *file, const element *owner, uint32_t row) {
  double point[3] = {0, 0, 0};
  sonde_status status = SONDE_OK;
  for (uint32_t p = 0; p < owner->property_count && !status; ++p) {
    const property *item = &owner->properties[p];
    double value = 0;
    if (item->role == INDICES)
      status = read_polygon(file, owner, item, row);
    else if (item->count_type != NO_SCALAR)
      status = skip_list(file, owner, item, row);
    else
      status = read_scalar(file, owner, item, item->type, row, &value);
    if (item->role >= X && item->role <= Z) point[item->role - X] = value;
  }
  if (status || strcmp(owner->name, "vertex")) return status;
  return sonde_builder_vertex(file->builder, vec3(point[0], point[1], point[2]))
             ? SONDE_OK
             : sonde_fail_memory(file->error);
}

static sonde_status read_element(ply *file, const element *owner) {
  sonde_text *text = &file->text;
  SONDE_ASSERT(owner->property_count <= MAX_PROPERTIES);
  if (!owner->property_count) return SONDE_OK;
  for (uint32_t row = 0; row < owner->count; ++row) {
    if (file->format == ASCII && !sonde_text_skip_blank_lines(text))
      return sonde_text_expected(text, file->error, "%s %u of %u", owner->name, row, owner->count);
    sonde_status status = read_row(file, owner, row);
    if (status) return status;
    if (file->format == ASCII && sonde_text_more(text))
      return sonde_text_expected(text, file->error, "the end of the line of %s %u", owner->name,
                                 row);
    if (file->format == ASCII) sonde_text_next_line(text);
  }
  return SONDE_OK;
}

sonde_status sonde_ply_read(const char *path, const char *bytes, size_t count,
                            sonde_mesh_builder *builder, sonde_error *error) {
  ply *file = SONDE_NEW(ply, 1);
  if (!file) return sonde_fail_memory(error);
  file->text = (sonde_text){path, bytes, bytes, bytes + count, 1};
  file->builder = builder;
  file->error = error;
  sonde_status status = read_header(file);
  SONDE_ASSERT(file->element_count <= MAX_ELEMENTS);
  for (uint32_t e = 0; e < file->element_count && !status; ++e)
    status = read_element(file, &file->elements[e]);
  char at[256];
  if (!status && sonde_text_skip_blank_lines(&file->text))
    status = sonde_fail(error, SONDE_FORMAT,
                        "%s: expected the end of the file after the last element, found %zu more "
                        "bytes",
                        place(file, at, sizeof at), (size_t)(file->text.end - file->text.at));
  sonde_free(file);
  return status;
}
