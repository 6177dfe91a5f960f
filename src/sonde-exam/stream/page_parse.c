// JSON commands from the page: everything is bounded and checked before it reaches the session.
#include "stream/page_message.h"

#include "base/maths.h"

#include <string.h>

static const double REACH_MM = 2000; // farthest goal from the model's origin

// A command that is being read. The first mistake stays: after it every read does nothing.
typedef struct reader {
  const sonde_json *root;
  sonde_status status;
  sonde_error *error;
} reader;

#define refuse(r, ...) sonde_fail_once((r)->status, (r)->error, SONDE_ARGUMENT, __VA_ARGS__)

// A number within a range; `absent` when there is none of that key.
static double read_real(reader *r, const char *key, double low, double high, double absent) {
  const sonde_json *item = sonde_json_member(r->root, key);
  double found = sonde_json_as_number(item);
  if (!item) return absent;
  if (found >= low && found <= high) return found;
  refuse(r, "\"%s\" must be a number from %g to %g", key, low, high);
  return absent;
}

static uint32_t read_id(reader *r, const char *key) {
  double value = read_real(r, key, 0, UINT32_MAX, 0.5);
  if (value != floor(value)) refuse(r, "\"%s\" must be a whole number", key);
  return (uint32_t)value;
}

static double read_time(reader *r) {
  double time_s = read_real(r, "time_s", 0, 86400, (double)NAN);
  if (isnan(time_s)) refuse(r, "\"time_s\" is missing");
  return time_s;
}

static bool read_bool(reader *r, const char *key) {
  sonde_json_kind kind = sonde_json_kind_of(sonde_json_member(r->root, key));
  if (kind != SONDE_JSON_TRUE && kind != SONDE_JSON_FALSE)
    refuse(r, "\"%s\" must be true or false", key);
  return kind == SONDE_JSON_TRUE;
}

// An empty name when the key is absent.
static void read_name(reader *r, const char *key, char *name, size_t size) {
  const sonde_json *item = sonde_json_member(r->root, key);
  const char *text = sonde_json_as_text(item);
  bool good = text && text[0] && strlen(text) < size;
  if (item && !good) refuse(r, "\"%s\" must be a name of 1 to %zu characters", key, size - 1);
  snprintf(name, size, "%s", good ? text : "");
}

// UTF-8 text without control characters; `least` 0 allows it to be absent.
static void read_text(reader *r, const char *key, size_t least, size_t most, char *text,
                      size_t size) {
  const sonde_json *item = sonde_json_member(r->root, key);
  if (!item && least == 0) return;
  size_t count = 0;
  const char *found = sonde_json_as_text(item);
  bool plain = found != NULL;
  for (const char *c = plain ? found : ""; *c; ++c) {
    if ((unsigned char)*c < 0x20 && *c != '\n') plain = false;
    if ((*c & 0xc0) != 0x80) ++count;
  }
  if (plain && count >= least && count <= most && strlen(found) < size)
    snprintf(text, size, "%s", found);
  else
    refuse(r, "\"%s\" must be a text of %zu to %zu characters", key, least, most);
}

static void read_vector(reader *r, const char *key, uint32_t count, double limit, double *values) {
  const sonde_json *array = sonde_json_member(r->root, key), *item = sonde_json_first(array);
  if (sonde_json_kind_of(array) != SONDE_JSON_LIST || sonde_json_count(array) != count)
    refuse(r, "\"%s\" must be an array of %u numbers", key, count);
  for (uint32_t i = 0; i < count; ++i, item = sonde_json_next(item)) {
    values[i] = sonde_json_as_number(item);
    if (!(fabs(values[i]) <= limit))
      refuse(r, "\"%s\" must hold numbers from -%g to %g", key, limit, limit);
  }
}

// One of the words of an action, counted from 0.
static size_t read_action(reader *r, const char *const *words, size_t count, const char *expected) {
  char action[12] = "";
  read_name(r, "action", action, sizeof action);
  for (size_t i = 0; i < count; ++i)
    if (strcmp(action, words[i]) == 0) return i;
  refuse(r, "\"action\" must be %s", expected);
  return 0;
}

static double *setting_of(sonde_echo_settings *echo, const sonde_echo_range *range) {
  return (double *)(void *)((char *)echo + range->offset);
}

static double *gate_number(sonde_gate_settings *gate, size_t k) {
  return (double *)(void *)((char *)gate + page_gate_number[k].offset);
}

