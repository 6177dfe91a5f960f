// Doppler over the image: the colours, the box with its bar, and the buttons of scanner and free hand.

import type { Connection } from "./connection";
import { announce, beside, draw, find, make, press, pressed, stepper } from "./dom";
import { type Face, FLAT, halfOf, lineOf, placeOf } from "./lines";
import type { ColourFrame, ColourShown, Controls } from "./protocol";

const SCALES_CM_S = [1, 2, 3, 4, 6, 8, 10, 15, 20, 30, 40, 60, 100];
const STEER_DEG = [0, 20, -20];
const GAIN_DB = { low: -30, high: 20, step: 2 };
const LEAST_MM = 5; // of the box
const DEPTH_MM = 200;
const SQUEEZE_MS = 1500;
const BREATH_MS = 5000;
const ARC_PIECES = 16; // of an arc as it is drawn
const BAR = { left: 10, top: 30, width: 9, height: 96 };

type Box = [number, number, number, number]; // left, right along the face from its middle, top, bottom: depths; mm

/** From red, green, blue to a pixel in memory. */
const pixel = (r: number, g: number, b: number): number => (0xff000000 | (Math.round(b) << 16) | (Math.round(g) << 8) | Math.round(r)) >>> 0;

const mix = (stops: number[][], at: number): number => {
  const x = Math.min(0.9999, Math.max(0, at)) * (stops.length - 1);
  const [a, b, f] = [stops[Math.floor(x)]!, stops[Math.floor(x) + 1]!, x - Math.floor(x)];
  return pixel(a[0]! + f * (b[0]! - a[0]!), a[1]! + f * (b[1]! - a[1]!), a[2]! + f * (b[2]! - a[2]!));
};
const TOWARDS = [[70, 0, 0], [200, 10, 0], [255, 90, 0], [255, 225, 60]];
const AWAY = [[0, 0, 90], [0, 40, 220], [0, 140, 255], [110, 240, 255]];
const MOVES = [[70, 8, 0], [190, 40, 0], [255, 130, 0], [255, 225, 110]];

/** Pixels of the values 1 to 255: velocity from the fastest away to the fastest towards the probe, or power. */
function palette(power: boolean): Uint32Array {
  const colours = new Uint32Array(256);
  for (let i = 1; i < 256; ++i) {
    const v = (i - 128) / 127;
    colours[i] = power ? mix(MOVES, (v + 1) / 2) : mix(v < 0 ? AWAY : TOWARDS, Math.abs(v));
  }
  return colours;
}
const PALETTES = { velocity: palette(false), power: palette(true) };

/** Lays the colours of a frame over the pixels of its image. */
export function paintColour(rgba: Uint32Array, width: number, colour: ColourFrame): void {
  const colours = PALETTES[colour.shown];
  for (let y = 0, k = 0; y < colour.height; ++y) {
    const row = (colour.top + y) * width + colour.left;
    for (let x = 0; x < colour.width; ++x, ++k) if (colour.pixels[k]) rgba[row + x] = colours[colour.pixels[k]!]!;
  }
}

const css = (colour: number): string => `rgb(${colour & 255} ${(colour >> 8) & 255} ${(colour >> 16) & 255})`;

/** The box over the image, which can be dragged and drawn larger, and the bar of its colours. */
export class DopplerBox {
  readonly svg = draw("svg", { class: "doppler" }) as SVGSVGElement;
  /** the box was put there; `last`: and stays there */
  moved: (box: Box, last: boolean) => void = () => undefined;
  enabled = true;
  private colour: ColourFrame | null = null;
  private wanted: Box | null = null; // while it is dragged
  private scale = 1;
  private size_mm: [number, number] = [1, 1];
  private face = FLAT;
  private drag: { x: number; y: number; box: Box; corner: boolean } | null = null;
  private readonly outline = draw("path", { class: "box" });
  private readonly body = draw("path", { class: "grip", tabindex: 0, role: "application", "aria-label": "Colour box: arrow keys move it, with Shift its size" });
  private readonly corner = draw("rect", { class: "grip corner", width: 18, height: 18 });
  private readonly bar = draw("g", { class: "bar" });
  private barKey = "";

  constructor() {
    this.svg.append(this.body, this.outline, this.corner, this.bar);
    for (const [grip, corner] of [[this.body, false], [this.corner, true]] as const) {
      grip.addEventListener("pointerdown", (e) => this.down(e as PointerEvent, corner));
      grip.addEventListener("pointermove", (e) => this.move(e as PointerEvent));
      grip.addEventListener("pointerup", () => this.end());
      grip.addEventListener("pointercancel", () => this.end());
    }
    this.body.addEventListener("keydown", (e) => this.key(e as KeyboardEvent));
    this.svg.style.display = "none";
  }

