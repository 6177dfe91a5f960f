// Where the camera stands so that all of a leg is in the picture, whatever the picture's form. Lengths are mm.

type Vec = readonly [number, number, number];

export const FOV_DEG = 27; // of the picture's height, of its width when that is less
const EDGE_PX = 26; // of the picture that stays free on every side: half a name beside the leg
const EDGE_MOST = 0.16; // of the picture's width and height

const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Vec, b: Vec): Vec => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a: Vec): Vec => {
  const length = Math.hypot(...a);
  return [a[0] / length, a[1] / length, a[2] / length];
};

/** Half the picture's extent, at a distance of one. */
export function halfView(width_px: number, height_px: number): { x: number; y: number } {
  const least = Math.tan((FOV_DEG * Math.PI) / 360) / Math.min(width_px, height_px);
  return { x: least * width_px, y: least * height_px };
}

export interface Stand {
  /** in the middle of the picture, as deep as the middle of what is seen */
  target_mm: [number, number, number];
  /** of the camera from there */
  away_mm: number;
}

/**
 * The nearest stand from which every point (x, y, z in a row) is in the picture with some room around it. The camera looks
 * against `away`, `up` upwards. Each of the four sides of what it sees asks for a least distance that falls as the camera
 * moves aside to it: two opposite sides ask for the same one at the best place between them.
 */
export function stand(points: ArrayLike<number>, away: Vec, up: Vec, width_px: number, height_px: number): Stand {
  const z = unit(away), x = unit(cross(up, z)), y = cross(z, x);
  const view = halfView(width_px, height_px);
  const free = (px: number): number => 1 - 2 * Math.min(EDGE_MOST, EDGE_PX / px);
  const [tan_x, tan_y] = [view.x * free(width_px), view.y * free(height_px)];
  const most = { right: -Infinity, left: -Infinity, above: -Infinity, below: -Infinity, near: -Infinity, far: Infinity };
  for (let i = 0; i + 2 < points.length; i += 3) {
    const p: Vec = [points[i]!, points[i + 1]!, points[i + 2]!];
    const [a, b, c] = [dot(p, x) / tan_x, dot(p, y) / tan_y, dot(p, z)];
    most.right = Math.max(most.right, c + a), most.left = Math.max(most.left, c - a);
    most.above = Math.max(most.above, c + b), most.below = Math.max(most.below, c - b);
    most.near = Math.max(most.near, c), most.far = Math.min(most.far, c);
  }
  const aside = ((most.right - most.left) / 2) * tan_x, lifted = ((most.above - most.below) / 2) * tan_y;
  const camera = Math.max((most.right + most.left) / 2, (most.above + most.below) / 2);
  const middle = (most.near + most.far) / 2;
  const at = (k: 0 | 1 | 2): number => aside * x[k] + lifted * y[k] + middle * z[k];
  return { target_mm: [at(0), at(1), at(2)], away_mm: camera - middle };
}
