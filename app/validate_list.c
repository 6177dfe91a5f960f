// One line per measure as it comes, or one JSON object at the end.
#include "validate_list.h"

#include "app.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

void validate_note(validate_list *l, const char *name, double value, double least, double most,
                   const char *target) {
  assert(least <= most);
  if (l->count == VALIDATE_MOST) return;
  validate_measure *m = &l->list[l->count++];
  *m = (validate_measure){.value = value, .least = least, .most = most};
  m->pass = value >= least && value <= most;
  l->failed += !m->pass;
  snprintf(m->name, sizeof m->name, "%s", name);
  if (target)
    snprintf(m->target, sizeof m->target, "%s", target);
  else if (isfinite(most))
    snprintf(m->target, sizeof m->target, "<= %g", most);
  else
    snprintf(m->target, sizeof m->target, ">= %g", least);
  if (l->json) return;
  app_progress_end();
  printf("%-34s %12.5g   %-36s %s\n", name, value, m->target, m->pass ? "pass" : "FAIL");
  fflush(stdout);
  if (l->working) app_progress_begin(l->working);
}

bool validate_end(const validate_list *l) {
  app_progress_end();
  if (l->json) {
    app_json_begin();
    for (const validate_measure *m = l->list; m < l->list + l->count; ++m) {
      app_json_object(m->name);
      app_json("value:%g least:%g most:%g target:%s pass:%hhd", m->value, m->least, m->most,
               m->target, m->pass);
      app_json_close();
    }
    const bool pass = l->failed == 0;
    app_json("passed:%u failed:%u pass:%hhd", l->count - l->failed, l->failed, pass);
    app_json_end();
  } else
    printf("%d passed, %d failed\n", l->count - l->failed, l->failed);
  return l->failed == 0;
}
