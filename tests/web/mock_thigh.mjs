// A plausible thigh for tests of the page without the program: a tapered cylinder with a vein and an
// artery, a probe that follows its goal, forces and images by simple formulas. Nothing here is physics.
// Messages are those of docs/page_protocol.md.

const RINGS = 29;
const AROUND = 40;
const MM_PER_RING = 10;
const RADIUS = (z) => 84 - 0.08 * z;
const VEIN = { x: 6, below: 21, radius: 5 };
const ARTERY = { x: 19, below: 19, radius: 3.8 };
const FRAME_MS = 50;
const SPEED_MM_S = 260;
const PX_PER_MM = 4;
const WIDTH_MM = 60;
const QUANTUM_MM = 0.002;
const PROBES = [
  { name: "linear", half_x_mm: 25, half_y_mm: 5, rectangular: true },
  { name: "point", half_x_mm: 4, half_y_mm: 4, rectangular: false },
];

function head(type, id, size) {
  const b = Buffer.alloc(size);
  b.write("SNDE", 0, "latin1");
  b.writeUInt16LE(2, 4);
  b.writeUInt16LE(type, 6);
  b.writeUInt32LE(id, 8);
  b.writeUInt32LE(size, 12);
  return b;
}

function mesh(part, points, faces) {
  const b = head(1, part, 24 + 4 * points.length + 4 * faces.length);
  b.writeUInt32LE(points.length / 3, 16);
  b.writeUInt32LE(faces.length / 3, 20);
  points.forEach((v, i) => b.writeFloatLE(v, 24 + 4 * i));
  faces.forEach((v, i) => b.writeUInt32LE(v, 24 + 4 * points.length + 4 * i));
  return b;
}

function line(part, points) {
  const b = head(2, part, 24 + 4 * points.length);
  b.writeUInt32LE(points.length / 4, 16);
  points.forEach((v, i) => b.writeFloatLE(v, 24 + 4 * i));
  return b;
}

/** A tube of rings along z, closed at both ends. */
function tube(radius, rings, around, cx = 0, cy = 0) {
  const points = [];
  const faces = [];
  for (let r = 0; r < rings; ++r)
    for (let a = 0; a < around; ++a) {
      const t = (2 * Math.PI * a) / around;
      const z = r * MM_PER_RING;
      points.push(cx + radius(z) * Math.cos(t), cy + radius(z) * Math.sin(t), z);
    }
  for (let r = 0; r + 1 < rings; ++r)
    for (let a = 0; a < around; ++a) {
      const [i, j] = [r * around + a, r * around + ((a + 1) % around)];
      faces.push(i, j, j + around, i, j + around, i + around);
    }
  for (const r of [0, rings - 1]) {
    points.push(cx, cy, r * MM_PER_RING);
    const centre = points.length / 3 - 1;
    for (let a = 0; a < around; ++a) {
      const [i, j] = [r * around + a, r * around + ((a + 1) % around)];
      faces.push(...(r === 0 ? [centre, j, i] : [centre, i, j]));
    }
  }
  return { points, faces };
}

function box(hx, hy) {
  const points = [];
  for (const z of [-60, 0]) for (const y of [-hy, hy]) for (const x of [-hx, hx]) points.push(x, y, z);
  return { points, faces: [0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5] };
}

const rotate = ([w, x, y, z], v) => {
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]];
};
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const clamp = (v, low, high) => Math.min(high, Math.max(low, v));

/** How long the mock's blood falls back after a squeeze. */
export const REFLUX_S = 0.8;

