// What the report of an exam holds: written by src/sonde-exam/trainer/report.c and score_save.c.

import type { Real } from "./number";
import type { Sheet } from "./worksheet";
import { t } from "../words/language";

export type Result = "complete" | "open" | "insufficient" | "too_hard" | "off_axis";
export type Decision = "" | "compressible" | "clot" | "not_seen";
export type Stretch = [from_mm: number, to_mm: number];

export interface Press {
  result: Result;
  segment: string;
  start_s: number;
  peak_s: number;
  end_s: number;
  along_mm: Real;
  force_peak_n: number;
  limit_n: Real;
  vein: Real;
  artery_least: Real;
  tilt_deg: Real;
}

export interface Segment {
  id: string;
  title: string;
  needed: boolean;
  places: number;
  places_done: number;
  decision: Decision;
  truth: Decision;
  correct: boolean;
  supported: boolean;
}

export interface Place {
  title: string;
  along_mm: number;
  firm_n: Real;
  limit_n: Real;
  done: boolean;
}

/** An exam of the log; the first one is this exam. */
export interface Entry {
  title: string;
  date: string;
  same_patient: boolean;
  interrupted: boolean;
  passed: boolean;
  correct: boolean;
  score: number;
  coverage: Real;
  valid_share: Real;
  time_s: Real;
}

export interface Exam {
  program: string;
  interrupted: boolean;
  recording: string | null;
  patient: { history: string; note: string; diagnosis: string };
  protocol?: { title: string; text: string };
  exam: { exam: string | null; date: string | null; trainee: string | null; title: string; protocol: string | null; guidance: string | null };
  score: { version: number; score: number; passed: boolean; correct: boolean; answered: boolean; thrombosis: boolean; diagnosis: string; truth: string; summary: string };
  metrics: Record<Result, number> & Record<
    "coverage" | "vein_coverage" | "largest_gap_mm" | "completeness" | "valid_share" | "force_peak_n" | "force_p95_n" | "time_s" | "contact_s" | "path_mm" | "smoothness_ldlj",
    Real
  > & { places: number; places_done: number; hints: number; taken_off: number };
  parts: { title: string; meaning: string; points: number; of: number; lost: string }[];
  segments: Segment[];
  places: Place[];
  presses: Press[];
  vein: {
    length_mm: number;
    reach_mm: number;
    tilt_deg: number;
    segments: { id: string; title: string; mm: Stretch }[];
    planned: Stretch[];
    examined: Stretch[];
    gap?: Stretch;
    clot?: Stretch;
  };
  comments: { time_s: number; author: string; text: string }[];
  pictures: { press: number; before: string | null; peak: string | null }[];
  traces: { time_s: number[]; force_n: Real[]; vein: Real[] };
  exams: Entry[];
  curve: { number: number; score: number; median: number; passed: boolean }[];
  worksheet?: Sheet;
}

// ---- words and marks

export const WORDS: Record<Result, string> = {
  complete: t("report.press.complete"),
  open: t("report.press.open"),
  insufficient: t("report.press.insufficient"),
  too_hard: t("report.press.too_hard"),
  off_axis: t("report.press.off_axis"),
};
/** Of Okabe and Ito's palette, darkened until text in it is readable; shapes say the same. */
export const COLOURS: Record<Result, string> = { complete: "#00795a", open: "#0072b2", insufficient: "#946000", too_hard: "#c2410c", off_axis: "#8a4b78" };
export const RESULTS = Object.keys(WORDS) as Result[];

export const DECISIONS: Record<Decision, string> = { "": t("report.not_decided"), compressible: t("report.decision.compressible"), clot: t("report.decision.clot"), not_seen: t("report.decision.not_seen") };

export const isGood = (result: Result): boolean => result === "complete" || result === "open";
export const pressCount = (data: Exam): number => RESULTS.reduce((sum, result) => sum + data.metrics[result], 0);
