// Common volume of two meshes by the column method (docs/contact.md).
#include "contact/overlap.h"

// Off the axes, so that faces along or across the hint are seen at an angle; further ones in case
// some face runs along the first.
static const double tilts[][2] = {
    {0.137, 0.089}, {-0.113, 0.151}, {0.071, -0.167}, {-0.181, -0.053}};

static void see_row(sonde_overlap *overlap, int side, const view *w, const seen_face *face) {
  overlap_body *b = &overlap->body[side];
  uint32_t f = face->face;
  SONDE_ASSERT(f < b->face_room);
  if (b->face_stamp[f] == overlap->stamp) return;
  b->face_stamp[f] = overlap->stamp;
  b->net[f] = 0;
  sonde_vec3 size = v_sub(face->box.high, face->box.low);
  b->scale[f] = size.x * size.x + size.y * size.y;
  const sonde_vec3 *x = b->tree->vertices;
  for (int k = 0; k < 3; ++k) b->corner[f][k] = face->corner[k];
  sonde_vec3 first = x[face->corner[0]];
  sonde_vec3 twice = v_cross(v_sub(x[face->corner[1]], first), v_sub(x[face->corner[2]], first));
  b->area_per_shadow[f] = v_scale(twice, 1 / fabs(v_dot(twice, w->k)));
  b->region[f] = b->counted[f] = SONDE_NO_REGION;
  b->seen[b->seen_count++] = f;
}

static void add_piece(sonde_overlap *overlap, const view *w, const seen_face *a, const seen_face *b,
                      const covered *polygon, double low) {
  moments m = sonde_covered_moments(polygon);
  if (!(m.area > 0)) return;
  if (overlap->piece_count == overlap->config.max_pieces) {
    overlap->result.flags |= SONDE_OVERLAP_PIECES_FULL;
    return;
  }
  piece *p = &overlap->pieces[overlap->piece_count++];
  *p = (piece){.face = {a->face, b->face}, .area = m.area};
  p->side[0] = a->twice_area > 0 ? 1 : -1;
  p->side[1] = b->twice_area > 0 ? 1 : -1;
  sonde_seen_weights(a, m.u, m.v, p->weight[0]);
  sonde_seen_weights(b, m.u, m.v, p->weight[1]);
  // The depth is z_a - z_b, the mean over the polygon: its value at the centroid.
  for (int k = 0; k < 3; ++k) p->depth += p->weight[0][k] * a->p[k].z - p->weight[1][k] * b->p[k].z;
  p->crossing = low <= 1e-12 * (fabs(a->box.high.z) + fabs(b->box.low.z));
  see_row(overlap, 0, w, a);
  see_row(overlap, 1, w, b);
  overlap->volume_m3 -= p->side[0] * p->side[1] * p->area * p->depth;
  overlap->body[0].net[a->face] -= p->side[1] * p->area;
  overlap->body[1].net[b->face] += p->side[0] * p->area;
}

static void forget(sonde_overlap *overlap) {
  ++overlap->stamp;
  overlap->piece_count = 0;
  overlap->volume_m3 = 0;
  overlap->steep = false;
  overlap->result.flags = 0;
  overlap->body[0].seen_count = overlap->body[1].seen_count = 0;
}

bool sonde_overlap_compute(sonde_overlap *overlap, const sonde_face_tree *a,
                           const sonde_face_tree *b, sonde_vec3 hint) {
  SONDE_ASSERT(overlap != NULL && a->face_count <= overlap->body[0].face_room);
  SONDE_ASSERT(a->vertex_count <= overlap->body[0].vertex_room);
  SONDE_ASSERT(b->face_count <= overlap->body[1].face_room);
  SONDE_ASSERT(b->vertex_count <= overlap->body[1].vertex_room);
  overlap->result.box_tests = overlap->result.face_pairs = 0;
  overlap->body[0].tree = a;
  overlap->body[1].tree = b;
  overlap->region_count = overlap->point_count = 0;
  overlap->body[0].entry_count = overlap->body[1].entry_count = 0;
  forget(overlap);
  sonde_bounds box_a = a->nodes[0].box, box_b = b->nodes[0].box;
  if (bounds_meet(&box_a, &box_b, 0)) {
    sonde_bounds common = bounds_common(box_a, box_b);
    if (!(v_norm2(hint) > 0)) {
      // The hint defaults to the axis along which the boxes overlap least, towards B's middle.
      sonde_vec3 size = v_sub(common.high, common.low);
      sonde_vec3 offset = v_sub(v_add(box_b.low, box_b.high), v_add(box_a.low, box_a.high));
      if (size.x <= size.y && size.x <= size.z)
        hint = vec3(offset.x < 0 ? -1 : 1, 0, 0);
      else if (size.y <= size.z)
        hint = vec3(0, offset.y < 0 ? -1 : 1, 0);
      else
        hint = vec3(0, 0, offset.z < 0 ? -1 : 1);
    }
    hint = v_unit(hint, vec3(0, 0, 1));
    view around = sonde_view_make(hint, (sonde_bounds){{0, 0, 0}, {0, 0, 0}});
    sonde_vec3 k = hint;
    // The view is turned off the hint by a few degrees, otherwise where a face runs along it.
    for (uint32_t turn = 0; turn < SONDE_COUNT_OF(tilts); ++turn) {
      forget(overlap);
      k = v_madd(v_madd(hint, tilts[turn][0], around.u), tilts[turn][1], around.v);
      k = v_unit(k, hint);
      view w = sonde_view_make(k, common);
      overlap->patient = turn + 1 == SONDE_COUNT_OF(tilts);
      sonde_view_pairs(overlap, &w, false, add_piece);
      if (!overlap->steep) break;
    }
    sonde_overlap_regions(overlap, k);
    sonde_overlap_columns(overlap);
  }
  sonde_overlap_result *r = &overlap->result;
  SONDE_ASSERT(overlap->region_count <= overlap->config.max_regions);
  r->volume_m3 = overlap->volume_m3;
  r->region_count = overlap->region_count;
  r->point_count = overlap->point_count;
  r->regions = overlap->regions;
  r->points = overlap->points;
  for (int k = 0; k < 2; ++k) {
    r->entries[k] = overlap->body[k].entries;
    r->entry_count[k] = overlap->body[k].entry_count;
  }
  return overlap->region_count > 0;
}

const sonde_overlap_result *sonde_overlap_get(const sonde_overlap *overlap) {
  SONDE_ASSERT(overlap != NULL);
  return &overlap->result;
}
