// The open port of a class. The door's thread asks class_join(), which knows its own list of places
// only; the program's thread takes from that list who has come (class_door_turn).
#include "class_door.h"

#include "class_results.h"
#include "class_scorm.h"
#include "page_token.h"

#include <arpa/inet.h>
#include <assert.h>
#include <ifaddrs.h>
#include <inttypes.h>
#include <net/if.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct place {
  char name[CLASS_NAME]; // empty: nobody's yet
  bool joined;           // somebody has come for it
  char token[SONDE_PAGE_TOKEN], watcher_token[SONDE_PAGE_TOKEN];
} place;

struct class_door {
  sonde_door *door;
  char code[SONDE_DOOR_CODE], address[SONDE_PAGE_ADDRESS];
  bool listed;
  pthread_mutex_t lock; // of the places
  uint32_t count;
  place places[CLASS_LEARNERS];
  const char *tokens[CLASS_LEARNERS]; // of the places
  double tell_s;                      // clock of the next news to the board
  class_results results;
};

// ---- joining

static int refuse(char answer[SONDE_DOOR_ANSWER], int code, const char *name, const char *why) {
  snprintf(answer, SONDE_DOOR_ANSWER, "%s%s\n", name, why);
  return code;
}

static int class_join(void *user, const char *name, bool watches, char answer[SONDE_DOOR_ANSWER]) {
  class_door *d = user;
  assert(name[0] && strlen(name) < CLASS_NAME);
  place *own = NULL, *free_place = NULL;
  int code = 200;
  pthread_mutex_lock(&d->lock);
  for (uint32_t i = 0; i < d->count; ++i) {
    if (strcmp(d->places[i].name, name) == 0) own = &d->places[i];
    if (!d->places[i].name[0] && !free_place) free_place = &d->places[i];
  }
  if (watches && !own)
    code = refuse(answer, 404, name, " is not in this class");
  else if (!watches && own && own->joined)
    code = refuse(answer, 409, name,
                  " has a place already. Was it you, in another browser? The teacher's board has "
                  "the place's address. Else join by another name.");
  else if (!own && d->listed)
    code = refuse(answer, 403, name, " is not on the list of this class");
  else if (!own && !free_place)
    code = refuse(answer, 503, "", "all places of this class are taken");
  if (code == 200) {
    place *given = own ? own : free_place;
    if (!own) snprintf(given->name, sizeof given->name, "%s", name);
    given->joined |= !watches;
    snprintf(answer, SONDE_DOOR_ANSWER, "{\"place\":%d,\"token\":\"%s\"}",
             (int)(given - d->places) + 1, watches ? given->watcher_token : given->token);
  }
  pthread_mutex_unlock(&d->lock);
  return code;
}

// ---- learning management systems

static int class_follow(void *user, uint32_t number, int64_t since_unix_s, char **answer) {
  class_door *d = user;
  char name[CLASS_NAME], date[24];
  assert(number >= 1 && number <= d->count);
  pthread_mutex_lock(&d->lock);
  memcpy(name, d->places[number - 1].name, sizeof name);
  pthread_mutex_unlock(&d->lock);
  sonde_log_date(since_unix_s, date);
  *answer = class_results_since(&d->results, name, date);
  return *answer ? 200 : 503;
}

// ---- opening

// Prints an address for each that leads to this computer.
static void print_addresses(class_door *d, const char *address, const char *teacher_token) {
  struct ifaddrs *all = NULL;
  const unsigned port = sonde_door_port(d->door);
  bool wild = strcmp(address, "0.0.0.0") == 0 && getifaddrs(&all) == 0;
  char text[INET_ADDRSTRLEN];
  snprintf(text, sizeof text, "%s", address);
  for (struct ifaddrs *p = all; wild && p; p = p->ifa_next) {
    if (!p->ifa_addr || p->ifa_addr->sa_family != AF_INET || (p->ifa_flags & IFF_LOOPBACK))
      continue;
    inet_ntop(AF_INET, &((struct sockaddr_in *)(void *)p->ifa_addr)->sin_addr, text, sizeof text);
    printf("This computer: %s\n", text);
  }
  if (all) freeifaddrs(all);
  snprintf(d->address, sizeof d->address, "https://%s:%u/", text, port);
  printf("Join at: %s\nCode: %.4s-%.4s\nTeacher: %s#%s\n", d->address, d->code, d->code + 4,
         d->address, teacher_token);
}

