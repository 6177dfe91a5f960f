// Haply Inverse3 through the service of its maker: JSON over WebSocket on this machine. One state
// comes back for every command; a command that is not repeated is forgotten by the service.
#include "haptics/devices/pump.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"
#include "haptics/devices/websocket.h"
#include "sonde/base_json.h"

#include <string.h>

static const double silence_s = 0.1;

typedef struct haply {
  sonde_websocket socket;
  bool opened;
  char device[64]; // id; empty before the first state
  double heard_s;  // clock of the newest state
  sonde_quat rotation;
} haply;

static sonde_status bind(void *self, const sonde_device_open_def *def, sonde_error *error) {
  haply *h = self;
  sonde_status status = sonde_websocket_open(&h->socket, def->port, error);
  h->opened = !status;
  return status;
}

static bool read_vector(const sonde_json *object, const char *name, sonde_vec3 *v) {
  const sonde_json *o = sonde_json_member(object, name);
  *v = vec3(sonde_json_as_number(sonde_json_member(o, "x")),
            sonde_json_as_number(sonde_json_member(o, "y")),
            sonde_json_as_number(sonde_json_member(o, "z")));
  return v_finite(*v);
}

// Torn or foreign messages are dropped: silence, not nonsense, decides that a device is lost.
static bool read_state(haply *h, sonde_device_sample *sample) {
  sonde_json *root = NULL;
  const char *message = h->socket.message;
  if (sonde_json_parse(message, strlen(message), NULL, &root, NULL)) return false;
  const sonde_json *device = sonde_json_first(sonde_json_member(root, "inverse3"));
  const char *id = sonde_json_as_text(sonde_json_member(device, "device_id"));
  const sonde_json *state = sonde_json_member(device, "state");
  sonde_vec3 position;
  bool known = id && read_vector(state, "cursor_position", &position);
  if (known) {
    sample->world_from_probe.position = position;
    snprintf(h->device, sizeof h->device, "%s", id);
    // The grip is optional: without it the last rotation stays.
    static const char *const kinds[] = {"wireless_verse_grip", "verse_grip"};
    static const char *const buttons[] = {"a", "b", "c"};
    for (size_t k = 0; k < SONDE_COUNT_OF(kinds); ++k) {
      const sonde_json *grip = sonde_json_first(sonde_json_member(root, kinds[k]));
      const sonde_json *held = sonde_json_member(grip, "state");
      sonde_vec3 v;
      double w =
          sonde_json_as_number(sonde_json_member(sonde_json_member(held, "orientation"), "w"));
      if (isfinite(w) && read_vector(held, "orientation", &v))
        h->rotation = q_unit((sonde_quat){w, v.x, v.y, v.z});
      const sonde_json *pressed = sonde_json_member(held, "buttons");
      for (size_t b = 0; b < SONDE_COUNT_OF(buttons); ++b)
        if (sonde_json_kind_of(sonde_json_member(pressed, buttons[b])) == SONDE_JSON_TRUE)
          sample->buttons |= 1u << b;
    }
    sample->world_from_probe.rotation = h->rotation;
  }
  sonde_json_free(root);
  return known;
}

// Waits for the first state: a service without a device sends none.
static sonde_status open_device(void *self, const sonde_device_open_def *def, sonde_error *error) {
  haply *h = self;
  h->rotation = quat_identity();
  sonde_device_sample sample = {0};
  double until_s = sonde_clock_now() + 0.5;
  for (int got = 0; got >= 0 && !h->device[0] && sonde_clock_now() < until_s;) {
    sonde_websocket_wait(&h->socket, 50);
    got = sonde_websocket_receive(&h->socket);
    if (got > 0) read_state(h, &sample);
  }
  if (!h->device[0])
    return sonde_fail(error, SONDE_DEVICE, "the service on port %u knows no Inverse3",
                      (unsigned)def->port);
  h->heard_s = sonde_clock_now();
  return SONDE_OK;
}

static int exchange(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m,
                    sonde_device_sample *sample) {
  haply *h = self;
  (void)torque_n_m;
  SONDE_ASSERT(h->opened);
  char text[256];
  int length = snprintf(text, sizeof text,
                        "{\"inverse3\":[{\"device_id\":\"%s\",\"commands\":{\"set_cursor_force\":"
                        "{\"values\":{\"x\":%.6f,\"y\":%.6f,\"z\":%.6f}}}}]}",
                        h->device, force_n.x, force_n.y, force_n.z);
  if (length <= 0 || (size_t)length >= sizeof text ||
      !sonde_websocket_send(&h->socket, text, (size_t)length))
    return -1;
  int got, fresh = 0;
  while ((got = sonde_websocket_receive(&h->socket)) > 0)
    if (read_state(h, sample)) fresh = 1;
  if (fresh) h->heard_s = sonde_clock_now();
  if (got < 0 || sonde_clock_now() - h->heard_s > silence_s) return -1;
  return fresh;
}

static void close_device(void *self) {
  haply *h = self;
  if (h->opened) sonde_websocket_close(&h->socket);
  h->opened = false;
  h->device[0] = '\0';
}

// x to the right, y away from the user, z up: not verified
const sonde_driver sonde_driver_haply = {"haply",
                                         "Inverse3 through its service (WebSocket)",
                                         {0.70710678118654752, -0.70710678118654752, 0, 0},
                                         sizeof(haply),
                                         bind,
                                         open_device,
                                         exchange,
                                         close_device};
