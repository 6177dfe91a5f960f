// A bare WebSocket client: reads frames as fast as they come, or never.
import { randomBytes } from "node:crypto";
import { connect } from "node:net";

const FRAME = 3;

function masked(text) {
  const data = Buffer.from(text);
  const mask = randomBytes(4);
  const body = data.map((byte, i) => byte ^ mask[i % 4]);
  const size = data.length < 126 ? [0x80 | data.length] : [0x80 | 126, data.length >> 8, data.length & 0xff];
  return Buffer.concat([Buffer.from([0x81, ...size]), mask, body]);
}

/** One whole message of the program at the start of the bytes, or null. */
function message(bytes) {
  if (bytes.length < 2) return null;
  const short = bytes[1] & 0x7f;
  const extra = short === 126 ? 2 : short === 127 ? 8 : 0;
  if (bytes.length < 2 + extra) return null;
  const size = extra === 2 ? bytes.readUInt16BE(2) : extra === 8 ? Number(bytes.readBigUInt64BE(2)) : short;
  const end = 2 + extra + size;
  return bytes.length < end ? null : { opcode: bytes[0] & 0x0f, data: bytes.subarray(2 + extra, end), end };
}

export class Client {
  /** reads: acknowledges every frame at once; otherwise it asks for everything and reads nothing. */
  constructor({ port, token }, reads) {
    this.sequences = [];
    this.parts = [];
    this.size = 0;
    this.wanted = 2;
    this.socket = connect(port, "127.0.0.1");
    this.socket.write(`GET /ws HTTP/1.1\r\nHost: 127.0.0.1:${port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: sonde, ${token}\r\n\r\n`);
    this.open = new Promise((done, fail) => {
      this.socket.once("error", fail);
      if (!reads) this.socket.once("connect", () => (this.socket.pause(), done()));
      else {
        // The head of the answer may come in several pieces.
        let head = Buffer.alloc(0);
        const readHead = (bytes) => {
          head = Buffer.concat([head, bytes]);
          const end = head.indexOf("\r\n\r\n");
          if (end < 0) return;
          this.socket.off("data", readHead);
          this.socket.on("data", (more) => this.hear(more));
          this.hear(head.subarray(end + 4));
          done();
        };
        this.socket.on("data", readHead);
      }
    });
  }

  hear(bytes) {
    this.parts.push(bytes);
    this.size += bytes.length;
    if (this.size < this.wanted) return; // no copy for every few kilobytes of a frame
    let rest = Buffer.concat(this.parts);
    for (let m = message(rest); m; m = message(rest)) {
      rest = rest.subarray(m.end);
      if (m.opcode === 1) this.heard?.(JSON.parse(m.data.toString()));
      if (m.opcode === 8) this.ended?.(m.data.readUInt16BE(0));
      if (m.opcode === 2 && m.data.readUInt16LE(6) === FRAME) this.acknowledge(m.data.readUInt32LE(8));
    }
    this.parts = [rest];
    this.size = rest.length;
    this.wanted = this.size + 2;
  }

  acknowledge(sequence) {
    this.sequences.push(sequence);
    this.socket.write(masked(JSON.stringify({ type: "ack", frame: sequence })));
    this.woken?.();
  }

  /** A message to the program, shorter than 64 KiB. */
  say(message) {
    this.socket.write(masked(JSON.stringify(message)));
  }

  /** Resolves once so many more frames have come. */
  async frames(count) {
    const end = this.sequences.length + count;
    while (this.sequences.length < end) await new Promise((done) => (this.woken = done));
  }

  /** Frames received of the next `published` that the program made: 1 when none was left out. */
  async share(published) {
    const from = this.sequences.length;
    const last = () => this.sequences.at(-1) ?? 0;
    while (this.sequences.length === from) await new Promise((done) => (this.woken = done));
    const start = last();
    while (last() < start + published) await new Promise((done) => (this.woken = done));
    return this.sequences.filter((s) => s > start && s <= start + published).length / published;
  }

  close() {
    this.socket.destroy();
  }
}
