// The report of an exam for the learner: result, answer and truth, what to take away, the score's parts, the vein
// with every press, the learner's own images, force over time, earlier exams, measures.

import { type Child, h, s } from "./dom";
import { COLOURS, DECISIONS, type Entry, type Exam, isGood, type Press, pressCount, WORDS } from "./exam_data";
import { drawScores, drawTraces, drawVein, pressMark } from "./exam_drawings";
import { type Advice, toWorkOn, wentWell } from "./exam_words";
import { fixed, isKnown, type Real } from "./number";
import { type Cell, columns, table } from "./table";
import { drawSheet, type SheetPicture } from "./worksheet";
import { capital, counted, dress, language, t, translated } from "../words/language";

const GUIDANCE = { full: t("guidance.full"), hints: t("guidance.hints"), exam: t("guidance.exam") };
const LISTED = 9; // exams in the table of earlier ones
const SHORT = 24; // a list of presses that stands open

const quiet = (...children: Child[]): HTMLElement => h("p", { class: "quiet" }, ...children);
const section = (id: string, title: string, ...children: Child[]): HTMLElement => h("section", { id }, h("h2", {}, title), ...children);
const strong = (words: string): HTMLElement => h("b", {}, words);
const verdict = (good: boolean, words: string): HTMLElement => h("span", { class: good ? "yes" : "no" }, `${good ? "\u2713" : "\u2717"} ${words}`);

/** Value and unit; a dash for what is not known. */
const withUnit = (value: Real, decimals: number, unit: string): string => (isKnown(value) ? `${fixed(value, decimals)} ${unit}` : fixed(value, 0));
const inPercent = (share: Real): string => fixed(isKnown(share) ? 100 * share : share, 0);
const percent = (share: Real): string => `${inPercent(share)}${isKnown(share) ? " %" : ""}`;

function duration(seconds: Real): string {
  if (!isKnown(seconds) || seconds < 0) return fixed(seconds, 0);
  const whole = Math.floor(seconds);
  return `${t("report.minutes", { time: `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}` })}`;
}

/** 22 November 2026, 04:40 UTC */
function dateInWords(date: string): string {
  const parts = /^(\d{4})-(\d\d)-(\d\d)T(\d\d:\d\d):\d\dZ$/.exec(date);
  if (!parts || Number.isNaN(Date.parse(date))) return date;
  const day = new Intl.DateTimeFormat(language === "en" ? "en-GB" : language, { dateStyle: "long", timeZone: "UTC" }).format(new Date(date));
  return `${day}, ${parts[4]} UTC`;
}

/** Segment and centimetres from the groin, or that the vein was not in view. */
function placeOf(data: Exam, press: Press): string {
  if (!isKnown(press.along_mm)) return t("report.not_in_view");
  const title = data.vein.segments.find((segment) => segment.id === press.segment)?.title;
  return title ? t("report.place", { place: title, cm: fixed(press.along_mm / 10, 1) }) : `${fixed(press.along_mm / 10, 1)} cm`;
}

function figure(drawing: SVGElement, name: string, title: string, caption: string): HTMLElement {
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label", title);
  return h("figure", { id: `figure-${name}`, class: "full" }, drawing, h("figcaption", {}, caption));
}

// ---- the head

/** The score as a ring. */
function dial(score: number, passed: boolean): SVGElement {
  const round = 2 * Math.PI * 54;
  const ring = { cx: 66, cy: 66, r: 54, fill: "none", "stroke-width": 11 };
  return s(
    "svg",
    { class: "fig dial", role: "img", "aria-label": t("report.score_of", { score: fixed(score, 0) }), viewBox: "0 0 132 132", width: 132, height: 132 },
    s("circle", { ...ring, stroke: "#e4e9ed" }),
    s("circle", { ...ring, stroke: passed ? "#00795a" : "#b3261e", "stroke-dasharray": `${((round * score) / 100).toFixed(1)} ${round.toFixed(1)}`, transform: "rotate(-90 66 66)" }),
    s("text", { x: 66, y: 74, class: "middle", style: "font-size:38px;font-weight:680" }, fixed(score, 0)),
    s("text", { x: 66, y: 93, class: "middle", style: "font-size:12.5px;fill:#55616b" }, t("result.of")),
  );
}