static void read_controls(reader *r, page_command *command) {
  static const char *const OTHERS[] = {"type",
                                       "probe",
                                       "case",
                                       "posture",
                                       "damping_scale",
                                       "friction_scale",
                                       "valsalva",
                                       "stiffness_scale",
                                       "colour",
                                       "colour_box_mm",
                                       "colour_steer_deg",
                                       "colour_gain_db",
                                       "colour_scale_cm_s",
                                       "gate",
                                       "gate_mm"};
  const sonde_echo_range *range = sonde_echo_ranges();
  const double absent = (double)NAN;
  // An unknown key is a mistake of the page: what it asks for would not happen, unseen.
  for (const sonde_json *item = sonde_json_first(r->root); item; item = sonde_json_next(item)) {
    const char *key = sonde_json_key(item);
    bool known = false;
    for (size_t k = 0; k < SONDE_ECHO_SETTINGS; ++k) known |= strcmp(key, range[k].key) == 0;
    for (size_t k = 0; k < SONDE_COUNT_OF(OTHERS); ++k) known |= strcmp(key, OTHERS[k]) == 0;
    for (size_t k = 0; k < PAGE_GATE_NUMBERS; ++k)
      known |= strcmp(key, page_gate_number[k].key) == 0;
    if (!known) refuse(r, "there is no control \"%.40s\"", key);
  }
  // Settings come in the page's units; NaN leaves a control as it is.
  for (const sonde_echo_range *e = range; e < range + SONDE_ECHO_SETTINGS; ++e)
    *setting_of(&command->echo, e) = e->si * read_real(r, e->key, e->low, e->high, absent);
  command->stiffness_scale = read_real(r, "stiffness_scale", 0.5, 2, absent);
  command->damping_scale = read_real(r, "damping_scale", 0.25, 4, absent);
  command->friction_scale = read_real(r, "friction_scale", 0, 2, absent);
  // Colour.
  const double reach_mm = 250;
  char shown[16];
  read_name(r, "colour", shown, sizeof shown);
  command->colour = -1;
  for (int k = 0; k < PAGE_COLOURS; ++k)
    if (strcmp(shown, page_colour_word[k]) == 0) command->colour = k;
  if (shown[0] && command->colour < 0) refuse(r, "\"colour\" must be off, velocity or power");
  double *box = command->colour_box_m;
  const bool boxed = sonde_json_member(r->root, "colour_box_mm") != NULL;
  if (boxed) read_vector(r, "colour_box_mm", 4, reach_mm, box);
  for (int k = 0; k < 4; ++k) box[k] = boxed ? 1e-3 * box[k] : absent;
  command->colour_steer_rad = SONDE_PI / 180 * read_real(r, "colour_steer_deg", -20, 20, absent);
  command->colour_scale_m_s = 1e-2 * read_real(r, "colour_scale_cm_s", 1, 100, absent);
  command->colour_gain_db = read_real(r, "colour_gain_db", -30, 20, absent);
  command->gated = sonde_json_member(r->root, "gate") ? read_bool(r, "gate") : -1;
  double place[2] = {absent, absent};
  if (sonde_json_member(r->root, "gate_mm")) read_vector(r, "gate_mm", 2, reach_mm, place);
  command->gate.x_m = 1e-3 * place[0], command->gate.z_m = 1e-3 * place[1];
  for (size_t k = 0; k < PAGE_GATE_NUMBERS; ++k)
    *gate_number(&command->gate, k) =
        page_gate_number[k].si * read_real(r, page_gate_number[k].key, page_gate_number[k].low,
                                           page_gate_number[k].high, absent);
  read_name(r, "probe", command->probe, sizeof command->probe);
  read_name(r, "case", command->pathology, sizeof command->pathology);
  read_name(r, "posture", command->posture, sizeof command->posture);
  command->strain = sonde_json_member(r->root, "valsalva") ? read_bool(r, "valsalva") : -1;
}

