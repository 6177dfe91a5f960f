/**
 * @file identify.h
 * Damping and friction from motion: protocols of the virtual robot that move the probe in time,
 * their records, what is identified from them, and presets. docs/identify.md.
 */
#ifndef SONDE_IDENTIFY_H
#define SONDE_IDENTIFY_H

#include "sonde/robot.h"
#include "sonde/world.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sonde_protocol_kind {
  SONDE_PROTOCOL_RAMP_HOLD, /**< in at a speed, hold, out; once per speed */
  SONDE_PROTOCOL_SLIDE, /**< press, then to and fro across the skin with stops; fast moves repeated
                         */
} sonde_protocol_kind;

/** What the robot's sensors say at one instant. */
typedef struct sonde_motion_sample {
  double time_s;
  double penetration_m; /**< of the face's centre below the rest skin, along the site's normal */
  double slide_m;       /**< of the probe along the axis, from the site */
  double normal_n;      /**< push of the skin on the probe along the normal */
  double tangential_n;  /**< push of the probe on the skin along the axis */
} sonde_motion_sample;

/** A record in time; released by sonde_motion_record_clear(). */
typedef struct sonde_motion_record {
  sonde_protocol_kind protocol;
  uint32_t site;   /**< UINT32_MAX when the file does not say */
  char probe[256]; /**< name or mesh file; empty when the file does not say */
  char axis;       /**< 'u' around the leg or 'v' along it */
  double gel_film; /**< see sonde_friction; 0 when the file does not say */
  bool synthetic;  /**< made by sonde_protocol_run() */
  uint32_t count;
  sonde_motion_sample *samples; /**< [count] */
} sonde_motion_record;

enum { SONDE_PROTOCOL_SPEEDS = 8 };

/** What the robot does; validated by sonde_protocol_run(). */
typedef struct sonde_protocol {
  sonde_protocol_kind kind;
  uint32_t site;
  const char *probe; /**< name or mesh file; default linear */
  char axis;         /**< of the slide; default 'u' */
  double depth_m;    /**< default 12 mm for ramp-and-hold, 5 mm for the slide */
  double force_n;    /**< > 0: presses to this static force instead */
  double speed_m_s[SONDE_PROTOCOL_SPEEDS]; /**< default 20, 40, 80 mm/s; slide 10, 20, 60 */
  uint32_t speed_count;
  double hold_s;  /**< hold, and pause between moves; default 0.2, slide 0.1 */
  double slide_m; /**< length of a move; default 12 mm */
  double rate_hz; /**< of the samples; default 1000 */
  double noise_force_n, noise_position_m; /**< standard deviations of the sensors; default 0 */
  uint64_t seed;
} sonde_protocol;

SONDE_API sonde_protocol sonde_protocol_default(sonde_protocol_kind kind); /**< @thread any */

/** The world of protocols and identification: five Newton iterations per step. @thread any */
SONDE_API sonde_world_def sonde_identify_world(void);

/**
 * Moves the probe over the model in time and records what its sensors say.
 * @param def the world, its friction included; NULL: sonde_identify_world()
 * @param[out] record owned by the caller, marked synthetic
 * @return ARGUMENT naming the value out of range; NOT_FOUND (site, probe); CONVERGENCE when force_n
 *   is not reached; CANCELLED
 * @thread owner
 */
SONDE_API sonde_status sonde_protocol_run(const sonde_model *model, const sonde_world_def *def,
                                          const sonde_protocol *protocol,
                                          const sonde_progress *progress,
                                          sonde_motion_record *record, sonde_error *error);

/**
 * Reads `time_s,penetration_mm,slide_mm,normal_n,tangential_n` with comments `# key: value` for
 * protocol, site, probe, axis, gel_film and origin.
 * @return FORMAT naming file, line and what was expected: a missing column, times that do not
 *   increase, fewer than 50 samples, an unknown word; IO
 * @thread owner
 */
SONDE_API sonde_status sonde_motion_record_load(const char *path, sonde_motion_record *record,
                                                sonde_error *error);
/** Writes the same atomically. @thread owner */
SONDE_API sonde_status sonde_motion_record_save(const char *path, const sonde_motion_record *record,
                                                sonde_error *error);
SONDE_API void sonde_motion_record_clear(sonde_motion_record *record); /**< @thread owner */

/** One hold of a record without any model: F(t) = static + sum amplitude_k e^(-t/tau_k). */
typedef struct sonde_relaxation {
  double start_s, length_s;
  double depth_m, speed_m_s;       /**< of the hold; of the ramp before it */
  double peak_n, static_n;         /**< at the start of the hold; fitted at infinity */
  double ratio;                    /**< peak/static */
  double relaxation_s;             /**< when the excess over static has fallen to 1/e */
  double tau_s[2], amplitude_n[2]; /**< shorter first; amplitude 0: not needed */
  double power;                    /**< slope of ln F over ln t */
  double rms_n;                    /**< misfit of the exponentials */
} sonde_relaxation;

