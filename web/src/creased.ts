// Normals of a mesh that has edges: smooth where its faces meet at a small angle, sharp elsewhere.

import * as THREE from "three";

/** The mesh with corners of their own for each face. The normal of a corner is the mean of those of the faces about its
 *  vertex that are turned by less than `crease_rad` from its own. Vertices are shared by their number, not by their place. */
export function creased(points: Float32Array, faces: ArrayLike<number>, crease_rad: number): THREE.BufferGeometry {
  const corners = faces.length, least = Math.cos(crease_rad);
  const normals = new Float32Array(corners); // of the faces, of length 1
  const after = new Uint32Array(points.length / 3 + 1); // of each vertex: where its faces end in `about`
  for (let f = 0; f < corners; f += 3) {
    const [a, b, c] = [3 * faces[f]!, 3 * faces[f + 1]!, 3 * faces[f + 2]!];
    const ux = points[b]! - points[a]!, uy = points[b + 1]! - points[a + 1]!, uz = points[b + 2]! - points[a + 2]!;
    const vx = points[c]! - points[a]!, vy = points[c + 1]! - points[a + 1]!, vz = points[c + 2]! - points[a + 2]!;
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const size = Math.hypot(x, y, z) || 1;
    (normals[f] = x / size), (normals[f + 1] = y / size), (normals[f + 2] = z / size);
    for (let k = f; k < f + 3; ++k) after[faces[k]! + 1]!++;
  }
  for (let i = 1; i < after.length; ++i) after[i]! += after[i - 1]!;
  const next = after.slice(), about = new Uint32Array(corners);
  for (let k = 0; k < corners; ++k) about[next[faces[k]!]!++] = k - (k % 3);
  const position = new Float32Array(3 * corners), normal = new Float32Array(3 * corners);
  for (let k = 0; k < corners; ++k) {
    const f = k - (k % 3), v = faces[k]!;
    let x = 0, y = 0, z = 0;
    for (let i = after[v]!; i < after[v + 1]!; ++i) {
      const g = about[i]!;
      if (normals[f]! * normals[g]! + normals[f + 1]! * normals[g + 1]! + normals[f + 2]! * normals[g + 2]! <= least) continue;
      (x += normals[g]!), (y += normals[g + 1]!), (z += normals[g + 2]!);
    }
    const size = Math.hypot(x, y, z) || 1;
    position.set(points.subarray(3 * v, 3 * v + 3), 3 * k);
    (normal[3 * k] = x / size), (normal[3 * k + 1] = y / size), (normal[3 * k + 2] = z / size);
  }
  const g = new THREE.BufferGeometry();
  g.setAttribute("position", new THREE.BufferAttribute(position, 3));
  g.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
  return g;
}
