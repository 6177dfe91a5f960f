/**
 * @file haptics.h
 * Devices, safety limits and the 1 kHz loop.
 */
#ifndef SONDE_HAPTICS_H
#define SONDE_HAPTICS_H

#include "sonde/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a device reports each tick. */
typedef struct sonde_device_sample {
  sonde_pose world_from_probe; /**< where the operator holds the probe */
  uint32_t buttons;
  bool present; /**< false: unplugged or not started; the force fades */
} sonde_device_sample;

/** A device behind one table of functions. All of them may be called at 1 kHz without waiting. */
typedef struct sonde_device {
  const char *name; /**< null, script, replay, page */
  void *self;
  /** Pose for this tick; ticks count from 0. @thread tick */
  void (*read)(void *self, uint64_t tick, sonde_device_sample *sample);
  /** Force (N) and torque (N m) to render, world frame. @thread tick */
  void (*write)(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m);
  /** Frees self. @thread owner */
  void (*destroy)(void *self);
} sonde_device;

/** A device family and whether this machine has it. */
typedef struct sonde_device_info {
  const char *name;
  const char *description;
  bool available;
  char reason[160]; /**< one sentence: why it is or is not available */
} sonde_device_info;

/** Stands still at a pose.
 *  @param[out] device filled; release with device->destroy(device->self) unless a session took it
 *  @return SONDE_ARGUMENT for a pose that is not finite @thread owner */
SONDE_API sonde_status sonde_device_null(sonde_pose pose, sonde_device *device, sonde_error *error);

/** One key of a script: the pose at a time. Between keys the position follows a monotone cubic
 *  (no overshoot, at rest where two keys agree), the rotation the short arc. */
typedef struct sonde_script_key {
  double time_s;
  sonde_pose world_from_probe;
} sonde_script_key;

/** Follows keys (copied); stays at the first before its time and at the last after.
 *  @param keys [count] finite, times strictly ascending; @param dt_s duration of a tick
 *  @return SONDE_ARGUMENT naming the first key that breaks the rule @thread owner */
SONDE_API sonde_status sonde_device_script(const sonde_script_key *keys, uint32_t count,
                                           double dt_s, sonde_device *device, sonde_error *error);
/** Plays recorded samples, samples[tick] at each tick (copied); absent after the last.
 *  @thread owner */
SONDE_API sonde_status sonde_device_replay(const sonde_device_sample *samples, uint64_t count,
                                           sonde_device *device, sonde_error *error);
/** Follows the goal last set by sonde_device_page_goal(): at most 0.25 m/s and 3 rad/s, then a
 *  critically damped filter (80 rad/s), so that speed and acceleration are bounded and nothing
 *  overshoots (docs/haptics.md). @thread owner */
SONDE_API sonde_status sonde_device_page(sonde_pose start, double dt_s, sonde_device *device,
                                         sonde_error *error);
/** Newest goal from the page; never waits. Poses that are not finite are ignored, as are devices
 *  of another family. @thread any one thread besides the tick */
SONDE_API void sonde_device_page_goal(sonde_device *device, sonde_pose world_from_probe);

/** Limits of what may be rendered; SI. */
typedef struct sonde_safety_limits {
  double force_n;      /**< norm; default 40 N (tissue force, no hardware attached) */
  double torque_n_m;   /**< default 2 */
  double slew_n_s;     /**< largest change per second; default 2000. Torque: the same share of its
                            limit. A fade may be faster when force_n / fade_s is larger. */
  double fade_s;       /**< time to zero after a fault; default 0.02 */
  double soft_start_s; /**< ramp from zero after start or resume; default 0.1 */
  double stale_s;      /**< gap between two ticks of a running session that counts as STALE;
                            default 0.25 */
  // 0, the default: no such limit
  double continuous_n; /**< what the motors bear for ever; above it they heat (thermal_s) */
  double thermal_s;    /**< time constant of that heat; default 5 */
  double velocity_m_s; /**< a faster probe is a fault; a jump of its pose counts as speed */
  double impulse_n_s;  /**< a force that drives the hand along for longer is a fault */
} sonde_safety_limits;

/** @thread any */
SONDE_API sonde_safety_limits sonde_safety_limits_default(void);

