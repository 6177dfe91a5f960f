// The page in windows of every size, without WebGL, with a lost WebGL context and without a connection, against
// the mock. Usage: node windows_test.mjs WEB_BUILD_DIR OUT_DIR
import { createRequire } from "node:module";
import { mkdirSync } from "node:fs";
import path from "node:path";
import { browserPath, exams, openBrowser, PATIENCE_MS, picture, ready } from "./drive.mjs";
import { layoutFaults } from "./inspect.mjs";
import { startMock } from "./mock_server.mjs";

const [, , webDir, outDir] = process.argv;
const SKIPPED = 77;
const SIZES = [[1280, 720], [820, 1180], [390, 844], [844, 390]];
if (!browserPath) {
  console.log("skipped: /usr/bin/chromium is not installed");
  process.exit(SKIPPED);
}
const { chromium } = createRequire(path.join(webDir, "package.json"))("playwright-core");
const failures = [];
function check(good, what) {
  console.log(`${good ? "ok    " : "FAILED"} ${what}`);
  if (!good) failures.push(what);
}

/** Which of these are not wholly inside the window, without scrolling. */
function outside(selectors) {
  return selectors.filter((s) => {
    const e = document.querySelector(s);
    const b = e.getBoundingClientRect();
    const top = document.elementFromPoint(b.left + b.width / 2, b.top + b.height / 2);
    return b.width === 0 || b.left < -0.5 || b.top < -0.5 || b.right > innerWidth + 0.5 || b.bottom > innerHeight + 0.5 || !e.contains(top);
  });
}

/** Everything that can be clicked or dragged and is smaller than 24 px in one direction. */
function small() {
  const LEAST = 24;
  const seen = (e) => e.checkVisibility({ visibilityProperty: true }) && e.getBoundingClientRect().width > 0;
  const all = [...document.querySelectorAll("button, a[href], input, select, .card, .handle .hit")].filter((e) => seen(e) && !e.closest(".card") === !e.matches(".card input"));
  return all.map((e) => [e, e.getBoundingClientRect()]).filter(([, b]) => b.width < LEAST - 0.01 || b.height < LEAST - 0.01)
    .map(([e, b]) => `${e.id || e.className || e.textContent.trim()}: ${b.width.toFixed(0)} x ${b.height.toFixed(0)}`);
}

const button = (page, name) => page.getByRole("button", { name, exact: true });

async function look(page, state, [w, h]) {
  await page.waitForTimeout(250);
  await picture(page, path.join(outDir, `${state.replace(/ /g, "_")}_${w}x${h}.png`));
  const where = `${state} at ${w} x ${h}`;
  const tiny = await page.evaluate(small);
  check(tiny.length === 0, `${where}: every target has 24 px${tiny.map((t) => `\n       ${t}`).join("")}`);
  const faults = await page.evaluate(layoutFaults);
  check(faults.length === 0, `${where}: nothing overlaps or is cut${faults.slice(0, 6).map((f) => `\n       ${f}`).join("")}`);
}

/** Slider, Let go and Stop are in view without scrolling; Stop also after scrolling. */
async function reachable(page, state, size) {
  const wanted = ["#depth-slider", "#ease", "#stop", "#scene", ".pane:not([hidden]) canvas"];
  const gone = await page.evaluate(outside, wanted);
  check(gone.length === 0, `${state} at ${size.join(" x ")}: image, thigh, slider, Let go and Stop are in view ${gone.join(" ")}`);
  await page.evaluate(() => document.querySelector("main").scrollTo(0, 1e5));
  check((await page.evaluate(outside, ["#stop"])).length === 0, `${state} at ${size.join(" x ")}: Stop stays when the page is scrolled`);
  await page.evaluate(() => document.querySelector("main").scrollTo(0, 0));
}

async function testSize(browser, mock, size) {
  const page = await browser.newPage({ viewport: { width: size[0], height: size[1] } });
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(`${mock.address}?quality=low`);
  await ready(page);
  await page.locator("#start[open]").waitFor();
  await look(page, "start", size);
  await button(page, "Free practice").click();
  await look(page, "practice", size);
  const leg = await page.evaluate(() => window.sonde.legOnScreen());
  check(leg.least > 0 && leg.most < 1 && leg.most - leg.least > 0.6, `practice at ${size.join(" x ")}: all of the leg is in its picture and fills it, from ${leg.least.toFixed(2)} to ${leg.most.toFixed(2)}`);
  await reachable(page, "practice", size);
  await button(page, "Compare").click();
  await look(page, "compare", size);
  const used = await page.evaluate(() => {
    const area = (e) => e.getBoundingClientRect().width * e.getBoundingClientRect().height;
    return [...document.querySelectorAll(".pane")].reduce((sum, e) => sum + area(e), 0) / area(document.getElementById("echo-box"));
  });
  if (size[0] === 1280) check(used > 0.6, `compare at ${size.join(" x ")}: both images fill ${(100 * used).toFixed(0)} % of their panel`);
  else console.log(`       compare at ${size.join(" x ")}: both images fill ${(100 * used).toFixed(0)} % of their panel`);
  await button(page, "Compare").click();
  await button(page, "Start an exam").click();
  await page.locator("#start-go").click();
  await page.waitForFunction(() => window.sonde.exam.phase === "running" && window.sonde.exam.step.target);
  await page.evaluate(() => document.getElementById("coach-close").click());
  await look(page, "exam", size);
  await reachable(page, "exam", size);
  await button(page, "Leave").click();
  await page.waitForFunction(() => window.sonde.exam.phase === "practice");
  await page.close();
}

