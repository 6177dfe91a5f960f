// The case editor with the real program: a teacher writes a case, points at a vein, checks, keeps, shares, opens and
// tries it, by pointer and by keyboard alone; a learner may not; nothing is overwritten unasked, and a full disk loses
// nothing. Usage: editor_test.mjs SONDE WEB_DIR OUT_DIR DISK_FAULTS CASES_DIR
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

const [sonde, web, out, faults, cases] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const MOST_BYTES = 12288; // of a message with a case
const MOST_CASES = 100; // of one's own
const TAP_BESIDE_PX = 20; // more than the 14 of a mouse, less than the 28 of a finger
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
mkdirSync(out, { recursive: true });
const home = mkdtempSync(join(tmpdir(), "sonde-editor-"));
const own = join(home, "own");
process.on("exit", () => rmSync(home, { recursive: true, force: true }));
for (const signal of ["SIGINT", "SIGTERM"]) process.once(signal, () => process.exit(1));
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
  const error = new Promise((done, fail) => {
    const limit = setTimeout(() => fail(new Error(`a learner's edit is not answered; heard ${heard.join(" ").slice(0, 400)}`)), PATIENCE_MS);
    learner.heard = (m) => {
      heard.push(JSON.stringify(m));
      if (m.type === "error") clearTimeout(limit), done(m.message);
    };
  });
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

/** A finger beside the vein, farther than a mouse may be. */
async function tap(page, share) {
  const [at, ahead] = await page.evaluate((s) => [s, s + 0.01].map((one) => window.sonde.vesselOnScreen(2, one)), share);
  const [u, v] = [ahead[0] - at[0], ahead[1] - at[1]];
  const beside = TAP_BESIDE_PX / Math.hypot(u, v);
  const box = await page.locator("#scene").boundingBox();
  const devtools = await page.context().newCDPSession(page);
  await devtools.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [{ x: box.x + at[0] - beside * v, y: box.y + at[1] + beside * u }] });
  await devtools.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
  await devtools.detach();
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
  const seed = await page.locator("#editor-seed").inputValue();
  await page.locator("#editor-another").click();
  check((await told(page)).good && (await page.locator("#editor-seed").inputValue()) !== seed, "another leg is drawn, and made");
  await page.locator("#editor-seed").fill("5425");
  await page.locator("#editor-side").selectOption("left");
  await page.locator("#editor-bmi").fill("23");
  await inspect(page, "leg");
  check((await checked(page)).good && (await page.evaluate(() => window.sonde.hello.limb.side)) === "left", "the leg that is shown is the one of the case");
}

async function point(page) {
  await tab(page, "findings");
  await page.locator("#editor-point").click();
  await click(page, 0.4);
  await page.waitForFunction(() => document.getElementById("editor-point").textContent.includes("ends"));
  await tap(page, 0.52);
  await page.locator("#editor-clot-0-stage").waitFor();
  await page.locator("#editor-clot-0-stage").selectOption("chronic_occlusive");
  await page.locator("#editor-point").click();
  await page.keyboard.press("Escape");
  check((await page.locator("#editor-point").getAttribute("aria-pressed")) === "false" && !(await page.evaluate(() => window.sonde.controls.stop)), "Escape ends pointing, and stops nothing");
  const ends = await Promise.all(["from", "to"].map((key) => page.locator(`#editor-clot-0-${key}`).inputValue()));
  check(Math.abs(Number(ends[0]) - 40) < 2 && Math.abs(Number(ends[1]) - 52) < 2, `a click on the vein and a tap near it place a clot: ${ends.join(" to ")} %`);
  // Pressed twice, and written on while the program looks at it.
  const asked = page.asked;
  await page.evaluate(() => {
    for (let n = 0; n < 2; ++n) document.getElementById("editor-check").click();
    const ends = document.getElementById("editor-clot-0-to");
    ends.value = "53";
    ends.dispatchEvent(new Event("input"));
    ends.dispatchEvent(new Event("change"));
  });
  await page.waitForFunction(() => document.getElementById("editor-check").getAttribute("aria-disabled") === "false");
  check(page.asked === asked + 1, `two presses ask once: ${page.asked - asked}`);
  check((await page.locator("#editor-state").textContent()).startsWith("Not checked") && (await page.locator("#editor-clot-0-to").inputValue()) === "53", "an answer to an older text changes nothing, and calls nothing right");
  const draft = await checked(page);
  check(draft.good, `the answer follows the findings: ${draft.message}`);
  await inspect(page, "findings");
  // What is added and removed again leaves the case as it was.
  const before = await page.evaluate(() => sessionStorage.getItem("sonde.draft"));
  await page.locator("#editor-lesion").click();
  await page.locator("#editor-add").selectOption("great_saphenous");
  await page.locator("#editor-put").click();
  const more = await page.evaluate(() => sessionStorage.getItem("sonde.draft"));
  check(more.includes("kind: node") && more.includes("branch: great_saphenous") && (await page.locator(".editor-card").count()) === 3, "a lesion and a vein's clot are added");
  await page.locator("#editor-clot-1-drop").click();
  await page.locator("#editor-lesion-0-drop").click();
  const after = await page.evaluate(() => sessionStorage.getItem("sonde.draft"));
  check(after.replace(/^findings: \{\}\n/m, "") === before, "and removed");
  await tab(page, "answer");
  check((await told(page)).good, "the answer is asked for where it is read");
  check((await page.locator("#editor-thrombosis").inputValue()) === "true", "it is a thrombosis");
  check((await page.locator("#editor-diagnosis").inputValue()).startsWith("Chronic occlusive clot: femoral vein"), "the diagnosis says so");
  await inspect(page, "answer");
}

