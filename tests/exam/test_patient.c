// Gel, circulation and the practitioner's bench in a session: one state behind force and image, and
// recordings that keep it.
#include "exam_test.h"
#include "haptics/gel.h"
#include "interior/interior.h"

static const char path[] = "test_patient.rec";

static int set_up(void **state) {
  *state = barrel_model();
  return 0;
}
static int tear_down(void **state) {
  sonde_model_destroy(*state);
  return 0;
}

// Pressed to 8 mm within 0.2 s, held until 0.4 s, then 12 mm along the leg by 0.8 s.
static sonde_device slide_device(void) {
  sonde_site site = barrel_site();
  sonde_pose away = sonde_site_pose(&site, 0.008);
  away.position.z += 0.012;
  const sonde_script_key keys[] = {{0.0, sonde_site_pose(&site, -0.002)},
                                   {0.2, sonde_site_pose(&site, 0.008)},
                                   {0.4, sonde_site_pose(&site, 0.008)},
                                   {0.8, away}};
  sonde_device device;
  assert_int_equal(sonde_device_script(keys, SONDE_COUNT_OF(keys), 1e-3, &device, NULL), SONDE_OK);
  return device;
}

static sonde_frame run(sonde_session *session, int ticks) {
  sonde_frame frame = {0};
  for (int i = 0; i < ticks; ++i) {
    sonde_session_tick(session);
    sonde_session_frame(session, &frame);
  }
  assert_non_null(frame.pixels);
  return frame;
}

// Mean grey of the picture below the first centimetre, where the face reverberates.
static double brightness(const sonde_frame *frame) {
  double sum = 0;
  uint32_t from = (uint32_t)(0.010 / frame->height_m * frame->height);
  for (uint32_t i = from * frame->width; i < frame->width * frame->height; ++i)
    sum += frame->pixels[i];
  return sum / ((frame->height - from) * frame->width);
}

static double sideways(const sonde_frame *frame) {
  return fabs(frame->snapshot.force_n.z) / frame->snapshot.force_normal_n;
}

static void set(sonde_session *session, sonde_session_controls controls) {
  sonde_session_control(session, &controls);
}

static void without_gel_the_image_is_coupled(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_session *session = open_session(&def, slide_device());
  sonde_frame frame = run(session, 300);
  double coupled = brightness(&frame);
  assert_true(isnan(frame.snapshot.gel_coupling) && isnan(frame.snapshot.gel_volume_m3));
  close_session(session);
  // dry skin lets nothing in, gel almost everything
  def.controls.gel = true;
  session = open_session(&def, slide_device());
  frame = run(session, 300);
  assert_true(frame.snapshot.gel_coupling < 1e-9 && frame.snapshot.gel_volume_m3 < 1e-15);
  assert_true(brightness(&frame) < 0.3 * coupled);
  close_session(session);
  def.gel_m3 = 10e-6;
  session = open_session(&def, slide_device());
  frame = run(session, 300);
  assert_true(frame.snapshot.gel_coupling > 0.8);
  assert_true(fabs(frame.snapshot.gel_volume_m3 - 10e-6) < 0.1e-6); // a little dries
  assert_true(brightness(&frame) > 0.9 * coupled && brightness(&frame) < 1.1 * coupled);
  close_session(session);
}

// One state: in the slide, the session with less gel rubs more and sees less, at the same tick.
static void less_gel_rubs_more_and_shows_less(void **state) {
  const double gel_m3[] = {40e-6, 0.04e-6, 0}; // half of it where the probe slides
  double rubs[3], grey[3], coupling[3];
  for (int k = 0; k < 3; ++k) {
    sonde_session_def def = small_def(*state);
    def.controls.probe = 3; // a ball does not plough
    def.world.friction = (sonde_friction){0.5, 0.4, 0.01, 0, 0.05};
    def.controls.gel = true;
    def.gel_m3 = gel_m3[k];
    sonde_session *session = open_session(&def, slide_device());
    sonde_frame frame = run(session, 640);
    rubs[k] = sideways(&frame);
    grey[k] = brightness(&frame);
    coupling[k] = frame.snapshot.gel_coupling;
    close_session(session);
  }
  assert_true(rubs[0] < 0.5 * rubs[2] && rubs[0] < rubs[1] && rubs[1] <= rubs[2]);
  assert_true(coupling[0] > coupling[1] && coupling[1] > coupling[2]);
  assert_true(grey[0] > grey[1] && grey[1] > grey[2]);
}

