// Messages of the page: any bytes are either a command in range or an error. Goals and controls
// reach a session, which makes a tick.
#include "fuzz.h"

#include "base/maths.h"
#include "stream/page_message.h"

// One session serves all inputs: making its inside takes most of a second. Every input begins with
// the controls of the start and the probe off the skin.
static void apply(const page_command *command) {
  static sonde_session *session;
  static sonde_session_controls start;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_pose off = fuzz_press(fuzz_leg(), -5e-3);
  if (!session) {
    sonde_device device;
    FUZZ_CHECK(sonde_device_page(off, 1e-3, &device, &error) == SONDE_OK);
    session = fuzz_session(NULL, &device);
    start = sonde_session_controls_now(session);
  }
  sonde_session_controls c = start;
  if (command->type == PAGE_COMMAND_CONTROLS) page_command_take(command, &c);
  if (command->gel_put) c.gel = true, ++c.gel_put;
  sonde_session_control(session, &c);
  sonde_pose goal = command->type == PAGE_COMMAND_GOAL ? command->goal : off;
  sonde_device_page_goal(sonde_session_device(session), goal);
  for (int k = 0; k < 3; ++k) sonde_session_tick(session);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  page_command command;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = page_parse_command((const char *)bytes, count, &command, &error);
  if (!fuzz_checked(status, &error)) return 0;
  FUZZ_CHECK(memchr(command.probe, 0, sizeof command.probe) != NULL);
  FUZZ_CHECK(v_finite(command.goal.position));
  if (command.type == PAGE_COMMAND_GOAL || command.type == PAGE_COMMAND_CONTROLS ||
      command.type == PAGE_COMMAND_GEL)
    apply(&command);
  return 0;
}
