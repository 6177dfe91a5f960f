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
#include "exam/duplex.h"
#include "exam/record.h"
#include "exam/subject.h"
#include "interior/interior.h"

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
  sonde_hand_moment hand;
  struct sonde_leg_place *place; // of a solid; NULL: springs, or a solid at rest
  double pose_s;                 // clock when the tick read its pose; 0 in lockstep
  bool keyframe;                 // one was taken with it
} sonde_surface_slot;

// Bins of 0.25 ms; the last one holds all that is older.
enum { LATENCY_BINS = 1024 };
static const double LATENCY_BIN_S = 0.25e-3;

// What the image's beam depends on.
typedef struct sonde_session_beam {
  double aperture_m, frequency_hz, depth_m, focus_m;
} sonde_session_beam;

// What the next tick depends on besides the world and its own inputs. Whatever else a tick carries
// on to the next belongs here too: a player starts from it.
typedef struct sonde_tick_memory {
  sonde_session_controls controls;
  sonde_device_sample sample;
} sonde_tick_memory;

// What the next image depends on besides its surface. Whatever else an image carries on to the next
// belongs here too.
typedef struct sonde_image_memory {
  uint32_t shown, building, beam_images;
  uint64_t shown_tick;
  sonde_pathology shown_pathology;
  sonde_session_beam beam, coming;
  sonde_interior_memory interior;
  sonde_duplex_memory duplex;
} sonde_image_memory;

// In mailbox slots on the way to the recorder: the world, followed by sonde_subject_remember(), and
// the inside of the same image.
typedef struct sonde_world_slot {
  uint64_t tick;
  size_t bytes;
  sonde_tick_memory memory;
} sonde_world_slot;
typedef struct sonde_inside_slot {
  uint64_t tick;
  sonde_image_memory memory;
} sonde_inside_slot;

// Keyframes are taken at the last images before every multiple of this, every other one while the
// probe touches nothing.
#define SONDE_KEYFRAME_PERIOD_S 0.25

typedef struct sonde_queued_note sonde_queued_note;

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
  size_t positions_at, forces_at, film_at, solid_at, skin_at, pixels_at, colour_at,
      spectrum_at; // offsets inside mailbox slots

  // tick
  sonde_subject *subject;
  sonde_state *state; // the subject's
  sonde_safety safety;
  sonde_render render;
  sonde_session_controls controls; // in force
  sonde_device_sample sample;      // last used
  bool realtime;
  uint64_t offered_tick;                   // of the newest surface
  uint64_t keyframe_period, keyframe_tick; // ticks; the next multiple that may want a keyframe
  double last_tick_s; // clock of the previous real-time tick, 0 before the first
  _Atomic uint64_t ticks;
  _Atomic int fault; // the safety's, for other threads
  _Atomic uint64_t lost_records;

  // image
  sonde_interior *interior;
  sonde_echo *echo;
  sonde_scanner scanner;           // all 0: the plain one
  sonde_duplex *duplex;            // NULL: no inside
  sonde_pathology shown_pathology; // of the controls
  uint32_t lines;                  // of the image
  sonde_vec3 *line_m;              // [lines] where each starts
  float *line_coupling;            // [lines]
  uint32_t *touched;               // [nodes] scratch
  sonde_findings findings;
  bool has_findings;
  atomic_bool surface_pending; // offered and not yet an image: real time offers no other
  const void *surface;         // slot of the newest image
  const sonde_vec3 *skin_now_m, *pushes_n; // [nodes] of the newest image: its skin, what touches
  sonde_vec3 *solid_skin_m, *solid_pushes; // [nodes] of a solid; NULL: springs
  struct sonde_leg_place *place;           // whose tissue the interior borrows, NULL: none
  bool shown;                              // an image was made
  sonde_session_beam beam, coming;         // of the images; being built
  bool building;                           // coming
  uint32_t beam_images;                    // since the building began
  uint64_t shown_tick;
  _Atomic uint64_t images;
  uint64_t images_hash;                   // of all pixels so far, with a recording
  _Atomic uint32_t latency[LATENCY_BINS]; // images by age of their pose when finished

  void (*watch)(void *user, const sonde_frame *frame); // NULL: nobody
  void *watch_user;

  // recorder; NULL without a recording and after its end
  sonde_recorder *recorder;
  bool setup_stored, ended; // kept also without ticks; its end was written
  sonde_record_end end;
  pthread_mutex_t note_lock; // of notes; the tick never takes it
  sonde_queued_note *notes;
  struct sonde_keyframe_writer *keyframes;
  const sonde_world_slot *world_part; // of the next keyframe, until both parts are there
  const sonde_inside_slot *inside_part;

  // between threads
  sonde_shared_controls requested;
  atomic_bool stop_pressed;
  sonde_mailbox *control_box; // sonde_session_controls
  sonde_mailbox *surface_box; // sonde_surface_slot + arrays
  sonde_mailbox *frame_box;   // sonde_frame + arrays
  sonde_ring *records;        // sonde_record; NULL without a recording, like the others below
  sonde_ring *image_checks;   // sonde_record_check of images
  sonde_mailbox *world_box;   // sonde_world_slot + state
  sonde_mailbox *inside_box;  // sonde_inside_slot

  // real time
  _Atomic(sonde_loop *) loop;
  sonde_loop_stats loop_stats; // of the last loop
  pthread_t image_thread, record_thread, pass_thread, place_thread;
  bool image_running, record_running, pass_running, place_running;
  atomic_bool stop_image, stop_record, stop_solid;
};

