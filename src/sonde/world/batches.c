// Layout of a model in batches for an engine; cold but for the functions marked as of the tick.
#include "world/batches.h"

#include "tissue/two_layer.h"
#include "world/second_thread.h"
#include "world/fan.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/vector.h"

#include <string.h>

// Of face_marked.
static size_t mark_words(const sonde_batches *l) { return l->face_batch_count / 64 + 1; }

static real upper(real a, real b) { return b > a ? b : a; }

// Vectors for so many numbers.
static uint32_t vectors_of(uint32_t count) { return (count + SONDE_BATCH - 1) / SONDE_BATCH; }

#define CARVE(field, count) (l->field = sonde_carve(base, &offset, (count), sizeof *l->field))

static size_t carve(sonde_batches *l, uint32_t faces, char *base) {
  uint32_t batches = l->common.batch_count, face_batches = l->face_batch_count;
  uint32_t layers = l->law.layered ? l->slot_count : 0, groups = vectors_of(batches);
  bool searches = sizeof(real) == sizeof(double);
  size_t offset = 0, rows = (size_t)batches * SONDE_BATCH, seen = rows + l->seen_count;
  CARVE(model, batches), CARVE(box, groups), CARVE(batch, batches);
  CARVE(base, searches ? batches : 0), CARVE(free, searches ? batches : 0);
  CARVE(slot, l->slot_count), CARVE(tangent, l->slot_count), CARVE(share, l->slot_count);
  CARVE(slot_layer, layers), CARVE(slot_face, layers), CARVE(slot_from, layers);
  CARVE(contact, batches), CARVE(contact_of, batches), CARVE(contact_batch, batches);
  CARVE(face, face_batches), CARVE(point_area, face_batches);
  CARVE(near, l->near_total), CARVE(face_near, l->face_total);
  CARVE(record, l->law.springs ? seen * SONDE_RECORD : 0), CARVE(direction, seen * SONDE_QUAD);
  CARVE(slide, l->law.layered ? seen * SONDE_RECORD : 0);
  CARVE(layer_direction, l->law.layered ? seen * SONDE_QUAD : 0);
  CARVE(seen, l->seen_count), CARVE(seen_at, l->seen_count > 0 ? rows : 0);
  CARVE(awake, batches), CARVE(common.is_awake, batches), CARVE(common.calm, batches);
  CARVE(face_marked, mark_words(l)), CARVE(face_code, face_batches);
  CARVE(is_near, batches), CARVE(near_list, batches);
  CARVE(speed2, groups * SONDE_BATCH), CARVE(moved2, groups * SONDE_BATCH);
  CARVE(unrest2, batches), CARVE(common.published, batches), CARVE(touched_rows, batches);
  CARVE(near_probe, batches), CARVE(near_code, batches);
  CARVE(probe_place, rows * SONDE_QUAD), CARVE(probe_motion, rows * SONDE_QUAD);
  CARVE(probe_move, rows * SONDE_QUAD);
  CARVE(probe.plane, SONDE_MAX_PROBE_PLANES), CARVE(probe.slope, SONDE_MAX_PROBE_PLANES);
  CARVE(pushed, batches > face_batches ? batches : face_batches);
  CARVE(push_corners, 1), CARVE(advance_corners, 1);
  CARVE(coupling, SONDE_FACE_POINTS * (size_t)faces / SONDE_BATCH + 1);
  CARVE(region_row, l->common.node_count), CARVE(region_weight, l->common.node_count);
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
    sonde_fan_find(model, i, fan);
    return;
  }
  for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k)
    fan->node[fan->count++] = t->neighbour[k];
}

// Which part a row belongs to.
static uint32_t part_of(const sonde_batches *body, uint32_t row) {
  return body->part_count > 1 && row / SONDE_BATCH >= body->part_batch[1];
}

static bool is_seen(const sonde_batches *body, const sonde_topology *t, uint32_t i) {
  for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k)
    if (part_of(body, t->neighbour[k]) != part_of(body, i)) return true;
  return false;
}

// Where row i reads what row j has published.
static whole seen_from(const sonde_batches *body, uint32_t i, uint32_t j) {
  return (whole)(part_of(body, i) == part_of(body, j) ? j : body->seen_at[j]);
}

