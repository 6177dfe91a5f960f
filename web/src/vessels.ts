// Places along a vessel's line (x, y, z, radius per point): the one that is nearest on the screen, and a stretch of it.

const length = (p: Float32Array, i: number): number => Math.hypot(p[i + 4]! - p[i]!, p[i + 5]! - p[i + 1]!, p[i + 6]! - p[i + 2]!);

function whole(points: Float32Array): number {
  let sum = 0;
  for (let i = 0; i + 4 < points.length; i += 4) sum += length(points, i);
  return sum;
}

/** Share of the line's length at which it is nearest to a point of the screen, and how far that is, px. */
export function nearestShare(points: Float32Array, at: (x: number, y: number, z: number) => [number, number], x: number, y: number): { share: number; away_px: number } {
  const all = whole(points);
  let best = { share: 0, away_px: Infinity };
  for (let i = 0, before = 0; i + 4 < points.length; i += 4) {
    const [ax, ay] = at(points[i]!, points[i + 1]!, points[i + 2]!);
    const [bx, by] = at(points[i + 4]!, points[i + 5]!, points[i + 6]!);
    const [ux, uy] = [bx - ax, by - ay];
    const t = Math.max(0, Math.min(1, ((x - ax) * ux + (y - ay) * uy) / Math.max(1e-9, ux * ux + uy * uy)));
    const away_px = Math.hypot(ax + t * ux - x, ay + t * uy - y);
    if (away_px < best.away_px) best = { share: (before + t * length(points, i)) / Math.max(1e-9, all), away_px };
    before += length(points, i);
  }
  return best;
}

/** The part of a line between two shares of its length. */
export function stretch(points: Float32Array, from: number, to: number): Float32Array {
  const all = whole(points);
  const [a, b] = [Math.max(0, from) * all, Math.min(1, to) * all];
  const out: number[] = [];
  const put = (i: number, t: number): void => {
    for (let k = 0; k < 4; ++k) out.push(points[i + k]! + t * (points[i + 4 + k]! - points[i + k]!));
  };
  for (let i = 0, before = 0; i + 4 < points.length; i += 4) {
    const piece = length(points, i), after = before + piece;
    if (after >= a && before <= b && piece > 0) {
      if (out.length === 0) put(i, Math.max(0, (a - before) / piece));
      put(i, Math.min(1, (b - before) / piece));
    }
    before = after;
  }
  return new Float32Array(out);
}
