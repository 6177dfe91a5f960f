// Claims, tables and figures of `sonde paper`: collecting them, and the JSON object that holds
// them.
#include "paper.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const char *const VERDICT[PAPER_VERDICTS] = {"holds", "in part", "does not hold",
                                                    "not tried"};

const char *paper_verdict_text(paper_verdict verdict) {
  assert(verdict < PAPER_VERDICTS);
  return VERDICT[verdict];
}

void paper_path(const paper *p, const char *name, char *path, size_t room) {
  assert(p->directory && room > 0);
  snprintf(path, room, "%s/%s", p->directory, name);
}

paper_claim *paper_begin(paper *p, const char *id, const char *section, const char *sentence,
                         const char *done) {
  assert(p->claim_count < PAPER_CLAIMS);
  paper_claim *claim = &p->claim[p->claim_count++];
  *claim = (paper_claim){
      .id = id, .section = section, .sentence = sentence, .done = done, .verdict = PAPER_OPEN};
  return claim;
}

void paper_samples(paper_claim *claim, uint32_t count, const char *what) {
  claim->samples = count, claim->sample = what;
}

void paper_value(paper_claim *claim, const char *key, double value) {
  assert(claim->value_count < PAPER_VALUES);
  claim->value[claim->value_count].key = key;
  claim->value[claim->value_count++].value = value;
}

void paper_sort(paper *p) {
  for (uint32_t i = 1; i < p->claim_count; ++i) {
    paper_claim claim = p->claim[i];
    size_t length = strcspn(claim.section, ",");
    uint32_t k = i;
    for (; k > 0 && strncmp(p->claim[k - 1].section, claim.section, length) > 0; --k)
      p->claim[k] = p->claim[k - 1];
    p->claim[k] = claim;
  }
}

void paper_say(paper_claim *claim, paper_verdict verdict, const char *format, ...) {
  claim->verdict = verdict;
  va_list list;
  va_start(list, format);
  vsnprintf(claim->found, sizeof claim->found, format, list);
  va_end(list);
}

paper_table *paper_table_begin(paper *p, const char *id, const char *title, const char *columns) {
  assert(p->table_count < PAPER_TABLES);
  paper_table *table = &p->table[p->table_count++];
  *table = (paper_table){.id = id, .title = title};
  for (const char *c = columns; *c; c += strcspn(c, "\n"), c += *c == '\n') {
    assert(table->column_count < PAPER_COLUMNS && strchr(c, '|'));
    table->column[table->column_count] = c;
    table->head[table->column_count++] = strchr(c, '|') + 1;
  }
  return table;
}

double paper_cell(const paper_table *t, const char *row, const char *column) {
  for (uint32_t r = 0; r < t->row_count; ++r)
    for (uint32_t k = 0; k < t->column_count && strcmp(t->row[r].key, row) == 0; ++k)
      if (strncmp(t->column[k], column, strlen(column)) == 0 && t->column[k][strlen(column)] == '|')
        return t->row[r].cell[k];
  return NAN;
}

void paper_row(paper_table *table, const char *key, const char *name, const double *cells) {
  assert(table->row_count < PAPER_ROWS);
  uint32_t r = table->row_count++;
  snprintf(table->row[r].key, sizeof table->row[r].key, "%s", key);
  snprintf(table->row[r].name, sizeof table->row[r].name, "%s", name);
  memcpy(table->row[r].cell, cells, table->column_count * sizeof *cells);
}

void paper_caption(char *caption, size_t room, const char *format, ...) {
  va_list list;
  va_start(list, format);
  vsnprintf(caption, room, format, list);
  va_end(list);
}

// ---- figures

sonde_status paper_figure_begin(paper *p, int number, const char *title, double width,
                                double height, sonde_file **drawing, sonde_error *error) {
  assert(number >= 1 && number <= PAPER_FIGURES);
  paper_figure *f = &p->figure[number - 1];
  char path[1200];
  snprintf(f->file, sizeof f->file, "fig%d.svg", number);
  snprintf(f->title, sizeof f->title, "%s", title);
  paper_path(p, f->file, path, sizeof path);
  sonde_status status = sonde_file_create(path, drawing, error);
  if (!status) sonde_svg_begin(*drawing, title, width, height);
  return status;
}

sonde_status paper_figure_end(sonde_file *drawing, sonde_status status, sonde_error *error) {
  if (!drawing) return status;
  if (!status) return sonde_svg_end(drawing, error);
  sonde_file_discard(drawing);
  return status;
}

// ---- JSON

