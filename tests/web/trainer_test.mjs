// The page's trainer in a real browser against the mock: whole exams by pointer and by keyboard, each
// level of guidance, calipers, compare, replay, list, watching, a lost connection, and for every state
// names, contrast and layout. Usage: node trainer_test.mjs WEB_BUILD_DIR OUT_DIR
import { createRequire } from "node:module";
import { mkdirSync, statSync } from "node:fs";
import path from "node:path";
import { browserPath, exams, goTo, openBrowser, PATIENCE_MS, picture, ready } from "./drive.mjs";
import { contrastFaults, layoutFaults, nameFaults } from "./inspect.mjs";
import { startMock } from "./mock_server.mjs";
import { REFLUX_S } from "./mock_thigh.mjs";

const [, , webDir, outDir] = process.argv;
const SKIPPED = 77;
const CLOSED_MM = 15; // closes the mock's vein
const SMALL = { width: 1024, height: 700 };
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

const button = (page, name) => page.getByRole("button", { name, exact: true });
const exam = (page) => page.evaluate(() => window.sonde.exam);
const phase = (page, wanted) => page.waitForFunction((p) => window.sonde.exam.phase === p, wanted);

/** Names, contrast and layout of what is on the screen. */
async function inspect(page, state) {
  for (const [kind, find] of [["names", nameFaults], ["contrast", contrastFaults], ["layout", layoutFaults]]) {
    const faults = await page.evaluate(find);
    check(faults.length === 0, `${state}: ${kind}${faults.slice(0, 5).map((f) => `\n       ${f}`).join("")}`);
  }
}

async function testStart(page) {
  check(await page.locator("#start").isVisible(), "a new visit asks what to do");
  const offered = await page.locator(".cards.case .card").count();
  check(offered >= 12, "every case is offered");
  await page.locator("#tab-hard").click();
  const hard = await page.locator(".cards.case .card .level").allTextContents();
  check(hard.length > 0 && hard.length < offered && hard.every((text) => text === "Hard"), "only the cases of one level when asked");
  check((await page.locator(".cards.case input:checked").count()) === 1, "one of them is chosen");
  await page.locator("#tab-all").click();
  await page.locator(".cards.case .card").first().click();
  await inspect(page, "start");
}

/** Drags the press slider's thumb up until the probe is so deep. */
async function pressBySlider(page, depth_mm) {
  const box = await page.locator("#depth-slider").boundingBox();
  const y = (mm) => box.y + 16 + (box.height - 32) * (1 - (mm + 20) / 65);
  const now = await page.evaluate(() => window.sonde.depth);
  await page.mouse.move(box.x + box.width / 2, y(now));
  await page.mouse.down();
  for (const mm of [now, (now + depth_mm) / 2, depth_mm, depth_mm + 0.5]) {
    await page.mouse.move(box.x + box.width / 2, y(mm));
    await page.waitForTimeout(40);
  }
  await page.mouse.up();
  await page.waitForFunction((d) => window.sonde.snapshot.penetration_mm > d - 2.5, depth_mm);
}

async function testPointerExam(page) {
  await button(page, "Start the exam").click();
  await phase(page, "running");
  check(await page.locator("#practice-bar").isHidden(), "in an exam the veins to choose from are hidden");
  check(await page.locator("#coach").isVisible(), "a newcomer is told what to do first");
  await inspect(page, "guided exam");
  let pointed = false;
  for (let i = 0; i < 2; ++i) {
    await goTo(page);
    pointed ||= await page.locator("#target-label.reached").isVisible();
    await pressBySlider(page, CLOSED_MM);
    await page.waitForFunction(() => document.getElementById("compression").dataset.state === "complete");
    const before = (await exam(page)).presses.length;
    await page.locator("#ease").click();
    await page.waitForFunction((n) => window.sonde.exam.presses.length > n, before);
    if (i === 0) await picture(page, path.join(outDir, "guided.png"));
    await page.locator(".finding.compressible").click();
    await page.waitForFunction((n) => window.sonde.exam.segments.filter((s) => s.decision === "compressible").length === n, i + 1);
  }
  check(pointed, "the ring says that the probe is there");
  await page.locator("#finish-button").click();
  await inspect(page, "finish");
  await button(page, "Finish and see the result").click();
  await phase(page, "done");
  const result = (await exam(page)).result;
  check(result.passed && result.correct, `an exam by pointer passes: ${result.score}`);
  check((await page.locator("#result").textContent()).includes("Right diagnosis"), "the result says that the diagnosis is right");
  const shown = await page.locator("#result").textContent();
  check(shown.includes("What First walk teaches."), "the result shows what the case teaches");
  check(shown.includes("nothing lost") && shown.includes("Where points went"), "the result shows where points went");
  await inspect(page, "result");
  const [report] = await Promise.all([page.context().waitForEvent("page"), page.getByRole("link", { name: "Open the report" }).click()]);
  await report.waitForLoadState();
  check((await report.locator("h1").textContent()).includes("First walk"), "the report opens in a new tab");
  await report.close();
  await page.bringToFront();
}

