// head:          title and style of the page.
// masthead:      title, where the data come from, version, date, command.
// write_notes:   remarks and warnings.
// figure_name:   letters, digits and hyphens out of any text.
#include "report/view.h"

#include <string.h>

// Light only, on purpose: the figures carry measured colours and the page is meant for paper too.
static const char STYLE[] =
    ":root{color-scheme:light}"
    "body{margin:0;background:#fff;color:#1c1c1c;font:16px/1.55 \"Helvetica Neue\",Arial,"
    "\"Liberation Sans\",sans-serif}"
    "main,header,footer{max-width:900px;margin:0 auto;padding:0 24px}"
    "header{padding-top:40px}"
    "h1{font-size:30px;line-height:1.2;margin:0 0 12px;font-weight:650}"
    "h2{font-size:21px;margin:52px 0 10px;padding-top:14px;border-top:1px solid #c8c8c8;"
    "font-weight:650}"
    "p{margin:10px 0;max-width:74ch}"
    "a{color:#005a8c}code{font:13px/1.4 \"DejaVu Sans Mono\",Menlo,Consolas,monospace;"
    "overflow-wrap:anywhere}"
    "dl{display:grid;grid-template-columns:max-content 1fr;gap:3px 18px;margin:14px 0;"
    "font-size:14px}dt{color:#5a5a5a}dd{margin:0}"
    "nav{font-size:14px;margin:18px 0 0;line-height:1.9}nav a{margin-right:18px;white-space:nowrap}"
    ".notes{border-left:4px solid #d55e00;background:#fdf4ec;padding:8px 18px;margin:20px 0;"
    "font-size:15px}.notes ul{margin:4px 0;padding-left:18px}"
    ".key{display:flex;flex-wrap:wrap;gap:12px;margin:18px 0}"
    ".key div{flex:1 1 150px;border:1px solid #d6d6d6;border-radius:4px;padding:10px 14px}"
    ".key b{display:block;font-size:24px;font-weight:600;line-height:1.3;"
    "font-variant-numeric:tabular-nums}.key span{font-size:13px;color:#555}"
    ".wide{overflow-x:auto;margin:18px 0}"
    "table{border-collapse:collapse;font-size:13px;line-height:1.4;"
    "border-bottom:1.5px solid #333}"
    "caption{text-align:left;font-size:14px;padding:0 0 7px;line-height:1.45;max-width:80ch}"
    "th,td{padding:4px 7px;text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}"
    "th{font-weight:600;border-top:1.5px solid #333;border-bottom:1px solid #333;"
    "vertical-align:bottom}"
    "th.l,td.l{text-align:left}td.l{white-space:normal}td.l:first-child{max-width:16em}th[colspan]{"
    "text-align:center}tr.strong td{font-weight:650;"
    "background:#f1f6fa}"
    "tbody tr+tr td{border-top:1px solid #ececec}"
    "figure{margin:26px 0}figure.full svg{width:100%}figure "
    "svg{max-width:100%;height:auto;display:block}"
    "figcaption{font-size:14px;line-height:1.5;color:#333;max-width:80ch;margin-top:8px}"
    ".pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(400px,1fr));gap:0 "
    "24px;align-items:start}"
    "details{margin:18px 0}summary{cursor:pointer;font-size:15px}"
    "footer{font-size:13px;color:#5a5a5a;margin-top:60px;padding-bottom:40px}"
    "@media print{body{font-size:10.5pt}main,header,footer{max-width:none;padding:0}nav{display:"
    "none}figure,tr,.key,.notes{break-inside:avoid}h2{break-after:avoid}.wide{overflow:visible}"
    "a{color:inherit;text-decoration:none}}";

static const char *title_of(const sonde_report_view *view) {
  return view->in->title ? view->in->title : "Estimation report";
}

