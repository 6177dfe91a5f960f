// The teacher's board: all learners live, one WebSocket each, whose frames are acknowledged a second
// late so that a picture comes twice a second and not as often as it can.

import { freshId, socketAddress } from "./access";
import { showResults } from "./class_results";
import { button, find, make, minutes } from "./dom";
import { decode, type Exam, type Frame, type TextMessage } from "./protocol";
import { shown, t, told, translated } from "./words/language";

/** What a learner's program is doing, by the word that the class's program has for it. */
const STATES: Record<string, string> = {
  "given up": t("class.state.given_up"),
  ended: t("class.state.ended"),
  starting: t("class.state.starting"),
  practice: t("class.state.practice"),
  preparing: t("class.state.preparing"),
  running: t("class.state.running"),
  done: t("class.state.done"),
  replay: t("class.state.replay"),
  film: t("class.state.film"),
  edit: t("class.state.edit"),
};

interface Learner {
  place: number;
  name: string;
  state: string;
  case: string;
  elapsed_s: number | null;
  score: number | null;
  /** of the teacher; of the learner, for who comes back in another browser */
  token: string;
  learner_token: string;
}

interface ClassNews {
  code: string;
  address: string;
  places: number;
  wrong: number;
  learners: Learner[];
}

const NEWS_MS = 1000;
const ACK_MS = 1000;
const FRAME = 3;

/** What of the exam is done: places seen, presses and how many of them were good. */
export function progressOf(exam: Exam | null): string {
  if (!exam || exam.phase === "practice") return "";
  const needed = exam.segments.filter((s) => s.needed);
  const decided = needed.filter((s) => s.decision !== "").length;
  const good = exam.presses.filter((p) => p.result === "complete").length;
  return t("class.done", { decided, needed: needed.length, presses: exam.presses.length, good });
}

class Card {
  readonly box = make("article", "card");
  private readonly title = make("h2");
  private readonly state = make("span", "muted");
  private readonly canvas = make("canvas");
  private readonly values = new Map<string, HTMLElement>();
  private readonly back = make("code");
  private readonly comment = make("input");
  private readonly open = make("a", "button", t("class.open"));
  private socket: WebSocket | null = null;
  private exam: Exam | null = null;
  private holder = "";
  private retry_ms = 500;

  constructor(private learner: Learner) {
    const head = make("div", "head");
    head.append(this.title, this.state);
    const list = make("dl");
    for (const key of ["case", "force", "step", "progress", "score", "control"] as const) {
      const value = make("dd");
      value.dataset["of"] = key;
      this.values.set(key, value);
      list.append(make("dt", "", t(`class.${key}`)), value);
    }
    const body = make("div", "body");
    this.canvas.setAttribute("role", "img");
    body.append(this.canvas, list);
    const does = make("div", "does");
    Object.assign(this.open, { target: "_blank", rel: "noopener" });
    Object.assign(this.comment, { maxLength: 400, placeholder: t("class.comment"), autocomplete: "off" });
    this.comment.onkeydown = (event) => event.key === "Enter" && this.say();
    does.append(this.open, this.comment, button(t("class.send"), () => this.say()));
    const again = make("details");
    again.append(make("summary", "", t("class.come_back")), this.back);
    this.box.append(head, body, does, again);
    this.listen();
  }

  /** News of the class. */
  tell(learner: Learner, address: string): void {
    this.learner = learner;
    this.title.textContent = learner.name;
    const state = STATES[learner.state] ?? learner.state;
    this.state.textContent = learner.elapsed_s === null ? state : `${state} ${minutes(learner.elapsed_s)}`;
    this.canvas.setAttribute("aria-label", t("class.image_of", { name: learner.name }));
    this.comment.setAttribute("aria-label", t("class.comment_for", { name: learner.name }));
    this.open.setAttribute("aria-label", t("class.open_of", { name: learner.name }));
    this.open.href = `${learner.place}/#${learner.token}`;
    this.back.textContent = `${address}${learner.place}/#${learner.learner_token}`;
    this.put("case", told(learner.case) || "-");
    this.put("score", learner.score === null ? "-" : learner.score.toFixed(0));
  }

  close(): void {
    if (this.socket) this.socket.onclose = null;
    this.socket?.close();
  }

