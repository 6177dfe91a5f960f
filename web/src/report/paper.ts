// The report of the paper: its claims with what came out, its figures, and the tables behind them.

import { type Child, h, keys, Page, paragraph } from "./dom";
import { grouped, type Real, significant } from "./number";
import type { Column } from "./table";

type Verdict = "holds" | "in part" | "does not hold" | "not tried";

interface Claim {
  section: string;
  sentence: string;
  done: string;
  found: string;
  verdict: Verdict;
  samples: number;
  sample?: string;
}

interface Figure {
  file: string;
  title: string;
  caption: string;
  drawing?: string;
}

interface Table {
  title: string;
  caption: string;
  columns: Record<string, string>;
  rows: Record<string, Record<string, Real> & { name: string }>;
}

interface PaperReport {
  title: string;
  version: string;
  model: string;
  provenance: string;
  quick: boolean;
  sites: number;
  measurements: number;
  third_measurements: number;
  nodes: number;
  holds: number;
  in_part: number;
  does_not_hold: number;
  not_tried: number;
  claims: Record<string, Claim>;
  tables: Record<string, Table>;
  figures: Record<string, Figure>;
}

const mark = (verdict: Verdict): HTMLElement => h("span", { class: `claim-verdict ${verdict.replace(/ /g, "-")}` }, verdict);

/** A file's drawing within the page, with the page's style for its words. */
function drawn(figure: Figure): SVGElement | null {
  const svg = new DOMParser().parseFromString(figure.drawing ?? "", "image/svg+xml").documentElement;
  if (svg.tagName !== "svg") return null;
  for (const part of svg.querySelectorAll("style, title")) part.remove();
  svg.setAttribute("class", "fig");
  return document.importNode(svg, true) as unknown as SVGElement;
}

function showClaims(page: Page, report: PaperReport): void {
  const section = page.section("claims", "Claims");
  const heads: Column[] = ["Verdict", "The paper says", "What was done", "What came out", "n"].map((head) => ({ head, words: head !== "n" }));
  const row = (id: string, c: Claim): { cells: (string | Node)[] } => {
    const samples: Child[] = c.samples ? [grouped(c.samples), c.sample ? h("small", {}, ` ${c.sample}`) : null] : [];
    return { cells: [mark(c.verdict), h("span", { id: `claim-${id}` }, c.sentence, h("small", {}, ` (${c.section})`)), c.done, c.found, h("span", {}, ...samples)] };
  };
  page.table(section, {
    caption: "A row for each claim, in the order of the paper\u2019s sections. The sentences are shortened; the section stands behind them. n: what was counted.",
    columns: heads,
    rows: Object.entries(report.claims).map(([id, claim]) => row(id, claim)),
  });
  section.classList.add("claims");
}

function showFigures(page: Page, report: PaperReport): void {
  const section = page.section("figures", "Figures");
  for (const [name, figure] of Object.entries(report.figures)) {
    const drawing = drawn(figure);
    const title = figure.title.replace(/^Figure \d+\. /, "");
    if (drawing) page.figure(section, drawing, { name, title, caption: figure.caption, wide: true });
  }
}

function showTables(page: Page, report: PaperReport): void {
  const section = page.section("paper-tables", "Tables");
  for (const [id, table] of Object.entries(report.tables)) {
    section.append(h("h3", { id: `table-${id}` }, table.title));
    const columns = Object.keys(table.columns);
    page.table(section, {
      caption: table.caption,
      columns: [{ head: "", words: true }, ...columns.map((key) => ({ head: table.columns[key]! }))],
      rows: Object.values(table.rows).map((row) => ({ cells: [row.name, ...columns.map((key) => (Number.isInteger(row[key]) ? grouped(row[key]) : significant(row[key], 3)))] })),
    });
  }
}

export function paper(data: unknown): void {
  const report = data as PaperReport;
  const page = new Page(report.title);
  page.facts([
    ["Paper", "D. d\u2019Aulignac, C. Laugier, M. C. Cavusoglu: Towards a realistic echographic simulator with force feedback. IROS 1999"],
    ["Model", `${report.model}, ${grouped(report.nodes)} nodes`],
    ["Data", `${grouped(report.measurements)} forces at ${report.sites} sites under two probes; ${grouped(report.third_measurements)} under a third footprint`],
    ["Source", report.provenance],
    ["Version", report.version],
  ]);
  page.notes([
    "The data are synthetic: forces come from finite elements, images from the simulator. The paper\u2019s own measurements are not public, so a claim is tried on data of the same kind, not on the paper\u2019s.",
    ...(report.quick ? ["Made with --quick: samples are small, and the figures are for tests only."] : []),
  ]);
  const summary = page.section("summary", "Summary");
  summary.append(
    keys([String(report.holds), "hold"], [String(report.in_part), "hold in part"], [String(report.does_not_hold), "do not hold"], ...(report.not_tried ? [[String(report.not_tried), "not tried"] as [string, string]] : [])),
    paragraph("Each claim was tried by running the simulator or the estimation; no figure is copied from the paper. \u201cHolds\u201d means that the sentence is true of our data and model; \u201cin part\u201d that it is true with the limit that its row names."),
  );
  showClaims(page, report);
  showFigures(page, report);
  showTables(page, report);
  page.show();
}
