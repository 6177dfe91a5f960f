// Tokens of a text file, line by line, and the mesh that a reader fills.
#include "geometry/internal.h"

#include "base/bounds.h"

#include <string.h>

static bool blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

// Length of the token at the present place; 0 at the end of the line.
static size_t token_length(const sonde_text *text) {
  const char *at = text->at;
  while (at < text->end && *at != '\n' && !blank(*at)) ++at;
  return (size_t)(at - text->at);
}

bool sonde_text_more(sonde_text *text) {
  SONDE_ASSERT(text->at <= text->end);
  while (text->at < text->end && blank(*text->at)) ++text->at;
  return text->at < text->end && *text->at != '\n';
}

bool sonde_text_next_line(sonde_text *text) {
  SONDE_ASSERT(text->at <= text->end);
  const char *feed = memchr(text->at, '\n', (size_t)(text->end - text->at));
  text->at = feed ? feed + 1 : text->end;
  if (feed) text->line++;
  return text->at < text->end;
}

bool sonde_text_skip_blank_lines(sonde_text *text) {
  while (!sonde_text_more(text))
    if (!sonde_text_next_line(text)) return false;
  return true;
}

void sonde_text_word(sonde_text *text, char *word, size_t size) {
  SONDE_ASSERT(size > 0);
  sonde_text_more(text);
  size_t length = token_length(text);
  size_t kept = length < size ? length : size - 1;
  memcpy(word, text->at, kept);
  word[kept] = 0;
  text->at += length;
}

bool sonde_text_real(sonde_text *text, double *value) {
  if (!sonde_text_more(text)) return false;
  const char *stop = NULL;
  *value = sonde_parse_real(text->at, &stop);
  if (stop != text->at + token_length(text) || !isfinite(*value)) return false;
  text->at = stop;
  return true;
}

sonde_status sonde_text_expected(sonde_text *text, sonde_error *error, const char *format, ...) {
  char what[160], found[40];
  SONDE_ASSERT(format != NULL);
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(what, sizeof what, format, arguments);
  va_end(arguments);
  // the token at the present place, quoted and printable
  size_t length = sonde_text_more(text) ? token_length(text) : 0;
  if (length)
    snprintf(found, sizeof found, "\"%.*s\"", length > 24 ? 24 : (int)length, text->at);
  else
    snprintf(found, sizeof found, "%s",
             text->at < text->end ? "the end of the line" : "the end of the file");
  for (char *c = found; *c; ++c)
    if (*c < 32 || *c > 126) *c = '?';
  return sonde_fail(error, SONDE_FORMAT, "%s:%u: expected %s, found %s", text->path, text->line,
                    what, found);
}

// Makes room for one more item of `size` bytes.
static bool grow(void **items, uint32_t count, uint32_t *room, size_t size) {
  SONDE_ASSERT(count <= *room && size > 0);
  if (count >= sonde_limits_mesh.most_items) return false;
  if (count < *room) return true;
  uint32_t wanted = *room ? 2 * *room : 1024;
  void *grown = sonde_realloc(*items, *room * size, wanted * size);
  if (!grown) return false;
  *items = grown;
  *room = wanted;
  return true;
}

bool sonde_builder_vertex(sonde_mesh_builder *builder, sonde_vec3 point) {
  SONDE_ASSERT(builder->scale > 0);
  sonde_mesh *mesh = &builder->mesh;
  void *items = mesh->vertices;
  bool grown = grow(&items, mesh->vertex_count, &builder->vertex_room, sizeof *mesh->vertices);
  mesh->vertices = items;
  if (grown) mesh->vertices[mesh->vertex_count++] = v_scale(point, builder->scale);
  return grown;
}

bool sonde_builder_face(sonde_mesh_builder *builder, uint32_t a, uint32_t b, uint32_t c) {
  sonde_mesh *mesh = &builder->mesh;
  void *items = mesh->faces;
  bool grown = grow(&items, mesh->face_count, &builder->face_room, sizeof *mesh->faces);
  mesh->faces = items;
  if (!grown) return false;
  uint32_t *face = mesh->faces[mesh->face_count++];
  face[0] = a;
  face[1] = b;
  face[2] = c;
  return true;
}
