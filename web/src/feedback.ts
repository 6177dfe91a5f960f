// What the page says of a press, in one place: the word at the force bar and the tag in the exam's
// bar come from the same decision, so that they cannot contradict each other.

import type { Compression } from "./protocol";
import { t } from "./words/language";

export interface Pressing {
  force_n: number;
  touching: boolean;
  /** the place's force: from what closes a healthy vein to the limit; null when it is not shown */
  target_n: [number, number] | null;
  /** of the device, N */
  limit_n: number;
  comfort_n: number;
  /** of the judge; null when it is not shown */
  compression: Compression | null;
}

export interface Feedback {
  /** beside the force */
  word: string;
  tone: "calm" | "good" | "warn" | "danger";
  /** in the exam's bar; empty: none */
  tag: string;
  state: Compression["state"];
}

const LET_GO: Partial<Record<Compression["state"], string>> = {
  complete: t("force.tag.complete"),
  open: t("force.tag.open"),
  too_hard: t("force.tag.too_hard"),
  off_axis: t("force.tag.off_axis"),
};

function plainWord(p: Pressing): [string, Feedback["tone"]] {
  if (!p.touching && p.force_n <= 0.3) return [t("force.no_contact"), "calm"];
  if (p.force_n <= 0.3) return [t("force.touching"), "calm"];
  if (p.target_n) return p.force_n < p.target_n[0] ? [t("force.press_on"), "calm"] : [t("force.firm"), "good"];
  if (p.force_n >= 0.98 * p.limit_n) return [t("force.limit"), "danger"];
  return p.force_n > p.comfort_n ? [t("force.uncomfortable"), "warn"] : [t("force.comfortable"), "calm"];
}

/** The tag for a press that still goes on: how open the vein is. */
function pressing(c: Compression | null): string {
  if (c?.state !== "pressing") return "";
  return c.vein === null ? t("force.pressing") : t("force.pressing_open", { percent: (100 * c.vein).toFixed(0) });
}

/** The judge's message is older than the force: a force above the limit is too hard at once, and a
 *  press that was too hard stays so until it has been let go. */
export function feedback(p: Pressing): Feedback {
  const above = p.target_n !== null && p.force_n > p.target_n[1];
  const state = above ? "too_hard" : (p.compression?.state ?? "none");
  const tag = LET_GO[state] ?? pressing(p.compression);
  if (above) return { word: t("force.too_hard"), tone: "danger", tag: p.compression ? tag : "", state };
  const held = p.force_n > 0.3 && LET_GO[state] !== undefined;
  const [word, tone] = plainWord(p);
  if (!held) return { word, tone, tag, state };
  return { word: t("force.let_go"), tone: state === "complete" || state === "open" ? "good" : "warn", tag, state };
}
