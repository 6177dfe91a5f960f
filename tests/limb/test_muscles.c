// Muscles: areas by labels against their rule, the section covered once, volumes, places as in an
// atlas, fibres.
#include "limb_test.h"

#include "../../bench/limb_laws.h"

#include "limb/frame.h"
#include "limb/muscles.h"
#include "limb/vessels.h"

enum { MOST = 30 };
#define FAMILY (uint32_t) SAMPLES(MOST, 6)

static uint32_t muscle_named(const char *name) {
  for (uint32_t k = 0; k < sonde_limb_muscle_count(); ++k)
    if (!strcmp(limb_muscle_table[k].name, name)) return k;
  fail_msg("no muscle is called %s", name);
  return 0;
}

static sonde_limb *family[MOST];

static int make_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) family[k] = limb_of_family(k, SONDE_LIMB_RIGHT);
  return 0;
}

static int drop_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) sonde_limb_destroy(family[k]);
  return 0;
}

// Cells counted on a grid of 1 mm that has nothing to do with the solver's.
static void cells_have_their_areas_and_cover_the_section(void **state) {
  (void)state;
  double worst = 0, sum = 0;
  uint32_t checked = 0, off = 0;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    sonde_limb *limb = family[k];
    for (double level = -0.097 + 0.02 * (k % 7); level < 1.95; level += 0.3) {
      double area[LIMB_CELLS] = {0}, within = 0, other = 0, step = 0.001;
      sonde_vec3 c = limb_centre(limb, level);
      for (double y = -0.16; y < 0.16; y += step)
        for (double x = -0.16; x < 0.16; x += step) {
          if (hypot(x, y) > limb_fascia_radius(limb, level, atan2(x, y))) continue;
          within += step * step;
          sonde_vec3 p = vec3(c.x + x, c.y + y, c.z);
          sonde_limb_label label = sonde_limb_at(limb, p);
          // Nothing within the fascia is without a label, and no skin is there.
          assert_true(label.tissue >= SONDE_LIMB_FAT);
          const double xyz[3] = {p.x, p.y, p.z};
          bool bundle = limb->vessels && limb_vessels_bundle(limb->vessels, xyz) < 0;
          if (bundle || limb_bone_distance(limb, xyz, NULL) < 0) {
            other += step * step;
            continue;
          }
          limb_cell cell = limb_cell_at(limb, level, x, y);
          assert_true(cell.cell < LIMB_CELLS);
          if (label.tissue == SONDE_LIMB_MUSCLE && label.index != cell.cell)
            fail_msg("member %u level %g: %u and %u, %g mm", k, level, label.index, cell.cell,
                     cell.boundary_m * 1e3);
          area[cell.cell] += step * step;
        }
      double total = other;
      for (uint32_t m = 0; m < LIMB_CELLS; ++m) total += area[m];
      assert_near(total / within, 1, 1e-9);
      for (uint32_t m = 0; m < SONDE_LIMB_MUSCLES; ++m) {
        double rule;
        sonde_limb_muscle_section(limb, m, level, &rule);
        if (rule < 300e-6) continue;
        double error = fabs(area[m] / rule - 1);
        worst = fmax(worst, error), sum += error, ++checked, off += error > 0.05;
      }
    }
  }
  print_message("%u sections of muscles: mean error %.2f %%, %u beyond 5 %%, worst %.1f %%\n",
                checked, 100 * sum / checked, off, 100 * worst);
  assert_true(sum / checked < 0.015);
  assert_true(off < 0.03 * checked);
}

// Means over the population of what is labelled as muscle: the rule is for the average, a leg's own
// girth decides about the leg.
static void volumes_are_those_of_the_rule(void **state) {
  (void)state;
  enum { POPULATION = 20 };
  double mean[2] = {0};
  for (uint64_t seed = 0; seed < POPULATION; ++seed) {
    sonde_limb *limb =
        make_limb(3000 + seed, seed % 2 ? SONDE_SEX_MALE : SONDE_SEX_FEMALE, NAN, SONDE_LIMB_RIGHT);
    double ratio[2];
    limb_muscle_ratio(limb, ratio);
    for (int k = 0; k < 2; ++k) mean[k] += ratio[k] / POPULATION;
    sonde_limb_destroy(limb);
  }
  print_message("volume against rule: thigh %.3f, calf %.3f\n", mean[0], mean[1]);
  assert_near(mean[0], 1, 0.06); // 1.054
  assert_near(mean[1], 1, 0.05); // 1.042
}