function head(data: Exam): HTMLElement {
  const { exam, score } = data;
  const about: Child[] = [
    exam.trainee && strong(exam.trainee),
    exam.date && dateInWords(exam.date),
    data.protocol?.title ?? exam.protocol,
    exam.guidance && t("report.guidance", { level: exam.guidance in GUIDANCE ? GUIDANCE[exam.guidance as keyof typeof GUIDANCE] : exam.guidance }),
  ];
  const meta = h("p", { class: "meta" });
  for (const child of about) if (child) meta.append(...(meta.hasChildNodes() ? [" \u00b7 "] : []), child);
  const said = [`${t("result.passed")}. `, `${t("result.not_passed")}: `, `${t("result.not_passed")}. `].find((words) => score.summary.startsWith(words)) ?? "";
  const sentence = capital(score.summary.slice(said.length)); // the tag says these words already
  return h("header", {}, h("div", { class: "top" },
    h("div", {},
      h("p", { class: "eyebrow" }, t("report.eyebrow")),
      h("h1", {}, exam.title),
      meta,
      h("p", { class: "verdict" }, h("span", { class: `tag ${score.passed ? "good" : "bad"}` }, score.passed ? t("result.passed") : t("result.not_passed")), sentence),
      data.interrupted && quiet(t("report.interrupted"))),
    dial(score.score, score.passed)));
}

function question(data: Exam): HTMLElement {
  const { score, patient, protocol } = data;
  const card = (look: string, title: string, words: string): HTMLElement => h("div", { class: `card ${look}` }, h("h3", {}, title), h("p", {}, words));
  const answer = score.correct ? t("report.answer_right") : score.answered ? t("report.answer_wrong") : t("report.answer_none");
  return section("question", t("report.question"),
    patient.history && h("p", { class: "text" }, patient.history),
    protocol?.text && quiet(t("report.protocol", { title: protocol.title, text: protocol.text })),
    h("div", { class: "cards" },
      card(score.correct ? "right" : "wrong", answer, score.diagnosis || t("report.no_answer")),
      card("", t("result.truth"), score.truth || patient.diagnosis || (score.thrombosis ? t("report.dvt") : t("report.no_dvt")))));
}

function advice(data: Exam): HTMLElement {
  const list = (title: string, items: Advice[], none: string): HTMLElement =>
    h("div", {}, h("h3", {}, title), items.length
      ? h("ul", {}, ...items.map(([about, sentence]) => h("li", {}, about && strong(about), about && ": ", sentence)))
      : h("p", {}, none));
  const good = wentWell(data);
  return section("advice", t("report.advice"), h("div", { class: "two" },
    list(t("report.work_on"), toWorkOn(data), t("report.nothing")),
    good.length > 0 && list(t("report.went_well"), good, "")));
}

function score(data: Exam): HTMLElement {
  const sum = data.parts.reduce((points, part) => points + part.points, 0);
  const rows: Cell[][] = data.parts.map((part) => {
    const bar = h("i");
    bar.style.width = `${Math.min(100, Math.max(0, (100 * part.points) / part.of)).toFixed(1)}%`;
    const lost = part.lost ? h("div", {}, strong(t("report.lost_of", { points: fixed(part.of - part.points, 1), of: fixed(part.of, 0) })), ` ${part.lost}.`) : "";
    return [strong(part.title), h("div", {}, part.meaning, lost, h("span", { class: "bar" }, bar)), t("report.n_of", { n: fixed(part.points, 1), of: fixed(part.of, 0) })];
  });
  const total = t("sheet.score_of", { score: fixed(data.score.score, 1) });
  return section("score", t("report.score"),
    table({ columns: columns(`<${t("report.part")}`, `<${t("report.part_meaning")}`, t("result.points")), rows: [...rows.map((cells) => ({ cells })), { cells: [t("result.score"), "", total], strong: true }] }),
    sum > data.score.score + 0.05 &&
      h("p", {}, t("report.capped", { sum: fixed(sum, 1), score: fixed(data.score.score, 1) })));
}

// ---- the vein, the images, the traces

function along(data: Exam): HTMLElement {
  const hidden = data.presses.filter((p) => !isKnown(p.along_mm)).length;
  const caption =
    t(data.vein.clot ? "report.along.clot" : "report.along.plain") + (hidden ? ` ${counted("report.hidden", hidden)}` : "");
  const rows = data.segments.map((v, i) => {
    const asked = v.needed || v.decision !== "";
    const right = !v.decision ? t("report.not_decided") : !v.correct ? t("report.wrong") : v.supported ? t("report.right") : t("report.not_shown");
    const cells: Cell[] = [strong(`${i + 1}. ${v.title}`), asked ? DECISIONS[v.decision] : t("report.not_in_protocol"), v.truth ? DECISIONS[v.truth] : "\u2013",
      asked ? verdict(v.correct, right) : "\u2013", t("report.n_of", { n: v.places_done, of: v.places })];
    return { cells };
  });
  return section("vein", t("report.along"),
    figure(drawVein(data), "vein", t("report.vein_figure"), caption),
    h("h3", {}, t("report.by_segment")),
    table({ columns: columns(`<${t("result.segment")}`, `<${t("result.said")}`, `<${t("result.truth")}`, `<${t("report.verdict")}`, t("report.places_well")), rows }),
    quiet(t("report.shown_note")));
}

