// Cubes of tissue on their way into the grid: their maps against the field, the kernels behind them
// against each other and against the scalar twin.
#include "interior/clot.h"
#include "base/random.h"
#include "echo/bench.h"
#include "echo/cubes.h"
#include "interior/interior.h"

#include <stdlib.h>

static const char *const sets[] = {"base", "sse4", "avx2", "avx512", "plain"};
enum { SETS = 5, PLAIN = 4 };

static float between(double low, double high, uint64_t *draw) {
  return (float)(low + (high - low) * sonde_random_uniform(11, (*draw)++));
}

typedef struct wall_points {
  float wall[3][WALL_FIELDS][WALL_ROOM], rest[3][WALL_POINTS], warped[3][WALL_POINTS],
      place[3][WALL_POINTS];
} wall_points;

// A vessel of 2 to 6 mm within 8 mm of the origin, pressed to an ellipse, or none.
static void draw_wall(wall_points *c, uint32_t k, uint32_t g, uint64_t *draw) {
  sonde_vec3 axis = v_unit(vec3(0.3, (double)between(-1, 1, draw), 1), vec3(0, 0, 1));
  sonde_vec3 flat = v_unit(v_cross(axis, vec3((double)between(-1, 1, draw), 1, 0)), vec3(1, 0, 0));
  sonde_vec3 across = v_cross(axis, flat);
  float radius = between(2e-3, 6e-3, draw), lost = between(-0.2, 0.97, draw);
  const float tissue[5] = {between(-0.2, 0.2, draw), between(0.5, 1, draw),
                           between(-0.3, 0.3, draw), between(1, 1.5, draw), between(0, 1, draw)};
  float half_long = radius * between(1, 1.3, draw);
  for (int i = 0; i < 3; ++i) {
    c->wall[k][WALL_REST + i][g] = between(-8e-3, 8e-3, draw);
    c->wall[k][WALL_SHIFT + i][g] = between(-3e-3, 3e-3, draw);
    c->wall[k][WALL_AXIS + i][g] = (float)v_coordinate(axis, i);
    c->wall[k][WALL_FLAT + i][g] = (float)v_coordinate(flat, i);
    c->wall[k][WALL_ACROSS + i][g] = (float)v_coordinate(across, i);
  }
  c->wall[k][WALL_RADIUS][g] = radius;
  for (int i = 0; i < 5; ++i) c->wall[k][WALL_ROTATION + i][g] = tissue[i];
  c->wall[k][WALL_LONG][g] = half_long;
  c->wall[k][WALL_SHORT][g] = radius * radius * (1 - lost) / half_long;
  float engaged = fminf(fabsf(lost) / (float)sonde_engaged_loss, 1);
  c->wall[k][WALL_COUPLING][g] = (g + k) % 5 ? engaged : 0;
}

static void draw_points(wall_points *c) {
  uint64_t draw = 0;
  for (uint32_t g = 0; g < WALL_ROOM; ++g)
    for (uint32_t k = 0; k < 3; ++k) draw_wall(c, k, g, &draw);
  for (uint32_t i = 0; i < WALL_POINTS; ++i)
    for (int k = 0; k < 3; ++k) {
      c->rest[k][i] = between(-12e-3, 12e-3, &draw);
      c->place[k][i] = c->rest[k][i] + between(-4e-3, 4e-3, &draw);
    }
  for (int k = 0; k < 3; ++k) // the centre of a vessel
    c->rest[k][8] = c->wall[0][WALL_REST + k][2];
}

static void move_with(const char *set, uint32_t walls, wall_points *c) {
  const wall_job job = {WALL_GROUPS,
                        walls,
                        (const float(*)[WALL_FIELDS][WALL_ROOM])c->wall,
                        (const float(*)[WALL_POINTS])c->rest,
                        c->warped,
                        c->place};
  sonde_echo_kernels_find(set)->warp(&job);
  sonde_echo_kernels_find(set)->smooth(&job);
}

