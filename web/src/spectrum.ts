// The spectrum of pulsed Doppler below the image: it scrolls while it is live; frozen it has an interval of
// time and a line of velocity, which can be dragged, and what is read off between them.

import { draw, find, make } from "./dom";
import { read, smoothed, type Readings } from "./readings";
import type { Controls, SpectrumColumn, SpectrumFrame } from "./protocol";
import type { DopplerSound } from "./sound";
import { ink } from "./theme";
import { decimal, shown, t } from "./words/language";

const KEPT = 1000; // columns: 10 s
const SHOWN_S = 6;
const BINS = 128;
const LEFT_PX = 44; // of the strip: the axis
const FOOT_PX = 15;
const STEP_S = 0.01;
const STEEP_DEG = 60; // beyond it a small error of the angle is a large one of the velocity

type Handle = "from" | "to" | "level";

/** A round step that divides a range into about `wanted`. */
function roundStep(range: number, wanted: number): number {
  const rough = range / wanted;
  const ten = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((k) => k * ten).find((s) => s >= rough)!;
}

export class SpectrumView {
  /** the time of reflux is to be kept */
  keep: (reflux_s: number) => void = () => undefined;
  private columns: SpectrumColumn[] = [];
  private axes: SpectrumFrame | null = null;
  private controls: Controls | null = null;
  private frozen = false;
  private squeezes: number[] = []; // numbers of columns
  private cursor: Record<Handle, number> = { from: 0, to: 0, level: 0 }; // numbers of columns; share of the axis, 1 at the top
  private drag: Handle | null = null;
  private readonly box = find("spectrum");
  private readonly canvas = make("canvas");
  private readonly strip = make("canvas");
  private readonly svg = draw("svg", { class: "spectrum-marks" }) as SVGSVGElement;
  private readonly words = find("spectrum-words");
  private readonly handles: Record<Handle, SVGElement>;
  private readonly lines: Record<Handle, SVGElement>;

  constructor(private readonly sound: DopplerSound) {
    this.strip.width = KEPT;
    this.strip.height = BINS;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", t("spectrum.name"));
    const handle = (name: string): SVGElement => draw("rect", { class: "grip", tabindex: 0, role: "slider", "aria-label": name, "aria-valuenow": 0 });
    this.handles = { from: handle(t("spectrum.from")), to: handle(t("spectrum.to")), level: handle(t("spectrum.level")) };
    this.lines = { from: draw("line"), to: draw("line"), level: draw("line") };
    for (const key of ["from", "to", "level"] as const) {
      const grip = this.handles[key];
      this.svg.append(this.lines[key], grip);
      grip.addEventListener("pointerdown", (e) => {
        this.drag = key;
        grip.setPointerCapture((e as PointerEvent).pointerId);
        e.preventDefault();
      });
      grip.addEventListener("pointermove", (e) => this.drag === key && this.pull(key, e as PointerEvent));
      grip.addEventListener("pointerup", () => (this.drag = null));
      grip.addEventListener("pointercancel", () => (this.drag = null));
      grip.addEventListener("keydown", (e) => this.key(key, e as KeyboardEvent));
    }
    this.box.prepend(this.canvas, this.svg);
    new ResizeObserver(() => this.paint()).observe(this.box);
  }

  /** For tests: what the words say, in numbers. */
  get readings(): (Readings & { columns: number; squeezes: number }) | null {
    const part = this.part();
    return part ? { ...part, columns: this.columns.length, squeezes: this.squeezes.length } : null;
  }

  set(controls: Controls): void {
    const angled = controls.gate_angle_deg !== this.controls?.gate_angle_deg;
    this.controls = controls;
    this.box.hidden = !controls.gate;
    document.body.classList.toggle("pulsed", controls.gate ?? false);
    if (!controls.gate) {
      this.clear();
      this.tell();
    }
    if (angled || this.frozen) this.paint();
  }

  /** The hand squeezes the calf now. */
  squeezed(): void {
    const last = this.columns[this.columns.length - 1];
    if (last) this.squeezes.push(last.number);
  }

