// Playing everything and comparing with what was recorded.
#include "exam/player.h"

#include "base/base.h"

#include <string.h>

sonde_status sonde_player_check(sonde_player *player, bool images, const sonde_progress *progress,
                                sonde_replay_result *result, sonde_error *error) {
  SONDE_ASSERT(player != NULL && result != NULL);
  const sonde_record_end *told = &player->recording.told;
  const uint64_t slack = 8 * player->session->keyframe_period;
  *result =
      (sonde_replay_result){.recorded_hash = told->hash, .recorded_image_hash = told->image_hash};
  bool images_differ = false, cancelled = false;
  uint32_t next = 0; // hash to compare
  sonde_player_restart(player);
  for (bool more = true; more && !cancelled;) {
    // One image, or the ticks behind the last one.
    more = sonde_player_next_image(player, images);
    sonde_frame frame;
    if (more && images && sonde_player_frame(player, &frame))
      result->image_hash = sonde_frame_hash(result->image_hash, &frame);
    if (!more) sonde_player_advance(player, player->info.duration_s);
    result->images += more;
    // Hashes of the state and of the images come in the order of their ticks each, but not
    // together.
    uint64_t tick = sonde_player_tick(player);
    while (next < player->check_count && player->checks[next].tick + slack < tick) next++;
    for (uint32_t k = next; k < player->check_count; ++k) {
      const sonde_record_check *check = &player->checks[k];
      if (check->tick > tick + slack) break;
      bool state = check->kind == SONDE_CHECK_STATE;
      if (check->tick != tick || (!state && !images)) continue;
      result->checks += state;
      if ((state ? sonde_player_hash(player) : result->image_hash) == check->hash) continue;
      if (!state) images_differ = true;
      if (!result->different_tick) result->different_tick = check->tick;
    }
    double fraction = (double)tick / (double)player->info.ticks;
    cancelled = !sonde_progress_report(progress, fraction, "replay");
  }
  result->ticks = sonde_player_tick(player);
  result->hash = sonde_player_hash(player);
  memcpy(result->model_path, player->info.model_path, sizeof result->model_path);
  bool ended = player->recording.ended, all = !cancelled && result->ticks == player->info.ticks;
  result->same = all && (result->different_tick == 0 || images_differ) &&
                 (!ended || result->hash == told->hash);
  result->same_images = all && images && !images_differ && player->recording.version >= 4 &&
                        (!ended || result->image_hash == told->image_hash);
  if (!cancelled) return SONDE_OK;
  return sonde_fail(error, SONDE_CANCELLED, "the replay was cancelled at %.3f of %.3f s",
                    sonde_player_time(player), player->info.duration_s);
}
