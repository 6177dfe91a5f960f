// stuck_client.mjs SONDE OUT.csv [ROUNDS]: the share of a running simulator's frames that a client gets
// which acknowledges each at once, alone and beside a client that asks for frames and never reads. Writes
// one row per round and prints the medians. A busy machine lowers both shares; compare them within a round.
import { writeFileSync } from "node:fs";
import { Client } from "../tests/web/socket.mjs";
import { startRun } from "../tests/web/program.mjs";

const [sonde, out, rounds = "5"] = process.argv.slice(2);
if (!out || !(Number(rounds) >= 1)) {
  console.error("usage: stuck_client.mjs SONDE OUT.csv [ROUNDS]");
  process.exit(2);
}
const PUBLISHED = 200; // frames that are counted
const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

const program = await startRun(sonde, ["--port", "0"]);
const reader = new Client(program.learner, true);
await reader.open;
const rows = [];
for (let round = 0; round < Number(rounds); ++round) {
  const alone = await reader.share(PUBLISHED);
  const stuck = new Client(program.learner, false);
  await stuck.open;
  const beside = await reader.share(PUBLISHED);
  stuck.close();
  rows.push([round, alone, beside]);
}
writeFileSync(out, `round,share_alone,share_beside_stuck\n${rows.map((row) => row.join(",")).join("\n")}\n`);
console.log(`of ${PUBLISHED} frames a reader gets ${(100 * median(rows.map((r) => r[1]))).toFixed(1)} % alone, ${(100 * median(rows.map((r) => r[2]))).toFixed(1)} % beside a client that never reads (medians of ${rows.length} rounds)`);
reader.close();
program.interrupt();
await program.ended;
