// After the exam: the score, whether the diagnosis was right, what was found and missed, and where to
// go from here.

import { button, draw, find, make } from "./dom";
import type { Exam, PressResult, Result, ScorePart } from "./protocol";
import { finding, PRESS_WORDS } from "./words";
import { language, shown, t } from "./words/language";

export interface ResultActions {
  replay(exam: string): void;
  again(caseId: string): void;
  next(caseId: string): void;
  close(): void;
  /** back to a lesson; its practice once more */
  lesson(id: string): void;
  repeat(id: string, turn: number): void;
  comment(): void;
  /** of the worksheet; null: none was written */
  worksheet(): HTMLElement | null;
}

function ring(result: Result): HTMLElement {
  const r = 46;
  const round = 2 * Math.PI * r;
  const svg = draw("svg", { viewBox: "0 0 120 120", role: "img", "aria-label": t("result.score_of", { score: result.score.toFixed(0) }) });
  const part = (round * Math.max(0, Math.min(100, result.score))) / 100;
  svg.append(
    draw("circle", { cx: 60, cy: 60, r, class: "track" }),
    draw("circle", { cx: 60, cy: 60, r, class: "part", "stroke-dasharray": `${part} ${round}`, transform: "rotate(-90 60 60)" }),
    draw("text", { x: 60, y: 66, "text-anchor": "middle", class: "score" }, result.score.toFixed(0)),
    draw("text", { x: 60, y: 84, "text-anchor": "middle", class: "of" }, t("result.of")),
  );
  const box = make("div", `ring ${result.passed ? "good" : "bad"}`);
  box.append(svg);
  return box;
}

/** The head already says whether it is passed. */
function beyondVerdict(summary: string): string {
  const said = [`${t("result.passed")}. `, `${t("result.not_passed")}: `].find((head) => summary.startsWith(head)) ?? "";
  const rest = summary.slice(said.length);
  return rest.charAt(0).toUpperCase() + rest.slice(1);
}

/** "6 x vein closed, 1 x too hard" */
function tally(exam: Exam): string {
  const count = new Map<PressResult, number>();
  for (const p of exam.presses) count.set(p.result, (count.get(p.result) ?? 0) + 1);
  const parts = [...count].map(([result, n]) => `${n} × ${PRESS_WORDS[result]}`);
  return parts.length ? parts.join(", ") : t("result.no_compression");
}

function segments(exam: Exam): HTMLElement {
  const table = make("table");
  const head = make("tr");
  for (const name of [t("result.segment"), t("result.compressions"), t("result.your_finding")]) head.append(make("th", "", name));
  table.append(head);
  for (const s of exam.segments.filter((x) => x.needed || x.decision || x.done)) {
    const row = make("tr");
    const done = s.done >= s.points;
    row.append(make("td", "", s.title), make("td", done ? "good" : "warn", t("result.n_of", { n: s.done, of: s.points })), make("td", s.decision ? "" : "warn", finding(s.decision)));
    table.append(row);
  }
  return table;
}

/** The score part by part: what was lost, where and why. */
function parts(list: ScorePart[]): HTMLElement {
  const table = make("table", "parts");
  const head = make("tr");
  for (const name of [t("result.score"), t("result.points"), t("result.where")]) head.append(make("th", "", name));
  table.append(head);
  for (const p of list) {
    const row = make("tr");
    const full = p.lost === "";
    const lost = full ? t("result.nothing_lost") : t("result.lost", { points: shown(p.of - p.points, 1), why: p.lost });
    row.append(make("td", "", p.title), make("td", full ? "good" : "warn", t("result.n_of", { n: shown(p.points, 1), of: p.of })), make("td", "", lost));
    table.append(row);
  }
  return table;
}

/** The result beside the lesson's bar. */
function barWords(exam: Exam): HTMLElement {
  const { bar, reached } = exam.lesson!;
  const box = make("p", `bar-result ${reached ? "good" : "warn"}`);
  const alone = exam.guidance === "exam" ? "" : ` ${t("result.bar_alone")}`;
  box.append(make("b", "", `${reached ? t("result.bar_reached") : t("result.bar_missed")} `), t("result.bar_words", { points: bar!.score, mean: shown(bar!.mean, 1), sd: shown(bar!.sd, 1), runs: bar!.runs }) + alone);
  return box;
}

export class ResultDialog {
  private readonly box = find<HTMLDialogElement>("result");
  private shown = "";

  constructor(private readonly actions: ResultActions) {
    this.box.oncancel = (e) => e.preventDefault();
  }

  hide(): void {
    this.shown = "";
    this.box.close();
  }

  /** `comments`: who sees it may comment on the exam. */
  show(exam: Exam, controls: boolean, comments: boolean): void {
    const result = exam.result;
    const key = `${exam.exam} ${controls} ${comments} ${this.actions.worksheet() !== null}`;
    if (!result || key === this.shown) return;
    this.shown = key;
    const head = make("h2", result.passed ? "good" : "bad", result.passed ? t("result.passed") : t("result.not_passed"));
    head.id = "result-title";
    const words = make("div", "words");
    words.append(head, make("p", "case-name", exam.title), make("p", "summary", beyondVerdict(result.summary)));
    const top = make("div", "top");
    top.append(ring(result), words);
    const body: HTMLElement[] = [top, this.diagnosis(result)];
    if (exam.lesson?.bar) body.push(barWords(exam));
    if (result.note) body.push(make("p", "note", result.note));
    if (result.parts) body.push(parts(result.parts));
    const sheet = exam.lesson ? null : this.actions.worksheet();
    if (sheet) body.push(sheet);
    this.box.replaceChildren(...body, segments(exam), make("p", "tally", t("result.tally", { tally: tally(exam) })), this.foot(exam, result, controls, comments));
    if (!this.box.open) this.box.showModal();
    this.box.querySelector<HTMLElement>("a.primary")?.focus();
  }

  private diagnosis(result: Result): HTMLElement {
    const box = make("dl", result.correct ? "good" : "bad");
    box.append(make("dt", "", t("result.said")), make("dd", "", result.diagnosis.asked), make("dt", "", t("result.truth")), make("dd", "", result.diagnosis.truth));
    const verdict = make("strong", "", result.correct ? t("result.right") : t("result.wrong"));
    box.append(verdict);
    return box;
  }

  private foot(exam: Exam, result: Result, controls: boolean, comments: boolean): HTMLElement {
    const row = make("div", "actions");
    const report = make("a", "primary button", t("result.report"));
    Object.assign(report, { href: `.${result.report}#lang=${language}`, target: "_blank", rel: "noopener" });
    const l = exam.lesson;
    const later = [
      button(t("result.replay"), () => this.actions.replay(exam.exam)),
      button(t("result.again"), () => (l ? this.actions.repeat(l.id, l.turn) : this.actions.again(exam.case))),
      l ? button(t("film.on"), () => this.actions.lesson(l.id)) : button(t("result.next"), () => this.actions.next(exam.case)),
    ];
    later[0]!.disabled = !exam.recording;
    for (const b of later) b.disabled ||= !controls;
    if (comments) later.push(button(t("page.comment"), () => (this.box.close(), this.actions.comment())));
    row.append(report, ...later, make("span", "spring"), button(t("page.close"), () => (this.box.close(), controls && this.actions.close())));
    return row;
  }
}
