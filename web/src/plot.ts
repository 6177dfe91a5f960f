// Force against penetration: what the probe does now, beside what was measured at the nearest site.

import uPlot from "uplot";
import { nameDrawing } from "./dom";
import { ink, onTheme } from "./theme";
import { decimal, t } from "./words/language";

const TRACE_POINTS = 900;
const MOST = { mm: 50, n: 60 }; // a point beyond stays at the edge

export interface Curve {
  penetration_mm: number[];
  force_n: number[];
}

export class ForcePlot {
  private readonly plot: uPlot;
  private readonly trace: [number, number][] = [];
  private topX = 30;
  private topY = 30;

  constructor(private readonly box: HTMLElement) {
    this.plot = new uPlot(this.options(), [[0], [0]], box);
    nameDrawing(box, t("plot.name"));
    new ResizeObserver(() => this.resize()).observe(box);
    onTheme(() => this.plot.redraw());
    this.resize();
  }

  private resize(): void {
    this.plot.setSize({ width: Math.max(200, this.box.clientWidth), height: Math.max(100, this.box.clientHeight) });
  }

  private options(): uPlot.Options {
    const font = "11px system-ui, sans-serif";
    const axis = { stroke: () => ink("muted"), font, labelFont: font, grid: { stroke: () => ink("grid"), width: 1 }, ticks: { show: false } };
    return {
      width: 300,
      height: 150,
      legend: { show: false },
      cursor: { show: false },
      padding: [8, 20, 0, 0],
      scales: {
        x: { time: false, range: () => [0, this.topX] },
        y: { range: () => [0, this.topY] },
      },
      axes: [
        { ...axis, size: 26, gap: 2, values: (_u, ticks) => ticks.map((t, i) => (i === ticks.length - 1 ? `${t} mm` : `${t}`)) },
        { ...axis, size: 40, gap: 4, values: (_u, ticks) => ticks.map((t, i) => decimal(i === ticks.length - 1 ? `${t} N` : `${t}`)) },
      ],
      series: [
        {},
        {
          stroke: () => ink("measured"),
          width: 1.25,
          dash: [3, 4],
          points: { show: true, size: 5, width: 0, fill: () => ink("measured") },
        },
      ],
      hooks: { draw: [(u) => this.drawTrace(u)] },
    };
  }

  private drawTrace(u: uPlot): void {
    const c = u.ctx;
    const last = this.trace[this.trace.length - 1];
    if (!last) return;
    const x = (p: [number, number]): number => u.valToPos(p[0], "x", true);
    const y = (p: [number, number]): number => u.valToPos(p[1], "y", true);
    c.save();
    c.beginPath();
    c.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    c.clip();
    c.strokeStyle = ink("accent");
    c.lineWidth = 2 * devicePixelRatio;
    c.lineJoin = "round";
    const chunk = 60; // older pieces are fainter
    for (let i = 0; i < this.trace.length - 1; i += chunk) {
      const age = 1 - (i + chunk) / this.trace.length;
      c.globalAlpha = Math.max(0.12, 1 - 1.3 * Math.max(0, age));
      c.beginPath();
      this.trace.slice(i, i + chunk + 1).forEach((p, k) => (k ? c.lineTo(x(p), y(p)) : c.moveTo(x(p), y(p))));
      c.stroke();
    }
    c.restore();
    c.fillStyle = ink("bright");
    c.beginPath();
    c.arc(Math.max(u.bbox.left, x(last)), Math.max(u.bbox.top, y(last)), 4.5 * devicePixelRatio, 0, 2 * Math.PI);
    c.fill();
  }

  /** Forgets the live trace: another probe, another place. */
  clear(): void {
    this.trace.length = 0;
  }

  add(penetration_mm: number, force_n: number): void {
    const last = this.trace[this.trace.length - 1];
    const moved = !last || Math.hypot(last[0] - penetration_mm, last[1] - force_n) > 0.05;
    if (moved) this.trace.push([penetration_mm, force_n]);
    else this.trace[this.trace.length - 1] = [penetration_mm, force_n];
    if (this.trace.length > TRACE_POINTS) this.trace.shift();
    if (!moved) return;
    if (this.fit(penetration_mm, force_n)) this.plot.setData(this.plot.data, true);
    else this.plot.redraw(false, false);
  }

  /** Makes room for a point; true when the axes changed. */
  private fit(x: number, y: number): boolean {
    const [oldX, oldY] = [this.topX, this.topY];
    this.topX = Math.min(MOST.mm, Math.max(oldX, 5 * Math.ceil((x + 1) / 5)));
    this.topY = Math.min(MOST.n, Math.max(oldY, 10 * Math.ceil((y + 1) / 10)));
    return this.topX !== oldX || this.topY !== oldY;
  }

  measured(curve: Curve): void {
    this.topX = 30;
    this.topY = 10;
    this.fit(Math.max(0, ...curve.penetration_mm), Math.max(0, ...curve.force_n));
    for (const p of this.trace) this.fit(p[0], p[1]);
    const none = curve.force_n.length === 0;
    this.plot.setData([[0, ...curve.penetration_mm], [none ? null : 0, ...curve.force_n]], true);
  }
}