static void gel_is_put_and_wiped(void **state) {
  sonde_session_def def = small_def(*state);
  def.controls.gel = true;
  sonde_session *session = open_session(&def, slide_device());
  sonde_session_controls controls = sonde_session_controls_now(session);
  assert_true(run(session, 240).snapshot.gel_coupling < 1e-9);
  controls.gel_put++;
  set(session, controls);
  sonde_frame frame = run(session, 40);
  assert_true(fabs(frame.snapshot.gel_volume_m3 - 2e-6) < 0.01e-6);
  assert_true(frame.snapshot.gel_coupling > 0.3);
  controls.gel_wipe++;
  set(session, controls);
  frame = run(session, 40);
  assert_true(frame.snapshot.gel_volume_m3 < 1e-15 && frame.snapshot.gel_coupling < 1e-9);
  close_session(session);
}

// A vein under the barrel's site so soft and near that it answers; pressures in mmHg.
static double venous_mmhg(const sonde_frame *frame) {
  return frame->snapshot.venous_pressure_pa / 133.322;
}

static void circulation_follows_posture_and_strain(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_session *session = open_session(&def, slide_device());
  sonde_frame first = run(session, 100), later = run(session, 400);
  assert_true(venous_mmhg(&first) == venous_mmhg(&later)); // constant unless asked for
  close_session(session);
  def.circulate = true;
  session = open_session(&def, slide_device());
  sonde_session_controls controls = sonde_session_controls_now(session);
  double least = INFINITY, most = 0;
  for (int k = 0; k < 60; ++k) {
    sonde_frame frame = run(session, 20);
    double now_pa = sonde_arterial_pressure(&def.circulation, frame.snapshot.time_s);
    assert_true(fabs(frame.snapshot.arterial_pressure_pa - now_pa) < 1e-6);
    least = fmin(least, now_pa), most = fmax(most, now_pa);
  }
  assert_true(most - least > 30 * 133.0); // a beat was seen
  controls.valsalva = true;
  set(session, controls);
  sonde_frame strained = run(session, 800);
  assert_true(fabs(venous_mmhg(&strained) - 30) < 0.1); // supine 10 and 20 of strain, breath held
  controls.valsalva = false;
  controls.posture = SONDE_POSTURE_STANDING;
  set(session, controls);
  sonde_frame stood = run(session, 800);
  assert_true(fabs(venous_mmhg(&stood) - 32) < 1.6);
  close_session(session);
}

static uint64_t hash_of(const sonde_session_def *def, const sonde_session_controls *later) {
  sonde_session *session = open_session(def, slide_device());
  for (int i = 0; i < 500; ++i) {
    if (i == 250 && later) set(session, *later);
    sonde_session_step(session);
  }
  uint64_t hash = sonde_session_hash(session);
  close_session(session);
  return hash;
}

// Scales on the bench and the preset that says the same are one tissue; so is a preset applied to
// the model's own arrays.
static void bench_is_a_preset(void **state) {
  sonde_session_def scaled = small_def(*state), preset = scaled;
  scaled.world.friction = (sonde_friction){0.5, 0.4, 0.01, 0, 0.05};
  scaled.controls.stiffness_scale = 1.5;
  scaled.controls.damping_scale = 2;
  scaled.controls.friction_scale = 0.5;
  sonde_session *session = open_session(&scaled, slide_device());
  preset.preset_count = 1;
  sonde_session_controls asked = sonde_session_controls_now(session);
  preset.presets[0] = sonde_setup_preset(&session->subject->setup, &asked);
  close_session(session);
  assert_true(preset.presets[0].friction.mu_static == 0.25);
  uint64_t hash = hash_of(&scaled, NULL);
  assert_true(hash == hash_of(&preset, NULL));
  sonde_session_def plain = small_def(*state);
  assert_true(hash != hash_of(&plain, NULL));
}

