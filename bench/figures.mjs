// Figures of the documents: measured by commands, kept in bench/figures, inserted by a command.
//
//   node bench/figures.mjs measure BIN [GROUP...]   runs the group's commands from BIN (build/release/bin)
//                                                   and writes bench/figures/GROUP.json
//   node bench/figures.mjs insert                   writes the figures into README.md and docs/*.md
//   node bench/figures.mjs check [ROOT]             exit 1 when a document differs from its figures or
//                                                   names one that is not there; tells figures whose
//                                                   sources have changed since they were measured
//
// A document holds a figure between two comments, its name and its decimals in the first:
//   <!--image.avx512.frame_ms 1-->4.5<!---->
// and a table, or the output of a program word for word, between two comments on lines of their own:
//   <!--block fit_errors-->
//   ...
//   <!--end block-->
import { execFileSync } from 'node:child_process'
import { createHash } from 'node:crypto'
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from 'node:fs'
import { cpus, tmpdir } from 'node:os'
import { dirname, join, relative } from 'node:path'
import { fileURLToPath } from 'node:url'

const HOME = join(dirname(fileURLToPath(import.meta.url)), '..')
const BLOCK = /<!--block (\w+)-->\n(.*?)<!--end block-->/gs
const FIGURE = /<!--([a-z]\w*(?:\.\w+)+) (\d)-->(.*?)<!---->/gs

const run = (bin, program, ...options) =>
  execFileSync(join(bin, program), options, { encoding: 'utf8', cwd: HOME, maxBuffer: 1 << 26 })
// Output of a program that ends with 1 when it found what it looks for.
const found = (bin, program, ...options) => {
  try {
    return run(bin, program, ...options)
  } catch (failed) {
    if (failed.status !== 1) throw failed
    return failed.stdout
  }
}
const spread = (runs, of) => {
  const all = runs.map(of).sort((a, b) => a - b)
  return { least: all[0], median: all[all.length >> 1], most: all[all.length - 1] }
}

// Rows by the names of the columns of the table that a program writes.
const table_of = (bin, program) => {
  const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-')), path = join(folder, 'table.csv')
  run(bin, program, path)
  const [head, ...rows] = readFileSync(path, 'utf8').trim().split('\n').map(line => line.split(','))
  rmSync(folder, { recursive: true })
  return rows.map(row => Object.fromEntries(head.map((name, k) => [name, row[k]])))
}

// A script under the system's interpreter with the package of the build.
const python = (bin, ...options) =>
  JSON.parse(execFileSync('/usr/bin/python3', options, { encoding: 'utf8', cwd: HOME, maxBuffer: 1 << 26,
    env: { ...process.env, PYTHONPATH: [join(bin, '..', 'python'), join(HOME, '..', 'shared', 'peers', 'python'), process.env.PYTHONPATH ?? ''].join(':') } }))
const json = (bin, ...options) => JSON.parse(run(bin, 'sonde', ...options, '--json'))
const engine = ['src/sonde/world', 'src/sonde/tissue', 'src/sonde/sparse']
const thigh = ['--surface', 'data/thigh/skin.ply', '--sites', 'data/thigh/sites.csv']

// Seed, sex and BMI of the legs whose flow is measured.
const FLOW_LEGS = [['29', 'female', '19.5'], ['3', 'male', '24'], ['7', 'female', '31'], ['12', 'male', '34']]

