// The page: connects the server's messages with the views, and the operator's hand with the server.

import { gradient } from "./colour";
import { Connection } from "./connection";
import { EchoView, label } from "./echo";
import { Input } from "./input";
import { Chips, fillHelp, find, Readouts, Sliders } from "./panel";
import { ForcePlot } from "./plot";
import { add, Hold, nearestSite, rotate, type Pose } from "./pose";
import { VERSION, type Controls, type Frame, type Hello, type Snapshot, type TextMessage } from "./protocol";
import { ThighScene } from "./scene";

const HOME_SITE = 27;
const NEAR_MM = 20; // farther from a site its curve says nothing about this place

const query = new URLSearchParams(location.search);

class App {
  hello: Hello | null = null;
  controls: Controls | null = null;
  snapshot: Snapshot | null = null;
  connected = false;
  frames = 0;
  imageSum = 0;
  readonly hold = new Hold();
  readonly scene = new ThighScene(find<HTMLCanvasElement>("scene"), query.get("quality") === "low");
  readonly echo = new EchoView(
    find("echo-box"),
    find<HTMLCanvasElement>("echo"),
    find<HTMLCanvasElement>("echo-marks"),
    find("echo-text"),
  );
  readonly plot = new ForcePlot(find("plot"));
  readonly readouts = new Readouts(find("readouts"));
  readonly sliders = new Sliders(find("sliders"), (key, value) => this.connection.echo(key, value));
  readonly probes = new Chips(find("probes"), (name) => this.connection.probe(name));
  readonly cases = new Chips(find("cases"), (name) => this.connection.pathology(name), shortCase);
  readonly input: Input;
  readonly connection: Connection;
  private pending: Frame | null = null;
  private goalDue = false;
  private curveKey = "";
  private started = false;
  private rates = { at_s: 0, tick: 0, frames: 0 };
  private rates_s = 0; // when they were last computed
  private shown_s = 0; // when the last frame was drawn

  constructor() {
    this.connection = new Connection({
      text: (message) => this.text(message),
      geometry: (part) => this.scene.setPart(part),
      frame: (frame) => (this.pending = frame),
      state: (connected, wait_s) => this.setConnected(connected, wait_s),
    });
    this.input = new Input(find<HTMLCanvasElement>("scene"), this.scene, this.hold, {
      moved: () => this.moved(),
      probe: (i) => this.hello?.probes[i] && this.connection.probe(this.hello.probes[i].name),
      nextCase: () => this.nextCase(),
      freeze: () => this.freeze(),
      seeThrough: () => this.toggleThrough(),
      reset: () => this.reset(),
      stop: () => this.connection.stop(),
      help: () => find<HTMLDialogElement>("help").showModal(),
      sites: () => this.hello?.sites ?? [],
    });
    this.wireButtons();
    const loop = (now: number): void => {
      this.animate(now / 1000);
      requestAnimationFrame(loop);
    };
    requestAnimationFrame(loop);
  }

  private wireButtons(): void {
    fillHelp(find("help").querySelector<HTMLElement>(".keys")!);
    find("legend-bar").style.background = gradient();
    this.scene.rangeChanged = (mm) => (find("legend-top").textContent = `${mm} mm`);
    const press = (id: string, action: () => void): void => {
      find(id).onclick = () => {
        action();
        find(id).blur();
      };
    };
    press("stop", () => this.connection.stop());
    press("resume", () => this.connection.resume());
    press("help-button", () => find<HTMLDialogElement>("help").showModal());
    press("see-through", () => this.toggleThrough());
    press("home", () => this.reset());
    press("depth-less", () => this.setDepth(this.hold.depth_mm - 1));
    press("depth-more", () => this.setDepth(this.hold.depth_mm + 1));
    const slider = find<HTMLInputElement>("depth-slider");
    slider.oninput = () => this.setDepth(slider.valueAsNumber);
    slider.onchange = () => slider.blur();
  }

  // ---- messages --------------------------------------------------------------------------------

