// What the program says to a reader of the page: sentences of the C sources, with a place for each value, and texts of
// the cases, protocols and lessons. Each with where it stands.
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";

/** Sources whose sentences reach the page, and those whose errors do. */
const SOURCES = ["judge_guide.c", "picture.c", "score.c", "score_explain.c", "worksheet_judge.c", "vein_map.c", "case_draw.c"].map((f) => `src/sonde-exam/trainer/${f}`)
  .concat(["src/sonde/haptics/safety.c", "app/exam_app.c", "app/exam_app_draft.c", "app/exam_app_edit.c", "app/exam_app_exam.c", "app/exam_app_export.c", "app/exam_app_film.c", "app/exam_app_files.c", "app/exam_app_replay.c", "app/exam_app_sheet.c"]);
/** Calls whose texts never reach a reader: failures of files, members of JSON, checks. */
const UNSEEN = /\b(sonde_fail|sonde_reader_fail|refuse|SONDE_ASSERT|_Static_assert|sonde_json_\w+|fprintf|printf|strcmp|strncmp|sonde_file_\w+|fopen|strstr|sonde_reader_\w+|sonde_path_\w+|sonde_disk_\w+|offset_of|memcmp|sonde_pathology_preset)\s*\(/g;

/** The end of the call whose bracket stands at `open`. */
function closing(text, open) {
  for (let i = open, depth = 0, quoted = false; i < text.length; ++i) {
    if (text[i] === "\\") ++i;
    else if (text[i] === '"') quoted = !quoted;
    else if (!quoted && text[i] === "(") ++depth;
    else if (!quoted && text[i] === ")" && --depth === 0) return i + 1;
  }
  return text.length;
}

/** "%u of %s" -> "{a} of {one}": a letter for a number, a word for a text. */
export function placed(format) {
  let numbers = 0;
  let texts = 0;
  return format.replace(/%%|%[-+ 0#]*(?:\d+|\*)?(?:\.(?:\d+|\*))?(?:ll|l|z|h)?([a-zA-Z])/g, (all, kind) =>
    all === "%%" ? "%" : kind === "s" ? `{${["one", "two", "three"][texts++]}}` : `{${"abcdefgh"[numbers++]}}`);
}

function sentences(file, text) {
  let code = text.replace(/^\s*#include.*$/gm, "").replace(/\/\*[^]*?\*\//g, "").replace(/^([^"\n]|"(\\.|[^"\\])*")*?\/\/.*$/gm, (line) => line.replace(/\/\/(?=[^"]*$).*/, ""));
  for (let m; (m = UNSEEN.exec(code)); ) {
    const end = closing(code, m.index + m[0].length - 1);
    code = code.slice(0, m.index) + code.slice(end);
    UNSEEN.lastIndex = m.index;
  }
  const found = [];
  for (const m of code.matchAll(/"(?:\\.|[^"\\])*"(?:[\s\\]*"(?:\\.|[^"\\])*")*/g)) {
    const joined = [...m[0].matchAll(/"((?:\\.|[^"\\])*)"/g)].map((p) => p[1]).join("").replace(/\\"/g, '"');
    if (/[A-Za-z]{2,}[,:;]? [A-Za-z%]|^[A-Z][a-z]{2,}|%[.\d]*[fu] [a-z]/.test(joined)) found.push([placed(joined), file]);
  }
  return found;
}

/** Members of the data that are read by people. */
const MEMBERS = /^(\s*(?:- )?)(title|text|history|note|diagnosis|goal|film|ask|why|choices):\s*(.*)$/;

function members(file, text) {
  const found = [];
  const lines = text.split("\n");
  for (let i = 0; i < lines.length; ++i) {
    const m = MEMBERS.exec(lines[i]);
    if (!m) continue;
    let value = m[3];
    if (value === ">") {
      const folded = [];
      while (i + 1 < lines.length && (/^\s/.test(lines[i + 1]) || lines[i + 1] === "") && !MEMBERS.test(lines[i + 1])) folded.push(lines[++i].trim());
      value = folded.join(" ").trim();
    }
    const parts = m[2] === "choices" ? [...value.slice(1, -1).matchAll(/"([^"]*)"|([^,\s][^,]*)/g)].map((p) => (p[1] ?? p[2]).trim()) : [value.replace(/^"(.*)"$/, "$1")];
    for (const part of parts) if (part) found.push([part, file]);
  }
  return found;
}