async function testReplay(page) {
  await button(page, "Watch the replay").click();
  await page.waitForFunction(() => window.sonde.replay);
  const presses = (await page.evaluate(() => window.sonde.replay)).presses.length;
  check((await page.locator("#scrub-marks rect").count()) === presses && presses > 0, `the track has a mark for each of ${presses} presses`);
  const at = async (share) => {
    await page.locator("#scrub").evaluate((e, s) => {
      e.value = String(Number(e.max) * s);
      e.dispatchEvent(new Event("input"));
      e.dispatchEvent(new Event("change"));
    }, share);
    await page.waitForFunction((s) => Math.abs(window.sonde.replay.time_s - s * window.sonde.replay.duration_s) < 0.2, share);
    const frames = await page.evaluate(() => window.sonde.frames);
    await page.waitForFunction((n) => window.sonde.frames > n + 3, frames);
    return page.evaluate(() => [window.sonde.imageSum, window.sonde.snapshot.force_normal_n]);
  };
  const [early, late, again] = [await at(0.05), await at(0.5), await at(0.05)];
  check(early[0] !== late[0] && early[0] === again[0] && early[1] === again[1], "scrubbing back shows the same image and force");
  check(await page.locator("#depth-slider").isDisabled(), "in a replay nothing moves the probe");
  await page.locator("#comment-text").fill("Well <b>done</b>");
  await page.locator("#comment-author").fill("Dr. Keller");
  await button(page, "Add").click();
  await page.waitForFunction(() => window.sonde.replay.comments.length === 1);
  check((await page.locator("#comment-list li").textContent()).includes("Well <b>done</b>"), "a comment is shown as it was written");
  check((await page.locator("#scrub-marks path").count()) === 1, "a comment has its mark");
  await page.locator("#replay-play").click();
  await page.waitForFunction(() => window.sonde.replay.playing && window.sonde.replay.time_s > 0.5);
  await inspect(page, "replay");
  await page.locator("#replay-leave").click();
  await phase(page, "practice");
  await button(page, "My exams").click();
  await page.waitForFunction(() => document.querySelectorAll("#exams tbody tr, #exams table tr").length > 2);
  check((await page.locator("#exams circle").count()) > 2, "the learning curve has a point for each exam");
  await inspect(page, "my exams");
  await button(page, "Close").click();
}

/** Presses a key until a condition of the exam holds. */
async function keyUntil(page, key, condition, most = 20) {
  for (let i = 0; i < most; ++i) {
    if (await page.evaluate(condition)) return;
    const before = await page.evaluate(() => window.sonde.exam.elapsed_s);
    await page.keyboard.press(key);
    await page.waitForFunction((t) => window.sonde.exam.elapsed_s > t + 0.3, before);
  }
  throw new Error(`pressing ${key} does not lead there`);
}

