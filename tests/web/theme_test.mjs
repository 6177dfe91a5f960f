// Colours of the page: every one is in the palette, the switch is kept, a picture stays on black, and the layouts of a
// projector and of a tablet hold. Usage: node theme_test.mjs WEB_BUILD_DIR SOURCE_DIR OUT_DIR
import assert from "node:assert/strict";
import { mkdirSync, readdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { browserPath, exams, openBrowser, PATIENCE_MS, picture, ready } from "./drive.mjs";
import { contrastFaults, layoutFaults } from "./inspect.mjs";
import { startMock } from "./mock_server.mjs";

const [webDir, sourceDir, outDir] = process.argv.slice(2).map((p) => path.resolve(p));

/** Colours that are written where they are used. A number after 0x with six digits is one in the picture of the leg. */
function literals() {
  const web = path.join(sourceDir, "web");
  const files = ["style.css", ...readdirSync(path.join(web, "src")).filter((f) => f.endsWith(".ts") && f !== "theme.ts").map((f) => `src/${f}`)];
  const selector = /^[^{}]*\{/; // an id before the brace is no colour
  return files.flatMap((file) =>
    readFileSync(path.join(web, file), "utf8").split("\n").flatMap((text, i) => {
      const line = file.endsWith(".css") ? text.replace(selector, "") : text;
      const found = line.match(/(?<![\w&])#(?:[0-9a-f]{8}|[0-9a-f]{6}|[0-9a-f]{3,4})(?![\w-])|\b0x[0-9a-f]{6}\b(?!\))|\b(?:rgba?|hsla?)\(\s*\d/gi);
      return found ? [`${file}:${i + 1}: ${found.join(" ")}`] : [];
    }),
  );
}

const palette = readFileSync(path.join(sourceDir, "web/src/palette.css"), "utf8");
const known = new Set([...palette.matchAll(/^ {2}(--[\w-]+):/gm)].map((m) => m[1]));
const style = readFileSync(path.join(sourceDir, "web/style.css"), "utf8");
const set = new Set([...style.matchAll(/(--[\w-]+):/g)].map((m) => m[1]));
const missing = [...style.matchAll(/var\((--[\w-]+)\)/g)].map((m) => m[1]).filter((name) => !known.has(name) && !set.has(name) && name !== "--tip");
assert.deepEqual(missing, [], "every colour that is used is in the palette");
assert.deepEqual(literals().filter((l) => !l.includes("0x010101") && !l.includes("protocol.ts")), [], "no colour stands outside the palette");
console.log("ok     every colour is in the palette");

if (!browserPath) process.exit(0);
const { chromium } = createRequire(path.join(webDir, "package.json"))("playwright-core");
mkdirSync(outDir, { recursive: true });
const check = (good, what) => {
  assert.ok(good, what);
  console.log(`ok     ${what}`);
};

/** Relative brightness of an element's ground. */
const ground = (page, id) => page.locator(id).evaluate((e) => {
  const c = getComputedStyle(e).backgroundColor.match(/[\d.]+/g).map(Number);
  return (c[0] + c[1] + c[2]) / 765;
});

async function look(page, name) {
  for (const find of [contrastFaults, layoutFaults]) {
    const faults = await page.evaluate(find);
    check(faults.length === 0, `${name}: ${find.name} ${faults.slice(0, 6).join("\n       ")}`);
  }
  await picture(page, path.join(outDir, `${name}.png`));
}

const mock = await startMock({ webDir, list: exams() });
const browser = await openBrowser(chromium);
try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, reducedMotion: "reduce", colorScheme: "dark" });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(`${mock.address}?quality=low`);
  await ready(page);
  if (await page.locator("#start[open]").count()) await page.keyboard.press("Escape");
  check((await ground(page, "#thigh")) < 0.2, "the theme is the system's: dark");
  await page.emulateMedia({ colorScheme: "light" });
  await page.waitForFunction(() => document.getElementById("theme-button").textContent === "Dark");
  check((await ground(page, "#thigh")) > 0.8, "and follows it: light");
  check((await ground(page, "#echo-box")) < 0.05, "a picture stays on black");
  await look(page, "light_1280");
  await page.emulateMedia({ colorScheme: "dark" });
  await page.locator("#theme-button").click();
  check((await ground(page, "#thigh")) > 0.8, "the switch chooses the other theme");
  await page.reload();
  await ready(page);
  check((await ground(page, "#thigh")) > 0.8, "and it is kept");
  if (await page.locator("#start[open]").count()) await look(page, "light_start"), await page.keyboard.press("Escape");
  await page.locator("#colour").click();
  await page.locator("#pulsed").click();
  await page.waitForFunction(() => window.sonde.spectrum?.columns > 50);
  await look(page, "light_duplex");
  // A projector with the browser's type at 125 %, and tablets.
  for (const [name, width, height] of [["light_large_type", 1024, 576], ["light_tablet", 820, 1180], ["light_tablet_wide", 1180, 820]]) {
    await page.setViewportSize({ width, height });
    await page.waitForFunction((w) => innerWidth === w && document.getElementById("scene").clientWidth > 0, width);
    await look(page, name);
  }
} finally {
  await browser.close();
  mock.close();
}
process.exit(0);
