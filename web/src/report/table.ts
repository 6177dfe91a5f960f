// Tables: numbers to the right, words to the left, heads with units, groups of columns.

import { h, type Child } from "./dom";

export type Cell = string | Node;

export interface Column {
  head: string;
  /** words stand to the left, numbers to the right */
  words?: boolean;
}

export interface TableOptions {
  caption?: string | Child[];
  columns: Column[];
  /** heads above some columns each; their spans add up to the number of columns */
  groups?: { head: string; span: number }[];
  rows: { cells: Cell[]; strong?: boolean }[];
}

/** Columns of numbers, or of words where the head begins with '<'. */
export const columns = (...heads: string[]): Column[] =>
  heads.map((head) => (head.startsWith("<") ? { head: head.slice(1), words: true } : { head }));

export function table(options: TableOptions): HTMLElement {
  const look = (column: Column | undefined): string | undefined => (column?.words ? "words" : undefined);
  const head = h("thead");
  if (options.groups)
    head.append(h("tr", { class: "groups" }, ...options.groups.map((g) => h("th", { colspan: g.span, scope: "colgroup" }, g.head))));
  head.append(h("tr", {}, ...options.columns.map((c) => h("th", { class: look(c), scope: "col" }, c.head))));
  const body = h("tbody");
  for (const row of options.rows)
    body.append(h("tr", { class: row.strong ? "strong" : undefined }, ...row.cells.map((cell, i) => h("td", { class: look(options.columns[i]) }, cell))));
  const caption = options.caption ? h("caption", {}, ...(typeof options.caption === "string" ? [options.caption] : options.caption)) : null;
  return h("div", { class: "wide" }, h("table", {}, caption, head, body));
}
