// Reports: the data come back from the file as they went in, whatever they hold, and can neither
// end their script nor leave it; a failed write is told and leaves nothing.
#include "fixture.h"
#include "sonde/base_json.h"
#include "sonde/files.h"

#include "base/base.h"

#include <unistd.h>

static const char BEGIN[] = "<script type=\"application/json\" id=\"report\">", END[] = "</script>";

static char *write_report(const char *title, const char *json, const char *name) {
  char path[300];
  char *text;
  size_t count;
  snprintf(path, sizeof path, "%s/%s_%d.html", SONDE_BINARY_DIR, name, (int)getpid());
  assert_int_equal(sonde_report_write(path, title, json, strlen(json), NULL), SONDE_OK);
  assert_int_equal(sonde_file_load(path, &text, &count, NULL), SONDE_OK);
  assert_int_equal(strlen(text), count);
  unlink(path);
  return text;
}

// The text between the script's tags, as a browser takes it: up to the first end tag.
static void data_come_back(void **state) {
  (void)state;
  static const char JSON[] =
      "{\"kind\":\"none\",\"name\":\"</script><!--<script>\",\"n\":[1,2.5,-3]}";
  char *page = write_report("data", JSON, "report_data");
  const char *from = strstr(page, BEGIN);
  assert_non_null(from);
  from += sizeof BEGIN - 1;
  const char *to = strstr(from, END);
  assert_non_null(to);
  assert_null(memchr(from, '<', (size_t)(to - from)));
  sonde_json *root;
  assert_int_equal(sonde_json_parse(from, (size_t)(to - from), NULL, &root, NULL), SONDE_OK);
  const char *name = sonde_json_as_text(sonde_json_member(root, "name"));
  assert_string_equal(name, "</script><!--<script>");
  const sonde_json *n = sonde_json_member(root, "n");
  assert_int_equal(sonde_json_count(n), 3);
  assert_true(sonde_json_as_number(sonde_json_next(sonde_json_first(n))) == 2.5);
  sonde_json_free(root);
  sonde_free(page);
}

static void titles_are_text(void **state) {
  (void)state;
  char *page = write_report("a</title><b>&", "{}", "report_title");
  assert_non_null(strstr(page, "<title>a&lt;/title>&lt;b>&amp;</title>"));
  assert_null(strstr(page, "@SONDE_"));
  sonde_free(page);
}

// Nothing is loaded from elsewhere: no address beside those that only name a kind of XML or a
// licence's page.
static void page_needs_nothing_else(void **state) {
  (void)state;
  static const char *const FOREIGN[] = {"<link", " src=",   "@import", "url(//",
                                        "<img",  "<iframe", "import("};
  char *page = write_report("self", "{}", "report_self");
  for (size_t i = 0; i < SONDE_COUNT_OF(FOREIGN); ++i)
    if (strstr(page, FOREIGN[i])) fail_msg("the page holds '%s'", FOREIGN[i]);
  sonde_free(page);
}

static void failed_writes_are_told(void **state) {
  (void)state;
  sonde_error error = {0};
  assert_int_equal(sonde_report_write("/nonexistent/a.html", "t", "{}", 2, &error), SONDE_IO);
  assert_non_null(strstr(error.message, "/nonexistent/a.html"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(data_come_back),
      cmocka_unit_test(titles_are_text),
      cmocka_unit_test(page_needs_nothing_else),
      cmocka_unit_test(failed_writes_are_told),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
