// Surfaces: closed, one piece, no handle; bones inside the fascia, fascia inside the skin; girths
// of the body; the order of tissues; a left limb is the mirror of a right one.
#include "limb_test.h"

#include "limb/bones.h"

enum { MOST = 24, WHOLE = 6 };
#define FAMILY (uint32_t) SAMPLES(MOST, 12)
static sonde_limb *family[MOST]; // right limbs, bones and surfaces alone
static sonde_limb *whole[WHOLE]; // the first of them with vessels and muscles

static int make_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    sonde_limb *limb = family[k] = SONDE_NEW(sonde_limb, 1);
    sonde_error error = {0};
    limb->body = body_of_family(k, SONDE_LIMB_RIGHT);
    limb->scale = limb->body.thigh_length_m / 0.430;
    if (limb_bones_make(limb, &error) || limb_surface_make(limb, &error))
      fail_msg("member %u: %s", k, error.message);
    if (k < WHOLE) whole[k] = limb_of_family(k, SONDE_LIMB_RIGHT);
  }
  return 0;
}
static int destroy_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) sonde_limb_destroy(family[k]);
  for (uint32_t k = 0; k < WHOLE; ++k) sonde_limb_destroy(whole[k]);
  return 0;
}

// Number of pieces of a mesh by joining the corners of its faces.
static uint32_t pieces_of(const sonde_mesh *mesh) {
  uint32_t *root = SONDE_NEW(uint32_t, mesh->vertex_count), pieces = mesh->vertex_count;
  for (uint32_t i = 0; i < mesh->vertex_count; ++i) root[i] = i;
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 1; k < 3; ++k) {
      uint32_t a = mesh->faces[f][0], b = mesh->faces[f][k];
      while (root[a] != a) a = root[a] = root[root[a]];
      while (root[b] != b) b = root[b] = root[root[b]];
      if (a != b) root[b] = a, --pieces;
    }
  sonde_free(root);
  return pieces;
}

static void is_a_ball(const sonde_mesh *mesh, const char *what, uint32_t member) {
  sonde_mesh_report report;
  assert_int_equal(sonde_mesh_inspect(mesh, &report, NULL), SONDE_OK);
  long euler = (long)mesh->vertex_count - report.edge_count + mesh->face_count;
  uint32_t pieces = pieces_of(mesh);
  if (!report.closed || !report.outward || report.duplicate_or_degenerate_faces || euler != 2 ||
      pieces != 1)
    fail_msg("%s of member %u: closed %d, outward %d, Euler number %ld, pieces %u", what, member,
             report.closed, report.outward, euler, pieces);
}

static void skins_are_closed_without_handles(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    sonde_limb *limb = family[k];
    sonde_mesh skin;
    assert_int_equal(sonde_limb_skin(limb, 0.006, &skin, NULL), SONDE_OK);
    is_a_ball(&skin, "skin", k);
    sonde_mesh_clear(&skin);
  }
}

static void bones_are_closed_without_handles_inside_the_fascia(void **state) {
  (void)state;
  static const char *const NAMES[] = {"pelvis", "femur", "patella", "tibia", "fibula"};
  for (uint32_t k = 0; k < FAMILY; k += 4) {
    sonde_limb *limb = family[k];
    for (int bone = 0; bone < SONDE_LIMB_BONES; ++bone) {
      sonde_mesh mesh;
      assert_int_equal(sonde_limb_bone_mesh(limb, (sonde_limb_bone)bone, 0.003, &mesh, NULL),
                       SONDE_OK);
      is_a_ball(&mesh, NAMES[bone], k);
      for (uint32_t i = 0; i < mesh.vertex_count; ++i) {
        sonde_vec3 p = mesh.vertices[i];
        const double xyz[3] = {p.x, p.y, p.z};
        double level, angle, f;
        int nearest;
        sonde_limb_polar(limb, p, &level, &angle, &f);
        if (!(f < 1)) fail_msg("%s of member %u at level %.2f: f is %g", NAMES[bone], k, level, f);
        // No other bone reaches the surface of this one.
        double d = limb_bone_distance(limb, xyz, &nearest);
        if (d < -0.0012 && nearest != bone)
          fail_msg("%s of member %u at level %.2f is %.1f mm within %s", NAMES[bone], k, level,
                   -d * 1e3, NAMES[nearest]);
      }
      sonde_mesh_clear(&mesh);
    }
  }
}

