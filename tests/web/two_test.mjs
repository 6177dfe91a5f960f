// Two learners at once in their pages, started by sonde class: what one does is nowhere in the other's
// exam, page, log or directory; and a client that never reads holds up nobody. How many frames it
// costs the others is measured by bench/stuck_client.mjs.
// Usage: two_test.mjs SONDE WEB_DIR OUT_DIR
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { addressOf, browserPath, findAddress, goTo, openBrowser, PATIENCE_MS, picture, ready, singleExams } from "./drive.mjs";
import { FEW_IMAGES, onePlace } from "./program.mjs";
import { Client } from "./socket.mjs";

const [sonde, web, out] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
mkdirSync(out, { recursive: true });
const exams = mkdtempSync(join(tmpdir(), "sonde-two-"));
const MORE_FRAMES = 60; // beside a client that never reads: far more than any buffer on the way holds
let checks = 0;
const check = (condition, what) => {
  assert.ok(condition, what);
  checks += 1;
  console.log(`ok ${what}`);
};

const isFree = (port) =>
  new Promise((done) => {
    const server = createServer();
    server.once("error", () => done(false));
    server.listen(port, "127.0.0.1", () => server.close(() => done(true)));
  });

async function freePair() {
  for (let port = 20000 + (process.pid % 15000); ; port += 2) if ((await isFree(port)) && (await isFree(port + 1))) return port;
}

const until = (page, condition, argument) => page.waitForFunction(condition, argument, { timeout: PATIENCE_MS });
const exam = (page) => page.evaluate(() => window.sonde.exam);
const status = async (at) => (await fetch(`${at.origin}status.json`, { headers: { Authorization: `Bearer ${at.token}` } })).json();

/** Both programs, once they answer. */
async function startClass(port) {
  const child = spawn(sonde, ["class", "--names", "Ada,Bo", "--port", String(port), "--", "--exams", exams, ...onePlace(), ...FEW_IMAGES], { stdio: ["ignore", "pipe", "inherit"] });
  let said = "";
  child.stdout.on("data", (text) => (said += text));
  const places = [];
  for (const name of ["Ada", "Bo"])
    for (;;) {
      const at = findAddress(said.split("\n").find((line) => line.startsWith(`${name}: http`)) ?? "");
      if (at && (await status(at).catch(() => null))) {
        places.push(at);
        break;
      }
      assert.ok(child.exitCode === null, "sonde class has ended");
      await new Promise((done) => setTimeout(done, 100));
    }
  return [child, ...places];
}

async function visit(browser, at, errors) {
  const page = await browser.newPage({ viewport: { width: 1024, height: 640 } });
  page.setDefaultTimeout(PATIENCE_MS);
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  page.on("pageerror", (e) => errors.push(String(e)));
  await page.goto(addressOf(at, "?quality=low"));
  await ready(page);
  return page;
}

async function begin(page, guidance, which) {
  await singleExams(page);
  await page.locator(".cards.case .card").nth(which).click();
  await page.getByRole("radio", { name: guidance }).check();
  await page.locator("#start-go").click();
  await until(page, () => window.sonde.exam?.phase === "running" && window.sonde.exam.elapsed_s > 0);
}

async function press(page, depth) {
  const before = (await exam(page)).presses.length;
  await page.evaluate((d) => window.sonde.setDepth(d), depth);
  await until(page, (d) => window.sonde.snapshot.penetration_mm > d - 2, depth);
  await page.evaluate(() => window.sonde.setDepth(-8));
  await until(page, (n) => window.sonde.exam.presses.length > n, before);
}

