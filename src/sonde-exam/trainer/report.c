// The page of an exam, from its head to its foot.
//
// head            title, style, what the page may load (nothing)
// put_date        22 November 2026, 04:40 UTC
// put_dial        the score as a ring
// masthead        title, who and when, result
// teaching_note   of the case
// footer          formulas, recording
// check           what a caller can get wrong
#include "trainer/report.h"

#include <string.h>

static const char STYLE[] =
    ":root{color-scheme:light}*{box-sizing:border-box}"
    "body{margin:0;background:#f4f6f8;color:#1b2126;font:16px/1.55 system-ui,-apple-system,"
    "\"Segoe UI\",\"Helvetica Neue\",Arial,\"Liberation Sans\",sans-serif;overflow-wrap:anywhere}"
    "main,footer{max-width:980px;margin:0 auto;padding:0 20px}"
    "header{background:#fff;border-bottom:1px solid #d9dfe4}"
    ".top{max-width:980px;margin:0 auto;padding:34px 20px 28px;display:flex;gap:32px;"
    "align-items:center;justify-content:space-between}"
    ".top>div{min-width:0;flex:1}.top svg{flex:none}"
    ".eyebrow{margin:0;font-size:13px;letter-spacing:.06em;text-transform:uppercase;color:#55616b}"
    "h1{font-size:30px;line-height:1.2;margin:4px 0 10px;font-weight:680}"
    ".meta{margin:0;color:#55616b;font-size:15px}.meta b{color:#1b2126;font-weight:600}"
    ".verdict{margin:16px 0 0;font-size:17px}"
    ".tag{display:inline-block;border-radius:999px;padding:1px 12px;font-weight:650;font-size:15px;"
    "margin-right:8px;white-space:nowrap}"
    ".good{background:#d9f0e6;color:#00553f}.bad{background:#fbe0dc;color:#8c1d12}"
    ".none{background:#e6eaee;color:#434d56}"
    "section{background:#fff;border:1px solid #d9dfe4;border-radius:10px;padding:22px 26px;"
    "margin:22px 0}"
    "h2{font-size:20px;margin:0 0 12px;font-weight:680;line-height:1.3}"
    "h3{font-size:16px;margin:18px 0 6px;font-weight:650}h3:first-child{margin-top:0}"
    "p{margin:8px "
    "0;max-width:76ch}.text{white-space:pre-line}.quiet{color:#55616b;font-size:14.5px}"
    ".cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(260px,1fr));gap:16px;"
    "margin:16px 0 0}"
    ".card{border:1px solid #d9dfe4;border-radius:8px;padding:12px 16px;min-width:0}"
    ".card h3{color:#55616b;font-size:13.5px;margin:0 0 2px;font-weight:600}"
    ".card p{margin:2px 0;font-size:16.5px;font-weight:600}"
    ".card.right{border-left:5px solid #00795a}.card.wrong{border-left:5px solid #b3261e}"
    ".day{white-space:nowrap}.two{display:grid;grid-template-columns:repeat(auto-fit,minmax(330px,"
    "1fr));"
    "gap:8px 32px}.two>div{min-width:0}.two h3{margin-top:6px}"
    "ul{margin:6px 0;padding-left:20px}li{margin:5px 0;max-width:74ch}"
    ".wide{overflow-x:auto}"
    "table{border-collapse:collapse;width:100%;font-size:14.5px;line-height:1.4;overflow-wrap:"
    "break-word}"
    "th,td{padding:7px 10px;text-align:left;vertical-align:top}"
    "th{font-weight:600;color:#55616b;font-size:13.5px;border-bottom:1.5px solid #aeb8c1;"
    "vertical-align:bottom}"
    "td{border-bottom:1px solid #e7ebee}"
    "td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}"
    "tbody th{color:#1b2126;font-size:14.5px;border-bottom:1px solid #e7ebee;vertical-align:top}"
    "tr.this td,tr.this th{background:#eef5fb}"
    ".yes{color:#00553f;font-weight:600;white-space:nowrap}"
    ".no{color:#8c1d12;font-weight:600;white-space:nowrap}"
    ".bar{display:block;height:9px;border-radius:5px;background:#e4e9ed;min-width:120px;margin-top:"
    "6px;"
    "overflow:hidden}.bar i{display:block;height:100%;background:#0b5cad;border-radius:5px}"
    "figure{margin:16px 0 0}figure.full svg{width:100%;height:auto;display:block}"
    "figcaption{font-size:14px;line-height:1.5;color:#434d56;margin-top:8px;max-width:90ch}"
    ".pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(250px,1fr));gap:16px;"
    "margin-top:14px}.pictures figure{margin:0;border:1px solid #d9dfe4;border-radius:8px;"
    "overflow:hidden}.pictures figcaption{padding:8px 12px 10px;margin:0}"
    ".pair{display:grid;grid-template-columns:1fr 1fr;gap:2px;background:#0d1114}"
    ".pair div{position:relative;min-height:90px;color:#c9d2d9;font-size:12.5px}"
    ".pair img{width:100%;height:auto;display:block}"
    ".pair span{position:absolute;left:6px;top:4px;color:#fff;background:rgba(0,0,0,.55);"
    "border-radius:4px;padding:0 6px;font-size:12px;line-height:1.5}"
    ".pair em{position:absolute;inset:0;display:flex;align-items:center;justify-content:center;"
    "font-style:normal}"
    "summary{cursor:pointer;font-weight:600}details table{margin-top:10px}"
    "code{font:13.5px/1.4 ui-monospace,\"DejaVu Sans Mono\",Menlo,Consolas,monospace}"
    "footer{font-size:13.5px;color:#55616b;padding-bottom:48px}"
    "@media(max-width:640px){.top{flex-direction:column-reverse;align-items:flex-start}"
    "section{padding:18px 16px}}"
    "@media print{@page{margin:16mm}body{background:#fff;font-size:10.5pt}"
    "main,footer,.top{max-width:none;padding-left:0;padding-right:0}"
    "section{border:none;padding:0;margin:20px 0;border-radius:0}"
    ".pictures figure,tr,li,.card,figure.full{break-inside:avoid}h2,h3{break-after:avoid}"
    ".wide{overflow:visible}.pictures{grid-template-columns:repeat(3,1fr);gap:10px}table{font-size:"
    "9pt}"
    "th,td{padding:4px 8px}*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}";

