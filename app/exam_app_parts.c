// An exam in several positions of the patient is recorded in parts, one after the other, each on
// the model of its position: exam.rec, exam-2.rec, exam-3.rec. Their setups say which position it
// is.
#include "exam_app_export.h"

#include <assert.h>
#include <stdio.h>
#include <unistd.h>

const char *exam_part_path(char path[EXAM_PATH], const char *directory, uint32_t part) {
  char name[32];
  assert(part >= 1 && part <= EXAM_PARTS);
  snprintf(name, sizeof name, "exam-%u.rec", part);
  return exam_app_path(path, directory, part > 1 ? name : "exam.rec");
}

uint32_t exam_part_count(const char *directory) {
  char path[EXAM_PATH];
  uint32_t count = 0;
  while (count < EXAM_PARTS && access(exam_part_path(path, directory, count + 1), F_OK) == 0)
    ++count;
  return count;
}

bool exam_part_position(const char *directory, uint32_t part, sonde_limb_position *position) {
  char path[EXAM_PATH];
  sonde_json *setup = exam_read_setup(exam_part_path(path, directory, part));
  const char *key = sonde_json_as_text(sonde_json_member(setup, "position"));
  const bool known = sonde_position_parse(key, position);
  sonde_json_free(setup);
  return known;
}

sonde_status exam_part_case(const char *recording, sonde_case *patient, bool *known,
                            sonde_error *error) {
  sonde_json *setup = exam_read_setup(recording);
  const char *text = sonde_json_as_text(sonde_json_member(setup, "patient"));
  const char *key = sonde_json_as_text(sonde_json_member(setup, "position"));
  *known = text != NULL;
  sonde_status status = text ? sonde_case_parse(text, recording, patient, error) : SONDE_OK;
  if (text && !status) (void)sonde_position_parse(key, &patient->position);
  sonde_json_free(setup);
  return status;
}

sonde_status exam_part_leg(const char *recording, const char *path, bool chosen, const char *cases,
                           sonde_case_setup *leg, bool *known, sonde_error *error) {
  sonde_case patient;
  *leg = (sonde_case_setup){0};
  sonde_status status = exam_part_case(recording, &patient, known, error);
  *known = *known && (!chosen || patient.thigh == SONDE_CASE_BUNDLED);
  if (!status && *known) return sonde_case_build(&patient, path, cases, leg, error);
  return status ? status : sonde_limb_model_load(path, &leg->model, error);
}

sonde_status exam_part_comments(const char *directory, sonde_comments *comments,
                                sonde_error *error) {
  char path[EXAM_PATH];
  const uint32_t parts = exam_part_count(directory);
  sonde_status status = sonde_comments_load(exam_part_path(path, directory, 1), comments, error);
  for (uint32_t part = 2; part <= parts && !status; ++part) {
    sonde_comments more = {0};
    status = sonde_comments_load(exam_part_path(path, directory, part), &more, error);
    for (uint32_t i = 0; i < more.count && comments->count < SONDE_MAX_COMMENTS; ++i)
      comments->list[comments->count++] = more.list[i]; // a list has room for the most
    sonde_comments_clear(&more);
  }
  return status;
}