// A then B: from the change on another tissue, and another than either alone.
static void presets_are_compared(void **state) {
  sonde_session_def def = small_def(*state), only = def;
  def.preset_count = 2;
  def.presets[0] = def.presets[1] = sonde_preset_default();
  def.presets[1].stiffness_scale = 1.4;
  def.presets[1].normal_damping_s = 0.01;
  sonde_session_controls b = def.controls;
  b.preset = 1;
  only.preset_count = 1;
  only.presets[0] = def.presets[1];
  uint64_t both = hash_of(&def, &b), a = hash_of(&def, NULL), alone = hash_of(&only, NULL);
  assert_true(both != a && both != alone && a != alone);
  def.controls.preset = 1;
  assert_true(hash_of(&def, NULL) == alone);
  def.presets[0].stiffness_scale = -1;
  sonde_session *session = NULL;
  sonde_device device = slide_device();
  assert_int_equal(sonde_session_create(&def, &device, &session, NULL), SONDE_ARGUMENT);
  def.preset_count = 3;
  assert_int_equal(sonde_session_create(&def, &device, &session, NULL), SONDE_ARGUMENT);
  def.preset_count = 0;
  def.gel_m3 = -1;
  assert_int_equal(sonde_session_create(&def, &device, &session, NULL), SONDE_ARGUMENT);
  def.gel_m3 = 0;
  def.circulation.breath_pa = NAN;
  assert_int_equal(sonde_session_create(&def, &device, &session, NULL), SONDE_ARGUMENT);
  device.destroy(device.self);
}

static void bench_is_kept_in_range(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_session *session = open_session(&def, slide_device());
  sonde_session_controls wild = sonde_session_controls_now(session), kept;
  wild.stiffness_scale = 100;
  wild.damping_scale = 0;
  wild.friction_scale = NAN;
  wild.posture = (sonde_posture)17;
  wild.preset = 9;
  set(session, wild);
  kept = sonde_session_controls_now(session);
  assert_true(kept.stiffness_scale == 2 && kept.damping_scale == 0.25 && kept.friction_scale == 1);
  assert_true(kept.posture == SONDE_POSTURE_SUPINE && kept.preset == 0);
  close_session(session);
}

// Everything that can be changed is changed; the replay ends in the same state.
static void recording_keeps_the_patient(void **state) {
  sonde_session_def def = small_def(*state);
  def.record_path = path;
  def.controls.gel = true;
  def.gel_m3 = 1e-6;
  def.circulate = true;
  def.preset_count = 2;
  def.presets[0] = def.presets[1] = sonde_preset_default();
  def.presets[0].friction = def.presets[1].friction = (sonde_friction){0.5, 0.4, 0.01, 0, 0.05};
  def.presets[1].damping_multiplier = 1.0 / 3.0;
  sonde_session *session = open_session(&def, slide_device());
  sonde_session_controls c = sonde_session_controls_now(session);
  for (int i = 0; i < 700; ++i) {
    if (i == 100) c.stiffness_scale = 1.0 / 1.3, c.friction_scale = 1.7, set(session, c);
    if (i == 230) c.gel_put++, c.valsalva = true, set(session, c);
    if (i == 450) c.preset = 1, c.gel_wipe++, set(session, c);
    if (i == 560) c.gel = false, c.posture = SONDE_POSTURE_SITTING, set(session, c);
    sonde_session_tick(session);
  }
  close_session(session);
  sonde_replay_result result;
  sonde_error error = {0};
  assert_int_equal(play_again(path, *state, NULL, &result, &error), SONDE_OK);
  assert_int_equal(result.ticks, 700);
  assert_true(result.same);
}

