// Errors: histogram with the fitted distributions, relative error by depth, error against force; tables by probe,
// depth and site.

import { axis, range, tightAxis } from "./axis";
import { Chart, drawing, legendRow, look } from "./chart";
import type { Page } from "./dom";
import type { Errors, FitReport, Histogram, Point } from "./fit_data";
import { fixed, grouped, isKnown, real, short, signed, significant } from "./number";
import { columns } from "./table";

export const CORRIDOR_PERCENT = 8;
const WORST_SITES = 10;

// ---- histogram

function histogramFigure(h: Histogram, total: number): SVGElement {
  const bars = h.count.map((count) => (100 * count) / total);
  const shares = h.distributions.map((d) => d.share_per_bar.map((v) => 100 * real(v)));
  const tallest = Math.max(...bars);
  const top = Math.max(tallest, ...shares.map((share) => Math.min(1.6 * tallest, range(share, 0)[1])));
  const to = h.from_n + h.count.length * h.step_n;
  const svg = drawing(830, 390);
  const chart = new Chart(svg, { left: 62, top: 20, width: 740, height: 315, x: tightAxis("error, N", h.from_n, to, 12), y: axis("share of measurements per bar, %", 0, top, 6) });
  bars.forEach((bar, i) => {
    const from = h.from_n + i * h.step_n;
    if (bar) chart.box(from, from + h.step_n, 0, bar, { fill: "#cfd8de", stroke: "#8fa1ad", "stroke-width": 0.8 });
  });
  chart.upright(0, "zero");
  shares.forEach((share, i) => chart.line(share.map((_, k) => h.from_n + ((to - h.from_n) * k) / (share.length - 1)), share, look(i)));
  chart.legend(652, 36, h.distributions.map((d, i) => ({ ...look(i), kind: "line", text: d.name })));
  return svg;
}

function showHistogram(page: Page, into: HTMLElement, hist: Histogram, total: number): void {
  const outside = hist.outside ? ` ${grouped(hist.outside)} errors (${significant((100 * hist.outside) / total, 2)}\u00a0%) lie outside the drawn range.` : "";
  page.figure(into, histogramFigure(hist, total), {
    name: "histogram",
    title: "Distribution of the errors",
    caption: `Errors (model minus measurement) of ${grouped(total)} forces in bars of ${significant(hist.step_n, 1)}\u00a0N. Lines are distributions fitted to the errors themselves, not to the bars. Bars far from the middle that stand above the normal line are large errors that a normal distribution would not expect.${outside}`,
  });
  const best = range(hist.distributions.map((d) => real(d.aic)))[0];
  if (!hist.distributions.length) return;
  page.table(into, {
    caption: "Distributions fitted to the errors by maximum likelihood. Scale: standard deviation of the normal, mean distance from the centre of the Laplace, scale of the t. The lower the AIC, the better the description.",
    columns: columns("<Distribution", "Centre, N", "Scale, N", "Degrees of freedom", "Log-likelihood", "AIC", "AIC above best"),
    rows: hist.distributions.map((d) => ({
      strong: d.aic === best,
      cells: [d.name, fixed(d.centre_n, 4), fixed(d.scale_n, 4), d.freedom === undefined ? "" : significant(d.freedom, 3), fixed(d.log_likelihood, 1), fixed(d.aic, 1), fixed(real(d.aic) - best, 1)],
    })),
  });
}

// ---- relative error by depth

function depthFigure(report: FitReport): SVGElement {
  const { depths, bin_mm } = report.errors!;
  const deepest = (depths.length - 0.5) * bin_mm;
  const shown = depths.slice(1).flatMap((d) => d.probes.flatMap((p) => (p ? [p.low_percent, p.high_percent, p.bias_percent] : [])));
  const [least, most] = range(shown.map((v) => Math.max(-100, Math.min(150, real(v)))), -12, 12);
  const svg = drawing(830, 30 + 292 * report.probes.length);
  report.probes.forEach((name, p) => {
    const last = p === report.probes.length - 1;
    const chart = new Chart(svg, { left: 62, top: 28 + 292 * p, width: 740, height: 230, title: `probe ${name}`, x: tightAxis(last ? "penetration, mm" : "", 0, deepest, 16), y: axis("error over force, %", least, most, 7) });
    chart.box(0, deepest, -CORRIDOR_PERCENT, CORRIDOR_PERCENT, { fill: "#f0efe6" });
    for (const edge of [CORRIDOR_PERCENT, -CORRIDOR_PERCENT]) chart.across(edge, "dash");
    chart.across(0, "zero");
    const bins = depths.slice(1).filter((d) => d.probes[p]);
    const mine = { colour: look(p).colour, mark: p };
    for (const d of bins) {
      const e = d.probes[p]!;
      chart.box(d.depth_mm - 0.3 * bin_mm, d.depth_mm + 0.3 * bin_mm, real(e.low_percent), real(e.high_percent), { fill: mine.colour, "fill-opacity": 0.25 });
    }
    const [x, y] = [bins.map((d) => d.depth_mm), bins.map((d) => real(d.probes[p]!.bias_percent))];
    chart.line(x, y, mine).marks(x, y, mine);
  });
  return svg;
}

// ---- error against force

