// Takes the picture of the README: the page at 1600 x 900, pressed at site 27 until the healthy vein
// is nearly closed. Usage: node screenshot.mjs SONDE MODEL WEB_BUILD_DIR OUT.png [DEPTH_MM]
import { createRequire } from "node:module";
import path from "node:path";
import { addressOf } from "./drive.mjs";
import { startRun } from "./program.mjs";

const [, , program, model, webDir, out, depth] = process.argv;
const { chromium } = createRequire(path.resolve(webDir, "package.json"))("playwright-core");
const sonde = await startRun(program, [model, "--port", "0"]);
const browser = await chromium.launch({
  executablePath: "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--disable-background-networking"],
});
const page = await browser.newPage({ viewport: { width: 1600, height: 900 } });
await page.goto(addressOf(sonde.learner, "?site=27&depth=0"));
await page.waitForFunction(() => (window.sonde?.frames ?? 0) > 3);
let at = 0;
const closed = () => page.evaluate(() => window.sonde.snapshot.vein_area_ratio < 0.12);
while (depth ? at < Number(depth) : at < 44 && !(await closed())) {
  at = Math.min(at + 0.5, depth ? Number(depth) : 44);
  await page.evaluate((d) => window.sonde.setDepth(d), at);
  await page.waitForFunction((d) => Math.abs(window.sonde.snapshot.penetration_mm - d) < 0.2, at);
  await page.waitForTimeout(350);
}
await page.waitForTimeout(2500);
console.log(at, await page.evaluate(() => JSON.stringify(window.sonde.snapshot)));
await page.screenshot({ path: out });
await browser.close();
sonde.interrupt();
