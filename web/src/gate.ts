// The gate of pulsed Doppler: its beam, sample volume and angle cursor over the image, its buttons and keys.

import type { Connection } from "./connection";
import { beside, draw, find, make, press, pressed, stepper } from "./dom";
import { beamOf, type Face, FLAT, halfOf, lineOf, placeOf } from "./lines";
import type { Controls, GateKey, SpectrumFrame } from "./protocol";
import type { DopplerSound } from "./sound";

const STEP_MM = 0.5;
const FAST_MM = 2;
const SENT_MS = 25; // a hand that drags need not send more often than pictures come
const STEEP_DEG = 60; // beyond it a small error of the angle is a large one of the velocity
const CURSOR_MM = 9; // half of the angle cursor
const STEPS: Record<GateKey, number[]> = {
  gate_length_mm: [1, 1.5, 2, 3, 4, 6, 8, 10, 15],
  gate_steer_deg: [-20, 0, 20],
  gate_angle_deg: Array.from({ length: 81 }, (_, k) => 2 * k - 80),
  gate_scale_cm_s: [3, 5, 8, 10, 15, 20, 30, 40, 60, 80, 100, 150, 200],
  gate_baseline: [-0.75, -0.5, -0.25, 0, 0.25, 0.5, 0.75],
  gate_filter_hz: [20, 50, 100, 150, 200, 300, 500],
  gate_gain_db: Array.from({ length: 21 }, (_, k) => 3 * k - 30),
};

/** Over the image; the gate is dragged, its cursor turned. */
export class GateOverlay {
  readonly svg = draw("svg", { class: "doppler gate" }) as SVGSVGElement;
  moved: (mm: [number, number], last: boolean) => void = () => undefined;
  turned: (angle_deg: number) => void = () => undefined;
  enabled = true;
  private gate: SpectrumFrame | null = null;
  private wanted: [number, number] | null = null; // while it is dragged
  private scale = 1;
  private size_mm: [number, number] = [1, 1];
  private face = FLAT;
  private drag: { x: number; y: number; at: [number, number] } | null = null; // at: x and z
  private turns = false;
  private readonly beam = draw("path", { class: "beam" });
  private readonly walls = draw("path", { class: "walls" });
  private readonly cursor = draw("path", { class: "cursor" });
  private readonly body = draw("circle", { class: "grip", r: 15, tabindex: 0, role: "application", "aria-label": "Doppler gate: arrow keys move it" });
  private readonly end = draw("circle", { class: "grip end", r: 10, tabindex: 0, role: "application", "aria-label": "Angle cursor: left and right turn it" });

  constructor() {
    this.svg.append(this.beam, this.cursor, this.walls, this.body, this.end);
    this.body.addEventListener("pointerdown", (e) => this.down(e as PointerEvent));
    this.body.addEventListener("pointermove", (e) => this.move(e as PointerEvent));
    for (const name of ["pointerup", "pointercancel"]) this.body.addEventListener(name, () => this.drop());
    this.body.addEventListener("keydown", (e) => this.key(e as KeyboardEvent));
    this.end.addEventListener("pointerdown", (e) => {
      this.turns = this.enabled;
      this.end.setPointerCapture((e as PointerEvent).pointerId);
      e.preventDefault();
    });
    this.end.addEventListener("pointermove", (e) => this.turns && this.turn(e as PointerEvent));
    for (const name of ["pointerup", "pointercancel"]) this.end.addEventListener(name, () => (this.turns = false));
    this.end.addEventListener("keydown", (e) => this.turnByKey(e as KeyboardEvent));
    this.svg.style.display = "none";
  }

  show(gate: SpectrumFrame | null): void {
    this.gate = gate;
    this.svg.style.display = gate ? "" : "none";
    if (gate) this.paint(gate);
  }

  /** Also of a frozen image, whose spectrum is read along it. */
  angle(angle_deg: number): void {
    if (!this.gate || this.gate.angle_deg === angle_deg) return;
    this.gate = { ...this.gate, angle_deg };
    this.paint(this.gate);
  }

  layout(width_mm: number, height_mm: number, scale: number, face: Face): void {
    this.scale = scale;
    this.face = face;
    this.size_mm = [width_mm, height_mm];
    this.svg.setAttribute("viewBox", `0 0 ${width_mm * scale} ${height_mm * scale}`);
    if (this.gate) this.paint(this.gate);
  }

