// Calipers on an image: distances and elliptic areas in millimetres of the image, drawn over it as on
// a scanner. Placed by dragging or by two clicks; every point can be dragged or moved by arrow keys.

import { draw } from "./dom";
import { shown, t } from "./words/language";

export type Tool = "distance" | "area" | null;
type Point = [number, number]; // x from the image's left edge, depth below the probe, mm

interface Measure {
  kind: "distance" | "area";
  number: number;
  /** ends of the line, or of the ellipse's first axis */
  ends: [Point, Point];
  /** half of the ellipse's other axis */
  half_mm: number;
}

const MOST = 4;
const FIRST_HALF = 0.35; // of the first axis: how wide a new ellipse is
const CLICK_PX = 4;
const STEP_MM = 0.2;
const FAST_MM = 2;
const HIT_PX = 13;

const between = (a: Point, b: Point): number => Math.hypot(b[0] - a[0], b[1] - a[1]);

function sizeOf(m: Measure): number {
  const length = between(...m.ends);
  return m.kind === "distance" ? length : (Math.PI * length * m.half_mm) / 2;
}

function sentence(m: Measure): string {
  return m.kind === "distance" ? `${m.number}  ${shown(sizeOf(m), 1)} mm` : `${m.number}  ${sizeOf(m).toFixed(0)} mm²`;
}

export class Calipers {
  readonly svg = draw("svg", { class: "calipers" }) as SVGSVGElement;
  private list: Measure[] = [];
  private count = 0;
  private tool: Tool = null;
  private scale = 1; // pixels per mm
  private drag: { m: Measure; handle: number; x: number; y: number; fresh: boolean } | null = null;

  constructor(private readonly changed: () => void) {
    this.svg.addEventListener("pointerdown", (e) => this.down(e));
    this.svg.addEventListener("pointermove", (e) => this.move(e));
    this.svg.addEventListener("pointerup", (e) => this.up(e));
  }

  use(tool: Tool): void {
    this.tool = tool;
    this.svg.classList.toggle("active", tool !== null);
    this.drag = null;
  }

  layout(width_mm: number, height_mm: number, scale: number): void {
    this.scale = scale;
    this.svg.setAttribute("viewBox", `0 0 ${width_mm * scale} ${height_mm * scale}`);
    this.paint();
  }

  clear(): void {
    this.list = [];
    this.count = 0;
    this.drag = null;
    this.paint();
    this.changed();
  }

  get measures(): { kind: string; value: number; text: string }[] {
    return this.list.map((m) => ({ kind: m.kind, value: sizeOf(m), text: sentence(m) }));
  }

  /** x, depth, x, depth, half of an ellipse's other axis (0: a distance), mm. */
  get marks(): number[][] {
    return this.list.map((m) => [...m.ends[0], ...m.ends[1], m.kind === "area" ? m.half_mm : 0].map((v) => Math.round(v * 100) / 100));
  }

  copyFrom(other: Calipers): void {
    this.list = other.list.map((m) => ({ ...m, ends: [[...m.ends[0]], [...m.ends[1]]] }));
    this.count = other.count;
    this.paint();
    this.changed();
  }

  /** For the keyboard: a measurement in the middle of the image, its first point in focus. */
  placeDefault(width_mm: number, height_mm: number): void {
    const [x, y] = [width_mm / 2, height_mm / 4];
    this.add([x, y - 4], [x, y + 4]);
    this.svg.querySelector<SVGElement>(`[data-measure="${this.count}"]`)?.focus();
  }

  private add(a: Point, b: Point): Measure {
    const m: Measure = { kind: this.tool ?? "distance", number: ++this.count, ends: [a, b], half_mm: FIRST_HALF * between(a, b) };
    this.list.push(m);
    if (this.list.length > MOST) this.list.shift();
    this.paint();
    this.changed();
    return m;
  }

  private point(e: PointerEvent): Point {
    const box = this.svg.getBoundingClientRect();
    return [(e.clientX - box.left) / this.scale, (e.clientY - box.top) / this.scale];
  }

  private down(e: PointerEvent): void {
    if (this.drag) {
      this.drag = null; // the second click of two
      return;
    }
    const held = (e.target as SVGElement).closest<SVGElement>("[data-measure]");
    const m = held && this.list.find((x) => x.number === Number(held.dataset.measure));
    if (m && held) this.drag = { m, handle: Number(held.dataset.handle), x: e.clientX, y: e.clientY, fresh: false };
    else if (this.tool) this.drag = { m: this.add(this.point(e), this.point(e)), handle: 1, x: e.clientX, y: e.clientY, fresh: true };
    else return;
    this.svg.setPointerCapture(e.pointerId);
    e.preventDefault();
  }

