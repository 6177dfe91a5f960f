// Doppler sound, made from the spectrum: each column becomes a short grain of tones at its Doppler
// shifts, flow towards the probe on the right, away from it on the left. Off until it is asked for.

import type { SpectrumColumn, SpectrumFrame } from "./protocol";

const RATE_HZ = 16000;
const HOP = 160; // samples from column to column: 10 ms
const GRAIN = 4 * HOP; // four grains lie over each other
const AHEAD_S = 0.09; // what a late frame may be late
const MOST_AHEAD_S = 0.4;
const RANGE_DB = 36; // of a column's 0 to 255
const FAINT = 60; // of 255: noise that is not heard
const LOUDNESS = 0.004;
const WINDOW = Float32Array.from({ length: GRAIN }, (_, n) => 0.5 - 0.5 * Math.cos((2 * Math.PI * n) / GRAIN));
const AMPLITUDE = Float32Array.from({ length: 256 }, (_, p) => (p < FAINT ? 0 : LOUDNESS * 10 ** ((p / 255) * (RANGE_DB / 20))));

export class DopplerSound {
  private context: AudioContext | null = null;
  private gain: GainNode | null = null;
  private at = 0; // when the next column sounds
  private volume_ = 0.5;
  /** columns that were made audible, for tests */
  sounded = 0;

  get on(): boolean {
    return this.context !== null;
  }

  /** After a press of a button only: browsers allow no other sound. */
  switch(on: boolean): void {
    if (on === this.on) return;
    if (!on) {
      void this.context!.close();
      this.context = this.gain = null;
      return;
    }
    this.context = new AudioContext();
    this.gain = this.context.createGain();
    this.gain.connect(this.context.destination);
    this.volume(this.volume_);
    this.at = 0;
    void this.context.resume();
  }

  /** 0 to 1 */
  volume(value: number): void {
    this.volume_ = value;
    if (this.gain) this.gain.gain.value = value * value;
  }

  /** Columns that follow each other, as they come. */
  add(columns: SpectrumColumn[], frame: SpectrumFrame): void {
    const context = this.context;
    if (!context || columns.length === 0) return;
    const now = context.currentTime;
    if (this.at < now + 0.01) this.at = now + AHEAD_S;
    if (this.at > now + MOST_AHEAD_S) return; // more came than time passed: a replay that runs fast
    const buffer = context.createBuffer(2, (columns.length - 1) * HOP + GRAIN, RATE_HZ);
    const sides = [buffer.getChannelData(0), buffer.getChannelData(1)] as const;
    columns.forEach((column, k) => grain(column, frame, sides, k * HOP));
    const source = context.createBufferSource();
    source.buffer = buffer;
    source.connect(this.gain!);
    source.start(this.at);
    this.at += (columns.length * HOP) / RATE_HZ;
    this.sounded += columns.length;
  }
}

function grain(column: SpectrumColumn, frame: SpectrumFrame, [left, right]: readonly [Float32Array, Float32Array], from: number): void {
  const bins = column.power.length;
  for (let b = 0; b < bins; ++b) {
    const amplitude = AMPLITUDE[column.power[b]!]!;
    if (amplitude === 0) continue;
    const velocity = frame.low_cm_s + ((b + 0.5) * 2 * frame.limit_cm_s) / bins;
    const shift_hz = ((velocity / frame.limit_cm_s) * frame.pulse_hz) / 2;
    if (Math.abs(shift_hz) > 0.48 * RATE_HZ) continue;
    const side = shift_hz > 0 ? right : left;
    // A tone of any phase, by turning a vector.
    const start = 2 * Math.PI * Math.random();
    const step = (2 * Math.PI * Math.abs(shift_hz)) / RATE_HZ;
    const [c, s] = [Math.cos(step), Math.sin(step)];
    let [x, y] = [amplitude * Math.cos(start), amplitude * Math.sin(start)];
    for (let n = 0; n < GRAIN; ++n) {
      side[from + n]! += x * WINDOW[n]!;
      [x, y] = [x * c - y * s, x * s + y * c];
    }
  }
}
