// What went well in an exam and what to work on, in words.

import { DECISIONS, type Exam, plural, pressCount, type Result, type Segment } from "./exam_data";
import { fixed, isKnown } from "./number";

/** A sentence, with what it is about before it. */
export type Advice = [about: string | null, sentence: string];

const NAMED = 6; // of a list of places

const pressesIn = (data: Exam, segment: string, result?: Result): number =>
  data.presses.filter((p) => p.segment === segment && (!result || p.result === result)).length;

function whyMissed(data: Exam, segment: string): string {
  const total = pressesIn(data, segment);
  const open = pressesIn(data, segment, "open");
  if (!total) return "The segment was never pressed.";
  if (open) return `${open} press${plural(open)} at the force that closes a healthy vein there left it open: that is the sign.`;
  return `None of the ${total} press${plural(total)} there reached the force that closes a healthy vein: press on until then, and move in smaller steps.`;
}

function segmentAdvice(data: Exam, s: Segment): string | null {
  if (s.truth === "clot" && s.decision !== "clot") {
    if (!s.needed && !s.decision) return "there is a clot here, outside of what this protocol examines.";
    return `a clot was missed; your answer was \u201c${DECISIONS[s.decision]}\u201d. ${whyMissed(data, s.id)}`;
  }
  if (s.decision === "clot" && s.truth === "compressible") {
    const closed = pressesIn(data, s.id, "complete") > 0;
    return `was called a clot, but the vein there closes. ${closed ? "One of your own presses closed it." : "Press with the force that closes a healthy vein there before calling it open."}`;
  }
  if (!s.needed) return null;
  if (!s.decision) return "was left undecided; a segment without an answer cannot count.";
  if (!s.correct) return `your answer was \u201c${DECISIONS[s.decision]}\u201d; right is \u201c${DECISIONS[s.truth]}\u201d.`;
  return s.supported ? null : "the answer is right, but no press of the right kind shows it.";
}

export function toWorkOn(data: Exam): Advice[] {
  const advice: Advice[] = [];
  for (const s of data.segments) {
    const sentence = segmentAdvice(data, s);
    if (sentence) advice.push([s.title, sentence]);
  }

  const missed = data.places.filter((p) => !p.done).map((p) => p.title || "unnamed");
  const rest = missed.length > NAMED ? `, and ${missed.length - NAMED} more` : "";
  if (missed.length) advice.push(["Places without a good press", `${missed.slice(0, NAMED).join(", ")}${rest}.`]);
  const gap = data.vein.gap;
  if (gap && gap[1] - gap[0] >= 10 && missed.length < data.places.length)
    advice.push(["Longest gap", `${fixed((gap[1] - gap[0]) / 10, 1)} cm of vein without a good press, from ${fixed(gap[0] / 10, 1)} to ${fixed(gap[1] / 10, 1)} cm.`]);

  const m = data.metrics;
  const all = pressCount(data);
  if (!all) advice.push(["No compression", "press with the probe across the vein until its walls touch, place by place."]);
  if (m.too_hard) advice.push(["Too hard", `${m.too_hard} of ${all} presses were above the limit of their place. Stop as soon as the walls touch.`]);
  if (m.off_axis)
    advice.push(["Off axis", `${m.off_axis} of ${all} presses. Keep the image plane across the vein, within ${fixed(data.vein.tilt_deg, 0)} degrees, and the vein in view while you press.`]);
  if (m.insufficient) advice.push(["Not far enough", `${m.insufficient} of ${all} presses. Press until the walls touch, or to the force of the place.`]);
  if (m.hints) advice.push(["Hints", `you asked for ${m.hints}; try the next one without.`]);
  return advice;
}

export function wentWell(data: Exam): Advice[] {
  const advice: Advice[] = [];
  const m = data.metrics;
  const needed = data.segments.filter((s) => s.needed);
  const right = needed.filter((s) => s.correct && s.supported).length;
  for (const s of data.segments) if (s.truth === "clot" && s.correct && s.supported) advice.push([s.title, "the clot was found, and shown by a press."]);
  if (right) advice.push([null, `${right} of ${needed.length} segments answered rightly, with a press to show it.`]);
  if (m.places && m.places_done === m.places) advice.push([null, "Every planned place was pressed well."]);
  else if (isKnown(m.coverage) && m.coverage >= 0.9) advice.push([null, `${fixed(100 * m.coverage, 0)} % of the planned vein was examined.`]);
  if (m.complete && isKnown(m.completeness) && m.completeness >= 0.95)
    advice.push([null, `Complete presses closed the vein to ${fixed(100 * (1 - m.completeness), 0)} % of its area on average.`]);
  if (pressCount(data) && !m.too_hard) advice.push([null, "No press was too hard."]);
  return advice;
}
