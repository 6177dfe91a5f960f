// A recording played by a session that gets recorded inputs instead of a device's.
#include "exam/player.h"

#include "base/base.h"
#include "base/maths.h"
#include "echo/live.h"

#include <string.h>

enum { WINDOWS = 3 }; // of the interior that are kept for seeks

static uint64_t tick_of(const sonde_player *player) { return sonde_session_ticks(player->session); }

static sonde_status create_session(sonde_player *player, const sonde_model *model,
                                   const sonde_findings *findings, sonde_error *error) {
  const sonde_recording *r = &player->recording;
  sonde_session_def def = sonde_session_def_default();
  sonde_device device = {0};
  const char **names = SONDE_NEW(const char *, r->probe_count + 1);
  if (!names) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < r->probe_count; ++i) names[i] = r->probe_names[i];
  def.model = model;
  def.probe_names = names;
  def.world = r->world;
  def.image_width = r->image_width, def.image_height = r->image_height;
  def.ticks_per_image = r->ticks_per_image;
  def.controls = player->events[0].controls;
  sonde_setup_apply(&r->setup, &def);
  def.findings = findings;
  sonde_status status = sonde_device_null((sonde_pose){.rotation = {1, 0, 0, 0}}, &device, error);
  if (!status) status = sonde_session_create(&def, &device, &player->session, error);
  if (device.destroy) device.destroy(device.self);
  sonde_free(names);
  if (status) return status;
  // The probes must have the shape that they had when the exam was recorded.
  for (uint32_t i = 0; i < r->probe_count; ++i)
    if (sonde_probe_hash(sonde_session_probe(player->session, i)) != r->probe_hashes[i])
      return sonde_fail(error, SONDE_MISMATCH,
                        "%s: the probe \"%s\" has another shape than when it was recorded",
                        player->path, r->probe_names[i]);
  // The moment before the first tick is the player's first keyframe.
  sonde_subject *subject = player->session->subject;
  if (player->session->interior)
    status = sonde_interior_cache_windows(player->session->interior, WINDOWS, error);
  player->world = sonde_calloc(1, sonde_subject_size(subject));
  player->start_world = sonde_calloc(1, sonde_subject_size(subject));
  if (!player->world || !player->start_world) status = sonde_fail_memory(error);
  if (status) return status;
  player->start_bytes = sonde_subject_remember(subject, player->start_world);
  player->start_inputs = (sonde_tick_memory){player->session->controls, player->session->sample};
  sonde_session_remember_image(player->session, &player->start_inside);
  return sonde_keyframes_init(&player->keyframes, subject, error);
}

static uint32_t images_until(const sonde_player *player, uint64_t tick) {
  return sonde_count_until(player->images, sizeof *player->images, player->image_count, tick);
}

// Events, images and the reader's place behind `tick` ticks; an image of that very tick is still to
// come.
static void place(sonde_player *player, uint64_t tick) {
  sonde_recording *r = &player->recording;
  const sonde_player_event *events = player->events;
  uint32_t e = 0, i = 0;
  if (tick > 0) e = sonde_count_until(events, sizeof *events, player->event_count, tick - 1);
  if (tick > 0) i = images_until(player, tick - 1);
  player->next_event = e > 0 ? e : 1, player->next_image = i;
  uint64_t mark = tick / SONDE_PLAYER_MARK;
  r->at = r->end;
  if (mark >= player->mark_count) return;
  r->at = player->marks[mark];
  sonde_record record;
  for (size_t before = r->at; sonde_recording_next(r, &record); before = r->at) {
    if (record.tag != SONDE_RECORD_TICK || record.tick < tick) continue;
    r->at = before;
    return;
  }
}

void sonde_player_restart(sonde_player *player) {
  sonde_session *s = player->session;
  sonde_status status = SONDE_OK;
  status = sonde_session_recall(s, &player->start_inputs, &player->start_inside,
                                player->start_world, player->start_bytes, NULL);
  SONDE_ASSERT(status == SONDE_OK);
  place(player, 0);
  if (s->echo) sonde_echo_begin_looks(s->echo);
  player->followed = player->drawn = false;
}

bool sonde_player_jump(sonde_player *player, const sonde_packed_keyframe *packed) {
  sonde_keyframe key;
  if (!sonde_keyframes_unpack(&player->keyframes, packed, &key)) return false;
  sonde_tick_memory inputs;
  memcpy(&inputs, key.inputs, sizeof inputs);
  memcpy(&player->inside, key.inside, sizeof player->inside);
  memcpy(player->world, key.world, key.world_bytes);
  sonde_session *s = player->session;
  if (sonde_session_recall(s, &inputs, &player->inside, player->world, key.world_bytes, NULL) ||
      tick_of(player) != packed->tick)
    return false;
  place(player, packed->tick);
  player->followed = player->drawn = false;
  return true;
}

