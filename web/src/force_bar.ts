// The force on the probe as a bar: what is comfortable, what is not, the limit, and the corridor that
// a guided compression asks for. True newtons; what a device renders, when that is less, is a notch.

import { find, make, write } from "./dom";
import { feedback, type Feedback } from "./feedback";
import type { Compression, Snapshot } from "./protocol";
import { ink, onTheme } from "./theme";
import { shown, t } from "./words/language";

const TOP_PX = 10;
const FOOT_PX = 8;
const BAR = { left: 34, width: 22 };
const OVER = 1.1; // the scale ends above the limit
const RENDERED_N = 0.3; // smaller differences between true and rendered force are not shown

export class ForceBar {
  private limit_n = 40;
  private comfort_n = 20;
  private corridor: [number, number] | null = null;
  private force_n = 0;
  private rendered_n = 0;
  private drawn = "";
  private told = ""; // in words and numbers
  private readonly c: CanvasRenderingContext2D;
  private readonly canvas = find<HTMLCanvasElement>("force-bar");

  constructor() {
    this.c = this.canvas.getContext("2d")!;
    const again = (): void => {
      this.drawn = "";
      this.paint();
    };
    new ResizeObserver(again).observe(this.canvas);
    onTheme(again);
  }

  limits(limit_n: number, comfort_n: number): void {
    this.limit_n = limit_n;
    this.comfort_n = comfort_n;
    this.canvas.setAttribute("aria-valuemax", limit_n.toFixed(0));
    this.paint();
  }

  ask(corridor: [number, number] | null): void {
    this.corridor = corridor;
    this.paint();
  }

  /** Nothing is measured while there is no connection. */
  lost(on: boolean): void {
    if (!on) return;
    this.force_n = this.rendered_n = 0;
    this.told = "";
    find("force-value").replaceChildren("–", make("small", "", "N"));
    find("force-word").textContent = t("force.not_connected");
    find("force-head").dataset.tone = "lost";
    this.canvas.removeAttribute("aria-valuenow");
    this.canvas.setAttribute("aria-valuetext", t("force.not_connected"));
    this.paint();
  }

  /** Shows the force and says what it means, with the judge's word on the press (null: not shown). */
  show(s: Snapshot, compression: Compression | null): Feedback {
    this.force_n = Math.max(0, s.force_normal_n);
    this.rendered_n = Math.hypot(...s.rendered_force_n);
    const touching = s.contact_area_mm2 > 0;
    const said = feedback({ force_n: this.force_n, touching, target_n: this.corridor, limit_n: this.limit_n, comfort_n: this.comfort_n, compression });
    const air = !touching && this.force_n < 0.05;
    const value = air ? "–" : shown(this.force_n, 1);
    const key = `${value} ${said.word} ${said.tone}`;
    if (key !== this.told) {
      find("force-value").replaceChildren(value, ...(air ? [] : [make("small", "", "N")]));
      write(find("force-word"), said.word);
      find("force-head").dataset.tone = said.tone;
      this.canvas.setAttribute("aria-valuenow", this.force_n.toFixed(1));
      this.canvas.setAttribute("aria-valuetext", t("force.newtons", { force: shown(this.force_n, 1), word: said.word }));
    }
    this.told = key;
    this.paint();
    return said;
  }

  private paint(): void {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const state = `${w} ${h} ${this.limit_n} ${this.comfort_n} ${this.corridor} ${this.force_n.toFixed(1)} ${this.rendered_n.toFixed(1)}`;
    if (state === this.drawn || w === 0 || h === 0) return;
    this.drawn = state;
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(w * ratio);
    this.canvas.height = Math.round(h * ratio);
    this.c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.c.clearRect(0, 0, w, h);
    const span = h - TOP_PX - FOOT_PX;
    const y = (n: number): number => TOP_PX + span * (1 - Math.min(1, n / (OVER * this.limit_n)));
    this.zones(y);
    this.scale(y);
    this.level(y);
    if (this.corridor) this.bracket(y, this.corridor);
  }

  private block(y: (n: number) => number, from: number, to: number, colour: string, left = BAR.left, width = BAR.width): void {
    this.c.fillStyle = colour;
    this.c.fillRect(left, y(to), width, y(from) - y(to));
  }

  private zones(y: (n: number) => number): void {
    this.c.globalAlpha = 0.55;
    this.block(y, 0, this.comfort_n, ink("force-comfort"));
    this.block(y, this.comfort_n, this.limit_n, ink("force-firm"));
    this.block(y, this.limit_n, OVER * this.limit_n, ink("force-hard"));
    this.c.globalAlpha = 1;
  }

  private scale(y: (n: number) => number): void {
    const c = this.c;
    c.font = "11px system-ui, sans-serif";
    c.textBaseline = "middle";
    c.textAlign = "right";
    c.fillStyle = ink("muted");
    for (let n = 0; n <= this.limit_n; n += 10) {
      c.fillText(`${n}`, BAR.left - 9, y(n));
      c.fillRect(BAR.left - 5, Math.round(y(n)), 4, 1);
    }
  }

  private level(y: (n: number) => number): void {
    this.block(y, 0, this.force_n, ink("force-fill"), BAR.left + 6, BAR.width - 12);
    if (Math.abs(this.rendered_n - this.force_n) < RENDERED_N || this.rendered_n === 0) return;
    this.c.fillStyle = ink("force-notch"); // what the device renders
    this.c.fillRect(BAR.left, y(this.rendered_n) - 1.5, BAR.width, 3);
  }

  private bracket(y: (n: number) => number, [low, high]: [number, number]): void {
    const c = this.c;
    const right = BAR.left + BAR.width + 3;
    c.strokeStyle = ink("accent");
    c.lineWidth = 2;
    c.strokeRect(BAR.left - 1.5, y(high), BAR.width + 3, y(low) - y(high));
    c.fillStyle = ink("accent");
    c.beginPath();
    c.moveTo(right + 1, (y(low) + y(high)) / 2);
    c.lineTo(right + 9, (y(low) + y(high)) / 2 - 5);
    c.lineTo(right + 9, (y(low) + y(high)) / 2 + 5);
    c.fill();
  }
}
