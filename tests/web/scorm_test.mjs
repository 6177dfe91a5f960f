// The package of SCORM 1.2 in a learning management system of this test's own, whose interface takes only what the
// run-time environment of SCORM 1.2 (ADL 2001) defines: the class opens and is joined from there, exams that end come
// back as score, result and interactions, the best one stands, and a second attempt goes on where the first ended.
// The class is the real one; the learner's program is one that only says how it is, and exams are put into the log.
// Usage: scorm_test.mjs SONDE FAKE_LEARNER WEB_DIR
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { browserPath, openBrowser, PATIENCE_MS, picture } from "./drive.mjs";

const [sonde, fake, web] = process.argv.slice(2).map((p) => resolve(p));
if (!browserPath) {
  console.log("skipped: no Chromium");
  process.exit(77);
}
const { chromium } = createRequire(join(web, "package.json"))("playwright-core");
const directory = mkdtempSync(join(tmpdir(), "sonde-scorm-"));
process.on("exit", () => rmSync(directory, { recursive: true, force: true }));
const check = (condition, what) => {
  assert.ok(condition, what);
  console.log(`ok ${what}`);
};
const exams = join(directory, "exams");

// ---- a class, and its log

async function startClass() {
  execFileSync("mkdir", [exams]);
  execFileSync(sonde, ["exam", "--recover", exams], { stdio: "ignore" }); // makes a log without exams
  const port = 20000 + (process.pid % 15000);
  const child = spawn(sonde, ["class", "--learners", "1", "--port", String(port), "--program", fake, "--listen", "127.0.0.1:0", "--data", join(directory, "data"), "--scorm", join(directory, "class.zip"), "--", "--exams", exams], {
    stdio: ["ignore", "pipe", "inherit"],
    cwd: directory, // the program leaves the number of its process there
  });
  process.on("exit", () => child.kill("SIGINT"));
  let said = "";
  child.stdout.on("data", (text) => (said += text));
  while (!/^SCORM 1\.2: /m.test(said)) {
    assert.ok(child.exitCode === null, "sonde class has ended");
    await new Promise((done) => setTimeout(done, 100));
  }
  return { child, address: /^Join at: (\S+)$/m.exec(said)[1], code: /^Code: (\S+)$/m.exec(said)[1] };
}

function addExam(trainee, score, passed) {
  const script = `import datetime, sqlite3, sys
log = sqlite3.connect(sys.argv[1], timeout=60)
now = datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
row = {"id": f"{now}-{sys.argv[3]}", "trainee": sys.argv[2], "case_id": "c", "case_title": "A sore calf", "protocol": "two_point", "guidance": "full",
       "date": now, "score": float(sys.argv[3]), "passed": int(sys.argv[4]), "correct": int(sys.argv[4]), "seconds": 3723.5}
columns = [r[1:3] for r in log.execute("PRAGMA table_info(exams)")][1:]
log.execute(f"INSERT INTO exams ({','.join(c for c, _ in columns)}) VALUES ({','.join('?' * len(columns))})", [row.get(c, "" if k == "TEXT" else 0) for c, k in columns])
log.commit()`;
  execFileSync("python3", ["-c", script, join(exams, "exams.sqlite"), trainee, String(score), passed ? "1" : "0"]);
}

// ---- a learning management system

// What a page may set, by SCORM 1.2's data model, and the form of each value.
const TIMESPAN = "^\\d{2,4}:\\d{2}:\\d{2}(\\.\\d{1,2})?$";
const SETTABLE = {
  "^cmi\\.core\\.lesson_status$": "^(passed|completed|failed|incomplete|browsed)$",
  "^cmi\\.core\\.score\\.(raw|min|max)$": "^(100(\\.0+)?|\\d{1,2}(\\.\\d+)?)$",
  "^cmi\\.core\\.exit$": "^(time-out|suspend|logout|)$",
  "^cmi\\.core\\.session_time$": TIMESPAN,
  "^cmi\\.suspend_data$": "^[\\s\\S]{0,4096}$",
  "^cmi\\.interactions\\.\\d+\\.id$": "^[0-9A-Za-z_]{1,255}$",
  "^cmi\\.interactions\\.\\d+\\.type$": "^(true-false|choice|fill-in|matching|performance|sequencing|likert|numeric)$",
  "^cmi\\.interactions\\.\\d+\\.student_response$": "^[\\s\\S]{0,255}$",
  "^cmi\\.interactions\\.\\d+\\.result$": "^(correct|wrong|unanticipated|neutral|-?\\d+(\\.\\d+)?)$",
  "^cmi\\.interactions\\.\\d+\\.latency$": TIMESPAN,
};

