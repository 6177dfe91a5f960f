// Files of a kept exam, downloaded from the page with the real program behind it: each sequence is, byte for
// byte, what `sonde replay --sequence` writes; the worksheet's files are those of the exam's directory; none is
// given to who has not its address; a cancelled export and one that is over leave no file.
// Usage: export_test.mjs SONDE EXAM_ONCE MODEL LIBRARY WEB_DIR
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { addressOf, browserPath, openBrowser, PATIENCE_MS, picture, ready } from "./drive.mjs";
import { FEW_IMAGES, startRun } from "./program.mjs";

const [sonde, examOnce, model, library, web] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
const work = mkdtempSync(join(tmpdir(), "sonde-export-"));
const [exams, protocols] = ["exams", "protocols"].map((name) => join(work, name));
let checks = 0;
const check = (condition, what) => {
  assert.ok(condition, what);
  checks += 1;
  console.log(`ok ${what}`);
};

/** A short exam with a worksheet, in two positions of the patient. */
function examine() {
  mkdirSync(exams);
  mkdirSync(protocols);
  writeFileSync(join(protocols, "two.yaml"), "sonde_protocol: 1\nid: two\ntitle: Two\ntext: Two.\nplaces:\n- {title: Groin, at: {station: common_femoral}}\n- {title: Knee, at: {station: popliteal}, position: prone_bent}\n");
  const env = { ...process.env, EXAM_ONCE_DIR: exams, EXAM_ONCE_MODEL: model, EXAM_ONCE_CASES: join(library, "cases"), EXAM_ONCE_PROTOCOLS: protocols, EXAM_ONCE_SECONDS: "0.2", EXAM_ONCE_TICKS: "200", EXAM_ONCE_ROOM_AFTER: "60", EXAM_ONCE_SHEET: "1" };
  const told = execFileSync(examOnce, ["run"], { env, encoding: "utf8" });
  check(told.includes("kept\nscored"), "an exam is kept");
  return readdirSync(exams, { withFileTypes: true }).find((e) => e.isDirectory()).name;
}

async function download(page, name) {
  const link = page.locator("#export .files a", { hasText: name });
  await link.waitFor({ timeout: PATIENCE_MS });
  const [file] = await Promise.all([page.waitForEvent("download", { timeout: PATIENCE_MS }), link.click()]);
  return { bytes: readFileSync(await file.path()), called: file.suggestedFilename(), link: await link.getAttribute("href") };
}

const exported = (directory) => readdirSync(directory).filter((name) => name.startsWith("export-"));

async function main() {
  const id = examine();
  const directory = join(exams, id);
  const running = await startRun(sonde, ["--port", "0", "--exams", exams, "--protocols", protocols, ...FEW_IMAGES]);
  const at = `http://127.0.0.1:${running.learner.port}`;
  const browser = await openBrowser(chromium);
  const page = await browser.newPage({ viewport: { width: 1024, height: 700 }, acceptDownloads: true });
  page.setDefaultTimeout(PATIENCE_MS);
  const errors = [];
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  page.on("pageerror", (e) => errors.push(String(e)));
  await page.goto(addressOf(running.learner, "?quality=low"));
  await ready(page);
  await page.locator("#start[open]").waitFor();
  await page.keyboard.press("Escape");
  await page.locator("#exams-button").click();
  await page.locator("#exams").getByRole("button", { name: /^Files of/ }).first().click();
  for (const [part, recording, ending] of [[1, "exam.rec", "igs.mha"], [2, "exam-2.rec", "seq.nrrd"], [1, "exam.rec", "dcm"]]) {
    const own = join(work, `own-${part}.${ending}`);
    execFileSync(sonde, ["replay", join(directory, recording), "--sequence", own, "--cases", join(library, "cases")]);
    await page.locator("#export select").selectOption(String(part));
    await page.locator(`#export button[data-what="${ending}"]:enabled`).click();
    const file = await download(page, `export-${part}.${ending}`);
    check(file.bytes.equals(readFileSync(own)), `part ${part} as ${ending}: the ${file.bytes.length} bytes of the command line`);
    check(file.called === `${id}-${part}.${ending}`, `it is called ${file.called}`);
    const stranger = await fetch(new URL(file.link.split("?")[0], at));
    const other = await fetch(new URL(file.link.replace(/key=./, (key) => (key === "key=0" ? "key=1" : "key=0")), at));
    check(stranger.status === 401 && other.status === 401, "but not without its key");
    check(exported(directory).length === 1, "one export is kept");
  }
  await picture(page, join(work, "export.png"));
  const names = readdirSync(directory).filter((name) => /^worksheet.*\.(dcm|csv|json)$/.test(name));
  check(names.includes("worksheet.dcm") && names.includes("worksheet-1.dcm"), `the worksheet has ${names.join(", ")}`);
  for (const name of names) {
    const link = await page.locator("#export .files a", { hasText: new RegExp(`^${name.replaceAll(".", "\\.")}$`) }).getAttribute("href");
    const bytes = Buffer.from(await (await fetch(new URL(link, at))).arrayBuffer());
    check(bytes.equals(readFileSync(join(directory, name))), `${name} is that of the exam`);
    check((await fetch(new URL(link.split("?")[0], at))).status === 401, "and not for everyone");
  }
  // Cancelled, or over before that: there is no file of a part, and the next export is taken.
  await page.locator("#export select").selectOption("2");
  await page.locator('#export button[data-what="igs.mha"]:enabled').click();
  const cancel = page.locator("#export").getByRole("button", { name: "Cancel" });
  const file = page.locator("#export .files a", { hasText: "export-2.igs.mha" });
  await cancel.or(file).first().waitFor();
  if (await cancel.isVisible()) await cancel.click({ timeout: 1000 }).catch(() => {});
  await page.locator('#export button[data-what="dcm"]:enabled').waitFor();
  check(exported(directory).length === ((await file.count()) ? 1 : 0), "a cancelled export leaves no file");
  check(errors.length === 0, `no console error ${errors.join("; ")}`);
  await browser.close();
  running.interrupt();
  await running.ended;
  check(exported(directory).length === 0, "with the program the export goes");
  rmSync(work, { recursive: true });
  console.log(`${checks} checks`);
}

main().then(
  () => process.exit(0),
  (problem) => {
    console.error(problem);
    process.exit(1);
  },
);
