// node bench/whole_leg.mjs SONDE: a scripted expert and a scripted novice examine every bundled case by the
// protocol whole_leg. Writes to stdout, as JSON, what the documents show of it (bench/figures.mjs, whole_leg).
//
// SONDE_WHOLE_LEG=DIR keeps the result of each exam in DIR as CASE-OPERATOR.json, so that a run that was
// stopped goes on where it was; results of another build are not told apart: one DIR for one build. An exam
// takes minutes of a core's time; two run at a time.
import { spawn } from 'node:child_process'
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, renameSync, writeFileSync } from 'node:fs'
import { tmpdir } from 'node:os'
import { dirname, join } from 'node:path'
import { fileURLToPath } from 'node:url'

const HOME = join(dirname(fileURLToPath(import.meta.url)), '..'), AT_ONCE = 2, OPERATORS = ['expert', 'novice']

const program = process.argv[2]
if (process.argv.length !== 3 || !existsSync(program)) {
  console.error('usage: node bench/whole_leg.mjs SONDE, the program of a build, e.g. build/release/bin/sonde')
  process.exit(2)
}
const folder = process.env.SONDE_WHOLE_LEG ?? mkdtempSync(join(tmpdir(), 'sonde-whole-leg-'))
mkdirSync(folder, { recursive: true })

// The program's answer, or the reason for which it refused the exam (exit code 1).
const examine = (patient, operator) => new Promise((resolve, reject) => {
  const child = spawn(program, ['exam', '--case', patient, '--protocol', 'whole_leg', '--operator', operator, '--json'], { stdio: ['ignore', 'pipe', 'pipe'] })
  let said = '', complained = ''
  child.stdout.on('data', text => { said += text })
  child.stderr.on('data', text => { complained += text })
  child.on('error', reject)
  child.on('close', code => {
    const refused = complained.split(/[\r\n]/).filter(line => line.startsWith('sonde exam:')).pop()
    if (code === 0) resolve(said)
    else if (code === 1 && refused) resolve(JSON.stringify({ case: patient, operator, refused }))
    else reject(new Error(`${patient}, ${operator}: exit code ${code}: ${complained.slice(-400)}`))
  })
})

const cases = readdirSync(join(HOME, 'data/cases')).filter(name => name.endsWith('.yaml')).map(name => name.slice(0, -5)).sort()
const open = cases.flatMap(patient => OPERATORS.map(operator => [patient, operator]))
const path_of = (patient, operator) => join(folder, `${patient}-${operator}.json`)
async function work() {
  for (let next = open.shift(); next; next = open.shift()) {
    const path = path_of(...next)
    if (existsSync(path)) continue
    writeFileSync(`${path}.part`, await examine(...next))
    renameSync(`${path}.part`, path)
    console.error(`${next.join(', ')}: ${open.length} to go`)
  }
}
await Promise.all(Array.from({ length: AT_ONCE }, work))

const results = Object.fromEntries(OPERATORS.map(operator => [operator, cases.map(patient => JSON.parse(readFileSync(path_of(patient, operator), 'utf8')))]))
const values = { cases: cases.length, refused: results.expert.filter(r => r.refused).length, wrong_passed: 0 }
const done = {}
for (const operator of OPERATORS) {
  const all = done[operator] = results[operator].filter(r => !r.refused), scores = all.map(r => r.score)
  values[operator] = {
    exams: all.length, score_mean: scores.reduce((a, b) => a + b, 0) / all.length, score_least: Math.min(...scores), score_most: Math.max(...scores),
    right: all.filter(r => r.correct).length, passed: all.filter(r => r.passed).length,
    places: all.reduce((sum, r) => sum + r.places, 0), places_done: all.reduce((sum, r) => sum + r.places_done, 0),
    force_peak_n: Math.max(...all.map(r => r.force_peak_n)), time_least_s: Math.min(...all.map(r => r.time_s)), time_most_s: Math.max(...all.map(r => r.time_s)),
  }
  values.wrong_passed += all.filter(r => r.passed && !r.correct).length
}
// Share of the pairs of an expert's and a novice's exam in which the expert's score is the higher one; ties count half.
const pairs = done.expert.flatMap(e => done.novice.map(n => e.score > n.score ? 1 : e.score === n.score ? 0.5 : 0))
values.separation = pairs.reduce((a, b) => a + b, 0) / pairs.length
console.log(JSON.stringify(values))
