// The report of the paper in a browser: all claims, figures and tables are shown, words of figures do not overlap. Reads what the
// test app_paper left. Usage: node paper_report_test.mjs WEB_BUILD_DIR PAPER.html
import { existsSync } from "node:fs";
import { judge, openBrowser, openReport } from "./report.mjs";

const [, , web, file] = process.argv;
if (!existsSync(file)) {
  console.log(`${file} is not there: run app_paper first`);
  process.exit(77);
}
const failures = [];
let checks = 0;
const check = (good, what) => (++checks, good || failures.push(what));
const browser = await openBrowser(web);
const { page, data, drawings, text } = await openReport(browser.context, file, check);
check(drawings === 9, `${drawings} figures, expected 9`);
const claims = Object.values(data.claims);
const rows = await page.$$eval("#claims tbody tr", (list) => list.map((row) => row.textContent));
check(rows.length === claims.length && claims.length >= 20, `${rows.length} rows for ${claims.length} claims`);
claims.forEach((c, i) => check([c.sentence, c.done, c.found, c.verdict].every((words) => rows[i]?.includes(words)), `row ${i} is not of ${c.sentence}`));
check(data.holds + data.in_part + data.does_not_hold + data.not_tried === claims.length, "verdicts add up to the claims");
const tables = Object.values(data.tables);
check((await page.$$("#paper-tables table")).length === tables.length && tables.length >= 6, `${tables.length} tables`);
for (const t of tables) for (const row of Object.values(t.rows)) check(text.includes(row.name), `no row ${row.name}`);
check(text.includes("synthetic"), "the report says that its data are synthetic");
await browser.close();
judge(failures, checks);
