// JSON commands from the page: everything is bounded and checked before it reaches the session.
#include "stream/page_message.h"

#include "base/maths.h"
#include "sonde/base_json.h"

#include <string.h>

static const double REACH_MM = 2000; // farthest goal from the model's origin

// Leaves *value as it is when the key is absent.
static sonde_status read_real(const sonde_json *object, const char *key, double low, double high,
                              double *value, sonde_error *error) {
  const sonde_json *item = sonde_json_member(object, key);
  if (!item) return SONDE_OK;
  double found = sonde_json_as_number(item);
  if (!(found >= low && found <= high))
    return sonde_fail(error, SONDE_ARGUMENT, "\"%s\" must be a number from %g to %g", key, low,
                      high);
  *value = found;
  return SONDE_OK;
}

static sonde_status read_name(const sonde_json *object, const char *key, char *name, size_t size,
                              sonde_error *error) {
  const sonde_json *item = sonde_json_member(object, key);
  if (!item) return SONDE_OK;
  const char *text = sonde_json_as_text(item);
  if (!text || !text[0] || strlen(text) >= size)
    return sonde_fail(error, SONDE_ARGUMENT, "\"%s\" must be a name of 1 to %zu characters", key,
                      size - 1);
  snprintf(name, size, "%s", text);
  return SONDE_OK;
}

static sonde_status read_vector(const sonde_json *object, const char *key, uint32_t count,
                                double limit, double *values, sonde_error *error) {
  const sonde_json *array = sonde_json_member(object, key);
  if (sonde_json_kind_of(array) != SONDE_JSON_LIST || sonde_json_count(array) != count)
    return sonde_fail(error, SONDE_ARGUMENT, "\"%s\" must be an array of %u numbers", key, count);
  const sonde_json *item = sonde_json_first(array);
  for (uint32_t i = 0; i < count; ++i, item = sonde_json_next(item)) {
    values[i] = sonde_json_as_number(item);
    if (!(fabs(values[i]) <= limit))
      return sonde_fail(error, SONDE_ARGUMENT, "\"%s\" must hold numbers from -%g to %g", key,
                        limit, limit);
  }
  return SONDE_OK;
}

static sonde_status read_id(const sonde_json *object, const char *key, uint32_t *id,
                            sonde_error *error) {
  double value = -1;
  sonde_status status = read_real(object, key, 0, UINT32_MAX, &value, error);
  if (status) return status;
  if (value < 0 || value != floor(value))
    return sonde_fail(error, SONDE_ARGUMENT, "\"%s\" must be a whole number", key);
  *id = (uint32_t)value;
  return SONDE_OK;
}

static sonde_status parse_goal(const sonde_json *root, page_command *command, sonde_error *error) {
  double p[3], q[4];
  sonde_status status = read_vector(root, "position_mm", 3, REACH_MM, p, error);
  if (!status) status = read_vector(root, "rotation", 4, 2, q, error);
  if (status) return status;
  double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (norm2 < 0.25 || norm2 > 4)
    return sonde_fail(error, SONDE_ARGUMENT, "\"rotation\" must be a unit quaternion w, x, y, z");
  command->goal.position = v_scale(vec3(p[0], p[1], p[2]), 1e-3);
  command->goal.rotation = q_unit((sonde_quat){q[0], q[1], q[2], q[3]});
  return SONDE_OK;
}

static sonde_status read_bool(const sonde_json *object, const char *key, bool *value,
                              sonde_error *error) {
  sonde_json_kind kind = sonde_json_kind_of(sonde_json_member(object, key));
  *value = kind == SONDE_JSON_TRUE;
  if (kind == SONDE_JSON_TRUE || kind == SONDE_JSON_FALSE) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT, "\"%s\" must be true or false", key);
}

// -1 when it is absent.
static sonde_status read_strain(const sonde_json *root, page_command *command, sonde_error *error) {
  bool strains = false;
  sonde_status status = SONDE_OK;
  command->strain = -1;
  if (!sonde_json_member(root, "valsalva")) return SONDE_OK;
  status = read_bool(root, "valsalva", &strains, error);
  if (!status) command->strain = strains ? 1 : 0;
  return status;
}

// In the page's unit; NaN when it is absent.
static sonde_status read_setting(const sonde_json *root, const sonde_echo_range *range,
                                 double *target, sonde_error *error) {
  double value = (double)NAN;
  sonde_status status = read_real(root, range->key, range->low, range->high, &value, error);
  *target = value * range->si;
  return status;
}

