// Protocols of the examination: any text is either a protocol, which is planned on the leg, or an
// error with the line.
#include "fuzz.h"

#include <math.h>

static void plan(const sonde_exam_protocol *protocol) {
  static sonde_vein_map map;
  static sonde_plan made;
  sonde_error error = {SONDE_OK, "", ""};
  if (!map.point_count) FUZZ_CHECK(sonde_vein_map_make(fuzz_leg(), &map, &error) == SONDE_OK);
  sonde_status status = sonde_plan_make(protocol, &map, &made, &error);
  if (status) {
    FUZZ_CHECK(error.status == status && error.message[0]);
    return;
  }
  FUZZ_CHECK(made.count > 0 && made.count <= SONDE_PLAN_POINTS);
  for (uint32_t k = 0; k < made.count; ++k)
    FUZZ_CHECK(made.point[k].at.along_m >= 0 && made.point[k].at.along_m <= map.length_m + 1e-9);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  sonde_exam_protocol protocol;
  sonde_error error = {SONDE_OK, "", ""};
  char *text = fuzz_text(bytes, count);
  if (!text) return 0;
  sonde_status status = sonde_exam_protocol_parse(text, "protocol.yaml", &protocol, &error);
  bool good = fuzz_checked(status, &error);
  FUZZ_CHECK(good || strstr(error.message, "protocol.yaml:"));
  if (good) plan(&protocol);
  free(text);
  return 0;
}
