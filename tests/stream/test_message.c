// Messages of the page: golden bytes, what is written can be read, hostile text is refused.
#include "base/random.h"
#include "base/test.h"
#include "stream/page_message.h"

#include <cjson/cJSON.h>
#include <math.h>

// ---- binary -----------------------------------------------------------------------------------

static void mesh_has_golden_bytes(void **state) {
  (void)state;
  sonde_vec3 points[3] = {{0, 0, 0}, {0.001, 0, 0}, {0, -0.002, 0.5}};
  uint32_t faces[1][3] = {{0, 1, 2}};
  sonde_mesh mesh = {3, 1, points, faces};
  static const unsigned char EXPECTED[72] = {
      'S', 'N', 'D',  'E',  3, 0, 1, 0,    3, 0, 0,    0,
      72,  0,   0,    0,                                     // header: version, type, part
      3,   0,   0,    0,    1, 0, 0, 0,                      // counts
      0,   0,   0,    0,    0, 0, 0, 0,    0, 0, 0,    0,    // 0 0 0
      0,   0,   0x80, 0x3f, 0, 0, 0, 0,    0, 0, 0,    0,    // 1 0 0 mm
      0,   0,   0,    0,    0, 0, 0, 0xc0, 0, 0, 0xfa, 0x43, // 0 -2 500 mm
      0,   0,   0,    0,    1, 0, 0, 0,    2, 0, 0,    0,    // face
  };
  unsigned char bytes[80];
  memset(bytes, 0x77, sizeof bytes);
  assert_int_equal(page_encode_mesh(&mesh, PAGE_ARTERY, bytes, sizeof bytes), 72);
  assert_memory_equal(bytes, EXPECTED, 72);
  assert_int_equal(bytes[72], 0x77);
}

