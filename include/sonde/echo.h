/**
 * @file echo.h
 * The echographic image of the deformed thigh: scan lines, speckle that belongs to the tissue,
 * attenuation, bone echo and shadow, log compression, scan conversion.
 */
#ifndef SONDE_ECHO_H
#define SONDE_ECHO_H

#include "sonde/interior.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What the operator sets on the scanner. */
typedef struct sonde_echo_settings {
  double frequency_hz;     /**< 1-12 MHz; default 7.5 MHz */
  double depth_m;          /**< imaged depth, 20-150 mm; default 70 mm */
  double gain_db;          /**< overall gain, -30..30; default 0 */
  double dynamic_range_db; /**< 30-90; default 60 */
  double focus_m;          /**< default 25 mm */
  double tgc_db_per_m;     /**< slope of the time-gain compensation on top of the default's, default
                                0; the compensation ends at 112 dB, where muscle is 6 dB above the
                                receiver's noise, and falls by 10 dB behind that depth */
} sonde_echo_settings;

SONDE_API sonde_echo_settings sonde_echo_settings_default(void); /**< @thread any */
/** Range of one setting, in the unit in which the page and the command line give it. */
typedef struct sonde_echo_range {
  const char *key;      /**< with the unit, e.g. "depth_mm" */
  double low, high, si; /**< si: factor to the unit of the member */
  size_t offset;        /**< of the member in sonde_echo_settings */
} sonde_echo_range;
enum { SONDE_ECHO_SETTINGS = 6 };
/** All settings. @return [SONDE_ECHO_SETTINGS] @thread any */
SONDE_API const sonde_echo_range *sonde_echo_ranges(void);
/** Clamps every field into its range and replaces NaN by the default. @thread any */
SONDE_API sonde_echo_settings sonde_echo_settings_clamp(sonde_echo_settings settings);

/** Slope of the time-gain compensation that belongs to tgc_db_per_m = 0 (round trip through mean
 *  soft tissue); set tgc_db_per_m to its negative to switch compensation off. @thread any */
SONDE_API double sonde_echo_default_tgc_db_per_m(double frequency_hz);

/** Grey image, row 0 at the probe, column 0 at negative x of the probe frame. */
typedef struct sonde_image {
  uint32_t width, height;
  double width_m, height_m; /**< physical size of the picture; square pixels */
  double top_m;             /**< z of its upper edge in the probe frame: 0 of a flat face; above the
                                 middle of a curved one, whose outer lines start higher: negative */
  uint64_t tick;            /**< of the state it shows */
  uint8_t *pixels;          /**< [height*width] owned by the image */
} sonde_image;

SONDE_API sonde_status sonde_image_create(uint32_t width, uint32_t height, sonde_image *image,
                                          sonde_error *error); /**< @thread owner */
SONDE_API void sonde_image_clear(sonde_image *image);          /**< @thread owner */

typedef struct sonde_echo sonde_echo;

/** Options fixed at creation; zero selects the default. */
typedef struct sonde_echo_def {
  uint32_t version;         /**< SONDE_DEF_VERSION, from sonde_echo_def_default() */
  uint32_t line_count;      /**< default 192 */
  uint32_t sample_count;    /**< per line, default 1024 */
  double scatterers_per_m3; /**< default: enough for developed speckle */
  uint64_t seed;
  bool plain;                          /**< tissue without septa and bundles, for measurements */
  const struct sonde_scanner *scanner; /**< echo_scanner.h, copied; NULL: the plain scanner */
  bool rolling; /**< a live picture: each render draws the next look of the scanner and shows the
                     mean with the last ones, under its persistence; else every picture is drawn
                     from all looks */
} sonde_echo_def;

/** All zero but the version. @thread any */
SONDE_API sonde_echo_def sonde_echo_def_default(void);

/** @param interior borrowed, its updates feed the images @param def NULL: the default @thread owner
 */
SONDE_API sonde_status sonde_echo_create(const sonde_interior *interior, const sonde_echo_def *def,
                                         sonde_echo **echo, sonde_error *error);
SONDE_API void sonde_echo_destroy(sonde_echo *echo); /**< @thread owner */

/**
 * Renders the image plane (x-z) of the probe from the interior's current state. Lines above air
 * (no contact) stay dark with reverberation at the face.
 * @param aperture_m lateral width of the array, e.g. 2*probe->half_x_m
 * @thread owner of the echo, not while the interior updates; no allocation
 */
SONDE_API void sonde_echo_render(sonde_echo *echo, sonde_pose world_from_probe, double aperture_m,
                                 const sonde_pathology *pathology,
                                 const sonde_echo_settings *settings, sonde_image *image);