// What a group measures: the sources that its figures depend on, and its values by name.
const GROUPS = {
  // Bars of the lessons, and scripted learners who look for the views of their places.
  course: {
    sources: ['src/sonde-exam/trainer/learner.c', 'src/sonde-exam/trainer/picture.c', 'data/course'],
    measure: bin => ({ search: json(bin, 'course', '--search', '--learners', '20'), lessons: json(bin, 'course') }),
  },
  fit: {
    sources: ['src/sonde-fit/fit', ...engine, 'data/thigh'],
    measure(bin) {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-'))
      const values = {}
      for (const [name, ...options] of [['stage1', '--stages', '1'], ['stage2', '--stages', '2'], ['stage3', '--stages', '3'],
        ['hold_out', '--stages', '3', '--hold-out', 'sites']])
        values[name] = json(bin, 'fit', 'data/thigh/indentation.csv', ...thigh, ...options, '-o', join(folder, `${name}.sonde`))
      rmSync(folder, { recursive: true })
      return values
    },
  },
  // Moduli of the solid from four sites, beside the springs from all; and with a fat thickness that is wrong by up to 1.5 mm, in waves over the thigh.
  solid: {
    sources: ['src/sonde-solid', 'src/sonde-fit/fit/solid.c', 'data/thigh'],
    measure(bin) {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-')), wrong = join(folder, 'muscle.ply')
      const [head, body] = readFileSync(join(HOME, 'data/thigh/muscle_surface.ply'), 'utf8').split('end_header\n')
      const count = Number(/element vertex (\d+)/.exec(head)[1]), lines = body.split('\n')
      const corners = lines.slice(0, count).map(line => line.split(' ').map(Number))
      const middle = k => corners.reduce((sum, p) => sum + p[k], 0) / count, cx = middle(0), cy = middle(1)
      const moved = corners.map(([x, y, z]) => {
        const r = Math.hypot(x - cx, y - cy), grow = 1 + 1.5 * Math.sin(2 * Math.atan2(y - cy, x - cx) + z / 30) / Math.max(r, 1)
        return [cx + grow * (x - cx), cy + grow * (y - cy), z].map(c => c.toFixed(6)).join(' ')
      })
      writeFileSync(wrong, `${head}end_header\n${[...moved, ...lines.slice(count)].join('\n')}`)
      const fit = (...options) => {
        const r = json(bin, 'fit', 'data/thigh/indentation.csv', ...thigh, '--solid', '--at', '0,21,36,49', '--check', '4,17,32,53',
          '--also', 'data/thigh/indentation_square.csv', '-o', join(folder, 'moduli.csv'), ...options)
        const errors = e => ({ ln_rms_percent: 100 * e.ln_rms, count: e.all.count, all_percent: e.all.mae_percent,
          ...Object.fromEntries(Object.entries(e.probes).map(([name, p]) => [`${name}_percent`, p.mae_percent])) })
        const parts = Object.fromEntries(['fitted', 'left_out', 'never_fitted'].map(key =>
          [key, { ...errors(r[key]), ...(r[key].springs ? { springs: errors(r[key].springs) } : {}) }]))
        return { ...parts, moduli: r.moduli, steps: r.steps, processor_s: r.processor_s, start_ln_rms_percent: 100 * r.start_ln_rms }
      }
      const values = { right: fit('--beside'), thick: fit('--muscle', wrong, '--edge-mm', '10', '--growth', '2.2') }
      rmSync(folder, { recursive: true })
      return values
    },
  },
  // Forces of site 27 on three meshes.
  solid_mesh: {
    sources: ['src/sonde-solid', 'data/thigh'],
    measure(bin) {
      const meshes = { coarse: ['--edge-mm', '10', '--growth', '2.2', '--through', '3:2:1'], default: [], fine: ['--edge-mm', '3.4', '--growth', '1.7', '--through', '5:3:1'] }
      const values = {}
      for (const [name, options] of Object.entries(meshes))
        for (const contact of ['bonded', 'slip']) {
          const r = json(bin, 'solve', '--site', '27', '--contact', contact, '--depths', '2,6,10,14,20', ...(contact === 'slip' ? ['--rounding-mm', '3'] : []), ...options)
          values[`${name}_${contact}`] = { unknowns: r.unknowns, force_n: Object.fromEntries(r.depths.map(d => [`at_${Math.round(d.depth_mm)}`, d.force_n])),
            steps: r.depths.reduce((sum, d) => sum + d.steps, 0) }
        }
      return values
    },
  },
  // The live solid beside the equilibrium, at three speeds to two depths.
  ...Object.fromEntries([14, 22].map(depth => [`solid_live_${depth}`, { sources: ['src/sonde-solid', 'bench/bench_live.c', 'data/thigh'],
    measure: bin => JSON.parse(run(bin, 'bench_live', join(bin, '../share/sonde/thigh.sonde'), `${depth}`)) }])),
  solid_live_sites: { sources: ['src/sonde-solid', 'bench/bench_live.c', 'data/thigh'],
    measure: bin => Object.fromEntries(['4', '19', '36', '45'].map(site => [site, JSON.parse(run(bin, 'bench_live', join(bin, '../share/sonde/thigh.sonde'), '22', site))])) },
  // Ten limbs under a probe that the solid bears, poked at random; the sum of what was counted, the most of what was felt.
  poke_solid: {
    sources: ['src/sonde-solid', 'src/sonde-exam/exam', 'src/sonde-limb', 'bench/bench_poke_solid.c'],
    measure(bin) {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-')), path = join(folder, 'limb.sonde'), all = {}
      for (let seed = 1; seed <= 10; ++seed) {
        run(bin, 'sonde', 'limb', '--seed', `${seed}`, '--model', path)
        for (const [name, value] of Object.entries(JSON.parse(found(bin, 'bench_poke_solid', path, '60000', `${seed}`))))
          all[name] = /most|handed/.test(name) ? Math.max(all[name] ?? 0, value) : /least/.test(name) ? Math.min(all[name] ?? 0, value) : (all[name] ?? 0) + value
      }
      rmSync(folder, { recursive: true })
      return all
    },
  },
  closure: {
    sources: ['src/sonde/interior', 'src/sonde-fit/fit', ...engine, 'data/thigh'],
    measure(bin) {
      const values = {}
      for (const force of ['2', '4', '6', '8']) {
        const press = name => json(bin, 'press', '--site', '27', '--probe', 'linear', '--force-n', force, '--case', name)
        const healthy = press('healthy')
        values[`at_${force}_n`] = { healthy: healthy.vein_area_ratio, artery: healthy.artery_area_ratio, chronic: press('chronic_occlusive').vein_area_ratio }
      }
      return values
    },
  },
  likeness: {
    sources: ['src/sonde/echo'],
    measure(bin) {
      const result = json(bin, 'validate', 'image', '--quick'), values = {}
      for (const [name, entry] of Object.entries(result)) values[name] = entry.value
      const all = Object.entries(values).filter(([name]) => name.startsWith('likeness_')).map(([, value]) => value)
      return { ...values, least: Math.min(...all), most: Math.max(...all) }
    },
  },
  haptics: {
    sources: ['src/sonde/haptics', 'app/validate_haptics.c', ...engine],
    measure(bin) {
      const values = {}
      for (const [name, entry] of Object.entries(JSON.parse(found(bin, 'sonde', 'validate', 'haptics', '--json')))) values[name] = entry.value
      return values
    },
  },
  operators: {
    sources: ['src/sonde-exam', 'src/sonde/interior', ...engine, 'data/cases', 'data/protocols'],
    measure(bin) {
      const values = json(bin, 'exam', '--compare', '--protocol', 'three_point', '-o', mkdtempSync(join(tmpdir(), 'sonde-figures-')))
      const operators = ['expert', 'novice', 'timid', 'forceful']
      values.passed = Object.fromEntries(operators.map(name => [name, values[name].passed]))
      return values
    },
  },
  paper: {
    sources: ['src/sonde-fit', 'src/sonde-scene', 'src/sonde-sweep', 'src/sonde/geometry', 'src/sonde/echo', 'src/sonde/interior', ...engine,
      ...['bulk', 'collision', 'curves', 'equal', 'fit', 'models', 'pressed', 'solvers', 'speed', 'steps', 'sweep'].map(name => `app/paper_${name}.c`), 'data/thigh'],
    measure(bin) {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-'))
      // Processor time of ended children, in hundredths of a second: what others do on the machine does not count.
      const used = () => readFileSync('/proc/self/stat', 'utf8').split(') ')[1].split(' ').slice(13, 15).reduce((a, b) => a + Number(b), 0)
      const before = used(), values = json(bin, 'paper', '-o', folder)
      values.processor_minutes = (used() - before) / 6000
      rmSync(folder, { recursive: true })
      return values
    },
  },
  // Programs that print tables; the documents show what they print.
  solver: { sources: [...engine, 'app/solver_cost.c', 'bench/bench_solver.c'], measure: bin => ({ output: run(bin, 'bench_solver') }) },
  accuracy: { sources: [...engine, 'app/step_cost.c', 'bench/bench_accuracy.c'], measure: bin => ({ output: run(bin, 'bench_accuracy', '1962') }) },
  step: {
    sources: [...engine, 'src/sonde/haptics'],
    measure(bin) {
      const values = {}
      for (const scene of ['press', 'slide', 'point']) {
        const runs = Array.from({ length: 5 }, () => json(bin, 'bench', '--scene', scene))
        values[scene] = {
          steps_per_s: spread(runs, r => r.steps_per_s), median_ms: spread(runs, r => r.step_ms.median), p99_ms: spread(runs, r => r.step_ms.p99),
          max_ms: spread(runs, r => r.step_ms.max), error_percent: 100 * runs[0].relative_error, iterations: runs[0].iterations,
        }
      }
      return values
    },
  },
  ellipsoid: {
    sources: engine,
    measure(bin) {
      const values = {}
      for (const [nodes, sleep] of [['1962', '50'], ['7842', '10'], ['32492', '50']]) {
        const r = json(bin, 'bench', '--scene', 'ellipsoid', '--nodes', nodes, '--sleep-um', sleep, '--repeat', '5')
        values[`nodes_${nodes}`] = { steps_per_s: r.steps_per_s, error_percent: 100 * r.relative_error, awake: r.awake_nodes, iterations: r.iterations }
      }
      return values
    },
  },
  batch: {
    sources: ['src/sonde-exam/batch', 'src/sonde/interior', 'bench/batch.py', ...engine],
    measure: bin => python(bin, 'bench/batch.py').values,
  },
  learner: {
    sources: ['src/sonde-exam/batch', 'python/sonde/tasks.py', 'python/examples/learn_reach.py'],
    measure: bin => python(bin, 'python/examples/learn_reach.py', '--json'),
  },
  image: {
    sources: ['src/sonde/echo', 'src/sonde/interior'],
    // The bundled thigh by the plain scanner, then a whole limb by one that ships.
    measure(bin) {
      const values = { limb: {} }, folder = mkdtempSync(join(tmpdir(), 'sonde-figures-')), path = join(folder, 'limb.sonde')
      run(bin, 'sonde', 'limb', '--seed', '3', '--bmi', '24', '--model', path)
      for (const kernels of ['avx512', 'avx2', 'sse4', 'base']) {
        const bench = (...options) =>
          json(bin, 'bench', ...options, '--scene', 'image', '--frames', '100', '--kernels', kernels)
        const take = r => ({ frame_ms: r.frame_ms.median, p99_ms: r.frame_ms.p99, ...r.stages_ms })
        const thigh = bench(), limb = bench(path, '--scanner', 'venous')
        values[kernels] = take(thigh), values.limb[kernels] = take(limb)
        values.scatterers = thigh.scatterers, values.limb.scatterers = limb.scatterers
      }
      rmSync(folder, { recursive: true })
      return values
    },
  },
  // Programs of learners at once, each with a session of its own, without a page.
  class: {
    sources: ['app', 'src/sonde-exam', 'src/sonde/echo', ...engine],
    measure: bin => Object.fromEntries([1, 2, 4, 6, 8].map(learners => {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-'))
      execFileSync('bash', ['-c', 'for ((k = 0; k < $1; ++k)); do "$2" run "$3" --headless --seconds 10 --json >"$4/$k" & done; wait',
        'class', `${learners}`, join(bin, 'sonde'), join(bin, '../share/sonde/leg.sonde'), folder], { cwd: HOME })
      const runs = readdirSync(folder).map(name => JSON.parse(readFileSync(join(folder, name), 'utf8')))
      rmSync(folder, { recursive: true })
      return [`learners_${learners}`, {
        images_per_s: spread(runs, r => r.images / r.wall_s),
        left_out_percent: spread(runs, r => 100 * r.deadline_misses / (r.ticks + r.deadline_misses)),
        pose_to_image_ms: spread(runs, r => r.pose_to_image_ms.median), pose_to_image_p99_ms: spread(runs, r => r.pose_to_image_ms.p99) }]
    })),
  },
  session: {
    sources: ['src/sonde/world', 'src/sonde/haptics', 'src/sonde-exam/exam', 'src/sonde/echo', 'src/sonde/interior'],
    measure(bin) {
      const runs = []
      for (let k = 0; k < 3; ++k)
        runs.push(JSON.parse(run(bin, 'sonde', 'run', '--headless', '--seconds', '8', '--json')))
      return {
        ticks: spread(runs, r => r.ticks),
        late: spread(runs, r => r.deadline_misses),
        tick_mean_ms: spread(runs, r => r.tick_mean_ms),
        tick_max_ms: spread(runs, r => r.tick_max_ms),
        images_per_s: spread(runs, r => r.images / r.wall_s),
        pose_to_image_ms: spread(runs, r => r.pose_to_image_ms.median),
        pose_to_image_p99_ms: spread(runs, r => r.pose_to_image_ms.p99),
      }
    },
  },
  // Many subjects by one process and by two ranks of MPI.
  cohort: {
    sources: ['app/fit_cohort.c', 'bench/cohort.py', 'src/sonde-fit/fit'],
    measure: bin => python(bin, 'bench/cohort.py', bin),
  },
  // Frames that readers of OpenIGTLink get at 60 Hz beside one that never reads.
  igtl: {
    sources: ['src/sonde-exam/stream/igtl_message.c', 'src/sonde-exam/stream/igtl_server.c', 'bench/bench_igtl.c', 'bench/igtl.py'],
    measure: bin => python(bin, 'bench/igtl.py', bin),
  },
  // Laws of 200 limbs: sums of faults, shares of limbs whose view is true, and of those of BMI 20 to 35 whose depth is in its band and at most 5 mm beyond it.
  limb: {
    sources: ['src/sonde-limb', 'bench/bench_limb.c', 'bench/limb_laws.c'],
    measure(bin) {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-')), path = join(folder, 'limbs.csv')
      found(bin, 'bench_limb', path)
      const [head, ...rows] = readFileSync(path, 'utf8').trim().split('\n').map(line => line.split(','))
      rmSync(folder, { recursive: true })
      const column = name => rows.map(row => Number(row[head.indexOf(name)]))
      const sum = all => all.reduce((a, b) => a + b, 0), mean = all => sum(all) / all.length
      const values = { limbs: rows.length, places: sum(column('places')) }
      for (const name of ['walls', 'bone', 'lumen', 'fascia', 'eye']) values[name] = sum(column(name))
      const bmi = column('bmi'), known = all => all.filter((_, i) => bmi[i] >= 20 && bmi[i] <= 35)
      for (let k = 1; k <= 11; ++k) {
        const off = known(column(`v${k}_off_mm`))
        values[`v${k}`] = { true_percent: 100 * mean(column(`v${k}`)), in_band_percent: 100 * mean(off.map(mm => Number(mm === 0))), near_band_percent: 100 * mean(off.map(mm => Number(mm <= 5))) }
      }
      values.banded = known(bmi).length
      const error = column('vein_error_mm')
      Object.assign(values, { vein_mean_mm: mean(error), vein_rms_mm: Math.sqrt(mean(error.map(e => e * e))) })
      for (const part of ['thigh', 'calf']) {
        const ratio = column(`${part}_ratio`), middle = mean(ratio)
        values[part] = { ratio: middle, deviation: Math.sqrt(mean(ratio.map(r => (r - middle) ** 2))) }
      }
      return values
    },
  },
  // What Doppler reads off the veins of four legs, and off the network itself; spreads over the legs.
  flow: {
    sources: ['src/sonde-limb', 'app/cmd_doppler.c'],
    measure(bin) {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-')), legs = []
      for (const [seed, sex, bmi] of FLOW_LEGS) {
        const path = join(folder, 'leg.sonde')
        run(bin, 'sonde', 'limb', '--seed', seed, '--sex', sex, '--bmi', bmi, '--model', path)
        const take = (...options) => json(bin, 'doppler', path, ...options)
        legs.push({
          rest: take(), femoral: take('--vessel', 'femoral'), artery: take('--vessel', 'artery'), groin: take('--squeeze-s', '8'),
          knee: take('--vessel', 'popliteal', '--squeeze-s', '8'), leak: take('--vessel', 'popliteal', '--squeeze-s', '8', '--leak', '1'),
          clot: take('--squeeze-s', '8', '--clot', 'external-iliac'), strain: take('--valsalva-s', '6'),
        })
      }
      rmSync(folder, { recursive: true })
      const values = {}, all = (name, of) => { values[name] = spread(legs, of) }
      all('lumen_cm_s', l => l.rest.true_mean_cm_s), all('gate_cm_s', l => l.rest.mean_cm_s), all('peak_cm_s', l => l.rest.peak_cm_s)
      all('femoral_peak_cm_s', l => l.femoral.peak_cm_s), all('artery_peak_cm_s', l => l.artery.peak_cm_s)
      all('phasicity', l => l.rest.phasicity), all('augmentation', l => l.groin.augmentation)
      all('squeeze_peak_cm_s', l => l.knee.peak_cm_s), all('reflux_s', l => l.knee.reflux_s), all('leak_s', l => l.leak.reflux_s)
      all('clot_phasicity', l => l.clot.phasicity), all('clot_augmentation', l => l.clot.augmentation), all('strain_s', l => l.strain.reflux_s)
      values.phasicity_off_percent = Math.max(...legs.map(l => 100 * Math.abs(l.rest.phasicity / l.rest.true_phasicity - 1)))
      values.reflux_off_s = Math.max(...legs.flatMap(l => [l.knee, l.leak, l.strain].map(r => Math.abs(r.reflux_s - r.true_reflux_s))))
      return values
    },
  },
  // What a gate in a picture of the same legs reads off its spectrum, and the truth in it.
  gate: {
    sources: ['src/sonde-limb', 'bench/bench_gate.c'],
    measure(bin) {
      const folder = mkdtempSync(join(tmpdir(), 'sonde-figures-'))
      const paths = FLOW_LEGS.map(([seed, sex, bmi]) => {
        const path = join(folder, `leg-${seed}.sonde`)
        run(bin, 'sonde', 'limb', '--seed', seed, '--sex', sex, '--bmi', bmi, '--model', path)
        return path
      })
      run(bin, 'bench_gate', join(folder, 'table.csv'), ...paths)
      const [head, ...rows] = readFileSync(join(folder, 'table.csv'), 'utf8').trim().split('\n').map(line => line.split(','))
      rmSync(folder, { recursive: true })
      const legs = rows.map((row, k) => ({ ...Object.fromEntries(head.map((name, i) => [name, Number(row[i])])), limb: Number(FLOW_LEGS[k][0]) }))
      return { legs, phasicity_off_percent: Math.max(...legs.map(l => 100 * Math.abs(l.phasicity / l.true_phasicity - 1))) }
    },
  },
  // Forces and cuffs that close the veins of eight limbs at the stations, and what clots leave of them.
  closing: {
    sources: ['src/sonde-limb', 'src/sonde/interior', ...engine, 'bench/bench_closing.c'],
    measure(bin) {
      const rows = table_of(bin, 'bench_closing'), number = text => text === '' ? null : Number(text)
      const veins = rows.map(r => ({ ...Object.fromEntries(Object.entries(r).map(([key, text]) => [key, ['sex', 'station', 'vein'].includes(key) ? text : number(text)])) }))
      const closed = veins.filter(v => v.closed), early = closed.filter(v => v.force_n < v.least_n), late = closed.filter(v => v.force_n > v.most_n)
      return { veins, count: veins.length, within: closed.length - early.length - late.length, early: early.length, late: late.length, open: veins.length - closed.length,
        most_late_percent: Math.max(0, ...late.map(v => 100 * (v.force_n / v.most_n - 1))) }
    },
  },
  // A scripted expert and a novice on every bundled case from groin to calf: some hours, see SONDE_WHOLE_LEG.
  whole_leg: {
    sources: ['src/sonde-exam', 'src/sonde/interior', 'src/sonde-limb', ...engine, 'data/cases', 'data/protocols', 'bench/whole_leg.mjs'],
    measure: bin => JSON.parse(execFileSync(process.execPath, ['bench/whole_leg.mjs', join(bin, 'sonde')], { encoding: 'utf8', cwd: HOME })),
  },
  // What ten whole legs cost.
  legs: {
    sources: ['src/sonde-limb', 'src/sonde/interior', 'src/sonde/echo', ...engine, 'bench/bench_legs.c'],
    measure(bin) {
      const rows = table_of(bin, 'bench_legs')
      return { count: rows.length, ...Object.fromEntries(Object.keys(rows[0]).filter(key => key !== 'seed').map(key => [key, spread(rows, r => Number(r[key]))])) }
    },
  },
  hostile: {
    sources: ['src/sonde/interior', 'src/sonde/world'],
    measure(bin) {
      const sum = { pictures: 0, folded: 0, points: 0, folded_points: 0, inverses: 0, lost: 0, misfits: 0, most_n: 0 }
      for (const seed of ['1', '2', '3']) {
        const text = found(bin, 'bench_hostile', 'data/cases', '1', seed)
        const [, pictures, force, folded] = /(\d+) pictures, force to ([\d.]+) N: (\d+) folded/.exec(text).map(Number)
        const [, foldedPoints, points] = /(\d+) of (\d+) points folded/.exec(text).map(Number)
        const [, lost, inverses] = /(\d+) of (\d+) inverses off/.exec(text).map(Number)
        const [, misfits] = /(\d+) cases did not fit/.exec(text).map(Number)
        sum.pictures += pictures, sum.folded += folded, sum.points += points, sum.folded_points += foldedPoints
        sum.inverses += inverses, sum.lost += lost, sum.misfits = misfits, sum.most_n = Math.max(sum.most_n, force)
      }
      return sum
    },
  },
}