  show(colour: ColourFrame | null): void {
    this.colour = colour;
    this.svg.style.display = colour ? "" : "none";
    if (colour) this.paint(colour);
  }

  layout(width_mm: number, height_mm: number, scale: number, face: Face): void {
    this.scale = scale;
    this.face = face;
    this.size_mm = [width_mm, height_mm];
    this.svg.setAttribute("viewBox", `0 0 ${width_mm * scale} ${height_mm * scale}`);
    if (this.colour) this.paint(this.colour);
  }

  private paint(colour: ColourFrame): void {
    const [left, right, top, bottom] = this.wanted ?? colour.box_mm;
    const lean = (colour.steer_deg * Math.PI) / 180;
    const px = (along: number, depth: number): [number, number] => {
      const [x, z] = placeOf(this.face, along, depth, lean);
      return [(x + this.size_mm[0] / 2) * this.scale, (z - this.face.top_mm) * this.scale];
    };
    // Top and bottom of a sector are arcs.
    const pieces = this.face.radius_mm > 0 ? ARC_PIECES : 1;
    const across = (from: number, to: number, depth: number): string =>
      Array.from({ length: pieces + 1 }, (_, k) => px(from + ((to - from) * k) / pieces, depth).map((v) => v.toFixed(1)).join(" ")).join(" L");
    const shape = `M${across(left, right, top)} L${across(right, left, bottom)} Z`;
    this.outline.setAttribute("d", shape);
    this.body.setAttribute("d", shape);
    const [x, y] = px(right, bottom);
    this.corner.setAttribute("x", `${x - 12}`);
    this.corner.setAttribute("y", `${y - 12}`);
    this.svg.classList.toggle("still", !this.enabled);
    const key = `${colour.shown} ${colour.limit_cm_s.toFixed(1)}`;
    if (key !== this.barKey) this.paintBar(colour);
    this.barKey = key;
  }

  private paintBar(colour: ColourFrame): void {
    const { left, top, width, height } = BAR;
    const steps = 48;
    const cells = Array.from({ length: steps }, (_, k) =>
      draw("rect", { x: left, y: top + (k * height) / steps, width, height: height / steps + 0.6, fill: css(PALETTES[colour.shown][Math.round(255 - (k / (steps - 1)) * 254)]!) }),
    );
    const words = colour.shown === "power" ? ["more", "less", ""] : [`+${colour.limit_cm_s.toFixed(1)}`, `−${colour.limit_cm_s.toFixed(1)}`, "cm/s"];
    this.bar.replaceChildren(
      ...cells,
      draw("text", { x: left, y: top - 5 }, words[0]),
      draw("text", { x: left, y: top + height + 13 }, words[1]),
      draw("text", { x: left, y: top + height + 26 }, words[2]),
    );
  }

  private down(e: PointerEvent, corner: boolean): void {
    if (!this.colour || !this.enabled) return;
    this.drag = { x: e.clientX, y: e.clientY, box: [...this.colour.box_mm], corner };
    (e.target as Element).setPointerCapture(e.pointerId);
    e.preventDefault();
  }

  private move(e: PointerEvent): void {
    if (!this.drag) return;
    const { box, corner } = this.drag;
    // How far its middle, or the corner, is dragged along the face and in depth.
    const [along, depth] = corner ? [box[1], box[3]] : [(box[0] + box[1]) / 2, (box[2] + box[3]) / 2];
    const [x, z] = placeOf(this.face, along, depth);
    const to = lineOf(this.face, x + (e.clientX - this.drag.x) / this.scale, z + (e.clientY - this.drag.y) / this.scale);
    this.put(box, to[0] - along, to[1] - depth, corner);
  }

  private end(): void {
    this.drag = null;
    if (this.wanted) this.moved(this.wanted, true);
    this.wanted = null;
  }

  private key(e: KeyboardEvent): void {
    const step: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = step[e.key];
    if (!way || !this.colour || !this.enabled) return;
    this.put(this.colour.box_mm, way[0], way[1], e.shiftKey);
    this.end();
    e.preventDefault();
    e.stopPropagation();
  }

  /** The box moved, or its lower right corner, within the image. */
  private put(box: Box, x: number, y: number, corner: boolean): void {
    let [left, right, top, bottom] = box;
    const [half, deep] = [halfOf(this.face, this.size_mm[0]), Math.min(this.size_mm[1] + this.face.top_mm, DEPTH_MM)];
    if (corner) {
      right = Math.min(half, Math.max(left + LEAST_MM, right + x));
      bottom = Math.min(deep, Math.max(top + LEAST_MM, bottom + y));
    } else {
      x = Math.max(-half - left, Math.min(half - right, x));
      y = Math.max(-top, Math.min(deep - bottom, y));
      [left, right, top, bottom] = [left + x, right + x, top + y, bottom + y];
    }
    this.wanted = [left, right, top, bottom];
    this.moved(this.wanted, false);
    if (this.colour) this.paint(this.colour);
  }
}

