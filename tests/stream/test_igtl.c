// OpenIGTLink: the CRC, both header versions, clients that read, do not read, or talk rubbish.
#include "stream/ws_client.h"

#include "base/clock.h"
#include "sonde/stream_igtl.h"
#include "stream/igtl_message.h"

#include <math.h>
#include <netinet/in.h>
#include <poll.h>

enum { WIDTH = 160, HEIGHT = 120, MESSAGES = 6, PATIENCE_S = 60 };

typedef struct message {
  int version;
  char type[13], device[21];
  size_t size;
  unsigned char body[WIDTH * HEIGHT + 400];
} message;

static igtl_crc crc;
static uint8_t pixels[WIDTH * HEIGHT];

static sonde_frame a_frame(uint8_t shade) {
  memset(pixels, shade, sizeof pixels);
  sonde_frame frame = {
      .pixels = pixels, .width = WIDTH, .height = HEIGHT, .width_m = 0.048, .height_m = 0.06};
  // A quarter turn about z: x of the probe is y of the model.
  frame.snapshot.world_from_probe = (sonde_pose){{0.01, 0.02, 0.03}, {sqrt(0.5), 0, 0, sqrt(0.5)}};
  frame.snapshot.force_n = (sonde_vec3){1, -2, 4};
  frame.snapshot.force_normal_n = 3.5;
  return frame;
}

static uint64_t big(const unsigned char *bytes, int count) {
  uint64_t value = 0;
  for (int k = 0; k < count; ++k) value = value << 8 | bytes[k];
  return value;
}

