// Writes the seeds of every fuzz target: what this program itself writes today, and the files that
// ship. usage: fuzz_seeds DIRECTORY SOURCE_DIRECTORY
// put           one seed: a byte that chooses, then bytes
// put_file      one seed from a file
// seed_*        the seeds of one target
#include "fuzz.h"
#include "sweep/frames.h"
#include "scene/scene.h"

#include "base/maths.h"
#include "fuzz_scene_text.h"

#include <dirent.h>
#include <sys/stat.h>

static const char *root, *source;
static sonde_error error;

#define MUST(call)                                                                                 \
  do {                                                                                             \
    sonde_status must = (call);                                                                    \
    if (must) fprintf(stderr, "%s\n", error.message);                                              \
    FUZZ_CHECK(must == SONDE_OK);                                                                  \
  } while (0)

// A choice of 0 puts no byte before the bytes.
static void put(const char *target, const char *name, char choice, const void *bytes,
                size_t count) {
  char path[1024];
  snprintf(path, sizeof path, "%s/%s", root, target);
  mkdir(path, 0777);
  snprintf(path, sizeof path, "%s/%s/%s", root, target, name);
  FILE *stream = fopen(path, "wb");
  FUZZ_CHECK(stream && (!choice || fputc(choice, stream) == choice));
  FUZZ_CHECK(fwrite(bytes, 1, count, stream) == count && fclose(stream) == 0);
}

static void put_text(const char *target, const char *name, char choice, const char *text) {
  put(target, name, choice, text, strlen(text));
}

static void put_file(const char *target, const char *name, char choice, const char *path) {
  char *bytes = NULL;
  size_t count;
  MUST(sonde_file_load(path, &bytes, &count, &error));
  put(target, name, choice, bytes, count);
  sonde_free(bytes);
}

// Every file of a directory of the source tree.
static void put_data(const char *target, const char *directory, char choice) {
  char path[1024];
  snprintf(path, sizeof path, "%s/%s", source, directory);
  DIR *list = opendir(path);
  FUZZ_CHECK(list);
  for (struct dirent *entry; (entry = readdir(list));) {
    if (entry->d_name[0] == '.') continue;
    snprintf(path, sizeof path, "%s/%s/%.255s", source, directory, entry->d_name);
    put_file(target, entry->d_name, choice, path);
  }
  closedir(list);
}

static void seed_meshes(void) {
  static const struct {
    const char *name;
    char mesh, probe;
  } FORMATS[] = {{"seed.ply", '0', '1'}, {"seed.obj", '1', '3'}, {"seed.stl", '2', '5'}};
  sonde_probe probe;
  MUST(sonde_probe_create("rect:20x10", &probe, &error));
  for (size_t k = 0; k < sizeof FORMATS / sizeof FORMATS[0]; ++k) {
    const char *path = fuzz_path(FORMATS[k].name);
    MUST(sonde_mesh_save(path, 1e-3, &probe.body.hull, &error));
    put_file("mesh", FORMATS[k].name, FORMATS[k].mesh, path);
    put_file("probe", FORMATS[k].name, FORMATS[k].probe, path);
  }
  sonde_probe_clear(&probe);
  put_text("probe", "rectangle", '0', "rect:12x80");
  put_text("probe", "ball", '0', "ball:15");
  for (const char *const *name = sonde_probe_names(); *name; ++name)
    put_text("probe", *name, '0', *name);
}

static void seed_models(void) {
  static const uint8_t NO_EDIT[4] = {0, 0, 0, 'S'};
  FUZZ_CHECK(sonde_model_save(fuzz_leg(), fuzz_path("seed.sonde"), &error) == SONDE_OK);
  put_file("model", "whole", '1', fuzz_path("seed.sonde"));
  put_file("model", "whole_seen", '3', fuzz_path("seed.sonde"));
  put("model", "edits", '2', NO_EDIT, sizeof NO_EDIT);
}

static void seed_tables(void) {
  sonde_model *leg = fuzz_leg();
  sonde_site_table sites = {.count = leg->site_count, .sites = leg->sites};
  sonde_datum data[4];
  sonde_vec3 place[4], normal[4];
  for (int k = 0; k < 4; ++k) {
    place[k] = leg->sites[0].position_m, normal[k] = leg->sites[0].normal;
    data[k] = (sonde_datum){.site = 1, .penetration_m = 2e-3 * k, .force_n = 0.9 * k};
    snprintf(data[k].probe, sizeof data[k].probe, "linear");
  }
  sonde_measurements measured = {.count = 4, .data = data, .position_m = place, .normal = normal};
  MUST(sonde_site_table_save(fuzz_path("sites.csv"), &sites, &error));
  MUST(sonde_measurements_save(fuzz_path("measured.csv"), &measured, &error));
  put_file("tables", "sites.csv", '1', fuzz_path("sites.csv"));
  put_file("tables", "measurements.csv", '0', fuzz_path("measured.csv"));
  for (int kind = 0; kind < 2; ++kind) {
    sonde_protocol protocol = sonde_protocol_default((sonde_protocol_kind)kind);
    sonde_motion_record record;
    protocol.site = 1;
    protocol.rate_hz = 200;
    protocol.speed_count = 1;
    MUST(sonde_protocol_run(leg, NULL, &protocol, NULL, &record, &error));
    MUST(sonde_motion_record_save(fuzz_path("motion.csv"), &record, &error));
    sonde_motion_record_clear(&record);
    put_file("tables", kind ? "slide.csv" : "ramp.csv", '2', fuzz_path("motion.csv"));
  }
}

