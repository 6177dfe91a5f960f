// A volumetric body for engines with a block matrix: memory and energy; cold.
#define SONDE_REAL_DOUBLE
#include "tissue/bulk/blocks_inside.h"

#include "base/base.h"

sonde_status sonde_bulk_blocks_create(const sonde_model *model, sonde_bulk_blocks **out,
                                      sonde_error *error) {
  SONDE_ASSERT(model && model->bulk && out);
  *out = NULL;
  sonde_bulk_blocks *b = SONDE_NEW(sonde_bulk_blocks, 1);
  if (!b) return sonde_fail_memory(error);
  const sonde_nodes nodes = sonde_model_nodes(model);
  b->model = model;
  b->batch_count = sonde_vectors_of(nodes.count);
  size_t rows = (size_t)b->batch_count * SONDE_BATCH;
  b->block = sonde_calloc(1, b->batch_count * sizeof *b->rows +
                                 (rows + 1) * SONDE_RECORD * sizeof(real) + 63);
  sonde_status status = b->block ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_bulk_graph_create(model, &b->graph, error);
  if (!status) {
    b->rows = (void *)sonde_whole_lines(b->block);
    b->place = (real *)(void *)(b->rows + b->batch_count);
    const sonde_layout layout = {.nodes = nodes, .batch_count = b->batch_count, .part_count = 1};
    const sonde_step_scales step = {.stiffness_scale = 1};
    status = sonde_bulk_calls.create(model, &layout, &step, b->rows, &b->tissue, error);
  }
  if (status) {
    sonde_bulk_blocks_destroy(b);
    return status;
  }
  b->tissue->published[0].place = b->place;
  *out = b;
  return SONDE_OK;
}

void sonde_bulk_blocks_destroy(sonde_bulk_blocks *blocks) {
  if (!blocks) return;
  if (blocks->tissue) blocks->tissue->calls->destroy(blocks->tissue);
  sonde_bulk_graph_clear(&blocks->graph);
  sonde_free(blocks->block);
  sonde_free(blocks);
}

uint32_t sonde_node_pairs(const sonde_nodes *nodes, uint32_t (*pairs)[2]) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < nodes->count; ++i)
    for (uint32_t k = nodes->start[i]; k < nodes->start[i + 1]; ++k) {
      if (nodes->neighbour[k] < i) continue;
      if (pairs) pairs[count][0] = i, pairs[count][1] = nodes->neighbour[k];
      ++count;
    }
  return count;
}

double sonde_bulk_energy(const sonde_bulk_blocks *blocks, const sonde_vec3 *position) {
  SONDE_ASSERT(blocks && position);
  return sonde_bulk_graph_energy(blocks->model, &blocks->graph, position);
}
