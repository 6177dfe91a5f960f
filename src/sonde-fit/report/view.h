// What the sections of the page share: the report as given, the page as far as it is written, and
// the measurements sorted out into probes, sites and depths.
#ifndef SONDE_SRC_REPORT_VIEW_H
#define SONDE_SRC_REPORT_VIEW_H

#include "base/order.h"
#include "report/chart.h"
#include "sonde/report.h"

enum { SONDE_REPORT_FIGURES = 32, SONDE_REPORT_BINS = 40 };
enum { SONDE_ALL = UINT32_MAX }; // every probe, every site

typedef struct sonde_report_place {
  uint32_t id;
  sonde_vec3 position_m, normal, along; // along: footprint axis v; zero when not known
  double fat_m;                         // NaN when not known
} sonde_report_place;

typedef struct sonde_report_view {
  const sonde_fit_report *in;
  sonde_text page;       // body of the page, section by section
  sonde_text contents;   // links to the sections
  sonde_figure *figures; // [SONDE_REPORT_FIGURES]
  uint32_t figure_count, table_count;
  bool section_open;
  bool memory; // an allocation failed

  const sonde_report_stage *main; // NULL without stages
  bool synthetic;                 // the provenance says so
  uint32_t rows;                  // measurements
  uint32_t probe_count;
  char probe[SONDE_FIT_PROBES][24];
  uint32_t *row_probe, *row_site; // [rows] indices
  double *depth_m, *force_n;      // [rows]
  double *scratch[3];             // [rows] for whoever needs it
  uint32_t site_count;
  sonde_report_place *sites; // [site_count] of the table or the model, then those of the data alone
  double bin_m;              // width of a depth bin, centred on its multiples
  uint32_t bin_count;
} sonde_report_view;

sonde_status sonde_view_open(const sonde_fit_report *report, sonde_report_view *view,
                             sonde_error *error);
void sonde_view_close(sonde_report_view *view);

// Rows of one probe, site and depth bin (SONDE_ALL: any).
typedef struct sonde_report_pick {
  uint32_t probe, site, bin;
} sonde_report_pick;
static const sonde_report_pick SONDE_PICK_ALL = {SONDE_ALL, SONDE_ALL, SONDE_ALL};

// Of the picked rows where the stage has a force.
typedef struct sonde_report_group {
  sonde_error_statistics errors;
  double least_n, most_n;           // measured
  double bias_percent;              // sum of errors over sum of forces
  double low_percent, high_percent; // quartiles of the rows' relative errors
} sonde_report_group;

bool sonde_view_picks(const sonde_report_view *view, sonde_report_pick pick, uint32_t row);
// False when there is no such row.
bool sonde_view_group(sonde_report_view *view, const double *model_n, sonde_report_pick pick,
                      sonde_report_group *group);
// The picked rows' error model - measurement into out, ascending; returns their number.
uint32_t sonde_view_errors(sonde_report_view *view, sonde_report_pick pick, double *out);
uint32_t sonde_view_bin(const sonde_report_view *view, double depth_m);

// ---- html.c: the page -------------------------------------------------------------------------

// The whole page around its body.
void sonde_page_write(sonde_report_view *view, sonde_text *out);
// Opens a section; the one before it is closed. A name for links, a title.
void sonde_page_section(sonde_report_view *view, const char *id, const char *title);
// A paragraph of our own words with numbers in it; foreign text goes through sonde_text_escape.
void sonde_page_paragraph(sonde_report_view *view, const char *words);

// Begins a figure; sonde_figure_place puts it on the page with its caption.
sonde_figure *sonde_figure_begin(sonde_report_view *view, const char *name, const char *title,
                                 double width, double height);
void sonde_figure_place(sonde_report_view *view, sonde_figure *figure, const char *caption);
// The same for a name and a title that end with foreign text.
sonde_figure *sonde_figure_begin_for(sonde_report_view *view, const char *name, const char *title,
                                     const char *of, double width, double height);
void sonde_figures_side_by_side(sonde_report_view *view, bool begin);

// Tables: cells are numbers unless said otherwise. Heads: "text" alone or "<text" for a left
// column.
void sonde_table_begin(sonde_report_view *view, const char *caption);
void sonde_table_head(sonde_report_view *view, const char *const *heads, uint32_t count);
void sonde_row_begin(sonde_report_view *view, bool strong);
void sonde_cell_text(sonde_report_view *view, const char *utf8);
void sonde_cell(sonde_report_view *view, sonde_number number);
void sonde_cell_words(sonde_report_view *view, const char *words);
void sonde_row_end(sonde_report_view *view);
void sonde_table_end(sonde_report_view *view);

// ---- sections -----------------------------------------------------------------------------------

void sonde_report_summary(sonde_report_view *view);
void sonde_report_stages(sonde_report_view *view);
void sonde_report_curves(sonde_report_view *view);
void sonde_report_errors(sonde_report_view *view);
void sonde_report_error_tables(sonde_report_view *view);
void sonde_report_maps(sonde_report_view *view);
void sonde_report_parameters(sonde_report_view *view);
void sonde_report_correlation(sonde_report_view *view);
void sonde_report_profiles(sonde_report_view *view);
void sonde_report_identifiability_section(sonde_report_view *view);
void sonde_report_holdouts(sonde_report_view *view);
void sonde_report_end_matter(sonde_report_view *view);

#endif
