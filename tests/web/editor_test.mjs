// The case editor with the real program: a teacher writes a case, points at a vein, checks, keeps, shares, opens and
// tries it; a learner may not. Usage: editor_test.mjs SONDE WEB_DIR OUT_DIR
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { addressOf, browserPath, openBrowser, PATIENCE_MS, picture, ready } from "./drive.mjs";
import { contrastFaults, layoutFaults, nameFaults } from "./inspect.mjs";
import { FEW_IMAGES, onePlace, startRun } from "./program.mjs";
import { Client } from "./socket.mjs";

const [sonde, web, out] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
mkdirSync(out, { recursive: true });
const home = mkdtempSync(join(tmpdir(), "sonde-editor-"));
const own = join(home, "own");
const check = (condition, what) => {
  assert.ok(condition, what);
  console.log(`ok ${what}`);
};

/** What the program says of the text as it stands, once it does. */
const told = async (page) => (await page.waitForFunction(() => window.sonde.draft)).jsonValue();
const tab = (page, name) => page.locator(`#editor-tab-${name}`).click();
const checked = async (page, button = "check") => {
  await page.locator(`#editor-${button}`).click();
  return told(page);
};
const text = async (page) => {
  await tab(page, "text");
  return page.locator("#editor-text").inputValue();
};

async function inspect(page, state) {
  for (const [find, colorScheme] of [[nameFaults], [contrastFaults, "light"], [contrastFaults, "dark"], [layoutFaults]]) {
    if (colorScheme) await page.emulateMedia({ colorScheme });
    const faults = await page.evaluate(find);
    check(faults.length === 0, `${state}: ${find.name} ${colorScheme ?? ""}${faults.slice(0, 5).map((f) => `\n       ${f}`).join("")}`);
  }
  await picture(page, join(out, `editor_${state.replace(/ /g, "_")}.png`));
}

/** Who has the learner's address is refused, and hears nothing of a case. */
async function refused(at) {
  const learner = new Client(at, true);
  const heard = [];
  const error = new Promise((done) => (learner.heard = (m) => (heard.push(m.type), m.type === "error" && done(m.message))));
  await learner.open;
  learner.say({ type: "edit", action: "open", case: "patient-1" });
  check((await error).includes("teacher's address"), "a learner edits no case");
  return { learner, heard };
}

async function click(page, share) {
  const at = await page.evaluate((s) => window.sonde.vesselOnScreen(2, s), share);
  const box = await page.locator("#scene").boundingBox();
  await page.mouse.click(box.x + at[0], box.y + at[1]);
}

async function write(page) {
  await page.locator("#edit-button").click();
  await page.locator("#editor-new").waitFor();
  await inspect(page, "choose");
  await page.locator("#editor-new").click();
  const first = await told(page);
  check(first.good, `a new case is right from the start: ${first.message}`);
  check((await page.evaluate(() => window.sonde.exam.phase)) === "edit", "its leg is in view");
  await page.locator("#editor-id").fill("test-case");
  await page.locator("#editor-name").fill("A case for the test");
  await inspect(page, "case");
  await tab(page, "leg");
  await page.locator("#editor-side").selectOption("left");
  await page.locator("#editor-bmi").fill("23");
  await inspect(page, "leg");
}

async function point(page) {
  await tab(page, "findings");
  await page.locator("#editor-point").click();
  await click(page, 0.4);
  await page.waitForFunction(() => document.getElementById("editor-point").textContent.includes("ends"));
  await click(page, 0.52);
  await page.locator("#editor-clot-0-stage").waitFor();
  await page.locator("#editor-clot-0-stage").selectOption("chronic_occlusive");
  const ends = await Promise.all(["from", "to"].map((key) => page.locator(`#editor-clot-0-${key}`).inputValue()));
  check(Math.abs(Number(ends[0]) - 40) < 2 && Math.abs(Number(ends[1]) - 52) < 2, `two clicks on the vein place a clot: ${ends.join(" to ")} %`);
  const draft = await checked(page);
  check(draft.good, `the answer follows the findings: ${draft.message}`);
  check((await page.evaluate(() => window.sonde.hello.limb.side)) === "left", "the leg that is shown is the one of the case");
  await inspect(page, "findings");
  await tab(page, "answer");
  check((await page.locator("#editor-thrombosis").inputValue()) === "true", "it is a thrombosis");
  await inspect(page, "answer");
}