static void an_encoder_never_writes_beyond_its_buffer(void **state) {
  (void)state;
  sonde_vec3 points[3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  uint32_t faces[1][3] = {{0, 1, 2}};
  sonde_mesh mesh = {3, 1, points, faces};
  for (size_t capacity = 0; capacity < 72; ++capacity) {
    unsigned char bytes[80];
    memset(bytes, 0x55, sizeof bytes);
    assert_int_equal(page_encode_mesh(&mesh, 0, bytes, capacity), 72);
    for (size_t i = 0; i < sizeof bytes; ++i) assert_int_equal(bytes[i], 0x55);
  }
}

static void line_has_golden_bytes(void **state) {
  (void)state;
  sonde_vessel vessel = {.count = 1};
  vessel.point[0] = (sonde_vessel_point){{0.004, 0, -0.001}, 0.0055, 0.018};
  static const unsigned char EXPECTED[40] = {
      'S', 'N', 'D', 'E', 3, 0, 2,    0,    2, 0, 0, 0, 40, 0, 0,    0,    1, 0, 0,    0,
      0,   0,   0,   0,   0, 0, 0x80, 0x40, 0, 0, 0, 0, 0,  0, 0x80, 0xbf, 0, 0, 0xb0, 0x40};
  unsigned char bytes[40];
  assert_int_equal(page_encode_line(&vessel, PAGE_VEIN, bytes, sizeof bytes), 40);
  assert_memory_equal(bytes, EXPECTED, 40);
}

static uint32_t u32_at(const unsigned char *b) {
  return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}
static int i16_at(const unsigned char *b) { return (int16_t)(uint16_t)(b[0] | b[1] << 8); }
static float f32_at(const unsigned char *b) {
  uint32_t bits = u32_at(b);
  float value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

static sonde_gate_spectrum heard; // of the next frame
static double radius_m;           // likewise

// A frame of two nodes and 2 x 1 pixels, of which colour covers the right one; the first node moved
// by far too much.
static size_t make_frame(unsigned char *bytes, size_t capacity, bool colour) {
  sonde_vec3 rest_points[2] = {{0.01, 0.02, 0.03}, {0, 0, 0}};
  sonde_mesh rest = {.vertex_count = 2, .vertices = rest_points};
  float skin[6] = {1.0f, 0.018f, 0.03f, 0, 0, NAN};
  uint8_t pixels[2] = {7, 200};
  sonde_frame frame = {
      .skin_m = skin, .pixels = pixels, .width = 2, .height = 1, .width_m = 0.06, .height_m = 0.07};
  uint8_t over[1] = {201};
  if (colour)
    frame.colour = (sonde_frame_colour){
        SONDE_DUPLEX_VELOCITY, {-0.01, 0.012, 0.004, 0.03, 0.25, 0}, 0.0625, {1, 0, 1, 1, over}};
  frame.spectrum = heard;
  frame.radius_m = radius_m, frame.top_m = radius_m > 0 ? -0.0075 : 0;
  sonde_snapshot *s = &frame.snapshot;
  s->tick = 0x0102030405060708u;
  s->time_s = 1.5;
  s->probe = 3;
  s->fault = SONDE_FAULT_STOPPED;
  s->world_from_probe = (sonde_pose){{0.1, 0.2, 0.3}, {1, 0, 0, 0}};
  s->force_normal_n = 20.5;
  s->penetration_m = 0.022;
  s->vein_area_ratio = (double)NAN;
  s->solver_iterations = 1000000;
  s->solid = true, s->flags = SONDE_FLAG_INSIDE_OUT;
  return page_encode_frame(&frame, &rest, 9, bytes, capacity);
}

static size_t small_frame(unsigned char *bytes, size_t capacity) {
  return make_frame(bytes, capacity, false);
}

static void colour_stands_behind_the_image(void **state) {
  (void)state;
  unsigned char b[200] = {0};
  assert_int_equal(make_frame(b, sizeof b, true), 154 + 36 + 1);
  static const unsigned char HEAD[12] = {1, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 0};
  assert_int_equal(u32_at(b + 12), 154 + 36 + 1);
  assert_memory_equal(b + 154, HEAD, sizeof HEAD);
  assert_float_equal(f32_at(b + 166), 6.25, 0);       // limit, cm/s
  assert_float_equal(f32_at(b + 170), -10, 0);        // box, mm
  assert_float_equal(f32_at(b + 182), 30, 0);         //
  assert_float_equal(f32_at(b + 186), 14.3239, 1e-4); // degrees
  assert_int_equal(b[190], 201);
}

// A curved face tells its radius and where the picture begins; colours follow.
static void a_curved_face_stands_behind_the_image(void **state) {
  (void)state;
  unsigned char b[220] = {0};
  radius_m = 0.0625;
  assert_int_equal(make_frame(b, sizeof b, true), 154 + 12 + 36 + 1);
  radius_m = 0;
  static const unsigned char HEAD[4] = {4, 0, 0, 0};
  assert_memory_equal(b + 154, HEAD, sizeof HEAD);
  assert_float_equal(f32_at(b + 158), 62.5, 0);
  assert_float_equal(f32_at(b + 162), -7.5, 0);
  assert_int_equal(b[166], SONDE_DUPLEX_VELOCITY);
  assert_int_equal(b[202], 201);
}

// Behind the image, or the colours, with columns whose numbers go on from the first one's.
static void a_spectrum_stands_behind_all(void **state) {
  (void)state;
  static sonde_gate_column column[2];
  column[0].number = 0x0a0b0c, column[0].mean_m_s = 0.125f, column[0].peak_m_s = -0.25f;
  column[0].power[127] = 9, column[1].power[0] = 17;
  heard = (sonde_gate_spectrum){.on = true,
                                .settings = {.x_m = -4e-3, .z_m = 0.02, .steer_rad = 0.25},
                                .pulse_hz = 2500,
                                .limit_m_s = 0.5,
                                .low_m_s = -0.25,
                                .slowest_m_s = 0.0125,
                                .count = 2,
                                .column = column};
  for (int colour = 0; colour < 2; ++colour) {
    unsigned char b[600] = {0};
    const size_t at = 154 + (colour ? 37 : 0);
    assert_int_equal(make_frame(b, sizeof b, colour), at + 56 + 2 * 136);
    static const unsigned char HEAD[8] = {3, 0, 2, 0, 128, 0, 0, 0};
    assert_memory_equal(b + at, HEAD, sizeof HEAD);
    assert_float_equal(f32_at(b + at + 8), -4, 0);          // x, depth, mm
    assert_float_equal(f32_at(b + at + 12), 20, 0);         //
    assert_float_equal(f32_at(b + at + 20), 14.3239, 1e-4); // lean, degrees
    assert_float_equal(f32_at(b + at + 28), 50, 0);         // limit, lowest, cm/s
    assert_float_equal(f32_at(b + at + 32), -25, 0);        //
    assert_float_equal(f32_at(b + at + 36), 2500, 0);       // pulses, Hz
    assert_float_equal(f32_at(b + at + 40), 1.25, 1e-6);    // slowest, cm/s
    assert_int_equal(u32_at(b + at + 48), 0x0a0b0c);
    assert_float_equal(f32_at(b + at + 56), 12.5, 0);
    assert_float_equal(f32_at(b + at + 60), -25, 0);
    assert_int_equal(b[at + 56 + 135], 9);
    assert_int_equal(b[at + 56 + 136 + 8], 17);
  }
  heard.on = false;
}

static void frame_fields_stand_where_the_protocol_says(void **state) {
  (void)state;
  unsigned char b[160] = {0};
  assert_int_equal(small_frame(b, sizeof b), 140 + 12 + 2);
  static const unsigned char HEAD[48] = {
      'S', 'N', 'D', 'E', 3,   0,    3,    0,
      9,   0,   0,   0,   154, 0,    0,    0, // header
      8,   7,   6,   5,   4,   3,    2,    1,
      0,   0,   0,   0,   0,   0,    0xf8, 0x3f, // tick, 1.5 s
      2,   0,   0,   0,   2,   0,    1,    0,
      3,   0,   4,   0,   8,   0x80, 0xff, 0xff}; // nodes ... flags, iterations (full)
  assert_memory_equal(b, HEAD, sizeof HEAD);
  assert_float_equal(f32_at(b + 52), 100, 1e-4);    // x mm
  assert_float_equal(f32_at(b + 64), 1, 0);         // w
  assert_float_equal(f32_at(b + 104), 20.5, 0);     // normal force
  assert_float_equal(f32_at(b + 108), 22, 1e-5);    // penetration mm
  assert_true(isnan(f32_at(b + 116)));              // vein: not in view
  assert_float_equal(f32_at(b + 136), 0.002, 1e-9); // quantum mm
  assert_int_equal(b[152], 7);
  assert_int_equal(b[153], 200);
}

static void displacements_are_rounded_and_saturate(void **state) {
  (void)state;
  unsigned char b[160] = {0};
  small_frame(b, sizeof b);
  assert_int_equal(i16_at(b + 140), 32767); // 990 mm saturates
  assert_int_equal(i16_at(b + 142), -1000); // -2 mm in steps of 2 um
  assert_int_equal(i16_at(b + 144), 0);
  assert_int_equal(i16_at(b + 150), 0); // not a number
}

// ---- JSON to the browser ----------------------------------------------------------------------

static sonde_model small_model(sonde_site *site, sonde_datum data[3]) {
  *site = (sonde_site){.id = 27, .position_m = {0.01, -0.02, 0.03}, .normal = {0, 1, 0}};
  data[0] = (sonde_datum){27, "linear", 0.002, 1.25};
  data[1] = (sonde_datum){27, "linear", 0.004, 2.5};
  data[2] = (sonde_datum){28, "linear", 0.004, 99};
  sonde_model model = {.name = "Thigh \"A\" \\ \n",
                       .provenance = "computed",
                       .site_count = 1,
                       .sites = site,
                       .datum_count = 3,
                       .data = data};
  return model;
}

static sonde_json_out begin_text(void) {
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  assert_int_equal(sonde_file_in_memory(&out.file, NULL), SONDE_OK);
  return out;
}

static cJSON *end_text(sonde_json_out *out) {
  char *text = NULL;
  size_t count = 0;
  assert_int_equal(sonde_file_take(out->file, &text, &count, NULL), SONDE_OK);
  cJSON *root = cJSON_ParseWithOpts(text, NULL, 1);
  sonde_free(text);
  return root;
}

static void the_hello_can_be_read_by_a_json_parser(void **state) {
  (void)state;
  sonde_site site;
  sonde_datum data[3];
  sonde_model model = small_model(&site, data);
  sonde_probe probe = {.name = "linear", .half_x_m = 0.03, .half_y_m = 0.006, .rectangular = true};
  const sonde_probe *probes[1] = {&probe};
  page_hello hello = {&model, probes, 1, 40, "\"trainee\":\"A\"", true};
  sonde_json_out out = begin_text();
  page_write_hello(&out, &hello);
  cJSON *root = end_text(&out);
  assert_non_null(root);
  assert_string_equal(cJSON_GetObjectItem(root, "model")->valuestring, model.name);
  const cJSON *read_site = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "sites"), 0);
  const cJSON *position = cJSON_GetObjectItem(read_site, "position_mm");
  assert_float_equal(cJSON_GetArrayItem(position, 1)->valuedouble, -20, 1e-9);
  const cJSON *curve = cJSON_GetObjectItem(cJSON_GetObjectItem(read_site, "curves"), "linear");
  assert_int_equal(cJSON_GetArraySize(curve), 2); // the other site's datum is not in it
  assert_float_equal(cJSON_GetArrayItem(cJSON_GetArrayItem(curve, 1), 1)->valuedouble, 2.5, 1e-9);
  assert_string_equal(cJSON_GetObjectItem(root, "trainee")->valuestring, "A");
  int cases = cJSON_GetArraySize(cJSON_GetObjectItem(root, "cases"));
  int names = 0;
  while (sonde_pathology_names()[names]) ++names;
  assert_int_equal(cases, names);
  cJSON_Delete(root);
}

