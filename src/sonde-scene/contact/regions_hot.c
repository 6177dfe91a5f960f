// Regions of the common volume, and the gradients of each.
//
// Touched faces (with a part inside the other body) are joined through their vertices into parts of
// A and parts of B; parts whose faces touch each other make a group. A group is one region, except
// where the parts of one body lie side by side over large faces of the other, as hills under a
// plate: there each part makes a region.
#include "contact/overlap.h"

// A face counts as touched when more than this share of its size^2 is inside.
#define TOUCHED 1e-13

static uint32_t find(uint32_t *parent, uint32_t i) {
  SONDE_ASSERT(parent[i] <= i);
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

static void join(uint32_t *parent, uint32_t a, uint32_t b) {
  uint32_t x = find(parent, a), y = find(parent, b);
  if (x < y)
    parent[y] = x;
  else
    parent[x] = y;
}

static void sort(uint32_t *list, uint32_t count) {
  for (uint32_t gap = count / 2; gap > 0; gap /= 2)
    for (uint32_t k = gap; k < count; ++k) {
      uint32_t value = list[k], at = k;
      for (; at >= gap && list[at - gap] > value; at -= gap) list[at] = list[at - gap];
      list[at] = value;
    }
}

static uint32_t node_of(const sonde_overlap *overlap, int side, uint32_t vertex) {
  return side ? overlap->body[0].vertex_room + vertex : vertex;
}

static bool touched(const sonde_overlap *overlap, int side, uint32_t face) {
  return overlap->body[side].region[face] != SONDE_NO_REGION;
}

static uint32_t part_of(sonde_overlap *overlap, int side, uint32_t face) {
  return find(overlap->part, node_of(overlap, side, overlap->body[side].corner[face][0]));
}

static void join_parts(sonde_overlap *overlap, int side) {
  overlap_body *b = &overlap->body[side];
  for (uint32_t i = 0; i < b->seen_count; ++i) {
    uint32_t f = b->seen[i], node[3];
    if (!(b->net[f] > TOUCHED * b->scale[f])) continue;
    b->region[f] = 0;
    for (int k = 0; k < 3; ++k) {
      node[k] = node_of(overlap, side, b->corner[f][k]);
      if (overlap->node_stamp[node[k]] == overlap->stamp) continue;
      overlap->node_stamp[node[k]] = overlap->stamp;
      overlap->part[node[k]] = overlap->group[node[k]] = node[k];
      overlap->part_region[node[k]] = SONDE_NO_REGION;
      overlap->group_facts[node[k]] = (overlap_group){.region = SONDE_NO_REGION, .split_by = -1};
    }
    join(overlap->part, node[0], node[1]);
    join(overlap->part, node[1], node[2]);
  }
}

// Lists the parts of a body in `touched` of the body, ascending; returns how many.
static uint32_t list_parts(sonde_overlap *overlap, int side) {
  overlap_body *b = &overlap->body[side];
  uint32_t count = 0;
  for (uint32_t i = 0; i < b->seen_count; ++i) {
    uint32_t f = b->seen[i];
    if (b->region[f] == SONDE_NO_REGION) continue;
    for (int k = 0; k < 3; ++k) {
      uint32_t node = node_of(overlap, side, b->corner[f][k]);
      if (find(overlap->part, node) != node || b->vertex_stamp[b->corner[f][k]] == overlap->stamp)
        continue;
      b->vertex_stamp[b->corner[f][k]] = overlap->stamp;
      b->touched[count++] = node;
    }
  }
  sort(b->touched, count);
  return count;
}

static overlap_group *facts_of(sonde_overlap *overlap, uint32_t part) {
  return &overlap->group_facts[find(overlap->group, part)];
}

// Order of the pieces by the face of one side, then by the other side's part.
static bool piece_before(sonde_overlap *overlap, int side, uint32_t a, uint32_t b) {
  const piece *p = &overlap->pieces[a], *q = &overlap->pieces[b];
  if (p->face[side] != q->face[side]) return p->face[side] < q->face[side];
  return p->part != q->part ? p->part < q->part : a < b;
}

// A group stays whole when a face of this side has more of it inside the other body than the
// other's parts in the group cover one by one: then it joins parts, as where one body pierces the
// other. Each part's cover has to be positive and nothing else may cover the face.
static void check_splits(sonde_overlap *overlap, int side) {
  overlap_body *b = &overlap->body[side];
  uint32_t count = 0;
  for (uint32_t i = 0; i < overlap->piece_count; ++i) {
    piece *p = &overlap->pieces[i];
    if (!touched(overlap, side, p->face[side])) continue;
    const overlap_group *g = facts_of(overlap, part_of(overlap, side, p->face[side]));
    if (g->split_by != 1 - side) continue;
    uint32_t other = p->face[1 - side];
    p->part = SONDE_NO_REGION;
    if (touched(overlap, 1 - side, other)) {
      uint32_t part = part_of(overlap, 1 - side, other);
      if (facts_of(overlap, part) == g) p->part = part;
    }
    b->order[count++] = i;
  }
  // The pieces are sorted by the face of this side, then by the other side's part.
  for (uint32_t gap = count / 2; gap > 0; gap /= 2)
    for (uint32_t k = gap; k < count; ++k) {
      uint32_t value = b->order[k], at = k;
      for (; at >= gap && piece_before(overlap, side, value, b->order[at - gap]); at -= gap)
        b->order[at] = b->order[at - gap];
      b->order[at] = value;
    }
  for (uint32_t i = 0, next; i < count; i = next) {
    const piece *p = &overlap->pieces[b->order[i]];
    double cover = 0, slack = 1e-9 * b->scale[p->face[side]];
    for (next = i; next < count; ++next) {
      const piece *q = &overlap->pieces[b->order[next]];
      if (q->face[side] != p->face[side] || q->part != p->part) break;
      cover += q->area * (side ? q->side[0] : -q->side[1]);
    }
    bool apart = p->part == SONDE_NO_REGION ? fabs(cover) <= slack : cover >= -slack;
    if (!apart) facts_of(overlap, part_of(overlap, side, p->face[side]))->whole = true;
  }
}

// Which groups are split, and by the parts of which side.
static void judge_groups(sonde_overlap *overlap, const uint32_t parts[2]) {
  bool candidates = false;
  for (int side = 0; side < 2; ++side)
    for (uint32_t i = 0; i < parts[side]; ++i)
      ++facts_of(overlap, overlap->body[side].touched[i])->parts[side];
  for (int side = 0; side < 2; ++side)
    for (uint32_t i = 0; i < parts[side]; ++i) {
      overlap_group *g = facts_of(overlap, overlap->body[side].touched[i]);
      if (g->parts[side] <= g->parts[1 - side] || !g->parts[1 - side]) continue;
      g->split_by = side;
      candidates = true;
    }
  if (!candidates) return;
  check_splits(overlap, 0);
  check_splits(overlap, 1);
  for (int side = 0; side < 2; ++side)
    for (uint32_t i = 0; i < parts[side]; ++i) {
      overlap_group *g = facts_of(overlap, overlap->body[side].touched[i]);
      if (g->whole) g->split_by = -1;
    }
}

// Regions are numbered by their first vertex.
static void number_regions(sonde_overlap *overlap, const uint32_t parts[2]) {
  for (int side = 0; side < 2; ++side)
    for (uint32_t i = 0; i < parts[side]; ++i) {
      uint32_t part = overlap->body[side].touched[i];
      overlap_group *g = facts_of(overlap, part);
      if (g->split_by != side && (g->split_by >= 0 || g->region != SONDE_NO_REGION)) continue;
      uint32_t number = overlap->region_count;
      if (number == overlap->config.max_regions) {
        overlap->result.flags |= SONDE_OVERLAP_REGIONS_FULL;
        --number;
      } else {
        ++overlap->region_count;
        overlap->family[number] = g->region == SONDE_NO_REGION ? number : g->region;
        overlap->split_by[number] = g->split_by;
      }
      if (g->region == SONDE_NO_REGION) g->region = number;
      overlap->part_region[part] = number;
    }
  for (int side = 0; side < 2; ++side) {
    overlap_body *b = &overlap->body[side];
    for (uint32_t i = 0; i < b->seen_count; ++i) {
      uint32_t f = b->seen[i];
      if (b->region[f] == SONDE_NO_REGION) continue;
      uint32_t part = part_of(overlap, side, f);
      const overlap_group *g = facts_of(overlap, part);
      b->region[f] = g->split_by == side ? overlap->part_region[part] : g->region;
    }
  }
}

uint32_t sonde_piece_region(sonde_overlap *overlap, const piece *p, int side) {
  uint32_t own = overlap->body[side].region[p->face[side]];
  uint32_t other = overlap->body[1 - side].region[p->face[1 - side]];
  if (own == SONDE_NO_REGION || overlap->split_by[own] != 1 - side) return own;
  if (other == SONDE_NO_REGION || overlap->family[other] != overlap->family[own]) return own;
  return other;
}

// Counting sort of the pieces whose face of this side is touched.
static void bucket(sonde_overlap *overlap, int side) {
  overlap_body *b = &overlap->body[side];
  uint32_t *first = b->first, regions = overlap->region_count;
  for (uint32_t r = 0; r <= regions; ++r) first[r] = 0;
  for (uint32_t i = 0; i < overlap->piece_count; ++i) {
    uint32_t r = sonde_piece_region(overlap, &overlap->pieces[i], side);
    if (r != SONDE_NO_REGION) ++first[r + 1];
  }
  for (uint32_t r = 0; r < regions; ++r) first[r + 1] += first[r];
  for (uint32_t i = 0; i < overlap->piece_count; ++i) {
    uint32_t r = sonde_piece_region(overlap, &overlap->pieces[i], side);
    if (r != SONDE_NO_REGION) b->order[first[r]++] = i;
  }
  for (uint32_t r = regions; r > 0; --r) first[r] = first[r - 1];
  first[0] = 0;
}

// The gradients of a region at the vertices of one side.
static void accumulate(sonde_overlap *overlap, int side, uint32_t region) {
  SONDE_ASSERT(region < overlap->region_count);
  overlap_body *b = &overlap->body[side];
  sonde_overlap_region *r = &overlap->regions[region];
  uint32_t count = 0;
  uint64_t stamp = UINT64_MAX - ++overlap->stamp_vertices;
  for (uint32_t i = b->first[region]; i < b->first[region + 1]; ++i) {
    const piece *p = &overlap->pieces[b->order[i]];
    uint32_t f = p->face[side];
    if (b->counted[f] != region) ++r->face_count[side];
    b->counted[f] = region;
    double area = p->area * (side ? p->side[0] : -p->side[1]);
    for (int k = 0; k < 3; ++k) {
      // The gradient of a vertex begins at 0 where the region meets the vertex first.
      uint32_t v = b->corner[f][k];
      if (b->vertex_stamp[v] != stamp) {
        b->vertex_stamp[v] = stamp;
        b->gradient[v] = vec3(0, 0, 0);
        b->touched[count++] = v;
      }
      sonde_vec3 g = v_scale(b->area_per_shadow[f], area * p->weight[side][k]);
      b->gradient[v] = v_add(b->gradient[v], g);
    }
  }
  sort(b->touched, count);
  r->first_entry[side] = b->entry_count;
  for (uint32_t i = 0; i < count; ++i) {
    if (b->entry_count == b->entry_room) {
      overlap->result.flags |= SONDE_OVERLAP_REGIONS_FULL;
      break;
    }
    uint32_t v = b->touched[i];
    b->entries[b->entry_count++] = (sonde_overlap_entry){v, region, b->gradient[v]};
  }
  r->entry_count[side] = b->entry_count - r->first_entry[side];
}

// Centroid of one side's entries by their share across the direction; their mean when the shares
// cancel.
static sonde_vec3 side_centre(const sonde_overlap *overlap, const sonde_overlap_region *r, int side,
                              double sign) {
  const overlap_body *b = &overlap->body[side];
  sonde_vec3 mean = vec3(0, 0, 0), centre = mean;
  double sum = 0, size = 0;
  for (uint32_t i = 0; i < r->entry_count[side]; ++i) {
    const sonde_overlap_entry *e = &b->entries[r->first_entry[side] + i];
    double share = sign * v_dot(e->gradient_m2, r->direction);
    centre = v_madd(centre, share, b->tree->vertices[e->vertex]);
    mean = v_madd(mean, 1.0 / r->entry_count[side], b->tree->vertices[e->vertex]);
    sum += share;
    size += fabs(share);
  }
  return sum > 1e-3 * size ? v_scale(centre, 1 / sum) : mean;
}

// Area, direction, centre, volume and mean depth of a region from its gradients.
static void summarise(sonde_overlap *overlap, sonde_overlap_region *r, sonde_vec3 k) {
  sonde_vec3 sum = vec3(0, 0, 0);
  double size = 0;
  for (uint32_t i = 0; i < r->entry_count[0]; ++i) {
    sonde_vec3 g = overlap->body[0].entries[r->first_entry[0] + i].gradient_m2;
    sum = v_add(sum, g);
    size += v_norm(g);
  }
  r->area_m2 = v_norm(sum);
  r->direction = r->area_m2 > 1e-9 * size ? v_unit(sum, k) : k;
  if (r->entry_count[0] && r->entry_count[1])
    r->centre_m = v_lerp(side_centre(overlap, r, 0, 1), side_centre(overlap, r, 1, -1), 0.5);
  else
    r->centre_m = side_centre(overlap, r, r->entry_count[0] ? 0 : 1, 1);
  // The volume is homogeneous of degree 3 in the positions: 3 V = sum of x . dV/dx.
  for (int side = 0; side < 2; ++side)
    for (uint32_t i = 0; i < r->entry_count[side]; ++i) {
      const sonde_overlap_entry *e = &overlap->body[side].entries[r->first_entry[side] + i];
      sonde_vec3 x = v_sub(overlap->body[side].tree->vertices[e->vertex], r->centre_m);
      r->volume_m3 += v_dot(x, e->gradient_m2) / 3;
    }
  r->depth_m = r->area_m2 > 0 ? r->volume_m3 / r->area_m2 : 0;
}

void sonde_overlap_regions(sonde_overlap *overlap, sonde_vec3 k) {
  SONDE_ASSERT(overlap->region_count == 0);
  join_parts(overlap, 0);
  join_parts(overlap, 1);
  // Parts of A and of B whose faces touch each other belong to one group.
  for (uint32_t i = 0; i < overlap->piece_count; ++i) {
    const piece *p = &overlap->pieces[i];
    if (!p->crossing || !touched(overlap, 0, p->face[0]) || !touched(overlap, 1, p->face[1]))
      continue;
    join(overlap->group, part_of(overlap, 0, p->face[0]), part_of(overlap, 1, p->face[1]));
  }
  uint32_t parts[2] = {list_parts(overlap, 0), list_parts(overlap, 1)};
  judge_groups(overlap, parts);
  number_regions(overlap, parts);
  bucket(overlap, 0);
  bucket(overlap, 1);
  for (uint32_t r = 0; r < overlap->region_count; ++r) {
    overlap->regions[r] = (sonde_overlap_region){0};
    accumulate(overlap, 0, r);
    accumulate(overlap, 1, r);
    summarise(overlap, &overlap->regions[r], k);
  }
}