  private paint(gate: SpectrumFrame): void {
    const [line, depth_mm] = this.wanted ?? [gate.x_mm, gate.z_mm];
    const [x, z] = placeOf(this.face, line, depth_mm);
    const lean = beamOf(this.face, line, (gate.steer_deg * Math.PI) / 180);
    const flow = lean + (gate.angle_deg * Math.PI) / 180;
    const px = (across: number, depth: number): [number, number] => [(across + this.size_mm[0] / 2) * this.scale, (depth - this.face.top_mm) * this.scale];
    const at = (across: number, depth: number): string => px(across, depth).map((v) => v.toFixed(1)).join(" ");
    const along = (mm: number): [number, number] => [x + mm * Math.sin(lean), z + mm * Math.cos(lean)];
    const half = gate.length_mm / 2;
    const slant = this.face.radius_mm > 0 ? 1 : Math.cos(lean); // depths of a fan are along its lines
    const [top, bottom] = [-depth_mm / slant, (this.size_mm[1] + this.face.top_mm - depth_mm) / slant];
    this.beam.setAttribute("d", `M${at(...along(top))} L${at(...along(-half))} M${at(...along(half))} L${at(...along(bottom))}`);
    const wall = (mm: number): string => {
      const [ax, az] = along(mm);
      const [c, s] = [2.2 * Math.cos(lean), -2.2 * Math.sin(lean)];
      return `M${at(ax - c, az - s)} L${at(ax + c, az + s)}`;
    };
    this.walls.setAttribute("d", `${wall(-half)} ${wall(half)}`);
    const [fx, fz] = [Math.sin(flow) * CURSOR_MM, Math.cos(flow) * CURSOR_MM];
    this.cursor.setAttribute("d", `M${at(x - fx, z - fz)} L${at(x - 0.25 * fx, z - 0.25 * fz)} M${at(x + 0.25 * fx, z + 0.25 * fz)} L${at(x + fx, z + fz)}`);
    const place = (circle: SVGElement, [cx, cy]: [number, number]): void => {
      circle.setAttribute("cx", cx.toFixed(1));
      circle.setAttribute("cy", cy.toFixed(1));
    };
    place(this.body, px(x, z));
    place(this.end, px(x + fx, z + fz));
    this.svg.classList.toggle("still", !this.enabled);
  }

  private down(e: PointerEvent): void {
    if (!this.gate || !this.enabled) return;
    this.drag = { x: e.clientX, y: e.clientY, at: placeOf(this.face, this.gate.x_mm, this.gate.z_mm) };
    this.body.setPointerCapture(e.pointerId);
    e.preventDefault();
  }

  private move(e: PointerEvent): void {
    if (!this.drag) return;
    const { x, y, at } = this.drag;
    this.put(...lineOf(this.face, at[0] + (e.clientX - x) / this.scale, at[1] + (e.clientY - y) / this.scale));
  }

  private drop(): void {
    this.drag = null;
    if (this.wanted) this.moved(this.wanted, true);
    this.wanted = null;
  }

  private put(line: number, depth_mm: number): void {
    const half = halfOf(this.face, this.size_mm[0]);
    this.wanted = [Math.max(-half, Math.min(half, line)), Math.max(1, Math.min(this.size_mm[1] + this.face.top_mm - 1, depth_mm))];
    this.moved(this.wanted, false);
    if (this.gate) this.paint(this.gate);
  }

  private key(e: KeyboardEvent): void {
    const step: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = step[e.key];
    if (!way || !this.gate || !this.enabled) return;
    const far = e.shiftKey ? FAST_MM : STEP_MM;
    this.put(this.gate.x_mm + way[0] * far, this.gate.z_mm + way[1] * far);
    this.drop();
    e.preventDefault();
    e.stopPropagation();
  }

  private turn(e: PointerEvent): void {
    if (!this.gate) return;
    const at = this.svg.getBoundingClientRect();
    const [gx, gz] = placeOf(this.face, this.gate.x_mm, this.gate.z_mm);
    const x = (e.clientX - at.left) / this.scale - this.size_mm[0] / 2 - gx;
    const z = (e.clientY - at.top) / this.scale + this.face.top_mm - gz;
    const beam = beamOf(this.face, this.gate.x_mm, (this.gate.steer_deg * Math.PI) / 180);
    let angle = ((Math.atan2(x, z) - beam) * 180) / Math.PI;
    if (angle > 90) angle -= 180;
    if (angle < -90) angle += 180;
    this.turned(Math.max(-80, Math.min(80, Math.round(angle))));
  }