const table = (head, rows) =>
  [head, head.map(() => '---'), ...rows].map(row => `| ${row.join(' | ')} |`).join('\n')
const fenced = text => '```\n' + text.trimEnd() + '\n```'
const fixed = (value, decimals) => value.toLocaleString('en-US', { minimumFractionDigits: decimals, maximumFractionDigits: decimals })

// Times of pictures by instruction set.
const frames = image => table(['kernels', 'frame', '99 %', 'plane', 'medium', 'scatterers', 'beam', 'picture'],
  ['avx512', 'avx2', 'sse4', 'base'].map(name => [name, ...['frame_ms', 'p99_ms'].map(key => fixed(image[name][key], 1)),
    ...['plane', 'medium', 'scatter', 'beam', 'picture'].map(key => fixed(image[name][key], 2))]))

// What the blocks of the documents show, from the groups' values; undefined where a group is not measured.
const BLOCKS = {
  course_search({ course }) {
    const name = { full: 'full', hints: 'names alone', exam: 'none' }
    return table(['guidance', 'found', 'path, median', '90 %', 'ticks of 1 ms, median', '90 %'],
      Object.entries(course.search).map(([level, e]) => [name[level], `${e.found} of ${e.searches}`, `${fixed(e.path_mm, 0)} mm`, `${fixed(e.path_p90_mm, 0)} mm`, fixed(e.ticks, 0), fixed(e.ticks_p90, 0)]))
  },
  course_bars({ course }) {
    return table(['lesson', 'places', 'runs', 'expert, score', 'time', 'path', 'bar'],
      Object.values(course.lessons).map(l => [l.title, l.places, l.runs, `${fixed(l.score_mean, 1)} ± ${fixed(l.score_sd, 1)}`, `${fixed(l.time_mean_s, 1)} s`, `${fixed(l.path_mean_mm, 0)} mm`, fixed(l.bar, 0)]))
  },
  learner({ learner }) {
    const share = value => value.toFixed(2)
    return ['| pictures that the learner saw | episodes that reach the vein |', '|---|---|',
      ...learner.curve.map(([pictures, reached]) => `| ${pictures} | ${share(reached)} |`),
      `| chance | ${share(learner.random)} |`, `| scripted operator that knows the vein's place | ${share(learner.scripted)} |`].join('\n')
  },
  fit_errors({ fit }) {
    const rows = [
      ['stage 1, every curve by itself', fit.stage1.parameters, fit.stage1],
      ['stage 2, simplified interaction', fit.stage2.parameters, fit.stage2],
      ['stage 3, full equilibrium', fit.stage3.parameters, fit.stage3],
      ['stage 3, one site left out (linearised)', '', fit.stage3.stage3.one_site_out],
      ['stage 3, eight folds of sites left out, refitted', '', fit.hold_out.hold_out],
    ]
    const cell = e => `${fixed(e.mae_n, 3)} / ${fixed(e.sd_n, 3)} N, ${fixed(e.mae_percent, 2)} %`
    return table(['', 'parameters', 'linear MAE / SD', 'point MAE / SD', 'both MAE / SD'],
      rows.map(([name, parameters, e]) => [name, parameters, cell(e.probes.linear), cell(e.probes.point), cell(e.all)]))
  },
  solid_fit({ solid }) {
    const row = (name, e) => e ? [name, ...['linear', 'point', 'square', 'all'].map(key => e[`${key}_percent`] === undefined ? '' : `${fixed(e[`${key}_percent`], 2)} %`), `${fixed(e.ln_rms_percent, 2)} %`] : null
    const { right, thick } = solid
    return table(['', 'linear', 'point', 'square', 'all', 'rms of ln'], [
      row('solid, 6 numbers, the 4 sites that were fitted', right.fitted), row('solid, sites 4, 17, 32, 53, left out', right.left_out),
      row('springs, 258 numbers from all other sites, the same rows', right.left_out.springs), row('solid, square footprint, never fitted', right.never_fitted),
      row('springs, the same rows', right.never_fitted.springs), row('solid, fat wrong by up to 1.5 mm: fitted', thick.fitted), row('the same, sites left out', thick.left_out),
      row('the same, square footprint', thick.never_fitted)].filter(r => r))
  },
  solid_moduli: ({ solid }) => table(['layer', 'true mu, kPa; exponent', 'mu, kPa (sd of ln)', 'exponent (sd of ln)', 'with wrong fat'],
    [['muscle', '3.6; 9'], ['fat', '1.1; 8'], ['skin', '40; 9']].map(([layer, truth]) => {
      const m = solid.right.moduli[layer], w = solid.thick.moduli[layer], from = known => known ? '' : ', prior'
      return [layer, truth, `${fixed(m.shear_kpa, 2)} (${fixed(m.ln_shear_sd, 2)}${from(m.shear_measured)})`,
        `${fixed(m.exponent, 1)} (${fixed(m.ln_exponent_sd, 2)}${from(m.exponent_measured)})`, `${fixed(w.shear_kpa, 2)}; ${fixed(w.exponent, 1)}`]
    })),
  solid_mesh: ({ solid_mesh: m }) => table(['contact', 'mesh', 'unknowns', ...['2', '6', '10', '14', '20'].map(d => `${d} mm, N`)],
    ['bonded', 'slip'].flatMap(contact => ['coarse', 'default', 'fine'].map(name => {
      const e = m[`${name}_${contact}`], fine = m[`fine_${contact}`]
      const cell = key => fixed(e.force_n[key], 3) + (name === 'fine' ? '' : ` (${e.force_n[key] > fine.force_n[key] ? '+' : ''}${fixed(100 * (e.force_n[key] / fine.force_n[key] - 1), 1)} %)`)
      return [contact === 'slip' ? 'sliding, rounded by 3 mm' : 'bonded', name, fixed(e.unknowns, 0), ...['at_2', 'at_6', 'at_10', 'at_14', 'at_20'].map(cell)]
    }))),
  solid_live: figures => table(['to, mm', 'mm/s', 'way', 'rms, %', 'most, %', 'most, N', 'jump, N', 'at rest, %', 'of one core, %'],
    [14, 22].flatMap(depth => [10, 20, 40].flatMap(speed => Object.entries({ press: 'pressed', slide_across: 'slid 6 mm across', back_across: 'and back', slide_along: 'slid 6 mm along', back_along: 'and back', withdraw: 'withdrawn to 1 mm' }).map(([key, name]) => {
      const e = figures[`solid_live_${depth}`][`at_${speed}`][key]
      return [fixed(depth, 0), fixed(speed, 0), name, fixed(e.rms_percent, 2), fixed(e.most_percent, 1), fixed(e.most_n, 3), fixed(e.jump_n, 3), fixed(e.held_percent, 2), fixed(e.core_percent, 0)]
    })))),
  solid_live_sites: figures => table(['site', 'mm/s', 'pressed: rms; most, %', 'slid and back: rms; most, %', 'withdrawn: rms; most, %', 'at rest, most, %', 'returns'],
    Object.entries({ 4: 0, 19: 0, 27: figures.solid_live_22, 36: 0, 45: 0 }).flatMap(([site, own]) => [10, 20, 40].map(speed => {
      const e = (own || figures.solid_live_sites[site])[`at_${speed}`], parts = Object.values(e).filter(part => part.rms_percent !== undefined), slides = parts.slice(1, -1)
      const worst = (list, key) => Math.max(...list.map(part => Math.abs(part[key])))
      const pair = list => `${fixed(worst(list, 'rms_percent'), 1)}; ${fixed(worst(list, 'most_percent'), 1)}`
      return [site, fixed(speed, 0), pair([e.press]), pair(slides), pair([e.withdraw]), fixed(worst(parts, 'held_percent'), 1), fixed(e.returns, 0)]
    }))),
  class: figures => table(['learners', 'images per second each', 'ticks left out, %', 'from pose to image, ms: median; 99 %'],
    Object.entries(figures.class).map(([name, e]) => [name.slice(9), fixed(e.images_per_s.median, 0), fixed(e.left_out_percent.median, 1),
      `${fixed(e.pose_to_image_ms.median, 0)}; ${fixed(e.pose_to_image_p99_ms.median, 0)}`])),
  ellipsoid: ({ ellipsoid }) => table(['nodes', 'steps/s', 'error', 'nodes awake', 'iterations per step'],
    Object.entries(ellipsoid).map(([name, e]) =>
      [fixed(Number(name.slice(6)), 0), fixed(e.steps_per_s, 0), `${fixed(e.error_percent, 2)} %`, fixed(e.awake, 0), fixed(e.iterations, 1)])),
  step: ({ step }) => table(['`sonde bench --scene`', 'steps/s', 'median, ms', '99 %, ms', 'most, ms', 'error'],
    Object.entries(step).map(([name, e]) => [`\`${name}\``, fixed(e.steps_per_s.median, 0), fixed(e.median_ms.median, 3),
      fixed(e.p99_ms.median, 2), fixed(e.max_ms.median, 2), `${fixed(e.error_percent, 2)} %`])),
  frame: ({ image }) => frames(image),
  frame_limb: ({ image }) => frames(image.limb),
  // The claims of a section of the paper: "2", "3.1", ...
  ...Object.fromEntries(['1', '2', '3.1', '3.2', '4.1', '4.2', '5'].map(section => [`paper_${section.replace('.', '_')}`, ({ paper }) =>
    table(['the paper', 'what came out', ''], Object.values(paper.claims).filter(c => c.section.split(',')[0] === section)
      .map(c => [`${c.sentence}${c.section.includes(',') ? ` (${c.section.split(', ').slice(1).join(', ')})` : ''}`, c.found, `**${c.verdict}**`]))])),
  paper_models: ({ paper }) => table(['model', 'parameters', 'MAE / SD', 'linear', 'point', 'both', 'third footprint', 'sites left out', 'step'],
    Object.values(paper.tables.models.rows).map(r => [r.name, r.parameters, `${fixed(r.mae_n, 2)} / ${fixed(r.sd_n, 2)} N`,
      ...['linear', 'point', 'both', 'third', 'left_out'].map(key => `${fixed(r[`${key}_percent`], 2)} %`), `${fixed(r.step_ms, 2)} ms`])),
  paper_volumetric: ({ paper }) => table(['model', 'parameters', 'linear', 'point', 'both', 'sites left out', 'third footprint', 'rows without equilibrium', ...(paper.tables.volumetric.columns.all_percent ? ['both, these as no force'] : []), 'nodes', 'set-up', 'step'],
    Object.values(paper.tables.volumetric.rows).map(r => [r.name, r.parameters,
      ...['linear', 'point', 'both', 'left_out', 'third'].map(key => r[`${key}_percent`] === null ? '' : `${fixed(r[`${key}_percent`], 1)} %`),
      `${fixed(r.none_percent, 0)} %`, ...(paper.tables.volumetric.columns.all_percent ? [`${fixed(r.all_percent, 1)} %`] : []), r.nodes, r.setup_ms === null ? '' : `${fixed(r.setup_ms, 0)} ms`, r.step_ms === null ? '' : `${fixed(r.step_ms, 2)} ms`])),
  paper_equal: ({ paper }) => !paper.tables.equal_error ? 'Its figures are those of the next measurement, `node bench/figures.mjs measure build/release/bin paper`.'
    : table(['model', 'error at 16 mm', 'error at 8 mm', 'nodes', 'set-up', 'step', 'of two layers\'', 'step at 8 mm'],
      Object.values(paper.tables.equal_error.rows).map(r => [r.name, ...['coarse', 'middle'].map(key => `${fixed(r[`${key}_percent`], 1)} %`),
        ...(r.equal_step_ms === null ? ['', '', 'not reached', ''] : [fixed(r.equal_nodes, 0), `${fixed(r.equal_setup_ms, 0)} ms`, `${fixed(r.equal_step_ms, 3)} ms`, fixed(r.times, 1)]),
        `${fixed(r.same_step_ms, 3)} ms`])),
  paper_figures: ({ paper }) => table(['figure', 'what it shows'], Object.values(paper.figures).map(f => [f.title.replace(/\..*/, ''), f.caption])),
  flow({ flow }) {
    const from = (e, decimals, unit = '') => `${fixed(e.least, decimals)} to ${fixed(e.most, decimals)}${unit}`
    return table(['', 'Sonde', 'published'], [
      ['common femoral vein at rest: mean in the gate; over the lumen', `${from(flow.gate_cm_s, 1)}; ${from(flow.lumen_cm_s, 1, ' cm/s')}`, '9 to 15 cm/s'],
      ['common femoral, femoral vein at rest: peak', `${from(flow.peak_cm_s, 0)}; ${from(flow.femoral_peak_cm_s, 0, ' cm/s')}`, '12 to 30 cm/s'],
      ['phasicity in the groin; augmentation', `${from(flow.phasicity, 2)}; ${from(flow.augmentation, 1, ' times')}`, 'flow falls with the breath, may stop'],
      ['squeeze of the calf, popliteal vein: peak', from(flow.squeeze_peak_cm_s, 0, ' cm/s'), '89 +- 35'],
      ['popliteal vein: blood falls back, valves sound; leaking', `${from(flow.reflux_s, 2)}; ${from(flow.leak_s, 2, ' s')}`, 'median 0.19, 95 % below 0.66; more than 1 s standing'],
      ['clot in the pelvis: phasicity in the groin; augmentation', `${from(flow.clot_phasicity, 2)}; ${from(flow.clot_augmentation, 1, ' times')}`, 'lost; weak'],
      ['strain: reversal, then none', from(flow.strain_s, 2, ' s'), 'stop or less than 0.5 s back'],
      ['common femoral artery: peak', from(flow.artery_peak_cm_s, 0, ' cm/s'), '114 +- 25'],
    ])
  },
  gate: ({ gate }) => table(['seed', 'phasicity in the groin: read off; true', 'popliteal vein, valves leaking: blood falls back, read off; true', 'that is faster along the beam than'],
    gate.legs.map(l => [l.limb, `${fixed(l.phasicity, 2)}; ${fixed(l.true_phasicity, 2)}`, `${fixed(l.leaking_s, 2)}; ${fixed(l.true_leaking_s, 2)} s`, `${fixed(l.slowest_cm_s, 1)} cm/s`])),
  limb_faults: ({ limb }) => table(['law', `violations in ${limb.limbs} limbs, ${fixed(limb.places, 0)} places`],
    [['walls of two vessels 0.3 mm apart or more', limb.walls], ['deep vessels 1.5 mm or more from bone', limb.bone], ['no lumen in bone', limb.lumen],
      ['deep vessels 0.3 mm or more under the deep fascia', limb.fascia], ['saphenous veins between both fasciae', limb.eye]]),
  limb_views: ({ limb }) => table(['view', 'true, % of limbs', `depth in its band, % of the ${limb.banded} of BMI 20 to 35`, 'at most 5 mm beyond it'],
    Array.from({ length: 11 }, (_, k) => [`V${k + 1}`, ...['true_percent', 'in_band_percent', 'near_band_percent'].map(key => fixed(limb[`v${k + 1}`][key], 1))])),
  // Force (band), in bold outside of it, for each vein of each station.
  closing_forces({ closing }) {
    const bodies = [...new Set(closing.veins.map(v => `${v.bmi} ${v.sex}`))], names = [...new Set(closing.veins.map(v => `${v.station}: ${v.vein}`))]
    const cell = v => {
      if (!v) return ''
      const band = `(${fixed(v.least_n, 1)} - ${fixed(v.most_n, 1)})`
      if (!v.closed) return `**${fixed(v.area, 2)} open** ${band}`
      return v.force_n < v.least_n || v.force_n > v.most_n ? `**${fixed(v.force_n, 1)}** ${band}` : `${fixed(v.force_n, 1)} ${band}`
    }
    return table(['station: vein', ...bodies.map(b => `BMI ${b.replace('female', 'woman').replace('male', 'man')}`)],
      names.map(name => [name, ...bodies.map(body => cell(closing.veins.find(v => `${v.station}: ${v.vein}` === name && `${v.bmi} ${v.sex}` === body)))]))
  },
  closing_clots({ closing }) {
    const stations = [...new Set(closing.veins.map(v => v.station))]
    const range = (of, key) => {
      const all = of.map(v => v[key]).filter(a => a !== null)
      return all.length ? `${fixed(Math.min(...all), 2)} - ${fixed(Math.max(...all), 2)}` : ''
    }
    return table(['station', 'artery', 'fresh occlusive clot', 'a few weeks old', 'old', 'mural, 45 %'],
      stations.map(s => [s, ...['artery', 'acute_occlusive', 'subacute_occlusive', 'chronic_occlusive', 'partial_mural'].map(key => range(closing.veins.filter(v => v.station === s && v.closed), key))]))
  },
  closing_cuffs({ closing }) {
    const range = key => {
      const all = closing.veins.map(v => v[key]).filter(a => a !== null)
      return `${fixed(Math.min(...all), 0)} - ${fixed(Math.max(...all), 0)}`
    }
    return table(['', 'deep and superficial veins of all stations', 'published, calf'],
      [['lying', range('cuff_supine_mmhg'), '20 - 25'], ['sitting', range('cuff_sitting_mmhg'), '50 - 60'], ['standing', range('cuff_standing_mmhg'), 'about 70']])
  },
  legs({ legs }) {
    const row = (name, key, decimals, unit) => [name, ...['least', 'median', 'most'].map(of => `${fixed(legs[key][of], decimals)} ${unit}`)]
    return table(['', 'least', 'median', 'most'], [
      row('making a leg and saving it', 'build_s', 2, 's'), row('loading its file', 'load_s', 2, 's'), row('its inside', 'inside_s', 2, 's'), row('memory, with picture', 'memory_mb', 0, 'MB'),
      row('slow press to 8 N at mid-thigh', 'press_s', 2, 's'), row('vessels below it, the solid factored at once', 'first_update_s', 2, 's'),
      row('step, median', 'tick_ms', 2, 'ms'), row('step, 99 %', 'tick_p99_ms', 2, 'ms'), row('step, 99.9 %', 'tick_p999_ms', 2, 'ms'), row('step, most', 'tick_max_ms', 2, 'ms'),
      row('inside and picture, median', 'picture_ms', 1, 'ms'), row('inside and picture, 99 %', 'picture_p99_ms', 1, 'ms')])
  },
  solver: ({ solver }) => fenced(solver.output),
  accuracy: ({ accuracy }) => fenced(accuracy.output),
}

