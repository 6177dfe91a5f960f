/**
 * @file exam.h
 * Cases, sessions (one trainee, one thigh, one probe), recording and replay.
 */
#ifndef SONDE_EXAM_H
#define SONDE_EXAM_H

#include "sonde/exam_journal.h"
#include "sonde/echo.h"
#include "sonde/flow_gate.h"
#include "sonde/haptics_render.h"
#include "sonde/identify.h"
#include "sonde/interior_findings.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What Doppler lays over the image: velocity along the beam, or how much moves. */
typedef enum sonde_duplex_shown {
  SONDE_DUPLEX_OFF,
  SONDE_DUPLEX_VELOCITY,
  SONDE_DUPLEX_POWER
} sonde_duplex_shown;

/** The scanner's Doppler, on flat faces; numbers out of range are clamped. */
typedef struct sonde_duplex_controls {
  sonde_duplex_shown shown;
  sonde_colour_box box; /**< cut to the image; sides lean by up to 20 degrees */
  double scale_m_s;     /**< velocity along the beam from which colour folds, 0.01 to 1; less where
                             the pulses' way to the box and back takes longer */
  double gain_db;       /**< -30 to 20 */
  bool gated;           /**< pulsed Doppler is on */
  sonde_gate_settings gate;
} sonde_duplex_controls;
/** Off; a box of 28 mm by 30 mm, 6 cm/s, 0 dB; the usual gate. @thread any */
SONDE_API sonde_duplex_controls sonde_duplex_controls_default(void);

/** What changes a session besides the probe's pose; applied at the start of a tick. */
typedef struct sonde_session_controls {
  uint32_t probe; /**< index into the session's probes */
  sonde_pathology pathology;
  sonde_echo_settings echo;
  bool stop;       /**< emergency stop pressed (latched until resume) */
  uint32_t resume; /**< counts resumes */
  // the skin: a film of gel drives friction and image while `gel` is on
  bool gel;
  uint32_t gel_put;  /**< counts: each step puts 2 ml on the skin nearest to the probe's face */
  uint32_t gel_wipe; /**< counts: each step leaves dry skin */
  // the patient, of a session with def.circulate
  sonde_posture posture;
  bool valsalva; /**< strains as long as it is set */
  // blood: the free hand, a deep breath, and what the scanner shows of it
  uint32_t squeeze;     /**< counts: each step squeezes the calf for 1.5 s */
  uint32_t deep_breath; /**< counts: each step is one deep breath in and out, 5 s */
  sonde_duplex_controls duplex;
  // the practitioner's bench
  uint32_t preset;        /**< index into the session's presets */
  double stiffness_scale; /**< of every spring of that preset, 0.5 to 2 */
  double damping_scale;   /**< of every damper, 0.25 to 4 */
  double friction_scale;  /**< of every coefficient of friction, 0 to 2 */
} sonde_session_controls;

enum { SONDE_SESSION_PRESETS = 2 };

typedef struct sonde_frame sonde_frame;

typedef struct sonde_session_def {
  const sonde_model *model;       /**< borrowed */
  const char *model_path;         /**< written into the recording; may be NULL */
  const char *const *probe_names; /**< NULL-terminated; NULL: all built-in */
  sonde_world_def world;
  sonde_safety_limits limits;
  sonde_render_def rendering;                  /**< coupling and force scale; default none, 1 */
  sonde_session_controls controls;             /**< at the start; the counters count from there */
  uint32_t preset_count;                       /**< 0: the model's springs and world.friction */
  sonde_preset presets[SONDE_SESSION_PRESETS]; /**< tissues to compare; controls.preset chooses */
  double gel_m3;                  /**< spread over the model's sites at the start; default 0 */
  bool circulate;                 /**< circulation gives the vessels' pressures, not the case */
  sonde_circulation circulation;  /**< posture and strain follow the controls */
  const sonde_findings *findings; /**< copied; NULL: none */
  const struct sonde_scanner *scanner; /**< copied; live pictures by it (echo_scanner.h); NULL: the
                                            plain one */
  /** Copied; bears the probe (exam_solid.h); NULL: springs do. */
  const struct sonde_session_solid *solid;
  uint32_t image_width, image_height; /**< default 512 x 512 */
  uint32_t ticks_per_image;           /**< lockstep: an image every so many ticks; real time: no
                                           more often, when the image thread is free; default 20 */
  const char *record_path;            /**< NULL: no recording; format: docs/recording.md. A file
                                           that is there gets the name PATH.old */
  const char *record_setup;           /**< text of a SONDE_NOTE_SETUP that is on the disk before the
                                           first tick; NULL: none */
  /** Gets every image, also those that no reader of sonde_session_frame() sees; NULL: nobody.
   *  @thread image thread, or the owner's in lockstep and in sonde_session_stop() */
  void (*watch)(void *user, const sonde_frame *frame);
  void *watch_user;
} sonde_session_def;

