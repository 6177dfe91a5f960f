// The page: connects the server's messages with the views, and the operator's hand with the server.

import { Coach } from "./coach";
import { gradient } from "./colour";
import { Connection } from "./connection";
import { Dial } from "./dial";
import { announce, find, label, minutes, press, pressed, recall, release, remember, write } from "./dom";
import { Duplex } from "./duplex";
import { EchoView } from "./echo";
import { FilmBar } from "./film";
import { Editor } from "./editor";
import { ExamBar } from "./exam";
import { ForceBar } from "./force_bar";
import { GateTools } from "./gate";
import { ExportDialog } from "./exports";
import { HistoryDialog } from "./history";
import { Input } from "./input";
import { limbWords } from "./limb";
import { fillHelp, Readouts, Sliders } from "./panel";
import { ForcePlot } from "./plot";
import { Hold, nearestSite } from "./pose";
import { PatientTools } from "./practice";
import { FLAG_INSIDE_OUT, FLAG_SOLID, VERSIONS, type Controls, type Exam, type Frame, type Hello, type Phase, type Replay, type Snapshot, type TextMessage } from "./protocol";
import { Rates } from "./rates";
import { ReplayBar } from "./replay";
import { ResultDialog } from "./result";
import { Route } from "./route";
import { LegScene } from "./scene";
import { DopplerSound } from "./sound";
import { SpectrumView } from "./spectrum";
import { StartDialog } from "./start";
import { EchoTools } from "./tools";
import { startTheme } from "./theme";
import { Traces } from "./traces";
import { letGo, ROLE_ACTIONS, roleWords } from "./words";
import { Worksheet, type SheetMessage } from "./worksheet";
import { amid, capital, decimal, dress, shown, t, translated, untold } from "./words/language";

const HOME_SITE = 27;
/** Stations of a limb where an exam begins: the groin, or what a position is for, behind the knee and the calf. */
const GROIN_SITE = 1;
const START_SITE: Record<string, number> = { prone: 8, prone_bent: 8, sitting: 10 };
const NEAR_MM = 20; // farther from a site its curve says nothing about this place
const COMFORT = 0.5; // of the limit, when the program does not say what is comfortable
const LIFTED_MM = -8;
const LIFTED_NOTE_MM = -1; // farther from the skin the image says why it is dark
const EASED_MM = 0.5; // the probe rests on the skin
const REST_MS = 250; // between two looks at what changes without a message or a hand, such as the rates

const query = new URLSearchParams(location.search);

class App {
  hello: Hello | null = null;
  controls: Controls | null = null;
  exam: Exam | null = null;
  replay: Replay | null = null;
  snapshot: Snapshot | null = null;
  connected = false;
  frames = 0;
  private imaged = false; // an image has been painted
  /** pixels of the last frame */
  pixels: Uint8Array = new Uint8Array(0);
  readonly hold = new Hold();
  private readonly route = new Route();
  readonly scene = new LegScene(find<HTMLCanvasElement>("scene"), query.get("quality") === "low");
  readonly echo = new EchoView(find("echo-box"), find<HTMLCanvasElement>("echo-marks"), find("echo-text"), find("measures"));
  readonly connection: Connection;
  private readonly plot = new ForcePlot(find("plot"));
  private readonly traces = new Traces();
  private readonly readouts = new Readouts(find("readouts"));
  private readonly forceBar = new ForceBar();
  private readonly dial = new Dial(find("dial"));
  private readonly sliders = new Sliders(find("sliders"), (key, value) => this.connection.set(key, value));
  private readonly tools = new EchoTools(this.echo);
  private readonly patient: PatientTools;
  private readonly duplex: Duplex;
  readonly sound = new DopplerSound();
  readonly spectrum = new SpectrumView(this.sound);
  private readonly gateTools: GateTools;
  private readonly examBar: ExamBar;
  readonly worksheet: Worksheet;
  private readonly replayBar: ReplayBar;
  private readonly filmBar: FilmBar;
  private readonly start: StartDialog;
  private readonly result: ResultDialog;
  private readonly exports: ExportDialog;
  private readonly history: HistoryDialog;
  readonly editor: Editor;
  private readonly coach = new Coach();
  private readonly rates = new Rates();
  private readonly input: Input;
  private pending: Frame | null = null;
  private goalDue = false;
  private curveKey: string | null = null; // null: the curve is to be drawn anew
  private placed = false; // the hold of this leg is chosen
  private fresh = false; // a hello came, its controls not yet
  private offered = query.has("site"); // who names a site knows what he wants
  private lost = false; // since the last hello
  private through = true; // what the operator chose, also while an exam forbids it
  private phase: Phase = "practice";