// All sets move points to the same bits, and within 50 nm of where the vessels take them; away
// from the vessels the field's own motion stays.
static void walls_move_alike(void **state) {
  (void)state;
  wall_points *start = SONDE_NEW(wall_points, 1), *c = SONDE_NEW(wall_points, SETS);
  draw_points(start);
  for (uint32_t walls = 0; walls <= 3; ++walls) {
    double worst = 0, moved = 0;
    for (int k = 0; k < SETS; ++k) {
      c[k] = *start;
      if (sonde_echo_kernels_find(sets[k]) == NULL) continue;
      move_with(sets[k], walls, &c[k]);
      if (k < PLAIN) assert_memory_equal(c[k].place, c[0].place, sizeof c[k].place);
      if (k < PLAIN) assert_memory_equal(c[k].warped, c[0].warped, sizeof c[k].warped);
    }
    for (int k = 0; k < 3; ++k)
      for (uint32_t i = 0; i < WALL_POINTS; ++i) {
        worst = fmax(worst, (double)fabsf(c[PLAIN].place[k][i] - c[0].place[k][i]));
        moved = fmax(moved, (double)fabsf(start->place[k][i] - c[0].place[k][i]));
      }
    print_message("%u walls: %.2g nm off, moved by up to %.2g mm\n", walls, worst * 1e9,
                  moved * 1e3);
    assert_true(worst < 50e-9);
    assert_true(walls > 0 ? moved > 1e-3 : moved < 1e-8);
  }
  sonde_free(start);
  sonde_free(c);
}

enum { POINTS = 512, COLUMNS = 64, ROWS = 80, STRIDE = 2 * COLUMNS + 16 };

typedef struct laid {
  float x[POINTS], y[POINTS], z[POINTS], sign[POINTS], grid[(ROWS + 1) * STRIDE];
} laid;

static double energy(const laid *l) {
  double sum = 0;
  for (int i = 0; i < (ROWS + 1) * STRIDE; ++i) sum += (double)l->grid[i] * (double)l->grid[i];
  return sum;
}

// Three maps: inside the grid, over its border, and one with two lumina, the second with clot of a
// form.
static void lay_with(const char *set, sonde_clot_form form, laid *l) {
  const splat_map maps[] = {
      {{{30, 0, 40, 1}, {9, 0.5f, 2}, {-3, 1, 8}, {2, 1.5f, 4}}, 0, 256, 0, 0},
      {{{60, 0.2f, 3, 1}, {9, 0.5f, 2}, {-3, 1, 8}, {2, 1.5f, 4}}, 256, 128, 0, 0},
      {{{20, -0.3f, 60, 1.5f}, {9, 0.5f, 2}, {-3, 1, 8}, {2, 1.5f, 4}}, 384, 128, 0, 2}};
  const splat_lumen lumen[] = {
      {{0.2f, 2, 0.1f, 0.3f}, {0, 0.4f, 3, 0.2f}, {0}, 0, 0, 0, SONDE_CLOT_MURAL},
      {{-0.7f, 2.2f, 0, 0}, {0.5f, 0, 0.3f, 2}, {0.1f, 0, 0, 2e-3f}, 0.4f, 0, 1, form}};
  const splat_job job = {.x = l->x,
                         .y = l->y,
                         .z = l->z,
                         .sign = l->sign,
                         .map = maps,
                         .maps = SONDE_COUNT_OF(maps),
                         .lumen = lumen,
                         .cube = true,
                         .turns = 0.13f,
                         .right = COLUMNS - 1,
                         .rows = {1, ROWS - 1},
                         .grid = l->grid,
                         .stride = STRIDE,
                         .mask = UINT32_MAX};
  memset(l->grid, 0, sizeof l->grid);
  sonde_echo_kernels_find(set)->splat(&job);
}

// The same bits from all sets, the scalar twin's grid within single precision. What lies in the
// lumina adds nothing.
static void lay_alike(sonde_clot_form form) {
  laid *l = SONDE_NEW(laid, SETS);
  uint64_t draw = 7000;
  for (uint32_t i = 0; i < POINTS; ++i) {
    l->x[i] = between(-0.5, 0.5, &draw), l->y[i] = between(-0.5, 0.5, &draw);
    l->z[i] = between(-0.5, 0.5, &draw), l->sign[i] = i % 3 ? 1 : -1;
  }
  for (int k = 1; k < SETS; ++k) l[k] = l[0];
  double worst = 0;
  for (int k = 0; k < SETS; ++k) {
    if (sonde_echo_kernels_find(sets[k]) == NULL) continue;
    lay_with(sets[k], form, &l[k]);
    if (k < PLAIN) assert_memory_equal(l[k].grid, l[0].grid, sizeof l[k].grid);
  }
  for (int i = 0; i < (ROWS + 1) * STRIDE; ++i)
    worst = fmax(worst, (double)fabsf(l[0].grid[i] - l[PLAIN].grid[i]));
  print_message("scalar twin: %.2g off, energy %.3g\n", worst, energy(&l[0]));
  assert_true(worst < 2e-3 && energy(&l[0]) > 10);
  uint32_t inside = 0;
  for (uint32_t i = 384; i < POINTS; ++i) { // of the third map
    double x = (double)l->x[i], y = (double)l->y[i], z = (double)l->z[i];
    const double first[] = {0.2 + 2 * x + 0.1 * y + 0.3 * z, 0.4 * x + 3 * y + 0.2 * z},
                 second[] = {-0.7 + 2.2 * x, 0.5 + 0.3 * y + 2 * z};
    const double clot = sonde_clot_depth(form, 0.4, 1, 0.1 + 2e-3 * z, second[0], second[1]);
    if (!(first[0] * first[0] + first[1] * first[1] < 1) &&
        !(second[0] * second[0] + second[1] * second[1] < 1 && !(clot > 0)))
      continue;
    for (int k = 0; k < SETS; ++k) l[k].sign[i] = 0;
    ++inside;
  }
  laid *empty = &l[1];
  lay_with("base", form, empty);
  assert_true(inside > 20 && inside < 110);
  assert_memory_equal(empty->grid, l[0].grid, sizeof empty->grid);
  sonde_free(l);
}

