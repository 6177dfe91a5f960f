// Inside of the trainer: what its files share.
#ifndef SONDE_SRC_TRAINER_H
#define SONDE_SRC_TRAINER_H

#include "base/base.h"
#include "base/maths.h"
#include "files/yaml.h"
#include "sonde/trainer_operator.h"

// Copies a text of a map into a member of `size` bytes; too long a text is an error.
void sonde_read_member(sonde_reader *reader, sonde_place map, const char *key, bool needed,
                       char *to, size_t size);
// A station: a number of mm from the groin end, or {segment, share, shift_mm}.
void sonde_read_station(sonde_reader *reader, sonde_place at, const char *what,
                        sonde_station *station);

// A file of a directory that ends with .yaml is handed to `load`, which fills one item.
typedef sonde_status (*sonde_item_load)(const char *path, void *item, sonde_error *error);
// Loads all of them in the order of their names. @param items [*count] freed by sonde_free
sonde_status sonde_load_directory(const char *directory, size_t item_bytes, sonde_item_load load,
                                  void **items, uint32_t *count, sonde_error *error);

// A double vein is as open as the one of the two that is; NaN when the first is not in view.
static inline double sonde_vein_ratio(const sonde_snapshot *s) {
  double first = s->vein_area_ratio;
  return isfinite(first) ? fmax(first, s->other_vein_ratio) : first;
}

#endif
