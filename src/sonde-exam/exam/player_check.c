// Playing everything and comparing with what was recorded.
#include "exam/player.h"

#include "base/base.h"

#include <string.h>

typedef struct checker {
  sonde_player *player;
  sonde_replay_result *result;
  uint32_t next; // hash to meet
  bool images, images_differ;
} checker;

static void meet(checker *c, const sonde_record_check *check) {
  sonde_replay_result *result = c->result;
  bool state = check->kind == SONDE_CHECK_STATE;
  if (!state && !c->images) return;
  uint64_t hash = state ? sonde_player_hash(c->player) : result->image_hash;
  result->checks += state;
  if (hash == check->hash) return;
  if (!state) c->images_differ = true;
  if (!result->different_tick) result->different_tick = check->tick;
}

// Hashes of the state and of the images come in the order of their ticks each, but not together.
static void meet_all(checker *c) {
  const sonde_player *p = c->player;
  uint64_t tick = sonde_player_tick(p), slack = 8 * p->session->key_period;
  while (c->next < p->check_count && p->checks[c->next].tick + slack < tick) c->next++;
  for (uint32_t k = c->next; k < p->check_count && p->checks[k].tick <= tick + slack; ++k)
    if (p->checks[k].tick == tick) meet(c, &p->checks[k]);
}

static sonde_status play(checker *c, const sonde_progress *progress, sonde_error *error) {
  sonde_player *p = c->player;
  for (bool more = true; more;) {
    more = sonde_player_next_image(p, c->images);
    sonde_frame frame;
    if (more && c->images && sonde_player_frame(p, &frame))
      c->result->image_hash =
          sonde_hash(c->result->image_hash, frame.pixels, (size_t)frame.width * frame.height);
    if (!more) sonde_player_advance(p, p->info.duration_s);
    c->result->images += more;
    meet_all(c);
    double fraction = (double)sonde_player_tick(p) / (double)p->info.ticks;
    if (!sonde_progress_report(progress, fraction, "replay"))
      return sonde_fail(error, SONDE_CANCELLED, "the replay was cancelled at %.3f of %.3f s",
                        sonde_player_time(p), p->info.duration_s);
  }
  return SONDE_OK;
}

sonde_status sonde_player_check(sonde_player *player, bool images, const sonde_progress *progress,
                                sonde_replay_result *result, sonde_error *error) {
  SONDE_ASSERT(player != NULL && result != NULL);
  const sonde_record_end *told = &player->recording.told;
  *result =
      (sonde_replay_result){.recorded_hash = told->hash, .recorded_image_hash = told->image_hash};
  checker c = {.player = player, .result = result, .images = images};
  sonde_player_restart(player);
  sonde_status status = play(&c, progress, error);
  result->ticks = sonde_player_tick(player);
  result->hash = sonde_player_hash(player);
  memcpy(result->model_path, player->info.model_path, sizeof result->model_path);
  bool ended = player->recording.ended, all = !status && result->ticks == player->info.ticks;
  result->same = all && (result->different_tick == 0 || c.images_differ) &&
                 (!ended || result->hash == told->hash);
  result->same_images = all && images && !c.images_differ && player->recording.version >= 4 &&
                        (!ended || result->image_hash == told->image_hash);
  return status;
}