  private text(message: TextMessage): void {
    if (message.type === "hello") this.greet(message);
    else if (message.type === "controls") this.setControls(message);
    else if (message.type === "error") this.say(message.message);
  }

  private greet(hello: Hello): void {
    if (hello.version !== VERSION) return this.say("this page belongs to another version: reload it");
    this.hello = hello;
    this.started = false;
    find("model").textContent = `${label(hello.model)}: ${hello.provenance}`;
    find("model").title = hello.provenance;
    find("about").textContent =
      `Sonde ${hello.program}. Trains and simulates; not a medical device. ` + `${hello.nodes} skin nodes. ${hello.provenance}`;
    this.probes.fill(hello.probes.map((p) => p.name));
    this.cases.fill(hello.cases);
    this.readouts.setLimit(hello.force_limit_n);
  }

  /** Comes after the geometry, so the thigh is there now. */
  private setControls(controls: Controls): void {
    const probeChanged = this.controls?.probe !== controls.probe;
    this.controls = controls;
    this.probes.press(controls.probe);
    this.cases.press(controls.case);
    this.sliders.set(controls);
    this.echo.set(controls);
    this.input.enabled = controls.controls;
    this.probes.enable(controls.controls);
    this.cases.enable(controls.controls);
    for (const id of ["depth-slider", "depth-less", "depth-more", "home"])
      find<HTMLButtonElement>(id).disabled = !controls.controls;
    if (probeChanged) this.plot.clear();
    this.curveKey = "";
    if (!this.started) this.start(controls);
    this.updateCurve();
    if (!controls.controls) this.say("Another page controls the probe; this one watches.", 6000);
  }

  /** First controls of a connection: sets the scene up and applies the address's wishes. */
  private start(controls: Controls): void {
    this.started = true;
    this.scene.setProbes(this.hello!.probes);
    this.scene.setSites(this.hello!.sites);
    if (!controls.controls) return;
    const probe = query.get("probe");
    const wantedCase = query.get("case");
    if (probe && probe !== controls.probe) this.connection.probe(probe);
    if (wantedCase && wantedCase !== controls.case) this.connection.pathology(wantedCase);
    const depth = Number.parseFloat(query.get("depth") ?? "");
    this.setSite(Number.parseInt(query.get("site") ?? `${HOME_SITE}`, 10));
    this.setDepth(Number.isFinite(depth) ? depth : -8);
  }

