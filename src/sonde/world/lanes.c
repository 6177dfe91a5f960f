// Laying out a model for the fast engine; cold.
// carve:       all arrays in one block; measured and placed by the same code.
// list_seen:   rows at the border between the two parts of a large body.
// fill_row:    neighbours of every row, padded to the slice's largest number.
// fill_springs, fill_shear: what a tuning changes.
// fill_faces:  faces in slices of 16, for the contact.
// list_near:   slices that share an edge, and slices of faces that touch a slice.
#include "tissue/two_layer.h"
#include "world/crew.h"
#include "world/lanes.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/vector.h"

#include <string.h>

// Of face_marked.
static size_t mark_words(const sonde_lanes *l) { return l->face_slice_count / 64 + 1; }

// Vectors for so many numbers.
static uint32_t vectors_of(uint32_t count) { return (count + SONDE_LANES - 1) / SONDE_LANES; }

#define CARVE(field, count) (l->field = sonde_carve(base, &offset, (count), sizeof *l->field))

static size_t carve(sonde_lanes *l, uint32_t faces, char *base) {
  size_t offset = 0, rows = (size_t)l->slice_count * SONDE_LANES, all = rows + l->seen_count;
  CARVE(model, l->slice_count), CARVE(box, vectors_of(l->slice_count)),
      CARVE(slice, l->slice_count);
  CARVE(slot, l->slot_count), CARVE(tangent, l->slot_count), CARVE(share, l->slot_count);
  CARVE(slot_layer, l->law.layered ? l->slot_count : 0);
  CARVE(slot_face, l->law.layered ? l->slot_count : 0);
  CARVE(slot_from, l->law.layered ? l->slot_count : 0);
  CARVE(press, l->slice_count), CARVE(press_of, l->slice_count), CARVE(pressed, l->slice_count);
  CARVE(face, l->face_slice_count), CARVE(point_area, l->face_slice_count);
  CARVE(near, l->near_total), CARVE(face_near, l->face_total);
  CARVE(record, l->law.springs ? all * SONDE_RECORD : 0), CARVE(direction, all * SONDE_QUAD);
  CARVE(slide, l->law.layered ? all * SONDE_RECORD : 0);
  CARVE(layer_direction, l->law.layered ? all * SONDE_QUAD : 0);
  CARVE(seen, l->seen_count), CARVE(seen_at, l->seen_count > 0 ? rows : 0);
  CARVE(awake, l->slice_count);
  CARVE(is_awake, l->slice_count), CARVE(calm, l->slice_count);
  CARVE(face_marked, mark_words(l)), CARVE(face_code, l->face_slice_count);
  CARVE(is_near, l->slice_count), CARVE(near_list, l->slice_count);
  CARVE(speed2, l->slice_count), CARVE(way2, l->slice_count), CARVE(unrest2, l->slice_count);
  CARVE(published, l->slice_count), CARVE(touched_rows, l->slice_count);
  CARVE(near_probe, l->slice_count), CARVE(near_code, l->slice_count);
  CARVE(probe_place, rows * SONDE_QUAD), CARVE(probe_motion, rows * SONDE_QUAD);
  CARVE(probe_way, rows * SONDE_QUAD);
  CARVE(probe.plane, SONDE_MAX_PROBE_PLANES), CARVE(probe.slope, SONDE_MAX_PROBE_PLANES);
  CARVE(pressed_slice, l->slice_count > l->face_slice_count ? l->slice_count : l->face_slice_count);
  CARVE(press_corners, 1), CARVE(meet_corners, 1);
  CARVE(tie, SONDE_FACE_POINTS * (size_t)faces / SONDE_LANES + 1);
  return offset;
}

static uint32_t valence(const sonde_topology *t, uint32_t i) {
  return i < t->vertex_count ? t->start[i + 1] - t->start[i] : 0;
}

// The order of a row's slots: around it where faces matter.
static void order_slots(const sonde_model *model, bool layered, uint32_t i, sonde_fan *fan) {
  const sonde_topology *t = &model->topology;
  fan->count = fan->turn = 0;
  fan->last = i;
  if (i >= t->vertex_count) return;
  if (layered) {
    sonde_lanes_fan(model, i, fan);
    return;
  }
  for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k)
    fan->node[fan->count++] = t->neighbour[k];
}

