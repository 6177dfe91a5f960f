// The echo image as on a scanner: grey picture, depth scale, focus, gain over depth; freeze, calipers,
// and a kept image beside the live one.

import { Calipers, type Tool } from "./calipers";
import { label, make, write } from "./dom";
import { DopplerBox, paintColour } from "./duplex";
import { GateOverlay } from "./gate";
import { PictureGuide } from "./guide";
import { FLAT } from "./lines";
import type { Controls, Frame, Picture } from "./protocol";
import { ink } from "./theme";
import { amid, shown, t } from "./words/language";

const RULER_PX = 40;
const CURVE_PX = 26; // gain over depth, left of the image
const PAD_PX = 10;
const GAP_PX = 14;
const TOP_PX = 16;
const NARROW_PX = 480;
const FULL_DB = 30; // at the edge of the gain curve

function context(canvas: HTMLCanvasElement): CanvasRenderingContext2D {
  const c = canvas.getContext("2d");
  if (!c) throw new Error("this browser has no 2D canvas");
  return c;
}

/** One image with its calipers. */
class Pane {
  readonly root = make("div", "pane");
  readonly canvas = make("canvas");
  readonly title = make("span", "pane-title");
  readonly calipers: Calipers;
  readonly doppler = new DopplerBox();
  readonly gate = new GateOverlay();
  readonly guide = new PictureGuide();
  width_mm = 60;
  height_mm = 70;
  face = FLAT;
  private readonly image: CanvasRenderingContext2D;
  private data: ImageData | null = null;

  constructor(name: string, changed: () => void) {
    this.calipers = new Calipers(changed);
    this.image = context(this.canvas);
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", name);
    this.root.append(this.canvas, this.doppler.svg, this.gate.svg, this.guide.svg, this.calipers.svg, this.title);
  }

  /** True when the size in millimetres changed. */
  show(frame: Frame): boolean {
    if (!this.data || this.data.width !== frame.width || this.data.height !== frame.height) {
      this.canvas.width = frame.width;
      this.canvas.height = frame.height;
      this.data = this.image.createImageData(frame.width, frame.height);
    }
    const rgba = new Uint32Array(this.data.data.buffer);
    const grey = frame.pixels;
    for (let i = 0; i < grey.length; ++i) rgba[i] = 0xff000000 | (grey[i]! * 0x010101);
    if (frame.colour) paintColour(rgba, frame.width, frame.colour);
    this.doppler.show(frame.colour);
    this.gate.show(frame.spectrum);
    this.image.putImageData(this.data, 0, 0);
    const same = frame.width_mm === this.width_mm && frame.height_mm === this.height_mm && frame.face.top_mm === this.face.top_mm;
    this.face = frame.face;
    this.width_mm = frame.width_mm;
    this.height_mm = frame.height_mm;
    return !same;
  }

  copyFrom(other: Pane): void {
    this.canvas.width = other.canvas.width;
    this.canvas.height = other.canvas.height;
    this.image.drawImage(other.canvas, 0, 0);
    this.width_mm = other.width_mm;
    this.height_mm = other.height_mm;
    this.face = other.face;
    this.calipers.copyFrom(other.calipers);
  }

  place(left: number, top: number, scale: number): void {
    const style = { left: `${left}px`, top: `${top}px`, width: `${this.width_mm * scale}px`, height: `${this.height_mm * scale}px` };
    Object.assign(this.root.style, style);
    this.calipers.layout(this.width_mm, this.height_mm, scale);
    this.doppler.layout(this.width_mm, this.height_mm, scale, this.face);
    this.gate.layout(this.width_mm, this.height_mm, scale, this.face);
    this.guide.layout(this.width_mm, this.height_mm, scale, this.face);
  }
}

export class EchoView {
  measured: () => void = () => undefined;
  private frozen = false;
  private compared = false;
  private nameCase = true;
  private tool: Tool = null;
  private controls: Controls | null = null;
  private force_n = 0;
  private readonly live: Pane;
  private readonly kept: Pane;
  private readonly marks: CanvasRenderingContext2D;

  constructor(
    private readonly box: HTMLElement,
    private readonly overlay: HTMLCanvasElement,
    private readonly text: HTMLElement,
    private readonly values: HTMLElement,
  ) {
    this.live = new Pane(t("page.echo_image"), () => this.list());
    this.kept = new Pane(t("echo.kept_image"), () => this.list());
    this.kept.root.hidden = true;
    this.box.prepend(this.kept.root, this.live.root);
    this.marks = context(overlay);
    new ResizeObserver(() => this.layout()).observe(box);
  }

