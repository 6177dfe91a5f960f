// The demonstration's bar: the words of the step, play and pause, on to the next step, how fast, and
// how many places are done.

import { announce, find, press, release } from "./dom";
import type { Exam, Film } from "./protocol";
import { counted, t } from "./words/language";

export interface FilmActions {
  play(playing: boolean, speed: number): void;
  next(): void;
  /** back to the lesson */
  leave(lesson: string): void;
}

export class FilmBar {
  private film: Film | null = null;
  private lesson = "";
  private readonly speed = find<HTMLSelectElement>("film-speed");

  constructor(private readonly actions: FilmActions) {
    press("film-play", () => this.toggle());
    press("film-next", () => this.next());
    press("film-leave", () => actions.leave(this.lesson));
    this.speed.onchange = () => {
      actions.play(this.film?.playing ?? false, Number(this.speed.value));
      release(this.speed);
    };
  }

  show(exam: Exam, controls: boolean): void {
    const f = (this.film = exam.film ?? null);
    if (!f) return;
    this.lesson = exam.lesson?.id ?? "";
    const begun = f.playing || f.place > 0 || f.over;
    find("film-title").textContent = f.title;
    const words = find("film-words");
    if (words.textContent !== f.words) {
      words.textContent = f.words;
      words.scrollTop = 0;
      announce(f.words);
    }
    const play = find("film-play");
    play.textContent = f.playing ? t("film.pause") : begun ? t("page.replay_play") : t("page.film_play");
    play.hidden = f.over;
    play.classList.toggle("primary", !f.playing);
    find("film-next").hidden = f.over || !f.playing;
    find<HTMLButtonElement>("film-next").disabled = !f.reading || !controls;
    find("film-leave").textContent = f.over ? t("film.on") : t("page.leave");
    find("film-leave").classList.toggle("primary", f.over);
    find("film-place").textContent = f.over ? counted("film.all", f.places) : begun ? t("film.place", { n: f.place + 1, places: f.places }) : counted("film.places", f.places);
    if (document.activeElement !== this.speed) this.speed.value = String(f.speed);
    for (const id of ["film-play", "film-leave", "film-speed"]) find<HTMLButtonElement>(id).disabled = !controls;
  }

  private toggle(): void {
    if (this.film && !this.film.over) this.actions.play(!this.film.playing, Number(this.speed.value) || 1);
  }

  private next(): void {
    if (this.film?.reading) this.actions.next();
  }

  key(code: string): boolean {
    if (!this.film) return false;
    if (code === "Space") this.toggle();
    else if (code === "ArrowRight" || code === "Enter") this.next();
    else return false;
    return true;
  }

  leave(): void {
    this.film = null;
  }
}