static void controls_survive_the_bytes(void **state) {
  sonde_session_controls c = small_def(*state).controls, back;
  c.gel = c.valsalva = true;
  c.gel_put = 3, c.gel_wipe = 4, c.preset = 1;
  c.posture = SONDE_POSTURE_STANDING;
  c.stiffness_scale = 1.0 / 0.7, c.damping_scale = 1.0 / 3.0, c.friction_scale = 0.1;
  c.pathology.wall_shear_pa = 12345.678;
  c.pathology.form = SONDE_CLOT_RECANALISED;
  c.squeeze = 5, c.deep_breath = 6;
  c.duplex = (sonde_duplex_controls){SONDE_DUPLEX_POWER,
                                     {-0.01, 0.012, 0.004, 0.04, 0.1, 0},
                                     0.25,
                                     3,
                                     true,
                                     {-3e-3, 0.02, 2e-3, -0.3, 0.8, 0.5, -0.25, 100, 6}};
  unsigned char bytes[SONDE_RECORD_MOST_BYTES];
  bytes_cursor w = {bytes, sizeof bytes, 0};
  sonde_controls_put(&w, &c);
  bytes_reader r = {bytes};
  back.probe = 0;
  sonde_controls_get(&r, SONDE_RECORD_VERSION, &back);
  assert_true(r.at == bytes + w.count);
  assert_true(back.squeeze == 5 && back.deep_breath == 6);
  assert_int_equal(back.duplex.shown, c.duplex.shown);
  assert_memory_equal(&back.duplex.box, &c.duplex.box, sizeof c.duplex.box);
  assert_true(back.duplex.scale_m_s == c.duplex.scale_m_s);
  assert_true(back.duplex.gain_db == c.duplex.gain_db && back.duplex.gated);
  assert_memory_equal(&back.duplex.gate, &c.duplex.gate, sizeof c.duplex.gate);
  assert_memory_equal(&back.pathology, &c.pathology, sizeof c.pathology);
  assert_true(back.gel && back.valsalva && back.gel_put == 3 && back.gel_wipe == 4);
  assert_true(back.preset == 1 && back.posture == SONDE_POSTURE_STANDING);
  assert_true(back.stiffness_scale == c.stiffness_scale);
  assert_true(back.damping_scale == c.damping_scale && back.friction_scale == c.friction_scale);
  r.at = bytes;
  sonde_controls_get(&r, 9, &back);
  assert_int_equal(r.at - bytes, 280);
  assert_true(back.squeeze == 5 && !back.duplex.gated && back.duplex.gate.z_m == 0.02);
  r.at = bytes;
  sonde_controls_get(&r, 8, &back);
  assert_int_equal(r.at - bytes, 208);
  assert_true(back.gel_put == 3 && back.squeeze == 0 && back.duplex.shown == SONDE_DUPLEX_OFF);
  r.at = bytes;
  sonde_controls_get(&r, 3, &back);
  assert_int_equal(r.at - bytes, 152);
  assert_true(!back.gel && back.stiffness_scale == 1 && back.friction_scale == 1);
}

// Mean velocity along the beam that colour shows within 2 mm of the vein's middle below the probe,
// m/s; 0 where less than half of it is in colour.
static double vein_colour(const sonde_session *session, const sonde_frame *frame) {
  const sonde_interior *in = session->interior;
  const sonde_colour_overlay *over = &frame->colour.over;
  double nearest = INFINITY, sum = 0;
  int there = 0, shown = 0;
  sonde_vec3 at = vec3(0, 0, 0);
  for (uint32_t i = 0; i < in->course[0].count; ++i) {
    sonde_vec3 centre =
        pose_apply_inverse(frame->snapshot.world_from_probe, in->state[0][i].centre_m);
    if (fabs(centre.x) < nearest) nearest = fabs(centre.x), at = centre;
  }
  for (uint32_t k = 0; frame->colour.shown && k < over->width * over->height; ++k) {
    const double size = frame->width_m / frame->width;
    const double x = (over->left + k % over->width + 0.5 - 0.5 * frame->width) * size;
    const double z = (over->top + k / over->width + 0.5) * size;
    const double v = (over->pixels[k] - 128.0) / 127 * frame->colour.limit_m_s;
    if (hypot(x - at.x, z - at.z) > 2e-3) continue;
    ++there;
    if (over->pixels[k]) sum += v, ++shown;
  }
  return 2 * shown > there ? sum / shown : 0;
}

