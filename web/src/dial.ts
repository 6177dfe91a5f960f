// The angle of the image plane from transverse: a needle over an arc whose middle is what is asked.

import { draw } from "./dom";
import { t } from "./words/language";

const ALLOWED_DEG = 20;
const END_DEG = 60;
const RADIUS = 40;

const at = (deg: number, r: number): [number, number] => {
  const a = ((deg - 90) * Math.PI) / 180;
  return [60 + r * Math.cos(a), 54 + r * Math.sin(a)];
};

function arc(from: number, to: number): string {
  const [a, b] = [at(from, RADIUS), at(to, RADIUS)];
  return `M${a[0]} ${a[1]}A${RADIUS} ${RADIUS} 0 0 1 ${b[0]} ${b[1]}`;
}

export class Dial {
  private readonly needle = draw("line", { x1: 60, y1: 54, x2: 60, y2: 18, class: "needle" });
  private readonly value = draw("text", { x: 60, y: 72, "text-anchor": "middle" });

  constructor(private readonly box: HTMLElement) {
    const svg = draw("svg", { viewBox: "0 0 120 78", role: "img", "aria-label": t("dial.label") });
    svg.append(
      draw("path", { d: arc(-END_DEG, END_DEG), class: "arc" }),
      draw("path", { d: arc(-ALLOWED_DEG, ALLOWED_DEG), class: "arc good" }),
      this.needle,
      draw("circle", { cx: 60, cy: 54, r: 3.5, class: "hub" }),
      this.value,
    );
    box.append(svg);
  }

  show(angle_deg: number | null, ok: boolean): void {
    this.box.hidden = angle_deg === null;
    if (angle_deg === null) return;
    const [x, y] = at(Math.max(-END_DEG, Math.min(END_DEG, angle_deg)), RADIUS - 6);
    this.needle.setAttribute("x2", String(x));
    this.needle.setAttribute("y2", String(y));
    this.box.classList.toggle("ok", ok);
    this.value.textContent = t("dial.off", { deg: Math.abs(angle_deg).toFixed(0) });
  }
}