  private put(key: string, text: string): void {
    this.values.get(key)!.textContent = text;
  }

  private listen(): void {
    const socket = new WebSocket(socketAddress(freshId(), `${this.learner.place}/`), ["sonde", this.learner.token]);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => (this.retry_ms = 500);
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = () => {
      this.put("force", "-");
      window.setTimeout(() => this.listen(), this.retry_ms);
      this.retry_ms = Math.min(8000, 2 * this.retry_ms);
    };
    this.socket = socket;
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data !== "string") {
      if (new DataView(data).getUint16(6, true) === FRAME) this.show(decode(data) as Frame);
      return;
    }
    const message = translated(JSON.parse(data) as TextMessage);
    if (message.type === "exam") this.exam = message;
    if (message.type === "controls") this.holder = message.holder ?? "";
    this.put("step", this.exam?.step.text || "-");
    this.put("progress", progressOf(this.exam) || "-");
    this.put("control", this.holder || "-");
    this.values.get("control")!.className = this.holder === "teacher" ? "warn" : "";
  }

  private show(frame: Frame): void {
    const { width, height, pixels, snapshot } = frame;
    window.setTimeout(() => this.send({ type: "ack", frame: frame.sequence }), ACK_MS);
    this.put("force", `${shown(Math.max(0, snapshot.force_normal_n), 1)} N`);
    if (!width || !height) return;
    Object.assign(this.canvas, { width, height });
    const context = this.canvas.getContext("2d")!;
    const image = context.createImageData(width, height);
    for (let i = 0; i < width * height; ++i) {
      image.data.fill(pixels[i]!, 4 * i, 4 * i + 3);
      image.data[4 * i + 3] = 255;
    }
    context.putImageData(image, 0, 0);
  }

  private say(): void {
    const text = this.comment.value.trim();
    if (!text) return;
    this.send({ type: "comment", time_s: 0, text, author: t("class.teacher") });
    this.comment.value = "";
  }

  private send(message: object): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}

export function openBoard(room: HTMLElement, secret: string): void {
  const cards = new Map<number, Card>();
  const top = make("header", "top");
  const where = make("span", "muted");
  const code = make("b", "code");
  const wrong = make("span", "warn");
  const board = make("div", "board");
  const results = make("div", "results");
  const nobody = make("p", "empty muted", t("class.nobody"));
  const tabs = make("div", "tabs");
  tabs.setAttribute("role", "tablist");
  const show = (which: HTMLElement): void => {
    for (const view of [board, results]) view.hidden = view !== which;
    for (const tab of tabs.children) tab.setAttribute("aria-selected", String(tab.id === (which === board ? "tab-board" : "tab-results")));
    if (which === results) void showResults(results, secret);
  };
  for (const [id, text, view] of [["tab-board", t("class.learners"), board], ["tab-results", t("class.results"), results]] as const) {
    const tab = button(text, () => show(view));
    tab.id = id;
    tab.setAttribute("role", "tab");
    tabs.append(tab);
  }
  top.append(make("h1", "", t("class.title")), tabs, make("span", "spring"), where, code, wrong);
  room.replaceChildren(top, nobody, board, results);
  show(board);

  const update = (news: ClassNews): void => {
    where.textContent = t("class.join_at", { address: news.address });
    code.textContent = news.code;
    wrong.textContent = news.wrong ? t("class.wrong", { n: news.wrong }) : "";
    nobody.hidden = news.learners.length > 0 || board.hidden;
    for (const learner of news.learners) {
      const card = cards.get(learner.place) ?? new Card(learner);
      if (!cards.has(learner.place)) board.append(card.box);
      cards.set(learner.place, card);
      card.tell(learner, news.address);
    }
  };
  const ask = async (): Promise<void> => {
    try {
      const answer = await fetch("class.json", { headers: { Authorization: `Bearer ${secret}` }, cache: "no-store" });
      if (answer.status === 401) {
        for (const card of cards.values()) card.close();
        nobody.textContent = t("class.not_teacher");
        return;
      }
      update((await answer.json()) as ClassNews);
      find("live").textContent = "";
      top.classList.remove("lost");
    } catch {
      find("live").textContent = t("class.silent");
      code.textContent = t("class.silent");
    }
    window.setTimeout(() => void ask(), NEWS_MS);
  };
  void ask();
}
