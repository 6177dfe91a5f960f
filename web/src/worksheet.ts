// The worksheet while an exam runs and after it: the station at hand, storing its pictures, what is found at
// each station, the conclusion; print and file.

import { token } from "./access";
import { announce, button, find, make, minutes, press, release } from "./dom";
import type { Decision, Exam } from "./protocol";
import { AGE_WORDS, CONCLUSION_WORDS, drawPicture, drawSheet, FINDING_WORDS, isClot, KIND_WORDS, newest, REFLUX_WORDS, sideWord, type About, type Finding, type Sheet, type SheetPicture, type SheetPlace } from "./report/worksheet";
import { decimal, original, shown, t } from "./words/language";

export interface SheetMessage extends Sheet {
  type: "worksheet";
  exam: string;
}

export interface SheetActions {
  /** an entry of the message `worksheet` */
  enter(entry: object): void;
  decide(segment: string, decision: Decision): void;
  choose(segment: string): void;
  /** calipers on the image of now, mm */
  marks(): number[][];
  learner(): string;
  protocol(id: string): string;
}

const WAIT_MS = 500; // after the last key of a text
const FOUND: { finding: Exclude<Finding, "">; name: string }[] = [
  { finding: "compressible", name: t("sheet.closes") }, { finding: "partly", name: t("sheet.partly") }, { finding: "not_compressible", name: t("sheet.stays_open") }, { finding: "not_seen", name: t("sheet.not_seen") },
];

/** A list whose first choice is nothing. */
function select(name: string, words: Record<string, string>, none: string, change: (value: string) => void): HTMLSelectElement {
  const box = make("select");
  box.setAttribute("aria-label", name);
  for (const [value, word] of Object.entries(words)) box.append(new Option(value ? word : none, value));
  box.onchange = () => (change(box.value), release(box));
  return box;
}

interface Row {
  root: HTMLElement;
  pair: HTMLElement;
  found: HTMLButtonElement[];
  clot: HTMLElement;
  age: HTMLSelectElement;
  kind: HTMLSelectElement;
  reflux: HTMLSelectElement;
  seconds: HTMLInputElement;
  text: HTMLInputElement;
}

export class Worksheet {
  private sheet: SheetMessage | null = null;
  private exam: Exam | null = null;
  private controls = false;
  private at = 0;
  private target = -1; // that the guidance asked for last
  private shownTick = -1;
  private heldTick = -1;
  private rows: Row[] = [];
  private readonly pixels = new Map<string, string>(); // data address of a picture
  private readonly bar = find("sheet-bar");
  private readonly drawer = find("sheet-drawer");
  private readonly dialog = find<HTMLDialogElement>("sheet");
  private readonly list = make("div");
  private readonly ends = make("div");
  private readonly chips = make("div");
  private readonly impression = make("textarea");
  private painted = ""; // what the paper shows
  private timers = new Map<string, number>();

  constructor(private readonly actions: SheetActions) {
    press("station-before", () => this.step(-1));
    press("station-after", () => this.step(1));
    press("store-picture", () => this.store());
    press("sheet-button", () => this.open(this.drawer.hidden));
    window.addEventListener("beforeprint", () => this.layOut());
    this.furnish();
  }

  /** The newest message. */
  get written(): SheetMessage | null {
    return this.sheet;
  }

  // ---- messages and moments

  set(message: SheetMessage): void {
    const other = message.exam !== this.sheet?.exam;
    const before = other ? 0 : this.sheet!.pictures.length;
    this.sheet = message;
    if (other) {
      this.pixels.clear();
      this.at = 0;
      this.target = -1;
      this.build();
    }
    if (!other && message.pictures.length > before) {
      const p = message.pictures[message.pictures.length - 1]!;
      announce(t(p.view === "with" ? "sheet.stored_with" : "sheet.stored_without", { place: message.places[p.place]!.title, force: shown(p.force_n, 1) }));
    }
    void this.load();
    this.fill();
  }

  show(exam: Exam, controls: boolean): void {
    const running = exam.phase === "running";
    this.exam = exam;
    this.controls = controls && running;
    this.bar.hidden = !running || !this.sheet;
    if (!running) this.open(false);
    if (exam.phase === "practice" || exam.phase === "replay") {
      this.sheet = null;
      this.dialog.close();
    }
    const target = exam.step.target?.place ?? -1;
    if (running && target >= 0 && target !== this.target && this.sheet) this.go(target, false);
    this.target = target;
    this.fill();
  }

