// Memory of an overlap: one block, in which a first pass over the arrays measures and a second one
// hands them out.
#include "contact/overlap.h"

#define CARVE(at, count) ((at) = sonde_carve(base, &offset, (count), sizeof *(at)))

static size_t lay_out(sonde_overlap *overlap, char *base) {
  const sonde_overlap_config *config = &overlap->config;
  size_t offset = 0, nodes = 0;
  for (int side = 0; side < 2; ++side) {
    overlap_body *b = &overlap->body[side];
    size_t faces = b->face_room, vertices = b->vertex_room;
    nodes += vertices;
    CARVE(b->face_stamp, faces);
    CARVE(b->net, faces);
    CARVE(b->scale, faces);
    CARVE(b->corner, faces);
    CARVE(b->area_per_shadow, faces);
    CARVE(b->region, faces);
    CARVE(b->counted, faces);
    CARVE(b->seen, faces);
    CARVE(b->vertex_stamp, vertices);
    CARVE(b->gradient, vertices);
    CARVE(b->touched, vertices);
    CARVE(b->order, config->max_pieces);
    CARVE(b->first, (size_t)config->max_regions + 1);
    CARVE(b->entries, b->entry_room);
  }
  CARVE(overlap->pieces, config->max_pieces);
  CARVE(overlap->node_stamp, nodes);
  CARVE(overlap->part, nodes);
  CARVE(overlap->group, nodes);
  CARVE(overlap->part_region, nodes);
  CARVE(overlap->group_facts, nodes);
  CARVE(overlap->regions, config->max_regions);
  CARVE(overlap->points, config->max_points);
  CARVE(overlap->family, config->max_regions);
  CARVE(overlap->split_by, config->max_regions);
  return offset;
}

sonde_status sonde_overlap_create(const sonde_face_tree *a, const sonde_face_tree *b,
                                  const sonde_overlap_config *config, sonde_overlap **out,
                                  sonde_error *error) {
  SONDE_ASSERT(a != NULL && b != NULL && out != NULL);
  *out = NULL;
  sonde_overlap_config full = config ? *config : (sonde_overlap_config){0};
  uint64_t pieces = 8 * ((uint64_t)a->face_count + b->face_count);
  if (pieces < 4096) pieces = 4096;
  if (!full.max_pieces) full.max_pieces = pieces < UINT32_MAX ? (uint32_t)pieces : UINT32_MAX;
  if (!full.max_regions) full.max_regions = 64;
  if (!full.max_points) full.max_points = full.max_pieces;
  if (!full.points_per_piece) full.points_per_piece = 3;
  uint32_t points = full.points_per_piece;
  if (points != 1 && points != 3 && points != UINT32_MAX)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "points_per_piece is %u, expected 1, 3 or UINT32_MAX for none", points);
  sonde_overlap *overlap = SONDE_NEW(sonde_overlap, 1);
  if (!overlap) return sonde_fail_memory(error);
  overlap->config = full;
  for (int side = 0; side < 2; ++side) {
    const sonde_face_tree *tree = side ? b : a;
    overlap_body *body = &overlap->body[side];
    bool more = full.max_vertices > tree->vertex_count;
    body->vertex_room = more ? full.max_vertices : tree->vertex_count;
    body->face_room = full.max_faces > tree->face_count ? full.max_faces : tree->face_count;
    body->entry_room = 2 * body->vertex_room + 16 * full.max_regions;
  }
  overlap->block = sonde_calloc(1, lay_out(overlap, NULL));
  if (!overlap->block) {
    sonde_overlap_destroy(overlap);
    return sonde_fail_memory(error);
  }
  lay_out(overlap, overlap->block);
  *out = overlap;
  return SONDE_OK;
}

void sonde_overlap_destroy(sonde_overlap *overlap) {
  if (!overlap) return;
  sonde_free(overlap->block);
  sonde_free(overlap);
}
