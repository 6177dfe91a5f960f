// Lines of sight of a picture: of a flat face, which may lean, or the fan of a curved one. Lengths in mm, angles in radians.

/** Radius of the face (0: flat) and z of the picture's upper edge, which is above the middle of a curved face. */
export interface Face {
  radius_mm: number;
  top_mm: number;
}
export const FLAT: Face = { radius_mm: 0, top_mm: 0 };

/** x and z of the place on the line that leaves the face at `along`; the depth is along the line of a fan, else along z. */
export function placeOf(face: Face, along: number, depth: number, lean = 0): [number, number] {
  const r = face.radius_mm;
  return r > 0 ? [(r + depth) * Math.sin(along / r), (r + depth) * Math.cos(along / r) - r] : [along + depth * Math.tan(lean), depth];
}

/** Where the line of a place leaves the face, and the place's depth. */
export function lineOf(face: Face, x: number, z: number, lean = 0): [number, number] {
  const r = face.radius_mm;
  return r > 0 ? [r * Math.atan2(x, z + r), Math.hypot(x, z + r) - r] : [x - z * Math.tan(lean), z];
}

/** The beam's angle from the probe's axis. */
export const beamOf = (face: Face, along: number, lean: number): number => (face.radius_mm > 0 ? along / face.radius_mm : lean);

/** How far along the face a line may be from its middle. */
export const halfOf = (face: Face, width_mm: number): number =>
  face.radius_mm > 0 ? face.radius_mm * Math.acos(1 + face.top_mm / face.radius_mm) : width_mm / 2;
