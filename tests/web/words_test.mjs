// The texts of page and reports without a browser: every language has what the others have, with the same places;
// the page shows nothing that does not stand in the tables; what the program and its data say is translated.
// Usage: node words_test.mjs WEB_DIR SOURCE_DIR
import { readdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, relative, resolve } from "node:path";
import { spoken } from "./spoken.mjs";

const [web, source] = process.argv.slice(2, 4).map((p) => resolve(p));
const require = createRequire(join(web, "package.json"));
const ts = require("typescript");
const { buildSync } = require("esbuild");
const src = join(source, "web", "src");
const faults = [];
const complain = (sentence) => faults.push(sentence);

// ---- tables

async function table(name, member) {
  const built = buildSync({ entryPoints: [join(src, "words", `${name}.ts`)], bundle: true, format: "esm", write: false });
  return (await import(`data:text/javascript;base64,${Buffer.from(built.outputFiles[0].contents).toString("base64")}`))[member];
}
const en = await table("en", "en");
const others = { de: await table("de", "de"), fr: await table("fr", "fr") };
const told = { de: await table("told_de", "toldDe"), fr: await table("told_fr", "toldFr") };
const places = (text) => [...text.matchAll(/\{(\w+)\}/g)].map((m) => m[1]).sort().join();

/** Words that are the same in both languages, keys of the keyboard, signs, units. */
const SAME = /^[^A-Za-z]*$|^(\{\w+\}|[^A-Za-z{}]|\b(mm|cm|s|ms|N|ml|dB|Hz|MHz|min|TGC|C|F|M|O|B|P|V|Z|J|K|L|N|U|I|Esc|Q|E|T|G|Y|H|A|D|W|S|R)\b)*$/;
const ALIKE = {
  de: /^(page\.(power|stop|patient|gel_put|doppler)|film\.pause|gel\.ml|name\.linear|course\.patient|gate\.filter|sheet\.(reflux|patient|side\.l|side\.r)|sheet\.reflux\.present|sheet\.score_of|report\.(minutes)|exam\.said|editor\.part\.text)$/,
  fr: /^(page\.(distance|measure_distance|patient|probe|position|gel_put|force|doppler)|film\.pause|gel\.ml|slider\.gain|sheet\.(reflux|note|impression|conclusion|patient|head\.compression)|sheet\.reflux\.present|course\.(patient|questions)|finding\.compressible|sheet\.finding\.compressible|duplex\.gain|duplex\.steer|gate\.(angle|base|gain|beam)|spectrum\.angle|result\.(compressions|segment|points)|history\.(date)|report\.(date|minutes|verdict|decision\.compressible|draw\.(force|minutes))|sheet\.(question|date)|exam\.said|name\.(healthy)|tissue\.friction|report\.force_n|force\.newtons|course\.points|caliper\.second|class\.(force|score|discrimination|date))$/,
};
for (const [language, words] of Object.entries(others)) {
  for (const [key, text] of Object.entries(en)) {
    if (places(text) !== places(words[key] ?? "")) complain(`words/${language}.ts: "${key}" has the places {${places(words[key] ?? "")}}, expected {${places(text)}} as in English`);
    if (words[key] === text && !SAME.test(text) && !ALIKE[language].test(key)) complain(`words/${language}.ts: "${key}" is the English text; translate it, or name it in ALIKE of words_test.mjs`);
    if (!words[key]?.trim()) complain(`words/${language}.ts: "${key}" is empty`);
  }
}
for (const [language, words] of Object.entries(told))
  for (const [from, to] of Object.entries(words)) {
    if (places(from) !== places(to)) complain(`words/told_${language}.ts: "${from}" has the places {${places(to)}}, expected {${places(from)}}`);
    if (!to.trim()) complain(`words/told_${language}.ts: "${from}" is empty`);
  }

// ---- keys that are used, and texts outside of the tables

/** Reports for those who develop and measure: in English. */
const TECHNICAL = /report\/(fit\w*|scene|paper|plain|mesh|chart|axis|table|colour|dom)\.ts$/;
const HUMAN = /[A-Za-z]{2,}[,.:;]? [a-z]{2,}|^[A-Z][a-z]{2,}|[a-z]{2,}[.!?]$/;
const CALLS_WITHOUT_WORDS = new Set(["find", "querySelector", "querySelectorAll", "closest", "addEventListener", "removeEventListener", "getContext", "getAttribute", "removeAttribute", "hasAttribute",
  "remember", "recall", "fetch", "Error", "add", "remove", "toggle", "contains", "startsWith", "getObjectByName", "setProperty", "test", "matches", "createElement", "createElementNS", "press", "has", "get", "Event", "KeyboardEvent"]);
