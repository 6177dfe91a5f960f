// Layout of a two-layer model in batches; cold but for tune().
#include "tissue/two_layer/batches.h"
#include "tissue/two_layer/fan.h"
#include "tissue/two_layer/linearise.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

#define CARVE(field, count) (t->field = sonde_carve(base, &offset, (count), sizeof *t->field))

static size_t carve(two_layer *t, const sonde_layout *layout, char *base) {
  uint32_t layers = t->layered ? t->slot_count : 0;
  size_t offset = 0, seen = sonde_published_rows(layout);
  CARVE(batch, layout->batch_count);
  CARVE(slot, t->slot_count), CARVE(tangent, t->slot_count), CARVE(share, t->slot_count);
  CARVE(slot_layer, layers), CARVE(slot_face, layers), CARVE(slot_from, layers);
  if (t->layered) {
    CARVE(common.published[1].place, seen * SONDE_RECORD);
    CARVE(common.published[1].direction, seen * SONDE_QUAD);
  }
  return offset;
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

// The spring to the neighbour of slot k; one that has a slot already has no spring here.
static void fill_spring(two_layer *tissue, const sonde_model *model, const sonde_layout *layout,
                        uint32_t i, uint32_t k, const sonde_fan *fan) {
  uint32_t l = i % SONDE_BATCH;
  two_layer_batch *fixed = &tissue->batch[i / SONDE_BATCH];
  two_layer_slot *slot = &tissue->slot[fixed->first_slot + k];
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
  tissue->tangent[fixed->first_slot + k].node[l] = sonde_seen_from(layout, i, j);
  slot->rest[0][l] = (real)d.x, slot->rest[1][l] = (real)d.y, slot->rest[2][l] = (real)d.z;
  slot->length[l] = (real)length;
  tissue->share[fixed->first_slot + k][l] = (real)share;
  if (share != 1 && k < fixed->whole_count) fixed->whole_count = k;
}

static void fill_shear(two_layer_face *slot, const sonde_model *model, uint32_t f, uint32_t lane) {
  double shear, limit;
  sonde_tissue_face_law(model, f, &shear, &limit);
  slot->shear[lane] = (real)shear;
  slot->bend[lane] = shear > 0 ? (real)(1 / (limit * limit * model->face_area_m2[f])) : 0;
}

// Both layers in slot k, whose face also weighs on the slot before.
static void fill_layers(two_layer *tissue, const sonde_model *model, const sonde_layout *layout,
                        uint32_t i, uint32_t k, const sonde_fan *fan) {
  uint32_t l = i % SONDE_BATCH, f = k < fan->count ? fan->face[k] : SONDE_NO_FACE;
  two_layer_batch *fixed = &tissue->batch[i / SONDE_BATCH];
  two_layer_coupling *layer = &tissue->slot_layer[fixed->first_slot + k];
  tissue->slot_from[fixed->first_slot + k][l] = f == SONDE_NO_FACE ? -1 : (whole)f;
  layer->node[l] = sonde_seen_from(layout, i, k < fan->count ? fan->node[k] : i);
  if (f == SONDE_NO_FACE) return;
  const uint32_t *v = model->surface.faces[f];
  uint32_t own = v[0] == i ? 0 : v[1] == i ? 1 : 2;
  two_layer_face *slot = &tissue->slot_face[fixed->first_slot + k];
  for (uint32_t c = 0; c < 3; ++c)
    slot->cot[c][l] = (real)model->face_half_cotangent[f][(own + c) % 3];
  fill_shear(slot, model, f, l);
  layer->weight[l] += slot->cot[1][l];
  two_layer_coupling *before = &tissue->slot_layer[fixed->first_slot + (k > 0 ? k : fan->turn) - 1];
  before->weight[l] += slot->cot[2][l];
  fixed->weight[l] += slot->cot[1][l] + slot->cot[2][l];
}

// Normal springs of a node.
static void fill_anchor(two_layer *tissue, const sonde_model *model, uint32_t i, sonde_rows *rows) {
  double tangent = model->law.tangential_stiffness_n_m3, k0 = model->k0_n_m3[i];
  uint32_t s = i / SONDE_BATCH, l = i % SONDE_BATCH;
  tissue->batch[s].k0[l] = (real)k0;
  rows[s].yield[l] = (real)(1 / (model->area_m2[i] * (tangent > 0 ? fmin(tangent, k0) : k0)));
}

static void fill_row(two_layer *tissue, const sonde_model *model, const sonde_layout *layout,
                     uint32_t i, sonde_rows *rows, sonde_fan *fan) {
  uint32_t l = i % SONDE_BATCH;
  two_layer_batch *fixed = &tissue->batch[i / SONDE_BATCH];
  fixed->k0[l] = 0;
  fixed->xm[l] = fixed->limit[l] = 1;
  if (i < layout->nodes.count) {
    sonde_vec3 normal = model->normal[i];
    const double n[3] = {normal.x, normal.y, normal.z};
    for (int c = 0; c < 3; ++c) fixed->normal[c][l] = (real)n[c];
    fill_anchor(tissue, model, i, rows);
    fixed->xm[l] = (real)model->xm_m[i];
    fixed->limit[l] = (real)(model->law.guard * model->xm_m[i]);
    const sonde_topology *t = &model->topology;
    for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k) {
      real bend = 1 / (real)model->edge_rest_m[t->neighbour_edge[k]];
      fixed->bend = bend > fixed->bend ? bend : fixed->bend;
    }
  }
  order_slots(model, tissue->layered, i, fan);
  fixed->last[l] = sonde_seen_from(layout, i, fan->last);
  fixed->turn[l] = (whole)fan->turn;
  if (l == 0) fixed->whole_count = fixed->slot_count;
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    fill_spring(tissue, model, layout, i, k, fan);
    if (tissue->layered) fill_layers(tissue, model, layout, i, k, fan);
  }
}