static void girths_are_the_body_s_and_centres_are_centroids(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    sonde_limb *limb = family[k];
    const sonde_limb_body *body = sonde_limb_body_of(limb);
    assert_near(sonde_limb_girth(limb, 0.12) / body->girth_thigh_m, 1, 0.02);
    assert_near(sonde_limb_girth(limb, 0.88) / body->girth_knee_m, 1, 0.02);
    assert_near(sonde_limb_girth(limb, 1.28) / body->girth_calf_m, 1, 0.02);
    assert_near(sonde_limb_girth(limb, 1.86) / body->girth_ankle_m, 1, 0.04);
    for (double level = -0.2; level <= 2; level += 0.05) {
      double area = 0, x = 0, y = 0;
      for (int i = 0; i < 720; ++i) {
        double a = SONDE_PI * i / 360, r = limb_fascia_radius(limb, level, a);
        area += r * r / 2, x += r * r * r * sin(a) / 3, y += r * r * r * cos(a) / 3;
      }
      assert_near(x / area, 0, 0.0006);
      assert_near(y / area, 0, 0.0006);
    }
  }
}

// Unit normal of the skin by differences, out of the limb.
static sonde_vec3 skin_normal(const sonde_limb *limb, double level, double angle) {
  const double dl = 0.002, da = 0.01;
  sonde_vec3 p[4];
  for (int k = 0; k < 4; ++k) {
    double l = level + (k == 0   ? dl
                        : k == 1 ? -dl
                                 : 0),
           a = angle + (k == 2   ? da
                        : k == 3 ? -da
                                 : 0);
    p[k] = v_madd(limb_centre(limb, l), limb_skin_radius(limb, l, a), vec3(sin(a), cos(a), 0));
  }
  return v_unit(v_cross(v_sub(p[0], p[1]), v_sub(p[2], p[3])), vec3(0, 0, 0));
}

// Over groin and ramus the skin turns gently: along the limb its normal changes by less than a
// radius of curvature of 15 mm would let it, within every 5 mm from the front to the medial side.
static void the_groin_has_no_step(void **state) {
  (void)state;
  double most = 0;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    const double step = 0.005 / family[k]->body.thigh_length_m;
    for (double angle = -20 * DEGREE; angle < 95 * DEGREE; angle += 5 * DEGREE)
      for (double level = -0.19; level < 0.25; level += step) {
        sonde_vec3 a = skin_normal(family[k], level, angle),
                   b = skin_normal(family[k], level + step, angle);
        most = fmax(most, acos(clamp(v_dot(a, b), -1, 1)) / DEGREE);
      }
  }
  assert_true(most < 20); // 18.8; 59 where the ramus pushed one row alone
}

// Along rays from outside: skin, fat, then fascia, then what is within it; each ends before the
// next.
static void tissues_come_in_order(void **state) {
  (void)state;
  uint32_t random = 7;
  for (uint32_t k = 0; k < WHOLE; ++k) {
    sonde_limb *limb = whole[k];
    for (int ray = 0; ray < 850; ++ray) {
      double level = -0.2 + 2.2 * next_uniform(&random),
             angle = 2 * SONDE_PI * next_uniform(&random);
      double outer = limb_skin_radius(limb, level, angle) / limb_fascia_radius(limb, level, angle);
      int before = 0;
      bool seen[4] = {false};
      for (double f = outer + 0.02; f > 0.9; f -= 0.0006) {
        sonde_limb_label label = sonde_limb_at(limb, sonde_limb_point(limb, level, angle, f));
        int rank = label.tissue == SONDE_LIMB_OUTSIDE           ? 0
                   : label.tissue == SONDE_LIMB_SKIN            ? 1
                   : f > 1 && label.tissue != SONDE_LIMB_FASCIA ? 2
                                                                : 3;
        if (rank < before)
          fail_msg("member %u level %.3f: rank %d after %d", k, level, rank, before);
        before = rank, seen[rank] = true;
      }
      assert_true(seen[0] && seen[1] && seen[2] && seen[3]);
    }
  }
}