static void maps_are_laid_alike(void **state) {
  (void)state;
  for (int f = SONDE_CLOT_MURAL; f <= SONDE_CLOT_RECANALISED; ++f) lay_alike((sonde_clot_form)f);
}

// A cube's middle, and the middles of its pieces beside a pressed vein, go where the interior takes
// them, up to what the coarse plane is off between its nodes.
static void cubes_follow_the_interior(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  for (uint32_t i = 0; i < b.leg.model.surface.vertex_count; ++i) {
    sonde_vec3 v = b.leg.model.surface.vertices[i];
    double away = v.x * v.x + (v.z - 0.15) * (v.z - 0.15);
    if (v.y > 0 && away < 0.02 * 0.02) b.forces[i] = vec3(0, -0.35, 0);
  }
  look(&b, NULL);
  uint32_t count;
  const sonde_vessel_state *vein = sonde_interior_vessel(b.interior, 0, &count);
  assert_true(vein[count / 2].area_ratio < 0.9);
  sonde_cubes *s = b.echo->cubes;
  const double h = b.echo->cell_m;
  double whole = 0, pieces = 0;
  uint32_t by_walls = 0;
  for (int j = 0; j < 12; ++j)
    for (int i = -5; i < 5; ++i) {
      sonde_cubes_begin(b.echo);
      sonde_vec3 near = pose_apply(b.pose, vec3(2e-3 * i, 0, 4e-3 + 2e-3 * j));
      const int32_t cell[3] = {(int32_t)floor(near.x / h), (int32_t)floor(near.y / h),
                               (int32_t)floor(near.z / h)};
      sonde_vec3 middle = vec3((cell[0] + 0.5) * h, (cell[1] + 0.5) * h, (cell[2] + 0.5) * h);
      sonde_vec3 guess = sonde_echo_from_world(b.echo, near);
      s->slab[0] = (slab_cube){
          point_of(v_sub(middle, s->corner)), point_of(guess), {cell[0], cell[1], cell[2]}};
      s->slab_count = 1;
      sonde_motion_begin(b.echo);
      assert_int_equal(sonde_motion_displace(b.echo, 0), 1);
      const moved_cube c = s->moved[0];
      sonde_vec3 at = vec3((double)c.at[0], (double)c.at[1], (double)c.at[2]);
      sonde_vec3 field = v_add(middle, sonde_interior_field(b.interior, middle));
      whole = fmax(whole, v_distance(sonde_echo_to_world(b.echo, at), field));
      for (uint32_t p = 0; c.by_walls && p < (c.close ? 8 : 4); ++p, ++by_walls) {
        sonde_vec3 rest = s->corner, now = s->corner;
        rest =
            v_add(rest, vec3((double)s->rest[0][p], (double)s->rest[1][p], (double)s->rest[2][p]));
        now = v_add(now, vec3((double)s->place_m[0][p], (double)s->place_m[1][p],
                              (double)s->place_m[2][p]));
        sonde_vec3 due = v_add(rest, sonde_interior_displacement(b.interior, rest));
        pieces = fmax(pieces, v_distance(now, due));
      }
    }
  print_message("middles %.2g um off, %u points by walls %.2g um\n", whole * 1e6, by_walls,
                pieces * 1e6);
  assert_true(by_walls > 400 && whole < 1e-6 && pieces < 20e-6);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(walls_move_alike),
      cmocka_unit_test(maps_are_laid_alike),
      cmocka_unit_test(cubes_follow_the_interior),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
