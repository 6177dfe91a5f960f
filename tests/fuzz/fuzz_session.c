// A session on the small leg. In a file of its own: the internal header of sessions and the public
// header of the trainer both name a type sonde_station.
#include "exam/session.h"

#include <stdio.h>
#include <stdlib.h>

sonde_model *fuzz_leg(void);
sonde_session *fuzz_session(const char *record_path, sonde_device *device);

sonde_session *fuzz_session(const char *record_path, sonde_device *device) {
  sonde_session_def def = sonde_session_def_default();
  sonde_session *session = NULL;
  sonde_error error = {0};
  def.model = fuzz_leg();
  def.model_path = "leg.sonde";
  def.controls.probe = 1;
  def.image_width = def.image_height = 32;
  def.record_path = record_path;
  sonde_status status = sonde_session_create(&def, device, &session, &error);
  if (status) {
    fprintf(stderr, "%s\n", error.message);
    abort();
  }
  sonde_interior_set_method(session->interior, SONDE_INTERIOR_COLUMNS);
  return session;
}