async function testKeyboardExam(page) {
  await page.locator("#start-button").focus();
  await page.keyboard.press("Enter");
  await page.keyboard.press("Enter");
  await phase(page, "running");
  const offset = () => window.sonde.exam.step.offset_mm !== null && window.sonde.exam.step.offset_mm < 12;
  for (let point = 0; point < 2; ++point) {
    await page.waitForFunction(() => window.sonde.exam.step.target !== null);
    await page.keyboard.press("0");
    const by = await page.evaluate(() => window.sonde.exam.step.target.position_mm[2] - window.sonde.point[2]);
    for (let i = 0; i < Math.round(Math.abs(by) / 10); ++i) await page.keyboard.press(by > 0 ? "Shift+ArrowRight" : "Shift+ArrowLeft");
    await page.waitForFunction(offset);
    await keyUntil(page, "Shift+ArrowUp", () => window.sonde.exam.compression.state === "complete");
    const before = (await exam(page)).presses.length;
    await page.keyboard.press("0");
    await page.waitForFunction((n) => window.sonde.exam.presses.length > n, before);
    await page.keyboard.press("j");
    await page.waitForFunction(() => window.sonde.exam.segments.every((s) => s.done === 0 || s.decision !== ""));
  }
  await page.keyboard.press("Shift+Enter");
  await page.keyboard.press("Enter");
  await phase(page, "done");
  check((await exam(page)).result.passed, `an exam by keyboard alone passes: ${(await exam(page)).result.score}`);
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => window.sonde.replay !== null && window.sonde.exam.phase === "replay");
  await page.locator("#scene").focus();
  await page.keyboard.press("Shift+ArrowRight");
  await page.waitForFunction(() => window.sonde.replay.time_s > 2);
  check(true, "keys open and move the replay");
  await page.locator("#replay-leave").focus();
  await page.keyboard.press("Enter");
  await phase(page, "practice");
}

async function begin(page, guidance, caseName) {
  await button(page, "Start an exam").click();
  await page.getByRole("radio", { name: guidance }).check();
  await page.getByRole("radio", { name: caseName }).check();
  await page.locator("#start-go").click();
  await phase(page, "running");
}

const chosen = (page) => page.locator("#segments [aria-checked=true] .name").textContent();

/** The finding that the bar asks for is the one that is selected: first the segment pressed last. */
async function testAsked(page) {
  await begin(page, /^Full/, /^First walk/);
  const asked = (id) => page.waitForFunction((s) => window.sonde.exam.step.segment === s, id);
  for (const id of ["common_femoral", "popliteal"]) {
    await goTo(page);
    await pressBySlider(page, CLOSED_MM);
    await page.waitForFunction(() => document.getElementById("compression").dataset.state === "complete");
    await page.locator("#ease").click();
    await asked(id);
  }
  check((await chosen(page)) === "Femoral, above the knee", "who decided nothing is asked for what was pressed last, and it is selected");
  await page.keyboard.press("j");
  await asked("common_femoral");
  check((await chosen(page)) === "Common femoral", "then for the first that waits");
  const bar = await page.locator("#step-text").textContent();
  check(bar.includes("common femoral"), `the bar names it: ${bar}`);
  await page.keyboard.press("j");
  await asked("");
  await button(page, "Leave").click();
  await phase(page, "practice");
}

async function testGuidance(page) {
  const shown = async () => ({
    ring: await page.locator("#target-label").isVisible(), angle: await page.locator("#dial").isVisible(),
    vein: await page.getByText("Vein area").isVisible(), inside: await page.locator("#see-through").isEnabled(), hint: await page.locator("#hint-button").isVisible(),
  });
  await begin(page, /^Full/, /^After the new hip/);
  await page.waitForFunction(() => window.sonde.exam.step.target);
  const full = await shown();
  check(full.ring && full.angle && full.vein && full.inside && !full.hint, "full guidance shows ring, angle and vessels");
  await button(page, "Leave").click();
  await begin(page, /^Hints/, /^After the new hip/);
  const hints = await shown();
  check(!hints.ring && !hints.angle && !hints.vein && hints.hint, "with hints only the next point is named");
  check((await page.locator("#step-text").textContent()).includes("groin"), "the next point is named");
  await page.keyboard.press("u");
  await page.waitForFunction(() => document.getElementById("step-detail").textContent.startsWith("Hint:"));
  check((await exam(page)).hints_used === 1, "a hint comes when asked for");
  await inspect(page, "exam with hints");
  await button(page, "Leave").click();
  await begin(page, /^None/, /^After the new hip/);
  const none = await shown();
  check(!none.ring && !none.angle && !none.vein && !none.inside && !none.hint, "without guidance nothing is told");
  await page.evaluate(() => window.sonde.setDepth(12));
  await page.waitForFunction(() => window.sonde.snapshot.penetration_mm > 11);
  const words = (await page.locator("body").innerText()).toLowerCase();
  check(!/occlusive|acute|thromb|healthy/.test(words), "nothing on the page tells the truth");
  await inspect(page, "exam without guidance");
}