/** Steps that a new beam takes in all (docs/echo.md tells what they cost). */
#define SONDE_ECHO_PREPARE_STEPS 42
/**
 * Builds the beam that other frequency, focus, depth or aperture need beside the one in use, at
 * most `steps` steps of it per call; renders in between go on with their own settings. Without it,
 * or before it is ready, the next render with these settings does what is left. Asking for another
 * beam drops the one under way.
 * @return true when a render with these settings finds its beam ready
 * @thread owner of the echo; no allocation
 */
SONDE_API bool sonde_echo_prepare(sonde_echo *echo, double aperture_m,
                                  const sonde_echo_settings *settings, uint32_t steps);

/** CPU time of the stages of the last render, and scatterers moved with the tissue. */
typedef struct sonde_echo_times {
  double settings_s, plane_s, medium_s, scatter_s, beam_s, picture_s;
  uint32_t scatterers, blood; /**< blood: those of them in the lumina */
  uint32_t lost; /**< pieces of tissue in view that were not drawn for want of room; 0 in every
                      view that sonde_echo_check_view() allows */
} sonde_echo_times;
SONDE_API sonde_echo_times sonde_echo_last_times(const sonde_echo *echo); /**< @thread owner */

/** Blood of one vessel in a picture, such as a network of veins lets flow. */
typedef struct sonde_vessel_blood {
  double path_m;    /**< of the mean flow so far, along the vessel's axis */
  double speed_m_s; /**< mean over the section now, along the axis */
  double rouleaux;  /**< how far the red cells of slow blood have stuck together, 0 to 1: then it is
                         12 dB brighter, in streaks */
  double shut;      /**< how far the cusps of its valves have come together, 0 to 1 */
} sonde_vessel_blood;

/** Motion of the blood. Profiles are parabolic. Without `blood` it is a function of the time alone:
 *  speeds are means over the section and over time, the artery's follows its pulse above the
 *  diastolic pressure, veins flow against the z of the leg and arteries along it; behind a plug of
 *  clot a vein's blood stands. */
typedef struct sonde_echo_flow {
  double t_s;                      /**< default 0 */
  double vein_m_s, artery_m_s;     /**< default 0.08 and 0.13 */
  sonde_circulation circulation;   /**< gives the pulse */
  const sonde_vessel_blood *blood; /**< [vessels of the interior] borrowed until another flow is
                                      set; NULL (default): from the time */
} sonde_echo_flow;
SONDE_API sonde_echo_flow sonde_echo_flow_default(void); /**< @thread any */
/** Blood of the following renders; finite fields. @thread owner */
SONDE_API void sonde_echo_set_flow(sonde_echo *echo, const sonde_echo_flow *flow);

/** Gel or air below each line of the following renders: the share of the echoes' amplitude that
 *  passes, 0..1 (NaN: 0); the rest reverberates at the face. NULL (default): all, wherever the skin
 *  touches. @param coupling [line_count] copied @thread owner */
SONDE_API void sonde_echo_set_coupling(sonde_echo *echo, const float *coupling);

/** Radius of a curved face (m, 20 mm and more), its aperture measured along the arc; 0: flat. An
 *  echo begins with its scanner's.
 *  @return SONDE_ARGUMENT @thread owner */
SONDE_API sonde_status sonde_echo_set_radius(sonde_echo *echo, double radius_m, sonde_error *error);
/** Whether a face can be drawn whole to every depth: an array of 5 to 200 mm, flat or on an arc of
 *  at most 100 degrees. @param radius_m of a curved face, 0: flat
 *  @return SONDE_ARGUMENT @thread any */
SONDE_API sonde_status sonde_echo_check_view(double aperture_m, double radius_m,
                                             sonde_error *error);
/** Chooses the inner loops: "avx512", "avx2", "base" (the widest that runs here is the default) or
 *  "plain" without vectors. @return SONDE_NOT_FOUND when this processor lacks them @thread owner */
SONDE_API sonde_status sonde_echo_set_kernels(sonde_echo *echo, const char *name,
                                              sonde_error *error);
SONDE_API const char *sonde_echo_kernels(const sonde_echo *echo); /**< @thread owner */

/** Envelope before log compression of the last render, mean of the scanner's looks:
 *  [sample_count*line_count], sample-major. @thread owner */
SONDE_API const float *sonde_echo_envelope(const sonde_echo *echo, uint32_t *lines,
                                           uint32_t *samples);

#ifdef __cplusplus
}
#endif
#endif
