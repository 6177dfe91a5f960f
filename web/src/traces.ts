// Force and vein area over the last seconds, side by side in time: what pressing does to the vein.

import uPlot from "uplot";
import { find, nameDrawing } from "./dom";
import type { Snapshot } from "./protocol";
import { ink, onTheme } from "./theme";
import { decimal, t } from "./words/language";

const SPAN_S = 15;
const REDRAW_S = 0.1;
const JUMP_S = 3; // a step of time larger than this, or back, starts the curve anew

export class Traces {
  private times: number[] = [];
  private forces: number[] = [];
  private veins: (number | null)[] = [];
  private vessels = true;
  private top_n = 10;
  private drawn_s = 0;
  private readonly plot: uPlot;
  private readonly box = find("traces");

  constructor() {
    this.plot = new uPlot(this.options(), [[], [], []], this.box);
    nameDrawing(this.box, t("traces.name"));
    new ResizeObserver(() => this.resize()).observe(this.box);
    onTheme(() => this.plot.redraw());
    this.resize();
  }

  private resize(): void {
    if (this.box.clientWidth === 0) return;
    this.plot.setSize({ width: Math.max(160, this.box.clientWidth), height: Math.max(60, this.box.clientHeight) });
  }

  private options(): uPlot.Options {
    const font = "11px system-ui, sans-serif";
    const axis = { stroke: () => ink("muted"), font, grid: { stroke: () => ink("grid"), width: 1 }, ticks: { show: false } };
    const last = (unit: string) => (_u: uPlot, ticks: number[]): string[] => ticks.map((t, i) => decimal(i === ticks.length - 1 ? `${t} ${unit}` : `${t}`));
    const range = (): [number, number] => {
      const now = this.times[this.times.length - 1] ?? 0;
      return [now - SPAN_S, now];
    };
    return {
      width: 300,
      height: 120,
      legend: { show: false },
      cursor: { show: false },
      padding: [8, 16, 0, 0],
      scales: { x: { time: false, range }, n: { range: () => [0, this.top_n] }, vein: { range: () => [0, 120] } },
      axes: [
        { ...axis, size: 22, gap: 2, align: 2, splits: () => [0, 3, 6, 9, 12].map((s) => range()[1] - s).reverse(),
          values: (_u, ticks) => ticks.map((at) => { const ago = Math.round(range()[1] - at); return ago === 0 ? t("plot.now") : `${ago} s`; }) },
        { ...axis, scale: "n", size: 38, gap: 4, stroke: () => ink("accent"), values: last("N") },
        { ...axis, scale: "vein", side: 1, size: 44, gap: 4, stroke: () => ink("vein"), grid: { show: false }, splits: [0, 50, 100], values: last("%") },
      ],
      series: [
        {},
        { scale: "n", stroke: () => ink("accent"), width: 2, points: { show: false } },
        { scale: "vein", stroke: () => ink("vein"), width: 2, dash: [7, 4], points: { show: false }, spanGaps: false },
      ],
    };
  }

  /** There is a curve to look at. */
  get drawn(): boolean {
    return this.times.length > 2;
  }

  showVessels(on: boolean): void {
    if (this.vessels === on) return;
    this.vessels = on;
    this.plot.setSeries(2, { show: on });
    this.plot.axes[2]!.show = on;
    this.plot.redraw(true, true);
  }

  add(s: Snapshot): void {
    const last = this.times[this.times.length - 1];
    if (last !== undefined && (s.time_s < last || s.time_s > last + JUMP_S)) this.clear();
    this.times.push(s.time_s);
    this.forces.push(Math.max(0, s.force_normal_n));
    this.veins.push(Number.isNaN(s.vein_area_ratio) || !(s.contact_area_mm2 > 0) ? null : Math.min(120, 100 * s.vein_area_ratio));
    while (this.times[0]! < s.time_s - SPAN_S) for (const list of [this.times, this.forces, this.veins]) list.shift();
    if (s.time_s - this.drawn_s < REDRAW_S || this.box.clientWidth === 0) return;
    this.drawn_s = s.time_s;
    this.top_n = Math.max(10, 10 * Math.ceil((Math.max(...this.forces) + 1) / 10));
    this.plot.setData([this.times, this.forces, this.veins]);
  }

  clear(): void {
    this.times = [];
    this.forces = [];
    this.veins = [];
    this.drawn_s = 0;
  }
}
