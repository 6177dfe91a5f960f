// Positions: volume and form are kept, the way there and back, skin without folds, veins that fill
// by gravity, a bed that flattens, probes that reach their stations.
#include "limb_test.h"

#include "limb/muscles.h"
#include "limb/pose.h"
#include "limb/vessels_graph.h"

enum { MOST = 4 };
#define FAMILY (uint32_t) SAMPLES(MOST, 2)
static sonde_limb *family[MOST];
static sonde_limb_pose *posed[MOST][SONDE_LIMB_POSITIONS];

static sonde_limb_pose *put(const sonde_limb *limb, sonde_limb_setting setting) {
  sonde_limb_pose *pose = NULL;
  sonde_error error = {0};
  if (sonde_limb_pose_create(limb, &setting, &pose, &error)) fail_msg("%s", error.message);
  return pose;
}

static int make_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    family[k] = limb_of_family(5 * k, k % 3 == 2 ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT);
    for (int i = 0; i < SONDE_LIMB_POSITIONS; ++i)
      posed[k][i] = put(family[k], sonde_limb_setting_usual((sonde_limb_position)i));
  }
  return 0;
}
static int drop_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    for (int i = 0; i < SONDE_LIMB_POSITIONS; ++i) sonde_limb_pose_destroy(posed[k][i]);
    sonde_limb_destroy(family[k]);
  }
  return 0;
}
#define EACH_POSE(k, i)                                                                            \
  for (uint32_t k = 0; k < FAMILY; ++k)                                                            \
    for (int i = 0; i < SONDE_LIMB_POSITIONS; ++i)
static const char *name_of(int position) {
  return sonde_limb_position_name((sonde_limb_position)position);
}

// Volume of a small tetrahedron after the map against that before.
static double volume_change(const sonde_limb_pose *pose, sonde_vec3 p) {
  const double edge = 1e-4;
  sonde_vec3 corner[4], q[4];
  for (int k = 0; k < 4; ++k) {
    corner[k] = v_add(p, vec3(k == 1 ? edge : 0, k == 2 ? edge : 0, k == 3 ? edge : 0));
    q[k] = sonde_limb_pose_point(pose, corner[k]);
  }
  return v_dot(v_sub(q[1], q[0]), v_cross(v_sub(q[2], q[0]), v_sub(q[3], q[0]))) /
         (edge * edge * edge);
}

// A point of the limb, even over level, angle and area.
static sonde_vec3 any_point(const sonde_limb *limb, uint32_t *random, double deepest) {
  double level = -0.2 + 2.2 * next_uniform(random), angle = 2 * SONDE_PI * next_uniform(random);
  double skin = limb_skin_radius(limb, level, angle) / limb_fascia_radius(limb, level, angle);
  double f = skin * sqrt(deepest + (1 - deepest) * next_uniform(random));
  return sonde_limb_point(limb, level, angle, f);
}

static void muscles_keep_their_volume(void **state) {
  (void)state;
  double worst = 0, worst_all = 0;
  uint32_t wrong = 0;
  EACH_POSE(k, i) {
    double before[SONDE_LIMB_MUSCLES] = {0}, after[SONDE_LIMB_MUSCLES] = {0}, sum[2] = {0, 0};
    uint32_t random = 17;
    const double h = 0.006;
    double foot = limb_z(family[k], 2), top = limb_z(family[k], LIMB_TOP);
    for (double z = foot; z < top; z += h)
      for (double x = -0.16; x < 0.16; x += h)
        for (double y = -0.16; y < 0.16; y += h) {
          sonde_vec3 p = vec3(x + h * next_uniform(&random), y + h * next_uniform(&random),
                              z + h * next_uniform(&random));
          sonde_limb_label label = sonde_limb_at(family[k], p);
          if (label.tissue != SONDE_LIMB_MUSCLE) continue;
          double change = volume_change(posed[k][i], p);
          before[label.index] += h * h * h, after[label.index] += h * h * h * change;
          sum[0] += 1, sum[1] += change;
        }
    worst_all = fmax(worst_all, fabs(sum[1] / sum[0] - 1));
    for (int m = 0; m < SONDE_LIMB_MUSCLES; ++m) {
      // Popliteus, plantaris and the small rotators lie between the bones of a joint.
      if (before[m] < 4e-6) continue;
      double off = fabs(after[m] / before[m] - 1);
      const char *name = limb_muscle_table[m].name;
      bool between = !strcmp(name, "popliteus") || !strcmp(name, "plantaris") ||
                     !strcmp(name, "deep rotators of the hip");
      bool loose = i == SONDE_LIMB_SITTING || !strcmp(name, "pectineus");
      if (!between) worst = fmax(worst, off);
      if (off <= (between ? 0.45 : loose ? 0.056 : 0.03)) continue;
      ++wrong;
      print_message("member %u, %s: %s has %.3f of its volume\n", k, name_of(i), name,
                    after[m] / before[m]);
    }
  }
  print_message("volume of a muscle to %.2f %%, of all to %.2f %%\n", 100 * worst, 100 * worst_all);
  assert_int_equal(wrong, 0);
  assert_true(worst_all < 0.004);
}