/** What a source puts together from pieces, as it is heard. */
const JOINED = {
  "{one}{two} compression: {three}": ["with compression: {one}", "without compression: {one}"],
  "{one} deep vein thrombosis: {two}{three}{undefined}": ["{one} deep vein thrombosis: {two} to {three}", "{one} deep vein thrombosis: {two}"],
  "{a} of {b} presses {one}": ["{a} of {b} presses {one}: {two}"],
  "there is no {one} of that name": ["there is no case of that name", "there is no protocol of that name"],
  "common femoral": [],
  "unknown fault": [],
  "Synthetic limb of a training case": [],
  "Leg of a case": [], // the page has words of its own for it
  "there are too many of one's own": [], // on the terminal
  "a case of one's own has no model file": [],
  "another case has its id": [],
  Worksheet: [],
  Guest: [],
};
/** Single words within sentences: ends and sides of the leg, verdicts. */
const PIECES = ["foot", "knee", "groin", "front", "back", "right", "wrong", "missing"];

/** Texts of a list that a macro makes, the last of each row. */
const listed = (file, text, macro) => [...new RegExp(`#define ${macro}\\(X\\)([^]*?[^\\\\])\\n`).exec(text)[1].matchAll(/"((?:\\.|[^"\\])*)"/g)].map((m) => [m[1], file]);

/** Vessels of the picture by their names in the limb, a number in them as a place; each as it is called in the picture. */
function vessels(file, text) {
  const named = [...text.matchAll(/"((?:[A-Za-z]+ )*(?:vein|artery|perforator|loop|tributary)(?: \d)?)"/g)].map((m) => m[1]).filter((name) => name.includes(" "));
  const branches = [...text.matchAll(/"(\w+_(?:vein|artery)|(?:second_)?(?:great|small)_saphenous)"/g)].map((m) => m[1].replace(/_/g, " "));
  const called = (name) => `${name.charAt(0).toUpperCase()}${name.slice(1)}${/(vein|artery)$/.test(name) ? "" : " vein"}`.replace(/ \d /, " {a} ");
  return [...named, ...branches].map((name) => [called(name), file]);
}

export function spoken(source) {
  const at = (file) => [file, readFileSync(join(source, file), "utf8")];
  const all = SOURCES.flatMap((file) => sentences(file, readFileSync(join(source, file), "utf8")));
  all.push(...listed(...at("include/sonde/limb.h"), "SONDE_LIMB_LIST").filter((_row, i) => i % 2 === 1)); // each row: key, text
  all.push(...PIECES.map((word) => [word, "src/sonde-exam/trainer"]));
  all.push(...listed(...at("include/sonde/trainer_judge.h"), "SONDE_SCORE_LIST"), ...listed(...at("include/sonde/haptics.h"), "SONDE_FAULT_LIST"));
  all.push(...[.../POSITION_TITLES\[\] = \{([^}]*)\}/.exec(at("src/sonde-exam/trainer/case_read.c")[1])[1].matchAll(/"([^"]*)"/g)].map((m) => [m[1], "src/sonde-exam/trainer/case_read.c"]));
  const limb = "src/sonde-limb/limb";
  all.push(...sentences(...at(`${limb}/stations.c`)).filter(([text]) => text.endsWith("."))); // what a place looks like, where a protocol says nothing
  for (const name of readdirSync(join(source, limb)).filter((n) => /^(vessels|variants)\w*\.c$/.test(n)).sort()) all.push(...vessels(...at(`${limb}/${name}`)));
  all.push(...vessels(...at("src/sonde-exam/trainer/vein_map.c")), ...["Femoral", "Popliteal"].flatMap((n) => ["vein", "artery"].map((kind) => [`${n} ${kind}`, "src/sonde-exam/trainer/vein_map.c"])));
  for (const directory of ["data/cases", "data/protocols", "data/course", "data/course/cases"])
    for (const name of readdirSync(join(source, directory)).filter((n) => n.endsWith(".yaml")).sort()) all.push(...members(`${directory}/${name}`, readFileSync(join(source, directory, name), "utf8")));
  const once = new Map();
  for (const [text, where] of all.flatMap(([text, where]) => (JOINED[text] ?? [text]).map((t) => [t, where]))) if (!once.has(text)) once.set(text, where);
  return [...once];
}