// A session whose probe lies along the vein, lightly, and whose blood flows.
static sonde_session *open_along_vein(sonde_session_def *def) {
  sonde_site site = barrel_site();
  site.u = vec3(0, 0, 1), site.v = vec3(0, -1, 0);
  const sonde_script_key keys[] = {{0, sonde_site_pose(&site, -0.002)},
                                   {0.1, sonde_site_pose(&site, 0.003)}};
  sonde_device device;
  assert_int_equal(sonde_device_script(keys, 2, 1e-3, &device, NULL), SONDE_OK);
  def->circulate = true;
  def->controls.echo.depth_m = 0.05;
  return open_session(def, device);
}

// Along the vein, lightly: colour shows its blood, a squeeze of the calf speeds it up, a strain
// stops it; in a clot nothing flows, and it comes back when colour is switched on again.
static void colour_follows_blood_and_hand(void **state) {
  sonde_session_def def = small_def(*state);
  def.controls.duplex.shown = SONDE_DUPLEX_VELOCITY;
  def.controls.duplex.box = (sonde_colour_box){-0.012, 0.012, 0.001, 0.05, 0.35, 0};
  def.controls.duplex.scale_m_s = 0.3;
  sonde_session *session = open_along_vein(&def);
  sonde_session_controls c = sonde_session_controls_now(session);
  sonde_frame frame = run(session, 400);
  const double rest = vein_colour(session, &frame);
  ++c.squeeze, set(session, c);
  double squeezed = 0;
  for (int k = 0; k < 60; ++k) {
    frame = run(session, 20);
    squeezed = fmax(squeezed, vein_colour(session, &frame) / rest);
  }
  run(session, 500);
  c.valsalva = true, set(session, c);
  run(session, 900);
  frame = run(session, 100);
  const double strained = vein_colour(session, &frame);
  c.valsalva = false, set(session, c);
  c.duplex.shown = SONDE_DUPLEX_OFF, set(session, c);
  frame = run(session, 40);
  assert_int_equal(frame.colour.shown, SONDE_DUPLEX_OFF);
  c.duplex.shown = SONDE_DUPLEX_VELOCITY;
  assert_int_equal(sonde_pathology_preset("acute_occlusive", &c.pathology, NULL), SONDE_OK);
  set(session, c);
  frame = run(session, 200);
  print_message("rest %.1f cm/s along the beam, squeezed %.1f times, strain %.1f, clot %.1f\n",
                100 * rest, squeezed, 100 * strained, 100 * vein_colour(session, &frame));
  assert_true(fabs(rest) > 0.01 && squeezed > 2 && fabs(strained) < 0.3 * fabs(rest));
  assert_true(vein_colour(session, &frame) == 0);
  close_session(session);
}

// Velocity along the beam over the columns that come in so many images: mean, and farthest from 0.
typedef struct course {
  double mean, most;
  uint32_t columns;
} course;

static course hear(sonde_session *session, uint32_t images) {
  course c = {0};
  uint64_t seen = UINT64_MAX;
  for (uint32_t k = 0; k < images; ++k) {
    const sonde_frame frame = run(session, 20);
    const sonde_gate_spectrum *heard = &frame.spectrum;
    for (uint32_t n = 0; heard->on && n < heard->count; ++n) {
      const sonde_gate_column *column = &heard->column[n];
      const double mean = (double)column->mean_m_s;
      if (seen == UINT64_MAX) seen = heard->column[heard->count - 1].number;
      if (column->number <= seen) continue;
      seen = column->number, ++c.columns, c.mean += mean;
      if (fabs(mean) > fabs(c.most)) c.most = mean;
    }
  }
  c.mean /= fmax(c.columns, 1);
  return c;
}

