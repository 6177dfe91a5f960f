// Figures 4 and 5: force against penetration at eleven sites under the two probes, and what the
// paper says of them.
#include "paper.h"
#include "paper_plot.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SHOWN = 11, LONGEST = 64 };

// The measured curve of a site under a probe, in mm and N. @return its length
static uint32_t curve_of(const paper *p, uint32_t site, const char *probe, double (*points)[2]) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < p->measurements.count && count < LONGEST; ++i) {
    const sonde_datum *d = &p->measurements.data[i];
    if (d->site != site || strcmp(d->probe, probe) != 0) continue;
    points[count][0] = 1e3 * d->penetration_m;
    points[count++][1] = d->force_n;
  }
  return count;
}

static uint32_t shown_site(const paper *p, uint32_t k) {
  return p->sites.sites[k * (p->sites.count - 1) / (SHOWN - 1)].id;
}

static sonde_status draw(paper *p, int number, const char *probe, const char *title,
                         sonde_error *error) {
  double points[LONGEST + 1][2];
  sonde_file *file = NULL;
  sonde_status status = paper_figure_begin(p, number, title, 760, 440, &file, error);
  if (status) return status;
  paper_plot plot = {.file = file, .left = 66, .top = 40, .width = 540, .height = 340};
  for (uint32_t k = 0; k < SHOWN; ++k) {
    uint32_t count = curve_of(p, shown_site(p, k), probe, points);
    for (uint32_t i = 0; i < count; ++i) {
      plot.x_high = fmax(plot.x_high, points[i][0] + 1);
      plot.y_high = fmax(plot.y_high, points[i][1]);
    }
  }
  plot_begin(&plot, title, "penetration along the normal, mm", "reaction force, N");
  for (uint32_t k = 0; k < SHOWN; ++k) {
    char name[32];
    uint32_t count = curve_of(p, shown_site(p, k), probe, points + 1) + 1;
    points[0][0] = points[0][1] = 0;
    plot_line(&plot, (const double(*)[2])points, count, PLOT_COLOUR[k], NULL);
    plot_marks(&plot, (const double(*)[2])(points + 1), count - 1, PLOT_COLOUR[k], k);
    snprintf(name, sizeof name, "site %u", shown_site(p, k));
    plot_legend(&plot, 636, 56 + 20 * (double)k, PLOT_COLOUR[k], NULL, (int)k, name);
  }
  paper_figure *f = &p->figure[number - 1];
  paper_caption(f->caption, sizeof f->caption,
                "Reaction force against penetration at eleven of the %u sites under the probe "
                "\"%s\". Synthetic data: computed by finite elements, not measured on a person.",
                p->sites.count, probe);
  return paper_figure_end(file, SONDE_OK, error);
}

// Second differences of every curve, the untouched skin included, and how much more than
// proportionally the force grows.
static void judge_shape(paper *p) {
  static const char *const PROBE[] = {"point", "linear"};
  double points[LONGEST + 1][2], growth = 0;
  uint32_t differences = 0, negative = 0, curves = 0;
  for (uint32_t s = 0; s < p->sites.count; ++s)
    for (int k = 0; k < 2; ++k) {
      points[0][0] = points[0][1] = 0;
      uint32_t count = curve_of(p, p->sites.sites[s].id, PROBE[k], points + 1) + 1;
      for (uint32_t i = 2; i < count; ++i, ++differences)
        negative += (points[i][1] - points[i - 1][1]) / (points[i][0] - points[i - 1][0]) <
                    (points[i - 1][1] - points[i - 2][1]) / (points[i - 1][0] - points[i - 2][0]);
      if (count < 3) continue;
      double first = points[1][1] / points[1][0];
      growth += points[count - 1][1] / points[count - 1][0] / first;
      curves++;
    }
  paper_claim *c = paper_begin(p, "nonlinear_curves", "3.1, Fig. 4",
                               "The relation between penetration and reaction force is non-linear.",
                               "Signs of the second differences of every measured curve.");
  paper_samples(c, differences, "second differences");
  paper_value(c, "curves", curves);
  paper_value(c, "concave", negative);
  paper_value(c, "stiffening", growth / curves);
  paper_say(c, negative == 0 ? PAPER_HOLDS : PAPER_IN_PART,
            "%u of %u second differences are negative; force per depth grows %.2f times from the "
            "first step to the last, where a linear spring keeps 1.",
            negative, differences, growth / curves);
}

