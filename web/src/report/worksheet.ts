// The worksheet of an exam as it is read and printed: conclusion, a line for each station, and its pictures
// side by side, without and with compression. Used by the page and by the report; written by
// src/sonde-exam/trainer/worksheet_save.c.

import { h, s, type Child } from "./dom";
import { fixed, isKnown, signed, type Real } from "./number";
import { counted, t } from "../words/language";

export type Finding = "" | "compressible" | "partly" | "not_compressible" | "not_seen";
export type Age = "" | "acute" | "chronic" | "indeterminate";
export type Kind = "" | "occlusive" | "partly" | "free_floating";
export type Reflux = "" | "absent" | "present";
export type Conclusion = "" | "no_dvt" | "proximal" | "distal" | "superficial" | "inconclusive";
export type Outcome = "right" | "missed" | "over_called" | "not_seen" | "not_written";

export interface PlaceVerdict {
  outcome: Outcome;
  truth: Finding;
  /** a clot ends here: either finding is right */
  edge: boolean;
  age: Age;
  kind: Kind;
  age_right: boolean;
  kind_right: boolean;
  documented: boolean;
  /** what is wrong with the pictures */
  pictures: string;
}

export interface SheetPlace {
  title: string;
  segment: string;
  position: string;
  superficial: boolean;
  finding: Finding;
  age: Age;
  kind: Kind;
  reflux: Reflux;
  reflux_s: Real;
  text: string;
  verdict?: PlaceVerdict;
}

export interface Mark {
  distance_mm?: number;
  area_mm2?: number;
  /** from and to, each from the left edge and below the probe; half of the ellipse's other axis */
  at_mm: [number, number, number, number, number];
}

export interface SheetPicture {
  number: number;
  place: number;
  view: "without" | "with";
  time_s: number;
  force_n: number;
  width_mm: number;
  height_mm: number;
  marks: Mark[];
  /** PNG in base64 */
  image?: string;
}

export interface ExtentVerdict {
  clot: boolean;
  said: boolean;
  truth: number[];
  off_stations: Real[];
  off_mm: Real[];
}

export interface SheetVerdict {
  score: number;
  findings: number;
  pictures: number;
  clot: Real;
  places: number;
  right: number;
  missed: number;
  over_called: number;
  documented: number;
  conclusion: Conclusion;
  conclusion_right: boolean;
  deep: ExtentVerdict;
  superficial: ExtentVerdict;
  summary: string;
}

export interface Sheet {
  side: "left" | "right" | "";
  written: boolean;
  places: SheetPlace[];
  pictures: SheetPicture[];
  deep: number[];
  superficial: number[];
  conclusion: Conclusion;
  text: string;
  verdict?: SheetVerdict;
}

export const FINDING_WORDS: Record<Finding, string> = { "": "", compressible: t("sheet.finding.compressible"), partly: t("sheet.finding.partly"), not_compressible: t("sheet.finding.not_compressible"), not_seen: t("sheet.finding.not_seen") };
export const AGE_WORDS: Record<Age, string> = { "": "", acute: t("sheet.age.acute"), chronic: t("sheet.age.chronic"), indeterminate: t("sheet.age.indeterminate") };
export const KIND_WORDS: Record<Kind, string> = { "": "", occlusive: t("sheet.kind.occlusive"), partly: t("sheet.kind.partly"), free_floating: t("sheet.kind.free_floating") };
export const REFLUX_WORDS: Record<Reflux, string> = { "": "", absent: t("sheet.reflux.absent"), present: t("sheet.reflux.present") };
export const CONCLUSION_WORDS: Record<Conclusion, string> = {
  "": t("sheet.conclusion.none"), no_dvt: t("sheet.conclusion.no_dvt"), proximal: t("sheet.conclusion.proximal"), distal: t("sheet.conclusion.distal"),
  superficial: t("sheet.conclusion.superficial"), inconclusive: t("sheet.conclusion.inconclusive"),
};
const OUTCOME_WORDS: Record<Outcome, string> = { right: t("sheet.outcome.right"), missed: t("sheet.outcome.missed"), over_called: t("sheet.outcome.over_called"), not_seen: t("sheet.outcome.not_seen"), not_written: t("sheet.outcome.not_written") };

export const isClot = (finding: Finding): boolean => finding === "partly" || finding === "not_compressible";
export const sideWord = (sheet: Sheet): string => (sheet.side ? t(`sheet.side.${sheet.side}`) : "");

/** Label of a station's pictures, as on a scanner. */
export const stationLabel = (sheet: Sheet, place: number): string => [sheet.side && (sheet.side === "left" ? t("sheet.side.l") : t("sheet.side.r")), sheet.places[place]?.title].filter(Boolean).join(" ");

const sized = (mark: Mark): string => (mark.area_mm2 !== undefined ? `${fixed(mark.area_mm2, 0)} mm\u00b2` : `${fixed(mark.distance_mm, 1)} mm`);

