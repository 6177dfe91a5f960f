// The course in the start's dialog: lessons with what is done and what comes next, the steps of the
// chosen one, its questions, and the progress as a file.

import { announce, button, find, make } from "./dom";
import { drawn, Progress, type Step } from "./progress";
import type { Exam, Lesson } from "./protocol";
import { counted, shown, t } from "./words/language";

export interface CourseActions {
  watch(lesson: string): void;
  practise(lesson: string, turn: number): void;
  /** the view has changed and is to be shown again */
  changed(): void;
}

const TICK = "✓";

export class CourseView {
  readonly progress = new Progress();
  private course: Lesson[] = [];
  private chosen = -1;
  private asking = false;
  private noted = ""; // exam whose result is kept

  constructor(private readonly actions: CourseActions) {}

  get any(): boolean {
    return this.course.length > 0;
  }

  greet(course: Lesson[], trainee: string): void {
    this.course = course;
    this.progress.of(trainee);
    if (this.chosen < 0 || this.chosen >= course.length) this.chosen = this.progress.current(course);
  }

  /** Opens at a lesson, or at the one that is next. */
  choose(id: string): void {
    const at = this.course.findIndex((l) => l.id === id);
    this.chosen = at >= 0 ? at : this.progress.current(this.course);
    this.asking = false;
  }

  /** The result of a repetition is kept once; the demonstration counts when it has come to its end. */
  see(exam: Exam): void {
    const lesson = this.course.find((l) => l.id === exam.lesson?.id);
    if (!lesson || !exam.lesson) return;
    if (exam.phase === "film" && exam.film?.over) this.progress.watch(lesson);
    if (exam.phase !== "done" || !exam.result || this.noted === exam.exam) return;
    this.noted = exam.exam;
    this.progress.practised(lesson, exam.lesson.turn, exam.result.score, exam.lesson.reached);
  }

  // ---- the dialog's parts ----------------------------------------------------------------------

  build(): HTMLElement {
    const lesson = this.course[this.chosen];
    const columns = make("div", "columns course");
    columns.append(this.list(), lesson ? (this.asking ? this.quiz(lesson) : this.lesson(lesson)) : make("div"));
    return columns;
  }

  /** What the dialog's first button does now, in words. */
  get goWords(): string {
    const lesson = this.course[this.chosen];
    if (!lesson) return t("course.start");
    const step = this.progress.next(lesson);
    if (this.asking) return t("course.back");
    if (step.kind === "watch") return t("course.watch");
    if (step.kind === "practise") return t("course.practise", { n: step.turn + 1, of: lesson.practice.length });
    if (step.kind === "quiz") return t("course.answer");
    return this.chosen + 1 < this.course.length ? t("course.next") : t("course.watch_again");
  }

  /** Does that; true when the dialog is done with. */
  go(): boolean {
    const lesson = this.course[this.chosen];
    if (!lesson) return true;
    if (this.asking) return (this.asking = false), this.actions.changed(), false;
    const step = this.progress.next(lesson);
    if (step.kind === "passed" && this.chosen + 1 < this.course.length) return this.chosen++, this.actions.changed(), false;
    return this.take(lesson, step.kind === "passed" ? { kind: "watch" } : step);
  }

  private take(lesson: Lesson, step: Step): boolean {
    if (step.kind === "watch") return this.actions.watch(lesson.id), true;
    if (step.kind === "practise") return this.actions.practise(lesson.id, step.turn), true;
    this.asking = step.kind === "quiz";
    this.actions.changed();
    return false;
  }

  private list(): HTMLElement {
    const box = make("fieldset", "cards case lessons");
    box.append(make("legend", "caption", t("course.lessons")));
    const current = this.progress.current(this.course);
    this.course.forEach((l, k) => {
      const row = make("label", "card");
      const input = make("input");
      Object.assign(input, { type: "radio", name: "lesson", value: l.id, checked: k === this.chosen });
      input.onchange = () => {
        this.chosen = k;
        this.asking = false;
        this.actions.changed();
      };
      const step = this.progress.next(l);
      const done = this.progress.done(l);
      const share = [done.watched, ...done.turns.map((t) => t !== null), ...(l.quiz.length ? [done.answered.every(Boolean)] : [])];
      const words = make("span", "words");
      words.append(make("b", "", `${k + 1}. ${l.title}`), this.dots(share, step.kind === "passed"));
      row.append(input, words);
      if (step.kind === "passed") row.append(make("i", "level passed", t("course.passed", { tick: TICK })));
      else if (k === current) row.append(make("i", "level next", t("course.comes_next")));
      box.append(row);
    });
    return box;
  }