static void bones_keep_their_form(void **state) {
  (void)state;
  EACH_POSE(k, i) {
    const sonde_limb *limb = family[k];
    for (int bone = 0; bone < SONDE_LIMB_BONES; ++bone) {
      sonde_mesh mesh, moved;
      assert_int_equal(sonde_limb_bone_mesh(limb, (sonde_limb_bone)bone, 0.004, &mesh, NULL), 0);
      assert_int_equal(
          sonde_limb_pose_bone_mesh(posed[k][i], (sonde_limb_bone)bone, 0.004, &moved, NULL), 0);
      uint32_t step = mesh.vertex_count / 200 + 1;
      for (uint32_t v = 0; v + step < mesh.vertex_count; v += step) {
        // As far apart as at rest, and where the tissue of the bone goes.
        assert_near(v_distance(moved.vertices[v], moved.vertices[v + step]),
                    v_distance(mesh.vertices[v], mesh.vertices[v + step]), 1e-9);
        double off =
            v_distance(sonde_limb_pose_point(posed[k][i], mesh.vertices[v]), moved.vertices[v]);
        if (off > 0.0012)
          fail_msg("member %u, %s: bone %d is %.2f mm from its tissue", k, name_of(i), bone,
                   1e3 * off);
      }
      sonde_mesh_clear(&mesh);
      sonde_mesh_clear(&moved);
    }
  }
}

// Angles between bones are those asked for: directions of shaft and tibia against the pelvis.
static void joints_have_their_angles(void **state) {
  (void)state;
  for (int side = 0; side < 2; ++side) {
    sonde_limb *limb = limb_of_family(2, side ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT);
    double lateral = side ? 1 : -1;
    const double angle = 24 * DEGREE;
    for (int which = 0; which < 4; ++which) {
      sonde_limb_setting s = {SONDE_LIMB_STANDING, 0, 0, 0, 0};
      *(which == 0   ? &s.hip_flexion_rad
        : which == 1 ? &s.hip_rotation_rad
        : which == 2 ? &s.hip_abduction_rad
                     : &s.knee_flexion_rad) = angle;
      sonde_limb_pose *pose = put(limb, s);
      sonde_pose femur = sonde_limb_pose_bone(pose, SONDE_LIMB_FEMUR),
                 tibia = sonde_limb_pose_bone(pose, SONDE_LIMB_TIBIA);
      sonde_vec3 thigh = q_rotate(femur.rotation, vec3(0, 0, -1)),
                 front = q_rotate(femur.rotation, vec3(0, 1, 0)),
                 calf = q_rotate(tibia.rotation, vec3(0, 0, -1));
      if (which == 0) assert_near(atan2(thigh.y, -thigh.z), angle, 1e-9);
      if (which == 1) assert_near(atan2(lateral * front.x, front.y), angle, 1e-9);
      if (which == 2) assert_near(atan2(lateral * thigh.x, -thigh.z), angle, 1e-9);
      if (which == 3) assert_near(atan2(-calf.y, -calf.z), angle, 1e-9);
      if (which < 3) assert_near(v_distance(thigh, calf), 0, 1e-9);
      sonde_limb_pose_destroy(pose);
    }
    sonde_limb_destroy(limb);
  }
}

