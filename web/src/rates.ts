// Latency and frame rate, shown on request.

import { find, recall, remember } from "./dom";

export class Rates {
  private shown = recall("rates") === "yes";
  private frames = 0;
  private at = { s: 0, tick: 0, frames: 0 };

  toggle(): void {
    this.shown = !this.shown;
    remember("rates", this.shown ? "yes" : "");
    this.at.s = 0;
  }

  /** Once per animation frame; writes once per second. */
  update(now_s: number, drew: boolean, tick: number, connected: boolean, latency_ms: number): void {
    if (drew) ++this.frames;
    const dt_s = now_s - this.at.s;
    if (dt_s < 1) return;
    const steps = Math.max(0, tick - this.at.tick) / dt_s;
    const images = (this.frames - this.at.frames) / dt_s;
    const fresh = this.at.s === 0;
    this.at = { s: now_s, tick, frames: this.frames };
    const latency = Number.isNaN(latency_ms) ? "" : `, ${latency_ms.toFixed(0)} ms`;
    const rates = fresh ? "measuring" : `${images.toFixed(0)} images/s, ${steps.toFixed(0)} steps/s${latency}`;
    find("status-text").textContent = !connected ? "Not connected" : this.shown ? rates : "Connected";
    find("status").setAttribute("aria-pressed", String(this.shown));
  }
}