static cJSON *written_controls(double gain_db, page_hidden hidden) {
  sonde_session_controls controls = {.echo = {.gain_db = gain_db}, .duplex.gate.scale_m_s = 0.25};
  sonde_json_out out = begin_text();
  snprintf(controls.pathology.name, sizeof controls.pathology.name, "healthy");
  page_write_controls(&out, &controls, "point", hidden, 0,
                      (page_role){PAGE_WATCHER, PAGE_LEARNER, PAGE_MAY_NOTHING, false});
  return end_text(&out);
}

// A learner is not told the case; the posture of a model that has its own is no control.
static void controls_are_hidden(void **state) {
  (void)state;
  cJSON *all = written_controls(0, (page_hidden){false, false, false}),
        *none = written_controls(0, (page_hidden){true, true, true});
  assert_string_equal(cJSON_GetObjectItem(all, "case")->valuestring, "healthy");
  assert_string_equal(cJSON_GetObjectItem(all, "posture")->valuestring, "supine");
  assert_string_equal(cJSON_GetObjectItem(none, "case")->valuestring, "");
  assert_null(cJSON_GetObjectItem(none, "posture"));
  // The lines of a fan do not lean.
  for (int fan = 0; fan < 2; ++fan) {
    const cJSON *of = fan ? none : all;
    assert_float_equal(cJSON_GetObjectItem(of, "gate_scale_cm_s")->valuedouble, 25, 1e-9);
    assert_string_equal(cJSON_GetObjectItem(of, "colour")->valuestring, "off");
    assert_int_equal(cJSON_HasObjectItem(of, "colour_steer_deg"), !fan);
    assert_int_equal(cJSON_HasObjectItem(of, "gate_steer_deg"), !fan);
  }
  cJSON_Delete(all);
  cJSON_Delete(none);
}

