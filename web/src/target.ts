// The ring on the skin where the next compression is wanted, with a bar that shows how the probe is to
// lie: across the vein. Scene units are mm.

import * as THREE from "three";
import type { Target } from "./protocol";
import { paint } from "./theme";

const LIFT_MM = 1.5; // above the skin

export class TargetMark {
  readonly group = new THREE.Group();
  readonly anchor = new THREE.Vector3(); // where the name is written
  private readonly material = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.95, side: THREE.DoubleSide, depthTest: false });
  private readonly faint = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.16, side: THREE.DoubleSide, depthTest: false });
  private key = "";
  /** what is shown, for a view without WebGL */
  shown: { target: Target; reached: boolean } | null = null;

  constructor() {
    this.group.visible = false;
  }

  /** True when something changed. */
  set(target: Target | null, reached: boolean): boolean {
    const key = target ? JSON.stringify([target, reached]) : "";
    if (key === this.key) return false;
    this.key = key;
    this.group.visible = target !== null;
    this.shown = target && { target, reached };
    if (target) this.build(target, reached);
    return true;
  }

  private build(target: Target, reached: boolean): void {
    for (const old of this.group.children) (old as THREE.Mesh).geometry.dispose();
    this.group.clear();
    for (const material of [this.material, this.faint]) paint(material, reached ? "reached" : "wanted");
    const r = Math.max(5, target.radius_mm);
    this.add(new THREE.RingGeometry(r - 1.1, r, 64), this.material);
    this.add(new THREE.CircleGeometry(r - 1.1, 48), this.faint);
    for (const side of [-1, 1]) this.add(new THREE.PlaneGeometry(9, 1.6), this.material).position.x = side * (r + 6);
    const z = new THREE.Vector3(...target.normal).normalize();
    const x = new THREE.Vector3(...target.across);
    x.addScaledVector(z, -x.dot(z)).normalize();
    const y = new THREE.Vector3().crossVectors(z, x);
    this.group.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(x, y, z));
    this.group.position.set(...target.position_mm).addScaledVector(z, LIFT_MM);
    this.anchor.copy(this.group.position).addScaledVector(z, 14);
  }

  private add(geometry: THREE.BufferGeometry, material: THREE.Material): THREE.Mesh {
    const mesh = new THREE.Mesh(geometry, material);
    mesh.renderOrder = 6;
    this.group.add(mesh);
    return mesh;
  }
}