  /** of the live image */
  get doppler(): DopplerBox {
    return this.live.doppler;
  }
  get gate(): GateOverlay {
    return this.live.gate;
  }
  /** Names and ways of a live picture; a frozen one keeps its own. */
  point(picture: Picture | null): void {
    if (!this.frozen || !picture) this.live.guide.show(picture);
  }
  get isFrozen(): boolean {
    return this.frozen;
  }
  get isCompared(): boolean {
    return this.compared;
  }
  get activeTool(): Tool {
    return this.tool;
  }
  get measures(): { kind: string; value: number; text: string }[] {
    return [...(this.compared ? this.kept.calipers.measures : []), ...this.live.calipers.measures];
  }

  /** Calipers on the live or frozen image. */
  get calipers(): number[][] {
    return this.live.calipers.marks;
  }

  show(frame: Frame): void {
    if (this.frozen) return;
    this.force_n = Math.max(0, frame.snapshot.force_normal_n);
    if (this.live.show(frame)) this.layout();
    this.titles();
  }

  set(controls: Controls): void {
    this.controls = controls;
    if (!this.frozen) this.caption(controls);
    this.layout();
  }

  /** An exam does not say what is in the vein. */
  tellCase(tell: boolean): void {
    if (this.nameCase === tell) return;
    this.nameCase = tell;
    if (this.controls) this.caption(this.controls);
  }

  /** A frozen picture keeps its caption. */
  freeze(frozen: boolean): void {
    this.frozen = frozen;
    this.live.root.classList.toggle("frozen", frozen);
    this.titles();
    if (!frozen && this.controls) this.set(this.controls);
  }

  /** Keeps the image of now on the left while the live one goes on at the right, or ends that. */
  compare(on: boolean): void {
    this.compared = on;
    if (on) {
      this.kept.copyFrom(this.live);
      this.kept.title.textContent = t("echo.kept_force", { force: shown(this.force_n, 1) });
      this.live.calipers.clear();
    } else {
      this.kept.calipers.clear();
    }
    this.kept.root.hidden = !on;
    this.titles();
    this.layout();
  }

  use(tool: Tool, byKeyboard = false): void {
    this.tool = tool;
    this.live.calipers.use(tool);
    this.kept.calipers.use(tool);
    if (tool && byKeyboard) this.live.calipers.placeDefault(this.live.width_mm, this.live.height_mm);
  }

  clearMeasures(): void {
    this.live.calipers.clear();
    this.kept.calipers.clear();
  }

  private list(): void {
    const line = (m: { kind: string; text: string }): HTMLElement => make("span", m.kind, m.text);
    const kept = this.compared ? this.kept.calipers.measures : [];
    const live = this.live.calipers.measures;
    const head = (text: string): HTMLElement => make("span", "which", text);
    this.values.replaceChildren(
      ...(kept.length ? [head(t("echo.kept")), ...kept.map(line)] : []),
      ...(kept.length && live.length ? [head(t("echo.now"))] : []),
      ...live.map(line),
    );
    this.layout();
    this.measured();
  }

  private titles(): void {
    const state = this.frozen ? t("echo.frozen") : this.compared ? t("echo.now") : "";
    const force = this.compared ? `, ${shown(this.force_n, 1)} N` : "";
    write(this.live.title, state ? state + force : "");
  }

  private caption(controls: Controls): void {
    const probe = label(controls.probe);
    const head = this.nameCase ? t("echo.probe_case", { probe, name: amid(label(controls.case)) }) : t("echo.probe", { probe });
    this.text.textContent = `${head}\n${t("echo.settings", { mhz: shown(controls.frequency_mhz, 1), gain: controls.gain_db.toFixed(0), range: controls.dynamic_range_db.toFixed(0) })}`;
  }