// One tick, lockstep and real time alike (hot).
void sonde_session_step(sonde_session *session);
// Body of the loop's tick (hot).
void sonde_session_realtime_tick(void *session);
// The same with recorded inputs instead of the device's (hot). @param controls NULL: as before
// @param told bits of SONDE_LEG_ that the tick had
void sonde_session_replay(sonde_session *session, const sonde_session_controls *controls,
                          const sonde_device_sample *sample, uint32_t told);
// The multiple whose keyframe an image of this tick would be, 0: none is wanted (hot).
uint64_t sonde_session_keyframe_tick(const sonde_session *session, uint64_t tick);
// The surface and its snapshot into the mailbox of the image thread (hot).
void sonde_session_offer(sonde_session *session);
// What the next tick depends on, also sonde_subject_remember() into world[] (hot). Returns its
// bytes.
size_t sonde_session_remember_tick(const sonde_session *session, sonde_tick_memory *memory,
                                   void *world);
void sonde_session_remember_image(const sonde_session *session, sonde_image_memory *memory);
// Goes on from there; not while threads run. @return FORMAT, MISMATCH: then the session stands
// somewhere between
sonde_status sonde_session_recall(sonde_session *session, const sonde_tick_memory *tick_memory,
                                  const sonde_image_memory *image_memory, const void *world,
                                  size_t world_bytes, sonde_error *error);
// Turns the newest surface, if there is one, into a frame: inside and beam follow it, then it is
// drawn. Image thread or lockstep.
bool sonde_session_show(sonde_session *session);
bool sonde_session_follow(sonde_session *session);
void sonde_session_draw(sonde_session *session);
// Hash of a frame's pixels, colour and spectrum behind those before it.
uint64_t sonde_frame_hash(uint64_t before, const sonde_frame *frame);
// The journal of the definition, if it asks for one, and what leads to it.
sonde_status sonde_session_create_recording(sonde_session *session, const sonde_session_def *def,
                                            const char *const *probe_names, sonde_error *error);
void sonde_session_release_recording(sonde_session *session);
const sonde_probe *sonde_session_probe(const sonde_session *session, uint32_t index);
// Moves everything in the rings and keyframes to their files. Recorder thread or lockstep.
void sonde_session_drain(sonde_session *session);

#endif
