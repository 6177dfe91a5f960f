// Numbers as a reader expects them: rounded, with a true minus sign; the decimal sign is the language's, but a point in
// reports that are in English whoever reads them.

import { decimal } from "../words/language";

const MINUS = "\u2212";
const NONE = "\u2013"; // what is not known
const RAISED = "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079";

/** What JSON gives for a number: null where it is not finite. */
export type Real = number | null | undefined;

export const isKnown = (x: Real): x is number => typeof x === "number" && Number.isFinite(x);
/** NaN for what is not known, so that it can be computed with. */
export const real = (x: Real): number => (isKnown(x) ? x : NaN);

let sign = decimal;
/** From now on decimal points, as in English. */
export const inEnglish = (): void => void (sign = (digits) => digits);

export function fixed(x: Real, decimals: number): string {
  if (!isKnown(x)) return NONE;
  if (Math.abs(x) >= 1e15) return significant(x, 6);
  const digits = sign(Math.abs(x).toFixed(decimals));
  return x < 0 && /[1-9]/.test(digits) ? MINUS + digits : digits;
}

export function signed(x: Real, decimals: number): string {
  const digits = fixed(x, decimals);
  return isKnown(x) && x > 0 && /[1-9]/.test(digits) ? `+${digits}` : digits;
}

export function significant(x: Real, count: number): string {
  if (!isKnown(x) || x === 0) return fixed(x, 0);
  const [mantissa, power] = Math.abs(x).toExponential(count - 1).split("e") as [string, string];
  const exponent = Number(power);
  if (exponent >= -4 && exponent < 6) return fixed(x, Math.max(0, count - 1 - exponent));
  const raised = [...String(Math.abs(exponent))].map((d) => RAISED[Number(d)]).join("");
  return `${x < 0 ? MINUS : ""}${mantissa} \u00d7 10${exponent < 0 ? "\u207b" : ""}${raised}`;
}

/** Four digits without the zeros at their end. */
export function short(x: Real): string {
  const digits = significant(x, 4);
  return digits.includes(".") && !digits.includes("\u00d7") ? digits.replace(/\.?0+$/, "") : digits;
}

/** 1234567 -> "1,234,567" */
export const grouped = (x: Real): string => fixed(x, 0).replace(/\B(?=(\d{3})+$)/g, ",");
