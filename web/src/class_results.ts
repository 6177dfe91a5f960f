// The results of a class: learners, cases with their difficulty, learning curves, and files to keep.

import { button, draw, make, minutes } from "./dom";
import { t, told } from "./words/language";

export interface ResultEntry {
  id: string;
  trainee: string;
  case: string;
  title: string;
  protocol: string;
  guidance: string;
  date: string;
  score: number;
  passed: boolean;
  correct: boolean;
  seconds: number;
  hints: number;
}

const mean = (list: number[]): number => list.reduce((sum, v) => sum + v, 0) / list.length;

export function median(list: number[]): number {
  const sorted = [...list].sort((a, b) => a - b);
  const half = Math.floor(sorted.length / 2);
  return sorted.length % 2 ? sorted[half]! : (sorted[half - 1]! + sorted[half]!) / 2;
}

export interface Item {
  id: string;
  title: string;
  exams: number;
  learners: number;
  score: number;
  passed: number;
  /** share of exams with a wrong diagnosis: 0 easy, 1 hard */
  difficulty: number;
  /** mean score of the better half of the learners less that of the other half; NaN: fewer than two on either side */
  discrimination: number;
}

const groups = (list: ResultEntry[], key: (e: ResultEntry) => string): [string, ResultEntry[]][] => {
  const found = new Map<string, ResultEntry[]>();
  for (const e of list) found.set(key(e), [...(found.get(key(e)) ?? []), e]);
  return [...found].sort((a, b) => a[0].localeCompare(b[0]));
};

/** Cases from the hardest to the easiest. A learner is in the better half by the mean over all cases. */
export function itemsOf(list: ResultEntry[]): Item[] {
  const means = new Map(groups(list, (e) => e.trainee).map(([name, own]) => [name, mean(own.map((e) => e.score))]));
  const middle = median([...means.values()]);
  return groups(list, (e) => e.case)
    .map(([id, own]) => {
      const better = own.filter((e) => means.get(e.trainee)! > middle).map((e) => e.score);
      const other = own.filter((e) => means.get(e.trainee)! <= middle).map((e) => e.score);
      return {
        id,
        title: told(own[0]!.title),
        exams: own.length,
        learners: new Set(own.map((e) => e.trainee)).size,
        score: mean(own.map((e) => e.score)),
        passed: own.filter((e) => e.passed).length,
        difficulty: own.filter((e) => !e.correct).length / own.length,
        discrimination: better.length > 1 && other.length > 1 ? mean(better) - mean(other) : NaN,
      };
    })
    .sort((a, b) => b.difficulty - a.difficulty || a.score - b.score);
}

function table(heads: string[], rows: (string | number)[][]): HTMLElement {
  const element = make("table");
  const row = (tag: "th" | "td", cells: (string | number)[]): HTMLElement => {
    const line = make("tr");
    cells.forEach((cell, i) => line.append(make(tag, i > 0 && typeof (rows[0]?.[i] ?? "") === "number" ? "number" : "", typeof cell === "number" ? (Number.isNaN(cell) ? "-" : String(cell)) : cell)));
    return line;
  };
  element.append(row("th", heads), ...rows.map((cells) => row("td", cells)));
  return element;
}

/** Scores of one learner exam by exam, with the median of the last five. */
function curve(name: string, own: ResultEntry[]): HTMLElement {
  const box = make("div");
  const [width, height, left, top, foot] = [260, 110, 26, 8, 8];
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${name}: ${own.map((e) => e.score.toFixed(0)).join(", ")}` });
  const x = (i: number): number => left + ((width - left - 8) * (i + 0.5)) / own.length;
  const y = (score: number): number => top + (height - top - foot) * (1 - score / 100);
  for (const mark of [0, 50, 100]) svg.append(draw("line", { x1: left, x2: width, y1: y(mark), y2: y(mark), class: "grid" }), draw("text", { x: left - 4, y: y(mark) + 4, "text-anchor": "end" }, String(mark)));
  const medians = own.map((_, i) => median(own.slice(Math.max(0, i - 4), i + 1).map((e) => e.score)));
  svg.append(draw("polyline", { points: medians.map((v, i) => `${x(i)},${y(v)}`).join(" ") }));
  own.forEach((e, i) => svg.append(draw("circle", { cx: x(i), cy: y(e.score), r: 3.5, class: e.passed ? "good" : "bad" })));
  box.append(make("p", "", name), svg);
  return box;
}

function part(title: string, ...content: (HTMLElement | string)[]): HTMLElement {
  const section = make("section");
  section.append(make("h2", "", title), ...content);
  return section;
}

export async function showResults(room: HTMLElement, secret: string): Promise<void> {
  const fetched = async (path: string): Promise<Response> => {
    const answer = await fetch(path, { headers: { Authorization: `Bearer ${secret}` }, cache: "no-store" });
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  };
  const save = async (path: string): Promise<void> => {
    const link = make("a");
    link.href = URL.createObjectURL(await (await fetched(path)).blob());
    link.download = path;
    link.click();
    URL.revokeObjectURL(link.href);
  };
  let list: ResultEntry[];
  try {
    list = ((await (await fetched("results.json")).json()) as { exams?: ResultEntry[] }).exams ?? [];
  } catch {
    room.replaceChildren(make("p", "empty warn", t("class.unread")));
    return;
  }
  const files = make("div");
  files.append(button(t("class.save_csv"), () => void save("results.csv")), " ", button(t("class.save_xapi"), () => void save("statements.jsonl")));
  if (!list.length) {
    room.replaceChildren(make("p", "empty muted", t("class.no_exam")), files);
    return;
  }
  list.sort((a, b) => a.date.localeCompare(b.date));
  const learners = groups(list, (e) => e.trainee);
  const curves = make("div", "curves");
  curves.append(...learners.map(([name, own]) => curve(name, own)));
  const round = (v: number, digits = 0): number => (Number.isNaN(v) ? NaN : Number(v.toFixed(digits)));
  room.replaceChildren(
    part(t("class.learners"), table([t("class.learner"), t("class.exams"), t("class.passed"), t("class.right"), t("class.mean"), t("class.best"), t("class.last")], learners.map(([name, own]) => [name, own.length, own.filter((e) => e.passed).length, own.filter((e) => e.correct).length, round(mean(own.map((e) => e.score))), round(Math.max(...own.map((e) => e.score))), own[own.length - 1]!.date.slice(0, 10)]))),
    part(t("class.cases"), table([t("class.case"), t("class.exams"), t("class.learners"), t("class.mean"), t("class.passed"), t("class.difficulty"), t("class.discrimination")], itemsOf(list).map((i) => [i.title, i.exams, i.learners, round(i.score), i.passed, round(i.difficulty, 2), round(i.discrimination)])), make("p", "muted", t("class.items_note"))),
    part(t("class.curves"), make("p", "muted", t("class.curves_note")), curves),
    part(t("class.exams"), table([t("class.date"), t("class.learner"), t("class.case"), t("class.score"), t("class.time")], [...list].reverse().slice(0, 200).map((e) => [e.date.replace("T", " ").replace("Z", ""), e.trainee, told(e.title), round(e.score), minutes(e.seconds)]))),
    part(t("class.files"), files),
  );
}
