// Where the operator holds the probe: a point on the resting skin, its inward normal, tilt and
// rotation, and how deep. No DOM, no three.js. Lengths are mm, angles rad.

import type { Quat, Site, Vec3 } from "./protocol";

const CUT_END = 0.9; // a face whose normal is this much along the leg
export const DEPTH_MIN_MM = -20;
export const DEPTH_MAX_MM = 45;

export const add = (a: Vec3, b: Vec3, s = 1): Vec3 => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const sub = (a: Vec3, b: Vec3): Vec3 => add(a, b, -1);
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const length = (a: Vec3): number => Math.hypot(a[0], a[1], a[2]);
export const unit = (a: Vec3): Vec3 => {
  const n = length(a);
  return n > 1e-9 ? [a[0] / n, a[1] / n, a[2] / n] : [0, 0, 1];
};

/** Quaternion of the rotation whose columns are the frame's axes. */
function quaternion(x: Vec3, y: Vec3, z: Vec3): Quat {
  const trace = x[0] + y[1] + z[2];
  let q: Quat;
  if (trace > 0) q = [1 + trace, y[2] - z[1], z[0] - x[2], x[1] - y[0]];
  else if (x[0] > y[1] && x[0] > z[2]) q = [y[2] - z[1], 1 + x[0] - y[1] - z[2], y[0] + x[1], z[0] + x[2]];
  else if (y[1] > z[2]) q = [z[0] - x[2], y[0] + x[1], 1 + y[1] - x[0] - z[2], z[1] + y[2]];
  else q = [x[1] - y[0], z[0] + x[2], z[1] + y[2], 1 + z[2] - x[0] - y[1]];
  const n = Math.hypot(...q);
  return [q[0] / n, q[1] / n, q[2] / n, q[3] / n];
}

/** v turned by the quaternion q. */
export function rotate(q: Quat, v: Vec3): Vec3 {
  const u: Vec3 = [q[1], q[2], q[3]];
  const t = cross(u, v);
  return add(add(v, t, 2 * q[0]), cross(u, t), 2);
}

/** v turned about the unit axis k. */
function turn(v: Vec3, k: Vec3, angle: number): Vec3 {
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  return add(add([v[0] * c, v[1] * c, v[2] * c], cross(k, v), s), k, dot(k, v) * (1 - c));
}

export interface Pose {
  position_mm: Vec3;
  rotation: Quat;
}

/** Holds the skin's points and their normals, averaged over a probe's footprint. */
export class Skin {
  readonly normals: Float32Array;
  constructor(
    readonly points: Float32Array,
    faces: Uint32Array,
  ) {
    this.normals = new Float32Array(points.length);
    for (let f = 0; f < faces.length; f += 3) this.addFace(faces[f]!, faces[f + 1]!, faces[f + 2]!);
  }

  private addFace(a: number, b: number, c: number): void {
    const n = cross(sub(this.point(b), this.point(a)), sub(this.point(c), this.point(a)));
    if (Math.abs(n[2]) > CUT_END * length(n)) return; // a cut end of the leg (z is its axis) is no skin
    for (const i of [a, b, c]) for (let k = 0; k < 3; ++k) this.normals[3 * i + k]! += n[k]!;
  }

  point(i: number): Vec3 {
    return [this.points[3 * i]!, this.points[3 * i + 1]!, this.points[3 * i + 2]!];
  }

  /** Outward normal at a point, weighted by area and distance so that small bumps do not matter. */
  normalAt(p: Vec3, radius_mm = 14): Vec3 {
    let n: Vec3 = [0, 0, 0];
    const reach2 = 9 * radius_mm * radius_mm;
    for (let i = 0; i < this.points.length; i += 3) {
      const dx = this.points[i]! - p[0];
      const dy = this.points[i + 1]! - p[1];
      const dz = this.points[i + 2]! - p[2];
      const d2 = dx * dx + dy * dy + dz * dz;
      if (d2 > reach2) continue;
      const w = Math.exp((-0.5 * d2) / (radius_mm * radius_mm));
      n = add(n, [this.normals[i]!, this.normals[i + 1]!, this.normals[i + 2]!], w);
    }
    return unit(n);
  }
}

export class Hold {
  point: Vec3 = [0, 0, 0];
  normal: Vec3 = [0, 1, 0];
  depth_mm = -8;
  /** about the beam axis, and of the beam out of the normal towards x and y */
  rotation = 0;
  tiltX = 0;
  tiltY = 0;

  at(point: Vec3, normal: Vec3): void {
    this.point = point;
    this.normal = normal;
  }

  atSite(site: Site): void {
    this.at(site.position_mm, site.normal);
  }

  straighten(): void {
    this.rotation = this.tiltX = this.tiltY = 0;
  }

  setDepth(depth_mm: number): void {
    this.depth_mm = Math.min(DEPTH_MAX_MM, Math.max(DEPTH_MIN_MM, depth_mm));
  }

  /** Axes of the probe: x across the leg, z into the tissue. */
  axes(): [Vec3, Vec3, Vec3] {
    let z: Vec3 = [-this.normal[0], -this.normal[1], -this.normal[2]];
    let x = unit(cross([0, 0, 1], this.normal));
    x = turn(x, z, this.rotation);
    let y = cross(z, x);
    z = turn(z, y, this.tiltX);
    x = turn(x, y, this.tiltX);
    z = turn(z, x, this.tiltY);
    y = cross(z, x);
    return [x, y, z];
  }

  /** Takes over a pose of the probe as it is, untilted, with its depth below the skin. */
  adopt(position_mm: Vec3, rotation: Quat, depth_mm: number): void {
    const z = rotate(rotation, [0, 0, 1]);
    this.straighten();
    this.at(add(position_mm, z, -depth_mm), [-z[0], -z[1], -z[2]]);
    this.setDepth(depth_mm);
    const [x, y] = this.axes();
    const now = rotate(rotation, [1, 0, 0]);
    this.rotation = Math.atan2(dot(now, y), dot(now, x));
  }

  pose(): Pose {
    const [x, y, z] = this.axes();
    return { position_mm: add(this.point, this.normal, -this.depth_mm), rotation: quaternion(x, y, z) };
  }
}

/** The site nearest to a point, and how far it is. */
export function nearestSite(sites: readonly Site[], p: Vec3): { site: Site; distance_mm: number } | null {
  let best: Site | null = null;
  let distance_mm = Infinity;
  for (const site of sites) {
    const d = length(sub(site.position_mm, p));
    if (d < distance_mm) [best, distance_mm] = [site, d];
  }
  return best ? { site: best, distance_mm } : null;
}
