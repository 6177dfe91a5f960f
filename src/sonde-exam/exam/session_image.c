// From the newest surface to a frame: skin, inside, vessels, image, all of one tick.
#include "exam/session.h"
#include "exam/vessels.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"
#include "echo/lines.h"
#include "haptics/gel.h"

#include <string.h>

enum { BEAM_STEPS = 3 }; // of a new beam per image

static sonde_echo_settings with_beam(const sonde_session_beam *beam, sonde_echo_settings rest) {
  rest.frequency_hz = beam->frequency_hz;
  rest.depth_m = beam->depth_m;
  rest.focus_m = beam->focus_m;
  return rest;
}

static void prepare_beam(sonde_session *session, const sonde_echo_settings *asked, uint32_t steps) {
  if (!session->building || !session->echo) return;
  sonde_echo_settings coming = with_beam(&session->coming, *asked);
  (void)sonde_echo_prepare(session->echo, session->coming.aperture_m, &coming, steps);
}

// Gel and air below each line of the image in use; returns their mean, NaN without gel. The probe's
// body touches with a flat face, whatever the fan of a curved one is: each line starts on that.
static double couple(sonde_session *session, const unsigned char *slot) {
  const sonde_surface_slot *head = (const void *)slot;
  if (!session->echo) return (double)NAN;
  if (!head->controls.gel) {
    sonde_echo_set_coupling(session->echo, NULL);
    return (double)NAN;
  }
  double sum = 0, width_m = session->beam.aperture_m;
  for (uint32_t l = 0; l < session->lines; ++l) {
    const double along_m = width_m * ((double)l / (session->lines - 1) - 0.5);
    sonde_vec3 start = sight_place((sight_lines){session->scanner.radius_m, 0}, along_m, 0);
    start.z = 0;
    session->line_m[l] = pose_apply(head->snapshot.world_from_probe, start);
  }
  sonde_gel_coupling_of(session->subject->gel, (const void *)(slot + session->film_at),
                        session->touched, session->skin_now_m, session->pushes_n, session->line_m,
                        session->lines, session->line_coupling);
  for (uint32_t l = 0; l < session->lines; ++l) sum += (double)session->line_coupling[l];
  sonde_echo_set_coupling(session->echo, session->line_coupling);
  return sum / session->lines;
}

static sonde_duplex_moment duplex_moment(const sonde_session *session,
                                         const sonde_surface_slot *head) {
  return (sonde_duplex_moment){.time_s = (double)head->snapshot.tick * session->dt_s,
                               .probe = head->snapshot.world_from_probe,
                               .controls = &head->controls.duplex,
                               .circulation =
                                   session->subject->setup.circulate ? &head->circulation : NULL,
                               .hand = head->hand};
}

// A leg of which nothing is moved.
static sonde_vec3 not_moved(const sonde_interior_tissue *self, sonde_vec3 rest_m) {
  (void)self, (void)rest_m;
  return vec3(0, 0, 0);
}
static sonde_mat3 not_stressed(const sonde_interior_tissue *self, sonde_vec3 rest_m) {
  (void)self, (void)rest_m;
  return m_zero();
}
static const sonde_interior_tissue at_rest = {not_moved, not_stressed};

// The skin of the surface; of a solid also its tissue.
static const sonde_interior_tissue *find_skin(sonde_session *session, const unsigned char *slot) {
  const sonde_surface_slot *head = (const void *)slot;
  session->skin_now_m = (const void *)(slot + session->positions_at);
  session->pushes_n = (const void *)(slot + session->forces_at);
  if (!session->solid_skin_m) return NULL;
  memcpy(session->solid_skin_m, session->skin_now_m, session->nodes * sizeof(sonde_vec3));
  memset(session->solid_pushes, 0, session->nodes * sizeof(sonde_vec3));
  session->skin_now_m = session->solid_skin_m, session->pushes_n = session->solid_pushes;
  if (!head->place) return &at_rest;
  const sonde_interior_tissue *tissue =
      sonde_leg_place_tissue(head->place, (const void *)(slot + session->solid_at));
  sonde_leg_place_skin(head->place, head->snapshot.world_from_probe, session->solid_skin_m,
                       session->solid_pushes);
  return tissue;
}

