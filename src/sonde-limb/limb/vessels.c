// Vessels of a limb.
#include "limb/vessels.h"

sonde_status limb_vessels_make(sonde_limb *limb, sonde_error *error) {
  SONDE_ASSERT(limb && !limb->vessels);
  (void)error;
  return SONDE_OK;
}

void limb_vessels_destroy(struct limb_vessels *vessels) { sonde_free(vessels); }

limb_vessel_hit limb_vessels_at(const struct limb_vessels *vessels, const double xyz[3]) {
  (void)vessels, (void)xyz;
  return (limb_vessel_hit){LIMB_PART_NONE, 0, INFINITY};
}

const char *limb_vessels_name(const struct limb_vessels *vessels, limb_part part, uint32_t index) {
  (void)vessels, (void)part, (void)index;
  return "";
}