// The spring to the neighbour of slot k; one that has a slot already has no spring here.
static void fill_spring(sonde_batches *body, const sonde_model *model, uint32_t i, uint32_t k,
                        const sonde_fan *fan) {
  uint32_t l = i % SONDE_BATCH;
  sonde_batch_model *fixed = &body->model[i / SONDE_BATCH];
  sonde_slot *slot = &body->slot[fixed->first_slot + k];
  bool used = k < fan->count;
  uint32_t j = used ? fan->node[k] : i;
  sonde_vec3 d = vec3(1, 0, 0);
  double length = 1, share = used;
  if (used) {
    const sonde_topology *t = &model->topology;
    uint32_t at = t->start[i];
    while (at < t->start[i + 1] && t->neighbour[at] != j) ++at;
    SONDE_ASSERT(at < t->start[i + 1]);
    uint32_t e = t->neighbour_edge[at];
    if (model->edge_share) share = model->edge_share[e];
    d = v_sub(model->surface.vertices[j], model->surface.vertices[i]);
    length = model->edge_rest_m[e];
  }
  for (uint32_t before = 0; used && before < k; ++before)
    if (fan->node[before] == j) share = 0;
  body->tangent[fixed->first_slot + k].node[l] = seen_from(body, i, j);
  slot->rest[0][l] = (real)d.x, slot->rest[1][l] = (real)d.y, slot->rest[2][l] = (real)d.z;
  slot->length[l] = (real)length;
  body->share[fixed->first_slot + k][l] = (real)share;
  if (share != 1 && k < fixed->whole_count) fixed->whole_count = k;
}

static void fill_shear(sonde_slot_face *slot, const sonde_model *model, uint32_t f, uint32_t lane) {
  double shear, limit;
  sonde_tissue_face_law(model, f, &shear, &limit);
  slot->shear[lane] = (real)shear;
  slot->bend[lane] = shear > 0 ? (real)(1 / (limit * limit * model->face_area_m2[f])) : 0;
}

// Both layers in slot k, whose face also weighs on the slot before.
static void fill_layers(sonde_batches *body, const sonde_model *model, uint32_t i, uint32_t k,
                        const sonde_fan *fan) {
  uint32_t l = i % SONDE_BATCH, f = k < fan->count ? fan->face[k] : SONDE_NO_FACE;
  sonde_batch_model *fixed = &body->model[i / SONDE_BATCH];
  sonde_slot_layer *layer = &body->slot_layer[fixed->first_slot + k];
  body->slot_from[fixed->first_slot + k][l] = f == SONDE_NO_FACE ? -1 : (whole)f;
  layer->node[l] = seen_from(body, i, k < fan->count ? fan->node[k] : i);
  if (f == SONDE_NO_FACE) return;
  const uint32_t *v = model->surface.faces[f];
  uint32_t own = v[0] == i ? 0 : v[1] == i ? 1 : 2;
  sonde_slot_face *slot = &body->slot_face[fixed->first_slot + k];
  for (uint32_t c = 0; c < 3; ++c)
    slot->cot[c][l] = (real)model->face_half_cotangent[f][(own + c) % 3];
  fill_shear(slot, model, f, l);
  layer->weight[l] += slot->cot[1][l];
  sonde_slot_layer *before = &body->slot_layer[fixed->first_slot + (k > 0 ? k : fan->turn) - 1];
  before->weight[l] += slot->cot[2][l];
  fixed->weight[l] += slot->cot[1][l] + slot->cot[2][l];
}

static void fill_row(sonde_batches *body, const sonde_model *model, uint32_t i, sonde_fan *fan) {
  uint32_t l = i % SONDE_BATCH;
  sonde_batch_model *fixed = &body->model[i / SONDE_BATCH];
  order_slots(model, body->law.layered, i, fan);
  fixed->last[l] = seen_from(body, i, fan->last);
  fixed->turn[l] = (whole)fan->turn;
  if (l == 0) fixed->whole_count = fixed->slot_count;
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    fill_spring(body, model, i, k, fan);
    if (body->law.layered) fill_layers(body, model, i, k, fan);
  }
}

static void fill_springs(sonde_batch_model *fixed, const sonde_model *model, uint32_t i) {
  double tangent = model->law.tangential_stiffness_n_m3, k0 = model->k0_n_m3[i];
  uint32_t l = i % SONDE_BATCH;
  fixed->k0[l] = (real)k0;
  fixed->yield[l] = (real)(1 / (model->area_m2[i] * (tangent > 0 ? fmin(tangent, k0) : k0)));
}