async function testWatch(page, mock) {
  const second = await page.context().newPage();
  second.setDefaultTimeout(PATIENCE_MS);
  await second.goto(`${mock.address}?quality=low`);
  await ready(second);
  check(await second.locator("#watching").isVisible(), "a second page says that it watches");
  check((await second.locator("#step").innerText()).includes("Examine") && (await second.locator("#finish-button").isHidden()), "it follows the exam and cannot end it");
  await second.keyboard.press("k");
  await page.waitForTimeout(300);
  check((await exam(page)).segments.every((s) => s.decision !== "clot"), "it cannot decide");
  await inspect(second, "watching");
  await second.close();
  await page.bringToFront();
}

async function testLoss(page, mock) {
  await page.keyboard.press("l");
  await page.waitForFunction(() => window.sonde.exam.segments[0].decision === "not_seen");
  const depth = await page.evaluate(() => window.sonde.depth);
  mock.drop(900);
  await page.waitForFunction(() => !document.getElementById("banner").hidden);
  check((await page.locator("#banner").textContent()).includes("lost"), "a lost connection is said");
  await page.waitForFunction(() => window.sonde.connected);
  const frames = await page.evaluate(() => window.sonde.frames);
  await page.waitForFunction((n) => window.sonde.frames > n + 2, frames);
  const now = await exam(page);
  check(now.phase === "running" && now.segments[0].decision === "not_seen", "the exam goes on when the connection is back");
  check((await page.evaluate(() => window.sonde.depth)) === depth, "the hand is where it was");
  check(await page.locator("#start").isHidden(), "nobody is asked what to do in the middle of an exam");
  check(await page.locator("#banner").isHidden(), "the sentence goes away");
  await page.reload();
  await ready(page);
  check(await page.locator("#exam-bar").isVisible(), "a page that is loaded anew is back in the exam");
  await button(page, "Leave").click();
  await phase(page, "practice");
}

async function drag(page, from, to) {
  await page.mouse.move(...from);
  await page.mouse.down();
  await page.mouse.move(...to, { steps: 4 });
  await page.mouse.up();
}

async function testCalipers(page) {
  const pane = await page.locator(".pane").last().boundingBox();
  const at = (x, y) => [pane.x + (x * pane.width) / 60, pane.y + (y * pane.height) / 70];
  const measures = () => page.evaluate(() => window.sonde.measures);
  await button(page, "Distance").click();
  await drag(page, at(20, 20), at(26, 28));
  const distance = (await measures())[0].value;
  check(Math.abs(distance - 10) < 0.15, `a line of 10 mm measures ${distance.toFixed(2)} mm`);
  check((await page.locator("#measures").innerText()).includes("10.0 mm") || (await page.locator("#measures").innerText()).includes("mm"), "it is written with its unit");
  await button(page, "Area").click();
  await drag(page, at(20, 40), at(40, 40));
  await drag(page, at(30, 47), at(30, 45));
  const area = (await measures())[1].value;
  check(Math.abs(area - Math.PI * 50) < 5, `an ellipse of 20 x 10 mm measures ${area.toFixed(1)} mm²`);
  await page.keyboard.press("Delete");
  check((await measures()).length === 0, "Delete clears");
  await page.keyboard.press("m");
  await page.keyboard.press("m");
  const before = (await measures())[0].value;
  await page.keyboard.press("Shift+ArrowUp");
  check(Math.abs((await measures())[0].value - before - 2) < 1e-9, "arrow keys move a caliper's point");
  await button(page, "Clear").click();
  if (await page.locator("#measure-distance[aria-pressed=true]").count()) await button(page, "Distance").click();
}

async function testCompare(page) {
  const pixels = (n) => page.locator(".pane canvas").nth(n).evaluate((c) => c.toDataURL());
  await page.evaluate(() => window.sonde.setDepth(1));
  await page.waitForFunction(() => window.sonde.snapshot.penetration_mm > 0.5);
  await page.waitForTimeout(200);
  await button(page, "Compare").click();
  const kept = await pixels(0);
  await page.evaluate((d) => window.sonde.setDepth(d), CLOSED_MM);
  await page.waitForFunction((d) => window.sonde.snapshot.penetration_mm > d - 1, CLOSED_MM);
  await page.waitForTimeout(200);
  check((await pixels(0)) === kept && (await pixels(1)) !== kept, "the kept image stays, the live one goes on");
  await button(page, "Freeze").click();
  const frozen = await pixels(1);
  await page.evaluate(() => window.sonde.setDepth(1));
  await page.waitForFunction(() => window.sonde.snapshot.penetration_mm < 3);
  check((await pixels(1)) === frozen, "before and after stand side by side");
  await inspect(page, "compare");
  await picture(page, path.join(outDir, "compare.png"));
  await button(page, "Compare").click();
  check(await page.locator(".pane").first().isHidden(), "compare ends");
}