/** Healthy vein, first probe, default limits and world, no gel, constant pressures. @thread any */
SONDE_API sonde_session_def sonde_session_def_default(void);

enum { SONDE_VEIN_CROSSINGS = 24 };
/** Where the image plane cuts a vein beside the main one. */
typedef struct sonde_vein_crossing {
  uint32_t vessel;   /**< index of sonde_interior_vessel_name() */
  double area_ratio; /**< current / rest */
  double aside_m;    /**< from the beam axis, along the probe's x */
  sonde_vec3 rest_m; /**< on its course at rest */
} sonde_vein_crossing;

/** Everything a viewer shows of one tick; copied as a whole through a mailbox. */
typedef struct sonde_snapshot {
  uint64_t tick;
  double time_s;
  sonde_pose world_from_probe;
  uint32_t probe;
  sonde_vec3 force_n;          /**< of the tissue on the probe */
  sonde_vec3 rendered_force_n; /**< after the limits */
  double force_normal_n;       /**< along the probe's axis, > 0 when pressed */
  double penetration_m;        /**< of the face's centre below the rest skin, along the axis;
                                    negative above the skin */
  double contact_volume_m3, contact_area_m2;
  double vein_area_ratio, artery_area_ratio; /**< at the image plane; NaN when not in view */
  double other_vein_ratio; /**< greatest of doubled femoral and popliteal veins there; NaN: none */
  double vein_short_m;     /**< AP diameter */
  sonde_vec3 vein_rest_m;  /**< where the image plane cuts the vein, on its course at rest; NaN when
                                not in view */
  double vein_tilt_rad;    /**< between the vein and the normal of the image plane, 0: transverse */
  uint32_t crossing_count;
  sonde_vein_crossing crossing[SONDE_VEIN_CROSSINGS]; /**< [crossing_count] other veins, in the
                                                         order of the vessels */
  uint32_t view_count;
  sonde_vessel_view view[SONDE_VESSEL_VIEWS]; /**< [view_count] what the picture has of vessels */
  double gel_volume_m3; /**< on the skin; NaN while the controls' gel is off */
  double gel_coupling;  /**< mean over the lines of the image, 0..1; likewise */
  double venous_pressure_pa, arterial_pressure_pa; /**< in the vessels */
  bool solid;                                      /**< bears the probe; no contact volume */
  uint32_t awake_nodes, solver_iterations, flags;
  uint32_t restores; /**< times the probe was taken off and the skin restored to rest, because the
                          probe's path would have turned it inside out (docs/exam.md) */
  sonde_fault fault;
} sonde_snapshot;

typedef struct sonde_session sonde_session;

/** Builds world, interior, echo and recorder.
 *  @param device moved into the session and zeroed; on failure it stays the caller's
 *  @param[out] session released by sonde_session_destroy()
 *  @return SONDE_ARGUMENT, SONDE_NOT_FOUND (a probe), SONDE_IO (the recording), SONDE_MEMORY
 *  @thread owner */
SONDE_API sonde_status sonde_session_create(const sonde_session_def *def, sonde_device *device,
                                            sonde_session **session, sonde_error *error);
/** Stops the threads, ends the recording, frees; NULL is ignored. A session without a single tick
 *  and without a setup leaves no recording.
 *  @return as sonde_session_finish(); what the disk did not take is lost then
 *  @thread owner */
SONDE_API sonde_status sonde_session_destroy(sonde_session *session, sonde_error *error);

/** Adds a note to the recording, if there is one: on the disk some milliseconds later in real time,
 *  after the next tick or the end in lockstep.
 *  @param tick ticks before what it is about @param text one JSON object, copied
 *  @return ARGUMENT for a text that is too long; MEMORY @thread any */
SONDE_API sonde_status sonde_session_note(sonde_session *session, sonde_note_kind kind,
                                          uint64_t tick, const char *text, sonde_error *error);
