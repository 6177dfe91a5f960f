// The trainer's side of the protocol for tests of the page: exam, findings, hints, score, list, replay,
// comments. It follows the frames of whatever thigh is behind it; the numbers are plausible, no more.

const CASES = [
  ["first_walk", "First walk", "Maria, 34. Calf cramp after a long flight. No swelling.", "first", "healthy"],
  ["runner", "The runner", "Jonas, 27. Pulled a muscle on Sunday, thigh tender since.", "easy", "healthy"],
  ["after_hip", "After the new hip", "Elsbeth, 71. Sixth day after a hip replacement; the leg is warm and swollen.", "easy", "acute_occlusive"],
  ["long_drive", "A long drive", "Ravi, 52. Drove for eleven hours; the groin aches.", "easy", "acute_occlusive"],
  ["old_story", "An old story", "Henrik, 66. A clot four years ago; the leg has never been quite right.", "hard", "chronic_occlusive"],
  ["newborn", "Three weeks after birth", "Amina, 29. Left leg heavy for two days.", "easy", "acute_occlusive"],
  ["oedema", "Heavy legs", "Walter, 80. Heart failure, both legs swollen, deep dents.", "hard", "healthy"],
  ["gym", "Big thighs", "Tom, 41. Weight lifter, 128 kg. Sudden pain while squatting.", "hard", "healthy"],
  ["knee", "Behind the knee", "Irene, 58. A lump behind the knee, painful on walking.", "hard", "healthy"],
  ["groin", "A lump in the groin", "Luis, 45. Fever last week, tender lump in the groin.", "hard", "healthy"],
  ["partial", "Half a day", "Sofia, 38. Started the pill in spring; pain since noon.", "hard", "partial_mural"],
  ["twin", "Two of them", "Karl, 49. Referred because 'one vein too many' was seen.", "hard", "healthy"],
].map(([id, title, history, level, truth]) => ({ id, title, history, level, truth }));

const PROTOCOLS = [
  { id: "two_point", title: "2-point", text: "Groin and above the knee. Quick; misses a clot between them." },
  { id: "three_point", title: "3-point", text: "Groin, mid thigh, above the knee." },
  { id: "extended", title: "Extended", text: "Every 2 cm from the groin to the knee." },
];

const SEGMENTS = [
  ["common_femoral", "Common femoral", 15, 65],
  ["femoral_upper", "Femoral, upper", 65, 120],
  ["femoral_middle", "Femoral, middle", 120, 180],
  ["femoral_lower", "Femoral, lower", 180, 225],
  ["popliteal", "Femoral, above the knee", 225, 270],
].map(([id, title, from_mm, to_mm]) => ({ id, title, from_mm, to_mm }));
const NEEDED = { two_point: [0, 4], three_point: [0, 2, 4], extended: [0, 1, 2, 3, 4] };
const POINTS = { two_point: 1, three_point: 1, extended: 3 };

const TOUCH_N = 0.5;
const TARGET_N = [12, 25]; // from what closes a healthy vein to the limit
const CLOSED = 0.15;
const OFF_AXIS_DEG = 20;
const RADIUS_MM = 14;
const PREPARE_MS = 350;
const KEEP_MS = 90; // of the frames kept for the replay
const HINT_MS = 10000;

const rotateY = ([w, x, y, z]) => [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)];
const practice = () => ({
  type: "exam", phase: "practice", message: "", progress: 0, exam: "", case: "", title: "", history: "", protocol: "", guidance: "full", elapsed_s: 0,
  recording: false, step: { text: "", detail: "", segment: "", target: null, force_n: null, offset_mm: null, angle_deg: null, angle_ok: false }, compression: null,
  segments: [], presses: [], hint: "", hints_used: 0, result: null,
});

export class Trainer {
  /** thigh: {skinPoints, vein}; send: to all pages; prepare(case): makes the thigh new */
  constructor({ send, prepare, list = [] }) {
    Object.assign(this, { send, prepare, list, exam: practice(), replay: null, trainee: "", points: [], vein: [] });
    this.truth = "healthy";
    this.kept = new Map();
    this.press = null;
  }