static void left_is_the_mirror_of_right(void **state) {
  (void)state;
  uint32_t random = 3;
  for (uint32_t k = 0; k < 6; ++k) {
    sonde_limb *right = whole[k], *left = limb_of_family(k, SONDE_LIMB_LEFT);
    for (int i = 0; i < 4000; ++i) {
      sonde_vec3 p =
          sonde_limb_point(right, -0.2 + 2.2 * next_uniform(&random),
                           2 * SONDE_PI * next_uniform(&random), 1.3 * next_uniform(&random));
      sonde_vec3 q = vec3(-p.x, p.y, p.z), along, mirrored;
      sonde_limb_label a = sonde_limb_at(right, p), b = sonde_limb_at(left, q);
      assert_int_equal(a.tissue, b.tissue);
      assert_int_equal(a.index, b.index);
      assert_int_equal(b.side, SONDE_LIMB_LEFT);
      assert_string_equal(sonde_limb_name(right, a), sonde_limb_name(left, b));
      assert_near(sonde_limb_distance(left, q).skin, sonde_limb_distance(right, p).skin, 1e-12);
      if (sonde_limb_fibre(right, p, &along)) {
        assert_true(sonde_limb_fibre(left, q, &mirrored));
        assert_near(mirrored.x, -along.x, 1e-12);
        assert_near(mirrored.z, along.z, 1e-12);
      }
    }
    sonde_mesh skin;
    assert_int_equal(sonde_limb_skin(left, 0.006, &skin, NULL), SONDE_OK);
    is_a_ball(&skin, "left skin", k);
    sonde_mesh_clear(&skin);
    sonde_limb_destroy(left);
  }
}

// Distances against a mesh of the skin, and points through polar coordinates and back.
static void distances_and_places_agree(void **state) {
  (void)state;
  uint32_t random = 11;
  sonde_limb *limb = limb_of_family(3, SONDE_LIMB_LEFT);
  sonde_mesh skin;
  sonde_surface_index *index = NULL;
  assert_int_equal(sonde_limb_skin(limb, 0.003, &skin, NULL), SONDE_OK);
  assert_int_equal(sonde_surface_index_create(&skin, &index, NULL), SONDE_OK);
  for (int i = 0; i < 2000; ++i) {
    double level = 0.15 + 1.75 * next_uniform(&random),
           angle = 2 * SONDE_PI * next_uniform(&random);
    double at_skin = limb_skin_radius(limb, level, angle) / limb_fascia_radius(limb, level, angle);
    sonde_vec3 p =
        sonde_limb_point(limb, level, angle, at_skin * (0.97 + 0.06 * next_uniform(&random)));
    double l, a, f, exact = sonde_surface_closest(index, p).distance_m;
    double d = sonde_limb_distance(limb, p).skin;
    if (fabs(fabs(d) - exact) > 0.0004 + 0.12 * exact)
      fail_msg("level %.3f angle %.0f: distance %g mm, expected %g", level, angle / DEGREE,
               fabs(d) * 1e3, exact * 1e3);
    sonde_limb_polar(limb, p, &l, &a, &f);
    assert_near(v_distance(sonde_limb_point(limb, l, a, f), p), 0, 1e-12);
    assert_near(l, level, 1e-12);
    assert_near(remainder(a - angle, 2 * SONDE_PI), 0, 1e-9);
  }
  sonde_surface_index_destroy(index);
  sonde_mesh_clear(&skin);
  sonde_limb_destroy(limb);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(skins_are_closed_without_handles),
      cmocka_unit_test(bones_are_closed_without_handles_inside_the_fascia),
      cmocka_unit_test(girths_are_the_body_s_and_centres_are_centroids),
      cmocka_unit_test(the_groin_has_no_step),
      cmocka_unit_test(tissues_come_in_order),
      cmocka_unit_test(left_is_the_mirror_of_right),
      cmocka_unit_test(distances_and_places_agree)};
  return cmocka_run_group_tests(tests, make_family, destroy_family);
}
