// What a learner has done of the course: kept in this browser under his name, saved to a file and
// read from one.

import { recall, remember } from "./dom";
import type { Lesson } from "./protocol";

export interface Done {
  watched: boolean;
  /** of each repetition its best score and whether that reached the bar; null: not done */
  turns: ({ score: number; reached: boolean } | null)[];
  /** questions whose right answer was found */
  answered: boolean[];
}

export type Step = { kind: "watch" } | { kind: "practise"; turn: number } | { kind: "quiz" } | { kind: "passed" };

export class Progress {
  private all: Record<string, Done> = {};
  private name = "";

  constructor() {
    this.of("");
  }

  /** Whose progress it is. */
  of(trainee: string): void {
    this.name = trainee;
    this.all = parse(recall(this.key)) ?? {};
  }

  private get key(): string {
    return this.name ? `course.${this.name}` : "course";
  }

  done(lesson: Lesson): Done {
    const kept = this.all[lesson.id];
    return {
      watched: kept?.watched ?? false,
      turns: lesson.practice.map((_, k) => kept?.turns[k] ?? null),
      answered: lesson.quiz.map((_, k) => kept?.answered[k] ?? false),
    };
  }

  private keep(lesson: Lesson, done: Done): void {
    this.all[lesson.id] = done;
    remember(this.key, JSON.stringify(this.all));
  }

  watch(lesson: Lesson): void {
    this.keep(lesson, { ...this.done(lesson), watched: true });
  }

  answer(lesson: Lesson, question: number): void {
    const done = this.done(lesson);
    done.answered[question] = true;
    this.keep(lesson, done);
  }

  /** A repetition's result. Patients that are drawn are examined in a row: one that is missed begins it anew. */
  practised(lesson: Lesson, turn: number, score: number, reached: boolean): void {
    const done = this.done(lesson);
    const before = done.turns[turn];
    if (!before || score >= before.score || reached) done.turns[turn] = { score, reached: reached || (before?.reached ?? false) };
    if (drawn(lesson) && !reached) done.turns = done.turns.map(() => null);
    this.keep(lesson, done);
  }

  /** What comes next in a lesson. Repetitions with help have only to be done, those without reach the bar. */
  next(lesson: Lesson): Step {
    const done = this.done(lesson);
    if (!done.watched) return { kind: "watch" };
    const turn = done.turns.findIndex((t, k) => !t || (lesson.practice[k] === "exam" && !t.reached));
    if (turn >= 0) return { kind: "practise", turn };
    return done.answered.every(Boolean) ? { kind: "passed" } : { kind: "quiz" };
  }

  /** The first lesson that is not passed. */
  current(course: Lesson[]): number {
    const at = course.findIndex((l) => this.next(l).kind !== "passed");
    return at < 0 ? course.length - 1 : at;
  }

  text(): string {
    return JSON.stringify({ sonde_progress: 1, trainee: this.name, date: new Date().toISOString(), lessons: this.all }, null, 1);
  }

  /** Takes a saved file over; false when it is none. */
  load(text: string): boolean {
    const lessons = parse(text, true);
    if (!lessons) return false;
    this.all = lessons;
    remember(this.key, JSON.stringify(this.all));
    return true;
  }
}

export const drawn = (lesson: Lesson): boolean => lesson.patient === "";

/** Lessons of a text; what does not look like one is left out. */
function parse(text: string, saved = false): Record<string, Done> | null {
  try {
    const root = JSON.parse(text) as Record<string, unknown>;
    if (saved && root.sonde_progress !== 1) return null;
    const from = (saved ? root.lessons : root) as Record<string, Partial<Done>>;
    const good = Object.entries(from).filter(([, d]) => Array.isArray(d?.turns) && Array.isArray(d?.answered));
    return Object.fromEntries(
      good.map(([id, d]) => [
        id,
        {
          watched: d.watched === true,
          turns: d.turns!.map((t) => (typeof t?.score === "number" ? { score: t.score, reached: t.reached === true } : null)),
          answered: d.answered!.map((a) => a === true),
        },
      ]),
    );
  } catch {
    return null;
  }
}