static void put_claims(const paper *p, sonde_json_out *out) {
  sonde_json_begin_object(out, "claims");
  for (const paper_claim *c = p->claim; c < p->claim + p->claim_count; ++c) {
    sonde_json_begin_object(out, c->id);
    sonde_json_put_text(out, "section", c->section);
    sonde_json_put_text(out, "sentence", c->sentence);
    sonde_json_put_text(out, "done", c->done);
    sonde_json_put_text(out, "found", c->found);
    sonde_json_put_text(out, "verdict", VERDICT[c->verdict]);
    sonde_json_put_integer(out, "samples", c->samples);
    if (c->sample) sonde_json_put_text(out, "sample", c->sample);
    for (uint32_t k = 0; k < c->value_count; ++k)
      sonde_json_put_real(out, c->value[k].key, c->value[k].value, 6);
    sonde_json_end(out);
  }
  sonde_json_end(out);
}

static void put_table(const paper_table *t, sonde_json_out *out) {
  char text[120];
  sonde_json_begin_object(out, t->id);
  sonde_json_put_text(out, "title", t->title);
  sonde_json_put_text(out, "caption", t->caption);
  sonde_json_begin_object(out, "columns");
  for (uint32_t k = 0; k < t->column_count; ++k) {
    char key[40];
    snprintf(key, sizeof key, "%.*s", (int)strcspn(t->column[k], "|"), t->column[k]);
    snprintf(text, sizeof text, "%.*s", (int)strcspn(t->head[k], "\n"), t->head[k]);
    sonde_json_put_text(out, key, text);
  }
  sonde_json_end(out);
  sonde_json_begin_object(out, "rows");
  for (uint32_t r = 0; r < t->row_count; ++r) {
    sonde_json_begin_object(out, t->row[r].key);
    sonde_json_put_text(out, "name", t->row[r].name);
    for (uint32_t k = 0; k < t->column_count; ++k) {
      snprintf(text, sizeof text, "%.*s", (int)strcspn(t->column[k], "|"), t->column[k]);
      sonde_json_put_real(out, text, t->row[r].cell[k], 6);
    }
    sonde_json_end(out);
  }
  sonde_json_end(out);
  sonde_json_end(out);
}

static sonde_status put_figures(const paper *p, bool drawings, sonde_json_out *out,
                                sonde_error *error) {
  sonde_status status = SONDE_OK;
  sonde_json_begin_object(out, "figures");
  for (int k = 0; k < PAPER_FIGURES && !status; ++k) {
    const paper_figure *f = &p->figure[k];
    char key[8], path[1200], *text = NULL;
    size_t count = 0;
    if (!f->file[0]) continue;
    snprintf(key, sizeof key, "fig%d", k + 1);
    paper_path(p, f->file, path, sizeof path);
    status = sonde_file_load(path, &text, &count, error);
    if (status) break;
    sonde_json_begin_object(out, key);
    sonde_json_put_text(out, "file", f->file);
    sonde_json_put_text(out, "title", f->title);
    sonde_json_put_text(out, "caption", f->caption);
    sonde_json_put_integer(out, "bytes", (int64_t)count);
    if (drawings) sonde_json_put_text(out, "drawing", text);
    sonde_json_end(out);
    sonde_free(text);
  }
  sonde_json_end(out);
  return status;
}

sonde_status paper_put_json(const paper *p, bool drawings, sonde_json_layout layout, char **json,
                            size_t *length, sonde_error *error) {
  sonde_json_out out = {.layout = layout};
  uint32_t verdicts[PAPER_VERDICTS] = {0};
  for (uint32_t k = 0; k < p->claim_count; ++k) verdicts[p->claim[k].verdict]++;
  sonde_status status = sonde_file_in_memory(&out.file, error);
  if (status) return status;
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_text(&out, "kind", "paper");
  sonde_json_put_text(&out, "title", "The 1999 paper, figure by figure and claim by claim");
  sonde_json_put_text(&out, "version", sonde_version());
  sonde_json_put_text(&out, "model", p->model->name);
  sonde_json_put_text(&out, "provenance", p->model->provenance);
  sonde_json_put_bool(&out, "quick", p->quick);
  sonde_json_put_integer(&out, "sites", p->sites.count);
  sonde_json_put_integer(&out, "measurements", p->measurements.count);
  sonde_json_put_integer(&out, "third_measurements", p->third.count);
  sonde_json_put_integer(&out, "nodes", p->model->surface.vertex_count);
  sonde_json_put_integer(&out, "holds", verdicts[PAPER_HOLDS]);
  sonde_json_put_integer(&out, "in_part", verdicts[PAPER_IN_PART]);
  sonde_json_put_integer(&out, "does_not_hold", verdicts[PAPER_FAILS]);
  sonde_json_put_integer(&out, "not_tried", verdicts[PAPER_OPEN]);
  put_claims(p, &out);
  sonde_json_begin_object(&out, "tables");
  for (uint32_t k = 0; k < p->table_count; ++k) put_table(&p->table[k], &out);
  sonde_json_end(&out);
  status = put_figures(p, drawings, &out, error);
  sonde_json_end(&out);
  if (status) {
    sonde_file_discard(out.file);
    return status;
  }
  return sonde_file_take(out.file, json, length, error);
}
