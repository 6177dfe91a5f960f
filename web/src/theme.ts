// The theme: the system's, or the one that the user chose and that is kept; and its colours for what CSS does not
// paint. The colours of the page are in palette.css, those of solid things in the picture of the leg below.

import { announce, find, press, recall, remember } from "./dom";
import { t } from "./words/language";

/** Of solid things under the lights of the leg's picture. */
export const SOLID = {
  vein: 0x5b8def, artery: 0xe0604d, clot: 0xb04fd6, bone: 0xe7dfcb, probe: 0xd3dae2, mark: 0x5cc8c2, skin: 0x9fb0c2, edge: 0xffffff, site: 0xc9d4e2,
  wanted: 0xffc857, reached: 0x5fd38d, cut: 0x2b333e, sky: 0xdfe8f5, floor: 0x3a3632, key: 0xfff3e4, rim: 0x86a8d8,
} as const;
type SolidName = keyof typeof SOLID;
/** Of the same things where the page is light: they stand before a light ground. */
const SOLID_LIGHT: Partial<Record<SolidName, number>> = { mark: 0x0b6e69, site: 0x5a6876, edge: 0x2c3742, probe: 0xa9b4bf, cut: 0xaeb8c2, wanted: 0xb97900, reached: 0x1c8a4c };

type Theme = "light" | "dark";

const system = window.matchMedia("(prefers-color-scheme: light)");
const listeners: (() => void)[] = [];
const inks = new Map<string, string>();

function chosen(): Theme | "" {
  const kept = recall("theme");
  return kept === "light" || kept === "dark" ? kept : "";
}

export const theme = (): Theme => chosen() || (system.matches ? "light" : "dark");

export const solid = (name: SolidName): number => (theme() === "light" ? SOLID_LIGHT[name] : undefined) ?? SOLID[name];

/** Gives a material the colour, and again whenever the theme changes (repaint). */
export function paint<M extends { color: { setHex(hex: number): unknown }; userData: Record<string, unknown> }>(material: M, name: SolidName): M {
  material.userData.solid = name;
  material.color.setHex(solid(name));
  return material;
}

export function repaint(material: unknown): void {
  const painted = material as Parameters<typeof paint>[0] | undefined;
  const name = painted?.userData?.solid as SolidName | undefined;
  if (painted && name) painted.color.setHex(solid(name));
}

/** Calls it after each change of the theme. */
export function onTheme(changed: () => void): void {
  listeners.push(changed);
}

/** A colour of palette.css for a canvas; `on`: where it is painted, a picture or (absent) the page. */
export function ink(name: string, on: "page" | "picture" = "page"): string {
  const key = `${name} ${on}`;
  const known = inks.get(key);
  if (known) return known;
  const probe = document.createElement("i");
  probe.style.color = `var(--${name})`;
  if (on === "picture") probe.style.colorScheme = "dark";
  document.body.append(probe);
  const colour = getComputedStyle(probe).color;
  probe.remove();
  inks.set(key, colour);
  return colour;
}

/** Dresses the document in the theme that is kept, or in the system's. */
export function dressTheme(): void {
  const kept = chosen();
  if (kept) document.documentElement.dataset.theme = kept;
  else delete document.documentElement.dataset.theme;
}

function apply(): void {
  dressTheme();
  inks.clear();
  const next = theme() === "light" ? "dark" : "light";
  const button = find("theme-button");
  button.textContent = t(`theme.${next}`);
  button.title = t(`theme.${next}.label`);
  button.setAttribute("aria-label", t(`theme.${next}.label`));
  for (const changed of listeners) changed();
}

/** Wires the switch in the header. */
export function startTheme(): void {
  press("theme-button", () => {
    const next: Theme = theme() === "light" ? "dark" : "light";
    remember("theme", next);
    apply();
    announce(t(`theme.${next}.said`));
  });
  system.addEventListener("change", apply);
  apply();
}