static void head(sonde_debrief *page) {
  sonde_text_put(&page->out,
                 "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
                 "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
                 "style-src 'unsafe-inline'; img-src data:\"/>\n"
                 "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"/>\n"
                 "<title>");
  sonde_text_escape(&page->out, page->in->patient->title);
  sonde_text_format(&page->out,
                    " \u2013 examination report</title>\n<style>%s%s</style>\n</head>\n"
                    "<body>\n",
                    STYLE, SONDE_SVG_STYLE);
}

static void put_date(sonde_text *out, const char *date) {
  static const char *const MONTHS[12] = {"January",   "February", "March",    "April",
                                         "May",       "June",     "July",     "August",
                                         "September", "October",  "November", "December"};
  bool ours = strlen(date) == 20 && date[4] == '-' && date[10] == 'T';
  int month = ours ? (date[5] - '0') * 10 + date[6] - '0' : 0;
  if (month < 1 || month > 12) {
    sonde_text_escape(out, date);
    return;
  }
  char words[64], *day = words;
  snprintf(words, sizeof words, "%.2s %s %.4s, %.5s UTC", date + 8, MONTHS[month - 1], date,
           date + 11);
  if (*day == '0') ++day;
  sonde_text_escape(out, day);
}

// The length of the arc is the score's share of the circle.
static void put_dial(sonde_debrief *page) {
  const sonde_score *score = page->in->score;
  double radius = 54, round_px = 2 * SONDE_PI * radius, share = clamp(score->score / 100, 0, 1);
  sonde_number part = sonde_coordinate(share * round_px), whole = sonde_coordinate(round_px);
  sonde_number points = sonde_fixed(score->score, 0);
  SONDE_ASSERT(share >= 0 && share <= 1);
  sonde_text_format(
      &page->out,
      "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"fig\" role=\"img\" aria-label=\"Score: %s "
      "of 100 points\" viewBox=\"0 0 132 132\" width=\"132\" height=\"132\">\n"
      "<circle cx='66' cy='66' r='54' fill='none' stroke='#e4e9ed' stroke-width='11'/>\n"
      "<circle cx='66' cy='66' r='54' fill='none' stroke='%s' stroke-width='11' "
      "stroke-dasharray='%s %s' transform='rotate(-90 66 66)'/>\n"
      "<text x='66' y='74' class='middle' style=\"font-size:38px;font-weight:680\">%s</text>\n"
      "<text x='66' y='93' class='middle' style=\"font-size:12.5px;fill:#55616b\">of 100</text>\n"
      "</svg>\n",
      points.s, score->passed ? "#00795a" : "#b3261e", part.s, whole.s, points.s);
}

