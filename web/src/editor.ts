// The case editor: a teacher writes a patient beside the leg that the program makes of the text. Veins are pointed at
// on the leg. Text and form are the same case; the text is what is checked, kept and shared.

import { answer, clots, copyOf, fresh, placeOf, read, segmentTitle, shareOf, write, type Clot, type DraftLeg, type DraftMessage, type Form, type Lesion } from "./draft";
import { announce, button, find, label, make, press } from "./dom";
import { choiceField, numberField, textField } from "./fields";
import type { Controls, Hello, Phase } from "./protocol";
import type { LegScene, VesselMark, VesselPoint } from "./scene";
import { LEVELS } from "./words";

const VIEWS = ["Case", "Leg", "Findings", "Answer", "Text"] as const;
type View = (typeof VIEWS)[number];
const LESIONS = ["node", "cyst", "haematoma"];
const POSITIONS = ["supine_turned", "prone_bent", "supine", "prone", "standing", "sitting"];
const FIRST_PARAMETERS = ["age-y", "stature-cm", "bmi"];
const MAIN_PART = 2, FIRST_PART = 256; // of the geometry
const CLICK_PX = 5; // a pointer that moved farther has turned the leg
const AGAIN_MS = 2000; // after a lost connection: an answer that was under way comes first
const KEPT = "sonde.draft"; // of this tab: a page that is loaded anew goes on

export interface EditorActions {
  send(message: { action: string; [key: string]: unknown }): void;
  /** asks for control, for a teacher who has not got it */
  control(): void;
  changed(): void;
}

export class Editor {
  isOpen = false;
  private text = "";
  private form: Form | null = null;
  private view: View = "Case";
  private hello: Hello | null = null;
  private draft: DraftMessage | null = null;
  private serial = 0;
  private busy = false;
  private asked = ""; // the action that is under way
  private last: { action: string; [key: string]: unknown } | null = null; // its message
  private copies = false; // what is opened next is a copy
  private follows = true; // the answer follows the findings
  private points: Clot | Lesion | "clot" | null = null; // what the next click on the leg is for
  private first: VesselPoint | null = null; // where the clot begins that is being pointed out
  private tried = false; // an exam of the draft is under way
  private down: [number, number] | null = null;
  private readonly box = find("editor");

  constructor(
    private readonly scene: LegScene,
    private readonly actions: EditorActions,
  ) {
    press("edit-button", () => (this.isOpen ? this.close() : this.open()));
    const canvas = find<HTMLCanvasElement>("scene");
    canvas.addEventListener("pointerdown", (e) => (this.down = e.button === 0 ? [e.clientX, e.clientY] : null));
    canvas.addEventListener("pointerup", (e) => {
      const from = this.down;
      this.down = null;
      if (this.isOpen && from && Math.hypot(e.clientX - from[0], e.clientY - from[1]) < CLICK_PX) this.point(e.clientX, e.clientY);
    });
  }

  greet(hello: Hello): void {
    this.hello = hello;
    if (this.isOpen && this.text === "") this.build();
  }

  /** Only who has the teacher's address writes cases. */
  set(controls: Controls): void {
    find("edit-button").hidden = controls.role !== "teacher" || !this.hello?.trainer;
  }

  /** The connection is back: what was asked while it was lost is asked again. */
  again(): void {
    window.setTimeout(() => this.busy && this.last && this.actions.send(this.last), AGAIN_MS);
  }

  /** An exam of the draft takes the page, and gives it back. */
  follow(phase: Phase): void {
    if (this.isOpen && phase === "running") this.show(false);
    else if (this.tried && phase === "practice") {
      this.tried = false;
      this.show(true);
      this.send("check");
    } else if (!this.isOpen && phase === "edit" && !find("edit-button").hidden) this.open();
  }

