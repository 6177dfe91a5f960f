// Inside of a session: who owns what, and what crosses the threads.
//
//   owner ---- controls mailbox ----> tick ---- surface mailbox ----> image ---- frame mailbox -->
//   reader
//                                      \------- record ring --------> recorder thread
#ifndef SONDE_SRC_SESSION_H
#define SONDE_SRC_SESSION_H

#include "sonde/exam.h"

#include "base/mailbox.h"
#include "base/ring.h"
#include "exam/record.h"
#include "exam/subject.h"

#include <pthread.h>
#include <stdatomic.h>

// Controls that any thread may read while one thread writes: a sequence counter around words.
enum { SONDE_CONTROL_WORDS = (sizeof(sonde_session_controls) + 7) / 8 };
typedef struct sonde_shared_controls {
  atomic_uint sequence; // odd while being written
  _Atomic uint64_t word[SONDE_CONTROL_WORDS];
} sonde_shared_controls;

void sonde_shared_controls_set(sonde_shared_controls *shared, const sonde_session_controls *value);
sonde_session_controls sonde_shared_controls_get(const sonde_shared_controls *shared);
// `wanted` with every member usable: clamped, or from `before` where it is not.
sonde_session_controls sonde_controls_clean(const sonde_session_controls *wanted,
                                            const sonde_session_controls *before,
                                            uint32_t probe_count);

// What the image of one tick is made from; in a mailbox slot, followed by positions, forces and
// film.
typedef struct sonde_surface_slot {
  sonde_snapshot snapshot;
  sonde_session_controls controls;
  sonde_pathology pathology; // of the controls, with the pressures of this tick
  sonde_circulation circulation;
  double pose_s; // clock when the tick read its pose; 0 in lockstep
} sonde_surface_slot;

// Bins of 0.25 ms; the last one holds all that is older.
enum { LATENCY_BINS = 1024 };
static const double LATENCY_BIN_S = 0.25e-3;

// What the image's beam depends on.
typedef struct sonde_session_beam {
  double aperture_m, frequency_hz, depth_m, focus_m;
} sonde_session_beam;

struct sonde_session {
  // set up once
  const sonde_model *model;
  sonde_device device;
  uint32_t probe_count;
  sonde_probe *probes; // [probe_count]
  double dt_s;
  uint32_t ticks_per_image;
  uint32_t image_width, image_height;
  size_t nodes;
  size_t positions_at, forces_at, film_at, skin_at, pixels_at; // offsets inside mailbox slots

  // tick
  sonde_subject *subject;
  sonde_state *state; // the subject's
  sonde_safety safety;
  sonde_render render;
  sonde_session_controls controls; // in force
  sonde_device_sample sample;      // last used
  bool realtime;
  uint64_t offered_tick; // of the newest surface
  double last_tick_s;    // clock of the previous real-time tick, 0 before the first
  _Atomic uint64_t ticks;
  _Atomic int fault; // the safety's, for other threads
  _Atomic uint64_t lost_records;

  // image
  sonde_surface_index *rest_skin;
  sonde_interior *interior;
  sonde_echo *echo;
  sonde_pathology shown_pathology; // of the controls
  uint32_t lines;                  // of the image
  sonde_vec3 *line_m;              // [lines] where each starts
  float *line_coupling;            // [lines]
  uint32_t *touched;               // [nodes] scratch
  sonde_findings findings;
  bool has_findings;
  atomic_bool surface_wanted;      // the image thread waits for a surface
  bool shown;                      // an image was made
  sonde_session_beam beam, coming; // of the images; being built
  bool building;                   // coming
  uint64_t shown_tick;
  _Atomic uint64_t images;
  _Atomic uint32_t latency[LATENCY_BINS]; // images by age of their pose when finished

  // recorder; NULL without a recording
  sonde_recorder *recorder;

  // between threads
  sonde_shared_controls requested;
  atomic_bool stop_pressed;
  sonde_mailbox *control_box; // sonde_session_controls
  sonde_mailbox *surface_box; // sonde_surface_slot + arrays
  sonde_mailbox *frame_box;   // sonde_frame + arrays
  sonde_ring *records;        // sonde_record; NULL without a recording

  // real time
  _Atomic(sonde_loop *) loop;
  sonde_loop_stats loop_stats; // of the last loop
  pthread_t image_thread, record_thread;
  bool image_running, record_running;
  atomic_bool stop_image, stop_record;
};

// One tick, lockstep and real time alike (hot).
void sonde_session_step(sonde_session *session);
// Body of the loop's tick (hot).
void sonde_session_realtime_tick(void *session);
// Turns the newest surface, if there is one, into a frame. Image thread or lockstep.
bool sonde_session_show(sonde_session *session);
// Moves everything in the ring to the file. Recorder thread or lockstep.
void sonde_session_drain(sonde_session *session);

#endif
