// What the picture of a limb has beside its skin: the foot, which the model ends above, the knee cap's name,
// and which way is up for the patient. Lengths are mm.

import * as THREE from "three";
import type { LimbInfo } from "./protocol";
import { SOLID } from "./theme";
import { t } from "./words/language";

const POINTS = 28; // round a section
const ANKLE_MM = 36; // radius of the ankle that the sections are of
const RELAXED_RAD = 0.44; // a foot that carries nothing points downwards by this much

/** Sections of a foot from heel to toe: forward of the ankle, top and sole below its middle, half width. */
const SECTIONS: readonly (readonly [number, number, number, number])[] = [
  [-58, 38, 62, 12], [-52, 18, 74, 25], [-40, -6, 79, 31], [-18, -22, 80, 34], [12, -18, 79, 35], [40, 6, 77, 36],
  [75, 27, 76, 40], [110, 42, 77, 45], [145, 54, 80, 47], [172, 61, 80, 44], [192, 66, 79, 34], [201, 71, 77, 16],
];

/** A closed skin through the sections. */
function footGeometry(limb: LimbInfo): THREE.BufferGeometry {
  const scale = limb.ankle_radius_mm / ANKLE_MM;
  const standing = limb.position === "standing" || limb.position === "sitting";
  const turn = standing ? 0 : RELAXED_RAD;
  const [down, forward] = [new THREE.Vector3(...limb.down), new THREE.Vector3(...limb.forward)];
  const toes = forward.clone().multiplyScalar(Math.cos(turn)).addScaledVector(down, Math.sin(turn));
  const sole = down.clone().multiplyScalar(Math.cos(turn)).addScaledVector(forward, -Math.sin(turn));
  const across = new THREE.Vector3().crossVectors(sole, toes).normalize();
  const middle = new THREE.Vector3(...limb.ankle_mm);
  const points: number[] = [], faces: number[] = [];
  const put = (f: number, d: number, s: number): void => {
    const p = middle.clone().addScaledVector(toes, f * scale).addScaledVector(sole, d * scale).addScaledVector(across, s * scale);
    points.push(p.x, p.y, p.z);
  };
  for (const [f, top, bottom, half] of SECTIONS)
    for (let k = 0; k < POINTS; ++k) {
      const a = (2 * Math.PI * k) / POINTS;
      put(f, (top + bottom) / 2 - ((bottom - top) / 2) * Math.cos(a), half * Math.sin(a));
    }
  const last = (SECTIONS.length - 1) * POINTS;
  for (let i = 0; i < last; i += POINTS)
    for (let k = 0; k < POINTS; ++k) {
      const [a, b] = [i + k, i + ((k + 1) % POINTS)];
      faces.push(a, b, a + POINTS, b, b + POINTS, a + POINTS);
    }
  for (let k = 1; k + 1 < POINTS; ++k) faces.push(0, k + 1, k, last, last + k, last + k + 1);
  const g = new THREE.BufferGeometry();
  g.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  g.setIndex(faces);
  g.computeVertexNormals();
  return g;
}

export class Foot {
  readonly group = new THREE.Group();
  private readonly material = new THREE.MeshStandardMaterial({ color: SOLID.skin, roughness: 0.85, transparent: true, opacity: 0.5, side: THREE.DoubleSide });

  place(limb: LimbInfo | null): void {
    this.group.clear();
    if (limb) this.group.add(new THREE.Mesh(footGeometry(limb), this.material));
  }

  /** Where its skin is, mm. */
  points(): ArrayLike<number> {
    return (this.group.children[0] as THREE.Mesh | undefined)?.geometry.getAttribute("position").array ?? [];
  }

  /** Like the skin above it. */
  seeThrough(on: boolean): void {
    this.material.opacity = on ? 0.35 : 1;
    this.material.depthWrite = !on;
    this.material.needsUpdate = true;
  }
}

/** "Left leg, prone, the knee bent". */
export const limbWords = (limb: LimbInfo): string => t(limb.side === "left" ? "leg.left" : "leg.right", { position: limb.title });
