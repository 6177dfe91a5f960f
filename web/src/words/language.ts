// The language of a page or report, and its texts: `t` gives the text of a key, `told` the translation of what the
// program says, which writes English. Chosen by the reader, kept in the browser, at first the browser's own. No DOM
// but in `dress`, so that modules with words work without a page.

import { de } from "./de";
import { en } from "./en";
import { fr } from "./fr";
import { toldDe } from "./told_de";
import { toldFr } from "./told_fr";

export type Key = keyof typeof en;
export type Words = Record<Key, string>;
type Names<S extends string> = S extends `${string}{${infer N}}${infer Rest}` ? N | Names<Rest> : never;
type Values<K extends Key> = [Names<(typeof en)[K]>] extends [never] ? [] : [values: Record<Names<(typeof en)[K]>, string | number>];

export const LANGUAGES = { en: "English", de: "Deutsch", fr: "Français" } as const;
export type Language = keyof typeof LANGUAGES;

const TEXTS: Record<Language, Words> = { en, de, fr };
const TOLD: Record<Language, Record<string, string>> = { en: {}, de: toldDe, fr: toldFr };
const KEPT = "sonde.language";

const known = (name: string | null | undefined): Language | undefined => {
  const code = name?.slice(0, 2).toLowerCase() ?? "";
  return code in LANGUAGES ? (code as Language) : undefined;
};

