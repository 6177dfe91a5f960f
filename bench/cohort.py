"""cohort.py BIN [SUBJECTS [STAGES [ROUNDS]]]: time of sonde fit --cohort by one process and by two ranks of MPI.

The subjects are the bundled thigh with its forces scaled by 0.8 to 1.2. Fails when the two leave other bytes.
Prints one JSON object; times are medians of rounds in turn, wall clock.
"""
import filecmp
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

HOME = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "data", "thigh")


def main():
    folder = os.path.abspath(sys.argv[1])
    subjects, stages, rounds = (int(v) for v in (sys.argv[2:] + ["6", "2", "5"][len(sys.argv) - 2:]))
    home = os.path.abspath(HOME)
    with tempfile.TemporaryDirectory() as work:
        rows = open(os.path.join(home, "indentation.csv"), encoding="utf-8").read().splitlines()
        at = rows[0].split(",").index("force_n")
        with open(os.path.join(work, "list.csv"), "w", encoding="utf-8") as table:
            table.write("subject,measurements,surface,sites\n")
            for k in range(subjects):
                scale = 0.8 + 0.4 * k / max(subjects - 1, 1)
                with open(os.path.join(work, f"{k}.csv"), "w", encoding="utf-8") as out:
                    out.write(rows[0] + "\n")
                    for row in rows[1:]:
                        cells = row.split(",")
                        cells[at] = f"{scale * float(cells[at]):.6f}"
                        out.write(",".join(cells) + "\n")
                table.write(f"leg-{k},{k}.csv,{home}/skin.ply,{home}/sites.csv\n")
        times = {1: [], 2: []}
        load = os.getloadavg()[0]
        for _ in range(rounds):
            for ranks in times:
                to = os.path.join(work, f"by{ranks}")
                shutil.rmtree(to, ignore_errors=True)
                words = [os.path.join(folder, "sonde"), "fit", "--cohort", "list.csv", "-o", to, "--", "--stages", str(stages)]
                if ranks > 1:
                    words = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(ranks)] + words
                began = time.monotonic()
                subprocess.run(words, check=True, cwd=work, stdout=subprocess.DEVNULL)
                times[ranks].append(time.monotonic() - began)
            one, two = os.path.join(work, "by1"), os.path.join(work, "by2")
            names = sorted(os.listdir(one))
            if names != sorted(os.listdir(two)) or filecmp.cmpfiles(one, two, names, shallow=False)[0] != names:
                sys.exit("one process and two ranks leave other bytes")
        one_s, two_s = (statistics.median(times[k]) for k in times)
        ratios = [a / b for a, b in zip(times[1], times[2])]
        print(json.dumps({"subjects": subjects, "stages": stages, "rounds": rounds, "one_s": one_s, "two_s": two_s,
                          "speed_up": {"least": min(ratios), "median": statistics.median(ratios), "most": max(ratios)},
                          "load": load}))


main()
