// Force curves: per probe, sites spread over the measured area, measured and modelled force against penetration.

import { axis, range } from "./axis";
import { Chart, drawing, text, legendEntry } from "./chart";
import { sequential } from "./colour";
import type { Page } from "./dom";
import type { FitReport, Point, Site } from "./fit_data";
import { real } from "./number";

const CURVES = 11;

interface Curve {
  site: number;
  points: Point[]; // by depth
}

const distance = (a: Site, b: Site): number => {
  const d = Math.hypot(...[0, 1, 2].map((k) => real(a.position_mm[k]) - real(b.position_mm[k])));
  return Number.isFinite(d) ? d : 0;
};

/** The first of the sites, then always the one farthest from those chosen. */
function spread(sites: Site[]): Site[] {
  const chosen = sites.slice(0, 1);
  while (chosen.length < Math.min(CURVES, sites.length)) {
    const rest = sites.filter((site) => !chosen.includes(site));
    const away = rest.map((site) => Math.min(...chosen.map((other) => distance(site, other))));
    chosen.push(rest[away.indexOf(Math.max(...away))]!);
  }
  return chosen;
}

/** Measured force at a depth, linear between the points and from the origin. */
function forceAt(curve: Curve, depth_mm: number): number {
  let before = { depth_mm: 0, force_n: 0 };
  for (const p of curve.points) {
    if (p.depth_mm >= depth_mm && p.depth_mm > before.depth_mm) {
      const t = (depth_mm - before.depth_mm) / (p.depth_mm - before.depth_mm);
      return (1 - t) * before.force_n + t * p.force_n;
    }
    before = p;
  }
  return before.force_n;
}

function curvesOf(report: FitReport, points: Point[], probe: number): Curve[] {
  const ofProbe = points.filter((p) => p.probe === probe);
  const measured = new Set(ofProbe.map((p) => p.site));
  const curves = spread(report.sites.filter((site) => measured.has(site.id))).map((site) => ({
    site: site.id,
    points: ofProbe.filter((p) => p.site === site.id).sort((a, b) => a.depth_mm - b.depth_mm),
  }));
  const common_mm = Math.min(...curves.map((c) => c.points[c.points.length - 1]!.depth_mm));
  return curves.sort((a, b) => forceAt(b, common_mm) - forceAt(a, common_mm) || a.site - b.site);
}

function draw(curves: Curve[], hasModel: boolean, hasBand: boolean): SVGElement {
  const all = curves.flatMap((c) => c.points);
  const deepest = range(all.map((p) => p.depth_mm), 0)[1];
  const most = range(all.flatMap((p) => [p.force_n, Math.min(p.model_n, 2 * p.force_n)]), 0)[1];
  const svg = drawing(830, 470);
  const chart = new Chart(svg, { left: 62, top: 22, width: 590, height: 390, x: axis("penetration, mm", 0, deepest, 10), y: axis("force, N", 0, most) });
  // Colours by rank keep clear of the lightest end, which is lost on white.
  const colour = (rank: number): string => sequential(curves.length > 1 ? (0.82 * rank) / (curves.length - 1) : 0);
  [...curves.keys()].reverse().forEach((i) => {
    const c = curves[i]!;
    const model = c.points.filter((p) => p.depth_mm > 0);
    const look = { colour: colour(i), mark: i % 4 };
    const x = [0, ...model.map((p) => p.depth_mm)];
    chart.band(x, [0, ...model.map((p) => p.model_n - p.band_n)], [0, ...model.map((p) => p.model_n + p.band_n)], look);
    chart.line(x, [0, ...model.map((p) => p.model_n)], look);
    chart.marks(c.points.map((p) => p.depth_mm), c.points.map((p) => p.force_n), look);
  });
  const [x, y] = [670, 36];
  svg.append(text(x, y, "head", "Sites, stiffest first"));
  curves.forEach((c, i) => legendEntry(svg, x, y + 22 + 19 * i, { kind: hasModel ? "both" : "mark", colour: colour(i), mark: i % 4, text: `site ${c.site}` }));
  const foot = y + 36 + 19 * curves.length;
  legendEntry(svg, x, foot, { kind: "mark", text: "measured" });
  if (hasModel) legendEntry(svg, x, foot + 19, { kind: "line", text: "model" });
  if (hasBand) legendEntry(svg, x, foot + 38, { kind: "box", text: "95 % band" });
  return svg;
}

export function fitCurves(page: Page, report: FitReport, points: Point[]): void {
  if (!points.length) return;
  const section = page.section("curves", "Force curves");
  const [hasModel, hasBand] = [report.rows?.model_n !== undefined, report.rows?.band_n !== undefined];
  report.probes.forEach((name, probe) => {
    const curves = curvesOf(report, points, probe);
    if (!curves.length) return;
    const words = `${curves.length} of ${report.sites.length} sites, spread over the measured area. Marks are measured${hasModel ? ", lines are the model" : ""}${hasBand ? ", the shaded band should hold 95\u00a0% of new measurements" : ""}. Colours run from stiff (dark) to soft. A curve that bends upwards says that the tissue stiffens as it is compressed; how far the curves lie apart shows how much the thigh differs from place to place.`;
    page.figure(section, draw(curves, hasModel, hasBand), { name: `curves-${probe + 1}`, title: `Force against penetration, probe ${name}`, caption: words });
  });
}
