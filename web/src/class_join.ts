// Joining a class: name and code, then the own page on the learner's place.

import { announce, make, recall, remember } from "./dom";
import { t } from "./words/language";

const MOST_NAME = 40;

interface Place {
  place: number;
  token: string;
}

const addressOf = (at: Place): string => `${at.place}/#${at.token}`;

/** A place that this browser was given before, as long as its program knows it. */
function known(): Place | null {
  try {
    const at = JSON.parse(recall("place")) as Place;
    return Number.isInteger(at.place) && /^[0-9a-f]{32}$/.test(at.token) ? at : null;
  } catch {
    return null;
  }
}

const status = async (at: Place): Promise<number> => {
  try {
    return (await fetch(`${at.place}/status.json`, { headers: { Authorization: `Bearer ${at.token}` }, cache: "no-store" })).status;
  } catch {
    return 0;
  }
};

/** The ticket of the learning management system that opened this page; empty: none did. */
const ticket = /[?&]lms=([0-9a-f]{32})(&|$)/.exec(location.search)?.[1] ?? "";

/** Goes to a place as soon as its program answers; the learning management system follows a learner there. */
async function enter(at: Place, say: (sentence: string) => void, learns = true): Promise<void> {
  if (ticket && learns) await fetch(`lms?ticket=${ticket}`, { headers: { Authorization: `Bearer ${at.token}` }, cache: "no-store" });
  say(t("class.starting"));
  while ((await status(at)) !== 200) await new Promise((done) => setTimeout(done, 500));
  location.assign(addressOf(at));
}

function choice(value: string, text: string, on: boolean): HTMLElement {
  const box = make("label");
  const input = make("input");
  Object.assign(input, { type: "radio", name: "role", value, checked: on });
  box.append(input, text);
  return box;
}

export function openJoin(room: HTMLElement): void {
  const form = make("form", "join");
  const field = (id: string, text: string, more: object): HTMLInputElement => {
    const box = make("label", "", text);
    const input = make("input");
    Object.assign(input, { id, required: true, autocomplete: "off", ...more });
    box.append(input);
    form.append(box);
    return input;
  };
  form.append(make("h1", "", t("class.join_title")));
  const roles = make("fieldset");
  roles.append(choice("learner", t("class.examine"), true), choice("watcher", t("class.watch"), false));
  form.append(roles);
  const name = field("name", t("class.your_name"), { maxLength: MOST_NAME, value: new URLSearchParams(location.search).get("name")?.slice(0, MOST_NAME) || recall("trainee") });
  const code = field("code", t("class.code"), { maxLength: 12, spellcheck: false });
  const go = make("button", "primary", t("class.join"));
  const said = make("p", "warn");
  said.id = "said";
  said.setAttribute("role", "status");
  form.append(go, said);
  const back = known();
  if (back) {
    const again = make("button", "", t("class.back"));
    again.type = "button";
    again.hidden = true;
    again.onclick = () => void enter(back, say);
    form.append(again);
    void status(back).then((found) => (again.hidden = found !== 200));
  }
  room.replaceChildren(form);
  const watches = (): boolean => form.querySelector<HTMLInputElement>("input[value=watcher]")!.checked;
  roles.onchange = () => (name.previousSibling!.textContent = watches() ? t("class.whom") : t("class.your_name"));
  const say = (sentence: string): void => {
    said.textContent = sentence;
    announce(sentence);
  };
  form.onsubmit = (event) => {
    event.preventDefault();
    void join();
  };
  async function join(): Promise<void> {
    go.disabled = true;
    say(t("class.asking"));
    const role = watches() ? "watcher" : "learner";
    try {
      const answer = await fetch(`join?name=${encodeURIComponent(name.value.trim())}&role=${role}`, { headers: { Authorization: `Bearer ${code.value.trim()}` }, cache: "no-store" });
      if (!answer.ok) return say(await answer.text());
      const at = (await answer.json()) as Place;
      if (role === "learner") {
        remember("place", JSON.stringify(at));
        remember("trainee", name.value.trim());
      }
      await enter(at, say, role === "learner");
    } catch {
      say(t("class.silent_retry"));
    } finally {
      go.disabled = false;
    }
  }
  (name.value ? code : name).focus();
}