static uint32_t count_slots(const sonde_model *model, bool layered, uint32_t slice,
                            sonde_fan *fan) {
  uint32_t most = 0;
  for (uint32_t l = 0; l < SONDE_LANES; ++l) {
    order_slots(model, layered, slice * SONDE_LANES + l, fan);
    if (fan->count > most) most = fan->count;
  }
  return most;
}

static uint32_t edge_between(const sonde_topology *t, uint32_t i, uint32_t j) {
  uint32_t k = t->start[i];
  while (k < t->start[i + 1] && t->neighbour[k] != j) ++k;
  SONDE_ASSERT(k < t->start[i + 1]);
  return t->neighbour_edge[k];
}

// Which part a row belongs to.
static uint32_t part_of(const sonde_lanes *lanes, uint32_t row) {
  return lanes->part_count > 1 && row / SONDE_LANES >= lanes->part_slice[1];
}

static bool is_seen(const sonde_lanes *lanes, const sonde_topology *t, uint32_t i) {
  for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k)
    if (part_of(lanes, t->neighbour[k]) != part_of(lanes, i)) return true;
  return false;
}

// Rows that the other part sees; those of the last part, which the first one sees, come last.
static void list_seen(sonde_lanes *lanes, const sonde_topology *t) {
  uint32_t count = 0, half = 0;
  if (lanes->seen_count == 0) return;
  for (uint32_t i = 0; i < t->vertex_count; ++i) {
    if (!is_seen(lanes, t, i)) continue;
    half += part_of(lanes, i) == 0;
    lanes->seen[count] = i;
    lanes->seen_at[i] = lanes->slice_count * SONDE_LANES + count++;
  }
  SONDE_ASSERT(count == lanes->seen_count);
  lanes->part_seen[1] = half, lanes->part_seen[2] = count;
}

// Where row i reads what row j has published.
static int32_t seen_from(const sonde_lanes *lanes, uint32_t i, uint32_t j) {
  return (int32_t)(part_of(lanes, i) == part_of(lanes, j) ? j : lanes->seen_at[j]);
}

// The spring to the neighbour of slot k; one that has a slot already has no spring here.
static void fill_spring(sonde_lanes *lanes, const sonde_model *model, uint32_t i, uint32_t k,
                        const sonde_fan *fan) {
  uint32_t l = i % SONDE_LANES;
  sonde_slice_model *fixed = &lanes->model[i / SONDE_LANES];
  sonde_slot *slot = &lanes->slot[fixed->first_slot + k];
  bool used = k < fan->count;
  uint32_t j = used ? fan->node[k] : i;
  sonde_vec3 d = vec3(1, 0, 0);
  double length = 1, share = used;
  if (used) {
    uint32_t e = edge_between(&model->topology, i, j);
    if (model->edge_share) share = model->edge_share[e];
    d = v_sub(model->surface.vertices[j], model->surface.vertices[i]);
    length = model->edge_rest_m[e];
  }
  for (uint32_t before = 0; used && before < k; ++before)
    if (fan->node[before] == j) share = 0;
  lanes->tangent[fixed->first_slot + k].node[l] = seen_from(lanes, i, j);
  slot->rest[0][l] = (float)d.x, slot->rest[1][l] = (float)d.y, slot->rest[2][l] = (float)d.z;
  slot->length[l] = (float)length;
  lanes->share[fixed->first_slot + k][l] = (float)share;
  if (share != 1 && k < fixed->whole_count) fixed->whole_count = k;
}

static void fill_shear(sonde_slot_face *slot, const sonde_model *model, uint32_t f, uint32_t lane) {
  double shear, limit;
  sonde_tissue_face_law(model, f, &shear, &limit);
  slot->shear[lane] = (float)shear;
  slot->bend[lane] = shear > 0 ? (float)(1 / (limit * limit * model->face_area_m2[f])) : 0;
}

