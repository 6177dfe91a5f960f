// Where the probe has left gel on the skin: a wetness per node, which the skin's shader turns to shine.

import { dot, rotate, sub } from "./pose";
import type { ProbeInfo, Snapshot, Vec3 } from "./protocol";

const EDGE_MM = 7; // gel stands this far beyond the face
const REACH_MM = 8; // along the beam, above and below the face
const CONTACT_MM = -1;

export class Gel {
  wet = new Float32Array(0);
  private any = false;

  resize(nodes: number): void {
    this.wet = new Float32Array(nodes);
    this.any = false;
  }

  /** True when it changed. */
  wipe(): boolean {
    const was = this.any;
    this.wet.fill(0);
    this.any = false;
    return was;
  }

  /** Gel under the face of a probe that touches the skin. True when it changed. */
  spread(points: Float32Array, s: Snapshot, probe: ProbeInfo): boolean {
    if (s.penetration_mm < CONTACT_MM) return false;
    const axes = ([[1, 0, 0], [0, 1, 0], [0, 0, 1]] as Vec3[]).map((v) => rotate(s.rotation, v));
    const [hx, hy] = [probe.half_x_mm + EDGE_MM, probe.half_y_mm + EDGE_MM];
    const deep = Math.max(0, s.penetration_mm);
    let changed = false;
    for (let i = 0; i < this.wet.length; ++i) {
      const d = sub([points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!], s.position_mm);
      if (Math.abs(dot(d, axes[2]!) + deep) > REACH_MM + deep) continue;
      const out = Math.max(Math.abs(dot(d, axes[0]!)) / hx, Math.abs(dot(d, axes[1]!)) / hy);
      const wet = Math.min(1, Math.max(0, 3 * (1.2 - out)));
      if (wet <= this.wet[i]!) continue;
      this.wet[i] = wet;
      changed = this.any = true;
    }
    return changed;
  }
}