bool sonde_session_follow(sonde_session *session) {
  const unsigned char *slot = sonde_mailbox_read(session->surface_box);
  if (!slot) return false;
  session->surface = slot;
  const sonde_surface_slot *head = (const void *)slot;
  if (head->keyframe) {
    sonde_inside_slot *part = (void *)sonde_mailbox_write_slot(session->inside_box);
    part->tick = head->snapshot.tick;
    sonde_session_remember_image(session, &part->memory);
    sonde_mailbox_publish(session->inside_box);
  }
  sonde_leg_place *before = session->place;
  const sonde_interior_tissue *tissue = find_skin(session, slot);
  session->place = head->place;
  if (session->interior) {
    // Another vein than the last image's starts in equilibrium; the same one in motion or under
    // another pressure goes on from its last state.
    const sonde_pathology *pathology = &head->controls.pathology;
    bool same =
        session->shown && memcmp(&session->shown_pathology, pathology, sizeof *pathology) == 0;
    double since_s = (double)(head->snapshot.tick - session->shown_tick) * session->dt_s;
    sonde_interior_input input = {
        .positions_m = (const void *)(slot + session->positions_at),
        .contact_forces_n = (const void *)(slot + session->forces_at),
        .world_from_probe = head->snapshot.world_from_probe,
        .pathology = &head->pathology,
        .dt_s = same ? since_s : -1.0,
        .tick = head->snapshot.tick,
        .face_half_x_m = session->probes[head->snapshot.probe].half_x_m,
        .face_half_y_m = session->probes[head->snapshot.probe].half_y_m,
        .posture = head->controls.posture,
        .tissue = tissue,
    };
    sonde_interior_update(session->interior, &input);
    const sonde_duplex_moment moment = duplex_moment(session, head);
    if (session->duplex) sonde_duplex_follow(session->duplex, &moment);
    session->shown = true;
    session->shown_tick = head->snapshot.tick;
    session->shown_pathology = *pathology;
  }
  sonde_leg_place_give_back(before); // the interior has let go of its tissue
  // A new beam is built over several images, which go on with the old one: none of them comes late.
  // One under way is finished first, so that a slider that keeps moving shows where it has been.
  // The number of images is the same for every beam, whatever was built before: a replay that
  // starts anywhere changes beams at the same image.
  const uint32_t images = (SONDE_ECHO_PREPARE_STEPS + BEAM_STEPS - 1) / BEAM_STEPS;
  const double half_m = session->probes[head->snapshot.probe].half_x_m;
  const sonde_session_beam now = {sight_aperture(&session->scanner, half_m),
                                  head->controls.echo.frequency_hz, head->controls.echo.depth_m,
                                  head->controls.echo.focus_m};
  if (!(session->beam.aperture_m > 0)) session->beam = now;
  if (!session->building && memcmp(&now, &session->beam, sizeof now) != 0)
    session->coming = now, session->building = true, session->beam_images = 0;
  if (session->building) {
    if (!session->realtime) prepare_beam(session, &head->controls.echo, BEAM_STEPS);
    if (!(++session->beam_images < images)) {
      session->beam = session->coming;
      session->building = false;
    }
  }
  return true;
}

// Depth of the face below the resting skin. Along the axis from well outside, the first crossing is
// the skin above the face, whether the face is above or below it; beside the thigh the signed
// closest distance takes over.
static double face_depth(const sonde_surface_index *rest, const sonde_snapshot *snapshot) {
  const double back_m = 0.15, reach_m = 0.3;
  const sonde_pose pose = snapshot->world_from_probe;
  const sonde_vec3 axis = q_rotate(pose.rotation, vec3(0, 0, 1));
  const sonde_vec3 outside = v_madd(pose.position, -back_m, axis);
  sonde_surface_point hit;
  if (!sonde_surface_inside(rest, outside) &&
      sonde_surface_raycast(rest, outside, axis, reach_m, &hit))
    return back_m - v_dot(v_sub(hit.point_m, outside), axis);
  const double distance_m = sonde_surface_closest(rest, pose.position).distance_m;
  return sonde_surface_inside(rest, pose.position) ? distance_m : -distance_m;
}

