// What the page keeps of the course, and guidance in the picture, without a browser: the order of the
// steps, the bar, patients that are drawn, the file of the progress; names at the picture's edges.
// Usage: node course_test.mjs WEB_BUILD_DIR SOURCE_DIR
import { createRequire } from "node:module";
import { readdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";

const [web, source] = process.argv.slice(2, 4).map((p) => resolve(p));
const esbuild = createRequire(join(web, "package.json"))("esbuild");
let checks = 0;
const failures = [];
const check = (good, what) => (++checks, good || (failures.push(what), console.log(`FAILED ${what}`)));

// A page's memory, and as much of a document as the modules ask for when they are loaded.
const memory = new Map();
globalThis.localStorage = { getItem: (k) => memory.get(k) ?? null, setItem: (k, v) => memory.set(k, v) };
globalThis.window = { addEventListener: () => undefined };
class Node {
  constructor(name) {
    Object.assign(this, { name, attributes: {}, children: [], textContent: "" });
  }
  setAttribute(key, value) {
    this.attributes[key] = value;
  }
  append(...more) {
    this.children.push(...more);
  }
  replaceChildren(...more) {
    this.children = more;
  }
}
globalThis.document = { createElementNS: (_space, name) => new Node(name) };

async function load(name) {
  const made = await esbuild.build({ entryPoints: [join(web, "src", name)], bundle: true, format: "esm", write: false, logLevel: "silent" });
  return import(`data:text/javascript;base64,${Buffer.from(made.outputFiles[0].text).toString("base64")}`);
}

const { Progress } = await load("progress.ts");
const bar = { score: 90, mean: 98, sd: 1, runs: 5, time_s: 9, path_mm: 300, force_n: 9 };
const question = { ask: "a", choices: ["b", "c"], right: 1, why: "w" };
const lesson = { id: "lesson-a", title: "A", goal: "g", patient: "Woman", places: 2, practice: ["full", "hints", "exam"], quiz: [question, question], bar };
const last = { ...lesson, id: "lesson-z", patient: "", practice: ["exam", "exam"], quiz: [] };

const p = new Progress();
const at = (l) => JSON.stringify(p.next(l));
check(at(lesson) === '{"kind":"watch"}', "a lesson begins with its demonstration");
p.watch(lesson);
check(at(lesson) === '{"kind":"practise","turn":0}', "then comes the first repetition");
p.practised(lesson, 0, 40, false);
check(at(lesson) === '{"kind":"practise","turn":1}', "with help a repetition has only to be done");
p.practised(lesson, 1, 95, true);
p.practised(lesson, 2, 80, false);
check(at(lesson) === '{"kind":"practise","turn":2}', "without help it has to reach the bar");
p.practised(lesson, 2, 93, true);
p.practised(lesson, 2, 70, false);
check(at(lesson) === '{"kind":"quiz"}' && p.done(lesson).turns[2].reached, "a bar that was reached stays reached");
p.answer(lesson, 0);
check(at(lesson) === '{"kind":"quiz"}', "every question has to be answered");
p.answer(lesson, 1);
check(at(lesson) === '{"kind":"passed"}' && p.current([lesson, last]) === 1, "then the next lesson is current");
p.watch(last);
p.practised(last, 0, 95, true);
check(at(last) === '{"kind":"practise","turn":1}', "one drawn patient after the other");
p.practised(last, 1, 60, false);
check(at(last) === '{"kind":"practise","turn":0}', "one that is missed begins the row anew");

// Another visit, another learner, a file.
check(JSON.stringify(new Progress().next(lesson)) === '{"kind":"passed"}', "the browser keeps it");
const other = new Progress();
other.of("Lea");
check(other.next(lesson).kind === "watch", "each name has its own");
check(other.load(p.text()) && other.next(lesson).kind === "passed", "a saved file brings it along");
for (const bad of ["", "[]", "null", "7", "{", '{"lessons":{}}', '{"sonde_progress":2,"lessons":{}}', '{"sonde_progress":1}']) check(!other.load(bad), `no progress: ${bad}`);
check(other.load('{"sonde_progress":1,"lessons":{"lesson-a":{"turns":[{"score":"x"}],"answered":[1]},"b":7}}') && other.next(lesson).kind === "watch", "what is no progress in a file counts as not done");
check(other.next(lesson).kind === "watch" && p.next(lesson).kind === "passed", "and touches nobody else's");

// Guidance: every name once, all text within the picture, no label on another of its side.
const { PictureGuide, wrap } = await load("guide.ts");
check(wrap("closed: the walls touch", 12).join("|") === "closed: the|walls touch", "words are not broken");
const guide = new PictureGuide();
guide.layout(50, 50, 8, { radius_mm: 0, top_mm: 0 });
const mark = (name, x_mm, depth_mm, more = {}) => ({ kind: "vein", name, why: "", wanted: false, x_mm, depth_mm, half_mm: 4, flat_mm: 4, ...more });
const marks = [
  mark("Common femoral vein", 5, 20, { wanted: true, why: "closed: the walls touch, there is no clot here" }),
  mark("Great saphenous vein", 9, 18), mark("Superficial epigastric vein", 15, 17), mark("Common femoral artery", -10, 19, { kind: "artery", why: "round, thick wall, beats, keeps its shape" }),
  mark("Below the picture", 0, 70),
];
guide.show({ marks, aside_mm: 12, along_mm: 0, way: "12 mm to this side" });
const all = (name) => guide.svg.children.filter((n) => n.name === name);
const labels = all("text").filter((t) => t.children.length);
check(labels.length === 4 && all("ellipse").length === 4, "what is in the picture is named, and nothing else");
for (const side of ["start", "end"]) {
  const rows = labels.filter((t) => t.attributes["text-anchor"] === side).map((t) => t.children.map((s) => Number(s.attributes.y)));
  rows.sort((a, b) => a[0] - b[0]);
  rows.forEach((r, k) => check(k === 0 || r[0] >= rows[k - 1].at(-1) + 14, `labels of one side stand apart: ${rows.map(String).join(" / ")}`));
  for (const y of rows.flat()) check(y > 0 && y < 400, `a label is in the picture: ${y}`);
}
check(all("text").some((t) => t.textContent === "12 mm to this side") && all("path").some((n) => n.attributes.class === "arrow"), "the way is an arrow with its length");
guide.show({ marks: [], aside_mm: 2, along_mm: -40, way: "40 mm towards the knee" });
check(all("text").some((t) => t.textContent === "Slide 40 mm towards the knee") && !all("path").length, "along the leg it is said in words");
guide.show(null);
check(guide.svg.children.length === 0, "without guidance nothing is drawn");

// The lessons that ship: the right choice is not always at the same place.
const places = new Map();
for (const file of readdirSync(join(source, "data/course")).filter((f) => f.endsWith(".yaml")))
  for (const [, n] of readFileSync(join(source, "data/course", file), "utf8").matchAll(/^ {2}right: (\d)/gm)) places.set(n, (places.get(n) ?? 0) + 1);
const count = [...places.values()].reduce((a, b) => a + b, 0);
check(count >= 20 && [...places.values()].every((n) => n <= 0.5 * count), `right choices are spread: ${[...places].join(" ")}`);

console.log(`${checks} checks, ${failures.length} failed`);
process.exit(failures.length || checks < 20 ? 1 : 0);
