"""Tasks for learners on a batch of legs, in NumPy; `sonde.gym` makes Gymnasium environments of them.

    import numpy as np, sonde.tasks
    task = sonde.tasks.CompressVein(count=8)
    for i in range(8):
        task.reset(i, np.random.default_rng(i))
    rewards, over = task.step(actions, mask=np.ones(8, bool))
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import sonde

STEP_S = 0.04
SPEED_M_S = 0.05
TURN_RAD_S = 0.5
FORCE_MOST_N = 25.0
START_M = 0.003  # of the face above the skin
IMAGE = 64


def _turned(q: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """The vector `axis` of the probe's frame in the leg's, for rows of quaternions w x y z."""
    w, v = q[..., :1], q[..., 1:]
    t = 2 * np.cross(v, axis)
    return axis + w * t + np.cross(v, t)


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return np.array([aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
                     aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw])


class Task:
    """Probes on legs with a question: `count` environments of one batch.

    Action (6 numbers or more, each -1 to 1): speed along the face and along the leg (50 mm/s),
    normal force (0 to 25 N), turning about the probe's three axes (0.5 rad/s). Observation:
    `image` (64 x 64 grey values), `wrench` (N, N m on the probe, in its frame), `turn` (the
    probe's quaternion); `bounds` has least and largest value, shape and type of each. Tissue, venous
    pressure and gain are drawn at every reset.
    """

    actions = 6
    steps = 150

    def __init__(self, count: int = 1, legs: sonde.Leg | Sequence[sonde.Leg] | None = None,
                 images: bool = True, scanner: str | None = None, threads: int = 0,
                 steps: int | None = None):
        if legs is None:
            legs = sonde.thigh()
        self.legs = [legs] if isinstance(legs, sonde.Leg) else list(legs)
        self.veins = [leg.vein for leg in self.legs]
        self.steps = self.steps if steps is None else steps
        self.count = count
        self.batch = sonde.Batch(self.legs, count=count, drive="force",
                                 ticks=round(STEP_S * 1000), threads=threads,
                                 size=(IMAGE, IMAGE) if images else None, scanner=scanner)
        self.column = {name: k for k, name in enumerate(self.batch.vessel_names)}
        self.wrench = np.asarray(self.batch.wrench)
        self.vessel = np.asarray(self.batch.vessel)
        self.pose = np.asarray(self.batch.pose)
        self.flags = np.asarray(self.batch.flags)
        self.images = np.asarray(self.batch.images) if images else None
        self.left = np.zeros(count, int)
        self.bounds: dict[str, tuple[float, float, tuple[int, ...], type]] = {
            "wrench": (-200.0, 200.0, (6,), np.float32), "turn": (-1.0, 1.0, (4,), np.float32)}
        if images:
            self.bounds["image"] = (0, 255, (IMAGE, IMAGE), np.uint8)

    # ---- what the tasks say
    def begin(self, i: int, rng: np.random.Generator) -> dict[str, Any]:
        """Arguments of Batch.reset() for a new episode of environment i."""
        raise NotImplementedError

    def judge(self, i: int, action: np.ndarray) -> tuple[float, bool]:
        """Reward of the step, and whether the episode is over."""
        raise NotImplementedError

    # ---- all environments
    def reset(self, i: int, rng: np.random.Generator) -> None:
        self.left[i] = self.steps
        self.batch.reset(i, **self.begin(i, rng))

    def step(self, actions: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps those of the mask. Rewards, and whose episode is over."""
        a = np.clip(np.asarray(actions, np.float64), -1, 1)
        rows = np.zeros((self.count, 7))
        rows[:, :2] = SPEED_M_S * a[:, :2]
        rows[:, 2] = FORCE_MOST_N * 0.5 * (a[:, 2] + 1)
        rows[:, 3:6] = TURN_RAD_S * a[:, 3:6]
        self.batch.step(rows, mask)
        reward, over = np.zeros(self.count), np.zeros(self.count, bool)
        for i in np.flatnonzero(mask):
            reward[i], over[i] = self.judge(int(i), a[i])
            self.left[i] -= 1
        return reward, over

    def observation(self, i: int) -> dict[str, np.ndarray]:
        seen = {"wrench": np.clip(self.wrench[i], -200, 200).astype(np.float32),
                "turn": np.clip(self.pose[i, 3:], -1, 1).astype(np.float32)}
        if self.images is not None:
            seen["image"] = self.images[i].copy()
        return seen

    def info(self, i: int) -> dict[str, Any]:
        return {"vein_ratio": self.see(i, "vein_ratio"), "vein_x_m": self.see(i, "vein_x_m"),
                "force_n": self.force_n(i), "flags": int(self.flags[i])}

    # ---- what tasks use
    def see(self, i: int, name: str) -> float:
        """A column of Batch.vessel now."""
        return float(self.vessel[i, self.column[name]])

    def force_n(self, i: int) -> float:
        return float(-self.wrench[i, 2])

    def drawn_point(self, i: int, rng: np.random.Generator) -> dict[str, Any]:
        """A point of the vein, away from its ends."""
        vein = self.veins[i % len(self.veins)]
        at = rng.uniform(0.1, 0.9) * vein[-1]["along_m"]
        return min(vein, key=lambda p: abs(p["along_m"] - at))

    @staticmethod
    def near(point: dict[str, Any], aside_m: float, turn_rad: float,
             rng: np.random.Generator) -> np.ndarray:
        """Above a point, up to so far aside along the face and turned about the beam."""
        pose = np.array(point["pose"])
        pose[:3] -= START_M * _turned(pose[3:], np.array([0.0, 0.0, 1.0]))
        aside = rng.uniform(-aside_m, aside_m)
        pose[:3] += aside * _turned(pose[3:], np.array([1.0, 0.0, 0.0]))
        angle = rng.uniform(-turn_rad, turn_rad) / 2
        pose[3:] = _product(pose[3:], np.array([np.cos(angle), 0, 0, np.sin(angle)]))
        return pose

    @staticmethod
    def tissue(rng: np.random.Generator) -> dict[str, float]:
        """Tissue, venous pressure and gain of a new episode."""
        return {"stiffness": float(rng.uniform(0.75, 1.35)),
                "damping": float(rng.uniform(0.7, 1.5)),
                "venous_mmhg": float(rng.uniform(7, 14)), "gain_db": float(rng.uniform(-4, 4))}


class ReachVein(Task):
    """Bring the vein under the middle of the face, transverse, with a light touch.

    Reward: what the distance fell by in the step, in centimetres (a radian of tilt counts as half
    a centimetre), less 0.02 a newton above 6 N; 5 when the vein is within 2 mm of the middle and
    10 degrees of transverse under 0.5 to 6 N, which ends the episode. -1 ends an episode that has
    lost the vein from its plane.
    """

    def __init__(self, count: int = 1, **words):
        super().__init__(count, **words)
        self.before = np.full(count, np.nan)

    def begin(self, i, rng):
        self.before[i] = np.nan
        return {"pose": self.near(self.drawn_point(i, rng), 0.02, 0.4, rng), **self.tissue(rng)}

    def judge(self, i, action):
        x, tilt, force = self.see(i, "vein_x_m"), self.see(i, "vein_tilt_rad"), self.force_n(i)
        if not np.isfinite(x):
            return -1.0, True
        far = 100 * abs(x) + 0.5 * tilt
        gain = 0.0 if np.isnan(self.before[i]) else self.before[i] - far
        self.before[i] = far
        there = abs(x) < 2e-3 and tilt < np.radians(10) and 0.5 < force < 6
        return gain - 0.02 * max(0.0, force - 6) + (5.0 if there else 0.0), there


class CompressVein(Task):
    """Close the vein under a limit of force, or press firmly enough to know that a clot holds it.

    Half of the episodes have an occlusive clot (`info["clot"]`). The seventh number of the action
    says what the learner thinks: below -0.5 "it closes", above 0.5 "a clot", between "not yet".
    Saying ends the episode: +5 when right and shown (the vein below 10 % of its area, or held with
    12 N and more while above 30 %), +1 when right but not shown, -5 when wrong. Every step costs
    0.02, and 0.05 a newton above 18 N.
    """

    actions = 7
    clots = ("acute_occlusive", "subacute_occlusive", "chronic_occlusive")

    def __init__(self, count: int = 1, **words):
        super().__init__(count, **words)
        self.clot = np.zeros(count, bool)
        self.closed = np.zeros(count, bool)
        self.held = np.zeros(count, bool)

    def begin(self, i, rng):
        self.clot[i] = rng.integers(2)
        self.closed[i] = self.held[i] = False
        kind = self.clots[rng.integers(len(self.clots))] if self.clot[i] else "healthy"
        return {"pose": self.near(self.drawn_point(i, rng), 0.004, 0.1, rng), "pathology": kind,
                **self.tissue(rng)}

    def judge(self, i, action):
        ratio, force = self.see(i, "vein_ratio"), self.force_n(i)
        self.closed[i] |= ratio < 0.10
        self.held[i] |= ratio > 0.30 and force > 12
        reward = -0.02 - 0.05 * max(0.0, force - 18)
        if abs(action[6]) <= 0.5:
            return reward, False
        says_clot = action[6] > 0.5
        if says_clot != self.clot[i]:
            return reward - 5, True
        return reward + (5 if (self.held[i] if says_clot else self.closed[i]) else 1), True

    def info(self, i):
        return {**super().info(i), "clot": bool(self.clot[i]), "closed": bool(self.closed[i])}


class ThreePointExam(Task):
    """A whole examination by a protocol, judged as a trainee's; one environment.

    Observation besides: `target`, where the next place lies (m, in the probe's frame), and
    `firm_n`, the force that closes a healthy vein there. The seventh number of the action answers
    for the segment that waits: below -0.5 "compressible", above 0.5 "clot". Reward: 1 for every
    place that is examined, and a tenth of the score when the last segment has its answer.
    """

    actions = 7
    steps = 3000

    def __init__(self, count: int = 1, case: str | None = None, protocol: str | None = None,
                 **words):
        path = case if case is not None else sonde.cases()["healthy-lean"]
        leg = sonde.Leg.case(path, bundled=sonde.data_file("thigh.sonde"))
        super().__init__(count, legs=leg, **words)
        protocol = protocol if protocol is not None else sonde.protocols()["three_point"]
        self.exams = [sonde.Exam(leg, protocol) for _ in range(count)]
        self.places = self.exams[0].places
        self.done = np.zeros(count, int)
        self.bounds["target"] = (-5.0, 5.0, (3,), np.float32)
        self.bounds["firm_n"] = (0.0, 100.0, (1,), np.float32)

    def begin(self, i, rng):
        self.exams[i].restart()
        self.done[i] = 0
        return {"pose": self.near(self.places[0], 0.01, 0.2, rng)}

    def judge(self, i, action):
        exam = self.exams[i]
        exam.feed(self.batch, i)
        waits = exam.guidance()["undecided"]
        if waits is not None and abs(action[6]) > 0.5:
            exam.decide(waits, "clot" if action[6] > 0.5 else "compressible")
        segments = exam.segments().values()
        done = sum(s["done"] for s in segments)
        reward, self.done[i] = float(done - self.done[i]), done
        if all(s["decision"] for s in segments):
            return reward + 0.1 * exam.score()["score"], True
        return reward, False

    def observation(self, i):
        guide = self.exams[i].guidance()
        target = np.zeros(3)
        if guide["point"] is not None:
            away = np.array(self.places[guide["point"]]["pose"][:3]) - self.pose[i, :3]
            target = _turned(self.pose[i, 3:] * np.array([1, -1, -1, -1]), away)
        firm = guide["firm_n"] if np.isfinite(guide["firm_n"]) else 0.0
        return {**super().observation(i), "target": np.clip(target, -5, 5).astype(np.float32),
                "firm_n": np.array([np.clip(firm, 0, 100)], np.float32)}

    def info(self, i):
        return {**super().info(i), "segments": self.exams[i].segments()}


TASKS = (ReachVein, CompressVein, ThreePointExam)
