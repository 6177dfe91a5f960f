// Messages of docs/page_protocol.md: types, decoding of the binary ones. Lengths are mm.

import type { ExportMessage } from "./exports";
import type { DraftMessage } from "./draft";
import { type Face, FLAT } from "./lines";
import type { SheetMessage } from "./worksheet";

export type Vec3 = [number, number, number];
/** w, x, y, z */
export type Quat = [number, number, number, number];

export interface ProbeInfo {
  name: string;
  half_x_mm: number;
  half_y_mm: number;
  rectangular: boolean;
}

export interface Site {
  id: number;
  position_mm: Vec3;
  normal: Vec3;
  u: Vec3;
  v: Vec3;
  /** per probe: [penetration mm, force N] */
  curves: Record<string, [number, number][]>;
}

export interface Hello {
  type: "hello";
  version: number;
  program: string;
  model: string;
  provenance: string;
  nodes: number;
  faces: number;
  force_limit_n: number;
  controls: boolean;
  probes: ProbeInfo[];
  cases: string[];
  faults: string[];
  sites: Site[];
  // version 2
  trainer?: boolean;
  trainee?: string;
  case_list?: CaseInfo[];
  protocols?: ProtocolInfo[];
  device?: string;
  /** above it a press is uncomfortable; half the limit when absent */
  comfort_n?: number;
  /** of a whole limb */
  limb?: LimbInfo;
  course?: Lesson[];
}

export interface LimbInfo {
  side: "left" | "right";
  /** key of the position, and what the patient does in it */
  position: string;
  title: string;
  /** away from the ground */
  up: Vec3;
  kneecap_mm: Vec3;
  ankle_mm: Vec3;
  ankle_radius_mm: number;
  /** along the shin, and where the toes point */
  down: Vec3;
  forward: Vec3;
}

export interface CaseInfo {
  id: string;
  title: string;
  history: string;
  level: "first" | "easy" | "hard";
  /** one of those that the user wrote */
  own?: boolean;
}

export interface ProtocolInfo {
  id: string;
  title: string;
  text: string;
}

export interface Controls {
  type: "controls";
  controls: boolean;
  // version 3
  role?: Role;
  /** who controls */
  holder?: Role | "nobody";
  /** the one thing about control that this page may ask for */
  may?: "" | RoleAction;
  probe: string;
  case: string;
  stop: boolean;
  gain_db: number;
  depth_mm: number;
  frequency_mhz: number;
  dynamic_range_db: number;
  focus_mm: number;
  tgc_db_per_cm: number;
  // version 2
  posture?: Posture;
  valsalva?: boolean;
  gel?: boolean;
  gel_ml?: number;
  stiffness_scale?: number;
  damping_scale?: number;
  friction_scale?: number;
  // of a flat face: Doppler
  colour?: ColourShown;
  /** left, right (from the middle of the face), top, bottom */
  colour_box_mm?: [number, number, number, number];
  /** none before a curved face, whose lines are a fan */
  colour_steer_deg?: number;
  colour_scale_cm_s?: number;
  colour_gain_db?: number;
  gate?: boolean;
  /** x from the middle of the face, depth */
  gate_mm?: [number, number];
  gate_length_mm?: number;
  gate_steer_deg?: number;
  /** from the beam to the cursor that lies along the vessel */
  gate_angle_deg?: number;
  gate_scale_cm_s?: number;
  /** how far the base line is moved down, share of half the axis */
  gate_baseline?: number;
  gate_filter_hz?: number;
  gate_gain_db?: number;
}

export type GateKey = "gate_length_mm" | "gate_steer_deg" | "gate_angle_deg" | "gate_scale_cm_s" | "gate_baseline" | "gate_filter_hz" | "gate_gain_db";
export type GateWish = Partial<Pick<Controls, "gate" | "gate_mm" | GateKey>>;
export type ColourShown = "off" | "velocity" | "power";
export type ColourWish = Partial<Pick<Controls, "colour" | "colour_box_mm" | "colour_steer_deg" | "colour_scale_cm_s" | "colour_gain_db">>;
export type Role = "learner" | "watcher" | "teacher";
export type RoleAction = "take" | "give" | "return";
export type Posture = "supine" | "sitting" | "standing";
export type Guidance = "full" | "hints" | "exam";
export type Decision = "" | "compressible" | "clot" | "not_seen";
export type PressResult = "complete" | "open" | "too_hard" | "off_axis" | "insufficient";
export type Phase = "practice" | "preparing" | "running" | "done" | "replay" | "film" | "edit";

