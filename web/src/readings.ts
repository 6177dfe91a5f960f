// What is read off columns of a spectrum: peak, mean, phasicity, augmentation, time of reflux.

import type { SpectrumColumn } from "./protocol";

export interface Readings {
  /** velocities along the flow, cm/s */
  peak: number;
  mean: number;
  /** greatest less least mean of a fifth of a second, over the mean; NaN: too short, or no flow */
  phasicity: number;
  /** greatest mean within 3 s of the squeeze over the mean before it; NaN: none in the part */
  augmentation: number;
  /** how long blood ran against the flow, s */
  reflux_s: number;
  seconds: number;
}

const SLIDE_S = 0.2;
const SQUEEZE_S = 3;

/** The median of five neighbours in the place of each, as scanners smooth their traces. */
export function smoothed(values: number[]): number[] {
  return values.map((_, k) => {
    const near = [-2, -1, 0, 1, 2].map((i) => values[Math.max(0, Math.min(values.length - 1, k + i))]!);
    return near.sort((a, b) => a - b)[2]!;
  });
}

const average = (values: number[]): number => values.reduce((sum, v) => sum + v, 0) / values.length;

/**
 * @param scale of velocities along the beam to those along the flow: 1 over the cosine of the angle
 * @param slowest cm/s along the beam that pass the wall filter
 * @param squeeze index of the column at which the calf was squeezed, or -1
 */
export function read(columns: SpectrumColumn[], column_s: number, scale: number, slowest: number, squeeze: number): Readings {
  const mean = smoothed(columns.map((c) => c.mean_cm_s));
  const edge = smoothed(columns.map((c) => c.edge_cm_s));
  const farthest = (values: number[]): number => values.reduce((most, v) => (Math.abs(v) > Math.abs(most) ? v : most), 0);
  const result: Readings = { peak: farthest(edge) * scale, mean: average(mean) * scale, phasicity: NaN, augmentation: NaN, reflux_s: 0, seconds: columns.length * column_s };
  // The flow's own way: that of what is fastest, which a squeeze drives.
  const forward = Math.sign(farthest(mean));
  result.reflux_s = mean.filter((v) => v * forward < -slowest).length * column_s;
  const slide = Math.round(SLIDE_S / column_s);
  const rest = squeeze > 0 ? mean.slice(0, squeeze) : mean;
  const slides: number[] = [];
  for (let k = 0; k + slide <= rest.length; ++k) slides.push(average(rest.slice(k, k + slide)));
  const level = rest.length > 0 ? average(rest) : 0;
  if (slides.length > 5 * slide && Math.abs(level) > slowest) result.phasicity = (Math.max(...slides) - Math.min(...slides)) / Math.abs(level);
  if (squeeze > slide && Math.abs(level) > slowest) {
    const after = mean.slice(squeeze, squeeze + Math.round(SQUEEZE_S / column_s));
    result.augmentation = farthest(after) / level;
  }
  return result;
}
