// Reader of Wavefront OBJ files: v and f lines; f takes v, v/vt, v//vn, v/vt/vn and negative
// indices. Everything else (texture, normals, groups, materials, lines) is passed over.
#include "geometry/internal.h"

#include <string.h>

typedef struct obj {
  sonde_text text;
  uint32_t vertex_count; // in the whole file
  sonde_mesh_builder *builder;
  sonde_error *error;
} obj;

// Whether the line begins with this keyword; moves behind it.
static bool keyword(sonde_text *text, char letter) {
  if (!sonde_text_more(text)) return false;
  const char *at = text->at;
  if (at[0] != letter || at + 1 >= text->end || (at[1] != ' ' && at[1] != '\t')) return false;
  text->at += 2;
  return true;
}

// Reads a decimal integer with optional sign; false when there is none.
static bool read_integer(const char **at, const char *end, int64_t *value) {
  bool negative = *at < end && **at == '-';
  const char *digit = *at + (negative ? 1 : 0), *first = digit;
  for (*value = 0; digit < end && *digit >= '0' && *digit <= '9'; ++digit)
    if (*value < INT64_C(1) << 40) *value = *value * 10 + (*digit - '0');
  if (negative) *value = -*value;
  *at = digit;
  return digit > first;
}

static bool at_token_end(const char *at, const char *end) {
  return at >= end || *at == ' ' || *at == '\t' || *at == '\r' || *at == '\n';
}

// Corners of a polygon, split into a fan of triangles. Texture and normal of a corner are passed.
static sonde_status read_face(obj *file) {
  sonde_text *text = &file->text;
  uint32_t first = 0, previous = 0, corners = 0;
  for (; sonde_text_more(text); ++corners) {
    const char *at = text->at, *end = text->end;
    int64_t value = 0, ignored, known = file->builder->mesh.vertex_count;
    bool good = read_integer(&at, end, &value);
    if (good && !at_token_end(at, end)) {
      good = *at++ == '/';
      bool texture = good && read_integer(&at, end, &ignored);
      if (good && at_token_end(at, end))
        good = texture;
      else
        good = good && *at++ == '/' && read_integer(&at, end, &ignored) && at_token_end(at, end);
    }
    if (!good)
      return sonde_text_expected(text, file->error, "a face corner such as 3, 3/1, 3//2 or 3/1/2");
    int64_t position = value < 0 ? known + value : value - 1;
    if (position < 0 || position >= file->vertex_count)
      return sonde_text_expected(text, file->error, "a vertex index from 1 to %u",
                                 file->vertex_count);
    text->at = at;
    uint32_t index = (uint32_t)position;
    if (corners == 0) first = index;
    if (corners >= 2 && !sonde_builder_face(file->builder, first, previous, index))
      return sonde_fail_memory(file->error);
    previous = index;
  }
  return corners >= 3 ? SONDE_OK
                      : sonde_text_expected(text, file->error, "at least 3 corners in face %u",
                                            file->builder->mesh.face_count + 1);
}

sonde_status sonde_obj_read(const char *path, const char *bytes, size_t count,
                            sonde_mesh_builder *builder, sonde_error *error) {
  SONDE_ASSERT(builder->mesh.vertex_count == 0);
  obj file = {{path, bytes, bytes, bytes + count, 1}, 0, builder, error};
  // Faces may come before the vertices that they name: count them first.
  sonde_text all = file.text;
  do {
    if (keyword(&all, 'v') && file.vertex_count < UINT32_MAX / 4) ++file.vertex_count;
  } while (sonde_text_next_line(&all));
  sonde_status status = SONDE_OK;
  do {
    if (keyword(&file.text, 'v')) {
      double p[3], extra; // position; weight or colours
      for (int k = 0; k < 3; ++k)
        if (!sonde_text_real(&file.text, &p[k]))
          return sonde_text_expected(&file.text, error, "a finite number for %c of vertex %u",
                                     "xyz"[k], builder -> mesh.vertex_count + 1);
      while (sonde_text_more(&file.text))
        if (!sonde_text_real(&file.text, &extra))
          return sonde_text_expected(&file.text, error, "a number");
      if (!sonde_builder_vertex(builder, vec3(p[0], p[1], p[2]))) return sonde_fail_memory(error);
    } else if (keyword(&file.text, 'f'))
      status = read_face(&file);
  } while (!status && sonde_text_next_line(&file.text));
  return status;
}
