// Leaves out of a bundle the texts that it never shows: a plugin for esbuild that puts in the place of each table of
// src/words only the keys that the bundle's own code names, and of what the program says only what it translates.
import { build } from "esbuild";
import path from "node:path";

const TABLE = /[\\/]words[\\/](en|de|fr|told_de|told_fr)\.ts$/;
const TOLD = { told_de: "toldDe", told_fr: "toldFr" };
const member = (name) => TOLD[name] ?? name;

/** Tables with what `keep` says, as modules. */
const tables = (keep) => ({
  name: "words-used",
  setup(made) {
    made.onLoad({ filter: TABLE }, async ({ path: file }) => {
      const name = TABLE.exec(file)[1];
      return { contents: `export const ${member(name)} = ${JSON.stringify(await keep(file, name))};`, loader: "js" };
    });
  },
});

async function load(file, name) {
  const { outputFiles } = await build({ entryPoints: [file], bundle: true, format: "esm", write: false });
  return (await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].text).toString("base64")}`))[member(name)];
}

/** Whether a key is named in the code: as it is, as what `counted` makes of it, or by a template with places for parts of it. */
function namedIn(code) {
  const whole = new Set([...code.matchAll(/"([\w.]+)"/g)].map((m) => m[1]));
  const templates = [...code.matchAll(/`([a-z]\w*\.[^`]*)`/g)].map((m) => m[1].split(/\$\{[^}]*\}/).map((part) => part.replace(/[.*+?^$()|[\]{}\\]/g, "\\$&")).join("[\\w.]+"));
  const pattern = new RegExp(`^(${templates.join("|") || "(?!)"})(\\.(one|other))?$`);
  return (key) => whole.has(key) || whole.has(key.replace(/\.(one|other)$/, "")) || pattern.test(key);
}

/**
 * The plugin for the bundle of an entry. @param settings that decide what the bundle leaves out
 * @param page the document, whose elements name keys too (data-t)
 */
export async function wordsUsed(entry, settings, page = "") {
  const bare = await build({ ...settings, entryPoints: [entry], minify: false, metafile: false, write: false, outfile: path.join("dist", "bare.js"), plugins: [tables(() => ({}))] });
  const code = bare.outputFiles[0].text;
  const named = namedIn(`${code}\n${[...page.matchAll(/data-t(?:-\w+)?=("[^"]*")/g)].map((m) => m[1]).join("\n")}`);
  const translates = /function told\(/.test(code);
  return tables(async (file, name) => {
    if (name in TOLD && !translates) return {};
    const all = await load(file, name);
    return name in TOLD ? all : Object.fromEntries(Object.entries(all).filter(([key]) => named(key)));
  });
}
