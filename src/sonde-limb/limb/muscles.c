// Muscles of each section by a power diagram whose weights give every cell its area
// (docs/limb_theory.md, Muscles).
#include "limb/muscles.h"

#include "limb/knots.h"
#include "limb/vessels.h"

#include "base/parallel.h"

#include <string.h>

static const double LEAST_AREA = 14e-6;   // a belly of less is a tendon
static const double MOST_SCALE = 1.25;    // muscle against its rule; fat takes what is left
enum { MIDDLE_ROW = LIMB_CELL_ROWS / 2 }; // at the knee; both halves of the limb begin there

// Fat between the muscles: which share of the section it takes at levels, and where.
typedef struct filler {
  const char *name;
  double share[8][2];
  uint32_t seeds;
  limb_seed_knot knot[3];
} filler;

static const filler FILLERS[LIMB_FILLERS] = {
    {"fat of the femoral triangle",
     {{-0.2, 0.02},
      {-0.05, 0.03},
      {0.05, 0.035},
      {0.15, 0.025},
      {0.25, 0.01},
      {0.45, 0.004},
      {0.6, 0},
      {3, 0}},
     2,
     {{-0.2, {{20, 0.8}, {40, 0.8}}},
      {0.1, {{22, 0.82}, {35, 0.75}}},
      {0.4, {{45, 0.66}, {55, 0.62}}}}},
    {"contents of the pelvis and perineum, subgluteal fat",
     {{-0.2, 0.36},
      {-0.1, 0.25},
      {0, 0.14},
      {0.06, 0.09},
      {0.12, 0.05},
      {0.18, 0.02},
      {0.24, 0},
      {5, 0}},
     3,
     {{-0.2, {{95, 0.6}, {65, 0.6}, {130, 0.7}}},
      {0, {{100, 0.8}, {85, 0.85}, {150, 0.7}}},
      {0.12, {{150, 0.5}, {170, 0.45}, {200, 0.42}}}}},
    {"popliteal fat",
     {{0.55, 0},
      {0.68, 0.03},
      {0.8, 0.1},
      {0.9, 0.2},
      {1, 0.2},
      {1.07, 0.1},
      {1.15, 0.02},
      {1.25, 0}},
     2,
     {{0.6, {{182, 0.5}, {195, 0.5}}},
      {0.9, {{180, 0.62}, {195, 0.62}}},
      {1.1, {{180, 0.6}, {192, 0.58}}}}},
    {"joint and fat pads of the knee",
     {{0.78, 0},
      {0.86, 0.03},
      {0.93, 0.16},
      {1, 0.36},
      {1.05, 0.3},
      {1.1, 0.1},
      {1.16, 0.01},
      {1.2, 0}},
     4,
     {{0.85, {{355, 0.65}, {5, 0.68}, {0, 0.6}, {350, 0.6}}},
      {0.95, {{0, 0.75}, {80, 0.85}, {280, 0.85}, {25, 0.8}}},
      {1.1, {{5, 0.8}, {90, 0.85}, {275, 0.85}, {340, 0.85}}}}},
    {"fat before the Achilles tendon",
     {{1.5, 0},
      {1.62, 0.04},
      {1.75, 0.12},
      {1.85, 0.22},
      {1.95, 0.36},
      {2, 0.42},
      {3, 0.42},
      {4, 0.42}},
     2,
     {{1.5, {{165, 0.8}, {195, 0.8}}},
      {1.75, {{185, 0.78}, {160, 0.8}}},
      {2, {{178, 0.6}, {200, 0.65}}}}}};

limb_compartment limb_cell_compartment(uint32_t cell) {
  SONDE_ASSERT(cell < LIMB_CELLS);
  return cell < SONDE_LIMB_MUSCLES ? limb_muscle_table[cell].compartment : LIMB_FILLING;
}

