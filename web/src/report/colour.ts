// Colours of values: in Oklab (Ottosson 2020) equal steps of the value look equally large, and lightness alone orders
// the sequential ones, so that they print in grey.

const clamp = (x: number, low: number, high: number): number => Math.max(low, Math.min(high, x));

/** Linear light to the value of a screen. */
const companded = (linear: number): number => {
  const c = clamp(linear, 0, 1);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
};

function oklch(lightness: number, chroma: number, hueDegrees: number): string {
  const hue = (hueDegrees * Math.PI) / 180;
  const [a, b] = [chroma * Math.cos(hue), chroma * Math.sin(hue)];
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  const linear = [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
  return `#${linear.map((v) => Math.round(255 * companded(v)).toString(16).padStart(2, "0")).join("")}`;
}

/** t in [0, 1], dark violet to light green; shade 1 is fully lit. */
export function sequential(t: number, shade = 1): string {
  const at = clamp(t, 0, 1);
  return oklch((0.32 + 0.62 * at) * shade, 0.105 * shade, 282 - 174 * at);
}

/** t in [-1, 1], blue to orange, white in the middle. */
export function diverging(t: number): string {
  const size = Math.abs(clamp(t, -1, 1));
  return oklch(0.985 - 0.42 * size, 0.14 * size, t < 0 ? 250 : 55);
}
