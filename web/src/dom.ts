// Small helpers for the document: finding, making, announcing, and giving the focus back.

import { named, t } from "./words/language";

export function find<T extends HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`#${id} is missing`);
  return element as T;
}

export function make<K extends keyof HTMLElementTagNameMap>(tag: K, className = "", text = ""): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.textContent = text;
  return element;
}

/** Writes a text where another one stands: one that is written again would be laid out again. */
export function write(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

const SVG = "http://www.w3.org/2000/svg";

export function draw(tag: string, attributes: Record<string, string | number> = {}, text = ""): SVGElement {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  if (text) element.textContent = text;
  return element;
}

export function button(text: string, action: () => void, className = ""): HTMLButtonElement {
  const element = make("button", className, text);
  element.type = "button";
  element.onclick = () => {
    action();
    release(element);
  };
  return element;
}

/** A name with a value between less and more; its buttons' ids are `id`-less and `id`-more. */
export function stepper(id: string, name: string, output: HTMLElement, change: (way: number) => void, title: string): HTMLElement {
  const row = make("span", "stepper");
  const step = (text: string, way: number): HTMLElement => {
    const one = button(text, () => change(way));
    Object.assign(one, { title, id: `${id}-${way < 0 ? "less" : "more"}` });
    one.setAttribute("aria-label", way < 0 ? t("step.less", { name }) : t("step.more", { name }));
    return one;
  };
  row.append(make("span", "caption", name), step("−", -1), output, step("+", 1));
  return row;
}

let byPointer = false;
window.addEventListener("pointerdown", () => (byPointer = true), true);
window.addEventListener("keydown", () => (byPointer = false), true);

/** After a click the keys move the probe again; who came by keyboard stays where he is. */
export function release(element: HTMLElement): void {
  if (byPointer) element.blur();
}

/** Wires a button of the document. */
export function press(id: string, action: () => void): void {
  const element = find(id);
  element.onclick = () => {
    action();
    release(element);
  };
}

export function pressed(id: string, on: boolean): void {
  find(id).setAttribute("aria-pressed", String(on));
}

/** Said by screen readers; the same sentence is not said twice in a row. */
export function announce(sentence: string): void {
  const live = find("live");
  if (live.textContent !== sentence) live.textContent = sentence;
}

/** "partial_mural" -> "Partial mural" */
export const label = named;

/** The value of a rising list so many places beside the one that is nearest to `now`. */
export function beside(list: number[], now: number, way: number): number {
  const nearest = list.reduce((best, v, k) => (Math.abs(v - now) < Math.abs(list[best]! - now) ? k : best), 0);
  return list[Math.max(0, Math.min(list.length - 1, nearest + way))]!;
}

/** 65.2 -> "1:05" */
export function minutes(time_s: number): string {
  const s = Math.max(0, Math.floor(time_s));
  return `${Math.floor(s / 60)}:${String(s % 60).padStart(2, "0")}`;
}

/** What this browser remembers of its user; a browser that forbids it remembers nothing. */
export function recall(key: string): string {
  try {
    return localStorage.getItem(`sonde.${key}`) ?? "";
  } catch {
    return "";
  }
}

export function remember(key: string, value: string): void {
  try {
    localStorage.setItem(`sonde.${key}`, value);
  } catch {
    // private mode: the page works without
  }
}

/** A drawing whose canvas means nothing to a screen reader, under one name. */
export function nameDrawing(box: HTMLElement, name: string): void {
  box.setAttribute("role", "img");
  box.setAttribute("aria-label", name);
  for (const canvas of box.querySelectorAll("canvas")) canvas.setAttribute("aria-hidden", "true");
}