// Of the names and contents of all files below the sources.
function digest(root, sources) {
  const hash = createHash('sha256')
  const visit = path => {
    if (statSync(path).isDirectory()) for (const name of readdirSync(path).sort()) visit(join(path, name))
    else hash.update(relative(root, path)).update('\0').update(readFileSync(path)).update('\0')
  }
  for (const source of sources) if (existsSync(join(root, source))) visit(join(root, source))
  return hash.digest('hex')
}

function complain(text) {
  console.error(`figures: ${text}`)
  process.exitCode = 2
}

function measure(bin, names) {
  const unknown = names.find(name => !GROUPS[name])
  if (unknown !== undefined) return complain(`no group "${unknown}"; expected ${Object.keys(GROUPS).join(', ')}`)
  if (!existsSync(join(bin, 'sonde'))) return complain(`${bin}: no program sonde there; expected build/release/bin`)
  mkdirSync(join(HOME, 'bench/figures'), { recursive: true })
  for (const name of names.length ? names : Object.keys(GROUPS)) {
    const group = GROUPS[name]
    const record = {
      machine: `${cpus()[0].model}, ${cpus().length} processors`,
      date: new Date().toISOString().slice(0, 10),
      sources: group.sources,
      digest: digest(HOME, group.sources),
      values: group.measure(bin),
    }
    writeFileSync(join(HOME, 'bench/figures', `${name}.json`), JSON.stringify(record, null, 2) + '\n')
    console.log(`bench/figures/${name}.json`)
  }
}

