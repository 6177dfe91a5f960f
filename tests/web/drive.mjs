// What tests and pictures of the page do with it: open a browser, wait, move, press.
import { existsSync } from "node:fs";

/** How long a condition may take on a busy machine; one that never comes must not use up the time of all tests. */
export const PATIENCE_MS = 300000;

export const browserPath = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].find(existsSync);

/** Between two looks at a condition: Playwright's own look at every picture keeps the browser drawing pictures in which nothing has changed. */
const LOOK_MS = 50;

/** What the browser leaves undone: first what Playwright leaves out itself, since only the last such list counts; then the pages behind the
 *  address bar, which every new window would load unseen, in a process of their own that costs as much as the simulator's page. */
const WITHOUT = ["AcceptCHFrame", "AvoidUnnecessaryBeforeUnloadCheckSync", "DestroyProfileOnBrowserClose", "DialMediaRouteProvider", "GlobalMediaControls", "HttpsUpgrades", "LensOverlay",
  "MediaRouter", "PaintHolding", "ThirdPartyStoragePartitioning", "Translate", "AutoDeElevate", "WebUIOmniboxPopup", "WebUIOmniboxAimPopup", "WebUIOmniboxFullPopup"];

/** Speaks English, whatever the machine does, unless a context names another locale. */
export async function openBrowser(chromium, more = [], program = null) {
  const args = ["--lang=en-US", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync", `--disable-features=${WITHOUT.join(",")}`];
  const browser = await chromium.launch({ executablePath: program || browserPath, args: [...args, ...more] });
  const newContext = browser.newContext.bind(browser);
  browser.newContext = async (options) => {
    const context = await newContext(options);
    context.on("page", (page) => {
      const wait = page.waitForFunction.bind(page);
      page.waitForFunction = (condition, arg, how = {}) => wait(condition, arg, { polling: LOOK_MS, ...how });
    });
    return context;
  };
  return browser;
}

/** The address that the program prints, in its parts; null when the text has none. */
export function findAddress(text) {
  const found = /(http:\/\/127\.0\.0\.1:(\d+)\/)#([0-9a-f]{32})/.exec(text);
  return found && { origin: found[1], port: Number(found[2]), token: found[3] };
}

/** What to open: the address with a query. */
export const addressOf = (at, query = "") => `${at.origin}${query}#${at.token}`;

export const ready = (page) => page.waitForFunction(() => (window.sonde?.frames ?? 0) > 2 && window.sonde.exam !== null);

/** From the course to the single exams of the start, where there is a course. */
export async function singleExams(page) {
  await page.locator("#start[open]").waitFor();
  const tab = page.locator("#tab-exams");
  if (await tab.isVisible()) await tab.click();
}

/** Writes what the page shows, for people to look at, when SONDE_TEST_PICTURES is set: drawing it costs seconds. */
export const picture = async (page, path, more = {}) => {
  if (process.env.SONDE_TEST_PICTURES) await page.screenshot({ path, ...more });
};

/** Puts the probe, lifted, onto the target by dragging there. */
export async function goTo(page) {
  await page.waitForFunction(() => window.sonde.exam.step.target !== null);
  for (;;) {
    const at = await page.evaluate(() => window.sonde.targetOnScreen());
    const box = await page.locator("#scene").boundingBox();
    await page.mouse.click(box.x + at[0], box.y + at[1]);
    // Ends when the probe is there, or after 3 s of the simulation.
    const start = await page.evaluate(() => window.sonde.snapshot.tick);
    const outcome = await page.waitForFunction((t) => {
      const { target, offset_mm } = window.sonde.exam.step;
      if (target && offset_mm !== null && offset_mm <= target.radius_mm) return "there";
      return window.sonde.snapshot.tick > t + 3000 ? "not there" : null;
    }, start);
    if ((await outcome.jsonValue()) === "there") return;
  }
}

/** Puts the patient in the position that the next place asks for, if it asks. */
export async function turnPatient(page) {
  const position = await page.evaluate(() => window.sonde.exam.step.position ?? "");
  if (!position) return;
  await page.locator("#position").selectOption(position);
  await page.waitForFunction((p) => window.sonde.hello.limb?.position === p && window.sonde.exam.position === p && window.sonde.exam.step.target !== null, position);
}

/** Turns the probe by keys as the page asks, until it lies across the vein: once round at most. */
export async function turnAcross(page) {
  const angle = () => page.evaluate(() => window.sonde.exam.step);
  let key = "e";
  let before = await angle();
  for (let turns = 0; turns < 72 && before.target && before.angle_ok === false; ++turns) {
    const start = await page.evaluate(() => window.sonde.snapshot.tick);
    await page.keyboard.press(key);
    await page.waitForFunction((t) => window.sonde.snapshot.tick > t + 400, start);
    const now = await angle();
    if (now.angle_deg > before.angle_deg) key = key === "e" ? "q" : "e";
    before = now;
  }
}

/** Presses to a depth and lets go; waits until the press is counted. */
export async function pressAndRelease(page, depth_mm) {
  const before = await page.evaluate(() => window.sonde.exam.presses.length);
  await page.evaluate((d) => window.sonde.setDepth(d), depth_mm);
  await page.waitForFunction((d) => window.sonde.snapshot.penetration_mm > d - 1, depth_mm);
  await page.evaluate(() => window.sonde.setDepth(-8));
  await page.waitForFunction((n) => window.sonde.exam.presses.length > n, before);
}

/** Exams of two learners over some days. */
export function exams() {
  const rows = [
    ["Lea", "first_walk", "First walk", 34, false], ["Lea", "first_walk", "First walk", 52, false], ["Lea", "runner", "The runner", 61, false],
    ["Tim", "first_walk", "First walk", 40, false], ["Lea", "after_hip", "After the new hip", 58, false], ["Lea", "long_drive", "A long drive", 77, true],
    ["Lea", "old_story", "An old story", 84, true], ["Lea", "partial", "Half a day", 91, true],
  ];
  return rows.map(([trainee, id, title, score, passed], i) => ({ id: `old-${i}`, trainee, case: id, title, date: new Date(Date.UTC(2026, 10, 10 + i, 9, 12)).toISOString(),
    protocol: i < 4 ? "two_point" : "extended", score, passed, seconds: 420 - 31 * i, report: `/report/old-${i}`, recording: false })).reverse();
}
