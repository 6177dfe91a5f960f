// A probe that is led through the body turns no skin inside out: it is taken off, the flag says so,
// and the skin is at rest when the probe has left the body. What presses and slides is left alone.
#include "../sanitized.h"
#include "exam_test.h"

enum { RADIUS_MM = 70 };

static int set_up(void **state) {
  *state = barrel_model();
  return 0;
}
static int tear_down(void **state) {
  sonde_model_destroy(*state);
  return 0;
}

// The probe on the barrel's side at an angle (0: +x) and a height, face this deep below the skin.
static sonde_pose on_barrel(double turn, double z_m, double depth_m) {
  double t = z_m / 0.15, radius_m = 1e-3 * RADIUS_MM - 0.008 * t * t;
  sonde_site site = {.normal = vec3(cos(turn), sin(turn), 0), .u = vec3(-sin(turn), cos(turn), 0)};
  site.v = vec3(0, 0, 1);
  site.position_m = vec3(radius_m * cos(turn), radius_m * sin(turn), z_m);
  return sonde_site_pose(&site, depth_m);
}

// Faces whose outside looks against where it looks at rest.
static uint32_t inverted_faces(const sonde_session *session) {
  const sonde_mesh *rest = &session->model->surface;
  const sonde_vec3 *x = sonde_state_positions(session->state);
  uint32_t count = 0;
  for (uint32_t f = 0; f < rest->face_count; ++f) {
    const uint32_t *v = rest->faces[f];
    sonde_vec3 a = v_cross(v_sub(x[v[1]], x[v[0]]), v_sub(x[v[2]], x[v[0]]));
    sonde_vec3 b = v_cross(v_sub(rest->vertices[v[1]], rest->vertices[v[0]]),
                           v_sub(rest->vertices[v[2]], rest->vertices[v[0]]));
    count += v_dot(a, b) <= 0;
  }
  return count;
}

static double farthest_from_rest(const sonde_session *session) {
  const sonde_vec3 *x = sonde_state_positions(session->state);
  double most = 0;
  for (uint32_t i = 0; i < session->nodes; ++i)
    most = fmax(most, v_distance(x[i], session->model->surface.vertices[i]));
  return most;
}

static sonde_device scripted(const sonde_script_key *keys, uint32_t count) {
  sonde_device device;
  sonde_error error = {0};
  if (sonde_device_script(keys, count, 1e-3, &device, &error)) fail_msg("%s", error.message);
  return device;
}

typedef struct outcome {
  uint32_t flags, flagged_frames, black_frames, seen_restores;
  uint64_t hash;
} outcome;

// Plays the script to its end. A frame is flagged, black and without a vein, or none of these.
static outcome play(sonde_session *session, uint32_t ticks) {
  outcome seen = {0};
  for (uint32_t tick = 0; tick < ticks; ++tick) {
    sonde_session_tick(session);
    seen.flags |= sonde_state_flags(session->state);
    sonde_frame frame;
    if (!sonde_session_frame(session, &frame)) continue;
    bool bright = false, flagged = frame.snapshot.flags & SONDE_FLAG_INSIDE_OUT;
    for (uint32_t p = 0; p < frame.width * frame.height; ++p) bright = bright || frame.pixels[p];
    seen.flagged_frames += flagged;
    seen.black_frames += !bright;
    seen.seen_restores = frame.snapshot.restores;
    if (flagged) assert_true(isnan(frame.snapshot.vein_area_ratio));
  }
  seen.hash = sonde_session_hash(session);
  return seen;
}

// From the groin at one side to the knee at the other, straight, and off there.
static void straight_through_leaves_the_skin_as_it_was(void **state) {
  sonde_session_def def = small_def(*state);
  char directory[] = "/tmp/sonde-guard-XXXXXX", path[64];
  assert_non_null(mkdtemp(directory));
  snprintf(path, sizeof path, "%s/through.rec", directory);
  def.record_path = path;
  for (int k = SAMPLES(0, 2); k < 3; ++k) {
    double angle = SONDE_PI * (2 + k) / 4; // a chord, a wider one, right through
    const sonde_script_key keys[] = {{0.0, on_barrel(0, -0.1, -0.01)},
                                     {0.2, on_barrel(0, -0.1, 0.01)},
                                     {0.8, on_barrel(angle, 0.1, 0.01)},
                                     {1.0, on_barrel(angle, 0.1, -0.03)},
                                     {2.0, on_barrel(angle, 0.1, -0.03)}};
    sonde_session *session = open_session(&def, scripted(keys, SONDE_COUNT_OF(keys)));
    outcome seen = play(session, 2000);
    assert_true(seen.seen_restores >= 1);
    assert_true(seen.flagged_frames >= 5 && seen.black_frames >= seen.flagged_frames);
    assert_true(v_norm(sonde_state_contact(session->state)->force_n) == 0);
    assert_int_equal(inverted_faces(session), 0);
    assert_true(farthest_from_rest(session) < 1e-4);
    close_session(session);
    sonde_replay_result again;
    assert_int_equal(play_again(path, *state, NULL, &again, NULL), SONDE_OK);
    assert_true(again.same && again.hash == seen.hash);
  }
  char keys_path[80], old[80];
  snprintf(keys_path, sizeof keys_path, "%s.keys", path);
  snprintf(old, sizeof old, "%s.old", path);
  remove(keys_path), remove(old), remove(path);
  assert_int_equal(rmdir(directory), 0);
}

