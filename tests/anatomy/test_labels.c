// Label volumes of a leg: a generated thigh with the ends of a femur, written as NIfTI in any
// position, resolution and order of axes, comes back with its girths, fat, bone and vessels within
// a voxel; wrong sides, units and holes are refused with the reason.
#include "../sanitized.h"
#include "anatomy/shape.h"
#include "anatomy_test.h"

#include <nifti2_io.h>
#include <unistd.h>

static const char *const VOLUME = "test_labels.nii.gz", *const LIST = "test_labels.txt";
enum { SKIN = 1, FAT, MUSCLE, BONE, VEIN, ARTERY };

typedef struct leg {
  sonde_thigh thigh;
  sonde_thigh_shape *shape;
  sonde_model *model;
  double femur_m;
} leg;

static leg make_leg(uint64_t seed) {
  leg l = {0};
  sonde_thigh unknown = sonde_thigh_unknown();
  sonde_thigh_def def = coarse();
  unknown.second_vein = 0;
  assert_int_equal(sonde_thigh_draw(&unknown, seed, &l.thigh, NULL), SONDE_OK);
  assert_int_equal(sonde_thigh_shape_create(&l.thigh, &l.shape, NULL), SONDE_OK);
  assert_int_equal(sonde_thigh_build(&l.thigh, l.shape, &def, &l.model, NULL), SONDE_OK);
  l.femur_m = l.thigh.length_m / 0.71; // the thigh lies between 9 and 80 % of it
  return l;
}

static void clear_leg(leg *l) {
  sonde_model_destroy(l->model);
  sonde_thigh_shape_destroy(l->shape);
}

static double to_segment(sonde_vec3 p, sonde_vec3 a, sonde_vec3 b, double *t) {
  sonde_vec3 d = v_sub(b, a);
  *t = clamp(v_dot(v_sub(p, a), d) / v_norm2(d), 0, 1);
  return v_distance(p, v_madd(a, *t, d));
}

static bool in_vessel(const sonde_vessel *line, sonde_vec3 p) {
  for (uint32_t k = 0; k + 1 < line->count; ++k) {
    const sonde_vessel_point *a = &line->point[k], *b = a + 1;
    if (p.z < a->centre_m.z - 0.01 || p.z > b->centre_m.z + 0.01) continue;
    double t, d = to_segment(p, a->centre_m, b->centre_m, &t);
    if (d < a->radius_m + t * (b->radius_m - a->radius_m)) return true;
  }
  return false;
}

// Shaft, head with neck, and two condyles behind: a femur as the parts of the frame need it.
static bool in_femur(const leg *l, sonde_vec3 p) {
  const sonde_tube *femur = &l->shape->femur;
  const double top = -0.09 * l->femur_m, knee = 0.91 * l->femur_m;
  const sonde_vec3 at = vec3(femur->x_m[0], femur->y_m[0], 0);
  const sonde_vec3 end =
      vec3(femur->x_m[SONDE_TUBE_ROWS - 1], femur->y_m[SONDE_TUBE_ROWS - 1], knee);
  const sonde_vec3 head = v_add(at, vec3(0.045, 0.008, top + 0.024));
  double t;
  if (p.z > -0.005 && p.z < knee - 0.02 && sonde_tube_outside(femur, p) < 0) return true;
  if (v_distance(p, head) < 0.024) return true;
  if (to_segment(p, head, v_add(at, vec3(0, 0, 0.005)), &t) < 0.013) return true;
  for (int side = -1; side <= 1; side += 2)
    if (v_distance(p, v_add(end, vec3(side * 0.023, -0.02, -0.022))) < 0.022) return true;
  return false;
}

