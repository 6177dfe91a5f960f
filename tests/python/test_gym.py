"""The environments before Gymnasium's own checker, and their laws. Gymnasium is not a package of Debian 12: without
it beside the sources, or installed, the test is skipped and says so."""
import os
import pathlib
import sys
import tempfile
import unittest

import numpy as np

SOURCE = os.environ["SONDE_SOURCE"]
sys.path.insert(0, os.path.join(SOURCE, "python", "examples"))
sys.path.append(os.path.join(SOURCE, "..", "shared", "peers", "python"))
try:
    import gymnasium
except ImportError:
    print("skipped: no gymnasium, neither installed nor in ../shared/peers/python")
    sys.exit(77)

import sonde
import sonde.gym
from gymnasium.utils.env_checker import check_env

CASE = """
sonde_case: 2
id: gym
title: A thigh for the test
level: first
history: Made for a test.
note: Made for a test.
thigh: bundled
truth:
  thrombosis: false
  diagnosis: No deep vein thrombosis
  segments: {common_femoral: compressible, femoral_proximal: compressible, femoral_mid: compressible,
    femoral_distal: compressible, popliteal: compressible}
"""
PROTOCOL = """
sonde_protocol: 1
id: one
title: One place
text: Made for a test.
places:
- title: Femoral vein
  text: Press.
  at: {segment: femoral_mid, share: 0.5}
"""


class Gym(unittest.TestCase):
    def test_reach_passes_the_checker(self):
        check_env(gymnasium.make("sonde/ReachVein-v0", disable_env_checker=True).unwrapped)

    def test_compress_passes_the_checker(self):
        check_env(gymnasium.make("sonde/CompressVein-v0", images=False,
                                 disable_env_checker=True).unwrapped, skip_render_check=True)

    def test_an_exam_passes_the_checker_and_can_be_won(self):
        with tempfile.TemporaryDirectory() as folder:
            case, protocol = os.path.join(folder, "gym.yaml"), os.path.join(folder, "one.yaml")
            pathlib.Path(case).write_text(CASE)
            pathlib.Path(protocol).write_text(PROTOCOL)
            env = gymnasium.make("sonde/ThreePointExam-v0", case=case, protocol=protocol,
                                 images=False, disable_env_checker=True).unwrapped
            check_env(env, skip_render_check=True)
        seen, _ = env.reset(seed=2)
        total, firm = 0.0, seen["firm_n"][0]
        over = False
        for k in range(160):  # above the place, pressed for three seconds, let go, answered
            action = np.zeros(7, np.float32)
            action[:2] = np.clip(seen["target"][:2] / 0.01, -1, 1)
            action[2] = 2 * (firm if 20 < k < 110 else 0.1) / 25 - 1
            action[6] = -1 if k > 140 else 0
            seen, reward, over, late, info = env.step(action)
            total += reward
            if over:
                break
        self.assertTrue(over)
        self.assertGreater(total, 8)  # a place, and a score of 70 and more

    def test_many_are_as_one(self):
        one = sonde.gym.ReachVein(count=1, images=False)
        many = sonde.gym.ReachVein(count=3, images=False)
        one.reset(0, np.random.default_rng(5))
        for i in range(3):
            many.reset(i, np.random.default_rng(5 if i == 1 else i))
        for k in range(6):
            action = np.array([0.2, 0.1, -0.6, 0, 0, 0.1])
            a, _ = one.step(action[None], np.ones(1, bool))
            b, _ = many.step(np.tile(action, (3, 1)), np.ones(3, bool))
            self.assertEqual(a[0], b[1])
        self.assertTrue(np.array_equal(one.wrench[0], many.wrench[1]))
        self.assertFalse(np.array_equal(one.wrench[0], many.wrench[0]))

    def test_vector_episodes_begin_anew(self):
        env = gymnasium.make_vec("sonde/CompressVein-v0", num_envs=2, images=False,
                                 vectorization_mode="vector_entry_point")
        env.reset(seed=1)
        action = np.zeros((2, 7), np.float32)
        action[0, 6] = 1  # the first one answers at once
        _, reward, over, _, info = env.step(action)
        self.assertEqual(over.tolist(), [True, False])
        self.assertTrue(reward[0] in (-5.02, 0.98))
        time_s = np.asarray(env.unwrapped.task.batch.time_s)
        _, reward, over, _, _ = env.step(action)
        self.assertEqual((reward[0], over[0]), (0, False))
        self.assertEqual(time_s[0], 0)
        self.assertGreater(time_s[1], 0.07)

    def test_the_learner_beats_chance(self):
        import learn_reach
        rows, random, scripted = learn_reach.main(pictures=(0, 120), episodes=8, count=4)
        self.assertGreater(rows[1][1], rows[0][1])
        self.assertGreaterEqual(scripted, rows[1][1])


if __name__ == "__main__":
    unittest.main()