static void put_meta(sonde_debrief *page) {
  const sonde_exam_report *r = page->in;
  const char *protocol = r->protocol ? r->protocol->title : r->note.protocol;
  sonde_text *out = &page->out;
  bool any = false;
  sonde_text_put(out, "<p class=\"meta\">");
  const char *const texts[] = {r->note.trainee, r->note.date, protocol, r->note.guidance};
  for (size_t i = 0; i < SONDE_COUNT_OF(texts); ++i) {
    if (!texts[i] || !texts[i][0]) continue;
    sonde_text_put(out, any ? " \u00b7 " : "");
    sonde_text_put(out, i == 0 ? "<b>" : i == 3 ? "guidance: " : "");
    if (i == 1)
      put_date(out, texts[i]);
    else
      sonde_text_escape(out, texts[i]);
    sonde_text_put(out, i == 0 ? "</b>" : "");
    any = true;
  }
  sonde_text_put(out, "</p>\n");
}

static void masthead(sonde_debrief *page) {
  const sonde_exam_report *r = page->in;
  sonde_text *out = &page->out;
  sonde_text_put(out, "<header><div class=\"top\"><div>\n<p class=\"eyebrow\">Compression "
                      "ultrasound \u00b7 examination report</p>\n<h1>");
  sonde_text_escape(out, r->patient->title);
  sonde_text_put(out, "</h1>\n");
  put_meta(page);
  sonde_text_format(out, "<p class=\"verdict\"><span class=\"tag %s\">%s</span>",
                    r->score->passed ? "good" : "bad", r->score->passed ? "Passed" : "Not passed");
  const char *summary = r->score->summary; // the tag says its first words already
  const char *const known[] = {"Passed. ", "Not passed: ", "Not passed. "};
  for (size_t i = 0; i < SONDE_COUNT_OF(known); ++i)
    if (strncmp(summary, known[i], strlen(known[i])) == 0) summary += strlen(known[i]);
  char first[8] = {summary[0] >= 'a' && summary[0] <= 'z' ? (char)(summary[0] - 'a' + 'A') : 0};
  sonde_text_put(out, first);
  sonde_text_escape(out, summary + strlen(first));
  sonde_text_put(out, "</p>\n");
  if (r->interrupted)
    sonde_text_put(out, "<p class=\"quiet\">The exam was interrupted before its end. It is listed "
                        "among the exams but does not count as one.</p>\n");
  sonde_text_put(out, "</div>\n");
  put_dial(page);
  sonde_text_put(out, "</div></header>\n<main>\n");
}

static void teaching_note(sonde_debrief *page) {
  const char *note = page->in->patient->note;
  if (!note[0]) return;
  sonde_debrief_section(page, "case", "About this case");
  sonde_text_put(&page->out, "<p class=\"text\">");
  sonde_text_escape(&page->out, note);
  sonde_text_put(&page->out, "</p>\n</section>\n");
}