static void there_and_back(void **state) {
  (void)state;
  uint32_t random = 5, folded = 0, all = 0;
  EACH_POSE(k, i) {
    for (int n = 0; n < 3000; ++n) {
      sonde_vec3 p = any_point(family[k], &random, 0), back;
      sonde_vec3 q = sonde_limb_pose_point(posed[k][i], p);
      bool found = sonde_limb_pose_rest(posed[k][i], q, &back);
      if (found) assert_near(v_distance(sonde_limb_pose_point(posed[k][i], back), q), 0, 1e-7);
      ++all;
      if (found && v_distance(back, p) < 1e-5) continue;
      // Only what lies between the bones of hip and knee has no way back, or another.
      ++folded;
      double level, angle, f, bone = sonde_limb_distance(family[k], p).bone;
      sonde_limb_polar(family[k], p, &level, &angle, &f);
      if (bone > 0.02 || (fabs(level - 1) > 0.15 && fabs(level) > 0.2))
        fail_msg("member %u, %s: no way back at level %.2f, angle %.0f, f %.2f, %.0f mm from bone",
                 k, name_of(i), level, angle / DEGREE, f, 1e3 * bone);
    }
  }
  print_message("%u of %u points between bones have no way back of their own\n", folded, all);
  assert_true(folded < 0.003 * all);
}

// Skin: closed, and its inside is inside: tissue within, air without, everywhere.
static void skin_stays_closed_and_does_not_cross(void **state) {
  (void)state;
  EACH_POSE(k, i) {
    sonde_mesh skin;
    sonde_mesh_report report;
    assert_int_equal(sonde_limb_pose_skin(posed[k][i], 0.005, &skin, NULL), SONDE_OK);
    assert_int_equal(sonde_mesh_inspect(&skin, &report, NULL), SONDE_OK);
    assert_true(report.closed && report.outward && !report.duplicate_or_degenerate_faces);
    sonde_vec3 *normal = SONDE_NEW(sonde_vec3, skin.vertex_count);
    for (uint32_t f = 0; f < skin.face_count; ++f) {
      const uint32_t *v = skin.faces[f];
      sonde_vec3 a = skin.vertices[v[0]];
      sonde_vec3 n = v_cross(v_sub(skin.vertices[v[1]], a), v_sub(skin.vertices[v[2]], a));
      for (int c = 0; c < 3; ++c) normal[v[c]] = v_add(normal[v[c]], n);
    }
    uint32_t wrong = 0, asked = 0;
    for (uint32_t v = 0; v < skin.vertex_count; v += 17) {
      sonde_vec3 n = v_unit(normal[v], vec3(0, 0, 1)), rest;
      if (!sonde_limb_pose_rest(posed[k][i], skin.vertices[v], &rest)) continue;
      double level = limb_level(family[k], rest.z);
      if (level < -0.19 || level > 1.99) continue; // lids
      sonde_limb_label out = sonde_limb_pose_at(posed[k][i], v_madd(skin.vertices[v], 0.0012, n)),
                       in = sonde_limb_pose_at(posed[k][i], v_madd(skin.vertices[v], -0.0012, n));
      wrong += out.tissue != SONDE_LIMB_OUTSIDE || in.tissue == SONDE_LIMB_OUTSIDE, ++asked;
    }
    // Normals of a mesh of 5 mm are rough where the bed's edge bends the skin.
    if (500 * wrong > asked)
      fail_msg("member %u, %s: %u of %u places of the skin are wrong", k, name_of(i), wrong, asked);
    assert_true(asked > 200);
    sonde_free(normal);
    sonde_mesh_clear(&skin);
  }
}

// At rest everything is as without a position.
static void standing_straight_is_rest(void **state) {
  (void)state;
  uint32_t random = 23;
  for (uint32_t k = 0; k < FAMILY; ++k)
    for (int n = 0; n < 2000; ++n) {
      sonde_vec3 p = any_point(family[k], &random, 0), q, a, b;
      const sonde_limb_pose *pose = posed[k][SONDE_LIMB_STANDING];
      assert_true(sonde_limb_pose_rest(pose, p, &q));
      assert_near(v_distance(p, q), 0, 1e-12);
      sonde_limb_distances d = sonde_limb_distance(family[k], p),
                           e = sonde_limb_pose_distance(pose, p);
      assert_near(e.skin, d.skin, 1e-6);
      if (fabs(d.bone) < 0.02) assert_near(e.bone, d.bone, 1e-9);
      assert_int_equal(sonde_limb_fibre(family[k], p, &a), sonde_limb_pose_fibre(pose, p, &b));
    }
}

