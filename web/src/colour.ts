// Colour of the skin by displacement: lightness rises steadily from the resting skin to the largest
// displacement, so that more always looks like more, also in grey and to colour-blind eyes.

type Rgb = [number, number, number];

const STOPS: [number, Rgb][] = [
  [0.0, [98, 106, 118]],
  [0.2, [110, 108, 154]],
  [0.42, [160, 110, 164]],
  [0.64, [214, 116, 132]],
  [0.83, [244, 154, 106]],
  [1.0, [254, 226, 150]],
];

function at(t: number): Rgb {
  for (let i = 1; i < STOPS.length; ++i) {
    const [t0, a] = STOPS[i - 1]!;
    const [t1, b] = STOPS[i]!;
    if (t > t1 && i < STOPS.length - 1) continue;
    const w = Math.min(1, Math.max(0, (t - t0) / (t1 - t0)));
    return [a[0] + w * (b[0] - a[0]), a[1] + w * (b[1] - a[1]), a[2] + w * (b[2] - a[2])];
  }
  return STOPS[0]![1];
}

/** The colour of a share of the largest displacement, brightened or darkened, for CSS. */
export const shade = (t: number, light: number): string => `rgb(${at(t).map((c) => Math.min(255, Math.round(c * light))).join(",")})`;

const linear = (c: number): number => {
  const s = c / 255;
  return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
};

export const SHADES = 256;

/** Linear-light RGB of SHADES steps, for vertex colours. */
export const SHADE_TABLE: Float32Array = (() => {
  const table = new Float32Array(SHADES * 3);
  for (let i = 0; i < SHADES; ++i) table.set(at(i / (SHADES - 1)).map(linear), 3 * i);
  return table;
})();

/** The same ramp as a CSS gradient for the legend, bottom to top. */
export function gradient(): string {
  const stops = STOPS.map(([t, c]) => `rgb(${c.join(",")}) ${(t * 100).toFixed(0)}%`);
  return `linear-gradient(to right, ${stops.join(", ")})`;
}

const RANGES_MM = [5, 10, 20, 30, 40, 60];

/** Top of the legend: grows at once, shrinks only when far too large, so that it does not flicker. */
export function nextRange(current_mm: number, largest_mm: number): number {
  const fit = RANGES_MM.find((r) => r >= largest_mm) ?? 60;
  return fit > current_mm || largest_mm < 0.4 * current_mm ? fit : current_mm;
}
