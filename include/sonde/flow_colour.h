/**
 * @file flow_colour.h
 * Colour Doppler: what flows in the vessels of a pressed model, laid on a grid of cells in the
 * image plane, and the autocorrelation estimate that a scanner makes of it from packets of pulses.
 * docs/flow.md, docs/flow_theory.md.
 */
#ifndef SONDE_FLOW_COLOUR_H
#define SONDE_FLOW_COLOUR_H

#include "sonde/echo.h"
#include "sonde/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SONDE_COLOUR_LINES = 96,
  SONDE_COLOUR_ROWS = 128,
  SONDE_COLOUR_CELLS = SONDE_COLOUR_LINES * SONDE_COLOUR_ROWS
};
#define SONDE_COLOUR_NO_VESSEL UINT32_MAX

/** Where the colour is: a box of the image plane whose sides lean with the beam; before a curved
 *  face a sector between two lines of its fan. */
typedef struct sonde_colour_box {
  double left_m, right_m; /**< at the face, from its middle: x of the probe frame, of a curved face
                               along the arc */
  double top_m, bottom_m; /**< depths, of a curved face along the lines */
  double steer_rad;       /**< of a flat face's beam towards +x, -0.5 to 0.5 */
  double radius_m;        /**< of a curved face; 0: flat */
} sonde_colour_box;
/** Middle of a cell in the image plane: x and z of the probe frame, m. @thread any (tick) */
SONDE_API void sonde_colour_place(const sonde_colour_box *box, uint32_t line, uint32_t row,
                                  double xz_m[2]);
/** The cell of a place in the image plane, in whole cells and shares of them from the middle of the
 * first; false beside the box. @thread any (tick) */
SONDE_API bool sonde_colour_find(const sonde_colour_box *box, double x_m, double z_m,
                                 double line_row[2]);

/** What moves in a cell. */
typedef struct sonde_colour_cell {
  float towards_m_s; /**< along the beam, towards the probe */
  float across_m_s;  /**< across it */
  uint32_t vessel;   /**< whose blood it is, or SONDE_COLOUR_NO_VESSEL: tissue */
  float loss_db;     /**< of its echo, more than what the compensation makes up for: in a shadow */
} sonde_colour_cell;

/** The chain behind the colour. */
typedef struct sonde_colour_def {
  double frequency_hz, pulse_hz; /**< carrier, 1e6 to 2e7; pulse repetition, 100 to 2e4 */
  uint32_t packet;               /**< pulses per estimate, 4 to 16; default 10 */
  uint32_t filter_order;         /**< of the polynomials that the wall filter takes out, 0 to 3;
                                      default 1 */
  double beam_m;                 /**< standard deviation of the beam's width; default 0.45 mm */
  double noise_db, clutter_db;   /**< noise over the blood's echo, default -15; tissue's, 35 */
  double persistence;            /**< share of the estimate before, 0 to 0.95; default 0 */
  uint64_t seed;                 /**< of scatterers and noise */
} sonde_colour_def;
SONDE_API sonde_colour_def sonde_colour_def_default(void); /**< @thread any */
/** Highest velocity along the beam that is not folded: c pulse_hz / (4 f). @thread any */
SONDE_API double sonde_colour_limit(const sonde_colour_def *def);

typedef struct sonde_colour sonde_colour;
/** @return ARGUMENT naming the value, MEMORY. @thread owner */
SONDE_API sonde_status sonde_colour_create(const sonde_colour_def *def, sonde_colour **colour,
                                           sonde_error *error);
SONDE_API void sonde_colour_destroy(sonde_colour *colour); /**< NULL is fine. @thread owner */
/** Other numbers from the next frame on, but for the seed; without allocation.
 *  @return false when one is out of range: then nothing changed @thread tick */
SONDE_API bool sonde_colour_tune(sonde_colour *colour, const sonde_colour_def *def);
/** The number of the next frame, which chooses its random numbers; frames count from 0 by
 *  themselves. @param holds whether it keeps its share of the frame before @thread tick */
SONDE_API void sonde_colour_next(sonde_colour *colour, uint64_t number, bool holds);

/** What the estimate holds of a cell. */
typedef struct sonde_colour_value {
  float velocity_m_s; /**< towards the probe, folded at the limit */
  float power;        /**< behind the wall filter, over what noise alone leaves there */
} sonde_colour_value;
/** Power from which a cell is shown in colour: noise alone stays below. */
#define SONDE_COLOUR_POWER 2.5f

/**
 * A packet of pulses on every cell: blood that moves and loses its pattern with the beam's passage,
 * mixed over neighbours by the beam, tissue, noise; wall filter, lag-one autocorrelation, averages
 * over 3 x 3 cells, persistence.
 * @param cells [SONDE_COLOUR_CELLS] row by row; lines beside each other; tissue that moves shows,
 *   too
 * @return [SONDE_COLOUR_CELLS] owned by the colour, until the next frame
 * @thread tick
 */
