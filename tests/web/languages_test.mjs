// An exam in German and in French, with the real program: the start, the exam, its worksheet, its result and its report
// say nothing in English, and no button is too narrow for its words. The browser's own language is German; the French
// page is chosen by hand. Usage: languages_test.mjs SONDE WEB_DIR SOURCE_DIR OUT_DIR
import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { addressOf, browserPath, goTo, openBrowser, PATIENCE_MS, picture, ready, singleExams, turnAcross, turnPatient } from "./drive.mjs";
import { FEW_IMAGES, startRun } from "./program.mjs";

const [sonde, web, source, out] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const require = createRequire(join(web, "package.json"));
const { chromium } = require("playwright-core");
const { buildSync } = require("esbuild");
mkdirSync(out, { recursive: true });
const home = mkdtempSync(join(tmpdir(), "sonde-languages-"));
const check = (condition, what) => {
  assert.ok(condition, what);
  console.log(`ok ${what}`);
};

async function table(name, member) {
  const built = buildSync({ entryPoints: [join(source, "web", "src", "words", `${name}.ts`)], bundle: true, format: "esm", write: false });
  return (await import(`data:text/javascript;base64,${Buffer.from(built.outputFiles[0].contents).toString("base64")}`))[member];
}
const tables = { en: await table("en", "en"), de: await table("de", "de"), fr: await table("fr", "fr") };
const told = { de: await table("told_de", "toldDe"), fr: await table("told_fr", "toldFr") };

/** The first place of a protocol that ships, so that its words are those that learners see. */
const shipped = readFileSync(join(source, "data/protocols/two_point.yaml"), "utf8");
mkdirSync(join(home, "protocols"));
writeFileSync(join(home, "protocols", "two_point.yaml"), shipped.slice(0, shipped.indexOf("- title: Where the saphenous")));

/** What the page shows or says to a screen reader: texts and names; and buttons that are too narrow. */
const seen = (page) => page.evaluate(() => {
  const texts = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let n = walker.nextNode(); n; n = walker.nextNode()) if (n.parentElement.checkVisibility() && !n.parentElement.closest("script, style, #language")) texts.push(n.textContent.trim());
  for (const e of document.querySelectorAll("[title], [aria-label], [placeholder]")) if (e.checkVisibility()) texts.push(...["title", "aria-label", "placeholder"].map((a) => e.getAttribute(a) ?? ""));
  const narrow = [...document.querySelectorAll("button, select, .chips button")].filter((b) => b.checkVisibility() && b.scrollWidth > b.clientWidth + 1).map((b) => `${b.id} "${b.textContent}"`);
  return { texts: texts.filter((t) => /[A-Za-z]{2,}/.test(t)), narrow, lang: document.documentElement.lang, untold: window.sonde?.untold ?? [] };
});

/** Whether a text is English: that of a table, whatever stands in its places. */
function englishOf(language) {
  const pattern = (text) => new RegExp(`^${text.replace(/[.*+?^$()|[\]\\]/g, "\\$&").replace(/\{\w\}/g, "[\\d.,]+").replace(/\{\w+\}/g, ".+")}$`);
  const own = Object.entries(tables.en).filter(([key, text]) => tables[language][key] !== text && /[a-z]{2,}/.test(text.replace(/\{\w+\}/g, ""))).map(([, text]) => text);
  const others = new Set([...Object.values(tables[language]), ...Object.values(told[language])]); // "Position" is French too
  const all = [...own, ...Object.keys(told[language]).filter((text) => told[language][text] !== text)].filter((text) => !others.has(text) && /[a-z]{3,}/.test(text.replace(/\{\w+\}/g, "")));
  const exact = new Set(all.filter((text) => !text.includes("{")));
  const forms = all.filter((text) => text.includes("{")).map(pattern);
  const mine = [...others].filter((text) => text.includes("{")).map(pattern);
  return (text) => exact.has(text) || (forms.some((f) => f.test(text)) && !mine.some((f) => f.test(text)) && !others.has(text));
}
const english = { de: englishOf("de"), fr: englishOf("fr") };

async function speaks(page, language, where) {
  const { texts, narrow, lang, untold } = await seen(page);
  check(lang === language, `${where}: the document is in ${language}`);
  const left = [...new Set(texts.filter(english[language]))];
  check(left.length === 0, `${where}: nothing is English ${left.slice(0, 8).join(" | ")}`);
  check(untold.filter((text) => !/^Lea$/.test(text)).length === 0, `${where}: the program says nothing that is not translated ${untold.join(" | ")}`);
  check(narrow.length === 0, `${where}: every button has room for its words ${narrow.join(" | ")}`);
  await picture(page, join(out, `languages_${language}_${where}.png`));
}

