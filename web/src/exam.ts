// The exam's bar: the next step, the segments with what was done and found, findings by buttons and
// keys, hint, leave, and finish with a question first.

import { announce, button, find, make, press } from "./dom";
import type { Decision, Exam, Segment } from "./protocol";
import type { Feedback } from "./feedback";
import { finding, FINDINGS } from "./words";
import { amid, t } from "./words/language";

export interface ExamActions {
  decide(segment: string, decision: Decision): void;
  hint(): void;
  finish(): void;
  leave(): void;
  /** writes a finding at the station at hand; what the segment is called then, null: there is no worksheet */
  write(segment: string, decision: Decision): Decision | null;
  /** a segment was chosen */
  chosen(segment: string): void;
  /** what else is still open before the end, in a sentence */
  gaps(): string;
}

interface Cell {
  root: HTMLButtonElement;
  dots: HTMLElement;
  finding: HTMLElement;
}

export class ExamBar {
  private exam: Exam | null = null;
  private controls = false;
  private chosen = "";
  private near = ""; // the segment that the probe was last above
  private asked = ""; // the segment that the guidance asks for
  private cells = new Map<string, Cell>();
  private readonly box = find("segments");
  private readonly choices: HTMLButtonElement[];

  constructor(private readonly actions: ExamActions) {
    this.choices = FINDINGS.map((f) => {
      const b = button(f.name, () => this.decide(f.decision), `finding ${f.decision}`);
      b.append(make("kbd", "", f.key));
      b.title = f.help;
      return b;
    });
    find("decisions").append(...this.choices);
    press("hint-button", () => actions.hint());
    press("leave-button", () => actions.leave());
    press("finish-button", () => this.askFinish());
    this.box.onkeydown = (e) => this.arrow(e);
  }

  show(exam: Exam, controls: boolean): void {
    if (exam.exam !== this.exam?.exam) this.cells.clear(); // another exam begins at its first segment
    this.exam = exam;
    this.controls = controls;
    this.sayStep(exam);
    find("hint-button").hidden = exam.guidance !== "hints";
    for (const id of ["leave-button", "finish-button", "decide"]) find(id).hidden = !controls;
    if (!controls) find("hint-button").hidden = true;
    const complete = exam.segments.every((s) => !s.needed || s.decision !== "");
    find("finish-button").classList.toggle("primary", complete); // not before there is something to finish
    this.fill(exam.segments);
    this.obey(exam);
    if (!exam.segments.some((s) => s.id === this.chosen)) this.chosen = exam.segments[0]?.id ?? "";
    this.mark(exam.segments);
  }

  /** The tag of the press under way. */
  tell(said: Feedback): void {
    const tag = find("compression");
    tag.hidden = said.tag === "";
    if (tag.textContent !== said.tag) tag.textContent = said.tag;
    tag.dataset.state = said.state;
  }

  /** The segment that the guidance asks for is chosen, once: the learner may choose another. */
  private obey(exam: Exam): void {
    const asked = exam.step.segment;
    if (asked === this.asked) return;
    this.asked = asked;
    this.near = "";
    if (asked) this.chosen = asked;
  }

  private sayStep(exam: Exam): void {
    const hint = exam.hint !== "";
    const text = exam.step.text || (exam.guidance === "exam" ? t("exam.examine") : "");
    find("step-text").textContent = text;
    find("step-detail").textContent = hint ? t("exam.hint", { hint: exam.hint }) : exam.step.detail;
    find("step-detail").title = find("step-detail").textContent; // all of it, where the line is too short
    find("step-detail").classList.toggle("hinted", hint);
    announce(hint ? `${text} ${t("exam.hint", { hint: exam.hint })}` : text);
  }

  private fill(segments: Segment[]): void {
    if (segments.length === this.cells.size && segments.every((s) => this.cells.has(s.id))) return;
    this.cells = new Map(segments.map((s) => [s.id, this.cell(s)]));
    this.box.replaceChildren(...[...this.cells.values()].map((c) => c.root));
    this.chosen = (segments.find((s) => s.needed) ?? segments[0])?.id ?? "";
    this.near = this.asked = "";
  }

  private cell(s: Segment): Cell {
    const root = button("", () => this.choose(s.id), "segment");
    const [dots, found] = [make("span", "dots"), make("span", "found")];
    root.setAttribute("role", "radio");
    root.title = s.needed ? s.title : t("exam.not_in_protocol", { segment: s.title });
    root.append(make("span", "name", s.title), dots, found);
    return { root, dots, finding: found };
  }

