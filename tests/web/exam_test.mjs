// A whole exam in the page with the real program behind it: guided by the ring, pressed, decided,
// finished, reported, replayed; then the program is killed in the middle of another one and started
// again. Usage: exam_test.mjs SONDE WEB_DIR OUT_DIR
import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { addressOf, browserPath, goTo, openBrowser, PATIENCE_MS, picture, ready, singleExams, turnAcross, turnPatient } from "./drive.mjs";
import { FEW_IMAGES, onePlace, startRun } from "./program.mjs";

const [sonde, web, out] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
mkdirSync(out, { recursive: true });
const exams = mkdtempSync(join(tmpdir(), "sonde-exams-"));
let checks = 0;
const check = (condition, what) => {
  assert.ok(condition, what);
  checks += 1;
  console.log(`ok ${what}`);
};

const start = (port, more = []) => startRun(sonde, ["--port", String(port), "--exams", exams, ...FEW_IMAGES, ...more]);

const state = (page) => page.evaluate(() => ({ exam: window.sonde.exam, replay: window.sonde.replay, snapshot: window.sonde.snapshot, sum: window.sonde.imageSum }));
const until = (page, condition, argument) => page.waitForFunction(condition, argument, { timeout: PATIENCE_MS });

async function begin(page, guidance) {
  const again = page.getByRole("button", { name: "Start an exam", exact: true });
  if (!(await page.locator("#start").isVisible())) await again.click();
  await singleExams(page);
  await page.locator("#trainee").fill("Test learner");
  await page.getByRole("radio", { name: guidance }).check();
  await page.locator("#start-go").click();
  await until(page, () => window.sonde.exam?.phase === "running");
  await until(page, () => window.sonde.snapshot?.tick > 0 && window.sonde.exam.elapsed_s > 0);
}

/** The probe is at the depth, or has been on its way for 3 s of the simulation; then 0.25 s of it more. */
async function held(page, depth) {
  const start = await page.evaluate(() => window.sonde.snapshot.tick);
  await until(page, ([d, t]) => window.sonde.snapshot.penetration_mm > d - 0.5 || window.sonde.snapshot.tick > t + 3000, [depth, start]);
  const there = await page.evaluate(() => window.sonde.snapshot.tick);
  await until(page, (t) => window.sonde.snapshot.tick > t + 250, there);
}

/** Presses deeper and deeper until the program calls it something, then lets go. */
async function press(page) {
  const before = (await state(page)).exam.presses.length;
  const named = () => ["complete", "open", "too_hard"].includes(window.sonde.exam.compression?.state);
  for (let depth = 5; depth <= 45; depth += 1.5) {
    await page.evaluate((d) => window.sonde.setDepth(d), depth);
    await held(page, depth);
    if (await page.evaluate(named)) break;
  }
  await page.evaluate(() => window.sonde.setDepth(-8));
  await until(page, (n) => window.sonde.exam.presses.length > n, before);
}

async function guidedExam(page) {
  const first = (await state(page)).exam;
  check(first.segments.some((s) => s.needed), "the exam names segments");
  check((await page.evaluate(() => window.sonde.controls.case)) === "", "the case's pathology is not told");
  for (let i = 0; i < 8; ++i) {
    await turnPatient(page);
    const { exam } = await state(page);
    if (exam.step.target === null) break;
    await goTo(page);
    await turnAcross(page);
    await press(page);
  }
  const { exam } = await state(page);
  await picture(page, join(out, "real_exam.png"));
  const [asked, shown] = [exam.segments.find((s) => s.id === exam.step.segment), await page.locator("#segments [aria-checked=true] .name").textContent()];
  check(asked?.id === exam.presses.at(-1).segment && shown === asked.title, `the finding asked for is that of the last press, and selected: ${shown}`);
  check(exam.segments.filter((s) => s.needed).every((s) => s.done === s.points), "every place of the protocol was examined");
  return exam;
}

/** Each segment is called what its presses showed. */
async function decide(page) {
  const { exam } = await state(page);
  for (const s of exam.segments.filter((one) => one.needed)) {
    const open = exam.presses.some((p) => p.segment === s.id && p.result === "open");
    await page.locator("#segments [role=radio]", { hasText: s.title }).click();
    await page.locator(open ? ".finding.clot" : ".finding.compressible").click();
    await until(page, (id) => window.sonde.exam.segments.find((one) => one.id === id).decision !== "", s.id);
  }
}

async function finish(page) {
  await page.locator("#finish-button").click();
  await page.getByRole("button", { name: "Finish and see the result" }).click();
  await until(page, () => window.sonde.exam.result);
  await page.waitForTimeout(500);
  await picture(page, join(out, "real_result.png"));
  return (await state(page)).exam;
}