  /** Largest pictures with their true proportions between the gain curve and the ruler. */
  private layout(): void {
    const { clientWidth: w, clientHeight: h } = this.box;
    const panes = this.compared ? [this.kept, this.live] : [this.live];
    const curve = this.compared && w < NARROW_PX ? 0 : CURVE_PX; // two images need the room
    const room = w - RULER_PX - curve - 2 * PAD_PX - GAP_PX * (panes.length - 1);
    const wide = panes.reduce((sum, p) => sum + p.width_mm, 0);
    const high = Math.max(...panes.map((p) => p.height_mm));
    const scale = Math.min(room / wide, (h - TOP_PX - PAD_PX) / high);
    if (!(scale > 0)) return;
    const first = PAD_PX + curve + (room - wide * scale) / 2;
    let left = first;
    for (const pane of panes) {
      pane.place(left, TOP_PX, scale);
      left += pane.width_mm * scale + GAP_PX;
    }
    this.placeText(first, left - GAP_PX, TOP_PX + high * scale, h);
    const ratio = window.devicePixelRatio;
    this.overlay.width = Math.round(w * ratio);
    this.overlay.height = Math.round(h * ratio);
    this.marks.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawMarks(first, left - GAP_PX, scale, curve > 0);
  }

  /** Under the pictures when there is room, else over their foot; measurements above the caption. */
  private placeText(left: number, right: number, foot: number, h: number): void {
    const top = Math.min(foot + 6, h - this.text.offsetHeight - 8);
    this.text.style.left = `${left + 6}px`;
    this.text.style.maxWidth = `${Math.max(90, right - left - 8)}px`;
    this.text.style.top = `${top}px`;
    const below = top + this.text.offsetHeight + 8;
    const roomy = below + this.values.offsetHeight < h;
    this.values.style.left = `${left + 6}px`;
    this.values.style.top = `${roomy ? below : top - this.values.offsetHeight - 4}px`;
  }

  private drawMarks(left: number, right: number, scale: number, curve: boolean): void {
    const c = this.marks;
    const top_mm = this.live.face.top_mm;
    const depth_mm = this.live.height_mm + top_mm;
    c.clearRect(0, 0, this.overlay.width, this.overlay.height);
    c.font = "11.5px system-ui, sans-serif";
    c.textBaseline = "middle";
    c.strokeStyle = c.fillStyle = ink("muted", "picture");
    c.lineWidth = 1;
    c.beginPath();
    for (let mm = 0; mm <= depth_mm + 0.01; mm += 5) {
      const y = Math.round(TOP_PX + (mm - top_mm) * scale) + 0.5;
      c.moveTo(right + 3, y);
      c.lineTo(right + (mm % 10 === 0 ? 10 : 6), y);
      if (mm % 10 === 0 && mm > 0) c.fillText(`${mm / 10}`, right + 15, y);
    }
    c.stroke();
    c.fillText("cm", right + 14, TOP_PX + 1);
    this.drawFocus(right, scale);
    if (curve) this.drawGain(left, scale);
    c.fillStyle = ink("accent", "picture"); // the side of the probe's own mark
    c.beginPath();
    c.arc(left + 5, TOP_PX - 7, 3.5, 0, 2 * Math.PI);
    c.fill();
  }

  private drawFocus(right: number, scale: number): void {
    const focus_mm = this.controls?.focus_mm ?? NaN;
    const { height_mm, face } = this.live;
    if (!(focus_mm < height_mm + face.top_mm)) return;
    const y = TOP_PX + (focus_mm - face.top_mm) * scale;
    const c = this.marks;
    c.fillStyle = ink("focus");
    c.beginPath();
    c.moveTo(right + 2, y);
    c.lineTo(right + 10, y - 5);
    c.lineTo(right + 10, y + 5);
    c.fill();
  }

  /** How much the depth compensation lifts each depth: to the right is more. */
  private drawGain(left: number, scale: number): void {
    const slope = this.controls?.tgc_db_per_cm ?? NaN;
    if (!Number.isFinite(slope)) return;
    const c = this.marks;
    const middle = left - CURVE_PX / 2 - 4;
    const bottom = TOP_PX + this.live.height_mm * scale;
    const db = Math.max(-FULL_DB, Math.min(FULL_DB, (slope * this.live.height_mm) / 10));
    c.strokeStyle = ink("image-rule");
    c.beginPath();
    c.moveTo(middle, TOP_PX);
    c.lineTo(middle, bottom);
    c.stroke();
    c.strokeStyle = ink("accent", "picture");
    c.globalAlpha = 0.8;
    c.beginPath();
    c.moveTo(middle, TOP_PX);
    c.lineTo(middle + (db / FULL_DB) * (CURVE_PX / 2), bottom);
    c.stroke();
    c.globalAlpha = 1;
    c.fillStyle = ink("muted", "picture");
    c.textAlign = "center";
    c.fillText("TGC", middle, TOP_PX - 7);
    c.textAlign = "left";
  }
}