// A device that jumps in one tick: into the middle, and with its face out at the other side.
static void a_jump_into_the_body_is_refused(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_pose out = on_barrel(0, 0, -0.02), middle = on_barrel(0, 0, 0.07);
  sonde_pose behind = on_barrel(0, 0, 0.145); // the handle fills the barrel
  const sonde_pose into[] = {middle, behind};
  for (int k = 0; k < 2; ++k) {
    const sonde_script_key keys[] = {{0.0, out},     {0.1, out},    {0.1001, into[k]},
                                     {0.3, into[k]}, {0.3001, out}, {1.0, out}};
    sonde_session *session = open_session(&def, scripted(keys, SONDE_COUNT_OF(keys)));
    play(session, 290);
    assert_int_equal(session->subject->now.restores, 1);
    assert_true(session->subject->now.off && farthest_from_rest(session) == 0);
    outcome seen = play(session, 700);
    assert_int_equal(seen.seen_restores, 1);
    assert_false(session->subject->now.off);
    assert_int_equal(sonde_subject_flags(session->subject), 0);
    close_session(session);
  }
}

// The skin's own motion decides as well: a state whose skin is held elsewhere is put right in the
// air, without a deep pose.
static void caught_skin_is_let_go_in_the_air(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_pose out = on_barrel(0, 0, -0.06);
  sonde_device device;
  assert_int_equal(sonde_device_null(out, &device, NULL), SONDE_OK);
  sonde_session *session = open_session(&def, device);
  play(session, 20);
  sonde_vec3 *moved = calloc(session->nodes, sizeof *moved);
  assert_non_null(moved);
  sonde_vec3 inside = v_madd(out.position, 0.02, vec3(1, 0, 0)); // of the probe's body
  for (uint32_t i = 0; i < session->nodes; ++i) {
    sonde_vec3 rest = session->model->surface.vertices[i];
    bool caught = v_distance(rest, vec3(0.07, 0, 0)) < 0.03;
    moved[i] = caught ? v_add(inside, vec3(0, 0.1 * rest.y, 0.1 * rest.z)) : rest;
  }
  sonde_state_set(session->state, moved, NULL);
  free(moved);
  outcome seen = play(session, 60);
  assert_true(seen.flags & SONDE_FLAG_INSIDE_OUT);
  assert_true(seen.seen_restores >= 1);
  assert_int_equal(inverted_faces(session), 0);
  assert_true(v_norm(sonde_state_contact(session->state)->force_n) == 0);
  close_session(session);
}

// Deep presses and a slide under pressure are no such path.
static void presses_and_slides_are_left_alone(void **state) {
  sonde_session_def def = small_def(*state);
  const sonde_script_key keys[] = {
      {0.0, on_barrel(0, 0, -0.005)},     {0.3, on_barrel(0, 0, 0.03)},
      {0.4, on_barrel(0, 0, 0.03)},       {0.6, on_barrel(0, 0, 0.006)},
      {1.0, on_barrel(0.3, 0.05, 0.006)}, {1.2, on_barrel(0.3, 0.05, -0.01)}};
  sonde_session *session = open_session(&def, scripted(keys, SONDE_COUNT_OF(keys)));
  outcome seen = play(session, 1200);
  assert_int_equal(seen.seen_restores, 0);
  assert_int_equal(seen.flags & SONDE_FLAG_INSIDE_OUT, 0);
  assert_int_equal(seen.flagged_frames, 0);
  close_session(session);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(straight_through_leaves_the_skin_as_it_was),
      cmocka_unit_test(a_jump_into_the_body_is_refused),
      cmocka_unit_test(caught_skin_is_let_go_in_the_air),
      cmocka_unit_test(presses_and_slides_are_left_alone),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
