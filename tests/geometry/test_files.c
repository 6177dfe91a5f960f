// Mesh files: what is written is read back, all dialects give the same mesh, damage is named.
#include "geometry/shapes.h"

#include <locale.h>

static char folder[] = "/tmp/sonde_files_XXXXXX";

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : 1;
}

static int remove_folder(void **state) {
  (void)state;
  static const char *const names[] = {"a.ply", "a.obj", "a.stl", "a.PLY", "a.txt"};
  char path[64];
  for (size_t k = 0; k < SONDE_COUNT_OF(names); ++k) {
    snprintf(path, sizeof path, "%s/%s", folder, names[k]);
    unlink(path);
  }
  return rmdir(folder);
}

static const char *file_path(const char *name) {
  static char path[64];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

static void put_bytes(const char *name, const void *bytes, size_t count) {
  FILE *file = fopen(file_path(name), "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, count, file), count);
  fclose(file);
}

// Loads the text as a file of this name and expects failure with both pieces in the message.
static void expect_failure(const char *name, const void *bytes, size_t count, sonde_status status,
                           const char *where, const char *what) {
  put_bytes(name, bytes, count);
  sonde_mesh mesh;
  sonde_error error = {0};
  assert_int_equal(sonde_mesh_load(file_path(name), 1, &mesh, &error), status);
  assert_int_equal(error.status, status);
  assert_null(mesh.vertices);
  assert_non_null(strstr(error.message, name));
  if (!strstr(error.message, where) || !strstr(error.message, what))
    fail_msg("\"%s\" does not say \"%s\" and \"%s\"", error.message, where, what);
}

static void expect_text_failure(const char *name, const char *text, const char *where,
                                const char *what) {
  expect_failure(name, text, strlen(text), SONDE_FORMAT, where, what);
}

static void assert_same(const sonde_mesh *a, const sonde_mesh *b, double tolerance) {
  assert_int_equal(a->vertex_count, b->vertex_count);
  assert_int_equal(a->face_count, b->face_count);
  assert_memory_equal(a->faces, b->faces, a->face_count * sizeof *a->faces);
  for (uint32_t v = 0; v < a->vertex_count; ++v)
    assert_near(v_distance(a->vertices[v], b->vertices[v]), 0, tolerance);
}

static void test_round_trip(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(7, 0.0123), back;
  shape_move(&ball, (sonde_pose){{0.1, -0.2, 0.3}, {1, 0, 0, 0}});
  static const char *const names[] = {"a.ply", "a.obj", "a.PLY"};
  static const double units[] = {1, 1e-3};
  for (int k = 0; k < 3; ++k)
    for (int u = 0; u < 2; ++u) {
      assert_ok(sonde_mesh_save(file_path(names[k]), units[u], &ball, &shape_error));
      assert_ok(sonde_mesh_load(file_path(names[k]), units[u], &back, &shape_error));
      assert_same(&ball, &back, u ? 1e-16 : 0);
      sonde_mesh_clear(&back);
    }
  // STL keeps single precision and no vertex list: welding must close the surface again.
  assert_ok(sonde_mesh_save(file_path("a.stl"), 1e-3, &ball, &shape_error));
  assert_ok(sonde_mesh_load(file_path("a.stl"), 1e-3, &back, &shape_error));
  sonde_mesh_report before = shape_report(&ball), after = shape_report(&back);
  assert_int_equal(back.vertex_count, ball.vertex_count);
  assert_int_equal(back.face_count, ball.face_count);
  assert_true(after.closed && after.outward);
  assert_near(after.volume_m3, before.volume_m3, 1e-4 * before.volume_m3);
  sonde_mesh_clear(&back);
  sonde_mesh_clear(&ball);
}

static void test_foreign_locale(void **state) {
  (void)state;
  static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"};
  bool set = false;
  for (int k = 0; k < 3 && !set; ++k) set = setlocale(LC_ALL, names[k]) != NULL;
  sonde_mesh box = shape_box(0.5, 0.25, 0.125), back;
  assert_ok(sonde_mesh_save(file_path("a.ply"), 1, &box, &shape_error));
  assert_ok(sonde_mesh_load(file_path("a.ply"), 1, &back, &shape_error));
  setlocale(LC_ALL, "C");
  assert_same(&box, &back, 0);
  sonde_mesh_clear(&back);
  sonde_mesh_clear(&box);
  if (!set) print_message("no comma locale is installed: checked in the C locale only\n");
}

// ---- dialects of PLY ----------------------------------------------------------------------

typedef struct bytes {
  unsigned char at[1024];
  size_t count;
} bytes;

static void put_text(bytes *b, const char *text) {
  memcpy(b->at + b->count, text, strlen(text));
  b->count += strlen(text);
}

static void put_value(bytes *b, const void *value, size_t size, bool big) {
  const unsigned char *from = value; // the tests run on little-endian machines
  for (size_t k = 0; k < size; ++k) b->at[b->count++] = from[big ? size - 1 - k : k];
}

// A square pyramid with unusual types, order and properties; the base is one quadrilateral.
static bytes pyramid(bool big) {
  bytes b = {.count = 0};
  put_text(&b, "ply\r\nformat ");
  put_text(&b, big ? "binary_big_endian" : "binary_little_endian");
  put_text(&b, " 1.0\r\ncomment vertices 5\r\nobj_info x\r\nelement material 1\r\n"
               "property list uint8 float32 gloss\r\nelement vertex 5\r\nproperty uchar red\r\n"
               "property float64 z\r\nproperty float x\r\nproperty short y\r\n"
               "property list ushort int8 tags\r\nelement face 5\r\nproperty int32 group\r\n"
               "property list uint uint16 vertex_index\r\nend_header\r\n");
  float gloss[2] = {0.5f, 0.25f};
  unsigned char two = 2, red = 200;
  put_value(&b, &two, 1, big);
  put_value(&b, &gloss[0], 4, big);
  put_value(&b, &gloss[1], 4, big);
  static const double points[5][3] = {{-1, -2, 0}, {1, -2, 0}, {1, 2, 0}, {-1, 2, 0}, {0, 0, 3}};
  for (int v = 0; v < 5; ++v) {
    float x = (float)points[v][0];
    short y = (short)points[v][1];
    unsigned short tags = (unsigned short)(v % 3);
    put_value(&b, &red, 1, big);
    put_value(&b, &points[v][2], 8, big);
    put_value(&b, &x, 4, big);
    put_value(&b, &y, 2, big);
    put_value(&b, &tags, 2, big);
    for (int k = 0; k < tags; ++k) put_value(&b, &red, 1, big);
  }
  static const uint16_t faces[5][4] = {
      {0, 3, 2, 1}, {0, 1, 4, 9}, {1, 2, 4, 9}, {2, 3, 4, 9}, {3, 0, 4, 9}};
  for (int f = 0; f < 5; ++f) {
    int32_t group = -f;
    uint32_t length = f ? 3 : 4;
    put_value(&b, &group, 4, big);
    put_value(&b, &length, 4, big);
    for (uint32_t k = 0; k < length; ++k) put_value(&b, &faces[f][k], 2, big);
  }
  return b;
}

static const char pyramid_ascii[] =
    "ply\nformat ascii 1.0\nelement vertex 5\nproperty float y\nproperty float x\n"
    "property int q\nproperty double z\nelement face 5\nproperty list uchar int vertex_indices\n"
    "property uchar flag\nend_header\n-2 -1 7 0\n-2 1 7 0\n2 1 7 0\n\n2 -1 7 0.0e0\n  0 0 7 +3.0 \n"
    "4 0 3 2 1 9\n3 0 1 4 9\n3 1 2 4 9\n3 2 3 4 9\n3 3 0 4 9";
static const char pyramid_obj[] =
    "# pyramid\nmtllib a.mtl\no base\nv -1 -2 0 1.0\nv 1 -2 0\nvt 0 0\nvn 0 0 1\nv 1 2 0\n"
    "v -1 2 0 0.1 0.2 0.3\nf -4 -1 -2 -3\nf 1/1 2/1 5/1\nf 2//1 3//1 5//1\ns off\n"
    "f 3/1/1 4/1/1 5/1/1\nf 4 1 5\nv 0 0 3\n";

static void check_pyramid(const char *name) {
  sonde_mesh mesh;
  assert_ok(sonde_mesh_load(file_path(name), 2, &mesh, &shape_error));
  sonde_mesh_report report = shape_report(&mesh);
  assert_int_equal(mesh.vertex_count, 5);
  assert_int_equal(mesh.face_count, 6);
  assert_true(report.closed && report.outward);
  assert_near(report.volume_m3, 8 * 2 * 4 * 3 / 3.0, 1e-12); // all lengths doubled
  assert_near(mesh.vertices[2].x, 2, 0);
  assert_near(mesh.vertices[2].y, 4, 0);
  assert_near(mesh.vertices[4].z, 6, 0);
  sonde_mesh_clear(&mesh);
}

static void test_dialects(void **state) {
  (void)state;
  for (int big = 0; big < 2; ++big) {
    bytes b = pyramid(big);
    put_bytes("a.ply", b.at, b.count);
    check_pyramid("a.ply");
  }
  put_bytes("a.ply", pyramid_ascii, strlen(pyramid_ascii));
  check_pyramid("a.ply");
  put_bytes("a.obj", pyramid_obj, strlen(pyramid_obj));
  check_pyramid("a.obj");
}

static void test_stl_ascii(void **state) {
  (void)state;
  static const char text[] =
      "solid facet of a name\n"
      "facet normal 0 0 -1\n outer loop\n  vertex 0 0 0\n  vertex 0 1 0\n  vertex 1 0 -0\n"
      " endloop\nendfacet\n"
      "facet normal 0 -1 0\nouter loop\nvertex 0 -0.0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\n"
      "endfacet\n"
      "facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\n"
      "endfacet\n"
      "facet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1e0\nendloop\n"
      "endfacet\n"
      "facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\n"
      "endfacet\nendsolid facet of a name\n";
  put_bytes("a.stl", text, strlen(text));
  sonde_mesh mesh;
  assert_ok(sonde_mesh_load(file_path("a.stl"), 1, &mesh, &shape_error));
  assert_int_equal(mesh.vertex_count, 4);
  assert_int_equal(mesh.face_count, 4); // the facet with two equal corners is dropped
  sonde_mesh_report report = shape_report(&mesh);
  assert_true(report.closed && report.outward);
  assert_near(report.volume_m3, 1 / 6.0, 1e-15);
  sonde_mesh_clear(&mesh);
  expect_text_failure("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1\n",
                      ":5:", "the end of the line");
  expect_text_failure("a.stl", "solid a\nfacet normal 0 0 1\nouter lop\n", ":3:", "outer loop");
  expect_text_failure("a.stl", "solid a\n", ":2:", "endsolid");
}

// Symmetric bodies come with zeros of both signs; they are one coordinate.
static void test_stl_zeros(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(8, 1), back;
  FILE *file = fopen(file_path("a.stl"), "w");
  assert_non_null(file);
  fprintf(file, "solid zeros\n");
  for (uint32_t f = 0; f < ball.face_count; ++f) {
    fprintf(file, "facet normal 0 0 0\nouter loop\n");
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 p = ball.vertices[ball.faces[f][k]];
      double x[3] = {p.x, p.y, p.z};
      fprintf(file, "vertex");
      for (int c = 0; c < 3; ++c) fprintf(file, " %.17g", x[c] == 0 && f % 2 ? -0.0 : x[c]);
      fprintf(file, "\n");
    }
    fprintf(file, "endloop\nendfacet\n");
  }
  fprintf(file, "endsolid\n");
  fclose(file);
  assert_ok(sonde_mesh_load(file_path("a.stl"), 1, &back, &shape_error));
  assert_int_equal(back.vertex_count, ball.vertex_count);
  assert_true(shape_report(&back).outward);
  sonde_mesh_clear(&back);
  sonde_mesh_clear(&ball);
}

// ---- damage -------------------------------------------------------------------------------

#define HEAD                                                                                       \
  "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "   \
  "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"

static void test_damaged_text(void **state) {
  (void)state;
  static const char *const cases[][4] = {
      {"a.ply", HEAD "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", ":13:", "from 0 to 2"},
      {"a.ply", HEAD "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", ":13:", "from 0 to 2"},
      {"a.ply", HEAD "0 0 0\n1 0 0\n0 1 0\n3 0 1 1.5\n", ":13:", "from 0 to 2"},
      {"a.ply", HEAD "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", ":11:", "\"nan\""},
      {"a.ply", HEAD "0 0 0\n1 1e999 0\n0 1 0\n3 0 1 2\n", ":11:", "finite number for y"},
      {"a.ply", HEAD "0 0 0\n1 0,5 0\n0 1 0\n3 0 1 2\n", ":11:", "\"0,5\""},
      {"a.ply", HEAD "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", ":11:", "vertex 1 of 3"},
      {"a.ply", HEAD "0 0 0\n1 0\n0 1 0\n3 0 1 2\n", ":11:", "the end of the line"},
      {"a.ply", HEAD "0 0 0\n1 0 0 5\n0 1 0\n3 0 1 2\n", ":11:", "the end of the line of vertex"},
      {"a.ply", HEAD "0 0 0\n1 0 0\n0 1 0\n", ":13:", "face 0 of 1"},
      {"a.ply", HEAD "0 0 0\n1 0 0\n0 1 0\n3 0 1", ":13:", "the end of the file"},
      {"a.ply", HEAD "0 0 0\n1 0 0\n0 1 0\n2 0 1\n", ":13:", "at least 3"},
      {"a.ply", HEAD "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n", ":14", "the end of the file"},
      {"a.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", ":4:", "end_header"},
      {"a.ply", "ply\nformat binary 1.0\n", ":2:", "\"binary\""},
      {"a.ply", "ply\nelement vertex -3\n", ":2:", "count"},
      {"a.ply", "ply\nproperty float x\n", ":2:", "element"},
      {"a.ply", "ply\nelement vertex 3\nproperty real x\n", ":3:", "\"real\""},
      {"a.ply", "ply\nelement vertex 3\nproperty float x\nend_header\n", ":4:", "x, y, z"},
      {"a.ply", "solid a\n", ":1:", "\"ply\""},
      {"a.ply", "", ":1:", "\"ply\""},
      {"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", ":4:", "from 1 to 3"},
      {"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", ":4:", "from 1 to 3"},
      {"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", ":4:", "from 1 to 3"},
      {"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2/ 3\n", ":4:", "\"2/\""},
      {"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", ":4:", "3 corners"},
      {"a.obj", "v 0 0 0\nv 1 inf 0\nv 0 1 0\nf 1 2 3\n", ":2:", "y of vertex 2"},
      {"a.obj", "v 0 0\n", ":1:", "the end of the line"},
      {"a.obj", "v 0 0 0\n", "a.obj", "at least one face"},
  };
  for (size_t k = 0; k < SONDE_COUNT_OF(cases); ++k)
    expect_text_failure(cases[k][0], cases[k][1], cases[k][2], cases[k][3]);
}

// Every cut of a binary file is refused; the message names a byte.
static void test_truncated_binary(void **state) {
  (void)state;
  bytes b = pyramid(false);
  const char *body = strstr((const char *)b.at, "end_header");
  size_t head = (size_t)(body - (const char *)b.at) + 12;
  for (size_t cut = 0; cut < b.count; ++cut)
    expect_failure("a.ply", b.at, cut, SONDE_FORMAT, cut > head ? "byte " : "a.ply:", "expected");
  bytes longer = b;
  longer.at[longer.count++] = 'x';
  expect_failure("a.ply", longer.at, longer.count, SONDE_FORMAT, "byte ", "1 more bytes");
  sonde_mesh box = shape_box(1, 1, 1);
  assert_ok(sonde_mesh_save(file_path("a.stl"), 1, &box, &shape_error));
  char *whole = NULL;
  size_t count = 0;
  assert_ok(sonde_file_load(file_path("a.stl"), &whole, &count, &shape_error));
  expect_failure("a.stl", whole, count - 1, SONDE_FORMAT, "byte 80", "684 bytes");
  float bad = NAN;
  memcpy(whole + 84 + 12, &bad, sizeof bad);
  expect_failure("a.stl", whole, count, SONDE_FORMAT, "byte 96", "finite");
  sonde_free(whole);
  sonde_mesh_clear(&box);
}

// Flipping any byte never crashes and never yields a mesh with bad indices.
static void test_flipped_bytes(void **state) {
  (void)state;
  uint64_t seed = 4;
  bytes plain[3] = {pyramid(false), {.count = 0}, {.count = 0}};
  static const char *const names[] = {"a.ply", "a.ply", "a.obj"};
  put_text(&plain[1], pyramid_ascii);
  put_text(&plain[2], pyramid_obj);
  for (int trial = 0; trial < 1500; ++trial) {
    bytes b = plain[trial % 3];
    for (int k = 0; k < 2; ++k)
      b.at[(size_t)shape_uniform(&seed, 0, (double)b.count)] ^=
          (unsigned char)(1 << (int)shape_uniform(&seed, 0, 8));
    put_bytes(names[trial % 3], b.at, b.count);
    sonde_mesh mesh;
    sonde_error error = {0};
    sonde_mesh_report report;
    if (sonde_mesh_load(file_path(names[trial % 3]), 1, &mesh, &error))
      assert_true(strlen(error.message) > 10);
    else
      assert_ok(sonde_mesh_inspect(&mesh, &report, &shape_error));
    sonde_mesh_clear(&mesh);
  }
}

static void test_bad_arguments(void **state) {
  (void)state;
  sonde_mesh mesh, box = shape_box(1, 1, 1);
  sonde_error error;
  assert_int_equal(sonde_mesh_load("/no/such.ply", 1, &mesh, &error), SONDE_IO);
  assert_non_null(strstr(error.message, "/no/such.ply"));
  assert_int_equal(sonde_mesh_load("a.txt", 1, &mesh, &error), SONDE_ARGUMENT);
  assert_int_equal(sonde_mesh_load("a.ply", 0, &mesh, &error), SONDE_ARGUMENT);
  assert_int_equal(sonde_mesh_save("/no/such.ply", 1, &box, &error), SONDE_IO);
  assert_int_equal(sonde_mesh_save("a.vtk", 1, &box, NULL), SONDE_ARGUMENT);
  sonde_mesh_clear(&box);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_round_trip),       cmocka_unit_test(test_foreign_locale),
      cmocka_unit_test(test_dialects),         cmocka_unit_test(test_stl_ascii),
      cmocka_unit_test(test_stl_zeros),        cmocka_unit_test(test_damaged_text),
      cmocka_unit_test(test_truncated_binary), cmocka_unit_test(test_flipped_bytes),
      cmocka_unit_test(test_bad_arguments),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
