"""The tasks as environments, before Gymnasium's own checker. CMake adds this test where Gymnasium is at
hand: installed, or in ../shared/peers/python."""
import os
import sys
import tempfile
import unittest

import numpy as np

sys.path.append(os.path.join(os.environ["SONDE_SOURCE"], "..", "shared", "peers", "python"))
import gymnasium
import sonde.gym
from gymnasium.utils.env_checker import check_env

import one_place


class Gym(unittest.TestCase):
    def test_reach_passes_the_checker(self):
        check_env(gymnasium.make("sonde/ReachVein-v0", disable_env_checker=True).unwrapped)

    def test_compress_passes_the_checker(self):
        check_env(gymnasium.make("sonde/CompressVein-v0", images=False,
                                 disable_env_checker=True).unwrapped, skip_render_check=True)

    def test_an_exam_passes_the_checker(self):
        with tempfile.TemporaryDirectory() as folder:  # the checker makes the exam again
            env = gymnasium.make("sonde/ThreePointExam-v0", images=False, disable_env_checker=True,
                                 **one_place.write(folder)).unwrapped
            check_env(env, skip_render_check=True)

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


if __name__ == "__main__":
    unittest.main()
