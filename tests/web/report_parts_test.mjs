// Axes, numbers, colours and lines of the reports, without a browser. Usage: node report_parts_test.mjs WEB_BUILD_DIR
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { judge } from "./report.mjs";

const web = resolve(process.argv[2]);
const esbuild = createRequire(join(web, "package.json"))("esbuild");
const failures = [];
let checks = 0;
const check = (good, what) => (++checks, good || failures.push(what));
async function load(name) {
  const made = await esbuild.build({ entryPoints: [join(web, "src/report", name)], bundle: true, format: "esm", write: false, logLevel: "silent" });
  return import(`data:text/javascript;base64,${Buffer.from(made.outputFiles[0].text).toString("base64")}`);
}
const isRound = (step) => [1, 2, 5].some((m) => Math.abs(step / 10 ** Math.floor(Math.log10(step * (1 + 1e-9))) - m) < 1e-6);
let seed = 1;
const uniform = () => (seed = (seed * 48271) % 2147483647) / 2147483647;

// ---- axes: for ranges over 24 decades round steps, all of the range covered, neither few nor many ticks

const { axis, tightAxis, tickLabel, niceStep, range } = await load("axis.ts");
for (let i = 0; i < 4000; ++i) {
  const size = 10 ** (24 * uniform() - 12);
  const low = size * (2 * uniform() - 1), high = low + size * (0.01 + uniform()), count = 3 + (i % 12);
  const a = axis("", low, high, count), t = tightAxis("", low, high, count), slack = 1e-5 * a.step;
  const covers = a.low <= low + slack && a.high >= high - slack && low - a.low < a.step && a.high - high < a.step;
  const steps = a.ticks.length - 1;
  check(isRound(a.step) && covers && steps <= count + 2 && 2.5 * steps >= count - 1, `axis of ${low} to ${high}: ${a.low} to ${a.high} by ${a.step}`);
  check(t.low === low && t.high === high && t.ticks.every((v) => v >= low - slack && v <= high + slack), `tight axis of ${low} to ${high}`);
}
for (const [low, high] of [[0, 0], [3, 3], [-2, -2], [NaN, 1], [0, Infinity], [5, -5], [-1e308, 1e308]]) {
  const a = axis("", low, high, 6);
  check(Number.isFinite(a.low) && Number.isFinite(a.high) && a.high > a.low && a.step > 0, `a range without hope: ${low} to ${high}`);
}
for (let decade = -4; decade < 5; ++decade) {
  const a = axis("", 0, 7 * 10 ** decade, 8);
  for (const tick of a.ticks) check(Math.abs(Number(tickLabel(a, tick)) - tick) < 1e-6 * a.step, `label ${tickLabel(a, tick)} of ${tick}`);
}
check(niceStep(2) === 2 && niceStep(2.1) === 5 && niceStep(0.06) === 0.1, "round steps");
check(range([3, NaN, -1, Infinity], 0).join() === "-1,3" && range([], 2).join() === "2,2", "range of finite values");

// ---- numbers

const { fixed, signed, significant, short, grouped } = await load("number.ts");
const minus = "\u2212", dash = "\u2013";
for (const [is, should] of [
  [fixed(1.25, 1), "1.3"], [fixed(-0.04, 1), "0.0"], [fixed(-12.345678, 2), `${minus}12.35`], [fixed(0.999, 2), "1.00"], [fixed(NaN, 2), dash], [fixed(null, 2), dash],
  [fixed(undefined, 0), dash], [fixed(Infinity, 0), dash], [signed(3, 1), "+3.0"], [signed(0.01, 1), "0.0"], [signed(-3, 1), `${minus}3.0`],
  [significant(0.0123456, 3), "0.0123"], [significant(9.996, 3), "10.0"], [significant(183412, 3), "183412"], [significant(1.8e7, 2), "1.8 \u00d7 10\u2077"],
  [significant(-2.5e-12, 2), `${minus}2.5 \u00d7 10\u207b\u00b9\u00b2`], [significant(0, 3), "0"], [short(2), "2"], [short(2.5), "2.5"], [short(100), "100"],
  [grouped(0), "0"], [grouped(999), "999"], [grouped(1234567), "1,234,567"],
]) check(is === should, `'${is}' instead of '${should}'`);

// ---- colours, back from sRGB to Oklab by the published matrices

const linear = (byte) => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4);
function oklab(colour) {
  const [r, g, b] = [1, 3, 5].map((i) => linear(parseInt(colour.slice(i, i + 2), 16)));
  const l = Math.cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const m = Math.cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const s = Math.cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return [0.2104542553 * l + 0.793617785 * m - 0.0040720468 * s, 1.9779984951 * l - 2.428592205 * m + 0.4505937099 * s, 0.0259040371 * l + 0.7827717662 * m - 0.808675766 * s];
}
const { sequential, diverging } = await load("colour.ts");
const path = Array.from({ length: 17 }, (_, i) => oklab(sequential(i / 16)));
const steps = path.slice(1).map((c, i) => Math.hypot(...c.map((v, k) => v - path[i][k])));
check(path.slice(1).every((c, i) => c[0] > path[i][0] + 0.02), "lightness alone orders the colours");
check(Math.max(...steps) < 1.25 * Math.min(...steps), `steps look equally large: ${Math.min(...steps)} to ${Math.max(...steps)}`);
for (let i = 1; i <= 10; ++i) {
  const [middle, low, high] = [0, -0.1 * i, 0.1 * i].map((t) => oklab(diverging(t)));
  check(Math.abs(low[0] - high[0]) < 0.03 && low[0] < middle[0] && low[2] < middle[2] && high[2] > middle[2], `diverging at ${i}`);
}

// ---- lines break where a value is missing, and nothing but numbers is drawn

class Element {
  constructor(tag) {
    Object.assign(this, { tag, attributes: {}, children: [] });
  }
  setAttribute(name, value) {
    this.attributes[name] = value;
  }
  append(...children) {
    this.children.push(...children);
  }
  all(tag) {
    return [...(this.tag === tag ? [this] : []), ...this.children.flatMap((c) => c.all?.(tag) ?? [])];
  }
}
globalThis.document = { createElementNS: (_, tag) => new Element(tag), createElement: (tag) => new Element(tag) };
const { Chart, drawing, look } = await load("chart.ts");
const svg = drawing(100, 100);
const chart = new Chart(svg, { left: 0, top: 0, width: 100, height: 100, x: axis("x, mm", 0, 10), y: axis("y, N", 0, 10) });
const x = [0, 1, NaN, 3, 4, 5, 6], y = [0, 1, 2, 3, Infinity, 1e300, -1e300];
chart.line(x, y).band(x, y, y).dots(x, y).marks(x, y).errorBar(2, NaN, NaN).box(0, NaN, 0, 1, {});
const lines = svg.all("path").filter((p) => p.attributes.class === "line");
check((lines[0].attributes.d.match(/M/g) ?? []).length === 3, `a gap for each missing value: ${lines[0].attributes.d}`);
check(svg.all("path").filter((p) => p.attributes.class === "mark").length === 3, "marks only of what is known and within the axes");
check(svg.all("rect").length === 1, "a box without an end is left out");
check(!/NaN|Infinity/.test(JSON.stringify(svg)), "nothing but numbers in the drawing");
check(new Set([0, 1, 2, 3].map((i) => look(i).dash)).size === 4 && new Set([0, 1, 2, 3].map((i) => look(i).mark)).size === 4, "series differ without colour");

judge(failures, checks);
