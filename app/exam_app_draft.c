// The draft of the case editor: read and built as `sonde cases --check` does it, its leg in view,
// kept among the user's own cases.
#include "exam_app_draft.h"

#include <assert.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void exam_draft_destroy(exam_draft *draft) {
  if (!draft) return;
  sonde_case_setup_clear(&draft->setup);
  sonde_free(draft->text);
  free(draft->right);
  free(draft);
}

// Puts the leg of a case in view, and takes it over; the page keeps what it shows when it is that
// leg already: equal bodies, seeds and positions make equal legs.
static sonde_status show_leg(exam_app *app, const sonde_case *of, sonde_case_setup *leg,
                             sonde_error *error) {
  exam_draft *draft = app->draft;
  assert(draft && leg->model);
  sonde_case_setup before = draft->setup;
  const sonde_case *seen = &draft->seen;
  if (before.model && seen->thigh == of->thigh && seen->seed == of->seed &&
      seen->position == of->position && memcmp(&seen->leg, &of->leg, sizeof of->leg) == 0 &&
      memcmp(&seen->known, &of->known, sizeof of->known) == 0) {
    sonde_case_setup_clear(leg);
    return SONDE_OK;
  }
  sonde_status status =
      sonde_page_show_model(app->server, leg->model, app->probes, app->probe_count, error);
  if (status) {
    sonde_case_setup_clear(leg);
    return status;
  }
  draft->setup = *leg, draft->seen = *of;
  sonde_case_setup_clear(&before);
  sonde_page_conceal(app->server, false, false);
  exam_app_end_session(app);
  app->draft = NULL; // not of what goes
  exam_app_change(app, NULL, NULL);
  app->draft = draft;
  return SONDE_OK;
}

// Calls the main vein's segments, those that the case names, and those that it would call otherwise
// unless they were named, what their veins are.
static void follow_findings(sonde_case *of, const sonde_case_setup *leg) {
  const sonde_case before = *of;
  of->truth_count = 0;
  of->thrombosis = leg->thrombosis;
  for (uint32_t i = 0; i < leg->map.segment_count; ++i) {
    const sonde_exam_segment *segment = &leg->map.segment[i];
    const sonde_decision is = leg->clot[i] ? SONDE_DECISION_CLOT : SONDE_DECISION_COMPRESSIBLE;
    bool named = sonde_case_truth(of, segment->name) != is;
    for (uint32_t k = 0; k < before.truth_count; ++k)
      named |= strcmp(before.truth_segment[k], segment->name) == 0;
    if (!named) continue;
    memcpy(of->truth_segment[of->truth_count], segment->name, sizeof segment->name);
    of->truth[of->truth_count++] = is;
  }
}

sonde_status exam_draft_check(exam_app *app, const char *text, sonde_case *out,
                              sonde_error *error) {
  assert(app->draft && text);
  sonde_case_setup leg = {0};
  sonde_status status = sonde_case_parse(text, "case", out, error);
  if (!status && out->thigh == SONDE_CASE_MODEL)
    status =
        app_error(error, SONDE_ARGUMENT,
                  "the page edits no case with a model file: give a leg, or a thigh by its seed");
  if (status) return status;
  exam_draft *draft = app->draft;
  if (draft->right && draft->right_follows == draft->follows && strcmp(draft->right, text) == 0) {
    *out = draft->told;
    return SONDE_OK;
  }
  free(draft->right);
  draft->right = NULL;
  exam_app_set_phase(app, EXAM_PREPARING, "The leg of the case is being made.");
  sonde_case untold = *out;
  if (draft->follows) untold.truth_count = 0;
  status = sonde_case_build(&untold, exam_app_bundled(app), app->own_cases, &leg, error);
  if (!status && draft->follows) follow_findings(out, &leg);
  if (!status) status = show_leg(app, out, &leg, error);
  if (!status) {
    draft->told = *out, draft->right_follows = draft->follows;
    draft->right = strdup(text);
    return SONDE_OK;
  }
  // Nothing was built; but where a clot or the truth is wrong is best seen on the leg.
  sonde_limb_body body;
  sonde_limb_model_def def = sonde_limb_model_def_default();
  sonde_limb_setting setting;
  if (out->position < SONDE_LIMB_POSITIONS) {
    setting = sonde_limb_setting_usual(out->position);
    def.setting = &setting;
  }
  def.provenance = "Synthetic limb of a training case";
  if (out->thigh != SONDE_CASE_LEG || sonde_limb_draw(&out->leg, out->seed, &body, NULL) ||
      sonde_limb_model(&body, &def, &leg.model, NULL))
    return status;
  if (sonde_vein_map_make(leg.model, &leg.map, NULL))
    sonde_case_setup_clear(&leg);
  else
    (void)show_leg(app, out, &leg, NULL);
  return status;
}

