// The thigh drawn without WebGL, on a plain canvas: skin shaded by displacement, vessels, sites, probe, image
// plane and the wanted ring, seen by the same camera, so that dragging and turning work as ever. Lengths are mm.

import * as THREE from "three";
import { shade } from "./colour";
import type { ProbeInfo, Site, Target, Vec3 } from "./protocol";
import { ink } from "./theme";

const LIGHTS = 10; // steps of brightness
const SHADES = 8; // steps of displacement
const HANDLE_MM = 46;
const RING_POINTS = 40;
const EVERY_MS = 50; // a processor that draws has other work too
const LIGHT = new THREE.Vector3(0.45, 0.8, -0.4).normalize();

export interface FlatVessel {
  /** x, y, z, radius */
  points: Float32Array;
  vein: boolean;
  /** a clot that is being placed */
  marked?: boolean;
}

/** What there is to see. */
export interface FlatScene {
  camera: THREE.PerspectiveCamera;
  /** deformed skin and the size of each node's displacement relative to the legend's top */
  skin: { points: ArrayLike<number>; faces: ArrayLike<number>; moved(node: number): number } | null;
  vessels: readonly FlatVessel[];
  sites: readonly Site[];
  probe: { info: ProbeInfo; frame: THREE.Matrix4 } | null;
  image_mm: [number, number];
  target: { target: Target; reached: boolean } | null;
  through: boolean;
}

type Point = [number, number];

export class FlatView {
  private readonly c: CanvasRenderingContext2D;
  private drawn_ms = -EVERY_MS;
  private width = 0;
  private height = 0;
  private readonly matrix = new THREE.Matrix4();

  constructor(readonly canvas: HTMLCanvasElement) {
    const c = canvas.getContext("2d");
    if (!c) throw new Error("this browser has no 2D canvas");
    this.c = c;
  }

  /** False when the last picture is too recent: ask again. */
  draw(scene: FlatScene): boolean {
    if (performance.now() - this.drawn_ms < EVERY_MS) return false;
    this.drawn_ms = performance.now();
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const ratio = Math.min(2, window.devicePixelRatio);
    if (this.canvas.width !== Math.round(w * ratio)) this.canvas.width = Math.round(w * ratio);
    if (this.canvas.height !== Math.round(h * ratio)) this.canvas.height = Math.round(h * ratio);
    [this.width, this.height] = [w, h];
    this.c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.c.clearRect(0, 0, w, h);
    scene.camera.updateMatrixWorld();
    this.matrix.multiplyMatrices(scene.camera.projectionMatrix, scene.camera.matrixWorldInverse);
    if (scene.skin) this.skin(scene.skin, scene.through);
    if (scene.through) for (const vessel of scene.vessels) this.vessel(vessel);
    this.sites(scene);
    if (scene.target) this.ring(scene.target.target, scene.target.reached);
    if (scene.probe) this.probe(scene.probe.info, scene.probe.frame, scene.through ? scene.image_mm : null);
    return true;
  }

  private project(x: number, y: number, z: number): Point {
    const e = this.matrix.elements;
    const w = e[3]! * x + e[7]! * y + e[11]! * z + e[15]!;
    const u = (e[0]! * x + e[4]! * y + e[8]! * z + e[12]!) / w;
    const v = (e[1]! * x + e[5]! * y + e[9]! * z + e[13]!) / w;
    return [((u + 1) / 2) * this.width, ((1 - v) / 2) * this.height];
  }

  /** Faces that look at the camera; those of one colour are filled together. */
  private skin(skin: NonNullable<FlatScene["skin"]>, through: boolean): void {
    const p = skin.points;
    const screen = new Float32Array((p.length / 3) * 2);
    for (let i = 0, k = 0; i < p.length; i += 3, k += 2) screen.set(this.project(p[i]!, p[i + 1]!, p[i + 2]!), k);
    const paths = new Map<number, Path2D>();
    const [a, b, n] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    for (let f = 0; f < skin.faces.length; f += 3) {
      const [i, j, k] = [skin.faces[f]!, skin.faces[f + 1]!, skin.faces[f + 2]!];
      const [x, y] = [screen[2 * i]!, screen[2 * i + 1]!];
      const area = (screen[2 * j]! - x) * (screen[2 * k + 1]! - y) - (screen[2 * k]! - x) * (screen[2 * j + 1]! - y);
      if (area >= 0) continue; // counter-clockwise from outside, and the screen's y points down
      a.set(p[3 * j]! - p[3 * i]!, p[3 * j + 1]! - p[3 * i + 1]!, p[3 * j + 2]! - p[3 * i + 2]!);
      b.set(p[3 * k]! - p[3 * i]!, p[3 * k + 1]! - p[3 * i + 1]!, p[3 * k + 2]! - p[3 * i + 2]!);
      const light = Math.round((LIGHTS - 1) * (0.5 + 0.5 * n.crossVectors(a, b).normalize().dot(LIGHT)));
      const moved = Math.round((SHADES - 1) * Math.min(1, (skin.moved(i) + skin.moved(j) + skin.moved(k)) / 3));
      const key = moved * LIGHTS + light;
      let path = paths.get(key);
      if (!path) paths.set(key, (path = new Path2D()));
      path.moveTo(x, y);
      path.lineTo(screen[2 * j]!, screen[2 * j + 1]!);
      path.lineTo(screen[2 * k]!, screen[2 * k + 1]!);
      path.closePath();
    }
    this.c.lineWidth = 0.7; // closes the seams between faces
    for (const [key, path] of paths) {
      const colour = shade(Math.floor(key / LIGHTS) / (SHADES - 1), 0.35 + (through ? 0.5 : 0.75) * ((key % LIGHTS) / (LIGHTS - 1)));
      this.c.fillStyle = this.c.strokeStyle = colour;
      this.c.fill(path);
      this.c.stroke(path);
    }
  }

