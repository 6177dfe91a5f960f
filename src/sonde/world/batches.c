// Layout of a body in batches for an engine; cold but for the functions marked as of the tick.
#include "world/batches.h"

#include "world/models.h"
#include "world/second_thread.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/vector.h"

#include <string.h>

// In the order of sonde_family.
static const sonde_model_kernels models[] = {
#ifdef __x86_64__
#define X(model)                                                                                   \
  {&BY_REAL(sonde_##model##_calls),                                                                \
   {&SONDE_KERNELS_OF(model, avx512), &SONDE_KERNELS_OF(model, avx2),                              \
    &SONDE_KERNELS_OF(model, base)}},
#else
#define X(model) {&BY_REAL(sonde_##model##_calls), {&SONDE_KERNELS_OF(model, base)}},
#endif
    SONDE_MODELS(X)
#undef X
};

static real upper(real a, real b) { return b > a ? b : a; }

#define CARVE(field, count) (l->field = sonde_carve(base, &offset, (count), sizeof *l->field))

static size_t carve(sonde_batches *l, uint32_t faces, char *base) {
  uint32_t batches = l->common.batch_count, face_batches = l->face_batch_count;
  uint32_t groups = sonde_vectors_of(batches);
  bool searches = sizeof(real) == sizeof(double);
  // One more row than is published stays still.
  size_t offset = 0, rows = (size_t)batches * SONDE_BATCH, seen = rows + l->seen_count + 1;
  CARVE(rows, batches), CARVE(box, groups), CARVE(batch, batches);
  CARVE(base, searches ? batches : 0), CARVE(free, searches ? batches : 0);
  CARVE(contact, batches), CARVE(contact_of, batches), CARVE(contact_batch, batches);
  CARVE(face, face_batches), CARVE(point_area, face_batches);
  CARVE(near, l->near_total), CARVE(face_near, l->face_total);
  CARVE(place, seen * SONDE_RECORD), CARVE(direction, seen * SONDE_QUAD);
  CARVE(seen, l->seen_count), CARVE(seen_at, l->seen_count > 0 ? rows : 0);
  CARVE(awake, batches), CARVE(common.is_awake, batches), CARVE(common.calm, batches);
  CARVE(face_marked, l->face_batch_count / 64 + 1), CARVE(face_code, face_batches);
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

static sonde_layout layout_of(const sonde_batches *body) {
  return (sonde_layout){.nodes = body->nodes,
                        .batch_count = body->common.batch_count,
                        .part_count = body->part_count,
                        .seen_count = body->seen_count,
                        .part_batch = body->part_batch,
                        .seen_at = body->seen_at};
}

static bool is_seen(const sonde_batches *body, uint32_t i) {
  const sonde_layout layout = layout_of(body);
  const sonde_nodes *nodes = &body->nodes;
  for (uint32_t k = nodes->start[i]; k < nodes->start[i + 1]; ++k)
    if (sonde_part_of(&layout, nodes->neighbour[k]) != sonde_part_of(&layout, i)) return true;
  return false;
}

static void fill_batch(sonde_batches *body, uint32_t s) {
  const sonde_nodes *nodes = &body->nodes;
  sonde_rows *rows = &body->rows[s];
  sonde_batch_boxes *box = &body->box[s / SONDE_BATCH];
  uint32_t own = s % SONDE_BATCH;
  for (uint32_t l = 0; l < SONDE_BATCH; ++l) {
    uint32_t i = s * SONDE_BATCH + l;
    rows->mass[l] = 1;
    for (int c = 0; c < 3; ++c) rows->place[c][l] = (real)1e30; // in no box
    if (i >= nodes->count) continue;
    rows->area[l] = (real)nodes->area_m2[i];
    rows->mass[l] = (real)nodes->mass_kg[i];
    sonde_vec3 x = nodes->rest[i];
    const double at[3] = {x.x, x.y, x.z};
    for (int c = 0; c < 3; ++c) {
      real p, low;
      sonde_split(at[c], &p, &low);
      rows->place[c][l] = p, rows->place_low[c][l] = low;
      if (p < box->low[c][own]) box->low[c][own] = p;
      box->high[c][own] = upper(box->high[c][own], p);
    }
    for (uint32_t k = nodes->start[i]; k < nodes->start[i + 1]; ++k) {
      real rest = (real)v_norm(v_sub(nodes->rest[nodes->neighbour[k]], x));
      box->reach[own] = upper(box->reach[own], rest);
    }
    rows->used = l + 1;
  }
}

// Adds value to the list that starts at first unless it is there; returns the new count.
static uint32_t add_once(uint32_t *list, uint32_t count, uint32_t value) {
  for (uint32_t k = 0; k < count; ++k)
    if (list[k] == value) return count;
  list[count] = value;
  return count + 1;
}

// Lists of one batch at the ends of `near` and `faces`, which may be scratch for counting. `place`:
// of a face along the curve.
static void list_near(sonde_batches *body, const sonde_topology *t, const uint32_t *place,
                      uint32_t s, uint32_t *near, uint32_t *faces, sonde_rows *rows) {
  const sonde_nodes *nodes = &body->nodes;
  rows->near_count = rows->face_count = 0;
  for (uint32_t i = s * SONDE_BATCH; i < s * SONDE_BATCH + rows->used; ++i) {
    for (uint32_t k = nodes->start[i]; k < nodes->start[i + 1]; ++k)
      if (nodes->neighbour[k] / SONDE_BATCH != s)
        rows->near_count = add_once(near, rows->near_count, nodes->neighbour[k] / SONDE_BATCH);
    for (uint32_t k = i < t->vertex_count ? t->face_start[i] : 0;
         i < t->vertex_count && k < t->face_start[i + 1]; ++k)
      rows->face_count = add_once(faces, rows->face_count, place[t->face_list[k]] / SONDE_BATCH);
  }
}

// The unknown is the change of ve = v + lambda dv, or, explicit, dv itself (docs/world.md).
void sonde_batches_set_step(sonde_batches *body, const sonde_world_def *def) {
  double h = def->dt_s, lambda = def->implicitness;
  body->step = (sonde_step_scales){.dt = (real)h,
                                   .lambda = (real)lambda,
                                   .reach = (real)(lambda * h),
                                   .force_scale = (real)h,
                                   .mass_scale = (real)(lambda > 0 ? 1 / lambda : 1),
                                   .damping_scale = (real)(lambda > 0 ? h : 0),
                                   .stiffness_scale = (real)(lambda * h * h)};
}

// @thread tick
static void tune(sonde_engine_data *data, const sonde_model *tuned, const sonde_world_def *def) {
  sonde_batches *body = (sonde_batches *)(void *)data;
  SONDE_ASSERT(data->node_count == sonde_model_nodes(tuned).count);
  sonde_batches_set_step(body, def);
  body->tissue->calls->tune(body->tissue, tuned, &body->step, body->rows);
  body->by_gradients = SONDE_BATCH == 8 || body->tissue->is_stiff;
}

// Most neighbours or faces around a node.
static uint32_t most_around(const sonde_batches *body, const sonde_topology *t) {
  uint32_t most = 0;
  for (uint32_t i = 0; i < body->nodes.count; ++i) {
    uint32_t faces = i < t->vertex_count ? t->face_start[i + 1] - t->face_start[i] : 0;
    uint32_t edges = body->nodes.start[i + 1] - body->nodes.start[i];
    most = edges > most ? edges : most;
    most = faces > most ? faces : most;
  }
  return most;
}

// Sizes that need a pass over the nodes: lists per batch. lists: room for two of one batch.
static void measure(sonde_batches *body, const sonde_topology *t, const uint32_t *place,
                    sonde_rows *sizes, uint32_t *lists) {
  size_t most = (size_t)most_around(body, t) * SONDE_BATCH + 1;
  for (uint32_t i = 0; body->part_count > 1 && i < body->nodes.count; ++i)
    body->seen_count += is_seen(body, i);
  for (uint32_t s = 0; s < body->common.batch_count; ++s) {
    uint32_t rest = body->nodes.count - s * SONDE_BATCH;
    sizes[s].used = rest < SONDE_BATCH ? rest : SONDE_BATCH;
    list_near(body, t, place, s, lists, lists + most, &sizes[s]);
    sizes[s].first_near = body->near_total;
    sizes[s].first_face = body->face_total;
    body->near_total += sizes[s].near_count;
    body->face_total += sizes[s].face_count;
  }
}

static void fill(sonde_batches *body, const sonde_model *model, const uint32_t *place,
                 const sonde_rows *sizes) {
  memcpy(body->rows, sizes, body->common.batch_count * sizeof *sizes);
  for (uint32_t k = 0; k < sonde_vectors_of(body->common.batch_count); ++k)
    for (int c = 0; c < 3; ++c)
      body->box[k].low[c] = all((real)1e30), body->box[k].high[c] = all(-(real)1e30);
  // Rows that the other part sees; those of the last part, which the first one sees, come last.
  uint32_t count = 0, half = 0;
  for (uint32_t i = 0; body->seen_count > 0 && i < body->nodes.count; ++i) {
    if (!is_seen(body, i)) continue;
    half += i / SONDE_BATCH < body->part_batch[1];
    body->seen[count] = i;
    body->seen_at[i] = body->common.batch_count * SONDE_BATCH + count++;
  }
  SONDE_ASSERT(count == body->seen_count);
  body->part_seen[1] = half, body->part_seen[2] = count;
  for (uint32_t s = 0; s < body->common.batch_count; ++s) {
    sonde_rows *rows = &body->rows[s];
    fill_batch(body, s);
    list_near(body, &model->topology, place, s, body->near + rows->first_near,
              body->face_near + rows->first_face, rows);
  }
  // Faces in batches, for the contact.
  for (uint32_t at = 0; at < model->surface.face_count; ++at) {
    uint32_t f = body->face_order[at], s = at / SONDE_BATCH, l = at % SONDE_BATCH;
    body->point_area[s][l] = (real)(model->face_area_m2[f] / SONDE_FACE_POINTS);
    for (int k = 0; k < 3; ++k) body->face[s][k][l] = (whole)model->surface.faces[f][k];
  }
}

static void destroy(sonde_engine_data *data) {
  sonde_batches *body = (sonde_batches *)(void *)data;
  if (!body) return;
  if (body->tissue) body->tissue->calls->destroy(body->tissue);
  sonde_second_thread_destroy(body->thread);
  sonde_free(body->response.row);
  sonde_free(body->response.stiffness);
  sonde_free(body->block);
  sonde_free(body);
}

// Measures, allocates and fills a body whose counts of nodes, batches and parts are known.
static sonde_status lay_out(sonde_batches *body, const sonde_model *model,
                            const sonde_world_def *def, sonde_error *error) {
  const sonde_tissue_calls *calls = models[sonde_model_family(model)].calls;
  size_t around = 2 * ((size_t)most_around(body, &model->topology) * SONDE_BATCH + 1);
  uint32_t faces = model->surface.face_count;
  char *room = sonde_calloc(body->common.batch_count + 1, sizeof(sonde_rows));
  sonde_rows *sizes = (void *)sonde_whole_lines(room);
  uint32_t *place = SONDE_NEW(uint32_t, faces), *lists = SONDE_NEW(uint32_t, around);
  sonde_status status = room && place && lists ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    for (uint32_t k = 0; k < faces; ++k) place[body->face_order[k]] = k;
    measure(body, &model->topology, place, sizes, lists);
    // The block starts at a multiple of 64, as vectors need.
    body->block = sonde_calloc(1, carve(body, faces, NULL) + 63);
    if (!body->block) status = sonde_fail_memory(error);
  }
  if (!status) {
    carve(body, faces, sonde_whole_lines(body->block));
    SONDE_ASSERT(((uintptr_t)body->batch & 63) == 0);
    fill(body, model, place, sizes);
    sonde_batches_set_step(body, def);
    const sonde_layout layout = layout_of(body);
    status = calls->create(model, &layout, &body->step, body->rows, &body->tissue, error);
  }
  if (!status && body->tissue->compliance) {
    sonde_response *r = &body->response;
    uint32_t n = body->nodes.count;
    size_t most = r->most = n < SONDE_RESPONSE_NODES ? n : SONDE_RESPONSE_NODES;
    r->row = SONDE_NEW(uint32_t, most);
    r->stiffness = SONDE_NEW(double, 18 * most * most + 9 * most);
    if (!r->row || !r->stiffness)
      status = sonde_fail_memory(error);
    else {
      r->matrix = r->stiffness + 9 * most * most;
      r->way = r->matrix + 9 * most * most, r->move = r->way + 3 * most,
      r->push = r->move + 3 * most;
    }
  }
  sonde_free(room);
  sonde_free(place);
  sonde_free(lists);
  return status;
}

static sonde_status create(const sonde_model *model, const sonde_world_def *def,
                           const uint32_t *face_order, sonde_engine_data **data,
                           sonde_error *error) {
  *data = NULL;
  sonde_batches *body = SONDE_NEW(sonde_batches, 1);
  if (!body) return sonde_fail_memory(error);
  body->nodes = sonde_model_nodes(model);
  uint32_t n = body->nodes.count;
  body->common.calls = &BY_REAL(sonde_engine);
  body->common.node_count = n;
  body->common.batch_count = sonde_vectors_of(n);
  body->face_batch_count = sonde_vectors_of(model->surface.face_count);
  body->face_order = face_order;
  body->part_count = n < SONDE_PART_NODES ? 1 : SONDE_PARTS;
  for (uint32_t k = 1; k <= SONDE_PARTS; ++k)
    body->part_batch[k] =
        k < body->part_count ? body->common.batch_count / 2 : body->common.batch_count;
  body->kernels = sonde_kernels_find(model, NULL);
  sonde_status status = SONDE_OK;
  if (def->threads > 1 && body->part_count > 1)
    status = sonde_second_thread_create(&body->thread, error);
  if (!status) status = lay_out(body, model, def, error);
  if (status) {
    destroy(&body->common);
    return status;
  }
  body->tissue->published[0] = (sonde_published){body->place, body->direction};
  body->by_gradients = SONDE_BATCH == 8 || body->tissue->is_stiff;
  body->common.batch_nodes = SONDE_BATCH;
  body->common.batches = (char *)body->batch;
  body->common.batch_bytes = sizeof *body->batch;
  body->common.motion_bytes = offsetof(sonde_batch, factor);
  body->common.real_bytes = sizeof(real);
  body->common.speed2 = body->speed2, body->common.moved2 = body->moved2;
  *data = &body->common;
  return SONDE_OK;
}

void sonde_batches_still(sonde_batches *body, uint32_t first, uint32_t count) {
  const size_t quads = SONDE_BATCH * SONDE_QUAD;
  SONDE_ASSERT(first + count <= body->common.batch_count);
  for (int k = 0; k < SONDE_PUBLISHED; ++k) {
    real *direction = body->tissue->published[k].direction;
    if (direction) memset(direction + first * quads, 0, count * quads * sizeof(real));
  }
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
    for (uint32_t l = 0; l < body->rows[s].used; ++l) {
      uint32_t i = s * SONDE_BATCH + l;
      sonde_vec3 u = v_sub(position[i], rest[i]), v = velocity[i];
      const double motion[6] = {u.x, u.y, u.z, v.x, v.y, v.z};
      for (int c = 0; c < 3; ++c) {
        at->u[c][l] = (real)motion[c];
        at->v[c][l] = at->ve[c][l] = (real)motion[3 + c];
      }
      body->speed2[s] = upper(body->speed2[s], (real)v_norm2(v));
      body->moved2[s] = upper(body->moved2[s], (real)v_norm2(u));
    }
    body->kernels->record(body, s);
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
    for (uint32_t l = 0; l < body->rows[s].used; ++l) {
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
  for (uint32_t s = 0; s < data->batch_count; ++s) body->kernels->record(body, s);
}

const sonde_kernels *sonde_kernels_find(const sonde_model *model, const char *name) {
  const sonde_model_kernels *known = &models[sonde_model_family(model)];
  for (size_t k = 0; k < SONDE_COUNT_OF(known->kernels); ++k)
    if (known->kernels[k] && sonde_vectors_serve(known->kernels[k]->name, name))
      return known->kernels[k];
  return NULL;
}

const sonde_engine_calls BY_REAL(sonde_engine) = {
    create, destroy, tune, import, publish, refresh, BY_REAL(sonde_batches_step)};