/** What the program says against is marked at its field, from whatever part it is asked. */
async function wrongField(page) {
  await tab(page, "leg");
  await page.locator("#editor-bmi").fill("99");
  await tab(page, "case");
  check(!(await checked(page)).good, "a body mass index of 99 is refused");
  check((await page.locator("#editor-state").textContent()).endsWith("bmi must be a number from 15 to 45, not 99"), "with a sentence");
  await page.locator("#editor-go").click();
  check(await page.evaluate(() => document.activeElement.id === "editor-bmi" && document.activeElement.getAttribute("aria-invalid") === "true"), "and its field");
  await inspect(page, "wrong");
  await page.locator("#editor-bmi").fill("23");
  await tab(page, "answer");
  await page.locator("#editor-follows").uncheck();
  await page.locator("#editor-truth-femoral_mid").selectOption("compressible");
  check(!(await checked(page)).good && (await page.locator("#editor-go").count()) === 1, "an answer that denies its findings is refused");
  const marked = () => page.evaluate(() => document.querySelector("#editor [aria-invalid=true]")?.id);
  check((await marked()) === "editor-thrombosis", `at the thrombosis first: ${await marked()}`);
  await page.locator("#editor-thrombosis").selectOption("false");
  const { message } = await checked(page);
  check((await marked()) === "editor-truth-femoral_mid" && message.includes("the truth calls femoral_mid compressible"), `then at its segment: ${message}`);
  await page.locator("#editor-follows").check();
  check((await checked(page)).good, "until it follows them again");
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
  await page.locator("#editor-other").click();
  check(await page.getByText("It is not saved").isVisible(), "another case is not chosen without a word about this one");
  await page.locator("#editor-back").click();
  check((await told(page)).good && (await page.locator("#editor-name").inputValue()) === "A better title", "which is there still");
  check((await checked(page, "save")).exists && (await checked(page, "save")).saved === file && readFileSync(file, "utf8").includes("A better title"), "until it is asked for");
  await page.locator("#editor-other").click();
  check((await page.locator("#editor-back").isVisible()) && (await page.getByText("It is not saved").isHidden()), "what is saved can be left without a word");
  await page.locator("#editor-back").click();
  await told(page);
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
  // Texts that would not end as forms, would not fit, or are no case.
  const strange = { "a: &a [x, x]\nb: *a": "refers to no other part", "findings: {branches: 3}": "cannot show", [written + "#".repeat(MOST_BYTES)]: "too long", "- 1": "list of keys" };
  for (const [odd, why] of Object.entries(strange)) {
    await page.locator("#editor-text").fill(odd);
    await page.locator("#editor-check").click();
    await page.waitForFunction(() => document.getElementById("editor-check").getAttribute("aria-disabled") !== "true");
    const said = await page.locator("#editor-state").textContent();
    check((await page.locator("#editor-tab-case").isDisabled()) || said.includes(why), `no form of ${odd.slice(0, 24).replace(/\n/g, " ")}: ${said}`);
  }
  const large = join(home, "exams", "large.yaml");
  writeFileSync(large, written + "#".repeat(MOST_BYTES));
  await page.locator("#editor-text").fill(written);
  check((await checked(page)).good, "and is mended in its text");
  await page.locator("#editor-other").click();
  await page.locator("#editor-file").setInputFiles(large);
  await page.waitForFunction(() => document.getElementById("editor-state").textContent.includes("too long"));
  check(await page.locator("#editor-new").isVisible(), "a file that is too large is not opened");
  await page.locator("[id^=editor-copy-]").first().click();
  check((await told(page)).good && (await page.locator("#editor-id").inputValue()).endsWith("-copy"), "a case of the program's is copied under another id");
  await page.locator("#editor-other").click();
  await page.locator("#editor-file").setInputFiles(file);
  await told(page);
  await tab(page, "text");
  await page.locator("#editor-text").fill(written);
  await checked(page);
}

