// The muscle that a point of the picture belongs to, by the powers of the cells' seeds, and what
// parts it from the next one. Included by kernel_tissue.h only.
#ifndef SONDE_SRC_ECHO_KERNEL_MUSCLES_H
#define SONDE_SRC_ECHO_KERNEL_MUSCLES_H

#include "base/base.h"
#include "echo/kernel.h"

// Epimysium and septa: half thickness, m, and brightness when the beam meets them squarely.
static const float epimysium_m = 0.45e-3f, septum_m = 0.7e-3f;
static const float epimysium_scatter = 1.3f, septum_scatter = 2.2f, grazing = 0.25f;

// The muscle that a point belongs to, and what parts it from the next one.
typedef struct muscle_place {
  floats muscle, lean, turn, gain; // of the cell
  floats bright;                   // of its boundary there
} muscle_place;

// A point lies in the cell whose seed has the least power there. The boundary with the cell of the
// next power is half the difference of both powers over the distance of both seeds away.
INLINE muscle_place place_in_muscles(const tissue_job *job, const float *field) {
  const uint32_t n = job->lines;
  floats least = vset(1e30f), next = vset(1e30f), cell = vset(-1);
  floats x = vset(0), y = vset(0), next_x = vset(0), next_y = vset(0);
  floats section = vset(0), next_section = vset(0);
  muscle_place at = {vset(1), vset(0), vset(0), vset(1), vset(0)};
  for (uint32_t k = 0; k < job->cells; ++k) {
    const tissue_cell *c = &job->cell[k];
    const floats power = vload(field + k * n);
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
    at.muscle = vselect(first, vset(c->muscle), at.muscle);
    at.lean = vselect(first, vset(c->lean), at.lean);
    at.turn = vselect(first, vset(c->turn), at.turn);
    at.gain = vselect(first, vset(c->gain), at.gain);
  }
  floats dx = x - next_x, dy = y - next_y, apart = vsqrt(dx * dx + dy * dy) + 1e-3f;
  floats away = (next - least) * 0.5e-3f / apart; // m
  ints septum = section != next_section;
  floats half = vselect(septum, vset(septum_m), vset(epimysium_m));
  floats height = vmax(1 - away / half, vset(0));
  floats square = (dx * job->beam_x + dy * job->beam_y) / apart;
  floats facing = grazing + (1 - grazing) * square * square;
  at.bright = height * facing * vselect(septum, vset(septum_scatter), vset(epimysium_scatter));
  return at;
}

#endif
