// The replay's bar: scrub along the presses, play, speed, and a teacher's comments.

import { announce, button, draw, find, make, minutes, press, recall, release, remember } from "./dom";
import type { Comment, Exam, Press, PressResult, Replay } from "./protocol";
import { Wishes } from "./wish";
import { PRESS_WORDS } from "./words";
import { t } from "./words/language";

const SEEK_MS = 80; // while the slider is dragged

export interface ReplayActions {
  seek(time_s: number): void;
  play(playing: boolean, speed: number): void;
  comment(time_s: number, text: string, author: string): void;
  leave(): void;
}

export class ReplayBar {
  private replay: Replay | null = null;
  private exam: Exam | null = null; // that runs and may be commented on
  private readonly wishes = new Wishes<{ time_s: number }>();
  private held = false; // the slider is in the hand
  private sent_ms = 0;
  private marksKey = "";
  private readonly scrub = find<HTMLInputElement>("scrub");
  private readonly speed = find<HTMLSelectElement>("replay-speed");

  constructor(private readonly actions: ReplayActions) {
    press("replay-play", () => this.toggle());
    press("replay-leave", () => actions.leave());
    press("replay-comment", () => this.write());
    this.scrub.oninput = () => this.slide();
    this.scrub.onchange = () => {
      this.held = false;
      actions.seek(this.scrub.valueAsNumber);
      release(this.scrub);
    };
    this.speed.onchange = () => {
      actions.play(this.replay?.playing ?? false, Number(this.speed.value));
      release(this.speed);
    };
    find<HTMLFormElement>("comment-form").onsubmit = (e) => this.submit(e);
    find<HTMLInputElement>("comment-author").value = recall("author");
    find("replay-key").append(...(Object.keys(PRESS_WORDS) as PressResult[]).map((r) => make("span", r, PRESS_WORDS[r])), make("span", "comment", t("replay.comment")));
  }

  /** While an exam runs, and at its result, a teacher or watcher comments on what is seen now. */
  live(exam: Exam | null): void {
    this.exam = exam;
    if (!exam) return;
    const key = JSON.stringify(["live", exam.exam, exam.comments]);
    if (key === this.marksKey) return;
    this.marksKey = key;
    this.comments(exam.comments ?? [], false);
  }

  show(replay: Replay, controls: boolean): void {
    this.replay = replay;
    this.wishes.tell({ time_s: replay.time_s });
    this.exam = null;
    find("replay-title").textContent = replay.title;
    this.scrub.max = String(replay.duration_s);
    if (!this.held) this.scrub.value = String(replay.time_s);
    this.time(this.held ? this.scrub.valueAsNumber : replay.time_s);
    find("replay-play").textContent = replay.playing ? t("film.pause") : t("page.replay_play");
    if (document.activeElement !== this.speed) this.speed.value = String(replay.speed);
    for (const id of ["replay-play", "replay-leave", "scrub", "replay-speed"])
      find<HTMLButtonElement>(id).disabled = !controls;
    this.marks(replay, controls);
  }

  private time(time_s: number): void {
    const text = `${minutes(time_s)} / ${minutes(this.replay?.duration_s ?? 0)}`;
    find("replay-time").textContent = text;
    this.scrub.setAttribute("aria-valuetext", text);
  }

  private slide(): void {
    this.held = true;
    this.time(this.scrub.valueAsNumber);
    if (performance.now() - this.sent_ms < SEEK_MS) return;
    this.sent_ms = performance.now();
    this.actions.seek(this.scrub.valueAsNumber);
  }

  private toggle(): void {
    if (this.replay) this.actions.play(!this.replay.playing, Number(this.speed.value) || 1);
  }

  key(code: string, shift: boolean): boolean {
    const r = this.replay;
    if (!r) return false;
    const by = shift ? 5 : 1;
    const now_s = this.wishes.get("time_s") ?? r.time_s;
    const go = (time_s: number): void => this.actions.seek(this.wishes.ask({ time_s: Math.max(0, Math.min(r.duration_s, time_s)) }).time_s);
    if (code === "Space") this.toggle();
    else if (code === "ArrowLeft") go(now_s - by);
    else if (code === "ArrowRight") go(now_s + by);
    else return false;
    return true;
  }

  leave(): void {
    this.replay = null;
    this.wishes.forget();
    this.marksKey = "";
  }

  // ---- marks and comments ----------------------------------------------------------------------

  private marks(replay: Replay, controls: boolean): void {
    const key = JSON.stringify([replay.exam, replay.duration_s, replay.presses, replay.comments, controls]);
    if (key === this.marksKey) return;
    this.marksKey = key;
    const svg = draw("svg", { viewBox: "0 0 1000 20", preserveAspectRatio: "none" });
    const x = (t_s: number): number => (1000 * t_s) / Math.max(0.1, replay.duration_s);
    const mark = (p: Press): SVGElement => draw("rect", { x: x(p.t_s) - 3, y: 3, width: 6, height: 14, rx: 1, class: p.result });
    const note = (t_s: number): SVGElement => draw("path", { d: `M${x(t_s) - 5} 0h10l-5 8z`, class: "comment" });
    svg.append(...replay.presses.map(mark), ...replay.comments.map((c) => note(c.t_s)));
    find("scrub-marks").replaceChildren(svg);
    this.comments(replay.comments, controls);
  }

  private comments(list: readonly Comment[], controls: boolean): void {
    const rows = list.map((c) => {
      const row = make("li");
      const go = button(minutes(c.t_s), () => this.actions.seek(c.t_s), "time");
      go.setAttribute("aria-label", t("replay.go", { time: minutes(c.t_s) }));
      go.disabled = !controls;
      const words = make("span", "", c.text);
      if (c.author) words.append(make("i", "", c.author));
      row.append(go, words);
      return row;
    });
    const none = make("li", "none", t("replay.none"));
    find("comment-list").replaceChildren(...(rows.length ? rows : [none]));
  }

  write(): void {
    const r = this.replay;
    if (r?.playing && !find<HTMLButtonElement>("replay-play").disabled) this.actions.play(false, r.speed);
    find("comment-text").focus();
  }

  private submit(e: Event): void {
    e.preventDefault();
    const text = find<HTMLInputElement>("comment-text");
    const author = find<HTMLInputElement>("comment-author").value.trim();
    const time_s = this.replay?.time_s ?? this.exam?.elapsed_s;
    if (!text.value.trim() || time_s === undefined) return text.focus();
    this.actions.comment(time_s, text.value.trim(), author);
    remember("author", author);
    announce(t("replay.added", { time: minutes(time_s) }));
    text.value = "";
  }
}