const program = await startRun(sonde, ["--port", "0", "--exams", join(home, "exams"), "--protocols", join(home, "protocols"), ...FEW_IMAGES]);
const browser = await openBrowser(chromium);
const context = await browser.newContext({ locale: "de-AT", viewport: { width: 1280, height: 760 }, acceptDownloads: true });
const page = await context.newPage();
page.setDefaultTimeout(PATIENCE_MS);
const errors = [];
page.on("pageerror", (e) => errors.push(String(e)));
const until = (condition, argument) => page.waitForFunction(condition, argument);
const inLanguage = async (name) => {
  await page.goto(addressOf(program.learner, `?quality=low&lang=${name}`));
  await ready(page);
};

// ---- the start: the course and the cases

await page.goto(addressOf(program.learner, "?quality=low"));
await ready(page);
await page.locator("#start[open]").waitFor();
await speaks(page, "de", "course");
await singleExams(page);
await speaks(page, "de", "cases");
check((await page.locator("#start").textContent()).includes(told.de["Woman, 29 years. Sore right thigh for three days after a long run. No swelling, no fever, no journey, no operation. Takes the pill."]), "the story of a case is in German");
await Promise.all([page.waitForEvent("load"), page.locator("#language").selectOption("fr")]);
await ready(page);
await page.locator("#start[open]").waitFor();
await singleExams(page);
await speaks(page, "fr", "cases");
await page.goto(addressOf(program.learner, "?quality=low"));
await ready(page);
check((await page.evaluate(() => document.documentElement.lang)) === "fr", "the choice is kept");

// ---- an exam

await singleExams(page);
await page.locator("#trainee").fill("Lea");
await page.locator("input[name=guidance][value=full]").check();
await page.locator("#start-go").click();
await until(() => window.sonde.exam?.phase === "running" && window.sonde.exam.elapsed_s > 0);
await turnPatient(page);
await goTo(page);
await turnAcross(page);
await speaks(page, "fr", "exam");
check((await page.locator("#step-text").textContent()).length > 0 && (await page.locator("#segments .name").first().textContent()) === told.fr["Common femoral vein"], "the segments are named in French");
await inLanguage("de");
await until(() => window.sonde.exam?.phase === "running");
const before = await page.evaluate(() => window.sonde.exam.presses.length);
for (let depth = 5; depth <= 45; depth += 1.5) {
  await page.evaluate((d) => window.sonde.setDepth(d), depth);
  const at = await page.evaluate(() => window.sonde.snapshot.tick);
  await until((t) => window.sonde.snapshot.tick > t + 600, at);
  if (await page.evaluate(() => ["complete", "open", "too_hard"].includes(window.sonde.exam.compression?.state))) break;
}
await speaks(page, "de", "pressed");
check(/^\d+,\d$/.test(await page.locator("#force-value").evaluate((e) => e.firstChild.textContent)), "the force has a decimal comma");
await page.locator("#store-picture").click();
await page.evaluate(() => window.sonde.setDepth(-8));
await until((n) => window.sonde.exam.presses.length > n, before);
await page.locator(".finding.compressible").click();
await page.locator("#sheet-button").click();
await speaks(page, "de", "worksheet");
await page.getByRole("button", { name: tables.de["sheet.read"] }).click();
await page.locator("#sheet[open] .sheet-pair").waitFor();
await speaks(page, "de", "sheet");
const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: tables.de["sheet.json"] }).click()]);
const saved = JSON.parse(readFileSync(await download.path(), "utf8"));
check(saved.protocol === "Two regions" && saved.places[0].title === "Common femoral vein", "the worksheet's file is in English, as programs expect it");
await page.getByRole("button", { name: tables.de["page.close"], exact: true }).last().click();

// ---- the result and the report

await page.locator("#finish-button").click();
await page.locator("#finish[open]").waitFor();
await speaks(page, "de", "finish");
await page.getByRole("button", { name: tables.de["exam.finish"] }).click();
await page.locator("#result[open]").waitFor();
await speaks(page, "de", "result");
const report = await page.locator("#result a.primary").getAttribute("href");
// No images come while a result is looked at.
await page.goto(addressOf(program.learner, "?quality=low&lang=fr"));
await page.locator("#result[open]").waitFor();
await speaks(page, "fr", "result");
for (const language of ["de", "fr"]) {
  const paper = await context.newPage();
  await paper.goto(new URL(report, program.learner.origin).href.replace(/lang=\w+/, `lang=${language}`));
  await paper.locator("#measures").waitFor();
  await speaks(paper, language, "report");
  await paper.close();
}
check(errors.length === 0, `no errors ${errors.join("; ")}`);
await browser.close();
program.interrupt();
await program.ended;
rmSync(home, { recursive: true });
process.exit(0);