// Both layers in slot k, whose face also weighs on the slot before.
static void fill_layers(sonde_lanes *lanes, const sonde_model *model, uint32_t i, uint32_t k,
                        const sonde_fan *fan) {
  uint32_t l = i % SONDE_LANES, f = k < fan->count ? fan->face[k] : SONDE_NO_FACE;
  sonde_slice_model *fixed = &lanes->model[i / SONDE_LANES];
  sonde_slot_layer *layer = &lanes->slot_layer[fixed->first_slot + k];
  lanes->slot_from[fixed->first_slot + k][l] = (int32_t)f;
  layer->node[l] = seen_from(lanes, i, k < fan->count ? fan->node[k] : i);
  if (f == SONDE_NO_FACE) return;
  const uint32_t *v = model->surface.faces[f];
  uint32_t own = v[0] == i ? 0 : v[1] == i ? 1 : 2;
  sonde_slot_face *slot = &lanes->slot_face[fixed->first_slot + k];
  for (uint32_t c = 0; c < 3; ++c)
    slot->cot[c][l] = (float)model->face_half_cotangent[f][(own + c) % 3];
  fill_shear(slot, model, f, l);
  layer->weight[l] += slot->cot[1][l];
  sonde_slot_layer *before = &lanes->slot_layer[fixed->first_slot + (k > 0 ? k : fan->turn) - 1];
  before->weight[l] += slot->cot[2][l];
  fixed->weight[l] += slot->cot[1][l] + slot->cot[2][l];
}

static void fill_row(sonde_lanes *lanes, const sonde_model *model, uint32_t i, sonde_fan *fan) {
  uint32_t l = i % SONDE_LANES;
  sonde_slice_model *fixed = &lanes->model[i / SONDE_LANES];
  order_slots(model, lanes->law.layered, i, fan);
  fixed->last[l] = seen_from(lanes, i, fan->last);
  fixed->turn[l] = (int32_t)fan->turn;
  if (l == 0) fixed->whole_count = fixed->slot_count;
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    fill_spring(lanes, model, i, k, fan);
    if (lanes->law.layered) fill_layers(lanes, model, i, k, fan);
  }
}

static void fill_springs(sonde_slice_model *fixed, const sonde_model *model, uint32_t i) {
  double tangent = model->law.tangential_stiffness_n_m3, k0 = model->k0_n_m3[i];
  uint32_t l = i % SONDE_LANES;
  fixed->k0[l] = (float)k0;
  fixed->yield[l] = (float)(1 / (model->area_m2[i] * (tangent > 0 ? fmin(tangent, k0) : k0)));
}

static void empty_boxes(sonde_lanes *lanes) {
  for (uint32_t k = 0; k < vectors_of(lanes->slice_count); ++k)
    for (int c = 0; c < 3; ++c)
      for (int l = 0; l < SONDE_LANES; ++l)
        lanes->box[k].low[c][l] = 1e30f, lanes->box[k].high[c][l] = -1e30f;
}

static void fill_slice(sonde_lanes *lanes, const sonde_model *model, uint32_t s) {
  uint32_t n = model->surface.vertex_count;
  sonde_slice_model *fixed = &lanes->model[s];
  sonde_slice_boxes *box = &lanes->box[s / SONDE_LANES];
  uint32_t own = s % SONDE_LANES;
  for (uint32_t l = 0; l < SONDE_LANES; ++l) {
    uint32_t i = s * SONDE_LANES + l;
    fixed->k0[l] = fixed->area[l] = 0;
    fixed->xm[l] = fixed->limit[l] = fixed->mass[l] = 1;
    for (int c = 0; c < 3; ++c) fixed->place[c][l] = 1e30f; // in no box
    if (i >= n) continue;
    sonde_vec3 normal = model->normal[i];
    fixed->normal[0][l] = (float)normal.x;
    fixed->normal[1][l] = (float)normal.y;
    fixed->normal[2][l] = (float)normal.z;
    fixed->area[l] = (float)model->area_m2[i];
    fill_springs(fixed, model, i);
    fixed->xm[l] = (float)model->xm_m[i];
    fixed->limit[l] = (float)(model->law.guard * model->xm_m[i]);
    fixed->mass[l] = (float)model->mass_kg[i];
    sonde_vec3 x = model->surface.vertices[i];
    const double at[3] = {x.x, x.y, x.z};
    for (int c = 0; c < 3; ++c) {
      float p, low;
      sonde_split(at[c], &p, &low);
      fixed->place[c][l] = p, fixed->place_low[c][l] = low;
      box->low[c][own] = fminf(box->low[c][own], p);
      box->high[c][own] = fmaxf(box->high[c][own], p);
    }
    const sonde_topology *t = &model->topology;
    for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k) {
      float rest = (float)model->edge_rest_m[t->neighbour_edge[k]];
      box->reach[own] = fmaxf(box->reach[own], rest);
      fixed->bend = fmaxf(fixed->bend, 1 / rest);
    }
    fixed->used = l + 1;
  }
}