static void head(const sonde_report_view *view, sonde_text *out) {
  sonde_text_put(out, "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
                      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"/>\n"
                      "<title>");
  sonde_text_escape(out, title_of(view));
  sonde_text_format(out, "</title>\n<style>%s%s</style>\n</head>\n<body>\n", STYLE,
                    SONDE_SVG_STYLE);
}

static void item(sonde_text *out, const char *name, const char *utf8, bool code) {
  if (!utf8 || !*utf8) return;
  sonde_text_format(out, "<dt>%s</dt><dd>%s", name, code ? "<code>" : "");
  sonde_text_escape(out, utf8);
  sonde_text_format(out, "%s</dd>\n", code ? "</code>" : "");
}

static void write_notes(const sonde_report_view *view, sonde_text *out) {
  if (!view->synthetic && !view->in->note_count) return;
  sonde_text_put(out, "<div class=\"notes\"><ul>\n");
  if (view->synthetic)
    sonde_text_put(out, "<li>The data are synthetic: they were computed, not measured on a person. "
                        "\u201cMeasured\u201d below means \u201cin the data\u201d, and agreement "
                        "is agreement with that computation.</li>\n");
  for (uint32_t i = 0; i < view->in->note_count; ++i) {
    sonde_text_put(out, "<li>");
    sonde_text_escape(out, view->in->notes[i]);
    sonde_text_put(out, "</li>\n");
  }
  sonde_text_put(out, "</ul></div>\n");
}

static void masthead(const sonde_report_view *view, sonde_text *out) {
  const sonde_fit_report *r = view->in;
  const char *provenance = r->provenance ? r->provenance : r->model ? r->model->provenance : NULL;
  bool facts = (provenance && *provenance) || r->command_line || r->version || r->date || r->model;
  sonde_text_put(out, "<header>\n<h1>");
  sonde_text_escape(out, title_of(view));
  sonde_text_put(out, "</h1>\n");
  if (facts) {
    sonde_text_put(out, "<dl>\n");
    if (r->model) item(out, "Model", r->model->name, false);
    item(out, "Data", provenance, false);
    item(out, "Date", r->date, false);
    item(out, "Version", r->version, false);
    item(out, "Command", r->command_line, true);
    sonde_text_put(out, "</dl>\n");
  }
  write_notes(view, out);
  if (view->contents.used) {
    sonde_text_put(out, "<nav>");
    sonde_text_append(out, &view->contents);
    sonde_text_put(out, "</nav>\n");
  }
  sonde_text_put(out, "</header>\n");
}

void sonde_page_write(sonde_report_view *view, sonde_text *out) {
  head(view, out);
  masthead(view, out);
  sonde_text_put(out, "<main>\n");
  sonde_text_append(out, &view->page);
  if (view->section_open) sonde_text_put(out, "</section>\n");
  sonde_text_put(out, "</main>\n<footer>Written by Sonde; every figure stands beside this page as "
                      "an .svg file.</footer>\n</body>\n</html>\n");
}

void sonde_page_section(sonde_report_view *view, const char *id, const char *title) {
  SONDE_ASSERT(id && title);
  if (view->section_open) sonde_text_put(&view->page, "</section>\n");
  sonde_text_format(&view->page, "<section id=\"%s\">\n<h2>%s</h2>\n", id, title);
  sonde_text_format(&view->contents, "<a href=\"#%s\">%s</a> ", id, title);
  view->section_open = true;
}

void sonde_page_paragraph(sonde_report_view *view, const char *words) {
  sonde_text_format(&view->page, "<p>%s</p>\n", words);
}

// ---- figures ------------------------------------------------------------------------------------