// ---- the user's own cases

sonde_status exam_app_load_cases(exam_app *app, sonde_error *error) {
  sonde_case *shipped = NULL;
  uint32_t count = 0;
  sonde_status status = sonde_case_list(app->cases, &shipped, &count, error);
  if (status) return status;
  sonde_case *all = calloc(count + EXAM_OWN_CASES + 1, sizeof *all);
  if (all) memcpy(all, shipped, count * sizeof *all);
  sonde_free(shipped);
  if (!all) return app_error(error, SONDE_MEMORY, "out of memory");
  uint32_t end = count;
  // One file that cannot be read is no reason to stay without the others. By id.
  struct dirent **list = NULL;
  const int files = scandir(app->own_cases, &list, NULL, alphasort);
  for (int i = 0; i < files; ++i) {
    char path[EXAM_PATH];
    sonde_error wrong = {0};
    const char *name = list[i]->d_name;
    const size_t length = strlen(name);
    if (name[0] == '.' || length <= 5 || strcmp(name + length - 5, ".yaml") != 0) continue;
    if (sonde_case_load(exam_app_path(path, app->own_cases, name), &all[end], &wrong)) {
      fprintf(stderr, "sonde run: a case is left out: %s\n", wrong.message);
      continue;
    }
    const char *reason = end == count + EXAM_OWN_CASES ? "there are too many of one's own" : "";
    if (all[end].thigh == SONDE_CASE_MODEL) reason = "a case of one's own has no model file";
    for (uint32_t k = 0; k < end; ++k)
      if (strcmp(all[k].id, all[end].id) == 0) reason = "another case has its id";
    if (reason[0]) {
      fprintf(stderr, "sonde run: a case is left out: %s: %s\n", path, reason);
      continue;
    }
    for (uint32_t k = end++; k > count && strcmp(all[k - 1].id, all[k].id) > 0; --k) {
      const sonde_case later = all[k - 1];
      all[k - 1] = all[k], all[k] = later;
    }
  }
  for (int i = 0; i < files; ++i) free(list[i]);
  free(list);
  free(app->case_list);
  app->case_list = all;
  app->shipped_count = count, app->case_count = end;
  assert(app->case_count - app->shipped_count <= EXAM_OWN_CASES);
  return SONDE_OK;
}

sonde_status exam_draft_keep(exam_app *app, const sonde_case *c, bool replace, sonde_error *error) {
  assert(app->draft && !app->draft->saved[0] && app->shipped_count <= app->case_count);
  assert(c->id[0] && !strchr(c->id, '/') && c->id[0] != '.'); // a file of this directory
  char path[EXAM_PATH], name[64];
  bool listed = false;
  for (uint32_t i = 0; i < app->case_count; ++i) {
    const bool same = strcmp(app->case_list[i].id, c->id) == 0;
    listed |= same;
    if (same && i < app->shipped_count)
      return app_error(error, SONDE_ARGUMENT,
                       "the case '%s' comes with the program: give this one another id", c->id);
  }
  snprintf(name, sizeof name, "%s.yaml", c->id);
  if (!exam_app_path(path, app->own_cases, name)[0])
    return app_error(error, SONDE_ARGUMENT, "the path of the own cases is too long");
  const bool there = access(path, F_OK) == 0;
  if (listed && !there)
    return app_error(error, SONDE_ARGUMENT,
                     "another file of your cases has the id '%s': give this one another id", c->id);
  app->draft->exists = !replace && there;
  if (app->draft->exists)
    return app_error(error, SONDE_ARGUMENT, "there is a case '%s' of yours already", c->id);
  if (!there && app->case_count - app->shipped_count >= EXAM_OWN_CASES)
    return app_error(error, SONDE_ARGUMENT,
                     "there are %d cases of yours already, which is the most", EXAM_OWN_CASES);
  sonde_status status = sonde_directory_make(app->own_cases, 0700, true, error);
  if (!status) status = sonde_case_save(c, path, error);
  if (!status) status = exam_app_load_cases(app, error);
  if (status) return status;
  snprintf(app->draft->saved, sizeof app->draft->saved, "%s", path);
  exam_app_tell_greeting(app);
  return SONDE_OK;
}