// Label at a point of the thigh's frame; beyond its ends the sections go on as they are.
static uint8_t label_at(const leg *l, sonde_vec3 p) {
  if (p.z < -0.11 * l->femur_m || p.z > 0.95 * l->femur_m) return 0;
  double deep = -sonde_tube_outside(&l->shape->skin, p);
  if (deep < 0) return 0;
  if (in_femur(l, p)) return BONE;
  if (in_vessel(&l->model->vein, p)) return VEIN;
  if (in_vessel(&l->model->artery, p)) return ARTERY;
  if (deep < l->thigh.skin_m) return SKIN;
  return deep < l->thigh.skin_m + sonde_shape_fat(l->shape, p) ? FAT : MUSCLE;
}

// How the leg lies and how it is sampled.
typedef struct scanner {
  bool left;
  sonde_vec3 step_mm[3]; // of each index, to the right, front and head
  double half_mm;        // of the volume, to the side and to the front
  sonde_quat turned;     // the leg in the patient
  double unit;           // numbers of the header per mm
  int unit_code, datatype;
  bool q;    // qform instead of sform
  bool form; // any of them
} scanner;

static scanner usual(void) {
  return (scanner){.step_mm = {{2, 0, 0}, {0, 2, 0}, {0, 0, 3}},
                   .half_mm = 118,
                   .turned = {1, 0, 0, 0},
                   .unit = 1,
                   .unit_code = NIFTI_UNITS_MM,
                   .datatype = DT_UINT8,
                   .form = true};
}

// The volume; `spoil` changes labels by the thigh's coordinates.
static nifti_image *scan_leg(const leg *l, const scanner *s,
                             uint8_t (*spoil)(uint8_t label, sonde_vec3 p)) {
  const double high = 0.5 * 1.07 * l->femur_m * 1e3;
  const sonde_vec3 lean = v_scale(q_rotate(s->turned, vec3(0, 0, 1)), high);
  const sonde_vec3 half = vec3(s->half_mm + fabs(lean.x), s->half_mm + fabs(lean.y), high);
  int64_t dims[8] = {3, 1, 1, 1, 1, 1, 1, 1};
  for (int a = 0; a < 3; ++a) {
    sonde_vec3 d = s->step_mm[a];
    double reach = fabs(d.x) * half.x + fabs(d.y) * half.y + fabs(d.z) * half.z;
    dims[a + 1] = (int64_t)ceil(2 * reach / v_norm2(d));
  }
  nifti_image *image = nifti_make_new_nim(dims, s->datatype, 1);
  assert_non_null(image);
  sonde_vec3 origin = vec3(140, -60, 900); // somewhere in the scanner
  sonde_vec3 first = origin;
  for (int a = 0; a < 3; ++a)
    first = v_madd(first, -0.5 * ((double)dims[a + 1] - 1), s->step_mm[a]);
  for (int64_t at = 0; at < image->nvox; ++at) {
    int64_t index[3] = {at % dims[1], at / dims[1] % dims[2], at / dims[1] / dims[2]};
    sonde_vec3 p = first;
    for (int a = 0; a < 3; ++a) p = v_madd(p, (double)index[a], s->step_mm[a]);
    p = q_rotate(q_conj(s->turned), v_scale(v_sub(p, origin), 1e-3));
    // To the thigh's frame: medial, front, towards the knee.
    p = vec3(s->left ? p.x : -p.x, p.y, 0.42 * l->femur_m - p.z);
    uint8_t label = label_at(l, p);
    if (spoil) label = spoil(label, p);
    if (s->datatype == DT_FLOAT32)
      ((float *)image->data)[at] = label;
    else
      ((uint8_t *)image->data)[at] = label;
  }
  nifti_dmat44 form = {0};
  const sonde_vec3 *column[4] = {&s->step_mm[0], &s->step_mm[1], &s->step_mm[2], &first};
  for (int a = 0; a < 4; ++a) {
    form.m[0][a] = column[a]->x * s->unit;
    form.m[1][a] = column[a]->y * s->unit;
    form.m[2][a] = column[a]->z * s->unit;
  }
  form.m[3][3] = 1;
  image->xyz_units = s->unit_code;
  double pixdim[3];
  for (int a = 0; a < 3; ++a) image->pixdim[a + 1] = pixdim[a] = v_norm(s->step_mm[a]) * s->unit;
  image->dx = pixdim[0], image->dy = pixdim[1], image->dz = pixdim[2];
  if (s->q) {
    nifti_dmat44_to_quatern(form, &image->quatern_b, &image->quatern_c, &image->quatern_d,
                            &image->qoffset_x, &image->qoffset_y, &image->qoffset_z, NULL, NULL,
                            NULL, &image->qfac);
  } else {
    image->sto_xyz = form;
  }
  if (s->form) *(s->q ? &image->qform_code : &image->sform_code) = NIFTI_XFORM_SCANNER_ANAT;
  return image;
}