  greeting() {
    return { trainer: true, trainee: this.trainee, case_list: CASES.map(({ truth, ...shown }) => shown), protocols: PROTOCOLS, device: "page" };
  }

  state() {
    return this.replay ? [this.exam, this.replay.message] : [this.exam];
  }

  tell() {
    for (const m of this.state()) this.send(m);
  }

  /** True when the message was the trainer's. */
  receive(m) {
    const does = {
      start_exam: () => this.begin(m), decide: () => this.decide(m), hint: () => this.hint(), finish_exam: () => this.finish(), leave_exam: () => this.leave(),
      list_exams: () => this.send({ type: "exams", list: this.list }), open_replay: () => this.open(m.exam), seek: () => this.seek(m.time_s),
      play: () => this.play(m), comment: () => this.comment(m),
    }[m.type];
    does?.();
    return does !== undefined;
  }

  begin({ case: id, protocol, guidance, trainee }) {
    const c = CASES.find((x) => x.id === id);
    if (!c) return this.send({ type: "error", message: `there is no case ${id}` });
    this.leaveQuietly();
    this.trainee = trainee;
    this.truth = c.truth;
    const needed = NEEDED[protocol] ?? NEEDED.two_point;
    const segments = SEGMENTS.map((s, i) => ({ ...s, needed: needed.includes(i), points: needed.includes(i) ? POINTS[protocol] : 0, done: 0, decision: "" }));
    const now = new Date();
    this.exam = { ...practice(), phase: "preparing", message: `Preparing ${c.title}`, exam: `${now.toISOString().slice(0, 19).replace(/[:T]/g, "-")}-${this.list.length}`,
      case: id, title: c.title, history: c.history, protocol, guidance, recording: true, segments };
    this.tell();
    setTimeout(() => {
      this.exam.progress = 0.6;
      this.tell();
    }, PREPARE_MS / 2);
    setTimeout(() => this.run(c), PREPARE_MS);
  }

  run(c) {
    this.prepare(c.truth);
    Object.assign(this.exam, { phase: "running", message: "" });
    this.started = Date.now();
    this.press = null;
    this.seen = "";
    this.frames = [];
    this.tell();
  }

  decide({ segment, decision }) {
    const s = this.exam.segments.find((x) => x.id === segment);
    if (s) s.decision = decision;
    this.tell();
  }

  hint() {
    const next = this.next();
    this.exam.hint = next ? `Place the probe across the leg ${this.where(next)} and press until the vein is gone.` : "Say what you found, then finish.";
    this.exam.hints_used++;
    this.hintUntil = Date.now() + HINT_MS;
    this.tell();
  }

  where(s) {
    return { common_femoral: "in the groin", popliteal: "just above the knee" }[s.id] ?? "at mid thigh";
  }

  next() {
    return this.exam.segments.find((s) => s.needed && s.done < s.points);
  }

  undecided() {
    return this.exam.segments.find((s) => s.needed && s.decision === "");
  }

  leaveQuietly() {
    this.exam = practice();
    this.replay = null;
    clearInterval(this.player);
  }

  leave() {
    this.leaveQuietly();
    this.tell();
  }

  finish() {
    const e = this.exam;
    const sick = this.truth !== "healthy";
    const needed = e.segments.filter((s) => s.needed);
    const said = needed.some((s) => s.decision === "clot");
    const covered = needed.filter((s) => s.done >= s.points).length / needed.length;
    const told = needed.filter((s) => s.decision).length / needed.length;
    const correct = said === sick && told === 1;
    const bad = e.presses.filter((p) => ["too_hard", "off_axis", "insufficient"].includes(p.result)).length;
    const score = Math.max(0, Math.min(correct ? 100 : 59, Math.round(60 * covered + 30 * told + 10 - 4 * bad)));
    const names = (list) => list.map((s) => s.title.toLowerCase()).join(", ");
    const missed = needed.filter((s) => s.done < s.points);
    e.phase = "done";
    e.result = {
      score, passed: correct && score >= 70, correct, report: `/report/${e.exam}`,
      note: `What ${e.title} teaches.`,
      parts: [
        { title: "Findings", points: 40 * told, of: 40, lost: told < 1 ? `${names(needed.filter((s) => !s.decision))}: no finding` : "" },
        { title: "Force", points: 10 * covered, of: 10, lost: covered < 1 ? `${names(missed)}: not examined` : "" },
      ],
      summary: missed.length ? `No valid compression at: ${names(missed)}.` : `Every point of the protocol was compressed${bad ? `; ${bad} of ${e.presses.length} presses were not valid` : ""}.`,
      diagnosis: { asked: said ? `Clot at: ${names(needed.filter((s) => s.decision === "clot"))}` : "No clot", truth: sick ? "Clot in every segment" : "No clot: the vein closes everywhere" },
    };
    this.kept.set(e.exam, { frames: this.frames, presses: e.presses, comments: [], title: e.title });
    this.list.unshift({ id: e.exam, trainee: this.trainee, case: e.case, title: e.title, date: new Date().toISOString(), protocol: e.protocol, score, passed: e.result.passed,
      seconds: e.elapsed_s, report: e.result.report, recording: true });
    this.tell();
  }