export interface Target {
  name: string;
  /** its number in the worksheet, from 0 */
  place?: number;
  position_mm: Vec3;
  normal: Vec3;
  across: Vec3;
  radius_mm: number;
}

export interface Step {
  text: string;
  detail: string;
  /** to be decided now; empty: none */
  segment: string;
  target: Target | null;
  force_n: [number, number] | null;
  offset_mm: number | null;
  angle_deg: number | null;
  angle_ok: boolean;
  /** that the patient is to take first; empty: he lies right */
  position?: string;
}

export interface Compression {
  state: "none" | "pressing" | "complete" | "open" | "too_hard" | "off_axis";
  vein: number | null;
  artery: number | null;
}

export interface Segment {
  id: string;
  title: string;
  from_mm: number;
  to_mm: number;
  needed: boolean;
  points: number;
  done: number;
  decision: Decision;
}

export interface Press {
  t_s: number;
  z_mm: number;
  segment: string;
  result: PressResult;
  force_n: number;
}

export interface ScorePart {
  title: string;
  points: number;
  of: number;
  /** where the missing points went; empty when none are missing */
  lost: string;
}

export interface Result {
  score: number;
  passed: boolean;
  correct: boolean;
  summary: string;
  report: string;
  /** what the case teaches */
  note?: string;
  parts?: ScorePart[];
  diagnosis: { asked: string; truth: string };
}

export interface Exam {
  type: "exam";
  phase: Phase;
  message: string;
  progress: number;
  exam: string;
  case: string;
  title: string;
  history: string;
  protocol: string;
  guidance: Guidance;
  /** how the patient lies, and the positions that the protocol asks for */
  position?: string;
  positions?: { id: string; title: string }[];
  elapsed_s: number;
  recording: boolean;
  step: Step;
  compression: Compression | null;
  segments: Segment[];
  presses: Press[];
  hint: string;
  hints_used: number;
  result: Result | null;
  // version 3
  comments?: Comment[];
  /** that is practised or demonstrated */
  lesson?: LessonState | null;
  picture?: Picture | null;
  film?: Film | null;
}

/** What the expert came to, and what is asked of a learner. */
export interface Bar {
  score: number;
  mean: number;
  sd: number;
  runs: number;
  time_s: number;
  path_mm: number;
  force_n: number;
}

export interface LessonState {
  id: string;
  /** repetition, from 0, and how many there are */
  turn: number;
  turns: number;
  bar: Bar | null;
  reached: boolean;
}

export interface PictureMark {
  kind: "vein" | "artery" | "lesion";
  name: string;
  /** what is seen of it and why; empty: nothing now */
  why: string;
  wanted: boolean;
  /** of its middle, from the middle of the face and below it */
  x_mm: number;
  depth_mm: number;
  /** half of its greater and of its smaller diameter */
  half_mm: number;
  flat_mm: number;
}

/** Guidance in the picture. */
export interface Picture {
  marks: PictureMark[];
  /** the way to the view, along the picture's x and along the probe's y; null: none */
  aside_mm: number | null;
  along_mm: number | null;
  way: string;
}

/** A demonstration. */
export interface Film {
  title: string;
  words: string;
  playing: boolean;
  /** waits while the words are read */
  reading: boolean;
  over: boolean;
  speed: number;
  place: number;
  places: number;
}

export interface Question {
  ask: string;
  choices: string[];
  right: number;
  why: string;
}

export interface Lesson {
  id: string;
  title: string;
  goal: string;
  /** the patient's history; empty: drawn anew each time */
  patient: string;
  places: number;
  /** guidance of each repetition */
  practice: Guidance[];
  quiz: Question[];
  bar: Bar | null;
}

export interface ExamEntry {
  id: string;
  trainee: string;
  case: string;
  title: string;
  date: string;
  protocol: string;
  score: number | null;
  passed: boolean;
  seconds: number;
  report: string;
  recording: boolean;
}

export interface Comment {
  t_s: number;
  text: string;
  author: string;
}

export interface Replay {
  type: "replay";
  exam: string;
  title: string;
  duration_s: number;
  time_s: number;
  playing: boolean;
  speed: number;
  presses: Press[];
  comments: Comment[];
}

export type TextMessage =
  | Hello
  | Controls
  | Exam
  | Replay
  | SheetMessage
  | ExportMessage
  | DraftMessage
  | { type: "exams"; list: ExamEntry[] }
  | { type: "error"; message: string }
  | { type: "pong"; id: number };

export interface Mesh {
  kind: "mesh";
  part: number;
  points: Float32Array;
  faces: Uint32Array;
}

