// The report of an exam for the learner: result, answer and truth, what to take away, the score's parts, the vein
// with every press, the learner's own images, force over time, earlier exams, measures.

import { type Child, h, s } from "./dom";
import { COLOURS, DECISIONS, type Entry, type Exam, isGood, plural, type Press, pressCount, WORDS } from "./exam_data";
import { drawScores, drawTraces, drawVein, pressMark } from "./exam_drawings";
import { type Advice, toWorkOn, wentWell } from "./exam_words";
import { fixed, isKnown, type Real } from "./number";
import { type Cell, columns, table } from "./table";
import { drawSheet, type SheetPicture } from "./worksheet";

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
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}

/** 22 November 2026, 04:40 UTC */
function dateInWords(date: string): string {
  const months = ["January", "February", "March", "April", "May", "June", "July", "August", "September", "October", "November", "December"];
  const parts = /^(\d{4})-(\d\d)-(\d\d)T(\d\d:\d\d):\d\dZ$/.exec(date);
  const month = parts ? months[Number(parts[2]) - 1] : undefined;
  return parts && month ? `${Number(parts[3])} ${month} ${parts[1]}, ${parts[4]} UTC` : date;
}

/** Segment and centimetres from the groin, or that the vein was not in view. */
function placeOf(data: Exam, press: Press): string {
  if (!isKnown(press.along_mm)) return "vein not in view";
  const title = data.vein.segments.find((segment) => segment.id === press.segment)?.title;
  return `${title ? `${title}, ` : ""}${fixed(press.along_mm / 10, 1)} cm`;
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
    { class: "fig dial", role: "img", "aria-label": `Score: ${fixed(score, 0)} of 100 points`, viewBox: "0 0 132 132", width: 132, height: 132 },
    s("circle", { ...ring, stroke: "#e4e9ed" }),
    s("circle", { ...ring, stroke: passed ? "#00795a" : "#b3261e", "stroke-dasharray": `${((round * score) / 100).toFixed(1)} ${round.toFixed(1)}`, transform: "rotate(-90 66 66)" }),
    s("text", { x: 66, y: 74, class: "middle", style: "font-size:38px;font-weight:680" }, fixed(score, 0)),
    s("text", { x: 66, y: 93, class: "middle", style: "font-size:12.5px;fill:#55616b" }, "of 100"),
  );
}

function head(data: Exam): HTMLElement {
  const { exam, score } = data;
  const about: Child[] = [
    exam.trainee && strong(exam.trainee),
    exam.date && dateInWords(exam.date),
    data.protocol?.title ?? exam.protocol,
    exam.guidance && `guidance: ${exam.guidance}`,
  ];
  const meta = h("p", { class: "meta" });
  for (const child of about) if (child) meta.append(...(meta.hasChildNodes() ? [" \u00b7 "] : []), child);
  const summary = score.summary.replace(/^(Passed\. |Not passed: |Not passed\. )/, ""); // the tag says these words already
  const sentence = summary.charAt(0).toUpperCase() + summary.slice(1);
  return h("header", {}, h("div", { class: "top" },
    h("div", {},
      h("p", { class: "eyebrow" }, "Compression ultrasound \u00b7 examination report"),
      h("h1", {}, exam.title),
      meta,
      h("p", { class: "verdict" }, h("span", { class: `tag ${score.passed ? "good" : "bad"}` }, score.passed ? "Passed" : "Not passed"), sentence),
      data.interrupted && quiet("The exam was interrupted before its end. It is listed among the exams but does not count as one.")),
    dial(score.score, score.passed)));
}

function question(data: Exam): HTMLElement {
  const { score, patient, protocol } = data;
  const card = (look: string, title: string, words: string): HTMLElement => h("div", { class: `card ${look}` }, h("h3", {}, title), h("p", {}, words));
  const answer = score.correct ? "\u2713 Your answer, right" : score.answered ? "\u2717 Your answer, wrong" : "\u2717 No answer";
  return section("question", "The patient and the answer",
    patient.history && h("p", { class: "text" }, patient.history),
    protocol?.text && quiet(`${protocol.title}: ${protocol.text}`),
    h("div", { class: "cards" },
      card(score.correct ? "right" : "wrong", answer, score.diagnosis || "No answer"),
      card("", "The truth", score.truth || patient.diagnosis || (score.thrombosis ? "Deep vein thrombosis" : "No deep vein thrombosis"))));
}

