// Inside of the cut: nodes that coincide at rest, and the chain of nodes that a path runs through.
#ifndef SONDE_SRC_LIVE_CUT_H
#define SONDE_SRC_LIVE_CUT_H

#include "sonde/tissue.h"

// Nodes at one rest position are copies that earlier cuts made; the lowest of them names them all.
typedef struct sonde_copies {
  uint32_t *first; // [nodes] lowest node at the same rest position
  uint32_t *next;  // [nodes] next higher node there; UINT32_MAX at the end
} sonde_copies;

sonde_status sonde_copies_find(const sonde_model *model, sonde_copies *copies, sonde_error *error);
void sonde_copies_clear(sonde_copies *copies);

// Nodes that a cut runs through, the first ones of their copies, none twice; consecutive ones are
// joined by an edge, in a closed path also the last and the first.
typedef struct sonde_cut_path {
  uint32_t *node; // [count] freed by sonde_free
  uint32_t count;
  bool closed;
  uint64_t work; // edges looked at
} sonde_cut_path;

// The chain along edges that follows points on the skin at `position`.
sonde_status sonde_cut_path_find(const sonde_model *model, const sonde_copies *copies,
                                 const sonde_vec3 *position, const sonde_vec3 *point,
                                 uint32_t count, sonde_cut_path *path, sonde_error *error);

// Whether the skin is closed when the lips of its cuts are put together.
sonde_status sonde_skin_closes(const sonde_model *model, bool *closes, sonde_error *error);

#endif