/** The address's wish (?lang= or #lang=), what was chosen here before, what the browser speaks. */
function find(): Language {
  if (typeof location === "undefined") return "en";
  const asked = /[?&#]lang=([a-z]+)/.exec(location.search + location.hash)?.[1];
  let kept: string | null = null;
  try {
    kept = localStorage.getItem(KEPT);
  } catch {
    // private mode, or a report from a file: the browser's own language
  }
  return known(asked) ?? known(kept) ?? navigator.languages.map(known).find(Boolean) ?? "en";
}

export const language: Language = find();
const words = TEXTS[language];

/** The reader chooses; the page is loaded anew, since its views write their texts once. */
export function choose(name: Language): void {
  try {
    localStorage.setItem(KEPT, name);
  } catch {
    // private mode: the address keeps it
  }
  const address = new URL(location.href);
  address.searchParams.set("lang", name);
  location.replace(address);
}

// ---- numbers

const SIGN = new Intl.NumberFormat(language).formatToParts(1.5).find((p) => p.type === "decimal")?.value ?? ".";

/** Digits with the language's decimal sign. */
export const decimal = (digits: string): string => (SIGN === "." ? digits : digits.replace(".", SIGN));

/** A number as it is read, with so many decimals. */
export const shown = (value: number, decimals: number): string => decimal(value.toFixed(decimals));

// ---- the page's own texts

function put(text: string, values: Record<string, string | number> | undefined): string {
  return values ? text.replace(/\{(\w+)\}/g, (_all, name: string) => {
    const value = values[name] ?? "";
    return typeof value === "number" ? decimal(String(value)) : value;
  }) : text;
}

/** The text of a key, with its places filled; numbers get the language's decimal sign. */
export const t = <K extends Key>(key: K, ...[values]: Values<K>): string => put(words[key], values);

const rules = new Intl.PluralRules(language);
/** Keys of which there is one for a single thing and one for several. */
export type Counted = { [K in Key]: K extends `${infer Base}.one` ? Base : never }[Key];

/** The text for so many things: of `key.one` or `key.other`; {n} is the count. */
export function counted(key: Counted, n: number, values: Record<string, string | number> = {}): string {
  return put(words[`${key}.${rules.select(n) === "one" ? "one" : "other"}` as Key], { n, ...values });
}

/** Surnames that vessels are called by: capital within a sentence too. */
const SURNAME = /^(Boyd|Cockett|Dodd|Hunter)\b/;

/** A name within a sentence: a small first letter where the language allows it. */
export const amid = (name: string): string => (language === "de" || SURNAME.test(name) ? name : name.charAt(0).toLowerCase() + name.slice(1));

export const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

const hasKey = (key: string): key is Key => key in words;

/** What a thing of the program is called that has only an id: "acute_occlusive" -> "Acute occlusive". */
export function named(id: string): string {
  const plain = id.replace(/.*\//, "");
  const key = `name.${plain}`;
  if (hasKey(key)) return words[key];
  return capital(plain.replace(/_/g, " "));
}

// ---- what the program says

interface Form {
  pattern: RegExp;
  names: string[];
  text: string;
}

const exact = TOLD[language];
const forms: Form[] = Object.entries(exact).filter(([from]) => from.includes("{")).map(([from, text]) => {
  const names: string[] = [];
  // A place whose name is one letter takes a number, any other one a text that is translated itself.
  const pattern = from.replace(/[.*+?^$()|[\]\\]/g, "\\$&").replace(/\{(\w+)\}/g, (_all, name: string) => {
    names.push(name);
    return name.length === 1 ? "([-\u2212]?[\\d.]+)" : "(.+?)";
  });
  return { pattern: new RegExp(`^${pattern}$`), names, text };
});
const memory = new Map<string, string>();
const origin = new Map<string, string>();

function formed(text: string): string | null {
  for (const { pattern, names, text: to } of forms) {
    const found = pattern.exec(text);
    if (!found) continue;
    return put(to, Object.fromEntries(names.map((name, i) => [name, name.length === 1 ? decimal(found[i + 1]!) : told(found[i + 1]!)])));
  }
  return null;
}

const whole = (text: string): string | null => exact[text] ?? formed(text);

/** Texts that are joined from several, each of which must be known: the longest first, since titles have commas too. */
function parted(text: string): string | null {
  for (const by of ["; ", ". ", ", "]) {
    const parts = text.split(by);
    const out: string[] = [];
    for (let i = 0; i < parts.length && parts.length > 1; ) {
      let end = parts.length;
      let to: string | null = null;
      for (; end > i && to === null; --end) to = whole(parts.slice(i, end).join(by));
      if (to === null) break;
      out.push(to);
      i = end + 1;
      if (i === parts.length) return out.join(by);
    }
  }
  return null;
}

/** Sentences of the program that have no translation, for tests. */
export const untold = new Set<string>();

/** Translates a text of the program; what nobody has translated, such as what a learner wrote, stays as it is. */
export function told(text: string): string {
  if (language === "en" || !/[A-Za-z]{2}/.test(text)) return text;
  const before = memory.get(text);
  if (before !== undefined) return before;
  // Within another sentence the first letter may be a small one.
  const found = whole(text) ?? parted(text) ?? whole(capital(text));
  if (found === null && untold.size < 100) untold.add(text);
  const to = found ?? text;
  if (memory.size > 5000) memory.clear(); // sentences with numbers are many
  memory.set(text, to);
  if (to !== text) origin.set(to, text);
  return to;
}

/** The English text that was translated to this one, for files that a program reads. */
export const original = (text: string): string => origin.get(text) ?? text;

/** Members of messages and reports that hold sentences of the program, or lists of them. */
const SPOKEN = new Set(["title", "text", "detail", "hint", "history", "patient", "note", "goal", "words", "ask", "why", "choices", "name", "way", "summary", "lost", "message",
  "asked", "diagnosis", "meaning", "pictures", "faults"]);

function walk(value: unknown, member: string): unknown {
  if (typeof value === "string") return SPOKEN.has(member) ? told(value) : value;
  if (Array.isArray(value)) return value.map((v) => walk(v, member));
  if (value === null || typeof value !== "object") return value;
  const person = "author" in value || "finding" in value || "conclusion" in value || "serial" in value; // a text of these was written by one
  const scored = "asked" in value || "thrombosis" in value; // the truth of these is a sentence, elsewhere an id
  return Object.fromEntries(Object.entries(value).map(([name, v]) => [name, name === "probes" || (name === "text" && person) ? v : walk(v, name === "truth" && scored ? "diagnosis" : name)]));
}

/** A message of the program or the data of a report with its sentences in the reader's language. */
export const translated = <T>(message: T): T => (language === "en" ? message : (walk(message, "") as T));

// ---- the document

/** Writes the texts whose keys stand in the document: data-t is its text, data-t-title and so on an attribute. */
export function dress(root: Document): void {
  root.documentElement.lang = language;
  const attributes = { "data-t-title": "title", "data-t-label": "aria-label", "data-t-placeholder": "placeholder" };
  for (const e of root.querySelectorAll("[data-t]")) e.prepend(words[e.getAttribute("data-t") as Key]);
  for (const [from, to] of Object.entries(attributes))
    for (const e of root.querySelectorAll(`[${from}]`)) e.setAttribute(to, words[e.getAttribute(from) as Key]);
}