const FRAME = `<!doctype html><title>LMS</title><script>
const settable = ${JSON.stringify(SETTABLE)};
const data = { "cmi.core.student_name": "Lovelace, Ada", "cmi.core.lesson_status": "not attempted", "cmi.core.score.raw": "", "cmi.suspend_data": "", ...JSON.parse(sessionStorage.getItem("attempt") ?? "{}"), "cmi.launch_data": LAUNCH };
window.data = data;
window.wrong = [];
window.stage = "none";
const live = (call) => window.stage === "begun" || window.wrong.push(call + " while " + window.stage);
const count = () => Object.keys(data).filter((e) => /interactions\\.\\d+\\.id$/.test(e)).length;
window.API = {
  LMSInitialize(none) { if (window.stage !== "none" || none !== "") window.wrong.push("LMSInitialize"); window.stage = "begun"; return "true"; },
  LMSGetValue(element) { live(element); if (element === "cmi.interactions._count") return String(count()); if (!(element in data)) window.wrong.push("get " + element); return data[element] ?? ""; },
  LMSSetValue(element, value) {
    live(element);
    const form = Object.entries(settable).find(([name]) => new RegExp(name).test(element))?.[1];
    const at = /interactions\\.(\\d+)\\./.exec(element);
    if (!form || typeof value !== "string" || !new RegExp(form).test(value) || (at && Number(at[1]) > count())) window.wrong.push("set " + element + " " + value);
    data[element] = value;
    return "true";
  },
  LMSCommit(none) { live("LMSCommit"); sessionStorage.setItem("attempt", JSON.stringify(data)); return "true"; },
  LMSFinish(none) { live("LMSFinish"); window.stage = "ended"; return "true"; },
};
</script><iframe src="/sco/index.html" style="width:700px;height:560px"></iframe>`;

async function startLms(address) {
  const read = (name) => execFileSync("python3", ["-c", "import sys, zipfile; sys.stdout.buffer.write(zipfile.ZipFile(sys.argv[1]).read(sys.argv[2]))", join(directory, "class.zip"), name], { maxBuffer: 1 << 24 });
  const launch = /<adlcp:datafromlms>(.*)<\/adlcp:datafromlms>/.exec(read("imsmanifest.xml").toString())[1];
  assert.equal(launch, address);
  const page = read("index.html");
  const server = createServer((request, answer) => {
    answer.setHeader("Content-Type", "text/html; charset=utf-8");
    answer.end(request.url === "/" ? FRAME.replace("LAUNCH", JSON.stringify(launch)) : page);
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  process.on("exit", () => server.close());
  return `http://127.0.0.1:${server.address().port}/`;
}

// ---- the test

const holds = (page, element, value) => page.waitForFunction(([e, v]) => window.data[e] === v, [element, value]);
const told = (page) => page.evaluate(() => ({ stage: window.stage, wrong: window.wrong, interactions: window.API && Object.keys(window.data).filter((e) => /interactions\.\d+\.result$/.test(e)).map((e) => window.data[e]) }));

const room = await startClass();
const lms = await startLms(room.address);
const browser = await openBrowser(chromium);
const context = await browser.newContext({ ignoreHTTPSErrors: true });
context.setDefaultTimeout(PATIENCE_MS);
const errors = [];
context.on("page", (page) => page.on("pageerror", (e) => errors.push(String(e))));

const alone = await context.newPage();
await alone.goto(`${lms}sco/index.html`);
await alone.getByText("no SCORM 1.2 interface was found").waitFor();
check(true, "outside of a learning management system the page says that it belongs into one");
await alone.close();

const page = await context.newPage();
await page.goto(lms);
let sco = page.frameLocator("iframe");
await holds(page, "cmi.core.lesson_status", "incomplete");
check((await sco.locator("#address").inputValue()) === room.address, "the class's address comes from the package");
await sco.locator("#address").fill("http://127.0.0.1/");
await sco.getByRole("button", { name: "Open the class" }).click();
await sco.getByText("begins with https://").waitFor();
await sco.locator("#address").fill(room.address);
const opened = context.waitForEvent("page");
await sco.getByRole("button", { name: "Open the class" }).click();
const learner = await opened;
await sco.getByText("Waiting for you to join").waitFor();
check((await learner.locator("#name").inputValue()) === "Ada Lovelace", "the learner's name comes from the system");
await learner.locator("#code").fill(room.code);
await learner.getByRole("button", { name: "Join", exact: true }).click();
await sco.getByText("Connected").waitFor();
check(true, "who joins is followed by the ticket");

addExam("Ada Lovelace", 40.25, false);
await holds(page, "cmi.core.score.raw", "40.3");
await holds(page, "cmi.core.lesson_status", "failed");
addExam("Somebody Else", 99, true);
addExam("Ada Lovelace", 88, true);
await holds(page, "cmi.core.lesson_status", "passed");
addExam("Ada Lovelace", 93, false);
await sco.locator("li").nth(2).waitFor();
await picture(page, "/tmp/scorm.png");
let is = await told(page);
check((await page.evaluate(() => window.data["cmi.core.score.raw"])) === "88.0", "a failed exam does not replace one that was passed");
assert.deepEqual(is.interactions, ["wrong", "correct", "wrong"]);
check((await page.evaluate(() => window.data["cmi.interactions.1.latency"])) === "0001:02:03.50", "every exam of the learner is an interaction, others' are not");
await page.locator("iframe").evaluate((frame) => (frame.src = "about:blank"));
await page.waitForFunction(() => window.stage === "ended");
is = await told(page);
assert.deepEqual(is.wrong, []);
check(true, "the attempt ends when the page goes, and all it said is of SCORM 1.2's data model");

addExam("Ada Lovelace", 95, true);
await page.reload();
sco = page.frameLocator("iframe");
await sco.getByRole("button", { name: "Open the class" }).click();
await holds(page, "cmi.core.score.raw", "95.0");
is = await told(page);
assert.deepEqual([is.interactions, is.wrong], [["wrong", "correct", "wrong", "correct"], []]);
check(true, "a second attempt takes what came meanwhile, once");
assert.deepEqual(errors, []);
await browser.close();
room.child.kill("SIGINT");
process.exit(0);