enum { SONDE_HOLDS = 32 };

/** Holds of a record after a ramp in, at most SONDE_HOLDS. @thread owner */
SONDE_API sonde_status sonde_relaxation_read(const sonde_motion_record *record,
                                             sonde_relaxation *holds, uint32_t *count,
                                             sonde_error *error);

/** One speed of a slide without any model, both directions together. */
typedef struct sonde_slide {
  double speed_m_s;
  double ratio;     /**< |tangential|/normal, median over the second half of the moves */
  double breakaway; /**< largest smoothed |tangential|/normal of the moves */
  double lean;      /**< half the difference between the directions: slope of the skin */
  uint32_t moves;
} sonde_slide;

/** Speeds of a slide record in ascending order, at most SONDE_HOLDS. @thread owner */
SONDE_API sonde_status sonde_slide_read(const sonde_motion_record *record, sonde_slide *slides,
                                        uint32_t *count, sonde_error *error);

/** An identified parameter with its 95 % interval. */
typedef struct sonde_estimate {
  double value, low, high;
  double relative_sd; /**< standard deviation of ln value */
  bool identified;    /**< the records determine it within a factor of 1.5 */
} sonde_estimate;

typedef struct sonde_identify_options {
  uint32_t max_iterations; /**< default 12 */
  uint32_t threads;        /**< 0: one per online core */
  sonde_world_def world;   /**< of the forward simulations */
} sonde_identify_options;

SONDE_API sonde_identify_options sonde_identify_options_default(void); /**< @thread any */

typedef struct sonde_damping_result {
  sonde_estimate normal_damping_s, stiffness_scale;
  sonde_estimate edge_damping_s; /**< the model's own value when not identified */
  double edge_sensitivity_n;     /**< RMS force per e-fold of edge_damping_s */
  double residual_n;             /**< RMS */
  uint32_t iterations, simulations, samples;
} sonde_damping_result;

/**
 * Normal damping, stiffness scale and, when the records hold it, edge damping: forward simulations
 * of the model along the recorded motion are fitted to the recorded normal force.
 * @param records ramp-and-hold records
 * @return MISMATCH for a site that the model lacks, CONVERGENCE, CANCELLED
 * @thread owner
 */
SONDE_API sonde_status sonde_identify_damping(const sonde_model *model,
                                              const sonde_motion_record *records, uint32_t count,
                                              const sonde_identify_options *options,
                                              const sonde_progress *progress,
                                              sonde_damping_result *result, sonde_error *error);

typedef struct sonde_friction_result {
  sonde_estimate mu_static, mu_kinetic; /**< as measured, under the records' gel film */
  sonde_estimate stribeck_speed_m_s;
  double gel_film;   /**< of the records */
  double residual_n; /**< RMS of the compared means, as noise of one sample */
  uint32_t iterations, simulations, samples;
} sonde_friction_result;

/**
 * Coefficients of friction: forward simulations along the recorded motion are fitted to the
 * recorded ratio of tangential to normal force and its ripple while the probe slides, so that a
 * model that is too soft or too stiff does not bias them.
 * @param records slides under one gel film
 * @return as above; estimates are not `identified` when the probe never slips
 * @thread owner
 */
SONDE_API sonde_status sonde_identify_friction(const sonde_model *model,
                                               const sonde_motion_record *records, uint32_t count,
                                               const sonde_identify_options *options,
                                               const sonde_progress *progress,
                                               sonde_friction_result *result, sonde_error *error);

/** What a practitioner sets; NaN keeps the model's own value. */
typedef struct sonde_preset {
  char name[64];
  double normal_damping_s, edge_damping_s; /**< default NaN */
  double damping_multiplier;               /**< of both; default 1 */
  double stiffness_scale;                  /**< of every spring; default 1 */
  sonde_friction friction;                 /**< default none */
} sonde_preset;

SONDE_API sonde_preset sonde_preset_default(void); /**< @thread any */
/** Reads a preset (JSON, docs/identify.md). @return FORMAT naming file, line, key and range; IO
 * @thread owner */
SONDE_API sonde_status sonde_preset_load(const char *path, sonde_preset *preset,
                                         sonde_error *error);
/** Writes it atomically after the same checks. @thread owner */
SONDE_API sonde_status sonde_preset_save(const char *path, const sonde_preset *preset,
                                         sonde_error *error);
/** Checks and applies; the model's site and node stiffnesses and its law change. @param model, def
 * either may be NULL @thread owner, before a state of the model exists */
SONDE_API sonde_status sonde_preset_apply(const sonde_preset *preset, sonde_model *model,
                                          sonde_world_def *def, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