static void fill_batch(sonde_batches *body, const sonde_model *model, uint32_t s) {
  uint32_t n = model->surface.vertex_count;
  sonde_batch_model *fixed = &body->model[s];
  sonde_batch_boxes *box = &body->box[s / SONDE_BATCH];
  uint32_t own = s % SONDE_BATCH;
  for (uint32_t l = 0; l < SONDE_BATCH; ++l) {
    uint32_t i = s * SONDE_BATCH + l;
    fixed->k0[l] = fixed->area[l] = 0;
    fixed->xm[l] = fixed->limit[l] = fixed->mass[l] = 1;
    for (int c = 0; c < 3; ++c) fixed->place[c][l] = (real)1e30; // in no box
    if (i >= n) continue;
    sonde_vec3 normal = model->normal[i];
    fixed->normal[0][l] = (real)normal.x;
    fixed->normal[1][l] = (real)normal.y;
    fixed->normal[2][l] = (real)normal.z;
    fixed->area[l] = (real)model->area_m2[i];
    fill_springs(fixed, model, i);
    fixed->xm[l] = (real)model->xm_m[i];
    fixed->limit[l] = (real)(model->law.guard * model->xm_m[i]);
    fixed->mass[l] = (real)model->mass_kg[i];
    sonde_vec3 x = model->surface.vertices[i];
    const double at[3] = {x.x, x.y, x.z};
    for (int c = 0; c < 3; ++c) {
      real p, low;
      sonde_split(at[c], &p, &low);
      fixed->place[c][l] = p, fixed->place_low[c][l] = low;
      if (p < box->low[c][own]) box->low[c][own] = p;
      box->high[c][own] = upper(box->high[c][own], p);
    }
    const sonde_topology *t = &model->topology;
    for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k) {
      real rest = (real)model->edge_rest_m[t->neighbour_edge[k]];
      box->reach[own] = upper(box->reach[own], rest);
      fixed->bend = upper(fixed->bend, 1 / rest);
    }
    fixed->used = l + 1;
  }
}

// Adds value to the list that starts at first unless it is there; returns the new count.
static uint32_t add_once(uint32_t *list, uint32_t count, uint32_t value) {
  for (uint32_t k = 0; k < count; ++k)
    if (list[k] == value) return count;
  list[count] = value;
  return count + 1;
}

// Lists of one batch at the ends of `near` and `faces`, which may be NULL for counting: then the
// scratch lists are used.
static void list_near(sonde_batches *body, const sonde_model *model, const uint32_t *place,
                      uint32_t s, uint32_t *near, uint32_t *faces) {
  const sonde_topology *t = &model->topology;
  sonde_batch_model *fixed = &body->model[s];
  fixed->near_count = fixed->face_count = 0;
  for (uint32_t i = s * SONDE_BATCH; i < s * SONDE_BATCH + fixed->used; ++i) {
    for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k)
      if (t->neighbour[k] / SONDE_BATCH != s)
        fixed->near_count = add_once(near, fixed->near_count, t->neighbour[k] / SONDE_BATCH);
    for (uint32_t k = t->face_start[i]; k < t->face_start[i + 1]; ++k)
      fixed->face_count = add_once(faces, fixed->face_count, place[t->face_list[k]] / SONDE_BATCH);
  }
}

// The unknown is the change of ve = v + lambda dv, or, explicit, dv itself (docs/world.md).
void sonde_batches_set_law(sonde_batches *body, const sonde_surface_law *law,
                           const sonde_world_def *def) {
  double h = def->dt_s, lambda = def->implicitness;
  bool layered = sonde_tissue_is_layered(law);
  body->law = (sonde_batch_law){
      .springs = law->edge_stiffness_n_m > 0 || law->edge_pretension_n > 0 || !layered,
      .layered = layered,
      .inplane = (real)law->inplane_stiffness_n_m,
      .shear = (real)law->shear_stiffness_n_m,
      .edge = {(real)law->edge_stiffness_n_m, (real)(law->edge_damping_s * law->edge_stiffness_n_m),
               (real)law->edge_compression, (real)law->edge_pretension_n},
      .anchor = {(int)law->normal_exponent, (real)law->tangential_stiffness_n_m3,
                 (real)law->normal_damping_s},
      .dt = (real)h,
      .lambda = (real)lambda,
      .reach = (real)(lambda * h),
      .force_scale = (real)h,
      .mass_scale = (real)(lambda > 0 ? 1 / lambda : 1),
      .damping_scale = (real)(lambda > 0 ? h : 0),
      .stiffness_scale = (real)(lambda * h * h)};
}