export class SyntheticThigh {
  constructor(toAll) {
    this.toAll = toAll;
    this.skin = tube(RADIUS, RINGS, AROUND);
    this.controls = {
      type: "controls", controls: true, probe: "linear", case: "healthy", stop: false, gain_db: 0, depth_mm: 70, frequency_mhz: 7.5,
      dynamic_range_db: 60, focus_mm: 25, tgc_db_per_cm: 0.5, posture: "supine", valsalva: false, gel: true, gel_ml: 0,
      stiffness_scale: 1, damping_scale: 1, friction_scale: 1,
      colour: "off", colour_box_mm: [-14, 14, 6, 36], colour_steer_deg: 0, colour_scale_cm_s: 6, colour_gain_db: 0,
      gate: false, gate_mm: [0, 20], gate_length_mm: 3, gate_steer_deg: 0, gate_angle_deg: 60, gate_scale_cm_s: 60, gate_baseline: 0, gate_filter_hz: 50, gate_gain_db: 0,
    };
    this.hand = []; // what the free hand and the patient did
    this.pose = { position_mm: [6, RADIUS(140) + 12, 140], rotation: [0.7071, 0.7071, 0, 0] };
    this.goal = this.pose;
    this.fault = 0;
    this.solid = true;
    this.sequence = 0;
    this.time_s = 0;
    this.noise = Uint8Array.from({ length: 65521 }, (_, i) => ((i * 7919) ^ (i * i * 31)) & 255);
    this.timer = setInterval(() => this.step(), FRAME_MS);
  }

  close() {
    clearInterval(this.timer);
  }

  hello() {
    const site = { id: 27, position_mm: [6, Math.sqrt(RADIUS(140) ** 2 - 36), 140], normal: [0.08, 0.997, 0], u: [1, 0, 0], v: [0, 0, 1],
      curves: { linear: [[0, 0], [10, 5], [20, 14], [30, 27]] } };
    return {
      type: "hello", version: 2, program: "mock", model: "synthetic_thigh", provenance: "A cylinder for tests of the page", nodes: this.skin.points.length / 3,
      faces: this.skin.faces.length / 3, force_limit_n: 40, controls: true, probes: PROBES,
      cases: ["healthy", "partial_mural", "acute_occlusive", "chronic_occlusive"], faults: ["none", "emergency stop"], sites: [site],
    };
  }

  geometry() {
    const femur = tube(() => 13, RINGS, 20, 4, 0);
    const vessel = (part, v) => {
      const points = [];
      for (let z = 10; z <= 270; z += 10) points.push(v.x, RADIUS(z) - v.below, z, v.radius);
      return line(part, points);
    };
    const probes = PROBES.map((p, i) => {
      const b = box(p.half_x_mm, p.half_y_mm);
      return mesh(16 + i, b.points, b.faces);
    });
    return [mesh(0, this.skin.points, this.skin.faces), mesh(1, femur.points, femur.faces), vessel(2, VEIN), vessel(3, ARTERY), ...probes];
  }

  /** A message of the controlling page that is not the trainer's. */
  receive(m) {
    if (m.type === "goal") this.goal = m;
    else if (m.type === "stop") this.fault = 1;
    else if (m.type === "resume") this.fault = 0;
    else if (m.type === "gel") this.controls.gel_ml = m.action === "put" ? this.controls.gel_ml + 2 : 0;
    else if (m.type === "hand") {
      this.hand.push(m.action);
      if (m.action === "squeeze") this.squeezed_s = this.time_s;
    }
    else if (m.type === "controls") for (const key of Object.keys(m)) if (key in this.controls && key !== "type" && key !== "controls") this.controls[key] = m[key];
    this.controls.stop = this.fault !== 0;
    return ["stop", "resume", "gel", "controls"].includes(m.type);
  }

  step() {
    this.time_s += FRAME_MS / 1000;
    const [from, to] = [this.pose.position_mm, this.goal.position_mm];
    const away = Math.hypot(...to.map((v, i) => v - from[i]));
    const share = away > 0 ? Math.min(1, (SPEED_MM_S * FRAME_MS) / 1000 / away) : 1;
    this.pose = { position_mm: from.map((v, i) => v + share * (to[i] - v)), rotation: this.goal.rotation };
    this.toAll(this.frame());
  }