  private move(e: PointerEvent): void {
    if (this.drag) this.put(this.drag.m, this.drag.handle, this.point(e), this.drag.fresh);
  }

  private up(e: PointerEvent): void {
    const d = this.drag;
    const clicked = d && d.fresh && Math.hypot(e.clientX - d.x, e.clientY - d.y) < CLICK_PX;
    if (!clicked) this.drag = null; // a click leaves the second point at the pointer until the next
  }

  private put(m: Measure, handle: number, p: Point, fresh: boolean): void {
    const [a, b] = m.ends;
    if (handle < 2) {
      m.ends[handle] = p;
      if (fresh) m.half_mm = FIRST_HALF * between(...m.ends);
    } else {
      const length = Math.max(1e-6, between(a, b));
      const [cx, cy] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
      m.half_mm = Math.abs(((p[0] - cx) * (a[1] - b[1]) + (p[1] - cy) * (b[0] - a[0])) / length);
    }
    this.paint();
    this.changed();
  }

  private key(e: KeyboardEvent, m: Measure, handle: number): void {
    const by = e.shiftKey ? FAST_MM : STEP_MM;
    const steps: Record<string, Point> = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] };
    const step = steps[e.key];
    if (e.key === "Delete" || e.key === "Backspace") this.remove(m);
    else if (step) {
      const [x, y] = this.handles(m)[handle]!;
      this.put(m, handle, [x + step[0], y + step[1]], false);
      this.svg.querySelector<SVGElement>(`[data-measure="${m.number}"][data-handle="${handle}"]`)?.focus();
    } else return;
    e.preventDefault();
    e.stopPropagation();
  }

  private remove(m: Measure): void {
    this.list = this.list.filter((x) => x !== m);
    this.paint();
    this.changed();
  }

  private handles(m: Measure): Point[] {
    const [a, b] = m.ends;
    if (m.kind === "distance") return [a, b];
    const length = Math.max(1e-6, between(a, b));
    const n: Point = [(a[1] - b[1]) / length, (b[0] - a[0]) / length];
    return [a, b, [(a[0] + b[0]) / 2 + n[0] * m.half_mm, (a[1] + b[1]) / 2 + n[1] * m.half_mm]];
  }

  // ---- drawing ---------------------------------------------------------------------------------

  private paint(): void {
    this.svg.replaceChildren(...this.list.flatMap((m) => this.shape(m)));
  }

  private shape(m: Measure): SVGElement[] {
    const [a, b] = m.ends.map((p) => [p[0] * this.scale, p[1] * this.scale]) as [Point, Point];
    const line = { x1: a[0], y1: a[1], x2: b[0], y2: b[1], class: `line n${m.number % 4}` };
    const parts = [draw("line", line)];
    if (m.kind === "area") {
      const angle = (Math.atan2(b[1] - a[1], b[0] - a[0]) * 180) / Math.PI;
      const [cx, cy] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
      const ellipse = { cx, cy, rx: between(a, b) / 2, ry: m.half_mm * this.scale, transform: `rotate(${angle} ${cx} ${cy})` };
      parts.push(draw("ellipse", { ...ellipse, class: `line n${m.number % 4}` }));
    }
    return [...parts, ...this.handles(m).map((p, i) => this.handle(m, i, p))];
  }

  private handle(m: Measure, index: number, p: Point): SVGElement {
    const name = [t("caliper.first"), t("caliper.second"), t("caliper.width")][index]!;
    const g = draw("g", {
      class: `handle n${m.number % 4}`,
      transform: `translate(${p[0] * this.scale} ${p[1] * this.scale})`,
      tabindex: 0,
      role: "slider",
      "aria-label": t(m.kind === "area" ? "caliper.area" : "caliper.distance", { n: m.number, point: name }),
      "aria-valuenow": sizeOf(m).toFixed(1),
      "aria-valuetext": sentence(m),
      "data-measure": m.number,
      "data-handle": index,
    });
    g.append(draw("circle", { r: HIT_PX, class: "hit" }), draw("path", { d: "M-6 0H6M0 -6V6" }));
    if (index === 1) g.append(draw("text", { x: 9, y: -7 }, String(m.number)));
    (g as SVGGElement).addEventListener("keydown", (e) => this.key(e, m, index));
    return g;
  }
}
