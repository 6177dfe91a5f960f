// The case editor: a teacher writes a patient beside the leg that the program makes of the text. Veins are pointed at
// on the leg. Text and form are the same case; the text is what is checked, kept and shared.

import { clots, copyOf, diagnosis, faultOf, fresh, lined, placeOf, read, shareOf, veinName, whereabouts, why, write, type Clot, type DraftLeg, type DraftMessage, type Form, type Lesion, type Part } from "./draft";
import { announce, button, find, label, make, press } from "./dom";
import { choiceField, numberField, selectLine, textField } from "./fields";
import type { Controls, Hello, Phase } from "./protocol";
import type { LegScene, VesselMark, VesselPoint } from "./scene";
import { LEVELS } from "./words";
import { capital, t } from "./words/language";

const PARTS: readonly Part[] = ["case", "leg", "findings", "answer", "text"];
const LESIONS = ["node", "cyst", "haematoma"];
const POSITIONS = ["supine_turned", "prone_bent", "supine", "prone", "standing", "sitting"];
const FIRST_PARAMETERS = ["age-y", "stature-cm", "bmi"];
const MAIN_PART = 2, FIRST_PART = 256; // of the geometry
const CLICK_PX = 5, TAP_PX = 12; // a mouse, a finger that moved farther has turned the leg
const NEAR_PX = 14, NEAR_TAP_PX = 28; // of them: this near to a vessel is on it
const AGAIN_MS = 2000; // after a lost connection: an answer that was under way comes first
const MOST_BYTES = 12288; // of a message with a case, as the program takes it
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
  private stored = ""; // the text that is on a disk, or can be made again
  private chooses = false; // another case is being chosen, while this one stays
  private form: Form | null = null;
  private part: Part = "case";
  private hello: Hello | null = null;
  private draft: DraftMessage | null = null;
  private serial = Math.floor(Math.random() * 1e8); // apart from those of another teacher's page
  private busy = false;
  private isStale = true; // the text was changed since it was sent
  private refusal = ""; // why the page did not send it
  private asked = ""; // the action that is under way
  private last: { action: string; [key: string]: unknown } | null = null; // its message
  private copies = false; // what is opened next is a copy
  private follows = true; // the answer follows the findings: the program gives it
  private awaits: (() => void) | null = null; // what waits for the answer
  private said = ""; // the diagnosis as the findings gave it; a teacher's own words stay
  private hasMore = false; // all measures of the leg are unfolded
  private points: Clot | Lesion | "clot" | null = null; // what the next click on the leg is for
  private first: VesselPoint | null = null; // where the pointed-out clot begins
  private tried = false; // an exam of the draft is under way
  private takes = false; // the probe when it begins: a teacher whose connection is lost loses it
  private down: [number, number] | null = null;
  private mayEdit = false;
  private phase: Phase = "practice"; // the last one whose leg was in view
  private readonly box = find("editor");

  constructor(
    private readonly scene: LegScene,
    private readonly actions: EditorActions,
  ) {
    press("edit-button", () => (this.isOpen ? this.close() : this.open()));
    const canvas = find<HTMLCanvasElement>("scene");
    canvas.addEventListener("pointerdown", (e) => (this.down = e.button === 0 && e.isPrimary ? [e.clientX, e.clientY] : null));
    canvas.addEventListener("pointerup", (e) => {
      const from = this.down;
      this.down = null;
      const tap = e.pointerType === "touch";
      if (this.isOpen && from && Math.hypot(e.clientX - from[0], e.clientY - from[1]) < (tap ? TAP_PX : CLICK_PX)) this.point(e.clientX, e.clientY, tap ? NEAR_TAP_PX : NEAR_PX);
    });
  }

  greet(hello: Hello): void {
    this.hello = hello;
    if (this.isOpen && this.text === "") this.build();
  }

  /** Only who has the teacher's address writes cases, and not while an exam runs. */
  set(controls: Controls): void {
    this.mayEdit = controls.role === "teacher" && (this.hello?.trainer ?? false);
    find("edit-button").hidden = !this.mayEdit || this.phase === "running";
  }

  /** The connection is back: what was asked while it was lost is asked again, and so is the probe, when an exam of the draft runs. */
  again(): void {
    this.takes = this.tried;
    window.setTimeout(() => this.busy && this.last && this.actions.send(this.last), AGAIN_MS);
  }

  /** An exam takes the page, and gives it back when it was one of the draft. */
  follow(phase: Phase): void {
    if (phase === "preparing") return;
    const before = this.phase;
    this.phase = phase;
    find("edit-button").hidden = !this.mayEdit || phase === "running";
    if (phase === "running" && before !== phase && this.busy && this.asked === "try") {
      // The exam of the draft begins sooner than the program answers.
      this.tried = true;
      this.busy = false;
    }
    if (phase === "running" && this.takes && this.tried) {
      this.takes = false;
      this.actions.control();
    }
    if (this.isOpen && phase === "running") this.show(false);
    else if (this.tried && phase === "practice") {
      this.tried = false;
      this.show(true);
      this.send("check");
    } else if (!this.isOpen && phase === "edit" && this.mayEdit) this.open();
    else if (this.isOpen && phase !== before) {
      if (before === "edit") this.stale(); // another leg came into view
      this.mark();
    }
  }

  hear(draft: DraftMessage): void {
    if (draft.serial !== this.serial || !this.busy) return; // of another teacher's page, or told before
    this.draft = draft;
    this.busy = false;
    if (draft.text !== undefined) {
      const form = read(draft.text);
      return this.load(typeof form === "string" ? draft.text : write(this.copies ? copyOf(form) : form), true);
    }
    const own = this.text === this.last?.text; // not written on since
    if (own) this.takeAnswer(draft.answer);
    if (this.asked === "save" && draft.saved) {
      this.stored = own ? this.text : String(this.last?.text);
      announce(t("editor.saved", { file: draft.saved }));
    }
    if (this.asked === "try" && draft.good) this.tried = true;
    this.mark();
    this.build();
    const next = this.awaits;
    this.awaits = null;
    if (next) this.ask(next);
  }

  /** For tests: what the program said of the text as it stands, or null. */
  get told(): DraftMessage | null {
    return this.isTold ? this.draft : null;
  }

  private get isTold(): boolean {
    return !this.busy && !this.isStale && this.refusal === "" && this.draft?.serial === this.serial;
  }

  private open(): void {
    const kept = sessionStorage.getItem(KEPT) ?? "";
    this.chooses = false;
    this.show(true);
    if (this.text) this.send("check");
    else if (kept) this.load(kept, false);
  }

  private close(): void {
    this.actions.send({ action: "close" });
    this.show(false);
    this.tried = this.takes = this.busy = false;
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

  /** `stored`: nothing is lost when another case takes its place. */
  private load(text: string, stored: boolean): void {
    const form = read(text);
    this.text = text;
    this.stored = stored ? text : "";
    this.chooses = false;
    this.form = typeof form === "string" ? null : form;
    this.follows = true;
    this.awaits = null;
    this.said = this.form ? diagnosis(this.form, this.draft ?? {}) : "";
    this.part = this.form ? "case" : "text";
    this.keep();
    this.send("check");
  }

  private keep(): void {
    try {
      sessionStorage.setItem(KEPT, this.text);
    } catch {
      // full or forbidden: the text lasts as long as the page
    }
  }

  /** The form was changed. */
  private change(rebuild = false): void {
    if (!this.form) return;
    const now = diagnosis(this.form, this.draft ?? {}); // follows too, until a teacher has put it into words
    if (this.follows && this.form.truth.diagnosis === this.said) this.form.truth.diagnosis = now;
    if (this.follows) this.said = now;
    this.text = write(this.form);
    this.keep();
    this.stale();
    this.mark();
    if (rebuild) this.build();
  }

  /** What the program found, where the answer follows the findings. */
  private takeAnswer(found: DraftMessage["answer"]): void {
    const truth = this.form?.truth;
    if (!truth || !found || !this.follows) return;
    const before = JSON.stringify([truth.thrombosis, truth.segments]);
    if (before === JSON.stringify([found.thrombosis, found.segments])) return; // the text stays as it was written
    Object.assign(truth, found);
    this.text = write(this.form!);
    this.keep();
  }

  /** Where the answer is read or taken away: has it found first, if the findings may have another one by now. */
  private ask(then = (): void => undefined): void {
    const waits = this.follows && this.form !== null && this.isStale && !document.body.classList.contains("offline");
    if (waits && !this.busy) this.send("check");
    if (waits && this.busy) this.awaits = then;
    else then();
  }

  private send(action: string, more: object = {}): void {
    if (this.busy) return;
    const message = { ...more, action, serial: ++this.serial, text: this.text, follows: this.follows };
    this.asked = action;
    this.isStale = false;
    const bytes = new TextEncoder().encode(JSON.stringify({ type: "edit", ...message })).length;
    this.refusal = bytes > MOST_BYTES ? t("editor.too_long", { bytes, most: MOST_BYTES }) : "";
    this.busy = this.refusal === "";
    if (this.busy) this.actions.send((this.last = message));
    this.build();
  }

  private openCase(id: string, copies: boolean): void {
    if (this.busy) return;
    this.copies = copies;
    this.busy = true;
    this.isStale = false;
    this.refusal = "";
    this.asked = "open";
    this.last = { action: "open", case: id, serial: ++this.serial };
    this.actions.send(this.last);
    this.build();
  }

  private tryIt(): void {
    if (this.busy) return;
    this.takes = true;
    this.actions.control();
    this.send("try", { protocol: find<HTMLSelectElement>("editor-protocol").value });
  }

  private download(): void {
    const link = make("a");
    link.href = URL.createObjectURL(new Blob([this.text], { type: "application/yaml" }));
    link.download = `${/^[a-z0-9_-]{1,47}$/.test(this.form?.id ?? "") ? this.form!.id : "case"}.yaml`;
    link.click();
    this.stored = this.text;
    window.setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  // ---- what is seen ----------------------------------------------------------------------------

  private build(): void {
    if (!this.isOpen) return;
    const at = document.activeElement as HTMLElement | null;
    const focused = at && this.box.contains(at) ? at.id : "";
    const caret = at instanceof HTMLTextAreaElement || (at instanceof HTMLInputElement && at.type === "text") ? [at.selectionStart, at.selectionEnd] as const : null;
    const body = this.box.querySelector<HTMLElement>(".editor-body, .editor-cases");
    const [part, scrolled] = [body?.dataset.part, body?.scrollTop ?? 0];
    if (this.text === "" || this.chooses) this.box.replaceChildren(...this.choose());
    else this.box.replaceChildren(this.head(), this.state(), this.tabs(), this.body(), this.foot());
    this.showFault();
    const now = this.box.querySelector<HTMLElement>(".editor-body, .editor-cases");
    if (now && now.dataset.part === part) now.scrollTop = scrolled;
    const next = focused ? document.getElementById(focused) : null;
    if (!next) return;
    next.focus({ preventScroll: true });
    if (caret && (next instanceof HTMLTextAreaElement || next instanceof HTMLInputElement)) next.setSelectionRange(caret[0], caret[1]);
  }

  private choose(): HTMLElement[] {
    const head = make("h2", "", t("editor.write"));
    const row = make("div", "actions");
    const begin = button(t("editor.new"), () => this.load(write(fresh()), true), "primary");
    begin.id = "editor-new";
    row.append(begin, this.openFile(), make("span", "spring"), this.closeButton());
    const present = this.text ? [this.present()] : [];
    const list = make("ul", "editor-cases");
    list.dataset.part = "choose";
    for (const c of this.hello?.case_list ?? []) {
      const item = make("li");
      const words = make("span", "words");
      words.append(make("b", "", c.title), make("span", "caption", c.own ? t("editor.own", { level: LEVELS[c.level] }) : LEVELS[c.level]));
      item.append(words);
      const acts: [string, string, boolean][] = [["edit", t("editor.edit"), false], ["copy", t("editor.copy"), true]];
      for (const [name, text, copies] of acts) {
        if (!c.own && !copies) continue;
        const act = button(text, () => this.openCase(c.id, copies));
        act.id = `editor-${name}-${c.id}`;
        act.setAttribute("aria-label", `${text}: ${c.title}`);
        act.setAttribute("aria-disabled", String(this.busy));
        item.append(act);
      }
      list.append(item);
    }
    const state = make("p", "caption", this.busy ? t("editor.opening") : this.refusal || (this.isTold ? this.draft!.message : ""));
    state.id = "editor-state";
    state.setAttribute("role", "status");
    return [head, row, ...present, state, make("div", "caption", t("editor.or_copy")), list];
  }

  /** The case that stays until another one takes its place. */
  private present(): HTMLElement {
    const row = make("div", "editor-row");
    const back = button(t("editor.back", { title: this.title() }), () => this.open());
    back.id = "editor-back";
    row.append(back, make("span", "caption", this.text === this.stored ? "" : t("editor.unsaved")));
    return row;
  }

  private openFile(): HTMLElement {
    const input = make("input");
    Object.assign(input, { type: "file", accept: ".yaml,.yml", id: "editor-file", className: "unseen" });
    input.onchange = () => {
      const file = input.files?.[0];
      if (!file) return;
      if (file.size <= MOST_BYTES) return void file.text().then((text) => this.load(text, true));
      this.refusal = t("editor.too_long", { bytes: file.size, most: MOST_BYTES });
      this.build();
    };
    const words = make("label", "button", t("editor.open_file"));
    words.htmlFor = "editor-file";
    const box = make("span");
    box.append(input, words);
    return box;
  }

  private closeButton(): HTMLElement {
    const close = button(t("editor.close"), () => this.close());
    close.id = "editor-close";
    return close;
  }

  private title(): string {
    return this.form?.title || t("editor.a_case");
  }

  private head(): HTMLElement {
    const row = make("div", "actions");
    const other = button(t("editor.other"), () => {
      this.chooses = true;
      this.refusal = "";
      this.busy = false;
      this.points = this.first = null;
      this.mark();
      this.build();
    });
    other.id = "editor-other";
    row.append(make("b", "editor-title", this.title()), make("span", "spring"), other, this.closeButton());
    return row;
  }

  private words(): [string, string] {
    const d = this.draft;
    if (this.busy) return ["caption", t("editor.checking")];
    if (this.refusal) return ["bad", this.refusal];
    if (!this.isTold || !d) return ["caption", t("editor.unchecked")];
    if (this.asked === "save" && d.saved) return ["good", t("editor.saved", { file: d.saved })];
    return d.message ? ["bad", lined(d.message, d)] : ["good", t("editor.right")];
  }

  private state(): HTMLElement {
    const row = make("div", "editor-told");
    const [tone, words] = this.words();
    const line = make("p", `editor-state ${tone}`, words);
    line.id = "editor-state";
    line.setAttribute("role", "status");
    row.append(line);
    const fault = this.fault();
    if (!fault) return row;
    const go = button(t("editor.go"), () => {
      this.part = fault.part;
      this.build();
      const field = document.getElementById(fault.field);
      field?.scrollIntoView({ block: "center" });
      field?.focus();
    });
    go.id = "editor-go";
    row.append(go);
    return row;
  }

  /** What is wrong with the case as it stands; null when it is right or not known. */
  private fault(): ReturnType<typeof faultOf> | null {
    return this.isTold && !this.draft!.good && this.draft!.message ? faultOf(this.draft!.message, this.text, this.form) : null;
  }

  /** Marks the part and the field that the program's sentence is about. */
  private showFault(): void {
    const fault = this.fault();
    if (!fault) return;
    const tab = document.getElementById(`editor-tab-${fault.part}`);
    tab?.classList.add("wrong");
    tab?.setAttribute("aria-description", t("editor.wrong"));
    const field = this.part === fault.part ? document.getElementById(fault.field) : null;
    if (!field || field.id === "editor-text") return;
    field.setAttribute("aria-invalid", "true");
    field.setAttribute("aria-describedby", "editor-why");
    const reason = make("span", "bad editor-why", why(this.draft!.message.replace(/^[^:]*:\d+: /, ""), this.draft!));
    reason.id = "editor-why";
    field.after(reason);
    for (let up = field.parentElement; up && up !== this.box; up = up.parentElement) if (up instanceof HTMLDetailsElement) up.open = true;
  }

  /** What was checked is not what stands there any more. */
  private stale(): void {
    this.isStale = true;
    this.refusal = "";
    const [tone, words] = this.words();
    const line = document.getElementById("editor-state");
    if (line) Object.assign(line, { className: `editor-state ${tone}`, textContent: words });
    document.getElementById("editor-go")?.remove();
    const title = this.box.querySelector(".editor-title");
    if (title) title.textContent = this.title();
    const save = document.getElementById("editor-save");
    if (save) save.textContent = t("editor.save");
  }

  private tabs(): HTMLElement {
    const box = make("div", "chips");
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", t("editor.parts"));
    for (const part of PARTS) {
      const chip = button(t(`editor.part.${part}`), () => {
        this.part = part;
        this.build();
        if (part === "answer" || part === "text") this.ask();
      });
      chip.id = `editor-tab-${part}`;
      chip.setAttribute("aria-pressed", String(part === this.part));
      chip.disabled = this.form === null && part !== "text";
      box.append(chip);
    }
    return box;
  }

  private foot(): HTMLElement {
    const row = make("div", "actions editor-foot");
    const check = button(t("editor.check"), () => this.send("check"), this.isTold ? "" : "primary");
    check.id = "editor-check";
    const replaces = this.isTold && this.draft!.exists;
    const save = button(replaces ? t("editor.replace") : t("editor.save"), () => this.send("save", { replace: this.isTold && this.draft!.exists }));
    save.id = "editor-save";
    const download = button(t("editor.download"), () => this.ask(() => this.download()));
    download.id = "editor-download";
    const protocol = make("select");
    protocol.id = "editor-protocol";
    protocol.setAttribute("aria-label", t("editor.protocol"));
    for (const p of this.hello?.protocols ?? []) protocol.append(Object.assign(make("option", "", p.title), { value: p.id }));
    const before = document.getElementById("editor-protocol");
    if (before instanceof HTMLSelectElement && before.value) protocol.value = before.value;
    const go = button(t("editor.try"), () => this.tryIt());
    go.id = "editor-try";
    // Not disabled, which would lose the focus of who works by keyboard.
    for (const one of [check, save, go]) one.setAttribute("aria-disabled", String(this.busy));
    row.append(check, save, download, make("span", "spring"), protocol, go);
    return row;
  }

  private body(): HTMLElement {
    const box = make("div", "editor-body");
    const f = this.form;
    box.dataset.part = f ? this.part : "text";
    if (this.part === "text" || !f) box.append(this.textView());
    else if (this.part === "case") box.append(...this.caseView(f));
    else if (this.part === "leg") box.append(...this.legView(f));
    else if (this.part === "findings") box.append(...this.findingsView(f));
    else box.append(...this.answerView(f));
    return box;
  }

  private caseView(f: Form): HTMLElement[] {
    const set = (key: "id" | "title" | "history" | "note") => (v: string): void => ((f[key] = v), this.change());
    return [
      textField("editor-id", t("editor.id"), f.id, 47, set("id")),
      textField("editor-name", t("editor.title"), f.title, 95, set("title")),
      choiceField("editor-level", t("editor.level"), ["first", "easy", "hard"], f.level, (v) => ((f.level = v), this.change()), (v) => LEVELS[v as keyof typeof LEVELS]),
      textField("editor-history", t("editor.history"), f.history, 1000, set("history"), 4),
      textField("editor-note", t("editor.note"), f.note ?? "", 1000, set("note"), 5),
    ];
  }

  private legView(f: Form): HTMLElement[] {
    if (!f.leg) return [make("p", "", t("editor.thigh"))];
    const leg = f.leg;
    const put = (key: string) => (v: number | string | null): void => {
      if (v === null || v === "") delete leg[key];
      else leg[key] = v;
      this.change();
    };
    const value = (key: string): number | null => (typeof leg[key] === "number" ? (leg[key] as number) : null);
    const another = button(t("editor.another"), () => (put("seed")(1 + Math.floor(Math.random() * 9999)), this.send("check")));
    another.title = t("editor.another.title");
    another.id = "editor-another";
    const known = this.draft?.parameters ?? [];
    const fields = (keys: string[]): HTMLElement[] =>
      keys.flatMap((key) => {
        const p = known.find((one) => one.key === key);
        const unit = /-(mm|cm|deg)$/.exec(key)?.[1] ?? "";
        return p ? [numberField(`editor-${key}`, `${capital(p.text)}${unit && `, ${unit === "deg" ? "°" : unit}`}`, value(key), p.low, p.high, t("editor.drawn"), put(key))] : [];
      });
    const more = make("details");
    more.open = this.hasMore;
    more.ontoggle = () => (this.hasMore = more.open);
    more.append(make("summary", "", t("editor.more")), ...fields(known.map((p) => p.key).filter((key) => !FIRST_PARAMETERS.includes(key))));
    const flow = f.circulation ?? {};
    const leak = (v: number | null): void => {
      f.circulation = flow;
      if (v === null) delete flow.valve_leak;
      else flow.valve_leak = v;
      if (Object.keys(flow).length === 0) delete f.circulation;
      this.change();
    };
    const seed = make("div", "editor-row");
    seed.append(numberField("editor-seed", t("editor.seed"), value("seed"), 0, 4294967295, "1", put("seed")), another);
    const names = (this.draft?.veins ?? []).map(veinName).join(", ");
    return [
      seed,
      choiceField("editor-sex", t("editor.sex"), ["female", "male", "drawn"], String(leg.sex ?? "drawn"), put("sex")),
      choiceField("editor-side", t("editor.side"), ["right", "left"], String(leg.side ?? "right"), put("side")),
      ...fields(FIRST_PARAMETERS),
      choiceField("editor-position", t("editor.position"), ["", ...POSITIONS], String(leg.position ?? ""), put("position"), (v) => (v ? label(v) : t("editor.straight"))),
      numberField("editor-leak", t("editor.leak"), typeof flow.valve_leak === "number" ? flow.valve_leak : null, 0, 1, "0", leak),
      more,
      make("p", "caption", names ? t("editor.vessels", { names }) : ""),
    ];
  }

  // ---- findings --------------------------------------------------------------------------------

  private findingsView(f: Form): HTMLElement[] {
    const row = make("div", "editor-row");
    const hand = button(this.points === "clot" ? (this.first ? t("editor.point.end") : t("editor.point.begin")) : t("editor.point"), () => {
      this.points = this.points ? null : "clot";
      this.first = null;
      this.mark();
      this.build();
    });
    hand.id = "editor-point";
    hand.setAttribute("aria-pressed", String(this.points === "clot"));
    const add = make("select");
    add.id = "editor-add";
    const veins = ["", ...(this.draft?.veins ?? [])].map((name) => Object.assign(make("option", "", veinName(name || undefined)), { value: name || "main" }));
    add.append(Object.assign(make("option", "", t("editor.add")), { value: "" }), ...veins);
    add.setAttribute("aria-label", t("editor.add.label"));
    const put = button(t("editor.add.put"), () => {
      if (add.value) this.addClot(add.value === "main" ? undefined : add.value, 0.3, 0.6);
    });
    put.id = "editor-put";
    const lesion = button(t("editor.add_lesion"), () => {
      const findings = (f.findings ??= {});
      (findings.lesions ??= []).push({ kind: "node", at: placeOf(0.1, undefined, this.draft ?? {}), depth_mm: 15, size_mm: [10, 10, 16] });
      this.change(true);
    });
    lesion.id = "editor-lesion";
    row.append(hand, add, put, lesion);
    const hint = this.points ? t("editor.hint.point") : t("editor.hint");
    const cards = clots(f).map((c, i) => this.clotCard(f, c, i));
    const lesions = (f.findings?.lesions ?? []).map((one, i) => this.lesionCard(f, one, i));
    const oedema = (v: number | null): void => {
      f.findings ??= {};
      if (v === null) delete f.findings.oedema;
      else f.findings.oedema = v;
      this.change();
    };
    const none = clots(f).length + lesions.length ? [] : [make("p", "caption", t("editor.no_finding"))];
    return [row, make("p", "caption", hint), ...cards, ...lesions, ...none, numberField("editor-oedema", t("editor.oedema"), f.findings?.oedema ?? null, 0, 1, "0", oedema)];
  }

  /** One clot lies in each vein: a new one takes the place of the one that was there. */
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
    announce(t("editor.added", { vein: veinName(branch) }));
  }

  private stages(): string[] {
    return (this.hello?.cases ?? []).filter((name) => name !== "healthy");
  }

  /** From and to of a clot in percent of its vein, or in words where only the program can tell. */
  private ends(id: string, c: Clot): HTMLElement[] {
    const leg: DraftLeg = this.draft ?? {};
    return (["from", "to"] as const).map((key) => {
      const share = shareOf(c[key], c.branch, leg, key === "to" ? 1 : 0);
      if (share === null) return make("p", "caption", t(`editor.end.text.${key}`, { place: JSON.stringify(c[key]) }));
      return numberField(`${id}-${key}`, t(`editor.end.${key}`), Math.round(1000 * share) / 10, 0, 100, "", (v) => {
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
    const name = veinName(c.branch);
    const drop = button(t("editor.remove"), () => {
      if (c.branch === undefined) f.vein = { stage: "healthy" };
      else f.findings!.branches = f.findings!.branches!.filter((one) => one !== c);
      if (f.findings?.branches?.length === 0) delete f.findings.branches;
      this.change(true);
    });
    drop.id = `${id}-drop`;
    drop.setAttribute("aria-label", t("editor.remove_clot", { vein: name }));
    const head = make("div", "editor-row");
    head.append(make("b", "", name), make("span", "caption", whereabouts(c, this.draft ?? {})), make("span", "spring"), drop);
    const stage = choiceField(`${id}-stage`, t("editor.stage"), this.stages(), c.stage, (v) => {
      for (const key of Object.keys(c)) if (!["branch", "from", "to", "webs"].includes(key)) delete c[key];
      c.stage = v;
      this.change();
    });
    const row = make("div", "editor-row");
    row.append(stage, ...this.ends(id, c));
    card.append(head, row);
    return card;
  }

  private lesionCard(f: Form, one: Lesion, i: number): HTMLElement {
    const card = make("div", "editor-card");
    const id = `editor-lesion-${i}`;
    const drop = button(t("editor.remove"), () => {
      f.findings!.lesions = f.findings!.lesions!.filter((other) => other !== one);
      if (f.findings!.lesions.length === 0) delete f.findings!.lesions;
      this.change(true);
    });
    drop.id = `${id}-drop`;
    drop.setAttribute("aria-label", t("editor.remove_lesion", { kind: label(one.kind) }));
    const hand = button(this.points === one ? t("editor.point.lesion") : t("editor.point.short"), () => {
      this.points = this.points === one ? null : one;
      this.build();
    });
    hand.id = `${id}-point`;
    hand.setAttribute("aria-pressed", String(this.points === one));
    const head = make("div", "editor-row");
    head.append(make("b", "", label(one.kind)), make("span", "spring"), hand, drop);
    const leg: DraftLeg = this.draft ?? {};
    const share = shareOf(one.at, undefined, leg, 0);
    const size = (one.size_mm ??= [10, 10, 16]);
    const row = make("div", "editor-row");
    const sizes = [t("editor.size.across"), t("editor.size.deep"), t("editor.size.along")];
    row.append(
      choiceField(`${id}-kind`, t("editor.kind"), LESIONS, one.kind, (v) => ((one.kind = v), this.change(true))),
      numberField(`${id}-at`, t("editor.beside"), share === null ? null : Math.round(1000 * share) / 10, 0, 100, t("editor.as_text"), (v) => v !== null && ((one.at = placeOf(v / 100, undefined, leg)), this.change())),
      numberField(`${id}-depth`, t("editor.depth"), one.depth_mm, 1, 120, "", (v) => v !== null && ((one.depth_mm = v), this.change())),
      ...sizes.map((name, k) => numberField(`${id}-size-${k}`, name, size[k]!, 1, 100, "", (v) => v !== null && ((size[k] = v), this.change()))),
    );
    card.append(head, row);
    return card;
  }

  /** A click on the leg, on a vessel that is at most `near_px` away. */
  private point(x: number, y: number, near_px: number): void {
    if (!this.points) return;
    if (this.phase !== "edit") return this.send("check"); // its own leg comes back first
    // Where a clot ends is sought on its own vein first: others lie beside it.
    const same = this.first && this.scene.vesselAt(x, y, near_px, (part) => part === this.first!.part);
    const hit = same ?? this.scene.vesselAt(x, y, near_px, (part) => part === MAIN_PART || (part >= FIRST_PART && part % 2 === 0));
    if (!hit) return this.say(t("editor.miss"));
    if (this.points !== "clot") {
      if (hit.part !== MAIN_PART) return this.say(t("editor.miss_lesion"));
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

  /** A sentence about a click, where who clicks looks, and for screen readers. */
  private say(sentence: string): void {
    announce(sentence);
    const hint = this.box.querySelector(".editor-body > .caption");
    if (hint) hint.textContent = sentence;
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
    const marks: VesselMark[] = this.isOpen && this.form && this.phase === "edit"
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
    const truth = f.truth, leg: DraftLeg = this.draft ?? {};
    const follow = make("label", "editor-check");
    const tick = make("input");
    Object.assign(tick, { type: "checkbox", checked: this.follows, id: "editor-follows" });
    tick.onchange = () => {
      this.follows = tick.checked;
      // One that the reader takes, until the program has found the right one.
      if (this.follows) Object.assign(truth, { thrombosis: false, segments: Object.fromEntries(Object.keys(truth.segments).map((id) => [id, "compressible"])) });
      this.change(true);
      this.ask();
    };
    follow.append(tick, make("span", "", t("editor.follows")));
    const rows = (leg.segments ?? []).map((s) => {
      const listed = truth.segments[s.id];
      const field = choiceField(`editor-truth-${s.id}`, s.title, ["", "compressible", "clot"], listed ?? "", (v) => {
        if (v) truth.segments[s.id] = v;
        else delete truth.segments[s.id];
        this.change();
      }, (v) => (v === "clot" ? t("finding.clot") : v === "compressible" ? t("finding.compressible") : t("editor.as_veins")));
      field.querySelector("select")!.disabled = this.follows;
      return field;
    });
    const thrombosis = choiceField("editor-thrombosis", t("editor.thrombosis"), ["true", "false"], String(truth.thrombosis), (v) => ((truth.thrombosis = v === "true"), this.change()), (v) => (v === "true" ? t("editor.yes") : t("editor.no")));
    thrombosis.querySelector("select")!.disabled = this.follows;
    const alike = (v: string): void => {
      const list = v.split(",").map((one) => one.trim()).filter(Boolean);
      if (list.length) truth.look_alikes = list;
      else delete truth.look_alikes;
      this.change();
    };
    return [
      follow,
      textField("editor-diagnosis", t("editor.diagnosis"), truth.diagnosis, 159, (v) => ((truth.diagnosis = v), this.change())),
      thrombosis,
      ...rows,
      textField("editor-alike", t("editor.alike"), (truth.look_alikes ?? []).join(", "), 190, alike),
    ];
  }

  private textView(): HTMLElement {
    const area = make("textarea");
    Object.assign(area, { id: "editor-text", value: this.text, spellcheck: false });
    area.setAttribute("aria-label", t("editor.text"));
    area.oninput = () => {
      this.text = area.value;
      const form = read(this.text);
      this.form = typeof form === "string" ? null : form;
      this.follows = false; // who writes the text writes the answer
      this.keep();
      this.stale();
      for (const chip of this.box.querySelectorAll<HTMLButtonElement>(".chips button:not(#editor-tab-text)")) chip.disabled = this.form === null;
    };
    const line = this.isTold ? /^[^:]*:(\d+):/.exec(this.draft!.message)?.[1] : undefined;
    if (line) window.setTimeout(() => selectLine(area, Number(line)));
    return area;
  }
}