// Makes the image of the state at hand, if the recording has one.
static void make_image(sonde_player *player) {
  sonde_session *s = player->session;
  uint32_t next = player->next_image;
  uint64_t tick = tick_of(player);
  if (next >= player->image_count || player->images[next].tick != tick) return;
  // A keyframe where the session would have taken one, unless there is one already.
  const sonde_packed_keyframe *last = sonde_keyframes_find(&player->keyframes, tick);
  uint64_t from = sonde_session_keyframe_tick(s, tick), ahead = 2 * (uint64_t)s->ticks_per_image;
  if (from != 0 && !(last && last->tick + ahead > from)) {
    sonde_tick_memory inputs;
    memset(&inputs, 0, sizeof inputs);
    size_t bytes = sonde_session_remember_tick(s, &inputs, player->world);
    sonde_session_remember_image(s, &player->inside);
    sonde_keyframe key = {tick, &inputs, &player->inside, player->world, bytes};
    (void)sonde_keyframes_add(&player->keyframes,
                              &key); // without it a seek starts from farther away
  }
  // The limits of the force acted on the device, which the recording tells.
  const sonde_player_image *image = &player->images[player->next_image++];
  s->safety.force_n = image->told.rendered_force_n;
  s->safety.fault = image->told.fault;
  sonde_session_offer(s);
  player->followed = sonde_session_follow(s);
  player->drawn = false;
}

// False at the end.
static bool tick_once(sonde_player *player) {
  sonde_record record;
  const sonde_session_controls *controls = NULL;
  uint64_t tick = tick_of(player);
  do {
    if (!sonde_recording_next(&player->recording, &record)) return false;
  } while (record.tag != SONDE_RECORD_TICK);
  SONDE_ASSERT(record.tick == tick);
  for (;
       player->next_event < player->event_count && player->events[player->next_event].tick <= tick;
       ++player->next_event)
    controls = &player->events[player->next_event].controls;
  // What the tick took over is done before it.
  if (player->session->subject->solid)
    sonde_solid_leg_await(player->session->subject->solid, record.did);
  sonde_session_replay(player->session, controls, &record.sample, record.did);
  make_image(player);
  if (player->covered == tick) player->covered = tick + 1;
  return true;
}

sonde_status sonde_player_open(const sonde_player_def *def, sonde_player **out,
                               sonde_error *error) {
  SONDE_ASSERT(def != NULL && def->path != NULL && def->model != NULL && out != NULL);
  *out = NULL;
  sonde_player *player = SONDE_NEW(sonde_player, 1);
  if (!player) return sonde_fail_memory(error);
  size_t bytes = strlen(def->path) + 1;
  player->path = SONDE_NEW(char, bytes);
  player->no_cache = def->no_cache;
  sonde_status status = player->path ? SONDE_OK : sonde_fail_memory(error);
  if (!status) memcpy(player->path, def->path, bytes);
  if (!status) status = sonde_recording_load(def->path, def->recover, &player->recording, error);
  const sonde_recording *r = &player->recording;
  if (!status && r->model_checksum != def->model->checksum)
    status = sonde_fail(error, SONDE_MISMATCH,
                        "%s: recorded on the model %s (checksum %016llx), this one is %s (%016llx)",
                        def->path, r->model_name, (unsigned long long)r->model_checksum,
                        def->model->name, (unsigned long long)def->model->checksum);
  if (!status) status = sonde_player_index(player, error);
  if (!status) status = create_session(player, def->model, def->findings, error);
  if (status) {
    player->no_cache = true;
    sonde_player_close(player);
    return status;
  }
  // Keyframes that an earlier player left beside the recording.
  char *path = player->no_cache ? NULL : sonde_keyframes_path(player->path);
  if (path) sonde_keyframes_open(&player->keyframes, path, player->session->subject, r->told.crc);
  player->from_file = player->keyframes.count;
  sonde_free(path);
  sonde_player_restart(player);
  *out = player;
  return SONDE_OK;
}

