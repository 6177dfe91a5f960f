// The muscle that a point of the picture belongs to, by the powers of the cells' seeds, and what
// parts it from the next one. Included by kernel_tissue.h only.
#ifndef SONDE_SRC_ECHO_KERNEL_MUSCLES_H
#define SONDE_SRC_ECHO_KERNEL_MUSCLES_H

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_texture.h"

// Epimysium and septa: half thickness, m, and brightness when the beam meets them squarely.
static const float epimysium_m = 0.45e-3f, septum_m = 0.7e-3f;
static const float epimysium_scatter = 1.6f, septum_scatter = 2.6f, grazing = 0.2f;

// The muscle that a point belongs to, and what parts it from the next one.
typedef struct muscle_place {
  ints which;    // of the cells
  floats bright; // of its boundary there
} muscle_place;

// Boundaries wind by so many mm.
static const float winding_mm = 0.7f;

// A point lies in the cell whose seed has the least power there. The boundary with the cell of the
// next power is half the difference of both powers over the distance of both seeds away. A step d
// of the point adds -2 d.c to the power of a seed at c, apart from what it adds to all.
INLINE muscle_place place_in_muscles(const tissue_job *job, const tissue_gate *gate, knots *memory,
                                     uint32_t field, floats theta, floats s, floats depth) {
  const uint32_t n = job->lines;
  muscle_place at = {vset_ints(gate->cell[0]), vset(0)};
  if (gate->cells == 1) return at; // no other one can be as near as its boundary is thick
  floats least = vset(1e30f), next = vset(1e30f), cell = vset(-1);
  floats x = vset(0), y = vset(0), next_x = vset(0), next_y = vset(0);
  floats section = vset(0), next_section = vset(0);
  floats wind_x = texture(memory, theta, s * 120, depth * 220, TURNS_FAT, 2);
  floats wind_y = texture(memory, theta, s * 140, depth * 250, TURNS_FAT, 3);
  wind_x = wind_x * (-2 * winding_mm), wind_y = wind_y * (-2 * winding_mm);
  for (uint32_t i = 0; i < gate->cells; ++i) {
    const uint32_t k = gate->cell[i];
    const tissue_cell *c = &job->cell[k];
    const floats power = field_at(job, field + k * n) + (wind_x * c->x_mm + wind_y * c->y_mm);
    const ints own = cell == c->cell, first = power < least;
    // When this seed has the least power so far, the cell that had it before becomes the next one.
    const ints pushed = first & ~own, second = ~first & ~own & (power < next);
    next = vselect(pushed, least, next), next_x = vselect(pushed, x, next_x);
    next_y = vselect(pushed, y, next_y), next_section = vselect(pushed, section, next_section);
    next = vselect(second, power, next), next_x = vselect(second, vset(c->x_mm), next_x);
    next_y = vselect(second, vset(c->y_mm), next_y);
    next_section = vselect(second, vset(c->section), next_section);
    least = vselect(first, power, least), cell = vselect(first, vset(c->cell), cell);
    x = vselect(first, vset(c->x_mm), x), y = vselect(first, vset(c->y_mm), y);
    section = vselect(first, vset(c->section), section);
    at.which = vselect(first, vset_ints((int32_t)k), at.which);
  }
  floats dx = x - next_x, dy = y - next_y, apart = vsqrt(dx * dx + dy * dy) + 1e-3f;
  floats away = (next - least) * 0.5e-3f / apart; // m
  ints parted = section != next_section;
  floats patch = texture(memory, theta, s * 160, depth * 400, 2 * TURNS_FAT, 5);
  floats half = vselect(parted, vset(septum_m), vset(epimysium_m)) * (1 + 0.5f * patch);
  floats height = vmax(1 - away / half, vset(0));
  floats square = (dx * job->beam_x + dy * job->beam_y) / apart;
  floats facing = grazing + (1 - grazing) * square * square;
  at.bright = height * facing * (0.75f + 0.7f * patch) *
              vselect(parted, vset(septum_scatter), vset(epimysium_scatter));
  return at;
}

// A fact of each lane's cell. Most vectors lie in one cell.
INLINE floats cell_fact_at(const tissue_job *job, cell_fact which, ints cell, bool one) {
  return one ? vset(job->fact[which][cell[0]]) : vgather(job->fact[which], cell);
}

// Muscle's tile along the fibres of each lane's cell: 26 tiles around the leg, of 51 mm along it
// and 16 mm down.
INLINE tile_grain muscle_grain(const tissue_job *job, ints cell, bool one, floats theta, floats s,
                               floats depth) {
  const float around = 26 * SONDE_TILE_SIDE * 0.159154943f;
  floats lean = cell_fact_at(job, CELL_LEAN, cell, one);
  floats x = theta * around + cell_fact_at(job, CELL_SHIFT, cell, one);
  floats y = s * 1250 + cell_fact_at(job, (cell_fact)(CELL_SHIFT + 1), cell, one);
  floats z = (depth + lean * s) * 4000 + cell_fact_at(job, (cell_fact)(CELL_SHIFT + 2), cell, one);
  return tile_at(job->tile[1], x, y, z);
}

#endif