  private mark(segments: Segment[]): void {
    for (const s of segments) {
      const cell = this.cells.get(s.id)!;
      const on = s.id === this.chosen;
      cell.root.setAttribute("aria-checked", String(on));
      cell.root.tabIndex = on ? 0 : -1;
      cell.root.dataset.decision = s.decision;
      cell.root.classList.toggle("done", s.points > 0 && s.done >= s.points);
      cell.root.classList.toggle("spare", !s.needed);
      cell.dots.classList.toggle("word", !s.needed || s.points > 5);
      cell.dots.textContent = s.needed ? (s.points > 5 ? `${s.done} / ${s.points}` : "●".repeat(Math.min(s.done, s.points)) + "○".repeat(Math.max(0, s.points - s.done))) : t("exam.not_asked");
      cell.finding.textContent = s.decision ? finding(s.decision) : "";
      cell.root.setAttribute(
        "aria-label",
        s.needed ? t("exam.segment_state", { segment: s.title, done: s.done, points: s.points, finding: amid(finding(s.decision)) })
          : t("exam.segment_not_asked", { segment: s.title, finding: amid(finding(s.decision)) }),
      );
    }
    const now = segments.find((s) => s.id === this.chosen);
    find("decide-title").textContent = now ? t("exam.finding_of", { segment: now.title }) : t("page.finding");
    const due = now !== undefined && now.needed && now.done >= now.points && now.decision === "" && this.exam?.guidance !== "exam";
    find("decide").classList.toggle("due", due);
    this.choices.forEach((b, i) => {
      b.disabled = !this.controls || !now;
      b.setAttribute("aria-pressed", String(now?.decision === FINDINGS[i]!.decision));
    });
  }

  /** With guidance the finding follows the probe while none is asked for: z along the leg, mm. */
  follow(z_mm: number, touching: boolean): void {
    if (!this.exam || this.exam.guidance === "exam" || this.asked || !touching) return;
    const s = this.exam.segments.find((x) => x.needed && z_mm >= Math.min(x.from_mm, x.to_mm) && z_mm <= Math.max(x.from_mm, x.to_mm));
    if (!s || s.id === this.near) return;
    this.near = s.id;
    this.choose(s.id);
  }

  /** From outside: the bar follows. */
  select(id: string): void {
    this.chosen = id;
    if (this.exam) this.mark(this.exam.segments);
  }

  private choose(id: string): void {
    this.chosen = id;
    this.actions.chosen(id);
    if (this.exam) this.mark(this.exam.segments);
  }

  private step(by: number): void {
    const all = this.exam?.segments ?? [];
    const i = all.findIndex((s) => s.id === this.chosen);
    const next = all[Math.max(0, Math.min(all.length - 1, i + by))];
    if (next) this.choose(next.id);
  }

  private arrow(e: KeyboardEvent): void {
    const by = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[e.key];
    if (by === undefined) return;
    this.step(by);
    this.cells.get(this.chosen)?.root.focus();
    e.preventDefault();
    e.stopPropagation();
  }

  /** The same finding again takes it back. */
  private decide(decision: Decision): void {
    const now = this.exam?.segments.find((s) => s.id === this.chosen);
    if (!now || !this.controls) return;
    // At a station of the worksheet the finding is that station's, and the segment's follows.
    const next = this.actions.write(now.id, decision) ?? (now.decision === decision ? "" : decision);
    this.actions.decide(now.id, next);
    announce(t("exam.said", { segment: now.title, finding: finding(next) }));
  }

  key(code: string, shift: boolean): boolean {
    if (this.exam?.phase !== "running") return false;
    const f = FINDINGS.find((x) => x.code === code);
    if (f) this.decide(f.decision);
    else if (code === "Comma") this.step(-1);
    else if (code === "Period") this.step(1);
    else if (code === "KeyU" && this.exam.guidance === "hints") this.actions.hint();
    else if (code === "Enter" && shift) this.askFinish();
    else return false;
    return true;
  }

  private askFinish(): void {
    if (!this.exam || !this.controls) return;
    const open = this.exam.segments.filter((s) => s.needed && s.decision === "").map((s) => s.title);
    const box = find<HTMLDialogElement>("finish");
    const head = make("h2", "", t("exam.finish_title"));
    head.id = "finish-title";
    const words = open.length ? t("exam.open", { segments: open.join(", ") }) : t("exam.all_found");
    const row = make("div", "actions");
    const done = button(t("exam.finish"), () => (box.close(), this.actions.finish()), "primary");
    row.append(button(t("exam.go_on"), () => box.close()), done);
    const gaps = this.actions.gaps();
    box.replaceChildren(head, make("p", open.length ? "warn" : "", words), ...(gaps ? [make("p", "warn", gaps)] : []), row);
    box.showModal();
    done.focus();
  }
}