/** A case from nothing to the disk without a pointer. */
async function byKeys(page) {
  const go = async (id) => {
    for (let n = 0; n < 90; ++n) {
      if (await page.evaluate((want) => document.activeElement?.id === want, id)) return;
      await page.keyboard.press("Tab");
    }
    assert.fail(`Tab does not reach ${id}`);
  };
  const press = async (id, key = "Enter") => {
    await go(id);
    await page.keyboard.press(key);
  };
  await press("edit-button");
  await press("editor-other");
  await press("editor-new");
  check((await told(page)).good, "by keyboard: a new case");
  await go("editor-id");
  await page.keyboard.press("Control+A");
  await page.keyboard.type("by-keys");
  await press("editor-tab-findings");
  await go("editor-add");
  await page.keyboard.press("ArrowDown");
  await press("editor-put");
  await go("editor-clot-0-to");
  await page.keyboard.press("Control+A");
  await page.keyboard.type("35");
  await press("editor-check");
  const draft = await told(page);
  check(draft.good, `a clot by the list and its percent: ${draft.message}`);
  check(await page.evaluate(() => document.activeElement.id === "editor-check"), "the focus stays where it was");
  await press("editor-save");
  await page.waitForFunction(() => window.sonde.draft?.saved);
  check(readFileSync(join(own, "by-keys.yaml"), "utf8").includes("thrombosis: true"), "kept");
  await press("editor-close");
  await page.waitForFunction(() => window.sonde.exam.phase === "practice");
}

/** A client with the teacher's address that asks without a page: `ask` gives the answer to an edit. */
async function teacherClient(at) {
  const client = new Client(at, true);
  let serial = 0;
  let heard = null;
  client.heard = (m) => (m.type === "draft" || m.type === "error") && heard?.(m);
  await client.open;
  const ask = (message, until = "draft") => {
    const of = ++serial;
    return new Promise((done) => {
      heard = (m) => (m.type === "error" || (m.type === until && m.serial === of)) && done(m);
      client.say({ type: "edit", serial: of, ...message });
    });
  };
  return { client, ask };
}

/** Who asks without the page: refused with a sentence, and the disk stays as it was, the more so when it is full. */
async function hostile() {
  const kept = join(home, "kept");
  mkdirSync(kept);
  const text = readFileSync(join(cases, "gastrocnemius.yaml"), "utf8");
  const named = (id) => text.replace("id: gastrocnemius", `id: ${id}`);
  for (let i = 0; i < MOST_CASES; ++i) writeFileSync(join(kept, `case-${i}.yaml`), named(`case-${i}`));
  writeFileSync(join(kept, "broken.yaml"), "sonde_case: 3\nid: [\n");
  writeFileSync(join(kept, "twice.yaml"), named("case-7"));
  const before = () => readdirSync(kept).sort().map((name) => [name, readFileSync(join(kept, name), "utf8")]);
  const first = JSON.stringify(before());
  const running = await startRun(sonde, ["--port", "0", "--exams", join(home, "exams"), "--own-cases", kept, ...FEW_IMAGES, ...onePlace()],
    { LD_PRELOAD: faults, DISK_FAULTS_UNDER: kept, DISK_FAULTS_AT: "2", DISK_FAULTS_HOW: "full" });
  const { client, ask } = await teacherClient(running.teacher);
  const save = (id, more = {}) => ask({ action: "save", text: named(id), ...more });
  const refusals = [
    ["one case more than are kept", await save("one-more"), `${MOST_CASES} cases`],
    ["a case that is there", await save("case-3"), "already"],
    ["an unreadable file of that name", await save("broken"), "already"],
    ["the same id in another file", await save("../case-3"), "expected a-z"],
    ["a full disk", await save("case-3", { replace: true }), "No space left"],
    ["an id of 300 letters", await save("x".repeat(300), { replace: true }), "id"],
    ["no text", await ask({ action: "save" }), "must be open with"],
    ["a text that is a number", await ask({ action: "save", text: 5 }), "must be open with"],
    ["no such action", await ask({ action: "delete", text }), "must be open with"],
    ["no such case", await ask({ action: "open", case: "../../etc/passwd" }), "no such case"],
    ["a model file", await ask({ action: "check", text: text.replace(/leg: \{.*\}/, "thigh: {model: /etc/passwd}") }), "model file"],
    ["a protocol that is not there", await ask({ action: "try", text: named("mine"), protocol: "none" }, "error"), "no protocol"],
  ];
  for (const [what, answer, why] of refusals) check(!answer.saved && answer.message.includes(why), `${what}: ${answer.message}`);
  const size = await new Promise((done) => {
    client.ended = done;
    client.say({ type: "edit", serial: 1, action: "check", text: "x".repeat(MOST_BYTES) });
  });
  check(size === 1009, "a message that is too long ends the connection");
  check(JSON.stringify(before()) === first, "no file was changed, none was added");
  running.interrupt();
  await running.ended;
}

