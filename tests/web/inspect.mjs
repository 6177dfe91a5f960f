// What is wrong with the page as it stands: controls without a name, text of too little contrast,
// things that overlap or are cut off. Each function runs in the page and returns sentences.

export function nameFaults() {
  const seen = (e) => e.checkVisibility({ visibilityProperty: true }) && e.getBoundingClientRect().width > 0;
  const named = (e) => {
    const by = e.getAttribute("aria-labelledby");
    const labels = e.labels ? [...e.labels].map((l) => l.textContent).join(" ") : "";
    return (e.getAttribute("aria-label") || (by && document.getElementById(by)?.textContent) || labels || e.textContent || "").trim();
  };
  const all = document.querySelectorAll("button, a[href], input, select, textarea, canvas:not([aria-hidden]), dialog[open], [role]:not([role=alert]):not([role=status]), [tabindex='0']");
  return [...all].filter((e) => seen(e) && !named(e)).map((e) => `no name: ${e.outerHTML.slice(0, 90)}`);
}

export function contrastFaults() {
  const LEAST = 4.5;
  const parse = (c) => (c.match(/[\d.]+/g) ?? []).map(Number);
  const light = ([r, g, b]) => {
    const f = (v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4);
    return 0.2126 * f(r) + 0.7152 * f(g) + 0.0722 * f(b);
  };
  const over = (top, below) => top.slice(0, 3).map((v, i) => v * (top[3] ?? 1) + below[i] * (1 - (top[3] ?? 1)));
  const ground = (e) => {
    const layers = [];
    for (let p = e; p; p = p.parentElement) {
      const c = parse(getComputedStyle(p).backgroundColor);
      if ((c[3] ?? 1) > 0) layers.push(c);
      if ((c[3] ?? 1) === 1) break;
    }
    return layers.reverse().reduce((below, top) => over(top, below), [10, 13, 17]);
  };
  const modal = document.querySelector("dialog[open]");
  const faults = [];
  const walker = document.createTreeWalker(modal ?? document.body, NodeFilter.SHOW_TEXT);
  for (let n = walker.nextNode(); n; n = walker.nextNode()) {
    const e = n.parentElement;
    const svg = e instanceof SVGElement;
    if (!n.textContent.trim() || !e.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
    if (e.closest("script, style, :disabled, .unseen, option")) continue;
    const style = getComputedStyle(e);
    const back = ground(e);
    let front = over(parse(svg ? style.fill : style.color), back);
    for (let p = e; p; p = p.parentElement) front = over([...front, Number(getComputedStyle(p).opacity)], back);
    const [a, b] = [light(front), light(back)].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < LEAST) faults.push(`contrast ${ratio.toFixed(2)}: "${n.textContent.trim().slice(0, 40)}" (${e.className || e.id || e.tagName})`);
  }
  return faults;
}

export function layoutFaults() {
  const seen = (e) => e.checkVisibility({ visibilityProperty: true }) && e.getBoundingClientRect().width > 0;
  const name = (e) => e.id || e.className || e.textContent.trim().slice(0, 20) || e.tagName;
  const faults = [];
  const root = document.documentElement;
  if (root.scrollWidth > innerWidth || root.scrollHeight > innerHeight) faults.push("the page scrolls");
  const modal = document.querySelector("dialog[open]");
  const groups = modal
    ? [modal, ...modal.querySelectorAll(".actions, .top, .columns")]
    : [...document.querySelectorAll("header, #bar > div, #step, #findings, #segments, #decisions, #replay-head, #replay-track, .tools, #sliders, .slider, #press, #press-slider, #press-foot, #bottom-head, #readouts, main, #left, #right, #comment-form")];
  for (const group of groups.filter(seen)) {
    const box = group.getBoundingClientRect();
    const scrolls = /auto|scroll/.test(getComputedStyle(group).overflowX + getComputedStyle(group).overflowY);
    if (group.closest("main") !== group && [...document.querySelectorAll("main")].some((m) => m.contains(group) && m.scrollHeight > m.clientHeight + 1 && box.bottom > m.getBoundingClientRect().bottom)) continue; // reached by scrolling
    if (getComputedStyle(group).display === "contents") continue;
    if (box.left < -0.5 || box.top < -0.5 || box.right > innerWidth + 0.5 || box.bottom > innerHeight + 0.5) faults.push(`${name(group)} leaves the window`);
    const parts = [...group.children].filter((e) => seen(e) && !e.closest(".unseen") && getComputedStyle(e).position !== "fixed");
    parts.forEach((a, i) => {
      const p = a.getBoundingClientRect();
      if (!scrolls && (p.right > box.right + 1.5 || p.left < box.left - 1.5 || p.bottom > box.bottom + 1.5 || p.top < box.top - 1.5)) faults.push(`${name(a)} leaves ${name(group)}`);
      for (const b of parts.slice(i + 1)) {
        const q = b.getBoundingClientRect();
        const [w, h] = [Math.min(p.right, q.right) - Math.max(p.left, q.left), Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top)];
        if (w > 1.5 && h > 1.5) faults.push(`${name(a)} overlaps ${name(b)}`);
      }
    });
  }
  const words = [...document.querySelectorAll("button, .caption, output, .readout b, .segment .name")].filter((e) => seen(e) && (!modal || modal.contains(e)));
  for (const e of words) if (e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0 && getComputedStyle(e).display !== "inline") faults.push(`"${e.textContent.trim()}" is cut`);
  return faults;
}
