// Starts the program for tests, pictures and benchmarks of the page.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { findAddress } from "./drive.mjs";

/** For tests of who may do what: a protocol of one place, which is prepared in seconds, in a new directory. */
export function onePlace() {
  const directory = mkdtempSync(join(tmpdir(), "sonde-protocols-"));
  process.on("exit", () => rmSync(directory, { recursive: true }));
  const place = "{title: Groin, at: {station: common_femoral}, position: supine_turned}";
  writeFileSync(join(directory, "groin.yaml"), `sonde_protocol: 1\nid: groin\ntitle: Groin\ntext: Groin alone.\nplaces:\n- ${place}\n`);
  return ["--protocols", directory];
}

/** For tests that watch what happens, not how often: a page and its program share the processor. */
export const FEW_IMAGES = ["--images-hz", "4"];

/**
 * `sonde run` with these arguments, once it has printed the learner's and the teacher's address:
 * {child, learner, teacher, ended, interrupt}. `ended` gives the signal or the exit code. The program
 * dies with this process. `more`: variables of its environment.
 */
export function startRun(sonde, args, more = {}) {
  const child = spawn(sonde, ["run", ...args], { stdio: ["ignore", "pipe", "inherit"], env: { ...process.env, ...more } });
  process.on("exit", () => child.kill("SIGKILL"));
  const ended = new Promise((done) => child.on("exit", (code, signal) => done(signal ?? code)));
  let interrupted = false; // a second SIGINT would end the program at once
  const interrupt = () => {
    if (!interrupted) child.kill("SIGINT");
    interrupted = true;
  };
  let said = "";
  return new Promise((done, fail) => {
    child.stdout.on("data", (text) => {
      said += text;
      const [learner, teacher] = said.split("\n").slice(0, -1).map(findAddress).filter(Boolean);
      if (teacher) done({ child, learner, teacher, ended, interrupt });
    });
    ended.then((how) => fail(new Error(`sonde run ended with ${how} before it told its addresses: ${said}`)));
  });
}