static double written(double gain_db) {
  cJSON *root = written_controls(gain_db, (page_hidden){false, false, false});
  assert_non_null(root);
  const cJSON *gain = cJSON_GetObjectItem(root, "gain_db");
  double value = cJSON_IsNull(gain) ? (double)NAN : gain->valuedouble;
  cJSON_Delete(root);
  return value;
}

static void numbers_survive_writing(void **state) {
  (void)state;
  const double values[] = {0, 1, -1, 0.0001, -0.0001, 12.3456, -7.5, 123456.789, 0.99999};
  for (size_t i = 0; i < SONDE_COUNT_OF(values); ++i)
    assert_float_equal(written(values[i]), values[i], 0.51e-4);
  assert_true(isnan(written((double)NAN)));
  assert_true(isnan(written((double)INFINITY)));
  assert_true(isnan(written(-1e300)));
}

// ---- JSON from the browser --------------------------------------------------------------------

static sonde_status parse(const char *text, page_command *command) {
  sonde_error error = {0};
  sonde_status status = page_parse_command(text, strlen(text), command, &error);
  if (status) assert_true(strlen(error.message) > 10);
  return status;
}

static void a_goal_is_read_in_si(void **state) {
  (void)state;
  page_command c;
  assert_int_equal(
      parse("{\"type\":\"goal\",\"position_mm\":[10,-20,30.5],\"rotation\":[0,0,1.2,0]}", &c),
      SONDE_OK);
  assert_int_equal(c.type, PAGE_COMMAND_GOAL);
  assert_float_equal(c.goal.position.z, 0.0305, 1e-12);
  assert_float_equal(c.goal.rotation.y, 1, 1e-12); // normalised
}