function drawMark(mark: Mark, index: number): SVGElement {
  const [x1, y1, x2, y2, half] = mark.at_mm;
  const length = Math.hypot(x2 - x1, y2 - y1);
  const angle = (Math.atan2(y2 - y1, x2 - x1) * 180) / Math.PI;
  const [cx, cy] = [(x1 + x2) / 2, (y1 + y2) / 2];
  const cross = (x: number, y: number): SVGElement => s("path", { d: `M${x - 1} ${y}H${x + 1}M${x} ${y - 1}V${y + 1}` });
  return s("g", {}, s("line", { x1, y1, x2, y2 }), half > 0 ? s("ellipse", { cx, cy, rx: length / 2, ry: half, transform: `rotate(${angle} ${cx} ${cy})` }) : null,
    cross(x1, y1), cross(x2, y2), s("text", { x: x2 + 1.4, y: y2 - 0.6 }, String(index + 1)));
}

/** A stored picture with its label, its calipers and the force. @param src where its pixels are; empty: not there */
export function drawPicture(sheet: Sheet, picture: SheetPicture, src: string): HTMLElement {
  const label = t(picture.view === "with" ? "sheet.picture_with" : "sheet.picture_without", { station: stationLabel(sheet, picture.place) });
  const marks = picture.marks.length
    ? s("svg", { viewBox: `0 0 ${picture.width_mm} ${picture.height_mm}`, class: "sheet-marks", "aria-hidden": "true" }, ...picture.marks.map(drawMark)) : null;
  const sizes = picture.marks.map((m, i) => `${i + 1}: ${sized(m)}`).join("  ");
  return h("figure", { class: "sheet-picture" },
    h("div", { class: "sheet-image" }, src ? h("img", { src, alt: label }) : h("em", {}, t("sheet.not_loaded")), marks,
      h("span", { class: "sheet-label" }, stationLabel(sheet, picture.place)), h("span", { class: "sheet-view" }, picture.view === "with" ? t("sheet.w_comp") : t("sheet.wo_comp"))),
    h("figcaption", {}, `${fixed(picture.force_n, 1)} N${sizes ? `  \u00b7  ${sizes}` : ""}`));
}

/** The newest picture of a station in a view. */
export const newest = (sheet: Sheet, place: number, view: "without" | "with"): SheetPicture | undefined =>
  [...sheet.pictures].reverse().find((p) => p.place === place && p.view === view);

function pair(sheet: Sheet, place: number, source: (p: SheetPicture) => string): HTMLElement | null {
  const views = (["without", "with"] as const).map((view) => newest(sheet, place, view));
  if (!views[0] && !views[1]) return null;
  const empty = (view: "with" | "without"): HTMLElement => h("figure", { class: "sheet-picture none" }, h("div", { class: "sheet-image" }, h("em", {}, t(`sheet.no_picture_${view}`))), h("figcaption", {}, "\u2013"));
  return h("div", { class: "sheet-pair" }, h("b", {}, `${place + 1}  ${sheet.places[place]!.title}`),
    h("div", {}, ...views.map((p, i) => (p ? drawPicture(sheet, p, source(p)) : empty(i ? "with" : "without")))));
}

const placeNames = (sheet: Sheet, ends: number[]): string => (ends.length === 2 ? t("sheet.from_to", { from: sheet.places[ends[0]!]?.title ?? "?", to: sheet.places[ends[1]!]?.title ?? "?" }) : "");

/** Reflux as it is written in a line. */
const reflux = (p: SheetPlace): string => `${REFLUX_WORDS[p.reflux]}${isKnown(p.reflux_s) ? ` ${fixed(p.reflux_s, 2)} s` : ""}`;

/** What was right or wrong at a place, in words. */
function verdictOf(p: SheetPlace): HTMLElement {
  const v = p.verdict!;
  const good = v.outcome === "right";
  const wrong: string[] = [];
  if (isClot(p.finding) && isClot(v.truth) && good) {
    if (!v.age_right) wrong.push(p.age ? t("sheet.age_truth", { age: AGE_WORDS[v.age] }) : t("sheet.age_not_written"));
    if (!v.kind_right) wrong.push(p.kind ? t("sheet.kind_truth", { kind: KIND_WORDS[v.kind] }) : t("sheet.kind_not_written"));
  }
  const truth = v.edge ? t("sheet.clot_ends") : isClot(v.truth) ? `${FINDING_WORDS[v.truth]}, ${AGE_WORDS[v.age]}` : FINDING_WORDS[v.truth];
  return h("div", {}, h("b", { class: good ? "yes" : "no" }, `${good ? "\u2713" : "\u2717"} ${OUTCOME_WORDS[v.outcome]}`),
    !good || isClot(v.truth) || v.edge ? ` (${truth})` : null, ...wrong.map((w) => h("div", { class: "no" }, w)), v.documented ? null : h("div", { class: "gap" }, t("sheet.pictures_gap", { pictures: v.pictures })));
}