// A distance is how far it is: to the mesh of the posed skin, in the joints and on the bed too.
static void distances_are_those_of_the_position(void **state) {
  (void)state;
  uint32_t random = 3;
  for (uint32_t k = 0; k < FAMILY; k += 2)
    for (int i = 0; i < 3; ++i) {
      sonde_mesh skin;
      sonde_surface_index *index = NULL;
      assert_int_equal(sonde_limb_pose_skin(posed[k][i], 0.0025, &skin, NULL), SONDE_OK);
      assert_int_equal(sonde_surface_index_create(&skin, &index, NULL), SONDE_OK);
      for (int n = 0; n < 400; ++n) {
        double level = 0.1 + 1.8 * next_uniform(&random),
               angle = 2 * SONDE_PI * next_uniform(&random);
        double f = limb_skin_radius(family[k], level, angle) /
                   limb_fascia_radius(family[k], level, angle) *
                   (0.97 + 0.03 * next_uniform(&random));
        sonde_vec3 p = sonde_limb_point(family[k], level, angle, f), back;
        sonde_vec3 q = sonde_limb_pose_point(posed[k][i], p);
        if (!sonde_limb_pose_rest(posed[k][i], q, &back) || v_distance(back, p) > 1e-5) continue;
        double exact = sonde_surface_closest(index, q).distance_m;
        double d = sonde_limb_pose_distance(posed[k][i], q).skin;
        if (fabs(-d - exact) > 0.0015 + 0.25 * exact)
          fail_msg("member %u, %s, level %.2f, angle %.0f: distance %.2f mm, expected %.2f", k,
                   name_of(i), level, angle / DEGREE, -1e3 * d, 1e3 * exact);
      }
      sonde_surface_index_destroy(index);
      sonde_mesh_clear(&skin);
    }
}

// From the external iliac vein to the ankle.
static double path_length(const sonde_limb *limb, const sonde_limb_pose *pose) {
  static const char *const NAMES[] = {
      "external iliac vein", "common femoral vein",      "femoral vein",
      "popliteal vein",      "tibioperoneal trunk vein", "posterior tibial vein"};
  double sum = 0;
  for (size_t i = 0; i < SONDE_COUNT_OF(NAMES); ++i) {
    uint32_t b = sonde_limb_vessel_find(limb, NAMES[i]);
    assert_true(b != SONDE_LIMB_NO_VESSEL);
    sum += pose ? sonde_limb_pose_length(pose, b) : sonde_limb_vessel_get(limb, b).length_m;
  }
  return sum;
}

static void veins_keep_their_length(void **state) {
  (void)state;
  double worst = 0, sitting = 0;
  EACH_POSE(k, i) {
    double off = fabs(path_length(family[k], posed[k][i]) / path_length(family[k], NULL) - 1);
    // A hip bent by 45 degrees and a knee by 50 shorten what runs before the one and behind the
    // other.
    if (i == SONDE_LIMB_SITTING)
      sitting = fmax(sitting, off);
    else
      worst = fmax(worst, off);
  }
  print_message("path of the veins to %.2f %%, sitting to %.2f %%\n", 100 * worst, 100 * sitting);
  assert_true(worst < 0.02);
  assert_true(sitting < 0.065);
}

static double area_at(const sonde_limb *limb, const sonde_limb_pose *pose, const char *name,
                      double share) {
  uint32_t b = sonde_limb_vessel_find(limb, name);
  return sonde_limb_pose_place(pose, b, share * sonde_limb_vessel_get(limb, b).length_m).area_m2;
}