static void write_leg(const leg *l, const scanner *s,
                      uint8_t (*spoil)(uint8_t label, sonde_vec3 p)) {
  nifti_image *image = scan_leg(l, s, spoil);
  unlink(VOLUME);
  assert_int_equal(nifti_set_filenames(image, VOLUME, 0, 1), 0);
  nifti_image_write(image);
  nifti_image_free(image);
}

// Reads the volume and makes a thigh of it. `names`: text of the file of label names.
static sonde_status read_leg(const char *names, bool left, bool skin_only, sonde_thigh *thigh,
                             sonde_leg_report *report, sonde_leg_labels *labels,
                             sonde_error *error) {
  if (names) {
    FILE *file = fopen(LIST, "w");
    assert_non_null(file);
    fputs(names, file);
    fclose(file);
  }
  sonde_thigh_shape *shape = NULL;
  sonde_thigh unknown = sonde_thigh_unknown();
  unknown.second_vein = 0;
  *error = (sonde_error){0};
  sonde_status status = sonde_leg_labels_load(VOLUME, names ? LIST : NULL, labels, error);
  if (status) return status;
  sonde_leg_scan scan = {.skin = &labels->skin,
                         .femur = labels->femur.face_count ? &labels->femur : NULL,
                         .muscle = labels->muscle.face_count ? &labels->muscle : NULL,
                         .vein = &labels->vein,
                         .artery = &labels->artery,
                         .left = left,
                         .axes = SONDE_AXES_RAS};
  if (skin_only) scan.femur = scan.muscle = scan.vein = scan.artery = NULL;
  assert_int_equal(sonde_thigh_draw(&unknown, 77, thigh, NULL), SONDE_OK);
  status = sonde_thigh_shape_scan(&scan, thigh, &shape, report, error);
  sonde_thigh_def def = coarse();
  sonde_model *model = NULL;
  if (!status) status = sonde_thigh_build(thigh, shape, &def, &model, error);
  sonde_model_destroy(model);
  sonde_thigh_shape_destroy(shape);
  sonde_leg_labels_clear(labels);
  return status;
}

/* ---- there and back ----------------------------------------------------------------------- */

// Girths, length, vessels and cover within a voxel; fat and the femur's diameter are means over
// many.
static void compare(const char *what, const sonde_thigh *got, const sonde_thigh *made,
                    double voxel_m) {
  const struct {
    const char *name;
    double got, made, bound;
  } row[] = {{"girth at the groin", got->girth_proximal_m, made->girth_proximal_m, voxel_m},
             {"girth", got->girth_m, made->girth_m, 0.5 * voxel_m},
             {"girth above the knee", got->girth_distal_m, made->girth_distal_m, voxel_m},
             {"length", got->length_m, made->length_m, voxel_m},
             {"fat inside", got->fat_inner_m, made->fat_inner_m, 0.3 * voxel_m},
             {"fat in front", got->fat_front_m, made->fat_front_m, 0.3 * voxel_m},
             {"fat outside", got->fat_outer_m, made->fat_outer_m, 0.3 * voxel_m},
             {"fat behind", got->fat_back_m, made->fat_back_m, 0.3 * voxel_m},
             {"femur", got->femur_m, made->femur_m, 0.15 * voxel_m},
             // The bone's middles are extended straight from the middle of the thigh to the groin.
             {"femur to the side", got->femur_lateral_m, made->femur_lateral_m, 1.2 * voxel_m},
             {"femur to the front", got->femur_anterior_m, made->femur_anterior_m, 0.5 * voxel_m},
             {"vein", got->vein_m, made->vein_m, 0.5 * voxel_m},
             {"artery", got->artery_m, made->artery_m, 0.5 * voxel_m},
             {"cover of the vein", got->vein_cover_m, made->vein_cover_m, voxel_m},
             {"cover in the canal", got->canal_cover_m, made->canal_cover_m, voxel_m}};
  int wrong = 0;
  for (size_t k = 0; k < SONDE_COUNT_OF(row); ++k) {
    if (fabs(row[k].got - row[k].made) <= row[k].bound) continue;
    print_error("%s: %s is %.2f mm, expected %.2f within %.2f\n", what, row[k].name,
                row[k].got * 1e3, row[k].made * 1e3, row[k].bound * 1e3);
    ++wrong;
  }
  assert_int_equal(wrong, 0);
  assert_near(got->vein_angle_rad, made->vein_angle_rad, 5 * SONDE_PI / 180);
}