void sonde_session_draw(sonde_session *session) {
  SONDE_ASSERT(session->surface != NULL);
  sonde_frame *frame = (void *)sonde_mailbox_write_slot(session->frame_box);
  unsigned char *out = (unsigned char *)frame;
  const sonde_surface_slot *head = (const void *)session->surface;
  // The skin in single precision.
  const double *positions_m = &session->skin_now_m->x;
  float *skin_m = (float *)(void *)(out + session->skin_at);
  for (size_t i = 0; i < 3 * session->nodes; ++i) skin_m[i] = (float)positions_m[i];
  sonde_image image = {.width = session->image_width,
                       .height = session->image_height,
                       .pixels = out + session->pixels_at};
  sonde_frame_colour colour = {.over.pixels = out + session->colour_at};
  const float *gel = head->controls.gel ? session->line_coupling : NULL;
  const double coupling = couple(session, session->surface);
  sonde_gate_spectrum spectrum = {.on = false};
  bool off = head->snapshot.flags & SONDE_FLAG_INSIDE_OUT; // the probe sees no body
  if (session->echo && !off) {
    sonde_echo_settings settings = with_beam(&session->beam, head->controls.echo);
    sonde_echo_flow flow = sonde_echo_flow_default();
    flow.t_s = (double)head->snapshot.tick * session->dt_s;
    if (session->subject->setup.circulate) flow.circulation = head->circulation;
    if (session->duplex) flow.blood = sonde_duplex_blood(session->duplex);
    sonde_echo_set_flow(session->echo, &flow);
    sonde_echo_render(session->echo, head->snapshot.world_from_probe, session->beam.aperture_m,
                      &head->pathology, &settings, &image);
    SONDE_ASSERT(sonde_interior_tick(session->interior) == head->snapshot.tick);
    const sonde_duplex_moment moment = duplex_moment(session, head);
    if (session->duplex) {
      sonde_duplex_draw(session->duplex, &moment, &image, settings.frequency_hz, gel,
                        session->lines, &colour);
      sonde_duplex_hear(session->duplex, &moment, &image, settings.frequency_hz, gel,
                        session->lines, (void *)(out + session->spectrum_at), &spectrum);
    }
  } else {
    memset(image.pixels, 0, (size_t)image.width * image.height);
    if (session->echo)
      image.width_m = session->beam.aperture_m, image.height_m = session->beam.depth_m,
      image.top_m = 0;
  }
  *frame = (sonde_frame){.snapshot = head->snapshot,
                         .skin_m = skin_m,
                         .pixels = image.pixels,
                         .width = image.width,
                         .height = image.height,
                         .width_m = image.width_m,
                         .height_m = image.height_m,
                         .top_m = image.top_m,
                         .radius_m = session->scanner.radius_m,
                         .colour = colour,
                         .spectrum = spectrum};
  frame->snapshot.gel_coupling = coupling;
  const double *film_m = (const void *)(session->surface + session->film_at);
  double gel_m3 = gel ? 0 : (double)NAN;
  for (size_t i = 0; gel && i < session->nodes; ++i)
    gel_m3 += film_m[i] * session->model->area_m2[i];
  frame->snapshot.gel_volume_m3 = gel_m3;
  frame->snapshot.venous_pressure_pa = head->pathology.venous_pressure_pa;
  frame->snapshot.arterial_pressure_pa = head->pathology.arterial_pressure_pa;
  frame->snapshot.penetration_m = face_depth(session->subject->rest_skin, &head->snapshot);
  if (session->interior && !off) sonde_snapshot_read_vessels(session->interior, &frame->snapshot);
  // All pixels so far, so that one number tells whether a replay shows the same.
  if (session->image_checks) {
    session->images_hash = sonde_frame_hash(session->images_hash, frame);
    sonde_record_check check = {SONDE_CHECK_IMAGES, frame->snapshot.tick, session->images_hash};
    (void)sonde_ring_push(session->image_checks, &check); // the end has the last one at any rate
  }
  if (session->watch) session->watch(session->watch_user, frame);
  sonde_mailbox_publish(session->frame_box);
}

uint64_t sonde_frame_hash(uint64_t before, const sonde_frame *frame) {
  const sonde_colour_overlay *over = &frame->colour.over;
  const sonde_gate_spectrum *heard = &frame->spectrum;
  uint64_t hash = sonde_hash(before, frame->pixels, (size_t)frame->width * frame->height);
  if (frame->colour.shown)
    hash = sonde_hash(hash, over->pixels, (size_t)over->width * over->height);
  return heard->on ? sonde_hash(hash, heard->column, heard->count * sizeof *heard->column) : hash;
}

bool sonde_session_show(sonde_session *session) {
  if (!sonde_session_follow(session)) return false;
  sonde_session_draw(session);
  double pose_s = ((const sonde_surface_slot *)session->surface)->pose_s;
  if (pose_s > 0) {
    double bin = (sonde_clock_now() - pose_s) / LATENCY_BIN_S;
    uint32_t at = bin < LATENCY_BINS - 1 ? (uint32_t)fmax(bin, 0) : LATENCY_BINS - 1;
    atomic_fetch_add_explicit(&session->latency[at], 1, memory_order_relaxed);
  }
  if (session->realtime) {
    // What later images need, when this one is out and the pose of the next is not yet taken; a
    // little more than an image's share, so that nothing is left when it is due.
    const sonde_surface_slot *head = (const void *)session->surface;
    if (session->interior) sonde_interior_build_ahead(session->interior);
    prepare_beam(session, &head->controls.echo, BEAM_STEPS + 1);
  }
  uint64_t images = atomic_load_explicit(&session->images, memory_order_relaxed);
  atomic_store_explicit(&session->images, images + 1, memory_order_release);
  atomic_store_explicit(&session->surface_pending, false, memory_order_release);
  return true;
}

bool sonde_session_frame(sonde_session *session, sonde_frame *frame) {
  const sonde_frame *newest = sonde_mailbox_read(session->frame_box);
  if (!newest) return false;
  SONDE_ASSERT(newest->width == session->image_width && newest->pixels != NULL);
  *frame = *newest;
  return true;
}

double sonde_session_latency(const sonde_session *session, double fraction) {
  SONDE_ASSERT(fraction >= 0 && fraction <= 1);
  uint32_t count[LATENCY_BINS];
  uint64_t all = 0, seen = 0;
  for (int k = 0; k < LATENCY_BINS; ++k)
    all += count[k] = atomic_load_explicit(&session->latency[k], memory_order_relaxed);
  for (int k = 0; k < LATENCY_BINS; ++k) {
    seen += count[k];
    if (all > 0 && (double)seen >= fraction * (double)all) return (k + 1) * LATENCY_BIN_S;
  }
  return (double)NAN;
}