function pictures(data: Exam): HTMLElement | null {
  if (!data.presses.length) return null;
  if (!data.pictures.length) return section("pictures", t("report.pictures"), h("p", {}, t("report.no_images")));
  const side = (bytes: string | null, number: number, label: string): HTMLElement =>
    h("div", {}, bytes ? h("img", { alt: t("report.image_of", { n: number, label }), src: `data:image/png;base64,${bytes}` }) : h("em", {}, t("report.no_image")), h("span", {}, label));
  const pairs = data.pictures.map(({ press, before, peak }) => {
    const p = data.presses[press - 1]!;
    const title = h("b", {}, t("report.press_result", { n: press, result: WORDS[p.result] }));
    title.style.color = COLOURS[p.result];
    const force = fixed(p.force_peak_n, 1);
    return h("figure", {}, h("div", { class: "images" }, side(before, press, t("report.before")), side(peak, press, t("report.peak"))),
      h("figcaption", {}, title, h("br"), placeOf(data, p), h("br"), isKnown(p.vein) ? t("report.vein_left", { force, percent: percent(p.vein) }) : `${force} N`));
  });
  const all = t(pairs.length < data.presses.length ? "report.pictures_some" : "report.pictures_all", { n: pairs.length, of: data.presses.length });
  return section("pictures", t("report.pictures"), quiet(`${all} ${t("report.pictures_note")}`),
    h("div", { class: "pictures" }, ...pairs));
}

/** What the learner wrote, beside the truth; it prints alone too. */
function worksheet(data: Exam): HTMLElement | null {
  const sheet = data.worksheet;
  if (!sheet) return null;
  const source = (p: SheetPicture): string => (p.image ? `data:image/png;base64,${p.image}` : "");
  const print = h("button", { type: "button", class: "save alone" }, t("report.print_alone"));
  print.onclick = () => {
    document.body.classList.add("sheet-alone");
    window.print();
    document.body.classList.remove("sheet-alone");
  };
  const { exam: e, patient, protocol } = data;
  return section("worksheet", t("report.worksheet"), h("p", {}, print),
    drawSheet(sheet, [[t("sheet.patient"), e.title], [t("start.protocol"), protocol?.title ?? e.protocol], [t("sheet.examiner"), e.trainee], [t("sheet.date"), e.date && dateInWords(e.date)], [t("sheet.exam"), e.exam], [t("sheet.question"), patient.history]], source));
}

const traces = (data: Exam): HTMLElement | null =>
  data.traces.time_s.length < 2 ? null : section("traces", t("report.traces"),
    figure(drawTraces(data), "traces", t("report.traces_figure"),
      t("report.traces_note")));

// ---- earlier exams, measures, presses

function earlier(data: Exam): HTMLElement {
  if (data.exams.length < 2) return section("earlier", t("report.earlier"), h("p", {}, t("report.first")));
  const same = data.exams.slice(1).filter((e) => e.same_patient && !e.interrupted);
  const best = Math.max(...same.map((e) => e.score));
  const [before, now] = [data.curve[data.curve.length - 2], data.curve[data.curve.length - 1]];
  const median = before && now && !data.interrupted
    ? `${t("report.median", { n: now.number, now: fixed(now.median, 0), before: fixed(before.median, 0) })} ` : "";
  const seen = same.length ? counted("report.seen", same.length, { best: fixed(best, 0) }) : t("report.new");
  const result = (e: Entry): Cell => (e.interrupted ? t("report.was_interrupted") : verdict(e.passed, e.passed ? t("report.passed") : e.correct ? t("report.not_passed") : t("report.wrong_diagnosis")));
  const rows = data.exams.slice(0, LISTED).map((e, i) => ({
    strong: i === 0,
    cells: [strong(i === 0 ? t("report.this_exam", { title: e.title }) : e.title), h("span", { class: "line" }, e.date.slice(0, 16).replace("T", " ")), fixed(e.score, 0), result(e), percent(e.coverage), percent(e.valid_share),
      withUnit(isKnown(e.time_s) ? e.time_s / 60 : e.time_s, 1, "min")],
  }));
  return section("earlier", t("report.earlier"),
    h("p", {}, median + seen),
    before && figure(drawScores(data), "curve", t("report.curve"),
      t("report.curve_note")),
    table({ columns: columns(`<${t("sheet.patient")}`, `<${t("report.date")}`, t("result.score"), `<${t("report.result")}`, t("report.coverage"), t("report.good_presses"), t("report.time")), rows }),
    data.exams.length > LISTED && quiet(t("report.more_earlier", { n: data.exams.length - LISTED })));
}

