// What the page says of a press, without a browser: for one instant the word at the force, the tag in
// the bar and the note to newcomers never contradict each other; and nothing that a learner reads
// holds an engineer's word. Usage: node feedback_test.mjs WEB_BUILD_DIR SOURCE_DIR
import { createRequire } from "node:module";
import { readdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";

const [web, source] = process.argv.slice(2, 4).map((p) => resolve(p));
const esbuild = createRequire(join(web, "package.json"))("esbuild");
const failures = [];
const check = (good, what) => good || (failures.push(what), console.log(`FAILED ${what}`));

async function load(name) {
  const made = await esbuild.build({ entryPoints: [join(web, "src", name)], bundle: true, format: "esm", write: false, logLevel: "silent" });
  return import(`data:text/javascript;base64,${Buffer.from(made.outputFiles[0].text).toString("base64")}`);
}

const STATES = ["none", "pressing", "complete", "open", "too_hard", "off_axis"];
const { feedback } = await load("feedback.ts");
let [hard, closed] = [0, 0];
for (const target_n of [null, [6, 14], [22, 29], [38, 48]])
  for (const state of [null, ...STATES])
    for (let force_n = 0; force_n <= 50; force_n += 0.5) {
      const compression = state && { state, vein: 0.5, artery: 0.8 };
      const said = feedback({ force_n, touching: force_n > 0, target_n, limit_n: 40, comfort_n: 20, compression });
      const at = `${force_n} N of ${target_n}, ${state}: "${said.word}", "${said.tag}"`;
      const saysHard = /too hard/i.test(said.word) || /^too hard/i.test(said.tag) || said.tone === "danger";
      const saysGood = said.tone === "good" || /^(Vein closed|Firm)/.test(said.tag);
      check(!(saysHard && saysGood), `good and too hard at once: ${at}`);
      if (target_n && force_n > target_n[1]) check(/too hard/.test(said.word), `above the limit: ${at}`), ++hard;
      if (target_n && force_n <= target_n[1]) check(!/too hard/.test(said.word), `below the limit: ${at}`);
      if (state === "complete" && !saysHard && force_n > 0.5) check(said.word === "let go", `closed: ${at}`), ++closed;
      if (target_n && force_n > 0.5 && force_n < target_n[0]) check(said.word !== "uncomfortable", `asked to press on: ${at}`);
    }
check(hard > 100 && closed > 100, "the cases were tried");

globalThis.window = { addEventListener: () => undefined };
globalThis.localStorage = { getItem: () => null, setItem: () => undefined };
const { dueMark } = await load("coach.ts");
const exam = (state, offset_mm) => ({ phase: "running", guidance: "full", presses: [], segments: [],
  step: { segment: "", target: { radius_mm: 10 }, offset_mm }, compression: { state, vein: 0.5, artery: 0.8 } });
check(dueMark(exam("none", 50), new Set())?.id === "move", "first the probe is moved");
check(dueMark(exam("none", 3), new Set(["move"]))?.id === "press", "then it is pressed");
for (const state of ["complete", "open", "too_hard", "off_axis"])
  check(dueMark(exam(state, 3), new Set(["move"]))?.id !== "press", `nobody is told to press on while the bar says ${state}`);

// ---- words

const ENGINEER = /calculix|\.csv\b|finite.element|bonded|footprint|penetration|skin nodes|dimensionless|\bas fitted\b|fitted values/i;
const quoted = (text) => [...text.matchAll(/"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`|'((?:[^'\\\n]|\\.)*)'/g)].map((m) => m[1] ?? m[2] ?? m[3]);
const plain = (text) => text.split("\n").filter((l) => !/^\s*(\/\/|\*|\/\*)/.test(l)).join("\n");
const files = (folder, end) => readdirSync(join(source, folder)).filter((f) => f.endsWith(end)).map((f) => [`${folder}/${f}`, readFileSync(join(source, folder, f), "utf8")]);
const texts = [
  ...[...files("web/src", ".ts"), ...files("web/src/report", ".ts").filter(([name]) => /exam/.test(name))].map(([name, text]) => [name, quoted(plain(text)).filter((s) => / /.test(s) && !/\$\{/.test(s))]),
  ["web/index.html", [...readFileSync(join(source, "web/index.html"), "utf8").matchAll(/>([^<>]+)<|(?:aria-label|title|placeholder)="([^"]+)"/g)].map((m) => m[1] ?? m[2])],
  ...files("src/sonde-exam/trainer", ".c").filter(([name]) => /judge_guide|score_explain|vein_map/.test(name)).map(([name, text]) => [name, quoted(plain(text)).filter((s) => / /.test(s))]),
  ...files("data/cases", ".yaml").map(([name, text]) => [name, text.split("\n").filter((l) => !/^\s*#/.test(l))]),
  ...files("data/protocols", ".yaml").map(([name, text]) => [name, text.split("\n").filter((l) => !/^\s*#/.test(l))]),
];
check(texts.length > 40 && texts.every(([, list]) => Array.isArray(list)), "the texts were read");
check(texts.reduce((n, [, list]) => n + list.length, 0) > 500, "there are texts");
for (const [name, list] of texts) for (const s of list) check(!ENGINEER.test(s), `${name}: an engineer's word: ${s.slice(0, 90)}`);
const shown = (name) => texts.find(([n]) => n === name)[1];
for (const s of shown("web/index.html").concat(quoted(plain(readFileSync(join(source, "web/src/panel.ts"), "utf8")))))
  check(!/^depth$|\bprobe depth\b/i.test(s.trim()), `depth of what? ${s}`);

console.log(failures.length ? `${failures.length} failures` : "all good");
process.exit(failures.length ? 1 : 0);
