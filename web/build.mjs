// Bundles the page into dist/ (or the directory given as the first argument): index.html, style.css
// and app.js, and each of them as .gz for embedding. The licences of three.js and uPlot stay at the
// end of app.js.
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { gzipSync } from "node:zlib";
import path from "node:path";

const here = import.meta.dirname ?? path.dirname(new URL(import.meta.url).pathname);
const out = path.resolve(process.argv[2] ?? process.env.SONDE_WEB_OUT ?? path.join(here, "dist"));
await mkdir(out, { recursive: true });

await build({
  entryPoints: [path.join(here, "src/main.ts")],
  outfile: path.join(out, "app.js"),
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2020",
  legalComments: "eof",
  logLevel: "warning",
});

const plotStyle = await readFile(path.join(here, "node_modules/uplot/dist/uPlot.min.css"), "utf8");
const licence = await readFile(path.join(here, "node_modules/uplot/LICENSE"), "utf8");
const style = await readFile(path.join(here, "style.css"), "utf8");
await writeFile(path.join(out, "style.css"), `${style}\n/*! uPlot\n${licence}*/\n${plotStyle}`);
await writeFile(path.join(out, "index.html"), await readFile(path.join(here, "index.html")));

// One licence text per bundled library, whatever the minifier kept of the comments.
const script = path.join(out, "app.js");
const three = await readFile(path.join(here, "node_modules/three/LICENSE"), "utf8");
await writeFile(script, `${await readFile(script, "utf8")}\n/*! three.js\n${three}*/\n/*! uPlot\n${licence}*/\n`);

for (const name of ["index.html", "style.css", "app.js"]) {
  const file = path.join(out, name);
  await writeFile(`${file}.gz`, gzipSync(await readFile(file), { level: 9 }));
}