async function testPatient(page, mock) {
  await page.locator("#posture").selectOption("standing");
  await page.waitForFunction(() => window.sonde.controls.posture === "standing");
  await page.locator("#valsalva").click();
  await page.waitForFunction(() => window.sonde.controls.valsalva === true);
  await page.locator("#gel-put").click();
  await page.waitForFunction(() => window.sonde.controls.gel_ml === 2);
  await page.locator("#gel-wipe").click();
  await page.waitForFunction(() => window.sonde.controls.gel_ml === 0);
  await button(page, "Tissue").click();
  await page.locator("#tissue input").first().fill("1.5");
  await page.waitForFunction(() => window.sonde.controls.stiffness_scale === 1.5);
  await page.keyboard.press("Escape");
  check(mock.thigh.controls.stiffness_scale === 1.5, "position, strain, gel and tissue reach the program");
}

/** Colour is on the image where the program says, its box follows the hand, and the buttons reach the program. */
async function testDuplex(page, mock) {
  const colours = () => page.evaluate(() => {
    const all = document.querySelector(".pane:not([hidden]) canvas");
    const d = all.getContext("2d").getImageData(0, 0, all.width, all.height).data;
    let count = 0;
    for (let i = 0; i < d.length; i += 4) if (d[i] !== d[i + 2]) ++count;
    return count / (d.length / 4);
  });
  check((await colours()) === 0, "without Doppler the image is grey");
  await page.locator("#colour").click();
  await page.waitForFunction(() => !document.getElementById("duplex-tools").hidden);
  await page.waitForFunction(() => document.querySelector(".pane:not([hidden]) .doppler .box").getAttribute("d")?.startsWith("M"));
  const share = await colours();
  const [l, r, t, b] = mock.thigh.controls.colour_box_mm;
  const wanted = ((r - l) * (b - t)) / (60 * mock.thigh.controls.depth_mm);
  check(Math.abs(share / wanted - 1) < 0.05, "colour covers the box and nothing else");
  const grip = await page.locator(".pane:not([hidden]) .doppler .grip").first().boundingBox();
  await page.mouse.move(grip.x + 10, grip.y + 10);
  await page.mouse.down();
  await page.mouse.move(grip.x + 40, grip.y + 30, { steps: 3 });
  await page.mouse.up();
  await page.waitForFunction(() => window.sonde.controls.colour_box_mm[0] > -14 + 1);
  check(Math.abs(mock.thigh.controls.colour_box_mm[1] - mock.thigh.controls.colour_box_mm[0] - 28) < 1e-3, "a dragged box keeps its size");
  await page.locator("#scale-more").click();
  await page.locator("#steer-more").click();
  await page.locator("#gain-less").click();
  await page.waitForFunction(() => window.sonde.controls.colour_gain_db === -2);
  await page.locator("#squeeze").click();
  await page.locator("#scene").focus();
  await page.keyboard.press("Shift+V");
  await page.keyboard.press("Shift+M");
  await page.waitForFunction(() => window.sonde.controls.colour === "power");
  const { colour_scale_cm_s: scale, colour_steer_deg: steer } = mock.thigh.controls;
  check(scale === 8 && steer === 20 && mock.thigh.hand.join() === "squeeze,breathe", "scale, lean, squeeze and breath reach the program");
  await inspect(page, "duplex");
  await picture(page, path.join(outDir, "duplex.png"));
  await page.keyboard.press("Shift+B");
  await page.waitForFunction(() => document.getElementById("duplex-tools").hidden);
}