  constructor() {
    const connection = (this.connection = new Connection({
      text: (message) => (this.text(message), this.wake()),
      geometry: (part) => this.scene.setPart(part),
      frame: (frame) => ((this.pending = frame), this.wake()),
      state: (connected, wait_s) => this.setConnected(connected, wait_s),
      refused: () => this.refused(),
    }));
    this.patient = new PatientTools(connection);
    this.duplex = new Duplex(connection, this.echo.doppler);
    this.duplex.squeezed = () => this.spectrum.squeezed();
    this.gateTools = new GateTools(connection, this.echo.gate, this.sound);
    this.spectrum.keep = (reflux_s) => this.worksheet.keepReflux(reflux_s);
    this.examBar = new ExamBar({
      decide: (segment, decision) => connection.decide(segment, decision),
      write: (segment, decision) => this.worksheet.write(segment, decision),
      chosen: (segment) => this.worksheet.chosen(segment),
      gaps: () => (this.exam?.lesson ? "" : this.worksheet.gaps()),
      hint: () => connection.hint(),
      finish: () => connection.finishExam(),
      leave: () => connection.leaveExam(),
    });
    this.worksheet = new Worksheet({
      enter: (entry) => connection.worksheet(entry),
      decide: (segment, decision) => connection.decide(segment, decision),
      choose: (segment) => this.examBar.select(segment),
      marks: () => this.echo.calipers,
      learner: () => this.hello?.trainee ?? "",
      protocol: (id) => this.hello?.protocols?.find((p) => p.id === id)?.title ?? id,
    });
    this.replayBar = new ReplayBar({
      seek: (time_s) => connection.seek(time_s),
      play: (playing, speed) => connection.play(playing, speed),
      comment: (time_s, text, author) => connection.comment(time_s, text, author),
      leave: () => connection.leaveExam(),
    });
    this.start = new StartDialog((wish) => connection.startExam(wish), () => find("scene").focus(), {
      watch: (lesson) => connection.demonstrate(lesson),
      practise: (lesson, turn) => connection.startLesson(lesson, turn, this.start.trainee),
    });
    this.filmBar = new FilmBar({
      play: (playing, speed) => connection.play(playing, speed),
      next: () => connection.next(),
      leave: (lesson) => (connection.leaveExam(), this.start.teach(lesson)),
    });
    this.result = new ResultDialog({
      lesson: (id) => (this.result.hide(), connection.leaveExam(), this.start.teach(id)),
      repeat: (id, turn) => (this.result.hide(), connection.startLesson(id, turn, this.start.trainee)),
      replay: (exam) => (this.result.hide(), connection.openReplay(exam)),
      again: (id) => (this.result.hide(), this.start.again(id)),
      next: (id) => (this.result.hide(), connection.leaveExam(), this.start.open(this.start.next(id))),
      close: () => connection.leaveExam(),
      comment: () => this.replayBar.write(),
      worksheet: () => this.worksheet.summary(),
    });
    this.exports = new ExportDialog({ ask: (exam, what, part) => connection.exportExam(exam, what, part) });
    this.history = new HistoryDialog((exam) => connection.openReplay(exam), (exam) => this.exports.open(exam));
    this.editor = new Editor(this.scene, {
      send: (message) => connection.edit(message),
      control: () => this.controls?.may === "take" && connection.role("take"),
      changed: () => this.showMode(),
    });
    this.input = this.wireInput();
    this.wireButtons();
    startTheme();
    this.scene.changed = () => this.wake();
    for (const event of ["pointerdown", "pointermove", "pointerup", "wheel", "keydown", "keyup", "input", "click", "change"]) window.addEventListener(event, () => this.wake(), { capture: true, passive: true });
    window.setInterval(() => this.wake(), REST_MS);
    this.wake();
  }

