#!/usr/bin/env python3
"""Cost of batches, as JSON: memory, resets, steps, and how 64 environments share the cores.

    PYTHONPATH=build/release/python /usr/bin/python3 bench/batch.py > bench/figures/batch.json

Wall times are of a machine that other programs may use; `cpu_share` compares the processor time of a
step in a batch of 64 on all cores with that of the same leg alone, which other programs disturb less.
"""
import json
import os
import statistics
import time

import numpy as np
import sonde


def resident() -> float:
    """Resident memory of this process, bytes."""
    with open("/proc/self/statm") as f:
        return int(f.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def median(work, repeats: int = 9) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def prepared(leg, count, threads, **words):
    """A batch whose probes press with 6 N at a place."""
    batch = sonde.Batch(leg, count=count, threads=threads, drive="force", **words)
    name = "popliteal" if "popliteal" in leg.places else "site 27"
    for i in range(count):
        batch.reset(i, pose=leg.places[name])
    actions = np.zeros((count, 7))
    actions[:, 2] = 6
    actions[:, 1] = 0.002  # slides slowly, so that nothing sleeps
    for _ in range(15):
        batch.step(actions)
    return batch, actions


def stepping(leg, count, threads, steps, **words) -> tuple[float, float]:
    """Wall and processor seconds for one step of one environment; medians of rounds."""
    batch, actions = prepared(leg, count, threads, **words)
    wall, cpu = [], []
    for _ in range(5):
        start, used = time.perf_counter(), time.process_time()
        for _ in range(steps):
            batch.step(actions)
        wall.append((time.perf_counter() - start) / (steps * count))
        cpu.append((time.process_time() - used) / (steps * count))
    return statistics.median(wall), statistics.median(cpu)


def measure(leg) -> dict:
    found = {"nodes": leg.nodes}
    before = resident()
    batch, actions = prepared(leg, 8, 0, size=(128, 128))
    found["mb_with_picture"] = (resident() - before) / 8e6
    found["reset_ms"] = 1e3 * median(lambda: batch.reset(0, pose=leg.places[next(iter(leg.places))]))
    saved = batch.save(1)
    found["saved_mb"] = len(saved) / 1e6
    found["restore_with_inside_ms"] = 1e3 * median(lambda: batch.restore(1, saved))
    del batch
    before = resident()
    batch, actions = prepared(leg, 8, 0, inside=False)
    found["mb_force_only"] = (resident() - before) / 8e6
    saved = batch.save(1)
    found["restore_ms"] = 1e3 * median(lambda: batch.restore(1, saved), 51)
    del batch
    for name, words in (("force", {"inside": False}), ("vessels", {}), ("picture", {"size": (128, 128)})):
        wall, cpu = stepping(leg, 1, 1, 10, **words)
        found[f"{name}_step_ms"] = 1e3 * cpu
        found[f"{name}_times_real_time"] = 0.02 / cpu
    cores = len(os.sched_getaffinity(0))
    alone, alone_cpu = stepping(leg, 1, 1, 40, inside=False)
    many, many_cpu = stepping(leg, 64, cores, 4, inside=False)
    found["cores"] = cores
    found["speed_up_64"] = alone / many
    found["of_linear_64"] = alone / many / cores
    found["cpu_share_64"] = alone_cpu / many_cpu
    return found


if __name__ == "__main__":
    limb = sonde.Leg.limb(3, bmi=24)
    print(json.dumps({"values": {"thigh": measure(sonde.thigh()), "limb": measure(limb)}}, indent=1))
