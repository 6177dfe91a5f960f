// The start: choose a case with its history, a protocol, a level of guidance and a name; or practise.

import type { ExamWish } from "./connection";
import { button, find, make, recall, remember } from "./dom";
import type { CaseInfo, Guidance, Hello } from "./protocol";
import { CourseView, type CourseActions } from "./course";
import { GUIDANCE, LEVELS } from "./words";
import { choose, language, LANGUAGES, t, type Language } from "./words/language";

interface Choice {
  id: string;
  title: string;
  text: string;
  tag?: string;
}

function cards(name: string, legend: string, list: Choice[], chosen: string, change: (id: string) => void): HTMLElement {
  const box = make("fieldset", `cards ${name}`);
  box.append(make("legend", "caption", legend));
  for (const c of list) {
    const row = make("label", "card");
    const input = make("input");
    Object.assign(input, { type: "radio", name, value: c.id, checked: c.id === chosen });
    input.onchange = () => change(c.id);
    const words = make("span", "words");
    words.append(make("b", "", c.title), make("span", "", c.text));
    row.append(input, words);
    if (c.tag) row.append(make("i", "level", c.tag));
    box.append(row);
  }
  return box;
}

/** Buttons of which one is pressed. */
function chips(label: string, choices: { id: string; title: string }[], chosen: string, change: (id: string) => void): HTMLElement {
  const box = make("div", "chips");
  box.setAttribute("role", "group");
  box.setAttribute("aria-label", label);
  for (const c of choices) {
    const chip = button(c.title, () => change(c.id));
    chip.id = `tab-${c.id || "all"}`;
    chip.setAttribute("aria-pressed", String(c.id === chosen));
    box.append(chip);
  }
  return box;
}

/** The language of the page: each by its own name. */
function languages(): HTMLElement {
  const box = make("select");
  box.id = "language";
  box.setAttribute("aria-label", t("language.label"));
  for (const [id, name] of Object.entries(LANGUAGES)) box.append(Object.assign(make("option", "", name), { value: id, lang: id }));
  box.value = language;
  box.onchange = () => choose(box.value as Language);
  return box;
}

export class StartDialog {
  private hello: Hello | null = null;
  private wish: ExamWish = { case: "", protocol: "", guidance: "full", trainee: "" };
  private readonly box = find<HTMLDialogElement>("start");
  private taught = true; // the course is in view
  private level = ""; // of the cases in view; empty: all
  readonly course: CourseView;

  constructor(
    private readonly start: (wish: ExamWish) => void,
    private readonly practise: () => void,
    teach: Omit<CourseActions, "changed">,
  ) {
    this.course = new CourseView({
      watch: (lesson) => teach.watch(lesson),
      practise: (lesson, turn) => teach.practise(lesson, turn),
      changed: () => this.hello && this.build(this.hello),
    });
  }

  get trainee(): string {
    return this.wish.trainee;
  }

  get isOpen(): boolean {
    return this.box.open;
  }

  close(): void {
    this.box.close();
  }

  /** The case after the one that was just examined. */
  next(after: string): string {
    const list = this.hello?.case_list ?? [];
    return list[(list.findIndex((c) => c.id === after) + 1) % Math.max(1, list.length)]?.id ?? after;
  }

  greet(hello: Hello): void {
    this.hello = hello;
    const cases = hello.case_list ?? [];
    const protocols = hello.protocols ?? [];
    const keep = (list: { id: string }[], id: string): string => (list.some((x) => x.id === id) ? id : (list[0]?.id ?? ""));
    const first = cases.find((c) => c.level === "first")?.id ?? "";
    this.wish = {
      case: keep(cases, this.wish.case || first),
      protocol: keep(protocols, this.wish.protocol || recall("protocol")),
      guidance: (recall("guidance") as Guidance) || "full",
      trainee: hello.trainee || recall("trainee"),
    };
    this.course.greet(hello.course ?? [], this.wish.trainee);
  }

  open(caseId?: string): void {
    if (!this.hello?.trainer || this.box.open) return;
    if (caseId) this.wish.case = caseId, this.level = "";
    this.taught = this.course.any && !caseId && recall("start") !== "exams";
    this.build(this.hello);
    this.box.showModal();
    find<HTMLButtonElement>("start-go").focus();
    this.reveal();
  }

  /** Opens the course at a lesson, or at the next one. */
  teach(lesson: string): void {
    if (!this.hello || this.box.open) return;
    this.course.choose(lesson);
    remember("start", "course");
    this.open();
  }

  private reveal(): void {
    this.box.querySelector(".cards.case input:checked")?.closest(".card")?.scrollIntoView({ block: "nearest" });
  }

