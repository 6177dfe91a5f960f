// The probe and the patient: probe, position, strain, gel; and in free practice the vein and the tissue.

import type { Connection, TissueKey } from "./connection";
import { find, label, make, press, pressed, release } from "./dom";
import { Chips } from "./panel";
import type { Exam, Controls, Hello, Posture } from "./protocol";
import { amid, shown, t } from "./words/language";

const POSTURES: Posture[] = ["supine", "sitting", "standing"];
const SCALES: { key: TissueKey; name: string }[] = [
  { key: "stiffness_scale", name: t("tissue.stiffness") },
  { key: "damping_scale", name: t("tissue.damping") },
  { key: "friction_scale", name: t("tissue.friction") },
];

/** Chips have little room: "partial_mural" -> "Partial". */
function shortCase(name: string): string {
  return label(name.split("_")[0] ?? name);
}

export class PatientTools {
  private controls: Controls | null = null;
  private readonly probes = find<HTMLSelectElement>("probes");
  private readonly posture = find<HTMLSelectElement>("posture");
  private readonly position = find<HTMLSelectElement>("position");
  private readonly cases: Chips;
  private readonly scales = new Map<TissueKey, { input: HTMLInputElement; output: HTMLElement }>();

  constructor(private readonly connection: Connection) {
    this.cases = new Chips(find("cases"), (name) => connection.pathology(name), shortCase);
    this.probes.onchange = () => (connection.probe(this.probes.value), release(this.probes));
    this.posture.onchange = () => (connection.posture(this.posture.value as Posture), release(this.posture));
    this.position.onchange = () => (connection.position(this.position.value), release(this.position));
    press("valsalva", () => this.strain());
    press("gel-put", () => connection.gel("put"));
    press("gel-wipe", () => connection.gel("wipe"));
    press("tissue-button", () => this.openTissue(find("tissue").hidden));
    this.buildTissue();
  }

  greet(hello: Hello): void {
    const option = (name: string): HTMLOptionElement => Object.assign(make("option", "", amid(label(name))), { value: name });
    this.probes.replaceChildren(...hello.probes.map((p) => option(p.name)));
    this.cases.fill(hello.cases);
  }

  set(controls: Controls): void {
    this.controls = controls;
    const mine = controls.controls;
    this.probes.value = controls.probe;
    this.cases.press(controls.case);
    this.cases.enable(mine);
    find("posture-box").hidden = controls.posture === undefined;
    this.posture.value = controls.posture ?? "supine";
    find("valsalva").hidden = controls.valsalva === undefined;
    pressed("valsalva", controls.valsalva ?? false);
    find("gel-box").hidden = !controls.gel;
    const ml = controls.gel_ml ?? 0;
    find("gel-put").textContent = ml > 0.05 ? t("gel.ml", { ml: ml.toFixed(0) }) : t("page.gel_put");
    for (const id of ["probes", "posture", "valsalva", "gel-put", "gel-wipe"]) find<HTMLButtonElement>(id).disabled = !mine;
    find<HTMLButtonElement>("gel-wipe").disabled ||= ml < 0.05;
    find("tissue-button").hidden = controls.stiffness_scale === undefined;
    for (const [key, { input, output }] of this.scales) {
      const value = controls[key] ?? 1;
      input.disabled = !mine;
      if (document.activeElement !== input) input.value = String(value);
      output.textContent = `${shown(value, 2)} ×`;
    }
  }

  /** The positions of an exam; the one that comes next is marked. */
  turns(exam: Exam): void {
    const all = exam.phase === "running" ? (exam.positions ?? []) : [];
    find("position-box").hidden = all.length < 2;
    find("position-box").classList.toggle("due", (exam.step.position ?? "") !== "");
    const key = all.map((p) => p.id).join();
    if (this.position.dataset.key !== key) {
      this.position.dataset.key = key;
      this.position.replaceChildren(...all.map((p) => Object.assign(make("option", "", p.title), { value: p.id })));
    }
    if (document.activeElement !== this.position) this.position.value = exam.position ?? "";
    this.position.disabled = !this.controls?.controls;
  }

  key(code: string, shift: boolean): boolean {
    const c = this.controls;
    if (!c?.controls) return false;
    if (code === "KeyP" && !find("position-box").hidden) {
      const all = [...this.position.options];
      this.connection.position(all[(all.findIndex((o) => o.value === this.position.value) + 1) % all.length]!.value);
      return true;
    }
    if (code === "KeyP" && c.posture) this.connection.posture(POSTURES[(POSTURES.indexOf(this.connection.wishes.get("posture") ?? c.posture) + 1) % 3]!);
    else if (code === "KeyV" && c.valsalva !== undefined) this.strain();
    else if (code === "KeyZ" && c.gel) this.connection.gel(shift ? "wipe" : "put");
    else return false;
    return true;
  }

  private strain(): void {
    this.connection.valsalva(!(this.connection.wishes.get("valsalva") ?? false));
  }

  // ---- tissue ----------------------------------------------------------------------------------

  private buildTissue(): void {
    const box = find("tissue");
    box.append(make("p", "caption", t("tissue.note")));
    for (const { key, name } of SCALES) {
      const row = make("label", "slider");
      const output = make("output", "", `${shown(1, 2)} ×`);
      const input = make("input");
      input.setAttribute("aria-label", t("tissue.times", { name }));
      Object.assign(input, { type: "range", min: 0.5, max: 2, step: 0.05, value: 1 });
      input.oninput = () => {
        output.textContent = `${shown(input.valueAsNumber, 2)} ×`;
        this.connection.set(key, input.valueAsNumber);
      };
      input.onchange = () => release(input);
      row.append(make("span", "caption", name), output, input);
      box.append(row);
      this.scales.set(key, { input, output });
    }
    const reset = make("button", "", t("tissue.reset"));
    reset.type = "button";
    reset.onclick = () => SCALES.forEach(({ key }) => this.connection.set(key, 1));
    box.append(reset);
    box.onkeydown = (e) => e.key === "Escape" && (this.openTissue(false), find("tissue-button").focus(), e.stopPropagation());
    window.addEventListener("pointerdown", (e) => {
      const inside = (e.target as Element).closest("#tissue, #tissue-button");
      if (!inside) this.openTissue(false);
    });
  }

  openTissue(open: boolean): void {
    const anchor = find("tissue-button").getBoundingClientRect();
    Object.assign(find("tissue").style, { left: `${anchor.left}px`, top: `${anchor.bottom + 6}px` });
    find("tissue").hidden = !open;
    find("tissue-button").setAttribute("aria-expanded", String(open));
  }
}
