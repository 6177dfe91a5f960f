// Creation and release of an interior.
#include "base/base.h"
#include "interior/interior.h"
#include "interior/window.h"

sonde_status sonde_interior_create(const sonde_model *model, sonde_interior **interior,
                                   sonde_error *error) {
  SONDE_ASSERT(interior != NULL);
  *interior = NULL;
  if (model == NULL || model->surface.face_count == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "expected a model with a skin");
  if (model->femur.face_count == 0)
    return sonde_fail(error, SONDE_MESH,
                      "the model has no bone, and so no vessels and no image: fit it with --femur");
  if (model->fat_depth_m == NULL || model->muscle_depth_m == NULL)
    return sonde_fail(error, SONDE_ARGUMENT, "expected a model with layer depths per node");
  sonde_interior *made = SONDE_NEW(sonde_interior, 1);
  if (made == NULL) return sonde_fail_memory(error);
  made->model = model;
  sonde_status status = sonde_pathology_preset("healthy", &made->pathology[0], error);
  for (uint32_t k = 1; k < SONDE_VESSELS; ++k) made->pathology[k] = made->pathology[0];
  if (status == SONDE_OK) status = sonde_columns_create(made, error);
  if (status == SONDE_OK) status = sonde_sections_create(made, error);
  made->column_grid = SONDE_NEW(struct sonde_column_grid, 1);
  if (status == SONDE_OK && made->column_grid == NULL) status = sonde_fail_memory(error);
  if (status == SONDE_OK) status = sonde_window_create(&made->live, error);
  if (status == SONDE_OK) status = sonde_window_create(&made->next, error);
  if (status == SONDE_OK) made->whole = sonde_window_steps(made->live, SONDE_WINDOW_BUDGET);
  if (status == SONDE_OK)
    *interior = made;
  else
    sonde_interior_destroy(made);
  return status;
}

void sonde_interior_destroy(sonde_interior *interior) {
  if (interior == NULL) return;
  sonde_window_destroy(interior->live);
  sonde_window_destroy(interior->next);
  for (uint32_t k = 0; k < interior->cache_count; ++k) sonde_window_destroy(interior->cache[k]);
  sonde_free(interior->cache);
  sonde_surface_index_destroy(interior->skin);
  sonde_direct_destroy(interior->surface);
  sonde_free(interior->column);
  sonde_free(interior->bend);
  sonde_free(interior->bone);
  sonde_free(interior->field);
  sonde_free(interior->column_grid);
  sonde_free(interior->reached);
  for (uint32_t k = 0; k < SONDE_VESSELS; ++k) {
    sonde_free(interior->section[k]);
    sonde_free(interior->state[k]);
    sonde_free(interior->strained[k]);
  }
  sonde_free(interior->potential);
  sonde_free(interior);
}

void sonde_interior_set_method(sonde_interior *interior, sonde_interior_method method) {
  SONDE_ASSERT(interior != NULL && method <= SONDE_INTERIOR_COLUMNS);
  interior->method = method;
}

void sonde_interior_for_vessels(sonde_interior *interior, bool only) {
  SONDE_ASSERT(interior != NULL);
  interior->vessels_only = only;
}

void sonde_interior_wait(sonde_interior *interior, bool waits) {
  SONDE_ASSERT(interior != NULL);
  interior->waits = waits;
}

sonde_interior_method sonde_interior_used_method(const sonde_interior *interior) {
  SONDE_ASSERT(interior != NULL);
  return interior->solid || interior->tissue ? SONDE_INTERIOR_SOLID : SONDE_INTERIOR_COLUMNS;
}