const MEMBERS_WITHOUT_WORDS = new Set(["class", "className", "d", "viewBox", "font", "style", "transform", "type", "id", "key", "code", "headers", "accept", "role", "points", "powerPreference", "stroke", "fill", "kind", "rel", "cache", "Authorization"]);
/** Of the pieces of a drawing's style, of keys, of the console. */
const NOT_SHOWN = /system-ui|^(\(prefers|MetaImage$|PLUS|first image|sonde\.|course\.|primary big|middle light small|sonde replay|linear-gradient|float facing|rgb|data:|blob:|url|M\$|#|\.|\[)|^(Arrow|Key|Digit|Enter|Escape|Backspace|Delete|Space|Semicolon|Quote|Minus|Equal|Backslash|Comma|Period|Bracket|Page|Home|End|Shift|Control|Bearer )/;

/** Units, abbreviations of the scanner and names that are the same everywhere. */
const UNITS = /^([^A-Za-z]|\b(mm|cm|s|ml|dB|Hz|MHz|min|TGC|N|UTC)\b)*$/;

function shownOutside(file) {
  const name = relative(src, file);
  const tree = ts.createSourceFile(name, readFileSync(file, "utf8"), ts.ScriptTarget.ES2020, true);
  const used = [];
  const wordless = (node) => {
    for (let at = node, up = node.parent; up; at = up, up = up.parent) {
      if (ts.isImportDeclaration(up) || ts.isTypeNode(up) || ts.isCaseClause(up) || ts.isThrowStatement(up) || ts.isElementAccessExpression(up)) return true;
      if (ts.isBinaryExpression(up) && /^(===|!==)$/.test(up.operatorToken.getText())) return true;
      if (ts.isBinaryExpression(up) && up.operatorToken.getText() === "=" && ts.isPropertyAccessExpression(up.left) && MEMBERS_WITHOUT_WORDS.has(up.left.name.text)) return true;
      if (ts.isPropertyAssignment(up) && (up.name === at || MEMBERS_WITHOUT_WORDS.has(up.name.text))) return true;
      if (ts.isTaggedTemplateExpression(up)) return true;
      if (ts.isCallExpression(up) || ts.isNewExpression(up)) {
        const called = up.expression.name?.text ?? up.expression.text ?? "";
        if (CALLS_WITHOUT_WORDS.has(called)) return true;
        const place = up.arguments?.indexOf(at) ?? -1;
        if ((called === "make" || called === "draw") && place <= 1 && place >= 0) return called === "make" || !ts.isObjectLiteralExpression(at);
        if ((called === "setAttribute" || called === "h" || called === "s" || called === "section") && place === 0) return true;
        if ((called === "t" || called === "counted") && place === 0) return true;
      }
      if (ts.isStatement(up)) return false;
    }
    return false;
  };
  /** Where a text is certainly shown, however it looks. */
  const certain = (node) => {
    for (let at = node, up = node.parent; up && !ts.isStatement(up); at = up, up = up.parent) {
      if (ts.isBinaryExpression(up) && /^(===|!==)$/.test(up.operatorToken.getText())) return false;
      if (ts.isBinaryExpression(up) && up.operatorToken.getText() === "=") return ts.isPropertyAccessExpression(up.left) && /^(textContent|title|placeholder|innerHTML|innerText)$/.test(up.left.name.text) && up.right === at;
      if (ts.isPropertyAssignment(up)) return /^"?(aria-label|title|placeholder)"?$/.test(up.name.getText()) && up.initializer === at;
      if (!ts.isCallExpression(up)) continue;
      const called = up.expression.name?.text ?? up.expression.text ?? "";
      const place = up.arguments.indexOf(at);
      if (called === "make" || called === "draw") return place === 2;
      if (called === "h" || called === "s") return place >= 2;
      if (called === "button" || called === "announce" || called === "say") return place === 0;
      return called === "append" || called === "replaceChildren" || called === "fillText";
    }
    return false;
  };
  const visit = (node) => {
    const texts = ts.isStringLiteral(node) || ts.isNoSubstitutionTemplateLiteral(node) ? [node.text] : ts.isTemplateExpression(node) ? [node.head.text, ...node.templateSpans.map((s) => s.literal.text)] : [];
    for (const text of texts) if (/[A-Za-z]{2,}/.test(text) && (certain(node) ? !UNITS.test(text.trim()) : HUMAN.test(text.trim()) && !NOT_SHOWN.test(text) && !wordless(node))) {
      const { line } = tree.getLineAndCharacterOfPosition(node.getStart());
      complain(`web/src/${name}:${line + 1}: "${text.trim()}" is shown and stands in no table: add a key to words/en.ts, de.ts and fr.ts and write t("key"), see CONTRIBUTING.md, "Texts"`);
    }
    if (ts.isCallExpression(node) && /^(t|counted)$/.test(node.expression.getText()) && node.arguments[0]) used.push(node.arguments[0].getText());
    ts.forEachChild(node, visit);
  };
  visit(tree);
  return used;
}

const files = readdirSync(src, { recursive: true, withFileTypes: true }).filter((e) => e.isFile() && e.name.endsWith(".ts")).map((e) => join(e.parentPath ?? e.path, e.name));
const uses = files.filter((f) => !/\/words\//.test(f)).flatMap((f) => (TECHNICAL.test(f) ? [] : shownOutside(f)));

const page = readFileSync(join(source, "web", "index.html"), "utf8");
const inPage = [...page.matchAll(/data-t(?:-\w+)?="([^"]*)"/g)].map((m) => m[1]);
for (const key of inPage) if (!(key in en)) complain(`web/index.html: no table has the key "${key}"`);
const body = page.slice(page.indexOf("<body>")).replace(/<script[^]*?<\/script>/g, "");
for (const m of body.matchAll(/>([^<>]*[A-Za-z]{2,}[^<>]*)</g)) if (!/^(Sonde|0 mm|10 mm)$/.test(m[1].trim())) complain(`web/index.html: "${m[1].trim()}" stands in no table: give the element data-t="key"`);
for (const m of body.matchAll(/\s(title|aria-label|placeholder)="([^"]*[A-Za-z]{2,}[^"]*)"/g)) complain(`web/index.html: ${m[1]}="${m[2]}" stands in no table: write data-t-${m[1].replace("aria-", "")}="key"`);

// A key that nothing uses is a text that nobody sees.
const patterns = uses.flatMap((u) => [...u.matchAll(/"([\w.]+)"|`([^`]+)`/g)].map((m) => (m[1] ?? m[2]).replace(/[.]/g, "\\.").replace(/\$\{[^}]*\}/g, "\\w+")));
const all = new RegExp(`^(${[...patterns, ...inPage.map((k) => k.replace(/[.]/g, "\\.")), "name\\.\\w+"].join("|")})(\\.(one|other))?$`);
for (const key of Object.keys(en)) if (!all.test(key)) complain(`words/en.ts: nothing uses "${key}"`);

// ---- bundles: each has every text that its own code names, and what the program says only where it is translated

for (const script of ["app.js", "class.js", "report.js", "scorm.js"]) {
  const built = readFileSync(join(web, "dist", script), "utf8");
  const has = (key) => built.includes(`"${key}":`);
  const literal = [...built.matchAll(/["'`]([a-z]\w*(?:\.\w+)+)["'`](?!:)/g)].map((m) => m[1]);
  const begun = [...built.matchAll(/`([a-z]\w*\.[^`\s]*)`/g)].map((m) => new RegExp(`^${m[1].replace(/[.]/g, "\\.").replace(/\$\{[^}]*\}/g, "\\w+").replace(/[^\w.\\+]/g, "")}(\\.(one|other))?$`));
  const named = Object.keys(en).filter((key) => literal.includes(key) || literal.includes(key.replace(/\.(one|other)$/, "")) || begun.some((form) => form.test(key)));
  for (const key of named) if (!has(key)) complain(`${script}: names the text "${key}", which web/words_used.mjs left out`);
  if (named.length < 10) complain(`${script}: names ${named.length} texts only`);
  const idle = Object.keys(en).filter((key) => has(key) && !named.includes(key) && !/^(name|finding|press|role)\./.test(key));
  if (idle.length > 0.2 * Object.keys(en).length) complain(`${script}: holds ${idle.length} texts that it does not name, such as "${idle[0]}": is web/words_used.mjs asked?`);
  if (has("Common femoral vein") === (script === "scorm.js")) complain(`${script}: what the program says is ${script === "scorm.js" ? "in it, though nothing translates it" : "not in it"}`);
}

// ---- what the program says

const said = spoken(source);
for (const [text, where] of said) if (!(text in told.de)) complain(`${where}: "${text}" has no translation in words/told_de.ts and told_fr.ts`);
const known = new Set(said.map(([text]) => text));
for (const from of Object.keys(told.de)) if (!known.has(from)) complain(`words/told_de.ts: nothing in the program or its data says "${from}"`);

for (const fault of faults) console.log(fault);
console.log(`${Object.keys(en).length} texts of the page and ${Object.keys(told.de).length} of the program in ${1 + Object.keys(others).length} languages, ${faults.length} faults`);
process.exit(faults.length ? 1 : 0);
