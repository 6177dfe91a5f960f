// Drawings as SVG: words are escaped, coordinates come back within half a tenth in any locale,
// outlines are closed.
#include "fixture.h"
#include "sonde/files.h"

#include <locale.h>
#include <unistd.h>

static sonde_file *begin(const char *title) {
  sonde_file *file = NULL;
  assert_int_equal(sonde_file_in_memory(&file, NULL), SONDE_OK);
  sonde_svg_begin(file, title, 100, 50);
  return file;
}

static char *take(sonde_file *file) {
  size_t count;
  char *text[1] = {NULL};
  assert_int_equal(sonde_file_take(file, text, &count, NULL), SONDE_OK);
  assert_int_equal(strlen(text[0]), count);
  return text[0];
}

static void words_are_escaped(void **state) {
  (void)state;
  sonde_file *file = begin("a<b>&");
  sonde_svg_put_text(file, 1, 2, "class='tick'", "k\u2080 <\"'> \x01\xff \xe2\x82");
  char *text = take(file);
  assert_non_null(strstr(text, "<title>a&#60;b&#62;&#38;</title>"));
  assert_non_null(strstr(text, ">k\u2080 &#60;\"'&#62; \ufffd\ufffd \ufffd\ufffd</text>"));
  sonde_free(text);
}

// A line through points of all signs: added up nothing is lost, whatever the locale's decimal
// point.
static void coordinates_come_back(void **state) {
  (void)state;
  static const char *const COMMA[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "C.UTF-8"};
  for (size_t i = 0; i < SONDE_COUNT_OF(COMMA) && !setlocale(LC_ALL, COMMA[i]); ++i) {
  }
  enum { COUNT = 200 };
  double xy[COUNT][2];
  for (int i = 0; i < COUNT; ++i) xy[i][0] = 100 * sin(1.3 * i), xy[i][1] = 0.3 * cos(2.1 * i);
  sonde_file *file = begin("line");
  sonde_svg_put_line(file, (const double(*)[2])xy, COUNT, "fill='none'");
  char *text = take(file);
  size_t p = (size_t)(strstr(text, " d='") - text) + 4;
  for (int i = 0; i < COUNT; ++i)
    for (int k = 0; k < 2; ++k) {
      assert_true(text[p] == (k ? ' ' : i ? 'L' : 'M'));
      assert_near(sonde_parse_real(text + p + 1, NULL), xy[i][k], 0.05 + 1e-9);
      p += 1 + strspn(text + p + 1, "-.0123456789");
    }
  assert_int_equal(text[p], '\''); // open
  setlocale(LC_ALL, "C");
  sonde_free(text);
}

static void outlines_are_closed_one_by_one(void **state) {
  (void)state;
  const double xy[6][2] = {{0, 0}, {1, 0}, {0, 1}, {5, 5}, {6, 5}, {5, -0.04}};
  sonde_file *file = begin("outlines");
  sonde_svg_put_outlines(file, xy, 6, 3, "fill='#000'");
  sonde_svg_put_outlines(file, xy, 0, 3, "fill='#000'");
  char *text = take(file);
  assert_non_null(strstr(text, "<path fill='#000' d='M0 0L1 0L0 1zM5 5L6 5L5 0z'/>\n"));
  sonde_free(text);
}

static void drawings_end(void **state) {
  (void)state;
  char path[300];
  snprintf(path, sizeof path, "%s/drawing_%d.svg", SONDE_BINARY_DIR, (int)getpid());
  sonde_file *file = NULL;
  assert_int_equal(sonde_file_create(path, &file, NULL), SONDE_OK);
  sonde_svg_begin(file, "end", 10, 10);
  sonde_svg_put_circle(file, 5, 5.25, 2, "fill='#fff'");
  assert_int_equal(sonde_svg_end(file, NULL), SONDE_OK);
  char *text = NULL;
  size_t count;
  assert_int_equal(sonde_file_load(path, &text, &count, NULL), SONDE_OK);
  assert_non_null(strstr(text, "<circle cx='5' cy='5.3' r='2' fill='#fff'/>\n</svg>\n"));
  unlink(path);
  sonde_free(text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(words_are_escaped),
      cmocka_unit_test(coordinates_come_back),
      cmocka_unit_test(outlines_are_closed_one_by_one),
      cmocka_unit_test(drawings_end),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
