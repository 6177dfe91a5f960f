// Gates of the march: bounds of the coarse plane's fields over blocks of lines tell what is too far
// away to matter there. Between nodes fields are linear, so that bounds at the nodes hold.
#include "echo/gates.h"

#include "base/base.h"
#include "base/vector_records.h"

// What lies farther than this beyond what a vessel or a node draws changes no line nor its
// neighbours.
static const float margin_m = 1e-3f;
static const float most_place = 20.5f; // of a vessel, in semi-axes
// Of bodies without a rim: inside a cylinder's unit circle; of cusps besides within their length.
static const float cord_reach = 0.01f, cusp_reach = 0.43f;
// Of muscles' cells (kernel_muscles.h): how far their boundaries wind, half of the thickest one,
// and what single precision leaves of the powers.
static const float most_wind_mm = 0.7f, most_half_mm = 1.06f, power_error = 0.1f; // mm^2

// A coarse row, its fields side by side per node.
static void turn_row(const sonde_echo *echo, const tissue_job *job, uint32_t j, gate_row *to) {
  const float *from = echo->plane + j * SONDE_PLANE_COLUMNS;
  const size_t n = SONDE_PLANE_NODES;
  const uint32_t cells = map_field_at(job->vessels, job->lesions, 1);
  SONDE_ASSERT(j < echo->plane_rows);
  for (uint32_t v = 0; v < job->vessels; ++v)
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
      const float *at = from + vessel_field_at(v, VESSEL_SHORT) * n + i;
      for (uint32_t c = 0; c < 2; ++c) to->place[c][i][v] = at[c * n];
      to->place[2][i][v] = 0;
      to->half[i][v] = fminf(at[VESSEL_HALF_SHORT * n], at[VESSEL_HALF_LONG * n]);
    }
  for (uint32_t k = 0; k < job->bodies; ++k) {
    const tissue_body *it = &job->body[k];
    const bool node = it->kind == SONDE_TISSUE_NODE;
    const float half = fminf(fminf(it->half_m[0], it->half_m[1]), it->half_m[2]);
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
      const float *at = from + (cells + job->cells + BODY_FIELDS * k) * n + i;
      for (uint32_t c = 0; c < 3; ++c) to->place[c][i][job->vessels + k] = at[c * n];
      float *along = &to->place[2][i][job->vessels + k];
      *along = node ? *along : it->kind == SONDE_TISSUE_CUSPS ? 2 * *along - 1 : 0;
      to->half[i][job->vessels + k] = node ? half : 1;
    }
  }
  for (uint32_t k = 0; k < job->cells; ++k)
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) to->power[i][k] = from[(cells + k) * n + i];
}

// Of vessels and bodies those that come near to nodes, a bit each. The distance to a wall is at
// least that to a circle as wide as the section is thick.
static uint32_t find_things(const sonde_gates *g, uint32_t first, uint32_t last, uint32_t count) {
  uint32_t found = 0;
  SONDE_ASSERT(last < SONDE_PLANE_COLUMNS && count <= GATE_THINGS);
  for (uint32_t k = 0; k < count; k += 4) {
    const float_x4 none = vset_float_x4(0);
    float_x4 half = vset_float_x4(INFINITY), low[3] = {half, half, half},
             high[3] = {-half, -half, -half}, square = none;
    for (uint32_t i = first; i <= last; ++i)
      for (uint32_t row = 0; row < 2; ++row) {
        const gate_row *at = &g->turned[row];
        for (uint32_t c = 0; c < 3; ++c) {
          const float_x4 place = vload_float_x4(at->place[c][i] + k);
          low[c] = vmin(low[c], place), high[c] = vmax(high[c], place);
        }
        half = vmin(half, vload_float_x4(at->half[i] + k));
      }
    for (uint32_t c = 0; c < 3; ++c) {
      const float_x4 away = vmax(vmax(low[c], -high[c]), none);
      square += away * away;
    }
    const float_x4 place = vsqrt(square);
    found |= (uint32_t)vbits((place <= most_place) &
                             ((place - 1) * half <= vload_float_x4(g->reach + k)))
             << k;
  }
  return found & ((1u << count) - 1);
}