/** The buttons and keys of colour and hand. */
export class Duplex {
  /** the hand squeezes the calf */
  squeezed: () => void = () => undefined;
  private controls: Controls | null = null;
  private sent = 0;
  private readonly values = { scale: make("output"), gain: make("output"), steer: make("output") };
  private readonly lean = stepper("steer", "Steer", this.values.steer, (way) => this.steer(way), "\\: lean of the beam");

  constructor(
    private readonly connection: Connection,
    private readonly box: DopplerBox,
  ) {
    press("colour", () => this.connection.colour({ colour: this.shown === "off" ? "velocity" : "off" }));
    press("power", () => this.power());
    press("squeeze", () => this.hand("squeeze"));
    press("breathe", () => this.hand("breathe"));
    find("colour-tools").append(
      stepper("scale", "Scale", this.values.scale, (way) => this.scale(way), "; and ': velocity from which colour folds"),
      stepper("gain", "Gain", this.values.gain, (way) => this.gain(way), "− and =: how little is shown"),
      this.lean,
    );
    box.moved = (mm, last) => {
      const now = performance.now(); // a hand that drags need not send more often than pictures come
      if (!last && now - this.sent < 25) return;
      this.connection.colour({ colour_box_mm: mm });
      this.sent = now;
    };
  }

  set(controls: Controls): void {
    this.controls = controls;
    const shown = this.shown;
    this.box.enabled = controls.controls;
    find("colour").hidden = controls.colour === undefined;
    find("duplex-tools").hidden = shown === "off" && !controls.gate;
    find("colour-tools").hidden = shown === "off";
    this.lean.hidden = controls.colour_steer_deg === undefined; // the lines of a fan do not lean
    pressed("colour", shown !== "off");
    pressed("power", shown === "power");
    for (const each of document.querySelectorAll<HTMLButtonElement>("#colour, #duplex-tools button")) each.disabled = !controls.controls;
    this.values.scale.textContent = `${(controls.colour_scale_cm_s ?? 0).toFixed(0)} cm/s`;
    this.values.gain.textContent = `${(controls.colour_gain_db ?? 0).toFixed(0)} dB`;
    this.values.steer.textContent = `${(controls.colour_steer_deg ?? 0).toFixed(0)}°`;
  }

  key(code: string, shift: boolean): boolean {
    if (!this.controls?.controls || this.controls.colour === undefined) return false;
    const shown = this.shown !== "off";
    if (code === "KeyM" && shift) this.power();
    else if (code === "KeyB" && shift) this.connection.colour({ colour: shown ? "off" : "velocity" });
    else if (code === "KeyC" && shift) this.hand("squeeze");
    else if (code === "KeyV" && shift) this.hand("breathe");
    else if (shown && (code === "Semicolon" || code === "Quote")) this.scale(code === "Semicolon" ? -1 : 1);
    else if (shown && (code === "Minus" || code === "Equal")) this.gain(code === "Minus" ? -1 : 1);
    else if (shown && code === "Backslash" && !this.lean.hidden) this.steer(1);
    else return false;
    return true;
  }

  private get shown(): ColourShown {
    return this.controls?.colour ?? "off";
  }

  /** How much moves instead of how fast, and back. */
  private power(): void {
    this.connection.colour({ colour: this.shown === "power" ? "velocity" : "power" });
  }

  private scale(way: number): void {
    const now = this.controls?.colour_scale_cm_s ?? 6;
    this.connection.colour({ colour_scale_cm_s: beside(SCALES_CM_S, now, way) });
  }

  private gain(way: number): void {
    const wanted = (this.controls?.colour_gain_db ?? 0) + way * GAIN_DB.step;
    this.connection.colour({ colour_gain_db: Math.max(GAIN_DB.low, Math.min(GAIN_DB.high, wanted)) });
  }

  private steer(way: number): void {
    const at = STEER_DEG.indexOf(Math.round(this.controls?.colour_steer_deg ?? 0));
    this.connection.colour({ colour_steer_deg: STEER_DEG[(at + way + STEER_DEG.length) % STEER_DEG.length]! });
  }

  private hand(action: "squeeze" | "breathe"): void {
    this.connection.hand(action);
    if (action === "squeeze") this.squeezed();
    pressed(action, true);
    window.setTimeout(() => pressed(action, false), action === "squeeze" ? SQUEEZE_MS : BREATH_MS);
    announce(action === "squeeze" ? "The calf is squeezed." : "The patient breathes in deeply.");
  }
}
