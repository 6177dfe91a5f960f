// Scene files: what is wrong is told with file, line and reason; what is read is what was written.
#include "scene_fixture.h"
#include "sanitized.h"

#include <unistd.h>

typedef struct bad_scene {
  const char *text;
  sonde_status status;
  const char *part; // of the message, with the line
} bad_scene;

#define HEAD "sonde_scene: 1\nbodies:\n"
#define BALL "- {name: ball, shape: {sphere_mm: 5}, mass_kg: 1}\n"

static const bad_scene BAD[] = {
    {"", SONDE_FORMAT, ":1: the file is empty"},
    {"a: [1, 2\n", SONDE_FORMAT, "not YAML"},
    {"bodies: []\n", SONDE_FORMAT, "sonde_scene is missing"},
    {"sonde_scene: 2\nbodies: []\n", SONDE_VERSION, ":1: sonde_scene: 1 expected, got 2"},
    {"sonde_scene: 1\n", SONDE_FORMAT, "bodies is missing"},
    {"sonde_scene: 1\ngravitation: 3\nbodies: []\n", SONDE_FORMAT, ":2: unknown key 'gravitation'"},
    {"sonde_scene: 1\ntitle: a\ntitle: b\n", SONDE_FORMAT, ":3: key 'title' is given twice"},
    {HEAD "- {name: a, shape: {sphere_mm: -5}, mass_kg: 1}\n", SONDE_ARGUMENT, ":3: sphere_mm"},
    {HEAD "- {name: a, shape: {sphere_mm: 5}, mass_kg: -1}\n", SONDE_ARGUMENT, ":3: mass_kg"},
    {HEAD "- {name: a, shape: {sphere_mm: 5}, mass_kg: heavy}\n", SONDE_FORMAT, "'heavy'"},
    {HEAD "- {name: a, shape: {sphere_mm: 5}}\n", SONDE_FORMAT, ":3: density_kg_m3 is missing"},
    {HEAD "- {name: a, shape: {sphere_mm: 5}, mass_kg: 1, density_kg_m3: 1}\n", SONDE_FORMAT,
     "both given"},
    {HEAD "- {name: a, shape: {sphere_mm: 5, box_mm: [1, 1, 1]}, mass_kg: 1}\n", SONDE_FORMAT,
     "both box_mm and sphere_mm"},
    {HEAD "- {name: a, shape: {box_mm: [1, 1]}, mass_kg: 1}\n", SONDE_FORMAT, "three numbers"},
    {HEAD BALL BALL, SONDE_FORMAT, ":4: two bodies are named 'ball'"},
    {HEAD "- {name: a, shape: {sphere_mm: 5}, mass_kg: 1, material: gold}\n", SONDE_NOT_FOUND,
     ":3: no material 'gold'"},
    {HEAD BALL "contacts: [[ball, wall]]\n", SONDE_NOT_FOUND, ":4: no body 'wall'"},
    {HEAD BALL "contacts: [[ball, ball]]\n", SONDE_ARGUMENT, "does not touch itself"},
    {HEAD "- {name: a, kind: jelly, shape: {sphere_mm: 5}, mass_kg: 1}\n", SONDE_FORMAT,
     "expected one of rigid, springs, lattice, two_layer"},
    {HEAD "- {name: a, motion: driven, shape: {probe: linear}}\n", SONDE_FORMAT, "needs a path"},
    {HEAD "- {name: a, motion: driven, shape: {probe: spoon}, path: [{time_s: 0}]}\n",
     SONDE_NOT_FOUND, ":3: "},
    {HEAD "- {name: a, motion: driven, shape: {probe: linear}, path: [{time_s: 1}, {time_s: 1}]}\n",
     SONDE_ARGUMENT, "time_s must grow"},
    {HEAD "- {name: a, shape: {mesh: {file: nowhere.ply}}, mass_kg: 1}\n", SONDE_IO, "nowhere.ply"},
    {HEAD "- {name: a, kind: lattice, shape: {box_mm: [10, 10, 15]}, density_kg_m3: 1000, "
          "lattice: {cell_mm: 10, youngs_pa: 1e4}}\n",
     SONDE_ARGUMENT, "15 mm is not a whole number of cells of 10 mm"},
    {HEAD "- {name: a, kind: springs, shape: {sphere_mm: 5}, mass_kg: 1}\n", SONDE_FORMAT,
     "springs is missing"},
    {HEAD "- {name: a, kind: springs, shape: {sphere_mm: 5}, mass_kg: 1, "
          "springs: {stiffness_n_m: 1}, held_mm: [[[50, 50, 50], [60, 60, 60]]]}\n",
     SONDE_ARGUMENT, "the box holds no node"},
    {"sonde_scene: 1\nmaterials: [{name: m, friction_static: 0.1, friction_kinetic: 0.2}]\n" BALL,
     SONDE_FORMAT, "not YAML"},
    {"sonde_scene: 1\nmaterials: [{name: m, friction_static: 0.1, friction_kinetic: "
     "0.2}]\nbodies:\n" BALL,
     SONDE_ARGUMENT, ":2: friction_kinetic is 0.2"},
    {"sonde_scene: 1\nstep: {lambda: 1.5}\nbodies:\n" BALL, SONDE_ARGUMENT, ":2: lambda"},
    {"sonde_scene: 1\nstep: {lambda: 1, method: explicit}\nbodies:\n" BALL, SONDE_FORMAT,
     "lambda belongs to the implicit method"},
    {HEAD "- {name: t, kind: two_layer, model: thigh}\n", SONDE_NOT_FOUND, ":3: the bundled thigh"},
    {HEAD BALL "---\n" HEAD BALL, SONDE_FORMAT, ":4: a second document begins, expected 1"},
    {HEAD BALL "...\n{\n", SONDE_FORMAT, ":5: "},
    {"title: [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[", SONDE_FORMAT,
     ":1: expected at most 32 levels of nesting"},
    {HEAD "- {name: a, shape: {sphere_mm: 50, edge_mm: 0.01}, mass_kg: 1}\n", SONDE_ARGUMENT,
     ":3: edge_mm is 0.01, which makes 7854 edges along 78.5398 mm; expected at most 200"},
    {HEAD "- {name: a, shape: {box_mm: [80, 1, 1], edge_mm: 0.1}, mass_kg: 1}\n", SONDE_ARGUMENT,
     ":3: edge_mm is 0.1, which makes 800 edges along 80 mm"},
    {HEAD "- {name: a, shape: {cylinder_mm: {radius: 9, length: 9}, edge_mm: 0.02}, mass_kg: 1}\n",
     SONDE_ARGUMENT, ":3: edge_mm is 0.02"},
    {HEAD "- {name: 'a/b', shape: {sphere_mm: 5}, mass_kg: 1}\n", SONDE_FORMAT, "letters"},
};