static void set_law(two_layer *tissue, const sonde_model *model, const sonde_step_scales *step) {
  // Runs blew up from 400 on: the bound of stiffness over mass is mild.
  const double most = 30;
  const sonde_surface_law *law = &model->law;
  double stiffness = law->edge_stiffness_n_m, mass = 0;
  tissue->layered = sonde_tissue_is_layered(law);
  tissue->springs = stiffness > 0 || law->edge_pretension_n > 0 || !tissue->layered;
  tissue->inplane = (real)law->inplane_stiffness_n_m;
  tissue->shear = (real)law->shear_stiffness_n_m;
  tissue->edge = (edge_law){(real)stiffness, (real)(law->edge_damping_s * stiffness),
                            (real)law->edge_compression, (real)law->edge_pretension_n};
  tissue->anchor = (anchor_law){(int)law->normal_exponent, (real)law->tangential_stiffness_n_m3,
                                (real)law->normal_damping_s};
  // Sweeps carry a move from batch to batch; where springs outweigh masses they need many, and the
  // springs turn under the first one's moves.
  double coupling = (double)step->stiffness_scale *
                        (double)(tissue->edge.stiffness + tissue->shear + tissue->inplane) +
                    (double)(step->damping_scale * tissue->edge.damper);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) mass += model->mass_kg[i];
  tissue->common.is_stiff = 2 * model->topology.edge_count * coupling > most * mass;
  tissue->common.reads_rows = tissue->springs;
  tissue->common.evaluated_per_slot = (tissue->springs ? 16u : 0) + (tissue->layered ? 12u : 0);
  tissue->common.multiplied_per_slot = (tissue->springs ? 10u : 0) + (tissue->layered ? 7u : 0);
}

// @thread tick
static void tune(sonde_tissue *data, const sonde_model *tuned, const sonde_step_scales *step,
                 sonde_rows *rows) {
  two_layer *tissue = (two_layer *)(void *)data;
  SONDE_ASSERT(tuned->k0_n_m3);
  set_law(tissue, tuned, step);
  for (uint32_t i = 0; i < tuned->surface.vertex_count; ++i) fill_anchor(tissue, tuned, i, rows);
  for (uint32_t k = 0; tissue->shear > 0 && k < tissue->slot_count; ++k)
    for (uint32_t l = 0; l < SONDE_BATCH; ++l)
      if (tissue->slot_from[k][l] >= 0)
        fill_shear(&tissue->slot_face[k], tuned, (uint32_t)tissue->slot_from[k][l], l);
}

static void destroy(sonde_tissue *data) {
  two_layer *tissue = (two_layer *)(void *)data;
  if (!tissue) return;
  sonde_free(tissue->block);
  sonde_free(tissue);
}

static sonde_status create(const sonde_model *model, const sonde_layout *layout,
                           const sonde_step_scales *step, sonde_rows *rows, sonde_tissue **out,
                           sonde_error *error) {
  const sonde_topology *t = &model->topology;
  uint32_t most = 0;
  for (uint32_t i = 0; i < t->vertex_count; ++i) {
    uint32_t faces = t->face_start[i + 1] - t->face_start[i], edges = t->start[i + 1] - t->start[i];
    most = faces > most ? faces : most;
    most = edges > most ? edges : most;
  }
  two_layer *tissue = SONDE_NEW(two_layer, 1);
  uint32_t *slots = SONDE_NEW(uint32_t, layout->batch_count);
  sonde_fan fan = {.node = SONDE_NEW(uint32_t, 2 * (size_t)most + 1),
                   .face = SONDE_NEW(uint32_t, 2 * (size_t)most + 1)};
  sonde_status status = SONDE_OK;
  if (!tissue || !slots || !fan.node || !fan.face) status = sonde_fail_memory(error);
  if (!status) {
    tissue->common.calls = &sonde_two_layer_calls;
    set_law(tissue, model, step);
    for (uint32_t i = 0; i < t->vertex_count; ++i) {
      uint32_t *slot = &slots[i / SONDE_BATCH];
      order_slots(model, tissue->layered, i, &fan);
      *slot = fan.count > *slot ? fan.count : *slot;
    }
    for (uint32_t s = 0; s < layout->batch_count; ++s) tissue->slot_count += slots[s];
    tissue->block = sonde_calloc(1, carve(tissue, layout, NULL) + 63);
    if (!tissue->block) status = sonde_fail_memory(error);
  }
  if (!status) {
    carve(tissue, layout, sonde_whole_lines(tissue->block));
    uint32_t first = 0;
    for (uint32_t s = 0; s < layout->batch_count; first += slots[s++]) {
      tissue->batch[s].first_slot = first, tissue->batch[s].slot_count = slots[s];
      for (uint32_t l = 0; l < SONDE_BATCH; ++l)
        fill_row(tissue, model, layout, s * SONDE_BATCH + l, rows, &fan);
    }
    *out = &tissue->common;
  } else {
    destroy(&tissue->common);
  }
  sonde_free(slots);
  sonde_free(fan.node);
  sonde_free(fan.face);
  return status;
}

const sonde_tissue_calls sonde_two_layer_calls = {create, destroy, tune};