  show(frame: SpectrumFrame | null, frozen: boolean): void {
    if (frozen !== this.frozen) this.freeze(frozen);
    if (!frame || frozen) return;
    const before = this.axes;
    // What was measured with other pulses stands at other velocities.
    if (before && (before.limit_cm_s !== frame.limit_cm_s || before.low_cm_s !== frame.low_cm_s)) this.clear();
    const last = this.columns[this.columns.length - 1]?.number;
    const newest = frame.columns[frame.columns.length - 1]?.number;
    if (last !== undefined && newest !== undefined && (newest < last || newest > last + KEPT)) this.clear(); // another time of a replay
    this.axes = frame;
    const fresh = frame.columns.filter((c) => c.number > (this.columns[this.columns.length - 1]?.number ?? -1));
    for (const column of fresh) this.add(column);
    this.sound.add(fresh, frame);
    this.paint();
  }

  private clear(): void {
    this.columns = [];
    this.squeezes = [];
    this.axes = null;
    this.strip.getContext("2d")!.clearRect(0, 0, KEPT, BINS);
  }

  private add(column: SpectrumColumn): void {
    const c = this.strip.getContext("2d")!;
    const last = this.columns[this.columns.length - 1]?.number ?? column.number - 1;
    for (let n = Math.max(last + 1, column.number - KEPT); n < column.number; ++n) c.clearRect(n % KEPT, 0, 1, BINS); // what was missed is dark
    const line = c.createImageData(1, BINS);
    const rgba = new Uint32Array(line.data.buffer);
    for (let b = 0; b < BINS; ++b) rgba[BINS - 1 - b] = 0xff000000 | (column.power[b]! * 0x010101);
    c.putImageData(line, column.number % KEPT, 0);
    // The frame's bytes are let go.
    this.columns.push({ ...column, power: new Uint8Array(0) });
    while (this.columns[0]!.number <= column.number - KEPT) this.columns.shift();
    this.squeezes = this.squeezes.filter((n) => n > column.number - KEPT);
  }

  private freeze(frozen: boolean): void {
    this.frozen = frozen;
    if (!frozen) this.clear();
    const [from, to] = this.span();
    this.cursor = { from, to, level: 0.75 };
    this.paint();
  }

  /** Numbers of the first and the last column that are shown. */
  private span(): [number, number] {
    const last = this.columns[this.columns.length - 1]?.number ?? 0;
    return [Math.max(last - Math.round(SHOWN_S / STEP_S) + 1, this.columns[0]?.number ?? 0), last];
  }

  private get cosine(): number {
    return Math.cos(((this.controls?.gate_angle_deg ?? 0) * Math.PI) / 180);
  }

  /** Readings of the interval, or of what is shown while it is live. */
  private part(): Readings | null {
    if (!this.axes || this.columns.length === 0) return null;
    const [from, to] = this.frozen ? [Math.min(this.cursor.from, this.cursor.to), Math.max(this.cursor.from, this.cursor.to)] : this.span();
    const columns = this.columns.filter((c) => c.number >= from && c.number <= to);
    if (columns.length < 5) return null;
    const squeeze = this.squeezes.find((n) => n > from && n < to);
    return read(columns, this.axes.column_s, 1 / this.cosine, this.axes.slowest_cm_s, squeeze === undefined ? -1 : columns.findIndex((c) => c.number >= squeeze));
  }

  // ---- drawing

  private get size(): { w: number; h: number; plot: number } {
    const { clientWidth: w, clientHeight: h } = this.box;
    return { w, h, plot: w - LEFT_PX };
  }

  private xOf(number: number): number {
    const [, last] = this.span();
    return LEFT_PX + this.size.plot * (1 - (last - number) / (SHOWN_S / STEP_S));
  }

  private numberAt(x: number): number {
    const [first, last] = this.span();
    return Math.max(first, Math.min(last, Math.round(last - (1 - (x - LEFT_PX) / this.size.plot) * (SHOWN_S / STEP_S))));
  }

  /** Share of the axis (1 at the top) of a velocity along the beam. */
  private shareOf(velocity: number): number {
    return this.axes ? (velocity - this.axes.low_cm_s) / (2 * this.axes.limit_cm_s) : 0;
  }

