// The drawings of an exam: the vein along its length with every press, force and vein over time, scores exam by exam.

import { axis, range, tightAxis } from "./axis";
import { Chart, drawing, text, textWidth } from "./chart";
import { s } from "./dom";
import { COLOURS, type Exam, type Press, RESULTS, type Result, WORDS } from "./exam_data";
import { fixed, isKnown, real } from "./number";
import { t } from "../words/language";

const WIDTH = 900;
const LEFT = 58;
const RIGHT = 16;

// Filled circle, ring, triangle down, filled triangle up, diamond.
const SHAPES: Record<Result, string> = {
  complete: "m-4.2 0a4.2 4.2 0 1 0 8.4 0a4.2 4.2 0 1 0-8.4 0z",
  open: "m-3.8 0a3.8 3.8 0 1 0 7.6 0a3.8 3.8 0 1 0-7.6 0z",
  insufficient: "m-4.6-3.2h9.2l-4.6 7.6z",
  too_hard: "m-4.8 3.4h9.6l-4.8-8z",
  off_axis: "m0-5l4.6 5l-4.6 5l-4.6-5z",
};

/** The mark of a press: shape and colour tell its result. */
export function pressMark(x: number, y: number, result: Result): SVGElement {
  const filled = result === "complete" || result === "too_hard";
  const colour = COLOURS[result];
  return s("path", { d: `M${x.toFixed(1)} ${y.toFixed(1)}${SHAPES[result]}`, fill: filled ? colour : "#fff", stroke: filled ? "#fff" : colour, "stroke-width": filled ? 0.8 : 1.8 });
}

const inWords = (p: Press, number: number): SVGElement => s("title", {}, t("report.draw.press", { n: number, result: WORDS[p.result], force: fixed(p.force_peak_n, 1) }));

// ---- the vein

const COVERED = "#9fd8c3";
const MISSED = "#fbd9b5";
const UNPLANNED = "#edf0f3";
const CLOT = "#7b1e3a";
const LIMIT = "#c2410c";

function legend(into: SVGElement, y: number, clot: boolean): void {
  let x = LEFT;
  for (const result of RESULTS) {
    into.append(pressMark(x + 6, y - 4, result), text(x + 16, y, "tick", WORDS[result]));
    x += 16 + textWidth(WORDS[result]) + 20;
  }
  x = LEFT;
  y += 20;
  const keys: [string, string][] = [[COVERED, t("report.draw.examined")], [MISSED, t("report.draw.missed")], [UNPLANNED, t("report.draw.unplanned")]];
  if (clot) keys.push([CLOT, t("report.draw.clot")]);
  for (const [fill, words] of keys) {
    into.append(s("rect", { x, y: y - 9, width: 18, height: 10, fill, stroke: "#8b97a1", "stroke-width": 0.6 }), text(x + 24, y, "tick", words));
    x += 24 + textWidth(words) + 20;
  }
  into.append(place(x + 6, y - 4, true), place(x + 18, y - 4, false), text(x + 28, y, "tick", t("report.draw.place")));
}

const place = (cx: number, cy: number, done: boolean): SVGElement => s("circle", { cx, cy, r: 4, fill: done ? "#1b2126" : "#fff", stroke: "#1b2126", "stroke-width": 1.4 });