double limb_muscle_area(const sonde_limb_body *b, uint32_t muscle, double level) {
  SONDE_ASSERT(muscle < SONDE_LIMB_MUSCLES);
  const limb_muscle *m = &limb_muscle_table[muscle];
  double factor = limb_muscle_rule(b) * b->share[muscle];
  if (m->volume_cm3 <= 0) { // areas of a leg of 430 mm of thigh
    uint32_t rows = 1;
    while (rows < SONDE_COUNT_OF(m->area) && m->area[rows][0] > m->area[rows - 1][0]) ++rows;
    return factor * limb_through(&m->area[0][0], rows, 2, 1, level) * 1e-6 * 0.430 /
           b->thigh_length_m;
  }
  double u = (level - m->from) / (m->to - m->from);
  if (u <= 0 || u >= 1) return 0;
  double a = m->spread * (m->peak - m->from) / (m->to - m->from), c = m->spread - a;
  double length = (m->to - m->from) * (m->peak < 1 ? b->thigh_length_m : b->calf_length_m);
  double beta = exp(lgamma(a + 1) + lgamma(c + 1) - lgamma(a + c + 2));
  return factor * m->volume_cm3 * 1e-6 / (length * beta) * pow(u, a) * pow(1 - u, c);
}

// Adds the seeds of a cell in a row: polar places between two knots, x and y in mean radii.
static void place_seeds(const sonde_limb *limb, double level, const limb_seed_knot *knot,
                        uint32_t knots, uint32_t seeds, uint32_t row, uint32_t at) {
  struct limb_muscles *m = limb->muscles;
  SONDE_ASSERT(knots >= 1 && at + seeds <= LIMB_SEEDS);
  uint32_t i = 0;
  while (i + 2 < knots && knot[i + 1].level < level) ++i;
  const limb_seed_knot *a = &knot[i], *b = knots > 1 ? a + 1 : a;
  double u = b->level > a->level ? clamp((level - a->level) / (b->level - a->level), 0, 1) : 0;
  for (uint32_t s = 0; s < seeds; ++s) {
    double from = a->place[s][0] * SONDE_PI / 180, to = b->place[s][0] * SONDE_PI / 180;
    double fx = (1 - u) * a->place[s][1] * sin(from) + u * b->place[s][1] * sin(to);
    double fy = (1 - u) * a->place[s][1] * cos(from) + u * b->place[s][1] * cos(to);
    double angle = atan2(fx, fy);
    double r = limb_fascia_radius(limb, level, angle) / m->radius[row];
    m->seed[row][at + s].x = (float)(r * fx), m->seed[row][at + s].y = (float)(r * fy);
  }
}

enum { SAMPLES = 2400 };

typedef struct section {
  uint32_t count;
  float x[SAMPLES], y[SAMPLES]; // in mean radii
  float owned[SAMPLES];         // distance to the nearest cell: squared, less the weight
  double spacing, cell_area;    // in mean radii
} section;

// Points of a square grid within the fascia and outside bones and vessels.
static void sample_section(const sonde_limb *limb, double level, double radius, section *s) {
  sonde_vec3 c = limb_centre(limb, level);
  s->count = 0, s->spacing = 0.058, s->cell_area = s->spacing * s->spacing;
  for (double y = -1.7; y < 1.7; y += s->spacing)
    for (double x = -1.7; x < 1.7; x += s->spacing) {
      double r = radius * sqrt(x * x + y * y);
      if (r > limb_fascia_radius(limb, level, atan2(x, y))) continue;
      const double p[3] = {c.x + radius * x, c.y + radius * y, c.z};
      if (limb_bone_distance(limb, p, NULL) < 0) continue;
      if (limb->vessels && !limb_vessels_clear(limb->vessels, p) &&
          limb_vessels_bundle(limb->vessels, p) < 0)
        continue;
      SONDE_ASSERT(s->count < SAMPLES);
      s->x[s->count] = (float)x, s->y[s->count++] = (float)y;
    }
}

// Seeds of the cells that a row and its two neighbours know: the others own nothing between them.
typedef struct row_seeds {
  uint32_t count;
  uint8_t at[LIMB_SEEDS], cell[LIMB_SEEDS]; // in the row, of which cell
  bool cells[LIMB_CELLS];
} row_seeds;