  private awake = false;
  /** Asks for a picture. While nothing comes, moves or is touched none is drawn, so that the processor is left to the simulation beside it. */
  private wake(): void {
    if (this.awake) return;
    this.awake = true;
    requestAnimationFrame((now) => {
      this.awake = false; // first: whatever goes wrong in one picture, the next one comes
      this.animate(now / 1000);
    });
  }

  private wireInput(): Input {
    return new Input(find<HTMLCanvasElement>("scene"), this.scene, this.hold, {
      moved: () => this.moved(),
      probe: (i) => this.hello?.probes[i] && this.connection.probe(this.hello.probes[i].name),
      nextCase: () => this.nextCase(),
      freeze: () => this.tools.freeze(),
      seeThrough: () => this.toggleThrough(),
      reset: () => this.reset(),
      stop: () => void (this.editor.escape() || this.connection.stop()),
      help: () => find<HTMLDialogElement>("help").showModal(),
      sites: () => (this.phase === "practice" ? (this.hello?.sites ?? []) : []),
      key: (code, shift) => this.key(code, shift),
    });
  }

  private wireButtons(): void {
    fillHelp(find("help").querySelector<HTMLElement>(".keys")!);
    find("legend-bar").style.background = gradient();
    this.scene.flatChanged = (flat) => (find("flat-note").hidden = !flat);
    this.scene.rangeChanged = (mm) => (find("legend-top").textContent = `${mm} mm`);
    press("stop", () => this.connection.stop());
    press("resume", () => this.connection.resume());
    press("help-button", () => find<HTMLDialogElement>("help").showModal());
    press("start-button", () => (remember("start", "exams"), this.start.open()));
    press("course-button", () => this.start.teach(""));
    press("exams-button", () => this.openHistory());
    press("role-button", () => this.controls?.may && this.connection.role(this.controls.may));
    press("status", () => this.rates.toggle());
    press("see-through", () => this.toggleThrough());
    press("home", () => this.reset());
    press("turn-left", () => this.input.turnBy(-1));
    press("turn-right", () => this.input.turnBy(1));
    press("depth-less", () => this.setDepth(this.hold.depth_mm - 1));
    press("depth-more", () => this.setDepth(this.hold.depth_mm + 1));
    press("ease", () => this.setDepth(EASED_MM));
    press("tab-time", () => this.chart(true));
    press("tab-depth", () => this.chart(false));
    const slider = find<HTMLInputElement>("depth-slider");
    slider.oninput = () => this.setDepth(slider.valueAsNumber);
    slider.onchange = () => release(slider);
  }

  /** Keys that the views own; true when one of them took it. */
  private key(code: string, shift: boolean): boolean {
    if (code === "KeyI") this.rates.toggle();
    else if (code === "Digit0" && this.hands) this.setDepth(EASED_MM);
    else if (this.phase === "film" && this.controls?.controls && this.filmBar.key(code)) return true;
    else if (this.phase === "replay" && this.controls?.controls && this.replayBar.key(code, shift)) return true;
    else if (this.worksheet.key(code, shift)) return true;
    else return this.gateTools.key(code, shift) || this.duplex.key(code, shift) || this.tools.key(code) || this.examBar.key(code, shift) || this.patient.key(code, shift);
    return true;
  }

  // ---- messages --------------------------------------------------------------------------------

  private text(heard: TextMessage): void {
    const message = translated(heard);
    if (message.type === "hello") this.greet(message);
    else if (message.type === "controls") this.setControls(message);
    else if (message.type === "exam") this.setExam(message);
    else if (message.type === "exams") this.history.fill(message.list);
    else if (message.type === "export") this.exports.fill(message);
    else if (message.type === "replay") this.setReplay(message);
    else if (message.type === "worksheet") this.setSheet(message);
    else if (message.type === "draft") this.editor.hear(message);
    else if (message.type === "error") this.say(message.message);
  }

  private greet(hello: Hello): void {
    if (!VERSIONS.includes(hello.version)) return this.say(t("main.reload"));
    const same = this.hello?.model === hello.model && this.hello.nodes === hello.nodes;
    this.placed = this.lost && same && this.placed; // the hand stays where it was
    this.lost = false;
    this.fresh = true;
    this.hello = hello;
    find("about").textContent = t("main.about", { version: hello.program });
    this.patient.greet(hello);
    this.scene.setLimb(hello.limb ?? null);
    find("leg-name").textContent = hello.limb ? limbWords(hello.limb) : "";
    this.start.greet(hello);
    this.editor.greet(hello);
    this.forceBar.limits(hello.force_limit_n, hello.comfort_n ?? COMFORT * hello.force_limit_n);
    find("start-button").hidden = find("exams-button").hidden = !hello.trainer;
    find("course-button").hidden = !this.start.course.any;
    this.showMode();
  }