/** The gate follows pointer and keys, its settings reach the program, and a frozen spectrum says what flowed. */
async function testPulsed(page, mock) {
  mock.thigh.squeezed_s = undefined; // calm blood
  await page.locator("#scene").focus();
  await page.keyboard.press("Shift+P");
  await page.waitForFunction(() => window.sonde.spectrum?.columns > 50);
  check(await page.evaluate(() => Math.abs(window.sonde.spectrum.mean) > 5 && window.sonde.sounded === 0), "the spectrum scrolls in silence");
  const grip = page.locator(".pane:not([hidden]) .gate .grip").first();
  const box = await grip.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 40, box.y + box.height / 2 + 30, { steps: 3 });
  await page.mouse.up();
  await page.waitForFunction(() => window.sonde.controls.gate_mm[0] > 1 && window.sonde.controls.gate_mm[1] > 21);
  const [, depth] = mock.thigh.controls.gate_mm;
  await grip.focus();
  await page.keyboard.press("ArrowUp");
  await page.waitForFunction((d) => Math.abs(window.sonde.controls.gate_mm[1] - d + 0.5) < 0.01, depth);
  await page.locator("#gate-beam-more").click();
  await page.locator("#gate-filter-less").click();
  await page.waitForFunction(() => window.sonde.controls.gate_filter_hz === 20);
  check(mock.thigh.controls.gate_steer_deg === 20, "the gate's settings reach the program");
  await page.locator("#doppler-sound").click();
  await page.waitForFunction(() => window.sonde.sounded > 10);
  await page.waitForFunction(() => window.sonde.spectrum.columns > 150);
  await page.locator("#squeeze").click();
  await page.waitForFunction(() => window.sonde.spectrum.squeezes === 1);
  const squeezed = mock.thigh.squeezed_s;
  await page.waitForFunction((t) => window.sonde.snapshot.time_s > t + 2.6, squeezed);
  await page.keyboard.press("f");
  await page.waitForFunction(() => document.querySelector("#spectrum-words").textContent.includes("Reverse"));
  const read = await page.evaluate(() => window.sonde.spectrum);
  check(Math.abs(read.reflux_s / REFLUX_S - 1) < 0.05, `the frozen spectrum has the time of reflux: ${read.reflux_s} s`);
  check(Math.abs(read.peak / 100 - 1) < 0.05 && read.squeezes === 1, `and the peak along the cursor: ${read.peak} cm/s`);
  check(Math.abs(read.augmentation / 4 - 1) < 0.4, `the squeeze augments: ${read.augmentation}`);
  await inspect(page, "pulsed");
  await picture(page, path.join(outDir, "pulsed.png"));
  await page.locator("#scene").focus();
  await page.keyboard.press("f");
  await page.keyboard.press("Shift+P");
  await page.waitForFunction(() => document.getElementById("spectrum").hidden);
  await testFan(page, mock);
}

/** Before a curved face the box is a sector, the gate's beam its line; nothing leans by hand. */
async function testFan(page, mock) {
  const radius = 60;
  mock.thigh.face = { radius_mm: radius, top_mm: radius * (Math.cos(0.5) - 1) };
  const box = [-14, 14, 10, 40];
  Object.assign(mock.thigh.controls, { colour: "velocity", colour_box_mm: box, colour_steer_deg: undefined, gate: true, gate_mm: [20, 30], gate_steer_deg: undefined });
  await page.locator("#gel-put").click();
  const shape = () => page.evaluate(() => {
    const svg = document.querySelector(".pane:not([hidden]) .doppler");
    const scale = svg.viewBox.baseVal.width / window.sonde.image_mm[0];
    const points = (name) => (document.querySelector(`.pane:not([hidden]) ${name}`).getAttribute("d") ?? "").match(/-?[0-9.]+ -?[0-9.]+/g)?.map((p) => p.split(" ").map((v) => v / scale)) ?? [];
    return { box: points(".doppler .box"), beam: points(".gate .beam"), wide: window.sonde.image_mm[0] };
  });
  await page.waitForFunction(() => document.querySelector(".pane:not([hidden]) .doppler .box").getAttribute("d")?.split("L").length > 20);
  await page.waitForFunction(() => document.querySelector(".pane:not([hidden]) .gate .beam").getAttribute("d"));
  const seen = await shape();
  const top = mock.thigh.face.top_mm;
  const at = (along, depth) => [(radius + depth) * Math.sin(along / radius) + seen.wide / 2, (radius + depth) * Math.cos(along / radius) - radius - top];
  const near = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) < 0.1;
  check([[-14, 10], [14, 10], [0, 10], [14, 40], [-14, 40], [0, 40]].every((p) => seen.box.some((q) => near(q, at(...p)))), "the colour box is a sector of the fan");
  check(near(seen.beam[0], at(20, 0)) && near(seen.beam[1], at(20, 28.5)), "the gate lies on its line");
  check(await page.evaluate(() => !document.getElementById("steer-more").checkVisibility() && !document.getElementById("gate-beam-more").checkVisibility() && document.getElementById("pulsed").checkVisibility()), "nothing leans by hand");
  const grip = page.locator(".pane:not([hidden]) .gate .grip").first();
  await grip.focus();
  await page.keyboard.press("ArrowDown");
  await page.waitForFunction(() => window.sonde.controls.gate_mm[1] === 30.5 && window.sonde.controls.gate_mm[0] === 20);
  await picture(page, path.join(outDir, "fan.png"));
  mock.thigh.face = undefined;
}

