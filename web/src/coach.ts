// Says to a newcomer, one sentence at a time and next to the thing, what to do in the first guided
// exam. Each sentence goes when it has been done.

import { find, press, recall, remember } from "./dom";
import type { Exam } from "./protocol";
import { t } from "./words/language";

export interface Mark {
  id: string;
  anchor: string;
  text: string;
  /** whether there is something to do just now */
  due(exam: Exam): boolean;
  done(exam: Exam): boolean;
}

const there = (exam: Exam): boolean => {
  const { target, offset_mm } = exam.step;
  return target !== null && offset_mm !== null && offset_mm <= target.radius_mm;
};
const away = (exam: Exam): boolean => exam.step.target !== null && !there(exam);
const judged = (state: string | undefined): boolean => state === "complete" || state === "open";
// From here on the bar says to let go.
const pressed = (exam: Exam): boolean => judged(exam.compression?.state) || exam.presses.some((p) => judged(p.result));
// The bar says to let go and press again; the coach says nothing else beside it.
const spoiled = (exam: Exam): boolean => exam.compression?.state === "too_hard" || exam.compression?.state === "off_axis";
const asked = (exam: Exam): boolean => exam.step.segment !== "";
const decided = (exam: Exam): boolean => exam.segments.some((s) => s.decision !== "");

const MARKS: Mark[] = [
  { id: "move", anchor: "stage", text: t("coach.move"), due: away, done: there },
  { id: "press", anchor: "press", text: t("coach.press"), due: (exam) => there(exam) && !spoiled(exam), done: pressed },
  { id: "decide", anchor: "decide", text: t("coach.decide"), due: asked, done: decided },
];

/** The sentence that is due: the first that was neither seen nor done, when there is something to do
 *  for it just now. */
export function dueMark(exam: Exam, seen: ReadonlySet<string>): Mark | null {
  const next = MARKS.find((m) => !seen.has(m.id) && !m.done(exam));
  return next?.due(exam) ? next : null;
}

export class Coach {
  private readonly box = find("coach");
  private seen = new Set(recall("coach").split(" "));

  constructor() {
    press("coach-close", () => this.close());
  }

  private now: Mark | null = null;

  private close(): void {
    if (this.now) this.seen.add(this.now.id);
    remember("coach", [...this.seen].join(" "));
    this.place(null);
  }

  show(exam: Exam | null, controls: boolean): void {
    const coaching = exam !== null && exam.phase === "running" && exam.guidance === "full" && controls;
    if (!coaching) return this.place(null);
    if (this.now?.done(exam)) this.close(); // done while it was in view
    this.place(dueMark(exam, this.seen));
  }

  private place(mark: Mark | null): void {
    this.now = mark;
    this.box.hidden = mark === null;
    if (!mark) return;
    find("coach-text").textContent = mark.text;
    this.box.dataset.at = mark.id;
    const a = find(mark.anchor).getBoundingClientRect();
    const b = this.box.getBoundingClientRect();
    const [x, y] =
      mark.id === "move" ? [a.left + (a.width - b.width) / 2, a.bottom - b.height - 64]
      : mark.id === "press" ? [a.left - b.width - 14, a.bottom - b.height - 10]
      : [Math.min(a.left + 10, innerWidth - b.width - 12), a.bottom + 12];
    Object.assign(this.box.style, { left: `${Math.max(8, x)}px`, top: `${Math.max(8, y)}px` });
    this.box.style.setProperty("--tip", `${a.left + Math.min(a.width, 200) / 2 - Math.max(8, x)}px`);
  }
}
