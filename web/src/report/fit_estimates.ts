// Parameters with their intervals, and how well the data determine them: correlation, profiles, deviations by data.

import { axis, range, tightAxis } from "./axis";
import { Chart, drawing, legendRow, PALETTE, text, textWidth } from "./chart";
import { diverging } from "./colour";
import { h, type Page, s } from "./dom";
import type { FitReport, Interval, Profile, SiteParameters } from "./fit_data";
import { fixed, isKnown, type Real, real, significant } from "./number";
import { columns } from "./table";

const words = (lower: Real, upper: Real, digits: number): string =>
  isKnown(lower) || isKnown(upper) ? `${isKnown(lower) ? significant(lower, digits) : "?"} to ${isKnown(upper) ? significant(upper, digits) : "?"}` : "\u2013";

/** Which intervals any of these has. */
const kinds = (list: Interval[]): { bounds: boolean; bootstrap: boolean } => ({
  bounds: list.some((i) => isKnown(i.lower) || isKnown(i.upper)),
  bootstrap: list.some((i) => isKnown(i.bootstrap_lower) || isKnown(i.bootstrap_upper)),
});

const intervalHeads = (k: { bounds: boolean; bootstrap: boolean }): string[] => [...(k.bounds ? ["95 % interval"] : []), ...(k.bootstrap ? ["95 % bootstrap"] : [])];
const intervalCells = (i: Interval | undefined, k: { bounds: boolean; bootstrap: boolean }): string[] => [
  significant(i?.value, 4),
  ...(k.bounds ? [words(i?.lower, i?.upper, 4)] : []),
  ...(k.bootstrap ? [words(i?.bootstrap_lower, i?.bootstrap_upper, 4)] : []),
];

// ---- parameters

const SITE_COLUMNS: [head: string, of: (site: SiteParameters) => Interval | undefined][] = [
  ["k\u2080, kPa/mm", (site) => site.k0_kpa_mm],
  ["x\u2098, mm", (site) => site.xm_mm],
  ["G, N/m", (site) => site.shear_n_m],
  ["g\u2098", (site) => site.shear_limit],
];

function siteFigure(sites: SiteParameters[]): SVGElement {
  const svg = drawing(830, 560);
  SITE_COLUMNS.slice(0, 2).forEach(([head, of], row) => {
    const intervals = sites.map((site) => of(site)!);
    // A wide interval must not squeeze the values: it is cut at three times the value.
    const ends = intervals.flatMap((i) => [real(i.value), Math.max(real(i.lower), real(i.value) / 3), Math.min(real(i.upper), 3 * real(i.value))]);
        const x = tightAxis("site", -1, Math.max(1, ...sites.map((site) => site.site)) + 1, 16);
    const chart = new Chart(svg, { left: 62, top: 28 + 280 * row, width: 740, height: 200, x, y: axis(head, ...range(ends), 6) });
    sites.forEach((site, i) => {
      const v = intervals[i]!;
      chart.errorBar(site.site - 0.12, real(v.lower), real(v.upper), { colour: PALETTE[0] });
      chart.errorBar(site.site + 0.12, real(v.bootstrap_lower), real(v.bootstrap_upper), { colour: PALETTE[1], dash: "3 2" });
    });
    chart.marks(sites.map((site) => site.site), intervals.map((i) => real(i.value)), { colour: "#222" });
  });
  const k = kinds(sites.flatMap((site) => [site.k0_kpa_mm, site.xm_mm]));
  legendRow(svg, 520, 18, [
    ...(k.bounds ? [{ kind: "line" as const, colour: PALETTE[0], text: "95 % interval" }] : []),
    ...(k.bootstrap ? [{ kind: "line" as const, colour: PALETTE[1], dash: "3 2", text: "95 % bootstrap" }] : []),
  ]);
  return svg;
}