// Area of every cell in mean radii squared. A sample at a boundary counts for both sides by its
// distance to it.
static void measure_cells(const struct limb_muscles *m, uint32_t row, const row_seeds *known,
                          section *s, double *area) {
  enum { LANES = 16 };
  float x[LIMB_SEEDS], y[LIMB_SEEDS], weight[LIMB_SEEDS], d[LIMB_SEEDS];
  const uint32_t all = (known->count + LANES - 1) / LANES * LANES;
  for (uint32_t k = 0; k < all; ++k) {
    const limb_seed *seed = k < known->count ? &m->seed[row][known->at[k]] : NULL;
    x[k] = seed ? seed->x : 0, y[k] = seed ? seed->y : 0;
    weight[k] = seed ? seed->weight : -1e6F;
  }
  memset(area, 0, LIMB_CELLS * sizeof *area);
  for (uint32_t i = 0; i < s->count; ++i) {
    float px = s->x[i], py = s->y[i], d1 = 1e30F, d2 = 1e30F;
    for (uint32_t k = 0; k < all; ++k) {
      float dx = px - x[k], dy = py - y[k];
      d[k] = dx * dx + dy * dy - weight[k];
    }
    uint32_t first = 0, second = 0;
    for (uint32_t k = 0; k < known->count; ++k) {
      if (d[k] >= d2) continue;
      if (d[k] < d1) {
        if (known->cell[k] != known->cell[first]) d2 = d1, second = first;
        d1 = d[k], first = k;
      } else if (known->cell[k] != known->cell[first]) {
        d2 = d[k], second = k;
      }
    }
    s->owned[i] = d1;
    float sx = x[first] - x[second], sy = y[first] - y[second];
    double apart = (double)sqrtf(sx * sx + sy * sy) + 1e-6;
    double part = 0.5 + 0.5 * (double)(d2 - d1) / apart / s->spacing;
    part = part < 1 ? part : 1;
    area[known->cell[first]] += part * s->cell_area;
    area[known->cell[second]] += (1 - part) * s->cell_area;
  }
}

// How much nearer a cell would have to be to own any sample, as measure_cells() found them.
static double lack_of(const struct limb_muscles *m, uint32_t row, uint32_t cell, const section *s) {
  double lack = INFINITY;
  for (uint32_t k = 0; k < m->seed_count; ++k) {
    if (m->cell_of[k] != cell) continue;
    const limb_seed *seed = &m->seed[row][k];
    float least = 1e30F;
    for (uint32_t i = 0; i < s->count; ++i) {
      float dx = s->x[i] - seed->x, dy = s->y[i] - seed->y;
      float d = dx * dx + dy * dy - seed->weight - s->owned[i];
      least = d < least ? d : least;
    }
    lack = fmin(lack, (double)least);
  }
  return lack;
}

static void set_weight(struct limb_muscles *m, uint32_t row, uint32_t cell, double by) {
  for (uint32_t k = 0; k < m->seed_count; ++k)
    if (m->cell_of[k] == cell) m->seed[row][k].weight += (float)by;
}

