// The page in memory: the bundle that the build made (SONDE_WEB_DIR names its directory), or one
// page that says that it was not built.
#include "stream/page_data.h"

#include "base/embed.h"

static const char HTML[] = "text/html; charset=utf-8";
static const char CSS[] = "text/css; charset=utf-8";
static const char JS[] = "text/javascript; charset=utf-8";

#ifdef SONDE_WEB_DIR

SONDE_EMBED(sonde_page_html, SONDE_WEB_DIR "/index.html.gz");
SONDE_EMBED(sonde_page_css, SONDE_WEB_DIR "/style.css.gz");
SONDE_EMBED(sonde_page_js, SONDE_WEB_DIR "/app.js.gz");
SONDE_EMBED(sonde_class_html, SONDE_WEB_DIR "/class.html.gz");
SONDE_EMBED(sonde_class_css, SONDE_WEB_DIR "/class.css.gz");
SONDE_EMBED(sonde_class_js, SONDE_WEB_DIR "/class.js.gz");

static page_file files[] = {{"index.html", HTML, sonde_page_html_begin, 0, true},
                            {"style.css", CSS, sonde_page_css_begin, 0, true},
                            {"app.js", JS, sonde_page_js_begin, 0, true}};
static page_file class_files[] = {{"", HTML, sonde_class_html_begin, 0, true},
                                  {"class.css", CSS, sonde_class_css_begin, 0, true},
                                  {"class.js", JS, sonde_class_js_begin, 0, true}};

// The sizes are differences of linker symbols, which C does not take as constants.
__attribute__((constructor)) static void measure(void) {
  files[0].size = (size_t)(sonde_page_html_end - sonde_page_html_begin);
  files[1].size = (size_t)(sonde_page_css_end - sonde_page_css_begin);
  files[2].size = (size_t)(sonde_page_js_end - sonde_page_js_begin);
  class_files[0].size = (size_t)(sonde_class_html_end - sonde_class_html_begin);
  class_files[1].size = (size_t)(sonde_class_css_end - sonde_class_css_begin);
  class_files[2].size = (size_t)(sonde_class_js_end - sonde_class_js_begin);
}

#else

static const char NOT_BUILT[] =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Sonde</title>"
    "<body><h1>Sonde</h1><p>This build has no page: it was configured with "
    "SONDE_BUILD_WEB=OFF. Configure with SONDE_BUILD_WEB=ON (needs npm), or type ./run.</p>"
    "</body></html>\n";

static const page_file files[] = {
    {"index.html", HTML, (const unsigned char *)NOT_BUILT, sizeof NOT_BUILT - 1, false},
    {"style.css", CSS, NULL, 0, false},
    {"app.js", JS, NULL, 0, false}};
static const page_file class_files[] = {
    {"", HTML, (const unsigned char *)NOT_BUILT, sizeof NOT_BUILT - 1, false}};

#endif

const page_file *page_files(uint32_t *count) {
  SONDE_ASSERT(count);
  *count = SONDE_COUNT_OF(files);
  return files;
}

const page_file *page_class_files(uint32_t *count) {
  SONDE_ASSERT(count);
  *count = SONDE_COUNT_OF(class_files);
  return class_files;
}
