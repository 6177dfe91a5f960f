// Maps of the parameters on the skin, seen along the mean normal of the sites, and of the error by site.

import { type Axis, axis, range, tickLabel, tightAxis } from "./axis";
import { drawing, text } from "./chart";
import { sequential } from "./colour";
import { h, type Page, paragraph, s } from "./dom";
import type { FitReport, Site } from "./fit_data";
import { type Camera, cross, dot, look, madd, paint, project, scaleBar, type Surface, unit, type Vector, vertex } from "./mesh";
import { isKnown, type Real, real, signed } from "./number";

const LEFT = 10;
const TOP = 16;
const INSIDE = 320;
const LEVELS = 28;
const SHADES = 10;

interface MapOptions {
  name: string;
  title: string;
  caption: string;
  values: { nodes: number[] } | { sites: Map<number, number> };
  range: Axis;
}

const vector = (v: Real[]): Vector => [real(v[0]), real(v[1]), real(v[2])];
const isFinite3 = (v: Vector): boolean => v.every(Number.isFinite);
const sum = (vectors: Vector[]): Vector => vectors.filter(isFinite3).reduce((a, b) => madd(a, 1, b), [0, 0, 0] as Vector);

function cameraOf(sites: Site[], skin: Surface): Camera {
  const along = sum(sites.map((site) => vector(site.along)));
  const down: Vector = Math.hypot(...along) > 0.1 ? along : [0, 0, 1];
  return look(sum(sites.map((site) => vector(site.normal))), [-down[0], -down[1], -down[2]], [skin], { left: LEFT, top: TOP, width: INSIDE, height: 560 });
}

/** The middle 98 % of the nodes that face the viewer: the cut ends of the leg must not set the colours. */
function rangeOf(label: string, values: number[], normals: Vector[], camera: Camera): Axis {
  const seen = values.filter((v, i) => Number.isFinite(v) && dot(normals[i]!, camera.toward) > 0.5).sort((a, b) => a - b);
  const at = (share: number): number => seen[Math.round(share * (seen.length - 1))]!;
  return seen.length ? tightAxis(label, at(0.01), at(0.99), 6) : tightAxis(label, 0, 1, 6);
}

function nodeNormals(skin: Surface): Vector[] {
  const normals = Array.from({ length: skin.position.length / 3 }, (): Vector => [0, 0, 0]);
  for (let f = 0; f < skin.face.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => vertex(skin, skin.face[f + k]!)) as [Vector, Vector, Vector];
    const normal = cross(madd(b, -1, a), madd(c, -1, a));
    for (let k = 0; k < 3; ++k) normals[skin.face[f + k]!] = madd(normals[skin.face[f + k]!]!, 1, normal);
  }
  return normals.map((n) => unit(n));
}

function drawKey(into: SVGElement, x: number, y: number, height: number, key: Axis): void {
  const parts = 48; // whole pixels: no seam shows between two parts
  for (let i = 0; i < parts; ++i)
    into.append(s("rect", { x, y: y + (height * (parts - 1 - i)) / parts, width: 14, height: height / parts, fill: sequential((i + 0.5) / parts), "shape-rendering": "crispEdges" }));
  for (const tick of key.ticks) {
    const at = y + (height * (key.high - tick)) / (key.high - key.low);
    into.append(s("line", { x1: x + 14, x2: x + 18, y1: at, y2: at, class: "axis" }), text(x + 22, at + 4, "tick", tickLabel(key, tick)));
  }
  into.append(text(x + 36, y - 14, "tick end", key.label));
}

/** Dots, coloured where the sites have values, and as many labels as have room. */
function drawSites(into: SVGElement, sites: Site[], c: Camera, values: Map<number, number> | null, key: Axis): void {
  const seen = sites.filter((site) => isFinite3(vector(site.position_mm)) && dot(vector(site.normal), c.toward) > 0.15 && (!values || values.has(site.id)));
  for (const site of seen) {
    const [cx, cy] = project(c, vector(site.position_mm));
    const fill = values ? sequential((values.get(site.id)! - key.low) / (key.high - key.low)) : "#fff";
    into.append(s("circle", { cx, cy, r: values ? 6.5 : 2.4, fill, stroke: "#333", "stroke-width": 0.8 }));
  }
  const taken: [number, number][] = [];
  for (const site of seen) {
    const [x, y] = project(c, vector(site.position_mm));
    if (taken.some(([a, b]) => Math.abs(a - x) < 14 && Math.abs(b - y + 7) < 10)) continue;
    taken.push([x, y - 7]);
    into.append(text(x, y - 7, "small middle halo", String(site.id)));
  }
}

