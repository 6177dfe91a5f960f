// Limbs without muscles, which vessels and stations do not ask for.
#ifndef SONDE_TESTS_BARE_LIMB_H
#define SONDE_TESTS_BARE_LIMB_H

#include "../fixture.h"

#include "limb/bones.h"
#include "limb/vessels_graph.h"

// The k-th of a family over both sexes and BMI 17 to 40, drawn from seed first + k.
static inline sonde_limb *bare_limb(uint32_t k, uint32_t first, sonde_limb_side side) {
  sonde_limb_body body = sonde_limb_unknown();
  sonde_limb *limb = SONDE_NEW(sonde_limb, 1);
  sonde_error error = {0};
  body.sex = k % 2 ? SONDE_SEX_MALE : SONDE_SEX_FEMALE;
  body.bmi = 17 + (k * 7) % 24, body.side = side;
  sonde_status status = sonde_limb_draw(&body, first + k, &body, &error);
  limb->body = body, limb->scale = body.thigh_length_m / 0.430;
  if (!status) status = limb_bones_make(limb, &error);
  if (!status) status = limb_surface_make(limb, &error);
  if (!status) status = limb_vessels_make(limb, &error);
  if (status) fail_msg("member %u: %s", k, error.message);
  return limb;
}

#endif
