// Charts as inline SVG: axes with units, lines, points, error bars, bands, bars and legends. Values that are not
// finite or lie outside the axes are left out; lines and bands are cut off at the axes. Series differ in colour, dash
// and mark, so that they can be told apart in grey and by colour-blind readers.

import { type Axis, tickLabel } from "./axis";
import { type Child, s } from "./dom";

/** Okabe and Ito. */
export const PALETTE = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#777777"] as const;
const DASHES = ["", "7 3", "2 3", "9 3 2 3", "12 4", "4 2", "1 3", "6 2 1 2"] as const;
const MARKS = [
  "m-2.6 0a2.6 2.6 0 1 0 5.2 0a2.6 2.6 0 1 0-5.2 0z", // circle
  "m-2.4-2.4h4.8v4.8h-4.8z", // square
  "m0-3.2l3 5.4h-6z", // triangle
  "m0-3.4l3.2 3.4l-3.2 3.4l-3.2-3.4z", // diamond
] as const;

export interface Look {
  colour?: string;
  dash?: string;
  width?: number;
  mark?: number;
  opacity?: number;
}

/** Colour, dash and mark of the series with this number. */
export const look = (index: number): Required<Pick<Look, "colour" | "dash" | "mark">> => ({
  colour: PALETTE[index % PALETTE.length]!,
  dash: DASHES[index % DASHES.length]!,
  mark: index % MARKS.length,
});

export interface Sample extends Look {
  text: string;
  kind: "line" | "mark" | "both" | "box";
}

/** Width of a text in pixels, about. */
export const textWidth = (text: string, size = 11): number => 0.56 * size * [...text].length;

export const text = (x: number, y: number, look: string, words: string): SVGElement => s("text", { x, y, class: look || undefined }, words);

function shape(x: number, y: number, index: number, colour: string): SVGElement {
  return s("path", { d: `M${x.toFixed(1)} ${y.toFixed(1)}${MARKS[index % MARKS.length]}`, class: "mark", stroke: colour });
}

/** A sample of what is drawn and its name; returns the width that it took. */
export function legendEntry(into: SVGElement, x: number, y: number, e: Sample): number {
  const colour = e.colour ?? "#444";
  if (e.kind === "box") into.append(s("rect", { x, y: y - 9, width: 22, height: 10, fill: colour, "fill-opacity": e.opacity ?? 0.35 }));
  if (e.kind === "line" || e.kind === "both")
    into.append(s("line", { x1: x, x2: x + 22, y1: y - 4, y2: y - 4, stroke: colour, "stroke-width": e.width ?? 1.8, "stroke-dasharray": e.dash || undefined }));
  if (e.kind === "mark" || e.kind === "both") into.append(shape(x + 11, y - 4, e.mark ?? 0, colour));
  into.append(text(x + 28, y, "tick", e.text));
  return 28 + textWidth(e.text) + 18;
}

/** A drawing of this size in pixels. */
export const drawing = (width: number, height: number, ...children: Child[]): SVGSVGElement =>
  s("svg", { class: "fig", viewBox: `0 0 ${width} ${Math.ceil(height)}`, width, height: Math.ceil(height) }, ...children);

export interface Plot {
  left: number;
  top: number;
  width: number;
  height: number;
  x: Axis;
  y: Axis;
  title?: string;
}

let clips = 0;

/** A plot within a drawing: what is drawn on it is appended to `into`. */
export class Chart {
  private readonly inside: SVGElement; // cut off at the axes
  private readonly above = s("g"); // marks and words, not cut off

  constructor(into: SVGElement, readonly plot: Plot) {
    const { left, top, width, height } = plot;
    const name = `clip-${++clips}`;
    this.inside = s("g", { "clip-path": `url(#${name})` });
    into.append(s("clipPath", { id: name }, s("rect", { x: left, y: top, width, height })));
    this.frame(into);
    into.append(this.inside, this.above);
  }

  x(value: number): number {
    const { left, width, x } = this.plot;
    return left + (width * (value - x.low)) / (x.high - x.low);
  }

  y(value: number): number {
    const { top, height, y } = this.plot;
    return top + (height * (y.high - value)) / (y.high - y.low);
  }

  holds(x: number, y: number): boolean {
    const on = (a: Axis, v: number): boolean => Number.isFinite(v) && v >= a.low - 1e-6 * (a.high - a.low) && v <= a.high + 1e-6 * (a.high - a.low);
    return on(this.plot.x, x) && on(this.plot.y, y);
  }

  private frame(into: SVGElement): void {
    const { left, top, width, height, x, y, title } = this.plot;
    const [right, bottom] = [left + width, top + height];
    const line = (x1: number, y1: number, x2: number, y2: number, look: string): SVGElement => s("line", { x1, y1, x2, y2, class: look });
    for (const tick of x.ticks) {
      const at = this.x(tick);
      into.append(line(at, top, at, bottom, "grid"), line(at, bottom, at, bottom + 4, "axis"), text(at, bottom + 17, "tick middle", tickLabel(x, tick)));
    }
    for (const tick of y.ticks) {
      const at = this.y(tick);
      into.append(line(left, at, right, at, "grid"), line(left - 4, at, left, at, "axis"), text(left - 7, at + 4, "tick end", tickLabel(y, tick)));
    }
    into.append(line(left, bottom, right, bottom, "axis"), line(left, top, left, bottom, "axis"));
    if (title) into.append(text(left, top - 10, "head", title));
    if (x.label) into.append(text((left + right) / 2, bottom + 36, "middle", x.label));
    if (y.label) into.append(s("text", { transform: `translate(${left - 44} ${(top + bottom) / 2}) rotate(-90)`, class: "middle" }, y.label));
  }

