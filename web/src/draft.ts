// A case that is being written: its text (docs/trainer.md, Cases), the same as an object, and what its findings make of
// the answer. Places are shares of a vein's length from its proximal end, or of the main vein's from the groin.

import { dump, JSON_SCHEMA, load, YAMLException } from "js-yaml";

/** What the program says of the leg that a draft has. */
export interface DraftLeg {
  /** length of the main vein, mm */
  vein_mm?: number;
  segments?: { id: string; title: string; kind: "main" | "deep" | "calf" | "superficial"; along_mm?: [number, number]; branches: string[] }[];
  /** veins and arteries beside the main ones, in the order of the geometry */
  branches?: string[];
}

export interface DraftMessage extends DraftLeg {
  type: "draft";
  serial: number;
  good: boolean;
  exists: boolean;
  message: string;
  saved: string;
  /** of a case that was opened */
  text?: string;
  parameters: { key: string; text: string; low: number; high: number }[];
}

export type Place = number | { segment?: string; share?: number; shift_mm?: number; landmark?: string; station?: string };

export interface Clot {
  stage: string;
  branch?: string;
  from?: Place;
  to?: Place;
  [key: string]: unknown;
}

export interface Lesion {
  kind: string;
  at: Place;
  depth_mm: number;
  size_mm?: [number, number, number];
  [key: string]: unknown;
}

export interface Form {
  sonde_case: number;
  id: string;
  title: string;
  level: string;
  history: string;
  note?: string;
  leg?: Record<string, number | string | string[]>;
  circulation?: Record<string, number | string>;
  vein?: Clot;
  findings?: { oedema?: number; lesions?: Lesion[]; branches?: Clot[] };
  truth: { thrombosis: boolean; diagnosis: string; segments: Record<string, string>; look_alikes?: string[] };
  [key: string]: unknown;
}

const HEALTHY = "healthy";
const LEAST_MM = 5; // less of a clot in a segment does not count, as in the program
const MAIN = ["common_femoral", "femoral_proximal", "femoral_mid", "femoral_distal", "popliteal"];

export const write = (form: Form): string => dump(form, { schema: JSON_SCHEMA, lineWidth: 100, noRefs: true, flowLevel: 3 });

/** The text as an object, or why it is none. */
export function read(text: string): Form | string {
  try {
    const found = load(text, { schema: JSON_SCHEMA });
    if (typeof found !== "object" || found === null || Array.isArray(found)) return "a case is a list of keys with values";
    const form = found as Form;
    for (const key of ["id", "title", "history", "note"] as const) if (form[key] !== undefined) form[key] = String(form[key]);
    form.truth = { ...{ thrombosis: false, diagnosis: "", segments: {} }, ...form.truth };
    form.truth.segments ??= {};
    return form;
  } catch (e) {
    if (!(e instanceof YAMLException)) throw e;
    return `case:${(e.mark?.line ?? 0) + 1}: ${e.reason}`;
  }
}

/** A healthy patient of whom only sex, age and build are known. */
export const fresh = (): Form => ({
  sonde_case: 3,
  id: "my-case",
  title: "New case",
  level: "easy",
  history: "Woman, 50 years. What she complains of, and since when.",
  note: "What the case teaches.",
  leg: { seed: 1 + Math.floor(Math.random() * 9999), sex: "female", side: "right", "age-y": 50, bmi: 24 },
  vein: { stage: HEALTHY },
  truth: { thrombosis: false, diagnosis: "Healthy veins", segments: Object.fromEntries(MAIN.map((id) => [id, "compressible"])) },
});

/** Under another id, so that what is kept of the first stays. */
export const copyOf = (form: Form): Form => ({ ...form, id: `${form.id.slice(0, 40)}-copy`, title: `${form.title} (copy)`.slice(0, 90) });

/** Clots of a case: that of the main vein, if it has one, then those of branches. */
export function clots(form: Form): Clot[] {
  const main = form.vein && form.vein.stage !== HEALTHY ? [form.vein] : [];
  return [...main, ...(form.findings?.branches ?? [])];
}

/** Where a place is along the main vein, mm; null when only the program can tell. */
function along(place: Place, leg: DraftLeg): number | null {
  if (typeof place === "number") return place;
  const ends = leg.segments?.find((s) => s.id === place.segment)?.along_mm;
  if (!ends) return null;
  return ends[0] + (place.share ?? 0) * (ends[1] - ends[0]) + (place.shift_mm ?? 0);
}

/** A place as a share of its vein; null when only the program can tell. */
export function shareOf(place: Place | undefined, branch: string | undefined, leg: DraftLeg, whole: number): number | null {
  if (place === undefined) return whole;
  if (branch !== undefined) return typeof place === "object" && place.segment === undefined && !place.station && !place.landmark && !place.shift_mm ? (place.share ?? 0) : null;
  const mm = along(place, leg);
  return mm === null || !leg.vein_mm ? null : mm / leg.vein_mm;
}

/** The place of a share: of the branch, or of the segment of the main vein that it lies in. */
export function placeOf(share: number, branch: string | undefined, leg: DraftLeg): Place {
  const at = Math.max(0, Math.min(1, share));
  const rounded = (v: number): number => Math.round(1000 * v) / 1000;
  if (branch !== undefined) return { share: rounded(at) };
  const mm = at * (leg.vein_mm ?? 0);
  const main = (leg.segments ?? []).filter((s) => s.along_mm);
  const segment = main.find((s) => mm >= s.along_mm![0] && mm <= s.along_mm![1]);
  if (!segment) return Math.round(mm);
  const [a, b] = segment.along_mm!;
  return { segment: segment.id, share: rounded((mm - a) / Math.max(1, b - a)) };
}

export const segmentTitle = (id: string, leg: DraftLeg): string => leg.segments?.find((s) => s.id === id)?.title ?? id.replace(/_/g, " ");

/** The answer that the findings give; false when only the program can tell where they are. */
export function answer(form: Form, leg: DraftLeg): boolean {
  const main = form.vein && form.vein.stage !== HEALTHY ? form.vein : null;
  const segments = leg.segments ?? [];
  if (segments.length === 0) return false;
  const ends = main && main.from !== undefined && main.to !== undefined ? [along(main.from, leg), along(main.to, leg)] : [0, leg.vein_mm ?? 0];
  if (ends[0] === null || ends[1] === null) return false;
  const filled = new Set((form.findings?.branches ?? []).map((c) => c.branch));
  let deep = false;
  const called: Record<string, string> = {};
  for (const s of segments) {
    const [a, b] = s.along_mm ?? [0, 0];
    const length = main && s.along_mm ? Math.min(b, ends[1]!) - Math.max(a, ends[0]!) : 0;
    const clot = length >= LEAST_MM || s.branches.some((name) => filled.has(name));
    deep ||= clot && s.kind !== "superficial";
    if (s.kind === "main" || form.truth.segments[s.id] !== undefined) called[s.id] = clot ? "clot" : "compressible";
  }
  form.truth.segments = called;
  form.truth.thrombosis = deep;
  return true;
}