static double real(const unsigned char *bytes) {
  uint32_t bits = (uint32_t)big(bytes, 4);
  float value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

// Reads a message and checks its CRC. False at the end of the stream.
static bool next(int s, message *m) {
  unsigned char head[IGTL_HEAD_BYTES];
  if (!read_all(s, head, sizeof head)) return false;
  m->version = (int)big(head, 2);
  snprintf(m->type, sizeof m->type, "%.12s", (const char *)head + 2);
  snprintf(m->device, sizeof m->device, "%.20s", (const char *)head + 14);
  m->size = big(head + 42, 8);
  assert_true(m->size <= sizeof m->body);
  if (!read_all(s, m->body, m->size)) return false;
  assert_true(big(head + 50, 8) == igtl_crc_of(&crc, m->body, m->size));
  return true;
}

// Reads the messages of a frame. @return its first pixel
static int frame_of(int s, message *m) {
  static const char *const types[MESSAGES] = {"IMAGE",  "TRANSFORM", "TRANSFORM",
                                              "SENSOR", "SENSOR",    "STRING"};
  int shade = -1;
  for (int k = 0; k < MESSAGES; ++k) {
    assert_true(next(s, m));
    assert_string_equal(m->type, types[k]);
    if (k == 0) shade = m->body[(m->version > 1 ? 12 : 0) + 72];
  }
  return shade;
}

static sonde_igtl_server *started(const char *push, bool listens) {
  sonde_igtl_server *server = NULL;
  sonde_igtl_def def = {.listen = listens, .push = push};
  assert_int_equal(sonde_igtl_start(&def, &server, NULL), SONDE_OK);
  assert_true((sonde_igtl_port(server) != 0) == listens);
  return server;
}

static void wait_for_clients(sonde_igtl_server *server, uint32_t count) {
  for (double end_s = sonde_clock_now() + PATIENCE_S; sonde_clock_now() < end_s;) {
    if (sonde_igtl_counted(server).clients == count) return;
    sonde_clock_sleep_until(sonde_clock_now() + 0.001);
  }
  fail_msg("%u clients, expected %u", sonde_igtl_counted(server).clients, count);
}

static int connected(sonde_igtl_server *server, int receive_buffer, uint32_t count) {
  int s = tcp_connect(sonde_igtl_port(server), receive_buffer);
  wait_for_clients(server, count);
  return s;
}

static void say(int s, int version, const char *type, uint64_t body) {
  unsigned char head[IGTL_HEAD_BYTES] = {0, (unsigned char)version};
  memcpy(head + 2, type, strlen(type));
  for (int k = 0; k < 8; ++k) head[42 + k] = (unsigned char)(body >> 8 * (7 - k) & 0xff);
  assert_int_equal(send(s, head, sizeof head, MSG_NOSIGNAL), sizeof head);
}

// The check value of CRC-64/ECMA-182, and the eight-byte tables against bits one after the other.
static void crc_is_that_of_ecma(void **state) {
  (void)state;
  assert_true(igtl_crc_of(&crc, (const unsigned char *)"123456789", 9) == 0x6C40DF5F0B497347);
  unsigned char bytes[61];
  for (unsigned k = 0; k < sizeof bytes; ++k) bytes[k] = (unsigned char)(k * k * 37 + 11);
  for (size_t size = 0; size <= sizeof bytes; ++size) {
    uint64_t slow = 0;
    for (size_t k = 0; k < 8 * size; ++k) {
      uint64_t bit = bytes[k / 8] >> (7 - k % 8) & 1;
      slow = slow << 1 ^ ((slow >> 63 ^ bit) ? 0x42F0E1EBA9EA3693 : 0);
    }
    assert_true(igtl_crc_of(&crc, bytes, size) == slow);
  }
}

static void places_are_in_mm(void **state) {
  (void)state;
  sonde_igtl_server *server = started(NULL, true);
  int s = connected(server, 0, 1);
  sonde_frame frame = a_frame(77);
  assert_true(sonde_igtl_post(server, &frame));
  message m;
  assert_true(next(s, &m));
  assert_int_equal(m.version, 1);
  assert_int_equal(m.size, 72 + WIDTH * HEIGHT);
  assert_int_equal(big(m.body + 6, 2), WIDTH);
  // Columns go along x of the probe, which is y of the model, 0.3 mm each; rows along z, 0.5 mm.
  const double expected[12] = {0, 0.3, 0, 0, 0, 0.5, 0.3, 0, 0, 10, 20, 30 + 30};
  for (int k = 0; k < 12; ++k) assert_float_equal(real(m.body + 12 + 4 * k), expected[k], 1e-5);
  assert_int_equal(m.body[72 + WIDTH * HEIGHT - 1], 77);
  assert_true(next(s, &m));
  assert_string_equal(m.device, "ImageToProbe");
  const double corner[3] = {-24 + 0.15, 0, 0.25};
  for (int k = 0; k < 3; ++k) assert_float_equal(real(m.body + 36 + 4 * k), corner[k], 1e-5);
  assert_true(next(s, &m));
  assert_string_equal(m.device, "ProbeToReference");
  const double pose[12] = {0, 1, 0, -1, 0, 0, 0, 0, 1, 10, 20, 30};
  for (int k = 0; k < 12; ++k) assert_float_equal(real(m.body + 4 * k), pose[k], 1e-5);
  assert_true(next(s, &m));
  assert_string_equal(m.device, "ProbeForce");
  const double force_n[3] = {1, -2, 4};
  assert_int_equal(m.body[0], 3);
  for (int k = 0; k < 3; ++k) {
    uint64_t bits = big(m.body + 10 + 8 * k, 8);
    assert_memory_equal(&bits, &force_n[k], 8);
  }
  close(s);
  sonde_igtl_stop(server);
}

// Version 1 until the client says version 2; what it asks for comes between two frames.
static void speaks_as_the_client(void **state) {
  (void)state;
  sonde_igtl_server *server = started(NULL, true);
  int s = connected(server, 0, 1), old = connected(server, 0, 2);
  sonde_frame frame = a_frame(1);
  message m;
  assert_true(sonde_igtl_post(server, &frame));
  assert_int_equal(frame_of(s, &m), 1);
  assert_int_equal(m.version, 1);
  say(s, 2, "GET_STATUS", 5);
  assert_int_equal(send(s, "12345", 5, MSG_NOSIGNAL), 5);
  assert_true(next(s, &m));
  assert_string_equal(m.type, "STATUS");
  assert_int_equal(m.version, 2);
  say(s, 2, "GET_CAPABIL", 0);
  assert_true(next(s, &m));
  assert_string_equal(m.type, "CAPABILITY");
  assert_int_equal(big(m.body + 12, 4), 6);
  frame = a_frame(2);
  assert_true(sonde_igtl_post(server, &frame));
  assert_true(next(s, &m));
  assert_int_equal(m.version, 2);
  // Extended header, image, four heads of metadata, their texts.
  assert_int_equal(big(m.body, 2), 12);
  const size_t heads = big(m.body + 2, 2), texts = big(m.body + 4, 4);
  assert_int_equal(big(m.body + 8, 4), 2); // the frame's number
  assert_int_equal(m.size, 12 + 72 + WIDTH * HEIGHT + heads + texts);
  assert_int_equal(heads, 2 + 4 * 8);
  assert_memory_equal(m.body + m.size - texts, "ContactForceN3.5FrameNumber2TimeS0DepthMm60",
                      texts);
  assert_int_equal(frame_of(old, &m), 1);
  assert_int_equal(frame_of(old, &m), 2);
  assert_int_equal(m.version, 1);
  close(s), close(old);
  sonde_igtl_stop(server);
}

// A client that does not read costs the other nothing, and gets the newest frame when it reads
// again.
static void a_stuck_client_is_alone(void **state) {
  (void)state;
  enum { FRAMES = 240 };
  sonde_igtl_server *server = started(NULL, true);
  int stuck = connected(server, 4096, 1), reader = connected(server, 0, 2);
  message m;
  for (int k = 1; k <= FRAMES; ++k) {
    sonde_frame frame = a_frame((uint8_t)k);
    assert_true(sonde_igtl_post(server, &frame));
    assert_int_equal(frame_of(reader, &m), k);
  }
  sonde_igtl_counts counts = sonde_igtl_counted(server);
  assert_int_equal(counts.frames, FRAMES);
  assert_true(counts.replaced >= FRAMES / 3);
  int got = 0, before = 0;
  while (before < FRAMES) {
    int shade = frame_of(stuck, &m);
    assert_true(shade > before);
    before = shade;
    ++got;
  }
  assert_true(got < 2 * FRAMES / 3);
  assert_int_equal((uint64_t)got + sonde_igtl_counted(server).replaced, FRAMES);
  close(stuck), close(reader);
  sonde_igtl_stop(server);
}

static void rubbish_ends_a_connection(void **state) {
  (void)state;
  sonde_igtl_server *server = started(NULL, true);
  int good = connected(server, 0, 1);
  message m;
  for (int k = 0; k < 4; ++k) {
    int s = tcp_connect(sonde_igtl_port(server), 0);
    if (k == 0) say(s, 0, "STATUS", 0);                // no version
    if (k == 1) say(s, 1, "", 0);                      // no type
    if (k == 2) say(s, 1, "IMAGE", (uint64_t)1 << 40); // no such image
    if (k == 3) say(s, 'G', "T / HTTP", 0);
    assert_false(next(s, &m));
    close(s);
  }
  say(good, 1, "POINT", 0); // what we do not know is no rubbish
  sonde_frame frame = a_frame(9);
  wait_for_clients(server, 1);
  assert_true(sonde_igtl_post(server, &frame));
  assert_int_equal(frame_of(good, &m), 9);
  // No place for one more.
  int others[SONDE_IGTL_CLIENTS];
  for (int k = 1; k < SONDE_IGTL_CLIENTS; ++k) others[k] = connected(server, 0, (uint32_t)k + 1);
  others[0] = tcp_connect(sonde_igtl_port(server), 0);
  assert_false(next(others[0], &m));
  for (int k = 0; k < SONDE_IGTL_CLIENTS; ++k) close(others[k]);
  wait_for_clients(server, 1);
  close(good);
  sonde_igtl_stop(server);
}

// The reader is not there at first, comes, goes and comes again.
static void pushes_to_a_reader(void **state) {
  (void)state;
  struct sockaddr_in address = {.sin_family = AF_INET};
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  int listener = socket(AF_INET, SOCK_STREAM, 0);
  assert_int_equal(bind(listener, (struct sockaddr *)&address, sizeof address), 0);
  assert_int_equal(getsockname(listener, (struct sockaddr *)&address, &size), 0);
  char push[40];
  snprintf(push, sizeof push, "127.0.0.1:%u", (unsigned)ntohs(address.sin_port));
  sonde_igtl_server *server = started(push, false);
  sonde_frame frame = a_frame(5);
  assert_true(sonde_igtl_post(server, &frame)); // to nobody
  assert_int_equal(listen(listener, 1), 0);
  message m;
  for (int k = 0; k < 2; ++k) {
    struct pollfd waits = {.fd = listener, .events = POLLIN};
    assert_int_equal(poll(&waits, 1, PATIENCE_S * 1000), 1);
    int s = accept(listener, NULL, NULL);
    wait_for_clients(server, 1);
    frame = a_frame((uint8_t)(6 + k));
    assert_true(sonde_igtl_post(server, &frame));
    assert_int_equal(frame_of(s, &m), 6 + k);
    close(s);
    wait_for_clients(server, 0);
  }
  close(listener);
  sonde_igtl_stop(server);
  sonde_error error = {0};
  static const char *const words[] = {
      "localhost", ":1", "localhost:", "localhost:0", "localhost:1x", "localhost:65536"};
  for (size_t k = 0; k < sizeof words / sizeof *words; ++k) {
    sonde_igtl_def def = {.push = words[k]};
    assert_int_equal(sonde_igtl_start(&def, &server, &error), SONDE_ARGUMENT);
    assert_non_null(strstr(error.message, "HOST:PORT"));
  }
  sonde_igtl_def def = {.listen = true, .address = "nowhere"};
  assert_int_equal(sonde_igtl_start(&def, &server, &error), SONDE_ARGUMENT);
}

static void a_port_is_taken_once(void **state) {
  (void)state;
  sonde_igtl_server *server = started(NULL, true), *second = NULL;
  sonde_error error = {0};
  sonde_igtl_def def = {.listen = true, .port = sonde_igtl_port(server)};
  assert_int_equal(sonde_igtl_start(&def, &second, &error), SONDE_PORT);
  assert_non_null(strstr(error.message, "in use by another program"));
  sonde_igtl_stop(server);
}

int main(void) {
  igtl_crc_begin(&crc);
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(crc_is_that_of_ecma),       cmocka_unit_test(places_are_in_mm),
      cmocka_unit_test(speaks_as_the_client),      cmocka_unit_test(a_stuck_client_is_alone),
      cmocka_unit_test(rubbish_ends_a_connection), cmocka_unit_test(pushes_to_a_reader),
      cmocka_unit_test(a_port_is_taken_once),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
