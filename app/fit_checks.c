// fit_checks_run:   what was asked for.
// fit_checks_print: as text. fit_checks_print_json: into the open object.
#include "fit_checks.h"

#include "app.h"

#include <math.h>
#include <stdio.h>

static const char *const FIGURE_NAME[] = {"G", "gm", "k0", "xm"};

sonde_status fit_checks_run(fit_checks *c, const sonde_model *model, const sonde_site_table *sites,
                            const sonde_measurements *data, const sonde_fit_def *def,
                            const sonde_fit_result *result, const sonde_progress *progress,
                            sonde_error *error) {
  sonde_status status = SONDE_OK;
  if (c->profile)
    status = sonde_fit_profile_shear(model, sites, data, def, result, progress, &c->shear, error);
  if (c->identify && !status)
    status = sonde_fit_identify(model, sites, data, def, result, progress, &c->parts, error);
  if (c->starts && !status)
    status = sonde_fit_random_starts(model, sites, data, def, result, c->starts, c->seed, progress,
                                     &c->ends, error);
  return status;
}

void fit_checks_name(const sonde_fit_part *part, char name[40]) {
  if (part->probe[0])
    snprintf(name, 40, "%s only", part->probe);
  else
    snprintf(name, 40, "all probes");
}

static void print_parts(const sonde_fit_identifiability *parts) {
  printf("what each probe determines (ln sd; correlation G-k0, G-xm, k0-xm; condition)\n");
  for (uint32_t p = 0; p < parts->count; ++p) {
    const sonde_fit_part *part = &parts->part[p];
    char name[40];
    fit_checks_name(part, name);
    printf("  %-16s", name);
    for (int k = 0; k < 4; ++k) printf(" %s %.3g", FIGURE_NAME[k], part->ln_sd[k]);
    printf("; %+.2f %+.2f %+.2f; %.3g\n", part->correlation[0][2], part->correlation[0][3],
           part->correlation[2][3], part->condition);
  }
}

void fit_checks_print(const fit_checks *c) {
  if (c->shear.count)
    printf("profile likelihood of G: %.4g N/m, 95 %% interval %.4g to %.4g\n",
           c->shear.estimate_n_m, c->shear.interval_95[0], c->shear.interval_95[1]);
  if (c->parts.count) print_parts(&c->parts);
  if (c->ends.count)
    printf("random starts: %u of %u end in the same optimum (cost %.6g to %.6g), %u fail\n",
           c->ends.same, c->ends.count, c->ends.least_cost, c->ends.most_cost, c->ends.failed);
}

static void print_json_part(const sonde_fit_part *part) {
  char name[40], key[48];
  fit_checks_name(part, name);
  app_json_object(name);
  app_json_real("condition", part->condition);
  for (int k = 0; k < 4; ++k) {
    snprintf(key, sizeof key, "ln_%s_sd", FIGURE_NAME[k]);
    app_json_real(key, part->ln_sd[k]);
  }
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < k; ++j) {
      snprintf(key, sizeof key, "correlation_%s_%s", FIGURE_NAME[j], FIGURE_NAME[k]);
      app_json_real(key, part->correlation[j][k]);
    }
  app_json_close();
}

static void print_json_profile(const sonde_fit_profile *p) {
  app_json_object("profile");
  app_json_real("shear_n_m", p->estimate_n_m);
  app_json_real("low_n_m", p->interval_95[0]);
  app_json_real("high_n_m", p->interval_95[1]);
  app_json_real("threshold", p->threshold);
  app_json_object("rise");
  for (uint32_t k = 0; k < p->count; ++k) {
    char key[32];
    snprintf(key, sizeof key, "%.6g", p->shear_n_m[k]);
    app_json_real(key, p->rise[k]);
  }
  app_json_close();
  app_json_close();
}

void fit_checks_print_json(const fit_checks *c) {
  if (c->shear.count) print_json_profile(&c->shear);
  if (c->parts.count) {
    app_json_object("identifiability");
    for (uint32_t p = 0; p < c->parts.count; ++p) print_json_part(&c->parts.part[p]);
    app_json_close();
  }
  if (c->ends.count) {
    app_json_object("random_starts");
    app_json_integer("count", c->ends.count);
    app_json_integer("same", c->ends.same);
    app_json_integer("failed", c->ends.failed);
    app_json_real("least_cost", c->ends.least_cost);
    app_json_real("most_cost", c->ends.most_cost);
    app_json_real("farthest_sd", c->ends.farthest_sd);
    app_json_close();
  }
}
