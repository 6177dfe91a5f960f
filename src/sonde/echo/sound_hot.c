// Sound speeds: rays that bend, depths that time tells, and the tables from true to drawn places.
//
// A ray follows the paraxial law theta' = -d(ln c)/dx, x' = theta; it is drawn at the depth that
// its time of travel has at the assumed speed. Speeds are means over the beam's width there.
#include "echo/sound.h"

#include "base/base.h"
#include "echo/gates.h"

// Speeds of sound, m/s, and densities, kg/m^3 (IT'IS database of tissue properties 4.1; fat and
// muscle: means of Duck, Physical Properties of Tissue, 1990).
typedef struct medium {
  float speed, density;
} medium;
static const medium skin = {1624, 1109}, fat = {1440, 911}, muscle = {1580, 1090},
                    blood = {1578, 1050}, fluid = {1525, 1005};
static const float septum_m =
    0.2e-3f; // thickness of the fat's septa, which are of the dermis's tissue

// The beam that a structure bends aims at the focus, and at least so much deeper than it.
static const float least_aim_m = 8e-3f;
static const float least_gap = 0.25f;                     // of two neighbouring rays, lines
static const float least_spread = 0.25f, most_spread = 2; // -12 and +6 dB

static float row_m(const sonde_echo *echo) {
  return (float)(echo->frame.reach_m / (SONDE_MEDIUM_ROWS - 1));
}

// Lines per metre across them at a depth.
static float lines_per_m(const frame *f, float depth_m) {
  float wider = f->radius_m > 0 ? 1 + depth_m / (float)f->radius_m : 1;
  return 1 / ((float)f->pitch_m * wider);
}

void sonde_sound_begin(sonde_echo *echo) {
  sonde_sound *s = echo->sound;
  SONDE_ASSERT(echo->padded <= SONDE_MOST_LINES);
  s->line = s->wide_line + SOUND_MARGIN, s->slow = s->wide_slow + SOUND_MARGIN;
  for (uint32_t l = 0; l < echo->padded; ++l) {
    s->line[l] = (float)(l < echo->lines ? l : echo->lines - 1);
    s->turn[l] = s->shown[l] = s->before[l] = s->mean[l] = 0;
    s->slow[l] = 0, s->spread[l] = 1, s->next[l / 4] = 0;
  }
  echo->gates->vessels = UINT32_MAX;
}

void sonde_sound_aim(sonde_echo *echo, uint32_t which, float rows_on) {
  const sonde_sound *s = echo->sound;
  const float on = rows_on * row_m(echo) * lines_per_m(&echo->frame, s->shown[0]);
  const float edge = (float)echo->frame.edge_lines, scale = (float)(1 / echo->lines_per_column);
  float last = 0;
  for (uint32_t l = 0; l < echo->padded; ++l) {
    const float x = fminf((edge + s->line[l] + on * s->turn[l]) * scale, SONDE_PLANE_COLUMNS - 1);
    last = fmaxf(x, last); // ascending
    const uint32_t i =
        (uint32_t)last < SONDE_PLANE_COLUMNS - 2 ? (uint32_t)last : SONDE_PLANE_COLUMNS - 2;
    echo->gates->column[which][l] = (int32_t)i, echo->gates->share[which][l] = last - (float)i;
  }
}

