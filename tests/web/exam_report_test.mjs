// The report of an exam in a browser, opened from disk: nothing is loaded, nothing fails, what stands in the page
// is what its JSON says, foreign texts stay texts, and it fits window, telephone and paper.
// Usage: exam_report_test.mjs TEST_TRAINER_REPORT WEB_DIR OUT_DIR
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { PATIENCE_MS, browserPath, openBrowser, picture } from "./drive.mjs";
import { contrastFaults } from "./inspect.mjs";

const [writer, web, out] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
const examples = join(out, "exam_reports");
mkdirSync(examples, { recursive: true });
execFileSync(writer, [examples]);
const check = (condition, what) => {
  assert.ok(condition, what);
  console.log(`ok ${what}`);
};
const close = (shown, value, decimals, what) => assert.ok(Math.abs(Number(shown.replace("\u2212", "-")) - value) <= 0.5 * 10 ** -decimals + 1e-9, `${what}: ${shown} shows ${value}`);
const NASTY = "<b>&\"'\u0001\ufffd</script><script>alert(1)</script>";

const browser = await openBrowser(chromium);

// Everything that the page shows, read in the page.
const readPage = () => {
  const texts = (at, within = document) => [...within.querySelectorAll(at)].map((e) => e.textContent);
  const cells = (at) => [...document.querySelectorAll(`${at} tbody tr`)].map((row) => texts("td", row));
  return {
    data: JSON.parse(document.getElementById("report").textContent),
    title: document.querySelector("h1").textContent,
    tag: document.querySelector(".tag").textContent,
    dial: texts(".dial text"),
    text: document.body.innerText,
    advice: texts("#advice li"),
    parts: cells("#score"),
    segments: cells("#vein"),
    presses: cells("#presses"),
    earlier: cells("#earlier"),
    measures: Object.fromEntries(cells("#measures").map((row) => row)),
    comments: cells("#comments"),
    marks: document.querySelectorAll("#figure-vein a").length,
    bold: document.querySelectorAll("h1 b, p.text b").length,
    images: [...document.images].map((image) => image.naturalWidth),
    sections: [...document.querySelectorAll("section")].map((e) => e.id),
    wide: document.documentElement.scrollWidth > innerWidth,
  };
};

function figuresAgree(name, shown) {
  const { data, presses, parts } = shown;
  close(shown.dial[0], data.score.score, 0, `${name}: score`);
  check(shown.tag === (data.score.passed ? "Passed" : "Not passed"), `${name}: the tag says the result`);
  check(presses.length === data.presses.length && data.presses.every((p, i) => Number(presses[i][0]) === i + 1), `${name}: every press once`);
  data.presses.forEach((p, i) => {
    close(presses[i][1], p.start_s, 1, `${name}: time of press ${i + 1}`);
    close(presses[i][4], p.force_peak_n, 1, `${name}: force of press ${i + 1}`);
    if (p.vein !== null) close(presses[i][5], 100 * p.vein, 0, `${name}: vein in press ${i + 1}`);
    if (p.along_mm !== null) close(/([\d.]+) cm$/.exec(presses[i][2])[1], p.along_mm / 10, 1, `${name}: place of press ${i + 1}`);
  });
  data.parts.forEach((p, i) => {
    close(parts[i][2].split(" ")[0], p.points, 1, `${name}: points of ${p.title}`);
    assert.ok(parts[i][1].includes(p.lost), `${name}: where points of ${p.title} went`);
  });
  check(shown.segments.length === data.segments.length && data.segments.every((v, i) => shown.segments[i][4] === `${v.places_done} of ${v.places}`), `${name}: segment by segment`);
  check(data.segments.every((v, i) => shown.segments[i][3].startsWith(v.correct ? "\u2713" : "\u2717")), `${name}: verdicts`);
  close(shown.measures["Greatest force"].split(" ")[0], data.metrics.force_peak_n, 1, `${name}: greatest force`);
  close(shown.measures["Coverage"].split(" ")[0], 100 * data.metrics.coverage, 0, `${name}: coverage`);
  close(shown.measures["Longest gap"].split(" ")[0], data.metrics.largest_gap_mm / 10, 1, `${name}: longest gap`);
  check(shown.marks === data.presses.filter((p) => p.along_mm !== null && p.along_mm <= data.vein.length_mm).length, `${name}: a mark for each press in view`);
  const pictures = data.pictures.flatMap((p) => [p.before, p.peak]).filter(Boolean).length;
  check(shown.images.length === pictures && shown.images.every((width) => width > 0), `${name}: ${pictures} images are decoded`);
  check(data.exams.length < 2 || shown.earlier.length === Math.min(9, data.exams.length), `${name}: earlier exams`);
}

async function testExample(name) {
  const page = await browser.newPage({ viewport: { width: 1100, height: 900 } });
  page.setDefaultTimeout(PATIENCE_MS);
  const [told, asked] = [[], []];
  page.on("console", (m) => told.push(m.text()));
  page.on("pageerror", (e) => told.push(String(e)));
  page.on("dialog", (d) => told.push(`dialog: ${d.message()}`));
  page.on("request", (r) => asked.push(r.url()));
  await page.goto(`file://${examples}/${name}.html`);
  const shown = await page.evaluate(readPage);
  check(told.length === 0, `${name}: nothing fails ${told.join(" ")}`);
  check(asked.filter((url) => !url.startsWith("data:")).length === 1, `${name}: nothing is loaded`);
  figuresAgree(name, shown);
  const faults = (await page.evaluate(contrastFaults)).filter((f) => !f.includes('"CLOT"')); // white on the clot's dark red
  check(faults.length === 0, `${name}: text stands out ${faults.slice(0, 3).join("; ")}`);
  await picture(page, join(out, `exam_report_${name}.png`), { fullPage: true });
  const wide = () => page.evaluate(() => document.documentElement.scrollWidth > innerWidth);
  check(!shown.wide, `${name}: fits the window`);
  await page.setViewportSize({ width: 390, height: 800 });
  check(!(await wide()), `${name}: fits a telephone`);
  await page.setViewportSize({ width: 720, height: 1000 });
  await page.emulateMedia({ media: "print" });
  check(!(await wide()), `${name}: fits paper`);
  await page.close();
  return shown;
}

const passed = await testExample("passed");
check(passed.advice.some((s) => s.includes("the clot was found")) && !passed.text.includes("a clot was missed") && !passed.text.includes("never passed"), "what went well is said");
check(!passed.sections.includes("comments"), "without comments there is no place for them");
const missed = await testExample("missed");
check(missed.advice.some((s) => s.includes("a clot was missed; your answer was \u201ccompressible\u201d")), "a missed clot is said");
check(missed.advice.some((s) => s.includes("left undecided")) && missed.advice.some((s) => s.includes("29 cm below the groin")), "what is left is said");
check(missed.text.includes("never passed") && missed.text.includes("22 November 2026, 04:40 UTC"), "the cap and the date are said");
await testExample("many");
const nothing = await testExample("nothing");
check(nothing.text.includes("first exam in your log") && nothing.text.includes("interrupted before its end") && nothing.advice.some((s) => s.startsWith("No compression")), "an exam without a press says so");
check(!nothing.sections.includes("pictures") && !nothing.sections.includes("presses"), "and leaves out what it has not");
const hostile = await testExample("hostile");
check(hostile.title === NASTY && hostile.bold === 0 && hostile.comments[0][1].startsWith("<b>&"), "foreign texts stay texts");
check(/no image/.test(hostile.text), "a missing image is said");
await browser.close();