  /** Pixels of points, bounded; a gap where a value is not finite. */
  private path(xs: ArrayLike<number>, ys: ArrayLike<number>): string {
    let [d, down] = ["", false];
    for (let i = 0; i < xs.length; ++i) {
      const [x, y] = [this.x(xs[i]!), this.y(ys[i]!)];
      const known = Number.isFinite(x) && Number.isFinite(y);
      const bounded = (v: number): string => Math.max(-1e5, Math.min(1e5, v)).toFixed(1);
      if (known) d += `${down ? "L" : "M"}${bounded(x)} ${bounded(y)}`;
      down = known;
    }
    return d;
  }

  line(xs: ArrayLike<number>, ys: ArrayLike<number>, l: Look = {}): this {
    this.inside.append(s("path", { d: this.path(xs, ys), class: "line", stroke: l.colour ?? PALETTE[0], "stroke-width": l.width ?? 1.7, "stroke-dasharray": l.dash || undefined, "stroke-opacity": l.opacity }));
    return this;
  }

  /** Between two curves. */
  band(xs: readonly number[], low: readonly number[], high: readonly number[], l: Look = {}): this {
    const keep = xs.map((_, i) => i).filter((i) => [xs[i], low[i], high[i]].every((v) => Number.isFinite(v)));
    const back = [...keep].reverse();
    const d = this.path([...keep, ...back].map((i) => xs[i]!), [...keep.map((i) => high[i]!), ...back.map((i) => low[i]!)]);
    if (d) this.inside.append(s("path", { d: `${d}Z`, fill: l.colour ?? PALETTE[0], "fill-opacity": l.opacity ?? 0.16 }));
    return this;
  }

  /** Many small dots as one path. */
  dots(xs: ArrayLike<number>, ys: ArrayLike<number>, l: Look = {}): this {
    let d = "";
    for (let i = 0; i < xs.length; ++i) if (this.holds(xs[i]!, ys[i]!)) d += `M${this.x(xs[i]!).toFixed(1)} ${this.y(ys[i]!).toFixed(1)}h0`;
    this.inside.append(s("path", { d, class: "dots", stroke: l.colour ?? PALETTE[0], "stroke-width": l.width ?? 3, "stroke-opacity": l.opacity ?? 0.55, "stroke-linecap": (l.mark ?? 0) % 2 ? "square" : "round" }));
    return this;
  }

  /** Hollow marks. */
  marks(xs: ArrayLike<number>, ys: ArrayLike<number>, l: Look = {}): this {
    for (let i = 0; i < xs.length; ++i)
      if (this.holds(xs[i]!, ys[i]!)) this.above.append(shape(this.x(xs[i]!), this.y(ys[i]!), l.mark ?? 0, l.colour ?? PALETTE[0]));
    return this;
  }

  /** An upright interval; what is open on one side goes on to the edge of the plot. */
  errorBar(x: number, low: number, high: number, l: Look = {}): this {
    if (!Number.isFinite(low) && !Number.isFinite(high)) return this;
    const { y } = this.plot;
    const [from, to] = [Number.isFinite(low) ? low : y.low, Number.isFinite(high) ? high : y.high];
    this.inside.append(s("line", { x1: this.x(x), x2: this.x(x), y1: this.y(from), y2: this.y(to), stroke: l.colour ?? PALETTE[0], "stroke-width": l.width ?? 1.6, "stroke-dasharray": l.dash || undefined }));
    return this;
  }

  /** A box between two values on each axis. */
  box(x0: number, x1: number, y0: number, y1: number, attributes: Record<string, string | number>): this {
    if (![x0, x1, y0, y1].every(Number.isFinite)) return this;
    const [a, b] = [this.x(Math.min(x0, x1)), this.x(Math.max(x0, x1))];
    const [c, d] = [this.y(Math.max(y0, y1)), this.y(Math.min(y0, y1))];
    this.inside.append(s("rect", { x: a, y: c, width: b - a, height: d - c, ...attributes }));
    return this;
  }

  across(y: number, look: string): this {
    const { left, width } = this.plot;
    this.inside.append(s("line", { x1: left, x2: left + width, y1: this.y(y), y2: this.y(y), class: look }));
    return this;
  }

  upright(x: number, look: string): this {
    const { top, height } = this.plot;
    this.inside.append(s("line", { x1: this.x(x), x2: this.x(x), y1: top, y2: top + height, class: look }));
    return this;
  }

  /** Entries below each other, the first at x, y. */
  legend(x: number, y: number, entries: Sample[]): this {
    entries.forEach((e, i) => legendEntry(this.above, x, y + 19 * i, e));
    return this;
  }
}

/** Entries side by side above a plot. */
export function legendRow(into: SVGElement, x: number, y: number, entries: Sample[]): void {
  for (const e of entries) x += legendEntry(into, x, y, e);
}
