// Reports as HTML: the page that draws them, built from web/src/report, with the data inside.
#include "base/base.h"
#include "base/embed.h"
#include "sonde/files.h"

#include <string.h>
#define ZLIB_CONST // the input is constant
#include <zlib.h>

// Where the template holds its title and its data; web/build.mjs sees that each stands there once.
static const char TITLE[] = "@SONDE_TITLE@", DATA[] = "@SONDE_DATA@";

#ifdef SONDE_WEB_DIR

SONDE_EMBED(sonde_report_page, SONDE_WEB_DIR "/report.html.gz");

static sonde_status load_template(char **text, sonde_error *error) {
  enum { GZIP = 16 + MAX_WBITS };
  size_t packed = (size_t)(sonde_report_page_end - sonde_report_page_begin), length = 0;
  // The last four bytes of a gzip file are the length of its contents, the lowest byte first.
  for (size_t k = 1; k <= 4; ++k) length = length << 8 | sonde_report_page_begin[packed - k];
  *text = SONDE_NEW(char, length + 1);
  if (!*text) return sonde_fail_memory(error);
  z_stream stream = {.next_in = sonde_report_page_begin,
                     .avail_in = (uInt)packed,
                     .next_out = (Bytef *)*text,
                     .avail_out = (uInt)length};
  if (inflateInit2(&stream, GZIP) != Z_OK) return sonde_fail_memory(error);
  int code = inflate(&stream, Z_FINISH);
  inflateEnd(&stream);
  return code == Z_STREAM_END ? SONDE_OK : sonde_fail_memory(error);
}

#else

// Without the built page a report shows its data as they are.
static sonde_status load_template(char **text, sonde_error *error) {
  static const char PLAIN[] =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta "
      "charset=\"utf-8\">\n<title>@SONDE_TITLE@</title>\n"
      "</head>\n<body>\n<p>This build draws no reports: it was configured with "
      "SONDE_BUILD_WEB=OFF. These are "
      "the report's data.</p>\n<pre id=\"data\"></pre>\n"
      "<script type=\"application/json\" id=\"report\">@SONDE_DATA@</script>\n"
      "<script>document.getElementById(\"data\").textContent = "
      "JSON.stringify(JSON.parse(document.getElementById(\"report\").textContent), null, "
      "1);</script>\n"
      "</body>\n</html>\n";
  *text = SONDE_NEW(char, sizeof PLAIN);
  if (!*text) return sonde_fail_memory(error);
  memcpy(*text, PLAIN, sizeof PLAIN);
  return SONDE_OK;
}

#endif

sonde_status sonde_report_write(const char *path, const char *title, const char *json,
                                size_t length, sonde_error *error) {
  SONDE_ASSERT(path && title && json && length > 1 && json[0] == '{');
  char *text = NULL;
  sonde_file *file = NULL;
  sonde_status status = load_template(&text, error);
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    const char *name = strstr(text, TITLE), *data = strstr(text, DATA);
    SONDE_ASSERT(name && data && name < data);
    const char *behind = name + sizeof TITLE - 1, *rest = data + sizeof DATA - 1;
    sonde_file_write(file, text, (size_t)(name - text));
    // Text between tags: HTML takes any other character as it is.
    for (const char *p = title; *p; ++p) {
      const char *entity = *p == '<' ? "&lt;" : *p == '&' ? "&amp;" : NULL;
      if (entity)
        sonde_file_printf(file, "%s", entity);
      else
        sonde_file_write(file, p, 1);
    }
    sonde_file_write(file, behind, (size_t)(data - behind));
    // In JSON a '<' stands within strings only; as an escape it can neither end the script nor
    // begin a comment.
    for (size_t from = 0; from < length;) {
      const char *mark = memchr(json + from, '<', length - from);
      size_t plain = mark ? (size_t)(mark - json) - from : length - from;
      sonde_file_write(file, json + from, plain);
      if (mark) sonde_file_printf(file, "\\u003c");
      from += plain + (mark != NULL);
    }
    sonde_file_write(file, rest, strlen(rest));
    status = sonde_file_commit(file, error);
  }
  sonde_free(text);
  return status;
}