  private turnByKey(e: KeyboardEvent): void {
    const way = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
    if (!way || !this.gate || !this.enabled) return;
    this.turned(Math.max(-80, Math.min(80, Math.round(this.gate.angle_deg) + way * (e.shiftKey ? 10 : 2))));
    e.preventDefault();
    e.stopPropagation();
  }
}

const WORDS: [GateKey, string, string, (value: number) => string][] = [
  ["gate_length_mm", "Gate", "length of the sample volume", (v) => `${v} mm`],
  ["gate_steer_deg", "Beam", "lean of the Doppler beam", (v) => `${v.toFixed(0)}°`],
  ["gate_angle_deg", "Angle", "between the beam and the cursor along the vessel", (v) => `${v.toFixed(0)}°`],
  ["gate_scale_cm_s", "Scale", "velocity along the beam from which the spectrum folds", (v) => `${v.toFixed(0)} cm/s`],
  ["gate_baseline", "Base", "where the base line lies", (v) => (v === 0 ? "middle" : v > 0 ? `low ${v}` : `high ${-v}`)],
  ["gate_filter_hz", "Filter", "slower shifts are left out", (v) => `${v.toFixed(0)} Hz`],
  ["gate_gain_db", "Gain", "brightness of the spectrum", (v) => `${v.toFixed(0)} dB`],
];

/** The buttons of the gate and of its sound. */
export class GateTools {
  private controls: Controls | null = null;
  private sent = 0;
  private readonly values = new Map<GateKey, HTMLElement>();

  constructor(
    private readonly connection: Connection,
    private readonly overlay: GateOverlay,
    private readonly sound: DopplerSound,
  ) {
    press("pulsed", () => this.toggle());
    const box = find("gate-tools");
    for (const [key, name, title] of WORDS) {
      const output = make("output");
      this.values.set(key, output);
      const row = stepper(`gate-${name.toLowerCase()}`, name, output, (way) => this.step(key, way), title);
      row.id = `gate-${name.toLowerCase()}`;
      box.append(row);
    }
    press("doppler-sound", () => this.hear(!sound.on));
    const volume = find<HTMLInputElement>("doppler-volume");
    volume.oninput = () => sound.volume(volume.valueAsNumber);
    box.append(find("sound-box"));
    overlay.moved = (mm, last) => {
      const now = performance.now();
      if (!last && now - this.sent < SENT_MS) return;
      this.connection.gate({ gate_mm: mm });
      this.sent = now;
    };
    overlay.turned = (angle) => this.connection.gate({ gate_angle_deg: angle });
  }

  set(controls: Controls): void {
    this.controls = controls;
    const on = controls.gate ?? false;
    this.overlay.enabled = controls.controls;
    find("pulsed").hidden = controls.gate === undefined;
    find("gate-beam").hidden = controls.gate_steer_deg === undefined; // the lines of a fan do not lean
    find("gate-tools").hidden = !on;
    pressed("pulsed", on);
    if (!on && this.sound.on) this.hear(false);
    for (const each of document.querySelectorAll<HTMLButtonElement>("#pulsed, #gate-tools .stepper button")) each.disabled = !controls.controls;
    for (const [key, , , words] of WORDS) this.values.get(key)!.textContent = words(controls[key] ?? 0);
    const steep = Math.abs(controls.gate_angle_deg ?? 0) > STEEP_DEG;
    this.values.get("gate_angle_deg")!.classList.toggle("warn", steep);
    if (controls.gate_angle_deg !== undefined) this.overlay.angle(controls.gate_angle_deg);
  }

  key(code: string, shift: boolean): boolean {
    if (!this.controls?.controls || this.controls.gate === undefined || code !== "KeyP" || !shift) return false;
    this.toggle();
    return true;
  }

  private toggle(): void {
    this.connection.gate({ gate: !this.controls?.gate });
  }

  private hear(on: boolean): void {
    this.sound.switch(on);
    pressed("doppler-sound", on);
    find("doppler-volume").hidden = !on;
  }

  private step(key: GateKey, way: number): void {
    this.connection.gate({ [key]: beside(STEPS[key], this.controls?.[key] ?? 0, way) });
  }
}