  /** The first question of a new visit; not when an exam already runs, nor to who only watches. */
  private offerStart(): void {
    if (this.offered || !this.hello?.trainer || !this.exam || !this.controls) return;
    this.offered = true;
    if (this.exam.phase === "practice" && this.controls.controls) this.start.open();
  }

  /** Comes after the geometry, so the thigh is there now. */
  private setControls(controls: Controls): void {
    const probeChanged = this.controls?.probe !== controls.probe;
    this.controls = controls;
    this.sliders.set(controls);
    this.echo.set(controls);
    this.patient.set(controls);
    this.duplex.set(controls);
    this.gateTools.set(controls);
    this.spectrum.set(controls);
    this.editor.set(controls);
    this.scene.setGel((controls.gel_ml ?? 0) > 0.05);
    if (probeChanged) this.plot.clear();
    this.curveKey = null;
    if (this.fresh) this.furnish();
    if (!this.placed) this.place(controls);
    this.updateCurve();
    this.showMode();
    this.offerStart();
  }

  /** Marks and sites of a thigh that has just come; the hand is told where it is. */
  private furnish(): void {
    this.fresh = false;
    this.scene.setProbes(this.hello!.probes);
    this.scene.setSites(this.hello!.sites);
    this.goalDue = this.placed;
  }

  /** First controls of a thigh: puts the hand somewhere and applies the address's wishes. */
  private place(controls: Controls): void {
    this.placed = true;
    if (!controls.controls) return;
    const probe = query.get("probe");
    const wantedCase = query.get("case");
    if (probe && probe !== controls.probe) this.connection.probe(probe);
    if (wantedCase && wantedCase !== controls.case) this.connection.pathology(wantedCase);
    const depth = Number.parseFloat(query.get("depth") ?? "");
    const limb = this.phase === "practice" ? undefined : this.hello?.limb;
    const home = limb ? (START_SITE[limb.position] ?? GROIN_SITE) : HOME_SITE;
    this.setSite(Number.parseInt(query.get("site") ?? `${home}`, 10));
    this.setDepth(Number.isFinite(depth) ? depth : LIFTED_MM);
    // The program has the probe there; where it was over another limb says nothing of the way.
    if (limb) this.route.forget();
    for (const key of ["probe", "case", "depth", "site"]) query.delete(key); // once
  }

  private setExam(exam: Exam): void {
    const before = this.phase;
    this.exam = exam;
    this.phase = exam.phase;
    if (exam.phase !== before && this.echo.isFrozen) this.tools.freeze();
    if (exam.phase === "running" && before !== "running") this.begin(before);
    if (exam.phase === "practice" && exam.message && before !== "practice") this.say(exam.message, 8000);
    if (exam.phase === "running" || exam.phase === "done") this.examBar.show(exam, this.controls?.controls ?? false);
    this.start.course.see(exam);
    if (exam.phase === "film" && before !== "film") this.filming();
    if (exam.phase === "film") this.filmBar.show(exam, this.controls?.controls ?? false);
    else this.filmBar.leave();
    this.echo.point(exam.picture ?? null);
    this.patient.turns(exam);
    this.worksheet.show(exam, this.controls?.controls ?? false);
    if (exam.lesson) find("sheet-bar").hidden = true; // a lesson is about one thing
    if (exam.phase === "done") this.result.show(exam, this.controls?.controls ?? false, this.comments);
    else this.result.hide();
    if (exam.phase !== "replay") this.replayBar.leave();
    this.guide(exam);
    if (exam.phase === "edit") this.still();
    this.editor.follow(exam.phase);
    this.showMode();
    this.offerStart();
  }