static void controls_leave_out_what_is_absent(void **state) {
  (void)state;
  page_command c;
  assert_int_equal(parse("{\"type\":\"controls\",\"depth_mm\":80,\"frequency_mhz\":5,"
                         "\"case\":\"healthy\"}",
                         &c),
                   SONDE_OK);
  assert_float_equal(c.echo.depth_m, 0.08, 1e-12);
  assert_float_equal(c.echo.frequency_hz, 5e6, 1e-3);
  assert_true(isnan(c.echo.gain_db) && isnan(c.echo.dynamic_range_db) && isnan(c.echo.focus_m));
  assert_string_equal(c.pathology, "healthy");
  assert_string_equal(c.probe, "");
  // A gate's numbers change alone.
  sonde_session_controls controls = {.duplex = sonde_duplex_controls_default()};
  const sonde_gate_settings usual = controls.duplex.gate;
  page_command_take(&c, &controls);
  assert_memory_equal(&controls.duplex.gate, &usual, sizeof usual);
  assert_int_equal(parse("{\"type\":\"controls\",\"gate\":true,\"gate_mm\":[-4,25],"
                         "\"gate_steer_deg\":-20,\"gate_filter_hz\":100}",
                         &c),
                   SONDE_OK);
  page_command_take(&c, &controls);
  const sonde_gate_settings *gate = &controls.duplex.gate;
  assert_true(controls.duplex.gated && gate->scale_m_s == usual.scale_m_s);
  assert_float_equal(gate->x_m, -0.004, 1e-12);
  assert_float_equal(gate->z_m, 0.025, 1e-12);
  assert_float_equal(gate->steer_rad, -0.34907, 1e-5);
  assert_float_equal(gate->filter_hz, 100, 0);
}

static void bad_commands_are_refused(void **state) {
  (void)state;
  static const char *const BAD[] = {
      "",
      " ",
      "null",
      "[]",
      "7",
      "{}",
      "{\"type\":7}",
      "{\"type\":\"fire\"}",
      "{\"type\":\"stop\"",
      "{\"type\":\"stop\"} x",
      "{\"type\":\"goal\"}",
      "{\"type\":\"goal\",\"position_mm\":[1,2],\"rotation\":[1,0,0,0]}",
      "{\"type\":\"goal\",\"position_mm\":[1,2,3,4],\"rotation\":[1,0,0,0]}",
      "{\"type\":\"goal\",\"position_mm\":[1,2,\"3\"],\"rotation\":[1,0,0,0]}",
      "{\"type\":\"goal\",\"position_mm\":[1,2,1e9],\"rotation\":[1,0,0,0]}",
      "{\"type\":\"goal\",\"position_mm\":[1,2,1e999],\"rotation\":[1,0,0,0]}",
      "{\"type\":\"goal\",\"position_mm\":[1,2,NaN],\"rotation\":[1,0,0,0]}",
      "{\"type\":\"goal\",\"position_mm\":[1,2,3],\"rotation\":[0,0,0,0]}",
      "{\"type\":\"goal\",\"position_mm\":[1,2,3],\"rotation\":[2,2,2,2]}",
      "{\"type\":\"controls\",\"gain_db\":31}",
      "{\"type\":\"controls\",\"gain\":3}",
      "{\"type\":\"controls\",\"gain_db\":\"1\"}",
      "{\"type\":\"controls\",\"depth_mm\":19.9}",
      "{\"type\":\"controls\",\"probe\":\"\"}",
      "{\"type\":\"controls\",\"probe\":5}",
      "{\"type\":\"controls\",\"case\":\"a name that is longer than any case may be\"}",
      "{\"type\":\"controls\",\"gate\":1}",
      "{\"type\":\"controls\",\"gate_mm\":[1]}",
      "{\"type\":\"controls\",\"gate_mm\":[1,1e9]}",
      "{\"type\":\"controls\",\"gate_scale_cm_s\":0}",
      "{\"type\":\"controls\",\"gate_baseline\":1}",
      "{\"type\":\"controls\",\"gate_angle_deg\":90}",
      "{\"type\":\"ack\"}",
      "{\"type\":\"ack\",\"frame\":-1}",
      "{\"type\":\"ack\",\"frame\":1.5}",
      "{\"type\":\"ack\",\"frame\":4294967296}",
      "{\"type\":\"stop\",\"x\":[[[0]]]}",
  };
  page_command c;
  for (size_t i = 0; i < SONDE_COUNT_OF(BAD); ++i)
    if (parse(BAD[i], &c) == SONDE_OK) fail_msg("accepted: %s", BAD[i]);
  assert_int_equal(parse("{\"type\":\"stop\",\"x\":\"[[[[[{{{{\"}", &c), SONDE_OK); // in a string
}