  private setConnected(connected: boolean, wait_s: number): void {
    this.connected = connected;
    find("status").classList.toggle("off", !connected);
    if (connected) find("banner").hidden = true;
    else this.say(`The connection to Sonde is lost. Trying again in ${wait_s.toFixed(1)} s. Is the program running?`, 0);
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

  // ---- what the operator does ------------------------------------------------------------------

  private moved(): void {
    this.goalDue = true;
    if (this.started && this.snapshot && this.snapshot.tick > 0 && this.hold.depth_mm > 0) find("hint").classList.add("gone");
    find("depth-value").textContent = `${this.hold.depth_mm.toFixed(1).replace(/\.0$/, "")} mm`;
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
    this.hold.setDepth(-8);
    this.setSite(HOME_SITE);
    this.scene.home();
    this.plot.clear();
  }

  private nextCase(): void {
    const cases = this.hello?.cases ?? [];
    const next = cases[(cases.indexOf(this.controls?.case ?? "") + 1) % cases.length];
    if (next) this.connection.pathology(next);
  }

  private freeze(): void {
    this.echo.freeze(!this.echo.isFrozen);
    find("frozen").hidden = !this.echo.isFrozen;
  }

  private toggleThrough(): void {
    this.scene.seeThrough(!this.scene.isThrough);
    find("see-through").setAttribute("aria-pressed", String(this.scene.isThrough));
  }

  /** The nearest site's measured curve for this probe, or the reason why there is none. */
  private updateCurve(): void {
    const probe = this.controls?.probe ?? "";
    const near = nearestSite(this.hello?.sites ?? [], this.hold.point);
    const useful = near !== null && near.distance_mm < NEAR_MM;
    const points = useful ? (near.site.curves[probe] ?? []) : [];
    const where = near ? `site ${near.site.id}${near.distance_mm >= 0.5 ? `, ${near.distance_mm.toFixed(0)} mm away` : ""}` : "";
    const none = useful ? `not measured with the ${label(probe).toLowerCase()} probe` : "no measured site nearby";
    find("plot-site").textContent = points.length ? `${label(probe)} probe, ${where}` : none;
    find("key-measured").hidden = points.length === 0;
    const key = points.length ? `${near!.site.id} ${probe}` : "";
    if (key !== this.curveKey || key === "") {
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
    if (this.goalDue && this.controls?.controls) {
      this.goalDue = false;
      const pose: Pose = this.hold.pose();
      this.connection.goal(pose.position_mm, pose.rotation);
    }
    const frame = this.pending;
    this.pending = null;
    if (frame) this.show(frame);
    if (frame) this.shown_s = now_s;
    this.scene.render();
    if (frame) this.connection.ack(frame.sequence);
    if (now_s - this.rates_s > 1) this.showRates(now_s);
  }

  private show(frame: Frame): void {
    const s = frame.snapshot;
    this.snapshot = s;
    ++this.frames;
    this.imageSum = frame.pixels.reduce((sum, p, i) => (sum + p * ((i % 251) + 1)) % 1e9, 0);
    this.scene.show(frame);
    this.echo.show(frame);
    this.readouts.show(s);
    if (!this.controls?.controls) this.follow(s);
    if (s.penetration_mm > -1) this.plot.add(s.penetration_mm, Math.max(0, s.force_normal_n));
    this.showFault(s.fault);
  }

  /** A watching page takes over the hold that it sees, so that nothing jumps when it may control. */
  private follow(s: Snapshot): void {
    const z = rotate(s.rotation, [0, 0, 1]);
    this.hold.at(add(s.position_mm, z, -s.penetration_mm), [-z[0], -z[1], -z[2]]);
    this.hold.setDepth(s.penetration_mm);
    this.moved();
    this.goalDue = false;
  }

  private shownFault = -1;
  private showFault(fault: number): void {
    const stopped = fault !== 0 || (this.controls?.stop ?? false);
    find("resume").hidden = !stopped || !(this.controls?.controls ?? false);
    if (fault === this.shownFault) return;
    this.shownFault = fault;
    const box = find("fault");
    box.hidden = fault === 0;
    const sentence = this.hello?.faults[fault] ?? "";
    const advice = document.createElement("small");
    advice.textContent = "The force has faded to zero. Press Resume to go on.";
    box.replaceChildren(`${label(sentence)}.`, document.createElement("br"), advice);
  }

  private showRates(now_s: number): void {
    const r = this.rates;
    const tick = this.snapshot?.tick ?? 0;
    const first = r.tick === 0;
    const dt_s = Math.max(0.001, this.shown_s - r.at_s);
    const ticks_s = Math.max(0, tick - r.tick) / dt_s;
    const images_s = (this.frames - r.frames) / dt_s;
    this.rates = { at_s: this.shown_s, tick, frames: this.frames };
    this.rates_s = now_s;
    if (first && this.connected) return;
    const latency = Number.isNaN(this.connection.latency_ms) ? "" : `, ${this.connection.latency_ms.toFixed(0)} ms`;
    find("status").textContent = this.connected
      ? `${ticks_s.toFixed(0)} steps/s, ${images_s.toFixed(0)} images/s${latency}`
      : "not connected";
  }
}

/** Chips have little room: "partial_mural" -> "Partial". */
function shortCase(name: string): string {
  return label(name.split("_")[0] ?? name);
}

const app = new App();

/** For tests and for the console. Lengths are mm. */
const sonde = {
  get snapshot() { return app.snapshot; },
  get connected() { return app.connected; },
  get controls() { return app.controls; },
  get hello() { return app.hello; },
  get frames() { return app.frames; },
  /** changes whenever the echo image changes */
  get imageSum() { return app.imageSum; },
  get depth() { return app.hold.depth_mm; },
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
