// The camera's stand, without a browser: from whatever side and in whatever form of the picture, every corner of a leg lies
// inside what the camera sees, with room around it, and no nearer stand has that. Usage: node framing_test.mjs WEB_BUILD_DIR
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const web = resolve(process.argv[2]);
const require = createRequire(join(web, "package.json"));
const THREE = await import(pathToFileURL(require.resolve("three")));
const made = await require("esbuild").build({ entryPoints: [join(web, "src", "framing.ts")], bundle: true, format: "esm", write: false, logLevel: "silent" });
const { halfView, stand } = await import(`data:text/javascript;base64,${Buffer.from(made.outputFiles[0].text).toString("base64")}`);
let checks = 0;
const failures = [];
const check = (good, what) => (++checks, good || (failures.push(what), console.log(`FAILED ${what}`)));

/** Corners of boxes: thigh, shin and foot. */
const corners = (...boxes) => boxes.flatMap(([low, high]) => [0, 1, 2, 3, 4, 5, 6, 7].flatMap((k) => low.map((v, i) => (k >> i) & 1 ? high[i] : v)));
const LEGS = {
  straight: corners([[-90, -100, -120], [90, 90, 420]], [[-55, -60, 420], [55, 60, 830]], [[-40, -70, 800], [45, 190, 900]]),
  bent: corners([[-90, -100, -120], [90, 90, 420]], [[-55, -420, 380], [55, 0, 470]], [[-40, -480, 380], [45, -400, 600]]),
  thigh: corners([[-85, -85, 0], [110, 80, 300]]),
};
const SIDES = [[0.74, 0.52, -0.43], [-0.74, 0.52, -0.43], [0.5, 0.8, -0.25], [0, -1, 0.01], [0.1, 0.05, -1], [0.3, -0.7, 0.6]];
const NEARER = 0.98;

/** Where the points are in the picture, as shares of half its width and height; depth from -1 to 1. */
function seen(points, { target_mm, away_mm }, away, up, width, height) {
  const camera = new THREE.PerspectiveCamera(THREE.MathUtils.radToDeg(2 * Math.atan(halfView(width, height).y)), width / height, 10, 8000);
  camera.up.set(...up);
  camera.position.set(...target_mm).addScaledVector(new THREE.Vector3(...away).normalize(), away_mm);
  camera.lookAt(...target_mm);
  camera.updateMatrixWorld();
  return Array.from({ length: points.length / 3 }, (_, i) => new THREE.Vector3().fromArray(points, 3 * i).project(camera));
}

for (const [leg, points] of Object.entries(LEGS))
  for (const away of SIDES)
    for (const up of [[0, 1, 0], [0, -1, 0], [0, 0, -1]])
      for (const height of [180, 440, 1000])
        for (const aspect of [0.4, 0.6, 0.78, 1, 1.33, 1.78, 2.4, 3]) {
          if (Math.hypot(...new THREE.Vector3(...away).normalize().cross(new THREE.Vector3(...up)).toArray()) < 0.05) continue; // no such view
          const width = aspect * height;
          const where = `${leg} from ${away.join()}, up ${up.join()}, in ${Math.round(width)} x ${height}`;
          const found = stand(points, away, up, width, height);
          const extent = (at) => {
            const all = seen(points, at, away, up, width, height);
            const of = (k, by) => by(...all.map((p) => p[k]));
            return { left: -of("x", Math.min), right: of("x", Math.max), below: -of("y", Math.min), above: of("y", Math.max), near: of("z", Math.min), far: of("z", Math.max) };
          };
          const e = extent(found);
          const most = Math.max(e.left, e.right, e.below, e.above);
          check(most < 1 && e.near > -1 && e.far < 1, `all of it is seen: ${where}: ${most.toFixed(3)}`);
          const room = [[1 - e.left, width], [1 - e.right, width], [1 - e.below, height], [1 - e.above, height]].map(([share, px]) => (share * px) / 2);
          const least = Math.min(...[width, height].map((px) => Math.min(26, 0.16 * px)));
          check(Math.min(...room) > least - 0.5, `with room around it: ${where}: ${room.map((px) => px.toFixed(1)).join()} px`);
          check(Math.abs(e.left - e.right) < 1e-6 || Math.abs(e.above - e.below) < 1e-6, `in the middle of the picture: ${where}`);
          const n = extent({ ...found, away_mm: NEARER * found.away_mm });
          const gone = [1 - n.left, 1 - n.right].some((s) => (s * width) / 2 < Math.min(26, 0.16 * width)) || [1 - n.below, 1 - n.above].some((s) => (s * height) / 2 < Math.min(26, 0.16 * height));
          check(gone, `nearer it would not be: ${where}`);
        }

console.log(`${checks} checks, ${failures.length} failed`);
process.exit(failures.length || checks < 1000 ? 1 : 0);
