// Mouse, touch and keys -> the operator's hold of the probe.

import * as THREE from "three";
import { add, length, sub, type Hold } from "./pose";
import type { Site, Vec3 } from "./protocol";
import type { LegScene } from "./scene";

const FAR_MM = 30;      // a click farther than this lifts the probe first
const SITE_MM = 4;      // a click this near to a site goes to the site
const LIFTED_MM = -8;
const STEP_RAD = (5 * Math.PI) / 180;
const SPACE_MM_S = 8;   // progressive press
const FINGER_MM = 0.15; // press per pixel of a drag

export interface InputActions {
  moved(): void;
  probe(index: number): void;
  nextCase(): void;
  freeze(): void;
  seeThrough(): void;
  reset(): void;
  stop(): void;
  help(): void;
  sites(): readonly Site[];
  /** a key of the page; true when it was one of its own */
  key(code: string, shift: boolean): boolean;
}

type Drag = { kind: "slide" | "press"; x: number; y: number; moved: boolean } | null;

export class Input {
  enabled = true;
  private drag: Drag = null;
  private space = 0;
  private last_s = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly scene: LegScene,
    private readonly hold: Hold,
    private readonly actions: InputActions,
  ) {
    canvas.addEventListener("pointerdown", (e) => this.down(e), { capture: true });
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointercancel", (e) => {
      this.drag = null;
      this.fingers.delete(e.pointerId);
    });
    canvas.addEventListener("pointerleave", () => this.scene.hover(null, null));
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    window.addEventListener("keydown", (e) => this.key(e));
    window.addEventListener("keyup", (e) => e.code === "Space" && (this.space = 0));
    window.addEventListener("blur", () => (this.space = 0));
  }

  /** Two fingers: up and down presses, apart zooms. */
  private readonly fingers = new Map<number, { x: number; y: number }>();
  private twoFingers(e: PointerEvent): void {
    const before = [...this.fingers.values()].map((f) => ({ ...f }));
    this.fingers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    const after = [...this.fingers.values()];
    const [a, b, c, d] = [before[0]!, before[1]!, after[0]!, after[1]!];
    this.press(((c.y + d.y - a.y - b.y) / 2) * FINGER_MM);
    const apart = Math.hypot(d.x - c.x, d.y - c.y);
    if (apart > 1) this.scene.zoom(Math.hypot(b.x - a.x, b.y - a.y) / apart);
  }

  private down(e: PointerEvent): void {
    this.canvas.focus();
    if (e.pointerType === "touch") this.fingers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (this.fingers.size > 1) {
      this.drag = null;
      return;
    }
    const left = e.button === 0 && !e.altKey;
    const point = left && this.enabled ? this.scene.pick(e.clientX, e.clientY) : null;
    // Beside the thigh, and with Alt, the left button turns the view.
    this.scene.orbit.mouseButtons.LEFT = e.button === 0 && !point ? THREE.MOUSE.ROTATE : null;
    this.scene.orbit.touches.ONE = point ? null : THREE.TOUCH.ROTATE;
    if (!this.enabled) return;
    if (e.button === 2) this.drag = { kind: "press", x: e.clientX, y: e.clientY, moved: false };
    if (!point) return;
    this.drag = { kind: "slide", x: e.clientX, y: e.clientY, moved: false };
    this.canvas.setPointerCapture(e.pointerId);
    if (length(sub(point, this.hold.point)) > FAR_MM) this.hold.setDepth(LIFTED_MM);
    this.place(point);
  }

  private move(e: PointerEvent): void {
    if (this.fingers.size === 2 && this.fingers.has(e.pointerId)) return this.twoFingers(e);
    const point = e.buttons === 0 || this.drag?.kind === "slide" ? this.scene.pick(e.clientX, e.clientY) : null;
    this.canvas.classList.toggle("over", point !== null);
    this.scene.hover(e.buttons === 0 ? point : null, point && this.scene.skin ? this.scene.skin.normalAt(point) : null);
    if (!this.drag) return;
    if (Math.hypot(e.clientX - this.drag.x, e.clientY - this.drag.y) > 3) this.drag.moved = true;
    if (this.drag.kind === "slide" && point && this.drag.moved) this.place(point);
    if (this.drag.kind === "press") {
      this.press((e.clientY - this.drag.y) * FINGER_MM);
      this.drag.y = e.clientY;
    }
  }

  private up(e: PointerEvent): void {
    this.fingers.delete(e.pointerId);
    const drag = this.drag;
    this.drag = null;
    if (!drag || drag.kind !== "slide" || drag.moved) return;
    const point = this.scene.pick(e.clientX, e.clientY);
    const site = point && this.actions.sites().find((s) => length(sub(s.position_mm, point)) < SITE_MM);
    if (!site) return;
    this.hold.atSite(site);
    this.actions.moved();
  }

  private place(point: Vec3): void {
    if (!this.scene.skin) return;
    this.hold.at(point, this.scene.skin.normalAt(point));
    this.actions.moved();
  }

  private press(by_mm: number): void {
    if (!this.enabled) return;
    this.hold.setDepth(this.hold.depth_mm + by_mm);
    this.actions.moved();
  }

  private wheel(e: WheelEvent): void {
    e.preventDefault();
    const delta = e.deltaY || e.deltaX; // Shift turns the wheel sideways
    const notches = Math.max(-3, Math.min(3, delta / (e.deltaMode === 0 ? 100 : 3)));
    if (e.ctrlKey) this.scene.zoom(1.1 ** notches);
    else this.press(-notches * (e.shiftKey ? 5 : 1));
  }

  /** Slides along the skin in the plane of the face. */
  private slide(x_mm: number, y_mm: number): void {
    const [x, y] = this.hold.axes();
    const wanted = add(add(this.hold.point, x, x_mm), y, y_mm);
    const point = this.scene.project(wanted, this.hold.normal);
    if (point) this.place(point);
  }

  /** Turns the probe about its beam by steps of a key. */
  turnBy(steps: number): void {
    if (this.enabled) this.turn({ rotation: steps * STEP_RAD });
  }

  private turn(change: Partial<Pick<Hold, "rotation" | "tiltX" | "tiltY">>): void {
    for (const [axis, by] of Object.entries(change) as ["rotation" | "tiltX" | "tiltY", number][]) {
      const limit = axis === "rotation" ? Math.PI : Math.PI / 4;
      this.hold[axis] = Math.max(-limit, Math.min(limit, this.hold[axis] + by));
    }
    this.actions.moved();
  }

  /** Keys that belong to a field, a focused button, a dialog or the browser. */
  private static taken(e: KeyboardEvent): boolean {
    const inField = e.target instanceof HTMLInputElement || e.target instanceof HTMLSelectElement || e.target instanceof HTMLTextAreaElement;
    const onButton = e.target instanceof HTMLElement && e.target.closest("button, a, [role=radio]") !== null;
    const ownsKey = onButton && (e.code === "Space" || (e.code === "Enter" && !e.shiftKey));
    const open = document.querySelector("dialog[open]") !== null;
    return inField || ownsKey || open || e.ctrlKey || e.metaKey || e.altKey;
  }

  private key(e: KeyboardEvent): void {
    if (e.key === "Escape" && !document.querySelector("dialog[open]")) return this.actions.stop();
    if (Input.taken(e)) return;
    if (this.actions.key(e.code, e.shiftKey)) return e.preventDefault();
    const step = e.shiftKey ? 5 : 1;
    const keys: Record<string, () => void> = {
      ArrowUp: () => this.press(step),
      ArrowDown: () => this.press(-step),
      KeyW: () => this.press(step),
      KeyS: () => this.press(-step),
      KeyA: () => this.slide(-2 * step, 0),
      KeyD: () => this.slide(2 * step, 0),
      ArrowLeft: () => this.slide(0, 2 * step),
      ArrowRight: () => this.slide(0, -2 * step),
      KeyQ: () => this.turn({ rotation: -STEP_RAD }),
      KeyE: () => this.turn({ rotation: STEP_RAD }),
      KeyT: () => this.turn({ tiltY: STEP_RAD }),
      KeyG: () => this.turn({ tiltY: -STEP_RAD }),
      KeyY: () => this.turn({ tiltX: STEP_RAD }),
      KeyH: () => this.turn({ tiltX: -STEP_RAD }),
      Space: () => (this.space = e.shiftKey ? -1 : 1),
      KeyC: () => this.actions.nextCase(),
      KeyF: () => this.actions.freeze(),
      KeyX: () => this.actions.seeThrough(),
      KeyR: () => this.actions.reset(),
    };
    const digit = /^Digit([1-9])$/.exec(e.code);
    const action = e.key === "?" ? () => this.actions.help() : keys[e.code];
    const watching = ["KeyF", "KeyX"].includes(e.code) || e.key === "?";
    if (!action && !digit) return;
    e.preventDefault();
    if (!this.enabled && !watching) return;
    if (digit && e.key !== "?") this.actions.probe(Number(digit[1]) - 1);
    else action?.();
  }

  /** A key presses the probe as long as it is held. */
  get holds(): boolean {
    return this.space !== 0;
  }

  /** Called once per picture. */
  tick(now_s: number): void {
    const dt_s = Math.min(0.1, now_s - this.last_s);
    this.last_s = now_s;
    if (this.space !== 0) this.press(this.space * SPACE_MM_S * dt_s);
  }
}