  // ---- a frame ---------------------------------------------------------------------------------

  /** Follows the probe; b is a frame message. */
  frame(b) {
    if (this.exam.phase !== "running") return;
    const now = Date.now();
    this.exam.elapsed_s = (now - this.started) / 1000;
    if (now - (this.frames[this.frames.length - 1]?.at ?? 0) >= KEEP_MS) this.frames.push({ at: now, t_s: this.exam.elapsed_s, bytes: b });
    const f = (at) => b.readFloatLE(at);
    const snap = { position: [f(52), f(56), f(60)], rotation: [f(64), f(68), f(72), f(76)], force: f(104), vein: f(116), artery: f(120) };
    const along = Math.abs(rotateY(snap.rotation)[2]);
    snap.angle = (Math.acos(Math.min(1, along)) * 180) / Math.PI;
    this.compress(snap);
    this.guide(snap);
    if (now - (this.told ?? 0) >= 200) {
      this.told = now;
      this.tell();
    }
  }

  compress(s) {
    const p = this.press;
    if (s.force > TOUCH_N && !p) this.press = { t_s: this.exam.elapsed_s, force: 0, vein: 9, angle: s.angle, z: s.position[2] };
    else if (s.force > TOUCH_N) {
      if (s.force >= p.force) Object.assign(p, { force: s.force, angle: s.angle, z: s.position[2] });
      if (s.vein < p.vein) p.vein = s.vein;
    } else if (p) this.release(p);
    this.exam.compression = this.exam.guidance === "full" ? this.judge(s) : null;
  }

  judge(s) {
    const nullable = (v) => (Number.isNaN(v) ? null : v);
    let state = "none";
    if (s.force > TOUCH_N) state = "pressing";
    if (s.force > 2 && s.angle > OFF_AXIS_DEG) state = "off_axis";
    else if (s.force > TARGET_N[1]) state = "too_hard";
    else if (s.vein < CLOSED) state = "complete";
    else if (s.force >= TARGET_N[0]) state = "open";
    return { state, vein: nullable(s.vein), artery: nullable(s.artery) };
  }

  release(p) {
    this.press = null;
    const s = this.exam.segments.find((x) => p.z >= x.from_mm && p.z < x.to_mm);
    const result = p.angle > OFF_AXIS_DEG ? "off_axis" : p.force > TARGET_N[1] ? "too_hard" : p.vein < CLOSED ? "complete" : p.force >= TARGET_N[0] ? "open" : "insufficient";
    if (p.force > 1) this.exam.presses.push({ t_s: p.t_s, z_mm: p.z, segment: s?.id ?? "", result, force_n: p.force });
    if (s && (result === "complete" || result === "open") && s.done < s.points) s.done++;
    if (s && (result === "complete" || result === "open")) this.seen = s.id; // asked for first
    this.tell();
  }