function measures(data: Exam): HTMLElement {
  const m = data.metrics;
  const scaled = (value: Real, scale: number): Real => (isKnown(value) ? value * scale : value);
  const rows: [string, string, string][] = [
    [t("report.places_well"), t("report.n_of", { n: m.places_done, of: m.places }), t("report.m.places")],
    [t("report.coverage"), percent(m.coverage), t("report.m.coverage")],
    [t("report.vein_coverage"), percent(m.vein_coverage), t("report.m.vein_coverage")],
    [t("report.gap"), withUnit(scaled(m.largest_gap_mm, 0.1), 1, "cm"), t("report.m.gap")],
    [t("report.good_presses"), t("report.n_of", { n: m.complete + m.open, of: pressCount(data) }), t("report.m.good")],
    [t("report.completeness"), percent(m.completeness), t("report.m.completeness")],
    [t("report.peak_force"), withUnit(m.force_peak_n, 1, "N"), t("report.m.peak_force")],
    [t("report.usual_force"), withUnit(m.force_p95_n, 1, "N"), t("report.m.usual_force")],
    [t("report.time"), duration(m.time_s), t("report.m.time")],
    [t("report.skin_time"), duration(m.contact_s), t("report.m.skin_time")],
    [t("report.path"), withUnit(scaled(m.path_mm, 1e-3), 2, "m"), t("report.m.path")],
    [t("report.smoothness"), fixed(m.smoothness_ldlj, 1), t("report.m.smoothness")],
  ];
  if (m.taken_off) rows.push([t("report.taken_off"), String(m.taken_off), t("report.m.taken_off")]);
  return section("measures", t("report.measures"),
    table({ columns: columns(`<${t("report.measure")}`, t("report.value"), `<${t("report.meaning")}`), rows: rows.map(([name, value, meaning]) => ({ cells: [strong(name), value, h("span", { class: "quiet" }, meaning)] })) }));
}

function presses(data: Exam): HTMLElement | null {
  const count = data.presses.length;
  if (!count) return null;
  const rows = data.presses.map((p, i) => {
    const mark = s("svg", { viewBox: "0 0 14 14", width: 14, height: 14, "aria-hidden": "true" }, pressMark(7, 7, p.result));
    const cells: Cell[] = [String(i + 1), fixed(p.start_s, 1), placeOf(data, p), h("span", { class: "line" }, mark, ` ${WORDS[p.result]}`), fixed(p.force_peak_n, 1),
      inPercent(p.vein), inPercent(p.artery_least), fixed(p.tilt_deg, 0)];
    return { cells };
  });
  const list = table({ columns: columns(t("report.no"), t("report.at_s"), `<${t("report.place_head")}`, `<${t("report.result")}`, t("report.force_n"), t("report.vein_left_head"), t("report.artery_left_head"), t("report.tilt_head")), rows });
  list.querySelectorAll("tbody tr").forEach((row, i) => row.setAttribute("id", `press-${i + 1}`));
  const good = data.presses.filter((p) => isGood(p.result)).length;
  return section("presses", t("report.presses"),
    h("details", { open: count <= SHORT ? "" : undefined }, h("summary", {}, counted("report.presses_count", count, { good })), list));
}

function comments(data: Exam): HTMLElement | null {
  if (!data.comments.length) return null;
  const rows = data.comments.map((c) => ({ cells: [duration(c.time_s), c.text, h("span", { class: "quiet" }, c.author)] }));
  return section("comments", t("page.comments"), table({ columns: columns(`<${t("report.at")}`, `<${t("page.comment")}`, `<${t("report.by")}`), rows }));
}

function foot(data: Exam): HTMLElement {
  const line = (words: string, code: string | null): Child => code && h("p", {}, words, h("code", {}, code));
  return h("footer", {},
    h("p", {}, t("report.foot", { program: data.program, version: data.score.version })),
    line(`${t("sheet.exam")} `, data.exam.exam),
    line(`${t("report.recording")} `, data.recording && `sonde replay ${data.recording}`));
}

export function exam(report: unknown): void {
  const data = translated(report as Exam);
  dress(document);
  document.title = t("report.title", { title: data.exam.title });
  document.body.classList.add("exam");
  const sections = [question(data), advice(data), data.patient.note ? section("case", t("report.case"), h("p", { class: "text" }, data.patient.note)) : null, comments(data),
    score(data), worksheet(data), along(data), pictures(data), traces(data), earlier(data), measures(data), presses(data)];
  document.body.append(head(data), h("main", {}, ...sections), foot(data));
  if (location.hash === "#worksheet-alone") document.body.classList.add("sheet-alone");
  // A link to a press opens the list that holds it.
  document.body.addEventListener("click", (event) => {
    const link = (event.target as Element).closest("a[href^='#press-']");
    if (link) document.querySelector("#presses details")?.setAttribute("open", "");
  });
}
