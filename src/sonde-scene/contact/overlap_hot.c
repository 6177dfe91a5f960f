// Common volume of two meshes by the column method (docs/contact.md).
//
//   see_row / add_piece   a pair of faces above each other
//   approach              direction for the columns when none is given
//   tilted                that direction off the faces that it may run along
//   gather                all pieces, again along another tilt where a face runs along k
#include "contact/overlap.h"

// Off the axes, so that faces along or across the hint are seen at an angle; further ones in case
// some face runs along the first.
static const double tilts[][2] = {
    {0.137, 0.089}, {-0.113, 0.151}, {0.071, -0.167}, {-0.181, -0.053}};

static void see_row(sonde_overlap *overlap, int side, const view *w, const seen_face *face) {
  overlap_body *b = &overlap->body[side];
  uint32_t f = face->face;
  SONDE_ASSERT(f < b->face_count);
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

static double mean_depth(const view *w, const seen_face *a, const seen_face *b, const piece *p) {
  (void)w;
  double depth = 0;
  for (int k = 0; k < 3; ++k) depth += p->weight[0][k] * a->p[k].z - p->weight[1][k] * b->p[k].z;
  return depth;
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
  p->depth = mean_depth(w, a, b, p);
  p->crossing = low <= 1e-12 * (fabs(a->box.high.z) + fabs(b->box.low.z));
  see_row(overlap, 0, w, a);
  see_row(overlap, 1, w, b);
  overlap->volume_m3 -= p->side[0] * p->side[1] * p->area * p->depth;
  overlap->body[0].net[a->face] -= p->side[1] * p->area;
  overlap->body[1].net[b->face] += p->side[0] * p->area;
}

// Axis along which the boxes overlap least, towards B's middle.
static sonde_vec3 approach(const sonde_bounds *a, const sonde_bounds *b, sonde_bounds common) {
  sonde_vec3 size = v_sub(common.high, common.low);
  sonde_vec3 way = v_sub(v_add(b->low, b->high), v_add(a->low, a->high));
  if (size.x <= size.y && size.x <= size.z) return vec3(way.x < 0 ? -1 : 1, 0, 0);
  if (size.y <= size.z) return vec3(0, way.y < 0 ? -1 : 1, 0);
  return vec3(0, 0, way.z < 0 ? -1 : 1);
}

static sonde_vec3 tilted(sonde_vec3 k, uint32_t turn) {
  sonde_bounds point = {{0, 0, 0}, {0, 0, 0}};
  view w = sonde_view_make(k, point);
  return v_unit(v_madd(v_madd(k, tilts[turn][0], w.u), tilts[turn][1], w.v), k);
}

static void forget(sonde_overlap *overlap) {
  ++overlap->stamp;
  overlap->piece_count = 0;
  overlap->volume_m3 = 0;
  overlap->steep = false;
  overlap->result.flags = 0;
  overlap->body[0].seen_count = overlap->body[1].seen_count = 0;
}

static sonde_vec3 gather(sonde_overlap *overlap, sonde_vec3 hint, sonde_bounds common) {
  sonde_vec3 k = hint;
  for (uint32_t turn = 0; turn < SONDE_COUNT_OF(tilts); ++turn) {
    forget(overlap);
    k = tilted(hint, turn);
    view w = sonde_view_make(k, common);
    bool last = turn + 1 == SONDE_COUNT_OF(tilts);
    overlap->patient = last;
    sonde_view_pairs(overlap, &w, false, add_piece);
    if (!overlap->steep) break;
  }
  return k;
}

static void publish(sonde_overlap *overlap) {
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
}

bool sonde_overlap_compute(sonde_overlap *overlap, const sonde_face_tree *a,
                           const sonde_face_tree *b, sonde_vec3 hint) {
  SONDE_ASSERT(overlap != NULL && a->face_count == overlap->body[0].face_count);
  SONDE_ASSERT(b->face_count == overlap->body[1].face_count);
  overlap->result.box_tests = overlap->result.face_pairs = 0;
  overlap->body[0].tree = a;
  overlap->body[1].tree = b;
  overlap->region_count = overlap->point_count = 0;
  overlap->body[0].entry_count = overlap->body[1].entry_count = 0;
  forget(overlap);
  sonde_bounds box_a = a->nodes[0].box, box_b = b->nodes[0].box;
  if (bounds_meet(&box_a, &box_b, 0)) {
    sonde_bounds common = bounds_common(box_a, box_b);
    if (!(v_norm2(hint) > 0)) hint = approach(&box_a, &box_b, common);
    sonde_vec3 k = gather(overlap, v_unit(hint, vec3(0, 0, 1)), common);
    sonde_overlap_regions(overlap, k);
    sonde_overlap_columns(overlap);
  }
  publish(overlap);
  return overlap->region_count > 0;
}

const sonde_overlap_result *sonde_overlap_get(const sonde_overlap *overlap) {
  SONDE_ASSERT(overlap != NULL);
  return &overlap->result;
}

double sonde_overlap_rate(const sonde_overlap_result *result, uint32_t region,
                          const sonde_vec3 *velocity_a, const sonde_vec3 *velocity_b) {
  SONDE_ASSERT(region < result->region_count);
  const sonde_overlap_region *r = &result->regions[region];
  const sonde_vec3 *velocity[2] = {velocity_a, velocity_b};
  double rate = 0;
  for (int side = 0; side < 2; ++side) {
    const sonde_overlap_entry *entry = result->entries[side] + r->first_entry[side];
    if (!velocity[side]) continue;
    for (uint32_t k = 0; k < r->entry_count[side]; ++k)
      rate += v_dot(entry[k].gradient_m2, velocity[side][entry[k].vertex]);
  }
  return rate;
}
