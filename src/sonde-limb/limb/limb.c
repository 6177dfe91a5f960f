// A limb as a whole: made in the order frame, bones, vessels, muscles.
#include "limb/bones.h"
#include "limb/muscles.h"
#include "limb/vessels.h"

sonde_status sonde_limb_create(const sonde_limb_body *body, sonde_limb **out, sonde_error *error) {
  SONDE_ASSERT(body && out);
  *out = NULL;
  sonde_limb *limb = SONDE_NEW(sonde_limb, 1);
  if (!limb) return sonde_fail_memory(error);
  limb->body = *body;
  limb->scale = body->thigh_length_m / 0.430;
  sonde_status status = limb_bones_make(limb, error);
  if (!status) status = limb_surface_make(limb, error);
  if (!status) status = limb_vessels_make(limb, error);
  if (!status) status = limb_muscles_make(limb, error);
  if (status) {
    sonde_limb_destroy(limb);
    return status;
  }
  *out = limb;
  return SONDE_OK;
}

void sonde_limb_destroy(sonde_limb *limb) {
  if (!limb) return;
  limb_vessels_destroy(limb->vessels);
  sonde_free(limb->muscles);
  sonde_free(limb->bones);
  sonde_free(limb);
}
