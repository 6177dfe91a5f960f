"""Gymnasium environments of the tasks in `sonde.tasks`; `import sonde.gym` registers them.

    import gymnasium, sonde.gym
    env = gymnasium.make("sonde/CompressVein-v0")

`gymnasium.make` gives one probe on one leg, `gymnasium.make_vec` many at once: one batch, stepped
by all cores.
"""
from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

from sonde.tasks import STEP_S, TASKS, Task


def _spaces(task: Task) -> tuple[spaces.Box, spaces.Dict]:
    """Of actions and observations."""
    seen = {name: spaces.Box(*bound) for name, bound in task.bounds.items()}
    return spaces.Box(-1.0, 1.0, (task.actions,), np.float32), spaces.Dict(seen)


class SondeEnv(gymnasium.Env):
    """One environment of a task."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / STEP_S)}

    def __init__(self, task: type[Task], render_mode: str | None = None, **words: Any):
        self.task = task(count=1, threads=words.pop("threads", 1), **words)
        self.render_mode = render_mode
        self.action_space, self.observation_space = _spaces(self.task)

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
        self.single_action_space, self.single_observation_space = _spaces(self.task)
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


for _task in TASKS:
    _name = f"sonde/{_task.__name__}-v0"
    if _name not in gymnasium.registry:
        gymnasium.register(id=_name, entry_point="sonde.gym:SondeEnv",
                           vector_entry_point="sonde.gym:SondeVectorEnv", kwargs={"task": _task})
