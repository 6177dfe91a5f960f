// Surfaces in a parallel projection: faces turned to the viewer, painted from back to front in thin layers of depth,
// one path per layer and colour.

import { niceStep } from "./axis";
import { text } from "./chart";
import { s } from "./dom";
import { short } from "./number";

export type Vector = [number, number, number];

export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vector, b: Vector): Vector => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const madd = (a: Vector, t: number, b: Vector): Vector => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
export const unit = (a: Vector, otherwise: Vector = [0, 0, 0]): Vector => {
  const size = Math.hypot(...a);
  return size > 1e-12 ? [a[0] / size, a[1] / size, a[2] / size] : otherwise;
};

export interface Surface {
  /** x, y, z of each vertex */
  position: number[];
  /** three vertices of each face, counter-clockwise seen from outside */
  face: number[];
}

export const vertex = (surface: Surface, i: number): Vector => [surface.position[3 * i]!, surface.position[3 * i + 1]!, surface.position[3 * i + 2]!];

/** Axes of the view as unit vectors, pixels per unit of length, pixels of the origin. */
export interface Camera {
  right: Vector;
  up: Vector;
  toward: Vector;
  scale: number;
  x: number;
  y: number;
  /** of the drawn surfaces, in pixels */
  height: number;
}

/** Looks against `toward`, with `up` upwards as far as it can be; the surfaces fill a box of pixels. */
export function look(toward: Vector, up: Vector, surfaces: Surface[], box: { left: number; top: number; width: number; height: number }): Camera {
  const front = unit(toward, [0, 1, 0]);
  let upright = madd(up, -dot(up, front), front);
  if (Math.hypot(...upright) < 1e-6) upright = cross(front, [1, 0, 0]);
  upright = unit(upright, [1, 0, 0]);
  const right = cross(upright, front);
  let [left, bottom, far, top] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const surface of surfaces)
    for (let i = 0; 3 * i < surface.position.length; ++i) {
      const p = vertex(surface, i);
      const [x, y] = [dot(p, right), dot(p, upright)];
      [left, far, bottom, top] = [Math.min(left, x), Math.max(far, x), Math.min(bottom, y), Math.max(top, y)];
    }
  const scale = Math.min(box.width / Math.max(far - left, 1e-9), box.height / Math.max(top - bottom, 1e-9));
  return { right, up: upright, toward: front, scale, x: box.left + box.width / 2 - (scale * (left + far)) / 2, y: box.top + scale * top, height: scale * (top - bottom) };
}

export const project = (c: Camera, p: Vector): [number, number] => [c.x + c.scale * dot(p, c.right), c.y - c.scale * dot(p, c.up)];

/** A bar of a round length in mm, where the surfaces are in mm. */
export function scaleBar(c: Camera, x: number, y: number): SVGElement {
  const length_mm = niceStep(40 / c.scale);
  const end = x + length_mm * c.scale;
  const line = (x1: number, y1: number, x2: number, y2: number): SVGElement => s("line", { x1, y1, x2, y2, class: "axis" });
  return s("g", {}, line(x, y, end, y), line(x, y - 4, x, y + 4), line(end, y - 4, end, y + 4), text(end + 8, y + 4, "tick", `${short(length_mm)} mm`));
}

interface Piece {
  depth: number;
  colour: string;
  path: string;
}

/** Cuts a face along its longest edge until it is small, so that layers of depth order large faces too. */
function cut(c: Camera, corners: [Vector, Vector, Vector], colour: string, most_px: number, out: Piece[], deep = 0): void {
  const edges = corners.map((p, k) => Math.hypot(...madd(corners[(k + 1) % 3]!, -1, p)));
  const longest = edges.indexOf(Math.max(...edges));
  if (edges[longest]! * c.scale < most_px || deep === 12) {
    const path = corners.map((p) => project(c, p).map((v) => v.toFixed(1)).join(" ")).join("L");
    out.push({ depth: corners.reduce((sum, p) => sum + dot(p, c.toward) / 3, 0), colour, path: `M${path}z` });
    return;
  }
  const [a, b, other] = [0, 1, 2].map((k) => corners[(longest + k) % 3]!) as [Vector, Vector, Vector];
  const middle = madd(a, 0.5, madd(b, -1, a));
  cut(c, [a, middle, other], colour, most_px, out, deep + 1);
  cut(c, [middle, b, other], colour, most_px, out, deep + 1);
}

/**
 * Paints the faces that are turned to the viewer.
 * @param colourOf of a face with this unit normal; null: the face is left out
 * @param most_px longest edge of what is painted at once
 */
export function paint(c: Camera, surfaces: Surface[], colourOf: (surface: number, face: number, normal: Vector) => string | null, layers = 600, most_px = 14): SVGElement {
  const pieces: Piece[] = [];
  surfaces.forEach((surface, which) => {
    for (let f = 0; 3 * f < surface.face.length; ++f) {
      const corners = [0, 1, 2].map((k) => vertex(surface, surface.face[3 * f + k]!)) as [Vector, Vector, Vector];
      const normal = unit(cross(madd(corners[1], -1, corners[0]), madd(corners[2], -1, corners[0])));
      if (!(dot(normal, c.toward) > 0)) continue;
      const colour = colourOf(which, f, normal);
      if (colour) cut(c, corners, colour, most_px, pieces);
    }
  });
  const [nearest, farthest] = [pieces.reduce((high, p) => Math.max(high, p.depth), -Infinity), pieces.reduce((low, p) => Math.min(low, p.depth), Infinity)];
  const layered: Map<string, string[]>[] = Array.from({ length: layers }, () => new Map<string, string[]>());
  for (const p of pieces) {
    const layer = layered[Math.min(layers - 1, Math.floor(((p.depth - farthest) / Math.max(nearest - farthest, 1e-12)) * layers))]!;
    const list = layer.get(p.colour);
    if (list) list.push(p.path);
    else layer.set(p.colour, [p.path]);
  }
  // Strokes of the faces' own colour close the seams between them.
  const group = s("g", { "stroke-width": 0.6, "stroke-linejoin": "round", class: "surface" });
  for (const layer of layered) for (const [colour, paths] of layer) group.append(s("path", { d: paths.join(""), fill: colour, stroke: colour }));
  return group;
}
