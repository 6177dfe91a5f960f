// Reports of the program in a browser, from disk and without a network: the numbers that are shown are those of the
// data, every figure is drawn with all its points, and names are text. Usage: node report_test.mjs SONDE WEB_BUILD_DIR
// DATA OUT_DIR
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { judge, openBrowser, openReport } from "./report.mjs";

const [sonde, web, data, out] = process.argv.slice(2, 6).map((p) => resolve(p));
mkdirSync(out, { recursive: true });
const failures = [];
let checks = 0;
const check = (good, what) => (++checks, good || failures.push(what));
const run = (...args) => execFileSync(sonde, args, { cwd: out, stdio: ["ignore", "ignore", "pipe"] });
const NAME = 'leg <b>&"\' </script><!-- {{';
const minus = (text) => text.replace("-", "\u2212");
const { context, close } = await openBrowser(web);

// ---- the report of an estimation

const thigh = join(data, "thigh");
run("fit", join(thigh, "indentation.csv"), "--surface", join(thigh, "skin.ply"), "--sites", join(thigh, "sites.csv"), "--stages", "3",
  "--smoothness", "0.1", "--fine-mm", "6", "--name", NAME, "-o", "fit.sonde", "--report", "fit");
{
  const { page, data: r, drawings, text } = await openReport(context, join(out, "fit/index.html"), check);
  const texts = (selector) => page.locator(selector).allTextContents();
  check(text.includes(NAME), "the model's name is text");
  check(r.kind === "fit" && r.rows.force_n.length > 1000, "the data are those of a fit");
  const fields = ["k0_kpa_mm", "xm_mm", "shear_n_m", "shear_limit", "muscle_depth_mm"].filter((f) => r.skin[f]).length;
  check(drawings === r.probes.length + 3 + fields + 1 + 4, `${drawings} figures`);

  const keys = await texts(".key b");
  check(keys[0] === `${r.errors.all.mae_n.toPrecision(3)} N` && keys[1] === `${r.errors.all.percent_of_mean.toPrecision(3)} %`, `the summary says ${keys}`);
  const rows = await page.locator("section#tables table").nth(0).locator("tbody tr").allInnerTexts();
  [...r.errors.probes, r.errors.all].forEach((e, i) => {
    const cells = rows[i].split("\t").slice(2);
    const expected = [e.mae_n, e.sd_n, e.sd_abs_n, e.rmse_n, e.bias_n, e.median_abs_n, e.p95_abs_n, e.max_abs_n].map((v) => minus(v.toFixed(3)));
    const shares = [e.percent_of_mean, e.percent_of_range, e.percent_of_largest].map((v) => v.toFixed(2));
    check(cells.join() === [...expected, ...shares].join().replace("\u22120.000", "0.000"), `errors by probe: ${cells} instead of ${expected},${shares}`);
  });
  check((await page.locator("section#tables table").nth(1).locator("tbody tr").count()) === r.errors.depths.filter((d) => d.probes.some(Boolean)).length, "a row for each depth");
  const stages = await texts("section#stages tbody tr td:first-child");
  check(stages.join() === r.stages.map((s) => s.name).join(), `stages: ${stages}`);
  check((await texts("section#stages tr.strong td:first-child")).join() === r.stages.find((s) => s.main).name, "the main stage is marked");
  const site = (await page.locator("section#parameters details tbody tr").first().innerText()).split("\t");
  check(site[1] === r.site_parameters[0].k0_kpa_mm.value.toPrecision(4), `k0 of the first site: ${site}`);

  // Points of the drawings against those of the data, back from pixels to values.
  const drawn = await page.evaluate(() => {
    const all = (selector) => [...document.querySelectorAll(selector)];
    const bars = all("#figure-histogram rect[stroke='#8fa1ad']").map((b) => ({ x: +b.getAttribute("x"), height: +b.getAttribute("height") }));
    const dots = all("#figure-residuals .dots").map((p) => (p.getAttribute("d").match(/M/g) ?? []).length);
    const marks = all("[id^=figure-curves]").map((f) => f.querySelectorAll("g > .mark").length);
    const labels = Object.fromEntries(all("figure").map((f) => [f.id, [...f.querySelectorAll("text")].map((t) => t.textContent)]));
    const dashes = all("#figure-histogram path.line").map((p) => p.getAttribute("stroke-dasharray"));
    const surfaces = all("figure .surface").map((g) => (g.innerHTML.match(/M/g) ?? []).length);
    return { bars, dots, marks, labels, dashes, surfaces };
  });
  const counts = r.errors.histogram.count.filter(Boolean);
  check(drawn.bars.length === counts.length, `${drawn.bars.length} bars instead of ${counts.length}`);
  const tallest = Math.max(...counts), pixels = Math.max(...drawn.bars.map((b) => b.height));
  drawn.bars.forEach((b, i) => check(Math.abs(b.height / pixels - counts[i] / tallest) < 0.01, `bar ${i} is ${b.height} tall`));
  const known = r.rows.model_n.filter((v) => v !== null).length;
  check(drawn.dots.reduce((a, b) => a + b, 0) === known, `${drawn.dots} dots instead of ${known}`);
  check(drawn.marks.every((n) => n > 100), `marks of the curves: ${drawn.marks}`);
  check(new Set(drawn.dashes).size === 3, "the distributions differ in dash, not in colour alone");
  check(drawn.surfaces.length === fields + 1 && drawn.surfaces.every((n) => n > r.skin.face.length / 3 / 3), `faces of the maps: ${drawn.surfaces}`);
  const UNITS = { "figure-curves-1": ["penetration, mm", "force, N"], "figure-histogram": ["error, N", "share of measurements per bar, %"], "figure-depth": ["penetration, mm", "error over force, %"], "figure-residuals": ["force of the model, N", "error, N"], "figure-sites": ["k\u2080, kPa/mm", "x\u2098, mm"], "figure-map-k0": ["k\u2080, kPa/mm", "50 mm"], "figure-map-error": ["MAE, %"] };
  for (const [id, words] of Object.entries(UNITS)) for (const word of words) check(drawn.labels[id]?.includes(word), `${id} says '${word}'`);

  const [saved] = await Promise.all([page.waitForEvent("download"), page.locator("#figure-histogram .save").click()]);
  const svg = readFileSync(await saved.path(), "utf8");
  check(saved.suggestedFilename().endsWith("-histogram.svg") && svg.includes("xmlns=\"http://www.w3.org/2000/svg\"") && svg.includes(".fig text"), "a figure is saved as SVG with its style");
  await page.emulateMedia({ media: "print" });
  check((await page.locator(".save").first().isVisible()) === false, "paper has no buttons");
  await page.pdf({ path: join(out, "fit.pdf"), format: "A4" });
}

