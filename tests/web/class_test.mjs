// A class on the network with the real program, over TLS: a learner joins by the code, the teacher sees the
// board, takes control and gives it back, comments; strangers hold connections meanwhile; pages and the
// learner's program die and nothing is lost. Where the machine lets it, the two browsers are in network
// namespaces of their own; else all is on the loopback address.
// Usage: class_test.mjs SONDE WEB_DIR OUT_DIR
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { chmodSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { connect } from "node:net";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { browserPath, goTo, openBrowser, PATIENCE_MS, picture, pressAndRelease, ready, singleExams } from "./drive.mjs";
import { FEW_IMAGES, onePlace } from "./program.mjs";

const [sonde, web, out] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
mkdirSync(out, { recursive: true });
const directory = mkdtempSync(join(tmpdir(), "sonde-class-"));
const check = (condition, what) => {
  assert.ok(condition, what);
  console.log(`ok ${what}`);
};
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

// ---- network namespaces

const ip = (...words) => execFileSync("ip", words, { stdio: "pipe" });
const made = [];

/** A namespace with a cable to this one: {executablePath, host}; null where that is not allowed. */
function namespace(number) {
  const name = `sonde${process.pid}-${number}`;
  const cable = `sd${process.pid % 100000}${number}`;
  const net = `10.${100 + (process.pid % 100)}.${number}`;
  try {
    ip("netns", "add", name);
    made.push(name);
    ip("link", "add", `${cable}a`, "type", "veth", "peer", "name", `${cable}b`, "netns", name);
    ip("addr", "add", `${net}.1/30`, "dev", `${cable}a`);
    ip("link", "set", `${cable}a`, "up");
    ip("-n", name, "addr", "add", `${net}.2/30`, "dev", `${cable}b`);
    ip("-n", name, "link", "set", `${cable}b`, "up");
    ip("-n", name, "link", "set", "lo", "up");
    const script = join(directory, `browser-${number}`);
    writeFileSync(script, `#!/bin/sh\nexec ip netns exec ${name} ${browserPath} "$@"\n`);
    chmodSync(script, 0o755);
    return { executablePath: script, host: `${net}.1` };
  } catch {
    return null;
  }
}

process.on("exit", () => {
  for (const name of made) // its cable goes with it
    try {
      ip("netns", "delete", name);
    } catch {
      // was not made whole
    }
  rmSync(directory, { recursive: true, force: true });
});

// ---- the program

async function startClass() {
  const port = 20000 + (process.pid % 15000);
  const words = ["class", "--learners", "2", "--port", String(port), "--listen", "0.0.0.0:0", "--data", join(directory, "data"), "--", "--exams", join(directory, "exams"), ...onePlace(), ...FEW_IMAGES];
  const child = spawn(sonde, words, { stdio: ["ignore", "pipe", "inherit"] });
  process.on("exit", () => child.kill("SIGINT"));
  let said = "";
  child.stdout.on("data", (text) => (said += text));
  while (!/^Certificate: /m.test(said)) {
    assert.ok(child.exitCode === null, "sonde class has ended");
    await pause(100);
  }
  const first = (pattern) => pattern.exec(said)[1];
  return { child, said: () => said, port: Number(first(/^Join at: https:.*:(\d+)\/$/m)), code: first(/^Code: (\S+)$/m), secret: first(/^Teacher: .*#([0-9a-f]{32})$/m) };
}

// ---- pages

const has = (page, controls) => page.waitForFunction((c) => window.sonde.controls.controls === c, controls);
const role = (page, name) => page.locator("#role-button", { hasText: name }).click();
const dd = (page, key) => page.locator(".card dt", { hasText: key }).locator("xpath=following-sibling::dd[1]");
const says = (page, key, words) => dd(page, key).filter({ hasText: words }).waitFor();

/** The simulator's page is drawn with low quality: where it goes there is no place for a query. */
const lowQuality = () => /^\/\d+\/$/.test(location.pathname) && history.replaceState(null, "", `?quality=low${location.hash}`);

async function open(context, address, errors) {
  const page = await context.newPage();
  await page.addInitScript(lowQuality);
  page.setDefaultTimeout(PATIENCE_MS);
  page.on("pageerror", (e) => errors.push(String(e)));
  await page.goto(address);
  return page;
}

async function joins(page, room) {
  await page.locator("#name").fill("Ada");
  await page.locator("#code").fill("WRONG-CODE");
  await page.getByRole("button", { name: "Join", exact: true }).click();
  await page.locator("#said", { hasText: "not the code" }).waitFor();
  check(true, "a wrong code is refused");
  await picture(page, join(out, "class_join.png"));
  await page.locator("#code").fill(room.code.toLowerCase());
  await page.getByRole("button", { name: "Join", exact: true }).click();
  await page.waitForURL(/\/1\/\?/);
  await ready(page);
  await has(page, true);
  check(await page.evaluate(() => window.sonde.hello.trainee === "Ada"), "who joins is the learner of a program of its own, by name");
}

/** Both lighter than the ground and darker: each text of the page against what is behind it, at least 4.5 to 1. */
const contrast = (page) =>
  page.evaluate(() => {
    const light = (text) => {
      const [r, g, b] = text.match(/[\d.]+/g).slice(0, 3).map((v) => (v / 255 <= 0.03928 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const ground = (e) => {
      for (let at = e; at; at = at.parentElement) {
        const found = getComputedStyle(at).backgroundColor;
        if (!/, 0\)$|transparent/.test(found)) return found;
      }
      return "rgb(255, 255, 255)";
    };
    const shown = [...document.querySelectorAll("#class *")].filter((e) => e.checkVisibility() && [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()));
    const ratios = shown.map((e) => [light(getComputedStyle(e).color), light(ground(e))].sort((a, b) => b - a)).map(([a, b]) => (a + 0.05) / (b + 0.05));
    return { least: Math.min(...ratios), count: ratios.length };
  });

async function readable(page, name) {
  for (const colorScheme of ["dark", "light"]) {
    await page.emulateMedia({ colorScheme });
    const { least, count } = await contrast(page);
    check(count > 5 && least >= 4.5, `${name}, ${colorScheme}: ${count} texts, least contrast ${least.toFixed(2)}`);
    await picture(page, join(out, `${name}_${colorScheme}.png`));
  }
}

async function onBoard(board, learner) {
  await board.locator(".card h2", { hasText: "Ada" }).waitFor();
  await board.waitForFunction(() => {
    const canvas = document.querySelector(".card canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return canvas.width > 100 && data.some((v, i) => i % 4 === 0 && v > 40);
  });
  check(true, "the board shows the learner's image");
  await singleExams(learner);
  await learner.locator("#start-go").click();
  await learner.waitForFunction(() => window.sonde.exam?.phase === "running" && window.sonde.exam.elapsed_s > 0);
  await says(board, "Step", /[a-z]/);
  await says(board, "Done", "0 of ");
  await goTo(learner);
  await learner.evaluate(() => window.sonde.setDepth(8));
  await says(board, "Force", /^([1-9]|0\.[1-9])/);
  await learner.evaluate(() => window.sonde.setDepth(-8));
  await says(board, "Done", "1 presses");
  check(true, "and the exam's step, its presses and the force");
  await board.getByRole("textbox", { name: "Comment for Ada" }).fill("Slower, please.");
  await board.keyboard.press("Enter");
  await learner.waitForFunction(() => window.sonde.exam.comments.some((c) => c.text === "Slower, please." && c.author === "Teacher"));
  check(true, "a comment from the board is in the exam");
  await readable(board, "class_board");
}

async function handsOver(board, learner, errors) {
  const address = await board.getByRole("link", { name: "Open Ada" }).evaluate((a) => a.href);
  const teacher = await open(board.context(), address, errors);
  await ready(teacher);
  await role(teacher, "Take control");
  await has(teacher, true);
  await has(learner, false);
  await says(board, "Control", "teacher");
  await teacher.evaluate(() => window.sonde.setDepth(9));
  await learner.waitForFunction(() => window.sonde.snapshot.penetration_mm > 8);
  await role(teacher, "Give control back");
  await has(learner, true);
  check(true, "the teacher takes control, presses, and gives it back");
  await role(teacher, "Take control");
  await has(learner, false);
  await teacher.close(); // dies with control in its hands
  await has(learner, true);
  await learner.evaluate(() => window.sonde.setDepth(-8));
  check(true, "a teacher's page that dies leaves control with the learner");
}

/** Connections that say nothing, half a greeting, or noise, more than the door has places. */
async function hold(room, count) {
  const held = [];
  for (let i = 0; i < count; ++i) {
    const one = connect(room.port, "127.0.0.1");
    one.on("error", () => {});
    await new Promise((done) => one.once("connect", done));
    one.write(["\x16\x03\x01\x02\x00\x01\x00", "GET / HTTP/1.1\r\n\r\n", Buffer.alloc(3000, 7)][i % 3]);
    held.push(one);
  }
  return () => held.forEach((one) => one.destroy());
}

async function main() {
  const [first, second] = [namespace(1), namespace(2)];
  const apart = first && second;
  console.log(apart ? "two network namespaces" : "loopback only: this machine allows no network namespaces");
  const room = await startClass();
  const [host, other] = apart ? [first.host, second.host] : ["127.0.0.1", "127.0.0.1"];
  const browsers = [await openBrowser(chromium, [], apart && first.executablePath), await openBrowser(chromium, [], apart && second.executablePath)];
  const errors = [];
  const view = { viewport: { width: 1024, height: 640 }, ignoreHTTPSErrors: true };
  const context = await browsers[0].newContext(view);
  let learner = await open(context, `https://${host}:${room.port}/`, errors);
  const board = await open(await browsers[1].newContext(view), `https://${other}:${room.port}/#${room.secret}`, errors);
  await joins(learner, room);
  await onBoard(board, learner);
  await handsOver(board, learner, errors);
  const release = await hold(room, 400);
  await pressAndRelease(learner, 8);
  const exam = await learner.evaluate(() => ({ exam: window.sonde.exam.exam, presses: window.sonde.exam.presses.length }));
  check(true, "strangers that hold every connection do not disturb the learner");
  await learner.close();
  learner = await open(context, `https://${host}:${room.port}/`, errors); // a newcomer gets through as well
  release();
  await learner.getByRole("button", { name: "Back to my place" }).click();
  await learner.waitForURL(/\/1\/\?/);
  await ready(learner);
  await has(learner, true);
  // A press that was under way when its page died may have ended meanwhile.
  await learner.waitForFunction((was) => window.sonde.exam?.exam === was.exam && window.sonde.exam.presses.length >= was.presses, exam);
  check(true, "a learner's page that died comes back to its place, its exam and its presses");
  check(errors.length === 0, `nothing fails in a page ${errors.join("; ")}`);
  for (const browser of browsers) await browser.close();
  const ended = new Promise((done) => room.child.on("exit", done));
  room.child.kill("SIGINT");
  check((await ended) === 0, "the class ends");
}

main().then(
  () => process.exit(0),
  (problem) => {
    console.error(problem);
    process.exit(1);
  },
);
