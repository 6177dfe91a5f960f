// Names of the leg's ends and sides, in the picture of the leg.

import * as THREE from "three";
import { halfView } from "./framing";
import type { LimbInfo } from "./protocol";
import { ink } from "./theme";
import { t } from "./words/language";

const HEIGHT_PX = 44; // of the drawn letters
const LEAST_PX = 19, SHARE = 0.034; // of a shown name, and of it in the picture's height
const AWAY_MM = 14; // from the skin
const END_MM = 15; // of the leg that belongs to an end
const THIGH_MM = 500; // a longer leg goes on below the knee
const INNER = t("leg.inner"), OUTER = t("leg.outer");

function words(text: string): THREE.Sprite {
  const canvas = document.createElement("canvas");
  const c = canvas.getContext("2d")!;
  const font = `600 ${HEIGHT_PX * 0.7}px system-ui, sans-serif`;
  c.font = font;
  canvas.width = Math.ceil(c.measureText(text).width) + 16;
  canvas.height = HEIGHT_PX;
  c.font = font;
  c.textBaseline = "middle";
  c.lineWidth = 7;
  c.strokeStyle = ink("leg-words-edge");
  c.fillStyle = ink("leg-words");
  c.strokeText(text, 8, HEIGHT_PX / 2);
  c.fillText(text, 8, HEIGHT_PX / 2);
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map, depthTest: false, sizeAttenuation: false }));
  sprite.userData.wide = canvas.width / canvas.height;
  sprite.renderOrder = 6;
  sprite.name = text;
  return sprite;
}

/** How far the skin reaches to the front near an end: the leg is thinner at the knee than at the groin. */
function topNear(points: Float32Array, end_z: number): number {
  let top = -Infinity;
  for (let i = 0; i < points.length; i += 3) if (Math.abs(points[i + 2]! - end_z) < END_MM) top = Math.max(top, points[i + 1]!);
  return top;
}

/** y points to the front, z from the groin down; x to the inner side of a right leg, the outer one of a left. */
export class Sides {
  readonly group = new THREE.Group();
  limb: LimbInfo | null = null; // whose side is known
  private middle_x = 0;
  private half_x = 0;
  private high = 0.03; // a name at a distance of one

  /** Names keep a size that can be read when the picture is small, and can be read from afar when it is large. */
  seenOn(width_px: number, height_px: number): void {
    this.high = (Math.max(LEAST_PX, SHARE * height_px) / height_px) * 2 * halfView(width_px, height_px).y;
    for (const sprite of this.group.children) sprite.scale.set(this.high * (sprite.userData.wide as number), this.high, 1);
  }

  /** Around a leg with these skin points, mm; a right one until its vein is known. */
  place(points: Float32Array): void {
    const box = new THREE.Box3().setFromArray(points);
    const middle = box.getCenter(new THREE.Vector3());
    const at: [string, number, number, number, number][] = [
      [t("leg.groin"), middle.x, topNear(points, box.min.z) + AWAY_MM, box.min.z, 0],
      [box.max.z - box.min.z > THIGH_MM ? t("leg.ankle") : t("leg.knee"), middle.x, topNear(points, box.max.z) + AWAY_MM, box.max.z, 0],
      [INNER, 0, middle.y, middle.z, 1],
      [OUTER, 0, middle.y, middle.z, -1],
    ];
    if (this.limb) {
      const [cap, out, foot] = [this.limb.kneecap_mm, this.limb.forward, this.limb.ankle_mm];
      at.push([t("leg.kneecap"), cap[0] + 2 * AWAY_MM * out[0], cap[1] + 2 * AWAY_MM * out[1], cap[2] + 2 * AWAY_MM * out[2], 0]);
      at[1] = [this.limb.side === "left" ? t("leg.left_foot") : t("leg.right_foot"), foot[0], foot[1], foot[2] + 8 * AWAY_MM, 0];
    }
    this.group.clear();
    for (const [text, x, y, z, side] of at) {
      const sprite = words(text);
      sprite.position.set(x, y, z);
      sprite.userData.side = side;
      sprite.scale.set(this.high * (sprite.userData.wide as number), this.high, 1);
      this.group.add(sprite);
    }
    this.middle_x = middle.x;
    this.half_x = box.max.x - middle.x + AWAY_MM;
    this.veinAt(Infinity);
  }

  /** The vein enters the leg on its inner side: its x there, mm. */
  veinAt(x: number): void {
    const inner = this.limb ? (this.limb.side === "left" ? -1 : 1) : x < this.middle_x ? -1 : 1;
    for (const sprite of this.group.children) {
      const side = sprite.name === INNER ? inner : sprite.name === OUTER ? -inner : 0;
      sprite.userData.side = side;
      if (side !== 0) sprite.position.x = this.middle_x + side * this.half_x;
    }
  }

  /** A side is named where the viewer sees it, not through the leg. */
  face(camera: THREE.Camera): void {
    for (const sprite of this.group.children) {
      const side = sprite.userData.side as number;
      sprite.visible = side === 0 || side * (camera.position.x - this.middle_x) > 0;
    }
  }
}
