// The open port of a class: who joins gets a place, what the teacher's board is told.
#ifndef SONDE_APP_CLASS_DOOR_H
#define SONDE_APP_CLASS_DOOR_H

#include "class_learners.h"

typedef struct class_door class_door;

typedef struct class_door_def {
  const char *address; // IPv4 address of this computer
  uint16_t port;
  const char *data;  // directory of certificate and teacher's secret, made when it is missing
  const char *exams; // directory of the learners' exams
  bool listed;       // only who is on the list of names may join
  const char *scorm; // file of the package for learning management systems; NULL: none
} class_door_def;

// Opens the port for a class whose tokens are made, and prints code, addresses and fingerprint.
// Returns APP_OK, or the exit code after saying what is wrong.
int class_door_open(const class_door_def *def, const class_room *room, class_door **door);
// Starts the program of who has joined, and tells the board how all are doing.
void class_door_turn(class_door *door, class_room *room, class_say say);
// NULL is ignored.
void class_door_close(class_door *door);

#endif