int class_door_open(const class_door_def *def, const class_room *room, class_door **out) {
  static const char VERB[] = "class";
  static char identity[SONDE_DOOR_IDENTITY];
  char teacher[SONDE_PAGE_TOKEN], print[SONDE_DOOR_FINGERPRINT];
  sonde_error error = {0};
  class_door *d = calloc(1, sizeof *d);
  assert(room->count >= 1 && room->count <= CLASS_LEARNERS);
  if (!d) return app_usage_error(VERB, "out of memory");
  pthread_mutex_init(&d->lock, NULL);
  pthread_mutex_init(&d->results.lock, NULL);
  d->count = room->count;
  d->listed = def->listed;
  snprintf(d->results.log, sizeof d->results.log, "%s/exams.sqlite", def->exams);
  for (uint32_t i = 0; i < room->count; ++i) {
    const class_learner *learner = &room->learner[i];
    if (learner->taken) memcpy(d->places[i].name, learner->name, sizeof d->places[i].name);
    memcpy(d->places[i].token, learner->token, sizeof d->places[i].token);
    d->tokens[i] = d->places[i].token;
    memcpy(d->places[i].watcher_token, learner->watcher_token, sizeof d->places[i].watcher_token);
  }
  sonde_status status = sonde_directory_make(def->data, 0700, true, &error);
  if (!status) status = page_identity_find(def->data, "class.pem", identity, &error);
  if (!status)
    status = page_token_find(def->data, "teacher.token", "SONDE_CLASS_TOKEN", teacher, &error);
  if (!status) status = sonde_door_code_make(d->code, &error);
  if (!status) {
    sonde_door_def door = {.address = def->address,
                           .port = def->port,
                           .identity = identity,
                           .code = d->code,
                           .teacher_token = teacher,
                           .first_port = room->learner[0].port,
                           .places = room->count,
                           .user = d,
                           .join = class_join,
                           .learner_tokens = d->tokens,
                           .follow = class_follow};
    status = sonde_door_open(&door, &d->door, &error);
  }
  memset(identity, 0, sizeof identity);
  if (status) {
    class_door_close(d);
    return app_fail(VERB, &error);
  }
  sonde_door_fingerprint(d->door, print);
  print_addresses(d, def->address, teacher);
  printf("Certificate: %s/class.pem, SHA-256 %s\n", def->data, print);
  *out = d;
  if (!def->scorm) return APP_OK;
  status = class_scorm_write(def->scorm, d->address, &error);
  if (!status) printf("SCORM 1.2: %s\n", def->scorm);
  return status ? app_fail(VERB, &error) : APP_OK;
}

// ---- while it runs

// What the board is told: who is there, how to reach them, how they are doing.
static void tell(class_door *d, const class_room *room) {
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  if (sonde_file_in_memory(&out.file, NULL)) return;
  char *text = NULL, code[16];
  size_t size;
  snprintf(code, sizeof code, "%.4s-%.4s", d->code, d->code + 4);
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_text(&out, "code", code);
  sonde_json_put_text(&out, "address", d->address);
  sonde_json_put_integer(&out, "places", room->count);
  sonde_json_put_integer(&out, "wrong", (int64_t)sonde_door_wrong(d->door));
  sonde_json_begin_list(&out, "learners");
  for (uint32_t i = 0; i < room->count; ++i) {
    const class_learner *learner = &room->learner[i];
    if (!learner->taken) continue;
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_integer(&out, "place", i + 1);
    sonde_json_put_text(&out, "name", learner->name);
    sonde_json_put_text(&out, "state", class_state(learner));
    sonde_json_put_text(&out, "case", learner->status.patient);
    sonde_json_put_real(&out, "elapsed_s", learner->status.elapsed_s, 6);
    sonde_json_put_real(&out, "score", learner->status.score, 6);
    sonde_json_put_text(&out, "token", learner->teacher_token);
    sonde_json_put_text(&out, "learner_token", learner->token);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_json_end(&out);
  if (sonde_file_take(out.file, &text, &size, NULL)) return;
  (void)sonde_door_publish(d->door, SONDE_DOOR_CLASS, text, NULL);
  sonde_free(text);
}

void class_door_turn(class_door *d, class_room *room, class_say say) {
  for (uint32_t i = 0; i < room->count; ++i) {
    class_learner *learner = &room->learner[i];
    if (learner->taken) continue;
    pthread_mutex_lock(&d->lock);
    learner->taken = d->places[i].name[0] != 0;
    if (learner->taken) memcpy(learner->name, d->places[i].name, sizeof learner->name);
    pthread_mutex_unlock(&d->lock);
    if (!learner->taken) continue;
    say(learner, "has joined");
    class_start(room, learner, say);
    d->tell_s = 0;
  }
  if (class_now_s() < d->tell_s) return;
  d->tell_s = class_now_s() + 1;
  tell(d, room);
  class_results_tell(&d->results, d->address, d->door);
}

void class_door_close(class_door *d) {
  if (!d) return;
  sonde_door_close(d->door);
  pthread_mutex_destroy(&d->lock);
  pthread_mutex_destroy(&d->results.lock);
  sonde_free(d->results.entries);
  free(d);
}
