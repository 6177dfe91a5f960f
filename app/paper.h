// What `sonde paper` works on and what it finds: claims, tables and figures.
#ifndef SONDE_APP_PAPER_H
#define SONDE_APP_PAPER_H

#include "app.h"
#include "settled.h"

// How a sentence of the paper stands after it was tried.
typedef enum paper_verdict {
  PAPER_HOLDS,
  PAPER_IN_PART,
  PAPER_FAILS,
  PAPER_OPEN, // not tried
  PAPER_VERDICTS
} paper_verdict;

enum {
  PAPER_CLAIMS = 32,
  PAPER_VALUES = 16,
  PAPER_TABLES = 10,
  PAPER_ROWS = 16,
  PAPER_COLUMNS = 16,
  PAPER_FIGURES = 9,
  PAPER_TEXT = 640
};

// A sentence of the paper, what was done about it and what came out.
typedef struct paper_claim {
  const char *id, *section; // section of the paper
  const char *sentence;     // of the paper, shortened
  const char *done;
  char found[PAPER_TEXT]; // one sentence with the figures
  paper_verdict verdict;
  uint32_t samples;
  const char *sample; // what is counted
  uint32_t value_count;
  struct {
    const char *key; // with the unit at its end
    double value;
  } value[PAPER_VALUES];
} paper_claim;

// Rows of numbers, each with a key and a name.
typedef struct paper_table {
  const char *id, *title;
  char caption[PAPER_TEXT];
  uint32_t column_count, row_count;
  const char *column[PAPER_COLUMNS], *head[PAPER_COLUMNS]; // key; words with the unit
  struct {
    char key[40], name[80];
    double cell[PAPER_COLUMNS]; // NaN: not measured
  } row[PAPER_ROWS];
} paper_table;

// A figure of the paper, drawn.
typedef struct paper_figure {
  char file[16]; // in the directory
  char title[96], caption[PAPER_TEXT];
} paper_figure;

typedef struct paper {
  const char *directory, *model_path;
  bool quick; // smaller samples
  sonde_progress progress;
  sonde_model *model;
  sonde_site_table sites;          // of the model
  sonde_measurements measurements; // of the two probes that were fitted
  sonde_measurements third;        // of a third footprint, never fitted
  sonde_fit_def fit_def;           // of the three stages
  sonde_fit_result fit;            // zero until it is done
  struct {
    bool known;
    sonde_bulk_law law;
  } fitted[SONDE_CONDENSED_SOLID + 1]; // volumetric models by sonde_model_kind
  const sonde_site *central;           // where the examples are shown
  uint32_t claim_count, table_count;
  paper_claim claim[PAPER_CLAIMS];
  paper_table table[PAPER_TABLES];
  paper_figure figure[PAPER_FIGURES];
} paper;

// ---- recording (paper_record.c)

// Begins a claim; what is found is said by paper_say() and the values that follow.
paper_claim *paper_begin(paper *p, const char *id, const char *section, const char *sentence,
                         const char *done);
void paper_samples(paper_claim *claim, uint32_t count, const char *what);
void paper_value(paper_claim *claim, const char *key, double value);
__attribute__((format(printf, 3, 4))) void paper_say(paper_claim *claim, paper_verdict verdict,
                                                     const char *format, ...);
// A table with columns "key|head" separated by newlines.
paper_table *paper_table_begin(paper *p, const char *id, const char *title, const char *columns);
// A row with as many numbers as the table has columns.
void paper_row(paper_table *table, const char *key, const char *name, const double *cells);
// MAE over the mean force in per cent, of a probe or (NULL) of all; NaN when a model has no force.
double paper_percent(const sonde_error_report *report, const char *probe);
// Cell of a row and a column by their keys; NaN when there is none.
double paper_cell(const paper_table *table, const char *row, const char *column);
__attribute__((format(printf, 3, 4))) void paper_caption(char *caption, size_t room,
                                                         const char *format, ...);
// Begins figure `number` as SVG in the directory; paper_figure_end() writes it.
sonde_status paper_figure_begin(paper *p, int number, const char *title, double width,
                                double height, sonde_file **drawing, sonde_error *error);
// @param status of the drawing so far; unless it is OK the file is dropped
sonde_status paper_figure_end(sonde_file *drawing, sonde_status status, sonde_error *error);
// Everything found as one JSON object. @param drawings with the text of the figures
sonde_status paper_put_json(const paper *p, bool drawings, sonde_json_layout layout, char **json,
                            size_t *length, sonde_error *error);
// The claims in the order of the paper's sections; within one as they were begun.
void paper_sort(paper *p);
const char *paper_verdict_text(paper_verdict verdict);
// Path of a file in the directory.
void paper_path(const paper *p, const char *name, char *path, size_t room);

// ---- work, each part in a file of its own; each adds claims, tables and figures

sonde_status paper_curves(paper *p, sonde_error *error); // figures 4 and 5
sonde_status paper_fit(paper *p, sonde_error *error);    // figure 7
sonde_status paper_models(paper *p, sonde_error *error); // the table `models`
sonde_status paper_bulk(paper *p, sonde_error *error);   // the table `volumetric`
sonde_status paper_equal(paper *p, sonde_error *error);  // the table `equal_error`, figure 9
// Processor time of a state's creation and of a step of 1 ms while the flat probe goes in, ms.
sonde_status paper_time_steps(const paper *p, const sonde_model *model, double *setup_ms,
                              double *step_ms, sonde_error *error);
sonde_status paper_drawings(paper *p, sonde_error *error);  // figures 3 and 6
sonde_status paper_pressed(paper *p, sonde_error *error);   // figure 8
sonde_status paper_sweep(paper *p, sonde_error *error);     // figures 1 and 2
sonde_status paper_collision(paper *p, sonde_error *error); // penalty against impulse
sonde_status paper_steps(paper *p, sonde_error *error);     // explicit against implicit
sonde_status paper_solvers(paper *p, sonde_error *error);   // dense against sparse
sonde_status paper_speed(paper *p, sonde_error *error);     // frames, collision's share, distance

#endif
