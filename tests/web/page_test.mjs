// The page in a real browser against the real program: presses at site 27 with the linear probe.
// Checks that force rises with depth, that the healthy vein closes and the chronic one does not,
// that the image changes, that Stop and Resume work, that everything fits at 1280 x 720 and that the
// console stays free of errors. Usage: node page_test.mjs SONDE MODEL WEB_BUILD_DIR OUT_DIR
import { createRequire } from "node:module";
import { existsSync, mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { addressOf, PATIENCE_MS, picture } from "./drive.mjs";
import { FEW_IMAGES, startRun } from "./program.mjs";

const [, , program, model, webDir, outDir] = process.argv;
const { chromium } = createRequire(path.join(webDir, "package.json"))("playwright-core");
const SKIPPED = 77;
const FORCE_N = 20;
const browserPath = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].find(existsSync);
if (!browserPath) {
  console.log("skipped: /usr/bin/chromium is not installed");
  process.exit(SKIPPED);
}

const failures = [];
function check(good, what) {
  console.log(`${good ? "ok    " : "FAILED"} ${what}`);
  if (!good) failures.push(what);
}

/** Holds the probe at a depth until it is there and the force is steady; returns the snapshot. */
async function press(page, depth_mm) {
  await page.evaluate((d) => window.sonde.setDepth(d), depth_mm);
  await page.waitForFunction((d) => Math.abs(window.sonde.snapshot.penetration_mm - d) < 0.3, depth_mm, { timeout: PATIENCE_MS });
  let last = NaN;
  for (let i = 0; i < 60; ++i) {
    const s = await nextSnapshot(page);
    if (Math.abs(s.force_normal_n - last) < 0.02 * Math.max(1, Math.abs(last))) return s;
    last = s.force_normal_n;
  }
  throw new Error(`the force at ${depth_mm} mm does not settle`);
}

/** A snapshot of at least 300 ticks later. */
async function nextSnapshot(page) {
  const tick = await page.evaluate(() => window.sonde.snapshot.tick);
  await page.waitForFunction((t) => window.sonde.snapshot.tick > t + 300, tick, { timeout: PATIENCE_MS });
  return page.evaluate(() => window.sonde.snapshot);
}

async function pressAndTell(page, depth) {
  const s = await press(page, depth);
  console.log(`       ${depth} mm: ${s.force_normal_n.toFixed(2)} N, vein ${(100 * s.vein_area_ratio).toFixed(0)} %`);
  return s;
}

/** Presses by steps until FORCE_N is passed, then halves the last step until the force is near it. */
async function pressUntilForce(page) {
  const forces = [];
  let [low, high] = [0, 0];
  for (; high < 44 && !(forces[forces.length - 1] >= FORCE_N); ) {
    [low, high] = [high, high + 4];
    forces.push((await pressAndTell(page, high)).force_normal_n);
  }
  check(forces.every((f, i) => i === 0 || f > forces[i - 1]), "the force rises with depth");
  check(forces[forces.length - 1] >= FORCE_N, `the force reaches ${FORCE_N} N within 44 mm`);
  for (let i = 0; i < 7; ++i) {
    const middle = (low + high) / 2;
    const s = await pressAndTell(page, middle);
    if (Math.abs(s.force_normal_n - FORCE_N) < 0.1 * FORCE_N) return s;
    [low, high] = s.force_normal_n < FORCE_N ? [middle, high] : [low, middle];
  }
  throw new Error(`${FORCE_N} N was not found between ${low} and ${high} mm`);
}

async function testVein(page) {
  const relaxed = await page.evaluate(() => window.sonde.imageSum);
  const healthy = await pressUntilForce(page);
  check(healthy.vein_area_ratio < 0.15, `the healthy vein closes: ${healthy.vein_area_ratio.toFixed(3)} < 0.15`);
  check(healthy.artery_area_ratio > 0.4, `the artery stays open: ${healthy.artery_area_ratio.toFixed(3)}`);
  check((await page.evaluate(() => window.sonde.imageSum)) !== relaxed, "the image changes");
  await picture(page, path.join(outDir, "press.png"));
  await page.getByRole("button", { name: "Chronic" }).click();
  await page.waitForFunction(() => window.sonde.controls.case === "chronic_occlusive");
  let chronic = null;
  for (let i = 0; i < 6; ++i) chronic = await nextSnapshot(page);
  check(chronic.vein_area_ratio > 0.7, `the chronic vein stays open: ${chronic.vein_area_ratio.toFixed(3)} > 0.7`);
  await picture(page, path.join(outDir, "press_chronic.png"));
}

async function testControls(page) {
  const marks = await page.evaluate(() => window.sonde.imageSum);
  await page.evaluate(() => {
    const gain = document.querySelector("#sliders input");
    gain.value = "12";
    gain.dispatchEvent(new Event("input"));
  });
  await page.waitForFunction(() => window.sonde.controls.gain_db === 12);
  await nextSnapshot(page);
  check((await page.evaluate(() => window.sonde.imageSum)) !== marks, "gain changes the image");
  const before = await page.evaluate(() => window.sonde.depth);
  await page.locator("#scene").hover();
  await page.mouse.wheel(0, 100);
  check((await page.evaluate(() => window.sonde.depth)) === before - 1, "one notch of the wheel is 1 mm");
  await page.locator("#scene").focus();
  await page.keyboard.press("Shift+ArrowDown");
  check((await page.evaluate(() => window.sonde.depth)) === before - 6, "Shift and an arrow key are 5 mm");
  await page.keyboard.press("1");
  await page.waitForFunction(() => window.sonde.controls.probe === window.sonde.hello.probes[0].name);
  check(true, "a digit chooses the probe");
}