function advice(data: Exam): HTMLElement {
  const list = (title: string, items: Advice[], none: string): HTMLElement =>
    h("div", {}, h("h3", {}, title), items.length
      ? h("ul", {}, ...items.map(([about, sentence]) => h("li", {}, about && strong(about), about && ": ", sentence)))
      : h("p", {}, none));
  const good = wentWell(data);
  return section("advice", "What to take away", h("div", { class: "two" },
    list("What to work on", toWorkOn(data), "Nothing: every answer was right and every press was good."),
    good.length > 0 && list("What went well", good, "")));
}

function score(data: Exam): HTMLElement {
  const sum = data.parts.reduce((points, part) => points + part.points, 0);
  const rows: Cell[][] = data.parts.map((part) => {
    const bar = h("i");
    bar.style.width = `${Math.min(100, Math.max(0, (100 * part.points) / part.of)).toFixed(1)}%`;
    const lost = part.lost ? h("div", {}, strong(`\u2212${fixed(part.of - part.points, 1)} of ${fixed(part.of, 0)}:`), ` ${part.lost}.`) : "";
    return [strong(part.title), h("div", {}, part.meaning, lost, h("span", { class: "bar" }, bar)), `${fixed(part.points, 1)} of ${fixed(part.of, 0)}`];
  });
  const total = `${fixed(data.score.score, 1)} of 100`;
  return section("score", "The score",
    table({ columns: columns("<Part", "<What it means, and where points went", "Points"), rows: [...rows.map((cells) => ({ cells })), { cells: ["Score", "", total], strong: true }] }),
    sum > data.score.score + 0.05 &&
      h("p", {}, `The parts add up to ${fixed(sum, 1)} points. A wrong or missing diagnosis is never passed: the score is limited to ${fixed(data.score.score, 1)}.`));
}

// ---- the vein, the images, the traces

function along(data: Exam): HTMLElement {
  const hidden = data.presses.filter((p) => !isKnown(p.along_mm)).length;
  const caption =
    `Above, the vein from the groin to the knee, with what was examined${data.vein.clot ? " and what is there" : ""}. Below, each press by its place and its greatest force. ` +
    "A green box reaches from the force that closes a healthy vein at a place to the red line, the limit there: above it a press is too hard." +
    (hidden ? ` ${hidden} press${plural(hidden)} without the vein in view cannot be drawn.` : "");
  const rows = data.segments.map((v, i) => {
    const asked = v.needed || v.decision !== "";
    const right = !v.decision ? "not decided" : !v.correct ? "wrong" : v.supported ? "right" : "right, but not shown";
    const cells: Cell[] = [strong(`${i + 1}. ${v.title}`), asked ? DECISIONS[v.decision] : "not part of this protocol", v.truth ? DECISIONS[v.truth] : "\u2013",
      asked ? verdict(v.correct, right) : "\u2013", `${v.places_done} of ${v.places}`];
    return { cells };
  });
  return section("vein", "Along the vein",
    figure(drawVein(data), "vein", "The vein along its length, and every press", caption),
    h("h3", {}, "Segment by segment"),
    table({ columns: columns("<Segment", "<Your answer", "<Truth", "<Verdict", "Places pressed well"), rows }),
    quiet("An answer is shown when a press of the right kind in that segment supports it: one that closed the vein, or one that left it open at the force that closes a healthy vein there."));
}