static void judge_probes(paper *p) {
  double flat[LONGEST + 1][2], sharp[LONGEST + 1][2], least = INFINITY, most = 0;
  uint32_t pairs = 0, larger = 0;
  for (uint32_t s = 0; s < p->sites.count; ++s) {
    uint32_t count = curve_of(p, p->sites.sites[s].id, "linear", flat);
    uint32_t other = curve_of(p, p->sites.sites[s].id, "point", sharp);
    for (uint32_t i = 0; i < count; ++i)
      for (uint32_t k = 0; k < other; ++k) {
        if (fabs(flat[i][0] - sharp[k][0]) > 1e-6) continue;
        double ratio = flat[i][1] / sharp[k][1];
        least = fmin(least, ratio), most = fmax(most, ratio);
        larger += ratio > 1, pairs++;
      }
  }
  paper_claim *c = paper_begin(
      p, "flat_needs_more", "3.1, Fig. 5",
      "A larger contact surface gives a larger force for the same penetration distance.",
      "Forces of the two probes at every depth and site that both reached.");
  paper_samples(c, pairs, "pairs of forces");
  paper_value(c, "larger", larger);
  paper_value(c, "least_ratio", least);
  paper_value(c, "most_ratio", most);
  paper_say(c, pairs && larger == pairs ? PAPER_HOLDS : PAPER_FAILS,
            "The flat probe's force is the larger one in %u of %u pairs, %.2f to %.2f times; the "
            "areas differ 20 times.",
            larger, pairs, least, most);
}

static double correlation(const double *x, const double *y, uint32_t count) {
  double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
  for (uint32_t i = 0; i < count; ++i) mx += x[i] / count, my += y[i] / count;
  for (uint32_t i = 0; i < count; ++i) {
    xx += (x[i] - mx) * (x[i] - mx), yy += (y[i] - my) * (y[i] - my);
    xy += (x[i] - mx) * (y[i] - my);
  }
  return xy / sqrt(xx * yy);
}

// How sites differ, and whether tissue that is thin over the bone reaches its limit sooner.
static void judge_heterogeneity(paper *p) {
  const sonde_model *m = p->model;
  enum { MOST = 512 };
  double points[LONGEST + 1][2], at_depth[MOST], limit[MOST], bone[MOST], fat[MOST];
  uint32_t count = 0;
  double mean = 0, spread = 0;
  for (uint32_t s = 0; s < p->sites.count && count < MOST; ++s) {
    uint32_t rows = curve_of(p, p->sites.sites[s].id, "linear", points), nearest = 0;
    double least = INFINITY;
    for (uint32_t i = 0; i < rows; ++i)
      if (fabs(points[i][0] - 10) < 0.01) at_depth[count] = points[i][1];
    for (uint32_t i = 0; i < m->surface.vertex_count; ++i) {
      sonde_vec3 a = m->surface.vertices[i], b = p->sites.sites[s].position_m;
      double away = hypot(hypot(a.x - b.x, a.y - b.y), a.z - b.z);
      if (away < least) least = away, nearest = i;
    }
    limit[count] = p->sites.sites[s].xm_m;
    bone[count] = m->bone_depth_m[nearest];
    fat[count++] = p->sites.fat_depth_m[s];
  }
  assert(count > 0);
  for (uint32_t i = 0; i < count; ++i) mean += at_depth[i] / count;
  for (uint32_t i = 0; i < count; ++i)
    spread += (at_depth[i] - mean) * (at_depth[i] - mean) / count;
  paper_claim *c = paper_begin(
      p, "heterogeneous", "3.1",
      "The curves differ because the thigh is not homogeneous: fat here, bone close below there.",
      "Spread of the flat probe's force at 10 mm over the sites; correlation of the fitted "
      "asymptote x_m with the depth of the bone and the thickness of the fat.");
  paper_samples(c, count, "sites");
  paper_value(c, "variation_percent", 100 * sqrt(spread) / mean);
  double with_bone = correlation(limit, bone, count), with_fat = correlation(limit, fat, count);
  paper_value(c, "correlation_bone", with_bone);
  paper_value(c, "correlation_fat", with_fat);
  paper_say(
      c, with_bone > 0.5 ? PAPER_HOLDS : PAPER_IN_PART,
      "Forces at 10 mm vary by %.1f %% (standard deviation) over the sites; x_m is correlated "
      "%+.2f with the depth of the bone and %+.2f with the thickness of the fat.",
      100 * sqrt(spread) / mean, with_bone, with_fat);
}

sonde_status paper_curves(paper *p, sonde_error *error) {
  sonde_status status =
      draw(p, 4, "point", "Figure 4. Force against penetration, punctual contact", error);
  if (!status)
    status = draw(p, 5, "linear", "Figure 5. Force against penetration, flat probe", error);
  judge_shape(p);
  judge_probes(p);
  judge_heterogeneity(p);
  return status;
}