// A gate in the vein hears its blood, a column each hundredth of a second; a squeeze speeds it up,
// in a clot and beside the vein there is none.
static void a_gate_hears_blood_and_hand(void **state) {
  sonde_session_def def = small_def(*state);
  def.controls.duplex.gated = true;
  sonde_session *session = open_along_vein(&def);
  sonde_frame frame = run(session, 200);
  sonde_vessel_state vein;
  const sonde_pose across = {
      frame.snapshot.world_from_probe.position,
      q_mul(frame.snapshot.world_from_probe.rotation, (sonde_quat){sqrt(0.5), 0, 0, sqrt(0.5)})};
  assert_true(sonde_interior_vessel_at_plane(session->interior, 0, across, &vein));
  const sonde_vec3 at = pose_apply_inverse(frame.snapshot.world_from_probe, vein.centre_m);
  sonde_session_controls c = sonde_session_controls_now(session);
  c.duplex.gate.x_m = at.x, c.duplex.gate.z_m = at.z, c.duplex.gate.steer_rad = 0.35;
  c.duplex.gate.scale_m_s = 0.6, set(session, c);
  run(session, 200);
  const course rest = hear(session, 20);
  ++c.squeeze, set(session, c);
  const course squeezed = hear(session, 60);
  c.duplex.gate.z_m += 0.015, set(session, c);
  run(session, 100);
  const course beside = hear(session, 10);
  c.duplex.gate.z_m -= 0.015;
  assert_int_equal(sonde_pathology_preset("acute_occlusive", &c.pathology, NULL), SONDE_OK);
  set(session, c);
  run(session, 200);
  const course clot = hear(session, 10);
  print_message(
      "rest %.1f cm/s along the beam in %u columns, squeezed %.1f, beside %.2f, clot %.2f\n",
      100 * rest.mean, rest.columns, 100 * squeezed.most, 100 * beside.mean, 100 * clot.mean);
  assert_true(rest.columns >= 36 && fabs(rest.mean) > 0.01);
  assert_true(squeezed.most / rest.mean > 2 && beside.mean == 0 && clot.mean == 0);
  c.duplex.gated = false, set(session, c);
  frame = run(session, 40);
  assert_false(frame.spectrum.on);
  close_session(session);
}

static sonde_json *written_and_read(const sonde_setup *setup) {
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  sonde_json *root = NULL;
  char *text;
  size_t count;
  assert_int_equal(sonde_file_in_memory(&out.file, NULL), SONDE_OK);
  sonde_json_begin_object(&out, NULL);
  sonde_setup_write(&out, setup);
  sonde_json_end(&out);
  assert_int_equal(sonde_file_take(out.file, &text, &count, NULL), SONDE_OK);
  assert_int_equal(sonde_json_parse(text, count, NULL, &root, NULL), SONDE_OK);
  sonde_free(text);
  return root;
}