  /** An exam begins, or goes on after the page was loaded anew. */
  private begin(before: Phase): void {
    remember("trained", "yes");
    this.start.close();
    this.exports.close();
    this.history.close();
    this.traces.clear();
    find("hint").classList.add("gone");
    const s = this.snapshot;
    if (before === "practice" && s && s.penetration_mm > 0) this.hold.adopt(s.position_mm, s.rotation, s.penetration_mm);
    find("scene").focus();
  }

  private filming(): void {
    this.start.close();
    this.traces.clear();
    find("hint").classList.add("gone");
    find("scene").focus();
  }

  /** What guidance shows: ring, angle, force. */
  private guide(exam: Exam): void {
    const running = exam.phase === "running";
    const target = running ? exam.step.target : null;
    const reached = target !== null && exam.step.offset_mm !== null && exam.step.offset_mm <= target.radius_mm;
    this.scene.setTarget(target, reached);
    this.forceBar.ask(running ? exam.step.force_n : null);
    this.dial.show(running ? exam.step.angle_deg : null, exam.step.angle_ok);
    const name = find("target-label");
    name.hidden = target === null;
    const away = exam.step.offset_mm === null || reached ? null : exam.step.offset_mm.toFixed(0);
    if (target) name.textContent = away ? t("main.target_away", { place: target.name, mm: away }) : target.name;
    name.classList.toggle("reached", reached);
  }

  private setSheet(sheet: SheetMessage): void {
    this.worksheet.set(sheet);
    if (this.exam) this.setExam(this.exam);
  }

  private setReplay(replay: Replay): void {
    this.replay = replay;
    this.header(this.phase);
    this.replayBar.show(replay, this.controls?.controls ?? false);
  }

  private setConnected(connected: boolean, wait_s: number): void {
    this.connected = connected;
    if (!connected) this.pending = null; // a picture that came too late is no sign of life
    if (!connected) this.live(false);
    find<HTMLButtonElement>("stop").disabled = !connected;
    find("status").classList.toggle("off", !connected);
    if (connected) {
      find("banner").hidden = true;
      this.editor?.again();
    } else {
      this.lost = true;
      this.say(t(this.phase === "running" ? "main.lost_exam" : "main.lost", { seconds: shown(wait_s, 1) }), 0);
    }
  }

  /** A leg without images is looked at as well. */
  private still(): void {
    this.imaged = true;
    this.live(true);
  }

  private isLive = false;
  /** What was measured last is not what is now: without a connection image and numbers are greyed out. */
  private live(on: boolean): void {
    if (this.isLive === on) return;
    this.isLive = on;
    document.body.classList.toggle("offline", !on);
    find("echo-lost").hidden = on || this.frames === 0;
    this.readouts.lost(!on);
    this.forceBar.lost(!on);
    this.showMode();
  }

  private refused(): void {
    this.setConnected(false, 0);
    this.say(t("main.refused"), 0);
  }

  private sayTimer = 0;
  /** A sentence at the top; 0 keeps it until the connection is back. */
  private say(sentence: string, ms = 4000): void {
    const banner = find("banner");
    banner.textContent = sentence;
    banner.hidden = false;
    window.clearTimeout(this.sayTimer);
    if (ms > 0) this.sayTimer = window.setTimeout(() => (banner.hidden = !this.connected ? banner.hidden : true), ms);
  }

  // ---- modes -----------------------------------------------------------------------------------

  /** This page's hand moves the probe: not when watching, with another device, or in a replay. */
  private get hands(): boolean {
    const device = this.hello?.device ?? "page";
    return this.isLive && (this.controls?.controls ?? false) && device === "page" && this.phase !== "replay" && this.phase !== "film" && this.phase !== "preparing" && this.phase !== "edit" && !this.editor?.isOpen;
  }

