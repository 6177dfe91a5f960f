// What can be taken out of a kept exam: its recording as a tracked sequence, written on demand by the program's
// own exporter, and the files of its worksheet.

import { announce, button, find, make } from "./dom";
import type { ExamEntry } from "./protocol";
import { t } from "./words/language";

export interface ExportFile {
  name: string;
  link: string;
}

export interface ExportMessage {
  type: "export";
  exam: string;
  /** of the recording: one for each time that the patient lay otherwise */
  parts: number;
  /** the sequence under way or there: "2.igs.mha"; or empty */
  what: string;
  running: boolean;
  /** 0 to 1 */
  progress: number;
  message: string;
  files: ExportFile[];
}

export interface ExportActions {
  /** what: ending of a sequence, "" to look, "cancel" */
  ask(exam: string, what: string, part: number): void;
}

const KINDS = [
  { what: "igs.mha", name: "MetaImage", note: "PLUS, 3D Slicer (.igs.mha)" },
  { what: "seq.nrrd", name: "NRRD", note: "3D Slicer (.seq.nrrd)" },
  { what: "dcm", name: "DICOM", note: t("export.dicom") },
];

export class ExportDialog {
  private readonly box = find<HTMLDialogElement>("export");
  private exam: ExamEntry | null = null;
  private message: ExportMessage | null = null;
  private part = 1;

  constructor(private readonly actions: ExportActions) {}

  open(exam: ExamEntry): void {
    this.exam = exam;
    this.message = null;
    this.part = 1;
    this.build();
    if (!this.box.open) this.box.showModal();
    this.actions.ask(exam.id, "", 1);
  }

  close(): void {
    this.box.close();
  }

  fill(message: ExportMessage): void {
    if (message.exam !== this.exam?.id) return;
    const before = this.message;
    this.message = message;
    const bar = this.box.querySelector("progress");
    const same = before && before.running === message.running && before.files.length === message.files.length && before.what === message.what;
    if (same && bar) bar.value = message.progress; // the focus stays where it is
    else this.build();
    if (before?.running && !message.running) announce(message.message || t("export.there"));
  }

  private build(): void {
    const exam = this.exam!;
    const message = this.message;
    const title = make("h2", "", t("export.files_of", { title: exam.title }));
    title.id = "export-title";
    const intro = make("p", "intro", t("export.intro"));
    const kinds = make("div", "kinds");
    const running = message?.running ?? false;
    for (const kind of exam.recording ? KINDS : []) {
      const make_it = button(kind.name, () => this.actions.ask(exam.id, kind.what, this.part));
      make_it.disabled = running || !message;
      make_it.dataset.what = kind.what;
      const row = make("p");
      row.append(make_it, " ", kind.note);
      kinds.append(row);
    }
    const row = make("div", "actions");
    const close = button(t("page.close"), () => this.box.close(), "primary");
    row.append(make("span", "spring"), close);
    this.box.replaceChildren(title, intro, this.parts(), kinds, this.state(), this.files(), row);
    if (this.box.open && !this.box.contains(document.activeElement)) close.focus();
  }

  /** The part of the recording, when the patient was turned. */
  private parts(): HTMLElement {
    const count = this.message?.parts ?? 1;
    if (count < 2) return make("span");
    const row = make("label", "", `${t("export.part")} `);
    const select = make("select");
    for (let k = 1; k <= count; ++k) select.append(new Option(t("result.n_of", { n: k, of: count }), String(k), false, k === this.part));
    select.onchange = () => (this.part = Number(select.value));
    row.append(select);
    return row;
  }

  private state(): HTMLElement {
    const message = this.message;
    const box = make("p", "export-state");
    if (message?.running) {
      const bar = make("progress");
      bar.setAttribute("aria-label", t("export.progress"));
      bar.value = message.progress;
      box.append(bar, " ", button(t("export.cancel"), () => this.actions.ask(this.exam!.id, "cancel", 1)));
    } else box.textContent = message?.message ?? "";
    return box;
  }

  private files(): HTMLElement {
    const list = make("ul", "files");
    for (const file of this.message?.files ?? []) {
      const link = make("a", "", file.name);
      Object.assign(link, { href: `.${file.link}`, download: `${this.exam!.id}-${file.name.replace(/^export-/, "")}` });
      const item = make("li");
      item.append(link);
      list.append(item);
    }
    return list;
  }
}