static void seed_frames(void) {
  static const char *const NAMES[] = {"seed.mha", "seed.nrrd", "seed.seq.nrrd"};
  sonde_sequence s;
  sonde_volume v;
  MUST(sonde_sequence_create(8, 6, 4, &s, &error));
  for (uint32_t f = 0; f < 4; ++f) {
    sonde_affine pixel = {{{0.5, 0, 0, 0}, {0, 0.5, 0, 0}, {0, 0, 1, 0.6 * f}}};
    MUST(sonde_sequence_set_transform(&s, f, "ImageToReference", &pixel, &error));
  }
  for (size_t i = 0; i < 8 * 6 * 4; ++i) s.pixels[i] = (uint8_t)(37 * i);
  MUST(sonde_volume_create((const uint32_t[3]){5, 4, 3}, &v, &error));
  for (int packed = 0; packed < 2; ++packed)
    for (int k = 0; k < 3; ++k) {
      char name[64];
      const char *path = fuzz_path(NAMES[k]);
      snprintf(name, sizeof name, "%s%s", packed ? "packed_" : "", NAMES[k]);
      MUST(sonde_sequence_save(path, &s, packed, &error));
      put_file("frames", name, '0', path);
      snprintf(name, sizeof name, "volume_%s%s", packed ? "packed_" : "", NAMES[k]);
      if (k < 2) MUST(sonde_volume_save(path, &v, packed, &error));
      if (k < 2) put_file("frames", name, '1', path);
    }
  sonde_sequence_clear(&s);
  sonde_volume_clear(&v);
  put_text("calibration", "plus.xml", 0,
           "<PlusConfiguration version=\"2.1\">\n<CoordinateDefinitions>\n"
           "<Transform From=\"Image\" To=\"Probe\" Matrix=\"0.2 0 0 1  0 0.2 0 2  0 0 0.2 3  "
           "0 0 0 1\" />\n</CoordinateDefinitions>\n"
           "<VolumeReconstruction ClipRectangleOrigin=\"1 1\" ClipRectangleSize=\"6 4\" />\n"
           "</PlusConfiguration>\n");
}

static void seed_scenes(void) {
  sonde_scene *scene = NULL;
  sonde_scene_state *state = NULL;
  put_text("scene", "kinds.yaml", '0', FUZZ_SCENE);
  put_text("scene", "joints.yaml", '0',
           "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nbodies:\n"
           "- {name: box, shape: {box_mm: [40, 40, 40]}, mass_kg: 1}\n"
           "- {name: in, shape: {sphere_mm: 8}, mass_kg: 0.1, position_mm: [3, 2, 1]}\n"
           "- {name: rod, shape: {box_mm: [50, 5, 5]}, mass_kg: 0.1, position_mm: [45, 0, 40]}\n"
           "- {name: s, kind: springs, shape: {sheet_mm: [40, 20], edge_mm: 10}, position_mm: "
           "[0, 0, 23], mass_kg: 0.01, springs: {stiffness_n_m: 100, thickness_mm: 2, "
           "bending_n_m: 1e-3, bending_damping_s: 0.01}}\n"
           "attachments:\n- {bodies: [rod], points_mm: [[70, 0, 40], [70, 5, 40]]}\n"
           "- {bodies: [s, rod], box_mm: [[19, -10, 22], [20, 10, 24]], stiffness_n_m: 1e3, "
           "damping_n_s_m: 1}\n");
  put_text("scene", "leg.yaml", '0',
           "sonde_scene: 1\nbodies:\n- {name: leg, kind: two_layer, model: thigh}\n"
           "- {name: block, shape: {mesh: {file: body.ply}}, mass_kg: 0.1, "
           "position_mm: [62, 0, 0]}\n");
  put_text("scene", "tetrahedra", '1',
           "4 3 0 0\n1 0 0 0\n2 10 0 0\n3 0 10 0\n4 0 0 10\n--\n1 4 0\n1 1 2 3 4\n");
  MUST(sonde_scene_parse(FUZZ_SCENE, "snapshot.yaml", NULL, &scene, &error));
  MUST(sonde_scene_state_create(scene, &state, &error));
  for (int k = 0; k < 5; ++k) sonde_scene_advance(state);
  MUST(sonde_scene_state_save(state, fuzz_path("snapshot"), &error));
  put_file("snapshot", "five_ticks", 0, fuzz_path("snapshot"));
  sonde_scene_state_destroy(state);
  sonde_scene_destroy(scene);
}