void sonde_player_close(sonde_player *player) {
  if (!player) return;
  // The keyframes of an exam that was played through are kept beside the recording.
  if (!player->no_cache && player->covered == player->info.ticks &&
      player->keyframes.count > player->from_file) {
    sonde_keyframe_writer *file = NULL;
    char *path = sonde_keyframes_path(player->path);
    if (path) (void)sonde_keyframe_writer_create(path, player->session->subject, &file, NULL);
    bool good = file != NULL;
    for (uint32_t k = 0; good && k < player->keyframes.count; ++k) {
      sonde_packed_keyframe key;
      good = sonde_keyframes_fetch(&player->keyframes, &player->keyframes.list[k], &key);
      if (good) sonde_keyframe_writer_copy(file, &key);
    }
    if (good)
      (void)sonde_keyframe_writer_commit(file, player->recording.told.crc, NULL);
    else
      sonde_keyframe_writer_discard(file);
    sonde_free(path);
  }
  sonde_keyframes_clear(&player->keyframes);
  (void)sonde_session_destroy(player->session, NULL);
  sonde_recording_clear(&player->recording);
  sonde_free(player->events);
  sonde_free(player->images);
  sonde_free(player->checks);
  sonde_free(player->marks);
  sonde_free(player->world);
  sonde_free(player->start_world);
  sonde_free(player->path);
  sonde_free(player);
}

// ---- moving -------------------------------------------------------------------------------

static uint64_t clamp_tick(const sonde_player *player, double time_s) {
  double tick = floor(time_s / player->info.dt_s + 1e-6);
  if (!(tick > 0)) return 0;
  return tick < (double)player->info.ticks ? (uint64_t)tick : player->info.ticks;
}

sonde_status sonde_player_seek(sonde_player *player, double time_s, const sonde_progress *progress,
                               sonde_error *error) {
  SONDE_ASSERT(player != NULL);
  uint64_t goal = clamp_tick(player, time_s);
  // To the nearest moment from which the goal's image can be made: a keyframe's own image is made
  // again. A damaged keyframe leaves nothing to go on from.
  uint32_t images = images_until(player, goal);
  uint64_t now = tick_of(player);
  bool here = now <= goal, jumped = false;
  const sonde_packed_keyframe *key =
      images > 0 ? sonde_keyframes_find(&player->keyframes, player->images[images - 1].tick) : NULL;
  while (key && !jumped && (!here || key->tick > now)) {
    jumped = sonde_player_jump(player, key);
    key = key > player->keyframes.list ? key - 1 : NULL;
    here = false;
  }
  if (!here && !jumped) sonde_player_restart(player);
  // Wherever the player was before, the next image is one of all looks.
  if (player->session->echo) sonde_echo_begin_looks(player->session->echo);
  if (player->session->duplex) sonde_duplex_forget(player->session->duplex);
  make_image(player);
  uint64_t start = tick_of(player);
  for (uint64_t tick = start; tick < goal && tick_once(player); ++tick) {
    double fraction = (double)(tick + 1 - start) / (double)(goal - start);
    if (tick % 64 == 63 && !sonde_progress_report(progress, fraction, "seek"))
      return sonde_fail(error, SONDE_CANCELLED, "the seek was cancelled at %.3f s",
                        sonde_player_time(player));
  }
  return SONDE_OK;
}

void sonde_player_advance(sonde_player *player, double time_s) {
  SONDE_ASSERT(player != NULL);
  uint64_t goal = clamp_tick(player, time_s);
  while (tick_of(player) < goal && tick_once(player)) {
  }
}

static bool draw(sonde_player *player) {
  if (!player->followed) return false;
  if (player->drawn) return true;
  sonde_session_draw(player->session);
  player->drawn = sonde_session_frame(player->session, &player->frame);
  return player->drawn;
}

bool sonde_player_next_image(sonde_player *player, bool with_pixels) {
  SONDE_ASSERT(player != NULL);
  uint32_t next = player->next_image;
  if (next >= player->image_count) return false;
  while (player->next_image == next)
    if (!tick_once(player)) return false;
  return !with_pixels || draw(player);
}

bool sonde_player_frame(sonde_player *player, sonde_frame *frame) {
  SONDE_ASSERT(player != NULL && frame != NULL);
  if (!draw(player)) return false;
  *frame = player->frame;
  return true;
}

// ---- reading ------------------------------------------------------------------------------

const sonde_recording_info *sonde_player_info(const sonde_player *player) { return &player->info; }

uint64_t sonde_player_tick(const sonde_player *player) { return tick_of(player); }

double sonde_player_time(const sonde_player *player) {
  return (double)tick_of(player) * player->info.dt_s;
}

uint64_t sonde_player_hash(sonde_player *player) {
  return sonde_subject_hash(player->session->subject);
}

sonde_session_controls sonde_player_controls(const sonde_player *player) {
  return player->session->controls;
}