/** Two fingers that go up press. */
async function testTouch(page) {
  const before = await page.evaluate(() => window.sonde.depth);
  await page.locator("#scene").evaluate((canvas) => {
    const box = canvas.getBoundingClientRect();
    const send = (type, pointerId, x, y) => canvas.dispatchEvent(new PointerEvent(type, { pointerId, pointerType: "touch", isPrimary: pointerId === 11, bubbles: true, clientX: box.left + x, clientY: box.top + y, button: 0, buttons: 1 }));
    canvas.setPointerCapture = () => undefined;
    canvas.releasePointerCapture = () => undefined;
    send("pointerdown", 11, 20, 20);
    send("pointerdown", 12, 60, 20);
    for (let i = 1; i <= 5; ++i) send("pointermove", 11, 20, 20 + 8 * i), send("pointermove", 12, 60, 20 + 8 * i);
    send("pointerup", 11, 20, 60);
    send("pointerup", 12, 60, 60);
  });
  const after = await page.evaluate(() => window.sonde.depth);
  check(Math.abs(after - before - 6) < 0.6, `two fingers by 40 px press by ${(after - before).toFixed(1)} mm`);
}

async function testLight(page, mock) {
  const bytes = ["index.html", "style.css", "app.js"].reduce((sum, f) => sum + statSync(path.join(webDir, "dist", `${f}.gz`)).size, 0);
  check(bytes < 1e6, `the page weighs ${(bytes / 1000).toFixed(0)} kB compressed`);
  await page.goto(`${mock.address}?quality=low`);
  await page.waitForFunction(() => (window.sonde?.frames ?? 0) > 0);
  const wall = await page.evaluate(() => performance.getEntriesByName("first image")[0].startTime.toFixed(0));
  const cdp = await page.context().newCDPSession(page);
  await cdp.send("Performance.enable");
  const { metrics } = await cdp.send("Performance.getMetrics");
  const busy = metrics.find((m) => m.name === "TaskDuration").value;
  console.log(`       first image after ${wall} ms, of which the page's own thread worked ${(1000 * busy).toFixed(0)} ms`);
  await ready(page);
}

async function main() {
  mkdirSync(outDir, { recursive: true });
  const mock = await startMock({ webDir, list: exams() });
  const browser = await openBrowser(chromium);
  try {
    const context = await browser.newContext({ viewport: SMALL, reducedMotion: "reduce" });
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE_MS);
    const errors = [];
    page.on("console", (m) => m.type() === "error" && !/WebSocket|ERR_CONNECTION/.test(m.text()) && errors.push(m.text()));
    page.on("pageerror", (e) => errors.push(e.message));
    await testLight(page, mock);
    await page.locator("#start[open]").waitFor();
    await testStart(page);
    await testPointerExam(page);
    await testReplay(page);
    await inspect(page, "free practice");
    await testKeyboardExam(page);
    await testAsked(page);
    await testGuidance(page);
    await testWatch(page, mock);
    await testLoss(page, mock);
    await testCalipers(page);
    await testCompare(page);
    await testPatient(page, mock);
    await testDuplex(page, mock);
    await testPulsed(page, mock);
    await testTouch(page);
    check(errors.length === 0, `no errors on the console${errors.map((e) => `\n       ${e}`).join("")}`);
  } finally {
    await browser.close();
    mock.close();
  }
}

await main().catch((error) => check(false, error.stack));
process.exit(failures.length ? 1 : 0);
