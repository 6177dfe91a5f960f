// Everything of the page that is neither picture, thigh nor plot: choices, sliders, read-outs.

import type { EchoKey } from "./connection";
import { label } from "./echo";
import type { Controls, Snapshot } from "./protocol";

export function find<T extends HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`#${id} is missing`);
  return element as T;
}

function make(tag: string, className = "", text = ""): HTMLElement {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.textContent = text;
  return element;
}

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
          button.blur();
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
  { key: "gain_db", name: "Gain", unit: "dB", low: -30, high: 30, step: 1 },
  { key: "depth_mm", name: "Image depth", unit: "mm", low: 30, high: 120, step: 5 },
  { key: "frequency_mhz", name: "Frequency", unit: "MHz", low: 2, high: 12, step: 0.5 },
  { key: "dynamic_range_db", name: "Dynamic range", unit: "dB", low: 30, high: 90, step: 5 },
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
    Object.assign(input, { type: "range", min: info.low, max: info.high, step: info.step });
    input.oninput = () => {
      this.write(output, info, input.valueAsNumber);
      this.change(info.key, input.valueAsNumber);
    };
    input.onchange = () => input.blur(); // the arrow keys press the probe again
    row.append(make("span", "caption", info.name), output, input);
    this.inputs.set(info.key, { input, output, info });
    return row;
  }

  private write(output: HTMLElement, info: SliderInfo, value: number): void {
    output.textContent = `${value.toFixed(info.step < 1 ? 1 : 0)} ${info.unit}`;
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
  fill: HTMLElement;
}

export class Readouts {
  private readonly force = make("b");
  private readonly forceFill = make("i");
  private readonly limit = make("span");
  private readonly penetration: HTMLElement;
  private readonly vein: Gauge;
  private readonly artery: Gauge;
  private limit_n = 40;

  constructor(private readonly box: HTMLElement) {
    const force = make("div", "force");
    force.append(make("span", "caption", "Force on the probe"), this.force);
    const bar = make("div");
    const track = make("div", "bar");
    track.append(this.forceFill);
    const scale = make("div", "scale");
    scale.append(make("span", "", "0"), this.limit);
    bar.append(track, scale);
    const row = make("div", "row");
    this.penetration = make("b");
    row.append(make("span", "caption", "Penetration"), this.penetration);
    this.box.append(force, bar, row);
    this.vein = this.gauge("Vein area", "var(--vein)");
    this.artery = this.gauge("Artery area", "var(--artery)");
    this.setLimit(40);
  }

  private gauge(name: string, colour: string): Gauge {
    const row = make("div", "row");
    const value = make("b");
    const bar = make("div", "bar");
    const fill = make("i");
    fill.style.background = colour;
    bar.append(fill);
    row.append(make("span", "caption", name), value, bar);
    this.box.append(row);
    return { row, value, fill };
  }

  setLimit(limit_n: number): void {
    this.limit_n = limit_n;
    this.limit.textContent = `limit ${limit_n.toFixed(0)} N`;
  }

  private static number(element: HTMLElement, text: string, unit: string): void {
    element.replaceChildren(text, make("small", "", unit));
  }

  private setGauge(gauge: Gauge, ratio: number): void {
    const away = Number.isNaN(ratio);
    gauge.row.classList.toggle("away", away);
    if (away) gauge.value.textContent = "not in view";
    else Readouts.number(gauge.value, (100 * ratio).toFixed(0), "% of rest");
    gauge.fill.style.width = away ? "0" : `${Math.min(100, 100 * ratio)}%`;
  }

  show(s: Snapshot): void {
    const share = Math.max(0, s.force_normal_n) / this.limit_n;
    Readouts.number(this.force, Math.max(0, s.force_normal_n).toFixed(1), "N");
    this.forceFill.style.width = `${Math.min(100, 100 * share)}%`;
    this.forceFill.style.background = share > 0.95 ? "var(--danger)" : share > 0.75 ? "var(--warn)" : "var(--accent)";
    const deep = s.penetration_mm;
    if (deep > -0.05) Readouts.number(this.penetration, Math.abs(deep).toFixed(1), "mm");
    else Readouts.number(this.penetration, (-deep).toFixed(1), "mm above");
    this.setGauge(this.vein, s.vein_area_ratio);
    this.setGauge(this.artery, s.artery_area_ratio);
  }
}

const KEYS: [string, string][] = [
  ["Drag on the thigh", "slide the probe along the skin; a far click lifts it and sets it down there"],
  ["Click a dot", "go to that measured site"],
  ["Wheel, Up / Down, W / S", "press deeper or shallower by 1 mm, with Shift by 5 mm"],
  ["Right drag, hold Space", "press progressively (Shift + Space lifts)"],
  ["A / D, Left / Right", "slide across or along the leg"],
  ["Q / E", "rotate about the beam"],
  ["T / G, Y / H", "tilt the beam"],
  ["1 to 9, C", "choose the probe, next case"],
  ["F, X", "freeze the image, see through the skin"],
  ["R", "lift and return above site 27"],
  ["Esc", "emergency stop; Resume continues"],
  ["Drag beside the thigh", "turn the view; also middle drag or Alt + drag. Ctrl + wheel zooms"],
];

export function fillHelp(box: HTMLElement): void {
  for (const [keys, meaning] of KEYS) box.append(make("kbd", "", keys), make("span", "", meaning));
}