static void veins_fill_by_gravity(void **state) {
  (void)state;
  const double mmhg = 133.322;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    const sonde_limb *limb = family[k];
    const sonde_limb_body *body = sonde_limb_body_of(limb);
    const sonde_limb_pose *lying = posed[k][SONDE_LIMB_SUPINE],
                          *sits = posed[k][SONDE_LIMB_SITTING],
                          *stands = posed[k][SONDE_LIMB_STANDING];
    sonde_vec3 groin =
        sonde_limb_vessel_place(limb, sonde_limb_vessel_find(limb, "common femoral vein"), 0.03)
            .centre_m;
    sonde_vec3 ankle = vec3(0, 0, limb_z(limb, 2));
    double supine = sonde_limb_pose_pressure(lying, groin) / mmhg;
    assert_near(supine, 10, 1);
    assert_near(sonde_limb_pose_pressure(lying, ankle) / mmhg, 10, 4);
    assert_near(sonde_limb_pose_pressure(stands, groin) / mmhg / supine, 3.2, 0.3);
    assert_near(sonde_limb_pose_pressure(sits, sonde_limb_pose_point(sits, groin)) / mmhg / supine,
                2.5, 0.4);
    // 76 to 79 mmHg at the ankle of the mean man, whose leg is 0.825 m long.
    double leg = body->thigh_length_m + body->calf_length_m;
    assert_near(sonde_limb_pose_pressure(stands, ankle) / mmhg, 77.5 + (leg - 0.825) * 55, 3);
    static const char *const DEEP[] = {"common femoral vein", "femoral vein", "popliteal vein",
                                       "posterior tibial vein"};
    for (int n = 0; n < 4; ++n)
      for (double share = 0.1; share < 1; share += 0.2) {
        double ratio = area_at(limb, stands, DEEP[n], share) / area_at(limb, lying, DEEP[n], share);
        if (!(ratio > 1.4 && ratio < 1.85))
          fail_msg("member %u: %s at %.1f has %.2f of its area when standing", k, DEEP[n], share,
                   ratio);
      }
    assert_near(area_at(limb, stands, "popliteal artery", 0.5) /
                    area_at(limb, lying, "popliteal artery", 0.5),
                1, 1e-12);
  }
}

// The popliteal vein is 7.7 mm wide when the knee is bent and 4.3 mm when it is straight.
static void bending_the_knee_frees_the_popliteal_vein(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    double before = 0, width[6];
    uint32_t b = sonde_limb_vessel_find(family[k], "popliteal vein");
    double arc = 0, length = sonde_limb_vessel_get(family[k], b).length_m;
    while (arc < length &&
           limb_level(family[k], sonde_limb_vessel_place(family[k], b, arc).centre_m.z) < 0.97)
      arc += 0.001;
    for (int n = 0; n <= 5; ++n) {
      sonde_limb_setting s = {SONDE_LIMB_PRONE, 0, 0, 0, 6 * n * DEGREE};
      sonde_limb_pose *pose = put(family[k], s);
      width[n] = 2 * sonde_limb_pose_place(pose, b, arc).radius_m;
      assert_true(width[n] >= before - 1e-4);
      before = width[n];
      sonde_limb_pose_destroy(pose);
    }
    assert_near(width[0] / width[5], 4.3 / 7.7, 0.02);
    assert_near(width[5], 2 * sonde_limb_vessel_place(family[k], b, arc).radius_m, 7e-4);
  }
}

// A label in the vein's wider lumen, and none of it in an emptier one.
static void labels_have_the_width_of_the_position(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k)
    for (int i = 0; i < 3; ++i) {
      sonde_limb_station station[SONDE_LIMB_STATIONS];
      sonde_limb_pose_stations(posed[k][i], station);
      for (uint32_t n = 0; n < SONDE_LIMB_STATIONS; ++n) {
        const sonde_limb_station *s = &station[n];
        if ((int)s->position != i) continue; // elsewhere the bed may flatten the vein
        sonde_limb_label at = sonde_limb_pose_at(posed[k][i], s->target_m);
        if (at.tissue != SONDE_LIMB_LUMEN ||
            sonde_limb_vessel_get(family[k], at.index).kind == SONDE_LIMB_ARTERY)
          fail_msg("member %u, %s, %s: the vein's middle is %s", k, name_of(i), s->name,
                   sonde_limb_name(family[k], at));
        // Towards the skin the lumen ends where the position's width says.
        sonde_limb_vessel_point vein = sonde_limb_pose_place(posed[k][i], s->vein[0], s->arc_m[0]);
        double edge = 0;
        sonde_vec3 out = v_unit(v_sub(s->skin_m, s->target_m), s->normal);
        while (sonde_limb_pose_at(posed[k][i], v_madd(s->target_m, edge, out)).tissue ==
               SONDE_LIMB_LUMEN)
          edge += 0.0001;
        if (n != 1 && n != 2 && edge < 0.7 * vein.radius_m)
          fail_msg("member %u, %s, %s: lumen of %.1f mm, expected %.1f", k, name_of(i), s->name,
                   1e3 * edge, 1e3 * vein.radius_m);
      }
    }
}