static void read_request(reader *r, sonde_page_ask ask, sonde_page_request *q) {
  q->ask = ask;
  q->speed = 1;
  switch (ask) {
  case SONDE_PAGE_START_EXAM:
    read_text(r, "case", 1, 47, q->id, sizeof q->id);
    read_text(r, "protocol", 1, 47, q->protocol, sizeof q->protocol);
    read_text(r, "guidance", 1, 15, q->guidance, sizeof q->guidance);
    read_text(r, "trainee", 0, 40, q->name, sizeof q->name);
    if (strcmp(q->guidance, "full") && strcmp(q->guidance, "hints") && strcmp(q->guidance, "exam"))
      refuse(r, "\"guidance\" must be full, hints or exam");
    break;
  case SONDE_PAGE_DECIDE:
    read_text(r, "segment", 1, 31, q->id, sizeof q->id);
    read_text(r, "decision", 0, 15, q->text, sizeof q->text);
    break;
  case SONDE_PAGE_START_LESSON:
    read_text(r, "lesson", 1, 47, q->id, sizeof q->id);
    read_text(r, "trainee", 0, 40, q->name, sizeof q->name);
    q->turn = read_id(r, "turn");
    break;
  case SONDE_PAGE_DEMONSTRATE: read_text(r, "lesson", 1, 47, q->id, sizeof q->id); break;
  case SONDE_PAGE_EXPORT:
    read_text(r, "exam", 1, 63, q->id, sizeof q->id);
    read_text(r, "what", 0, 15, q->text, sizeof q->text);
    q->turn = sonde_json_member(r->root, "part") ? read_id(r, "part") : 1;
    break;
  case SONDE_PAGE_POSITION: read_text(r, "position", 1, 31, q->id, sizeof q->id); break;
  case SONDE_PAGE_OPEN_REPLAY: read_text(r, "exam", 1, 63, q->id, sizeof q->id); break;
  case SONDE_PAGE_SEEK: q->time_s = read_time(r); break;
  case SONDE_PAGE_PLAY:
    q->playing = read_bool(r, "playing");
    q->speed = read_real(r, "speed", 0.25, 4, 1);
    break;
  case SONDE_PAGE_COMMENT:
    q->time_s = read_time(r);
    read_text(r, "text", 1, 400, q->text, sizeof q->text);
    read_text(r, "author", 0, 40, q->name, sizeof q->name);
    break;
  default: break;
  }
}

// Requests of the program after the page's own commands, in the order of sonde_page_ask.
static const char *const TYPES[] = {
    "goal",         "controls",    "stop",        "resume", "ack",  "ping",     "gel",
    "role",         "hand",        "start_exam",  "decide", "hint", "position", "finish_exam",
    "leave_exam",   "list_exams",  "open_replay", "seek",   "play", "comment",  "worksheet",
    "start_lesson", "demonstrate", "next",        "export", "edit"};
_Static_assert(SONDE_COUNT_OF(TYPES) == PAGE_COMMAND_REQUEST + (int)SONDE_PAGE_ASKS, "a type each");