// Slowness of the row: the tissues' shares of a step about it, from the levels' distances.
static void find_slowness(sonde_echo *echo, uint32_t row) {
  sonde_sound *s = echo->sound;
  const uint32_t n = echo->padded, walls = LAYER_LEVELS, edges = walls + echo->shown_count;
  const float *level = echo->level[row % 2];
  const float per_row = 1 / row_m(echo), all = (float)echo->scanner.sound_speeds;
  const float c0 = (float)sonde_sound_m_s;
  const sonde_lesion *lesion = echo->interior->findings.lesion;
  // What lies beyond each level, and the side of it: 1 where the level is positive.
  struct {
    uint32_t level;
    float side, slow;
  } part[2 + MOST_LESIONS + MOST_VESSELS];
  uint32_t parts = 0;
  part[parts].level = 1, part[parts].side = 1, part[parts++].slow = c0 / fat.speed;
  part[parts].level = 2, part[parts].side = 1, part[parts++].slow = c0 / muscle.speed;
  for (uint32_t k = 0; k < echo->lesion_count; ++k) {
    const bool cyst = (int)lesion[echo->lesion[k]].kind == (int)TISSUE_CYST;
    part[parts].level = edges + k, part[parts].side = -1;
    part[parts++].slow = c0 / (cyst ? fluid.speed : blood.speed);
  }
  for (uint32_t k = walls; k < edges; ++k) {
    if (!(echo->gates->vessels >> (k - walls) & 1)) continue;
    part[parts].level = k, part[parts].side = -1, part[parts++].slow = c0 / blood.speed;
  }
  const float_x4 none = vset_float_x4(0), one = vset_float_x4(1);
  // The fat's septa are thinner than a row is deep, which they fill in part.
  const float *septum = echo->septum[row % 2], *strength = echo->septum[2];
  const float tough_slow = c0 / skin.speed;
  for (uint32_t l = 0; l < n; l += 4) {
    float_x4 slow = vset_float_x4(c0 / skin.speed);
    for (uint32_t k = 0; k < parts; ++k) {
      const float_x4 rows = part[k].side * per_row * vload_float_x4(level + part[k].level * n + l);
      slow += vmin(vmax(rows + 0.5f, none), one) * (part[k].slow - slow);
    }
    const float_x4 thick = septum_m * per_row * vload_float_x4(strength + l);
    const float_x4 reach = 0.5f * (thick + 1) - per_row * vabs(vload_float_x4(septum + l));
    slow += vmin(vmax(reach, none), vmin(thick, one)) * (tough_slow - slow);
    const float_x4 inside = vmin(vmax(per_row * vload_float_x4(level + l) + 0.5f, none), one);
    vstore_float_x4(s->slow + l, all * inside * (slow - 1));
  }
}

// Rays do not cross: half-way between pushing them apart from the left and from the right.
static void part_rays(float *line, uint32_t lines) {
  float pushed[SONDE_MOST_LINES];
  SONDE_ASSERT(lines > 0 && lines <= SONDE_MOST_LINES);
  pushed[0] = line[0];
  for (uint32_t l = 1; l < lines; ++l) {
    const float least = pushed[l - 1] + least_gap;
    pushed[l] = line[l] < least ? least : line[l];
  }
  for (uint32_t l = lines - 1; l-- > 0;)
    if (line[l] > line[l + 1] - least_gap) line[l] = line[l + 1] - least_gap;
  for (uint32_t l = 0; l < lines; ++l) line[l] = 0.5f * (line[l] + pushed[l]);
}

void sonde_sound_step(sonde_echo *echo, uint32_t row) {
  sonde_sound *s = echo->sound;
  const frame *f = &echo->frame;
  const uint32_t lines = echo->lines;
  const float dz = row_m(echo), z = (float)row * dz, per_m = lines_per_m(f, z);
  find_slowness(echo, row);
  // Half the beam's width here, lines.
  const double number = 0.5 * (f->scanner->transmit_f + f->scanner->receive_f);
  const float aim = fmaxf((float)f->focus_m, z + least_aim_m);
  const float wide = fmaxf((aim - z) / (float)(2 * number) * per_m + 0.5f, 1);
  const int half = (int)fminf(wide, SOUND_MARGIN), padded = (int)echo->padded;
  // Rays and times to this row, then the turns that the row itself adds.
  int_x4 crossed = {0};
  for (uint32_t l = 0; row > 0 && l < lines; l += 4)
    vstore_float_x4(s->line + l,
                    vload_float_x4(s->line + l) + dz * per_m * vload_float_x4(s->turn + l));
  for (uint32_t l = 0; l + 1 < lines; l += 4)
    crossed |= vload_float_x4(s->line + l + 1) - vload_float_x4(s->line + l) < least_gap;
  if (vany(crossed)) part_rays(s->line, lines);
  float wide_sum[SOUND_WIDE + 1], *sum = wide_sum + SOUND_MARGIN;
  for (int l = -half; l <= half; ++l) {
    const int end = (int)lines - 1 + l;
    if (l < 0) s->slow[l] = s->slow[0], s->line[l] = s->line[0] + (float)l;
    if (l > 0) s->slow[end] = s->slow[lines - 1], s->line[end] = s->line[lines - 1] + (float)l;
  }
  sum[-half] = 0;
  for (int l = -half; l < padded + half; ++l) sum[l + 1] = sum[l] + s->slow[l];
  const float unbend = f->radius_m > 0 ? 1 - dz / ((float)f->radius_m + z) : 1;
  const float_x4 share = vset_float_x4(1 / (float)(2 * half + 1));
  for (int l = 0; l < padded; l += 4) {
    const float_x4 mean =
        share * (vload_float_x4(sum + l + half + 1) - vload_float_x4(sum + l - half));
    const float_x4 shown = vload_float_x4(s->shown + l), turn = vload_float_x4(s->turn + l);
    const float_x4 apart = vload_float_x4(s->line + l + half) - vload_float_x4(s->line + l - half);
    const float_x4 step = vload_float_x4(s->slow + l + half) - vload_float_x4(s->slow + l - half);
    const float_x4 time = 1 + 0.5f * (vload_float_x4(s->mean + l) + mean);
    const float_x4 near = vload_float_x4(s->line + l + 1) - vload_float_x4(s->line + l - 1);
    vstore_float_x4(s->before + l, shown);
    if (row > 0) vstore_float_x4(s->shown + l, shown + dz * time * (1 + 0.5f * turn * turn));
    vstore_float_x4(s->mean + l, mean);
    vstore_float_x4(s->turn + l, unbend * (turn + dz * per_m * step / ((1 + mean) * apart)));
    vstore_float_x4(s->spread + l,
                    vmin(vmax(2 / near, vset_float_x4(least_spread)), vset_float_x4(most_spread)));
  }
  float *way = s->trace_slow[row / SOUND_EVERY] + SOUND_MARGIN;
  const float keep = row % SOUND_EVERY ? 1 : 0;
  for (uint32_t l = 0; l < lines; l += 4)
    vstore_float_x4(way + l, keep * vload_float_x4(way + l) + dz * vload_float_x4(s->slow + l));
  if (row % SOUND_EVERY == 0)
    for (uint32_t l = 0; l < echo->padded; ++l) {
      s->trace_line[row / SOUND_EVERY][l] = s->line[l];
      s->trace_shown[row / SOUND_EVERY][l] = s->shown[l];
    }
}