static void fill_faces(sonde_lanes *lanes, const sonde_model *model) {
  for (uint32_t at = 0; at < model->surface.face_count; ++at) {
    uint32_t f = lanes->face_order[at], s = at / SONDE_LANES, l = at % SONDE_LANES;
    SONDE_ASSERT(s < lanes->face_slice_count);
    lanes->point_area[s][l] = (float)(model->face_area_m2[f] / SONDE_FACE_POINTS);
    for (int k = 0; k < 3; ++k) lanes->face[s][k][l] = (int32_t)model->surface.faces[f][k];
  }
}

// Adds value to the list that starts at first unless it is there; returns the new count.
static uint32_t add_once(uint32_t *list, uint32_t count, uint32_t value) {
  for (uint32_t k = 0; k < count; ++k)
    if (list[k] == value) return count;
  list[count] = value;
  return count + 1;
}

// Lists of one slice at the ends of `near` and `faces`, which may be NULL for counting: then the
// scratch lists are used.
static void list_near(sonde_lanes *lanes, const sonde_model *model, const uint32_t *place,
                      uint32_t s, uint32_t *near, uint32_t *faces) {
  const sonde_topology *t = &model->topology;
  sonde_slice_model *fixed = &lanes->model[s];
  fixed->near_count = fixed->face_count = 0;
  for (uint32_t i = s * SONDE_LANES; i < s * SONDE_LANES + fixed->used; ++i) {
    for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k)
      if (t->neighbour[k] / SONDE_LANES != s)
        fixed->near_count = add_once(near, fixed->near_count, t->neighbour[k] / SONDE_LANES);
    for (uint32_t k = t->face_start[i]; k < t->face_start[i + 1]; ++k)
      fixed->face_count = add_once(faces, fixed->face_count, place[t->face_list[k]] / SONDE_LANES);
  }
}

static sonde_lane_law law_of(const sonde_surface_law *law, const sonde_world_def *def) {
  double h = def->dt_s;
  bool layered = sonde_tissue_is_layered(law);
  return (sonde_lane_law){.springs =
                              law->edge_stiffness_n_m > 0 || law->edge_pretension_n > 0 || !layered,
                          .layered = layered,
                          .inplane = (float)law->inplane_stiffness_n_m,
                          .edge_stiffness = (float)law->edge_stiffness_n_m,
                          .edge_damper = (float)(law->edge_damping_s * law->edge_stiffness_n_m),
                          .edge_compression = (float)law->edge_compression,
                          .edge_pretension = (float)law->edge_pretension_n,
                          .tangential = (float)law->tangential_stiffness_n_m3,
                          .normal_damping_s = (float)law->normal_damping_s,
                          .shear = (float)law->shear_stiffness_n_m,
                          .exponent = (int)law->normal_exponent,
                          .dt = (float)h,
                          .stiffness_scale = (float)(h * h),
                          .damping_scale = (float)h};
}

