// Inside of the cut: nodes that share a place, and the way of a path over the skin.
#ifndef SONDE_SRC_LIVE_CUT_H
#define SONDE_SRC_LIVE_CUT_H

#include "sonde/tissue.h"

// Nodes at one rest position are copies that earlier cuts made: they share a place, named after
// the lowest of them.
typedef struct sonde_places {
  uint32_t *place; // [nodes]
  uint32_t *next;  // [nodes] next higher node at the place; UINT32_MAX at the end
} sonde_places;

sonde_status sonde_places_find(const sonde_model *model, sonde_places *places, sonde_error *error);
void sonde_places_clear(sonde_places *places);

// Distinct places, consecutive ones joined by an edge; a closed way also joins last and first.
typedef struct sonde_way {
  uint32_t *place; // [count]
  uint32_t count;
  bool closed;
  uint64_t work; // edges looked at
} sonde_way;

// The way along edges that follows a path over the skin at `position`. Freed by sonde_free(place).
sonde_status sonde_way_find(const sonde_model *model, const sonde_places *places,
                            const sonde_vec3 *position, const sonde_vec3 *path, uint32_t count,
                            sonde_way *way, sonde_error *error);

// Whether the skin is closed when the lips of its cuts are put together.
sonde_status sonde_skin_closes(const sonde_model *model, bool *closes, sonde_error *error);

#endif
