// What lies in the tissue as bodies: lesions, nodes, nerves, tendons.
// Included by kernel_tissue.h only.
#ifndef SONDE_SRC_ECHO_KERNEL_BODIES_H
#define SONDE_SRC_ECHO_KERNEL_BODIES_H

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_texture.h"

// Attenuation (dB/m/MHz one way), backscatter over muscle (amplitude); docs/echo.md.
static const float node_loss = 60, haematoma_loss = 45, fluid_tissue[2] = {0.006f, 5};
static const float capsule_m = 0.3e-3f, capsule_scatter = 1.4f, hilum_scatter = 1.2f;

INLINE void mark(ints mask, floats scatter, float loss, floats out[2]) {
  out[0] = vselect(mask, scatter, out[0]), out[1] = vselect(mask, vset(loss), out[1]);
}

INLINE void mark_both(ints mask, floats scatter, floats loss, floats out[2]) {
  out[0] = vselect(mask, scatter, out[0]), out[1] = vselect(mask, loss, out[1]);
}

// What a point's texture depends on.
typedef struct tissue_point {
  knots *memory;
  const tissue_gate *gate;
  uint32_t map; // place of the tissue map's fields
  floats theta, s, depth;
  floats facing; // how squarely the beam meets the layers, 0..1
  floats sheath; // of the bright fat around a vessel, 0..1
} tissue_point;

// Place of a body's fields behind the map's.
INLINE uint32_t body_place_at(const tissue_job *job, uint32_t map, uint32_t body) {
  return map + (1 + job->cells + BODY_FIELDS * body) * job->lines;
}

// Signed distance to the ellipsoid |q| = 1, m, to first order.
INLINE floats lesion_distance(const tissue_lesion *lesion, const floats q[3]) {
  floats square = vset(0), steep = vset(0);
  for (int k = 0; k < 3; ++k) {
    floats g = q[k] * lesion->per_half[k];
    square += q[k] * q[k], steep += g * g;
  }
  floats size = vsqrt(square);
  return (size - 1) * size / vmax(vsqrt(steep), vset(1));
}

// Rim and hilum, fluid, or clotted and liquid parts; a thin capsule.
INLINE void lesion(const tissue_lesion *it, knots *memory, const floats q[3], floats away,
                   floats theta, floats s, floats depth, floats out[2]) {
  ints in = away < 0;
  if (!vany(away < capsule_m)) return;
  if (it->kind != TISSUE_HAEMATOMA)
    mark_both((away >= 0) & (away < capsule_m), vset(capsule_scatter), out[1], out);
  if (it->kind == TISSUE_CYST) {
    mark(in, vmax(vset(it->scatter), vset(fluid_tissue[0])), fluid_tissue[1], out);
    return;
  }
  floats grain = texture(memory, theta, s * 400, depth * 500, 4 * TURNS_MUSCLE, 11);
  floats scatter = it->scatter * (1 + 0.3f * grain);
  if (it->kind == TISSUE_NODE) {
    floats hilum = q[0] * q[0] * 7 + q[1] * q[1] * 7 + q[2] * q[2] * 2 + 0.4f * grain;
    floats share = smooth(vmin(vmax((1.2f - hilum) * 2, vset(0)), vset(1)));
    mark(in, scatter + share * (hilum_scatter - scatter), node_loss, out);
    return;
  }
  floats lump = texture(memory, theta, s * 150, depth * 200, 2 * TURNS_MUSCLE, 12) + 0.5f * grain;
  floats liquid = smooth(vmin(vmax(0.1f - 3 * lump, vset(0)), vset(1)));
  mark(in, scatter * power2(1.5f * lump) * (1 - liquid) + fluid_tissue[0] * liquid, haematoma_loss,
       out);
}

// Nerve: dark fascicles of 0.7 mm in bright epineurium. Both grow grey when the beam does not meet
// them squarely.
static const float fascicle_mm = 0.75f, fascicle_scatter = 0.28f, epineurium_scatter = 1.9f;
// Tendon: fibrils where the beam meets them squarely within some degrees, dark else.
static const float tendon_body = 0.35f, tendon_bright = 2.2f, fibril_per_m = 2600;
static const float body_loss[2] = {90, 110}, node_rim = 0.35f;

// Nerves, tendons and nodes of the tissue map.
INLINE void bodies(const tissue_job *job, const tissue_point *p, floats out[2]) {
  const uint32_t n = job->lines;
  for (uint32_t i = 0; i < p->gate->bodies; ++i) {
    const uint32_t k = p->gate->body[i], field = body_place_at(job, p->map, k);
    const tissue_body *it = &job->body[k];
    floats q[3] = {field_at(job, field), field_at(job, field + n), field_at(job, field + 2 * n)};
    if (it->kind == SONDE_TISSUE_NODE) {
      const tissue_lesion node = {
          TISSUE_NODE, {1 / it->half_m[0], 1 / it->half_m[1], 1 / it->half_m[2]}, node_rim};
      lesion(&node, p->memory, q, lesion_distance(&node, q), p->theta, p->s, p->depth, out);
      continue;
    }
    floats square = q[0] * q[0] + q[1] * q[1];
    ints in = square < 1;
    if (it->kind == SONDE_TISSUE_CUSPS || !vany(in)) continue;
    const float square_on = it->facing * it->facing, fourth = square_on * square_on;
    if (it->kind == SONDE_TISSUE_NERVE) {
      // A honeycomb: three waves across the nerve at 60 degrees, which sway along it.
      floats sway = texture(p->memory, p->theta, p->s * 60, p->depth * 150, TURNS_FAT, 6);
      floats u = q[0] * (1e3f * it->half_m[0] / fascicle_mm) + 0.5f * sway, c[3], s;
      floats v = q[1] * (1e3f * it->half_m[1] / fascicle_mm) + 0.3f * sway;
      for (int wave = 0; wave < 3; ++wave) {
        static const float x[3] = {1.1547f, -0.57735f, -0.57735f}, y[3] = {0, 1, -1};
        floats turns = x[wave] * u + y[wave] * v;
        turn(turns - vfloor(turns), &c[wave], &s);
      }
      floats dark = smooth(vmin(vmax((c[0] + c[1] + c[2]) * 0.6f + 0.5f, vset(0)), vset(1)));
      dark = dark * smooth(vmin(vmax((1 - square) * 3, vset(0)), vset(1))); // a rim of epineurium
      const float bright = epineurium_scatter * (0.4f + 0.6f * fourth);
      mark(in, bright + dark * (fascicle_scatter - bright), body_loss[0], out);
    } else {
      const float bright = tendon_bright * fourth * fourth * fourth * fourth;
      floats patch = texture(p->memory, p->theta, p->s * 140, p->depth * 1500, 2 * TURNS_FAT, 4);
      floats fibril = sheet(q[1] * (it->half_m[1] * fibril_per_m) + 0.4f * patch, 0.8f);
      mark(in, tendon_body + bright * fibril * (1 + 0.5f * patch), body_loss[1], out);
    }
  }
}

#endif