// Sweeps carry a move from slice to slice; where springs outweigh masses they need many, and the
// springs turn under the first one's moves. The bound is mild: runs blew up from 400 on.
static bool is_stiff(const sonde_model *model, const sonde_lane_law *law) {
  const double most = 30;
  double mass = 0, coupling = (double)law->stiffness_scale *
                                  (double)(law->edge_stiffness + law->shear + law->inplane) +
                              (double)(law->damping_scale * law->edge_damper);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) mass += model->mass_kg[i];
  return 2 * model->topology.edge_count * coupling > most * mass;
}

void sonde_lanes_tune(sonde_lanes *lanes, const sonde_model *tuned, const sonde_world_def *def) {
  SONDE_ASSERT(lanes->node_count == tuned->surface.vertex_count);
  lanes->law = law_of(&tuned->law, def);
  lanes->stiff = is_stiff(tuned, &lanes->law);
  for (uint32_t i = 0; i < lanes->node_count; ++i)
    fill_springs(&lanes->model[i / SONDE_LANES], tuned, i);
  for (uint32_t k = 0; lanes->law.shear > 0 && k < lanes->slot_count; ++k)
    for (uint32_t l = 0; l < SONDE_LANES; ++l)
      if (lanes->slot_from[k][l] >= 0)
        fill_shear(&lanes->slot_face[k], tuned, (uint32_t)lanes->slot_from[k][l], l);
}

// Most neighbours or faces around a node.
static uint32_t most_around(const sonde_topology *t) {
  uint32_t most = 0;
  for (uint32_t i = 0; i < t->vertex_count; ++i) {
    uint32_t faces = t->face_start[i + 1] - t->face_start[i];
    most = valence(t, i) > most ? valence(t, i) : most;
    most = faces > most ? faces : most;
  }
  return most;
}

// Sizes that need a pass over the mesh: slots and lists per slice. lists: room for two of 16 nodes.
static void measure(sonde_lanes *lanes, const sonde_model *model, const uint32_t *place,
                    sonde_slice_model *sizes, uint32_t *lists, sonde_fan *fan) {
  const sonde_topology *t = &model->topology;
  size_t most = (size_t)most_around(t) * SONDE_LANES + 1;
  lanes->model = sizes;
  for (uint32_t i = 0; lanes->part_count > 1 && i < t->vertex_count; ++i)
    lanes->seen_count += is_seen(lanes, t, i);
  for (uint32_t s = 0; s < lanes->slice_count; ++s) {
    uint32_t left = t->vertex_count - s * SONDE_LANES;
    sizes[s].used = left < SONDE_LANES ? left : SONDE_LANES;
    sizes[s].first_slot = lanes->slot_count;
    sizes[s].slot_count = count_slots(model, lanes->law.layered, s, fan);
    list_near(lanes, model, place, s, lists, lists + most);
    sizes[s].first_near = lanes->near_total;
    sizes[s].first_face = lanes->face_total;
    lanes->slot_count += sizes[s].slot_count;
    lanes->near_total += sizes[s].near_count;
    lanes->face_total += sizes[s].face_count;
  }
}

static void fill(sonde_lanes *lanes, const sonde_model *model, const uint32_t *place,
                 const sonde_slice_model *sizes, sonde_fan *fan) {
  memcpy(lanes->model, sizes, lanes->slice_count * sizeof *sizes);
  empty_boxes(lanes);
  list_seen(lanes, &model->topology);
  for (uint32_t s = 0; s < lanes->slice_count; ++s) {
    const sonde_slice_model *fixed = &lanes->model[s];
    fill_slice(lanes, model, s);
    list_near(lanes, model, place, s, lanes->near + fixed->first_near,
              lanes->face_near + fixed->first_face);
    for (uint32_t l = 0; l < SONDE_LANES; ++l) fill_row(lanes, model, s * SONDE_LANES + l, fan);
  }
  fill_faces(lanes, model);
}

// The block starts at a multiple of 64, as vectors need.
static sonde_status allocate(sonde_lanes *lanes, uint32_t faces, sonde_error *error) {
  size_t bytes = carve(lanes, faces, NULL);
  lanes->block = sonde_calloc(1, bytes + 63);
  if (!lanes->block) return sonde_fail_memory(error);
  carve(lanes, faces, sonde_whole_lines(lanes->block));
  SONDE_ASSERT(((uintptr_t)lanes->slice & 63) == 0);
  return SONDE_OK;
}