function drawMap(skin: Surface, sites: Site[], c: Camera, m: MapOptions): SVGElement {
  const height = TOP + Math.max(c.height, 320) + 34;
  const svg = drawing(440, height);
  const nodes = "nodes" in m.values ? m.values.nodes : null;
  // Light from the viewer: at most an eighth darker where the skin turns away.
  const colourOf = (_: number, f: number, normal: Vector): string | null => {
    const shade = 0.875 + (0.125 * Math.min(SHADES - 1, Math.floor(dot(normal, c.toward) * SHADES))) / (SHADES - 1);
    if (!nodes) return `rgb(${Math.round(232 * shade)} ${Math.round(232 * shade)} ${Math.round(232 * shade)})`;
    const value = [0, 1, 2].reduce((total, k) => total + nodes[skin.face[3 * f + k]!]! / 3, 0);
    if (!Number.isFinite(value)) return null;
    const t = Math.max(0, Math.min(1, (value - m.range.low) / (m.range.high - m.range.low)));
    return sequential((Math.min(LEVELS - 1, Math.floor(t * LEVELS)) + 0.5) / LEVELS, shade);
  };
  svg.append(paint(c, [skin], colourOf, 12, Infinity));
  drawSites(svg, sites, c, "sites" in m.values ? m.values.sites : null, m.range);
  svg.append(scaleBar(c, LEFT, height - 12));
  drawKey(svg, LEFT + INSIDE + 44, TOP + 30, 240, m.range);
  return svg;
}

export function fitMaps(page: Page, report: FitReport): void {
  const skin = report.skin;
  if (!skin) return;
  const surface: Surface = { position: skin.position_mm.map(real), face: skin.face };
  if (!surface.position.every(Number.isFinite)) return;
  const section = page.section("maps", "Maps of the thigh");
  section.append(paragraph("The skin seen along the mean normal of the sites, without perspective; the footprint axis v points down. Numbers are sites. Between them values are interpolated, beyond them extrapolated: there the colours are an assumption. Colours span the middle 98\u00a0% of what faces the viewer."));
  const pair = h("div", { class: "pair" });
  section.append(pair);
  const camera = cameraOf(report.sites, surface);
  const normals = nodeNormals(surface);
  const field = (name: string, label: string, values: Real[] | undefined, title: string, caption: string): void => {
    if (!values) return;
    const nodes = values.map(real);
    page.figure(pair, drawMap(surface, report.sites, camera, { name, title, caption, values: { nodes }, range: rangeOf(label, nodes, normals, camera) }), { name, title, caption });
  };
  const [k0, xm] = [skin.fat_correlates_with_k0, skin.fat_correlates_with_xm];
  const fat = isKnown(k0) && isKnown(xm) ? ` Over the sites the thickness of the fat correlates with k\u2080 by ${signed(k0, 2)} and with x\u2098 by ${signed(xm, 2)}.` : "";
  field("map-k0", "k\u2080, kPa/mm", skin.k0_kpa_mm, "Initial stiffness k\u2080 of the normal springs", "Pressure per depth at the first touch: light is stiff.");
  field("map-xm", "x\u2098, mm", skin.xm_mm, "Greatest compression x\u2098 of the normal springs", "The depth at which the springs would become rigid: dark is where little can be compressed.");
  field("map-shear", "G, N/m", skin.shear_n_m, "Stiffness G of the shear layer", "How strongly the skin pulls its surroundings along: light is strongly.");
  field("map-limit", "g\u2098", skin.shear_limit, "Limit g\u2098 of the shear layer", "The slope of the skin at which the layer would become rigid.");
  field("map-depth", "depth, mm", skin.muscle_depth_mm, "Depth of the muscle", `Distance from the skin to the muscle: skin and fat together.${fat}`);
  const sites = new Map((report.errors?.sites ?? []).filter((e) => isKnown(e.percent_of_mean)).map((e) => [e.site, real(e.percent_of_mean)]));
  const most = range(sites.values(), 0)[1];
  if (!(most > 0)) return;
  const options = { name: "map-error", title: "Error by site", caption: "MAE of each site over its mean measured force, all probes and depths. Where light sites lie side by side, the model falls short of that part of the thigh." };
  page.figure(pair, drawMap(surface, report.sites, camera, { ...options, values: { sites }, range: axis("MAE, %", 0, most, 5) }), options);
}
