// fake_learner run --port N [--die]: stands for `sonde run` in tests of `sonde class`. Writes its
// process id to pid.N, answers who has its token with a status, or says a sentence and ends
// with 3 at once. With --hang it accepts connections and never answers.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static int listen_on(int port) {
  struct sockaddr_in address = {.sin_family = AF_INET,
                                .sin_port = htons((uint16_t)port),
                                .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  int on = 1, fd = socket(AF_INET, SOCK_STREAM, 0);
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (fd < 0 || bind(fd, (struct sockaddr *)&address, sizeof address) || listen(fd, 8)) {
    perror("fake_learner");
    exit(1);
  }
  return fd;
}

static void answer(int client, int port) {
  char request[1024] = "", body[256], reply[512];
  if (read(client, request, sizeof request - 1) <= 0) return;
  snprintf(body, sizeof body,
           "{\"trainee\":\"%s\",\"phase\":\"exam\",\"case\":\"case-%d\",\"elapsed_s\":83.2,"
           "\"score\":null}",
           getenv("SONDE_TRAINEE") ? getenv("SONDE_TRAINEE") : "?", port);
  char token[64];
  snprintf(token, sizeof token, "Authorization: Bearer %.32s\r\n",
           getenv("SONDE_PAGE_TOKEN") ? getenv("SONDE_PAGE_TOKEN") : "none");
  bool asked = strncmp(request, "GET /status.json HTTP/1.1\r\n", 27) == 0 && strstr(request, token);
  int size = snprintf(reply, sizeof reply,
                      "HTTP/1.1 %s\r\nContent-Length: %zu\r\nConnection: close\r\n\r\n%s",
                      asked ? "200 OK" : "404 Not Found", strlen(body), body);
  (void)!write(client, reply, (size_t)size);
}

int main(int argc, char **argv) {
  if (argc < 4 || strcmp(argv[1], "run") != 0 || strcmp(argv[2], "--port") != 0) return 9;
  const char *how = argc > 4 ? argv[4] : "";
  if (strcmp(how, "--die") == 0) {
    fprintf(stderr, "fake_learner: no probe is plugged in\n");
    return 3;
  }
  int port = atoi(argv[3]), fd = listen_on(port);
  char name[32];
  snprintf(name, sizeof name, "pid.%d", port);
  FILE *file = fopen(name, "w");
  fprintf(file, "%d %s\n", (int)getpid(), getenv("SONDE_TRAINEE"));
  fclose(file);
  for (;;) {
    int client = accept(fd, NULL, NULL);
    if (strcmp(how, "--hang") == 0) continue;
    answer(client, port);
    close(client);
  }
}