sonde_status page_parse_command(const char *bytes, size_t count, page_command *command,
                                sonde_error *error) {
  SONDE_ASSERT(bytes && command);
  *command = (page_command){0};
  if (count == 0 || count > PAGE_COMMAND_BYTES)
    return sonde_fail(error, SONDE_FORMAT, "a message must have 1 to %d bytes, not %zu",
                      PAGE_COMMAND_BYTES, count);
  const sonde_json_source source = {.most_depth = PAGE_COMMAND_DEPTH};
  sonde_error wrong = {0};
  sonde_json *root = NULL;
  sonde_status status = sonde_json_parse(bytes, count, &source, &root, &wrong);
  if (status)
    return sonde_fail(error, status, "a message must be one JSON object: %s", wrong.message);
  const char *type = sonde_json_as_text(sonde_json_member(root, "type"));
  size_t which = 0;
  while (type && which < SONDE_COUNT_OF(TYPES) && strcmp(type, TYPES[which]) != 0) ++which;
  reader r = {.root = root, .error = error};
  if (!type)
    r.status = sonde_fail(error, SONDE_FORMAT, "a message must be an object with a \"type\"");
  else if (which == SONDE_COUNT_OF(TYPES))
    r.status = sonde_fail(
        error, SONDE_NOT_FOUND,
        "\"type\" must be goal, controls, stop, resume, ack, ping, gel, role, hand or a request of "
        "docs/page_protocol.md");
  else if (count > PAGE_SHORT_BYTES && which != PAGE_COMMAND_REQUEST + (size_t)SONDE_PAGE_EDIT)
    r.status = sonde_fail(error, SONDE_FORMAT, "a message of this type has at most %d bytes",
                          PAGE_SHORT_BYTES);
  else {
    static const char *const GEL[] = {"put", "wipe"}, *const ROLE[] = {"take", "give", "return"};
    static const char *const HAND[] = {"squeeze", "breathe"};
    double p[3], q[4], norm2 = 0;
    bool request = which >= PAGE_COMMAND_REQUEST;
    command->type = request ? PAGE_COMMAND_REQUEST : (page_command_type)which;
    switch (command->type) {
    case PAGE_COMMAND_REQUEST:
      read_request(&r, (sonde_page_ask)(which - PAGE_COMMAND_REQUEST), &command->request);
      // What its members mean is the worksheet's to say, which reads them from a journal too, or
      // the editor's.
      _Static_assert((int)SONDE_PAGE_ENTRY > (int)PAGE_COMMAND_BYTES, "room for its end");
      if (command->request.ask == SONDE_PAGE_WORKSHEET || command->request.ask == SONDE_PAGE_EDIT)
        memcpy(command->request.entry, bytes, count);
      break;
    case PAGE_COMMAND_GOAL:
      read_vector(&r, "position_mm", 3, REACH_MM, p);
      read_vector(&r, "rotation", 4, 2, q);
      for (int i = 0; i < 4; ++i) norm2 += q[i] * q[i];
      if (!(norm2 >= 0.25 && norm2 <= 4))
        refuse(&r, "\"rotation\" must be a unit quaternion w, x, y, z");
      if (r.status) break;
      command->goal.position = v_scale(vec3(p[0], p[1], p[2]), 1e-3);
      command->goal.rotation = q_unit((sonde_quat){q[0], q[1], q[2], q[3]});
      break;
    case PAGE_COMMAND_CONTROLS: read_controls(&r, command); break;
    case PAGE_COMMAND_ACK: command->id = read_id(&r, "frame"); break;
    case PAGE_COMMAND_PING: command->id = read_id(&r, "id"); break;
    case PAGE_COMMAND_GEL:
      command->gel_wipe = read_action(&r, GEL, SONDE_COUNT_OF(GEL), "put or wipe") == 1;
      command->gel_put = !command->gel_wipe;
      break;
    case PAGE_COMMAND_HAND:
      command->deep_breath = read_action(&r, HAND, SONDE_COUNT_OF(HAND), "squeeze or breathe") == 1;
      command->squeeze = !command->deep_breath;
      break;
    case PAGE_COMMAND_ROLE:
      command->action = (page_may)(PAGE_MAY_TAKE + read_action(&r, ROLE, SONDE_COUNT_OF(ROLE),
                                                               "take, give or return"));
      break;
    default: break; // stop, resume
    }
  }
  sonde_json_free(root);
  return r.status;
}

static void take(double value, double *control) {
  if (!isnan(value)) *control = value;
}

void page_command_take(const page_command *command, sonde_session_controls *controls) {
  SONDE_ASSERT(command && controls);
  const sonde_echo_range *range = sonde_echo_ranges();
  sonde_echo_settings asked = command->echo;
  for (size_t k = 0; k < SONDE_ECHO_SETTINGS; ++k)
    take(*setting_of(&asked, &range[k]), setting_of(&controls->echo, &range[k]));
  take(command->stiffness_scale, &controls->stiffness_scale);
  take(command->damping_scale, &controls->damping_scale);
  take(command->friction_scale, &controls->friction_scale);
  sonde_duplex_controls *duplex = &controls->duplex;
  if (command->colour >= 0) duplex->shown = (sonde_duplex_shown)command->colour;
  take(command->colour_box_m[0], &duplex->box.left_m);
  take(command->colour_box_m[1], &duplex->box.right_m);
  take(command->colour_box_m[2], &duplex->box.top_m);
  take(command->colour_box_m[3], &duplex->box.bottom_m);
  take(command->colour_steer_rad, &duplex->box.steer_rad);
  take(command->colour_scale_m_s, &duplex->scale_m_s);
  take(command->colour_gain_db, &duplex->gain_db);
  if (command->gated >= 0) duplex->gated = command->gated > 0;
  take(command->gate.x_m, &duplex->gate.x_m), take(command->gate.z_m, &duplex->gate.z_m);
  sonde_gate_settings asked_gate = command->gate;
  for (size_t k = 0; k < PAGE_GATE_NUMBERS; ++k)
    take(*gate_number(&asked_gate, k), gate_number(&duplex->gate, k));
  if (command->strain >= 0) controls->valsalva = command->strain > 0;
  controls->echo = sonde_echo_settings_clamp(controls->echo);
}