  /** Starts the same way as last time, with another case or the same again. */
  again(caseId: string): void {
    this.wish.case = caseId;
    this.go();
  }

  private build(hello: Hello): void {
    const focused = (document.activeElement as HTMLElement | null)?.id || (document.activeElement instanceof HTMLInputElement ? `${document.activeElement.name}=${document.activeElement.value}` : "");
    if (this.taught) this.box.replaceChildren(this.head(), this.course.build(), this.foot());
    else this.exams(hello);
    if (!this.box.open) return;
    // Who came by keyboard stays where he was.
    const [name, value] = focused.split("=");
    const same = value === undefined ? document.getElementById(focused) : this.box.querySelector<HTMLElement>(`input[name="${name}"][value="${value}"]`);
    (same ?? find("start-go")).focus();
    this.reveal();
  }

  private head(): HTMLElement {
    const row = make("div", "start-head");
    const head = make("h2", "", t("start.title"));
    head.id = "start-title";
    row.append(head, languages());
    if (!this.course.any) return row;
    const views = [{ id: "course", title: t("start.course") }, { id: "exams", title: t("start.exams") }];
    row.append(chips(t("start.course_or_exams"), views, this.taught ? "course" : "exams", (view) => {
      this.taught = view === "course";
      remember("start", view);
      if (this.hello) this.build(this.hello);
    }));
    return row;
  }

  private exams(hello: Hello): void {
    const intro = recall("trained") ? t("start.choose") : t("start.new");
    const all = hello.case_list ?? [];
    const levels = [...new Set(all.map((c: CaseInfo) => c.level))];
    const cases = this.seen(all).map((c: CaseInfo) => ({ id: c.id, title: c.title, text: c.history, tag: LEVELS[c.level] }));
    const row = make("div", "start-head");
    const choices = [{ id: "", title: t("start.all", { n: all.length }) }, ...levels.map((id) => ({ id: id as string, title: LEVELS[id] }))];
    row.append(make("p", "intro", intro));
    if (levels.length > 1) row.append(chips(t("start.levels"), choices, this.level, (level) => this.choose(level, hello)));
    const left = cards("case", t("start.case"), cases, this.wish.case, (id) => (this.wish.case = id));
    const right = make("div", "options");
    const guidance = (Object.keys(GUIDANCE) as Guidance[]).map((id) => ({ id, title: GUIDANCE[id][0], text: GUIDANCE[id][1] }));
    right.append(
      cards("protocol", t("start.protocol"), hello.protocols ?? [], this.wish.protocol, (id) => (this.wish.protocol = id)),
      cards("guidance", t("start.guidance"), guidance, this.wish.guidance, (id) => (this.wish.guidance = id as Guidance)),
      this.name(),
    );
    const columns = make("div", "columns");
    columns.append(left, right);
    this.box.replaceChildren(this.head(), row, columns, this.foot());
  }

  private seen(list: CaseInfo[]): CaseInfo[] {
    return list.filter((c) => !this.level || c.level === this.level);
  }

  /** Shows the cases of one level; one of them is chosen. */
  private choose(level: string, hello: Hello): void {
    this.level = level;
    const seen = this.seen(hello.case_list ?? []);
    if (!seen.some((c) => c.id === this.wish.case)) this.wish.case = seen[0]?.id ?? "";
    this.build(hello);
  }

  private name(): HTMLElement {
    const box = make("label", "field");
    const input = make("input");
    Object.assign(input, { id: "trainee", maxLength: 40, value: this.wish.trainee, placeholder: t("start.name_hint"), autocomplete: "off" });
    input.oninput = () => (this.wish.trainee = input.value.trim());
    input.onkeydown = (e) => e.key === "Enter" && this.go();
    box.append(make("span", "caption", t("page.your_name")), input);
    return box;
  }

  private foot(): HTMLElement {
    const row = make("div", "actions");
    const go = button(this.taught ? this.course.goWords : t("start.go"), () => this.go(), "primary big");
    go.id = "start-go";
    const free = button(t("page.free_practice"), () => (this.box.close(), this.practise()));
    const note = this.taught ? this.course.foot() : [make("span", "caption note", t("start.free_note"))];
    row.append(free, ...note, make("span", "spring"), go);
    return row;
  }

  private go(): void {
    if (this.taught) return void (this.course.go() && this.box.close());
    remember("protocol", this.wish.protocol);
    remember("guidance", this.wish.guidance);
    remember("trainee", this.wish.trainee);
    this.box.close();
    this.start({ ...this.wish });
  }
}
