// What a learning management system shows of a class (SCORM 1.2): a button that opens the class in a window of its own,
// with a ticket that this page made; what the class tells of the ticket's learner goes into the system. The best
// exam's score and result stand for the attempt, every exam is an interaction.

import { freshId } from "./access";
import { make, minutes } from "./dom";
import { Attempt, timespan } from "./scorm_api";
import { language, shown, t } from "./words/language";

interface Exam {
  id: string;
  title: string;
  score: number;
  passed: boolean;
  correct: boolean;
  seconds: number;
}

/** Kept by the system between two attempts, cmi.suspend_data. */
interface Kept {
  address: string;
  ticket: string;
  since: string; // when the class linked the ticket
  told: number; // how many of the exams since then the system has
}

const ASK_MS = 3000;
const LONGEST_TEXT = 255; // of SCORM's CMIString255

const attempt = Attempt.begin();
const began = Date.now();

/** The class's address with "/" at its end; null for what is no address of TLS. */
function classAt(text: string): URL | null {
  try {
    const at = new URL("./", text.trim());
    return at.protocol === "https:" ? at : null;
  } catch {
    return null;
  }
}

function kept(): Kept {
  const fresh = { address: attempt?.get("cmi.launch_data") ?? "", ticket: freshId(), since: "", told: 0 };
  try {
    const old = JSON.parse(attempt?.get("cmi.suspend_data") ?? "") as Kept;
    return classAt(old.address) && /^[0-9a-f]{32}$/.test(old.ticket) && old.told >= 0 ? old : fresh;
  } catch {
    return fresh;
  }
}

function open(to: Attempt): void {
  const own = kept();
  const score = parseFloat(to.get("cmi.core.score.raw"));
  let best: { score: number; passed: boolean } | null = Number.isFinite(score) ? { score, passed: to.get("cmi.core.lesson_status") === "passed" } : null;
  let watched: URL | null = null;

  const form = make("form", "join");
  const box = make("label", "", t("scorm.address"));
  const address = make("input");
  Object.assign(address, { id: "address", type: "url", required: true, value: own.address, spellcheck: false });
  box.append(address);
  const go = make("button", "primary", t("scorm.open"));
  const said = make("p");
  said.id = "said";
  said.setAttribute("role", "status");
  const list = make("ol", "exams");
  form.append(make("h1", "", t("scorm.title")), make("p", "muted", t("scorm.how")), box, go, said, list);
  document.getElementById("lms")!.replaceChildren(form);
  const say = (sentence: string): void => {
    if (said.textContent !== sentence) said.textContent = sentence; // a screen reader says what is new
  };

  const keep = (): void => {
    to.set("cmi.suspend_data", JSON.stringify(own));
    to.set("cmi.core.session_time", timespan((Date.now() - began) / 1000));
    to.commit();
  };

  /** Puts an exam that the system has not heard of into the attempt. */
  function tell(exam: Exam): void {
    const n = Number(to.get("cmi.interactions._count")) || 0;
    const element = (name: string): string => ["cmi.interactions", n, name].join(".");
    to.set(element("id"), `exam_${exam.id.replace(/[^0-9A-Za-z_]/g, "_")}`);
    to.set(element("type"), "performance");
    to.set(element("student_response"), exam.title.slice(0, LONGEST_TEXT));
    to.set(element("result"), exam.correct ? "correct" : "wrong");
    to.set(element("latency"), timespan(exam.seconds));
    list.append(make("li", exam.passed ? "good" : "bad", t(exam.passed ? "scorm.passed" : "scorm.failed", { title: exam.title, score: shown(exam.score, 0), time: minutes(exam.seconds) })));
    const better = best === null || (exam.passed === best.passed ? exam.score > best.score : exam.passed);
    if (!better) return;
    best = exam;
    to.set("cmi.core.score.min", 0);
    to.set("cmi.core.score.max", 100);
    to.set("cmi.core.score.raw", exam.score.toFixed(1));
    to.set("cmi.core.lesson_status", exam.passed ? "passed" : "failed");
  }

  async function ask(): Promise<void> {
    const at = watched;
    if (!at) return;
    try {
      const answer = await fetch(new URL(`lms.json?ticket=${own.ticket}`, at), { cache: "no-store", referrerPolicy: "no-referrer" });
      if (answer.status === 404) return say(t("scorm.join_there"));
      if (!answer.ok) return say(t("scorm.silent"));
      const { since, exams } = (await answer.json()) as { since: string; exams: Exam[] };
      if (since !== own.since) Object.assign(own, { since, told: 0 }); // a class that was started anew
      for (const exam of exams.slice(own.told)) tell(exam);
      if (exams.length > own.told) {
        own.told = exams.length;
        keep();
      }
      say(t("scorm.follows"));
    } catch {
      say(t("scorm.silent"));
    }
  }

  form.onsubmit = (event) => {
    event.preventDefault();
    const at = classAt(address.value);
    if (!at) return say(t("scorm.no_address"));
    own.address = at.href;
    keep();
    watched = at;
    const [last = "", first = ""] = to.get("cmi.core.student_name").split(",").map((part) => part.trim());
    const query = new URLSearchParams({ lms: own.ticket, name: `${first} ${last}`.trim(), lang: language });
    window.open(new URL(`?${query}`, at), "_blank", "noopener");
    say(t("scorm.join_there"));
  };
  if (!/^(passed|failed)$/.test(to.get("cmi.core.lesson_status"))) to.set("cmi.core.lesson_status", "incomplete");
  to.set("cmi.core.exit", "suspend");
  keep();
  window.setInterval(() => void ask(), ASK_MS);
  window.addEventListener("pagehide", () => {
    keep();
    to.end();
  });
  address.focus();
}

document.documentElement.lang = language;
if (attempt) open(attempt);
else document.getElementById("lms")!.append(make("p", "warn join", t("scorm.no_lms")));
