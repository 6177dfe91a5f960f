// Vessels along one row of the march: walls, lumina, clot.
// Included by kernel_tissue.h only.
#ifndef SONDE_SRC_ECHO_KERNEL_VESSELS_H
#define SONDE_SRC_ECHO_KERNEL_VESSELS_H

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_texture.h"
#include "echo/kernel_bodies.h"
#include "interior/clot.h"

// Backscatter over muscle (amplitude) and attenuation (dB/m/MHz one way); docs/echo.md.
static const float wall_tissue[2] = {1.9f, 110}, blood_tissue[2] = {0.06f, 18};
static const float wall_body = 0.5f; // of a vessel's wall along the beam

// Signed distance over the row, metres (negative inside): to first order (F - 1)/|grad F| of the
// ellipse F = 1.
INLINE floats wall_distance(floats a, floats b, floats half_a, floats half_b) {
  floats square = a * a + b * b, size = vsqrt(square);
  floats ga = a / half_a, gb = b / half_b, steep = vsqrt(ga * ga + gb * gb);
  floats distance = vselect(steep > 1e-3f, (size - 1) * size / vmax(steep, vset(1e-3f)), -half_a);
  floats beyond = (vabs(b) - 1) * half_b; // bounds the estimate beside a flat ellipse's tips
  distance = vselect((beyond > 0) & (beyond > distance), beyond, distance);
  return vselect(square > 400, vset(1), distance);
}

// sonde_clot_surface() for a vector of places.
INLINE floats clot_surface(uint32_t vessel, floats along, floats across) {
  floats sum = clot_bend * (clot_level - across * across), c, s;
  for (uint32_t k = 0; k < CLOT_WAVES; ++k) {
    const clot_wave *w = &clot_waves[k];
    floats turns = w->across * across + w->per_m * along + sonde_clot_start(vessel, k);
    turn(turns - vfloor(turns), &c, &s);
    sum += w->height * c;
  }
  return sum;
}

// sonde_clot_depth() for a vector of places.
INLINE floats clot_depth(sonde_clot_form form, float solid, uint32_t vessel, floats along, floats a,
                         floats b) {
  if (form == SONDE_CLOT_MURAL) return -a - (1 - 2 * solid) - clot_surface(vessel, along, b);
  floats turns = clot_winds_per_m * along + sonde_clot_start(vessel, 0), c, s;
  turn(turns - vfloor(turns), &c, &s);
  if (form == SONDE_CLOT_FLOATING) {
    const float radius = __builtin_sqrtf(solid), off = clot_wanders[0] * (1 - radius);
    const floats x = a - off * c, y = b - off * s;
    return radius - vsqrt(x * x + y * y);
  }
  const float open = 1 - solid, one = __builtin_sqrtf(clot_wide_share * open),
              other = __builtin_sqrtf((1 - clot_wide_share) * open);
  const float far = clot_wanders[1], off = far * (1 - one), opposite = far * (1 - other);
  const floats x = a - off * c, y = b - off * s, u = a + opposite * c, v = b + opposite * s;
  return vmin(vsqrt(x * x + y * y) - one, vsqrt(u * u + v * v) - other);
}

// Unevenness of a clot, dB: lumps of 2 mm and finer grain, and the layers in which it grew.
INLINE floats clot_grain(const tissue_vessel *it, knots *memory, floats theta, floats s,
                         floats depth, floats inward) {
  floats lump = texture(memory, theta, s * 400, depth * 600, 4 * TURNS_MUSCLE, 13);
  floats layer = sheet(inward * 2.2f + 0.6f * lump, 0.6f);
  return it->lumps_db * lump + it->layers_db * (layer - 0.3f);
}

// Cusps of a valve: two sheets, rooted in the wall, whose edges come together by the share `bend`.
// `field`: place over the lumen's radius and the cusps' length, from the heart's far end.
static const float cusp_m = 0.22e-3f, cusp_scatter = 1.3f;

INLINE floats cusps(const tissue_job *job, const tissue_body *it, uint32_t field, float bend) {
  const uint32_t n = job->lines;
  floats a = field_at(job, field), b = field_at(job, field + n), u = field_at(job, field + 2 * n);
  floats chord = vsqrt(vmax(1 - b * b, vset(0)));
  floats away = vabs(vabs(a) - chord * (1 - bend * u)) * it->half_m[0];
  return vonly((u > 0) & (u < 1) & (a * a + b * b < 1),
               cusp_scatter * vmax(1 - away * (1 / cusp_m), vset(0)));
}

// Walls hide lesions, lumina walls: branches begin in the lumen of their parents. Clot last.
INLINE void vessels(const tissue_job *job, const tissue_point *p, uint32_t line,
                    const floats *level, floats out[2]) {
  const uint32_t n = job->lines;
  const tissue_gate *gate = p->gate;
  const float *before = job->before + LAYER_LEVELS * n + line;
  for (uint32_t i = gate->vessels; i-- > 0;) {
    const uint32_t v = gate->vessel[i];
    const ints wall = level[v] < job->vessel[v].wall_m;
    if (vany(wall)) {
      // Where the beam grazes it, the wall is as grey as what lies around it.
      floats slope = vabs(level[v] - vload(before + v * n)) * job->rows_per_m;
      floats square = vmin(slope * slope, vset(1));
      floats scatter = vset(wall_tissue[0]);
      if (!job->plain) scatter = wall_body + (wall_tissue[0] - wall_body) * (square * square);
      mark(wall, scatter, wall_tissue[1], out);
    }
    mark(level[v] <= 0, vset(blood_tissue[0]), blood_tissue[1], out);
  }
  for (uint32_t i = 0; i < gate->vessels; ++i)
    if (gate->vessel[i] >= 2)
      mark(level[gate->vessel[i]] <= 0, vset(blood_tissue[0]), blood_tissue[1], out);
  for (uint32_t i = 0; i < gate->bodies; ++i) {
    const uint32_t k = gate->body[i];
    if (job->body[k].kind != SONDE_TISSUE_CUSPS) continue;
    const uint32_t field = body_place_at(job, p->map, k);
    for (uint32_t j = 0; j < gate->vessels; ++j) {
      const uint32_t v = gate->vessel[j];
      const ints lumen = level[v] <= 0;
      if (!vany(lumen)) continue;
      const floats bright = cusps(job, &job->body[k], field, job->vessel[v].cusp_bend);
      mark(lumen & (bright > out[0]), bright, blood_tissue[1], out);
    }
  }
  for (uint32_t i = 0; i < gate->vessels; ++i) {
    const uint32_t v = gate->vessel[i], at = line + vessel_field_at(v, VESSEL_SHORT) * n;
    const tissue_vessel *it = &job->vessel[v];
    if (!(it->clot_fraction > 0)) continue;
    ints clot = (level[v] <= 0) & (field_at(job, at + VESSEL_CLOT * n) >= 0.5f);
    if (!vany(clot)) continue;
    const floats a = field_at(job, at);
    const floats b = field_at(job, at + VESSEL_LONG * n);
    if (it->clot_fraction < 1)
      clot &= clot_depth(it->form, it->clot_fraction, it->number, p->s, a, b) > 0;
    floats scatter = vset(it->clot_scatter);
    if (!job->plain)
      scatter =
          scatter * power2(clot_grain(it, p->memory, p->theta, p->s, p->depth, a) * 0.16609640474f);
    if (v == 0 && job->webs > 0 && vany(clot))
      scatter = scatter * (1 - 0.6f * job->webs) +
                job->webs * webs(p->memory, p->theta, p->s, p->depth, a);
    mark(clot, scatter, it->clot_loss, out);
  }
}

#endif