/** Medians of groups of equal size, ordered by the model's force; none for fewer than four measurements in each. */
function runningMedian(points: Point[], groups = 12): { x: number[]; y: number[] } {
  const sorted = points.map((p) => ({ force: p.model_n, error: p.model_n - p.force_n })).sort((a, b) => a.force - b.force || a.error - b.error);
  const out = { x: [] as number[], y: [] as number[] };
  for (let g = 0; g < groups && sorted.length >= 4 * groups; ++g) {
    const group = sorted.slice(Math.floor((g * sorted.length) / groups), Math.floor(((g + 1) * sorted.length) / groups));
    const errors = group.map((p) => p.error).sort((a, b) => a - b);
    out.x.push(group.reduce((sum, p) => sum + p.force, 0) / group.length);
    out.y.push((errors[Math.floor((errors.length - 1) / 2)]! + errors[Math.floor(errors.length / 2)]!) / 2);
  }
  return out;
}

function residualFigure(report: FitReport, points: Point[]): SVGElement {
  const known = points.filter((p) => Number.isFinite(p.model_n));
  const svg = drawing(830, 420);
  const [least, most] = range(known.map((p) => p.model_n - p.force_n), 0);
  const chart = new Chart(svg, { left: 62, top: 40, width: 740, height: 325, x: axis("force of the model, N", 0, range(known.map((p) => p.model_n), 0)[1], 10), y: axis("error, N", least, most, 7) });
  chart.across(0, "zero");
  const ofProbe = report.probes.map((_, probe) => known.filter((p) => p.probe === probe));
  ofProbe.forEach((list, p) => chart.dots(list.map((q) => q.model_n), list.map((q) => q.model_n - q.force_n), { colour: look(p).colour, mark: p }));
  ofProbe.forEach((list, p) => {
    const { x, y } = runningMedian(list);
    chart.line(x, y, { colour: "#fff", width: 5 }).line(x, y, { ...look(p), width: 2.6 });
  });
  legendRow(svg, 62, 22, report.probes.map((name, p) => ({ ...look(p), width: 2.6, kind: "line", text: `probe ${name}, median` })));
  return svg;
}

export function fitErrors(page: Page, report: FitReport, points: Point[]): void {
  const errors = report.errors;
  if (!errors?.all) return;
  const section = page.section("errors", "Errors");
  if (errors.histogram) showHistogram(page, section, errors.histogram, errors.all.count);
  page.figure(section, depthFigure(report), {
    name: "depth",
    title: "Relative error by depth",
    caption: "Marks: summed errors over summed forces at each depth, which is the bias there; positive means that the model is too stiff. Boxes hold the middle half of the single relative errors. Dashed lines mark \u00b18\u00a0%. Forces at small depths are small, so that a few hundredths of a newton weigh much here and little in the mean error.",
  });
  page.figure(section, residualFigure(report, points), {
    name: "residuals",
    title: "Error against the model's force",
    caption: "One dot per measurement; lines are medians of groups of equal size. A line that leaves zero is an error of the model's shape rather than scatter; dots that fan out to the right are errors that grow with the force.",
  });
}

// ---- tables

const MEASURES = ["n", "MAE, N", "SD, N", "SD |e|, N", "RMSE, N", "bias, N", "median", "95th %", "max", "% of mean", "% of range", "% of max"];
const measures = (e: Errors): string[] => [
  grouped(e.count),
  ...[e.mae_n, e.sd_n, e.sd_abs_n, e.rmse_n, e.bias_n, e.median_abs_n, e.p95_abs_n, e.max_abs_n].map((v) => fixed(v, 3)),
  ...[e.percent_of_mean, e.percent_of_range, e.percent_of_largest].map((v) => fixed(v, 2)),
];

export function fitErrorTables(page: Page, report: FitReport): void {
  const errors = report.errors;
  if (!errors?.all) return;
  const section = page.section("tables", "Error tables");
  const probes = report.probes.flatMap((name, p) => (errors.probes[p] ? [{ cells: [name, ...measures(errors.probes[p]!)] }] : []));
  const all = { strong: true, cells: ["all", ...measures(errors.all)] };
  page.table(section, {
    caption: "Errors by probe. e = model \u2212 measurement; MAE: mean |e|; SD: standard deviation of e; SD |e|: the same of |e|; median, 95th percentile and maximum of |e| in N; the last three columns: MAE as a share of the mean, of the range and of the largest measured force.",
    columns: columns("<Probe", ...MEASURES),
    rows: report.probes.length > 1 ? [...probes, all] : probes,
  });
  page.table(section, {
    caption: "Errors by depth. %: MAE over the mean force at that depth; bias: summed errors over summed forces.",
    groups: [{ head: "", span: 1 }, ...report.probes.map((head) => ({ head, span: 6 }))],
    columns: columns("Depth, mm", ...report.probes.flatMap(() => ["n", "mean, N", "MAE, N", "SD, N", "%", "bias, %"])),
    rows: errors.depths
      .filter((d) => d.probes.some(Boolean))
      .map((d) => ({
        cells: [short(d.depth_mm), ...d.probes.flatMap((e) => (e ? [grouped(e.count), fixed(e.mean_n, 2), fixed(e.mae_n, 3), fixed(e.sd_n, 3), fixed(e.percent_of_mean, 1), signed(e.bias_percent, 1)] : Array<string>(6).fill("")))],
      })),
  });
  const worst = errors.sites.filter((e) => isKnown(e.percent_of_mean)).sort((a, b) => real(b.percent_of_mean) - real(a.percent_of_mean) || a.site - b.site);
  page.table(section, {
    caption: worst.length > WORST_SITES ? `The ten sites of ${worst.length} with the largest MAE over their mean force; columns as above.` : `Errors at the ${worst.length} sites; columns as above.`,
    columns: columns("<Site", ...MEASURES),
    rows: worst.slice(0, WORST_SITES).map((e) => ({ cells: [String(e.site), ...measures(e)] })),
  });
}