static void legs_come_back(void **state) {
  (void)state;
  scanner way[5];
  for (int k = 0; k < 5; ++k) way[k] = usual();
  const char *const NAME[] = {"right", "left, oblique grid", "sagittal, axes flipped", "leg turned",
                              "left, qform, float"};
  const double c = cos(0.35), s = sin(0.35);
  way[1].left = true;
  way[1].step_mm[0] = vec3(1.6 * c, 0, -1.6 * s);
  way[1].step_mm[1] = vec3(0, 1.6, 0);
  way[1].step_mm[2] = vec3(4 * s, 0, 4 * c);
  way[2].step_mm[0] = vec3(0, 0, -1.2);
  way[2].step_mm[1] = vec3(0, 2.5, 0);
  way[2].step_mm[2] = vec3(-3, 0, 0);
  way[3].turned = q_unit((sonde_quat){0.96, 0.1, -0.05, 0.24});
  way[4].left = way[4].q = true;
  way[4].datatype = DT_FLOAT32;
  for (int k = SAMPLES(0, ROUNDS(2, 4)); k < 5; ++k) {
    leg l = make_leg((uint64_t)k + 1);
    write_leg(&l, &way[k], NULL);
    sonde_thigh got;
    sonde_leg_report report;
    sonde_leg_labels labels;
    sonde_error error;
    if (read_leg(NULL, way[k].left, false, &got, &report, &labels, &error))
      fail_msg("%s: %s", NAME[k], error.message);
    double voxel = 0;
    for (int a = 0; a < 3; ++a) voxel = fmax(voxel, 1e-3 * v_norm(way[k].step_mm[a]));
    compare(NAME[k], &got, &l.thigh, voxel);
    clear_leg(&l);
  }
  unlink(VOLUME);
}

/* ---- what is refused, and what is not ----------------------------------------------------- */

static scanner coarse_scanner(void) {
  scanner s = usual();
  s.step_mm[0] = vec3(5, 0, 0), s.step_mm[1] = vec3(0, 5, 0), s.step_mm[2] = vec3(0, 0, 6);
  return s;
}

static void expect(const leg *l, const scanner *s, uint8_t (*spoil)(uint8_t, sonde_vec3),
                   const char *names, bool left, const char *reason) {
  sonde_thigh got;
  sonde_leg_report report;
  sonde_leg_labels labels;
  sonde_error error;
  write_leg(l, s, spoil);
  sonde_status status = read_leg(names, left, false, &got, &report, &labels, &error);
  print_message("%s\n", status ? error.message : "-");
  if (!reason && status) fail_msg("%s", error.message);
  if (reason && (!status || !strstr(error.message, reason)))
    fail_msg("expected \"%s\", found \"%s\"", reason, status ? error.message : "a thigh");
  if (!status) assert_near(got.girth_m, l->thigh.girth_m, 0.004);
}