  /** Skin nearest to the vein at a height, and the way out of the leg there. */
  skinAbove(z) {
    const vein = this.vein.reduce((a, p) => (Math.abs(p[2] - z) < Math.abs(a[2] - z) ? p : a));
    let best = null;
    let least = Infinity;
    for (const p of this.points) {
      const cost = Math.hypot(p[0] - vein[0], p[1] - vein[1], 2 * (p[2] - z));
      if (p[1] > vein[1] && cost < least) [best, least] = [p, cost];
    }
    const out = Math.hypot(best[0] - vein[0], best[1] - vein[1]);
    const normal = [(best[0] - vein[0]) / out, (best[1] - vein[1]) / out, 0];
    return { position_mm: best, normal, across: [normal[1], -normal[0], 0] };
  }

  guide(s) {
    const e = this.exam;
    const step = (e.step = { text: "", detail: "", segment: "", target: null, force_n: null, offset_mm: null, angle_deg: null, angle_ok: s.angle <= OFF_AXIS_DEG });
    if (this.hintUntil && Date.now() > this.hintUntil) [e.hint, this.hintUntil] = ["", 0];
    if (e.guidance === "exam") return;
    const [next, open] = [this.next(), this.undecided()];
    const due = (x) => x.needed && x.done >= x.points && x.decision === "";
    const pending = e.segments.find((x) => x.id === this.seen && due(x)) ?? e.segments.find(due);
    step.segment = pending?.id ?? "";
    if (pending) step.text = `What did you see at ${pending.title.toLowerCase()}?`;
    else if (next) step.text = `Compress the vein ${this.where(next)}: ${next.title.toLowerCase()}`;
    else step.text = open ? `What did you see at ${open.title.toLowerCase()}?` : "All points are done. Finish the exam.";
    if (e.guidance !== "full") return;
    step.angle_deg = s.angle;
    if (!next) step.detail = pending ? "Choose a finding." : "You see your score and the truth after it.";
    else {
      const z = next.from_mm + ((next.done + 0.5) / next.points) * (next.to_mm - next.from_mm);
      const at = this.skinAbove(z);
      const off = at.position_mm.map((v, i) => v - s.position[i]);
      const height = off.reduce((sum, v, i) => sum + v * at.normal[i], 0);
      step.offset_mm = Math.hypot(...off.map((v, i) => v - height * at.normal[i]));
      step.target = { name: next.title, ...at, radius_mm: RADIUS_MM };
      step.force_n = TARGET_N;
      if (pending) step.detail = `Then compress the vein ${this.where(next)}.`;
      else step.detail = step.offset_mm > RADIUS_MM ? "Move the probe into the ring, across the leg." : "Press until the walls touch, then let go.";
    }
  }

  // ---- replay ----------------------------------------------------------------------------------

  open(id) {
    const kept = this.kept.get(id);
    if (!kept || kept.frames.length === 0) return this.send({ type: "error", message: `exam ${id} has no recording` });
    const frames = kept.frames;
    this.replay = { kept, message: { type: "replay", exam: id, title: kept.title, duration_s: frames[frames.length - 1].t_s, time_s: 0, playing: false, speed: 1, presses: kept.presses, comments: kept.comments } };
    this.exam = { ...practice(), phase: "replay", exam: id, title: kept.title };
    this.tell();
    this.seek(0);
    clearInterval(this.player);
    this.player = setInterval(() => this.advance(0.1), 100);
  }

  seek(time_s) {
    const r = this.replay;
    if (!r) return;
    r.message.time_s = Math.max(0, Math.min(r.message.duration_s, time_s));
    r.frame = r.kept.frames.reduce((a, f) => (Math.abs(f.t_s - time_s) < Math.abs(a.t_s - time_s) ? f : a)).bytes;
    this.tell();
  }

  advance(dt_s) {
    const m = this.replay?.message;
    if (!m?.playing) return;
    this.seek(m.time_s + dt_s * m.speed);
    if (m.time_s >= m.duration_s) m.playing = false;
  }

  play({ playing, speed }) {
    if (!this.replay) return;
    const m = this.replay.message;
    if (playing && m.time_s >= m.duration_s) m.time_s = 0;
    Object.assign(m, { playing, speed });
    this.tell();
  }

  comment({ time_s, text, author }) {
    this.replay?.kept.comments.push({ t_s: time_s, text, author });
    this.replay?.kept.comments.sort((a, b) => a.t_s - b.t_s);
    this.tell();
  }
}