function load(root) {
  const folder = join(root, 'bench/figures'), figures = {}
  for (const file of existsSync(folder) ? readdirSync(folder) : [])
    if (file.endsWith('.json')) figures[file.slice(0, -5)] = JSON.parse(readFileSync(join(folder, file), 'utf8'))
  return figures
}

function shown(figures, name, decimals) {
  const [group, ...path] = name.split('.')
  const value = path.reduce((at, key) => at?.[key], figures[group]?.values)
  if (typeof value !== 'number') return undefined
  return value.toLocaleString('en-US', { minimumFractionDigits: decimals, maximumFractionDigits: decimals })
}

const documents = root => [
  ...['README.md'].filter(name => existsSync(join(root, name))),
  ...(existsSync(join(root, 'docs')) ? readdirSync(join(root, 'docs')) : [])
    .filter(name => name.endsWith('.md')).sort().map(name => join('docs', name)),
]

// Compares the documents' figures with the measured ones and, with `write`, puts the measured ones in.
// Returns how many are wrong: without a measurement, or (without `write`) another number.
function compareDocuments(root, write) {
  const figures = load(root)
  let wrong = 0
  for (const name of documents(root)) {
    const path = join(root, name), before = readFileSync(path, 'utf8')
    const values = Object.fromEntries(Object.entries(figures).map(([group, record]) => [group, record.values]))
    const blocks = before.replace(BLOCK, (whole, block, was) => {
      let now
      try { now = BLOCKS[block]?.(values) } catch { now = undefined } // a group that is not measured
      if (now === undefined) return console.log(`${name}: no values for the block "${block}" in bench/figures`), ++wrong, whole
      if (`${now}\n` !== was && !write) console.log(`${name}: the block "${block}" differs from bench/figures`), ++wrong
      return `<!--block ${block}-->\n${now}\n<!--end block-->`
    })
    const after = blocks.replace(FIGURE, (whole, figure, decimals, was) => {
      const now = shown(figures, figure, Number(decimals))
      if (now === undefined) console.log(`${name}: no figure "${figure}" in bench/figures`), ++wrong
      else if (now !== was && !write) console.log(`${name}: ${figure} is "${was}", measured "${now}"`), ++wrong
      return now === undefined ? whole : `<!--${figure} ${decimals}-->${now}<!---->`
    })
    if (write && after !== before) writeFileSync(path, after)
  }
  for (const [name, record] of Object.entries(figures))
    if (digest(root, record.sources) !== record.digest)
      console.log(`bench/figures/${name}.json (${record.date}) is older than ${record.sources.join(', ')}`)
  return wrong
}

const [verb, ...rest] = process.argv.slice(2)
if (verb === 'measure' && rest.length) measure(rest[0], rest.slice(1))
else if (verb === 'insert' && !rest.length) process.exitCode = compareDocuments(HOME, true) ? 1 : 0
else if (verb === 'check' && rest.length < 2) process.exitCode = compareDocuments(rest[0] ?? HOME, false) ? 1 : 0
else {
  console.error('usage: node bench/figures.mjs measure BIN [GROUP...] | insert | check [ROOT]')
  process.exitCode = 2
}