/** Faults; the first is latched until sonde_safety_resume(). */
#define SONDE_FAULT_LIST(X)                                                                        \
  X(NONE, "no fault")                                                                              \
  X(NON_FINITE, "the simulation produced a force that is not a number")                            \
  X(DEVICE_LOST, "the device stopped answering")                                                   \
  X(STALE, "the simulation did not deliver a force in time")                                       \
  X(STOPPED, "the emergency stop was pressed")                                                     \
  X(VELOCITY, "the device moved faster than its limit")                                            \
  X(IMPULSE, "the force pushed the hand away for too long")

typedef enum sonde_fault {
#define SONDE_FAULT_ENUM(name, text) SONDE_FAULT_##name,
  SONDE_FAULT_LIST(SONDE_FAULT_ENUM)
#undef SONDE_FAULT_ENUM
      SONDE_FAULT_COUNT
} sonde_fault;

/** Sentence of a fault; never NULL. @thread any */
SONDE_API const char *sonde_fault_text(sonde_fault fault);

/** State of the limiter; set up by sonde_safety_init(). Held by value in its owner's state: a tick
 *  needs neither an allocation nor an indirection. Its members are there to be read. */
typedef struct sonde_safety {
  sonde_safety_limits limits;
  sonde_fault fault;
  double gain;        /**< soft start (rising), or what is left of a fade; 0..1 */
  sonde_vec3 force_n; /**< last rendered */
  sonde_vec3 torque_n_m;
  uint64_t limited_ticks;  /**< how often a limit acted */
  sonde_vec3 fade_force_n; /**< rendered when the fault came */
  sonde_vec3 fade_torque_n_m;
  double heat;        /**< of the motors: 1 is what continuous_n leads to */
  double impulse_n_s; /**< leaky integral of a force that drives the hand along */
  bool placed;        /**< position_m is one */
  sonde_vec3 position_m;
} sonde_safety;

/** Starts softly from zero. @param limits NULL: the defaults; members that are not finite or
 *  negative are replaced by the default @thread owner */
SONDE_API void sonde_safety_init(sonde_safety *safety, const sonde_safety_limits *limits);
/** Latches a fault; the force fades to zero within limits.fade_s. The first fault stays.
 *  @thread tick */
SONDE_API void sonde_safety_trip(sonde_safety *safety, sonde_fault fault);
/** Clears the fault and starts softly. @thread tick */
SONDE_API void sonde_safety_resume(sonde_safety *safety);
/** Watches the device's motion before the wrench of the tick: trips VELOCITY and IMPULSE. Skipping
 *  it leaves these two limits off. @thread tick */
SONDE_API void sonde_safety_motion(sonde_safety *safety, sonde_vec3 position_m, double dt_s);
/** Passes a wanted wrench through the limits; the result is in safety->force_n and torque_n_m. A
 *  wrench that is not finite trips NON_FINITE. @thread tick */
SONDE_API void sonde_safety_apply(sonde_safety *safety, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                                  double dt_s);

/** Counters of a real-time loop. */
typedef struct sonde_loop_stats {
  uint64_t ticks;
  uint64_t deadline_misses;        /**< periods that began while an earlier tick was still due */
  uint64_t lateness_histogram[12]; /**< wake-up lateness: < 10, 20, 50, 100, 200, 500 us,
                                        1, 2, 5, 10, 50 ms, more */
  double compute_max_s, compute_mean_s;
  bool realtime_priority, memory_locked;
  char priority_note[160]; /**< one sentence when they were refused, else empty */
} sonde_loop_stats;

typedef struct sonde_loop sonde_loop;
typedef void (*sonde_tick_fn)(void *user);

/** Calls tick(user) every period on its own thread at absolute times; SCHED_FIFO and mlockall when
 *  allowed. A missed deadline is counted and the phase kept (no burst of make-up ticks).
 *  @param period_s 1e-4 to 1 @param[out] loop released by sonde_loop_stop() @thread owner */
SONDE_API sonde_status sonde_loop_start(double period_s, sonde_tick_fn tick, void *user,
                                        sonde_loop **loop, sonde_error *error);
/** Stops and joins; destroys the loop (NULL is ignored). @param stats may be NULL @thread owner */
SONDE_API void sonde_loop_stop(sonde_loop *loop, sonde_loop_stats *stats);
/** Copy of the counters, never waits for the tick. @thread any */
SONDE_API sonde_loop_stats sonde_loop_read(const sonde_loop *loop);

#ifdef __cplusplus
}
#endif
#endif
