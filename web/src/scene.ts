// The thigh, the vessels, the femur and the probe in three dimensions. Draws only when something
// changed. Scene units are mm, axes those of the model.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { creased } from "./creased";
import { find } from "./dom";
import { nextRange, SHADES, SHADE_TABLE } from "./colour";
import { FlatView, movedShare, type FlatVessel } from "./flat";
import { halfView, stand } from "./framing";
import { nearestShare, stretch } from "./vessels";
import { Gel } from "./gel";
import { Foot } from "./limb";
import { Skin } from "./pose";
import { Sides } from "./sides";
import { TargetMark } from "./target";
import { PART, type Frame, type LimbInfo, type Line, type Mesh, type ProbeInfo, type Quat, type Site, type Target, type Vec3 } from "./protocol";
import { onTheme, paint, repaint, SOLID } from "./theme";

// Between two pictures of the leg with low quality: while skin or probe move, and while only the echo image changes.
const LOW_INTERVAL_S = 1 / 8;
const LOW_STILL_INTERVAL_S = 1;
const STILL_MM = 0.05; // movements below this one are not seen
const STILL_COSINE = Math.cos(0.0005); // of half the angle that the probe turned by
const CALM_ALPHA = 0.4; // of see-through skin at rest; displaced skin is up to MOVED_ALPHA
const MOVED_ALPHA = 0.86;
const CREASE_RAD = 0.6; // sharper edges are drawn sharp
const SEEN_COSINE = 0.4; // between the view and the normal of a place: less is on the far side
const NEAREST_MM = 220, FARTHEST_SHARE = 1.6; // of the camera from the leg; of the distance at which all of it is seen
const OTHER_SHARE = 0.3; // a leg whose length differs by more is looked at anew
const MARK_SCALE = 1.35; // of a marked stretch against its vessel
const BEHIND_MM = 46; // how much of a probe's body is drawn: a hand's breadth, not the whole handle

/** Skin: vertex colours with alpha; more opaque where it is seen at a grazing angle, like glass; where
 *  it is wet with gel it shines. */
function skinMaterial(): THREE.MeshStandardMaterial {
  const material = new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.78, metalness: 0 });
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nattribute float wet; varying float vWet;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvWet = wet;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nvarying float vWet;")
      .replace("#include <roughnessmap_fragment>", "#include <roughnessmap_fragment>\nroughnessFactor = mix(roughnessFactor, 0.16, vWet);")
      .replace(
        "#include <opaque_fragment>",
        `float facing = abs(dot(normal, normalize(vViewPosition)));
        outgoingLight += vWet * vec3(0.05, 0.12, 0.15) * (1.4 - facing);
        #ifndef OPAQUE
          diffuseColor.a = mix(1.0, max(diffuseColor.a, 0.6 * vWet), smoothstep(0.0, 0.75, facing));
        #endif
        #include <opaque_fragment>`,
      );
  };
  return material;
}

/** The two cut ends of the thigh: flat, calm, not part of the skin. */
function endMaterial(): THREE.MeshBasicMaterial {
  return paint(new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.5, depthWrite: false }), "cut");
}

/** Splits the faces into the skin and the flat ends across the leg (z is the leg's axis). */
function splitEnds(mesh: Mesh): { skin: number[]; ends: number[] } {
  let [low, high] = [Infinity, -Infinity];
  for (let i = 2; i < mesh.points.length; i += 3) {
    low = Math.min(low, mesh.points[i]!);
    high = Math.max(high, mesh.points[i]!);
  }
  const skin: number[] = [];
  const ends: number[] = [];
  const along = (corner: number): number => mesh.points[3 * mesh.faces[corner]! + 2]!;
  for (let f = 0; f < mesh.faces.length; f += 3) {
    const [a, b, c] = [along(f), along(f + 1), along(f + 2)];
    const flat = Math.max(a, b, c) < low + 0.5 || Math.min(a, b, c) > high - 0.5;
    (flat ? ends : skin).push(mesh.faces[f]!, mesh.faces[f + 1]!, mesh.faces[f + 2]!);
  }
  return { skin, ends };
}

/** Whether skin or probe have visibly moved between two frames of one patient. */
function hasMoved(before: Frame, now: Frame): boolean {
  const [a, b] = [before.snapshot, now.snapshot];
  if (a.probe !== b.probe || Math.hypot(...a.position_mm.map((v, i) => v - b.position_mm[i]!)) > STILL_MM) return true;
  if (Math.abs(a.rotation.reduce((sum, v, i) => sum + v * b.rotation[i]!, 0)) < STILL_COSINE) return true;
  return now.displacements.some((d, i) => Math.abs(d * now.quantum_mm - before.displacements[i]! * before.quantum_mm) > STILL_MM);
}

