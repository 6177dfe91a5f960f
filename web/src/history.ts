// My exams: a learning curve and the list, with report and replay of each.

import { button, draw, find, label, make, minutes } from "./dom";
import type { ExamEntry } from "./protocol";
import { language, t } from "./words/language";

const CURVE = { width: 880, height: 110, left: 30, right: 10, top: 8, foot: 16 };

/** Scores from the oldest to the newest exam. */
function curve(list: ExamEntry[]): SVGElement {
  const scored = list.filter((e) => e.score !== null).reverse();
  const svg = draw("svg", { viewBox: `0 0 ${CURVE.width} ${CURVE.height}`, role: "img", class: "curve", "aria-label": t("history.scores", { n: scored.length, scores: scored.map((e) => e.score!.toFixed(0)).join(", ") }) });
  const span = CURVE.height - CURVE.top - CURVE.foot;
  const y = (score: number): number => CURVE.top + span * (1 - score / 100);
  const x = (i: number): number => CURVE.left + ((CURVE.width - CURVE.left - CURVE.right) * (i + 0.5)) / Math.max(1, scored.length);
  for (const mark of [0, 50, 100])
    svg.append(
      draw("line", { x1: CURVE.left, x2: CURVE.width - CURVE.right, y1: y(mark), y2: y(mark), class: "grid" }),
      draw("text", { x: CURVE.left - 6, y: y(mark) + 4, "text-anchor": "end" }, String(mark)),
    );
  svg.append(draw("polyline", { points: scored.map((e, i) => `${x(i)},${y(e.score!)}`).join(" "), class: "path" }));
  scored.forEach((e, i) => svg.append(draw("circle", { cx: x(i), cy: y(e.score!), r: 4, class: e.passed ? "good" : "bad" })));
  return svg;
}

export class HistoryDialog {
  private readonly box = find<HTMLDialogElement>("exams");
  private list: ExamEntry[] = [];
  private trainee = "";

  constructor(private readonly replay: (exam: string) => void, private readonly files: (exam: ExamEntry) => void) {}

  /** Opens with what is known; the list comes with the next message. */
  open(trainee: string): void {
    this.trainee = trainee;
    this.build();
    if (!this.box.open) this.box.showModal();
  }

  close(): void {
    this.box.close();
  }

  fill(list: ExamEntry[]): void {
    this.list = list;
    if (this.trainee && !list.some((e) => e.trainee === this.trainee)) this.trainee = "";
    if (this.box.open) this.build();
  }

  private build(): void {
    const head = make("div", "head");
    const title = make("h2", "", t("page.exams_button"));
    title.id = "exams-title";
    head.append(title, make("span", "spring"), this.who());
    const mine = this.trainee ? this.list.filter((e) => e.trainee === this.trainee) : this.list;
    const row = make("div", "actions");
    const close = button(t("page.close"), () => this.box.close(), "primary");
    row.append(make("span", "spring"), close);
    const nothing = make("p", "intro", t("history.none"));
    this.box.replaceChildren(head, ...(mine.length ? [curve(mine), this.table(mine)] : [nothing]), row);
    if (this.box.open) close.focus();
  }

  private who(): HTMLElement {
    const names = [...new Set(this.list.map((e) => e.trainee))].sort();
    if (names.length < 2) return make("span");
    const select = make("select");
    select.setAttribute("aria-label", t("history.learner"));
    for (const name of ["", ...names.filter((n) => n)]) {
      const option = make("option", "", name || t("history.all"));
      option.value = name;
      option.selected = name === this.trainee;
      select.append(option);
    }
    select.onchange = () => {
      this.trainee = select.value;
      this.build();
    };
    return select;
  }

  private table(list: ExamEntry[]): HTMLElement {
    const scroll = make("div", "scroll");
    scroll.tabIndex = 0;
    scroll.setAttribute("aria-label", t("history.list"));
    scroll.setAttribute("role", "region");
    const table = make("table");
    const head = make("tr");
    for (const name of [t("history.date"), t("start.case"), t("history.learner"), t("start.protocol"), t("history.score"), t("history.time"), ""]) head.append(make("th", "", name));
    table.append(head, ...list.map((e) => this.row(e)));
    scroll.append(table);
    return scroll;
  }

  private row(e: ExamEntry): HTMLElement {
    const row = make("tr");
    const date = new Date(e.date);
    const when = Number.isNaN(date.getTime()) ? e.date : date.toLocaleString(language, { dateStyle: "medium", timeStyle: "short" });
    const score = make("td", e.passed ? "good" : "bad", e.score === null ? t("history.no_score") : t(e.passed ? "history.passed" : "history.not_passed", { score: e.score.toFixed(0) }));
    const does = make("td", "does");
    const report = make("a", "button", t("history.report"));
    Object.assign(report, { href: `.${e.report}#lang=${language}`, target: "_blank", rel: "noopener" });
    report.setAttribute("aria-label", t("history.report_of", { title: e.title, when }));
    const replay = button(t("page.replay"), () => (this.box.close(), this.replay(e.id)));
    replay.setAttribute("aria-label", t("history.replay_of", { title: e.title, when }));
    replay.disabled = !e.recording;
    const files = button(t("export.files"), () => this.files(e));
    files.setAttribute("aria-label", t("export.files_of_when", { title: e.title, when }));
    does.append(report, replay, files);
    row.append(make("td", "", when), make("td", "", e.title), make("td", "", e.trainee), make("td", "", label(e.protocol)), score, make("td", "", minutes(e.seconds)), does);
    return row;
  }
}