  /** An image was shown, or would have been: the one that is frozen is kept in reach. */
  see(tick: number, frozen: boolean): void {
    if (!frozen) this.shownTick = tick;
    else if (this.controls && this.heldTick !== this.shownTick) this.actions.enter({ hold: (this.heldTick = this.shownTick) });
  }

  /**
   * A finding given by key: a clot is written at the station at hand, anything else also at the segment's
   * stations where nothing is written. The same again takes it back. What the segment is called then; null:
   * there is no worksheet.
   */
  write(segment: string, decision: Decision): Decision | null {
    const sheet = this.sheet;
    if (!sheet || !sheet.places.some((p) => p.segment === segment)) return null;
    if (sheet.places[this.at]!.segment !== segment) this.at = sheet.places.findIndex((p) => p.segment === segment);
    const own = sheet.places[this.at]!;
    const finding: Finding = decision === "clot" ? (isClot(own.finding) ? own.finding : "not_compressible") : decision;
    if (own.finding === finding) this.put(this.at, "");
    else {
      this.put(this.at, finding);
      sheet.places.forEach((p, i) => decision !== "clot" && p.segment === segment && p.finding === "" && this.put(i, finding));
    }
    this.fill();
    return this.called(segment);
  }

  /** The segment that the exam's bar has chosen. */
  chosen(segment: string): void {
    if (!this.sheet || this.sheet.places[this.at]?.segment === segment) return;
    const place = this.sheet.places.findIndex((p) => p.segment === segment);
    if (place >= 0) this.at = place;
    this.fill();
  }

  /** What is still open, for the question before the end. */
  gaps(): string {
    const sheet = this.sheet;
    if (!sheet) return "";
    const bare = sheet.places.filter((_p, i) => !newest(sheet, i, "without") || !newest(sheet, i, "with")).length;
    if (bare) return t(sheet.conclusion ? "sheet.gaps_pictures" : "sheet.gaps_both", { n: bare, of: sheet.places.length });
    return sheet.conclusion ? "" : t("sheet.gaps_conclusion");
  }

  /** Of the result: the worksheet's own score, and the way to it. */
  summary(): HTMLElement | null {
    const v = this.sheet?.verdict;
    if (!v || !this.sheet?.written) return null;
    const box = make("p", "tally sheet-summary");
    box.append(make("b", v.conclusion_right ? "good" : "bad", `${t("sheet.score", { score: v.score.toFixed(0) })} `), v.summary, " ", button(t("sheet.open"), () => this.preview()));
    return box;
  }

  key(code: string, shift: boolean): boolean {
    if (this.exam?.phase !== "running" || !this.sheet) return false;
    if (code === "KeyN" && shift) this.open(this.drawer.hidden);
    else if (code === "KeyN") this.store();
    else if (code === "BracketLeft") this.step(-1);
    else if (code === "BracketRight") this.step(1);
    else return false;
    return true;
  }

  // ---- stations and pictures

  private step(by: number): void {
    const count = this.sheet?.places.length ?? 0;
    if (count) this.go((this.at + by + count) % count, true);
  }

  private go(place: number, choose: boolean): void {
    this.at = place;
    const segment = this.sheet?.places[place]?.segment;
    if (choose && segment) this.actions.choose(segment);
    this.rows[place]?.root.scrollIntoView({ block: "nearest" });
    this.fill();
  }

  private store(): void {
    if (!this.controls || this.shownTick < 0) return;
    this.actions.enter({ place: this.at, picture: this.shownTick, marks: this.actions.marks() });
  }

  /** Time of reflux that was measured at the station. */
  keepReflux(reflux_s: number): void {
    if (!this.controls || !this.sheet) return;
    const least_s = 0.5; // at a calf vein or a superficial one; the learner may say otherwise
    this.actions.enter({ place: this.at, reflux: reflux_s > least_s ? "present" : "absent", reflux_s: Math.min(reflux_s, 20) });
    announce(t("sheet.kept_reflux", { s: shown(reflux_s, 2) }));
  }

  /** Fetches the pixels of pictures that are not here yet. */
  private async load(): Promise<void> {
    const sheet = this.sheet;
    for (const p of sheet?.pictures ?? []) {
      const key = `${sheet!.exam}/${p.number}`;
      if (this.pixels.has(key)) continue;
      this.pixels.set(key, "");
      const answer = await fetch(`worksheet/${key}.png`, { headers: { Authorization: `Bearer ${token()}` } }).catch(() => null);
      if (!answer?.ok) {
        this.pixels.delete(key);
        continue;
      }
      const bytes = new Uint8Array(await answer.arrayBuffer());
      this.pixels.set(key, `data:image/png;base64,${btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(""))}`);
      this.fill();
    }
  }

