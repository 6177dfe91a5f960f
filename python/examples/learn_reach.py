"""A baseline learner for ReachVein in plain NumPy, beside a scripted operator and chance.

The learner looks at labelled pictures: from the mean grey value of blocks of the picture it estimates by
ridge regression where the vein lies along the face, then it moves there. The curve is its share of episodes
that reach the vein against the number of pictures. The scripted operator reads the vein's place from the
simulator; the random one does not look at all.
"""
import argparse
import contextlib
import json
import sys

import numpy as np

from sonde.tasks import ReachVein, SPEED_M_S, STEP_S

COLUMNS, ROWS = 16, 16
LIGHT = 2 * 3.0 / 25.0 - 1  # a normal force of 3 N


def features(picture):
    """Means of blocks, and a constant."""
    h, w = picture.shape
    blocks = picture.reshape(ROWS, h // ROWS, COLUMNS, w // COLUMNS).mean(axis=(1, 3)) / 255.0
    return np.append(blocks.ravel(), 1.0)


def collect(task, count, rng):
    """Pictures under a light touch, and where the vein is along the face (m)."""
    x, y = [], []
    while len(x) < count:
        for i in range(task.count):
            task.reset(i, rng)
        for _ in range(12):
            actions = rng.uniform(-1, 1, (task.count, 6))
            actions[:, 1] = actions[:, 3:] = 0
            actions[:, 2] = LIGHT
            task.step(actions, np.ones(task.count, bool))
            for i in range(task.count):
                if np.isfinite(task.see(i, "vein_x_m")) and task.force_n(i) > 0.5:
                    x.append(features(task.images[i]))
                    y.append(task.see(i, "vein_x_m"))
    return np.array(x[:count]), np.array(y[:count])


def regress(x, y, ridge=3.0):
    return np.linalg.solve(x.T @ x + ridge * np.eye(x.shape[1]), x.T @ y)


def towards(x_m, tilt=0.0):
    """The action that goes to where the vein is thought to be."""
    action = np.zeros(6)
    action[0] = np.clip(x_m / (3 * STEP_S * SPEED_M_S), -1, 1)
    action[2] = LIGHT
    action[5] = tilt
    return action


def succeed(task, episodes, rng, policy):
    """Share of episodes that reach the vein."""
    reached = tried = 0
    while tried < episodes:
        for i in range(task.count):
            task.reset(i, rng)
        live = np.ones(task.count, bool)
        for _ in range(task.steps):
            actions = np.stack([policy(task, i) for i in range(task.count)])
            reward, over = task.step(actions, live)
            reached += int(np.sum(over & (reward > 2)))
            live &= ~over
            if not live.any():
                break
        tried += task.count
    return reached / tried


def main(pictures=(0, 30, 100, 300, 1000), episodes=48, count=8, seed=1):
    task = ReachVein(count=count, steps=50)
    rng = np.random.default_rng(seed)
    x, y = collect(task, max(pictures), rng)
    rows = []
    for n in pictures:
        weights = regress(x[:n], y[:n]) if n else np.zeros(x.shape[1])
        share = succeed(task, episodes, np.random.default_rng(seed + 1),
                        lambda t, i: towards(features(t.images[i]) @ weights))
        rows.append((n, share))
        print(f"{n:5d} pictures: {share:.2f} of {episodes} episodes reach the vein")
    drift = np.random.default_rng(seed + 2)
    random = succeed(task, episodes, np.random.default_rng(seed + 1),
                     lambda t, i: np.append(drift.uniform(-1, 1, 2), [LIGHT, 0, 0, 0]))
    scripted = succeed(task, episodes, np.random.default_rng(seed + 1),
                       lambda t, i: towards(t.see(i, "vein_x_m")))
    print(f"random operator: {random:.2f}; scripted operator that knows the vein's place: {scripted:.2f}")
    return rows, random, scripted


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few pictures and episodes")
    parser.add_argument("--json", action="store_true", help="print the curve as JSON only")
    given = parser.parse_args()
    words = {"pictures": (0, 40), "episodes": 4, "count": 4} if given.quick else {}
    if given.json:
        with contextlib.redirect_stdout(sys.stderr):
            curve, chance, known = main(**words)
        print(json.dumps({"curve": curve, "random": chance, "scripted": known}))
    else:
        main(**words)
