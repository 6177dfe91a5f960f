// Everything of the page that is neither picture, thigh nor plot: choices, sliders, read-outs, keys.

import type { EchoKey } from "./connection";
import { label, make, release } from "./dom";
import type { Controls, Snapshot } from "./protocol";
import { shown, t } from "./words/language";

/** A row of buttons of which one is pressed. */
export class Chips {
  private names: readonly string[] = [];
  constructor(
    private readonly box: HTMLElement,
    private readonly choose: (name: string) => void,
    private readonly short: (name: string) => string = label,
  ) {}

  fill(names: readonly string[]): void {
    this.names = names;
    this.box.replaceChildren(
      ...names.map((name) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = this.short(name);
        button.title = label(name);
        button.onclick = () => {
          this.choose(name);
          release(button);
        };
        return button;
      }),
    );
  }

  press(name: string): void {
    [...this.box.children].forEach((b, i) => b.setAttribute("aria-pressed", String(this.names[i] === name)));
  }

  enable(enabled: boolean): void {
    for (const b of this.box.children) (b as HTMLButtonElement).disabled = !enabled;
  }
}

interface SliderInfo {
  key: EchoKey;
  name: string;
  unit: string;
  low: number;
  high: number;
  step: number;
}

const SLIDERS: SliderInfo[] = [
  { key: "gain_db", name: t("slider.gain"), unit: "dB", low: -30, high: 30, step: 1 },
  { key: "depth_mm", name: t("slider.depth"), unit: "mm", low: 30, high: 120, step: 5 },
  { key: "frequency_mhz", name: t("slider.frequency"), unit: "MHz", low: 2, high: 12, step: 0.5 },
  { key: "dynamic_range_db", name: t("slider.range"), unit: "dB", low: 30, high: 90, step: 5 },
  { key: "focus_mm", name: t("slider.focus"), unit: "mm", low: 5, high: 115, step: 1 },
  { key: "tgc_db_per_cm", name: "TGC", unit: "dB/cm", low: -10, high: 10, step: 0.5 },
];

export class Sliders {
  private readonly inputs = new Map<EchoKey, { input: HTMLInputElement; output: HTMLElement; info: SliderInfo }>();

  constructor(
    box: HTMLElement,
    private readonly change: (key: EchoKey, value: number) => void,
  ) {
    for (const info of SLIDERS) box.append(this.build(info));
  }

  private build(info: SliderInfo): HTMLElement {
    const row = make("label", "slider");
    const output = make("output");
    const input = document.createElement("input");
    input.setAttribute("aria-label", t("slider.label", { name: info.name, unit: info.unit })); // the label names its output
    Object.assign(input, { type: "range", min: info.low, max: info.high, step: info.step });
    input.oninput = () => {
      this.write(output, info, input.valueAsNumber);
      this.change(info.key, input.valueAsNumber);
    };
    input.onchange = () => release(input); // the arrow keys press the probe again
    row.append(make("span", "caption", info.name), output, input);
    this.inputs.set(info.key, { input, output, info });
    return row;
  }

  private write(output: HTMLElement, info: SliderInfo, value: number): void {
    output.textContent = `${shown(value, info.step < 1 ? 1 : 0)} ${info.unit}`;
  }

  set(controls: Controls): void {
    for (const [key, { input, output, info }] of this.inputs) {
      if (document.activeElement === input) continue;
      input.value = String(controls[key]);
      input.disabled = !controls.controls;
      this.write(output, info, controls[key]);
    }
  }
}

interface Gauge {
  row: HTMLElement;
  value: HTMLElement;
  said: string;
}

/** A line of numbers: how far the probe is pressed in, vein, artery; dashes while it is in the air. */
export class Readouts {
  private readonly pressed: Gauge;
  private readonly vein: Gauge;
  private readonly diameter: Gauge;
  private readonly artery: Gauge;
  private vessels = true;

  constructor(private readonly box: HTMLElement) {
    this.pressed = this.gauge(t("readout.pressed"));
    this.vein = this.gauge(t("readout.vein_area"), "vein");
    this.diameter = this.gauge(t("readout.vein_diameter"), "vein");
    this.artery = this.gauge(t("readout.artery_area"), "artery");
  }

  private gauge(name: string, colour = ""): Gauge {
    const row = make("div", `readout ${colour}`);
    const value = make("b");
    row.append(make("span", "caption", name), value);
    this.box.append(row);
    return { row, value, said: "" };
  }

  /** In an exam without full guidance the learner judges the vein by eye. */
  showVessels(on: boolean): void {
    if (this.vessels === on) return;
    this.vessels = on;
    for (const g of [this.vein, this.diameter, this.artery]) g.row.hidden = !on;
  }

  /** Nothing is measured while there is no connection. */
  lost(on: boolean): void {
    if (!on) return;
    for (const g of [this.pressed, this.vein, this.diameter, this.artery]) {
      g.row.classList.add("away");
      g.value.replaceChildren((g.said = "–"));
    }
  }

  private static number(gauge: Gauge, value: number, digits: number, unit: string, touching: boolean): void {
    const away = !touching || !Number.isFinite(value);
    const word = away ? (touching ? t("readout.not_in_view") : "–") : shown(value, digits);
    if (gauge.said === word) return; // what is written anew is laid out anew
    gauge.said = word;
    gauge.row.classList.toggle("away", away);
    gauge.value.replaceChildren(word, ...(away ? [] : [make("small", "", unit)]));
  }

  show(s: Snapshot): void {
    const touching = s.contact_area_mm2 > 0;
    Readouts.number(this.pressed, Math.max(0, s.penetration_mm), 1, "mm", touching);
    Readouts.number(this.vein, 100 * s.vein_area_ratio, 0, t("readout.of_rest"), touching);
    Readouts.number(this.diameter, Number.isNaN(s.vein_area_ratio) ? NaN : s.vein_short_mm, 1, "mm", touching);
    Readouts.number(this.artery, 100 * s.artery_area_ratio, 0, t("readout.of_rest"), touching);
  }
}

const KEYS = ["drag_leg", "wheel", "right_drag", "slide", "rotate", "beside", "choose", "image", "patient",
  "pulsed", "colour", "hand", "segment", "finding", "sheet", "exam", "replay", "stop"] as const;

export function fillHelp(box: HTMLElement): void {
  for (const key of KEYS) box.append(make("kbd", "", t(`help.${key}`)), make("span", "", t(`help.${key}.what`)));
}