function pictures(data: Exam): HTMLElement | null {
  if (!data.presses.length) return null;
  if (!data.pictures.length) return section("pictures", "Your compressions", h("p", {}, "No images were kept of this exam."));
  const side = (bytes: string | null, number: number, label: string): HTMLElement =>
    h("div", {}, bytes ? h("img", { alt: `Ultrasound image of press ${number}, ${label}`, src: `data:image/png;base64,${bytes}` }) : h("em", {}, "no image"), h("span", {}, label));
  const pairs = data.pictures.map(({ press, before, peak }) => {
    const p = data.presses[press - 1]!;
    const title = h("b", {}, `Press ${press}: ${WORDS[p.result]}`);
    title.style.color = COLOURS[p.result];
    const left = isKnown(p.vein) ? `, ${percent(p.vein)} of the vein left` : "";
    return h("figure", {}, h("div", { class: "images" }, side(before, press, "before"), side(peak, press, "at the peak")),
      h("figcaption", {}, title, h("br"), placeOf(data, p), h("br"), `${fixed(p.force_peak_n, 1)} N${left}`));
  });
  const all = pairs.length < data.presses.length ? "" : "All ";
  return section("pictures", "Your compressions",
    quiet(`${all}${pairs.length} of your ${data.presses.length} presses: the image before and at the peak. In a complete press the vein's walls touch. In this simulator the artery beside it gives way too and keeps four to six tenths of its area; in a patient it keeps its shape.`),
    h("div", { class: "pictures" }, ...pairs));
}

/** What the learner wrote, beside the truth; it prints alone too. */
function worksheet(data: Exam): HTMLElement | null {
  const sheet = data.worksheet;
  if (!sheet) return null;
  const source = (p: SheetPicture): string => (p.image ? `data:image/png;base64,${p.image}` : "");
  const print = h("button", { type: "button", class: "save alone" }, "Print the worksheet alone");
  print.onclick = () => {
    document.body.classList.add("sheet-alone");
    window.print();
    document.body.classList.remove("sheet-alone");
  };
  const { exam: e, patient, protocol } = data;
  return section("worksheet", "Your worksheet", h("p", {}, print),
    drawSheet(sheet, [["Patient", e.title], ["Protocol", protocol?.title ?? e.protocol], ["Examiner", e.trainee], ["Date", e.date && dateInWords(e.date)], ["Exam", e.exam], ["Question", patient.history]], source));
}

const traces = (data: Exam): HTMLElement | null =>
  data.traces.time_s.length < 2 ? null : section("traces", "Force and vein over time",
    figure(drawTraces(data), "traces", "Force of the probe and area of the vein over time",
      "Shaded: presses, in the colours of the vein's drawing. Red: the limit of the place, above which a press is too hard. The blue line is broken where the vein was not in the image."));

// ---- earlier exams, measures, presses

function earlier(data: Exam): HTMLElement {
  if (data.exams.length < 2) return section("earlier", "Compared with your earlier exams", h("p", {}, "This is the first exam in your log."));
  const same = data.exams.slice(1).filter((e) => e.same_patient && !e.interrupted);
  const best = Math.max(...same.map((e) => e.score));
  const [before, now] = [data.curve[data.curve.length - 2], data.curve[data.curve.length - 1]];
  const median = before && now && !data.interrupted
    ? `Exam ${now.number}. The median of your last five is ${fixed(now.median, 0)} points; before this exam it was ${fixed(before.median, 0)}. ` : "";
  const seen = same.length ? `You have examined this patient ${same.length} time${same.length === 1 ? "" : "s"} before, with ${fixed(best, 0)} points at best.` : "This patient was new to you.";
  const result = (e: Entry): Cell => (e.interrupted ? "interrupted" : verdict(e.passed, e.passed ? "passed" : e.correct ? "not passed" : "wrong diagnosis"));
  const rows = data.exams.slice(0, LISTED).map((e, i) => ({
    strong: i === 0,
    cells: [strong(`${e.title}${i === 0 ? " (this exam)" : ""}`), h("span", { class: "line" }, e.date.slice(0, 16).replace("T", " ")), fixed(e.score, 0), result(e), percent(e.coverage), percent(e.valid_share),
      withUnit(isKnown(e.time_s) ? e.time_s / 60 : e.time_s, 1, "min")],
  }));
  return section("earlier", "Compared with your earlier exams",
    h("p", {}, median + seen),
    before && figure(drawScores(data), "curve", "Your scores, exam by exam",
      "Each exam that was finished: filled, passed; hollow, not passed; the outer ring marks this one. The line is the median of the last five."),
    table({ columns: columns("<Patient", "<Date (UTC)", "Score", "<Result", "Coverage", "Good presses", "Time"), rows }),
    data.exams.length > LISTED && quiet(`and ${data.exams.length - LISTED} earlier ones.`));
}