static void footer(sonde_debrief *page) {
  const sonde_exam_report *r = page->in;
  sonde_text *out = &page->out;
  sonde_text_format(out,
                    "</main>\n<footer>\n<p>The patient, the images and the forces are synthetic: "
                    "computed by Sonde %s. Scores and measures: formulas of version %d, "
                    "docs/trainer.md.</p>\n",
                    sonde_version(), SONDE_SCORE_VERSION);
  if (r->note.exam && r->note.exam[0]) {
    sonde_text_put(out, "<p>Exam <code>");
    sonde_text_escape(out, r->note.exam);
    sonde_text_put(out, "</code></p>\n");
  }
  if (r->recording && r->recording[0]) {
    sonde_text_put(out, "<p>Its recording plays again with <code>sonde replay ");
    sonde_text_escape(out, r->recording);
    sonde_text_put(out, "</code></p>\n");
  }
  sonde_text_put(out, "</footer>\n</body>\n</html>\n");
}

void sonde_debrief_section(sonde_debrief *page, const char *id, const char *title) {
  sonde_text_format(&page->out, "<section id=\"%s\">\n<h2>%s</h2>\n", id, title);
}

void sonde_debrief_drawing(sonde_debrief *page, sonde_figure *figure, const char *caption) {
  sonde_text_put(&page->out, "<figure class=\"full\">\n");
  sonde_svg_write(&page->out, figure, false);
  sonde_text_format(&page->out, "<figcaption>%s</figcaption>\n</figure>\n", caption);
  if (figure->body.failed) page->out.failed = true;
  sonde_text_clear(&figure->body);
}

// ---- the whole ----------------------------------------------------------------------------------

static sonde_status check(const sonde_exam_report *r, sonde_error *error) {
  enum { LARGEST = 2048 };
  if (!r->patient || !r->map || !r->plan || !r->score)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "report of an exam; expected its patient, map, plan and score");
  if (r->map->point_count < 2 || !(r->map->length_m > 0) || r->plan->count > SONDE_PLAN_POINTS)
    return sonde_fail(error, SONDE_ARGUMENT, "report of an exam; expected a vein and its plan");
  for (uint32_t i = 0; i < r->picture_count; ++i) {
    const sonde_exam_picture *p = &r->pictures[i];
    if (p->press >= r->press_count)
      return sonde_fail(error, SONDE_ARGUMENT, "picture %u of press %u; there are %u presses", i,
                        p->press, r->press_count);
    if (p->before.width > LARGEST || p->before.height > LARGEST || p->peak.width > LARGEST ||
        p->peak.height > LARGEST)
      return sonde_fail(error, SONDE_ARGUMENT, "picture %u; expected at most %d pixels a side", i,
                        LARGEST);
  }
  return SONDE_OK;
}

static sonde_status compose(sonde_debrief *page, sonde_error *error) {
  head(page);
  masthead(page);
  sonde_debrief_question(page);
  sonde_debrief_advice(page);
  teaching_note(page);
  sonde_debrief_comments(page);
  sonde_debrief_score(page);
  sonde_debrief_along(page);
  sonde_status status = sonde_debrief_pictures(page, error);
  if (!status) status = sonde_debrief_traces(page, error);
  if (!status) status = sonde_debrief_earlier(page, error);
  if (status) return status;
  sonde_debrief_measures(page);
  sonde_debrief_presses(page);
  footer(page);
  return page->out.failed ? sonde_fail_memory(error) : SONDE_OK;
}

sonde_status sonde_exam_report_write(const sonde_exam_report *report, const char *path,
                                     sonde_error *error) {
  SONDE_ASSERT(report && path);
  sonde_status status = check(report, error);
  if (status) return status;
  sonde_debrief page = {.in = report, .vein = sonde_debrief_vein_make(report)};
  sonde_file *file = NULL;
  status = compose(&page, error);
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_write(file, page.out.bytes, page.out.used);
    status = sonde_file_commit(file, error);
  }
  sonde_text_clear(&page.out);
  return status;
}