static void orientation_is_checked(void **state) {
  (void)state;
  leg l = make_leg(1);
  scanner s = coarse_scanner();
  expect(&l, &s, NULL, NULL, false, NULL);
  expect(&l, &s, NULL, NULL, true, "it is a right leg");
  s.left = true;
  expect(&l, &s, NULL, NULL, true, NULL);
  expect(&l, &s, NULL, NULL, false, "it is a left leg, or its coordinates are mirrored");
  s.left = false;
  s.turned = (sonde_quat){0, 0, 0, 1};
  expect(&l, &s, NULL, NULL, false, "(LPS), expected right and front");
  s.turned = (sonde_quat){0, 0, 1, 0};
  expect(&l, &s, NULL, NULL, false, "leg stands on its head");
  s = coarse_scanner();
  s.turned = q_unit((sonde_quat){0.9, 0, 0, 0.4}); // turned out by 48 degrees
  expect(&l, &s, NULL, NULL, false, NULL);
  s = coarse_scanner();
  s.form = false;
  expect(&l, &s, NULL, NULL, false, "sform_code and qform_code are 0");
  clear_leg(&l);
  unlink(VOLUME);
}

static void units_are_checked(void **state) {
  (void)state;
  leg l = make_leg(2);
  const struct {
    double unit;
    int code;
    const char *reason;
  } row[] = {{1, NIFTI_UNITS_MM, NULL},
             {1e-3, NIFTI_UNITS_METER, NULL},
             {1e3, NIFTI_UNITS_MICRON, NULL},
             {1, NIFTI_UNITS_UNKNOWN, NULL},
             {1e-3, NIFTI_UNITS_MM, "seem to be m,"},
             {1e-3, NIFTI_UNITS_UNKNOWN, "unknown and read as mm"},
             {1, NIFTI_UNITS_METER, "seem to be mm,"},
             {1e3, NIFTI_UNITS_MM, "seem to be um,"},
             {1, NIFTI_UNITS_MICRON, "seem to be mm,"},
             {1, 5, "expected m, mm, um"}};
  for (size_t k = 0; k < SONDE_COUNT_OF(row); ++k) {
    scanner s = coarse_scanner();
    s.unit = row[k].unit, s.unit_code = row[k].code;
    expect(&l, &s, NULL, NULL, false, row[k].reason);
  }
  clear_leg(&l);
  unlink(VOLUME);
}

static uint8_t small_hole(uint8_t label, sonde_vec3 p) {
  return v_distance(p, vec3(0.02, 0.03, 0.15)) < 0.015 ? 0 : label;
}
static uint8_t empty_marrow(uint8_t label, sonde_vec3 p) {
  return label == BONE && fabs(p.z - 0.2) > 0.19 ? 0 : label; // both ends of the bone
}
static uint8_t large_hole(uint8_t label, sonde_vec3 p) {
  return label == MUSCLE && p.z > 0.05 && p.z < 0.2 ? 0 : label;
}
static uint8_t broken(uint8_t label, sonde_vec3 p) { return p.z > 0.14 && p.z < 0.16 ? 0 : label; }
static uint8_t crumb(uint8_t label, sonde_vec3 p) {
  return v_distance(p, vec3(0.105, 0.105, 0.2)) < 0.012 ? FAT : label;
}
static uint8_t other_number(uint8_t label, sonde_vec3 p) {
  return label == MUSCLE && p.y > 0 ? 9 : label;
}

static void holes_are_filled_or_refused(void **state) {
  (void)state;
  leg l = make_leg(3);
  scanner s = coarse_scanner();
  expect(&l, &s, small_hole, NULL, false, NULL);
  expect(&l, &s, crumb, NULL, false, NULL);
  expect(&l, &s, empty_marrow, NULL, false, "femur"); // a shaft without its ends
  expect(&l, &s, large_hole, NULL, false, "has no label");
  expect(&l, &s, broken, NULL, false, "two bodies");
  s.half_mm = 60;
  expect(&l, &s, NULL, NULL, false, "miss the skin");
  clear_leg(&l);
  unlink(VOLUME);
}