static void seed_exams(void) {
  put_data("case", "data/cases", 0);
  put_data("protocol", "data/protocols", 0);
  put_data("preset", "data/presets", 0);
  for (uint64_t k = 0; k < 6; ++k) {
    char name[32];
    sonde_case patient;
    sonde_case_generate(k, (sonde_case_level)(k % 3), &patient);
    snprintf(name, sizeof name, "generated_%d.yaml", (int)k);
    MUST(sonde_case_save(&patient, fuzz_path(name), &error));
    put_file("case", name, 0, fuzz_path(name));
  }
  sonde_preset preset = sonde_preset_default();
  snprintf(preset.name, sizeof preset.name, "seed");
  preset.normal_damping_s = 0.01, preset.edge_damping_s = 0.02;
  MUST(sonde_preset_save(fuzz_path("preset.json"), &preset, &error));
  put_file("preset", "saved.json", 0, fuzz_path("preset.json"));
}

static void seed_log(void) {
  sonde_exam_log *log = NULL;
  MUST(sonde_exam_log_open(fuzz_path("log.sqlite"), &log, &error));
  for (int k = 0; k < 3; ++k) {
    sonde_log_entry entry = {.score = 20.0 * k, .answered = true};
    snprintf(entry.id, sizeof entry.id, "exam_%d", k);
    snprintf(entry.trainee, sizeof entry.trainee, "ann");
    snprintf(entry.case_id, sizeof entry.case_id, "healthy");
    sonde_log_date(1795000000 + k, entry.date);
    MUST(sonde_exam_log_add(log, &entry, &error));
  }
  sonde_exam_log_close(log);
  put_file("log", "three_exams", 0, fuzz_path("log.sqlite"));
}

// A recording of a press with changed controls, as the recorder leaves it and with a comment; the
// comments beside an old one.
static void seed_recording(void) {
  const char *path = fuzz_path("seed.rec");
  sonde_device device;
  const sonde_script_key keys[] = {{0.0, fuzz_press(fuzz_leg(), -1e-3)},
                                   {0.3, fuzz_press(fuzz_leg(), 0.012)}};
  MUST(sonde_device_script(keys, 2, 1e-3, &device, &error));
  sonde_session *session = fuzz_session(path, &device);
  for (int k = 0; k < 300; ++k) {
    sonde_session_controls c = sonde_session_controls_now(session);
    if (k == 120) c.echo.gain_db = 6, c.gel = true, ++c.gel_put;
    if (k == 200) c.probe = 0;
    sonde_session_control(session, &c);
    sonde_session_tick(session);
  }
  MUST(sonde_session_destroy(session, &error));
  put_file("recording", "whole", 0, path);
  sonde_comment comment = {.time_s = 0.1, .author = "teacher", .text = "well pressed"};
  MUST(sonde_comments_add(path, &comment, &error));
  put_file("recording", "commented", 0, path);
  put_text("comments", "one", 0,
           "{\"comments\":[{\"time_s\":0.1,\"author\":\"teacher\",\"text\":\"well pressed\"}]}");
}

static void seed_messages(void) {
  // clang-format off
  static const char *const TEXTS[] = {
      "{\"type\":\"goal\",\"position_mm\":[62,0,0],\"rotation\":[0.7,0,-0.7,0]}",
      "{\"type\":\"controls\",\"gain_db\":3,\"depth_mm\":60,\"frequency_mhz\":5,\"stiffness_scale\":1.5}",
      "{\"type\":\"controls\",\"probe\":\"linear\",\"case\":\"healthy\",\"valsalva\":true,\"posture\":\"supine\"}",
      "{\"type\":\"stop\"}",
      "{\"type\":\"resume\"}",
      "{\"type\":\"ack\",\"frame\":7}",
      "{\"type\":\"ping\",\"id\":9}",
      "{\"type\":\"gel\",\"action\":\"put\"}",
      "{\"type\":\"start_exam\",\"case\":\"a\",\"protocol\":\"b\",\"guidance\":\"full\",\"trainee\":\"ann\"}",
      "{\"type\":\"decide\",\"segment\":\"femoral_mid\",\"decision\":\"clot\"}",
      "{\"type\":\"seek\",\"time_s\":2.5}",
      "{\"type\":\"play\",\"playing\":true,\"speed\":2}",
      "{\"type\":\"comment\",\"time_s\":1,\"text\":\"good\",\"author\":\"teacher\"}"};
  // clang-format on
  for (size_t k = 0; k < sizeof TEXTS / sizeof TEXTS[0]; ++k) {
    char name[16];
    snprintf(name, sizeof name, "%zu.json", k);
    put_text("message", name, 0, TEXTS[k]);
  }
}

int main(int argc, char **argv) {
  if (argc != 3) {
    fprintf(stderr, "usage: %s DIRECTORY SOURCE_DIRECTORY\n", argv[0]);
    return 2;
  }
  root = argv[1], source = argv[2];
  mkdir(root, 0777);
  seed_meshes();
  seed_tables();
  seed_frames();
  seed_scenes();
  seed_exams();
  seed_log();
  seed_messages();
  seed_recording();
  seed_models();
  return 0;
}