  /** The operator's press and what it does to the vessels. */
  state() {
    const p = this.pose.position_mm;
    const axis = rotate(this.pose.rotation, [0, 0, 1]);
    const across = rotate(this.pose.rotation, [1, 0, 0]);
    const deep = RADIUS(p[2]) - Math.hypot(p[0], p[1]);
    const force = deep > 0 ? 0.28 * deep + 0.02 * deep * deep : 0;
    const local = (v) => dot([v.x - p[0], RADIUS(p[2]) - v.below - p[1], 0], across);
    const seen = Math.abs(local(VEIN)) < WIDTH_MM / 2 - 6;
    const clot = !["healthy"].includes(this.controls.case);
    const vein = clot ? clamp(1 - force / 90, 0, 1.2) : clamp(1 - (force - 1.5) / 7, 0.03, 1) * (this.controls.valsalva ? 1.4 : 1);
    return { axis, deep, force: this.fault ? 0 : force, seen, vein, artery: clamp(1 - (force - 7) / 30, 0.2, 1), veinX: local(VEIN), arteryX: local(ARTERY) };
  }

  frame() {
    const s = this.state();
    const nodes = this.skin.points.length / 3;
    const [w, h] = [WIDTH_MM * PX_PER_MM, Math.round(this.controls.depth_mm * PX_PER_MM)];
    // A curved face: its radius, and where the picture begins.
    const fan = Buffer.alloc(this.face ? 12 : 0);
    if (this.face) fan.writeUInt16LE(4, 0), fan.writeFloatLE(this.face.radius_mm, 4), fan.writeFloatLE(this.face.top_mm, 8);
    const colour = Buffer.concat([fan, this.colour(w, h)]);
    const spectrum = this.spectrum();
    const b = head(3, ++this.sequence, 140 + 6 * nodes + w * h + colour.length + spectrum.length);
    b.writeBigUInt64LE(BigInt(Math.round(this.time_s * 1000)), 16);
    b.writeDoubleLE(this.time_s, 24);
    b.writeUInt32LE(nodes, 32);
    const probe = Math.max(0, PROBES.findIndex((p) => p.name === this.controls.probe));
    [w, h, probe, this.fault, this.solid ? 0x8000 : 0, 4].forEach((v, i) => b.writeUInt16LE(v, 36 + 2 * i));
    b.writeUInt32LE(nodes, 48);
    const force = s.axis.map((v) => -v * s.force);
    const seen = (v) => (s.seen ? v : NaN);
    const values = [...this.pose.position_mm, ...this.pose.rotation, ...force, ...force, s.force, s.deep, s.deep > 0 ? 380 : 0,
      seen(s.vein), seen(s.artery), seen(2 * VEIN.radius * s.vein), WIDTH_MM, this.controls.depth_mm, QUANTUM_MM];
    values.forEach((v, i) => b.writeFloatLE(v, 52 + 4 * i));
    this.dent(b, s);
    this.image(b.subarray(140 + 6 * nodes, 140 + 6 * nodes + w * h), w, h, s);
    colour.copy(b, 140 + 6 * nodes + w * h);
    spectrum.copy(b, 140 + 6 * nodes + w * h + colour.length);
    return b;
  }

  /** 10 cm/s along the beam with the breath; squeezed 40 for a second, then REFLUX_S of -20. */
  flow(time_s) {
    const since = time_s - (this.squeezed_s ?? Infinity);
    if (since >= 0 && since < 1) return 40;
    if (since >= 1 && since < 1 + REFLUX_S) return -20;
    return 10 + 4 * Math.sin(2 * Math.PI * 0.25 * time_s);
  }