// The bed's side is flat: 10 to 25 mm of thigh are gone where it lies, none on the other side; no
// tissue is in the bed.
static void the_bed_flattens_what_lies_on_it(void **state) {
  (void)state;
  double sum = 0;
  uint32_t thighs = 0;
  EACH_POSE(k, i) {
    const sonde_limb_pose *pose = posed[k][i];
    if (i == SONDE_LIMB_STANDING) {
      assert_true(isinf(sonde_limb_pose_bed(pose, vec3(0, 0, 0))));
      continue;
    }
    uint32_t random = 9;
    for (int n = 0; n < 3000; ++n) {
      sonde_vec3 q = sonde_limb_pose_point(pose, any_point(family[k], &random, 0.9));
      double bed = sonde_limb_pose_bed(pose, q);
      if (bed < -0.0005)
        fail_msg("member %u, %s: tissue %.1f mm in the bed", k, name_of(i), -1e3 * bed);
    }
    double lost = 0;
    for (double level = 0.15; level < 0.6; level += 0.05) {
      double squeezed = INFINITY, free = INFINITY, top = 0;
      for (int a = 0; a < 72; ++a) {
        double angle = a * 5 * DEGREE;
        sonde_vec3 p =
            v_madd(limb_centre(family[k], level), limb_skin_radius(family[k], level, angle),
                   vec3(sin(angle), cos(angle), 0));
        double before = v_dot(limb_pose_joints(pose, p), pose->up),
               after = v_dot(limb_pose_forward(pose, p), pose->up);
        squeezed = fmin(squeezed, after), free = fmin(free, before),
        top = fmax(top, after - before);
        if (before > v_dot(limb_pose_joints(pose, limb_centre(family[k], level)), pose->up))
          assert_true(after - before < 0.004);
      }
      lost = fmax(lost, squeezed - free);
    }
    if (!(lost > 0.0065 && lost < 0.0255))
      fail_msg("member %u, %s: the thigh loses %.1f mm", k, name_of(i), 1e3 * lost);
    sum += lost, ++thighs;
  }
  print_message("a thigh on the bed loses %.1f mm\n", 1e3 * sum / thighs);
  assert_true(sum / thighs > 0.01);
}

static void bad_positions_are_refused(void **state) {
  (void)state;
  sonde_limb_pose *pose;
  sonde_error error = {0};
  sonde_limb_setting s = sonde_limb_setting_usual(SONDE_LIMB_SITTING);
  s.knee_flexion_rad = 120 * DEGREE;
  assert_int_equal(sonde_limb_pose_create(family[0], &s, &pose, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "knee flexion is 120 degrees, expected 0 to 75"));
  s.knee_flexion_rad = NAN;
  assert_int_equal(sonde_limb_pose_create(family[0], &s, &pose, &error), SONDE_ARGUMENT);
  assert_null(pose);
}

static void a_left_limb_lies_as_the_mirror(void **state) {
  (void)state;
  sonde_limb *left = limb_of_family(0, SONDE_LIMB_LEFT);
  uint32_t random = 31;
  for (int i = 0; i < 3; ++i) {
    sonde_limb_pose *pose = put(left, sonde_limb_setting_usual((sonde_limb_position)i));
    for (int n = 0; n < 300; ++n) {
      sonde_vec3 p = any_point(family[0], &random, 0), m = vec3(-p.x, p.y, p.z);
      sonde_vec3 a = sonde_limb_pose_point(posed[0][i], p), b = sonde_limb_pose_point(pose, m);
      assert_near(v_distance(vec3(-a.x, a.y, a.z), b), 0, 1e-12);
      sonde_limb_label la = sonde_limb_pose_at(posed[0][i], a), lb = sonde_limb_pose_at(pose, b);
      assert_true(la.tissue == lb.tissue && la.index == lb.index);
    }
    for (int bone = 0; bone < SONDE_LIMB_BONES; ++bone) {
      sonde_pose r = sonde_limb_pose_bone(posed[0][i], (sonde_limb_bone)bone),
                 l = sonde_limb_pose_bone(pose, (sonde_limb_bone)bone);
      sonde_vec3 p = vec3(0.03, 0.02, -0.4), a = pose_apply(r, p);
      assert_near(v_distance(pose_apply(l, vec3(-0.03, 0.02, -0.4)), vec3(-a.x, a.y, a.z)), 0,
                  1e-12);
    }
    sonde_limb_pose_destroy(pose);
  }
  sonde_limb_destroy(left);
}