// A gate's numbers are taken to either end of their ranges and refused beyond.
static void a_gate_s_numbers_are_bounded(void **state) {
  (void)state;
  static const struct {
    const char *key;
    double low, high;
  } NUMBER[] = {{"length_mm", 0.5, 15}, {"steer_deg", -20, 20},  {"angle_deg", -80, 80},
                {"scale_cm_s", 2, 200}, {"baseline", -0.9, 0.9}, {"filter_hz", 10, 1000},
                {"gain_db", -30, 30}};
  for (size_t k = 0; k < SONDE_COUNT_OF(NUMBER); ++k) {
    const double spare = 0.01 * (NUMBER[k].high - NUMBER[k].low);
    const double value[] = {NUMBER[k].low, NUMBER[k].high, NUMBER[k].low - spare,
                            NUMBER[k].high + spare};
    for (int i = 0; i < 4; ++i) {
      char text[96];
      page_command c;
      snprintf(text, sizeof text, "{\"type\":\"controls\",\"gate_%s\":%.9g}", NUMBER[k].key,
               value[i]);
      if ((parse(text, &c) == SONDE_OK) != (i < 2))
        fail_msg("%s: %s", i < 2 ? "refused" : "accepted", text);
    }
  }
}

static void size_zero_bytes_and_depth_are_bounded(void **state) {
  (void)state;
  page_command c;
  sonde_error error;
  static char big[PAGE_COMMAND_BYTES + 2];
  memset(big, ' ', sizeof big);
  memcpy(big, "{\"type\":\"stop\"}", 15);
  assert_int_equal(page_parse_command(big, PAGE_SHORT_BYTES, &c, &error), SONDE_OK);
  assert_int_equal(page_parse_command(big, PAGE_SHORT_BYTES + 1, &c, &error), SONDE_FORMAT);
  // Only a case that is edited may be longer.
  memcpy(big, "{\"type\":\"edit\"}", 15);
  assert_int_equal(page_parse_command(big, PAGE_COMMAND_BYTES, &c, &error), SONDE_OK);
  assert_int_equal(strlen(c.request.entry), PAGE_COMMAND_BYTES);
  assert_int_equal(page_parse_command(big, PAGE_COMMAND_BYTES + 1, &c, &error), SONDE_FORMAT);
  assert_int_equal(page_parse_command("{\"type\":\"stop\"}\0", 16, &c, &error), SONDE_FORMAT);
  memset(big, '[', PAGE_COMMAND_BYTES);
  assert_int_equal(page_parse_command(big, PAGE_COMMAND_BYTES, &c, &error), SONDE_FORMAT);
}

static sonde_status say(const char *key, double value, page_command *c, sonde_error *error) {
  char text[100];
  snprintf(text, sizeof text, "{\"type\":\"controls\",\"%s\":%.12g}", key, value);
  return page_parse_command(text, strlen(text), c, error);
}

// A control at the end of its range is taken as it is, also by the scanner; what lies beyond is
// refused, and the error names the control and the range.
static void controls_out_of_range_are_refused_by_name(void **state) {
  (void)state;
  const sonde_echo_range *r = sonde_echo_ranges();
  page_command c;
  sonde_error error;
  for (uint32_t k = 0; k < SONDE_ECHO_SETTINGS; ++k, ++r) {
    const double ends[] = {r->low, r->high}, width = r->high - r->low;
    for (int end = 0; end < 2; ++end) {
      assert_int_equal(say(r->key, ends[end], &c, &error), SONDE_OK);
      double taken = *(const double *)(const void *)((const char *)&c.echo + r->offset);
      assert_true(fabs(taken - ends[end] * r->si) <= 1e-12 * r->si * r->high);
      sonde_echo_settings clean = sonde_echo_settings_clamp(c.echo);
      assert_true(*(const double *)(const void *)((const char *)&clean + r->offset) == taken);
      double beyond = ends[end] + (end ? 1e-3 : -1e-3) * width;
      assert_int_equal(say(r->key, beyond, &c, &error), SONDE_ARGUMENT);
      char high[24];
      snprintf(high, sizeof high, "to %g", r->high);
      assert_true(strstr(error.message, r->key) && strstr(error.message, high));
    }
  }
  assert_int_equal(say("gain", 3, &c, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "\"gain\""));
}

