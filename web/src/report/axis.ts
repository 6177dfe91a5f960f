// Axes with ticks at 1, 2 or 5 times a power of ten.

import { fixed, significant } from "./number";

export interface Axis {
  low: number;
  high: number;
  step: number;
  ticks: number[];
  label: string;
}

/** The smallest of 1, 2, 5 times a power of ten that is not below `least`. */
export function niceStep(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  return (([1, 2, 5, 10].find((m) => m * power >= least * (1 - 1e-9)) ?? 10) * power);
}

function ends(low: number, high: number): [number, number] {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const [a, b] = [Math.max(-1e100, Math.min(low, high)), Math.min(1e100, Math.max(low, high))];
  const size = Math.max(Math.abs(a), Math.abs(b));
  const half = size > 0 ? 0.5 * size : 0.5;
  return b - a > 1e-9 * size ? [a, b] : [a - half, b + half];
}

function between(label: string, low: number, high: number, step: number): Axis {
  const first = Math.ceil(low / step - 1e-6);
  const last = Math.floor(high / step + 1e-6);
  return { label, low, high, step, ticks: Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step) };
}

/** Ends at whole steps, about `count` of them. Ends that are not finite or equal give an axis around them. */
export function axis(label: string, low: number, high: number, count = 8): Axis {
  const [a, b] = ends(low, high);
  const step = niceStep((b - a) / count);
  return between(label, Math.floor(a / step + 1e-6) * step, Math.ceil(b / step - 1e-6) * step, step);
}

/** Ends exactly at low and high. */
export function tightAxis(label: string, low: number, high: number, count = 8): Axis {
  const [a, b] = ends(low, high);
  return between(label, a, b, niceStep((b - a) / count));
}

export function tickLabel(axis: Axis, value: number): string {
  const decimals = -Math.floor(Math.log10(axis.step) + 1e-6);
  if (Math.abs(value) < 1e-6 * axis.step) return "0";
  if (decimals > 4 || Math.max(Math.abs(axis.low), Math.abs(axis.high)) >= 1e6) return significant(value, 3);
  return fixed(value, Math.max(0, decimals));
}

/** Least and largest of the finite values; `known` take part. */
export function range(values: Iterable<number>, ...known: number[]): [number, number] {
  let [low, high] = [Math.min(...known), Math.max(...known)];
  for (const value of values)
    if (Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return [low, high];
}
