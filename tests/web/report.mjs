// Reports in a browser: what every report must keep, and the data that it holds.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { openBrowser as launch } from "./drive.mjs";

/** Chromium without a network. @param web the page's build directory */
export async function openBrowser(web) {
  const { chromium } = createRequire(path.resolve(web, "package.json"))("playwright-core");
  const browser = await launch(chromium);
  const context = await browser.newContext({ viewport: { width: 1000, height: 900 }, offline: true });
  return { context, close: () => browser.close() };
}

/** The data of a report's file. */
export const dataOf = (file) => JSON.parse(/id="report">([^<]*)<\/script>/.exec(readFileSync(file, "utf8"))[1]);

/**
 * Opens a report from disk and checks what all reports must keep: nothing is loaded, nothing fails, no value shows as
 * it should not, every figure has a name and its words and lines stay within it, words of a figure do not overlap.
 */
export async function openReport(context, file, check) {
  const page = await context.newPage();
  const said = [];
  page.on("console", (m) => said.push(m.text()));
  page.on("pageerror", (e) => said.push(e.message));
  page.on("request", (r) => /^(file|data|blob):/.test(r.url()) || said.push(`asks for ${r.url()}`));
  await page.goto(`file://${path.resolve(file)}`);
  await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
  check(said.length === 0, `${file}: ${said.join("; ")}`);
  const found = await page.evaluate(() => {
    const bad = [];
    const text = document.body.innerText + [...document.querySelectorAll("svg text")].map((t) => t.textContent).join("\n");
    for (const word of ["NaN", "undefined", "null", "Infinity", "[object"]) if (text.includes(word)) bad.push(`shows ${word}`);
    const drawings = [...document.querySelectorAll("figure svg")];
    for (const svg of drawings) {
      const name = svg.getAttribute("aria-label");
      if (!name) bad.push("a figure without a name");
      if (/NaN|undefined|Infinity/.test(svg.outerHTML.replace(/href="data:[^"]*"/g, ""))) bad.push(`${name}: a coordinate is no number`);
      const frame = svg.getBoundingClientRect();
      const words = [...svg.querySelectorAll("text:not(.halo)")].filter((t) => t.textContent).map((t) => ({ text: t.textContent, box: t.getBoundingClientRect() }));
      for (const { text, box } of words)
        if (box.left < frame.left - 2 || box.right > frame.right + 2 || box.top < frame.top - 2 || box.bottom > frame.bottom + 2) bad.push(`${name}: '${text}' leaves the figure`);
      words.forEach((a, i) =>
        words.slice(i + 1).forEach((b) => {
          const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
          const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
          if (across > 2 && down > 4) bad.push(`${name}: '${a.text}' overlaps '${b.text}'`);
        }),
      );
    }
    return { bad, drawings: drawings.length, text };
  });
  check(found.bad.length === 0, `${file}: ${found.bad.slice(0, 6).join("; ")}`);
  return { page, data: dataOf(file), drawings: found.drawings, text: found.text };
}

/** What the checks found; ends the program with 1 when anything failed. */
export function judge(failures, checks) {
  console.log(`${checks} checks, ${failures.length} failed`);
  for (const failure of failures) console.log(`FAILED ${failure}`);
  process.exit(failures.length || !checks ? 1 : 0);
}