static void refuse(const char *text, sonde_status status, const char *part) {
  sonde_scene *scene = NULL;
  sonde_error error = {0};
  sonde_status got = sonde_scene_parse(text, "bad.yaml", NULL, &scene, &error);
  if (got != status || !strstr(error.message, part) || scene)
    fail_msg("%s\ngave %d \"%s\", expected %d with \"%s\"", text, got, error.message, status, part);
  if (!strstr(error.message, "bad.yaml:")) fail_msg("no file and line in \"%s\"", error.message);
}

static void test_bad_scenes(void **unused) {
  (void)unused;
  for (size_t k = 0; k < sizeof BAD / sizeof BAD[0]; ++k)
    refuse(BAD[k].text, BAD[k].status, BAD[k].part);
}

static void put_text(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  fputs(text, file);
  fclose(file);
}

#define TETRAHEDRON "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\n"

static void test_bad_meshes(void **unused) {
  (void)unused;
  static const struct {
    const char *mesh, *part;
  } CASES[] = {
      {TETRAHEDRON "f 1 3 2\nf 1 2 4\nf 2 3 4\n", "open"},
      {TETRAHEDRON "f 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n", "inside out"},
      {TETRAHEDRON "v 5 0 0\nf 1 3 2\nf 1 5 4\nf 5 2 4\nf 2 3 4\nf 1 4 3\nf 1 2 5\n", "no area"},
      // two tetrahedra in one file, one through the other
      {TETRAHEDRON "v 1 1 -5\nv 11 1 -5\nv 1 11 -5\nv 1 1 5\n"
                   "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n",
       "cuts itself"},
  };
  char path[] = "/tmp/sonde_mesh_XXXXXX.obj", text[512];
  int descriptor = mkstemps(path, 4);
  assert_true(descriptor >= 0);
  close(descriptor);
  for (size_t k = 0; k < sizeof CASES / sizeof CASES[0]; ++k) {
    put_text(path, CASES[k].mesh);
    snprintf(text, sizeof text, HEAD "- {name: a, shape: {mesh: {file: %s}}, mass_kg: 1}\n", path);
    refuse(text, SONDE_MESH, CASES[k].part);
    // the same as a soft body that may touch the ball
    snprintf(text, sizeof text,
             HEAD BALL "- {name: a, kind: springs, shape: {mesh: {file: %s}}, mass_kg: 1, "
                       "springs: {stiffness_n_m: 1}}\n",
             path);
    refuse(text, SONDE_MESH, CASES[k].part);
  }
  unlink(path);
}

#define NODES "# two tetrahedra\n5 3 0 0\n1 0 0 0\n2 10 0 0\n3 0 10 0\n4 0 0 10\n5 10 10 10\n"