// Weights that give each cell its target: damped steps, each cell by its own error; an absent cell
// keeps the greatest weight at which it owns nothing.
static void solve_row(struct limb_muscles *m, uint32_t row, const row_seeds *known, section *s) {
  double unit = m->radius[row] * m->radius[row], area[LIMB_CELLS];
  double gain[LIMB_CELLS], before[LIMB_CELLS] = {0};
  for (uint32_t k = 0; k < LIMB_CELLS; ++k) gain[k] = 0.45;
  for (uint32_t pass = 0; pass < 70; ++pass) {
    measure_cells(m, row, known, s, area);
    double worst = 0;
    for (uint32_t k = 0; k < LIMB_CELLS; ++k) {
      double wanted = m->target[row][k] / unit, error = wanted - area[k];
      if (!known->cells[k]) continue;
      if (wanted <= 0) {
        // Absent: just out of every sample's reach; in the first pass at once.
        double out = lack_of(m, row, k, s) - 0.04;
        set_weight(m, row, k, area[k] > 0 ? -0.03 - 0.5 * area[k] : pass ? fmin(out, 0.1) : out);
        worst = fmax(worst, area[k] > 0 ? area[k] / 0.004 * 0.02 : 0);
        continue;
      }
      if (area[k] <= 0) {
        set_weight(m, row, k, lack_of(m, row, k, s) + 0.004);
        worst = 1;
        continue;
      }
      // The step shrinks when the error changes its sign and grows while it does not.
      gain[k] = fmin(fmax(gain[k] * (error * before[k] < 0 ? 0.5 : 1.15), 0.08), 1.2);
      before[k] = error;
      set_weight(m, row, k, clamp(gain[k] * error, -0.08, 0.08));
      worst = fmax(worst, fabs(error) / (wanted + 0.004));
    }
    if (worst < 0.008) break;
  }
  // What is absent goes entirely; its neighbours gain less than a sample.
  for (uint32_t pass = 0, owned = 1; pass < 40 && owned; ++pass) {
    measure_cells(m, row, known, s, area);
    owned = 0;
    for (uint32_t k = 0; k < LIMB_CELLS; ++k)
      if (known->cells[k] && m->target[row][k] <= 0 &&
          (area[k] > 0 || lack_of(m, row, k, s) < 0.03))
        set_weight(m, row, k, -0.02 - area[k]), owned = 1;
  }
  for (uint32_t k = 0; k < LIMB_CELLS; ++k) m->area[row][k] = area[k] * unit;
}

// Share of the section that fat of a kind takes by its table; little counts as none.
static double filler_share(uint32_t kind, double level) {
  double share = KNOTS(FILLERS[kind].share, 1, level);
  return share < 0.003 ? 0 : share;
}

// Makes one row of the diagram. Weights begin at those of the row `from` beside it, which is made
// already; a cell that this row does not know has a weight below all others. @param from `row`
// itself: all weights begin at 0
static void make_row(const sonde_limb *limb, uint32_t row, uint32_t from, section *s) {
  struct limb_muscles *m = limb->muscles;
  double level = LIMB_TOP + row * LIMB_CELL_STEP, mean = 0;
  for (uint32_t c = 0; c < LIMB_ANGLES; ++c)
    mean += limb_fascia_radius(limb, level, 2 * SONDE_PI * c / LIMB_ANGLES) / LIMB_ANGLES;
  m->radius[row] = mean;
  uint32_t at = 0;
  for (uint32_t c = 0; c < SONDE_LIMB_MUSCLES; at += limb_muscle_table[c++].seeds) {
    const limb_muscle *muscle = &limb_muscle_table[c];
    uint32_t knots = 1;
    while (knots < LIMB_SEED_KNOTS && muscle->knot[knots].place[0][1] > 0) ++knots;
    place_seeds(limb, level, muscle->knot, knots, muscle->seeds, row, at);
  }
  for (uint32_t c = 0; c < LIMB_FILLERS; at += FILLERS[c++].seeds)
    place_seeds(limb, level, FILLERS[c].knot, 3, FILLERS[c].seeds, row, at);
  row_seeds known = {0};
  for (uint32_t k = 0; k < m->seed_count; ++k) {
    const uint32_t c = m->cell_of[k], muscle = c < SONDE_LIMB_MUSCLES;
    for (int beside = -1; beside <= 1 && !known.cells[c]; ++beside) {
      double at_level = level + beside * LIMB_CELL_STEP;
      known.cells[c] = muscle ? limb_muscle_area(&limb->body, c, at_level) >= LEAST_AREA
                              : filler_share(c - SONDE_LIMB_MUSCLES, at_level) > 0;
    }
    if (known.cells[c]) known.at[known.count] = (uint8_t)k, known.cell[known.count++] = (uint8_t)c;
    m->seed[row][k].weight = !known.cells[c] ? -1 : row != from ? m->seed[from][k].weight : 0;
  }
  sample_section(limb, level, mean, s);
  // Areas of the row: muscles by their rule times a common scale, fat for its share and for what
  // muscle does not fill.
  double room = s->count * s->cell_area * mean * mean;
  double muscle = 0, share[LIMB_FILLERS], fat = 0;
  for (uint32_t k = 0; k < SONDE_LIMB_MUSCLES; ++k) {
    double area = limb_muscle_area(&limb->body, k, level);
    m->target[row][k] = area < LEAST_AREA ? 0 : area;
    muscle += m->target[row][k];
  }
  for (uint32_t k = 0; k < LIMB_FILLERS; ++k) {
    share[k] = filler_share(k, level);
    fat += share[k];
  }
  double scale = muscle > 0 ? (1 - fat) * room / muscle : 1;
  double elastic = fat - share[0]; // the fat of the femoral triangle keeps its share
  if (elastic > 0 && scale > MOST_SCALE) {
    double more = ((1 - share[0]) * room - MOST_SCALE * muscle) / (elastic * room);
    for (uint32_t k = 1; k < LIMB_FILLERS; ++k) share[k] *= more;
    scale = MOST_SCALE;
  }
  m->scale[row] = scale;
  for (uint32_t k = 0; k < SONDE_LIMB_MUSCLES; ++k) m->target[row][k] *= scale;
  for (uint32_t k = 0; k < LIMB_FILLERS; ++k)
    m->target[row][SONDE_LIMB_MUSCLES + k] = share[k] * room;
  solve_row(m, row, &known, s);
}

