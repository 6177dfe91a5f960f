// Score, measures and presses as tables.
//
// part_row         one part of the score with its bar, and where its points went
// cap              why the score is less than its parts
// measure          one line of the measures
// number, percent  a value with its unit; a dash where nothing was done
// press_row        one press
#include "trainer/report.h"

#include <string.h>

// ---- score --------------------------------------------------------------------------------------

static void part_row(sonde_text *out, const sonde_score_part *part) {
  double kept = part->points / part->of;
  sonde_text_format(out, "<tr><th scope=\"row\">%s</th><td>", part->title);
  sonde_text_escape(out, part->meaning);
  if (part->lost[0]) {
    sonde_text_format(out, "<br/><b>\u2212%s of %s:</b> ",
                      sonde_fixed(part->of - part->points, 1).s, sonde_fixed(part->of, 0).s);
    sonde_text_escape(out, part->lost);
    sonde_text_put(out, ".");
  }
  sonde_text_format(out,
                    "<span class=\"bar\"><i style=\"width:%s%%\"></i></span></td>"
                    "<td class=\"n\">%s of %s</td></tr>\n",
                    sonde_coordinate(100 * clamp(kept, 0, 1)).s, sonde_fixed(part->points, 1).s,
                    sonde_fixed(part->of, 0).s);
}

static void cap(sonde_text *out, const sonde_score *score, double sum) {
  if (!(sum > score->score + 0.05)) return;
  sonde_text_format(
      out,
      "<p>The parts add up to %s points. A wrong or missing diagnosis is never passed: "
      "the score is limited to %s.</p>\n",
      sonde_fixed(sum, 1).s, sonde_fixed(score->score, 1).s);
}

void sonde_debrief_score(sonde_debrief *page) {
  const sonde_score *score = page->in->score;
  sonde_text *out = &page->out;
  double sum = 0;
  sonde_debrief_section(page, "score", "The score");
  sonde_text_put(out, "<table>\n<thead><tr><th>Part</th><th>What it means, and where points "
                      "went</th><th class=\"n\">Points"
                      "</th></tr></thead>\n<tbody>\n");
  sonde_score_part part[SONDE_SCORE_PARTS];
  sonde_score_explain(score, page->in->plan, page->in->presses, page->in->press_count, part);
  for (int k = 0; k < SONDE_SCORE_PARTS; ++k) {
    part_row(out, &part[k]);
    sum += part[k].points;
  }
  sonde_text_format(out,
                    "<tr class=\"this\"><th scope=\"row\">Score</th><td></td><td class=\"n\"><b>%s"
                    " of 100</b></td></tr>\n</tbody></table>\n",
                    sonde_fixed(score->score, 1).s);
  cap(out, score, sum);
  sonde_text_put(out, "</section>\n");
}

// ---- measures -----------------------------------------------------------------------------------

static sonde_number with_unit(double value, double scale, int decimals, const char *unit) {
  sonde_number number = sonde_fixed(scale * value, decimals);
  if (isfinite(value))
    snprintf(number.s + strlen(number.s), sizeof number.s - strlen(number.s), " %s", unit);
  return number;
}

static sonde_number percent(double share) { return with_unit(share, 100, 0, "%"); }

static sonde_number duration(double seconds) {
  sonde_number number = sonde_fixed(seconds, 0);
  if (isfinite(seconds) && seconds >= 0 && seconds < 1e6)
    snprintf(number.s, sizeof number.s, "%u:%02u min", (unsigned)seconds / 60,
             (unsigned)seconds % 60);
  return number;
}

static void measure(sonde_text *out, const char *title, const char *value, const char *meaning) {
  sonde_text_format(
      out,
      "<tr><th scope=\"row\">%s</th><td class=\"n\">%s</td><td class=\"quiet\">%s</td>"
      "</tr>\n",
      title, value, meaning);
}

void sonde_debrief_comments(sonde_debrief *page) {
  const sonde_exam_report *r = page->in;
  sonde_text *out = &page->out;
  if (!r->comment_count) return;
  sonde_debrief_section(page, "comments", "Comments");
  sonde_text_put(out, "<div class=\"wide\"><table>\n<tbody>\n");
  for (uint32_t i = 0; i < r->comment_count; ++i) {
    const sonde_comment *c = &r->comments[i];
    sonde_text_format(out, "<tr><th scope=\"row\">%s</th><td>", duration(c->time_s).s);
    sonde_text_escape(out, c->text);
    sonde_text_put(out, "</td><td class=\"quiet\">");
    sonde_text_escape(out, c->author);
    sonde_text_put(out, "</td></tr>\n");
  }
  sonde_text_put(out, "</tbody></table></div>\n</section>\n");
}

