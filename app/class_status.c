// How the learners are doing: GET /status.json from every program at once, on this machine only.
#include "class_learners.h"

#include <assert.h>
#include <arpa/inet.h>
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

static void finish(question *q) {
  assert(q->poll.fd >= 0);
  close(q->poll.fd);
  q->poll.fd = -1;
}

// A member as text that a terminal can show.
static void take_text(const sonde_json *object, const char *key, char *to, size_t size) {
  assert(size > 1);
  const char *text = sonde_json_as_text(sonde_json_member(object, key));
  snprintf(to, size, "%.*s", (int)size - 1, text ? text : "");
  for (char *p = to; *p; ++p)
    if ((unsigned char)*p < 0x20 || *p == 0x7f) *p = ' ';
}

static double take_number(const sonde_json *object, const char *key) {
  double value = sonde_json_as_number(sonde_json_member(object, key));
  return fabs(value) < 1e6 ? value : (double)NAN;
}

void class_ask(class_room *room) {
  assert(room->count <= CLASS_LEARNERS);
  static question all[CLASS_LEARNERS];
  struct pollfd polls[CLASS_LEARNERS];
  double until_s = class_now_s() + WAIT_S;
  for (uint32_t i = 0; i < room->count; ++i) {
    // A connection that does not wait.
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons(room->learner[i].port),
                                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    all[i] = (question){.poll = {.fd = -1, .events = POLLOUT}};
    if (room->learner[i].process)
      all[i].poll.fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (all[i].poll.fd >= 0) {
      if (connect(all[i].poll.fd, (struct sockaddr *)&address, sizeof address) &&
          errno != EINPROGRESS)
        finish(&all[i]);
    }
  }
  for (double rest_s = WAIT_S; rest_s > 0; rest_s = until_s - class_now_s()) {
    bool open = false;
    for (uint32_t i = 0; i < room->count; ++i) {
      polls[i] = all[i].poll; // poll() passes over -1
      open |= all[i].poll.fd >= 0;
    }
    if (!open || poll(polls, room->count, (int)(1e3 * rest_s) + 1) < 0) break;
    for (uint32_t i = 0; i < room->count; ++i)
      if (polls[i].fd >= 0 && polls[i].revents) {
        // Sends the request, then takes what comes.
        if (!all[i].sent) {
          char request[256];
          int size =
              snprintf(request, sizeof request,
                       "GET /status.json HTTP/1.1\r\nHost: 127.0.0.1:%u\r\nConnection: close\r\n"
                       "Accept: application/json\r\nAuthorization: Bearer %s\r\n\r\n",
                       (unsigned)room->learner[i].port, room->learner[i].token);
          all[i].sent = send(all[i].poll.fd, request, (size_t)size, MSG_NOSIGNAL) == size;
          all[i].poll.events = POLLIN;
          if (!all[i].sent) finish(&all[i]);
        } else {
          ssize_t got =
              recv(all[i].poll.fd, all[i].answer + all[i].used, CLASS_ANSWER - all[i].used, 0);
          if (got > 0) all[i].used += (size_t)got;
          bool again = got < 0 && (errno == EAGAIN || errno == EINTR);
          if ((got <= 0 && !again) || all[i].used == CLASS_ANSWER) finish(&all[i]);
        }
      }
  }
  for (uint32_t i = 0; i < room->count; ++i) {
    if (all[i].poll.fd >= 0) finish(&all[i]);
    room->learner[i].status =
        (class_status){.answers = all[i].used > 0, .elapsed_s = (double)NAN, .score = (double)NAN};
    const char *body = strstr(all[i].answer, "\r\n\r\n");
    if (strncmp(all[i].answer, "HTTP/1.", 7) == 0 && strstr(all[i].answer, " 200 ") && body) {
      sonde_json *object = NULL;
      (void)sonde_json_parse(body + 4, strlen(body + 4), NULL, &object, NULL);
      take_text(object, "phase", room->learner[i].status.phase,
                sizeof room->learner[i].status.phase);
      take_text(object, "case", room->learner[i].status.patient,
                sizeof room->learner[i].status.patient);
      room->learner[i].status.elapsed_s = take_number(object, "elapsed_s");
      room->learner[i].status.score = take_number(object, "score");
      sonde_json_free(object);
    }
  }
}
