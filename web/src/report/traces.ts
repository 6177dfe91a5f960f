// Long traces against a common axis, by uPlot: drag along the axis to look closer, double click to see all again.

import uPlot from "uplot";
import { h } from "./dom";
import { DASHES, PALETTE } from "./chart";
import { significant } from "./number";

export interface Trace {
  name: string;
  unit: string;
  /** as many as the axis has; a gap where there is none */
  values: (number | null)[];
}

export interface TraceOptions {
  /** ascending */
  x: number[];
  /** with its unit */
  xLabel: string;
  yLabel: string;
  traces: Trace[];
  height?: number;
  /** what a screen reader says */
  name: string;
}

const WIDTH = 850;

/** The plot; it keeps the width of the page on paper. */
export function traces(options: TraceOptions): HTMLElement {
  const box = h("div", { class: "traces", role: "img", "aria-label": options.name });
  const font = '11px "Helvetica Neue", Arial, "Liberation Sans", sans-serif';
  const axis = { stroke: "#444", font, labelFont: font, labelSize: 22, grid: { stroke: "#e4e4e4", width: 1 }, ticks: { stroke: "#555", width: 1, size: 4 } };
  const series = options.traces.map((t, i): uPlot.Series => ({
    label: `${t.name}, ${t.unit}`,
    stroke: PALETTE[i % PALETTE.length]!,
    dash: DASHES[i % DASHES.length]!.split(" ").filter(Boolean).map(Number),
    width: 1.5,
    value: (_u, v) => significant(v, 4),
  }));
  new uPlot(
    {
      width: WIDTH,
      height: options.height ?? 260,
      scales: { x: { time: false } },
      axes: [{ ...axis, label: options.xLabel, size: 32 }, { ...axis, label: options.yLabel, size: 46 }],
      series: [{ label: options.xLabel, value: (_u, v) => significant(v, 4) }, ...series],
    },
    [options.x, ...options.traces.map((t) => t.values)],
    box,
  );
  return box;
}
