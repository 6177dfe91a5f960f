// A mock of the Haply service: answers every command with a state, on a port of its own.
#ifndef SONDE_TESTS_MOCK_HAPLY_H
#define SONDE_TESTS_MOCK_HAPLY_H

#include "fake.h"

#include <pthread.h>
#include <stdint.h>

typedef struct mock_haply {
  fake_control control;           // plugged: the service knows a device
  atomic_bool stop, torn, silent; // torn: every other answer is cut short
  atomic_bool hang_up;            // close the connection once
  int listener;
  uint16_t port;
  pthread_t thread;
} mock_haply;

bool mock_haply_start(mock_haply *mock);
void mock_haply_stop(mock_haply *mock);

#endif
