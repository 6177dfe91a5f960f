// Inside of the course: what its files share.
#ifndef SONDE_SRC_TRAINER_COURSE_H
#define SONDE_SRC_TRAINER_COURSE_H

#include "files/yaml.h"
#include "sonde/trainer_course.h"

void sonde_read_question(sonde_reader *reader, sonde_place at, sonde_question *question);
// A hash of what the expert does at a lesson's places, whatever their words.
uint64_t sonde_course_print(const sonde_exam_protocol *places);
// The bars of a file go to the lessons that they were measured on; no file: no bars.
sonde_status sonde_course_read_bars(sonde_course *course, const char *path, sonde_error *error);

#endif
