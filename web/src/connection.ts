// The WebSocket: connects, says when the connection is lost and tries again.

import { clientId, isStranger, socketAddress, takeToken, token } from "./access";
import {
  decode,
  type ColourWish,
  type Controls,
  type Decision,
  type Frame,
  type GateWish,
  type Guidance,
  type Line,
  type Mesh,
  type Posture,
  type Quat,
  type RoleAction,
  type TextMessage,
  type Vec3,
} from "./protocol";
import { Wishes } from "./wish";

export interface ConnectionEvents {
  text(message: TextMessage): void;
  geometry(part: Mesh | Line): void;
  frame(frame: Frame): void;
  state(connected: boolean, retryInS: number): void;
  /** the program is there, but this page has not got its token */
  refused(): void;
}

export type EchoKey = "gain_db" | "depth_mm" | "frequency_mhz" | "dynamic_range_db" | "focus_mm" | "tgc_db_per_cm";
export type TissueKey = "stiffness_scale" | "damping_scale" | "friction_scale";

export interface ExamWish {
  case: string;
  protocol: string;
  guidance: Guidance;
  trainee: string;
}

export class Connection {
  /** smoothed round trip of a ping, ms */
  latency_ms = NaN;
  /** the scanner's controls: those asked for over those told */
  readonly wishes = new Wishes<Controls>();
  private socket: WebSocket | null = null;
  private retry = 0;
  private pingId = 0;
  private pingSent = 0;
  private timer = 0;
  private readonly id = clientId();

  constructor(private readonly events: ConnectionEvents) {
    takeToken();
    this.open();
    window.addEventListener("hashchange", () => takeToken() && !this.connected && this.open());
    window.setInterval(() => this.ping(), 1000);
  }

  goal(position_mm: Vec3, rotation: Quat): void {
    this.send({ type: "goal", position_mm, rotation });
  }
  probe(probe: string): void {
    this.send({ type: "controls", probe });
  }
  pathology(name: string): void {
    this.send({ type: "controls", ...this.wishes.ask({ case: name }) });
  }
  set(key: EchoKey | TissueKey, value: number): void {
    this.send({ type: "controls", [key]: value });
  }
  posture(posture: Posture): void {
    this.send({ type: "controls", ...this.wishes.ask({ posture }) });
  }
  valsalva(valsalva: boolean): void {
    this.send({ type: "controls", ...this.wishes.ask({ valsalva }) });
  }
  gel(action: "put" | "wipe"): void {
    this.send({ type: "gel", action });
  }
  colour(wish: ColourWish): void {
    this.send({ type: "controls", ...this.wishes.ask(wish) });
  }
  gate(wish: GateWish): void {
    this.send({ type: "controls", ...this.wishes.ask(wish) });
  }
  hand(action: "squeeze" | "breathe"): void {
    this.send({ type: "hand", action });
  }
  role(action: RoleAction): void {
    this.send({ type: "role", action });
  }
  stop(): void {
    this.send({ type: "stop" });
  }
  resume(): void {
    this.send({ type: "resume" });
  }
  startExam(wish: ExamWish): void {
    this.send({ type: "start_exam", ...wish });
  }
  startLesson(lesson: string, turn: number, trainee: string): void {
    this.send({ type: "start_lesson", lesson, turn, trainee });
  }
  demonstrate(lesson: string): void {
    this.send({ type: "demonstrate", lesson });
  }
  next(): void {
    this.send({ type: "next" });
  }
  decide(segment: string, decision: Decision): void {
    this.send({ type: "decide", segment, decision });
  }
  hint(): void {
    this.send({ type: "hint" });
  }
  position(position: string): void {
    this.send({ type: "position", position });
  }
  finishExam(): void {
    this.send({ type: "finish_exam" });
  }
  leaveExam(): void {
    this.send({ type: "leave_exam" });
  }
  listExams(): void {
    this.send({ type: "list_exams" });
  }
  exportExam(exam: string, what: string, part: number): void {
    this.send({ type: "export", exam, what, part });
  }
  openReplay(exam: string): void {
    this.send({ type: "open_replay", exam });
  }
  seek(time_s: number): void {
    this.send({ type: "seek", time_s });
  }
  play(playing: boolean, speed: number): void {
    this.send({ type: "play", playing, speed });
  }
  comment(time_s: number, text: string, author: string): void {
    this.send({ type: "comment", time_s, text, author });
  }
  edit(message: object): void {
    this.send({ type: "edit", ...message });
  }
  worksheet(entry: object): void {
    this.send({ type: "worksheet", ...entry });
  }
  ack(sequence: number): void {
    this.send({ type: "ack", frame: sequence });
  }

  private send(message: object): void {
    if (this.connected) this.socket!.send(JSON.stringify(message));
  }

  private ping(): void {
    this.pingSent = performance.now();
    this.send({ type: "ping", id: ++this.pingId });
  }

  private get connected(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  private open(): void {
    window.clearTimeout(this.timer);
    if (this.socket) this.socket.onclose = null;
    // Beside the page, wherever it lies: a class serves several pages on one port.
    const socket = new WebSocket(socketAddress(this.id), token() ? ["sonde", token()] : ["sonde"]);
    let greeted = false;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      greeted = true;
      this.retry = 0;
      this.wishes.forget();
      this.events.state(true, 0);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = () => void this.closed(socket, greeted);
    this.socket = socket;
  }

  private async closed(socket: WebSocket, greeted: boolean): Promise<void> {
    this.latency_ms = NaN;
    if (!greeted && (await isStranger())) return this.events.refused();
    if (socket !== this.socket) return; // another one was opened meanwhile
    const wait_s = Math.min(4, 0.5 * 2 ** this.retry++);
    this.events.state(false, wait_s);
    this.timer = window.setTimeout(() => this.open(), wait_s * 1000);
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data === "string") {
      const message = JSON.parse(data) as TextMessage;
      if (message.type === "controls") this.wishes.tell(message);
      if (message.type !== "pong") this.events.text(message);
      else if (message.id === this.pingId) this.measure(performance.now() - this.pingSent);
      return;
    }
    const message = decode(data);
    if (message.kind === "frame") this.events.frame(message);
    else this.events.geometry(message);
  }

  private measure(ms: number): void {
    this.latency_ms = Number.isNaN(this.latency_ms) ? ms : 0.7 * this.latency_ms + 0.3 * ms;
  }
}
