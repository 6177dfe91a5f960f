// From the transforms of a frame and the calibration to its pose.
#include "sweep/frames.h"

#include "base/bounds.h"

#include <string.h>

enum { NAME_MAX_BYTES = 32, NAMES_MAX = 24, EDGES_MAX = 40 };

typedef struct edge {
  uint32_t from, to;
  sonde_affine there, back; // mm
} edge;

typedef struct graph {
  char names[NAMES_MAX][NAME_MAX_BYTES];
  uint32_t name_count, edge_count;
  edge edges[EDGES_MAX];
  bool reached[NAMES_MAX];
  sonde_affine from_image[NAMES_MAX]; // that name from Image
} graph;

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

// Copies the value into text; false when the attribute is missing or too long.
static bool attribute(const char *element, const char *end, const char *name, char *text,
                      size_t size) {
  size_t length = strlen(name);
  for (const char *at = element; at + length + 2 < end; ++at) {
    if (!is_blank(at[0]) || strncmp(at + 1, name, length) != 0) continue;
    const char *value = at + 1 + length;
    while (value < end && is_blank(*value)) ++value;
    if (value + 1 >= end || *value++ != '=') continue;
    while (value < end && is_blank(*value)) ++value;
    if (value >= end || (*value != '"' && *value != '\'')) continue;
    const char *stop = memchr(value + 1, *value, (size_t)(end - value - 1));
    if (!stop || (size_t)(stop - value) > size) return false;
    memcpy(text, value + 1, (size_t)(stop - value - 1));
    text[stop - value - 1] = 0;
    return true;
  }
  return false;
}

static const char *const BLOCKS[] = {
    "scaling_from_pixel_to_mm",
    "spatial_calibration_from_image_coordinate_system_to_tracking_tool_coordinate_system"};

// Two blocks of four lines of four numbers, each below a line with its name, as the TUS-REC data
// sets bring them: mm from pixels, which count from 1 there, and the probe's tool from these mm.
static sonde_status load_blocks(const char *path, const char *text, sonde_calibration *c,
                                sonde_error *error) {
  sonde_affine block[2];
  for (int b = 0; b < 2; ++b) {
    const char *at = strstr(text, BLOCKS[b]), *end;
    double v[4][4];
    bool good = at != NULL;
    for (int row = 0; row < 4 && good; ++row) {
      at = strchr(at, '\n');
      good = at != NULL;
      for (int k = 0; k < 4 && good; ++k) {
        v[row][k] = sonde_parse_real(++at, &end);
        good = end != at && isfinite(v[row][k]) && (k == 3 || *end == ',');
        at = end;
      }
    }
    good = good && v[3][0] == 0 && v[3][1] == 0 && v[3][2] == 0 && v[3][3] == 1;
    if (!good)
      return sonde_fail(error, SONDE_FORMAT,
                        "%.200s:%u: expected four lines of four numbers each below %s, the last "
                        "one 0,0,0,1",
                        path, at ? sonde_line_of(text, at) : 1, BLOCKS[b]);
    memcpy(block[b].m, v, sizeof block[b].m);
  }
  const sonde_affine from_zero = {{{1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 1, 0}}};
  const sonde_affine mm = affine_mul(&block[0], &from_zero);
  c->count = 1;
  snprintf(c->transforms[0].from, NAME_MAX_BYTES, "Image");
  snprintf(c->transforms[0].to, NAME_MAX_BYTES, "Probe");
  c->transforms[0].to_from_from = affine_mul(&block[1], &mm);
  return SONDE_OK;
}

