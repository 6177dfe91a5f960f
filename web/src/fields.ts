// Labelled fields of a form: a text, a choice, a number that may be absent.

import { make } from "./dom";
import { named, t } from "./words/language";

function field(id: string, words: string, control: HTMLElement): HTMLElement {
  const box = make("label", "field");
  control.id = id;
  box.append(make("span", "caption", words), control);
  return box;
}

/** `rows` > 1: a text of several lines. */
export function textField(id: string, words: string, value: string, most: number, change: (value: string) => void, rows = 1): HTMLElement {
  const input = make(rows > 1 ? "textarea" : "input");
  Object.assign(input, { value, maxLength: most, autocomplete: "off" });
  if (input instanceof HTMLTextAreaElement) input.rows = rows;
  input.oninput = () => change(input.value);
  return field(id, words, input);
}

export function choiceField(id: string, words: string, choices: string[], value: string, change: (value: string) => void, name = named): HTMLElement {
  const select = make("select");
  for (const choice of choices) select.append(Object.assign(make("option", "", name(choice)), { value: choice }));
  select.value = value;
  select.onchange = () => change(select.value);
  return field(id, words, select);
}

/** Null: the field is empty. Numbers out of range are marked; what is wrong with them, the program says. */
export function numberField(id: string, words: string, value: number | null, low: number, high: number, empty: string, change: (value: number | null) => void): HTMLElement {
  const input = make("input");
  Object.assign(input, { type: "number", min: String(low), max: String(high), step: "any", value: value === null ? "" : String(value), placeholder: empty });
  input.oninput = () => !input.validity.badInput && change(input.value === "" ? null : input.valueAsNumber);
  return field(id, high === 100 || high > 1e6 ? words : t("editor.range", { name: words, low, high }), input); // of percents and seeds it says nothing
}

/** Selects a line of a text and brings it into view. */
export function selectLine(area: HTMLTextAreaElement, line: number): void {
  const lines = area.value.split("\n");
  const start = lines.slice(0, line - 1).reduce((sum, one) => sum + one.length + 1, 0);
  area.focus();
  area.setSelectionRange(start, start + (lines[line - 1]?.length ?? 0));
  area.scrollTop = (area.scrollHeight / Math.max(1, lines.length)) * Math.max(0, line - 4);
}