// Centroids of the labels at mid-thigh and mid-calf against the table of directions.
static void muscles_stand_where_an_atlas_has_them(void **state) {
  (void)state;
  const struct row {
    const char *name;
    double level, degrees;
  } rows[] = {{"sartorius", 0.25, 25},
              {"rectus femoris", 0.25, 347},
              {"vastus lateralis", 0.25, 282},
              {"adductor longus", 0.25, 67},
              {"gracilis", 0.25, 97},
              {"adductor magnus", 0.25, 119},
              {"gluteus maximus", 0.25, 211},
              {"sartorius", 0.5, 75},
              {"rectus femoris", 0.5, 350},
              {"vastus medialis", 0.5, 37},
              {"vastus lateralis", 0.5, 288},
              {"gracilis", 0.5, 103},
              {"semimembranosus", 0.5, 137},
              {"semitendinosus", 0.5, 168},
              {"biceps femoris, long head", 0.5, 204},
              {"sartorius", 0.75, 104},
              {"vastus medialis", 0.75, 48},
              {"semimembranosus", 0.75, 144},
              {"biceps femoris, long head", 0.75, 212},
              {"biceps femoris, short head", 0.75, 245},
              {"gastrocnemius, medial head", 1.25, 140},
              {"gastrocnemius, lateral head", 1.25, 224},
              {"tibialis anterior", 1.25, 351},
              {"extensor digitorum longus", 1.25, 324},
              {"peroneus longus", 1.25, 295},
              {"soleus", 1.5, 152},
              {"tibialis anterior", 1.5, 356},
              {"flexor digitorum longus", 1.5, 57},
              {"flexor hallucis longus", 1.5, 245}};
  for (uint32_t k = 0; k < (uint32_t)SAMPLES(12, 4); ++k) {
    sonde_limb *limb = family[k];
    for (size_t i = 0; i < SONDE_COUNT_OF(rows); ++i) {
      uint32_t wanted = muscle_named(rows[i].name);
      double x = 0, y = 0;
      for (double a = 0; a < 2 * SONDE_PI; a += 0.03)
        for (double f = 0.05; f < 1; f += 0.03) {
          sonde_limb_label label = sonde_limb_at(limb, sonde_limb_point(limb, rows[i].level, a, f));
          if (label.tissue == SONDE_LIMB_MUSCLE && label.index == wanted)
            x += f * f * sin(a), y += f * f * cos(a);
        }
      double off = remainder(atan2(x, y) / DEGREE - rows[i].degrees, 360);
      if (!(hypot(x, y) > 0 && fabs(off) < 30))
        fail_msg("%s at level %g of member %u is %.0f degrees off", rows[i].name, rows[i].level, k,
                 off);
    }
    // The tibia's medial face lies on the fascia, the fibula lateral of it and behind.
    for (double level = 1.25; level < 1.6; level += 0.25) {
      double gap = 1;
      for (double a = 5; a <= 60; a += 5)
        for (double f = 1; f > 0.8; f -= 0.005) {
          sonde_limb_label label =
              sonde_limb_at(limb, sonde_limb_point(limb, level, a * DEGREE, f));
          if (label.tissue == SONDE_LIMB_BONE && label.index == SONDE_LIMB_TIBIA)
            gap = fmin(gap, (1 - f) * limb_fascia_radius(limb, level, a * DEGREE));
        }
      if (gap > 0.004)
        fail_msg("member %u level %g: %.1f mm from tibia to fascia", k, level, gap * 1e3);
    }
  }
}

static void fibres_run_down_with_their_pennation(void **state) {
  (void)state;
  uint32_t random = 5, found = 0;
  sonde_limb *limb = family[5];
  for (int i = 0; i < 20000; ++i) {
    sonde_vec3 fibre,
        p = sonde_limb_point(limb, 2 * next_uniform(&random), 2 * SONDE_PI * next_uniform(&random),
                             sqrt(next_uniform(&random)));
    if (!sonde_limb_fibre(limb, p, &fibre)) {
      assert_true(sonde_limb_at(limb, p).tissue != SONDE_LIMB_MUSCLE);
      continue;
    }
    ++found;
    assert_near(v_norm(fibre), 1, 1e-9);
    assert_true(fibre.z < 0);
  }
  assert_true(found > 8000);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(cells_have_their_areas_and_cover_the_section),
                                     cmocka_unit_test(volumes_are_those_of_the_rule),
                                     cmocka_unit_test(muscles_stand_where_an_atlas_has_them),
                                     cmocka_unit_test(fibres_run_down_with_their_pennation)};
  return cmocka_run_group_tests(tests, make_family, drop_family);
}