  private showMode(): void {
    const phase = this.phase;
    const examining = phase === "running" || phase === "done";
    const judged = phase === "running" || phase === "preparing"; // nothing may tell the truth
    const guidance = this.exam?.guidance ?? "full";
    document.body.dataset.phase = phase;
    find("practice-bar").hidden = examining || phase === "replay" || phase === "film" || phase === "edit";
    find("edit-note").hidden = phase !== "edit";
    find("film-bar").hidden = phase !== "film";
    find("exam-bar").hidden = !examining;
    find("replay-bar").hidden = phase !== "replay";
    find("comments").hidden = !this.comments;
    find("sliders").hidden = this.comments;
    if (phase !== "replay") this.replayBar.live(this.comments ? this.exam : null);
    this.header(phase);
    this.preparing();
    const bare = judged && guidance === "exam";
    find<HTMLButtonElement>("see-through").disabled = bare;
    this.applyThrough((this.through || (this.editor?.isOpen ?? false)) && !bare); // in the editor veins are pointed at
    this.scene.showSites(phase === "practice");
    this.echo.tellCase(phase === "practice");
    this.readouts.showVessels(!judged || guidance === "full");
    this.traces.showVessels(!judged || guidance === "full");
    find("chart-tabs").hidden = phase !== "practice";
    if (phase !== "practice") this.chart(true);
    if (phase !== "practice") this.patient.openTissue(false);
    this.input.enabled = this.hands;
    for (const id of ["depth-slider", "depth-less", "depth-more", "ease", "home", "turn-left", "turn-right"]) find<HTMLButtonElement>(id).disabled = !this.hands;
    find("ease").classList.toggle("primary", phase === "running" && letGo(this.exam?.compression ?? null));
    this.coach.show(this.exam, this.hands);
  }

  private header(phase: Phase): void {
    const exam = this.exam;
    const own = exam !== null && phase !== "practice" && exam.title !== "";
    const played = phase === "replay" ? (this.replay?.title ?? "") : "";
    const shown = phase === "film" ? this.hello?.course?.find((l) => l.id === exam?.lesson?.id) : undefined;
    const written = phase === "edit";
    find("case-title").textContent = written ? t("editor.label") : own ? exam.title : shown?.title || played || label(this.hello?.model ?? "");
    find("case-history").textContent = written ? t("page.edit_note") : own ? exam.history : shown ? shown.patient : played ? "" : t("main.practise_on");
    find("case").title = find("case-history").textContent ?? "";
    this.showRole();
    const device = this.hello?.device ?? "page";
    if (device !== "page" && this.controls?.controls) find("hint").textContent = t("main.moved_by", { device });
    const clock = find("clock");
    clock.hidden = phase !== "running" && phase !== "done";
    clock.classList.toggle("recording", phase === "running" && (exam?.recording ?? false));
    clock.title = exam?.recording ? t("main.recorded") : t("main.not_recorded");
    find("clock-text").textContent = minutes(exam?.elapsed_s ?? 0);
  }

  private showRole(): void {
    const words = this.controls ? roleWords(this.controls) : "";
    find("watching").hidden = words === "";
    find("watching").textContent = words;
    const may = this.controls?.may ?? "";
    const button = find<HTMLButtonElement>("role-button");
    button.hidden = may === "" || !this.isLive;
    if (may) [button.textContent, button.title] = ROLE_ACTIONS[may];
  }

  /** Who does not examine may comment on what is seen, while the exam runs and after it. */
  private get comments(): boolean {
    const watches = this.controls?.role !== undefined && this.controls.role !== "learner";
    return this.phase === "replay" || (watches && (this.phase === "done" || (this.phase === "running" && !this.controls!.controls)));
  }

  private preparing(): void {
    const on = this.phase === "preparing";
    find("preparing").hidden = !on;
    if (!on || !this.exam) return;
    find("preparing-text").textContent = this.exam.message || t("main.preparing");
    find<HTMLProgressElement>("preparing-bar").value = this.exam.progress;
  }

  private openHistory(): void {
    this.history.open(this.hello?.trainee || recall("trainee"));
    this.connection.listExams();
  }

  private chart(time: boolean): void {
    pressed("tab-time", time);
    pressed("tab-depth", !time);
    find("traces").hidden = !time;
    find("plot-box").hidden = time;
  }

  // ---- what the operator does ------------------------------------------------------------------

  private moved(): void {
    this.goalDue = true;
    this.wake();
    if (this.snapshot) this.route.to(this.scene.skin, this.snapshot.position_mm, this.hold.point);
    if (this.snapshot && this.snapshot.tick > 0 && this.hold.depth_mm > 0) find("hint").classList.add("gone");
    write(find("depth-value"), `${decimal(this.hold.depth_mm.toFixed(1).replace(/\.0$/, ""))} mm`);
    find<HTMLInputElement>("depth-slider").value = String(this.hold.depth_mm);
    this.updateCurve();
  }