  hear(draft: DraftMessage): void {
    this.draft = draft;
    if (draft.serial !== this.serial) return;
    this.busy = false;
    if (draft.text !== undefined) {
      const form = read(draft.text);
      if (typeof form === "string") this.load(draft.text);
      else this.load(write(this.copies ? copyOf(form) : form));
      return;
    }
    const before = JSON.stringify(this.form?.truth);
    if (!draft.good && this.form && this.follows && answer(this.form, draft) && JSON.stringify(this.form.truth) !== before) {
      this.text = write(this.form);
      return this.send(this.asked); // with the answer that belongs to this leg
    }
    if (this.asked === "save" && draft.saved) announce(`Saved as ${draft.saved}`);
    if (this.asked === "try" && draft.good) this.tried = true;
    this.build();
  }

  /** For tests: what the program said of the text as it stands, or null. */
  get told(): DraftMessage | null {
    return this.draft?.serial === this.serial && !this.busy ? this.draft : null;
  }

  private open(): void {
    const kept = sessionStorage.getItem(KEPT) ?? "";
    this.show(true);
    if (this.text) this.send("check");
    else if (kept) this.load(kept);
  }

  private close(): void {
    this.actions.send({ action: "close" });
    this.show(false);
    this.tried = false;
  }

  private show(on: boolean): void {
    this.isOpen = on;
    this.box.hidden = !on;
    document.body.classList.toggle("editing", on);
    find("edit-button").setAttribute("aria-pressed", String(on));
    this.points = this.first = null;
    if (on) this.build();
    this.mark();
    this.actions.changed();
  }

  // ---- text and form ---------------------------------------------------------------------------

  private load(text: string): void {
    const form = read(text);
    this.text = text;
    this.form = typeof form === "string" ? null : form;
    this.follows = true;
    this.view = this.form ? "Case" : "Text";
    this.keep();
    this.send("check");
  }

  private keep(): void {
    sessionStorage.setItem(KEPT, this.text);
  }

  /** The form was changed. `known`: the leg is the one that the program has shown. */
  private change(rebuild = false): void {
    if (!this.form) return;
    if (this.follows && this.draft) answer(this.form, this.draft);
    this.text = write(this.form);
    this.keep();
    this.stale();
    this.mark();
    if (rebuild) this.build();
  }

  private send(action: string, more: object = {}): void {
    this.busy = true;
    this.asked = action;
    this.last = { action, serial: ++this.serial, text: this.text, ...more };
    this.actions.send(this.last);
    this.build();
  }

  private openCase(id: string, copies: boolean): void {
    this.copies = copies;
    this.busy = true;
    this.asked = "open";
    this.last = { action: "open", case: id, serial: ++this.serial };
    this.actions.send(this.last);
    this.build();
  }

  private tryIt(): void {
    this.actions.control();
    this.send("try", { protocol: find<HTMLSelectElement>("editor-protocol").value });
  }