float sonde_sound_passage_db(const sonde_echo *echo, uint32_t level, float cosine) {
  const uint32_t edges = LAYER_LEVELS + echo->shown_count;
  const medium *above = &muscle, *below = &blood;
  if (level == 0 || level == 3 || level == 4) return 0; // coupled, opaque, or fat on both sides
  if (level == 1) above = &skin, below = &fat;
  if (level == 2) above = &fat, below = &muscle;
  if (level >= edges) below = &fluid;
  // Fresnel's coefficient of pressure with Snell's angle; nothing passes beyond the critical one.
  const float c = fminf(fmaxf(cosine, 0.05f), 1), ratio = below->speed / above->speed;
  const float sine = ratio * sqrtf(1 - c * c), across = sqrtf(fmaxf(1 - sine * sine, 1e-4f));
  const float z1 = above->speed * above->density / c, z2 = below->speed * below->density / across;
  const float r = (z2 - z1) / (z2 + z1);
  return (float)echo->scanner.sound_speeds * -20 * log10f(fmaxf(1 - r * r, least_spread));
}

float sonde_sound_depth(const sonde_echo *echo, uint32_t line, float share, float *rise_m) {
  const sonde_sound *s = echo->sound;
  const uint32_t left = line > 0 ? line - 1 : line;
  const uint32_t right = line + 1 < echo->lines ? line + 1 : line;
  const float step = s->shown[line] - s->before[line];
  const float across = (s->before[right] - s->before[left]) / (float)(right - left);
  *rise_m = *rise_m * (step / row_m(echo)) + across / SONDE_FINE;
  return s->before[line] + share * step;
}

// Four lines at a time, when all of them have passed a row.
void sonde_sound_draw_gain(sonde_echo *echo, uint32_t row) {
  sonde_sound *s = echo->sound;
  const float step = (float)(echo->frame.depth_m / (SONDE_MEDIUM_ROWS - 1));
  const float *now = s->gain[row % 2], *above = row > 0 ? s->gain[(row + 1) % 2] : now;
  float *gain = echo->gain + echo->pad_lines / SONDE_FINE;
  const bool last = row + 1 == SONDE_MEDIUM_ROWS;
  for (uint32_t l = 0; l < echo->padded; l += 4) {
    const float_x4 shown = vload_float_x4(s->shown + l), before = vload_float_x4(s->before + l);
    const float least = fminf(fminf(shown[0], shown[1]), fminf(shown[2], shown[3]));
    uint32_t next = s->next[l / 4];
    for (; next < SONDE_MEDIUM_ROWS && (last || (float)next * step <= least); ++next) {
      const float_x4 on =
          ((float)next * step - before) / vmax(shown - before, vset_float_x4(1e-9f));
      const float_x4 share = vmin(vmax(on, vset_float_x4(0)), vset_float_x4(1));
      const float_x4 from = vload_float_x4(above + l);
      vstore_float_x4(gain + (size_t)next * echo->gain_stride + l,
                      from + share * (vload_float_x4(now + l) - from));
    }
    s->next[l / 4] = next;
  }
}

