// Contact of a scene's bodies, and what it tells of trouble.
#ifndef SONDE_SRC_SCENE_TOUCH_H
#define SONDE_SRC_SCENE_TOUCH_H

#include "scene/state.h"

// Contacts at the stage: pushes and grips.
// @param start the stage is the start of a step, where bodies are found wholly inside others
// @thread tick
void sonde_touch_find(sonde_scene_state *state, bool start);
// Surfaces and trees are fitted as a whole at the next search: bodies were put elsewhere.
void sonde_touch_forget(sonde_scene_state *state);
// Vertices of a body that may have moved since the last search. @thread tick
void sonde_touch_surface(sonde_scene_state *state, uint32_t body, const sonde_vec3 *position,
                         const sonde_quat *rotation);
// A push whose rows come next; NULL when there is no room. @thread tick
sonde_push *sonde_push_new(sonde_scene_state *state, uint32_t touch);
// The pushes of attachments, before those of contacts. @thread tick
void sonde_pins_push(sonde_scene_state *state);
// The same of creases. @thread tick
void sonde_creases_push(sonde_scene_state *state);
// The pushes of bodies on themselves; their trees are those of the stage. @thread tick
void sonde_selves_push(sonde_scene_state *state);
// Notices a body wholly inside the other of a touch. @thread tick
void sonde_release_notice(sonde_scene_state *state, uint32_t touch,
                          const sonde_overlap_result *found);
// The push that lets it out; false when it is out, which may only end at the start of a step.
bool sonde_release_push(sonde_scene_state *state, uint32_t touch, bool may_end);
// Raises a flag of one body, or of one and another (UINT32_MAX: none). @thread tick
void sonde_scene_note(sonde_scene_state *state, uint32_t flag, uint32_t body, uint32_t other);
// False when a common volume is negative; at the start of a step a deformable body of the touch is
// flagged for it. @thread tick
bool sonde_trouble_overlap(sonde_scene_state *state, uint32_t touch,
                           const sonde_overlap_result *found, bool start);
// Flags a touch whose direction turned round while it was deep; at the end of a step. @thread tick
void sonde_trouble_direction(sonde_scene_state *state, uint32_t touch);
// Straight motion of a rigid body from the start of a step of h, in `undo`, to its end. @thread
// tick
sonde_motion sonde_cast_way(const sonde_scene_state *state, uint32_t body, double h);
// Flags a touch whose bodies met on the way of a step from `undo` and are apart again; h its
// length. @thread tick
void sonde_trouble_way(sonde_scene_state *state, uint32_t touch, double h);
// Flags deformable bodies that are inside out. @thread tick
void sonde_trouble_inspect(sonde_scene_state *state);
// Forces at the stage, which the bodies reached after moving for moved_s. @thread tick
void sonde_touch_evaluate(sonde_scene_state *state, double moved_s);
// Sums forces and K v over the slots and lists the terms of the matrix. @thread tick
void sonde_touch_gather(sonde_scene_state *state, const sonde_tissue_scales *scales);
// Forces at the end of the step from the moves since the evaluation; how many pushes would pull
// and were dropped. @thread tick
uint32_t sonde_touch_predict(sonde_scene_state *state);
// Measures and bonds at the end of the step. @thread tick
void sonde_touch_finish(sonde_scene_state *state, double h);

// Friction of a grip at the stage / at the end of the step. @thread tick
void sonde_grip_begin(sonde_scene_state *state, sonde_grip *grip);
void sonde_grip_evaluate(sonde_scene_state *state, sonde_grip *grip, double moved_s);
void sonde_grip_predict(sonde_scene_state *state, sonde_grip *grip);
void sonde_bonds_advance(sonde_scene_state *state, double h);
// First bond of a touch, made when it has none; UINT32_MAX when there is no room. @thread tick
uint32_t sonde_bonds_of(sonde_scene_state *state, uint32_t touch);
// Relative velocity of a grip's points, a less b, for a field over the slots.
sonde_vec3 sonde_grip_slip(const sonde_scene_state *state, const sonde_grip *grip,
                           const sonde_vec3 *field);
// Adds a force on a's point and its opposite on b's to a field over the slots.
void sonde_grip_spread(const sonde_scene_state *state, const sonde_grip *grip, sonde_vec3 force,
                       sonde_vec3 *field);
// Rows of a push along `direction` on a and against it on b; false when the pool is full.
bool sonde_grip_rows(sonde_scene_state *state, const sonde_grip *grip, sonde_vec3 direction,
                     uint32_t *first, uint32_t *count);

#endif
