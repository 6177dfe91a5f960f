// The report of a scene: its bodies as they stand, turned by dragging, with their measures and contacts.

import { Page, s } from "./dom";
import { drawing, text, textWidth } from "./chart";
import { type Camera, cross, dot, look, madd, paint, scaleBar, type Surface, unit, type Vector } from "./mesh";
import { fixed, grouped, type Real, real, significant } from "./number";
import { columns } from "./table";

interface Body {
  name: string;
  kind: string;
  nodes: number;
  seen: boolean; // in the view; others are too far from the rest
  mass_kg: Real;
  centre_mm: Real[];
  speed_mm_s: Real;
  kinetic_mj: Real;
  elastic_mj: Real;
  position_mm: Real[];
  face: number[];
}

interface SceneReport {
  title: string;
  version: string;
  time_s: number;
  steps: number;
  flagged_steps: number;
  gravity_m_s2: number[];
  bodies: Body[];
  contacts: { a: string; b: string; normal_n: Real; friction_n: Real; depth_mm: Real; area_mm2: Real; volume_mm3: Real; energy_mj: Real }[];
}

const WIDTH = 830;
const BOX = { left: 12, top: 12, width: WIDTH - 24, height: 480 };
const SHADES = 24;
const BASE: Vector[] = [
  [214, 196, 168],
  [214, 106, 84],
  [92, 138, 190],
  [128, 128, 134],
  [112, 168, 110],
  [186, 140, 190],
];

const colour = (body: number, lit: number): string => {
  const light = 0.5 + (0.58 * Math.min(SHADES - 1, Math.floor(lit * SHADES))) / (SHADES - 1);
  return `rgb(${BASE[body % BASE.length]!.map((v) => Math.min(255, Math.round(v * light))).join(" ")})`;
};

/** The view from an angle around the upright axis and above the horizon, both in radians. */
function cameraAt(report: SceneReport, surfaces: Surface[], around: number, above: number): Camera {
  const [x, y, z] = report.gravity_m_s2 as Vector;
  const up = unit([-x, -y, -z], [0, 0, 1]);
  const axis: Vector = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 0, 1];
  const side = unit(madd(axis, -dot(axis, up), up));
  const front = cross(side, up);
  const level = madd(madd([0, 0, 0], Math.cos(around), front), Math.sin(around), side);
  return look(madd(madd([0, 0, 0], Math.cos(above), level), Math.sin(above), up), up, surfaces.filter((_surface, b) => report.bodies[b]!.seen), BOX);
}

/** Draws the bodies into a group; the names and the time stay as they are when the view turns. */
function drawBodies(report: SceneReport, surfaces: Surface[], around: number, above: number): SVGElement {
  const camera = cameraAt(report, surfaces, around, above);
  const seen = surfaces.map((surface, b): Surface => (report.bodies[b]!.seen ? surface : { position: surface.position, face: [] }));
  const light = unit(madd(madd(camera.toward, 1.1, camera.up), -0.5, camera.right)); // from above the viewer's left shoulder
  return s("g", {}, paint(camera, seen, (body, _face, normal) => colour(body, Math.max(0, dot(normal, light)))), scaleBar(camera, BOX.left, BOX.top + BOX.height - 4));
}

function figureOf(report: SceneReport, surfaces: Surface[]): SVGElement {
  let [around, above] = [0.55, 0.42];
  const foot = BOX.top + BOX.height + 24;
  const names: SVGElement[] = [];
  let [x, y] = [12, foot];
  report.bodies.forEach((body, b) => {
    const name = body.seen ? body.name : `${body.name} (out of view)`;
    const width = 34 + textWidth(name, 12);
    if (x > 12 && x + width > WIDTH - (y === foot ? 100 : 12)) [x, y] = [12, y + 18];
    names.push(s("rect", { x, y: y - 10, width: 11, height: 11, fill: colour(b, 0.98) }), text(x + 16, y, "", name));
    x += width;
  });
  const svg = drawing(WIDTH, y + 12);
  let bodies = drawBodies(report, surfaces, around, above);
  svg.append(bodies, ...names);
  svg.append(text(WIDTH - 12, foot, "end", `t = ${fixed(report.time_s, 3)} s`));
  svg.style.cursor = "grab";
  svg.style.touchAction = "none";
  svg.onpointerdown = (e) => svg.setPointerCapture(e.pointerId);
  svg.onpointermove = (e) => {
    if (!svg.hasPointerCapture(e.pointerId)) return;
    around -= 0.008 * e.movementX;
    above = Math.max(-1.5, Math.min(1.5, above + 0.008 * e.movementY));
    const turned = drawBodies(report, surfaces, around, above);
    bodies.replaceWith(turned);
    bodies = turned;
  };
  return svg;
}

export function scene(data: unknown): void {
  const report = data as SceneReport;
  const page = new Page(report.title);
  page.facts([["Time", `${fixed(report.time_s, 4)} s, ${grouped(report.steps)} steps`], ["Version", report.version]]);
  if (report.flagged_steps) page.notes([`${grouped(report.flagged_steps)} steps were flagged: the solver did not converge, contact was full or a step was undone.`]);
  const surfaces = report.bodies.map((body): Surface => ({ position: body.position_mm.map(real), face: body.face }));
  const bodies = page.section("bodies", "Bodies");
  page.figure(bodies, figureOf(report, surfaces), { name: "scene", title: "The bodies as they stand", caption: "A parallel projection; drag to turn it." });
  page.table(bodies, {
    caption: "Bodies at this time. Centre and speed are those of the body as a whole.",
    columns: columns("<Body", "<Kind", "Nodes", "Mass, kg", "Centre x, mm", "y, mm", "z, mm", "Speed, mm/s", "Kinetic, mJ", "Elastic, mJ"),
    rows: report.bodies.map((b) => ({ cells: [b.name, b.kind, b.nodes ? grouped(b.nodes) : "", significant(b.mass_kg, 4), ...[0, 1, 2].map((k) => fixed(b.centre_mm[k], 2)), ...[b.speed_mm_s, b.kinetic_mj, b.elastic_mj].map((v) => significant(v, 4))] })),
  });
  if (report.contacts.length)
    page.table(page.section("contacts", "Contacts"), {
      caption: "Contacts in the last step. Normal: sum of the pushes; friction: size of its resultant.",
      columns: columns("<Body", "<against", "Normal, N", "Friction, N", "Depth, mm", "Area, mm\u00b2", "Volume, mm\u00b3", "Energy, mJ"),
      rows: report.contacts.map((c) => ({ cells: [c.a, c.b, ...[c.normal_n, c.friction_n, c.depth_mm, c.area_mm2, c.volume_mm3, c.energy_mj].map((v) => significant(v, 4))] })),
    });
  page.show();
}