static sonde_status read_settings(const sonde_json *root, page_command *command,
                                  sonde_error *error) {
  static const sonde_echo_range BENCH[] = {{"stiffness_scale", 0.5, 2, 1, 0},
                                           {"damping_scale", 0.25, 4, 1, 0},
                                           {"friction_scale", 0, 2, 1, 0}};
  double *const bench[] = {&command->stiffness_scale, &command->damping_scale,
                           &command->friction_scale};
  const sonde_echo_range *range = sonde_echo_ranges();
  sonde_status status = SONDE_OK;
  for (size_t i = 0; i < SONDE_ECHO_SETTINGS && !status; ++i)
    status = read_setting(root, &range[i],
                          (double *)(void *)((char *)&command->echo + range[i].offset), error);
  for (size_t i = 0; i < SONDE_COUNT_OF(BENCH) && !status; ++i)
    status = read_setting(root, &BENCH[i], bench[i], error);
  return status;
}

// A key that is none is a mistake of the page: what it asks for would not happen, unseen.
static sonde_status check_keys(const sonde_json *root, sonde_error *error) {
  static const char *const OTHERS[] = {"type",     "probe",          "case",
                                       "posture",  "damping_scale",  "friction_scale",
                                       "valsalva", "stiffness_scale"};
  for (const sonde_json *item = sonde_json_first(root); item; item = sonde_json_next(item)) {
    const char *key = sonde_json_key(item);
    bool known = false;
    for (size_t k = 0; k < SONDE_ECHO_SETTINGS; ++k)
      known = known || strcmp(key, sonde_echo_ranges()[k].key) == 0;
    for (size_t k = 0; k < SONDE_COUNT_OF(OTHERS); ++k)
      known = known || strcmp(key, OTHERS[k]) == 0;
    if (!known) return sonde_fail(error, SONDE_ARGUMENT, "there is no control \"%.40s\"", key);
  }
  return SONDE_OK;
}

static sonde_status parse_controls(const sonde_json *root, page_command *command,
                                   sonde_error *error) {
  sonde_status status = check_keys(root, error);
  if (!status) status = read_settings(root, command, error);
  if (status) return status;
  status = read_name(root, "probe", command->probe, sizeof command->probe, error);
  if (!status)
    status = read_name(root, "case", command->pathology, sizeof command->pathology, error);
  if (!status)
    status = read_name(root, "posture", command->posture, sizeof command->posture, error);
  return status ? status : read_strain(root, command, error);
}

static sonde_status parse_gel(const sonde_json *root, page_command *command, sonde_error *error) {
  char action[8] = "";
  sonde_status status = read_name(root, "action", action, sizeof action, error);
  command->gel_put = strcmp(action, "put") == 0;
  command->gel_wipe = strcmp(action, "wipe") == 0;
  if (!status && !command->gel_put && !command->gel_wipe)
    status = sonde_fail(error, SONDE_ARGUMENT, "\"action\" must be put or wipe");
  return status;
}

static sonde_status parse_role(const sonde_json *root, page_command *command, sonde_error *error) {
  static const char *const ACTIONS[] = {"", "take", "give", "return"};
  char action[8] = "";
  sonde_status status = read_name(root, "action", action, sizeof action, error);
  for (size_t i = 1; i < SONDE_COUNT_OF(ACTIONS); ++i)
    if (strcmp(action, ACTIONS[i]) == 0) command->action = (page_may)i;
  if (!status && command->action == PAGE_MAY_NOTHING)
    status = sonde_fail(error, SONDE_ARGUMENT, "\"action\" must be take, give or return");
  return status;
}

// UTF-8 text without control characters; `least` 0 allows it to be absent.
static sonde_status read_text(const sonde_json *object, const char *key, size_t least, size_t most,
                              char *text, size_t size, sonde_error *error) {
  const sonde_json *item = sonde_json_member(object, key);
  if (!item && least == 0) return SONDE_OK;
  size_t count = 0;
  const char *found = sonde_json_as_text(item);
  bool plain = found != NULL;
  for (const char *c = plain ? found : ""; *c; ++c) {
    if ((unsigned char)*c < 0x20 && *c != '\n') plain = false;
    if ((*c & 0xc0) != 0x80) ++count;
  }
  if (!plain || count < least || count > most || strlen(found) >= size)
    return sonde_fail(error, SONDE_ARGUMENT, "\"%s\" must be a text of %zu to %zu characters", key,
                      least, most);
  snprintf(text, size, "%s", found);
  return SONDE_OK;
}

static const double LONGEST_S = 86400;

static sonde_status read_time(const sonde_json *root, sonde_page_request *r, sonde_error *error) {
  r->time_s = (double)NAN;
  sonde_status status = read_real(root, "time_s", 0, LONGEST_S, &r->time_s, error);
  if (!status && isnan(r->time_s))
    status = sonde_fail(error, SONDE_ARGUMENT, "\"time_s\" is missing");
  return status;
}

