// node bench/stage2_edges.mjs: how the error of the paper's own estimation (stage 2) depends on the
// edges that leave the footprints. Flat skin, nominal areas; per site k0 and x_m, for all one edge
// stiffness. Prints a row for each setting (docs/estimation.md).
import { readFileSync } from 'node:fs'
const AREA = { linear: 720e-6, point: 36e-6 }, EDGE_M = 3e-3
const [head, ...lines] = readFileSync(new URL('../data/thigh/indentation.csv', import.meta.url), 'utf8').trim().split('\n').map(line => line.split(','))
const column = Object.fromEntries(head.map((name, k) => [name, k]))
const rows = lines.map(cell => ({ site: cell[column.site], probe: cell[column.probe], depth: 1e-3 * cell[column.penetration_mm], force: +cell[column.force_n] }))

// Where f is least between low and high, by golden section.
function least(f, low, high, steps) {
  const share = (Math.sqrt(5) - 1) / 2
  let a = high - share * (high - low), b = low + share * (high - low), fa = f(a), fb = f(b)
  for (let k = 0; k < steps; ++k)
    if (fa < fb) { high = b, b = a, fb = fa, a = high - share * (high - low), fa = f(a) }
    else { low = a, a = b, fa = fb, b = low + share * (high - low), fb = f(b) }
  return (low + high) / 2
}

// Mean absolute errors in percent with `edges` edges leaving each footprint.
function fit(edges, floor, deepest, relative) {
  const data = rows.filter(row => row.depth <= deepest + 1e-9), mean = {}, sites = new Map()
  for (const probe of Object.keys(AREA)) {
    const own = data.filter(row => row.probe === probe)
    mean[probe] = own.reduce((sum, row) => sum + row.force, 0) / own.length
  }
  for (const row of data) {
    const long = Math.hypot(EDGE_M, row.depth)
    const item = { ...row, weight: relative ? 1 / mean[row.probe] : 1, pull: edges[row.probe] * (long - EDGE_M) * row.depth / long }
    sites.set(row.site, [...sites.get(row.site) ?? [], item])
  }
  const model = (k0, xm, ks) => row => k0 * AREA[row.probe] * row.depth / (1 - row.depth / xm) + ks * row.pull
  function site(list, ks) { // k0 follows from x_m in closed form
    const deep = Math.max(...list.map(row => row.depth)), low = floor > 0 ? Math.max(floor, deep) : deep / 0.97
    const at = logarithm => {
      const xm = low + Math.exp(logarithm), unit = model(1, xm, 0)
      let product = 0, square = 0
      for (const row of list) product += row.weight ** 2 * unit(row) * (row.force - ks * row.pull), square += (row.weight * unit(row)) ** 2
      const force = model(Math.max(product / square, 1e-9), xm, ks)
      return { force, cost: list.reduce((sum, row) => sum + (row.weight * (force(row) - row.force)) ** 2, 0) }
    }
    return at(least(z => at(z).cost, Math.log(1e-6), 0, 32))
  }
  const cost = ks => [...sites.values()].reduce((sum, list) => sum + site(list, ks).cost, 0)
  const ks = edges.point > 0 ? least(cost, 0, 200, 16) : 0, off = { all: 0 }, all = { all: 0 }
  for (const list of sites.values()) {
    const { force } = site(list, ks)
    for (const row of list)
      for (const of of [row.probe, 'all']) off[of] = (off[of] ?? 0) + Math.abs(force(row) - row.force), all[of] = (all[of] ?? 0) + row.force
  }
  const percent = of => (100 * off[of] / all[of]).toFixed(1)
  return { rows: data.length, ks, linear: percent('linear'), point: percent('point'), both: percent('all') }
}

const GRID = { linear: 52, point: 12 } // of 21 x 5 and 3 x 3 nodes at 3 mm, aligned with the probe
const SETTINGS = [
  ['edges 6.6 to 1, as on the skin', { linear: 6.6 * 12, point: 12 }, 0, 1],
  ['the same, x_m >= 30.2 mm', { linear: 6.6 * 12, point: 12 }, 30.2e-3, 1],
  ['edges 5.5 to 1, x_m >= 30.2 mm', { linear: 5.5 * 12, point: 12 }, 30.2e-3, 1],
  ['grid of 3 mm, 4.3 to 1', GRID, 0, 1],
  ['the same, x_m >= 30.2 mm', GRID, 30.2e-3, 1],
  ['the same, rows to 26 mm', GRID, 30.2e-3, 26e-3],
  ['edges 3.3 to 1, x_m >= 30.2 mm', { linear: 3.3 * 12, point: 12 }, 30.2e-3, 1],
  ['no edges, x_m >= 30.2 mm', { linear: 0, point: 0 }, 30.2e-3, 1],
  ['grid, relative weights, x_m >= 30.2 mm', GRID, 30.2e-3, 1, true]
]
for (const [name, ...setting] of SETTINGS) {
  const r = fit(...setting)
  console.log(`${name.padEnd(40)} ${r.rows} rows, ${r.ks.toFixed(1)} N/m: linear ${r.linear} %, point ${r.point} %, both ${r.both} %`)
}