// A report of the first stage alone: sections without data leave no trace.
run("fit", join(thigh, "indentation.csv"), "--surface", join(thigh, "skin.ply"), "--sites", join(thigh, "sites.csv"), "--stages", "1",
  "--fine-mm", "8", "-o", "first.sonde", "--report", "first");
{
  const { page, data: r } = await openReport(context, join(out, "first/index.html"), check);
  const ids = await page.locator("section").evaluateAll((list) => list.map((s) => s.id));
  check(ids.join() === "summary,stages,curves,errors,tables,maps,timing", `sections of the first stage: ${ids}`);
  check((await page.locator("nav a").count()) === ids.length && r.stages.length === 2, "a link to each section");
}

// ---- the report of a scene

run("simulate", join(data, "scenes/four_kinds.yaml"), "-o", "scene", "--steps", "60", "--no-frames", "--picture", "scene.html");
{
  const { page, data: r, drawings, text } = await openReport(context, join(out, "scene.html"), check);
  check(r.kind === "scene" && drawings === 1 && text.includes(`t = ${r.time_s.toFixed(3)} s`), "the scene is drawn at its time");
  const rows = (await page.locator("section#bodies tbody tr").allInnerTexts()).map((row) => row.split("\t"));
  check(rows.length === r.bodies.length && rows.every((row, i) => row[0] === r.bodies[i].name && row[3] === r.bodies[i].mass_kg.toPrecision(4)), `bodies: ${rows.map((row) => row[0])}`);
  const contacts = await page.locator("section#contacts tbody tr").count();
  check(contacts === r.contacts.length && contacts > 0, `${contacts} contacts`);
  const drawn = () => page.locator(".surface").first().evaluate((g) => g.innerHTML);
  const before = await drawn();
  const visible = r.bodies.reduce((n, b) => n + b.face.length / 3, 0) / 3;
  check((before.match(/M/g) ?? []).length > visible, "the faces towards the viewer are painted");
  const box = await page.locator("figure svg").boundingBox();
  await page.mouse.move(box.x + 300, box.y + 200);
  await page.mouse.down();
  await page.mouse.move(box.x + 400, box.y + 230, { steps: 4 });
  await page.mouse.up();
  check((await drawn()) !== before && (await page.locator(".surface").count()) === 1, "dragging turns the bodies");
}

await close();
judge(failures, checks);