function lines(sheet: Sheet): HTMLElement {
  const judged = sheet.verdict !== undefined;
  const refluxed = sheet.places.some((p) => p.reflux || isKnown(p.reflux_s));
  const heads = ["", t("sheet.head.station"), t("sheet.head.compression"), t("sheet.head.clot"), ...(refluxed ? [t("sheet.reflux")] : []), t("sheet.head.pictures"), t("sheet.note"), ...(judged ? [t("sheet.head.truth")] : [])];
  const rows = sheet.places.map((p, i) => {
    const count = (view: string): number => sheet.pictures.filter((x) => x.place === i && x.view === view).length;
    const [without, with_] = [count("without"), count("with")];
    const cells: Child[] = [String(i + 1), h("b", {}, p.title), h("span", { class: `found ${p.finding}` }, FINDING_WORDS[p.finding] || "\u2013"),
      isClot(p.finding) ? [AGE_WORDS[p.age], KIND_WORDS[p.kind]].filter(Boolean).join(", ") || t("sheet.not_described") : "",
      ...(refluxed ? [reflux(p)] : []), t(without && with_ ? "sheet.pictures.both" : without ? "sheet.pictures.without" : with_ ? "sheet.pictures.with" : "sheet.pictures.none"), p.text, ...(judged ? [verdictOf(p)] : [])];
    return h("tr", { class: p.verdict && p.verdict.outcome !== "right" ? "wrong" : undefined }, ...cells.map((c) => h("td", {}, c)));
  });
  return h("table", { class: "sheet-lines" }, h("thead", {}, h("tr", {}, ...heads.map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, ...rows));
}

/** Both ends of the clot against the truth. */
function extentVerdict(sheet: Sheet, v: ExtentVerdict): string {
  if (!v.clot) return v.said ? t("sheet.extent.none") : "";
  const truth = placeNames(sheet, v.truth);
  if (!v.said) return t("sheet.extent.not_written", { truth });
  const off = (["upper", "lower"] as const).map((end, i) => {
    const n = v.off_stations[i];
    return isKnown(n) && n !== 0 ? counted(`sheet.${end}_${n > 0 ? "low" : "high"}`, Math.abs(n), { mm: signed(v.off_mm[i], 0) }) : "";
  }).filter(Boolean);
  return off.length ? t("sheet.extent.off", { ends: off.join(", "), truth }) : t("sheet.extent.right");
}

function conclusion(sheet: Sheet): HTMLElement {
  const v = sheet.verdict;
  const row = (name: string, words: Child, verdict: Child): Child => h("div", {}, h("dt", {}, name), h("dd", {}, words, verdict));
  const mark = (good: boolean, words: string): HTMLElement => h("span", { class: good ? "yes" : "no" }, ` ${good ? "\u2713" : "\u2717"} ${words}`);
  const extent = (name: string, ends: number[], e: ExtentVerdict | undefined): Child => {
    const said = placeNames(sheet, ends);
    const words = e ? extentVerdict(sheet, e) : "";
    return said || words ? row(name, said || "\u2013", words && mark(words === t("sheet.extent.right"), words)) : null;
  };
  return h("dl", { class: "sheet-conclusion" },
    row(t("sheet.conclusion"), h("b", {}, CONCLUSION_WORDS[sheet.conclusion]), v && mark(v.conclusion_right, v.conclusion_right ? t("sheet.outcome.right") : t("sheet.truly", { conclusion: CONCLUSION_WORDS[v.conclusion] }))),
    extent(t("sheet.deep"), sheet.deep, v?.deep), extent(t("sheet.superficial"), sheet.superficial, v?.superficial),
    sheet.text ? row(t("sheet.impression"), h("span", { class: "text" }, sheet.text), null) : null,
    v ? row(t("page.worksheet"), h("b", {}, t("sheet.score_of", { score: fixed(v.score, 0) })), ` ${v.summary}`) : null);
}

/** What a worksheet is about: name and value, those that are known. */
export type About = [name: string, value: string | null | undefined][];

/** The whole worksheet. @param source where a picture's pixels are */
export function drawSheet(sheet: Sheet, about: About, source: (p: SheetPicture) => string): HTMLElement {
  const title = t(sheet.side ? `sheet.title.${sheet.side}` : "sheet.title");
  const pairs = sheet.places.map((_p, i) => pair(sheet, i, source)).filter((p) => p !== null);
  return h("article", { class: "sheet" },
    h("header", { class: "sheet-head" }, h("h2", {}, title), h("dl", {}, ...about.filter(([, value]) => value).map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))))),
    conclusion(sheet), lines(sheet),
    pairs.length ? h("div", { class: "sheet-pairs" }, ...pairs) : h("p", { class: "sheet-none" }, t("sheet.no_pictures")),
    h("p", { class: "sheet-foot" }, t("sheet.foot")));
}
