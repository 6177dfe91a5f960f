// The page of a session: adapts sonde_session to the server's source.
#include "stream/page_server.h"

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

static session_source *adapt(sonde_session *session) {
  uint32_t count = sonde_session_probe_count(session);
  session_source *self = SONDE_NEW(session_source, 1);
  if (!self) return NULL;
  self->session = session;
  sonde_device *device = sonde_session_device(session);
  if (device && strcmp(device->name, "page") == 0) self->page_device = device;
  self->probes = SONDE_NEW(const sonde_probe *, count);
  if (!self->probes) {
    release(self);
    return NULL;
  }
  for (uint32_t i = 0; i < count; ++i) self->probes[i] = sonde_session_probe(session, i);
  return self;
}

static page_source make_source(session_source *self, double force_limit_n) {
  return (page_source){self,          sonde_session_model(self->session),
                       self->probes,  sonde_session_probe_count(self->session),
                       force_limit_n, take_frame,
                       set_goal,      set_controls,
                       get_controls,  release};
}

sonde_status sonde_page_start(const sonde_page_def *def, sonde_session *session,
                              sonde_page_server **server, sonde_error *error) {
  SONDE_ASSERT(def && session && server);
  session_source *self = adapt(session);
  if (!self) return sonde_fail_memory(error);
  double limit_n =
      def->force_limit_n > 0 ? def->force_limit_n : sonde_safety_limits_default().force_n;
  page_source source = make_source(self, limit_n);
  sonde_status status = page_server_start(def, &source, server, error);
  if (status) release(self);
  return status;
}

sonde_status sonde_page_show(sonde_page_server *server, sonde_session *session,
                             sonde_error *error) {
  SONDE_ASSERT(server && session);
  session_source *self = adapt(session);
  if (!self) return sonde_fail_memory(error);
  page_source source = make_source(self, server->source.force_limit_n);
  sonde_status status = page_server_show(server, &source, error);
  if (status) release(self);
  return status;
}