SONDE_API const sonde_colour_value *sonde_colour_frame(sonde_colour *colour,
                                                       const sonde_colour_cell *cells);

/** Colour over a rectangle of an image's pixels. */
typedef struct sonde_colour_overlay {
  uint32_t left, top, width, height; /**< of the pixels that hold the box */
  uint8_t *pixels; /**< [height * width]; 0: none. Velocity from the limit away (1) over 0 (128) to
                        the limit towards the probe (255); power from the least that is shown (1)
                        over 25 dB */
} sonde_colour_overlay;
/**
 * The last frame over the picture: bilinear between cells, velocities as phases, so that folds stay
 * sharp. Where the picture is brighter than 110 of 255 it has priority.
 * @param gain_db of the power before the threshold SONDE_COLOUR_POWER
 * @param power how much moves instead of how fast
 * @param[in,out] overlay pixels with room for all of the image; the rest is set
 * @thread tick
 */
SONDE_API void sonde_colour_paint(sonde_colour *colour, const sonde_colour_box *box, double gain_db,
                                  bool power, const sonde_image *image,
                                  sonde_colour_overlay *overlay);

/* ---- vessels of a pressed model ----------------------------------------------------------- */

/** The vessels of an interior with what the network lets flow in them. */
typedef struct sonde_flow_scene sonde_flow_scene;
/** @param limb of the model, NULL: typical veins @param interior borrowed
 *  @return MEMORY @thread owner */
SONDE_API sonde_status sonde_flow_scene_create(const sonde_limb *limb,
                                               const sonde_interior *interior,
                                               sonde_flow_scene **scene, sonde_error *error);
SONDE_API void sonde_flow_scene_destroy(sonde_flow_scene *scene); /**< @thread owner */
/** Sets what is closed of the veins of a definition to what probe and clots leave of the sections
 *  now: the share that gives the vein's whole length its resistance. @thread owner */
SONDE_API void sonde_flow_scene_narrow(const sonde_flow_scene *scene, sonde_flow_def *def);
/** Runs a network to a time and takes flows and profiles, which go on from those of the last run
 *  when the network does, else begin steady; arteries at the heart's share of the beat.
 *  @thread owner; no allocation */
SONDE_API void sonde_flow_scene_run(sonde_flow_scene *scene, sonde_flow *flow, double until_s);
/** All that the next run goes on from. */
typedef struct sonde_flow_scene_memory {
  sonde_flow flow; /**< as the last run left it */
  double profile_m_s[SONDE_FLOW_SEGMENTS][SONDE_FLOW_RINGS], artery_m_s[SONDE_FLOW_RINGS];
  double clearing_m3_s[SONDE_FLOW_SEGMENTS]; /**< the flow by which rouleaux form and break up */
  double path_m[2 + SONDE_BRANCHES];         /**< of each vessel's blood */
} sonde_flow_scene_memory;
/** @thread owner; no allocation */
SONDE_API sonde_flow_scene_memory sonde_flow_scene_remember(const sonde_flow_scene *scene);
/** Goes on from there. @thread owner; no allocation */
SONDE_API void sonde_flow_scene_recall(sonde_flow_scene *scene,
                                       const sonde_flow_scene_memory *memory);
/** What moves in the cells of a box now: lumina as the interior has them, at the places where the
 *  echo's last picture draws them, velocities against the beam at each line.
 *  @param box of the radius of the echo's face
 *  @param[out] cells [SONDE_COLOUR_CELLS] @thread owner; no allocation */
SONDE_API void sonde_flow_scene_cells(const sonde_flow_scene *scene, const sonde_echo *echo,
                                      const sonde_colour_box *box, sonde_colour_cell *cells);
/** From the next run on the blood below is that of the sections nearest to a probe's axis.
 *  @thread owner; no allocation */
SONDE_API void sonde_flow_scene_show(sonde_flow_scene *scene, sonde_pose world_from_probe);
/** The blood there of each vessel of the interior, for the picture of sonde_echo_set_flow(). It
 *  stands where probe or clot close the vein. Red cells stick together where it has been slow for
 *  seconds, and part where it is fast; cusps follow it.
 *  @return [vessels of the interior] of the last run; owned by the scene @thread owner */
SONDE_API const sonde_vessel_blood *sonde_flow_scene_blood(const sonde_flow_scene *scene);
/** Mean velocity of a vessel of the interior towards the heart (veins) or away from it (arteries)
 *  in the section that lies nearest to the probe's axis, m/s; 0 when it is closed.
 *  @thread owner */
SONDE_API double sonde_flow_scene_velocity(const sonde_flow_scene *scene, uint32_t vessel,
                                           sonde_pose world_from_probe);

#ifdef __cplusplus
}
#endif
#endif
