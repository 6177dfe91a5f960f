// How the learners are doing: GET /status.json from every program at once, on this machine only.
//
// begin      a connection that does not wait
// advance    sends the request, then takes what comes
// take_text  a member as text that a terminal can show
// read_answer  the members of the answer
#include "class_learners.h"

#include <arpa/inet.h>
#include <cjson/cJSON.h>
#include <errno.h>
#include <math.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const double WAIT_S = 0.5;

typedef struct question {
  struct pollfd poll; // fd -1: done
  bool sent;
  char answer[CLASS_ANSWER + 1];
  size_t used;
} question;

static void begin(const class_learner *learner, question *q) {
  struct sockaddr_in address = {.sin_family = AF_INET,
                                .sin_port = htons(learner->port),
                                .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  q->poll.fd = -1;
  if (!learner->process) return;
  int fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) return;
  if (connect(fd, (struct sockaddr *)&address, sizeof address) && errno != EINPROGRESS)
    close(fd);
  else
    q->poll = (struct pollfd){.fd = fd, .events = POLLOUT};
}

static void finish(question *q) {
  close(q->poll.fd);
  q->poll.fd = -1;
}

static void advance(question *q, const class_learner *learner) {
  if (!q->sent) {
    char request[256];
    int size = snprintf(request, sizeof request,
                        "GET /status.json HTTP/1.1\r\nHost: 127.0.0.1:%u\r\nConnection: close\r\n"
                        "Accept: application/json\r\nAuthorization: Bearer %s\r\n\r\n",
                        (unsigned)learner->port, learner->token);
    q->sent = send(q->poll.fd, request, (size_t)size, MSG_NOSIGNAL) == size;
    q->poll.events = POLLIN;
    if (!q->sent) finish(q);
    return;
  }
  ssize_t got = recv(q->poll.fd, q->answer + q->used, CLASS_ANSWER - q->used, 0);
  if (got > 0) q->used += (size_t)got;
  bool again = got < 0 && (errno == EAGAIN || errno == EINTR);
  if ((got <= 0 && !again) || q->used == CLASS_ANSWER) finish(q);
}

static void take_text(const cJSON *object, const char *key, char *to, size_t size) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
  snprintf(to, size, "%.*s", (int)size - 1, cJSON_IsString(item) ? item->valuestring : "");
  for (char *p = to; *p; ++p)
    if ((unsigned char)*p < 0x20 || *p == 0x7f) *p = ' ';
}

static double take_number(const cJSON *object, const char *key) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
  return cJSON_IsNumber(item) && fabs(item->valuedouble) < 1e6 ? item->valuedouble : (double)NAN;
}

static void read_answer(const question *q, class_status *status) {
  *status = (class_status){.answers = q->used > 0, .elapsed_s = (double)NAN, .score = (double)NAN};
  const char *body = strstr(q->answer, "\r\n\r\n");
  if (strncmp(q->answer, "HTTP/1.", 7) != 0 || !strstr(q->answer, " 200 ") || !body) return;
  cJSON *object = cJSON_Parse(body + 4);
  take_text(object, "phase", status->phase, sizeof status->phase);
  take_text(object, "case", status->patient, sizeof status->patient);
  status->elapsed_s = take_number(object, "elapsed_s");
  status->score = take_number(object, "score");
  cJSON_Delete(object);
}

void class_ask(class_room *room) {
  static question all[CLASS_LEARNERS];
  struct pollfd polls[CLASS_LEARNERS];
  double until_s = class_now_s() + WAIT_S;
  memset(all, 0, sizeof all);
  for (uint32_t i = 0; i < room->count; ++i) begin(&room->learner[i], &all[i]);
  for (double left_s = WAIT_S; left_s > 0; left_s = until_s - class_now_s()) {
    bool open = false;
    for (uint32_t i = 0; i < room->count; ++i) {
      polls[i] = all[i].poll; // poll() passes over -1
      open |= all[i].poll.fd >= 0;
    }
    if (!open || poll(polls, room->count, (int)(1e3 * left_s) + 1) < 0) break;
    for (uint32_t i = 0; i < room->count; ++i)
      if (polls[i].fd >= 0 && polls[i].revents) advance(&all[i], &room->learner[i]);
  }
  for (uint32_t i = 0; i < room->count; ++i) {
    if (all[i].poll.fd >= 0) finish(&all[i]);
    read_answer(&all[i], &room->learner[i].status);
  }
}
