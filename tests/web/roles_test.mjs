// Learner, watcher and teacher in their pages, with the real program: a reload keeps control, a teacher takes it
// and gives it back, a watcher comments while the exam runs and after it.
// Usage: roles_test.mjs SONDE WEB_DIR OUT_DIR
import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { addressOf, browserPath, openBrowser, PATIENCE_MS, picture, ready, singleExams } from "./drive.mjs";
import { FEW_IMAGES, onePlace, startRun } from "./program.mjs";

const [sonde, web, out] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
mkdirSync(out, { recursive: true });
const exams = mkdtempSync(join(tmpdir(), "sonde-roles-"));
const check = (condition, what) => {
  assert.ok(condition, what);
  console.log(`ok ${what}`);
};

async function visit(browser, at, errors) {
  const page = await (await browser.newContext({ viewport: { width: 1024, height: 640 } })).newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  page.on("pageerror", (e) => errors.push(String(e)));
  await page.goto(addressOf(at, "?quality=low"));
  await ready(page);
  return page;
}

const has = (page, controls) => page.waitForFunction((c) => window.sonde.controls.controls === c, controls);
const badge = (page) => page.locator("#watching").textContent();
const role = (page, name) => page.locator("#role-button", { hasText: name }).click();

async function testReload(learner, watcher) {
  await learner.reload();
  await ready(learner);
  await has(learner, true);
  await watcher.waitForFunction(() => window.sonde.controls.holder === "learner"); // nobody had control meanwhile
  check((await badge(watcher)) === "Watching" && !(await watcher.evaluate(() => window.sonde.controls.controls)), "who loads the page anew keeps control, the watcher watches");
  check(await learner.locator("#exam-bar").isVisible(), "and is back in the exam");
  check(await learner.locator("#watching").isHidden(), "who has control is not told that it watches");
}

async function testTeacher(learner, teacher) {
  check((await badge(teacher)) === "Teacher, watching", "a teacher watches at first");
  await role(teacher, "Take control");
  await has(teacher, true);
  await has(learner, false);
  check((await badge(learner)) === "The teacher has control" && (await badge(teacher)) === "Teacher: you have control", "both say who has control");
  check(await learner.locator("#depth-slider").isDisabled(), "the learner's slider rests");
  await teacher.evaluate(() => window.sonde.setDepth(9));
  await teacher.waitForFunction(() => window.sonde.snapshot.penetration_mm > 8);
  check(true, "the teacher presses");
  await picture(teacher, join(out, "teacher.png"));
  await picture(learner, join(out, "taught.png"));
  await role(teacher, "Give control back");
  await has(learner, true);
  check(await learner.evaluate(() => window.sonde.depth > 5), "the learner takes over where the teacher was");
  await learner.evaluate(() => window.sonde.setDepth(-8));
}

async function comment(page, text) {
  await page.locator("#comment-text").fill(text);
  await page.locator("#comment-author").fill("Dr. Keller");
  await page.locator("#comment-form button").click();
}

async function testComments(learner, watcher) {
  check((await watcher.locator("#comments").isVisible()) && (await learner.locator("#comments").isHidden()), "who watches an exam may comment, who examines is not disturbed");
  await comment(watcher, "Here you press too fast.");
  await watcher.waitForFunction(() => window.sonde.exam.comments.length === 1);
  check((await watcher.locator("#comment-list").innerText()).includes("Here you press too fast."), "a comment is kept while the exam runs");
  await picture(watcher, join(out, "watcher.png"));
  await learner.locator("#finish-button").click();
  await learner.getByRole("button", { name: "Finish and see the result" }).click();
  await learner.waitForFunction(() => window.sonde.exam.result);
  await watcher.locator("#result").getByRole("button", { name: "Comment" }).click();
  await comment(watcher, "Look at <your> second press again.");
  await watcher.waitForFunction(() => window.sonde.exam.comments.length === 2);
  check(await learner.locator("#result").getByRole("button", { name: "Comment" }).isHidden(), "the learner does not comment on itself");
  const report = await learner.evaluate(async () => {
    for (let k = 0; k < 100; ++k) {
      const text = await (await fetch(window.sonde.exam.result.report)).text();
      if (text.includes("second press again")) return text;
      await new Promise((done) => setTimeout(done, 100));
    }
    return "";
  });
  const said = JSON.parse(/id="report">(.*?)<\/script>/s.exec(report)[1]).comments.map((c) => c.text);
  check(said.includes("Look at <your> second press again.") && said.includes("Here you press too fast."), "comments made while the result is shown stand in the report");
  await learner.getByRole("button", { name: "Watch the replay" }).click();
  await learner.waitForFunction(() => window.sonde.replay?.comments.length === 2);
  const kept = await learner.evaluate(() => window.sonde.replay.comments[0]);
  check(kept.text === "Here you press too fast." && kept.author === "Dr. Keller" && kept.t_s > 0, `it stands in the replay at its time: ${kept.t_s.toFixed(1)} s`);
  await watcher.waitForFunction(() => window.sonde.exam.phase === "replay" && window.sonde.replay);
  await watcher.evaluate(() => document.getElementById("result").open && document.querySelector("#result button:last-child").click());
  await comment(watcher, "And this was well done.");
  await learner.waitForFunction(() => window.sonde.replay.comments.length === 3);
  check(true, "a watcher comments on the replay");
  await learner.locator("#replay-leave").click();
}

async function main() {
  const running = await startRun(sonde, ["--port", "0", "--exams", exams, ...onePlace(), ...FEW_IMAGES]);
  const browser = await openBrowser(chromium);
  const errors = [];
  const learner = await visit(browser, running.learner, errors);
  check(await learner.evaluate(() => window.sonde.hello.limb !== null && window.sonde.hello.limb !== undefined), "the page practises on a whole leg");
  await singleExams(learner);
  await learner.locator("#trainee").fill("Test learner");
  await learner.locator("#start-go").click();
  const [watcher, teacher] = await Promise.all([visit(browser, running.learner, errors), visit(browser, running.teacher, errors)]);
  await learner.waitForFunction(() => window.sonde.exam?.phase === "running" && window.sonde.exam.elapsed_s > 0);
  await testReload(learner, watcher);
  await testTeacher(learner, teacher);
  await testComments(learner, watcher);
  check(errors.length === 0, `nothing fails in a page ${errors.join("; ")}`);
  await browser.close();
  running.interrupt();
  await running.ended;
  rmSync(exams, { recursive: true });
}

main().then(
  () => process.exit(0),
  (problem) => {
    console.error(problem);
    process.exit(1);
  },
);