// What laying out needs for itself.
typedef struct workshop {
  char *room; // sizes
  sonde_slice_model *sizes;
  uint32_t *place; // [faces] along the curve
  uint32_t *lists;
  sonde_fan fan;
} workshop;

static sonde_status open_workshop(workshop *shop, const sonde_model *model, uint32_t slices,
                                  const uint32_t *face_order, sonde_error *error) {
  size_t around = 2 * ((size_t)most_around(&model->topology) * SONDE_LANES + 1);
  uint32_t faces = model->surface.face_count;
  shop->room = sonde_calloc(slices + 1, sizeof(sonde_slice_model));
  shop->sizes = (void *)sonde_whole_lines(shop->room);
  shop->place = SONDE_NEW(uint32_t, faces);
  shop->lists = SONDE_NEW(uint32_t, around);
  shop->fan.node = SONDE_NEW(uint32_t, around);
  shop->fan.face = SONDE_NEW(uint32_t, around);
  if (!shop->room || !shop->place || !shop->lists || !shop->fan.node || !shop->fan.face)
    return sonde_fail_memory(error);
  for (uint32_t k = 0; k < faces; ++k) shop->place[face_order[k]] = k;
  return SONDE_OK;
}

static void close_workshop(workshop *shop) {
  sonde_free(shop->room);
  sonde_free(shop->place);
  sonde_free(shop->lists);
  sonde_free(shop->fan.node);
  sonde_free(shop->fan.face);
}

static void begin(sonde_lanes *lanes, const sonde_model *model, const sonde_world_def *def,
                  const uint32_t *face_order) {
  uint32_t n = model->surface.vertex_count, faces = model->surface.face_count;
  lanes->slice_count = vectors_of(n);
  lanes->face_slice_count = vectors_of(faces);
  lanes->part_count = n < SONDE_PART_NODES ? 1 : SONDE_PARTS;
  for (uint32_t k = 1; k <= SONDE_PARTS; ++k)
    lanes->part_slice[k] = k < lanes->part_count ? lanes->slice_count / 2 : lanes->slice_count;
  lanes->node_count = n;
  lanes->face_order = face_order;
  lanes->law = law_of(&model->law, def);
  lanes->stiff = is_stiff(model, &lanes->law);
  lanes->kernels = sonde_lane_kernels_find(NULL);
}

sonde_status sonde_lanes_create(const sonde_model *model, const sonde_world_def *def,
                                const uint32_t *face_order, sonde_lanes **out, sonde_error *error) {
  *out = NULL;
  workshop shop = {0};
  sonde_lanes *lanes = SONDE_NEW(sonde_lanes, 1);
  if (!lanes) return sonde_fail_memory(error);
  begin(lanes, model, def, face_order);
  sonde_status status = SONDE_OK;
  if (def->threads > 1 && lanes->part_count > 1) status = sonde_crew_create(&lanes->crew, error);
  if (!status) status = open_workshop(&shop, model, lanes->slice_count, face_order, error);
  if (!status) {
    measure(lanes, model, shop.place, shop.sizes, shop.lists, &shop.fan);
    status = allocate(lanes, model->surface.face_count, error);
  }
  if (!status) {
    fill(lanes, model, shop.place, shop.sizes, &shop.fan);
    *out = lanes;
  } else {
    sonde_lanes_destroy(lanes);
  }
  close_workshop(&shop);
  return status;
}

void sonde_lanes_destroy(sonde_lanes *lanes) {
  if (!lanes) return;
  sonde_crew_destroy(lanes->crew);
  sonde_free(lanes->block);
  sonde_free(lanes);
}