  private line(points: Point[], closed = false): void {
    this.c.beginPath();
    points.forEach(([x, y], i) => (i ? this.c.lineTo(x, y) : this.c.moveTo(x, y)));
    if (closed) this.c.closePath();
  }

  private vessel({ points, vein, marked }: FlatVessel): void {
    const middle: Point[] = [];
    let radius_mm = 0;
    for (let i = 0; i < points.length; i += 4) {
      middle.push(this.project(points[i]!, points[i + 1]!, points[i + 2]!));
      radius_mm += points[i + 3]! / (points.length / 4);
    }
    if (middle.length < 2) return;
    const c = this.c;
    const [a, b] = [middle[0]!, middle[middle.length - 1]!];
    const length_mm = Math.hypot(points[points.length - 4]! - points[0]!, points[points.length - 3]! - points[1]!, points[points.length - 2]! - points[2]!);
    c.strokeStyle = ink(marked ? "leg-clot" : vein ? "leg-vein" : "leg-artery");
    c.globalAlpha = 0.85;
    c.lineCap = c.lineJoin = "round";
    c.lineWidth = Math.max(2, (2 * radius_mm * Math.hypot(b[0] - a[0], b[1] - a[1])) / Math.max(1, length_mm));
    this.line(middle);
    c.stroke();
    c.globalAlpha = 1;
  }

  /** Sites on the side that the camera sees. */
  private sites(scene: FlatScene): void {
    const eye = scene.camera.position;
    this.c.fillStyle = ink("leg-site");
    for (const { position_mm: p, normal: n } of scene.sites) {
      if ((eye.x - p[0]) * n[0] + (eye.y - p[1]) * n[1] + (eye.z - p[2]) * n[2] <= 0) continue;
      const [x, y] = this.project(...p);
      this.c.beginPath();
      this.c.arc(x, y, 2.2, 0, 2 * Math.PI);
      this.c.fill();
    }
  }

  private ring(target: Target, reached: boolean): void {
    const z = new THREE.Vector3(...target.normal).normalize();
    const x = new THREE.Vector3(...target.across);
    x.addScaledVector(z, -x.dot(z)).normalize();
    const y = new THREE.Vector3().crossVectors(z, x);
    const r = Math.max(5, target.radius_mm);
    const at = (u: number, v: number): Point => {
      const p = new THREE.Vector3(...target.position_mm).addScaledVector(x, u).addScaledVector(y, v);
      return this.project(p.x, p.y, p.z);
    };
    this.c.strokeStyle = reached ? ink("leg-reached") : ink("leg-wanted");
    this.c.lineWidth = 3;
    this.line(Array.from({ length: RING_POINTS }, (_, i) => at(r * Math.cos((2 * Math.PI * i) / RING_POINTS), r * Math.sin((2 * Math.PI * i) / RING_POINTS))), true);
    this.c.stroke();
    for (const side of [-1, 1]) {
      this.line([at(side * (r + 1.5), 0), at(side * (r + 10.5), 0)]);
      this.c.stroke();
    }
  }

  private probe(info: ProbeInfo, frame: THREE.Matrix4, image_mm: [number, number] | null): void {
    const at = (x: number, y: number, z: number): Point => {
      const p = new THREE.Vector3(x, y, z).applyMatrix4(frame);
      return this.project(p.x, p.y, p.z);
    };
    const [hx, hy] = [info.half_x_mm, Math.max(2, info.half_y_mm)];
    const face = (z: number): Point[] => ([[-hx, -hy], [hx, -hy], [hx, hy], [-hx, hy]] as Point[]).map(([x, y]) => at(x, y, z));
    const [low, high] = [face(0), face(-HANDLE_MM)];
    const c = this.c;
    if (image_mm) {
      const [w, h] = [image_mm[0] / 2, image_mm[1]];
      this.line([at(-w, 0, 0), at(w, 0, 0), at(w, 0, h), at(-w, 0, h)], true);
      c.fillStyle = ink("leg-plane");
      c.strokeStyle = ink("leg-mark");
      c.lineWidth = 1;
      c.fill();
      c.stroke();
    }
    c.fillStyle = ink("leg-probe");
    c.strokeStyle = ink("leg-probe-edge");
    c.lineWidth = 1;
    for (let i = 0; i < 4; ++i) {
      const k = (i + 1) % 4;
      c.globalAlpha = 0.3;
      this.line([low[i]!, low[k]!, high[k]!, high[i]!], true);
      c.fill();
      c.globalAlpha = 0.8;
      c.stroke();
    }
    c.globalAlpha = 1;
    this.line(low, true);
    c.lineWidth = 2;
    c.stroke();
    const [mx, my] = at(-hx, 0, 0); // the image's left side
    c.fillStyle = ink("leg-mark");
    c.beginPath();
    c.arc(mx, my, 4.5, 0, 2 * Math.PI);
    c.fill();
  }
}

/** Displacement of a node relative to the legend's top. */
export const movedShare = (rest: Float32Array, now: ArrayLike<number>, range_mm: number) => (node: number): number => {
  const d: Vec3 = [now[3 * node]! - rest[3 * node]!, now[3 * node + 1]! - rest[3 * node + 1]!, now[3 * node + 2]! - rest[3 * node + 2]!];
  return Math.hypot(...d) / range_mm;
};
