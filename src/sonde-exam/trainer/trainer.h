// Inside of the trainer: what its files share.
#ifndef SONDE_SRC_TRAINER_H
#define SONDE_SRC_TRAINER_H

#include "base/base.h"
#include "base/maths.h"
#include "files/yaml.h"
#include "sonde/trainer_operator.h"

// Segments that are named at all, those of the main vein first; vessels of an interior before its
// branches.
enum { TRAINER_SEGMENTS = 13, MAIN_SEGMENTS = 8, TRAINER_FIRST_BRANCH = 2 };
// @param kind what a clot there means; may be NULL
const char *sonde_segment_known(uint32_t i, sonde_segment_kind *kind);
// The segment that a branch belongs to; NULL: none.
const char *sonde_segment_of_branch(const char *branch);

// What people call a vessel in view: "great_saphenous" is the great saphenous vein; the main ones
// are called by the part of the leg.
void sonde_vessel_title(const sonde_vein_map *map, const sonde_vessel_view *view, char *title,
                        size_t size);

// Copies a text of a map into a member of `size` bytes; too long a text is an error.
void sonde_read_member(sonde_reader *reader, sonde_place map, const char *key, bool needed,
                       char *to, size_t size);
// A place: a number of mm from the groin end, or a map with station, landmark, segment or share.
void sonde_read_station(sonde_reader *reader, sonde_place at, const char *what,
                        sonde_station *station);

// The places of a protocol or a lesson, 1 to SONDE_EXAM_STOPS of them.
void sonde_read_stops(sonde_reader *reader, sonde_place root, sonde_exam_protocol *out);

// A file of a directory that ends with .yaml is handed to `load`, which fills one item.
typedef sonde_status (*sonde_item_load)(const char *path, void *item, sonde_error *error);
// Loads all of them in the order of their names. @param items [*count] freed by sonde_free
sonde_status sonde_load_directory(const char *directory, size_t item_bytes, sonde_item_load load,
                                  void **items, uint32_t *count, sonde_error *error);

// A distance along the main vein of one map where another map of the same leg has that place: by
// shares of the segments. NaN stays.
double sonde_vein_course(const sonde_vein_map *from, const sonde_vein_map *to, double along_m);

// A double vein is as open as the one of the two that is; NaN when the first is not in view.
static inline double sonde_vein_ratio(const sonde_snapshot *s) {
  double first = s->vein_area_ratio;
  return isfinite(first) ? fmax(first, s->other_vein_ratio) : first;
}

// Places of one station: one press is at both.
static inline bool sonde_same_stand(const sonde_plan_point *a, const sonde_plan_point *b) {
  return a->station && b->station && a->held == b->held &&
         v_distance(a->at.skin_m, b->at.skin_m) < 1e-9;
}

#endif
