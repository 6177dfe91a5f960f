// Any JSON as tables: what a report shows for which there is no view of its own.

import { h, Page } from "./dom";
import { columns } from "./table";

type Json = null | boolean | number | string | Json[] | { [key: string]: Json };

const MOST_ROWS = 200;
const isObject = (value: Json | undefined): value is { [key: string]: Json } => typeof value === "object" && value !== null && !Array.isArray(value);
const cell = (value: Json | undefined): string => (value === undefined ? "" : typeof value === "object" && value ? JSON.stringify(value) : String(value));

/** Objects become a table of names and values; lists of objects a table with their members as columns. */
function show(page: Page, into: HTMLElement, value: Json): void {
  const list = Array.isArray(value) ? value : null;
  if (list && list.every(isObject)) {
    const names = [...new Set((list as { [key: string]: Json }[]).flatMap((row) => Object.keys(row)))];
    page.table(into, { columns: columns(...names), rows: list.slice(0, MOST_ROWS).map((row) => ({ cells: names.map((name) => cell((row as { [key: string]: Json })[name])) })) });
  } else if (list) {
    into.append(h("p", {}, list.slice(0, MOST_ROWS).map(cell).join(", ")));
  } else if (isObject(value)) {
    page.table(into, { columns: columns("<Name", "<Value"), rows: Object.entries(value).map(([name, v]) => ({ cells: [name, cell(v)] })) });
  }
}

export function plain(data: unknown): void {
  const report = data as { [key: string]: Json };
  const page = new Page(typeof report["title"] === "string" ? report["title"] : "Report");
  const large = (value: Json): boolean => typeof value === "object" && value !== null;
  page.facts(Object.entries(report).filter(([, v]) => !large(v)).map(([name, v]) => [name, cell(v)]));
  for (const [name, value] of Object.entries(report)) if (large(value)) show(page, page.section(name, name), value);
  page.show();
}