export function drawVein(data: Exam): SVGSVGElement {
  const [top, height, plotTop, plotHeight] = [46, 26, 142, 150];
  const { vein } = data;
  const bottom = top + height;
  const x = (mm: number): number => LEFT + (WIDTH - LEFT - RIGHT) * Math.min(1, Math.max(0, mm / vein.length_mm));
  const svg = drawing(WIDTH, plotTop + plotHeight + 92);
  const bar = (from: number, to: number, fill: string): void => svg.append(s("rect", { x: x(from), y: top, width: x(to) - x(from), height, fill }));

  // The vein from the groin to the knee: what was planned, what was examined, what is there.
  bar(0, vein.length_mm, UNPLANNED);
  for (const [from, to] of vein.planned) bar(from, to, MISSED);
  for (const [from, to] of vein.examined) bar(from, to, COVERED);
  if (vein.clot) {
    const [from, to] = vein.clot.map(x) as [number, number];
    svg.append(s("rect", { x: from, y: top + 6, width: to - from, height: height - 12, rx: 5, fill: CLOT }));
    if (to - from > 40) svg.append(text((from + to) / 2, top + 17, "middle light small", t("report.draw.clot_mark")));
  }
  svg.append(s("rect", { x: x(0), y: top, width: x(vein.length_mm) - x(0), height, fill: "none", stroke: "#5b6670", "stroke-width": 1.2 }));
  svg.append(text(LEFT - 8, top + 17, "end", t("report.draw.groin")), text(WIDTH - RIGHT, top - 6, "end", t("report.draw.knee")));
  vein.segments.forEach((segment, i) => {
    const [from, to] = segment.mm.map(x) as [number, number];
    const full = `${i + 1}  ${segment.title}`;
    const fits = textWidth(full, 12) <= to - from - 8;
    svg.append(s("text", { x: (from + to) / 2, y: 32, class: "middle", "font-weight": 600 }, fits ? full : String(i + 1), s("title", {}, segment.title)));
    if (i) svg.append(s("line", { x1: from, x2: from, y1: 22, y2: bottom + 4, stroke: "#8b97a1" }));
  });
  for (const p of data.places) {
    const mark = place(x(p.along_mm), bottom + 11, p.done);
    mark.append(s("title", {}, p.title));
    svg.append(mark);
  }
  if (vein.gap && vein.gap[1] - vein.gap[0] >= 5) {
    const [from, to] = vein.gap.map(x) as [number, number];
    const words = t("report.draw.gap", { cm: fixed((vein.gap[1] - vein.gap[0]) / 10, 1) });
    const half = textWidth(words, 12) / 2;
    const y = bottom + 26;
    svg.append(s("path", { d: `M${from} ${y}H${to}M${from} ${y - 4}v8M${to} ${y - 4}v8`, stroke: LIMIT, "stroke-width": 1.4 }));
    svg.append(s("text", { x: Math.min(WIDTH - RIGHT - half, Math.max(LEFT + half, (from + to) / 2)), y: y + 16, class: "middle", style: "fill:#9a3412" }, words));
  }

  // Every press by its place and its greatest force, beside the force of each place.
  const forces = [...data.places.map((p) => 1.15 * real(p.limit_n)), ...data.presses.map((p) => p.force_peak_n)];
  const [, most] = range(forces, 0);
  const chart = new Chart(svg, {
    left: LEFT, top: plotTop, width: WIDTH - LEFT - RIGHT, height: plotHeight,
    x: tightAxis(t("report.draw.along"), 0, vein.length_mm / 10, 10),
    y: axis(t("report.force_n"), 0, most || 10, 5),
  });
  for (const p of data.places) {
    const [from, to] = [(p.along_mm - vein.reach_mm) / 10, (p.along_mm + vein.reach_mm) / 10];
    chart.box(from, to, real(p.firm_n), real(p.limit_n), { fill: "#d9f0e6" });
    chart.line([from, to], [real(p.limit_n), real(p.limit_n)], { colour: LIMIT, width: 1.6 });
  }
  for (const segment of vein.segments.slice(1)) chart.line([segment.mm[0] / 10, segment.mm[0] / 10], [0, chart.plot.y.high], { colour: "#c5ccd2", width: 1 });
  data.presses.forEach((p, i) => {
    const along = real(p.along_mm) / 10;
    if (!chart.holds(along, p.force_peak_n)) return;
    const mark = pressMark(chart.x(along), chart.y(p.force_peak_n), p.result);
    mark.append(inWords(p, i + 1));
    svg.append(s("a", { href: `#press-${i + 1}` }, mark));
  });
  legend(svg, plotTop + plotHeight + 60, Boolean(vein.clot));
  return svg;
}

// ---- force and vein over time

export function drawTraces(data: Exam): SVGSVGElement {
  const times = data.traces.time_s;
  const [first, last] = [times[0]!, times[times.length - 1]!];
  const unit = last - first > 180 ? 60 : 1;
  const svg = drawing(WIDTH, 362);
  const across = { left: LEFT, width: WIDTH - LEFT - RIGHT };
  const time = (label: string) => tightAxis(label, first / unit, last / unit, 10);
  const forces = data.traces.force_n.map(real);
  const areas = data.traces.vein.map((v) => 100 * real(v));
  const [, most] = range([...forces, ...data.places.map((p) => 1.1 * real(p.limit_n))], 1);
  const [, widest] = range(areas, 100);
  const force = new Chart(svg, { ...across, top: 26, height: 130, title: t("report.draw.force"), x: time(""), y: axis("N", 0, most, 4) });
  const vein = new Chart(svg, { ...across, top: 216, height: 100, title: t("report.draw.area"), x: time(unit === 60 ? t("report.draw.minutes") : t("report.draw.seconds")), y: axis(t("report.draw.of_rest"), 0, widest, 5) });
  const at = times.map((t) => t / unit);
  data.presses.forEach((p) => {
    const span: [number, number] = [p.start_s / unit, p.end_s / unit];
    for (const chart of [force, vein]) chart.box(...span, 0, chart.plot.y.high, { fill: COLOURS[p.result], "fill-opacity": 0.16 });
    if (isKnown(p.limit_n)) force.line(span, [p.limit_n, p.limit_n], { colour: LIMIT, width: 1.6 });
  });
  force.line(at, forces, { colour: "#1b2126" });
  vein.line(at, areas, { colour: "#0b5cad" });
  return svg;
}

// ---- scores

export function drawScores(data: Exam): SVGSVGElement {
  const shown = data.curve.slice(-200);
  const numbers = shown.map((p) => p.number);
  const svg = drawing(WIDTH, 190);
  const [first, last] = [numbers[0]!, numbers[numbers.length - 1]!];
  const x = tightAxis(t("report.draw.exam"), first - 0.5, last + 0.5, 12);
  if (shown.length <= 20) [x.step, x.ticks] = [1, numbers];
  const chart = new Chart(svg, { left: LEFT, top: 14, width: WIDTH - LEFT - RIGHT, height: 130, x, y: axis(t("report.draw.score"), 0, 100, 5) });
  chart.line(numbers, shown.map((p) => p.median), { colour: "#0b5cad", opacity: 0.55 });
  for (const p of shown) {
    const now = p.number === last && !data.interrupted;
    const [cx, cy] = [chart.x(p.number), chart.y(p.score)];
    const colour = p.passed ? "#00795a" : "#b3261e";
    svg.append(s("circle", { cx, cy, r: now ? 6 : 4, fill: p.passed ? colour : "#fff", stroke: colour, "stroke-width": 1.8 }, s("title", {}, t("report.draw.exam_points", { n: p.number, score: fixed(p.score, 0) }))));
    if (now) svg.append(s("circle", { cx, cy, r: 10, fill: "none", stroke: "#1b2126", "stroke-width": 1.2 }));
  }
  return svg;
}
