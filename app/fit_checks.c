// What else sonde fit can say of a result: profile, certainty, random starts, other layers.
#include "fit_checks.h"

#include "fit_common.h"

#include <assert.h>
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
  if (c->layers && !status)
    status = sonde_fit_layers(model, sites, data, c->also, def, result, progress, c->layer, error);
  return status;
}

const char *fit_checks_layer(sonde_layer kind) {
  assert(kind < SONDE_FIT_LAYERS);
  static const char *const NAME[] = {"A, shear with a limit", "T, pre-tension",
                                     "J, pre-tension and stiffening"};
  return NAME[kind];
}

void fit_checks_name(const sonde_fit_part *part, char name[40]) {
  if (part->probe[0])
    snprintf(name, 40, "%s only", part->probe);
  else
    snprintf(name, 40, "all probes");
}

void fit_checks_print(const fit_checks *c) {
  if (c->shear.count)
    printf("profile likelihood of G: %.4g N/m, 95 %% interval %.4g to %.4g\n",
           c->shear.estimate_n_m, c->shear.interval_95[0], c->shear.interval_95[1]);
  if (c->parts.count)
    printf("what each probe determines (ln sd; correlation G-k0, G-xm, k0-xm; condition)\n");
  for (uint32_t p = 0; p < c->parts.count; ++p) {
    const sonde_fit_part *part = &c->parts.part[p];
    char name[40];
    fit_checks_name(part, name);
    printf("  %-16s", name);
    for (int k = 0; k < 4; ++k) printf(" %s %.3g", FIGURE_NAME[k], part->ln_sd[k]);
    printf("; %+.2f %+.2f %+.2f; %.3g\n", part->correlation[0][2], part->correlation[0][3],
           part->correlation[2][3], part->condition);
  }
  if (c->ends.count)
    printf("random starts: %u of %u end in the same optimum (cost %.6g to %.6g), %u fail\n",
           c->ends.same, c->ends.count, c->ends.least_cost, c->ends.most_cost, c->ends.failed);
  if (!c->layers) return;
  printf("other laws of the layer between neighbours, refitted\n");
  for (const sonde_fit_layer *l = c->layer; l < c->layer + SONDE_FIT_LAYERS; ++l) {
    // Errors of seen rows, of sites left out, of probes that were never fitted.
    printf("  %-30s %4u parameters, cost %8.1f;", fit_checks_layer(l->kind), l->parameters,
           l->cost);
    for (uint32_t p = 0; p < l->seen.probe_count; ++p)
      printf(" %s %.2f %% (site left out %.2f %%)", l->seen.probe[p], l->seen.probes[p].mae_percent,
             l->one_out.probes[p].mae_percent);
    for (uint32_t p = 0; p < l->also.probe_count; ++p)
      printf(" %s, never fitted, %.2f %%", l->also.probe[p], l->also.probes[p].mae_percent);
    printf("\n");
    if (l->kind != SONDE_LAYER_LIMIT)
      printf("  %-30s T %.3g N/m, k %.3g N/m, c %.3g%s\n", "", l->tension_n_m, l->second,
             l->stiffening, l->converged ? "" : ", not converged");
  }
}

void fit_checks_print_json(const fit_checks *c) {
  if (c->layers) {
    static const char *const KEY[] = {"limit", "tension", "stiffening"};
    app_json_object("layers");
    for (int k = 0; k < SONDE_FIT_LAYERS; ++k) {
      const sonde_fit_layer *l = &c->layer[k];
      app_json_object(KEY[k]);
      app_json_report("full", &l->seen);
      app_json("parameters:%u converged:%hhd cost:%g tension_n_m:%g second:%g stiffening_c:%g",
               l->parameters, l->converged, l->cost, l->tension_n_m, l->second, l->stiffening);
      app_json_object("one_site_out");
      app_json_report("full", &l->one_out);
      app_json_close();
      if (c->also) {
        app_json_object("also");
        app_json_report("full", &l->also);
        app_json_close();
      }
      app_json_close();
    }
    app_json_close();
  }
  if (c->shear.count) {
    const sonde_fit_profile *p = &c->shear;
    app_json_object("profile");
    app_json("shear_n_m:%g low_n_m:%g high_n_m:%g threshold:%g", p->estimate_n_m, p->interval_95[0],
             p->interval_95[1], p->threshold);
    app_json_object("rise");
    for (uint32_t k = 0; k < p->count; ++k) {
      char key[32];
      snprintf(key, sizeof key, "%.6g", p->shear_n_m[k]);
      app_json_real(key, p->rise[k]);
    }
    app_json_close();
    app_json_close();
  }
  if (c->parts.count) {
    app_json_object("identifiability");
    for (uint32_t p = 0; p < c->parts.count; ++p) {
      const sonde_fit_part *part = &c->parts.part[p];
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
    app_json_close();
  }
  if (c->ends.count) {
    app_json_object("random_starts");
    app_json("count:%u same:%u failed:%u least_cost:%g most_cost:%g farthest_sd:%g", c->ends.count,
             c->ends.same, c->ends.failed, c->ends.least_cost, c->ends.most_cost,
             c->ends.farthest_sd);
    app_json_close();
  }
}