void sonde_debrief_measures(sonde_debrief *page) {
  const sonde_metrics *m = &page->in->score->metrics;
  sonde_text *out = &page->out;
  char places[48], valid[48];
  snprintf(places, sizeof places, "%u of %u", m->points_done, m->points);
  snprintf(valid, sizeof valid, "%u of %u",
           m->presses[SONDE_PRESS_COMPLETE] + m->presses[SONDE_PRESS_OPEN], m->press_count);
  sonde_debrief_section(page, "measures", "Measures");
  sonde_text_put(out, "<div class=\"wide\"><table>\n<tbody>\n");
  measure(out, "Places pressed well", places, "Planned places with a good press within reach.");
  measure(out, "Coverage", percent(m->coverage).s, "Of the planned vein, near a good press.");
  measure(out, "Coverage of the whole vein", percent(m->vein_coverage).s,
          "From the groin to the knee, planned or not.");
  measure(out, "Longest gap", with_unit(m->gap_m, 1e2, 1, "cm").s,
          "Longest planned stretch without a good press.");
  measure(out, "Good presses", valid, "Complete, or showing an open vein.");
  measure(out, "Completeness", percent(m->completeness).s,
          "How far the complete presses closed the vein, on average.");
  measure(out, "Greatest force", with_unit(m->force_peak_n, 1, 1, "N").s, "Over the whole exam.");
  measure(out, "Usual upper force", with_unit(m->force_p95_n, 1, 1, "N").s,
          "95 % of the time of pressing stayed below.");
  measure(out, "Time", duration(m->time_s).s, "From the first image to the last.");
  measure(out, "Time on the skin", duration(m->contact_s).s, "With the probe pressing.");
  measure(out, "Path of the probe", with_unit(m->path_m, 1, 2, "m").s, "Shorter is calmer.");
  measure(out, "Smoothness", sonde_fixed(m->smoothness, 1).s,
          "How evenly the probe moved between presses: nearer to zero is smoother.");
  char times[16];
  snprintf(times, sizeof times, "%u", m->restores);
  if (m->restores)
    measure(out, "Probe taken off", times,
            "Times the probe was led through the leg: it was taken off until it had left the leg.");
  sonde_text_put(out, "</tbody></table></div>\n</section>\n");
}

// ---- presses ------------------------------------------------------------------------------------

static void press_row(sonde_debrief *page, uint32_t index) {
  const sonde_compression *p = &page->in->presses[index];
  sonde_text *out = &page->out;
  sonde_text_format(out, "<tr id=\"press-%u\"><td class=\"n\">%u</td><td class=\"n\">%s</td><td>",
                    index + 1, index + 1, sonde_fixed(p->start_s, 1).s);
  sonde_debrief_place(page, p);
  sonde_text_format(out, "</td><td><svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 14 14\" "
                         "width=\"14\" height=\"14\" aria-hidden=\"true\">");
  sonde_press_mark(out, 7, 7, p->result);
  double tilt = p->tilt_rad * 180 / SONDE_PI;
  sonde_text_format(out,
                    "</svg> %s</td><td class=\"n\">%s</td><td class=\"n\">%s</td><td class=\"n\">%s"
                    "</td><td class=\"n\">%s</td></tr>\n",
                    sonde_press_words(p->result), sonde_fixed(p->force_peak_n, 1).s,
                    sonde_fixed(100 * p->vein_ratio, 0).s, sonde_fixed(100 * p->artery_least, 0).s,
                    sonde_fixed(tilt, 0).s);
}

void sonde_debrief_presses(sonde_debrief *page) {
  enum { SHORT = 24 };
  const sonde_exam_report *r = page->in;
  sonde_text *out = &page->out;
  if (!r->press_count) return;
  sonde_debrief_section(page, "presses", "Every press");
  sonde_text_format(out, "<details%s><summary>%u press%s, in the order of time</summary>\n",
                    r->press_count <= SHORT ? " open=\"open\"" : "", r->press_count,
                    r->press_count == 1 ? "" : "es");
  sonde_text_put(out,
                 "<div class=\"wide\"><table>\n<thead><tr><th class=\"n\">No</th><th class=\"n\">"
                 "at (s)</th><th>Place</th><th>Result</th><th class=\"n\">force (N)</th>"
                 "<th class=\"n\">vein left (%)</th><th class=\"n\">artery left (%)</th>"
                 "<th class=\"n\">tilt (\u00b0)</th></tr></thead>\n<tbody>\n");
  for (uint32_t i = 0; i < r->press_count; ++i) press_row(page, i);
  sonde_text_put(out, "</tbody></table></div></details>\n</section>\n");
}
