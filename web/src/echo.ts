// The echo image as on a scanner: grey picture, depth scale, focus and orientation marks.

import type { Controls, Frame } from "./protocol";

const RULER_PX = 44;
const PAD_PX = 10;
const TOP_PX = 14;

function context(canvas: HTMLCanvasElement): CanvasRenderingContext2D {
  const c = canvas.getContext("2d");
  if (!c) throw new Error("this browser has no 2D canvas");
  return c;
}

export class EchoView {
  private frozen = false;
  private readonly image: CanvasRenderingContext2D;
  private readonly marks: CanvasRenderingContext2D;
  private data: ImageData | null = null;
  private controls: Controls | null = null;
  private width_mm = 60;
  private height_mm = 70;

  get isFrozen(): boolean {
    return this.frozen;
  }

  constructor(
    private readonly box: HTMLElement,
    private readonly picture: HTMLCanvasElement,
    private readonly overlay: HTMLCanvasElement,
    private readonly text: HTMLElement,
  ) {
    this.image = context(picture);
    this.marks = context(overlay);
    new ResizeObserver(() => this.layout()).observe(box);
  }

  show(frame: Frame): void {
    if (this.frozen) return;
    if (!this.data || this.data.width !== frame.width || this.data.height !== frame.height) {
      this.picture.width = frame.width;
      this.picture.height = frame.height;
      this.data = this.image.createImageData(frame.width, frame.height);
    }
    const rgba = new Uint32Array(this.data.data.buffer);
    const grey = frame.pixels;
    for (let i = 0; i < grey.length; ++i) rgba[i] = 0xff000000 | (grey[i]! * 0x010101);
    this.image.putImageData(this.data, 0, 0);
    if (frame.width_mm !== this.width_mm || frame.height_mm !== this.height_mm) {
      this.width_mm = frame.width_mm;
      this.height_mm = frame.height_mm;
      this.layout();
    }
  }

  set(controls: Controls): void {
    this.controls = controls;
    if (!this.frozen) this.caption(controls);
    this.layout();
  }

  /** A frozen picture keeps its caption. */
  freeze(frozen: boolean): void {
    this.frozen = frozen;
    if (!frozen && this.controls) this.set(this.controls);
  }

  private caption(controls: Controls): void {
    this.text.textContent =
      `${label(controls.probe)} probe, ${label(controls.case).toLowerCase()}\n` +
      `${controls.frequency_mhz.toFixed(1)} MHz, gain ${controls.gain_db.toFixed(0)} dB, range ${controls.dynamic_range_db.toFixed(0)} dB`;
  }

  /** Largest picture with its true proportions beside the ruler. */
  private layout(): void {
    const { clientWidth: w, clientHeight: h } = this.box;
    const room = [w - RULER_PX - 2 * PAD_PX, h - TOP_PX - PAD_PX] as const;
    const scale = Math.min(room[0] / this.width_mm, room[1] / this.height_mm);
    if (!(scale > 0)) return;
    const [pw, ph] = [this.width_mm * scale, this.height_mm * scale];
    const left = PAD_PX + (room[0] - pw) / 2;
    Object.assign(this.picture.style, {
      left: `${left}px`,
      top: `${TOP_PX}px`,
      width: `${pw}px`,
      height: `${ph}px`,
    });
    this.text.style.left = `${left}px`;
    const below = TOP_PX + ph + 8; // under the picture when there is room, else over its foot
    this.text.style.top = `${Math.min(below, h - this.text.offsetHeight - 8)}px`;
    const ratio = window.devicePixelRatio;
    this.overlay.width = Math.round(w * ratio);
    this.overlay.height = Math.round(h * ratio);
    this.marks.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawMarks(left, left + pw, scale);
  }

  private drawMarks(left: number, right: number, scale: number): void {
    const c = this.marks;
    c.font = "11px system-ui, sans-serif";
    c.textBaseline = "middle";
    c.strokeStyle = c.fillStyle = "#8491a1";
    c.lineWidth = 1;
    c.beginPath();
    for (let mm = 0; mm <= this.height_mm + 0.01; mm += 5) {
      const y = Math.round(TOP_PX + mm * scale) + 0.5;
      c.moveTo(right + 3, y);
      c.lineTo(right + (mm % 10 === 0 ? 10 : 6), y);
      if (mm % 10 === 0 && mm > 0) c.fillText(`${mm}`, right + 14, y);
    }
    c.stroke();
    c.fillText("mm", right + 14, TOP_PX + 1);
    this.drawFocus(right, scale);
    c.fillStyle = "#5cc8c2"; // the side of the probe's own mark
    c.beginPath();
    c.arc(left + 5, TOP_PX - 7, 3.5, 0, 2 * Math.PI);
    c.fill();
  }

  private drawFocus(right: number, scale: number): void {
    const focus_mm = this.controls?.focus_mm ?? NaN;
    if (!(focus_mm < this.height_mm)) return;
    const y = TOP_PX + focus_mm * scale;
    const c = this.marks;
    c.fillStyle = "#e6b450";
    c.beginPath();
    c.moveTo(right + 2, y);
    c.lineTo(right + 10, y - 5);
    c.lineTo(right + 10, y + 5);
    c.fill();
  }
}

/** "partial_mural" -> "Partial mural" */
export function label(name: string): string {
  const words = name.replace(/.*\//, "").replace(/_/g, " ");
  return words.charAt(0).toUpperCase() + words.slice(1);
}
