// What a player needs to know of a recording before it plays.
#include "exam/player.h"

#include "base/base.h"
#include "base/maths.h"

static sonde_status allocate(sonde_player *player, sonde_error *error) {
  const sonde_recording *r = &player->recording;
  sonde_record record;
  sonde_recording walk = *r;
  uint32_t events = 0, checks = 0;
  while (sonde_recording_next(&walk, &record)) {
    events += record.tag == SONDE_RECORD_CONTROLS;
    checks += record.tag == SONDE_RECORD_CHECK;
  }
  uint64_t marks = r->told.ticks / SONDE_PLAYER_MARK + 1;
  if (player->info.images >= UINT32_MAX || marks >= UINT32_MAX)
    return sonde_fail(error, SONDE_FORMAT, "%s: too long for a player", player->path);
  player->events = SONDE_NEW(sonde_player_event, events);
  player->event_ticks = SONDE_NEW(uint64_t, events);
  player->images = SONDE_NEW(sonde_player_image, (size_t)player->info.images);
  player->checks = SONDE_NEW(sonde_record_check, checks);
  player->marks = SONDE_NEW(size_t, (size_t)marks);
  bool all = player->events && player->event_ticks && player->images && player->checks;
  return all && player->marks ? SONDE_OK : sonde_fail_memory(error);
}

// Controls as a session would have taken them: a file may hold any numbers.
static void add_event(sonde_player *player, const sonde_record *record) {
  const sonde_recording *r = &player->recording;
  sonde_session_controls before = sonde_session_def_default().controls;
  if (player->event_count > 0) before = player->events[player->event_count - 1].controls;
  player->event_ticks[player->event_count] = record->tick;
  player->events[player->event_count++] =
      (sonde_player_event){(double)record->tick * r->world.dt_s,
                           sonde_controls_clean(&record->controls, &before, r->probe_count)};
}

static void fill(sonde_player *player) {
  sonde_recording walk = player->recording;
  sonde_record record;
  for (size_t at = walk.at; sonde_recording_next(&walk, &record); at = walk.at) {
    if (record.tag == SONDE_RECORD_CONTROLS) add_event(player, &record);
    if (record.tag == SONDE_RECORD_CHECK) player->checks[player->check_count++] = record.check;
    if (record.tag == SONDE_RECORD_IMAGE)
      player->images[player->image_count++] = (sonde_player_image){record.tick, record.image};
    if (record.tag == SONDE_RECORD_TICK && record.tick % SONDE_PLAYER_MARK == 0)
      player->marks[player->mark_count++] = at;
  }
  SONDE_ASSERT(player->event_count > 0); // checked when it was loaded
}

static void make_up_images(sonde_player *player) {
  const double none = (double)NAN;
  uint64_t every = player->recording.ticks_per_image;
  for (uint64_t i = 0; i < player->info.images; ++i)
    player->images[player->image_count++] =
        (sonde_player_image){(i + 1) * every, {vec3(none, none, none), SONDE_FAULT_NONE}};
}

sonde_status sonde_player_index(sonde_player *player, sonde_error *error) {
  sonde_recording_describe(&player->recording, &player->info);
  sonde_status status = allocate(player, error);
  if (status) return status;
  fill(player);
  if (player->recording.version < 4) make_up_images(player);
  SONDE_ASSERT(player->image_count == player->info.images);
  return SONDE_OK;
}