/** Another leg comes into view: the case is not pointed at on it. */
async function another(page, at) {
  await tab(page, "findings");
  const written = () => page.evaluate(() => sessionStorage.getItem("sonde.draft"));
  const before = await written();
  const { client } = await teacherClient(at);
  client.say({ type: "edit", action: "close" });
  await page.waitForFunction(() => window.sonde.exam.phase === "practice");
  check((await page.locator("#editor-state").textContent()).startsWith("Not checked"), "the leg of the case is not in view any more");
  await page.locator("#editor-point").click();
  const box = await page.locator("#scene").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  check((await told(page)).good && (await written()) === before, "a click brings it back and places nothing");
  await page.waitForFunction(() => window.sonde.exam.phase === "edit");
  await page.locator("#editor-point").click();
  client.close();
}

async function tryIt(page, at) {
  await page.locator("#editor-try").click();
  await page.waitForFunction(() => window.sonde.exam.phase === "running" && window.sonde.controls.controls);
  const { title, step } = await page.evaluate(() => window.sonde.exam);
  check(title === "A better title" && step.target !== null, "an exam of the draft runs, and the teacher has the probe");
  const { client, ask } = await teacherClient(at);
  check((await ask({ action: "check", text: "" })).message.includes("an exam runs"), "no leg is put into an exam that runs");
  client.close();
  check(await page.locator("#edit-button").isHidden(), "nor is another case opened");
  check(await page.locator("#editor").isHidden() && (await page.locator("#echo-panel").isVisible()), "it looks like every exam");
  await page.getByRole("button", { name: "Leave", exact: true }).click();
  await page.waitForFunction(() => window.sonde.exam.phase === "edit" && window.sonde.draft?.good);
  check(await page.locator("#editor").isVisible(), "after it the case is written on");
  await tab(page, "case");
  await page.locator("#editor-note").fill("The newest words.");
  const kept = await text(page);
  await page.reload();
  await page.waitForFunction(() => window.sonde?.draft?.good);
  check(kept.includes("The newest words.") && (await text(page)) === kept, "a page that is loaded anew has all of it still");
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
  page.asked = 0; // messages of the editor
  page.on("websocket", (socket) => socket.on("framesent", ({ payload }) => (page.asked += /"type":"edit"/.test(payload))));
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  page.on("pageerror", (e) => errors.push(String(e)));
  await page.goto(addressOf(running.teacher, "?quality=low"));
  await ready(page);
  if (await page.locator("#start[open]").isVisible()) await page.keyboard.press("Escape");
  await write(page);
  await point(page);
  await wrongField(page);
  await keep(page);
  await share(page);
  check(heard.length > 5 && !heard.some((m) => /"draft"|test-case|my-case|chronic_occlusive/.test(m.replace(/"cases":\[[^\]]*\]/, ""))), "a learner hears nothing of the draft");
  learner.close();
  await another(page, running.teacher);
  await tryIt(page, running.teacher);
  await byKeys(page);
  check(errors.length === 0, `no console error ${errors.join("; ")}`);
  await browser.close();
  running.interrupt();
  await running.ended;
  await hostile();
}

main().then(
  () => process.exit(0),
  (problem) => {
    console.error(problem);
    process.exit(1);
  },
);