static void setup_survives_the_header(void **state) {
  (void)state;
  sonde_setup setup = sonde_setup_default(), back;
  setup.friction = (sonde_friction){0.5, 1.0 / 3.0, 0.011, 2, 0.05};
  setup.preset_count = 1;
  setup.presets[0] = sonde_preset_default();
  setup.presets[0].edge_damping_s = 1.0 / 7.0;
  setup.gel_m3 = 1e-5 / 3;
  setup.circulate = true;
  setup.circulation.heart_rate_hz = 1.7;
  setup.circulation.posture = SONDE_POSTURE_SITTING;
  setup.circulation.valve_leak = 1.0 / 3.0;
  sonde_json *read = written_and_read(&setup);
  assert_true(sonde_setup_read(read, &back));
  assert_memory_equal(&back.friction, &setup.friction, sizeof back.friction);
  assert_int_equal(back.circulation.posture, setup.circulation.posture);
  assert_true(back.circulation.heart_rate_hz == setup.circulation.heart_rate_hz);
  assert_true(back.circulation.breath_pa == setup.circulation.breath_pa);
  assert_true(back.circulation.valve_leak == setup.circulation.valve_leak);
  sonde_session_def def = sonde_session_def_default();
  sonde_setup_apply(&back, &def);
  sonde_setup again = sonde_setup_of(&def);
  assert_int_equal(again.preset_count, back.preset_count);
  assert_memory_equal(again.presets, back.presets, sizeof back.presets);
  assert_memory_equal(&again.friction, &back.friction, sizeof back.friction);
  assert_true(again.gel_m3 == back.gel_m3 && again.circulate == back.circulate);
  assert_int_equal(again.circulation.posture, back.circulation.posture);
  assert_true(again.circulation.heart_rate_hz == back.circulation.heart_rate_hz);
  assert_true(back.circulate && back.gel_m3 == setup.gel_m3 && back.preset_count == 1);
  assert_true(isnan(back.presets[0].normal_damping_s));
  assert_true(back.presets[0].edge_damping_s == setup.presets[0].edge_damping_s);
  sonde_json_free(read);
  setup.gel_m3 = -1;
  read = written_and_read(&setup);
  assert_false(sonde_setup_read(read, &back));
  sonde_json_free(read);
}

// What is kept of a moment brings another subject to it.
static void moments_are_kept(void **state) {
  sonde_setup setup = sonde_setup_default();
  setup.gel_m3 = 5e-6;
  setup.friction = (sonde_friction){0.5, 0.4, 0.01, 0, 0.05};
  sonde_session_controls controls = small_def(*state).controls;
  controls.gel = controls.valsalva = true;
  sonde_world_def world = sonde_session_def_default().world;
  sonde_subject *a, *b;
  assert_int_equal(sonde_subject_create(&setup, *state, &world, &controls, &a, NULL), SONDE_OK);
  assert_int_equal(sonde_subject_create(&setup, *state, &world, &controls, &b, NULL), SONDE_OK);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  sonde_site site = barrel_site();
  for (int i = 0; i < 133; ++i) sonde_subject_step(a, &probe, sonde_site_pose(&site, 5e-5 * i));
  controls.stiffness_scale = 1.25;
  sonde_subject_control(a, &controls);
  void *saved = sonde_calloc(1, sonde_subject_save(a, NULL));
  sonde_subject_save(a, saved);
  sonde_subject_restore(b, saved);
  size_t bytes = ((const sonde_model *)*state)->surface.vertex_count * sizeof(double);
  assert_memory_equal(sonde_gel_film(a->gel), sonde_gel_film(b->gel), bytes);
  assert_memory_equal(a->gel->change_m3, b->gel->change_m3, bytes);
  assert_memory_equal(&sonde_state_def(a->state)->friction, &sonde_state_def(b->state)->friction,
                      sizeof(sonde_friction));
  sonde_pathology of_a = sonde_subject_pathology(a), of_b = sonde_subject_pathology(b);
  assert_memory_equal(&of_a, &of_b, sizeof of_a);
  assert_true(b->now.controls.stiffness_scale == 1.25);
  sonde_free(saved);
  sonde_probe_clear(&probe);
  sonde_subject_destroy(a);
  sonde_subject_destroy(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(without_gel_the_image_is_coupled),
      cmocka_unit_test(less_gel_rubs_more_and_shows_less),
      cmocka_unit_test(gel_is_put_and_wiped),
      cmocka_unit_test(circulation_follows_posture_and_strain),
      cmocka_unit_test(bench_is_a_preset),
      cmocka_unit_test(presets_are_compared),
      cmocka_unit_test(bench_is_kept_in_range),
      cmocka_unit_test(recording_keeps_the_patient),
      cmocka_unit_test(controls_survive_the_bytes),
      cmocka_unit_test(colour_follows_blood_and_hand),
      cmocka_unit_test(a_gate_hears_blood_and_hand),
      cmocka_unit_test(setup_survives_the_header),
      cmocka_unit_test(moments_are_kept),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