  private paint(): void {
    const { w, h, plot } = this.size;
    if (this.box.hidden || !(plot > 0 && h > FOOT_PX)) return;
    const ratio = window.devicePixelRatio;
    if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(h * ratio)) {
      this.canvas.width = Math.round(w * ratio);
      this.canvas.height = Math.round(h * ratio);
    }
    const c = this.canvas.getContext("2d")!;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = ink("black");
    c.fillRect(0, 0, w, h);
    const high = h - FOOT_PX;
    if (this.axes && this.columns.length > 0) this.paintStrip(c, plot, high);
    this.paintAxes(c, w, high);
    if (this.frozen) this.paintTrace(c, high);
    this.paintMarks(high);
    this.tell();
  }

  private paintStrip(c: CanvasRenderingContext2D, plot: number, high: number): void {
    const [, last] = this.span();
    const shown = Math.round(SHOWN_S / STEP_S);
    const each = plot / shown;
    // The ring is cut where it ends.
    let number = last - shown + 1;
    while (number <= last) {
      const at = ((number % KEPT) + KEPT) % KEPT;
      const count = Math.min(KEPT - at, last - number + 1);
      if (number + count > 0) c.drawImage(this.strip, at, 0, count, BINS, LEFT_PX + (number - last + shown - 1) * each, 0, count * each, high);
      number += count;
    }
  }

  private paintAxes(c: CanvasRenderingContext2D, w: number, high: number): void {
    c.font = "11px system-ui, sans-serif";
    c.textBaseline = "middle";
    c.fillStyle = c.strokeStyle = ink("muted", "picture");
    c.lineWidth = 1;
    c.clearRect(0, 0, LEFT_PX - 1, high + FOOT_PX);
    c.textAlign = "right";
    if (this.axes) {
      const { low_cm_s: low, limit_cm_s: limit } = this.axes;
      const scale = 1 / this.cosine;
      const step = roundStep(2 * limit * scale, Math.max(3, high / 30));
      for (let v = Math.ceil((low * scale) / step) * step; v <= (low + 2 * limit) * scale; v += step) {
        const y = high * (1 - this.shareOf(v / scale));
        if (y > 12 && y < high - 3) c.fillText(decimal(`${Math.round(v * 10) / 10 || 0}`), LEFT_PX - 7, y);
        c.fillRect(LEFT_PX - 5, Math.round(y), 4, 1);
      }
      c.fillText("cm/s", LEFT_PX - 7, 6);
      c.fillStyle = ink("base-line"); // the base line
      c.fillRect(LEFT_PX, Math.round(high * (1 - this.shareOf(0))), w - LEFT_PX, 1);
    }
    // Whole seconds.
    c.fillStyle = ink("muted", "picture");
    c.textAlign = "center";
    const [, last] = this.span();
    for (let n = Math.floor((last * STEP_S) / 1) * (1 / STEP_S); n > last - SHOWN_S / STEP_S && n >= 0; n -= 1 / STEP_S) {
      const x = this.xOf(n);
      c.fillRect(Math.round(x), high, 1, 4);
      if (x > LEFT_PX + 8 && x < w - 12) c.fillText(`${Math.round(n * STEP_S)} s`, x, high + 10);
    }
    for (const n of this.squeezes) {
      const x = this.xOf(n);
      if (x <= LEFT_PX) continue;
      c.fillStyle = ink("focus");
      c.beginPath();
      c.moveTo(x, high - 8);
      c.lineTo(x - 5, high);
      c.lineTo(x + 5, high);
      c.fill();
    }
  }

  /** Edge (yellow) and mean (green) of a frozen spectrum. */
  private paintTrace(c: CanvasRenderingContext2D, high: number): void {
    const [first] = this.span();
    const shown = this.columns.filter((k) => k.number >= first);
    for (const [key, colour] of [["edge_cm_s", "mark"], ["mean_cm_s", "good"]] as const) {
      const values = smoothed(shown.map((k) => k[key]));
      c.strokeStyle = ink(colour, "picture");
      c.lineWidth = 1.2;
      c.beginPath();
      shown.forEach((k, n) => {
        const at = [this.xOf(k.number), high * (1 - this.shareOf(values[n]!))] as const;
        if (k.number === (shown[n - 1]?.number ?? 0) + 1) c.lineTo(...at);
        else c.moveTo(...at); // what was missed has no trace
      });
      c.stroke();
    }
  }

  private paintMarks(high: number): void {
    this.svg.style.display = this.frozen && this.columns.length > 0 ? "" : "none";
    const { w, h } = this.size;
    this.svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
    for (const key of ["from", "to"] as const) {
      const x = this.xOf(this.cursor[key]);
      Object.entries({ x1: x, x2: x, y1: 0, y2: high }).forEach(([k, v]) => this.lines[key].setAttribute(k, `${v}`));
      Object.entries({ x: x - 9, y: 0, width: 18, height: high, "aria-valuenow": (this.cursor[key] * STEP_S).toFixed(2) }).forEach(([k, v]) => this.handles[key].setAttribute(k, `${v}`));
    }
    const y = high * (1 - this.cursor.level);
    Object.entries({ x1: LEFT_PX, x2: w, y1: y, y2: y }).forEach(([k, v]) => this.lines.level.setAttribute(k, `${v}`));
    Object.entries({ x: LEFT_PX, y: y - 7, width: w - LEFT_PX, height: 14, "aria-valuenow": this.level.toFixed(1) }).forEach(([k, v]) => this.handles.level.setAttribute(k, `${v}`));
  }

  /** Velocity of the line, along the flow. */
  private get level(): number {
    return this.axes ? (this.axes.low_cm_s + 2 * this.axes.limit_cm_s * this.cursor.level) / this.cosine : 0;
  }

  /** What is read off a frozen spectrum, in the place of the gate's buttons. */
  private tell(): void {
    const r = this.frozen ? this.part() : null;
    const held = r !== null && !this.box.hidden;
    document.body.classList.toggle("held", held);
    find("spectrum-readings").hidden = !held;
    if (!r) return;
    const steep = Math.abs(this.controls?.gate_angle_deg ?? 0) > STEEP_DEG;
    const texts: [string, string][] = [[t("spectrum.peak"), `${shown(r.peak, 1)} cm/s`], [t("spectrum.mean"), `${shown(r.mean, 1)} cm/s`]];
    if (Number.isFinite(r.phasicity)) texts.push([t("spectrum.phasicity"), shown(r.phasicity, 2)]);
    if (Number.isFinite(r.augmentation)) texts.push([t("spectrum.squeeze"), `× ${shown(r.augmentation, 1)}`]);
    texts.push([t("spectrum.reverse"), t("spectrum.reverse_of", { s: shown(r.reflux_s, 2), of: shown(r.seconds, 2) })], [t("spectrum.line"), `${shown(this.level, 1)} cm/s`]);
    if (steep) texts.push([t("spectrum.angle"), t("spectrum.steep")]);
    const key = texts.join();
    if (this.words.dataset.key === key) return;
    this.words.dataset.key = key;
    this.words.replaceChildren(...texts.map(([name, value]) => {
      const word = make("span", "", name);
      word.append(make("b", "", value));
      return word;
    }));
    const button = find<HTMLButtonElement>("spectrum-keep");
    button.hidden = document.body.dataset.phase !== "running";
    button.onclick = () => this.keep(Math.round(r.reflux_s * 100) / 100);
  }

  // ---- cursors

  private pull(key: Handle, e: PointerEvent): void {
    const at = this.box.getBoundingClientRect();
    if (key === "level") this.cursor.level = Math.max(0, Math.min(1, 1 - (e.clientY - at.top) / (at.height - FOOT_PX)));
    else this.cursor[key] = this.numberAt(e.clientX - at.left);
    this.paint();
  }

  private key(key: Handle, e: KeyboardEvent): void {
    const far = e.shiftKey ? 10 : 1;
    const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[e.key];
    if (!way) return;
    const [first, last] = this.span();
    if (key === "level") this.cursor.level = Math.max(0, Math.min(1, this.cursor.level + (way * far) / (2 * BINS)));
    else this.cursor[key] = Math.max(first, Math.min(last, this.cursor[key] + way * far));
    this.paint();
    e.preventDefault();
    e.stopPropagation();
  }
}