static sonde_status parse_start(const sonde_json *root, sonde_page_request *r, sonde_error *error) {
  static const char *const LEVELS[] = {"full", "hints", "exam"};
  sonde_status status = read_text(root, "case", 1, 47, r->id, sizeof r->id, error);
  if (!status) status = read_text(root, "protocol", 1, 47, r->protocol, sizeof r->protocol, error);
  if (!status) status = read_text(root, "guidance", 1, 15, r->guidance, sizeof r->guidance, error);
  if (!status) status = read_text(root, "trainee", 0, 40, r->name, sizeof r->name, error);
  if (status) return status;
  for (size_t i = 0; i < SONDE_COUNT_OF(LEVELS); ++i)
    if (strcmp(r->guidance, LEVELS[i]) == 0) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT, "\"guidance\" must be full, hints or exam");
}

static sonde_status parse_comment(const sonde_json *root, sonde_page_request *r,
                                  sonde_error *error) {
  sonde_status status = read_time(root, r, error);
  if (!status) status = read_text(root, "text", 1, 400, r->text, sizeof r->text, error);
  if (!status) status = read_text(root, "author", 0, 40, r->name, sizeof r->name, error);
  return status;
}

static sonde_status parse_request(const sonde_json *root, sonde_page_ask ask, sonde_page_request *r,
                                  sonde_error *error) {
  sonde_status status = SONDE_OK;
  r->ask = ask;
  r->speed = 1;
  switch (ask) {
  case SONDE_PAGE_START_EXAM: return parse_start(root, r, error);
  case SONDE_PAGE_DECIDE:
    status = read_text(root, "segment", 1, 31, r->id, sizeof r->id, error);
    return status ? status : read_text(root, "decision", 0, 15, r->text, sizeof r->text, error);
  case SONDE_PAGE_OPEN_REPLAY: return read_text(root, "exam", 1, 63, r->id, sizeof r->id, error);
  case SONDE_PAGE_SEEK: return read_time(root, r, error);
  case SONDE_PAGE_PLAY:
    status = read_bool(root, "playing", &r->playing, error);
    return status ? status : read_real(root, "speed", 0.25, 4, &r->speed, error);
  case SONDE_PAGE_COMMENT: return parse_comment(root, r, error);
  default: return SONDE_OK;
  }
}

// Requests of the program after the page's own commands, in the order of sonde_page_ask.
static const char *const TYPES[] = {
    "goal",       "controls",   "stop",        "resume", "ack",  "ping",
    "gel",        "role",       "start_exam",  "decide", "hint", "finish_exam",
    "leave_exam", "list_exams", "open_replay", "seek",   "play", "comment"};
_Static_assert(SONDE_COUNT_OF(TYPES) == PAGE_COMMAND_REQUEST + (int)SONDE_PAGE_ASKS, "a type each");

static sonde_status parse_object(const sonde_json *root, page_command *command,
                                 sonde_error *error) {
  const char *type = sonde_json_as_text(sonde_json_member(root, "type"));
  if (!type) return sonde_fail(error, SONDE_FORMAT, "a message must be an object with a \"type\"");
  size_t which = 0;
  while (which < SONDE_COUNT_OF(TYPES) && strcmp(type, TYPES[which]) != 0) ++which;
  if (which == SONDE_COUNT_OF(TYPES))
    return sonde_fail(
        error, SONDE_NOT_FOUND,
        "\"type\" must be goal, controls, stop, resume, ack, ping, gel, role or a request of "
        "docs/page_protocol.md");
  if (which >= PAGE_COMMAND_REQUEST) {
    command->type = PAGE_COMMAND_REQUEST;
    return parse_request(root, (sonde_page_ask)(which - PAGE_COMMAND_REQUEST), &command->request,
                         error);
  }
  command->type = (page_command_type)which;
  switch (which) {
  case PAGE_COMMAND_GOAL: return parse_goal(root, command, error);
  case PAGE_COMMAND_CONTROLS: return parse_controls(root, command, error);
  case PAGE_COMMAND_ACK: return read_id(root, "frame", &command->id, error);
  case PAGE_COMMAND_PING: return read_id(root, "id", &command->id, error);
  case PAGE_COMMAND_GEL: return parse_gel(root, command, error);
  case PAGE_COMMAND_ROLE: return parse_role(root, command, error);
  default: return SONDE_OK; // stop, resume
  }
}

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
  status = parse_object(root, command, error);
  sonde_json_free(root);
  return status;
}

static void take(double value, double *control) {
  if (!isnan(value)) *control = value;
}

void page_command_take(const page_command *command, sonde_session_controls *controls) {
  SONDE_ASSERT(command && controls);
  const sonde_echo_range *range = sonde_echo_ranges();
  for (size_t k = 0; k < SONDE_ECHO_SETTINGS; ++k)
    take(*(const double *)(const void *)((const char *)&command->echo + range[k].offset),
         (double *)(void *)((char *)&controls->echo + range[k].offset));
  take(command->stiffness_scale, &controls->stiffness_scale);
  take(command->damping_scale, &controls->damping_scale);
  take(command->friction_scale, &controls->friction_scale);
  if (command->strain >= 0) controls->valsalva = command->strain > 0;
  controls->echo = sonde_echo_settings_clamp(controls->echo);
}