// Whatever passes is within the ranges that the session was promised.
static void check_accepted(const page_command *c) {
  assert_true(c->type <= PAGE_COMMAND_PING);
  if (c->type == PAGE_COMMAND_GOAL) {
    const sonde_quat q = c->goal.rotation;
    assert_true(fabs(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1) < 1e-9);
    assert_true(fabs(c->goal.position.x) <= 2 && fabs(c->goal.position.y) <= 2);
  } else if (c->type == PAGE_COMMAND_CONTROLS) {
    assert_true(isnan(c->echo.gain_db) || fabs(c->echo.gain_db) <= 30);
    assert_true(isnan(c->echo.depth_m) ||
                (c->echo.depth_m >= 0.02 - 1e-9 && c->echo.depth_m <= 0.15 + 1e-9));
    assert_non_null(memchr(c->probe, 0, sizeof c->probe));
  }
}

static void mangled_messages_do_no_harm(void **state) {
  (void)state;
  static const char *const SEEDS[] = {
      "{\"type\":\"goal\",\"position_mm\":[10,-20,30.5],\"rotation\":[1,0,0,0]}",
      "{\"type\":\"controls\",\"probe\":\"linear\",\"case\":\"healthy\",\"gain_db\":-3e0}",
      "{\"type\":\"ack\",\"frame\":17}", "{\"type\":\"\\u0073top\",\"a\":{\"b\":[1,true,null]}}"};
  static const char ALPHABET[] = "{}[]\",:\\0123456789eE+-.truefalsn \x01\x7f\xff/u";
  uint64_t counter = 0;
  uint32_t accepted = 0;
  for (int round = 0; round < 60000; ++round) {
    char text[256];
    const char *seed = SEEDS[round % 4];
    size_t count = strlen(seed);
    memcpy(text, seed, count);
    uint64_t edits = sonde_random_bits(11, counter++) % 6;
    for (uint64_t e = 0; e < edits; ++e) {
      uint64_t r = sonde_random_bits(11, counter++);
      text[r % count] = ALPHABET[(r >> 32) % (sizeof ALPHABET - 1)];
    }
    if (round % 3 == 0) count = sonde_random_bits(11, counter++) % (count + 1);
    page_command c;
    sonde_error error = {0};
    if (page_parse_command(text, count, &c, &error) == SONDE_OK) {
      ++accepted;
      check_accepted(&c);
    } else {
      assert_true(error.message[0] != 0);
    }
  }
  assert_in_range(accepted, 2000, 40000); // the loop met both sides
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(mesh_has_golden_bytes),
      cmocka_unit_test(an_encoder_never_writes_beyond_its_buffer),
      cmocka_unit_test(line_has_golden_bytes),
      cmocka_unit_test(colour_stands_behind_the_image),
      cmocka_unit_test(a_curved_face_stands_behind_the_image),
      cmocka_unit_test(a_spectrum_stands_behind_all),
      cmocka_unit_test(frame_fields_stand_where_the_protocol_says),
      cmocka_unit_test(displacements_are_rounded_and_saturate),
      cmocka_unit_test(the_hello_can_be_read_by_a_json_parser),
      cmocka_unit_test(numbers_survive_writing),
      cmocka_unit_test(controls_are_hidden),
      cmocka_unit_test(a_goal_is_read_in_si),
      cmocka_unit_test(controls_leave_out_what_is_absent),
      cmocka_unit_test(bad_commands_are_refused),
      cmocka_unit_test(a_gate_s_numbers_are_bounded),
      cmocka_unit_test(size_zero_bytes_and_depth_are_bounded),
      cmocka_unit_test(controls_out_of_range_are_refused_by_name),
      cmocka_unit_test(mangled_messages_do_no_harm),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
