// What went well in an exam and what to work on, in words.

import { DECISIONS, type Exam, pressCount, type Result, type Segment } from "./exam_data";
import { fixed, isKnown } from "./number";
import { counted, t } from "../words/language";

/** A sentence, with what it is about before it. */
export type Advice = [about: string | null, sentence: string];

const NAMED = 6; // of a list of places

const pressesIn = (data: Exam, segment: string, result?: Result): number =>
  data.presses.filter((p) => p.segment === segment && (!result || p.result === result)).length;

function whyMissed(data: Exam, segment: string): string {
  const total = pressesIn(data, segment);
  const open = pressesIn(data, segment, "open");
  if (!total) return t("report.advice.never_pressed");
  if (open) return counted("report.advice.open", open);
  return counted("report.advice.weak", total);
}

function segmentAdvice(data: Exam, s: Segment): string | null {
  if (s.truth === "clot" && s.decision !== "clot") {
    if (!s.needed && !s.decision) return t("report.advice.outside");
    return t("report.advice.missed", { answer: DECISIONS[s.decision], why: whyMissed(data, s.id) });
  }
  if (s.decision === "clot" && s.truth === "compressible") {
    const closed = pressesIn(data, s.id, "complete") > 0;
    return t(closed ? "report.advice.over_closed" : "report.advice.over");
  }
  if (!s.needed) return null;
  if (!s.decision) return t("report.advice.undecided");
  if (!s.correct) return t("report.advice.answer", { answer: DECISIONS[s.decision], truth: DECISIONS[s.truth] });
  return s.supported ? null : t("report.advice.unsupported");
}

export function toWorkOn(data: Exam): Advice[] {
  const advice: Advice[] = [];
  for (const s of data.segments) {
    const sentence = segmentAdvice(data, s);
    if (sentence) advice.push([s.title, sentence]);
  }

  const missed = data.places.filter((p) => !p.done).map((p) => p.title || t("report.advice.unnamed"));
  const named = missed.slice(0, NAMED).join(", ");
  if (missed.length) advice.push([t("report.advice.places"), missed.length > NAMED ? t("report.advice.and_more", { places: named, n: missed.length - NAMED }) : t("report.advice.list", { places: named })]);
  const gap = data.vein.gap;
  if (gap && gap[1] - gap[0] >= 10 && missed.length < data.places.length)
    advice.push([t("report.gap"), t("report.advice.gap", { cm: fixed((gap[1] - gap[0]) / 10, 1), from: fixed(gap[0] / 10, 1), to: fixed(gap[1] / 10, 1) })]);

  const m = data.metrics;
  const all = pressCount(data);
  if (!all) advice.push([t("report.advice.none"), t("report.advice.none.what")]);
  if (m.too_hard) advice.push([t("report.advice.too_hard"), t("report.advice.too_hard.what", { n: m.too_hard, of: all })]);
  if (m.off_axis)
    advice.push([t("report.advice.off_axis"), t("report.advice.off_axis.what", { n: m.off_axis, of: all, deg: fixed(data.vein.tilt_deg, 0) })]);
  if (m.insufficient) advice.push([t("report.advice.insufficient"), t("report.advice.insufficient.what", { n: m.insufficient, of: all })]);
  if (m.hints) advice.push([t("report.advice.hints"), t("report.advice.hints.what", { n: m.hints })]);
  return advice;
}

export function wentWell(data: Exam): Advice[] {
  const advice: Advice[] = [];
  const m = data.metrics;
  const needed = data.segments.filter((s) => s.needed);
  const right = needed.filter((s) => s.correct && s.supported).length;
  for (const s of data.segments) if (s.truth === "clot" && s.correct && s.supported) advice.push([s.title, t("report.well.found")]);
  if (right) advice.push([null, t("report.well.segments", { n: right, of: needed.length })]);
  if (m.places && m.places_done === m.places) advice.push([null, t("report.well.places")]);
  else if (isKnown(m.coverage) && m.coverage >= 0.9) advice.push([null, t("report.well.coverage", { percent: fixed(100 * m.coverage, 0) })]);
  if (m.complete && isKnown(m.completeness) && m.completeness >= 0.95)
    advice.push([null, t("report.well.complete", { percent: fixed(100 * (1 - m.completeness), 0) })]);
  if (pressCount(data) && !m.too_hard) advice.push([null, t("report.well.soft")]);
  return advice;
}