void sonde_lanes_record(sonde_lanes *lanes, uint32_t i) {
  const sonde_slice *at = &lanes->slice[i / SONDE_LANES];
  const sonde_slice_model *fixed = &lanes->model[i / SONDE_LANES];
  uint32_t l = i % SONDE_LANES;
  float ue[3], normal[3];
  for (int c = 0; c < 3; ++c) {
    ue[c] = at->u[c][l] + lanes->law.dt * at->ve[c][l];
    normal[c] = fixed->normal[c][l] * ue[c];
  }
  for (int c = 0; lanes->law.springs && c < 3; ++c) {
    lanes->record[(size_t)i * SONDE_RECORD + (size_t)c] = ue[c];
    lanes->record[(size_t)i * SONDE_RECORD + 3 + (size_t)c] = at->ve[c][l];
  }
  if (!lanes->law.layered) return;
  float indentation = -(normal[0] + normal[1] + normal[2]);
  float *slide = lanes->slide + (size_t)i * SONDE_RECORD;
  for (int c = 0; c < 3; ++c) slide[c] = ue[c] + indentation * fixed->normal[c][l];
  slide[3] = indentation;
  slide[4] = 0;
}

static void import_slice(sonde_lanes *lanes, uint32_t s, const sonde_vec3 *rest,
                         const sonde_vec3 *position, const sonde_vec3 *velocity) {
  sonde_slice *at = &lanes->slice[s];
  SONDE_ASSERT(s < lanes->slice_count);
  memset(at, 0, sizeof *at);
  lanes->speed2[s] = lanes->way2[s] = 0;
  for (uint32_t l = 0; l < lanes->model[s].used; ++l) {
    uint32_t i = s * SONDE_LANES + l;
    sonde_vec3 u = v_sub(position[i], rest[i]), v = velocity[i];
    const double motion[6] = {u.x, u.y, u.z, v.x, v.y, v.z};
    for (int c = 0; c < 3; ++c) {
      at->u[c][l] = (float)motion[c];
      at->v[c][l] = at->ve[c][l] = (float)motion[3 + c];
    }
    sonde_lanes_record(lanes, i);
    lanes->speed2[s] = fmaxf(lanes->speed2[s], (float)v_norm2(v));
    lanes->way2[s] = fmaxf(lanes->way2[s], (float)v_norm2(u));
  }
}

void sonde_lanes_still(sonde_lanes *lanes, uint32_t first, uint32_t count) {
  const size_t quads = SONDE_LANES * SONDE_QUAD;
  SONDE_ASSERT(first + count <= lanes->slice_count);
  memset(lanes->direction + first * quads, 0, count * quads * sizeof(float));
  if (lanes->law.layered)
    memset(lanes->layer_direction + first * quads, 0, count * quads * sizeof(float));
}

void sonde_lanes_import(sonde_lanes *lanes, const sonde_vec3 *rest, const sonde_vec3 *position,
                        const sonde_vec3 *velocity, bool awake) {
  sonde_lanes_still(lanes, 0, lanes->slice_count);
  for (uint32_t s = 0; s < lanes->slice_count; ++s) {
    import_slice(lanes, s, rest, position, velocity);
    lanes->is_awake[s] = awake;
    lanes->calm[s] = 0;
    lanes->published[s] = 1;
  }
  lanes->stale = false;
}

void sonde_lanes_publish(sonde_lanes *lanes, const sonde_vec3 *rest, sonde_vec3 *position,
                         sonde_vec3 *velocity) {
  for (uint32_t s = 0; s < lanes->slice_count; ++s) {
    if (lanes->published[s]) continue;
    const sonde_slice *at = &lanes->slice[s];
    for (uint32_t l = 0; l < lanes->model[s].used; ++l) {
      uint32_t i = s * SONDE_LANES + l;
      position[i] = v_add(rest[i], sonde_lane_vector(at->u, l));
      velocity[i] = sonde_lane_vector(at->v, l);
    }
    lanes->published[s] = 1;
  }
}

const sonde_lane_kernels *sonde_lane_kernels_find(const char *name) {
  const sonde_lane_kernels *known[] = {
#ifdef __x86_64__
      &sonde_lane_kernels_avx512, &sonde_lane_kernels_avx2,
#endif
      &sonde_lane_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (sonde_vectors_serve(known[k]->name, name)) return known[k];
  return NULL;
}