  private download(): void {
    const link = make("a");
    link.href = URL.createObjectURL(new Blob([this.text], { type: "application/yaml" }));
    link.download = `${this.form?.id || "case"}.yaml`;
    link.click();
    window.setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  // ---- what is seen ----------------------------------------------------------------------------

  private build(): void {
    if (!this.isOpen) return;
    const focused = (document.activeElement as HTMLElement | null)?.id ?? "";
    if (this.text === "") this.box.replaceChildren(...this.choose());
    else this.box.replaceChildren(this.head(), this.state(), this.tabs(), this.body(), this.foot());
    if (focused && this.box.querySelector(`#${CSS.escape(focused)}`)) find(focused).focus();
  }

  private choose(): HTMLElement[] {
    const head = make("h2", "", "Write a case");
    const row = make("div", "actions");
    const begin = button("New case", () => this.load(write(fresh())), "primary");
    begin.id = "editor-new";
    const close = button("Close", () => this.close());
    row.append(begin, this.openFile(), make("span", "spring"), close);
    const list = make("ul", "editor-cases");
    for (const c of this.hello?.case_list ?? []) {
      const item = make("li");
      const words = make("span", "words");
      words.append(make("b", "", c.title), make("span", "caption", `${LEVELS[c.level]}${c.own ? ", your own" : ""}`));
      item.append(words);
      if (c.own) item.append(button("Edit", () => this.openCase(c.id, false)));
      item.append(button("Copy", () => this.openCase(c.id, true)));
      list.append(item);
    }
    const state = make("p", "caption", this.busy ? "Opening the case …" : this.failed());
    return [head, row, state, make("div", "caption", "Or start from a patient that is there:"), list];
  }

  private failed(): string {
    return this.draft && this.draft.serial === this.serial ? this.draft.message : "";
  }

  private openFile(): HTMLElement {
    const input = make("input");
    Object.assign(input, { type: "file", accept: ".yaml,.yml", id: "editor-file", className: "unseen" });
    input.onchange = () => void input.files?.[0]?.text().then((text) => this.load(text));
    const words = make("label", "button", "Open a file");
    words.htmlFor = "editor-file";
    const box = make("span");
    box.append(input, words);
    return box;
  }

  private head(): HTMLElement {
    const row = make("div", "actions");
    const other = button("Other case", () => {
      this.text = "";
      this.form = null;
      sessionStorage.removeItem(KEPT);
      this.mark();
      this.build();
    });
    const title = make("b", "editor-title", this.form?.title ?? "A case");
    row.append(title, make("span", "spring"), other, button("Close", () => this.close()));
    return row;
  }

  private words(): [string, string] {
    const d = this.draft;
    if (this.busy) return ["caption", "The program makes the leg and checks the case …"];
    if (!d || d.serial !== this.serial) return ["caption", "Not checked since the last change."];
    if (this.asked === "save" && d.saved) return ["good", `Saved: ${d.saved}`];
    return d.message ? ["bad", d.message] : ["good", "The case is right: text, leg, findings and answer agree."];
  }

  private state(): HTMLElement {
    const [tone, words] = this.words();
    const line = make("p", `editor-state ${tone}`, words);
    line.id = "editor-state";
    line.setAttribute("role", "status");
    return line;
  }

  /** What was checked is not what stands there any more. */
  private stale(): void {
    this.serial++;
    const [tone, words] = this.words();
    const line = document.getElementById("editor-state");
    if (line) Object.assign(line, { className: `editor-state ${tone}`, textContent: words });
    const title = this.box.querySelector(".editor-title");
    if (title) title.textContent = this.form?.title ?? "A case";
    find("editor-save").textContent = "Save";
  }

  private tabs(): HTMLElement {
    const box = make("div", "chips");
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", "Part of the case");
    for (const view of VIEWS) {
      const chip = button(view, () => {
        this.view = view;
        this.build();
      });
      chip.id = `editor-tab-${view.toLowerCase()}`;
      chip.setAttribute("aria-pressed", String(view === this.view));
      chip.disabled = this.form === null && view !== "Text";
      box.append(chip);
    }
    return box;
  }

  private foot(): HTMLElement {
    const row = make("div", "actions editor-foot");
    const check = button("Check", () => this.send("check"), this.draft?.serial === this.serial ? "" : "primary");
    check.id = "editor-check";
    const replaces = this.draft?.serial === this.serial && this.draft.exists;
    const save = button(replaces ? "Replace mine" : "Save", () => this.send("save", { replace: replaces }));
    save.id = "editor-save";
    const download = button("Download", () => this.download());
    download.id = "editor-download";
    const protocol = make("select");
    protocol.id = "editor-protocol";
    protocol.setAttribute("aria-label", "Protocol of the trial");
    for (const p of this.hello?.protocols ?? []) protocol.append(Object.assign(make("option", "", p.title), { value: p.id }));
    const go = button("Try it", () => this.tryIt());
    go.id = "editor-try";
    for (const one of [check, save, go]) one.disabled = this.busy;
    row.append(check, save, download, make("span", "spring"), protocol, go);
    return row;
  }

  private body(): HTMLElement {
    const box = make("div", "editor-body");
    const f = this.form;
    if (this.view === "Text" || !f) box.append(this.textView());
    else if (this.view === "Case") box.append(...this.caseView(f));
    else if (this.view === "Leg") box.append(...this.legView(f));
    else if (this.view === "Findings") box.append(...this.findingsView(f));
    else box.append(...this.answerView(f));
    return box;
  }

  private caseView(f: Form): HTMLElement[] {
    const set = (key: "id" | "title" | "history" | "note") => (v: string): void => ((f[key] = v), this.change());
    return [
      textField("editor-id", "Id: a-z, 0-9, - and _; the name of its file", f.id, 47, set("id")),
      textField("editor-name", "Title", f.title, 95, set("title")),
      choiceField("editor-level", "Level", ["first", "easy", "hard"], f.level, (v) => ((f.level = v), this.change()), (v) => LEVELS[v as keyof typeof LEVELS]),
      textField("editor-history", "History: what the learner reads before the exam", f.history, 1000, set("history"), 4),
      textField("editor-note", "Note: what the case teaches, read after it", f.note ?? "", 1000, set("note"), 5),
    ];
  }

  private legView(f: Form): HTMLElement[] {
    if (!f.leg) return [make("p", "", "This case has a thigh instead of a whole leg. Its thigh is edited as text.")];
    const leg = f.leg;
    const put = (key: string) => (v: number | string | null): void => {
      if (v === null || v === "") delete leg[key];
      else leg[key] = v;
      this.change();
    };
    const value = (key: string): number | null => (typeof leg[key] === "number" ? (leg[key] as number) : null);
    const another = button("Another leg", () => (put("seed")(1 + Math.floor(Math.random() * 9999)), this.send("check")));
    another.title = "Draws what is not given anew: build, muscles, the course of the veins";
    const known = this.draft?.parameters ?? [];
    const fields = (keys: string[]): HTMLElement[] =>
      keys.flatMap((key) => {
        const p = known.find((one) => one.key === key);
        const unit = /-(mm|cm|deg)$/.exec(key)?.[1] ?? "";
        return p ? [numberField(`editor-${key}`, `${p.text.charAt(0).toUpperCase()}${p.text.slice(1)}${unit && `, ${unit}`}`, value(key), p.low, p.high, "drawn", put(key))] : [];
      });
    const more = make("details");
    more.append(make("summary", "", "More measures"), ...fields(known.map((p) => p.key).filter((key) => !FIRST_PARAMETERS.includes(key))));
    const flow = (f.circulation ??= {});
    const seed = make("div", "editor-row");
    seed.append(numberField("editor-seed", "Seed", value("seed"), 0, 4294967295, "1", put("seed")), another);
    const names = (this.draft?.branches ?? []).map((name) => name.replace(/_/g, " ")).join(", ");
    return [
      seed,
      choiceField("editor-sex", "Sex", ["female", "male", "drawn"], String(leg.sex ?? "drawn"), put("sex")),
      choiceField("editor-side", "Side", ["right", "left"], String(leg.side ?? "right"), put("side")),
      ...fields(FIRST_PARAMETERS),
      choiceField("editor-position", "Position at first", ["", ...POSITIONS], String(leg.position ?? ""), put("position"), (v) => (v ? label(v) : "Straight, lying")),
      numberField("editor-leak", "Valves that leak: 0 none, 1 fully", typeof flow.valve_leak === "number" ? flow.valve_leak : null, 0, 1, "0", (v) => {
        if (v === null) delete flow.valve_leak;
        else flow.valve_leak = v;
        this.change();
      }),
      more,
      make("p", "caption", names ? `Vessels of this leg: ${names}.` : ""),
    ];
  }

  // ---- findings --------------------------------------------------------------------------------

  private get veins(): string[] {
    return (this.draft?.branches ?? []).filter((name) => !name.includes("artery"));
  }

  private findingsView(f: Form): HTMLElement[] {
    const row = make("div", "editor-row");
    const hand = button(this.points === "clot" ? (this.first ? "Now where it ends" : "Now where it begins") : "Point out a clot", () => {
      this.points = this.points ? null : "clot";
      this.first = null;
      this.mark();
      this.build();
    });
    hand.id = "editor-point";
    hand.setAttribute("aria-pressed", String(this.points === "clot"));
    const add = make("select");
    add.id = "editor-add";
    add.append(make("option", "", "Add a clot in …"), ...["", ...this.veins].map((name) => Object.assign(make("option", "", name ? label(name) : "Main vein"), { value: name || "main" })));
    add.setAttribute("aria-label", "Add a clot in a vein");
    add.onchange = () => this.addClot(add.value === "main" ? undefined : add.value, 0.3, 0.6);
    const lesion = button("Add a lesion", () => {
      const findings = (f.findings ??= {});
      (findings.lesions ??= []).push({ kind: "node", at: placeOf(0.1, undefined, this.draft ?? {}), depth_mm: 15, size_mm: [10, 10, 16] });
      this.change(true);
    });
    row.append(hand, add, lesion);
    const hint = this.points ? "Click on a vein of the leg (drag turns the leg, Escape ends)." : "Veins are blue. A clot is drawn where it lies.";
    const cards = clots(f).map((c, i) => this.clotCard(f, c, i));
    const lesions = (f.findings?.lesions ?? []).map((one, i) => this.lesionCard(f, one, i));
    const findings = (key: "oedema") => (v: number | null): void => {
      f.findings ??= {};
      if (v === null) delete f.findings[key];
      else f.findings[key] = v;
      this.change();
    };
    const none = clots(f).length + lesions.length ? [] : [make("p", "caption", "No finding: every vein is healthy.")];
    return [row, make("p", "caption", hint), ...cards, ...lesions, ...none, numberField("editor-oedema", "Oedema: 0 none, 1 most", f.findings?.oedema ?? null, 0, 1, "0", findings("oedema"))];
  }

  private addClot(branch: string | undefined, from: number, to: number): void {
    const f = this.form, leg = this.draft;
    if (!f || !leg) return;
    const clot: Clot = { ...(branch === undefined ? {} : { branch }), stage: "acute_occlusive", from: placeOf(from, branch, leg), to: placeOf(to, branch, leg) };
    if (branch === undefined) f.vein = clot;
    else {
      const findings = (f.findings ??= {});
      findings.branches = [...(findings.branches ?? []).filter((c) => c.branch !== branch), clot];
    }
    this.change(true);
    announce(`A clot in ${branch === undefined ? "the main vein" : branch.replace(/_/g, " ")}.`);
  }

  private stages(): string[] {
    return (this.hello?.cases ?? []).filter((name) => name !== "healthy");
  }

  /** From and to of a clot in percent of its vein, or in words where only the program can tell. */
  private ends(id: string, c: Clot): HTMLElement[] {
    const leg: DraftLeg = this.draft ?? {};
    return (["from", "to"] as const).map((key) => {
      const share = shareOf(c[key], c.branch, leg, key === "to" ? 1 : 0);
      if (share === null) return make("p", "caption", `${key}: ${JSON.stringify(c[key])} (as text)`);
      return numberField(`${id}-${key}`, `${label(key)}, % of the vein`, Math.round(1000 * share) / 10, 0, 100, "", (v) => {
        if (v === null) return;
        for (const end of ["from", "to"] as const) c[end] ??= placeOf(end === "to" ? 1 : 0, c.branch, leg);
        c[key] = placeOf(v / 100, c.branch, leg);
        this.change();
      });
    });
  }

  private clotCard(f: Form, c: Clot, i: number): HTMLElement {
    const card = make("div", "editor-card");
    const id = `editor-clot-${i}`;
    const name = c.branch === undefined ? "Main vein" : label(c.branch);
    const drop = button("Remove", () => {
      if (c.branch === undefined) f.vein = { stage: "healthy" };
      else f.findings!.branches = f.findings!.branches!.filter((one) => one !== c);
      if (f.findings?.branches?.length === 0) delete f.findings.branches;
      this.change(true);
    });
    drop.setAttribute("aria-label", `Remove the clot in ${name}`);
    const head = make("div", "editor-row");
    head.append(make("b", "", name), make("span", "caption", this.whereabouts(c)), make("span", "spring"), drop);
    const stage = choiceField(`${id}-stage`, "Kind and age", this.stages(), c.stage, (v) => {
      for (const key of Object.keys(c)) if (!["branch", "from", "to", "webs"].includes(key)) delete c[key];
      c.stage = v;
      this.change();
    });
    const row = make("div", "editor-row");
    row.append(stage, ...this.ends(id, c));
    card.append(head, row);
    return card;
  }

  private whereabouts(c: Clot): string {
    const leg: DraftLeg = this.draft ?? {};
    if (c.branch !== undefined) return "";
    const names = [c.from, c.to].map((p) => (typeof p === "object" && p.segment ? segmentTitle(p.segment, leg).toLowerCase() : ""));
    return names[0] && names[1] ? (names[0] === names[1] ? names[0] : `${names[0]} to ${names[1]}`) : "";
  }

  private lesionCard(f: Form, one: Lesion, i: number): HTMLElement {
    const card = make("div", "editor-card");
    const id = `editor-lesion-${i}`;
    const drop = button("Remove", () => {
      f.findings!.lesions = f.findings!.lesions!.filter((other) => other !== one);
      if (f.findings!.lesions.length === 0) delete f.findings!.lesions;
      this.change(true);
    });
    drop.setAttribute("aria-label", "Remove the lesion");
    const hand = button(this.points === one ? "Click on the main vein" : "Point", () => {
      this.points = this.points === one ? null : one;
      this.build();
    });
    hand.setAttribute("aria-pressed", String(this.points === one));
    const head = make("div", "editor-row");
    head.append(make("b", "", label(one.kind)), make("span", "spring"), hand, drop);
    const leg: DraftLeg = this.draft ?? {};
    const share = shareOf(one.at, undefined, leg, 0);
    const size = (one.size_mm ??= [10, 10, 16]);
    const row = make("div", "editor-row");
    row.append(
      choiceField(`${id}-kind`, "Kind", LESIONS, one.kind, (v) => ((one.kind = v), this.change(true))),
      numberField(`${id}-at`, "Beside, % of the main vein", share === null ? null : Math.round(1000 * share) / 10, 0, 100, "as text", (v) => v !== null && ((one.at = placeOf(v / 100, undefined, leg)), this.change())),
      numberField(`${id}-depth`, "Depth, mm", one.depth_mm, 1, 120, "", (v) => v !== null && ((one.depth_mm = v), this.change())),
      ...["across", "deep", "along"].map((name, k) => numberField(`${id}-${name}`, `Size ${name}, mm`, size[k]!, 1, 100, "", (v) => v !== null && ((size[k] = v), this.change()))),
    );
    card.append(head, row);
    return card;
  }

  /** A click on the leg. */
  private point(x: number, y: number): void {
    if (!this.points) return;
    const hit = this.scene.vesselAt(x, y, (part) => part === MAIN_PART || (part >= FIRST_PART && part % 2 === 0));
    if (!hit) return announce("There is no vein: click nearer to a blue line.");
    if (this.points !== "clot") {
      if (hit.part !== MAIN_PART) return announce("A lesion has its place beside the main vein.");
      (this.points as Lesion).at = placeOf(hit.share, undefined, this.draft ?? {});
      this.points = null;
      return this.change(true);
    }
    if (!this.first || this.first.part !== hit.part) {
      this.first = hit;
      this.mark();
      return this.build();
    }
    const [from, to] = [this.first.share, hit.share].sort((a, b) => a - b) as [number, number];
    this.points = this.first = null;
    this.addClot(hit.part === MAIN_PART ? undefined : this.draft?.branches?.[(hit.part - FIRST_PART) / 2], from, to);
  }

  /** Escape ends pointing; true when there was some. */
  escape(): boolean {
    if (!this.isOpen || !this.points) return false;
    this.points = this.first = null;
    this.mark();
    this.build();
    return true;
  }

  /** Draws the clots into the leg. */
  private mark(): void {
    const leg: DraftLeg = this.draft ?? {};
    const partOf = (branch: string | undefined): number => (branch === undefined ? MAIN_PART : FIRST_PART + 2 * (leg.branches ?? []).indexOf(branch));
    const marks: VesselMark[] = this.isOpen && this.form
      ? clots(this.form).flatMap((c) => {
          const [from, to] = [shareOf(c.from, c.branch, leg, 0), shareOf(c.to, c.branch, leg, 1)];
          return from === null || to === null ? [] : [{ part: partOf(c.branch), from, to }];
        })
      : [];
    if (this.first) marks.push({ part: this.first.part, from: this.first.share - 0.005, to: this.first.share + 0.005 });
    this.scene.markVessels(marks);
  }

  // ---- answer and text -------------------------------------------------------------------------

  private answerView(f: Form): HTMLElement[] {
    const t = f.truth, leg: DraftLeg = this.draft ?? {};
    const follow = make("label", "editor-check");
    const tick = make("input");
    Object.assign(tick, { type: "checkbox", checked: this.follows, id: "editor-follows" });
    tick.onchange = () => ((this.follows = tick.checked), this.change(true));
    follow.append(tick, make("span", "", "The answer follows the findings"));
    const rows = (leg.segments ?? []).map((s) => {
      const listed = t.segments[s.id];
      const field = choiceField(`editor-truth-${s.id}`, s.title, ["", "compressible", "clot"], listed ?? "", (v) => {
        if (v) t.segments[s.id] = v;
        else delete t.segments[s.id];
        this.change();
      }, (v) => (v === "" ? "As its veins are" : label(v)));
      field.querySelector("select")!.disabled = this.follows;
      return field;
    });
    const thrombosis = choiceField("editor-thrombosis", "Thrombosis of a deep vein", ["true", "false"], String(t.thrombosis), (v) => ((t.thrombosis = v === "true"), this.change()), (v) => (v === "true" ? "Yes" : "No"));
    thrombosis.querySelector("select")!.disabled = this.follows;
    const alike = (v: string): void => {
      const list = v.split(",").map((one) => one.trim()).filter(Boolean);
      if (list.length) t.look_alikes = list;
      else delete t.look_alikes;
      this.change();
    };
    return [
      follow,
      textField("editor-diagnosis", "Diagnosis in words, shown with the result", t.diagnosis, 159, (v) => ((t.diagnosis = v), this.change())),
      thrombosis,
      ...rows,
      textField("editor-alike", "What could be taken for a clot, with commas between", (t.look_alikes ?? []).join(", "), 190, alike),
    ];
  }

  private textView(): HTMLElement {
    const area = make("textarea");
    Object.assign(area, { id: "editor-text", value: this.text, spellcheck: false });
    area.setAttribute("aria-label", "Text of the case");
    area.oninput = () => {
      this.text = area.value;
      const form = read(this.text);
      this.form = typeof form === "string" ? null : form;
      this.follows = false; // who writes the text writes the answer
      this.keep();
      this.stale();
      for (const chip of this.box.querySelectorAll<HTMLButtonElement>(".chips button:not(#editor-tab-text)")) chip.disabled = this.form === null;
    };
    const line = this.draft?.serial === this.serial ? /^[^:]*:(\d+):/.exec(this.draft.message)?.[1] : undefined;
    if (line) window.setTimeout(() => this.goToLine(area, Number(line)));
    return area;
  }

  /** Selects the line that a message names. */
  private goToLine(area: HTMLTextAreaElement, line: number): void {
    const lines = area.value.split("\n");
    const start = lines.slice(0, line - 1).reduce((sum, one) => sum + one.length + 1, 0);
    area.focus();
    area.setSelectionRange(start, start + (lines[line - 1]?.length ?? 0));
    area.scrollTop = (area.scrollHeight / Math.max(1, lines.length)) * Math.max(0, line - 4);
  }
}
