// Layout of a volumetric body in batches; cold.
#include "tissue/bulk/batches.h"
#include "tissue/bulk/bulk.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

#define CARVE(field, count) (t->field = sonde_carve(base, &offset, (count), sizeof *t->field))

// responding: nodes of a condensed solid, else 0.
static size_t carve(bulk_tissue *t, uint32_t batches, uint32_t responding, char *base) {
  size_t offset = 0;
  CARVE(compliance, 9 * (size_t)responding * batches);
  CARVE(batch, batches), CARVE(slot, t->slot_count);
  CARVE(spring, t->springs ? t->slot_count : 0), CARVE(corner, t->corner_count);
  return offset;
}

static void fill_row(bulk_tissue *tissue, const sonde_bulk *bulk, const sonde_layout *layout,
                     const sonde_bulk_graph *graph, uint32_t i) {
  uint32_t l = i % SONDE_BATCH, n = layout->nodes.count;
  bulk_batch *fixed = &tissue->batch[i / SONDE_BATCH];
  whole still = (whole)sonde_published_rows(layout); // a row that never moves
  uint32_t used = i < n ? graph->start[i + 1] - graph->start[i] : 0;
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    bulk_slot *slot = &tissue->slot[fixed->first_slot + k];
    uint32_t j = k < used ? graph->neighbour[graph->start[i] + k] : i;
    slot->node[l] = j >= n && k < used ? still : sonde_seen_from(layout, i, j);
    if (tissue->springs) {
      bulk_spring *spring = &tissue->spring[fixed->first_slot + k];
      sonde_vec3 d = k < used ? v_sub(bulk->node[j], bulk->node[i]) : vec3(1, 0, 0);
      sonde_bulk_spring law = {0};
      if (k < used) law = graph->spring[graph->start[i] + k];
      spring->rest[0][l] = (real)d.x, spring->rest[1][l] = (real)d.y;
      spring->rest[2][l] = (real)d.z, spring->length[l] = (real)v_norm(d);
      spring->law.stiffness[l] = (real)law.stiffness_n_m;
      spring->law.steep[l] = (real)law.steep_n_m;
      spring->law.knee[l] = (real)(law.knee * v_norm(d));
    }
    if (tissue->constant && k < used)
      for (int e = 0; e < 9; ++e)
        slot->block[e][l] = (real)graph->block[graph->start[i] + k].m[e / 3][e % 3];
  }
  if (tissue->constant && i < n) {
    const sonde_mat3 *own = &graph->own[i];
    const double six[6] = {own->m[0][0], own->m[0][1], own->m[0][2],
                           own->m[1][1], own->m[1][2], own->m[2][2]};
    for (int e = 0; e < 6; ++e) fixed->own[e][l] = (real)six[e];
  }
}

// Corner c of tetrahedron e, at row i, as the row's k-th.
static void fill_corner(bulk_tissue *tissue, const sonde_model *model, const sonde_layout *layout,
                        const sonde_bulk_graph *graph, uint32_t i, uint32_t k, uint32_t e,
                        uint32_t c) {
  const sonde_bulk *bulk = model->bulk;
  uint32_t l = i % SONDE_BATCH, n = layout->nodes.count, first = graph->start[i];
  bulk_corner *corner = &tissue->corner[tissue->batch[i / SONDE_BATCH].first_corner + k];
  sonde_vec3 gradient[4];
  double v = sonde_bulk_gradients(bulk, e, gradient), mu, lambda;
  sonde_bulk_solid(model, e, &mu, &lambda);
  corner->volume[l] = (real)v, corner->mu[l] = (real)mu, corner->lambda[l] = (real)lambda;
  for (uint32_t m = 0; m < 3; ++m) {
    uint32_t other = (c + 1 + m) % 4, j = bulk->element[e][other], slot = first;
    while (graph->neighbour[slot] != j) ++slot;
    SONDE_ASSERT(slot < graph->start[i + 1]);
    corner->slot[m][l] = (whole)(slot - first);
    corner->node[m][l] =
        j >= n ? (whole)sonde_published_rows(layout) : sonde_seen_from(layout, i, j);
    corner->gradient[m][0][l] = (real)gradient[other].x;
    corner->gradient[m][1][l] = (real)gradient[other].y;
    corner->gradient[m][2][l] = (real)gradient[other].z;
  }
}

static void destroy(sonde_tissue *data) {
  bulk_tissue *tissue = (bulk_tissue *)(void *)data;
  if (!tissue) return;
  sonde_free(tissue->block);
  sonde_free(tissue);
}

