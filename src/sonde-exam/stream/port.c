// A port that is listened on.
#include "stream/port.h"

#include <arpa/inet.h>
#include <errno.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

enum { BACKLOG = 128 };

sonde_status stream_port_open(const char *name, uint16_t *port, int *listener, int *wake,
                              sonde_error *error) {
  struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(*port)};
  socklen_t size = sizeof address;
  int one = 1;
  *listener = *wake = -1;
  if (inet_pton(AF_INET, name, &address.sin_addr) != 1)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "'%.100s' is no address of this computer, expected four numbers as in "
                      "127.0.0.1",
                      name);
  *listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  *wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  bool opened = *listener >= 0 && *wake >= 0;
  if (opened) setsockopt(*listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
  if (opened && !bind(*listener, (struct sockaddr *)&address, sizeof address) &&
      !listen(*listener, BACKLOG) && !getsockname(*listener, (struct sockaddr *)&address, &size)) {
    *port = ntohs(address.sin_port);
    return SONDE_OK;
  }
  const int problem = errno;
  if (problem == EADDRINUSE)
    return sonde_fail(error, SONDE_PORT,
                      "port %u on %s is in use by another program; expected a free port, "
                      "or 0 for any free one",
                      (unsigned)*port, name);
  return sonde_fail(error, SONDE_PORT, "port %u on %s cannot be opened: %s", (unsigned)*port, name,
                    strerror(problem));
}

void stream_port_wake(int wake) {
  const uint64_t one = 1;
  (void)!write(wake, &one, sizeof one); // a full counter wakes as well
}