void sonde_sound_end(sonde_echo *echo) {
  sonde_sound *s = echo->sound;
  const frame *f = &echo->frame;
  const uint32_t columns = echo->grid_lines / SHIFT_STEP + 2, last = echo->lines - 1;
  SONDE_ASSERT(columns <= SHIFT_COLUMNS && last > 0);
  for (uint32_t row = 0; row < SOUND_ROWS; ++row) {
    const float *ray = s->trace_line[row], *shown = s->trace_shown[row];
    const float z = (float)(row * SOUND_EVERY) * row_m(echo);
    uint32_t l = 0;
    for (uint32_t i = 0; i < columns; ++i) {
      const float at = (float)(i * SHIFT_STEP) / SONDE_FINE - (float)f->edge_lines;
      while (l + 2 < echo->lines && ray[l + 1] < at) ++l;
      // Beyond the outer rays their shift goes on.
      const float t = fminf(fmaxf((at - ray[l]) / (ray[l + 1] - ray[l]), 0), 1);
      const float beyond = at < ray[0] ? at - ray[0] : at > ray[last] ? at - ray[last] : 0;
      s->shift[row][i] =
          (float_x4){SONDE_FINE * ((float)l + t + beyond - at), 0,
                     (shown[l] + t * (shown[l + 1] - shown[l]) - z) / (float)f->step_m, 0};
    }
  }
}

void sonde_sound_true_place(const sonde_echo *echo, double *line, double *depth_m) {
  const sonde_sound *s = echo->sound;
  const uint32_t last = echo->lines - 2, l = *line < last ? (uint32_t)fmax(*line, 0) : last;
  const double t = clamp(*line - l, 0, 1);
  // The first row of the table drawn as deep.
  uint32_t row = 1;
  const float *shown = s->trace_shown[row] + l;
  while (row + 1 < SOUND_ROWS &&
         (double)shown[0] + t * ((double)shown[1] - (double)shown[0]) < *depth_m)
    shown = s->trace_shown[++row] + l;
  const double here = (double)shown[0] + t * ((double)shown[1] - (double)shown[0]);
  shown = s->trace_shown[row - 1] + l;
  const double above = (double)shown[0] + t * ((double)shown[1] - (double)shown[0]);
  const double share = here > above ? (*depth_m - above) / (here - above) : 0;
  const float *top = s->trace_line[row - 1] + l, *low = s->trace_line[row] + l;
  const double from = (double)top[0] + t * ((double)top[1] - (double)top[0]);
  const double to = (double)low[0] + t * ((double)low[1] - (double)low[0]);
  *depth_m = (row - 1 + share) * SOUND_EVERY * (double)row_m(echo);
  *line = from + share * (to - from);
}

void sonde_sound_move(const sonde_echo *echo, splat_map *map) {
  const sonde_sound *s = echo->sound;
  const float per_row = (float)(echo->frame.step_m / (SOUND_EVERY * (double)row_m(echo)));
  const float u = fmaxf(map->m[0][0] / SHIFT_STEP, 0);
  const float v = fmaxf((map->m[0][2] - (float)echo->pad_samples) * per_row, 0);
  const uint32_t most = echo->grid_lines / SHIFT_STEP;
  const uint32_t i = (uint32_t)u < most ? (uint32_t)u : most;
  const uint32_t j = (uint32_t)v < SOUND_ROWS - 2 ? (uint32_t)v : SOUND_ROWS - 2;
  const float a = fminf(u - (float)i, 1), b = fminf(v - (float)j, 1);
  const float_x4 *top = &s->shift[j][i], *low = &s->shift[j + 1][i];
  const float_x4 left = top[0] + b * (low[0] - top[0]), right = top[1] + b * (low[1] - top[1]);
  const float_x4 over = top[0] + a * (top[1] - top[0]), under = low[0] + a * (low[1] - low[0]);
  const float_x4 across = (right - left) * (1.0f / SHIFT_STEP), down = (under - over) * per_row;
  const float amplitude = map->m[0][3];
  for (int k = 1; k < 4; ++k) {
    const float_x4 m = vload_float_x4(map->m[k]);
    vstore_float_x4(map->m[k], m + m[0] * across + m[2] * down);
  }
  vstore_float_x4(map->m[0], vload_float_x4(map->m[0]) + over + b * (under - over));
  map->m[0][3] = amplitude;
}