/** A place on a vessel: its part of the geometry and the share of its length. */
export interface VesselPoint {
  part: number;
  share: number;
}

/** A stretch of a vessel that is made visible. */
export interface VesselMark {
  part: number;
  from: number;
  to: number;
}

interface SiteDot {
  node: number;
  rest: THREE.Vector3;
}

export class LegScene {
  skin: Skin | null = null;
  rangeChanged: (range_mm: number) => void = () => undefined;
  /** the picture is no longer what there is to see */
  changed: () => void = () => undefined;
  readonly orbit: OrbitControls;
  private renderer: THREE.WebGLRenderer | null = null;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(30, 1, 10, 8000);
  private readonly skinMaterial = skinMaterial();
  private readonly inside = new THREE.Group();
  private readonly probe = new THREE.Group();
  private readonly probeBodies = new Map<number, THREE.Object3D>();
  private readonly ring: THREE.Mesh;
  private readonly plane: THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;
  private readonly ray = new THREE.Raycaster();
  private texture: THREE.DataTexture | null = null;
  private surface: THREE.Mesh<THREE.BufferGeometry, THREE.MeshStandardMaterial> | null = null;
  private readonly ends = new THREE.Mesh(new THREE.BufferGeometry(), endMaterial());
  private restMesh: THREE.Mesh | null = null; // never drawn: the rays meet the resting skin
  private dots: THREE.InstancedMesh | null = null;
  private readonly gel = new Gel();
  private readonly target = new TargetMark();
  private readonly sides = new Sides();
  private readonly foot = new Foot();
  private readonly lights = new THREE.Group();
  private limb: LimbInfo | null = null;
  private outline = new Float32Array([-60, -60, 0, 84, 44, 284]); // what is to be seen: skin and foot
  private probes: readonly ProbeInfo[] = [];
  private gelled = false;
  private dotInfo: SiteDot[] = [];
  private range_mm = 10;
  private through = true;
  private dirty = true;
  private moved = false; // skin or probe, since the last picture
  private imaged = false; // a new echo image came since the last picture
  private drawn_s = -Infinity;
  private flat: FlatView | null = null; // draws while there is no WebGL
  private readonly vessels = new Map<number, FlatVessel>();
  private readonly marked = new THREE.Group();
  private marks: readonly VesselMark[] = [];
  private sites: readonly Site[] = [];
  private frame: Frame | null = null;
  private placed: Frame | null = null; // that skin and probe were last drawn at
  private seen = ""; // side and position of the leg
  private faced = "";
  private length_mm = 0; // of the leg
  private fitted_mm = 560; // distance at which all of it is seen
  private size_px: [number, number] = [600, 450]; // of the picture
  private sided: THREE.Vector3 | null = null; // from where the newest place is seen, if not from home
  private turned = false; // by the viewer, or brought nearer
  /** whether the thigh is drawn without WebGL from now on */
  flatChanged: (flat: boolean) => void = () => undefined;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly low: boolean,
  ) {
    this.ring = new THREE.Mesh(
      new THREE.RingGeometry(4.2, 5, 40),
      paint(new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.8, side: THREE.DoubleSide, depthTest: false }), "mark"),
    );
    this.ring.visible = false;
    this.ring.renderOrder = 5;
    this.plane = new THREE.Mesh(
      new THREE.PlaneGeometry(1, 1),
      new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.92, side: THREE.DoubleSide, depthWrite: false }),
    );
    this.plane.visible = false;
    this.plane.renderOrder = 2.5; // after the skin, so that it shows through at full brightness
    this.plane.rotation.set(Math.PI / 2, 0, 0);
    this.probe.add(this.plane);
    this.scene.add(this.inside, this.probe, this.ring, this.target.group, this.marked, this.sides.group, this.foot.group, this.lights);
    this.addLights();
    this.camera.up.set(0, 1, 0);
    this.orbit = new OrbitControls(this.camera, canvas);
    this.configureOrbit();
    this.home();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.seeThrough(true);
    onTheme(() => this.repaint());
    // three.js restores its own state; until then the plain view takes its place.
    canvas.addEventListener("webglcontextlost", (e) => (e.preventDefault(), this.setFlat(true)));
    canvas.addEventListener("webglcontextrestored", () => this.setFlat(false));
  }

  private addLights(): void {
    this.lights.add(new THREE.HemisphereLight(SOLID.sky, SOLID.floor, 1.7));
    const key = new THREE.DirectionalLight(SOLID.key, 2.4);
    key.position.set(260, 420, -160);
    const rim = new THREE.DirectionalLight(SOLID.rim, 0.9);
    rim.position.set(-300, 120, 300);
    this.lights.add(key, rim);
  }

  private spoil(): void {
    this.dirty = true;
    this.changed();
  }

  /** In the colours of the present theme. */
  private repaint(): void {
    this.scene.traverse((thing) => repaint((thing as THREE.Mesh).material));
    if (this.skin) this.sides.place(this.skin.points);
    this.spoil();
  }

  private configureOrbit(): void {
    this.orbit.enableDamping = false;
    this.orbit.enableZoom = false; // the wheel presses; Ctrl + wheel zooms (input.ts)
    this.orbit.mouseButtons = { LEFT: null, MIDDLE: THREE.MOUSE.ROTATE, RIGHT: null };
    this.orbit.touches = { ONE: null, TWO: null }; // one finger beside the leg turns (input.ts)
    this.orbit.minDistance = NEAREST_MM;
    this.orbit.addEventListener("start", () => (this.turned = true));
    this.orbit.addEventListener("change", () => this.spoil());
  }

  /** What is to be seen; a patient of another length, side or position is looked at anew. */
  private look(mesh: Mesh): void {
    let low = Infinity, high = -Infinity;
    for (let i = 2; i < mesh.points.length; i += 3) (low = Math.min(low, mesh.points[i]!)), (high = Math.max(high, mesh.points[i]!));
    const key = this.limb ? `${this.limb.side} ${this.limb.position}` : "";
    const other = Math.abs(high - low - this.length_mm) > OTHER_SHARE * this.length_mm || key !== this.seen;
    const foot = this.foot.points();
    this.outline = new Float32Array(mesh.points.length + foot.length);
    this.outline.set(mesh.points), this.outline.set(foot, mesh.points.length);
    (this.seen = key), (this.length_mm = high - low);
    if (other) this.home();
    else this.fit();
  }

  /** Side and position of a limb, before its skin comes: up is the patient's. */
  setLimb(limb: LimbInfo | null): void {
    this.limb = limb;
    this.foot.place(limb);
    this.sides.limb = limb;
    const y = new THREE.Vector3(0, 1, 0), up = limb ? new THREE.Vector3(...limb.up) : y;
    if (this.camera.up.distanceTo(up) < 1e-6) return;
    this.camera.up.copy(up);
    // The controls turn about the up of the camera that they were made with.
    const inner = this.orbit as unknown as { _quat: THREE.Quaternion; _quatInverse: THREE.Quaternion };
    inner._quat.setFromUnitVectors(up, y);
    inner._quatInverse.copy(inner._quat).invert();
    this.lights.quaternion.setFromUnitVectors(y, up);
    this.home();
  }

  home(): void {
    this.turned = false;
    this.sided = null;
    this.fit();
  }

  /** Medial and from above, the leg lying across the picture, in a narrow one along it; a standing leg seen from the front. */
  private homeward(): THREE.Vector3 {
    const medial = this.limb?.side === "left" ? -1 : 1, up = this.camera.up;
    if (Math.abs(up.z) > 0.5) return new THREE.Vector3(0.5 * medial, 0.8, -0.25);
    return this.size_px[0] < this.size_px[1] ? new THREE.Vector3(0.42 * medial, 0.68 * up.y, -0.6) : new THREE.Vector3(0.74 * medial, 0.52 * up.y, -0.43);
  }

  /** All of the leg, from where it is to be seen; what the viewer has turned and brought nearer keeps its middle and its size. */
  private fit(from: THREE.Vector3 | null = null): void {
    const before = this.fitted_mm, present = this.camera.position.clone().sub(this.orbit.target), distance = present.length();
    const away = (from ?? (this.turned ? present : (this.sided ?? this.homeward()))).clone().normalize();
    const { target_mm, away_mm } = stand(this.outline, away.toArray(), this.camera.up.toArray(), this.size_px[0], this.size_px[1]);
    this.fitted_mm = away_mm;
    this.orbit.maxDistance = FARTHEST_SHARE * away_mm;
    if (!this.turned) this.orbit.target.set(...target_mm);
    this.camera.position.copy(this.orbit.target).addScaledVector(away, this.turned ? (distance * away_mm) / before : away_mm);
    this.orbit.update();
    this.spoil();
  }

  zoom(factor: number): void {
    const offset = this.camera.position.clone().sub(this.orbit.target);
    offset.setLength(Math.min(this.orbit.maxDistance, Math.max(NEAREST_MM, offset.length() * factor)));
    this.turned = true;
    this.camera.position.copy(this.orbit.target).add(offset);
    this.orbit.update();
    this.spoil();
  }

  private resize(): void {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (w === 0 || h === 0) return;
    this.renderer?.setSize(w, h, false);
    this.size_px = [w, h];
    this.camera.aspect = w / h;
    this.camera.fov = THREE.MathUtils.radToDeg(2 * Math.atan(halfView(w, h).y));
    this.camera.updateProjectionMatrix();
    this.sides.seenOn(w, h);
    this.fit();
  }

  seeThrough(on: boolean): void {
    this.through = on;
    this.skinMaterial.transparent = on;
    this.skinMaterial.depthWrite = !on;
    this.ends.material.opacity = on ? 0.45 : 1;
    this.ends.material.depthWrite = !on;
    this.skinMaterial.needsUpdate = true;
    this.inside.visible = on;
    this.foot.seeThrough(on);
    this.plane.visible = on && this.texture !== null;
    this.spoil();
  }

  get isThrough(): boolean {
    return this.through;
  }

  // ---- geometry --------------------------------------------------------------------------------

  setPart(part: Mesh | Line): void {
    if (part.kind === "line") this.setVessel(part);
    else if (part.part === PART.skin) this.setSkin(part);
    else if (part.part === PART.femur) this.setFemur(part);
    else this.setProbeBody(part);
    this.moved = true; // the new part has to be put where the newest frame has it
    this.spoil();
  }

  private static geometry(mesh: Mesh): THREE.BufferGeometry {
    const g = new THREE.BufferGeometry();
    g.setAttribute("position", new THREE.BufferAttribute(mesh.points.slice(), 3));
    g.setIndex(new THREE.BufferAttribute(mesh.faces.slice(), 1));
    g.computeVertexNormals();
    return g;
  }

  private setSkin(mesh: Mesh): void {
    this.skin = new Skin(mesh.points.slice(), mesh.faces);
    this.restMesh = new THREE.Mesh(LegScene.geometry(mesh));
    for (const part of this.vessels.keys()) this.inside.getObjectByName(`vessel ${part}`)?.removeFromParent();
    this.vessels.clear();
    this.frame = this.placed = null;
    this.look(mesh);
    const g = LegScene.geometry(mesh);
    const colours = new Float32Array((mesh.points.length / 3) * 4).fill(CALM_ALPHA);
    for (let i = 0; i < colours.length; i += 4) colours.set(SHADE_TABLE.subarray(0, 3), i);
    g.setAttribute("color", new THREE.BufferAttribute(colours, 4));
    this.sides.place(mesh.points);
    this.gel.resize(mesh.points.length / 3);
    g.setAttribute("wet", new THREE.BufferAttribute(this.gel.wet, 1));
    this.surface?.geometry.dispose();
    this.surface?.removeFromParent();
    this.surface = new THREE.Mesh(g, this.skinMaterial);
    this.surface.frustumCulled = false;
    this.surface.renderOrder = 2;
    const { skin, ends } = splitEnds(mesh); // the ends share the points, not the normals
    g.setIndex(skin);
    this.ends.geometry.setAttribute("position", g.getAttribute("position"));
    this.ends.geometry.setIndex(ends);
    this.ends.renderOrder = 1;
    this.scene.add(this.surface, this.ends);
  }

  private replaceInside(name: string, object: THREE.Object3D): void {
    this.inside.getObjectByName(name)?.removeFromParent();
    object.name = name;
    this.inside.add(object);
  }

  private setFemur(mesh: Mesh): void {
    const material = new THREE.MeshStandardMaterial({ color: SOLID.bone, roughness: 0.9 });
    this.replaceInside("femur", new THREE.Mesh(creased(mesh.points, mesh.faces, CREASE_RAD), material));
  }

  private setVessel(line: Line): void {
    const points: THREE.Vector3[] = [];
    let radius = 0;
    for (let i = 0; i < line.points.length; i += 4) {
      points.push(new THREE.Vector3(line.points[i], line.points[i + 1], line.points[i + 2]));
      radius += line.points[i + 3]!;
    }
    if (points.length < 2) return;
    if (line.part === PART.vein) this.sides.veinAt(points[0]!.x);
    const vein = line.part === PART.vein || (line.part >= PART.branch && line.part % 2 === 0);
    const branch = line.part >= PART.branch;
    this.vessels.set(line.part, { points: line.points.slice(), vein });
    const tube = new THREE.TubeGeometry(new THREE.CatmullRomCurve3(points), branch ? 24 : 96, radius / points.length, branch ? 6 : 16);
    const colour = vein ? SOLID.vein : SOLID.artery;
    const material = new THREE.MeshStandardMaterial({ color: colour, roughness: 0.55, emissive: colour, emissiveIntensity: 0.25 });
    this.replaceInside(`vessel ${line.part}`, new THREE.Mesh(tube, material));
    if (this.marks.some((m) => m.part === line.part)) this.markVessels(this.marks);
  }

  private setProbeBody(mesh: Mesh): void {
    const points = mesh.points.slice();
    for (let i = 2; i < points.length; i += 3) points[i] = Math.max(points[i]!, -BEHIND_MM);
    const g = creased(points, mesh.faces, CREASE_RAD);
    const round = mesh.faces.length > 3 * 60;
    const material = paint(new THREE.MeshStandardMaterial({ roughness: 0.5, transparent: true, opacity: 0.5 }), "probe");
    const body = new THREE.Mesh(g, material);
    body.renderOrder = 3;
    if (!round) {
      const edge = paint(new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }), "edge");
      body.add(new THREE.LineSegments(new THREE.EdgesGeometry(g, 20), edge));
    }
    body.visible = false;
    this.probeBodies.get(mesh.part - PART.probe)?.removeFromParent();
    this.probeBodies.set(mesh.part - PART.probe, body);
    this.probe.add(body);
  }

  /** The coloured mark of each probe: the image's left side. */
  setProbes(probes: readonly ProbeInfo[]): void {
    this.probes = probes;
    probes.forEach((info, i) => {
      const mark = new THREE.Mesh(new THREE.SphereGeometry(1.6, 16, 12), paint(new THREE.MeshBasicMaterial(), "mark"));
      mark.position.set(-info.half_x_mm, 0, -Math.min(10, 4 * info.half_y_mm));
      this.probeBodies.get(i)?.add(mark);
    });
    this.spoil();
  }

  setSites(sites: readonly Site[]): void {
    const skin = this.skin;
    if (!skin) return;
    this.sites = sites;
    this.dots?.removeFromParent();
    const material = paint(new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.55 }), "site");
    this.dots = new THREE.InstancedMesh(new THREE.SphereGeometry(0.95, 10, 8), material, sites.length);
    this.dots.frustumCulled = false;
    this.dots.renderOrder = 4;
    this.dotInfo = sites.map((site) => ({ node: this.nearestNode(site.position_mm), rest: new THREE.Vector3(...site.position_mm) }));
    this.scene.add(this.dots);
    this.moveDots(this.placed);
    this.spoil();
  }

  /** The measured sites mean something in free practice only. */
  showSites(on: boolean): void {
    if (!this.dots || this.dots.visible === on) return;
    this.dots.visible = on;
    this.spoil();
  }

  setTarget(target: Target | null, reached: boolean): void {
    if (!this.target.set(target, reached)) return;
    this.spoil();
    const place = target ? target.position_mm.join() : "";
    if (target && place !== this.faced) this.face(target);
    this.faced = place;
  }

  /** Turns the view about the leg when a new target lies on the side that is not seen. */
  private face(target: Target): void {
    const from = this.camera.position.clone().sub(this.orbit.target), out = new THREE.Vector3(...target.normal).normalize();
    const look = from.clone().normalize();
    if (out.dot(look) > SEEN_COSINE) return;
    this.sided = look.addScaledVector(out, 1.6 - out.dot(look)).normalize();
    this.fit(this.sided);
  }

  /** Where the target's name belongs on the canvas, px; null when there is none or it is behind. */
  targetOnScreen(part: "name" | "middle" = "name"): [number, number] | null {
    if (!this.target.group.visible) return null;
    const p = (part === "name" ? this.target.anchor : this.target.group.position).clone().project(this.camera);
    if (p.z > 1) return null;
    return [((p.x + 1) / 2) * this.canvas.clientWidth, ((1 - p.y) / 2) * this.canvas.clientHeight];
  }

  setGel(on: boolean): void {
    this.gelled = on;
    if (!on && this.gel.wipe()) this.wetSkin();
  }

  private wetSkin(): void {
    const wet = this.surface?.geometry.getAttribute("wet");
    if (wet) wet.needsUpdate = true;
    this.spoil();
  }

  private nearestNode(p: Vec3): number {
    const points = this.skin!.points;
    let best = 0;
    let best2 = Infinity;
    for (let i = 0; i < points.length; i += 3) {
      const d2 = (points[i]! - p[0]) ** 2 + (points[i + 1]! - p[1]) ** 2 + (points[i + 2]! - p[2]) ** 2;
      if (d2 < best2) [best, best2] = [i / 3, d2];
    }
    return best;
  }

  private moveDots(frame: Frame | null): void {
    if (!this.dots) return;
    const m = new THREE.Matrix4();
    const p = new THREE.Vector3();
    this.dotInfo.forEach((dot, i) => {
      p.copy(dot.rest);
      const q = frame?.quantum_mm ?? 0;
      const d = frame?.displacements;
      if (d) p.add(new THREE.Vector3(d[3 * dot.node]! * q, d[3 * dot.node + 1]! * q, d[3 * dot.node + 2]! * q));
      this.dots!.setMatrixAt(i, m.setPosition(p));
    });
    this.dots.instanceMatrix.needsUpdate = true;
  }

  // ---- a frame ---------------------------------------------------------------------------------

  show(frame: Frame): void {
    if (frame.displacements.length !== this.skin?.points.length) return; // of the patient before this one
    this.moved ||= !this.placed || hasMoved(this.placed, frame);
    this.imaged ||= this.through && !this.isFlat; // the plain view shows no echo image
    this.frame = frame;
    const probe = this.probes[frame.snapshot.probe];
    if (this.gelled && probe && this.skin && this.gel.spread(this.skin.points, frame.snapshot, probe)) this.wetSkin();
  }

  /** Puts skin, marks and probe where a frame has them. */
  private place(frame: Frame): void {
    this.placed = frame;
    this.deform(frame);
    this.moveDots(frame);
    this.placeProbe(frame.snapshot.probe, frame.snapshot.position_mm, frame.snapshot.rotation);
  }

  private deform(frame: Frame): void {
    if (!this.surface || !this.skin) return;
    const rest = this.skin.points;
    const d = frame.displacements;
    const position = this.surface.geometry.getAttribute("position") as THREE.BufferAttribute;
    const colour = this.surface.geometry.getAttribute("color") as THREE.BufferAttribute;
    const out = position.array as Float32Array;
    const rgba = colour.array as Float32Array;
    const shade = ((SHADES - 1) * frame.quantum_mm) / this.range_mm;
    const alpha = (MOVED_ALPHA - CALM_ALPHA) / (SHADES - 1);
    let largest2 = 0;
    for (let i = 0, c = 0; i < out.length; i += 3, c += 4) {
      const [x, y, z] = [d[i]!, d[i + 1]!, d[i + 2]!];
      out[i] = rest[i]! + x * frame.quantum_mm;
      out[i + 1] = rest[i + 1]! + y * frame.quantum_mm;
      out[i + 2] = rest[i + 2]! + z * frame.quantum_mm;
      const size2 = x * x + y * y + z * z;
      if (size2 > largest2) largest2 = size2;
      const k = Math.min(SHADES - 1, Math.round(Math.sqrt(size2) * shade));
      rgba[c] = SHADE_TABLE[3 * k]!;
      rgba[c + 1] = SHADE_TABLE[3 * k + 1]!;
      rgba[c + 2] = SHADE_TABLE[3 * k + 2]!;
      rgba[c + 3] = CALM_ALPHA + alpha * k;
    }
    position.needsUpdate = colour.needsUpdate = true;
    this.surface.geometry.computeVertexNormals();
    this.setRange(nextRange(this.range_mm, Math.sqrt(largest2) * frame.quantum_mm));
  }

  private setRange(range_mm: number): void {
    if (range_mm === this.range_mm) return;
    this.range_mm = range_mm;
    this.rangeChanged(range_mm);
  }

  private placeProbe(index: number, p: Vec3, q: Quat): void {
    for (const [i, body] of this.probeBodies) body.visible = i === index;
    this.probe.position.set(...p);
    this.probe.quaternion.set(q[1], q[2], q[3], q[0]);
  }

  /** The echo image where it is taken: below the probe, x to the right, z down. */
  private placeImage(frame: Frame): void {
    if (!this.through) return;
    if (!this.texture || this.texture.image.width !== frame.width || this.texture.image.height !== frame.height) {
      this.texture?.dispose();
      this.texture = new THREE.DataTexture(new Uint8Array(4 * frame.width * frame.height), frame.width, frame.height);
      this.texture.colorSpace = THREE.SRGBColorSpace;
      this.texture.minFilter = this.texture.magFilter = THREE.LinearFilter;
      this.plane.material.map = this.texture;
      this.plane.material.needsUpdate = true;
    }
    const rgba = this.texture.image.data as unknown as Uint8Array;
    const grey = frame.pixels;
    for (let i = 0; i < grey.length; ++i) {
      const g = grey[i]!;
      rgba[4 * i] = rgba[4 * i + 1] = rgba[4 * i + 2] = g;
      rgba[4 * i + 3] = Math.min(230, 40 + 3 * g); // what is black in the image lets the vessels through
    }
    this.texture.needsUpdate = true;
    this.plane.visible = true;
    this.plane.scale.set(frame.width_mm, frame.height_mm, 1);
    this.plane.position.set(0, 0, frame.face.top_mm + frame.height_mm / 2);
  }

  /** The wanted vessel that is nearest to the pointer, at most `near_px` away, and where on it. */
  vesselAt(clientX: number, clientY: number, near_px: number, wanted: (part: number) => boolean): VesselPoint | null {
    const box = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const p = new THREE.Vector3();
    const at = (x: number, y: number, z: number): [number, number] => {
      p.set(x, y, z).project(this.camera);
      return [box.left + ((p.x + 1) / 2) * box.width, box.top + ((1 - p.y) / 2) * box.height];
    };
    let best: (VesselPoint & { away_px: number }) | null = null;
    for (const [part, { points }] of this.vessels) {
      if (!wanted(part)) continue;
      const { share, away_px } = nearestShare(points, at, clientX, clientY);
      if (away_px < near_px && (!best || away_px < best.away_px)) best = { part, share, away_px };
    }
    return best && { part: best.part, share: best.share };
  }

  /** Where a place on a vessel is on the canvas, px. */
  vesselOnScreen(part: number, share: number): [number, number] | null {
    const line = this.vessels.get(part);
    const piece = line && stretch(line.points, share, share + 1e-4);
    if (!piece?.length) return null;
    this.camera.updateMatrixWorld();
    const q = new THREE.Vector3(piece[0], piece[1], piece[2]).project(this.camera);
    return [((q.x + 1) / 2) * this.canvas.clientWidth, ((1 - q.y) / 2) * this.canvas.clientHeight];
  }

  /** How far skin and foot reach, as shares of the picture: less than 0 or more than 1 is out of it. */
  legOnScreen(): { least: number; most: number } {
    this.camera.updateMatrixWorld();
    const p = new THREE.Vector3(), shares: number[] = [];
    for (let i = 0; i < this.outline.length; i += 3) {
      p.fromArray(this.outline, i).project(this.camera);
      shares.push((p.x + 1) / 2, (1 - p.y) / 2);
    }
    return { least: shares.reduce((a, b) => Math.min(a, b)), most: shares.reduce((a, b) => Math.max(a, b)) };
  }

  /** Draws stretches of vessels thicker, for clots that are being placed. */
  markVessels(marks: readonly VesselMark[]): void {
    this.marks = marks;
    for (const old of this.marked.children) (old as THREE.Mesh).geometry.dispose();
    this.marked.clear();
    for (const { points } of this.markedLines()) {
      const course = Array.from({ length: points.length / 4 }, (_, i) => new THREE.Vector3(points[4 * i], points[4 * i + 1], points[4 * i + 2]));
      const tube = new THREE.TubeGeometry(new THREE.CatmullRomCurve3(course), 8 * course.length, MARK_SCALE * Math.max(1.5, points[3]!), 10);
      const mesh = new THREE.Mesh(tube, new THREE.MeshBasicMaterial({ color: SOLID.clot, depthTest: false, transparent: true, opacity: 0.9 }));
      mesh.renderOrder = 5;
      this.marked.add(mesh);
    }
    this.spoil();
  }

  private markedLines(): FlatVessel[] {
    return this.marks.flatMap(({ part, from, to }) => {
      const line = this.vessels.get(part);
      const points = line ? stretch(line.points, from, to) : new Float32Array(0);
      return points.length >= 8 ? [{ points, vein: true, marked: true }] : [];
    });
  }

  // ---- pointing --------------------------------------------------------------------------------

  /** Point of the resting skin under the pointer. */
  pick(clientX: number, clientY: number): Vec3 | null {
    const box = this.canvas.getBoundingClientRect();
    const x = ((clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((clientY - box.top) / box.height) * 2;
    this.ray.setFromCamera(new THREE.Vector2(x, y), this.camera);
    return this.cast();
  }

  /** Point of the resting skin below a point, along the inward normal. */
  project(p: Vec3, normal: Vec3): Vec3 | null {
    const n = new THREE.Vector3(...normal);
    this.ray.set(new THREE.Vector3(...p).addScaledVector(n, 40), n.negate());
    return this.cast();
  }

  private cast(): Vec3 | null {
    const hit = this.restMesh ? this.ray.intersectObject(this.restMesh, false)[0] : undefined;
    return hit ? [hit.point.x, hit.point.y, hit.point.z] : null;
  }

  hover(p: Vec3 | null, normal: Vec3 | null): void {
    if (!p && !this.ring.visible) return;
    this.ring.visible = p !== null && normal !== null;
    if (p && normal) {
      this.ring.position.set(...p);
      this.ring.lookAt(p[0] + normal[0], p[1] + normal[1], p[2] + normal[2]);
    }
    this.spoil();
  }

  /** Takes up to half a second, so only the first picture asks for it: the echo image goes before. Null: this
   *  browser has no WebGL, or gave it up. */
  private makeRenderer(): THREE.WebGLRenderer | null {
    const { canvas, low } = this;
    const settings = { antialias: !low, alpha: true, powerPreference: "high-performance" } as const;
    try {
      const context = canvas.getContext("webgl2", settings) as WebGL2RenderingContext | null; // three.js would say on the console that there is none
      if (!context) return null;
      const renderer = new THREE.WebGLRenderer({ canvas, context, ...settings });
      renderer.setPixelRatio(low ? 0.5 : Math.min(2, window.devicePixelRatio));
      return renderer;
    } catch {
      return null;
    }
  }

  get isFlat(): boolean {
    return this.flat !== null && !this.flat.canvas.hidden;
  }

  private setFlat(on: boolean): void {
    const canvas = find<HTMLCanvasElement>("scene-flat");
    if (on) this.flat ??= new FlatView(canvas);
    canvas.hidden = !on;
    this.canvas.classList.toggle("unlit", on);
    this.spoil();
    this.flatChanged(on);
  }

  private drawFlat(flat: FlatView): void {
    const surface = this.surface;
    const points = surface?.geometry.getAttribute("position").array as Float32Array | undefined;
    const info = this.frame ? this.probes[this.frame.snapshot.probe] : undefined;
    this.probe.updateMatrixWorld();
    const drawn = flat.draw({
      camera: this.camera,
      skin: points && this.skin ? { points, faces: surface!.geometry.getIndex()!.array, moved: movedShare(this.skin.points, points, this.range_mm) } : null,
      vessels: [...this.vessels.values(), ...this.markedLines()],
      sites: this.dots?.visible ? this.sites : [],
      probe: info ? { info, frame: this.probe.matrixWorld } : null,
      image_mm: this.frame ? [this.frame.width_mm, this.frame.height_mm] : [0, 0],
      target: this.target.shown,
      through: this.through,
    });
    if (!drawn) this.spoil();
  }

  /** Draws the leg if it has changed; with low quality at most 8 times a second, and once a second while nothing
   *  moves, so that image and force have the processor where it also does a graphics card's work. */
  render(now_s: number): void {
    const changed = this.dirty || this.moved;
    if (!changed && !this.imaged) return;
    if (this.low && now_s - this.drawn_s < (changed ? LOW_INTERVAL_S : LOW_STILL_INTERVAL_S)) return;
    if (this.frame && this.moved) this.place(this.frame);
    if (this.frame && this.imaged) this.placeImage(this.frame);
    this.dirty = this.moved = this.imaged = false;
    this.drawn_s = now_s;
    if (!this.renderer && !this.isFlat) {
      this.renderer = this.makeRenderer();
      if (!this.renderer) this.setFlat(true);
      this.resize();
    }
    this.sides.face(this.camera);
    if (this.isFlat) this.drawFlat(this.flat!);
    else this.renderer?.render(this.scene, this.camera);
  }

  get quality(): "low" | "high" {
    return this.low ? "low" : "high";
  }
}
