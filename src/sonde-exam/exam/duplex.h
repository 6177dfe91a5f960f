// Doppler over a session's images: the patient's blood flow, run from image to image, the colour
// and the spectrum that a scanner makes of it. Belongs to the image thread.
#ifndef SONDE_SRC_DUPLEX_H
#define SONDE_SRC_DUPLEX_H

#include "sonde/exam.h"

// Sides of a box are at least this long; an image keeps this share of the colours so long before
// it, which is set by eye.
static const double sonde_duplex_least_m = 4e-3, sonde_duplex_persistence = 0.7,
                    sonde_duplex_image_s = 0.02;
enum { SONDE_DUPLEX_GRID = 9 }; // places each way where the tissue's motion is looked at

// What hand and patient did last, s of the session; -INFINITY: never.
typedef struct sonde_hand_moment {
  double squeeze_s, breath_s;
} sonde_hand_moment;

// Of one image.
typedef struct sonde_duplex_moment {
  double time_s;
  sonde_pose probe;
  const sonde_duplex_controls *controls;
  const sonde_circulation *circulation; // NULL: breath and beat as flow has them, no strain
  sonde_hand_moment hand;
} sonde_duplex_moment;

// What the next image's blood depends on.
typedef struct sonde_duplex_memory {
  uint32_t flows;
  sonde_flow_scene_memory scene;
} sonde_duplex_memory;

typedef struct sonde_duplex {
  const sonde_echo *echo;
  sonde_flow body; // of the patient, lying still, veins open
  sonde_flow_scene *scene;
  sonde_colour *colour;
  sonde_colour_cell *cells; // [SONDE_COLOUR_CELLS]
  bool flows;               // the network runs
  // tissue of the last picture with colour: at rest, by line and depth
  bool seen;
  double seen_s, seen_aperture_m, seen_depth_m;
  sonde_vec3 rest_m[SONDE_DUPLEX_GRID * SONDE_DUPLEX_GRID];
  sonde_gate *gate;
  // tissue in the gate when it was put last: at rest, when, and where the gate was
  sonde_vec3 gate_rest_m;
  double gated_s, gated_xz_m[2]; // NaN: never
} sonde_duplex;

// The duplex of a session's interior and echo, both borrowed. @thread owner
sonde_status sonde_duplex_create(const sonde_model *model, const sonde_interior *interior,
                                 const sonde_echo *echo, sonde_duplex **duplex, sonde_error *error);
void sonde_duplex_destroy(sonde_duplex *duplex); // NULL is fine
// `wanted` with every number usable: within its range, or from `before` where it is none.
sonde_duplex_controls sonde_duplex_clean(const sonde_duplex_controls *wanted,
                                         const sonde_duplex_controls *before);
// The blood up to an image, whose interior is updated: the network starts with the first image and
// goes on from image to image (hot).
void sonde_duplex_follow(sonde_duplex *duplex, const sonde_duplex_moment *moment);
// The blood of the vessels in that image, owned by the duplex (hot).
const sonde_vessel_blood *sonde_duplex_blood(const sonde_duplex *duplex);
// A stage of drawing: the cells' tissue moves as it came to its places since the last picture,
// blood moves with it; behind bone and where no gel or skin is nothing comes back (hot).
void sonde_duplex_move(sonde_duplex *duplex, const sonde_duplex_moment *moment,
                       const sonde_image *image, const sonde_colour_box *box, const float *coupling,
                       uint32_t lines);
// Colour over the picture that the echo has just drawn, into overlay->pixels[height * width] (hot).
// @param coupling [lines] of the picture, NULL: all coupled
void sonde_duplex_draw(sonde_duplex *duplex, const sonde_duplex_moment *moment,
                       const sonde_image *image, double frequency_hz, const float *coupling,
                       uint32_t lines, sonde_frame_colour *colour);
// Puts the gate into that picture and hands over the columns that came since it was put first, in
// column[SONDE_GATE_COLUMNS] (hot).
void sonde_duplex_hear(sonde_duplex *duplex, const sonde_duplex_moment *moment,
                       const sonde_image *image, double frequency_hz, const float *coupling,
                       uint32_t lines, sonde_gate_column *column, sonde_gate_spectrum *spectrum);
// The next picture holds nothing of those before (hot).
void sonde_duplex_forget(sonde_duplex *duplex);
sonde_duplex_memory sonde_duplex_remember(const sonde_duplex *duplex);
void sonde_duplex_recall(sonde_duplex *duplex, const sonde_duplex_memory *memory);

#endif