  private source(p: SheetPicture): string {
    return this.pixels.get(`${this.sheet?.exam}/${p.number}`) ?? "";
  }

  // ---- the drawer

  private open(on: boolean): void {
    this.drawer.hidden = !on;
    find("sheet-button").setAttribute("aria-expanded", String(on));
    if (on) this.rows[this.at]?.root.scrollIntoView({ block: "nearest" });
  }

  private furnish(): void {
    const head = make("div", "sheet-tools");
    head.append(make("b", "mode", t("page.worksheet")), make("span", "caption", t("sheet.kept")), make("span", "spring"),
      button(t("sheet.read"), () => this.preview()), button(t("page.close"), () => this.open(false)));
    this.list.className = "sheet-rows";
    this.ends.className = "sheet-ends";
    this.chips.className = "sheet-chips";
    this.chips.setAttribute("role", "group");
    this.chips.setAttribute("aria-label", t("sheet.conclusion"));
    for (const [value, word] of Object.entries(CONCLUSION_WORDS).filter(([v]) => v)) {
      const b = button(value === "no_dvt" ? t("sheet.conclusion.no_dvt.short") : word, () => this.actions.enter({ conclusion: this.sheet?.conclusion === value ? "" : value }));
      b.dataset.value = value;
      this.chips.append(b);
    }
    Object.assign(this.impression, { rows: 3, maxLength: 600, placeholder: t("sheet.impression.hint") });
    this.impression.setAttribute("aria-label", t("sheet.impression"));
    this.impression.oninput = () => this.later("impression", () => this.actions.enter({ text: this.impression.value }));
    const foot = make("div", "sheet-foot-box");
    foot.append(this.ends, make("span", "caption", t("sheet.conclusion")), this.chips, this.impression);
    this.drawer.append(head, this.list, foot);
    // Keys of a text are its own.
    this.drawer.addEventListener("keydown", (e) => (e.target instanceof HTMLTextAreaElement || e.target instanceof HTMLInputElement) && e.key !== "Escape" && e.stopPropagation());
  }

  /** Texts are sent when the writer pauses. */
  private later(what: string, send: () => void): void {
    window.clearTimeout(this.timers.get(what));
    this.timers.set(what, window.setTimeout(send, WAIT_MS));
  }

  private build(): void {
    const sheet = this.sheet!;
    this.rows = sheet.places.map((p, i) => this.row(p, i));
    this.list.replaceChildren(...this.rows.map((r) => r.root));
    const places = Object.fromEntries(sheet.places.map((p, i) => [String(i), `${i + 1}  ${p.title}`]));
    const boxes = (["deep", "superficial"] as const).map((which) => {
      const box = make("div", `extent ${which}`);
      const own = Object.fromEntries(Object.entries(places).filter(([i]) => sheet.places[Number(i)]!.superficial === (which === "superficial")));
      const send = (): void => {
        const [from, to] = [...box.querySelectorAll("select")].map((s) => s.value);
        this.actions.enter({ [which]: from && to ? [Number(from), Number(to)] : [] });
      };
      const choice = (name: string): HTMLSelectElement => {
        const s = select(name, {}, "", () => {
          if ([...box.querySelectorAll("select")].every((x) => x.value) || !s.value) send();
        });
        s.append(new Option("\u2013", ""), ...Object.entries(own).map(([value, title]) => new Option(title, value)));
        return s;
      };
      box.append(make("span", "caption", t(`sheet.clot_${which}`)), choice(t("sheet.upper_end")), make("span", "caption", t("sheet.to")), choice(t("sheet.lower_end")));
      return box;
    });
    this.ends.replaceChildren(...boxes);
    this.impression.value = sheet.text;
  }

