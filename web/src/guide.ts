// Guidance in the picture: names at the edges with a line to what they name, the wanted vein with
// what is seen of it, and the way to the view. What is said comes from the program.

import { draw } from "./dom";
import type { Face } from "./lines";
import type { Picture, PictureMark } from "./protocol";

const ROW_PX = 15;
const EDGE_PX = 6;
const LETTER_PX = 6.1; // of the label's font, about
const GAP_PX = 4; // between a ring and its vessel

interface Row {
  mark: PictureMark;
  lines: string[];
  y: number;
}

/** Breaks a sentence into lines of at most so many letters. */
export function wrap(text: string, letters: number): string[] {
  const lines: string[] = [];
  for (const word of text.split(" ")) {
    const last = lines[lines.length - 1];
    if (last !== undefined && `${last} ${word}`.length <= letters) lines[lines.length - 1] = `${last} ${word}`;
    else lines.push(word);
  }
  return lines;
}

export class PictureGuide {
  readonly svg = draw("svg", { class: "guide", "aria-hidden": "true" });
  private picture: Picture | null = null;
  private size = { width_mm: 60, height_mm: 70, scale: 1, top_mm: 0 };
  private key = "";

  show(picture: Picture | null): void {
    const key = JSON.stringify(picture);
    if (key === this.key) return;
    this.key = key;
    this.picture = picture;
    this.paint();
  }

  layout(width_mm: number, height_mm: number, scale: number, face: Face): void {
    this.size = { width_mm, height_mm, scale, top_mm: face.top_mm };
    this.svg.setAttribute("viewBox", `0 0 ${width_mm * scale} ${height_mm * scale}`);
    this.paint();
  }

  private paint(): void {
    const p = this.picture;
    const marks = (p?.marks ?? []).filter((m) => m.depth_mm < this.size.height_mm + this.size.top_mm && Math.abs(m.x_mm) < this.size.width_mm / 2);
    const parts: SVGElement[] = [];
    for (const side of [-1, 1]) parts.push(...this.side(side, marks.filter((m) => (m.x_mm < 0 ? -1 : 1) === side)));
    if (p) parts.push(...this.way(p));
    this.svg.replaceChildren(...parts);
  }

  /** The labels of one side, from top to bottom without overlap. */
  private side(side: number, marks: PictureMark[]): SVGElement[] {
    const { width_mm, height_mm, scale } = this.size;
    const [w, h] = [width_mm * scale, height_mm * scale];
    const letters = Math.max(12, Math.floor((0.4 * w) / LETTER_PX));
    const rows: Row[] = [...marks]
      .sort((a, b) => a.depth_mm - b.depth_mm)
      .map((mark) => ({ mark, lines: [...wrap(mark.name, letters), ...(mark.why ? wrap(mark.why, letters) : [])], y: this.beside(mark, side, letters) }));
    let floor = 24;
    for (const row of rows) {
      row.y = Math.max(floor, row.y);
      floor = row.y + ROW_PX * row.lines.length + 4;
    }
    const over = Math.max(0, floor - (h - 8));
    for (const row of rows) row.y = Math.max(14, row.y - over);
    return rows.flatMap((row) => this.row(row, side, w));
  }

  /** Where the label of a mark begins: at its height when there is room beside the ring, else below it. */
  private beside(mark: PictureMark, side: number, letters: number): number {
    const { width_mm, scale, top_mm } = this.size;
    const room = (width_mm / 2 - Math.abs(mark.x_mm) - mark.half_mm) * scale - GAP_PX - EDGE_PX;
    const middle = (mark.depth_mm - top_mm) * scale;
    const long = Math.min(letters, Math.max(mark.name.length, mark.why.length)) * LETTER_PX;
    return side !== 0 && room > long ? middle : middle + Math.max(6, mark.flat_mm * scale + GAP_PX) + ROW_PX;
  }

  private row(row: Row, side: number, w: number): SVGElement[] {
    const { width_mm, scale, top_mm } = this.size;
    const { mark, lines } = row;
    const [cx, cy] = [(width_mm / 2 + mark.x_mm) * scale, (mark.depth_mm - top_mm) * scale];
    const [rx, ry] = [Math.max(6, mark.half_mm * scale + GAP_PX), Math.max(6, mark.flat_mm * scale + GAP_PX)];
    const x = side < 0 ? EDGE_PX : w - EDGE_PX;
    const long = Math.max(...lines.map((l) => l.length)) * LETTER_PX;
    const end = side < 0 ? x + long + 4 : x - long - 4;
    const apart = side < 0 ? cx - rx - end : end - cx - rx;
    const names = wrap(mark.name, Math.max(12, Math.floor((0.4 * w) / LETTER_PX))).length;
    const kind = `${mark.kind}${mark.wanted ? " wanted" : ""}`;
    const text = draw("text", { class: kind, "text-anchor": side < 0 ? "start" : "end" });
    lines.forEach((line, k) => text.append(draw("tspan", { x, y: row.y + k * ROW_PX + 4, class: k < names ? "name" : "why" }, line)));
    return [
      draw("ellipse", { cx, cy, rx, ry, class: kind }),
      // Beside the ring, or far below it, a line leads to it; a label right below needs none.
      ...(apart > 2 ? [draw("path", { d: `M${end} ${row.y}L${cx + side * rx} ${cy}`, class: kind })]
        : row.y > cy + ry + 2 * ROW_PX ? [draw("path", { d: `M${cx + side * Math.min(rx, Math.abs(end - cx))} ${row.y - 9}L${cx + 0.7 * side * rx} ${cy + 0.7 * ry}`, class: kind })] : []),
      text,
    ];
  }

  /** An arrow at the edge towards which the probe slides; along the leg it is said in words. */
  private way(p: Picture): SVGElement[] {
    if (!p.way) return [];
    const { width_mm, height_mm, scale } = this.size;
    const [w, h] = [width_mm * scale, height_mm * scale];
    const parts: SVGElement[] = [];
    const aside = p.aside_mm ?? 0;
    const along = Math.abs(p.along_mm ?? 0) > 0;
    if (!along || Math.abs(aside) > 6) {
      const s = aside < 0 ? -1 : 1;
      const [x, y] = [s < 0 ? 18 : w - 18, h - 46];
      parts.push(draw("path", { class: "arrow", d: `M${x - s * 46} ${y - 7}h${s * 28}v-9l${s * 22} 16l${-s * 22} 16v-9h${-s * 28}z` }));
      const words = `${Math.abs(aside).toFixed(0)} mm to this side`;
      parts.push(draw("text", { class: "way", x: s < 0 ? 10 : w - 10, y: y + 32, "text-anchor": s < 0 ? "start" : "end" }, words));
    }
    if (along) {
      const words = `Slide ${p.way}`;
      const half = (words.length * 7.2) / 2 + 14;
      parts.push(draw("rect", { class: "plate", x: w / 2 - half, y: 8, width: 2 * half, height: 26, rx: 13 }), draw("text", { class: "way", x: w / 2, y: 26, "text-anchor": "middle" }, words));
    }
    return parts;
  }
}
