// The page of a session: adapts sonde_session to the server's source.
#include "stream/page_server.h"

#include "exam/session.h"

#include <string.h>

typedef struct session_source {
  sonde_session *session;
  sonde_device *page_device; // NULL: another device moves the probe
  const sonde_probe **probes;
} session_source;

static bool take_frame(void *self, sonde_frame *frame) {
  return sonde_session_frame(((session_source *)self)->session, frame);
}

static void set_goal(void *self, sonde_pose pose) {
  sonde_device *device = ((session_source *)self)->page_device;
  if (device) sonde_device_page_goal(device, pose);
}

static void set_controls(void *self, const sonde_session_controls *controls) {
  sonde_session_control(((session_source *)self)->session, controls);
}

static sonde_session_controls get_controls(void *self) {
  return sonde_session_controls_now(((session_source *)self)->session);
}

static void release(void *self) {
  sonde_free(((session_source *)self)->probes);
  sonde_free(self);
}

static sonde_status make_source(sonde_session *session, double force_limit_n, page_source *source,
                                sonde_error *error) {
  SONDE_ASSERT(session->probe_count > 0);
  sonde_device *device = sonde_session_device(session);
  session_source *self = SONDE_NEW(session_source, 1);
  const sonde_probe **probes = SONDE_NEW(const sonde_probe *, session->probe_count);
  if (!self || !probes) {
    sonde_free(self);
    sonde_free(probes);
    return sonde_fail_memory(error);
  }
  bool by_page = device && strcmp(device->name, "page") == 0;
  *self = (session_source){session, by_page ? device : NULL, probes};
  for (uint32_t i = 0; i < session->probe_count; ++i) probes[i] = sonde_session_probe(session, i);
  *source = (page_source){.self = self,
                          .model = session->model,
                          .probes = probes,
                          .probe_count = session->probe_count,
                          .force_limit_n = force_limit_n,
                          .fan = session->scanner.radius_m > 0,
                          .frame = take_frame,
                          .goal = set_goal,
                          .control = set_controls,
                          .controls_now = get_controls,
                          .release = release};
  return SONDE_OK;
}

sonde_status sonde_page_start(const sonde_page_def *def, sonde_session *session,
                              sonde_page_server **server, sonde_error *error) {
  SONDE_ASSERT(def && session && server);
  double limit_n =
      def->force_limit_n > 0 ? def->force_limit_n : sonde_safety_limits_default().force_n;
  page_source source;
  sonde_status status = make_source(session, limit_n, &source, error);
  if (status) return status;
  status = page_server_start(def, &source, server, error);
  if (status) release(source.self);
  return status;
}

sonde_status sonde_page_show(sonde_page_server *server, sonde_session *session,
                             sonde_error *error) {
  SONDE_ASSERT(server && session);
  page_source source;
  sonde_status status = make_source(session, server->source.force_limit_n, &source, error);
  if (status) return status;
  status = page_server_show(server, &source, error);
  if (status) release(source.self);
  return status;
}