/** Stops the threads, ends the recording and brings it to the disk. No tick may follow. After DISK
 * or IO everything that the disk did not take still waits in memory, and another call tries again.
 *  @return DISK also when inputs were lost before (sonde_session_recording() tells)
 *  @thread owner */
SONDE_API sonde_status sonde_session_finish(sonde_session *session, sonde_error *error);
/** How the recording goes. @thread owner */
SONDE_API sonde_recording_state sonde_session_recording(const sonde_session *session);

/** One tick in lockstep: device, world, limits, recorder; every ticks_per_image-th tick also the
 *  inside and the image. @thread owner, only while no loop runs */
SONDE_API void sonde_session_tick(sonde_session *session);
/** Starts the tick thread (one tick per world.dt_s), the image thread and the recorder's thread;
 *  a running session stays as it is. @thread owner */
SONDE_API sonde_status sonde_session_start(sonde_session *session, sonde_error *error);
/** Joins them; ticks go on in lockstep or after another start. @thread owner */
SONDE_API void sonde_session_stop(sonde_session *session);

/** New controls, taken over at the next tick; never waits. Values out of range are clamped, those
 *  that are not finite and unknown probes keep what was set. @thread any one thread */
SONDE_API void sonde_session_control(sonde_session *session,
                                     const sonde_session_controls *controls);
/** The controls set last, after clamping. @thread any */
SONDE_API sonde_session_controls sonde_session_controls_now(const sonde_session *session);
/** For sonde_device_page_goal(). @thread any */
SONDE_API sonde_device *sonde_session_device(sonde_session *session);

/** Colour over a frame's image. */
typedef struct sonde_frame_colour {
  sonde_duplex_shown shown;  /**< OFF: none, nothing else is set */
  sonde_colour_box box;      /**< as it was drawn */
  double limit_m_s;          /**< velocity along the beam from which it folds */
  sonde_colour_overlay over; /**< its pixels belong to the frame */
} sonde_frame_colour;

/** Newest finished frame: snapshot, skin and image of one and the same tick. */
struct sonde_frame {
  sonde_snapshot snapshot;
  const float *skin_m;   /**< [nodes*3] deformed positions */
  const uint8_t *pixels; /**< [height*width] */
  uint32_t width, height;
  double width_m, height_m;
  double top_m;    /**< z of the picture's upper edge, as in sonde_image */
  double radius_m; /**< of the scanner's curved face, 0: flat */
  sonde_frame_colour colour;
  sonde_gate_spectrum spectrum; /**< its columns belong to the frame */
};
/** Newest frame since the last call, false when nothing is new; the pointers stay valid until the
 *  next call. @thread any, one reader */
SONDE_API bool sonde_session_frame(sonde_session *session, sonde_frame *frame);

/** Fault that is latched, e.g. to resume when a lost device is back. @thread any */
SONDE_API sonde_fault sonde_session_fault(const sonde_session *session);
/** Ticks and images so far. @thread any */
SONDE_API uint64_t sonde_session_ticks(const sonde_session *session);
SONDE_API uint64_t sonde_session_images(const sonde_session *session); /**< @thread any */
/** Age of the pose that a finished image shows, seconds: `fraction` of the images since the
 * creation are at most so old, to 0.25 ms; NaN before the first in real time. From the tick's
 * reading of the device to the frame that sonde_session_frame() gives. @thread any */
SONDE_API double sonde_session_latency(const sonde_session *session, double fraction);
/** State hash now; 0 while the loop runs. @thread owner */
SONDE_API uint64_t sonde_session_hash(sonde_session *session);
/** Counters of the running loop, or of the last one. @thread owner and any one other while the
 *  session runs */
SONDE_API sonde_loop_stats sonde_session_loop(const sonde_session *session);

/** Result of playing a recording again. */
typedef struct sonde_replay_result {
  uint64_t ticks;
  uint64_t recorded_hash, hash; /**< recorded_hash: 0 for a file without an end */
  bool same;                    /**< also every state hash on the way */
  uint64_t different_tick;      /**< of the first of them that differs, 0: none */
  uint32_t checks;              /**< state hashes on the way that were compared */
  uint64_t images, recorded_image_hash, image_hash;
  bool same_images; /**< false when images were not made */
  char model_path[512];
} sonde_replay_result;

/** A device that plays the poses of a recording again; absent after the last.
 *  @return FORMAT/CHECKSUM/VERSION for an unusable file @thread owner */
SONDE_API sonde_status sonde_device_recording(const char *path, sonde_device *device,
                                              sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
