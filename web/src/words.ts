// What the page calls results, findings and levels.

import type { CaseInfo, Compression, Controls, Decision, Guidance, PressResult, RoleAction } from "./protocol";

export const FINDINGS: { decision: Exclude<Decision, "">; name: string; help: string; key: string; code: string }[] = [
  { decision: "compressible", name: "Compressible", help: "The walls of the vein touched: no clot here", key: "J", code: "KeyJ" },
  { decision: "clot", name: "Clot", help: "Pressed with the force that closes a healthy vein, it stayed open", key: "K", code: "KeyK" },
  { decision: "not_seen", name: "Not seen", help: "The vein was not seen well enough to tell", key: "L", code: "KeyL" },
];

export const finding = (d: Decision): string => FINDINGS.find((f) => f.decision === d)?.name ?? "No finding";

export const PRESS_WORDS: Record<PressResult, string> = {
  complete: "vein closed",
  open: "vein stayed open",
  insufficient: "not far enough",
  too_hard: "too hard",
  off_axis: "not straight across the vein",
};

export const ROLE_ACTIONS: Record<RoleAction, [string, string]> = {
  take: ["Take control", "You move the probe; the one who has control now watches"],
  give: ["Give control", "To the teacher, or to who watches longest"],
  return: ["Give control back", "To the learner"],
};

/** What a page says about control; empty for a learner who has it. */
export function roleWords(c: Controls): string {
  if (c.controls) return c.role === "teacher" ? "Teacher: you have control" : c.role === "watcher" ? "You have control" : "";
  const has = c.holder === "teacher" ? "The teacher has control" : c.holder === "watcher" ? "A watcher has control" : c.holder === "nobody" ? "Nobody has control" : "";
  if (c.role === "learner") return has || "Watching";
  return `${c.role === "teacher" ? "Teacher, watching" : "Watching"}${has && c.holder !== c.role ? `. ${has}` : ""}`;
}

export const LEVELS: Record<CaseInfo["level"], string> = { first: "First exam", easy: "Easy", hard: "Hard" };

export const GUIDANCE: Record<Guidance, [string, string]> = {
  full: ["Full", "A ring shows where, a needle the angle, a bracket the force."],
  hints: ["Hints", "The next point is named; more only when you ask for a hint."],
  exam: ["None", "As in an exam: the protocol and your own eyes."],
};

/** The press of now has shown what it can. */
export const letGo = (c: Compression | null): boolean => c?.state === "complete" || c?.state === "open" || c?.state === "too_hard";