/** Image and force go on, and the probe can still be dragged. */
async function goesOn(page, what) {
  const frames = await page.evaluate(() => window.sonde.frames);
  await page.waitForFunction((n) => window.sonde.frames > n + 20, frames);
  await page.evaluate(() => window.sonde.setDepth(12));
  await page.waitForFunction(() => Number.parseFloat(document.getElementById("force-value").textContent) > 1);
  check(true, `${what}: images and force go on`);
  await page.evaluate(() => window.sonde.setSite(27));
  const before = await page.evaluate(() => window.sonde.point);
  const box = await page.locator("#scene").boundingBox();
  await page.mouse.move(box.x + box.width * 0.45, box.y + box.height * 0.5);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.6, box.y + box.height * 0.52, { steps: 8 });
  await page.mouse.up();
  const after = await page.evaluate(() => window.sonde.point);
  check(Math.hypot(...after.map((v, i) => v - before[i])) > 5, `${what}: dragging moves the probe`);
}

/** Share of the flat canvas that is painted, and whether there is the vein's colour. */
const painted = (page) =>
  page.evaluate(() => {
    const c = document.getElementById("scene-flat");
    const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
    let [full, blue] = [0, 0];
    for (let i = 0; i < d.length; i += 4) {
      if (d[i + 3] > 0) ++full;
      if (d[i + 3] > 0 && d[i + 2] > d[i] + 60 && d[i + 2] > d[i + 1] + 40) ++blue;
    }
    return { share: full / (d.length / 4), blue };
  });

async function testNoWebGl(mock) {
  const browser = await openBrowser(chromium, ["--disable-3d-apis"]);
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  page.setDefaultTimeout(PATIENCE_MS);
  const errors = [];
  page.on("pageerror", (e) => errors.push(e.message));
  await page.goto(`${mock.address}?site=27&depth=0`);
  await ready(page);
  check(await page.evaluate(() => document.createElement("canvas").getContext("webgl2") === null), "this browser has no WebGL");
  await goesOn(page, "without WebGL");
  check(await page.locator("#flat-note").isVisible(), "without WebGL: the page says so");
  const seen = await painted(page);
  check(seen.share > 0.1 && seen.share < 0.9 && seen.blue > 50, `without WebGL: the leg is drawn on ${(100 * seen.share).toFixed(0)} % of the stage, with its vein`);
  await picture(page, path.join(outDir, "no_webgl.png"));
  check(errors.length === 0, `without WebGL: nothing fails ${errors.slice(0, 2).join("; ")}`);
  await browser.close();
}

async function testLostContext(browser, mock) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(`${mock.address}?site=27&depth=0&quality=low`);
  await ready(page);
  check(await page.locator("#scene-flat").isHidden(), "with WebGL there is no plain view");
  const has = await page.evaluate(() => {
    const gl = document.getElementById("scene").getContext("webgl2");
    window.lose = gl?.getExtension("WEBGL_lose_context");
    window.lose?.loseContext();
    return Boolean(window.lose);
  });
  check(has, "the context can be lost");
  await page.locator("#scene-flat").waitFor({ state: "visible" });
  await goesOn(page, "with a lost context");
  await page.evaluate(() => window.lose.restoreContext());
  await page.locator("#scene-flat").waitFor({ state: "hidden" });
  await goesOn(page, "with the context restored");
  await picture(page, path.join(outDir, "restored.png"));
  await page.close();
}

async function testOffline(browser, mock) {
  for (const size of SIZES) {
    const page = await browser.newPage({ viewport: { width: size[0], height: size[1] } });
    page.setDefaultTimeout(PATIENCE_MS);
    await page.goto(`${mock.address}?site=27&depth=10&quality=low`);
    await ready(page);
    await page.waitForFunction(() => Number.parseFloat(document.getElementById("force-value").textContent) > 1);
    await page.waitForFunction(() => document.getElementById("status-text").textContent === "Connected, solid tissue");
    mock.drop();
    await page.waitForFunction(() => !window.sonde.connected);
    await picture(page, path.join(outDir, `offline_${size.join("x")}.png`));
    const shown = await page.evaluate(() => ({
      grey: getComputedStyle(document.querySelector(".pane")).filter.includes("grayscale") && Number(getComputedStyle(document.querySelector(".pane")).opacity) < 0.6,
      force: document.getElementById("force-value").textContent, word: document.getElementById("force-word").textContent,
      readings: [...document.querySelectorAll(".readout b")].map((e) => e.textContent).join(""),
      said: document.getElementById("echo-lost").checkVisibility(), status: document.getElementById("status-text").textContent,
      slider: document.getElementById("depth-slider").disabled,
    }));
    const where = `offline at ${size.join(" x ")}`;
    check(shown.grey && shown.said, `${where}: the image is grey and says that it is not of now`);
    check(!/\d/.test(shown.force) && shown.word === "not connected" && !/\d/.test(shown.readings), `${where}: no number is shown as if it were measured: ${shown.force} ${shown.word} ${shown.readings}`);
    check(shown.slider, `${where}: what would do nothing cannot be moved`);
    mock.back();
    await page.waitForFunction(() => window.sonde.connected);
    await page.waitForFunction(() => !document.body.classList.contains("offline") && /\d/.test(document.getElementById("force-value").textContent));
    check(await page.locator("#echo-lost").isHidden(), `${where}: all of it comes back with the connection`);
    await page.close();
  }
}

async function main() {
  mkdirSync(outDir, { recursive: true });
  const mock = await startMock({ webDir, list: exams() });
  const browser = await openBrowser(chromium);
  try {
    for (const size of SIZES) await testSize(browser, mock, size);
    await testOffline(browser, mock);
    await testLostContext(browser, mock);
    await testNoWebGl(mock);
  } finally {
    await browser.close();
    mock.close();
  }
}

await main().catch((error) => check(false, error.stack));
process.exit(failures.length ? 1 : 0);
