// What sonde fit says of measurements and results that no tissue gives.
#include "fit_doubts.h"

#include "app.h"

#include <assert.h>
#include <stdio.h>

void fit_doubts_sentence(const sonde_doubt *d, const char *path, char *text, size_t room) {
  char line[16] = "", curve[96] = "", more[64] = "";
  if (d->line) snprintf(line, sizeof line, ":%u", d->line);
  if (d->site != UINT32_MAX)
    snprintf(curve, sizeof curve, "site %u, probe %s: ", d->site, d->probe);
  if (d->site != UINT32_MAX && d->curves > 1)
    snprintf(more, sizeof more, " (%u curves like this)", d->curves);
  snprintf(text, room, "%.200s%s: %s%s%s", path, line, curve, d->sentence, more);
}

sonde_status fit_doubts_decide(const sonde_doubts *doubts, const char *path, bool accept,
                               sonde_error *error) {
  const sonde_doubt *d = sonde_doubts_gravest(doubts);
  char text[900];
  if (!d || d->grade == SONDE_DOUBT_WARNING) return SONDE_OK;
  if (d->grade == SONDE_DOUBT_IMPLAUSIBLE && accept) return SONDE_OK;
  fit_doubts_sentence(d, path, text, sizeof text);
  bool may = d->grade == SONDE_DOUBT_IMPLAUSIBLE;
  return app_error(error, SONDE_FORMAT, "%s%s", text,
                   may ? "; --accept-implausible fits it nevertheless" : "");
}

void fit_doubts_print(const sonde_doubts *doubts, uint32_t first, const char *path) {
  assert(first <= doubts->count);
  for (uint32_t k = first; k < doubts->count; ++k) {
    char text[900];
    fit_doubts_sentence(&doubts->doubt[k], path, text, sizeof text);
    fprintf(stderr, "sonde fit: warning: %s\n", text);
  }
}

void fit_doubts_print_json(const sonde_doubts *doubts, const char *path) {
  app_json_object("warnings");
  for (uint32_t k = 0; k < doubts->count; ++k) {
    char text[900];
    fit_doubts_sentence(&doubts->doubt[k], path, text, sizeof text);
    app_json_text(doubts->doubt[k].kind, text);
  }
  app_json_close();
}
