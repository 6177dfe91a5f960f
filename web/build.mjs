// Bundles the page and the reports into dist/ (or the directory given as the first argument): index.html,
// style.css, app.js and report.html, and each of them as .gz for embedding. The licences of three.js,
// uPlot and js-yaml stay at the end of the scripts that hold them.
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { gzipSync } from "node:zlib";
import path from "node:path";
import { wordsUsed } from "./words_used.mjs";

const here = import.meta.dirname ?? path.dirname(new URL(import.meta.url).pathname);
const out = path.resolve(process.argv[2] ?? process.env.SONDE_WEB_OUT ?? path.join(here, "dist"));
await mkdir(out, { recursive: true });

const read = (name) => readFile(path.join(here, name), "utf8");
const settings = { bundle: true, minify: true, format: "iife", target: "es2020", legalComments: "eof", logLevel: "warning", metafile: true };
/** `page`: the document of the script. */
async function bundle(entry, outfile, page) {
  const from = path.join(here, "src", entry);
  return build({ ...settings, entryPoints: [from], outfile: path.join(out, outfile), plugins: [await wordsUsed(from, settings, await read(page))] });
}

// One licence text per bundled library, whatever the minifier kept of the comments.
async function licences(inputs) {
  const held = ["three", "uplot", "js-yaml"].filter((name) => Object.keys(inputs).some((file) => file.includes(`node_modules/${name}/`)));
  const texts = await Promise.all(held.map(async (name) => `/*! ${name}\n${await read(`node_modules/${name}/LICENSE`)}*/\n`));
  return texts.join("");
}

const page = await bundle("main.ts", "app.js", "index.html");
const script = path.join(out, "app.js");
await writeFile(script, `${await readFile(script, "utf8")}\n${await licences(page.metafile.inputs)}`);
const plotStyle = `/*! uPlot\n${await read("node_modules/uplot/LICENSE")}*/\n${await read("node_modules/uplot/dist/uPlot.min.css")}`;
await writeFile(path.join(out, "style.css"), `${await read("src/palette.css")}\n${await read("style.css")}\n${await read("src/report/worksheet.css")}\n${plotStyle}`);
await writeFile(path.join(out, "index.html"), await read("index.html"));
await bundle("class.ts", "class.js", "class.html");
await writeFile(path.join(out, "class.html"), await read("class.html"));
await writeFile(path.join(out, "class.css"), `${await read("src/palette.css")}\n${await read("class.css")}`);

// A report is one file: template, style and script. The marks of title and data stay for the program.
const report = await bundle("report/main.ts", "report.js", "report.html");
const parts = {
  STYLE: `${await read("src/report/style.css")}\n${await read("src/report/exam.css")}\n${await read("src/report/worksheet.css")}\n${await read("src/report/paper.css")}`,
  FIGURE_STYLE: await read("src/report/figure.css"),
  SCRIPT: `${await readFile(path.join(out, "report.js"), "utf8")}\n${await licences(report.metafile.inputs)}`,
};
if (/<\/script|<!--/i.test(parts.SCRIPT)) throw new Error("report.js holds what would end its script element");
const template = (await read("report.html")).replace(/@SONDE_(STYLE|FIGURE_STYLE|SCRIPT)@/g, (_all, name) => parts[name]);
for (const mark of ["@SONDE_TITLE@", "@SONDE_DATA@"])
  if (template.split(mark).length !== 2) throw new Error(`report.html must hold ${mark} once`);
await writeFile(path.join(out, "report.html"), template);

// What a learning management system opens is one file too.
await bundle("scorm.ts", "scorm.js", "scorm.html");
const inside = { STYLE: `${await read("src/palette.css")}\n${await read("class.css")}`, SCRIPT: await readFile(path.join(out, "scorm.js"), "utf8") };
if (/<\/script|<!--/i.test(inside.SCRIPT)) throw new Error("scorm.js holds what would end its script element");
await writeFile(path.join(out, "scorm.html"), (await read("scorm.html")).replace(/@SONDE_(STYLE|SCRIPT)@/g, (_all, name) => inside[name]));

for (const name of ["index.html", "style.css", "app.js", "class.html", "class.css", "class.js", "report.html"]) {
  const file = path.join(out, name);
  await writeFile(`${file}.gz`, gzipSync(await readFile(file), { level: 9 }));
}