sonde_status sonde_calibration_load(const char *path, sonde_calibration *c, sonde_error *error) {
  SONDE_ASSERT(path != NULL && c != NULL);
  *c = (sonde_calibration){0};
  char *bytes;
  size_t count;
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_xml, &bytes, &count, error);
  if (status) return status;
  if (strstr(bytes, BLOCKS[0])) {
    status = load_blocks(path, bytes, c, error);
    sonde_free(bytes);
    return status;
  }
  // Only elements that begin with these names matter; comments are skipped.
  const char *stop = bytes + count, *end;
  for (const char *at = bytes; !status && (at = memchr(at, '<', (size_t)(stop - at))); at = end) {
    bool comment = strncmp(at, "<!--", 4) == 0;
    end = comment ? strstr(at, "-->") : memchr(at, '>', (size_t)(stop - at));
    if (!end) {
      status = sonde_fail(error, SONDE_FORMAT, "%.200s:%u: the file ends inside an element", path,
                          sonde_line_of(bytes, at));
    } else if (strncmp(at, "<Transform", 10) == 0 && is_blank(at[10])) {
      char matrix[1024];
      bool full = c->count == SONDE_COUNT_OF(c->transforms);
      if (full)
        status = sonde_fail(error, SONDE_FORMAT, "%.200s:%u: expected at most %zu transforms", path,
                            sonde_line_of(bytes, at), SONDE_COUNT_OF(c->transforms));
      else if (!attribute(at, end, "From", c->transforms[c->count].from, NAME_MAX_BYTES) ||
               !attribute(at, end, "To", c->transforms[c->count].to, NAME_MAX_BYTES) ||
               !attribute(at, end, "Matrix", matrix, sizeof matrix) ||
               !sonde_text_affine(matrix, &c->transforms[c->count].to_from_from))
        status = sonde_fail(
            error, SONDE_FORMAT,
            "%.200s:%u: Transform: expected From, To and Matrix of 16 finite numbers that "
            "end in 0 0 0 1",
            path, sonde_line_of(bytes, at));
      c->count += !status;
    } else if (strncmp(at, "<VolumeReconstruction", 21) == 0 && is_blank(at[21])) {
      char origin[64], size[64];
      double v[4];
      if (!attribute(at, end, "ClipRectangleOrigin", origin, sizeof origin) ||
          !attribute(at, end, "ClipRectangleSize", size, sizeof size))
        continue;
      bool good = sonde_text_reals(origin, 2, v) && sonde_text_reals(size, 2, v + 2);
      for (int k = 0; k < 4 && good; ++k) {
        good = v[k] >= (k > 1) && v[k] <= SONDE_SIDE_MAX && floor(v[k]) == v[k];
        if (good) c->clip[k] = (uint32_t)v[k];
      }
      c->has_clip = good;
      if (!good)
        status = sonde_fail(error, SONDE_FORMAT,
                            "%.200s:%u: ClipRectangleOrigin and ClipRectangleSize: expected two "
                            "whole numbers of pixels each",
                            path, sonde_line_of(bytes, at));
    }
  }
  if (!status && c->count == 0)
    status = sonde_fail(error, SONDE_FORMAT,
                        "%.200s: expected at least one <Transform From To Matrix> of a PLUS "
                        "configuration, or TUS-REC's calib_matrix.csv",
                        path);
  sonde_free(bytes);
  return status;
}

// NAMES_MAX when there is no room for another.
static uint32_t name_index(graph *g, const char *name) {
  for (uint32_t i = 0; i < g->name_count; ++i)
    if (strcmp(g->names[i], name) == 0) return i;
  if (g->name_count == NAMES_MAX) return NAMES_MAX;
  snprintf(g->names[g->name_count], NAME_MAX_BYTES, "%.31s", name);
  return g->name_count++;
}

static sonde_status add_edge(graph *g, const char *from, const char *to, const sonde_affine *there,
                             sonde_error *error) {
  edge e = {.from = name_index(g, from), .to = name_index(g, to), .there = *there};
  if (e.from == NAMES_MAX || e.to == NAMES_MAX || g->edge_count == EDGES_MAX)
    return sonde_fail(error, SONDE_FORMAT,
                      "expected at most %d coordinate frames and %d transforms", NAMES_MAX,
                      EDGES_MAX);
  if (!affine_inverse(there, &e.back))
    return sonde_fail(error, SONDE_FORMAT, "%sTo%sTransform has no inverse", from, to);
  g->edges[g->edge_count++] = e;
  return SONDE_OK;
}

// Edges of the frame; with `all` also those whose status is not OK.
static sonde_status frame_edges(const sonde_sequence *s, uint32_t frame, bool all, graph *g,
                                sonde_error *error) {
  const sonde_tracked_frame *f = frame == SONDE_WHOLE_FILE ? &s->file : &s->frames[frame];
  for (uint32_t i = 0; i < f->field_count; ++i) {
    const char *key = f->fields[i].key;
    char from[NAME_MAX_BYTES], to[NAME_MAX_BYTES], status_key[128];
    sonde_affine there;
    if (!sonde_text_ends(key, "Transform")) continue;
    // The first "To" behind the first letter and before a capital divides: "ToolToProbe".
    size_t length = strlen(key) - 9, at = 1;
    while (at + 2 < length &&
           (key[at] != 'T' || key[at + 1] != 'o' || key[at + 2] < 'A' || key[at + 2] > 'Z'))
      ++at;
    if (at + 2 >= length || at >= NAME_MAX_BYTES || length - at - 2 >= NAME_MAX_BYTES) continue;
    snprintf(from, sizeof from, "%.*s", (int)at, key);
    snprintf(to, sizeof to, "%.*s", (int)(length - at - 2), key + at + 2);
    snprintf(status_key, sizeof status_key, "%.100sStatus", key);
    const char *word = sonde_sequence_get(s, frame, status_key);
    if (!all && word && strcmp(word, "OK") != 0) continue;
    if (!sonde_text_affine(f->fields[i].value, &there)) {
      if (all)
        there = affine_identity(); // only asked whether there is a way
      else
        continue;
    }
    sonde_affine inverse;
    if (all && !affine_inverse(&there, &inverse)) there = affine_identity();
    sonde_status status = add_edge(g, from, to, &there, error);
    if (status) return status;
  }
  return SONDE_OK;
}