  private row(p: SheetPlace, i: number): Row {
    const enter = (entry: object): void => this.actions.enter({ place: i, ...entry });
    const root = make("div", "sheet-row");
    const [pair, clot, found] = [make("div", "thumbs"), make("span", "clot-words"), make("div", "found-chips")];
    const name = button(`${i + 1}  ${p.title}`, () => this.go(i, true), "name");
    const buttons = FOUND.map((f) => {
      const b = button(f.name, () => this.found(i, f.finding), f.finding);
      b.title = FINDING_WORDS[f.finding];
      return b;
    });
    const age = select(t("sheet.age"), AGE_WORDS, t("sheet.age.none"), (v) => enter({ age: v }));
    const kind = select(t("sheet.kind"), KIND_WORDS, t("sheet.kind.none"), (v) => enter({ kind: v }));
    const reflux = select(t("sheet.reflux"), REFLUX_WORDS, t("sheet.reflux.none"), (v) => enter({ reflux: v }));
    const seconds = make("input");
    Object.assign(seconds, { placeholder: "s", inputMode: "decimal", maxLength: 5, className: "seconds" });
    seconds.setAttribute("aria-label", t("sheet.reflux_s"));
    seconds.oninput = () => this.later(`s${i}`, () => {
      const value = Number.parseFloat(seconds.value.replace(",", "."));
      enter({ reflux_s: value >= 0 && value <= 20 ? value : null });
    });
    const text = make("input");
    Object.assign(text, { placeholder: t("sheet.note"), maxLength: 200, autocomplete: "off" });
    text.setAttribute("aria-label", t("sheet.note_on", { place: p.title }));
    text.oninput = () => this.later(`t${i}`, () => enter({ text: text.value }));
    found.append(...buttons);
    clot.append(age, kind);
    const words = make("div", "sheet-words");
    const second = make("div", "second");
    second.append(reflux, seconds, text);
    const first = make("div", "first");
    first.append(found, clot);
    words.append(name, first, second);
    root.append(pair, words);
    return { root, pair, found: buttons, clot, age, kind, reflux, seconds, text };
  }

  /** Writes a finding; a new clot begins as the one described before it. It counts at once, not when the program's answer comes. */
  private put(i: number, finding: Finding): void {
    const places = this.sheet!.places;
    const own = places[i]!;
    const model = isClot(finding) && !own.age && !own.kind ? [...places.slice(0, i)].reverse().find((p) => isClot(p.finding)) : undefined;
    this.actions.enter({ place: i, finding, ...(model ? { age: model.age, kind: model.kind } : {}) });
    own.finding = finding;
  }

  /** What its stations make of a segment. */
  private called(segment: string): Decision {
    const of = this.sheet!.places.filter((p) => p.segment === segment).map((p) => p.finding);
    if (of.some(isClot)) return "clot";
    if (of.includes("")) return "";
    return of.includes("not_seen") ? "not_seen" : "compressible";
  }

  private found(i: number, finding: Finding): void {
    const own = this.sheet!.places[i]!;
    this.put(i, own.finding === finding ? "" : finding);
    this.at = i;
    this.actions.decide(own.segment, this.called(own.segment));
    this.fill();
  }

  private thumbs(place: number): HTMLElement[] {
    const sheet = this.sheet!;
    return (["without", "with"] as const).map((view) => {
      const p = newest(sheet, place, view);
      if (!p) return make("span", "thumb none", t(`sheet.${view}`));
      const shot = drawPicture(sheet, p, this.source(p));
      const edit = make("span", "edit");
      const swap = button("\u21c4", () => this.actions.enter({ change: p.number, view: view === "with" ? "without" : "with" }));
      swap.title = t(view === "with" ? "sheet.is_without" : "sheet.is_with");
      const drop = button("\u00d7", () => this.actions.enter({ change: p.number, drop: true }));
      drop.title = t("sheet.drop");
      swap.setAttribute("aria-label", swap.title);
      drop.setAttribute("aria-label", drop.title);
      edit.append(swap, drop);
      const box = make("span", "thumb");
      box.title = `${minutes(p.time_s)}, ${shown(p.force_n, 1)} N`;
      box.append(shot, ...(this.controls ? [edit] : []));
      return box;
    });
  }

  private fill(): void {
    const sheet = this.sheet;
    if (!sheet || !this.rows.length) return;
    const here = sheet.places[this.at]!;
    find("station-name").textContent = t("sheet.station", { n: this.at + 1, of: sheet.places.length, place: [sideWord(sheet), here.title].filter(Boolean).join(", ") });
    find("station-found").textContent = FINDING_WORDS[here.finding];
    find("station-thumbs").replaceChildren(...this.thumbs(this.at));
    for (const id of ["store-picture", "station-before", "station-after"]) find<HTMLButtonElement>(id).disabled = !this.controls;
    this.rows.forEach((row, i) => this.mark(row, i));
    const any = (superficial: boolean): boolean => sheet.places.some((p) => p.superficial === superficial && isClot(p.finding));
    for (const which of ["deep", "superficial"] as const) {
      const box = this.ends.querySelector<HTMLElement>(`.${which}`)!;
      box.hidden = !any(which === "superficial") && sheet[which].length === 0;
      if (sheet[which].length === 2) box.querySelectorAll("select").forEach((s, k) => (s.value = String(sheet[which][k])));
      box.querySelectorAll("select").forEach((s) => (s.disabled = !this.controls));
    }
    for (const b of this.chips.querySelectorAll("button")) {
      b.setAttribute("aria-pressed", String(b.dataset.value === sheet.conclusion));
      b.disabled = !this.controls;
    }
    this.impression.disabled = !this.controls;
    if (document.activeElement !== this.impression) this.impression.value = sheet.text;
    if (this.dialog.open) this.paint();
  }

