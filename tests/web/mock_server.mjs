// A stand-in for `sonde run` that speaks version 2 of the page's protocol: serves the built page, a
// thigh (its own, or that of a running program) and the trainer. For tests and for work on the page.
// Usage: node mock_server.mjs WEB_DIR [--port N] [--program ADDRESS]
// WEB_DIR has package.json, node_modules and dist/; ADDRESS is what sonde run prints.
import http from "node:http";
import { createRequire } from "node:module";
import { existsSync, readFileSync, realpathSync } from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { findAddress } from "./drive.mjs";
import { SyntheticThigh } from "./mock_thigh.mjs";
import { Trainer } from "./mock_trainer.mjs";

const TYPES = { html: "text/html; charset=utf-8", css: "text/css", js: "text/javascript" };
const MOST_UNSEEN = 2; // frames that a client has not acknowledged
const SIZE_AT = 12;
const NODES_AT = 32; // in a frame: their number,
const DISPLACEMENTS_AT = 140; // and 6 bytes for each

/** Forwards a running program's thigh, images and forces. */
class ProgramThigh {
  constructor(WebSocket, address, toAll) {
    this.parts = [];
    this.ready = new Promise((resolve) => (this.resolve = resolve));
    const at = findAddress(address);
    this.socket = new WebSocket(`ws://127.0.0.1:${at.port}/ws`, ["sonde", at.token]);
    this.socket.on("message", (data, binary) => this.message(data, binary, toAll));
    this.extra = { posture: "supine", valsalva: false, gel: true, gel_ml: 0, stiffness_scale: 1, damping_scale: 1, friction_scale: 1 };
  }
  message(data, binary, toAll) {
    if (!binary) {
      const m = JSON.parse(data.toString());
      if (m.type === "hello") this.greeting = m;
      if (m.type === "controls") {
        this.own = m;
        this.resolve();
        this.changed?.();
      }
    } else if (data.readUInt16LE(6) === 3) {
      this.send({ type: "ack", frame: data.readUInt32LE(8) });
      toAll(data);
    } else this.parts.push(data);
  }
  send(m) {
    this.socket.send(JSON.stringify(m));
  }
  get controls() {
    return { ...this.own, ...this.extra };
  }
  hello() {
    return { ...this.greeting, version: 2 };
  }
  geometry() {
    return this.parts;
  }
  receive(m) {
    if (m.type === "gel") this.extra.gel_ml = m.action === "put" ? this.extra.gel_ml + 2 : 0;
    else if (m.type === "controls" && Object.keys(m).some((k) => k in this.extra)) {
      for (const k of Object.keys(m)) if (k in this.extra) this.extra[k] = m[k];
    } else {
      this.send(m);
      return false; // the program answers with its controls
    }
    return true;
  }
  close() {
    this.socket.close();
  }
}

/** The same frame of a skin with fewer nodes. */
function withoutNodes(frame, count) {
  const [nodes, at] = [frame.readUInt32LE(NODES_AT), DISPLACEMENTS_AT];
  const fewer = Buffer.concat([frame.subarray(0, at + 6 * (nodes - count)), frame.subarray(at + 6 * nodes)]);
  fewer.writeUInt32LE(fewer.length, SIZE_AT);
  fewer.writeUInt32LE(nodes - count, NODES_AT);
  return fewer;
}