static void fill(bulk_tissue *tissue, const sonde_model *model, const sonde_layout *layout,
                 const sonde_bulk_graph *graph, sonde_rows *rows, uint32_t *corners) {
  const sonde_bulk *bulk = model->bulk;
  uint32_t n = layout->nodes.count;
  for (uint32_t i = 0; i < layout->batch_count * SONDE_BATCH; ++i)
    fill_row(tissue, bulk, layout, graph, i);
  for (uint32_t s = 0; s < layout->batch_count; ++s)
    for (uint32_t k = 0; k < tissue->batch[s].corner_count; ++k)
      for (uint32_t l = 0; l < SONDE_BATCH; ++l)
        for (int m = 0; m < 3; ++m)
          tissue->corner[tissue->batch[s].first_corner + k].node[m][l] =
              (whole)(s * SONDE_BATCH + l);
  memset(corners, 0, n * sizeof *corners);
  for (uint32_t e = 0; tissue->solid && e < bulk->element_count; ++e)
    for (uint32_t c = 0; c < 4; ++c) {
      uint32_t i = bulk->element[e][c];
      if (i < n) fill_corner(tissue, model, layout, graph, i, corners[i]++, e, c);
    }
  // Compliance of a condensed solid, column by column.
  for (size_t k = 0; graph->compliance && k < 3 * (size_t)n; ++k) {
    reals *column = tissue->compliance + 3 * k * layout->batch_count;
    for (uint32_t j = 0; j < 3 * n; ++j)
      column[3 * (j / 3 / SONDE_BATCH) + j % 3][j / 3 % SONDE_BATCH] =
          (real)graph->compliance[3 * k * n + j];
  }
  // A row's stiffness, as the mean of its diagonal block, and how fast moves change it.
  for (uint32_t i = 0; i < n; ++i) {
    const sonde_mat3 *own = &graph->own[i];
    double stiffness = (own->m[0][0] + own->m[1][1] + own->m[2][2]) / 3;
    rows[i / SONDE_BATCH].yield[i % SONDE_BATCH] = (real)(1 / stiffness);
    real bend = (real)(stiffness / bulk->shortest_m[i]);
    bulk_batch *batch = &tissue->batch[i / SONDE_BATCH];
    if (!tissue->constant && bend > batch->bend) batch->bend = bend;
  }
}

static sonde_status create(const sonde_model *model, const sonde_layout *layout,
                           const sonde_step_scales *step, sonde_rows *rows, sonde_tissue **out,
                           sonde_error *error) {
  const sonde_bulk *bulk = model->bulk;
  uint32_t batches = layout->batch_count;
  (void)step;
  uint32_t n = layout->nodes.count;
  SONDE_ASSERT(bulk && n <= bulk->node_count);
  bulk_tissue *tissue = SONDE_NEW(bulk_tissue, 1);
  uint32_t *corners = SONDE_NEW(uint32_t, n);
  char *room = sonde_calloc(batches + 1, sizeof(bulk_batch));
  bulk_batch *size = (void *)sonde_whole_lines(room);
  uint32_t responding = model->kind == SONDE_CONDENSED_SOLID ? n : 0;
  sonde_bulk_graph graph = {0};
  sonde_status status = tissue && corners && room ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_bulk_graph_create(model, &graph, error);
  if (!status) {
    tissue->common.calls = &sonde_bulk_calls;
    tissue->constant = graph.block != NULL;
    tissue->springs = graph.spring != NULL;
    tissue->solid = !tissue->constant && sonde_bulk_is_solid(model);
    tissue->damping_s = (real)bulk->law.damping_s;
    tissue->made_scale = (real)bulk->law.stiffness_scale, tissue->gain = 1;
    tissue->common.reads_rows = tissue->common.is_stiff = true;
    // Counts of slots and corners per batch, and their sums.
    for (uint32_t e = 0; tissue->solid && e < bulk->element_count; ++e)
      for (int c = 0; c < 4; ++c)
        if (bulk->element[e][c] < n) ++corners[bulk->element[e][c]];
    for (uint32_t i = 0; i < n; ++i) {
      bulk_batch *at = &size[i / SONDE_BATCH];
      uint32_t slots = graph.start[i + 1] - graph.start[i];
      at->slot_count = slots > at->slot_count ? slots : at->slot_count;
      at->corner_count = corners[i] > at->corner_count ? corners[i] : at->corner_count;
    }
    for (uint32_t s = 0; s < batches; ++s) {
      size[s].first_slot = tissue->slot_count, size[s].first_corner = tissue->corner_count;
      tissue->slot_count += size[s].slot_count;
      tissue->corner_count += size[s].corner_count;
    }
    tissue->common.evaluated_per_slot = tissue->springs ? 34 : 18;
    tissue->common.multiplied_per_slot = 14;
    tissue->block = sonde_calloc(1, carve(tissue, batches, responding, NULL) + 63);
    if (!tissue->block) status = sonde_fail_memory(error);
  }
  if (!status) {
    carve(tissue, batches, responding, sonde_whole_lines(tissue->block));
    if (responding > 0) tissue->common.compliance = tissue->compliance;
    tissue->common.gain = tissue->gain, tissue->common.damping_s = tissue->damping_s;
    memcpy(tissue->batch, size, batches * sizeof *size);
    fill(tissue, model, layout, &graph, rows, corners);
    *out = &tissue->common;
  } else {
    destroy(&tissue->common);
  }
  sonde_bulk_graph_clear(&graph);
  sonde_free(corners);
  sonde_free(room);
  return status;
}

// @thread tick
static void tune(sonde_tissue *data, const sonde_model *tuned, const sonde_step_scales *step,
                 sonde_rows *rows) {
  bulk_tissue *tissue = (bulk_tissue *)(void *)data;
  (void)step, (void)rows;
  SONDE_ASSERT(tuned->bulk);
  tissue->damping_s = (real)tuned->bulk->law.damping_s;
  tissue->gain = (real)tuned->bulk->law.stiffness_scale / tissue->made_scale;
  tissue->common.gain = tissue->gain, tissue->common.damping_s = tissue->damping_s;
}

const sonde_tissue_calls sonde_bulk_calls = {create, destroy, tune};
