// What the page calls results, findings and levels.

import type { CaseInfo, Compression, Controls, Decision, Guidance, PressResult, RoleAction } from "./protocol";
import { t } from "./words/language";

export const FINDINGS: { decision: Exclude<Decision, "">; name: string; help: string; key: string; code: string }[] = [
  { decision: "compressible", name: t("finding.compressible"), help: t("finding.compressible.help"), key: "J", code: "KeyJ" },
  { decision: "clot", name: t("finding.clot"), help: t("finding.clot.help"), key: "K", code: "KeyK" },
  { decision: "not_seen", name: t("finding.not_seen"), help: t("finding.not_seen.help"), key: "L", code: "KeyL" },
];

export const finding = (d: Decision): string => FINDINGS.find((f) => f.decision === d)?.name ?? t("finding.none");

export const PRESS_WORDS: Record<PressResult, string> = {
  complete: t("press.complete"),
  open: t("press.open"),
  insufficient: t("press.insufficient"),
  too_hard: t("press.too_hard"),
  off_axis: t("press.off_axis"),
};

export const ROLE_ACTIONS: Record<RoleAction, [string, string]> = {
  take: [t("role.take"), t("role.take.help")],
  give: [t("role.give"), t("role.give.help")],
  return: [t("role.return"), t("role.return.help")],
};

/** What a page says about control; empty for a learner who has it. */
export function roleWords(c: Controls): string {
  if (c.controls) return c.role === "teacher" ? t("role.teacher_has_own") : c.role === "watcher" ? t("role.you_have") : "";
  const has = c.holder === "teacher" ? t("role.teacher_has") : c.holder === "watcher" ? t("role.watcher_has") : c.holder === "nobody" ? t("role.nobody_has") : "";
  if (c.role === "learner") return has || t("page.watching");
  return `${c.role === "teacher" ? t("role.teacher_watching") : t("page.watching")}${has && c.holder !== c.role ? `. ${has}` : ""}`;
}

export const LEVELS: Record<CaseInfo["level"], string> = { first: t("level.first"), easy: t("level.easy"), hard: t("level.hard") };

export const GUIDANCE: Record<Guidance, [string, string]> = {
  full: [t("guidance.full"), t("guidance.full.help")],
  hints: [t("guidance.hints"), t("guidance.hints.help")],
  exam: [t("guidance.exam"), t("guidance.exam.help")],
};

/** The press of now has shown what it can. */
export const letGo = (c: Compression | null): boolean => c?.state === "complete" || c?.state === "open" || c?.state === "too_hard";
