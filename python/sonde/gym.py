"""Gymnasium environments; `import sonde.gym` registers them (docs/python.md).

    import gymnasium, sonde.gym
    env = gymnasium.make("sonde/CompressVein-v0")

`gymnasium.make` gives one probe on one leg, `gymnasium.make_vec` many at once: one batch, stepped
by all cores. A task holds what both share.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

import sonde

STEP_S = 0.04
SPEED_M_S = 0.05
TURN_RAD_S = 0.5
FORCE_MOST_N = 25.0
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


def _across(point: dict[str, Any], above_m: float) -> np.ndarray:
    """A pose of the probe straight above a point of the vein, its plane across the vein."""
    z = -np.array(point["normal"])
    x = np.array(point["across"])
    x = x - z * (x @ z)
    x /= np.linalg.norm(x)
    m = np.stack([x, np.cross(z, x), z], axis=1)
    w = np.sqrt(max(0.0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    if w > 1e-3:
        q = np.array([w, (m[2, 1] - m[1, 2]) / (4 * w), (m[0, 2] - m[2, 0]) / (4 * w),
                      (m[1, 0] - m[0, 1]) / (4 * w)])
    else:  # half a turn
        k = int(np.argmax(np.diag(m)))
        i, j = (k + 1) % 3, (k + 2) % 3
        v = np.zeros(3)
        v[k] = np.sqrt(max(0.0, 1 + m[k, k] - m[i, i] - m[j, j])) / 2
        v[i], v[j] = (m[i, k] + m[k, i]) / (4 * v[k]), (m[j, k] + m[k, j]) / (4 * v[k])
        q = np.concatenate([[(m[j, i] - m[i, j]) / (4 * v[k])], v])
    return np.concatenate([np.array(point["skin_m"]) - above_m * z, q / np.linalg.norm(q)])


class Task:
    """Probes on legs with a question: `count` environments of one batch.

    Action (6 numbers or more, each -1 to 1): speed along the face and along the leg (50 mm/s),
    normal force (0 to 25 N), turning about the probe's three axes (0.5 rad/s). Observation:
    `image` (64 x 64 grey values), `wrench` (N, N m on the probe, in its frame), `turn` (the
    probe's quaternion). Tissue, venous pressure and gain are drawn at every reset.
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
        parts: dict[str, spaces.Space] = {
            "wrench": spaces.Box(-200.0, 200.0, (6,), np.float32),
            "turn": spaces.Box(-1.0, 1.0, (4,), np.float32)}
        if images:
            parts["image"] = spaces.Box(0, 255, (IMAGE, IMAGE), np.uint8)
        self.observation_space = spaces.Dict(parts)
        self.action_space = spaces.Box(-1.0, 1.0, (self.actions,), np.float32)

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
        pose = _across(point, 0.003)
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

    def begin(self, i, rng):
        if not hasattr(self, "before"):
            self.before = np.full(self.count, np.nan)
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
        self.observation_space = spaces.Dict({
            **self.observation_space.spaces,
            "target": spaces.Box(-5.0, 5.0, (3,), np.float32),
            "firm_n": spaces.Box(0.0, 100.0, (1,), np.float32)})

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
            away = np.array(self.places[guide["point"]]["skin_m"]) - self.pose[i, :3]
            target = _turned(self.pose[i, 3:] * np.array([1, -1, -1, -1]), away)
        firm = guide["firm_n"] if np.isfinite(guide["firm_n"]) else 0.0
        return {**super().observation(i), "target": np.clip(target, -5, 5).astype(np.float32),
                "firm_n": np.array([np.clip(firm, 0, 100)], np.float32)}

    def info(self, i):
        return {**super().info(i), "segments": self.exams[i].segments()}


class SondeEnv(gymnasium.Env):
    """One environment of a task."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / STEP_S)}

    def __init__(self, task: type[Task], render_mode: str | None = None, **words: Any):
        self.task = task(count=1, threads=words.pop("threads", 1), **words)
        self.render_mode = render_mode
        self.action_space = self.task.action_space
        self.observation_space = self.task.observation_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self.task.reset(0, self.np_random)
        return self.task.observation(0), self.task.info(0)

    def step(self, action: np.ndarray):
        reward, over = self.task.step(np.asarray(action)[None], np.ones(1, bool))
        ended = bool(over[0])
        late = not ended and bool(self.task.left[0] <= 0)
        return self.task.observation(0), float(reward[0]), ended, late, self.task.info(0)

    def render(self):
        if self.render_mode != "rgb_array" or self.task.images is None:
            return None
        return np.repeat(self.task.images[0][:, :, None], 3, axis=2)


class SondeVectorEnv(gymnasium.vector.VectorEnv):
    """Many environments of a task in one batch. An episode that has ended begins anew in the next
    step, whose action for it does not count."""

    metadata = {"autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(self, task: type[Task], num_envs: int = 1, **words: Any):
        self.task = task(count=num_envs, **words)
        self.num_envs = num_envs
        self.single_action_space = self.task.action_space
        self.single_observation_space = self.task.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.ended = np.zeros(num_envs, bool)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        if seed is not None or not hasattr(self, "streams"):
            self.streams = [np.random.default_rng(s) for s in
                            self.np_random.integers(2**62, size=self.num_envs)]
        for i in range(self.num_envs):
            self.task.reset(i, self.streams[i])
        self.ended[:] = False
        return self._observations(), self._infos()

    def step(self, actions: np.ndarray):
        fresh = self.ended.copy()
        reward, over = self.task.step(actions, ~fresh)
        for i in np.flatnonzero(fresh):
            self.task.reset(int(i), self.streams[i])
        late = ~over & ~fresh & (self.task.left <= 0)
        self.ended = over | late
        return self._observations(), reward, over, late, self._infos()

    def _observations(self) -> dict[str, np.ndarray]:
        rows = [self.task.observation(i) for i in range(self.num_envs)]
        return {key: np.stack([row[key] for row in rows]) for key in rows[0]}

    def _infos(self) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for i in range(self.num_envs):
            infos = self._add_info(infos, self.task.info(i), i)
        return infos


for _task in (ReachVein, CompressVein, ThreePointExam):
    _name = f"sonde/{_task.__name__}-v0"
    if _name not in gymnasium.registry:
        gymnasium.register(id=_name, entry_point="sonde.gym:SondeEnv",
                           vector_entry_point="sonde.gym:SondeVectorEnv", kwargs={"task": _task})