export function fitParameters(page: Page, report: FitReport): void {
  const { parameters, site_parameters: sites } = report;
  if (!parameters.length && !sites.length) return;
  const section = page.section("parameters", "Parameters");
  if (parameters.length) {
    const k = kinds(parameters.map((p) => p.estimate));
    const notes = parameters.some((p) => p.note);
    page.table(section, {
      caption: "Parameters of the whole model.",
      columns: columns("<Parameter", "Value", ...intervalHeads(k), "<Unit", ...(notes ? ["<Note"] : [])),
      rows: parameters.map((p) => ({ cells: [p.name ?? "", ...intervalCells(p.estimate, k), p.unit ?? "", ...(notes ? [p.note ?? ""] : [])] })),
    });
  }
  if (!sites.length) return;
  const sheared = sites[0]!.shear_n_m !== undefined;
  const shown = SITE_COLUMNS.slice(0, sheared ? 4 : 2);
  const k = kinds(sites.flatMap((site) => shown.flatMap(([, of]) => of(site) ?? [])));
  page.figure(section, siteFigure(sites), {
    name: "sites",
    title: "Parameters of the sites",
    caption: k.bounds || k.bootstrap ? "Circles are estimates, lines their intervals, drawn up to three times the value. Where the lines of two sites do not overlap, the thigh differs there by more than the estimation's uncertainty." : "Circles are estimates; this report gives no intervals for them.",
  });
  const details = h("details", {}, h("summary", {}, "Parameters of every site"));
  section.append(details);
  page.table(details, {
    caption: sheared ? "Parameters of the sites: normal springs k\u2080, x\u2098, shear layer G, g\u2098." : "Parameters of the sites: p(s) = k\u2080 s/(1 \u2212 s/x\u2098).",
    columns: columns("Site", ...shown.flatMap(([head]) => [head, ...intervalHeads(k)])),
    rows: sites.map((site) => ({ cells: [String(site.site), ...shown.flatMap(([, of]) => intervalCells(of(site), k))] })),
  });
}

// ---- correlation

function correlationFigure(names: string[], values: Real[]): SVGElement {
  const n = Math.round(Math.sqrt(values.length));
  const cell = Math.min(560 / n, 64);
  const every = Math.ceil(10 / cell); // name: as many as have room
  const margin = 14 + Math.min(160, Math.max(20, ...names.map((name) => textWidth(name))));
  const side = n * cell;
  const svg = drawing(margin + side + 100, margin + Math.max(side, 290) + 12);
  for (let i = 0; i < n; ++i)
    for (let j = 0; j < n; ++j) {
      const value = values[i * n + j];
      svg.append(s("rect", { x: margin + j * cell, y: margin + i * cell, width: cell, height: cell, fill: isKnown(value) ? diverging(value) : "#bbb", "shape-rendering": "crispEdges" }));
      if (cell >= 28) svg.append(text(margin + (j + 0.5) * cell, margin + (i + 0.5) * cell + 4, Math.abs(real(value)) > 0.75 ? "tick middle light" : "tick middle", fixed(value, 2)));
    }
  svg.append(s("rect", { x: margin, y: margin, width: side, height: side, class: "axis" }));
  names.forEach((name, i) => {
    if (i % every) return;
    const [at, size] = [margin + (i + 0.5) * cell + 3.5, cell < 13 ? "small" : "tick"];
    svg.append(text(margin - 6, at, `${size} end`, name), s("text", { transform: `translate(${at} ${margin - 6}) rotate(-90)`, class: size }, name));
  });
  const [x, top, parts] = [margin + side + 40, margin + 24, 41];
  for (let i = 0; i < parts; ++i) svg.append(s("rect", { x, y: top + 6 * i, width: 14, height: 6, fill: diverging(1 - (2 * i) / (parts - 1)), "shape-rendering": "crispEdges" }));
  for (let i = 0; i <= 4; ++i) {
    const at = top + (6 * parts * i) / 4;
    svg.append(s("line", { x1: x + 14, x2: x + 18, y1: at, y2: at, class: "axis" }), text(x + 22, at + 4, "tick", fixed(1 - 0.5 * i, 1)));
  }
  svg.append(text(x + 8, top - 12, "tick middle", "correlation"));
  return svg;
}

