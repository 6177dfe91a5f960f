// The probe's way to a far place, without a browser: on a bent tube every waypoint lies outside of it
// with the probe's face clear of the skin, from any place to any other. Usage: node route_test.mjs WEB_BUILD_DIR
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const web = resolve(process.argv[2]);
const esbuild = createRequire(join(web, "package.json"))("esbuild");
async function load(name) {
  const made = await esbuild.build({ entryPoints: [join(web, "src", name)], bundle: true, format: "esm", write: false, logLevel: "silent" });
  return import(`data:text/javascript;base64,${Buffer.from(made.outputFiles[0].text).toString("base64")}`);
}
const { Route } = await load("route.ts");
const { Skin, Hold, rotate } = await load("pose.ts");

const [AROUND, ALONG, RADIUS, LENGTH, BEND] = [48, 61, 70, 300, 30];
const centre = (z) => [BEND * Math.sin((Math.PI * z) / LENGTH), 0];
const points = new Float32Array(3 * AROUND * ALONG);
const faces = [];
for (let k = 0; k < ALONG; ++k)
  for (let i = 0; i < AROUND; ++i) {
    const z = (k * LENGTH) / (ALONG - 1);
    const a = (2 * Math.PI * i) / AROUND;
    const [x, y] = centre(z);
    points.set([x + RADIUS * Math.cos(a), y + RADIUS * Math.sin(a), z], 3 * (k * AROUND + i));
    const next = k * AROUND + ((i + 1) % AROUND);
    if (k + 1 < ALONG) faces.push(k * AROUND + i, next, next + AROUND, k * AROUND + i, next + AROUND, k * AROUND + i + AROUND);
  }
const skin = new Skin(points, new Uint32Array(faces));
const depthInside = (p) => {
  const [x, y] = centre(p[2]);
  return RADIUS - Math.hypot(p[0] - x, p[1] - y);
};
const HALF_X_MM = 30;
let ways = 0;
let deepest = -Infinity;
for (const from of [5, 20, 700, 1450, 2030, 2800])
  for (const to of [0, 24, 350, 1300, 1475, 2200, 2900]) {
    const hold = new Hold();
    const start = skin.point(from);
    const goal = skin.point(to);
    hold.at(goal, skin.normalAt(goal));
    hold.setDepth(-8);
    const route = new Route();
    route.to(skin, start, goal);
    const lifted = new Hold();
    lifted.at(start, skin.normalAt(start));
    lifted.setDepth(-8);
    let probe = lifted.pose().position_mm;
    let last = null;
    for (let k = 0; k < 200 && last !== hold.pose().position_mm.join(); ++k) {
      const pose = route.pose(hold.pose());
      // The probe goes straight from pose to pose; its face is as wide as the linear probe's.
      for (let s = 0; s <= 1; s += 0.1) {
        const at = probe.map((c, i) => c + s * (pose.position_mm[i] - c));
        const x = rotate(pose.rotation, [1, 0, 0]);
        for (const side of [-1, 0, 1]) deepest = Math.max(deepest, depthInside(at.map((c, i) => c + side * HALF_X_MM * x[i])));
      }
      last = pose.position_mm.join();
      // It goes on to the next pose as soon as the route says so, here at every tenth of the way.
      const from = probe;
      for (let s = 0.1; s <= 1.001; s += 0.1) {
        probe = from.map((c, i) => c + s * (pose.position_mm[i] - c));
        if (route.passed(probe)) break;
      }
    }
    const error = Math.hypot(...probe.map((c, i) => c - hold.pose().position_mm[i]));
    if (error > 1e-6) {
      console.log(`FAILED from ${from} to ${to}: ended ${error.toFixed(1)} mm away`);
      process.exit(1);
    }
    ways += 1;
  }
console.log(`${ways} ways, the face came ${deepest.toFixed(1)} mm into the resting skin at most`);
process.exit(ways === 42 && deepest < 5 ? 0 : 1);