  private mark(row: Row, i: number): void {
    const p = this.sheet!.places[i]!;
    const clot = isClot(p.finding);
    row.root.classList.toggle("here", i === this.at);
    row.root.dataset.finding = p.finding;
    row.found.forEach((b, k) => {
      b.setAttribute("aria-pressed", String(p.finding === FOUND[k]!.finding));
      b.disabled = !this.controls;
    });
    row.clot.hidden = !clot;
    row.seconds.hidden = p.reflux !== "present";
    for (const [box, value] of [[row.age, p.age], [row.kind, p.kind], [row.reflux, p.reflux]] as const) {
      if (document.activeElement !== box) box.value = value;
      box.disabled = !this.controls;
    }
    if (document.activeElement !== row.seconds) row.seconds.value = typeof p.reflux_s === "number" ? decimal(String(p.reflux_s)) : "";
    if (document.activeElement !== row.text) row.text.value = p.text;
    row.text.disabled = row.seconds.disabled = !this.controls;
    const key = `${["without", "with"].map((v) => newest(this.sheet!, i, v as "with")).map((x) => (x ? `${x.number}${x.view}${this.source(x).length}` : "")).join()}${this.controls}`;
    if (row.pair.dataset.key === key) return;
    row.pair.dataset.key = key;
    row.pair.replaceChildren(...this.thumbs(i));
  }

  // ---- reading, printing, saving

  private about(): About {
    const exam = this.exam;
    return [[t("sheet.patient"), exam?.title], [t("start.protocol"), this.actions.protocol(exam?.protocol ?? "")], [t("sheet.examiner"), this.actions.learner()],
      [t("sheet.time"), exam ? minutes(exam.elapsed_s) : ""], [t("sheet.exam"), this.sheet?.exam], [t("sheet.question"), exam?.history]];
  }

  private draw(): HTMLElement {
    return drawSheet(this.sheet!, this.about(), (p) => this.source(p));
  }

  private preview(): void {
    if (!this.sheet) return;
    const row = make("div", "actions");
    row.append(button(t("sheet.print"), () => window.print(), "primary"), button(t("sheet.json"), () => this.save()), make("span", "spring"), button(t("page.close"), () => this.dialog.close()));
    this.dialog.replaceChildren(make("div", "paper"), row);
    this.painted = "";
    if (!this.dialog.open) this.dialog.showModal();
    this.paint();
  }

  /** The paper is drawn anew only when it says something else: who reads and clicks is not disturbed. */
  private paint(): void {
    const key = `${JSON.stringify(this.sheet)}${[...this.pixels.values()].filter(Boolean).length}`;
    const paper = this.dialog.querySelector(".paper");
    if (!paper || key === this.painted) return;
    this.painted = key;
    paper.replaceChildren(this.draw());
  }

  /** The browser prints the worksheet of the exam, whatever is on the screen. */
  private layOut(): void {
    const print = find("print");
    document.body.classList.toggle("prints-sheet", this.sheet !== null);
    print.replaceChildren(...(this.sheet ? [this.draw()] : []));
  }

  private save(): void {
    const sheet = this.sheet!;
    const { type: _type, pictures, ...rest } = sheet;
    const about = { sonde_worksheet: 1, trainee: this.actions.learner(), title: this.exam?.title, history: this.exam?.history, protocol: this.actions.protocol(this.exam?.protocol ?? "") };
    const english = (_key: string, value: unknown): unknown => (typeof value === "string" ? original(value) : value); // programs read it
    const shots = pictures.map((p) => ({ ...p, image: this.source(p).replace(/^data:image\/png;base64,/, "") }));
    const link = make("a");
    link.href = `data:application/json;charset=utf-8,${encodeURIComponent(JSON.stringify({ ...about, ...rest, pictures: shots }, english, 1))}`;
    link.download = `worksheet-${sheet.exam}.json`;
    link.click();
  }
}