async function keep(page) {
  const saved = await checked(page, "save");
  const file = join(own, "test-case.yaml");
  check(saved.saved === file && existsSync(file), `the case is kept: ${saved.saved}${saved.message}`);
  const run = spawnSync(sonde, ["cases", "--check", file, "--json"], { encoding: "utf8" });
  check(run.status === 0 && JSON.parse(run.stdout).thrombosis === true, `sonde cases --check agrees ${run.stderr}`);
  await tab(page, "case");
  await page.locator("#editor-name").fill("A better title");
  const exists = await checked(page, "save");
  check(exists.exists && exists.saved === "" && exists.message.includes("already"), "a case that is there is not replaced unasked");
  check(!readFileSync(file, "utf8").includes("A better title"), "and stays as it was");
  check((await checked(page, "save")).saved === file && readFileSync(file, "utf8").includes("A better title"), "until it is asked for");
  for (const [id, why] of [["gastrocnemius", "comes with the program"], ["../outside", "expected a-z"], ["/tmp/outside", "expected a-z"]]) {
    await page.locator("#editor-id").fill(id);
    const answer = await checked(page, "save");
    check(answer.saved === "" && answer.message.includes(why), `no case is kept as ${id}: ${answer.message}`);
  }
  check(readdirSync(own).join() === "test-case.yaml" && readdirSync(home).every((name) => ["own", "exams"].includes(name)), "and nothing was written elsewhere");
  await page.locator("#editor-id").fill("test-case");
}

async function share(page) {
  const written = await text(page);
  const [download] = await Promise.all([page.waitForEvent("download"), page.locator("#editor-download").click()]);
  const file = join(home, "exams", "shared.yaml");
  await download.saveAs(file);
  check(download.suggestedFilename() === "test-case.yaml" && readFileSync(file, "utf8") === written, "one file holds the case");
  writeFileSync(file, written.replace("level: easy", "level: easier"));
  await page.getByRole("button", { name: "Other case" }).click();
  await page.locator("#editor-file").setInputFiles(file);
  const wrong = await told(page);
  const line = 1 + written.split("\n").indexOf("level: easy");
  check(!wrong.good && wrong.message.startsWith(`case:${line}: `), `what is wrong with a file is told with its line: ${wrong.message}`);
  await tab(page, "text");
  await page.waitForFunction(() => {
    const area = document.getElementById("editor-text");
    return area.value.slice(area.selectionStart, area.selectionEnd) === "level: easier";
  });
  await inspect(page, "text");
  await page.locator("#editor-text").fill(written);
  check((await checked(page)).good, "and is mended in its text");
}

async function tryIt(page) {
  await page.locator("#editor-try").click();
  await page.waitForFunction(() => window.sonde.exam.phase === "running" && window.sonde.controls.controls);
  const { title, step } = await page.evaluate(() => window.sonde.exam);
  check(title === "A better title" && step.target !== null, "an exam of the draft runs, and the teacher has the probe");
  check(await page.locator("#editor").isHidden() && (await page.locator("#echo-panel").isVisible()), "it looks like every exam");
  await page.getByRole("button", { name: "Leave", exact: true }).click();
  await page.waitForFunction(() => window.sonde.exam.phase === "edit" && window.sonde.draft?.good);
  check(await page.locator("#editor").isVisible(), "after it the case is written on");
  await page.reload();
  await page.waitForFunction(() => window.sonde?.draft?.good);
  check((await text(page)).includes("test-case"), "a page that is loaded anew has it still");
  await page.getByRole("button", { name: "Close", exact: true }).click();
  await page.waitForFunction(() => window.sonde.exam.phase === "practice" && window.sonde.hello.case_list.some((c) => c.own && c.title === "A better title"));
  check(true, "closed, the case is among those that can be examined");
}

async function main() {
  const running = await startRun(sonde, ["--port", "0", "--exams", join(home, "exams"), "--own-cases", own, ...FEW_IMAGES, ...onePlace()]);
  const browser = await openBrowser(chromium);
  const { learner, heard } = await refused(running.learner);
  const page = await (await browser.newContext({ viewport: { width: 1280, height: 720 }, reducedMotion: "reduce" })).newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  const errors = [];
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  page.on("pageerror", (e) => errors.push(String(e)));
  await page.goto(addressOf(running.teacher, "?quality=low"));
  await ready(page);
  if (await page.locator("#start[open]").isVisible()) await page.keyboard.press("Escape");
  await write(page);
  await point(page);
  await keep(page);
  await share(page);
  check(!heard.includes("draft"), "a learner hears nothing of the draft");
  learner.close();
  await tryIt(page);
  check(errors.length === 0, `no console error ${errors.join("; ")}`);
  await browser.close();
  running.interrupt();
  await running.ended;
  rmSync(home, { recursive: true });
}

main().then(
  () => process.exit(0),
  (problem) => {
    console.error(problem);
    process.exit(1);
  },
);
