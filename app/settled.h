// A probe settled on a model: what `sonde press`, `sonde image`, `sonde slice --press` and the
// image's benchmark look at.
#ifndef SONDE_APP_SETTLED_H
#define SONDE_APP_SETTLED_H

#include "sonde/sonde.h"

typedef struct settled {
  bool without_springs; // set before it is opened: something else presses, and gives the tissue
  sonde_model *model;
  sonde_state *state;
  sonde_probe probe;
  sonde_interior *interior;
  sonde_interior_tissue *tissue; // NULL: the springs' skin moves the inside
  sonde_pose pose;               // world_from_probe
  double depth_m;                // along the beam from where the press began
  double force_n;                // along the beam, onto the skin
  sonde_settle_result result;
  sonde_path_result path; // of the last press
  uint32_t iterations;    // of all settling
} settled;

// preset: of damping and friction; NULL: none; not of one without springs. needs_interior: a model
// without a bone is refused; else its interior is NULL.
sonde_status settled_open(settled *s, const char *model, const char *probe,
                          const sonde_preset *preset, bool needs_interior, sonde_error *error);
void settled_close(settled *s);
// A site of the model, and the pose at rest there. @return SONDE_NOT_FOUND naming the model's file
sonde_status settled_site(const settled *s, const char *model, long number, sonde_pose *above,
                          sonde_error *error);
// The same at a station of the model by name or by the first letters of it ("popliteal"); NULL: at
// its first one. `number` 0 or more: at that site instead. @param[out] at what is said of the place
sonde_status settled_place(const settled *s, const char *model, long number, const char *station,
                           sonde_pose *above, char at[64], sonde_error *error);
// Where a pose's beam meets the rest skin, the pose moved there; false when it misses.
bool settled_on_skin(const settled *s, sonde_pose *pose);
// Settles with the face `depth_m` along the beam from `start`, hardly moved since the last
// settling.
void settled_at(settled *s, sonde_pose start, double depth_m, double residual);
// Presses slowly along the beam from `start`, on the skin at rest, to a depth or until the force is
// force_n (INFINITY: to the depth); shows progress. @return as sonde_settle_path()
sonde_status settled_press(settled *s, sonde_pose start, double depth_m, double force_n,
                           sonde_error *error);
// The same to a force, at most 60 mm deep.
sonde_status settled_force(settled *s, sonde_pose start, double force_n, sonde_error *error);
// Says on stderr where the last press met a jump of the skin; the same as a list in the JSON.
void settled_warn(const settled *s, const char *verb);
void settled_json_jumps(const settled *s);
// The interior at the settled state, in a cuff of that pressure (0: none).
void settled_update(const settled *s, const sonde_pathology *pathology, double cuff_pa,
                    uint64_t tick);

// Branches that the image plane meets below the probe: a line for each, or a JSON object "branches"
// of area ratios.
void settled_branches(const settled *s, bool json);

#endif