static void numbers_have_names(void **state) {
  (void)state;
  leg l = make_leg(4);
  scanner s = coarse_scanner();
  expect(&l, &s, other_number, NULL, false, "label 9 has no name");
  static const char *const SNAP = "# label file\n0 0 0 0 0 0 0 \"Clear Label\"\n"
                                  "1 255 0 0 1 1 1 \"Skin\"\n2 0 255 0 1 1 1 \"Subcut. fat\"\n"
                                  "3 0 0 255 1 1 1 \"muscle, back\"\n4 9 9 9 1 1 1 \"FEMUR\"\n"
                                  "5 9 9 9 1 1 1 \"femoral vein\"\n6 9 9 9 1 1 1 \"Artery\"\n"
                                  "\n9 1 2 3 1 1 1 \"rectus femoris muscle\"\n";
  expect(&l, &s, other_number, SNAP, false, NULL);
  expect(&l, &s, NULL, "1 skin\n7 spleen\n", false, ":2: label 7 names no tissue");
  expect(&l, &s, NULL, "1 fat or muscle\n", false, "several tissues");
  expect(&l, &s, NULL, "skin 1\n", false, ":1: expected a number");
  expect(&l, &s, NULL, "1 skin\n2 fat\n", false, "label 3 has no name");
  clear_leg(&l);
  unlink(VOLUME);
  unlink(LIST);
}

static void other_files_are_refused(void **state) {
  (void)state;
  leg l = make_leg(4);
  scanner s = coarse_scanner();
  sonde_leg_labels labels;
  sonde_error error = {0};
  // Grey values are no labels.
  s.datatype = DT_FLOAT32;
  nifti_image *image = scan_leg(&l, &s, NULL);
  ((float *)image->data)[1234] = 0.5F;
  assert_int_equal(nifti_set_filenames(image, VOLUME, 0, 1), 0);
  nifti_image_write(image);
  nifti_image_free(image);
  assert_int_equal(sonde_leg_labels_load(VOLUME, NULL, &labels, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "is 0.5, expected a label"));
  // A file that ends early, and one of another kind.
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(VOLUME, &bytes, &count, NULL), SONDE_OK);
  FILE *file = fopen(VOLUME, "wb");
  fwrite(bytes, 1, count / 2, file);
  fclose(file);
  assert_int_equal(sonde_leg_labels_load(VOLUME, NULL, &labels, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "cannot be read"));
  file = fopen(VOLUME, "wb");
  fputs("no volume", file);
  fclose(file);
  assert_int_equal(sonde_leg_labels_load(VOLUME, NULL, &labels, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "no NIfTI header"));
  unlink(VOLUME);
  assert_int_equal(sonde_leg_labels_load(VOLUME, NULL, &labels, &error), SONDE_IO);
  assert_int_equal(sonde_leg_labels_load("leg.stl", NULL, &labels, &error), SONDE_ARGUMENT);
  sonde_free(bytes);
  clear_leg(&l);
}

static uint8_t from_the_groin(uint8_t label, sonde_vec3 p) { return p.z < 0 ? 0 : label; }