// Nothing of the limb, the bed or the other leg is where the probe's body is: 60 x 30 mm, 130 mm
// long, from a face of 45 x 12 mm. Of each station in its position, and of those that the protocol
// of the whole leg examines in another.
static void probes_reach_every_station(void **state) {
  (void)state;
  static const struct {
    uint32_t station;
    sonde_limb_position position;
  } MORE[] = {{10, SONDE_LIMB_SUPINE_TURNED}, // posterior tibial
              {11, SONDE_LIMB_PRONE_BENT},    // peroneal
              {12, SONDE_LIMB_PRONE_BENT}};   // gastrocnemius
  uint32_t blocked = 0, all = 0;
  double sunk = 0;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    sonde_limb_station station[SONDE_LIMB_STATIONS];
    sonde_limb_stations(family[k], station);
    double out = family[k]->body.side == SONDE_LIMB_LEFT ? -1 : 1;
    double midline = out * 0.088 * family[k]->scale;
    for (uint32_t i = 0; i < SONDE_LIMB_STATIONS + SONDE_COUNT_OF(MORE); ++i, ++all) {
      const bool own = i < SONDE_LIMB_STATIONS;
      const uint32_t n = own ? i : MORE[i - SONDE_LIMB_STATIONS].station;
      const sonde_limb_position position =
          own ? station[n].position : MORE[i - SONDE_LIMB_STATIONS].position;
      const sonde_limb_pose *pose = posed[k][position];
      sonde_limb_station here[SONDE_LIMB_STATIONS];
      sonde_limb_pose_stations(pose, here);
      const sonde_limb_station *s = &here[n];
      const char *what = NULL;
      double most = 0;
      for (double back = 0.004; back < 0.13; back += 0.006)
        for (double u = -1; u <= 1.01; u += 0.25)
          for (double v = -1; v <= 1.01; v += 0.5) {
            double grow = fmin(back / 0.03, 1);
            sonde_vec3 p = pose_apply(
                s->probe, vec3(u * (0.0225 + 0.0075 * grow), v * (0.006 + 0.009 * grow), -back));
            sonde_limb_label at = sonde_limb_pose_at(pose, p);
            if (at.tissue != SONDE_LIMB_OUTSIDE)
              most = fmax(most, -sonde_limb_pose_distance(pose, p).skin);
            if (sonde_limb_pose_bed(pose, p) < -0.001) what = "the bed";
            sonde_vec3 other = vec3(2 * midline - p.x, p.y, p.z);
            if (sonde_limb_pose_at(pose, other).tissue != SONDE_LIMB_OUTSIDE)
              what = "the other leg";
          }
      // The edges of the face may press a hollow of the groin by what a light touch gives.
      if (most > 0.0085) what = "the limb";
      sunk = fmax(sunk, most);
      assert_true(sonde_limb_pose_reaches(pose, s->probe) == !what || most > 0.0075);
      if (!what) continue;
      ++blocked;
      print_message("member %u, %s, %s: %s is in the probe\n", k, name_of((int)position), s->name,
                    what);
    }
  }
  print_message("%u of %u probes blocked, edges sink %.1f mm\n", blocked, all, 1e3 * sunk);
  assert_int_equal(blocked, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(muscles_keep_their_volume),
                                     cmocka_unit_test(bones_keep_their_form),
                                     cmocka_unit_test(joints_have_their_angles),
                                     cmocka_unit_test(there_and_back),
                                     cmocka_unit_test(skin_stays_closed_and_does_not_cross),
                                     cmocka_unit_test(standing_straight_is_rest),
                                     cmocka_unit_test(distances_are_those_of_the_position),
                                     cmocka_unit_test(veins_keep_their_length),
                                     cmocka_unit_test(veins_fill_by_gravity),
                                     cmocka_unit_test(bending_the_knee_frees_the_popliteal_vein),
                                     cmocka_unit_test(labels_have_the_width_of_the_position),
                                     cmocka_unit_test(the_bed_flattens_what_lies_on_it),
                                     cmocka_unit_test(bad_positions_are_refused),
                                     cmocka_unit_test(a_left_limb_lies_as_the_mirror),
                                     cmocka_unit_test(probes_reach_every_station)};
  return cmocka_run_group_tests(tests, make_family, drop_family);
}
