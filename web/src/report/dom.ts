// Elements of a report, and the page that counts its figures and tables. All text enters as text, never as markup.

import { table, type TableOptions } from "./table";

export type Child = Node | string | null | undefined | false;
type Attributes = Record<string, string | number | undefined>;

function fill<T extends Element>(element: T, attributes: Attributes, children: Child[]): T {
  for (const [name, value] of Object.entries(attributes)) if (value !== undefined) element.setAttribute(name, String(value));
  for (const child of children) if (child) element.append(child);
  return element;
}

/** An element of HTML. */
export function h<K extends keyof HTMLElementTagNameMap>(tag: K, attributes: Attributes = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  return fill(document.createElement(tag), attributes, children);
}

/** An element of SVG; numbers keep two decimals. */
export function s<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Attributes = {}, ...children: Child[]): SVGElementTagNameMap[K] {
  const rounded = Object.entries(attributes).map(([name, value]) => [name, typeof value === "number" ? Math.round(value * 100) / 100 : value]);
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), Object.fromEntries(rounded) as Attributes, children);
}

/** A file of the reader's own: the figure with its style, for papers and slides. */
function saveSvg(drawing: SVGElement, name: string): void {
  const copy = drawing.cloneNode(true) as SVGElement;
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.prepend(s("style", {}, document.getElementById("figure-style")?.textContent ?? ""), s("rect", { width: "100%", height: "100%", fill: "#fff" }));
  const text = `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(copy)}\n`;
  const link = h("a", { href: URL.createObjectURL(new Blob([text], { type: "image/svg+xml" })), download: `${name}.svg` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

export interface FigureOptions {
  /** letters, digits, hyphens: of the link and the saved file */
  name: string;
  title: string;
  caption?: string;
  /** drawn for the width of the page */
  wide?: boolean;
}

/** The page: header, links to the sections, sections. What is not given leaves no trace. */
export class Page {
  private readonly header = h("header");
  private readonly links = h("nav", { "aria-label": "Sections" });
  private readonly main = h("main");
  private figures = 0;
  private tables = 0;

  constructor(title: string) {
    this.header.append(h("h1", {}, title));
    document.title = title;
  }

  /** Name and value of what the report is about; an empty value is left out. */
  facts(rows: [name: string, value: string | null | undefined, code?: "code"][]): void {
    const list = h("dl");
    for (const [name, value, code] of rows) if (value) list.append(h("dt", {}, name), h("dd", {}, code ? h("code", {}, value) : value));
    if (list.childElementCount) this.header.append(list);
  }

  /** Remarks and warnings. */
  notes(texts: string[]): void {
    if (texts.length) this.header.append(h("div", { class: "notes" }, h("ul", {}, ...texts.map((text) => h("li", {}, text)))));
  }

  section(id: string, title: string): HTMLElement {
    const section = h("section", { id }, h("h2", {}, title));
    this.links.append(h("a", { href: `#${id}` }, title), " ");
    this.main.append(section);
    return section;
  }

  figure(into: HTMLElement, drawing: SVGElement, options: FigureOptions): void {
    const number = ++this.figures;
    drawing.setAttribute("role", "img");
    drawing.setAttribute("aria-label", options.title);
    const save = h("button", { type: "button", class: "save", title: "Save this figure as an SVG file" }, "SVG");
    save.onclick = () => saveSvg(drawing, `${String(number).padStart(2, "0")}-${options.name}`);
    const caption = h("figcaption", {}, h("b", {}, `Figure ${number}. ${options.title}.`), ` ${options.caption ?? ""} `, save);
    into.append(h("figure", { id: `figure-${options.name}`, class: options.wide ?? Number(drawing.getAttribute("width")) > 800 ? "full" : undefined }, drawing, caption));
  }

  /** A table under its number; `caption` explains the columns. */
  table(into: HTMLElement, options: TableOptions): void {
    const words = typeof options.caption === "string" ? [options.caption] : options.caption ?? [];
    into.append(table({ ...options, caption: [h("b", {}, `Table ${++this.tables}. `), ...words] }));
  }

  /** Puts the page into the document. */
  show(footer = "Written by Sonde. This file holds everything that it shows."): void {
    if (this.links.childElementCount > 1) this.header.append(this.links);
    document.body.append(this.header, this.main, h("footer", {}, footer));
  }
}

/** The large figures at the top: value with unit, and what it means. */
export function keys(...items: [value: string, meaning: string][]): HTMLElement {
  return h("div", { class: "key" }, ...items.map(([value, meaning]) => h("div", {}, h("b", {}, value), h("span", {}, meaning))));
}

export const paragraph = (text: string): HTMLElement => h("p", {}, text);