// Skin alone: its upper end is the groin; the sides follow from the axes, the bone from the
// parameters.
static void skin_alone_is_enough(void **state) {
  (void)state;
  for (int k = ROUNDS(0, 1); k < 2; ++k) {
    leg l = make_leg(5);
    scanner s = usual();
    s.left = k == 1;
    s.turned = q_unit((sonde_quat){0.99, 0.06, 0.05, 0});
    write_leg(&l, &s, from_the_groin);
    sonde_leg_labels labels;
    sonde_leg_report report;
    sonde_thigh unknown = sonde_thigh_unknown(), drawn, got;
    sonde_thigh_shape *shape = NULL;
    sonde_error error = {0};
    if (sonde_leg_labels_load(VOLUME, NULL, &labels, &error)) fail_msg("%s", error.message);
    assert_int_equal(sonde_thigh_draw(&unknown, 5, &drawn, NULL), SONDE_OK);
    got = drawn;
    sonde_leg_scan scan = {.skin = &labels.skin, .left = k == 1, .length_m = l.thigh.length_m};
    assert_int_equal(sonde_thigh_shape_scan(&scan, &got, &shape, &report, &error), SONDE_ARGUMENT);
    scan.axes = SONDE_AXES_RAS;
    if (sonde_thigh_shape_scan(&scan, &got, &shape, &report, &error)) fail_msg("%s", error.message);
    assert_true(report.femur_length_m == 0 && !report.vein_found);
    // The thigh begins where its first section is whole, 5 mm and the end's slant below the groin;
    // from there on it is the leg.
    const sonde_tube *skin = &l.shape->skin;
    double below = 0, length = l.thigh.length_m;
    while (sonde_tube_girth(skin, below) > got.girth_proximal_m) below += 0.0005;
    assert_true(below > 0.004 && below < 0.02);
    assert_near(got.girth_m, sonde_tube_girth(skin, below + 0.5 * length), 0.0015);
    assert_near(got.girth_distal_m, l.thigh.girth_distal_m, 0.001); // goes on as it ends
    assert_true(got.femur_m == drawn.femur_m && got.vein_m == drawn.vein_m);
    // The same leg by the same parameters has its bone where the generated leg has it.
    const sonde_tube *a = &shape->femur, *b = &l.shape->femur;
    for (uint32_t j = 0; j < SONDE_TUBE_ROWS; j += 20) {
      double got_x = a->x_m[j] - shape->skin.x_m[j], made_x = b->x_m[j] - skin->x_m[j];
      assert_near(got_x, made_x, 0.001);
      assert_near(a->y_m[j] - shape->skin.y_m[j], b->y_m[j] - skin->y_m[j], 0.001);
      // The way of the skin's middle against the bone: the same slope of the frame.
      assert_near(shape->skin.x_m[j], skin->x_m[j], 0.0015);
    }
    // Longer than what there is.
    scan.length_m = 0.5;
    sonde_thigh_shape *none = NULL;
    assert_int_equal(sonde_thigh_shape_scan(&scan, &got, &none, &report, &error), SONDE_MESH);
    assert_non_null(strstr(error.message, "expected the thigh's length of 500"));
    sonde_thigh_shape_destroy(shape);
    sonde_leg_labels_clear(&labels);
    clear_leg(&l);
  }
  unlink(VOLUME);
}

/* ---- a real leg --------------------------------------------------------------------------- */

static sonde_surface_index *real_surface(const char *name, sonde_mesh *mesh) {
  char path[512];
  sonde_surface_index *index = NULL;
  snprintf(path, sizeof path, "%s/../shared/data/right_leg_surfaces/%s", SONDE_SOURCE_DIR, name);
  if (sonde_mesh_load(path, 1e-3, mesh, NULL)) {
    print_message("%s is absent: no real leg to label\n", path);
    skip();
  }
  assert_int_equal(sonde_surface_index_create(mesh, &index, NULL), SONDE_OK);
  return index;
}