static void figure_name(sonde_figure *figure, uint32_t number, const char *name, const char *of) {
  int used = snprintf(figure->name, sizeof figure->name, "%02u-%s", number, name);
  SONDE_ASSERT(used > 0 && used < (int)sizeof figure->name - 2);
  if (!of) return;
  figure->name[used++] = '-';
  for (const char *p = of; *p && used + 1 < (int)sizeof figure->name; ++p) {
    bool plain = (*p >= '0' && *p <= '9') || (*p >= 'a' && *p <= 'z');
    char c = *p >= 'A' && *p <= 'Z' ? (char)(*p - 'A' + 'a') : *p;
    figure->name[used++] = (char)(plain || c != *p ? c : '-');
  }
  figure->name[used] = 0;
}

sonde_figure *sonde_figure_begin_for(sonde_report_view *view, const char *name, const char *title,
                                     const char *of, double width, double height) {
  SONDE_ASSERT(view->figure_count < SONDE_REPORT_FIGURES);
  sonde_figure *figure = &view->figures[view->figure_count++];
  SONDE_ASSERT(width > 0 && height > 0);
  *figure = (sonde_figure){.width = width, .height = height};
  figure_name(figure, view->figure_count, name, of);
  snprintf(figure->title, sizeof figure->title, "%s%s", title, of ? of : "");
  return figure;
}

sonde_figure *sonde_figure_begin(sonde_report_view *view, const char *name, const char *title,
                                 double width, double height) {
  return sonde_figure_begin_for(view, name, title, NULL, width, height);
}

void sonde_figure_place(sonde_report_view *view, sonde_figure *figure, const char *caption) {
  sonde_text *page = &view->page;
  bool full = figure->width > 800; // drawn for the width of the page
  sonde_text_put(page, full ? "<figure class=\"full\">\n" : "<figure>\n");
  sonde_svg_write(page, figure, false);
  sonde_text_format(page, "<figcaption><b>Figure %u. ", (uint32_t)(figure - view->figures) + 1);
  sonde_text_escape(page, figure->title);
  sonde_text_format(page, ".</b> %s <a href=\"%s.svg\">SVG</a></figcaption>\n</figure>\n", caption,
                    figure->name);
}

void sonde_figures_side_by_side(sonde_report_view *view, bool begin) {
  sonde_text_put(&view->page, begin ? "<div class=\"pair\">\n" : "</div>\n");
}

// ---- tables -------------------------------------------------------------------------------------

void sonde_table_begin(sonde_report_view *view, const char *caption) {
  sonde_text_format(&view->page,
                    "<div class=\"wide\"><table>\n<caption><b>Table %u.</b> %s</caption>\n",
                    ++view->table_count, caption);
}

void sonde_table_head(sonde_report_view *view, const char *const *heads, uint32_t count) {
  SONDE_ASSERT(count > 0);
  sonde_text_put(&view->page, "<thead><tr>");
  for (uint32_t i = 0; i < count; ++i) {
    bool left = heads[i][0] == '<';
    sonde_text_put(&view->page, left ? "<th class=\"l\">" : "<th>");
    sonde_text_escape(&view->page, heads[i] + left);
    sonde_text_put(&view->page, "</th>");
  }
  sonde_text_put(&view->page, "</tr></thead>\n<tbody>\n");
}

void sonde_row_begin(sonde_report_view *view, bool strong) {
  sonde_text_put(&view->page, strong ? "<tr class=\"strong\">" : "<tr>");
}

void sonde_cell_text(sonde_report_view *view, const char *utf8) {
  sonde_text_put(&view->page, "<td class=\"l\">");
  sonde_text_escape(&view->page, utf8);
  sonde_text_put(&view->page, "</td>");
}

void sonde_cell(sonde_report_view *view, sonde_number number) {
  sonde_text_format(&view->page, "<td>%s</td>", number.s);
}

void sonde_cell_words(sonde_report_view *view, const char *words) {
  sonde_text_format(&view->page, "<td>%s</td>", words);
}

void sonde_row_end(sonde_report_view *view) { sonde_text_put(&view->page, "</tr>\n"); }

void sonde_table_end(sonde_report_view *view) {
  sonde_text_put(&view->page, "</tbody></table></div>\n");
}