// From the middle row, which is made already, row by row to the ankle (way 0) or to the top (1).
static sonde_status make_rows(void *user, uint32_t worker, uint32_t way, const atomic_bool *stop,
                              sonde_error *error) {
  const sonde_limb *limb = user;
  section *s = SONDE_NEW(section, 1);
  (void)worker, (void)stop;
  if (!s) return sonde_fail_memory(error);
  if (way == 0)
    for (uint32_t row = MIDDLE_ROW; row + 1 < LIMB_CELL_ROWS; ++row)
      make_row(limb, row + 1, row, s);
  else
    for (uint32_t row = MIDDLE_ROW; row > 0; --row) make_row(limb, row - 1, row, s);
  sonde_free(s);
  return SONDE_OK;
}

sonde_status limb_muscles_make(sonde_limb *limb, sonde_error *error) {
  SONDE_ASSERT(limb && limb->bones && !limb->muscles);
  struct limb_muscles *m = limb->muscles = SONDE_NEW(struct limb_muscles, 1);
  section *s = SONDE_NEW(section, 1);
  if (!m || !s) {
    sonde_free(s);
    return sonde_fail_memory(error);
  }
  for (uint32_t c = 0; c < LIMB_CELLS; ++c) {
    uint32_t seeds =
        c < SONDE_LIMB_MUSCLES ? limb_muscle_table[c].seeds : FILLERS[c - SONDE_LIMB_MUSCLES].seeds;
    for (uint32_t k = 0; k < seeds; ++k) m->cell_of[m->seed_count++] = (uint8_t)c;
    SONDE_ASSERT(seeds >= 1 && m->seed_count <= LIMB_SEEDS);
  }
  make_row(limb, MIDDLE_ROW, MIDDLE_ROW, s);
  sonde_free(s);
  sonde_status status =
      sonde_parallel_run(2, sonde_parallel_workers(0, 2), make_rows, limb, NULL, "", error);
  for (uint32_t row = 0; row + 1 < LIMB_CELL_ROWS; ++row)
    for (uint32_t k = 0; k < m->seed_count; ++k) {
      uint32_t c = m->cell_of[k];
      if (m->target[row][c] > 0 || m->target[row + 1][c] > 0)
        m->active[row][m->active_count[row]++] = (uint8_t)k;
    }
  return status;
}

