// The thigh under the probe with everything that acts on it besides the probe's pose: tissue and
// friction in force, gel, circulation. A session and a replay drive it with the same inputs.
#ifndef SONDE_SRC_SUBJECT_H
#define SONDE_SRC_SUBJECT_H

#include "exam/duplex.h"
#include "exam/setup.h"
#include "solid/leg.h"
#include "sonde/haptics_gel.h"

enum { SONDE_GEL_TICKS = 20 }; // of a step of the film, a part of it per tick

// What moves in it besides world and film.
typedef struct sonde_subject_moment {
  sonde_session_controls controls; // in force
  sonde_circulation circulation;   // with the posture and the strain of the controls
  sonde_hand_moment hand;
  sonde_friction friction; // in force
  sonde_pose pose;         // of the probe in the last tick
  sonde_vec3 drift_m_s;    // of the probe, mean over about a step of the gel
  bool placed, touching;
  bool carried;      // the last step turned skin inside out
  bool off;          // the probe is taken off until it has left the body
  uint32_t restores; // times the skin was restored to rest for it
  uint64_t off_tick; // last tick without the probe
  // of a solid
  uint32_t did;          // bits of SONDE_LEG_ in the last tick
  bool broken;           // its force was not finite
  uint64_t felt_hash;    // of all that it has exerted
  sonde_leg_moment rest; // where a saved moment goes on
} sonde_subject_moment;

typedef struct sonde_subject {
  const sonde_model *model; // borrowed
  sonde_setup setup;
  double dt_s;
  sonde_state *state;
  sonde_gel *gel;
  sonde_solid_leg *solid;    // NULL: springs
  const sonde_probe *probes; // of the solid
  uint32_t told;             // bits of SONDE_LEG_: what its ticks take over
  sonde_contact felt;        // of it on the probe
  sonde_surface_index *rest_skin;
  sonde_subject_moment now;
} sonde_subject;

// At rest under these controls, gel spread, tissue tuned. @thread owner
sonde_status sonde_subject_create(const sonde_setup *setup, const sonde_model *model,
                                  const sonde_world_def *world,
                                  const sonde_session_controls *controls, sonde_subject **subject,
                                  sonde_error *error);
void sonde_subject_destroy(sonde_subject *subject);
// The setup's solid bears these probes in place of the springs; interior (NULL: the model has no
// bone) and probes are borrowed. Before any step.
// @return ARGUMENT for what a solid does not have, MEMORY @thread owner
sonde_status sonde_subject_give_solid(sonde_subject *subject, const sonde_interior *interior,
                                      const sonde_probe *probes, uint32_t probe_count,
                                      sonde_error *error);
// Other controls from the next step on. @thread tick
void sonde_subject_control(sonde_subject *subject, const sonde_session_controls *controls);
// One tick of world and gel. A probe that is led where no press leads is taken off. @thread tick
void sonde_subject_step(sonde_subject *subject, const sonde_probe *probe, sonde_pose pose);
// What the probe feels: springs or solid. @thread tick
const sonde_contact *sonde_subject_contact(const sonde_subject *subject);
// Whether a moment can be saved now. A solid can while nothing loads it. @thread tick
bool sonde_subject_savable(const sonde_subject *subject);
// sonde_state_hash(), with all that a solid has exerted. @thread owner
uint64_t sonde_subject_hash(const sonde_subject *subject);
// Flags of the last step; INSIDE_OUT also while the probe is off and for half a second afterwards,
// so that a viewer of some of the ticks sees it. @thread tick
uint32_t sonde_subject_flags(const sonde_subject *subject);
// Whether the probe is off in this tick; on the tick when it is taken off the skin goes back to
// rest (guard_hot.c). @thread tick
bool sonde_subject_guard(sonde_subject *subject, const sonde_probe *probe, sonde_pose pose);
// The case with the pressures of this tick. @thread tick
sonde_pathology sonde_subject_pathology(const sonde_subject *subject);
// Tissue and friction that controls ask for.
sonde_preset sonde_setup_preset(const sonde_setup *setup, const sonde_session_controls *controls);

// What has to be kept beside the state to go on from a tick: controls, strain, film, the step of
// the film under way. @return bytes; `out` may be NULL to ask for them @thread tick
size_t sonde_subject_save(const sonde_subject *subject, void *out);
// Goes on from there with tissue and friction of the saved controls. It wakes every node: restore
// the state after it. @thread tick
void sonde_subject_restore(sonde_subject *subject, const void *saved);

// All of a subject: the above and sonde_state_save(). @param[out] out [sonde_subject_size()]
// aligned to 8 bytes @return bytes @thread tick
size_t sonde_subject_size(const sonde_subject *subject);
size_t sonde_subject_remember(const sonde_subject *subject, void *out);
// sonde_subject_hash() of a remembered moment. @thread any
uint64_t sonde_subject_saved_hash(const sonde_subject *subject, const void *saved);
// Goes on from there. @return FORMAT, MISMATCH: then it stands somewhere between @thread owner
sonde_status sonde_subject_recall(sonde_subject *subject, const void *saved, size_t bytes,
                                  sonde_error *error);

#endif