async function testStop(page) {
  await page.keyboard.press("Escape");
  await page.waitForFunction(() => window.sonde.snapshot.fault !== 0);
  const s = await nextSnapshot(page);
  check(Math.hypot(...s.rendered_force_n) === 0, "after Esc the rendered force is zero");
  check(await page.locator("#fault").isVisible(), "the stop is said");
  await page.locator("#resume").click();
  await page.waitForFunction(() => window.sonde.snapshot.fault === 0);
  check(await page.locator("#fault").isHidden(), "Resume goes on");
}

// Deeper than the skin at the knee gives way: no force, no image, and a word about it.
async function testThrough(page) {
  const [site, depth] = await page.evaluate(() => [window.sonde.hello.sites.at(-1).id, window.sonde.depth]);
  await page.evaluate((id) => (window.sonde.setSite(id), window.sonde.setDepth(45)), site);
  await page.waitForFunction(() => window.sonde.snapshot.flags & 8);
  check(await page.locator("#fault").isVisible() && /lift the probe/i.test(await page.locator("#fault").innerText()), "a path through the leg is said");
  await page.waitForFunction(() => Math.hypot(...window.sonde.snapshot.force_n) === 0 && window.sonde.imageSum === 0);
  check(await page.locator("#resume").isHidden(), "there is nothing to resume");
  await page.evaluate(() => window.sonde.setDepth(-15));
  await page.waitForFunction(() => (window.sonde.snapshot.flags & 8) === 0);
  check(await page.locator("#fault").isHidden(), "lifted off, the probe acts again");
  await page.evaluate((mm) => (window.sonde.setSite(27), window.sonde.setDepth(mm)), depth);
}

async function testDrag(page) {
  const box = await page.locator("#scene").boundingBox();
  await page.evaluate(() => window.sonde.setDepth(2));
  const before = await page.evaluate(() => window.sonde.snapshot.position_mm);
  await page.mouse.move(box.x + box.width * 0.55, box.y + box.height * 0.4);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.62, box.y + box.height * 0.45, { steps: 8 });
  await page.mouse.up();
  await nextSnapshot(page);
  const after = await page.evaluate(() => window.sonde.snapshot.position_mm);
  const moved = Math.hypot(...after.map((c, i) => c - before[i]));
  check(moved > 3, `dragging moves the probe: ${moved.toFixed(1)} mm`);
}

/** The token is out of sight, survives a reload, and is asked of everyone. */
async function testAccess(page, browser, { origin, token }) {
  check(!page.url().includes(token), `the token is taken out of the visible address: ${page.url()}`);
  await page.reload();
  await page.waitForFunction(() => (window.sonde?.frames ?? 0) > 3);
  check(true, "a page that is loaded anew still has access");
  const stranger = await browser.newPage();
  await stranger.goto(origin);
  await stranger.waitForFunction(() => document.getElementById("banner").textContent.includes("no access"));
  check((await stranger.evaluate(() => window.sonde.frames)) === 0, "a page without the token gets nothing and says what to do");
  await stranger.goto(`${origin}#${token}`);
  await stranger.waitForFunction(() => window.sonde.connected);
  check(true, "the whole address lets it in");
  await stranger.close();
  const status = async (headers) => (await fetch(`${origin}status.json`, { headers })).status;
  check((await status({})) === 401 && (await status({ Authorization: `Bearer ${token}` })) === 200, "data is for who has the token");
}

async function testLayout(page) {
  const size = await page.evaluate(() => {
    const e = document.documentElement;
    return { w: e.scrollWidth, h: e.scrollHeight, cut: [...document.querySelectorAll("#readouts *")].some((x) => x.getBoundingClientRect().bottom > innerHeight) };
  });
  check(size.w <= 1280 && size.h <= 720 && !size.cut, "everything fits at 1280 x 720");
}

async function testLoss(page, server) {
  server.interrupt();
  await page.waitForFunction(() => !document.getElementById("banner").hidden, null, { timeout: PATIENCE_MS });
  check((await page.locator("#banner").textContent()).includes("lost"), "a lost connection is said");
}

async function main() {
  mkdirSync(outDir, { recursive: true });
  const profile = mkdtempSync(path.join(tmpdir(), "sonde-web-"));
  const server = await startRun(program, [model, "--port", "0", ...FEW_IMAGES]);
  const address = server.learner;
  let browser = null;
  try {
    browser = await chromium.launchPersistentContext(profile, {
      executablePath: browserPath,
      headless: true,
      viewport: { width: 1280, height: 720 },
      args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync"],
    });
    const page = await browser.newPage();
    page.setDefaultTimeout(PATIENCE_MS);
    const errors = [];
    page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
    page.on("pageerror", (e) => errors.push(e.message));
    await page.goto(addressOf(address, "?site=27&depth=0&probe=linear&case=healthy&quality=low"));
    await page.waitForFunction(() => (window.sonde?.frames ?? 0) > 3 && Math.abs(window.sonde.snapshot.penetration_mm) < 0.5);
    check(true, "the page connects and receives frames");
    await testAccess(page, browser, address);
    await testLayout(page);
    await testVein(page);
    await testControls(page);
    await testStop(page);
    await testThrough(page);
    await testDrag(page);
    check(errors.length === 0, `no errors on the console${errors.map((e) => `\n       ${e}`).join("")}`);
    await testLoss(page, server);
  } finally {
    await browser?.close();
    server.interrupt();
    const ending = await server.ended;
    check(ending === 0, `the program ends cleanly: ${ending}`);
    rmSync(profile, { recursive: true, force: true });
  }
}

await main().catch((error) => check(false, error.stack));
process.exit(failures.length ? 1 : 0);
