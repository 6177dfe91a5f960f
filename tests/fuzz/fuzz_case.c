// Cases of the trainer: any text is either a case, which is placed on the leg and seen, or an error
// with the line.
#include "fuzz.h"

static void place(sonde_case *patient) {
  sonde_case_setup setup;
  sonde_error error = {SONDE_OK, "", ""};
  patient->thigh = SONDE_CASE_BUNDLED; // making a thigh takes seconds
  sonde_status status = sonde_case_build(patient, fuzz_leg_file(), NULL, &setup, &error);
  if (status) {
    FUZZ_CHECK(error.status == status && error.message[0]);
    return;
  }
  fuzz_picture(NULL, &setup.pathology, &setup.findings);
  sonde_case_setup_clear(&setup);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  sonde_case patient;
  sonde_error error = {SONDE_OK, "", ""};
  char *text = fuzz_text(bytes, count);
  if (!text) return 0;
  bool good = fuzz_checked(sonde_case_parse(text, "case.yaml", &patient, &error), &error);
  FUZZ_CHECK(good || strstr(error.message, "case.yaml:"));
  if (good) place(&patient);
  free(text);
  return 0;
}