function measures(data: Exam): HTMLElement {
  const m = data.metrics;
  const scaled = (value: Real, scale: number): Real => (isKnown(value) ? value * scale : value);
  const rows: [string, string, string][] = [
    ["Places pressed well", `${m.places_done} of ${m.places}`, "Planned places with a good press within reach."],
    ["Coverage", percent(m.coverage), "Of the planned vein, near a good press."],
    ["Coverage of the whole vein", percent(m.vein_coverage), "From the groin to the knee, planned or not."],
    ["Longest gap", withUnit(scaled(m.largest_gap_mm, 0.1), 1, "cm"), "Longest planned stretch without a good press."],
    ["Good presses", `${m.complete + m.open} of ${pressCount(data)}`, "Complete, or showing an open vein."],
    ["Completeness", percent(m.completeness), "How far the complete presses closed the vein, on average."],
    ["Greatest force", withUnit(m.force_peak_n, 1, "N"), "Over the whole exam."],
    ["Usual upper force", withUnit(m.force_p95_n, 1, "N"), "95 % of the time of pressing stayed below."],
    ["Time", duration(m.time_s), "From the first image to the last."],
    ["Time on the skin", duration(m.contact_s), "With the probe pressing."],
    ["Path of the probe", withUnit(scaled(m.path_mm, 1e-3), 2, "m"), "Shorter is calmer."],
    ["Smoothness", fixed(m.smoothness_ldlj, 1), "How evenly the probe moved between presses: nearer to zero is smoother."],
  ];
  if (m.taken_off) rows.push(["Probe taken off", String(m.taken_off), "Times the probe was led through the leg: it was taken off until it had left the leg."]);
  return section("measures", "Measures",
    table({ columns: columns("<Measure", "Value", "<Meaning"), rows: rows.map(([name, value, meaning]) => ({ cells: [strong(name), value, h("span", { class: "quiet" }, meaning)] })) }));
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
  const list = table({ columns: columns("No", "at (s)", "<Place", "<Result", "force (N)", "vein left (%)", "artery left (%)", "tilt (\u00b0)"), rows });
  list.querySelectorAll("tbody tr").forEach((row, i) => row.setAttribute("id", `press-${i + 1}`));
  const good = data.presses.filter((p) => isGood(p.result)).length;
  return section("presses", "Every press",
    h("details", { open: count <= SHORT ? "" : undefined }, h("summary", {}, `${count} press${plural(count)}, ${good} of them good, in the order of time`), list));
}

function comments(data: Exam): HTMLElement | null {
  if (!data.comments.length) return null;
  const rows = data.comments.map((c) => ({ cells: [duration(c.time_s), c.text, h("span", { class: "quiet" }, c.author)] }));
  return section("comments", "Comments", table({ columns: columns("<At", "<Comment", "<By"), rows }));
}

function foot(data: Exam): HTMLElement {
  const line = (words: string, code: string | null): Child => code && h("p", {}, words, h("code", {}, code));
  return h("footer", {},
    h("p", {}, `The patient, the images and the forces are synthetic: computed by Sonde ${data.program}. Scores and measures: formulas of version ${data.score.version}, docs/trainer_theory.md.`),
    line("Exam ", data.exam.exam),
    line("Its recording plays again with ", data.recording && `sonde replay ${data.recording}`));
}

export function exam(report: unknown): void {
  const data = report as Exam;
  document.body.classList.add("exam");
  const sections = [question(data), advice(data), data.patient.note ? section("case", "About this case", h("p", { class: "text" }, data.patient.note)) : null, comments(data),
    score(data), worksheet(data), along(data), pictures(data), traces(data), earlier(data), measures(data), presses(data)];
  document.body.append(head(data), h("main", {}, ...sections), foot(data));
  if (location.hash === "#worksheet-alone") document.body.classList.add("sheet-alone");
  // A link to a press opens the list that holds it.
  document.body.addEventListener("click", (event) => {
    const link = (event.target as Element).closest("a[href^='#press-']");
    if (link) document.querySelector("#presses details")?.setAttribute("open", "");
  });
}