limb_row limb_row_at(const struct limb_muscles *m, double level) {
  SONDE_ASSERT(m);
  double at = clamp((level - LIMB_TOP) / LIMB_CELL_STEP, 0, LIMB_CELL_ROWS - 1.000001);
  limb_row r = {.row = (uint32_t)at};
  r.u = (float)(at - r.row);
  r.radius = (1 - r.u) * m->radius[r.row] + r.u * m->radius[r.row + 1];
  return r;
}

limb_cell limb_cell_at(const sonde_limb *limb, double level, double x, double y) {
  const struct limb_muscles *m = limb->muscles;
  const limb_row at = limb_row_at(m, level);
  float px = (float)(x / at.radius), py = (float)(y / at.radius), d1 = 1e30F, d2 = 1e30F;
  uint32_t first = 0, second = 0;
  float sx[2] = {0, 0}, sy[2] = {0, 0}; // places of the first and the second seed
  for (uint32_t i = 0; i < m->active_count[at.row]; ++i) {
    uint32_t k = m->active[at.row][i];
    float kx, ky, d = limb_seed_power(m, &at, k, px, py, &kx, &ky);
    if (d < d1) {
      if (m->cell_of[k] != m->cell_of[first]) d2 = d1, second = first, sx[1] = sx[0], sy[1] = sy[0];
      d1 = d, first = k, sx[0] = kx, sy[0] = ky;
    } else if (d < d2 && m->cell_of[k] != m->cell_of[first]) {
      d2 = d, second = k, sx[1] = kx, sy[1] = ky;
    }
  }
  double apart = hypot((double)(sx[0] - sx[1]), (double)(sy[0] - sy[1]));
  double boundary = d2 < 1e29F ? 0.5 * (d2 - d1) / (apart + 1e-6) * at.radius : INFINITY;
  return (limb_cell){m->cell_of[first], m->cell_of[second], boundary, first, at.row};
}

sonde_vec3 limb_fibre(const sonde_limb *limb, const limb_cell *cell, sonde_vec3 p) {
  const struct limb_muscles *m = limb->muscles;
  SONDE_ASSERT(m && cell->cell < SONDE_LIMB_MUSCLES);
  const limb_muscle *muscle = &limb_muscle_table[cell->cell];
  // Axis of the belly: from the seed in this row to the seed in the next.
  double level = LIMB_TOP + cell->row * LIMB_CELL_STEP, next = level + LIMB_CELL_STEP;
  const limb_seed *a = &m->seed[cell->row][cell->seed], *b = &m->seed[cell->row + 1][cell->seed];
  sonde_vec3 from = limb_centre(limb, level), to = limb_centre(limb, next);
  double ra = m->radius[cell->row], rb = m->radius[cell->row + 1];
  from.x += ra * a->x, from.y += ra * a->y, to.x += rb * b->x, to.y += rb * b->y;
  sonde_vec3 axis = v_unit(v_sub(to, from), vec3(0, 0, -1));
  // Tilt by the pennation towards the sheet that the fibres end on.
  sonde_vec3 centre = limb_centre(limb, limb_level(limb, p.z));
  sonde_vec3 out = v_unit(vec3(p.x - centre.x, p.y - centre.y, 0), vec3(0, 1, 0));
  double side = 1;
  if (muscle->pennate == LIMB_CENTRAL) {
    sonde_vec3 across = vec3(out.y, -out.x, 0);
    double u = (p.z - from.z) / (to.z - from.z);
    sonde_vec3 middle = v_lerp(from, to, u);
    side = v_dot(v_sub(p, middle), across) > 0 ? -1 : 1;
    out = across;
  } else if (muscle->pennate == LIMB_INWARD) {
    side = -1;
  } else if (muscle->pennate == LIMB_STRAP) {
    return axis;
  }
  sonde_vec3 tilt = v_unit(v_madd(out, -v_dot(out, axis), axis), out);
  double pennation = muscle->pennation_deg * SONDE_PI / 180;
  return v_add(v_scale(axis, cos(pennation)), v_scale(tilt, side * sin(pennation)));
}
