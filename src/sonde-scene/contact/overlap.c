// Creation of an overlap: all its memory.
//
//   make_body    what is kept per face and vertex of one body
#include "contact/overlap.h"

static bool make_body(overlap_body *b, const sonde_face_tree *tree,
                      const sonde_overlap_config *config) {
  size_t faces = tree->face_count, vertices = tree->vertex_count;
  b->vertex_count = tree->vertex_count;
  b->face_count = tree->face_count;
  b->entry_room = 2 * tree->vertex_count + 16 * config->max_regions;
  b->face_stamp = SONDE_NEW(uint64_t, faces);
  b->net = SONDE_NEW(double, faces);
  b->scale = SONDE_NEW(double, faces);
  b->corner = sonde_calloc(faces, sizeof *b->corner);
  b->area_per_shadow = SONDE_NEW(sonde_vec3, faces);
  b->region = SONDE_NEW(uint32_t, faces);
  b->counted = SONDE_NEW(uint32_t, faces);
  b->seen = SONDE_NEW(uint32_t, faces);
  b->vertex_stamp = SONDE_NEW(uint64_t, vertices);
  b->gradient = SONDE_NEW(sonde_vec3, vertices);
  b->touched = SONDE_NEW(uint32_t, vertices);
  b->order = SONDE_NEW(uint32_t, config->max_pieces);
  b->first = SONDE_NEW(uint32_t, (size_t)config->max_regions + 1);
  b->entries = SONDE_NEW(sonde_overlap_entry, b->entry_room);
  return b->face_stamp && b->net && b->scale && b->corner && b->area_per_shadow && b->region &&
         b->counted && b->seen && b->vertex_stamp && b->gradient && b->touched && b->order &&
         b->first && b->entries;
}

static bool make_rest(sonde_overlap *overlap) {
  const sonde_overlap_config *config = &overlap->config;
  size_t nodes = (size_t)overlap->body[0].vertex_count + overlap->body[1].vertex_count;
  overlap->pieces = SONDE_NEW(piece, config->max_pieces);
  overlap->node_stamp = SONDE_NEW(uint64_t, nodes);
  overlap->part = SONDE_NEW(uint32_t, nodes);
  overlap->group = SONDE_NEW(uint32_t, nodes);
  overlap->part_region = SONDE_NEW(uint32_t, nodes);
  overlap->group_facts = SONDE_NEW(overlap_group, nodes);
  overlap->regions = SONDE_NEW(sonde_overlap_region, config->max_regions);
  overlap->points = SONDE_NEW(sonde_overlap_point, config->max_points);
  overlap->family = SONDE_NEW(uint32_t, config->max_regions);
  overlap->split_by = SONDE_NEW(int, config->max_regions);
  return overlap->pieces && overlap->node_stamp && overlap->part && overlap->group &&
         overlap->part_region && overlap->group_facts && overlap->regions && overlap->points &&
         overlap->family && overlap->split_by;
}

static sonde_overlap_config filled(const sonde_overlap_config *config, uint64_t faces) {
  sonde_overlap_config full = config ? *config : (sonde_overlap_config){0};
  uint64_t pieces = 8 * faces < 4096 ? 4096 : 8 * faces;
  if (!full.max_pieces) full.max_pieces = pieces < UINT32_MAX ? (uint32_t)pieces : UINT32_MAX;
  if (!full.max_regions) full.max_regions = 64;
  if (!full.max_points) full.max_points = full.max_pieces;
  if (!full.points_per_piece) full.points_per_piece = 3;
  return full;
}

sonde_status sonde_overlap_create(const sonde_face_tree *a, const sonde_face_tree *b,
                                  const sonde_overlap_config *config, sonde_overlap **out,
                                  sonde_error *error) {
  SONDE_ASSERT(a != NULL && b != NULL && out != NULL);
  *out = NULL;
  sonde_overlap_config full = filled(config, (uint64_t)a->face_count + b->face_count);
  uint32_t points = full.points_per_piece;
  if (points != 1 && points != 3 && points != UINT32_MAX)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "points_per_piece is %u, expected 1, 3 or UINT32_MAX for none", points);
  sonde_overlap *overlap = SONDE_NEW(sonde_overlap, 1);
  if (!overlap) return sonde_fail_memory(error);
  overlap->config = full;
  bool room = make_body(&overlap->body[0], a, &full) && make_body(&overlap->body[1], b, &full);
  if (!room || !make_rest(overlap)) {
    sonde_overlap_destroy(overlap);
    return sonde_fail_memory(error);
  }
  *out = overlap;
  return SONDE_OK;
}

void sonde_overlap_destroy(sonde_overlap *overlap) {
  if (!overlap) return;
  for (int k = 0; k < 2; ++k) {
    overlap_body *b = &overlap->body[k];
    void *const rows[] = {b->face_stamp, b->net,     b->scale,   b->corner, b->area_per_shadow,
                          b->region,     b->counted, b->seen,    b->order,  b->vertex_stamp,
                          b->gradient,   b->touched, b->entries, b->first};
    for (size_t i = 0; i < SONDE_COUNT_OF(rows); ++i) sonde_free(rows[i]);
  }
  void *const rest[] = {overlap->pieces,  overlap->node_stamp,  overlap->part,
                        overlap->group,   overlap->part_region, overlap->group_facts,
                        overlap->regions, overlap->points,      overlap->family,
                        overlap->split_by};
  for (size_t i = 0; i < SONDE_COUNT_OF(rest); ++i) sonde_free(rest[i]);
  sonde_free(overlap);
}