async function readReport(browser, port, exam) {
  const page = await browser.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  const errors = [];
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  const answer = await page.goto(`http://127.0.0.1:${port}${exam.result.report}`);
  check(answer.status() === 200, "the report is served");
  const bare = await fetch(`http://127.0.0.1:${port}${exam.result.report.split("?")[0]}`);
  check(bare.status === 401, "but not without its key");
  await picture(page, join(out, "real_report.png"), { fullPage: true });
  check((await page.locator("img").count()) > 0, "the report shows the learner's own images");
  check(errors.length === 0, `the report has no console error ${errors.join(" ")}`);
  await page.close();
  const data = JSON.parse(readFileSync(join(exams, exam.exam, "exam.json")));
  check(data !== null && readdirSync(join(exams, exam.exam)).includes("exam.csv"), "the data is kept");
}

const hash = (page) => page.evaluate(() => window.sonde.imageSum);

async function replay(page, exam) {
  await page.getByRole("button", { name: "Watch the replay" }).click();
  await until(page, () => window.sonde.exam.phase === "replay" && window.sonde.replay?.duration_s > 0);
  const { replay: opened } = await state(page);
  check(opened.presses.length === exam.presses.length, "the replay marks the presses");
  const seek = async (share, within_s = 0.2) => {
    const frames = await page.evaluate(() => window.sonde.frames);
    await page.locator("#scrub").evaluate((e, at) => {
      e.value = String(Number(e.max) * at);
      e.dispatchEvent(new Event("input"));
      e.dispatchEvent(new Event("change"));
    }, share);
    await until(page, ([at, near]) => Math.abs(window.sonde.replay.time_s - at * window.sonde.replay.duration_s) < near, [share, within_s]);
    await until(page, (n) => window.sonde.frames > n, frames);
    // Another part of the exam has another model, which takes seconds: the image has come when it stays.
    for (let [last, same] = [-1, 0]; ; ) {
      const now = await hash(page);
      same = now === last ? same + 1 : 0;
      if (same === 4) return now;
      last = now;
      await page.waitForTimeout(500);
    }
  };
  const there = await seek(0.5);
  // On a busy machine an image can come after one that stayed: what is to be seen is waited for.
  const other = (sum) => window.sonde.imageSum !== sum, same = (sum) => window.sonde.imageSum === sum;
  await seek(0.2);
  await until(page, other, there);
  check(true, "another moment shows another image");
  await seek(0.5);
  await until(page, same, there);
  check(true, "the same moment shows the same image again");
  // Earlier than the first image of the recording, which comes when the machine has made it: that one is shown.
  await seek(0, 0.15 * opened.duration_s);
  await until(page, other, there);
  check(true, "a replay that is moved before its first image shows it");
  await picture(page, join(out, "real_replay.png"));
  await page.locator("#replay-leave").click();
  await until(page, () => window.sonde.exam.phase === "practice");
}

async function killed(browser, port) {
  const place = onePlace(); // what is killed is an exam, however many places it has
  const running = await start(port, place);
  const page = await browser.newPage({ viewport: { width: 1024, height: 700 } });
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(addressOf(running.learner, "?quality=low"));
  await ready(page);
  await begin(page, /^None/);
  await page.evaluate(() => window.sonde.setDepth(10));
  await page.waitForTimeout(2500);
  running.child.kill("SIGKILL");
  const again = await start(port, place);
  await until(page, () => window.sonde.connected && window.sonde.exam?.phase === "practice");
  check(again.learner.token === running.learner.token, "the token outlives the program, and the page finds it again");
  const file = statSync(join(exams, "page.token"));
  check((file.mode & 0o777) === 0o600, "only its owner can read the file with the token");
  const kept = readdirSync(exams, { withFileTypes: true }).filter((e) => e.isDirectory()).map((e) => readdirSync(join(exams, e.name)));
  check(kept.some((files) => files.includes("exam.rec") && !files.includes("exam.json")), "the killed exam's recording is kept");
  await page.close();
  return again;
}

async function main() {
  let running = await start(0);
  const browser = await openBrowser(chromium);
  const page = await browser.newPage({ viewport: { width: 1024, height: 700 } });
  page.setDefaultTimeout(PATIENCE_MS);
  const errors = [];
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  page.on("pageerror", (e) => errors.push(String(e)));
  await page.goto(addressOf(running.learner, "?quality=low"));
  await ready(page);
  await begin(page, /^Full/);
  await guidedExam(page);
  await decide(page);
  const exam = await finish(page);
  console.log(`score ${exam.result.score}, ${exam.result.summary}`);
  check(exam.result.passed && exam.result.correct, "who follows the guidance passes");
  await readReport(browser, running.learner.port, exam);
  await replay(page, exam);
  check(errors.length === 0, `no console error ${errors.join("; ")}`);
  await page.close();
  running.interrupt();
  await running.ended;
  running = await killed(browser, running.learner.port);
  await browser.close();
  running.interrupt();
  await running.ended;
  rmSync(exams, { recursive: true });
  console.log(`${checks} checks`);
}

main().then(
  () => process.exit(0),
  (problem) => {
    console.error(problem);
    process.exit(1);
  },
);
