// The probe's way to a far place leads over the skin: straight there it would go through the leg.
// No DOM, no three.js. Lengths are mm.

import { add, dot, Hold, length, sub, unit, type Pose, type Skin } from "./pose";
import type { Vec3 } from "./protocol";

const FAR_MM = 40;     // a goal nearer than this is gone to straight
const STEP_MM = 20;    // along the skin from one waypoint to the next
const CLEAR_MM = 20;   // of the probe's face from the skin at a waypoint
const REACHED_MM = 14; // nearer to a waypoint than this the probe goes on to the next
const STEPS_MAX = 80;

/** Nearest of the skin's points. */
function nearest(skin: Skin, p: Vec3): Vec3 {
  let best = 0;
  let least = Infinity;
  for (let i = 0; i < skin.points.length / 3; ++i) {
    const d = length(sub(skin.point(i), p));
    if (d < least) [best, least] = [i, d];
  }
  return skin.point(best);
}

/** Points of the skin from one to the other, each some STEP_MM from the last; without the ends. */
export function overSkin(skin: Skin, from: Vec3, to: Vec3): Vec3[] {
  const points: Vec3[] = [];
  let at = nearest(skin, from);
  for (let k = 0; k < STEPS_MAX && length(sub(to, at)) > 2 * STEP_MM; ++k) {
    const normal = skin.normalAt(at);
    const straight = unit(sub(to, at));
    let along = add(straight, normal, -dot(straight, normal));
    if (length(along) < 0.1) along = [-normal[1], normal[0], 0]; // right through the leg: round it
    const next = nearest(skin, add(at, unit(along), STEP_MM));
    if (length(sub(next, at)) < 1) break;
    points.push(next);
    at = next;
  }
  return points;
}

/** Where the probe is held at a waypoint. */
function above(skin: Skin, point: Vec3): Pose {
  const hold = new Hold();
  hold.at(point, skin.normalAt(point));
  hold.setDepth(-CLEAR_MM);
  return hold.pose();
}

/** What is sent to the program: the goal, or the next waypoint to it. */
export class Route {
  private waypoints: Pose[] = [];

  /** The operator holds the probe elsewhere: a far place is reached over the skin. */
  to(skin: Skin | null, probe: Vec3, goal: Vec3): void {
    const last = this.waypoints[this.waypoints.length - 1];
    if (last && length(sub(last.position_mm, goal)) < 2 * STEP_MM + CLEAR_MM) return; // on its way there
    const far = skin && length(sub(goal, probe)) > FAR_MM;
    this.waypoints = far ? overSkin(skin, probe, goal).map((point) => above(skin, point)) : [];
  }

  /** The probe is over another leg: it goes straight to its goal. */
  forget(): void {
    this.waypoints = [];
  }

  /** True when the probe has reached a waypoint, so that the next pose is due. */
  passed(probe: Vec3): boolean {
    const next = this.waypoints[0];
    if (!next || length(sub(next.position_mm, probe)) > REACHED_MM) return false;
    this.waypoints.shift();
    return true;
  }

  pose(goal: Pose): Pose {
    return this.waypoints[0] ?? goal;
  }
}