/** Ada presses twice and decides; Bo presses once; neither sees anything of the other. */
async function apart(ada, bo, places) {
  await Promise.all([begin(ada, /^Full/, 0), begin(bo, /^None/, 3)]);
  const [first, second] = [await exam(ada), await exam(bo)];
  check(first.exam !== second.exam && first.case !== second.case, "two learners, two exams, two cases");
  await goTo(ada);
  const still = await bo.evaluate(() => window.sonde.snapshot.position_mm);
  await press(ada, 8);
  check((await bo.evaluate(() => window.sonde.snapshot.position_mm)).every((v, i) => Math.abs(v - still[i]) < 0.5), "one's probe moves, the other's stays");
  await press(ada, 9);
  await press(bo, 8);
  check((await exam(ada)).presses.length === 2 && (await exam(bo)).presses.length === 1, "presses are counted where they were made");
  const needed = (await exam(ada)).segments.find((s) => s.needed);
  await ada.locator("#segments [role=radio]", { hasText: needed.title }).click();
  await ada.locator(".finding.clot").click();
  await until(ada, (id) => window.sonde.exam.segments.find((s) => s.id === id).decision === "clot", needed.id);
  check((await exam(bo)).segments.every((s) => s.decision === ""), "a finding belongs to who gave it");
  const told = [await status(places[0]), await status(places[1])];
  const foreign = await fetch(`${places[1].origin}status.json`, { headers: { Authorization: `Bearer ${places[0].token}` } });
  check(foreign.status === 401, "one learner's token does not open the other's page");
  check(told[0].trainee === "Ada" && told[1].trainee === "Bo" && told[0].case === first.title && told[1].case === second.title, "the teacher's overview has each with the own case");
}

async function ends(ada, bo) {
  await ada.locator("#finish-button").click();
  await ada.getByRole("button", { name: "Finish and see the result" }).click();
  await until(ada, () => window.sonde.exam.result);
  const [first, second] = [await exam(ada), await exam(bo)];
  check(second.phase === "running" && second.result === null, "one has finished, the other goes on");
  await picture(bo, join(out, "two_learners.png"));
  const kept = readdirSync(exams, { withFileTypes: true }).filter((e) => e.isDirectory()).map((e) => e.name);
  const names = (id, name) => readFileSync(join(exams, id, "exam.rec"), "latin1").includes(`"${name}"`); // the journal's setup
  check(kept.length === 2 && names(first.exam, "Ada") && !names(first.exam, "Bo") && names(second.exam, "Bo"), "each exam has its own directory and name");
  const result = JSON.parse(readFileSync(join(exams, first.exam, "exam.json")));
  check(result.presses.length === 2 && !existsSync(join(exams, second.exam, "exam.json")), "only the finished one has a result, with its own presses");
}

/** A client that never reads holds up nobody: frames go on coming to one that reads and to the page. */
async function stuck(bo, at) {
  const silent = new Client(at, false);
  await silent.open;
  const reader = new Client(at, true);
  await reader.open;
  const before = await bo.evaluate(() => window.sonde.frames);
  await reader.frames(MORE_FRAMES);
  await until(bo, (n) => window.sonde.frames >= n, before + MORE_FRAMES);
  check(reader.sequences.every((s, i) => i === 0 || s > reader.sequences[i - 1]), "a client that never reads holds up nobody: frames go on, each newer than the last");
  silent.close();
  reader.close();
}

let programs = null;
process.on("exit", () => programs?.kill("SIGINT")); // whatever ends this test ends the programs

async function main() {
  const port = await freePair();
  const [child, first, second] = await startClass(port);
  programs = child;
  const browser = await openBrowser(chromium);
  const errors = [];
  const [ada, bo] = [await visit(browser, first, errors), await visit(browser, second, errors)];
  await apart(ada, bo, [first, second]);
  await ends(ada, bo);
  await stuck(bo, second);
  check(errors.length === 0, `no console error ${errors.join("; ")}`);
  await browser.close();
  programs.kill("SIGINT");
  await new Promise((done) => programs.on("exit", done));
  rmSync(exams, { recursive: true });
  console.log(`${checks} checks`);
}

main().then(
  () => process.exit(0),
  (problem) => {
    console.error(problem);
    programs?.kill("SIGINT");
    process.exit(1);
  },
);