  setDepth(depth_mm: number): void {
    this.hold.setDepth(depth_mm);
    this.moved();
  }

  setSite(id: number): boolean {
    const site = this.hello?.sites.find((s) => s.id === id);
    if (site) {
      this.hold.straighten();
      this.hold.atSite(site);
    } else {
      this.holdAnywhere();
    }
    this.moved();
    return site !== undefined;
  }

  /** A thigh without that site: the middle of its anterior side. */
  private holdAnywhere(): void {
    const first = this.hello?.sites[0];
    if (first) return this.hold.atSite(first);
    const skin = this.scene.skin;
    const point = skin && this.scene.project([0, 150, 150], [0, 1, 0]);
    if (skin && point) this.hold.at(point, skin.normalAt(point));
  }

  private reset(): void {
    this.hold.setDepth(LIFTED_MM);
    this.setSite(HOME_SITE);
    this.scene.home();
    this.plot.clear();
  }

  private nextCase(): void {
    const cases = this.hello?.cases ?? [];
    const next = cases[(cases.indexOf(this.connection.wishes.get("case") ?? "") + 1) % cases.length];
    if (next && this.phase === "practice") this.connection.pathology(next);
  }

  private toggleThrough(): void {
    if (find<HTMLButtonElement>("see-through").disabled) return;
    this.through = !this.through;
    this.applyThrough(this.through);
  }

  private applyThrough(on: boolean): void {
    if (this.scene.isThrough !== on) this.scene.seeThrough(on);
    pressed("see-through", on);
  }

  /** The nearest site's measured curve for this probe, or the reason why there is none. */
  private updateCurve(): void {
    const probe = this.controls?.probe ?? "";
    const near = nearestSite(this.hello?.sites ?? [], this.hold.point);
    const useful = near !== null && near.distance_mm < NEAR_MM;
    const points = useful ? (near.site.curves[probe] ?? []) : [];
    const where = near ? near.distance_mm >= 0.5 ? t("main.place_away", { n: near.site.id, mm: near.distance_mm.toFixed(0) }) : t("main.place", { n: near.site.id }) : "";
    const none = useful ? t("main.not_computed", { probe: amid(label(probe)) }) : t("main.no_curve");
    write(find("plot-site"), points.length ? t("main.probe_at", { probe: label(probe), where }) : none);
    find("key-measured").hidden = points.length === 0;
    const key = points.length ? `${near!.site.id} ${probe}` : "";
    if (key !== this.curveKey) {
      this.curveKey = key;
      this.plot.measured({ penetration_mm: points.map((p) => p[0]), force_n: points.map((p) => p[1]) });
    }
  }

  measured(): [number, number][] {
    const near = nearestSite(this.hello?.sites ?? [], this.hold.point);
    return near?.site.curves[this.controls?.probe ?? ""] ?? [];
  }

  // ---- the screen ------------------------------------------------------------------------------

  private animate(now_s: number): void {
    this.input.tick(now_s);
    if (this.snapshot && this.route.passed(this.snapshot.position_mm)) this.goalDue = true;
    if (this.goalDue && this.hands) {
      this.goalDue = false;
      const pose = this.route.pose(this.hold.pose());
      this.connection.goal(pose.position_mm, pose.rotation);
    }
    const frame = this.pending;
    this.pending = null;
    if (frame) this.show(frame);
    if (frame) this.connection.ack(frame.sequence); // before the leg: image and force do not wait for it
    if (this.imaged) this.scene.render(now_s); // its first picture takes long: the image goes before it
    if (!this.imaged && this.frames > 0) (this.imaged = true), this.wake(); // for the leg
    if (this.input.holds) this.wake();
    this.nameTarget();
    this.rates.update(now_s, frame !== null, this.snapshot?.tick ?? 0, this.connected, this.connection.latency_ms, ((this.snapshot?.flags ?? 0) & FLAG_SOLID) !== 0);
  }

