// Messages of the page: binary and JSON to the browser, JSON commands from it.
// docs/page_protocol.md is the reference; millimetres, decibels and megahertz exist only in these
// two files.
#ifndef SONDE_SRC_STREAM_PAGE_MESSAGE_H
#define SONDE_SRC_STREAM_PAGE_MESSAGE_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/base_json.h"
#include "sonde/stream.h"

enum {
  PAGE_VERSION = 3,
  PAGE_HEADER_BYTES = 16,
  PAGE_MESH_FIXED_BYTES = 24,     // header and counts, before the points
  PAGE_FRAME_FIXED_BYTES = 140,   // header and snapshot, before the displacements
  PAGE_FAN_BYTES = 12,            // of a curved face, behind the image
  PAGE_COLOUR_FIXED_BYTES = 36,   // before the colours of a frame
  PAGE_SPECTRUM_FIXED_BYTES = 56, // before the columns of a frame's spectrum
  PAGE_SPECTRUM = 3,              // what it begins with, where colours have a sonde_duplex_shown
  PAGE_FAN = 4,                   // likewise
  PAGE_SOLID = 1 << 15,           // of a frame's flags: the hyperelastic solid bears the probe
  PAGE_COMMAND_BYTES = 12288,     // longest message accepted of a teacher: a case that is edited
  PAGE_SHORT_BYTES = 4096,        // longest one of every other kind, or of anyone else
  PAGE_COMMAND_DEPTH = 3,         // deepest nesting accepted
};

typedef enum page_type { PAGE_MESH = 1, PAGE_LINE = 2, PAGE_FRAME = 3 } page_type;

// Identity of a static mesh or line.
typedef enum page_part {
  PAGE_SKIN = 0,
  PAGE_FEMUR = 1,
  PAGE_VEIN = 2,
  PAGE_ARTERY = 3,
  PAGE_PROBE = 16,  // plus the probe's index
  PAGE_BRANCH = 256 // plus twice the branch's index, and 1 of an artery
} page_part;

// Length of one unit of a displacement in a frame; 16 bits reach +-65 mm.
#define PAGE_QUANTUM_M 2e-6

// Each encoder returns the size of the whole message and writes it only when it fits `capacity`.
size_t page_encode_mesh(const sonde_mesh *mesh, uint32_t part, unsigned char *bytes,
                        size_t capacity);
size_t page_encode_line(const sonde_vessel *vessel, uint32_t part, unsigned char *bytes,
                        size_t capacity);
// `rest` are the rest positions of the skin that the frame's displacements refer to.
size_t page_encode_frame(const sonde_frame *frame, const sonde_mesh *rest, uint32_t sequence,
                         unsigned char *bytes, size_t capacity);

// What the hello message says; all borrowed.
typedef struct page_hello {
  const sonde_model *model;
  const sonde_probe *const *probes;
  uint32_t probe_count;
  double force_limit_n;
  const char *more; // further members, "key":value,...; may be NULL
  bool controls;    // this client may move the probe
} page_hello;

typedef enum page_who { PAGE_NOBODY, PAGE_LEARNER, PAGE_WATCHER, PAGE_TEACHER } page_who;
typedef enum page_may { PAGE_MAY_NOTHING, PAGE_MAY_TAKE, PAGE_MAY_GIVE, PAGE_MAY_RETURN } page_may;

// What a client is told about control.
typedef struct page_role {
  page_who is, holder; // the client; who controls
  page_may may;        // the one thing that it may ask for
  bool controls;
} page_role;

// What is left out of the controls.
typedef struct page_hidden {
  bool pathology; // a learner may not be told its name
  bool posture;   // the model says how it is held
  bool steer;     // the lines of a curved face are a fan, which does not lean
} page_hidden;

// A sonde_duplex_shown in messages.
enum { PAGE_COLOURS = 3 };
static const char *const page_colour_word[PAGE_COLOURS] = {"off", "velocity", "power"};

// Numbers of a gate in messages: keys, units, ranges.
enum { PAGE_GATE_NUMBERS = 7 };
static const struct {
  const char *key;
  double si, low, high;
  size_t offset;
} page_gate_number[PAGE_GATE_NUMBERS] = {
    {"gate_length_mm", 1e-3, 0.5, 15, offsetof(sonde_gate_settings, length_m)},
    {"gate_steer_deg", SONDE_PI / 180, -20, 20, offsetof(sonde_gate_settings, steer_rad)},
    {"gate_angle_deg", SONDE_PI / 180, -80, 80, offsetof(sonde_gate_settings, angle_rad)},
    {"gate_scale_cm_s", 1e-2, 2, 200, offsetof(sonde_gate_settings, scale_m_s)},
    {"gate_baseline", 1, -0.9, 0.9, offsetof(sonde_gate_settings, baseline)},
    {"gate_filter_hz", 1, 10, 1000, offsetof(sonde_gate_settings, filter_hz)},
    {"gate_gain_db", 1, -30, 30, offsetof(sonde_gate_settings, gain_db)}};

// Each writer puts one message onto a text in memory.
void page_write_hello(sonde_json_out *out, const page_hello *hello);
// @param gel_m3 on the skin
void page_write_controls(sonde_json_out *out, const sonde_session_controls *controls,
                         const char *probe_name, page_hidden hidden, double gel_m3, page_role role);
bool page_posture_parse(const char *name, sonde_posture *posture);

typedef enum page_command_type {
  PAGE_COMMAND_GOAL,
  PAGE_COMMAND_CONTROLS,
  PAGE_COMMAND_STOP,
  PAGE_COMMAND_RESUME,
  PAGE_COMMAND_ACK,
  PAGE_COMMAND_PING,
  PAGE_COMMAND_GEL,
  PAGE_COMMAND_ROLE,
  PAGE_COMMAND_HAND,
  PAGE_COMMAND_REQUEST
} page_command_type;

// A validated command in SI units. NaN or an empty name: leave that control as it is.
typedef struct page_command {
  page_command_type type;
  sonde_pose goal;
  char probe[64], pathology[32];
  sonde_echo_settings echo; // likewise
  double stiffness_scale, damping_scale, friction_scale;
  double colour_box_m[4]; // left, right, top, bottom
  double colour_steer_rad, colour_scale_m_s, colour_gain_db;
  int colour;               // a sonde_duplex_shown; -1: as it is
  int gated;                // 1, 0; -1: as it is
  sonde_gate_settings gate; // NaN: as it is
  char posture[16];
  int strain; // 1, 0; -1: as it is
  bool gel_put, gel_wipe;
  bool squeeze, deep_breath;
  page_may action; // of a role
  uint32_t id;     // of the acknowledged frame or of the ping
  sonde_page_request request;
} page_command;

// Parses one message of `count` bytes (need not end in 0). On failure the sentence for the client
// is in error->message; it never repeats the client's own text. @thread any
sonde_status page_parse_command(const char *bytes, size_t count, page_command *command,
                                sonde_error *error);

// Takes a command's numbers and straining over into the controls; the image's settings are clamped
// to their ranges. @thread any
void page_command_take(const page_command *command, sonde_session_controls *controls);

#endif
