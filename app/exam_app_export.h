// A kept exam for other programs: what is recorded of it, files of its worksheet for an archive,
// and what the page downloads.
#ifndef SONDE_APP_EXAM_APP_EXPORT_H
#define SONDE_APP_EXAM_APP_EXPORT_H

#include "exam_app_parts.h"

// What the page looks at to download it, and the export under way.
struct exam_export {
  char id[64], directory[EXAM_PATH]; // of the exam; empty: none
  char name[EXAM_ALIAS];             // "2.igs.mha": part and ending of the sequence; empty: none
  pid_t child;                       // that writes it; 0: nobody
  int said;                          // where it says how far it is
  int percent;
  bool ready, cancelled;
  size_t line_length;
  char line[EXAM_SENTENCE], message[EXAM_SENTENCE];
};

// exam_app_parts.c.
// The case that a part was recorded on, as its setup has it, in the part's position.
// @param[out] known false: the setup has no case, and *patient is as before
sonde_status exam_part_case(const char *recording, sonde_case *patient, bool *known,
                            sonde_error *error);
// The leg that a recording was made on: of an exam that of its case, else, and when a file was
// chosen for a case with a leg of its own, the one of the file. @param path of the bundled thigh or
// that file
// @param cases where files lie that the case names @param[out] leg with its model; cleared by
// sonde_case_setup_clear() @param[out] known it is that of the case, with what the case has in it
sonde_status exam_part_leg(const char *recording, const char *path, bool chosen, const char *cases,
                           sonde_case_setup *leg, bool *known, sonde_error *error);

// exam_app_archive.c: the worksheet as a structured report of DICOM, worksheet.dcm.
sonde_status exam_sheet_archive(const exam *of, sonde_error *error);
// What the DICOM file of a picture says.
sonde_dicom_about exam_sheet_about(const exam *of, const sonde_sheet_picture *picture);

// exam_app_export.c: files of a kept exam for the page.
// An id names one directory.
bool exam_is_id(const char *id);
sonde_status exam_export_ask(exam_app *app, const sonde_page_request *request, sonde_error *error);
void exam_export_turn(exam_app *app);
// Ends what is under way and removes its file.
void exam_export_end(exam_app *app);

#endif
