// Names and keys of case files, shared by reader and writer.
#ifndef SONDE_SRC_TRAINER_CASE_H
#define SONDE_SRC_TRAINER_CASE_H

#include "trainer/trainer.h"

extern const char *const sonde_case_levels[];   // NULL-terminated, in the order of the enum
extern const char *const sonde_case_postures[]; // likewise
extern const char *const sonde_case_lesions[];
extern const char *const sonde_case_clot_forms[]; // of sonde_clot_form
extern const char *const sonde_case_sexes[];
extern const char *const sonde_case_sides[];
extern const char *const sonde_case_positions[]; // of sonde_limb_position, then straight
// All bits of sonde_case.positions.
enum { CASE_ALL_POSITIONS = (1 << SONDE_LIMB_POSITIONS) - 1 };

// Everything that needs no model; a sentence without place.
sonde_status sonde_case_check(const sonde_case *of, sonde_error *error);

#endif
