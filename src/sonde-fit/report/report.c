// write_text:     one file, whole or not at all.
// write_files:    the figures, then the page.
#include "report/view.h"

#include <string.h>

static sonde_status write_text(const char *directory, const char *name, const char *extension,
                               const sonde_text *text, sonde_error *error) {
  if (text->failed) return sonde_fail_memory(error);
  size_t bytes = strlen(directory) + strlen(name) + strlen(extension) + 2;
  char *path = SONDE_NEW(char, bytes);
  if (!path) return sonde_fail_memory(error);
  snprintf(path, bytes, "%s/%s%s", directory, name, extension);
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  sonde_free(path);
  if (status) return status;
  sonde_file_write(file, text->bytes, text->used);
  return sonde_file_commit(file, error);
}

static bool all_there(const sonde_report_view *view) {
  bool there = !view->memory && !view->page.failed && !view->contents.failed;
  for (uint32_t i = 0; i < view->figure_count; ++i) there = there && !view->figures[i].body.failed;
  return there;
}

static sonde_status write_files(sonde_report_view *view, const char *directory,
                                sonde_error *error) {
  sonde_text page = {0};
  sonde_page_write(view, &page);
  sonde_status status =
      page.failed ? sonde_fail_memory(error) : sonde_directory_make(directory, 0777, false, error);
  for (uint32_t i = 0; i < view->figure_count && !status; ++i) {
    sonde_text figure = {0};
    sonde_svg_write(&figure, &view->figures[i], true);
    status = write_text(directory, view->figures[i].name, ".svg", &figure, error);
    sonde_text_clear(&figure);
  }
  if (!status) status = write_text(directory, "index", ".html", &page, error);
  sonde_text_clear(&page);
  return status;
}

sonde_status sonde_fit_report_write(const sonde_fit_report *report, const char *directory,
                                    sonde_error *error) {
  SONDE_ASSERT(report && directory);
  sonde_report_view view;
  sonde_status status = sonde_view_open(report, &view, error);
  if (status) return status;
  sonde_report_summary(&view);
  sonde_report_stages(&view);
  sonde_report_curves(&view);
  sonde_report_errors(&view);
  sonde_report_error_tables(&view);
  sonde_report_maps(&view);
  sonde_report_parameters(&view);
  sonde_report_correlation(&view);
  sonde_report_profiles(&view);
  sonde_report_identifiability_section(&view);
  sonde_report_holdouts(&view);
  sonde_report_end_matter(&view);
  status = all_there(&view) ? write_files(&view, directory, error) : sonde_fail_memory(error);
  sonde_view_close(&view);
  return status;
}
