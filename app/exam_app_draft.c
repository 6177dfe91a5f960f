// The draft of the case editor: read and built as `sonde cases --check` does it, its leg in view,
// kept.
#include "exam_app_parts.h"

#include <assert.h>
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

// Puts a leg in view, and takes it over; the page keeps what it shows when it is that leg already.
static sonde_status show_leg(exam_app *app, sonde_case_setup *leg, sonde_error *error) {
  exam_draft *draft = app->draft;
  assert(draft && leg->model);
  sonde_case_setup before = draft->setup;
  const sonde_mesh *skin = &leg->model->surface,
                   *seen = before.model ? &before.model->surface : NULL;
  if (seen && seen->vertex_count == skin->vertex_count &&
      memcmp(seen->vertices, skin->vertices, skin->vertex_count * sizeof *skin->vertices) == 0) {
    sonde_case_setup_clear(leg);
    return SONDE_OK;
  }
  sonde_status status =
      sonde_page_show_model(app->server, leg->model, app->probes, app->probe_count, error);
  if (status) {
    sonde_case_setup_clear(leg);
    return status;
  }
  draft->setup = *leg;
  sonde_case_setup_clear(&before);
  sonde_page_conceal(app->server, false, false);
  exam_app_end_session(app);
  app->draft = NULL; // not of what goes
  exam_app_change(app, NULL, NULL);
  app->draft = draft;
  return SONDE_OK;
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
  if (app->draft->right && strcmp(app->draft->right, text) == 0) return SONDE_OK;
  free(app->draft->right);
  app->draft->right = NULL;
  status = sonde_case_build(out, exam_app_bundled(app), app->own_cases, &leg, error);
  if (!status) status = show_leg(app, &leg, error);
  if (!status) {
    app->draft->right = strdup(text);
    return SONDE_OK;
  }
  sonde_limb_body body;
  sonde_limb_model_def def = sonde_limb_model_def_default();
  sonde_limb_setting setting;
  if (out->position < SONDE_LIMB_POSITIONS) {
    setting = sonde_limb_setting_usual(out->position);
    def.setting = &setting;
  }
  def.name = out->id, def.provenance = "Synthetic limb of a training case";
  if (out->thigh != SONDE_CASE_LEG || sonde_limb_draw(&out->leg, out->seed, &body, NULL) ||
      sonde_limb_model(&body, &def, &leg.model, NULL))
    return status;
  if (sonde_vein_map_make(leg.model, &leg.map, NULL))
    sonde_case_setup_clear(&leg);
  else
    (void)show_leg(app, &leg, NULL);
  return status;
}

sonde_status exam_draft_keep(exam_app *app, const sonde_case *c, bool replace, sonde_error *error) {
  char path[EXAM_PATH], name[64];
  for (uint32_t i = 0; i < app->shipped_count; ++i)
    if (strcmp(app->case_list[i].id, c->id) == 0)
      return app_error(error, SONDE_ARGUMENT,
                       "the case '%s' comes with the program: give this one another id", c->id);
  snprintf(name, sizeof name, "%s.yaml", c->id);
  if (!exam_app_path(path, app->own_cases, name)[0])
    return app_error(error, SONDE_ARGUMENT, "the path of the own cases is too long");
  app->draft->exists = !replace && access(path, F_OK) == 0;
  if (app->draft->exists)
    return app_error(error, SONDE_ARGUMENT, "there is a case '%s' of yours already", c->id);
  sonde_status status = sonde_directory_make(app->own_cases, 0700, true, error);
  if (!status) status = sonde_case_save(c, path, error);
  if (!status) status = exam_app_load_cases(app, error);
  if (status) return status;
  snprintf(app->draft->saved, sizeof app->draft->saved, "%s", path);
  exam_app_tell_greeting(app);
  return SONDE_OK;
}
