// Creation of the sweep.
#include "contact/sweep.h"

sonde_status sonde_sweep_create(uint32_t capacity, sonde_sweep **out, sonde_error *error) {
  SONDE_ASSERT(out != NULL);
  *out = NULL;
  sonde_sweep *sweep = SONDE_NEW(sonde_sweep, 1);
  if (!sweep) return sonde_fail_memory(error);
  sweep->capacity = capacity;
  sweep->order = SONDE_NEW(uint32_t, capacity);
  if (!sweep->order) {
    sonde_free(sweep);
    return sonde_fail_memory(error);
  }
  *out = sweep;
  return SONDE_OK;
}

void sonde_sweep_destroy(sonde_sweep *sweep) {
  if (!sweep) return;
  SONDE_ASSERT(sweep->count <= sweep->capacity);
  sonde_free(sweep->order);
  sonde_free(sweep);
}