  /** The last columns, each as bright between the base line and the edge as it gets. */
  spectrum() {
    const c = this.controls;
    if (!c.gate) return Buffer.alloc(0);
    const [count, bins, limit] = [64, 128, c.gate_scale_cm_s];
    const first = Math.max(0, Math.floor(this.time_s * 100) - count);
    const b = Buffer.alloc(56 + count * (8 + bins), 20);
    [3, count, bins, 0].forEach((v, i) => b.writeUInt16LE(v, 2 * i));
    const low = limit * (c.gate_baseline - 1);
    [...c.gate_mm, c.gate_length_mm, c.gate_steer_deg ?? 0, c.gate_angle_deg, limit, low, 4000, 0.03, 0.01].forEach((v, i) => b.writeFloatLE(v, 8 + 4 * i));
    b.writeBigUInt64LE(BigInt(first), 48);
    for (let k = 0; k < count; ++k) {
      const at = 56 + k * (8 + bins);
      const mean = this.flow((first + k) / 100);
      b.writeFloatLE(mean, at);
      b.writeFloatLE(1.25 * mean, at + 4);
      for (let n = 0; n < bins; ++n) {
        const v = low + ((n + 0.5) * 2 * limit) / bins;
        if (v * mean > 0 && Math.abs(v) < Math.abs(1.25 * mean)) b[at + 8 + n] = 230;
      }
    }
    return b;
  }

  /** The box, full of the greatest velocity towards the probe. */
  colour(w, h) {
    const shown = ["off", "velocity", "power"].indexOf(this.controls.colour);
    if (shown <= 0) return Buffer.alloc(0);
    const [left, right, top, bottom] = this.controls.colour_box_mm;
    const place = [left * PX_PER_MM + w / 2, top * PX_PER_MM, (right - left) * PX_PER_MM, Math.min(bottom * PX_PER_MM, h) - top * PX_PER_MM].map(Math.round);
    const b = Buffer.alloc(36 + place[2] * place[3], 255);
    [shown, ...place, 0].forEach((v, i) => b.writeUInt16LE(v, 2 * i));
    [this.controls.colour_scale_cm_s, left, right, top, bottom, this.controls.colour_steer_deg ?? 0].forEach((v, i) => b.writeFloatLE(v, 12 + 4 * i));
    return b;
  }

  dent(b, s) {
    const p = this.pose.position_mm;
    const points = this.skin.points;
    if (s.deep <= 0) return;
    for (let i = 0; i < points.length; i += 3) {
      const d2 = (points[i] - p[0]) ** 2 + (points[i + 1] - p[1]) ** 2 + (points[i + 2] - p[2]) ** 2;
      const size = s.deep * Math.exp(-d2 / 900);
      if (size > 0.05) s.axis.forEach((v, k) => b.writeInt16LE(Math.round(clamp((v * size) / QUANTUM_MM, -32767, 32767)), 140 + 2 * (i + k)));
    }
  }

  image(out, w, h, s) {
    const gain = 10 ** (this.controls.gain_db / 40);
    const squeeze = Math.max(0, s.deep) * 0.5;
    const inside = (x, y, v, cx, open) => ((x - cx) / (v.radius * (1 + 0.4 * (1 - open)))) ** 2 + ((y - (v.below - squeeze)) / Math.max(0.3, v.radius * open)) ** 2;
    const clot = this.controls.case === "healthy" ? 6 : 46;
    const shift = Math.round(this.pose.position_mm[2]) * 131;
    for (let j = 0; j < h; ++j) {
      const y = j / PX_PER_MM;
      for (let i = 0; i < w; ++i) {
        const x = i / PX_PER_MM - WIDTH_MM / 2;
        const grain = this.noise[(i * 211 + j * 97 + shift + ((i >> 1) * (j >> 1)) * 13) % 65521];
        let base = 92 - 0.6 * y + (y < 2 ? 90 : 0);
        const v = inside(x, y, VEIN, s.veinX, Math.max(0.04, s.vein));
        const a = inside(x, y, ARTERY, s.arteryX, Math.max(0.3, s.artery));
        if (v < 1) base = clot;
        else if (a < 1) base = 5;
        else if (a < 1.5) base = 150;
        else if (v < 1.25) base = 120;
        if (Math.hypot(x, y - 62) < 14) base = Math.hypot(x, y - 62) > 12.5 ? 210 : 8;
        out[j * w + i] = s.deep > -1 ? clamp(base * (0.5 + grain / 255) * gain, 0, 255) : clamp(y < 1.5 ? 160 : 3 + grain / 40, 0, 255);
      }
    }
  }
}