  private dots(share: boolean[], passed: boolean): HTMLElement {
    const dots = make("span", "steps");
    const count = share.filter(Boolean).length;
    dots.append(...share.map((on) => make("i", on || passed ? "on" : "")));
    dots.setAttribute("role", "img");
    dots.setAttribute("aria-label", t("course.steps_done", { n: count, of: share.length }));
    return dots;
  }

  private lesson(l: Lesson): HTMLElement {
    const box = make("div", "options lesson");
    const done = this.progress.done(l);
    const step = this.progress.next(l);
    box.append(make("h3", "", l.title), make("p", "goal", l.goal));
    if (l.patient) box.append(make("p", "patient", l.patient));
    const list = make("ol", "path");
    list.append(this.row(t("course.watch_title"), counted("course.watch_places", l.places), done.watched, step.kind === "watch", () => this.take(l, { kind: "watch" })));
    l.practice.forEach((level, turn) => {
      const did = done.turns[turn];
      const barred = level === "exam" && l.bar;
      const words = level === "full" ? t("course.full") : level === "hints" ? t("course.hints") : t("course.alone");
      const scored = !did ? words : t(!barred ? "course.points" : did.reached ? "course.points_reached" : "course.points_below", { words, points: did.score.toFixed(0) });
      const good = did !== null && did !== undefined && (!barred || did.reached);
      const title = drawn(l) ? t("course.patient", { n: turn + 1 }) : t(`course.practise_${level}`, { n: turn + 1 });
      list.append(this.row(title, scored, good, step.kind === "practise" && step.turn === turn, () => this.take(l, { kind: "practise", turn })));
    });
    if (l.quiz.length) {
      const right = done.answered.filter(Boolean).length;
      list.append(this.row(t("course.questions"), t("course.answered", { n: right, of: l.quiz.length }), right === l.quiz.length, step.kind === "quiz", () => this.take(l, { kind: "quiz" })));
    }
    box.append(list);
    if (l.bar) {
      box.append(make("p", "bar-words", t("course.bar", { points: l.bar.score, mean: shown(l.bar.mean, 1), sd: shown(l.bar.sd, 1), runs: l.bar.runs, seconds: l.bar.time_s.toFixed(0) })));
    }
    return box;
  }

  private row(title: string, words: string, done: boolean, next: boolean, action: () => boolean): HTMLElement {
    const row = make("li", `${done ? "done" : ""}${next ? " next" : ""}`);
    const go = button(done ? t("course.again") : t("course.go"), () => action() && find<HTMLDialogElement>("start").close());
    go.setAttribute("aria-label", done ? t("course.again_label", { title }) : t("course.go_label", { title }));
    const text = make("span", "words");
    text.append(make("b", "", title), make("span", "", words));
    row.append(make("i", "tick", done ? TICK : ""), text, go);
    return row;
  }

  // ---- questions -------------------------------------------------------------------------------

  private quiz(l: Lesson): HTMLElement {
    const box = make("div", "options quiz");
    const done = this.progress.done(l);
    box.append(make("h3", "", t("course.questions_of", { title: l.title })));
    l.quiz.forEach((q, k) => {
      const field = make("fieldset", "question");
      const why = make("p", "why");
      why.setAttribute("role", "status");
      field.append(make("legend", "", `${k + 1}. ${q.ask}`));
      q.choices.forEach((choice, c) => {
        const row = make("label", "choice");
        const input = make("input");
        Object.assign(input, { type: "radio", name: `question-${k}`, value: String(c), checked: done.answered[k] === true && c === q.right });
        const say = (): void => {
          const right = c === q.right;
          for (const other of field.querySelectorAll(".choice")) other.classList.remove("good", "bad");
          row.classList.add(right ? "good" : "bad");
          why.textContent = right ? t("course.right", { why: q.why }) : t("course.not_so");
          if (right) this.progress.answer(l, k);
          announce(why.textContent);
        };
        input.onchange = say;
        row.append(input, make("span", "", choice));
        if (input.checked) row.classList.add("good"), (why.textContent = q.why);
        field.append(row);
      });
      field.append(why);
      box.append(field);
    });
    return box;
  }

  // ---- as a file -------------------------------------------------------------------------------

  foot(): HTMLElement[] {
    const file = make("input");
    Object.assign(file, { type: "file", accept: "application/json,.json", hidden: true });
    file.onchange = async () => {
      const text = await file.files?.[0]?.text();
      const good = text !== undefined && this.progress.load(text);
      announce(good ? t("course.read") : t("course.no_progress"));
      this.choose("");
      this.actions.changed();
    };
    const save = button(t("course.save"), () => {
      const link = make("a");
      link.href = URL.createObjectURL(new Blob([this.progress.text()], { type: "application/json" }));
      link.download = "sonde-progress.json";
      link.click();
      URL.revokeObjectURL(link.href);
    });
    return [save, button(t("course.load"), () => file.click()), file];
  }
}
