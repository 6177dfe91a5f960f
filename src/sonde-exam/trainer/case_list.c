// The cases of a directory.
#include "trainer/trainer.h"

#include <string.h>

static sonde_status load_one(const char *path, void *item, sonde_error *error) {
  return sonde_case_load(path, item, error);
}

// By level, then title, then id: the order in which a learner reads them.
static int compare_cases(const void *a, const void *b) {
  const sonde_case *x = a, *y = b;
  if (x->level != y->level) return x->level < y->level ? -1 : 1;
  int titles = strcmp(x->title, y->title);
  return titles ? titles : strcmp(x->id, y->id);
}

sonde_status sonde_case_list(const char *directory, sonde_case **cases, uint32_t *count,
                             sonde_error *error) {
  SONDE_ASSERT(directory && cases && count);
  void *items;
  sonde_status status =
      sonde_load_directory(directory, sizeof(sonde_case), load_one, &items, count, error);
  *cases = items;
  if (status) return status;
  sonde_case *c = *cases;
  for (uint32_t i = 0; i < *count; ++i)
    for (uint32_t k = 0; k < i && !status; ++k)
      if (strcmp(c[i].id, c[k].id) == 0)
        status =
            sonde_fail(error, SONDE_ARGUMENT, "%s: two cases have the id '%s'", directory, c[i].id);
  if (status) {
    sonde_free(c);
    *cases = NULL;
    *count = 0;
    return status;
  }
  qsort(c, *count, sizeof *c, compare_cases);
  return SONDE_OK;
}