// The surfaces of a real leg, as a volume of labels and as they are, make the same thigh.
static void a_real_leg_survives_its_labels(void **state) {
  (void)state;
  if (ROUNDS(0, 1)) return; // the same code as above, on larger volumes
  sonde_mesh mesh[3] = {{0}};
  static const char *const NAME[] = {"FMA24474.stl", "right_leg_muscle_envelope.stl",
                                     "right_leg_skin_closed.stl"};
  static const uint8_t LABEL[] = {BONE, MUSCLE, FAT};
  sonde_surface_index *index[3];
  for (int k = 0; k < 3; ++k) index[k] = real_surface(NAME[k], &mesh[k]);
  const sonde_vec3 low = vec3(-0.22, -0.17, 0.36), step = vec3(0.004, 0.004, 0.005);
  int64_t dims[8] = {3, 60, 60, 106, 1, 1, 1, 1};
  nifti_image *image = nifti_make_new_nim(dims, DT_UINT8, 1);
  assert_non_null(image);
  for (int64_t at = 0; at < image->nvox; ++at) {
    sonde_vec3 p = vec3(low.x + step.x * (double)(at % dims[1]),
                        low.y + step.y * (double)(at / dims[1] % dims[2]),
                        low.z + step.z * (double)(at / dims[1] / dims[2]));
    int k = 0;
    while (k < 3 && !sonde_surface_inside(index[k], p)) ++k;
    if (k == 3) continue;
    ((uint8_t *)image->data)[at] = LABEL[k];
  }
  // The surfaces run to the left and back.
  image->sto_xyz = (nifti_dmat44){{{-1e3 * step.x, 0, 0, -1e3 * low.x},
                                   {0, -1e3 * step.y, 0, -1e3 * low.y},
                                   {0, 0, 1e3 * step.z, 1e3 * low.z},
                                   {0, 0, 0, 1}}};
  image->sform_code = NIFTI_XFORM_SCANNER_ANAT;
  image->xyz_units = NIFTI_UNITS_MM;
  assert_int_equal(nifti_set_filenames(image, VOLUME, 0, 1), 0);
  nifti_image_write(image);
  nifti_image_free(image);

  sonde_thigh unknown = sonde_thigh_unknown(), got[2];
  sonde_leg_report report;
  sonde_leg_labels labels;
  sonde_error error = {0};
  if (sonde_leg_labels_load(VOLUME, NULL, &labels, &error)) fail_msg("%s", error.message);
  const sonde_leg_scan scan[] = {
      {.skin = &labels.skin,
       .femur = &labels.femur,
       .muscle = &labels.muscle,
       .axes = SONDE_AXES_RAS},
      {.skin = &mesh[2], .femur = &mesh[0], .muscle = &mesh[1], .axes = SONDE_AXES_LPS}};
  for (int k = 0; k < 2; ++k) {
    sonde_thigh_shape *shape = NULL;
    assert_int_equal(sonde_thigh_draw(&unknown, 1, &got[k], NULL), SONDE_OK);
    if (sonde_thigh_shape_scan(&scan[k], &got[k], &shape, &report, &error))
      fail_msg("%s", error.message);
    sonde_thigh_shape_destroy(shape);
  }
  const double voxel = 0.005;
  assert_near(got[0].girth_m, got[1].girth_m, 0.5 * voxel);
  // These surfaces end less than two voxels above the first section, so that labels round its edge.
  assert_near(got[0].girth_proximal_m, got[1].girth_proximal_m, 5 * voxel);
  assert_near(got[0].girth_distal_m, got[1].girth_distal_m, voxel);
  assert_near(got[0].length_m, got[1].length_m, voxel);
  assert_near(got[0].femur_m, got[1].femur_m, 0.15 * voxel);
  assert_near(got[0].fat_front_m, got[1].fat_front_m, 0.5 * voxel);
  assert_near(got[0].fat_inner_m, got[1].fat_inner_m, 0.5 * voxel);
  assert_near(got[0].fat_outer_m, got[1].fat_outer_m, 0.5 * voxel);
  assert_near(got[0].fat_back_m, got[1].fat_back_m, 0.5 * voxel);
  print_message("girth %.1f, %.1f mm\n", got[0].girth_m * 1e3, got[1].girth_m * 1e3);
  for (int k = 0; k < 3; ++k) {
    sonde_surface_index_destroy(index[k]);
    sonde_mesh_clear(&mesh[k]);
  }
  sonde_leg_labels_clear(&labels);
  unlink(VOLUME);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(legs_come_back),       cmocka_unit_test(orientation_is_checked),
      cmocka_unit_test(units_are_checked),    cmocka_unit_test(holes_are_filled_or_refused),
      cmocka_unit_test(numbers_have_names),   cmocka_unit_test(other_files_are_refused),
      cmocka_unit_test(skin_alone_is_enough), cmocka_unit_test(a_real_leg_survives_its_labels),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