export interface Line {
  kind: "line";
  part: number;
  /** x, y, z, radius */
  points: Float32Array;
}

/** Bit of Snapshot.flags: the probe was led through the leg and is taken off until it has left it. */
export const FLAG_INSIDE_OUT = 8;
/** The hyperelastic solid bears the probe, else springs. */
export const FLAG_SOLID = 0x8000;

export interface Snapshot {
  tick: number;
  time_s: number;
  probe: number;
  fault: number;
  flags: number;
  iterations: number;
  awake: number;
  position_mm: Vec3;
  rotation: Quat;
  force_n: Vec3;
  rendered_force_n: Vec3;
  force_normal_n: number;
  penetration_mm: number;
  contact_area_mm2: number;
  /** NaN when the vessel is not in view */
  vein_area_ratio: number;
  artery_area_ratio: number;
  vein_short_mm: number;
}

export interface Frame {
  kind: "frame";
  sequence: number;
  snapshot: Snapshot;
  /** displacement of each node in units of quantum_mm */
  displacements: Int16Array;
  quantum_mm: number;
  width: number;
  height: number;
  width_mm: number;
  height_mm: number;
  face: Face;
  pixels: Uint8Array;
  /** null: Doppler is off */
  colour: ColourFrame | null;
  /** null: pulsed Doppler is off */
  spectrum: SpectrumFrame | null;
}

/** The spectrum at one time; velocities along the beam, towards the probe. */
export interface SpectrumColumn {
  /** times column_s: when its last pulse was sent */
  number: number;
  /** 0: noise alone */
  mean_cm_s: number;
  edge_cm_s: number;
  /** from the lowest velocity up; 0 to 255 are 36 dB */
  power: Uint8Array;
}

export interface SpectrumFrame {
  x_mm: number;
  z_mm: number;
  length_mm: number;
  steer_deg: number;
  angle_deg: number;
  /** half the width of the velocities that are shown, and the lowest of them */
  limit_cm_s: number;
  low_cm_s: number;
  pulse_hz: number;
  /** from which blood passes the wall filter whole, along the beam */
  slowest_cm_s: number;
  column_s: number;
  columns: SpectrumColumn[];
}

/** Colour over a rectangle of a frame's image. */
export interface ColourFrame {
  shown: "velocity" | "power";
  left: number;
  top: number;
  width: number;
  height: number;
  /** velocity along the beam from which it folds */
  limit_cm_s: number;
  /** left, right, top, bottom */
  box_mm: [number, number, number, number];
  steer_deg: number;
  /** 0: none; 1 to 255: velocity from the limit away over 0 (128) to the limit towards the probe, or power */
  pixels: Uint8Array;
}

export const PART = { skin: 0, femur: 1, vein: 2, artery: 3, probe: 16, branch: 256 } as const;
/** versions of the protocol that this page speaks; 1 has no trainer */
export const VERSIONS = [1, 2, 3];

const HEADER = 16;
const MESH_FIXED = 24;
const FRAME_FIXED = 140;
const COLOUR_FIXED = 36;
const SPECTRUM_FIXED = 56;
const FAN_BYTES = 12;
const SPECTRUM = 3; // what its block begins with, where colours have 1 or 2
const FAN = 4; // likewise, of a curved face
const MAGIC = 0x45444e53; // "SNDE", little-endian

/** Reads one value after the other. */
class Cursor {
  constructor(
    private readonly view: DataView,
    private at: number,
  ) {}
  u16(): number {
    this.at += 2;
    return this.view.getUint16(this.at - 2, true);
  }
  u32(): number {
    this.at += 4;
    return this.view.getUint32(this.at - 4, true);
  }
  u64(): number {
    const low = this.u32();
    return low + this.u32() * 4294967296;
  }
  f32(): number {
    this.at += 4;
    return this.view.getFloat32(this.at - 4, true);
  }
  f64(): number {
    this.at += 8;
    return this.view.getFloat64(this.at - 8, true);
  }
  vec3(): Vec3 {
    return [this.f32(), this.f32(), this.f32()];
  }
  quat(): Quat {
    return [this.f32(), this.f32(), this.f32(), this.f32()];
  }
}

