// What a player needs to know of a recording before it plays.
#include "exam/player.h"

#include "base/base.h"
#include "base/maths.h"

sonde_status sonde_player_index(sonde_player *player, sonde_error *error) {
  const sonde_recording *r = &player->recording;
  sonde_recording_describe(r, &player->info);
  // How much there is of each.
  uint32_t events = 0, checks = 0;
  const uint64_t marks = r->told.ticks / SONDE_PLAYER_MARK + 1, images = player->info.images;
  sonde_record record;
  for (sonde_recording walk = *r; sonde_recording_next(&walk, &record);) {
    events += record.tag == SONDE_RECORD_CONTROLS;
    checks += record.tag == SONDE_RECORD_CHECK;
  }
  if (images >= UINT32_MAX || marks >= UINT32_MAX)
    return sonde_fail(error, SONDE_FORMAT, "%s: too long for a player", player->path);
  player->events = SONDE_NEW(sonde_player_event, events);
  player->images = SONDE_NEW(sonde_player_image, (size_t)images);
  player->checks = SONDE_NEW(sonde_record_check, checks);
  player->marks = SONDE_NEW(size_t, (size_t)marks);
  if (!player->events || !player->images || !player->checks || !player->marks)
    return sonde_fail_memory(error);
  sonde_recording walk = *r;
  for (size_t at = walk.at; sonde_recording_next(&walk, &record); at = walk.at) {
    if (record.tag == SONDE_RECORD_CONTROLS) {
      // Controls as a session would have taken them: a file may hold any numbers.
      sonde_session_controls before = sonde_session_def_default().controls;
      if (player->event_count > 0) before = player->events[player->event_count - 1].controls;
      player->events[player->event_count++] =
          (sonde_player_event){record.tick, (double)record.tick * r->world.dt_s,
                               sonde_controls_clean(&record.controls, &before, r->probe_count)};
    }
    if (record.tag == SONDE_RECORD_CHECK) player->checks[player->check_count++] = record.check;
    if (record.tag == SONDE_RECORD_IMAGE)
      player->images[player->image_count++] = (sonde_player_image){record.tick, record.image};
    if (record.tag == SONDE_RECORD_TICK && record.tick % SONDE_PLAYER_MARK == 0)
      player->marks[player->mark_count++] = at;
  }
  // A file before version 4 does not tell its images: they are those of a lockstep session.
  const double none = (double)NAN;
  for (uint64_t i = 0; r->version < 4 && i < images; ++i)
    player->images[player->image_count++] = (sonde_player_image){
        (i + 1) * r->ticks_per_image, {vec3(none, none, none), SONDE_FAULT_NONE}};
  SONDE_ASSERT(player->event_count > 0 && player->image_count == images);
  return SONDE_OK;
}