// Cells whose seeds may have the least power at some nodes, or the least beside another cell: as
// near as those that have it in the middle. One cell where no boundary is near.
static uint32_t find_cells(const sonde_gates *g, uint32_t first, uint32_t last, uint32_t count) {
  SONDE_ASSERT(count > 0 && count <= MOST_CELLS);
  const float *middle = g->turned[0].power[(first + last) / 2];
  uint32_t own = 0, other = count, found = 0, near = 0;
  for (uint32_t k = 1; k < count; ++k)
    if (middle[k] < middle[own]) own = k;
  for (uint32_t k = 0; k < count; ++k)
    if (g->cell_number[k] != g->cell_number[own] && (other == count || middle[k] < middle[other]))
      other = k;
  const bool alone = other == count;
  if (alone) other = own;
  for (uint32_t k = 0; k < count; k += 4) {
    float_x4 from_own = vset_float_x4(INFINITY), from_other = from_own;
    for (uint32_t i = first; i <= last; ++i)
      for (uint32_t row = 0; row < 2; ++row) {
        const float *at = g->turned[row].power[i];
        const float_x4 power = vload_float_x4(at + k);
        from_own = vmin(from_own, power - at[own]);
        from_other = vmin(from_other, power - at[other]);
      }
    const float_x4 x = vload_float_x4(g->cell_x + k), y = vload_float_x4(g->cell_y + k);
    const float_x4 dx = vabs(x - g->cell_x[own]), dy = vabs(y - g->cell_y[own]);
    const float_x4 wind = 2 * most_wind_mm * (dx + dy) + power_error;
    const float_x4 far =
        2 * most_wind_mm * (vabs(x - g->cell_x[other]) + vabs(y - g->cell_y[other])) + power_error;
    const int_x4 same = vload_float_x4(g->cell_number + k) == g->cell_number[own];
    const int_x4 least = from_own <= wind, second = from_other <= far;
    const int_x4 edge = from_own <= wind + 2 * most_half_mm * vsqrt(dx * dx + dy * dy);
    found |= (uint32_t)vbits(least | (second & ~same)) << k;
    near |= (uint32_t)vbits((same & least) | (edge & ~same)) << k;
  }
  const uint32_t all = (1u << count) - 1, self = 1u << own;
  return (near & all & ~self) == 0 ? self : (found & all) | self;
}

// The bits of a set as numbers.
static uint8_t list_of(uint32_t set, uint8_t *list) {
  uint8_t count = 0;
  for (uint8_t k = 0; set >> k; ++k)
    if (set >> k & 1) list[count++] = k;
  return count;
}

void sonde_gates_find(sonde_echo *echo, const tissue_job *job, uint32_t j) {
  sonde_gates *g = echo->gates;
  SONDE_ASSERT(j + 1 < echo->plane_rows && job->lines <= SONDE_MOST_LINES);
  SONDE_ASSERT(job->vessels <= MOST_VESSELS && job->bodies <= MOST_BODIES);
  if (j == 0) { // what is the same in all rows, and the first one
    for (uint32_t v = 0; v < job->vessels; ++v)
      g->reach[v] = job->vessel[v].wall_m + job->vessel[v].sheath_m + margin_m;
    for (uint32_t k = 0; k < job->bodies; ++k) {
      const sonde_tissue kind = job->body[k].kind;
      g->reach[job->vessels + k] = kind == SONDE_TISSUE_NODE    ? margin_m
                                   : kind == SONDE_TISSUE_CUSPS ? cusp_reach
                                                                : cord_reach;
    }
    for (uint32_t k = 0; k < job->cells; ++k)
      g->cell_x[k] = job->cell[k].x_mm, g->cell_y[k] = job->cell[k].y_mm,
      g->cell_number[k] = job->cell[k].cell;
    turn_row(echo, job, 0, &g->turned[0]);
  }
  turn_row(echo, job, j + 1, &g->turned[(j + 1) % 2]);
  g->vessels = g->cells = g->bodies = 0;
  for (uint32_t l = 0; l < job->lines; l += ECHO_ALIGN) {
    const uint32_t end = l + ECHO_ALIGN - 1;
    const int32_t *top = g->column[0], *low = g->column[1];
    const uint32_t first = (uint32_t)(top[l] < low[l] ? top[l] : low[l]);
    const uint32_t last = (uint32_t)(top[end] > low[end] ? top[end] : low[end]) + 1;
    tissue_gate *gate = &g->block[l / ECHO_ALIGN];
    const uint32_t things = find_things(g, first, last, job->vessels + job->bodies);
    const uint32_t vessels = things & ((1u << job->vessels) - 1), bodies = things >> job->vessels;
    gate->vessels = list_of(vessels, gate->vessel), gate->bodies = list_of(bodies, gate->body);
    g->vessels |= vessels, g->bodies |= bodies;
    // Depth below the muscles' fascia of the deepest of these places: negative, none is in muscle.
    const float *field = echo->plane + j * SONDE_PLANE_COLUMNS;
    float inside = -INFINITY;
    for (uint32_t i = first; i <= last; ++i)
      for (uint32_t row = 0; row < 2; ++row) {
        const float *at = field + row * SONDE_PLANE_COLUMNS + i;
        inside = fmaxf(inside,
                       at[PLANE_DEPTH * SONDE_PLANE_NODES] - at[PLANE_MUSCLE * SONDE_PLANE_NODES]);
      }
    gate->cells = 0;
    if (job->plain || job->cells == 0 || inside < -margin_m) continue;
    const uint32_t cells = find_cells(g, first, last, job->cells);
    gate->cells = list_of(cells, gate->cell);
    if (gate->cells > 1) g->cells |= cells;
  }
}