export function fitCorrelation(page: Page, report: FitReport): void {
  if (!report.correlation) return;
  page.figure(page.section("correlation", "Correlation of the estimates"), correlationFigure(report.correlation.names, report.correlation.values), {
    name: "correlation",
    title: "Correlation of the estimated parameters",
    caption: "Blue: an error in one estimate comes with an opposite error in the other; orange: both err the same way; grey: unknown. Strong colour away from the diagonal says that the data fix a combination of the two better than either alone.",
  });
}

// ---- profile likelihood

function drawProfile(svg: SVGElement, p: Profile, place: number): void {
  const label = [p.name, p.unit].filter(Boolean).join(", ");
  const [left, top] = [62 + 420 * (place % 2), 30 + 280 * Math.floor(place / 2)];
  const x = p.x.map(real);
  const chart = new Chart(svg, { left, top, width: 330, height: 190, title: p.name ?? "", x: tightAxis(label, ...range(x), 5), y: axis("rise of 2 \u00d7 cost", 0, 2.6 * p.threshold, 5) });
  chart.box(real(p.lower), real(p.upper), 0, p.threshold, { fill: PALETTE[0], "fill-opacity": 0.1 });
  if (p.quadratic) chart.line(x, p.quadratic.map(real), { colour: "#777", dash: "2 3" });
  chart.line(x, p.rise.map(real)).marks(x, p.rise.map(real));
  chart.across(p.threshold, "dash").upright(real(p.estimate), "zero");
  svg.append(text(left + 330, top - 10, "tick end", isKnown(p.lower) || isKnown(p.upper) ? words(p.lower, p.upper, 3) : "no bound within the range"));
}

export function fitProfiles(page: Page, report: FitReport): void {
  const { profiles } = report;
  if (!profiles.length) return;
  const svg = drawing(830, 280 * Math.ceil(profiles.length / 2) + 8);
  profiles.forEach((p, i) => drawProfile(svg, p, i));
  const dotted = profiles.some((p) => p.quadratic) ? " Dotted: what the covariance alone would say; where both agree the problem is nearly linear." : "";
  page.figure(page.section("profiles", "Profile likelihood"), svg, {
    name: "profiles",
    title: "Profile likelihood",
    caption: `Each parameter is held at the value on the axis while all others are estimated again; the curve is how much worse the fit becomes. Where it stays below the dashed line lies the 95\u00a0% interval (shaded, written above).${dotted} A flat curve would mean that the data do not determine the parameter.`,
  });
}

// ---- what the data determine

export function fitIdentifiability(page: Page, report: FitReport): void {
  const rows = report.identifiability;
  if (!rows.length) return;
  const begins = rows.map((row, i) => Boolean(row.parameter) && row.parameter !== rows[i - 1]?.parameter);
  const most = range(rows.map((row) => real(row.relative_sd)), 0)[1] || 1;
  const left = 12 + Math.min(248, Math.max(60, ...rows.map((row) => textWidth(row.data ?? "", 12))));
  const svg = drawing(830, 20 + 28 * begins.filter(Boolean).length + 26 * rows.length);
  let y = 8;
  rows.forEach((row, i) => {
    if (begins[i]) {
      svg.append(text(0, y + 18, "head", row.parameter!));
      y += 28;
    }
    const known = isKnown(row.relative_sd) && row.relative_sd >= 0;
    const width = 700 - left;
    const length = known ? (width * real(row.relative_sd)) / most : width;
    const look = known ? { fill: PALETTE[0], "fill-opacity": 0.75 } : { fill: "none", stroke: PALETTE[1], "stroke-dasharray": "4 3" };
    svg.append(
      text(left - 10, y + 14, "end", row.data ?? ""),
      s("rect", { x: left, y: y + 2, width: length, height: 16, ...look }),
      text(left + length + 8, y + 14, "tick", known ? `${significant(100 * real(row.relative_sd), 3)} %` : "not determined"),
      s("line", { x1: left, x2: left, y1: y - 3, y2: y + 23, class: "axis" }),
    );
    y += 26;
  });
  page.figure(page.section("identifiability", "What the data determine"), svg, {
    name: "identifiability",
    title: "Identifiability by data",
    caption: "Relative standard deviation of the estimate (from the curvature of the cost) with part of the data and with all. A long bar: these data alone leave the parameter open; if the bar for all data is much shorter than either, the probes determine it together.",
  });
}
