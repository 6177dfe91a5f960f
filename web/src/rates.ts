// Which tissue bears the probe; latency and frame rate, shown on request.

import { find, recall, remember } from "./dom";
import { t } from "./words/language";

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
  update(now_s: number, drew: boolean, tick: number, connected: boolean, latency_ms: number, solid: boolean): void {
    if (drew) ++this.frames;
    const dt_s = now_s - this.at.s;
    if (dt_s < 1) return;
    const steps = Math.max(0, tick - this.at.tick) / dt_s;
    const images = (this.frames - this.at.frames) / dt_s;
    const fresh = this.at.s === 0;
    this.at = { s: now_s, tick, frames: this.frames };
    const seen = { images: images.toFixed(0), steps: steps.toFixed(0) };
    const rates = fresh ? t("rates.measuring") : Number.isNaN(latency_ms) ? t("rates.rates", seen) : t("rates.latency", { ...seen, ms: latency_ms.toFixed(0) });
    const said = this.shown ? rates : t("rates.connected");
    const tissue = solid ? t("rates.solid", { said }) : this.shown ? t("rates.springs", { said }) : said;
    find("status-text").textContent = connected ? tissue : t("rates.not_connected");
    find("status").setAttribute("aria-pressed", String(this.shown));
  }
}