  private show(frame: Frame): void {
    const s = frame.snapshot;
    this.snapshot = s;
    this.live(true);
    if (++this.frames === 1) performance.mark("first image");
    this.pixels = frame.pixels;
    this.scene.show(frame);
    this.echo.show(frame);
    this.spectrum.show(frame.spectrum, this.echo.isFrozen);
    this.worksheet.see(s.tick, this.echo.isFrozen);
    this.readouts.show(s);
    const running = this.phase === "running";
    this.examBar.tell(this.forceBar.show(s, running ? (this.exam?.compression ?? null) : null));
    this.traces.add(s);
    find("echo-note").hidden = s.penetration_mm > LIFTED_NOTE_MM;
    find("traces-note").hidden = this.phase !== "replay" || this.traces.drawn;
    this.examBar.follow(s.position_mm[2], s.penetration_mm > 0);
    if (!this.hands) this.follow(s);
    if (s.penetration_mm > -1) this.plot.add(s.penetration_mm, Math.max(0, s.force_normal_n));
    this.showFault(s.fault, (s.flags & FLAG_INSIDE_OUT) !== 0);
  }

  /** A watching page takes over the hold that it sees, so that nothing jumps when it may control. */
  private follow(s: Snapshot): void {
    this.hold.adopt(s.position_mm, s.rotation, s.penetration_mm);
    this.moved();
    this.goalDue = false;
  }

  /** Writes the target's name beside its ring. */
  private nameTarget(): void {
    const at = this.scene.targetOnScreen();
    const name = find("target-label");
    if (!at || name.hidden) return;
    const [w, h] = [name.parentElement!.clientWidth - name.offsetWidth, name.parentElement!.clientHeight - name.offsetHeight];
    const x = Math.max(6, Math.min(w - 6, at[0] - name.offsetWidth / 2));
    const y = Math.max(6, Math.min(h - 6, at[1] - name.offsetHeight - 6));
    name.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  }

  private shownFault = -1;
  private shownOff = false;
  /** `off`: the probe was led through the leg and is taken off. */
  private showFault(fault: number, off: boolean): void {
    const stopped = fault !== 0 || (this.controls?.stop ?? false);
    find("resume").hidden = !stopped || !(this.controls?.controls ?? false);
    if (fault === this.shownFault && off === this.shownOff) return;
    this.shownFault = fault;
    this.shownOff = off;
    const box = find("fault");
    box.hidden = fault === 0 && !off;
    const sentence = fault ? (this.hello?.faults[fault] ?? "") : t("main.too_far");
    const next = fault ? t("main.resume") : t("main.lift");
    const advice = document.createElement("small");
    advice.textContent = t("main.faded", { next });
    box.replaceChildren(`${capital(sentence)}.`, document.createElement("br"), advice);
    if (fault || off) announce(`${sentence}. ${next}`);
  }
}

dress(document);
const app = new App();

/** For tests and for the console. Lengths are mm. */
const sonde = {
  get snapshot() { return app.snapshot; },
  get connected() { return app.connected; },
  get controls() { return app.controls; },
  get hello() { return app.hello; },
  get exam() { return app.exam; },
  get replay() { return app.replay; },
  get worksheet() { return app.worksheet.written; },
  get frames() { return app.frames; },
  /** sentences of the program without a translation */
  get untold() { return [...untold]; },
  /** changes whenever the echo image changes */
  get imageSum() { return app.pixels.reduce((sum, p, i) => (sum + p * ((i % 251) + 1)) % 1e9, 0); },
  get measures() { return app.echo.measures; },
  /** what is read off the spectrum */
  get spectrum() { return app.spectrum.readings; },
  /** columns of the spectrum that were made audible */
  get sounded() { return app.sound.sounded; },
  get depth() { return app.hold.depth_mm; },
  /** where the hand holds the probe on the resting skin */
  get point() { return app.hold.point; },
  get draft() { return app.editor.told; },
  vesselOnScreen: (part: number, share: number) => app.scene.vesselOnScreen(part, share),
  legOnScreen: () => app.scene.legOnScreen(),
  /** middle of the wanted ring on the canvas, px */
  targetOnScreen: () => app.scene.targetOnScreen("middle"),
  setDepth: (depth_mm: number) => app.setDepth(depth_mm),
  setSite: (id: number) => app.setSite(id),
  selectProbe: (name: string) => app.connection.probe(name),
  selectCase: (name: string) => app.connection.pathology(name),
  measured: () => app.measured(),
  stop: () => app.connection.stop(),
  resume: () => app.connection.resume(),
};
declare global {
  interface Window { sonde: typeof sonde }
}
window.sonde = sonde;
