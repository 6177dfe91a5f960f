// What a session carries from image to image, and going on from a keyframe; cold.
#include "exam/session.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/motion.h"

#include <string.h>

void sonde_session_remember_image(const sonde_session *session, sonde_image_memory *memory) {
  memset(memory, 0, sizeof *memory);
  memory->shown = session->shown, memory->building = session->building;
  memory->beam_images = session->beam_images, memory->shown_tick = session->shown_tick;
  memory->shown_pathology = session->shown_pathology;
  memory->beam = session->beam, memory->coming = session->coming;
  if (session->interior) sonde_interior_remember(session->interior, &memory->interior);
  if (session->duplex) memory->duplex = sonde_duplex_remember(session->duplex);
}

static bool beam_usable(const sonde_session_beam *beam, bool any) {
  if (!any) return true;
  sonde_echo_settings s = {
      .frequency_hz = beam->frequency_hz, .depth_m = beam->depth_m, .focus_m = beam->focus_m};
  sonde_echo_settings clean = sonde_echo_settings_clamp(s);
  return beam->aperture_m > 0 && beam->aperture_m < 1 && clean.frequency_hz == s.frequency_hz &&
         clean.depth_m == s.depth_m && clean.focus_m == s.focus_m;
}

sonde_status sonde_session_recall(sonde_session *session, const sonde_tick_memory *inputs,
                                  const sonde_image_memory *inside, const void *world,
                                  size_t world_bytes, sonde_error *error) {
  SONDE_ASSERT(!atomic_load(&session->loop));
  if (inputs->controls.probe >= session->probe_count || inside->shown > 1 || inside->building > 1 ||
      !sonde_pose_usable(inputs->sample.world_from_probe) ||
      !beam_usable(&inside->beam, inside->shown) || !beam_usable(&inside->coming, inside->building))
    return sonde_fail(error, SONDE_FORMAT, "the keyframe is damaged");
  sonde_status status = sonde_subject_recall(session->subject, world, world_bytes, error);
  if (!status && session->interior)
    status = sonde_interior_recall(session->interior, &inside->interior, error);
  if (status) return status;
  if (session->duplex) sonde_duplex_recall(session->duplex, &inside->duplex);
  session->controls =
      sonde_controls_clean(&inputs->controls, &session->controls, session->probe_count);
  session->sample = inputs->sample;
  session->shown = inside->shown, session->building = inside->building;
  session->beam_images = inside->beam_images, session->shown_tick = inside->shown_tick;
  session->shown_pathology = inside->shown_pathology;
  session->beam = inside->beam, session->coming = inside->coming;
  uint64_t tick = sonde_state_tick(session->state);
  session->offered_tick = tick;
  atomic_store_explicit(&session->ticks, tick, memory_order_release);
  return SONDE_OK;
}
