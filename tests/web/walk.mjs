// The first guided exam as a newcomer does it, with the real program: only what the page says is
// done, by mouse. Takes a picture of every step. Usage: node walk.mjs SONDE WEB_DIR OUT_DIR [WxH]
import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { addressOf, openBrowser, PATIENCE_MS, ready, turnAcross, turnPatient, singleExams } from "./drive.mjs";
import { startRun } from "./program.mjs";

const [sonde, web, out] = process.argv.slice(2, 5).map((p) => resolve(p));
const [width, height] = (process.argv[5] ?? "1280x800").split("x").map(Number);
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
mkdirSync(out, { recursive: true });
const exams = mkdtempSync(join(tmpdir(), "sonde-walk-"));
const program = await startRun(sonde, ["--port", "0", "--exams", exams]);
const browser = await openBrowser(chromium);
const page = await browser.newPage({ viewport: { width, height } });
page.setDefaultTimeout(PATIENCE_MS);
const started = Date.now();
await page.goto(addressOf(program.learner));
await ready(page);
console.log(`first images after ${Date.now() - started} ms`);

let count = 0;
async function shot(name) {
  const file = join(out, `${width}_${String(++count).padStart(2, "0")}_${name}.png`);
  await page.screenshot({ path: file });
  const words = await page.evaluate(() => ["#step-text", "#step-detail", "#coach-text", "#compression", "#force-word"].map((s) => {
    const e = document.querySelector(s);
    return e.checkVisibility() ? e.textContent : "";
  }));
  console.log(`${name}: ${words.join(" | ")}`);
}
const step = () => page.evaluate(() => window.sonde.exam.step);
const pause = (ms) => page.waitForTimeout(ms);

/** Drags the probe into the ring. */
async function intoRing() {
  for (let i = 0; i < 5; ++i) {
    const s = await step();
    if (!s.target || (s.offset_mm !== null && s.offset_mm <= s.target.radius_mm)) return;
    const at = await page.evaluate(() => window.sonde.targetOnScreen());
    const box = await page.locator("#scene").boundingBox();
    await page.mouse.click(box.x + at[0], box.y + at[1]);
    await pause(1500);
  }
}

/** Pulls the slider up little by little until the page says something else than to press on. */
async function pressSlowly(name) {
  const box = await page.locator("#depth-slider").boundingBox();
  const y = (mm) => box.y + 16 + (box.height - 32) * (1 - (mm + 20) / 65);
  const from = await page.evaluate(() => window.sonde.depth);
  await page.mouse.move(box.x + box.width / 2, y(from));
  await page.mouse.down();
  let mm = Math.max(from, 0);
  for (; mm < 45; mm += 1.5) {
    await page.mouse.move(box.x + box.width / 2, y(mm), { steps: 2 });
    await pause(450);
    const state = await page.evaluate(() => window.sonde.exam.compression?.state);
    if (["complete", "open", "too_hard", "off_axis"].includes(state)) break;
    if (Math.round(mm) === 14) await shot(`${name}_half`);
  }
  await pause(500);
  await shot(`${name}_pressed`);
  await page.mouse.up();
  await page.locator("#ease").click();
  await pause(1500);
}

await shot("start");
await singleExams(page);
await page.locator("#start-go").click();
await page.waitForFunction(() => ["preparing", "running"].includes(window.sonde.exam?.phase)); // a quick one is not seen to prepare
await shot("started");
await page.waitForFunction(() => window.sonde.exam?.phase === "running" && window.sonde.exam.step.target);
await pause(1500);
await shot("running");
for (let i = 0; i < 6; ++i) {
  await turnPatient(page);
  const s = await step();
  if (!s.target && !s.segment) break;
  if (s.target) {
    await intoRing();
    await turnAcross(page);
    await shot(`place${i}_there`);
    const before = await page.evaluate(() => window.sonde.exam.presses.length);
    await pressSlowly(`place${i}`);
    await page.waitForFunction((n) => window.sonde.exam.presses.length > n, before).catch(() => null);
    await pause(600);
  }
  await shot(`place${i}_let_go`);
  const asked = await step();
  if (!asked.segment) continue;
  const open = await page.evaluate((id) => window.sonde.exam.presses.some((p) => p.segment === id && p.result === "open"), asked.segment);
  await page.locator(open ? ".finding.clot" : ".finding.compressible").click();
  await pause(900);
  await shot(`place${i}_decided`);
}
await page.locator("#finish-button").click();
await pause(400);
await shot("finish");
await page.getByRole("button", { name: "Finish and see the result" }).click();
await page.waitForFunction(() => window.sonde.exam.result);
await pause(800);
await shot("result");
await page.getByRole("button", { name: "Watch the replay" }).click();
await page.waitForFunction(() => window.sonde.exam.phase === "replay" && window.sonde.replay);
await page.locator("#scrub").evaluate((e) => {
  e.value = String(Number(e.max) * 0.6);
  e.dispatchEvent(new Event("input"));
  e.dispatchEvent(new Event("change"));
});
await pause(2500);
await shot("replay");
await page.getByRole("button", { name: "Close replay" }).click();
await page.waitForFunction(() => window.sonde.exam.phase === "practice");
await pause(1500);
await shot("practice");
await browser.close();
program.interrupt();
await program.ended;
if (process.argv[6]) console.log(exams);
else rmSync(exams, { recursive: true });
process.exit(0);