/** Starts a mock; resolves to {address, trainer, thigh, drop(ms), close()}. */
export async function startMock({ webDir, port = 0, program = null, list = [] }) {
  const { WebSocketServer, WebSocket } = createRequire(path.join(webDir, "package.json"))("ws");
  const clients = new Set();
  const text = (m) => JSON.stringify(m);
  let away = false;
  let latest = null;
  const toAll = (frame) => {
    latest = frame;
    trainer.frame(frame);
    const shown = trainer.replay?.frame ? Buffer.from(trainer.replay.frame) : frame;
    shown.writeUInt32LE(frame.readUInt32LE(8), 8); // a replayed frame keeps its content only
    for (const c of clients) if (c.sent - c.seen < MOST_UNSEEN) c.socket.send(shown, () => undefined), c.sent++, (c.last = frame.readUInt32LE(8));
  };
  const everyone = (m) => clients.forEach((c) => c.socket.send(text(m)));
  const first = () => clients.values().next().value;
  const role = (c) => ({ ...thigh.controls, controls: c === first(), ...(trainer.exam.phase === "practice" ? {} : { case: "" }) });
  const roles = () => clients.forEach((c) => c.socket.send(text(role(c))));
  const introduce = (c) => {
    c.socket.send(text({ ...thigh.hello(), ...trainer.greeting(), controls: c === first() }));
    for (const part of thigh.geometry()) c.socket.send(part);
    c.socket.send(text(role(c)));
    for (const m of trainer.state()) c.socket.send(text(m));
    // A frame of the patient before, who had fewer nodes, may come after the new skin.
    if (latest) c.socket.send(withoutNodes(latest, 8));
  };
  const prepare = (truth) => {
    thigh.receive({ type: "controls", case: truth });
    clients.forEach(introduce);
  };
  const trainer = new Trainer({ send: everyone, prepare, list });
  const thigh = program ? new ProgramThigh(WebSocket, program, toAll) : new SyntheticThigh(toAll);
  thigh.changed = roles;
  await thigh.ready;
  learn(trainer, thigh.geometry());

  const server = http.createServer((request, response) => serve(webDir, trainer, request, response));
  const sockets = new WebSocketServer({ server, path: "/ws", verifyClient: () => !away });
  sockets.on("connection", (socket) => {
    const c = { socket, sent: 0, seen: 0, last: 0 };
    clients.add(c);
    introduce(c);
    socket.on("message", (data) => receive(c, JSON.parse(data.toString())));
    socket.on("close", () => {
      clients.delete(c);
      roles();
    });
  });
  function receive(c, m) {
    if (m.type === "ping") return socket(c, { type: "pong", id: m.id });
    if (m.type === "ack") return void (c.seen = m.frame >= c.last ? c.sent : c.seen + 1);
    if (c !== first() && m.type !== "stop" && m.type !== "list_exams") return;
    const phase = trainer.exam.phase;
    if (!trainer.receive(m) && thigh.receive(m)) roles();
    if (trainer.exam.phase !== phase) roles();
  }
  const socket = (c, m) => c.socket.send(text(m));
  await new Promise((resolve) => server.listen(port, "127.0.0.1", resolve));
  return {
    address: `http://127.0.0.1:${server.address().port}/`, trainer, thigh, clients,
    /** The program is away for so long, or until it is back; what it knows is kept. */
    drop(ms = 0) {
      away = true;
      clients.forEach((c) => c.socket.terminate());
      if (ms) setTimeout(() => (away = false), ms);
    },
    back() {
      away = false;
    },
    close() {
      clearInterval(trainer.player);
      thigh.close();
      clients.forEach((c) => c.socket.terminate());
      server.close();
    },
  };
}

/** The trainer's targets lie on the skin above the vein. */
function learn(trainer, parts) {
  const read = (b, k) => Array.from({ length: b.readUInt32LE(16) }, (_, i) => [0, 1, 2].map((j) => b.readFloatLE(24 + 4 * (k * i + j))));
  for (const b of parts) {
    if (b.readUInt16LE(6) === 1 && b.readUInt32LE(8) === 0) trainer.points = read(b, 3);
    if (b.readUInt16LE(6) === 2 && b.readUInt32LE(8) === 2) trainer.vein = read(b, 4);
  }
}

function serve(webDir, trainer, request, response) {
  const uri = new URL(request.url, "http://x").pathname;
  if (uri === "/status.json") return response.writeHead(200, { "Content-Type": "application/json" }).end("{}");
  const report = /^\/report\/(.+)$/.exec(uri);
  if (report) {
    const e = trainer.list.find((x) => x.id === report[1]);
    response.writeHead(e ? 200 : 404, { "Content-Type": TYPES.html });
    return response.end(`<!doctype html><html lang="en"><title>Report</title><h1>${e ? `${e.title}: ${e.score}` : "no such exam"}</h1></html>`);
  }
  const file = path.join(webDir, "dist", uri === "/" ? "index.html" : path.basename(uri));
  if (!existsSync(file)) return response.writeHead(404).end();
  response.writeHead(200, { "Content-Type": TYPES[file.split(".").pop()] ?? "application/octet-stream" });
  response.end(readFileSync(file));
}

if (process.argv[1] && realpathSync(process.argv[1]) === fileURLToPath(import.meta.url)) {
  const option = (name) => (process.argv.includes(name) ? process.argv[process.argv.indexOf(name) + 1] : null);
  const mock = await startMock({ webDir: process.argv[2], port: Number(option("--port") ?? 0), program: option("--program") });
  console.log(mock.address);
}
