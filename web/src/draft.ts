// A case that is being written: its text (docs/trainer.md, Cases), and the same as an object. Places are shares of a vein's length from its proximal end, or of the main vein's from the groin.

import { dump, JSON_SCHEMA, load, YAMLException } from "js-yaml";
import { label } from "./dom";
import { amid, capital, t, told } from "./words/language";

/** What the program says of the leg that a draft has. */
export interface DraftLeg {
  /** length of the main vein, mm */
  vein_mm?: number;
  segments?: { id: string; title: string; kind: "main" | "deep" | "calf" | "superficial"; along_mm?: [number, number]; branches: string[] }[];
  /** veins and arteries beside the main ones, in the order of the geometry */
  branches?: string[];
  /** the veins among them */
  veins?: string[];
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
  /** of a case that is right and whose answer follows: what its findings come to */
  answer?: { thrombosis: boolean; segments: Record<string, string> };
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
const MAIN = ["common_femoral", "femoral_proximal", "femoral_mid", "femoral_distal", "popliteal"];

export const write = (form: Form): string => dump(form, { schema: JSON_SCHEMA, lineWidth: 100, noRefs: true, flowLevel: 3 });

type Tree = { [key: string]: unknown };
const isMap = (v: unknown): v is Tree => typeof v === "object" && v !== null && !Array.isArray(v);
const isPlain = (v: unknown): boolean => typeof v !== "object" || v === null;

/** Whether a part stands at two places: written out, such a text can be larger than any memory. */
function repeats(value: unknown, seen: Set<unknown>): boolean {
  if (isPlain(value)) return false;
  if (seen.has(value)) return true;
  seen.add(value);
  return Object.values(value as object).some((v) => repeats(v, seen));
}

/** Whether the parts that the form shows are maps, lists and words where it expects them. What is in them, the program checks. */
function isShaped(c: Tree): boolean {
  const mapOrNone = (v: unknown): boolean => v === undefined || isMap(v);
  const listOf = (v: unknown, one: (item: unknown) => boolean): boolean => v === undefined || (Array.isArray(v) && v.every(one));
  const place = (v: unknown): boolean => isPlain(v) || (isMap(v) && Object.values(v).every(isPlain));
  const clot = (v: unknown): boolean => isMap(v) && place(v.from) && place(v.to) && isPlain(v.stage) && isPlain(v.branch);
  const lesion = (v: unknown): boolean => isMap(v) && isPlain(v.kind) && place(v.at) && isPlain(v.depth_mm) && listOf(v.size_mm, (n) => typeof n === "number");
  const truth = isMap(c.truth) ? c.truth : {};
  const findings = isMap(c.findings) ? c.findings : {};
  return ["id", "title", "level", "history", "note"].every((key) => isPlain(c[key]))
    && ["leg", "circulation", "findings", "truth"].every((key) => mapOrNone(c[key])) && (c.vein === undefined || clot(c.vein))
    && listOf(findings.branches, clot) && listOf(findings.lesions, lesion) && isPlain(findings.oedema)
    && isPlain(truth.thrombosis) && isPlain(truth.diagnosis) && listOf(truth.look_alikes, isPlain)
    && mapOrNone(truth.segments) && Object.values(isMap(truth.segments) ? truth.segments : {}).every(isPlain);
}

/** The text as an object, or why it is none. */
export function read(text: string): Form | string {
  try {
    const found = load(text, { schema: JSON_SCHEMA });
    if (!isMap(found)) return t("editor.no_map");
    if (repeats(found, new Set())) return t("editor.repeats");
    if (!isShaped(found)) return t("editor.other_shape");
    const form = found as Form;
    for (const key of ["id", "title", "history"] as const) form[key] = String(form[key] ?? "");
    if (form.note !== undefined) form.note = String(form.note);
    form.truth = { ...{ thrombosis: false, diagnosis: "", segments: {} }, ...form.truth };
    form.truth.diagnosis = String(form.truth.diagnosis);
    return form;
  } catch (e) {
    if (!(e instanceof YAMLException)) throw e;
    return t("editor.line", { n: (e.mark?.line ?? 0) + 1, why: e.reason });
  }
}

/** A healthy patient of whom only sex, age and build are known. */
export const fresh = (): Form => ({
  sonde_case: 3,
  id: "my-case",
  title: t("editor.fresh.title"),
  level: "easy",
  history: t("editor.fresh.history"),
  note: t("editor.fresh.note"),
  leg: { seed: 1 + Math.floor(Math.random() * 9999), sex: "female", side: "right", "age-y": 50, bmi: 24 },
  vein: { stage: HEALTHY },
  truth: { thrombosis: false, diagnosis: t("editor.fresh.diagnosis"), segments: Object.fromEntries(MAIN.map((id) => [id, "compressible"])) },
});

/** Under another id, so that what is kept of the first stays. */
export const copyOf = (form: Form): Form => ({ ...form, id: `${form.id.slice(0, 40)}-copy`, title: t("editor.copy_of", { title: form.title }).slice(0, 90) });

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

// ---- what is wrong, by field

export type Part = "case" | "leg" | "findings" | "answer" | "text";

/** Where a mistake is mended: a part of the editor and the id of a field in it, which it may not have. */
export interface Fault {
  part: Part;
  field: string;
}

/** Keys and places in lists that lead to a line, from the outside. */
function pathOf(text: string, line: number): (string | number)[] {
  const lines = text.split("\n");
  const path: (string | number)[] = [];
  let indent = Infinity;
  let item = -1; // place in the list whose entries stand at `indent`; -1: not in a list
  for (let i = Math.min(line, lines.length) - 1; i >= 0; --i) {
    const [, blank, dash, key] = /^(\s*)(- )?\s*(?:([\w-]+)\s*:)?/.exec(lines[i]!)!;
    const at = blank!.length;
    if (!lines[i]!.trim() || lines[i]!.trim().startsWith("#") || at > indent) continue;
    if (item >= 0 && dash && at === indent) ++item;
    else if (dash && at < indent) {
      if (key && indent === Infinity) path.push(key);
      if (item >= 0) path.push(item);
      [item, indent] = [0, at];
    } else if (key && (at < indent || item >= 0)) {
      if (item >= 0) path.push(item);
      path.push(key);
      [item, indent] = [-1, at];
    }
  }
  return path.reverse();
}

const TOP: Record<string, Fault> = {
  id: { part: "case", field: "editor-id" },
  title: { part: "case", field: "editor-name" },
  level: { part: "case", field: "editor-level" },
  history: { part: "case", field: "editor-history" },
  note: { part: "case", field: "editor-note" },
  circulation: { part: "leg", field: "editor-leak" },
};

/** The field that a sentence of the program about the case is about. */
export function faultOf(message: string, text: string, form: Form | null): Fault {
  const [, line, sentence] = /^[^:]*:(\d+): ([^]*)$/.exec(message) ?? [null, "", message];
  if (!form) return { part: "text", field: "editor-text" };
  const [top, ...rest] = line ? pathOf(text, Number(line)) : [];
  const word = /^'?([\w-]+)/.exec(sentence!)?.[1] ?? "";
  const clotsBefore = form.vein && form.vein.stage !== HEALTHY ? 1 : 0;
  const end = /^(from|to)$/.test(word) ? word : "stage";
  const branch = /no vein '(\w+)'/.exec(sentence!)?.[1];
  const segment = /truth (?:calls|misses the segment|names) '?(\w+)/.exec(sentence!)?.[1];
  if (branch) {
    const i = (form.findings?.branches ?? []).findIndex((c) => c.branch === branch);
    return { part: "findings", field: `editor-clot-${clotsBefore + i}-stage` };
  }
  if (segment) return { part: "answer", field: `editor-truth-${segment}` };
  if (/^(a clot from|webs in)/.test(sentence!)) return { part: "findings", field: "editor-clot-0-from" };
  if (typeof top === "string" && TOP[top]) return TOP[top]!;
  if (top === "leg") return { part: "leg", field: `editor-${rest[0] ?? word}` };
  if (top === "vein") return { part: "findings", field: `editor-clot-0-${end}` };
  if (top === "findings") {
    const [list, i] = rest;
    if (list === "branches") return { part: "findings", field: `editor-clot-${clotsBefore + Number(i ?? 0)}-${end}` };
    return { part: "findings", field: list === "lesions" ? `editor-lesion-${Number(i ?? 0)}-${word === "depth_mm" ? "depth" : "kind"}` : "editor-oedema" };
  }
  if (top === "truth") {
    if (rest[0] === "segments") return { part: "answer", field: `editor-truth-${rest[1] ?? ""}` };
    return { part: "answer", field: rest[0] === "look_alikes" ? "editor-alike" : rest[0] === "diagnosis" || word === "diagnosis" ? "editor-diagnosis" : "editor-thrombosis" };
  }
  if (line) return { part: "text", field: "editor-text" };
  const known = Object.keys(form.leg ?? {}).find((key) => sentence!.includes(key));
  return known ? { part: "leg", field: `editor-${known}` } : { part: "text", field: "editor-text" };
}

// ---- what is said of it

/** A vein by its name in the limb, as the picture calls it. */
export const veinName = (branch: string | undefined): string => {
  if (branch === undefined) return t("editor.main_vein");
  const name = capital(branch.replace(/_/g, " "));
  return told(/(vein|artery)$/.test(name) ? name : `${name} vein`);
};

/** Where along the main vein a clot is; empty for one that is elsewhere, or by the program's own marks. */
export function whereabouts(c: Clot, leg: DraftLeg): string {
  if (c.branch !== undefined) return "";
  const [from, to] = [c.from, c.to].map((p) => (typeof p === "object" && p.segment ? amid(segmentTitle(p.segment, leg)) : ""));
  if (!from || !to) return "";
  return from === to ? from : t("editor.from_to", { from, to });
}

/** What the findings come to, in words. */
export function diagnosis(form: Form, leg: DraftLeg): string {
  const each = clots(form).map((c) => t("editor.clot_in", { stage: label(c.stage), vein: amid(whereabouts(c, leg) || veinName(c.branch)) }));
  return each.length ? each.join("; ").slice(0, 159) : t("editor.fresh.diagnosis");
}

/** What the program says most often of a case, in the reader's language. */
export function why(sentence: string, leg: DraftLeg): string {
  const found = (form: RegExp): string[] | undefined => form.exec(sentence)?.slice(1);
  const number = found(/^(\S+) must be a number from (\S+) to (\S+), got '(.*)'$/);
  if (number) return t("editor.why.number", { name: number[0]!, low: number[1]!, high: number[2]!, got: number[3]! });
  const choice = found(/^(\S+) is '(.*)', expected one of (.*)$/);
  if (choice) return t("editor.why.choice", { name: choice[0]!, got: choice[1]!, list: choice[2]! });
  const id = found(/^id '(.*)' has '(.)', expected/);
  if (id) return t("editor.why.id", { id: id[0]!, sign: id[1]! });
  const missing = found(/^(\S+) is missing$/);
  if (missing) return t("editor.why.missing", { name: missing[0]! });
  const truth = found(/truth calls (\w+) (\w+), but (\d+) of its (\d+) mm have a clot$/);
  if (truth) return t("editor.why.truth", { segment: segmentTitle(truth[0]!, leg), called: amid(t(truth[1] === "clot" ? "finding.clot" : "finding.compressible")), clot: truth[2]!, all: truth[3]! });
  const segment = found(/truth (?:misses the segment|names) '(\w+)'/);
  if (segment) return t("editor.why.segment", { segment: segmentTitle(segment[0]!, leg) });
  const order = found(/^a clot from (\d+) to (\d+) mm along the vein/);
  if (order) return t("editor.why.order", { from: order[0]!, to: order[1]! });
  if (/^thrombosis is (true|false), but/.test(sentence)) return t("editor.why.thrombosis");
  const vein = found(/no vein '(\w+)'/);
  return vein ? t("editor.why.no_vein", { vein: veinName(vein[0]) }) : sentence;
}

/** A sentence about the case with its line, for readers. */
export function lined(message: string, leg: DraftLeg): string {
  const [, n, sentence] = /^[^:]*:(\d+): ([^]*)$/.exec(message) ?? [];
  return n ? t("editor.line", { n: Number(n), why: why(sentence!, leg) }) : why(message, leg);
}
