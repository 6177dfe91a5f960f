// The case editor: what a teacher's page asks for.
#include "exam_app_draft.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

sonde_status exam_edit(exam_app *app, const char *entry, sonde_error *error) {
  assert(app->server && entry);
  static const char *const ACTIONS[] = {"open", "check", "save", "try", "close"};
  enum { OPEN, CHECK, SAVE, TRY, CLOSE, COUNT };
  sonde_json *root = NULL;
  sonde_case c = sonde_case_default();
  sonde_status status = sonde_json_parse(entry, strlen(entry), NULL, &root, error);
  if (status) return status;
  const char *action = sonde_json_as_text(sonde_json_member(root, "action"));
  const char *text = sonde_json_as_text(sonde_json_member(root, "text"));
  const char *alias = sonde_json_as_text(sonde_json_member(root, "case"));
  int which = 0;
  while (which < COUNT && !(action && strcmp(action, ACTIONS[which]) == 0)) ++which;
  const exam_phase before = app->phase;
  if (which == COUNT || (which == OPEN ? !alias : which != CLOSE && !text))
    status = app_error(error, SONDE_FORMAT,
                       "\"action\" must be open with a \"case\", check, save or try with a "
                       "\"text\", or close");
  else if (which != CLOSE && !app->draft && !(app->draft = calloc(1, sizeof *app->draft)))
    status = app_error(error, SONDE_MEMORY, "out of memory");
  if (status || which == CLOSE) {
    sonde_json_free(root);
    return !status && before == EXAM_EDIT ? exam_app_practice(app, error) : status;
  }
  exam_draft *draft = app->draft;
  sonde_error wrong = {0};
  const double serial = sonde_json_as_number(sonde_json_member(root, "serial"));
  draft->serial = serial >= 0 && serial < 1e9 ? (uint32_t)serial : 0;
  draft->saved[0] = 0, draft->exists = false;
  const sonde_json *follows = sonde_json_member(root, "follows");
  draft->follows = sonde_json_kind_of(follows) == SONDE_JSON_TRUE;
  sonde_free(draft->text);
  draft->text = NULL;
  if (before == EXAM_RUNNING) {
    status = app_error(&wrong, SONDE_ARGUMENT, "an exam runs: finish or leave it before");
  } else if (which == OPEN) {
    status = app_error(&wrong, SONDE_NOT_FOUND, "there is no such case");
    for (uint32_t i = 0; i < app->case_count; ++i) {
      char own[EXAM_ALIAS];
      exam_app_case_alias(app, app->case_list[i].id, own);
      if (strcmp(own, alias) == 0)
        status = sonde_case_text(&app->case_list[i], &draft->text, &wrong);
    }
    text = draft->text;
  }
  if (!status) status = exam_draft_check(app, text, &c, &wrong);
  draft->good = !status;
  if (!status && which == SAVE) {
    const sonde_json *replace = sonde_json_member(root, "replace");
    status = exam_draft_keep(app, &c, sonde_json_kind_of(replace) == SONDE_JSON_TRUE, &wrong);
  }
  snprintf(draft->message, sizeof draft->message, "%s", status ? wrong.message : "");
  if (app->phase == EXAM_PREPARING)
    exam_app_set_phase(app, draft->setup.model ? EXAM_EDIT : before, "");
  exam_app_tell_draft(app);
  if (!status && which == TRY) {
    sonde_page_request trial = {.ask = SONDE_PAGE_START_EXAM, .guidance = "full"};
    const char *protocol = sonde_json_as_text(sonde_json_member(root, "protocol"));
    snprintf(trial.protocol, sizeof trial.protocol, "%s", protocol ? protocol : "");
    app->trial = &c;
    status = exam_start(app, &trial, error);
    app->trial = NULL;
  } else {
    status = SONDE_OK;
  }
  sonde_json_free(root);
  return status;
}