// Sweeps carry a move from batch to batch; where springs outweigh masses they need many, and the
// springs turn under the first one's moves. The bound is mild: runs blew up from 400 on.
static bool is_stiff(const sonde_model *model, const sonde_batch_law *law) {
  const double most = 30;
  double mass = 0, coupling = (double)law->stiffness_scale *
                                  (double)(law->edge.stiffness + law->shear + law->inplane) +
                              (double)(law->damping_scale * law->edge.damper);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) mass += model->mass_kg[i];
  return 2 * model->topology.edge_count * coupling > most * mass;
}

static void set_step(sonde_batches *body, const sonde_model *model, const sonde_world_def *def) {
  sonde_batches_set_law(body, &model->law, def);
  body->by_gradients = SONDE_BATCH == 8 || is_stiff(model, &body->law);
}

// @thread tick
static void tune(sonde_engine_data *data, const sonde_model *tuned, const sonde_world_def *def) {
  sonde_batches *body = (sonde_batches *)(void *)data;
  SONDE_ASSERT(data->node_count == tuned->surface.vertex_count);
  set_step(body, tuned, def);
  for (uint32_t i = 0; i < data->node_count; ++i)
    fill_springs(&body->model[i / SONDE_BATCH], tuned, i);
  for (uint32_t k = 0; body->law.shear > 0 && k < body->slot_count; ++k)
    for (uint32_t l = 0; l < SONDE_BATCH; ++l)
      if (body->slot_from[k][l] >= 0)
        fill_shear(&body->slot_face[k], tuned, (uint32_t)body->slot_from[k][l], l);
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

// Sizes that need a pass over the mesh: slots and lists per batch. lists: room for two of one
// batch.
static void measure(sonde_batches *body, const sonde_model *model, const uint32_t *place,
                    sonde_batch_model *sizes, uint32_t *lists, sonde_fan *fan) {
  const sonde_topology *t = &model->topology;
  size_t most = (size_t)most_around(t) * SONDE_BATCH + 1;
  body->model = sizes;
  for (uint32_t i = 0; body->part_count > 1 && i < t->vertex_count; ++i)
    body->seen_count += is_seen(body, t, i);
  for (uint32_t s = 0; s < body->common.batch_count; ++s) {
    uint32_t left = t->vertex_count - s * SONDE_BATCH;
    sizes[s].used = left < SONDE_BATCH ? left : SONDE_BATCH;
    sizes[s].first_slot = body->slot_count;
    for (uint32_t l = 0; l < SONDE_BATCH; ++l) {
      order_slots(model, body->law.layered, s * SONDE_BATCH + l, fan);
      if (fan->count > sizes[s].slot_count) sizes[s].slot_count = fan->count;
    }
    list_near(body, model, place, s, lists, lists + most);
    sizes[s].first_near = body->near_total;
    sizes[s].first_face = body->face_total;
    body->slot_count += sizes[s].slot_count;
    body->near_total += sizes[s].near_count;
    body->face_total += sizes[s].face_count;
  }
}

static void fill(sonde_batches *body, const sonde_model *model, const uint32_t *place,
                 const sonde_batch_model *sizes, sonde_fan *fan) {
  memcpy(body->model, sizes, body->common.batch_count * sizeof *sizes);
  for (uint32_t k = 0; k < vectors_of(body->common.batch_count); ++k)
    for (int c = 0; c < 3; ++c)
      body->box[k].low[c] = all((real)1e30), body->box[k].high[c] = all(-(real)1e30);
  // Rows that the other part sees; those of the last part, which the first one sees, come last.
  uint32_t count = 0, half = 0;
  for (uint32_t i = 0; body->seen_count > 0 && i < model->surface.vertex_count; ++i) {
    if (!is_seen(body, &model->topology, i)) continue;
    half += part_of(body, i) == 0;
    body->seen[count] = i;
    body->seen_at[i] = body->common.batch_count * SONDE_BATCH + count++;
  }
  SONDE_ASSERT(count == body->seen_count);
  body->part_seen[1] = half, body->part_seen[2] = count;
  for (uint32_t s = 0; s < body->common.batch_count; ++s) {
    const sonde_batch_model *fixed = &body->model[s];
    fill_batch(body, model, s);
    list_near(body, model, place, s, body->near + fixed->first_near,
              body->face_near + fixed->first_face);
    for (uint32_t l = 0; l < SONDE_BATCH; ++l) fill_row(body, model, s * SONDE_BATCH + l, fan);
  }
  // Faces in batches, for the contact.
  for (uint32_t at = 0; at < model->surface.face_count; ++at) {
    uint32_t f = body->face_order[at], s = at / SONDE_BATCH, l = at % SONDE_BATCH;
    body->point_area[s][l] = (real)(model->face_area_m2[f] / SONDE_FACE_POINTS);
    for (int k = 0; k < 3; ++k) body->face[s][k][l] = (whole)model->surface.faces[f][k];
  }
}

// What laying out needs for itself.
typedef struct workshop {
  char *room; // sizes
  sonde_batch_model *sizes;
  uint32_t *place; // [faces] along the curve
  uint32_t *lists;
  sonde_fan fan;
} workshop;

static sonde_status open_workshop(workshop *shop, const sonde_model *model, uint32_t batches,
                                  const uint32_t *face_order, sonde_error *error) {
  size_t around = 2 * ((size_t)most_around(&model->topology) * SONDE_BATCH + 1);
  uint32_t faces = model->surface.face_count;
  shop->room = sonde_calloc(batches + 1, sizeof(sonde_batch_model));
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

static void destroy(sonde_engine_data *data) {
  sonde_batches *body = (sonde_batches *)(void *)data;
  if (!body) return;
  sonde_second_thread_destroy(body->thread);
  sonde_free(body->block);
  sonde_free(body);
}

static sonde_status create(const sonde_model *model, const sonde_world_def *def,
                           const uint32_t *face_order, sonde_engine_data **data,
                           sonde_error *error) {
  uint32_t n = model->surface.vertex_count, faces = model->surface.face_count;
  *data = NULL;
  workshop shop = {0};
  sonde_batches *body = SONDE_NEW(sonde_batches, 1);
  if (!body) return sonde_fail_memory(error);
  body->common.calls = &BY_REAL(sonde_engine);
  body->common.node_count = n;
  body->common.batch_count = vectors_of(n);
  body->face_batch_count = vectors_of(faces);
  body->face_order = face_order;
  body->part_count = n < SONDE_PART_NODES ? 1 : SONDE_PARTS;
  for (uint32_t k = 1; k <= SONDE_PARTS; ++k)
    body->part_batch[k] =
        k < body->part_count ? body->common.batch_count / 2 : body->common.batch_count;
  set_step(body, model, def);
  body->kernels = sonde_kernels_find(NULL);
  sonde_status status = SONDE_OK;
  if (def->threads > 1 && body->part_count > 1)
    status = sonde_second_thread_create(&body->thread, error);
  if (!status) status = open_workshop(&shop, model, body->common.batch_count, face_order, error);
  if (!status) {
    measure(body, model, shop.place, shop.sizes, shop.lists, &shop.fan);
    // The block starts at a multiple of 64, as vectors need.
    body->block = sonde_calloc(1, carve(body, faces, NULL) + 63);
    if (!body->block) status = sonde_fail_memory(error);
  }
  if (!status) {
    carve(body, faces, sonde_whole_lines(body->block));
    SONDE_ASSERT(((uintptr_t)body->batch & 63) == 0);
    fill(body, model, shop.place, shop.sizes, &shop.fan);
    body->common.batch_nodes = SONDE_BATCH;
    body->common.batches = (char *)body->batch;
    body->common.batch_bytes = sizeof *body->batch;
    body->common.motion_bytes = offsetof(sonde_batch, factor);
    body->common.real_bytes = sizeof(real);
    body->common.speed2 = body->speed2, body->common.moved2 = body->moved2;
    *data = &body->common;
  } else {
    destroy(&body->common);
  }
  sonde_free(shop.room);
  sonde_free(shop.place);
  sonde_free(shop.lists);
  sonde_free(shop.fan.node);
  sonde_free(shop.fan.face);
  return status;
}

void sonde_batches_record(sonde_batches *body, uint32_t i) {
  const sonde_batch *at = &body->batch[i / SONDE_BATCH];
  const sonde_batch_model *fixed = &body->model[i / SONDE_BATCH];
  uint32_t l = i % SONDE_BATCH;
  real ue[3], normal[3];
  for (int c = 0; c < 3; ++c) {
    ue[c] = at->u[c][l] + body->law.reach * at->ve[c][l];
    normal[c] = fixed->normal[c][l] * ue[c];
  }
  for (int c = 0; body->law.springs && c < 3; ++c) {
    body->record[(size_t)i * SONDE_RECORD + (size_t)c] = ue[c];
    body->record[(size_t)i * SONDE_RECORD + 3 + (size_t)c] = at->ve[c][l];
  }
  if (!body->law.layered) return;
  real indentation = -(normal[0] + normal[1] + normal[2]);
  real *slide = body->slide + (size_t)i * SONDE_RECORD;
  for (int c = 0; c < 3; ++c) slide[c] = ue[c] + indentation * fixed->normal[c][l];
  slide[3] = indentation;
  slide[4] = 0;
}

void sonde_batches_still(sonde_batches *body, uint32_t first, uint32_t count) {
  const size_t quads = SONDE_BATCH * SONDE_QUAD;
  SONDE_ASSERT(first + count <= body->common.batch_count);
  memset(body->direction + first * quads, 0, count * quads * sizeof(real));
  if (body->law.layered)
    memset(body->layer_direction + first * quads, 0, count * quads * sizeof(real));
}

// @thread tick
static void import(sonde_engine_data *data, const sonde_vec3 *rest, const sonde_vec3 *position,
                   const sonde_vec3 *velocity, bool awake) {
  sonde_batches *body = (sonde_batches *)(void *)data;
  sonde_batches_still(body, 0, data->batch_count);
  for (uint32_t s = 0; s < data->batch_count; ++s) {
    sonde_batch *at = &body->batch[s];
    memset(at, 0, sizeof *at);
    body->speed2[s] = body->moved2[s] = 0;
    for (uint32_t l = 0; l < body->model[s].used; ++l) {
      uint32_t i = s * SONDE_BATCH + l;
      sonde_vec3 u = v_sub(position[i], rest[i]), v = velocity[i];
      const double motion[6] = {u.x, u.y, u.z, v.x, v.y, v.z};
      for (int c = 0; c < 3; ++c) {
        at->u[c][l] = (real)motion[c];
        at->v[c][l] = at->ve[c][l] = (real)motion[3 + c];
      }
      sonde_batches_record(body, i);
      body->speed2[s] = upper(body->speed2[s], (real)v_norm2(v));
      body->moved2[s] = upper(body->moved2[s], (real)v_norm2(u));
    }
    data->is_awake[s] = awake;
    data->calm[s] = 0;
    data->published[s] = 1;
  }
  data->stale = false;
}

// @thread tick
static void publish(sonde_engine_data *data, const sonde_vec3 *rest, sonde_vec3 *position,
                    sonde_vec3 *velocity) {
  const sonde_batches *body = (const sonde_batches *)(const void *)data;
  for (uint32_t s = 0; s < data->batch_count; ++s) {
    if (data->published[s]) continue;
    const sonde_batch *at = &body->batch[s];
    for (uint32_t l = 0; l < body->model[s].used; ++l) {
      uint32_t i = s * SONDE_BATCH + l;
      position[i] = v_add(rest[i], sonde_batch_vector(at->u, l));
      velocity[i] = sonde_batch_vector(at->v, l);
    }
    data->published[s] = 1;
  }
}

static void refresh(sonde_engine_data *data) {
  sonde_batches *body = (sonde_batches *)(void *)data;
  sonde_batches_still(body, 0, data->batch_count);
  for (uint32_t i = 0; i < data->batch_count * SONDE_BATCH; ++i) sonde_batches_record(body, i);
}

const sonde_kernels *sonde_kernels_find(const char *name) {
  const sonde_kernels *known[] = {
#ifdef __x86_64__
      &sonde_kernels_avx512, &sonde_kernels_avx2,
#endif
      &sonde_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (sonde_vectors_serve(known[k]->name, name)) return known[k];
  return NULL;
}

const sonde_engine_calls BY_REAL(sonde_engine) = {
    create, destroy, tune, import, publish, refresh, BY_REAL(sonde_batches_step)};