// A tetrahedron of TetGen: six springs, a quarter of the mass per corner, an outward skin.
static void test_tetrahedra_of_a_file(void **unused) {
  (void)unused;
  char directory[] = "/tmp/sonde_tet_XXXXXX", path[128], text[512];
  assert_non_null(mkdtemp(directory));
  snprintf(path, sizeof path, "%s/a.node", directory);
  char elements[128];
  snprintf(elements, sizeof elements, "%s/a.ele", directory);
  put_text(elements, "2 4 0\n1 1 2 3 4\n2 2 3 4 5\n");
  snprintf(text, sizeof text,
           HEAD "- {name: t, kind: lattice, lattice: {tetrahedra: %s/a, youngs_pa: 1e5}, "
                "density_kg_m3: 1000}\n",
           directory);
  put_text(path, "4 3 0 0\n1 0 0 1e30\n");
  refuse(text, SONDE_FORMAT, "a.node:2: expected three coordinates within 10 km");
  put_text(path, NODES);
  world w = world_of(text);
  sonde_body_info info = sonde_scene_body(w.scene, 0);
  assert_int_equal(info.node_count, 5);
  assert_int_equal(info.spring_count, 9);
  assert_int_equal(info.surface->face_count, 6);
  sonde_mesh_report report;
  assert_int_equal(sonde_mesh_inspect(info.surface, &report, NULL), SONDE_OK);
  assert_true(report.closed && report.outward);
  assert_near(info.mass.mass_kg, report.volume_m3 * 1000, 1e-18);
  world_end(&w);
  put_text(elements, "2 4 0\n1 1 2 3 4\n2 2 3 4 9\n");
  refuse(text, SONDE_FORMAT, "a.ele:3: expected the number of a node");
  unlink(path);
  unlink(elements);
  rmdir(directory);
}

// The examples that ship are read and step without a flag.
static void test_examples(void **unused) {
  (void)unused;
  static const char *const NAMES[] = {"four_kinds", "stack", "incline"};
  for (size_t k = 0; k < sizeof NAMES / sizeof NAMES[0]; ++k) {
    char path[512];
    world w = {0};
    sonde_error error = {0};
    snprintf(path, sizeof path, SONDE_SOURCE_DIR "/data/scenes/%s.yaml", NAMES[k]);
    sonde_status status = sonde_scene_load(path, NULL, &w.scene, &error);
    if (!status) status = sonde_scene_state_create(w.scene, &w.state, &error);
    if (status) print_error("%s\n", error.message);
    assert_int_equal(status, SONDE_OK);
    steps(&w, 20);
    assert_unflagged(&w);
    world_end(&w);
  }
}

// Every allocation of loading and starting may fail.
typedef struct failing {
  size_t left, live;
} failing;

static void *fail_at(size_t bytes, void *user) {
  failing *f = user;
  if (f->left == 0) return NULL;
  --f->left;
  ++f->live;
  return malloc(bytes);
}

static void release(void *pointer, void *user) {
  failing *f = user;
  if (pointer) --f->live;
  free(pointer);
}

static void test_allocations_may_fail(void **unused) {
  (void)unused;
  static const char TEXT[] = HEAD BALL
      "- {name: a, kind: springs, shape: {sphere_mm: 5}, position_mm: [20, 0, 0], "
      "mass_kg: 1, springs: {stiffness_n_m: 1}}\n"
      "- {name: c, kind: lattice, shape: {box_mm: [10, 10, 10]}, position_mm: [0, 40, 0], "
      "density_kg_m3: 1, lattice: {cell_mm: 10, youngs_pa: 1e4}}\n";
  failing f = {0};
  sonde_allocator allocator = {fail_at, release, &f};
  sonde_set_allocator(&allocator);
  bool done = false;
  for (size_t n = 0; n < 2000 && !done; n += ROUNDS(1, 1 + n / 8)) {
    f = (failing){.left = n};
    sonde_scene *scene = NULL;
    sonde_scene_state *state = NULL;
    sonde_error error = {0};
    sonde_status status = sonde_scene_parse(TEXT, "x.yaml", NULL, &scene, &error);
    if (!status) status = sonde_scene_state_create(scene, &state, &error);
    done = status == SONDE_OK;
    if (!done) assert_int_equal(status, SONDE_MEMORY);
    sonde_scene_state_destroy(state);
    sonde_scene_destroy(scene);
    assert_int_equal(f.live, 0);
  }
  assert_true(done);
  sonde_set_allocator(NULL);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_bad_scenes),           cmocka_unit_test(test_bad_meshes),
      cmocka_unit_test(test_tetrahedra_of_a_file), cmocka_unit_test(test_examples),
      cmocka_unit_test(test_allocations_may_fail),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