function decodeSpectrum(bytes: ArrayBuffer, at: number): SpectrumFrame | null {
  if (at + SPECTRUM_FIXED > bytes.byteLength) return null;
  const c = new Cursor(new DataView(bytes), at + 2);
  const [count, bins] = [c.u16(), c.u16()];
  c.u16();
  const frame: SpectrumFrame = {
    x_mm: c.f32(),
    z_mm: c.f32(),
    length_mm: c.f32(),
    steer_deg: c.f32(),
    angle_deg: c.f32(),
    limit_cm_s: c.f32(),
    low_cm_s: c.f32(),
    pulse_hz: c.f32(),
    slowest_cm_s: c.f32(),
    column_s: c.f32(),
    columns: [],
  };
  const first = c.u64();
  for (let k = 0; k < count; ++k) {
    const from = at + SPECTRUM_FIXED + k * (8 + bins);
    const head = new Cursor(new DataView(bytes), from);
    frame.columns.push({ number: first + k, mean_cm_s: head.f32(), edge_cm_s: head.f32(), power: new Uint8Array(bytes, from + 8, bins) });
  }
  return frame;
}

function decodeFace(bytes: ArrayBuffer, at: number): Face {
  if (at + FAN_BYTES > bytes.byteLength || new DataView(bytes).getUint16(at, true) !== FAN) return FLAT;
  const c = new Cursor(new DataView(bytes), at + 4);
  return { radius_mm: c.f32(), top_mm: c.f32() };
}

function decodeColour(bytes: ArrayBuffer, at: number): ColourFrame | null {
  if (at + COLOUR_FIXED > bytes.byteLength || new DataView(bytes).getUint16(at, true) === SPECTRUM) return null;
  const c = new Cursor(new DataView(bytes), at);
  const shown = c.u16() === 2 ? "power" : "velocity";
  const [left, top, width, height] = [c.u16(), c.u16(), c.u16(), c.u16()];
  c.u16();
  return {
    shown,
    left,
    top,
    width,
    height,
    limit_cm_s: c.f32(),
    box_mm: c.quat(),
    steer_deg: c.f32(),
    pixels: new Uint8Array(bytes, at + COLOUR_FIXED, width * height),
  };
}

function decodeFrame(bytes: ArrayBuffer, sequence: number): Frame {
  const c = new Cursor(new DataView(bytes), HEADER);
  const tick = c.u64();
  const time_s = c.f64();
  const nodes = c.u32();
  const width = c.u16();
  const height = c.u16();
  const snapshot: Snapshot = {
    tick,
    time_s,
    probe: c.u16(),
    fault: c.u16(),
    flags: c.u16(),
    iterations: c.u16(),
    awake: c.u32(),
    position_mm: c.vec3(),
    rotation: c.quat(),
    force_n: c.vec3(),
    rendered_force_n: c.vec3(),
    force_normal_n: c.f32(),
    penetration_mm: c.f32(),
    contact_area_mm2: c.f32(),
    vein_area_ratio: c.f32(),
    artery_area_ratio: c.f32(),
    vein_short_mm: c.f32(),
  };
  const width_mm = c.f32();
  const height_mm = c.f32();
  const quantum_mm = c.f32();
  const image = FRAME_FIXED + nodes * 6 + width * height;
  const face = decodeFace(bytes, image);
  const behind = image + (face.radius_mm > 0 ? FAN_BYTES : 0);
  const colour = decodeColour(bytes, behind);
  return {
    kind: "frame",
    sequence,
    snapshot,
    displacements: new Int16Array(bytes, FRAME_FIXED, nodes * 3),
    quantum_mm,
    width,
    height,
    width_mm,
    height_mm,
    face,
    pixels: new Uint8Array(bytes, FRAME_FIXED + nodes * 6, width * height),
    colour,
    spectrum: decodeSpectrum(bytes, behind + (colour ? COLOUR_FIXED + colour.pixels.length : 0)),
  };
}

/** Decodes a binary message; throws with a sentence when it is not one of ours. */
export function decode(bytes: ArrayBuffer): Mesh | Line | Frame {
  const c = new Cursor(new DataView(bytes), 0);
  if (bytes.byteLength < HEADER || c.u32() !== MAGIC) throw new Error("not a Sonde message");
  const version = c.u16();
  if (!VERSIONS.includes(version)) throw new Error(`protocol version ${version} is not one of ${VERSIONS.join(", ")}`);
  const type = c.u16();
  const id = c.u32();
  if (c.u32() !== bytes.byteLength) throw new Error("a message was cut");
  if (type === 3) return decodeFrame(bytes, id);
  const count = c.u32();
  const faces = c.u32();
  if (type === 2) return { kind: "line", part: id, points: new Float32Array(bytes, MESH_FIXED, count * 4) };
  if (type !== 1) throw new Error(`unknown message type ${type}`);
  return {
    kind: "mesh",
    part: id,
    points: new Float32Array(bytes, MESH_FIXED, count * 3),
    faces: new Uint32Array(bytes, MESH_FIXED + count * 12, faces * 3),
  };
}