// All that holds for a frame, spread from Image; edges of the calibration come first.
static sonde_status frame_graph(const sonde_sequence *s, const sonde_calibration *c, uint32_t frame,
                                bool all, graph *g, sonde_error *error) {
  *g = (graph){0};
  sonde_status status = SONDE_OK;
  for (uint32_t i = 0; c && i < c->count && !status; ++i)
    status = add_edge(g, c->transforms[i].from, c->transforms[i].to, &c->transforms[i].to_from_from,
                      error);
  if (!status) status = frame_edges(s, SONDE_WHOLE_FILE, all, g, error);
  if (!status) status = frame_edges(s, frame, all, g, error);
  if (status) return status;
  // The names are reached from Image over the edges, either way round.
  uint32_t image = name_index(g, "Image");
  if (image == NAMES_MAX) return SONDE_OK;
  g->reached[image] = true;
  g->from_image[image] = affine_identity();
  for (bool changed = true; changed;) {
    changed = false;
    for (uint32_t i = 0; i < g->edge_count; ++i) {
      const edge *e = &g->edges[i];
      if (g->reached[e->from] == g->reached[e->to]) continue;
      uint32_t old = g->reached[e->from] ? e->from : e->to, new = old == e->from ? e->to : e->from;
      g->from_image[new] = affine_mul(old == e->from ? &e->there : &e->back, &g->from_image[old]);
      g->reached[new] = changed = true;
    }
  }
  return SONDE_OK;
}

// Index of the name when it is reached, else NAMES_MAX.
static uint32_t reached_name(const graph *g, const char *name) {
  for (uint32_t i = 0; i < g->name_count; ++i)
    if (g->reached[i] && strcmp(g->names[i], name) == 0) return i;
  return NAMES_MAX;
}

sonde_status sonde_sequence_locate(sonde_sequence *s, const sonde_calibration *c, const char *world,
                                   sonde_located *out, sonde_error *error) {
  SONDE_ASSERT(s != NULL && s->frames != NULL);
  sonde_located located = {0};
  sonde_status status = SONDE_OK;
  for (uint32_t i = 0; i < s->count; ++i) s->frames[i].used = false;
  if (c && c->has_clip) {
    const uint32_t *clip = c->clip;
    if (clip[2] < 1 || clip[3] < 1 || clip[0] > s->width || clip[2] > s->width - clip[0] ||
        clip[1] > s->height || clip[3] > s->height - clip[1])
      return sonde_fail(error, SONDE_MISMATCH,
                        "clip rectangle of %u x %u pixels at (%u, %u): expected one within frames "
                        "of %u x %u",
                        clip[2], clip[3], clip[0], clip[1], s->width, s->height);
    memcpy(s->clip, clip, sizeof s->clip);
  }
  graph *g = SONDE_NEW(graph, 1);
  if (!g) return sonde_fail_memory(error);
  snprintf(located.world, sizeof located.world, "%.31s", world ? world : "");
  // Without a wish the world is the first of the usual names that some frame leads to.
  static const char *const usual[] = {"Reference", "Tracker", "World", "Probe"};
  for (size_t k = 0; k < SONDE_COUNT_OF(usual) && !world && !status && !located.world[0]; ++k)
    for (uint32_t i = 0; i < s->count && !status && !located.world[0]; ++i) {
      status = frame_graph(s, c, i, true, g, error);
      if (!status && reached_name(g, usual[k]) != NAMES_MAX)
        snprintf(located.world, sizeof located.world, "%s", usual[k]);
    }
  if (!status && !world && !located.world[0])
    status = sonde_fail(error, SONDE_MISMATCH,
                        "no transforms lead from Image to Reference, Tracker, World or Probe; the "
                        "file has no ImageToProbe: give the PLUS configuration that holds it "
                        "(--config)");
  if (status) {
    sonde_free(g);
    return status;
  }
  sonde_error cause = {0};
  for (uint32_t i = 0; i < s->count && !status; ++i) {
    status = frame_graph(s, c, i, false, g, &cause);
    if (!status) {
      sonde_tracked_frame *f = &s->frames[i];
      uint32_t name = reached_name(g, located.world);
      const char *word = sonde_sequence_get(s, i, "ImageStatus");
      if (!word) word = sonde_sequence_get(s, i, "Status");
      f->used = name != NAMES_MAX && (!word || strcmp(word, "OK") == 0);
      if (f->used) f->world_from_pixel = affine_scale(g->from_image[name], 1e-3);
      // A frame without a path of transforms is counted apart from one whose path is INVALID.
      if (name == NAMES_MAX) status = frame_graph(s, c, i, true, g, &cause);
      bool path = name != NAMES_MAX || reached_name(g, located.world) != NAMES_MAX;
      ++*(f->used ? &located.used : path ? &located.invalid : &located.missing);
    }
    if (status) sonde_fail(error, status, "frame %u: %.300s", i, cause.message);
  }
  sonde_free(g);
  SONDE_ASSERT(status || located.used + located.invalid + located.missing == s->count);
  if (!status && !located.used)
    status =
        sonde_fail(error, SONDE_MISMATCH,
                   "none of %u frames has a pose in %s: %u INVALID, %u without transforms that "
                   "lead there from Image",
                   s->count, located.world, located.invalid, located.missing);
  if (out) *out = located;
  return status;
}
