// Texts and numbers of reports: escaping, damaged UTF-8, rounding, the locale.
#include "fixture.h"
#include "report/svg.h"

#include <locale.h>

static void assert_escapes(const char *from, const char *to) {
  sonde_text text = {0};
  sonde_text_put(&text, "");
  sonde_text_escape(&text, from);
  assert_false(text.failed);
  assert_string_equal(text.bytes, to);
  sonde_text_clear(&text);
}

static void markup_is_escaped(void **state) {
  (void)state;
  assert_escapes("a<b & \"c\" > 'd'", "a&lt;b &amp; &quot;c&quot; &gt; &#39;d&#39;");
  assert_escapes(NULL, "");
  assert_escapes("&amp;", "&amp;amp;");
}

// What XML cannot hold is replaced byte by byte; what it can hold stays, also beyond 16 bits.
static void damaged_text_is_replaced(void **state) {
  (void)state;
  assert_escapes("k\u2080 \u00e9 \U0001f9b5\tx\n", "k\u2080 \u00e9 \U0001f9b5\tx\n");
  assert_escapes("a\x01z\x1f", "a\ufffdz\ufffd");
  assert_escapes("\xff\xfe", "\ufffd\ufffd");
  assert_escapes("\xc0\xaf", "\ufffd\ufffd");           // overlong '/'
  assert_escapes("\xed\xa0\x80", "\ufffd\ufffd\ufffd"); // half of a surrogate pair
  assert_escapes("\xe2\x82", "\ufffd\ufffd");           // cut off
  assert_escapes("\xf4\x90\x80\x80", "\ufffd\ufffd\ufffd\ufffd");
}

static void numbers_round_and_read_well(void **state) {
  (void)state;
  assert_string_equal(sonde_fixed(1.25, 1).s, "1.3");
  assert_string_equal(sonde_fixed(-0.04, 1).s, "0.0"); // no minus in front of nothing
  assert_string_equal(sonde_fixed(-12.345, 2).s, "\u221212.35");
  assert_string_equal(sonde_fixed(0.999, 2).s, "1.00");
  assert_string_equal(sonde_fixed(NAN, 2).s, "\u2013");
  assert_string_equal(sonde_fixed(INFINITY, 0).s, "\u2013");
  assert_string_equal(sonde_fixed_signed(3, 1).s, "+3.0");
  assert_string_equal(sonde_fixed_signed(0.01, 1).s, "0.0");
  assert_string_equal(sonde_significant(0.0123456, 3).s, "0.0123");
  assert_string_equal(sonde_significant(9.996, 3).s, "10.0");
  assert_string_equal(sonde_significant(183412, 3).s, "183412");
  assert_string_equal(sonde_significant(1.8e7, 2).s, "1.8 \u00d7 10\u2077");
  assert_string_equal(sonde_significant(-2.5e-12, 2).s, "\u22122.5 \u00d7 10\u207b\u00b9\u00b2");
  assert_string_equal(sonde_significant(0, 3).s, "0");
  assert_string_equal(sonde_short(2).s, "2");
  assert_string_equal(sonde_short(2.50).s, "2.5");
  assert_string_equal(sonde_short(100).s, "100");
  assert_string_equal(sonde_grouped(0).s, "0");
  assert_string_equal(sonde_grouped(999).s, "999");
  assert_string_equal(sonde_grouped(1234567).s, "1,234,567");
}

// A coordinate read back is within half a tenth, for all signs and sizes.
static void coordinates_are_plain(void **state) {
  (void)state;
  for (int i = -2000; i < 2000; ++i) {
    double x = 0.0371 * i;
    sonde_number number = sonde_coordinate(x);
    assert_int_equal(strspn(number.s, "-.0123456789"), strlen(number.s));
    assert_near(sonde_parse_real(number.s, NULL), x, 0.05 + 1e-9);
  }
  assert_string_equal(sonde_coordinate(-0.01).s, "0");
}

static void numbers_do_not_follow_the_locale(void **state) {
  (void)state;
  static const char *const COMMA[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "C.UTF-8"};
  for (size_t i = 0; i < SONDE_COUNT_OF(COMMA) && !setlocale(LC_ALL, COMMA[i]); ++i) {
  }
  assert_string_equal(sonde_fixed(1234.5, 1).s, "1234.5");
  assert_string_equal(sonde_coordinate(0.5).s, "0.5");
  setlocale(LC_ALL, "C");
}

// The path's steps, added up, come back to where the points were.
static void paths_add_up(void **state) {
  (void)state;
  sonde_text text = {0};
  sonde_path path = sonde_path_begin(&text, "class='line'");
  for (int i = 0; i < 50; ++i) {
    double x = 100 * sin(1.3 * i), y = 100 * cos(2.1 * i);
    if (i == 0)
      sonde_path_move(&path, x, y);
    else
      sonde_path_draw(&path, x, y);
  }
  sonde_path_end(&path);
  double sum[2] = {0, 0};
  int count = 0;
  for (const char *p = strstr(text.bytes, " d='") + 4; *p != '\'';) {
    const char *end;
    if (*p == 'm' || *p == 'l' || *p == ' ') {
      ++p;
      continue;
    }
    sum[count++ % 2] += sonde_parse_real(p, &end);
    assert_ptr_not_equal(end, p);
    p = end;
  }
  assert_int_equal(count, 100);
  assert_near(sum[0], 100 * sin(1.3 * 49), 0.05 + 1e-9);
  assert_near(sum[1], 100 * cos(2.1 * 49), 0.05 + 1e-9);
  sonde_text_clear(&text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(markup_is_escaped),
      cmocka_unit_test(damaged_text_is_replaced),
      cmocka_unit_test(numbers_round_and_read_well),
      cmocka_unit_test(coordinates_are_plain),
      cmocka_unit_test(numbers_do_not_follow_the_locale),
      cmocka_unit_test(paths_add_up),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
